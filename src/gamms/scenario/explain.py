"""Why plain values are no scenario: where exactly, and what was probably meant."""

import types
from collections.abc import Iterable
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from gamms.errors import nearest
from gamms.scenario.errors import ScenarioError, joined
from gamms.scenario.shape import converted, fields_of, is_mapping
from gamms.text import shown


def checked(value: Any, kind: Any, path: str = "") -> Any:
    """Plain values as what a type describes.

    Raises:
        ScenarioError: they are not; it names the innermost place that is wrong.
    """
    try:
        return converted(value, kind)
    except (ValueError, TypeError, RecursionError) as error:
        raise _explained(value, kind, path, error) from None


def unknown_key(path: str, key: Any, value: Any, known: Iterable[Any]) -> ScenarioError:
    """A key that nobody knows."""
    known = [str(one) for one in known]
    hint = nearest(key, known) or (f" Keys here are: {', '.join(known)}." if known else "")
    return ScenarioError(joined(path, key), f"unknown key, with the value {shown(value)}.{hint}")


def _explained(value: Any, kind: Any, path: str, error: Exception) -> ScenarioError:
    for option in _options(kind):
        if is_mapping(option) and isinstance(value, dict):
            known = fields_of(option)
            for key in value:
                if key not in known:
                    return unknown_key(path, key, value[key], known)
            for key, (_, is_required) in known.items():
                if is_required and key not in value:
                    return ScenarioError(joined(path, key), f"is missing in {shown(value)}.")
        for key, inner, inner_kind in _parts(value, option):
            try:
                converted(inner, inner_kind)
            except (ValueError, TypeError, RecursionError) as inner_error:
                return _explained(inner, inner_kind, joined(path, key), inner_error)
    return ScenarioError(path, f"cannot be {shown(value)}: {_in_words(value, kind, str(error))}")


def _parts(value: Any, kind: Any) -> list[tuple[Any, Any, Any]]:
    """Key, value and type of what a value is made of, as far as it may be of that type."""
    origin, args = get_origin(kind), get_args(kind)
    if isinstance(value, dict):
        if is_mapping(kind):
            known = fields_of(kind)
            return [(key, inner, known[key][0]) for key, inner in value.items() if key in known]
        return [(key, inner, args[1]) for key, inner in value.items()] if origin is dict else []
    if isinstance(value, list) and origin is list:
        return [(number, inner, args[0]) for number, inner in enumerate(value)]
    if isinstance(value, list) and origin is tuple and len(value) == len(args):
        return [(number, inner, one) for number, (inner, one) in enumerate(zip(value, args, strict=True))]
    return []


def _options(kind: Any) -> list[Any]:
    """The types that a type may be, without their notes."""
    if get_origin(kind) is Annotated:
        return _options(get_args(kind)[0])
    if get_origin(kind) in (Union, types.UnionType):
        return [one for option in get_args(kind) for one in _options(option)]
    return [kind]


def _in_words(value: Any, kind: Any, message: str) -> str:
    """What is possible instead."""
    choices = [choice for option in _options(kind) if get_origin(option) is Literal for choice in get_args(option)]
    if choices:
        return f"use one of {', '.join(map(str, choices))}.{nearest(value, choices)}"
    plain = message.replace("`", "").replace("null", "nothing").replace("object", "mapping").replace("array", "list")
    return f"{plain[:1].lower()}{plain[1:].split(' - at ')[0]}."
