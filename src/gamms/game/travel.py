"""Travel by metres: the map and the ways of agents as `gamms.core.travel` takes them, and the game of a context by ids.

`Map`, `Reach` and `Trips` hold what the core reads and writes, for one game or for many; nodes and edges have rows
there. `Travel` says where agents of the game of a context may go and where they go, by ids.
"""

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property
from math import nan
from typing import Any, NamedTuple

import numpy as np

from gamms import kernels
from gamms.core import travel as core
from gamms.errors import BadValue, NoPath, UnknownName
from gamms.game.settings import Settings
from gamms.ir.agents import Position, Quat
from gamms.ir.graph import FloatArray, GraphColumns, IntArray
from gamms.ir.progress import Motion, Progress
from gamms.typing.context import HostContext
from gamms.typing.game import Leg
from gamms.typing.graph_engine import IGraph
from gamms.typing.on_edges import Line, OnEdge, placed

SLACK = 1e-9  # of a turn, as the core has it
_REMEMBERED = 64  # nodes on the way of each agent, 16 bytes each
_MORE_LEGS = 3  # than a way has nodes
ENDLESS = 1 << 32  # edges: more than any way has
LEAST, MOST = 5e-324, 1.0 - 2.0**-53  # of an edge: who is under way is on it, though these shares may be rounded
_MOTIONS = tuple(Motion)
_NOTHING: IntArray = np.zeros(0, np.int64)


def map_of(
    columns: GraphColumns,
    costs: FloatArray,
    seconds: FloatArray | None,
    turn_seconds: float,
    leaving: tuple[IntArray, IntArray] | None = None,
    patch: tuple[IntArray, IntArray, IntArray] = (_NOTHING, np.zeros(1, np.int64), _NOTHING),
) -> core.Roads:
    """Return the edges of a graph as the core takes them.

    Args:
        columns: of the graph.
        costs: (edges,) by which agents find their ways.
        seconds: (edges,) that each takes at least; None: edges have no speed of their own.
        turn_seconds: how long a turn lasts, in the time of speeds.
        leaving: offsets (nodes + 1,) and rows of the edges that leave nodes; None: those of the graph.
        patch: rows of nodes, ascending, that other edges leave, with offsets and rows of these.
    """
    offsets, edges = (columns.offsets, columns.out_edges) if leaving is None else leaving
    ints = [columns.node_ids, offsets, edges, *patch, columns.sources, columns.targets]
    floats = [columns.lengths, costs, np.zeros(0) if seconds is None else seconds]
    views: list[Any] = [np.ascontiguousarray(column, np.int64).data for column in ints]
    views += [np.ascontiguousarray(column, np.float64).data for column in floats]
    return core.Roads(*[*views, turn_seconds])


class Reach:
    """The nodes that an agent may go to, as the core finds them.

    Args:
        nodes: how many nodes there are.

    Attributes:
        core: what the core writes to.
        nodes, times: (nodes,) rows, and when each is reached, of as many as were found.
    """

    def __init__(self, nodes: int) -> None:
        ints, floats = np.zeros((6, nodes), np.int64), np.zeros((2, nodes))
        self.nodes, self.times = ints[0], floats[0]
        listed, heap, places, rank, seen = (column.data for column in ints[1:])
        self.core = core.Reach(self.nodes.data, self.times.data, listed, heap, places, floats[1].data, rank, seen)


class Trips:
    """The ways of agents through a turn, as the core writes them; see `core.Trips` for the columns.

    Args:
        rows: how many agents there are.
        most: for how many legs of each there is room.
        route: for how many nodes of a route there is room; None: for as many.

    Attributes:
        core: what the core writes to.
    """

    def __init__(self, rows: int, most: int, route: int | None = None) -> None:
        states, shares = np.zeros((6, rows), np.int64), np.zeros((4, rows))
        self.node, self.edge, self.motion, self.left, self.legs, self.passed = states
        self.share, self.now, self.speed, self.pace = shares
        self.most, self.edges, self.nodes = most, np.zeros((rows, most), np.int64), np.zeros((rows, most + 1), np.int64)
        parts, self.times = np.zeros((4, rows, most)), np.zeros((rows, most + 1))
        self.route = np.zeros(most if route is None else route, np.int64)
        self.begins, self.ends, self.since, self.until = parts
        columns = (*states, *shares, self.edges, *parts, self.nodes, self.times, self.route)
        views: list[Any] = [column.reshape(-1).data for column in columns]
        self.core = core.Trips(most, *views)
        # NOTE: items of memoryviews are numbers of Python, which arrays make in twice the time (benchmarks: travel).
        self._edge, self._motion, self._counts, self._passed = views[1], views[2], views[4], views[5]
        self._share = views[6]
        self._legs = views[10:15]
        self._nodes, self._times = views[15:17]

    def ended(self, row: int, ids: Sequence[int], edge_ids: "EdgeIds", begun: Progress | None) -> "ResolvedAction":
        """Return the way that the core has written, of an agent that was on its node or there on an edge.

        Args:
            row: of the agent.
            ids: of nodes, by row.
            edge_ids: of edges.
            begun: where on an edge it was.
        """
        # NOTE: loops without generators, because each agent goes a way in each turn (benchmarks: travel).
        edges, begins, ends, since, until = self._legs
        legs = list[Leg]()
        first = row * self.most
        for place in range(first, first + self._counts[row]):
            source, target, id, back = edge_ids[edges[place]]
            leg = Leg(source, target, id, begins[place], ends[place], since[place], until[place], back)
            legs.append(leg)
        first += row  # a way has one node more than legs
        last = first + self._passed[row]
        path = [ids[node] for node in self._nodes[first:last]]
        progress, edge = None, self._edge[row]
        if edge >= 0:
            source, target, id, _ = edge_ids[edge]
            progress = Progress(source, target, self._share[row], id, _MOTIONS[self._motion[row]])
        passed = tuple(self._times[first:last])
        return ResolvedAction(path[-1], tuple(path), (), passed, progress, tuple(legs), begun)


class Memories:
    """The cheapest ways that agents remember; no way leads along an edge that costs infinitely much.

    Args:
        columns: of the graph.
        costs: (edges,) by which agents find their ways.
        rows: how many agents there are.
        most: how many nodes of its way each remembers.
    """

    def __init__(self, columns: GraphColumns, costs: FloatArray, rows: int, most: int) -> None:
        self._costs = costs
        entering = kernels.group_rows(columns.targets, len(columns.node_ids))
        turned = replace(columns, sources=columns.targets, targets=columns.sources)
        leaving = _of_finite_costs(costs, (columns.offsets, columns.out_edges))
        self._plain = map_of(columns, costs, None, 1.0, leaving)
        self._back = map_of(turned, costs, None, 1.0, _of_finite_costs(costs, entering))
        self._begin(rows, most)

    def _begin(self, rows: int, most: int) -> None:
        self.most = most
        self._ints: Any = np.zeros((3, rows), np.int64)
        self._ints[0] = -1  # the goal
        self._nodes: Any = np.zeros(rows * most, np.int64)
        self._far: Any = np.zeros(rows * most)

    def apart(self, rows: int, most: int) -> "Memories":
        """Return the same of so many other ways, of which so many nodes are remembered."""
        twin = copy(self)
        twin._begin(rows, most)
        return twin

    def ways(self, roads: core.Roads, reach: Reach) -> core.Ways:
        """Return what one thread finds ways with on a map."""
        columns: Any = [column.data for column in (*self._ints, self._nodes, self._far)]
        direct: Any = np.zeros(len(self._costs), np.uint8).data
        return core.Ways(*[roads, self._back, reach.core, direct, self.most, *columns])

    def plain_ways(self, reach: Reach) -> core.Ways:
        """Return the same where only costs count."""
        return self.ways(self._plain, reach)


class Paths:
    """The nodes of one revision of a graph by their ids, and the ways of the agents of one game.

    Args:
        columns: of the graph.
        costs: (edges,) by which agents find their ways.

    Attributes:
        ids: of the nodes, by row.
        reach: scratch, and the nodes that were found last.
    """

    def __init__(self, columns: GraphColumns, costs: FloatArray) -> None:
        self._columns = columns
        self._costs = costs
        self.ids: list[int] = columns.node_ids.tolist()
        self._row_of = {id: row for row, id in enumerate(self.ids)}
        self.reach = Reach(len(self.ids))
        self._found = self.reach.nodes.data
        self._ways: core.Ways | None = None
        self._agents = 0  # for how many of these that has room

    def row(self, node: int) -> int:
        """Return the row of a node.

        Raises:
            UnknownName (KeyError): there is none.
        """
        try:
            return self._row_of[node]
        except KeyError:
            raise UnknownName("node", node) from None

    def found(self, count: int) -> tuple[int, ...]:
        """Return the ids of the first nodes that were found last."""
        ids = self.ids
        return tuple([ids[row] for row in self._found[:count].tolist()])

    def ways(self, agent: int) -> core.Ways:
        """Return the ways of agents, among them of this one, by its row."""
        if self._ways is None or agent >= self._agents:
            self._agents = 2 * agent + 2
            self._ways = Memories(self._columns, self._costs, self._agents, _REMEMBERED).plain_ways(self.reach)
        return self._ways


class EdgeIds(dict[int, tuple[int, int, int, int | None]]):
    """Row of an edge -> the ids of the nodes it leads from and to, its own, and that of the one back.

    NOTE: kept, because each agent looks around in each turn (benchmarks: travel).
    """

    def __init__(self, columns: GraphColumns, roads: core.Roads) -> None:
        super().__init__()
        self._columns, self._roads = columns, roads

    def __missing__(self, row: int) -> tuple[int, int, int, int | None]:
        columns, back = self._columns, core.back(self._roads, row)
        source, target = columns.node_ids[[columns.sources[row], columns.targets[row]]].tolist()
        of = columns.edge_ids.item
        found = self[row] = source, target, of(row), None if back < 0 else of(back)
        return found


class Roads(Paths):
    """The edges of one revision of a graph by their ids; of parallel ones the cheapest, of equal ones the first.

    Args:
        graph: with the edges.
        columns: of the graph.
        weight: of the game, by which agents find their ways.
        seconds: (edges,) that each takes at least; None: edges have no speed of their own.
        turn_seconds: how long a turn lasts, in the time of speeds.

    Attributes:
        map: what the core takes.
        edge_ids: of edges, by row.
    """

    def __init__(
        self, graph: IGraph, columns: GraphColumns, weight: str | None, seconds: Any, turn_seconds: float
    ) -> None:
        super().__init__(columns, graph.weights(weight))
        self._graph = graph
        self.map = map_of(columns, self._costs, seconds, turn_seconds)
        self._edge_row_of = {id: row for row, id in enumerate(columns.edge_ids.tolist())}
        self.edge_ids = EdgeIds(columns, self.map)
        self._lines: dict[int, Line] = {}  # by the id of an edge

    def on(self, edge: int) -> int | None:
        """Return the row of an edge by its id; None where there is none."""
        return self._edge_row_of.get(edge)

    def of(self, place: Progress) -> int:
        """Return the row of the edge that an agent is on.

        Raises:
            UnknownName (KeyError): it was closed; agents leave such edges before they are asked.
        """
        row = self._edge_row_of.get(place.edge)
        if row is None:
            raise UnknownName("edge", place.edge)
        return row

    @cached_property
    def xy(self) -> list[tuple[float, float]]:
        """Where nodes are, by row."""
        return [*map(tuple, self._columns.xy.tolist())]

    def located(self, place: Progress) -> OnEdge | None:
        """Return what `typing.on_edges.located` does."""
        row = self._edge_row_of.get(place.edge)
        if row is None:
            return None
        line = self._lines.get(place.edge)
        if line is None:
            line = self._lines[place.edge] = Line.of(self._graph.get_edge(place.edge).points)
        return placed(place, self._columns.lengths.item(row), line)


def _of_finite_costs(costs: FloatArray, edges_at: tuple[IntArray, IntArray]) -> tuple[IntArray, IntArray]:
    """Return offsets and rows of edges without those of which no path is made."""
    offsets, edges = edges_at
    kept = np.isfinite(costs)[edges]
    return np.concatenate(([0], np.cumsum(kept)))[offsets], edges[kept]


class ResolvedAction(NamedTuple):
    """What one agent is going to do."""

    end: int  # node id
    path: tuple[int, ...]  # node ids, from the agent's node to the end
    heading: Any = ()  # (cos, sin) to face from now on, None to follow moves again; () leaves it
    times: tuple[float, ...] = ()  # when it is at each node of the path, from 0 to 1; (): evenly
    progress: Progress | None = None  # along the edge behind the end of the path
    legs: tuple[Leg, ...] = ()  # of one that travels by metres
    begun: Progress | None = None  # where on an edge such a one is before the turn
    position: Position | None = None  # of a flyer
    quat: Quat | None = None
    deeds: Mapping[str, dict[str, Any]] | None = None  # what it does besides: deed -> the values of its fields


def progress_at(leg: Leg, time: float) -> Progress | None:
    """Return where an agent on a leg is at a time of the turn; None: on a node."""
    share = leg.share_at(time) if time < leg.until else leg.end
    if time < leg.until and leg.begin != leg.end:
        share = min(max(share, LEAST), MOST)
    if not 0.0 < share < 1.0:
        return None
    moving = Motion.FORWARD if leg.end > leg.begin else Motion.BACK
    motion = Motion.STOPPED if leg.end == leg.begin else moving
    return Progress(leg.source, leg.target, share, leg.edge, motion)


class Travel:
    """Where agents of a game by metres go.

    Args:
        ctx: the context, whose graph and agents count.
        settings: of the game.

    Attributes:
        now: of the turn, from 0 to 1: when the agents that are asked act.
    """

    def __init__(self, ctx: HostContext, settings: Settings) -> None:
        self._ctx, self._settings = ctx, settings
        self._roads: Roads | None = None
        self._key: tuple[Any, ...] = ()
        self.now = 0.0
        self._make_room(0)

    @property
    def roads(self) -> Roads:
        """The edges as they are now."""
        graph, settings = self._ctx.graph.graph, self._settings
        key = graph.revision, settings.weight, settings.speed_unit, settings.turn_seconds
        if self._roads is None or key != self._key or key[0] is None:
            turn_seconds = settings.turn_seconds if settings.speed_unit == "metres_per_second" else 1.0
            has_speeds = settings.weight == "travel_time" and settings.speed_unit == "metres_per_second"
            seconds = graph.weights(settings.weight) if has_speeds else None
            roads = Roads(graph, self._ctx.graph.columns(), settings.weight, seconds, turn_seconds)
            self._roads, self._key = roads, key
            self._make_room(len(roads.ids) + _MORE_LEGS)
        return self._roads

    def place(self, row: int) -> Progress | None:
        """Return where on an edge an agent is; None: on its node."""
        place: Progress | None = self._ctx.agent.block.on_edge(row)
        return place

    def is_going(self, place: Progress) -> bool:
        """Whether an agent is on its way along an edge that is there, or back where one may turn round on it."""
        edge = self.roads.on(place.edge)
        return edge is not None and core.is_going(self.roads.map, edge, place.motion)

    def reachable(self, place: Progress | None, here: int, speed: float | None) -> tuple[int, ...]:
        """Return the nodes that an agent may go to: those next to it, then those in reach in this turn.

        One whose edge was closed is on the node that it has passed last when the next turn begins. One on its way that
        decides where it arrives gets the nodes that are in reach from there.
        """
        roads = self.roads
        edge = None if place is None else roads.on(place.edge)
        share, motion = (0.0, 0) if place is None else (place.share, place.motion)
        count = core.reachable(
            roads.map,
            roads.reach.core,
            roads.row(here),
            -1 if edge is None else edge,
            share,
            motion,
            nan if speed is None else speed,
            self.now,
            self._settings.decide == "arrival",
        )
        return roads.found(count)

    # -- ways -----------------------------------------------------------------------------------------------------

    def stay(self, place: Progress | None, here: int) -> ResolvedAction:
        """Return the way of an agent that stops where it is: on an edge, or on its node."""
        if place is None:
            return ResolvedAction(here, (here,), (), (self.now,))
        roads = self.roads
        self._begin(roads, place._replace(motion=Motion.STOPPED), here, None)
        core.stand(self._trips, 0)
        return self._ended(roads, place)

    def go_on(self, place: Progress, here: int, speed: float | None) -> ResolvedAction:
        """Return the way of an agent that is on its way along an edge, and goes on to the end that it heads for."""
        return self._go(self.roads, place, here, speed, place.motion, 0)

    def along(self, place: Progress | None, here: int, speed: float | None, route: list[int]) -> ResolvedAction:
        """Return the way along nodes that follow each other, as far as the turn goes.

        Raises:
            BadValue: no edge leads from one to the next, or an agent would have to turn round on a one-way road.
        """
        if not route:
            return self.stay(place, here)
        roads, nodes, at, motion = self.roads, route[1:] if route[0] == here else route, here, Motion.FORWARD
        if place is not None and nodes and nodes[0] == place.target:
            nodes, at = nodes[1:], place.target
        elif place is not None:
            motion = Motion.BACK
            if core.back(roads.map, roads.of(place)) < 0:
                raise one_way(place.source, place.target)
        if len(nodes) + _MORE_LEGS > self._most:
            self._make_room(len(nodes) + _MORE_LEGS)
        for number, node in enumerate(nodes):
            self._route[number] = roads.row(node)
        flaw = core.without_edge(roads.map, self._trips, roads.row(at), len(nodes))
        if flaw >= 0:
            raise BadValue(f"No edge leads from node {[at, *nodes][flaw]} to node {nodes[flaw]}.")
        return self._go(roads, place, here, speed, motion, len(nodes))

    def towards(
        self, agent: int, place: Progress | None, here: int, speed: float | None, target: int
    ) -> ResolvedAction:
        """Return the way of an agent, by its row, towards a node, by the shortest path, as far as the turn goes.

        Raises:
            BadValue: no path leads there.
        """
        roads = self.roads
        if place is None and speed is None and target != here:
            self._refuse_far(here, target)
        self._begin(roads, place, here, speed)
        if not core.go_towards(roads.map, self._trips, roads.ways(agent), agent, 0, roads.row(target)):
            if place is None:
                raise BadValue(str(NoPath(here, target)))
            may_turn = core.back(roads.map, roads.of(place)) >= 0
            raise no_way(here, place.target, target, is_paced=speed is not None, may_turn=may_turn)
        return self._ended(roads, place)

    def _refuse_far(self, here: int, target: int) -> None:
        near = self._ctx.graph.graph.neighborhoods[here]
        if target not in near:
            raise BadValue(f"Node {target} is not next to node {here}; legal are {list(near)}.")

    # -- what the core is asked -------------------------------------------------------------------------------------

    def _make_room(self, most: int) -> None:
        """Get memory for ways of so many legs."""
        self._written = trips = Trips(1, most)
        self._most, self._trips = most, trips.core
        self._route = trips.route.data

    def _begin(self, roads: Roads, place: Progress | None, here: int, speed: float | None) -> None:
        """Put an agent where its way begins."""
        edge, share, motion = (-1, 0.0, 0) if place is None else (roads.of(place), place.share, place.motion)
        pace, most = nan if speed is None else speed, 1 if self._settings.decide == "arrival" else ENDLESS
        core.begin(self._trips, 0, roads.row(here), edge, share, motion, self.now, pace, most)

    def _go(
        self, roads: Roads, place: Progress | None, here: int, speed: float | None, motion: int, count: int
    ) -> ResolvedAction:
        """Return the way of an agent along the first nodes of the route that the core has."""
        self._begin(roads, place, here, speed)
        core.go(roads.map, self._trips, 0, motion, count)
        return self._ended(roads, place)

    def _ended(self, roads: Roads, begun: Progress | None) -> ResolvedAction:
        """Return the way that the core has written, of an agent that was on its node or there on an edge."""
        return self._written.ended(0, roads.ids, roads.edge_ids, begun)


def no_way(here: int, end: int, target: int, *, is_paced: bool, may_turn: bool) -> BadValue:
    """Return the error of an agent on an edge from `here` to `end` that cannot get to a node."""
    if not is_paced:
        return BadValue(f"Node {target} is no end of the edge from node {here} to node {end}.")
    return BadValue(str(NoPath(end, target))) if may_turn or target != here else one_way(here, end)


def one_way(source: int, target: int) -> BadValue:
    """Return the error of agents that cannot turn round on an edge."""
    return BadValue(
        f"The edge from node {source} to node {target} is a one-way road: the agent cannot turn round on "
        f"it; legal is node {target}, and what lies beyond."
    )
