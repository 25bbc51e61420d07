"""Pixel coverage of shapes, for smooth edges at fractional positions and widths.

Pixel (column, row) is the square from (column, row) to (column + 1, row + 1); y is down. Coverage is 0 to 255.
"""

from typing import Any, NamedTuple, Protocol

import numpy as np

from gamms import kernels
from gamms.ir.graph import FloatArray, IntArray

ByteArray = np.ndarray[Any, np.dtype[np.uint8]]
PixelArray = np.ndarray[Any, np.dtype[np.uint32]]  # (rows, columns)  blue, green, red and an unused byte

_FINER = 4  # sample lines per row of pixels
_AT_ONCE = 20_000  # lines filled together, to limit memory
_CORNER_PX = 4.0  # maximum distance between the corners of round ends


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
    low = np.minimum(starts, ends).min(axis=0) - half
    high = np.maximum(starts, ends).max(axis=0) + half
    patch = _empty_patch(low, high, width, height)
    if patch is None:
        return None
    for begin in range(0, len(starts), _AT_ONCE):
        part = slice(begin, begin + _AT_ONCE)
        corners = _outlines(starts[part], ends[part], half)
        offsets = np.arange(len(corners) + 1) * corners.shape[1]
        _fill(patch, corners.reshape(-1, 2), offsets, np.zeros(len(corners), np.int64))
    if width_px < 1.0:
        return patch._replace(coverage=np.rint(patch.coverage * width_px).astype(np.uint8))
    return patch


def _outlines(starts: FloatArray, ends: FloatArray, half: float) -> FloatArray:
    """Return the outlines (lines, corners, 2) of lines with round ends and half a width, all in one direction."""
    ways = ends - starts
    headings = np.arctan2(ways[:, 1], ways[:, 0])
    corners = 2 + int(np.pi * half / _CORNER_PX) + 2 * (half > 1.0)
    turns = np.linspace(np.pi / 2, 3 * np.pi / 2, corners)
    angles = headings[:, None] + np.concatenate([turns, turns + np.pi])
    middles = np.repeat(np.stack([starts, ends], axis=1), corners, axis=1)
    return middles + half * np.stack([np.cos(angles), np.sin(angles)], axis=2)


def polygons(points: FloatArray, offsets: IntArray, width: int, height: int) -> Patch | None:
    """Return the coverage of filled polygons, by nonzero winding number, clipped to a picture; overlaps count once.

    Args:
        points: (points, 2), pixels.
        offsets: (polygons + 1,)  polygon `i` is `points[offsets[i]:offsets[i + 1]]`.
        width: width of the picture.
        height: height of the picture.
    """
    patch = _empty_patch(points.min(axis=0), points.max(axis=0), width, height)
    if patch is not None:
        _fill(patch, points, offsets, np.arange(len(offsets) - 1))
    return patch


def _empty_patch(low: FloatArray, high: FloatArray, width: int, height: int) -> Patch | None:
    """Return a patch from corner to corner, clipped to a picture; None if it is outside."""
    left, top = np.maximum(np.floor(low), 0).astype(np.int64).tolist()
    right, bottom = np.minimum(np.ceil(high), (width, height)).astype(np.int64).tolist()
    if left >= right or top >= bottom:
        return None
    return Patch(np.zeros((bottom - top, right - left), np.uint8), left, top)


def _fill(patch: Patch, points: FloatArray, offsets: IntArray, groups: IntArray) -> None:
    """Add the coverage of polygons to a patch; winding numbers are counted in each of `groups` (polygons,)."""
    rows, columns = patch.coverage.shape
    first = np.repeat(groups * rows * _FINER, np.diff(offsets))
    place, turn = _crossings(points - (patch.left, patch.top), offsets, first, rows * _FINER, columns + 1)
    order = np.argsort(place)
    place = place[order]
    turn = turn[order]
    after = np.cumsum(turn)  # winding number to the right of each crossing; 0 after each line
    is_side = (after == 0) | (after == turn)
    step = np.where(after[is_side] == 0, -1.0, 1.0) / _FINER
    line, x = np.divmod(place[is_side], columns + 1)
    column = np.minimum(x.astype(np.int64), columns - 1)
    beyond = x - column
    pixel = line.astype(np.int64) % (rows * _FINER) // _FINER * (columns + 1) + column
    steps = np.zeros(rows * (columns + 1))
    steps += np.bincount(pixel, step * (1 - beyond), len(steps))
    steps += np.bincount(pixel + 1, step * beyond, len(steps))
    covered = np.cumsum(steps.reshape(rows, -1)[:, :-1], axis=1) * 255
    np.maximum(patch.coverage, np.rint(np.clip(covered, 0, 255)).astype(np.uint8), out=patch.coverage)


def _crossings(
    points: FloatArray, offsets: IntArray, first: IntArray, lines: int, length: int
) -> tuple[FloatArray, IntArray]:
    """Return the crossings of polygon sides and sample lines: place, and direction, downward (1) or upward (-1).

    The place is x plus the length of all earlier lines; `first` (points,) is the first line of the group of each side.
    """
    following = np.arange(1, len(points) + 1)
    following[offsets[1:] - 1] = offsets[:-1]
    begin = points
    end = points[following]
    turn = np.sign(end[:, 1] - begin[:, 1]).astype(np.int64)
    is_down = (turn > 0)[:, None]
    high = np.where(is_down, begin, end)
    low = np.where(is_down, end, begin)
    top = np.clip(np.ceil(high[:, 1] * _FINER - 0.5), 0, lines).astype(np.int64)
    bottom = np.clip(np.ceil(low[:, 1] * _FINER - 0.5), 0, lines).astype(np.int64)
    side, line = kernels.expand_ranges(top, bottom)
    with np.errstate(all="ignore"):  # level sides cross no line
        slope = (low[:, 0] - high[:, 0]) / (low[:, 1] - high[:, 1])
    x = high[side, 0] + ((line + 0.5) / _FINER - high[side, 1]) * slope[side]
    return (line + first[side]) * length + np.clip(x, 0.0, length - 1.0), turn[side]
