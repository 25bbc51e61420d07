"""The store that lives in memory, and the path that other stores live at."""

import os
from collections.abc import Sequence
from typing import Any

from gamms.errors import BadType
from gamms.memory.checked import CheckedStore, Rows
from gamms.memory.errors import DuplicateKey
from gamms.memory.schema import Schema, check_name
from gamms.memory.values import plain
from gamms.text import shown
from gamms.typing import IPathLike, StoreType

LazyMapping = dict  # the old name of what `get_data` returns; rows are read at once now


class PathLike(IPathLike):
    """A path as text: equal by value, `':memory:'` for a database without a file."""

    def __init__(self, path: str) -> None:
        self._path = _path_text(path)

    @property
    def path(self) -> str:
        """The path as text."""
        return self._path

    def as_str(self) -> str:
        """The path as text."""
        return self._path

    def exists(self) -> bool:
        """Whether something is there."""
        return os.path.exists(self._path)  # noqa: PTH110 - a PathLike is made of text

    def __repr__(self) -> str:
        return f"PathLike({self._path!r})"

    def __eq__(self, other: object) -> bool:
        return self._path == other._path if isinstance(other, PathLike) else NotImplemented

    def __hash__(self) -> int:
        return hash(self._path)


class MemoryStore(CheckedStore):
    """Keeps its maps in memory; they are gone when it is closed."""

    def __init__(self, name: str, path: IPathLike | None = None) -> None:
        super().__init__(name)
        self._path = path

    def path(self) -> IPathLike | None:
        """What the caller named; nothing is ever written there."""
        return self._path

    @property
    def type(self) -> StoreType:
        """In memory."""
        return StoreType.MEMORY

    def _make_rows(self, schema: Schema) -> Rows:
        return _RowsInMemory(schema)

    def _drop_rows(self, map_name: str) -> None:
        """Nothing to do: the rows go with the map."""

    def _release(self) -> None:
        """Nothing to do: the rows go with the maps."""


class _RowsInMemory(Rows):
    """A dict keeps insertion order, and a row's place when it changes."""

    def __init__(self, schema: Schema) -> None:
        self._schema = schema
        self._rows: dict[Any, list[Any]] = {}

    def append(self, columns: list[list[Any]]) -> None:
        seen: set[Any] = set()
        for key in columns[self._schema.key_at]:
            if key in seen or key in self._rows:
                raise DuplicateKey(self._schema.map_name, key)
            seen.add(key)
        for row in zip(*columns, strict=True):
            self._rows[row[self._schema.key_at]] = list(row)

    def read(self, key: Any) -> Sequence[Any] | None:
        row = self._rows.get(key)
        return None if row is None else [self._fresh(at, value) for at, value in enumerate(row)]

    def change(self, key: Any, values: dict[int, Any]) -> bool:
        row = self._rows.get(key)
        if row is None:
            return False
        for at, value in values.items():
            row[at] = value
        return True

    def remove(self, key: Any) -> bool:
        return self._rows.pop(key, None) is not None

    def keys(self) -> list[Any]:
        return list(self._rows)

    def columns(self) -> list[list[Any]]:
        return [[self._fresh(at, row[at]) for row in self._rows.values()] for at in range(len(self._schema.fields))]

    def clear(self) -> None:
        self._rows.clear()

    def _fresh(self, at: int, value: Any) -> Any:
        field = self._schema.fields[at]
        return value if field.is_scalar else plain(value, field.place)


def _path_text(path: object) -> str:
    """`path` as non-empty text.

    Raises:
        BadType: it is no text.
        BadValue: it is empty, or no file can have it.
    """
    if not isinstance(path, str):
        raise BadType(f"A path must be a str, not {shown(path)} ({type(path).__name__}).")
    check_name(path, f"The path {shown(path)}")
    return path
