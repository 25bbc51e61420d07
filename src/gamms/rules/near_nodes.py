"""Which nodes are near others by paths, by edges or metres, for many pairs of nodes at once."""

import numpy as np

from gamms import kernels
from gamms.game.streets import Streets
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray

_MOST_KNOWN = 1 << 25  # pairs of nodes that are kept


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
        self._open_gate(1 << 12)

    def _open_gate(self, pairs: int) -> None:
        """Make a table that says, by the sum of the hashes of two nodes, whether they may be near; of so many pairs."""
        size = 1 << (8 * pairs).bit_length()
        hashes = kernels.draw_bits_many(0, np.arange(self._nodes, dtype=np.uint64), 0)
        self._hash: IntArray = (hashes % np.uint64(size)).astype(np.int64)
        self._gate, self._room = np.zeros(2 * size, np.bool_), pairs
        self._admit(np.flatnonzero(self._offset >= 0))

    def _admit(self, rows: IntArray) -> None:
        pairs, entries = kernels.expand_ranges(self._offset[rows], self._offset[rows] + self._count[rows])
        self._gate[self._hash[rows][pairs] + self._hash[self._ends[entries]]] = True

    def _learn(self, rows: IntArray) -> None:
        """Look around these nodes, as far as that was not done before."""
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
        if after > self._room:
            self._open_gate(2 * after)
        else:
            self._admit(new)

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

    def may_be_near(self, starts: IntArray, ends: IntArray) -> BoolArray:
        """Return which pairs of nodes may be near each other; the others are not. The shapes are broadcast."""
        self._learn(np.concatenate((starts.ravel(), ends.ravel())))
        found: BoolArray = self._gate[self._hash[starts] + self._hash[ends]]
        return found

    def distances(self, starts: IntArray, ends: IntArray) -> FloatArray:
        """Return how far it is there or back, whichever is shorter; infinite where that is too far."""
        return np.minimum(self.ahead(starts, ends), self.ahead(ends, starts))

    def ahead(self, starts: IntArray, ends: IntArray) -> FloatArray:
        """Return how far it is from nodes to others, (pairs,); infinite where that is too far."""
        self._learn(starts)
        found = np.full(len(starts), np.inf)
        pairs, entries = kernels.expand_ranges(self._offset[starts], self._offset[starts] + self._count[starts])
        is_there = self._ends[entries] == ends[pairs]
        found[pairs[is_there]] = self._far[entries[is_there]]
        return found
