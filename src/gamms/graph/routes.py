"""Routing: shortest paths and distances by edge weights, cached for one revision of a graph.

Strategies ask every turn, of goals that stay or move. So a path is searched for near its ends first. Once the searches
for one goal have taken a share of what a table takes, the distances to it, and from every node the next step on the
way, are computed once; then a path from anywhere is a walk.
"""

import logging
from collections.abc import Callable, Hashable, Iterable, Mapping
from functools import cache, partial
from math import inf
from time import perf_counter

import numpy as np

from gamms import kernels
from gamms.arguments import as_range
from gamms.errors import BadType, UnknownName, install_command
from gamms.graph import records
from gamms.graph.store import Cache, GraphStore
from gamms.ir.graph import FloatArray, GraphColumns, IntArray
from gamms.text import shown
from gamms.typing.graph_values import NodeIds
from gamms.typing.routes import RememberedT, Routes

_FEW = 8  # targets: of so many the nearest is found by asking for the distance to each
_SHARE = 16  # searches for one goal may expand one node in so many before its table is made
_SMALL_SHARE = 64  # one node in so many is expanded in Python while SciPy comes to all of them
_MOST_STEPS = 1 << 18  # on paths that were found, about 200 bytes each
_PATIENCE_S = 2.0
_MOST_BYTES = 256 * 2**20  # the tables of one goal take 12 bytes a node


class Goal:
    """What searches have found of the ways to one node.

    Attributes:
        steps: row -> next row; -1 where there is no path.
        distances: row -> distance.
        expanded: how many nodes the searches expanded.
    """

    __slots__ = ("distances", "expanded", "steps")

    def __init__(self) -> None:
        self.steps: dict[int, int] = {}
        self.distances: dict[int, float] = {}
        self.expanded = 0


class CachedRoutes(Routes):
    """The routes of a store.

    Attributes:
        cache: among others (weight, id of a node) -> the distances to that node, (memoryview by row,).
    """

    def __init__(self, store: GraphStore) -> None:
        self._store = store
        self.cache = Cache(_MOST_BYTES)
        self._seconds = 0.0
        self._searches: dict[tuple[str | None, bool], kernels.LocalSearch] = {}  # by weight; reversed or not
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
        check_weight(weight)
        goal = None if self._has_table(("steps", weight, end)) else self._goal(row, end, weight)
        return super().next_rows(row, end, weight) if goal is None else goal.steps

    def distance_between(self, row: int, end: int, weight: str | None, within: float = inf) -> float:
        """Return the distance from a row to row `end`; perhaps infinite, if it is greater than `within`."""
        check_weight(weight)
        goal = None if self._has_table((weight, self.ids().item(end))) else self._goal(row, end, weight, within)
        return super().distance_between(row, end, weight) if goal is None else goal.distances.get(row, inf)

    def reached(
        self, rows: IntArray, weight: str | None, limit: float, *, reverse: bool
    ) -> tuple[IntArray, FloatArray]:
        """Return the rows, ascending, that are at most so far from the nearest of some rows, or to it, and how far."""
        check_weight(weight)
        near, most = None, len(self.ids()) // _SMALL_SHARE
        if limit < inf:
            near = self.search(weight, reverse=reverse).distances(rows.tolist(), most, within=limit)
        if near is None:
            return super().reached(rows, weight, limit, reverse=reverse)
        order = sorted(near)
        return np.array(order, np.int64), np.array([near[row] for row in order])

    def matrix_lines(self, roots: IntArray, others: IntArray, weight: str | None, *, reverse: bool) -> FloatArray:
        """Return the distances (roots, others) from rows to others, or to them where reversed."""
        check_weight(weight)
        search, most, wanted = self.search(weight, reverse=reverse), len(self.ids()) // _SHARE, others.tolist()
        found, goals = np.empty((len(roots), len(others))), set(wanted)
        for at, root in enumerate(roots.tolist()):
            near = None if len(goals) > most else search.distances([root], most, others=goals)
            if near is None:  # nor will the rest be near
                found[at:] = super().matrix_lines(roots[at:], others, weight, reverse=reverse)
                break
            found[at] = [near.get(one, inf) for one in wanted]
        return found

    def least_distances(self, row: int, ends: IntArray, weight: str | None) -> FloatArray:
        """Return (ends,) what the ways from a row to others take at least."""
        check_weight(weight)
        return self.search(weight).least_distances(row, ends)

    def nearest_end(self, row: int, ends: IntArray, weight: str | None, within: float) -> int | None:
        """Return the place in `ends` of the nearest; of many, only those are asked for that a search reaches first."""
        check_weight(weight)
        if len(ends) <= _FEW:
            return super().nearest_end(row, ends, weight, within)
        places = self._reached_first(row, ends, weight)
        if len(places) == 1 and within == inf:
            return places[0]
        found = super().nearest_end(row, ends[places], weight, within)
        return None if found is None else places[found]

    def distances_between(self, rows: IntArray, end: int, weight: str | None) -> FloatArray:
        """Return the distances (rows,) from some rows to row `end`; few are searched for near it first."""
        check_weight(weight)
        near = self._near_end(rows, end, weight, is_nearest=False)
        return super().distances_between(rows, end, weight) if near is None else np.array(near)

    def distance_from_nearest(self, rows: IntArray, end: int, weight: str | None) -> float:
        """Return the distance to row `end` from the nearest of some rows; of many, the first that a search reaches."""
        check_weight(weight)
        if len(rows) <= _FEW:
            return super().distance_from_nearest(rows, end, weight)
        near = self._near_end(rows, end, weight, is_nearest=True)
        return min(super().distances_between(rows, end, weight).tolist() if near is None else near)

    def _near_end(self, rows: IntArray, end: int, weight: str | None, *, is_nearest: bool) -> list[float] | None:
        """Return the distances from some rows to row `end`, or from those nearest to it; None: a table is cheaper."""
        others, most = set(rows.tolist()), len(self.ids()) // _SHARE
        if self._has_table((weight, self.ids().item(end))) or (len(others) > most and not is_nearest):
            return None
        near = self.search(weight).distances([end], most, others=others, is_nearest=is_nearest)
        return None if near is None else [near.get(row, inf) for row in rows.tolist()]

    def _reached_first(self, row: int, ends: IntArray, weight: str | None) -> list[int]:
        """Return the places in `ends` of those that are reached first from a row, up to rounding."""
        search, most = self.search(weight, reverse=False), len(self.ids()) // _SHARE
        near = search.distances([row], most, others=set(ends.tolist()), is_nearest=True)
        if near is None:
            far = kernels.shortest_distances(self.arcs(weight, reverse=False), np.array([row]))[ends]
        else:
            far = np.array([near.get(end, inf) for end in ends.tolist()])
        found: list[int] = np.flatnonzero((far <= kernels.widened(far.min())) & (far < inf)).tolist()
        return found

    def _has_table(self, key: Hashable) -> bool:
        return self.cache.revision == self._store.revision and key in self.cache.entries

    def _goal(self, row: int, end: int, weight: str | None, within: float = inf) -> Goal | None:
        """Return what is known of a goal, this row among it unless it is farther away; None: a table is cheaper."""
        search = self.search(weight)
        goal = self._goals.get((weight, end))
        if goal is None:
            goal = self._goals[weight, end] = Goal()
        if row in goal.distances:
            return goal
        left = len(self.ids()) // _SHARE - goal.expanded
        found = search.search(row, end, left, within)
        if found is None:
            goal.expanded += left
            return None
        goal.expanded += found.expanded
        far = found.distances.get(row, inf)
        if far <= within:
            steps = kernels.best_steps(row, end, found, self.ids().data)
            goal.steps.update(steps or {row: -1})
            goal.distances.update({one: found.distances[one] for one in steps} or {row: far})
            self._steps_kept += len(steps) + 1
        return goal

    def search(self, weight: str | None, *, reverse: bool = True) -> kernels.LocalSearch:
        """Return the search for near nodes at this revision of the graph; what was found at another is discarded."""
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
            found = self._searches[weight, reverse] = kernels.LocalSearch(arcs, self._store.columns().xy)
        return found

    def remember(self, key: Hashable, make: Callable[[], RememberedT]) -> RememberedT:
        """Return what `make` gave for this revision of the graph."""
        slow = kernels.lacks_scipy(len(self._store.edges))
        return self.cache.get(self._store.revision, key, partial(self._timed, make) if slow else make)

    def _timed(self, make: Callable[[], RememberedT]) -> RememberedT:
        """Return what `make` gives; warn once it has taken seconds, most of which SciPy would have saved."""
        began = perf_counter()
        found = make()
        self._seconds += perf_counter() - began
        if self._seconds > _PATIENCE_S:
            _warn_of_missing_scipy()
        return found


@cache  # once in a process
def _warn_of_missing_scipy() -> None:
    logging.getLogger("gamms").warning(
        "Shortest ways have taken seconds, because SciPy is not installed. With it they take a fraction of that: %s",
        install_command("accel"),
    )


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
