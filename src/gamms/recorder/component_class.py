"""Makes a user's class a component: named objects whose declared fields report every change.

The values lie in one dict per object, `__recorded_component_`; the class gets a property per field and an `__init__`
that takes the name first.
"""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from gamms.errors import BadType
from gamms.recorder import struct_types
from gamms.recorder.struct_types import FieldType
from gamms.text import shown

Key = tuple[str, str]  # module and qualified name of a class

STORE = "__recorded_component_"
_KIND = "__recorded_class_"


class Keeper(Protocol):
    """Who is told what its components go through."""

    def begin(self, component: Any, name: Any) -> None:
        """A component has a name and no values yet."""

    def abandon(self, component: Any) -> None:
        """The `__init__` of a component failed."""

    def assign(self, component: Any, field: str, value: Any) -> None:
        """A field is to take a value."""


@dataclass(frozen=True, slots=True)
class Kind:
    """What a component class is: its fields in order, and the `__init__` its author wrote."""

    key: Key
    fields: dict[str, FieldType]
    original_init: Callable[..., None]

    def begin(self, component: Any, name: Any) -> None:
        """Give a component its name and fields of None."""
        object.__setattr__(component, STORE, {**dict.fromkeys(self.fields), "name": name})


def kind_of(component: Any) -> Kind | None:
    """The kind of a component; None for any other object."""
    return getattr(type(component), _KIND, None) if STORE in getattr(component, "__dict__", ()) else None


def declared_fields(struct: Any) -> dict[str, FieldType]:
    """The fields that a user declares by name and Python type, each of which may also be None.

    Raises:
        BadType (TypeError): it is no dict, or a name or a type is not possible.
    """
    if not isinstance(struct, Mapping):
        raise BadType(f"The struct of a component must be a dict of field names to types, not {shown(struct)}.")
    return {checked_name(name): struct_types.of_hint(hint).or_none() for name, hint in struct.items()}


def checked_name(name: Any) -> str:
    """The name of a field.

    Raises:
        BadType (TypeError): it is no text, or reserved.
    """
    if not isinstance(name, str):
        raise BadType(f"The name of a field must be a str, not {shown(name)}.")
    if name in ("name", STORE, _KIND) or (name.startswith("__") and name.endswith("__")):
        raise BadType(f"A field cannot be called {shown(name)}: the name is reserved. Choose another.")
    return name


def check_class(cls: Any, fields: Mapping[str, FieldType]) -> None:
    """See that a class can become a component.

    Raises:
        BadType (TypeError): it is no class, has no room for the values, or its names clash with the fields.
    """
    if not isinstance(cls, type):
        raise BadType(f"Only a class can be a component, not {shown(cls)}.")
    if not cls.__dictoffset__:
        raise BadType(f"{cls.__qualname__} has __slots__ and no __dict__: a component needs one for its fields.")
    taken = [field for field in fields if hasattr(cls, field)]
    if taken:
        raise BadType(f"{cls.__qualname__} already has an attribute {taken[0]!r}. Name the field differently.")
    if "name" in _parameters_of(cls):
        raise BadType(
            f"The __init__ of {cls.__qualname__} has a parameter 'name', which is reserved: a component takes its name "
            "as the first argument, before those of its own __init__. Call the parameter differently."
        )


def make_component(cls: Any, fields: dict[str, FieldType], keeper: Keeper) -> Kind:
    """Turn a checked class into a component class, in place."""
    kind = Kind(key_of(cls), fields, cls.__init__)
    for field in fields:
        setattr(cls, field, _property_of(field, keeper))
    cls.name = property(lambda self: getattr(self, STORE)["name"], doc="The name of the component.")
    cls.__init__ = _init_of(kind, keeper)
    setattr(cls, _KIND, kind)
    return kind


def key_of(cls: type) -> Key:
    """Under what a class is registered."""
    return (cls.__module__, cls.__qualname__)


def takes_nothing(init: Callable[..., None]) -> bool:
    """Whether an `__init__` can be called with no argument but the object."""
    try:
        inspect.signature(init).bind(object())
    except (TypeError, ValueError):
        return False
    return True


def _parameters_of(cls: Any) -> Mapping[str, Any]:
    try:
        return inspect.signature(cls.__init__).parameters
    except ValueError:  # of a class that is not written in Python
        return {}


def _property_of(field: str, keeper: Keeper) -> property:
    def get(self: Any) -> Any:
        value = getattr(self, STORE)[field]
        return list(value) if isinstance(value, list) else value  # a change within would go unrecorded

    def put(self: Any, value: Any) -> None:
        keeper.assign(self, field, value)

    return property(get, put, doc=f"The recorded field {shown(field)}; a list is handed out as a copy.")


def _init_of(kind: Kind, keeper: Keeper) -> Callable[..., None]:
    def __init__(self: Any, name: Any, *args: Any, **kwargs: Any) -> None:  # noqa: N807 - it becomes the method
        kind.begin(self, name)
        keeper.begin(self, name)
        try:
            kind.original_init(self, *args, **kwargs)
        except BaseException:
            keeper.abandon(self)
            raise

    return __init__
