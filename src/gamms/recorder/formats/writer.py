"""Write a recording, so that it can be read up to the last second whenever the program dies.

Blocks close by what is in them, never by the clock. What the clock forces out early are shorter, provisional blocks at
the end of the file, which the one block of the same turns replaces later: that one is first written behind them, then
over them, and then the file is cut. So at every moment one or the other is whole, and a finished file does not know how
long anything took.
"""

import os
import time
from array import array
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any, BinaryIO

from gamms.errors import BadType, BadValue
from gamms.ir import packing
from gamms.ir.packed_bytes import FAST
from gamms.plain import Plain
from gamms.recorder.errors import RecordingError
from gamms.recorder.formats import blocks, chunks

_FEWEST_TURNS = 32
_MOST_SIZES = 64
_TROUBLES = (OSError, ValueError, TypeError, AttributeError)  # full, gone, closed, none at all


class Writer:
    """Writes a recording into a binary stream, which stays open.

    Requires: nothing else is written into the stream.
    Ensures: the same header, logs and keyframes give the same bytes. Whenever the program is killed, the turns of at
        most `seconds` are lost, `size` bytes or `turns` turns, whichever is least. Streams that cannot seek, cut and
        overwrite, and files opened for appending, get whole blocks only: there the seconds do not count.
    """

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
            stream: open for writing; the recording begins where it stands, or takes the place of what is provisional.
            header: plain values and NumPy arrays, whatever describes the recording.
            turns: a block closes after so many turns, 1 to 65,536.
            seconds: how often open blocks are written too; None for never.
            size: a block of 32 turns or more closes after so many bytes, counting 4 for each move; one of fewer turns
                after 64 times as many.
            clock: where the seconds come from.

        Raises:
            BadType, BadValue: the header is not plain.
            RecordingError: the stream cannot be written.
        """
        if not 1 <= turns <= blocks.MOST_TURNS or size < 1:
            raise BadValue(
                f"Blocks of {turns} turns or {size} bytes cannot be; at least 1 of both, at most 65,536 turns."
            )
        body = packing.pack(_is_dict(header, "header"), "The header")
        head = blocks.block(blocks.HEADER, body, 0, blocks.Counts())
        self._turns, self._seconds, self._size, self._clock = turns, seconds, size, clock
        self._key = blocks.head_of(head[: blocks.HEAD_SIZE]).crc
        self._file = stream if isinstance(stream, Output) else Output(stream)
        self._values = 0  # before the open block
        self._open = chunks.Collected(0)
        self._file.append(blocks.MAGIC + head)
        self._saved_at = clock()
        self._saved = 0  # parts of the open block that are in provisional blocks

    @property
    def turns(self) -> int:
        """How many turns were added."""
        return self._open.first + self._open.turns

    @property
    def values(self) -> int:
        """How many events with a value were added: all but those whose data are only numbers."""
        return self._values + self._open.values

    def add_turn(self, log: Sequence[object]) -> None:
        """Add the log of the next turn; it may be changed afterwards.

        Raises:
            BadType, BadValue: it is no log, or has an event that is not plain; nothing was added then.
            RecordingError: the stream cannot be written. What was written before stays readable.
        """
        self._file.check()
        part = chunks.part_of(log)
        if not self._open.fits(part.turns[0], len(part.kinds)):
            self._close_block()
        self._open.add(part)
        self._close_or_flush()

    def add_moves(self, logs: Sequence[list[int]]) -> None:
        """Add the logs of turns that have moves alone; as `add_turn`, in a fraction of the time.

        Raises:
            TypeError: there is something else in them; nothing was added.
            RecordingError: see `add_turn`.
        """
        moves = array("q")
        for log in logs:
            moves.fromlist(log)
        begin = first = 0
        while first < len(logs):  # block by block
            some = logs[first : first + self._turns - self._open.turns]
            counts = [len(log) >> 1 for log in some]
            end = begin + 2 * sum(counts)
            is_whole = end - begin == sum(map(len, some)) and not self._file.is_closed
            if is_whole and self._open.fits(sum(counts)) and not self._is_full_before(counts):
                self._open.add(chunks.part_of_moves(moves[begin:end], counts))
                self._close_or_flush()
            else:
                for log in some:
                    self.add_turn(log)
            begin, first = end, first + len(some)

    def _close_or_flush(self) -> None:
        if self._is_full(self._open.turns, self._open.size):
            self._close_block()
        elif self._seconds is not None and self._clock() - self._saved_at >= self._seconds:
            self.flush()

    def _is_full_before(self, counts: list[int]) -> bool:
        """Return whether turns of so many moves each would close the block before the last of them."""
        turns, size = self._open.turns + len(counts) - 1, self._open.size + chunks.BYTES_PER_MOVE * sum(counts[:-1])
        return len(counts) > 1 and self._is_full(turns, size)

    def _is_full(self, turns: int, size: int) -> bool:
        """Return whether a block closes: not before some turns, so that a block of many agents has several, too."""
        is_large = size >= self._size and (turns >= _FEWEST_TURNS or size >= _MOST_SIZES * self._size)
        return turns >= self._turns or is_large

    def keyframe(self, state: dict[str, Plain]) -> None:
        """Write the whole state after the turns added so far: plain values and NumPy arrays.

        Raises:
            BadType, BadValue: it is not plain; nothing was written then.
            RecordingError: see `add_turn`.
        """
        self._file.check()
        body = packing.pack(_is_dict(state, "keyframe"), "A keyframe", FAST)
        self.end_block()
        self._put(blocks.KEYFRAME, body, blocks.Counts(self.turns))

    def end_block(self) -> None:
        """Write the turns that were added and let a new block begin, whatever the stream can do.

        Raises:
            RecordingError: see `add_turn`.
        """
        self._file.check()
        if self._open.turns:
            self._close_block()

    def flush(self) -> None:
        """Write all turns that were added, if the stream can take back the last blocks of a file.

        Raises:
            RecordingError: see `add_turn`.
        """
        self._file.check()
        if self._file.can_overwrite and len(self._open.parts) > self._saved:
            part = self._open.since(self._saved)
            self._file.extend(self._block(blocks.TURNS, part.body(), part.counts))
            self._saved = len(self._open.parts)
        self._saved_at = self._clock()

    def close(self) -> None:
        """Write all turns and the end; calls after the first do nothing, nor do those after an error.

        Raises:
            RecordingError: see `add_turn`.
        """
        if self._file.is_closed:
            return
        self.end_block()
        self._put(blocks.END, b"", blocks.Counts(self.turns))
        self._file.close()

    def _close_block(self) -> None:
        self._put(blocks.TURNS, self._open.body(), self._open.counts)
        self._values += self._open.values
        self._open = chunks.Collected(self.turns)
        self._saved, self._saved_at = 0, self._clock()

    def _put(self, type: int, body: bytes, counts: blocks.Counts) -> None:
        self._file.append(self._block(type, body, counts))

    def _block(self, type: int, body: bytes, counts: blocks.Counts) -> bytes:
        return blocks.block(type, body, self._key, counts)


def _is_dict(value: object, what: str) -> dict[str, Plain]:
    if not isinstance(value, dict):
        raise BadType(f"A {what} is a dict, not {type(value).__name__}.")
    return value


# -- the stream -------------------------------------------------------------------------------------------------


class Output:
    """What is settled, and behind it perhaps provisional blocks, which will be replaced."""

    def __init__(self, stream: BinaryIO) -> None:
        self.end = 0  # of what is settled, in bytes from where the recording begins
        self.blocks = 0  # that were settled
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
            self.blocks += 1
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
