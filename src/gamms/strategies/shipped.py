"""The strategies that come with GAMMS: to move, to meet enemies, to combine; and what they know of state and map.

Those that act on enemies need `state["team"]`, and a sensor that shows agents: AGENT, AGENT_RANGE, AGENT_ARC or
OCCLUDED_AGENT. Such a sensor shows a flyer at the node nearest to it.
"""

from collections.abc import Callable, Iterable, Sequence
from inspect import iscoroutinefunction
from itertools import takewhile
from math import cos, inf, pi, sin
from typing import TYPE_CHECKING, Any, TypeVar, overload
from weakref import WeakKeyDictionary

from gamms.arguments import as_context, as_float, as_int, as_items, as_range
from gamms.errors import BadType, BadValue, MissingKey, NoPath, UnknownName
from gamms.text import shown, shown_as_called
from gamms.typing import IContext
from gamms.typing.game import AerialState, AerialStrategy, NodeId, State, Strategy
from gamms.typing.sensor_engine import SensorType

if TYPE_CHECKING:
    from typing_extensions import TypeIs

F = TypeVar("F")

# The kinds that those on the ground may carry; data: {name: node}
_SHOWING_AGENTS = {SensorType.AGENT, SensorType.AGENT_RANGE, SensorType.AGENT_ARC, SensorType.OCCLUDED_AGENT}

_warned: WeakKeyDictionary[IContext, set[str]] = WeakKeyDictionary()  # context -> strategies warned about

_WAYS_OUT = {
    "legal": "set it to the nodes it may move to, or give the agent a NEIGHBOR sensor",
    "memory": "set it to a dict that you keep for the agent",
    "rng": "set it to a generator, such as ctx.rng",
    "team": "set it to agent.team",
}


# -- moving -------------------------------------------------------------------------------------------------------


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


# -- enemies ------------------------------------------------------------------------------------------------------


@shown_as_called
def chase(ctx: IContext, otherwise: Strategy | None = random_walk) -> Strategy:
    """Go to the nearest enemy in sight, by road; of several, to the first by name.

    Args:
        ctx: the context.
        otherwise: the strategy to use when none is in sight, or there is no path; None sets no action then.
    """
    as_context(ctx, "chase")
    fallback = as_otherwise(otherwise, "chase")

    def strategy(state: State) -> None:
        here = node_of(state, "chase")
        move_to(ctx, state, _nearest(ctx, here, enemies_in_sight(ctx, state, "chase")), fallback, "chase")

    return strategy


@shown_as_called
def flee(ctx: IContext, otherwise: Strategy | None = stay) -> Strategy:
    """Go to the legal node, perhaps the agent's own, that is farthest by road from the nearest enemy in sight.

    The road leads from the enemy to the node. Of several nodes the one with the lowest id is taken.

    Args:
        ctx: the context.
        otherwise: the strategy to use when no enemy is in sight; None sets no action then.
    """
    as_context(ctx, "flee")
    fallback = as_otherwise(otherwise, "flee")

    def strategy(state: State) -> None:
        node_of(state, "flee")
        threats = set(enemies_in_sight(ctx, state, "flee").values())

        def safety(node: int) -> tuple[float, int]:
            return min(ctx.graph.graph.distance(threat, node) for threat in threats), -node

        if threats:
            state["action"] = max(legal_on_map(ctx, state), key=safety)
        else:
            fallback(state)

    return strategy


@shown_as_called
def guard(ctx: IContext, node: NodeId, radius: float) -> Strategy:
    """Stay near a node, the post, and go after the enemies in sight that come near it; it always sets an action.

    Near means at most `radius` by road, on the way to the post. Of several enemies the agent goes to the nearest by
    road, then to the first by name. It never goes farther away from the post than `radius`, but waits there. Without an
    enemy near, or farther away from the post itself, it goes back.

    Args:
        ctx: the context.
        node: the post.
        radius: metres, or the unit that the lengths of the edges have; may be infinite.

    Raises:
        UnknownName (KeyError), BadType, BadValue: the post is not a node of the map, or the radius not a distance.
    """
    as_context(ctx, "guard")
    post, reach = as_known_node(ctx, node, "node of guard"), as_range(radius, "radius of guard")

    def is_near(place: int) -> bool:
        return ctx.graph.graph.distance(place, post) <= reach

    def strategy(state: State) -> None:
        here = node_of(state, "guard")
        enemies = {name: at for name, at in enemies_in_sight(ctx, state, "guard").items() if is_near(at)}
        target = _nearest(ctx, here, enemies) if is_near(here) else None
        if target is None:
            move_to(ctx, state, post, stay, "guard")
        else:
            step = step_towards(ctx, state, target, "guard", is_near)
            state["action"] = here if step is None else step

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


# -- steps --------------------------------------------------------------------------------------------------------


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
    return (lambda _: None) if otherwise is None else as_strategy(otherwise, f"otherwise of {caller}")


def _nearest(ctx: IContext, here: int, enemies: dict[str, int]) -> int | None:
    """Return the node of the nearest by road; None where no path leads to any."""
    metres = {name: ctx.graph.graph.distance(here, node) for name, node in enemies.items()}
    name = min(metres, key=metres.__getitem__, default=None)  # they are in the order of their names
    return None if name is None or metres[name] == inf else enemies[name]


# -- what a strategy knows ----------------------------------------------------------------------------------------


def required(state: State | AerialState, key: str, caller: str) -> Any:
    """Return the value of a key that `ctx.game` puts into every state.

    Raises:
        MissingKey: there is none; the message says what to do about it in a loop of one's own.
    """
    if key not in state:
        raise MissingKey(
            f"{caller} needs state[{key!r}]. ctx.game puts it there; in a loop of your own, {_WAYS_OUT[key]}."
        )
    return state[key]  # type: ignore[literal-required] # the keys of `_WAYS_OUT`


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
    data_shown = [data for kind, data in state["sensor"].values() if kind in _SHOWING_AGENTS]
    if not data_shown and caller not in (warned := _warned.setdefault(ctx, set())):
        warned.add(caller)  # once in a context
        kinds = ", ".join(sorted(kind.name for kind in _SHOWING_AGENTS))
        who = f"agent {state['name']!r}" if "name" in state else "an agent"
        ctx.logger.warning(
            f"{caller}: {who} carries no sensor that shows agents, so it sees no enemy. Give it {kinds}."
        )
    seen: dict[str, int] = {}
    for data in data_shown:
        seen.update(data)
    seen.pop(state.get("name", ""), None)  # a sensor at a fixed place shows its owner, too
    teams = {name: getattr(ctx.agent.get_agent(name), "team", None) for name in sorted(seen)}
    return {name: seen[name] for name, other in teams.items() if team is None or other != team}


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
        BadType: it cannot be called, or is an `async def`.
    """
    if not callable(value):
        raise BadType(f"{name} must be a function of the state, not {shown(value)} ({type(value).__name__}).")
    if iscoroutinefunction(value):
        raise BadType(f"{name} must not be an async def: await it in an async def of your own.")
    return value
