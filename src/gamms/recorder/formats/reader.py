"""Random access to the turns of a recording, in complete, truncated or malicious files."""

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
from gamms.limits import MemoryBudget
from gamms.plain import Plain
from gamms.recorder.formats import blocks, chunks
from gamms.recorder.formats.blocks import (
    BlockHead,
    BlockSource,
    FileContents,
    add_position_to_errors,
    count_turns,
    read_contents,
)
from gamms.recorder.streams import StreamOwner

_KEPT = 4  # number of decoded blocks in memory
_TURNS_AT_ONCE = 256


class Reader(StreamOwner):
    """A recording that is open for reading; only a few blocks of turns are in memory.

    Every method raises RecordingError (a ValueError) with the position if the file is damaged, and BadValue for a turn
    that does not exist.
    """

    header: dict[str, Plain]  # as passed to the writer
    turns: int  # that are whole
    is_complete: bool  # whether the recording was finished
    warning: str | None  # the missing part of an unfinished recording

    def __init__(self, source: str | os.PathLike[str] | BinaryIO) -> None:
        """Open a recording by path, or from the present position of a stream to its end.

        Raises:
            RecordingError (ValueError): not a recording, or its header is incomplete.
            OSError: the file cannot be read.
        """
        super().__init__(as_path(source, "path").open("rb") if isinstance(source, str | os.PathLike) else None)
        try:
            self._input = BlockSource(self._owned or source)  # type: ignore[arg-type]  # a path would have been opened
            self._decoder = Decoder(MemoryBudget(self._input.size, "it", is_streamed=True))
            self._take(read_contents(self._input, self._decoder))
        except BaseException:
            self.close()
            raise

    def _take(self, contents: FileContents) -> None:
        self.header = contents.header
        self.warning = contents.warning
        self.is_complete = contents.warning is None
        self.turns = count_turns(contents.found)
        self._chunks = [block for block in contents.found if block.type == blocks.TURNS]
        self._keyframes = [block for block in contents.found if block.type == blocks.KEYFRAME]
        self._firsts = [block.first for block in self._chunks]
        self._keyframe_turns = [block.first for block in self._keyframes]
        self._kept: OrderedDict[int, chunks.Chunk] = OrderedDict()
        self._charged: dict[int, bytearray] = {}  # position of a block -> which of its values have been charged
        for block in self._chunks:
            with add_position_to_errors(block.at):
                self._decoder.allowance.begin()
                self._decoder.allowance.charge(blocks.compute_cost(block.turns, block.moves, block.events))

    def content(self) -> bytes:
        """Return the present bytes of the file."""
        return self._input.read(0, self._input.size)

    def log(self, turn: int, without: Collection[int] = ()) -> chunks.Log:
        """Return the log of a turn, counted from 0: pairs `row, node` for moves, and tuples `(kind, data)`.

        Args:
            turn: index of the turn.
            without: kinds of events to leave out.
        """
        self._check_range(turn, turn + 1)
        number = bisect_right(self._firsts, turn) - 1
        chunk = self._kept.get(number) or self._read_chunk(number)
        with add_position_to_errors(self._chunks[number].at):
            return chunk.log(turn, without)

    def moves(self, start: int = 0, stop: int | None = None) -> tuple[IntArray, IntArray, IntArray]:
        """Return all moves of turns `start` to `stop - 1`, in order: turns, rows, nodes, (moves,) each."""
        parts: list[tuple[IntArray, ...]] = []
        for chunk, first, last in self._read_parts(start, stop):
            begin = chunk.move_ends[first]
            end = chunk.move_ends[last]
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
        """Return whether turns `start` to `stop - 1` have events other than moves."""
        parts = self._read_parts(start, stop, with_events=True)
        return any(chunk.event_ends[first] < chunk.event_ends[last] for chunk, first, last in parts)

    def events(
        self, start: int = 0, stop: int | None = None, kinds: Collection[int] | None = None
    ) -> Iterator[tuple[int, int, int, Plain]]:
        """Yield all events other than moves of these turns, optionally only of some kinds, in order.

        Yields:
            The turn; the number of moves of this turn before the event; its kind; its data.
        """
        for chunk, first, last in self._read_parts(start, stop, with_events=True):
            numbers = chunk.find_numbers(first, last, kinds)
            turns = chunk.find_turns(numbers)
            places = chunk.after[numbers] - chunk.move_ends[turns]
            columns = (column.tolist() for column in (turns + chunk.first, places, chunk.kinds[numbers]))
            every = chunk.read_data(numbers)
            for turn, place, kind in zip(*columns, strict=True):
                with add_position_to_errors(self._chunks[bisect_right(self._firsts, turn) - 1].at):
                    data = next(every)
                yield turn, place, kind, data

    def pieces(self, start: int, stop: int) -> Iterator[tuple[int, int]]:
        """Yield (start, stop) of pieces of these turns, each small enough to stay in memory."""
        self._check_range(start, stop)
        while start < stop:
            last = bisect_right(self._firsts, start) - 1 + _KEPT
            end = self._firsts[last] if last < len(self._firsts) else stop
            end = min(end, start + _TURNS_AT_ONCE, stop)
            yield start, end
            start = end

    def count_moves(self) -> int:
        """Return the number of moves."""
        return sum(block.moves for block in self._chunks)

    def count_events(self) -> dict[int, int]:
        """Return the number of events of each kind."""
        counts: Counter[int] = Counter()
        for chunk, _, _ in self._read_parts(0, None, with_events=True):
            counts.update(chunk.kinds.tolist())
        return dict(sorted(counts.items()))

    def keyframe_before(self, turn: int) -> int:
        """Return the number of turns before the keyframe that `keyframe(turn)` returns; -1 without a keyframe."""
        number = bisect_right(self._keyframe_turns, turn) - 1
        return self._keyframe_turns[number] if number >= 0 else -1

    def keyframe(self, turn: int) -> tuple[int, dict[str, Plain]] | None:
        """Return the last keyframe at or before turn `turn`.

        Returns:
            The number of turns before it, and its state; None if there is none.
        """
        if not 0 <= turn <= self.turns:
            raise BadValue(f"There is no state after {turn} turns: this recording has {self.turns} turns.")
        number = bisect_right(self._keyframe_turns, turn) - 1
        if number < 0:
            return None
        block = self._keyframes[number]
        with add_position_to_errors(block.at):
            state = unpack(self._input.read_body(block), self._decoder, is_new=block.at not in self._charged)
            self._charged[block.at] = bytearray()
            if not isinstance(state, dict):
                raise BadFile("this is not a keyframe")
        return block.first, state

    def verify(self) -> None:
        """Read the whole recording, to check it.

        Raises:
            RecordingError (ValueError): a part is damaged.
        """
        for _ in self._read_parts(0, None):
            pass
        for _ in self.events():
            pass
        for turn in self._keyframe_turns:
            self.keyframe(turn)

    def _read_parts(
        self, start: int, stop: int | None, *, with_events: bool = False
    ) -> Iterator[tuple[chunks.Chunk, int, int]]:
        """Yield the chunks of these turns, or only chunks with events; with the first and the last of their turns."""
        stop = self.turns if stop is None else stop
        self._check_range(start, stop)
        number = max(bisect_right(self._firsts, start) - 1, 0)
        while start < stop:
            block = self._chunks[number]
            end = min(stop, block.first + block.turns)
            if block.events or not with_events:
                yield self._read_chunk(number), start - block.first, end - block.first
            number = number + 1
            start = end

    def _check_range(self, start: int, stop: int) -> None:
        if not 0 <= start <= stop <= self.turns:
            raise BadValue(f"There are no turns {start} to {stop - 1}: this recording has turns 0 to {self.turns - 1}.")

    def _read_chunk(self, number: int) -> chunks.Chunk:
        block = self._chunks[number]
        with add_position_to_errors(block.at):
            chunk = self._kept.pop(number, None) or self._read(block)
        self._kept[number] = chunk
        if len(self._kept) > _KEPT:
            self._kept.popitem(last=False)
        return chunk

    def _read(self, block: BlockHead) -> chunks.Chunk:
        body = self._input.read_body(block)
        charged = self._charged.setdefault(block.at, bytearray(block.events))
        return chunks.decode_chunk(block, body, self._decoder, charged)
