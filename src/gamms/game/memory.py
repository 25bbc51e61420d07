"""What teams remember together: everybody writes into a copy, and the copies become one between two turns."""

from copy import deepcopy
from typing import Any

_PLAIN = (str, bytes, int, float, bool, type(None))

Writes = list[tuple[str, dict[str, Any]]]  # (agent, what it made of its copy), in the order of the names


def copied(shared: dict[Any, Any]) -> dict[Any, Any]:
    """A copy that may be written to."""
    return shared.copy() if all(type(value) in _PLAIN for value in shared.values()) else deepcopy(shared)


def merged(before: dict[Any, Any], writes: Writes) -> dict[Any, Any]:
    """What a team remembers after everybody has written.

    A key that one agent changed has its value. Where several changed it: sets are united; dicts are merged by these
    rules; lists that begin as the old one did get what each agent appended, in the order of the names; of anything
    else the value of the last name counts. A key is gone if all who changed it removed it.
    """
    after = {}
    keys = dict.fromkeys([*before, *(key for _, copy in writes for key in copy)])
    for key in keys:
        old = before.get(key, _NOTHING)
        new = [copy.get(key, _NOTHING) for _, copy in writes]
        changed = [value for value in new if differs(value, old)]
        value = _one_of(old, [value for value in changed if value is not _NOTHING]) if changed else old
        if value is not _NOTHING:
            after[key] = value
    return after


def differs(value: Any, other: Any) -> bool:
    """Whether two values differ; what cannot be compared does."""
    if value is other:
        return False
    try:
        return bool(value != other)
    except (TypeError, ValueError):  # arrays, for example
        return True


class _Nothing:
    """Stands for a key that is not there."""


_NOTHING = _Nothing()


def _one_of(old: Any, values: list[Any]) -> Any:
    if len(values) < 2:
        return values[0] if values else _NOTHING
    if all(isinstance(value, (set, frozenset)) for value in values):
        return set().union(*values)
    if all(isinstance(value, dict) for value in values):
        return merged(old if isinstance(old, dict) else {}, [("", value) for value in values])
    start = old if isinstance(old, list) else []
    if all(isinstance(value, list) and value[: len(start)] == start for value in values):
        return [*start, *(one for value in values for one in value[len(start) :])]
    return values[-1]
