"""What a store may hold: plain values, fields with a type, and the schema of a map.

Values are copied on their way in and out, so that every store keeps and returns the same ones.
"""

import math
from collections.abc import Callable, Iterable, Mapping
from functools import lru_cache
from typing import Any

import numpy as np

from gamms.arguments import as_int
from gamms.errors import BadType, BadValue, GammsError, UnknownName, nearest
from gamms.ir import packing
from gamms.plain import Plain
from gamms.text import shown

MAX_DEPTH = packing.MOST_DEPTH - 1  # also ends a cycle
MAX_FIELDS = 1000  # a SQLite table holds no more than 2000 columns

_FLOATING = (float, np.floating)


class UnknownMap(GammsError, IndexError):
    """A data operation on a map that was not created."""

    def __init__(self, map_name: object, known: Iterable[str]) -> None:
        super().__init__(f"Unknown map {shown(map_name)}.{nearest(map_name, known)} Create it with create_map first.")


class DuplicateKey(GammsError, KeyError):
    """A key that already has a row."""

    def __init__(self, map_name: str, key: object) -> None:
        super().__init__(f"Map {map_name!r} already has a row with key {shown(key)}. Change it with update_data.")


class BadKeyField(GammsError, IndexError):
    """A primary key that the schema cannot have."""


class Field:
    """One named, typed field of a map: `stored` is the way in, `given` the way out."""

    def __init__(self, map_name: str, name: str, python_type: type) -> None:
        self.name, self.python_type = name, python_type
        self.place = f"Field {name!r} of map {map_name!r}"
        self._scalar = _SCALARS.get(python_type)

    @property
    def is_scalar(self) -> bool:
        """Whether its values are of one of the five simple types."""
        return self._scalar is not None

    @property
    def type_name(self) -> str:
        """The type as text, for messages and files; it is never turned back into a type."""
        module, name = self.python_type.__module__, self.python_type.__qualname__
        return name if module == "builtins" else f"{module}.{name}"

    def stored(self, value: object) -> Plain:
        """Return the plain copy of a value that a store keeps.

        Raises:
            BadType: the field's type does not accept it.
            BadValue: it is too large or too deep to be kept.
        """
        if value is None:
            return None
        if self._scalar is not None:
            return self._scalar(value, self.place)
        if self.python_type in _CONTAINERS and not isinstance(value, self.python_type):
            raise _refusal(value, self.place, f"a {self.type_name}")
        copy = plain(value, self.place)
        if type(copy) is not self.python_type:
            # Try the way back on a throw-away copy: the class may keep, or empty, what it is given.
            self.given(plain(copy, self.place))
        return copy

    def given(self, fresh: Plain) -> Plain:
        """Return the caller's value for a stored one that belongs to nothing else."""
        if fresh is None or self._scalar is not None or type(fresh) is self.python_type:
            return fresh
        try:
            return self.python_type(fresh)
        except Exception as error:
            # Any class may be a field's type, so anything may come out of its constructor.
            raise BadType(
                f"{self.place} must hold what {self.type_name}(…) accepts, not {shown(fresh)}: {error}."
            ) from error

    def stored_key(self, value: object) -> Plain:
        """Return a value as a primary key: never None, always equal to itself; raises what `stored` raises."""
        key = self.stored(value)
        if key is None:
            raise BadValue(f"{self.place} is the primary key and must not be None. Give every row a key.")
        if self.python_type is not float:
            return key
        if math.isnan(key):
            raise BadValue(f"{self.place} is the primary key and must not be NaN, which no row could be found by.")
        return key + 0.0  # -0.0 and 0.0 are one key


class Schema:
    """The fields of a map in order, one of which is the primary key."""

    def __init__(self, map_name: str, schema: dict[str, type], primary_key: str) -> None:
        _check_types(schema)
        _check_key(schema, primary_key)
        self.map_name = map_name
        self.fields = [Field(map_name, name, python_type) for name, python_type in schema.items()]
        self.names = list(schema)
        self.key_at = self.names.index(primary_key)
        self.key = self.fields[self.key_at]
        self.type_names = {field.name: field.type_name for field in self.fields}

    def row(self, struct: Mapping[str, Any]) -> list[Any]:
        """Return a whole row as it is stored, in field order."""
        self._check_names(struct)
        missing = [name for name in self.names if name not in struct]
        if missing:
            raise BadValue(f"A row of map {self.map_name!r} lacks {missing}. Give every field; None is a value.")
        return [(one.stored_key if one is self.key else one.stored)(struct[one.name]) for one in self.fields]

    def change(self, struct: Mapping[str, Any]) -> tuple[Any, dict[int, Any]]:
        """Return the key in `struct`, and what it changes: positions of fields, the key among them, and values."""
        self._check_is_row(struct)
        if self.key.name not in struct:
            raise BadValue(f"The row {shown(struct)} has no {self.key.name!r}, the primary key of {self.map_name!r}.")
        self._check_names(struct)
        key = self.lookup(struct[self.key.name])
        changes = {at: field.stored(struct[field.name]) for at, field in enumerate(self.fields) if field.name in struct}
        return key, {**changes, self.key_at: key}

    def lookup(self, key: object) -> Plain:
        """Return a key as rows are found by it.

        Raises:
            UnknownName: no row can have this key, for example because of its type.
        """
        try:
            return self.key.stored_key(key)
        except (BadType, BadValue):
            raise self.unknown_key(key) from None

    def unknown_key(self, key: object) -> UnknownName:
        """Return the error for a key that has no row."""
        return UnknownName(f"key ({self.key.type_name}) of map {self.map_name!r}:", key)

    def _check_is_row(self, struct: object) -> None:
        if not isinstance(struct, Mapping):
            raise BadType(f"A row of map {self.map_name!r} must be a dict, not {shown(struct)}.")

    def _check_names(self, struct: Mapping[str, Any]) -> None:
        self._check_is_row(struct)
        for name in struct:
            if name not in self.names:
                hint = nearest(name, self.names)
                raise BadValue(f"Map {self.map_name!r} has no field {shown(name)}.{hint} Its fields are {self.names}.")


def check_name(name: str, place: str) -> None:
    """Refuse the few names that no database and no file can have."""
    if not name:
        raise BadValue(f"{place} must not be empty. Choose a name.")
    if "\0" in name:
        raise BadValue(f"{place} must not contain NUL. Choose another name.")
    _text(name, place)


def _check_types(schema: object) -> None:
    if not isinstance(schema, dict) or not schema:
        raise BadType(f"A schema must be a dict of field names to types with at least one field, not {shown(schema)}.")
    if len(schema) > MAX_FIELDS:
        raise BadValue(f"A map holds at most {MAX_FIELDS} fields, not {len(schema)}. Put some into a dict field.")
    for name, python_type in schema.items():
        if not isinstance(name, str):
            raise BadType(f"A field name must be a str, not {shown(name)} ({type(name).__name__}).")
        if not isinstance(python_type, type):
            raise BadType(f"The type of field {name!r} must be a type such as int, not {shown(python_type)}.")
        if issubclass(python_type, np.ndarray):
            raise BadType(f"Field {name!r} cannot be an array. Make it a list and store array.tolist().")
        check_name(name, f"The field name {name!r}")


def _check_key(schema: dict[str, type], primary_key: str) -> None:
    if primary_key not in schema:
        raise BadKeyField(f"The primary key {shown(primary_key)} is not a field.{nearest(primary_key, schema)}")
    if schema[primary_key] not in _SCALARS:
        raise BadKeyField(
            f"The primary key {primary_key!r} must be int, float, str, bool or bytes, not {schema[primary_key]!r}."
        )


# -- plain values -----------------------------------------------------------------------------------------------


def plain(value: object, place: str, depth: int = 0) -> Plain:
    """Return a deep copy of a value, made of built-in types only.

    Raises:
        BadType: something in it is no plain data.
        BadValue: an integer beyond 64 bits, invalid Unicode, or more than `MAX_DEPTH` levels.
    """
    if depth > MAX_DEPTH:
        raise BadValue(f"{place} is nested more than {MAX_DEPTH} levels deep, or holds itself. Flatten it.")
    copy = _copy_of(type(value))  # type: ignore[arg-type] # a class can be hashed
    if copy is None:
        raise _refusal(value, place, "None, a number, text, bytes, or a tuple, list, dict or set of those")
    return copy(value, place, depth + 1)


def _number(value: object, place: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, np.integer, *_FLOATING)):
        raise _refusal(value, place, "a number")
    try:
        return float(value)
    except OverflowError:
        raise BadValue(f"{place} must fit into a float, not {shown(value)}.") from None


def _text(value: object, place: str) -> str:
    if not isinstance(value, str):
        raise _refusal(value, place, "a str")
    plain_text = str.__str__(value)
    try:
        plain_text.encode()
    except UnicodeEncodeError:
        raise BadValue(f"{place} must be valid Unicode, not {shown(value)}: it has a lone surrogate.") from None
    return plain_text


def _truth(value: object, place: str) -> bool:
    if not isinstance(value, (bool, np.bool_)):
        raise _refusal(value, place, "a bool")
    return bool(value)


def _octets(value: object, place: str) -> bytes:
    if not isinstance(value, bytes):
        raise _refusal(value, place, "bytes")
    return bytes(value)


def _refusal(value: object, place: str, wanted: str) -> BadType:
    return BadType(f"{place} must be {wanted}, not {shown(value)} ({type(value).__name__}).")


def _items(value: Iterable[Plain], place: str, depth: int) -> list[Any]:
    return [plain(one, place, depth) for one in value]


def _pairs(value: Mapping[Plain, Plain], place: str, depth: int) -> dict[Any, Any]:
    return {plain(key, place, depth): plain(one, place, depth) for key, one in value.items()}


_SCALARS: dict[type, Callable[[Any, str], Any]] = {
    int: as_int,
    float: _number,
    str: _text,
    bool: _truth,
    bytes: _octets,
}
_CONTAINERS = (tuple, list, dict, set, frozenset)
_Copy = Callable[[Any, str, int], Any]
_COPIES: tuple[tuple[tuple[type, ...], _Copy], ...] = (  # bool stands before int because it is one
    ((type(None),), lambda _value, _place, _depth: None),
    ((bool, np.bool_), lambda value, _place, _depth: bool(value)),
    ((int, np.integer), lambda value, place, _depth: as_int(value, place)),
    (_FLOATING, lambda value, _place, _depth: float(value)),
    ((str,), lambda value, place, _depth: _text(value, place)),
    ((bytes, bytearray), lambda value, _place, _depth: bytes(value)),
    ((list,), _items),
    ((dict,), _pairs),
    *(
        ((kind,), lambda value, place, depth, kind=kind: kind(_items(value, place, depth)))
        for kind in (tuple, frozenset, set)
    ),
)


@lru_cache(maxsize=256)
def _copy_of(kind: type) -> _Copy | None:
    return next((copy for accepted, copy in _COPIES if issubclass(kind, accepted)), None)
