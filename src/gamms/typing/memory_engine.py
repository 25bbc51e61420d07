"""Contract of the stores: tables of typed rows by key."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from enum import IntEnum
from typing import Any

Schema = dict[str, type]  # field -> Python type
Row = Mapping[str, Any]  # field -> value


class StoreType(IntEnum):
    """The storage of a store."""

    MEMORY = 0
    FILESYSTEM = 1
    DATABASE = 2


class IPathLike(ABC):
    """The location of a store."""

    @abstractmethod
    def as_str(self) -> str:
        """Return the path as text."""

    @abstractmethod
    def exists(self) -> bool:
        """Return whether the location exists."""


class IStore(ABC):
    """Named maps; each has a schema and a primary key.

    Raises, on every implementation:
        Duplicate (ValueError): `create_map` with a taken name.
        TypeError: a schema that is not a dict of field names to types, or is empty.
        IndexError: a primary key that is not in the schema or not of type int, float, str, bool or bytes;
            any data operation on an unknown map (at the call, not at the first step of an iterator).
        KeyError: `delete_map` of an unknown map; a key that exists on insert, or is missing elsewhere.
        ValueError: a row without one of its fields.
    """

    @abstractmethod
    def name(self) -> str:
        """Return the store's name."""

    @abstractmethod
    def path(self) -> IPathLike | None:
        """Return the location of the store; None for a store in memory."""

    @property
    @abstractmethod
    def type(self) -> StoreType:
        """The kind of storage."""

    @abstractmethod
    def create_map(self, map_name: str, schema: Schema, primary_key: str) -> None:
        """Begin a map."""

    @abstractmethod
    def delete_map(self, map_name: str) -> None:
        """Drop a map and its rows."""

    @abstractmethod
    def list_maps(self) -> list[str]:
        """Return the names of the maps, in order of creation."""

    @abstractmethod
    def insert_data(self, map_name: str, struct: dict[str, Any]) -> None:
        """Add a row; the caller's dict is neither changed nor stored."""

    @abstractmethod
    def get_data(self, map_name: str, key: object) -> Mapping[str, Any]:
        """Return a row by key."""

    @abstractmethod
    def update_data(self, map_name: str, struct: dict[str, Any]) -> None:
        """Change the given fields of the row whose key is in `struct`."""

    @abstractmethod
    def delete_data(self, map_name: str, key: object) -> None:
        """Remove a row."""

    @abstractmethod
    def query_keys(self, map_name: str) -> Iterator[Any]:
        """Return all keys, in insertion order."""

    @abstractmethod
    def close(self) -> None:
        """Release the store; it is unusable afterwards."""


class IMemoryEngine(ABC):
    """Stores by name."""

    @abstractmethod
    def create_store(self, store_type: StoreType, name: str, path: IPathLike | None = None) -> IStore:
        """Open a store.

        Raises:
            Duplicate: the name is taken.
            BadValue: an unknown type, or a DATABASE without a path.
            NotYet: a FILESYSTEM store.
        """

    @abstractmethod
    def get_store(self, name: str) -> IStore:
        """Return a store by name (KeyError)."""

    @abstractmethod
    def list_stores(self) -> Iterator[str]:
        """Return the names of the open stores."""

    @abstractmethod
    def terminate(self) -> None:
        """Close every store."""
