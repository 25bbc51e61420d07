"""Artists by name: declared with keywords, added by the caller, or made from the specs of a recording."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple, Unpack, cast

from gamms.arguments import as_declared, as_int, as_key, as_name, misspelt
from gamms.deciding import Guarded, Protected, outside_of_deciding, phase_of, refused_while_deciding
from gamms.errors import BadType, BadValue, ContextTerminated, UnknownName
from gamms.text import as_text, shown
from gamms.typing import ArtistType, IArtist, IContext
from gamms.typing.visualization_engine import (
    AgentVisual,
    Drawer,
    GraphVisual,
    IVisualizationEngine,
    ObstacleVisual,
    SensorVisual,
)
from gamms.visual.appearance import AgentData, AnyColor, Circle, Colorize, GraphData, Rectangle, Rgb, rgba
from gamms.visual.artist import Artist, data_of, looks_of
from gamms.visual.constants import Layer, Shape
from gamms.visual.drawers import (
    render_agent,
    render_circle,
    render_graph,
    render_input_overlay,
    render_obstacles,
    render_rectangle,
    render_sensor,
)
from gamms.visual.drawers.agents import render_looks
from gamms.visual.drawers.graph import render_base_map
from gamms.visual.drawers.marks import render_eliminated, render_tags, rows_of_eliminated
from gamms.visual.drawers.messages import render_messages
from gamms.visual.drawers.rules import FlagsDrawer, TerritoryDrawer, render_goals, teams_of_rules
from gamms.visual.drawers.standings import render_amounts, render_cooldowns, render_discovered, render_held
from gamms.visual.drawers.streets import render_tunnels
from gamms.visual.drawing import Drawing
from gamms.visual.legend import legend_only
from gamms.visual.recorded_drawings import RecordedDrawer, RecordedDrawings
from gamms.visual.themes import Theme

if TYPE_CHECKING:
    from gamms.visual.default_scene import DefaultScene
    from gamms.visual.fog import Fog

_Data = dict[str, Any]
_NONE: Mapping[str, IArtist] = MappingProxyType({})


class _Kind(NamedTuple):
    """A built-in drawer, and the keywords that describe its artists."""

    drawer: Drawer | type  # a class: a drawer made from the keywords
    names: tuple[str, ...]  # of the keywords
    keywords_of: Callable[[_Data], _Data]  # may have more, and may raise where the data are the caller's
    data_of: Callable[[_Data], _Data]
    is_static: bool = False
    is_shape: bool = False  # whose data are the program's own, so that they may change at any time


def _of_shape(kind: type) -> Callable[[_Data], _Data]:
    return lambda data: next((value.__dict__ for value in data.values() if isinstance(value, kind)), data)


_KINDS = {
    "graph": _Kind(
        render_graph,
        ("node_color", "node_size", "edge_color", "draw_id"),
        lambda data: data["graph_data"].__dict__,
        lambda given: {"graph_data": GraphData(**given)},
        is_static=True,
    ),
    "obstacles": _Kind(render_obstacles, ("color_map", "boundary_thickness", "fill"), dict, dict, is_static=True),
    "agent": _Kind(
        render_agent,
        ("name", "color", "size"),
        lambda data: data["agent_data"].given(),
        lambda given: {"agent_data": AgentData.declared(**given), "_alpha": 1.0},
    ),
    "sensor": _Kind(render_sensor, ("name", "color", "size", "node_color", "node_size", "edge_color"), dict, dict),
    "circle": _Kind(render_circle, ("x", "y", "radius", "scale", "color"), _of_shape(Circle), dict, is_shape=True),
    "rectangle": _Kind(
        render_rectangle, ("x", "y", "width", "height", "color"), _of_shape(Rectangle), dict, is_shape=True
    ),
    "flags": _Kind(FlagsDrawer, ("key", "colors"), dict, dict),
    "territory": _Kind(TerritoryDrawer, ("key", "colors"), dict, dict),
    "tags": _Kind(render_tags, (), dict, dict),
    "goals": _Kind(render_goals, (), dict, dict),
    "held": _Kind(render_held, (), dict, dict),
    "discovered": _Kind(render_discovered, (), dict, dict),
    "resources": _Kind(render_amounts, (), dict, dict),
    "cooldowns": _Kind(render_cooldowns, (), dict, dict),
}
_NAME_OF = {kind.drawer: name for name, kind in _KINDS.items()}
_KEYWORDS = {  # of `set_…_visual`
    "graph": GraphVisual.__optional_keys__,
    "obstacles": ObstacleVisual.__optional_keys__,
    "agent": AgentVisual.__optional_keys__,
    "sensor": SensorVisual.__optional_keys__,
}
_GROUND = (  # drawers of map, agents, messages and what sensors see
    render_graph,
    render_base_map,
    render_tunnels,
    render_obstacles,
    render_agent,
    render_looks,
    render_sensor,
    render_messages,
    render_input_overlay,
    legend_only,
)
_DRAWING = "drawing"  # the kind of an artist whose commands are recorded


def _kind_of(artist: IArtist) -> str | None:
    """Return the kind of an artist with a built-in drawer; None of any other."""
    drawer = artist.get_drawer()
    try:
        return _NAME_OF.get(drawer) or _NAME_OF.get(type(drawer))  # type: ignore[arg-type]  # None is in no table
    except TypeError:  # a drawer that is not hashable
        return None


def spec_of(name: str, artist: IArtist) -> dict[str, Any] | None:
    """Describe an artist: `name`, `kind`, `keywords`, `layer`, `visible`; None unless its drawer is built in."""
    kind = _kind_of(artist)
    if kind is None:
        return None
    try:
        drawer: Any = artist.get_drawer()
        given = drawer.keywords if isinstance(_KINDS[kind].drawer, type) else _KINDS[kind].keywords_of(artist.data)
        keywords = {key: given[key] for key in _KINDS[kind].names if key in given}
    except (KeyError, TypeError, ValueError, AttributeError):  # data of the caller's own, which do not draw, either
        return None
    return _spec(name, kind, keywords, artist)


def _spec(name: str, kind: str, keywords: _Data, artist: IArtist) -> _Data:
    layer, visible = artist.get_layer(), artist.get_visible()
    return {"name": name, "kind": kind, "keywords": keywords, "layer": layer, "visible": visible}


def artist_of(ctx: IContext, spec: dict[str, Any]) -> Artist | None:
    """Make an artist from its spec; None if it is of an unknown kind.

    Raises:
        KeyError, BadType, TypeError: this is no spec.
    """
    kind = _KINDS.get(spec["kind"])
    if kind is None:
        return None
    if not isinstance(spec["keywords"], dict):
        raise BadType(f"The keywords of artist {shown(spec['name'])} must be a dict, not {shown(spec['keywords'])}.")
    keywords = {key: value for key, value in spec["keywords"].items() if key in kind.names}
    drawer = kind.drawer(**keywords) if isinstance(kind.drawer, type) else kind.drawer
    artist = Artist(ctx, drawer, spec["layer"])
    artist.data = kind.data_of(keywords)
    artist.set_visible(spec["visible"])
    if kind.is_static:
        artist.set_artist_type(ArtistType.STATIC)
    return artist


class Artists(Guarded):
    """The artists of a context by name: those that were declared or added, and those of the default scene.

    Args:
        ctx: the context.
        drawing: what they draw with.

    Attributes:
        declared: every artist that was declared or added.
        is_graph_declared: whether the graph was, so that there is no default scene.
        edits: a number that changes whenever an artist is declared, added or removed.
        drawings: those of a recording that is replayed.
        fog: what a team knows, beyond which nothing is shown; None: all is.
    """

    _called = "ctx.visual"

    declared: Protected[dict[str, IArtist]] = Protected(dict)

    def __init__(self, ctx: IContext, drawing: Drawing) -> None:
        self._phase = phase_of(ctx)
        self._ctx, self._drawing = ctx, drawing
        self._own_colors: dict[str, Rgb] = {}  # of teams, but for those of a recording
        self.declared = {}
        self._proposed: dict[str, IArtist] = {}
        self.is_graph_declared = False
        self._is_replayed = False  # what is declared is from a recording, where rules drew, too
        self._default: dict[Theme, DefaultScene] = {}
        self.edits = 0
        self.drawings = RecordedDrawings(ctx)
        self.fog: Fog | None = None
        self._drawn: tuple[Any, dict[str, IArtist]] = None, {}  # what `drawn` has found, and by which edits

    # -- shown -----------------------------------------------------------------------------------------------

    @outside_of_deciding
    def shown(
        self, trails: int = 0, scene: "DefaultScene | None" = None, *, sensors: bool = True
    ) -> dict[str, IArtist]:
        """Return the artists that draw: the declared ones, and those of the default scene that they do not replace.

        Args:
            trails: of how many turns the ways of agents are shown, besides.
            scene: the default one; None: that of pictures, in the theme of the drawing.
            sensors: whether those of what sensors see are among them.

        Raises:
            ContextTerminated: the context has ended.
        """
        if self._ctx.is_terminated():
            raise ContextTerminated("the state to draw")
        artists = self._of_default(scene, sensors=sensors) | self.declared
        self._drawing.has_default_look = not self.is_graph_declared
        if self.fog is not None:
            artists = self.fog.filtered(artists)
        if not sensors:
            artists = {
                name: one for name, one in artists.items() if name not in ("rings", "sights") and name[:7] != "sensor_"
            }
        if trails:
            from gamms.visual.drawers.trails import artists_of_trails

            artists |= artists_of_trails(self._ctx, artists, trails)
        return self._eliminated(artists) | artists

    def signs(self) -> dict[str, IArtist]:
        """Return the artists that draw but for those of map, agents, messages and what sensors see, by name."""
        artists = self.shown(sensors=False)
        return {name: one for name, one in artists.items() if one.get_drawer() not in _GROUND}

    def _eliminated(self, artists: Mapping[str, IArtist]) -> dict[str, IArtist]:
        """Return the artist that marks agents that are out; marks stand beside the largest disc of these artists."""
        looks = list(looks_of(artists))
        colors, size = {look.name: look.color for look in looks}, max((look.size for look in looks), default=0.0)
        out = {name: has_arrived for name, has_arrived in self._drawing.events.out().items() if name in colors}
        tags = artists.get("tags")
        if tags is not None and (self.fog is not None or tags.get_drawer() is render_tags):
            data_of(tags).update(size=size, out=out)
        if not out:
            return {}
        marks = Artist(self._ctx, render_eliminated, Layer.TAGS)
        marks.data = {"colors": colors, "out": out, "size": size, "legend": rows_of_eliminated(out)}
        return {"eliminated": marks}

    def _of_default(self, scene: "DefaultScene | None", *, sensors: bool) -> dict[str, IArtist]:
        """Return the default scene unless the graph was declared; in a replay of such a game, what its rules drew."""
        if self.is_graph_declared and not self._is_replayed:
            return {}
        if scene is None:
            from gamms.visual.default_scene import DefaultScene

            theme = self._drawing.theme
            scene = self._default[theme] = self._default.get(theme) or DefaultScene(self._ctx, theme)
        return scene.of_rules() if self.is_graph_declared else scene.artists(self.declared, sensors=sensors)

    # -- declared --------------------------------------------------------------------------------------------

    @property
    def team_colors(self) -> Mapping[str, Rgb]:
        """The colours that were declared, by the text of their teams."""
        return MappingProxyType(dict(self._drawing.team_colors))

    @team_colors.setter
    def team_colors(self, colors: Mapping[Any, AnyColor]) -> None:
        """Give teams, and agents without one by their names, other colours than the usual ones.

        Raises:
            BadType, BadValue: no mapping, or a colour that is none.
            UnknownName (KeyError): no agent, flag or territory is of that team.
        """
        checked, known = _checked_colors(colors), {*self._drawing.group_colors(), *teams_of_rules(self._ctx)}
        for team in checked:
            if team not in known:
                raise UnknownName("team", team, sorted(known))
        self._own_colors = self._drawing.team_colors = checked
        self.edits += 1

    @refused_while_deciding
    @as_declared(IVisualizationEngine.set_graph_visual)
    def set_graph_visual(self, **kwargs: Unpack[GraphVisual]) -> Artist:
        """Declare how the graph looks; the contract explains the keywords."""
        self._declare_graph(is_declared=not self._ctx.is_terminated())
        return self._declare("graph", self._made("graph", {**kwargs}, Layer.GRAPH))

    def _declare_graph(self, *, is_declared: bool) -> None:
        """Note that the graph was declared: what the default scene has filled in is as in 1.0.0 again."""
        if is_declared and not self.is_graph_declared:
            self.is_graph_declared = True
            for look in looks_of(self.declared):
                look.fill(AgentData(look.name))
            for artist in self.declared.values():
                if artist.get_drawer() is render_sensor:
                    data_of(artist).pop("_defaults", None)

    @refused_while_deciding
    @as_declared(IVisualizationEngine.set_obstacle_visual)
    def set_obstacle_visual(self, **kwargs: Unpack[ObstacleVisual]) -> Artist:
        """Declare how obstacles look; the contract explains the keywords."""
        keywords = {"color_map": {}, "boundary_thickness": 1.0, **kwargs}
        return self._declare("obstacles", self._made("obstacles", keywords, Layer.OBSTACLES))

    @refused_while_deciding
    @as_declared(IVisualizationEngine.set_agent_visual)
    def set_agent_visual(self, name: str, **kwargs: Unpack[AgentVisual]) -> Artist:
        """Declare how an agent looks; the contract explains the keywords."""
        artist = self._made("agent", {**kwargs, "name": name}, Layer.AGENTS)
        artist.data["agent_data"].image = kwargs.get("image_path")
        return self._declare(name, artist)

    @refused_while_deciding
    @as_declared(IVisualizationEngine.set_sensor_visual)
    def set_sensor_visual(self, name: str, **kwargs: Unpack[SensorVisual]) -> Artist:
        """Declare how a sensor's last view looks; the contract explains the keywords."""
        artist = self._made("sensor", {**kwargs, "name": name}, kwargs.get("layer", Layer.SENSORS))
        return self._declare(f"sensor_{as_name(name, 'a sensor')}", artist)

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
            The artist, on layer 13; None where nothing is shown.

        Raises:
            UnknownName (KeyError): no such node, edge or colour map.
            BadType, BadValue: no mapping to numbers, both nodes and edges, or `vmin` not below `vmax`.
        """
        from gamms.visual.drawers.graph import render_values
        from gamms.visual.legend import checked

        as_name(name, "values")
        if nodes is not None and edges is not None:
            raise BadValue("Give nodes or edges; a second call with another name shows both.")
        if self._ctx.is_terminated():
            return None
        given = edges if nodes is None else nodes
        if given is None or name not in self.declared:
            self.edits += 1
        if given is None:
            self.declared.pop(name, None)
            return None
        columns = self._ctx.graph.columns()
        of, known = ("edges", columns.edge_ids) if nodes is None else ("nodes", columns.node_ids)
        artist = Artist(self._ctx, render_values, Layer.VALUES)
        title = "" if name == "values" else name
        shown = checked(of, given, known, cmap, (vmin, vmax), title)
        artist.data = {"values": shown, "legend": shown.legend}
        self.declared[name] = artist
        return artist

    def _made(self, kind: str, keywords: _Data, layer: int) -> Artist:
        for hint in misspelt(keywords, sorted(_KEYWORDS[kind])):
            self._ctx.logger.warning(
                f"Visual {shown(keywords.get('name', kind))}: {hint} It is left to drawers of your own."
            )
        spec = {"name": kind, "kind": kind, "keywords": keywords, "layer": layer, "visible": True}
        return cast("Artist", artist_of(self._ctx, spec))

    def _declare(self, name: str, artist: Artist) -> Artist:
        if not self._ctx.is_terminated():
            self.declared[as_name(name, "a visual")] = artist
            self.edits += 1
        return artist

    @refused_while_deciding
    @as_declared(IVisualizationEngine.add_artist)
    def add_artist(self, name: str, artist: IArtist | dict[str, Any]) -> IArtist:
        """Draw an artist; the contract explains the arguments."""
        if isinstance(artist, dict):
            artist = self._artist_of(artist)
        if not isinstance(artist, IArtist):
            raise BadType(
                f"Artist {shown(name)} must be an Artist or a dict, not {shown(artist)} ({type(artist).__name__})."
            )
        if not self._ctx.is_terminated():
            self.declared[as_name(name, "an artist")] = artist
            self.edits += 1
        return artist

    @refused_while_deciding
    def propose(self, name: str, artist: dict[str, Any]) -> None:
        """Draw an artist in place of the one that was proposed by that name; one of the caller's stays."""
        known = self.declared.get(name)
        if known is None or known is self._proposed.get(name):
            self._proposed[name] = self.add_artist(name, artist)

    @refused_while_deciding
    def withdraw(self, name: str) -> None:
        """Remove the artist that was proposed by this name, unless another has taken its place."""
        artist = self._proposed.pop(name, None)
        if artist is not None and self.declared.get(name) is artist:
            self.remove_artist(name)

    def get(self, name: str) -> IArtist | None:
        """Return the artist that was declared or added under a name; None if there is none."""
        return self.declared.get(as_key(name, "The name of an artist"))

    def _artist_of(self, data: dict[str, Any]) -> Artist:
        drawer = data.get("drawer", data.get("shape", Shape.Circle))
        artist = Artist(self._ctx, drawer, data.get("layer", Layer.ARTISTS))
        artist.data = data
        return artist

    @refused_while_deciding
    def remove_artist(self, name: str) -> None:
        """Draw an artist no longer; a missing one is only warned about."""
        if self._ctx.is_terminated():
            return
        self.edits += 1
        if self.declared.pop(as_key(name, "The name of an artist"), None) is None:
            self._ctx.logger.warning(f"There is no artist named {shown(name)} to remove.")

    # -- recorded --------------------------------------------------------------------------------------------

    def specs(self, *, with_drawings: bool = False) -> dict[str, Any]:
        """Describe the `artists` of built-in drawers as plain values; colours of teams; and if the graph was declared.

        With drawings, the artists of other drawers and shapes are in their places, for what they draw is recorded.
        """
        drawn, artists = self.drawn(with_custom=with_drawings), list[Any]()
        for name, artist in self.declared.items():
            if name in drawn:
                keywords = {"is_static": artist.get_artist_type() is ArtistType.STATIC}
                artists.append(_spec(name, _DRAWING, keywords, artist))
            else:
                artists.append(spec_of(name, artist))
        specs = {"artists": [one for one in artists if one is not None], "is_declared": self.is_graph_declared}
        return specs | ({"team_colors": dict(self.team_colors)} if self.team_colors else {})

    def drawn(self, *, with_custom: bool) -> dict[str, IArtist]:
        """Return the artists whose draw commands are recorded: those of a replay, and with custom drawers, by name."""
        key = self.edits, Artist.edits, with_custom
        if self._drawn[0] != key:
            self._drawn = key, {name: one for name, one in self.declared.items() if _is_drawn(one, with_custom)}
        return self._drawn[1]

    def recorded_drawings(self, *, with_custom: bool) -> dict[str, dict[str, Any]]:
        """Return what artists draw at present as plain values, by name; see `drawn`."""
        return {name: self.drawings.recorded(name, one) for name, one in self.drawn(with_custom=with_custom).items()}

    @refused_while_deciding
    def add_drawing(self, recorded: dict[str, Any]) -> None:
        """Show what was recorded of an artist that the recording has declared; else do nothing.

        Raises:
            BadType, BadValue, KeyError: this is no recorded drawing; nothing has changed.
        """
        artist = self.declared.get(recorded["artist"])
        if artist is None or not isinstance(artist.get_drawer(), RecordedDrawer):
            return
        layer, visible = as_int(recorded["layer"], "The layer of an artist"), bool(recorded["visible"])
        self.drawings.put(recorded)
        if (layer, visible) != (artist.get_layer(), artist.get_visible()):
            artist.set_layer(layer)
            artist.set_visible(visible)

    def end_turn(self) -> None:
        """Show drawings of a recording no longer where a turn was played, and not replayed."""
        if self.drawings.commands and not getattr(self._ctx.record, "is_replaying", False):
            self.drawings.clear()

    def _drawing_of(self, spec: dict[str, Any]) -> Artist:
        """Make an artist that draws what is recorded."""
        drawer = RecordedDrawer(self.drawings, spec["name"])
        artist = Artist(self._ctx, drawer, spec["layer"])
        artist.data = {"legend": drawer.legend}
        artist.set_visible(spec["visible"])
        if spec["keywords"].get("is_static"):
            artist.set_artist_type(ArtistType.STATIC)
        return artist

    @refused_while_deciding
    def add_specs(self, specs: dict[str, Any], own: Mapping[str, IArtist] = _NONE) -> Mapping[str, IArtist]:
        """Add the artists that `specs` describe, but for those whose names are taken.

        Args:
            specs: of this or another context.
            own: the result of an earlier call, whose artists are replaced.

        Returns:
            The artists that were added.

        Raises:
            KeyError, BadType (TypeError), TypeError: these are no specs; nothing has changed.
        """
        made = {
            as_name(one["name"], "an artist"): (
                self._drawing_of(one) if one["kind"] == _DRAWING else artist_of(self._ctx, one)
            )
            for one in specs["artists"]
        }
        is_declared, colors = bool(specs["is_declared"]), _checked_colors(specs.get("team_colors", {}))
        if self._ctx.is_terminated():
            return own
        for name, artist in own.items():
            if self.declared.get(name) is artist:
                del self.declared[name]
        new = {name: one for name, one in made.items() if one is not None and name not in self.declared}
        self.declared |= new
        self._declare_graph(is_declared=is_declared)
        self._drawing.team_colors = colors | self._own_colors
        self._is_replayed = True
        self.edits += 1
        return new


def _checked_colors(colors: object) -> dict[str, Rgb]:
    """Return colours by the text of their teams.

    Raises:
        BadType, BadValue: they are none.
    """
    if not isinstance(colors, Mapping):
        raise BadType(f"team_colors must be a mapping from teams to colours, not {shown(colors)}.")
    checked: dict[str, Rgb] = {}
    for team, color in colors.items():
        try:
            checked[as_text(team)] = rgba(color)[:3]
        except (BadType, BadValue) as error:
            raise type(error)(f"The colour of team {shown(team)}: {error}") from None
    return checked


def _is_drawn(artist: IArtist, with_custom: bool) -> bool:
    """Return whether the draw commands of an artist are recorded."""
    if isinstance(artist.get_drawer(), RecordedDrawer):
        return True
    kind = _kind_of(artist)
    return with_custom and artist.get_drawer() is not render_input_overlay and (kind is None or _KINDS[kind].is_shape)
