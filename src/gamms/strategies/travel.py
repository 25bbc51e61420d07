"""Strategies that need no enemies: they go somewhere, or are made of others."""

from collections.abc import Callable, Iterable
from math import cos, pi, sin
from typing import Any, overload

from gamms.arguments import as_context, as_float, as_items
from gamms.errors import BadValue
from gamms.strategies.knowledge import (
    as_known_node,
    as_otherwise,
    as_strategy,
    drawn_below,
    drawn_fraction,
    is_aerial,
    legal_nodes,
    move_to,
    node_of,
    required,
)
from gamms.text import shown_as_called
from gamms.typing import IContext
from gamms.typing.game import AerialState, AerialStrategy, NodeId, State, Strategy


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


@shown_as_called
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


@shown_as_called
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
    return _route(ctx, nodes, otherwise, "follow_path", repeat=repeat)


@shown_as_called
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
    return _route(ctx, nodes, otherwise, "patrol", repeat=True, is_nearest_first=True)


# -- combinations -------------------------------------------------------------------------------------------------


@overload
def first(*strategies: Strategy) -> Strategy: ...
@overload
def first(*strategies: AerialStrategy) -> AerialStrategy: ...
@shown_as_called
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
@shown_as_called
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
@shown_as_called
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


# -- steps ---------------------------------------------------------------------------------------------------------


def _route(
    ctx: IContext,
    nodes: Iterable[NodeId],
    otherwise: Strategy | None,
    caller: str,
    *,
    repeat: bool,
    is_nearest_first: bool = False,
) -> Strategy:
    """Return a strategy that goes from one of some stops to the next, and remembers which that is."""
    as_context(ctx, caller)
    name = f"nodes of {caller}"
    stops = tuple(as_known_node(ctx, node, f"Each of {name}") for node in as_items(nodes, name, "node ids"))
    if not stops:
        raise BadValue(f"{caller} needs one node at least.")
    key, fallback = f"{caller} {list(stops)}", as_otherwise(otherwise, caller)

    def strategy(state: State) -> None:
        memory, here = required(state, "memory", caller), node_of(state, caller)
        if key not in memory and is_nearest_first:
            metres = [ctx.graph.graph.distance(here, stop) for stop in stops]
            memory[key] = metres.index(min(metres))
        memory[key] = at = _advanced(stops, memory.get(key, 0), here, repeat=repeat)
        move_to(ctx, state, stops[at] if at < len(stops) else None, fallback, caller)

    return strategy


def _advanced(stops: tuple[int, ...], at: int, here: int, *, repeat: bool) -> int:
    """Return the index of the stop that comes next; their number after the last one."""
    for _ in stops:  # no more than once round: they may all be the same node
        if at == len(stops) or stops[at] != here:
            break
        at = (at + 1) % len(stops) if repeat else at + 1
    return at
