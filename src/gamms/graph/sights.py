"""What every node sees, worked out from arrays alone."""

from typing import NamedTuple

import numpy as np

from gamms.graph.obstacles import Obstacles
from gamms.graph.places import Places
from gamms.graph.tables import NodeTable
from gamms.ir.graph import FloatArray
from gamms.ir.obstacles import ObstacleColumns

RowArray = np.ndarray[tuple[int, ...], np.dtype[np.int32]]  # half the memory of other rows; there are many


class Scene(NamedTuple):
    """Who looks at whom, and what stands in between."""

    xy: FloatArray  # (nodes, 2)
    corners: FloatArray  # (faces, 4, 3)
    radius: float
    observer_height: float


class Seen(NamedTuple):
    """What some observers see, one after the other."""

    counts: RowArray  # (observers,)
    rows: RowArray  # (counts.sum(),) node rows, ascending for each observer


class Sights:
    """Answers what nodes see, as `GraphEngine.visible` would."""

    def __init__(self, scene: Scene) -> None:
        count, faces = len(scene.xy), len(scene.corners)
        self._radius = scene.radius
        self._points = np.column_stack((scene.xy, np.full(count, scene.observer_height)))
        nodes = NodeTable()
        nodes.extend(np.arange(count), xy=scene.xy)
        self._places = Places(nodes)
        self._obstacles = Obstacles()
        self._obstacles.add_many(ObstacleColumns(np.arange(faces), scene.corners, np.zeros(faces, np.int64)))

    def seen(self, first: int, last: int) -> Seen:
        """What the observers in these rows see; there must be one."""
        found = [self._row(self._points[row]) for row in range(first, last)]
        return Seen(np.array([len(rows) for rows in found], np.int32), np.concatenate(found))

    def _row(self, observer: FloatArray) -> RowArray:
        near = self._places.within(float(observer[0]), float(observer[1]), self._radius)
        return near[self._obstacles.visible(observer, self._points[near])].astype(np.int32)
