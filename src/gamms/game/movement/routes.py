"""Distances and actions toward targets for many agents at once, from tables of shortest paths that the core finds."""

from collections import OrderedDict
from hashlib import blake2b
from threading import RLock
from typing import Any

import numpy as np

from gamms.arguments import as_array, as_one_shape
from gamms.core import routes
from gamms.game.movement.streets import StreetGraph
from gamms.game.movement.travel import ReachableNodes
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.kernels import buffer

_MOST_BYTES = 512 * 2**20  # of the tables of one graph, and of the other graphs' tables in the cache
_BYTES = 12  # of a node in a table


_lock = RLock()  # one batch at a time reads and extends tables
_shared: OrderedDict[bytes, "RouteTable"] = OrderedDict()  # by hash of graph and weight; most recently used last


def shared_routes(streets: StreetGraph, weight: str | None) -> "RouteTable":
    """Return the tables of a graph; batches on equal graphs with equal weights share them."""
    arcs = streets.ways_to(weight)
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
        paths = routes.Paths(ReachableNodes(self._nodes).core, *map(buffer, np.zeros((3, self._nodes), np.int64)))
        self.core = routes.PathTables(buffer(ids), *arcs, paths, *self._with_room(arcs))

    def take(self, arcs: tuple[Any, Any, Any], moved: IntArray) -> None:
        """Switch to other maps, and keep the tables of those that remain; see `routes.PathTables.take`."""
        self.core.take(*arcs, *self._with_room(arcs), buffer(moved))

    def _with_room(self, arcs: tuple[Any, Any, Any]) -> tuple[Any, Any]:
        """Return the tables of the core, with room for paths to all nodes of these maps, or as many as fit."""
        # The operating system provides memory only for tables that are used.
        room = max(len(self._far), min(self._most, len(arcs[0]) - 1))
        self._far = _longer(self._far, room)
        self._following = _longer(self._following, room)
        return buffer(self._far), buffer(self._following)


def _longer(tables: np.ndarray[Any, Any], room: int) -> Any:
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
        self._streets = streets.apart()
        arcs = streets.ways(weight) if from_sources else streets.ways_to(weight)
        columns = buffer(arcs.offsets), buffer(arcs.ends), buffer(arcs.weights)
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
        sources, targets = self._checked(sources, targets)
        found = np.empty(sources.shape)
        with _lock:
            routes.find_distances(self._paths, *_queries(sources, targets), buffer(found))
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
        sources, targets = self._checked(sources, targets)
        enterable = np.zeros(0, np.bool_)
        if allowed is not None:
            enterable = as_array(allowed, "allowed", "booleans", (self._streets.num_nodes,))
        found = np.empty(sources.shape, np.int64)
        legal = buffer(self._streets.offsets), buffer(self._streets.targets)
        queries = _queries(sources, targets)
        with _lock:
            routes.find_actions(self._paths, *legal, *queries, buffer(enterable.view(np.uint8)), buffer(found))
        return found

    def _checked(self, sources: object, targets: object) -> list[IntArray]:
        """Return the rows of nodes that a caller passed, broadcast to one shape."""
        checked = self._streets.checked
        return as_one_shape({"sources": checked(sources, "sources"), "targets": checked(targets, "targets")})


def _queries(sources: IntArray, targets: IntArray) -> tuple[Any, Any, Any]:
    """Return queries for the core: their order by target, so that each table is made once, sources and targets."""
    ends = targets.reshape(-1)
    return buffer(np.argsort(ends, kind="stable")), buffer(sources), buffer(ends)
