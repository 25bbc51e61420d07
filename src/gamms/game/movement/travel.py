"""Travel by metres: maps and paths in the form of `gamms.core.travel`, and moves of the game of a context by ids.

`make_map`, `ReachableNodes` and `TurnPaths` hold the data of the core, for one game or many, with rows of nodes and
edges. `Travel` finds legal nodes and paths of agents in the game of a context, and `GamePaths` holds these paths: their
ids are only looked up when code reads them.
"""

from array import array
from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property, lru_cache
from math import nan
from typing import Any, NamedTuple

import numpy as np

from gamms import kernels
from gamms.core import by_edges
from gamms.core import travel as core
from gamms.core.ask import TravelSearch
from gamms.core.block import INT64
from gamms.errors import BadValue, NoPath, UnknownName
from gamms.game.settings import Settings
from gamms.ir.agents import Position, Quat
from gamms.ir.graph import (
    FloatArray,
    GraphColumns,
    IntArray,
    apply_mode,
    find_edge_weights,
    find_usable_edges,
    list_forbidden_paths,
    split_mode,
)
from gamms.ir.obstacles import BoolArray
from gamms.ir.progress import Motion, Progress
from gamms.typing.context import HostContext, IContext
from gamms.typing.game import Leg, Track
from gamms.typing.graph_engine import IGraph
from gamms.typing.on_edges import Line, OnEdge, locate_on_edge
from gamms.typing.routes import TurnRoutes

SLACK = 1e-9  # of a turn, as in the core
_REMEMBERED = 64  # the number of stored nodes on the path of each agent, 16 bytes each
_MORE_LEGS = 3  # legs that a path may have in addition to its nodes
_MOTIONS = tuple(Motion)
_FIRST_ROOM = 8  # legs
_OF_LEGS = ("edges", "backs", "begins", "ends", "since", "until")
_COLUMNS = (
    *("node", "edge", "motion", "left", "legs", "passed", "share", "now", "speed", "pace"),
    *(*_OF_LEGS, "nodes", "times", "route"),
)
NO_ROWS = np.zeros(0, np.int64)
STAYS = -1  # the number of nodes on the route of an agent that stays


def make_map(
    columns: GraphColumns,
    costs: FloatArray,
    seconds: FloatArray | None,
    turn_seconds: float,
    leaving: tuple[IntArray, IntArray] | None = None,
) -> core.RoadEdges:
    """Return the edges of a graph in the form of the core.

    Args:
        columns: the columns of the graph.
        costs: (edges,) the costs by which agents choose paths; or (kinds, edges), see `core.RoadEdges`.
        seconds: the minimum travel times of edges, in the same form; None: edges have no speed limits.
        turn_seconds: the duration of a turn, in the time unit of speeds.
        leaving: offsets and rows of the edges out of each node, of one map or several; None: those of the graph.
    """
    offsets, edges = (columns.offsets, columns.out_edges) if leaving is None else leaving
    ints = [columns.node_ids, offsets, edges, columns.sources, columns.targets]
    floats = [columns.lengths, np.ravel(costs), np.zeros(0) if seconds is None else np.ravel(seconds)]
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


class RoadIds:
    """The nodes and edges of paths by id.

    Args:
        columns: the columns of the graph.
        ids: node ids by row.
        map: the form of the core.
        revision: the revision of the graph; None: that of no single game.

    Attributes:
        ids, map, revision: see the arguments.
        edge_ids: ids of the edges by row.
        edges: (edges,) these ids as memory.
    """

    def __init__(self, columns: GraphColumns, ids: list[int], map: core.RoadEdges, revision: int | None) -> None:
        self.ids = ids
        self.map = map
        self.revision = revision
        self.edge_ids: Any = EdgeIds(columns)
        self.edges: Any = np.ascontiguousarray(columns.edge_ids, np.int64).data


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
        self._shape = rows, most
        self._memory = _make_memory(rows, most, most if route is None else route)
        self.core = core.TurnPaths(rows, most, *self._memory)
        columns = {name: np.asarray(getattr(self.core, name)) for name in _COLUMNS}
        self.node = columns["node"]
        self.edge = columns["edge"]
        self.share = columns["share"]
        self.motion = columns["motion"]
        self.legs = columns["legs"]
        self.passed = columns["passed"]
        self.edges, self.backs, self.begins, self.ends, self.since, self.until = (
            columns[name].reshape(rows, most) for name in _OF_LEGS
        )
        self.nodes = columns["nodes"].reshape(rows, most + 1)
        self.times = columns["times"].reshape(rows, most + 1)
        self.route = columns["route"]

    def bind_thread(self, route: int) -> core.TurnPaths:
        """Return the same paths for one thread, which has its own memory for a route of so many nodes."""
        found = core.TurnPaths(*self._shape, *self._memory)
        nodes: Any = np.zeros(route, np.int64).data
        found.take_route(nodes)
        return found


def make_paths_of_one(most: int) -> core.TurnPaths:
    """Return memory for the path of one agent, along `most` edges or over a route of `most` nodes."""
    return core.TurnPaths(1, most, *_make_memory(1, most, most))


def _make_memory(rows: int, most: int, route: int) -> tuple[Any, Any]:
    """Return memory for the integers and the floats of `core.TurnPaths`."""
    # NOTE: two pieces, because each turn of a game has paths of its own (benchmarks: travel).
    nodes = rows * (most + 1)
    ints = memoryview(bytearray(8 * (rows * (6 + 2 * most) + nodes + route)))
    floats = memoryview(bytearray(8 * (rows * (4 + 4 * most) + nodes)))
    return ints.cast(INT64), floats.cast("d")  # type: ignore[call-overload] # as in `core.block`


class _PathColumns(NamedTuple):
    """Columns of `core.TurnPaths`."""

    node: memoryview
    edge: memoryview
    motion: memoryview
    legs: memoryview
    passed: memoryview
    share: memoryview
    nodes: memoryview
    times: memoryview
    edges: memoryview
    backs: memoryview
    begins: memoryview
    ends: memoryview
    since: memoryview
    until: memoryview


class GamePaths(core.PathsBySlot):
    """The paths of the agents of one game through a turn, by slot.

    Args:
        agents: the number of agents.
        most: the number of legs of an agent for which there is room at first.

    Attributes:
        maps: the ids of the map on which each path was found, or `NodeIds`: it is over nodes; None: the agent has no
            path, but stays, or moves to a node.
        core: the form of the core.
    """

    def __init__(self, agents: int, most: int = _FIRST_ROOM) -> None:
        super().__init__(agents, Progress, _MOTIONS)
        self._make_room(most)

    def _make_room(self, most: int) -> None:
        """Allocate memory for `most` legs of each agent."""
        self._most = most
        self.core = core.TurnPaths(len(self.maps), most, *_make_memory(len(self.maps), most, 0))
        self._read: _PathColumns | None = None

    @property
    def _columns(self) -> "_PathColumns":
        """The columns as Python reads them."""
        if self._read is None:
            # NOTE: items of memoryviews are numbers of Python, which arrays make more slowly (benchmarks: travel).
            self._read = _PathColumns(*[memoryview(getattr(self.core, name)) for name in _PathColumns._fields])
        return self._read

    def drop(self, slots: Iterable[int]) -> None:
        """Drop the paths of some agents."""
        for i in slots:
            self.maps[i] = None
            self._columns.legs[i] = 0

    def walk(
        self, i: int, path: Sequence[int], progress: Progress | None = None, times: Sequence[float] | None = None
    ) -> None:
        """Set the path of an agent over nodes.

        Args:
            i: its slot.
            path: the ids of the nodes.
            progress: the part of an edge beyond the last node that it covers; None: none.
            times: the time at each node; None: they are evenly spaced from 0 to 1.
        """
        self.reserve(len(path))
        ahead, covered = (0, 0.0) if progress is None else (progress.target, progress.share)
        core.begin(self.core, i, path[-1], 0, covered, Motion.NONE, 0.0, nan, 0)
        columns = self._columns
        columns.edge[i] = ahead
        columns.passed[i] = len(path)
        first = i * (self._most + 1)
        last = first + len(path)
        columns.nodes[first:last] = array(INT64, path)
        columns.times[first:last] = _space_evenly(len(path)) if times is None else array("d", times)
        self.maps[i] = BY_IDS

    def reserve(self, legs: int) -> bool:
        """Make room for so many legs of an agent, and legs before and after them; return whether memory is new."""
        if legs + _MORE_LEGS <= self._most:
            return False
        before = self.core
        self._make_room(2 * legs + _MORE_LEGS)
        for i, roads in enumerate(self.maps):
            if roads is not None:
                core.copy_trip(before, i, self.core, i)
        return True

    @property
    def most(self) -> tuple[int, int]:
        """The maximum numbers of legs and of nodes of an agent."""
        return self.count_most_legs(), self.count_most_nodes()

    # -- one agent --------------------------------------------------------------------------------------------------

    def is_moving(self, i: int) -> bool:
        """Return whether an agent covers part of an edge."""
        if self._is_over_nodes(i):
            return bool(self._columns.passed[i] > 1 or self._columns.share[i] > 0.0)
        return self.maps[i] is not None and core.is_moving(self.core, i)

    def go_in_part(self, i: int, part: int, parts: int) -> None:
        """Fit the path of an agent into one of several equal parts of the turn; until then it waits at its start."""
        if self.maps[i] is not None and (self._columns.legs[i] or self._columns.passed[i] > 1):
            core.go_in_part(self.core, i, part, parts)

    def are_steps(self) -> bool:
        """Return whether no agent has a path here."""
        return all(roads is None for roads in self.maps)

    def is_on_roads(self, i: int) -> bool:
        """Return whether an agent has a path by metres."""
        return self.maps[i] is not None and not self._is_over_nodes(i)

    def _is_over_nodes(self, i: int) -> bool:
        return isinstance(self.maps[i], NodeIds)

    def count_legs(self, i: int) -> int:
        """Return the number of legs of an agent."""
        return 0 if self.maps[i] is None else self._columns.legs[i]

    def count_room(self, i: int) -> int:
        """Return the number of legs of an agent with a path, or of its nodes, if there are more."""
        return int(max(self._columns.legs[i], self._columns.passed[i]))

    def end(self, i: int) -> int:
        """Return the id of the node that an agent with a path passes last."""
        roads = self.maps[i]
        assert roads is not None  # noqa: S101 - it has a path
        node: int = roads.ids[self._columns.node[i]]
        return node

    def get_first_leg(self, i: int) -> Leg | None:
        """Return the first leg of an agent if it begins on an edge."""
        if self.maps[i] is None or not core.is_on_edge_at_start(self.core, i):
            return None
        return self.list_legs(i)[0]

    def make_track(self, i: int) -> Track | None:
        """Return the track of an agent; None: it has no path."""
        roads = self.maps[i]
        if roads is None:
            return None
        columns = self._columns
        first = i * (self._most + 1)
        last = first + columns.passed[i]
        ids = roads.ids
        path = [ids[node] for node in columns.nodes[first:last]]
        return Track(tuple(path), tuple(columns.times[first:last]), tuple(self.list_legs(i)))

    def _list_nodes_beyond(self, i: int) -> list[int]:
        """Return the ids of the nodes on the path of an agent over nodes, beyond the first."""
        columns = self._columns
        first = i * (self._most + 1)
        ahead = [columns.edge[i]] if columns.share[i] else []
        rows = [*columns.nodes[first + 1 : first + columns.passed[i]], *ahead]
        return [self.maps[i].ids[row] for row in rows]

    def list_legs(self, i: int) -> list[Leg]:
        """Return the legs of an agent with a path."""
        # NOTE: loops without generators, because each agent goes a way in each turn (benchmarks: travel).
        columns = self._columns
        edges, backs, begins, ends, since, until = columns[-6:]
        roads: Any = self.maps[i]
        legs = list[Leg]()
        for place in range(i * self._most, i * self._most + columns.legs[i]):
            source, target, id = roads.edge_ids[edges[place]]
            back = None if backs[place] < 0 else roads.edge_ids[backs[place]][2]
            legs.append(Leg(source, target, id, begins[place], ends[place], since[place], until[place], back))
        return legs

    def make_route(self, i: int, *, of_edges: bool = False) -> tuple[int, int, list[int]]:
        """Return the path of an agent as `core.ChosenRoutes` takes it: a count, a motion and ids.

        The count is for an agent that passes no more nodes. The ids are those of the nodes, or of the edges to them.
        """
        legs = self.list_legs(i)
        targets = [leg.edge if of_edges else leg.target for leg in legs] if legs else self._list_nodes_beyond(i)
        if not targets or not core.is_on_edge_at_start(self.core, i):
            return STAYS, Motion.FORWARD, targets
        motion = self._columns.motion[i]
        if not core.is_moving(self.core, i):  # it stands, or is on its way and too slow to get on
            return (STAYS if motion == Motion.STOPPED else 0), motion, []
        return 0, core.get_motion(legs[0].begin, legs[0].end), targets[1:]


@lru_cache(maxsize=256)
def _space_evenly(nodes: int) -> Any:
    """Return the times at the nodes of a path, evenly spaced from 0 to 1, as memory."""
    return array("d", [number / max(1, nodes - 1) for number in range(nodes)])


class _SameIds(dict[int, int]):
    def __missing__(self, id: int) -> int:
        return id


class NodeIds(RoadIds):
    """The ids of paths over nodes.

    Args:
        ids: node ids by row; None: the columns have ids in place of rows.
    """

    def __init__(self, ids: list[int] | None = None) -> None:
        same: Any = _SameIds()
        self.ids = same if ids is None else ids
        self.edge_ids = None


BY_IDS = NodeIds()
EdgesAt = tuple[tuple[IntArray, IntArray], tuple[IntArray, IntArray]]
"""The edges out of each node and into each node, as offsets (nodes + 1,) and rows of edges."""


class StoredPaths:
    """Stored shortest paths of agents; edges with infinite cost are closed.

    Args:
        columns: the columns of the graph.
        costs: (edges,) or (kinds, edges) the costs by which agents choose paths.
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
        self._take_edges(((columns.offsets, columns.out_edges), entering) if edges_at is None else edges_at, NO_ROWS)
        self._begin(rows, most)

    def _take_edges(self, edges_at: EdgesAt, first_costs: IntArray) -> None:
        leaving, entering = edges_at
        self._leaving = self._select_open(leaving, first_costs)
        self._entering = self._select_open(entering, first_costs)

    def _select_open(self, edges_at: tuple[IntArray, IntArray], first_costs: IntArray) -> tuple[IntArray, IntArray]:
        """Return offsets and rows of edges without edges of infinite cost."""
        offsets, edges = edges_at
        is_finite = np.isfinite(self._costs).ravel()
        if not len(first_costs):
            return _select_edges(is_finite[edges], edges_at)
        counts = np.diff(offsets[:: len(self._columns.node_ids)])
        return _select_edges(is_finite[edges + np.repeat(first_costs, counts)], edges_at)

    def _begin(self, rows: int, most: int) -> None:
        self.most = most
        self._ints: Any = np.zeros((3, rows), np.int64)
        self._ints[0] = -1  # the goal
        self._nodes: Any = np.zeros(rows * most, np.int64)
        self._far: Any = np.zeros(rows * most)
        self._plain: list[core.RoadEdges] = []  # the maps in use,
        self._back: list[core.RoadEdges] = []  # and with all edges reversed

    def copy_with_room(self, rows: int, most: int) -> "StoredPaths":
        """Return a copy with room for other numbers of agents and nodes."""
        twin = copy(self)
        twin._begin(rows, most)
        return twin

    def get_ways(self, roads: core.RoadEdges, reach: ReachableNodes) -> core.GoalPaths:
        """Return the paths in the form of the core, for one thread on a map."""
        columns: Any = [column.data for column in (*self._ints, self._nodes, self._far)]
        direct: Any = np.zeros(len(self._columns.edge_ids), np.uint8).data
        turned = replace(self._columns, sources=self._columns.targets, targets=self._columns.sources)
        back = make_map(turned, self._costs, None, 1.0, self._entering)
        self._back.append(back)
        return core.GoalPaths(*[roads, back, reach.core, direct, self.most, *columns])

    def get_plain_ways(self, reach: ReachableNodes) -> core.GoalPaths:
        """Return the paths in the form of the core, on a map where only costs matter."""
        roads = make_map(self._columns, self._costs, None, 1.0, self._leaving)
        self._plain.append(roads)
        return self.get_ways(roads, reach)

    def take_maps(self, edges_at: EdgesAt, moved: IntArray, first_costs: IntArray) -> None:
        """Switch to other maps, and keep the paths on those that remain.

        Args:
            edges_at: the open edges out of each node and into each node, of one map after the other.
            moved: (old maps,) the new place of the first node of each old map; -1: it is gone.
            first_costs: (maps,) see `core.RoadEdges`.
        """
        self._take_edges(edges_at, first_costs)
        for maps, (offsets, rows) in ((self._plain, self._leaving), (self._back, self._entering)):
            for one in maps:
                one.take(kernels.as_buffer(offsets), kernels.as_buffer(rows), kernels.as_buffer(first_costs))
        nodes = len(self._columns.node_ids)
        goal = self._ints[0]
        first = moved[goal // nodes]
        goal[:] = np.where((goal >= 0) & (first >= 0), first + goal % nodes, -1)


class PathFinder:
    """The nodes of one revision of a graph by id, and the shortest paths of the agents of one game.

    Args:
        columns: the columns of the graph.
        costs: (edges,) the costs by which agents choose paths.
        edges_at: the edges that agents may use out of each node and into each node; None: all.

    Attributes:
        ids: node ids by row.
        reach: working memory, with the nodes found last.
    """

    def __init__(self, columns: GraphColumns, costs: FloatArray, edges_at: EdgesAt | None = None) -> None:
        self.ids: list[int] = columns.node_ids.tolist()
        self._columns = columns
        self._costs = costs
        self._edges_at = edges_at
        self._row_of = RowsOfIds("node", self.ids)
        self.reach = ReachableNodes(len(self.ids))
        self._found = self.reach.nodes.data
        self._ways: core.GoalPaths | None = None
        self._agents = 0  # the number of agents that `_ways` has room for

    def find_row(self, node: int) -> int:
        """Return the row of a node.

        Raises:
            UnknownName (KeyError): the node does not exist.
        """
        return self._row_of[node]

    def list_found(self, count: int) -> tuple[int, ...]:
        """Return the ids of the first `count` nodes found last."""
        ids = self.ids
        return tuple([ids[row] for row in self._found[:count].tolist()])

    def get_ways(self, agent: int) -> core.GoalPaths:
        """Return the paths of agents, with room for an agent of this row."""
        if self._ways is None or agent >= self._agents:
            self._agents = 2 * agent + 2
            paths = StoredPaths(self._columns, self._costs, self._agents, _REMEMBERED, self._edges_at)
            self._ways = paths.get_plain_ways(self.reach)
        return self._ways


class RowsOfIds(dict[int, int]):
    """Id of a node or an edge -> its row; an unknown id raises an error.

    Args:
        kind: "node" or "edge".
        ids: the ids by row.
    """

    def __init__(self, kind: str, ids: Sequence[int]) -> None:
        super().__init__(zip(ids, range(len(ids)), strict=True))
        self._kind = kind

    def __missing__(self, id: int) -> int:
        raise UnknownName(self._kind, id)


class EdgeLines(dict[int, Line]):
    """Row of an edge -> its polyline, made on first use."""

    def __init__(self, graph: IGraph, edge_ids: Sequence[int]) -> None:
        super().__init__()
        self._graph = graph
        self._edge_ids = edge_ids

    def __missing__(self, row: int) -> Line:
        line = Line.from_flat(self._graph.get_edge(self._edge_ids[row]).points)
        self[row] = line
        return line


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
        found = source, target, columns.edge_ids.item(row)
        self[row] = found
        return found


class RoadMap(PathFinder, RoadIds):
    """The edges of one revision of a graph by id; of parallel edges the cheapest counts, then the first.

    Args:
        graph: the graph.
        columns: the columns of the graph.
        costs: (edges,) the costs by which agents choose paths.
        seconds: (edges,) the minimum travel time of each edge; None: edges have no speed limits.
        turn_seconds: the duration of a turn, in the time unit of speeds.
        mode: the edge attribute that says which edges agents may use; None: all.

    Attributes:
        seconds, turn_seconds, mode: see the arguments.
    """

    def __init__(
        self,
        graph: IGraph,
        columns: GraphColumns,
        costs: FloatArray,
        seconds: FloatArray | None,
        turn_seconds: float,
        mode: str | None = None,
    ) -> None:
        edges_at = None if mode is None else find_edges_at(columns, mode)
        self.seconds = seconds
        self.turn_seconds = turn_seconds
        self.mode = mode
        PathFinder.__init__(self, columns, costs, edges_at)
        roads = make_map(columns, self._costs, seconds, turn_seconds, edges_at and edges_at[0])
        RoadIds.__init__(self, columns, self.ids, roads, graph.revision)
        edge_ids = columns.edge_ids.tolist()
        self.edge_rows = RowsOfIds("edge", edge_ids)
        self.lines = EdgeLines(graph, edge_ids)

    @cached_property
    def turns(self) -> "TurnMap":
        """The states of traffic that obeys turn restrictions, for agents of the mode."""
        assert self.mode is not None  # noqa: S101 - it says that agents obey turns
        return TurnMap(self, self._columns, self._costs, self.mode)

    def get_row_of_edge(self, edge: int) -> int | None:
        """Return the row of an edge by its id; None: it does not exist."""
        return self.edge_rows.get(edge)

    def find_edge(self, source: int, target: int) -> int | None:
        """Return the id of the edge that agents take from one node to another; None: there is none now."""
        row_of = self._row_of
        if source not in row_of or target not in row_of:
            return None
        row = core.find_cheapest(self.map, row_of[source], row_of[target])
        return None if row < 0 else self.edge_ids[row][2]

    def find_cheapest(self, edges: Sequence[int]) -> int:
        """Return the id of the cheapest of several edges, the first of equal ones."""
        return min(edges, key=lambda edge: (self._costs[self.edge_rows[edge]], self.edge_rows[edge]))

    def list_edges(self, node: int) -> list[int]:
        """Return the ids of the edges that agents may take from a node to other nodes, in ascending order."""
        row = self._row_of.get(node)
        if row is None:
            return []
        columns = self._columns
        offsets, edges = (columns.offsets, columns.out_edges) if self._edges_at is None else self._edges_at[0]
        rows = edges[offsets[row] : offsets[row + 1]]
        return sorted(columns.edge_ids[rows[columns.targets[rows] != row]].tolist())

    def list_around(self, edge: int) -> list[int]:
        """Return the ids of an edge that an agent is on, and of the one for turning around, ascending."""
        row = self.edge_rows.get(edge)
        if row is None:
            return []
        back = core.find_reverse_edge(self.map, row)
        return sorted([edge] if back < 0 else [edge, self.edge_ids[back][2]])

    def join(self, others: Sequence["RoadMap"]) -> core.RoadEdges:
        """Return this map, and those of modes of the same graph behind it, in the form of the core."""
        every = [self, *others]
        columns = self._columns
        each = [(columns.offsets, columns.out_edges) if one._edges_at is None else one._edges_at[0] for one in every]
        offsets = np.concatenate(([0], np.cumsum(np.concatenate([np.diff(offsets) for offsets, _ in each]))))
        leaving = offsets, np.concatenate([rows for _, rows in each])
        costs = np.array([one._costs for one in every])
        found = make_map(columns, costs, None if self.seconds is None else costs, self.turn_seconds, leaving)
        first_costs = np.arange(len(every)) * len(columns.edge_ids)
        found.take(*map(kernels.as_buffer, (*leaving, first_costs)))
        return found

    def search(self, found: TravelSearch) -> None:
        """Let a search find paths on this map."""
        found.take_map(self.map, self.reach.core, self.ids, self.xy, self._row_of, self.edge_rows, self.lines)

    @cached_property
    def xy(self) -> list[tuple[float, float]]:
        """The positions of nodes, by row."""
        return [*map(tuple, self._columns.xy.tolist())]

    def locate(self, place: Progress) -> OnEdge | None:
        """Return the position of an agent on an edge; see `typing.on_edges.located`."""
        row = self.edge_rows.get(place.edge)
        return None if row is None else locate_on_edge(place, self._columns.lengths.item(row), self.lines[row])


def find_edges_at(columns: GraphColumns, mode: str) -> EdgesAt:
    """Return the edges that a mode may use out of each node and into each node, as offsets (nodes + 1,) and rows."""
    may_use = find_usable_edges(columns, mode)
    leaving = columns.offsets, columns.out_edges
    entering = kernels.group_rows(columns.targets, len(columns.node_ids))
    return _select_edges(may_use[leaving[1]], leaving), _select_edges(may_use[entering[1]], entering)


def _select_edges(kept: BoolArray, edges_at: tuple[IntArray, IntArray]) -> tuple[IntArray, IntArray]:
    """Return the offsets and rows of some of these edges; `kept` is a mask of the rows."""
    offsets, edges = edges_at
    return np.concatenate(([0], np.cumsum(kept)))[offsets], edges[kept]


class ResolvedAction(NamedTuple):
    """A checked action of one agent: its move and its deeds."""

    end: int  # node id
    path: tuple[int, ...]  # node ids, from the agent's node to the end; not by metres
    heading: Any = ()  # the new heading (cos, sin), None to follow moves again, () for no change
    progress: Progress | None = None  # the part of an edge beyond the end of the path that it has covered
    position: Position | None = None  # of an agent that flies
    quat: Quat | None = None
    deeds: Mapping[str, dict[str, Any]] | None = None  # deed -> field -> value
    edge: int | None = None  # id of the edge that the action has named, or that an agent that obeys turns takes

    def is_step(self) -> bool:
        """Return whether the agent stays, or moves along one edge to another node."""
        path = self.path
        return self.progress is None and (len(path) == 1 or (len(path) == 2 and path[0] != path[1]))


class Travel(TravelSearch):
    """Finds the paths of agents in a game by metres, on its present map: the last one that it has found can be read.

    Args:
        ctx: the context, for its graph and agents.
        settings: the settings of the game.
        mode: the edge attribute that says which edges the agents may use; None: all.

    Attributes:
        keeps_map: whether later changes of the graph do not count yet, because agents are on their way in a turn.
        like: the travel of agents of the mode in a game whose map is used as long as this game has the same; None: of
            no game. Only one of both is asked at a time, because they share working memory.
    """

    def __init__(self, ctx: HostContext, settings: Settings, mode: str | None = None) -> None:
        super().__init__()
        self._ctx = ctx
        self._mode = mode
        self._settings = settings
        self._roads: RoadMap | None = None
        self._key: tuple[Any, ...] = ()
        self.keeps_map = False
        self.like: Travel | None = None
        self._most = 0

    @property
    def roads(self) -> RoadMap:
        """The edges of the current revision of the graph, or of an earlier one, see `keeps_map`."""
        graph = self._ctx.graph.graph
        settings = self._settings
        self.at_arrivals = settings.decide == "arrival"
        revision = self._key[0] if self.keeps_map and self._key else graph.revision
        key = revision, settings.weight, settings.speed_unit, settings.turn_seconds
        if self._roads is None or key != self._key or key[0] is None:
            roads = None if self.like is None else self.like._get_roads(key)
            roads = roads or self._make_roads(graph)
            self._roads = roads
            self.found_on = roads
            self._key = key
            roads.search(self)
            self._make_room(len(roads.ids) + _MORE_LEGS)
        return self._roads

    def _get_roads(self, key: tuple[Any, ...]) -> RoadMap | None:
        """Return the edges of the current revision of the graph if they have this key; else None."""
        roads = self.roads
        return roads if self._key == key else None

    def _make_roads(self, graph: IGraph) -> RoadMap:
        """Return the edges of the current revision of the graph."""
        settings = self._settings
        turn_seconds = settings.turn_seconds if settings.speed_unit == "metres_per_second" else 1.0
        has_speeds = settings.weight == "travel_time" and settings.speed_unit == "metres_per_second"
        costs = weigh_edges(self._ctx, settings.weight, self._mode)
        seconds = costs if has_speeds else None
        return RoadMap(graph, self._ctx.graph.columns(), costs, seconds, turn_seconds, self._mode)

    def prepare(self, agents: int) -> None:
        """Prepare to find paths of agents below this row on the present map, until it changes."""
        self.take_ways(self.roads.get_ways(agents))

    def get_position(self, row: int) -> Progress | None:
        """Return the position of an agent on an edge; None: it is on its node."""
        place: Progress | None = self._ctx.agent.block.get_edge_position(row)
        return place

    # -- moves ----------------------------------------------------------------------------------------------------

    def stay(self, place: Progress | None, here: int) -> None:
        """Find the path of an agent that stops at its position, on an edge or a node."""
        roads = self.roads
        self.begin(here, place and place._replace(motion=Motion.STOPPED), None)
        core.stand(roads.map, self._trips, 0)

    def follow_route(self, place: Progress | None, here: int, speed: float | None, route: list[int]) -> None:
        """Find the path along a route of nodes, as far as the turn allows.

        Raises:
            BadValue: an edge of the route is missing, or the agent would have to turn around on a one-way road.
        """
        if not route:
            self.stay(place, here)
            return
        roads = self.roads
        nodes = route[1:] if route[0] == here else route
        at = here
        motion = Motion.FORWARD
        if place is not None and nodes and nodes[0] == place.target:
            nodes = nodes[1:]
            at = place.target
        elif place is not None:
            motion = Motion.BACK
            if core.find_reverse_edge(roads.map, roads.edge_rows[place.edge]) < 0:
                raise make_one_way_error(place.source, place.target)
        if len(nodes) + _MORE_LEGS > self._most:
            self._make_room(len(nodes) + _MORE_LEGS)
        for number, node in enumerate(nodes):
            self._route[number] = roads.find_row(node)
        flaw = core.find_missing_edge(roads.map, self._trips, roads.find_row(at), len(nodes))
        if flaw >= 0:
            raise BadValue(f"No edge leads from node {[at, *nodes][flaw]} to node {nodes[flaw]}.")
        self.begin(here, place, speed)
        core.go(roads.map, self._trips, 0, motion, len(nodes))

    def cross_edge(self, place: Progress | None, here: int, speed: float | None, edge: int) -> None:
        """Find the path of an agent to the end of an edge out of its node, or of the edge that it is on, or back on it.

        The path is as far as the turn allows.
        """
        roads = self.roads
        if place is None:
            _, target, _ = roads.edge_ids[roads.edge_rows[edge]]
            self.begin(here, Progress(here, target, 0.0, edge, Motion.FORWARD), speed)
        else:
            self.begin(here, place, speed)
        motion = Motion.FORWARD if place is None or place.edge == edge else Motion.BACK
        core.go(roads.map, self._trips, 0, motion, 0)
        if place is None and self._trips.share[0] == 0.0 and self._trips.edge[0] >= 0:  # it has not left its node
            self.stay(None, here)

    def find_path_towards(
        self, agent: int, place: Progress | None, here: int, speed: float | None, target: int
    ) -> None:
        """Find the shortest path of an agent toward a node, as far as the turn allows.

        Raises:
            BadValue: there is no path.
        """
        roads = self.roads
        self.prepare(agent)
        if place is None and speed is None and target != here:
            self._refuse_far(here, target)
        if not self.go_towards(agent, here, place, speed, target):
            if place is None:
                raise BadValue(str(NoPath(here, target)))
            may_turn = core.find_reverse_edge(roads.map, roads.edge_rows[place.edge]) >= 0
            raise make_no_path_error(here, place.target, target, is_paced=speed is not None, may_turn=may_turn)

    def _refuse_far(self, here: int, target: int) -> None:
        near = find_usable_graph(self._ctx, self._mode).neighborhoods[here]
        if target not in near:
            raise BadValue(f"Node {target} is not next to node {here}; legal are {list(near)}.")

    def _make_room(self, most: int) -> None:
        """Allocate memory for paths with `most` legs."""
        self._most = most
        self._trips = make_paths_of_one(most)
        self._route = self._trips.route
        self.take_trips(self._trips)


class FollowingStates(NamedTuple):
    """What may follow each state of traffic on a map, for `core.by_edges.TrafficStates`."""

    offsets: IntArray  # (states + 1,)
    after: IntArray  # states
    kept: IntArray  # (states,)


class TrafficTable:
    """The states of traffic that obeys turn restrictions by edges, on a graph and on maps with some of its edges.

    They are those of `kernels.make_turn_states`; behind them is one for each node, in which traffic begins there.

    Args:
        columns: the columns of the graph.
        mode: the mode of travel.

    Attributes:
        nodes: (states,) the row of the node of each state.
        edges: (states,) the row of the last edge; -1: traffic begins on the node.
        sources: (states,) the row of the node at the beginning of this edge; -1: traffic begins on the node.
        begin: the number of the state in which traffic begins on the first node.
    """

    def __init__(self, columns: GraphColumns, mode: str) -> None:
        row_of = {id: row for row, id in enumerate(columns.edge_ids.tolist())}
        paths = list_forbidden_paths(columns).get(split_mode(mode)[0], [])
        self._columns = columns
        self._forbidden = kernels.ForbiddenPaths(tuple(row_of[id] for id in path) for path in paths)
        self._begins = [*self._forbidden.begins]
        edges = np.arange(len(columns.edge_ids))
        edges = np.append(edges, np.array([path[-1] for path in self._begins], np.int64))
        none = np.full(len(columns.node_ids), -1)
        self.begin = len(edges)
        self.edges = np.append(edges, none)
        self.sources = np.append(columns.sources[edges], none).astype(np.int64)
        self.nodes = np.append(columns.targets[edges], np.arange(len(none))).astype(np.int64)

    def find_following(self, rows: IntArray, costs: FloatArray) -> FollowingStates:
        """Return what may follow each state on a map.

        Args:
            rows: the rows of the edges of the map that the mode may use, in their order there.
            costs: (edges,) the costs of all edges, by which the cheapest of parallel edges comes first.
        """
        columns = self._columns
        is_open = np.zeros(len(columns.edge_ids), np.bool_)
        is_open[rows] = True
        going = rows[columns.sources[rows] != columns.targets[rows]]
        steps = kernels.make_turn_states(columns.sources, columns.targets, columns.lengths, is_open, self._forbidden)
        starts = np.append(steps.starts, self.begin + columns.sources[going])
        ends = np.append(steps.ends, going)
        place = np.zeros(len(columns.edge_ids), np.int64)  # of each edge on the map,
        place[going] = np.arange(len(going))
        pairs = columns.sources[going] * len(columns.node_ids) + columns.targets[going]
        _, first, number = np.unique(pairs, return_index=True, return_inverse=True)
        near = np.zeros(len(columns.edge_ids), np.int64)  # and of the first one between the same nodes
        near[going] = first[number]
        edges = self.edges[ends]
        order = np.lexsort((place[edges], costs[edges], near[edges], starts))
        offsets = np.searchsorted(starts[order], np.arange(len(self.nodes) + 1))
        is_going = np.zeros(len(columns.edge_ids), np.bool_)
        is_going[going] = True
        return FollowingStates(offsets.astype(np.int64), ends[order], self._find_kept(is_going))

    def _find_kept(self, is_open: BoolArray) -> IntArray:
        """Return the state that is left of each one without the edges before its last closed one; -1: none."""
        kept = np.full(len(self.nodes), -1)
        count = len(is_open)
        kept[:count] = np.where(is_open, np.arange(count), -1)
        for place, path in enumerate(self._begins):
            closed = [number for number, edge in enumerate(path) if not is_open[edge]]
            rest = path[closed[-1] + 1 :] if closed else path
            kept[count + place] = self.find_state(rest) if rest else -1
        return kept

    def find_state(self, edges: Sequence[int]) -> int:
        """Return the state of traffic that has driven edges by row, at least one."""
        state: tuple[int, ...] = (edges[0],)
        for edge in edges[1:]:
            state = self._forbidden.step(state, edge) or (edge,)
        return state[0] if len(state) == 1 else len(self._columns.edge_ids) + self._begins.index(state)

    def list_edges(self, state: int) -> tuple[int, ...]:
        """Return the rows of the edges that traffic in a state has driven, as far as they matter."""
        beyond = state - len(self._columns.edge_ids)
        return (state,) if beyond < 0 else self._begins[beyond]


def bind_states(
    tables: Sequence[TrafficTable], begin_of_agent: IntArray, driven: IntArray, driving: IntArray
) -> by_edges.TrafficStates:
    """Return the states of traffic of several modes in the form of the core, for one thread; see there."""
    columns = [[getattr(one, name) for one in tables] for name in ("nodes", "edges", "sources")]
    views: list[Any] = [np.concatenate(several).data for several in columns]
    of_agents = [kernels.as_buffer(one.reshape(-1)) for one in (begin_of_agent, driven, driving)]
    return by_edges.TrafficStates(*views, *of_agents)


def find_legal_edges(
    state: int,
    at: int,
    nodes: Sequence[int],
    ids: Sequence[int],
    list_onward: Callable[[int], list[tuple[int, int, int]]],
    costs: FloatArray,
) -> list[int]:
    """Return the rows of the cheapest edges from a state of traffic over nodes, whose turns are all legal.

    Args:
        state: the state.
        at: the id of its node.
        nodes: the rows of the nodes; a node that is repeated counts once.
        ids: the ids of nodes by row.
        list_onward: returns what may follow a state: the rows of the edge and of its end, and the next state, of each.
        costs: (edges,) the costs.

    Raises:
        BadValue: no edges over the nodes are legal.
    """
    best: dict[int, tuple[float, list[int]]] = {state: (0.0, [])}
    for row in nodes:
        if ids[row] == at:
            continue
        following: dict[int, tuple[float, list[int]]] = {}
        for begun, (cost, edges) in best.items():
            for edge, end, after in list_onward(begun):
                found = cost + float(costs[edge]), [*edges, edge]
                if end == row and (after not in following or found < following[after]):
                    following[after] = found
        if not following:
            raise BadValue(f"No edge that a turn restriction allows leads on from node {at} to node {ids[row]}.")
        best = following
        at = ids[row]
    return min(best.values())[1]


class TurnMap:
    """The states of traffic that obeys turn restrictions, as a map for the core: its nodes are these states.

    Args:
        roads: the map with the edges that the mode may use.
        columns: the columns of the graph.
        costs: (edges,) the costs by which agents choose paths.
        mode: the mode of travel.

    Attributes:
        routes: shortest paths over the states.
        map: the form of the core.
        reach: working memory.
        nodes: (states,) the row of the node of each state.
        edges: (arcs,) the row of the edge of each arc of the map.
    """

    def __init__(self, roads: RoadMap, columns: GraphColumns, costs: FloatArray, mode: str) -> None:
        may_use = find_usable_edges(columns, mode)
        paths = list_forbidden_paths(columns).get(split_mode(mode)[0], [])
        self.routes = TurnRoutes(columns, costs, may_use, paths)
        starts, ends, edges, self.nodes = self.routes.list_arcs()
        self._first = len(self.nodes) - len(columns.node_ids)  # the state of traffic that begins on the first node
        order = np.lexsort((edges, starts))
        others = np.flatnonzero(~may_use)  # agents may stand on these, but not enter them
        sources = np.concatenate((starts[order], self._first + columns.sources[others]))
        targets = np.concatenate((ends[order], self._first + columns.targets[others]))
        self.edges = np.concatenate((edges[order], others))
        offsets = np.searchsorted(starts[order], np.arange(len(self.nodes) + 1))
        self._offsets = offsets.tolist()
        self._ends = targets.tolist()
        self._arcs = {pair: arc for arc, pair in enumerate(zip(sources.tolist(), self.edges.tolist(), strict=True))}
        ints = [columns.node_ids[self.nodes], offsets, np.arange(len(order)), sources, targets]
        seconds = np.zeros(0) if roads.seconds is None else roads.seconds[self.edges]
        floats = [columns.lengths[self.edges], costs[self.edges], seconds]
        views: list[Any] = [np.ascontiguousarray(column, np.int64).data for column in ints]
        views += [np.ascontiguousarray(column, np.float64).data for column in floats]
        self.map = core.RoadEdges(*[*views, roads.turn_seconds])
        self.reach = ReachableNodes(len(self.nodes))

    def start(self, node: int, driven: Sequence[int], edge: int | None) -> tuple[int, int, int]:
        """Return where an agent is: its state, the arc that it is on, and the state at the end of this arc.

        Args:
            node: the row of the node that it passed last.
            driven: the rows of the edges by which it came to this node.
            edge: the row of the edge that it is on; None: it is on its node. Then the arc is -1.
        """
        state = self.routes.find_vertex(node, driven)
        if edge is None:
            return state, -1, state
        if (state, edge) not in self._arcs:  # a rule has placed it there
            state = self._first + node
        arc = self._arcs[state, edge]
        return state, arc, self._ends[arc]

    def list_following(self, state: int) -> list[tuple[int, int, int]]:
        """Return what may follow a state: the rows of the edge and of its end, and the next state, of each."""
        arcs = range(self._offsets[state], self._offsets[state + 1])
        return [(int(self.edges[arc]), int(self.nodes[self._ends[arc]]), self._ends[arc]) for arc in arcs]

    def follow(self, state: int, edges: Sequence[int]) -> list[int]:
        """Return the states along edges by row, beyond the first."""
        found = list[int]()
        for edge in edges:
            state = self._ends[self._arcs[state, edge]]
            found.append(state)
        return found


class TravelWithTurns(Travel):
    """Finds the paths of agents by metres that obey turn restrictions.

    A path is found on a `TurnMap`, and then written with the rows of the map of roads, as all paths are.

    Attributes:
        driven: the ids of the edges by which the agent that is asked for has come to its node.
    """

    def __init__(self, ctx: HostContext, settings: Settings, mode: str) -> None:
        super().__init__(ctx, settings, mode)
        self.driven: tuple[int, ...] = ()

    @property
    def turns(self) -> TurnMap:
        """The states of traffic on the current revision of the graph."""
        return self.roads.turns

    def _find_start(self, here: int, place: Progress | None) -> tuple[int, int, int]:
        roads = self.roads
        edge = None if place is None else roads.get_row_of_edge(place.edge)
        return self.turns.start(roads.find_row(here), [roads.edge_rows[one] for one in self.driven], edge)

    def list_legal(self, here: int, place: Progress | None, speed: float | None) -> tuple[int, ...]:
        """Return the legal nodes of an agent: those next to it, then those that it can reach in this turn.

        An agent on an edge goes on to its end first.
        """
        turns = self.turns
        state, arc, _ = self._find_start(here, place)
        if arc >= 0 and speed is None and place is not None:
            return (place.target,)
        at = (0.0, Motion.NONE) if arc < 0 or place is None else (place.share, Motion.FORWARD)
        pace = nan if speed is None else speed
        count = core.find_reachable(turns.map, turns.reach.core, state, arc, *at, pace, self.now, True)
        ids = self.roads.ids
        rows = turns.nodes[turns.reach.nodes[:count]].tolist()
        return tuple(dict.fromkeys([ids[row] for row in rows]))

    def list_moves(self, here: int) -> list[tuple[int, int]]:
        """Return the ids of each edge that the agent may take next from its node, and of its end.

        Edges to the same node follow each other, the cheapest first.
        """
        turns = self.turns
        state, _, _ = self._find_start(here, None)
        begin, _, _ = turns.start(self.roads.find_row(here), (), None)
        first: dict[int, int] = {}  # the first edge to each node, also if it is not legal now
        for edge, end, _ in turns.list_following(begin):
            first.setdefault(end, edge)
        costs = turns.routes.costs
        onward = sorted((first[end], costs[edge], edge) for edge, end, _ in turns.list_following(state))
        ends = [self.roads.edge_ids[edge] for *_, edge in onward]
        return [(id, target) for _, target, id in ends if target != here]

    def follow_route(self, place: Progress | None, here: int, speed: float | None, route: list[int]) -> None:
        """Find the path along a route of nodes, over the cheapest edges whose turns are legal.

        Raises:
            BadValue: no edges along the route are legal, or the agent would have to turn back on its edge.
        """
        if not route:
            self.stay(place, here)
            return
        nodes = route[1:] if route[0] == here else route
        if place is not None and nodes[:1] != [place.target]:
            raise make_turning_error(place)
        nodes = nodes if place is None else nodes[1:]
        at = here if place is None else place.target
        self._go(place, here, speed, self._find_edges(self._find_start(here, place)[2], at, nodes))

    def _find_edges(self, state: int, at: int, nodes: Sequence[int]) -> list[int]:
        """Return the rows of the cheapest edges from a state along nodes, whose turns are all legal."""
        roads = self.roads
        turns = self.turns
        return find_legal_edges(
            state, at, [*map(roads.find_row, nodes)], roads.ids, turns.list_following, turns.routes.costs
        )

    def find_path_towards(
        self,
        agent: int,  # noqa: ARG002 - turns have no stored paths
        place: Progress | None,
        here: int,
        speed: float | None,
        target: int,
    ) -> None:
        """Find the shortest path of an agent toward a node over legal turns, as far as the turn allows.

        Raises:
            BadValue: there is no path.
        """
        *_, state = self._find_start(here, place)
        at = here if place is None else place.target
        if speed is None and target not in (legal := self.list_legal(here, place, None)):
            raise BadValue(f"Node {target} is not next to the agent, or the turn is forbidden; legal are {[*legal]}.")
        if speed is None:
            edges: list[int] | None = self._find_edges(state, at, [target])
        else:
            edges = self.turns.routes.path_from(state, self.roads.find_row(target))
        if edges is None:
            raise BadValue(str(NoPath(at, target)))
        self._go(place, here, speed, edges)

    def _go(self, place: Progress | None, here: int, speed: float | None, edges: Sequence[int]) -> None:
        """Let the core move an agent to the end of its edge, if it is on one, and along edges by row."""
        turns = self.turns
        state, arc, after = self._find_start(here, place)
        route = turns.follow(after, edges)
        if len(route) + _MORE_LEGS > self._most:
            self._make_room(len(route) + _MORE_LEGS)
        for number, one in enumerate(route):
            self._route[number] = one
        share = 0.0 if place is None else place.share
        motion = Motion.NONE if place is None else place.motion
        pace = nan if speed is None else speed
        core.begin(self._trips, 0, state, arc, share, motion, self.now, pace, core.UNLIMITED)
        core.go(turns.map, self._trips, 0, Motion.FORWARD, len(route))
        self._replace_states_by_roads()

    def _replace_states_by_roads(self) -> None:
        """Replace the states and arcs of the path by nodes and edges of the map of roads."""
        trips = self._trips
        turns = self.turns
        nodes = turns.nodes
        roads = self.roads.map
        for place in range(trips.passed[0]):
            trips.nodes[place] = nodes[trips.nodes[place]]
        trips.node[0] = nodes[trips.node[0]]
        if trips.edge[0] >= 0:
            trips.edge[0] = turns.edges[trips.edge[0]]
        for leg in range(trips.legs[0]):
            edge = int(turns.edges[trips.edges[leg]])
            trips.edges[leg] = edge
            trips.backs[leg] = core.find_reverse_edge(roads, edge)


def make_turning_error(place: Progress) -> BadValue:
    """Return the error for an agent that obeys turn restrictions and would have to turn back on an edge."""
    return BadValue(
        f"The agent is on the edge from node {place.source} to node {place.target} and obeys turn restrictions: it "
        f"does not turn back on an edge. Begin the route with node {place.target}."
    )


def get_mode_graph(ctx: IContext | HostContext, mode: str | None) -> Any:  # Any: its class cannot be imported here
    """Return the graph of the edges that the agents of a mode may use; None: the whole graph.

    Raises:
        BadValue: the agents obey turn restrictions, which a graph does not know.
    """
    if mode is not None and split_mode(mode)[1]:
        raise BadValue(
            f"This does not know turn restrictions, and agents with mode={mode!r} obey them. Shipped strategies know "
            "them, such as gamms.strategies.goto, which goes to a node."
        )
    return find_usable_graph(ctx, mode)


def find_usable_graph(ctx: IContext | HostContext, mode: str | None) -> Any:  # Any: as above
    """Return the graph of the edges that agents of a mode may use, whatever turn restrictions say; None: all edges."""
    return ctx.graph.graph if mode is None else ctx.graph.routes.select_mode(split_mode(mode)[0])


def weigh_edges(ctx: HostContext, weight: str | None, mode: str | None) -> FloatArray:
    """Return the weight of each edge, (edges,), for agents of a mode."""
    if mode is None:
        whole: IGraph = ctx.graph.graph
        return whole.weights(weight)
    return find_edge_weights(apply_mode(ctx.graph.columns(), mode), weight)


def make_no_path_error(here: int, end: int, target: int, *, is_paced: bool, may_turn: bool) -> BadValue:
    """Return the error for an agent on an edge from `here` to `end` that cannot reach a node."""
    if not is_paced:
        return BadValue(f"Node {target} is no end of the edge from node {here} to node {end}.")
    return BadValue(str(NoPath(end, target))) if may_turn or target != here else make_one_way_error(here, end)


def make_one_way_error(source: int, target: int) -> BadValue:
    """Return the error for an agent that cannot turn around on an edge."""
    return BadValue(
        f"The edge from node {source} to node {target} is a one-way road: the agent cannot turn round on "
        f"it; legal is node {target}, and what lies beyond."
    )
