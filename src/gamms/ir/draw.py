"""Draw commands: what every drawer emits and every render backend consumes.

This is the visualization IR that the paper leaves as future work: no objects, only columns.
"""

from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np

from gamms.ir.graph import FloatArray, IntArray


class DrawKind(IntEnum):
    """What one command draws, and what its points and size mean."""

    CIRCLE = 1  # one point, the centre; size = radius
    RECTANGLE = 2  # two points: top-left corner, in world units; (width, height), in the unit of `space`
    LINE = 3  # two or more points, an open polyline; width
    POLYGON = 4  # three or more points, closed; what it winds around is filled, so a seam to a ring may make a hole
    TEXT = 5  # one point, the anchor; size = font height
    IMAGE = 6  # one point, the centre; size = half of the side; `text` is the path or name of the image


class DrawSpace(IntEnum):
    """The unit of a command's size, of a rectangle's extent, and of a line's width.

    Positions are always in world units, y up; outlines are always in pixels.
    """

    WORLD = 0
    SCREEN = 1  # pixels


@dataclass(slots=True, frozen=True, eq=False)
class DrawCommands:
    """One row per command, in painting order within a layer; lower layers are painted first.

    The points of row `i` are `points[offsets[i]:offsets[i + 1]]`.
    """

    kind: IntArray  # (commands,)  DrawKind
    layer: IntArray  # (commands,)
    space: IntArray  # (commands,)  DrawSpace
    size: FloatArray  # (commands,)  radius, font height or half side
    width: FloatArray  # (commands,)  of a line, in the unit of `space`; of an outline, in pixels; 0 = filled
    angle: FloatArray  # (commands,)  degrees, counter-clockwise
    color: "np.ndarray[Any, np.dtype[np.uint8]]"  # (commands, 4)  RGBA
    offsets: IntArray  # (commands + 1,)
    points: FloatArray  # (points, 2)
    text: tuple[str, ...]  # (commands,)  "" where it does not apply

    def __len__(self) -> int:
        return len(self.kind)

    def in_painting_order(self) -> IntArray:
        """Rows from back to front."""
        if (self.layer[1:] >= self.layer[:-1]).all():  # as it nearly always is
            return np.arange(len(self.layer))
        return np.argsort(self.layer, kind="stable")
