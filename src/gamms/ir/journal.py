"""The journal in which a context notes events, in their order, for whoever records it."""

from typing import Any

from gamms.ir.events import AERIAL_AGENT_FLIGHT, AERIAL_AGENT_TURN, Log


class Journal:
    """The events of one context since somebody began to read.

    Attributes:
        log: what has happened; the reader empties it.
        ids: row of an agent -> the number by which moves name it, which stays when rows are closed up.
        names: that number -> the agent's name.
        progressed: the numbers of agents whose progress along an edge was set; the reader empties it.
        is_silent: whether it notes nothing, not even moves.
    """

    is_silent: bool = False

    def __init__(self, names: list[str]) -> None:
        self.log: Log = []
        self.progressed: set[int] = set()
        self.names = list(names)
        self.ids = list(range(len(names)))

    def note(self, kind: int, data: Any) -> None:
        """Something other than a move has happened; `data` are plain values."""
        self.log.append((kind, data))

    def append(self, kind: int, data: Any) -> None:
        """Take an event of a recording that has been applied to the context, as it is."""
        self.log.append((kind, data))

    def flew(self, row: int, node: int, position: tuple[float, float, float]) -> None:
        """A flyer is somewhere else, and this is the node below it."""
        self.log.append((AERIAL_AGENT_FLIGHT, (self.ids[row], node, *position)))

    def turned(self, row: int, quat: tuple[float, float, float, float]) -> None:
        """A flyer has turned."""
        self.log.append((AERIAL_AGENT_TURN, (self.ids[row], *quat)))

    def entered(self, row: int, name: str) -> None:
        """An agent has come, in the last row."""
        del self.ids[row:]
        self.ids += [-1] * (row - len(self.ids))  # rows of agents whose creation failed
        self.ids.append(len(self.names))
        self.names.append(name)

    def kept(self, rows: list[int]) -> None:
        """Only these rows are left, in this order."""
        self.ids = [self.ids[row] for row in rows]


class Muted(Journal):
    """Another journal while what happens is not worth a note, but for who has which number."""

    def __init__(self, journal: Journal) -> None:
        super().__init__([])
        self._journal = journal
        self.ids = journal.ids

    def note(self, kind: int, data: Any) -> None:
        """Nothing is noted."""

    def flew(self, row: int, node: int, position: tuple[float, float, float]) -> None:
        """Nothing is noted."""

    def turned(self, row: int, quat: tuple[float, float, float, float]) -> None:
        """Nothing is noted."""

    def entered(self, row: int, name: str) -> None:
        """An agent has come, in the last row."""
        self._journal.entered(row, name)

    def kept(self, rows: list[int]) -> None:
        """Only these rows are left, in this order."""
        self._journal.kept(rows)
        self.ids = self._journal.ids


class _Silent(Journal):
    """Notes nothing."""

    is_silent = True

    def __deepcopy__(self, memo: dict[int, Any]) -> "_Silent":
        return self

    def note(self, kind: int, data: Any) -> None:
        pass

    def append(self, kind: int, data: Any) -> None:
        pass

    def flew(self, row: int, node: int, position: tuple[float, float, float]) -> None:
        pass

    def turned(self, row: int, quat: tuple[float, float, float, float]) -> None:
        pass

    def entered(self, row: int, name: str) -> None:
        pass

    def kept(self, rows: list[int]) -> None:
        pass


NOBODY = _Silent([])  # agents are changed and nothing is noted
CLOSED = _Silent([])  # the context has ended: agents are no longer changed
