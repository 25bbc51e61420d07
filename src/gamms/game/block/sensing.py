"""The data of sensors in the games of a batch: the core computes plain sensors, all others run their own code.

A plain sensor shows the agents of some teams that are within a radius of its agent. Any other sensor is called in a
context of the game, once for each agent that carries it.
"""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from gamms import kernels
from gamms.arguments import as_array, as_numbers_of
from gamms.core import observe, sight
from gamms.errors import BadValue, TooLarge, UnknownName
from gamms.game.block.columns import PlayedGame, get_or_make, get_sensors
from gamms.game.block.state import GameArrays
from gamms.game.block.strategy_steps import collect_looks, has_plain_looks, make_search
from gamms.game.conflicts import flatten
from gamms.ir.columns import find_places, select_rows
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.ir.sensor_results import AgentLook
from gamms.text import shown
from gamms.typing.agent_engine import IAgent
from gamms.typing.context import HostContext
from gamms.typing.sensor_engine import IN_AIR, ON_GROUND, ISensor, SensorType

SHOWING_AGENTS = ON_GROUND | IN_AIR
SHOWING_NODES = {SensorType.NEIGHBOR, SensorType.MAP, SensorType.RANGE, SensorType.ARC, SensorType.OCCLUDED_MAP}
_MOST_PAIRS = 1 << 28  # agents and nodes, of one answer
_ON_NODES = flatten(np.zeros(0), np.float64)


class VisibleAgentPairs(NamedTuple):
    """The agents that agents see, as pairs: by game, then by observer, then by the name of the other agent.

    Attributes:
        shape: the numbers of games and agents in the view, and of agents in the roster.
        at: (pairs,) the game, as an index in the view.
        viewers: (pairs,) the observer, as an index in the view.
        others: (pairs,) the number of the visible agent in the roster.
        nodes: (pairs,) the row of its node.
    """

    shape: tuple[int, int, int]
    at: IntArray
    viewers: IntArray
    others: IntArray
    nodes: IntArray

    @property
    def mask(self) -> BoolArray:
        """Whether each agent sees each other agent, (games, agents of the view, agents of the roster).

        Raises:
            TooLarge: the mask would take more than 256 MB; use the pairs.
        """
        use = "at, viewers, others and nodes of view.seen()"
        return _make_mask(self.shape, (self.at, self.viewers, self.others), use)

    def in_games(self, games: IntArray) -> "VisibleAgentPairs":
        """Return the pairs of some games, ascending, renumbered for a view of these games."""
        at = find_places(games, self.shape[0])[self.at]
        return self._replace(shape=(len(games), *self.shape[1:]), at=at).of(at >= 0)

    def of(self, chosen: BoolArray | IntArray) -> "VisibleAgentPairs":
        """Return pairs selected by a mask, (pairs,), or by indices.

        Raises:
            BadType, BadValue: a pair does not exist.
        """
        if getattr(chosen, "dtype", None) == np.bool_:
            return select_rows(self, as_array(chosen, "chosen", "booleans", self.at.shape))
        return select_rows(self, as_numbers_of(chosen, "chosen", len(self.at), "pairs").reshape(-1))


class VisibleNodes(NamedTuple):
    """The nodes that agents see, as pairs: by game, then by observer.

    The nodes of one observer are in the order of the map; for a single sensor, in the order of the sensor.

    Attributes:
        shape: the numbers of games and agents in the view, and of nodes on the map.
        at: (pairs,) the game, as an index in the view.
        viewers: (pairs,) the observer, as an index in the view.
        nodes: (pairs,) the row of the node.
    """

    shape: tuple[int, int, int]
    at: IntArray
    viewers: IntArray
    nodes: IntArray

    @property
    def mask(self) -> BoolArray:
        """Whether each node is visible, (games, agents, nodes).

        Raises:
            TooLarge: the mask would take more than 256 MB; use the pairs.
        """
        return _make_mask(self.shape, (self.at, self.viewers, self.nodes), "at, viewers and nodes")


def _make_mask(shape: tuple[int, ...], pairs: tuple[IntArray, ...], use: str) -> BoolArray:
    """Return a mask that is true for these pairs; `use` names the alternative in an error."""
    if np.prod(shape, dtype=np.float64) > _MOST_PAIRS:
        raise TooLarge(f"A mask of {shape} is too large. Use the pairs: {use}.")
    found = np.zeros(shape, np.bool_)
    found[pairs] = True
    return found


def list_sensor_names(agents: Sequence[IAgent], numbers: IntArray, kinds: Collection[SensorType]) -> list[str]:
    """Return the names of the sensors of some kinds that some agents carry."""
    carried = [get_sensors(agents[number]) for number in numbers.tolist()]
    return sorted({name for one in carried for name, sensor in one.items() if sensor.type in kinds})


def is_turning_with_agent(sensor: ISensor) -> bool:
    """Return whether a sensor has a field of view that turns with the agent that carries it."""
    return bool(getattr(sensor, "turns_with_agent", False))


def list_agent_sensors(agent: IAgent) -> list[str]:
    """Return the sensors of an agent that show agents, in order of precedence.

    If several sensors show an agent, the last one on the ground counts, else the first one in the air.
    """
    carried = get_sensors(agent)
    ground = [name for name, one in carried.items() if one.type in ON_GROUND]
    return [*ground[::-1], *(name for name, one in carried.items() if one.type in IN_AIR)]


def list_node_sensors(agent: IAgent, *, varies: bool) -> list[str]:
    """Return the sensors of an agent that show nodes, and may show different nodes in other games from the same node.

    These are sensors that turn with the agent, sensors of neighbors, and all sensors if they vary by game.
    """
    nodes = {name: one for name, one in get_sensors(agent).items() if one.type in SHOWING_NODES}
    return [
        name for name, one in nodes.items() if varies or one.type is SensorType.NEIGHBOR or is_turning_with_agent(one)
    ]


def list_sensors_called_each_turn(agent: IAgent) -> list[str]:
    """Return the sensors of an agent that are called in each turn, even if nothing asks for their data.

    These are the sensors that report earlier turns, and those whose code may do more than look at the world.
    """
    found = []
    for name, sensor in get_sensors(agent).items():
        look: AgentLook | None = sensor.in_arrays() if hasattr(sensor, "in_arrays") else None
        if not getattr(sensor, "sees_world_only", False) or (look is not None and look.is_late):
            found.append(name)
    return found


def note_sensors(state: GameArrays, *, with_nodes: bool) -> None:
    """Record which sensors of agents are called in the contexts of their games.

    Args:
        state: the state of the games.
        with_nodes: whether to include sensors of nodes, because maps or headings may differ between games.
    """
    roster = state.roster
    varies = ~roster.is_first
    each = zip(roster.agents, roster.flies | varies, strict=True)
    are_plain = [not is_odd and has_plain_looks(one) for one, is_odd in each]
    found = {
        number: list_agent_sensors(roster.agents[number]) for number, is_plain in enumerate(are_plain) if not is_plain
    }
    state.noted = {number: names for number, names in found.items() if names}
    if with_nodes or varies.any():
        both = zip(roster.agents, varies.tolist(), strict=True)
        found = {number: list_node_sensors(one, varies=may_vary) for number, (one, may_vary) in enumerate(both)}
        state.noted_nodes = {number: names for number, names in found.items() if names}


# -- agents ---------------------------------------------------------------------------------------------------------


def find_seen_agents(
    state: GameArrays,
    games: IntArray,
    agents: IntArray,
    asked: BoolArray,
    names: Sequence[str],
    axes: Callable[[], FloatArray | None],
) -> VisibleAgentPairs:
    """Return the agents that some agents see.

    Args:
        state: the state of the games.
        games: their numbers.
        agents: the observers' numbers in the roster.
        asked: (games, agents) a mask of the observers.
        names: names of sensors; a named sensor at a fixed place also shows its own agent. None given: all sensors.
        axes: returns the positions of all agents, (games, all agents, 2); None: they are on their nodes.

    Raises:
        UnknownName (KeyError): no agent carries such a sensor that shows agents.
    """
    if names:
        known = list_sensor_names(state.roster.agents, agents, SHOWING_AGENTS)
        for name in names:
            if name not in known:
                raise UnknownName("sensor that shows agents", name, known)
    shape = len(games), len(agents), len(state.roster.names)
    noted = np.zeros(len(agents), np.bool_)
    if state.noted:
        noted = np.isin(agents, [*state.noted])
    plain = _find_seen_agents(state, games, agents, asked & ~noted, names, axes)
    if not noted.any() or not len(games):
        return VisibleAgentPairs(shape, *plain)
    _look(state, games)
    parts = [plain, *_list_sighted_agents(state, names, (games, agents), asked)]
    at, viewers, others, nodes = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    _, first = np.unique((at * shape[1] + viewers) * shape[2] + others, return_index=True)
    return VisibleAgentPairs(shape, at[first], viewers[first], others[first], nodes[first])


def _find_seen_agents(
    state: GameArrays,
    games: IntArray,
    agents: IntArray,
    asked: BoolArray,
    names: Sequence[str],
    axes: Callable[[], FloatArray | None],
) -> IntArray:
    """Return columns (games, agents, others, nodes) of the agents that plain sensors show, sorted."""
    search = find_search(state, names)
    xy = axes()
    own = _ON_NODES if xy is None else flatten(xy, np.float64)
    who = search, flatten(games, np.int64), own, flatten(agents, np.int64), flatten(asked.view(np.uint8), np.uint8)
    room = state.shared.get("pairs", asked.size)
    pairs: IntArray = np.empty((4, room), np.int64)
    total = observe.list_seen(*who, pairs.reshape(-1).data)
    if total > _MOST_PAIRS:
        raise TooLarge(f"The agents see {total} agents together, too many for arrays. Ask for fewer games.")
    if total > room:
        state.shared["pairs"] = total + total // 8
        pairs = np.empty((4, total), np.int64)
        observe.list_seen(*who, pairs.reshape(-1).data)
    return pairs[:, :total]


def find_search(state: GameArrays, names: Sequence[str] = ()) -> sight.AgentSearch:
    """Return the search for the agents that plain sensors of these names, or all, show."""
    return get_or_make(state.searches, (tuple(names), tuple(state.noted)), lambda: _search_for(state, names))


def _search_for(state: GameArrays, names: Sequence[str]) -> sight.AgentSearch:
    roster = state.roster
    looking = [number not in state.noted for number in range(len(roster.names))]
    key = "plain", tuple(names), tuple(state.noted)
    looks = get_or_make(state.shared, key, lambda: collect_looks(roster, looking, names))
    return make_search(state, sight.SensorTable(*looks, len(roster.teams)), state.streets.columns.xy)


def _list_sighted_agents(
    state: GameArrays, names: Sequence[str], who: tuple[IntArray, IntArray], asked: BoolArray
) -> Iterator[tuple[IntArray, ...]]:
    """Yield the same columns of recorded sightings, in order of precedence."""
    for at, game in enumerate(who[0].tolist()):
        for column, agent in enumerate(who[1].tolist()):
            sights = state.sighted.get((game, agent), {}) if asked[at, column] else {}
            for others, nodes in [one for name, one in sights.items() if name in names or not names]:
                counts = (others != agent) | bool(names)
                here = np.full(int(counts.sum()), at)
                yield here, np.full_like(here, column), others[counts], nodes[counts]


# -- nodes ----------------------------------------------------------------------------------------------------------


def find_seen_nodes(
    state: GameArrays, games: IntArray, agents: IntArray, node: IntArray, asked: BoolArray, names: Sequence[str]
) -> VisibleNodes:
    """Return the nodes that some agents see; see `find_seen_agents`.

    Args:
        state: the state of the games.
        games: their numbers.
        agents: the observers' numbers in the roster.
        node: (games, agents) the rows of the observers' nodes.
        asked: (games, agents) a mask of the observers.
        names: names of sensors. None given: all sensors.

    Raises:
        UnknownName (KeyError): no agent carries such a sensor that shows nodes.
        BadValue: a sensor is of a user's class.
        TooLarge: the agents see more than 268 million nodes together.
    """
    known = list_sensor_names(state.roster.agents, agents, SHOWING_NODES)
    for name in names:
        if name not in known:
            raise UnknownName("sensor that shows nodes", name, known)
    if state.noted_nodes:
        _look(state, games)
    shape = (*node.shape, state.streets.num_nodes)
    none = np.zeros(0, np.int64)
    parts = [(none, none, none)]
    for column, number in enumerate(agents.tolist()):
        carried = [name for name in names or known if _is_node_sensor(state.roster.agents[number], name)]
        own = [_find_shown_nodes(state, games, number, name, node[:, column], asked[:, column]) for name in carried]
        if not own:
            continue
        at, rows = (np.concatenate(side) for side in zip(*own, strict=True))
        if len(own) > 1:
            at, rows = np.divmod(np.unique(at * shape[2] + rows), max(shape[2], 1))
        parts.append((at, np.full_like(at, column), rows))
        if sum(len(part[0]) for part in parts) > _MOST_PAIRS:
            raise TooLarge("The agents see too many nodes together for arrays. Ask for fewer games.")
    at, viewers, rows = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    order = np.argsort(at * shape[1] + viewers, kind="stable")
    return VisibleNodes(shape, at[order], viewers[order], rows[order])


def _is_node_sensor(agent: IAgent, name: str) -> bool:
    sensor = get_sensors(agent).get(name)
    return sensor is not None and sensor.type in SHOWING_NODES


def _find_shown_nodes(
    state: GameArrays, games: IntArray, number: int, name: str, node: IntArray, asked: BoolArray
) -> tuple[IntArray, IntArray]:
    """Return the nodes that an agent's sensor shows in the asked games: columns of games and rows of nodes."""
    agent = state.roster.agents[number]
    at = np.flatnonzero(asked)
    if name in state.noted_nodes.get(number, ()):
        none = np.zeros(0, np.int64)
        noted = [state.sighted_nodes.get((int(games[i]), number), {}).get(name, none) for i in at]
        return np.repeat(at, [len(rows) for rows in noted]), np.concatenate((none, *noted))
    sensor = get_sensors(agent)[name]
    if sensor.type is SensorType.NEIGHBOR and state.roads.differ:
        tables = state.roads.tables
        first = tables.first[games[at]] + state.movement.find_mode_offset(number, tables)
        entries, ends = kernels.select_runs(tables.offsets, first + node[at])
        return np.repeat(at, np.diff(ends)), tables.targets[entries]
    if not sensor.sees_world_only:
        raise BadValue(
            f"The sensor {shown(name)} of agent {shown(agent.name)} is of a class of its own, and so has no array "
            "form. Look with state['sensor'], in a strategy for one agent."
        )
    starts, which = np.unique(node[at], return_inverse=True)
    found = sensor.sense_many(state.streets.ids(starts))
    ends = found.offsets[:-1]
    counts = np.diff(found.offsets)[which]
    total = int(counts.sum())
    if total > _MOST_PAIRS:
        raise TooLarge(f"The agents see {total} nodes together, too many for arrays. Ask for fewer games.")
    places = np.arange(total) - np.repeat(np.cumsum(counts) - counts - ends[which], counts)
    return np.repeat(at, counts), state.streets.rows(found.values)[places]


# -- sensors that are called in contexts ------------------------------------------------------------------------------


def _look(state: GameArrays, games: IntArray) -> None:
    """Call sensors in the games whose sensor data are out of date."""
    if state.find_game is None:
        return
    known: set[int] = state.now.setdefault("looked", set())
    for number in games.tolist():
        if number not in known:
            with state.reading():
                look_in(state, state.find_game(number), number)
            known.add(number)


def look_in(state: GameArrays, game: PlayedGame, number: int) -> None:
    """Call the sensors of a game in its context.

    Args:
        state: the state of all games.
        game: the game.
        number: its number.

    Raises:
        UnknownName (KeyError): a sensor shows a node that has no row.
    """
    ctx = game.ctx
    names = {name: i for i, name in enumerate(state.roster.names)}
    for i in {**state.noted, **state.noted_nodes}:
        agent = ctx.agent.agents.get(state.roster.names[i])
        carried = get_sensors(agent) if agent is not None and agent.alive else {}
        of_agents = [name for name in state.noted.get(i, ()) if name in carried]
        of_nodes = [name for name in state.noted_nodes.get(i, ()) if name in carried]
        data = game.internals.parts.turns.read_sensors(agent, of_agents + of_nodes) if carried else {}
        sights: dict[str, tuple[IntArray, IntArray]] = {}
        state.sighted[number, i] = sights
        for name in of_agents:
            known = [(names[other], node) for other, node in _list_places(data[name], ctx) if other in names]
            others, nodes = np.array([*known, (0, 0)], np.int64)[:-1].T
            sights[name] = others, state.streets.rows(nodes)
        state.sighted_nodes[number, i] = {name: state.streets.rows(_list_nodes(data[name])) for name in of_nodes}


def _list_places(data: Mapping[str, Any], ctx: HostContext) -> list[tuple[str, int]]:
    """Return the agents that a sensor shows, with node ids; for agents in the air, the nearest nodes."""
    nearest = ctx.graph.graph.nearest_node
    return [(name, nearest(*at[1][:2]) if isinstance(at, tuple) else int(at)) for name, at in data.items()]


def _list_nodes(data: list[int] | Mapping[str, Any]) -> list[int]:
    return [*(data if isinstance(data, list) else data["nodes"])]
