"""Which agents are in which rows of a state, where thousands may come and go between its other events."""

from typing import Any

import numpy as np

from gamms.ir.graph import IntArray
from gamms.recorder.checking import ARRAYS, LISTS
from gamms.recorder.errors import DAMAGES, Damaged
from gamms.recorder.state import State
from gamms.text import reason, shown

_FEW = 24  # agents that are found faster one by one
_SHARE = 64  # of all agents: fewer than one of so many are found one by one, too


class Roster:
    """Adds agents to the columns of a state and takes them out, at a cost that does not depend on how many there are.

    New rows wait until one of them is asked for, and rows of deleted agents stay until `settle`.

    Args:
        state: see `recorder.state.opened`; only this writes its columns longer or shorter.

    Attributes:
        flyers: how many agents fly or have flown.
    """

    def __init__(self, state: State) -> None:
        self._state = state
        self._index()

    def __len__(self) -> int:
        return len(self._row_of)

    def _index(self) -> None:
        """Work out which agents are in which rows."""
        state = self._state
        numbers, names = state["numbers"].tolist(), state["names"]
        self._row_of: dict[int, int] = dict(zip(numbers, range(len(numbers)), strict=True))
        self._row_of_name: dict[str, int] = dict(zip(names, range(len(names)), strict=True))
        if not len(self._row_of) == len(self._row_of_name) == len(names):
            raise Damaged("two agents have the same name or number")
        self._columns: dict[str, np.ndarray[Any, Any]] = {
            name: state[name] for name in ARRAYS
        }  # with room behind the last row
        self._size = len(names)  # rows that are in the columns
        self._new: list[dict[str, Any]] = []  # rows that are not
        self._gone: list[int] = []
        self._order: IntArray | None = None  # rows, by the numbers of their agents
        self._is_counted = numbers == list(range(len(numbers)))  # rows are numbers
        self.flyers = int(np.count_nonzero(state["kind"]))

    def enter(self, row: dict[str, Any]) -> None:
        """Add an agent.

        Raises:
            Damaged: another one has its name or number.
        """
        place = self._size + len(self._new)
        name, number = row["names"], row["numbers"]
        if name in self._row_of_name or number in self._row_of:
            raise Damaged("two agents have the same name or number")
        self._row_of[number] = self._row_of_name[name] = place
        self._is_counted = self._is_counted and number == place
        self._order = None
        self.flyers += row["kind"] != 0
        self._new.append(row)

    def leave(self, name: str) -> None:
        """Take an agent out.

        Raises:
            KeyError: there is none of this name.
        """
        row = self.row(name)
        del self._row_of_name[name], self._row_of[int(self._state["numbers"][row])]
        self._gone.append(row)
        self._order, self._is_counted = None, False
        if len(self._gone) > len(self):  # so that each agent pays for one other
            self.settle()

    def row(self, name: str) -> int:
        """The row of an agent by its name (KeyError)."""
        row = self._row_of_name[name]
        if row >= self._size:
            self._add_new()
        return row

    def row_of(self, number: int) -> int:
        """The row of an agent by its number.

        Raises:
            Damaged: there is none.
        """
        row = self._row_of.get(number)
        if row is None:
            raise _stranger(number)
        if row >= self._size:
            self._add_new()
        return row

    def are_few(self, numbers: IntArray) -> bool:
        """Whether so many agents are better looked for one by one than among all at once."""
        return len(numbers) < max(_FEW, len(self) // _SHARE)

    def rows(self, numbers: IntArray) -> IntArray:
        """Rows of agents by their numbers.

        Raises:
            Damaged: one of them is not there.
        """
        if self.are_few(numbers):
            return np.array([self.row_of(number) for number in numbers.tolist()], np.int64)
        self.settle()
        if self._are_rows(numbers):
            return numbers
        if self._order is None:
            self._order = self._state["numbers"].argsort(kind="stable")
        ordered = self._state["numbers"][self._order]
        places = ordered.searchsorted(numbers)
        places[places == len(ordered)] = 0
        is_known = ordered[places] == numbers if len(ordered) else np.zeros(len(numbers), np.bool_)
        if not is_known.all():
            raise _stranger(int(numbers[~is_known][0]))
        rows: IntArray = self._order[places]
        return rows

    def _are_rows(self, numbers: IntArray) -> bool:
        """Whether these numbers are the rows themselves."""
        return self._is_counted and int(numbers.min()) >= 0 and int(numbers.max()) < len(self)

    def are_walkers(self, numbers: IntArray) -> bool:
        """Whether all these are agents on the ground who are here now."""
        if not len(numbers) or (not self.flyers and self._are_rows(numbers)):
            return True
        try:
            rows = self.rows(numbers)
        except Damaged:
            return False
        return not self._state["kind"][rows].any()

    def settle(self) -> None:
        """Let each row of the columns be that of an agent."""
        self._add_new()
        if not self._gone:
            return
        stays = np.ones(self._size, np.bool_)
        stays[self._gone] = False
        rows = np.flatnonzero(stays).tolist()
        for name in LISTS:
            column = self._state[name]
            self._state[name] = [column[row] for row in rows]
        for name in ARRAYS:
            self._state[name] = self._state[name][stays]
        self._index()

    def _add_new(self) -> None:
        if not self._new:
            return
        new, self._new = self._new, []
        begin, self._size = self._size, self._size + len(new)
        for name in LISTS:
            self._state[name].extend([row[name] for row in new])
        for name in ARRAYS:
            try:
                self._room(name, begin)[begin : self._size] = [row[name] for row in new]
            except DAMAGES as error:
                raise Damaged(f"an agent comes whose {shown(name)} is not right ({reason(error)})") from error
            self._state[name] = self._columns[name][: self._size]

    def _room(self, name: str, begin: int) -> "np.ndarray[Any, Any]":
        """A column with room for all rows, of which those before `begin` are in the state."""
        column = self._columns[name]
        if len(column) < self._size:
            dtype, shape = ARRAYS[name]
            column = self._columns[name] = np.empty((2 * self._size, *shape), dtype)
            column[:begin] = self._state[name]
        return column


def _stranger(number: int) -> Damaged:
    return Damaged(f"agent number {number} moves and is not there")
