"""Points one context at each game of a batch in turn, for rules and strategies that are plain functions."""

from collections.abc import Callable, Iterator, Sequence
from operator import itemgetter
from typing import Any, NamedTuple, NoReturn

import numpy as np

from gamms.core.copies import copied
from gamms.deciding import phase_of
from gamms.game.batch.begun import fits_float, movement_type
from gamms.game.batch.columns import Failure, PlayedGame, Roster, decider_of
from gamms.game.batch.forms import strategy_spec_of
from gamms.game.batch.in_core import CoreGames, core_form_of
from gamms.game.batch.state import STOPPED, GameArrays, NotTakenUp
from gamms.game.batch.view import ArrayView, movement_in
from gamms.game.decisions import Decisions
from gamms.game.moves import TurnMoves
from gamms.game.order import Part, TurnOrder
from gamms.game.random_streams import DrawTable
from gamms.game.settings import NamedRule, as_called
from gamms.game.slots import COUNTED
from gamms.ir.agents import show_game
from gamms.ir.game_state import GameState, Scores, in_conflict
from gamms.ir.graph import IntArray
from gamms.ir.journal import PLAIN, Journal
from gamms.ir.obstacles import BoolArray
from gamms.ir.schema import CHANGE_EVENTS
from gamms.plain import is_plain, is_same

_MOST_ORDERS = 1 << 10  # sets of living agents of which it is kept what a turn needs of them
_READ = (
    "began",
    "counts",
    "errors",
    "events",
    "memories",
    "moves",
    "scores",
)  # fields that are made when they are read
_OWN = (*_READ, "data", "over", "start", "team_memories")
_CHANGING = frozenset(CHANGE_EVENTS[name].code for name in ("node", "previous", "alive"))
_OF_ONE = ("__contains__", "__delitem__", "__getitem__", "__setitem__", "get", "pop", "setdefault")
_OF_ALL = (
    *("__bool__", "__deepcopy__", "__eq__", "__format__", "__ior__", "__iter__", "__len__", "__ne__", "__or__"),
    *("__repr__", "__ror__", "clear", "copy", "items", "keys", "popitem", "update", "values"),
)


class Unknown(dict[Any, Any]):
    """A dict of a game of which some values are in columns of the core; a function that reads these ends that.

    Args:
        values: the others.
        keys: of those in columns; None: all.
        leave: lets the games leave the core.
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
    """Return a method of `Unknown` that reads the value of one key, or all values."""
    method = getattr(dict, name, None)

    def read(self: Unknown, *args: Any, **named: object) -> Any:
        if method is None or self.of_core is None or not is_of_one or args[0] in self.of_core:
            self.leave(f"reads {self.what}")
        return method(self, *args, **named)

    return read


for _name in (*_OF_ONE, *_OF_ALL):
    setattr(Unknown, _name, _refusing(_name, is_of_one=_name in _OF_ONE))


class _Start:
    """The start of the game that a context is pointed at; such a game cannot be reset.

    Args:
        make: returns the value of a field of the game that is read.
        began: returns where agents began.
        leave: lets the games leave the core.
    """

    def __init__(
        self, make: Callable[[str], Any], began: Callable[[], dict[str, Any]], leave: Callable[[str], NoReturn]
    ) -> None:
        self.make = make
        self._began = began
        self._leave = leave

    @property
    def snapshot(self) -> "_Start":
        """What says where agents began."""
        return self

    def places_of(self, _: object) -> dict[str, Any]:
        """Return where agents began."""
        return self._began()

    def __getattr__(self, name: str) -> NoReturn:
        """Refuse all else."""
        if name.startswith("__"):
            raise AttributeError(name)
        self._leave("resets the game")


class _PointedState(GameState):
    """The state of the game that a context is pointed at; some fields are made when they are read."""

    __slots__ = ()

    def __getattr__(self, name: str) -> Any:
        """Make a field."""
        if name not in _READ:
            raise AttributeError(f"A game has no {name!r}.")
        value = self.start.make(name)
        setattr(self, name, value)
        return value

    def memory_of(self, name: str) -> dict[Any, Any]:  # noqa: ARG002 - as that of a game
        """Return a memory in the place of that of the agent, which the cursor puts there before it is asked."""
        return {}


class _Own:
    """What one game has beside the columns of the batch, as Python objects.

    Attributes:
        data, team_memories: as `GameState` has them.
        memories: agent -> what it remembers.
        facts: what was published; None: what was published before the batch.
        undone: agent -> why it did not do in its last turn what it wanted, but for conflicts.
    """

    __slots__ = ("data", "facts", "memories", "team_memories", "undone")

    def __init__(self, data: dict[Any, Any]) -> None:
        self.data = data
        self.memories: dict[str, dict[Any, Any]] = {}
        self.team_memories: dict[Any, dict[Any, Any]] = {}
        self.facts: dict[str, Any] | None = None
        self.undone: dict[str, str] = {}

    def copy(self) -> "_Own":
        """Return a copy that later turns do not change."""
        data = self.data
        values: dict[Any, Any] = {key: copied(one) for key, one in dict.items(data)}
        if isinstance(data, Unknown):
            values = Unknown(values, data.of_core, data.leave, data.what)
        twin = _Own(values)
        twin.memories = copied(self.memories)
        twin.team_memories = copied(self.team_memories)
        twin.facts = self.facts
        twin.undone = dict(self.undone)
        return twin


class _Asked(NamedTuple):
    """Agents that are asked, of which some may be dead.

    Attributes:
        part: those of the turn that live.
        places: the slot of each agent; -1: it is dead.
        members: the slots and names of those that live.
        templates: the names of those that live, and their states.
    """

    part: Part
    places: list[int]
    members: list[tuple[int, str]]
    templates: list[tuple[str, dict[str, Any]]]


class _Living(NamedTuple):
    """The order of a turn of the agents that live in a game.

    Attributes:
        order: the order.
        table: by which they draw.
        asked: by numbers of agents in the roster.
    """

    order: TurnOrder
    table: DrawTable
    asked: dict[bytes, _Asked]


class _Place(NamedTuple):
    """Where the agents of a game are, by the rows of the block."""

    number: int  # of the game
    turn: int
    node: "memoryview[int]"
    previous: "memoryview[int]"
    alive: bytes
    is_placed: bool  # whether an agent was put where it is


class Cursor:
    """Points the context of a game at each game of a batch in turn.

    The context has one set of agents, which are those of the game that it is pointed at. A plain function that reads
    what the core has otherwise than a context, or changes what the core cannot change, raises `NotTakenUp`: the games
    leave the core then.

    Args:
        game: at its start, whose context is pointed at games.
        state: of all games.
        core: plays them.
        asked: the numbers in the roster of agents whose strategies and plans are called.
        has_array_functions: whether array functions are called, too.

    Attributes:
        functions: the plain functions that are called.
    """

    def __init__(
        self, game: PlayedGame, state: GameArrays, core: CoreGames, asked: Sequence[int], *, has_array_functions: bool
    ) -> None:
        parts = game.internals.parts
        self._game = game
        self._state = state
        self._core = core
        self._has_array_functions = has_array_functions
        self._ctx = game.ctx
        self._parts = parts
        self._turns = parts.turns
        self._values = parts.state
        self._phase = phase_of(game.ctx)
        self._own_of_ctx = vars(game.ctx)
        self._has_begun = False
        self._games: list[_Own | None] = [None] * len(state)
        self._why = ""  # why games leave the core
        self._wanted = np.full(state.node.shape, -1)  # ids of the nodes to which agents wanted to go
        self._unknown = frozenset(_keys_in_core(game))
        self._keeps_in_columns = keep_in_columns(game, state.roster)
        plans = game.settings()["plans"]
        deciders = [decider_of(state.roster.agents[number], plans) for number in asked]
        self.functions = [*(one.rule for one in as_called(game.rules) if is_plain_rule(one)), *deciders]

    # -- the context --------------------------------------------------------------------------------------------

    def _begin(self) -> None:
        """Let the context be pointed at games."""
        values, block = self._values, self._ctx.agent.block
        self._has_begun = True
        self._block = block
        self._before = self._game.snapshot()
        self._kept = {name: getattr(values, name) for name in _OWN}
        self._number_of = number = {name: i for i, name in enumerate(self._state.roster.names)}
        self._numbers = np.array([number[name] for name in block.names], np.int64)  # of the rows, in the roster
        self._agents = [self._ctx.agent.agents[name] for name in block.names]
        self._journal = Journal(block.names)
        self._first_data = {key: one for key, one in values.data.items() if key not in self._unknown}
        self._facts = values.facts
        self._first_facts = {
            name: self._no(f"ctx.game.facts[{name!r}]") if name in self._unknown else fact
            for name, fact in self._facts.items()
        }
        self._first_attributes = [copied(vars(one)) for one in self._agents]
        self._orders: dict[bytes, _Living] = {}
        for name in _READ:
            delattr(values, name)
        values.__class__ = _PointedState
        values.start = _Start(self._make, self._began, self._leave)
        values.has_begun = True
        values.last_turn = self._game.settings()["max_turns"]
        if self._keeps_in_columns:
            values.team_memories = self._no("ctx.game.team_memories")
        values.deeds = []
        values.messages = []
        self._block.journal = self._journal
        self._facts_own: dict[str, Any] | None = None  # of the game, if it has other facts than the first
        self._show_facts(None)
        access = self._ctx.agent.storage.turn_access
        each = [access(one) for one in self._agents]
        self._lasts = [one.last for one in each] + [last for one in each for _, last, *_ in one.carried]
        self._looks = self._no("what agents have sensed")
        self._living: _Living
        self._alive: bytes | None = None  # who lives now; None: that is not known
        self._read = list[str]()
        self._row = _Own({})
        self._number = -1
        self._fixed = self._what_is_fixed()
        self._forget_looks()

    def release(self) -> None:
        """Have the context as it was before it was pointed at games."""
        if not self._has_begun:
            return
        self._has_begun = False
        values, turns = self._values, self._turns
        values.__class__ = GameState
        for name, value in self._kept.items():
            setattr(values, name, value)
        values.has_begun = False
        values.began = {}
        values.last_turn = None
        values.stream_version += 1  # slots have memories and draws of games of the batch
        self._block.journal = PLAIN
        self._block.placed.clear()
        turns.is_playing = turns.is_moving = False
        self._own_of_ctx["_rng"] = None
        for agent, own in zip(self._agents, self._first_attributes, strict=True):
            agent.__dict__ = copied(own)
        for last in self._lasts:
            last[0] = {}
        self._game.restore(self._before)

    def _no(self, what: str) -> Unknown:
        return Unknown({}, None, self._leave, what)

    def _leave(self, what: str) -> NoReturn:
        """Let the games leave the core, because of what a function does, in words."""
        self._why = self._why or f"a plain function {what}"
        raise NotTakenUp(self._why)

    def _what_is_fixed(self) -> tuple[Any, ...]:
        """Return what only the turn engine can change, as numbers and objects."""
        phase, graph = self._phase, self._ctx.graph
        return (
            *(phase.setting_changes, phase.sensor_changes, phase.owner_changes, phase.strategy_changes),
            *(graph.graph.revision, graph.obstacle_revision, graph.storage.has_placed),
            *(id(self._parts.rules.rules), self._ctx.is_terminated(), id(self._ctx.agent.block)),
        )

    def _refuse_changes(self) -> None:
        """Leave the core if a function has changed a value that all games share."""
        if self._why:
            raise NotTakenUp(self._why)
        if self._what_is_fixed() != self._fixed:
            self._leave("changes the map, settings, rules, sensors or strategies")
        if not is_same([vars(one) for one in self._agents], self._first_attributes):
            self._leave("changes attributes of agents")
        self._refuse_private_facts()
        if self._own_of_ctx["_rng"] is not None:
            self._leave("draws from ctx.rng")

    def _refuse_private_facts(self) -> None:
        of_agents, of_teams = self._values.agent_facts, self._values.team_facts
        if any(of_agents.values()) or any(of_teams.values()):
            self._leave("publishes facts to single agents or teams")
        if of_agents or of_teams:  # a function has asked for them
            of_agents.clear()
            of_teams.clear()
            self._alive = None

    def _forget_looks(self) -> None:
        for last in self._lasts:
            last[0] = self._looks

    # -- pointing -----------------------------------------------------------------------------------------------

    def _places(self, games: IntArray) -> list[_Place]:
        """Return where agents are in some games."""
        if not self._has_begun:
            self._begin()
        state, numbers = self._state, self._numbers
        ids, before = (
            np.ascontiguousarray(state.streets.ids_of(rows[games][:, numbers]), np.int64).reshape(-1).data
            for rows in (state.node, state.previous)
        )
        lives = np.ascontiguousarray(state.alive[games][:, numbers]).tobytes()
        size = len(numbers)
        parts = [slice(first, first + size) for first in range(0, size * len(games), size)]
        are_placed = np.any(state.placed[games], axis=1).tolist()
        return [
            _Place(number, turn, ids[part], before[part], lives[part], is_placed)
            for number, turn, part, is_placed in zip(
                games.tolist(), state.turn[games].tolist(), parts, are_placed, strict=True
            )
        ]

    def _point(self, place: _Place) -> _Own:
        """Point the context at a game."""
        number, turn, node, previous, alive, is_placed = place
        values, state = self._values, self._state
        row = self._games[number]
        if row is None:
            row = self._games[number] = self._begun()
        self._row = row
        self._number = number
        if self._read:
            self._forget_read()
        values.turn = turn
        values.data = row.data
        if not self._keeps_in_columns:
            values.team_memories = row.team_memories
        values.over = self._over = state.over[number]
        self._turns.seed_changes += 1
        self._own_of_ctx["_seed"] = state.seeds[number]
        block = self._block
        if alive == self._alive:
            show_game(block, node, previous, None)
        else:
            show_game(block, node, previous, alive)
            self._take_living(alive)
        if is_placed:
            block.placed = set(np.flatnonzero(state.placed[number][self._numbers]).tolist())
        elif block.placed:
            block.placed = set()
        if row.facts is not self._facts_own:
            self._show_facts(row.facts)
        return row

    def _show_facts(self, own: dict[str, Any] | None) -> None:
        """Let what was published be that of a game; None: it is what was published before the batch."""
        self._facts_own = own
        self._facts_shown = self._first_facts if own is None else own
        self._facts.clear()
        self._facts.update(self._facts_shown)

    def _forget_read(self) -> None:
        for name in self._read:
            delattr(self._values, name)
        self._read.clear()

    def _begun(self) -> _Own:
        """Return what a game has of its own when it begins."""
        values = self._kept
        data: dict[Any, Any] = copied(self._first_data)
        if self._unknown:
            keys = ", ".join(sorted(self._unknown))
            data = Unknown(data, self._unknown, self._leave, f"ctx.game.data, with that of {keys}")
        row = _Own(data)
        row.team_memories = copied(values["team_memories"])
        row.memories = copied({name: memory for name, memory in values["memories"].items() if memory})
        return row

    def forget(self, games: IntArray) -> None:
        """Let some games begin again."""
        for number in games.tolist():
            self._games[number] = None
        self._wanted[games] = -1

    def _take_living(self, alive: bytes) -> None:
        """Let the agents that live now take turns."""
        self._alive = alive
        known = self._orders.get(alive)
        if known is None:
            if len(self._orders) >= _MOST_ORDERS:
                self._orders.clear()
            known = self._orders[alive] = _Living(self._turns.order(), self._turns.draw_table, {})
        else:
            self._turns.take_order(known.order)
        self._living = known

    def _order_of(self, alive: bytes) -> TurnOrder:
        """Return the order of the agents that lived."""
        block = self._block
        known = self._orders.get(alive)
        if known is None:
            lives = bytes(block.alive)
            with self._phase.suspended():  # a strategy may ask how agents have moved
                show_game(block, block.node, block.previous, alive)
                self._take_living(alive)
                known = self._living
                show_game(block, block.node, block.previous, lives)
                self._take_living(lives)
        return known.order

    # -- what is read -------------------------------------------------------------------------------------------

    def _make(self, name: str) -> Any:
        """Return a field of the game that the context is pointed at, when it is read."""
        value = getattr(self, f"_{name}")()
        self._read.append(name)
        return value

    def _began(self) -> dict[str, Any]:
        state = self._state
        return dict(zip(state.roster.names, state.streets.ids(state.start[self._number]).tolist(), strict=True))

    def _scores(self) -> Scores:
        self._scores_before = self._state.scores.of(np.array([self._number]))[0]
        scores = Scores()
        dict.update(scores, self._scores_before)
        return scores

    def _events(self) -> list[dict[str, Any]]:
        found = self._state.events.of(self._number)
        self._num_events = len(found)
        return found

    def _errors(self) -> list[dict[str, Any]]:
        return self._state.errors[self._number]

    def _counts(self) -> dict[str, dict[str, int]]:
        state = self._state
        columns = {kind: state.counts[kind][self._number].tolist() for kind in COUNTED}
        names = enumerate(state.roster.names)
        return {name: {kind: column[i] for kind, column in columns.items()} for i, name in names}

    def _memories(self) -> NoReturn:
        self._leave("reads ctx.game.memories")

    def _moves(self) -> TurnMoves | None:
        """Return how agents have moved in the last turn of the game; None: there was none."""
        starts, ends, took_part = (column[0] for column in self._core.last_moves(np.array([self._number])))
        if not took_part.any():
            return None
        order = self._order_of(np.ascontiguousarray(took_part[self._numbers]).tobytes())
        ids = self._state.streets.ids
        moves = TurnMoves(order, ids(starts[took_part]).tolist(), ids(ends[took_part]).tolist(), {})
        parts = self._parts.settings.order
        return moves if parts is None else moves.in_parts(parts)

    # -- rules --------------------------------------------------------------------------------------------------

    def call(self, named: NamedRule, games: IntArray) -> None:
        """Call a rule in each of these games."""
        turns, ctx = self._turns, self._ctx
        places = self._places(games)
        self._forget_read()
        turns.is_playing = True
        turns.is_moving = False
        drawn = self._drawn()
        try:
            for place in places:
                self._point(place)
                try:
                    named.rule(ctx)
                finally:
                    self._take()
        except Exception as error:
            if not isinstance(error, NotTakenUp):
                self._refuse_changes()
                error.add_note(f"In the rule {named.name!r} (phase {named.phase!r}), in turn {self._values.turn}.")
                error.add_note(self._named())
            raise
        finally:
            turns.is_playing = False
        self._refuse_changes()
        if any(last[0] is not self._looks for last in self._lasts):
            self._leave("asks sensors")
        if self._drawn() != drawn:
            self._leave("draws by the streams of agents")
        self._state.now.clear()

    def _named(self) -> str:
        return f"In game {self._number} of a batch, with the seed {self._state.seeds[self._number]}."

    def _drawn(self) -> int:
        """Return a number that changes when an agent draws."""
        return sum({id(one.table): one.table.begun for one in self._orders.values()}.values())

    def _take(self) -> None:
        """Write the changes of a game into the columns."""
        values, row, number = self._values, self._row, self._number
        if values.data is not row.data:
            if self._unknown:
                self._leave("replaces ctx.game.data")
            row.data = values.data
        if "scores" in self._read:
            self._take_scores(values.scores)
        if "events" in self._read and len(values.events) != self._num_events:
            if len(values.events) < self._num_events:
                self._leave("deletes events")
            self._note_events(values.events[self._num_events :])
        if values.over is not self._over:
            self._state.over[number] = values.over
            self._state.is_going[number] = values.over is None
        if self._journal.log or self._journal.progressed:
            self._take_agents()
        if self._facts != self._facts_shown:
            self._take_facts(row)

    def _note_events(self, entries: Sequence[dict[str, Any]]) -> None:
        """Let the core find events that are in the log of a game already."""
        state, numbers = self._state, self._number_of
        state.events.note(self._number, entries)
        for entry in entries:
            stopped = entry.get(STOPPED.get(entry["kind"], ""))
            if isinstance(stopped, str) and stopped in numbers:
                state.stops[self._number, numbers[stopped]] += 1

    def _take_scores(self, scores: dict[Any, Any]) -> None:
        known = self._scores_before
        if scores == known and [*map(type, scores.values())] == [*map(type, known.values())]:
            return
        if not all(map(fits_float, scores.values())) or bool in map(type, scores.values()):
            self._leave("sets scores that are no numbers")
        self._state.scores.put(self._number, scores)

    def _take_agents(self) -> None:
        """Write where agents are that were put elsewhere, and who lives."""
        journal, block, state, number = self._journal, self._block, self._state, self._number
        kinds = {one[0] for one in journal.log if type(one) is tuple}
        has_progressed = bool(journal.progressed)
        journal.log.clear()
        journal.progressed.clear()
        if not kinds <= _CHANGING or has_progressed:
            self._leave("changes agents otherwise than by putting them elsewhere or out of the game")
        numbers = self._numbers
        state.node[number, numbers] = state.streets.rows(np.array(block.node))
        state.previous[number, numbers] = state.streets.rows(np.array(block.previous))
        alive = bytes(block.alive)
        if alive != self._alive:
            state.alive[number, numbers] = np.frombuffer(alive, np.bool_)
            self._alive = None
        state.placed[number, numbers] = [row in block.placed for row in range(len(numbers))]

    def _take_facts(self, row: _Own) -> None:
        """Keep what a rule has published in a game."""
        first = self._first_facts
        known, now = self._facts_shown, self._facts
        changed = {name for name, fact in now.items() if name not in known or fact is not known[name]}
        row.facts = self._facts_own = self._facts_shown = dict(now)
        if changed & self._unknown or any(name in first and not is_plain(first[name]) for name in changed):
            self._leave("publishes facts of rules in the core")
        if self._has_array_functions:
            self._leave("publishes facts, which array functions may read")

    # -- strategies ---------------------------------------------------------------------------------------------

    def decide(self, view: ArrayView) -> IntArray:
        """Return the actions of agents that are asked game by game."""
        state, turns = self._state, self._turns
        games, agents = view.games, view.agents
        places = self._places(games)
        flagged = np.any(state.blocked[games][:, agents], axis=1).tolist()
        ends = list[int]()
        which = agents.tobytes()
        turns.is_playing = turns.is_moving = True
        try:
            for place, is_blocked in zip(places, flagged, strict=True):
                row = self._point(place)
                self._living.table.rekey(state.seeds[place.number])
                asked = self._asked(which, agents)
                if not asked.members:
                    ends += place.node[:1].tolist() * len(agents)
                    continue
                told = self._tell_blocked(row, asked) if is_blocked or row.undone else ()
                ends += self._ask(row, asked)
                for slot in told:
                    slot.set_blocked(None)
        except Exception as error:
            if not isinstance(error, NotTakenUp):
                self._refuse_changes()
                error.add_note(self._named())
            raise
        finally:
            turns.is_playing = turns.is_moving = False
            self._forget_looks()
        self._refuse_changes()
        nodes = np.array(ends, np.int64).reshape(len(games), len(agents))
        self._want(games, agents, nodes, view.mask)
        return view.action_to(nodes)

    def _want(self, games: IntArray, agents: IntArray, nodes: IntArray, decide: BoolArray) -> None:
        """Note where those agents want to go that decide now, (games, agents) each."""
        which = np.ix_(games, agents)
        self._wanted[which] = np.where(decide, nodes, self._wanted[which])

    def note_given(self, view: ArrayView, actions: IntArray) -> None:
        """Note where agents go whose actions were given, (games, agents), in place of their own."""
        rows = movement_in(view).nodes(view._choices, actions)
        self._want(view.games, view.agents, self._state.streets.ids_of(rows), view.mask)
        names = self._state.roster.names
        for at, i in np.argwhere(view.mask).tolist():
            own = self._games[view.games[at]]
            if own is not None:
                own.undone.pop(names[view.agents[i]], None)

    def _ask(self, row: _Own, asked: _Asked) -> list[int]:
        """Return the nodes to which agents of the game that the context is pointed at go."""
        for name, template in asked.templates:
            template["memory"] = row.memories.setdefault(name, {})
        decisions = self._turns.decide(self._turns.order(), asked.part)
        found = decisions.ends
        if decisions.actions or decisions.failures or decisions.written or row.undone:
            self._take_decisions(row, decisions, asked)
        return [found[i] for i in asked.places]

    def _take_decisions(self, row: _Own, decisions: Decisions, asked: _Asked) -> None:
        """Take the decisions that are not nodes to go to."""
        for action in decisions.actions.values():
            if action.heading != ():
                self._leave("sets the orientation of agents")
            if len(action.path) > 2:
                self._leave("chooses a route over other nodes")
            if action.path[1:] == action.path[:1]:
                self._leave("chooses a route that comes to the node on which it begins")
        named = dict(asked.members)
        decide = set(named.values())
        undone = {name: why for name, why in row.undone.items() if name not in decide}
        for i, why in decisions.undone():
            undone[named[i]] = f"{undone[named[i]]}; {why}" if named[i] in undone else why
        row.undone = undone
        if decisions.written:
            decisions.merge_team_memories()
        for i, kind, message in sorted(decisions.failures, key=itemgetter(0)):
            self._state.note_failure(Failure(self._number, False, self._number_of[named[i]], kind, message))

    def _asked(self, which: bytes, agents: IntArray) -> _Asked:
        """Return what asking some agents needs, of those that live now."""
        known = self._living
        asked = known.asked.get(which)
        if asked is None:
            order, names = known.order, self._state.roster.names
            named = [names[number] for number in agents.tolist()]
            places = [order.index_of.get(name, -1) for name in named]
            members = [(i, name) for i, name in zip(places, named, strict=True) if i >= 0]
            part = order.whole
            if len(members) < len(order.slots):
                part = Part(order.slots, [i for i, _ in members], order.progress, self._parts.settings)
            templates = [(name, order.slots[i].template) for i, name in members]
            asked = known.asked[which] = _Asked(part, places, members, templates)
        return asked

    def _tell_blocked(self, row: _Own, asked: _Asked) -> list[Any]:
        """Let agents know why they did not do what they wanted in their last turns; return their slots."""
        state, told = self._state, []
        slots, numbers = self._turns.order().slots, self._number_of
        for i, name in asked.members:
            why = [row.undone[name]] if name in row.undone else []
            if state.blocked[self._number, numbers[name]]:
                why.append(in_conflict(int(self._wanted[self._number, numbers[name]])))
            if why:
                slots[i].set_blocked("; ".join(why))
                told.append(slots[i])
        return told

    # -- turns --------------------------------------------------------------------------------------------------

    def checkpoint(self) -> Callable[[], None]:
        """Return a function that takes back all that happens from now on."""
        undo = self._state.checkpoint([self._wanted, *self._core.moves])
        own = [None if one is None else one.copy() for one in self._games]

        def take_back() -> None:
            undo()
            self._games[:] = own
            self._alive = None

        return take_back


def is_plain_rule(rule: NamedRule) -> bool:
    """Whether a rule is a function of the context alone."""
    return rule.spec.core_form is None and not rule.spec.is_array_function


def _keys_in_core(game: PlayedGame) -> Iterator[str]:
    """Yield the keys of `ctx.game.data` and the facts of rules that the core plays."""
    for one in game.rules:
        spec = one.spec
        if spec.core_form is not None and spec.key is not None:
            yield spec.key
            if spec.disclose is not None:
                yield from spec.disclose({}, ())


def asked_of(game: PlayedGame, roster: Roster) -> list[int]:
    """Return the numbers of the agents whose strategies, or the plans of whose teams, are plain functions."""
    plans, by = game.settings()["plans"], movement_type(game, roster)
    found = []
    for number, agent in enumerate(roster.agents):
        decider = decider_of(agent, plans)
        is_array_function = strategy_spec_of(decider).array_form is not None
        if core_form_of(decider, by) is None and not is_array_function:
            found.append(number)
    return found


def keep_in_columns(game: PlayedGame, roster: Roster) -> bool:
    """Whether what some agents remember is in columns of the batch."""
    plans = game.settings()["plans"]
    asked = asked_of(game, roster)
    others = [decider_of(agent, plans) for number, agent in enumerate(roster.agents) if number not in asked]
    return any(one is not None and not isinstance(strategy_spec_of(one).core_form, int) for one in others)
