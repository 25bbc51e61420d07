"""What the agents of a side have heard."""

from collections.abc import Container, Iterable, Iterator, Mapping
from typing import Any

from gamms.ir.messages import ARRIVALS


def select_heard(entries: Iterable[Mapping[str, Any]], names: Container[str], turn: float) -> Iterator[dict[str, Any]]:
    """Yield the messages that agents have sent or heard, without their fate among others and in later turns.

    Args:
        entries: the log of messages; see `ir.messages`.
        names: the names of the agents.
        turn: the last turn of which they know.
    """
    for entry in entries:
        heard = find_receivers(entry, names, turn)
        if entry["sender"] in names or any(heard.values()):
            yield {**entry, **heard, "lost": [], "jammed": []}


def find_receivers(entry: Mapping[str, Any], names: Container[str], turn: float) -> dict[str, dict[str, int]]:
    """Return which of the agents have heard or overheard a message until a turn, each with its turn of arrival."""
    return {key: {name: at for name, at in entry[key].items() if name in names and at <= turn} for key in ARRIVALS}
