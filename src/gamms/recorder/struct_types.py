"""The types of component fields, parsed from Python hints and from texts in recordings, without `eval`.

    type  = atom {"|" atom}
    atom  = "int" | "float" | "str" | "bool" | "NoneType" | "None" | "..." | "<class '" name "'>"
          | "Optional[" type "]" | "Union[" type {"," type} "]"
          | "Tuple[" type {"," type} "]" | "Tuple[" type ", ...]" | "List[" type "]"

with an optional `typing.` before names, and `tuple` and `list` for `Tuple` and `List`. A recording has the text that
1.0.0 writes: `typing.Optional[int]`, `typing.Union[int, str, NoneType]`, `<class 'NoneType'>`. Except for `<class '…'>`
this is Python's grammar of expressions, so Python's own parser is used, which evaluates nothing.
"""

import ast
import re
import types
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np

from gamms.errors import BadType
from gamms.recorder.errors import RecordingError
from gamms.text import parse_syntax, shown

_SCALARS: dict[str, type] = {
    "int": int,
    "float": float,
    "str": str,
    "bool": bool,
    "NoneType": types.NoneType,
    "...": types.EllipsisType,
}
_ACCEPTED: dict[str, tuple[type, ...]] = {name: (kind,) for name, kind in _SCALARS.items()} | {"float": (float, int)}
_NONE = "NoneType"
_OPEN = "..."  # after the only type in a tuple of any length
_MOST_LETTERS = 4000
_MOST_DEPTH = 8
_CLASS = re.compile(r"<class '(\w+)'>")
_LETTERS = re.compile(r"[A-Za-z_.\[\],|\s]*")  # no digits, quotes or other brackets
_EMPTY_END = re.compile(r",\s*\]")
_ALLOWED = "int, float, str, bool, None, Optional, Union, tuple[...] and list[...] of those"


@dataclass(frozen=True, slots=True)
class Array:
    """A tuple with one type per item, a tuple of any length, or a list."""

    kind: type  # tuple or list
    items: tuple["FieldType", ...]
    is_open: bool  # any number of items of one type

    def __str__(self) -> str:
        inside = ", ".join(item.get_inner_text() for item in self.items)
        return f"{self.kind.__name__}[{inside}{', ...' if self.is_open and self.kind is tuple else ''}]"

    def is_valid(self, value: object) -> bool:
        """Return whether a value is such a tuple or list."""
        if not isinstance(value, tuple | list) or type(value) is not self.kind:
            return False
        if self.is_open:
            return all(self.items[0].is_valid(one) for one in value)
        return len(value) == len(self.items) and all(
            item.is_valid(one) for item, one in zip(self.items, value, strict=True)
        )

    def convert(self, values: Iterable[Any]) -> Any:
        """Return the values as a fresh tuple or list, recursively."""
        values = list(values)
        if self.is_open:
            return self.kind(self.items[0].convert(one) for one in values)
        if len(values) != len(self.items):
            return self.kind(values)
        return self.kind(item.convert(one) for item, one in zip(self.items, values, strict=True))


@dataclass(frozen=True, slots=True)
class FieldType:
    """The type of a field: a union of scalars and arrays."""

    members: tuple[str | Array, ...]

    def __str__(self) -> str:
        """Return the text for a recording."""
        if len(self.members) == 1 and self.members[0] in _SCALARS and self.members[0] != "...":
            return f"<class '{self.members[0]}'>"
        return self.get_inner_text()

    def get_inner_text(self) -> str:
        """Return the text inside brackets."""
        texts = [str(member) for member in self.members]
        if len(texts) == 1:
            return texts[0]
        if len(texts) == 2 and _NONE in texts:
            return f"typing.Optional[{next(text for text in texts if text != _NONE)}]"
        return f"typing.Union[{', '.join(texts)}]"

    def make_optional(self) -> "FieldType":
        """Return the type with None, which every field may be, and is initially."""
        return unite_types([self, FieldType((_NONE,))])

    def is_valid(self, value: object) -> bool:
        """Return whether a value has this type; an integer counts as a float, as in Python's typing."""
        return any(
            member.is_valid(value) if isinstance(member, Array) else isinstance(value, _ACCEPTED[member])
            for member in self.members
        )

    def convert(self, value: object) -> Any:
        """Return a fresh value of the declared type: recordings have one kind of array, Python tuples and lists.

        A value of an undeclared type is returned unchanged.
        """
        if isinstance(value, np.generic | np.ndarray):
            value = value.tolist()
        if not isinstance(value, tuple | list):
            return value
        shapes = [member.convert(value) for member in self.members if isinstance(member, Array)]
        return next(filter(self.is_valid, shapes), shapes[0] if shapes else value)


def unite_types(parts: Iterable[FieldType]) -> FieldType:
    """Return the union of types, without duplicates, in order; None comes last."""
    members = tuple(dict.fromkeys(chain.from_iterable(part.members for part in parts)))
    return FieldType(members[::-1] if len(members) == 2 and members[0] == _NONE else members)


# -- from hints and texts ---------------------------------------------------------------------------------------


def parse_hint(hint: object) -> FieldType:
    """Return the type of a Python hint, by its text in the grammar above.

    Raises:
        BadType (TypeError): recordings do not support it.
    """
    try:
        if hint is not None and not isinstance(hint, str):
            return parse("..." if hint is Ellipsis else str(hint))
    except RecordingError as error:
        raise BadType(str(error)) from error
    raise BadType(f"A field of a component cannot be {shown(hint)}. Use {_ALLOWED}.")


def parse(text: object) -> FieldType:
    """Return the type of a text in a recording.

    Raises:
        RecordingError: the text is not a type.
    """
    if not isinstance(text, str) or len(text) > _MOST_LETTERS:
        raise RecordingError(f"The type of a field is a text of at most {_MOST_LETTERS} letters. Use {_ALLOWED}.")
    why = ""
    plain = _CLASS.sub(r" \1 ", text).strip()
    if _LETTERS.fullmatch(plain) and not _EMPTY_END.search(plain):
        try:
            return _parse_type(parse_syntax(plain, mode="eval").body, 1)
        except (SyntaxError, RecursionError, MemoryError):
            pass
        except ValueError as error:
            why = str(error)
    raise RecordingError(f"{text[:100]!r} is not the type of a field. Use {_ALLOWED}.{why}")


def _parse_type(node: ast.expr, depth: int) -> FieldType:
    """Return the type of an expression (ValueError)."""
    if depth > _MOST_DEPTH:
        raise ValueError(f" It is nested deeper than {_MOST_DEPTH}.")
    parts = []
    while isinstance(node, ast.BinOp) and isinstance(node.op, ast.BitOr):
        parts.append(node.right)
        node = node.left
    return _merge_kinds([_parse_atom(part, depth) for part in (node, *reversed(parts))])


def _merge_kinds(parts: list[FieldType]) -> FieldType:
    found = unite_types(parts)
    if len({member.kind for member in found.members if isinstance(member, Array)}) > 1:
        raise ValueError(" It has both tuples and lists, which a recording cannot tell apart.")
    return found


def _parse_atom(node: ast.expr, depth: int) -> FieldType:
    if isinstance(node, ast.Constant) and node.value in (None, ...):
        return FieldType((_NONE if node.value is None else _OPEN,))
    if isinstance(node, ast.Name) and node.id in _SCALARS:
        return FieldType((node.id,))
    if not isinstance(node, ast.Subscript):
        raise ValueError  # noqa: TRY004 - it is the text that is wrong
    inside = [
        _parse_type(one, depth + 1) for one in (node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice])
    ]
    name = ast.unparse(node.value).removeprefix("typing.").lower()
    dots = FieldType((_OPEN,))
    if name == "optional" and len(inside) == 1:
        return inside[0].make_optional()
    if name == "union":
        return _merge_kinds(inside)
    if name == "list" and len(inside) == 1:
        return _make_array_type(Array(list, tuple(inside), is_open=True))
    if name == "tuple" and inside[0] != dots:
        is_open = len(inside) == 2 and inside[1] == dots
        return _make_array_type(Array(tuple, tuple(inside[:1] if is_open else inside), is_open))
    raise ValueError


def _make_array_type(array: Array) -> FieldType:
    members = chain.from_iterable(item.members for item in array.items)
    if any(list in (array.kind, member.kind) for member in members if isinstance(member, Array)):
        raise ValueError(" A list holds scalars, and a tuple holds no list.")
    return FieldType((array,))
