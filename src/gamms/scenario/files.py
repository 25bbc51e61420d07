"""Scenario files in, plain values out; the one door to YAML. Reading never runs code, and is bounded."""

import json
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from gamms.scenario.errors import ScenarioError, joined
from gamms.scenario.plain import checked_key
from gamms.text import shown

MOST_BYTES = 1_000_000
_DEEPEST = 40
_SUFFIXES = (".yaml", ".yml", ".json")

# What a plain word of YAML 1.2 means. YAML 1.1, which PyYAML reads otherwise, makes booleans of `on` and `no`.
_WORDS = re.compile(
    r"(?P<null>~|null|Null|NULL|)"
    r"|(?P<bool>true|True|TRUE|false|False|FALSE)"
    r"|(?P<int>[-+]?[0-9]+)"
    r"|(?P<float>[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?|[-+]?\.(?:inf|Inf|INF))"
)
_TAG = "tag:yaml.org,2002:"


def read(file: Path) -> Any:
    """The plain values in a scenario file.

    Raises:
        ScenarioError: it is too large, no text, no YAML or JSON, or says a key twice.
        OSError: it cannot be read.
    """
    if file.suffix.lower() not in _SUFFIXES:
        raise ScenarioError("", f"a scenario file ends in {', '.join(_SUFFIXES)}, not {file.suffix!r}.")
    with file.open("rb") as stream:
        data = stream.read(MOST_BYTES + 1)
    if len(data) > MOST_BYTES:
        raise ScenarioError("", f"the file has more than {MOST_BYTES:,} bytes. Put maps and tables into other files.")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ScenarioError("", f"the file is no UTF-8 text: {error}.") from None
    return from_json(text) if file.suffix.lower() == ".json" else from_yaml(text)


def from_json(text: str) -> Any:
    """The plain values in a text of JSON.

    Raises:
        ScenarioError: it is none, or says a key twice.
    """
    try:
        return json.loads(text, object_pairs_hook=_once, parse_constant=_refuse_constant, parse_float=_float)
    except (ValueError, RecursionError) as error:
        if isinstance(error, ScenarioError):
            raise
        raise ScenarioError("", f"this is no JSON: {error}.") from None


def from_yaml(text: str) -> Any:
    """The plain values in a text of YAML 1.2, which may use neither aliases nor tags.

    Raises:
        ScenarioError: it is none, or says a key twice.
    """
    import yaml

    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # NOTE: ten times as fast; only its events are asked for
    try:
        return _Document(yaml.parse(text, Loader=loader)).read()
    except yaml.YAMLError as error:
        raise ScenarioError("", f"this is no YAML: {' '.join(str(error).split())}.") from None


class _Document:
    """Plain values made of the events of YAML, as they come: what is not plain is refused before more is read.

    Args:
        events: of the whole stream.
    """

    def __init__(self, events: Iterator[Any]) -> None:
        self._events = events

    def read(self) -> Any:
        """The value of the only document; None without one."""
        import yaml

        value, documents = None, 0
        for event in self._events:
            if isinstance(event, yaml.DocumentStartEvent):
                documents += 1
                if documents > 1:
                    raise ScenarioError("", f"{_line(event)}: a file holds a single document.")
                value = self._value(next(self._events), "", 1)
        return value

    def _value(self, event: Any, path: str, depth: int) -> Any:
        import yaml

        if depth > _DEEPEST:
            raise ScenarioError("", f"the file is nested more than {_DEEPEST} deep.")
        if isinstance(event, yaml.ScalarEvent):
            return _scalar(event, path)
        if isinstance(event, yaml.AliasEvent):
            raise ScenarioError("", f"{_line(event)}: aliases (*name) are not allowed; write it out.")
        is_map = isinstance(event, yaml.MappingStartEvent)
        if event.tag not in (None, "!", f"{_TAG}{'map' if is_map else 'seq'}"):
            raise ScenarioError(path, f"{_line(event)}: the tag {event.tag!r} is not allowed.")
        return self._mapping(path, depth) if is_map else self._sequence(path, depth)

    def _sequence(self, path: str, depth: int) -> list[Any]:
        import yaml

        found: list[Any] = []
        for event in self._events:
            if isinstance(event, yaml.SequenceEndEvent):
                break
            found.append(self._value(event, joined(path, len(found)), depth + 1))
        return found

    def _mapping(self, path: str, depth: int) -> dict[Any, Any]:
        import yaml

        found: dict[Any, Any] = {}
        for event in self._events:
            if isinstance(event, yaml.MappingEndEvent):
                break
            key = self._value(event, path, depth + 1)
            try:
                checked_key(key)
            except ScenarioError as error:
                raise ScenarioError(path, f"{_line(event)}: {error.message}") from None
            _put(found, key, self._value(next(self._events), joined(path, key), depth + 1), path)
        return found


def _scalar(event: Any, path: str) -> Any:
    """The value of a single word or text."""
    tag = event.tag
    if tag is None and event.implicit[0]:
        word = _WORDS.fullmatch(event.value)
        kind = "str" if word is None else word.lastgroup
    else:
        kind = "str" if tag in (None, "!") else tag.removeprefix(_TAG)
    read_scalar = _SCALARS.get(kind or "")
    if read_scalar is None:
        raise ScenarioError(path, f"{_line(event)}: the tag {tag!r} is not allowed.")
    try:
        return read_scalar(event.value)
    except (ValueError, KeyError) as error:
        raise ScenarioError(path, f"{_line(event)}: {error}.") from None


def _line(event: Any) -> str:
    return f"line {event.start_mark.line + 1}"


def _once(pairs: list[tuple[Any, Any]]) -> dict[Any, Any]:
    """A mapping in which no key is said twice."""
    found: dict[Any, Any] = {}
    for key, value in pairs:
        _put(found, key, value, "")
    return found


def _put(found: dict[Any, Any], key: Any, value: Any, path: str) -> None:
    if key in found:
        values = f"{shown(found[key])} and with {shown(value)}"
        raise ScenarioError(joined(path, key), f"this key is there twice, with {values}.")
    found[key] = value


def _refuse_constant(name: str) -> Any:
    raise ScenarioError("", f"{name} is no number of JSON.")


def _float(text: str) -> float:
    number = float(text.replace(".inf", "inf").replace(".Inf", "inf").replace(".INF", "inf"))
    if math.isinf(number) and "inf" not in text.lower():
        raise ValueError(f"{shown(text)} is too large")
    return number


_SCALARS: dict[str, Any] = {
    "null": lambda _: None,
    "bool": lambda text: {"true": True, "false": False}[text.lower()],
    "int": int,
    "float": _float,
    "str": str,
}
