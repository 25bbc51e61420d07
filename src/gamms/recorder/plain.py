"""What a recording can hold: plain values, not too deep."""

from typing import Any

import numpy as np

_SCALARS = (str, int, float, bool, bytes, type(None))
_DEEPEST = 24


def is_plain(value: Any, depth: int = 0) -> bool:
    """Whether a value is a text, number, bytes, None, an array of numbers, or a list, tuple or dict of such."""
    kind = type(value)
    if kind in _SCALARS:
        return True
    if kind is np.ndarray:
        return value.dtype.kind in "biuf"
    if depth >= _DEEPEST:
        return False
    if kind in (list, tuple):
        return all(is_plain(one, depth + 1) for one in value)
    return kind is dict and all(type(key) in _SCALARS and is_plain(one, depth + 1) for key, one in value.items())


def plain(value: Any) -> Any:
    """A value that can be written; a NumPy number as Python's, and anything else as what it looks like."""
    if isinstance(value, np.generic):
        return value.item()
    return value if is_plain(value) else repr(value)
