"""State of a function that the game does not know: in closures, default arguments, globals and objects."""

import marshal
import random
import sys
from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dis import get_instructions
from functools import cached_property, lru_cache, partial
from gc import get_referents
from itertools import chain, count, repeat
from operator import length_hint
from pathlib import Path
from types import BuiltinMethodType, CodeType, FunctionType, GeneratorType, MethodType, ModuleType
from typing import Any, NamedTuple

import numpy as np

from gamms.errors import BadValue
from gamms.text import shown

_DRAWING = {"random": random, "numpy.random": np.random}  # modules with a generator that all games share
_INSTALLED = {"site-packages", "dist-packages"}
_WITHOUT_REFERENCES = 2  # the last version of marshal in which equal values have equal bytes
_OF_ITERATORS = {"builtins", "itertools"}  # modules: of iter(path), zip(…), cycle(…)


class _Variable(NamedTuple):
    """A variable as it is at a moment."""

    name: str
    image: Any  # equal at two moments if nothing has changed in between
    written: str | None  # the value as text; None: an array of numbers, whose image has all of it

    @property
    def text(self) -> str:
        """The value as text."""
        # NOTE: only for errors: writing an array takes longer than a turn (benchmarks: games of the gallery).
        if self.written is not None:
            return self.written
        kind, shape, numbers = self.image
        return shown(np.frombuffer(numbers, kind).reshape(shape))


_Variables = dict[tuple[int, str], _Variable]
_MISSING = _Variable("", None, "nothing")


class HiddenState:
    """The variables that functions can reach besides their arguments, with their current values.

    These are closure variables, default arguments, globals that they name, attributes of functions and of the object of
    a method, and the same for functions among these. Objects of GAMMS, of Python and of installed packages are not
    searched.

    Args:
        functions: strategies or rules.
    """

    def __init__(self, *functions: Callable[..., object]) -> None:
        self._functions = functions
        self._before = self._read_variables()

    @property
    def image(self) -> object:
        """The names and values as a comparable object; it is equal if all values are."""
        return [(one.name, one.image) for one in self._before.values()]

    def describe_change(self, way_out: str) -> str:
        """Return a sentence about the first variable that has changed since, followed by `way_out`; "" if none has."""
        known = self._looked
        now = self._read_variables()
        for key, one in now.items():
            before = self._before.get(key, _MISSING if key[0] in known else one)
            if one.image != before.image:
                change = "" if one.text == before.text else f" from {before.text} to {one.text}"
                return (
                    f"{one.name} changed{change} in the game, which neither ctx.game.reset nor ctx.game.restore takes "
                    f"back. {way_out} What can be worked out again may be cached by functools.cache."
                )
        return ""

    def _read_variables(self) -> _Variables:
        found = _Variables()
        self._looked = set[int]()
        for function in self._functions:
            _add_variables(function, found, self._looked)
        return found


def find_names(functions: Iterable[Callable[..., object]]) -> Iterator[frozenset[str]]:
    """Yield the names of globals and attributes, and the texts, in the code of each function that functions can reach.

    The functions of GAMMS, of Python and of installed packages are left out.
    """
    for one in _find_all(functions):
        yield _list_names(one.__code__)


def is_drawing_globally(functions: Iterable[Callable[..., object]]) -> bool:
    """Return whether the code of functions, or of those that they call, draws by `random` or `numpy.random` themselves.

    These are the global generators, which all games share. A function that imports one of these modules, or passes it
    on, may draw from its generator, too.
    """
    generators = [random.random.__self__, np.random.rand.__self__]  # type: ignore[attr-defined]
    loaded = chain.from_iterable(_load_values(one, one.__code__) for one in _find_all(functions))
    return any(getattr(value, "__self__", None) is one for value in loaded for one in generators)


def _load_values(function: FunctionType, code: CodeType) -> Iterator[object]:
    """Yield the values of the globals and closure variables that a function loads, and of attributes of modules."""
    cells = dict(zip(function.__code__.co_freevars, function.__closure__ or (), strict=True))
    value: object = None
    for one in get_instructions(code):
        if one.opname == "LOAD_GLOBAL":
            value = function.__globals__.get(one.argval)
        elif one.opname == "LOAD_DEREF" and one.argval in cells:
            value = next(iter(get_referents(cells[one.argval])), None)  # an empty cell has none
        elif one.opname in ("LOAD_ATTR", "LOAD_METHOD") and isinstance(value, ModuleType):
            value = vars(value).get(one.argval)
        elif (one.opname == "IMPORT_NAME" and one.argval in _DRAWING) or any(value is it for it in _DRAWING.values()):
            value = random.random
        else:
            value = None
        yield value
    for within in code.co_consts:
        if isinstance(within, CodeType):
            yield from _load_values(function, within)


def _find_all(functions: Iterable[Callable[..., object]]) -> list[FunctionType]:
    """Return the functions of the program that functions can reach, and themselves."""
    reached = dict[int, Any]()
    for function in functions:
        _reach(function, reached)
    return [one for one in reached.values() if isinstance(one, FunctionType)]


def _reach(function: object, reached: dict[int, Any]) -> None:
    """Add a function of the program, and all that it can reach, by their ids."""
    if id(function) in reached or (isinstance(function, FunctionType) and not _is_of_program(function)):
        return
    reached[id(function)] = function
    values = [value for _, value in _list_named_values(function)]
    if isinstance(function, FunctionType):
        for module in [one for one in values if isinstance(one, ModuleType)]:
            values += [vars(module).get(name) for name in _list_names(function.__code__)]
    else:
        values += _list_methods(type(getattr(function, "__self__", function)))
    for value in values:
        for one in _list_parts(value):
            if callable(one) and not isinstance(one, type):
                _reach(one, reached)


def _list_parts(value: object) -> Iterable[object]:
    """Return a value, or the items of a container, or the methods of a class of the program."""
    if isinstance(value, type):
        return _list_methods(value)
    if isinstance(value, dict):
        return value.values()
    return value if isinstance(value, list | tuple) else [value]


def _list_methods(kind: type) -> list[object]:
    """Return the methods of a class of the program and of its bases that are."""
    return [one for base in kind.__mro__ if _is_of_program(base) for one in vars(base).values()]


@lru_cache(maxsize=1 << 12)
def _list_names(code: CodeType) -> frozenset[str]:
    """Return the names of globals and attributes, and the texts, in a function and its inner functions."""
    texts = [one for one in code.co_consts if isinstance(one, str)]
    within = [_list_names(one) for one in code.co_consts if isinstance(one, CodeType)]
    return frozenset(code.co_names).union(texts, *within)


@contextmanager
def refuse_changes(functions: Iterable[Callable[..., object]], way_out: str) -> Iterator[None]:
    """Raise an error if functions have changed, within the block, state that they can reach besides their arguments.

    Raises:
        BadValue: a variable has changed; the message has its name and the way out.
    """
    hidden = HiddenState(*functions)
    yield
    changed = hidden.describe_change(way_out)
    if changed:
        raise BadValue(changed)


def make_image(made: object) -> object:
    """Return a comparable image of a value, or of the state that a function can reach.

    Equal values have equal images.
    """
    if isinstance(made, Mapping):
        return [(key, make_image(one)) for key, one in made.items()]
    if not callable(made) or isinstance(made, type):
        return _make_image(made, set())
    return HiddenState(made).image


def _add_variables(function: object, found: _Variables, seen: set[int]) -> None:
    """Add the variables that a function can reach, recursively."""
    if id(function) in seen:
        return
    seen.add(id(function))
    is_ours = _find_package(function) == "gamms"
    for name, value in _list_named_values(function):
        if callable(value) and not isinstance(value, type):
            _add_variables(value, found, seen)
        elif not is_ours:
            has_all = type(value) is np.ndarray and not value.dtype.hasobject
            found[id(function), name] = _Variable(name, _make_image(value, set()), None if has_all else shown(value))


def _list_named_values(function: object) -> Iterator[tuple[str, object]]:
    """Yield (description, value) for each variable that a function can reach besides its arguments."""
    if isinstance(function, FunctionType):
        yield from _list_variables(function)
    elif isinstance(function, partial):
        yield "", function.func
        for key, value in [*enumerate(function.args), *function.keywords.items()]:
            yield f"The argument {key!r} of a partial function", value
    elif isinstance(function, MethodType | BuiltinMethodType):
        yield "", getattr(function, "__func__", None)
        own = function.__self__
        name = function.__name__
        yield from _list_attributes(own) if _is_of_program(type(own)) else [(f"The object of the method {name!r}", own)]
    elif hasattr(function, "__wrapped__"):  # made by functools.cache
        yield "", function.__wrapped__
    else:
        yield "", getattr(type(function), "__call__", None)  # noqa: B004 - it is followed, not asked for
        yield from _list_attributes(function)


def _list_variables(function: FunctionType) -> Iterator[tuple[str, object]]:
    whose = f"of {function.__name__}()"
    code = function.__code__
    for name, cell in zip(code.co_freevars, function.__closure__ or (), strict=True):
        try:
            yield f"The closure variable {name!r} {whose}", cell.cell_contents
        except ValueError:  # it has no value yet
            continue
    arguments = code.co_varnames[: code.co_argcount]
    defaults = function.__defaults__ or ()
    last = dict(zip(arguments[len(arguments) - len(defaults) :], defaults, strict=True))
    for name, value in {**last, **(function.__kwdefaults__ or {})}.items():
        yield f"The default argument {name!r} {whose}", value
    for name in _list_globals(code):
        if name in function.__globals__:
            yield f"The global variable {name!r}", function.__globals__[name]
    for name, value in vars(function).items():
        yield f"The attribute {name!r} {whose}", value


@lru_cache(maxsize=1 << 12)
def _list_globals(code: CodeType) -> tuple[str, ...]:
    """Return the names of globals in a function and its inner functions, each once."""
    named = [one.argval for one in get_instructions(code) if one.opname in ("LOAD_GLOBAL", "STORE_GLOBAL")]
    within = [_list_globals(constant) for constant in code.co_consts if isinstance(constant, CodeType)]
    return tuple(dict.fromkeys([*named, *chain(*within)]))


def _list_attributes(owner: object) -> Iterator[tuple[str, object]]:
    """Yield (description, value) for each attribute of a class of the program, or of an object of one."""
    kind = owner if isinstance(owner, type) else type(owner)
    if not _is_of_program(kind):
        return
    named = [vars(one).get("__slots__", ()) for one in kind.__mro__]
    slots = [name for names in named for name in ([names] if isinstance(names, str) else names)]
    values = {name: getattr(owner, name) for name in slots if hasattr(owner, name)} | dict(
        getattr(owner, "__dict__", {})
    )
    for name, value in values.items():
        if not name.startswith("__") and not isinstance(getattr(kind, name, None), cached_property):
            yield f"The attribute {name!r} of {kind.__name__}", value


def _make_image(value: Any, seen: set[int]) -> object:  # Any: whatever a program keeps
    """Return a comparable image of a value; it is equal at another time if the value has not changed."""
    for kinds, image in () if type(value) in _CONTAINERS else _ATOMS:
        if isinstance(value, kinds):
            return image(value)
    if id(value) in seen:
        return None
    seen.add(id(value))
    if isinstance(value, list | tuple | deque):
        return _make_images(value, seen)
    if isinstance(value, set | frozenset):
        return frozenset(_make_image(one, seen) for one in value)
    if isinstance(value, Iterator) and type(value).__module__ in _OF_ITERATORS:
        # Its remaining length and the objects that it iterates over; reading these consumes nothing.
        return length_hint(value), tuple(_make_image(one, seen) for one in get_referents(value))
    pairs = dict(value if isinstance(value, Mapping) else _list_attributes(value))
    return _make_images(pairs.keys(), seen), _make_images(pairs.values(), seen)


def _make_images(values: Collection[Any], seen: set[int]) -> object:
    """Return a comparable image of several values."""
    # NOTE: strategies hold tables of places in closures: a fourth of the time (benchmarks: games of the gallery).
    if _SCALARS.issuperset(map(type, values)):
        return marshal.dumps([*values], _WITHOUT_REFERENCES)
    return tuple([_make_image(one, seen) for one in values])


_CONTAINERS = frozenset({list, tuple, dict})
_SCALARS = frozenset({bool, int, float, complex, str, bytes})
_ATOMS: tuple[tuple[Any, Callable[[Any], object]], ...] = (
    (
        (bool, int, float, complex, str, bytes, bytearray, np.generic, count, repeat),
        lambda one: (type(one).__name__, repr(one)),
    ),
    (np.ndarray, lambda one: (one.dtype.str, one.shape, repr(one) if one.dtype.hasobject else one.tobytes())),
    (random.Random, lambda one: one.getstate()),
    (np.random.Generator, lambda one: repr(one.bit_generator.state)),
    # Generators may carry signals, which are not state of a game.
    ((type(None), FunctionType, ModuleType, GeneratorType), lambda _: None),
)


def _is_of_program(kind: type | FunctionType) -> bool:
    """Return whether a class or a function belongs neither to GAMMS, nor to Python, nor to an installed package."""
    file = getattr(sys.modules.get(kind.__module__), "__file__", None) or ""
    return _find_package(kind) not in {"gamms", *sys.stdlib_module_names} and not _INSTALLED & {*Path(file).parts}


def _find_package(value: object) -> str:
    return str(getattr(value, "__module__", None) or "").partition(".")[0]
