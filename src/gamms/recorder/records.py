"""Events as the record dicts that `replay` of 1.0.0 yields, and what format version 2 writes of them."""

from collections.abc import Iterator
from typing import Any

from gamms.ir import journal as kinds
from gamms.ir.journal import Log

Record = dict[str, Any]

TURN_NS = 1_000_000_000  # what a turn lasts in time stamps, which follow from the turns alone


def steps_of(log: Log) -> Iterator[tuple[Any, Any]]:
    """The log of a turn, event by event: (number of the agent, node) of a move, else (None, (kind, data))."""
    entries = iter(log)
    for entry in entries:
        if type(entry) is tuple:
            yield None, entry
        else:
            yield entry, next(entries)


def records_of_move(name: str, before: int, node: int, timestamp: int) -> tuple[Record, Record]:
    """What 1.0.0 says of one step of an agent on the ground."""
    return (
        {"timestamp": timestamp, "opCode": kinds.AGENT_PREV_NODE, "data": {"agent_name": name, "node_id": before}},
        {"timestamp": timestamp, "opCode": kinds.AGENT_CURRENT_NODE, "data": {"agent_name": name, "node_id": node}},
    )


def record_of(kind: int, data: Any, timestamp: int) -> Record:
    """What 1.0.0 says of any other event; of those that it does not know, the same in its form."""
    if kind == kinds.AGENT_CREATE:
        data = {"name": data["name"], "kwargs": data["kwargs"]}
    elif kind == kinds.AERIAL_AGENT_POSITION:
        data = {"agent_name": data["agent_name"], "position": data["position"]}
    return {"timestamp": timestamp, "opCode": kind, "data": data}
