"""Edges by one of their ends, built when first asked for and kept up to date by notes."""

import numpy as np

from gamms import kernels
from gamms.graph.tables import EdgeTable
from gamms.ir.graph import IntArray

_LATE = 1024


class Adjacency:
    """Edge rows grouped by source (or target) row.

    A grouping is made once; edges that change later are noted beside it. What the grouping says is checked against
    the table when read, so a removed edge needs no note.
    """

    def __init__(self, edges: EdgeTable, end: str, nodes: int) -> None:
        self._edges, self._end = edges, end
        self._nodes = nodes
        self._offsets, self._rows = kernels.group_rows(edges.array(end), nodes)
        self._offset_view, self._row_view = self._offsets.data, self._rows.data
        self._late: dict[int, list[int]] = {}  # node row -> edge rows noted since
        self._late_count = 0
        self._is_exact = edges.dead == 0  # whether every grouped edge is alive and still where it was

    def note_added(self, node: int, edge: int) -> None:
        """An edge now has this end at `node`."""
        self._late.setdefault(node, []).append(edge)
        self._late_count += 1

    def note_changed(self) -> None:
        """Some edge was removed or has moved away from its node."""
        self._is_exact = False

    @property
    def is_worn(self) -> bool:
        """Whether so much was noted that a new grouping is cheaper."""
        return self._late_count > _LATE + len(self._rows) // 4

    def at_one(self, node: int) -> list[int]:
        """Living edge rows whose end is this node row, ascending."""
        rows: list[int] = []
        if node < self._nodes:
            rows = self._row_view[self._offset_view[node] : self._offset_view[node + 1]].tolist()
        late = self._late.get(node)
        if late:
            rows = sorted({*rows, *late})
        if late or not self._is_exact:
            alive, ends = self._edges.alive, getattr(self._edges, self._end)
            rows = [row for row in rows if alive[row] and ends[row] == node]
        return rows

    def at(self, nodes: IntArray) -> IntArray:
        """Living edge rows whose end is one of `nodes` (unique rows), ascending."""
        rows = kernels.ragged_rows(self._offsets, self._rows, nodes[nodes < self._nodes])
        if self._late:
            late = [edge for node in nodes.tolist() for edge in self._late.get(node, ())]
            rows = np.concatenate([rows, np.array(late, np.int64)])
        if not (self._is_exact and not self._late):
            rows = rows[self._edges.array("alive")[rows] != 0]
            rows = rows[np.isin(self._edges.array(self._end)[rows], nodes)]
            return np.unique(rows)
        rows.sort()
        return rows
