"""What a recording is written to and read from: paths, and streams of the caller's own."""

import io
import os
from pathlib import Path
from typing import Any, BinaryIO

from gamms.errors import BadType

_SUFFIX = ".ggr"


def writable(path: Any) -> tuple[BinaryIO, bool]:
    """A stream to write to, and whether it was opened here.

    Raises:
        FileExistsError: there is such a file.
        BadType (TypeError): this is neither a path nor a binary stream.
    """
    if isinstance(path, (str, os.PathLike)):
        file = Path(path)
        file = file if file.name.endswith(_SUFFIX) else Path(f"{file}{_SUFFIX}")
        if file.exists():
            raise FileExistsError(f"There is a file {str(file)!r} already; choose another name or delete it first.")
        return file.open("xb"), True
    if hasattr(path, "write") and not isinstance(path, io.TextIOBase):
        return path, False
    raise BadType(f"A recording is written to a path or a binary stream, not to {path!r}.")


def readable(path: Any) -> tuple[BinaryIO, bool]:
    """A stream that can seek, and whether it was opened here; the suffix of a path may be left out.

    Raises:
        FileNotFoundError: there is no such file.
        BadType (TypeError): this is neither a path nor a binary stream.
    """
    if isinstance(path, (str, os.PathLike)):
        file = Path(path)
        if not file.exists() and file.suffix != _SUFFIX:
            file = Path(f"{file}{_SUFFIX}")
        return file.open("rb"), True
    if hasattr(path, "read") and not isinstance(path, io.TextIOBase):
        stream: BinaryIO = path if path.seekable() else io.BytesIO(path.read())
        return stream, False
    raise BadType(f"A recording is read from a path or a binary stream, not from {path!r}.")
