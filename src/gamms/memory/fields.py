"""Contents of a store: plain values, fields with a type, and the schema of a map.

A field turns a value into a *cell* and back: None, one of five simple values, or the bytes of any other plain value
(`ir/packing.py`). All stores hold cells, so that they keep and return equal values, and never share them.
"""

import math
from collections.abc import Callable, Iterable, Mapping
from struct import pack, unpack
from typing import Any

import numpy as np

from gamms.arguments import as_float, as_int, as_mapping, as_text
from gamms.errors import BadFile, BadType, BadValue, GammsError, UnknownName, nearest
from gamms.ir import packing
from gamms.plain import Plain
from gamms.text import find_module, shown

MAX_FIELDS = 1000  # a SQLite table holds at most 2000 columns


class UnknownMap(GammsError, IndexError):
    """A data operation on a map that was not created."""

    def __init__(self, map_name: object, known: Iterable[str]) -> None:
        super().__init__(f"Unknown map {shown(map_name)}.{nearest(map_name, known)} Create it with create_map first.")


class DuplicateKey(GammsError, KeyError):
    """A key that already has a row."""

    def __init__(self, map_name: str, key: object) -> None:
        super().__init__(f"Map {map_name!r} already has a row with key {shown(key)}. Change it with update_data.")


class BadKeyField(GammsError, IndexError):
    """A primary key that is not allowed in the schema."""


class Field:
    """One named, typed field of a map: `cell` encodes a value for storage, `value` decodes it."""

    def __init__(self, map_name: str, name: str, python_type: type) -> None:
        self.name = name
        self.python_type = python_type
        self.place = f"Field {name!r} of map {map_name!r}"
        self._simple = _SIMPLE.get(python_type)
        module = find_module(python_type)
        type_name = python_type.__qualname__
        # for messages and files; never turned back into a type
        self.type_name = type_name if module == "builtins" else f"{module}.{type_name}"

    def encode(self, value: object) -> Plain:
        """Return the stored form of a value.

        Raises:
            BadType: the field's type does not accept it.
            BadValue: it is too large or too deeply nested.
        """
        if value is None:
            return None
        if self._simple is not None:
            return self._simple(value, self.place)
        if self.python_type in _CONTAINERS and not isinstance(value, self.python_type):
            raise _make_refusal(value, self.place, f"a {self.type_name}")
        cell = packing.to_bytes(value, self.place)
        if type(value) is not self.python_type:
            self.decode(cell)  # test the conversion
        return cell

    def decode(self, cell: Plain) -> Plain:
        """Return a new value from a cell.

        Raises:
            BadFile: this field cannot have made the cell.
        """
        if cell is None:
            return None
        if self._simple is not None:
            given = bool(cell) if self.python_type is bool and cell in (0, 1) else cell
            return unpack("<d", given)[0] if self.python_type is float and type(given) is bytes else self.encode(given)
        plain = packing.from_bytes(cell)
        if type(plain) is self.python_type:
            return plain
        if self.python_type in _CONTAINERS:
            raise BadFile(f"{self.place} holds {shown(plain)}, which is not a {self.type_name}.")
        try:
            return self.python_type(plain)
        except Exception as error:
            # Any class may be a field's type, so its constructor may raise any error.
            raise BadType(
                f"{self.place} must hold what {self.type_name}(…) accepts, not {shown(plain)}: {error}."
            ) from error

    def encode_key(self, value: object) -> Plain:
        """Return the cell of a primary key: never None, always equal to itself; raises like `cell`."""
        key = self.encode(value)
        if key is None:
            raise BadValue(f"{self.place} is the primary key and must not be None. Give every row a key.")
        if self.python_type is not float:
            return key
        if math.isnan(number := float(value)):  # type: ignore[arg-type] # as `cell` has checked
            raise BadValue(f"{self.place} is the primary key and must not be NaN, which no row could be found by.")
        return number + 0.0  # -0.0 and 0.0 are one key


class Schema:
    """The fields of a map in order, one of which is the primary key."""

    def __init__(self, map_name: str, schema: dict[str, type], primary_key: str) -> None:
        _check_types(schema)
        if primary_key not in schema:
            raise BadKeyField(f"The primary key {shown(primary_key)} is not a field.{nearest(primary_key, schema)}")
        if (key_type := schema[primary_key]) not in _SIMPLE:
            raise BadKeyField(
                f"The primary key {primary_key!r} must be int, float, str, bool or bytes, not {key_type!r}."
            )
        self.map_name = map_name
        self.fields = {name: Field(map_name, name, python_type) for name, python_type in schema.items()}
        self.key = self.fields[primary_key]
        self.type_names = {field.name: field.type_name for field in self.fields.values()}

    def encode_row(self, struct: Mapping[str, Any]) -> dict[str, Any]:
        """Return the cells of a whole row, in field order."""
        self._check_names(struct)
        missing = [name for name in self.fields if name not in struct]
        if missing:
            raise BadValue(f"A row of map {self.map_name!r} lacks {missing}. Give every field; None is a value.")
        return self._make_cells(struct)

    def change(self, struct: Mapping[str, Any]) -> tuple[Any, dict[str, Any]]:
        """Return the key in `struct`, and the changed cells, including the key."""
        name = self.key.name
        if name not in as_mapping(struct, f"A row of map {self.map_name!r}"):
            raise BadValue(f"The row {shown(struct)} has no {name!r}, the primary key of {self.map_name!r}.")
        self._check_names(struct)
        return self.lookup(struct[name]), self._make_cells(struct)

    def lookup(self, key: object) -> Plain:
        """Return the cell by which the row of a key is found.

        Raises:
            UnknownName: no row can have this key, for example because of its type.
        """
        try:
            return self.key.encode_key(key)
        except (BadType, BadValue):
            raise self.make_unknown_key_error(key) from None

    def make_unknown_key_error(self, key: object) -> UnknownName:
        """Return the error for a key that has no row."""
        return UnknownName(f"key ({self.key.type_name}) of map {self.map_name!r}:", key)

    def _make_cells(self, struct: Mapping[str, Any]) -> dict[str, Any]:
        given = (field for field in self.fields.values() if field.name in struct)
        return {one.name: (one.encode_key if one is self.key else one.encode)(struct[one.name]) for one in given}

    def _check_names(self, struct: Mapping[str, Any]) -> None:
        for name in as_mapping(struct, f"A row of map {self.map_name!r}"):
            if name not in self.fields:
                hint = nearest(name, self.fields)
                known = [*self.fields]
                raise BadValue(f"Map {self.map_name!r} has no field {shown(name)}.{hint} Its fields are {known}.")


def check_name(name: str, place: str) -> None:
    """Refuse names that databases and files cannot have."""
    if not name or "\0" in name:
        raise BadValue(f"{place} must not {'contain NUL' if name else 'be empty'}. Choose another name.")
    as_text(name, place)


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


def _check_number(value: object, place: str) -> float | bytes:
    number = float(value) if isinstance(value, float | np.floating) else as_float(value, place)
    # SQLite turns NaN into NULL and -0.0 into 0.0; as eight bytes they stay unchanged.
    is_altered = math.isnan(number) or (number == 0.0 and math.copysign(1.0, number) < 0.0)
    return pack("<d", number) if is_altered else number


def _make_instance_check(make: type, *kinds: type) -> Callable[[Any, str], Any]:
    def made(value: object, place: str) -> Any:
        if not isinstance(value, kinds):
            raise _make_refusal(value, place, f"a {make.__name__}")
        return make(value)

    return made


def _make_refusal(value: object, place: str, wanted: str) -> BadType:
    return BadType(f"{place} must be {wanted}, not {shown(value)} ({type(value).__name__}).")


_SIMPLE: dict[type, Callable[[Any, str], Any]] = {
    int: as_int,
    float: _check_number,
    str: as_text,
    bool: _make_instance_check(bool, bool, np.bool_),
    bytes: _make_instance_check(bytes, bytes),
}
_CONTAINERS = (tuple, list, dict, set, frozenset)
