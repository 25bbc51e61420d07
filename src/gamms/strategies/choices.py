"""Strategies made of others, and of whoever sits in front of the screen."""

from collections.abc import Callable
from typing import Any

from gamms.arguments import as_float
from gamms.errors import BadValue
from gamms.strategies.knowledge import State, as_strategy, drawn_fraction
from gamms.typing.agent_engine import Strategy


def first(*strategies: Strategy) -> Strategy:
    """Ask one strategy after the other until one sets an action; if none does, it is undecided itself.

    An action that is there already is forgotten.

    Raises:
        BadType, BadValue: one of them is no function, or there is none.
    """
    if not strategies:
        raise BadValue("first needs one strategy at least.")
    options = tuple(as_strategy(option, "Each strategy of first") for option in strategies)

    def strategy(state: State) -> None:
        state.pop("action", None)
        for option in options:
            option(state)
            if "action" in state:
                return

    return strategy


def mix(p: float, a: Strategy, b: Strategy) -> Strategy:
    """Ask `a` with the probability `p`, else `b`; drawn at every turn, one number from `state["draw"]`.

    Raises:
        BadType, BadValue: `p` is not from 0 to 1, or `a` or `b` is no function.
    """
    chance = as_float(p, "p of mix")
    if not 0.0 <= chance <= 1.0:
        raise BadValue(f"p of mix must be a probability from 0 to 1, not {chance}.")
    options = as_strategy(b, "b of mix"), as_strategy(a, "a of mix")

    def strategy(state: State) -> None:
        options[drawn_fraction(state, "mix") < chance](state)

    return strategy


def human(read: Callable[[State], Any]) -> Strategy:
    """Let a person decide, through any front end.

    Args:
        read: called with the state, gives the action; None leaves it undecided. Nothing is checked here: whoever plays
            the game does.

    Raises:
        BadType: `read` cannot be called.
    """
    ask = as_strategy(read, "read of human")

    def strategy(state: State) -> None:
        action = ask(state)
        if action is not None:
            state["action"] = action

    return strategy
