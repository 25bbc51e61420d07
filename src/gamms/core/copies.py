"""Deep copies of plain Python values: the game state outside columns, such as memories, facts and data of rules.

This module handles Python objects and holds the GIL.
"""

from __future__ import annotations

import warnings
from copy import deepcopy
from typing import Any

from numpy import ndarray

from gamms.core.form import as_dict

ONLY_PLAIN: dict[int, Any] = {}
"""In place of a memo: objects that are not plain are not copied, but raise NotPlain."""
_ATOMS = frozenset({str, bytes, int, float, bool, complex, frozenset, type(None)})


class NotPlain(Exception):
    """A value contains an object that is not plain, or contains an object twice."""


def copy_deep(value: Any, memo: Any = None) -> Any:
    """Return a deep copy; references to one object stay references to one object.

    Args:
        value: the value to copy.
        memo: id of an object -> its replacement, see `copy.deepcopy`; or `ONLY_PLAIN`.
    """
    try:
        return _copy_plain(value, set())
    except NotPlain:
        if memo is ONLY_PLAIN:
            raise
        return deepcopy(value, memo)


def copy_values(each: Any, memo: Any = None) -> Any:
    """Return a dict of deep copies of the values; a value that cannot be copied is shared."""
    try:
        return _copy_plain(each, set())
    except NotPlain:
        if memo is ONLY_PLAIN:
            raise
        return {key: _copy_or_share(value, memo) for key, value in each.items()}


def copy_items(values: Any, memo: Any = None, owner: str = "ctx.game.data") -> Any:
    """Return a deep copy of a dict; values that cannot be copied are left out, with a warning that names the owner."""
    before = {} if memo is None else dict(memo)
    try:
        return copy_deep(values, memo)
    except NotPlain:
        raise
    except Exception:  # noqa: BLE001 - whatever a caller's object raises when it is copied
        if memo is not None:  # it has parts of objects
            memo.clear()
            memo.update(before)
    known = {}
    for key, value in values.items():
        try:
            copy_deep(value, dict(before))
            known[key] = value
        except Exception as error:  # noqa: BLE001 - as above
            warnings.warn(
                f"{owner} has {key!r}, which cannot be copied ({type(error).__name__}: {error}): snapshots, forks and "
                "other copies of the game are without it. Make it where the key is missing.",
                stacklevel=2,
            )
    return copy_deep(known, memo)


def copy_dict(value: Any, memo: Any = None) -> Any:  # noqa: ARG001 - called as `copy_deep` is
    """Return a shallow copy of a dict, as a plain dict."""
    return dict(value)


def copy_each(dicts: Any, memo: Any = None) -> Any:  # noqa: ARG001 - called as `copy_deep` is
    """Return a dict of shallow copies of inner dicts."""
    made = {}
    for key, one in dicts.items():
        made[key] = one.copy()
    return made


def copy_filled(each: Any, memo: Any = None) -> Any:
    """Return a dict of copies of the memories of agents that are not empty; see `copy_items`."""
    made = {}
    for key, value in each.items():
        if value:
            made[key] = copy_items(value, memo, f"the memory of agent {key!r}")
    return made


def copy_fields(values: list[Any], copies: list[tuple[int, Any]], memo: Any = None) -> list[Any]:
    """Replace some values of a list by copies, and empty ones by None; return the list.

    Args:
        values: the values.
        copies: the index of each of these values, and the function that copies it; see `copy_deep`.
        memo: given to these functions.
    """
    for one in copies:
        value = values[one[0]]
        values[one[0]] = one[1](value, memo) if value else None
    return values


def restore_fields(state: Any, values: list[Any], shared: list[Any], replaced: list[Any], refilled: list[Any]) -> int:
    """Set attributes of an object to values from `copy_fields`.

    Args:
        state: the object.
        values: the values.
        shared: (index, name) of values that are set without a copy.
        replaced: (index, name, copy, make) of values that are set to a copy; None: to the result of `make`.
        refilled: (index, name, copy, fill) of dicts whose items are replaced by `fill`.
    """
    for one in shared:
        setattr(state, one[1], values[one[0]])
    for one in replaced:
        value = values[one[0]]
        if value:
            setattr(state, one[1], one[2](value, None))
        elif getattr(state, one[1]):
            setattr(state, one[1], one[3]())
    for one in refilled:
        value = values[one[0]]
        one[3](getattr(state, one[1]), one[2](value, None) if value else {})
    return 0


def refill(known: Any, value: Any) -> Any:
    """Replace the items of a dict in place, because others refer to it; return it."""
    known.clear()
    dict.update(known, value)  # scores are numbers already
    return known


def refill_each(known: Any, value: Any) -> Any:
    """Replace the items of inner dicts in place, and return the outer dict.

    An inner dict without a counterpart becomes empty.
    """
    for key, one in known.items():
        other = value.get(key)
        if one:
            one.clear()
        if other:
            one.update(other)
    return _add_missing(known, value)


def refill_counts(known: Any, value: Any) -> Any:
    """Replace the numbers of inner dicts in place, and return the outer dict.

    An inner dict without a counterpart is set to 0.
    """
    for key, one in known.items():
        other = value.get(key)
        one.update(dict.fromkeys(one, 0) if other is None else other)
    return _add_missing(known, value)


def _add_missing(known: Any, value: Any) -> Any:
    for key, one in value.items():
        if key not in known:
            known[key] = one.copy()
    return known


def _copy_or_share(value: Any, memo: Any) -> Any:
    try:
        return copy_deep(value, memo)
    except Exception:  # noqa: BLE001 - whatever a caller's object raises when it is copied
        return value


def _copy_plain(value: Any, seen: set[int]) -> Any:
    """Return a copy of a plain value; `seen` collects the ids of copied containers (NotPlain)."""
    kind = type(value)
    if kind is str or kind is int or value is None or kind in _ATOMS:
        return value
    number = id(value)
    if number in seen:
        raise NotPlain
    seen.add(number)
    if kind is dict:
        known = as_dict(value)
        made = known.copy()
        for key, one in known.items():
            own = _copy_plain(one, seen)
            if own is not one:
                made[key] = own
        return made
    if kind is list or kind is tuple:
        return kind([_copy_plain(one, seen) for one in value])
    if kind is set or (kind is ndarray and not value.dtype.hasobject and value.base is None):
        return value.copy()  # items of sets are immutable
    raise NotPlain
