"""Plain values of a scenario: copied, and changed by dotted paths."""

import math
from collections.abc import Mapping
from enum import Enum
from pathlib import PurePath
from typing import Any

from gamms.errors import nearest
from gamms.scenario.errors import ScenarioError, joined
from gamms.text import shown

_DEEPEST = 40
_INT64 = 1 << 63


def copied(value: Any, path: str = "", depth: int = 0) -> Any:
    """A copy of dicts, lists and scalars: what a file could say.

    Raises:
        ScenarioError: something in it is no plain value, NaN, or nested too deep.
    """
    if depth > _DEEPEST:
        raise ScenarioError(path, f"this is nested more than {_DEEPEST} deep.")
    if isinstance(value, Mapping):
        return {checked_key(key, path): copied(one, joined(path, key), depth + 1) for key, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [copied(one, joined(path, number), depth + 1) for number, one in enumerate(value)]
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, PurePath):
        return value.as_posix()
    if hasattr(value, "item") and getattr(value, "ndim", None) == 0:  # a scalar of NumPy
        value = value.item()
    if isinstance(value, float) and math.isnan(value):
        raise ScenarioError(path, "cannot be NaN, which is no number.")
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    raise ScenarioError(path, f"{shown(value)} is no plain value; a scenario is made of what a file could say.")


def checked_key(key: Any, path: str = "") -> str | int:
    """A key of a mapping: a text, or an integer of 64 bits. Longer ones could be made to have one hash, all of them.

    Raises:
        ScenarioError: it is something else.
    """
    if isinstance(key, bool) or not isinstance(key, (str, int)):
        raise ScenarioError(path, f"a key must be a text or an integer, not {shown(key)}. Put quotes around it.")
    if isinstance(key, int) and not -_INT64 <= key < _INT64:
        raise ScenarioError(path, f"a key that is an integer must fit into 64 bits, not {shown(key)}.")
    return key


def changed(raw: dict[Any, Any], changes: Mapping[str, Any]) -> dict[Any, Any]:
    """A copy in which each dotted path leads to another value.

    A part of a path is a key, or the number or the name of an item of a list. The last key may be new.

    Raises:
        ScenarioError: a path leads nowhere.
    """
    new: dict[Any, Any] = copied(raw)
    for path, value in changes.items():
        here: Any = new
        *way, last = path.split(".")
        for number, part in enumerate(way):
            here = _entered(here, part, ".".join(way[: number + 1]), is_section=number == 0)
        _put(here, last, copied(value, path), path)
    return new


def _entered(here: Any, part: str, path: str, *, is_section: bool) -> Any:
    """What a part of a path leads to."""
    key = _found(here, part)
    if key is None and is_section:
        return here.setdefault(part, {})  # such as settings, of which there need not be any
    if key is None:
        raise ScenarioError(path, f"there is no {part!r} to change.{nearest(part, _known(here))}")
    if here[key] is None:
        here[key] = {}
    return here[key]


def _put(here: Any, last: str, value: Any, path: str) -> None:
    key = _found(here, last)
    if key is not None:
        here[key] = value
    elif isinstance(here, dict):
        here[last] = value
    else:
        raise ScenarioError(path, f"there is no {last!r} to change.{nearest(last, _known(here))}")


def _found(here: Any, part: str) -> Any:
    """The key or number of a part; None if there is none."""
    if isinstance(here, dict):
        return next((key for key in here if str(key) == part), None)
    if isinstance(here, list):
        names = [str(number) for number in range(len(here))]
        for labels in (names, _known(here)):
            if part in labels:
                return labels.index(part)
    return None


def _known(here: Any) -> list[str]:
    """What a path can go on with."""
    if isinstance(here, dict):
        return [str(key) for key in here]
    if isinstance(here, list):
        return [str(one.get("name", one.get("rule", ""))) if isinstance(one, dict) else str(one) for one in here]
    return []
