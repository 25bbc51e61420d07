"""Folders of the user and of runs: how their files are read within bounds, and written completely or not at all.

A folder of results may come from a stranger. `opened`, and all that reads by it, takes regular files only: a link, a
pipe, a socket or a device in their place is refused. Nothing is written through a link, either.
"""

import csv
import errno
import json
import os
import stat
import sys
import tempfile
import threading
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO, Literal, NoReturn, TypeVar

from gamms.errors import BadFile, BadValue, WriteConflict
from gamms.limits import refuse_above
from gamms.text import as_cell, reason

T = TypeVar("T")

Scalar = bool | int | float | str | None
"""The type of a value in a row of a table."""

LOCK = "lock"
_DEEPEST = 64  # levels of JSON; a scenario, which may have 40, is in a plan
_MOST_DIGITS = 300  # of an integer, which then fits into a float
_BYTES_PER_LETTER = 4  # of memory for each byte of JSON: a text with an emoji has four bytes for each letter
_BYTES_PER_VALUE = {b",": 80, b"{": 250, b"[": 100, b"\n": 100}  # and for each sign that begins a value
_ESCAPED = "backslashreplace"  # halves of surrogate pairs
_held: set[Path] = set()  # folders of this process, whose locks do not exclude each other


def home_folder() -> Path:
    """The user's own folder; for one whom the system does not know, as in some containers, that of temporary files."""
    try:
        return Path.home()
    except RuntimeError:
        return Path(tempfile.gettempdir())


def cache_folder(name: str) -> Path:
    """The folder of that name in the user's own cache folder; it may have to be made."""
    home = home_folder()
    if sys.platform == "win32":
        caches = Path(os.environ.get("LOCALAPPDATA") or home / "AppData" / "Local")
    elif sys.platform == "darwin":
        caches = home / "Library" / "Caches"
    else:
        caches = Path(os.environ.get("XDG_CACHE_HOME") or home / ".cache")
    return caches / "gamms" / name


@contextmanager
def made_folder(folder: Path) -> Iterator[None]:
    """Make a folder for what the `with` block writes; an error that leaves nothing in it takes it away again.

    Raises:
        BadValue: there is a file of this name, or of that of a folder that it is in.
        OSError: it cannot be made.
    """
    made = [one for one in (folder, *folder.parents) if not one.exists()]
    last = [folder, *folder.parents][len(made)]
    if not last.is_dir():
        where = "" if last == folder else f", so that {str(folder)!r} cannot be made"
        raise BadValue(f"There is {str(last)!r} already, and it is not a folder{where}. Name another folder.")
    folder.mkdir(parents=True, exist_ok=True)
    try:
        yield
    except BaseException:
        with suppress(OSError):  # of one that is not empty
            for one in made:
                one.rmdir()
        raise


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Keep other runs, of this process and of others, from a folder; a process that has died keeps none.

    The file of the lock is there only as long as the lock, so that a run that is refused leaves no folder.

    Raises:
        BadFile: there is something else in the place of the file of the lock.
        WriteConflict: another run has it.
    """
    real = folder.resolve()
    refusal = WriteConflict(f"Another run is writing into {str(folder)!r}: wait for it, or choose another folder.")
    if real in _held:
        raise refusal
    file = real / LOCK
    with made_folder(folder), opened(file, "ab") as stream:
        # Another run may have deleted the file between the two calls.
        if not _locks(stream) or not (file.exists() and os.path.samestat(file.stat(), os.fstat(stream.fileno()))):
            raise refusal
        _held.add(real)
        try:
            yield
        finally:
            _held.discard(real)
            with suppress(OSError):  # where what is open cannot be deleted
                file.unlink()


if sys.platform == "win32":  # pragma: no cover

    def _locks(file: BinaryIO) -> bool:
        import msvcrt

        try:
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        return True

else:

    def _locks(file: BinaryIO) -> bool:
        """Lock a file until this process closes it; forked children do not have the lock."""
        import fcntl

        try:
            fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            return False
        return True


# -- writing ------------------------------------------------------------------------------------------------------


def write_whole(path: Path, data: bytes, *, through_links: bool = False) -> None:
    """Put a file in its place in one step.

    Args:
        path: the file.
        data: what is in it.
        through_links: see `whole_file`.

    Raises:
        OSError: it cannot be written; nothing has changed then.
    """
    with whole_file(path, through_links=through_links) as beside:
        beside.write_bytes(data)


@contextmanager
def whole_file(path: Path, *, through_links: bool = False) -> Iterator[Path]:
    """A file to be written in the `with` block, which is put in its place at the end; an error leaves nothing of it.

    Args:
        path: the file. A link, pipe or device of its name is replaced by the file, unless `through_links`.
        through_links: for a file that the user has named, not one within a folder of results: write to the target of a
            symbolic link, and to a pipe or device, all of which stay.

    Raises:
        OSError: it cannot be put there; nothing has changed then.
    """
    if through_links and path.exists() and not path.is_file() and not path.is_dir():
        with naming(path, path):
            yield path
        return
    real = Path(os.path.realpath(path)) if through_links else path
    beside = real.with_name(f".{real.name}.{os.getpid()}.{threading.get_ident()}.part")
    try:
        with naming(path, beside):
            yield beside
            beside.replace(real)
    finally:
        with suppress(OSError):
            beside.unlink()


@contextmanager
def naming(path: Path, beside: Path) -> Iterator[None]:
    """Let errors of the system name the file that could not be written.

    Those of `write` name none, and others the file beside it that a caller knows nothing of.

    Raises:
        OSError: with the path.
    """
    try:
        yield
    except OSError as error:
        if error.filename is None or os.fspath(error.filename) == str(beside):
            raise OSError(error.errno, error.strerror, str(path)) from error
        raise


def write_csv(file: Path, columns: Iterable[str], rows: Iterable[Iterable[object]], *, end: str = "\r\n") -> None:
    """Write a table as CSV, in which no cell is a formula of a spreadsheet (see `as_cell`).

    Args:
        file: the file.
        columns: their names.
        rows: the cells of each row.
        end: of a line.

    Raises:
        OSError: it cannot be written.
    """
    with file.open("w", newline="", encoding="utf-8", errors=_ESCAPED) as stream:
        writer = csv.writer(stream, lineterminator=end)
        writer.writerow(map(as_cell, columns))
        writer.writerows(map(as_cell, row) for row in rows)


def without_link(file: Path) -> Path:
    """Return the path of a file in a folder of results, after removing a link in its place.

    Raises:
        OSError: the link cannot be removed.
    """
    if file.is_symlink():
        file.unlink()
    return file


def refuse_link(folder: Path) -> None:
    """Check that a folder within a folder of results is no link to another one.

    Raises:
        BadFile: it is a link.
    """
    if folder.is_symlink():
        _refuse(folder, "a folder")


# -- reading ------------------------------------------------------------------------------------------------------


def opened(file: Path, mode: Literal["rb", "ab", "r+b"]) -> BinaryIO:
    """Open a regular file of a folder, and wait for nothing.

    Raises:
        BadFile: it is a link, a folder, a pipe, a socket or a device.
        OSError: it cannot be opened.
    """
    return open(file, mode, opener=_regular)


def _regular(path: str, flags: int) -> int:
    safe = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    try:
        number = os.open(path, flags | safe, 0o666)
    except OSError as error:
        if error.errno in (errno.ENOENT, errno.EACCES) or stat.S_ISREG(os.lstat(path).st_mode):
            raise
        _refuse(Path(path), "a file")
    if not stat.S_ISREG(os.fstat(number).st_mode):
        os.close(number)
        _refuse(Path(path), "a file")
    return number


_KINDS = {
    stat.S_IFLNK: "a link",
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFDIR: "a folder",
    stat.S_IFREG: "a file",
}


def _refuse(path: Path, wanted: str) -> NoReturn:
    found = _KINDS.get(stat.S_IFMT(path.lstat().st_mode), "a device")
    raise BadFile(
        f"{str(path)!r} must be {wanted}, and it is {found}, which a folder of results does not hold. Remove it, or "
        "use another folder."
    )


def bytes_of(file: Path, most: int | None = None) -> bytes:
    """Return what is in a regular file of a folder.

    Args:
        file: the file.
        most: how many bytes it may have; None: as many as fit into the memory that a file may take.

    Raises:
        BadFile: it is another kind of file, or has more.
        TooLarge: reading it would take more memory than is allowed.
        OSError: it cannot be read.
    """
    with opened(file, "rb") as stream:
        size = os.fstat(stream.fileno()).st_size
        if most is None:
            refuse_above(size, f"Reading {str(file)!r}")
        data = stream.read((size if most is None else most) + 1)
    if most is not None and len(data) > most:
        raise BadFile(f"{str(file)!r} has more than {most:,} bytes.")
    return data


def json_in(file: Path, what: str, kind: type[T]) -> T:
    """Return the value in a file of JSON.

    Args:
        file: the file.
        what: the subject that the file must be, for the message, such as "the plan of an experiment".
        kind: the type of the value, such as a TypedDict with the keys that it must have.

    Raises:
        BadFile: it is no regular file, not JSON, or holds another value.
        TooLarge: it would take more memory than is allowed.
        OSError: it cannot be read.
    """
    data = _bounded(file)
    try:
        return as_kind(_value(data), kind)
    except BadFile as error:
        raise BadFile(f"{str(file)!r} is not {what}: {error}. Use another folder.") from None


def lines_in(file: Path, what: str, *kinds: type[object]) -> list[dict[str, Any]]:
    """Return the objects in a file of JSON lines; [] if there is none.

    A last line without an end, where a program was killed, counts as not there.

    Args:
        file: the file.
        what: what each line must be, for the message, such as "a row".
        kinds: the types that each object must have, such as a TypedDict with keys; it may have others.

    Raises:
        BadFile: it is no regular file, or a line is no such object.
        TooLarge: it would take more memory than is allowed.
        OSError: it cannot be read.
    """
    try:
        data = _bounded(file)
    except FileNotFoundError:
        return []
    found: list[dict[str, Any]] = []
    shapes: list[type[object]] = [dict[str, Any], *kinds]
    for number, line in enumerate(data[: data.rfind(b"\n") + 1].splitlines(), 1):
        try:
            value = _value(line)
            for kind in shapes:
                as_kind(value, kind)
        except BadFile as error:
            raise damaged(file, number, what, str(error)) from None
        found.append(value)
    return found


def damaged(file: Path, number: int, what: str, why: str) -> BadFile:
    """Return the error for a line of a file of JSON lines."""
    return BadFile(f"{str(file)!r}, line {number}, is not {what}: {why}. Delete the line, or use another folder.")


def add_lines(file: Path, lines: Iterable[Mapping[str, object]]) -> None:
    """Append objects to a file of JSON lines, all at once.

    Raises:
        BadFile: it is no regular file.
        OSError: it cannot be written.
    """
    with naming(file, file), opened(file, "ab") as stream:
        stream.write(as_lines(lines))


def cut_torn_line(file: Path) -> None:
    """Cut a last line without an end, where a program was killed, off a file of JSON lines, if there is the file.

    Raises:
        BadFile: it is no regular file.
        OSError: it cannot be written.
    """
    with suppress(FileNotFoundError), opened(file, "r+b") as stream:
        stream.truncate(stream.read().rfind(b"\n") + 1)


def as_lines(values: Iterable[Mapping[str, object]]) -> bytes:
    """Return objects as lines of JSON; a half of a surrogate pair, which no file may hold, becomes a question mark."""
    return "".join(f"{json.dumps(one, ensure_ascii=False)}\n" for one in values).encode(errors="replace")


def as_kind(value: object, kind: type[T]) -> T:
    """Return a value of a file as the type that it must have.

    Raises:
        BadFile: it is another; the message says where.
    """
    import msgspec

    try:
        return msgspec.convert(value, kind)
    except msgspec.ValidationError as error:
        raise BadFile(reason(error)) from None


def _bounded(file: Path) -> bytes:
    """Return the bytes of a file of JSON whose values take no more memory than is allowed."""
    data = bytes_of(file)
    values = sum(data.count(sign) * size for sign, size in _BYTES_PER_VALUE.items())
    refuse_above(len(data) * _BYTES_PER_LETTER + values, f"Reading {str(file)!r}")
    return data


def _value(data: bytes) -> Any:
    """Return the value of a text of JSON.

    Raises:
        BadFile: it is no JSON, or holds what we do not write: NaN, very long integers, very deep lists, halves of
            surrogate pairs.
    """
    try:
        text = data.decode()
        value = json.loads(text, parse_int=_integer, parse_constant=_constant)
    except RecursionError:
        raise BadFile(f"it is nested more than {_DEEPEST} levels deep") from None
    except ValueError as error:
        raise BadFile(f"it is not JSON: {reason(error)}") from None
    if data.count(b"[") + data.count(b"{") > _DEEPEST:
        _check_depth(value)
    if "\\u" in text:
        _check_texts(value)
    return value


def _check_depth(value: object) -> None:
    level: list[object] = [value]
    for _ in range(_DEEPEST):
        level = [one for holder in level for one in _items_of(holder)]
    if level:
        raise BadFile(f"it is nested more than {_DEEPEST} levels deep")


def _check_texts(value: object) -> None:
    try:
        json.dumps(value, ensure_ascii=False).encode()
    except UnicodeEncodeError:
        raise BadFile("it has a text with half of a surrogate pair") from None


def _items_of(value: object) -> Iterable[object]:
    if isinstance(value, dict):
        return value.values()
    return value if isinstance(value, list) else ()


def _integer(text: str) -> int:
    if len(text) > _MOST_DIGITS:
        raise ValueError(f"an integer has {len(text):,} digits")
    return int(text)


def _constant(name: str) -> float:
    if name == "NaN":
        raise ValueError("NaN is no number")
    return float(name)
