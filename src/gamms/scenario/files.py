"""Scenario files in, plain values out; the one door to YAML. Reading never runs code, and is bounded."""

import json
import math
import re
from pathlib import Path
from typing import Any

from gamms.scenario.errors import ScenarioError, joined, shown

MOST_BYTES = 1_000_000
_DEEPEST = 40
_SUFFIXES = (".yaml", ".yml", ".json")

# What a plain word of YAML 1.2 means. YAML 1.1, which PyYAML reads otherwise, makes booleans of `on` and `no`.
_WORDS = {
    "tag:yaml.org,2002:null": (r"~|null|Null|NULL|", "~nN\0"),
    "tag:yaml.org,2002:bool": (r"true|True|TRUE|false|False|FALSE", "tTfF"),
    "tag:yaml.org,2002:int": (r"[-+]?[0-9]+", "-+0123456789"),
    "tag:yaml.org,2002:float": (
        r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?|[-+]?\.(?:inf|Inf|INF)",
        "-+0123456789.",
    ),
}


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
        return json.loads(text, object_pairs_hook=_once, parse_constant=_refuse_constant)
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

    try:
        node = _composed(text)
        return _value(node)
    except yaml.YAMLError as error:
        raise ScenarioError("", f"this is no YAML: {' '.join(str(error).split())}.") from None


def _composed(text: str) -> Any:
    """The nodes of the text, each with its place."""
    import yaml

    class Loader(yaml.SafeLoader):
        """Composes only what is plain; nothing is ever constructed."""

        depth = 0

        def compose_node(self, parent: Any, index: Any) -> Any:
            if self.check_event(yaml.AliasEvent):
                line = self.line + 1
                raise ScenarioError("", f"line {line}: aliases (*name) are not allowed; write it out.")
            self.depth += 1
            if self.depth > _DEEPEST:
                raise ScenarioError("", f"the file is nested more than {_DEEPEST} deep.")
            node = super().compose_node(parent, index)
            self.depth -= 1
            return node

    Loader.yaml_implicit_resolvers = {}
    for tag, (words, first) in _WORDS.items():
        Loader.add_implicit_resolver(tag, re.compile(f"^(?:{words})$"), ["" if one == "\0" else one for one in first])
    loader = Loader(text)
    try:
        return loader.get_single_node()
    finally:
        loader.dispose()


def _value(node: Any, path: str = "") -> Any:
    """The plain value of a node, and of those in it."""
    if node is None:
        return None
    kind = node.tag.removeprefix("tag:yaml.org,2002:")
    if node.id == "mapping" and kind == "map":
        keys = [_key(key) for key, _ in node.value]
        return _once(
            [(key, _value(value, joined(path, key))) for key, (_, value) in zip(keys, node.value, strict=True)], path
        )
    if node.id == "sequence" and kind == "seq":
        return [_value(one, joined(path, number)) for number, one in enumerate(node.value)]
    read_scalar = _SCALARS.get(kind) if node.id == "scalar" else None
    if read_scalar is None:
        raise ScenarioError(path, f"line {node.start_mark.line + 1}: the tag {node.tag!r} is not allowed.")
    try:
        return read_scalar(node.value)
    except (ValueError, KeyError) as error:
        raise ScenarioError(path, f"line {node.start_mark.line + 1}: {error}.") from None


def _key(node: Any) -> Any:
    key = _value(node)
    if isinstance(key, bool) or not isinstance(key, (str, int)):
        line = node.start_mark.line + 1
        raise ScenarioError("", f"line {line}: a key must be a text or an integer, not {key!r}. Put quotes around it.")
    return key


def _once(pairs: list[tuple[Any, Any]], path: str = "") -> dict[Any, Any]:
    """A mapping in which no key is said twice."""
    found: dict[Any, Any] = {}
    for key, value in pairs:
        if key in found:
            values = f"{shown(found[key])} and with {shown(value)}"
            raise ScenarioError(joined(path, key), f"this key is there twice, with {values}.")
        found[key] = value
    return found


def _refuse_constant(name: str) -> Any:
    raise ScenarioError("", f"{name} is no number of JSON.")


def _float(text: str) -> float:
    number = float(text.replace(".inf", "inf").replace(".Inf", "inf").replace(".INF", "inf"))
    if math.isinf(number) and "inf" not in text.lower():
        raise ValueError(f"{text} is too large")
    return number


_SCALARS: dict[str, Any] = {
    "null": lambda _: None,
    "bool": lambda text: {"true": True, "false": False}[text.lower()],
    "int": int,
    "float": _float,
    "str": str,
}
