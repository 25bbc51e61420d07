"""The stores of a context, by name."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack

from gamms.errors import BadType, BadValue, Duplicate, NotYet, UnknownName
from gamms.memory.checked import CheckedStore
from gamms.memory.store import MemoryStore
from gamms.text import shown
from gamms.typing import IMemoryEngine, IPathLike, StoreType


class MemoryEngine(IMemoryEngine):
    """Opens stores and closes them all at the end."""

    def __init__(self) -> None:
        self._stores: dict[str, CheckedStore] = {}

    def create_store(self, store_type: StoreType, name: str, path: IPathLike | None = None) -> CheckedStore:
        """Open a store.

        Raises:
            Duplicate: an open store has that name.
            BadValue: an unknown type, or a DATABASE without a path.
            BadFile: the path holds something that is no database.
            NotYet: a FILESYSTEM store.
        """
        if name in self._open():
            raise Duplicate("a store", name)
        store = _OPENERS[_store_type(store_type)](name, path)
        self._stores[name] = store
        return store

    def get_store(self, name: str) -> CheckedStore:
        """An open store by name (KeyError)."""
        stores = self._open()
        if name not in stores:
            raise UnknownName("store", name, stores)
        return stores[name]

    def list_stores(self) -> Iterator[str]:
        """Names of the open stores, in the order of their creation, but for those of other rooms (`.name`)."""
        return iter([name for name in self._open() if not name.startswith(".")])

    def terminate(self) -> None:
        """Close every store, even when closing one of them fails."""
        with ExitStack() as closing:
            for store in self._stores.values():
                closing.callback(store.close)
            self._stores = {}

    def _open(self) -> dict[str, CheckedStore]:
        # A store may be closed behind our back; its name is free again.
        self._stores = {name: store for name, store in self._stores.items() if not store.is_closed}
        return self._stores


def _store_type(value: object) -> StoreType:
    try:
        return StoreType(value)  # type: ignore[arg-type]  # the enum is the check
    except ValueError:
        known = ", ".join(f"StoreType.{one.name}" for one in StoreType)
        raise BadValue(f"Unknown store type {shown(value)}. Use one of {known}.") from None


def _database(name: str, path: IPathLike | None) -> CheckedStore:
    if path is None:
        raise BadValue(f"The database store {name!r} needs a path, such as PathLike('game.db').")
    if not isinstance(path, IPathLike):
        raise BadType(
            f"The path of store {name!r} must be a PathLike, not {shown(path)}. Write PathLike({shown(path)})."
        )
    from gamms.memory.sqlite import SqliteStore

    return SqliteStore(name, path)


def _filesystem(_name: str, _path: IPathLike | None) -> CheckedStore:
    raise NotYet("a store on the file system")


_OPENERS: dict[StoreType, Callable[[str, IPathLike | None], CheckedStore]] = {
    StoreType.MEMORY: MemoryStore,
    StoreType.FILESYSTEM: _filesystem,
    StoreType.DATABASE: _database,
}
