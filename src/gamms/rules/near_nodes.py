"""The nodes that are near nodes in many games on one graph, for `meetings.py`."""

from typing import NamedTuple

import numpy as np

from gamms import kernels
from gamms.game.streets import Streets
from gamms.ir.graph import FloatArray, IntArray

_MOST_KNOWN = 1 << 25  # pairs of nodes that are kept


class Reach(NamedTuple):
    """The nodes within a distance ahead of nodes, as `core.contacts.Reach` has them."""

    offsets: IntArray
    counts: IntArray
    ends: IntArray
    far: FloatArray


class NearNodes:
    """The nodes that can be reached from others within a distance, found when they are first asked for.

    Args:
        streets: the graph.
        limit: the distance.
        by_length: whether lengths of edges count, rather than their number.
    """

    def __init__(self, streets: Streets, limit: float, *, by_length: bool) -> None:
        columns, self._limit = streets.columns, limit
        weights = columns.lengths if by_length else np.ones(len(columns.lengths))
        self._nodes = len(columns.node_ids)
        self._arcs = kernels.make_arcs(columns.sources, columns.targets, weights, self._nodes)
        self._forget()

    def _forget(self) -> None:
        self._offset = np.full(self._nodes, -1, np.int64)
        self._count = np.zeros(self._nodes, np.int64)
        self._ends, self._far, self._used = np.zeros(0, np.int64), np.zeros(0), 0

    def around(self, rows: IntArray) -> Reach:
        """Return what lies around nodes, and around those that were asked for before."""
        self._learn(rows)
        return Reach(self._offset, self._count, self._ends, self._far)

    def _learn(self, rows: IntArray) -> None:
        """Look around nodes, as far as that was not done before."""
        new = np.unique(rows[self._offset[rows] < 0])
        if not len(new):
            return
        if self._used > _MOST_KNOWN:
            self._forget()
            new = np.unique(rows)
        index, ends, far = self._around(new)
        self._count[new] = np.bincount(index, minlength=len(new))
        self._offset[new] = self._used + np.cumsum(self._count[new]) - self._count[new]
        after = self._used + len(ends)
        if after > len(self._ends):
            self._ends = np.concatenate((self._ends[: self._used], np.empty(2 * after - self._used, np.int64)))
            self._far = np.concatenate((self._far[: self._used], np.empty(2 * after - self._used)))
        self._ends[self._used : after], self._far[self._used : after], self._used = ends, far, after

    def _around(self, rows: IntArray) -> tuple[IntArray, IntArray, FloatArray]:
        """Return what can be reached: the places in `rows`, ascending, rows of nodes, and the distances.

        The weights of a path are added from its start, so that the sums are those of `kernels.shortest_distances`.
        """
        nodes, arcs = self._nodes, self._arcs
        keys, far = np.arange(len(rows)) * nodes + rows, np.zeros(len(rows))
        order = np.argsort(keys)
        keys, far = keys[order], far[order]
        new, new_far = keys, far
        while len(new):
            entries, runs = kernels.chosen_runs(arcs.offsets, new % nodes)
            lines = np.repeat(np.arange(len(new)), np.diff(runs))
            sums = new_far[lines] + arcs.weights[entries]
            reached = (new // nodes)[lines] * nodes + arcs.ends[entries]
            is_near = sums <= self._limit
            reached, sums = reached[is_near], sums[is_near]
            order = np.lexsort((sums, reached))
            new, first = np.unique(reached[order], return_index=True)
            new_far = sums[order][first]
            at = kernels.rows_of(keys, new)
            is_known = at >= 0
            is_better = ~is_known | (new_far < far[at])
            far[at[is_known & is_better]] = new_far[is_known & is_better]
            added = ~is_known
            keys, far = np.concatenate((keys, new[added])), np.concatenate((far, new_far[added]))
            order = np.argsort(keys, kind="stable")
            keys, far = keys[order], far[order]
            new, new_far = new[is_better], new_far[is_better]
        return keys // nodes, keys % nodes, far
