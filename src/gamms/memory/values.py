"""What a field can hold: plain data, always copied, so that every store keeps and returns the same values."""

from collections.abc import Callable
from typing import Any

import numpy as np

from gamms.arguments import as_int
from gamms.errors import BadType, BadValue
from gamms.text import shown

MAX_DEPTH = 64  # deeper than any data we met, shallow enough for every CBOR reader; also ends a cycle

_WHOLE = (int, np.integer)
_FLOATING = (float, np.floating)
_NUMBER = (*_WHOLE, *_FLOATING)


def refuse(value: Any, place: str, wanted: str) -> BadType:
    """The error for a value of the wrong type."""
    return BadType(f"{place} must be {wanted}, not {shown(value)} ({type(value).__name__}).")


def whole(value: Any, place: str) -> int:
    """`value` as a plain 64-bit int; a bool is no number here."""
    return as_int(value, place)


def number(value: Any, place: str) -> float:
    """`value` as a plain float, NaN and infinity included."""
    if isinstance(value, bool) or not isinstance(value, _NUMBER):
        raise refuse(value, place, "a number")
    try:
        return float(value)
    except OverflowError:
        raise BadValue(f"{place} must fit into a float, not {shown(value)}.") from None


def text(value: Any, place: str) -> str:
    """`value` as a plain str that can be written as UTF-8."""
    if not isinstance(value, str):
        raise refuse(value, place, "a str")
    plain_text = str.__str__(value)
    if not plain_text.isascii():
        check_unicode(plain_text, place)
    return plain_text


def check_unicode(value: str, place: str) -> None:
    """Refuse text with half a surrogate pair, which no file can hold."""
    try:
        value.encode()
    except UnicodeEncodeError:
        raise BadValue(f"{place} must be valid Unicode, not {shown(value)}: it has a lone surrogate.") from None


def truth(value: Any, place: str) -> bool:
    """`value` as a plain bool."""
    if not isinstance(value, (bool, np.bool_)):
        raise refuse(value, place, "a bool")
    return bool(value)


def octets(value: Any, place: str) -> bytes:
    """`value` as plain bytes."""
    if not isinstance(value, bytes):
        raise refuse(value, place, "bytes")
    return bytes(value)


def plain(value: Any, place: str, depth: int = 0) -> Any:
    """A deep copy of `value` made of built-in types only.

    Raises:
        BadType: something in it is no plain data.
        BadValue: an integer beyond 64 bits, invalid Unicode, or more than `MAX_DEPTH` levels.
    """
    if depth > MAX_DEPTH:
        raise BadValue(f"{place} is nested more than {MAX_DEPTH} levels deep, or holds itself. Flatten it.")
    # NOTE: one look-up for the usual types; it saves half the time of `insert_many` with polylines.
    exact = _COPY_OF.get(type(value))
    if exact is not None:
        return exact(value, place, depth + 1)
    for accepted, copy in _COPIES:
        if isinstance(value, accepted):
            return copy(value, place, depth + 1)
    raise refuse(value, place, "None, a number, text, bytes, or a tuple, list, dict or set of those")


_Copy = Callable[[Any, str, int], Any]


def _items(value: Any, place: str, depth: int) -> list[Any]:
    return [plain(one, place, depth) for one in value]


# bool stands before int because it is one.
_COPIES: tuple[tuple[type | tuple[type, ...], _Copy], ...] = (
    (type(None), lambda _value, _place, _depth: None),
    ((bool, np.bool_), lambda value, _place, _depth: bool(value)),
    (_WHOLE, lambda value, place, _depth: whole(value, place)),
    (_FLOATING, lambda value, _place, _depth: float(value)),
    (str, lambda value, place, _depth: text(value, place)),
    ((bytes, bytearray), lambda value, _place, _depth: bytes(value)),
    (tuple, lambda value, place, depth: tuple(_items(value, place, depth))),
    (list, _items),
    (
        dict,
        lambda value, place, depth: {plain(key, place, depth): plain(one, place, depth) for key, one in value.items()},
    ),
    (frozenset, lambda value, place, depth: frozenset(_items(value, place, depth))),
    (set, lambda value, place, depth: set(_items(value, place, depth))),
)

_COPY_OF: dict[type, _Copy] = {
    kind: copy for accepted, copy in _COPIES for kind in (accepted if isinstance(accepted, tuple) else (accepted,))
}
