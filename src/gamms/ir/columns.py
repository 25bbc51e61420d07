"""Columns of agents, each a list, or a view of an array where there are many: some rows of them, and which changed."""

from bisect import bisect_left
from collections.abc import Callable, Collection, Iterable, Sequence
from functools import cached_property
from itertools import count
from operator import add, itemgetter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gamms.ir.graph import IntArray

Column = np.ndarray[Any, Any]
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
    """The rows of a block that came, went, or changed their life, team, speed or sensors, each under its own version.

    It is for one reader, which asks for what has changed since the version at which it has asked last.

    Attributes:
        version: a number that changes with every row that is noted.
    """

    __slots__ = ("_first", "_rows", "version")

    def __init__(self) -> None:
        self._first = self.version = 0  # the version before the first of these
        self._rows: list[int | str] = []

    def note(self, rows: Iterable[int]) -> None:
        """Note that these rows have changed."""
        self._rows += rows
        self.version = self._first + len(self._rows)
        if len(self._rows) > _MOST_NOTED:
            self.note_all(self.version)

    def note_all(self, version: int) -> None:
        """Note that all rows may have changed, and be those of other agents, since a version."""
        self._first = self.version = version + 1
        self._rows = []

    def keep(self, rows: Sequence[int], names: Sequence[str]) -> None:
        """Number rows as they are once only these are left, 0, 1, …; of those that go, note the names."""
        if self._rows:
            now = dict(zip(rows, count(), strict=False))
            self._rows = [one if isinstance(one, str) else now.get(one, names[one]) for one in self._rows]

    def since(self, version: int) -> list[int | str] | None:
        """Return the rows that have changed since a version, and names of those that are gone; None: all may have."""
        if version < self._first:
            return None
        self._rows, self._first = self._rows[version - self._first :], version
        return self._rows.copy()


class Succession:
    """How the living agents, in the order of their names, follow from those of an earlier moment.

    Args:
        before: the names of those.
        rows: which have changed since, and the names of those whose rows are gone.
        names: by row.
        inactive: the rows of agents that are not alive.

    Attributes:
        gone: the places of those that are gone or have changed, ascending.
        rows: of those that have come or changed, in the order of their names.
    """

    def __init__(
        self, before: Sequence[str], rows: Iterable[int | str], names: Sequence[str], inactive: Collection[int]
    ) -> None:
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

    def of_array(self, column: Column, values: ArrayLike) -> Column:
        """Return a column without those that are gone, and with values, or one value, of those that have come."""
        return np.insert(np.delete(column, self.gone), self._places, values)

    def of(self, column: Sequence[Any], values: Iterable[Any]) -> list[Any]:
        """Return a column without those that are gone, and with the values of those that have come."""
        if not column:
            return [*values]
        left = _joined(column, [(i, i + 1, ()) for i in self.gone])
        if not self._places:
            return left
        return _joined(left, [(i, i, (value,)) for i, value in zip(self._places, values, strict=True)])


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
    return column.copy() if type(column) is list else np.array(column).data


class Selection:
    """Some rows of columns, in an order of their own.

    Attributes:
        rows: which.
    """

    # NOTE: getters pick whole columns in C: every turn reads and writes all agents (benchmarks: turns).

    def __init__(self, rows: list[int]) -> None:
        self.rows = rows

    def after(self, change: Succession) -> "Selection":
        """Return the rows of the living agents once some have changed and none of the others is in another row."""
        now = Selection(change.of(self.rows, change.rows))
        if "array" in self.__dict__:
            now.array = change.of_array(self.array, change.rows)
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
    def pick(self) -> Callable[[Sequence[Any]], Iterable[Any]]:
        """The function that picks these rows of a list."""
        return _picker(self.rows)

    @cached_property
    def _inverse(self) -> Callable[[Sequence[Any]], Iterable[Any]]:
        return _picker(sorted(range(len(self.rows)), key=self.rows.__getitem__))

    def of(self, column: Sequence[Any]) -> Any:
        """Return what the column holds in these rows: a list, or a view of an array."""
        return [*self.pick(column)] if type(column) is list else np.asarray(column).take(self.array).data

    def column(self, values: Sequence[Any]) -> list[Any]:
        """Return the column that holds these values in these rows, which are all there are."""
        return [*self._inverse(values)]

    def write(self, column: list[Any], values: Sequence[Any]) -> None:
        """Set the column in these rows."""
        for row, value in zip(self.rows, values, strict=True):
            column[row] = value

    @cached_property
    def _order(self) -> IntArray:
        return self.array.argsort()

    @cached_property
    def _is_ascending(self) -> bool:
        return bool((self.array[1:] > self.array[:-1]).all())

    @cached_property
    def ascending(self) -> IntArray:
        """The rows in ascending order."""
        return self.array.take(self._order)

    def in_order(self, values: Sequence[int], column: Sequence[int]) -> IntArray:
        """Return values that a column has in these rows in ascending order of the rows, maybe no copies."""
        if type(column) is not list and len(column) == len(self.rows):
            return np.asarray(column)  # NOTE: no second gather where all move (benchmarks: teams, recorded).
        numbers = np.asarray(values)
        return numbers if self._is_ascending else numbers.take(self._order)

    def write_all(self, column: IntArray, values: Sequence[int]) -> None:
        """Set an array in these rows, which are all there are."""
        # NOTE: `take` costs a third of an assignment by rows, and three times a copy (benchmarks: teams).
        if self._is_ascending:
            column[:] = values
            return
        np.take(np.asarray(values), self._order, out=column, mode="clip")


def _picker(places: list[int]) -> Callable[[Sequence[Any]], Iterable[Any]]:
    """Return the function that picks what is at these places of a list."""
    if places == list(range(len(places))):
        return itemgetter(slice(len(places)))
    return itemgetter(*places) if len(places) > 1 else lambda values: [values[i] for i in places]
