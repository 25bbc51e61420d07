"""Contract of obstacles: quadrangles in space, and the sight lines that they block."""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import Any

import numpy as np

from gamms import kernels
from gamms.errors import BadType, BadValue
from gamms.ir.graph import FloatArray
from gamms.ir.obstacles import BoolArray, ObstacleColumns
from gamms.typing.graph_values import Corner, ObsFace


class IObstacles(ABC):
    """The obstacle faces of a graph engine."""

    # -- must write ---------------------------------------------------------------------------------------------

    @abstractmethod
    def add_obstacle_face(self, face_id: int, tr: Corner, tl: Corner, br: Corner, bl: Corner, type: int) -> None:
        """Add a quadrangle (KeyError for a taken id, ValueError for a bad corner)."""

    @abstractmethod
    def add_obstacles(self, faces: Any, ids: Any = None, types: Any = 0) -> list[int]:
        """Add many quadrangles at once, all or none; returns their ids.

        `faces` is an array (faces, 4, 3) of the corners tr, tl, br, bl, with `ids` (None: those after the greatest)
        and `types` (one for all or one for each); or an iterable of the arguments of `add_obstacle_face`, as dicts.

        Raises:
            KeyError: an id is taken, or given twice.
            TypeError, ValueError: a number or a shape is impossible.
        """

    @abstractmethod
    def remove_obstacle_face(self, face_id: int) -> None:
        """Remove a quadrangle (KeyError)."""

    @abstractmethod
    def get_obstacle_face(self, face_id: int) -> ObsFace:
        """A quadrangle by id (KeyError)."""

    @abstractmethod
    def get_obstacle_faces(self, d: float = -1.0, x: float = 0.0, y: float = 0.0) -> Iterator[int]:
        """Ids of the faces whose bounding box meets the square of half side d around (x, y); all for `d < 0`."""

    # -- may override for speed ---------------------------------------------------------------------------------

    @property
    def obstacle_revision(self) -> int | None:
        """A number that changes with every change of the obstacles; None means: never remember anything."""
        return None

    def obstacle_columns(self) -> ObstacleColumns:
        """All quadrangles as read-only arrays, in insertion order."""
        faces = [self.get_obstacle_face(id) for id in self.get_obstacle_faces()]
        ids, types = (np.array([face[i] for face in faces], np.int64) for i in (0, 5))
        return ObstacleColumns(ids, np.array([face[1:5] for face in faces], np.float64).reshape(-1, 4, 3), types)

    def visible(self, origin: Any, targets: Any) -> BoolArray:
        """Whether no face blocks the straight line from one place to each of others.

        A face that touches either end blocks; one that the line runs along does not, nor one of no area. A line of
        no length is never blocked. What this means in numbers, `gamms.kernels.blocks` says.

        Args:
            origin: (3,) x, y, z in map units.
            targets: (targets, 3)

        Returns:
            (targets,) a fresh array.

        Raises:
            BadValue (ValueError), BadType (TypeError): another shape, or a number that is not finite.
        """
        return kernels.visible(self.obstacle_columns().corners, *line_ends(origin, targets))


def line_ends(origin: Any, targets: Any) -> tuple[FloatArray, FloatArray]:
    """Both ends of sight lines from what a caller passed: shapes (3,) and (targets, 3), finite.

    Raises:
        BadValue, BadType: see `IObstacles.visible`.
    """
    ends = _points(targets, "targets")
    if ends.size == 0:
        ends = ends.reshape(-1, 3)
    start = _points(origin, "origin")
    if start.shape != (3,):
        raise BadValue(f"origin must be one place, (x, y, z), not of shape {start.shape}.")
    if ends.ndim != 2 or ends.shape[1] != 3:
        raise BadValue(f"targets must have shape (targets, 3): x, y, z of each; not {ends.shape}.")
    return start, ends


def _points(value: Any, name: str) -> FloatArray:
    try:
        array = np.asarray(value)
    except (TypeError, ValueError) as error:
        raise BadValue(f"{name} must be an array of places; {error}.") from None
    if array.dtype.kind not in "iuf":
        raise BadType(f"{name} must be numbers, not of {array.dtype}.")
    if not np.isfinite(array).all():
        raise BadValue(f"{name} must be finite; there is {array[~np.isfinite(array)][0]}.")
    return array.astype(np.float64, copy=False)
