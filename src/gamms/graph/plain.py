"""Attribute values as JSON text and back: plain data only, so that reading can never run code.

JSON knows no tuples, bytes, halves of surrogate pairs or dicts with other keys than strings; those are written as a
dict with one tag.
"""

import json
import re
from base64 import b64decode, b64encode
from typing import Any

import numpy as np

from gamms.errors import BadFile, BadValue
from gamms.graph.tables import MOST_DEPTH
from gamms.limits import Allowance, Keys
from gamms.text import shown

_HALF_PAIR = re.compile("[\ud800-\udfff]")  # surrogates, which are no Unicode on their own
_KINDS = "biufSU"  # of NumPy's scalars: those that are equal to a plain value
_BYTES_PER_CONTAINER = 100  # of memory, at least about
_BYTES_PER_ITEM = 40


def to_text(value: Any, where: str) -> str:
    """`value` as JSON text, the same text for the same value.

    Raises:
        BadValue: it is no plain value.
    """
    try:
        return json.dumps(_tagged(value, 0), separators=(",", ":"), ensure_ascii=False)
    except (TypeError, ValueError) as error:
        raise BadValue(
            f"{where} cannot be saved: {shown(value)} ({error}). Only None, bool, int, float, str, bytes, list, tuple "
            f"and dict of these can; convert it, or remove the attribute before saving."
        ) from None


def is_plain(value: Any) -> bool:
    """Whether `to_text` can write it."""
    try:
        to_text(value, "It")
    except BadValue:
        return False
    return True


class Texts:
    """The texts of one file, read within what the file may take.

    Args:
        allowance: of the file.
    """

    def __init__(self, allowance: Allowance) -> None:
        self._allowance = allowance
        self._keys = Keys()

    def read(self, text: str) -> Any:
        """The value that `to_text` wrote.

        Raises:
            BadFile: it wrote no such text, or the file would take too much memory or time.
        """
        containers, items = text.count("[") + text.count("{"), text.count(",")
        self._allowance.charge(len(text) + _BYTES_PER_CONTAINER * containers + _BYTES_PER_ITEM * items)
        try:
            return self._untagged(json.loads(text))
        except BadFile:
            raise
        except (ValueError, TypeError, KeyError, RecursionError) as error:
            raise BadFile(f"a value is damaged: {error}") from None

    def _untagged(self, value: Any) -> Any:
        if isinstance(value, list):
            return [self._untagged(one) for one in value]
        if not isinstance(value, dict):
            return value
        ((tag, inner),) = value.items()
        if tag == "tuple":
            return tuple(self._untagged(one) for one in inner)
        if tag == "bytes":
            return b64decode(inner, validate=True)
        if tag == "text":
            return b64decode(inner, validate=True).decode("utf-8", "surrogatepass")
        if tag == "dict":
            return {self._keys.check(self._untagged(key)): self._untagged(one) for key, one in inner}
        raise ValueError(f"unknown tag {shown(tag)}")


def _tagged(value: Any, depth: int) -> Any:
    if depth > MOST_DEPTH:
        raise ValueError(f"it is nested more than {MOST_DEPTH} levels deep, or holds itself")
    if isinstance(value, np.generic) and value.dtype.kind in _KINDS and not isinstance(value, np.longdouble):
        value = value.item()
    if value is None or isinstance(value, bool | int | float):
        return value
    if isinstance(value, str):
        return value if value.isascii() or not _HALF_PAIR.search(value) else {"text": _base64(_utf8(value))}
    if isinstance(value, list):
        return [_tagged(one, depth + 1) for one in value]
    if isinstance(value, tuple):
        return {"tuple": [_tagged(one, depth + 1) for one in value]}
    if isinstance(value, bytes):
        return {"bytes": _base64(value)}
    if isinstance(value, dict):
        return {"dict": [[_tagged(key, depth + 1), _tagged(one, depth + 1)] for key, one in value.items()]}
    raise TypeError(f"{type(value).__name__} is no plain type")


def _utf8(text: str) -> bytes:
    return text.encode("utf-8", "surrogatepass")


def _base64(data: bytes) -> str:
    return b64encode(data).decode()
