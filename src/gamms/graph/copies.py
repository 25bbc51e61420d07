"""Copies of the attribute values that callers give and get, so that none of them is shared."""

from collections.abc import Callable
from typing import Any

import numpy as np

from gamms.errors import BadValue

MOST_DEPTH = 100  # far below what the recursion limit allows, so that what is accepted can be read anywhere


def own(value: Any, depth: int = 0) -> Any:
    """`value`, with the lists, dicts, sets and arrays in it copied: no caller can change what the graph holds.

    Raises:
        BadValue: it is nested too deeply, or holds itself.
    """
    copy = _COPIES.get(type(value))
    if copy is None:
        return value
    if depth > MOST_DEPTH:
        raise BadValue(f"An attribute must not be nested more than {MOST_DEPTH} levels deep, or hold itself.")
    return copy(value, depth + 1)


_COPIES: dict[type, Callable[[Any, int], Any]] = {
    list: lambda value, depth: [own(one, depth) for one in value],
    tuple: lambda value, depth: tuple(own(one, depth) for one in value),
    dict: lambda value, depth: {key: own(one, depth) for key, one in value.items()},
    set: lambda value, _depth: value.copy(),
    bytearray: lambda value, _depth: value.copy(),
    np.ndarray: lambda value, _depth: value.copy(),
}

CONTAINERS = frozenset(_COPIES)  # of other classes `own` gives back the value itself
