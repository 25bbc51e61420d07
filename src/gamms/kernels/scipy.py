"""The one door to SciPy: the faster twin of `paths.shortest_distances`, which finds the same bits."""

from functools import cache
from math import inf
from typing import Any

import numpy as np

from gamms.ir.graph import FloatArray, IntArray
from gamms.kernels import paths
from gamms.kernels.paths import Arcs

_FEW = 1000  # arcs: below, a heap in Python is done before SciPy has checked its arguments


def shortest_distances(arcs: Arcs, rows: IntArray, cutoff: float = inf) -> FloatArray:
    """See `paths.shortest_distances`; by SciPy where it is installed and pays."""
    if len(arcs.ends) < _FEW or len(rows) == 0 or not is_installed():
        return paths.shortest_distances(arcs, rows, cutoff)
    return scipy_distances(arcs, rows, cutoff)


def scipy_distances(arcs: Arcs, rows: IntArray, cutoff: float = inf) -> FloatArray:
    """See `paths.shortest_distances`: Dijkstra with a Fibonacci heap, in C; `rows` must not be empty."""
    sparse = _sparse()
    nodes = len(arcs.offsets) - 1
    # Given as rows, not as a list of triples: so explicit zeros stay edges, and nothing is added up.
    matrix = sparse.csr_array((arcs.weights, arcs.ends.astype(np.int32), arcs.offsets.astype(np.int32)), (nodes, nodes))
    found: FloatArray = sparse.csgraph.dijkstra(matrix, indices=np.unique(rows), min_only=True, limit=cutoff)
    return found


@cache
def is_installed() -> bool:
    """Whether SciPy can be imported; asked once."""
    try:
        _sparse()
    except ImportError:
        return False
    return True


def _sparse() -> Any:
    import scipy.sparse.csgraph

    return scipy.sparse
