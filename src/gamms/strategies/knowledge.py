"""The knowledge of a strategy about its state and the map, and steps from node to node.

Strategies about enemies need `state["team"]`, and a sensor that shows agents: AGENT, AGENT_RANGE, AGENT_ARC or
OCCLUDED_AGENT. Such a sensor shows a flying agent at its nearest node.
"""

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from inspect import iscoroutinefunction
from math import inf
from typing import TYPE_CHECKING, Any, TypeVar, cast
from weakref import WeakKeyDictionary

from gamms.arguments import as_function_of, as_items
from gamms.context import Context
from gamms.errors import BadType, BadValue, MissingKey, UnknownName
from gamms.game.array_functions import aims
from gamms.game.movement.routes import RoutesFromNodes, RoutesWithTurns
from gamms.game.movement.travel import find_usable_graph, get_mode_graph
from gamms.game.strategy_specs import CoreStep, StrategySpec, declare, get_strategy_spec
from gamms.ir.agents import are_mates
from gamms.ir.graph import as_node_id, split_mode
from gamms.typing import IContext
from gamms.typing.game import AerialState, EdgeAction, NodeId, State, Strategy
from gamms.typing.sensor_engine import ON_GROUND, SensorType

if TYPE_CHECKING:
    from typing_extensions import TypeIs

F = TypeVar("F")

_warned: WeakKeyDictionary[IContext, set[str]] = WeakKeyDictionary()  # context -> strategies that were warned about

_WAYS_OUT = {
    "blocked": "set it to the reason why the agent's last action was refused, or None",
    "legal": "set it to the nodes it may move to, or give the agent a NEIGHBOR sensor",
    "memory": "set it to a dict that you store for the agent",
    "name": "set it to agent.name",
    "rng": "set it to a random generator, for example ctx.rng",
    "team": "set it to agent.team",
    "turn": "set it to the number of turns played",
}


def get_required(state: State | AerialState, key: str, caller: str) -> Any:
    """Return the value of a key that `ctx.game` sets in every state.

    Raises:
        MissingKey: the key is missing; the message explains how to set it in a custom loop.
    """
    if key not in state:
        raise MissingKey(f"{caller} needs state[{key!r}]. ctx.game sets it; in your own loop, {_WAYS_OUT[key]}.")
    return state[key]  # type: ignore[call-overload] # the keys of `_WAYS_OUT`


def draw_fraction(state: State | AerialState, caller: str) -> float:
    """Draw a number in [0, 1) from `state["draw"]`, or from `state["rng"]` in a custom loop."""
    if "draw" in state:
        return float(state["draw"].random())
    return float(get_required(state, "rng", caller).random())


def draw_below(state: State, n: int, caller: str) -> int:
    """Draw an integer from 0 to `n - 1` from `state["draw"]`, or from `state["rng"]` in a custom loop."""
    if "draw" in state:
        return int(state["draw"].below(n))
    return int(get_required(state, "rng", caller).integers(n))


def is_aerial(state: State | AerialState) -> "TypeIs[AerialState]":
    """Return whether the state is that of an aerial agent."""
    return isinstance(state["curr_pos"], tuple)


def get_node(state: State, caller: str) -> int:
    """Return the node of an agent on the ground.

    Raises:
        BadType: the agent flies.
    """
    if is_aerial(state):
        raise BadType(
            f"{caller} moves along edges, but the agent at {state['curr_pos']} flies. Give it another strategy."
        )
    return state["curr_pos"]


def list_legal_nodes(state: State, caller: str) -> Sequence[int]:
    """Return the legal nodes of a ground agent, its own first; without `state["legal"]` from a NEIGHBOR sensor."""
    if "legal" not in state:
        for kind, data in state["sensor"].values():
            if kind is SensorType.NEIGHBOR:
                near: Sequence[int] = data
                return near
    legal: Sequence[int] = get_required(state, "legal", caller)
    return legal


def get_graph(ctx: IContext, state: State) -> Any:  # Any: see `get_mode_graph`
    """Return the graph of the edges that an agent may use by its mode; without a mode or a name, the whole graph.

    If the agent obeys turn restrictions, it is `RoutesWithTurns`.
    """
    agent = ctx.agent.get_agent(state["name"]) if "name" in state else None
    mode = getattr(agent, "mode", None)
    if mode is None or not split_mode(mode)[1]:
        return get_mode_graph(ctx, mode)
    known: Any = state.get("fork")  # without a game, in a custom loop, the agent begins on its node
    driven = () if known is None else known.list_driven(state)
    place: Any = state.get("edge")
    graph = find_usable_graph(ctx, mode)
    return RoutesWithTurns(graph, mode, state["curr_pos"], driven, place, is_in_game=known is not None)


def get_graph_of_mode(ctx: IContext, mode: str | None) -> Any:  # Any: see `get_mode_graph`
    """Return the graph of the edges that other agents of a mode may use; if they obey turns, `RoutesFromNodes`."""
    if mode is None or not split_mode(mode)[1]:
        return get_mode_graph(ctx, mode)
    return RoutesFromNodes(find_usable_graph(ctx, mode), mode)


def move_on(graph: object, node: int) -> Any:  # Any: see `get_mode_graph`
    """Return the graph of an agent, see `get_graph`, after it has moved to a node."""
    return graph.move_on(node) if isinstance(graph, RoutesWithTurns) else graph


def list_legal_on_map(ctx: IContext, state: State) -> Sequence[int]:
    """Return the legal nodes of an agent on the ground, its own first; by the map if `state["legal"]` is missing."""
    legal: Sequence[int] | None = state.get("legal")
    if legal is None:
        legal = get_graph(ctx, state).neighborhoods[state["curr_pos"]]
    return legal


def has_speed(ctx: IContext, state: State) -> bool:
    """Return whether an agent on the ground may move along several edges, or part of one, in a turn of `ctx.game`."""
    if "legal" not in state or "name" not in state:
        return False  # in a custom loop a speed may mean anything
    return getattr(ctx.agent.get_agent(state["name"]), "speed", None) is not None


def choose_weight(ctx: IContext, state: State) -> str | None:
    """Return the edge weight by which an agent on the ground chooses its paths."""
    if not is_going_far(ctx, state):
        return "length"
    game = cast("Context", ctx).game
    return "length" if game.speed_unit == "edges" else game.weight


def is_going_far(ctx: IContext, state: State) -> bool:
    """Return whether an agent on the ground has a speed and a path to go, because it may not go to any node at once."""
    return has_speed(ctx, state) and cast("Context", ctx).game.legal == "edges"


def find_enemies_in_sight(ctx: IContext, state: State, caller: str) -> dict[str, int]:
    """Return the nodes of the enemies that the agent's sensors show, by name, sorted by name."""
    team = get_required(state, "team", caller)
    if caller not in (warned := _warned.setdefault(ctx, set())) and not _is_showing_agents(state):
        warned.add(caller)  # once in a context
        kinds = ", ".join(sorted(kind.name for kind in ON_GROUND))
        who = f"agent {state['name']!r}" if "name" in state else "an agent"
        ctx.logger.warning(
            f"{caller}: {who} carries no sensor that shows agents, so it sees no enemies. Give it one of {kinds}."
        )
    return {name: node for name, node, other in _list_agents_in_sight(ctx, state) if not are_mates(team, other)}


def find_mates_in_sight(ctx: IContext, state: State) -> dict[str, int]:
    """Return the nodes of the teammates that the agent's sensors show, by name, sorted by name."""
    team = state["team"]
    return {name: node for name, node, other in _list_agents_in_sight(ctx, state) if are_mates(team, other)}


def _is_showing_agents(state: State) -> bool:
    return any(kind in ON_GROUND for kind, _ in state["sensor"].values())


def _list_agents_in_sight(ctx: IContext, state: State) -> list[tuple[str, int, Hashable]]:
    """Return (name, node, team) of the agents that the sensors show, sorted by name."""
    seen: dict[str, int] = {}
    for kind, data in state["sensor"].values():
        if kind in ON_GROUND:
            seen.update(data)
    seen.pop(state.get("name", ""), None)  # a sensor at a fixed place also shows its owner
    there = ctx.agent.agents  # without agents that were deleted after a sensor with a delay saw them
    return [(name, seen[name], getattr(there[name], "team", None)) for name in sorted(seen) if name in there]


def find_nodes_in_view(ctx: IContext, state: State) -> set[int]:
    """Return the nodes on which the agent's sensors would show agents with a positive probability."""
    agent = ctx.agent.get_agent(state["name"])
    found = set[int]()
    for name, (kind, _) in state["sensor"].items():
        if kind in ON_GROUND:
            covered = agent.sensors[name].coverage(state["curr_pos"], state["name"])
            found.update(covered.node_ids[covered.detection > 0.0].tolist())
    return found


def as_known_node(ctx: IContext, value: object, name: str) -> int:
    """Check that a value is a node id of the map.

    Raises:
        BadType, UnknownName (KeyError): not a node id, or not on the map.
    """
    node = as_node_id(value, name, ctx.graph)
    if not ctx.graph.graph.has_node(node):
        raise UnknownName("node", node, ctx.graph.graph.get_nodes())
    return node


def as_strategy(value: F, name: str) -> F:
    """Check that a value is a function of the state.

    Raises:
        BadType: the value is not such a function, is an `async def`, or returns a strategy instead of being one.
    """
    as_function_of(value, name, "the state")
    if iscoroutinefunction(value) or iscoroutinefunction(getattr(value, "__call__", None)):  # noqa: B004 - it is looked at
        raise BadType(f"{name} must not be an async def: await it in your own async def.")
    return value


def check_nodes(ctx: IContext, values: Iterable[NodeId], caller: str, kind: str) -> tuple[int, ...]:
    """Check that values are node ids of the map, at least one.

    Raises:
        BadType, BadValue, UnknownName (KeyError): a value is not a node id, or there is none.
    """
    name = f"{kind} of {caller}"
    nodes = tuple(as_known_node(ctx, node, f"Each of {name}") for node in as_items(values, name, "node ids"))
    if not nodes:
        raise BadValue(f"{caller} needs at least one node.")
    return nodes


def get_shared_memory(state: State, key: str) -> dict[Any, Any]:
    """Return the writable dict under a key of the team's memory, or of the agent's own if it shares none."""
    is_shared = state.get("team") is not None and "team_memory" in state
    memory: dict[Any, Any] = state["team_memory"] if is_shared else get_required(state, "memory", key)
    found: dict[Any, Any] = memory.setdefault(key, {})
    return found


# -- steps ----------------------------------------------------------------------------------------------------


def move_to(ctx: IContext, state: State, target: int | None, fallback: Strategy, caller: str) -> None:
    """Set the action to a step toward a node; call the fallback if there is no node, or no path to it."""
    step = None if target is None else step_towards(ctx, state, target, caller)
    if step is None:
        fallback(state)
    else:
        state["action"] = step


def move_to_agent(
    ctx: IContext, state: State, target: int | None, seen: Mapping[str, int], fallback: Strategy, caller: str
) -> None:
    """Set the action to a step toward a visible agent: to the last node it passed, and on along its edge.

    Args:
        ctx: the context.
        state: state of an agent on the ground.
        target: the node; None: no agent is visible.
        seen: the visible agents with the last nodes that they passed; the first agent at `target` is followed.
        fallback: called if there is no target, or no path.
        caller: name of the strategy, for messages.
    """
    name = next((name for name, node in seen.items() if node == target), None)
    its: Any = None if name is None or "edge" not in state else getattr(ctx.agent.get_agent(name), "edge", None)
    if its is None or its[0] != target:
        move_to(ctx, state, target, fallback, caller)
        return
    graph = get_graph(ctx, state)
    lengths = ctx.graph.graph
    edge = state["edge"]
    source, end, street = its
    if isinstance(graph, RoutesWithTurns):  # it follows the other one: to the street, and then along it
        move_to(ctx, state, end if state["curr_pos"] == source else source, fallback, caller)
        return
    gone = getattr(ctx.agent.get_agent(cast("str", name)), "offset_m", 0.0)
    length = lengths.get_edge(street).length
    can_turn = edge is None or edge[0] in graph.neighborhoods[edge[1]]  # not on a one-way road
    if edge is not None and set(edge[:2]) == {source, end}:  # both are on one street
        offset = state["offset_m"] if edge[0] == source else length - state["offset_m"]
        ahead = end if offset < gone else source
        if can_turn or ahead == edge[1]:
            state["action"] = ahead
            return
    starts = {state["curr_pos"]: state["offset_m"]} if can_turn else {}
    if edge is not None:
        starts[edge[1]] = lengths.get_edge(edge[2]).length - state["offset_m"]
    ways = [(source, end, gone)] if graph is lengths or end in graph.neighborhoods[source] else []
    if source in graph.neighborhoods[end]:
        ways.append((end, source, length - gone))
    far, start, first, last = min(
        (
            (begun + graph.distance(start, first) + rest, start, first, last)
            for start, begun in starts.items()
            for first, last, rest in ways
        ),
        default=(inf, source, source, source),  # the agent may not use the street of the other one
    )
    if far == inf:
        fallback(state)
    else:
        state["action"] = [*graph.shortest_path(start, first), last]


def step_towards(
    ctx: IContext, state: State, target: int, caller: str, is_allowed: Callable[[int], bool] | None = None
) -> int | list[int] | EdgeAction | None:
    """Return the action that leads toward a node: the node itself if it is legal, else a step of the shortest path.

    Args:
        ctx: the context.
        state: state of an agent on the ground.
        target: a node id.
        caller: name of the strategy, for messages.
        is_allowed: whether the agent may enter a node; None: every node.

    Returns:
        See `gamms.game.array_functions.aims.step_towards` and `step_with_turns`; None if there is no path.

    Raises:
        BadType: the agent flies.
    """
    here = get_node(state, caller)
    is_paced = has_speed(ctx, state)
    ends: tuple[int, ...] = ()
    if is_paced and state.get("xy") is not None:
        ends = (here,) if state["edge"] is None else (here, state["edge"][1])
    legal = list_legal_on_map(ctx, state)
    graph = get_graph(ctx, state)
    if isinstance(graph, RoutesWithTurns):
        return aims.step_with_turns(graph, legal, target, by_metres=bool(ends), is_allowed=is_allowed)
    weight = choose_weight(ctx, state)
    return aims.step_towards(
        graph, here, legal, target, weight=weight, has_speed=is_paced, ends=ends, is_allowed=is_allowed
    )


def as_otherwise(otherwise: Strategy | None, caller: str) -> Strategy:
    """Return the fallback strategy; for None a strategy that sets no action."""
    return _pass if otherwise is None else as_strategy(otherwise, f"otherwise of {caller}")


def _pass(_: object) -> None:
    """Set no action."""


# -- strategies in the core -----------------------------------------------------------------------------------


def offer_steps(strategy: Callable[..., None], *steps: CoreStep | Callable[[Any], None] | None) -> None:
    """Declare the steps by which the core plays a strategy, if all strategies that it calls have steps, too.

    Args:
        strategy: a function of the state.
        steps: steps that the core tries, in order; strategies that the strategy calls; None: the core cannot play it.
    """
    several = [(one,) if isinstance(one, CoreStep) else get_strategy_spec(one).core_steps for one in steps]
    if None not in several:
        declare(strategy, StrategySpec(core_steps=tuple(step for own in several for step in own or ())))


offer_steps(_pass)
