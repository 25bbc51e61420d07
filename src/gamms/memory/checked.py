"""Every call on a store, checked: a store of a new kind says only where its rows lie."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from gamms.arguments import as_name
from gamms.errors import BadValue, Duplicate, UnknownName
from gamms.memory.errors import UnknownMap
from gamms.memory.schema import Schema, check_name
from gamms.text import shown
from gamms.typing import IStore


class Rows(ABC):
    """The rows of one map, in insertion order.

    What goes in is plain and checked; what comes out belongs to the caller.
    """

    @abstractmethod
    def append(self, columns: list[list[Any]]) -> None:
        """Add rows, given as one list per field; all or none.

        Raises:
            DuplicateKey: a key is there already, or twice in the column.
        """

    @abstractmethod
    def read(self, key: Any) -> Sequence[Any] | None:
        """The row with that key."""

    @abstractmethod
    def change(self, key: Any, values: dict[int, Any]) -> bool:
        """Replace values by their position in the row, all or none; False when there is no such row."""

    @abstractmethod
    def remove(self, key: Any) -> bool:
        """Drop a row; False when there is none."""

    @abstractmethod
    def keys(self) -> list[Any]:
        """All keys."""

    @abstractmethod
    def columns(self) -> list[list[Any]]:
        """Everything, one list per field."""

    @abstractmethod
    def clear(self) -> None:
        """Drop all rows."""


class CheckedStore(IStore):
    """A store that differs from others only in its `Rows`."""

    def __init__(self, name: str) -> None:
        self._name = as_name(name, "a store")
        self._maps: dict[str, tuple[Schema, Rows]] = {}
        self._is_closed = False

    @abstractmethod
    def _make_rows(self, schema: Schema) -> Rows:
        """Find or make the place for the rows of a map."""

    @abstractmethod
    def _drop_rows(self, map_name: str) -> None:
        """Give up the place of a map that is there."""

    @abstractmethod
    def _release(self) -> None:
        """Let go of what the store holds."""

    @property
    def is_closed(self) -> bool:
        """Whether `close` was called."""
        return self._is_closed

    def name(self) -> str:
        """The store's name."""
        return self._name

    def create_map(self, map_name: str, schema: dict[str, type], primary_key: str) -> None:
        """Begin a map, or go on with the one of that name in the store's file."""
        self._check_open()
        if as_name(map_name, "a map") in self._maps:
            raise Duplicate("a map", map_name)
        check_name(map_name, f"The map name {shown(map_name)}")
        checked = Schema(map_name, schema, primary_key)
        self._maps[map_name] = checked, self._make_rows(checked)

    def delete_map(self, map_name: str) -> None:
        """Drop a map and its rows."""
        self._check_open()
        if not self._has(map_name):
            raise UnknownName("map", map_name, self._maps)
        self._drop_rows(map_name)
        del self._maps[map_name]

    def list_maps(self) -> list[str]:
        """Names of the maps, in the order of their creation."""
        self._check_open()
        return list(self._maps)

    def insert_data(self, map_name: str, struct: Mapping[str, Any]) -> None:
        """Add a row; the caller's dict is neither changed nor kept."""
        schema, rows = self._map(map_name)
        rows.append([[value] for value in schema.row(struct)])

    def insert_many(self, map_name: str, columns: Mapping[str, Sequence[Any]]) -> None:
        """Add many rows at once, given as one equally long list per field; all or none.

        Raises:
            DuplicateKey: a key has a row already, or comes twice.
            BadValue: a field is missing, unknown, or of another length.
        """
        schema, rows = self._map(map_name)
        rows.append(schema.columns(columns))

    def get_data(self, map_name: str, key: Any) -> Mapping[str, Any]:
        """A row by key, as a fresh dict."""
        schema, rows = self._map(map_name)
        row = rows.read(schema.lookup(key))
        if row is None:
            raise schema.unknown_key(key)
        return {field.name: field.given(value) for field, value in zip(schema.fields, row, strict=True)}

    def read_columns(self, map_name: str) -> dict[str, list[Any]]:
        """All rows in insertion order, as one fresh list per field."""
        schema, rows = self._map(map_name)
        return {
            field.name: column if field.is_scalar else [field.given(value) for value in column]
            for field, column in zip(schema.fields, rows.columns(), strict=True)
        }

    def update_data(self, map_name: str, struct: Mapping[str, Any]) -> None:
        """Change the given fields of the row whose key is in `struct`; all or none."""
        schema, rows = self._map(map_name)
        key = schema.key_of(struct)
        if not rows.change(key, schema.change(struct) | {schema.key_at: key}):
            raise schema.unknown_key(key)

    def delete_data(self, map_name: str, key: Any) -> None:
        """Remove a row."""
        schema, rows = self._map(map_name)
        if not rows.remove(schema.lookup(key)):
            raise schema.unknown_key(key)

    def clear_map(self, map_name: str) -> None:
        """Remove all rows and keep the map."""
        self._map(map_name)[1].clear()

    def query_keys(self, map_name: str) -> Iterator[Any]:
        """All keys as of now, in insertion order; the map may change while you iterate."""
        return iter(self._map(map_name)[1].keys())

    def close(self) -> None:
        """Release the store; it is unusable afterwards. Closing it again does nothing."""
        if self._is_closed:
            return
        self._release()
        self._maps.clear()
        self._is_closed = True

    def _map(self, map_name: str) -> tuple[Schema, Rows]:
        self._check_open()
        if not self._has(map_name):
            raise UnknownMap(map_name, self._maps)
        return self._maps[map_name]

    def _has(self, map_name: object) -> bool:
        return isinstance(map_name, str) and map_name in self._maps

    def _check_open(self) -> None:
        if self._is_closed:
            raise BadValue(f"The store {self._name!r} is closed. Create a new store.")
