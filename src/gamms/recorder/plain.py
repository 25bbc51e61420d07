"""What a recording can hold: plain values, not too deep."""

import re
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

_SCALARS = (str, int, float, bool, bytes, type(None))
_SEQUENCES = (list, tuple, set, frozenset, np.ndarray)
_AS_BUILT_IN: dict[type, str] = {int: "__int__", float: "__float__", str: "__str__", bytes: "__bytes__"}
_DEEPEST = 24
_ADDRESS = re.compile(r" at 0x[0-9a-fA-F]+")


def is_plain(value: Any, depth: int = 0) -> bool:
    """Whether a value is a text, number, bytes, None, an array of numbers, or a list, tuple, set or dict of such."""
    kind = type(value)
    if kind in _SCALARS:
        return True
    if kind is np.ndarray:
        return value.dtype.kind in "biuf"
    if depth >= _DEEPEST:
        return False
    if kind in (list, tuple):
        return all(is_plain(one, depth + 1) for one in value)
    if kind in (set, frozenset):
        return all(map(_is_key, value))
    return kind is dict and all(_is_key(key) and is_plain(one, depth + 1) for key, one in value.items())


def plain(value: Any) -> Any:
    """A value that can be written, and is the caller's no longer: fresh containers of fresh containers.

    Numbers, texts and containers of other classes become Python's own, and anything else a text that is the same in
    every run.
    """
    return _converted(value, 0, _shown)


def plain_part(values: Mapping[Any, Any]) -> dict[Any, Any]:
    """What of a dict can be written, as `plain` gives it; anything else is left out, also of the dicts within."""
    return _converted_dict(values, 0, lambda _: ...)


def is_same(one: Any, other: Any) -> bool:
    """Whether two values that `plain` gave are equal, arrays in them, too."""
    if type(one) is not type(other):
        return False
    if isinstance(one, np.ndarray):
        return bool(one.dtype == other.dtype and one.shape == other.shape and one.tobytes() == other.tobytes())
    if isinstance(one, dict):
        return list(one) == list(other) and all(map(is_same, one.values(), other.values()))
    if isinstance(one, list | tuple):
        return len(one) == len(other) and all(map(is_same, one, other))
    return one is other or bool(one == other)


def _is_key(key: Any) -> bool:
    kind = type(key)
    return kind in _SCALARS or (kind in (tuple, frozenset) and all(map(_is_key, key)))


def _converted(value: Any, depth: int, other: Callable[[Any], Any]) -> Any:
    if isinstance(value, np.generic):
        value = value.item()
    if type(value) in _SCALARS:
        return value
    built_in = next((kind for kind in _AS_BUILT_IN if isinstance(value, kind)), None)
    if built_in is not None:  # an enum, for example
        return getattr(built_in, _AS_BUILT_IN[built_in])(value)
    if depth < _DEEPEST and isinstance(value, Mapping):
        return _converted_dict(value, depth, other)
    if depth < _DEEPEST and isinstance(value, _SEQUENCES):
        return _converted_list(value, depth)
    return other(value)


def _converted_dict(value: Mapping[Any, Any], depth: int, other: Callable[[Any], Any]) -> dict[Any, Any]:
    converted = {key if _is_key(key) else _key_of(key): _converted(one, depth + 1, other) for key, one in value.items()}
    return {key: one for key, one in converted.items() if one is not ...}


def _converted_list(value: Any, depth: int) -> Any:
    if isinstance(value, np.ndarray) and value.dtype.kind in "biuf":
        return np.array(value)
    if isinstance(value, set | frozenset):
        keys = map(_key_of, value)
        return frozenset(keys) if isinstance(value, frozenset) else set(keys)
    items = [_converted(one, depth + 1, _shown) for one in value]
    return tuple(items) if isinstance(value, tuple) else items


def _key_of(key: Any) -> Any:
    key = _converted(key, _DEEPEST - 1, _shown)
    return key if _is_key(key) else _shown(key)


def _shown(value: Any) -> str:
    """What an object looks like, without where it lies in memory."""
    return _ADDRESS.sub("", repr(value))
