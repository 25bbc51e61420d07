"""Attribute values as JSON text and back: plain data only, so that reading can never run code.

JSON knows no tuples, bytes or dicts with other keys than strings; those are written as a dict with one tag.
"""

import json
import re
from base64 import b64decode, b64encode
from typing import Any

import numpy as np

from gamms.errors import BadFile, BadValue
from gamms.text import shown

_HALF_PAIR = re.compile("[\ud800-\udfff]")  # lone surrogates, which are no Unicode


def to_text(value: Any, where: str) -> str:
    """`value` as JSON text, the same text for the same value.

    Raises:
        BadValue: it is no plain value.
    """
    try:
        tagged = _tagged(value)
        text = json.dumps(tagged, separators=(",", ":"), ensure_ascii=False)
        has_half_pairs = not text.isascii() and _HALF_PAIR.search(text) is not None  # no database takes those
        return json.dumps(tagged, separators=(",", ":")) if has_half_pairs else text
    except (TypeError, ValueError, RecursionError) as error:
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


def from_text(text: str) -> Any:
    """The value that was written.

    Raises:
        BadFile: nobody wrote this.
    """
    try:
        return _untagged(json.loads(text))
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise BadFile(f"a value is damaged: {error}") from None


def _tagged(value: Any) -> Any:
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, list):
        return [_tagged(one) for one in value]
    if isinstance(value, tuple):
        return {"tuple": [_tagged(one) for one in value]}
    if isinstance(value, bytes):
        return {"bytes": b64encode(value).decode()}
    if isinstance(value, dict):
        return {"dict": [[_tagged(key), _tagged(one)] for key, one in value.items()]}
    raise TypeError(f"{type(value).__name__} is no plain type")


def _untagged(value: Any) -> Any:
    if isinstance(value, list):
        return [_untagged(one) for one in value]
    if not isinstance(value, dict):
        return value
    ((tag, inner),) = value.items()
    if tag == "tuple":
        return tuple(_untagged(one) for one in inner)
    if tag == "bytes":
        return b64decode(inner, validate=True)
    if tag == "dict":
        return {_untagged(key): _untagged(one) for key, one in inner}
    raise ValueError(f"unknown tag {tag!r}")
