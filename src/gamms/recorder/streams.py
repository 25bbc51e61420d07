"""Files and streams of recordings."""

import io
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO, Self, SupportsIndex

from gamms.arguments import as_path, refuse_suffix
from gamms.errors import BadType, MissingFile, MissingFolder
from gamms.readonly import NotPickled
from gamms.recorder.errors import RecorderBusy, RecordingError
from gamms.text import shown
from gamms.typing.recorder import MAGIC_NUMBER

_SUFFIX = ".ggr"
_SCENARIOS = (".yaml", ".yml")
_PathOrStream = str | os.PathLike[str] | BinaryIO | io.TextIOBase  # the last one, text, is refused


def make_path(path: str | os.PathLike[str]) -> Path:
    """Return the path of a new recording, with the default suffix if it has none.

    Raises:
        BadValue: the suffix is that of a film, a picture, or another kind of file.
    """
    file = as_path(path, "The path of a recording")
    refuse_suffix(file, "A recording", _SUFFIX)
    return file if file.name.endswith(_SUFFIX) else Path(f"{file}{_SUFFIX}")


class StreamOwner(NotPickled):
    """A reader of a stream that closes the stream if it opened it."""

    _not_pickled = "An open file can neither be pickled nor copied: pass on its path, and open it again there."

    def __init__(self, owned: BinaryIO | None) -> None:
        self._owned = owned

    def __reduce_ex__(self, protocol: SupportsIndex) -> Any:
        """Refuse to be pickled with an open file."""
        if self._owned is None:
            return object.__reduce_ex__(self, protocol)
        return super().__reduce_ex__(protocol)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file if this object opened it."""
        if self._owned is not None:
            self._owned.close()


class RecordingTarget:
    """The destination of a recording: a stream of the caller, or a new file.

    Attributes:
        stream: the stream to write to.
        is_owned: whether the file was opened here.

    Args:
        path: path of the file, with the default suffix; or a binary stream.
        overwrite: whether to replace an existing file, on `keep`.

    Raises:
        FileExistsError: the file exists.
        RecorderBusy (RuntimeError): the file is being recorded or replayed.
        BadType (TypeError): neither a path nor a binary stream.
    """

    def __init__(self, path: _PathOrStream, *, overwrite: bool = False) -> None:
        self.is_owned = False
        self._old: BinaryIO | None = None
        if isinstance(path, str | os.PathLike):
            self.stream: BinaryIO = self._open_new_file(path, overwrite=overwrite)
            self.is_owned = True
        elif hasattr(path, "write") and not isinstance(path, io.TextIOBase):
            self.stream = path
        else:
            raise BadType(f"A recording is written to a path or a binary stream, not to {shown(path)}.")

    def _open_new_file(self, path: str | os.PathLike[str], *, overwrite: bool) -> BinaryIO:
        file = make_path(path)
        self._at = Path(os.path.realpath(file)) if overwrite else file
        self._path = self._at
        if self._path.exists():
            if not overwrite:
                raise FileExistsError(
                    f"The file {str(file)!r} already exists; choose another name, delete it, or pass overwrite=True."
                )
            self._old = self._path.open("rb")
            if not lock_file(self._old, alone=True):
                self._close_old()
                raise RecorderBusy(
                    f"{str(file)!r} is being recorded or replayed; choose another name or stop that first."
                )
            self._at = self._path.with_name(f".{self._path.name}.{os.getpid()}.part")
        try:
            stream = self._at.open("xb" if self._old is None else "wb")
        except OSError as error:
            self._close_old()
            if isinstance(error, FileNotFoundError):
                raise MissingFolder(file.name, file.parent) from None
            raise
        lock_file(stream, alone=True)
        return stream

    def keep(self) -> None:
        """Move the finished file to its path."""
        if self._old is not None:
            self._at.replace(self._path)
            self._close_old()

    def discard(self) -> None:
        """Delete the unfinished file, and leave an existing one unchanged."""
        if self.is_owned:
            self.stream.close()
            self._at.unlink(missing_ok=True)
        self._close_old()

    def _close_old(self) -> None:
        if self._old is not None:
            self._old.close()

    def close(self) -> bool:
        """Close the stream if it was opened here; return False if the file was removed meanwhile."""
        has_name = not self.is_owned or self.stream.closed or os.fstat(self.stream.fileno()).st_nlink > 0
        if self.is_owned or not isinstance(self.stream, io.BytesIO):
            self.stream.close()
        return has_name


@contextmanager
def open_output(path: _PathOrStream, *, overwrite: bool = False) -> Iterator[BinaryIO]:
    """Yield a stream to write a whole recording; on an error an existing file is unchanged. See `RecordingTarget`."""
    target = RecordingTarget(path, overwrite=overwrite)
    try:
        yield target.stream
        target.keep()
    except BaseException:
        target.discard()
        raise
    if target.is_owned:
        target.close()


def open_readable(path: _PathOrStream) -> tuple[BinaryIO, bool]:
    """Return a seekable stream, and whether it was opened here; the suffix of a path may be left out.

    Raises:
        FileNotFoundError: the file does not exist.
        RecordingError (ValueError): a folder or a scenario file.
        BadType (TypeError): neither a path nor a binary stream.
    """
    if isinstance(path, (str, os.PathLike)):
        file = as_path(path, "The path of a recording")
        if not file.exists() and file.suffix != _SUFFIX:
            file = Path(f"{file}{_SUFFIX}")
        refuse_other(file)
        if not file.exists():
            raise MissingFile("a recording", file)
        stream = file.open("rb")
        if read_format(stream) < 0:
            stream.close()
            raise RecordingError(f"{str(file)!r} is not a recording: it does not begin with 'MMGR' and a version.")
        return stream, True
    if hasattr(path, "read") and not isinstance(path, io.TextIOBase):
        return path if path.seekable() else io.BytesIO(path.read()), False
    raise BadType(f"A recording is read from a path or a binary stream, not from {shown(path)}.")


def refuse_other(file: Path) -> None:
    """Raise RecordingError for a folder, a pipe or device, and a scenario file."""
    if file.is_dir():
        held = sorted(file.glob(f"*{_SUFFIX}"))
        hint = f": give the file in it, {str(held[0])!r}." if held else ", which contains none."
        raise RecordingError(f"{str(file)!r} is a folder, not a recording{hint}")
    if file.exists() and not file.is_file():
        raise RecordingError(f"{str(file)!r} is a pipe, socket or device, not a recording.")
    if file.suffix.lower() in _SCENARIOS and file.exists():
        raise RecordingError(f"{str(file)!r} is not a recording: `gamms run` plays scenarios.")


def read_format(stream: BinaryIO) -> int:
    """Return the format version of the recording at the present position of a stream; -1 if there is none."""
    head = stream.read(8)
    stream.seek(-len(head), os.SEEK_CUR)
    return int.from_bytes(head[4:], "big") if head[:4] == MAGIC_NUMBER and len(head) == 8 else -1


def lock_file(stream: BinaryIO, *, alone: bool) -> bool:
    """Lock a file while it is open, exclusively or shared; return False if it is locked by others.

    Does nothing on systems or files without locks.
    """
    try:
        import fcntl

        fcntl.flock(stream.fileno(), (fcntl.LOCK_EX if alone else fcntl.LOCK_SH) | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except (ImportError, OSError):
        pass
    return True
