"""The engine without a window: keeps what a scenario should look like, shows nothing, and saves pictures."""

import os
from collections.abc import Callable
from typing import Any

from gamms.arguments import as_name
from gamms.errors import BadType, ContextTerminated
from gamms.ir.draw import DrawCommands
from gamms.typing import ArtistType, ColorType, IArtist, IContext
from gamms.visual.appearance import AgentData, GraphData
from gamms.visual.artist import Artist
from gamms.visual.color import PAPER
from gamms.visual.constants import Shape
from gamms.visual.drawers import render_agent, render_graph, render_obstacles, render_sensor
from gamms.visual.primitives import Primitives
from gamms.visual.undeclared import undeclared_artists

_OBSTACLES, _GRAPH, _AGENTS, _ARTISTS, _SENSORS = 5, 10, 20, 30, 40  # layers


class NoEngine(Primitives):
    """Takes every call of a windowed engine, and draws when a picture is asked for.

    Attributes:
        after_turn: called by `simulate`, in order.
    """

    def __init__(self, ctx: IContext, **kwargs: Any) -> None:  # noqa: ARG002 - options of other engines are no error
        super().__init__()
        self.ctx = ctx
        self._artists: dict[str, IArtist] = {}
        self._is_declared = False
        self.after_turn: list[Callable[[], None]] = []

    # -- what it looks like ----------------------------------------------------------------------------------

    def set_graph_visual(self, **kwargs: Any) -> Artist:
        """Declare how the graph looks: `node_color`, `node_size`, `edge_color`, `draw_id`."""
        look = _known(kwargs, "node_color", "node_size", "edge_color", "draw_id")
        artist = Artist(self.ctx, render_graph, _GRAPH)
        artist.set_artist_type(ArtistType.STATIC)
        artist.data = {"graph_data": GraphData(**look)}
        return self._declare("graph", artist)

    def set_obstacle_visual(self, **kwargs: Any) -> Artist:
        """Declare how obstacles look: `color_map` (type -> colour), `boundary_thickness` (world units)."""
        artist = Artist(self.ctx, render_obstacles, _OBSTACLES)
        artist.set_artist_type(ArtistType.STATIC)
        artist.data = {"color_map": {}, "boundary_thickness": 1.0}
        artist.data |= _known(kwargs, "color_map", "boundary_thickness")
        return self._declare("obstacles", artist)

    def set_agent_visual(self, name: str, **kwargs: Any) -> Artist:
        """Declare how an agent looks: `color`, `size` (world units), `image_path`; it need not exist yet."""
        look = AgentData(name, image=kwargs.get("image_path"), **_known(kwargs, "color", "size"))
        artist = Artist(self.ctx, render_agent, _AGENTS)
        artist.data = {"agent_data": look, "_alpha": 1.0}
        return self._declare(name, artist)

    def set_sensor_visual(self, name: str, **kwargs: Any) -> Artist:
        """Declare how a sensor's last view looks: `color`, `size`, or `node_color`, `edge_color`; `layer`."""
        artist = Artist(self.ctx, render_sensor, kwargs.get("layer", _SENSORS))
        artist.data = {"name": name, **_known(kwargs, "color", "size", "node_color", "edge_color")}
        return self._declare(f"sensor_{name}", artist)

    def _declare(self, name: str, artist: Artist) -> Artist:
        if not self.ctx.is_terminated():
            self._artists[as_name(name, "a visual")] = artist
            self._is_declared = True
        return artist

    def add_artist(self, name: str, artist: IArtist | dict[str, Any]) -> IArtist:
        """Draw an artist; one of that name is replaced.

        A dict becomes the `data` of a new artist; its keys `drawer` (or `shape`) and `layer` say how.

        Raises:
            BadType: neither an artist nor a dict.
        """
        if isinstance(artist, dict):
            artist = self._artist_of(artist)
        if not isinstance(artist, IArtist):
            raise BadType(f"Artist {name!r} must be an Artist or a dict, not {artist!r} ({type(artist).__name__}).")
        if not self.ctx.is_terminated():
            self._artists[as_name(name, "an artist")] = artist
        return artist

    def _artist_of(self, data: dict[str, Any]) -> Artist:
        drawer = data.get("drawer", data.get("shape", Shape.Circle))
        artist = Artist(self.ctx, drawer, data.get("layer", _ARTISTS))
        artist.data = data
        return artist

    def remove_artist(self, name: str) -> None:
        """Draw an artist no longer; a missing one is only warned about."""
        if self.ctx.is_terminated():
            return
        if self._artists.pop(name, None) is None:
            self.ctx.logger.warning("There is no artist named %r to remove.", name)

    # -- what a window would do ------------------------------------------------------------------------------

    def simulate(self) -> None:
        """Tell those who count turns that one is over; there is nobody to show it to."""
        for tell in self.after_turn:
            tell()

    def update(self) -> None:
        """Do nothing: there is no frame to draw."""

    def human_input(self, agent_name: str, state: dict[str, Any]) -> int | tuple[float, float, float]:  # noqa: ARG002 - nobody to ask
        """Stay: the agent's own node, or no movement for an agent that flies."""
        position: int | tuple[float, ...] = state["curr_pos"]
        return (0.0, 0.0, 0.0) if isinstance(position, tuple) else position

    def get_viewport(self) -> None:
        """None: nothing is shown."""
        return

    def terminate(self) -> None:
        """Close the room; there is nothing to release."""

    # -- pictures --------------------------------------------------------------------------------------------

    def draw_commands(self) -> DrawCommands:
        """The present state as draw commands.

        Where no visual was declared, the graph and the agents are drawn in a default look. A drawer that
        raises is logged, and the others draw on.

        Raises:
            ContextTerminated: the context has ended.
        """
        if self.ctx.is_terminated():
            raise ContextTerminated("the state to draw")
        artists = self._artists if self._is_declared else undeclared_artists(self.ctx) | self._artists
        from gamms.visual import picture

        with self._collecting() as commands:
            picture.paint(artists, commands, self.ctx.logger)
        return commands.freeze()

    def save(
        self,
        path: str | os.PathLike[str],
        width: int = 1280,
        height: int = 720,
        *,
        title: str = "",
        note: str = "",
        background: ColorType = PAPER,
        dpi: float = 96.0,
    ) -> None:
        """Save a picture of the present state; the suffix of `path` names the format (`.svg`, `.png`).

        Args:
            path: an existing file is replaced.
            width: pixels.
            height: pixels.
            title: a line above the picture.
            note: small print in its lower right corner; the source of the map is added to it.
            background: the colour behind everything.
            dpi: pixels per inch: how large the picture is on paper.

        Raises:
            BadValue: a size or dpi that is not positive, or a folder that does not exist.
            NotYet: a format that cannot be written.
            MissingExtra (ImportError): PNG needs pygame and Pillow, which are not installed.
            ContextTerminated: the context has ended.
        """
        from gamms.visual import picture

        sheet = picture.sheet(path, width, height, dpi)
        picture.write(
            sheet,
            self.draw_commands(),
            title=title,
            note=picture.with_attribution(note, getattr(self.ctx.graph, "attribution", None)),
            background=background,
        )


def _known(given: dict[str, Any], *names: str) -> dict[str, Any]:
    return {name: given[name] for name in names if name in given}
