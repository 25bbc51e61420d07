"""Obstacle faces: quadrangles in space by id."""

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from gamms.arguments import as_float, as_int
from gamms.errors import BadType, BadValue, DuplicateId, UnknownName
from gamms.graph import records
from gamms.graph.records import is_everywhere
from gamms.ir.graph import FloatArray
from gamms.typing.graph_engine import Corner, ObsFace


class Obstacles:
    """The faces of one graph, in insertion order."""

    def __init__(self) -> None:
        self._faces: dict[int, ObsFace] = {}
        self._boxes: FloatArray | None = None  # (faces, 4)  least x, least y, greatest x, greatest y

    def __len__(self) -> int:
        return len(self._faces)

    def __iter__(self) -> Iterator[ObsFace]:
        return iter(list(self._faces.values()))

    def add(self, face: ObsFace) -> None:
        """Add a face.

        Raises:
            DuplicateId (KeyError): its id is taken.
        """
        if face.id in self._faces:
            raise DuplicateId("an obstacle face", face.id)
        self._faces[face.id] = face
        self._boxes = None

    def get(self, face_id: int) -> ObsFace:
        """A face by id (KeyError)."""
        try:
            return self._faces[records.as_id(face_id, "an obstacle face")]
        except KeyError:
            raise UnknownName("obstacle face", face_id) from None

    def remove(self, face_id: int) -> None:
        """Remove a face (KeyError)."""
        del self._faces[self.get(face_id).id]
        self._boxes = None

    def replace(self, faces: Iterable[ObsFace]) -> None:
        """Hold `faces` and no others."""
        self._faces = {face.id: face for face in faces}
        self._boxes = None

    def near(self, d: float, x: float, y: float) -> Iterator[int]:
        """Ids of the faces whose bounding box meets the square of half side d around (x, y); all for `d < 0`."""
        if is_everywhere(d, x, y) or not self._faces:
            return iter(list(self._faces))
        if self._boxes is None:
            corners = np.array([face[1:5] for face in self._faces.values()])[:, :, :2]
            self._boxes = np.hstack([corners.min(axis=1), corners.max(axis=1)])
        low_x, low_y, high_x, high_y = self._boxes.T
        hit = (low_x <= x + d) & (high_x >= x - d) & (low_y <= y + d) & (high_y >= y - d)
        ids = list(self._faces)
        return iter([ids[row] for row in np.flatnonzero(hit).tolist()])


def checked_face(face_id: Any, tr: Any, tl: Any, br: Any, bl: Any, type: Any) -> ObsFace:
    """A face from what a caller passed.

    Raises:
        BadType: an id or type that is no integer, a coordinate that is no number.
        BadValue: a corner that is not three finite numbers.
    """
    id = records.as_id(face_id, "an obstacle face")
    return ObsFace(
        id,
        tr=_corner(tr, "tr", id),
        tl=_corner(tl, "tl", id),
        br=_corner(br, "br", id),
        bl=_corner(bl, "bl", id),
        type=as_int(type, f"The type of obstacle face {id}"),
    )


def _corner(value: Any, name: str, id: int) -> Corner:
    where = f"Corner {name} of obstacle face {id}"
    try:
        numbers = tuple(value)
    except TypeError:
        raise BadType(f"{where} must be three numbers (x, y, z), not {value!r}.") from None
    if len(numbers) != 3:
        raise BadValue(f"{where} must be three numbers (x, y, z), not {value!r}.")
    x, y, z = (as_float(number, where) for number in numbers)
    return (x, y, z)
