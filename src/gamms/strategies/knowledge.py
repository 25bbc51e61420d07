"""What a strategy knows of its state and of the map, and how it goes from node to node.

Strategies that act on enemies need `state["team"]`, and a sensor that shows agents: AGENT, AGENT_RANGE, AGENT_ARC or
OCCLUDED_AGENT. Such a sensor shows a flyer at the node nearest to it.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from inspect import iscoroutinefunction
from itertools import takewhile
from math import inf, isfinite
from typing import TYPE_CHECKING, Any, TypeVar, cast
from weakref import WeakKeyDictionary

from gamms.arguments import as_function_of, as_int, as_items
from gamms.errors import BadType, BadValue, MissingKey, NoPath, UnknownName
from gamms.game.batch.forms import CoreStep, StrategySpec, declare, strategy_spec_of
from gamms.game.batch.strategy_steps import begin_steps
from gamms.typing import IContext
from gamms.typing.game import AerialState, NodeId, State, Strategy
from gamms.typing.sensor_engine import SensorType

if TYPE_CHECKING:
    from typing_extensions import TypeIs

F = TypeVar("F")

# The kinds that those on the ground may carry; data: {name: node}
_SHOWING_AGENTS = {SensorType.AGENT, SensorType.AGENT_RANGE, SensorType.AGENT_ARC, SensorType.OCCLUDED_AGENT}

_warned: WeakKeyDictionary[IContext, set[str]] = WeakKeyDictionary()  # context -> strategies warned about

_WAYS_OUT = {
    "blocked": "set it to why the agent's last action was not done, or None",
    "legal": "set it to the nodes it may move to, or give the agent a NEIGHBOR sensor",
    "memory": "set it to a dict that you keep for the agent",
    "name": "set it to agent.name",
    "rng": "set it to a generator, such as ctx.rng",
    "team": "set it to agent.team",
    "turn": "set it to the number of turns that were played",
}


def required(state: State | AerialState, key: str, caller: str) -> Any:
    """Return the value of a key that `ctx.game` puts into every state.

    Raises:
        MissingKey: there is none; the message says what to do about it in a loop of one's own.
    """
    if key not in state:
        raise MissingKey(
            f"{caller} needs state[{key!r}]. ctx.game puts it there; in a loop of your own, {_WAYS_OUT[key]}."
        )
    return state[key]  # type: ignore[call-overload] # the keys of `_WAYS_OUT`


def drawn_fraction(state: State | AerialState, caller: str) -> float:
    """Draw a number in [0, 1): from `state["draw"]`, or from `state["rng"]` in a loop that has only that."""
    if "draw" in state:
        return float(state["draw"].random())
    return float(required(state, "rng", caller).random())


def drawn_below(state: State, n: int, caller: str) -> int:
    """Draw an integer from 0 to `n - 1`, likewise."""
    if "draw" in state:
        return int(state["draw"].below(n))
    return int(required(state, "rng", caller).integers(n))


def is_aerial(state: State | AerialState) -> "TypeIs[AerialState]":
    """Whether the state is that of an aerial agent."""
    return isinstance(state["curr_pos"], tuple)


def node_of(state: State, caller: str) -> int:
    """Return the node that an agent on the ground is on.

    Raises:
        BadType: the agent flies.
    """
    if is_aerial(state):
        raise BadType(
            f"{caller} goes along edges, and an agent at {state['curr_pos']} flies. Give it another strategy."
        )
    return state["curr_pos"]


def legal_nodes(state: State, caller: str) -> Sequence[int]:
    """Return the nodes that an agent on the ground may move to, its own first; without them a NEIGHBOR sensor's."""
    if "legal" not in state:
        for kind, data in state["sensor"].values():
            if kind is SensorType.NEIGHBOR:
                near: Sequence[int] = data
                return near
    legal: Sequence[int] = required(state, "legal", caller)
    return legal


def legal_on_map(ctx: IContext, state: State) -> Sequence[int]:
    """Return the nodes that an agent on the ground may move to, its own first; without them those one edge away."""
    legal = state.get("legal")
    return ctx.graph.graph.neighborhoods[state["curr_pos"]] if legal is None else legal


def has_speed(ctx: IContext, state: State) -> bool:
    """Whether an agent on the ground goes along more than one edge, or part of one, in a turn of `ctx.game`."""
    if "legal" not in state or "name" not in state:
        return False  # in a loop of one's own a speed may mean anything
    return getattr(ctx.agent.get_agent(state["name"]), "speed", None) is not None


def enemies_in_sight(ctx: IContext, state: State, caller: str) -> dict[str, int]:
    """Return the nodes of the enemies that the agent's sensors show, by name and in the order of the names."""
    team = required(state, "team", caller)
    if caller not in (warned := _warned.setdefault(ctx, set())) and not _shows_agents(state):
        warned.add(caller)  # once in a context
        kinds = ", ".join(sorted(kind.name for kind in _SHOWING_AGENTS))
        who = f"agent {state['name']!r}" if "name" in state else "an agent"
        ctx.logger.warning(
            f"{caller}: {who} carries no sensor that shows agents, so it sees no enemy. Give it {kinds}."
        )
    return {name: node for name, node, other in _in_sight(ctx, state) if team is None or other != team}


def mates_in_sight(ctx: IContext, state: State) -> dict[str, int]:
    """Return the nodes of the teammates that the agent's sensors show, likewise."""
    team = state["team"]
    return {name: node for name, node, other in _in_sight(ctx, state) if team is not None and other == team}


def _shows_agents(state: State) -> bool:
    return any(kind in _SHOWING_AGENTS for kind, _ in state["sensor"].values())


def _in_sight(ctx: IContext, state: State) -> list[tuple[str, int, object]]:
    """Return name, node and team of the agents that the sensors show, in the order of the names."""
    seen: dict[str, int] = {}
    for kind, data in state["sensor"].values():
        if kind in _SHOWING_AGENTS:
            seen.update(data)
    seen.pop(state.get("name", ""), None)  # a sensor at a fixed place shows its owner, too
    there = ctx.agent.agents  # without those that were deleted since a sensor with a delay has seen them
    return [(name, seen[name], getattr(there[name], "team", None)) for name in sorted(seen) if name in there]


def nodes_in_view(ctx: IContext, state: State) -> set[int]:
    """Return the nodes on which the agent's sensors would show agents with some probability."""
    agent, found = ctx.agent.get_agent(state["name"]), set[int]()
    for name, (kind, _) in state["sensor"].items():
        if kind in _SHOWING_AGENTS:
            covered = agent.sensors[name].coverage(state["curr_pos"], state["name"])
            found.update(covered.node_ids[covered.detection > 0.0].tolist())
    return found


def as_known_node(ctx: IContext, value: object, name: str) -> int:
    """Check that a value is the id of a node of the map.

    Raises:
        BadType, UnknownName (KeyError): it is not.
    """
    node = as_int(value, name)
    if not ctx.graph.graph.has_node(node):
        raise UnknownName("node", node)
    return node


def as_strategy(value: F, name: str) -> F:
    """Check that a value is a function of the state.

    Raises:
        BadType: it cannot be called with a state, makes such a function, or is an `async def`.
    """
    as_function_of(value, name, "the state")
    if iscoroutinefunction(value) or iscoroutinefunction(getattr(value, "__call__", None)):  # noqa: B004 - it is looked at
        raise BadType(f"{name} must not be an async def: await it in an async def of your own.")
    return value


def known_nodes(ctx: IContext, values: Iterable[NodeId], caller: str, kind: str) -> tuple[int, ...]:
    """Check that values are ids of nodes of the map, one at least.

    Raises:
        BadType, BadValue, UnknownName (KeyError): they are not.
    """
    name = f"{kind} of {caller}"
    nodes = tuple(as_known_node(ctx, node, f"Each of {name}") for node in as_items(values, name, "node ids"))
    if not nodes:
        raise BadValue(f"{caller} needs one node at least.")
    return nodes


def shared_memory(state: State, key: str) -> dict[Any, Any]:
    """Return the dict under a key of the team's memory, to be written into; an agent that shares none has its own."""
    is_shared = state.get("team") is not None and "team_memory" in state
    memory: dict[Any, Any] = state["team_memory"] if is_shared else required(state, "memory", key)
    found: dict[Any, Any] = memory.setdefault(key, {})
    return found


# -- steps ----------------------------------------------------------------------------------------------------


def move_to(ctx: IContext, state: State, target: int | None, fallback: Strategy, caller: str) -> None:
    """Set the action to a step towards a node; without a node, or a path to it, call the fallback."""
    step = None if target is None else step_towards(ctx, state, target, caller)
    if step is None:
        fallback(state)
    else:
        state["action"] = step


def move_to_agent(
    ctx: IContext, state: State, target: int | None, seen: Mapping[str, int], fallback: Strategy, caller: str
) -> None:
    """Set the action to a step towards an agent in sight: to the node it has passed last, and on along its edge.

    Args:
        ctx: the context.
        state: of an agent on the ground.
        target: the node; None: no agent is in sight.
        seen: the agents in sight, with the nodes that they have passed last; the first at the node is gone to.
        fallback: is called where there is none, or no path.
        caller: the name of the strategy, for messages.
    """
    name = next((name for name, node in seen.items() if node == target), None)
    its: Any = None if name is None or "edge" not in state else getattr(ctx.agent.get_agent(name), "edge", None)
    if its is None or its[0] != target:
        move_to(ctx, state, target, fallback, caller)
        return
    graph, edge, (source, end, street) = ctx.graph.graph, state["edge"], its
    gone, length = getattr(ctx.agent.get_agent(cast("str", name)), "offset_m", 0.0), graph.get_edge(street).length
    if edge is not None and set(edge[:2]) == {source, end}:  # both are on one street
        offset = state["offset_m"] if edge[0] == source else length - state["offset_m"]
        state["action"] = end if offset < gone else source
        return
    starts = {state["curr_pos"]: state["offset_m"]}
    if edge is not None:
        starts[edge[1]] = graph.get_edge(edge[2]).length - state["offset_m"]
    ways = [(source, end, gone)]
    if source in graph.neighborhoods[end]:
        ways.append((end, source, length - gone))
    far, start, first, last = min(
        (begun + graph.distance(start, first) + rest, start, first, last)
        for start, begun in starts.items()
        for first, last, rest in ways
    )
    if far == inf:
        fallback(state)
    else:
        state["action"] = [*graph.shortest_path(start, first), last]


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
    if is_allowed is None and state.get("xy") is not None and has_speed(ctx, state):
        starts = {here} if state["edge"] is None else {here, state["edge"][1]}
        return target if any(isfinite(ctx.graph.graph.distance(one, target)) for one in starts) else None
    if target in legal and (is_allowed is None or is_allowed(target)):
        return target
    try:
        path = _path_ahead(ctx, here, target, legal)
    except NoPath:
        return None
    allowed = list(path if is_allowed is None else takewhile(is_allowed, path))
    reached = sum(1 for _ in takewhile(legal.__contains__, allowed))
    if has_speed(ctx, state):
        return allowed[: reached + 1] or here
    return allowed[reached - 1] if reached else here


def _path_ahead(ctx: IContext, here: int, target: int, legal: Sequence[int]) -> list[int]:
    """Return the nodes after `here` on the shortest path, as far as the first that is not legal at least."""
    edges = 2  # which is enough where an agent goes along one
    while True:
        path = ctx.graph.graph.shortest_path(here, target, most_edges=edges)[1:]
        if len(path) < edges or path[-1] not in legal:
            return path
        edges *= 2


def as_otherwise(otherwise: Strategy | None, caller: str) -> Strategy:
    """Return the strategy to use when there is nothing to do; None: one that sets no action."""
    return _pass if otherwise is None else as_strategy(otherwise, f"otherwise of {caller}")


def _pass(_: object) -> None:
    """Set no action."""


# -- in the core ----------------------------------------------------------------------------------------------


def offer_steps(
    strategy: Callable[..., None], *steps: CoreStep | Callable[[Any], None], core_form: int | None = None
) -> None:
    """Let the core play a strategy by these steps and those of strategies that it calls, if all of these have some.

    Args:
        strategy: a function of the state.
        steps: what the core tries, one after the other.
        core_form: by what else the core plays it; see `StrategySpec`.
    """
    several = [(one,) if isinstance(one, CoreStep) else strategy_spec_of(one).core_steps for one in steps]
    if None not in several:
        found = tuple(step for own in several for step in own or ())
        declare(strategy, StrategySpec(core_form=core_form, core_steps=found, begins=partial(begin_steps, found)))


offer_steps(_pass)
