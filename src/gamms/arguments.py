"""Checks of arguments: convert the values of callers to plain values, or raise errors that explain the mistake."""

import math
import os
import re
import sys
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from copy import deepcopy
from enum import Enum
from functools import lru_cache, update_wrapper, wraps
from itertools import islice
from numbers import Real
from operator import index
from typing import TYPE_CHECKING, Any, ParamSpec, Self, SupportsIndex, TypeVar, cast, get_args

from gamms.errors import BadType, BadValue, MissingFolder, UnknownName, nearest
from gamms.text import NamedCall, as_code, shown

if TYPE_CHECKING:
    from inspect import Signature
    from pathlib import Path

    import numpy as np

    Array = np.ndarray[Any, np.dtype[Any]]

P = ParamSpec("P")
T = TypeVar("T")
F = TypeVar("F", bound=Callable[..., Any])
E = TypeVar("E", bound=Enum)
Documented = TypeVar("Documented", bound=Callable[..., Any])

_INT64 = 2**63


def as_int(value: object, name: str) -> int:
    """Return a plain int: ints and NumPy integers pass, bools and everything else do not.

    Raises:
        BadType: `value` is not an integer.
        BadValue: it does not fit into 64 bits.
    """
    try:
        number = convert_index(value)
    except TypeError:
        raise BadType(f"{name} must be an integer, not {shown(value)} ({type(value).__name__}).") from None
    if not -_INT64 <= number < _INT64:
        raise BadValue(f"{name} must fit into 64 bits, not {shown(number)}.")
    return number


def convert_index(value: object) -> int:
    """Return the plain int of an integer of any type.

    Raises:
        TypeError: `value` is not an integer; bools are refused, including NumPy's, which old NumPy versions accept.
    """
    if type(value).__name__ in ("bool", "bool_"):
        raise TypeError(value)
    return int(index(value))  # type: ignore[arg-type] # the error is the check


def as_items(values: object, name: str, form: str) -> list[Any]:
    """Return the items of an iterable as a list; `form` describes the items in messages, such as "integers".

    Raises:
        BadType: the value is not an iterable, or is a text.
    """
    if isinstance(values, (str, bytes)) or not isinstance(values, Iterable) or getattr(values, "ndim", 1) != 1:
        raise BadType(f"{name} must be a list of {form}, not {shown(values)} ({type(values).__name__}).")
    return list(values)


def as_ids(values: object, name: str) -> list[int]:
    """Return a list of plain ints, from any iterable of integers, such as an array.

    Raises:
        BadType: the value is not an iterable, or an item is not an integer.
        BadValue: an item does not fit into 64 bits.
    """
    of_array: Any = getattr(values, "dtype", None)
    if getattr(of_array, "kind", None) == "i" and getattr(values, "ndim", 0) == 1:
        listed: list[int] = values.tolist()  # type: ignore[attr-defined] # of NumPy
        return listed
    return [as_int(one, f"Each of {name}") for one in as_items(values, name, "integers")]


_NUMBERS = ("iufb", "float64")
_KINDS = {"integers": ("iu", "int64"), "booleans": ("b", "bool")}
_BOUNDS = {"probabilities": (1.0, "from 0 to 1"), "weights": (math.inf, "finite and not negative")}


def as_array(given: object, name: str, form: str, shape: tuple[int, ...] | None = None) -> "Array":
    """Convert an array, a scalar or nested lists to an array, if possible without copying.

    Args:
        given: the value.
        name: the name of the argument.
        form: "integers", "booleans" or "numbers"; "probabilities" are numbers from 0 to 1, "weights" from 0 on.
        shape: the shape to which the array must broadcast; None: any.

    Raises:
        BadType: the value has items of another type, or lists of different lengths.
        BadValue: the shape is wrong, or a number is out of range.
    """
    import numpy as np

    kinds, dtype = _KINDS.get(form, _NUMBERS)
    try:
        array = np.asarray(given)
    except (ValueError, TypeError):  # lists of different lengths, or items without a length
        array = np.empty(1, object)
    if array.dtype.kind not in kinds:
        if array.size:
            raise BadType(f"{name} must be an array of {form}, not {shown(given)}.")
        array = array.astype(dtype)
    if form in _BOUNDS:
        most, described = _BOUNDS[form]
        is_such = np.isfinite(array) & (array >= 0) & (array <= most)
        if not is_such.all():
            raise BadValue(f"{name} must be {described}, not {array[~is_such][0]}.")
    return array if shape is None or array.shape == shape else as_one_shape({name: array}, shape)[0]


def as_one_shape(arrays: Mapping[str, Any], shape: tuple[int, ...] | None = None) -> "list[Array]":
    """Broadcast arrays, by argument name, to one common or given shape.

    Raises:
        BadValue: the shapes do not match.
    """
    import numpy as np

    try:
        if shape is None:
            return [*np.broadcast_arrays(*arrays.values())]
        return [np.broadcast_to(array, shape) for array in arrays.values()]
    except ValueError:
        has = " and ".join(f"{name} has the shape {array.shape}" for name, array in arrays.items())
        raise BadValue(f"{has}, which does not broadcast to {shape or 'one shape'}.") from None


def as_numbers_of(given: object, name: str, count: int, kind: str) -> "Array":
    """Convert a value to an array of indices from 0 to `count` - 1, such as node rows.

    Args:
        given: the value that the caller passed.
        name: the name of the argument.
        count: the number of objects.
        kind: the kind of the objects, such as "nodes".

    Raises:
        BadType: the values are not integers.
        BadValue: an index is out of range.
    """
    numbers = as_array(given, name, "integers")
    # NOTE: one comparison, for a negative number is a large one without its sign (benchmarks: learning).
    signed = numbers.astype("int64", copy=False)
    if signed.size and signed.view("uint64").max() >= count:
        wrong = signed[(signed < 0) | (signed >= count)]
        raise BadValue(f"{name}: {wrong.flat[0]} is out of range; the {count} {kind} are numbered from 0.")
    return signed


def as_edges(given: object, name: str, shape: tuple[int, ...]) -> "Array":
    """Return the ids of the edges that agents take, an array of a shape, with -1 for agents that take none.

    Raises:
        BadType: the values are not integers.
        BadValue: they have another shape, or one is below -1.
    """
    edges = as_array(given, name, "integers", shape)
    wrong = edges[edges < -1]
    if wrong.size:
        raise BadValue(f"{name} must be ids of edges from 0, or -1 for agents that take none, not {wrong[0]}.")
    return edges


def as_bool(value: object, name: str) -> bool:
    """Return a plain bool: 0, 1 and NumPy's bools pass.

    Raises:
        BadType: the value is not a bool.
    """
    plain: object = value.item() if getattr(value, "size", 0) == 1 else value  # type: ignore[attr-defined] # NumPy's
    if not isinstance(plain, int) or plain not in (0, 1):
        raise BadType(f"{name} must be True or False, not {shown(value)} ({type(value).__name__}).")
    return bool(plain)


def as_flag(value: object, name: str) -> bool:
    """Return a bool; unlike `as_bool`, 0 and 1 are refused.

    Raises:
        BadType: it is something else.
    """
    if not isinstance(value, bool):
        raise BadType(f"{name} must be True or False, not {shown(value)}.")
    return value


def as_count(value: object, name: str, least: int = 1, *, hint: str = "") -> int:
    """Return a plain int that is at least `least`; `hint` ends the error message, for example with a valid alternative.

    Raises:
        BadType: `value` is not an integer.
        BadValue: it is less.
    """
    number = as_int(value, name)
    if number < least:
        form = f"be at least {least}" if least else "not be negative"
        raise BadValue(f"{name} must {form}, not {shown(number)}{hint or '.'}")
    return number


def as_choice(value: object, name: str, known: Sequence[str]) -> str:
    """Return a text if it is one of the allowed ones.

    Raises:
        BadValue: it is not.
    """
    if not isinstance(value, str) or value not in known:
        raise BadValue(f"{name} must be {' or '.join(map(repr, known))}, not {shown(value)}.{nearest(value, known)}")
    return value


def as_known(value: T, kind: str, known: Collection[Any]) -> T:
    """Return a name if it is one of the known names.

    Raises:
        UnknownName (KeyError): the name is unknown; the message lists the known names.
    """
    if value not in known:
        raise UnknownName(kind, value, known)
    return value


def refuse_keywords(given: Iterable[str], known: Collection[str], taker: str, hint: str = "") -> None:
    """Raise for unknown keywords; `hint` ends the message unless a keyword is similar to a known one.

    Raises:
        BadType: a keyword is unknown.
    """
    for name in given:
        if name not in known:
            way_out = nearest(name, known) or hint or f" There are: {', '.join(known)}."
            raise BadType(f"{taker} takes no keyword {shown(name)}.{way_out}")


def explain_call_errors(function: Callable[P, T], hint: str = "") -> Callable[P, T]:
    """Decorate a function: errors about arguments that do not fit show how it is called.

    An error about an unknown keyword names the most similar one; `**` takes all keywords.
    """
    code: Any = getattr(function, "__code__", None)
    takes_all = bool(code.co_flags & _KEYWORDS)
    known = [name for name in code.co_varnames[: code.co_argcount + code.co_kwonlyargcount] if name != "self"]
    taker = function.__qualname__.removesuffix(".__init__").rpartition(".")[2]

    @wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> T:
        if not takes_all:
            refuse_keywords(kwargs, known, taker, hint)
        try:
            return function(*args, **kwargs)
        except TypeError as error:
            refuse_call(error, function, taker, args, kwargs)
            raise

    return call


class DescribedFunction(NamedCall):
    """A function returned by a factory: it prints as the factory call, and is not pickled."""

    def __reduce_ex__(self, protocol: SupportsIndex) -> Any:  # Any: as pickle calls it
        """Refuse to be pickled, unless the function can be found by its name.

        Raises:
            BadType: it cannot be found, because a program makes it.
        """
        from pickle import dumps  # which few need

        try:
            dumps(self.func)
        except Exception:  # noqa: BLE001 - of any kind, by what the function holds
            raise BadType(
                f"{self.call} cannot be pickled, because a program makes it. Make it in the other process, or name it "
                "in a scenario."
            ) from None
        return super().__reduce_ex__(protocol)

    def __copy__(self) -> Self:
        return self.__deepcopy__(None)

    def __deepcopy__(self, memo: dict[int, Any] | None) -> Self:
        """Return a copy of the function with its attributes; deep, if there is a memo."""
        make, arguments, state = cast("tuple[Any, ...]", super().__reduce__())
        twin: Any = make(*arguments)
        twin.__setstate__(state if memo is None else deepcopy(state, memo))
        return cast("Self", twin)


def refuse_context(use: str) -> Callable[[Callable[P, T]], Callable[P, T]]:
    """Decorate a function that makes a part of a map: a context among its arguments is an error.

    Args:
        use: how a context gets the result, with `{name}` for the name of the function.
    """

    def decorate(function: Callable[P, T]) -> Callable[P, T]:
        checked = explain_call_errors(function)
        way_out = use.format(name=function.__name__)

        @wraps(function)
        def call(*args: P.args, **kwargs: P.kwargs) -> T:
            if any(map(is_context, args)):
                raise BadType(f"{function.__name__} takes no context. The context gets what it returns: {way_out}.")
            return checked(*args, **kwargs)

        return call

    return decorate


_FEW_NAMES = 6  # of the optional parameters that the form of a call lists
_MISSING = re.compile(r"missing a required (?:keyword-only )?argument: ('\w+')")


def refuse_call(
    error: TypeError, function: Callable[..., object], name: str, args: tuple[Any, ...], kwargs: Mapping[str, object]
) -> None:
    """Raise an error that shows how a function is called, if the arguments of a call do not fit its parameters.

    Args:
        error: the error of the call, caught where it was made.
        function: the function; a first parameter `self` is not shown.
        name: what programs call it, such as "ctx.game.publish".
        args: the arguments without names.
        kwargs: the arguments with names.

    Raises:
        BadType: the arguments do not fit the parameters; other errors are not touched.
    """
    if error.__traceback__ is None or error.__traceback__.tb_next is not None:
        return  # raised by the code of the function
    signature = find_signature(function)
    try:
        signature.bind(*args, **kwargs)
    except TypeError as flaw:
        words = _MISSING.sub(r"\1 is missing", str(flaw)).replace("positional arguments", "arguments without a name")
        said = f"{words}."
        takes_all = any(one.kind is one.VAR_KEYWORD for one in signature.parameters.values())
        unknown = None if takes_all else next((key for key in kwargs if key not in signature.parameters), None)
        if unknown is not None:
            said = f"it takes no keyword {shown(unknown)}.{nearest(unknown, signature.parameters)}"
        raise BadType(f"{name} is called as {describe_call(name, signature)}; {said}") from None


def describe_call(name: str, signature: "Signature") -> str:
    """Return how a function is called: its parameters without types, and the first few optional ones."""
    parts: list[str] = []
    optional = 0
    for one in signature.parameters.values():
        if one.kind is one.VAR_POSITIONAL:
            parts.append(f"*{one.name}")
        elif one.kind is one.VAR_KEYWORD:
            parts.append(f"**{one.name}")
        elif one.default is one.empty:
            parts.append(f"{one.name}=…" if one.kind is one.KEYWORD_ONLY else one.name)
        elif optional < _FEW_NAMES:
            optional += 1
            parts.append(f"{one.name}=…")
        elif optional == _FEW_NAMES:
            optional += 1
            parts.append("…")
    return f"{name.rpartition('.')[2]}({', '.join(part for part in parts if part != 'self')})"


def show_as_call(make: Callable[P, F]) -> Callable[P, F]:
    """Decorate a factory: the rules and other functions that it makes print as its call; see `explain_call_errors`.

    A first argument `ctx` prints as `ctx`.
    """
    code: Any = getattr(make, "__code__", None)
    words = ["ctx"] if code.co_varnames[:1] == ("ctx",) else []
    checked = explain_call_errors(make)

    @wraps(make)
    def call(*args: P.args, **kwargs: P.kwargs) -> F:
        function: Any = checked(*args, **kwargs)
        made: Any = update_wrapper(DescribedFunction(function), function)
        del made.__wrapped__
        made.__name__ = getattr(function, "__name__", make.__name__)
        made.__qualname__ = f"{make.__qualname__}.<locals>.{made.__name__}"  # not of a factory that this one calls
        given = [*(words if args else ()), *map(as_code, args[len(words) :])]
        named = [f"{name}={name if name in words else as_code(value)}" for name, value in kwargs.items()]
        made.call = f"{make.__name__}({', '.join([*given, *named])})"
        return cast("F", made)

    return call


def as_float(value: object, name: str) -> float:
    """Return a plain, finite float.

    Raises:
        BadType: `value` is not a real number.
        BadValue: it is NaN or infinite, or does not fit into a float.
    """
    if type(value) is float and math.isfinite(value):
        return value
    if isinstance(value, bool) or not (isinstance(value, Real) or hasattr(value, "__float__")):
        raise BadType(f"{name} must be a number, not {shown(value)} ({type(value).__name__}).")
    try:
        number = float(value)
    except OverflowError:
        raise BadValue(f"{name} must fit into a float, not {shown(value)}.") from None
    except (TypeError, ValueError) as error:
        raise BadType(f"{name} must be a number, not {shown(value)}: {error}.") from None
    if not math.isfinite(number):
        raise BadValue(f"{name} must be finite, not {number}.")
    return number


def as_positive(value: object, name: str, *, hint: str = "") -> float:
    """Return a plain, finite float that is more than 0; `hint` is the end of the message.

    Raises:
        BadType: `value` is not a real number.
        BadValue: it is 0 or less, NaN or infinite, or does not fit into a float.
    """
    number = as_float(value, name)
    if number <= 0.0:
        raise BadValue(f"{name} must be more than 0, not {number:g}{hint or '.'}")
    return number


def as_range(value: object, name: str) -> float:
    """Return a distance, which may be infinite, but neither negative nor NaN.

    Raises:
        BadType: `value` is not a real number.
        BadValue: it is negative or NaN.
    """
    if isinstance(value, Real) and value == math.inf:
        return math.inf
    number = as_float(value, name)
    if number < 0.0:
        raise BadValue(f"{name} must not be negative, not {number}.")
    return number


_FINER_UNITS = (("milliseconds", 1e14, "1,000"), ("microseconds", 1e17, "1,000,000"), ("nanoseconds", math.inf, "1e9"))
_LATEST_S = 1e11  # seconds since 1970 in the year 5138; milliseconds since 1970 are more from 1973 on


def is_finer_time(seconds: float) -> bool:
    """Return whether a time is too large for seconds since 1970, because it has a finer unit."""
    return abs(seconds) >= _LATEST_S


def refuse_finer_time(seconds: float, name: str) -> None:
    """Refuse a time that is too large for seconds since 1970, because it has a finer unit (BadValue)."""
    for unit, most, divisor in _FINER_UNITS:
        if is_finer_time(seconds) and abs(seconds) < most:
            raise BadValue(
                f"{name} is {seconds:.0f}, which is no number of seconds since 1970; it may be {unit}. Divide times by "
                f"{divisor}, or write them like 2025-06-15T15:06:40Z."
            )


def as_numbers(value: object, name: str, form: str) -> list[float]:
    """Return a list of finite floats, one for each name in `form`, such as "(x, y, z)".

    Raises:
        BadType: `value` is not a sequence of numbers.
        BadValue: there are more or fewer, or one is NaN or infinite.
    """
    if not (hasattr(value, "__getitem__") and hasattr(value, "__len__")) or isinstance(value, (str, bytes, Mapping)):
        raise BadType(f"{name} must be {form}, not {shown(value)} ({type(value).__name__}).")
    parts = cast("Sequence[object]", value)  # or an array
    if getattr(value, "ndim", 1) != 1 or len(parts) != form.count(",") + 1:
        raise BadValue(f"{name} must be {form}, not {shown(value)}.")
    of_each = f"Every part of {name[:1].lower() + name[1:]} {form}"
    return [as_float(part, of_each) for part in parts]


def as_name(value: object, kind: str) -> str:
    """Return the name of something.

    Raises:
        BadType: `value` is not a string.
        BadValue: it is empty.
    """
    if not isinstance(value, str):
        raise BadType(f"The name of {kind} must be a string, not {shown(value)} ({type(value).__name__}).")
    if not value:
        raise BadValue(f"The name of {kind} must not be empty.")
    return value


def as_key(value: T, name: str) -> T:
    """Check that a value may be a key of a dict and can be written out.

    Raises:
        BadType: it is not hashable, or an integer with more digits than Python writes.
    """
    try:
        hash(value), str(value)
    except (TypeError, ValueError):
        raise BadType(
            f"{name} must be a value such as a text or a number, not {shown(value)} ({type(value).__name__})."
        ) from None
    return value


def as_mapping(value: object, name: str) -> Mapping[Any, Any]:
    """Check that a value is a mapping, such as a dict.

    Raises:
        BadType: it is not.
    """
    if not isinstance(value, Mapping):
        raise BadType(f"{name} must be a dict, not {shown(value)} ({type(value).__name__}).")
    return value


def is_context(value: object) -> bool:
    """Return whether a value is a context."""
    return hasattr(value, "graph") and hasattr(value, "agent")


def as_context(value: T, caller: str, form: str = "") -> T:
    """Check that a value is a context.

    Args:
        value: the value.
        caller: the function that takes it.
        form: how the function is called, for messages.

    Raises:
        BadType: it is not.
    """
    if not is_context(value):
        way_out = f" Call it as {form}." if form else ""
        raise BadType(f"{caller} takes a context, as gamms.create_context gives it, not {shown(value)}.{way_out}")
    return value


def as_recording(value: T, caller: str) -> T:
    """Check that a value is an open recording.

    Raises:
        BadType: it is not.
    """
    if not hasattr(value, "header"):
        raise BadType(f"{caller} takes a recording, as gamms.recorder.open gives it, not {shown(value)}.")
    return value


def as_text(value: object, name: str, form: str = "a string") -> str:
    """Return plain Unicode text.

    Raises:
        BadType: it is not a text.
        BadValue: the text contains a lone surrogate, which files cannot store.
    """
    if not isinstance(value, str):
        raise BadType(f"{name} must be {form}, not {shown(value)} ({type(value).__name__}).")
    text = str.__str__(value)
    if not text.isascii() and any("\ud800" <= one <= "\udfff" for one in text):
        raise BadValue(f"{name} must be valid Unicode, not {shown(value)}: it has a lone surrogate.")
    return text


_VARIADIC = 0x04  # the flag of code objects that take *args
_KEYWORDS = 0x08  # the flag of code objects that take **kwargs
_GENERATOR = 0x220  # the flags of generators


def as_function_of(value: object, name: str, argument: str, most: int = 1) -> Any:
    """Check that a value can be called with one argument, such as a strategy or a rule.

    Args:
        value: the value.
        name: its role in messages, such as "A strategy".
        argument: the argument in messages, such as "the state".
        most: the maximum number of arguments.

    Raises:
        BadType: the value cannot be called in this way, or it is a factory such as `gamms.rules.tag` that was not
            called.
    """
    if not callable(value):
        hint = "; pass a function itself, without calling it." if value is None else "."
        raise BadType(f"{name} must be a function of {argument}, not {shown(value)} ({type(value).__name__}){hint}")
    made_by = getattr(value, "__name__", "it")
    if getattr(find_annotations(value).get("return"), "__origin__", None) is Callable:
        raise BadType(f"{made_by} makes such a function: call it, {made_by}(…), and pass what it returns.")
    if not _is_accepting(value, 1) and (most == 1 or not _is_accepting(value, most)):
        raise BadType(
            f"{name} must be a function of {argument} alone, and {made_by}{find_signature(value)} is not. If it "
            f"makes such a function, call it, {made_by}(…), and pass what it returns."
        )
    if isinstance(value, type) and _is_without_arguments(value):
        raise BadType(
            f"{name} must be a function of {argument}, and {made_by} is a class: pass an object of it, {made_by}(), "
            f"which is called with {argument}."
        )
    code = getattr(getattr(value, "__func__", value), "__code__", None)
    if code is not None and code.co_flags & _GENERATOR:
        raise BadType(f"{name} must not be a generator, and {made_by} has a yield: nothing of it would be done.")
    return value


def _is_without_arguments(kind: type) -> bool:
    """Return whether a class makes objects without arguments, so that a call with an argument fails."""
    makers = (type(kind), "__call__"), (kind, "__init__"), (kind, "__new__")
    usual: list[object] = [type.__call__, object.__init__, object.__new__]
    return [getattr(owner, name) for owner, name in makers] == usual


def _is_accepting(function: Callable[..., Any], given: int) -> bool:
    """Return whether a Python function accepts a number of arguments; True for other callables."""
    # NOTE: from the code object, because inspect.signature takes 10 us and every agent comes here.
    bound = int(hasattr(function, "__self__"))
    plain = getattr(function, "__func__", function)
    code = getattr(plain, "__code__", None)
    if code is None:
        return True
    required = code.co_argcount - bound - len(plain.__defaults__ or ())
    missing = code.co_kwonlyargcount - len(plain.__kwdefaults__ or ())
    has_places = code.co_argcount - bound >= given or bool(code.co_flags & _VARIADIC)
    return required <= given and missing <= 0 and has_places


def find_annotations(function: object) -> dict[str, Any]:
    """Return the annotations of a function; {} if they cannot be evaluated, which can happen since Python 3.14."""
    try:
        return getattr(function, "__annotations__", {})
    except Exception:  # noqa: BLE001 - whatever a caller's expression raises, such as a name for type checkers alone
        return {}


def find_signature(function: Callable[..., Any]) -> "Signature":
    """Return the signature of a function, also if its annotations cannot be evaluated.

    Raises:
        TypeError, ValueError: it is written in C and has none.
    """
    from inspect import signature

    if sys.version_info >= (3, 14):
        from annotationlib import Format

        return signature(function, annotation_format=Format.FORWARDREF)
    else:  # noqa: RET505 - so that type checkers see one of them
        return signature(function)


class _DependentDefault:
    """The default in a signature if the actual default depends on other arguments."""

    def __repr__(self) -> str:
        return "..."


_DOTS = _DependentDefault()


def spell_out_options(*inherited: type, **defaults: object) -> Callable[[Documented], Documented]:
    """Spell out the keywords of `**options: Unpack[…]` in the signature and the docstring of a function.

    The attributes of the TypedDict replace the entry `options` of the docstring.

    Args:
        inherited: the parents of the TypedDict, whose attributes come first; at run time, a TypedDict does not know
            its parents.
        defaults: the defaults that the signature shows; other keywords have dots. Options of the type `Never`, which
            only raise an error, are not shown.
    """
    from inspect import Parameter, cleandoc

    def shown_in(function: Documented) -> Documented:
        signature = find_signature(function)
        *others, rest = signature.parameters.values()
        options = next(iter(get_args(rest.annotation)), None)
        for name, kind in find_annotations(options).items():
            others.append(Parameter(name, Parameter.KEYWORD_ONLY, default=defaults.get(name, _DOTS), annotation=kind))
        shown_signature = remove_long_types(signature.replace(parameters=others))
        function.__signature__ = shown_signature  # type: ignore[attr-defined] # inspect reads it
        if function.__doc__ and options is not None:  # Python may run without docstrings
            described = [cleandoc(one.__doc__ or "") for one in (*inherited, options)]
            function.__doc__ = add_attributes(cleandoc(function.__doc__), rest.name, described)
        return function

    return shown_in


_LONG_TYPE = 24  # characters of a type that `help` shows


def remove_long_types(signature: "Signature") -> "Signature":
    """Return a signature without types that are too long to read in `help`; the docstring describes the arguments."""
    from inspect import Parameter, Signature, formatannotation

    def is_long(annotation: object) -> bool:
        return annotation is not Parameter.empty and len(formatannotation(annotation)) > _LONG_TYPE

    parameters = [
        one.replace(annotation=Parameter.empty) if is_long(one.annotation) else one
        for one in signature.parameters.values()
    ]
    result = Signature.empty if is_long(signature.return_annotation) else signature.return_annotation
    return signature.replace(parameters=parameters, return_annotation=result)


def add_attributes(text: str, entry: str, described: Iterable[str]) -> str:
    """Return a dedented docstring with an entry replaced by the attributes in other docstrings."""
    parts = [one.partition("\nAttributes:\n")[2].rstrip() for one in described]
    attributes = "\n".join(filter(None, parts))
    place = re.compile(rf"^    {entry}: .*(?:\n {{5,}}.*)*", re.MULTILINE)
    return place.sub(lambda found: attributes or found[0], text)


def as_declared(contract: Callable[..., Any]) -> Callable[[Documented], Documented]:
    """Show the signature and the docstring of the method of a contract, for the one that implements it."""

    def shown_in(method: Documented) -> Documented:
        method.__signature__ = remove_long_types(find_signature(contract))  # type: ignore[attr-defined] # inspect reads it
        method.__doc__ = contract.__doc__
        return method

    return shown_in


def as_member(kind: type[E], value: object) -> E | None:
    """Return an enum member, given as a member or by name in any case; None if the value is neither."""
    if isinstance(value, kind):
        return value
    return kind.__members__.get(value.rpartition(".")[2].upper()) if isinstance(value, str) else None


def as_path(value: object, name: str) -> "Path":
    """Return a path.

    Raises:
        BadType: `value` is neither a string nor a path.
        BadValue: the path contains characters that no file name can have.
    """
    text = os.fspath(value) if isinstance(value, (str, os.PathLike)) else None
    if not isinstance(text, str):
        raise BadType(f"{name} must be a path, not {shown(value)} ({type(value).__name__}).")
    try:
        is_path = b"\0" not in os.fsencode(text)
    except UnicodeEncodeError:
        is_path = False
    if not is_path:
        raise BadValue(f"{name} must be a path that a file can have, not {shown(value)}.")
    from pathlib import Path  # which takes longer to load than most of GAMMS

    return Path(text)


def as_target(value: object) -> "Path":
    """Return the path of an output file, whose folder must exist.

    Raises:
        BadType, BadValue: the value is not a path.
        MissingFolder (FileNotFoundError): the folder does not exist.
    """
    file = as_path(value, "path")
    if not file.absolute().parent.is_dir():
        raise MissingFolder(file.name, file.parent)
    return file


_RENDERED = "`gamms render {stem}.ggr {name}` makes {name!r} of a recording."
_CONVERTED = "`gamms convert {stem}.ggr {name}` makes {name!r} of a recording."
_WRITERS = {  # suffix -> what writes such files
    **dict.fromkeys((".mp4", ".gif", ".svg", ".png", ".pdf", ".html"), _RENDERED),
    **dict.fromkeys((".csv", ".jsonl", ".gpx"), _CONVERTED),
    **dict.fromkeys((".graphml", ".geojson", ".gpkg"), "ctx.graph.export({name!r}) writes a graph."),
    ".ggr": "ctx.game.run(record={name!r}) writes a recording.",
    ".gamms": "ctx.graph.save({name!r}) writes a graph.",
}


def refuse_suffix(file: "Path", kind: str, own: str) -> None:
    """Refuse a file name whose suffix belongs to files that another call writes.

    Args:
        file: the file that would be written.
        kind: its kind in messages, such as "A recording".
        own: the suffix of this kind.

    Raises:
        BadValue: the suffix belongs to another kind of file.
    """
    suffix = file.suffix.lower()
    if suffix in _WRITERS and suffix != own:
        writer = _WRITERS[suffix].format(stem=file.stem, name=file.name)
        raise BadValue(f"{kind} is a file {own}, not {suffix}: name it '{file.stem}{own}'. {writer}")


_MANY = 16  # keywords
_MISSPELT = 0.8  # how much a keyword is like the one that is meant: `start` is an attribute, and not `strategy`


def explain_misspelled(given: Collection[str], known: Collection[str], kind: str = "keyword") -> list[str]:
    """Return a sentence for each given keyword that is unknown but looks like a known one; of many, for the first.

    Unknown names are allowed here, so only names very similar to a missing one are returned. `kind` says what
    they are.
    """
    missing = tuple([name for name in known if name not in given])
    unknown = islice((name for name in given if name not in known), _MANY)
    return [
        f"Unknown {kind} {shown(name)}.{hint}" for name in unknown if (hint := _describe_misspelling(name, missing))
    ]


@lru_cache(maxsize=64, typed=True)
def _describe_misspelling(name: str, missing: tuple[str, ...]) -> str:
    """Return the hint that a name resembles a missing one; cached, because agents have the same attributes."""
    return nearest(name, missing, _MISSPELT)
