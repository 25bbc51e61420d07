"""Obstacle faces by place: a cell grid that is built when first asked for."""

from math import isqrt

import numpy as np

from gamms import kernels
from gamms.ir.graph import FloatArray, IntArray

_LATE = 256
_MARGIN = 0.01  # how much farther than its box a face may count for a sight line: see `kernels.visible`

Corner2D = tuple[float, float]


class Walls:
    """Finds the rows of faces near a rectangle at a cost that hardly grows with the number of faces.

    A few faces, the largest, are in no cell and always found; so they do not make every search a wide one. So are
    those that were appended since. A face that is removed may go on being found.

    Args:
        boxes: (rows, 6) least x, y, z and greatest x, y, z of each face; NaN for a removed one.
    """

    def __init__(self, boxes: FloatArray) -> None:
        rows = np.flatnonzero(~np.isnan(boxes[:, 0]))
        low, high = boxes[rows, :3] / 2.0, boxes[rows, 3:] / 2.0
        half = high - low
        with np.errstate(over="ignore"):
            spread = half[:, :2].max(axis=1) + 2.0 * _MARGIN * half.sum(axis=1)
        aside = isqrt(len(rows))
        order = np.argpartition(spread, len(rows) - 1 - aside)
        usual, self._others = order[: len(rows) - aside], rows[order[len(rows) - aside :]]
        self._rows = rows[usual]
        self._reach = float(spread[usual].max())
        self._cells = kernels.build_cells((low + high)[usual, :2])
        self._count = len(boxes)

    def is_worn(self, count: int) -> bool:
        """Whether so many rows, of `count` now, were appended since that a new grid is cheaper."""
        return count - self._count > _LATE + 2 * isqrt(self._count)

    def between(self, low: Corner2D, high: Corner2D, count: int) -> IntArray | None:
        """Rows, of `count`, of a superset of the faces whose box meets a rectangle; None: all."""
        reach = self._reach
        found = kernels.rows_between(self._cells, (low[0] - reach, low[1] - reach), (high[0] + reach, high[1] + reach))
        if found is None:
            return None
        return np.concatenate((self._rows[found], self._others, np.arange(self._count, count)))


def surroundings(origin: FloatArray, targets: FloatArray) -> tuple[Corner2D, Corner2D]:
    """The corners of a rectangle that has to be searched for faces that block lines from `origin` to `targets`."""
    low, high = np.minimum(targets.min(axis=0), origin), np.maximum(targets.max(axis=0), origin)
    with np.errstate(over="ignore"):
        margin = _MARGIN * float((high - low).sum())
    (low_x, low_y, _), (high_x, high_y, _) = low.tolist(), high.tolist()
    return (low_x - margin, low_y - margin), (high_x + margin, high_y + margin)
