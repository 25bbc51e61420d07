"""Obstacles as columns: what is drawn, and what sight is checked against."""

from typing import NamedTuple

import numpy as np

from gamms.ir.graph import FloatArray, IntArray

BoolArray = np.ndarray[tuple[int, ...], np.dtype[np.bool_]]


class ObstacleColumns(NamedTuple):
    """Quadrangles in space as read-only arrays, in insertion order."""

    ids: IntArray  # (faces,)
    corners: FloatArray  # (faces, 4, 3)  top right, top left, bottom right, bottom left; x, y, z
    types: IntArray  # (faces,)
