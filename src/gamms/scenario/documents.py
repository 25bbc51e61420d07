"""Scenario files as plain values: reading, dotted paths, changes by path, and errors that name a path.

The only module that knows YAML. Reading never runs code, and is bounded.
"""

import json
import math
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from enum import Enum
from functools import reduce
from pathlib import Path, PurePath
from types import ModuleType
from typing import TYPE_CHECKING, NoReturn

from gamms.errors import GammsError, MissingFile, nearest
from gamms.plain import Plain
from gamms.text import make_printable, shown

if TYPE_CHECKING:
    import yaml

_LONGEST = 500  # letters of a path


class ScenarioError(GammsError, ValueError):
    """A scenario that cannot be played as it is written.

    Attributes:
        path: the place in the scenario, such as `teams.red.count` or `rules.0`; "" for the whole.
        place: the path in words, with items counted from 1.
        file: the file of the scenario, or None.
    """

    def __init__(self, path: str, message: str, file: object = None, place: str | None = None) -> None:
        self.path = path
        self.message = message
        self.file = None if file is None else str(file)
        self.place = path if place is None else place
        super().__init__(make_printable(": ".join(part for part in (self.file, self.place, message) if part)))

    def within(self, file: object, raw: Plain) -> "ScenarioError":
        """Return the error with its file, and its place in words."""
        place = describe_path(self.path, raw) if self.place == self.path else self.place
        return ScenarioError(self.path, self.message, self.file or file, place)


def join_path(path: str, key: object) -> str:
    """Return the path of a key below a path, cut if it is long."""
    text = f"{path}.{key}" if path else str(key)
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}…"


@contextmanager
def locate_errors(path: str) -> Iterator[None]:
    """Turn errors in the block into a `ScenarioError` at a path.

    Raises:
        ScenarioError: replaces any error of GAMMS or of reading a file.
    """
    try:
        yield
    except ScenarioError:
        raise
    except (GammsError, OSError) as error:
        raise ScenarioError(path, str(error)) from error


@contextmanager
def name_errors(file: object, raw: Plain = None) -> Iterator[None]:
    """Add the file, or None, and the place in words to errors in the block.

    Raises:
        ScenarioError: the error of the block, with the file and the place added.
    """
    try:
        yield
    except ScenarioError as error:
        raise error.within(file, raw) from error.__cause__


@contextmanager
def add_map_number(number: int | None) -> Iterator[None]:
    """Add the number of the map to errors in the block; None: there is only one map.

    Raises:
        ScenarioError: the error of the block, with `maps[number]` in its path or its message.
    """
    try:
        yield
    except ScenarioError as error:
        if number is None:
            raise
        name = f"maps[{number}]"
        key, _, rest = error.path.partition(".")
        if key == "map":
            place = error.place.removeprefix("map")
            raise ScenarioError(
                join_path(name, rest) if rest else name, error.message, error.file, name + place
            ) from None
        message = f"on {name}, {error.message}"
        raise ScenarioError(error.path, message, error.file, error.place) from error.__cause__


def describe_path(path: str, raw: Plain) -> str:
    """Return a path with list items counted from 1: `item 3 of rules (tag), with.hops`."""
    words = ""
    here = raw
    for part in path.split("."):
        if isinstance(here, list) and part.isdecimal() and int(part) < len(here):
            label = _list_parts(here)[int(part)]
            here = here[int(part)]
            words = f"item {int(part) + 1} of {words}{f' ({label})' if label else ''}, "
        else:
            key = None if isinstance(here, list) else _follow_part(here, part)
            here = None if key is None else here[key]
            words = f"{words}{'.' if words and not words.endswith(', ') else ''}{part}"
    return words.removesuffix(", ")


# -- plain values ----------------------------------------------------------------------------------------------------


_DEEPEST = 40
_INT64 = 1 << 63


def copy_plain(value: Plain, path: str = "", depth: int = 0) -> Plain:
    """Return a copy of dicts, lists and scalars, as a file could hold.

    Raises:
        ScenarioError: a part is not a plain value, is NaN, or is nested too deeply.
    """
    if depth > _DEEPEST:
        raise ScenarioError(path, f"this is nested more than {_DEEPEST} deep.")
    if isinstance(value, Mapping):
        return {check_key(key, path): copy_plain(one, join_path(path, key), depth + 1) for key, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [copy_plain(one, join_path(path, number), depth + 1) for number, one in enumerate(value)]
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, PurePath):
        return value.as_posix()
    if hasattr(value, "item") and getattr(value, "ndim", None) == 0:  # a scalar of NumPy
        value = value.item()
    if isinstance(value, float) and math.isnan(value):
        raise ScenarioError(path, "cannot be NaN, which is not a number.")
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    raise ScenarioError(
        path,
        f"{shown(value)} is not a plain value; a scenario holds only values that a file could hold."
        f"{_explain_object(value)}",
    )


def _explain_object(value: object) -> str:
    """Return the way out for a function, class, rule or module: its name as text."""
    name = getattr(value, "__qualname__", "decide")  # a module has none
    module = str(getattr(value, "__module__", None) or getattr(value, "__name__", ""))
    if not callable(value) and not isinstance(value, ModuleType):
        return ""
    if module.startswith("gamms."):
        return " Write its name, such as 'gamms.strategies:chase' for a strategy, or 'tag' for a rule."
    if module == "__main__" or not name.isidentifier():  # no scenario imports the program, or a function of a function
        return " Move it to a file, such as strategies.py, and write 'strategies:decide' here, with folder='.'."
    return f" Write its name, '{module}:{name}', with the folder of its file as folder=."


def check_key(key: object, path: str = "") -> str | int:
    """Check a key of a mapping: a text, or an integer of 64 bits, because longer ones could be made to share one hash.

    Raises:
        ScenarioError: the key is something else.
    """
    if isinstance(key, bool) or not isinstance(key, (str, int)):
        raise ScenarioError(path, f"a key must be a text or an integer, not {shown(key)}. Put quotes around it.")
    if isinstance(key, int) and not -_INT64 <= key < _INT64:
        raise ScenarioError(path, f"a key that is an integer must fit into 64 bits, not {shown(key)}.")
    return key


def rename_keys(value: Plain, keys: tuple[Plain, ...] = ()) -> Plain:
    """Return the values of a scenario with the current names of its keys; `keys` lead to the value.

    Raises:
        ScenarioError: an old name and its current name are both given.
    """
    if isinstance(value, list):
        return [rename_keys(one, (*keys, number)) for number, one in enumerate(value)]
    if not isinstance(value, dict) or (keys and keys[0] not in ("map", "sensors", "teams")):
        return value
    current = {}
    for key, one in value.items():
        name = _find_current_key(keys, key)
        if name != key and name in value:
            path = reduce(join_path, (*keys, key), "")
            raise ScenarioError(path, f"is the old name of {name}, which is given, too.")
        current[name] = rename_keys(one, (*keys, key))
    return current


def _find_current_key(keys: tuple[Plain, ...], key: Plain) -> Plain:
    """Return the current name of a key, below the keys that lead to its mapping."""
    match keys:
        case ("map", "grid"):
            names = {"width": "columns", "height": "rows"}
        case ("sensors", _) | ("teams", _, "sensors", _) | ("teams", _, "agents", _, "sensors", _):
            names = {"sensor_range": "range_m"}
        case _:
            return key
    return names.get(key, key)


def apply_changes(raw: dict[str, Plain], changes: Mapping[str, Plain]) -> dict[str, Plain]:
    """Copy a mapping, with current names of keys, and with another value at each dotted path.

    A part of a path is a key, or of a list item the index, the name, or the name of its function, if no other item has
    it: `toll` for the rule `referee:toll`. The last key may be new, and so may the first, such as settings.

    Raises:
        ScenarioError: a path does not exist.
    """
    new: dict[str, Plain] = rename_keys(copy_plain(raw))
    for path, value in changes.items():
        here: Plain = new
        *above, last = path.split(".")
        parts = [*above, _find_current_key((*above,), last)]
        for number, part in enumerate(parts):
            is_last = number + 1 == len(parts)
            key = _follow_part(here, part)
            if key is None:
                if not (isinstance(here, dict) and (is_last or number == 0)):
                    known = ", ".join(map(repr, _list_parts(here)[:_MOST_NAMED]))
                    hint = nearest(part, _list_parts(here)) or (f" There are: {known}." if known else "")
                    raise ScenarioError(".".join(parts[: number + 1]), f"there is no {part!r} to change.{hint}")
                here[part] = None
                key = part
            if is_last:
                here[key] = copy_plain(value, path)
            elif here[key] is None:
                here[key] = {}
            here = here[key]
    return new


def list_differences(first: Plain, second: Plain, path: str = "") -> Iterator[str]:
    """Yield a line for each place where two plain values differ.

    Names and mappings in lists are compared by their labels, such as the names of agents and rules, if both lists have
    unique ones; all other items by their numbers.
    """
    with_labels = _has_labels(first) and _has_labels(second)
    one = _label_items(first, with_labels=with_labels)
    other = _label_items(second, with_labels=with_labels)
    if one is None or other is None or type(first) is not type(second):
        if first != second or isinstance(first, bool) != isinstance(second, bool):
            yield f"{path}: {_write_value(first)}, and {_write_value(second)}"
        return
    for key in dict.fromkeys([*one, *other]):
        place = join_path(path, key)
        if key not in other:
            yield f"{place}: {_write_value(one[key])}, and not there"
        elif key not in one:
            yield f"{place}: not there, and {_write_value(other[key])}"
        else:
            yield from list_differences(one[key], other[key], place)
    orders = [[str(key) for key in keys if key in one and key in other] for keys in (one, other)]
    if isinstance(first, list) and orders[0] != orders[1]:
        yield f"{path}: in the order {', '.join(orders[0])}, and {', '.join(orders[1])}"


def _has_labels(value: Plain) -> bool:
    """Return whether the items of a list are different names, or mappings with different names."""
    if not isinstance(value, list) or not all(isinstance(item, dict | str) for item in value):
        return False
    labels = _list_parts(value)
    return all(labels) and len(set(labels)) == len(labels)


def _label_items(value: Plain, *, with_labels: bool) -> dict[Plain, Plain] | None:
    """Return the items of a mapping or list by their keys, labels or numbers; None for another value."""
    if isinstance(value, dict):
        return value
    if not isinstance(value, list):
        return None
    keys: list[Plain] = [*_list_parts(value)] if with_labels else [*range(len(value))]
    return dict(zip(keys, value, strict=True))


def _write_value(value: Plain) -> str:
    text = json.dumps(value, ensure_ascii=False)
    return make_printable(text if len(text) <= _LONGEST else f"{text[:_LONGEST]}… ({len(text):,} characters)")


def _follow_part(here: Plain, part: str) -> Plain:
    """Return the key or index that a part of a path means; None if it does not exist."""
    if isinstance(here, dict):
        return next((key for key in here if str(key) == part), None)
    if isinstance(here, list):
        names = [str(number) for number in range(len(here))]
        for labels in (names, _list_parts(here)):
            if part in labels:
                return labels.index(part)
        return _find_function(here, part)
    return None


def _find_function(here: list[Plain], name: str) -> int | None:
    """Return the index of the only list item whose code, such as `referee:toll`, is a function of this name."""
    found = [index for index, label in enumerate(_list_parts(here)) if label.rpartition(":")[2] == name]
    return found[0] if len(found) == 1 else None


_MOST_NAMED = 8  # keys in an error


def _list_parts(here: Plain) -> list[str]:
    """Return the names that can follow in a path."""
    if isinstance(here, dict):
        return [str(key) for key in here]
    if isinstance(here, list):
        return [_find_label(one) for one in here]
    return []


def _find_label(item: Plain) -> str:
    """Return the name of an item of a list, or its rule; "" if it has neither."""
    if not isinstance(item, dict):
        return str(item)
    name = item.get("name")
    return str(item.get("rule", "") if name is None else name)


# -- files -----------------------------------------------------------------------------------------------------------


MOST_BYTES = 1_000_000
_SUFFIXES = (".yaml", ".yml", ".json")

# Types of plain words in YAML 1.2. YAML 1.1, which PyYAML reads otherwise, makes booleans of `on` and `no`.
_WORDS = re.compile(
    r"(?P<null>~|null|Null|NULL|)"
    r"|(?P<bool>true|True|TRUE|false|False|FALSE)"
    r"|(?P<int>[-+]?[0-9]+)"
    r"|(?P<float>[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?|[-+]?\.(?:inf|Inf|INF))"
)
_TAG = "tag:yaml.org,2002:"
_MOST_VALUES = 500_000  # as many as a file without aliases can hold


def read(file: Path) -> Plain:
    """Read the plain values in a scenario file.

    Raises:
        ScenarioError: the file is too large, not a text, not YAML or JSON, or repeats a key.
        OSError: the file cannot be read.
    """
    text = read_text(file)
    return parse_json(text) if file.suffix.lower() == ".json" else parse_yaml(text)


def read_text(file: Path) -> str:
    """Return the text of a scenario file.

    Raises:
        ScenarioError: the file is too large, or not a text.
        OSError: the file cannot be read.
    """
    if file.is_dir():
        held = sorted(one.name for one in file.iterdir() if one.suffix.lower() in (".yaml", ".yml"))
        hint = f": give the file in it, {held[0]!r}." if held else ", and none is in it."
        raise ScenarioError("", f"this is a folder, not a scenario file{hint}")
    if file.suffix.lower() not in _SUFFIXES:
        hint = " `gamms replay` shows recordings." if file.suffix == ".ggr" else ""
        raise ScenarioError("", f"a scenario file ends in {', '.join(_SUFFIXES)}, not {file.suffix!r}.{hint}")
    if not file.exists():
        raise MissingFile("a scenario", file)
    if not file.is_file():
        raise ScenarioError("", "this is a pipe, socket or device, not a scenario file.")
    with file.open("rb") as stream:
        data = stream.read(MOST_BYTES + 1)
    if len(data) > MOST_BYTES:
        raise ScenarioError("", f"the file has more than {MOST_BYTES:,} bytes. Put maps and tables into other files.")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ScenarioError("", f"the file is not UTF-8 text: {error}.") from None


def parse_json(text: str) -> Plain:
    """Return the plain values in a text of JSON.

    Raises:
        ScenarioError: the text is not JSON, or repeats a key.
    """
    try:
        return json.loads(
            text, object_pairs_hook=_check_unique, parse_constant=_refuse_constant, parse_float=_parse_float
        )
    except (ValueError, RecursionError) as error:
        if isinstance(error, ScenarioError):
            raise
        raise ScenarioError("", f"this is not JSON: {error}.") from None


def parse_yaml(text: str) -> Plain:
    """Return the plain values in a text of YAML 1.2 without tags and with a bounded number of aliases.

    Raises:
        ScenarioError: the text is not YAML, or repeats a key.
    """
    import yaml

    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # NOTE: ten times as fast; only its events are used
    value = None
    documents = 0
    try:
        for event in (events := yaml.parse(text, Loader=loader)):
            if isinstance(event, yaml.DocumentStartEvent):
                documents += 1
                if documents > 1:
                    raise ScenarioError("", f"{_describe_line(event)}: a file holds a single document.")
                value = _YamlComposer(events).compose_value(next(events), "", 1)
    except yaml.YAMLError as error:
        raise ScenarioError("", f"this is not YAML: {_describe_flaw(error, text)}") from None
    return value


def _describe_flaw(error: "yaml.YAMLError", text: str) -> str:
    """Return where and why a text is not YAML."""
    mark = getattr(error, "problem_mark", None)
    if mark is None:
        return f"{' '.join(str(error).split())}."
    lines = text.splitlines()
    for number in (mark.line, mark.line - 1):
        line = lines[number] if 0 <= number < len(lines) else ""
        if "\t" in line[: len(line) - len(line.lstrip())]:
            return f"line {number + 1} begins with a tab. YAML is indented by spaces: put spaces in its place."
    problem = str(getattr(error, "problem", error))
    flaw = next((words for words in _FLAWS if words in problem), "")
    hint = _explain_missing_colon(lines[: mark.line]) if flaw in _FLAWS_OF_KEYS else ""
    hint = hint or _FLAWS.get(flaw, "")
    shown_line = f" in {shown(lines[mark.line].strip())}" if mark.line < len(lines) else ""
    return f"line {mark.line + 1}, column {mark.column + 1}: {problem}{shown_line}.{hint}"


_SAME_COLUMN = " Put all keys of a mapping into the same column; a list has items with '- ' only."
_FLAWS_OF_KEYS = {  # words in the message of a YAML parser -> the way out
    "mapping values": " Put quotes around a text with a colon in it.",
    "expected key": _SAME_COLUMN,
    "<block end>": _SAME_COLUMN,
    "expected ':'": " Put a colon and a space after each key.",
}
_FLAWS = {
    **_FLAWS_OF_KEYS,
    "'-' indicator": _SAME_COLUMN,
    "',' or": " Close each bracket, and put a comma between items.",
}


def _explain_missing_colon(lines: list[str]) -> str:
    """Return a hint at the last line above a flaw if it has a key without a colon and a space; else ""."""
    written = [(number, line.partition(" #")[0].strip()) for number, line in enumerate(lines, 1)]
    number, line = next((one for one in reversed(written) if one[1] and one[1][0] not in "#-[{"), (0, ":"))
    is_complete = ": " in line or line.endswith((":", ",", "]", "}"))
    return "" if is_complete else f" Put a colon and a space after the key in line {number}, {line!r}."


class _YamlComposer:
    """Makes plain values from the events of a YAML parser; refuses other values at once.

    Aliases (`*name`) repeat the value that an earlier anchor (`&name`) has named. Every value counts, in aliases as
    often as it appears.
    """

    def __init__(self, events: "Iterator[yaml.Event]") -> None:
        self._events = events
        self._made = 0
        self._anchored: dict[str, tuple[Plain, int]] = {}  # each with its number of values

    def compose_value(self, event: "yaml.Event", path: str, depth: int) -> Plain:
        """Return the value that starts with an event."""
        import yaml

        if depth > _DEEPEST:
            raise ScenarioError("", f"the file is nested more than {_DEEPEST} deep.")
        before = self._made
        if isinstance(event, yaml.AliasEvent):
            value, size = self._compose_alias(event)
            self._made += size
        else:
            self._made += 1
            value = (
                _convert_scalar(event, path)
                if isinstance(event, yaml.ScalarEvent)
                else self._compose_collection(event, path, depth)
            )
            if getattr(event, "anchor", None):
                self._anchored[event.anchor] = value, self._made - before  # type: ignore[attr-defined] # asked for above
        if self._made > _MOST_VALUES:
            raise ScenarioError(
                "", f"{_describe_line(event)}: with its aliases the file has over {_MOST_VALUES:,} values."
            )
        return value

    def _compose_alias(self, event: "yaml.AliasEvent") -> tuple[Plain, int]:
        name = event.anchor
        if name not in self._anchored:
            hint = nearest(name, self._anchored)
            raise ScenarioError(
                "", f"{_describe_line(event)}: there is no anchor &{name} before the alias *{name}.{hint}"
            )
        return self._anchored[name]

    def _compose_collection(self, event: "yaml.Event", path: str, depth: int) -> Plain:
        """Return a mapping or a list."""
        import yaml

        is_map = isinstance(event, yaml.MappingStartEvent)
        tag = getattr(event, "tag", None)
        if tag not in (None, "!", f"{_TAG}{'map' if is_map else 'seq'}"):
            raise ScenarioError(path, f"{_describe_line(event)}: the tag {tag!r} is not allowed.")
        items: list[Plain] = []
        found: dict[str | int, Plain] = {}
        ends = (yaml.MappingEndEvent, yaml.SequenceEndEvent)
        while not isinstance(event := next(self._events), ends):
            if is_map:
                key = _check_event_key(self.compose_value(event, path, depth + 1), event, path)
                if key == "<<":
                    raise ScenarioError(path, f"{_describe_line(event)}: << is not read: give an alias for each value.")
                _add_once(found, key, self.compose_value(next(self._events), join_path(path, key), depth + 1), path)
            else:
                items.append(self.compose_value(event, join_path(path, len(items)), depth + 1))
        return found if is_map else items


def _check_event_key(key: Plain, event: "yaml.Event", path: str) -> str | int:
    try:
        return check_key(key)
    except ScenarioError as error:
        raise ScenarioError(path, f"{_describe_line(event)}: {error.message}") from None


def _convert_scalar(event: "yaml.ScalarEvent", path: str) -> Plain:
    """Return the value of a single word or text."""
    tag = event.tag
    if tag is None and event.implicit[0]:
        word = _WORDS.fullmatch(event.value)
        kind = "str" if word is None else word.lastgroup
    else:
        kind = "str" if tag in (None, "!") else tag.removeprefix(_TAG)
    read_scalar = _SCALARS.get(kind or "")
    if read_scalar is None:
        raise ScenarioError(path, f"{_describe_line(event)}: the tag {tag!r} is not allowed.")
    try:
        return read_scalar(event.value)
    except (ValueError, KeyError) as error:
        raise ScenarioError(path, f"{_describe_line(event)}: {error}.") from None


def _describe_line(event: "yaml.Event") -> str:
    return f"line {event.start_mark.line + 1 if event.start_mark else 0}"


def _check_unique(pairs: list[tuple[str, Plain]]) -> dict[str | int, Plain]:
    """Return a mapping from pairs; refuse a repeated key."""
    found: dict[str | int, Plain] = {}
    for key, value in pairs:
        _add_once(found, key, value, "")
    return found


def _add_once(found: dict[str | int, Plain], key: str | int, value: Plain, path: str) -> None:
    if key in found:
        values = f"{shown(found[key])} and with {shown(value)}"
        raise ScenarioError(join_path(path, key), f"this key is there twice, with {values}.")
    found[key] = value


def _refuse_constant(name: str) -> NoReturn:
    raise ScenarioError("", f"{name} is not a number in JSON.")


def _parse_float(text: str) -> float:
    number = float(text.replace(".inf", "inf").replace(".Inf", "inf").replace(".INF", "inf"))
    if math.isinf(number) and "inf" not in text.lower():
        raise ValueError(f"{shown(text)} is too large")
    return number


_SCALARS: dict[str, Callable[[str], Plain]] = {
    "null": lambda _: None,
    "bool": lambda text: {"true": True, "false": False}[text.lower()],
    "int": int,
    "float": _parse_float,
    "str": str,
}
