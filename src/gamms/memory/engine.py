"""The stores of a context, by name."""

from collections.abc import Iterator
from contextlib import ExitStack
from numbers import Integral
from typing import TYPE_CHECKING

from gamms.arguments import as_key, as_name
from gamms.errors import BadType, BadValue, Duplicate, NotYet, UnknownName
from gamms.text import shown
from gamms.typing import IMemoryEngine, IPathLike, StoreType

if TYPE_CHECKING:
    from gamms.memory.store import Store


class MemoryEngine(IMemoryEngine):
    """Opens stores, and closes them all at the end."""

    def __init__(self) -> None:
        self._stores: dict[str, Store] = {}

    def create_store(self, store_type: StoreType, name: str, path: IPathLike | None = None) -> "Store":
        """Open a store.

        Raises:
            Duplicate: an open store has this name.
            BadValue: the type is unknown, or a DATABASE has no path.
            BadFile: the file at the path is not a database.
            NotYet: a FILESYSTEM store.
        """
        if as_name(name, "a store") in self._open():
            raise Duplicate("a store", name)
        self._stores[name] = _open_store(store_type, name, path)
        return self._stores[name]

    def get_store(self, name: str) -> "Store":
        """Return an open store by name (KeyError)."""
        stores = self._open()
        if as_key(name, "The name of a store") not in stores:
            raise UnknownName("store", name, stores)
        return stores[name]

    def list_stores(self) -> Iterator[str]:
        """Return the names of the open stores, in order of creation, without those of other engines (`.name`)."""
        return iter([name for name in self._open() if not name.startswith(".")])

    def terminate(self) -> None:
        """Close every store, even if closing one of them fails."""
        with ExitStack() as closing:
            for store in self._stores.values():
                closing.callback(store.close)
            self._stores = {}

    def _open(self) -> "dict[str, Store]":
        # A caller may have closed a store itself; its name is free again.
        self._stores = {name: store for name, store in self._stores.items() if not store.is_closed}
        return self._stores


def _open_store(store_type: object, name: str, path: IPathLike | None) -> "Store":
    from gamms.memory.store import MemoryStore, SqliteStore  # most programs open no store

    if not isinstance(store_type, Integral) or store_type not in tuple(StoreType):
        known = ", ".join(f"StoreType.{one.name}" for one in StoreType)
        raise BadValue(f"Unknown store type {shown(store_type)}. Use one of {known}.")
    if store_type == StoreType.FILESYSTEM:
        raise NotYet("a store on the file system")
    if store_type == StoreType.MEMORY:
        return MemoryStore(name, path)
    if path is None:
        raise BadValue(f"The database store {name!r} needs a path, such as PathLike('game.db').")
    if not isinstance(path, IPathLike):
        raise BadType(
            f"The path of store {name!r} must be a PathLike, not {shown(path)}. Write PathLike({shown(path)})."
        )
    return SqliteStore(name, path)
