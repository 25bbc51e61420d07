"""What happens, in order: noted by whoever changes the state, read by the recorder."""

from typing import Any

Log = list[Any]  # (row id, node id) of each move of an agent on the ground as two ints; else (kind, data) as a tuple

TERMINATE = 0x00000000
SIMULATE = 0x00000001
SNAPSHOT = 0x00000010  # not in 1.0.0, like all that are marked so
UNFINISHED = 0x00000011  # not in 1.0.0: the last log is that of a turn that was not over
COPIED = -1  # never written: a record of version 2 that is copied as it is, and what was noted when it happened
AGENT_CREATE = 0x01000000
AGENT_DELETE = 0x01000001
AGENT_CURRENT_NODE = 0x01100000
AGENT_PREV_NODE = 0x01100001
AGENT_SENSOR_REGISTER = 0x01100002
AGENT_SENSOR_DEREGISTER = 0x01100003
AGENT_ORIENTATION = 0x01100004
AERIAL_AGENT_POSITION = 0x01100005
AERIAL_AGENT_QUATERNION = 0x01100006
AGENT_TEAM = 0x01100010  # not in 1.0.0
AGENT_ALIVE = 0x01100011  # not in 1.0.0
AGENT_SPEED = 0x01100012  # not in 1.0.0
AGENT_STRATEGY = 0x01100013  # not in 1.0.0
AGENT_PROGRESS = 0x01100014  # not in 1.0.0: how far along edges several agents are
FLYERS_ABOVE = 0x01100030  # not in 1.0.0: which nodes are below all who fly, in a turn that has changed the map
AERIAL_AGENT_FLIGHT = 0x01100020  # not in 1.0.0: (number of the flyer, node below it, x, y, z)
AERIAL_AGENT_TURN = 0x01100021  # not in 1.0.0: (number of the flyer, w, x, y, z)
WORLD = 0x03000000  # not in 1.0.0: graph and obstacles
VISUALS = 0x03000010  # not in 1.0.0: what it looks like
VISUAL_COMMANDS = 0x03000011  # not in 1.0.0: what an artist draws, from the end of this turn on
GAME_SCORES = 0x04000000  # not in 1.0.0
GAME_DATA = 0x04000001  # not in 1.0.0
GAME_EVENT = 0x04000002  # not in 1.0.0
GAME_OVER = 0x04000003  # not in 1.0.0
GAME_TURN = 0x04000004  # not in 1.0.0: the game has counted otherwise than it did
GAME_MEMORY = 0x04000005  # not in 1.0.0: what agents and teams remember
GAME_FACTS = 0x04000006  # not in 1.0.0
GAME_CHANCE = 0x04000007  # not in 1.0.0: where the context's own random stream stands
SENSORS = 0x06000000  # not in 1.0.0: sensors came
SENSED = 0x06000001  # not in 1.0.0: what agents sensed in this turn
USER_EVENT = 0x05000000  # not in 1.0.0


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


class _Silent(Journal):
    """Notes nothing."""

    is_silent = True

    def __deepcopy__(self, memo: dict[int, Any]) -> "_Silent":
        return self

    def note(self, kind: int, data: Any) -> None:
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
