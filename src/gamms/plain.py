"""The definition of plain values, which recordings, saved graphs and the data of rules consist of.

Plain are None, bool, int, float, str and bytes; arrays of at most eight dimensions of bools, integers and floats of at
most 64 bits; and lists, tuples, sets and dicts of plain values, at most `MOST_DEPTH` in each other. Keys of dicts and
items of sets are scalars, and tuples and frozen sets of such. Subclasses count (an enum, a NamedTuple), and so do
scalars of NumPy: `to_plain` gives Python's own.
"""

from base64 import b64encode
from collections.abc import Callable, Iterable, Mapping
from math import isfinite, isnan
from typing import Any, TypeAlias

import numpy as np

from gamms.text import as_text, shown, without_address, written

Plain: TypeAlias = Any
"""A plain value; type checkers know no type of lists and dicts, which are invariant, that holds all of them."""

MOST_DEPTH = 24
MOST_DIMENSIONS = 8
_MOST_BITS = 996  # of an integer in JSON, which other programs read as a float

_BUILT_IN = (str, int, float, bool, bytes, type(None))
_SCALARS = frozenset(_BUILT_IN)
_SEQUENCES = (list, tuple, set, frozenset, np.ndarray)
_AS_BUILT_IN: dict[type, str] = {int: "__int__", float: "__float__", str: "__str__", bytes: "__bytes__"}


def is_plain(value: Plain) -> bool:
    """Return whether a value is plain."""
    return not why_not_plain(value)


def to_plain(value: Plain) -> Plain:
    """Return a plain value that shares nothing with the caller's: fresh containers of fresh containers.

    Numbers, texts and containers of other classes become Python's own, and anything else a text that is the same in
    every run.
    """
    return _converted(value, 0, _described)


def as_json(value: Plain) -> Plain:
    """Convert a plain value to JSON values; integers of more than 300 digits become hexadecimal texts."""
    if isinstance(value, dict):
        return {key if isinstance(key, str) else as_text(key): as_json(one) for key, one in value.items()}
    if isinstance(value, (list, tuple, set, frozenset)):
        return [as_json(one) for one in (sorted(value, key=written) if isinstance(value, (set, frozenset)) else value)]
    if isinstance(value, np.ndarray):
        return as_json(value.tolist())
    if isinstance(value, bytes):
        return b64encode(value).decode()
    if isinstance(value, float) and not isfinite(value):
        return None if isnan(value) else str(value)
    return hex(value) if isinstance(value, int) and value.bit_length() > _MOST_BITS else value


def plain_subset(values: Mapping[Plain, Plain], left_out: list[Plain] | None = None) -> dict[Plain, Plain]:
    """Return the plain items of a dict, as from `to_plain`; other items are omitted, also in nested dicts.

    Args:
        values: the dict.
        left_out: collects the keys of values that were omitted in whole or in part.
    """
    if left_out is None:
        return _converted_dict(values, 0, lambda _: ...)
    missing: list[Plain] = []

    def note(value: Plain) -> Plain:
        missing.append(value)
        return ...

    part = _converted_dict(values, 0, note)
    if missing:  # seldom: then key by key
        for key, value in values.items():
            missing.clear()
            _converted(value, 1, note)
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


def why_not_plain(value: Plain, depth: int = 0) -> str:
    """Return where and why a value is not plain, such as "['brain'][2] is of type Brain"; "" if it is plain."""
    if type(value) in _SCALARS or isinstance(value, _BUILT_IN):
        return ""
    if isinstance(value, np.ndarray | np.generic):
        is_number = value.dtype.kind in "biuf" and value.dtype.itemsize <= 8 and value.ndim <= MOST_DIMENSIONS
        return "" if is_number else f" is of dtype {value.dtype} and shape {value.shape}"
    if isinstance(value, list | tuple | dict | set | frozenset):
        return _flaw_within(value, depth)
    return f" is of type {type(value).__name__}"


def _flaw_within(value: Plain, depth: int) -> str:
    if depth >= MOST_DEPTH:
        return f" is nested more than {MOST_DEPTH} levels deep, or holds itself"
    if isinstance(value, list | tuple):
        return "" if _SCALARS.issuperset(map(type, value)) else _first_flaw(enumerate(value), depth)
    if not _SCALARS.issuperset(map(type, value)):
        for key in value:
            if not _is_key(key):
                return f" has the key {shown(key)}, which cannot be written"
    return _first_flaw(value.items(), depth) if isinstance(value, dict) else ""


def _first_flaw(items: Iterable[tuple[Plain, Plain]], depth: int) -> str:
    for place, one in items:
        if flaw := why_not_plain(one, depth + 1):
            return f"[{shown(place)}]{flaw}"
    return ""


def _is_key(key: Plain) -> bool:
    if isinstance(key, tuple | frozenset):
        return all(map(_is_key, key))
    return type(key) in _SCALARS or (not why_not_plain(key) and not isinstance(key, np.ndarray))


# -- make it plain ----------------------------------------------------------------------------------------------


def _converted(value: Plain, depth: int, other: Callable[[Plain], Plain]) -> Plain:
    """Convert a value to a plain value; `other` replaces values that are not plain, or returns `...` to omit them."""
    if isinstance(value, np.generic):
        value = value.item()
    if type(value) in _SCALARS:
        return value
    built_in = next((kind for kind in _AS_BUILT_IN if isinstance(value, kind)), None)
    if built_in is not None:  # an enum, for example
        return getattr(built_in, _AS_BUILT_IN[built_in])(value)
    if depth < MOST_DEPTH and isinstance(value, Mapping):
        return _converted_dict(value, depth, other)
    if depth < MOST_DEPTH and isinstance(value, _SEQUENCES):
        return _converted_list(value, depth)
    return other(value)


def _converted_dict(value: Mapping[Plain, Plain], depth: int, other: Callable[[Plain], Plain]) -> dict[Plain, Plain]:
    converted = {_converted_key(key): _converted(one, depth + 1, other) for key, one in value.items()}
    return {key: one for key, one in converted.items() if one is not ...}


def _converted_list(value: Plain, depth: int) -> Plain:
    if isinstance(value, np.ndarray) and value.dtype.kind in "biuf":
        return np.array(value)
    if isinstance(value, set | frozenset):
        keys = map(_converted_key, value)
        return frozenset(keys) if isinstance(value, frozenset) else set(keys)
    # NOTE: scalars take a twentieth of the time (benchmarks: teams).
    are_scalars = _SCALARS.issuperset(map(type, value))
    items = list(value) if are_scalars else [_converted(one, depth + 1, _described) for one in value]
    return tuple(items) if isinstance(value, tuple) else items


def _converted_key(key: Plain) -> Plain:
    if _is_exact_key(key):
        return key
    key = _converted(key, MOST_DEPTH - 1, _described)
    return key if _is_exact_key(key) else _described(key)


def _is_exact_key(key: Plain) -> bool:
    kind = type(key)
    return kind in _SCALARS or (kind in (tuple, frozenset) and all(map(_is_exact_key, key)))


def _described(value: Plain) -> str:
    """Return the `repr` of an object without memory addresses."""
    try:
        text = repr(value)
    except Exception:  # noqa: BLE001 - of an object of the user, which has none
        text = object.__repr__(value)
    return without_address(text)
