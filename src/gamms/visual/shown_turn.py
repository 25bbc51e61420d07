"""The displayed turn: moves of agents, events, and sensor views, for drawers."""

from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import islice, takewhile
from typing import Any, NamedTuple, cast

import numpy as np

from gamms import kernels
from gamms.arguments import as_int, as_key
from gamms.errors import BadType, BadValue, ContextTerminated, NotOffered, UnknownName
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.progress import Progress, find_steps_along
from gamms.ir.sensor_results import SensorView
from gamms.knowledge.fields import find_pose
from gamms.knowledge.looks import LiveReports, Report, Reports, restore_data
from gamms.knowledge.sides import PastViews, Side, find_side
from gamms.text import shown
from gamms.typing import IAerialAgent, IAgent, IContext, ISensor, SensorType
from gamms.typing.agent_engine import AgentType
from gamms.typing.context import HostContext
from gamms.typing.on_edges import cut_line, locate
from gamms.typing.recorder import Step
from gamms.typing.sensor_engine import find_place_of_look

_Point = tuple[float, float]


class MovePaths(NamedTuple):
    """Polylines of moves, and the position of each point along its polyline, from 0.0 to 1.0."""

    points: FloatArray  # (points, 2)
    shares: FloatArray  # (points,)
    offsets: IntArray  # (paths + 1,)  path `i` is `points[offsets[i]:offsets[i + 1]]`

    @classmethod
    def from_bends(cls, straight: FloatArray, bends: Sequence[FloatArray]) -> "MovePaths":
        """Make paths from start to end, (paths, 2, 2), then paths along polylines, (points, 2) each."""
        counts = np.array([*[2] * len(straight), *map(len, bends)], np.int64)
        is_long = (straight[:, 0] != straight[:, 1]).any(axis=1)
        shares = np.column_stack([np.zeros(len(straight)), is_long]).ravel()
        points = np.concatenate([straight.reshape(-1, 2), *bends])
        offsets = np.concatenate(([0], np.cumsum(counts)))
        return cls(points, np.concatenate([shares, *map(_compute_shares, bends)]), offsets)

    def find_points(self, share: float) -> FloatArray:
        """Return the points (paths, 2) after a share of each path's length."""
        if len(self.points) == 0:
            return np.empty((0, 2))
        first = self.offsets[:-1]
        last = self.offsets[1:] - 1
        end = first + np.clip(np.add.reduceat(self.shares <= share, first, dtype=np.int64), 1, last - first)
        start = self.points[end - 1]
        behind = share - self.shares[end - 1]
        step = self.shares[end] - self.shares[end - 1]
        part = np.divide(behind, step, out=np.ones(len(step)), where=step > 0.0)
        found: FloatArray = start + part[:, None] * (self.points[end] - start)
        return found

    def list_points_until(self, row: int, share: float, end: _Point) -> list[_Point]:
        """Return the points of a path up to a share of its length, which is at `end`."""
        part = slice(self.offsets[row], self.offsets[row + 1])
        points = [(x, y) for x, y in self.points[part].tolist()]
        return points if share >= 1.0 else [*points[: bisect_right(self.shares[part].tolist(), share)], end]


def _compute_shares(points: FloatArray) -> FloatArray:
    lengths = np.hypot(*np.diff(points, axis=0).T)
    return np.concatenate([[0.0], np.cumsum(lengths)]) / (float(lengths.sum()) or 1.0)


class MovedAgents(NamedTuple):
    """The agents that moved in a turn, and the row of each one's path."""

    rows: dict[str, int]
    paths: MovePaths


_NO_MOVES = MovedAgents({}, MovePaths.from_bends(np.empty((0, 2, 2)), ()))
MOST_TURNS = 200  # that are remembered
_MOST_PLACES = 1 << 20  # that are: of 100,000 agents 10 turns


def as_turns(trails: object) -> int:
    """Check the number of turns of trails.

    Raises:
        BadType, BadValue: the number is invalid, or exceeds the number of stored turns.
    """
    turns = as_int(trails, "trails")
    if not 0 <= turns <= MOST_TURNS:
        raise BadValue(f"trails is a number of turns from 0 to {MOST_TURNS}, not {turns}.")
    return turns


# How a turn ended: the names of the agents, the nodes or points they were at, and the number of the turn; names and
# places when it began; and the edges that actions have named. One tuple, because two would be searched for garbage in
# every turn.
_Turn = tuple[Sequence[str], Sequence[Any], int, Sequence[str], Sequence[Any], Mapping[str, int]]
_NONE_NAMED: Mapping[str, int] = {}


class PastTurns:
    """The moves of the last turns of a context.

    Attributes:
        entries: the turns, or their moves, the latest last.
        latest: the last turn that was played; None before the first turn, and after a jump.
        count: the number of ended turns that belong to no game.
    """

    def __init__(self, ctx: IContext) -> None:
        self._ctx = ctx
        self.entries: deque[_Turn | MovedAgents] = deque()
        self.latest: _Turn | None = None
        self.count = 0
        self._names: Sequence[str] | None = None  # of agents; their number bounds the entries
        self._state: Any = None  # of the game

    def end_turn(self) -> None:
        """Store the end of a turn."""
        # NOTE: games without pictures pay for this in every turn (benchmarks: the loop, turns).
        ctx = self._ctx
        last = self.latest
        state = self._state
        if state is None and ctx.current_game is not None:
            state = ctx.current_game.internals.state
            self._state = state
        number = 0 if state is None else state.turn
        names, places = ctx.agent.positions.get_noted()
        if last is None or number < last[2]:  # or the game was reset
            if last is not None:
                self.forget()
            last = names, ctx.agent.positions.previous_places, 0, names, (), _NONE_NAMED
        if names is not self._names:
            self._names = names
            self.entries = deque(self.entries, self.room)
        named = state.find_named_edges(number) if state is not None and state.named_edges else _NONE_NAMED
        now = names, places, number, last[0], last[1], named
        self.latest = now
        self.entries.append(now)
        if not number:
            self.count += 1

    def has_ended(self, turn: int) -> bool:
        """Return whether the end of a turn of the game is stored as the latest one."""
        return self.latest is not None and self.latest[2] == turn

    @property
    def room(self) -> int:
        """The number of turns of the present agents that are remembered."""
        return min(max(_MOST_PLACES // max(len(self._ctx.agent.positions.names), 1), 1), MOST_TURNS)

    def end_turns(self, begin: Sequence[Any], places: Sequence[Sequence[Any]], last: int, *, goes_on: bool) -> None:
        """Store the ends of several turns of the present agents.

        Args:
            begin: (agents,) where they were before the first of these turns, or before their last move if they stayed.
            places: for each turn where they were at its end; see `Positions.places`.
            last: the number of the last of these turns.
            goes_on: whether the first of them follows the latest turn that is stored, if there is one.
        """
        names = self._ctx.agent.positions.get_names()
        number = last - len(places)
        if self.latest is not None and number + 1 < self.latest[2]:  # the game was reset
            self.forget()
        before = self.latest[:2] if self.latest is not None and goes_on else (names, begin)
        if names is not self._names:
            self._names = names
            self.entries = deque(self.entries, self.room)
        for end in places:
            number += 1
            self.latest = names, end, number, *before, _NONE_NAMED
            self.entries.append(self.latest)
            before = names, end

    def forget(self) -> None:
        """Forget all turns, and restart with the present positions before the next turn."""
        self.latest = None
        self.entries.clear()

    def jump(self, past: Iterable[MovedAgents] = ()) -> None:
        """Forget all turns but these moves: the next turn begins at the present positions."""
        self.entries.clear()
        self.entries.extend(past)
        names, places = self._ctx.agent.positions.get_noted()
        game = self._ctx.current_game
        self.latest = names, places, 0 if game is None else game.turn, names, places, _NONE_NAMED

    def forget_those_of_another_game(self) -> None:
        """Forget all turns if the game was reset since."""
        game = self._ctx.current_game
        last = self.latest
        if last is not None and (0 if game is None else game.turn) < last[2]:
            self.forget()


class LastMoves:
    """The last move of every agent during the frames of a turn, and the positions before it.

    Attributes:
        moves: in the turn that is shown.
        reported: agent -> its position, for agents that are shown where sensors report them instead of where they are.
    """

    def __init__(self, ctx: IContext, turns: PastTurns) -> None:
        self._ctx = ctx
        self._turns = turns
        self.moves = _NO_MOVES
        self.reported: Mapping[str, _Point] = {}
        self._now: tuple[float, FloatArray] | None = None  # where all that moved are after a share
        self._paths: tuple[Sequence[str], MovedAgents, IntArray] | None = None  # of the agents that were asked for last
        self._shown: _Turn | None = None  # the turn that is shown
        self._on_edges: tuple[Any, dict[str, _Point]] = (None, {})

    def list_past(self, turns: int) -> list[MovedAgents]:
        """Return the moves of up to `turns` last turns, the latest first."""
        self._turns.forget_those_of_another_game()
        entries = self._turns.entries
        for place in range(max(len(entries) - turns, 0), len(entries)):
            entry = entries[place]
            if not isinstance(entry, MovedAgents):
                steps = self._find_steps(entry)
                entries[place] = self.make_moves(steps | find_steps_along(steps, entry[-1]))
        return [moves for moves in reversed(entries) if isinstance(moves, MovedAgents)][:turns]

    def begin_turn(self) -> None:
        """Look up how each agent moved, unless that was done since the turn ended."""
        latest = self._turns.latest
        if latest is self._shown:
            return
        self._shown = latest
        self._now = None
        self.moves = _NO_MOVES
        if latest is not None:
            positions = self._ctx.agent.positions
            previous = dict(zip(positions.names, positions.previous_places, strict=True))
            steps = self._find_steps(latest).items()
            # An agent whose previous node is its node was put there.
            moved = {name: step for name, step in steps if previous.get(name) != step[1]}
            self.moves = self.make_moves(moved | find_steps_along(moved, latest[-1]))

    def _find_steps(self, turn: _Turn) -> dict[str, Step]:
        """Return where each agent was at the begin and at the end of a turn, but for agents that were put elsewhere."""
        names, places, number, names_before, places_before, _ = turn
        was = dict(zip(names_before, places_before, strict=True))
        game = self._ctx.current_game
        later = takewhile(lambda event: event["turn"] >= number, reversed(() if game is None else game.events))
        placed = {one["agent"] for one in later if one["kind"] == "respawned" and one["turn"] == number}
        steps = zip(names, places, strict=True)
        return {name: (was.get(name, place), place) for name, place in steps if name not in placed}

    def make_moves(self, steps: Mapping[str, Step]) -> MovedAgents:
        """Return how agents moved in a turn, by the places of each before and after it."""
        moved = {name: step for name, step in steps.items() if step[0] != step[1]}
        others = {name: step for name, step in moved.items() if any(isinstance(end, tuple) for end in step)}
        lines_of = {
            name: self._find_traveled_points(*step)
            for name, step in others.items()
            if any(isinstance(end, Progress) for end in step)
        }
        travels = {name: line for name, line in lines_of.items() if line is not None}
        flights = {name: step for name, step in others.items() if name not in lines_of}
        names = [name for name in moved if name not in others]
        ends = self._find_rows([moved[name] for name in names])
        is_known = (ends >= 0).all(axis=1)  # or else the node that it came from is gone
        bends = self._find_polylines(ends) if is_known.any() else {}
        straight = [row for row in np.flatnonzero(is_known).tolist() if row not in bends]
        lines = np.array([(before[:2], now[:2]) for before, now in flights.values()], np.float64).reshape(-1, 2, 2)
        if straight:
            lines = np.concatenate([lines, self._ctx.graph.columns().xy[ends[straight]]])
        order = [*flights, *(names[row] for row in (*straight, *bends)), *travels]
        row_of = {name: row for row, name in enumerate(order)}
        rows = {name: row_of[name] for name in moved if name in row_of}
        return MovedAgents(rows, MovePaths.from_bends(lines, [*bends.values(), *travels.values()]))

    def _find_traveled_points(self, before: Any, now: Any) -> FloatArray | None:
        """Return the points between two positions, one of them or both on edges; None if the edge was removed."""
        graph = self._ctx.graph.graph
        try:
            if isinstance(before, Progress) and isinstance(now, Progress) and before.edge == now.edge:
                line = cut_line(graph.get_edge(now.edge).points, before.share, now.share)
                return np.array(line)[:, 1:]
            came_by = now.source if isinstance(now, Progress) else now
            left = self._cut_edge(before, lambda share: (share, float(came_by != before.source)))
            entered = self._cut_edge(now, lambda share: (0.0, share))
        except UnknownName:
            return None
        return np.array([*left, *entered])[:, 1:]

    def _cut_edge(
        self, place: Progress | int, of: Callable[[float], tuple[float, float]]
    ) -> list[tuple[float, float, float]]:
        """Return the corners of a part of the agent's edge, (share, x, y) each; on a node, its position.

        `of` returns the part, given the agent's share of the edge.
        """
        graph = self._ctx.graph.graph
        if isinstance(place, Progress):
            return cut_line(graph.get_edge(place.edge).points, *of(place.share))
        node = graph.get_node(place)
        return [(0.0, node.x, node.y)]

    def find_position(self, name: str, share: float) -> _Point:
        """Return the position of an agent after a share of its last move, from 0.0 (before it) to 1.0 (after it).

        Raises:
            UnknownName (KeyError): the agent does not exist, or its node was removed.
        """
        name = as_key(name, "The name of an agent")
        if name in self.reported:
            return self.reported[name]
        row = self.moves.rows.get(name) if share < 1.0 else None
        if row is not None:
            x, y = self._compute_positions(share)[row].tolist()
            return x, y
        agent = self._ctx.agent.get_agent(name)
        if agent.type == AgentType.AERIAL:
            return cast("IAerialAgent", agent).position[:2]
        place = self.list_on_edges().get(agent.name)
        if place is not None:
            return place
        node = self._ctx.graph.graph.get_node(agent.current_node_id)
        return node.x, node.y

    def find_positions(self, names: Sequence[str], nodes: IntArray, share: float) -> FloatArray:
        """Return the positions (agents, 2) of agents on the ground, which are on nodes, as `find_position` does.

        Raises:
            UnknownName (KeyError): the node of an agent is gone.
        """
        positions: FloatArray = self._ctx.graph.graph.positions(nodes)
        on_edges = self.list_on_edges()
        for row, name in enumerate(names) if on_edges else ():
            positions[row] = on_edges.get(name, positions[row])
        if share < 1.0 and self.moves.rows:
            rows = self.find_paths(names)
            positions[rows >= 0] = self._compute_positions(share)[rows[rows >= 0]]
        for row, name in enumerate(names) if self.reported else ():
            positions[row] = self.reported.get(name, positions[row])
        return positions

    def find_paths(self, names: Sequence[str]) -> IntArray:
        """Return the rows (agents,) of the paths of agents in the turn that is shown; -1: it did not move."""
        known = self._paths
        if known is None or known[0] is not names or known[1] is not self.moves:
            found = np.array([self.moves.rows.get(name, -1) for name in names], np.int64)
            known = names, self.moves, found
            self._paths = known
        return known[2]

    def list_on_edges(self) -> dict[str, _Point]:
        """Return agent -> position, for agents on edges."""
        positions = self._ctx.agent.positions
        graph = self._ctx.graph.graph
        key = positions, positions.version, graph.revision
        if key != self._on_edges[0] or graph.revision is None:
            found = {row: locate(graph, progress) for row, progress in positions.on_edges.items()}
            names = positions.names
            self._on_edges = key, {names[row]: place.xy for row, place in found.items() if place is not None}
        return self._on_edges[1]

    def _compute_positions(self, share: float) -> FloatArray:
        """Return where all that moved are, (paths, 2)."""
        if self._now is None or self._now[0] != share:
            self._now = share, self.moves.paths.find_points(share)
        return self._now[1]

    def _find_rows(self, steps: list[tuple[int, int]]) -> IntArray:
        """Return the rows (steps, 2) of the nodes of steps; -1 is a node that is gone."""
        if not steps:
            return np.empty((0, 2), np.int64)
        try:
            columns = self._ctx.graph.columns()
        except ContextTerminated:
            return np.full((len(steps), 2), -1)
        return kernels.find_rows(columns.node_ids, np.array(steps, np.int64), columns.node_order)

    def _find_polylines(self, ends: IntArray) -> dict[int, FloatArray]:
        """Return the polylines of the first edges between nodes, for the steps (steps, 2) that have one."""
        columns = self._ctx.graph.columns()
        if not columns.polylines:
            return {}
        rows = np.flatnonzero((ends >= 0).all(axis=1))
        begin = ends[rows, 0]
        step, place = kernels.expand_ranges(columns.offsets[begin], columns.offsets[begin + 1])
        edges = columns.out_edges[place]
        is_taken = columns.targets[edges] == ends[rows[step], 1]
        first = dict(zip(rows[step[is_taken]][::-1].tolist(), edges[is_taken][::-1].tolist(), strict=True))
        return {row: columns.polylines[edge] for row, edge in sorted(first.items()) if edge in columns.polylines}


class TurnEvents:
    """The events of `ctx.game`, or of its replay, in the displayed turn.

    Attributes:
        views: which agents sides saw in the last turns.
    """

    def __init__(self, ctx: IContext) -> None:
        self._ctx = ctx
        self.views = PastViews()
        self._sides: tuple[int, dict[str, Side]] = (-1, {})  # structure version, and the side of each agent
        self._key: tuple[int, int] | None = None  # the turn and the number of events of the following
        self._eliminated = frozenset[str]()
        self._ends: dict[str, bool] | None = None  # of all agents that went out, once they are asked for

    def list_last(self) -> list[dict[str, Any]]:
        """Return the events of the last turn."""
        return list(self._list_latest(1))[::-1]

    def list_recent(self, kind: str, turns: int) -> list[dict[str, Any]]:
        """Return the events of a kind in the last turns, up to a limit, the latest first."""
        return [event for event in self._list_latest(turns) if event.get("kind") == kind]

    def _list_latest(self, turns: int) -> Iterator[dict[str, Any]]:
        game = self._ctx.current_game
        if game is not None and game.turn:
            first = game.turn - turns
            yield from takewhile(lambda event: event["turn"] > first, reversed(game.events))

    def find_witnesses(self, event: Mapping[str, Any]) -> set[Side]:
        """Return the sides that know of an event, as far as their views are noted: others know of their own agents."""
        positions = self._ctx.agent.positions
        if self._sides[0] != positions.structure_version:
            sides = map(find_side, positions.names, positions.teams)
            self._sides = positions.structure_version, dict(zip(positions.names, sides, strict=True))
        return self.views.find_witnesses(event, self._sides[1])

    def list_eliminated(self) -> frozenset[str]:
        """Return the names of the agents that went out of the game in the last turn."""
        self._renew()
        return self._eliminated

    def _renew(self) -> None:
        """Look again who went out, if a turn was played or undone since."""
        game = self._ctx.current_game
        key = (0, 0) if game is None else (game.turn, len(game.events))
        if key != self._key:
            self._key = key
            names = (event.get("agent") for event in self.list_recent("eliminated", 1))
            self._eliminated = frozenset(name for name in names if isinstance(name, str))
            self._ends = None

    def list_out(self) -> dict[str, bool]:
        """Return the agents that are out of the game, and for each whether it went out because it had arrived."""
        positions = self._ctx.agent.positions
        missing = {positions.names[row] for row in positions.inactive}
        game = self._ctx.current_game
        if not missing or game is None:
            return {}
        self._renew()
        if self._ends is None:
            last = {"arrive": dict[str, int](), "eliminated": dict[str, int]()}  # agent -> its last turn with it
            for event in game.events:
                if event.get("kind") in last and isinstance(event.get("agent"), str):
                    last[event["kind"]][event["agent"]] = event["turn"]
            self._ends = {name: last["arrive"].get(name) == turn for name, turn in last["eliminated"].items()}
        return {name: has_arrived for name, has_arrived in self._ends.items() if name in missing}


class ShownView(NamedTuple):
    """The view of a sensor from the agent that carries it; without a carrier, its last view."""

    sensor: ISensor
    carrier: str | None
    view: SensorView | None  # None: it has none; drawing it will show the error


class SensorCarriers:
    """The agents that carry each sensor, updated only if agents or their sensors have changed.

    Args:
        ctx: the context.
        places: returns the positions of agents between nodes.

    Attributes:
        read_reports: returns the reports of a recording for the shown state; None: no recording is shown.
    """

    def __init__(self, ctx: IContext, places: Callable[[], Mapping[str, _Point]]) -> None:
        self._ctx = ctx
        self._places = places
        self._key: Any = None
        self._of: dict[int, list[Any]] = {}
        self.read_reports: Callable[[], Reports | None] = lambda: None
        self._live: LiveReports | None = None

    def follow(self) -> LiveReports:
        """Return the reports of the context itself, which are noted from the first call on."""
        if self._live is None:
            self._live = LiveReports(cast("HostContext", self._ctx))
        return self._live

    def list_reports(self) -> Reports:
        """Return the last report of each sensor: of the shown recording, or of the context itself."""
        recorded = self.read_reports()
        return self.follow().read() if recorded is None else recorded

    def list_carriers(self, sensor: ISensor) -> list[Any]:
        """Return the agents that carry a sensor, dead ones too, in the order of their creation."""
        version = self._ctx.agent.structure_version
        if version is None or version != self._key:
            self._key = version
            self._of = {}
            for agent in self._ctx.agent.create_iter():
                for one in getattr(agent, "sensors", {}).values():
                    carriers = self._of.setdefault(id(one), [])
                    carriers += [agent] * (agent not in carriers[-1:])
        return self._of.get(id(sensor), [])

    def is_blind(self, sensor: ISensor) -> bool:
        """Return whether all agents that carry a sensor are out of the game."""
        carriers = self.list_carriers(sensor)
        return bool(carriers) and not any(agent.alive for agent in carriers)

    def list_views(self, most: int) -> list[ShownView]:
        """Return the views of sensors that have sensed; empty if there are more than the limit."""
        found = list(islice(self._list_looking_sensors(), most + 1))
        return [] if len(found) > most else [self.sight(*one) for one in found]

    def _list_looking_sensors(self) -> Iterator[tuple[Any, Any]]:
        """Yield the sensors that have sensed, with each living carrier, or with None."""
        game = self._ctx.current_game
        is_played = game is not None and game.turn > 0  # here or in a recording: then all have looked
        for sensor in self._ctx.sensor.sensors.values():
            carriers = self.list_carriers(sensor)
            living = [agent for agent in carriers if agent.alive] if carriers else [None]
            if sensor.type is not SensorType.NEIGHBOR and living and ((is_played and carriers) or _has_looked(sensor)):
                yield from ((sensor, agent) for agent in living)

    def sight(self, sensor: ISensor, agent: IAgent | None) -> ShownView:
        """Return the view of a sensor for an agent, without the agent's own team; None: its last view.

        If a recording is shown, it is the view that was reported in the shown state, else the present view.

        Raises:
            RecordingError (ValueError): the recording of which reports are read is damaged.
        """
        if agent is None:
            return self._show(sensor, None, lambda: get_view(sensor))
        recorded = self.read_reports() or {}
        key = next((name for name, one in agent.sensors.items() if one is sensor), "")
        report = recorded.get((agent.name, key))
        if report is not None and not report.is_early:
            return self.show_report(sensor, agent, report)
        look = getattr(sensor, "view_from", None)  # classes that do not inherit from ISensor have none
        if look is None:
            return self._show(sensor, agent, lambda: get_view(sensor))
        return self._show(sensor, agent, lambda: look(self._find_place(sensor, agent), agent.name))

    def show_report(self, sensor: ISensor, agent: IAgent, report: Report) -> ShownView:
        """Return the view of a report without a look; for sensors that are not built-in, the last view.

        The view of an early report stays where it was made. It has no field of view if its direction is not known.
        """
        found = self._show(sensor, agent, lambda: self._view_report(sensor, agent, report))
        if found.view is None or not report.is_early:
            return found
        view = replace(found.view, names=(), is_early=True)
        if report.look.field is None or find_pose(sensor, agent)[1] is not None:
            view = replace(view, outline=view.outline[:0], reach=view.reach[:0])
        return found._replace(view=view)

    def _view_report(self, sensor: ISensor, agent: IAgent, report: Report) -> SensorView:
        if not getattr(sensor, "sees_world_only", False):
            return get_view(sensor)
        field = report.look.field
        place = field.place if report.is_early and field is not None else self._find_place(sensor, agent)
        return sensor.view_of(
            restore_data(report.look, self._ctx.graph.graph, report.names), cast("int", place), agent.name
        )

    def _find_place(self, sensor: ISensor, agent: IAgent) -> Any:
        return find_place_of_look(sensor, agent.current_node_id, self._places().get(agent.name))

    def _show(self, sensor: ISensor, agent: IAgent | None, make_view: Callable[[], object]) -> ShownView:
        try:
            made = make_view()
        except NotOffered:
            made = SensorView()
        except Exception:  # noqa: BLE001 - a sensor is user code; its artist will fail likewise, which is logged
            made = None
        view = self._exclude_own_team(made, sensor, agent) if isinstance(made, SensorView) else None
        return ShownView(sensor, None if agent is None else agent.name, view)

    def _exclude_own_team(self, view: SensorView, sensor: ISensor, agent: IAgent | None) -> SensorView:
        """Return a view without the carrier's own team, whose field moves with the carrier if nothing blocks it."""
        if agent is None:
            return view
        is_bounded_by_walls = sensor.type.name.startswith("OCCLUDED") and len(view.outline) > 0
        moves = getattr(sensor, "at", None) is None and not is_bounded_by_walls
        view = replace(view, carrier=agent.name if moves else None)
        if agent.team is None or not view.names:
            return view
        agents = self._ctx.agent.agents
        is_other = np.array([name not in agents or agents[name].team != agent.team for name in view.names])
        names = tuple(name for name, other in zip(view.names, is_other.tolist(), strict=True) if other)
        return replace(view, agents=view.agents[is_other], names=names)


def get_view(sensor: ISensor) -> SensorView:
    """Return the last view of a sensor.

    Raises:
        NotOffered: it has no `last_view`.
        BadType: its `last_view` returns something else.
    """
    if not hasattr(sensor, "last_view"):  # a sensor need not inherit from ISensor
        raise NotOffered(sensor, "last_view, so it cannot be drawn")
    view = sensor.last_view()
    if not isinstance(view, SensorView):
        raise BadType(f"last_view of sensor {sensor.sensor_id!r} must return a SensorView, not {shown(view)}.")
    return view


def _has_looked(sensor: ISensor) -> bool:
    try:
        return has_content(get_view(sensor))
    except NotOffered:
        return False
    except Exception:  # noqa: BLE001 - see above
        return True


def has_content(view: SensorView) -> bool:
    """Return whether a view has nodes, edges, agents or a field of view."""
    return any(len(part) for part in (view.nodes, view.lines, view.agents, view.outline, view.dashed))
