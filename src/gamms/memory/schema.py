"""The fields of a map: which values they accept, and how a stored value is given back."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from gamms.errors import BadFile, BadType, BadValue, UnknownName, nearest
from gamms.memory.errors import BadKeyField
from gamms.memory.values import number, octets, plain, refuse, text, truth, whole
from gamms.text import shown

MAX_FIELDS = 1000  # a SQLite table holds no more than 2000 columns

KEY_TYPES = (int, float, str, bool, bytes)
_SCALARS: dict[type, Callable[[Any, str], Any]] = {
    int: whole,
    float: number,
    str: text,
    bool: truth,
    bytes: octets,
}
_CONTAINERS = (tuple, list, dict, set, frozenset)


class Field:
    """One named, typed field: `stored` is the way in, `given` the way out; neither shares a value."""

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
        """The type as text, for messages and files; nobody ever turns it back into a type."""
        module, name = self.python_type.__module__, self.python_type.__qualname__
        return name if module == "builtins" else f"{module}.{name}"

    def stored(self, value: Any) -> Any:
        """`value` as the plain copy that a store keeps.

        Raises:
            BadType: the field's type does not accept it.
            BadValue: it is too large or too deep to be kept.
        """
        if value is None:
            return None
        if self._scalar is not None:
            return self._scalar(value, self.place)
        if self.python_type in _CONTAINERS and not isinstance(value, self.python_type):
            raise refuse(value, self.place, f"a {self.type_name}")
        copy = plain(value, self.place)
        if type(copy) is not self.python_type:
            # Try the way back on a throw-away copy: the class may keep, or empty, what it is given.
            self.given(plain(copy, self.place))
        return copy

    def given(self, fresh: Any) -> Any:
        """The caller's value for a stored one that nobody else holds."""
        if fresh is None or self._scalar is not None or type(fresh) is self.python_type:
            return fresh
        try:
            return self.python_type(fresh)
        except Exception as error:
            # Any class may be a field's type, so anything may come out of its constructor.
            raise BadType(
                f"{self.place} must hold what {self.type_name}(…) accepts, not {shown(fresh)}: {error}."
            ) from error

    def stored_key(self, value: Any) -> Any:
        """`value` as a primary key: never None, always equal to itself.

        Raises:
            BadType: the field's type does not accept it.
            BadValue: it is None or NaN.
        """
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

    @property
    def key(self) -> Field:
        """The field that selects the row."""
        return self.fields[self.key_at]

    def type_names(self) -> dict[str, str]:
        """Field names and the names of their types."""
        return {field.name: field.type_name for field in self.fields}

    def row(self, struct: Mapping[str, Any]) -> list[Any]:
        """A whole row, in field order, ready to be stored."""
        self._check_names(struct)
        self._check_complete(struct)
        return [
            field.stored_key(struct[field.name]) if field is self.key else field.stored(struct[field.name])
            for field in self.fields
        ]

    def change(self, struct: Mapping[str, Any]) -> dict[int, Any]:
        """The fields of `struct` but for the key: position to stored value."""
        self._check_names(struct)
        return {
            at: field.stored(struct[field.name])
            for at, field in enumerate(self.fields)
            if field.name in struct and at != self.key_at
        }

    def columns(self, columns: Mapping[str, Sequence[Any]]) -> list[list[Any]]:
        """Whole columns, in field order, ready to be stored."""
        self._check_names(columns)
        self._check_complete(columns)
        self._check_lengths(columns)
        return [
            [field.stored_key(value) for value in columns[field.name]]
            if field is self.key
            else [field.stored(value) for value in columns[field.name]]
            for field in self.fields
        ]

    def lookup(self, key: Any) -> Any:
        """`key` as rows are found by it; a key of another type is simply not there.

        Raises:
            UnknownName: no row can have this key.
        """
        try:
            return self.key.stored_key(key)
        except (BadType, BadValue):
            raise self.unknown_key(key) from None

    def key_of(self, struct: Mapping[str, Any]) -> Any:
        """The key of the row that `struct` is about."""
        if not isinstance(struct, Mapping):
            raise BadType(f"A row of map {self.map_name!r} must be a dict, not {shown(struct)}.")
        if self.key.name not in struct:
            raise BadValue(f"The row {shown(struct)} has no {self.key.name!r}, the primary key of {self.map_name!r}.")
        return self.lookup(struct[self.key.name])

    def unknown_key(self, key: object) -> UnknownName:
        """The error for a key that has no row."""
        return UnknownName(f"key ({self.key.type_name}) of map {self.map_name!r}:", key)

    def _check_names(self, struct: Mapping[str, Any]) -> None:
        if not isinstance(struct, Mapping):
            raise BadType(f"A row of map {self.map_name!r} must be a dict, not {shown(struct)}.")
        for name in struct:
            if name not in self.names:
                hint = nearest(name, self.names)
                raise BadValue(f"Map {self.map_name!r} has no field {name!r}.{hint} Its fields are {self.names}.")

    def _check_complete(self, struct: Mapping[str, Any]) -> None:
        missing = [name for name in self.names if name not in struct]
        if missing:
            raise BadValue(f"A row of map {self.map_name!r} lacks {missing}. Give every field; None is a value.")

    def _check_lengths(self, columns: Mapping[str, Sequence[Any]]) -> None:
        lengths = {name: len(columns[name]) for name in self.names}
        if len(set(lengths.values())) > 1:
            raise BadValue(f"The columns for map {self.map_name!r} must be equally long, not {lengths}.")


def check_name(name: str, place: str) -> None:
    """Refuse the few names that no database and no file can have."""
    if not name:
        raise BadValue(f"{place} must not be empty. Choose a name.")
    if "\0" in name:
        raise BadValue(f"{place} must not contain NUL. Choose another name.")
    text(name, place)


def check_same(found: dict[str, str], found_key: str, schema: Schema, path: str) -> None:
    """Refuse to read a map of a file with another schema than it was written with.

    Raises:
        BadValue: they differ.
    """
    if found == schema.type_names() and found_key == schema.key.name:
        return
    raise BadValue(
        f"Map {schema.map_name!r} of {path!r} has the schema {found} with key {found_key!r}, not "
        f"{schema.type_names()} with key {schema.key.name!r}. Use that schema, another name or another file."
    )


def damaged(place: str, path: str, found: object) -> BadFile:
    """The error for a value in a file that its field cannot hold."""
    return BadFile(f"{place} holds {shown(found)} in {path!r}, which its type cannot be. The file is damaged.")


def _check_types(schema: Any) -> None:
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
    if schema[primary_key] not in KEY_TYPES:
        raise BadKeyField(
            f"The primary key {shown(primary_key)} must be int, float, str, bool or bytes, "
            f"not {shown(schema[primary_key])}."
        )
