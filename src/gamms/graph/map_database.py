"""A map in a database file: the bytes of a saved map in one row of a store of `ctx.ictx.memory`."""

from collections.abc import Iterator
from contextlib import AbstractContextManager
from typing import Protocol

from gamms.errors import BadFile, GammsError, WriteConflict
from gamms.graph import map_file
from gamms.graph.map_file import SavedMap
from gamms.graph.store import GraphStore
from gamms.typing.memory_engine import IPathLike, Row, Schema

STORE = ".graph"  # the dot: no store of the program's, and not listed among those

_MAP, _KEY = "saved_map", 0
_SCHEMA: Schema = {"id": int, "saves": int, "map": bytes}


class _Store(Protocol):
    """A DATABASE store, which has more than `IStore`."""

    @property
    def is_foreign(self) -> bool: ...
    def path(self) -> IPathLike: ...
    def create_map(self, map_name: str, schema: Schema, primary_key: str) -> None: ...
    def get_data(self, map_name: str, key: int) -> Row: ...
    def query_keys(self, map_name: str) -> Iterator[int]: ...
    def insert_data(self, map_name: str, struct: Row) -> None: ...
    def update_data(self, map_name: str, struct: Row) -> None: ...
    def flush(self) -> None: ...
    def transaction(self) -> AbstractContextManager[None]: ...


class NoFile(IPathLike):
    """The path of a database in memory."""

    def as_str(self) -> str:
        """Return what SQLite calls it."""
        return ":memory:"

    def exists(self) -> bool:
        """Return False: there is no file."""
        return False


class MapDatabase:
    """Writes a map into a store and reads it again; counts the saves, so that no program overwrites an unread one."""

    def __init__(self, store: _Store) -> None:
        self._store = store
        self._saves = 0  # that had been made when the map was read
        if store.is_foreign:
            raise BadFile(f"{self.path} is a database of something else, not of a graph.")
        try:
            store.create_map(_MAP, _SCHEMA, "id")
        except GammsError as error:
            raise BadFile(f"{self.path} cannot be opened as the database of a graph: {error}") from error
        store.flush()

    @property
    def path(self) -> str:
        """The path of the file."""
        return self._store.path().as_str()

    def read(self) -> SavedMap:
        """Return the map that was written last, or an empty one.

        Raises:
            BadFile: what is in the file is damaged.
        """
        try:
            row = self._row()
            contents = map_file.decode(row["map"]) if row["saves"] else SavedMap(GraphStore().columns(), [], None)
            self._saves = row["saves"]
        except (GammsError, TypeError) as error:
            kind = type(error) if isinstance(error, BadFile) else BadFile
            raise kind(f"{self.path} does not hold a graph that GAMMS can load: {error}") from error
        return contents

    def write(self, contents: SavedMap) -> None:
        """Replace what the database holds.

        Raises:
            BadValue: an attribute is no plain value; the database keeps the map it had.
            WriteConflict: another program has saved since the map was read; the database keeps what that saved.
            BadFile: the file cannot be written; it keeps the map it had.
        """
        data = map_file.encode(contents)
        with self._store.transaction():
            saves = self._row()["saves"]
            if saves != self._saves:
                raise WriteConflict(
                    f"Another program has saved to {self.path} since this context read it, and saving now would undo "
                    "that. Keep this graph in another file with ctx.graph.save('mine.gamms'), or drop it and read "
                    "what is in the database with ctx.graph.load()."
                )
            write = self._store.update_data if saves else self._store.insert_data
            write(_MAP, {"id": _KEY, "saves": saves + 1, "map": data})
        self._saves += 1

    def _row(self) -> Row:
        keys = list(self._store.query_keys(_MAP))  # in a file that was cut off, the index of the keys may be missing
        if not keys:
            return {"id": _KEY, "saves": 0, "map": b""}
        row = self._store.get_data(_MAP, _KEY)
        if not row["saves"] or row["map"] is None:
            raise BadFile(f"The row of the map in {self.path!r} is damaged.")
        return row
