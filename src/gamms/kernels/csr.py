"""Compressed sparse rows: group, and gather many groups at once."""

import numpy as np

from gamms.ir.graph import IntArray


def group_rows(keys: IntArray, groups: int) -> tuple[IntArray, IntArray]:
    """Group row numbers by key, in row order within a group.

    Args:
        keys: (rows,) the group of each row, in `range(groups)`.
        groups: how many groups there are.

    Returns:
        `offsets` (groups + 1,) and `rows` (rows,): group `g` is `rows[offsets[g]:offsets[g + 1]]`.
    """
    offsets = np.zeros(groups + 1, np.int64)
    np.cumsum(np.bincount(keys, minlength=groups), out=offsets[1:])
    return offsets, np.argsort(keys, kind="stable")


def ragged_rows(offsets: IntArray, rows: IntArray, groups: IntArray) -> IntArray:
    """Return the rows of several groups, concatenated in the order of `groups`."""
    first = offsets[groups]
    counts = offsets[groups + 1] - first
    ends = np.cumsum(counts)
    total = int(ends[-1]) if len(ends) else 0
    shift = np.repeat(first - ends + counts, counts)
    found: IntArray = rows[np.arange(total) + shift]
    return found


def chosen_runs(offsets: IntArray, chosen: IntArray) -> tuple[IntArray, IntArray]:
    """Return the positions in some runs, one run after the other, and the offsets that divide them.

    Args:
        offsets: (runs + 1,) run `i` is `offsets[i]:offsets[i + 1]`.
        chosen: rows of runs.
    """
    counts = offsets[chosen + 1] - offsets[chosen]
    ends = np.concatenate((np.zeros(1, np.int64), np.cumsum(counts)))
    return np.arange(ends[-1]) + np.repeat(offsets[chosen] - ends[:-1], counts), ends


def expand_ranges(first: IntArray, last: IntArray) -> tuple[IntArray, IntArray]:
    """Return the positions in several ranges, concatenated, and which range each is in.

    Args:
        first: (ranges,)
        last: (ranges,) one behind the last position; a range that ends before it begins is empty.
    """
    counts = np.maximum(last - first, 0)
    groups = np.repeat(np.arange(len(counts)), counts)
    ends = np.cumsum(counts)
    return groups, np.arange(len(groups)) + (first - ends + counts)[groups]
