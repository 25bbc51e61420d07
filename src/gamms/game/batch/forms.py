"""Array forms beside scalar forms: how they are declared for rules, their checks, strategies and plans, and found."""

from collections.abc import Callable
from typing import Any, TypeVar

from gamms.arguments import as_function_of
from gamms.errors import BadType
from gamms.game.batch.columns import PlayedGame
from gamms.text import shown

F = TypeVar("F", bound=Callable[..., Any])

_FORM = "array_form"  # the attribute of a scalar form that has its array form
BY_EDGES = "array_form_by_edges"  # of rules: whether the form is not for games by metres


def form_declared(of: object, decorator: str, argument: str, most: int = 1) -> Callable[[F], F]:
    """Return what declares a function as the array form of another; what it is called with see `as_function_of`."""
    if not callable(of) or not hasattr(of, "__dict__") or hasattr(of, "__func__"):
        raise BadType(f"{decorator}(of=…) needs the function whose form it declares, not {shown(of)}.")

    def declare(form: F) -> F:
        of.__dict__[_FORM] = as_function_of(form, f"What {decorator}(of=…) declares", argument, most)
        return form

    return declare


def form_of(function: object) -> Any:
    """Return the array form of a strategy, a rule, a check, a plan or a resolver; None: it has none."""
    return getattr(function, _FORM, None)


def form_in(game: PlayedGame, rule: object) -> Any:
    """Return the array form of a rule for a game; None: it has none there."""
    by_metres = game.settings()["speed_unit"] != "edges"
    return None if by_metres and getattr(rule, BY_EDGES, False) else form_of(rule)
