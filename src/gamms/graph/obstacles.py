"""Obstacle faces: quadrangles in space by id, stored as columns."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain, islice
from math import isfinite, isqrt
from struct import Struct
from typing import Any, ClassVar, cast

import numpy as np
from numpy.typing import ArrayLike

from gamms import kernels
from gamms.arguments import as_float, as_int
from gamms.errors import BadType, BadValue, DuplicateId
from gamms.graph import records
from gamms.graph.records import is_everywhere
from gamms.graph.tables import Table, TableSharing
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray, ObstacleColumns
from gamms.text import shown
from gamms.typing.graph_values import Corner, ObsFace
from gamms.typing.obstacles import Faces, make_face_columns

_AT_ONCE = 4096  # faces
_FEW = 256  # number of faces below which they are scanned one by one
_KEYS = ("face_id", "tr", "tl", "br", "bl", "type")
_MOST = 2**63 - 1
_LATE = 256
_FLOATS = {float}
_pack_corners = Struct("12d").pack
_type_of = type  # the built-in, because the contract calls an argument of faces `type`

Corner2D = tuple[float, float]


class _FaceTable(Table):
    """All faces; a removed face has a box of NaN, which meets no square."""

    kind = "an obstacle face"
    columns: ClassVar = {
        "ids": (np.int64, 1),
        "types": (np.int64, 1),
        "corners": (np.float64, 12),
        "boxes": (np.float64, 6),  # minimum x, y, z, maximum x, y, z
        "alive": (np.uint8, 1),
    }

    def __init__(self) -> None:
        super().__init__()
        self.grid: FaceGrid | None = None  # grid of the boxes, once there are many


class Obstacles(TableSharing):
    """The faces of one graph, in insertion order."""

    def __init__(self) -> None:
        self.revision = 0  # increases with every change
        self._reset()

    def __len__(self) -> int:
        return len(self._faces) + len(self._new)

    def __iter__(self) -> Iterator[ObsFace]:
        columns = self.columns()
        listed = zip(columns.ids.tolist(), columns.corners.tolist(), columns.types.tolist(), strict=True)
        return iter([_make_face(id, corners, type) for id, corners, type in listed])

    def columns(self) -> ObstacleColumns:
        """Return all faces as read-only arrays that never change."""
        return _make_columns(self._flush_to_table())

    def add(self, face: ObsFace) -> None:
        """Add a face.

        Raises:
            DuplicateId (KeyError): the id is taken.
        """
        id, tr, tl, br, bl, kind = face
        self.add_corners(id, (*tr, *tl, *br, *bl), kind)

    def add_corners(self, id: int, corners: tuple[float, ...], kind: int) -> None:
        """Add a face with these 12 coordinates; see `check_corners`.

        Raises:
            DuplicateId (KeyError): the id is taken.
        """
        if id in self._new or (self._faces.count and self._faces.index.find_row(id) >= 0):
            raise DuplicateId("an obstacle face", id)
        self._new[id] = kind
        self._new_corners += _pack_corners(*corners)
        self.revision += 1

    def add_many(self, new: ObstacleColumns) -> None:
        """Add many faces; on an error nothing is added.

        Raises:
            DuplicateId (KeyError): an id is taken, or occurs twice among the new faces.
        """
        self._copy_shared_table()
        _write(self._flush_to_table(), new)
        self.revision += 1

    def get(self, face_id: int) -> ObsFace:
        """Return a face by id (KeyError)."""
        table = self._flush_to_table()
        row = table.find(records.as_id(face_id, "an obstacle face"))
        corners = table.get_array("corners")[row].reshape(4, 3).tolist()
        return _make_face(int(table.ids[row]), corners, int(table.get_array("types")[row]))

    def remove(self, face_id: int) -> None:
        """Remove a face (KeyError)."""
        self._copy_shared_table()
        table = self._flush_to_table()
        row = table.find(records.as_id(face_id, "an obstacle face"))
        table.remove(row)
        table.get_array("boxes")[row] = np.nan
        self.revision += 1
        if table.dead > len(table) + _FEW:  # so that alternating adds and removes take linear time
            table.compact()
            table.grid = None

    def replace(self, faces: Iterable[ObsFace]) -> None:
        """Replace all faces by `faces`."""
        self.put(make_face_columns(list(faces)))

    def put(self, columns: ObstacleColumns) -> None:
        """Replace all faces by the faces in these columns."""
        self._reset()
        self.add_many(columns)

    def find_near(self, d: float, x: float, y: float) -> Iterator[int]:
        """Return ids of the faces whose bounding box meets the square of half side d around (x, y); all for `d < 0`."""
        table = self._flush_to_table()
        if is_everywhere(d, x, y):
            return table.iterate_ids()
        rows = self._find_between((x - d, y - d), (x + d, y + d))
        rows.sort()
        low_x, low_y, _, high_x, high_y, _ = table.get_array("boxes")[rows].T
        hit = (low_x <= x + d) & (high_x >= x - d) & (low_y <= y + d) & (high_y >= y - d)
        return iter(table.get_array("ids")[rows[hit]].tolist())

    def find_visible(self, origin: FloatArray, targets: FloatArray) -> BoolArray:
        """Return whether no face blocks the line from origin (3,) to each target (targets, 3)."""
        if not len(targets) or not len(self):
            return np.ones(len(targets), np.bool_)
        return kernels.find_visible(self._find_corners_around(origin, targets), origin, targets)

    def find_visible_from_each(self, origins: FloatArray, targets: FloatArray, is_asked: BoolArray) -> BoolArray:
        """Return a mask (origins, targets) of the requested lines, of at least one, that no face blocks."""
        if not len(self):
            return is_asked
        corners = self._find_corners_around(origins[0], np.concatenate((origins, targets)))
        return kernels.find_visible_from_each(corners, origins, targets, is_asked)

    def _find_corners_around(self, origin: FloatArray, targets: FloatArray) -> FloatArray:
        """Return the corners (faces, 4, 3) of a superset of the faces that may block lines between these places."""
        table = self._flush_to_table()
        rows = self._find_between(*find_surroundings(origin, targets))
        if table.dead:
            rows = rows[table.get_array("alive")[rows] != 0]
        corners: FloatArray = table.get_array("corners").take(rows, axis=0).reshape(-1, 4, 3)
        return corners

    def find_free_ids(self, count: int) -> IntArray:
        """Return `count` ids after the greatest id.

        Raises:
            BadValue: the ids would exceed 64 bits.
        """
        first = max(self._flush_to_table().iterate_ids(), default=-1) + 1
        if first + count - 1 > _MOST:
            raise BadValue(f"There are no {count} ids after the greatest, {first - 1}. Give ids yourself.")
        return np.arange(first, first + count, dtype=np.int64) if count else np.zeros(0, np.int64)

    # -- inside -------------------------------------------------------------------------------------------------

    def _reset(self) -> None:
        self.stop_sharing()
        self._faces = _FaceTable()
        # faces added one by one, not yet in the table: id -> type, and their corners, 12 numbers each
        self._new: dict[int, int] = {}
        self._new_corners = bytearray()

    def _flush_to_table(self) -> _FaceTable:
        """Move faces that were added one by one to the table, and return the table."""
        if self._new:
            self._copy_shared_table()
            count = len(self._new)
            ids = np.fromiter(self._new, np.int64, count)
            types = np.fromiter(self._new.values(), np.int64, count)
            corners = np.frombuffer(self._new_corners, np.float64).reshape(-1, 4, 3)
            self._new = {}
            self._new_corners = bytearray()
            _write(self._faces, ObstacleColumns(ids, corners, types))
        return self._faces

    def _find_between(self, low: tuple[float, float], high: tuple[float, float]) -> IntArray:
        """Return the rows, unordered, of a superset of the faces whose box meets a rectangle, maybe dead ones too."""
        table = self._faces
        if table.count > _FEW:
            grid = table.grid
            if grid is None or grid.is_outdated(table.count):
                grid = FaceGrid(table.get_array("boxes"))
                table.grid = grid
            rows = grid.find_between(low, high, table.count)
            if rows is not None:
                return rows
        return np.arange(table.count)

    # -- sharing ------------------------------------------------------------------------------------------------

    def fork(self) -> "Obstacles":
        """Return the same faces for another context; both share the table until one of them changes."""
        obstacles = Obstacles()
        obstacles.share(self)
        obstacles.revision = self.revision
        return obstacles

    def share(self, other: "Obstacles") -> None:
        """Replace all faces by the faces of another context; both share the table until one of them changes."""
        self._reset()
        self._faces = other._flush_to_table()
        self.share_with(other)
        self.revision = max(self.revision + 1, other.revision)

    def _copy_shared_table(self) -> None:
        """Stop sharing the table; called before every change."""
        if self.stop_sharing():
            shared = self._faces
            self._faces = _FaceTable()
            _write(self._faces, _make_columns(shared))


def _make_columns(table: _FaceTable) -> ObstacleColumns:
    rows = table.list_living()
    arrays = (
        table.get_array("ids")[rows],
        table.get_array("corners")[rows].reshape(-1, 4, 3),
        table.get_array("types")[rows],
    )
    for array in arrays:
        array.setflags(write=False)
    return ObstacleColumns(*arrays)


def _write(table: _FaceTable, new: ObstacleColumns) -> None:
    boxes = np.hstack((new.corners.min(axis=1), new.corners.max(axis=1)))
    table.extend(new.ids, types=new.types, corners=new.corners, boxes=boxes)


class FaceGrid:
    """A cell grid that finds the faces near a rectangle, in time nearly independent of the number of faces.

    The few largest faces are in no cell and are always returned, so that they do not widen every search. The same holds
    for faces appended later. A removed face may still be returned.

    Args:
        boxes: (rows, 6) minimum x, y, z and maximum x, y, z of each face; NaN for a removed face.
    """

    def __init__(self, boxes: FloatArray) -> None:
        rows = np.flatnonzero(~np.isnan(boxes[:, 0]))
        low = boxes[rows, :3] / 2.0
        high = boxes[rows, 3:] / 2.0
        half = high - low
        with np.errstate(over="ignore"):
            spread = half[:, :2].max(axis=1) + 2.0 * kernels.MARGIN * half.sum(axis=1)
        most_large = isqrt(len(rows))
        order = np.argpartition(spread, len(rows) - 1 - most_large)
        small = order[: len(rows) - most_large]
        self._others = rows[order[len(rows) - most_large :]]
        self._rows = rows[small]
        self._reach = float(spread[small].max())
        self._cells = kernels.build_cells((low + high)[small, :2])
        self._count = len(boxes)

    def is_outdated(self, count: int) -> bool:
        """Return whether so many of the `count` rows were appended later that a new grid is cheaper."""
        return count - self._count > _LATE + 2 * isqrt(self._count)

    def find_between(self, low: Corner2D, high: Corner2D, count: int) -> IntArray | None:
        """Return the rows below `count` of a superset of the faces whose box meets a rectangle; None: all rows."""
        reach = self._reach
        found = kernels.find_rows_between(
            self._cells, (low[0] - reach, low[1] - reach), (high[0] + reach, high[1] + reach)
        )
        if found is None:
            return None
        return np.concatenate((self._rows[found], self._others, np.arange(self._count, count)))


def find_surroundings(origin: FloatArray, targets: FloatArray) -> tuple[Corner2D, Corner2D]:
    """Return the corners of a rectangle that contains all faces that may block lines from `origin` to `targets`."""
    low = np.minimum(targets.min(axis=0), origin)
    high = np.maximum(targets.max(axis=0), origin)
    with np.errstate(over="ignore"):
        margin = kernels.MARGIN * float((high - low).sum())
    low_x, low_y, _ = low.tolist()
    high_x, high_y, _ = high.tolist()
    return (low_x - margin, low_y - margin), (high_x + margin, high_y + margin)


def check_face(
    face_id: int, tr: Sequence[float], tl: Sequence[float], br: Sequence[float], bl: Sequence[float], type: int
) -> ObsFace:
    """Check one face passed by a caller, and return it.

    Raises:
        BadType: an id or type is not an integer, or a coordinate is not a number.
        BadValue: a corner is not three finite numbers.
    """
    id, numbers, kind = check_corners(face_id, tr, tl, br, bl, type)
    return ObsFace(id, numbers[:3], numbers[3:6], numbers[6:9], numbers[9:], kind)  # type: ignore[arg-type] # of three


def check_corners(
    face_id: int, tr: Sequence[float], tl: Sequence[float], br: Sequence[float], bl: Sequence[float], type: int
) -> tuple[int, tuple[float, ...], int]:
    """Check one face passed by a caller, and return its id, the 12 coordinates of its corners, and its type.

    Raises: as `check_face`.
    """
    id = records.as_id(face_id, "an obstacle face")
    # NOTE: most faces have four tuples of three floats; one check for all of them halves the time (w1, faces one
    # by one).
    if tr.__class__ is tl.__class__ is br.__class__ is bl.__class__ is tuple and type.__class__ is int:
        numbers = (*tr, *tl, *br, *bl)
        are_three = len(tr) == len(tl) == len(br) == len(bl) == 3
        if are_three and {*map(_type_of, numbers)} == _FLOATS and isfinite(sum(numbers)) and abs(type) <= _MOST:
            return id, numbers, type
    corners = [_check_corner(*one, id) for one in ((tr, "tr"), (tl, "tl"), (br, "br"), (bl, "bl"))]
    return id, (*chain(*corners),), as_int(type, f"The type of obstacle face {id}")


def check_faces(faces: Faces, ids: ArrayLike | None, types: ArrayLike, obstacles: Obstacles) -> ObstacleColumns:
    """Check faces passed to `add_obstacles`; faces without ids are numbered after the greatest id.

    Raises:
        BadType, BadValue: see `check_face`; or the shapes of the arrays do not fit.
    """
    if not isinstance(faces, np.ndarray):
        given = _make_iterator(faces)
        first = list(islice(given, 1))
        if first and isinstance(first[0], Mapping):
            return _read_columns(chain(first, given), ids, types)
        faces = [*first, *given]
    corners = _make_corner_array(faces)
    count = len(corners)
    checked_ids = obstacles.find_free_ids(count) if ids is None else records.check_ids(ids, "ids")
    if len(checked_ids) != count:
        raise BadValue(f"ids must have shape ({count},) like the faces, not ({len(checked_ids)},).")
    return ObstacleColumns(checked_ids, corners, _make_type_array(types, count))


def _read_columns(given: Iterator[Any], ids: object, types: object) -> ObstacleColumns:
    if ids is not None or not (isinstance(types, int) and types == 0):
        raise BadValue("Records of faces have their own face_id and type: leave out ids and types.")
    parts = []
    # In batches, because a generator may make more dicts than fit in memory.
    while batch := list(islice(given, _AT_ONCE)):
        parts.append(make_face_columns([_read_face(record) for record in batch]))
    return ObstacleColumns(*map(np.concatenate, zip(*parts, strict=True)))


def _read_face(record: Mapping[str, Any]) -> ObsFace:
    face = [records.get_required(record, key, "An obstacle face") for key in _KEYS]
    for key in record if len(record) > len(_KEYS) else ():
        if key not in _KEYS:
            raise BadValue(f"An obstacle face has no {shown(key)}, only {', '.join(_KEYS)}.")
    return check_face(*face)


def _make_iterator(faces: Faces) -> Iterator[Any]:
    try:
        return iter(cast("Iterable[Any]", faces))
    except TypeError:
        raise BadType(
            f"faces must be an array (faces, 4, 3) or dicts with {', '.join(_KEYS)}, not {shown(faces)}."
        ) from None


def _make_corner_array(faces: Sequence[Any] | FloatArray) -> FloatArray:
    wanted = "faces must be an array (faces, 4, 3): the corners tr, tl, br, bl of each, as x, y, z"
    try:
        array = np.asarray(faces) if len(faces) else np.zeros((0, 4, 3))
    except (TypeError, ValueError) as error:
        raise BadValue(f"{wanted}; {error}.") from None
    if array.dtype.kind not in "iuf":
        raise BadType(f"{wanted}; not of {array.dtype}.")
    if array.ndim != 3 or array.shape[1:] != (4, 3):
        raise BadValue(f"{wanted}; not of shape {array.shape}.")
    bad = np.argwhere(~np.isfinite(array))
    if len(bad):
        face, corner, axis = bad[0].tolist()
        where = f"{'xyz'[axis]} of corner {_KEYS[1 + corner]} of face {face}"
        raise BadValue(f"The corners of faces must be finite; {where} is {array[face, corner, axis]}.")
    return array.astype(np.float64)


def _make_type_array(types: ArrayLike, count: int) -> IntArray:
    if np.ndim(types) == 0:
        return np.full(count, as_int(types, "types"), np.int64)
    array = records.check_ids(types, "types")
    if len(array) != count:
        raise BadValue(f"types must have shape ({count},) like the faces, not ({len(array)},).")
    return array


def _make_face(id: int, corners: list[list[float]], type: int) -> ObsFace:
    tr, tl, br, bl = corners
    return ObsFace(id, (*tr,), (*tl,), (*br,), (*bl,), type)  # type: ignore[arg-type] # three numbers each


def _check_corner(value: Sequence[float], name: str, id: int) -> Corner:
    where = f"Corner {name} of obstacle face {id}"
    try:
        numbers = tuple(value)
    except TypeError:
        raise BadType(f"{where} must be three numbers (x, y, z), not {shown(value)}.") from None
    if len(numbers) != 3:
        raise BadValue(f"{where} must be three numbers (x, y, z), not {shown(value)}.")
    x, y, z = (as_float(number, where) for number in numbers)
    return (x, y, z)
