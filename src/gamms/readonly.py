"""Read-only copies, and independent deep copies."""

from collections import deque
from collections.abc import Callable, Iterator, Mapping
from copy import deepcopy
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import partial
from types import BuiltinFunctionType, FunctionType, MethodType, ModuleType, NoneType
from typing import Any, ClassVar, NoReturn, Self, SupportsIndex, TypeVar, cast

import numpy as np

from gamms.errors import BadType, BadValue, GammsError, UnknownAttribute, UnknownName

_SCALARS = frozenset({str, bytes, int, float, complex, bool, NoneType})
_IMMUTABLE = (str, bytes, int, float, complex, Enum, range, slice, type)
_CODE = (FunctionType, BuiltinFunctionType, MethodType, partial, ModuleType)
_VALUES = frozenset({"datetime", "decimal", "fractions", "pathlib", "re", "uuid", "zoneinfo"})  # modules of values

Array = TypeVar("Array", bound="np.ndarray[Any, Any]")
Otherwise = Callable[[Any], Any]  # handles objects of unknown classes


class ReadOnly(GammsError, TypeError, AttributeError):
    """A read-only value was modified."""


class NotPickled:
    """Mix-in: refuses to be pickled and copied, with a sentence that says what to do instead.

    A class with a `__copy__` or a `__deepcopy__` of its own is copied by it.
    """

    __slots__ = ()
    _not_pickled: ClassVar[str]  # the sentence

    def __reduce_ex__(self, protocol: SupportsIndex) -> Any:
        """Refuse to be pickled.

        Raises:
            BadType: always.
        """
        raise BadType(self._not_pickled)


class ShallowCopyMixin(NotPickled):
    """Mix-in: refuses to be pickled and copied deeply; `copy.copy` makes a copy that shares all attributes."""

    __slots__ = ()

    def __copy__(self) -> Self:
        kind = type(self)
        twin = kind.__new__(kind)
        twin.__setstate__(self.__getstate__())
        return twin

    def __setstate__(self, state: object) -> None:
        """Become a copy."""
        set_attributes(self, state)


def set_attributes(twin: object, state: object) -> None:
    """Set the attributes of a copy to a state from `object.__getstate__`, without the checks of its class."""
    for part in state if isinstance(state, tuple) else (state,):  # attributes, and those in slots
        for name, value in (part or {}).items():
            object.__setattr__(twin, name, value)


class Immutable:
    """Mix-in: public attributes can be set only by the class itself."""

    _way_out: ClassVar[str]  # the advice in the message

    def __setattr__(self, name: str, value: object) -> None:
        """Refuse to set a public attribute."""
        if name[0] != "_":
            raise ReadOnly(f"{name} of a {type(self).__name__.lower()} cannot be set: {self._way_out}")
        object.__setattr__(self, name, value)

    def _put_public(self, **attributes: object) -> None:
        vars(self).update(attributes)


class ReadOnlyMapping(Mapping[Any, Any]):
    """A read-only view of a dict.

    Unlike `types.MappingProxyType` it can be copied and pickled, and hands the dict to no operator of another object.
    """

    __slots__ = ("_values",)

    def __init__(self, values: Mapping[Any, Any]) -> None:
        self._values = values

    def __getitem__(self, key: object) -> Any:
        try:
            return self._values[key]
        except KeyError:
            raise UnknownName("key", key, self._values) from None

    def __iter__(self) -> Iterator[Any]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __contains__(self, key: object) -> bool:
        return key in self._values

    def __repr__(self) -> str:
        return repr(self._values)

    def __eq__(self, other: object) -> bool:
        # NOTE: `Mapping` makes two dicts for it, a tenth of a turn of two agents with flags (benchmarks: turns).
        return self._values == other if type(other) is dict else super().__eq__(other)

    __hash__ = None  # type: ignore[assignment] # as that of a dict

    def __or__(self, other: Mapping[Any, Any]) -> dict[Any, Any]:
        return {**self, **other}

    def __ror__(self, other: Mapping[Any, Any]) -> dict[Any, Any]:
        return {**other, **self}

    def __deepcopy__(self, memo: dict[int, Any]) -> "ReadOnlyMapping":
        return ReadOnlyMapping(deepcopy(self._values, memo))

    def __reduce__(self) -> tuple[Any, ...]:
        return ReadOnlyMapping, (dict(self._values),)  # a copy, which the caller may write to

    def get(self, key: object, default: object = None) -> Any:
        """Return the value of a key, or the default."""
        return self._values.get(key, default)

    def copy(self) -> dict[Any, Any]:
        """Return a writable dict with the same read-only items."""
        return dict(self._values)

    def _refuse(self, *_: object, **__: object) -> NoReturn:
        raise ReadOnly(
            "This is a read-only view: a strategy changes the game by state['action'] alone, a rule by ctx.game. For a "
            "dict of your own, call its copy()."
        )

    __setitem__ = _refuse
    __delitem__ = _refuse
    __ior__ = _refuse
    clear = _refuse
    pop = _refuse
    popitem = _refuse
    setdefault = _refuse
    update = _refuse


class Shareable:
    """Mix-in: an object that is passed to strategies without copying, because it refuses changes itself."""

    __slots__ = ()


class Unfreezable(GammsError):
    """An object is mutable, and not a container that can be copied read-only."""


def freeze(value: object) -> Any:
    """Return a deep read-only copy.

    Mappings become a `ReadOnlyMapping`, lists and deques tuples, sets frozensets, bytearrays bytes, arrays locked
    copies. Immutable objects, functions and the engines of a context are not copied; other objects are deep-copied.

    Raises:
        BadValue: it is too deep, or contains itself.
    """
    return _walk(value, _freeze, deepcopy)


def make_shareable(name: str, value: object) -> Any:
    """Return a read-only copy that can be shared; like `freeze`, except that other mutable objects are refused.

    Raises:
        BadType: the value contains another mutable object.
        BadValue: it is too deep, or contains itself.
    """
    try:
        return _walk(value, _freeze, _refuse_value)
    except Unfreezable as error:
        raise BadType(
            f"The fact {name!r} has {error} in it, which may change. Publish plain values and arrays, or make the "
            "class an enum, a NamedTuple or a frozen dataclass of such."
        ) from None


def thaw(value: object) -> Any:
    """Return a copy that shares nothing that can change; its containers and arrays may be written to.

    Raises:
        BadValue: it is too deep, or contains itself.
    """
    return _walk(value, _copy, deepcopy)


def _walk(value: object, walk: Callable[[Any, Otherwise], Any], otherwise: Otherwise) -> Any:
    try:
        return walk(value, otherwise)
    except RecursionError:
        raise BadValue("A value is nested too deeply, or contains itself.") from None


def _freeze(value: object, otherwise: Otherwise) -> Any:  # noqa: PLR0911 - one line for each kind of container
    if type(value) in _SCALARS:
        return value
    if isinstance(value, Mapping):
        return ReadOnlyMapping({key: _freeze(one, otherwise) for key, one in value.items()})
    if isinstance(value, tuple):
        return _make_tuple(value, [_freeze(one, otherwise) for one in tuple.__iter__(value)])
    if isinstance(value, (list, deque)):
        return tuple([_freeze(one, otherwise) for one in value])
    if isinstance(value, (set, frozenset)):
        return frozenset(value)
    if isinstance(value, (bytearray, memoryview)):
        return bytes(value)
    if type(value) is np.ndarray:
        return _lock_array(value, otherwise)
    return value if _is_immutable(value) else otherwise(value)


def _copy(value: object, otherwise: Otherwise) -> Any:
    kind = type(value)
    if kind in _SCALARS:
        return value
    if kind is dict:
        return {key: _copy(one, otherwise) for key, one in cast("dict[Any, Any]", value).items()}
    if kind in (list, set, deque):
        return cast("type[list[Any]]", kind)(_copy(one, otherwise) for one in cast("list[Any]", value))
    if isinstance(value, tuple):
        return _make_tuple(value, [_copy(one, otherwise) for one in tuple.__iter__(value)])
    return value if _is_immutable(value) else otherwise(value)


def _make_tuple(value: tuple[Any, ...], items: list[Any]) -> tuple[Any, ...]:
    """Return the tuple itself if its items are unchanged, else a tuple of the same class with the new items."""
    if all(item is own for item, own in zip(items, tuple.__iter__(value), strict=True)):
        return value
    make: Callable[[list[Any]], tuple[Any, ...]] = getattr(type(value), "_make", tuple)
    return make(items)


def copy_locked(array: Array) -> Array:
    """Return a copy of an array of numbers that cannot be written to, nor be made so: its memory is that of `bytes`."""
    memory: Any = array.base
    if isinstance(memory, bytes):
        return array
    return cast("Array", np.ndarray(array.shape, array.dtype, array.tobytes()))


def _lock_array(array: "np.ndarray[Any, Any]", otherwise: Otherwise) -> "np.ndarray[Any, Any]":
    if not array.dtype.hasobject:
        return copy_locked(array)
    copy = np.empty(array.shape, object)
    for place in np.ndindex(array.shape):
        copy[place] = _freeze(array[place], otherwise)
    copy.setflags(write=False)
    return copy


def _is_immutable(value: object) -> bool:
    kind = type(value)
    if isinstance(value, np.generic):
        return kind is not np.void
    if isinstance(value, (*_IMMUTABLE, *_CODE)) or kind.__module__ in _VALUES or kind is type(Ellipsis):
        return True
    if isinstance(value, Shareable) or kind.__module__.startswith("shapely."):
        return True
    if is_dataclass(value) and kind.__dataclass_params__.frozen:  # type: ignore[attr-defined] # every dataclass has it
        parts = [getattr(value, field.name) for field in fields(value)]
        return all(_freeze(part, _refuse_change) is part for part in parts)
    return False


def _refuse_change(_: object) -> Any:
    return object()


def _refuse_value(value: object) -> Any:
    raise Unfreezable(f"an object of the class {type(value).__module__}.{type(value).__qualname__}")


class _MissingAttribute:
    """An attribute that a class lacks: reading it says what to write in its place.

    Unlike `__getattr__`, it costs other attributes nothing, and an attribute that a program sets goes before it.
    """

    def __init__(self, owner: str, name: str, way_out: str) -> None:
        self._refused = owner, name, (), lambda _: f" {way_out}"

    def __get__(self, instance: object, kind: type) -> NoReturn:
        raise UnknownAttribute(*self._refused)


def answer_names(kind: type, owner: str, names: str, way_out: str) -> None:
    """Let objects of a class, which are called `owner`, answer names of other libraries with a sentence."""
    for name in names.split():
        setattr(kind, name, _MissingAttribute(owner, name, way_out))
