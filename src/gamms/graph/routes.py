"""Ways through a graph: shortest paths and distances, remembered for one revision of it.

Strategies ask every turn, mostly for the same goals. So the distances to a goal, and from every node the next step on
the way to it, are worked out once; then a path from anywhere is a walk.
"""

from collections.abc import Iterable
from functools import partial
from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np

from gamms import kernels
from gamms.arguments import as_range
from gamms.errors import NoPath
from gamms.graph import records
from gamms.graph.cache import Cache
from gamms.graph.weights import edge_weights
from gamms.ir.graph import FloatArray, GraphColumns, IntArray
from gamms.typing.graph_routes import between, one_end

if TYPE_CHECKING:
    from gamms.graph.graph import Graph

_MOST_BYTES = 256 * 2**20  # the tables of one goal take 12 bytes a node


class Routes:
    """Finds ways through one graph; see `IGraph` for what each call promises.

    Attributes:
        cache: among others (weight, id of a node) -> the distances to that node, (memoryview by row,).
    """

    def __init__(self, graph: "Graph") -> None:
        self._graph = graph
        self.cache = Cache(_MOST_BYTES)

    def clear(self) -> None:
        """Forget what is known."""
        self.cache.clear()

    def shortest_path(self, source: int, target: int, weight: str | None) -> list[int]:
        """Ids of the nodes on the way, both ends included."""
        columns = self._graph._snapshot()
        row, end = self._row(source), self._row(target)
        (steps,) = self._steps(columns, end, weight)
        next_of, ids = steps.data, columns.node_ids.data
        path = [ids[row]]
        while row != end:
            row = next_of[row]
            if row < 0:
                raise NoPath(source, target)
            path.append(ids[row])
        return path

    def distance(self, source: int, target: int, weight: str | None) -> float:
        """From one node to another; infinite where there is no way."""
        columns = self._graph._snapshot()
        row, end = self._row(source), self._row(target)
        found: float = self._distances_to(columns, end, weight)[row]
        return found

    def distances(self, source: Any, target: Any, weight: str | None, cutoff: float | None) -> dict[int, float]:
        """From the nearest source to each node, or from each node to the nearest target."""
        nodes = one_end(source, target)
        columns = self._graph._snapshot()
        rows = self._rows(nodes, "target" if source is None else "source")
        limit = inf if cutoff is None else as_range(cutoff, "cutoff")
        found = self._distances(columns, rows, weight, reverse=source is None, cutoff=limit)
        near = np.flatnonzero(np.isfinite(found))
        return dict(zip(columns.node_ids[near].tolist(), found[near].tolist(), strict=True))

    def distance_matrix(self, sources: Any, targets: Any, weight: str | None) -> FloatArray:
        """From each source (rows) to each target (columns); infinite where there is no way."""
        columns = self._graph._snapshot()
        starts, ends = self._rows(sources, "sources"), self._rows(targets, "targets")
        return between(partial(self._arcs, columns, weight), starts, ends)

    # -- inside -------------------------------------------------------------------------------------------------

    def _steps(self, columns: GraphColumns, end: int, weight: str | None) -> tuple[IntArray]:
        """From every node, the row of the next one on the way to row `end`; -1 where there is none."""

        def make() -> tuple[IntArray]:
            goal = np.array([end])
            distances = np.asarray(self._distances_to(columns, end, weight))
            tight = kernels.tight_arcs(self._arcs(columns, weight, reverse=True), distances)
            hops = kernels.shortest_distances(tight, goal)
            return (kernels.first_steps(tight, hops, columns.node_ids).astype(np.int32),)

        return self.cache.get(columns.revision, ("steps", weight, end), make)

    def _distances_to(self, columns: GraphColumns, end: int, weight: str | None) -> memoryview:
        def make() -> tuple[memoryview]:
            arcs = self._arcs(columns, weight, reverse=True)
            return (kernels.shortest_distances(arcs, np.array([end])).data,)

        return self.cache.get(columns.revision, (weight, columns.node_ids.item(end)), make)[0]

    def _distances(
        self, columns: GraphColumns, rows: IntArray, weight: str | None, *, reverse: bool, cutoff: float
    ) -> FloatArray:
        if reverse and cutoff == inf and len(rows) == 1:
            return np.asarray(self._distances_to(columns, rows.item(), weight))

        def make() -> tuple[FloatArray]:
            return (kernels.shortest_distances(self._arcs(columns, weight, reverse=reverse), rows, cutoff),)

        key = ("distances", weight, reverse, cutoff, np.unique(rows).tobytes())
        return self.cache.get(columns.revision, key, make)[0]

    def _arcs(self, columns: GraphColumns, weight: str | None, *, reverse: bool) -> kernels.Arcs:
        def make() -> kernels.Arcs:
            ends = (columns.targets, columns.sources) if reverse else (columns.sources, columns.targets)
            return kernels.make_arcs(*ends, edge_weights(columns, weight), len(columns.node_ids))

        return self.cache.get(columns.revision, ("arcs", weight, reverse), make)

    def _row(self, node_id: int) -> int:
        return self._graph._nodes.find(records.as_id(node_id, "a node"))

    def _rows(self, node_ids: Any, name: str) -> IntArray:
        """Rows of one node or of several."""
        if not isinstance(node_ids, Iterable):
            return np.array([self._row(node_ids)])
        ids = node_ids if isinstance(node_ids, np.ndarray | str) else list(node_ids)
        return self._graph._nodes.index.rows(records.id_array(ids, name), "node")
