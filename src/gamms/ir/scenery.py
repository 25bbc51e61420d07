"""Base maps as columns: buildings, areas and lines that are drawn around the streets and block no sight.

A base map belongs to a map and has the same units; files, recordings and snapshots store it. Only drawers read it.
"""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from gamms.errors import BadValue
from gamms.ir.draw import FARTHEST
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray, ObstacleColumns

_GROUND_MARGIN = 0.01  # of the longer side of the map
MOST_POINTS = 1 << 20  # of shapes and of walls, to limit the drawing of untrusted files


class SceneryKind(IntEnum):
    """The kind of a shape; kinds below `WATERWAY` are areas, the others lines. Unknown kinds are not drawn."""

    GREEN = 1  # parks, grass, woods and cemeteries
    WATER = 2
    WATERWAY = 16
    TRAM = 17
    RAIL = 18


@dataclass(slots=True, frozen=True, eq=False)
class Scenery:
    """A base map: buildings, and shapes below all other drawings; areas are polygons with holes joined by seams.

    Raises:
        BadValue: the columns are inconsistent, not finite, or too large.
    """

    kinds: IntArray  # (shapes,)  SceneryKind
    offsets: IntArray  # (shapes + 1,)  shape `i` is `points[offsets[i]:offsets[i + 1]]`
    points: FloatArray  # (points, 2)
    buildings: ObstacleColumns

    def __post_init__(self) -> None:
        """Check the columns, and make them read-only."""
        shapes = len(self.kinds)
        if self.kinds.shape != (shapes,) or self.offsets.shape != (shapes + 1,) or self.points.shape[1:] != (2,):
            raise BadValue("The columns of a scenery must be kinds (n,), offsets (n + 1,) and points (m, 2).")
        sizes = np.diff(self.offsets)
        if self.offsets[0] != 0 or self.offsets[-1] != len(self.points) or (sizes < 2 + self.are_areas()).any():
            raise BadValue(
                "An area of a scenery needs three points or more, a line two; offsets go from 0 to their end."
            )
        points = len(self.points) + len(self.buildings.ids)
        if points > MOST_POINTS:
            raise BadValue(
                f"A scenery holds at most {MOST_POINTS} points and walls, not {points}. Take a smaller area."
            )
        if not all((np.abs(places) <= FARTHEST).all() for places in (self.points, self.buildings.corners)):
            raise BadValue(f"A point of a scenery is not finite, or farther away than {FARTHEST:g}.")
        for column in (self.kinds, self.offsets, self.points, *self.buildings):
            column.setflags(write=False)

    def are_areas(self) -> BoolArray:
        """Return a mask (shapes,) of the shapes that are areas."""
        return self.kinds < SceneryKind.WATERWAY


def find_ground(shapes: FloatArray, *others: FloatArray) -> FloatArray:
    """Return the lower left and the upper right corner (2, 2) of the ground of a map; empty, (0, 2), without shapes.

    Args:
        shapes: (points, 2) the points of areas and lines.
        others: (points, 2) each: points of streets and walls, which are on the ground, too.
    """
    if len(shapes) == 0:
        return np.zeros((0, 2))
    drawn = [points for points in (shapes, *others) if len(points)]
    low = np.min([points.min(axis=0) for points in drawn], axis=0)
    high = np.max([points.max(axis=0) for points in drawn], axis=0)
    margin = _GROUND_MARGIN * float((high - low).max())
    return np.stack([low - margin, high + margin])


def make_empty_scenery() -> Scenery:
    """Return an empty base map."""
    nothing = ObstacleColumns(np.zeros(0, np.int64), np.zeros((0, 4, 3)), np.zeros(0, np.int64))
    return Scenery(np.zeros(0, np.int64), np.zeros(1, np.int64), np.zeros((0, 2)), nothing)
