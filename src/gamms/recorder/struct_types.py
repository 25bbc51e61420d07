"""The types of a component's fields: from Python hints, from the text in a recording, and back; never by `eval`.

    type  = atom {"|" atom}
    atom  = "int" | "float" | "str" | "bool" | "NoneType" | "None" | "..." | "<class '" name "'>"
          | "Optional[" type "]" | "Union[" type {"," type} "]"
          | "Tuple[" type {"," type} "]" | "Tuple[" type ", ...]" | "List[" type "]"

with `typing.` before a name if you like, and `tuple` and `list` for `Tuple` and `List`. A recording holds the text that
1.0.0 writes: `typing.Optional[int]`, `typing.Union[int, str, NoneType]`, `<class 'NoneType'>`.
"""

import re
import types
import typing
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from gamms.errors import BadType
from gamms.recorder.errors import RecordingError
from gamms.text import shown

_SCALARS: dict[str, type] = {
    "int": int,
    "float": float,
    "str": str,
    "bool": bool,
    "NoneType": types.NoneType,
    "...": types.EllipsisType,
}
_NAME_OF = {kind: name for name, kind in _SCALARS.items() if name != "..."}
_ACCEPTED: dict[str, tuple[type, ...]] = {name: (kind,) for name, kind in _SCALARS.items()} | {"float": (float, int)}
_NONE = "NoneType"
_OPEN = "..."  # behind the only type in a tuple of any length
_MOST_LETTERS = 4000
_MOST_DEPTH = 8
_TOKEN = re.compile(r"\s*(<class '\w+'>|\.\.\.|[\w.]+|[\[\],|])")
_ALLOWED = "int, float, str, bool, None, Optional, Union, tuple[...] and list[...] of those"


@dataclass(frozen=True, slots=True)
class Array:
    """A tuple with a type per item, a tuple of any length, or a list."""

    kind: type  # tuple or list
    items: tuple["FieldType", ...]
    is_open: bool  # any number of items, all of one type

    def __str__(self) -> str:
        inside = ", ".join(item.inner_text() for item in self.items)
        return f"{self.kind.__name__}[{inside}{', ...' if self.is_open and self.kind is tuple else ''}]"

    def fits(self, value: object) -> bool:
        """Whether the value is such a tuple or list."""
        if not isinstance(value, tuple | list) or type(value) is not self.kind:
            return False
        if self.is_open:
            return all(self.items[0].fits(one) for one in value)
        return len(value) == len(self.items) and all(
            item.fits(one) for item, one in zip(self.items, value, strict=True)
        )

    def shaped(self, values: Iterable[Any]) -> Any:
        """Return the values as a fresh tuple or list, and so within."""
        values = list(values)
        if self.is_open:
            return self.kind(self.items[0].shaped(one) for one in values)
        if len(values) != len(self.items):
            return self.kind(values)
        return self.kind(item.shaped(one) for item, one in zip(self.items, values, strict=True))


@dataclass(frozen=True, slots=True)
class FieldType:
    """What a field may hold: one of the members, which are names of scalars and arrays."""

    members: tuple[str | Array, ...]

    def __str__(self) -> str:
        """Return the text in a recording."""
        if len(self.members) == 1 and self.members[0] in _SCALARS and self.members[0] != "...":
            return f"<class '{self.members[0]}'>"
        return self.inner_text()

    def inner_text(self) -> str:
        """Return the text inside brackets."""
        texts = [str(member) for member in self.members]
        if len(texts) == 1:
            return texts[0]
        if len(texts) == 2 and _NONE in texts:
            return f"typing.Optional[{next(text for text in texts if text != _NONE)}]"
        return f"typing.Union[{', '.join(texts)}]"

    def or_none(self) -> "FieldType":
        """Return the type of a field: each may be None, and is at first."""
        return union([self, FieldType((_NONE,))])

    def fits(self, value: object) -> bool:
        """Whether the value is of this type; a whole number passes for a float, as it does in Python's typing."""
        return any(
            member.fits(value) if isinstance(member, Array) else isinstance(value, _ACCEPTED[member])
            for member in self.members
        )

    def shaped(self, value: object) -> Any:
        """Return a fresh value of the kind declared: recordings have one kind of array, Python tuples and lists.

        A value of a type that is not declared comes back as it is.
        """
        if isinstance(value, np.generic | np.ndarray):
            value = value.tolist()
        if not isinstance(value, tuple | list):
            return value
        shapes = [member.shaped(value) for member in self.members if isinstance(member, Array)]
        return next(filter(self.fits, shapes), shapes[0] if shapes else value)


def union(parts: Iterable[FieldType]) -> FieldType:
    """Return the union of types, each once, in order; None last where there is one other, as Optional has no order."""
    members = tuple(dict.fromkeys(member for part in parts for member in part.members))
    return FieldType(members[::-1] if len(members) == 2 and members[0] == _NONE else members)


# -- from Python ------------------------------------------------------------------------------------------------


def of_hint(hint: object) -> FieldType:
    """Return the type of a Python hint.

    Raises:
        BadType (TypeError): the hint is not one of those a recording can hold.
    """
    found = _of_hint(hint)
    try:
        parse(str(found.or_none()))
    except RecordingError as error:
        raise BadType(str(error)) from error
    return found


def _of_hint(hint: object) -> FieldType:
    if hint is Ellipsis:
        return FieldType((_OPEN,))
    if isinstance(hint, type) and hint in _NAME_OF:
        return FieldType((_NAME_OF[hint],))
    origin, inside = typing.get_origin(hint), typing.get_args(hint)
    if origin in (typing.Union, types.UnionType):
        return union([_of_hint(one) for one in inside])
    if origin is tuple and inside and inside != (Ellipsis,):
        is_open = len(inside) == 2 and inside[1] is Ellipsis
        items = tuple(_of_hint(types.NoneType if one is None else one) for one in (inside[:1] if is_open else inside))
        return FieldType((Array(tuple, items, is_open),))
    if origin is list and len(inside) == 1:
        return FieldType((Array(list, (_of_hint(inside[0]),), is_open=True),))
    raise BadType(f"A field of a component cannot be {shown(hint)}. Use {_ALLOWED}.")


# -- from text --------------------------------------------------------------------------------------------------


def parse(text: object) -> FieldType:
    """Return the type of the text in a recording.

    Raises:
        RecordingError: the text says anything else.
    """
    if not isinstance(text, str) or len(text) > _MOST_LETTERS:
        raise RecordingError(f"The type of a field is a text of at most {_MOST_LETTERS} letters. Use {_ALLOWED}.")
    parser = _Parser(text)
    found = parser.type()
    if parser.next():
        raise parser.error()
    return found


class _Parser:
    """Reads the grammar above by recursive descent, one token ahead."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._tokens = _TOKEN.findall(text)
        self._at = 0
        self._depth = 0
        if "".join(self._tokens).replace(" ", "") != re.sub(r"\s", "", text):
            raise self.error()

    def error(self, why: str = "") -> RecordingError:
        return RecordingError(f"{self._text[:100]!r} is not the type of a field. Use {_ALLOWED}.{why}")

    def next(self) -> str:
        return self._tokens[self._at] if self._at < len(self._tokens) else ""

    def take(self, *expected: str) -> str:
        token = self.next()
        if expected and token not in expected:
            raise self.error()
        self._at += 1
        return token

    def type(self) -> FieldType:
        self._depth += 1
        if self._depth > _MOST_DEPTH:
            raise self.error()
        parts = [self._atom()]
        while self.next() == "|":
            self.take()
            parts.append(self._atom())
        self._depth -= 1
        return self._one_kind(union(parts))

    def _one_kind(self, found: FieldType) -> FieldType:
        if len({member.kind for member in found.members if isinstance(member, Array)}) > 1:
            raise self.error(" It has both tuples and lists, which a recording cannot tell apart.")
        return found

    def _atom(self) -> FieldType:
        name = self.take()
        if name.startswith("<"):
            name = name[len("<class '") : -len("'>")]
        if name == "None":
            name = _NONE
        if name in _SCALARS:
            return FieldType((name,))
        name = name.removeprefix("typing.").lower()
        if name not in ("optional", "union", "tuple", "list"):
            raise self.error()
        inside = self._inside()
        return self._made(name, inside)

    def _inside(self) -> list[FieldType]:
        self.take("[")
        found = [self.type()]
        while self.take(",", "]") == ",":
            found.append(self.type())
        return found

    def _made(self, name: str, inside: list[FieldType]) -> FieldType:
        if name == "optional" and len(inside) == 1:
            return inside[0].or_none()
        if name == "union":
            return self._one_kind(union(inside))
        dots = FieldType((_OPEN,))
        if name == "tuple" and inside[0] != dots:
            is_open = len(inside) == 2 and inside[1] == dots
            return self._array(Array(tuple, tuple(inside[:1] if is_open else inside), is_open))
        if name == "list" and len(inside) == 1:
            return self._array(Array(list, tuple(inside), is_open=True))
        raise self.error()

    def _array(self, array: Array) -> FieldType:
        inner = [member for item in array.items for member in item.members if isinstance(member, Array)]
        if any(list in (array.kind, member.kind) for member in inner):
            raise self.error(" A list holds scalars, and a tuple holds no list.")
        return FieldType((array,))
