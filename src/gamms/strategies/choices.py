"""Strategies made of other strategies, and of a person's input."""

from collections.abc import Callable
from typing import Any, overload

from gamms.arguments import as_float
from gamms.errors import BadValue
from gamms.strategies.knowledge import as_strategy, drawn_fraction
from gamms.typing.game import AerialState, AerialStrategy, State, Strategy


@overload
def first(*strategies: Strategy) -> Strategy: ...
@overload
def first(*strategies: AerialStrategy) -> AerialStrategy: ...
def first(*strategies: Callable[[Any], None]) -> Callable[[Any], None]:
    """Call one strategy after the other until one sets an action.

    An action that is there already is removed first.

    Raises:
        BadType, BadValue: one of them is not a function, or there is none.
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


@overload
def mix(p: float, a: Strategy, b: Strategy) -> Strategy: ...
@overload
def mix(p: float, a: AerialStrategy, b: AerialStrategy) -> AerialStrategy: ...
def mix(p: float, a: Callable[[Any], None], b: Callable[[Any], None]) -> Callable[[Any], None]:
    """Call `a` with the probability `p`, else `b`; one number is drawn from `state["draw"]` in every turn.

    Raises:
        BadType, BadValue: `p` is not from 0 to 1, or `a` or `b` is not a function.
    """
    chance = as_float(p, "p of mix")
    if not 0.0 <= chance <= 1.0:
        raise BadValue(f"p of mix must be a probability from 0 to 1, not {chance}.")
    options = as_strategy(b, "b of mix"), as_strategy(a, "a of mix")

    def strategy(state: State) -> None:
        options[drawn_fraction(state, "mix") < chance](state)

    return strategy


@overload
def human(read: Callable[[State], Any]) -> Strategy: ...
@overload
def human(read: Callable[[AerialState], Any]) -> AerialStrategy: ...
def human(read: Callable[[Any], Any]) -> Callable[[Any], None]:
    """Let a person decide, through any front end.

    Args:
        read: called with the state, returns the action; None sets none. The game checks the action, this does not.

    Raises:
        BadType: `read` cannot be called.
    """
    ask = as_strategy(read, "read of human")

    def strategy(state: State) -> None:
        action = ask(state)
        if action is not None:
            state["action"] = action

    return strategy
