"""Checks at the door: turn what a caller passed into the plain value we store, or say what is wrong."""

import math
import os
from collections.abc import Iterable, Mapping
from numbers import Real
from operator import index
from typing import TYPE_CHECKING, Any

from gamms.errors import BadType, BadValue, nearest

if TYPE_CHECKING:
    from pathlib import Path

_INT64 = 2**63


def as_int(value: Any, name: str) -> int:
    """`value` as a plain int: ints and NumPy integers pass, bools and everything else do not.

    Raises:
        BadType: `value` is not an integer.
        BadValue: it does not fit into 64 bits.
    """
    if isinstance(value, bool):
        raise BadType(f"{name} must be an integer, not the bool {value!r}.")
    try:
        number = index(value)
    except TypeError:
        raise BadType(f"{name} must be an integer, not {value!r} ({type(value).__name__}).") from None
    if not -_INT64 <= number < _INT64:
        raise BadValue(f"{name} must fit into 64 bits, not {number}.")
    return number


def as_float(value: Any, name: str) -> float:
    """`value` as a plain, finite float.

    Raises:
        BadType: `value` is not a real number.
        BadValue: it is NaN or infinite.
    """
    if isinstance(value, bool) or not (isinstance(value, Real) or hasattr(value, "__float__")):
        raise BadType(f"{name} must be a number, not {value!r} ({type(value).__name__}).")
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise BadType(f"{name} must be a number, not {value!r}: {error}.") from None
    if not math.isfinite(number):
        raise BadValue(f"{name} must be finite, not {number}.")
    return number


def as_range(value: Any, name: str) -> float:
    """`value` as a distance that may be infinite, but neither negative nor NaN.

    Raises:
        BadType: `value` is not a real number.
        BadValue: it is negative or NaN.
    """
    if isinstance(value, Real) and value == math.inf:
        return math.inf
    number = as_float(value, name)
    if number < 0.0:
        raise BadValue(f"{name} must not be negative, not {number}.")
    return number


def as_numbers(value: Any, name: str, form: str) -> list[float]:
    """`value` as so many finite numbers as `form`, such as "(x, y, z)", names.

    Raises:
        BadType: `value` is no sequence of numbers.
        BadValue: there are more or fewer, or one is NaN or infinite.
    """
    if not hasattr(value, "__getitem__") or isinstance(value, (str, bytes, Mapping)):
        raise BadType(f"{name} must be {form}, not {value!r} ({type(value).__name__}).")
    if getattr(value, "ndim", 1) != 1 or len(value) != form.count(",") + 1:
        raise BadValue(f"{name} must be {form}, not {value!r}.")
    return [as_float(part, f"Every part of {name[:1].lower() + name[1:]} {form}") for part in value]


def as_name(value: Any, kind: str) -> str:
    """`value` as the name of something.

    Raises:
        BadType: `value` is not a string.
        BadValue: it is empty.
    """
    if not isinstance(value, str):
        raise BadType(f"The name of {kind} must be a string, not {value!r} ({type(value).__name__}).")
    if not value:
        raise BadValue(f"The name of {kind} must not be empty.")
    return value


def as_path(value: Any, name: str) -> "Path":
    """`value` as a path.

    Raises:
        BadType: `value` is neither a string nor a path.
    """
    if not isinstance(value, (str, os.PathLike)):
        raise BadType(f"{name} must be a path, not {value!r} ({type(value).__name__}).")
    from pathlib import Path  # which takes longer to load than most of GAMMS

    return Path(value)


def misspelt(given: Iterable[str], known: Iterable[str]) -> list[str]:
    """One sentence for each given keyword that is unknown but looks like a known one."""
    known = list(known)
    return [
        f"Unknown keyword {name!r}.{hint}" for name in given if name not in known and (hint := nearest(name, known))
    ]
