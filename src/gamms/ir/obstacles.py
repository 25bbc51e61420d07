"""Obstacles as columns, for drawing and sight lines; and the colors of their types."""

from typing import NamedTuple

import numpy as np

from gamms.ir.graph import FloatArray, IntArray

BoolArray = np.ndarray[tuple[int, ...], np.dtype[np.bool_]]


class ObstacleColumns(NamedTuple):
    """Quadrangles in space as read-only arrays, in insertion order."""

    ids: IntArray  # (faces,)
    corners: FloatArray  # (faces, 4, 3)  top right, top left, bottom right, bottom left; x, y, z
    types: IntArray  # (faces,)


COLOR_TYPES: dict[int, str] = dict(
    enumerate(
        (
            *("#a6cee3", "#1f78b4", "#b2df8a", "#9fadf4", "#fb9a99", "#e31a1c", "#fdbf6f", "#ff7f00"),
            *("#cab2d6", "#6a3d9a", "#ffff99", "#b15928", "#8dd3c7", "#ffffb3", "#bebada", "#fb8072"),
            *("#33a02c", "#fdb462", "#b3de69", "#fccde5", "#d9d9d9", "#bc80bd", "#ccebc5", "#ffed6f"),
            *("#8dd3c7", "#80b1d3", "#fdb462", "#b3de69", "#fccde5", "#d9d9d9", "#bc80bd", "#ccebc5"),
        )
    )
)
"""Colors of the types 0-31, which programs rely on; other types are drawn in `OTHER_OBSTACLE`."""
OTHER_OBSTACLE = (169, 169, 169)
