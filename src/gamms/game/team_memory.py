"""What the members of a team share: copies of it, which they may write to, and what follows from these."""

from copy import deepcopy
from typing import Any

Writes = list[tuple[str, dict[str, Any]]]  # (agent, what it made of its copy), in the order of the names

_PLAIN = frozenset({str, bytes, int, float, bool, type(None)})
_DEEPEST = 2  # dicts within dicts whose values are looked at before they are copied
_NOTHING: Any = object()  # stands for a key that is not there


def memory_copy(shared: dict[Any, Any]) -> dict[Any, Any]:
    """Return a copy of a team's memory, which may be written to."""
    if _PLAIN.issuperset(map(type, shared.values())):
        return shared.copy()
    # NOTE: `deepcopy` takes ten times as long for many plain values, such as those of `sweep` and `assign`.
    found, level = dict[int, Any](), [shared]
    for _ in range(_DEEPEST):
        inner = [value for one in level for value in one.values()]
        found |= {id(one): one.copy() for one in inner if _is_flat(one)}
        level = [one for one in inner if type(one) is dict and id(one) not in found]
    return deepcopy(shared, found)


def _is_flat(value: object) -> bool:
    """Whether a value is a container of plain values, and of tuples of these, which copies of it may share."""
    if type(value) not in (dict, list, set):
        return False
    parts: Any = [*value, *value.values()] if isinstance(value, dict) else value
    others = set(map(type, parts)) - _PLAIN
    return not others or (
        others == {tuple} and all(_PLAIN.issuperset(map(type, part)) for part in parts if type(part) is tuple)
    )


def merged_memory(before: dict[Any, Any], writes: Writes) -> dict[Any, Any]:
    """Return what a team remembers after all its agents have written.

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


def differs(value: object, other: object) -> bool:
    """Return whether two values differ; what cannot be compared does."""
    if value is other:
        return False
    try:
        return bool(value != other)
    except (TypeError, ValueError):  # arrays, for example
        return True


def _one_of(old: object, values: list[Any]) -> Any:
    if len(values) < 2:
        return values[0] if values else _NOTHING
    if all(isinstance(value, (set, frozenset)) for value in values):
        return set().union(*values)
    if all(isinstance(value, dict) for value in values):
        return merged_memory(old if isinstance(old, dict) else {}, [("", value) for value in values])
    start = old if isinstance(old, list) else []
    if all(isinstance(value, list) and value[: len(start)] == start for value in values):
        return [*start, *(one for value in values for one in value[len(start) :])]
    return values[-1]
