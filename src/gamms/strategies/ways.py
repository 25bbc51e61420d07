"""Strategies that go somewhere: by shortest paths, as `graph.shortest_path` finds them."""

from collections.abc import Callable, Iterable
from typing import Any

from gamms.arguments import as_context
from gamms.errors import BadValue
from gamms.strategies.knowledge import State, as_known_node, as_known_nodes, place_of, told
from gamms.strategies.steps import as_otherwise, move_to
from gamms.strategies.walks import stay
from gamms.typing import IContext
from gamms.typing.agent_engine import Strategy


def goto(ctx: IContext, target: int | Callable[[State], int | None], otherwise: Strategy | None = stay) -> Strategy:
    """Go to a node, and stay there.

    Args:
        ctx: the context.
        target: a node id, or a function of the state that gives one, or None for nowhere.
        otherwise: what to do when there is nowhere to go, or no way; None leaves that undecided.

    Raises:
        UnknownName (KeyError), BadType: the target is no node of the map.
    """
    as_context(ctx, "goto")
    fixed = None if callable(target) else as_known_node(ctx, target, "target of goto")
    fallback = as_otherwise(otherwise, "goto")

    def strategy(state: State) -> None:
        node = target(state) if callable(target) else fixed
        move_to(ctx, state, None if node is None else as_known_node(ctx, node, "target of goto"), fallback, "goto")

    return strategy


def follow_path(
    ctx: IContext, nodes: Iterable[int], repeat: bool = False, otherwise: Strategy | None = stay
) -> Strategy:
    """Go to one node after the other, by the shortest path from wherever the agent is.

    How far it has come is remembered as the position of the node that comes next, under `"follow_path [<nodes>]"`.

    Args:
        ctx: the context.
        nodes: ids; neighbours on the list need not be neighbours on the map.
        repeat: begin anew behind the last one.
        otherwise: what to do behind the last one, or while there is no way; None leaves that undecided.

    Raises:
        UnknownName (KeyError), BadType, BadValue: the nodes are none of the map, or there are none at all.
    """
    stops = _as_stops(ctx, nodes, "follow_path")
    key, fallback = f"follow_path {list(stops)}", as_otherwise(otherwise, "follow_path")

    def strategy(state: State) -> None:
        memory = told(state, "memory", "follow_path")
        memory[key] = at = _advanced(stops, memory.get(key, 0), place_of(state, "follow_path"), repeat=repeat)
        move_to(ctx, state, stops[at] if at < len(stops) else None, fallback, "follow_path")

    return strategy


def patrol(ctx: IContext, nodes: Iterable[int], otherwise: Strategy | None = stay) -> Strategy:
    """Go round some nodes for ever, beginning with the nearest by road; of several, with the first on the list.

    Which comes next is remembered as its position on the list, under `"patrol [<nodes>]"`.

    Args:
        ctx: the context.
        nodes: ids; neighbours on the list need not be neighbours on the map.
        otherwise: what to do while there is no way; None leaves that undecided.

    Raises:
        UnknownName (KeyError), BadType, BadValue: the nodes are none of the map, or there are none at all.
    """
    stops = _as_stops(ctx, nodes, "patrol")
    key, fallback = f"patrol {list(stops)}", as_otherwise(otherwise, "patrol")

    def strategy(state: State) -> None:
        memory, here = told(state, "memory", "patrol"), place_of(state, "patrol")
        if key not in memory:
            metres = [ctx.graph.graph.distance(here, stop) for stop in stops]
            memory[key] = metres.index(min(metres))
        memory[key] = at = _advanced(stops, memory[key], here, repeat=True)
        move_to(ctx, state, stops[at], fallback, "patrol")

    return strategy


def _as_stops(ctx: IContext, nodes: Any, asker: str) -> tuple[int, ...]:
    stops = as_known_nodes(as_context(ctx, asker), nodes, f"nodes of {asker}")
    if not stops:
        raise BadValue(f"{asker} needs one node at least.")
    return stops


def _advanced(stops: tuple[int, ...], at: int, here: int, *, repeat: bool) -> int:
    """The position of the stop that comes next; their number behind the last one."""
    for _ in stops:  # no more than once round: they may all be the same node
        if at == len(stops) or stops[at] != here:
            break
        at = (at + 1) % len(stops) if repeat else at + 1
    return at
