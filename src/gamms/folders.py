"""Folders of the user and of runs, and how a file is written: completely or not at all."""

import os
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from gamms.errors import BadValue, WriteConflict

_LOCK = "lock"
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
        WriteConflict: another run has it.
    """
    real = folder.resolve()
    refusal = WriteConflict(f"Another run is writing into {str(folder)!r}: wait for it, or choose another folder.")
    if real in _held:
        raise refusal
    file = real / _LOCK
    with made_folder(folder), file.open("ab") as stream:
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


def write_whole(path: Path, data: bytes) -> None:
    """Put a file in its place in one step.

    Raises:
        OSError: it cannot be written; nothing has changed then.
    """
    with whole_file(path) as beside:
        beside.write_bytes(data)


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A file to be written in the `with` block, which is put in its place at the end; an error leaves nothing of it.

    What a symbolic link leads to is written, and the link stays. What is there and is no file, such as a device or a
    pipe, is written to, and stays as well.

    Raises:
        OSError: it cannot be put there; nothing has changed then.
    """
    if path.exists() and not path.is_file() and not path.is_dir():
        with naming(path, path):
            yield path
        return
    real = Path(os.path.realpath(path))
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
