"""Basic data of a batch: its source game, seeds, maps and agents; and helpers for columns and threads."""

from collections.abc import Callable, Collection, Hashable, Iterable, Mapping, Sequence
from itertools import chain, count, islice
from threading import Thread
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np

from gamms import kernels
from gamms.arguments import as_count, as_ids, as_int, as_items, as_key, as_mapping, as_name
from gamms.core import strategies as core
from gamms.errors import BadValue, UnknownName
from gamms.game.result import Result
from gamms.game.roles import Role
from gamms.game.settings import NamedRule, Plan
from gamms.game.snapshots import GameInternals, Snapshot
from gamms.game.strategy_specs import get_strategy_spec, make_form_key
from gamms.ir.agents import Position
from gamms.ir.graph import IntArray, split_mode
from gamms.ir.obstacles import BoolArray
from gamms.kernels.draws import BitArray
from gamms.limits import refuse_above
from gamms.readonly import copy_locked
from gamms.text import shown
from gamms.typing.agent_engine import AgentType, IAgent

# Bytes of an agent, measured: of each game in the core, with the events of 200 turns; of an agent that plays, and of a
# name that is reserved, in all games together.
BYTES_PER_AGENT = 290
BYTES_PER_PLAYER = 1_900
BYTES_PER_NAME = 1_200
Column = np.ndarray[Any, Any]
T = TypeVar("T")


def lock(arrays: Iterable[Column]) -> None:
    """Make arrays read-only, except for `put_locked`."""
    for array in arrays:
        if array.flags.writeable:
            array.setflags(write=False)


def put_locked(array: Column, where: IntArray | BoolArray | tuple[Any, ...], values: object) -> None:
    """Write to an array that may be read-only."""
    is_writeable = array.flags.writeable
    array.setflags(write=True)
    array[where] = values
    array.setflags(write=is_writeable)


def get_or_make(known: dict[Any, Any], key: Hashable, make: Callable[[], T]) -> T:
    """Return the value of a key; the first call stores `make()`."""
    if key not in known:
        known[key] = make()
    found: T = known[key]
    return found


def find_unique_pairs(at: IntArray, agents: IntArray) -> tuple[IntArray, IntArray]:
    """Return each pair of game and agent once, in the order of first occurrence."""
    if len(at) < 2:
        return at, agents
    _, first = np.unique(np.column_stack((at, agents)), axis=0, return_index=True)
    kept = np.sort(first)
    return at[kept], agents[kept]


class PlayedGame(Protocol):
    """The interface of `gamms.game.Game` that a batch needs."""

    ctx: Any  # its own class, which knows this one
    turn: int
    plans: Mapping[Any, Plan]

    # ruff: noqa: D102 - see there
    @property
    def agents(self) -> list[IAgent]: ...
    @property
    def rules(self) -> tuple[NamedRule, ...]: ...
    @property
    def facts(self) -> Mapping[str, Any]: ...
    @property
    def scores(self) -> Mapping[Any, float]: ...
    @property
    def over(self) -> dict[str, Any] | None: ...
    @property
    def internals(self) -> GameInternals: ...
    def settings(self) -> dict[str, Any]: ...
    def fork(self, seed: int) -> Any: ...
    def reset(self, seed: int | None = None) -> None: ...
    def step(self) -> bool: ...
    def run(self, max_turns: int | None = None) -> Result: ...
    def result(self) -> Result: ...
    def snapshot(self) -> Snapshot: ...
    def restore(self, snapshot: Snapshot) -> None: ...


def get_sensors(agent: "IAgent | ComingAgent") -> Mapping[str, Any]:
    """Return the sensors of an agent by their names."""
    found: Mapping[str, Any] = getattr(agent, "sensors", {})
    return found


def get_mode(agent: "IAgent | ComingAgent") -> str | None:
    """Return the mode of an agent on the ground, by which it may use edges; None: all edges, or it flies."""
    return None if agent.type is AgentType.AERIAL else getattr(agent, "mode", None)


class ComingAgent(NamedTuple):
    """An agent that is in no game of a batch at the start, but has a row.

    Attributes:
        name, team, type, speed, mode: the properties of the agent.
        strategy: its strategy, of which only the array form counts.
        sensors: the sensors that agents of this name carry in some game, by name.
        is_reserved: whether the caller has reserved the row; else the agent was deleted before the batch.
    """

    name: str
    team: Hashable
    type: AgentType
    speed: float | None
    mode: str | None
    strategy: Any
    sensors: Mapping[str, Any]
    is_reserved: bool = False

    @classmethod
    def make_like(cls, agent: IAgent, name: str) -> "ComingAgent":
        """Return a reserved agent of this name that is probably like another one."""
        own = agent.team, agent.type, agent.speed, get_mode(agent), agent.strategy, get_sensors(agent)
        return cls(name, *own, is_reserved=True)

    @classmethod
    def make_departed(cls, name: str, team: Hashable) -> "ComingAgent":
        """Return an agent that was deleted before the batch."""
        return cls(name, team, AgentType.BASIC, None, None, None, {})

    def is_compatible(self, agent: "IAgent | ComingAgent") -> bool:
        """Return whether an agent that was created can take this row."""
        is_same = self.team == agent.team and self.type is agent.type and self.speed == agent.speed
        is_same = is_same and self.mode == get_mode(agent)
        forms = [make_form_key(get_strategy_spec(one.strategy).array_form) for one in (self, agent)]
        return is_same and forms[0] == forms[1] and get_sensors(agent).keys() <= self.sensors.keys()


class AgentTable(NamedTuple):
    """The agents of every game of a batch, in the order of their names.

    Attributes:
        names: (agents,) the names of the agents, sorted.
        teams: the teams that agents play for, in the order of their first agents.
        team_of: (agents,) the number of each agent's team.
        keys: (agents,) the hashes of the names, for keyed draws.
        agents: the agents of the context that the batch was made from, for constant data such as sensors, and those
            that may come.
        is_first: (agents,) whether each agent is in the game at the start; the other rows are for agents that may come,
            whose strategies and sensors may differ between games.
        is_public: (agents,) whether callers observe the agent and give it actions.
        flies: (agents,) whether each agent flies; the others move on the ground.
    """

    names: tuple[str, ...]
    teams: tuple[Hashable, ...]
    team_of: IntArray
    keys: BitArray
    agents: Sequence[Any]  # `IAgent`, or `ComingAgent`
    is_first: BoolArray
    is_public: BoolArray
    flies: BoolArray

    @classmethod
    def of(cls, agents: Iterable[IAgent], coming: Iterable[ComingAgent] = ()) -> "AgentTable":
        """Return the roster of the agents, and of agents that rules may create.

        Args:
            agents: the agents of the start.
            coming: the agents that may come.
        """
        named: dict[str, Any] = {agent.name: agent for agent in sorted(agents, key=lambda agent: agent.name)}
        named |= {agent.name: agent for agent in coming}
        names = tuple(sorted(named))
        ordered = [named[name] for name in names]
        teams = tuple(dict.fromkeys(agent.team for agent in ordered))
        number = {team: i for i, team in enumerate(teams)}
        team_of = np.array([number[agent.team] for agent in ordered], np.int64)
        is_first = np.array([not isinstance(agent, ComingAgent) for agent in ordered], np.bool_)
        is_public = np.array([getattr(agent, "is_reserved", True) for agent in ordered], np.bool_)
        flies = np.array([agent.type is AgentType.AERIAL for agent in ordered], np.bool_)
        masks = [copy_locked(one) for one in (is_first, is_public, flies)]
        return cls(names, teams, copy_locked(team_of), copy_locked(kernels.compute_name_keys(names)), ordered, *masks)

    def replace_agents(self, agents: Mapping[int, IAgent]) -> "AgentTable":
        """Return the same roster with other agents of the same names and teams, by their numbers."""
        return self._replace(agents=[agents.get(number, agent) for number, agent in enumerate(self.agents)])

    def find_pairs(self, other: "AgentTable") -> IntArray:
        """Return the numbers of the agents that are in both rosters: here, and in the other, (2, agents)."""
        numbers = {name: number for number, name in enumerate(other.names)}
        pairs = [(number, numbers[name]) for number, name in enumerate(self.names) if name in numbers]
        return np.array(pairs, np.int64).reshape(-1, 2).T

    def _find_obeying(self) -> BoolArray:
        """Return a mask of the agents that obey turn restrictions, (agents,)."""
        modes = [get_mode(agent) for agent in self.agents]
        return np.array([mode is not None and split_mode(mode)[1] for mode in modes], np.bool_)

    @property
    def obey_turns(self) -> bool:
        """Whether any agent obeys turn restrictions."""
        return bool(self._find_obeying().any())

    def find_driving(self, speed_unit: str) -> BoolArray:
        """Return a mask of the agents that obey turn restrictions by metres, (agents,), given the unit of speeds."""
        return self._find_obeying() & (speed_unit != "edges")

    def get_teams_by_name(self) -> dict[str, Hashable]:
        """Return agent -> its team."""
        return dict(zip(self.names, map(self.teams.__getitem__, self.team_of.tolist()), strict=True))

    def can_hold(self, agent: IAgent) -> bool:
        """Return whether an agent that was created in a game can take the row of its name."""
        if agent.name not in self.names:
            return False
        number = self.names.index(agent.name)
        known = self.agents[number]
        if isinstance(known, ComingAgent):
            return known.is_compatible(agent)
        is_same = known.strategy is agent.strategy and get_sensors(known) == get_sensors(agent)
        return is_same and ComingAgent.make_like(known, agent.name).is_compatible(agent)

    def list_start_nodes(self, game: PlayedGame) -> list[int]:
        """Return the ids of the start nodes of a game's agents; for flying agents, the nodes nearest to the starts.

        The nodes of agents that may come are arbitrary, and those in place of removed nodes; see `InitialState`.
        """
        graph = game.ctx.graph.graph
        starts = find_starts(game)
        found = list[int]()
        for agent in self.agents:
            place = None if isinstance(agent, ComingAgent) else starts[agent.name]
            if isinstance(place, tuple):
                place = graph.nearest_node(*place[:2])
            found.append(next(iter(graph.get_nodes())) if place is None or not graph.has_node(place) else place)
        return found

    def members(self, team: Hashable) -> IntArray:
        """Return the numbers of the public agents of a team, ascending."""
        number = self.teams.index(team) if as_key(team, "A team") in self.teams else len(self.teams)
        found = np.flatnonzero((self.team_of == number) & self.is_public)
        if not len(found):
            raise UnknownName("team", team, self.public_teams)
        return found

    @property
    def public_teams(self) -> tuple[Hashable, ...]:
        """The teams of public agents, in the order of their first agents."""
        return tuple(dict.fromkeys(self.teams[number] for number in self.team_of[self.is_public].tolist()))

    def column(self, values: Mapping[str, Any], default: float) -> Column:
        """Return values by agent name as an array of one game, (1, agents), with a default for missing names."""
        known = as_mapping(values, "values")
        return np.array([[known.get(name, default) for name in self.names]])

    def find_players(self, teams: Collection[Hashable] | None) -> BoolArray:
        """Return whether each agent is in one of these teams, or has one of these `Role`s, (agents,); None: all."""
        is_in = np.array([teams is None or team in teams for team in self.teams], np.bool_)
        found: BoolArray = is_in[self.team_of]
        for role in teams or ():
            if isinstance(role, Role):
                for number in np.flatnonzero(self.find_players([role.team])).tolist():
                    found[number] |= self._has(number, role)
        return found

    def _has(self, number: int, role: Role) -> bool:
        """Return whether an agent of the team of a role has it; the attributes of agents that may come are unknown."""
        agent = self.agents[number] if role.where else None
        type = AgentType.AERIAL if self.flies[number] else AgentType.BASIC
        return role.is_held_by(self.names[number], type, getattr(agent, "__dict__", {}))

    def find_parts(self, order: Sequence[Sequence[Hashable]] | None) -> IntArray:
        """Return the part of the turn in which each agent moves, for an order of play, (agents,)."""
        parts = [next((i for i, part in enumerate(order or ()) if team in part), 0) for team in self.teams]
        return np.array(parts, np.int64)[self.team_of]

    def list_teams(self) -> list[Hashable]:
        """Return the team of each agent."""
        return [self.teams[number] for number in self.team_of.tolist()]

    def find_unlisted(self, order: Sequence[Sequence[Hashable]] | None) -> BoolArray:
        """Return whether the team of each agent is missing in an order of play, (agents,)."""
        return ~self.find_players(None if order is None else [team for part in order for team in part])

    @property
    def nobody(self) -> int:
        """The number of the team of agents without one (None); -1: all agents have a team."""
        return self.teams.index(None) if None in self.teams else -1

    def are_mates(self, agents: IntArray, others: IntArray) -> BoolArray:
        """Return whether agents are mates of others, (pairs,), given numbers (pairs,); see `strategies.are_mates`."""
        found = np.zeros(len(agents), np.bool_)
        pairs = kernels.as_buffer(agents), kernels.as_buffer(others)
        core.mark_mates(kernels.as_buffer(self.team_of), self.nobody, *pairs, kernels.as_buffer(found.view(np.uint8)))
        return found

    def name(self, number: int) -> str:
        """Return the name of an agent, for messages."""
        return shown(self.names[number])


def list_agents(game: PlayedGame) -> list[IAgent]:
    """Return all agents of a game in the order of names, dead or alive."""
    return [agent for _, agent in sorted(game.ctx.agent.agents.items())]


def find_starts(game: PlayedGame) -> Mapping[str, int | Position]:
    """Return name -> the start of an agent, a node id or (x, y, z), or its present place if the game has not begun."""
    known = game.internals.starts
    agents = game.ctx.agent.agents
    if known.keys() >= agents.keys():
        return known
    return {name: game.internals.find_start(agent) for name, agent in agents.items()}


def find_decider(agent: IAgent, plans: Mapping[Any, Plan]) -> Any:
    """Return the plan of an agent's team, or the agent's strategy, or None."""
    return plans[agent.team].function if agent.team in plans else agent.strategy


def make_reserved_agents(roster: AgentTable, most_agents: object) -> list[ComingAgent]:
    """Return the agents that rules may create, for which the caller reserves rows."""
    found: dict[Hashable, list[str]] = {}
    given = most_agents if isinstance(most_agents, Mapping) else dict.fromkeys(roster.public_teams, most_agents)
    for team, most in given.items():
        there = len(roster.members(team))
        if isinstance(most, Iterable):
            names = [as_name(name, "an agent") for name in as_items(most, f"most_agents[{team!r}]", "names")]
        else:
            number = as_count(most, f"most_agents[{team!r}]")
            if number < there:
                raise BadValue(f"most_agents[{team!r}] is {number}, and team {shown(team)} has {there} agents.")
            refuse_above(number * BYTES_PER_NAME, f"A batch with most_agents[{team!r}]={number}")
            free = (name for i in count() if (name := f"{team}_{i}") not in roster.names)
            names = list(islice(free, number - there))
        taken = [name for name in names if name in (*roster.names, *chain.from_iterable(found.values()))]
        if taken:
            raise BadValue(f"most_agents[{team!r}] reserves names for new agents, and {shown(taken[0])} is taken.")
        if len({*names}) < len(names):
            raise BadValue(f"most_agents[{team!r}] has a name twice: {shown(names)}.")
        found[team] = names
    first = {team: roster.agents[roster.members(team)[0]] for team in found}
    return [ComingAgent.make_like(first[team], name) for team, names in found.items() for name in names]


def as_seeds(num_games: int | None, seed: int, seeds: object) -> Sequence[int]:
    """Return the seeds of a batch: the given ones, or consecutive numbers."""
    if seeds is None:
        if num_games is None:
            raise BadValue("batch needs the number of games, or seeds=.")
        first = as_int(seed, "seed")
        seeds_of_games = range(first, first + as_count(num_games, "num_games"))
        as_int(seeds_of_games[-1], "the seed of the last game")
        return seeds_of_games
    if as_int(seed, "seed"):
        raise BadValue(f"batch got seed={shown(seed)} and seeds: give one of both.")
    given = tuple(as_ids(seeds, "seeds"))
    if not given:
        raise BadValue("seeds is empty: a batch has at least one game.")
    if num_games is not None and as_count(num_games, "num_games") != len(given):
        raise BadValue(f"batch got num_games={shown(num_games)} and {len(given)} seeds: give one of both.")
    return given


def draw_maps(seeds: Sequence[int], num_maps: int) -> IntArray:
    """Return the number of the map that each seed draws, (seeds,)."""
    if num_maps == 1:
        return np.zeros(len(seeds), np.int64)
    purposes = kernels.compute_purpose_keys(seeds, [("map",)])
    bits = kernels.draw_bits_rows(purposes[:, 0], kernels.compute_name_keys(["map"]), 0)
    return kernels.convert_to_integers(bits, num_maps)


def play_in_threads(play: Callable[[int, int, int], object], games: int, threads: int, *, waits: bool = False) -> None:
    """Call `play(thread, begin, end)` for equal parts of the games, each part in its own thread.

    If several threads raise errors, the first one is raised after all have ended.

    Args:
        play: called with the number of the thread, the first game, and the end of the range.
        games: the number of games.
        threads: the number of threads; the calling thread plays the last part, unless it waits.
        waits: whether the calling thread only waits, so that it notices Ctrl-C.
    """
    if threads == 1 and not waits:
        play(0, 0, games)
        return
    bounds = [games * part // threads for part in range(threads + 1)]
    errors: dict[int, BaseException] = {}

    def play_part(number: int) -> None:
        try:
            play(number, bounds[number], bounds[number + 1])
        except BaseException as error:  # noqa: BLE001 - raised below
            errors[number] = error

    others = [Thread(target=play_part, args=(number,)) for number in range(threads - (not waits))]
    for one in others:
        one.start()
    if not waits:
        play_part(threads - 1)
    for one in others:
        one.join()
    if errors:
        raise errors[min(errors)]


def describe_turns(turns: IntArray, games: IntArray, first_game: int) -> str:
    """Return a phrase with the turns of games, (games,), for notes on errors; it names a single game.

    `first_game`: the number of game 0 in the batch, see `GameArrays`.
    """
    known = np.unique(turns).tolist() or [0]
    those = f"in turn {known[0]}" if len(known) == 1 else f"in turns {known[0]} to {known[-1]}"
    return f"{those} of game {first_game + games[0]}" if len(games) == 1 else those


def make_roster(game: PlayedGame, most_agents: object = None) -> AgentTable:
    """Return the roster of a game's agents, with names for agents that may come later; see `make_reserved_agents`."""
    agents = list_agents(game)
    roster = AgentTable.of(agents)
    coming = {name: ComingAgent.make_departed(name, team) for name, (team, _) in game.internals.state.departed.items()}
    if most_agents is not None:
        coming |= {agent.name: agent for agent in make_reserved_agents(roster, most_agents)}
    more = [agent for name, agent in coming.items() if name not in roster.names]
    return AgentTable.of(agents, more) if more else roster
