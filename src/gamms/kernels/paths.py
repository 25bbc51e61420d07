"""Shortest paths: distances along edges, and the next step on the way; by SciPy where it is installed."""

from functools import cache
from math import inf
from typing import Any, NamedTuple

import numpy as np

from gamms.ir.graph import FloatArray, IntArray

_FEW = 1000  # arcs: below, a heap in Python is done before SciPy has checked its arguments


class Arcs(NamedTuple):
    """A weighted directed graph as compressed sparse rows: what leaves row `i` is at `offsets[i]:offsets[i + 1]`."""

    offsets: IntArray  # (nodes + 1,)
    ends: IntArray  # (arcs,)  rows, ascending for each start
    weights: FloatArray  # (arcs,)  not negative, finite


def make_arcs(starts: IntArray, ends: IntArray, weights: FloatArray, nodes: int) -> Arcs:
    """Group edges by their start; of parallel ones the cheapest stays.

    Args:
        starts: (edges,) rows.
        ends: (edges,) rows.
        weights: (edges,) not negative; an infinite one closes its edge.
        nodes: how many rows there are.
    """
    order = np.lexsort((weights, ends, starts))
    order = order[np.isfinite(weights[order])]
    starts, ends, weights = starts[order], ends[order], weights[order]
    is_first = np.ones(len(order), np.bool_)
    is_first[1:] = (starts[1:] != starts[:-1]) | (ends[1:] != ends[:-1])
    offsets = np.zeros(nodes + 1, np.int64)
    np.cumsum(np.bincount(starts[is_first], minlength=nodes), out=offsets[1:])
    return Arcs(offsets, ends[is_first], weights[is_first])


def heap_distances(arcs: Arcs, rows: IntArray, cutoff: float = inf) -> FloatArray:
    """Return the distance of every node from the nearest of some nodes: the specification.

    Dijkstra's algorithm (1959) with a binary heap. The weights of a path are added one by one, from its start: rounding
    never turns a longer sum into a smaller one, so that the result does not depend on the order of the heap, and
    every implementation that adds so finds the same bits.

    Args:
        arcs: the ways; reversed ones give the distances *to* `rows`.
        rows: where to start.
        cutoff: what is farther away than this counts as out of reach.

    Returns:
        (nodes,) infinite where there is no path.
    """
    from heapq import heapify, heappop, heappush

    offsets, ends, weights = (column.tolist() for column in arcs)
    distances = [inf] * (len(offsets) - 1)
    heap = [(0.0, row) for row in rows.tolist()]
    heapify(heap)
    for _, row in heap:
        distances[row] = 0.0
    while heap:
        distance, node = heappop(heap)
        if distance > distances[node]:
            continue
        for arc in range(offsets[node], offsets[node + 1]):
            end, far = ends[arc], distance + weights[arc]
            if far < distances[end] and far <= cutoff:
                distances[end] = far
                heappush(heap, (far, end))
    return np.array(distances)


def tight_arcs(arcs: Arcs, distances: FloatArray) -> Arcs:
    """Return the arcs that shortest paths may use, each of weight 1.

    Args:
        arcs: the ways.
        distances: (nodes,) what `shortest_distances` found along them.
    """
    starts = np.repeat(np.arange(len(arcs.offsets) - 1), np.diff(arcs.offsets))
    reached = distances[starts] + arcs.weights
    is_tight = (reached == distances[arcs.ends]) & np.isfinite(reached)
    ones = np.ones(int(is_tight.sum()))
    return make_arcs(starts[is_tight], arcs.ends[is_tight], ones, len(arcs.offsets) - 1)


def first_steps(tight: Arcs, hops: FloatArray, ids: IntArray) -> IntArray:
    """Return for every node the one before it on its shortest path from the start.

    Of equally long paths the one with the fewest edges counts; of these, the one whose ids, read from the node
    back to the start, are least at the first difference. On reversed arcs that is the next node on the way *to* the
    start.

    Args:
        tight: the arcs that shortest paths may use.
        hops: (nodes,) the least number of tight arcs to each node.
        ids: (nodes,) different numbers.

    Returns:
        (nodes,) rows; -1 for the start itself and where there is no path.
    """
    starts = np.repeat(np.arange(len(tight.offsets) - 1), np.diff(tight.offsets))
    is_step = hops[starts] + 1.0 == hops[tight.ends]
    starts, ends = starts[is_step], tight.ends[is_step]
    order = np.lexsort((-ids[starts], ends))  # of several, the last one written stays: the least id
    steps = np.full(len(ids), -1, np.int64)
    steps[ends[order]] = starts[order]
    return steps


def shortest_distances(arcs: Arcs, rows: IntArray, cutoff: float = inf) -> FloatArray:
    """Return what `heap_distances` returns; by SciPy where it is installed and faster."""
    if len(arcs.ends) < _FEW or len(rows) == 0 or not has_scipy():
        return heap_distances(arcs, rows, cutoff)
    return scipy_distances(arcs, rows, cutoff)


def scipy_distances(arcs: Arcs, rows: IntArray, cutoff: float = inf) -> FloatArray:
    """Return what `heap_distances` returns: Dijkstra with a Fibonacci heap, in C; `rows` must not be empty."""
    sparse = _sparse()
    nodes = len(arcs.offsets) - 1
    # Given as rows, not as a list of triples: so explicit zeros stay edges, and nothing is added up.
    matrix = sparse.csr_array((arcs.weights, arcs.ends.astype(np.int32), arcs.offsets.astype(np.int32)), (nodes, nodes))
    found: FloatArray = sparse.csgraph.dijkstra(matrix, indices=np.unique(rows), min_only=True, limit=cutoff)
    return found


def lacks_scipy(arcs: int) -> bool:
    """Return whether SciPy would be faster for so many arcs, and is not installed."""
    return arcs >= _FEW and not has_scipy()


@cache
def has_scipy() -> bool:
    """Return whether SciPy can be imported; tried once."""
    try:
        _sparse()
    except ImportError:
        return False
    return True


def _sparse() -> Any:
    import scipy.sparse.csgraph

    return scipy.sparse
