"""Stores: named maps from a key to a row of typed fields, in memory or in a SQLite file, as in 1.0.0.

Read `store.py` first: it handles every call. `fields.py` defines the values of a row, `database.py` talks to SQLite,
and `engine.py` keeps the stores of a context by name. The only user inside is `graph/map_file.py`.
May import: `gamms.typing` and below; sqlite3 in `database.py` only, when a store is opened.
"""

from typing import TYPE_CHECKING, Any

from gamms.errors import list_names as _list_names
from gamms.memory.engine import MemoryEngine

if TYPE_CHECKING:
    from gamms.memory.store import MemoryStore, PathLike, SqliteStore

__all__ = ["MemoryEngine", "MemoryStore", "PathLike", "SqliteStore"]
_list_names(__name__, __all__)


def __getattr__(name: str) -> Any:
    if name in __all__:  # most programs never open a store
        from gamms.memory import store

        return getattr(store, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
