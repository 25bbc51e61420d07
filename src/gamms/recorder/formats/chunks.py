"""The turns of one block: collected during a game, written as columns, read as arrays.

A block has the values of events, one after another, and columns (`ir/packing.py`):

    turns:  moves of each; events of each
    moves:  rows, as differences from the previous move; nodes, as tracks of the rows
    events: number of moves of the block before each, as differences; kinds; sizes of their values in bytes
    tracks: for each kind of event with only numeric data, and sizes of 0, these numbers

A track has the entries of one agent, in order, because consecutive positions of an agent are similar; tracks are sorted
by agent number. The first node of each track is stored separately, as the difference from the first node of the
previous track; the others are differences within the track. Moves are such tracks, and so are events with only numeric
data: an agent's number, maybe a node, and floats.
"""

from array import array
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from types import MappingProxyType
from typing import NamedTuple, cast

import numpy as np

from gamms.errors import BadFile, BadType, BadValue
from gamms.ir import packing
from gamms.ir.events import AERIAL_AGENT_FLIGHT, AERIAL_AGENT_TURN, MOVES
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.packed_bytes import FAST, ByteReader, compute_differences, encode_column
from gamms.plain import Plain
from gamms.recorder.formats import blocks
from gamms.text import reason, shown

Log = list[Plain]
"""The log of one turn: pairs of ints, and tuples, including tuples with the moves of many agents."""

# estimates of bytes
_BYTES_PER_MOVE = 4
_BYTES_PER_EVENT = 8
_BYTES_PER_NUMBER = 4


# -- tracks -----------------------------------------------------------------------------------------------------


class EventForm(NamedTuple):
    """The form of an event with only numeric data, after the number of its agent."""

    nodes: int
    floats: int


FORMS = {AERIAL_AGENT_FLIGHT: EventForm(1, 3), AERIAL_AGENT_TURN: EventForm(0, 4)}


class TrackLayout:
    """The assignment of entries to tracks, computed from the agent number of each entry."""

    __slots__ = ("at", "is_first", "lengths", "order")

    def __init__(self, numbers: IntArray) -> None:
        self.order = numbers.argsort(kind="stable")  # (entries,): sorted by track
        ordered = numbers[self.order]
        self.is_first = np.ones(len(numbers), np.bool_)
        self.is_first[1:] = ordered[1:] != ordered[:-1]
        self.at = np.flatnonzero(self.is_first)  # (tracks,): start of each track
        self.lengths = np.diff(self.at, append=len(numbers))

    def encode_columns(self, values: IntArray) -> Iterator[bytes]:
        """Yield two columns: the first value of each track; all other values, as differences."""
        ordered = values[self.order]
        yield encode_column(compute_differences(ordered[self.is_first]))
        yield encode_column(compute_differences(ordered)[~self.is_first])

    def encode_float_columns(self, values: IntArray) -> Iterator[bytes]:
        """Yield two columns of the bits of floats: like `encode_columns`, but with second differences of each track.

        The steps of an agent that moves straight on are nearly equal.
        """
        ordered = values[self.order]
        yield encode_column(compute_differences(ordered[self.is_first]))
        others = compute_differences(ordered)[~self.is_first]
        is_second = self.is_first[:-1][~self.is_first[1:]]  # (others,)
        yield encode_column(np.where(is_second, others, compute_differences(others)))

    def take(self, reader: ByteReader, *, are_floats: bool = False) -> IntArray:
        """Read the values (entries,) of `encode_columns`, or the bits of floats of `encode_float_columns`."""
        firsts = reader.read_sums(len(self.at))
        others = reader.read_column(len(self.order) - len(self.at))
        if are_floats:
            others = self._sum_tracks(0, others)[~self.is_first]
        values = np.empty(len(self.order), np.int64)
        values[self.order] = self._sum_tracks(firsts, others)
        return values

    def _sum_tracks(self, firsts: IntArray | int, others: IntArray) -> IntArray:
        """Return the cumulative sums of each track, track by track."""
        parts = np.zeros(len(self.order), np.int64)
        parts[~self.is_first] = others
        sums = np.cumsum(parts)
        sums += np.repeat(firsts - sums[self.at], self.lengths)
        return sums


# -- events -----------------------------------------------------------------------------------------------------


class EventRows(NamedTuple):
    """Events of one kind, before they are written to a block."""

    ints: "array[int]"  # number of the agent, and maybe a node, of each event
    floats: "array[float]"

    @classmethod
    def from_events(cls, kind: int, events: list[Plain]) -> "EventRows":
        """Return checked data of events.

        Raises:
            BadType, BadValue: the data are invalid for their kind.
        """
        nodes, floats = FORMS[kind]
        for data in events:
            if not isinstance(data, tuple) or len(data) != 1 + nodes + floats:
                raise BadValue(
                    f"An event of kind {kind:#010x} is a tuple of {1 + nodes} ints and {floats} floats, not "
                    f"{shown(data)}."
                )
        try:
            return cls(
                array("q", chain.from_iterable([data[: 1 + nodes] for data in events])),
                array("d", chain.from_iterable([data[1 + nodes :] for data in events])),
            )
        except TypeError as error:
            raise BadType(f"An event of kind {kind:#010x} has data that are not numbers ({reason(error)}).") from None
        except OverflowError:
            raise BadValue(f"An event of kind {kind:#010x} has a number of more than 64 bits.") from None

    @classmethod
    def join(cls, parts: Sequence["EventRows"]) -> "EventRows":
        """Return the events of several turns."""
        ints, floats = (b"".join(numbers) for numbers in zip(*parts, strict=True))
        return cls(array("q", ints), array("d", floats))

    def encode_columns(self, kind: int) -> Iterator[bytes]:
        """Yield the columns for the block: the bits of floats as integers."""
        nodes, floats = FORMS[kind]
        ints = np.frombuffer(self.ints, np.int64).reshape(-1, 1 + nodes)
        layout = TrackLayout(ints[:, 0])
        yield encode_column(compute_differences(ints[:, 0]))
        bits = np.frombuffer(self.floats, np.float64).astype("<f8", copy=False).view(np.int64).reshape(-1, floats)
        for part in ints.T[1:]:
            yield from layout.encode_columns(part)
        for part in bits.T:
            yield from layout.encode_float_columns(part)


@dataclass(frozen=True, slots=True)
class EventTracks:
    """Events of one kind, in order."""

    numbers: IntArray  # (events,): agent numbers
    nodes: IntArray  # (events, 0 or 1)
    floats: FloatArray  # (events, floats)

    def select(self, places: IntArray | slice) -> "EventTracks":
        """Return a selection of the events."""
        return EventTracks(self.numbers[places], self.nodes[places], self.floats[places])

    def list_data(self) -> Iterator[tuple[Plain, ...]]:
        """Yield the data of each event."""
        parts = (self.numbers, *self.nodes.T, *self.floats.T)
        return zip(*(part.tolist() for part in parts), strict=True)

    @classmethod
    def take(cls, reader: ByteReader, kind: int, size: int) -> "EventTracks":
        """Read `size` events of a kind from the next columns.

        Raises:
            BadFile: the columns are damaged.
        """
        numbers = reader.read_sums(size)
        layout = TrackLayout(numbers)
        nodes = np.empty((size, FORMS[kind].nodes), np.int64)
        floats = np.empty((size, FORMS[kind].floats), np.int64)
        for part in nodes.T:
            part[:] = layout.take(reader)
        for part in floats.T:
            part[:] = layout.take(reader, are_floats=True)
        return cls(numbers, nodes, floats.view(np.float64))


# -- collecting and writing -------------------------------------------------------------------------------------


class LogPart(NamedTuple):
    """The checked log of a turn, as columns."""

    moves: IntArray  # (moves, 2): agent number, node
    after: Sequence[int] = ()  # number of moves before each event
    kinds: Sequence[int] = ()
    data: Sequence[bytes] = ()  # of events with data other than numbers
    rows: Mapping[int, EventRows] = MappingProxyType({})  # events with only numeric data, by kind

    @property
    def size(self) -> int:
        """The estimated size in bytes."""
        values = sum(map(len, self.data)) + _BYTES_PER_EVENT * len(self.data)
        numbers = sum(len(some.ints) + len(some.floats) for some in self.rows.values())
        return _BYTES_PER_MOVE * len(self.moves) + values + _BYTES_PER_NUMBER * numbers


def make_part(log: Sequence[object]) -> LogPart:
    """Return the checked log of a turn as columns.

    Raises:
        BadType, BadValue: not a log, or an event is not plain.
    """
    log = log if isinstance(log, list) else list(log)
    try:
        part = LogPart(_make_pairs(array("q", cast("list[int]", log))))
    except (TypeError, OverflowError):
        part = _make_part(log)
    if len(part.moves) > blocks.MOST_MOVES or len(part.kinds) > blocks.MOST_EVENTS:
        raise BadValue(
            f"A turn of {len(part.moves)} moves and {len(part.kinds)} events cannot be recorded; at most "
            f"{blocks.MOST_MOVES} moves and {blocks.MOST_EVENTS} events can."
        )
    return part


def _make_part(log: Log) -> LogPart:
    """Return the log of a turn with events as a part."""
    found: list[IntArray] = []
    after = []
    kinds = []
    data = []
    rows: dict[int, list[Plain]] = {kind: [] for kind in FORMS}
    types = list(map(type, log))
    begin = 0
    count = 0
    for _ in range(types.count(tuple)):
        end = types.index(tuple, begin)
        moves = _select_moves(log[begin:end])
        begin = end + 1
        kind, one = _check_event(log[end])
        found.append(moves)
        count += len(moves)
        if kind == MOVES and isinstance(one, np.ndarray):
            found.append(one.astype(np.int64, copy=False).reshape(-1, 2))
            count += len(found[-1])
            continue
        after.append(count)
        kinds.append(kind)
        if kind in rows:
            rows[kind].append(one)
        else:
            data.append(packing.to_bytes(one, f"An event of kind {kind}"))
    found.append(_select_moves(log[begin:]))
    numbers = {kind: EventRows.from_events(kind, each) for kind, each in rows.items() if each}
    whole = np.concatenate(found)
    return LogPart(whole, after, kinds, data, numbers)


def _select_moves(numbers: Log) -> IntArray:
    try:
        return _make_pairs(array("q", numbers))
    except TypeError as error:
        raise BadType(
            f"A log has ints and tuples (kind, data); this one has other entries ({reason(error)})."
        ) from None
    except OverflowError:
        raise BadValue(f"Rows and nodes have 64 bits; {shown(numbers)} has more.") from None


def _make_pairs(numbers: "array[int]") -> IntArray:
    if len(numbers) % 2:
        raise BadValue("A log has two ints, row and node, for each move; one int is missing.")
    return np.frombuffer(numbers, np.int64).reshape(-1, 2)


def _check_event(event: tuple[Plain, ...]) -> tuple[int, Plain]:
    if len(event) != 2 or type(event[0]) is not int or not -(1 << 63) <= event[0] < 1 << 63:
        raise BadValue(f"An event is a tuple of an int of 64 bits, its kind, and its data, not {shown(event)}.")
    return event


class WaitingTurns:
    """The turns that wait to be written as a block.

    Args:
        first: number of turns before it.
        parts: the first turns.

    Attributes:
        parts: the turns.
        moves: number of moves; also `events`, and `values`, the number of events with a value.
        size: estimated size in bytes.
    """

    def __init__(self, first: int, parts: Sequence[LogPart] = ()) -> None:
        self.first = first
        self.parts = list[LogPart]()
        self.moves = 0
        self.events = 0
        self.values = 0
        self.size = 0
        for part in parts:
            self.add(part)

    @property
    def turns(self) -> int:
        """The number of turns."""
        return len(self.parts)

    @property
    def counts(self) -> blocks.BlockCounts:
        """The counts for the head of the block."""
        return blocks.BlockCounts(self.first, self.turns, self.moves, self.events)

    def has_room(self, moves: int, events: int = 0) -> bool:
        """Return whether this many moves and events can be added."""
        return self.moves + moves <= blocks.MOST_MOVES and self.events + events <= blocks.MOST_EVENTS

    def add(self, part: LogPart) -> None:
        """Add a turn."""
        self.parts.append(part)
        self.moves += len(part.moves)
        self.events += len(part.kinds)
        self.values += len(part.data)
        self.size += part.size

    def get_turns_since(self, mark: int) -> "WaitingTurns":
        """Return the turns after the first `mark` ones, for a separate block."""
        return WaitingTurns(self.first + mark, self.parts[mark:])

    def make_body(self) -> bytes:
        """Return the body of the block."""
        parts = self.parts
        columns = [encode_column(np.array([len(part.moves) for part in parts], np.int64))]
        columns += self._list_event_columns()
        columns[2:2] = self._list_move_columns()
        for kind in sorted(FORMS):
            if some := [part.rows[kind] for part in parts if kind in part.rows]:
                columns += EventRows.join(some).encode_columns(kind)
        data = list(chain.from_iterable(part.data for part in parts))
        return packing.pack_parts(data, columns, blocks.compute_cost(*self.counts[1:]), FAST)

    def _list_move_columns(self) -> Iterator[bytes]:
        """Yield rows, first nodes of tracks, and other nodes."""
        rows, nodes = np.concatenate([part.moves for part in self.parts]).T
        yield encode_column(compute_differences(rows))
        yield from TrackLayout(rows).encode_columns(nodes)

    def _list_event_columns(self) -> Iterator[bytes]:
        """Yield the number of events of each turn; for each event the moves before it, its kind, and its size."""
        of_turns, after, kinds, sizes = numbers = [list[int]() for _ in range(4)]
        moves = 0
        for part in self.parts:
            of_turns.append(len(part.kinds))
            after += [moves + one for one in part.after]
            kinds += part.kinds
            data = map(len, part.data)
            sizes += [0 if kind in FORMS else next(data) for kind in part.kinds]
            moves += len(part.moves)
        for one in numbers:
            array = np.array(one, np.int64)
            yield encode_column(compute_differences(array) if one is after else array)


# -- reading ----------------------------------------------------------------------------------------------------


class EventValues:
    """The values of the events of a block, decoded on access.

    Args:
        data: encoded values, one after another.
        ends: (values + 1,) end of each value, after a 0.
        decoder: decoder of the file.
        charged: (values,) 1 for values whose memory has been charged to the file.
    """

    __slots__ = ("_charged", "_data", "_decoder", "_ends")

    def __init__(self, data: bytes, ends: IntArray, decoder: packing.Decoder, charged: bytearray) -> None:
        self._data = data
        self._ends = ends
        self._decoder = decoder
        self._charged = charged

    def __getitem__(self, number: int) -> Plain:
        """Return the value with this number.

        Raises:
            BadFile: the bytes are invalid.
        """
        data = self._data[self._ends[number] : self._ends[number + 1]]
        value = self._decoder.decode(data, is_new=not self._charged[number])
        self._charged[number] = 1
        return value


@dataclass(frozen=True, slots=True)
class Chunk:
    """The turns of a block."""

    first: int
    move_ends: IntArray  # (turns + 1,): turn i has the moves from move_ends[i] to move_ends[i + 1]
    event_ends: IntArray  # (turns + 1,)
    moves: IntArray  # (moves, 2): row, node
    after: IntArray  # (events,): number of moves of the block before each event
    kinds: IntArray  # (events,)
    values: EventValues  # of the events
    tracks: dict[int, EventTracks]  # events with only numeric data, by kind
    places: dict[int, IntArray]  # which events these are

    def find_numbers(self, first: int, last: int, kinds: Collection[int] | None = None) -> IntArray:
        """Return the numbers of the events in turns `first` to `last - 1`, optionally only of some kinds."""
        begin = int(self.event_ends[first])
        end = int(self.event_ends[last])
        numbers = np.arange(begin, end)
        return numbers if kinds is None else numbers[np.isin(self.kinds[begin:end], list(kinds))]

    def find_turns(self, numbers: IntArray) -> IntArray:
        """Return the turn within the block of each event."""
        return self.event_ends.searchsorted(numbers, side="right") - 1

    def read_data(self, numbers: IntArray) -> Iterator[Plain]:
        """Yield the data of events, given in ascending order.

        Raises:
            BadFile: the data are damaged.
        """
        kinds = self.kinds[numbers]
        rows = {kind: self.read_tracks(kind, numbers[kinds == kind]).list_data() for kind in self.tracks}
        for number, kind in zip(numbers.tolist(), kinds.tolist(), strict=True):
            if kind in rows:
                yield next(rows[kind])
            else:
                yield self.values[number]

    def read_tracks(self, kind: int, numbers: IntArray) -> EventTracks:
        """Return some events of a kind with only numeric data."""
        return self.tracks[kind].select(self.places[kind].searchsorted(numbers))

    def log(self, turn: int, without: Collection[int] = ()) -> Log:
        """Return the log of a turn of the recording, without some kinds of events."""
        turn -= self.first
        begin, end = self.move_ends[turn : turn + 2].tolist()
        flat: Log = self.moves[begin:end].reshape(-1).tolist()
        numbers = self.find_numbers(turn, turn + 1)
        if without:
            numbers = numbers[[kind not in without for kind in self.kinds[numbers].tolist()]]
        if not len(numbers):
            return flat
        log: Log = []
        at = 0
        columns = self.after[numbers].tolist(), self.kinds[numbers].tolist(), self.read_data(numbers)
        for after, kind, data in zip(*columns, strict=True):
            until = 2 * (after - begin)
            if until > at:
                log += flat[at:until]
                at = until
            log.append((kind, data))
        return log + flat[at:]


def decode_chunk(head: blocks.BlockHead, body: bytes, decoder: packing.Decoder, charged: bytearray) -> Chunk:
    """Decode the turns of a block.

    Args:
        head: head of the block.
        body: body of the block.
        decoder: decoder of the file.
        charged: (events,) 1 for events whose values have been charged to the file.

    Raises:
        BadFile: the block is damaged.
    """
    data, columns = packing.unpack_parts(body, decoder.most_bytes, has_columns=True)
    reader = ByteReader(columns)
    move_ends = _compute_ends(reader.read_column(head.turns), head.moves, "moves")
    event_ends = _compute_ends(reader.read_column(head.turns), head.events, "events")
    moves = np.empty((head.moves, 2), np.int64)
    moves[:, 0] = reader.read_sums(head.moves)
    moves[:, 1] = TrackLayout(moves[:, 0]).take(reader)
    after = reader.read_sums(head.events)
    kinds = reader.read_column(head.events)
    sizes = reader.read_column(head.events)
    data_ends = _compute_ends(sizes, len(data), "bytes")
    found = _take_tracks(reader, kinds, sizes)
    reader.finish()
    moves.setflags(write=False)  # because views of it are returned
    turns = np.repeat(np.arange(head.turns), np.diff(event_ends))  # of the events
    if (after < move_ends[turns]).any() or (after > move_ends[turns + 1]).any() or (after[1:] < after[:-1]).any():
        raise BadFile("an event is out of place")
    values = EventValues(data, data_ends, decoder, charged)
    places = {kind: np.flatnonzero(kinds == kind) for kind in found}
    return Chunk(head.first, move_ends, event_ends, moves, after, kinds, values, found, places)


def _take_tracks(reader: ByteReader, kinds: IntArray, sizes: IntArray) -> dict[int, EventTracks]:
    found = {}
    for kind in sorted(FORMS):
        is_one = kinds == kind
        if is_one.any():
            if sizes[is_one].any():
                raise BadFile(f"an event of kind {kind:#010x} has data that are not numbers")
            found[kind] = EventTracks.take(reader, kind, int(np.count_nonzero(is_one)))
    return found


def _compute_ends(sizes: IntArray, total: int, what: str) -> IntArray:
    """Return the end of each part, given the sizes, after a 0."""
    ends = np.zeros(len(sizes) + 1, np.int64)
    if len(sizes) and (int(sizes.min()) < 0 or int(sizes.max()) > total):
        raise BadFile(f"its numbers of {what} are damaged")
    np.cumsum(sizes, out=ends[1:])
    if int(ends[-1]) != total:
        raise BadFile(f"its {what} do not add up to {total}")
    return ends
