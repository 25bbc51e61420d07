"""Columns of agents, each a list, or a view of an array where there are many: some rows of them, and which changed."""

from collections.abc import Callable, Iterable, Sequence
from functools import cached_property
from operator import itemgetter
from typing import Any

import numpy as np

from gamms.ir.graph import IntArray


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
