"""Distances and actions toward targets for many agents at once, from tables of shortest paths that the core finds."""

from collections import OrderedDict
from collections.abc import Iterable, Sequence
from copy import copy
from hashlib import blake2b
from math import inf
from threading import RLock
from typing import Any

import numpy as np

from gamms import kernels
from gamms.arguments import as_array, as_one_shape
from gamms.core import routes
from gamms.errors import NoPath
from gamms.game.movement.streets import StreetGraph
from gamms.game.movement.travel import ReachableNodes
from gamms.ir.graph import FloatArray, IntArray, split_mode
from gamms.ir.obstacles import BoolArray
from gamms.kernels import as_buffer
from gamms.typing.game import EdgeAction
from gamms.typing.graph_engine import IGraph

_MOST_BYTES = 512 * 2**20  # of the tables of one graph, and of the other graphs' tables in the cache
_BYTES = 12  # of a node in a table


_lock = RLock()  # one batch at a time reads and extends tables
_shared: OrderedDict[bytes, "RouteTable"] = OrderedDict()  # by hash of graph and weight; most recently used last


def get_shared_routes(streets: StreetGraph, weight: str | None) -> "RouteTable":
    """Return the tables of a graph; batches on equal graphs with equal weights share them."""
    arcs = streets.get_reversed_ways(weight)
    parts = (streets.columns.node_ids, streets.offsets, streets.targets, *arcs)
    key = blake2b(b"".join(blake2b(part.tobytes()).digest() for part in parts)).digest()
    with _lock:
        found = _shared.pop(key, None) or RouteTable(streets, weight)
        left = _MOST_BYTES
        for other in reversed([*_shared]):
            left -= _shared[other].nbytes
            if left < 0:
                del _shared[other]
        _shared[key] = found
    return found


class PathTables:
    """Tables of the shortest paths from all nodes to target nodes; the core fills each table on first use.

    When the tables would exceed 512 MB, all older ones are dropped and found again on demand.

    Args:
        ids: (nodes,) the ids of the nodes.
        arcs: offsets, source nodes and weights of the edges into each node, of one map or of several in sequence.
    """

    def __init__(self, ids: IntArray, arcs: tuple[Any, Any, Any]) -> None:
        self._nodes = len(ids)
        self._most = max(1, _MOST_BYTES // (_BYTES * max(1, self._nodes)))
        self._far: FloatArray = np.zeros((0, self._nodes))
        self._following = np.zeros((0, self._nodes), np.int32)
        paths = routes.Paths(ReachableNodes(self._nodes).core, *map(as_buffer, np.zeros((3, self._nodes), np.int64)))
        self.core = routes.PathTables(as_buffer(ids), *arcs, paths, *self._make_room(arcs))

    def take(self, arcs: tuple[Any, Any, Any], moved: IntArray) -> None:
        """Switch to other maps, and keep the tables of those that remain; see `routes.PathTables.take`."""
        self.core.take(*arcs, *self._make_room(arcs), as_buffer(moved))

    def _make_room(self, arcs: tuple[Any, Any, Any]) -> tuple[Any, Any]:
        """Return the tables of the core, with room for paths to all nodes of these maps, or as many as fit."""
        # The operating system provides memory only for tables that are used.
        room = max(len(self._far), min(self._most, len(arcs[0]) - 1))
        self._far = _extend_tables(self._far, room)
        self._following = _extend_tables(self._following, room)
        return as_buffer(self._far), as_buffer(self._following)


def _extend_tables(tables: np.ndarray[Any, Any], room: int) -> Any:
    """Return tables with room for more, if they have less."""
    if room <= len(tables):
        return tables
    found = np.zeros((room, tables.shape[1]), tables.dtype)
    found[: len(tables)] = tables
    return found


class RouteTable:
    """Distances to targets and actions that lead there, for arrays of agents.

    The first query of a target finds the paths from every node to it, which take 12 bytes for each node of the map.
    When the tables of a graph would exceed 512 MB, they are dropped and found again on demand.

    Args:
        streets: the nodes and their legal nodes.
        weight: the edge weight, see `IGraph`.
        from_sources: whether to search from the sources of paths; then "target" and "source" are exchanged here.
    """

    def __init__(self, streets: StreetGraph, weight: str | None, *, from_sources: bool = False) -> None:
        self._streets = streets.copy_without_graph()
        arcs = streets.get_ways(weight) if from_sources else streets.get_reversed_ways(weight)
        columns = as_buffer(arcs.offsets), as_buffer(arcs.ends), as_buffer(arcs.weights)
        self._paths = PathTables(streets.columns.node_ids, columns).core

    @property
    def nbytes(self) -> int:
        """The memory of the computed tables, bytes."""
        return self._paths.count * _BYTES * self._streets.num_nodes

    def distances(self, sources: IntArray, targets: IntArray) -> FloatArray:
        """Return the distances from sources to targets, as `graph.distance` does.

        Args:
            sources: rows of nodes, as `view.streets.rows(ids)` returns them.
            targets: rows of nodes; both arrays broadcast to one shape.

        Raises:
            BadType, BadValue: the arrays are not rows of nodes, or do not broadcast to one shape.
        """
        sources, targets = self._check_rows(sources, targets)
        found = np.empty(sources.shape)
        with _lock:
            routes.find_distances(self._paths, *_make_queries(sources, targets), as_buffer(found))
        return found

    def actions(
        self,
        sources: IntArray,
        targets: IntArray,
        allowed: BoolArray | None = None,
    ) -> IntArray:
        """Return the actions that lead toward targets along shortest paths.

        An action goes to the last node of the path that is legal in one move and that a chain of legal nodes leads to;
        to the target itself, if it is legal.

        Args:
            sources: rows of nodes.
            targets: rows of nodes; both arrays broadcast to one shape.
            allowed: (nodes,) the nodes that may be entered; None: all. The action is to stay where the next node of
                the path, or a target in one move, is not allowed.

        Returns:
            Indices of legal nodes; -1 without a path.

        Raises:
            BadType, BadValue: the arrays are not rows of nodes, or do not broadcast to one shape.
        """
        sources, targets = self._check_rows(sources, targets)
        enterable = np.zeros(0, np.bool_)
        if allowed is not None:
            enterable = as_array(allowed, "allowed", "booleans", (self._streets.num_nodes,))
        found = np.empty(sources.shape, np.int64)
        legal = as_buffer(self._streets.offsets), as_buffer(self._streets.targets)
        queries = _make_queries(sources, targets)
        with _lock:
            routes.find_actions(self._paths, *legal, *queries, as_buffer(enterable.view(np.uint8)), as_buffer(found))
        return found

    def _check_rows(self, sources: object, targets: object) -> list[IntArray]:
        """Return the rows of nodes that a caller passed, broadcast to one shape."""
        checked = self._streets.check_rows
        return as_one_shape({"sources": checked(sources, "sources"), "targets": checked(targets, "targets")})


def _make_queries(sources: IntArray, targets: IntArray) -> tuple[Any, Any, Any]:
    """Return queries for the core: their order by target, so that each table is made once, sources and targets."""
    ends = targets.reshape(-1)
    return as_buffer(np.argsort(ends, kind="stable")), as_buffer(sources), as_buffer(ends)


class RoutesFromNodes:
    """The routes of agents that obey turn restrictions and begin on nodes, as far as strategies ask for them.

    Args:
        graph: the graph of the edges that the mode may use.
        mode: the mode of the agents.

    Attributes:
        graph: see the argument.
        neighborhoods: of this graph.
        routes: this object.
    """

    def __init__(self, graph: IGraph, mode: str) -> None:
        self.graph: Any = graph  # its class cannot be imported here
        self.neighborhoods = graph.neighborhoods
        self.routes = self
        self._turns = split_mode(mode)[0]

    def find_path(self, source: int, target: int, weight: str | None = "length") -> list[int] | None:
        """Return the ids of the edges on the shortest path; None: there is none."""
        source, driven = self._find_start(source)
        try:
            return [*self.graph.routes.shortest_path_edges(source, target, weight, turns=self._turns, driven=driven)]
        except NoPath:
            return None

    def _find_start(self, source: int) -> tuple[int, tuple[int, ...]]:
        """Return the node where a path from a node begins, and the edges driven to it."""
        return source, ()

    def list_lengths(self, source: int, target: int, weight: str | None = "length") -> list[tuple[int, float]]:
        """Return the nodes on the shortest path, and the length of the path to each; [] if there is none."""
        edges = self.find_path(source, target, weight)
        if edges is None:
            return []
        rows = self._find_rows(edges)
        columns = self.graph.columns()
        ends = columns.node_ids[columns.targets[rows]].tolist()
        gone = np.cumsum(self.graph.routes.weights(weight)[rows]).tolist()
        return [(self._find_start(source)[0], 0.0), *zip(ends, gone, strict=True)]

    def _find_rows(self, edges: Sequence[int]) -> IntArray:
        """Return the rows of edges."""
        columns = self.graph.columns()
        return kernels.find_rows(columns.edge_ids, np.array(edges, np.int64), columns.edge_order)

    def distance(self, source: int, target: int, weight: str | None = "length") -> float:
        """Return the length of the shortest path; infinite if there is none."""
        edges = [] if self._find_start(source)[0] == target else self.find_path(source, target, weight)
        return inf if edges is None else float(self.graph.routes.weights(weight)[self._find_rows(edges)].sum())

    def nearest(self, source: int, targets: Iterable[int], weight: str | None = "length") -> int | None:
        """Return the nearest of several nodes, the first of equally near ones; None: no path leads to any."""
        far = self.distances(source, weight)
        return min((target for target in targets if target in far), key=far.__getitem__, default=None)

    def distances(
        self, source: int | Sequence[int], weight: str | None = "length", cutoff: float | None = None
    ) -> dict[int, float]:
        """Return node -> the length of the shortest path to it, from one node or the nearest of several."""
        start, driven = self._find_start(source) if isinstance(source, int) else (source, ())
        found: dict[int, float] = self.graph.routes.distances_with_turns(
            start, None, weight, cutoff, self._turns, driven
        )
        return found

    def distance_matrix(self, sources: Sequence[int], targets: IntArray, weight: str | None = "length") -> FloatArray:
        """Return the lengths of the shortest paths, (sources, targets); infinite if there is none."""
        ends = targets.tolist()
        several = [self.distances(source, weight) for source in sources]
        return np.array([[far.get(end, inf) for end in ends] for far in several]).reshape(len(several), len(ends))

    def distances_from_nearest(self, sources: Iterable[int], targets: Iterable[int]) -> list[float]:
        """Return the distance to each target from the nearest of some other agents, which begin on their nodes."""
        far = self.graph.distances(source=[*sources], turns=self._turns)
        return [far.get(target, inf) for target in targets]


class RoutesWithTurns(RoutesFromNodes):
    """The routes of an agent that obeys turn restrictions, as far as strategies ask for them.

    From its own node the agent goes on from the edge by which it came, and on an edge from the end of this edge. From
    other nodes, any edge is legal.

    Args:
        graph: the graph of the edges that the mode may use.
        mode: the mode of the agent.
        here: the id of its node.
        driven: the ids of the edges by which it has come there.
        place: the ids of the ends of the edge that it is on, and of the edge; None: it is on its node.
        is_in_game: whether its action may name an edge.

    Attributes:
        here: the node from which the agent goes on: its own, or the end of its edge.
        is_on_edge: whether it is on an edge.
    """

    def __init__(
        self,
        graph: IGraph,
        mode: str,
        here: int,
        driven: tuple[int, ...],
        place: tuple[int, int, int] | None,
        *,
        is_in_game: bool = True,
    ) -> None:
        super().__init__(graph, mode)
        self.here = here if place is None else place[1]
        self._passed = here
        self._is_in_game = is_in_game
        self.is_on_edge = place is not None
        self._driven = driven if place is None else (*driven, place[2])

    def move_on(self, node: int) -> "RoutesWithTurns":
        """Return the routes of the agent after it has moved to a node by the shortest path."""
        edges = [] if node == self.here else self.find_path(self.here, node)
        after = copy(self)
        after.routes = after
        if edges:
            after.here = node
            after._passed = node
            after._driven = (*self._driven, *edges)
        return after

    def _find_start(self, source: int) -> tuple[int, tuple[int, ...]]:
        """Return where a path begins, and the edges driven to this node: the agent goes on from the end of its edge."""
        return (self.here, self._driven) if source in (self.here, self._passed) else (source, ())

    def find_step(self, target: int) -> tuple[int, int | EdgeAction] | None:
        """Return the end of the first edge of the shortest path from the agent's own node, and the action to take it.

        Of several edges to this end, the action names the edge, because the path may not go on from the others. None:
        there is no path.
        """
        edges = self.find_path(self.here, target)
        if edges is None:
            return None
        columns = self.graph.columns()
        (row,) = self._find_rows(edges[:1])
        source, end = columns.sources[row], columns.targets[row]
        leaving = columns.out_edges[columns.offsets[source] : columns.offsets[source + 1]]
        node = int(columns.node_ids[end])
        is_alone = np.count_nonzero(columns.targets[leaving] == end) == 1
        return node, node if is_alone or not self._is_in_game else {"edge": edges[0]}
