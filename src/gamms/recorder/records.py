"""Events as the record dicts that `replay` of 1.0.0 yields, and what format version 2 writes of them."""

from collections.abc import Callable, Iterator
from typing import Any

from gamms.arguments import as_int, as_name, as_numbers
from gamms.errors import BadType, BadValue
from gamms.ir import events as kinds
from gamms.ir.events import Log
from gamms.plain import why_not_plain
from gamms.recorder.formats.version2 import FIELDS
from gamms.text import shown
from gamms.typing.opcodes import OpCodes

Record = dict[str, Any]

TURN_NS = 1_000_000_000  # what a turn lasts in time stamps, which follow from the turns alone


def check_record(opcode: Any, data: Any) -> None:
    """See that a record of the user's own can be read again.

    Raises:
        BadType, BadValue: it cannot.
    """
    if not isinstance(opcode, OpCodes):
        raise BadType(f"opCode must be one of gamms.typing.OpCodes, not {shown(opcode)}.")
    if opcode is OpCodes.TERMINATE:
        raise BadValue("TERMINATE is written by ctx.record.stop().")
    if not isinstance(data, dict):
        raise BadType(f"What is recorded must be a dict of plain values, not {shown(data)}.")
    if flaw := why_not_plain(data):
        raise BadType(f"What is recorded must be a dict of plain values, not {shown(data)}: data{flaw}.")
    missing = sorted(FIELDS[opcode.value] - data.keys())
    if missing:
        raise BadValue(f"The data of {opcode.name} must have {', '.join(map(repr, missing))}, not only {list(data)}.")
    for field in sorted(FIELDS[opcode.value] & _CHECKS.keys()):
        _CHECKS[field](data[field], f"{field!r} of {opcode.name}")


def _check_heading(value: Any, name: str) -> None:
    if value is not None:
        as_numbers(value, name, "(cos, sin)")


_CHECKS: dict[str, Callable[[Any, str], Any]] = {
    **dict.fromkeys(("agent_name", "name", "sensor_id"), as_name),
    "node_id": as_int,
    "orientation": _check_heading,
    "position": lambda value, name: as_numbers(value, name, "(x, y, z)"),
    "quat": lambda value, name: as_numbers(value, name, "(w, x, y, z)"),
}


def steps_of(log: Log) -> Iterator[tuple[Any, Any]]:
    """The log of a turn, event by event: (number of the agent, node) of a move, else (None, (kind, data))."""
    entries = iter(log)
    for entry in entries:
        if type(entry) is tuple:
            yield None, entry
        else:
            yield entry, next(entries)


def named(step: tuple[int, Any], name: str) -> tuple[int, Any]:
    """An event that names its agent by number, as one that names it; `FORMS` are such events."""
    kind, data = step
    if kind == kinds.AERIAL_AGENT_FLIGHT:
        _, node, *position = data
        return kinds.AERIAL_AGENT_POSITION, {"agent_name": name, "position": position, "node": node}
    return kinds.AERIAL_AGENT_QUATERNION, {"agent_name": name, "quat": list(data[1:])}


def records_of_move(name: str, before: int, node: int, timestamp: int) -> tuple[Record, Record]:
    """What 1.0.0 says of one step of an agent on the ground."""
    return (
        {"timestamp": timestamp, "opCode": kinds.AGENT_PREV_NODE, "data": {"agent_name": name, "node_id": before}},
        {"timestamp": timestamp, "opCode": kinds.AGENT_CURRENT_NODE, "data": {"agent_name": name, "node_id": node}},
    )


def records_of(kind: int, data: Any, timestamp: int, before: int | None = None) -> list[Record]:
    """What 1.0.0 says of any other event; of those that it does not know, the same in its form.

    Args:
        kind: of the event.
        data: what happened.
        timestamp: in nanoseconds.
        before: the node a flyer was above, where it has moved.
    """
    if kind == kinds.AGENT_CREATE:
        told = [(kind, {"name": data["name"], "kwargs": data["kwargs"]}), *_told_of_creation(data)]
    elif kind == kinds.AERIAL_AGENT_POSITION:
        name = data["agent_name"]
        told = [(kind, {"agent_name": name, "position": data["position"]})]
        told += [] if before is None else [(kinds.AGENT_PREV_NODE, {"agent_name": name, "node_id": before})]
    else:
        told = [(kind, data)]
    return [{"timestamp": timestamp, "opCode": kind, "data": data} for kind, data in told]


def _told_of_creation(data: Any) -> Iterator[tuple[int, Any]]:
    """What 1.0.0 records of a new agent beside its keywords, or has to be told because it knows other keywords."""
    name, given, made = {"agent_name": data["name"]}, data["kwargs"], data.get("state", {})
    for key in given:
        if key in _NODES:
            yield _NODES[key], {**name, "node_id": given[key]}
        elif key == "orientation" and "heading" in made:
            yield kinds.AGENT_ORIENTATION, {**name, "orientation": list(made["heading"])}
        elif key == "position" and "position" in made:
            yield kinds.AERIAL_AGENT_POSITION, {**name, "position": list(made["position"])}
            yield kinds.AGENT_PREV_NODE, {**name, "node_id": given["start_node_id"]}
        elif key in ("quat", "orientation") and "quat" in made:
            yield kinds.AERIAL_AGENT_QUATERNION, {**name, "quat": list(made["quat"])}
    sensors = given.get("sensors", ())
    for key, sensor_id in sensors.items() if isinstance(sensors, dict) else zip(sensors, sensors, strict=True):
        yield kinds.AGENT_SENSOR_REGISTER, {**name, "name": key, "sensor_id": sensor_id}


_NODES = {"prev_node_id": kinds.AGENT_PREV_NODE, "current_node_id": kinds.AGENT_CURRENT_NODE}
