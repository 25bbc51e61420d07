"""The stream that a recording is written into: whole blocks, the last of which may be replaced by one longer block."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any, BinaryIO

from gamms.recorder.errors import RecordingError

_TROUBLES = (OSError, ValueError, TypeError, AttributeError)  # full, gone, closed, none at all


class Output:
    """What is settled, and behind it perhaps provisional blocks, which will be replaced."""

    def __init__(self, stream: BinaryIO) -> None:
        self.end = 0  # of what is settled, in bytes from where the recording begins
        self.is_closed = False
        self._length = 0  # of all that is there
        with self._watch():
            stream.flush()
            # What a buffer could not write it would try again when it is closed, and fail for the second time.
            self._stream: Any = getattr(stream, "raw", stream)
            self.can_overwrite = _can_overwrite(stream)
            # A buffer that is read as well keeps what it has read until it seeks the end.
            self._readable = stream if stream is not self._stream and stream.readable() else None
            self._begin = stream.tell() if self.can_overwrite else 0

    def check(self) -> None:
        """Refuse to go on after the end, or an error."""
        if self.is_closed:
            raise RecordingError(f"Nothing more can be recorded: this recording ended after byte {self._length}.")

    def append(self, data: bytes) -> None:
        """Write what stays, instead of what is provisional, which stays readable until that is done."""
        with self._watch():
            if self._length > self.end:
                self._write(max(self._length, self.end + len(data)), data)
                self._length = self.end  # if the next line fails, the copy stays
                self._write(self.end, data)
                self._stream.truncate(self._begin + self.end + len(data))
            else:
                self._write(self.end, data)
            self._length = self.end = self.end + len(data)
            self._show()

    def extend(self, data: bytes) -> None:
        """Write a provisional block behind all that is there.

        Requires: `can_overwrite`.
        """
        with self._watch():
            self._write(self._length, data)
            self._length += len(data)
            self._show()

    def back_to(self, end: int) -> None:
        """Make all that is there from a byte on provisional, even if writing it was interrupted."""
        self.end = end
        if self.can_overwrite:
            self._length = self._stream.seek(0, os.SEEK_END) - self._begin

    def close(self) -> None:
        """Refuse whatever else is written."""
        self.is_closed = True

    def _write(self, at: int, data: bytes) -> None:
        if self.can_overwrite:
            self._stream.seek(self._begin + at)
        left = memoryview(data)
        while left:
            written = self._stream.write(left)
            if not written:
                raise BlockingIOError("it takes nothing more at the moment")
            left = left[written:]
        self._stream.flush()

    def _show(self) -> None:
        """Make what was written visible through the object of the program."""
        if self._readable is not None:
            self._readable.seek(0, os.SEEK_END)

    @contextmanager
    def _watch(self) -> Iterator[None]:
        try:
            yield
        except _TROUBLES as error:
            self.is_closed = True
            raise RecordingError(
                f"The recording ends after byte {self._length}, because its stream could not be written: {error}. What "
                f"was written before can be read."
            ) from error


def _can_overwrite(stream: BinaryIO) -> bool:
    """Return whether the stream can seek, overwrite and be cut."""
    if "a" in str(getattr(stream, "mode", "")):
        return False  # writes go to the end, wherever it stands
    with suppress(OSError, AttributeError):
        if stream.seekable():
            stream.truncate(stream.tell())
            return True
    return False
