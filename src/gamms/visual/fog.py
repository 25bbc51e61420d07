"""Fog of war: shows what the sensors of a team reported, and dims the nodes that they have seen before.

Reports are read from the recording that is shown, or are those that agents of a live game got; no sensor is asked.
Between two turns these are the reports of the last turn, from before its moves. They show other agents where they were
reported, and so do reports of sensors with errors.
"""

from collections.abc import Container, Iterator, Mapping, Sequence
from typing import Any, cast

import numpy as np

from gamms import kernels
from gamms.errors import BadValue
from gamms.ir.graph import FloatArray, GraphColumns, IntArray
from gamms.ir.sensor_results import SensorView
from gamms.knowledge.fields import find_field
from gamms.knowledge.looks import Report, Sighting, make_nearest
from gamms.knowledge.sides import (
    AgentPlaces,
    Side,
    SideLook,
    as_side_look,
    find_known,
    find_named_side,
    find_seen,
    find_side_of,
    find_sighted,
    has_errors,
)
from gamms.text import shown
from gamms.typing import AgentType, IAgent, IArtist, IContext, ISensor, SensorType
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
from gamms.visual.drawers.streets import find_distinct_roads, join_polylines
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
    """The knowledge of a team, which filters the shown artists from the first `look` on.

    Before the first report of a sensor, the team sees the nodes of its agents.

    Args:
        ctx: the context, whose `visual.artists` have this fog from now on.
        team: the team, or its text; for an agent without a team its name. "team red" and "agent red" tell a team and an
            agent with the same name apart.

    Raises:
        UnknownName (KeyError): no agent is of this team.
        BadValue: none of its agents carries a sensor, or a team and an agent without a team have this name.

    Attributes:
        side: the team, or the agent without a team.
        team: its text.
        hidden: the names of the agents that it does not see.
        reported: agent -> its position, for agents that are shown where sensors report them.
        sights: the last views of the sensors of its living agents.
    """

    def __init__(self, ctx: IContext, team: "str | Side") -> None:
        self._ctx = ctx
        sides = map(find_side_of, ctx.agent.create_iter())
        self.side = team if isinstance(team, Side) else find_named_side(team, sides)
        self.team = self.side.text
        if not any(_list_sensors(agent) for agent in self._list_own_agents()):
            raise BadValue(f"No agent of team {shown(self.team)} has a sensor in this recording, so it sees nothing.")
        self._seen: dict[int, int] = {}  # node -> since which turn
        self._now: set[int] = set()
        self.hidden: set[str] = set()
        self.reported: dict[str, tuple[float, float]] = {}
        self.sights: list[ShownView] = []
        self._carriers = get_drawing(ctx).carriers
        self._carriers.follow()
        self._sights: dict[str, Artist] = {}  # of sensors
        self._streets_artist = Artist(ctx, _TurnDrawer(self._draw_streets), Layer.GRAPH)
        self._tags = Artist(ctx, _TurnDrawer(self._draw_tags), Layer.TAGS)

    def _list_own_agents(self) -> Iterator[IAgent]:
        return (agent for agent in self._ctx.agent.create_iter() if find_side_of(agent) == self.side)

    def _list_own_names(self) -> set[str]:
        return {agent.name for agent in self._list_own_agents()}

    def is_own(self, name: str) -> bool:
        """Return whether an agent is of the team."""
        agent = self._ctx.agent.agents.get(name)
        return agent is not None and find_side_of(agent) == self.side

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
            together.data = data | {"looks": data["looks"].remove_agents(self.hidden)}
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
        """Show what the team knows in the present state: the last reports of its sensors.

        Raises:
            BadValue: the batch of this game has not kept these reports; nothing has changed.
        """
        columns = self._ctx.graph.columns()
        places = self._find_places(columns)
        others = {name for name, side in zip(places.names, places.sides, strict=True) if side != self.side}
        found = list(self._list_own_reports())
        at = dict(zip(places.names, places.rows.tolist(), strict=True))
        looks = [self._as_look(agent, sensor, report, at) for agent, sensor, report in found]
        known = find_known([self.side], looks, places, len(columns.node_ids))[self.side]
        self._note_views([report for _, _, report in found], others)
        rough = [report for _, sensor, report in found if report.is_early or has_errors(sensor)]
        sighted = find_sighted(rough, others.difference(known.agents), make_nearest(self._ctx.graph.columns))
        self.reported = dict(self._locate(sighted))
        self.hidden = others.difference(known.agents, self.reported)
        self._now = set(columns.node_ids[known.nodes].tolist())
        turn = self._get_turn()
        before = {node: since for node, since in self._seen.items() if since <= turn}  # a replay may go back
        self._seen = dict.fromkeys(self._now, turn) | before
        self.sights = [self._carriers.show_report(sensor, agent, report) for agent, sensor, report in found]
        self._show_sights([sight for sight in self.sights if sight.sensor.type is not SensorType.NEIGHBOR])
        cast("Any", self._ctx.visual).artists.fog = self

    def _list_own_reports(self) -> Iterator[tuple[IAgent, ISensor, Report]]:
        """Yield the last reports of the sensors of living agents of the team."""
        reports = self._carriers.list_reports()
        for agent in self._list_own_agents():
            for name, sensor in getattr(agent, "sensors", {}).items():
                if agent.alive and (agent.name, name) in reports:
                    yield agent, sensor, reports[agent.name, name]

    def _as_look(self, agent: IAgent, sensor: ISensor, report: Report, at: Mapping[str, int]) -> SideLook:
        """Return what a report says about the present state, without agents that may be elsewhere.

        Args:
            agent: the agent that carries the sensor.
            sensor: the sensor.
            report: its report.
            at: agent -> the row of its node.
        """
        ctx = self._ctx
        field = _NONE
        if report.look.field is not None or not report.is_early:
            field = find_field(report.look.field, sensor, agent, get_drawing(ctx).motion.list_on_edges(), ctx.graph)
        seen = find_seen(report, sensor, at, ctx.graph)
        look = as_side_look(agent.name, sensor, seen, field, is_early=report.is_early)
        return look._replace(agents=()) if has_errors(sensor) else look

    def _note_views(self, reports: Sequence[Report], others: Container[str]) -> None:
        """Note which agents the sensors report, to know later who has witnessed the events of the turn."""
        if not reports:
            return
        is_early = any(report.is_early for report in reports)
        turn = self._get_turn() + (not is_early)
        seen = find_sighted(reports, others, make_nearest(self._ctx.graph.columns))
        get_drawing(self._ctx).events.views.note(turn, self.side, seen, is_early=is_early)

    def _locate(self, sighted: Mapping[str, Sighting]) -> Iterator[tuple[str, tuple[float, float]]]:
        """Yield agents with their reported positions, without those on nodes that are gone."""
        graph = self._ctx.graph.graph
        for name, sighting in sighted.items():
            if sighting.position is not None:
                yield name, (sighting.position[0], sighting.position[1])
            elif graph.has_node(sighting.node):
                node = graph.get_node(sighting.node)
                yield name, (node.x, node.y)

    def _get_turn(self) -> int:
        game = self._ctx.current_game
        return 0 if game is None else game.turn

    def _find_places(self, columns: GraphColumns) -> AgentPlaces:
        agents = list(self._ctx.agent.create_iter())
        on_edges = get_drawing(self._ctx).motion.list_on_edges()
        nodes = np.array([agent.current_node_id for agent in agents], np.int64)
        is_standing = [agent.type != AgentType.AERIAL and agent.name not in on_edges for agent in agents]
        return AgentPlaces(
            [agent.name for agent in agents],
            [find_side_of(agent) for agent in agents],
            kernels.find_rows(columns.node_ids, nodes, columns.node_order),
            np.array([agent.alive for agent in agents], bool),
            np.array(is_standing, bool),
        )

    def _show_sights(self, sights: list[ShownView]) -> None:
        """Draw the views of the team's sensors, if they are few, and no others."""
        color = get_drawing(self._ctx).color_of(get_drawing(self._ctx).label_side(self.side))
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
            take, ends_of = kernels.select_runs(offsets, rows)
            visual.render_lines(points[take], ends_of, color, width, in_world=is_real)
            visual.render_circles(columns.xy[shades == shade], _DOT * unit, color)

    def _draw_flags(self, ctx: IContext, data: dict[str, Any]) -> None:
        render_flags(ctx, data | {"is_in_view": self._is_in_view})

    def _draw_homes(self, ctx: IContext, data: dict[str, Any]) -> None:
        render_homes(ctx, data | {"is_in_view": self._is_in_view})

    def _is_in_view(self, name: str) -> bool:
        return name not in self.hidden

    def _draw_messages(self, ctx: IContext, data: dict[str, Any]) -> None:
        render_messages(ctx, data | {"of": self._list_own_names(), "hidden": self.hidden})

    def _draw_tags(self, ctx: IContext, data: dict[str, Any]) -> None:
        data.update(side=self.side, hidden=self.hidden)
        render_tags(ctx, data)


def _list_streets(columns: GraphColumns) -> tuple[FloatArray, IntArray, IntArray]:
    """Return the points and offsets of streets, and the rows of the nodes at their ends (streets, 2)."""
    rows = find_distinct_roads(columns)
    return (*join_polylines(columns, rows), np.column_stack([columns.sources[rows], columns.targets[rows]]))


class _TurnDrawer:
    """A method as a drawer that is called once a turn."""

    once_a_turn = True

    def __init__(self, draw: Drawer) -> None:
        self._draw = draw

    def __call__(self, ctx: IContext, data: dict[str, Any]) -> None:
        self._draw(ctx, data)


def _list_sensors(agent: IAgent) -> list[Any]:
    """Return the sensors that an agent carries; Any: an agent of another class may carry any."""
    return list(getattr(agent, "sensors", {}).values())
