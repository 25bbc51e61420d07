"""Strategies that go by the enemies in sight; see the package for who is an enemy.

All of them need `state["team"]`, and a sensor that shows agents: AGENT, AGENT_RANGE, AGENT_ARC or OCCLUDED_AGENT. Such
a sensor shows a flyer at the node nearest to it.
"""

from math import inf

from gamms.arguments import as_context, as_range
from gamms.strategies.knowledge import State, as_known_node, enemies_in_sight, legal_on_map, place_of
from gamms.strategies.steps import as_otherwise, move_to, step_towards
from gamms.strategies.walks import random_walk, stay
from gamms.typing import IContext
from gamms.typing.agent_engine import Strategy


def chase(ctx: IContext, otherwise: Strategy | None = random_walk) -> Strategy:
    """Go to the nearest enemy in sight, by road; of several, to the first by name.

    Args:
        ctx: the context.
        otherwise: what to do when none is in sight, or no way leads there; None leaves that undecided.
    """
    as_context(ctx, "chase")
    fallback = as_otherwise(otherwise, "chase")

    def strategy(state: State) -> None:
        here = place_of(state, "chase")
        move_to(ctx, state, _nearest(ctx, here, enemies_in_sight(ctx, state, "chase")), fallback, "chase")

    return strategy


def flee(ctx: IContext, otherwise: Strategy | None = stay) -> Strategy:
    """Go to the legal node, perhaps the agent's own, that is farthest by road from the nearest enemy in sight.

    The road leads from the enemy to the node. Of several nodes the one with the lowest id is taken.

    Args:
        ctx: the context.
        otherwise: what to do when no enemy is in sight; None leaves that undecided.
    """
    as_context(ctx, "flee")
    fallback = as_otherwise(otherwise, "flee")

    def strategy(state: State) -> None:
        place_of(state, "flee")
        threats = set(enemies_in_sight(ctx, state, "flee").values())

        def safety(node: int) -> tuple[float, int]:
            return min(ctx.graph.graph.distance(threat, node) for threat in threats), -node

        if threats:
            state["action"] = max(legal_on_map(ctx, state), key=safety)
        else:
            fallback(state)

    return strategy


def guard(ctx: IContext, node: int, radius: float) -> Strategy:
    """Stay near a node, the post, and go after the enemies in sight that come near it; it decides always.

    Near is whatever is at most `radius` from the post by road, and that road leads to the post. Of several enemies it
    goes to the nearest by road, then to the first by name. It never goes farther away from the post than `radius`, but
    waits there. Without an enemy near, or farther away from the post itself, it goes back.

    Args:
        ctx: the context.
        node: the post.
        radius: metres, or whatever unit the lengths of the edges have; may be infinite.

    Raises:
        UnknownName (KeyError), BadType, BadValue: the post is no node of the map, or the radius no distance.
    """
    as_context(ctx, "guard")
    post, reach = as_known_node(ctx, node, "node of guard"), as_range(radius, "radius of guard")

    def is_near(place: int) -> bool:
        return ctx.graph.graph.distance(place, post) <= reach

    def strategy(state: State) -> None:
        here = place_of(state, "guard")
        enemies = {name: at for name, at in enemies_in_sight(ctx, state, "guard").items() if is_near(at)}
        target = _nearest(ctx, here, enemies) if is_near(here) else None
        if target is None:
            move_to(ctx, state, post, stay, "guard")
        else:
            state["action"] = step_towards(ctx, state, target, "guard", is_near)

    return strategy


def _nearest(ctx: IContext, here: int, enemies: dict[str, int]) -> int | None:
    """The node of the nearest by road; None where no way leads to any."""
    metres = {name: ctx.graph.graph.distance(here, node) for name, node in enemies.items()}
    name = min(metres, key=metres.__getitem__, default=None)  # they are in the order of their names
    return None if name is None or metres[name] == inf else enemies[name]
