"""The turns of one block: collected as they happen, written as columns, read as arrays.

Moves of one row lie side by side, in their order, and each but the first is the difference from the one before: what an
agent does next resembles what it did before. The body is nine columns:

    turns:  moves of each; events of each
    moves:  rows, as differences from the move before; of each row, ascending, the node it first moves to, as
            differences from the row before; of each row all other moves, as differences
    events: how many moves of the block come before each, as differences; kinds; sizes in bytes; then all data
"""

from array import array
from collections.abc import Sequence
from dataclasses import dataclass
from reprlib import repr as shown
from typing import Any

import numpy as np

from gamms.errors import BadFile, BadType, BadValue
from gamms.recorder.formats import blocks, columns, values
from gamms.recorder.formats.columns import IntArray

Log = list[Any]
"""The log of one turn: ints two by two, and tuples."""

_BYTES_PER_MOVE, _BYTES_PER_EVENT = 4, 8  # estimates that cost nothing


@dataclass(slots=True)
class Turn:
    """The log of one turn, checked and taken apart."""

    moves: "array[int]"  # row, node, row, node, …
    after: Sequence[int] = ()  # moves of the turn before each event
    kinds: Sequence[int] = ()
    data: Sequence[bytes] = ()


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
    for _ in range(types.count(tuple)):
        end = types.index(tuple, begin)
        moves.extend(_moves(log[begin:end]))
        after.append(len(moves) // 2)
        kind, one = _checked_event(log[end])
        kinds.append(kind)
        data.append(values.to_bytes(one, f"An event of kind {kind}"))
        begin = end + 1
    moves.extend(_moves(log[begin:]))
    return Turn(moves, after, kinds, data)


def _moves(numbers: Log) -> "array[int]":
    _check_pairs(len(numbers))
    try:
        return array("q", numbers)
    except TypeError as error:
        raise BadType(f"A log has ints and tuples (kind, data); this one has something else ({error}).") from None
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


class Collected:
    """The turns that wait for their block."""

    def __init__(self, first: int) -> None:
        self.first = first
        self.size = 0  # in bytes, an estimate
        self._moves = array("q")
        self._turns: tuple[list[int], list[int]] = [], []  # moves, events of each turn
        self._after: list[int] = []
        self._kinds: list[int] = []
        self._data: list[bytes] = []

    def __len__(self) -> int:
        return len(self._turns[0])

    @property
    def counts(self) -> blocks.Counts:
        """What the head of the block says."""
        return blocks.Counts(self.first, len(self), len(self._moves) // 2, len(self._kinds))

    def fits(self, turn: Turn) -> bool:
        """Whether a turn can still join."""
        moves, events = len(self._moves) + len(turn.moves), len(self._kinds) + len(turn.kinds)
        return moves <= 2 * blocks.MOST_MOVES and events <= blocks.MOST_EVENTS

    def add(self, turn: Turn) -> None:
        """Let a turn join."""
        moves, before = len(turn.moves) // 2, len(self._moves) // 2
        self._moves.extend(turn.moves)
        self._turns[0].append(moves)
        self._turns[1].append(len(turn.kinds))
        self.size += _BYTES_PER_MOVE * moves
        if turn.kinds:
            self._after.extend(before + after for after in turn.after)
            self._kinds.extend(turn.kinds)
            self._data.extend(turn.data)
            self.size += _BYTES_PER_EVENT * len(turn.kinds) + sum(map(len, turn.data))

    def add_moves(self, moves: "array[int]", count: int) -> bool:
        """Let a turn of so many moves and nothing else join; False, and nothing happens, if it cannot."""
        if len(self._moves) + len(moves) > 2 * blocks.MOST_MOVES:
            return False
        self._moves.extend(moves)
        self._turns[0].append(count)
        self._turns[1].append(0)
        self.size += _BYTES_PER_MOVE * count
        return True

    def body(self) -> bytes:
        """The body of the block."""
        moves = np.frombuffer(self._moves, np.int64).reshape(-1, 2)
        data = b"".join(self._data)
        parts = [columns.put(np.array(column, np.int64)) for column in self._turns]
        parts += [columns.put(column) for column in _columns_of_moves(moves[:, 0], moves[:, 1])]
        parts.append(columns.put(_steps(np.array(self._after, np.int64))))
        parts.append(columns.put(np.array(self._kinds, np.int64)))
        parts.append(columns.put(np.array([len(one) for one in self._data], np.int64)))
        return b"".join([*parts, blocks.put_bytes(data)])


def _columns_of_moves(rows: IntArray, nodes: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    order = _by_row(rows)
    sorted_nodes, is_first = nodes[order], _is_first(rows[order])
    return _steps(rows), _steps(sorted_nodes[is_first]), _steps(sorted_nodes)[~is_first]


def _steps(numbers: IntArray) -> IntArray:
    """Differences from the number before, which wrap around at 64 bits."""
    return numbers - np.concatenate((np.zeros(1, np.int64), numbers))[:-1]


def _by_row(rows: IntArray) -> IntArray:
    """The moves of each row side by side, in their order."""
    if len(rows) and int(rows.min()) >= 0 and int(rows.max()) < 1 << 16:
        return rows.astype(np.uint16).argsort(kind="stable")  # NOTE: a radix sort, 5 times as fast on unordered rows
    return rows.argsort(kind="stable")


def _is_first(sorted_rows: IntArray) -> np.ndarray[Any, np.dtype[np.bool_]]:
    is_first = np.ones(len(sorted_rows), np.bool_)
    is_first[1:] = sorted_rows[1:] != sorted_rows[:-1]
    return is_first


# -- reading ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Chunk:
    """The turns of a block."""

    first: int
    move_ends: IntArray  # (turns + 1,): turn i has the moves from move_ends[i] to move_ends[i + 1]
    event_ends: IntArray  # (turns + 1,)
    moves: IntArray  # (moves, 2): row, node
    after: IntArray  # (events,): moves of the block before it
    kinds: IntArray  # (events,)
    data_ends: IntArray  # (events + 1,)
    data: bytes

    def event(self, i: int) -> Any:
        """The data of an event.

        Raises:
            BadFile: it is damaged.
        """
        return values.from_bytes(self.data[self.data_ends[i] : self.data_ends[i + 1]])

    def log(self, turn: int) -> Log:
        """What was added as a turn of the recording."""
        turn -= self.first
        begin, end = self.move_ends[turn : turn + 2].tolist()
        flat: Log = self.moves[begin:end].reshape(-1).tolist()
        first, last = self.event_ends[turn : turn + 2].tolist()
        if first == last:
            return flat
        log: Log = []
        at = 0
        for i in range(first, last):
            until = 2 * (int(self.after[i]) - begin)
            log += flat[at:until]
            log.append((int(self.kinds[i]), self.event(i)))
            at = until
        return log + flat[at:]


def chunk_of(head: blocks.Head, body: bytes) -> Chunk:
    """The turns of a block.

    Raises:
        BadFile: it is damaged.
    """
    cursor = columns.Cursor(body)
    move_ends = _ends(columns.take(cursor, head.turns), head.moves, "moves")
    event_ends = _ends(columns.take(cursor, head.turns), head.events, "events")
    moves = np.empty((head.moves, 2), np.int64)
    np.cumsum(columns.take(cursor, head.moves), out=moves[:, 0])
    moves[:, 1] = _take_nodes(cursor, moves[:, 0])
    after = np.cumsum(columns.take(cursor, head.events), dtype=np.int64)
    kinds = columns.take(cursor, head.events)
    sizes = columns.take(cursor, head.events)
    data = blocks.take_bytes(cursor)
    cursor.finish()
    moves.setflags(write=False)  # views of it are handed out
    turns = np.repeat(np.arange(head.turns), np.diff(event_ends))  # of the events
    if (after < move_ends[turns]).any() or (after > move_ends[turns + 1]).any() or (after[1:] < after[:-1]).any():
        raise BadFile("an event is out of place")
    return Chunk(head.first, move_ends, event_ends, moves, after, kinds, _ends(sizes, len(data), "bytes"), data)


def _take_nodes(cursor: columns.Cursor, rows: IntArray) -> IntArray:
    order = _by_row(rows)
    is_first = _is_first(rows[order])
    at = np.flatnonzero(is_first)
    firsts = np.cumsum(columns.take(cursor, len(at)), dtype=np.int64)
    steps = np.zeros(len(rows), np.int64)
    steps[~is_first] = columns.take(cursor, len(rows) - len(at))
    nodes = np.empty(len(rows), np.int64)
    sums = np.cumsum(steps)
    nodes[order] = sums + np.repeat(firsts - sums[at], np.diff(at, append=len(rows)))
    return nodes


def _ends(sizes: IntArray, total: int, what: str) -> IntArray:
    """Where each part ends that has such a size, after a 0."""
    ends = np.zeros(len(sizes) + 1, np.int64)
    if len(sizes) and (int(sizes.min()) < 0 or int(sizes.max()) > total):
        raise BadFile(f"its numbers of {what} are damaged")
    np.cumsum(sizes, out=ends[1:])
    if int(ends[-1]) != total:
        raise BadFile(f"its {what} do not add up to {total}")
    return ends
