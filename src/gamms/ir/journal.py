"""The journal in which a context records events in order, for recordings."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from gamms.ir.columns import drop
from gamms.ir.events import AERIAL_AGENT_FLIGHT, AERIAL_AGENT_TURN, AGENT_ATTRIBUTE, MOVES, Log
from gamms.ir.graph import IntArray
from gamms.plain import Plain


class Journal:
    """The events of one context since a recording began; written by a block of agents.

    Attributes:
        log: the events; emptied by the reader.
        ids: row of an agent -> its number in moves, which does not change when rows are closed up.
        names: number -> name of the agent.
        in_arrays: number of moves in `log` beyond its length, because one entry may hold the moves of many agents;
            reset by the reader.
        progressed: numbers of agents whose progress along an edge was set; emptied by the reader.
        is_silent: whether nothing is recorded; `log`, `record_flight`, `record_rotation` and `record_attribute` must
            not be used then.
        notes_attributes: whether changes of custom attributes are recorded.
        is_closed: whether the context has ended, so that agents no longer change.
    """

    is_silent: bool = False
    notes_attributes: bool = True
    is_closed: bool = False

    def __init__(self, names: list[str]) -> None:
        self.log: Log = []
        self.progressed: set[int] = set()
        self.in_arrays = 0
        self.names = list(names)
        self.ids = list(range(len(names)))

    def note(self, kind: int, data: Plain) -> None:
        """Record an event other than a move; `data` are plain values."""
        self.log.append((kind, data))

    def append(self, kind: int, data: Plain) -> None:
        """Append an event of a recording that has already been applied to the context."""
        self.log.append((kind, data))

    def record_moves(self, rows: IntArray, nodes: IntArray) -> None:
        """Record the moves of many agents: their distinct rows, and the ids of their nodes, (agents,) each."""
        moves = np.empty((len(rows), 2), np.int64)
        moves[:, 0] = np.array(self.ids, np.int64).take(rows)
        moves[:, 1] = nodes
        self.log.append((MOVES, moves))
        self.in_arrays += 2 * len(rows) - 1

    def record_flight(self, row: int, node: int, position: tuple[float, float, float]) -> None:
        """Record a new position of a flying agent above a node."""
        self.log.append((AERIAL_AGENT_FLIGHT, (self.ids[row], node, *position)))

    def record_rotation(self, row: int, quat: tuple[float, float, float, float]) -> None:
        """Record a new rotation of a flying agent."""
        self.log.append((AERIAL_AGENT_TURN, (self.ids[row], *quat)))

    def record_attribute(self, rows: Iterable[int], name: str, values: Plain) -> None:
        """Record a change of a custom attribute, one value for each agent; None: it was deleted."""
        data = {"numbers": [self.ids[row] for row in rows], "name": name}
        self.in_arrays += len(data["numbers"]) - 1
        self.note(AGENT_ATTRIBUTE, data if values is None else {**data, "values": values})

    def number_agent(self, row: int, name: str) -> None:
        """Give a number to a new agent in the last row."""
        del self.ids[row:]
        self.ids += [-1] * (row - len(self.ids))  # rows of agents whose creation failed
        self.ids.append(len(self.names))
        self.names.append(name)

    def renumber(self, row: int, name: str, number: int) -> None:
        """Give an agent another number."""
        self.ids[row] = number
        self.names[number] = name

    def close_up(self, gone: list[int]) -> None:
        """Drop the numbers of rows, ascending, that are closed up."""
        drop(self.ids, [row for row in gone if row < len(self.ids)])  # agents whose creation failed have no numbers


class JournalOfRow(Journal):
    """The journal of a game of a batch, whose agents have their custom attributes themselves."""

    notes_attributes = False


class MutedJournal(Journal):
    """A wrapper of a journal that records nothing; new and removed agents still get their numbers."""

    is_silent = True
    notes_attributes = False

    def __init__(self, journal: Journal) -> None:
        super().__init__([])
        self._journal = journal

    def note(self, kind: int, data: Plain) -> None:
        """Record nothing."""

    def number_agent(self, row: int, name: str) -> None:
        """Give a number to a new agent in the last row."""
        self._journal.number_agent(row, name)

    def close_up(self, gone: list[int]) -> None:
        """Drop the numbers of rows, ascending, that are closed up."""
        self._journal.close_up(gone)


class _SilentJournal(Journal):
    """A journal that records nothing."""

    is_silent = True
    notes_attributes = False

    def __deepcopy__(self, memo: dict[int, Any]) -> "_SilentJournal":
        return self

    def note(self, kind: int, data: Plain) -> None:
        pass

    append = note

    def number_agent(self, row: int, name: str) -> None:
        pass

    def close_up(self, gone: list[int]) -> None:
        pass


class _ClosedJournal(_SilentJournal):
    """A journal that records nothing, for a context that has ended."""

    is_closed = True


PLAIN = _SilentJournal([])  # agents change without records
CLOSED = _ClosedJournal([])  # the context has ended: agents no longer change
