"""Strategies that need no enemies: they go somewhere, or are made of others."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from math import cos, inf, pi, sin
from typing import Any, overload
from weakref import WeakKeyDictionary

import numpy as np

from gamms.arguments import as_context, as_count, as_flag, as_float, as_int
from gamms.context import Context
from gamms.errors import BadValue
from gamms.game.batch.sight import blind
from gamms.game.batch.view import ArrayView
from gamms.ir.graph import FloatArray, IntArray
from gamms.strategies.knowledge import (
    as_known_node,
    as_otherwise,
    as_strategy,
    drawn_below,
    drawn_fraction,
    is_aerial,
    is_living,
    known_nodes,
    legal_nodes,
    move_to,
    node_of,
    nodes_in_view,
    required,
    shared_memory,
)
from gamms.text import shown_as_called
from gamms.typing import IContext
from gamms.typing.game import AerialState, AerialStrategy, NodeId, State, Strategy


def stay(state: State | AerialState) -> None:
    """Stay, on an edge too; it always sets an action."""
    if is_aerial(state):
        state["action"] = (0.0, 0.0, 0.0)
    else:
        state["action"] = state["curr_pos"] if state.get("edge") is None else None


def random_walk(state: State | AerialState) -> None:
    """Go to one of the legal nodes, the agent's own included, each as likely; fly in any horizontal direction.

    In games by metres an agent on an edge goes on to the end of it. Without `state["legal"]`, the legal nodes are those
    that a NEIGHBOR sensor shows.

    Raises:
        MissingKey: there is neither `state["draw"]` nor `state["rng"]`, or nothing that gives legal nodes.
    """
    if is_aerial(state):
        angle = 2.0 * pi * drawn_fraction(state, "random_walk")
        state["action"] = (cos(angle), sin(angle), 0.0)
    elif (edge := state.get("edge")) is not None:
        state["action"] = edge[1]
    else:
        legal = legal_nodes(state, "random_walk")
        state["action"] = legal[drawn_below(state, len(legal), "random_walk")]


@blind
def _stay_in_arrays(view: ArrayView) -> IntArray:
    return np.zeros_like(view.node)


@blind
def _walk_in_arrays(view: ArrayView) -> IntArray:
    return view.draw.below(view.counts)


stay.__dict__["array_form"] = _stay_in_arrays
random_walk.__dict__["array_form"] = _walk_in_arrays


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


@shown_as_called
def random_waypoints(
    ctx: Context, nodes: Iterable[NodeId] | None = None, pause: int = 0, otherwise: Strategy | None = stay
) -> Strategy:
    """Go to a node drawn at random, stay there for some turns, go to the next one drawn, and so forth.

    The random waypoint model (Johnson, Maltz: Dynamic source routing in ad hoc wireless networks, 1996) on a graph.
    The node and the turns that are left are in `state["memory"]`, under `"random_waypoints"`.

    Args:
        ctx: the context.
        nodes: ids to draw from; None: all nodes.
        pause: for how many turns it stays.
        otherwise: the strategy to use in a turn in which no path leads to the node; the next turn draws another one.

    Raises:
        UnknownName (KeyError), BadType, BadValue: one is not a node of the map, there are none, or `pause` is less
            than 0.
    """
    as_context(ctx, "random_waypoints")
    chosen = None if nodes is None else known_nodes(ctx, nodes, "random_waypoints", "nodes")
    turns, fallback = as_count(pause, "pause of random_waypoints", 0), as_otherwise(otherwise, "random_waypoints")

    def strategy(state: State) -> None:
        here, memory = node_of(state, "random_waypoints"), required(state, "memory", "random_waypoints")
        target, left = memory.get("random_waypoints", (None, 0))
        if target == here and left > 0:
            memory["random_waypoints"] = target, left - 1
        elif target is None or target == here or ctx.graph.graph.distance(here, target) == inf:
            options = ctx.graph.columns().node_ids.tolist() if chosen is None else chosen
            target = options[drawn_below(state, len(options), "random_waypoints")]
            memory["random_waypoints"] = target, turns
        move_to(ctx, state, target, fallback, "random_waypoints")

    return strategy


@shown_as_called
def sweep(
    ctx: Context,
    nodes: Iterable[NodeId] | None = None,
    by_sight: bool = False,
    repeat: bool = False,
    otherwise: Strategy | None = stay,
) -> Strategy:
    """Visit all nodes, each by one member of the team: always the nearest that is left in the agent's part of the map.

    The map is cut into parts with as many nodes each, one for each living member in the order of the names, by
    recursive coordinate bisection (Berger, Bokhari: A partitioning strategy for nonuniform problems on
    multiprocessors, 1987). An agent that is done with its part helps with the others. Which nodes were visited is in
    `state["team_memory"]`, and where the agent goes in `state["memory"]`, under `"sweep"`.

    Args:
        ctx: the context.
        nodes: ids of those to visit; None: all nodes.
        by_sight: whether nodes count as visited, too, on which the agent's sensors would show agents.
        repeat: begin again when all are visited.
        otherwise: the strategy to use when all are visited, or the rest cannot be reached; None sets no action then.

    Raises:
        UnknownName (KeyError), BadType, BadValue: one is not a node of the map, or there are none.
    """
    as_context(ctx, "sweep")
    chosen = None if nodes is None else known_nodes(ctx, nodes, "sweep", "nodes")
    sees, again = as_flag(by_sight, "by_sight of sweep"), as_flag(repeat, "repeat of sweep")
    fallback = as_otherwise(otherwise, "sweep")

    def strategy(state: State) -> None:
        here, memory, board = node_of(state, "sweep"), required(state, "memory", "sweep"), shared_memory(state, "sweep")
        visited = board.setdefault("visited", set())
        visited |= {here, *(nodes_in_view(ctx, state) if sees else ())}
        ids = ctx.graph.columns().node_ids.tolist() if chosen is None else chosen
        if again and visited.issuperset(ids):
            visited.clear()
            visited.add(here)
        target = memory.get("sweep target")
        if target is None or target in visited:
            target = memory["sweep target"] = _next_to_visit(ctx, state, ids, visited)
        move_to(ctx, state, target, fallback, "sweep")

    return strategy


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


@shown_as_called
def unblock(strategy: Strategy, after: int = 2) -> Strategy:
    """Play a strategy, and give way for some turns when other agents have blocked it for some.

    Two that stand face to face, or stand in a circle, would wait for each other for ever. So an agent that was in
    conflict for `after` turns draws lots: with a probability of one half it tries on; else it steps aside or back, and
    goes on away from there, for up to 1, 2, 4, ... turns the more often that happens (binary exponential backoff:
    Metcalfe, Boggs: Ethernet, 1976). How often is forgotten after as many turns without a conflict.

    It is in `state["memory"]`, under `"unblock"`.

    Args:
        strategy: of an agent on the ground.
        after: the number of turns in conflict after which it gives way.

    Raises:
        BadType, BadValue: `strategy` is not a function, or `after` is less than 1.
    """
    goes_on, patience = as_strategy(strategy, "strategy of unblock"), as_count(after, "after of unblock")

    def unblock(state: State) -> None:
        here, memory = node_of(state, "unblock"), required(state, "memory", "unblock")
        known = memory.get("unblock", _AT_EASE)
        is_blocked = "in conflict" in (required(state, "blocked", "unblock") or "")
        known = memory["unblock"] = _patience_left(state, known, patience, is_blocked=is_blocked)
        if known["yield"]:
            legal = legal_nodes(state, "unblock")
            options = [node for node in legal if node not in (here, known["ahead"])] or list(legal)
            state["action"] = options[drawn_below(state, len(options), "unblock")]
            memory["unblock"] = {**known, "ahead": here}
        else:
            goes_on(state)
            memory["unblock"] = {**known, "ahead": _first_node(state.get("action"))}

    return unblock


# -- steps ---------------------------------------------------------------------------------------------------------


_AT_EASE = {"blocked": 0, "calm": 0, "often": 0, "yield": 0, "ahead": None}  # turns, turns, times, turns, a node
_MOST_OFTEN = 8  # times: 256 turns of giving way


def _patience_left(state: State, known: dict[str, Any], patience: int, *, is_blocked: bool) -> dict[str, Any]:
    """Return what an agent remembers of being blocked after another turn; it draws when it has been so for long."""
    blocked = known["blocked"] + 1 if is_blocked else 0
    calm = 0 if is_blocked else known["calm"] + 1
    often = 0 if calm > 2 ** known["often"] else known["often"]
    left = max(0, known["yield"] - 1)
    if blocked >= patience and drawn_fraction(state, "unblock") < 0.5:
        often = min(often + 1, _MOST_OFTEN)
        return {"blocked": 0, "calm": 0, "often": often, "yield": _turns_drawn(state, often), "ahead": known["ahead"]}
    return {"blocked": blocked, "calm": calm, "often": often, "yield": left, "ahead": known["ahead"]}


def _turns_drawn(state: State, often: int) -> int:
    return 1 + drawn_below(state, 2 ** (often - 1), "unblock")


def _first_node(action: object) -> int | None:
    """Return the node to which an action leads first; None if it is none."""
    wanted = action.get("node_id") if isinstance(action, Mapping) else action
    if isinstance(wanted, Sequence):
        wanted = wanted[0] if wanted else None
    return None if wanted is None else as_int(wanted, "A node of an action")


def _next_to_visit(ctx: Context, state: State, ids: Sequence[int], visited: set[int]) -> int | None:
    """Return the nearest node that is left in the agent's part, else on the whole map; of several, the lowest id."""
    name, here = required(state, "name", "sweep"), state["curr_pos"]
    left = sorted(node for node in ids if node not in visited)
    team = required(state, "team", "sweep")
    members = [name] if team is None else sorted(one.name for one in ctx.agent.teams[team] if is_living(ctx, one.name))
    parts = _parts(ctx, tuple(ids), len(members))
    own = [node for node in left if node in parts[members.index(name)]]
    nearest = ctx.graph.routes.nearest(here, own)
    return ctx.graph.routes.nearest(here, left) if nearest is None else nearest


_cut: WeakKeyDictionary[Context, dict[Any, list[set[int]]]] = WeakKeyDictionary()  # the last cut of a map


def _parts(ctx: Context, ids: tuple[int, ...], number: int) -> list[set[int]]:
    """Return so many parts of some nodes, with as many nodes each, by cutting along the longer side again and again."""
    key = (ctx.graph.graph.revision, number, ids)
    if key not in (known := _cut.setdefault(ctx, {})):
        known.clear()
        known[key] = [set(part.tolist()) for part in _bisected(np.array(ids), ctx.graph.graph.positions(ids), number)]
    return known[key]


def _bisected(ids: IntArray, xy: FloatArray, number: int) -> list[IntArray]:
    if number <= 1:
        return [ids]
    axis = int(np.argmax(np.ptp(xy, axis=0))) if len(ids) else 0
    order = np.lexsort((ids, xy[:, axis]))
    first, second = np.split(order, [len(ids) * (number // 2) // number])
    return _bisected(ids[first], xy[first], number // 2) + _bisected(ids[second], xy[second], number - number // 2)


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
    stops = known_nodes(ctx, nodes, caller, "nodes")
    key, fallback = f"{caller} {list(stops)}", as_otherwise(otherwise, caller)

    def strategy(state: State) -> None:
        memory, here = required(state, "memory", caller), node_of(state, caller)
        if key not in memory and is_nearest_first:
            nearest = ctx.graph.routes.nearest(here, stops)
            memory[key] = 0 if nearest is None else stops.index(nearest)
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
