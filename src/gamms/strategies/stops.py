"""The strategy of an agent that visits the nodes of a list, the stops, as far as each turn allows."""

from array import array
from collections.abc import Iterable
from math import floor, inf

from gamms.arguments import as_context
from gamms.context import Context
from gamms.core import strategies as core
from gamms.errors import NoPath
from gamms.game.movement.routes import RoutesWithTurns
from gamms.game.movement.travel import get_mode_graph
from gamms.game.strategy_specs import CoreStep
from gamms.strategies.knowledge import (
    as_otherwise,
    check_nodes,
    get_graph,
    get_node,
    get_required,
    has_speed,
    list_legal_on_map,
    move_to,
    offer_steps,
)
from gamms.strategies.paces import find_pace
from gamms.typing.game import NodeId, State, Strategy
from gamms.typing.graph_engine import IGraph

Step = tuple[int, int, float]  # node, index of the next stop from there, distance in edges or map units
# the path of one turn: its length limit, and its steps, beginning with the agent's own node
TurnPath = tuple[float, list[Step]]

_MOST_NODES = 10_000  # nodes of a path: an agent of unlimited speed would circle forever


def route(
    ctx: Context,
    nodes: Iterable[NodeId],
    otherwise: Strategy | None,
    caller: str,
    *,
    repeat: bool,
    is_nearest_first: bool = False,
) -> Strategy:
    """Return a strategy that goes from one stop to the next, and remembers the next stop."""
    as_context(ctx, caller)
    stops = StopList(check_nodes(ctx, nodes, caller, "nodes"), repeat=repeat)
    key = f"{caller} {list(stops.nodes)}"
    way_key = f"{key} way"
    fallback = as_otherwise(otherwise, caller)

    def strategy(state: State) -> None:
        memory = get_required(state, "memory", caller)
        here = get_node(state, caller)
        if key not in memory and is_nearest_first:
            nearest = get_graph(ctx, state).routes.nearest(here, stops.nodes)
            memory[key] = 0 if nearest is None else stops.nodes.index(nearest)
        at = _stop_after(memory.pop(way_key, None), state, memory.get(key, 0))
        at = stops.find_next(at, here)
        memory[key] = at
        target = stops.nodes[at] if at < len(stops.nodes) else None
        way = None
        if target in list_legal_on_map(ctx, state) and _may_pass_stop(ctx, state):
            way = _find_path_of_turn(ctx, state, stops, at)
        if way is None:
            move_to(ctx, state, target, fallback, caller)
            return
        memory[way_key] = way
        path = [node for node, *_ in way[1]]
        # a path that turns around names the agent's own node twice
        state["action"] = path if path[1] == here else path[1:]

    step = CoreStep("follow", stops.nodes, int(is_nearest_first), stops.following, key)
    offer_steps(strategy, step, fallback)
    return strategy


# -- the path of one turn -------------------------------------------------------------------------------------------


def _may_pass_stop(ctx: Context, state: State) -> bool:
    """Return whether an agent may pass a stop within a turn without deciding there; where turns count, it stops."""
    if ctx.current_game is None or not has_speed(ctx, state) or isinstance(get_graph(ctx, state), RoutesWithTurns):
        return False
    return ctx.game.legal == "edges" and ctx.game.decide == "turn"


def _find_path_of_turn(ctx: Context, state: State, stops: "StopList", at: int) -> TurnPath | None:
    """Return the path through the stops from index `at`, up to the first node out of reach in this turn.

    Args:
        ctx: the context.
        state: state of an agent with a speed.
        stops: the list.
        at: index of the next stop, which is legal.

    Returns:
        None if no path leads to the next stop.
    """
    unit, speed, mode = find_pace(ctx, state["name"])
    graph = get_mode_graph(ctx, mode)
    reach = speed + 1.0 if unit is None else speed  # the agent may have covered part of an edge before
    last = state["curr_pos"]
    far = 0.0
    steps = [(last, at, -state.get("offset_m", 0.0))]
    if state.get("edge") is not None:
        last, far = _end_of_edge(ctx, state, stops.nodes[at])
        at = stops.find_next(at, last)
        steps.append((last, at, far))
    while at < len(stops.nodes) and far < reach and len(steps) < _MOST_NODES:
        weight: str | None = "length"
        if unit is not None:
            weight = ctx.game.weight
        elif len(steps) == 1 or graph.distance(last, stops.nodes[at], None) <= max(1.0, speed - far):
            weight = None  # to a legal node an agent takes the fewest edges
        path = _find_path(graph, last, stops.nodes[at], weight)
        for node in path:
            far += graph.distance(last, node, unit)
            at = stops.find_next(at, node)
            steps.append((node, at, far))
            last = node
            if far >= reach:
                break
        if not path:
            break
    covers = floor(speed) + 0.5 if unit is None and speed < inf else speed
    return None if len(steps) == 1 else (min(covers, far), steps)


def _end_of_edge(ctx: Context, state: State, target: int) -> tuple[int, float]:
    """Return the end of the agent's edge that leads to a node, and the distance to this end."""
    graph = get_graph(ctx, state)
    weight = ctx.game.weight
    source, end, edge = state["edge"]  # type: ignore[misc] # the agent is on one
    length = graph.get_edge(edge).length
    gone = state["offset_m"] / length
    cost = graph.distance(source, end, weight)
    ahead = (1.0 - gone) * cost + graph.distance(end, target, weight)
    may_turn = state["legal"][0] == source
    behind = gone * cost + graph.distance(source, target, weight) if may_turn else inf
    return (source, state["offset_m"]) if behind < ahead else (end, length - state["offset_m"])


def _find_path(graph: IGraph, source: int, target: int, weight: str | None) -> list[int]:
    """Return the nodes after `source` on the shortest path; empty if there is no path."""
    try:
        found: list[int] = graph.shortest_path(source, target, weight)[1:]
    except NoPath:
        found = []
    return found


def _stop_after(way: TurnPath | None, state: State, before: int) -> int:
    """Return the index of the next stop of an agent on this path; `before` if it is not on the path."""
    here = state["curr_pos"]
    if way is None or (state.get("blocked") and way[1][0][0] == here):
        return before
    covers, steps = way
    gone = state.get("offset_m", 0.0)
    passed = [(abs(far + gone - covers), stop) for node, stop, far in steps if node == here]
    return min(passed)[1] if passed else before  # a path may pass a node more than once


class StopList:
    """A list of nodes to visit, and the index of the next one.

    Args:
        nodes: ids of the stops.
        repeat: whether the first stop follows the last.

    Attributes:
        nodes: the argument `nodes`.
        following: for each stop, the index of the next stop on another node; the number of stops if there is none.
    """

    def __init__(self, nodes: tuple[int, ...], *, repeat: bool) -> None:
        self.nodes = nodes
        self.following = tuple(_find_following(nodes, at, repeat=repeat) for at in range(len(nodes)))
        self._ids = memoryview(array("q", nodes))
        self._next = memoryview(array("q", self.following))

    def find_next(self, at: int, here: int) -> int:
        """Return the index of the next stop, for an agent on node `here` whose next stop was `at`."""
        return core.find_next_stop(self._ids, self._next, 0, len(self.nodes), at, here)


def _find_following(nodes: tuple[int, ...], begin: int, *, repeat: bool) -> int:
    at = begin
    for _ in nodes:  # at most once around: all stops may be the same node
        if at == len(nodes) or nodes[at] != nodes[begin]:
            break
        at = (at + 1) % len(nodes) if repeat else at + 1
    return at
