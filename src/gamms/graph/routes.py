"""Routing: shortest paths and distances by edge weights, cached for one revision of a graph.

Strategies ask every turn, about fixed and moving goals. So paths are first found by searches near their ends. Once the
searches for one goal have visited as many nodes as the graph has, a table of the distances and next steps from all
nodes to this goal is computed; after that a path from anywhere is read from the table.
"""

from collections.abc import Callable, Hashable, Iterable, Mapping
from itertools import pairwise
from math import inf
from typing import Any

import numpy as np

from gamms import kernels
from gamms.graph import records
from gamms.graph.store import Cache, GraphStore
from gamms.ir.graph import (
    FloatArray,
    IntArray,
    apply_mode,
    check_mode,
    check_weight,
    find_edge_weights,
    find_usable_edges,
    select_edges,
)
from gamms.typing.graph_values import NodeIds
from gamms.typing.routes import RememberedT, Routes

_MANY = 1 << 62  # nodes: more than any graph has
_MOST_STEPS = 1 << 18  # total length of stored paths, about 200 bytes per step
_MOST_BYTES = 256 * 2**20  # of tables, 12 bytes per node and goal


class GoalDistances:
    """Distances to one node that searches have found so far.

    Attributes:
        steps: row -> next row; -1 if there is no path.
        distances: row -> distance.
        visited: the number of nodes that the searches have visited.
    """

    __slots__ = ("distances", "steps", "visited")

    def __init__(self) -> None:
        self.steps: dict[int, int] = {}
        self.distances: dict[int, float] = {}
        self.visited = 0

    def has_visited(self, nodes: int) -> bool:
        """Count visited nodes; return whether the search completed, as -1 means that it needed more nodes."""
        self.visited = _MANY if nodes < 0 else self.visited + nodes
        return nodes >= 0


class CachedRoutes(Routes):
    """The routes of a graph store.

    Args:
        store: the graph.
        make_graph: makes the graph of a mode from another store; Any: `graph.py` imports this module.

    Attributes:
        cache: results by key; for (weight, node id): distances to the node and next nodes on the path, by row.
    """

    def __init__(self, store: GraphStore, make_graph: Callable[[GraphStore], Any]) -> None:
        self._store = store
        self._make_graph = make_graph
        self.cache = Cache(_MOST_BYTES)
        self._searches: dict[tuple[str | None, bool], kernels.Search] = {}  # by weight, and reversed or not
        self._goals: dict[tuple[str | None, int], GoalDistances] = {}  # by weight and row
        self._searched_revision: int | None = None
        self._steps_kept = 0
        self._modes: dict[str, tuple[int, int, Any]] = {}  # with the revisions of this graph and of its own

    def __reduce__(self) -> tuple[type["CachedRoutes"], tuple[object, ...]]:
        """Copy and pickle the graph without the results, which are found again."""
        return CachedRoutes, (self._store, self._make_graph)

    def ids(self) -> IntArray:
        """Return the ids of all existing nodes, (nodes,), by row."""
        return self._store.columns().node_ids

    def ends(self) -> tuple[IntArray, IntArray]:
        """Return the rows of sources and targets, (edges,) each."""
        columns = self._store.columns()
        return columns.sources, columns.targets

    def weights(self, weight: str | None) -> FloatArray:
        """Return the weight of each edge, (edges,)."""
        return find_edge_weights(self._store.columns(), weight)

    def rows(self, nodes: NodeIds, name: str) -> IntArray:
        """Return the rows of one or several nodes (KeyError)."""
        self._store.columns()
        if not isinstance(nodes, Iterable):
            return np.array([self.row(nodes)])
        ids = nodes if isinstance(nodes, np.ndarray | str) else list(nodes)
        return self._store.nodes.index.find_rows(records.check_ids(ids, name, self._store), "node")

    def row(self, node_id: int) -> int:
        """Return the row of a node (KeyError)."""
        return self._store.nodes.find(records.as_id(node_id, "a node", self._store))

    def next_rows(self, row: int, end: int, weight: str | None) -> Mapping[int, int] | memoryview:
        """Return a mapping row -> next row on the path to row `end`, for the whole graph or for this path only."""
        goal = self._find_goal(row, end, weight)
        return super().next_rows(row, end, weight) if goal is None else goal.steps

    def distance_between(self, row: int, end: int, weight: str | None, within: float = inf) -> float:
        """Return the distance from a row to row `end`; may be infinite if it is greater than `within`."""
        goal = self._find_goal(row, end, weight, within)
        return super().distance_between(row, end, weight) if goal is None else goal.distances.get(row, inf)

    def near_end(self, rows: IntArray, end: int, weight: str | None, *, is_nearest: bool) -> FloatArray:
        """Return the distances (rows,) from rows to row `end`; with `is_nearest`, all but the least may be infinite."""
        if not self._has_table(end, weight):
            search = self.search(weight)
            goal = self._get_known_goals(end, weight)
            far, visited = search.compute_distances(
                np.array([end]), rows, most=self._count_left(goal), is_nearest=is_nearest
            )
            if goal.has_visited(visited):
                return far
        return np.asarray(self.distances_to(end, weight))[rows]

    def _has_table(self, end: int, weight: str | None) -> bool:
        check_weight(weight)
        return self.cache.revision == self._store.revision and (weight, self.ids().item(end)) in self.cache.entries

    def _find_goal(self, row: int, end: int, weight: str | None, within: float = inf) -> GoalDistances | None:
        """Return the known distances to a goal, searched as far as this row; None if a table is cheaper."""
        if self._has_table(end, weight):
            return None
        search = self.search(weight)
        goal = self._get_known_goals(end, weight)
        if row in goal.distances:
            return goal
        path = search.find_path(row, end, self._count_left(goal), kernels.widen_distance(within))
        if not goal.has_visited(path.visited):
            return None
        goal.steps.update(pairwise(path.rows))
        goal.distances.update(zip(path.rows, path.far, strict=True))
        if within == inf and not path.rows:
            goal.steps[row] = -1
            goal.distances[row] = inf
        self._steps_kept += len(path.rows) + 1
        return goal

    def _get_known_goals(self, end: int, weight: str | None) -> GoalDistances:
        if (weight, end) not in self._goals:
            self._goals[weight, end] = GoalDistances()
            self._steps_kept += 1
        return self._goals[weight, end]

    def _count_left(self, goal: GoalDistances) -> int:
        """Return how many more nodes searches for a goal may visit before a table is cheaper."""
        return len(self.ids()) - goal.visited

    def search(self, weight: str | None, *, reverse: bool = True) -> kernels.Search:
        """Return the search for near nodes of this revision of the graph; results of other revisions are dropped."""
        check_weight(weight)
        revision = self._store.revision
        if revision != self._searched_revision:
            self._searches.clear()
            self._searched_revision = revision
        if not self._searches or self._steps_kept > _MOST_STEPS:
            self._goals.clear()
            self._steps_kept = 0
        found = self._searches.get((weight, reverse))
        if found is None:
            arcs = self.arcs(weight, reverse=reverse)
            found = kernels.Search(arcs, self.ids())
            self._searches[weight, reverse] = found
        return found

    def select_mode(self, mode: str) -> Any:  # Any: see `Routes`
        """Return the graph with the edges and attributes of a mode; the same one until the graph changes."""
        known = self._modes.get(mode)
        if known is not None and known[:2] == (self._store.revision, known[2].revision):
            return known[2]
        columns = self._store.columns()
        if mode not in self._store.modes:
            check_mode(columns, self._store.closed, mode)
            self._store.modes |= {mode}
        store = GraphStore()
        chosen = apply_mode(select_edges(columns, find_usable_edges(columns, mode)), mode)
        store.replace(chosen, self._store.attribution, self._store.scenery, {})
        graph = self._make_graph(store)
        self._modes[mode] = self._store.revision, store.revision, graph
        return graph

    def remember(self, key: Hashable, make: Callable[[], RememberedT]) -> RememberedT:
        """Return the result of `make`, cached for this revision of the graph."""
        return self.cache.get(self._store.revision, key, make)
