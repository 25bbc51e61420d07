"""Team memories: merge the changes that the members of a team have made to copies of their shared memory."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import compress, islice
from operator import is_, ne
from typing import Any

from gamms.core.copies import copy_deep

Memory = dict[Any, Any]

_NOTHING: Any = object()  # the value of a missing key


def find_copy_problem(memory: Memory) -> str | None:
    """Return the reason why a team memory cannot be copied, as a sentence; None: it can."""
    try:
        copy_deep(memory)
    except Exception as error:  # noqa: BLE001 - whatever the classes of strategies raise
        return (
            f"What was written into state['team_memory'] cannot be copied ({type(error).__name__}: {error}). "
            "Share plain values, and keep objects that hold the context in state['memory']."
        )
    return None


def merge_memory(before: Memory, copies: Sequence[Memory]) -> Memory:
    """Return the memory of a team after the changes of all its agents; `before` itself if nothing has changed.

    A key that one agent has changed gets its value. If several agents have changed it: sets are united; dicts are
    merged by the same rules; lists that extend the old list get all appended items, in the order of names; otherwise
    the value of the last name counts. A key is removed if all agents that changed it removed it.

    Args:
        before: the memory before.
        copies: the copies of its agents after their changes, in the order of names.
    """
    changes = _find_changes(before, copies)
    return copy_deep(_apply_changes(before, changes)) if changes else before


def _find_changes(before: Memory, copies: Sequence[Memory]) -> dict[Any, list[Any]]:
    """Return key -> its changed values, in the order of the copies; `_NOTHING` for a removed key."""
    changes: dict[Any, list[Any]] = {}
    for copy in copies:
        for key in _find_changed_keys(before, copy):
            value = copy.get(key, _NOTHING)
            old = before.get(key, _NOTHING)
            if _is_different(value, old):
                changes.setdefault(key, []).append(value)
    return changes


def _find_changed_keys(before: Memory, copy: Memory) -> Iterator[Any]:
    """Yield the keys whose value may differ in a copy."""
    # NOTE: most copies have the keys in the same order, and new ones behind them: these are compared in C
    # (benchmarks: memories).
    if len(copy) >= len(before) and all(map(is_, before, copy)):
        try:
            changed = list(compress(before, map(ne, before.values(), copy.values())))
        except (TypeError, ValueError):  # arrays, for example
            changed = [*before]
        yield from changed
        yield from islice(copy, len(before), None)
    else:
        yield from dict.fromkeys([*before, *copy])


def _apply_changes(before: Memory, changes: Mapping[Any, Sequence[Any]]) -> Memory:
    """Return a memory with changed values."""
    after = dict(before)
    for key, changed in changes.items():
        values = [value for value in changed if value is not _NOTHING]
        if values:
            after[key] = _merge_values(before.get(key), values)
        else:
            del after[key]
    return after


def _is_different(value: object, other: object) -> bool:
    """Return whether two values differ; values that cannot be compared do."""
    if value is other:
        return False
    try:
        return bool(value != other)
    except (TypeError, ValueError):  # arrays, for example
        return True


def _merge_values(old: object, values: list[Any]) -> Any:
    """Return the merged value of several new values of one key."""
    if len(values) == 1:
        return values[0]
    if all(isinstance(value, (set, frozenset)) for value in values):
        return set().union(*values)
    if all(isinstance(value, dict) for value in values):
        start = old if isinstance(old, dict) else {}
        return _apply_changes(start, _find_changes(start, values))
    begin = old if isinstance(old, list) else []
    if all(isinstance(value, list) and value[: len(begin)] == begin for value in values):
        return [*begin, *(one for value in values for one in value[len(begin) :])]
    return values[-1]
