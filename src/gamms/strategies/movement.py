"""Strategies that move without regard to other agents: staying, walking at random, going along shortest paths."""

from collections.abc import Callable, Iterable
from itertools import takewhile
from math import cos, pi, sin

from gamms.arguments import as_context
from gamms.errors import BadValue, NoPath
from gamms.strategies.knowledge import (
    as_known_node,
    as_known_nodes,
    as_strategy,
    drawn_below,
    drawn_fraction,
    has_speed,
    is_aerial,
    legal_nodes,
    legal_on_map,
    node_of,
    required,
)
from gamms.typing import IContext
from gamms.typing.game import AerialState, NodeId, State, Strategy


def stay(state: State | AerialState) -> None:
    """Stay; it always sets an action."""
    if is_aerial(state):
        state["action"] = (0.0, 0.0, 0.0)
    else:
        state["action"] = state["curr_pos"]


def random_walk(state: State | AerialState) -> None:
    """Go to one of the legal nodes, the agent's own included, each as likely; fly in any horizontal direction.

    Without `state["legal"]`, the legal nodes are those that a NEIGHBOR sensor shows.

    Raises:
        MissingKey: there is neither `state["draw"]` nor `state["rng"]`, or nothing that gives legal nodes.
    """
    if is_aerial(state):
        angle = 2.0 * pi * drawn_fraction(state, "random_walk")
        state["action"] = (cos(angle), sin(angle), 0.0)
    else:
        legal = legal_nodes(state, "random_walk")
        state["action"] = legal[drawn_below(state, len(legal), "random_walk")]


def goto(
    ctx: IContext, target: NodeId | Callable[[State], NodeId | None], otherwise: Strategy | None = stay
) -> Strategy:
    """Go to a node, and stay there.

    Args:
        ctx: the context.
        target: a node id, or a function of the state that gives one, or None for nowhere.
        otherwise: the strategy to use when there is nowhere to go, or no path; None sets no action then.

    Raises:
        UnknownName (KeyError), BadType: the target is not a node of the map.
    """
    as_context(ctx, "goto")
    fixed = None if callable(target) else as_known_node(ctx, target, "target of goto")
    fallback = as_otherwise(otherwise, "goto")

    def strategy(state: State) -> None:
        node = target(state) if callable(target) else fixed
        move_to(ctx, state, None if node is None else as_known_node(ctx, node, "target of goto"), fallback, "goto")

    return strategy


def follow_path(
    ctx: IContext, nodes: Iterable[NodeId], repeat: bool = False, otherwise: Strategy | None = stay
) -> Strategy:
    """Go to one node after the other, by the shortest path from wherever the agent is.

    The index of the next node is in `state["memory"]`, under `"follow_path [<nodes>]"`.

    Args:
        ctx: the context.
        nodes: ids; neighbours on the list need not be neighbours on the map.
        repeat: start again after the last one.
        otherwise: the strategy to use after the last one, or while there is no path; None sets no action then.

    Raises:
        UnknownName (KeyError), BadType, BadValue: one is not a node of the map, or there are none.
    """
    stops = _as_stops(ctx, nodes, "follow_path")
    key, fallback = f"follow_path {list(stops)}", as_otherwise(otherwise, "follow_path")

    def strategy(state: State) -> None:
        memory = required(state, "memory", "follow_path")
        memory[key] = at = _advanced(stops, memory.get(key, 0), node_of(state, "follow_path"), repeat=repeat)
        move_to(ctx, state, stops[at] if at < len(stops) else None, fallback, "follow_path")

    return strategy


def patrol(ctx: IContext, nodes: Iterable[NodeId], otherwise: Strategy | None = stay) -> Strategy:
    """Visit some nodes in a cycle, beginning with the nearest by road; of several, with the first on the list.

    The index of the next node is in `state["memory"]`, under `"patrol [<nodes>]"`.

    Args:
        ctx: the context.
        nodes: ids; neighbours on the list need not be neighbours on the map.
        otherwise: the strategy to use while there is no path; None sets no action then.

    Raises:
        UnknownName (KeyError), BadType, BadValue: one is not a node of the map, or there are none.
    """
    stops = _as_stops(ctx, nodes, "patrol")
    key, fallback = f"patrol {list(stops)}", as_otherwise(otherwise, "patrol")

    def strategy(state: State) -> None:
        memory, here = required(state, "memory", "patrol"), node_of(state, "patrol")
        if key not in memory:
            metres = [ctx.graph.graph.distance(here, stop) for stop in stops]
            memory[key] = metres.index(min(metres))
        memory[key] = at = _advanced(stops, memory[key], here, repeat=True)
        move_to(ctx, state, stops[at], fallback, "patrol")

    return strategy


def _as_stops(ctx: IContext, nodes: Iterable[NodeId], caller: str) -> tuple[int, ...]:
    stops = as_known_nodes(as_context(ctx, caller), nodes, f"nodes of {caller}")
    if not stops:
        raise BadValue(f"{caller} needs one node at least.")
    return stops


def _advanced(stops: tuple[int, ...], at: int, here: int, *, repeat: bool) -> int:
    """Return the index of the stop that comes next; their number after the last one."""
    for _ in stops:  # no more than once round: they may all be the same node
        if at == len(stops) or stops[at] != here:
            break
        at = (at + 1) % len(stops) if repeat else at + 1
    return at


# -- for all strategies that follow paths -------------------------------------------------------------------------


def move_to(ctx: IContext, state: State, target: int | None, fallback: Strategy, caller: str) -> None:
    """Set the action to a step towards a node; without a node, or a path to it, call the fallback."""
    step = None if target is None else step_towards(ctx, state, target, caller)
    if step is None:
        fallback(state)
    else:
        state["action"] = step


def step_towards(
    ctx: IContext, state: State, target: int, caller: str, is_allowed: Callable[[int], bool] | None = None
) -> int | list[int] | None:
    """Return the action that leads to a node: go there, if that is legal, else along the shortest path.

    Args:
        ctx: the context.
        state: of an agent on the ground.
        target: a node id.
        caller: the name of the strategy, for messages.
        is_allowed: whether the agent may enter a node; every node by default.

    Returns:
        A node id, perhaps the agent's own; of an agent with a speed the nodes on the path, the first one out of reach
        included, so that what is left of its metres counts next turn; None where there is no path.

    Raises:
        BadType: the agent flies.
    """
    here, legal = node_of(state, caller), legal_on_map(ctx, state)
    if target in legal and (is_allowed is None or is_allowed(target)):
        return target
    try:
        path = ctx.graph.graph.shortest_path(here, target)[1:]
    except NoPath:
        return None
    allowed = list(path if is_allowed is None else takewhile(is_allowed, path))
    reached = sum(1 for _ in takewhile(legal.__contains__, allowed))
    if has_speed(ctx, state):
        return allowed[: reached + 1] or here
    return allowed[reached - 1] if reached else here


def as_otherwise(otherwise: Strategy | None, caller: str) -> Strategy:
    """Return the strategy to use when there is nothing to do; None: one that sets no action."""
    return set_no_action if otherwise is None else as_strategy(otherwise, f"otherwise of {caller}")


def set_no_action(state: State) -> None:
    """Set no action."""
