"""What the members of a team share: copies of it, which they may write to, and what follows from these."""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from copy import deepcopy
from functools import partial
from itertools import compress, count, islice
from operator import is_, ne
from typing import Any

Memory = dict[Any, Any]

_PLAIN = frozenset({str, bytes, int, float, bool, type(None)})
_NOTHING: Any = object()  # stands for a key that is not there


def memory_copy(memory: Memory) -> Memory:
    """Return a copy of a team's memory, which may be written to."""
    return copier_of(memory)()


def copier_of(memory: Memory) -> Callable[[], Memory]:
    """Return a function that copies a team's memory as often as it is called, until the memory changes.

    Each copy has containers of its own. Those that stand in several places are one in a copy, too.
    """
    # NOTE: each of many agents gets a copy of what all have written, and `deepcopy` takes a microsecond for each value
    # (benchmarks: memories).
    try:
        return _copier(memory, set()) or memory.copy
    except _NeedsDeepcopyError:
        return partial(deepcopy, memory)


def why_not_copied(memory: Memory) -> str | None:
    """Return why a team's memory cannot be copied, as a sentence for the agent that wrote into it; None: it can."""
    try:
        copier_of(memory)()
    except Exception as error:  # noqa: BLE001 - whatever the classes of strategies raise
        return (
            f"What was written into state['team_memory'] cannot be copied ({type(error).__name__}: {error}). "
            "Share plain values, and keep objects that hold the context in state['memory']."
        )
    return None


class _NeedsDeepcopyError(Exception):
    """Something is of no class of Python's own, or stands in several places."""


def _copier(value: Any, seen: set[int]) -> Callable[[], Any] | None:
    """Return a function that copies a value; None: copies may share it.

    Args:
        value: what is to be copied.
        seen: the ids of the containers that were met before; this one and those in it are added.

    Raises:
        _NeedsDeepcopyError: only `deepcopy` copies it well.
    """
    kind = type(value)
    if kind in _PLAIN:
        return None
    is_fixed = kind in (tuple, frozenset)
    if not is_fixed and (kind not in (dict, list, set) or id(value) in seen):
        raise _NeedsDeepcopyError
    seen.add(id(value))
    if kind is dict:
        _copiers(value, value.keys(), seen)  # raises where a key has to be copied
        copiers = _copiers(value, value.values(), seen)
    else:
        copiers = _copiers(count(), value, seen)
    if copiers and kind not in (dict, list):
        raise _NeedsDeepcopyError
    if is_fixed:
        return None
    copy: Callable[[], Any] = partial(_copied, value, copiers) if copiers else value.copy
    return copy


def _copiers(keys: Iterable[Any], parts: Collection[Any], seen: set[int]) -> list[tuple[Any, Callable[[], Any]]]:
    """Return the keys of those parts of a container that copies may not share, each with a function that copies it."""
    if _PLAIN.issuperset(map(type, parts)):
        return []
    each = ((key, _copier(part, seen)) for key, part in zip(keys, parts, strict=False))
    return [(key, copier) for key, copier in each if copier is not None]


def _copied(value: Any, parts: Sequence[tuple[Any, Callable[[], Any]]]) -> Any:
    """Return a copy of a dict or a list, some parts of which are copied."""
    copy = value.copy()
    for key, copied in parts:
        copy[key] = copied()
    return copy


def merged_memory(before: Memory, copies: Sequence[Memory]) -> Memory:
    """Return what a team remembers after all its agents have written: `before` itself if nothing has changed.

    A key that one agent changed has its value. Where several changed it: sets are united; dicts are merged by these
    rules; lists that begin as the old one did get what each agent appended, in the order of the names; of anything
    else the value of the last name counts. A key is gone if all who changed it removed it.

    Args:
        before: what it remembered.
        copies: what its agents have made of their copies, in the order of their names.
    """
    changes = _changes(before, copies)
    return memory_copy(_changed(before, changes)) if changes else before


def _changes(before: Memory, copies: Sequence[Memory]) -> dict[Any, list[Any]]:
    """Return key -> its other values, in the order of the copies; `_NOTHING` where it is not there."""
    changes: dict[Any, list[Any]] = {}
    for copy in copies:
        for key in _changed_keys(before, copy):
            value, old = copy.get(key, _NOTHING), before.get(key, _NOTHING)
            if _differs(value, old):
                changes.setdefault(key, []).append(value)
    return changes


def _changed_keys(before: Memory, copy: Memory) -> Iterator[Any]:
    """Yield the keys of which a copy may have another value."""
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


def _changed(before: Memory, changes: Mapping[Any, Sequence[Any]]) -> Memory:
    """Return a memory with other values."""
    after = dict(before)
    for key, changed in changes.items():
        values = [value for value in changed if value is not _NOTHING]
        if values:
            after[key] = _one_of(before.get(key), values)
        else:
            del after[key]
    return after


def _differs(value: object, other: object) -> bool:
    """Return whether two values differ; what cannot be compared does."""
    if value is other:
        return False
    try:
        return bool(value != other)
    except (TypeError, ValueError):  # arrays, for example
        return True


def _one_of(old: object, values: list[Any]) -> Any:
    """Return what becomes of several new values of one key."""
    if len(values) == 1:
        return values[0]
    if all(isinstance(value, (set, frozenset)) for value in values):
        return set().union(*values)
    if all(isinstance(value, dict) for value in values):
        start = old if isinstance(old, dict) else {}
        return _changed(start, _changes(start, values))
    begin = old if isinstance(old, list) else []
    if all(isinstance(value, list) and value[: len(begin)] == begin for value in values):
        return [*begin, *(one for value in values for one in value[len(begin) :])]
    return values[-1]
