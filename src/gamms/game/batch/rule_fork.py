"""A context that is made to have one game of a batch after the other, for rules that have no array form."""

import pickle
from collections.abc import Callable, Mapping, Sequence
from operator import is_
from typing import Any, NamedTuple, NoReturn

import numpy as np

from gamms.deciding import phase_of
from gamms.errors import BadValue, GammsError
from gamms.game.batch.begun import fits_float
from gamms.game.batch.columns import PlayedGame, put_locked
from gamms.game.batch.flights import InAir
from gamms.game.batch.roads import RoadMap
from gamms.game.batch.state import GameArrays
from gamms.game.batch.turn import ArrayTurn
from gamms.game.batch.unknown import NeedsTurnEngine, OfSlots, OfSome, Unknown
from gamms.game.conflicts import TurnConflicts
from gamms.game.legality import ResolvedAction
from gamms.game.moves import Refusals, TurnMoves
from gamms.game.order import TurnOrder
from gamms.game.settings import NamedRule, RuleSpec, as_called, spec_of
from gamms.game.snapshots import SnapshotTaker, Start
from gamms.ir.agents import AgentBlock, Position
from gamms.ir.columns import Selection
from gamms.ir.game_state import GameState
from gamms.ir.graph import IntArray
from gamms.ir.progress import Progress
from gamms.plain import copied, is_same, why_not_plain
from gamms.text import shown
from gamms.typing import IAgent

_MOST_ORDERS = 1000  # sets of living agents of which it is kept what a turn needs of them
Admit = Callable[[IAgent, Sequence[Any]], str | None]
"""Lets arrays have an agent that has come, with its sensors as they are described; or returns why they cannot."""


class LeavesArrays(GammsError):
    """A rule has made of a game what arrays cannot have."""


class NoRow(BadValue):
    """An agent has come for which no row was reserved."""


class OwnState(NamedTuple):
    """What one game has beside the arrays, between two calls of its rules.

    Attributes:
        data: `ctx.game.data`.
        attributes: those of agents, in the order of the rows; None: those at the beginning of that cast.
        rng: the state of `ctx.rng`; None: nothing was drawn from it.
        came: the names of the agents that have come since the start, in their order.
    """

    data: dict[str, Any]
    attributes: list[dict[str, Any]] | None
    rng: Any
    came: tuple[str, ...] = ()


class GameColumns(NamedTuple):
    """Some games of a turn as lists: of each game the values of its agents."""

    turns: list[int]
    node: list[list[int]]  # in the order of the rows, as the next four
    previous: list[list[int]]
    alive: list[list[bool]]
    took_part: list[list[bool]]
    placed: list[list[bool]]
    names_took_part: list[list[bool]]  # in the order of the names, as what follows
    starts: list[list[int]]
    ends: list[list[int]]
    began: list[list[int]]  # of the agents of the start
    progress: list[dict[int, Progress]]  # by row
    in_air: list[dict[int, InAir]]  # by row, those that fly
    began_in_air: list[dict[str, Position]]  # by name, likewise
    actions: list[dict[int, ResolvedAction]]  # of agents that go otherwise than along one edge, or do something
    scores: list[dict[Any, Any]]


class _Cast(NamedTuple):
    """Who plays in a game, the agents of the start and some that have come, as they were when the last one came."""

    agents: Any  # the agent engine's own class
    sensors: Any  # likewise
    attributes: list[dict[str, Any]]  # of the agents, in the order of the rows


class RuleFork:
    """A fork of the game of a batch, and how it is made to have another game.

    Attributes:
        functions: the rules, by name.
        number: agent -> its number in the roster.
        rows: (agents,) of each row of the block, the number of its agent in the roster.
        came: the names of the agents that have come, of the cast that it has.
        casting: how often it got another cast.
        ctx, game, parts: its context, its game and the parts of that.
        notes: what was looked at that arrays do not have.
        changed_map_by: the first of the rules that were called which changed the map, in words; None: none.
        calling: the rule that is being called, or has done what is being refused, in words; None: something else is.
    """

    calling: str | None = None
    changed_map_by: str | None = None

    def __init__(self, game: PlayedGame, state: GameArrays, admit: Admit) -> None:
        fork = game.fork(0)
        self._state, self._admit, self.game, self.ctx = state, admit, fork, fork.ctx
        self.parts: SnapshotTaker = fork.internals.parts
        self._values: GameState = self.parts.state
        self._conflicts = TurnConflicts()
        self.functions = {one.name: one.rule for one in (*fork.rules, *as_called(fork.rules))}
        self.number = {name: i for i, name in enumerate(state.roster.names)}
        named = zip(state.roster.names, state.roster.is_first.tolist(), strict=True)
        # those that come later began where they are
        self._first_names = [name for name, is_one in named if is_one]
        self._could_draw, self._nothing_collected = game.ctx.rng_state() is None, self.parts.collectors.snapshot()
        self._collected_before = self.parts.collectors.tables()
        self._phase, self.notes = phase_of(self.ctx), list[str]()
        self._begin(game)
        self.casting = 0
        self._gather(())
        self._know_attributes([copied(own) for own in self._attributes])
        self._casts: dict[tuple[str, ...], _Cast] = {(): self._cast()}
        self._map, self._obstacles = self.ctx.graph.storage.snapshot(), self.ctx.graph.obstacle_revision
        self._shown: RoadMap | None = None  # whose roads are open
        self._show(None)
        self._loaded: tuple[Any, ...] = ()
        self._brought_by: str | None = None  # the first of the rules that were called which let agents come, in words
        self._at: tuple[int, int, GameColumns]  # what was loaded, as the next one
        self._own: OwnState

    def _begin(self, game: PlayedGame) -> None:
        """Let the game be in the middle of a turn, and note what rules look at that arrays do not have."""
        values, ctx = self._values, self.ctx
        values.start = Start(self.game.snapshot(), ctx.rng_state(), (ctx.seed, ctx.rng_state()))
        values.has_begun, values.last_turn = True, self.game.settings()["max_turns"]
        self.parts.turns.is_playing = True
        self.game.internals.after_reset.append(lambda: self.notes.append("it resets the game"))
        keys = [spec.key for spec in self.specs_in_arrays if spec.key is not None]
        self._first_data = {
            key: self.unknown(f"ctx.game.data[{key!r}] of a rule in arrays") if _is_of(keys, key, value) else value
            for key, value in values.data.items()
        } | {key: self.unknown(f"ctx.game.data[{key!r}] of a rule in arrays") for key in keys}
        self._facts_at_start = dict(game.facts)
        values.counts = OfSlots(self.notes, "ctx.game.counts")
        values.memories = OfSlots(self.notes, "ctx.game.memories")
        values.team_memories = self.unknown("ctx.game.team_memories, or what an agent observes,")
        self._private_at_start = values.agent_facts, values.team_facts
        if values.team_facts:
            values.team_facts = OfSome(self.notes, "what is published to teams")
        if values.agent_facts:
            values.agent_facts = OfSome(self.notes, "what is published to agents")
        self._looks = self.unknown("what agents have sensed")
        self._last_moves = self.unknown("ctx.game.moves while agents decide")

    def _gather(self, came: tuple[str, ...]) -> None:
        """Take the agents that there are."""
        self.came, self._block, self.casting = came, self.ctx.agent.block, self.casting + 1
        self._agents = [self.ctx.agent.agents[name] for name in self._block.names]
        self.rows = np.array([self.number[name] for name in self._block.names], np.int64)
        self._row_of = {number: row for row, number in enumerate(self.rows.tolist())}
        self._attributes = [vars(agent) for agent in self._agents]
        self._are_plain = not any(why_not_plain(own) for own in self._attributes)  # so that they can be compared
        self._last_attributes: list[dict[str, Any]] | None = None
        access = [self.ctx.agent.storage.turn_access(agent) for agent in self._agents]
        self._held = [one.last for one in access] + [last for one in access for _, last, *_ in one.carried]
        self._heading, self._all = list(self._block.heading), Selection(list(range(len(self.rows))))
        self._orders: dict[tuple[bool, ...], TurnOrder] = {}  # by which agents live
        self._equipped, self._sensors = self._equipment(), self.ctx.sensor.storage.described()
        self._fixed = self._what_is_fixed()

    def _cast(self) -> _Cast:
        attributes = [copied(vars(agent)) for agent in self.ctx.agent.agents.values()]
        return _Cast(self.ctx.agent.storage.snapshot(), self.ctx.sensor.storage.snapshot(), attributes)

    def stand(self, came: tuple[str, ...]) -> None:
        """Have the agents of the start, and these that have come."""
        if came != self.came:
            cast = self._casts[came]
            self._values.delayed_looks = {}  # those that sensors forget; each game has its own
            self.ctx.agent.storage.restore(cast.agents)
            self.ctx.sensor.storage.restore(cast.sensors, forget=True)
            self._gather(came)
            self._know_attributes(cast.attributes)

    def has_recovered(self) -> bool:
        """Have agents, sensors and the map again as they were before an error; return whether all else is so, too."""
        came, known = self.came, (self._fixed, self._sensors, self._heading)
        self.came = ("",)  # none has this name: all is restored
        self.ctx.graph.storage.restore(self._map)
        self._show(None)
        self._obstacles = self.ctx.graph.obstacle_revision
        self.stand(came)
        return not self.notes and known == (self._fixed, self._sensors, self._heading)

    # -- agents that are asked in it --------------------------------------------------------------------------------

    @property
    def rank(self) -> IntArray:
        """(agents of the roster,) the row of each in the block, in whose order sensors show those of the start."""
        found = np.full(len(self.number), len(self.rows))
        found[self.rows] = np.arange(len(self.rows))
        return found

    def in_order(self, seen: dict[str, int]) -> dict[str, int]:
        """Return what a sensor shows in the order of the block, given in that of the agents of the start."""
        if not self.came:
            return seen
        row_of = self._block.row_of
        return dict(sorted(seen.items(), key=lambda one: row_of(one[0])))

    def continue_looks(self, state: GameState, sensors: Sequence[tuple[int, Any]], counts: IntArray) -> None:
        """Let sensors look as those of agents do that have looked so often in this turn, (agents,), of such a game."""
        self._values.delayed_looks = state.delayed_looks
        for number, sensor in sensors:
            sensor.notice.continue_from(self._state.roster.names[number], state.turn, counts.item(number))

    @property
    def specs_in_arrays(self) -> list[RuleSpec]:
        """What the rules that have array forms say about themselves."""
        return [one.spec for one in as_called(self.game.rules) if one.spec.array_form is not None]

    @property
    def facts(self) -> dict[str, Any]:
        """What was published to all, and does not change while there are only array forms."""
        self._know_facts()
        return dict(self._values.facts)

    @property
    def private_facts(self) -> tuple[dict[str, dict[str, Any]], dict[Any, dict[str, Any]]]:
        """What was published to agents and to teams, likewise."""
        changing = {name: value for name, value in self._facts.items() if isinstance(value, Unknown)}
        found: list[Any] = [
            {to: {name: changing.get(name, value) for name, value in known.items()} for to, known in those.items()}
            for those in self._private_at_start
        ]
        return found[0], found[1]

    def raise_notes(self) -> None:
        """Raise why a game needs the turn engine, if what was called has looked at what arrays do not have."""
        if self.notes:
            raise NeedsTurnEngine(self.notes[-1])

    def refuse(self, what: str) -> NoReturn:
        """Refuse what strategies do that no game in arrays can."""
        self.notes.append(what)
        raise NeedsTurnEngine(what)

    def unknown(self, what: str) -> Any:
        """Return what stands for what arrays do not have."""
        return Unknown(self.notes, what)

    def first_state(self) -> OwnState:
        """Return what a game has beside the arrays at its start."""
        data = {key: one if isinstance(one, Unknown) else copied(one) for key, one in self._first_data.items()}
        return OwnState(data, None if self._are_plain else [copied(one) for one in self._casts[()].attributes], None)

    def put_flyers(self, places: Mapping[int, InAir]) -> None:
        """Have agents that fly, by their numbers in the roster, in these places."""
        for number, place in places.items():
            self._put_flyer(self._row_of[number], place)

    def _put_flyer(self, row: int, place: InAir) -> None:
        before, position, quat = place
        self._block.write(row, {"previous_position": before, "position": position, "quat": quat})

    # -- from arrays and back ---------------------------------------------------------------------------------------

    def load(self, at: int, game: int, own: OwnState, columns: GameColumns, phase: str) -> None:
        """Have a game as it is now: the one at this place in the columns."""
        state, values, block, turns = self._state, self._values, self._block, self.parts.turns
        self._at, self._own = (at, game, columns), own
        turns.is_moving, turns.refusals = phase not in ("before", "after"), None
        values.turn = columns.turns[at]
        self.ctx.reseed(state.seeds[game], own.rng)
        if phase == "decide":
            values.moves = self._last_moves if values.turn else None
        else:
            self._set_alive(columns.took_part[at])
            values.moves = None if phase == "before" and not values.turn else self._moves(at, columns)
        self._set_alive(columns.alive[at])
        block.placed = {row for row, is_placed in enumerate(columns.placed[at]) if is_placed}
        for row, place in columns.in_air[at].items():
            self._put_flyer(row, place)
        block.move_all(self._all, columns.node[at])
        self._all.write(block.previous, columns.previous[at])
        for name, column in state.numbers.items():
            self._all.write(getattr(block, name), column[game, self.rows].tolist())
        for row in {*columns.progress[at], *_on_edges(block)}:
            block.set_progress(row, columns.progress[at].get(row))
        values.began = dict(zip(self._first_names, columns.began[at], strict=True)) | columns.began_in_air[at]
        values.events, values.errors = state.events.of(game), state.errors[game]
        values.deeds = state.deeds.of(game)
        values.messages = [] if state.radio is None else state.radio.of(game)
        values.over, values.data, scores = state.over[game], own.data, columns.scores[at]
        values.scores.clear()
        dict.update(values.scores, scores)  # which arrays have checked
        self._know_facts()
        self._set_attributes(own.attributes)
        for held in self._held:
            if held[0] is not self._looks:
                held[0] = self._looks
        self._loaded = columns.node[at], columns.previous[at], columns.alive[at], len(values.events), scores
        self._structure, self._counted = block.structure.version, self._what_is_counted()

    def _set_alive(self, alive: list[bool]) -> None:
        for row, (is_now, was) in enumerate(zip(alive, self._block.alive.tolist(), strict=True)):
            if is_now != was:
                self._block.set(row, "alive", is_now)

    def _moves(self, at: int, columns: GameColumns) -> TurnMoves:
        """Return the moves of a turn."""
        took_part, starts, ends = columns.names_took_part[at], columns.starts[at], columns.ends[at]
        actions = columns.actions[at]
        if not all(took_part):
            members = [number for number, is_there in enumerate(took_part) if is_there]
            starts, ends = [starts[number] for number in members], [ends[number] for number in members]
            actions = {i: actions[number] for i, number in enumerate(members) if number in actions}
        living = tuple(took_part)
        order = self._orders.get(living)
        if order is None:
            if len(self._orders) >= _MOST_ORDERS:
                self._orders.clear()
            order = self._orders[living] = self.parts.turns.order()
        return TurnMoves(order, starts, ends, actions)

    def _know_facts(self) -> None:
        """Have the facts of the start; those that array forms publish are not known."""
        facts, first = self._values.facts, self._facts_at_start
        facts.clear()
        for name, value in self._state.facts.items():
            is_same = name in first and first[name] is value
            facts[name] = value if is_same else self.unknown(f"the fact {name!r} of a rule in arrays")
        self._facts = dict(facts)

    def _set_attributes(self, attributes: list[dict[str, Any]] | None) -> None:
        """Give the agents their attributes; None: those at the beginning of the cast."""
        if attributes is not None or self._last_attributes is not None:
            new = [copied(one) for one in self._first_attributes] if attributes is None else attributes
            for own, values in zip(self._attributes, new, strict=True):
                own.clear()
                own.update(values)
            self._last_attributes = attributes

    def _know_attributes(self, first: list[dict[str, Any]]) -> None:
        self._first_attributes, self._pickled_first = first, _pickled(first)

    def _attributes_now(self) -> list[dict[str, Any]] | None:
        """Return the attributes of the agents; None: those at the beginning of the cast."""
        # NOTE: what has the same bytes is the same, found in an eighth of the time (benchmarks: a plain rule).
        if self._are_plain and (
            (self._pickled_first and _pickled(self._attributes) == self._pickled_first)
            or is_same(self._attributes, self._first_attributes)
        ):
            return None
        self._last_attributes = [own.copy() for own in self._attributes]
        return self._last_attributes

    # -- what is called -----------------------------------------------------------------------------------------------

    def forget_calls(self) -> None:
        """Forget which rules were called in another game, or in another turn."""
        self.calling = self.changed_map_by = self._brought_by = None

    def call(self, rules: Sequence[NamedRule]) -> None:
        """Call rules in the game that was loaded."""
        for named in rules:
            if self.calling is not None:  # one was called before, whose doing this is
                self._refuse_changes(has_come=bool(self._newcomers()))
            self.calling = f"the rule {named.name!r}"
            if named.phase != "before" or self._values.over is None:
                self.functions[named.name](self.ctx)
            if self._brought_by is None and self._newcomers():
                self._brought_by = self.calling
            if self.changed_map_by is None and self.ctx.graph.storage.has_other_roads() is not False:
                self.changed_map_by = self.calling

    def collect(self) -> None:
        """Collect what is due in the game that was loaded."""
        collectors, found = self.parts.collectors, self._state.collected.setdefault(self._at[1], {})
        collectors.collect(self._values.turn, self.ctx, lambda: self.game.agents)
        for name, table in collectors.tables().items():
            known = len(self._collected_before[name]["turn"])
            for column, values in table.items():
                found.setdefault(name, {}).setdefault(column, []).extend(values[known:])
        collectors.restore(self._nothing_collected)

    def refusals(self, named: NamedRule) -> Refusals:
        """Return what the check of a rule refuses."""
        refusals = self.parts.turns.refusals = Refusals(self._values.moves)
        check: Any = spec_of(self.functions[named.name]).check  # it has one
        check(self.ctx)
        self.parts.turns.refusals = None
        return refusals

    def losers(self) -> list[str]:
        """Return the agents that the conflict resolver stops."""
        moves, conflicts = self._values.moves, self.game.settings()["conflicts"]
        losers = self._conflicts.losers(conflicts, moves.order, moves.places(), moves.named, self.ctx)
        block = self._block
        if tuple(one.tolist() for one in (block.node, block.previous, block.alive)) != self._loaded[:3]:
            raise LeavesArrays("it moves agents")
        return [moves.slots[i].name for i in losers]

    def taken(self, at: int, turn: ArrayTurn) -> OwnState:
        """Write what was called has changed into a turn, and return what else the game has."""
        values, came = self._values, self._newcomers()
        self._refuse_changes(has_come=bool(came))
        self.calling = self._brought_by if came else self.calling
        for name in came:
            self._refuse_newcomer(self.ctx.agent.agents[name])
        self._write(at, turn, came)
        if not came:
            own = OwnState(values.data, self._attributes_now(), self.ctx.rng_state(), self.came)
            return self._own if all(map(is_, own, self._own)) else own
        key = self.came + came
        if key not in self._casts:
            self._casts[key] = self._cast()
        own = OwnState(values.data, self._cast().attributes, self.ctx.rng_state(), key)
        known, self.came = self.came, key
        self.stand(known)
        return own

    def _write(self, at: int, turn: ArrayTurn, came: tuple[str, ...]) -> None:
        """Write what has changed into the arrays."""
        state, values, block, (i, game, columns) = self._state, self._values, self.ctx.agent.block, self._at
        node, previous, alive, num_events, scores = self._loaded
        self._write_flyers(game, columns.in_air[i], came)
        headings = state.headings
        assert headings is not None  # noqa: S101 - there are such rules
        rows = self.rows
        if came:
            new = [self.number[name] for name in came]
            rows = np.append(rows, np.array(new, np.int64))
            state.is_there[game, new] = True
        for before, now, column, row in (
            (node, block.node.tolist(), turn.node, at),
            (previous, block.previous.tolist(), headings.previous, game),
        ):
            if now != before:
                put_locked(column, (row, rows), turn.streets.rows(now))
        if block.alive.tolist() != alive:
            put_locked(turn.alive, (at, rows), block.alive.tolist())
        state.placed[game, rows] = [row in block.placed for row in range(len(rows))]
        for name, numbers in state.numbers.items():
            numbers[game, rows] = getattr(block, name)
        left = [row for row in columns.progress[i] if block.progress[row] is None]
        if left:
            state.movement.clear(game, self.rows[left])
        if len(values.events) > num_events:
            state.note_events(game, values.events[num_events:])
        if values.over is not state.over[game]:
            state.over[game] = values.over
            state.is_going[game] = values.over is None
        if values.scores != scores:
            state.scores.put(game, values.scores)

    def _write_flyers(self, game: int, known: Mapping[int, InAir], came: Sequence[str]) -> None:
        """Write where agents are that fly and were put elsewhere, or have come."""
        block, flyers = self._block, self._state.flyers
        if flyers is not None:
            block.locate()
            for row in [*known, *map(block.row_of, came)]:
                now: Any = block.previous_position[row], block.position[row], block.quat[row]
                if now[1] is not None and now != known.get(row):
                    flyers.put(game, self.number[block.names[row]], now)

    # -- what arrays do not have ------------------------------------------------------------------------------------

    def _newcomers(self) -> tuple[str, ...]:
        """Return the names of the agents that have come since the game was loaded."""
        if self._block.structure.version == self._structure and self.ctx.agent.block is self._block:
            return ()
        return tuple(self.ctx.agent.block.names[len(self.rows) :])

    def _refuse_newcomer(self, agent: IAgent) -> None:
        """Refuse an agent for which there is no row, or that arrays cannot have."""
        number = self.number.get(agent.name)
        if number is None or self._state.roster.is_first[number]:
            roster, team = self._state.roster, agent.team
            listed = [name for name, is_one in zip(roster.names, roster.is_first, strict=True) if not is_one]
            size = len(roster.members(team)) if team in roster.teams else 0
            raise NoRow(
                f"Agent {shown(agent.name)} of team {shown(team)} has come, for which no row is reserved: "
                f"{'only for ' + ', '.join(listed) if listed else 'there is none'}. Make the batch with "
                f"most_agents={{{team!r}: {size + 1}}} and name the agent {team}_{size}, or with its name: "
                f"most_agents={{{team!r}: [{agent.name!r}]}}."
            )
        described = {one["id"]: one for one in self.ctx.sensor.storage.described()}
        sensors = [(name, described.get(one.sensor_id)) for name, one in agent.sensors.items()]
        why = self._admit(agent, sensors)
        if self._block.heading[self._block.row_of(agent.name)] is not None:
            why = f"agent {agent.name!r} comes turned"
        if why is not None:
            raise LeavesArrays(why)

    def _what_is_fixed(self) -> tuple[Any, ...]:
        """Return what only the turn engine can change, as numbers and objects."""
        parts = self.parts
        return self._phase.setting_changes, parts.rules.rules, parts.collectors.tables(), self.ctx.is_terminated()

    def _what_is_counted(self) -> tuple[int, int, int]:
        """Return how often sensors and strategies were changed, which agents that come change, too."""
        return self._phase.sensor_changes, self._phase.owner_changes, self._phase.strategy_changes

    def _equipment(self) -> list[Any]:
        """Return what agents are and carry."""
        block = self.ctx.agent.block
        columns = zip(block.names, block.teams, block.speed, self.ctx.agent.agents.values(), strict=True)
        return [(*values, agent.strategy, list(agent.sensors.items())) for *values, agent in columns]

    def show_roads(self, roads: RoadMap | None) -> None:
        """Have the roads open that are open in a game; None: those of the start."""
        if roads is not self._shown:
            self._show(roads)

    def _show(self, roads: RoadMap | None) -> None:
        storage, self._shown = self.ctx.graph.storage, roads
        if roads is None:
            storage.restore_when_read(self._map, None, {})
        else:
            storage.restore_when_read(self._map, roads.columns, roads.closed)

    def taken_roads(self) -> tuple[IntArray, Any] | None:
        """Return the edges that rules have left open, in their order, and the closed ones; None: as they were."""
        storage = self.ctx.graph.storage
        has_changed = storage.has_other_roads()
        if has_changed is False:
            return None
        self.calling = self.changed_map_by or self.calling
        if has_changed is None:
            self._show(self._shown)
            raise LeavesArrays("it changes more of the map than which roads are closed")
        edges, closed = storage.roads()
        found = edges.copy(), closed
        self._show(self._shown)
        return found

    def _refuse_changes(self, *, has_come: bool) -> None:
        """Refuse what cannot be written into arrays."""
        values, block, (i, _, columns) = self._values, self.ctx.agent.block, self._at
        scores, num_events = self._loaded[4], self._loaded[3]
        if self.notes:
            raise NeedsTurnEngine("; ".join(self.notes))
        self._refuse_what_detaches()
        sensors = self.ctx.sensor.storage.described()[: len(self._sensors)] if has_come else self._sensors
        is_same = sensors == self._sensors if has_come else self._what_is_counted() == self._counted
        if self._what_is_fixed() != self._fixed or not is_same:
            raise NeedsTurnEngine("it changes settings, rules, sensors, strategies or collectors")
        if values.turn != columns.turns[i] or len(values.events) < num_events:
            raise NeedsTurnEngine("it changes what has happened")
        if self._has_published():
            raise NeedsTurnEngine("it publishes facts")
        if block.heading != self._heading and block.heading[: len(self._heading)] != self._heading:
            raise NeedsTurnEngine("it turns agents")
        if self.ctx.graph.storage.has_placed or (not self._could_draw and self.ctx.rng_state() is not None):
            raise NeedsTurnEngine("it draws from ctx.graph.place or from ctx.rng, which was drawn from before the game")
        if values.scores != scores and not all(map(fits_float, values.scores.values())):
            raise NeedsTurnEngine("it sets scores that are no numbers")
        if any(isinstance(one, Unknown) for event in values.events[num_events:] for one in event.values()):
            raise NeedsTurnEngine("it passes on what it does not know")
        if not _on_edges(block).items() <= columns.progress[i].items():
            raise LeavesArrays("it puts agents on edges")

    def _has_published(self) -> bool:
        """Whether a rule has published facts, or taken some back."""
        values, facts, known = self._values, self._values.facts, self._facts
        if facts.keys() != known.keys() or any(one is not known[key] for key, one in facts.items()):
            return True
        return any(one and not isinstance(one, Unknown) for one in (values.agent_facts, values.team_facts))

    def _refuse_what_detaches(self) -> None:
        """Refuse what lets this game leave the arrays."""
        if self.ctx.graph.obstacle_revision != self._obstacles:
            raise LeavesArrays("it changes the obstacles")
        block = self.ctx.agent.block
        is_same = block is self._block and block.structure.version == self._structure and not block.has_teams
        if not is_same and self._equipment()[: len(self._equipped)] != self._equipped:
            raise LeavesArrays("agents go, or get other teams, speeds or sensors")


def _on_edges(block: AgentBlock) -> dict[int, Progress]:
    """Return where on edges agents are, by row."""
    column = block.progress  # most often there is no one
    return {} if column.count(None) == len(column) else {i: one for i, one in enumerate(column) if one is not None}


def _pickled(attributes: list[dict[str, Any]]) -> bytes:
    """Return attributes as bytes, none where they cannot be; what is equal may have others."""
    try:
        return pickle.dumps(attributes)
    except Exception:  # noqa: BLE001 - a rule may have set anything
        return b""


def _is_of(keys: Sequence[str], key: object, value: object) -> bool:
    """Whether an entry of `ctx.game.data` is that of rules of these keys: by its own, or with theirs in it."""
    return key in keys or (isinstance(value, dict) and any(one in value for one in keys))
