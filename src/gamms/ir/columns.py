"""Columns of agents, each a list, or a view of an array where there are many: some rows of them, and which changed."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Collection, Iterable, MutableSequence, Sequence
from functools import cached_property
from itertools import count
from operator import add, itemgetter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gamms.core.block import INT64, gather
from gamms.ir.graph import IntArray

Column = np.ndarray[Any, Any]
_FEW = 16  # where fewer than one name in so many is asked for, each is looked up
_FEW_DROPPED = 8  # places, up to which what is there is removed one by one
_MOST_NOTED = 1 << 16  # rows in a `StructureLog`


class ChangeLog:
    """The rows of a block whose node, position, team or life has changed, since this subscriber asked last."""

    __slots__ = ("_publish", "rows")

    def __init__(self, publish: Callable[[], None]) -> None:
        self._publish = publish  # writes what has changed into this log
        self.rows: set[int] | None = None

    def take(self) -> set[int] | None:
        """Return the rows that have changed; None where all may have, and rows may be those of other agents."""
        self._publish()
        rows = self.rows
        if rows is None or rows:
            self.rows = set()
        return rows


class StructureLog:
    """The rows of a block that came, went, or changed their life, team, speed, sensors or strategy, each by a version.

    It is for one reader, which asks for what has changed since the version at which it has asked last.

    Attributes:
        version: a number that changes with every row that is noted.
    """

    __slots__ = ("_closed", "_first", "_rows", "version")

    def __init__(self) -> None:
        self._first = self.version = 0  # the version before the first of these
        self._rows: list[int | str] = []
        self._closed: list[tuple[int, list[int]]] = []  # versions, and the rows that were closed up then

    def note(self, rows: Iterable[int]) -> None:
        """Note that these rows have changed."""
        self._rows += rows
        self.version = self._first + len(self._rows)
        if len(self._rows) > _MOST_NOTED:
            self.note_all(self.version)

    def note_all(self, version: int) -> None:
        """Note that all rows may have changed, and be those of other agents, since a version."""
        self._first = self.version = version + 1
        self._rows, self._closed = [], []

    def close_up(self, gone: list[int], names: Sequence[str]) -> None:
        """Number rows as they are once these, ascending, are closed up; note the names of those."""
        self._closed.append((self.version, gone))
        name_of = {row: names[row] for row in gone}
        self._rows = [
            one if isinstance(one, str) else name_of.get(one, one - bisect_left(gone, one)) for one in self._rows
        ]

    def since(self, version: int) -> tuple[list[int | str], list[list[int]]] | None:
        """Return what has changed since a version; None: all may have.

        That is rows, and names of agents that are gone; and the rows of these, each time that some were closed up.
        """
        if version < self._first:
            return None
        self._rows, self._first = self._rows[version - self._first :], version
        self._closed = [one for one in self._closed if one[0] > version]
        return self._rows.copy(), [gone for _, gone in self._closed]


class RowsByName:
    """The rows of agents by their names.

    An agent has a number for as long as it is there: rows are closed up, and numbers stay.

    Attributes:
        version: changes whenever agents have other rows, or rows are those of agents that have left.
    """

    __slots__ = ("_number_of", "_numbers", "version")

    def __init__(self) -> None:
        self.version = 0
        self.reset(())

    def reset(self, names: Sequence[str]) -> None:
        """Let these be the names of all rows."""
        self._number_of: dict[str, int] = {}
        self._numbers: list[int] = []  # by row, ascending
        self.version += 1
        self.enter_all(names)

    def __contains__(self, name: str) -> bool:
        return name in self._number_of

    def enter(self, name: str) -> None:
        """Add a row."""
        number = self._number_of[name] = self._numbers[-1] + 1 if self._numbers else 0
        self._numbers.append(number)

    def enter_all(self, names: Sequence[str]) -> None:
        """Add rows."""
        first = self._numbers[-1] + 1 if self._numbers else 0
        numbers = range(first, first + len(names))
        self._numbers += numbers
        self._number_of.update(zip(names, numbers, strict=True))

    def leave(self, name: str) -> None:
        """Forget a name, whose row stays until it is closed up."""
        del self._number_of[name]
        self.version += 1

    def close_up(self, gone: Sequence[int]) -> None:
        """Close up rows, ascending."""
        drop(self._numbers, gone)
        self.version += 1

    def of(self, name: str) -> int:
        """Return the row of a name (KeyError)."""
        return bisect_left(self._numbers, self._number_of[name])

    def of_each(self, names: Collection[str]) -> list[int]:
        """Return the rows of names (KeyError)."""
        if len(names) < len(self._numbers) // _FEW:
            return list(map(self.of, names))
        numbers = list(map(self._number_of.__getitem__, names))
        rows: list[int] = np.searchsorted(np.array(self._numbers, np.int64), numbers).tolist()
        return rows


class Succession:
    """How the living agents, in the order of their names, follow from those of an earlier moment.

    Args:
        before: the names of those.
        rows: which have changed since, and the names of those whose rows are gone.
        names: by row.
        inactive: the rows of agents that are not alive.
        closed: the rows that were closed up since, one time after the other.

    Attributes:
        closed: as given.
        gone: the places of those that are gone or have changed, ascending.
        rows: of those that have come or changed, in the order of their names.
    """

    def __init__(
        self,
        before: Sequence[str],
        rows: Iterable[int | str],
        names: Sequence[str],
        inactive: Collection[int],
        closed: Sequence[list[int]] = (),
    ) -> None:
        self.closed = closed
        noted = set(rows)
        changed: dict[str, int | None] = {one: None for one in noted if isinstance(one, str)}
        # later, because one that came may have the name of one that is gone.
        changed |= {names[one]: one for one in noted if not isinstance(one, str)}
        ordered = sorted(changed)
        self.gone: list[int] = []
        self.rows = [row for name in ordered if (row := changed[name]) is not None and row not in inactive]
        self._places = [] if before else [0] * len(self.rows)  # before which of those that are left they belong
        for name in ordered if before else ():
            row = changed[name]
            i = bisect_left(before, name)
            if row is not None and row not in inactive:
                self._places.append(i - len(self.gone))
            if i < len(before) and before[i] == name:
                self.gone.append(i)

    @property
    def places(self) -> list[int]:
        """The places of those that have come or changed."""
        return list(map(add, self._places, count()))

    def moved(self, rows: IntArray) -> IntArray:
        """Return the rows in which those of before are now, but for those that are gone."""
        for gone in self.closed:
            rows = rows - np.searchsorted(gone, rows)
        return rows

    def of_array(self, column: Column, values: ArrayLike) -> Column:
        """Return a column without those that are gone, and with values, or one value, of those that have come."""
        return np.insert(np.delete(column, self.gone), self._places, values)

    def of(self, column: Sequence[Any], values: Iterable[Any]) -> list[Any]:
        """Return a column without those that are gone, and with the values of those that have come."""
        if not column:
            return [*values]
        left = without(column, self.gone)
        if not self._places:
            return left
        return _joined(left, [(i, i, (value,)) for i, value in zip(self._places, values, strict=True)])


def without(column: Sequence[Any], gone: Iterable[int]) -> list[Any]:
    """Return a list without what is at some places, ascending."""
    return _joined(column, [(i, i + 1, ()) for i in gone])


def drop(column: list[Any], gone: Sequence[int]) -> None:
    """Remove what is at some places, ascending, from a list."""
    if len(gone) > _FEW_DROPPED:
        column[:] = without(column, gone)
        return
    # NOTE: a tenth of the time of a new list of many, and no garbage (benchmarks: deletion).
    for i in reversed(gone):
        del column[i]


def _joined(column: Sequence[Any], cuts: Iterable[tuple[int, int, tuple[Any, ...]]]) -> list[Any]:
    """Return a list in which each cut, from one place to another, is replaced by other values."""
    joined: list[Any] = []
    at = 0
    for begin, end, values in cuts:
        joined += column[at:begin]
        joined += values
        at = end
    joined += column[at:]
    return joined


def copied_column(column: Any) -> Any:
    """Return a copy of a list or of a view of an array."""
    return column.copy() if type(column) is list else np.array(column, np.int64).data


class Selection:
    """Some rows of columns, in an order of their own.

    Attributes:
        rows: which.
    """

    # NOTE: getters pick whole columns in C: every turn reads and writes all agents (benchmarks: turns). What has slots
    # is read at once, also where there is a dict for what is cached.

    __slots__ = ("__dict__", "_pick", "rows")

    def __init__(self, rows: list[int]) -> None:
        self.rows = rows
        self._pick: Callable[[Sequence[Any]], Iterable[Any]] | None = None

    def after(self, change: Succession) -> Selection:
        """Return the rows of the living agents once some have changed."""
        # NOTE: `array` is there when agents move in arrays (benchmarks: death, deletion).
        array = change.of_array(change.moved(self.array), change.rows)
        now = Selection(array.tolist() if change.closed else change.of(self.rows, change.rows))
        now.array = array
        return now

    @cached_property
    def as_set(self) -> frozenset[int]:
        """The rows, in no order."""
        return frozenset(self.rows)

    @cached_property
    def array(self) -> IntArray:
        """The rows as an array."""
        return np.array(self.rows, np.int64)

    @cached_property
    def buffer(self) -> memoryview[int]:
        """The rows as the core reads them."""
        return self.array.data

    def of(self, column: Sequence[Any]) -> Any:
        """Return what the column holds in these rows: a list, or a view of an array."""
        if type(column) is list:
            return self.listed(column)
        view: Any = column if type(column) is memoryview else np.asarray(column).data
        if view.format != INT64:
            return np.asarray(view).take(self.array).data
        values = np.empty(len(self.rows), np.int64).data
        gather(view, self.buffer, values)
        return values

    def listed(self, column: Sequence[Any]) -> list[Any]:
        """Return what the column holds in these rows as a list."""
        pick = self._pick
        if pick is None:
            pick = self._pick = _picker(self.rows)
        return [*pick(column)]

    def write(self, column: MutableSequence[Any], values: Sequence[Any]) -> None:
        """Set the column in these rows."""
        for row, value in zip(self.rows, values, strict=True):
            column[row] = value

    @cached_property
    def _order(self) -> IntArray:
        rows = self.array
        if not len(rows) or rows.max() >= len(rows):
            return rows.argsort()
        # NOTE: all rows there are, for which this is a tenth of a sort (benchmarks: deletion).
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

    def in_order(self, values: Sequence[int]) -> IntArray:
        """Return values of these rows in ascending order of the rows, maybe no copies."""
        numbers = np.asarray(values)
        return numbers if self._is_ascending else numbers.take(self._order)


def _picker(places: list[int]) -> Callable[[Sequence[Any]], Iterable[Any]]:
    """Return the function that picks what is at these places of a list."""
    if places == list(range(len(places))):
        return itemgetter(slice(len(places)))
    return itemgetter(*places) if len(places) > 1 else lambda values: [values[i] for i in places]
