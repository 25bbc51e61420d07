"""Runs the code that a scenario names: imports it, and makes strategies and rules with it."""

import importlib
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial, update_wrapper
from inspect import Parameter, signature
from pathlib import Path
from types import ModuleType
from typing import Any

from gamms.context import Context
from gamms.errors import nearest
from gamms.scenario.documents import ScenarioError, joined
from gamms.scenario.references import Found, Sources, find, is_defined_in, private_package
from gamms.text import shown

_stamps: dict[str, dict[Path, tuple[int, int]]] = {}  # private package -> when its files were written, and how long


class Library:
    """The functions that a scenario has asked for; each is looked for once.

    Args:
        sources: where they may be.
    """

    def __init__(self, sources: Sources) -> None:
        self._sources = sources
        self._known: dict[str, Callable[..., Any]] = {}

    def get(self, text: str, path: str, short: str | None = None) -> Callable[..., Any]:
        """Return the function of a reference; see `find`.

        Raises:
            ScenarioError: there is none; it names the path.
        """
        key = _key(text, short)
        if key not in self._known:
            self._known[key] = function_of(find(text, self._sources, path, short=short), self._sources.folder)
        return self._known[key]

    def known(self, text: str, short: str | None = None) -> Callable[..., Any] | None:
        """Return the function of a reference if something has asked for it; else None, and nothing is imported."""
        return self._known.get(_key(text, short))


def _key(text: str, short: str | None) -> str:
    return f"{short}:{text}" if short and ":" not in text else text


def function_of(found: Found, folder: Path | None) -> Callable[..., Any]:
    """Import the code of a reference.

    A module from the folder gets a private name, so that `strategies.py` of two scenarios are two modules, and
    `sys.path` stays as it is. Its neighbours are there by relative imports. Nothing is written beside it.

    Raises:
        ScenarioError: importing it raises, which is then the cause; it has no such function, or one from elsewhere.
    """
    with _raising(found.path, f"importing {found.text!r} failed:"):
        module = importlib.import_module(found.module) if found.file is None else _private(found, folder or Path())
        function = getattr(module, found.wanted, None)
    if not callable(function):
        hint = nearest(found.wanted, [name for name in vars(module) if not name.startswith("_")])
        raise ScenarioError(found.path, f"there is no function {found.wanted!r} in {found.text!r}.{hint}")
    if found.owner is not None and not is_defined_in(function, found.owner):
        raise ScenarioError(
            found.path,
            f"{found.wanted!r} in {found.text!r} is from elsewhere, {getattr(function, '__module__', 'nowhere')}. A "
            "scenario may name what is defined there: write a function that calls it.",
        )
    return function  # type: ignore[no-any-return] # it can be called


@contextmanager
def _raising(path: str, what: str) -> Iterator[None]:
    """Say of an error of the scenario's code where the scenario names the code; of SystemExit, too.

    Raises:
        ScenarioError: in its place.
    """
    try:
        yield
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        raise ScenarioError(path, f"{what} {type(error).__name__}: {error}") from error


def _private(found: Found, folder: Path) -> ModuleType:
    """Import a module of a scenario under a private name; again if its file has changed."""
    folder = folder.resolve()
    package = private_package(folder)
    stamps = _stamps.setdefault(package, {})
    if any(_stamp(file) != stamp for file, stamp in stamps.items()):
        for name in [name for name in sys.modules if name.partition(".")[0] == package]:
            del sys.modules[name]
        stamps.clear()
    if package not in sys.modules:
        sys.modules[package] = ModuleType(package)
        sys.modules[package].__path__ = [str(folder)]
    importlib.invalidate_caches()
    before, sys.dont_write_bytecode = sys.dont_write_bytecode, True
    try:
        module = importlib.import_module(f"{package}.{found.module}")
    finally:
        sys.dont_write_bytecode = before
    if found.file is not None:
        stamps[found.file] = _stamp(found.file)
    return module


def _stamp(file: Path) -> tuple[int, int]:
    try:
        status = file.stat()
    except OSError:
        return (0, 0)
    return (status.st_mtime_ns, status.st_size)


def strategy_of(function: Callable[..., Any], given: Mapping[str, Any] | None, ctx: Context, path: str) -> Any:
    """Return the strategy that a function is, or makes.

    A function whose first parameter is `state`, or that takes something and is given nothing, is the strategy. One
    whose first parameter is `ctx`, that takes nothing, or that is given parameters, makes it.

    Raises:
        ScenarioError: the parameters do not fit, or what it makes is not a function.
    """
    return _decider_of(function, given, ctx, path, ("state",), "strategy")


def plan_of(function: Callable[..., Any], given: Mapping[str, Any] | None, ctx: Context, path: str) -> Any:
    """Return the plan that a function is, or makes; as `strategy_of`, but with `states` or `arrays` first.

    Raises:
        ScenarioError: the parameters do not fit, or what it makes is not a function.
    """
    return _decider_of(function, given, ctx, path, ("states", "arrays"), "plan")


def _decider_of(
    function: Callable[..., Any],
    given: Mapping[str, Any] | None,
    ctx: Context,
    path: str,
    arguments: tuple[str, ...],
    what: str,
) -> Any:
    first, takes_any = first_of(function), needs(function)
    if first in arguments or (first != "ctx" and not given and takes_any):
        return _bound(function, (None,), given, path)
    return made(function, given, (ctx,) if first == "ctx" else (), path, what)


def rule_of(function: Callable[..., Any], given: Mapping[str, Any] | None, path: str) -> Any:
    """Return the rule that a function is, or makes.

    A function whose first parameter is `ctx`, or that needs something and is given nothing, is the rule. Any other
    makes it.

    Raises:
        ScenarioError: the parameters do not fit, or what it makes is not a function.
    """
    if first_of(function) == "state":
        raise ScenarioError(
            path, f"{getattr(function, '__name__', function)} takes a state: it is not a rule, but a strategy."
        )
    if first_of(function) == "ctx" or (not given and needs(function)):
        return _bound(function, (None,), given, path)
    return made(function, given, (), path, "rule")


def made(
    function: Callable[..., Any], given: Mapping[str, Any] | None, first: tuple[Any, ...], path: str, what: str
) -> Any:
    """Return what a function makes of its parameters; it can be called.

    Raises:
        ScenarioError: the parameters do not fit, the function raises, or what it makes cannot be called.
    """
    one = called(function, given, first, path)
    if not callable(one):
        name = getattr(function, "__name__", function)
        raise ScenarioError(path, f"{name} gives {shown(one)}, which is not a {what}.")
    return one


def called(function: Callable[..., Any], given: Mapping[str, Any] | None, first: tuple[Any, ...], path: str) -> Any:
    """Call a function.

    Raises:
        ScenarioError: the parameters do not fit, or the function raises, which is then the cause.
    """
    check_parameters(function, given or {}, first, path)
    with _raising(path, f"{getattr(function, '__name__', function)} raised"):
        return function(*first, **(given or {}))


def check_parameters(function: Callable[..., Any], given: Mapping[str, Any], first: tuple[Any, ...], path: str) -> None:
    """Compare parameters with those that a function takes, the first ones aside.

    Raises:
        ScenarioError: one is not known, or missing.
    """
    try:
        known = list(signature(function).parameters.values())
    except (TypeError, ValueError):  # some functions in C
        return
    name = getattr(function, "__name__", str(function))
    takes_all = any(one.kind is Parameter.VAR_KEYWORD for one in known)
    left = [one for one in known[len(first) :] if one.kind in (Parameter.POSITIONAL_OR_KEYWORD, Parameter.KEYWORD_ONLY)]
    names = [one.name for one in left]
    for key in given:
        if key not in names and not takes_all:
            hint = nearest(key, names) or (f" It takes: {', '.join(names)}." if names else " It takes none.")
            raise ScenarioError(joined(path, f"with.{key}"), f"{name} takes no such parameter.{hint}")
    for one in left:
        if one.default is Parameter.empty and one.name not in given:
            raise ScenarioError(joined(path, f"with.{one.name}"), f"is missing; {name} needs it.")


def first_of(function: Callable[..., Any]) -> str:
    """Return the name of the first parameter; "" without one."""
    try:
        return next(iter(signature(function).parameters), "")
    except (TypeError, ValueError):
        return ""


def needs(function: Callable[..., Any], first: tuple[Any, ...] = ()) -> bool:
    """Whether a function cannot be called with these arguments alone."""
    try:
        known = list(signature(function).parameters.values())[len(first) :]
    except (TypeError, ValueError):
        return True
    variable = (Parameter.VAR_POSITIONAL, Parameter.VAR_KEYWORD)
    return any(one.default is Parameter.empty and one.kind not in variable for one in known)


def _bound(function: Callable[..., Any], first: tuple[Any, ...], given: Mapping[str, Any] | None, path: str) -> Any:
    check_parameters(function, given or {}, first, path)
    return update_wrapper(partial(function, **given), function) if given else function
