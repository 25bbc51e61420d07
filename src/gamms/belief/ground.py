"""The map in the form that beliefs use: node rows, edges between them, and their costs."""

from functools import cached_property, lru_cache
from hashlib import blake2b
from typing import Any, Self

import numpy as np

from gamms import kernels
from gamms.errors import BadType, UnknownName
from gamms.ir.graph import FloatArray, GraphColumns, IntArray
from gamms.text import shown

Arc = tuple[int, int, float]  # ids of both ends, length


class BeliefMap:
    """The map in one revision.

    Attributes:
        columns: columns of the graph.
        size: number of nodes.
        digest: a text that identifies the nodes and edges, equal in every run.
    """

    def __init__(self, columns: GraphColumns) -> None:
        self.columns = columns
        self.size = len(columns.node_ids)
        ends = columns.node_ids[columns.sources], columns.node_ids[columns.targets]
        parts = (columns.node_ids, *ends, columns.lengths)
        self.digest = blake2b(
            b"".join(np.ascontiguousarray(part).tobytes() for part in parts), digest_size=8
        ).hexdigest()

    def __reduce__(self) -> tuple[Any, ...]:
        return belief_map_of, (self.columns,)

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        return self

    def rows(self, node_ids: IntArray) -> IntArray:
        """Return the rows of some nodes (nodes,); -1 for unknown nodes."""
        return kernels.rows_of(self.columns.node_ids, node_ids, self.columns.node_order)

    def row(self, node_id: int) -> int:
        """Return the row of a node; -1 if it is unknown."""
        return self._row_of.get(node_id, -1)

    @cached_property
    def _row_of(self) -> dict[int, int]:
        """Node id -> its row."""
        return dict(zip(self.columns.node_ids.tolist(), range(self.size), strict=True))

    def known_rows(self, node_ids: IntArray) -> IntArray:
        """Return the rows of some nodes (nodes,).

        Raises:
            UnknownName (KeyError): a node is not on the map.
        """
        rows = self.rows(node_ids)
        if (rows < 0).any():
            raise UnknownName("node", int(node_ids[np.argmax(rows < 0)]), self.columns.node_ids.tolist())
        return rows

    @cached_property
    def ways(self) -> tuple[IntArray, IntArray]:
        """Rows of both ends, (pairs,), of connected nodes, each pair once, sorted by source, then by target."""
        sources = self.columns.sources
        targets = self.columns.targets
        pairs = np.unique((sources * self.size + targets)[sources != targets])
        return pairs // self.size, pairs % self.size

    def shortest_edges(self, sources: IntArray, targets: IntArray) -> IntArray:
        """Return the rows (pairs,) of the shortest edges between pairs of node rows; -1 if there is no edge."""
        columns = self.columns
        order = np.lexsort((columns.lengths, columns.sources * self.size + columns.targets))
        known, first = np.unique((columns.sources * self.size + columns.targets)[order], return_index=True)
        if not len(known):
            return np.full(len(sources), -1)
        wanted = sources * self.size + targets
        places = np.minimum(np.searchsorted(known, wanted), len(known) - 1)
        is_there = (known[places] == wanted) & (sources != targets)
        return np.where(is_there, order[first[places]], -1)

    def arcs(self) -> set[Arc]:
        """Return all edges by the ids of their ends and their lengths."""
        ids = self.columns.node_ids
        columns = self.columns
        ends = ids[columns.sources].tolist(), ids[columns.targets].tolist()
        return set(zip(*ends, columns.lengths.tolist(), strict=True))

    def ids_where(self, chosen: "IntArray | FloatArray") -> list[int]:
        """Return the ids of the rows in a mask."""
        found: list[int] = self.columns.node_ids[chosen].tolist()
        return found


@lru_cache(maxsize=4)
def belief_map_of(columns: GraphColumns) -> BeliefMap:
    """Return the map of a graph revision, cached.

    Raises:
        BadType: not the columns of a graph.
    """
    if not isinstance(columns, GraphColumns):
        raise BadType(f"The map of a filter must be the columns of a graph, ctx.graph.columns(), not {shown(columns)}.")
    return BeliefMap(columns)
