"""Shortest paths: distances along edges, and the next step on the way; by SciPy where it is installed.

Of the whole graph, by Dijkstra's algorithm, in arrays; `local_paths.py` has those of nodes near each other.
Matchings of least cost are found by shortest augmenting paths.
"""

from collections.abc import Iterable
from functools import cache
from heapq import heapify, heappop, heappush
from itertools import groupby
from math import inf
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np

from gamms.ir.graph import FloatArray, IntArray
from gamms.kernels.csr import chosen_runs

_FEW = 1000  # arcs: below, a heap in Python is done before SciPy has checked its arguments
_FEW_TIES = 1 << 10  # arcs that end paths of equal length: of so few, the paths are followed one by one


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
    starts = _starts(arcs)
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
    starts = _starts(tight)
    is_step = hops[starts] + 1.0 == hops[tight.ends]
    starts, ends = starts[is_step], tight.ends[is_step]
    order = np.lexsort((-ids[starts], ends))  # of several, the last one written stays: the least id
    steps = np.full(len(ids), -1, np.int64)
    steps[ends[order]] = starts[order]
    return steps


class Reached(NamedTuple):
    """The nodes that can be reached from several starts: entries by start, then by row."""

    lines: IntArray  # (entries,)  numbers of starts
    rows: IntArray  # (entries,)  of nodes
    far: FloatArray  # (entries,)  distances from the start


class Trees(NamedTuple):
    """The same, with the shortest paths."""

    lines: IntArray
    rows: IntArray
    far: FloatArray
    arcs: IntArray  # (entries,)  the last arc on the path; -1 at the start itself


def route_trees(arcs: Arcs, roots: IntArray, ids: IntArray, cutoff: float = inf) -> Trees:
    """Return what `heap_distances` and `first_steps` say of several starts, all at once.

    On reversed arcs these are the distances to the roots, and the first arcs on the ways there.

    Args:
        arcs: the ways.
        roots: (roots,) rows, each once.
        ids: (nodes,) different numbers.
        cutoff: what is farther away than this counts as out of reach.
    """
    reached = reached_from(arcs, roots, len(ids), cutoff)
    return Trees(*reached, last_arcs(arcs, roots, ids, reached))


def reached_from(arcs: Arcs, roots: IntArray, nodes: int, cutoff: float = inf) -> Reached:
    """Return what `route_trees` returns, without the paths: half of its time or less.

    Args:
        arcs: the ways.
        roots: (roots,) rows, each once.
        nodes: how many rows there are.
        cutoff: as there.
    """
    if len(arcs.ends) < _FEW or not len(roots) or not has_scipy():
        distances = np.array([heap_distances(arcs, root, cutoff) for root in roots[:, None]]).reshape(-1, nodes)
    else:
        distances = _sparse().csgraph.dijkstra(_matrix(arcs), indices=roots, limit=cutoff)
    flat = distances.reshape(-1)
    near = np.flatnonzero(flat < inf)
    lines = near // max(nodes, 1)
    return Reached(lines, near - lines * nodes, flat[near])


def last_arcs(arcs: Arcs, roots: IntArray, ids: IntArray, reached: Reached) -> IntArray:
    """Return the last arcs on the shortest paths, (entries,) those of `Trees`.

    Args:
        arcs: the ways.
        roots: (roots,) rows, each once.
        ids: (nodes,) different numbers.
        reached: what `reached_from` returns of the roots.
    """
    nodes = len(ids)
    lines, rows, far = reached
    trees = len(roots)
    begins = np.arange(trees) * nodes + roots
    near = lines * nodes + rows
    flat = np.full(trees * nodes, inf)
    flat[near] = far
    used, runs = chosen_runs(arcs.offsets, rows)
    # The arcs of all roots side by side, as if each had a graph of its own, in which rows are `before` and `after`.
    starts = _starts(arcs)
    before = np.repeat(near, np.diff(runs))
    after = before + (arcs.ends - starts)[used]
    tight = np.flatnonzero(flat[before] + arcs.weights[used] == flat[after])
    before, after, used = before[tight], after[tight], used[tight]
    last: IntArray = np.full(len(flat), -1, np.int64)
    last[after] = used
    last[begins] = -1
    counts = np.bincount(after, minlength=len(flat))
    counts[begins] = 0
    among = np.flatnonzero(counts[after] > 1)
    if len(among) > _FEW_TIES or (len(among) and not arcs.weights.all()):
        tied = np.zeros(trees, np.bool_)
        tied[after[among] // nodes] = True
        some = tied[before // nodes]
        hops = _fewest_arcs(before[some], after[some], begins[tied[begins // nodes]], len(flat))
        best = among[hops[before[among]] + 1 == hops[after[among]]]
        best = best[np.argsort(-ids[starts[used[best]]], kind="stable")]  # the last one written stays: the least id
        last[after[best]] = used[best]
    elif len(among):
        among = among[np.lexsort((after[among], flat[after[among]]))]
        ties = zip(after[among].tolist(), ids[starts[used[among]]].tolist(), used[among].tolist(), strict=True)
        _break_ties(last, (starts - arcs.ends).data, begins, ties)
    found: IntArray = last[near]
    return found


def _break_ties(last: IntArray, back: memoryview, begins: IntArray, ties: Iterable[tuple[int, int, int]]) -> None:
    """Write the best last arcs to nodes to which there are several: the fewest arcs from the start, then the least id.

    Args:
        last: (nodes,) the last arc on the path to each node, right for those that are nearer than all ties.
        back: (arcs,) how far the row of the start of an arc is from that of its end.
        begins: rows, to which no arc leads.
        ties: nodes, ids and rows of arcs, by the distance of the node; those of one node follow each other.
    """
    hops = dict.fromkeys(begins.tolist(), 0)
    for node, group in groupby(ties, key=itemgetter(0)):
        options = []
        for _, id, arc in group:
            row, path = node + back[arc], list[int]()
            while row not in hops:
                path.append(row)
                row += back[last[row]]
            for count, passed in enumerate(reversed(path), hops[row] + 1):
                hops[passed] = count
            options.append((hops[node + back[arc]] + 1, id, arc))
        hops[node], _, last[node] = min(options)


def route_tables(arcs: Arcs, roots: IntArray, ids: IntArray, cutoff: float = inf) -> tuple[FloatArray, IntArray]:
    """Return what `route_trees` returns as distances (roots, nodes), infinite where there is no path, and as rows.

    The rows (roots, nodes) are those of the nodes before on the paths, -1 for the roots and where there is no path.
    """
    found, shape = route_trees(arcs, roots, ids, cutoff), (len(roots), len(ids))
    distances: FloatArray = np.full(shape, inf)
    steps: IntArray = np.full(shape, -1, np.int32)  # half the memory
    distances[found.lines, found.rows] = found.far
    is_led = found.arcs >= 0
    steps[found.lines[is_led], found.rows[is_led]] = _starts(arcs)[found.arcs[is_led]]
    return distances, steps


def _starts(arcs: Arcs) -> IntArray:
    """Return the row that each arc leads from."""
    return np.repeat(np.arange(len(arcs.offsets) - 1), np.diff(arcs.offsets))


def _fewest_arcs(starts: IntArray, ends: IntArray, begins: IntArray, nodes: int) -> IntArray:
    """Return how many arcs lead to each node from the nearest of some nodes, (nodes,); -1 where none lead.

    Args:
        starts: (arcs,) rows, ascending.
        ends: (arcs,)
        begins: rows.
        nodes: how many there are.
    """
    offsets = np.concatenate((np.zeros(1, np.int64), np.cumsum(np.bincount(starts, minlength=nodes))))
    hops, reached, count = np.full(nodes, -1), begins, 0
    while len(reached):
        hops[reached] = count
        arcs, _ = chosen_runs(offsets, reached)
        following = ends[arcs]
        following = following[hops[following] < 0]
        count += 1
        hops[following] = count
        reached = np.unique(following)
    return hops


def shortest_distances(arcs: Arcs, rows: IntArray, cutoff: float = inf) -> FloatArray:
    """Return what `heap_distances` returns; by SciPy where it is installed and faster."""
    if len(arcs.ends) < _FEW or len(rows) == 0 or not has_scipy():
        return heap_distances(arcs, rows, cutoff)
    return scipy_distances(arcs, rows, cutoff)


def scipy_distances(arcs: Arcs, rows: IntArray, cutoff: float = inf) -> FloatArray:
    """Return what `heap_distances` returns: Dijkstra with a Fibonacci heap, in C; `rows` must not be empty."""
    found: FloatArray = _sparse().csgraph.dijkstra(_matrix(arcs), indices=np.unique(rows), min_only=True, limit=cutoff)
    return found


def least_matching(costs: FloatArray) -> list[int]:
    """Return for each row a column of its own, so that the sum of the costs is least.

    The Hungarian method by shortest augmenting paths (Jonker, Volgenant: A shortest augmenting path algorithm for
    dense and sparse linear assignment problems, 1987). Of equally good matchings it gives always the same, unlike
    different versions of SciPy.

    Args:
        costs: (rows, columns), with as many columns as rows at least; infinite where both must not be matched, which
            is done all the same where nothing else is left.
    """
    table = costs.copy()
    table[np.isinf(table)] = 2.0 * table[np.isfinite(table)].sum() + 1.0
    rows, columns = table.shape
    row_of, prices, gains = np.full(columns, -1), np.zeros(columns), np.zeros(rows)
    for start in range(rows):
        row, distances, before = start, np.full(columns, inf), np.full(columns, -1)
        column, is_done, passed = -1, np.zeros(columns, np.bool_), 0.0
        while row >= 0:  # until a column is found that has no row yet
            offers = np.where(is_done, inf, passed + table[row] - gains[row] - prices)
            is_less = offers < distances
            distances[is_less], before[is_less] = offers[is_less], column
            column = int(np.argmin(np.where(is_done, inf, distances)))
            passed, is_done[column], row = float(distances[column]), True, int(row_of[column])
        tried = is_done & (row_of >= 0)
        gains[row_of[tried]] += passed - distances[tried]
        gains[start] += passed
        prices[is_done] += distances[is_done] - passed
        while column >= 0:
            previous = int(before[column])
            row_of[column] = start if previous < 0 else row_of[previous]
            column = previous
    found = {int(row): column for column, row in enumerate(row_of.tolist()) if row >= 0}
    return [found[row] for row in range(rows)]


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


def _matrix(arcs: Arcs) -> Any:
    """Return arcs as a sparse matrix."""
    nodes = len(arcs.offsets) - 1
    # Given as rows, not as a list of triples: so explicit zeros stay edges, and nothing is added up.
    parts = arcs.weights, arcs.ends.astype(np.int32), arcs.offsets.astype(np.int32)
    return _sparse().csr_array(parts, (nodes, nodes))


def _sparse() -> Any:
    import scipy.sparse.csgraph

    return scipy.sparse
