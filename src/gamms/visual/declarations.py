"""What a scenario should look like: every visual that was declared, by name."""

from collections.abc import Mapping
from typing import Any

from gamms.arguments import as_name
from gamms.deciding import refused_while_deciding
from gamms.errors import BadType, BadValue
from gamms.text import shown
from gamms.typing import ArtistType, IArtist, IContext
from gamms.visual.appearance import AgentData, GraphData
from gamms.visual.artist import Artist
from gamms.visual.colormaps import Colorize
from gamms.visual.constants import Shape
from gamms.visual.described import artist_of, words_of
from gamms.visual.drawers import render_agent, render_graph, render_obstacles, render_sensor
from gamms.visual.layers import Layer
from gamms.visual.primitives import Primitives


class Declarations(Primitives):
    """The part of an engine that keeps what is declared; it draws nothing.

    Attributes:
        declarations: a number that changes whenever an artist is declared, added or removed.
    """

    def __init__(self, ctx: IContext) -> None:
        super().__init__(ctx)
        self._artists: dict[str, IArtist] = {}
        self._proposed: dict[str, IArtist] = {}
        self._is_declared = False
        self._is_replayed = False  # whether what was declared was declared elsewhere, where rules drew, too
        self.declarations = 0

    @refused_while_deciding
    def set_graph_visual(self, **kwargs: Any) -> Artist:
        """Declare how the graph looks: `node_color`, `node_size`, `edge_color`, `draw_id`."""
        look = _known(kwargs, "node_color", "node_size", "edge_color", "draw_id")
        artist = Artist(self.ctx, render_graph, Layer.GRAPH)
        artist.set_artist_type(ArtistType.STATIC)
        artist.data = {"graph_data": GraphData(**look)}
        return self._declare("graph", artist)

    @refused_while_deciding
    def set_obstacle_visual(self, **kwargs: Any) -> Artist:
        """Declare how obstacles look: `color_map` (type -> colour), `boundary_thickness` (world units), `fill`.

        Where `fill` is true, what walls stand around is filled: in the colour of its type in `color_map`, or else in
        a tone that says how high it is. Otherwise only the top edges of faces are drawn.
        """
        artist = Artist(self.ctx, render_obstacles, Layer.OBSTACLES)
        artist.set_artist_type(ArtistType.STATIC)
        artist.data = {"color_map": {}, "boundary_thickness": 1.0}
        artist.data |= _known(kwargs, "color_map", "boundary_thickness", "fill")
        return self._declare("obstacles", artist)

    @refused_while_deciding
    def set_agent_visual(self, name: str, **kwargs: Any) -> Artist:
        """Declare how an agent looks: `color`, `size` (world units), `image_path`; it need not exist yet."""
        look = AgentData(name, image=kwargs.get("image_path"), **_known(kwargs, "color", "size"))
        artist = Artist(self.ctx, render_agent, Layer.AGENTS)
        artist.data = {"agent_data": look, "_alpha": 1.0}
        return self._declare(name, artist)

    @refused_while_deciding
    def set_sensor_visual(self, name: str, **kwargs: Any) -> Artist:
        """Declare how a sensor's last view looks: `color`, `size`, or `node_color`, `edge_color`; `layer`."""
        artist = Artist(self.ctx, render_sensor, kwargs.get("layer", Layer.SENSORS))
        artist.data = {"name": name, **_known(kwargs, "color", "size", "node_color", "edge_color")}
        return self._declare(f"sensor_{name}", artist)

    @refused_while_deciding
    def set_values(
        self,
        *,
        nodes: Mapping[int, float] | None = None,
        edges: Mapping[int, float] | None = None,
        cmap: str | Colorize = "viridis",
        vmin: float | None = None,
        vmax: float | None = None,
        name: str = "values",
    ) -> Artist | None:
        """Show a value of each node, or of each edge, as a colour, and explain the colours in a legend.

        Calling it again replaces what was shown under that name; with neither nodes nor edges it is shown no longer.

        Args:
            nodes: id -> value. One that is NaN, or not there, leaves the node as it is.
            edges: the same for edges; the higher value is on top where two edges share a street.
            cmap: "viridis", "magma", "cividis" or "diverging" (palest at 0, unless `vmin` or `vmax` is given), or a
                function from a value to a colour.
            vmin: what has the first colour, and all below it; default: the lowest value.
            vmax: what has the last colour, and all above it; default: the highest value.
            name: of the artist; another than "values" is the title of the legend.

        Returns:
            The artist, on layer `Layer.VALUES`; None where nothing is shown.

        Raises:
            UnknownName (KeyError): no such node, edge or colour map.
            BadType, BadValue: no mapping to numbers, both nodes and edges, or `vmin` not below `vmax`.
        """
        from gamms.visual import values
        from gamms.visual.drawers.values import render_values

        as_name(name, "values")
        if nodes is not None and edges is not None:
            raise BadValue("Give nodes or edges; a second call with another name shows both.")
        if self.ctx.is_terminated():
            return None
        given = edges if nodes is None else nodes
        if given is None:
            self._artists.pop(name, None)
            return None
        columns = self.ctx.graph.columns()
        of, known = ("edges", columns.edge_ids) if nodes is None else ("nodes", columns.node_ids)
        artist = Artist(self.ctx, render_values, Layer.VALUES)
        title = "" if name == "values" else name
        shown = values.checked(of, given, known, cmap, (vmin, vmax), title)
        artist.data = {"values": shown, "legend": shown.legend}
        self._artists[name] = artist
        return artist

    def _declare(self, name: str, artist: Artist) -> Artist:
        if not self.ctx.is_terminated():
            self._artists[as_name(name, "a visual")] = artist
            self._is_declared = True
            self.declarations += 1
        return artist

    @refused_while_deciding
    def add_artist(self, name: str, artist: IArtist | dict[str, Any]) -> IArtist:
        """Draw an artist; one of that name is replaced.

        A dict becomes the `data` of a new artist; its keys `drawer` (or `shape`) and `layer` say how.

        Raises:
            BadType: neither an artist nor a dict.
        """
        if isinstance(artist, dict):
            artist = self._artist_of(artist)
        if not isinstance(artist, IArtist):
            raise BadType(
                f"Artist {shown(name)} must be an Artist or a dict, not {shown(artist)} ({type(artist).__name__})."
            )
        if not self.ctx.is_terminated():
            self._artists[as_name(name, "an artist")] = artist
            self.declarations += 1
        return artist

    @refused_while_deciding
    def propose_artist(self, name: str, artist: dict[str, Any]) -> None:
        """Draw an artist unless there is one of that name: for who has no say against the caller, such as a rule."""
        if name not in self._artists:
            self._proposed[name] = self.add_artist(name, artist)

    @refused_while_deciding
    def withdraw_artist(self, name: str) -> None:
        """Remove the artist that was proposed by this name, unless another has taken its place."""
        artist = self._proposed.pop(name, None)
        if artist is not None and self._artists.get(name) is artist:
            self.remove_artist(name)

    def artist(self, name: str) -> IArtist | None:
        """Return the artist that was declared or added under a name; None if there is none."""
        return self._artists.get(name)

    def _artist_of(self, data: dict[str, Any]) -> Artist:
        drawer = data.get("drawer", data.get("shape", Shape.Circle))
        artist = Artist(self.ctx, drawer, data.get("layer", Layer.ARTISTS))
        artist.data = data
        return artist

    @refused_while_deciding
    def remove_artist(self, name: str) -> None:
        """Draw an artist no longer; a missing one is only warned about."""
        if self.ctx.is_terminated():
            return
        self.declarations += 1
        if self._artists.pop(name, None) is None:
            self.ctx.logger.warning("There is no artist named %r to remove.", name)

    def described(self) -> dict[str, Any]:
        """What it looks like, in words: the `artists` whose drawers are ours, and whether visuals were declared."""
        artists = [words_of(name, artist) for name, artist in self._artists.items()]
        return {"artists": [one for one in artists if one is not None], "is_declared": self._is_declared}

    @refused_while_deciding
    def show(self, described: dict[str, Any], own: frozenset[str] = frozenset()) -> frozenset[str]:
        """Add the artists that `described` told, but for those whose names are taken.

        Args:
            described: of this or another context.
            own: what an earlier call gave, whose artists are replaced.

        Returns:
            The names of the artists that were added.

        Raises:
            KeyError, BadType (TypeError), TypeError: nobody told this; nothing has changed.
        """
        made = {as_name(one["name"], "an artist"): artist_of(self.ctx, one) for one in described["artists"]}
        is_declared = bool(described["is_declared"])
        if self.ctx.is_terminated():
            return own
        for name in own:
            self._artists.pop(name, None)
        new = {name: one for name, one in made.items() if one is not None and name not in self._artists}
        self._artists |= new
        self._is_declared |= is_declared
        self._is_replayed = True
        self.declarations += 1
        return frozenset(new)


def _known(given: dict[str, Any], *names: str) -> dict[str, Any]:
    return {name: given[name] for name in names if name in given}
