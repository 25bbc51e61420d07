"""Artists by name: declared by keywords, added by callers, or created from the specs of a recording."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple, Unpack, cast

from gamms.arguments import as_declared, as_int, as_key, as_name, explain_misspelled
from gamms.deciding import ContextPart, Protected, get_phase, lift_decide_phase, refuse_while_deciding
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
from gamms.visual.appearance import AgentData, AnyColor, Circle, Colorize, GraphData, Rectangle, Rgb, parse_color
from gamms.visual.artist import Artist, get_data, list_looks
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
from gamms.visual.drawers.agents import render_looks, render_past_trails, render_trails
from gamms.visual.drawers.graph import render_base_map
from gamms.visual.drawers.marks import make_elimination_rows, render_eliminated, render_tags
from gamms.visual.drawers.messages import render_messages
from gamms.visual.drawers.rules import FlagsDrawer, TerritoryDrawer, find_teams_of_rules, render_goals
from gamms.visual.drawers.standings import (
    render_amounts,
    render_cooldowns,
    render_discovered,
    render_doing,
    render_held,
)
from gamms.visual.drawers.streets import render_tunnels
from gamms.visual.drawing import Drawing, get_drawing
from gamms.visual.legend import draw_nothing
from gamms.visual.recorded_drawings import RecordedDrawer, RecordedDrawings
from gamms.visual.themes import Theme

if TYPE_CHECKING:
    from gamms.visual.default_scene import DefaultScene
    from gamms.visual.fog import Fog

_Data = dict[str, Any]
_NONE: Mapping[str, IArtist] = MappingProxyType({})


class _ArtistKind(NamedTuple):
    """A kind of built-in artist: its drawer, and the keywords that describe it."""

    drawer: Drawer | type  # a class: the drawer is an object made from the keywords
    names: tuple[str, ...]  # of the keywords
    keywords_of: Callable[[_Data], _Data]  # may return more keys, and may raise for data of callers
    data_of: Callable[[_Data], _Data]
    is_static: bool = False
    is_shape: bool = False  # its data belong to the program, and may change at any time


def _make_shape_factory(kind: type) -> Callable[[_Data], _Data]:
    return lambda data: next((value.__dict__ for value in data.values() if isinstance(value, kind)), data)


_KINDS = {
    "graph": _ArtistKind(
        render_graph,
        ("node_color", "node_size", "edge_color", "draw_id"),
        lambda data: data["graph_data"].__dict__,
        lambda given: {"graph_data": GraphData(**given)},
        is_static=True,
    ),
    "obstacles": _ArtistKind(render_obstacles, ("color_map", "boundary_thickness", "fill"), dict, dict, is_static=True),
    "agent": _ArtistKind(
        render_agent,
        ("name", "color", "size"),
        lambda data: data["agent_data"].given(),
        lambda given: {"agent_data": AgentData.declared(**given), "_alpha": 1.0},
    ),
    "sensor": _ArtistKind(
        render_sensor, ("name", "color", "size", "node_color", "node_size", "edge_color"), dict, dict
    ),
    "circle": _ArtistKind(
        render_circle, ("x", "y", "radius", "scale", "color"), _make_shape_factory(Circle), dict, is_shape=True
    ),
    "rectangle": _ArtistKind(
        render_rectangle, ("x", "y", "width", "height", "color"), _make_shape_factory(Rectangle), dict, is_shape=True
    ),
    "flags": _ArtistKind(FlagsDrawer, ("key", "colors"), dict, dict),
    "territory": _ArtistKind(TerritoryDrawer, ("key", "colors"), dict, dict),
    "tags": _ArtistKind(render_tags, (), dict, dict),
    "goals": _ArtistKind(render_goals, (), dict, dict),
    "held": _ArtistKind(render_held, (), dict, dict),
    "discovered": _ArtistKind(render_discovered, (), dict, dict),
    "resources": _ArtistKind(render_amounts, (), dict, dict),
    "cooldowns": _ArtistKind(render_cooldowns, (), dict, dict),
    "doing": _ArtistKind(render_doing, (), dict, dict),
}
_NAME_OF = {kind.drawer: name for name, kind in _KINDS.items()}
_KEYWORDS = {  # keywords of `set_…_visual`
    "graph": GraphVisual.__optional_keys__,
    "obstacles": ObstacleVisual.__optional_keys__,
    "agent": AgentVisual.__optional_keys__,
    "sensor": SensorVisual.__optional_keys__,
}
_GROUND = (  # drawers of map, agents, messages and sensor views
    render_graph,
    render_base_map,
    render_tunnels,
    render_obstacles,
    render_agent,
    render_looks,
    render_sensor,
    render_messages,
    render_input_overlay,
    draw_nothing,
)
_DRAWING = "drawing"  # kind of an artist whose commands are recorded


def _find_kind(artist: IArtist) -> str | None:
    """Return the kind of an artist with a built-in drawer; None for others."""
    drawer = artist.get_drawer()
    try:
        return _NAME_OF.get(drawer) or _NAME_OF.get(type(drawer))  # type: ignore[arg-type]  # None is in no table
    except TypeError:  # the drawer is not hashable
        return None


def describe_artist(name: str, artist: IArtist) -> dict[str, Any] | None:
    """Return the spec of an artist: `name`, `kind`, `keywords`, `layer`, `visible`; None for custom drawers."""
    kind = _find_kind(artist)
    if kind is None:
        return None
    try:
        drawer: Any = artist.get_drawer()
        given = drawer.keywords if isinstance(_KINDS[kind].drawer, type) else _KINDS[kind].keywords_of(artist.data)
        keywords = {key: given[key] for key in _KINDS[kind].names if key in given}
    except (KeyError, TypeError, ValueError, AttributeError):  # invalid data of a caller, which cannot be drawn, either
        return None
    return _make_spec(name, kind, keywords, artist)


def _make_spec(name: str, kind: str, keywords: _Data, artist: IArtist) -> _Data:
    layer = artist.get_layer()
    visible = artist.get_visible()
    return {"name": name, "kind": kind, "keywords": keywords, "layer": layer, "visible": visible}


def make_artist_from_spec(ctx: IContext, spec: dict[str, Any]) -> Artist | None:
    """Return an artist from its spec; None for an unknown kind.

    Raises:
        KeyError, BadType, TypeError: not a valid spec.
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


class Artists(ContextPart):
    """The artists of a context by name: declared, added, and those of the default scene.

    Args:
        ctx: the context.
        drawing: the drawing primitives.

    Attributes:
        declared: all declared and added artists.
        is_graph_declared: whether the graph was declared, so that there is no default scene.
        edits: a number that changes whenever an artist is declared, added or removed.
        drawings: drawings of a recording that is replayed.
        fog: filter by the knowledge of a team; None: everything is shown.
    """

    _called = "ctx.visual"

    declared: Protected[dict[str, IArtist]] = Protected(dict)

    def __init__(self, ctx: IContext, drawing: Drawing) -> None:
        self._phase = get_phase(ctx)
        self._ctx = ctx
        self._drawing = drawing
        self._own_colors: dict[str, Rgb] = {}  # of teams, without those of a recording
        self.declared = {}
        self._proposed: dict[str, IArtist] = {}
        self.is_graph_declared = False
        self._default: dict[Theme, DefaultScene] = {}
        self.edits = 0
        self.drawings = RecordedDrawings(ctx)
        self._unchecked: list[str] = []  # names of agents that were declared before any agent existed
        self.fog: Fog | None = None
        # the result of `list_drawn`, with the edit counts for which it is valid
        self._drawn: tuple[Any, dict[str, IArtist]] = None, {}

    # -- shown -----------------------------------------------------------------------------------------------

    @lift_decide_phase
    def list_shown(
        self, trails: int = 0, scene: "DefaultScene | None" = None, *, sensors: bool = True
    ) -> dict[str, IArtist]:
        """Return the artists to draw: the declared ones, and those of the default scene that are not replaced.

        Args:
            trails: number of turns for which the paths of agents are shown.
            scene: the default scene; None: the one of pictures, in the theme of the drawing.
            sensors: whether artists of sensor views are included.

        Raises:
            ContextTerminated: the context has ended.
        """
        if self._ctx.is_terminated():
            raise ContextTerminated("the state to draw")
        self._warn_of_unknown_agents()
        self._drawing.motion.reported = {} if self.fog is None else self.fog.reported
        artists = self._make_default_artists(scene, sensors=sensors and self.fog is None) | self.declared
        artists = _make_artists_below_agents(self._ctx, artists) | artists
        self._drawing.has_default_look = not self.is_graph_declared
        if self.fog is not None:
            artists = self.fog.filtered(artists)
        if not sensors:
            artists = {
                name: one for name, one in artists.items() if name not in ("rings", "sights") and name[:7] != "sensor_"
            }
        if trails:
            artists |= _make_trail_artists(self._ctx, artists, trails, self.fog)
        return self._make_elimination_artist(artists) | artists

    def list_signs(self) -> dict[str, IArtist]:
        """Return the artists by name, without those of map, agents, messages and sensor views."""
        artists = self.list_shown(sensors=False)
        return {name: one for name, one in artists.items() if one.get_drawer() not in _GROUND}

    def _make_elimination_artist(self, artists: Mapping[str, IArtist]) -> dict[str, IArtist]:
        """Return the artist that marks eliminated agents; marks are placed beside the largest disc of these artists."""
        looks = list(list_looks(artists))
        colors = {look.name: look.color for look in looks}
        size = max((look.size for look in looks), default=0.0)
        out = {name: has_arrived for name, has_arrived in self._drawing.events.list_out().items() if name in colors}
        tags = artists.get("tags")
        if tags is not None and (self.fog is not None or tags.get_drawer() is render_tags):
            get_data(tags).update(size=size, out=out)
        if not out:
            return {}
        marks = Artist(self._ctx, render_eliminated, Layer.TAGS)
        marks.data = {"colors": colors, "out": out, "size": size, "legend": make_elimination_rows(out)}
        return {"eliminated": marks}

    def _make_default_artists(self, scene: "DefaultScene | None", *, sensors: bool) -> dict[str, IArtist]:
        """Return the default scene unless the graph was declared."""
        if self.is_graph_declared:
            return {}
        if scene is None:
            from gamms.visual.default_scene import DefaultScene

            theme = self._drawing.theme
            scene = self._default.get(theme) or DefaultScene(self._ctx, theme)
            self._default[theme] = scene
        return scene.list_artists(self.declared, sensors=sensors)

    # -- declared --------------------------------------------------------------------------------------------

    @property
    def team_colors(self) -> Mapping[str, Rgb]:
        """The declared colors, by the text of the teams."""
        return MappingProxyType(dict(self._drawing.team_colors))

    @team_colors.setter
    def team_colors(self, colors: Mapping[Any, AnyColor]) -> None:
        """Set the colors of teams, and of agents without a team by name.

        Raises:
            BadType, BadValue: not a mapping, or an invalid color.
            UnknownName (KeyError): the team has no agent, flag or territory.
        """
        checked = _check_colors(colors)
        known = {*self._drawing.group_colors(), *find_teams_of_rules(self._ctx)}
        for team in checked:
            if team not in known:
                raise UnknownName("team", team, sorted(known))
        self._own_colors = checked
        self._drawing.team_colors = checked
        self.edits += 1

    @refuse_while_deciding
    @as_declared(IVisualizationEngine.set_graph_visual)
    def set_graph_visual(self, **kwargs: Unpack[GraphVisual]) -> Artist:
        """Set the look of the graph; the contract explains the keywords."""
        self._declare_graph(is_declared=not self._ctx.is_terminated())
        return self._declare("graph", self._make_artist("graph", {**kwargs}, Layer.GRAPH))

    def _declare_graph(self, *, is_declared: bool) -> None:
        """Record that the graph was declared, and reset values of the default scene to those of 1.0.0."""
        if is_declared and not self.is_graph_declared:
            self.is_graph_declared = True
            for look in list_looks(self.declared):
                look.fill(AgentData(look.name))
            for artist in self.declared.values():
                if artist.get_drawer() is render_sensor:
                    get_data(artist).pop("_defaults", None)

    @refuse_while_deciding
    @as_declared(IVisualizationEngine.set_obstacle_visual)
    def set_obstacle_visual(self, **kwargs: Unpack[ObstacleVisual]) -> Artist:
        """Set the look of obstacles; the contract explains the keywords."""
        keywords = {"color_map": {}, "boundary_thickness": 1.0, **kwargs}
        return self._declare("obstacles", self._make_artist("obstacles", keywords, Layer.OBSTACLES))

    @refuse_while_deciding
    @as_declared(IVisualizationEngine.set_agent_visual)
    def set_agent_visual(self, name: str, **kwargs: Unpack[AgentVisual]) -> Artist:
        """Set the look of an agent; the contract explains the keywords."""
        self._unchecked.append(as_name(name, "an agent"))
        self._warn_of_unknown_agents()
        artist = self._make_artist("agent", {**kwargs, "name": name}, Layer.AGENTS)
        artist.data["agent_data"].image = kwargs.get("image_path")
        return self._declare(name, artist)

    def _warn_of_unknown_agents(self) -> None:
        """Warn once about each declared name that no agent has; wait while there are no agents."""
        agents = self._ctx.agent.agents
        if not agents:
            return
        for name in self._unchecked:
            if name not in agents:
                self._ctx.logger.warning(
                    f"set_agent_visual: {UnknownName('agent', name, agents)} It is shown once it exists."
                )
        self._unchecked.clear()

    @refuse_while_deciding
    @as_declared(IVisualizationEngine.set_sensor_visual)
    def set_sensor_visual(self, name: str, **kwargs: Unpack[SensorVisual]) -> Artist:
        """Set the look of a sensor's last view; the contract explains the keywords."""
        artist = self._make_artist("sensor", {**kwargs, "name": name}, kwargs.get("layer", Layer.SENSORS))
        return self._declare(f"sensor_{as_name(name, 'a sensor')}", artist)

    @refuse_while_deciding
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
        """Show values of nodes or edges as colors, with a legend.

        A further call replaces the values of this name; without nodes and edges it removes them.

        Args:
            nodes: id -> value. Nodes with NaN, or without a value, are unchanged.
            edges: id -> value; the higher value is on top if two edges share a street.
            cmap: "viridis", "magma", "cividis" or "diverging" (palest at 0, unless `vmin` or `vmax` is given), or a
                function from a value to a color.
            vmin: value of the first color, also used below; default: the lowest value.
            vmax: value of the last color, also used above; default: the highest value.
            name: name of the artist; any name except "values" is also the title of the legend.

        Returns:
            The artist, on layer 13; None if nothing is shown.

        Raises:
            UnknownName (KeyError): a node, edge or color map does not exist.
            BadType, BadValue: not a mapping to numbers, both nodes and edges, or `vmin` not below `vmax`.
        """
        from gamms.visual.drawers.graph import render_values
        from gamms.visual.legend import check_colored_values

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
        shown = check_colored_values(of, given, known, cmap, (vmin, vmax), title)
        artist.data = {"values": shown, "legend": shown.legend}
        self.declared[name] = artist
        return artist

    def _make_artist(self, kind: str, keywords: _Data, layer: int) -> Artist:
        for hint in explain_misspelled(keywords, sorted(_KEYWORDS[kind])):
            self._ctx.logger.warning(
                f"Visual {shown(keywords.get('name', kind))}: {hint} It is left to drawers of your own."
            )
        spec = {"name": kind, "kind": kind, "keywords": keywords, "layer": layer, "visible": True}
        return cast("Artist", make_artist_from_spec(self._ctx, spec))

    def _declare(self, name: str, artist: Artist) -> Artist:
        if not self._ctx.is_terminated():
            self.declared[as_name(name, "a visual")] = artist
            self.edits += 1
        return artist

    @refuse_while_deciding
    @as_declared(IVisualizationEngine.add_artist)
    def add_artist(self, name: str, artist: IArtist | dict[str, Any]) -> IArtist:
        """Add an artist; the contract explains the arguments."""
        if isinstance(artist, dict):
            artist = self._read_artist(artist)
        if not isinstance(artist, IArtist):
            raise BadType(
                f"Artist {shown(name)} must be an Artist or a dict, not {shown(artist)} ({type(artist).__name__})."
            )
        if not self._ctx.is_terminated():
            self.declared[as_name(name, "an artist")] = artist
            self.edits += 1
        return artist

    @refuse_while_deciding
    def propose(self, name: str, artist: dict[str, Any]) -> None:
        """Add an artist, or replace one proposed under this name; an artist of the caller stays.

        Its drawer may be the name of a kind.
        """
        if isinstance(artist["drawer"], str):
            drawer: Any = _KINDS[artist["drawer"]].drawer
            artist = {"drawer": drawer, "layer": drawer.layer}
        known = self.declared.get(name)
        if known is None or known is self._proposed.get(name):
            self._proposed[name] = self.add_artist(name, artist)

    @refuse_while_deciding
    def withdraw(self, name: str) -> None:
        """Remove the artist proposed under this name, unless another has replaced it."""
        artist = self._proposed.pop(name, None)
        if artist is not None and self.declared.get(name) is artist:
            self.remove_artist(name)

    def get(self, name: str) -> IArtist | None:
        """Return the artist declared or added under a name; None if there is none."""
        return self.declared.get(as_key(name, "The name of an artist"))

    def _read_artist(self, data: dict[str, Any]) -> Artist:
        drawer = data.get("drawer", data.get("shape", Shape.Circle))
        artist = Artist(self._ctx, drawer, data.get("layer", Layer.ARTISTS))
        artist.data = data
        return artist

    @refuse_while_deciding
    def remove_artist(self, name: str) -> None:
        """Remove an artist; a missing one only gives a warning."""
        if self._ctx.is_terminated():
            return
        self.edits += 1
        if self.declared.pop(as_key(name, "The name of an artist"), None) is None:
            self._ctx.logger.warning(f"There is no artist named {shown(name)} to remove.")

    # -- recorded --------------------------------------------------------------------------------------------

    def describe_artists(self, *, with_drawings: bool = False) -> dict[str, Any]:
        """Return specs of the `artists` with built-in drawers; colors of teams; and whether the graph was declared.

        With drawings, artists with other drawers and shapes are included, because their drawings are recorded.
        """
        drawn = self.list_drawn(with_custom=with_drawings)
        artists = list[Any]()
        for name, artist in self.declared.items():
            if name in drawn:
                keywords = {"is_static": artist.get_artist_type() is ArtistType.STATIC}
                artists.append(_make_spec(name, _DRAWING, keywords, artist))
            else:
                artists.append(describe_artist(name, artist))
        specs = {"artists": [one for one in artists if one is not None], "is_declared": self.is_graph_declared}
        return specs | ({"team_colors": dict(self.team_colors)} if self.team_colors else {})

    def list_drawn(self, *, with_custom: bool) -> dict[str, IArtist]:
        """Return the artists whose draw commands are recorded: those of a replay, and with custom drawers, by name."""
        key = self.edits, Artist.edits, with_custom
        if self._drawn[0] != key:
            self._drawn = key, {name: one for name, one in self.declared.items() if _is_drawn(one, with_custom)}
        return self._drawn[1]

    def record_drawings(self, *, with_custom: bool) -> dict[str, dict[str, Any]]:
        """Return the present drawings of artists as plain values, by name; see `list_drawn`."""
        return {
            name: self.drawings.record_drawing(name, one)
            for name, one in self.list_drawn(with_custom=with_custom).items()
        }

    @refuse_while_deciding
    def add_drawing(self, recorded: dict[str, Any]) -> None:
        """Show a recorded drawing of an artist that the recording has declared; otherwise do nothing.

        Raises:
            BadType, BadValue, KeyError: not a recorded drawing; nothing has changed.
        """
        artist = self.declared.get(recorded["artist"])
        if artist is None or not isinstance(artist.get_drawer(), RecordedDrawer):
            return
        layer = as_int(recorded["layer"], "The layer of an artist")
        visible = bool(recorded["visible"])
        self.drawings.put(recorded)
        if (layer, visible) != (artist.get_layer(), artist.get_visible()):
            artist.set_layer(layer)
            artist.set_visible(visible)

    def end_turn(self) -> None:
        """Remove recorded drawings after a turn that was played instead of replayed."""
        if self.drawings.commands and not getattr(self._ctx.record, "is_replaying", False):
            self.drawings.clear()

    def _make_drawing_artist(self, spec: dict[str, Any]) -> Artist:
        """Return an artist that draws recorded commands."""
        drawer = RecordedDrawer(self.drawings, spec["name"])
        artist = Artist(self._ctx, drawer, spec["layer"])
        artist.data = {"legend": drawer.legend}
        artist.set_visible(spec["visible"])
        if spec["keywords"].get("is_static"):
            artist.set_artist_type(ArtistType.STATIC)
        return artist

    @refuse_while_deciding
    def add_specs(self, specs: dict[str, Any], own: Mapping[str, IArtist] = _NONE) -> Mapping[str, IArtist]:
        """Add the artists described by `specs`, except for taken names.

        Args:
            specs: from this or another context.
            own: the result of an earlier call, whose artists are replaced.

        Returns:
            The artists that were added.

        Raises:
            KeyError, BadType (TypeError), TypeError: not valid specs; nothing has changed.
        """
        made = {
            as_name(one["name"], "an artist"): (
                self._make_drawing_artist(one) if one["kind"] == _DRAWING else make_artist_from_spec(self._ctx, one)
            )
            for one in specs["artists"]
        }
        is_declared = bool(specs["is_declared"])
        colors = _check_colors(specs.get("team_colors", {}))
        if self._ctx.is_terminated():
            return own
        for name, artist in own.items():
            if self.declared.get(name) is artist:
                del self.declared[name]
        new = {name: one for name, one in made.items() if one is not None and name not in self.declared}
        self.declared |= new
        self._declare_graph(is_declared=is_declared)
        self._drawing.team_colors = colors | self._own_colors
        self.edits += 1
        return new


def _check_colors(colors: object) -> dict[str, Rgb]:
    """Return checked colors by the text of their teams.

    Raises:
        BadType, BadValue: the colors are invalid.
    """
    if not isinstance(colors, Mapping):
        raise BadType(f"team_colors must be a mapping from teams to colors, not {shown(colors)}.")
    checked: dict[str, Rgb] = {}
    for team, color in colors.items():
        try:
            checked[as_text(team)] = parse_color(color)[:3]
        except (BadType, BadValue) as error:
            raise type(error)(f"The color of team {shown(team)}: {error}") from None
    return checked


def _is_drawn(artist: IArtist, with_custom: bool) -> bool:
    """Return whether the draw commands of an artist are recorded."""
    if isinstance(artist.get_drawer(), RecordedDrawer):
        return True
    kind = _find_kind(artist)
    return with_custom and artist.get_drawer() is not render_input_overlay and (kind is None or _KINDS[kind].is_shape)


def _make_artists_below_agents(ctx: IContext, artists: Mapping[str, IArtist]) -> dict[str, IArtist]:
    """Return artists for the parts of visible artists that are drawn below agents."""
    found: dict[str, IArtist] = {}
    for name, artist in artists.items():
        drawer = getattr(artist.get_drawer(), "beneath", None)
        if drawer is not None and artist.get_visible():
            found[f"{name} beneath"] = Artist(ctx, drawer, drawer.layer)
    return found


def _make_trail_artists(
    ctx: IContext, artists: Mapping[str, IArtist], turns: int, fog: "Fog | None"
) -> dict[str, IArtist]:
    """Return artists of the trails of the agents that artists show; in fog, of the team's own agents."""
    hidden = get_drawing(ctx).hidden_agents()
    looks = [look for look in list_looks(artists) if look.name not in hidden]
    colors = {look.name: look.color for look in looks if fog is None or fog.is_own(look.name)}
    trails: dict[str, IArtist] = {}
    for name, drawer in (("past trails", render_past_trails), ("trails", render_trails)):
        artist = Artist(ctx, drawer, Layer.TRAILS)
        artist.data = {"colors": colors, "turns": turns}
        trails[name] = artist
    return trails
