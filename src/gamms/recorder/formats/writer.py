"""Write a recording so that it can be read up to the last second if the program dies.

Blocks are closed by their contents, never by the clock. Turns that the clock forces out early are written as shorter,
provisional blocks at the end of the file, which the final block of the same turns replaces later: it is first written
after them, then over them, and then the file is truncated. So at every moment one of the two is complete, and a
finished file does not depend on timing.
"""

import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any, BinaryIO

from gamms.errors import BadType, BadValue
from gamms.ir import packing
from gamms.ir.packed_bytes import FAST
from gamms.plain import Plain
from gamms.readonly import NotPickled
from gamms.recorder.errors import RecordingError
from gamms.recorder.formats import blocks, chunks

_FEWEST_TURNS = 32
_MOST_SIZES = 64
_TROUBLES = (OSError, ValueError, TypeError, AttributeError)  # full, disconnected, closed, missing


class Writer(NotPickled):
    """Writes a recording to a binary stream, which stays open.

    Requires: nothing else is written to the stream.
    Ensures: equal headers, logs and keyframes give equal bytes. If the program is killed, at most the turns of
    `seconds`, `size` bytes or `turns` turns are lost, whichever is least. Streams that cannot seek, truncate and
    overwrite, and files opened for appending, get only final blocks: `seconds` has no effect for them.
    """

    _not_pickled = (
        "A writer can neither be pickled nor copied, because it writes to a stream. Make another writer for another "
        "stream."
    )

    def __init__(
        self,
        stream: "BinaryIO | Output",
        header: dict[str, Plain],
        *,
        turns: int = 64,
        seconds: float | None = 1.0,
        size: int = 256 * 1024,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Begin a recording.

        Args:
            stream: writable; the recording begins at its present position, or replaces provisional blocks.
            header: plain values and NumPy arrays that describe the recording.
            turns: most turns of a block, 1 to 65,536.
            seconds: interval for writing open blocks, too; None: never.
            size: a block of at least 32 turns closes after this many bytes, with 4 for each move; a block of fewer
                turns after 64 times as many.
            clock: returns the seconds.

        Raises:
            BadType, BadValue: the header is not plain.
            RecordingError: the stream cannot be written.
        """
        if not 1 <= turns <= blocks.MOST_TURNS or size < 1:
            raise BadValue(
                f"Blocks of {turns} turns or {size} bytes cannot be; at least 1 of both, at most 65,536 turns."
            )
        body = packing.pack(_is_dict(header, "header"), "The header")
        head = blocks.make_block(blocks.HEADER, body, 0, blocks.BlockCounts())
        self._turns = turns
        self._seconds = seconds
        self._size = size
        self._clock = clock
        self._key = blocks.decode_head(head[: blocks.HEAD_SIZE]).crc
        self._file = stream if isinstance(stream, Output) else Output(stream)
        self._values = 0  # before the open block
        self._open = chunks.WaitingTurns(0)
        self._file.append(blocks.MAGIC + head)
        self._saved_at = clock()
        self._saved = 0  # parts of the open block in provisional blocks

    @property
    def turns(self) -> int:
        """The number of turns added."""
        return self._open.first + self._open.turns

    @property
    def values(self) -> int:
        """The number of events with a value added: all except events with only numeric data."""
        return self._values + self._open.values

    def add_turn(self, log: Sequence[object]) -> None:
        """Add the log of the next turn; the list may be changed afterwards.

        Raises:
            BadType, BadValue: not a log, or an event is not plain; nothing was added.
            RecordingError: the stream cannot be written. Data written before stay readable.
        """
        self._file.check()
        part = chunks.make_part(log)
        if not self._open.has_room(len(part.moves), len(part.kinds)):
            self._close_block()
        self._open.add(part)
        if self._is_full(self._open.turns, self._open.size):
            self._close_block()
        elif self._seconds is not None and self._clock() - self._saved_at >= self._seconds:
            self.flush()

    def _is_full(self, turns: int, size: int) -> bool:
        """Return whether a block is full; a minimum number of turns keeps blocks of many agents from being small."""
        is_large = size >= self._size and (turns >= _FEWEST_TURNS or size >= _MOST_SIZES * self._size)
        return turns >= self._turns or is_large

    def keyframe(self, state: dict[str, Plain]) -> None:
        """Write the state after the turns added so far: plain values and NumPy arrays.

        Raises:
            BadType, BadValue: the state is not plain; nothing was written.
            RecordingError: see `add_turn`.
        """
        self._file.check()
        body = packing.pack(_is_dict(state, "keyframe"), "A keyframe", FAST)
        self.end_block()
        self._put(blocks.KEYFRAME, body, blocks.BlockCounts(self.turns))

    def end_block(self) -> None:
        """Write the added turns as a final block, on any stream.

        Raises:
            RecordingError: see `add_turn`.
        """
        self._file.check()
        if self._open.turns:
            self._close_block()

    def flush(self) -> None:
        """Write all added turns, if the last blocks of the stream can be replaced later.

        Raises:
            RecordingError: see `add_turn`.
        """
        self._file.check()
        if self._file.can_overwrite and len(self._open.parts) > self._saved:
            part = self._open.get_turns_since(self._saved)
            self._file.extend(self._write_block(blocks.TURNS, part.make_body(), part.counts))
            self._saved = len(self._open.parts)
        self._saved_at = self._clock()

    def close(self) -> None:
        """Write all turns and the end; further calls, and calls after an error, do nothing.

        Raises:
            RecordingError: see `add_turn`.
        """
        if self._file.is_closed:
            return
        self.end_block()
        self._put(blocks.END, b"", blocks.BlockCounts(self.turns))
        self._file.close()

    def _close_block(self) -> None:
        self._put(blocks.TURNS, self._open.make_body(), self._open.counts)
        self._values += self._open.values
        self._open = chunks.WaitingTurns(self.turns)
        self._saved = 0
        self._saved_at = self._clock()

    def _put(self, type: int, body: bytes, counts: blocks.BlockCounts) -> None:
        self._file.append(self._write_block(type, body, counts))

    def _write_block(self, type: int, body: bytes, counts: blocks.BlockCounts) -> bytes:
        return blocks.make_block(type, body, self._key, counts)


def _is_dict(value: object, what: str) -> dict[str, Plain]:
    if not isinstance(value, dict):
        raise BadType(f"A {what} is a dict, not {type(value).__name__}.")
    return value


# -- the stream -------------------------------------------------------------------------------------------------


class Output:
    """The stream: final blocks, and maybe provisional blocks after them, which are replaced later."""

    def __init__(self, stream: BinaryIO) -> None:
        self.end = 0  # end of the final blocks, in bytes from the start of the recording
        self.blocks = 0  # that were settled
        self.is_closed = False
        self._length = 0  # of all that is there
        with self._watch():
            stream.flush()
            # Unwritten data in a buffer would be written again on closing, and fail again.
            self._stream: Any = getattr(stream, "raw", stream)
            self.can_overwrite = _can_overwrite(stream)
            # A buffer that is also read keeps its data until it seeks the end.
            self._readable = stream if stream is not self._stream and stream.readable() else None
            self._begin = stream.tell() if self.can_overwrite else 0

    def check(self) -> None:
        """Raise an error after the end, or after an error."""
        if self.is_closed:
            raise RecordingError(f"Nothing more can be recorded: this recording ended after byte {self._length}.")

    def append(self, data: bytes) -> None:
        """Write a final block over the provisional blocks, which stay readable until it is complete."""
        with self._watch():
            if self._length > self.end:
                self._write(max(self._length, self.end + len(data)), data)
                self._length = self.end  # if the next line fails, the copy stays
                self._write(self.end, data)
                self._stream.truncate(self._begin + self.end + len(data))
            else:
                self._write(self.end, data)
            self._length = self.end + len(data)
            self.end = self._length
            self.blocks += 1
            self._show()

    def extend(self, data: bytes) -> None:
        """Write a provisional block at the end.

        Requires: `can_overwrite`.
        """
        with self._watch():
            self._write(self._length, data)
            self._length += len(data)
            self._show()

    def return_to(self, end: int) -> None:
        """Make all bytes from a position on provisional, even after an interrupted write."""
        self.end = end
        if self.can_overwrite:
            self._length = self._stream.seek(0, os.SEEK_END) - self._begin

    def close(self) -> None:
        """Refuse further writes."""
        self.is_closed = True

    def _write(self, at: int, data: bytes) -> None:
        if self.can_overwrite:
            self._stream.seek(self._begin + at)
        left = memoryview(data)
        while left:
            written = self._stream.write(left)
            if not written:
                raise BlockingIOError("it accepts no more data at the moment")
            left = left[written:]
        self._stream.flush()

    def _show(self) -> None:
        """Flush written data to the stream of the program."""
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
    """Return whether the stream can seek, overwrite and truncate."""
    if "a" in str(getattr(stream, "mode", "")):
        return False  # writes go to the end, at any position
    with suppress(OSError, AttributeError):
        if stream.seekable():
            stream.truncate(stream.tell())
            return True
    return False
