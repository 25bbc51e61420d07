"""What strategies decide at last: a step along a shortest path, or to ask another one."""

from collections.abc import Callable
from itertools import takewhile
from typing import Any

from gamms.errors import NoPath
from gamms.strategies.knowledge import State, as_strategy, has_speed, legal_on_map, place_of
from gamms.typing import IContext
from gamms.typing.agent_engine import Strategy


def move_to(ctx: IContext, state: State, target: int | None, fallback: Strategy, asker: str) -> None:
    """Decide for the step towards a node; without a node, or a way to it, ask the fallback."""
    step = None if target is None else step_towards(ctx, state, target, asker)
    if step is None:
        fallback(state)
    else:
        state["action"] = step


def step_towards(
    ctx: IContext, state: State, target: int, asker: str, is_allowed: Callable[[int], bool] | None = None
) -> int | list[int] | None:
    """What to do to get to a node: go there, if that is legal, else as far along the shortest path as is legal.

    Args:
        ctx: the context.
        state: of an agent on the ground.
        target: a node id.
        asker: the name of the strategy, for messages.
        is_allowed: whether it may enter a node; every node by default.

    Returns:
        A node id, perhaps the agent's own; of an agent with a speed the nodes on the way, the first one out of reach
        included, so that what is left of its metres counts next turn; None where there is no way.

    Raises:
        BadType: the agent flies.
    """
    here, legal = place_of(state, asker), legal_on_map(ctx, state)
    if target in legal and (is_allowed is None or is_allowed(target)):
        return target
    try:
        path = ctx.graph.graph.shortest_path(here, target)[1:]
    except NoPath:
        return None
    way = list(path if is_allowed is None else takewhile(is_allowed, path))
    reached = sum(1 for _ in takewhile(legal.__contains__, way))
    if has_speed(ctx, state):
        return way[: reached + 1] or here
    return way[reached - 1] if reached else here


def as_otherwise(otherwise: Any, asker: str) -> Strategy:
    """What to ask when there is nothing to do."""
    if otherwise is None:
        return leave_undecided
    strategy: Strategy = as_strategy(otherwise, f"otherwise of {asker}")
    return strategy


def leave_undecided(state: State) -> None:
    """Set no action."""
