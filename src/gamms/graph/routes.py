"""Routing: shortest paths and distances by edge weights, cached for one revision of a graph.

Strategies ask every turn, mostly for the same goals. So the distances to a goal, and from every node the next step on
the way to it, are computed once; then a path from anywhere is a walk.
"""

from collections.abc import Iterable
from functools import partial
from math import inf

import numpy as np

from gamms import kernels
from gamms.arguments import as_range
from gamms.errors import BadType, NoPath, UnknownName, nearest
from gamms.graph import records
from gamms.graph.cache import Cache
from gamms.graph.store import GraphStore
from gamms.ir.graph import FloatArray, GraphColumns, IntArray
from gamms.text import shown
from gamms.typing.graph_engine import between, one_end
from gamms.typing.graph_values import NodeIds

_MOST_BYTES = 256 * 2**20  # the tables of one goal take 12 bytes a node


class Routes:
    """Answers routing queries of one graph; see `IGraph` for what each call promises.

    Attributes:
        cache: among others (weight, id of a node) -> the distances to that node, (memoryview by row,).
    """

    def __init__(self, store: GraphStore) -> None:
        self._store = store
        self.cache = Cache(_MOST_BYTES)

    def shortest_path(self, source: int, target: int, weight: str | None) -> list[int]:
        """Return the ids of the nodes on the shortest path, both ends included."""
        columns = self._store.columns()
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
        """Return the distance from one node to another; infinite where there is no path."""
        columns = self._store.columns()
        row, end = self._row(source), self._row(target)
        found: float = self._distances_to(columns, end, weight)[row]
        return found

    def distances(
        self, source: NodeIds | None, target: NodeIds | None, weight: str | None, cutoff: float | None
    ) -> dict[int, float]:
        """Return the distances from the nearest source to each node, or from each node to the nearest target."""
        nodes = one_end(source, target)
        columns = self._store.columns()
        rows = self._rows(nodes, "target" if source is None else "source")
        limit = inf if cutoff is None else as_range(cutoff, "cutoff")
        found = self._distances(columns, rows, weight, reverse=source is None, cutoff=limit)
        near = np.flatnonzero(np.isfinite(found))
        return dict(zip(columns.node_ids[near].tolist(), found[near].tolist(), strict=True))

    def distance_matrix(self, sources: NodeIds, targets: NodeIds, weight: str | None) -> FloatArray:
        """Return the distances (sources, targets); infinite where there is no path."""
        columns = self._store.columns()
        starts, ends = self._rows(sources, "sources"), self._rows(targets, "targets")
        return between(partial(self._arcs, columns, weight), starts, ends)

    # -- inside -------------------------------------------------------------------------------------------------

    def _steps(self, columns: GraphColumns, end: int, weight: str | None) -> tuple[IntArray]:
        """Return for every node the row of the next one on the path to row `end`; -1 where there is none."""

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
        return self._store.nodes.find(records.as_id(node_id, "a node"))

    def _rows(self, node_ids: NodeIds, name: str) -> IntArray:
        """Return the rows of one node or of several."""
        if not isinstance(node_ids, Iterable):
            return np.array([self._row(node_ids)])
        ids = node_ids if isinstance(node_ids, np.ndarray | str) else list(node_ids)
        return self._store.nodes.index.rows(records.id_array(ids, name), "node")


def edge_weights(columns: GraphColumns, weight: str | None) -> FloatArray:
    """Return the weight of every edge: its length, one step, or one of its attributes.

    Args:
        columns: a graph.
        weight: "length", the name of an attribute (an edge without it counts 1), or None (every edge counts 1).

    Returns:
        (edges,) not negative; infinite where an edge is closed.

    Raises:
        BadType: `weight` is no name, or the attribute of an edge no number.
        BadValue: it is negative or NaN.
        UnknownName (KeyError): no edge has such an attribute, and the name looks like a misspelt one.
    """
    if weight is not None and not isinstance(weight, str):
        raise BadType(
            f"weight must be 'length', the name of an edge attribute, or None for steps, not {shown(weight)}."
        )
    if weight == "length":
        return columns.lengths
    known = ("length", *columns.edge_attributes)
    if weight is not None and weight not in known and nearest(weight, known):
        raise UnknownName("weight", weight, known)
    weights = np.ones(len(columns.edge_ids))
    given = {} if weight is None else columns.edge_attributes.get(weight, {})
    numbers = [_number(value, columns, row, weight) for row, value in given.items()]
    weights[list(given)] = numbers
    return weights


def _number(value: object, columns: GraphColumns, row: int, weight: str | None) -> float:
    if type(value) is float and value >= 0.0:
        return value
    return as_range(value, f"The weight {weight!r} of edge {columns.edge_ids[row]}")
