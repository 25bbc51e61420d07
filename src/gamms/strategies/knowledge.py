"""What a strategy knows: it reads the state and the map, and nothing else."""

from collections.abc import Sequence
from typing import Any
from weakref import WeakKeyDictionary

from gamms.arguments import as_int, as_items
from gamms.errors import BadType, MissingKey, UnknownName
from gamms.text import shown
from gamms.typing import IContext
from gamms.typing.sensor_engine import SensorType

State = dict[str, Any]

_SHOWING_AGENTS = frozenset(
    {SensorType.AGENT, SensorType.AGENT_RANGE, SensorType.AGENT_ARC, SensorType.OCCLUDED_AGENT}
)  # the kinds that those on the ground may carry; data: {name: node}

_warned: WeakKeyDictionary[IContext, set[str]] = WeakKeyDictionary()  # context -> strategies warned about

_WAYS_OUT = {
    "legal": "set it to the nodes it may move to, or give the agent a NEIGHBOR sensor",
    "memory": "set it to a dict that you keep for the agent",
    "rng": "set it to a generator, such as ctx.rng",
    "team": "set it to agent.team",
}


def told(state: State, key: str, asker: str) -> Any:
    """What the state says under a key.

    Raises:
        MissingKey: it does not; the message says what to do about it in a loop of one's own.
    """
    try:
        return state[key]
    except KeyError:
        raise MissingKey(
            f"{asker} needs state[{key!r}]. ctx.game puts it there; in a loop of your own, {_WAYS_OUT[key]}."
        ) from None


def drawn_fraction(state: State, asker: str) -> float:
    """Draw a number in [0, 1): from `state["draw"]`, or from `state["rng"]` in a loop that has only that."""
    if "draw" in state:
        return float(state["draw"].random())
    return float(told(state, "rng", asker).random())


def drawn_below(state: State, n: int, asker: str) -> int:
    """Draw an integer from 0 to `n - 1`, likewise."""
    if "draw" in state:
        return int(state["draw"].below(n))
    return int(told(state, "rng", asker).integers(n))


def is_flying(state: State) -> bool:
    """Whether the state is that of an aerial agent."""
    return isinstance(state["curr_pos"], tuple)


def place_of(state: State, asker: str) -> int:
    """The node an agent on the ground stands on.

    Raises:
        BadType: the agent flies.
    """
    if is_flying(state):
        raise BadType(f"{asker} goes along edges, and an agent at {state['curr_pos']} flies. Give it another strategy.")
    node: int = state["curr_pos"]
    return node


def legal_nodes(state: State, asker: str) -> Sequence[int]:
    """The nodes an agent on the ground may move to, its own first: as the state says, or a NEIGHBOR sensor."""
    if "legal" not in state:
        for kind, data in state["sensor"].values():
            if kind is SensorType.NEIGHBOR:
                near: Sequence[int] = data
                return near
    legal: Sequence[int] = told(state, "legal", asker)
    return legal


def legal_on_map(ctx: IContext, state: State) -> Sequence[int]:
    """The nodes an agent on the ground may move to, its own first: as the state says, or else along one edge."""
    legal: Sequence[int] | None = state.get("legal")
    return ctx.graph.graph.neighborhoods[state["curr_pos"]] if legal is None else legal


def has_speed(ctx: IContext, state: State) -> bool:
    """Whether an agent on the ground goes along more than one edge, or part of one, in a turn of `ctx.game`."""
    if "legal" not in state or "name" not in state:
        return False  # in a loop of one's own a speed means whatever it means there
    return getattr(ctx.agent.get_agent(state["name"]), "speed", None) is not None


def enemies_in_sight(ctx: IContext, state: State, asker: str) -> dict[str, int]:
    """The nodes of the enemies that the agent's sensors show, by name and in the order of the names."""
    team = told(state, "team", asker)
    shown = [data for kind, data in state["sensor"].values() if kind in _SHOWING_AGENTS]
    if not shown:
        _warn_of_blindness(ctx, asker, state.get("name"))
    seen: dict[str, int] = {}
    for data in shown:
        seen.update(data)
    seen.pop(state.get("name", ""), None)  # a sensor at a fixed place shows whoever carries it, too
    teams = {name: getattr(ctx.agent.get_agent(name), "team", None) for name in sorted(seen)}
    return {name: seen[name] for name, other in teams.items() if team is None or other != team}


def _warn_of_blindness(ctx: IContext, asker: str, name: str | None) -> None:
    """Warn once in a context that a strategy is used by an agent which can see no agents."""
    warned = _warned.setdefault(ctx, set())
    if asker not in warned:
        warned.add(asker)
        kinds = ", ".join(sorted(kind.name for kind in _SHOWING_AGENTS))
        who = "an agent" if name is None else f"agent {name!r}"
        ctx.logger.warning(f"{asker}: {who} carries no sensor that shows agents, so it sees no enemy. Give it {kinds}.")


def as_known_node(ctx: IContext, value: Any, name: str) -> int:
    """A node of the map.

    Raises:
        BadType, UnknownName (KeyError): it is none.
    """
    node = as_int(value, name)
    if not ctx.graph.graph.has_node(node):
        raise UnknownName("node", node)
    return node


def as_known_nodes(ctx: IContext, values: Any, name: str) -> tuple[int, ...]:
    """Several nodes of the map; one at least."""
    return tuple(as_known_node(ctx, value, f"Each of {name}") for value in as_items(values, name, "node ids"))


def as_strategy(value: Any, name: str) -> Any:
    """A function of the state.

    Raises:
        BadType: it cannot be called.
    """
    if not callable(value):
        raise BadType(f"{name} must be a function of the state, not {shown(value)} ({type(value).__name__}).")
    return value
