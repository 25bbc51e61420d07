"""Columns of agents, as lists or views of arrays: selections of rows, logs of changed rows, and logs of games."""

from __future__ import annotations

from abc import ABC, abstractmethod
from bisect import bisect_left
from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Mapping, MutableSequence, Sequence
from functools import cached_property
from itertools import count
from operator import add, itemgetter
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from gamms.core.block import INT64, gather
from gamms.deciding import UNDECIDED, DecidePhase
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray

Column = np.ndarray[Any, Any]
P = TypeVar("P")
Table = TypeVar("Table", bound=NamedTuple)
_FEW = 16  # if fewer than one name in this many is requested, each is looked up
_FEW_DROPPED = 8  # number of positions up to which items are removed one by one
_MOST_NOTED = 1 << 16  # most rows in a `StructureLog`


class ChangeLog:
    """The rows of a block whose node, position, team or alive flag changed since this subscriber last read the log."""

    __slots__ = ("_publish", "rows")

    def __init__(self, publish: Callable[[], None]) -> None:
        self._publish = publish  # writes all changes to this log
        self.rows: set[int] | None = None

    def take(self) -> set[int] | None:
        """Return the changed rows; None if all may have changed, and rows may have other agents."""
        self._publish()
        rows = self.rows
        if rows is None or rows:
            self.rows = set()
        return rows


class StructureLog:
    """Log of added and removed rows, and of changes of teams, speeds, sensors or strategies.

    For one reader, which asks for the changes since the entry that it last read.

    Attributes:
        entries: the number of the last entry.
        version: a number that rises with each entry, and whenever agents die or return.
        phase: the phase of the context, whose epoch rises with each entry.
    """

    __slots__ = ("_closed", "_first", "_rows", "entries", "phase", "version")

    def __init__(self) -> None:
        self._first = 0  # the number before the first entry that is kept
        self.entries = 0
        self.version = 0
        self._rows: list[int | str] = []
        self._closed: list[tuple[int, list[int]]] = []  # (number of entries, rows closed up at that time)
        self.phase: DecidePhase = UNDECIDED

    def note(self, rows: Iterable[int]) -> None:
        """Record changes of these rows."""
        self._rows += rows
        self.entries = self._first + len(self._rows)
        self.version += 1
        self.phase.drop_plans()
        if len(self._rows) > _MOST_NOTED:
            self.note_all(self)

    def note_lives(self) -> None:
        """Record that agents have died or returned."""
        self.version += 1

    def note_all(self, before: StructureLog) -> None:
        """Record that all rows may have changed, and may have other agents, since the last entry of a log."""
        self._first = before.entries + 1
        self.entries = self._first
        self.version = before.version + 1
        self.phase.drop_plans()
        self._rows = []
        self._closed = []

    def close_up(self, gone: list[int], names: Sequence[str]) -> None:
        """Renumber rows after these rows, ascending, are closed up; record the names of these agents."""
        self._closed.append((self.entries, gone))
        name_of = {row: names[row] for row in gone}
        self._rows = [
            one if isinstance(one, str) else name_of.get(one, one - bisect_left(gone, one)) for one in self._rows
        ]

    def list_changes_since(self, entry: int) -> tuple[list[int | str], list[list[int]]] | None:
        """Return the changes since an entry; None if everything may have changed.

        Returns rows, and names of removed agents; and the lists of rows that were closed up, in order.
        """
        if entry < self._first:
            return None
        self._rows = self._rows[entry - self._first :]
        self._first = entry
        self._closed = [one for one in self._closed if one[0] > entry]
        return self._rows.copy(), [gone for _, gone in self._closed]


class RowsByName:
    """The rows of agents by name.

    An agent keeps its number while it exists, even if rows are closed up.

    Attributes:
        version: changes whenever agents get other rows, or rows belong to removed agents.
    """

    __slots__ = ("_number_of", "_numbers", "version")

    def __init__(self) -> None:
        self.version = 0
        self.reset(())

    def reset(self, names: Sequence[str]) -> None:
        """Set the names of all rows."""
        self._number_of: dict[str, int] = {}
        self._numbers: list[int] = []  # by row, ascending
        self.version += 1
        self.enter_all(names)

    def __contains__(self, name: str) -> bool:
        return name in self._number_of

    def enter(self, name: str) -> None:
        """Add a row."""
        number = self._numbers[-1] + 1 if self._numbers else 0
        self._number_of[name] = number
        self._numbers.append(number)

    def enter_all(self, names: Sequence[str]) -> None:
        """Add rows."""
        first = self._numbers[-1] + 1 if self._numbers else 0
        numbers = range(first, first + len(names))
        self._numbers += numbers
        self._number_of.update(zip(names, numbers, strict=True))

    def leave(self, name: str) -> None:
        """Remove a name; its row remains until it is closed up."""
        del self._number_of[name]
        self.version += 1

    def close_up(self, gone: Sequence[int]) -> None:
        """Remove the given rows, which are ascending."""
        drop(self._numbers, gone)
        self.version += 1

    def find_row(self, name: str) -> int:
        """Return the row of a name (KeyError)."""
        return bisect_left(self._numbers, self._number_of[name])

    def find_rows(self, names: Collection[str]) -> list[int]:
        """Return the rows of names (KeyError)."""
        if len(names) < len(self._numbers) // _FEW:
            return list(map(self.find_row, names))
        numbers = list(map(self._number_of.__getitem__, names))
        rows: list[int] = np.searchsorted(np.array(self._numbers, np.int64), numbers).tolist()
        return rows


class AgentSetChange:
    """How the agents, sorted by name, differ from those of an earlier moment.

    Args:
        before: names of the earlier agents.
        rows: rows that have changed since, and names of agents whose rows are gone.
        names: by row.
        closed: lists of rows that were closed up since, in order.

    Attributes:
        closed: as given.
        gone: indices of agents that are gone or have changed, ascending.
        rows: rows of agents that are new or have changed, sorted by name.
    """

    def __init__(
        self,
        before: Sequence[str],
        rows: Iterable[int | str],
        names: Sequence[str],
        closed: Sequence[list[int]] = (),
    ) -> None:
        self.closed = closed
        noted = set(rows)
        changed: dict[str, int | None] = {one: None for one in noted if isinstance(one, str)}
        # after the removals, because a new agent may have the name of a removed one
        changed |= {names[one]: one for one in noted if not isinstance(one, str)}
        ordered = sorted(changed)
        self.gone: list[int] = []
        self.rows = [row for name in ordered if (row := changed[name]) is not None]
        self._places = [] if before else [0] * len(self.rows)  # insert positions among the remaining agents
        for name in ordered if before else ():
            row = changed[name]
            i = bisect_left(before, name)
            if row is not None:
                self._places.append(i - len(self.gone))
            if i < len(before) and before[i] == name:
                self.gone.append(i)

    @property
    def places(self) -> list[int]:
        """The positions of new and changed agents."""
        return list(map(add, self._places, count()))

    def map_rows(self, rows: IntArray) -> IntArray:
        """Return the present rows of the earlier agents, without removed ones."""
        for gone in self.closed:
            rows = rows - np.searchsorted(gone, rows)
        return rows

    def update_array(self, column: Column, values: ArrayLike) -> Column:
        """Return an updated array column: without removed agents, with the values of new agents."""
        stays = np.ones(len(column), np.bool_)
        stays[self.gone] = False
        left = column[stays]
        new = np.asarray(values, column.dtype)
        parts = []
        begin = 0
        for i, place in enumerate(self._places):  # NOTE: half the time of `np.insert` (benchmarks: death)
            parts += [left[begin:place], new[i : i + 1]]
            begin = place
        return np.concatenate([*parts, left[begin:]])

    def update_list(self, column: Sequence[Any], values: Iterable[Any]) -> list[Any]:
        """Return an updated list column: without removed agents, with the values of new agents."""
        if not column:
            return [*values]
        left = remove_items(column, self.gone)
        if not self._places:
            return left
        return _replace_ranges(left, [(i, i, (value,)) for i, value in zip(self._places, values, strict=True)])


def remove_items(column: Sequence[Any], gone: Iterable[int]) -> list[Any]:
    """Return a list without the items at ascending positions."""
    return _replace_ranges(column, [(i, i + 1, ()) for i in gone])


def drop(column: list[Any], gone: Sequence[int]) -> None:
    """Delete the items at ascending positions of a list."""
    if len(gone) > _FEW_DROPPED:
        column[:] = remove_items(column, gone)
        return
    # NOTE: a tenth of the time of a new list, and no garbage (benchmarks: deletion).
    for i in reversed(gone):
        del column[i]


def _replace_ranges(column: Sequence[Any], cuts: Iterable[tuple[int, int, tuple[Any, ...]]]) -> list[Any]:
    """Return a list in which each cut, a range of positions, is replaced by other values."""
    joined: list[Any] = []
    at = 0
    for begin, end, values in cuts:
        joined += column[at:begin]
        joined += values
        at = end
    joined += column[at:]
    return joined


def copy_column(column: Any) -> Any:
    """Return a copy of a list, or of a view of an array."""
    return column.copy() if type(column) is list else np.array(column, np.int64).data


class Selection:
    """A selection of rows, in any order.

    Attributes:
        rows: the selected rows.
    """

    # NOTE: getters pick whole columns in C: every turn reads and writes all agents (benchmarks: turns). Slots are
    # read fast, also with a dict for cached values.

    __slots__ = ("__dict__", "_pick", "rows")

    def __init__(self, rows: list[int]) -> None:
        self.rows = rows
        self._pick: Callable[[Sequence[Any]], Iterable[Any]] | None = None

    def follow_change(self, change: AgentSetChange) -> Selection:
        """Return the rows of the agents after a change."""
        # NOTE: `array` exists if agents move as arrays (benchmarks: death, deletion).
        array = change.update_array(change.map_rows(self.array), change.rows)
        now = Selection(array.tolist() if change.closed else change.update_list(self.rows, change.rows))
        now.array = array
        return now

    @cached_property
    def as_set(self) -> frozenset[int]:
        """The rows as a set."""
        return frozenset(self.rows)

    @cached_property
    def array(self) -> IntArray:
        """The rows as an array."""
        return np.array(self.rows, np.int64)

    @cached_property
    def buffer(self) -> memoryview[int]:
        """The rows as a buffer for the core."""
        return self.array.data

    def gather(self, column: Sequence[Any]) -> Any:
        """Return the values of a column in these rows: a list, or a view of an array."""
        if type(column) is list:
            return self.list_values(column)
        view: Any = column if type(column) is memoryview else np.asarray(column).data
        if view.format != INT64:
            return np.asarray(view).take(self.array).data
        values = np.empty(len(self.rows), np.int64).data
        gather(view, self.buffer, values)
        return values

    def list_values(self, column: Sequence[Any]) -> list[Any]:
        """Return the values of a column in these rows as a list."""
        pick = self._pick
        if pick is None:
            pick = _make_picker(self.rows)
            self._pick = pick
        return [*pick(column)]

    def write(self, column: MutableSequence[Any], values: Sequence[Any]) -> None:
        """Set a column in these rows."""
        for row, value in zip(self.rows, values, strict=True):
            column[row] = value

    @cached_property
    def _order(self) -> IntArray:
        rows = self.array
        if not len(rows) or rows.max() >= len(rows):
            return rows.argsort()
        # NOTE: for all rows, this is a tenth of the time of a sort (benchmarks: deletion).
        order = np.empty_like(rows)
        order[rows] = np.arange(len(rows))
        return order

    @cached_property
    def _is_ascending(self) -> bool:
        return bool((self.array[1:] > self.array[:-1]).all())

    @cached_property
    def ascending(self) -> IntArray:
        """The rows in ascending order."""
        return self.array.take(self._order)

    def sort_values(self, values: Sequence[int]) -> IntArray:
        """Return values of these rows in ascending order of the rows; may be the same array."""
        numbers = np.asarray(values)
        return numbers if self._is_ascending else numbers.take(self._order)


def _make_picker(places: list[int]) -> Callable[[Sequence[Any]], Iterable[Any]]:
    """Return a function that picks the items at these positions of a list."""
    if places == list(range(len(places))):
        return itemgetter(slice(len(places)))
    return itemgetter(*places) if len(places) > 1 else lambda values: [values[i] for i in places]


# -- tables and logs of games --------------------------------------------------------------------------------------


def select_rows(table: Table, which: BoolArray | IntArray) -> Table:
    """Return rows of a named tuple of columns, selected by a mask or by indices."""
    rows = np.flatnonzero(which) if which.dtype == np.bool_ else which.astype(np.int64, copy=False)
    return type(table)(*(_select_rows(column, rows) for column in table))


def _select_rows(column: Any, rows: IntArray) -> Any:
    if isinstance(column, list):
        return [column[row] for row in rows.tolist()]
    if isinstance(column, Mapping):
        return {name: _select_rows(one, rows) for name, one in column.items()}
    if hasattr(column, "_fields"):
        return select_rows(column, rows)
    return column[rows] if isinstance(column, np.ndarray) else column


def join_rows(tables: Sequence[Table]) -> Table:
    """Return the concatenated rows of several tables; there is at least one."""
    return type(tables[0])(*map(_join_column, zip(*tables, strict=True))) if len(tables) > 1 else tables[0]


def _join_column(columns: Sequence[Any]) -> Any:
    first = columns[0]
    if isinstance(first, list):
        return [one for column in columns for one in column]
    if isinstance(first, Mapping):
        return {name: _join_column([column[name] for column in columns]) for name in first}
    return np.concatenate(columns) if isinstance(first, np.ndarray) else first


def find_places(numbers: IntArray, most: int) -> IntArray:
    """Return the index of each number below a limit in an array, (most,); -1: the number is not in it."""
    found = np.full(most, -1)
    found[numbers] = np.arange(len(numbers))
    return found


class Failure(NamedTuple):
    """An error of an agent in a game of the batch."""

    game: int
    agent: int
    kind: str
    message: str

    @classmethod
    def make_illegal(cls, game: int, agent: int, why: str) -> Failure:
        """Return the failure for an illegal action, or for a message that cannot be sent."""
        return cls(game, agent, "illegal", why)


class GameLog(ABC, Generic[P]):
    """A log of all games: noted as arrays of many games, and written out for each game when it is read.

    Args:
        num_games: the number of games in the batch.
        names: the names of the agents, if entries have numbers of agents.
    """

    def __init__(self, num_games: int, names: Sequence[str] = ()) -> None:
        self._names = names
        self._pending: list[P] = []
        self._num_games = num_games
        self._of_game = defaultdict[int, list[dict[str, Any]]](list)

    def list_entries(self, game: int) -> list[dict[str, Any]]:
        """Return the log entries of a game, in order."""
        for noted in self._pending:
            for number, entry in self._list_entries(noted):
                self._of_game[number].append(entry)
        self._pending.clear()
        return self._of_game[game]

    def forget(self, games: IntArray) -> None:
        """Remove the entries of some games."""
        if len(games) == self._num_games:  # do not write out entries that are removed anyway
            self._pending.clear()
        self.list_entries(0)
        for game in games.tolist():
            self._of_game.pop(game, None)

    def clear(self) -> None:
        """Remove the entries of all games."""
        self._pending.clear()
        self._of_game.clear()

    def checkpoint(self) -> Callable[[], None]:
        """Return a function that undoes all later changes."""
        pending = [*self._pending]
        lengths = {game: len(entries) for game, entries in self._of_game.items()}

        def undo() -> None:
            self._pending[:] = pending
            for game, entries in self._of_game.items():
                del entries[lengths.get(game, 0) :]

        return undo

    def put(self, game: int, entries: list[dict[str, Any]]) -> None:
        """Replace the entries of a game by a list, which grows with the log."""
        self.list_entries(game)
        self._of_game[game] = entries

    def begin(self, games: IntArray, entries: Sequence[dict[str, Any]]) -> None:
        """Start the empty logs of some games with entries of earlier turns."""
        for game in games.tolist() if entries else ():
            self._of_game[game] += entries

    @abstractmethod
    def _list_entries(self, noted: P) -> Iterable[tuple[int, dict[str, Any]]]:
        """Return pairs of game number and log entry; the entries of a game are in order."""
