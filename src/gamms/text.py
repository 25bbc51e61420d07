"""Values and texts of any origin in a form that is safe to read: bounded, and without control characters."""

import ast
import re
from collections.abc import Iterator
from functools import partial
from reprlib import Repr
from threading import Lock
from types import FunctionType
from typing import Any, TypeVar

T = TypeVar("T")

_LONG = 200  # bits
_PARSING = Lock()  # Python 3.11 raises a SystemError where two threads parse at the same time
_MOST = 1000  # characters of what an error says
_CONTROLS = re.compile(  # C0 but the line feed, C1, marks of direction, breaks of lines, tags, halves of pairs
    "[\x00-\x09\x0b-\x1f\x7f-\x9f\u00ad\u061c\u180e\u200b\u200e\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb"
    "\ud800-\udfff\U000e0000-\U000e0fff]"
)
_NOT_IN_XML = "[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]"  # takes a while to compile
_FORMULA = re.compile("'*[=+\\-@\t\r]")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_ADDRESS = re.compile(r" at 0x[0-9a-fA-F]+")


class _Bounded(Repr):
    """Knows integers that Python refuses to write out, which have more than 4,300 digits."""

    def repr_int(self, value: int, level: int) -> str:
        """An integer, or how long it is."""
        if value.bit_length() <= _LONG:
            return super().repr_int(value, level)
        return f"<an integer of {value.bit_length()} bits>"


_bounded = _Bounded()
_bounded.maxstring = _bounded.maxlong = _bounded.maxother = 80


def shown(value: object) -> str:
    """Return the `repr` of a value, shortened to what a message can hold; it never raises."""
    return printable(_bounded.repr(value)).replace("\n", " ")


def syntax_tree(text: str | bytes, file: str = "<text>", mode: str = "exec") -> Any:
    """Return what `ast.parse` makes of Python, in one thread at a time.

    Raises:
        SyntaxError, ValueError, RecursionError, MemoryError: it is not Python, or too much of it.
    """
    with _PARSING:
        return ast.parse(text, file, mode)


class DescribedFunction(partial[Any]):
    """A function that another one has made; it prints as the call that made it."""

    call: str

    def __repr__(self) -> str:
        return self.call

    def held(self) -> Iterator[object]:
        """Yield what the function closes over, and what functions among that, which were made likewise, do."""
        cells = [cell.cell_contents for cell in getattr(self.func, "__closure__", None) or ()]
        for value in cells:
            for one in value if isinstance(value, (list, tuple)) else (value,):
                yield one
                if isinstance(one, DescribedFunction):
                    yield from one.held()


def as_code(value: object) -> str:
    """Return how a program writes a value: functions have their names, others are shortened as by `shown`."""
    if isinstance(value, DescribedFunction):
        return value.call
    return value.__name__ if isinstance(value, FunctionType) else shown(value)


def as_text(value: object) -> str:
    """Return the `str` of a plain value, or what `shown` says where Python refuses to write an integer in it."""
    try:
        return str(value)
    except ValueError:
        return shown(value)


def as_digits(number: float) -> str:
    """Return a number with at most six digits, or what `shown` says of an integer that fits into no float."""
    try:
        return f"{number:g}"
    except OverflowError:
        return shown(number)


def written(value: object) -> str:
    """Return the whole `repr` of a plain value, or a shortened one where Python refuses to write an integer in it."""
    try:
        return repr(value)
    except ValueError:
        return shown(value)


def reason(error: BaseException) -> str:
    """Return what an error says, shortened to what another message can hold; else what kind of error it is."""
    try:
        text = str(error)
    except ValueError:  # the key of a KeyError may be an integer that is not written out
        text = ""
    return (text if len(text) <= _MOST else f"{text[:_MOST]} …") or type(error).__name__


def printable(text: str) -> str:
    r"""Return a text that a terminal can print: control characters but the line feed become escapes such as \u001b."""
    return _CONTROLS.sub(lambda found: _escaped(found.group()), text)


def module_of(value: object) -> str:
    """Return the name of the module in which a function or class was defined, the same in every process."""
    return main_module(str(getattr(value, "__module__", "?")))


def main_module(name: str) -> str:
    """Return the name of a module, `__main__` for the program in processes that were spawned, too."""
    return "__main__" if name == "__mp_main__" else name


def without_address(text: str) -> str:
    """Return a text without where objects lie in memory, the same in every process."""
    return _ADDRESS.sub("", text)


def as_xml(text: str, *, quote: bool = True) -> str:
    """Return a text as XML has it, with a mark in the place of what XML cannot hold."""
    from html import escape  # which few programs need

    return escape(re.sub(_NOT_IN_XML, "\ufffd", text), quote=quote)


def as_cell(value: T) -> T | str:
    """Return a value as a cell of a CSV file, in which a text that spreadsheets take for a formula begins with `'`.

    A cell of a formula begins with =, +, -, @, a tab or a carriage return. Numbers stay as they are.
    """
    is_formula = isinstance(value, str) and _FORMULA.match(value) and not _NUMBER.fullmatch(value)
    return f"'{value}" if is_formula else value


def from_cell(text: str) -> str:
    """Return the text that `as_cell` has written."""
    return text[1:] if text.startswith("'") and _FORMULA.match(text) else text


def printable_line(text: str) -> str:
    r"""Return a text as `printable` does, and on one line: line feeds become \n."""
    return printable(text).replace("\n", "\\n")


def _escaped(character: str) -> str:
    code = ord(character)
    return f"\\u{code:04x}" if code < 1 << 16 else f"\\U{code:08x}"
