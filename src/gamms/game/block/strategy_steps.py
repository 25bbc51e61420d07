"""Data for decisions of agents along edges in the core: steps of strategies, sensors, memories, tables of paths."""

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from functools import partial
from itertools import accumulate, chain
from typing import Any

import numpy as np

from gamms.arguments import as_int
from gamms.core import moves, rules, sight, strategies
from gamms.errors import BadValue
from gamms.game.block.columns import AgentTable, get_or_make
from gamms.game.block.state import Arrays, GameArrays, GameRow
from gamms.game.conflicts import flatten
from gamms.game.movement.roads import RoadMap, RoadTables
from gamms.game.movement.routes import PathTables
from gamms.game.strategy_specs import CoreStep
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.ir.sensor_results import AgentLook
from gamms.text import shown
from gamms.typing import IAgent
from gamms.typing.context import HostContext
from gamms.typing.sensor_engine import IN_AIR, ON_GROUND, ISensor

LOOKING = ("chase", "flee")
_REMEMBERED = {"follow": {"at": -1}, "wander": {"target": -1, "left": 0}}  # by kinds of steps: column -> at first


def is_always_acting(steps: Sequence[CoreStep]) -> bool:
    """Return whether steps always choose an action; `chase`, for example, may choose none."""
    if not steps:
        return False
    first = steps[0]
    rest = steps[1:]
    if first.kind in ("mix", "pick"):
        return is_always_acting(rest) and is_always_acting(rest[first.number :])
    if first.kind == "skip":
        return is_always_acting(rest[first.number :])
    return first.kind in ("stay", "walk") or is_always_acting(rest)


def _has_looks(steps: Sequence[CoreStep]) -> bool:
    return any(step.kind in LOOKING for step in steps)


def _get_plain_look(sensor: ISensor) -> AgentLook | None:
    """Return the form of a plain sensor, which shows agents of some teams within a radius; None: it is not plain."""
    look: AgentLook | None = sensor.in_arrays() if hasattr(sensor, "in_arrays") else None
    if look is None or not look.is_plain:
        return None
    return look if look.radius == np.inf or sight.compute_scale(look.radius) == 1.0 else None


def has_plain_looks(agent: IAgent) -> bool:
    """Return whether all sensors of an agent that show agents are plain."""
    sensors = getattr(agent, "sensors", {}).values()
    return all(_get_plain_look(sensor) is not None for sensor in sensors if sensor.type in ON_GROUND | IN_AIR)


def collect_looks(roster: AgentTable, looking: Sequence[bool], names: Sequence[str] = ()) -> tuple[Any, Any, Any]:
    """Return the plain sensors of a roster's agents, of these names or all, in the form of the core.

    These are `begins`, `squares` and `shows` of `sight.SensorTable`.
    """
    looks: list[list[AgentLook]] = [[] for _ in roster.agents]
    for agent, own in [
        pair for pair, is_looking in zip(zip(roster.agents, looks, strict=True), looking, strict=True) if is_looking
    ]:
        for name, sensor in getattr(agent, "sensors", {}).items():
            look = _get_plain_look(sensor) if sensor.type in ON_GROUND else None
            if look is not None and (not names or name in names):
                own.append(look)
    listed = [look for own in looks for look in own]
    return (
        _make_column([0, *accumulate(map(len, looks))], np.int64),
        _make_column([look.radius * look.radius for look in listed], np.float64),
        _make_column([look.is_showing(team) for look in listed for team in roster.teams], np.uint8),
    )


def make_search(
    state: GameArrays, looks: sight.SensorTable, xy: FloatArray, order: IntArray | None = None
) -> sight.AgentSearch:
    """Return a search for the agents that sensors show, in all games.

    Args:
        state: the state of the games.
        looks: the sensors of the agents.
        xy: (nodes, 2) the positions of the nodes.
        order: (games, agents) receives the agents by x; None: a new array, with their present order.
    """
    if order is None:  # nodes on other maps may have larger numbers
        order = np.argsort(xy[:, 0].take(state.node, mode="clip"), axis=1)
    return sight.AgentSearch(
        looks,
        flatten(state.node, np.int64),
        flatten(state.alive.view(np.uint8), np.uint8),
        flatten(state.roster.team_of, np.int64),
        flatten(xy, np.float64),
        flatten(order, np.int64),
    )


def begin_steps(steps: Sequence[CoreStep], ctx: HostContext, state: GameArrays | GameRow) -> dict[Hashable, Arrays]:
    """Return the memories of strategy steps of a context's agents, in the form of `StrategySteps`."""
    found: dict[Hashable, Arrays] = {}
    number_of = {name: number for number, name in enumerate(state.roster.names)}

    def row_of(node: int) -> int:
        return int(state.streets.rows(node))

    for step in {step.key: step for step in steps if step.key}.values():
        columns = _make_empty_memory(step.kind, len(number_of), 1)
        found["memory", step.key] = columns
        known = {name: memory[step.key] for name, memory in ctx.game.memories.items() if step.key in memory}
        for name in known.keys() & number_of.keys():
            values = _encode_memory(step, known[name], row_of)
            for column, value in zip(columns.values(), values or (), strict=values is not None):
                column[0, number_of[name]] = value
    return found


def list_memories(state: GameArrays | GameRow, steps: Sequence[CoreStep]) -> Iterator[tuple[str, str, Any]]:
    """Yield the name of an agent, a key of its memory, and the value that a step keeps there, in the first game."""
    ids = state.streets.columns.node_ids
    for step in {step.key: step for step in steps}.values():
        columns = [column[0].tolist() for column in state.kept["memory", step.key].values()]
        for name, first, *rest in zip(state.roster.names, *columns, strict=True):
            if first >= 0:
                yield name, step.key, first if step.kind == "follow" else (int(ids[first]), *rest)


def can_read(steps: Sequence[CoreStep], memory: Mapping[Any, Any], find: Callable[[int], Any]) -> bool:
    """Return whether an agent's memory has the form that these steps write; `find` raises for unknown nodes."""
    remembered = [step for step in steps if step.key and step.key in memory]
    return all(_encode_memory(step, memory[step.key], find) is not None for step in remembered)


def _make_empty_memory(kind: str, agents: int, games: int) -> Arrays:
    """Return the columns of agents that remember nothing yet."""
    return {name: np.full((games, agents), first) for name, first in _REMEMBERED[kind].items()}


def _encode_memory(step: CoreStep, known: Any, row_of: Callable[[int], Any]) -> tuple[Any, ...] | None:
    """Return an agent's memory of a step, as numbers in its columns; None: the step has not written it."""
    try:
        if step.kind == "follow":
            stops = range(len(step.nodes or ()) + 1)
            return (stops[stops.index(as_int(known, "the next stop"))],)
        target, left = known
        return row_of(target), as_int(left, "left")
    except (TypeError, ValueError, LookupError):
        return None


class StepPaths:
    """The shortest paths that strategies ask for, in tables of each thread.

    Args:
        state: the state of all games.
    """

    def __init__(self, state: GameArrays) -> None:
        self._roads = state.roads
        self._ids = state.streets.columns.node_ids
        self._tables: list[PathTables] = []  # of each thread
        self._maps: list[RoadMap | None] = [None]  # on which they lead; see `RoadTables`

    def get_tables(self, thread: int) -> PathTables:
        """Return the tables for the thread of this number, at most the number of threads so far."""
        if thread == len(self._tables):
            self._tables.append(PathTables(self._ids, self._get_arcs()))
        return self._tables[thread]

    def take_roads(self, tables: RoadTables) -> None:
        """Set the open roads of each game."""
        if tables.maps is self._maps:
            return
        moved = tables.find_first_nodes(self._maps)
        self._maps = tables.maps
        arcs = self._get_arcs()
        for known in self._tables:
            known.take(arcs, moved)

    def _get_arcs(self) -> tuple[Any, Any, Any]:
        return self._roads.join_arcs(self._maps, "length", reverse=True)


class StrategySteps:
    """Columns of the steps of strategies, which all threads of a batch share.

    Args:
        state: the state of all games.
        steps: the steps of each agent, in the order of the roster; empty for an agent without steps.
        paths: shortest paths.

    Attributes:
        memory: (columns, games, agents) the memories of agents; see `take_memories`.
    """

    def __init__(self, state: GameArrays, steps: Sequence[Sequence[CoreStep]], paths: StepPaths) -> None:
        self._state = state
        self._paths = paths
        self._remembered: dict[str, CoreStep] = {}
        self._columns: list[tuple[str, str]] = []  # of the memory: the key, and the name
        self._steps = self._make_steps(steps)
        self._has_pools = any(step.kind == "pick" for one in steps for step in one)
        looking = [_has_looks(one) for one in steps]
        shape = state.node.shape if any(looking) else (0, state.node.shape[1])
        self._order = np.zeros(shape, np.int64)
        looks = sight.SensorTable(*collect_looks(state.roster, looking), len(state.roster.teams))
        self._search = make_search(state, looks, state.streets.columns.xy, self._order)
        for key in self._remembered:
            self._get_kept(key)
        self.memory = np.zeros((len(self._columns), *state.node.shape), np.int64)

    def _make_steps(self, steps: Sequence[Sequence[CoreStep]]) -> strategies.StrategySteps:
        rows = self._state.streets.rows
        listed = [step for one in steps for step in one]
        nodes: list[IntArray] = [np.zeros(0, np.int64)]
        following: list[Sequence[int]] = [()]
        first: dict[Any, int] = {}
        slots = []
        for step in listed:
            if step.key and step.key not in self._remembered:
                self._remembered[step.key] = step
                self._columns += [(step.key, name) for name in _REMEMBERED[step.kind]]
            slots.append([key for key, _ in self._columns].index(step.key) if step.key else 0)
            if (step.nodes, step.following) not in first:
                first[step.nodes, step.following] = sum(map(len, nodes))
                nodes.append(np.arange(self._state.streets.num_nodes) if step.nodes is None else rows(step.nodes))
                following.append(step.following or np.zeros(len(nodes[-1]), np.int64).tolist())
        sizes = [self._state.streets.num_nodes if step.nodes is None else len(step.nodes) for step in listed]
        return strategies.StrategySteps(
            _make_column([0, *accumulate(map(len, steps))], np.int64),
            _make_column([strategies.KINDS.index(step.kind) for step in listed], np.uint8),
            _make_column([first[step.nodes, step.following] for step in listed], np.int64),
            _make_column(sizes, np.int64),
            _make_column([step.number for step in listed], np.int64),
            _make_column([step.chance for step in listed], np.float64),
            _make_column(slots, np.int64),
            _make_column(np.concatenate(nodes), np.int64),
            _make_column([*chain.from_iterable(following)], np.int64),
        )

    def get_strategies(self, games: rules.GameColumns, thread: int) -> strategies.Strategies:
        """Return the strategies for the thread of this number."""
        keys = flatten(self._state.draw_keys(), np.uint64)
        memory = self.memory.reshape(-1).data
        ways = self._paths.get_tables(thread).core
        shares = flatten(self._state.draw_pool_shares() if self._has_pools else np.zeros(0), np.float64)
        return strategies.Strategies(games, self._steps, ways, self._search, keys, shares, memory)

    def take_memories(self, games: IntArray) -> None:
        """Read the memories of agents in some games from the state of the batch, and order the agents by x."""
        nodes = self._state.streets.num_nodes
        for column, (key, name) in enumerate(self._columns):
            step = self._remembered[key]
            known = self._get_kept(key)[name][games]
            most = nodes - 1 if step.nodes is None or step.kind != "follow" else len(step.nodes)
            if name != "left" and not -1 <= known.min(initial=-1) <= known.max(initial=-1) <= most:
                raise BadValue(f"Agents remember numbers from -1 to {most} under {shown(key)}, not {shown(known)}.")
            self.memory[column, games] = known
        if len(self._order):
            x = self._state.streets.columns.xy[:, 0]
            self._order[games] = np.argsort(x[self._state.node[games]], axis=1)

    def give_memories(self, games: IntArray) -> None:
        """Write the memories of agents in these games to the state of the batch."""
        for column, (key, name) in enumerate(self._columns):
            self._get_kept(key)[name][games] = self.memory[column, games]

    def _get_kept(self, key: str) -> Arrays:
        make = partial(_make_empty_memory, self._remembered[key].kind, len(self._state.roster.names))
        return self._state.keep(("memory", key), make)

    def take_roads(self, tables: RoadTables) -> None:
        """Set the open roads of each game for the search of paths."""
        self._paths.take_roads(tables)


class AskedSteps:
    """Decisions of some agents of all games by the steps of a strategy that is not their own, along one edge a turn.

    Args:
        state: the state of all games.
        steps: the steps of the strategy.
        agents: the numbers of the agents in the roster.
    """

    def __init__(self, state: GameArrays, steps: Sequence[CoreStep], agents: IntArray) -> None:
        self._state = state
        self._agents = flatten(agents, np.int64)
        roster = state.roster
        of_agent: list[Sequence[CoreStep]] = [()] * len(roster.names)
        for number in agents.tolist():
            of_agent[number] = steps
        paths = get_or_make(state.shared, "paths of asked strategies", lambda: StepPaths(state))
        self._steps = StrategySteps(state, of_agent, paths)
        self._first_node = np.zeros(len(state), np.int64)  # see `rules.GameColumns`
        self._tables: RoadTables | None = None  # once a rule has closed roads
        self._streets = state.streets.core
        unread: Any = flatten(np.zeros(0), np.int64)
        games = rules.GameColumns(
            len(roster.names),
            len(roster.teams),
            node=state.node.reshape(-1).data,
            alive=state.alive.view(np.uint8).reshape(-1).data,
            turn=state.turn.data,
            start=unread,
            previous=unread,
            placed=flatten(unread, np.uint8),
            stops=unread,
            home=unread,
            over=flatten(unread, np.uint8),
            score=flatten(unread, np.float64),
            team=flatten(roster.team_of, np.int64),
            plays=flatten(unread, np.uint8),
            first_node=self._first_node.data,
            nobody=roster.nobody,
        )
        self._core = self._steps.get_strategies(games, 0)

    def choose(self, games: IntArray, asked: BoolArray, drawn: IntArray) -> IntArray:
        """Return the chosen numbers of legal nodes, (games, agents); 0, to stay, where the steps choose nothing.

        Args:
            games: the numbers of the games.
            asked: a mask of the agents to decide for, (games, agents).
            drawn: (games, agents) how many numbers each has drawn in this turn; it is updated.
        """
        roads = self._state.roads
        if (self._tables is not None or roads.differ) and self._tables is not roads.tables:
            self._tables = roads.tables
            self._first_node[:] = roads.tables.first
            self._steps.take_roads(roads.tables)
            self._streets = moves.LegalMoves(
                flatten(roads.tables.offsets, np.int32), flatten(roads.tables.targets, np.int32)
            )
        found = np.zeros(asked.shape, np.int64)
        self._steps.take_memories(games)
        numbers = flatten(games, np.int64)
        moves.ask(
            self._core,
            self._streets,
            numbers,
            self._agents,
            flatten(asked, np.uint8),
            flatten(drawn, np.int64),
            flatten(found, np.int64),
        )
        self._steps.give_memories(games)
        return found


def _make_column(values: object, dtype: type[np.generic]) -> Any:  # memoryviews are not subscriptable
    return np.array(values, dtype).data
