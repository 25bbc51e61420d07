"""Nodes by place: a cell grid that is built when first asked for and kept up to date by notes."""

from math import isqrt

import numpy as np

from gamms import kernels
from gamms.graph.tables import NodeTable
from gamms.ir.graph import FloatArray, IntArray

_LATE = 256
_WIDER = 8  # how often a search grows before it looks through all nodes
_SURE = 1.0 - 1e-9  # of a radius: on the rim, rounding may have lost a node that is as near
_LEAST, _MOST = 1e-150, 1e150  # distances whose squares are neither zero nor infinite


class Places:
    """Finds the node rows in a disc at a cost that does not grow with the graph."""

    def __init__(self, nodes: NodeTable) -> None:
        self._nodes = nodes
        self._cells = kernels.build_cells(nodes.array("xy"))
        self._late: set[int] = set()  # rows that were added or moved since

    def note(self, row: int) -> None:
        """A node was added or moved."""
        self._late.add(row)

    @property
    def is_worn(self) -> bool:
        """Whether so much was noted that a new grid is cheaper."""
        return len(self._late) > _LATE + 2 * isqrt(len(self._cells.rows))

    def within(self, x: float, y: float, d: float) -> IntArray:
        """Living node rows whose distance to (x, y) is <= d, ascending."""
        rows = kernels.candidate_rows(self._cells, x, y, d)
        if rows is None:
            rows = np.arange(self._nodes.count)
        elif self._late:
            rows = np.union1d(rows, np.fromiter(self._late, np.int64))
        with np.errstate(over="ignore"):  # infinitely far away is far away
            dx, dy = (self._nodes.array("xy")[rows] - (x, y)).T
            is_near = dx * dx + dy * dy <= d * d if _LEAST < d < _MOST else np.hypot(dx, dy) <= d
            rows = rows[is_near]
        if self._nodes.dead:
            rows = rows[self._nodes.array("alive")[rows] != 0]
        found: IntArray = np.sort(rows)
        return found

    def nearest(self, x: float, y: float) -> int:
        """The living node row nearest to (x, y), the first of several; there must be one."""
        d = self._cells.size
        for _ in range(_WIDER):
            rows = self.within(x, y, d)
            distances = self._distances(rows, x, y)
            if len(rows) and distances.min() < d * _SURE:
                return int(rows[np.argmin(distances)])
            d *= 2.0
        rows = self._nodes.living()
        return int(rows[np.argmin(self._distances(rows, x, y))])

    def _distances(self, rows: IntArray, x: float, y: float) -> FloatArray:
        with np.errstate(over="ignore"):  # infinitely far away is far away
            distances: FloatArray = np.hypot(*(self._nodes.array("xy")[rows] - (x, y)).T)
        return distances
