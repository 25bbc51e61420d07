"""The stores: named maps from a key to a row of typed fields, in memory or in a SQLite database."""

import json
import os
import struct
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from gamms.arguments import as_name
from gamms.errors import BadFile, BadType, BadValue, Duplicate, GammsError, TooLarge, UnknownName
from gamms.memory.database import Database, quote
from gamms.memory.fields import DuplicateKey, Field, Schema, UnknownMap, check_name
from gamms.plain import Plain
from gamms.readonly import NotPickled
from gamms.text import shown
from gamms.typing import IPathLike, IStore, StoreType
from gamms.typing.memory_engine import Schema as TypesByName

if TYPE_CHECKING:
    import sqlite3

LazyMapping = dict  # the type that `get_data` returned in 1.0.0; rows are now read at once

_ORDER = quote("gamms_order")  # our own row number: a user's INTEGER PRIMARY KEY would replace SQLite's
_LIST = "gamms_maps"
_LIST_SQL = f"CREATE TABLE {_LIST} (name TEXT PRIMARY KEY, place TEXT NOT NULL)"
_COLUMN_TYPES = {"int": "INTEGER", "float": "REAL", "str": "TEXT", "bool": "INTEGER", "bytes": "BLOB"}


class PathLike(IPathLike):
    """A path as text: compared by value, `':memory:'` for a database without a file.

    Raises:
        BadType: the path is not a text.
        BadValue: the path is empty.
    """

    def __init__(self, path: str) -> None:
        if not isinstance(path, str):
            raise BadType(f"A path must be a str, not {shown(path)} ({type(path).__name__}).")
        check_name(path, f"The path {shown(path)}")
        self.path = path

    def as_str(self) -> str:
        """Return the path as text."""
        return self.path

    def exists(self) -> bool:
        """Return whether a file or folder exists at the path."""
        return os.path.exists(self.path)  # noqa: PTH110 - a PathLike is made of text

    def __repr__(self) -> str:
        return f"PathLike({self.path!r})"

    def __eq__(self, other: object) -> bool:
        return self.path == other.path if isinstance(other, PathLike) else NotImplemented

    def __hash__(self) -> int:
        return hash(self.path)


class Store(IStore):
    """Checks each call, so that all kinds of stores behave alike; subclasses store the rows of maps.

    Attributes:
        is_closed: whether `close` was called.
    """

    _type: ClassVar = StoreType.MEMORY

    def __init__(self, name: str, path: IPathLike | None = None) -> None:
        self._name = as_name(name, "a store")
        self._path = path
        self._maps: dict[str, _MapRows] = {}
        self.is_closed = False

    def name(self) -> str:
        """Return the store's name."""
        return self._name

    def path(self) -> IPathLike | None:
        """Return the caller's path; a store in memory writes nothing there."""
        return self._path

    @property
    def type(self) -> StoreType:
        """Where the store keeps its maps."""
        return self._type

    def create_map(self, map_name: str, schema: TypesByName, primary_key: str) -> None:
        """Create a map, or open the map of this name in the store's file."""
        self._check_open()
        if as_name(map_name, "a map") in self._maps:
            raise Duplicate("a map", map_name)
        check_name(map_name, f"The map name {shown(map_name)}")
        self._maps[map_name] = self._open_rows(Schema(map_name, schema, primary_key))

    def delete_map(self, map_name: str) -> None:
        """Drop a map and its rows."""
        self._check_open()
        if not self._has(map_name):
            raise UnknownName("map", map_name, self._maps)
        self._drop(map_name)
        del self._maps[map_name]

    def list_maps(self) -> list[str]:
        """Return the names of the maps, in the order of their creation."""
        self._check_open()
        return list(self._maps)

    def insert_data(self, map_name: str, struct: Mapping[str, Any]) -> None:
        """Add a row; the caller's dict is neither changed nor kept."""
        found = self._map(map_name)
        found.append(found.schema.encode_row(struct))

    def get_data(self, map_name: str, key: object) -> Mapping[str, Any]:
        """Return a row by key, as a fresh dict."""
        found = self._map(map_name)
        row = found.get_row(found.schema.lookup(key))
        if row is None:
            raise found.schema.make_unknown_key_error(key)
        return {field.name: found.decode_value(field, cell) for field, cell in zip(found.fields, row, strict=True)}

    def update_data(self, map_name: str, struct: Mapping[str, Any]) -> None:
        """Change the given fields of the row whose key is in `struct`, all or none."""
        found = self._map(map_name)
        key, cells = found.schema.change(struct)
        if not found.change(key, cells):
            raise found.schema.make_unknown_key_error(key)

    def delete_data(self, map_name: str, key: object) -> None:
        """Remove a row."""
        found = self._map(map_name)
        if not found.remove(found.schema.lookup(key)):
            raise found.schema.make_unknown_key_error(key)

    def query_keys(self, map_name: str) -> Iterator[Any]:
        """Return all current keys, in insertion order; the map may change during the iteration."""
        found = self._map(map_name)
        return iter([found.decode_value(found.schema.key, key) for key in found.list_keys()])

    def close(self) -> None:
        """Release the store; it is unusable afterwards. Closing it again does nothing."""
        if not self.is_closed:
            self.is_closed = True  # even if the last changes cannot be written
            self._maps.clear()
            self._release()

    def _map(self, map_name: str) -> "_MapRows":
        self._check_open()
        if not self._has(map_name):
            raise UnknownMap(map_name, self._maps)
        return self._maps[map_name]

    def _has(self, map_name: object) -> bool:
        return isinstance(map_name, str) and map_name in self._maps

    def _check_open(self) -> None:
        if self.is_closed:
            raise BadValue(f"The store {self._name!r} is closed. Create a new store.")

    def _open_rows(self, schema: Schema) -> "_MapRows":
        """Open or create the storage for the rows of a map."""
        return _MapRows(schema)

    def _drop(self, map_name: str) -> None:
        """Remove the storage of a map."""

    def _release(self) -> None:
        """Release the resources of the store."""


class MemoryStore(Store):
    """Keeps its maps in memory, until it is closed."""


class SqliteStore(Store, NotPickled):
    """Keeps its maps in a SQLite database; `create_map` with the same schema opens an existing map of the file.

    Attributes:
        is_foreign: whether the file already held tables, but none of GAMMS, when it was opened.
    """

    _type = StoreType.DATABASE
    _not_pickled = (
        "A store in a file can neither be pickled nor copied, because it holds a connection to its database. Pass on "
        "its path, and open it again there."
    )

    def __init__(self, name: str, path: IPathLike) -> None:
        super().__init__(name, path)
        self._database = Database(path.as_str())
        try:
            self._places = _read_map_tables(self._database)
            self.is_foreign = not self._places and bool(self._database.read("SELECT 1 FROM sqlite_master LIMIT 1"))
        except BaseException:
            self._database.abandon()
            raise

    def connection(self) -> "sqlite3.Connection":
        """Return the open connection, for SQL of your own."""
        self._check_open()
        return self._database.connection

    def cursor(self) -> "sqlite3.Cursor":
        """Return a new cursor on the connection."""
        return self.connection().cursor()

    def flush(self) -> None:
        """Commit: all writes until now survive a crash."""
        self._check_open()
        self._database.commit()

    def mark_dirty(self) -> None:
        """Begin a transaction, so that your writes through `cursor` also wait for `flush`."""
        self._check_open()
        self._database.begin()

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """Commit all writes of the block or none; writers of other programs are locked out meanwhile."""
        self.flush()
        self._database.begin()
        try:
            yield
            self._database.commit()
        except BaseException:
            self._database.undo()
            raise

    def _open_rows(self, schema: Schema) -> "_MapRows":
        place = self._places.get(schema.map_name)
        if place is None:
            with self._database.write_atomically():
                self._places = _read_map_tables(self._database)  # another program may have added it since
                place = self._places.get(schema.map_name) or _add_map_table(self._database, schema)
                self._places[schema.map_name] = place
        return _SqlMapRows(self._database, schema, place)

    def _drop(self, map_name: str) -> None:
        with self._database.write_atomically():
            self._database.write(f"DROP TABLE {quote(self._places[map_name].table)}")
            self._database.write(f"DELETE FROM {_LIST} WHERE name = ?", (map_name,))  # noqa: S608 - a constant
        del self._places[map_name]

    def _release(self) -> None:
        try:
            self._database.commit()
        finally:
            self._database.abandon()


# -- the rows of a map ------------------------------------------------------------------------------------------


class _MapRows:
    """The rows of a map in memory: key -> cells."""

    def __init__(self, schema: Schema) -> None:
        self.schema = schema
        self.fields = [*schema.fields.values()]
        self._rows: dict[Any, dict[str, Any]] = {}

    def append(self, row: dict[str, Any]) -> None:
        if (key := row[self.schema.key.name]) in self._rows:
            raise DuplicateKey(self.schema.map_name, key)
        self._rows[key] = row

    def get_row(self, key: Plain) -> Sequence[Any] | None:
        row = self._rows.get(key)
        return None if row is None else [*row.values()]

    def change(self, key: Plain, cells: dict[str, Any]) -> bool:
        if key not in self._rows:
            return False
        self._rows[key].update(cells)
        return True

    def remove(self, key: Plain) -> bool:
        return self._rows.pop(key, None) is not None

    def list_keys(self) -> list[Any]:
        return list(self._rows)

    def decode_value(self, field: Field, cell: Plain) -> Plain:
        return field.decode(cell)


class _SqlMapRows(_MapRows):
    """The rows of a map in a table of a database. Names are quoted, cells are bound."""

    def __init__(self, database: Database, schema: Schema, place: "_MapTable") -> None:
        super().__init__(schema)
        self._database = database
        if (place.types, place.key) != (schema.type_names, schema.key.name):
            raise BadValue(
                f"Map {schema.map_name!r} of {database.path!r} has the schema {place.types} with key {place.key!r}, "
                f"not {schema.type_names} with key {schema.key.name!r}. Use that schema, another name or another file."
            )
        database.check_table(place.table, place.write_sql())
        self._columns = {name: quote(place.columns[name]) for name in schema.fields}
        self._table = quote(place.table)
        self._key = self._columns[schema.key.name]
        self._where = f"WHERE {self._key} = ?"

    def append(self, row: dict[str, Any]) -> None:
        names = ", ".join(self._columns.values())
        marks = ", ".join("?" * len(row))
        insert = f"INSERT INTO {self._table} ({names}) VALUES ({marks})"  # noqa: S608 - quoted names
        try:
            self._database.write(insert, [*row.values()])
        except BadFile as error:
            if not isinstance(error.__cause__, self._database.integrity_error):
                raise
            raise DuplicateKey(self.schema.map_name, row[self.schema.key.name]) from None

    def get_row(self, key: Plain) -> Sequence[Any] | None:
        names = ", ".join(self._columns.values())
        found = self._database.read(f"SELECT {names} FROM {self._table} {self._where}", (key,))  # noqa: S608 - quoted
        return found[0] if found else None

    def change(self, key: Plain, cells: dict[str, Any]) -> bool:
        names = ", ".join(f"{self._columns[name]} = ?" for name in cells)
        update = f"UPDATE {self._table} SET {names} {self._where}"  # noqa: S608 - quoted names
        return self._database.write(update, [*cells.values(), key]) > 0

    def remove(self, key: Plain) -> bool:
        return self._database.write(f"DELETE FROM {self._table} {self._where}", (key,)) > 0  # noqa: S608 - quoted names

    def list_keys(self) -> list[Any]:
        return [key for (key,) in self._database.read_table(self._table, [self._key], f"ORDER BY {_ORDER}")]

    def decode_value(self, field: Field, cell: Plain) -> Plain:
        """Return the value of a cell in the file; raise a `BadFile` if it is damaged."""
        try:
            return field.decode(cell)
        except TooLarge:
            raise
        except (GammsError, TypeError, ValueError, struct.error):
            raise BadFile(
                f"{field.place} holds {shown(cell)} in {self._database.path!r}, which its type cannot be. "
                "The file is damaged."
            ) from None


# -- where a map lies in the database ---------------------------------------------------------------------------


@dataclass(frozen=True)
class _MapTable:
    """The table of a map, and its schema when it was created."""

    table: str
    key: str
    types: dict[str, str]
    columns: dict[str, str]  # field name to column name

    def write_sql(self) -> str:
        """Return the statement that creates the table, as SQLite stores it."""
        definitions = [f"{_ORDER} INTEGER PRIMARY KEY"]
        for name, type_name in self.types.items():
            unique = " NOT NULL UNIQUE" if name == self.key else ""
            definitions.append(f"{quote(self.columns[name])} {_COLUMN_TYPES.get(type_name, 'BLOB')}{unique}")
        return f"CREATE TABLE {quote(self.table)} ({', '.join(definitions)})"


def _read_map_tables(database: Database) -> dict[str, _MapTable]:
    """Return the maps listed in the file."""
    if not database.read("SELECT 1 FROM sqlite_master WHERE name = ?", (_LIST,)):
        return {}
    database.check_table(_LIST, _LIST_SQL)
    return {
        name: _parse_table(name, text, database.path) for name, text in database.read_table(_LIST, ["name", "place"])
    }


def _parse_table(name: object, text: Plain, path: str) -> _MapTable:
    try:
        place = _MapTable(**json.loads(text))
        columns = dict(place.columns)
        types = dict(place.types)
        names = [name, place.table, place.key, *columns, *columns.values(), *types, *types.values()]
        is_sound = all(isinstance(one, str) for one in names) and columns.keys() == types.keys()
    except (TypeError, ValueError, RecursionError):
        is_sound = False
    if not is_sound:
        raise BadFile(f"The list of maps in {path!r} is damaged at {shown(name)}: {shown(text)}.")
    return place


def _add_map_table(database: Database, schema: Schema) -> _MapTable:
    tables = {row[0].lower() for row in database.read("SELECT name FROM sqlite_master")}
    if _LIST not in tables:
        database.write(_LIST_SQL)
    columns = {"gamms_order"}
    place = _MapTable(
        table=_find_free_name(schema.map_name, tables | {_LIST}),
        key=schema.key.name,
        types=schema.type_names,
        columns={name: _find_free_name(name, columns) for name in schema.fields},
    )
    database.write(place.write_sql())
    values = (schema.map_name, json.dumps(vars(place)))
    database.write(f"INSERT INTO {_LIST} VALUES (?, ?)", values)  # noqa: S608 - a constant
    return place


def _find_free_name(wanted: str, taken: set[str]) -> str:
    """Return `wanted`, or a similar free name: SQLite ignores the case of names and reserves `sqlite_…`."""
    name = f"map_{wanted}" if wanted.lower().startswith("sqlite_") else wanted
    while name.lower() in taken:
        name += "_"
    taken.add(name.lower())
    return name
