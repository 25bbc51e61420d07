"""Fog of war: hides what a team cannot see, and dims what it has seen before."""

from collections.abc import Iterator, Mapping
from typing import Any, cast

import numpy as np

from gamms import kernels
from gamms.errors import BadValue, UnknownName
from gamms.ir.graph import FloatArray, GraphColumns, IntArray
from gamms.ir.sensor_results import SensorView
from gamms.knowledge.fields import find_field
from gamms.knowledge.looks import Report, take_looks
from gamms.knowledge.sides import AgentPlaces, SideLook, as_side_look, find_known, find_seen, name_side
from gamms.text import shown
from gamms.typing import AgentType, IAgent, IArtist, IContext, SensorType
from gamms.typing.sensor_engine import IN_AIR
from gamms.typing.visualization_engine import Drawer
from gamms.visual.appearance import AgentData
from gamms.visual.artist import Artist, get_data
from gamms.visual.constants import Layer
from gamms.visual.default_scene import MOST_SENSORS, TOGETHER, make_sight_artists, sight_radius
from gamms.visual.drawers import render_input_overlay, render_obstacles
from gamms.visual.drawers.agents import render_looks
from gamms.visual.drawers.graph import find_typical_edge_length, render_base_map
from gamms.visual.drawers.marks import render_tags
from gamms.visual.drawers.messages import make_message_legend, render_messages
from gamms.visual.drawers.rules import find_flags, find_territories, render_flags, render_homes
from gamms.visual.drawers.streets import find_distinct_roads, polylines
from gamms.visual.drawing import get_drawing
from gamms.visual.legend import draw_nothing
from gamms.visual.shown_turn import ShownView

_OPEN = (render_base_map, render_obstacles, render_input_overlay, draw_nothing)  # drawers of public knowledge
# as broad as in other pictures
_STREET = 2.0
_SLIM = 0.2
_DOT = 0.08
_LINE_PX = 1.5
_NONE = np.zeros(0, np.int64)


class Fog:
    """The map knowledge of a team, which filters the shown artists from the first `look` on.

    Args:
        ctx: the context, whose `visual.artists` have this fog from now on.
        team: its text; of an agent without a team its name.

    Raises:
        UnknownName (KeyError): no agent is of this team.
        BadValue: none of its agents carries a sensor.

    Attributes:
        hidden: the names of the agents that it does not see.
    """

    def __init__(self, ctx: IContext, team: str) -> None:
        self._ctx = ctx
        self.team = team
        if not any(True for _ in self._list_own_agents()):
            raise UnknownName("team", team, {_find_side(agent) for agent in ctx.agent.create_iter()})
        if not any(_list_sensors(agent) for agent in self._list_own_agents()):
            raise BadValue(f"No agent of team {shown(team)} has a sensor in this recording, so it sees nothing.")
        self._seen: dict[int, int] = {}  # node -> since which turn
        self._now: set[int] = set()
        self.hidden: set[str] = set()
        self._sights: dict[str, Artist] = {}  # of sensors
        self._streets_artist = Artist(ctx, _TurnDrawer(self._draw_streets), Layer.GRAPH)
        self._tags = Artist(ctx, _TurnDrawer(self._draw_tags), Layer.TAGS)

    def _list_own_agents(self) -> Iterator[IAgent]:
        return (agent for agent in self._ctx.agent.create_iter() if _find_side(agent) == self.team)

    def _list_own_names(self) -> set[str]:
        return {agent.name for agent in self._list_own_agents()}

    def filtered(self, artists: Mapping[str, IArtist]) -> dict[str, IArtist]:
        """Return the artists that the team may see, and artists of its knowledge instead of the others."""
        territories = find_territories(self._ctx)
        flags = find_flags(self._ctx)
        left_out = {
            "graph",
            "tags",
            "rings",
            "sights",
            *territories,
            *flags,
            *(f"sensor_{name}" for name in self._ctx.sensor.sensors),
        }
        kept = {name: artist for name, artist in artists.items() if name not in left_out and self._may_show(artist)}
        if TOGETHER in artists:
            data = get_data(artists[TOGETHER])
            together = Artist(self._ctx, render_looks, Layer.AGENTS)
            kept[TOGETHER] = together
            together.data = data | {"looks": data["looks"].without(self.hidden)}
        for key in flags:
            shown_flags = Artist(self._ctx, self._draw_flags, Layer.FLAGS)
            kept[key] = shown_flags
            shown_flags.data = {"key": key}
            homes = Artist(self._ctx, _TurnDrawer(self._draw_homes), Layer.GOALS)
            kept[f"{key} beneath"] = homes
            homes.data = {"key": key}
        if "messages" in artists:
            shown_messages = Artist(self._ctx, self._draw_messages, Layer.MESSAGES)
            kept["messages"] = shown_messages
            data = get_data(artists["messages"])
            shown_messages.data = data | {"legend": lambda ctx: make_message_legend(ctx, self._list_own_names())}
        return kept | {"graph": self._streets_artist, "tags": self._tags} | self._sights

    def _may_show(self, artist: IArtist) -> bool:
        """Return whether an artist shows a visible agent, or something independent of visibility."""
        look = get_data(artist).get("agent_data")
        return look.name not in self.hidden if isinstance(look, AgentData) else artist.get_drawer() in _OPEN

    # -- knowledge ---------------------------------------------------------------------------------------

    def look(self) -> None:
        """Take the reports of the team's sensors in the present state, and hide the agents that they do not show."""
        columns = self._ctx.graph.columns()
        carriers = get_drawing(self._ctx).carriers
        places = self._find_places(columns)
        sights = list[ShownView]()
        looks = list[SideLook]()
        for agent in self._list_own_agents():
            for sensor in _list_sensors(agent) if agent.alive else ():
                sight = carriers.sight(sensor, agent)
                sights.append(sight)
                looks.append(self._as_look(sight, agent, places))
        self._show_sights([sight for sight in sights if sight.sensor.type is not SensorType.NEIGHBOR])
        known = find_known([self.team], looks, places, len(columns.node_ids))[self.team]
        self._now = set(columns.node_ids[known.nodes].tolist())
        game = self._ctx.current_game
        turn = 0 if game is None else game.turn
        before = {node: since for node, since in self._seen.items() if since <= turn}  # a replay may go back
        self._seen = dict.fromkeys(self._now, turn) | before
        others = {name for name, side in zip(places.names, places.sides, strict=True) if side != self.team}
        self.hidden = others.difference(known.agents)
        cast("Any", self._ctx.visual).artists.fog = self

    def _as_look(self, sight: ShownView, agent: IAgent, places: AgentPlaces) -> SideLook:
        """Return what a sensor shows to the team, and the nodes on which it would show agents."""
        ctx = self._ctx
        view = sight.view or SensorView()
        report = sight.report or self._as_report(sight, places)
        field = _NONE
        if len(view.nodes) == 0 and (len(view.outline) or sight.sensor.type in IN_AIR):
            field = find_field(report.look.field, sight.sensor, agent, get_drawing(ctx).motion.on_edges(), ctx.graph)
        at = dict(zip(places.names, places.rows.tolist(), strict=True))
        return as_side_look(agent.name, sight.sensor, find_seen(report, sight.sensor, at, ctx.graph), field)

    def _as_report(self, sight: ShownView, places: AgentPlaces) -> Report:
        """Return what a sensor would report now, with the rows of agents as their numbers."""
        numbers = {name: row for row, name in enumerate(places.names)}
        nodes = dict(zip(places.names, self._ctx.agent.positions.nodes, strict=True))
        ((_, looks),) = take_looks([(0, {"": (sight.sensor.type, sight.data)})], numbers, nodes)
        return Report(looks[0], dict(enumerate(places.names)))

    def _find_places(self, columns: GraphColumns) -> AgentPlaces:
        agents = list(self._ctx.agent.create_iter())
        on_edges = get_drawing(self._ctx).motion.on_edges()
        nodes = np.array([agent.current_node_id for agent in agents], np.int64)
        is_standing = [agent.type != AgentType.AERIAL and agent.name not in on_edges for agent in agents]
        return AgentPlaces(
            [agent.name for agent in agents],
            [_find_side(agent) for agent in agents],
            kernels.rows_of(columns.node_ids, nodes, columns.node_order),
            np.array([agent.alive for agent in agents], bool),
            np.array(is_standing, bool),
        )

    def _show_sights(self, sights: list[ShownView]) -> None:
        """Draw the views of the team's sensors, if they are few, and no others."""
        color = get_drawing(self._ctx).color_of(self.team)
        found = dict[str, list[Any]]()
        for sight in sights if len(sights) <= MOST_SENSORS else ():
            found.setdefault(sight.sensor.sensor_id, []).append((color, sight.view or SensorView()))
        unit = sight_radius(self._ctx.graph.columns())
        self._sights = make_sight_artists(self._ctx, found, unit, {}, self._sights)

    # -- drawers ---------------------------------------------------------------------------------------------

    def _draw_streets(self, ctx: IContext, _: dict[str, Any]) -> None:
        columns = ctx.graph.columns()
        points, offsets, ends = get_drawing(ctx).of_map(_list_streets)
        shades = np.isin(columns.node_ids, list(self._seen)).astype(np.int64)
        shades += np.isin(columns.node_ids, list(self._now))
        of_streets = shades[ends].min(axis=1)
        unit = find_typical_edge_length(columns)
        visual = get_drawing(ctx)
        is_real = columns.crs is not None
        width = min(_STREET, _SLIM * unit) if is_real else _LINE_PX
        for shade, color in enumerate(visual.theme.fog):
            rows = np.flatnonzero(of_streets == shade)
            take, ends_of = kernels.chosen_runs(offsets, rows)
            visual.render_lines(points[take], ends_of, color, width, in_world=is_real)
            visual.render_circles(columns.xy[shades == shade], _DOT * unit, color)

    def _draw_flags(self, ctx: IContext, data: dict[str, Any]) -> None:
        render_flags(ctx, data | {"hidden": self.hidden})

    def _draw_homes(self, ctx: IContext, data: dict[str, Any]) -> None:
        render_homes(ctx, data | {"hidden": self.hidden})

    def _draw_messages(self, ctx: IContext, data: dict[str, Any]) -> None:
        render_messages(ctx, data | {"of": self._list_own_names(), "hidden": self.hidden})

    def _draw_tags(self, ctx: IContext, data: dict[str, Any]) -> None:
        data["of"] = self._list_own_names()
        render_tags(ctx, data)


def _list_streets(columns: GraphColumns) -> tuple[FloatArray, IntArray, IntArray]:
    """Return the points and offsets of streets, and the rows of the nodes at their ends (streets, 2)."""
    rows = find_distinct_roads(columns)
    return (*polylines(columns, rows), np.column_stack([columns.sources[rows], columns.targets[rows]]))


class _TurnDrawer:
    """A method as a drawer that is called once a turn."""

    once_a_turn = True

    def __init__(self, draw: Drawer) -> None:
        self._draw = draw

    def __call__(self, ctx: IContext, data: dict[str, Any]) -> None:
        self._draw(ctx, data)


def _find_side(agent: IAgent) -> str:
    return name_side(agent.name, getattr(agent, "team", None))


def _list_sensors(agent: IAgent) -> list[Any]:
    """Return the sensors that an agent carries; Any: an agent of another class may carry any."""
    return list(getattr(agent, "sensors", {}).values())
