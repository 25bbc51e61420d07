"""Points the context of one game at each game of a batch in turn."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from itertools import groupby
from typing import Any, NoReturn
from weakref import WeakValueDictionary

import numpy as np

from gamms.core.agents import PointedColumns
from gamms.core.copies import copied
from gamms.errors import BadValue
from gamms.game.block.columns import PlayedGame
from gamms.game.block.state import GameArrays, Heading
from gamms.game.movement.roads import RoadMap
from gamms.game.snapshots import Snapshot
from gamms.ir.agents import AgentBlock, show_column, show_flights, show_lives, show_progress
from gamms.ir.game_state import GameState
from gamms.ir.graph import IntArray
from gamms.ir.journal import PLAIN, Journal
from gamms.ir.obstacles import BoolArray
from gamms.typing.agent_engine import IAgent

_READ = ("began", "counts", "data", "deeds", "errors", "events", "memories", "messages", "moves", "scores")
"""Fields of the state of a game that are made when they are read."""
_OF_ONE = ("__contains__", "__delitem__", "__getitem__", "__setitem__", "get", "pop", "setdefault")
_OF_ALL = (
    *("__bool__", "__deepcopy__", "__eq__", "__format__", "__ior__", "__iter__", "__len__", "__ne__", "__or__"),
    *("__repr__", "__ror__", "clear", "copy", "items", "keys", "popitem", "update", "values"),
)


class GuardedDict(dict[Any, Any]):
    """A dict of a game, some of whose values only the core has; if a function reads one, its game leaves.

    Args:
        values: the values of the other keys.
        keys: the keys whose values only the core has; None: all.
        leave: moves the game to a context of its own; called with the reason.
        what: the dict, in words.
    """

    def __init__(
        self, values: dict[Any, Any], keys: frozenset[str] | None, leave: Callable[[str], NoReturn], what: str
    ) -> None:
        super().__init__(values)
        self.of_core = keys
        self.leave = leave
        self.what = what


def _refusing(name: str, *, is_of_one: bool) -> Callable[..., Any]:
    """Return a method of `GuardedDict` that reads the value of one key, or all values."""
    method = getattr(dict, name, None)

    def read(self: GuardedDict, *args: object, **named: object) -> Any:
        if method is None or self.of_core is None or not is_of_one or args[0] in self.of_core:
            self.leave(f"reads {self.what}")
        return method(self, *args, **named)

    return read


for _name in (*_OF_ONE, *_OF_ALL):
    setattr(GuardedDict, _name, _refusing(_name, is_of_one=_name in _OF_ONE))


class StartOfGame:
    """The start of the game that a context is pointed at; the game cannot be reset to it.

    Args:
        read: returns the value of a field of the game.
        replace_data: sets `ctx.game.data`.
        began: returns the start places of agents.
        memory_of: returns the memory of an agent.
        leave: moves the game to a context of its own; called with the reason.
    """

    def __init__(
        self,
        read: Callable[[str], Any],
        replace_data: Callable[[dict[Any, Any]], None],
        began: Callable[[], dict[str, Any]],
        memory_of: Callable[[str], dict[Any, Any]],
        leave: Callable[[str], NoReturn],
    ) -> None:
        self.read = read
        self.replace_data = replace_data
        self._began = began
        self.memory_of = memory_of
        self._leave = leave

    @property
    def snapshot(self) -> "StartOfGame":
        """The object with the start places of agents."""
        return self

    def places_of(self, _: object) -> dict[str, Any]:
        """Return the start places of agents."""
        return self._began()

    def place_of(self, agent: IAgent) -> Any:
        """Return the place of an agent that came later."""
        return getattr(agent, "position", agent.current_node_id)

    def __getattr__(self, name: str) -> NoReturn:
        """Refuse everything else."""
        if name.startswith("__"):
            raise AttributeError(name)
        self._leave("resets the game")


class PointedState(GameState):
    """The state of the game that a context is pointed at; some fields are computed when they are read."""

    __slots__ = ()

    def memory_of(self, name: str) -> dict[Any, Any]:
        """Return the writable memory of an agent in the game that the context is pointed at."""
        memory: dict[Any, Any] = self.start.memory_of(name)
        return memory


def _read_field(name: str, state: GameState) -> Any:
    return state.start.read(name)


def _play_turn_in_it(state: GameState, _: object) -> None:
    state.start._leave("plays a turn of the game")


for _name in _READ:
    _set_field: Any = _play_turn_in_it if _name != "data" else lambda state, data: state.start.replace_data(data)
    setattr(PointedState, _name, property(partial(_read_field, _name), _set_field))


class Population:
    """A set of agents, with their sensors, that the context has in some games.

    Args:
        game: the game whose context has them now.
        state: the state of all games of the batch.
        before: the previous set; None: this is the set of the start.

    Attributes:
        agents, sensors: the agents and the sensors.
        block: the block of the agents.
        numbers: the number in the roster of each agent, by row.
        flying: the indices of its flying agents among all flying agents of the batch.
        rows_in_air: the rows of its flying agents.
        first_headings: the default headings of agents, by row.
        journal: records the changes of functions.
    """

    def __init__(self, game: PlayedGame, state: GameArrays, before: "Population | None" = None) -> None:
        storage = game.ctx.agent.storage
        self.agents = storage.share()
        self.sensors = game.ctx.sensor.storage.share()
        self.block: AgentBlock = self.agents.block
        number_of = {name: number for number, name in enumerate(state.roster.names)}
        self.numbers: IntArray = np.array([number_of[name] for name in self.block.names], np.int64)
        row_of = {number: row for row, number in enumerate(self.numbers.tolist())}
        fly = [] if state.flights is None else state.flights.agents.tolist()
        self.flying = [place for place, number in enumerate(fly) if number in row_of]
        self.rows_in_air = [row_of[fly[place]] for place in self.flying]
        known = {} if before is None else dict(zip(before.agents.members, before.first_headings, strict=True))
        now = zip(self.agents.members, self.block.heading, strict=True)
        self.first_headings: list[Heading] = [known.get(agent, heading) for agent, heading in now]
        self.journal = self.renew_journal()

    def renew_journal(self) -> Journal:
        """Give the block a new journal, and return it."""
        self.journal = Journal(self.block.names)
        self.block.journal = self.journal
        return self.journal

    @property
    def key(self) -> tuple[Any, ...]:
        """The key of a set, equal for equal names, kinds, teams, speeds, strategies and sensors."""
        each = zip(self.agents.members, self.agents.equipment, strict=True)
        agents = [
            (one.name, one.type, one.team, one.speed, id(strategy), *own, *map(id, own.values()))
            for one, (strategy, own) in each
        ]
        return (*agents, *map(id, self.sensors.sensors), *self.sensors.owners)


class PointedContext:
    """A context that is pointed at each game of a batch in turn: it then has the agents, turn and seed of that game.

    Args:
        game: the game at its start, in a context in which nothing else is played.
        state: the state of all games.

    Attributes:
        population: the agents of the context.
        population_of: the agents of each game; None: the agents of the start.
        headings: the headings that differ from the start, by the numbers of agents; None: unknown.
        alive: whether each agent of the context lives, by row, as bytes; empty: unknown.
        delayed_looks: the pending reports of sensors in each game.
        departed: the agents that were deleted in each game; see `GameState`.
        moved: game -> a moment, and the agents whose moves functions see then; others were created or deleted since.
        map: the storage of the map of the context.
        map_changes: the changes of the map that is shown; see `IMapStorage.changes`.
    """

    population: Population
    headings: Mapping[int, Heading] | None
    map_changes: tuple[int, int, int, bool]

    def __init__(self, game: PlayedGame, state: GameArrays) -> None:
        self._game = game
        self._state = state
        self._before: Snapshot | None = None
        self._looks_at_start = copied(game.internals.state.delayed_looks)
        self.delayed_looks = [copied(self._looks_at_start) for _ in range(len(state))]
        self._departed_at_start = {**game.internals.state.departed}
        self.departed = [{**self._departed_at_start} for _ in range(len(state))]
        self.population_of: list[Population | None] = [None] * len(state)
        self.moved: dict[int, tuple[tuple[int, int | None, bool], Population]] = {}
        self._known: WeakValueDictionary[tuple[Any, ...], Population] = WeakValueDictionary()
        self._own = vars(game.ctx)
        self.map = game.ctx.graph.storage
        self.alive = b""

    def forget(self, games: IntArray) -> None:
        """Reset some games to the agents and the pending reports of the start."""
        for number in games.tolist():
            self.delayed_looks[number] = copied(self._looks_at_start)
            self.departed[number] = {**self._departed_at_start}
            self.population_of[number] = None
            self.moved.pop(number, None)

    def checkpoint(self) -> Callable[[], None]:
        """Return a function that undoes all later changes."""
        delayed_looks = [{**looks} if looks else {} for looks in self.delayed_looks]
        departed = [{**one} if one else {} for one in self.departed]
        populations = [*self.population_of]
        moved = {**self.moved}

        def take_back() -> None:
            self.delayed_looks[:] = delayed_looks
            self.departed[:] = departed
            self.population_of[:] = populations
            self.moved = moved

        return take_back

    def hold(self) -> None:
        """Remember the context as it is, for `release`."""
        self._before = self._game.snapshot()
        self._first_looks = self._game.internals.state.delayed_looks
        self._first = Population(self._game, self._state)
        self._note_shown(self._first)
        self._first_map = self.map.snapshot()
        self._note_map(None)

    def release(self) -> None:
        """Restore the context as it was before it was pointed at games."""
        assert self._before is not None  # noqa: S101 - it is held
        self.show(self._first)
        self._first.block.placed.clear()
        self._first.block.journal = PLAIN
        self._game.internals.state.delayed_looks = self._first_looks
        self._game.restore(self._before)
        self._before = None

    # -- agents -------------------------------------------------------------------------------------------------

    def show(self, population: Population) -> None:
        """Set the agents of the context."""
        self._game.ctx.agent.storage.show(population.agents)
        self._game.ctx.sensor.storage.show(population.sensors)
        self._note_shown(population)

    def show_first(self) -> None:
        """Set the agents of the context to those of the start."""
        self.show(self._first)

    @contextmanager
    def showing(self, population: Population) -> Iterator[None]:
        """Show another set of agents within the block, then the present set again, which may be changed."""
        agent = self._game.ctx.agent.storage
        sensor = self._game.ctx.sensor.storage
        agents = agent.share()
        sensors = sensor.share()
        shown = self.population
        lives = bytes(agents.block.alive)
        headings = self.headings
        self.show(population)
        try:
            yield
        finally:
            agent.show(agents)
            sensor.show(sensors)
            show_lives(agents.block, lives)
            self._note_shown(shown)
            self.alive = lives
            self.headings = headings

    def _note_shown(self, population: Population) -> None:
        self.population = population
        self.alive = b""
        self.headings = None

    @property
    def first(self) -> Population:
        """The agents of the start."""
        return self._first

    def part_from_others(self) -> None:
        """Give the context its own set of agents, if strategies or sensors were changed."""
        sensors = self._game.ctx.sensor.storage.share()
        known = self.population.sensors
        are_same = sensors is known or (sensors.sensors, sensors.keywords) == (known.sensors, known.keywords)
        each = zip(self.population.agents.members, self.population.agents.equipment, strict=True)
        if not are_same or any((agent.strategy, agent.sensors) != own for agent, own in each):
            self._game.ctx.agent.storage.part()

    def has_other_agents(self) -> bool:
        """Return whether agents were created or deleted since a set of agents was shown."""
        changed: bool = self._game.ctx.agent.block is not self.population.block
        return changed

    def take_population(self, number: int) -> Population:
        """Store the present agents of the context as those of a game, and return them."""
        before = self.population
        found = Population(self._game, self._state, before)
        before.renew_journal()
        known = self._known.setdefault(found.key, found)
        if known is not found:
            self.show(known)
        self._note_shown(known)
        self.population_of[number] = known
        return found

    @contextmanager
    def held(self) -> Iterator[None]:
        """Point the context at games in the block, and restore it afterwards unless it was held before."""
        if self._before is not None:
            yield
            return
        self.hold()
        try:
            yield
        finally:
            self.release()

    def by_population(self, games: IntArray) -> IntArray:
        """Return the indices of some games, ordered so that games with the same agents follow each other."""
        populations = [*map(self.population_of.__getitem__, games.tolist())]
        numbers = {one: number for number, one in enumerate(dict.fromkeys(populations))}
        return np.argsort([*map(numbers.__getitem__, populations)], kind="stable")

    def each(self, games: IntArray) -> Iterator[int]:
        """Point the context at each of some games in turn, and yield the number of the game."""
        for population, some in groupby(games.tolist(), self.population_of.__getitem__):
            yield from self._each_with(population or self._first, np.array([*some], np.int64))

    def _each_with(self, population: Population, games: IntArray) -> Iterator[int]:
        """Do the same as `each` for games with the same agents."""
        state = self._state
        block = population.block
        numbers = population.numbers
        values = self._game.internals.state
        turns = self._game.internals.parts.turns
        columns = self._nodes_of(population, games)
        more = [(name, column[games][:, numbers]) for name, column in state.numbers.items()]
        row_of = {number: row for row, number in enumerate(numbers.tolist())}
        lives = self._lives(population, games)
        placed = self._placed(games)
        are_placed = np.any(placed, axis=1).tolist()
        roads = state.roads
        are_closed = roads.are_closed
        seeds = state.seeds
        own = self._own
        headings = state.headings
        flies = len(population.rows_in_air) > 0
        remembers = state.movement.remembers
        self._drop_changes(population)
        played = state.turn[games].tolist()
        for at, number in enumerate(games.tolist()):
            if self.population is not population:
                self.show(population)
            values.turn = played[at]
            values.delayed_looks = self.delayed_looks[number]
            values.departed = self.departed[number]
            own["_seed"] = seeds[number]
            turns.seed_changes += 1
            columns.point(at)
            if flies or headings[number] != self.headings:
                self._show_poses(number)
            if lives[at] != self.alive:
                self.show_lives(lives[at])
            for name, column in more:
                show_column(block, name, column[at])
            if block.placed or are_placed[at]:
                block.placed = set(np.flatnonzero(placed[at][numbers]).tolist())
            if remembers:
                on_edges = state.movement.on_edges(number, state.node[number])
                show_progress(block, {row_of[agent]: one for agent, one in on_edges.items() if agent in row_of})
            if are_closed or self._roads is not None:
                self._show_roads(roads.of(number))
            yield number

    def _drop_changes(self, population: Population) -> None:
        """Undo what a function that has raised has changed of the map and the agents of the context."""
        if self.map_changes != self.map.changes():
            self._show_roads(None)
        if self.has_other_agents():
            self.show(population)

    def _lives(self, population: Population, games: IntArray) -> list[bytes]:
        """Return which agents live in each of some games, in the order of their rows."""
        lives = self._state.alive[games][:, population.numbers].tobytes()
        size = len(population.numbers)
        return [lives[at * size : (at + 1) * size] for at in range(len(games))]

    def _nodes_of(self, population: Population, games: IntArray) -> PointedColumns:
        """Return the current and previous nodes of agents in some games, in the order of their rows."""
        state = self._state
        numbers = population.block.numbers
        both = np.array([column[games][:, population.numbers] for column in (state.node, state.previous)], np.int64)
        ids = np.ascontiguousarray(state.streets.ids_of(both), np.int64)
        numbers.write(ids.reshape(-1).data, both.reshape(-1).data)
        node, previous = (column.reshape(-1).data for column in both)
        return PointedColumns(population.block, node, previous)

    def _show_poses(self, number: int) -> None:
        """Show the positions and rotations of flying agents in a game."""
        flights = self._state.flights
        headings = self._state.headings[number]
        shown = self.population
        if flights is not None:
            poses = flights.poses(number)
            show_flights(shown.block, shown.rows_in_air, [poses[place] for place in shown.flying])
        self.headings = headings
        each = zip(shown.numbers.tolist(), shown.first_headings, strict=True)
        show_column(shown.block, "heading", [headings.get(agent, first) for agent, first in each])

    def _placed(self, games: IntArray) -> BoolArray:
        """Return a mask of agents that rules have placed, (games, agents), without agents that flew there."""
        placed: BoolArray = self._state.placed[games]
        flights = self._state.flights
        if flights is not None:
            placed[:, flights.agents] &= ~flights.has_flown[games]
        return placed

    def show_lives(self, alive: bytes) -> None:
        """Set which agents of the context are alive, by row."""
        show_lives(self.population.block, alive)
        self.alive = alive

    def _show_roads(self, roads: RoadMap | None) -> None:
        """Open and close roads as in a game; None: as at the start."""
        if roads is not self._roads or self.map_changes != self.map.changes():
            self.map.restore(self._first_map if roads is None else roads.snapshot)
            self._note_map(roads)

    def _note_map(self, roads: RoadMap | None) -> None:
        self._roads = roads
        self.map_changes = self.map.changes()

    def change_roads(self, games: IntArray, verb: str, edges: Sequence[int]) -> None:
        """Close or open roads in some games.

        Args:
            games: the numbers of the games.
            verb: the name of the method of `ctx.graph`.
            edges: ids.

        Raises:
            UnknownName (KeyError): an edge does not exist in a game.
        """
        change = getattr(self._game.ctx.graph, verb)
        with self.held():
            for number in self.each(games):
                change(edges)
                self.take_roads(number)

    def take_roads(self, number: int) -> bool:
        """Store the map of the context for a game; return False, and do nothing, if more than roads was changed."""
        state = self._state
        revision, road_changes, *others = self.map.changes()
        known_revision, known_road_changes, *known_others = self.map_changes
        if revision - known_revision != road_changes - known_road_changes or others != known_others:
            return False
        try:
            roads = state.roads.map_with(*self.map.roads())
        except BadValue:
            return False
        if roads is not None and roads.snapshot is None:
            roads.snapshot = self.map.snapshot()
        state.put_roads(np.array([number]), roads)
        self._note_map(roads)
        return True
