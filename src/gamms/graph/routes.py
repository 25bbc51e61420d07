"""Routing: shortest paths and distances by edge weights, cached for one revision of a graph.

Strategies ask every turn, of goals that stay or move. So a path is searched for near its ends first. Once the searches
for one goal have visited as many nodes as a table has, the distances to it, and from every node the next step on the
way, are computed once; then a path from anywhere is a walk.
"""

from collections.abc import Callable, Hashable, Iterable, Mapping
from itertools import pairwise
from math import inf

import numpy as np

from gamms import kernels
from gamms.arguments import as_range
from gamms.errors import BadType, UnknownName
from gamms.graph import records
from gamms.graph.store import Cache, GraphStore
from gamms.ir.graph import FloatArray, GraphColumns, IntArray
from gamms.text import shown
from gamms.typing.graph_values import NodeIds
from gamms.typing.routes import RememberedT, Routes

_MANY = 1 << 62  # nodes: more than any graph has
_MOST_STEPS = 1 << 18  # on paths that were found, about 200 bytes each
_MOST_BYTES = 256 * 2**20  # the tables of one goal take 12 bytes a node


class Goal:
    """What searches have found of the ways to one node.

    Attributes:
        steps: row -> next row; -1 where there is no path.
        distances: row -> distance.
        visited: how many nodes the searches have visited.
    """

    __slots__ = ("distances", "steps", "visited")

    def __init__(self) -> None:
        self.steps: dict[int, int] = {}
        self.distances: dict[int, float] = {}
        self.visited = 0

    def has_visited(self, nodes: int) -> bool:
        """Count the nodes that a search has visited; return whether they were enough, which -1 says they were not."""
        self.visited = _MANY if nodes < 0 else self.visited + nodes
        return nodes >= 0


class CachedRoutes(Routes):
    """The routes of a store.

    Attributes:
        cache: among others (weight, id of a node) -> how far that node is, and the next node on the way, by row.
    """

    def __init__(self, store: GraphStore) -> None:
        self._store = store
        self.cache = Cache(_MOST_BYTES)
        self._searches: dict[tuple[str | None, bool], kernels.Search] = {}  # by weight; reversed or not
        self._goals: dict[tuple[str | None, int], Goal] = {}  # by weight and row
        self._searched_revision: int | None = None
        self._steps_kept = 0

    def ids(self) -> IntArray:
        """Return the ids of all nodes (nodes,), by row, without those of nodes that were removed."""
        return self._store.columns().node_ids

    def ends(self) -> tuple[IntArray, IntArray]:
        """Return the rows of sources and targets, (edges,) each."""
        columns = self._store.columns()
        return columns.sources, columns.targets

    def weights(self, weight: str | None) -> FloatArray:
        """Return what each edge costs, (edges,)."""
        return edge_weights(self._store.columns(), weight)

    def rows(self, nodes: NodeIds, name: str) -> IntArray:
        """Return the rows of one node or of several (KeyError)."""
        self._store.columns()
        if not isinstance(nodes, Iterable):
            return np.array([self.row(nodes)])
        ids = nodes if isinstance(nodes, np.ndarray | str) else list(nodes)
        return self._store.nodes.index.rows(records.id_array(ids, name), "node")

    def row(self, node_id: int) -> int:
        """Return the row of a node (KeyError)."""
        return self._store.nodes.find(records.as_id(node_id, "a node"))

    def next_rows(self, row: int, end: int, weight: str | None) -> Mapping[int, int] | memoryview:
        """Return the row of the next node on the path to row `end`, by row; of the whole graph, or of this path."""
        goal = self._goal(row, end, weight)
        return super().next_rows(row, end, weight) if goal is None else goal.steps

    def distance_between(self, row: int, end: int, weight: str | None, within: float = inf) -> float:
        """Return the distance from a row to row `end`; perhaps infinite, if it is greater than `within`."""
        goal = self._goal(row, end, weight, within)
        return super().distance_between(row, end, weight) if goal is None else goal.distances.get(row, inf)

    def near_end(self, rows: IntArray, end: int, weight: str | None, *, is_nearest: bool) -> FloatArray:
        """Return the distances (rows,) from some rows to row `end`; those that are not nearest may be infinite."""
        if not self._has_table(end, weight):
            search, goal = self.search(weight), self._known(end, weight)
            far, visited = search.far(np.array([end]), rows, most=self._left(goal), is_nearest=is_nearest)
            if goal.has_visited(visited):
                return far
        return np.asarray(self.distances_to(end, weight))[rows]

    def _has_table(self, end: int, weight: str | None) -> bool:
        check_weight(weight)
        return self.cache.revision == self._store.revision and (weight, self.ids().item(end)) in self.cache.entries

    def _goal(self, row: int, end: int, weight: str | None, within: float = inf) -> Goal | None:
        """Return what is known of a goal, this row among it unless it is farther away; None: a table is cheaper."""
        if self._has_table(end, weight):
            return None
        search, goal = self.search(weight), self._known(end, weight)
        if row in goal.distances:
            return goal
        way = search.way(row, end, self._left(goal), kernels.widened(within))
        if not goal.has_visited(way.visited):
            return None
        goal.steps.update(pairwise(way.rows))
        goal.distances.update(zip(way.rows, way.far, strict=True))
        if within == inf and not way.rows:
            goal.steps[row] = -1
            goal.distances[row] = inf
        self._steps_kept += len(way.rows) + 1
        return goal

    def _known(self, end: int, weight: str | None) -> Goal:
        if (weight, end) not in self._goals:
            self._goals[weight, end] = Goal()
            self._steps_kept += 1
        return self._goals[weight, end]

    def _left(self, goal: Goal) -> int:
        """Return how many nodes may be visited for a goal until its table has cost as much."""
        return len(self.ids()) - goal.visited

    def search(self, weight: str | None, *, reverse: bool = True) -> kernels.Search:
        """Return the search for near nodes at this revision of the graph; what was found at another is discarded."""
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
            found = self._searches[weight, reverse] = kernels.Search(arcs, self.ids())
        return found

    def remember(self, key: Hashable, make: Callable[[], RememberedT]) -> RememberedT:
        """Return what `make` gave for this revision of the graph."""
        return self.cache.get(self._store.revision, key, make)


def check_weight(weight: str | None) -> None:
    """Refuse what cannot name a weight (BadType)."""
    if weight is not None and not isinstance(weight, str):
        raise BadType(
            f"weight must be 'length', the name of an edge attribute, or None for steps, not {shown(weight)}."
        )


def edge_weights(columns: GraphColumns, weight: str | None) -> FloatArray:
    """Return the weight of every edge: its length, one step, or one of its attributes.

    Args:
        columns: a graph.
        weight: "length", the name of an attribute (an edge without it counts 1), or None (every edge counts 1).

    Returns:
        (edges,) not negative; infinite where an edge is closed.

    Raises:
        BadType: `weight` is no name, or the attribute of an edge no number.
        BadValue: it is negative or NaN.
        UnknownName (KeyError): no edge has such an attribute.
    """
    check_weight(weight)
    if weight == "length":
        return columns.lengths
    known = ("length", *columns.edge_attributes)
    if weight is not None and weight not in known and len(columns.edge_ids):
        raise UnknownName("weight", weight, known)
    weights = np.ones(len(columns.edge_ids))
    given = {} if weight is None else columns.edge_attributes.get(weight, {})
    numbers = [_number(value, columns, row, weight) for row, value in given.items()]
    weights[list(given)] = numbers
    return weights


def _number(value: object, columns: GraphColumns, row: int, weight: str | None) -> float:
    if type(value) is float and value >= 0.0:
        return value
    return as_range(value, f"The weight {weight!r} of edge {columns.edge_ids[row]}")
