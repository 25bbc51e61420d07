"""Changes of a scenario file that leave its comments and its form as they are.

Each change is made where the value stands in the text. What comes out is read again, and must be the values that were
meant; then the whole scenario is checked, before the file is replaced in one step.
"""

import json
import re
from collections.abc import Callable, Sequence
from difflib import unified_diff
from pathlib import Path
from typing import Any, NamedTuple

from gamms.errors import WriteConflict
from gamms.folders import write_whole
from gamms.plain import Plain
from gamms.scenario import documents
from gamms.scenario.documents import ScenarioError
from gamms.scenario.scenario import Scenario

_Node = Any  # of YAML, as `documents.nodes_of` gives it

_PLAIN = re.compile(r"[A-Za-z_][\w-]*", re.ASCII)
_WORDS = {"true", "false", "null", "yes", "no", "on", "off", "y", "n"}  # what some readers of YAML take for values
_CONTROL = re.compile("[\x7f-\xa0\u2028\u2029\ufeff\ud800-\udfff]")


class Change(NamedTuple):
    """What a value of a scenario is to be.

    Attributes:
        keys: where it is; the last one may be new.
        value: what it becomes.
        is_more: whether `value` is a list of items that are put behind those that are there.
    """

    keys: tuple[str | int, ...]
    value: Plain
    is_more: bool = False


class Edit(NamedTuple):
    """A scenario file with other values, not yet written.

    Attributes:
        game: the scenario that it then is, which was checked.
        file: the file.
        before: what was in it.
        after: what will be in it.
    """

    game: Scenario
    file: Path
    before: str
    after: str

    @property
    def diff(self) -> str:
        """The lines that are different, as `diff -u` prints them."""
        names = (str(self.file.name), f"{self.file.name} (changed)")
        return "".join(
            unified_diff(self.before.splitlines(keepends=True), self.after.splitlines(keepends=True), *names)
        )

    def write(self) -> None:
        """Replace the file in one step.

        Raises:
            WriteConflict: it has been changed since it was read, or is a link.
            OSError: it cannot be written; nothing has changed then.
        """
        if self.file.is_symlink():
            raise WriteConflict(f"{self.file} is a link, which is not written through. Edit {self.file.resolve()}.")
        if documents.text_of(self.file) != self.before:
            raise WriteConflict(f"{self.file} was changed by another program since it was read. Load it again.")
        write_whole(self.file, self.after.encode())


def edited(file: Path, changes: Sequence[Change], known: Scenario) -> Edit:
    """Return a scenario file with other values.

    Args:
        file: as it is now.
        changes: are made one after the other.
        known: the scenario of the file, perhaps of an earlier state; its map is used again, unless that is another one.

    Raises:
        ScenarioError: a value cannot be there, or the text cannot be changed without changing something else.
        OSError: the file cannot be read.
    """
    before = documents.text_of(file)
    is_json = file.suffix.lower() == ".json"
    read = documents.from_json if is_json else documents.from_yaml
    after, values = before, read(before)
    for change in changes:
        values = _changed(values, change.keys, change)  # refuses what is not there
        after = _with_change(after, change, is_json=is_json)
    if _read_again(read, after) != values:
        raise ScenarioError("", f"{file.name} is written so that this change cannot be made in it: make it by hand.")
    game = known.replace(**{str(key): values[key] for key in values if values[key] != known.to_dict().get(key)})
    game.check()
    return Edit(game, file, before, after)


def _read_again(read: Callable[[str], Plain], text: str) -> Plain:
    try:
        return read(text)
    except ScenarioError:
        return None


def _changed(values: Plain, keys: tuple[str | int, ...], change: Change) -> Plain:
    """Copy plain values with a change."""
    if not keys:
        return [*(values or []), *change.value] if change.is_more else change.value
    key, *rest = keys
    if isinstance(values, list) and isinstance(key, int) and 0 <= key < len(values):
        return [_changed(one, tuple(rest), change) if i == key else one for i, one in enumerate(values)]
    if not isinstance(values, dict) or (key not in values and rest):
        raise ScenarioError(".".join(map(str, change.keys)), "there is nothing to change.")
    return {**values, key: _changed(values.get(key), tuple(rest), change)}


def _with_change(text: str, change: Change, *, is_json: bool) -> str:
    """Return a text with a change."""
    here = documents.nodes_of(text)
    above, behind_key = here, 0
    for key in change.keys:
        above = here
        here, behind_key = _part(text, here, key)
    if here is None:
        return _with_key(text, above, f"{_scalar(str(change.keys[-1]), is_json)}: {_flow(change.value, is_json)}")
    if change.is_more and here.id == "sequence":
        return _with_items(text, here, [_flow(one, is_json) for one in change.value])
    start, space = (here.start_mark.index, "") if _is_inline(here) else (behind_key, " ")
    return f"{text[:start]}{space}{_flow(change.value, is_json)}{text[_end_of(here) :]}"


def _part(text: str, node: _Node, key: str | int) -> tuple[_Node, int]:
    """Return what a key or number leads to, if it is there, and where that may begin."""
    if node is None or node.id == "scalar":
        return None, 0
    if node.id == "sequence":
        return node.value[key], node.value[key].start_mark.index
    for name, value in node.value:
        if name.value == str(key):
            return value, text.index(":", name.end_mark.index) + 1
    return None, 0


def _is_inline(node: _Node) -> bool:
    """Whether a value is a scalar, or in brackets."""
    return node.id == "scalar" or bool(node.flow_style)


def _end_of(node: _Node) -> int:
    """Return where a value ends; of what is in blocks, its last part."""
    if _is_inline(node) or not node.value:
        return int(node.end_mark.index)
    last = node.value[-1]
    return _end_of(last[1] if node.id == "mapping" else last)


def _with_key(text: str, mapping: _Node, entry: str) -> str:
    """Return a text in which a mapping has one more key."""
    if _is_inline(mapping):
        return _before_bracket(text, mapping, entry)
    end = _end_of_line(text, _end_of(mapping))
    return f"{text[:end]}{_newline(text)}{' ' * mapping.start_mark.column}{entry}{text[end:]}"


def _with_items(text: str, items: _Node, more: list[str]) -> str:
    """Return a text in which a list has more items."""
    if _is_inline(items):
        return _before_bracket(text, items, ", ".join(more))
    end, margin = _end_of_line(text, _end_of(items)), f"{_newline(text)}{' ' * items.start_mark.column}- "
    return text[:end] + "".join(f"{margin}{one}" for one in more) + text[end:]


def _before_bracket(text: str, node: _Node, entry: str) -> str:
    end = node.end_mark.index - 1
    while text[end - 1].isspace():
        end -= 1
    comma = "" if not node.value else " " if text[end - 1] == "," else ", "
    return f"{text[:end]}{comma}{entry}{text[end:]}"


def _end_of_line(text: str, at: int) -> int:
    """Return where the line ends that a value ends in, behind what is said of it."""
    at = len(text[:at].rstrip())
    end = text.find("\n", at)
    end = len(text) if end < 0 else end
    return end - 1 if text[end - 1 : end] == "\r" else end


def _newline(text: str) -> str:
    return "\r\n" if "\r\n" in text else "\n"


def _flow(value: Plain, is_json: bool) -> str:
    """Return a value in one line."""
    if isinstance(value, list):
        return f"[{', '.join(_flow(one, is_json) for one in value)}]"
    if isinstance(value, dict):
        pairs = (f"{_scalar(str(key), is_json)}: {_flow(one, is_json)}" for key, one in value.items())
        return f"{{{', '.join(pairs)}}}"
    return _scalar(value, is_json) if isinstance(value, str) else json.dumps(value)


def _scalar(text: str, is_json: bool) -> str:
    if not is_json and _PLAIN.fullmatch(text) and text.lower() not in _WORDS:
        return text
    quoted = json.dumps(text, ensure_ascii=False)
    return _CONTROL.sub(lambda found: f"\\u{ord(found[0]):04x}", quoted)
