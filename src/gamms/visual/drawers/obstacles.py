"""Drawer of obstacles: the top edge of each face as a line in the colour of its type, or buildings as filled areas."""

from typing import Any

import numpy as np

from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray, ObstacleColumns
from gamms.ir.palette import COLOR_TYPES, OTHER_OBSTACLE
from gamms.typing import IContext
from gamms.visual.appearance import WallTones
from gamms.visual.color import Rgb, Rgba, rgba
from gamms.visual.drawing import Drawing, drawing_of
from gamms.visual.footprints import Footprints, footprints

_STEPS = 6  # tones that are told apart
_LOWEST, _TALLEST = 5.0, 95.0  # percentiles of heights: between them the tones change
_SHADE = 0.75  # of the colour of an area: its outline


def render_obstacles(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw all obstacles.

    `data`: `color_map` (type -> colour), `boundary_thickness` (world units); `fill` (bool): whether buildings are
    filled, in the colour of their type or, where the map has none, in a tone that says how high they are; `tones`,
    a WallTones, instead of the usual ones.

    Faces of one type are drawn at once, the types in the order of their first face.
    """
    columns = ctx.graph.obstacle_columns()
    visual, thickness = drawing_of(ctx), data.get("boundary_thickness", 1.0)
    if data.get("fill"):
        _draw_buildings(ctx, columns, data.get("color_map", {}), thickness, data.get("tones") or visual.wall_tones)
        return
    colors: dict[int, Any] = {**COLOR_TYPES, **data.get("color_map", {})}
    types, first = np.unique(columns.types, return_index=True)
    for type in types[np.argsort(first)].tolist():
        _draw_tops(visual, columns, columns.types == type, colors.get(type, OTHER_OBSTACLE), thickness)


def _draw_tops(visual: Drawing, columns: ObstacleColumns, chosen: BoolArray, color: Any, thickness: float) -> None:
    tops = columns.corners[chosen, 1::-1, :2]  # from top left to top right
    if len(tops):
        offsets = np.arange(0, 2 * len(tops) + 1, 2)
        visual.render_lines(tops.reshape(-1, 2), offsets, color, thickness, in_world=True)


# -- filled -----------------------------------------------------------------------------------------------------


def _draw_buildings(
    ctx: IContext, columns: ObstacleColumns, colors: dict[int, Any], thickness: float, tones: WallTones
) -> None:
    """Fill what closes, the highest last; then draw all top edges."""
    visual, built = drawing_of(ctx), footprints(columns)
    is_filled = ~_is_fence(ctx, built)
    own, step = np.isin(built.types, list(colors)), _steps(built.heights)
    for number in range(_STEPS):
        tone = _between(tones.low, tones.high, number / (_STEPS - 1))
        _fill(visual, built, is_filled & ~own & (step == number), tone)
    has_own = np.isin(columns.types, list(colors))
    is_around = np.append(is_filled, False)[built.row_of]  # the row -1 is the last
    _draw_tops(visual, columns, ~has_own & is_around, tones.outline, thickness)
    _draw_tops(visual, columns, ~has_own & ~is_around, tones.wall, thickness)
    for type, color in colors.items():
        _fill(visual, built, is_filled & (built.types == type), color)
        _draw_tops(visual, columns, (columns.types == type) & is_around, _shaded(color), thickness)
        _draw_tops(visual, columns, (columns.types == type) & ~is_around, color, thickness)


def _fill(visual: Drawing, built: Footprints, chosen: BoolArray, color: Any) -> None:
    if chosen.any():
        visual.render_polygons(*built.chosen(chosen), color)


def _is_fence(ctx: IContext, built: Footprints) -> BoolArray:
    """Which rings have the whole graph inside: they are around the scene, not in it."""
    xy: FloatArray = ctx.graph.columns().xy
    if len(xy) == 0 or len(built.types) == 0:
        return np.zeros(len(built.types), bool)
    low, high = built.boxes()
    is_fence: BoolArray = (low <= xy.min(axis=0)).all(axis=1) & (high >= xy.max(axis=0)).all(axis=1)
    return is_fence


def _steps(heights: FloatArray) -> IntArray:
    """Which of the tones each height has."""
    if len(heights) == 0:
        return np.zeros(0, np.int64)
    low, high = np.percentile(heights, (_LOWEST, _TALLEST)).tolist()
    if low == high:
        return np.full(len(heights), (_STEPS - 1) // 2)
    share = np.clip((heights - low) / (high - low), 0.0, 1.0)
    steps: IntArray = np.rint(share * (_STEPS - 1)).astype(np.int64)
    return steps


def _between(low: Rgb, high: Rgb, share: float) -> Rgb:
    red, green, blue = (round(a + share * (b - a)) for a, b in zip(low, high, strict=True))
    return red, green, blue


def _shaded(color: Any) -> Rgba:
    red, green, blue, alpha = rgba(color)
    return round(_SHADE * red), round(_SHADE * green), round(_SHADE * blue), alpha
