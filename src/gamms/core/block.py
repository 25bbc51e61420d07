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
        columns: as given.
        games: as given.
        sizes: axis -> how many rows each game has in use.
    """

    def __init__(self, columns: Sequence[BlockColumn], games: int = 1) -> None:
        self.columns = tuple(columns)
        self.games = games
        self.sizes = {"agent": 0, "team": 0, "game": 1}
        self._room = {"agent": 0, "team": 0, "game": 1}
        self._bytes = {one.name: self._filled(one, games) for one in self.columns}

    def array(self, name: str) -> memoryview[Any]:
        """Return a column of all games with the rows that are free, (games, rows) or (games, rows, width).

        It is the memory itself, until the block grows. A column of the game is (games,) or (games, width).
        """
        column = self._column(name)
        shape = [self.games, self._room[column.axis], column.width]
        if column.width == 1:
            shape.pop()
        if column.axis == "game":
            del shape[1]
        return _view(self._bytes[name], column.code, shape)

    def row(self, name: str, game: int = 0) -> memoryview[Any]:
        """Return the rows in use of a column in one game, (rows * width,): the memory itself, until the block grows."""
        column = self._column(name)
        numbers = _view(self._bytes[name], column.code)
        first = game * self._room[column.axis] * column.width
        return numbers[first : first + self.sizes[column.axis] * column.width]

    def add(self, count: int, axis: str = "agent") -> int:
        """Add rows of an axis to every game, which have the initial numbers; return the first of them."""
        first = self.sizes[axis]
        room = self._room[axis]
        if first + count > room:
            self._grow(axis, max(first + count, room + room // 2))
        self.sizes[axis] = first + count
        for column in self.columns:
            if column.axis == axis:
                self._reset(column, first, count)
        return first

    def close_up(self, gone: Sequence[int], axis: str = "agent") -> None:
        """Remove rows of an axis, ascending, from every game."""
        for column in self.columns:
            for game in range(self.games if column.axis == axis else 0):
                _close_up(self.row(column.name, game), gone, column.width)
        self.sizes[axis] -= len(gone)

    def copy_row(self, source: int, target: int, of: Block | None = None) -> None:
        """Make one game a copy of another.

        Args:
            source: the game that is copied.
            target: the game that becomes the copy.
            of: the block that the source is in, of the same columns; None: this one.
        """
        block = self if of is None else of
        for axis, size in block.sizes.items():
            if size > self.sizes[axis]:
                self.add(size - self.sizes[axis], axis)
            self.sizes[axis] = size
        for column in self.columns:
            if column.is_copied:
                self.row(column.name, target)[:] = block.row(column.name, source)
            else:
                self._reset(column, 0, self.sizes[column.axis], target)

    def copied(self, game: int = 0) -> Block:
        """Return a block of one game, which is a copy of one of these."""
        copy = Block(self.columns)
        copy.copy_row(game, 0, self)
        return copy

    def _column(self, name: str) -> BlockColumn:
        for column in self.columns:
            if column.name == name:
                return column
        raise KeyError(name)

    def _filled(self, column: BlockColumn, games: int) -> bytearray:
        """Return the memory of a column in which all rows have the initial number."""
        numbers = column.width * self._room[column.axis] * games
        return _bytes_of(column) * numbers

    def _grow(self, axis: str, room: int) -> None:
        """Have room for so many rows of an axis."""
        before = dict(self._room)
        self._room[axis] = room
        for column in self.columns:
            if column.axis == axis:
                old = self._bytes[column.name]
                new = bytearray(calcsize(column.code) * column.width * room * self.games)
                step = len(old) // self.games
                for game in range(self.games if before[axis] else 0):
                    first = game * (len(new) // self.games)
                    new[first : first + step] = old[game * step : (game + 1) * step]
                self._bytes[column.name] = new

    def _reset(self, column: BlockColumn, first: int, count: int, game: int | None = None) -> None:
        """Give rows the initial numbers, in one game or in all."""
        initial = _view(_bytes_of(column) * (count * column.width), column.code)
        for one in range(self.games) if game is None else (game,):
            self.row(column.name, one)[first * column.width : (first + count) * column.width] = initial


def _view(memory: bytearray, code: str, shape: Sequence[int] | None = None) -> memoryview[Any]:
    """Return memory as numbers of a format, in one dimension or in a shape."""
    numbers: memoryview[Any] = memoryview(memory).cast(code)  # type: ignore[call-overload] # which knows literals only
    return numbers if shape is None or not memory else numbers.cast("B").cast(code, shape)  # type: ignore[call-overload]


def _bytes_of(column: BlockColumn) -> bytearray:
    """Return the memory of one initial number."""
    memory = bytearray(calcsize(column.code))
    _view(memory, column.code)[0] = column.initial
    return memory


def _close_up(numbers: memoryview[Any], gone: Sequence[int], width: int) -> None:
    """Move rows of `width` numbers forward to the places of rows that are gone."""
    size = len(numbers) // width
    target = gone[0] * width if gone else 0
    for i, row in enumerate(gone):
        first = (row + 1) * width
        last = (gone[i + 1] if i + 1 < len(gone) else size) * width
        numbers[target : target + last - first] = numbers[first:last]
        target += last - first


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
