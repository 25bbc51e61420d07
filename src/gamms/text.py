"""Safe display of untrusted values and texts: bounded in length, and without control characters."""

import ast
import re
from collections.abc import Iterator
from functools import partial
from itertools import takewhile
from reprlib import Repr
from threading import Lock
from types import FunctionType
from typing import Any, TypeVar

T = TypeVar("T")

_LONG = 200  # bits
_PARSING = Lock()  # Python 3.11 raises a SystemError where two threads parse at the same time
_MOST = 1000  # characters of an error message
_CONTROLS = re.compile(  # C0 but the line feed, C1, marks of direction, breaks of lines, tags, halves of pairs
    "[\x00-\x09\x0b-\x1f\x7f-\x9f\u00ad\u061c\u180e\u200b\u200e\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb"
    "\ud800-\udfff\U000e0000-\U000e0fff]"
)
_NOT_IN_XML = "[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]"  # takes a while to compile
_FORMULA = re.compile("'*[=+\\-@\t\r]")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_SECTION = re.compile(r"(Args|Attributes|Returns|Yields|Raises|Requires|Ensures):")
_ENTRY = re.compile(r"    ([\w*]+(?:, [\w*]+)*): +(.*)")  # of a section of a docstring
_ADDRESS = re.compile(r" at 0x[0-9a-fA-F]+")


class _BoundedRepr(Repr):
    """A `Repr` that can format integers with more than 4,300 digits, which Python refuses to convert."""

    def repr_int(self, value: int, level: int) -> str:
        """Return the digits of an integer, or its number of bits if it is too long."""
        if value.bit_length() <= _LONG:
            return super().repr_int(value, level)
        return f"<an integer of {value.bit_length()} bits>"


_bounded = _BoundedRepr()
_bounded.maxstring = 80
_bounded.maxlong = 80
_bounded.maxother = 80


def shown(value: object) -> str:
    """Return the `repr` of a value, shortened for messages; it never raises."""
    return make_printable(_bounded.repr(value)).replace("\n", " ")


def parse_syntax(text: str | bytes, file: str = "<text>", mode: str = "exec") -> Any:
    """Parse Python code with `ast.parse`, in one thread at a time.

    Raises:
        SyntaxError, ValueError, RecursionError, MemoryError: the code is invalid, or too large.
    """
    with _PARSING:
        return ast.parse(text, file, mode)


class NamedCall(partial[Any]):
    """A function returned by a factory; its `repr` is the factory call."""

    call: str

    def __repr__(self) -> str:
        return self.call

    def list_held(self) -> Iterator[object]:
        """Yield the values in the closure, recursively for described functions among these."""
        cells = [cell.cell_contents for cell in getattr(self.func, "__closure__", None) or ()]
        for value in cells:
            for one in value if isinstance(value, (list, tuple)) else (value,):
                yield one
                if isinstance(one, NamedCall):
                    yield from one.list_held()


def as_code(value: object) -> str:
    """Return how a program writes a value: functions have their names, others are shortened as by `shown`."""
    if isinstance(value, NamedCall):
        return value.call
    return value.__name__ if isinstance(value, FunctionType) else shown(value)


def as_text(value: object) -> str:
    """Return the `str` of a plain value, or `shown(value)` if it contains an integer too long to convert."""
    try:
        return str(value)
    except ValueError:
        return shown(value)


def describe_empty_range(text: str, first: int, last: int) -> str:
    """Return the message for a range whose ends are exchanged, such as "5:1"."""
    return f"{shown(text)} is empty; did you mean {last}:{first}?"


def describe_lone_seed(number: int) -> str:
    """Return the message for one integer where seeds are expected."""
    many = max(number, 2)
    return (
        f"{number} could be a seed or a number of games: {number}:{number + 1} is the one game with the seed {number}, "
        f"and 0:{many} are {many:,} games."
    )


def as_digits(number: float) -> str:
    """Format a number with at most six digits; `shown(value)` for integers too large for a float."""
    try:
        return f"{number:g}"
    except OverflowError:
        return shown(number)


def write_repr(value: object) -> str:
    """Return the whole `repr` of a plain value, or a shortened one where Python refuses to write an integer in it."""
    try:
        return repr(value)
    except ValueError:
        return shown(value)


def reason(error: BaseException) -> str:
    """Return the message of an error, shortened for another message; its class name if the message is empty."""
    try:
        text = str(error)
    except ValueError:  # the key of a KeyError may be an integer that is not written out
        text = ""
    return (text if len(text) <= _MOST else f"{text[:_MOST]} …") or type(error).__name__


def make_printable(text: str) -> str:
    r"""Return a text that a terminal can print: control characters but the line feed become escapes such as \u001b."""
    return _CONTROLS.sub(lambda found: _escape_character(found.group()), text)


def find_module(value: object) -> str:
    """Return the name of the module that defines a function or class; it is the same in every process."""
    return find_main_module(str(getattr(value, "__module__", "?")))


def find_main_module(name: str) -> str:
    """Return the name of a module, `__main__` for the program in processes that were spawned, too."""
    return "__main__" if name == "__mp_main__" else name


def remove_addresses(text: str) -> str:
    """Remove memory addresses from a text, so that it is the same in every process."""
    return _ADDRESS.sub("", text)


def as_xml(text: str, *, quote: bool = True) -> str:
    """Escape a text for XML; characters that XML forbids become replacement characters."""
    from html import escape  # which few programs need

    return escape(re.sub(_NOT_IN_XML, "\ufffd", text), quote=quote)


def as_cell(value: T) -> T | str:
    """Format a value as a cell of a CSV file; texts that spreadsheets would take for formulas get a leading `'`.

    Formulas begin with =, +, -, @, a tab or a carriage return. Numbers stay as they are.
    """
    is_formula = isinstance(value, str) and _FORMULA.match(value) and not _NUMBER.fullmatch(value)
    return f"'{value}" if is_formula else value


def parse_cell(text: str) -> str:
    """Return the text that `as_cell` has written."""
    return text[1:] if text.startswith("'") and _FORMULA.match(text) else text


def split_paragraphs(docs: str | None) -> list[str]:
    """Return the paragraphs of a docstring before its first section, each on one line."""
    from inspect import cleandoc  # which few programs need

    parts = (part for part in cleandoc(docs or "").split("\n\n") if part)
    return [" ".join(part.split()) for part in takewhile(lambda part: not _SECTION.match(part), parts)]


def find_summary(docs: str | None) -> str:
    """Return the first paragraph of a docstring on one line; "" without a docstring."""
    return " ".join(split_paragraphs(docs)[:1])


def parse_entries(docs: str | None) -> dict[str, str]:
    """Return the entries of the sections Args and Attributes of a docstring: name -> text on one line."""
    from inspect import cleandoc

    found: dict[str, str] = {}
    names: list[str] = []
    is_inside = False
    for line in cleandoc(docs or "").splitlines():
        if line and not line.startswith(" "):
            is_inside = line in ("Args:", "Attributes:")
        elif is_inside and (entry := _ENTRY.fullmatch(line)):
            names = entry[1].split(", ")
            found.update(dict.fromkeys(names, entry[2]))
        elif is_inside and line:
            found.update({name: f"{found[name]} {line.strip()}" for name in names})
    return found


def make_printable_line(text: str) -> str:
    r"""Return a text as `make_printable` does, and on one line: line feeds become \n."""
    return make_printable(text).replace("\n", "\\n")


def _escape_character(character: str) -> str:
    code = ord(character)
    return f"\\u{code:04x}" if code < 1 << 16 else f"\\U{code:08x}"
