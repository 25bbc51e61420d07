"""The layout of a picture: the one rule by which labels, street names, legends, panels and captions find their places.

A part that has its place covers an area. A later part stands at the first of its places that covers no such area; a
part that must be shown stands at the first of those that cover the least.
"""

import numpy as np
from numpy.typing import ArrayLike

from gamms.ir.graph import FloatArray
from gamms.ir.obstacles import BoolArray

Rectangle = tuple[float, float, float, float]  # left, top, right, bottom; pixels


class Layout:
    """The covered areas of a page. All boxes are left, top, right, bottom in pixels.

    Args:
        page: where parts may stand.
        areas: (areas, 4) that are covered from the start.

    Attributes:
        page: where parts may stand.
        areas: (areas, 4) the covered areas, in the order in which they were covered.
    """

    def __init__(self, page: Rectangle, areas: ArrayLike = ()) -> None:
        self.page = page
        self.areas: FloatArray = np.empty((0, 4))
        self.cover(areas)

    def cover(self, areas: ArrayLike) -> None:
        """Cover areas (areas, 4), or one (4,)."""
        self.areas = np.vstack([self.areas, np.reshape(areas, (-1, 4))])

    def find_free(self, places: FloatArray, gap: float = 0.0) -> int | None:
        """Return the row of the first of `places` (places, 4) on the page that is `gap` away from covered areas.

        Returns:
            The row; None if no place is free.
        """
        overlaps = self._find_overlaps(places, gap)
        row = int(overlaps.argmin())
        return row if overlaps[row] == 0.0 else None

    def choose(self, places: FloatArray, gap: float = 0.0) -> int:
        """Return the row of the first of `places` (places, 4) that cover the least, on the page if possible."""
        return int(self._find_overlaps(places, gap).argmin())

    def _find_overlaps(self, places: FloatArray, gap: float) -> FloatArray:
        overlaps = self.measure_overlaps(places, gap)
        overlaps[~self.are_inside(places)] = np.inf
        return overlaps

    def measure_overlaps(self, boxes: FloatArray, gap: float = 0.0) -> FloatArray:
        """Return the covered area of each of `boxes` (boxes, 4) with a gap around it, in square pixels."""
        low = boxes[:, :2] - gap
        high = boxes[:, 2:] + gap
        begins_before = (self.areas[:, :2] < high.max(axis=0)).all(axis=1)
        ends_behind = (self.areas[:, 2:] > low.min(axis=0)).all(axis=1)
        near = self.areas[begins_before & ends_behind]
        shared = np.minimum(high[:, None], near[:, 2:]) - np.maximum(low[:, None], near[:, :2])
        overlaps: FloatArray = np.maximum(shared, 0.0).prod(axis=2).sum(axis=1)
        return overlaps

    def are_inside(self, boxes: FloatArray) -> BoolArray:
        """Return which of `boxes` (boxes, 4) are on the page."""
        low = self.page[:2]
        high = self.page[2:]
        is_inside: BoolArray = np.all((boxes[:, :2] >= low) & (boxes[:, 2:] <= high), axis=1)
        return is_inside

    def move_inside(self, boxes: FloatArray) -> FloatArray:
        """Move `boxes` (boxes, 4) onto the page; one that is larger than the page begins at its upper left corner."""
        moved: FloatArray = boxes + np.tile(np.minimum(np.subtract(self.page[2:], boxes[:, 2:]), 0.0), 2)
        moved += np.tile(np.maximum(np.subtract(self.page[:2], moved[:, :2]), 0.0), 2)
        return moved

    def list_below(self, box: Rectangle, gap: float) -> FloatArray:
        """Return a box, then the places (places, 4) below covered areas, from top to bottom, in whole pixels."""
        ways = np.ceil(self._find_areas_along(box, gap)[:, 3]) + gap - box[1]
        return _move_down(box, np.sort(ways[ways > 0.0]))

    def list_above(self, box: Rectangle, gap: float) -> FloatArray:
        """Return a box, then the places (places, 4) above covered areas, from bottom to top, in whole pixels."""
        ways = np.floor(self._find_areas_along(box, gap)[:, 1]) - gap - box[3]
        return _move_down(box, np.sort(ways[ways < 0.0])[::-1])

    def _find_areas_along(self, box: Rectangle, gap: float) -> FloatArray:
        """Return the covered areas that a box would meet on its way up or down."""
        left, _, right, _ = box
        return self.areas[(self.areas[:, 0] < right + gap) & (self.areas[:, 2] > left - gap)]


def _move_down(box: Rectangle, ways: FloatArray) -> FloatArray:
    """Return a box, and the box moved down by each of `ways`."""
    moved: FloatArray = np.array(box) + np.outer(np.append(0.0, ways), (0.0, 1.0, 0.0, 1.0))
    return moved
