"""Strategies without enemies: movement, and combinations of strategies."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from math import cos, inf, pi, sin
from typing import Any, TypeVar, overload

from gamms.arguments import as_context, as_count, as_float, find_signature, show_as_call
from gamms.context import Context
from gamms.core import strategies as core
from gamms.errors import BadType, BadValue
from gamms.game.strategy_specs import CoreStep, get_strategy_spec
from gamms.ir.graph import as_node_id
from gamms.strategies.knowledge import (
    as_known_node,
    as_otherwise,
    as_strategy,
    check_nodes,
    choose_weight,
    draw_below,
    draw_fraction,
    get_graph,
    get_node,
    get_required,
    is_aerial,
    is_going_far,
    list_legal_nodes,
    list_legal_on_map,
    move_to,
    offer_steps,
)
from gamms.strategies.stops import route
from gamms.text import shown
from gamms.typing import IContext
from gamms.typing.game import AerialState, AerialStrategy, NodeId, State, Strategy

F = TypeVar("F", bound=Callable[..., None])


def _check_call(strategy: F) -> F:
    """Return the strategy with a check that explains a call without a state."""
    # NOTE: a default argument, because a wrapper would be called for every agent and turn (benchmarks: turns).
    function: Any = strategy
    function.__signature__ = find_signature(strategy)  # without the default
    function.__defaults__ = (None,)
    return strategy


@_check_call
def stay(state: State | AerialState) -> None:
    """Stay, also on an edge; it always sets an action."""
    try:
        if is_aerial(state):
            state["action"] = (0.0, 0.0, 0.0)
        else:
            state["action"] = state["curr_pos"] if state.get("edge") is None else None
    except TypeError:
        raise _make_call_error(state, "stay") from None


@_check_call
def random_walk(state: State | AerialState) -> None:
    """Go to a legal node, maybe the agent's own, with equal probabilities; fly in a random horizontal direction.

    In games by metres an agent on an edge goes on to its end. Without `state["legal"]`, the legal nodes are those that
    a NEIGHBOR sensor shows.

    Raises:
        MissingKey: the state has neither `draw` nor `rng`, or no source of legal nodes.
    """
    try:
        draw = state.get("draw")
        legal = state.get("legal")
    except AttributeError:
        raise _make_call_error(state, "random_walk") from None
    if draw is not None and legal and state.get("edge") is None:  # the usual case first: it is called most often
        state["action"] = legal[draw.below(len(legal))]
    elif is_aerial(state):
        angle = 2.0 * pi * draw_fraction(state, "random_walk")
        state["action"] = (cos(angle), sin(angle), 0.0)
    elif (edge := state.get("edge")) is not None:
        state["action"] = edge[1]
    else:
        legal = state["legal"] if "legal" in state else list_legal_nodes(state, "random_walk")
        state["action"] = legal[draw_below(state, len(legal), "random_walk")]


def _make_call_error(given: object, name: str) -> BadType:
    """Return the error for a strategy that was called where its name was meant."""
    return BadType(
        f"{name} is a strategy, which games call with a state, not with {shown(given)}. Write "
        f"strategy={name}, without calling it."
    )


offer_steps(stay, CoreStep("stay"))
offer_steps(random_walk, CoreStep("walk"))


@show_as_call
def goto(
    ctx: IContext, target: NodeId | Callable[[State], NodeId | None], otherwise: Strategy | None = stay
) -> Strategy:
    """Go to a node, and stay there.

    Args:
        ctx: the context.
        target: a node id, or a function of the state that returns one, or None for no target.
        otherwise: the strategy to use if there is no target, or no path; None sets no action.

    Raises:
        UnknownName (KeyError), BadType: the target is not on the map.
    """
    as_context(ctx, "goto")
    fixed = None if callable(target) else as_known_node(ctx, target, "target of goto")
    fallback = as_otherwise(otherwise, "goto")

    def strategy(state: State) -> None:
        node = target(state) if callable(target) else fixed
        move_to(ctx, state, None if node is None else as_known_node(ctx, node, "target of goto"), fallback, "goto")

    if fixed is not None:
        offer_steps(strategy, CoreStep("go", (fixed,)), fallback)
    return strategy


@show_as_call
def follow_path(
    ctx: Context, nodes: Iterable[NodeId], repeat: bool = False, otherwise: Strategy | None = stay
) -> Strategy:
    """Go to the nodes of a list in order, each by the shortest path.

    An agent with a speed continues beyond a node of the list in the turn in which it arrives there. The index of the
    next node is in `state["memory"]`, under `"follow_path [<nodes>]"`; the path of the last turn is under this key and
    `" way"`.

    Args:
        ctx: the context.
        nodes: ids; consecutive nodes need not be neighbors on the map.
        repeat: whether to start again after the last node.
        otherwise: the strategy to use after the last node, or if there is no path; None sets no action.

    Raises:
        UnknownName (KeyError), BadType, BadValue: a node is not on the map, or there are no nodes.
    """
    return route(ctx, nodes, otherwise, "follow_path", repeat=repeat)


@show_as_call
def patrol(ctx: Context, nodes: Iterable[NodeId], otherwise: Strategy | None = stay) -> Strategy:
    """Visit nodes in a cycle, beginning with the nearest by road; ties go to the first node of the list.

    An agent with a speed continues beyond a node of the list in the turn in which it arrives there. The index of the
    next node is in `state["memory"]`, under `"patrol [<nodes>]"`; the path of the last turn is under this key and `"
    way"`.

    Args:
        ctx: the context.
        nodes: ids; consecutive nodes need not be neighbors on the map.
        otherwise: the strategy to use if there is no path; None sets no action.

    Raises:
        UnknownName (KeyError), BadType, BadValue: a node is not on the map, or there are no nodes.
    """
    return route(ctx, nodes, otherwise, "patrol", repeat=True, is_nearest_first=True)


@show_as_call
def random_waypoints(
    ctx: Context, nodes: Iterable[NodeId] | None = None, pause: int = 0, otherwise: Strategy | None = stay
) -> Strategy:
    """Go to a random node, stay there for some turns, go to the next random node, and so on.

    Only nodes are drawn that the agent can reach, by its mode and by open roads, unless it can reach none.

    The random waypoint model (Johnson, Maltz: Dynamic source routing in ad hoc wireless networks, 1996) on a graph.
    The target node and the remaining turns are in `state["memory"]`, under `"random_waypoints"`.

    Args:
        ctx: the context.
        nodes: ids to draw from; None: all nodes.
        pause: number of turns to stay.
        otherwise: the strategy to use in a turn without a path to the node; the next turn draws another node.

    Raises:
        UnknownName (KeyError), BadType, BadValue: a node is not on the map, there are no nodes, or `pause` is less than
            0.
    """
    as_context(ctx, "random_waypoints")
    chosen = None if nodes is None else check_nodes(ctx, nodes, "random_waypoints", "nodes")
    turns = as_count(pause, "pause of random_waypoints", 0)
    fallback = as_otherwise(otherwise, "random_waypoints")

    def strategy(state: State) -> None:
        here = get_node(state, "random_waypoints")
        memory = get_required(state, "memory", "random_waypoints")
        target, left = memory.get("random_waypoints", (None, 0))
        is_there = target == here
        weight = choose_weight(ctx, state)
        far = inf if target is None or is_there else get_graph(ctx, state).distance(here, target, weight)
        left = core.count_turns_left(is_there, left, far)
        if left < 0:
            options = ctx.graph.columns().node_ids.tolist() if chosen is None else chosen
            target = _draw_waypoint(ctx, state, options)
            left = turns
        memory["random_waypoints"] = target, left
        move_to(ctx, state, target, fallback, "random_waypoints")

    offer_steps(strategy, CoreStep("wander", chosen, turns, key="random_waypoints"), fallback)
    return strategy


def _draw_waypoint(ctx: Context, state: State, options: Sequence[int]) -> int:
    """Draw a node; if the agent cannot reach it, draw one of those that it can reach, if there are any."""
    here = state["curr_pos"]
    graph = get_graph(ctx, state)
    weight = choose_weight(ctx, state)
    drawn = options[draw_below(state, len(options), "random_waypoints")]
    is_near = not is_going_far(ctx, state) and drawn in list_legal_on_map(ctx, state)
    if is_near or graph.distance(here, drawn, weight) < inf:
        return drawn
    near = graph.distances(source=here, weight=weight)
    within = [node for node in options if node in near]
    return within[draw_below(state, len(within), "random_waypoints")] if within else drawn


# -- combinations -------------------------------------------------------------------------------------------------


@overload
def first(*strategies: Strategy) -> Strategy: ...
@overload
def first(*strategies: AerialStrategy) -> AerialStrategy: ...
@show_as_call
def first(*strategies: Callable[[Any], None]) -> Callable[[Any], None]:
    """Call strategies in order until one sets an action.

    An action that is already set is removed first.

    Raises:
        BadType, BadValue: one of them is not a function, or no strategy is given.
    """
    if not strategies:
        raise BadValue("first needs at least one strategy.")
    options = tuple(as_strategy(option, "Each strategy of first") for option in strategies)

    def strategy(state: State) -> None:
        state.pop("action", None)
        for option in options:
            option(state)
            if "action" in state:
                return

    offer_steps(strategy, *options)
    return strategy


@overload
def mix(p: float, a: Strategy, b: Strategy) -> Strategy: ...
@overload
def mix(p: float, a: AerialStrategy, b: AerialStrategy) -> AerialStrategy: ...
@show_as_call
def mix(p: float, a: Callable[[Any], None], b: Callable[[Any], None]) -> Callable[[Any], None]:
    """Call `a` with probability `p`, else `b`; one number is drawn from `state["draw"]` in every turn.

    Raises:
        BadType, BadValue: `p` is not from 0 to 1, or `a` or `b` is not a function.
    """
    chance = as_float(p, "p of mix")
    if not 0.0 <= chance <= 1.0:
        raise BadValue(f"p of mix must be a probability from 0 to 1, not {chance}.")
    options = as_strategy(b, "b of mix"), as_strategy(a, "a of mix")

    def strategy(state: State) -> None:
        options[core.is_drawn(draw_fraction(state, "mix"), chance)](state)

    first, second = (get_strategy_spec(one).core_steps for one in (a, b))
    if first is not None and second is not None:
        begin = CoreStep("mix", number=len(first) + 1, chance=chance)
        skip = CoreStep("skip", number=len(second))
        offer_steps(strategy, begin, a, skip, b)
    else:
        offer_steps(strategy, None, a, b)
    return strategy


@overload
def human(read: Callable[[State], Any]) -> Strategy: ...
@overload
def human(read: Callable[[AerialState], Any]) -> AerialStrategy: ...
@show_as_call
def human(read: Callable[[Any], Any]) -> Callable[[Any], None]:
    """Ask a person to decide, through any user interface.

    Args:
        read: called with the state, returns the action; None sets no action. The game checks the action.

    Raises:
        BadType: `read` cannot be called.
    """
    ask = as_strategy(read, "read of human")

    def strategy(state: State) -> None:
        action = ask(state)
        if action is not None:
            state["action"] = action

    return strategy


@show_as_call
def unblock(strategy: Strategy, after: int = 2) -> Strategy:
    """Play a strategy, and give way for some turns after other agents have blocked it for some turns.

    Two agents face to face, or agents in a circle, would wait for each other forever. So an agent that was in conflict
    for `after` turns draws a random number: with probability one half it tries again; else it steps aside or back, and
    moves away from there, for up to 1, 2, 4, ... turns the more often this happens (binary exponential backoff:
    Metcalfe, Boggs: Ethernet, 1976). The count is reset after as many turns without a conflict.

    The state is in `state["memory"]`, under `"unblock"`.

    Args:
        strategy: the strategy of an agent on the ground.
        after: the number of turns in conflict after which it gives way.

    Raises:
        BadType, BadValue: `strategy` is not a function, or `after` is less than 1.
    """
    goes_on = as_strategy(strategy, "strategy of unblock")
    patience = as_count(after, "after of unblock")

    def unblock(state: State) -> None:
        here = get_node(state, "unblock")
        memory = get_required(state, "memory", "unblock")
        known = memory.get("unblock", _NOT_BLOCKED)
        is_blocked = "in conflict" in (get_required(state, "blocked", "unblock") or "")
        known = _count_patience(state, known, patience, is_blocked=is_blocked)
        memory["unblock"] = known
        if known["yield"]:
            legal = list_legal_nodes(state, "unblock")
            options = [node for node in legal if node not in (here, known["ahead"])] or list(legal)
            state["action"] = options[draw_below(state, len(options), "unblock")]
            memory["unblock"] = {**known, "ahead": here}
        else:
            goes_on(state)
            memory["unblock"] = {**known, "ahead": _find_first_node(state.get("action"))}

    offer_steps(unblock, None, goes_on)
    return unblock


# -- counters ------------------------------------------------------------------------------------------------------


_NOT_BLOCKED = {"blocked": 0, "calm": 0, "often": 0, "yield": 0, "ahead": None}  # turns, turns, times, turns, a node
_MOST_OFTEN = 8  # times: up to 256 turns of giving way


def _count_patience(state: State, known: dict[str, Any], patience: int, *, is_blocked: bool) -> dict[str, Any]:
    """Return the counters of an agent after another turn; draws a number if it was blocked for long."""
    blocked = known["blocked"] + 1 if is_blocked else 0
    calm = 0 if is_blocked else known["calm"] + 1
    often = 0 if calm > 2 ** min(known["often"], _MOST_OFTEN) else known["often"]
    left = max(0, known["yield"] - 1)
    if blocked >= patience and draw_fraction(state, "unblock") < 0.5:
        often = min(often + 1, _MOST_OFTEN)
        turns = 1 + draw_below(state, 2 ** (often - 1), "unblock")
        return {"blocked": 0, "calm": 0, "often": often, "yield": turns, "ahead": known["ahead"]}
    return {"blocked": blocked, "calm": calm, "often": often, "yield": left, "ahead": known["ahead"]}


def _find_first_node(action: object) -> int | None:
    """Return the first node of an action; None for no action."""
    wanted = action.get("node_id") if isinstance(action, Mapping) else action
    if isinstance(wanted, Sequence):
        wanted = wanted[0] if wanted else None
    return None if wanted is None else as_node_id(wanted, "A node of an action")
