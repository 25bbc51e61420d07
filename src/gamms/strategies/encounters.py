"""Strategies that act on the enemies in sight."""

from math import inf

from gamms.arguments import as_context, as_range
from gamms.strategies.knowledge import (
    as_known_node,
    as_otherwise,
    enemies_in_sight,
    legal_on_map,
    move_to,
    node_of,
    step_towards,
)
from gamms.strategies.travel import random_walk, stay
from gamms.text import shown_as_called
from gamms.typing import IContext
from gamms.typing.game import NodeId, State, Strategy


@shown_as_called
def chase(ctx: IContext, otherwise: Strategy | None = random_walk) -> Strategy:
    """Go to the nearest enemy in sight, by road; of several, to the first by name.

    Args:
        ctx: the context.
        otherwise: the strategy to use when none is in sight, or there is no path; None sets no action then.
    """
    as_context(ctx, "chase")
    fallback = as_otherwise(otherwise, "chase")

    def strategy(state: State) -> None:
        here = node_of(state, "chase")
        move_to(ctx, state, _nearest(ctx, here, enemies_in_sight(ctx, state, "chase")), fallback, "chase")

    return strategy


@shown_as_called
def flee(ctx: IContext, otherwise: Strategy | None = stay) -> Strategy:
    """Go to the legal node, perhaps the agent's own, that is farthest by road from the nearest enemy in sight.

    The road leads from the enemy to the node. Of several nodes the one with the lowest id is taken.

    Args:
        ctx: the context.
        otherwise: the strategy to use when no enemy is in sight; None sets no action then.
    """
    as_context(ctx, "flee")
    fallback = as_otherwise(otherwise, "flee")

    def strategy(state: State) -> None:
        node_of(state, "flee")
        threats = set(enemies_in_sight(ctx, state, "flee").values())

        def safety(node: int) -> tuple[float, int]:
            return min(ctx.graph.graph.distance(threat, node) for threat in threats), -node

        if threats:
            state["action"] = max(legal_on_map(ctx, state), key=safety)
        else:
            fallback(state)

    return strategy


@shown_as_called
def guard(ctx: IContext, node: NodeId, radius: float) -> Strategy:
    """Stay near a node, the post, and go after the enemies in sight that come near it; it always sets an action.

    Near means at most `radius` by road, on the way to the post. Of several enemies the agent goes to the nearest by
    road, then to the first by name. It never goes farther away from the post than `radius`, but waits there. Without an
    enemy near, or farther away from the post itself, it goes back.

    Args:
        ctx: the context.
        node: the post.
        radius: metres, or the unit that the lengths of the edges have; may be infinite.

    Raises:
        UnknownName (KeyError), BadType, BadValue: the post is not a node of the map, or the radius not a distance.
    """
    as_context(ctx, "guard")
    post, reach = as_known_node(ctx, node, "node of guard"), as_range(radius, "radius of guard")

    def is_near(place: int) -> bool:
        return ctx.graph.graph.distance(place, post) <= reach

    def strategy(state: State) -> None:
        here = node_of(state, "guard")
        enemies = {name: at for name, at in enemies_in_sight(ctx, state, "guard").items() if is_near(at)}
        target = _nearest(ctx, here, enemies) if is_near(here) else None
        if target is None:
            move_to(ctx, state, post, stay, "guard")
        else:
            step = step_towards(ctx, state, target, "guard", is_near)
            state["action"] = here if step is None else step

    return strategy


def _nearest(ctx: IContext, here: int, enemies: dict[str, int]) -> int | None:
    """Return the node of the nearest by road; None where no path leads to any."""
    metres = {name: ctx.graph.graph.distance(here, node) for name, node in enemies.items()}
    name = min(metres, key=metres.__getitem__, default=None)  # they are in the order of their names
    return None if name is None or metres[name] == inf else enemies[name]
