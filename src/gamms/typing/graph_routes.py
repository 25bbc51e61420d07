"""The slow default of routing in `IGraph`: it reads the whole graph each time it is asked."""

from collections.abc import Callable, Iterable
from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np

from gamms import kernels
from gamms.arguments import as_int, as_range
from gamms.errors import BadValue, NoPath, UnknownName
from gamms.ir.graph import FloatArray, IntArray

if TYPE_CHECKING:
    from gamms.typing.graph_engine import IGraph


class Routes:
    """The ways through one graph as it is now; see `IGraph` for what each call promises."""

    def __init__(self, graph: "IGraph", weight: str | None) -> None:
        self._ids = list(graph.get_nodes())
        self._row_of = {id: row for row, id in enumerate(self._ids)}
        edges = [graph.get_edge(id) for id in graph.get_edges()]
        self._sources = np.array([self._row_of[edge.source] for edge in edges], np.int64)
        self._targets = np.array([self._row_of[edge.target] for edge in edges], np.int64)
        self._weights = graph.weights(weight)

    def shortest_path(self, source: int, target: int) -> list[int]:
        """Ids of the nodes on the way, both ends included."""
        row, goal = self.rows(source)[0], self.rows(target)
        arcs = self._arcs(reverse=True)
        tight = kernels.tight_arcs(arcs, kernels.shortest_distances(arcs, goal))
        hops = kernels.shortest_distances(tight, goal)
        steps = kernels.first_steps(tight, hops, np.array(self._ids, np.int64)).tolist()
        path = [self._ids[row]]
        while row != goal[0]:
            row = steps[row]
            if row < 0:
                raise NoPath(source, target)
            path.append(self._ids[row])
        return path

    def distances(self, nodes: Any, cutoff: float | None = None, *, reverse: bool) -> FloatArray:
        """(nodes,) from the nearest of some nodes, or to it."""
        limit = inf if cutoff is None else as_range(cutoff, "cutoff")
        return kernels.shortest_distances(self._arcs(reverse=reverse), self.rows(nodes), limit)

    def matrix(self, sources: Any, targets: Any) -> FloatArray:
        """(sources, targets) from each to each."""
        return between(self._arcs, self.rows(sources), self.rows(targets))

    def by_id(self, distances: FloatArray) -> dict[int, float]:
        """The finite ones by node id."""
        return {id: far for id, far in zip(self._ids, distances.tolist(), strict=True) if far < inf}

    def rows(self, nodes: Any) -> IntArray:
        """Rows of one node or of several (KeyError)."""
        ids = [as_int(id, "The id of a node") for id in (nodes if isinstance(nodes, Iterable) else [nodes])]
        for id in ids:
            if id not in self._row_of:
                raise UnknownName("node", id)
        return np.array([self._row_of[id] for id in ids], np.int64)

    def _arcs(self, *, reverse: bool) -> kernels.Arcs:
        ends = (self._targets, self._sources) if reverse else (self._sources, self._targets)
        return kernels.make_arcs(*ends, self._weights, len(self._ids))


def between(arcs_of: Callable[..., kernels.Arcs], starts: IntArray, ends: IntArray) -> FloatArray:
    """(starts, ends) distances, searched from the side with fewer different rows, from the ends if both have as many.

    Args:
        arcs_of: gives the arcs, with `reverse=True` the reversed ones.
        starts: rows.
        ends: rows.
    """
    (from_starts, start_of), (from_ends, end_of) = (np.unique(side, return_inverse=True) for side in (starts, ends))
    reverse = len(from_ends) <= len(from_starts)
    arcs = arcs_of(reverse=reverse)
    roots, others = (from_ends, starts) if reverse else (from_starts, ends)
    found = np.empty((len(roots), len(others)))
    for line, root in zip(found, roots, strict=True):
        line[:] = kernels.shortest_distances(arcs, np.array([root]))[others]
    return found[end_of].T.copy() if reverse else found[start_of]


def one_end(source: Any, target: Any) -> Any:
    """What is given of the two.

    Raises:
        BadValue: both are, or neither.
    """
    if (source is None) == (target is None):
        raise BadValue(
            "Give distances either source= or target=, not both and not neither. "
            "The way from one node to another is graph.distance(source, target)."
        )
    return target if source is None else source
