"""A block of games: all columns of a game in one piece of memory, and loops over the agents of one game.

A column has one or several numbers for each agent, for each team, or for the game. A normal game is a block with one
row; copying a row makes a snapshot, and a free row can hold a fork. A block reserves memory for more agents than it
has, so that adding an agent takes constant time on average.

A `RecordTable` numbers records, such as states of games: equal ones have equal numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from struct import calcsize
from typing import Any, NamedTuple

INT64 = "l" if calcsize("l") == 8 else "q"
"""The format of 64-bit integers in buffers, as NumPy names it on this platform."""
_ALIGNED = 8  # bytes
_DRAWN = -2
AT_START = _DRAWN
"""In a row of nodes with which games begin: the agent begins on the node that the seed of its game draws."""
MASK = 0xFFFFFFFFFFFFFFFF
FACTOR = 0x9E3779B97F4A7C15
EMPTY = -1


class BlockColumn(NamedTuple):
    """A column of a block.

    Attributes:
        name: the name of the column.
        code: the format of its numbers: `INT64`, "d" for floats, "?" for booleans.
        initial: the number in new rows.
        axis: "agent", "flyer" (an agent that flies), "team" or "game": the column has a row for each of them.
        width: the numbers in a row.
        is_copied: whether copies of a game keep the numbers; otherwise they start with the initial number.
    """

    name: str
    code: str
    initial: float
    axis: str = "agent"
    width: int = 1
    is_copied: bool = True


class Block:
    """Games with the same columns, and with equal numbers of agents and of teams.

    All numbers of a game lie in one piece of memory, so that copying a game is one copy of memory.

    Args:
        columns: the columns.
        games: the number of games.

    Attributes:
        columns: name -> column.
        games: the number of games.
        sizes: axis -> the number of rows in use in each game.
        memory: the numbers of all games; free rows hold the initial number.
    """

    def __init__(self, columns: Sequence[BlockColumn], games: int = 1) -> None:
        self.columns = {one.name: one for one in columns}
        self.games = games
        self.sizes = {"agent": 0, "flyer": 0, "team": 0, "game": 1}
        self._own = [one.name for one in columns if not one.is_copied]
        self._make_room({"agent": 1, "flyer": 0, "team": 1, "game": 1})

    def __getstate__(self) -> tuple[Any, ...]:
        """Return the attributes for copying and pickling."""
        return self.columns, self.games, self.sizes, self._own, self._room, self._first, self._stride, self.memory

    def __setstate__(self, state: tuple[Any, ...]) -> None:
        """Set the attributes of a copy."""
        self.columns, self.games, self.sizes, self._own, self._room, self._first, self._stride, self.memory = state
        self._views: dict[str, memoryview[Any]] = {}  # format -> the memory in this format, for `get_row`

    def get_row(self, name: str, game: int = 0) -> memoryview[Any]:
        """Return a column of one game, (rows in use * width,).

        It is a view of the memory, valid until the block grows.
        """
        column = self.columns[name]
        code = column.code
        view = self._views.get(code)
        if view is None:
            view = _cast_memory(self.memory, code)
            self._views[code] = view
        first = (game * self._stride + self._first[name]) // view.itemsize
        return view[first : first + self.sizes[column.axis] * column.width]

    def add(self, count: int, axis: str = "agent") -> int:
        """Add `count` rows of an axis, with initial numbers, to every game; return the first new row."""
        first = self.sizes[axis]
        if first + count > self._room[axis]:
            self._move({**self._room, axis: max(first + count, 2 * first)})
        self.sizes[axis] = first + count
        return first

    def close_up(self, gone: Sequence[int], axis: str = "agent") -> None:
        """Remove rows of an axis, given in ascending order, from every game."""
        for column in self.columns.values():
            for game in range(self.games if column.axis == axis else 0):
                _close_up(self.get_row(column.name, game), gone, column)
        self.sizes[axis] -= len(gone)

    def copy_row(self, source: int, target: int, of: Block | None = None) -> None:
        """Copy one game over another one; if the numbers of rows differ, the block gets new memory.

        Args:
            source: the game to copy.
            target: the game to overwrite.
            of: the block of the source, with the same columns; None: this block.
        """
        block = self if of is None else of
        for axis, size in block.sizes.items() if block.sizes != self.sizes else ():
            if size < self.sizes[axis]:
                self.close_up(range(size, self.sizes[axis]), axis)
            elif size > self.sizes[axis]:
                self.add(size - self.sizes[axis], axis)
        if block._room != self._room:
            self._move(block._room)
        size = self._stride
        self.memory[target * size : (target + 1) * size] = block.memory[source * size : (source + 1) * size]
        self._begin_own(target)

    def copy_game(self, game: int = 0) -> Block:
        """Return a new block that holds a copy of one game."""
        copy = Block.__new__(Block)
        size = self._stride
        memory = self.memory[game * size : (game + 1) * size]
        copy.__setstate__((self.columns, 1, self.sizes.copy(), self._own, self._room, self._first, size, memory))
        copy._begin_own(0)
        return copy

    def _begin_own(self, game: int) -> None:
        """Reset the columns with `is_copied=False` to their initial numbers."""
        for name in self._own:
            numbers = self.get_row(name, game)
            numbers[:] = _make_column(self.columns[name], len(numbers))

    def _make_room(self, room: dict[str, int]) -> None:
        """Allocate memory for these numbers of rows of each axis, all of them free."""
        self._room = room
        self._first = {}
        parts: list[bytes] = []
        size = 0
        for name, column in self.columns.items():
            self._first[name] = size
            numbers = bytes(_make_column(column, room[column.axis] * column.width))
            padding = bytes(-len(numbers) % _ALIGNED)
            parts += numbers, padding
            size += len(numbers) + len(padding)
        self._stride = size
        self.memory = bytearray(b"".join(parts) * self.games)
        self._views = {}

    def _move(self, room: dict[str, int]) -> None:
        """Reallocate with these numbers of rows of each axis, and keep the rows in use."""
        each = [(name, game) for name in self.columns for game in range(self.games)]
        before = [self.get_row(name, game) for name, game in each]
        self._make_room(room)
        for (name, game), numbers in zip(each, before, strict=True):
            self.get_row(name, game)[:] = numbers


def _close_up(numbers: memoryview[Any], gone: Sequence[int], column: BlockColumn) -> None:
    """Move rows forward over removed rows, and reset the rows at the end."""
    size = len(numbers) // column.width
    target = gone[0] * column.width if gone else len(numbers)
    for i, row in enumerate(gone):
        first = (row + 1) * column.width
        last = (gone[i + 1] if i + 1 < len(gone) else size) * column.width
        numbers[target : target + last - first] = numbers[first:last]
        target += last - first
    numbers[target:] = _make_column(column, len(numbers) - target)


def _make_column(column: BlockColumn, count: int) -> memoryview[Any]:
    """Return `count` copies of the initial number of a column."""
    memory = bytearray(calcsize(column.code))
    _cast_memory(memory, column.code)[0] = column.initial
    return _cast_memory(memory * max(count, 1), column.code)[:count]


def _cast_memory(memory: bytearray, code: str) -> memoryview[Any]:
    """Return memory as an array of numbers of a format."""
    numbers: memoryview[Any] = memoryview(memory).cast(code)  # type: ignore[call-overload] # which knows literals only
    return numbers


# -- loops over the agents of one game ----------------------------------------------------------------------------


def gather(column: memoryview[int], rows: memoryview[int], out: memoryview[int]) -> int:
    """Write the entries of a column at `rows`, (rows,), to `out`.

    Raises:
        IndexError: a row does not exist.
    """
    size = len(column)
    for i in range(len(rows)):
        row = rows[i]
        if row < 0 or row >= size:
            raise IndexError(f"There is no row {row}.")
        out[i] = column[row]
    return 0


def move_rows(node: memoryview[int], previous: memoryview[int], rows: memoryview[int], ends: memoryview[int]) -> int:
    """Move agents to nodes, and set the previous node of those that leave theirs; return the number of these agents.

    Args:
        node: the column of current nodes.
        previous: the column of previous nodes.
        rows: (agents,) the rows of the agents.
        ends: (agents,) the ids of the nodes.

    Raises:
        IndexError: a row does not exist; the agents before it have moved.
    """
    size = len(node)
    moved = 0
    for i in range(len(rows)):
        row = rows[i]
        if row < 0 or row >= size:
            raise IndexError(f"There is no row {row}.")
        end = ends[i]
        if node[row] != end:
            previous[row] = node[row]
            node[row] = end
            moved += 1
    return moved


def stop_moves(
    starts: memoryview[int],
    ends: memoryview[int],
    counts: memoryview[int],
    losers: memoryview[int],
    stopped: memoryview[int],
    nodes: memoryview[int],
) -> int:
    """Keep agents where they start; return how many of them would have moved.

    Args:
        starts: (agents,) the nodes where the moves begin.
        ends: (agents,) the nodes where they end; changed.
        counts: (agents,) the number of stopped moves of each agent; increased.
        losers: (losers,) the agents.
        stopped: (losers,) set to the agents that would have moved.
        nodes: (losers,) set to the nodes to which these would have moved.
    """
    found = 0
    for place in range(len(losers)):
        i = losers[place]
        if starts[i] != ends[i]:
            stopped[found] = i
            nodes[found] = ends[i]
            found += 1
            ends[i] = starts[i]
            counts[i] += 1
    return found


# -- games that begin --------------------------------------------------------------------------------------------------


class StartColumn:
    """A column of a batch, and the rows with which its games begin.

    Attributes:
        target: (games * size,) the bytes of the column.
        source: the bytes of the rows: one for all games, or one for each start; see `GameStarts`.
        nodes: (games * agents,) the column, if it holds nodes of agents, which may be `AT_START`; else empty.
        size: the number of bytes in a row.
        step: the distance between two rows in `source`; 0: all games begin with the same row.
        behind: the next column; None: it is the last one.
    """

    def __init__(
        self,
        target: memoryview[int],
        source: memoryview[int],
        nodes: memoryview[int],
        size: int,
        step: int,
        behind: StartColumn | None,
    ) -> None:
        self.target = target
        self.source = source
        self.nodes = nodes
        self.size = size
        self.step = step
        self.behind = behind
        self.has_nodes = len(nodes) > 0
        self.is_last = behind is None


class GameStarts:
    """The rows with which the games on one map begin.

    Attributes:
        first: the first column.
        nodes: (rows * agents,) the start nodes that seeds draw.
        agents: the number of agents of each game.
        streets: (rows,) the number of the streets that each seed draws.
        next: (games,) the row with which each game begins next.
        now: (games,) the row with which it has begun.
        ahead: the number of rows of each game, which follow each other.
    """

    def __init__(
        self,
        first: StartColumn,
        nodes: memoryview[int],
        agents: int,
        streets: memoryview[int],
        next: memoryview[int],
        now: memoryview[int],
        ahead: int,
    ) -> None:
        self.first = first
        self.nodes = nodes
        self.agents = agents
        self.streets = streets
        self.next = next
        self.now = now
        self.ahead = ahead

    def begin(self, games: memoryview[int]) -> int:
        """Begin the games of these numbers on this map."""
        for place in range(len(games)):
            begin_game(self, games[place])
        return 0


def begin_game(s: GameStarts, game: int) -> int:
    """Begin a game: copy the rows with which it begins over its own."""
    row = s.next[game]
    s.now[game] = row
    s.next[game] = game * s.ahead + (row + 1) % s.ahead
    return _copy_start(s.first, s.nodes, s.agents, game, row)


def _copy_start(c: StartColumn, nodes: memoryview[int], agents: int, game: int, row: int) -> int:
    """Copy a row over that of a game, in a column and in those behind it."""
    _copy_bytes(c.target, game * c.size, c.source, row * c.step, c.size)
    if c.has_nodes:
        for i in range(agents):
            if c.nodes[game * agents + i] == _DRAWN:
                c.nodes[game * agents + i] = nodes[row * agents + i]
    if not c.is_last:
        _copy_start(c.behind, nodes, agents, game, row)  # type: ignore[arg-type] # there is one
    return 0


def _copy_bytes(target: memoryview[int], first: int, source: memoryview[int], begin: int, size: int) -> int:
    """Copy `source[begin:begin + size]` to `target[first:first + size]`."""
    # NOTE: a function of its own, because bytes that are written may overlap attributes (benchmarks: w9_rows, begin).
    for i in range(size):
        target[first + i] = source[begin + i]
    return 0


class RecordTable:
    """Numbers of records of 64-bit words, in the order in which they were first added.

    It is a hash table with linear probing, whose memory the caller owns. The hash has no secret; it only spreads
    records over the slots.

    Args:
        words: the number of words of a record.

    Attributes:
        count: the number of records.
    """

    def __init__(self, words: int) -> None:
        self.words = words
        self.count = 0

    def take_memory(self, records: memoryview[int], slots: memoryview[int]) -> int:
        """Use other memory from now on.

        Args:
            records: (room * words,) 64-bit words without sign; the first `count` records are those of the table.
            slots: (slots,) integers; their number is a power of two, and at least twice the room.
        """
        self.records = records
        self.slots = slots
        for i in range(len(slots)):
            slots[i] = EMPTY
        for number in range(self.count):
            slots[find_slot(self, records, number)] = number
        return 0

    def add(self, rows: memoryview[int], out: memoryview[int]) -> int:
        """Write the numbers of rows of words, (rows,); give new numbers to new records, for which there is room."""
        for row in range(len(out)):
            slot = find_slot(self, rows, row)
            if self.slots[slot] == EMPTY:
                for i in range(self.words):
                    self.records[self.count * self.words + i] = rows[row * self.words + i]
                self.slots[slot] = self.count
                self.count += 1
            out[row] = self.slots[slot]
        return 0


def find_slot(t: RecordTable, rows: memoryview[int], row: int) -> int:
    """Return the slot of a row of words: the one with the number of an equal record, or the empty one for a new one."""
    begin = row * t.words
    key = 0
    for i in range(t.words):
        key = ((key ^ rows[begin + i]) * FACTOR) & MASK
        key = key ^ (key >> 29)
    last = len(t.slots) - 1
    slot = key & last
    while t.slots[slot] != EMPTY and not is_equal(t, t.slots[slot], rows, begin):
        slot = (slot + 1) & last
    return slot


def is_equal(t: RecordTable, number: int, rows: memoryview[int], begin: int) -> bool:
    """Return whether the record with a number equals the row that begins at this word."""
    first = number * t.words
    i = 0
    while i < t.words and t.records[first + i] == rows[begin + i]:
        i += 1
    return i == t.words
