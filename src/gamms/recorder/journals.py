"""The journal of a context during a recording, and warnings about values that cannot be written."""

from collections.abc import Callable, Iterable, Mapping
from copy import copy
from typing import Any

from gamms.ir import events as kinds
from gamms.ir.agents import Position, Quat
from gamms.ir.journal import Journal
from gamms.plain import Plain, is_plain, select_plain, to_plain
from gamms.typing.agent_engine import SensorsOfAgent
from gamms.typing.context import HostContext
from gamms.typing.game import find_strategy_name

_NOTED = ("ids", "in_arrays", "living", "log", "names", "progressed", "weight")
_OF_FLIGHT = 7  # weight of a flight, in addition to its entry


class SkippedValues:
    """Warns about values that are left out of a recording; once for each key of nodes, edges, agents and sensors."""

    def __init__(self, ctx: HostContext) -> None:
        self._ctx = ctx
        self._warned: set[tuple[str, Any]] = set()

    def pack_map(self) -> bytes:
        """Return the graph and the obstacles of the context, without values that cannot be written."""
        packed: bytes
        packed, left_out = self._ctx.graph.storage.pack_savable()
        for (kind, key), ids in left_out.items():
            others = f" and {len(ids) - 1} more" if len(ids) > 1 else ""
            self._warn(kind, f"{ids[0]}{others}", key)
        return packed

    def make_plain_part(self, kind: str, name: object, values: Mapping[Any, Any]) -> dict[Any, Any]:
        """Return the values of an agent or sensor that can be written."""
        left_out: list[Any] = []
        part = select_plain(values, left_out)
        for key in left_out:
            self._warn(kind, repr(name), key)
        return part

    def check_all(self) -> None:
        """Warn about values of agents and sensors that cannot be written."""
        for name, (_, attributes, _) in zip(
            self._ctx.agent.agents, self._ctx.agent.storage.list_details(), strict=True
        ):
            if attributes:
                self.make_plain_part("agent", name, attributes)
        self.check_sensors(self._ctx.sensor.storage.describe_sensors())

    def check_data(self) -> None:
        """Warn about data of rules that cannot be written."""
        left_out: list[Any] = []
        if self._ctx.current_game is not None:
            select_plain(self._ctx.game.data, left_out)
        for key in left_out:
            self._warn("data", "of the game", key)

    def check_sensors(self, described: list[dict[str, Any]]) -> None:
        """Warn about values of these sensors that cannot be written."""
        for sensor in described:
            self.make_plain_part("sensor", sensor["id"], sensor["keywords"])

    def _warn(self, kind: str, which: str, key: Plain) -> None:
        if (kind, key) in self._warned:
            return
        self._warned.add((kind, key))
        self._ctx.logger.warning(
            f"{kind.capitalize()} {which} has {key!r} with something in it that is no plain value, or is nested too "
            "deeply: that is left out of the recording, or is a text there in lists, in sets and as a key, here and "
            "wherever else."
        )


class SessionJournal(Journal):
    """A journal that keeps only values that can be written.

    Args:
        names: names of the present agents.
        left_out: warns about values that cannot be written.
        accept: called with each event of a replay.
        equip: called when an agent gets a sensor.

    Attributes:
        living: names of the agents known to the reader, in order of creation.
        weight: reading cost of the recorded flights beyond their log entries, in entries.
        last_set: the event to which the next attribute change may be added; None: there is none.
    """

    def __init__(
        self,
        names: list[str],
        left_out: SkippedValues,
        accept: Callable[[int, Any], None],
        equip: Callable[[], None],
    ) -> None:
        super().__init__(names)
        self._accept = accept
        self._equip = equip
        self._skipped = left_out
        self.living = dict.fromkeys(names)
        self.weight = 0
        self.last_set: Any = None

    def checkpoint(self) -> Callable[[], None]:
        """Return a function that drops all later events."""
        before = {name: copy(getattr(self, name)) for name in _NOTED}
        self.last_set = None

        def drop() -> None:
            self.last_set = None
            for name, value in before.items():
                setattr(self, name, value)

        return drop

    def note(self, kind: int, data: Plain) -> None:
        """Record an event other than a move, as plain values."""
        self._know(kind, data)
        self.log.append((kind, self._make_creation(data) if kind == kinds.AGENT_CREATE else to_plain(data)))

    def record_attribute(self, rows: Iterable[int], name: str, values: Plain) -> None:
        """Record a custom attribute, if it can be written."""
        if values is not None and not is_plain(values):
            for row, value in zip(rows, values, strict=True):
                part = self._skipped.make_plain_part("agent", self.names[self.ids[row]], {name: value})
                self.record_attribute([row], name, [part[name]] if name in part else None)
            return
        last = self.log[-1] if self.log else None
        if last is not None and last is self.last_set and last[1]["name"] == name and type(values) is list:
            # Changes of many agents by a rule become one event, in a tenth of the bytes.
            last[1]["numbers"] += [self.ids[row] for row in rows]
            last[1]["values"] += to_plain(values)
            self.in_arrays += len(values)
            return
        super().record_attribute(rows, name, values)
        self.last_set = self.log[-1] if type(values) is list else None

    def append(self, kind: int, data: Plain) -> None:
        """Append an applied event of a replay unchanged."""
        self._know(kind, data)
        self.log.append((kind, data))
        self._accept(kind, data)

    def _know(self, kind: int, data: Plain) -> None:
        if kind == kinds.AGENT_CREATE:
            self.living[data["name"]] = None
            if data["kwargs"].get("sensors"):
                self._equip()
        elif kind == kinds.AGENT_SENSOR_REGISTER:
            self._equip()
        elif kind == kinds.AGENT_DELETE:
            self.living.pop(data["name"], None)

    def record_flight(self, row: int, node: int, position: Position) -> None:
        """Record the position of a flying agent, and the node below it."""
        super().record_flight(row, node, position)
        self.weight += _OF_FLIGHT

    def record_rotation(self, row: int, quat: Quat) -> None:
        """Record the rotation of a flying agent."""
        super().record_rotation(row, quat)
        self.weight += _OF_FLIGHT

    def _make_creation(self, data: dict[str, Any]) -> dict[str, Any]:
        """Return the data of a creation without keywords that cannot be written."""
        given = dict(data["kwargs"])
        strategy = given.pop("strategy", None)
        if "sensors" in given:
            given["sensors"] = _find_ids(given["sensors"])
        named = {} if strategy is None else {"strategy": find_strategy_name(strategy)}
        return {**data, "kwargs": self._skipped.make_plain_part("agent", data["name"], given), **named}


def _find_ids(given: SensorsOfAgent) -> dict[str, str] | list[str]:
    """Return the ids of the sensors of a new agent, by their names in its state."""
    if isinstance(given, dict):
        return dict(zip(map(str, given), _find_ids(list(given.values())), strict=True))
    return [one if isinstance(one, str) else one.sensor_id for one in given]
