"""Runs of rows: group and gather compressed sparse rows, and find closed rings in sequences of lines."""

from typing import Any

import numpy as np

from gamms.ir.graph import FloatArray, IntArray


def group_rows(keys: IntArray, groups: int) -> tuple[IntArray, IntArray]:
    """Group row numbers by key, in row order within a group.

    Args:
        keys: (rows,) the group of each row, in `range(groups)`.
        groups: the number of groups.

    Returns:
        `offsets` (groups + 1,) and `rows` (rows,): group `g` is `rows[offsets[g]:offsets[g + 1]]`.
    """
    offsets = np.zeros(groups + 1, np.int64)
    np.cumsum(np.bincount(keys, minlength=groups), out=offsets[1:])
    return offsets, np.argsort(keys, kind="stable")


def group_by_target(sources: IntArray, targets: IntArray, weights: FloatArray, size: int) -> tuple[Any, Any, Any]:
    """Group weighted arcs by target row, in the order of their sources; see `gamms.core.belief.IncomingArcs`.

    Args:
        sources: (arcs,) rows.
        targets: (arcs,) rows.
        weights: (arcs,)
        size: the number of rows.

    Returns:
        Buffers of `first` (size + 1,), and of the sources and weights (arcs,): the arcs into row `i` are at
        `first[i]:first[i + 1]`.
    """
    order = np.lexsort((sources, targets))
    first, _ = group_rows(targets, size)
    return as_buffer(first.astype(np.int32)), as_buffer(sources[order].astype(np.int32)), as_buffer(weights[order])


def as_buffer(values: "np.ndarray[Any, Any]") -> Any:  # NumPy types all its buffers as integers
    """Return an array as a contiguous buffer for `gamms.core`; copies it only if needed."""
    return np.ascontiguousarray(values).reshape(-1).data


def select_runs(offsets: IntArray, chosen: IntArray) -> tuple[IntArray, IntArray]:
    """Return the positions in the chosen runs, one run after the other, and the offsets between them.

    Args:
        offsets: (runs + 1,) run `i` is `offsets[i]:offsets[i + 1]`.
        chosen: indices of runs.
    """
    counts = offsets[chosen + 1] - offsets[chosen]
    ends = np.concatenate((np.zeros(1, np.int64), np.cumsum(counts)))
    return np.arange(ends[-1]) + np.repeat(offsets[chosen] - ends[:-1], counts), ends


def find_rows(ids: IntArray, wanted: IntArray, order: IntArray | None = None) -> IntArray:
    """Return the row of each wanted id, -1 for unknown ids.

    Args:
        ids: (rows,) if ids repeat, the first row is used.
        wanted: ids, of any shape.
        order: (rows,) the rows sorted by id; None: the ids are sorted.
    """
    if not len(ids):
        return np.full(wanted.shape, -1)
    places = np.minimum(np.searchsorted(ids, wanted, sorter=order), len(ids) - 1)
    rows = places if order is None else order[places]
    return np.where(ids[rows] == wanted, rows, -1)


def number_by_appearance(keys: IntArray) -> tuple[IntArray, IntArray]:
    """Number the distinct keys 0, 1, … in the order of first appearance.

    Returns:
        `numbers` (keys,), the number of each key; `firsts` (distinct,), the position where each number first appears.
    """
    _, firsts, inverse = np.unique(keys, return_index=True, return_inverse=True)
    order = np.argsort(firsts)
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(len(order))
    return rank[inverse], firsts[order]


def list_neighborhoods(sources: IntArray, targets: IntArray, nodes: int) -> tuple[IntArray, IntArray]:
    """Return the node itself and its distinct out-neighbors in edge order, for each node.

    Args:
        sources: (edges,) source node of each edge.
        targets: (edges,) target node of each edge.
        nodes: the number of nodes.

    Returns:
        `offsets` (nodes + 1,) and `rows`: the neighbors of node `i` are `rows[offsets[i]:offsets[i + 1]]`.
    """
    own = np.arange(nodes)
    starts = np.concatenate((own, sources))
    ends = np.concatenate((own, targets))
    _, first = np.unique(starts * nodes + ends, return_index=True)
    kept = np.sort(first)  # the node itself, then its edges in order
    offsets, order = group_rows(starts[kept], nodes)
    return offsets, ends[kept][order]


def expand_ranges(first: IntArray, last: IntArray) -> tuple[IntArray, IntArray]:
    """Return the positions in several ranges, concatenated, and the index of the range of each position.

    Args:
        first: (ranges,)
        last: (ranges,) one past the last position; a range that ends before it begins is empty.
    """
    counts = np.maximum(last - first, 0)
    groups = np.repeat(np.arange(len(counts)), counts)
    ends = np.cumsum(counts)
    return groups, np.arange(len(groups)) + (first - ends + counts)[groups]


def find_equal_runs(*columns: "np.ndarray[Any, np.dtype[Any]]") -> IntArray:
    """Return the offsets (runs + 1,) of consecutive rows that are equal in all columns, each (rows,)."""
    count = len(columns[0])
    is_first = np.ones(count, np.bool_)
    is_first[1:] = np.any([column[1:] != column[:-1] for column in columns], axis=0)
    return np.append(np.flatnonzero(is_first), count)


_FEWEST = 3  # lines of a closed ring


def find_closed_rings(starts: FloatArray, ends: FloatArray) -> IntArray:
    """Return (first row, last row + 1), (rings, 2), of consecutive lines that end where they began.

    A line belongs to at most one ring; of rings that share lines, the one that closes first is used.

    Args:
        starts: (lines, axes)
        ends: (lines, axes)  equal to the start of the next line if the lines are connected
    """
    count = len(starts)
    if count < _FEWEST:
        return np.zeros((0, 2), np.int64)
    place = _number_points(np.concatenate((starts, ends)))
    begins = place[:count]
    finishes = place[count:]
    rows = np.arange(count)
    chain = np.cumsum(np.concatenate(([0], finishes[:-1] != begins[1:])))
    # The latest line, up to each line, that begins where this line ends.
    by_place = np.argsort(begins, kind="stable")
    at = np.searchsorted(begins[by_place] * count + by_place, finishes * count + rows, side="right") - 1
    first = by_place[at]
    closes = (begins[first] == finishes) & (chain[first] == chain) & (rows - first + 1 >= _FEWEST)
    rings: list[tuple[int, int]] = []
    for row, begin in zip(rows[closes].tolist(), first[closes].tolist(), strict=True):
        if not rings or begin >= rings[-1][1]:
            rings.append((begin, row + 1))
    return np.array(rings, np.int64).reshape(-1, 2)


def _number_points(points: FloatArray) -> IntArray:
    """Return numbers (points,) that are equal for equal points."""
    # NOTE: axis by axis, in a fifth of the time of `np.unique(..., axis=0)` (the buildings of a city).
    place = np.zeros(len(points), np.int64)
    for axis in points.T:
        values, row = np.unique(axis, return_inverse=True)
        _, place = np.unique(place * len(values) + row, return_inverse=True)
    return place
