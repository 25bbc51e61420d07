"""The scratch folder of an entry's process: measure and remove it, whatever the entry has put there.

Folders are opened by name relative to their parent, never by a path: names may be long, folders may be nested deeply,
and links may lead elsewhere.
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
_MOST_DEPTH = 32  # of nested folders
_AS_FOLDER = os.O_RDONLY
if sys.platform != "win32":  # no tournaments on Windows
    _AS_FOLDER |= os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC


class ScratchLimitExceeded(Exception):
    """A scratch folder exceeds its limits; the message says which."""


def check_folder(folder: str, process: int) -> None:
    """Check how much disk space a process uses: files in its folder, and deleted files that are still open.

    Raises:
        ScratchLimitExceeded: it is more than allowed, or cannot be measured.
    """
    size = 0
    count = 0
    try:
        size = _count_deleted_bytes(folder, process)
        for length in _list_sizes(folder, None, 0):
            size += length
            count += 1
            if count > _MOST_FILES:
                raise ScratchLimitExceeded(f"it made more than {_MOST_FILES:,} files and folders")
    except OSError as error:
        raise ScratchLimitExceeded(f"its files cannot be measured: {error.strerror}") from None
    if size > _MOST_BYTES:
        raise ScratchLimitExceeded(f"its files have more than {_MOST_BYTES:,} bytes")


def _list_sizes(name: str, above: int | None, depth: int) -> Iterator[int]:
    """Yield the sizes of all files and folders in a folder."""
    if depth > _MOST_DEPTH:
        raise ScratchLimitExceeded(f"it made more than {_MOST_DEPTH} folders in each other")
    opened = os.open(name, _AS_FOLDER, dir_fd=above)
    try:
        with os.scandir(opened) as found:
            for one in found:
                with suppress(FileNotFoundError):  # removed meanwhile
                    yield one.stat(follow_symlinks=False).st_size
                    if one.is_dir(follow_symlinks=False):
                        yield from _list_sizes(one.name, opened, depth + 1)
    finally:
        os.close(opened)


def _count_deleted_bytes(folder: str, process: int) -> int:
    """Return the size of deleted files of the folder that a process still holds open or mapped."""
    mark = os.fsencode(f"/{Path(folder).name}/")
    end = b" (deleted)"
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
    """Remove a folder that no process writes to any more; warn if something cannot be removed."""
    try:
        top = os.open(folder, _AS_FOLDER)
        try:
            while inside := _list_folder(top):
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
    """Remove a file; or move a folder's subfolders to the top, to avoid deep paths, and remove the folder."""
    if not one.is_dir(follow_symlinks=False):
        os.unlink(one.name, dir_fd=top)
        return
    os.chmod(one.name, stat.S_IRWXU, dir_fd=top)
    opened = os.open(one.name, _AS_FOLDER, dir_fd=top)
    try:
        for below in _list_folder(opened):
            if below.is_dir(follow_symlinks=False):
                os.chmod(below.name, stat.S_IRWXU, dir_fd=opened)  # moving a folder writes in it
                os.rename(below.name, secrets.token_hex(), src_dir_fd=opened, dst_dir_fd=top)
            else:
                os.unlink(below.name, dir_fd=opened)
    finally:
        os.close(opened)
    os.rmdir(one.name, dir_fd=top)


def _list_folder(opened: int) -> list[os.DirEntry[str]]:
    with os.scandir(opened) as found:
        return list(found)
