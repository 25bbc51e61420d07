"""The strategy of an agent that goes from one stop of a list to the next, as far as each turn leads."""

from array import array
from collections.abc import Iterable
from math import floor, inf

from gamms.arguments import as_context
from gamms.context import Context
from gamms.core import strategies as core
from gamms.errors import NoPath
from gamms.game.batch.forms import CoreStep
from gamms.strategies.knowledge import (
    as_otherwise,
    has_speed,
    known_nodes,
    legal_on_map,
    move_to,
    node_of,
    offer_steps,
    required,
)
from gamms.strategies.paces import pace_of
from gamms.typing.game import NodeId, State, Strategy

Step = tuple[int, int, float]  # a node, the index of the next stop from there, and how far it is: edges or map units
Way = tuple[float, list[Step]]  # of one turn: how far it leads, and its nodes, beginning with the agent's own

_MOST_NODES = 10_000  # of a way: an agent of endless speed would go round for ever


def route(
    ctx: Context,
    nodes: Iterable[NodeId],
    otherwise: Strategy | None,
    caller: str,
    *,
    repeat: bool,
    is_nearest_first: bool = False,
) -> Strategy:
    """Return a strategy that goes from one stop to the next, and remembers which one comes next."""
    as_context(ctx, caller)
    stops = Stops(known_nodes(ctx, nodes, caller, "nodes"), repeat=repeat)
    key = f"{caller} {list(stops.nodes)}"
    way_key = f"{key} way"
    fallback = as_otherwise(otherwise, caller)

    def strategy(state: State) -> None:
        memory = required(state, "memory", caller)
        here = node_of(state, caller)
        if key not in memory and is_nearest_first:
            nearest = ctx.graph.routes.nearest(here, stops.nodes)
            memory[key] = 0 if nearest is None else stops.nodes.index(nearest)
        at = _stop_after(memory.pop(way_key, None), state, memory.get(key, 0))
        memory[key] = at = stops.next(at, here)
        target = stops.nodes[at] if at < len(stops.nodes) else None
        way = None
        if target in legal_on_map(ctx, state) and _goes_beyond(ctx, state):
            way = _way(ctx, state, stops, at)
        if way is None:
            move_to(ctx, state, target, fallback, caller)
            return
        memory[way_key] = way
        path = [node for node, *_ in way[1]]
        state["action"] = path if path[1] == here else path[1:]  # a path to turn round by names the node behind twice

    step = CoreStep("follow", stops.nodes, int(is_nearest_first), stops.following, key)
    offer_steps(strategy, step, fallback)
    return strategy


# -- the way of one turn --------------------------------------------------------------------------------------------


def _goes_beyond(ctx: Context, state: State) -> bool:
    """Whether an agent may pass a stop within a turn, without being asked again there."""
    if ctx.current_game is None or not has_speed(ctx, state):
        return False
    return ctx.game.legal == "edges" and ctx.game.decide == "turn"


def _way(ctx: Context, state: State, stops: "Stops", at: int) -> Way | None:
    """Return the way through the stops from number `at` on, up to the first node that is out of reach in this turn.

    Args:
        ctx: the context.
        state: of an agent with a speed.
        stops: the list.
        at: the index of the next stop, which is legal.

    Returns:
        None where no path leads to the next stop.
    """
    graph = ctx.graph.graph
    unit, speed = pace_of(ctx, state["name"])
    reach = speed + 1.0 if unit is None else speed  # part of an edge may have been covered before
    last = state["curr_pos"]
    far = 0.0
    steps = [(last, at, -state.get("offset_m", 0.0))]
    if state.get("edge") is not None:
        last, far = _end_of_edge(ctx, state, stops.nodes[at])
        at = stops.next(at, last)
        steps.append((last, at, far))
    while at < len(stops.nodes) and far < reach and len(steps) < _MOST_NODES:
        weight: str | None = "length"
        if unit is not None:
            weight = ctx.game.weight
        elif len(steps) == 1 or graph.distance(last, stops.nodes[at], None) <= max(1.0, speed - far):
            weight = None  # to a node that is legal an agent goes along the fewest edges
        path = _path(ctx, last, stops.nodes[at], weight)
        for node in path:
            far += graph.distance(last, node, unit)
            at = stops.next(at, node)
            steps.append((node, at, far))
            last = node
            if far >= reach:
                break
        if not path:
            break
    covers = floor(speed) + 0.5 if unit is None and speed < inf else speed
    return None if len(steps) == 1 else (min(covers, far), steps)


def _end_of_edge(ctx: Context, state: State, target: int) -> tuple[int, float]:
    """Return the end of its edge by which an agent goes to a node, and how far that end is."""
    graph, weight = ctx.graph.graph, ctx.game.weight
    source, end, edge = state["edge"]  # type: ignore[misc] # the agent is on one
    length = graph.get_edge(edge).length
    gone = state["offset_m"] / length
    cost = graph.distance(source, end, weight)
    ahead = (1.0 - gone) * cost + graph.distance(end, target, weight)
    may_turn = state["legal"][0] == source
    behind = gone * cost + graph.distance(source, target, weight) if may_turn else inf
    return (source, state["offset_m"]) if behind < ahead else (end, length - state["offset_m"])


def _path(ctx: Context, source: int, target: int, weight: str | None) -> list[int]:
    """Return the nodes behind `source` on the shortest path; none where there is no path."""
    try:
        found: list[int] = ctx.graph.graph.shortest_path(source, target, weight)[1:]
    except NoPath:
        found = []
    return found


def _stop_after(way: Way | None, state: State, before: int) -> int:
    """Return the index of the next stop of an agent that was on this way; `before` where it is not on it."""
    here = state["curr_pos"]
    if way is None or (state.get("blocked") and way[1][0][0] == here):
        return before
    covers, steps = way
    gone = state.get("offset_m", 0.0)
    passed = [(abs(far + gone - covers), stop) for node, stop, far in steps if node == here]
    return min(passed)[1] if passed else before  # a way may pass a node more than once


class Stops:
    """The nodes of a list, and which of them comes next.

    Args:
        nodes: ids.
        repeat: whether the first one follows the last one.

    Attributes:
        nodes: as given.
        following: of each, the index of the next one that is another node; their number after the last one.
    """

    def __init__(self, nodes: tuple[int, ...], *, repeat: bool) -> None:
        self.nodes = nodes
        self.following = tuple(_following(nodes, at, repeat=repeat) for at in range(len(nodes)))
        self._ids = memoryview(array("q", nodes))
        self._next = memoryview(array("q", self.following))

    def next(self, at: int, here: int) -> int:
        """Return the index of the stop to which an agent on a node goes, given to which one it went so far."""
        return core.next_stop(self._ids, self._next, 0, len(self.nodes), at, here)


def _following(nodes: tuple[int, ...], begin: int, *, repeat: bool) -> int:
    at = begin
    for _ in nodes:  # no more than once round: they may all be the same node
        if at == len(nodes) or nodes[at] != nodes[begin]:
            break
        at = (at + 1) % len(nodes) if repeat else at + 1
    return at
