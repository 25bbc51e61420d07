"""Rules without an array form in games that are played in arrays: called game by game, in one context for all."""

import random
from collections.abc import Callable, Sequence
from functools import cache
from operator import itemgetter
from typing import Any, NamedTuple, NoReturn

import numpy as np

from gamms.deciding import phase_of
from gamms.errors import GammsError
from gamms.game.batch.columns import PlayedGame
from gamms.game.batch.forms import form_of
from gamms.game.batch.state import GameArrays
from gamms.game.batch.turn import ArrayTurn
from gamms.game.moves import TurnMoves
from gamms.game.order import ResolvedAction, TurnOrder
from gamms.game.settings import NamedRule
from gamms.game.snapshots import SnapshotTaker, Start, copied
from gamms.ir.agents import AgentBlock
from gamms.ir.columns import Selection
from gamms.ir.game_state import GameState
from gamms.ir.graph import IntArray
from gamms.plain import why_not_plain

_MOST_EXACT = 1 << 53  # scores in arrays are floats


class NeedsTurnEngine(GammsError):
    """A rule uses what games that are played in arrays do not have, or changes more than one game."""


class LeavesArrays(GammsError):
    """A rule has made of a game what arrays cannot have."""


def why_not_called(game: PlayedGame, named: NamedRule) -> str | None:
    """Return why a rule has no array form and cannot be called game by game either; None: it has, or can."""
    check = getattr(named.rule, "check", None)
    lacks_check = check is not None and form_of(check) is None
    if form_of(named.rule) is not None and not lacks_check:
        return None
    settings, block = game.settings(), game.ctx.agent.block
    sensors = [sensor for agent in game.agents for sensor in agent.sensors.values()]
    is_simple = (
        not (lacks_check or named.phase == "deeds" or block.has_arrays)
        and settings["speed_unit"] == "edges"
        and settings["team_memory"]  # by which rules are found that look at what agents observe
        and len(settings["order"] or ()) < 2
        and all(agent.speed is None for agent in game.agents)
        and not any(getattr(one, "delay_turns", 0) or not getattr(one, "sees_world_only", False) for one in sensors)
    )
    return None if is_simple else f"the rule {named.name!r}"


class OwnState(NamedTuple):
    """What one game has beside the arrays, between two calls of its rules.

    Attributes:
        data: `ctx.game.data`.
        attributes: those of agents, in the order of the rows; None: those of the start.
        rng: the state of `ctx.rng`; None: nothing was drawn from it.
    """

    data: dict[str, Any]
    attributes: list[dict[str, Any]] | None
    rng: Any


class _Columns(NamedTuple):
    """The games of a turn as lists: of each game the values of its agents."""

    node: list[list[int]]  # in the order of the rows, as the next four
    previous: list[list[int]]
    alive: list[list[bool]]
    took_part: list[list[bool]]
    names_took_part: list[list[bool]]  # in the order of the names, as what follows
    starts: list[list[int]]
    ends: list[list[int]]
    began: list[list[int]]
    deeds: dict[int, dict[int, dict[str, dict[str, Any]]]]  # game -> agent -> deed -> its fields


class RuleContext:
    """The context in which rules without an array form are called: it is made to have one game after the other.

    A game in which a rule does what arrays cannot have leaves them: the turn engine plays it again from its start.

    Args:
        start: returns the game of the batch at its start, whose context is not played in.
        state: of all games.
        own: what each game has beside the arrays; None: as at the start.
        close: puts a game on a map with other closed roads, or returns why that is not possible.
    """

    def __init__(
        self,
        start: Callable[[], PlayedGame],
        state: GameArrays,
        own: list[OwnState | None],
        close: Callable[[int, Any], str | None],
    ) -> None:
        self.start, self._state, self._own, self._close = cache(start), state, own, close
        self._known: _RuleFork | None = None

    @property
    def _fork(self) -> "_RuleFork":
        """The context; made when it is needed, and again after a rule has changed more than a game."""
        if self._known is None:
            self._known = _RuleFork(self.start(), self._state)
        return self._known

    @property
    def _previous(self) -> IntArray:
        """The rows of the nodes that agents came from, (games, agents)."""
        headings = self._state.headings
        assert headings is not None  # noqa: S101 - there are such rules
        return headings.previous

    def functions(self, rules: Sequence[NamedRule]) -> list[Callable[..., object]]:
        """Return the rules as they are called."""
        return [self._fork.functions[one.name] for one in rules]

    def call(self, rules: Sequence[NamedRule], turn: ArrayTurn) -> None:
        """Call rules of one phase in each game of a turn."""
        state, columns = self._state, self._columns(turn)
        before = _global_random()
        # NOTE: games in which the same agents live share what the turn engine works out of that.
        for at in np.lexsort(np.concatenate((turn.alive, turn.took_part), axis=1).T).tolist():
            game = int(turn.games[at])
            if game in state.apart:
                continue
            own = self._own[game] or self._fork.first_state()
            try:
                self._fork.load(at, own, columns, turn, rules[0].phase)
                self._own[game] = self._fork.called(rules, at, turn)
                map_now = self._fork.taken_map()
                why = None if map_now is None else self._close(game, map_now)
                if why is not None:
                    self._leave(game, rules, LeavesArrays(why))
            except Exception as error:  # noqa: BLE001 - whatever a rule raises, the turn engine raises it again
                self._known = None
                self._leave(game, rules, error)
        if _global_random() != before:
            self._leave(int(turn.games[0]), rules, NeedsTurnEngine("it draws from the global random"))

    def _leave(self, game: int, rules: Sequence[NamedRule], error: Exception) -> None:
        """Let a game leave the arrays; all games, where that is for what the rule is rather than for what it did."""
        named = " or ".join([f"the rule {one.name!r}" for one in rules])
        games = range(len(self._state)) if isinstance(error, NeedsTurnEngine) else [game]
        for one in games:
            if self._state.over[one] is None or one == game:
                self._state.apart.setdefault(one, f"{named}: {error}")

    def _columns(self, turn: ArrayTurn) -> _Columns:
        state, rows, ids = self._state, self._fork.rows, turn.streets.ids
        several: list[tuple[int, int, int, str, dict[str, Any]]] = []
        for done in map(turn.performed, state.deeds.kinds):
            fields = {key: state.deeds.plain(done, key) for key in done.values}
            numbers = zip(done.order.tolist(), done.at.tolist(), done.agents.tolist(), strict=True)
            for i, (order, at, agent) in enumerate(numbers):
                values = {key: column[i] for key, column in fields.items() if column[i] is not None}
                several.append((order, at, agent, done.kind, values))
        deeds: dict[int, dict[int, dict[str, dict[str, Any]]]] = {}
        for _, at, agent, kind, values in sorted(several, key=itemgetter(0)):
            deeds.setdefault(at, {}).setdefault(agent, {})[kind] = values
        return _Columns(
            ids(turn.node[:, rows]).tolist(),
            ids(self._previous[turn.games][:, rows]).tolist(),
            turn.alive[:, rows].tolist(),
            turn.took_part[:, rows].tolist(),
            turn.took_part.tolist(),
            ids(turn.starts).tolist(),
            ids(turn.ends).tolist(),
            ids(state.start[turn.games]).tolist(),
            deeds,
        )


class _RuleFork:
    """A fork of the game of a batch, and how it is made to have another game.

    Args:
        game: of which it is a fork.
        state: of all games.

    Attributes:
        functions: the rules, by name.
        rows: (agents,) of each row of the block, the number of its agent in the roster.
    """

    def __init__(self, game: PlayedGame, state: GameArrays) -> None:
        fork = game.fork(0)
        self._state, self._game, self._ctx = state, fork, fork.ctx
        self._parts: SnapshotTaker = fork.internals.parts
        self._values: GameState = self._parts.state
        self._block: AgentBlock = self._ctx.agent.block
        self.functions = {one.name: one.rule for one in fork.rules}
        number = {name: i for i, name in enumerate(state.roster.names)}
        self.rows = np.array([number[name] for name in self._block.names], np.int64)
        self._agents = [self._ctx.agent.agents[name] for name in self._block.names]
        self._could_draw = game.ctx.rng_state() is None
        self._phase, self._notes = phase_of(self._ctx), list[str]()
        self._begin(game)
        self._heading, self._all = list(self._block.heading), Selection(list(range(len(self.rows))))
        self._order: TurnOrder | None = None
        self._first_map = self._ctx.graph.storage.snapshot()
        self._fixed, self._map = self._what_is_fixed(), self._map_as_it_is()
        self._equipped = self._equipment()
        self._loaded: tuple[Any, ...] = ()

    def _begin(self, game: PlayedGame) -> None:
        """Let the game be in the middle of a turn, and note what rules look at that arrays do not have."""
        values, ctx = self._values, self._ctx
        values.start = Start(self._game.snapshot(), ctx.rng_state(), (ctx.seed, ctx.rng_state()))
        values.has_begun, values.last_turn = True, self._game.settings()["max_turns"]
        self._parts.turns.is_playing = True
        self._game.internals.after_reset.append(lambda: self._notes.append("it resets the game"))
        in_arrays = [one.rule for one in self._game.rules if form_of(one.rule) is not None]
        keys = [key for rule in in_arrays if (key := getattr(rule, "key", None)) is not None]
        self._first_data = {
            key: self._unknown(f"ctx.game.data[{key!r}] of a rule in arrays") if _is_of(keys, key, value) else value
            for key, value in values.data.items()
        } | {key: self._unknown(f"ctx.game.data[{key!r}] of a rule in arrays") for key in keys}
        self._attributes = [vars(agent) for agent in self._agents]
        self._first_attributes = [copied(own) for own in self._attributes]
        self._are_plain = not any(why_not_plain(own) for own in self._attributes)  # so that they can be compared
        self._last_attributes: list[dict[str, Any]] | None = None
        self._facts_at_start = dict(game.facts)
        values.counts = _OfSlots(self._notes, "ctx.game.counts")
        values.memories = _OfSlots(self._notes, "ctx.game.memories")
        values.team_memories = self._unknown("ctx.game.team_memories, or what an agent observes,")
        if values.team_facts:
            values.team_facts = _OfSlots(self._notes, "what is published to teams")
        self._looks = self._unknown("what agents have sensed")
        access = [ctx.agent.storage.turn_access(agent) for agent in self._agents]
        self._held = [one.last for one in access] + [result for one in access for *_, result in one.carried]

    def _unknown(self, what: str) -> "_Unknown":
        return _Unknown(self._notes, what)

    def first_state(self) -> OwnState:
        """Return what a game has beside the arrays at its start."""
        data = {key: one if isinstance(one, _Unknown) else copied(one) for key, one in self._first_data.items()}
        return OwnState(data, None if self._are_plain else [copied(one) for one in self._first_attributes], None)

    # -- from arrays and back ---------------------------------------------------------------------------------------

    def load(self, at: int, own: OwnState, columns: _Columns, turn: ArrayTurn, phase: str) -> None:
        """Have a game as it is now: number `at` of a turn."""
        state, values, block, game = self._state, self._values, self._block, int(turn.games[at])
        values.turn = int(turn.turn[at])
        self._ctx.reseed(state.seeds[game], own.rng)
        self._set_alive(columns.took_part[at])
        values.moves = None if phase == "before" and not values.turn else self._moves(at, columns)
        self._set_alive(columns.alive[at])
        block.move_all(self._all, columns.previous[at])
        block.move_all(self._all, columns.node[at])
        values.began = dict(zip(state.roster.names, columns.began[at], strict=True))
        values.events, values.errors = state.events.of(game), state.errors[game]
        values.deeds = state.deeds.of(game)
        values.messages = [] if state.radio is None else state.radio.of(game)
        values.over, values.data, scores = state.over[game], own.data, state.scores_of(game)
        values.scores.clear()
        values.scores.update(scores)
        self._know_facts()
        self._set_attributes(own.attributes)
        for held in self._held:
            if held[0] is not self._looks:
                held[0] = self._looks
        self._loaded = columns.node[at], columns.previous[at], columns.alive[at], len(values.events), scores
        self._structure = block.structure_version

    def _set_alive(self, alive: list[bool]) -> None:
        block = self._block
        if block.alive != alive:
            for row, (is_now, was) in enumerate(zip(alive, block.alive.copy(), strict=True)):
                if is_now != was:
                    block.set(row, "alive", is_now)

    def _moves(self, at: int, columns: _Columns) -> TurnMoves:
        """Return the moves of a turn, of agents that go along one edge."""
        took_part, starts, ends = columns.names_took_part[at], columns.starts[at], columns.ends[at]
        members = [number for number, is_there in enumerate(took_part) if is_there]
        if len(members) < len(took_part):
            starts, ends = [starts[number] for number in members], [ends[number] for number in members]
        done, actions = columns.deeds.get(at, {}), {}
        for i, number in enumerate(members if done else ()):
            if number in done:
                path = (starts[i],) if starts[i] == ends[i] else (starts[i], ends[i])
                actions[i] = ResolvedAction(ends[i], path, deeds=done[number])
        if self._order is None or self._order.structure_version != self._block.structure_version:
            self._order = self._parts.turns.order()
        return TurnMoves(self._order, starts, ends, actions)

    def _know_facts(self) -> None:
        """Have the facts of the start; those that array forms publish are not known."""
        facts, first = self._values.facts, self._facts_at_start
        facts.clear()
        for name, value in self._state.facts.items():
            is_same = name in first and first[name] is value
            facts[name] = value if is_same else self._unknown(f"the fact {name!r} of a rule in arrays")
        self._facts = dict(facts)

    def _set_attributes(self, attributes: list[dict[str, Any]] | None) -> None:
        """Give the agents their attributes; None: those of the start."""
        if attributes is not None or self._last_attributes is not None:
            new = [copied(one) for one in self._first_attributes] if attributes is None else attributes
            for own, values in zip(self._attributes, new, strict=True):
                own.clear()
                own.update(values)
            self._last_attributes = attributes

    def _attributes_now(self) -> list[dict[str, Any]] | None:
        """Return the attributes of the agents; None: those of the start."""
        if self._are_plain and self._attributes == self._first_attributes:
            return None
        self._last_attributes = [own.copy() for own in self._attributes]
        return self._last_attributes

    def called(self, rules: Sequence[NamedRule], at: int, turn: ArrayTurn) -> OwnState:
        """Call rules in the game that was loaded, write what has changed, and return what else the game has.

        Raises:
            NeedsTurnEngine: a rule does what no game in arrays can.
            LeavesArrays: it has made of this game what arrays cannot have.
        """
        values = self._values
        for named in rules:
            if named.phase != "before" or values.over is None:
                self.functions[named.name](self._ctx)
        self._refuse_changes(int(turn.turn[at]))
        self._write(at, turn)
        return OwnState(values.data, self._attributes_now(), self._ctx.rng_state())

    def _write(self, at: int, turn: ArrayTurn) -> None:
        """Write what has changed into the arrays."""
        state, values, block, game = self._state, self._values, self._block, int(turn.games[at])
        node, previous, alive, num_events, scores = self._loaded
        headings = state.headings
        assert headings is not None  # noqa: S101 - there are such rules
        for before, now, column in (
            (node, block.node, turn.node[at]),
            (previous, block.previous, headings.previous[game]),
        ):
            if now != before:
                column[self.rows] = turn.streets.rows(now)
        if block.alive != alive:
            turn.alive[at, self.rows] = block.alive
        if len(values.events) > num_events:
            state.note_events(game, values.events[num_events:])
        if values.over is not state.over[game]:
            state.over[game] = values.over
            state.is_going[game] = values.over is None
        if values.scores != scores:
            state.set_scores(game, values.scores)

    # -- what arrays do not have ------------------------------------------------------------------------------------

    def _what_is_fixed(self) -> tuple[Any, ...]:
        """Return what only the turn engine can change, as numbers and objects."""
        phase, parts = self._phase, self._parts
        changes = phase.sensor_changes, phase.owner_changes, phase.strategy_changes, parts.settings.changes
        return changes, parts.rules.rules, parts.collectors.tables(), self._ctx.is_terminated()

    def _equipment(self) -> list[Any]:
        """Return what agents are and carry."""
        block = self._block
        carried = [list(agent.sensors.items()) for agent in self._agents]
        return [self._ctx.agent.block, list(block.names), list(block.teams), list(block.speed), block.removed, carried]

    def _map_as_it_is(self) -> tuple[int, int]:
        graph = self._ctx.graph
        return graph.graph.revision, graph.obstacle_revision

    def taken_map(self) -> Any:
        """Return the map that rules have changed, and have the own one again; None: they have not."""
        if self._map_as_it_is() == self._map:
            return None
        storage = self._ctx.graph.storage
        changed = storage.snapshot()
        storage.restore(self._first_map)
        self._map = self._map_as_it_is()
        return changed

    def _refuse_changes(self, turn: int) -> None:
        """Refuse what cannot be written into arrays."""
        values, block = self._values, self._block
        facts, known, scores, num_events = values.facts, self._facts, self._loaded[4], self._loaded[3]
        if self._notes:
            raise NeedsTurnEngine("; ".join(self._notes))
        self._refuse_what_detaches()
        if self._what_is_fixed() != self._fixed:
            raise NeedsTurnEngine("it changes settings, rules, sensors, strategies or collectors")
        if values.turn != turn or len(values.events) < num_events:
            raise NeedsTurnEngine("it changes what has happened")
        are_known = facts.keys() == known.keys() and all(one is known[key] for key, one in facts.items())
        if not are_known or values.agent_facts:
            raise NeedsTurnEngine("it publishes facts")
        if block.heading != self._heading:
            raise NeedsTurnEngine("it turns agents")
        if self._ctx.graph.storage.has_placed or (not self._could_draw and self._ctx.rng_state() is not None):
            raise NeedsTurnEngine("it draws from ctx.graph.place or from ctx.rng, which was drawn from before the game")
        if values.scores != scores and not all(map(_fits_float, values.scores.values())):
            raise NeedsTurnEngine("it sets scores that are no numbers")
        if any(isinstance(one, _Unknown) for event in values.events[num_events:] for one in event.values()):
            raise NeedsTurnEngine("it passes on what it does not know")

    def _refuse_what_detaches(self) -> None:
        """Refuse what lets this game leave the arrays."""
        if self._ctx.graph.obstacle_revision != self._map[1]:
            raise LeavesArrays("it changes the obstacles")
        if self._block.structure_version != self._structure and self._equipment() != self._equipped:
            raise LeavesArrays("agents come or go, or get other teams, speeds or sensors")


class _Unknown(dict[Any, Any]):
    """What arrays do not have: a rule that looks at it needs the turn engine.

    Args:
        notes: gets what was looked at.
        what: it is, for messages.
    """

    def __init__(self, notes: list[str], what: str) -> None:
        super().__init__()
        self._notes, self._what = notes, what

    def _refuse(self, *_: object, **__: object) -> NoReturn:
        self._notes.append(f"it needs {self._what}")
        raise NeedsTurnEngine(self._notes[-1])

    __bool__ = __contains__ = __delitem__ = __eq__ = __getitem__ = __iter__ = __len__ = __ne__ = __or__ = __ror__ = (
        __setitem__
    ) = _refuse
    clear = copy = get = items = keys = pop = popitem = setdefault = update = values = _refuse


class _OfSlots(_Unknown):
    """What slots of the turn engine have a part of: how often agents moved, what they remember and learn."""

    def __bool__(self) -> bool:  # type: ignore[override] # alone of all that refuse
        """Whether there is any: slots ask for it."""
        return True

    def setdefault(self, _: object, default: object = None) -> Any:  # type: ignore[override] # likewise
        """Return what a slot is to have."""
        return default


def _is_of(keys: Sequence[str], key: object, value: object) -> bool:
    """Whether an entry of `ctx.game.data` is that of rules of these keys: by its own, or with theirs in it."""
    return key in keys or (isinstance(value, dict) and any(one in value for one in keys))


def _fits_float(score: object) -> bool:
    return isinstance(score, float) or (isinstance(score, int) and abs(score) <= _MOST_EXACT)


def _global_random() -> tuple[Any, ...]:
    """Return the states of `random` and `numpy.random`."""
    state: Any = np.random.get_state(legacy=False)  # noqa: NPY002 - what rules may draw from
    return random.getstate(), state["state"]["pos"], state["state"]["key"].tobytes(), state["has_gauss"]
