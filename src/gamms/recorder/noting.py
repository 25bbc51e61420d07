"""The journal of a context that is being recorded: whatever is noted becomes plain values at once.

At once, because what a program hands over it may change a moment later, and what is recorded is how it was.
"""

from collections.abc import Callable
from typing import Any

from gamms.ir import events as kinds
from gamms.ir.agents import Position, Quat
from gamms.ir.journal import Journal
from gamms.plain import to_plain
from gamms.recorder import keyframes
from gamms.recorder.left_out import LeftOut

_OF_FLIGHT = 7  # its weight


class PlainJournal(Journal):
    """Notes what can be written of what happens.

    Args:
        names: of the agents who are there.
        left_out: told of what cannot be written.
        accept: called with each event of a replay.

    Attributes:
        living: the names of the agents of whom the reader knows, in the order of their creation.
        weight: what it costs to read the flights that were noted, beside the entries of the log, in such entries.
    """

    def __init__(self, names: list[str], left_out: LeftOut, accept: Callable[[int, Any], None]) -> None:
        super().__init__(names)
        self._accept = accept
        self._left_out = left_out
        self.living = dict.fromkeys(names)
        self.weight = 0

    def note(self, kind: int, data: Any) -> None:
        """Something other than a move has happened."""
        self._know(kind, data)
        self.log.append((kind, self._creation(data) if kind == kinds.AGENT_CREATE else to_plain(data)))

    def append(self, kind: int, data: Any) -> None:
        """Take an event of a replay that has been applied, as it is."""
        self._know(kind, data)
        self.log.append((kind, data))
        self._accept(kind, data)

    def _know(self, kind: int, data: Any) -> None:
        if kind == kinds.AGENT_CREATE:
            self.living[data["name"]] = None
        elif kind == kinds.AGENT_DELETE:
            self.living.pop(data["name"], None)

    def flew(self, row: int, node: int, position: Position) -> None:
        """A flyer is somewhere else, and this is the node below it."""
        super().flew(row, node, position)
        self.weight += _OF_FLIGHT

    def turned(self, row: int, quat: Quat) -> None:
        """A flyer has turned."""
        super().turned(row, quat)
        self.weight += _OF_FLIGHT

    def _creation(self, data: dict[str, Any]) -> dict[str, Any]:
        """A new agent, without those of its keywords that cannot be written."""
        given = dict(data["kwargs"])
        strategy = given.pop("strategy", None)
        if "sensors" in given:
            given["sensors"] = _sensors(given["sensors"])
        named = {} if strategy is None else {"strategy": keyframes.name_of(strategy)}
        return {**data, "kwargs": self._left_out.plain_part("agent", data["name"], given), **named}


def _sensors(given: Any) -> Any:
    """The ids of the sensors that an agent was created with, by the names it knows them by."""
    if isinstance(given, dict):
        return {str(name): one if isinstance(one, str) else one.sensor_id for name, one in given.items()}
    return [one if isinstance(one, str) else one.sensor_id for one in given]
