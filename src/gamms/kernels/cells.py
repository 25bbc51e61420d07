"""A cell grid over points: finds rows near a place in time independent of the number of points."""

from bisect import bisect_left, bisect_right
from collections.abc import Iterator
from math import floor
from typing import NamedTuple

import numpy as np

from gamms.ir.graph import FloatArray, IntArray
from gamms.kernels.csr import expand_ranges

_POINTS_PER_CELL = 4.0
_MOST_CELLS = 2**31 - 2  # per axis: two cell numbers share one 64-bit key
_FAR = 1e150  # coordinates beyond this are clipped: their squares would overflow
_MOST_STRIPES = 512  # a disc that spans more rows of cells is answered by a scan
_MOST_CANDIDATES = 1 << 15  # candidates that are written out at a time, small enough for CPU caches


class CellIndex(NamedTuple):
    """Rows sorted by cell; cells are numbered row by row from the origin."""

    origin: tuple[float, float]
    size: float  # side of a cell, map units
    keys: IntArray  # (points,)  cell keys, ascending
    rows: IntArray  # (points,)


def build_cells(xy: FloatArray) -> CellIndex:
    """Build an index of finite points (points, 2).

    The cell size is chosen from the middle 90 % of the points, so that outliers have no effect.
    """
    if len(xy) == 0:
        empty = np.zeros(0, np.int64)
        return CellIndex((0.0, 0.0), 1.0, empty, empty)
    xy = np.clip(xy, -_FAR, _FAR)
    low, high = np.quantile(xy, [0.05, 0.95], axis=0)
    span = high - low
    area = float(span[0] * span[1])
    size = (area / len(xy) * _POINTS_PER_CELL) ** 0.5 if area > 0.0 else float(span.max()) / len(xy) * _POINTS_PER_CELL
    least = float(np.abs(xy).max()) * 1e-9  # smaller cells would be below rounding errors
    size = max(size, least) or 1.0
    origin = (float(xy[:, 0].min()), float(xy[:, 1].min()))
    keys = _make_key(_find_cells(xy[:, 0], origin[0], size), _find_cells(xy[:, 1], origin[1], size))
    order = np.argsort(keys, kind="stable")
    return CellIndex(origin, size, keys[order], order)


def find_rows_around(cells: CellIndex, x: float, y: float, reach: int) -> list[int]:
    """Return the rows of the points in the cell of (x, y) and in the cells around it."""
    keys = cells.keys.data
    found = list[int]()
    column = _find_cell_of_number(x, cells.origin[0], cells.size)
    stripe = _find_cell_of_number(y, cells.origin[1], cells.size)
    for middle in range(((stripe - reach) << 32) + column, (stripe + reach + 1) << 32, 1 << 32):
        first = bisect_left(keys, middle - reach)
        found += cells.rows[first : bisect_right(keys, middle + reach, first)].tolist()
    return found


def find_candidate_rows(cells: CellIndex, x: float, y: float, d: float) -> IntArray | None:
    """Return the rows of a superset of the points within `d` of (x, y); None if a scan of all points is cheaper."""
    return find_rows_between(cells, (x - d, y - d), (x + d, y + d))


def find_rows_between(cells: CellIndex, low: tuple[float, float], high: tuple[float, float]) -> IntArray | None:
    """Return the rows of a superset of the points in a closed rectangle; None if a scan of all points is cheaper."""
    # Rounding must not exclude a point on the border.
    rim = 1e-9 * max(map(abs, (*low, *high)))
    if (max(high[0] - low[0], high[1] - low[1]) + 2.0 * rim) / cells.size > _MOST_STRIPES:
        return None
    low_x, low_y = (
        _find_cell_of_number(value - rim, start, cells.size) for value, start in zip(low, cells.origin, strict=True)
    )
    high_x, high_y = (
        _find_cell_of_number(value + rim, start, cells.size) for value, start in zip(high, cells.origin, strict=True)
    )
    stripes = np.arange(low_y, high_y + 1)
    first = np.searchsorted(cells.keys, _make_key(low_x, stripes), side="left")
    last = np.searchsorted(cells.keys, _make_key(high_x, stripes), side="right")
    return np.concatenate([cells.rows[a:b] for a, b in zip(first.tolist(), last.tolist(), strict=True)])


def find_candidates_of_each(
    cells: CellIndex, x: FloatArray, y: FloatArray, d: float
) -> Iterator[tuple[int, int, IntArray, IntArray]] | None:
    """Find a superset of the points within `d` of each of several places, in chunks of places.

    Returns:
        For each chunk: its first place, one past its last place, and pairs of a place, counted from the first of the
        chunk, ascending, and the row of a point. None if scans of all points are cheaper.
    """
    # Rounding must not exclude a point on the border.
    reach = d + 1e-9 * (float(max(np.abs(x).max(initial=0.0), np.abs(y).max(initial=0.0))) + d)
    if 2.0 * reach / cells.size > _MOST_STRIPES:
        return None
    low_x, high_x = (_find_cells(edge, cells.origin[0], cells.size)[:, None] for edge in (x - reach, x + reach))
    low_y, high_y = (_find_cells(edge, cells.origin[1], cells.size) for edge in (y - reach, y + reach))
    stripes = low_y[:, None] + np.arange(int((high_y - low_y).max(initial=0)) + 1)
    first = np.searchsorted(cells.keys, _make_key(low_x, stripes), side="left")
    last = np.searchsorted(cells.keys, _make_key(high_x, stripes), side="right")
    return _expand_ranges(cells.rows, first, last)


def _expand_ranges(rows: IntArray, first: IntArray, last: IntArray) -> Iterator[tuple[int, int, IntArray, IntArray]]:
    """Write out the ranges (places, ranges) of each place; see `find_candidates_of_each`."""
    ends = np.cumsum((last - first).sum(axis=1))
    begin = 0
    while begin < len(first):
        before = int(ends[begin - 1]) if begin else 0
        end = max(begin + 1, int(np.searchsorted(ends, before + _MOST_CANDIDATES, side="right")))
        ranges, positions = expand_ranges(first[begin:end].ravel(), last[begin:end].ravel())
        yield begin, end, ranges // first.shape[1], rows[positions]
        begin = end


def _find_cell_of_number(value: float, origin: float, size: float) -> int:
    """Return `_find_cells` of one number, which may be anything except NaN."""
    # NOTE: twenty times faster than NumPy for one number; sight lines ask for few faces each.
    place = (min(max(value, -_FAR), _FAR) - origin) / size
    return floor(min(max(place, -1.0), _MOST_CELLS)) + 1


def _find_cells(values: FloatArray, origin: float, size: float) -> IntArray:
    return np.clip(np.floor((values - origin) / size), -1, _MOST_CELLS).astype(np.int64) + 1


def _make_key(column: IntArray | int, stripe: IntArray) -> IntArray:
    return (stripe << 32) | column
