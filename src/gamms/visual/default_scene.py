"""The default scene, for scenarios that do not declare their graph: gray streets, shaded buildings, colored agents.

Agents have the colors of their teams, or their own. What few sensors see is drawn in the colors of the living
agents that carry them, below the agents. Tags and messages of this turn are drawn, and a legend shows the teams.
"""

from collections.abc import Iterable, Mapping
from math import inf
from types import MappingProxyType
from typing import Any

import numpy as np

from gamms.ir.graph import GraphColumns
from gamms.ir.sensor_results import SensorView
from gamms.knowledge.sides import Side, find_side
from gamms.text import as_digits
from gamms.typing import ArtistType, IArtist, IContext
from gamms.typing.visualization_engine import Drawer
from gamms.visual.appearance import AgentData, AgentLooks, GraphData, Rgb
from gamms.visual.artist import Artist, get_data, list_looks
from gamms.visual.constants import Layer
from gamms.visual.drawers import render_agent, render_graph, render_obstacles, render_sensor
from gamms.visual.drawers.agents import render_looks
from gamms.visual.drawers.graph import (
    find_obstacles_to_draw,
    find_typical_edge_length,
    measure_longer_side,
    render_base_map,
)
from gamms.visual.drawers.marks import render_tags
from gamms.visual.drawers.messages import has_messages, render_messages
from gamms.visual.drawers.sensors import remove_edge_ends, render_rings, render_sight, render_sights
from gamms.visual.drawers.streets import has_tunnels, render_tunnels
from gamms.visual.drawing import get_drawing
from gamms.visual.legend import SIGN, LegendRow, LegendRows, draw_nothing
from gamms.visual.shown_turn import ShownView, has_content
from gamms.visual.themes import Theme

MOST_SENSORS = 20  # more views would hide the agents
_MOST_APART = 6  # the number of views that are drawn in full
_WITHOUT_CARRIER = (110, 114, 120)
# radius of agents; above this number they are smaller and drawn together
_AGENT_PX = 6.0
_LEAST_PX = 3.0
_MANY = 150
# above this number they are even smaller
_DENSE = 5000
_TINY_PX = 1.0
TOGETHER = "agents on the ground"  # the name of the artist of agents
_VIEWS = (  # attribute of a view, text in the legend, sign
    ("outline", "field of view", "field"),
    ("dashed", "range, if nothing blocks it", "range"),
    ("lines", "edge in view", "line"),
    ("nodes", "node in view", "dot"),
    ("agents", "agent in view", "ring"),
)
RING = 1.7  # of a sensed agent, in radii of its disc
# of a wall: in radii of agents, and at most in metres
_WALL = 0.3
_THICKEST = 0.5
_MOST_ROOM = 0.45  # for fields of view at each side of a map that stays as it is, in lengths of its longer side


ColoredSights = Mapping[str, list[tuple[Rgb, SensorView | None]]]


class DefaultScene:
    """The artists of a scenario that does not declare its graph, cached until their inputs change.

    Args:
        ctx: the context.
        theme: its colors.
    """

    def __init__(self, ctx: IContext, theme: Theme) -> None:
        self._ctx = ctx
        self._theme = theme
        self._map_key: Any = None
        self._map: dict[str, IArtist] = {}
        # the radius of agents, and its maximum
        self._unit = 1.0
        self._most = inf
        self._agents_key: Any = None
        self._agents: dict[str, IArtist] = {}
        self._colors: dict[str, Rgb] = {}  # of agents, by name
        self._views: dict[str, Artist] = {}  # of sensors
        self._tags = Artist(ctx, render_tags, Layer.TAGS)
        self._legend = legend_of_teams(ctx)

    def list_artists(self, declared: Mapping[str, IArtist], *, sensors: bool = True) -> dict[str, IArtist]:
        """Return the artists of the map, all agents, the sensors while they are few, rules, and the legend, by name.

        Sizes and colors that declared artists do not have are filled in.
        """
        self._renew_map()
        self._renew_agents(declared)
        for look in list_looks(declared):
            if look.name in self._agents:
                look.fill(get_data(self._agents[look.name])["agent_data"])
        for artist in declared.values():
            if artist.get_drawer() is render_sensor:
                get_data(artist)["_defaults"] = compute_sight_sizes(self._mark)
        seen = self._make_sensor_artists(declared) if sensors else {}
        return self._map | self._agents | seen | self._list_game_artists() | {"legend": self._legend}

    @property
    def _mark(self) -> float:
        """The radius of agents, world units."""
        return min(self._unit, self._most)

    def limit_marks(self, most: float) -> bool:
        """Draw agents no larger than this, world units; return whether that changes their size."""
        before = self._mark
        self._most = most
        return self._mark != before

    def _list_game_artists(self) -> dict[str, IArtist]:
        """Return the artists of tags and messages, which may come without a rule that declares them."""
        artists: dict[str, IArtist] = {"tags": self._tags}
        if has_messages(self._ctx):
            artists["messages"] = Artist(self._ctx, render_messages, Layer.MESSAGES)
            artists["messages"].data = {"size": self._mark}
        return artists

    def _renew_map(self) -> None:
        graph = self._ctx.graph
        key = graph.columns().revision, graph.obstacle_revision  # the first one changes with the scenery, too
        if key == self._map_key and None not in key:  # which are engines that do not count
            return
        columns = graph.columns()
        tones = self._theme.map
        self._map_key = key
        self._unit = sight_radius(columns)
        streets = self._make_static_artist(render_graph, Layer.GRAPH)
        size = (0.35 if columns.crs is None else 0.15) * self._unit  # where paths are slim, larger ones would be beads
        streets.data = {"graph_data": GraphData(tones.nodes, size, tones.streets), "tunnels": "below"}
        self._map = {"graph": streets}
        if len(graph.scenery_columns().kinds):
            self._map["base_map"] = self._make_static_artist(render_base_map, Layer.BASE_MAP)
        if has_tunnels(columns):
            tunnels = self._make_static_artist(render_tunnels, Layer.TUNNELS)
            self._map["tunnels"] = tunnels
            tunnels.data = streets.data
        if len(find_obstacles_to_draw(self._ctx).ids):
            thickness = _WALL * self._unit if columns.crs is None else min(_WALL * self._unit, _THICKEST)
            walls = self._make_static_artist(render_obstacles, Layer.OBSTACLES)
            self._map["obstacles"] = walls
            walls.data = {"fill": True, "boundary_thickness": thickness}

    def _make_static_artist(self, drawer: Drawer, layer: int) -> Artist:
        artist = Artist(self._ctx, drawer, layer)
        artist.set_artist_type(ArtistType.STATIC)
        return artist

    def _renew_agents(self, declared: Mapping[str, IArtist]) -> None:
        agents = self._ctx.agent.agents
        are_together = len(agents) > _MANY and not any(name in agents for name in declared)
        key = self._ctx.agent.structure_version, self._mark, get_drawing(self._ctx).team_colors, are_together
        if key == self._agents_key:
            return
        positions = self._ctx.agent.positions
        by_side = get_drawing(self._ctx).group_colors()
        labels = get_drawing(self._ctx).label_sides()
        names = positions.names
        sides = zip(positions.names, positions.teams, strict=True)
        least_px = max(_LEAST_PX, min(_AGENT_PX, _AGENT_PX * (_MANY / max(len(names), 1)) ** 0.5))
        if are_together:
            least_px = max(_TINY_PX, least_px * min(1.0, (_DENSE / len(names)) ** 0.5))
        self._agents_key = key
        self._agents = {}
        self._colors = {name: by_side[labels[find_side(name, team)]] for name, team in sides}
        if are_together:
            self._agents[TOGETHER] = self._make_agents_artist(least_px)
        above = set(positions.flyers.tolist()) if are_together else None
        for row, (name, color) in enumerate(self._colors.items()):
            if above is None or row in above:
                disc = Artist(self._ctx, render_agent, Layer.AGENTS)
                self._agents[name] = disc
                disc.data = {"agent_data": AgentData(name, color, self._mark, least_px=least_px), "_alpha": 1.0}

    def _make_agents_artist(self, least_px: float) -> Artist:
        """Return the artist of all agents on the ground."""
        positions = self._ctx.agent.positions
        colors = list(dict.fromkeys(self._colors.values()))
        place_of = {color: place for place, color in enumerate(colors)}
        places = np.array([place_of[color] for color in self._colors.values()], np.int64)
        rows = np.delete(np.arange(len(places)), positions.flyers)
        names = [positions.names[row] for row in rows.tolist()]
        version = self._ctx.agent.structure_version
        artist = Artist(self._ctx, render_looks, Layer.AGENTS)
        looks = AgentLooks(names, rows, version, colors, places[rows], self._mark, least_px)
        artist.data = {"looks": looks, "_alpha": 1.0}
        return artist

    def _make_sensor_artists(self, declared: Mapping[str, IArtist]) -> dict[str, IArtist]:
        """Return artists of the present sensor views."""
        nodes = len(self._ctx.graph.columns().node_ids)
        found = dict[str, list[ShownView]]()
        for sight in get_drawing(self._ctx).carriers.list_views(MOST_SENSORS):
            if sight.view is None or _is_worth_drawing(sight.view, nodes):
                found.setdefault(sight.sensor.sensor_id, []).append(sight)
        colored = {
            name: [(self._find_color(one.carrier), one.view) for one in sights] for name, sights in found.items()
        }
        self._views = make_sight_artists(self._ctx, colored, self._mark, declared, self._views)
        return dict(self._views)

    def _find_color(self, carrier: str | None) -> Rgb:
        return _WITHOUT_CARRIER if carrier is None else self._colors[carrier]


def compute_sight_sizes(unit: float) -> dict[str, float]:
    """Return the keywords of sensors that are sizes, where agents have some radius."""
    return {"size": RING * unit, "node_size": 0.5 * unit}


def make_sight_artists(
    ctx: IContext,
    sights: ColoredSights,
    unit: float,
    declared: Mapping[str, IArtist],
    before: Mapping[str, Artist] = MappingProxyType({}),
) -> dict[str, Artist]:
    """Return artists of sensor views: one per color, and one for the rings of all views.

    Args:
        ctx: the context.
        sights: sensor -> a color and a view for each of its carriers; a view that is None cannot be drawn.
        unit: the radius of agents.
        declared: artists by name, which are left out.
        before: artists to be used again.
    """
    artists = dict[str, Artist]()
    look = compute_sight_sizes(unit)
    together = list[tuple[Rgb, SensorView]]()
    for name, views in sights.items():
        if f"sensor_{name}" not in declared:
            together += [(color, view) for color, view in views if view is not None]
    if len(together) > _MOST_APART:
        artist = before.get("sights") or Artist(ctx, render_sights, Layer.SEEN)
        artists["sights"] = artist
        artist.data = {
            "sights": together,
            "legend": make_sight_legend((color, remove_edge_ends(view)) for color, view in together),
            **look,
        }
    for name, views in sights.items():
        if len(together) > _MOST_APART and all(view is not None for _, view in views):
            continue
        drawer = (
            render_sensor if any(view is None for _, view in views) else render_sight
        )  # the first error is reported
        artist = before.get(f"sensor_{name}") or Artist(ctx, drawer, Layer.SEEN)
        artists[f"sensor_{name}"] = artist
        artist.set_drawer(drawer)
        artist.data = {"name": name, "color": views[0][0], "sights": views, "legend": make_sight_legend(views), **look}
    ringed = [(color, view) for color, view in together if view.names]
    if ringed:
        rings = before.get("rings") or Artist(ctx, render_rings, Layer.SEEN)
        artists["rings"] = rings
        rings.data = {"sights": ringed, **look}
    return artists


def reach_of_views(ctx: IContext, artists: Mapping[str, IArtist]) -> float:
    """Return how far fields of view reach from their agents, world units; at most as far as frames make room."""
    far = 0.0
    for artist in artists.values():
        for _, view in get_data(artist).get("sights", ()):
            corners = np.zeros((0, 2)) if view is None else np.concatenate([view.outline, view.dashed])
            if len(corners) and view.carrier in ctx.agent.agents:
                center = get_drawing(ctx).position_of(view.carrier, 1.0)
                if view.is_early:
                    center = tuple((corners.min(axis=0) + corners.max(axis=0)) / 2)
                far = max(far, float(np.abs(corners - center).max()))
    return min(far, _MOST_ROOM * measure_longer_side(ctx.graph.columns()))


def make_sight_legend(given: Iterable[tuple[Rgb, SensorView | None]]) -> LegendRows | None:
    """Return legend rows for the signs of views, in grey, because views have the colors of their agents."""
    sights = list(given)
    views = [view for _, view in sights if view is not None]
    rows = [
        LegendRow(SIGN, words, sign=sign)
        for part, words, sign in _VIEWS
        if any(len(getattr(view, part)) for view in views)
    ]
    if any(color == _WITHOUT_CARRIER for color, _ in sights):
        rows.append(LegendRow(_WITHOUT_CARRIER, "sensor of no agent", sign="disc"))
    return LegendRows("", tuple(rows))


def make_team_rows(ctx: IContext) -> LegendRows | None:
    """Return the legend of the teams: color, name and score; None if there are fewer than two teams."""
    colors = get_drawing(ctx).group_colors()
    labels = get_drawing(ctx).label_sides()
    teams = dict.fromkeys(ctx.agent.positions.teams)
    scores = {} if ctx.current_game is None else ctx.current_game.scores
    named = [team for team in teams if team is not None]
    if len(named) < 2:
        return None
    heading = "" if ctx.current_game is None else "score"
    rows = tuple(
        LegendRow(colors[label], label, _score(scores.get(team, 0)) if heading else "")
        for team, label in ((team, labels[Side(team, None)]) for team in named)
    )
    return LegendRows("", rows, heading)


def _score(score: object) -> str:
    return as_digits(score) if isinstance(score, int | float) else ""


def legend_of_teams(ctx: IContext) -> Artist:
    """Return an artist that draws nothing but the legend of the teams."""
    artist = Artist(ctx, draw_nothing, Layer.TEAMS)
    artist.data = {"legend": make_team_rows}
    return artist


def _is_worth_drawing(view: SensorView, nodes: int) -> bool:
    """Return whether a view has content other than all `nodes` of the map."""
    return has_content(view) and (len(view.nodes) < nodes or len(view.outline) > 0 or len(view.dashed) > 0)


def sight_radius(columns: GraphColumns) -> float:
    """Return the radius of agents, in world units: large enough to be seen, small enough not to hide streets."""
    return min(0.22 * find_typical_edge_length(columns), 0.018 * measure_longer_side(columns)) or 1.0
