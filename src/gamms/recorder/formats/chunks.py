"""The turns of one block: collected as they happen, written as columns, read as arrays.

A block holds the values of events, one behind the other, and columns (`ir/packing.py`):

    turns:  moves of each; events of each
    moves:  rows, as differences from the move before; the nodes, as tracks of the rows (`tracks.py`)
    events: how many moves of the block come before each, as differences; kinds; sizes of their values in bytes
    tracks: of each kind of event whose data are only numbers, and whose sizes are 0, these numbers
"""

from array import array
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from gamms.errors import BadFile, BadType, BadValue
from gamms.ir import packing
from gamms.ir.graph import IntArray
from gamms.ir.packing import ByteReader, column, steps
from gamms.plain import Plain
from gamms.recorder.formats import blocks, tracks
from gamms.recorder.formats.tracks import FORMS, Layout, Rows, Tracks, layout_of
from gamms.text import reason, shown

Log = list[Any]
"""The log of one turn: ints two by two, and tuples."""

BYTES_PER_MOVE, _BYTES_PER_EVENT, _BYTES_PER_NUMBER = 4, 8, 4  # estimates that cost nothing


@dataclass(slots=True)
class Turn:
    """The log of one turn, checked and taken apart."""

    moves: "array[int]"  # row, node, row, node, …
    after: Sequence[int] = ()  # moves of the turn before each event
    kinds: Sequence[int] = ()
    data: Sequence[bytes] = ()  # of the events but those whose data are but numbers
    rows: dict[int, Rows] = field(default_factory=dict)  # these, by their kind


def turn_of(log: Sequence[Any]) -> Turn:
    """A log taken apart.

    Raises:
        BadType, BadValue: it is none, or has an event that is not plain.
    """
    log = log if isinstance(log, list) else list(log)
    try:
        turn = Turn(array("q", log))
    except (TypeError, OverflowError):
        turn = _mixed(log)
    _check_pairs(len(turn.moves))
    if len(turn.moves) > 2 * blocks.MOST_MOVES or len(turn.kinds) > blocks.MOST_EVENTS:
        raise BadValue(
            f"A turn of {len(turn.moves) // 2} moves and {len(turn.kinds)} events cannot be recorded; at most "
            f"{blocks.MOST_MOVES} moves and {blocks.MOST_EVENTS} events can."
        )
    return turn


def _mixed(log: Log) -> Turn:
    types, begin = list(map(type, log)), 0
    moves, after, kinds, data = array("q"), [], [], []
    rows: dict[int, list[Any]] = {kind: [] for kind in FORMS}
    for _ in range(types.count(tuple)):
        end = types.index(tuple, begin)
        if end > begin:
            moves.extend(_moves(log[begin:end]))
        after.append(len(moves) // 2)
        kind, one = _checked_event(log[end])
        kinds.append(kind)
        if kind in rows:
            rows[kind].append(one)
        else:
            data.append(packing.to_bytes(one, f"An event of kind {kind}"))
        begin = end + 1
    moves.extend(_moves(log[begin:]))
    return Turn(moves, after, kinds, data, {kind: Rows.of(kind, each) for kind, each in rows.items() if each})


def _moves(numbers: Log) -> "array[int]":
    _check_pairs(len(numbers))
    try:
        return array("q", numbers)
    except TypeError as error:
        raise BadType(
            f"A log has ints and tuples (kind, data); this one has something else ({reason(error)})."
        ) from None
    except OverflowError:
        raise BadValue(f"Rows and nodes have 64 bits; {shown(numbers)} has more.") from None


def _checked_event(event: tuple[Any, ...]) -> tuple[int, Any]:
    if len(event) != 2 or type(event[0]) is not int or not -(1 << 63) <= event[0] < 1 << 63:
        raise BadValue(f"An event is a tuple of an int of 64 bits, its kind, and its data, not {shown(event)}.")
    return event


def _check_pairs(size: int) -> None:
    if size % 2:
        raise BadValue("A log has two ints, row and node, for each move; one of them is missing.")


# -- collecting and writing -------------------------------------------------------------------------------------


class Mark(NamedTuple):
    """How much there was of the turns that wait for their block."""

    turns: int = 0
    moves: int = 0  # times two
    events: int = 0
    values: int = 0
    rows: dict[int, tuple[int, int]] = {}  # noqa: RUF012 - never changed
    size: int = 0


class Collected:
    """The turns that wait for their block.

    Args:
        first: turns before it.
    """

    def __init__(self, first: int) -> None:
        self.first = first
        self.size = 0  # in bytes, an estimate
        self._moves = array("q")
        self._turns: tuple[list[int], list[int]] = [], []  # moves, events of each turn
        self._after = array("q")
        self._kinds = array("q")
        self._data: list[bytes] = []
        self._rows: dict[int, Rows] = {}

    def __len__(self) -> int:
        return len(self._turns[0])

    @property
    def values(self) -> int:
        """How many events have a value."""
        return len(self._data)

    @property
    def counts(self) -> blocks.Counts:
        """What the head of the block says."""
        return blocks.Counts(self.first, len(self), len(self._moves) // 2, len(self._kinds))

    def fits(self, moves: int, events: int = 0) -> bool:
        """Return whether so many moves and events can still join."""
        counts = self.counts
        return counts.moves + moves <= blocks.MOST_MOVES and counts.events + events <= blocks.MOST_EVENTS

    def add(self, turn: Turn) -> None:
        """Let a turn join."""
        moves, before = len(turn.moves) // 2, len(self._moves) // 2
        self._moves.extend(turn.moves)
        self._turns[0].append(moves)
        self._turns[1].append(len(turn.kinds))
        self.size += BYTES_PER_MOVE * moves
        if turn.kinds:
            self._after.extend([before + after for after in turn.after])
            self._kinds.extend(turn.kinds)
            self._data.extend(turn.data)
            self.size += _BYTES_PER_EVENT * len(turn.data) + sum(map(len, turn.data))
        for kind, rows in turn.rows.items():
            self._rows.setdefault(kind, Rows()).extend(rows)
            self.size += _BYTES_PER_NUMBER * rows.numbers

    def add_moves(self, moves: "array[int]", counts: list[int]) -> None:
        """Let turns of so many moves each and nothing else join."""
        self._moves.extend(moves)
        self._turns[0].extend(counts)
        self._turns[1].extend(bytes(len(counts)))
        self.size += BYTES_PER_MOVE * sum(counts)

    def mark(self) -> Mark:
        """How much there is."""
        rows = {kind: (len(rows.ints), len(rows.floats)) for kind, rows in self._rows.items()}
        return Mark(len(self), len(self._moves), len(self._kinds), len(self._data), rows, self.size)

    def cut(self, mark: Mark) -> None:
        """Forget what is behind a mark, be it half a turn."""
        # Copies: what was interrupted may still look at these.
        self._turns = self._turns[0][: mark.turns], self._turns[1][: mark.turns]
        self._moves, self._after = self._moves[: mark.moves], self._after[: mark.events]
        self._kinds, self._data = self._kinds[: mark.events], self._data[: mark.values]
        self._rows = {kind: self._rows[kind].until(*sizes) for kind, sizes in mark.rows.items()}
        self.size = mark.size

    def since(self, mark: Mark) -> "Collected":
        """Return the turns behind a mark, for a block of their own."""
        part = Collected(self.first + mark.turns)
        part._moves = self._moves[mark.moves :]
        part._turns = self._turns[0][mark.turns :], self._turns[1][mark.turns :]
        part._after = array("q", [after - mark.moves // 2 for after in self._after[mark.events :]])
        part._kinds, part._data = self._kinds[mark.events :], self._data[mark.values :]
        rows = {kind: rows.since(*mark.rows.get(kind, (0, 0))) for kind, rows in self._rows.items()}
        part._rows = {kind: some for kind, some in rows.items() if some.numbers}
        return part

    def body(self) -> bytes:
        """Return the body of the block."""
        moves = np.frombuffer(self._moves, np.int64).reshape(-1, 2)
        rows = np.ascontiguousarray(moves[:, 0])
        parts = [column(np.array(sizes, np.int64)) for sizes in self._turns]
        parts += [column(steps(rows)), *layout_of(rows.tobytes()).columns(moves[:, 1])]
        parts += map(column, self._columns_of_events())
        for kind, some in sorted(self._rows.items()):
            parts += some.columns(kind)
        return packing.pack_parts(self._data, b"".join(parts), blocks.cost_of(*self.counts[1:]))

    def _columns_of_events(self) -> list[IntArray]:
        """How many moves come before each event, its kind, and the size of its data."""
        after, kinds = (np.frombuffer(column, np.int64) for column in (self._after, self._kinds))
        if not len(kinds):
            return [kinds] * 3
        sizes = np.zeros(len(kinds), np.int64)
        sizes[~np.isin(kinds, list(FORMS)) if self._rows else slice(None)] = [len(one) for one in self._data]
        return [steps(after), kinds, sizes]


# -- reading ----------------------------------------------------------------------------------------------------


class Values:
    """The values of the events of a block, each decoded when it is asked for.

    Args:
        data: one behind the other.
        ends: (values + 1,), where each ends, after a 0.
        decoder: of the file.
        charged: (values,), 1 for those that were charged to the file.
    """

    __slots__ = ("_charged", "_data", "_decoder", "_ends")

    def __init__(self, data: bytes, ends: IntArray, decoder: packing.Decoder, charged: bytearray) -> None:
        self._data, self._ends, self._decoder, self._charged = data, ends, decoder, charged

    def __getitem__(self, number: int) -> Plain:
        """Return one of them.

        Raises:
            BadFile: no writer makes this.
        """
        data = self._data[self._ends[number] : self._ends[number + 1]]
        value = self._decoder.value(data, is_new=not self._charged[number])
        self._charged[number] = 1
        return value


@dataclass(frozen=True, slots=True)
class Chunk:
    """The turns of a block."""

    first: int
    move_ends: IntArray  # (turns + 1,): turn i has the moves from move_ends[i] to move_ends[i + 1]
    event_ends: IntArray  # (turns + 1,)
    moves: IntArray  # (moves, 2): row, node
    after: IntArray  # (events,): moves of the block before it
    kinds: IntArray  # (events,)
    values: Values  # of the events
    tracks: dict[int, Tracks]  # the events whose data are but numbers, by their kind
    places: dict[int, IntArray]  # which events these are

    def numbers_of(self, first: int, last: int, kinds: Collection[int] | None = None) -> IntArray:
        """Which events happen in the turns from `first` of the block on and before `last`, or those of some kinds."""
        begin, end = int(self.event_ends[first]), int(self.event_ends[last])
        numbers = np.arange(begin, end)
        return numbers if kinds is None else numbers[np.isin(self.kinds[begin:end], list(kinds))]

    def turns_of(self, numbers: IntArray) -> IntArray:
        """In which turns of the block some events happen."""
        return self.event_ends.searchsorted(numbers, side="right") - 1

    def data_of(self, numbers: IntArray) -> Iterator[Any]:
        """The data of some events, ascending.

        Raises:
            BadFile: they are damaged.
        """
        kinds = self.kinds[numbers]
        rows = {kind: self.tracks_of(kind, numbers[kinds == kind]).data() for kind in self.tracks}
        for number, kind in zip(numbers.tolist(), kinds.tolist(), strict=True):
            if kind in rows:
                yield next(rows[kind])
            else:
                yield self.values[number]

    def tracks_of(self, kind: int, numbers: IntArray) -> Tracks:
        """Some events of a kind whose data are but numbers."""
        return self.tracks[kind].at(self.places[kind].searchsorted(numbers))

    def log(self, turn: int) -> Log:
        """What was added as a turn of the recording."""
        turn -= self.first
        begin, end = self.move_ends[turn : turn + 2].tolist()
        flat: Log = self.moves[begin:end].reshape(-1).tolist()
        numbers = self.numbers_of(turn, turn + 1)
        if not len(numbers):
            return flat
        log: Log = []
        at = 0
        columns = self.after[numbers].tolist(), self.kinds[numbers].tolist(), self.data_of(numbers)
        for after, kind, data in zip(*columns, strict=True):
            until = 2 * (after - begin)
            if until > at:
                log += flat[at:until]
                at = until
            log.append((kind, data))
        return log + flat[at:]


def chunk_of(head: blocks.Head, body: bytes, decoder: packing.Decoder, charged: bytearray) -> Chunk:
    """Return the turns of a block.

    Args:
        head: of the block.
        body: of the block.
        decoder: of the file.
        charged: (events,), 1 for those whose values were charged to the file.

    Raises:
        BadFile: it is damaged.
    """
    data, columns = packing.unpack_parts(body, decoder.most_bytes, has_columns=True)
    reader = ByteReader(columns)
    move_ends = _ends(reader.column(head.turns), head.moves, "moves")
    event_ends = _ends(reader.column(head.turns), head.events, "events")
    moves = np.empty((head.moves, 2), np.int64)
    moves[:, 0] = reader.sums(head.moves)
    moves[:, 1] = Layout(moves[:, 0]).take(reader)
    after, kinds, sizes = reader.sums(head.events), reader.column(head.events), reader.column(head.events)
    data_ends = _ends(sizes, len(data), "bytes")
    found = _take_tracks(reader, kinds, sizes)
    reader.finish()
    moves.setflags(write=False)  # views of it are handed out
    turns = np.repeat(np.arange(head.turns), np.diff(event_ends))  # of the events
    if (after < move_ends[turns]).any() or (after > move_ends[turns + 1]).any() or (after[1:] < after[:-1]).any():
        raise BadFile("an event is out of place")
    values = Values(data, data_ends, decoder, charged)
    places = {kind: np.flatnonzero(kinds == kind) for kind in found}
    return Chunk(head.first, move_ends, event_ends, moves, after, kinds, values, found, places)


def _take_tracks(reader: ByteReader, kinds: IntArray, sizes: IntArray) -> dict[int, Tracks]:
    found = {}
    for kind in sorted(FORMS):
        is_one = kinds == kind
        if is_one.any():
            if sizes[is_one].any():
                raise BadFile(f"an event of kind {kind:#010x} has data of its own")
            found[kind] = tracks.take(reader, kind, int(np.count_nonzero(is_one)))
    return found


def _ends(sizes: IntArray, total: int, what: str) -> IntArray:
    """Return where each part ends that has such a size, after a 0."""
    ends = np.zeros(len(sizes) + 1, np.int64)
    if len(sizes) and (int(sizes.min()) < 0 or int(sizes.max()) > total):
        raise BadFile(f"its numbers of {what} are damaged")
    np.cumsum(sizes, out=ends[1:])
    if int(ends[-1]) != total:
        raise BadFile(f"its {what} do not add up to {total}")
    return ends
