"""The folder that the process of an entry writes in: measured and removed, whatever the entry has put there.

Folders are opened by name within the folder above them, never by a path: names may be long, folders may lie deep in
each other, and links may lead elsewhere.
"""

import logging
import os
import secrets
import stat
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from gamms.tournament.confinement import LONGEST_FILE

_MOST_BYTES = 1 << 24
_MOST_FILES = 1_000  # folders included
_MOST_DEPTH = 32  # of folders in each other
_AS_FOLDER = os.O_RDONLY
if sys.platform != "win32":  # where no tournament is played
    _AS_FOLDER |= os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC


class Overfull(Exception):
    """The folder holds more than an entry may write; the message says what."""


def check_folder(folder: str, process: int) -> None:
    """Check how much a process holds on the disk: the files in its folder, and deleted files that it still uses.

    Raises:
        Overfull: it is more than allowed, or cannot be measured.
    """
    size, count = 0, 0
    try:
        size = _deleted_bytes(folder, process)
        for length in _sizes(folder, None, 0):
            size += length
            count += 1
            if count > _MOST_FILES:
                raise Overfull(f"it made more than {_MOST_FILES:,} files and folders")
    except OSError as error:
        raise Overfull(f"its files cannot be measured: {error.strerror}") from None
    if size > _MOST_BYTES:
        raise Overfull(f"its files have more than {_MOST_BYTES:,} bytes")


def _sizes(name: str, above: int | None, depth: int) -> Iterator[int]:
    """Yield the sizes of all files and folders in a folder."""
    if depth > _MOST_DEPTH:
        raise Overfull(f"it made more than {_MOST_DEPTH} folders in each other")
    opened = os.open(name, _AS_FOLDER, dir_fd=above)
    try:
        with os.scandir(opened) as found:
            for one in found:
                with suppress(FileNotFoundError):  # removed meanwhile
                    yield one.stat(follow_symlinks=False).st_size
                    if one.is_dir(follow_symlinks=False):
                        yield from _sizes(one.name, opened, depth + 1)
    finally:
        os.close(opened)


def _deleted_bytes(folder: str, process: int) -> int:
    """Return the size of files of the folder that have no name any more, and are open in a process or mapped by it."""
    mark, end = os.fsencode(f"/{Path(folder).name}/"), b" (deleted)"
    place = Path("/proc", str(process))
    sizes: dict[int, int] = {}
    try:
        for one in (place / "fd").iterdir():
            with suppress(FileNotFoundError):  # closed meanwhile
                target = os.fsencode(one.readlink())
                if mark in target and target.endswith(end):
                    status = one.stat()
                    sizes[status.st_ino] = status.st_size
        for line in (place / "maps").read_bytes().splitlines():
            if mark in line and line.endswith(end):
                inode = int(line.split(maxsplit=5)[4])
                sizes.setdefault(inode, LONGEST_FILE)  # only the kernel knows its size
    except (FileNotFoundError, ProcessLookupError):  # not on this system, or the process has ended
        return 0
    except PermissionError:
        if b"VmRSS" in (place / "status").read_bytes():
            raise
        return 0  # the process is about to end
    return sum(sizes.values())


def remove_folder(folder: str | os.PathLike[str]) -> None:
    """Remove a folder in which no process writes any more; leave what cannot be removed, with a warning."""
    try:
        top = os.open(folder, _AS_FOLDER)
        try:
            while inside := _inside(top):
                for one in inside:
                    _remove_level(one, top)
        finally:
            os.close(top)
        Path(folder).rmdir()
    except FileNotFoundError:
        return
    except OSError as error:
        logging.getLogger("gamms").warning("The folder %r could not be removed: %s.", os.fspath(folder), error.strerror)


def _remove_level(one: os.DirEntry[str], top: int) -> None:
    """Remove a file, or a folder after its own folders were moved to the top, so that no folder is too deep."""
    if not one.is_dir(follow_symlinks=False):
        os.unlink(one.name, dir_fd=top)
        return
    os.chmod(one.name, stat.S_IRWXU, dir_fd=top)
    opened = os.open(one.name, _AS_FOLDER, dir_fd=top)
    try:
        for below in _inside(opened):
            if below.is_dir(follow_symlinks=False):
                os.chmod(below.name, stat.S_IRWXU, dir_fd=opened)  # moving a folder writes in it
                os.rename(below.name, secrets.token_hex(), src_dir_fd=opened, dst_dir_fd=top)
            else:
                os.unlink(below.name, dir_fd=opened)
    finally:
        os.close(opened)
    os.rmdir(one.name, dir_fd=top)


def _inside(opened: int) -> list[os.DirEntry[str]]:
    with os.scandir(opened) as found:
        return list(found)
