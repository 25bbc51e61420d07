"""Routing: shortest paths and distances by edge weights, cached for one revision of a graph.

Strategies ask every turn, mostly for the same goals. So the distances to a goal, and from every node the next step on
the way to it, are computed once; then a path from anywhere is a walk.
"""

import logging
from collections.abc import Callable, Hashable, Iterable
from functools import cache, partial
from time import perf_counter

import numpy as np

from gamms import kernels
from gamms.arguments import as_range
from gamms.errors import BadType, UnknownName, nearest
from gamms.graph import records
from gamms.graph.cache import Cache
from gamms.graph.store import GraphStore
from gamms.ir.graph import FloatArray, GraphColumns, IntArray
from gamms.text import shown
from gamms.typing.graph_engine import RememberedT, Routes
from gamms.typing.graph_values import NodeIds

_PATIENCE_S = 2.0
_MOST_BYTES = 256 * 2**20  # the tables of one goal take 12 bytes a node


class CachedRoutes(Routes):
    """The routes of a store.

    Attributes:
        cache: among others (weight, id of a node) -> the distances to that node, (memoryview by row,).
    """

    def __init__(self, store: GraphStore) -> None:
        self._store = store
        self.cache = Cache(_MOST_BYTES)
        self._seconds = 0.0

    def ids(self) -> IntArray:
        """Return the ids of all nodes (nodes,), by row, without those of nodes that were removed."""
        return self._store.columns().node_ids

    def ends(self) -> tuple[IntArray, IntArray]:
        """Return the rows of sources and targets, (edges,) each."""
        columns = self._store.columns()
        return columns.sources, columns.targets

    def weights(self, weight: str | None) -> FloatArray:
        """Return what each edge costs, (edges,)."""
        return edge_weights(self._store.columns(), weight)

    def rows(self, nodes: NodeIds, name: str) -> IntArray:
        """Return the rows of one node or of several (KeyError)."""
        self._store.columns()
        if not isinstance(nodes, Iterable):
            return np.array([self.row(nodes)])
        ids = nodes if isinstance(nodes, np.ndarray | str) else list(nodes)
        return self._store.nodes.index.rows(records.id_array(ids, name), "node")

    def row(self, node_id: int) -> int:
        """Return the row of a node (KeyError)."""
        return self._store.nodes.find(records.as_id(node_id, "a node"))

    def remember(self, key: Hashable, make: Callable[[], RememberedT]) -> RememberedT:
        """Return what `make` gave for this revision of the graph."""
        slow = kernels.lacks_scipy(len(self._store.edges))
        return self.cache.get(self._store.revision, key, partial(self._timed, make) if slow else make)

    def _timed(self, make: Callable[[], RememberedT]) -> RememberedT:
        """Return what `make` gives; warn once it has taken seconds, most of which SciPy would have saved."""
        began = perf_counter()
        found = make()
        self._seconds += perf_counter() - began
        if self._seconds > _PATIENCE_S:
            _warn_of_missing_scipy()
        return found


@cache  # once in a process
def _warn_of_missing_scipy() -> None:
    logging.getLogger("gamms").warning(
        "Shortest ways have taken seconds, because SciPy is not installed. With it they take a fraction of that: "
        'pip install "gamms[accel]"'
    )


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
