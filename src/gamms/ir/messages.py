"""The log of messages of a game: their receivers and arrival turns.

An entry has `turn` (number of the turn in which it was sent, from 1), `channel`, `sender`, `to`, `body`, `size` (of the
body, bytes), `heard` and `overheard` (agent -> number of the turn in which the message is in its inbox), `lost` and
`jammed` (agents). The entry is complete as soon as a message is sent: messages in transit follow from the log.
"""

from collections.abc import Collection, Iterable, Mapping
from itertools import chain
from typing import Any

from gamms.errors import BadType
from gamms.text import shown

MESSAGE_COLUMNS = ("turn", "channel", "sender", "to", "receiver", "outcome", "arrival", "size", "body")
ARRIVALS = ("heard", "overheard")
"""The keys with the receivers of a message and their arrival turns."""
_NAMES = ("lost", "jammed")


def as_message(entry: dict[str, Any]) -> dict[str, Any]:
    """Check an entry of the log.

    Raises:
        BadType: it is not an entry.
    """
    times: list[Any] = [entry.get(key) for key in ARRIVALS]
    names: list[Any] = [entry.get(key) for key in _NAMES]
    has_times = all(isinstance(one, dict) and all(type(turn) is int for turn in one.values()) for one in times)
    has_numbers = all(type(entry.get(key)) is int for key in ("turn", "size")) and entry.keys() >= {"to", "body"}
    is_entry = has_times and has_numbers and all(isinstance(one, list) for one in names)
    if not is_entry or not all(isinstance(name, str) for name in chain.from_iterable((*times, *names))):
        raise BadType(f"{shown(entry)} is not one of the messages: it does not have receivers and arrival turns.")
    return entry


def make_message_table(entries: Iterable[Mapping[str, Any]]) -> dict[str, list[Any]]:
    """Return entries as columns, one row per message and receiver; receiver None if a message reaches no agent."""
    rows: list[tuple[Any, ...]] = []
    for entry in entries:
        first = [entry[key] for key in MESSAGE_COLUMNS[:4]]
        last = [entry["size"], entry["body"]]
        outcomes: list[tuple[str | None, str, int | None]] = []
        for outcome in (*ARRIVALS, *_NAMES):
            known: Collection[str] = entry[outcome]
            turns = known if isinstance(known, Mapping) else {}
            outcomes += [(name, outcome, turns.get(name)) for name in known]
        rows += [(*first, *one, *last) for one in outcomes or [(None, "out of reach", None)]]
    return {name: [row[i] for row in rows] for i, name in enumerate(MESSAGE_COLUMNS)}
