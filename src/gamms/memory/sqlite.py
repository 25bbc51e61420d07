"""The store in a SQLite file; the only file that knows sqlite3 and cbor2, loaded when a database is opened.

Changes are kept in one transaction, which `flush` and `close` commit. Compound values are CBOR.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gamms.errors import BadFile
from gamms.limits import Allowance
from gamms.memory.checked import CheckedStore, Rows
from gamms.memory.schema import Schema
from gamms.memory.sql_rows import Catalogue, SqlRows
from gamms.typing import IPathLike, StoreType

if TYPE_CHECKING:
    import sqlite3

# CBOR has arrays and maps only. A map whose one key is a "simple value", which plain data never is,
# marks the rest.
_MARKS: dict[type, int] = {tuple: 32, set: 33, frozenset: 34, dict: 35}
_MARKED: dict[int, type] = {mark: kind for kind, mark in _MARKS.items()}

_STEP = 1_000_000  # instructions of SQLite's machine between two looks at how many there were
_STEPS_PER_BYTE = 20  # that reading may take for each byte of the file,
_STEPS_PER_CHANGE = 1_000  # and for each row that was written and need not be in the file yet
_BYTES_PER_CHANGE = 64
_BYTES_PER_ITEM = 64  # of memory, for each item of a compound value


class SqliteStore(CheckedStore):
    """Keeps its maps in a SQLite database; `create_map` with its schema goes on with a map of the file."""

    def __init__(self, name: str, path: IPathLike) -> None:
        super().__init__(name)
        self._path = path
        self._database = Database(path.as_str())
        try:
            self._catalogue = Catalogue(self._database)
        except BaseException:
            self._database.abandon()
            raise

    def path(self) -> IPathLike:
        """Where the database is."""
        return self._path

    @property
    def type(self) -> StoreType:
        """In a database."""
        return StoreType.DATABASE

    @property
    def is_foreign(self) -> bool:
        """Whether the file already held tables, and none of ours, when it was opened."""
        return self._catalogue.is_foreign

    def connection(self) -> "sqlite3.Connection":
        """The open connection, for SQL of your own."""
        self._check_open()
        return self._database.connection

    def cursor(self) -> "sqlite3.Cursor":
        """A new cursor on the connection."""
        return self.connection().cursor()

    def flush(self) -> None:
        """Commit: what was written until now survives a crash."""
        self._check_open()
        self._database.commit()

    def mark_dirty(self) -> None:
        """Begin a transaction, so that what you write through `cursor` waits for `flush` as well."""
        self._check_open()
        self._database.begin()

    @contextmanager
    def transaction(self, *, is_writing: bool = True) -> Iterator[None]:
        """Commit what the block writes, or nothing of it; let it see the file as it is at one moment.

        While a block that `is_writing` runs, no other program can write.
        """
        self.flush()
        self._database.begin("IMMEDIATE" if is_writing else "DEFERRED")
        try:
            yield
            self._database.commit()
        except BaseException:
            self._database.undo()
            raise

    def allowance(self) -> Allowance:
        """The memory that what is read from the file may take."""
        return self._database.allowance()

    def _make_rows(self, schema: Schema) -> Rows:
        return SqlRows(self._database, schema, self._catalogue.find_or_add(schema))

    def _drop_rows(self, map_name: str) -> None:
        self._catalogue.drop(map_name)

    def _release(self) -> None:
        try:
            self._database.commit()
        finally:
            self._database.abandon()


class Database:
    """A connection whose errors name the file."""

    def __init__(self, path: str) -> None:
        import sqlite3

        self.path = path
        self._integrity_error = sqlite3.IntegrityError
        # Text that is no UTF-8, also within SQLite's own messages, is a UnicodeError.
        self._errors = (sqlite3.Error, OSError, UnicodeError)
        self._steps = 0
        with self._naming_the_file():
            if path != ":memory:":
                Path(path).parent.mkdir(parents=True, exist_ok=True)
            # A context may be ended by another thread than the one that began it.
            self.connection = sqlite3.connect(path, check_same_thread=False)
        try:
            self.read("PRAGMA trusted_schema = OFF")  # a foreign file's triggers get no dangerous functions
            self.read("SELECT count(*) FROM sqlite_master")  # the first read is what tells a database from other files
        except BaseException:
            self.abandon()
            raise

    def read(self, sql: str, values: Sequence[Any] = ()) -> list[tuple[Any, ...]]:
        """All rows of an answer, which may take work in proportion to the file."""
        self._steps = 0
        with self._naming_the_file():
            self.connection.set_progress_handler(self._is_too_much, _STEP)
            try:
                return self.connection.execute(sql, values).fetchall()
            finally:
                self.connection.set_progress_handler(None, 0)

    def allowance(self) -> Allowance:
        """The memory that what is read from the file may take."""
        return Allowance(
            self._size() + _BYTES_PER_CHANGE * self.connection.total_changes, f"The database {self.path!r}"
        )

    def write(self, sql: str, values: Sequence[Any] = ()) -> int:
        """Change something in the running transaction; how many rows it touched."""
        self.begin()
        with self._naming_the_file():
            return self.connection.execute(sql, values).rowcount

    def write_new(self, sql: str, rows: Sequence[Sequence[Any]]) -> bool:
        """Insert rows, all or none; False when a unique value is there already."""
        try:
            with self.all_or_nothing():
                self.connection.executemany(sql, rows)
        except BadFile as error:
            if isinstance(error.__cause__, self._integrity_error):
                return False
            raise
        return True

    @contextmanager
    def all_or_nothing(self) -> Iterator[None]:
        """Undo what the block wrote if it raises, and nothing before it."""
        self.write("SAVEPOINT gamms")
        try:
            with self._naming_the_file():
                yield
        except BaseException:
            self.write("ROLLBACK TO gamms")
            raise
        finally:
            self.write("RELEASE gamms")

    def begin(self, kind: str = "IMMEDIATE") -> None:
        """Start a transaction unless one is running; while an IMMEDIATE one runs, no other program can write."""
        with self._naming_the_file():
            if not self.connection.in_transaction:
                self.connection.execute(f"BEGIN {kind}")

    def commit(self) -> None:
        """Make the running transaction permanent."""
        with self._naming_the_file():
            self.connection.commit()

    def undo(self) -> None:
        """Forget the running transaction."""
        with self._naming_the_file():
            self.connection.rollback()

    def abandon(self) -> None:
        """Close the connection; what was not committed is lost."""
        with self._naming_the_file():
            self.connection.close()

    def blob(self, value: Any) -> bytes:
        """Plain data as CBOR."""
        from cbor2 import CBORSimpleValue, dumps

        def marked(value: Any) -> Any:
            kind = type(value)
            if kind is list:
                return [marked(one) for one in value]
            if kind is dict and not any(isinstance(key, (tuple, frozenset)) for key in value):
                return {key: marked(one) for key, one in value.items()}
            if kind not in _MARKS:
                return value
            items = [marked(one) for one in (value.items() if kind is dict else value)]
            if kind in (set, frozenset):
                items.sort(key=dumps)  # the same set, the same bytes
            return {CBORSimpleValue(_MARKS[kind]): items}

        return dumps(marked(value))

    def unblob(self, payload: Any) -> Any:
        """CBOR as plain data.

        Raises:
            BadFile: it is none.
        """
        from cbor2 import CBORSimpleValue, loads

        allowance = Allowance(len(payload), f"A value in the database {self.path!r}")

        def unmarked(value: Any) -> Any:
            allowance.charge(_BYTES_PER_ITEM)  # a value may hold one list many times
            if isinstance(value, list):
                return [unmarked(one) for one in value]
            if not isinstance(value, dict):
                return value
            if len(value) == 1 and isinstance(mark := next(iter(value)), CBORSimpleValue):
                return _MARKED[mark.value](unmarked(value[mark]))
            return {key: unmarked(one) for key, one in value.items()}

        try:
            return unmarked(loads(payload))
        except Exception as error:
            # Whatever goes wrong in a damaged file, it is the file that is wrong.
            raise BadFile(f"The database {self.path!r} holds a damaged value: {error}.") from error

    def _size(self) -> int:
        try:
            return Path(self.path).stat().st_size
        except OSError:  # a database in memory
            return 0

    def _is_too_much(self) -> bool:
        """Whether to stop SQLite: pages may refer to each other so that a small file takes for ever to read."""
        self._steps += _STEP
        per_change = _STEPS_PER_CHANGE * self.connection.total_changes
        return self._steps > _STEP + _STEPS_PER_BYTE * self._size() + per_change

    @contextmanager
    def _naming_the_file(self) -> Iterator[None]:
        try:
            yield
        except self._errors as error:
            why = "it takes far longer to read than its size explains" if str(error) == "interrupted" else error
            raise BadFile(
                f"Cannot use {self.path!r} as a database: {why}. "
                "Check that it is a SQLite file that nobody else is writing to, or take another path."
            ) from error
