"""A block of games: one array per column, whose first axis is the game, and the loops over the agents of one game.

A column belongs to agents, to teams or to the game itself, and has one number or several for each of them. The ordinary
game is a block of one; copying a row is a snapshot, and a row that is free holds a fork. A block has room for more
agents than there are, so that adding one takes constant time on average.
"""

from __future__ import annotations

from collections.abc import Sequence
from struct import calcsize
from typing import Any, NamedTuple

INT64 = "l" if calcsize("l") == 8 else "q"
"""The format of 64-bit integers in buffers, as NumPy names it on this platform."""


class BlockColumn(NamedTuple):
    """A column of a block.

    Attributes:
        name: of the column.
        code: the format of its numbers: `INT64`, "d" for floats, "?" for booleans.
        initial: the number that new rows have.
        axis: what has a row in it: "agent", "team" or "game".
        width: how many numbers a row has.
        is_copied: whether copies of a game have it; otherwise they begin with the initial number.
    """

    name: str
    code: str
    initial: float
    axis: str = "agent"
    width: int = 1
    is_copied: bool = True


class Block:
    """Games of the same columns, which have as many agents and teams each.

    Args:
        columns: which.
        games: how many.

    Attributes:
        columns: name -> column.
        games: as given.
        sizes: axis -> how many rows each game has in use.
        numbers: name -> all numbers of a column, those of rows that are free too, (games * rows * width,): the memory
            itself, until the block grows. Free rows have the initial number.
    """

    def __init__(self, columns: Sequence[BlockColumn], games: int = 1) -> None:
        self.columns = {one.name: one for one in columns}
        self.games = games
        self.sizes = {"agent": 0, "team": 0, "game": 1}
        self._room = {"agent": 0, "team": 0, "game": 1}
        self.numbers = {one.name: self._filled(one) for one in columns}

    def __getstate__(self) -> tuple[Any, ...]:
        """Return what a copy is made of."""
        memory = {name: bytearray(numbers) for name, numbers in self.numbers.items()}
        return [*self.columns.values()], self.games, self.sizes.copy(), self._room.copy(), memory

    def __setstate__(self, state: tuple[Any, ...]) -> None:
        """Become a copy."""
        columns, self.games, self.sizes, self._room, memory = state
        self.columns = {one.name: one for one in columns}
        self.numbers = {name: _view(one, self.columns[name].code) for name, one in memory.items()}

    def array(self, name: str) -> memoryview[Any]:
        """Return a column of all games with the rows that are free, (games, rows) or (games, rows, width).

        It is the memory itself, until the block grows. A column of the game is (games,) or (games, width).
        """
        column = self.columns[name]
        shape = [self.games, self._room[column.axis], column.width]
        if column.width == 1:
            shape.pop()
        if column.axis == "game":
            del shape[1]
        numbers = self.numbers[name]
        return numbers.cast("B").cast(column.code, shape) if len(numbers) else numbers  # type: ignore[call-overload]

    def row(self, name: str, game: int = 0) -> memoryview[Any]:
        """Return the rows in use of a column in one game, (rows * width,): the memory itself, until the block grows."""
        column = self.columns[name]
        axis, width = column.axis, column.width
        first = game * self._room[axis] * width
        return self.numbers[name][first : first + self.sizes[axis] * width]

    def add(self, count: int, axis: str = "agent") -> int:
        """Add rows of an axis to every game, which have the initial numbers; return the first of them."""
        first = self.sizes[axis]
        if first + count > self._room[axis]:
            self._grow(axis, max(first + count, 2 * first))
        self.sizes[axis] = first + count
        return first

    def close_up(self, gone: Sequence[int], axis: str = "agent") -> None:
        """Remove rows of an axis, ascending, from every game."""
        for column in self._on(axis):
            for game in range(self.games):
                _close_up(self.row(column.name, game), gone, column)
        self.sizes[axis] -= len(gone)

    def copy_row(self, source: int, target: int, of: Block | None = None) -> None:
        """Make one game a copy of another.

        Args:
            source: the game that is copied.
            target: the game that becomes the copy.
            of: the block that the source is in, of the same columns; None: this one.
        """
        block = self if of is None else of
        for axis, size in block.sizes.items() if block.sizes != self.sizes else ():
            if size < self.sizes[axis]:
                self.close_up(range(size, self.sizes[axis]), axis)
            elif size > self.sizes[axis]:
                self.add(size - self.sizes[axis], axis)
        for name, column in self.columns.items():
            if column.is_copied:
                self.row(name, target)[:] = block.row(name, source)
            else:
                numbers = self.row(name, target)
                numbers[:] = _initial(column, len(numbers))

    def copied(self, game: int = 0) -> Block:
        """Return a block of one game, which is a copy of one of these."""
        copy = Block.__new__(Block)
        copy.columns = self.columns
        copy.games = 1
        copy.sizes = self.sizes.copy()
        copy._room = self.sizes.copy()
        copy.numbers = {}
        for name, column in self.columns.items():
            numbers = self.row(name, game)
            kept = _view(bytearray(numbers), column.code) if column.is_copied else _initial(column, len(numbers))
            copy.numbers[name] = kept
        return copy

    def _on(self, axis: str) -> list[BlockColumn]:
        """Return the columns of an axis."""
        return [column for column in self.columns.values() if column.axis == axis]

    def _filled(self, column: BlockColumn) -> memoryview[Any]:
        """Return the numbers of a column in which all rows have the initial number."""
        return _initial(column, self.games * self._room[column.axis] * column.width)

    def _grow(self, axis: str, room: int) -> None:
        """Have room for so many rows of an axis."""
        before = self._room[axis]
        self._room[axis] = room
        for column in self._on(axis):
            numbers = self._filled(column)
            for game in range(self.games):
                first, old = game * room * column.width, game * before * column.width
                step = before * column.width
                numbers[first : first + step] = self.numbers[column.name][old : old + step]
            self.numbers[column.name] = numbers


def _close_up(numbers: memoryview[Any], gone: Sequence[int], column: BlockColumn) -> None:
    """Move rows forward to the places of rows that are gone, and free those at the end."""
    size = len(numbers) // column.width
    target = gone[0] * column.width if gone else len(numbers)
    for i, row in enumerate(gone):
        first = (row + 1) * column.width
        last = (gone[i + 1] if i + 1 < len(gone) else size) * column.width
        numbers[target : target + last - first] = numbers[first:last]
        target += last - first
    numbers[target:] = _initial(column, len(numbers) - target)


def _initial(column: BlockColumn, count: int) -> memoryview[Any]:
    """Return the initial number of a column so many times."""
    memory = bytearray(calcsize(column.code))
    _view(memory, column.code)[0] = column.initial
    return _view(memory * count, column.code)


def _view(memory: bytearray, code: str) -> memoryview[Any]:
    """Return memory as numbers of a format."""
    numbers: memoryview[Any] = memoryview(memory).cast(code)  # type: ignore[call-overload] # which knows literals only
    return numbers


# -- loops over the agents of one game ----------------------------------------------------------------------------


def gather(column: memoryview[int], rows: memoryview[int], out: memoryview[int]) -> int:
    """Write what a column holds in some rows, (rows,).

    Raises:
        IndexError: the column has no such row.
    """
    size = len(column)
    for i in range(len(rows)):
        row = rows[i]
        if row < 0 or row >= size:
            raise IndexError(f"There is no row {row}.")
        out[i] = column[row]
    return 0


def move_rows(node: memoryview[int], previous: memoryview[int], rows: memoryview[int], ends: memoryview[int]) -> int:
    """Move agents to nodes, `rows` and `ends` (agents,); return how many do not stay, which get a previous node.

    Raises:
        IndexError: the columns have no such row; agents before it have moved.
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


def count_moves(starts: memoryview[int], ends: memoryview[int], counts: memoryview[int]) -> int:
    """Add 1 to the count of each agent that ends elsewhere than it starts; return how many these are."""
    moved = 0
    for i in range(len(starts)):
        if starts[i] != ends[i]:
            counts[i] += 1
            moved += 1
    return moved
