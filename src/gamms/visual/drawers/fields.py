"""Drawer of a field of view: a faint area with a thin rim, cut off where the map is long over."""

from typing import Any

import numpy as np

from gamms.errors import BadValue
from gamms.ir.graph import FloatArray, GraphColumns, IntArray
from gamms.text import shown
from gamms.typing import IContext
from gamms.visual.color import Rgba, rgba
from gamms.visual.drawing import drawing_of

_SPILL = 0.2  # of the map's longer side: how far a field may reach beyond it, or else it would shrink the picture
_FILL_ALPHA, _RIM_ALPHA = 30, 130


def field_of_view(ctx: IContext, outline: Any, color: Any) -> None:
    """Fill `outline` (corners, 2) so that what lies below stays visible; a field that holds the whole map is none.

    Raises:
        BadValue: a corner that is no pair of finite numbers.
    """
    corners, box = np.asarray(outline, np.float64), drawing_of(ctx).of_map(_around_the_map)
    if corners.ndim != 2 or corners.shape[1] != 2 or not np.isfinite(corners).all():
        raise BadValue(f"The outline of a field of view is (x, y) pairs of finite numbers, not {shown(outline)}.")
    if box is not None:
        corners = cut(corners, *box)
    if len(corners) < 3:
        return
    goes_on = np.zeros(len(corners), bool) if box is None else _is_on_a_side(corners, *box)
    if goes_on.all():
        return
    visual, rim = drawing_of(ctx), _faint(color, _RIM_ALPHA)
    visual.render_polygon(corners.tolist(), _faint(color, _FILL_ALPHA))
    if goes_on.any():
        visual.render_lines(*_without(corners, goes_on), rim)
    else:
        visual.render_polygon(corners.tolist(), rim, 1)


def cut(corners: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """The part (corners, 2) of a polygon that is inside a box, by the algorithm of Sutherland and Hodgman."""
    if ((corners >= low) & (corners <= high)).all():  # as most are
        return corners
    for axis in (0, 1):
        corners = _cut_off(corners, axis, low[axis], -1.0)
        corners = _cut_off(corners, axis, high[axis], 1.0)
    return corners


def _cut_off(corners: FloatArray, axis: int, limit: float, side: float) -> FloatArray:
    """The part of a polygon that is not beyond a limit; `side` is 1.0 where larger is beyond, else -1.0."""
    beyond, following = side * (corners[:, axis] - limit), np.roll(corners, -1, axis=0)
    next_beyond = side * (following[:, axis] - limit)
    crosses = (beyond > 0.0) != (next_beyond > 0.0)
    share = np.divide(beyond, beyond - next_beyond, out=np.zeros(len(corners)), where=crosses)
    crossings = corners + share[:, None] * (following - corners)
    crossings[:, axis] = limit
    kept = np.column_stack([beyond <= 0.0, crosses]).ravel()
    both = np.stack([corners, crossings], axis=1).reshape(-1, 2)
    inside: FloatArray = both[kept]
    return inside


def _around_the_map(columns: GraphColumns) -> tuple[FloatArray, FloatArray] | None:
    """Lower left and upper right corner of the box that fields are cut to; None for a map without extent."""
    xy = columns.xy
    if len(xy) == 0:
        return None
    low, high = xy.min(axis=0), xy.max(axis=0)
    spill = _SPILL * float((high - low).max())
    return (low - spill, high + spill) if spill > 0.0 else None


def _is_on_a_side(corners: FloatArray, low: FloatArray, high: FloatArray) -> "np.ndarray[Any, np.dtype[np.bool_]]":
    """From which corners on the rim follows a side of the box: there the field goes on."""
    rim = np.stack([corners, np.roll(corners, -1, axis=0)])  # (2, corners, 2)  from corner to corner
    on_a_side: np.ndarray[Any, np.dtype[np.bool_]] = ((rim == low).all(axis=0) | (rim == high).all(axis=0)).any(axis=1)
    return on_a_side


def _without(corners: FloatArray, is_left_out: "np.ndarray[Any, np.dtype[np.bool_]]") -> tuple[FloatArray, IntArray]:
    """Points and offsets of what remains of a rim without some pieces, each named by the corner it begins at."""
    first = int(np.argmax(is_left_out)) + 1
    corners, is_left_out = np.roll(corners, -first, axis=0), np.roll(is_left_out, -first)
    counts = np.diff(np.flatnonzero(is_left_out) + 1, prepend=0)  # of corners from one gap to the next
    return corners[np.repeat(counts > 1, counts)], np.cumsum([0, *counts[counts > 1]])


def _faint(color: Any, alpha: int) -> Rgba:
    """The colour with our transparency, unless it brings more of its own."""
    red, green, blue, own = rgba(color)
    return red, green, blue, min(own, alpha)
