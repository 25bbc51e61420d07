"""The definition of plain values, which recordings, saved graphs and the data of rules consist of.

Plain are None, bool, int, float, str and bytes; arrays of at most eight dimensions of bools, integers and floats of at
most 64 bits; and lists, tuples, sets and dicts of plain values, at most `MOST_DEPTH` in each other, where a set counts
as `LEVELS_OF_SET`. Keys of dicts and items of sets are scalars, and tuples and frozen sets of such. Subclasses count
(an enum, a NamedTuple), and so do scalars of NumPy: `to_plain` gives Python's own.
"""

from base64 import b64encode
from collections.abc import Callable, Iterable, Mapping
from math import isfinite, isnan
from typing import Any, TypeAlias

import numpy as np

from gamms.text import as_text, remove_addresses, shown, write_repr

Plain: TypeAlias = Any
"""A plain value; type checkers know no type of lists and dicts, which are invariant, that holds all of them."""

MOST_DEPTH = 24
LEVELS_OF_SET = 7  # because `marshal`, by which changes are found, writes the items of each set twice
MOST_DIMENSIONS = 8
MOST_WHOLE = 1 << 53  # the largest stored count or turn: it is exact as a float, too
_MOST_BITS = 996  # of an integer in JSON, which other programs read as a float

_BUILT_IN = (str, int, float, bool, bytes, type(None))
_SCALARS = frozenset(_BUILT_IN)
_SEQUENCES = (list, tuple, set, frozenset, np.ndarray)
Replace: TypeAlias = Callable[[Plain], Plain]
"""Returns the replacement of a value that is not plain."""

_AS_BUILT_IN: dict[type, str] = {int: "__int__", float: "__float__", str: "__str__", bytes: "__bytes__"}


def is_plain(value: Plain) -> bool:
    """Return whether a value is plain."""
    return not describe_flaw(value)


def to_plain(value: Plain) -> Plain:
    """Return a plain value that shares nothing with the caller's: fresh containers of fresh containers.

    Numbers, texts and containers of other classes become Python's own, and anything else a text that is the same in
    every run.
    """
    return _convert(value, 0, _describe, _describe)


def as_json(value: Plain) -> Plain:
    """Convert a plain value to JSON values; integers of more than 300 digits become hexadecimal texts."""
    if isinstance(value, dict):
        return {key if isinstance(key, str) else as_text(key): as_json(one) for key, one in value.items()}
    if isinstance(value, (list, tuple, set, frozenset)):
        return [
            as_json(one) for one in (sorted(value, key=write_repr) if isinstance(value, (set, frozenset)) else value)
        ]
    if isinstance(value, np.ndarray):
        return as_json(value.tolist())
    if isinstance(value, bytes):
        return b64encode(value).decode()
    if isinstance(value, float) and not isfinite(value):
        return None if isnan(value) else str(value)
    return hex(value) if isinstance(value, int) and value.bit_length() > _MOST_BITS else value


def select_plain(values: Mapping[Plain, Plain], left_out: list[Plain] | None = None) -> dict[Plain, Plain]:
    """Return the plain items of a dict, as from `to_plain`; other items are omitted, also in nested dicts.

    Args:
        values: the dict.
        left_out: collects the keys of values of which something was omitted, or became a text: in lists, sets and keys.
    """
    if left_out is None:
        return _convert_dict(values, 0, lambda _: ..., _describe)
    missing: list[Plain] = []

    def note(value: Plain) -> Plain:
        missing.append(value)
        return ...

    def describe(value: Plain) -> str:
        missing.append(value)
        return _describe(value)

    part = _convert_dict(values, 0, note, describe)
    if missing:  # seldom: then key by key
        for key, value in values.items():
            missing.clear()
            _convert_dict({key: value}, 0, note, describe)
            if missing:
                left_out.append(key)
    return part


def is_same(one: Plain, other: Plain) -> bool:
    """Return whether two values from `to_plain` are equal, including arrays and the order of keys."""
    if one is other:
        return True
    if type(one) is not type(other):
        return False
    if isinstance(one, np.ndarray):
        return bool(one.dtype == other.dtype and one.shape == other.shape and one.tobytes() == other.tobytes())
    if isinstance(one, dict):
        return list(one) == list(other) and all(map(is_same, one.values(), other.values()))
    if isinstance(one, list | tuple):
        return len(one) == len(other) and all(map(is_same, one, other))
    return bool(one == other)


# -- is it plain ------------------------------------------------------------------------------------------------


def describe_flaw(value: Plain, depth: int = 0) -> str:
    """Return where and why a value is not plain, such as "['brain'][2] is of type Brain"; "" if it is plain."""
    if type(value) in _SCALARS or isinstance(value, _BUILT_IN):
        return ""
    if isinstance(value, np.ndarray | np.generic):
        is_number = value.dtype.kind in "biuf" and value.dtype.itemsize <= 8 and value.ndim <= MOST_DIMENSIONS
        return "" if is_number else f" is of dtype {value.dtype} and shape {value.shape}"
    if isinstance(value, list | tuple | dict | set | frozenset):
        return _find_flaw(value, depth)
    return f" is of type {type(value).__name__}"


def _find_flaw(value: Plain, depth: int) -> str:
    if depth >= MOST_DEPTH:
        return f" is nested more than {MOST_DEPTH} levels deep, or holds itself"
    if isinstance(value, list | tuple):
        return "" if _SCALARS.issuperset(map(type, value)) else _find_first_flaw(enumerate(value), depth)
    if not _SCALARS.issuperset(map(type, value)):
        for key in value:
            if not _is_key(key, depth + _count_levels(value)):
                return f" has the key {shown(key)}, which cannot be written"
    return _find_first_flaw(value.items(), depth) if isinstance(value, dict) else ""


def _find_first_flaw(items: Iterable[tuple[Plain, Plain]], depth: int) -> str:
    for place, one in items:
        if flaw := describe_flaw(one, depth + 1):
            return f"[{shown(place)}]{flaw}"
    return ""


def _is_key(key: Plain, depth: int) -> bool:
    if isinstance(key, tuple | frozenset):
        return depth < MOST_DEPTH and all(_is_key(one, depth + _count_levels(key)) for one in key)
    return type(key) in _SCALARS or (not describe_flaw(key) and not isinstance(key, np.ndarray))


def _count_levels(container: Plain) -> int:
    """Return how many levels of nesting a container counts as."""
    return LEVELS_OF_SET if isinstance(container, set | frozenset) else 1


# -- make it plain ----------------------------------------------------------------------------------------------


def _convert(value: Plain, depth: int, other: Replace, describe: Replace) -> Plain:
    """Convert a value to a plain value.

    Args:
        value: the value.
        depth: the number of containers around it.
        other: replaces values that are not plain, or returns `...` to omit them.
        describe: replaces them in lists, in sets and as keys, where none is omitted.
    """
    if isinstance(value, np.generic):
        value = value.item()
    if type(value) in _SCALARS:
        return value
    built_in = next((kind for kind in _AS_BUILT_IN if isinstance(value, kind)), None)
    if built_in is not None:  # an enum, for example
        return getattr(built_in, _AS_BUILT_IN[built_in])(value)
    if depth < MOST_DEPTH and isinstance(value, Mapping):
        return _convert_dict(value, depth, other, describe)
    if depth < MOST_DEPTH and isinstance(value, _SEQUENCES):
        return _convert_list(value, depth, describe)
    return other(value)


def _convert_dict(value: Mapping[Plain, Plain], depth: int, other: Replace, describe: Replace) -> dict[Plain, Plain]:
    converted = {
        _convert_key(key, depth + 1, describe): _convert(one, depth + 1, other, describe) for key, one in value.items()
    }
    return {key: one for key, one in converted.items() if one is not ...}


def _convert_list(value: Plain, depth: int, describe: Replace) -> Plain:
    if isinstance(value, np.ndarray) and value.dtype.kind in "biuf":
        return np.array(value)
    if isinstance(value, set | frozenset):
        keys = [_convert_key(key, depth + LEVELS_OF_SET, describe) for key in value]
        return frozenset(keys) if isinstance(value, frozenset) else set(keys)
    # NOTE: scalars take a twentieth of the time (benchmarks: teams).
    are_scalars = _SCALARS.issuperset(map(type, value))
    items = list(value) if are_scalars else [_convert(one, depth + 1, describe, describe) for one in value]
    return tuple(items) if isinstance(value, tuple) else items


def _convert_key(key: Plain, depth: int, describe: Replace) -> Plain:
    if _is_exact_key(key, depth):
        return key
    key = _convert(key, MOST_DEPTH - 1, describe, describe)
    return key if _is_exact_key(key, depth) else describe(key)


def _is_exact_key(key: Plain, depth: int) -> bool:
    kind = type(key)
    if kind not in (tuple, frozenset):
        return kind in _SCALARS
    return depth < MOST_DEPTH and all(_is_exact_key(one, depth + _count_levels(key)) for one in key)


def _describe(value: Plain) -> str:
    """Return the `repr` of an object without memory addresses."""
    try:
        text = repr(value)
    except Exception:  # noqa: BLE001 - of an object of the user, which has none
        text = object.__repr__(value)
    return remove_addresses(text)
