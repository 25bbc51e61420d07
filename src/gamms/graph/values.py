"""Node and OSMEdge values by row: sensing hands out hundreds per call, so they are made once and shared."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from gamms.graph.tables import EdgeTable, NodeTable
from gamms.ir.graph import IntArray
from gamms.typing.graph_engine import Node, OSMEdge

_MOST_EAGER = 1 << 19  # rows of a table whose values are made in one go; a larger one's as they are asked for
_MOST_KEPT = 1 << 21

# NOTE: skips the checking constructors; the tables hold checked values (benchmarks/README.md, w3).
_node: Callable[[Any], Node] = partial(tuple.__new__, Node)
_edge: Callable[[Any], OSMEdge] = partial(tuple.__new__, OSMEdge)


class Values:
    """Values by row; `make(rows)` makes those of some rows."""

    def __init__(self, make: Callable[[IntArray], list[Any]]) -> None:
        self._make = make
        self._values = np.empty(0, object)  # (rows,)  None where it is not made yet
        self._is_complete = True
        self._made = 0

    def take(self, rows: IntArray, count: int) -> list[Any]:
        """The values of `rows` in a table of `count` rows."""
        if count > len(self._values):
            self._grow(count)
        taken: list[Any] = self._values[rows].tolist()
        if not self._is_complete and None in taken:
            self._fill(rows[np.fromiter((value is None for value in taken), np.bool_, len(taken))])
            taken = self._values[rows].tolist()
            if None in taken:  # making room for the missing ones has dropped the others
                self._fill(rows)
                taken = self._values[rows].tolist()
        return taken

    def forget(self, rows: IntArray) -> None:
        """These rows have changed."""
        self._values[rows[rows < len(self._values)]] = None
        self._is_complete = False

    def _grow(self, count: int) -> None:
        before = len(self._values)
        is_eager = count <= _MOST_EAGER
        # Room to spare, so that a graph that grows between two looks is not copied at each of them.
        values = np.empty(count if is_eager else count + count // 4, object)
        values[:before] = self._values
        self._values = values
        if is_eager:
            self._fill(np.arange(before, count))
        else:
            self._is_complete = False

    def _fill(self, rows: IntArray) -> None:
        if self._made + len(rows) > _MOST_KEPT:
            self._values[:] = None
            self._is_complete, self._made = False, 0
        self._values[rows] = np.fromiter(self._make(rows), object, len(rows))
        self._made += len(rows)


def node_values(nodes: NodeTable, rows: IntArray) -> list[Node]:
    """The values of node rows."""
    xy = nodes.array("xy")[rows]
    return list(map(_node, zip(nodes.array("ids")[rows].tolist(), xy[:, 0].tolist(), xy[:, 1].tolist(), strict=True)))


def edge_values(
    edges: EdgeTable, nodes: NodeTable, rows: IntArray, take_nodes: Callable[[IntArray], list[Node]]
) -> list[OSMEdge]:
    """The values of edge rows; `take_nodes` gives those of node rows."""
    sources, targets = edges.array("sources")[rows], edges.array("targets")[rows]
    ids = nodes.array("ids")
    first: list[Any] = take_nodes(sources)
    last: list[Any] = take_nodes(targets)
    if edges.bends:
        for i, row in enumerate(rows.tolist()):
            if (bend := edges.bends.get(row)) is not None:
                first[i], last[i] = tuple(bend.ravel().tolist()), None
    fields = (edges.array("ids")[rows].tolist(), ids[sources].tolist(), ids[targets].tolist())
    return list(map(_edge, zip(*fields, edges.array("lengths")[rows].tolist(), first, last, strict=True)))
