"""Everything a graph can work out again from its tables: who is near, who is next, values by row.

Each index is built when first asked for; a change is noted, or forgets what it touches.
"""

from collections.abc import Iterator
from copy import deepcopy
from typing import Any

import numpy as np

from gamms import kernels
from gamms.errors import UnknownName
from gamms.graph import records
from gamms.graph.adjacency import Adjacency
from gamms.graph.places import Places
from gamms.graph.tables import EdgeTable, NodeTable
from gamms.graph.values import Values, edge_values, node_values
from gamms.ir.graph import IntArray
from gamms.typing.graph_engine import Node, OSMEdge

_MOST_NEIGHBORHOODS = 1 << 18
_FEW = 32


class Neighborhoods(dict[int, tuple[int, ...]]):
    """Node id -> the node itself, then its neighbours; filled when asked: one by one, after a few all at once."""

    # NOTE: a dict with __missing__ answers a known node without a Python call (benchmarks/README.md, w2).

    def __init__(self, graph: Any) -> None:  # Any: the graph, whose module needs this one
        self._graph = graph
        self._misses = 0

    def __deepcopy__(self, memo: dict[int, Any]) -> "Neighborhoods":
        copied: Neighborhoods = deepcopy(self._graph, memo).neighborhoods
        return copied

    def clear(self) -> None:
        """Forget everything."""
        super().clear()
        self._misses = 0

    def __missing__(self, id: int) -> tuple[int, ...]:
        id = records.as_id(id, "a node")
        made = (id, *(other for other in self._graph._indexes.neighbors(id) if other != id))
        self._misses += 1
        if len(self) >= _MOST_NEIGHBORHOODS:
            self.clear()
        elif self._misses == _FEW:
            self.update(self._graph._indexes.all_neighborhoods(_MOST_NEIGHBORHOODS))
        self[id] = made
        return made


class Indexes:
    """The indexes of one graph's tables."""

    def __init__(self, nodes: NodeTable, edges: EdgeTable, neighborhoods: Neighborhoods) -> None:
        self.is_built = False  # whether there is anything to note a change in
        self.neighborhoods = neighborhoods
        neighborhoods.clear()
        self._nodes, self._edges = nodes, edges
        self._places: Places | None = None
        self._by_end: dict[str, Adjacency] = {}
        self._node_values = Values(lambda rows: node_values(nodes, rows))
        self._edge_values = Values(lambda rows: edge_values(edges, nodes, rows, self.node_values))
        self._is_seen = np.zeros(0, np.bool_)  # by node row; all False between calls

    # -- questions ----------------------------------------------------------------------------------------------

    def nodes_within(self, x: float, y: float, d: float) -> IntArray:
        """Node rows whose distance to (x, y) is <= d, ascending."""
        return self._by_place().within(float(x), float(y), float(d))  # a NumPy float32 would round the rim away

    def nearest(self, x: float, y: float) -> int:
        """The node row nearest to (x, y), the first of several; there must be a node."""
        return self._by_place().nearest(x, y)

    def edges_at(self, nodes: IntArray) -> IntArray:
        """Edge rows with at least one end among the node rows, ascending."""
        return np.union1d(self._adjacency("sources").at(nodes), self._adjacency("targets").at(nodes))

    def edges_among(self, nodes: IntArray) -> list[OSMEdge]:
        """The edges with both ends among the node rows, in insertion order."""
        if len(self._is_seen) < self._nodes.count:
            self._is_seen = np.zeros(self._nodes.capacity, np.bool_)
        rows = self._adjacency("sources").at(nodes)
        self._is_seen[nodes] = True
        rows = rows[self._is_seen[self._edges.array("targets")[rows]]]
        self._is_seen[nodes] = False
        return self._edge_values.take(rows, self._edges.count)

    def node_values(self, rows: IntArray) -> list[Node]:
        """The nodes in these rows."""
        self.is_built = True
        return self._node_values.take(rows, self._nodes.count)

    def edge_value(self, row: int) -> OSMEdge:
        """The edge in a row."""
        made = edge_values(self._edges, self._nodes, np.array([row]), lambda rows: node_values(self._nodes, rows))
        return made[0]

    def neighbors(self, id: int) -> list[int]:
        """Unique targets of the edges leaving a node, in edge insertion order.

        Raises:
            UnknownName (KeyError): there is no such node.
        """
        row = self._nodes.index.row(id)
        if row < 0:
            raise UnknownName("node", id)
        edges = self._adjacency("sources").at_one(row)
        ids, targets = self._nodes.ids, self._edges.targets
        return list(dict.fromkeys(ids[targets[edge]] for edge in edges))

    def all_neighborhoods(self, most: int) -> Iterator[tuple[int, tuple[int, ...]]]:
        """Every node's neighbourhood, for a graph of at most `most` nodes; nothing for a larger one."""
        nodes, edges = self._nodes.living(), self._edges.living()
        if len(nodes) > most:
            return
        # NOTE: one int object per id, so that looking one up compares no values (benchmarks/README.md, w2).
        ids = self._nodes.array("ids").astype(object)
        offsets, order = kernels.group_rows(self._edges.array("sources")[edges], self._nodes.count)
        targets = ids[self._edges.array("targets")[edges][order]].tolist()
        starts, ends = offsets[nodes].tolist(), offsets[nodes + 1].tolist()
        for id, start, end in zip(ids[nodes].tolist(), starts, ends, strict=True):
            yield id, tuple(dict.fromkeys((id, *targets[start:end])))

    # -- notes --------------------------------------------------------------------------------------------------

    def node_added(self, row: int) -> None:
        """A node was appended."""
        if self._places is not None:
            self._places.note(row)

    def node_moved(self, row: int) -> None:
        """A node has other coordinates; straight edges at it have another shape."""
        if not self.is_built:
            return
        self.node_added(row)
        nodes = np.array([row])
        self._node_values.forget(nodes)
        self._edge_values.forget(self.edges_at(nodes))

    def node_removed(self, row: int) -> None:
        """A node and its edges are dead."""
        self.neighborhoods.pop(self._nodes.ids[row], None)

    def edge_added(self, row: int, source: int, target: int) -> None:
        """An edge was appended, or has these ends now."""
        for end, node in (("sources", source), ("targets", target)):
            if end in self._by_end:
                self._by_end[end].note_added(node, row)
        self.neighborhoods.pop(self._nodes.ids[source], None)

    def edge_changed(self, row: int, old_ends: tuple[int, int], ends: tuple[int, int]) -> None:
        """An edge has another length, shape or ends."""
        if not self.is_built:
            return
        self._edge_values.forget(np.array([row]))
        if ends != old_ends:
            self.edge_removed(old_ends)
            self.edge_added(row, *ends)

    def edge_removed(self, ends: tuple[int, int]) -> None:
        """An edge is dead, or has left these ends."""
        for adjacency in self._by_end.values():
            adjacency.note_changed()
        self.neighborhoods.pop(self._nodes.ids[ends[0]], None)

    def _by_place(self) -> Places:
        if self._places is None or self._places.is_worn:
            self._places = Places(self._nodes)
            self.is_built = True
        return self._places

    def _adjacency(self, end: str) -> Adjacency:
        adjacency = self._by_end.get(end)
        if adjacency is None or adjacency.is_worn:
            adjacency = self._by_end[end] = Adjacency(self._edges, end, self._nodes.count)
            self.is_built = True
        return adjacency
