"""The journal in which a context notes events, in their order, for recordings."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from gamms.ir.columns import drop
from gamms.ir.events import AERIAL_AGENT_FLIGHT, AERIAL_AGENT_TURN, AGENT_ATTRIBUTE, MOVES, Log
from gamms.ir.graph import IntArray
from gamms.plain import Plain


class Journal:
    """Notes the events of one context since a recording began; a block of agents writes into it.

    Attributes:
        log: what has happened; the reader empties it.
        ids: row of an agent -> the number by which moves name it, which stays when rows are closed up.
        names: that number -> the agent's name.
        in_arrays: by how much the log is longer than its entries, of which one may hold the moves of many agents; the
            reader sets it to 0.
        progressed: the numbers of agents whose progress along an edge was set; the reader empties it.
        is_silent: whether it notes nothing; `log`, `flew`, `turned` and `attributed` are then not to be used.
        is_closed: whether the context has ended, so that agents are no longer changed.
    """

    is_silent: bool = False
    is_closed: bool = False

    def __init__(self, names: list[str]) -> None:
        self.log: Log = []
        self.progressed: set[int] = set()
        self.in_arrays = 0
        self.names = list(names)
        self.ids = list(range(len(names)))

    def note(self, kind: int, data: Plain) -> None:
        """Note something other than a move; `data` are plain values."""
        self.log.append((kind, data))

    def append(self, kind: int, data: Plain) -> None:
        """Take an event of a recording that has been applied to the context, as it is."""
        self.log.append((kind, data))

    def moved(self, rows: IntArray, nodes: IntArray) -> None:
        """Note the moves of many agents: their rows, each once, and the ids of their nodes, (agents,) each."""
        moves = np.empty((len(rows), 2), np.int64)
        moves[:, 0] = np.array(self.ids, np.int64).take(rows)
        moves[:, 1] = nodes
        self.log.append((MOVES, moves))
        self.in_arrays += 2 * len(rows) - 1

    def flew(self, row: int, node: int, position: tuple[float, float, float]) -> None:
        """Note that a flyer is somewhere else, above this node."""
        self.log.append((AERIAL_AGENT_FLIGHT, (self.ids[row], node, *position)))

    def turned(self, row: int, quat: tuple[float, float, float, float]) -> None:
        """Note that a flyer has turned."""
        self.log.append((AERIAL_AGENT_TURN, (self.ids[row], *quat)))

    def attributed(self, rows: Iterable[int], name: str, values: Plain) -> None:
        """Note that an attribute of the caller's was set, one value for each agent; None: they have it no longer."""
        data = {"numbers": [self.ids[row] for row in rows], "name": name}
        self.in_arrays += len(data["numbers"]) - 1
        self.note(AGENT_ATTRIBUTE, data if values is None else {**data, "values": values})

    def entered(self, row: int, name: str) -> None:
        """Number an agent that has come, in the last row."""
        del self.ids[row:]
        self.ids += [-1] * (row - len(self.ids))  # rows of agents whose creation failed
        self.ids.append(len(self.names))
        self.names.append(name)

    def renumber(self, row: int, name: str, number: int) -> None:
        """Give an agent another number."""
        self.ids[row], self.names[number] = number, name

    def close_up(self, gone: list[int]) -> None:
        """Forget the numbers of these rows, ascending, which are closed up."""
        drop(self.ids, [row for row in gone if row < len(self.ids)])  # no numbers of agents whose creation failed


class Muted(Journal):
    """Another journal while what happens is not noted; agents that come and go still have their numbers."""

    is_silent = True

    def __init__(self, journal: Journal) -> None:
        super().__init__([])
        self._journal = journal

    def note(self, kind: int, data: Plain) -> None:
        """Note nothing."""

    def entered(self, row: int, name: str) -> None:
        """Number an agent that has come, in the last row."""
        self._journal.entered(row, name)

    def close_up(self, gone: list[int]) -> None:
        """Forget the numbers of these rows, ascending, which are closed up."""
        self._journal.close_up(gone)


class _Silent(Journal):
    """Notes nothing."""

    is_silent = True

    def __deepcopy__(self, memo: dict[int, Any]) -> "_Silent":
        return self

    def note(self, kind: int, data: Plain) -> None:
        pass

    append = note

    def entered(self, row: int, name: str) -> None:
        pass

    def close_up(self, gone: list[int]) -> None:
        pass


class _Closed(_Silent):
    """Notes nothing, because nothing is changed any more."""

    is_closed = True


PLAIN = _Silent([])  # agents are changed and nothing is noted
CLOSED = _Closed([])  # the context has ended: agents are no longer changed
