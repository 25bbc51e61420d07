"""Stores: named maps from a key to a row of typed fields, in memory or in a SQLite file.

Read `checked.py` first: it answers every call, so that all stores answer alike; a store only keeps the rows.
`schema.py` and `values.py` say what a row may hold, `store.py` keeps rows in memory, `sqlite.py` in a file.
May import: `gamms.typing` and below; sqlite3 and cbor2 in `sqlite.py` only, when a database is opened.
To add a store: one file with a `CheckedStore` and its `Rows`, and one line in `engine.py`.
"""

from typing import TYPE_CHECKING, Any

from gamms.memory.engine import MemoryEngine
from gamms.memory.store import MemoryStore, PathLike

if TYPE_CHECKING:
    from gamms.memory.sqlite import SqliteStore

__all__ = ["MemoryEngine", "MemoryStore", "PathLike", "SqliteStore"]


def __getattr__(name: str) -> Any:
    if name == "SqliteStore":  # most programs never open a database
        from gamms.memory.sqlite import SqliteStore

        return SqliteStore
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
