"""The nodes that are near nodes, for `meetings.py`."""

from collections.abc import Callable
from typing import Any

import numpy as np

from gamms.core import contacts as core
from gamms.ir.graph import FloatArray, IntArray

Reached = tuple[IntArray, IntArray | FloatArray, FloatArray]


class NearNodes:
    """The nodes that can be reached from others within a distance, found when they are first asked for.

    Args:
        search: rows of nodes, ascending -> how many nodes can be reached from each; these, from one after the other,
            ascending; and how far they are.
        most: pairs of nodes that are kept; beyond, all are found again. A pair takes 16 bytes.
    """

    def __init__(self, search: Callable[[IntArray], Reached], most: int) -> None:
        self._search = search
        self._most = most
        self._forget()

    def _forget(self) -> None:
        self._offset, self._count, self._ends = np.zeros((3, 0), np.int64)
        self._far, self._used = np.zeros(0), 0
        self._reach: core.Reach | None = None

    def around(self, rows: IntArray, nodes: int) -> core.Reach:
        """Return what lies around nodes, and around those that were asked for before; there are so many."""
        if self._used > self._most:
            self._forget()
        if nodes > len(self._offset):
            more = 2 * nodes - len(self._offset)
            self._offset = np.concatenate((self._offset, np.full(more, -1)))
            self._count = np.concatenate((self._count, np.zeros(more, np.int64)))
            self._reach = None
        is_new = self._offset[rows] < 0
        if is_new.any():
            self._learn(np.unique(rows[is_new]))
            self._reach = None
        if self._reach is None:
            columns: list[Any] = [one.data for one in (self._offset, self._count, self._ends, self._far)]
            self._reach = core.Reach(*columns)
        return self._reach

    def _learn(self, new: IntArray) -> None:
        """Look around nodes."""
        counts, ends, far = self._search(new)
        self._count[new], self._offset[new] = counts, self._used + np.cumsum(counts) - counts
        after = self._used + len(ends)
        if after > len(self._ends):
            self._ends = np.concatenate((self._ends[: self._used], np.empty(2 * after - self._used, np.int64)))
            self._far = np.concatenate((self._far[: self._used], np.empty(2 * after - self._used)))
        self._ends[self._used : after], self._far[self._used : after], self._used = ends, far, after
