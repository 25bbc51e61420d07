"""Safe files in folders of the user and of results: bounded reading, and writing that is complete or has no effect.

A folder of results may come from an untrusted source. `open_regular_file`, and all functions that use it, accept only
regular
files: links, pipes, sockets and devices are refused. Nothing is written through a link either.
"""

import csv
import errno
import json
import os
import shutil
import stat
import sys
import tempfile
import threading
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from itertools import chain
from pathlib import Path
from typing import Any, BinaryIO, Literal, NoReturn, TypeVar

from gamms.errors import BadFile, BadValue, MissingFolder, WriteConflict
from gamms.limits import refuse_above
from gamms.text import as_cell, reason

T = TypeVar("T")

Scalar = bool | int | float | str | None
"""The type of a value in a row of a table."""

LOCK = "lock"
_SAFE = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)  # flags of calls that follow no link and never wait
_CLAIMS = 3  # attempts to take a place from a program that was killed
_DEEPEST = 64  # levels of JSON; a scenario, which may have 40, is in a plan
_MOST_DIGITS = 300  # of an integer, which then fits into a float
_BYTES_PER_LETTER = 4  # of memory for each byte of JSON: a text with an emoji has four bytes for each letter
_BYTES_PER_VALUE = {b",": 80, b"{": 250, b"[": 100, b"\n": 100}  # and for each sign that begins a value
_ESCAPED = "backslashreplace"  # halves of surrogate pairs
_held: dict[str, object] = {}  # folder -> its holder in this process, whose locks do not exclude each other


def find_home_folder() -> Path:
    """Return the home folder of the user; if it is unknown, as in some containers, the folder of temporary files."""
    try:
        return Path.home()
    except RuntimeError:
        return Path(tempfile.gettempdir())


def cache_folder(name: str) -> Path:
    """The folder of that name in the user's own cache folder; it may have to be made."""
    home = find_home_folder()
    if sys.platform == "win32":
        caches = Path(os.environ.get("LOCALAPPDATA") or home / "AppData" / "Local")
    elif sys.platform == "darwin":
        caches = home / "Library" / "Caches"
    else:
        caches = Path(os.environ.get("XDG_CACHE_HOME") or home / ".cache")
    return caches / "gamms" / name


@contextmanager
def make_folder(folder: Path) -> Iterator[None]:
    """Create a folder for a `with` block; after an error, remove it if it is empty.

    Raises:
        BadValue: a file has the name of the folder or of one of its parents.
        MissingFolder (FileNotFoundError): the folder above takes no new folders.
        OSError: the folder cannot be created.
    """
    made = [one for one in (folder, *folder.parents) if not one.exists()]
    last = [folder, *folder.parents][len(made)]
    if not last.is_dir():
        where = "" if last == folder else f", so that {str(folder)!r} cannot be made"
        raise BadValue(f"There is {str(last)!r} already, and it is not a folder{where}. Name another folder.")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except FileNotFoundError:
        raise MissingFolder(folder.relative_to(last), last) from None
    try:
        yield
    except BaseException:
        with suppress(OSError):  # of one that is not empty
            for one in made:
                one.rmdir()
        raise


@contextmanager
def lock_folder(folder: Path) -> Iterator[None]:
    """Lock a folder against other runs, in this and other processes; the lock of a dead process is void.

    The lock file exists only during the lock, so that a refused run leaves no folder.

    Raises:
        BadFile: the path of the lock file is not a regular file.
        WriteConflict: another run has locked the folder.
    """
    real = folder.resolve()
    refusal = WriteConflict(f"Another run is writing into {str(folder)!r}: wait for it, or choose another folder.")
    holder = object()
    if _held.setdefault(str(real), holder) is not holder:  # in one step, for threads
        raise refusal
    file = real / LOCK
    try:
        with make_folder(folder), open_regular_file(file, "ab") as stream:
            # Another run may have deleted the file between the two calls.
            is_ours = _lock_file(stream) and file.exists()
            if not is_ours or not os.path.samestat(file.stat(), os.fstat(stream.fileno())):
                raise refusal
            try:
                yield
            finally:
                with suppress(OSError):  # on systems that cannot delete open files
                    file.unlink()
    finally:
        del _held[str(real)]


if sys.platform == "win32":  # pragma: no cover

    def _lock_descriptor(_: int) -> bool:
        return False

    def _lock_file(file: BinaryIO) -> bool:
        import msvcrt

        try:
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        return True

else:

    def _lock_descriptor(number: int) -> bool:
        """Lock an open file or folder until all its descriptors are closed, for other threads, too."""
        import fcntl

        try:
            fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            return False
        return True

    def _lock_file(file: BinaryIO) -> bool:
        """Lock a file until this process closes it; forked children do not have the lock."""
        import fcntl

        try:
            fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            return False
        return True


# -- writing ------------------------------------------------------------------------------------------------------


def write_whole(path: Path, data: bytes, *, through_links: bool = False) -> None:
    """Write a file in one step: it is complete, or unchanged after an error.

    Args:
        path: the file.
        data: the new content.
        through_links: see `open_whole_file`.

    Raises:
        OSError: it cannot be written; nothing has changed then.
    """
    with open_whole_file(path, through_links=through_links) as beside:
        beside.write_bytes(data)


@contextmanager
def open_whole_file(path: Path, *, through_links: bool = False) -> Iterator[Path]:
    """Open a file that replaces `path` at the end of the `with` block; after an error, `path` is unchanged.

    Args:
        path: the file. A link, pipe or device at this path is replaced, unless `through_links`.
        through_links: write to the target of a symbolic link, and into a pipe or device; for files named by the user,
            not for files in a folder of results.

    Raises:
        OSError: the file cannot be written; nothing has changed.
    """
    if through_links and path.exists() and not path.is_file() and not path.is_dir():
        with add_path_to_errors(path, path):
            yield path
        return
    real = Path(os.path.realpath(path)) if through_links else path
    with make_place_beside(real) as beside, add_path_to_errors(path, beside):
        yield beside
        beside.replace(real)


@contextmanager
def make_place_beside(real: Path, *, is_folder: bool = False) -> Iterator[Path]:
    """Yield the path of an unfinished file beside `real`; it is deleted at the end, unless it was moved.

    The path is the same each time, so that the next writer replaces the file that a killed program has left. While
    another writer holds it, and on systems without locks for it, the path is that of this thread alone.

    Args:
        real: the path of the finished file, or of the finished folder.
        is_folder: whether to make a folder; otherwise there may be an empty file.

    Raises:
        OSError: the folder cannot be made.
    """
    beside = real.with_name(f".{real.name}.part")
    lock = _claim_place(beside, is_folder=is_folder)
    if lock is None:
        beside = real.with_name(f".{real.name}.{os.getpid()}.{threading.get_ident()}.part")
        if is_folder:
            _delete(beside)
            beside.mkdir()
    try:
        yield beside
    finally:
        with suppress(OSError):
            if lock is None or os.path.samestat(beside.lstat(), os.fstat(lock)):  # else it was moved
                _delete(beside)
        if lock is not None:
            os.close(lock)


def _claim_place(place: Path, *, is_folder: bool) -> int | None:
    """Make an empty file or folder, and return a descriptor that locks it; None: another writer has it."""
    for _ in range(_CLAIMS):
        number = None
        try:
            if is_folder:
                with suppress(FileExistsError):
                    place.mkdir()
            number = os.open(place, os.O_RDONLY if is_folder else os.O_RDWR | os.O_CREAT | _SAFE, 0o666)
            kind = stat.S_IFMT(os.fstat(number).st_mode)
            is_mine = kind == (stat.S_IFDIR if is_folder else stat.S_IFREG) and _lock_descriptor(number)
            if is_mine and os.path.samestat(place.lstat(), os.fstat(number)):
                if not (any(place.iterdir()) if is_folder else os.fstat(number).st_size):
                    return number
                _delete(place)  # the rest of a killed program, with its own permissions
        except OSError:
            is_mine = False
        if number is not None:
            os.close(number)
        if not is_mine:
            return None
    return None


def _delete(place: Path) -> None:
    if place.is_dir() and not place.is_symlink():
        shutil.rmtree(place)
    else:
        place.unlink(missing_ok=True)


@contextmanager
def add_path_to_errors(path: Path, beside: Path) -> Iterator[None]:
    """Add the path of the file to system errors in the block.

    Errors of `write` name no file, and others name a temporary file that the caller does not know.

    Raises:
        MissingFolder (FileNotFoundError): the folder of the file does not exist, or takes no new files.
        OSError: another error occurred in the block; it now has the path.
    """
    try:
        yield
    except OSError as error:
        if error.filename is None or os.fspath(error.filename) == str(beside):
            if isinstance(error, FileNotFoundError):
                raise MissingFolder(path.name, path.parent) from None
            raise OSError(error.errno, error.strerror, str(path)) from error
        raise


def write_csv(file: Path, columns: Iterable[str], rows: Iterable[Iterable[object]], *, end: str = "\r\n") -> None:
    """Write a table as CSV; spreadsheets take no cell for a formula (see `as_cell`).

    Args:
        file: the file.
        columns: the names of the columns.
        rows: the cells of each row.
        end: the line terminator.

    Raises:
        OSError: the file cannot be written.
    """
    with file.open("w", newline="", encoding="utf-8", errors=_ESCAPED) as stream:
        writer = csv.writer(stream, lineterminator=end)
        writer.writerow(map(as_cell, columns))
        writer.writerows(map(as_cell, row) for row in rows)


def remove_link(file: Path) -> Path:
    """Return the path of a file in a folder of results, after removing a link in its place.

    Raises:
        OSError: the link cannot be removed.
    """
    if file.is_symlink():
        file.unlink()
    return file


def refuse_link(folder: Path) -> None:
    """Check that a folder in a folder of results is not a link.

    Raises:
        BadFile: it is a link.
    """
    if folder.is_symlink():
        _refuse(folder, "a folder")


# -- reading ------------------------------------------------------------------------------------------------------


def open_regular_file(file: Path, mode: Literal["rb", "ab", "r+b"]) -> BinaryIO:
    """Open a regular file without blocking.

    Raises:
        BadFile: it is a link, a folder, a pipe, a socket or a device.
        OSError: it cannot be opened.
    """
    return open(file, mode, opener=_open_regular)


def _open_regular(path: str, flags: int) -> int:
    try:
        number = os.open(path, flags | _SAFE, 0o666)
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
        f"{str(path)!r} must be {wanted}, and it is {found}, which a folder of results never contains. Remove it, "
        "or use another folder."
    )


def read_bytes(file: Path, most: int | None = None) -> bytes:
    """Read a regular file.

    Args:
        file: the file.
        most: the maximum size in bytes; None: the memory limit for files.

    Raises:
        BadFile: the file is not regular, or too large.
        TooLarge: reading it would take more memory than is allowed.
        OSError: it cannot be read.
    """
    with open_regular_file(file, "rb") as stream:
        size = os.fstat(stream.fileno()).st_size
        if most is None:
            refuse_above(size, f"Reading {str(file)!r}")
        data = stream.read((size if most is None else most) + 1)
    if most is not None and len(data) > most:
        raise BadFile(f"{str(file)!r} has more than {most:,} bytes.")
    return data


def read_json(file: Path, what: str, kind: type[T]) -> T:
    """Read a JSON file, and check the type of its value.

    Args:
        file: the file.
        what: the expected content for messages, such as "the plan of an experiment".
        kind: the type of the value, such as a TypedDict with the keys that it must have.

    Raises:
        BadFile: the file is not regular, not JSON, or has a value of another type.
        TooLarge: it would take more memory than is allowed.
        OSError: it cannot be read.
    """
    data = _read_bounded(file)
    try:
        return as_kind(_parse_value(data), kind)
    except BadFile as error:
        raise BadFile(f"{str(file)!r} is not {what}: {error}. Use another folder.") from None


def read_json_lines(file: Path, what: str, *kinds: type[object]) -> list[dict[str, Any]]:
    """Read a file of JSON lines; an empty list if the file does not exist.

    An unterminated last line, left by a killed program, is ignored.

    Args:
        file: the file.
        what: the expected content of a line for messages, such as "a row".
        kinds: the types that each object must match, such as a TypedDict; further keys are allowed.

    Raises:
        BadFile: the file is not regular, or a line does not match.
        TooLarge: it would take more memory than is allowed.
        OSError: it cannot be read.
    """
    try:
        data = _read_bounded(file)
    except FileNotFoundError:
        return []
    found: list[dict[str, Any]] = []
    shapes: list[type[object]] = [dict[str, Any], *kinds]
    for number, line in enumerate(data[: data.rfind(b"\n") + 1].splitlines(), 1):
        try:
            value = _parse_value(line)
            for kind in shapes:
                as_kind(value, kind)
        except BadFile as error:
            raise make_line_error(file, number, what, str(error)) from None
        found.append(value)
    return found


def make_line_error(file: Path, number: int, what: str, why: str) -> BadFile:
    """Return the error for a line of a file of JSON lines."""
    return BadFile(f"{str(file)!r}, line {number}, is not {what}: {why}. Delete the line, or use another folder.")


def add_lines(file: Path, lines: Iterable[Mapping[str, object]]) -> None:
    """Append objects to a file of JSON lines in one write.

    Raises:
        BadFile: the file is not a regular file.
        OSError: the file cannot be written.
    """
    with add_path_to_errors(file, file), open_regular_file(file, "ab") as stream:
        stream.write(as_lines(lines))


def cut_torn_line(file: Path) -> None:
    """Remove an unterminated last line, left by a killed program, from a file of JSON lines; the file need not exist.

    Raises:
        BadFile: the file is not a regular file.
        OSError: the file cannot be written.
    """
    with suppress(FileNotFoundError), open_regular_file(file, "r+b") as stream:
        stream.truncate(stream.read().rfind(b"\n") + 1)


def as_lines(values: Iterable[Mapping[str, object]]) -> bytes:
    """Encode objects as JSON lines; lone surrogates, which files cannot store, become question marks."""
    return "".join(f"{json.dumps(one, ensure_ascii=False)}\n" for one in values).encode(errors="replace")


def as_kind(value: object, kind: type[T]) -> T:
    """Convert a value from a file to a type, and check it.

    Raises:
        BadFile: the value has another type; the message names the place.
    """
    import msgspec

    try:
        return msgspec.convert(value, kind)
    except msgspec.ValidationError as error:
        raise BadFile(reason(error)) from None


def _read_bounded(file: Path) -> bytes:
    """Return the bytes of a file of JSON whose values take no more memory than is allowed."""
    data = read_bytes(file)
    values = sum(data.count(sign) * size for sign, size in _BYTES_PER_VALUE.items())
    refuse_above(len(data) * _BYTES_PER_LETTER + values, f"Reading {str(file)!r}")
    return data


def _parse_value(data: bytes) -> Any:
    """Parse JSON strictly.

    Raises:
        BadFile: the text is not JSON, or contains values that GAMMS never writes: NaN, very long integers, very deep
            lists, lone surrogates.
    """
    try:
        text = data.decode()
        value = json.loads(text, parse_int=_parse_integer, parse_constant=_refuse_constant)
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
        level = list(chain.from_iterable(_list_items(holder) for holder in level))
    if level:
        raise BadFile(f"it is nested more than {_DEEPEST} levels deep")


def _check_texts(value: object) -> None:
    try:
        json.dumps(value, ensure_ascii=False).encode()
    except UnicodeEncodeError:
        raise BadFile("it has a text with half of a surrogate pair") from None


def _list_items(value: object) -> Iterable[object]:
    if isinstance(value, dict):
        return value.values()
    return value if isinstance(value, list) else ()


def _parse_integer(text: str) -> int:
    if len(text) > _MOST_DIGITS:
        raise ValueError(f"an integer has {len(text):,} digits")
    return int(text)


def _refuse_constant(name: str) -> float:
    if name == "NaN":
        raise ValueError("NaN is no number")
    return float(name)
