"""Read a recording: any turn without the others, of a file that is whole, cut off, or made to do harm."""

import os
from bisect import bisect_right
from collections import Counter, OrderedDict
from collections.abc import Collection, Iterator
from typing import BinaryIO

import numpy as np

from gamms.arguments import as_path
from gamms.errors import BadFile, BadValue
from gamms.ir.graph import IntArray
from gamms.ir.packing import Decoder, unpack
from gamms.limits import Allowance
from gamms.plain import Plain
from gamms.recorder.formats import blocks, chunks
from gamms.recorder.formats.blocks import Contents, Head, Input, at_byte, contents_of, turns_of
from gamms.recorder.streams import Opened

_KEPT = 4  # blocks of turns that are kept as arrays
_TURNS_AT_ONCE = 256


class Reader(Opened):
    """A recording that is open for reading; of its turns only a few blocks are in memory.

    Every call raises RecordingError (a ValueError), which names the byte, where the file is damaged, and BadValue for a
    turn that is not there.
    """

    header: dict[str, Plain]  # what the writer was given
    turns: int  # that are whole
    is_complete: bool  # whether the recording was finished
    warning: str | None  # what is missing of an unfinished one

    def __init__(self, source: str | os.PathLike[str] | BinaryIO) -> None:
        """Open a recording by its path, or the one that begins where a stream stands and goes on to its end.

        Raises:
            RecordingError (ValueError): there is no recording, or none with a whole header.
            OSError: it cannot be read.
        """
        super().__init__(as_path(source, "path").open("rb") if isinstance(source, str | os.PathLike) else None)
        try:
            self._input = Input(self._owned or source)  # type: ignore[arg-type]  # a path would have been opened
            self._decoder = Decoder(Allowance(self._input.size, "it", is_streamed=True))
            self._take(contents_of(self._input, self._decoder))
        except BaseException:
            self.close()
            raise

    def _take(self, contents: Contents) -> None:
        self.header, self.warning = contents.header, contents.warning
        self.is_complete, self.turns = contents.warning is None, turns_of(contents.found)
        self._chunks = [block for block in contents.found if block.type == blocks.TURNS]
        self._keyframes = [block for block in contents.found if block.type == blocks.KEYFRAME]
        self._firsts = [block.first for block in self._chunks]
        self._keyframe_turns = [block.first for block in self._keyframes]
        self._kept: OrderedDict[int, chunks.Chunk] = OrderedDict()
        self._charged: dict[int, bytearray] = {}  # place of a block -> which of its values were
        for block in self._chunks:
            with at_byte(block.at):
                self._decoder.allowance.begin()
                self._decoder.allowance.charge(blocks.cost_of(block.turns, block.moves, block.events))

    def content(self) -> bytes:
        """Return the bytes of the file, as they are now."""
        return self._input.read(0, self._input.size)

    def log(self, turn: int, without: Collection[int] = ()) -> chunks.Log:
        """Return the log of a turn, from 0: `row, node` of a move two by two, and tuples `(kind, data)`.

        Args:
            turn: which.
            without: kinds of events to leave out.
        """
        self._check_range(turn, turn + 1)
        number = bisect_right(self._firsts, turn) - 1
        chunk = self._kept.get(number) or self._chunk(number)
        with at_byte(self._chunks[number].at):
            return chunk.log(turn, without)

    def moves(self, start: int = 0, stop: int | None = None) -> tuple[IntArray, IntArray, IntArray]:
        """Return all moves of turns `start` to `stop - 1`, in their order: turns, rows, nodes, (moves,) each."""
        parts: list[tuple[IntArray, ...]] = []
        for chunk, first, last in self._parts(start, stop):
            begin, end = chunk.move_ends[first], chunk.move_ends[last]
            sizes = np.diff(chunk.move_ends[first : last + 1])
            turns = np.repeat(np.arange(chunk.first + first, chunk.first + last), sizes)
            parts.append((turns, chunk.moves[begin:end, 0], chunk.moves[begin:end, 1]))
        if len(parts) == 1:
            return parts[0][0], parts[0][1], parts[0][2]
        turns, rows, nodes = (
            np.concatenate([np.zeros(0, np.int64), *(part[column] for part in parts)]) for column in range(3)
        )
        return turns, rows, nodes

    def has_events(self, start: int, stop: int) -> bool:
        """Return whether something other than a move happens in turns `start` to `stop - 1`."""
        parts = self._parts(start, stop, with_events=True)
        return any(chunk.event_ends[first] < chunk.event_ends[last] for chunk, first, last in parts)

    def events(
        self, start: int = 0, stop: int | None = None, kinds: Collection[int] | None = None
    ) -> Iterator[tuple[int, int, int, Plain]]:
        """Yield all other events of these turns, or those of some kinds, in their order.

        Yields:
            The turn; how many moves of this turn come before the event; its kind; its data.
        """
        for chunk, first, last in self._parts(start, stop, with_events=True):
            numbers = chunk.numbers_of(first, last, kinds)
            turns = chunk.turns_of(numbers)
            places = chunk.after[numbers] - chunk.move_ends[turns]
            columns = (column.tolist() for column in (turns + chunk.first, places, chunk.kinds[numbers]))
            every = chunk.data_of(numbers)
            for turn, place, kind in zip(*columns, strict=True):
                with at_byte(self._chunks[bisect_right(self._firsts, turn) - 1].at):
                    data = next(every)
                yield turn, place, kind, data

    def pieces(self, start: int, stop: int) -> Iterator[tuple[int, int]]:
        """Yield where pieces of these turns begin and end, of no more turns and blocks than stay in memory."""
        self._check_range(start, stop)
        while start < stop:
            last = bisect_right(self._firsts, start) - 1 + _KEPT
            end = self._firsts[last] if last < len(self._firsts) else stop
            end = min(end, start + _TURNS_AT_ONCE, stop)
            yield start, end
            start = end

    def count_moves(self) -> int:
        """Return how many moves there are."""
        return sum(block.moves for block in self._chunks)

    def count_events(self) -> dict[int, int]:
        """Return how many events of each kind there are."""
        counts: Counter[int] = Counter()
        for chunk, _, _ in self._parts(0, None, with_events=True):
            counts.update(chunk.kinds.tolist())
        return dict(sorted(counts.items()))

    def keyframe_before(self, turn: int) -> int:
        """Return how many turns come before the keyframe that `keyframe(turn)` returns; -1 if there is none."""
        number = bisect_right(self._keyframe_turns, turn) - 1
        return self._keyframe_turns[number] if number >= 0 else -1

    def keyframe(self, turn: int) -> tuple[int, dict[str, Plain]] | None:
        """Return the last keyframe that stands before turn `turn`.

        Returns:
            How many turns come before it, and the state after them; None if there is none so early.
        """
        if not 0 <= turn <= self.turns:
            raise BadValue(f"There is no state after {turn} turns: this recording has {self.turns} turns.")
        number = bisect_right(self._keyframe_turns, turn) - 1
        if number < 0:
            return None
        block = self._keyframes[number]
        with at_byte(block.at):
            state = unpack(self._input.body(block), self._decoder, is_new=block.at not in self._charged)
            self._charged[block.at] = bytearray()
            if not isinstance(state, dict):
                raise BadFile("this is no keyframe")
        return block.first, state

    def verify(self) -> None:
        """Read everything.

        Raises:
            RecordingError (ValueError): something is damaged.
        """
        for _ in self._parts(0, None):
            pass
        for _ in self.events():
            pass
        for turn in self._keyframe_turns:
            self.keyframe(turn)

    def _parts(
        self, start: int, stop: int | None, *, with_events: bool = False
    ) -> Iterator[tuple[chunks.Chunk, int, int]]:
        """Yield the chunks that have these turns, or only those with events; and which of their turns: from, to."""
        stop = self.turns if stop is None else stop
        self._check_range(start, stop)
        number = max(bisect_right(self._firsts, start) - 1, 0)
        while start < stop:
            block = self._chunks[number]
            end = min(stop, block.first + block.turns)
            if block.events or not with_events:
                yield self._chunk(number), start - block.first, end - block.first
            number, start = number + 1, end

    def _check_range(self, start: int, stop: int) -> None:
        if not 0 <= start <= stop <= self.turns:
            raise BadValue(f"There are no turns {start} to {stop - 1}: this recording has turns 0 to {self.turns - 1}.")

    def _chunk(self, number: int) -> chunks.Chunk:
        block = self._chunks[number]
        with at_byte(block.at):
            chunk = self._kept.pop(number, None) or self._read(block)
        self._kept[number] = chunk
        if len(self._kept) > _KEPT:
            self._kept.popitem(last=False)
        return chunk

    def _read(self, block: Head) -> chunks.Chunk:
        body = self._input.body(block)
        charged = self._charged.setdefault(block.at, bytearray(block.events))
        return chunks.chunk_of(block, body, self._decoder, charged)
