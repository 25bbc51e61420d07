"""Contracts of obstacles, which are quadrangles in space, and of visibility tables."""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence, Sized
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gamms import kernels
from gamms.errors import BadType, BadValue
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray, ObstacleColumns
from gamms.ir.scenery import Scenery, make_empty_scenery
from gamms.typing.graph_values import Corner, NodeIds, ObsFace

Faces = ArrayLike | Iterable[Mapping[str, Any]]
"""Corners (faces, 4, 3): tr, tl, br, bl of each face; or dicts of the arguments of `add_obstacle_face`."""


class IObstacles(ABC):
    """The obstacle faces of a graph engine."""

    # -- to implement -------------------------------------------------------------------------------------------

    @abstractmethod
    def add_obstacle_face(self, face_id: int, tr: Corner, tl: Corner, br: Corner, bl: Corner, type: int) -> None:
        """Add a quadrangle (KeyError for a taken id, ValueError for an invalid corner)."""

    @abstractmethod
    def add_obstacles(self, faces: Faces, ids: ArrayLike | None = None, types: ArrayLike = 0) -> list[int]:
        """Add many quadrangles at once and return their ids; on an error nothing is added.

        `faces` is an array (faces, 4, 3) of the corners tr, tl, br, bl, with `ids` (None: the ids after the greatest
        existing id) and `types` (one for all or one for each); or an iterable of dicts of the arguments of
        `add_obstacle_face`.

        Raises:
            KeyError: an id is taken, or occurs twice.
            TypeError, ValueError: a number or a shape is invalid.
        """

    @abstractmethod
    def remove_obstacle_face(self, face_id: int) -> None:
        """Remove a quadrangle (KeyError)."""

    @abstractmethod
    def get_obstacle_face(self, face_id: int) -> ObsFace:
        """Return a quadrangle by id (KeyError)."""

    @abstractmethod
    def get_obstacle_faces(self, d: float = -1.0, x: float = 0.0, y: float = 0.0) -> Iterator[int]:
        """Return ids of the faces whose bounding box meets the square of half side d around (x, y); all for `d < 0`."""

    # -- to override for speed ----------------------------------------------------------------------------------

    @property
    def obstacle_revision(self) -> int | None:
        """A number that changes with every change of the obstacles; None means that nothing may be cached."""
        return None

    def obstacle_columns(self) -> ObstacleColumns:
        """Return all quadrangles as read-only arrays, in insertion order."""
        return make_face_columns([self.get_obstacle_face(id) for id in self.get_obstacle_faces()])

    def scenery_columns(self) -> Scenery:
        """Return the base map, which blocks no sight; its buildings only if they are not obstacles."""
        return make_empty_scenery()

    def visible(self, origin: ArrayLike, targets: ArrayLike) -> BoolArray:
        """Return whether no face blocks the straight line from one place to each of several places.

        A face that touches either end blocks the line; a face that the line runs along does not, and neither does a
        face of zero area. A line of zero length is never blocked.

        Args:
            origin: (3,) x, y, z in map units.
            targets: (targets, 3)

        Returns:
            (targets,) a fresh array.

        Raises:
            BadValue (ValueError), BadType (TypeError): a shape is wrong, or a number is not finite.
        """
        return kernels.find_visible(self.obstacle_columns().corners, *check_line_ends(origin, targets))


class IVisibility(ABC, Sized):
    """A table of the nodes within a radius of each node that no face hides; both ends of sight lines are equally high.

    The table agrees with `ctx.graph.visible`. It is directed: the view of a node is computed from this node. Its length
    is the number of nodes. All ids are in insertion order, in fresh arrays.

    Every query raises UnknownName (KeyError) for an unknown node, and Outdated (RuntimeError) after nodes or obstacles
    have changed.
    """

    @property
    @abstractmethod
    def radius(self) -> float:
        """The radius in the plane, map units, border included; may be infinite."""

    @property
    @abstractmethod
    def observer_height(self) -> float:
        """The height of both ends of every sight line above the ground at their nodes, map units."""

    @abstractmethod
    def sees(self, observer: int, target: int) -> bool:
        """Return whether a node within the radius of another is visible from it."""

    @abstractmethod
    def mask(self, observer_id: int, ids: Iterable[int]) -> BoolArray:
        """Return whether each of some nodes `ids` (nodes,) is within the radius of a node and visible from it."""

    @abstractmethod
    def from_node(self, node_id: int) -> IntArray:
        """Return the ids of the nodes that are visible from a node, itself included."""

    @abstractmethod
    def watchers(self, node_id: int) -> IntArray:
        """Return the ids of the nodes from which a node is visible, itself included."""

    @abstractmethod
    def coverage(self, node_ids: NodeIds) -> IntArray:
        """Return the ids of the nodes that are visible from at least one of some nodes."""

    @abstractmethod
    def hidden(self, watchers: NodeIds) -> IntArray:
        """Return the ids of the nodes that are visible from none of some nodes."""

    @abstractmethod
    def nearest_hidden(self, node_id: int, watchers: NodeIds, weight: str | None = "length") -> int | None:
        """Return the id of the nearest node by path that is hidden from all watchers; the node itself if it is hidden.

        Ties by `distances(node_id, weight=weight)` go to the first node in insertion order; None if no path leads to a
        hidden node.
        """


def make_face_columns(faces: Sequence[ObsFace]) -> ObstacleColumns:
    """Return faces as columns."""
    ids, types = (np.array([face[i] for face in faces], np.int64) for i in (0, 5))
    return ObstacleColumns(ids, np.array([face[1:5] for face in faces], np.float64).reshape(-1, 4, 3), types)


def check_line_ends(origin: ArrayLike, targets: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Check both ends of sight lines passed by a caller: shapes (3,) and (targets, 3), finite.

    Raises:
        BadValue, BadType: see `IObstacles.visible`.
    """
    ends = _check_points(targets, "targets")
    if ends.size == 0:
        ends = ends.reshape(-1, 3)
    start = _check_points(origin, "origin")
    if start.shape != (3,):
        raise BadValue(f"origin must be one place, (x, y, z), not of shape {start.shape}.")
    if ends.ndim != 2 or ends.shape[1] != 3:
        raise BadValue(f"targets must have shape (targets, 3): x, y, z of each; not {ends.shape}.")
    return start, ends


def _check_points(value: ArrayLike, name: str) -> FloatArray:
    try:
        array = np.asarray(value)
    except (TypeError, ValueError) as error:
        raise BadValue(f"{name} must be an array of places; {error}.") from None
    if array.dtype.kind not in "iuf":
        raise BadType(f"{name} must be numbers, not of {array.dtype}.")
    if not np.isfinite(array).all():
        raise BadValue(f"{name} must be finite; there is {array[~np.isfinite(array)][0]}.")
    return array.astype(np.float64, copy=False)
