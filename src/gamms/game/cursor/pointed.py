"""Points the context of one game at each game of a batch in turn."""

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import deepcopy
from functools import partial
from itertools import takewhile
from typing import Any, NoReturn
from weakref import WeakValueDictionary

import numpy as np
from numpy.random import Generator

from gamms.core.agents import GamePointer
from gamms.core.copies import copy_deep, copy_filled, copy_items, copy_values
from gamms.errors import BadValue
from gamms.game.block.columns import PlayedGame
from gamms.game.block.state import GameArrays, Heading
from gamms.game.cursor.own_functions import FirstValues, FunctionsPerGame
from gamms.game.lasting import copy_doing, put_doing
from gamms.game.movement.roads import RoadMap
from gamms.game.result import Collectors
from gamms.game.snapshots import Snapshot
from gamms.ir.agents import AgentBlock, show_column, show_flights, show_lives, show_progress
from gamms.ir.game_state import FIELDS, GameState
from gamms.ir.graph import IntArray
from gamms.ir.journal import PLAIN, Journal
from gamms.ir.obstacles import BoolArray
from gamms.typing.agent_engine import IAgent

_READ = ("began", "counts", "driven", "errors", "events", "memories", "messages", "moves", "scores")
"""Fields of the state of a game that are made when they are read; so are `data` and `over`, which may be set."""
_IN_ROW = ("agent_facts", "delayed_looks", "departed", "team_facts", "team_memories")
"""Fields of the state of a game that are read from its row; see `RowValues`."""
_OF_TURN = (
    *(
        "blocked",
        "collected",
        "deed_log",
        "driven",
        "drawn",
        "facts",
        "has_begun",
        "last_turn",
        "marked",
        "named_edges",
    ),
    *("parts_played", "row", "start", "stream_version", "timings", "turn", "under_way", "unlogged"),
)
"""Fields of the state of a game that columns or logs hold, or the engine that plays all games."""
_OTHERS = [name for name in FIELDS if name not in {*_READ, *_IN_ROW, *_OF_TURN, "data", "over"}]
"""The other fields of the state of a game: each game has its own."""
_OF_ONE = ("__contains__", "__delitem__", "__getitem__", "__setitem__", "get", "pop", "setdefault")
_OF_ALL = (
    *("__eq__", "__format__", "__ior__", "__iter__", "__len__", "__ne__", "__or__"),
    *("__repr__", "__ror__", "clear", "copy", "items", "keys", "popitem", "update", "values"),
)

Looks = dict[tuple[str, str], Any]
"""What agents have sensed: (agent, "") -> its last state, and (agent, sensor) -> the last data of the sensor."""


class GuardedDict(dict[Any, Any]):
    """A dict of a game, some of whose values are not in it until a function reads one of them.

    Args:
        values: the values of the other keys.
        keys: the keys whose values are not in it; None: all.
        fill: called with the dict before such a value is read, to put all of them in.

    Attributes:
        is_filled: whether all values are in it.
    """

    def __init__(
        self, values: dict[Any, Any], keys: frozenset[str] | None, fill: Callable[["GuardedDict"], object]
    ) -> None:
        super().__init__(values)
        self._unread = keys
        self.fill_by(fill)
        self.is_filled = False

    def __bool__(self) -> bool:
        return len(self) > 0

    def __deepcopy__(self, memo: dict[int, Any]) -> dict[Any, Any]:
        return deepcopy({**self}, memo)

    def fill_by(self, fill: Callable[["GuardedDict"], object]) -> None:
        """Set the function that puts the values in."""
        self._fill = fill

    def fill(self) -> None:
        """Put all values in, unless they are."""
        if not self.is_filled:
            self.is_filled = True
            try:
                self._fill(self)
            except BaseException:
                self.is_filled = False
                raise

    def may_lack(self, key: object) -> bool:
        """Return whether the value of a key is possibly not in it."""
        return not self.is_filled and (self._unread is None or key in self._unread)


def _make_filling_method(name: str, *, is_of_one: bool) -> Callable[..., Any]:
    """Return the method of `dict` with this name, which first fills the dict if it may lack the key, or any value."""
    method = getattr(dict, name)

    def read(self: GuardedDict, *args: object, **named: object) -> Any:
        if not is_of_one or self.may_lack(args[0]):
            self.fill()
        return method(self, *args, **named)

    return read


for _name in (*_OF_ONE, *_OF_ALL):
    setattr(GuardedDict, _name, _make_filling_method(_name, is_of_one=_name in _OF_ONE))


class StartOfGame:
    """The start of the game that a context is pointed at; the game cannot be reset to it.

    Args:
        pointed: the context.
        read: returns the value of a field of the game.
        row: returns the Python values of the game; see `RowValues`.
        end: ends the game; called with the reason, the winner and the truncation.
        replace_data: sets `ctx.game.data`.
        refuse: refuses a verb; called with it, in words.
    """

    def __init__(
        self,
        pointed: "PointedContext",
        read: Callable[[str], Any],
        row: Callable[[], "RowValues"],
        end: Callable[[dict[str, Any] | None], None],
        replace_data: Callable[[dict[Any, Any]], None],
        refuse: Callable[[str], NoReturn],
    ) -> None:
        self.pointed = pointed
        self.read = read
        self.row = row
        self.end = end
        self.replace_data = replace_data
        self.refuse = refuse

    @property
    def snapshot(self) -> "StartOfGame":
        """The object with the start places of agents."""
        return self

    @property
    def agents(self) -> Any:
        """What agents know of others that look ahead: see `Snapshot.agents`."""
        return self.pointed.at_rest.agents

    @property
    def sensors(self) -> Any:
        """The same of sensors; see `Snapshot.sensors`."""
        return self.pointed.at_rest.sensors

    @property
    def data(self) -> dict[str, Any]:
        """The data of rules at the start; read-only."""
        return self.pointed.at_rest.data

    def places_of(self, _: object) -> dict[str, Any]:
        """Return the start places of agents."""
        return {**self.read("began")}

    def place_of(self, agent: IAgent) -> Any:
        """Return the place of an agent that came later."""
        return getattr(agent, "position", agent.current_node_id)

    def __getattr__(self, name: str) -> NoReturn:
        """Refuse everything else."""
        if name.startswith("__"):
            raise AttributeError(name)
        self.refuse("resets the game")


class PointedState(GameState):
    """The state of the game that a context is pointed at; fields are read from its row, or made when they are read."""

    __slots__ = ()

    def get_memory(self, name: str) -> dict[Any, Any]:
        """Return the writable memory of an agent in the game that the context is pointed at."""
        memory: dict[Any, Any] = self.start.row().memories.setdefault(name, {})
        return memory

    @property
    def row(self) -> int:  # type: ignore[override] # it is not set here
        """The number of the game in `deed_log`."""
        number: int = self.start.pointed.number
        return number

    @property
    def last_turn(self) -> int | None:  # type: ignore[override] # it is not set here
        """The turn after which the present `run` stops; None: no limit."""
        turn: int | None = self.start.pointed.run_until()
        return turn


def _read_field(name: str, state: GameState) -> Any:
    return state.start.read(name)


def _read_row(name: str, state: GameState) -> Any:
    return getattr(state.start.row(), name)


def _write_row(name: str, state: GameState, value: object) -> None:
    setattr(state.start.row(), name, value)


def _play_turn_in_it(state: GameState, _: object) -> None:
    state.start.refuse("plays a turn of the game")


for _name in _READ:
    setattr(PointedState, _name, property(partial(_read_field, _name), _play_turn_in_it))
for _name in (*_IN_ROW, *_OTHERS):
    setattr(PointedState, _name, property(partial(_read_row, _name), partial(_write_row, _name)))
for _name, _write in (
    ("data", lambda state, data: state.start.replace_data(data)),
    ("over", lambda state, over: state.start.end(over)),
):
    _set_field: Any = _write
    setattr(PointedState, _name, property(partial(_read_field, _name), _set_field))


class RowValues:
    """What only Python can hold of a game of a batch. It is made when it is read first.

    It has all fields of `GameState` that neither columns nor logs hold.

    Args:
        first: the values with which games begin.
        undone: see the attribute, at the start.

    Attributes:
        data: `ctx.game.data`; None: as at the start.
        facts: the public facts; None: as at the start.
        agent_facts, team_facts, memories, team_memories, delayed_looks, departed: see `GameState`.
        attributes: the custom attributes of the agents, by row; None: those that games share.
        undone: agent -> the reasons other than conflicts why its last action failed.
        collectors: the collectors, with their values; None: nothing was collected.
        rng: `ctx.rng`; None: it was not used.
        looks: what agents have sensed; None: as at the start. See `ShownGame.keep_looks`.
        population: the agents; None: those of the start.
        moved: a moment, and the agents whose moves functions see then; others were created or deleted since.
    """

    __slots__ = (
        *("agent_facts", "attributes", "collectors", "data", "delayed_looks", "departed", "facts"),
        *("looks", "memories", "moved", "population", "rng", "team_facts", "team_memories", "undone"),
        *_OTHERS,
    )

    def __init__(self, first: "GameState | RowValues", undone: Mapping[str, str]) -> None:
        self.data: dict[Any, Any] | None = None
        self.facts: dict[str, Any] | None = None
        self.agent_facts: dict[Any, dict[str, Any]] = copy_deep(first.agent_facts)
        self.team_facts: dict[Any, dict[str, Any]] = copy_deep(first.team_facts)
        self.memories: dict[str, dict[Any, Any]] = defaultdict(dict, copy_filled(first.memories))
        self.team_memories: dict[Any, dict[Any, Any]] = copy_deep(first.team_memories)
        self.delayed_looks: dict[tuple[str, str], dict[int, dict[str, Any]]] = copy_deep(first.delayed_looks)
        self.departed: dict[str, tuple[Any, int]] = {**first.departed}
        for name in _OTHERS:
            setattr(self, name, copy_deep(getattr(first, name)))
        self.attributes: list[dict[str, Any]] | None = None
        self.undone = dict(undone)
        self.collectors: Collectors | None = None
        self.rng: Generator | None = None
        self.looks: Looks | None = None
        self.population: Population | None = None
        self.moved: tuple[tuple[int, int | None, bool], Population] | None = None

    def begin(self, first: FirstValues) -> None:
        """Take the values with which this game begins, unlike others."""
        self.data = copy_items(first.data)
        self.facts = dict(first.facts)
        self.attributes = [copy_values(one) for one in first.attributes]
        self.agent_facts = copy_deep(first.agent_facts)
        self.team_facts = copy_deep(first.team_facts)

    def copy_turn_values(self) -> tuple[Any, ...]:
        """Return copies of what goes back with a turn that is taken back: all but what functions have written."""
        collected = None if self.collectors is None else self.collectors.snapshot()
        looks = {which: {**of_turns} for which, of_turns in self.delayed_looks.items()}
        rng = None if self.rng is None else deepcopy(self.rng)
        agents = self.attributes, self.looks, self.moved, self.population
        shared = copy_deep(self.team_memories)
        return (*agents, collected, looks, {**self.departed}, rng, {**self.undone}, shared)

    def take_back(self, values: tuple[Any, ...]) -> None:
        """Set what `copy_turn_values` has returned; what functions have written themselves stays."""
        attributes, self.looks, self.moved, population, collected, *others = values
        self.delayed_looks = others[0]
        self.departed = others[1]
        self.rng = others[2]
        self.undone = others[3]
        self.team_memories = others[4]
        if population is not self.population:
            self.attributes = attributes
            self.population = population
        if collected is None:
            self.collectors = None
        elif self.collectors is not None:
            self.collectors.restore(collected)


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
        flying: the numbers in the roster of its flying agents.
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
        self.flying = [number for number in state.flyers.tolist() if number in row_of]
        self.rows_in_air = [row_of[number] for number in self.flying]
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


class GamesToShow(GamePointer):
    """Shows games with the same agents in a context, one after the other.

    Args:
        pointed: the context.
        state: the state of all games.
        population: the agents of these games.
        games: the numbers of the games.
    """

    def __init__(self, pointed: "PointedContext", state: GameArrays, population: Population, games: IntArray) -> None:
        numbers: list[int] = games.tolist()
        agents = population.numbers
        self._alive = state.alive[games].take(agents, axis=1)
        values, own = pointed.shown_in
        node, previous = _get_node_numbers(state, population, games)
        turns: list[int] = state.turn[games].tolist()
        seeds = [*map(state.seeds.__getitem__, numbers)]
        lives = self._alive.view(np.uint8).reshape(-1).data
        super().__init__(pointed, numbers, population.block, values, own, turns, seeds, node, previous, lives)
        self._context = pointed
        self._state = state
        self._population = population
        self._columns = [(name, column[games][:, agents]) for name, column in state.numbers.items()]
        self._placed = self._find_placed_agents(games)
        self._are_placed = np.any(self._placed, axis=1)
        self._flies = len(population.rows_in_air) > 0
        self._remembers = state.movement.depends_on_speeds
        self._are_closed = state.roads.are_closed
        is_other = self._flies or self._remembers or self._are_closed or not pointed.reads_rows
        has_more = np.full(len(numbers), is_other or len(self._columns) > 0) | self._are_placed
        headings = [*map(state.headings.__getitem__, numbers)]
        if any(headings):
            has_more |= [*map(bool, headings)]
        self.have_more = has_more.tobytes()

    def _find_placed_agents(self, games: IntArray) -> BoolArray:
        """Return a mask of agents that rules have placed, (games, agents), without agents that flew there."""
        placed: BoolArray = self._state.placed[games]
        placed[:, self._state.flyers] &= ~self._state.has_flown[games]
        return placed

    def show_more(self, at: int, *, is_other: bool) -> None:
        """Show the columns of a game that in most games are as at the start."""
        pointed = self._context
        state = self._state
        block = self._population.block
        number = self.numbers[at]
        if pointed.population is not self._population:
            pointed.show(self._population)
        if is_other:
            pointed.show_lives(bytes(self._alive[at]))
        pointed.show_row(number)
        if self._flies or state.headings[number] != pointed.headings:
            pointed.show_poses(number)
        for name, column in self._columns:
            show_column(block, name, column[at])
        if block.placed or self._are_placed[at]:
            block.placed = set(np.flatnonzero(self._placed[at][self._population.numbers]).tolist())
        if self._remembers:
            row_of = {agent: row for row, agent in enumerate(self._population.numbers.tolist())}
            on_edges = state.movement.find_edge_positions(number, state.node[number])
            show_progress(block, {row_of[agent]: one for agent, one in on_edges.items() if agent in row_of})
        if self._are_closed or pointed.roads is not None:
            pointed.show_roads(state.roads.get_map(number))
        pointed.shows_more = pointed.roads is not None or bool(block.placed) or bool(state.headings[number])


def _get_node_numbers(state: GameArrays, population: Population, games: IntArray) -> tuple[memoryview, memoryview]:
    """Return the numbers of the current and of the previous nodes of agents in some games, (games * agents,)."""
    agents = population.numbers
    both = np.array([column[games].take(agents, axis=1) for column in (state.node, state.previous)], np.int64)
    ids = np.ascontiguousarray(state.streets.get_ids(both), np.int64)
    population.block.numbers.write(ids.reshape(-1).data, both.reshape(-1).data)
    node, previous = (column.reshape(-1).data for column in both)
    return node, previous


class PointedContext:
    """A context that is pointed at each game of a batch in turn: it then has the agents, turn and seed of that game.

    Args:
        game: the game at its start, in a context in which nothing else is played.
        state: the state of all games.
        own: the differences between the games from their start.

    Attributes:
        rows: what only Python holds of each game; None: as at the start.
        number: the number of the game that the context is pointed at; -1: none.
        read: fields of its state that were made when they were read; see `PointedState`.
        population: the agents of the context.
        headings: the headings that differ from the start, by the numbers of agents; None: unknown.
        alive: whether each agent of the context lives, by row, as bytes; empty: unknown.
        reads_rows: whether the state of the context reads fields from rows; see `PointedState`.
        shown_in: the state and the attributes of the context.
        shows_more: whether the context may show more of a game that is not as at the start than its turn, seed, nodes
            and living agents; the next game that is shown changes this, too.
        turns: the turn engine of the context.
        map: the storage of the map of the context.
        roads: the open roads that are shown; None: those of the start.
        map_changes: the changes of the map that is shown; see `IMapStorage.count_changes`.
    """

    population: Population
    headings: Mapping[int, Heading] | None
    map_changes: tuple[int, int, int, bool]

    def __init__(self, game: PlayedGame, state: GameArrays, own: FunctionsPerGame) -> None:
        self._game = game
        self._state = state
        self._before: Snapshot | None = None
        self._own = own
        values = game.internals.state
        self.at_start = RowValues(values, {})
        self._first_doing = copy_doing(values.data)
        self._start = values.start
        self.rows: list[RowValues | None] = [None] * len(state)
        self._known: WeakValueDictionary[tuple[Any, ...], Population] = WeakValueDictionary()
        self.shown_in = values, vars(game.ctx)
        self.shows_more = True
        self.turns = game.internals.parts.turns
        self.map = game.ctx.graph.storage
        self.alive = b""
        self.number = -1
        self.read: dict[str, Any] = {}
        self.reads_rows = False
        self._have_others = False  # whether agents of a game may differ from those of the start

    def get_row(self, number: int) -> RowValues:
        """Return the Python values of a game; make them if there are none."""
        row = self.rows[number]
        if row is None:
            row = RowValues(self.at_start, self.at_start.undone)
            self.rows[number] = row
        return row

    def forget(self, games: IntArray) -> None:
        """Reset some games to their start."""
        for number in games.tolist():
            self.rows[number] = None
        for number in games.tolist() if self._start is not None or self._own.is_needed else ():
            rng = self._make_first_rng(number)
            if rng is not None:
                self.get_row(number).rng = rng
        for number in games.tolist() if self._own.first else ():
            first = self._own.first[number]
            if first is not None:
                self.get_row(number).begin(first)

    def _make_first_rng(self, number: int) -> Generator | None:
        """Return `ctx.rng` of a new game; None: it is created on first use."""
        state = self._own.rngs[number]
        if state is None and self._start is not None:
            state = self._start.get_rng_state(self._state.seeds[number])
        if state is None:
            return None
        rng: Generator = self._game.ctx.stream("context")
        rng.bit_generator.state = state
        return rng

    def checkpoint(self) -> Callable[[], None]:
        """Return a function that undoes later changes; what functions have written themselves stays."""
        kept = [None if row is None else row.copy_turn_values() for row in self.rows]
        first = self._first_doing
        doings = [first if row is None or row.data is None else copy_doing(row.data) for row in self.rows]

        def take_back() -> None:
            for row, values, doing in zip(self.rows, kept, doings, strict=True):
                if row is not None:
                    row.take_back(values or RowValues(self.at_start, self.at_start.undone).copy_turn_values())
                    if row.data is not None:
                        put_doing(row.data, doing)

        return take_back

    def run_until(self) -> int | None:
        """Return the turn at which the last run stops the game that is shown; None: it had no limit."""
        return None if self.number < 0 else self._state.run_until(self.number)

    def get_population(self, number: int) -> Population | None:
        """Return the agents of a game; None: those of the start."""
        row = self.rows[number]
        return None if row is None else row.population

    def hold(self) -> None:
        """Remember the context as it is, for `release`."""
        self._before = self._game.snapshot()
        values = self._game.internals.state
        self._first_looks = values.delayed_looks
        self._first = Population(self._game, self._state)
        self._note_shown(self._first)
        self._first_map = self.map.snapshot()
        self._note_map(None)

    @property
    def at_rest(self) -> Snapshot:
        """The game of the context as it was before it was pointed at games."""
        assert self._before is not None  # noqa: S101 - it is held
        return self._before

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
    def show_population(self, population: Population) -> Iterator[None]:
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
        self.shows_more = True

    @property
    def first(self) -> Population:
        """The agents of the start."""
        return self._first

    def detach_agents(self) -> None:
        """Give the context its own set of agents, if strategies or sensors were changed."""
        sensors = self._game.ctx.sensor.storage.share()
        known = self.population.sensors
        are_same = sensors is known or (sensors.sensors, sensors.keywords) == (known.sensors, known.keywords)
        each = zip(self.population.agents.members, self.population.agents.equipment, strict=True)
        if not are_same or any((agent.strategy, agent.sensors) != own for agent, own in each):
            self._game.ctx.agent.storage.detach_agents()

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
        moved = self.get_row(number).moved
        if moved is not None and moved[1] is known:  # its agents are those that have moved, and not these
            known = self._known[found.key] = found
        if known is not found:
            self.show(known)
        self._note_shown(known)
        self.get_row(number).population = known
        self._have_others = True
        return found

    @contextmanager
    def keep_position(self) -> Iterator[None]:
        """Point the context at games in the block, and restore it afterwards unless it was held before."""
        if self._before is not None:
            yield
            return
        self.hold()
        try:
            yield
        finally:
            self.release()

    def order_by_population(self, games: IntArray) -> IntArray:
        """Return the indices of some games, ordered so that games with the same agents follow each other."""
        if not self._have_others:
            return np.arange(len(games))
        populations = [*map(self.get_population, games.tolist())]
        numbers = {one: number for number, one in enumerate(dict.fromkeys(populations))}
        return np.argsort([*map(numbers.__getitem__, populations)], kind="stable")

    def visit_each(self, games: IntArray) -> Iterator[int]:
        """Point the context at each of some games in turn, and yield the number of the game."""
        while len(games):
            some = self.get_first(games)
            for at, number in enumerate(some.numbers):
                some.show(at)
                yield number
            games = games[len(some.numbers) :]

    def get_first(self, games: IntArray) -> GamesToShow:
        """Return the first of some games, which have the same agents, to show each of them."""
        population = self.get_population(int(games[0]))
        some = games
        if self._have_others:
            alike = [*takewhile(lambda number: self.get_population(number) is population, games.tolist())]
            some = games[: len(alike)]
        found = population or self._first
        self._drop_changes(found)
        self.shows_more = True
        return GamesToShow(self, self._state, found, some)

    def _drop_changes(self, population: Population) -> None:
        """Undo what a function that has raised has changed of the map and the agents of the context."""
        if self.map_changes != self.map.count_changes():
            self.show_roads(None)
        if self.has_other_agents():
            self.show(population)

    def show_row(self, number: int) -> None:
        """Set the fields that the context reads from the row of a game, where it does not look there itself."""
        if not self.reads_rows:
            row = self.get_row(number)
            self._game.internals.state.delayed_looks = row.delayed_looks
            self._game.internals.state.departed = row.departed

    def show_poses(self, number: int) -> None:
        """Show the positions and rotations of flying agents in a game."""
        flights = self._state.flights
        headings = self._state.headings[number]
        shown = self.population
        if flights is not None:
            show_flights(shown.block, shown.rows_in_air, flights, shown.flying, number)
        self.headings = headings
        each = zip(shown.numbers.tolist(), shown.first_headings, strict=True)
        show_column(shown.block, "heading", [headings.get(agent, first) for agent, first in each])

    def show_lives(self, alive: bytes) -> None:
        """Set which agents of the context are alive, by row."""
        show_lives(self.population.block, alive)
        self.alive = alive

    def show_roads(self, roads: RoadMap | None) -> None:
        """Open and close roads as in a game; None: as at the start."""
        if roads is not self.roads or self.map_changes != self.map.count_changes():
            self.map.restore(self._first_map if roads is None else roads.snapshot)
            self._note_map(roads)

    @property
    def map_before(self) -> Any:
        """The map of the game without what a function has changed last."""
        roads = self.roads
        return self._first_map if roads is None else roads.snapshot

    def _note_map(self, roads: RoadMap | None) -> None:
        self.roads = roads
        self.map_changes = self.map.count_changes()
        self.shows_more = True

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
        with self.keep_position():
            for number in self.visit_each(games):
                change(edges)
                self.take_roads(number)

    def take_roads(self, number: int) -> bool:
        """Store the map of the context for a game; return False, and do nothing, if more than roads was changed."""
        state = self._state
        revision, road_changes, *others = self.map.count_changes()
        known_revision, known_road_changes, *known_others = self.map_changes
        if revision - known_revision != road_changes - known_road_changes or others != known_others:
            return False
        try:
            roads = state.roads.map_with(*self.map.list_roads())
        except BadValue:
            return False
        if roads is not None and roads.snapshot is None:
            roads.snapshot = self.map.snapshot()
        state.put_roads(np.array([number]), roads)
        self._note_map(roads)
        return True
