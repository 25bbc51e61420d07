"""Drawer of obstacles: the top edge of each face as a line in the colour of its type."""

from typing import Any

import numpy as np

from gamms.ir.palette import COLOR_TYPES, OTHER_OBSTACLE
from gamms.typing import IContext
from gamms.visual.primitives import primitives_of


def render_obstacles(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw all obstacles; `data`: `color_map` (type -> colour), `boundary_thickness` (world units).

    Faces of one type are drawn at once, the types in the order of their first face.
    """
    colors: dict[int, Any] = {**COLOR_TYPES, **data.get("color_map", {})}
    thickness = data.get("boundary_thickness", 1.0)
    columns = ctx.graph.obstacle_columns()
    types, first = np.unique(columns.types, return_index=True)
    for type in types[np.argsort(first)].tolist():
        tops = columns.corners[columns.types == type][:, 1::-1, :2]  # from top left to top right
        offsets = np.arange(0, 2 * len(tops) + 1, 2)
        color = colors.get(type, OTHER_OBSTACLE)
        primitives_of(ctx).render_lines(tops.reshape(-1, 2), offsets, color, thickness, in_world=True)
