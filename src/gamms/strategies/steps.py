"""What strategies decide at last: a step along a shortest path, or to ask another one."""

from collections.abc import Callable
from typing import Any

from gamms.errors import NoPath
from gamms.strategies.knowledge import State, as_strategy, legal_on_map, place_of
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
) -> int | None:
    """Where to move on the way to a node: there, if that is legal, else as far along the shortest path as is legal.

    Args:
        ctx: the context.
        state: of an agent on the ground.
        target: a node id.
        asker: the name of the strategy, for messages.
        is_allowed: whether it may enter a node; every node by default.

    Returns:
        A node id, perhaps the agent's own; None where there is no way.

    Raises:
        BadType: the agent flies.
    """
    here, legal = place_of(state, asker), legal_on_map(ctx, state)
    if target in legal and (is_allowed is None or is_allowed(target)):
        return target
    try:
        path = ctx.graph.graph.shortest_path(here, target)
    except NoPath:
        return None
    step = here
    for node in path[1:]:
        if node not in legal or not (is_allowed is None or is_allowed(node)):
            break
        step = node
    return step


def as_otherwise(otherwise: Any, asker: str) -> Strategy:
    """What to ask when there is nothing to do."""
    if otherwise is None:
        return leave_undecided
    strategy: Strategy = as_strategy(otherwise, f"otherwise of {asker}")
    return strategy


def leave_undecided(state: State) -> None:
    """Set no action."""
