"""Growable columns with one id per row: the storage of nodes and edges."""

from collections.abc import Callable, Iterator, Mapping
from itertools import chain, compress
from typing import Any, ClassVar, Self, TypeVar
from weakref import WeakSet

import numpy as np

from gamms.errors import BadValue, ContextTerminated, DuplicateId, UnknownName
from gamms.ir.graph import FloatArray, IntArray, Polylines, RowArray, RowMapping, read_only

T = TypeVar("T")

_START = 16
_CHUNK = 4096  # ids converted to Python ints at a time, for callers that read only the first few
MOST_DEPTH = 100  # far below the recursion limit, so that accepted values can be read everywhere


class RowIndex:
    """Finds the row of an id.

    The usual ids `first, first + 1, …` in row order take no memory, and all other ids take a dict.
    """

    __slots__ = ("_first", "_gone", "_others", "_run")

    def __init__(self) -> None:
        self._first = 0  # rows 0 … _run - 1 have the ids _first, _first + 1, …
        self._run = 0
        self._gone: set[int] = set()  # removed rows among these
        self._others: dict[int, int] = {}  # id -> row, for all other rows

    def find_row(self, id: int) -> int:
        """Return the row of `id`, or -1."""
        row = id - self._first
        if 0 <= row < self._run and row not in self._gone:
            return row
        return self._others.get(id, -1)

    def find_rows(self, ids: IntArray, kind: str) -> IntArray:
        """Return the rows (ids,) of many ids.

        Raises:
            UnknownName (KeyError): an id is unknown.
        """
        if not self._others and not self._gone:
            rows = ids - self._first
            # NOTE: as unsigned numbers, ids before the first are large: one comparison (benchmarks:
            # peers).
            if not len(rows) or int(rows.view(np.uint64).max()) < self._run:
                return rows
        rows = self._find_rows(ids)
        missing = np.flatnonzero(rows < 0)
        if len(missing):
            raise UnknownName(kind, int(ids[missing[0]]))
        return rows

    def add(self, id: int, row: int) -> None:
        """Assign a new `id` to the next row."""
        if row == 0:
            self._first = id
        if row == self._run and id == self._first + row:
            self._run += 1
        else:
            self._others[id] = row

    def extend(self, ids: IntArray, row: int, kind: str) -> None:
        """Assign `ids` to the rows from `row` on.

        Raises:
            DuplicateId (KeyError): an id is taken, or occurs twice in `ids`; nothing has changed.
        """
        if not len(ids):
            return
        self.refuse_duplicates(ids, kind)
        first = int(ids[0]) if row == 0 else self._first
        if _are_consecutive(ids) and row == self._run and int(ids[0]) == first + row:
            self._first = first
            self._run = row + len(ids)
        else:
            self._others.update(zip(ids.tolist(), range(row, row + len(ids)), strict=True))

    def remove(self, id: int) -> None:
        """Remove an existing id."""
        if self._others.pop(id, None) is None:
            self._gone.add(self.find_row(id))

    def refuse_duplicates(self, ids: IntArray, kind: str) -> None:
        """Check that new ids are neither taken nor repeated.

        Raises:
            DuplicateId (KeyError): an id is taken or repeated.
        """
        if not (ids[1:] > ids[:-1]).all():
            unique, counts = np.unique(ids, return_counts=True)
            if len(unique) < len(ids):
                raise DuplicateId(kind, int(unique[counts > 1][0]))
        if self._run or self._others:
            taken = np.flatnonzero(self._find_rows(ids) >= 0)
            if len(taken):
                raise DuplicateId(kind, int(ids[taken[0]]))

    def _find_rows(self, ids: IntArray) -> IntArray:
        """Return the rows (ids,) of many ids, -1 for unknown ids."""
        rows = ids - self._first
        rows[(rows < 0) | (rows >= self._run)] = -1
        if self._others or self._gone:
            gone = np.fromiter(self._gone, np.int64, len(self._gone))
            unsure = np.flatnonzero((rows < 0) | np.isin(rows, gone))
            rows[unsure] = np.fromiter(map(self.find_row, ids[unsure].tolist()), np.int64, len(unsure))
        return rows


def _are_consecutive(ids: IntArray) -> bool:
    # Python integers, because NumPy's wrap around at 64 bits.
    return len(ids) < 2 or (int(ids[-1]) - int(ids[0]) == len(ids) - 1 and bool((np.diff(ids) == 1).all()))


class Table:
    """Columns of equal length. A removed row stays as a dead row until `compact`.

    Each column is an attribute: a flat memoryview of single values, `width` values per row. `get_array` returns it as
    an array. Arrays returned by `get_frozen` are never written to again.
    """

    kind: ClassVar[str]  # name of a row, with its article, for messages
    columns: ClassVar[dict[str, tuple[Any, int]]]  # name -> (dtype, width)

    ids: memoryview
    alive: memoryview

    _empty: ClassVar[dict[str, np.ndarray[Any, Any]]]  # the columns of a table without rows

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        cls._empty = {name: np.zeros((0, width), dtype) for name, (dtype, width) in cls.columns.items()}
        for name, array in cls._empty.items():
            setattr(cls, name, array.reshape(-1).data)

    def __init__(self) -> None:
        self.index = RowIndex()
        self.count = 0  # rows in use, dead rows included
        self.dead = 0
        self.capacity = 0
        self.attributes: dict[str, Mapping[int, Any]] = {}  # name -> row -> value; may include dead rows
        self._arrays = self._empty.copy()  # NOTE: shared, because most contexts are made long before their map
        self._is_shared = False

    def __len__(self) -> int:
        return self.count - self.dead

    def get_array(self, name: str) -> np.ndarray[Any, Any]:
        """Return a column as an array of the rows in use; do not store it."""
        array = self._arrays[name][: self.count]
        return array[:, 0] if array.shape[1] == 1 else array

    def get_frozen(self, name: str) -> np.ndarray[Any, Any]:
        """Return a column as a read-only array that never changes."""
        self._is_shared = True
        return read_only(self.get_array(name))

    def prepare_writing(self) -> None:
        """Prepare for writing to an existing row: copy columns that were handed out."""
        if self._is_shared:
            self._resize(self.capacity)
            self._is_shared = False

    def reserve(self, rows: int) -> None:
        """Make room for `rows` more rows."""
        if self.count + rows > self.capacity:
            grown = max(_START, self.capacity + self.capacity // 2)
            # Bulk appends get the exact size; otherwise growth makes copies ever rarer.
            is_bulk = rows >= max(_START, self.capacity)
            self._resize(self.count + rows if is_bulk else max(self.count + rows, grown))

    def find(self, id: int) -> int:
        """Return the row of `id`.

        Raises:
            UnknownName (KeyError): the id is unknown.
        """
        row = self.index.find_row(id)
        if row < 0:
            raise UnknownName(self.kind.partition(" ")[2], id, compress(self.ids[: self.count], self.alive))
        return row

    def extend(self, ids: IntArray, **columns: np.ndarray[Any, Any]) -> int:
        """Append many rows, given all columns except `alive`; return the first new row.

        Raises:
            DuplicateId (KeyError): an id is taken; nothing has changed.
        """
        first = self.count
        end = self.count + len(ids)
        self.index.extend(ids, first, self.kind)
        self.reserve(len(ids))
        for name, values in {"ids": ids, **columns}.items():
            self._arrays[name][first:end] = values.reshape(len(ids), self.columns[name][1])
        self._arrays["alive"][first:end] = 1
        self.count = end
        return first

    def remove(self, row: int) -> None:
        """Mark a living row as dead."""
        self.index.remove(self.ids[row])
        self.alive[row] = 0
        self.dead += 1

    def list_living(self) -> IntArray:
        """Return the living rows, ascending."""
        if not self.dead:
            return np.arange(self.count)
        return np.flatnonzero(self.get_array("alive"))

    def iterate_ids(self, rows: IntArray | None = None) -> Iterator[int]:
        """Return the ids of `rows`, or of all living rows."""
        ids = self.get_array("ids")
        if rows is None:
            rows = None if not self.dead else self.list_living()
        ids = ids if rows is None else ids[rows]  # a snapshot, because the id of a row never changes
        return chain.from_iterable(ids[i : i + _CHUNK].tolist() for i in range(0, len(ids), _CHUNK))

    def copy_attributes(self, row: int) -> dict[str, Any]:
        """Return the attributes of one row as a fresh dict."""
        return {name: copy_value(values[row]) for name, values in self.attributes.items() if row in values}

    def set_attributes(self, row: int, given: dict[str, Any]) -> None:
        """Change some attributes of one row."""
        for name, value in given.items():
            values = make_writable(self.attributes.get(name, {}))
            self.attributes[name] = values
            values[row] = value

    def add_attributes(self, first: int, given: Mapping[str, Mapping[int, Any]]) -> None:
        """Add attributes by row; row 0 of `given` is row `first` of the table."""
        for name, values in given.items():
            self.attributes[name] = join_rows(self.attributes.get(name, {}), first, values)

    def compact(self) -> IntArray:
        """Drop the dead rows; return the new row (rows,) of each old row, -1 for a dead row."""
        alive = self.list_living()
        moved = np.full(self.count, -1, np.int64)
        moved[alive] = np.arange(len(alive))
        ids = self.get_array("ids")[alive]
        self._arrays = {name: array[alive] for name, array in self._arrays.items()}
        self.count = len(alive)
        self.dead = 0
        self.capacity = len(alive)
        self._is_shared = False
        self._resize(max(_START, len(alive)))
        self.index = RowIndex()
        self.index.extend(ids, 0, self.kind)
        left = {name: renumber_rows(values, moved) for name, values in self.attributes.items()}
        self.attributes = {name: values for name, values in left.items() if values}
        return moved

    def _resize(self, capacity: int) -> None:
        for name, (dtype, width) in self.columns.items():
            array = np.zeros((capacity, width), dtype)
            array[: self.count] = self._arrays[name][: self.count]
            self._arrays[name] = array
            setattr(self, name, array.reshape(-1).data)
        self.capacity = capacity


class NodeTable(Table):
    """The table of nodes."""

    kind = "a node"
    columns: ClassVar = {"ids": (np.int64, 1), "xy": (np.float64, 2), "alive": (np.uint8, 1)}

    xy: "memoryview[float]"

    def append(self, id: int, x: float, y: float) -> int:
        """Append a node with a new id; return its row."""
        row = self.count
        if row == self.capacity:
            self.reserve(1)
        self.index.add(id, row)
        self.ids[row] = id
        self.xy[2 * row] = x
        self.xy[2 * row + 1] = y
        self.alive[row] = 1
        self.count = row + 1
        return row


class EdgeTable(Table):
    """The table of edges; their ends are node rows."""

    kind = "an edge"
    columns: ClassVar = {
        "ids": (np.int64, 1),
        "sources": (np.int64, 1),
        "targets": (np.int64, 1),
        "lengths": (np.float64, 1),
        "alive": (np.uint8, 1),
    }

    sources: memoryview
    targets: memoryview
    lengths: "memoryview[float]"

    def __init__(self) -> None:
        super().__init__()
        # row -> (points, 2), for edges that are not straight; may include dead rows
        self.polylines: Mapping[int, FloatArray] = {}

    def append(self, id: int, source: int, target: int, length: float) -> int:
        """Append an edge with a new id; return its row."""
        row = self.count
        if row == self.capacity:
            self.reserve(1)
        self.index.add(id, row)
        self.ids[row] = id
        self.sources[row] = source
        self.targets[row] = target
        self.lengths[row] = length
        self.alive[row] = 1
        self.count = row + 1
        return row

    def set_polyline(self, row: int, polyline: FloatArray) -> None:
        """Set the polyline of an edge."""
        polylines = make_writable(self.polylines)
        self.polylines = polylines
        polylines[row] = polyline

    def straighten(self, row: int) -> None:
        """Remove the polyline of an edge, if it has one."""
        if row in self.polylines:
            polylines = make_writable(self.polylines)
            self.polylines = polylines
            del polylines[row]

    def find_polylines(self, rows: RowArray) -> list[tuple[int, FloatArray]]:
        """Return (index in `rows`, polyline) of the rows (rows,) that have a polyline."""
        polylines = self.polylines
        if isinstance(polylines, Polylines):
            return polylines.find_among(rows)
        return [(i, polylines[row]) for i, row in enumerate(rows.tolist()) if row in polylines]

    def compact(self) -> IntArray:
        """Drop the dead rows; return the new row (rows,) of each old row, -1 for a dead row."""
        moved = super().compact()
        self.polylines = renumber_rows(self.polylines, moved)
        return moved

    def rename_ends(self, moved: IntArray) -> None:
        """Update the ends after nodes were compacted."""
        self.prepare_writing()
        for name in ("sources", "targets"):
            column = self.get_array(name)
            # A dead edge may end at a dead node; any row is valid for it.
            column[:] = np.maximum(moved[column], 0)


def make_writable(values: Mapping[int, T]) -> dict[int, T]:
    """Return values by row as a dict that may be written to; shared columns are copied."""
    return values if isinstance(values, dict) else dict(values.items())


def join_rows(values: Mapping[int, T], first: int, given: Mapping[int, T]) -> Mapping[int, T]:
    """Join two mappings of values by row; rows of the second are counted from `first`."""
    if not (values or first) and isinstance(given, RowMapping):
        return given
    added = make_writable(values)
    added.update({first + row: value for row, value in given.items()} if first else given.items())
    return added


def renumber_rows(values: Mapping[int, T], moved: IntArray) -> Mapping[int, T]:
    """Renumber values by row: `moved` (rows,) has the new row, or -1 for rows that are dropped."""
    if not isinstance(values, RowMapping):
        rows = moved.tolist()
        return {rows[row]: value for row, value in values.items() if rows[row] >= 0}
    rows = moved[values.rows]
    places = np.flatnonzero(rows >= 0)
    return values.select_rows(places, rows[places])


def freeze_mapping(values: Mapping[int, T]) -> Mapping[int, T]:
    """Return the present values by row as a mapping that never changes."""
    return values if isinstance(values, RowMapping) else dict(values)


class ClosedTable:
    """The placeholder for tables and indexes of a closed graph; every access raises an error."""

    def __getattr__(self, name: str) -> Any:
        raise ContextTerminated("its graph")

    def __len__(self) -> int:
        raise ContextTerminated("its graph")


def copy_value(value: T, depth: int = 0) -> T:
    """Return `value` with copies of its lists, dicts, sets and arrays, so that callers cannot change the graph.

    Raises:
        BadValue: the value is nested too deeply, or contains itself.
    """
    copy: Callable[[T, int], T] | None = _COPIES.get(type(value))
    if copy is None:
        return value
    if depth > MOST_DEPTH:
        raise BadValue(f"An attribute must not be nested more than {MOST_DEPTH} levels deep, or hold itself.")
    return copy(value, depth + 1)


_COPIES: dict[type, Callable[[Any, int], Any]] = {
    list: lambda value, depth: [copy_value(one, depth) for one in value],
    tuple: lambda value, depth: tuple(copy_value(one, depth) for one in value),
    dict: lambda value, depth: {key: copy_value(one, depth) for key, one in value.items()},
    set: lambda value, _depth: value.copy(),
    bytearray: lambda value, _depth: value.copy(),
    np.ndarray: lambda value, _depth: value.copy(),
}

CONTAINERS = frozenset(_COPIES)  # values of other classes are returned as they are by `copy_value`


class TableSharing:
    """An object whose tables others like it may share; it copies them before it changes them."""

    _sharers: "WeakSet[TableSharing] | None" = None  # this object, and all others that share its tables

    def share_with(self, other: Self) -> None:
        """Note that this object has the tables of another."""
        if other._sharers is None:
            other._sharers = WeakSet([other])
        self._sharers = other._sharers
        self._sharers.add(self)

    def stop_sharing(self) -> bool:
        """Leave shared tables to their other owners; return whether there are any."""
        sharers = self._sharers
        self._sharers = None
        if sharers is not None:
            sharers.discard(self)
        return bool(sharers)
