"""A cell grid over points: rows near a place, at a cost that does not grow with the number of points."""

from math import floor
from typing import NamedTuple

import numpy as np

from gamms.ir.graph import FloatArray, IntArray
from gamms.kernels.csr import expand_ranges

_POINTS_PER_CELL = 4.0
_MOST_CELLS = 2**31 - 2  # per axis: two cell numbers share one 64-bit key
_FAR = 1e150  # coordinates beyond are as far away as this: their squares would overflow
_MOST_STRIPES = 512  # a disc that spans more rows of cells is answered by a scan
_MOST_PAIRS = 1 << 18  # that are compared at a time
_FEW_PAIRS = 1 << 10  # that are compared without cells


class CellIndex(NamedTuple):
    """Rows sorted by cell; cells are numbered row by row from the origin."""

    origin: tuple[float, float]
    size: float  # side of a cell, map units
    keys: IntArray  # (points,)  ascending
    rows: IntArray  # (points,)


def build_cells(xy: FloatArray) -> CellIndex:
    """Index points of shape (points, 2), finite.

    The cell size follows from the middle 90 % of the points, so that a few outliers do not spoil it.
    """
    if len(xy) == 0:
        empty = np.zeros(0, np.int64)
        return CellIndex((0.0, 0.0), 1.0, empty, empty)
    xy = np.clip(xy, -_FAR, _FAR)
    low, high = np.quantile(xy, [0.05, 0.95], axis=0)
    span = high - low
    area = float(span[0] * span[1])
    size = (area / len(xy) * _POINTS_PER_CELL) ** 0.5 if area > 0.0 else float(span.max()) / len(xy) * _POINTS_PER_CELL
    least = float(np.abs(xy).max()) * 1e-9  # smaller cells drown in rounding
    size = max(size, least) or 1.0
    origin = (float(xy[:, 0].min()), float(xy[:, 1].min()))
    keys = _key(_cell(xy[:, 0], origin[0], size), _cell(xy[:, 1], origin[1], size))
    order = np.argsort(keys, kind="stable")
    return CellIndex(origin, size, keys[order], order)


def candidate_rows(cells: CellIndex, x: float, y: float, d: float) -> IntArray | None:
    """Return rows of a superset of the points within `d` of (x, y); None when a scan of all points is cheaper."""
    return rows_between(cells, (x - d, y - d), (x + d, y + d))


def rows_between(cells: CellIndex, low: tuple[float, float], high: tuple[float, float]) -> IntArray | None:
    """Return rows of a superset of the points in a rectangle, its rim included; None when a scan of all is cheaper."""
    # A point on the rim must not fall out by rounding.
    rim = 1e-9 * (abs(low[0]) + abs(low[1]) + abs(high[0]) + abs(high[1]))
    if (max(high[0] - low[0], high[1] - low[1]) + 2.0 * rim) / cells.size > _MOST_STRIPES:
        return None
    low_x, low_y = (_cell_of(value - rim, start, cells.size) for value, start in zip(low, cells.origin, strict=True))
    high_x, high_y = (_cell_of(value + rim, start, cells.size) for value, start in zip(high, cells.origin, strict=True))
    stripes = np.arange(low_y, high_y + 1)
    first = np.searchsorted(cells.keys, _key(low_x, stripes), side="left")
    last = np.searchsorted(cells.keys, _key(high_x, stripes), side="right")
    return np.concatenate([cells.rows[a:b] for a, b in zip(first.tolist(), last.tolist(), strict=True)])


def pairs_within(a: FloatArray, b: FloatArray, limit: float) -> tuple[IntArray, IntArray, FloatArray]:
    """Find the pairs of points, one of each set, that are at most `limit` apart.

    Squares of distances are compared, (dx * dx + dy * dy) + dz * dz <= limit * limit in 64-bit floats: every machine
    finds the same pairs.

    Args:
        a: (points, 3), finite.
        b: (others, 3), finite.
        limit: not negative, may be infinite.

    Returns:
        `rows` of `a` and `others` of `b` (pairs,), by row, then by other row, and how far apart these are (pairs,).
    """
    first, last, order = _near_ranges(a, b, limit)
    rows, others, squares = list[IntArray](), list[IntArray](), list[FloatArray]()
    ends = np.cumsum((last - first).sum(axis=1))
    begin = 0
    while begin < len(a):
        before = int(ends[begin - 1]) if begin else 0
        end = max(begin + 1, int(np.searchsorted(ends, before + _MOST_PAIRS, side="right")))
        group, place = expand_ranges(first[begin:end].ravel(), last[begin:end].ravel())
        row, other = begin + group // first.shape[1], order[place]
        with np.errstate(over="ignore"):
            dx, dy, dz = (a[row] - b[other]).T
            square = dx * dx + dy * dy + dz * dz
            near = square <= limit * limit
        rows.append(row[near])
        others.append(other[near])
        squares.append(square[near])
        begin = end
    found = [np.concatenate([np.zeros(0, np.int64), *parts]) for parts in (rows, others)]
    sorting = np.lexsort(found[::-1])
    return found[0][sorting], found[1][sorting], np.sqrt(np.concatenate([np.zeros(0), *squares])[sorting])


def _near_ranges(a: FloatArray, b: FloatArray, limit: float) -> tuple[IntArray, IntArray, IntArray]:
    """Return the ranges of candidates (points, ranges), first and one behind the last, in an order of the others."""
    everything = np.arange(len(b))
    if len(a) * len(b) <= _FEW_PAIRS:
        return np.zeros((len(a), 1), np.int64), np.full((len(a), 1), len(b)), everything
    a, b = (np.clip(points[:, :2], -_FAR, _FAR) for points in (a, b))
    low = np.minimum(a.min(axis=0), b.min(axis=0))
    greatest = max(float(np.abs(a).max()), float(np.abs(b).max()))
    size = max(limit * (1.0 + 1e-9) + greatest * 1e-8, 1.0 / _FAR)  # smaller cells drown in rounding
    cells_a, cells_b = (np.floor((points - low) / size).astype(np.int64) + 1 for points in (a, b))
    keys = _key(cells_b[:, 0], cells_b[:, 1])
    order = np.argsort(keys, kind="stable")
    keys = keys[order]
    stripes = cells_a[:, 1, None] + np.array([-1, 0, 1])
    columns = cells_a[:, 0, None]
    first = np.searchsorted(keys, _key(columns - 1, stripes), side="left")
    last = np.searchsorted(keys, _key(columns + 1, stripes), side="right")
    return first, last, order


def _cell_of(value: float, origin: float, size: float) -> int:
    """As `_cell`, of one number, which may be anything but NaN."""
    # NOTE: twenty times faster than NumPy is for one number; sight lines ask for few faces each.
    place = (min(max(value, -_FAR), _FAR) - origin) / size
    return floor(min(max(place, -1.0), _MOST_CELLS)) + 1


def _cell(values: FloatArray, origin: float, size: float) -> IntArray:
    return np.clip(np.floor((values - origin) / size), -1, _MOST_CELLS).astype(np.int64) + 1


def _key(column: IntArray | int, stripe: IntArray) -> IntArray:
    return (stripe << 32) | column
