"""The default folders of files, and how a file is written: completely or not at all."""

import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


def cache_folder(name: str) -> Path:
    """The folder of that name in the user's own cache folder; it may have to be made."""
    home = Path.home()
    if sys.platform == "win32":
        caches = Path(os.environ.get("LOCALAPPDATA") or home / "AppData" / "Local")
    elif sys.platform == "darwin":
        caches = home / "Library" / "Caches"
    else:
        caches = Path(os.environ.get("XDG_CACHE_HOME") or home / ".cache")
    return caches / "gamms" / name


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
    path = Path(os.path.realpath(path))
    beside = path.with_name(f".{path.name}.{os.getpid()}.{threading.get_ident()}.part")
    try:
        with naming(path, beside):
            yield beside
            beside.replace(path)
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
