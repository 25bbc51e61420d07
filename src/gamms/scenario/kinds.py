"""The kinds of functions that GAMMS offers to scenario files, and the places where a file may name each.

They are derived from annotations. Functions of users are checked only when a game is built and they are imported.
"""

from collections.abc import Awaitable, Callable
from collections.abc import Callable as AnyCallable
from itertools import chain
from types import NoneType
from typing import Annotated, Any, get_args, get_origin

from gamms.arguments import annotations_of
from gamms.scenario.code import RULES, first_of, needs, offered
from gamms.scenario.documents import ScenarioError
from gamms.typing.game import AerialState, State

_ARTICLES = {
    "strategy": "a strategy",
    "plan": "a plan",
    "rule": "a rule",
    "resolver": "a resolver of conflicts",
    "sensor": "the function of a sensor",
}
_FIRST = {"state": "strategy", "states": "plan", "arrays": "plan"}


def kind_of(function: Callable[..., Any], first: str) -> str | None:
    """Return the kind of a function of GAMMS or of its result.

    Args:
        function: the function.
        first: the name of its first parameter.

    Returns:
        The kind; None for anything else. A "team strategy" is also a plan.
    """
    if first in _FIRST:
        return _FIRST[first]
    given = function if isinstance(function, type) else annotations_of(function).get("return")
    if isinstance(given, type):
        call = annotations_of(vars(given).get("__call__"))
        return "strategy" if "state" in call else None
    if get_origin(given) is not AnyCallable:
        return None
    arguments, result = get_args(given)
    if getattr(arguments[0], "__name__", "") == "Contest":  # of gamms.rules, which this package does not import
        return "resolver"
    if result is object:
        return "rule"
    return "strategy" if arguments[0] in (State, AerialState) else "team strategy"


def resolvers() -> list[str]:
    """Return the names of the resolvers of conflicts that GAMMS offers, by_priority first."""
    functions = offered(RULES).items()
    made = [name for name, one in functions if kind_of(one, first_of(one)) == "resolver" and not needs(one)]
    return ["by_priority", *made]


def check_kind(kind: str | None, wanted: str, name: str, path: str) -> None:
    """Check that a function of GAMMS has the kind that its place in a scenario needs.

    Raises:
        ScenarioError: it has another kind.
    """
    fits = {"strategy": ("strategy", "team strategy"), "plan": ("plan", "team strategy"), "rule": ("rule",)}
    if kind in fits.get(wanted, ()):
        return
    found = "no such function" if kind is None else _ARTICLES[kind.removeprefix("team ")]
    hint = " It belongs into conflicts.resolve." if kind == "resolver" else ""
    if wanted == "resolver":
        hint = f" Write {', '.join(resolvers())}, without a module, or name a function of your own."
    if kind == wanted:
        raise ScenarioError(path, f"{name} makes {found}, but is not one itself.{hint}")
    raise ScenarioError(path, f"{name} is {found}, and {_ARTICLES[wanted]} belongs here.{hint}")


def check_parameter(kind: str | None, annotation: object, name: str, path: str) -> None:
    """Check a function of GAMMS that is the parameter of another one.

    Args:
        kind: the kind of the function.
        annotation: the annotation of the parameter.
        name: the name of the function.
        path: the place that names it.

    Raises:
        ScenarioError: it is a strategy, rule or resolver, which the parameter does not accept.
    """
    takes_strategy = annotation is Any or any(map(_is_strategy, _callables_in(annotation)))
    if kind is None or (takes_strategy and kind in ("strategy", "team strategy")):
        return
    article = _ARTICLES[kind.removeprefix("team ")]
    raise ScenarioError(path, f"{name} is {article}, and the parameter takes none.")


def _callables_in(annotation: object) -> list[Any]:
    """Return the function types in an annotation."""
    if get_origin(annotation) is AnyCallable:
        return [annotation]
    parts = get_args(annotation)[:1] if get_origin(annotation) is Annotated else get_args(annotation)
    return list(chain.from_iterable(_callables_in(part) for part in parts))


def _is_strategy(function: object) -> bool:
    """Return whether a function of this type can be a strategy: it takes one argument and need not return anything."""
    arguments, result = get_args(function) or (..., None)
    results = get_args(result) or (result,)
    takes_state = len(arguments) == 1 if isinstance(arguments, list) else True  # not a list: `...`, which takes all
    returns_nothing = result is Any or {NoneType, None, Awaitable[None]}.issuperset(results)
    return takes_state and returns_nothing
