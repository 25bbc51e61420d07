"""A connection to SQLite whose errors name the file; other modules import sqlite3 only to write GeoPackages.

Code in a foreign file is never run, and reading takes time and memory only in proportion to the size of the file.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from gamms.errors import BadFile
from gamms.limits import MemoryBudget
from gamms.text import shown

_STEP = 1_000_000  # instructions of SQLite's virtual machine between two checks
_STEPS_PER_BYTE = 20  # instructions for each byte of the file,
_STEPS_PER_CHANGE = 1_000  # and for each written row that is not in the file yet
_BYTES_PER_CHANGE = 64


def quote(name: str) -> str:
    """Return a name as a quoted SQL identifier."""
    return '"' + name.replace('"', '""') + '"'


class Database:
    """One open connection; changes wait in a transaction for `commit`."""

    def __init__(self, path: str) -> None:
        import sqlite3

        self.path = path
        self.integrity_error = sqlite3.IntegrityError
        # Text that is not UTF-8, also in SQLite's own messages, raises a UnicodeError.
        self._errors = (sqlite3.Error, OSError, UnicodeError)
        self._steps = 0
        self._is_file = path != ":memory:"
        with self.name_errors():
            if self._is_file:
                Path(path).parent.mkdir(parents=True, exist_ok=True)
            # A context may be terminated by another thread than the one that created it.
            self.connection = sqlite3.connect(path, check_same_thread=False)
        try:
            self.read("PRAGMA trusted_schema = OFF")  # triggers in a foreign file get no dangerous functions
            self.read("SELECT count(*) FROM sqlite_master")  # the first read detects files that are not databases
        except BaseException:
            self.abandon()
            raise

    def read(self, sql: str, values: Sequence[Any] = ()) -> list[tuple[Any, ...]]:
        """Return all rows of a query, with a limit on work in proportion to the file."""
        self._steps = 0
        with self.name_errors():
            self.connection.set_progress_handler(self._is_too_much if self._is_file else None, _STEP)
            try:
                return self.connection.execute(sql, values).fetchall()
            finally:
                self.connection.set_progress_handler(None, 0)

    def read_table(self, table: str, columns: Sequence[str], order: str = "") -> list[tuple[Any, ...]]:
        """Return all rows of a table, after checking their total size; all names are quoted.

        Raises:
            TooLarge: the values would take far more memory than the size of the file explains.
        """
        if self._is_file:
            sizes = "".join(f" + ifnull(length(CAST({name} AS BLOB)), 0)" for name in columns)
            # Only the contents of cells are charged: each cell takes an instruction, which `read` counts.
            ((size,),) = self.read(f"SELECT total(0{sizes}) FROM {table}")  # noqa: S608 - quoted names
            allowance = MemoryBudget(
                self._measure_size() + _BYTES_PER_CHANGE * self.connection.total_changes, f"The database {self.path!r}"
            )
            allowance.charge(int(size))
        return self.read(f"SELECT {', '.join(columns)} FROM {table} {order}")  # noqa: S608 - quoted names

    def write(self, sql: str, values: Sequence[Any] = ()) -> int:
        """Run a statement in the current transaction, and return the number of affected rows."""
        self.begin()
        with self.name_errors():
            return self.connection.execute(sql, values).rowcount

    @contextmanager
    def write_atomically(self) -> Iterator[None]:
        """Undo the writes of the block if it raises, but nothing before it."""
        self.write("SAVEPOINT gamms")
        try:
            with self.name_errors():
                yield
        except BaseException:
            self.write("ROLLBACK TO gamms")
            raise
        finally:
            self.write("RELEASE gamms")

    def begin(self) -> None:
        """Start a transaction unless one is running; it locks out writers of other programs."""
        with self.name_errors():
            if not self.connection.in_transaction:
                self.connection.execute("BEGIN IMMEDIATE")

    def commit(self) -> None:
        """Make the running transaction permanent."""
        with self.name_errors():
            self.connection.commit()

    def undo(self) -> None:
        """Discard the current transaction."""
        with self.name_errors():
            self.connection.rollback()

    def abandon(self) -> None:
        """Close the connection; uncommitted changes are lost."""
        with self.name_errors():
            self.connection.close()

    def check_table(self, table: str, made_by: str) -> None:
        """Refuse a table that is not exactly as GAMMS makes it.

        A view, a virtual table, a generated column, a check, a default, a trigger or an index may each compute
        forever.

        Raises:
            BadFile: the table was made otherwise, or something was added to it.
        """
        found = self.read("SELECT type, name, sql FROM sqlite_master WHERE tbl_name = ? COLLATE NOCASE", (table,))
        if [one[2] for one in found if one[:2] == ("table", table)] != [made_by]:
            raise BadFile(f"The table {shown(table)} of {self.path!r} is not as GAMMS made it. The file is damaged.")
        for kind, name, text in found:
            if kind != "table" and text is not None:
                raise BadFile(
                    f"There is a {kind} {shown(name)} on the table {shown(table)} of {self.path!r}. It might run "
                    "anything when the table is used; remove it, or take another file."
                )

    @contextmanager
    def name_errors(self) -> Iterator[None]:
        """Turn errors of SQLite in the block into a `BadFile` with the path."""
        try:
            yield
        except self._errors as error:
            why = "it takes far longer to read than its size explains" if str(error) == "interrupted" else error
            raise BadFile(
                f"Cannot use {self.path!r} as a database: {why}. "
                "Check that it is a SQLite file that no other program is writing to, or take another path."
            ) from error

    def _measure_size(self) -> int:
        try:
            return Path(self.path).stat().st_size
        except OSError:  # a database in memory
            return 0

    def _is_too_much(self) -> bool:
        """Return whether to stop SQLite: pages may refer to each other so that a small file takes forever to read."""
        self._steps += _STEP
        per_change = _STEPS_PER_CHANGE * self.connection.total_changes
        return self._steps > _STEP + _STEPS_PER_BYTE * self._measure_size() + per_change
