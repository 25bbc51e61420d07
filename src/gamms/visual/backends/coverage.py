"""Pixel coverage of shapes, for smooth edges at fractional positions and widths.

Pixel (column, row) is the square from (column, row) to (column + 1, row + 1); y is down. Coverage is 0 to 255.
"""

from itertools import pairwise
from typing import Any, NamedTuple, Protocol

import numpy as np

from gamms import kernels
from gamms.ir.graph import FloatArray, IntArray
from gamms.visual.camera import extent

ByteArray = np.ndarray[Any, np.dtype[np.uint8]]
SingleArray = np.ndarray[Any, np.dtype[np.float32]]
PixelArray = np.ndarray[Any, np.dtype[np.uint32]]  # (rows, columns)  blue, green, red and an unused byte

_FINER = 4  # sample lines per row of pixels for polygons
_AT_ONCE = 2_000_000  # pixels processed together, to limit memory


class PaintedFrame(Protocol):
    """A frame of a film."""

    def pixels(self) -> ByteArray:
        """Return red, green and blue as a new array (height, width, 3)."""

    def bgrx(self) -> PixelArray:
        """Return blue, green, red and an unused byte as an array (height, width): the fastest way to an encoder."""


class Patch(NamedTuple):
    """Coverage of a part of a picture, and the position of its upper left pixel."""

    coverage: ByteArray  # (rows, columns)
    left: int
    top: int


def disc(x: float, y: float, outer: float, inner: float, width: int, height: int) -> Patch | None:
    """Return a disc of radius `outer` px with a hole of radius `inner`, clipped to a picture; None if it is empty."""
    left = max(0, int(np.floor(x - outer - 1)))
    top = max(0, int(np.floor(y - outer - 1)))
    right = min(width, int(np.ceil(x + outer + 1)))
    bottom = min(height, int(np.ceil(y + outer + 1)))
    if left >= right or top >= bottom:
        return None
    across = np.arange(left, right) + 0.5 - x
    down = np.arange(top, bottom) + 0.5 - y
    distance = np.hypot(across, down[:, None])
    covered = np.clip(outer + 0.5 - distance, 0.0, 1.0)
    if inner > 0.0:
        covered -= np.clip(inner + 0.5 - distance, 0.0, 1.0)
    return Patch(np.rint(np.maximum(covered, 0.0) * 255.0).astype(np.uint8), left, top)


def strokes(starts: FloatArray, ends: FloatArray, width_px: float, width: int, height: int) -> Patch | None:
    """Return the coverage of lines with round ends, clipped to a picture; overlaps count once.

    Args:
        starts: (lines, 2), pixels.
        ends: (lines, 2), pixels.
        width_px: width of every line; lines thinner than a pixel become paler.
        width: width of the picture.
        height: height of the picture.
    """
    half = max(width_px, 1.0) / 2
    low, high = extent(starts, ends)
    low, high = np.floor(low - half - 1), np.ceil(high + half + 1)
    left, top = np.maximum(low, 0).astype(np.int64).tolist()
    right, bottom = np.minimum(high, (width, height)).astype(np.int64).tolist()
    if left >= right or top >= bottom:
        return None
    shift = np.array([left, top])
    patch = np.zeros((bottom - top, right - left), np.uint8)
    for part in _parts(np.abs(ends - starts).max(axis=1), half):
        _stroke(patch, (starts[part] - shift).astype(np.float32), (ends[part] - shift).astype(np.float32), half)
    if width_px < 1.0:
        patch = np.rint(patch * width_px).astype(np.uint8)
    return Patch(patch, left, top)


def broad_strokes(starts: FloatArray, ends: FloatArray, width_px: float, width: int, height: int) -> Patch:
    """Return the result of `strokes` for few lines of any width, at a cost independent of the width."""
    half = width_px / 2
    covered = np.zeros((height, width), np.uint8)
    for start, end in zip(starts, ends, strict=True):
        ahead = (end - start) / (float(np.hypot(*(end - start))) or 1.0) * half
        beside = ahead[::-1] * (-1, 1)
        body = np.array([start + beside, end + beside, end - beside, start - beside])
        pieces = (polygon(body, width, height), *(disc(x, y, half, 0.0, width, height) for x, y in (start, end)))
        for patch, left, top in filter(None, pieces):
            place = covered[top : top + patch.shape[0], left : left + patch.shape[1]]
            np.maximum(place, patch, out=place)
    return Patch(covered, 0, 0)


def polygon(points: FloatArray, width: int, height: int) -> Patch | None:
    """Return a filled polygon (corners, 2), clipped to a picture; by nonzero winding number."""
    return polygons(points, np.array([0, len(points)]), width, height)


def polygons(points: FloatArray, offsets: IntArray, width: int, height: int) -> Patch | None:
    """Return the coverage of filled polygons, clipped to a picture; overlaps count once.

    Args:
        points: (points, 2), pixels.
        offsets: (polygons + 1,)  polygon `i` is `points[offsets[i]:offsets[i + 1]]`.
        width: width of the picture.
        height: height of the picture.
    """
    left, top = np.maximum(np.floor(points.min(axis=0)), 0).astype(np.int64).tolist()
    right, bottom = np.minimum(np.ceil(points.max(axis=0)), (width, height)).astype(np.int64).tolist()
    if left >= right or top >= bottom:
        return None
    lines = (bottom - top) * _FINER
    line, x, turn = _crossings(points - (left, top), offsets, lines)
    order = np.lexsort((x, line))
    line = line[order] % lines
    x = np.clip(x[order], 0, right - left)
    turn = turn[order]
    after = np.cumsum(turn)  # winding number to the right of each crossing; 0 after each line
    step = ((after != 0).astype(np.float64) - (after - turn != 0)) / _FINER
    column = np.minimum(x.astype(np.int64), right - left - 1)
    beyond = x - column
    steps = np.zeros((bottom - top, right - left + 1))
    np.add.at(steps, (line // _FINER, column), step * (1 - beyond))
    np.add.at(steps, (line // _FINER, column + 1), step * beyond)
    covered = np.cumsum(steps[:, :-1], axis=1) * 255
    return Patch(np.rint(np.clip(covered, 0, 255)).astype(np.uint8), left, top)


def _crossings(points: FloatArray, offsets: IntArray, lines: int) -> tuple[IntArray, FloatArray, IntArray]:
    """Return the crossings of polygon sides and sample lines: line, x, and direction, downward (1) or upward (-1).

    The sample lines of each polygon have separate numbers, after those of the previous polygon.
    """
    following = np.arange(1, len(points) + 1)
    following[offsets[1:] - 1] = offsets[:-1]
    begin, end = points, points[following]
    turn = np.sign(end[:, 1] - begin[:, 1]).astype(np.int64)
    high = np.where((turn > 0)[:, None], begin, end)
    low = np.where((turn > 0)[:, None], end, begin)
    first = np.clip(np.ceil(high[:, 1] * _FINER - 0.5), 0, lines).astype(np.int64)
    last = np.clip(np.ceil(low[:, 1] * _FINER - 0.5), 0, lines).astype(np.int64)
    side, line = kernels.expand_ranges(first, last)
    share = ((line + 0.5) / _FINER - high[side, 1]) / (low[side, 1] - high[side, 1])
    polygon = np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))[side]
    return line + lines * polygon, high[side, 0] + share * (low[side, 0] - high[side, 0]), turn[side]


def _parts(lengths: FloatArray, half: float) -> list[slice]:
    """Return slices of lines with a limited number of pixels each."""
    pixels = np.cumsum((lengths + 2 * half + 3) * (3 * half + 5))
    cuts = np.searchsorted(pixels, np.arange(_AT_ONCE, float(pixels[-1]), _AT_ONCE)).tolist()
    borders = sorted({0, *cuts, len(lengths)})
    return [slice(begin, end) for begin, end in pairwise(borders)]


def _stroke(patch: ByteArray, starts: SingleArray, ends: SingleArray, half: float) -> None:
    """Write the maximum of a patch and of the coverage by lines (float32, in its pixels)."""
    is_steep = np.abs(ends - starts)[:, 1] > np.abs(ends - starts)[:, 0]
    for steep in (False, True):
        rows = is_steep == steep
        if rows.any():
            turned = slice(None, None, -1 if steep else 1)
            _flat_strokes(patch.T if steep else patch, starts[rows][:, turned], ends[rows][:, turned], half)


def _flat_strokes(patch: ByteArray, starts: SingleArray, ends: SingleArray, half: float) -> None:
    """Paint lines that are more horizontal than vertical, by columns of pixels around their middle."""
    back = starts[:, 0] > ends[:, 0]
    starts, ends = np.where(back[:, None], ends, starts), np.where(back[:, None], starts, ends)
    ways = ends - starts
    slopes = np.divide(ways[:, 1], ways[:, 0], out=np.zeros_like(ways[:, 0]), where=ways[:, 0] > 0)
    # The centers of covered pixels lie less than half a pixel beyond the line.
    first = np.maximum(np.ceil(starts[:, 0] - half - 1), 0).astype(np.int32)
    last = np.minimum(np.floor(ends[:, 0] + half) + 1, patch.shape[1]).astype(np.int32)
    counts = np.maximum(last - first, 0)
    line = np.repeat(np.arange(len(starts), dtype=np.int32), counts)
    column = np.arange(len(line), dtype=np.int32) - np.repeat(np.cumsum(counts) - counts - first, counts)
    across = column + np.float32(0.5) - starts[line, 0]
    middle = starts[line, 1] + slopes[line] * np.clip(across, 0, ways[line, 0])
    reach = (half + 0.5) * np.sqrt(1 + float((slopes * slopes).max(initial=0.0)))
    row = np.ceil(middle - reach - 0.5).astype(np.int32)[:, None] + np.arange(int(2 * reach) + 1, dtype=np.int32)
    down = row + np.float32(0.5) - starts[line, 1][:, None]
    covered = _nearness(across[:, None], down, ways[line], half)
    _keep_largest(patch, row, column, covered)


def _nearness(across: SingleArray, down: SingleArray, ways: SingleArray, half: float) -> Any:
    """Return the coverage, 0 to 1, by lines from the origin along `ways` (columns, 2), at (columns, rows) places."""
    squares = np.maximum((ways * ways).sum(axis=1), np.float32(1e-12))[:, None]
    along = np.clip((across * ways[:, :1] + down * ways[:, 1:]) / squares, 0, 1)
    beside = across - along * ways[:, :1]
    above = down - along * ways[:, 1:]
    return np.clip(np.float32(half + 0.5) - np.sqrt(beside * beside + above * above), 0, 1)


def _keep_largest(patch: ByteArray, row: IntArray, column: IntArray, covered: SingleArray) -> None:
    rows = patch.shape[0]
    places = np.nonzero((covered > 0) & (row >= 0) & (row < rows))
    value = np.rint(covered[places] * 255).astype(np.uint8)
    order = np.argsort(value, kind="stable")  # the last value written stays, so the largest comes last
    at = (row[places][order], column[places[0]][order])
    patch[at] = np.maximum(patch[at], value[order])
