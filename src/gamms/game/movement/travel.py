"""Travel by metres: maps and paths in the form of `gamms.core.travel`, and moves of the game of a context by ids.

`map_of`, `ReachableNodes` and `TurnPaths` hold the data of the core, for one game or many, with rows of nodes and
edges. `Travel` finds legal nodes and moves of agents in the game of a context, by ids.
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

SLACK = 1e-9  # of a turn, as in the core
_REMEMBERED = 64  # the number of stored nodes on the path of each agent, 16 bytes each
_MORE_LEGS = 3  # legs that a path may have in addition to its nodes
ENDLESS = 1 << 32  # edges: more than any path has
_MOTIONS = tuple(Motion)


def map_of(
    columns: GraphColumns,
    costs: FloatArray,
    seconds: FloatArray | None,
    turn_seconds: float,
    leaving: tuple[IntArray, IntArray] | None = None,
) -> core.RoadEdges:
    """Return the edges of a graph in the form of the core.

    Args:
        columns: the columns of the graph.
        costs: (edges,) the costs by which agents choose paths.
        seconds: (edges,) the minimum travel time of each edge; None: edges have no speed limits.
        turn_seconds: the duration of a turn, in the time unit of speeds.
        leaving: offsets and rows of the edges out of each node, of one map or several; None: those of the graph.
    """
    offsets, edges = (columns.offsets, columns.out_edges) if leaving is None else leaving
    ints = [columns.node_ids, offsets, edges, columns.sources, columns.targets]
    floats = [columns.lengths, costs, np.zeros(0) if seconds is None else seconds]
    views: list[Any] = [np.ascontiguousarray(column, np.int64).data for column in ints]
    views += [np.ascontiguousarray(column, np.float64).data for column in floats]
    return core.RoadEdges(*[*views, turn_seconds])


class ReachableNodes:
    """The nodes that an agent can reach, found by the core.

    Args:
        nodes: the number of nodes.

    Attributes:
        core: the form of the core.
        nodes, times: (nodes,) rows and arrival times; the first ones are in use.
    """

    def __init__(self, nodes: int) -> None:
        ints = np.zeros((6, nodes), np.int64)
        floats = np.zeros((2, nodes))
        self.nodes = ints[0]
        self.times = floats[0]
        listed, heap, places, rank, seen = (column.data for column in ints[1:])
        self.core = core.ReachSearch(self.nodes.data, self.times.data, listed, heap, places, floats[1].data, rank, seen)


class TurnPaths:
    """The paths of agents through a turn, written by the core; see `core.TurnPaths` for the columns.

    Args:
        rows: the number of agents.
        most: the maximum number of legs of an agent.
        route: the maximum number of nodes of a route; None: equal to `most`.

    Attributes:
        core: the form of the core.
    """

    def __init__(self, rows: int, most: int, route: int | None = None) -> None:
        states = np.zeros((6, rows), np.int64)
        shares = np.zeros((4, rows))
        self.node, self.edge, self.motion, self.left, self.legs, self.passed = states
        self.share, self.now, self.speed, self.pace = shares
        self.most = most
        self.edges = np.zeros((rows, most), np.int64)
        self.backs = np.zeros((rows, most), np.int64)
        self.nodes = np.zeros((rows, most + 1), np.int64)
        parts = np.zeros((4, rows, most))
        self.times = np.zeros((rows, most + 1))
        self.route = np.zeros(most if route is None else route, np.int64)
        self.begins, self.ends, self.since, self.until = parts
        columns = (*states, *shares, self.edges, self.backs, *parts, self.nodes, self.times, self.route)
        views: list[Any] = [column.reshape(-1).data for column in columns]
        self.core = core.TurnPaths(most, *views)
        # NOTE: items of memoryviews are numbers of Python, which arrays make in twice the time (benchmarks: travel).
        self._edge = views[1]
        self._motion = views[2]
        self._counts = views[4]
        self._passed = views[5]
        self._share = views[6]
        self._legs = views[10:16]
        self._nodes = views[16]
        self._times = views[17]

    def ended(self, row: int, ids: Sequence[int], edge_ids: "EdgeIds", begun: Progress | None) -> "ResolvedAction":
        """Return the path that the core has written for an agent.

        Args:
            row: the row of the agent.
            ids: node ids by row.
            edge_ids: edge ids by row.
            begun: the agent's position on an edge at the start; None: it was on a node.
        """
        # NOTE: loops without generators, because each agent goes a way in each turn (benchmarks: travel).
        edges, backs, begins, ends, since, until = self._legs
        legs = list[Leg]()
        first = row * self.most
        for place in range(first, first + self._counts[row]):
            source, target, id = edge_ids[edges[place]]
            back = None if backs[place] < 0 else edge_ids[backs[place]][2]
            leg = Leg(source, target, id, begins[place], ends[place], since[place], until[place], back)
            legs.append(leg)
        first += row  # a path has one node more than legs
        last = first + self._passed[row]
        path = [ids[node] for node in self._nodes[first:last]]
        progress = None
        edge = self._edge[row]
        if edge >= 0:
            source, target, id = edge_ids[edge]
            progress = Progress(source, target, self._share[row], id, _MOTIONS[self._motion[row]])
        passed = tuple(self._times[first:last])
        return ResolvedAction(path[-1], tuple(path), (), passed, progress, tuple(legs), begun)


EdgesAt = tuple[tuple[IntArray, IntArray], tuple[IntArray, IntArray]]
"""The edges out of each node and into each node, as offsets (nodes + 1,) and rows of edges."""


class StoredPaths:
    """Stored shortest paths of agents; edges with infinite cost are closed.

    Args:
        columns: the columns of the graph.
        costs: (edges,) the costs by which agents choose paths.
        rows: the number of agents.
        most: the maximum number of stored nodes of each path.
        edges_at: the open edges out of each node and into each node, as offsets and rows; None: those of the graph.
    """

    def __init__(
        self, columns: GraphColumns, costs: FloatArray, rows: int, most: int, edges_at: EdgesAt | None = None
    ) -> None:
        self._costs = costs
        self._columns = columns
        entering = kernels.group_rows(columns.targets, len(columns.node_ids))
        self._take_edges(((columns.offsets, columns.out_edges), entering) if edges_at is None else edges_at)
        self._begin(rows, most)

    def _take_edges(self, edges_at: EdgesAt) -> None:
        leaving, entering = edges_at
        self._leaving = _of_finite_costs(self._costs, leaving)
        self._entering = _of_finite_costs(self._costs, entering)

    def _begin(self, rows: int, most: int) -> None:
        self.most = most
        self._ints: Any = np.zeros((3, rows), np.int64)
        self._ints[0] = -1  # the goal
        self._nodes: Any = np.zeros(rows * most, np.int64)
        self._far: Any = np.zeros(rows * most)
        self._plain: list[core.RoadEdges] = []  # the maps in use,
        self._back: list[core.RoadEdges] = []  # and with all edges reversed

    def apart(self, rows: int, most: int) -> "StoredPaths":
        """Return a copy with room for other numbers of agents and nodes."""
        twin = copy(self)
        twin._begin(rows, most)
        return twin

    def ways(self, roads: core.RoadEdges, reach: ReachableNodes) -> core.GoalPaths:
        """Return the paths in the form of the core, for one thread on a map."""
        columns: Any = [column.data for column in (*self._ints, self._nodes, self._far)]
        direct: Any = np.zeros(len(self._costs), np.uint8).data
        turned = replace(self._columns, sources=self._columns.targets, targets=self._columns.sources)
        back = map_of(turned, self._costs, None, 1.0, self._entering)
        self._back.append(back)
        return core.GoalPaths(*[roads, back, reach.core, direct, self.most, *columns])

    def plain_ways(self, reach: ReachableNodes) -> core.GoalPaths:
        """Return the paths in the form of the core, on a map where only costs matter."""
        roads = map_of(self._columns, self._costs, None, 1.0, self._leaving)
        self._plain.append(roads)
        return self.ways(roads, reach)

    def take_maps(self, edges_at: EdgesAt, moved: IntArray) -> None:
        """Switch to other maps, and keep the paths on those that remain.

        Args:
            edges_at: the open edges out of each node and into each node, of one map after the other.
            moved: (old maps,) the new place of the first node of each old map; -1: it is gone.
        """
        self._take_edges(edges_at)
        for maps, (offsets, rows) in ((self._plain, self._leaving), (self._back, self._entering)):
            for one in maps:
                one.take(kernels.buffer(offsets), kernels.buffer(rows))
        nodes = len(self._columns.node_ids)
        goal = self._ints[0]
        first = moved[goal // nodes]
        goal[:] = np.where((goal >= 0) & (first >= 0), first + goal % nodes, -1)


class PathFinder:
    """The nodes of one revision of a graph by id, and the shortest paths of the agents of one game.

    Args:
        columns: the columns of the graph.
        costs: (edges,) the costs by which agents choose paths.

    Attributes:
        ids: node ids by row.
        reach: working memory, with the nodes found last.
    """

    def __init__(self, columns: GraphColumns, costs: FloatArray) -> None:
        self._columns = columns
        self._costs = costs
        self.ids: list[int] = columns.node_ids.tolist()
        self._row_of = {id: row for row, id in enumerate(self.ids)}
        self.reach = ReachableNodes(len(self.ids))
        self._found = self.reach.nodes.data
        self._ways: core.GoalPaths | None = None
        self._agents = 0  # the number of agents that `_ways` has room for

    def row(self, node: int) -> int:
        """Return the row of a node.

        Raises:
            UnknownName (KeyError): the node does not exist.
        """
        try:
            return self._row_of[node]
        except KeyError:
            raise UnknownName("node", node) from None

    def found(self, count: int) -> tuple[int, ...]:
        """Return the ids of the first `count` nodes found last."""
        ids = self.ids
        return tuple([ids[row] for row in self._found[:count].tolist()])

    def ways(self, agent: int) -> core.GoalPaths:
        """Return the paths of agents, with room for an agent of this row."""
        if self._ways is None or agent >= self._agents:
            self._agents = 2 * agent + 2
            self._ways = StoredPaths(self._columns, self._costs, self._agents, _REMEMBERED).plain_ways(self.reach)
        return self._ways


class EdgeIds(dict[int, tuple[int, int, int]]):
    """Row of an edge -> the ids of its source, of its target, and of the edge.

    NOTE: entries are cached, because each agent looks around in each turn (benchmarks: travel).
    """

    def __init__(self, columns: GraphColumns) -> None:
        super().__init__()
        self._columns = columns

    def __missing__(self, row: int) -> tuple[int, int, int]:
        columns = self._columns
        source, target = columns.node_ids[[columns.sources[row], columns.targets[row]]].tolist()
        found = self[row] = source, target, columns.edge_ids.item(row)
        return found


class RoadMap(PathFinder):
    """The edges of one revision of a graph by id; of parallel edges the cheapest counts, then the first.

    Args:
        graph: the graph.
        columns: the columns of the graph.
        weight: the edge weight by which agents choose paths.
        seconds: (edges,) the minimum travel time of each edge; None: edges have no speed limits.
        turn_seconds: the duration of a turn, in the time unit of speeds.

    Attributes:
        map: the form of the core.
        edge_ids: edge ids by row.
    """

    def __init__(
        self, graph: IGraph, columns: GraphColumns, weight: str | None, seconds: Any, turn_seconds: float
    ) -> None:
        super().__init__(columns, graph.weights(weight))
        self._graph = graph
        self.map = map_of(columns, self._costs, seconds, turn_seconds)
        self._edge_row_of = {id: row for row, id in enumerate(columns.edge_ids.tolist())}
        self.edge_ids = EdgeIds(columns)
        self._lines: dict[int, Line] = {}  # by the id of an edge

    def on(self, edge: int) -> int | None:
        """Return the row of an edge by its id; None: it does not exist."""
        return self._edge_row_of.get(edge)

    def of(self, place: Progress) -> int:
        """Return the row of the edge that an agent is on.

        Raises:
            UnknownName (KeyError): the edge was closed; agents leave closed edges before they decide.
        """
        row = self._edge_row_of.get(place.edge)
        if row is None:
            raise UnknownName("edge", place.edge)
        return row

    @cached_property
    def xy(self) -> list[tuple[float, float]]:
        """The positions of nodes, by row."""
        return [*map(tuple, self._columns.xy.tolist())]

    def located(self, place: Progress) -> OnEdge | None:
        """Return the position of an agent on an edge; see `typing.on_edges.located`."""
        row = self._edge_row_of.get(place.edge)
        if row is None:
            return None
        line = self._lines.get(place.edge)
        if line is None:
            line = self._lines[place.edge] = Line.of(self._graph.get_edge(place.edge).points)
        return placed(place, self._columns.lengths.item(row), line)


def _of_finite_costs(costs: FloatArray, edges_at: tuple[IntArray, IntArray]) -> tuple[IntArray, IntArray]:
    """Return offsets and rows of edges without edges of infinite cost."""
    offsets, edges = edges_at
    kept = np.isfinite(costs)[edges]
    return np.concatenate(([0], np.cumsum(kept)))[offsets], edges[kept]


class ResolvedAction(NamedTuple):
    """A checked action of one agent: its move and its deeds."""

    end: int  # node id
    path: tuple[int, ...]  # node ids, from the agent's node to the end
    heading: Any = ()  # the new heading (cos, sin), None to follow moves again, () for no change
    times: tuple[float, ...] = ()  # the time at each node of the path, from 0 to 1; (): evenly spaced
    progress: Progress | None = None  # the position on an edge beyond the end of the path
    legs: tuple[Leg, ...] = ()  # by metres
    begun: Progress | None = None  # by metres, the position on an edge before the turn
    position: Position | None = None  # of an agent that flies
    quat: Quat | None = None
    deeds: Mapping[str, dict[str, Any]] | None = None  # deed -> field -> value


def progress_at(leg: Leg, time: float) -> Progress | None:
    """Return the position of an agent on a leg at a time of the turn; None: it is on a node."""
    share = core.share_at(leg.begin, leg.end, leg.since, leg.until, time)
    if not 0.0 < share < 1.0:
        return None
    return Progress(leg.source, leg.target, share, leg.edge, _MOTIONS[core.motion_of(leg.begin, leg.end)])


class Travel:
    """Finds the moves of agents in a game by metres.

    Args:
        ctx: the context, for its graph and agents.
        settings: the settings of the game.

    Attributes:
        now: the time in the turn, from 0 to 1, at which agents decide.
    """

    def __init__(self, ctx: HostContext, settings: Settings) -> None:
        self._ctx = ctx
        self._settings = settings
        self._roads: RoadMap | None = None
        self._key: tuple[Any, ...] = ()
        self.now = 0.0
        self._make_room(0)

    @property
    def roads(self) -> RoadMap:
        """The edges of the current revision of the graph."""
        graph = self._ctx.graph.graph
        settings = self._settings
        key = graph.revision, settings.weight, settings.speed_unit, settings.turn_seconds
        if self._roads is None or key != self._key or key[0] is None:
            turn_seconds = settings.turn_seconds if settings.speed_unit == "metres_per_second" else 1.0
            has_speeds = settings.weight == "travel_time" and settings.speed_unit == "metres_per_second"
            seconds = graph.weights(settings.weight) if has_speeds else None
            roads = RoadMap(graph, self._ctx.graph.columns(), settings.weight, seconds, turn_seconds)
            self._roads = roads
            self._key = key
            self._make_room(len(roads.ids) + _MORE_LEGS)
        return self._roads

    def place(self, row: int) -> Progress | None:
        """Return the position of an agent on an edge; None: it is on its node."""
        place: Progress | None = self._ctx.agent.block.on_edge(row)
        return place

    def is_going(self, place: Progress) -> bool:
        """Return whether an agent moves along an edge that exists, or back where it can turn around."""
        edge = self.roads.on(place.edge)
        return edge is not None and core.is_going(self.roads.map, edge, place.motion)

    def reachable(self, place: Progress | None, here: int, speed: float | None) -> tuple[int, ...]:
        """Return the legal nodes of an agent: the nodes next to it, then the nodes that it can reach in this turn.

        An agent whose edge was closed counts as on the node that it passed last. An agent under way that decides on
        arrival gets the nodes that it can reach from the end of its edge.
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

    # -- moves ----------------------------------------------------------------------------------------------------

    def stay(self, place: Progress | None, here: int) -> ResolvedAction:
        """Return the move of an agent that stops at its position, on an edge or a node."""
        if place is None:
            return ResolvedAction(here, (here,), (), (self.now,))
        roads = self.roads
        self._begin(roads, place._replace(motion=Motion.STOPPED), here, None)
        core.stand(roads.map, self._trips, 0)
        return self._ended(roads, place)

    def go_on(self, place: Progress, here: int, speed: float | None) -> ResolvedAction:
        """Return the move of an agent that continues to the end of its edge."""
        return self._go(self.roads, place, here, speed, place.motion, 0)

    def along(self, place: Progress | None, here: int, speed: float | None, route: list[int]) -> ResolvedAction:
        """Return the move along a route of nodes, as far as the turn allows.

        Raises:
            BadValue: an edge of the route is missing, or the agent would have to turn around on a one-way road.
        """
        if not route:
            return self.stay(place, here)
        roads = self.roads
        nodes = route[1:] if route[0] == here else route
        at = here
        motion = Motion.FORWARD
        if place is not None and nodes and nodes[0] == place.target:
            nodes = nodes[1:]
            at = place.target
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
        """Return the move of an agent along the shortest path toward a node, as far as the turn allows.

        Raises:
            BadValue: there is no path.
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

    # -- calls of the core -------------------------------------------------------------------------------------------

    def _make_room(self, most: int) -> None:
        """Allocate memory for paths with `most` legs."""
        self._written = trips = TurnPaths(1, most)
        self._most = most
        self._trips = trips.core
        self._route = trips.route.data

    def _begin(self, roads: RoadMap, place: Progress | None, here: int, speed: float | None) -> None:
        """Place an agent at the start of its path."""
        edge, share, motion = (-1, 0.0, 0) if place is None else (roads.of(place), place.share, place.motion)
        pace = nan if speed is None else speed
        most = 1 if self._settings.decide == "arrival" else ENDLESS
        core.begin(self._trips, 0, roads.row(here), edge, share, motion, self.now, pace, most)

    def _go(
        self, roads: RoadMap, place: Progress | None, here: int, speed: float | None, motion: int, count: int
    ) -> ResolvedAction:
        """Return the move along the first `count` nodes of the route in the core."""
        self._begin(roads, place, here, speed)
        core.go(roads.map, self._trips, 0, motion, count)
        return self._ended(roads, place)

    def _ended(self, roads: RoadMap, begun: Progress | None) -> ResolvedAction:
        """Return the path that the core has written."""
        return self._written.ended(0, roads.ids, roads.edge_ids, begun)


def no_way(here: int, end: int, target: int, *, is_paced: bool, may_turn: bool) -> BadValue:
    """Return the error for an agent on an edge from `here` to `end` that cannot reach a node."""
    if not is_paced:
        return BadValue(f"Node {target} is no end of the edge from node {here} to node {end}.")
    return BadValue(str(NoPath(end, target))) if may_turn or target != here else one_way(here, end)


def one_way(source: int, target: int) -> BadValue:
    """Return the error for an agent that cannot turn around on an edge."""
    return BadValue(
        f"The edge from node {source} to node {target} is a one-way road: the agent cannot turn round on "
        f"it; legal is node {target}, and what lies beyond."
    )
