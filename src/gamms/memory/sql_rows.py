"""Rows and the list of maps as SQL. Names are quoted, values are bound; no SQLite here, only `Sql`."""

import json
import math
import struct
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any, Protocol

from gamms.errors import BadFile, GammsError, TooLarge
from gamms.limits import Allowance
from gamms.memory.checked import Rows
from gamms.memory.errors import DuplicateKey
from gamms.memory.schema import Field, Schema, check_same, damaged
from gamms.text import shown

ORDER = "gamms_order"  # our own row number, because an INTEGER PRIMARY KEY of the user would replace SQLite's
CATALOGUE = "gamms_maps"

_COLUMN_TYPES = {"int": "INTEGER", "float": "REAL", "str": "TEXT", "bool": "INTEGER", "bytes": "BLOB"}
_CATALOGUE_SQL = f"CREATE TABLE {CATALOGUE} (name TEXT PRIMARY KEY, place TEXT NOT NULL)"
_BYTES_PER_CELL = 48  # of memory, beside the text or the bytes in it


class Sql(Protocol):
    """What we ask of a database."""

    path: str

    def read(self, sql: str, values: Sequence[Any] = ()) -> list[tuple[Any, ...]]:
        """All rows of an answer."""

    def allowance(self) -> Allowance:
        """The memory that what is read may take."""

    def write(self, sql: str, values: Sequence[Any] = ()) -> int:
        """Change something; how many rows it touched."""

    def write_new(self, sql: str, rows: Sequence[Sequence[Any]]) -> bool:
        """Insert rows, all or none; False when a unique value is there already."""

    def all_or_nothing(self) -> AbstractContextManager[None]:
        """Undo what the block wrote if it raises."""

    def blob(self, value: Any) -> bytes:
        """Plain data as bytes."""

    def unblob(self, payload: Any) -> Any:
        """Bytes as plain data, whatever was in the file."""


def quoted(name: str) -> str:
    """A name as SQL, whatever it contains."""
    return '"' + name.replace('"', '""') + '"'


def free_name(wanted: str, taken: set[str]) -> str:
    """`wanted`, or a name like it: SQLite ignores the case of names and keeps `sqlite_…` for itself."""
    name = f"map_{wanted}" if wanted.lower().startswith("sqlite_") else wanted
    while name.lower() in taken:
        name += "_"
    taken.add(name.lower())
    return name


@dataclass(frozen=True)
class Place:
    """Where a map lies in the database, and the schema it was written with."""

    table: str
    key: str
    types: dict[str, str]
    columns: dict[str, str]  # field name to column name


class Catalogue:
    """The table that remembers the maps of a file from one session to the next."""

    def __init__(self, sql: Sql) -> None:
        self._sql = sql
        self._places = self._load()
        self.is_foreign = not self._places and bool(sql.read("SELECT 1 FROM sqlite_master LIMIT 1"))

    def find_or_add(self, schema: Schema) -> Place:
        """The place of a map, made when the file has none of that name.

        Raises:
            BadValue: the file has the map with another schema.
            BadFile: the file lists the map and does not have it.
        """
        found = self._places.get(schema.map_name)
        if found is None:
            with self._sql.all_or_nothing():
                self._places = self._load()  # another program may have added it since
                found = self._places.get(schema.map_name) or self._add(schema)
        check_same(found.types, found.key, schema, self._sql.path)
        _check_table(self._sql, found.table, _table_sql(found))
        return found

    def drop(self, map_name: str) -> None:
        """Forget a map and drop its rows."""
        with self._sql.all_or_nothing():
            self._sql.write(f"DROP TABLE {quoted(self._places[map_name].table)}")
            self._sql.write(f"DELETE FROM {CATALOGUE} WHERE name = ?", (map_name,))  # noqa: S608 - a constant
        del self._places[map_name]

    def _add(self, schema: Schema) -> Place:
        place = self._plan(schema)
        if not self._sql.read("SELECT 1 FROM sqlite_master WHERE name = ?", (CATALOGUE,)):
            self._sql.write(_CATALOGUE_SQL)
        self._sql.write(_table_sql(place))
        values = (schema.map_name, json.dumps(vars(place)))
        self._sql.write(f"INSERT INTO {CATALOGUE} VALUES (?, ?)", values)  # noqa: S608 - a constant
        self._places[schema.map_name] = place
        return place

    def _plan(self, schema: Schema) -> Place:
        tables = {row[0].lower() for row in self._sql.read("SELECT name FROM sqlite_master")} | {CATALOGUE}
        columns = {ORDER}
        return Place(
            table=free_name(schema.map_name, tables),
            key=schema.key.name,
            types=schema.type_names(),
            columns={name: free_name(name, columns) for name in schema.names},
        )

    def _load(self) -> dict[str, Place]:
        if not self._sql.read("SELECT 1 FROM sqlite_master WHERE name = ?", (CATALOGUE,)):
            return {}
        _check_table(self._sql, CATALOGUE, _CATALOGUE_SQL)
        rows = _read_all(self._sql, CATALOGUE, ["name", "place"], ["name", "place"], "")
        return {name: self._parsed(name, text) for name, text in rows}

    def _parsed(self, name: Any, text: Any) -> Place:
        try:
            place = Place(**json.loads(text))
            columns, types = dict(place.columns), dict(place.types)
            names = [name, place.table, place.key, *columns, *columns.values(), *types, *types.values()]
            is_sound = all(isinstance(one, str) for one in names) and columns.keys() == types.keys()
        except (TypeError, ValueError, RecursionError):
            is_sound = False
        if not is_sound:
            raise BadFile(f"The list of maps in {self._sql.path!r} is damaged at {shown(name)}: {shown(text)}.")
        return place


def _table_sql(place: Place) -> str:
    """What makes the table of a map, as SQLite keeps it."""
    definitions = [f"{quoted(ORDER)} INTEGER PRIMARY KEY"]
    for name, type_name in place.types.items():
        unique = " NOT NULL UNIQUE" if name == place.key else ""
        definitions.append(f"{quoted(place.columns[name])} {_COLUMN_TYPES.get(type_name, 'BLOB')}{unique}")
    return f"CREATE TABLE {quoted(place.table)} ({', '.join(definitions)})"


def _check_table(sql: Sql, table: str, made_by: str) -> None:
    """Refuse a table that is not exactly as GAMMS makes it.

    A view, a virtual table, a generated column, a check, a default, a trigger or an index may each compute for ever.

    Raises:
        BadFile: it is something else, or something was added to it.
    """
    found = sql.read("SELECT type, name, sql FROM sqlite_master WHERE tbl_name = ? COLLATE NOCASE", (table,))
    own = [one for one in found if one[:2] == ("table", table)]
    if [one[2] for one in own] != [made_by]:
        raise BadFile(f"The table {shown(table)} of {sql.path!r} is not as GAMMS made it. The file is damaged.")
    for kind, name, text in found:
        if kind != "table" and text is not None:
            raise BadFile(
                f"There is a {kind} {shown(name)} on the table {shown(table)} of {sql.path!r}. It might run anything "
                f"when the table is used; remove it, or take another file."
            )


def _read_all(sql: Sql, table: str, columns: Sequence[str], sized: Sequence[str], order: str) -> list[tuple[Any, ...]]:
    """All rows of a table, after asking how large they are.

    Args:
        sql: the database.
        table: its quoted name.
        columns: their quoted names.
        sized: those of them that hold text or bytes.
        order: a clause.

    Raises:
        TooLarge: the values would take far more memory than the size of the file explains.
    """
    sizes = "".join(f" + ifnull(length(CAST({name} AS BLOB)), 0)" for name in sized)
    ((rows, size),) = sql.read(f"SELECT count(*), total(0{sizes}) FROM {table}")  # noqa: S608 - quoted names
    sql.allowance().charge(rows * len(columns) * _BYTES_PER_CELL + int(size))
    return sql.read(f"SELECT {', '.join(columns)} FROM {table} {order}")  # noqa: S608 - quoted names


class SqlRows(Rows):
    """The rows of one map in one table."""

    def __init__(self, sql: Sql, schema: Schema, place: Place) -> None:
        self._sql, self._schema = sql, schema
        self._into = [_encoder(field, sql) for field in schema.fields]
        self._out = [_decoder(field, sql) for field in schema.fields]
        self._columns = [quoted(place.columns[name]) for name in schema.names]
        self._sized = [name for name, field in zip(self._columns, schema.fields, strict=True) if _has_size(field)]
        self._table = quoted(place.table)
        self._key = self._columns[schema.key_at]

    def append(self, columns: list[list[Any]]) -> None:
        """Insert in one transaction."""
        encoded = [[encode(value) for value in column] for encode, column in zip(self._into, columns, strict=True)]
        marks = ", ".join("?" * len(columns))
        names = ", ".join(self._columns)
        insert = f"INSERT INTO {self._table} ({names}) VALUES ({marks})"  # noqa: S608 - quoted names
        if not self._sql.write_new(insert, list(zip(*encoded, strict=True))):
            raise DuplicateKey(self._schema.map_name, self._first_repeated(columns[self._schema.key_at]))

    def read(self, key: Any) -> Sequence[Any] | None:
        """Select one row."""
        found = self._select(", ".join(self._columns), f"WHERE {self._key} = ?", (self._encoded_key(key),))
        return [decode(value) for decode, value in zip(self._out, found[0], strict=True)] if found else None

    def change(self, key: Any, values: dict[int, Any]) -> bool:
        """Update one row in one statement."""
        changes = ", ".join(f"{self._columns[at]} = ?" for at in values)
        bound = [self._into[at](value) for at, value in values.items()]
        update = f"UPDATE {self._table} SET {changes} WHERE {self._key} = ?"  # noqa: S608 - quoted names
        return self._sql.write(update, [*bound, self._encoded_key(key)]) > 0

    def remove(self, key: Any) -> bool:
        """Delete one row."""
        delete = f"DELETE FROM {self._table} WHERE {self._key} = ?"  # noqa: S608 - quoted names
        return self._sql.write(delete, (self._encoded_key(key),)) > 0

    def keys(self) -> list[Any]:
        """Select the keys in our own order."""
        decode = self._out[self._schema.key_at]
        return [decode(key) for (key,) in self._read_all([self._key])]

    def columns(self) -> list[list[Any]]:
        """Select everything in our own order."""
        rows = self._read_all(self._columns)
        return [[decode(row[at]) for row in rows] for at, decode in enumerate(self._out)]

    def clear(self) -> None:
        """Delete all rows."""
        self._sql.write(f"DELETE FROM {self._table}")  # noqa: S608 - a quoted name

    def _read_all(self, columns: Sequence[str]) -> list[tuple[Any, ...]]:
        sized = [name for name in columns if name in self._sized]
        return _read_all(self._sql, self._table, columns, sized, f"ORDER BY {quoted(ORDER)}")

    def _select(self, what: str, which: str, values: Sequence[Any] = ()) -> list[tuple[Any, ...]]:
        return self._sql.read(f"SELECT {what} FROM {self._table} {which}", values)  # noqa: S608 - quoted names

    def _encoded_key(self, key: Any) -> Any:
        return self._into[self._schema.key_at](key)

    def _first_repeated(self, keys: list[Any]) -> Any:
        seen = set(self.keys())
        for key in keys:
            if key in seen:
                break
            seen.add(key)
        return key


def _has_size(field: Field) -> bool:
    """Whether values may be of any length; a float that is NaN is bytes, too."""
    return field.python_type not in (int, bool)


def _encoder(field: Field, sql: Sql) -> Callable[[Any], Any]:
    """How a stored value becomes a bound one."""
    if field.python_type is float:
        return _float_in
    if field.is_scalar:
        return lambda value: value
    return lambda value: None if value is None else sql.blob(value)


def _float_in(value: float | None) -> float | bytes | None:
    # SQLite turns NaN into NULL and -0.0 into 0.0; as eight bytes they stay what they are.
    if value is None or not (math.isnan(value) or (value == 0.0 and math.copysign(1.0, value) < 0.0)):
        return value
    return struct.pack("<d", value)


def _decoder(field: Field, sql: Sql) -> Callable[[Any], Any]:
    """How a value in the file becomes a stored one, or a `BadFile`."""
    read = sql.unblob if not field.is_scalar else _READERS.get(field.python_type, lambda value: value)

    def decode(value: Any) -> Any:
        if value is None:
            return None
        try:
            return field.stored(read(value))
        except TooLarge:
            raise
        except (GammsError, TypeError, ValueError, KeyError, struct.error):
            raise damaged(field.place, sql.path, value) from None

    return decode


def _float_out(value: Any) -> Any:
    return struct.unpack("<d", value)[0] if isinstance(value, bytes) else value


_READERS: dict[type, Callable[[Any], Any]] = {
    bool: lambda value: {0: False, 1: True}[value],
    float: _float_out,
}
