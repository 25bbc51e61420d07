"""Calls plain rules and strategies in a context that is pointed at each game of a batch in turn."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, lru_cache, partial
from typing import Any, NamedTuple, NoReturn
from weakref import WeakKeyDictionary

import numpy as np
from numpy.random import Generator

from gamms.core.ask import hold
from gamms.core.copies import copied, copied_values
from gamms.deciding import phase_of
from gamms.errors import UnknownAttribute
from gamms.game.array_functions.view import ArrayView
from gamms.game.block.channels import MessageTraffic
from gamms.game.block.columns import (
    Failure,
    NewAgents,
    PlayedGame,
    decider_of,
    sensors_of,
)
from gamms.game.block.in_core import CoreGames, called_rules
from gamms.game.block.scores import fits_float
from gamms.game.block.state import STOPPED, GameArrays, LeavesSharedContext
from gamms.game.cursor.called_functions import (
    functions_of_rules,
    keys_in_core,
)
from gamms.game.cursor.own_functions import FunctionPerGame, some_function
from gamms.game.cursor.pointed import GuardedDict, PointedContext, PointedState, Population, RowValues, StartOfGame
from gamms.game.decisions import Decisions
from gamms.game.messages import Inboxes
from gamms.game.movement.courses import Routes
from gamms.game.movement.flights import Flights
from gamms.game.movement.moves import TurnMoves
from gamms.game.order import TurnOrder, TurnPart
from gamms.game.random_streams import DrawTable
from gamms.game.result import Collectors
from gamms.game.settings import NamedRule
from gamms.game.slots import COUNTED
from gamms.game.strategy_specs import strategy_spec_of
from gamms.game.turn import CLOSED, closed_edge
from gamms.ir.agents import AgentBlock, as_ids
from gamms.ir.events import (
    AERIAL_AGENT_FLIGHT,
    AERIAL_AGENT_TURN,
    AGENT_ATTRIBUTE,
    AGENT_CREATE,
    AGENT_DELETE,
    AGENT_SENSOR_DEREGISTER,
    AGENT_SENSOR_REGISTER,
)
from gamms.ir.game_state import BlockedAgents, GameState, Scores, in_conflict
from gamms.ir.graph import IntArray
from gamms.ir.journal import Journal
from gamms.ir.obstacles import BoolArray
from gamms.ir.schema import CHANGE_EVENTS, NUMBERS
from gamms.plain import is_plain, is_same
from gamms.typing.agent_engine import IAgent

_NUMBERS = [column.name for column in NUMBERS]
_CHANGING = {CHANGE_EVENTS[name].code for name in ("node", "previous", "alive", *_NUMBERS)}
_EQUIPPING = {AGENT_CREATE, AGENT_DELETE, AGENT_SENSOR_REGISTER, AGENT_SENSOR_DEREGISTER}
_TURNED = CHANGE_EVENTS["heading"].code
_CHANGING |= {AERIAL_AGENT_FLIGHT, AERIAL_AGENT_TURN, AGENT_ATTRIBUTE, _TURNED}


def _itself(function: object) -> object:
    """Return the function of a collector for another game of the batch."""
    return function


class _AskedAgents(NamedTuple):
    """Agents that are asked, some of which may be dead.

    Attributes:
        part: the living ones, as a part of a turn.
        places: the slot of each agent; -1: it is dead.
        members: the slots and names of the living ones.
        templates: the names of the living ones, and their states.
    """

    part: TurnPart
    places: list[int]
    members: list[tuple[int, str]]
    templates: list[tuple[str, dict[str, Any]]]


class _StartValues(NamedTuple):
    """The values with which games begin; see `GameState`."""

    turn: int
    moves: TurnMoves | None
    counts: dict[str, dict[str, int]]

    @classmethod
    def of(cls, state: GameState) -> "_StartValues":
        """Return the values with which the game of a context begins."""
        return cls(state.turn, state.moves, {name: each.copy() for name, each in state.counts.items()})


class _StreamPositions(NamedTuple):
    """The positions of agents' random streams and sensors in a turn, for agents that are asked again.

    Attributes:
        streams: the marks by names of agents; see `AgentSlot.marks`.
        looks: the marks of the sensors that count their looks; see `DetectionModel.mark`.
    """

    streams: dict[str, tuple[Any, Any]]
    looks: list[Any]


class _OrderInGames(NamedTuple):
    """The turn order of the agents of some games.

    Attributes:
        order: the order.
        table: the keys of their draws.
        asked_of: returns the asked agents, by the numbers of agents that are asked and of others that observe, and by
            which agents live.
    """

    order: TurnOrder
    table: DrawTable
    asked_of: Callable[[bytes, bytes, bytes], _AskedAgents]


@dataclass
class _PopulationCaches:
    """Values derived from a set of agents of the context.

    Attributes:
        lasts: the last states of agents, and the last data of sensors, each a list of one item.
        notices: the detection models of sensors that count their looks.
        sees_world_only: whether all sensors that are called look only at the graph and the agents.
        are_plain: whether this holds, and repeated calls in a turn return the same data.
        order_of: returns the order of the agents, by whether all know the same facts.
    """

    lasts: list[list[Any]]
    notices: list[Any]
    sees_world_only: bool
    are_plain: bool
    order_of: Callable[[bool], _OrderInGames]


class Cursor:
    """Calls plain functions in a context that is pointed at each game of a batch in turn.

    The context has one set of agents. They show the game that the context is pointed at. If a plain function reads what
    a context cannot show of the core, or changes what the core cannot change, its game leaves: it plays the same turn
    in a context of its own, and all turns that follow.

    Args:
        game: the game at its start, whose context is pointed at other games.
        pointed: points the context at games.
        state: the state of all games.
        core: plays the games in the core.
        asked: the numbers in the roster of agents whose strategies and plans are called.
        observing: the numbers of agents whose sensors are called in each turn.
        has_array_functions: whether array functions are called, too.

    Attributes:
        functions: the plain functions that are called.
    """

    _has_begun = False
    _ordered: _OrderInGames
    _cached: _PopulationCaches
    _attributes_shown: list[dict[str, Any]]
    _marks: dict[int, _StreamPositions]  # of games, while agents arrive
    _part: int | None = None  # of the turn in which agents are about to move
    _have_joined = False  # whether agents created in this part of the turn take part in it

    def __init__(
        self,
        game: PlayedGame,
        pointed: PointedContext,
        state: GameArrays,
        core: CoreGames,
        asked: Sequence[int],
        observing: Sequence[int],
        *,
        has_array_functions: bool,
    ) -> None:
        parts = game.internals.parts
        self._game = game
        self._observing_names = {state.roster.names[number] for number in (*asked, *observing)}
        self._pointed = pointed
        self._state = state
        state.tell = self.note_undone
        self._core = core
        self._has_array_functions = has_array_functions
        self._ctx = game.ctx
        self._parts = parts
        self._turns = parts.turns
        self._values = parts.state
        self._phase = phase_of(game.ctx)
        self._why = ""  # why the game leaves that the context is pointed at
        self._core_keys = frozenset(keys_in_core(game, state.roster))
        specs = [one.spec for one in called_rules(game, state.roster) if one.spec.core_form is not None]
        self._facts_in_core = [(str(spec.key), spec.facts_of) for spec in specs if spec.facts_of is not None]
        deciders = [decider_of(state.roster.agents[number], game.settings()["plans"]) for number in asked]
        collectors = parts.collectors.by_name.values()
        self._periods = {one.every for one in collectors}
        of_rules = [function for one in game.rules for function in (one.rule, one.spec.check)]
        of_sensors = [
            getattr(one, "function", None) for agent in state.roster.agents for one in sensors_of(agent).values()
        ]
        functions = *deciders, *of_rules, *of_sensors
        self._own_functions = [one for one in functions if isinstance(one, FunctionPerGame)]
        self.functions = [
            *map(some_function, functions_of_rules(game, state.roster)),
            *map(some_function, deciders),
            *(one.fn for one in collectors),
        ]
        self._asked_agents = frozenset(asked)
        self._deeds: list[tuple[int, int, int, str, Mapping[str, Any]]] = []  # see `DeclaredDeeds.from_plain`
        self._first = _StartValues.of(parts.state)
        asked_names = {state.roster.names[number] for number in asked}
        pointed.at_start.undone = {name: why for name, why in parts.state.blocked.items() if name in asked_names}
        self._new_agents: list[IAgent] = []  # that have no rows
        self._row: RowValues | None = None  # of the game that is shown
        self._has_ended = False  # whether a function has ended the game

    @property
    def number(self) -> int:
        """The number of the game that the context is pointed at; -1: none."""
        return self._pointed.number

    @property
    def is_asking(self) -> bool:
        """Whether a strategy or a plan is running."""
        return self._phase.is_deciding

    # -- the context --------------------------------------------------------------------------------------------

    def _begin(self) -> None:
        """Prepare the context to be pointed at games, unless it is already."""
        if self._has_begun:
            return
        values = self._values
        self._pointed.hold()
        self._has_begun = True
        self._kept_start = values.start
        self._number_of = {name: i for i, name in enumerate(self._state.roster.names)}
        self._looks = self._no("what agents have sensed")
        self._known_caches: WeakKeyDictionary[Population, _PopulationCaches] = WeakKeyDictionary()
        self._take_shown()
        self._turns.note_departed()
        self._take_first_values()
        self._phase.before_reading = self._own_attributes
        self._own_of_ctx = vars(self._ctx)
        self._has_drawn = self._own_of_ctx["_rng"] is not None  # when the games were made, differently for each seed
        values.__class__ = PointedState
        values.start = StartOfGame(self._read_field, self._own_row, self._end, self._replace_data, self._leave)
        self._pointed.reads_rows = True
        values.has_begun = True
        values.last_turn = self._game.settings()["max_turns"]
        values.blocked = BlockedAgents()
        self._facts_own: dict[str, Any] | None = None  # of the game, if they are not the first ones
        self._show_facts(None)
        self._alive: bytes | None = None  # the agents whose order is taken; None: unknown
        self._is_public = True  # whether that is the order of agents that know the same facts
        self._read = self._pointed.read
        self._pointed.number = -1
        self._row = None
        self._fixed = self._what_is_fixed()
        self._note_epoch()

    def _take_first_values(self) -> None:
        """Take the data, facts and attributes of agents with which games begin."""
        values = self._values
        self._first_data = {key: one for key, one in values.data.items() if key not in self._core_keys}
        self._facts = values.facts
        self._first_facts = dict(self._facts)
        self._first_attributes = [copied_values(vars(one)) for one in self._agents]
        self._are_shared = is_plain(self._first_attributes)  # those of games that have not read any that may change
        self._shared_attributes: list[dict[str, Any]] = [one.__dict__ for one in self._agents]
        self._attributes = self._shared_attributes  # of the game; shown unless `_attributes_shown` differs
        self._attributes_shown = self._shared_attributes

    def release(self) -> None:
        """Restore the context as it was before it was pointed at games."""
        if not self._has_begun:
            return
        self._has_begun = False
        values = self._values
        turns = self._turns
        values.__class__ = GameState
        values.start = self._kept_start
        self._pointed.reads_rows = False
        values.has_begun = False
        values.began = {}
        values.last_turn = None
        self._phase.drop_plans()
        values.stream_version += 1  # slots have memories and draws of games of the batch
        turns.is_playing = False
        turns.is_moving = False
        self._phase.before_reading = None
        self._pointed.show_first()
        self._take_shown()
        for agent, own in zip(self._agents, self._first_attributes, strict=True):
            agent.__dict__ = own
        for last in self._cached.lasts:
            last[0] = {}
        self._pointed.release()

    def _no(self, what: str) -> GuardedDict:
        return GuardedDict({}, None, self._leave, what)

    def _leave(self, what: str) -> NoReturn:
        """Move the current game to a context of its own; the argument says why, in words."""
        self._why = self._why or f"a plain function {what}"
        raise LeavesSharedContext(self._why)

    def _let_leave(self) -> None:
        """Stop playing the current game here, and restore the context."""
        self._state.leave(np.array([self._pointed.number]), self._why)
        self._why = ""
        turns = self._turns
        is_moving = turns.is_moving
        self.release()
        self._begin()
        turns.is_playing = True
        turns.is_moving = is_moving

    def _what_is_fixed(self) -> tuple[int, object, int]:
        """Return the numbers and objects that only the turn engine may change."""
        parts = self._parts
        return self._phase.setting_changes, parts.rules.now, len(parts.collectors.by_name)

    def _note_epoch(self) -> None:
        """Note the agents and settings of the context: only functions that run from now on have changed them."""
        phase = self._phase
        self._epoch = phase.epoch
        self._changes = phase.strategy_changes, phase.sensor_changes

    def _take_shown(self) -> None:
        """Read the agents that the context has from now on."""
        population = self._pointed.population
        self._population = population
        self._block = population.block
        self._agents = population.agents.members
        self._journal = population.journal
        self._cached = self._caches_of(population)
        self._alive = None
        self._attributes_shown = []  # unknown
        self._forget_looks()

    def _caches_of(self, population: Population) -> _PopulationCaches:
        """Return the values derived from the agents of the context, which are these."""
        if population not in self._known_caches:
            self._known_caches[population] = self._new_caches(population.agents.members)
        return self._known_caches[population]

    def _new_caches(self, agents: Sequence[Any]) -> _PopulationCaches:
        access = self._ctx.agent.storage.turn_access
        each = [access(one) for one in agents]
        of_sensors = [last for one in each for _, last, *_ in one.carried]
        lasts = [one.last for one in each] + [last for last in of_sensors if type(last) is list]
        sensors = [sensor for agent in agents for sensor in agent.sensors.values()]
        observing = (agent for agent in agents if agent.name in self._observing_names)
        carried = [sensor for agent in observing for sensor in agent.sensors.values()]
        looks = [(one, one.in_arrays()) for one in sensors if hasattr(one, "in_arrays")]
        counting = {id(one): one.notice for one, look in looks if look is not None and not look.is_plain}
        notices = [counting[id(one)] for one in carried if id(one) in counting]
        sees_world_only = all(getattr(one, "sees_world_only", False) for one in carried)
        are_plain = not counting and all(getattr(one, "sees_world_only", False) for one in sensors)
        return _PopulationCaches(lasts, notices, sees_world_only, are_plain, cache(self._new_order))

    def _have_left(self, games: IntArray) -> bool:
        """Move games to contexts of their own if a function has changed attributes of agents that they share."""
        if not self._are_shared or is_same(self._shared_attributes, self._first_attributes):
            return False
        self._state.leave(games, "a plain function changes the __dict__ of agents")
        self.release()
        return True

    def _forget_looks(self) -> None:
        for last in self._cached.lasts:
            last[0] = self._looks

    # -- pointing -----------------------------------------------------------------------------------------------

    def _each(self, games: IntArray) -> Iterator[int]:
        """Point the context at each of some games that have not left, and yield the index of the game."""
        state = self._state
        places = np.arange(len(games))
        if state.leaving:
            places = np.flatnonzero(~np.isin(games, [*state.leaving]))
        facts = [(name, facts_of(state, games)) for name, facts_of in self._facts_in_core]
        stop = state.stop.data
        while len(places):
            some = self._pointed.first_of(games[places])
            at = 0
            for at, place in enumerate(places[: len(some.numbers)].tolist()):
                if stop[0]:
                    state.notice_interrupt()
                some.show(at)
                self._show_values(self._pointed.number)
                for name, of_games in facts:
                    self._facts[name] = of_games[place]
                    self._facts_shown[name] = of_games[place]
                yield place
                if self._why:
                    self._let_leave()
                    break
            places = places[at + 1 :]

    def _show_values(self, number: int) -> None:
        """Show the values in Python of the game that the context is pointed at."""
        pointed = self._pointed
        row = pointed.rows[number]
        if pointed.population is not self._population:
            self._take_shown()
        for own in self._own_functions:
            own.number = number
        if row is not None or self._row is not None or not self._are_shared:
            self._show_row(number, row)
        if self._alive is None:
            self._take_order()
        elif pointed.alive != self._alive:
            self._alive = pointed.alive
            self._ordered.order.take_lives()
        if self._state.radio is not None:
            self._show_inboxes()
        if self._attributes_shown is not self._attributes:
            self._show_attributes(self._attributes)
        if self._phase.epoch != self._epoch:
            self._note_epoch()

    def _show_row(self, number: int, row: RowValues | None) -> None:
        """Show what Python holds of a game; None: as at the start."""
        if row is None and not self._are_shared:
            row = self._pointed.row_of(number)
        self._row = row
        self._own_of_ctx["_rng"] = None if row is None else row.rng
        is_public = row is None or not (row.agent_facts or row.team_facts)
        if is_public != self._is_public:
            self._is_public = is_public
            self._alive = None
        facts = None if row is None else row.facts
        if facts is not self._facts_own:
            self._show_facts(facts)
        if row is None or row.attributes is None:
            self._attributes = self._begin_attributes(row)
        else:
            self._attributes = row.attributes

    def _show_inboxes(self) -> None:
        """Show the inboxes of the agents of a game."""
        row = self._own_row()
        if row.inboxes is None:
            row.inboxes = Inboxes(self._ctx, self._values)
        self._turns.inboxes = row.inboxes

    @property
    def _undone(self) -> Mapping[str, str]:
        """Agent -> why it did not do what it wanted in the last turn of the game, but for conflicts."""
        row = self._pointed.rows[self._pointed.number]
        return self._pointed.at_start.undone if row is None else row.undone

    def _own_row(self) -> RowValues:
        """Return what Python holds of the game that the context is pointed at; it is made if there is none."""
        row = self._pointed.row_of(self._pointed.number)
        self._row = row
        return row

    def _show_facts(self, own: dict[str, Any] | None) -> None:
        """Show the facts of a game; None: the facts published before the batch."""
        self._facts_own = own
        self._facts_shown = self._first_facts if own is None else own
        self._facts.clear()
        self._facts.update(self._facts_shown)

    def _begin_attributes(self, row: RowValues | None) -> list[dict[str, Any]]:
        """Return the attributes with which the agents of a game begin."""
        if self._are_shared or row is None:
            return self._shared_attributes
        row.attributes = [copied_values(own) for own in self._first_attributes]
        return row.attributes

    def _show_attributes(self, attributes: list[dict[str, Any]]) -> None:
        """Set the custom attributes of the agents."""
        for agent, own in zip(self._agents, attributes, strict=True):
            agent.__dict__ = own
        self._attributes_shown = attributes

    def _own_attributes(self) -> None:
        """Give the game its own attributes before one is read that may change in place."""
        row = self._own_row()
        if row.attributes is None:
            row.attributes = copied(self._attributes_shown)
            self._attributes = row.attributes
            self._show_attributes(row.attributes)

    def _take_attributes(self) -> None:
        """Store the attributes that a function has set in a game."""
        row = self._own_row()
        if row.attributes is None:
            row.attributes = self._attributes_shown
            self._attributes = row.attributes
            self._shared_attributes = copied(self._first_attributes)

    def _take_order(self) -> None:
        """Use the turn order of the agents of the game, and let the living ones take part."""
        self._alive = self._pointed.alive
        self._ordered = self._cached.order_of(self._is_public)
        self._turns.take_order(self._ordered.order)
        self._ordered.order.take_lives()

    def _new_order(self, is_public: bool) -> _OrderInGames:  # noqa: ARG002 - on which the order depends
        """Return the order of the agents of the context; they may know the same facts or not."""
        order = self._turns.make_order()
        return _OrderInGames(order, order.slots.table, lru_cache(1024)(partial(self._new_asked, order)))

    def _order_of(self, population: Population) -> TurnOrder:
        """Return the order of other agents than the present ones, some of which may have been deleted."""
        if population is self._population:
            return self._ordered.order
        with self._phase.suspended():  # a strategy may ask how agents have moved
            with self._pointed.showing(population):
                found = self._caches_of(population).order_of(self._is_public)
            if not self._pointed.has_other_agents():
                self._take_order()
        return found.order

    # -- fields that are made when they are read ------------------------------------------------------------------

    def _read_field(self, name: str) -> Any:
        """Return a field of the game that the context is pointed at."""
        read = self._read
        if name not in read:
            read[name] = getattr(self, f"_make_{name}")()
        return read[name]

    def _make_data(self) -> dict[Any, Any]:
        row = self._own_row()
        if row.data is None:
            row.data = self._copy_of_data(self._first_data)
        elif self._core_keys and type(row.data) is not GuardedDict:  # of a game that begins with other data
            row.data = self._copy_of_data({key: one for key, one in row.data.items() if key not in self._core_keys})
        return row.data

    def _make_over(self) -> dict[str, Any] | None:
        return self._state.over[self._pointed.number]

    def _end(self, over: dict[str, Any] | None) -> None:
        """End the game that the context is pointed at."""
        number = self._pointed.number
        self._state.over[number] = over
        self._state.is_going[number] = over is None
        self._read["over"] = over
        self._has_ended = True

    def _copy_of_data(self, data: dict[Any, Any]) -> dict[Any, Any]:
        values: dict[Any, Any] = {key: copied(one) for key, one in dict.items(data)}
        if not self._core_keys:
            return values
        keys = ", ".join(sorted(self._core_keys))
        return GuardedDict(values, self._core_keys, self._leave, f"ctx.game.data, with that of {keys}")

    def _replace_data(self, data: dict[Any, Any]) -> None:
        if self._core_keys:
            self._leave("replaces ctx.game.data")
        self._own_row().data = data
        self._read["data"] = data

    def _make_began(self) -> dict[str, Any]:
        state = self._state
        begun = np.flatnonzero(state.start[self._pointed.number] >= 0)
        nodes = state.streets.ids(state.start[self._pointed.number, begun]).tolist()
        starts: dict[str, Any] = dict(zip((state.roster.names[i] for i in begun), nodes, strict=True))
        if state.flights is not None:
            places = map(tuple, state.flights.start[self._pointed.number].tolist())
            flying = zip((state.roster.names[i] for i in state.flights.agents), places, strict=True)
            starts |= {name: place for name, place in flying if name in starts}
        return starts

    def _make_scores(self) -> Scores:
        self._scores_before = self._state.scores.of(self._pointed.number)
        scores = Scores()
        dict.update(scores, self._scores_before)
        return scores

    def _make_events(self) -> list[dict[str, Any]]:
        found = self._state.events.of(self._pointed.number)
        self._num_events = len(found)
        return found

    def _make_messages(self) -> list[dict[str, Any]]:
        radio = self._state.radio
        found = [] if radio is None else radio.of(self._pointed.number)
        self._num_messages = len(found)
        return found

    def _make_deeds(self) -> list[dict[str, Any]]:
        log = self._state.deed_log
        return [] if log is None else log.of(self._pointed.number)

    def _make_errors(self) -> list[dict[str, Any]]:
        return self._state.errors[self._pointed.number]

    def _make_counts(self) -> dict[str, dict[str, int]]:
        state = self._state
        columns = {kind: state.counts[kind][self._pointed.number].tolist() for kind in COUNTED}
        names = enumerate(state.roster.names)
        return self._first.counts | {name: {kind: column[i] for kind, column in columns.items()} for i, name in names}

    def _make_memories(self) -> NoReturn:
        self._leave("reads ctx.game.memories")

    def _make_moves(self) -> TurnMoves | None:
        """Return the moves of the last turn of the game, or the moves about to be made; None: there are none."""
        part = self._part
        number = self._pointed.number
        games = np.array([number])
        if part is not None:
            return self._moves_between(*(column[0] for column in self._core.next_moves(games, part)))
        if self._state.turn[number] == self._first.turn and not self._core.num_played_parts(number):
            return self._first.moves
        starts, ends, took_part = (column[0] for column in self._core.last_moves(games))
        if not took_part.any():
            return None
        moves = self._moves_between(starts, ends, took_part)
        parts = self._parts.settings.order
        return moves if parts is None or self._core.courses is not None else moves.in_parts(parts)

    @property
    def _moment(self) -> tuple[int, int | None, bool]:
        """The number of turns played, the part in which agents are about to move, and whether newcomers take part."""
        return int(self._state.turn[self._pointed.number]), self._part, self._have_joined

    def _moves_between(self, starts: IntArray, ends: IntArray, took_part: BoolArray) -> TurnMoves:
        """Return the moves of the agents that took part."""
        population = self._population
        moved = None if self._row is None else self._row.moved
        if moved is not None and moved[0] == self._moment:
            population = moved[1]
        order = self._order_of(population)
        ids = self._state.streets.ids
        courses = self._core.courses
        numbers = np.sort(population.numbers)
        took_part = took_part[numbers]
        starts = starts[numbers]
        ends = np.where(took_part, ends[numbers], starts)
        acting = np.where(took_part, numbers, -1)
        if self._part is not None:  # the others stay where they are
            acting[self._core.part_of[numbers] != self._part] = -1
        actions = {}
        paths = None
        if courses is not None:
            standing = np.where((acting < 0) & took_part, numbers, -1)
            paths = courses.game_paths(self._pointed.number, acting, standing, starts)
        first = ids(starts).tolist()
        if self._state.flights is not None:
            actions = self._state.flights.actions(self._pointed.number, acting, first)
        lives = took_part.tobytes()
        moves = TurnMoves(order, as_ids(first), ids(ends).data, actions, paths=paths, took_part=lives)
        if self._state.deed_log is not None:
            for number, deeds in self._state.deed_log.plain_of(self._pointed.number).items():
                if number in numbers[took_part] and self._part in (None, self._core.part_of[number]):
                    moves.do(int(np.searchsorted(numbers, number)), deeds)
        return moves

    # -- before agents move ---------------------------------------------------------------------------------------

    def check(self, games: IntArray, part: int) -> None:
        """Call the rules that may refuse moves and deeds of a part of the turn, in each of these games."""
        self._call_each(self._check, games, part=part)

    def _check(self) -> None:
        number = self._pointed.number
        moves = self._read_field("moves")
        log = self._state.deed_log
        part_of = self._core.part_of
        numbers = self._number_of
        members = [i for i, name in enumerate(moves.order.names) if part_of[numbers[name]] == self._part]
        for i, kind, why in self._turns.refused(moves, members, self._parts.rules):
            agent = numbers[moves.slots[i].name]
            self._note_undone(number, agent, why)
            if kind is None:
                self._hold(agent)
            elif log is not None:
                self._state.note_failure(Failure.illegal(number, agent, why))
                log.refuse(number, agent, kind)
        self._refuse_other_agents("the check of a rule")

    def cut_off(self, games: IntArray, part: int) -> None:
        """Keep agents in place whose path was closed in these games."""
        with self._after_joining():
            self._call_each(self._cut_off, games, part=part)

    @contextmanager
    def _after_joining(self) -> Iterator[None]:
        """Call functions after agents that were created in this part of the turn have joined it."""
        self._have_joined = True
        try:
            yield
        finally:
            self._have_joined = False

    def _cut_off(self) -> None:
        moves = self._read_field("moves")
        for i in self._turns.cut_off(moves):
            agent = self._number_of[moves.slots[i].name]
            self._hold(agent)
            self._note_undone(self._pointed.number, agent, CLOSED)

    def give_way(self, games: IntArray, part: int) -> None:
        """Keep agents in place that lose conflicts decided by a function, in these games."""
        with self._after_joining():
            self._call_each(self._give_way, games, part=part)

    def _give_way(self) -> None:
        moves = self._read_field("moves")
        for i, end in zip(*self._turns.stop_losers(moves), strict=True):
            agent = self._number_of[moves.slots[i].name]
            self._hold(agent)
            self._core.note_conflict(self._pointed.number, agent, end)
        self._refuse_other_agents("the function of conflicts")

    def begin_arrivals(self) -> None:
        """Begin a part of the turn in which agents are asked on arrival."""
        self._marks = {}

    def give_way_at_arrivals(self, games: IntArray) -> None:
        """Stop arrived agents that lose conflicts decided by a function, in these games."""
        self._call_each(self._give_way_at_arrivals, games)

    def _give_way_at_arrivals(self) -> None:
        order = self._ordered.order
        number = self._pointed.number
        agents = [self._number_of[name] for name in order.names]
        before, after = [[places[agent] for agent in agents] for places in self._core.places(number)]
        for i, _ in self._turns.losers_between(order, before, after):
            self._core.hold(number, agents[i])
        self._refuse_other_agents("the function of conflicts")

    def note_losers(self, games: IntArray) -> None:
        """Tell agents that conflicts have stopped them on arrival."""
        for at, agent in np.argwhere(self._core.losers(games)).tolist():
            game = int(games[at])
            self._note_undone(game, agent, in_conflict(self._core.wanted(game, agent)))

    def _hold(self, agent: int) -> None:
        """Cancel the move of an agent of the game that the context is pointed at, and count it."""
        self._state.counts["blocked"][self._pointed.number, agent] += 1
        self._cancel(agent)

    def _cancel(self, agent: int) -> None:
        """Cancel the move of an agent of the game that the context is pointed at."""
        self._core.hold(self._pointed.number, agent)
        if self._state.flights is not None:
            self._state.flights.hold(self._pointed.number, agent)

    def _refuse_other_agents(self, what: str) -> None:
        if any(type(one) is not tuple or one[0] != AGENT_ATTRIBUTE for one in self._journal.log):
            self._leave(f"that is {what} changes agents")

    # -- rules --------------------------------------------------------------------------------------------------

    def call(self, named: NamedRule, games: IntArray, part: int | None = None) -> None:
        """Call a rule in each of these games, before agents of a part of the turn move; None: before or after all."""
        what = f"the rule {named.name!r} (phase {named.phase!r})"
        self._call_each(partial(named.rule, self._ctx), games, what, part=part)

    def collect(self, games: IntArray) -> None:
        """Call the collectors in the games in which they are due."""
        turns = self._state.turn[games]
        is_due = np.zeros(len(games), np.bool_)
        for every in self._periods:
            is_due |= turns % every == 0
        if is_due.any():
            self._call_each(self._collect, games[is_due], "a collector")

    def _collect(self) -> None:
        row = self._own_row()
        if row.collectors is None:
            row.collectors = Collectors()
            row.collectors.copy_from(self._parts.collectors, _itself)
        row.collectors.collect(self._values.turn, self._ctx, lambda: self._game.agents)

    def collected(self, game: int) -> dict[str, dict[str, list[Any]]]:
        """Return the collected values of a game, by the names of collectors."""
        row = self._pointed.rows[game]
        return (self._parts.collectors if row is None or row.collectors is None else row.collectors).tables()

    def _call_each(
        self, function: Callable[[], object], games: IntArray, what: str = "", *, part: int | None = None
    ) -> None:
        """Call a function while the context is pointed at each of these games in turn.

        Args:
            function: the function to call.
            games: the numbers of the games.
            what: the function in words, for errors; "": its errors name it themselves.
            part: the part of the turn in which agents are about to move; None: they are not.
        """
        turns = self._turns
        self._begin()
        turns.is_playing = True
        self._part = part
        turns.is_moving = part is not None or self._core.arrival is not None
        try:
            for _ in self._each(games[self._pointed.by_population(games)]):
                self._call(function)
        except Exception as error:
            if not self._have_left(games):
                if what:
                    hint = UnknownAttribute.hint_of(error)
                    error.add_note(f"In {what}, in turn {self._values.turn}.{hint}")
                error.add_note(self._named())
                raise
        finally:
            turns.is_playing = False
            turns.is_moving = False
            self._part = None
        self._have_left(games)
        if self._new_agents:
            raise NewAgents(self._new_agents)
        self._state.now.clear()

    def _call(self, function: Callable[[], object]) -> None:
        """Call a function in the current game, and store its changes."""
        table = self._ordered.table
        begun = table.begun
        try:
            try:
                function()
            finally:
                if not self._why:
                    self._take()
            if table.begun != begun:
                self._leave("draws by the streams of agents")
            if not hold(self._cached.lasts, self._looks):
                self._forget_asking()
        except Exception:
            if not self._why:
                raise

    def _forget_asking(self) -> None:
        """Undo the sensor calls of a function."""
        if not self._cached.are_plain:
            self._leave("asks sensors that err, or of classes of their own")
        self._forget_looks()

    def _named(self) -> str:
        return f"In game {self._pointed.number} of a batch, with the seed {self._state.seeds[self._pointed.number]}."

    def _take(self) -> None:
        """Write the changes of a game into the columns; the game leaves if they are of values that all games share."""
        journal = self._journal
        phase = self._phase
        rng = self._own_of_ctx["_rng"]
        if rng is not None:
            self._take_rng(rng)
        is_other = phase.epoch != self._epoch
        are_changed = is_other and (phase.strategy_changes, phase.sensor_changes) != self._changes
        block: AgentBlock | None = self._block
        if journal.log or journal.progressed or are_changed:
            block = self._take_agents(journal)
            if block is None:
                return
        if self._read:
            self._take_logs(self._read)
        if self._pointed.map.changes() != self._pointed.map_changes:
            self._take_roads()
        for name in _NUMBERS:
            self._state.numbers[name][self._pointed.number, self._population.numbers] = getattr(block, name)
        if self._facts != self._facts_shown:
            self._take_facts()
        if is_other and self._what_is_fixed() != self._fixed:
            self._leave("changes settings, rules or collectors")

    def _take_rng(self, rng: Generator) -> None:
        """Store the random stream of a game."""
        self._own_row().rng = rng
        if self._has_drawn:
            self._leave("draws from ctx.rng, as the code of the scenario does")

    def _take_population(self) -> AgentBlock | None:
        """Store the agents that a function has created or deleted for its game.

        Returns:
            The block with the changes of the function; None: some agents have no rows, and games have to begin again.
        """
        number = self._pointed.number
        before = self._population
        agents = self._ctx.agent.agents
        roster = self._state.roster
        known = {agent.name: agent for agent in before.agents.members}
        first = dict(zip(self._pointed.first.agents.members, self._pointed.first.agents.equipment, strict=True))
        new = [agent for name, agent in agents.items() if known.get(name) is not agent]
        changed = [agent for agent, own in first.items() if own != (agent.strategy, agent.sensors)]
        self._turns.note_departed()
        self._refuse_other_forms([agent for agent in changed if agents.get(agent.name) is agent], first)
        if not self._state.adds_rows and any(agent.name not in self._number_of for agent in new):
            self._leave("creates agents whose names neither game 0 nor the other games of the batch know")
        unfit = [agent for agent in new if not roster.can_hold(agent)]
        unfit += [agent for agent in changed if not roster.varies[self._number_of[agent.name]]]
        if unfit:
            self._new_agents += unfit
            before.renew_journal()
            self._pointed.show(before)
            self._take_shown()
            self._fixed = self._what_is_fixed()
            return None
        self._take_attributes()
        row = self._own_row()
        if row.moved is None or row.moved[0] != self._moment:
            row.moved = self._moment, before
        for name in [name for name, agent in known.items() if agents.get(name) is not agent]:
            self._core.leave(number, self._number_of[name], row.departed[name][1])
        for agent in new:
            place = self._number_of[agent.name]
            start = self._values.began[agent.name]
            self._core.enter(number, place, start, agent.current_node_id, after_moves=self._part is None)
            if self._part is not None:  # it does not make the move of a deleted agent of its name
                self._cancel(place)
        attributes = {agent.name: agent.__dict__ for agent in agents.values()}
        found = self._pointed.take_population(number)
        self._take_shown()
        row.attributes = [attributes[agent.name] for agent in self._agents]
        self._attributes = row.attributes
        self._fixed = self._what_is_fixed()
        return found.block

    def _refuse_other_forms(self, changed: Sequence[Any], first: Mapping[Any, tuple[Any, Any]]) -> None:
        """Leave the core if agents for which array functions decided have other strategies now."""
        for agent in changed:
            if strategy_spec_of(agent.strategy).array_form is not strategy_spec_of(first[agent][0]).array_form:
                self._leave("changes a strategy to or from an array strategy")

    def _take_logs(self, read: dict[str, Any]) -> None:
        """Write the changes of the scores and the events of a game that were read."""
        if "scores" in read:
            self._take_scores(read["scores"])
        if "events" in read and len(read["events"]) != self._num_events:
            if len(read["events"]) < self._num_events:
                self._leave("deletes events")
            self._note_events(read["events"][self._num_events :])
        if "messages" in read and len(read["messages"]) != self._num_messages:
            self._leave("changes ctx.game.messages")

    def _take_roads(self) -> None:
        """Store the open roads of the game after a function call."""
        if not self._pointed.take_roads(self._pointed.number):
            self._leave("changes more of the map than which roads are open")

    def _note_events(self, entries: Sequence[dict[str, Any]]) -> None:
        """Count the stops of agents by events that a function has added to the log of a game."""
        state = self._state
        numbers = self._number_of
        for entry in entries:
            stopped = entry.get(STOPPED.get(entry["kind"], ""))
            if isinstance(stopped, str) and stopped in numbers:
                state.stops[self._pointed.number, numbers[stopped]] += 1

    def _take_scores(self, scores: dict[Any, Any]) -> None:
        known = self._scores_before
        if scores == known and [*map(type, scores.values())] == [*map(type, known.values())]:
            return
        columns = self._state.scores
        are_exact = {key for key, column in columns.items() if column.dtype == object}
        if not all(key in are_exact or fits_float(points) for key, points in scores.items()):
            self._leave("sets scores that are no numbers")
        columns.put(self._pointed.number, scores)

    def _take_agents(self, journal: Journal) -> AgentBlock | None:
        """Store the changes of agents; return their block; None: games have to begin again."""
        self._pointed.part_from_others()
        changed = None
        if self._pointed.has_other_agents():
            changed = self._take_population()
            if changed is None:
                return None
        self._take_changes(journal, changed)
        return changed or self._block

    def _take_changes(self, journal: Journal, changed: AgentBlock | None) -> None:
        """Write the nodes of agents that were placed elsewhere, and which agents live.

        Args:
            journal: the changes that a function has made.
            changed: the agents, if it has created or deleted some; else None.
        """
        state = self._state
        number = self._pointed.number
        block = changed or self._block
        kinds = {one[0] for one in journal.log if type(one) is tuple}
        progressed = [name for name in map(journal.names.__getitem__, journal.progressed) if name in block.rows]
        journal.log.clear()
        journal.progressed.clear()
        if AGENT_ATTRIBUTE in kinds:
            self._take_attributes()
        if not kinds <= _CHANGING | (_EQUIPPING if changed else set()):
            self._leave("changes agents otherwise than by putting them elsewhere or out of the game")
        numbers = self._population.numbers
        for name in progressed:
            state.movement.clear(number, self._number_of[name])
        if changed or _TURNED in kinds:
            headings = zip(numbers.tolist(), block.heading, self._population.first_headings, strict=True)
            state.headings[number] = {agent: now for agent, now, first in headings if now != first}
        block.locate()
        state.node[number, numbers] = state.streets.rows(np.array(block.ids_of(block.node)))
        state.previous[number, numbers] = state.streets.rows(np.array(block.ids_of(block.previous)))
        alive = bytes(block.alive)
        state.alive[number, numbers] = np.frombuffer(alive, np.bool_)
        if not changed:
            self._pointed.headings = state.headings[number]
            self._pointed.alive = alive
        state.placed[number, numbers] = [row in block.placed for row in range(len(numbers))]
        if changed and self._part is None:
            self._core.place_newcomers(np.array([number]))
        if state.flights is not None:
            fly = self._population.flying, self._population.rows_in_air
            state.placed[number, state.flights.agents] |= state.flights.take(number, block, *fly)

    def _take_facts(self) -> None:
        """Store the facts that a rule has published in a game."""
        known = self._facts_shown
        now = self._facts
        changed = {name for name, fact in now.items() if name not in known or fact is not known[name]}
        facts = dict(now)
        self._own_row().facts = facts
        self._facts_own = facts
        self._facts_shown = facts
        if changed & self._core_keys:
            self._leave("publishes facts of rules in the core")
        if self._has_array_functions:
            self._leave("publishes facts, which array functions may read")

    # -- strategies ---------------------------------------------------------------------------------------------

    @contextmanager
    def _deciding(self, games: IntArray) -> Iterator[None]:
        """Let agents observe and decide in games at which the context is pointed."""
        turns = self._turns
        self._begin()
        self._has_ended = False
        turns.is_playing = True
        turns.is_moving = True
        try:
            yield
        except Exception as error:
            if not self._have_left(games):
                error.add_note(self._named())
                raise
        finally:
            turns.is_playing = False
            turns.is_moving = False
            turns.travel.now = 0.0
            self._forget_looks()
        self._have_left(games)

    def decide(self, view: ArrayView, observing: IntArray, here: BoolArray | None) -> IntArray:
        """Return the actions of agents that are asked game by game.

        Args:
            view: the agents.
            observing: the numbers of other agents, whose sensors are called.
            here: (all games, all agents) a mask of the agents that arrive now; None: all agents decide.
        """
        state = self._state
        agents = view.agents
        places = self._pointed.by_population(view.games)
        games = view.games[places]
        are_blocked = np.any(state.blocked[games][:, agents], axis=1).tolist()
        ends = list[int]()
        decided = list[int]()
        self._deeds = []
        if self._core.courses is not None:
            self._core.courses.routes.forget()
        which = agents.tobytes(), observing.tobytes()
        with self._deciding(games):
            for place in self._each(games):
                number = self._pointed.number
                self._ordered.table.rekey(state.seeds[number])
                if here is None:
                    asked = self._ordered.asked_of(*which, self._block.alive.tobytes())
                else:
                    arriving, looking = [one[here[number, one]].tobytes() for one in (agents, observing)]
                    asked = self._new_asked(self._ordered.order, arriving, looking, b"")
                if not asked.part.observing:
                    continue
                told = self._tell_blocked(asked) if are_blocked[place] or self._undone else ()
                try:
                    ends += self._ask(asked)
                    decided.append(place)
                except Exception:
                    if not self._why:
                        raise
                for slot in told:
                    slot.set_blocked(None)
        if state.deed_log is not None and not self._core.arrival:
            state.deed_log.want(state.deeds, state.deeds.from_plain(self._deeds, state.node), state.turn)
        if self._core.courses is not None:
            self._core.courses.routes.write()
            return np.full(view.node.shape, -1)
        wanted = np.array(state.streets.ids_of(view.node))
        wanted[places[decided]] = np.array(ends, np.int64).reshape(len(decided), len(agents))
        return view.action_to(wanted)

    def note_given(self, view: ArrayView) -> None:
        """Record that agents got actions from outside."""
        names = self._state.roster.names
        for at, i in np.argwhere(view.mask).tolist():
            row = self._pointed.rows[view.games[at]]
            if row is not None:
                row.undone.pop(names[view.agents[i]], None)

    def _ask(self, asked: _AskedAgents) -> list[int]:
        """Return the nodes to which agents of the current game move."""
        row = self._own_row()
        memories = row.memories
        for name, template in asked.templates:
            template["memory"] = memories[name]
        if self._core.arrival is None:
            for notice in self._cached.notices:
                notice.reset()
            decisions = self._turns.decide(self._ordered.order, asked.part)
        else:
            decisions = self._decide_at_arrival(asked)
        if not self._cached.sees_world_only:
            self._take_what_sensors_change()
        if self._state.flights is not None:
            self._choose_flights(self._state.flights, decisions, asked)
        if self._core.courses is not None:
            self._choose_routes(self._core.courses.routes, decisions, asked)
        chooses = decisions.actions or decisions.paths is not None
        if chooses or decisions.failures or decisions.written or row.undone:
            self._take_decisions(decisions, asked)
        if self._state.deed_log is not None and decisions.actions:
            self._take_deeds(decisions, asked)
        if self._state.radio is not None:
            self._take_messages(self._state.radio, decisions, asked)
        found = decisions.ends
        return [found[i] for i in asked.places]

    def _decide_at_arrival(self, asked: _AskedAgents) -> Decisions:
        """Return the decisions of agents that may have decided before in the same turn."""
        number = self._pointed.number
        turns = self._turns
        slots = self._ordered.order.slots
        known = self._marks.get(number, _StreamPositions({}, [{} for _ in self._cached.notices]))
        for notice, looks in zip(self._cached.notices, known.looks, strict=True):
            notice.go_to(looks)
        for i, name in asked.members:
            slots[i].go_to(known.streams.get(name, (None, None)))
        turns.travel.now = self._state.movement.now[number].item()
        decisions: Decisions = turns.decide(self._ordered.order, asked.part)
        streams = {name: slots[i].marks() for i, name in asked.members}
        self._marks[number] = _StreamPositions(
            known.streams | streams, [notice.mark() for notice in self._cached.notices]
        )
        return decisions

    def _take_what_sensors_change(self) -> None:
        """Write the changes that custom sensors made before agents decided."""
        if self._journal.log or self._journal.progressed or self._has_ended:
            self._leave("that is a sensor changes agents or ends the game")
        self._take()

    def _choose_flights(self, flights: Flights, decisions: Decisions, asked: _AskedAgents) -> None:
        """Store the flights that agents of the current game have chosen."""
        for i, name in asked.members:
            action = decisions.actions.get(i)
            if action is not None and (action.position is not None or action.quat is not None):
                flights.choose(self._pointed.number, self._number_of[name], action.position, action.quat)

    def _choose_routes(self, routes: Routes, decisions: Decisions, asked: _AskedAgents) -> None:
        """Store the routes that agents of the current game have chosen."""
        for i, name in asked.members:
            if not routes.choose(self._pointed.number, self._number_of[name], decisions, i):
                self._leave("chooses a route with an edge that it repeats")

    def _take_decisions(self, decisions: Decisions, asked: _AskedAgents) -> None:
        """Store the decisions other than moves to nodes."""
        paths = decisions.paths
        for i in range(0 if paths is None or self._core.courses is not None else len(paths.maps)):
            track = None if paths is None else paths.track(i)
            if track is not None and len(track.path) > 2:
                self._leave("chooses a route over other nodes")
            if track is not None:
                self._leave("chooses a route that comes to the node on which it begins")
        named = dict(asked.members)
        for i, action in decisions.actions.items():
            if action.heading != ():
                self._state.turning.append((self._pointed.number, self._number_of[named[i]], action.heading))
        decide = set(named.values())
        row = self._own_row()
        undone = {name: why for name, why in row.undone.items() if name not in decide}
        for i, why in decisions.undone():
            undone[named[i]] = f"{undone[named[i]]}; {why}" if named[i] in undone else why
        row.undone = undone
        if decisions.written:
            decisions.merge_team_memories()
        turn = self._values.turn
        for i, kind, message in decisions.failures:
            self._state.failures.append((Failure(self._pointed.number, self._number_of[named[i]], kind, message), turn))

    def _take_deeds(self, decisions: Decisions, asked: _AskedAgents) -> None:
        """Store the deeds of agents of the current game."""
        for i, name in asked.members:
            action = decisions.actions.get(i)
            agent = self._number_of[name]
            deeds = (action and action.deeds) or {}
            if self._core.arrival and deeds:
                self._core.note_late_deeds(np.array([self._pointed.number]), np.array([agent]))
            for order, (kind, fields) in enumerate(deeds.items()):
                self._deeds.append((self._pointed.number, agent, order, kind, fields))

    def _take_messages(self, radio: MessageTraffic, decisions: Decisions, asked: _AskedAgents) -> None:
        """Store the messages that agents of the current game send."""
        failed = decisions.failed
        slots = self._ordered.order.slots
        number = self._pointed.number
        having = {*asked.part.observing}  # an outbox: agents whose plan is of arrays have none
        messages, unsent = self._turns.outboxes.read(
            [slots[i] for i, _ in asked.members if i in having and i not in failed]
        )
        flaws = [Failure.illegal(number, self._number_of[slot.name], why) for slot, why in unsent]
        radio.post_checked(number, messages, flaws)

    def note_closed_edges(self, games: IntArray, agents: IntArray, edges: IntArray) -> None:
        """Tell agents that they have left closed edges."""
        columns = self._state.movement.columns
        ends = columns.node_ids[columns.sources[edges]], columns.node_ids[columns.targets[edges]]
        for game, agent, source, target in zip(*(one.tolist() for one in (games, agents, *ends)), strict=True):
            self._note_undone(game, agent, closed_edge(source, target))

    def note_undone(self, failure: Failure) -> None:
        """Tell an asked agent, in its next turn, why its action failed in this one."""
        self._note_undone(failure.game, failure.agent, failure.message)

    def _note_undone(self, game: int, agent: int, why: str) -> None:
        if agent in self._asked_agents:
            undone = self._pointed.row_of(game).undone
            name = self._state.roster.names[agent]
            undone[name] = f"{undone[name]}; {why}" if name in undone else why

    def _new_asked(self, order: TurnOrder, asked: bytes, observing: bytes, _: bytes) -> _AskedAgents:
        """Return the living agents that are asked, and the living agents that only observe, given their numbers."""
        names = self._state.roster.names
        named = [names[number] for number in np.frombuffer(asked, np.int64).tolist()]
        living = {order.names[i]: i for i in order.present()}
        places = [living.get(name, -1) for name in named]
        members = [(i, name) for i, name in zip(places, named, strict=True) if i >= 0]
        part = order.whole
        if len(members) < len(order.slots):
            part = order.part_of([i for i, _ in members])
        others = {living.get(names[number], -1) for number in np.frombuffer(observing, np.int64).tolist()} - {-1}
        if others:
            part.let_observe(others)
        templates = [(name, order.slots[i].template) for i, name in members]
        return _AskedAgents(part, places, members, templates)

    def _tell_blocked(self, asked: _AskedAgents) -> list[Any]:
        """Set the reasons why agents failed to act in their last turns; return their slots."""
        state = self._state
        told = []
        slots = self._ordered.order.slots
        numbers = self._number_of
        number = self._pointed.number
        undone = self._undone
        for i, name in asked.members:
            why = [undone[name]] if name in undone else []
            if self._core.arrival is not None:
                pass  # `note_losers` has noted conflicts
            elif state.blocked[number, numbers[name]] and state.turn[number] > self._first.turn:
                why.append(in_conflict(self._core.wanted(number, numbers[name])))
            if why:
                slots[i].set_blocked("; ".join(why))
                told.append(slots[i])
        return told

    # -- turns --------------------------------------------------------------------------------------------------

    def agents(self, game: int) -> list[tuple[Any, Any]] | None:
        """Return the agents of a game and their strategies; None: those of the start."""
        population = self._pointed.population_of(game)
        if population is None:
            return None
        strategies = [strategy for strategy, _ in population.agents.equipment]
        return [*zip(population.agents.members, strategies, strict=True)]

    def departed(self, game: int) -> dict[str, tuple[Any, int]]:
        """Return the agents that were deleted in a game, with their teams and nodes."""
        row = self._pointed.rows[game] or self._pointed.at_start
        return row.departed

    def checkpoint(self) -> Callable[[], None]:
        """Return a function that undoes later changes, but for memories, data, facts and attributes of agents."""
        undo = self._state.checkpoint(self._core.moves)
        undo_rows = self._pointed.checkpoint()

        def take_back() -> None:
            undo()
            undo_rows()

        return take_back
