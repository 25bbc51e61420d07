"""The map as beliefs use it: rows of nodes, which edges lead where, and what they cost."""

from functools import cached_property, lru_cache
from hashlib import blake2b

import numpy as np

from gamms.errors import BadType, UnknownName
from gamms.ir.graph import FloatArray, GraphColumns, IntArray
from gamms.text import shown

Arc = tuple[int, int, float]  # ids of both ends, length


class Ground:
    """One revision of the map.

    Attributes:
        columns: of the graph.
        size: how many nodes there are.
        digest: the same text for the same nodes and edges, in every run.
    """

    def __init__(self, columns: GraphColumns) -> None:
        self.columns, self.size = columns, len(columns.node_ids)
        self._order = np.argsort(columns.node_ids, kind="stable")
        self._ascending = columns.node_ids[self._order]
        ends = columns.node_ids[columns.sources], columns.node_ids[columns.targets]
        parts = (columns.node_ids, *ends, columns.lengths)
        self.digest = blake2b(
            b"".join(np.ascontiguousarray(part).tobytes() for part in parts), digest_size=8
        ).hexdigest()

    def rows(self, node_ids: IntArray) -> IntArray:
        """Return the rows of some nodes (nodes,); -1 of those that are not on the map."""
        if not self.size:
            return np.full(len(node_ids), -1)
        places = np.minimum(np.searchsorted(self._ascending, node_ids), self.size - 1)
        return np.where(self._ascending[places] == node_ids, self._order[places], -1)

    def row(self, node_id: int) -> int:
        """Return the row of a node; -1 if it is not on the map."""
        return self._row_of.get(node_id, -1)

    @cached_property
    def _row_of(self) -> dict[int, int]:
        """Id of a node -> its row."""
        return dict(zip(self.columns.node_ids.tolist(), range(self.size), strict=True))

    def known_rows(self, node_ids: IntArray) -> IntArray:
        """Return the rows of some nodes (nodes,).

        Raises:
            UnknownName (KeyError): one is not on the map.
        """
        rows = self.rows(node_ids)
        if (rows < 0).any():
            raise UnknownName("node", int(node_ids[np.argmax(rows < 0)]))
        return rows

    @cached_property
    def ways(self) -> tuple[IntArray, IntArray]:
        """Rows of both ends (ways,) of which node leads to which other, each pair once, by start and then by end."""
        sources, targets = self.columns.sources, self.columns.targets
        pairs = np.unique((sources * self.size + targets)[sources != targets])
        return pairs // self.size, pairs % self.size

    def shortest_edges(self, sources: IntArray, targets: IntArray) -> IntArray:
        """Return the rows (pairs,) of the shortest edges between rows of nodes; -1 where none leads to another node."""
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
        """Return all edges by the ids of their ends and by their lengths."""
        ids, columns = self.columns.node_ids, self.columns
        ends = ids[columns.sources].tolist(), ids[columns.targets].tolist()
        return set(zip(*ends, columns.lengths.tolist(), strict=True))

    def ids_where(self, chosen: "IntArray | FloatArray") -> list[int]:
        """Return the ids of some rows."""
        found: list[int] = self.columns.node_ids[chosen].tolist()
        return found


@lru_cache(maxsize=4)
def ground_of(columns: GraphColumns) -> Ground:
    """Return the map of a revision of a graph, made once.

    Raises:
        BadType: these are no columns of a graph.
    """
    if not isinstance(columns, GraphColumns):
        raise BadType(f"The map of a filter is the columns of a graph, ctx.graph.columns(), not {shown(columns)}.")
    return Ground(columns)
