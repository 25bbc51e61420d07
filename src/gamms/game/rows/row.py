"""A game of a batch in a context of its own: what functions read is read there, and their changes are taken from it."""

from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from sys import getrefcount
from typing import Any, NamedTuple, NoReturn

import numpy as np

from gamms.core.copies import copy_deep, refill
from gamms.core.rows import Call, Row, RowColumns
from gamms.deciding import UNKNOWN_LOOK, UnknownLook, get_phase
from gamms.errors import BadValue
from gamms.game.block.columns import PlayedGame
from gamms.game.block.in_core import CoreGames
from gamms.game.block.state import STOPPED, Arrays, GameArrays, GameRow, Heading, is_exact_float
from gamms.game.block.strategy_steps import begin_steps, can_read
from gamms.game.lasting import copy_doing, put_doing
from gamms.game.messages import MessageTraffic
from gamms.game.movement.courses import Courses
from gamms.game.movement.moves import TurnMoves
from gamms.game.movement.roads import RoadMap
from gamms.game.movement.travel import ResolvedAction
from gamms.game.order import TurnOrder, TurnPart
from gamms.game.plan import RowPlan
from gamms.game.rows.state import RowStart, RowState, get_data, get_driven, get_memories, get_moves
from gamms.game.settings import RuleSpec, RuleTable
from gamms.game.slots import COUNTED
from gamms.game.snapshots import ForkSource, GameStart, Snapshot, copy_rules
from gamms.game.strategy_specs import Same, get_strategy_spec, make_form_key
from gamms.game.turn import TurnEngine
from gamms.ir.agents import AgentBlock, as_ids, get_speed, show_column, show_flights, show_lives, show_progress
from gamms.ir.events import (
    AERIAL_AGENT_FLIGHT,
    AERIAL_AGENT_TURN,
    AGENT_CREATE,
    AGENT_DELETE,
    AGENT_SENSOR_DEREGISTER,
    AGENT_SENSOR_REGISTER,
)
from gamms.ir.game_state import KEPT, BlockedAgents, GameState, Scores, describe_conflict
from gamms.ir.graph import IntArray
from gamms.ir.journal import PLAIN, Journal, JournalOfRow
from gamms.ir.obstacles import BoolArray
from gamms.ir.schema import CHANGE_EVENTS, NUMBERS, Memo
from gamms.typing.agent_engine import DeletedAgent
from gamms.typing.context import HostContext

_OF_SLOT = 2  # references to an object in a slot, that of the argument included
_NUMBERS = {column.name: CHANGE_EVENTS[column.name].code for column in NUMBERS}
_CHANGING = {CHANGE_EVENTS[name].code for name in ("node", "previous", "alive", *_NUMBERS)}
_OF_PLANS = {"conflicts", "max_turns", "plans"}  # settings that a function may change and stay in the batch
_EQUIPPING = {AGENT_CREATE, AGENT_DELETE, AGENT_SENSOR_REGISTER, AGENT_SENSOR_DEREGISTER}
_TURNED = CHANGE_EVENTS["heading"].code
_MOVED = -1  # the kind of a move, which is noted as two numbers
_CHANGING |= {_MOVED, AERIAL_AGENT_FLIGHT, AERIAL_AGENT_TURN, _TURNED}


class AskedPart(NamedTuple):
    """Agents that are asked, some of which may be dead.

    Attributes:
        order: the order of all agents.
        part: the living ones, as a part of a turn.
        places: the slot of each agent; -1: it is dead.
        members: the slots and names of the living ones.
        given: the same of agents that get their states, too, but have actions from outside.
    """

    order: TurnOrder
    part: TurnPart
    places: list[int]
    members: list[tuple[int, str]]
    given: list[tuple[int, str]]


class PhaseCall(Call):
    """The phase of a turn in which functions are called.

    Attributes:
        moving_part: the part of the turn in which agents are about to move; None: they are not.
        have_joined: whether agents created in this part of the turn take part in it.
        may_change: whether functions may change what belongs to the plan.
    """

    def __init__(self) -> None:
        super().__init__()
        self.moving_part: int | None = None
        self.have_joined = False
        self.may_change = False

    def begin(
        self,
        part: int | None,
        *,
        is_moving: bool,
        may_change: bool = False,
        have_joined: bool = False,
    ) -> None:
        """Begin to call functions."""
        self.may_change = may_change
        self.moving_part = part
        self.is_moving = is_moving
        self.have_joined = have_joined

    def end(self) -> None:
        """End to call functions."""
        self.begin(None, is_moving=False)


class RowMeans(NamedTuple):
    """What all games of a batch on one map share.

    Attributes:
        state: the state of all games.
        core: plays the games in the core.
        plan: what the games share.
        start: the state of a game at its start.
        call: the phase of the turn in which functions are called.
        columns: the columns of all games that contexts show.
        number_of: name -> the number of the agent in the roster.
        at_rest: a game at its start.
        turns: its turn engine, whose event loop awaits the answers of all games.
    """

    state: GameArrays
    core: CoreGames
    plan: RowPlan
    start: GameState
    call: PhaseCall
    columns: RowColumns
    number_of: Mapping[str, int]
    at_rest: Snapshot
    turns: TurnEngine


class PlanTerms(NamedTuple):
    """The settings, rules, collectors, strategies and sensors of a game that follows a plan.

    Attributes:
        means: what the games that follow the plan share.
        settings: the settings.
        rules: the rules.
        collectors: name -> the collector.
        equipment: name -> the strategy and the sensors of each agent of the start.
        sensors: the settings of the sensors that these agents carry, by the `id` of the sensor.
        functions: the function of each rule, by the name under which it is called.
    """

    means: RowMeans
    settings: Mapping[str, Any]
    rules: RuleTable
    collectors: Mapping[str, Any]
    equipment: Mapping[str, tuple[Any, Any]]
    sensors: Mapping[int, dict[str, Any] | None]
    functions: Mapping[str, Callable[..., object]]

    def list_changed(self, before: "PlanTerms") -> list[str]:
        """Return the agents whose strategies or sensors are not those of earlier terms."""
        return [name for name, own in self.equipment.items() if before.equipment.get(name) != own]

    def have_changed_sensors(self, before: "PlanTerms") -> bool:
        """Return whether sensors have other settings than in earlier terms, or did not exist then."""
        return any(before.sensors.get(one) != now for one, now in self.sensors.items())

    def make_key(self, first: "PlanTerms") -> Hashable:
        """Return what plans of games with the same start differ by: those with equal keys are one plan.

        Args:
            first: the terms of the game at its start.
        """
        own = [(name, *self.equipment[name]) for name in self.list_changed(first)]
        are_others = [sensors != first.equipment[name][1] for name, _, sensors in own]
        have_other_sensors = any(are_others) or self.have_changed_sensors(first)
        plans = [(team, _identify(plan.function), plan.arrays) for team, plan in self.settings["plans"].items()]
        rules = [(one, one.spec) for one in self.rules.rules]
        return (
            (Same(self.settings["conflicts"]), self.settings["max_turns"], tuple(plans)),
            tuple((one.name, one.phase, _identify(one.rule, spec.core_form, spec.array_form)) for one, spec in rules),
            tuple((name, one.every, one.per, Same(one.fn)) for name, one in self.collectors.items()),
            frozenset((name, _identify(strategy)) for name, strategy, _ in own),
            Same(self.equipment) if have_other_sensors else None,
        )


class Members:
    """The agents of a game at a time, with their sensors.

    Args:
        game: the game.
        means: what all games share.
        before: the agents at an earlier time; None: these are those of the start.

    Attributes:
        agents, sensors: the agents and the sensors.
        block: the block of the agents.
        numbers: the number in the roster of each agent, by row.
        have_come: these numbers, and those of agents that were deleted before.
        flying: the numbers in the roster of its flying agents.
        rows_in_air: the rows of its flying agents.
        first_headings: the default headings of agents, by row.
        journal: records the changes of functions.
        departure: the last agent that was deleted before.
        terms: the team and the speed of each agent, by row.
        lasts: the lists with the last states of agents, and the last data of sensors; see `list_last_states`.
        notices: the detection models of sensors that count their looks, of agents that observe.
        counting: each sensor that counts its looks, and its owners.
        sees_world_only: whether all sensors that are called look only at the graph and the agents.
        are_plain: whether this holds, and repeated calls in a turn return the same data.
        order: the order of these agents, if it was made after others have come; else None.
    """

    order: TurnOrder | None = None

    def __init__(self, game: PlayedGame, means: RowMeans, before: "Members | None" = None) -> None:
        storage = game.ctx.agent.storage
        self.agents = storage.share()
        self.sensors = game.ctx.sensor.storage.share()
        self.block: AgentBlock = self.agents.block
        self.numbers: IntArray = np.array([means.number_of[name] for name in self.block.names], np.int64)
        self.have_come: set[int] = {*self.numbers.tolist(), *(() if before is None else before.have_come)}
        row_of = {number: row for row, number in enumerate(self.numbers.tolist())}
        self.flying = [number for number in means.state.flyers.tolist() if number in row_of]
        self.rows_in_air = [row_of[number] for number in self.flying]
        known = {} if before is None else dict(zip(before.agents.members, before.first_headings, strict=True))
        now = zip(self.agents.members, self.block.heading, strict=True)
        self.first_headings: list[Heading] = [known.get(agent, heading) for agent, heading in now]
        self.journal = self.renew_journal()
        self.departure: DeletedAgent = storage.last_departure
        self.terms = [_get_terms(self.block, row) for row in range(len(self.block))]
        self.lasts = _list_last_looks(self.agents.members, storage.get_turn_access)
        self.find_kinds(means)

    def renew_journal(self) -> Journal:
        """Give the block a new journal, and return it."""
        self.journal = JournalOfRow(self.block.names)
        self.block.journal = self.journal
        return self.journal

    def find_kinds(self, means: RowMeans) -> None:
        """Find the kinds of sensors, for the agents that games with these means ask."""
        members = self.agents.members
        owned = [(sensor, agent.name) for agent in members for sensor in agent.sensors.values()]
        sensors = [sensor for sensor, _ in owned]
        looks_in_python = means.plan.is_asked | means.plan.is_observing
        looking = [agent for agent in members if looks_in_python[means.number_of[agent.name]]]
        carried = [sensor for agent in looking for sensor in agent.sensors.values()]
        looks = [(one, one.in_arrays()) for one in sensors if hasattr(one, "in_arrays")]
        counting = {id(one): one.notice for one, look in looks if look is not None and not look.is_plain}
        self.notices = [counting[id(one)] for one in carried if id(one) in counting]
        self.sees_world_only = all(getattr(one, "sees_world_only", False) for one in carried)
        self.are_plain = not counting and all(getattr(one, "sees_world_only", False) for one in sensors)
        owners: dict[int, tuple[Any, list[str]]] = {}
        for sensor, name in owned:
            if id(sensor) in counting:
                owners.setdefault(id(sensor), (sensor, []))[1].append(name)
        self.counting = [*owners.values()]


class RowOfGame(Row):
    """A game of a batch in a context of its own, and what functions change in it.

    If a rule or a collector changes the plan of its game, such as rules or strategies, the game follows another plan
    from there on, see `follow`. If it changes what the columns of all games cannot hold, its game goes on from there in
    columns of its own, with a fork of the context, see `why` and `make_fork`. If a function reads what a batch does not
    keep, it is refused.

    Args:
        game: the game at its start, in the context.
        number: its number.
        means: what all games share.

    Attributes:
        game, ctx: the game and its context.
        number_of: name -> the number of the agent in the roster.
        terms: how the game follows its plan.
        has_other_plan: whether a function has changed what belongs to the plan, see `follow`.
        members: the agents of the game.
        has_first_functions: whether all its functions are those of the start: no copies, which may have changed.
        refusal: why the game cannot go on; None: it can.
    """

    journal: Journal
    turns: TurnEngine
    values: GameState
    _state: GameArrays
    _has_core_data: bool  # whether `ctx.game.data` has the data of rules in the core now

    def __init__(self, game: PlayedGame, number: int, means: RowMeans) -> None:
        parts = game.internals.parts
        values = parts.state
        state = means.state
        self._map = game.ctx.graph.storage
        phase = get_phase(game.ctx)
        turns = parts.turns
        self.seed: int
        of_ctx = vars(game.ctx), state.seeds[number]
        changes = self._map.count_changes
        super().__init__(number, means.columns, means.call, phase, turns, values, *of_ctx, state, changes)
        self.game = game
        self.ctx: Any = game.ctx
        turns.loop_owner = means.turns
        self.number_of = means.number_of
        self.refusal: BadValue | None = None
        self.has_first_functions = False
        self._parts = parts
        self._scores_before: dict[Any, Any] = {}
        self._num_events = self._num_messages = 0  # of those that were read
        self._unknown_look = UnknownLook(self._note_refusal)
        self.look = None
        self.undone = {}
        self._is_data_held = False  # whether functions keep the dict, which then has the data of rules in each call
        self.has_other_plan = False
        self._first_fields = values.start, values.deed_log
        self._drivers = [(agent, state.roster.names[agent]) for agent in np.flatnonzero(means.plan.drives).tolist()]
        self._parts_noted = 0  # of turns; see `drive_on`
        self._first_core_data: dict[str, Any] = {}  # data of rules in the core
        self._core_data: dict[str, Any] = {}  # the same as they are shown
        self._own_arrays: dict[Hashable, Arrays] = {}  # that only functions called in this game keep
        self._core_memories: dict[str, dict[Any, Any]] = {}  # what the core remembers for agents, as above
        self._at_start = parts.take()
        self._moved: tuple[tuple[int, int | None, bool], Members | None] | None = None
        self._asked: tuple[Any, AskedPart] | None = None
        self._order: tuple[TurnOrder, bytes] | None = None
        self._headings: Mapping[int, Heading] = {}
        self._first_map = self._map.snapshot()
        self._first_members: Members | None = Members(game, means)
        self.members = self._first_members
        self._first_facts: dict[str, Any] = {}
        self._first_terms = self._make_terms(means)
        self.terms = self._first_terms
        self._put_terms(self.terms)
        self._begin_game()

    def _begin_game(self) -> None:
        """Begin to show the game, which is at its start in the context."""
        self._note_map(None)
        self._parts_noted = self._count_parts()
        self._begin_state()
        self._show_members()
        self.turns.note_departed()
        self.facts_shown = dict(self._facts)
        self._first_facts = dict(self._facts)
        self.read.clear()
        self._note_epoch()

    def begin_again(self, seed: int, begin: Callable[[PlayedGame], None]) -> None:
        """Begin the game again in the context.

        Args:
            seed: its seed.
            begin: gives the game the values with which it begins, unlike others.
        """
        values = self.values
        self.members.block.journal = PLAIN
        values.__class__ = GameState
        values.start, values.deed_log = self._first_fields
        values.data = {}
        self.seed = seed
        self.game.internals.take_calls(None)
        self.ctx.reseed(seed)
        self._parts.restore(self._at_start, forget=True)
        begin(self.game)
        self._moved = None
        self._asked = None
        self._order = None
        self._own_arrays = {}
        self._first_map = self._map.snapshot()
        if self.members is not self._first_members:
            self.members = self._first_members = Members(self.game, self._first_terms.means)
            self._first_terms = self._make_terms(self._first_terms.means)
        self.members.renew_journal()
        self._put_terms(self._first_terms)
        self._begin_game()

    def _begin_state(self) -> None:
        """Let the state of the context read the columns of all games."""
        values = self.values
        self._has_core_data = False
        self._is_data_held = False
        self._first_core_data = copy_deep(self._get_core_data())
        values.__class__ = RowState
        values.start = RowStart(self, self._means.at_rest)
        values.deed_log = self._state.deed_log
        values.has_begun = True
        asked_names = self._list_asked()
        self.undone = {name: why for name, why in self._means.start.blocked.items() if name in asked_names}
        values.blocked = BlockedAgents()
        if self._state.radio is not None:
            self.turns.read_inbox = partial(self._read_inbox, self._state.radio)

    def _list_asked(self) -> list[str]:
        """Return the names of the agents whose strategies are called, also of those to come."""
        return [self._state.roster.names[number] for number in np.flatnonzero(self._plan.is_asked)]

    @property
    def block(self) -> AgentBlock:
        """The columns of the agents of the context."""
        return self.members.block

    @property
    def _means(self) -> RowMeans:
        return self.terms.means

    @property
    def _core(self) -> CoreGames:
        return self.terms.means.core

    @property
    def _plan(self) -> RowPlan:
        return self.terms.means.plan

    @property
    def _phase_call(self) -> PhaseCall:
        return self._means.call

    def _raise(self, why: str) -> NoReturn:
        """Refuse what a function has done, also if it catches the error; see `raise_refusal`.

        Raises:
            BadValue: always.
        """
        error = BadValue(why)
        self._note_refusal(error)
        raise error

    def _note_refusal(self, error: BadValue) -> None:
        """Note the error that is raised, which a function may catch."""
        self.why = ""
        self.refusal = error

    def raise_refusal(self) -> None:
        """Raise the error with which something was refused last, once.

        Raises:
            BadValue: something was.
        """
        refusal = self.refusal
        self.refusal = None
        if refusal is not None:
            raise refusal

    def refuse_verb(self, what: str) -> NoReturn:
        """Refuse a verb that no function may call in a turn; the argument says which, in words."""
        self._raise(f"A plain function {what}: play and reset a game between two turns, not in a function of a turn.")

    def _need_rule(self, what: str) -> None:
        """Refuse what only rules and collectors may do, said in words, if another function is called."""
        if not self._phase_call.may_change:
            self._raise(f"A plain function that is no rule {what}. In a batch, only rules may do so.")

    def _need_columns(self, what: str) -> None:
        """Let the game go on in columns of its own after the function; the argument says why, in words."""
        self._need_rule(what)
        self.why = self.why or f"a plain function {what}"

    def refuse_route(self, name: str, what: str) -> NoReturn:
        """Refuse a route for which the columns have no room; `what` it does, in words.

        Raises:
            BadValue: always.
        """
        self._raise(
            f"Agent {name!r} chooses a route {what}, for which a batch has no room: go it in several turns, or play "
            "the game alone, for example by scenario.play."
        )

    def make_fork(self) -> tuple[PlayedGame, list[str]]:
        """Return the game as it is now in another context, and the names of agents that the last function has created.

        The context has what functions have changed, also in the middle of a turn.
        """
        self._refuse_kept_rows()
        new = [agent.name for agent in self._list_new_agents()]
        drawn = self._find_drawn()
        sensed = frozenset(key for key, last in list_last_states(self.ctx).items() if last[0] is not self.look)
        self._fill_fields()
        source = ForkSource(self._parts, only_plain=False)
        ctx, memo = self._make_fork(source)
        parts = ctx.game.internals.parts
        state = parts.state
        ctx.game.internals.take_calls(self.game.internals)
        self._begin_alone(state, ctx.seed)
        parts.rules.unchecked = copy_rules(self._parts.rules.unchecked, memo)
        parts.turns.note_departed()  # from here on
        parts.turns.restore(drawn | source.snapshot.part("turns"))
        parts.turns.phase.read_last_turn()  # before other agents decide
        if self._phase.strategy_changes == self._changes[0]:
            parts.turns.prepared = parts.turns.phase.strategy_changes
        self._copy_named_edges(state, self.read_field("moves"), is_within=self.part is not None)
        for key, last in list_last_states(ctx).items():
            if key not in sensed:
                last[0] = UNKNOWN_LOOK
        return ctx.game, new

    def _begin_alone(self, state: GameState, seed: int) -> None:
        """Set the fields of the state of a fork that it does not take from this game."""
        state.start = GameStart(self._means.at_rest, None, (seed, None))  # what planners know of other agents
        state.has_begun = True
        state.under_way = None
        state.parts_played = None
        for name in self.read["memories"]:
            state.get_memory(name)

    def put_back(self) -> None:
        """Put the context back, of which a fork was made, as before the call, but for what functions have written."""
        self.why = ""
        self.raised = None
        self.values.blocked = BlockedAgents()
        self._has_core_data = False
        self._drop_changes()
        self._take_terms_back(self.terms)
        self.forget_looks()
        self._note_epoch()

    def _take_terms_back(self, terms: PlanTerms) -> None:
        """Follow a plan on these terms again, with the settings, rules and collectors of then."""
        parts = self._parts
        if parts.settings.settings_now() != terms.settings:
            parts.settings.configure(terms.settings)
        if parts.rules.now is not terms.rules:
            parts.rules.put(terms.rules)
        parts.collectors.by_name = {**terms.collectors}
        self._put_terms(terms)

    def _put_terms(self, terms: PlanTerms) -> None:
        """Follow a plan on these terms."""
        means = terms.means
        self.terms = terms
        self.has_other_plan = False
        self._state = means.state
        self.look = None if means.plan.asks_all else self._unknown_look
        has_deeds = means.state.doings is not None
        self._keeps_more = means.plan.asks_all or has_deeds or bool(self._drivers or terms.collectors)
        self._fixed = self._list_fixed_values()

    def _make_terms(self, means: RowMeans) -> PlanTerms:
        """Return the present terms with which the game can follow a plan."""
        parts = self._parts
        members = self.members
        is_first = means.state.roster.is_first
        each = zip(members.numbers.tolist(), members.agents.members, members.agents.equipment, strict=True)
        equipment = {agent.name: own for number, agent, own in each if is_first[number]}
        settings = zip(members.sensors.sensors, members.sensors.keywords, strict=True)
        keywords = {id(sensor): own for sensor, own in settings}
        carried = [sensor for _, sensors in equipment.values() for sensor in sensors.values()]
        return PlanTerms(
            means,
            parts.settings.settings_now(),
            parts.rules.now,
            {**parts.collectors.by_name},
            equipment,
            {id(sensor): keywords.get(id(sensor)) for sensor in carried},
            {one.name: one.rule for of_phase in parts.rules.now.of_phase.values() for _, one in of_phase},
        )

    def follow(self, means: RowMeans) -> None:
        """Follow another plan from now on, with what functions have changed."""
        if self._plan.core_keys and not self._has_core_data:
            self._show_core_data()
        self.read_field("memories")  # which puts what the core remembers to those that functions have written
        blocked = {name: "; ".join(why) for name, why in self._list_failures().items()}
        asked = {*self._list_asked()}
        self._put_terms(self._make_terms(means))
        self._take_means(blocked, asked)

    def make_key(self) -> Hashable | None:
        """Return what the plan that the game needs now differs by from others; None: it is that of the start."""
        first = self._first_terms
        steps = first.means.core.steps
        find = self.ctx.graph.graph.get_node
        memories = self.read_field("memories") if steps else {}
        unreadable = [name for name, memory in memories.items() if not can_read(steps, memory, find)]
        facts = [(name, Same(fact)) for name, fact in self.list_own_facts().items()]
        are_exact = all(map(is_exact_float, self.read_field("scores").values()))
        key = self._make_terms(self._means).make_key(first)
        calls_rules = self.game.internals.calls_rules or not are_exact
        if key == first.make_key(first) and not (calls_rules or self.game.internals.asks_all or unreadable or facts):
            return None
        return key, calls_rules, self.game.internals.asks_all, tuple(sorted(unreadable)), tuple(facts)

    def list_own_facts(self) -> dict[str, Any]:
        """Return the facts that functions have published since the game began, and that the plan depends on."""
        first = self._first_facts
        found = {name: fact for name, fact in self._facts.items() if first.get(name) is not fact}
        specs = [one.spec for one in self.game.rules]
        deciders = [*self.ctx.agent.storage.list_strategies(), *(one.function for one in self.game.plans.values())]
        forms = [*(one.array_form for one in specs), *(get_strategy_spec(one).array_form for one in deciders)]
        if any(form is not None for form in forms):  # array functions may read all
            return found
        read = {name for spec in specs for name in spec.reads_owners}
        return {name: fact for name, fact in found.items() if name in read}

    def list_carriers(self) -> dict[int, Any]:
        """Return the agents of the start whose strategies or sensors were changed, by their numbers."""
        first = self._first_terms
        now = self._make_terms(self._means)
        changed = now.equipment if now.have_changed_sensors(first) else now.list_changed(first)
        return {self.number_of[name]: self.ctx.agent.agents[name] for name in changed}

    def _take_means(self, blocked: Mapping[str, str], were_asked: set[str]) -> None:
        """Take the memories, the data of rules, and the agents to the plan that the game follows now.

        Args:
            blocked: agent -> why it failed to act in its last turn.
            were_asked: the agents whose strategies were called before.
        """
        data = get_data(self.values)
        self._first_core_data |= copy_deep({key: data[key] for key in self._plan.core_keys & data.keys()})
        self._has_core_data = True  # as functions have left it
        game = GameRow.from_game(self._state, self.number)
        self._begin_rules(game)
        if KEPT in self._plan.core_keys:
            self._take_arrays(data.get(KEPT, {}))
        self._has_core_data = False
        self.read["memories"] = get_memories(self.values)
        self._put_arrays(begin_steps(self._core.steps, self.ctx, game))
        self.read.clear()
        for name in self._list_asked():
            if name not in were_asked and name in blocked:
                self.undone[name] = blocked[name]
        self.members.find_kinds(self._means)
        self._show_members()
        self._asked = None
        self._note_epoch()

    def _drop_changes(self) -> None:
        """Undo what functions have changed of the agents, the sensors and the map that was not taken."""
        members = self.members
        for row, terms in enumerate(members.terms):
            if terms != _get_terms(members.block, row):
                members.block.write(row, terms)
        members.journal.log.clear()
        members.journal.progressed.clear()
        self._show_members()
        if self.has_other_map:
            self._show_roads(self._roads, is_forced=True)

    def _refuse_kept_rows(self) -> None:
        """Refuse to fork a game if array functions keep values by agent, and it has other agents than the batch.

        Raises:
            BadValue: see `refuse`.
        """
        roster = self._state.roster
        row = GameRow.from_game(self._state, self.number)
        known = {*self.ctx.agent.agents, *self.values.departed}
        if row.keeps_for_agents and not known >= {*roster.names}:
            name = next(name for name in roster.names if name not in known)
            self._raise(
                f"The game needs columns of its own ({self.why}), but keep(key, make) has a place for agent {name!r}, "
                "which has not come: keep arrays of the shape (games,), or reserve no agents."
            )

    def _find_drawn(self) -> dict[str, tuple[Any, Any]]:
        """Return how far functions have read the streams of agents in this turn, see `AgentSlot.get_marks`."""
        slots = None if self._order is None else self._order[0].slots
        if slots is None or slots.table.turn != self.values.turn:
            return {}
        each = {slot.name: slot.get_marks() for slot in slots.list_made()}
        return {name: marks for name, marks in each.items() if marks != (None, None)}

    def _make_fork(self, source: ForkSource) -> tuple[Any, Memo]:
        """Return a context with the game, whose random streams go on, and the counterparts of objects in it."""
        ctx, memo = source.make_fork(self.ctx.seed)
        made = ctx.game.internals.parts
        made.state.collected = made.collectors.list_last_numbers(made.state.turn)
        continue_streams(ctx, self.ctx)
        return ctx, memo

    def _copy_named_edges(self, state: GameState, moves: TurnMoves | None, *, is_within: bool) -> None:
        """Let a fork know the edges that agents have named in its last moves.

        Args:
            state: the state of the fork.
            moves: the moves; None: there are none.
            is_within: whether they belong to the turn that the fork goes on with.
        """
        named = {} if moves is None else moves.find_named_edges()
        if named:
            state.named_edges = {name: (state.turn + is_within, edge) for name, edge in named.items()}

    def _fill_fields(self) -> None:
        """Put what only the core has into the fields of the game, which is going to be forked."""
        self.turns.restart_counts()
        for name in ("counts", "errors"):
            self.read.pop(name, None)  # refusals are noted after functions have read them
        self.read_data()
        self.read_field("memories")
        self.values.blocked = self._make_blocked()

    def _make_blocked(self) -> BlockedAgents:
        """Return why actions of agents were not executed in their last turns."""
        state = self._state
        number = self.number
        names = state.roster.names
        found = BlockedAgents(self.undone)
        told = {*found, *self._list_asked()}  # asked agents are told in `undone`
        decided = 0 if self.part is None else self.part + 1  # the parts of the turn in which agents have decided
        has_decided = self._core.part_of < decided
        for name, messages in self._list_failures().items():
            for message in messages if name not in told else ():
                found.add(name, message)
        is_known = state.blocked[number].copy()
        if state.turn[number] == self._means.start.turn:  # others were blocked before the game was in the batch
            is_known &= has_decided
            for name, why in self._means.start.blocked.items():
                if not has_decided[self.number_of[name]]:
                    found.setdefault(name, why)
        for agent in np.flatnonzero(is_known).tolist():  # in its last turn
            why = describe_conflict(self._core.get_wanted_place(number, agent))
            if why not in found.get(names[agent], ""):
                found.add(names[agent], why)
        return found

    def _list_failures(self) -> dict[str, list[str]]:
        """Return agent -> why it could not act in its last turn, other than conflicts."""
        state = self._state
        number = self.number
        decided = 0 if self.part is None else self.part + 1  # the parts of the turn in which agents have decided
        has_decided = self._core.part_of < decided
        found: dict[str, list[str]] = {}
        for error in state.errors.list_entries(number):
            last = state.turn[number] - (not has_decided[self.number_of[error["agent"]]])
            if error["turn"] == last:
                found.setdefault(error["agent"], []).append(error["message"])
        return found

    def _list_fixed_values(self) -> tuple[int, object, int]:
        """Return the numbers and objects that only the turn engine may change."""
        parts = self._parts
        return self._phase.setting_changes, parts.rules.now, len(parts.collectors.by_name)

    def _note_epoch(self) -> None:
        """Note the agents and settings of the context: only functions that run from now on have changed them."""
        phase = self._phase
        self.epoch = phase.epoch
        self._changes = phase.strategy_changes, phase.sensor_changes

    # -- what is shown -------------------------------------------------------------------------------------------------

    def _show_members(self) -> None:
        """Let the context have the agents of the game, with their strategies and sensors."""
        members = self.members
        shown = members.agents
        each = zip(shown.members, shown.equipment, strict=True)
        has_others = self.ctx.agent.block is not members.block
        if has_others or any((agent.strategy, agent.sensors) != own for agent, own in each):
            self.ctx.agent.storage.show(shown)
        if self.ctx.sensor.storage.share() is not members.sensors:
            self.ctx.sensor.storage.show(members.sensors)
        self.journal = members.journal
        self.lasts = [*members.lasts.values()]
        self.sees_world_only = members.sees_world_only
        self._headings = {}
        self.take_columns(members.block, (members.numbers + self.number * len(self.number_of)).data)
        self.shows_more = True
        self.forget_looks()

    def show_more(self, *, is_other: bool, are_placed: bool) -> None:
        """Show what in most games is as at the start; see `Row.show_more`."""
        state = self._state
        number = self.number
        members = self.members
        block = members.block
        if is_other:
            show_lives(block, state.alive[number, members.numbers].tobytes())
            self._asked = None
        headings = state.headings[number]
        flights = state.flights if members.flying else None
        if flights is not None:
            show_flights(block, members.rows_in_air, flights, members.flying, number)
        if flights is not None or headings is not self._headings:
            self._headings = headings
            each = zip(members.numbers.tolist(), members.first_headings, strict=True)
            show_column(block, "heading", [headings.get(agent, first) for agent, first in each])
        for name, column in state.numbers.items():
            show_column(block, name, column[number, members.numbers])
        if are_placed or block.placed:
            self._show_placed()
        remembers = state.movement.depends_on_speeds
        if remembers:
            self._show_positions_on_edges()
        if state.roads.are_closed or self._roads is not None:
            self._show_roads(state.roads.get_map(number))
        self._show_counts()
        if self._phase.epoch != self.epoch:
            self._note_epoch()
        if self._is_data_held:
            self._show_core_data()
        self.shows_more = bool(
            flights is not None
            or self._is_data_held
            or remembers
            or state.numbers
            or headings
            or block.placed
            or members.counting
            or state.roads.are_closed
        )

    def _show_placed(self) -> None:
        """Show which agents rules have placed in this turn."""
        placed = self._state.placed[self.number].copy()
        placed[self._state.flyers] &= ~self._state.has_flown[self.number]
        self.block.placed = set(np.flatnonzero(placed[self.members.numbers]).tolist())

    def _show_positions_on_edges(self) -> None:
        """Show which agents are on edges, and where."""
        state = self._state
        row_of = {agent: row for row, agent in enumerate(self.members.numbers.tolist())}
        on_edges = state.movement.find_edge_positions(self.number, state.node[self.number])
        show_progress(self.block, {row_of[agent]: one for agent, one in on_edges.items() if agent in row_of})

    def _show_counts(self) -> None:
        """Show how often sensors have looked before agents move: once, if their owners have decided."""
        part = self.part
        if part is None or not self.members.counting or self._plan.asks_all:  # where all are asked, sensors count
            return
        _, _, took_part = self._core.get_moves(np.array([self.number]), part)
        have_looked = took_part[0] & (self._core.part_of <= part)
        for sensor, owners in self.members.counting:
            sensor.notice.go_to({name: (self.values.turn, 1) for name in owners if have_looked[self.number_of[name]]})

    @property
    def part(self) -> int | None:
        """The part of the turn in which agents are about to move; None: they are not."""
        return self._phase_call.moving_part

    @property
    def order(self) -> TurnOrder:
        """The agents in the order of a turn; the living ones take part."""
        order = self.turns.get_order()
        lives = bytes(self.block.alive)
        if self._order is None or self._order[0] is not order:
            self.turns.restart_counts()  # the core counts
            order.slots.get_slots(range(len(order.slots)))  # now: later the context may have other agents
        if self._order != (order, lives):
            self._order = order, lives
            order.take_lives()
        return order

    def _make_order_of(self, members: Members) -> TurnOrder:
        """Return the order of earlier agents, some of which may have been deleted."""
        order = self.order
        if members.block is self.ctx.agent.block:
            return order
        if members.order is None:
            with self._phase.suspend(), self._show_earlier(members):  # a strategy may ask how agents have moved
                made = self.turns.make_order()
                made.slots.get_slots(range(len(made.slots)))  # now: later the context has other agents
                made.slots.begin_departures(members.departure)
                members.order = made
            self.turns.take_order(order)
        return members.order

    @contextmanager
    def _show_earlier(self, members: Members) -> Iterator[None]:
        """Show earlier agents within the block, then the present ones again, which may be changed."""
        storages = self.ctx.agent.storage, self.ctx.sensor.storage
        present = [one.share() for one in storages]
        lives = bytes(present[0].block.alive)
        for storage, one in zip(storages, (members.agents, members.sensors), strict=True):
            storage.show(one)
        try:
            yield
        finally:
            for storage, one in zip(storages, present, strict=True):
                storage.show(one)
            show_lives(present[0].block, lives)

    def find_asked(self, asked: bytes, observing: bytes, given: bytes) -> AskedPart:
        """Return the living agents that are asked, and those that only observe, given their numbers as bytes."""
        key = asked, observing, given, self._phase.epoch
        if self._asked is None or self._asked[0] != key:
            self._asked = key, self._make_asked(self.order, asked, observing, given)
        return self._asked[1]

    def _make_asked(self, order: TurnOrder, *which: bytes) -> AskedPart:
        names = self._state.roster.names
        named, looking, told = ([names[number] for number in np.frombuffer(one, np.int64).tolist()] for one in which)
        living = {order.names[i]: i for i in order.list_present()}
        places = [living.get(name, -1) for name in named]
        members = [(i, name) for i, name in zip(places, named, strict=True) if i >= 0]
        given = [(living[name], name) for name in told if name in living]
        part = order.whole
        if len(members) < len(order.slots):
            part = order.make_part([i for i, _ in members])
        others = [living[name] for name in looking if name in living]
        if others or given:
            part.let_observe(others, [i for i, _ in given])
        return AskedPart(order, part, places, members, given)

    def _show_roads(self, roads: RoadMap | None, *, is_forced: bool = False) -> None:
        """Open and close roads as in the columns of all games; None: as at the start."""
        if is_forced or roads is not self._roads or self.has_other_map:
            self._map.restore(self._first_map if roads is None else roads.snapshot)
            self._note_map(roads)

    def _note_map(self, roads: RoadMap | None) -> None:
        self._roads = roads
        self.map_changes = self._map.count_changes()
        self.shows_more = True

    def take_roads(self) -> bool:
        """Store the map of the context; return False, and do nothing, if more than roads was changed."""
        state = self._state
        revision, road_changes, *others = self._map.count_changes()
        known_revision, known_road_changes, *known_others = self.map_changes
        if revision - known_revision != road_changes - known_road_changes or others != known_others:
            return False
        try:
            roads = state.roads.map_with(*self._map.list_roads())
        except BadValue:
            return False
        if roads is not None and roads.snapshot is None:
            roads.snapshot = self._map.snapshot()
        state.put_roads(np.array([self.number]), roads)
        self._note_map(roads)
        return True

    @property
    def last_turn(self) -> int | None:
        """The turn at which the last run stops the game; None: it had no limit."""
        turn: int | None = self._state.run_until(self.number)
        return turn

    def _read_inbox(self, radio: MessageTraffic, name: str) -> list[dict[str, Any]]:
        """Return the messages that an agent of the game hears in its next turn."""
        return radio.make_inbox(self.number, self.values.turn, name)

    # -- fields that are made when they are read -----------------------------------------------------------------------

    def read_field(self, name: str) -> Any:
        """Return a field of the state of the game."""
        read = self.read
        if name not in read:
            read[name] = getattr(self, f"_make_{name}")()
        return read[name]

    def _make_over(self) -> dict[str, Any] | None:
        return self._state.over[self.number]

    def end(self, over: dict[str, Any] | None) -> None:
        """End the game."""
        number = self.number
        self._state.over[number] = over
        self._state.is_going[number] = over is None
        self.read["over"] = over

    def read_data(self) -> dict[Any, Any]:
        """Return `ctx.game.data`, with the data of rules in the core."""
        if self._plan.core_keys and not self._has_core_data:
            self._show_core_data()
        return get_data(self.values)

    def _show_core_data(self) -> None:
        """Put the data of rules in the core into `ctx.game.data`."""
        self._has_core_data = True
        data = get_data(self.values)
        self._take_events()
        facts = dict(self._facts)
        game = GameRow.from_game(self._state, self.number)
        for key in self._plan.core_keys & self._first_core_data.keys():
            data[key] = copy_deep(self._first_core_data[key])
        arrays = {**self._own_arrays, **game.of_arrays}
        if arrays:
            data[KEPT] = arrays
        with self._phase.suspend(changes_world=False):
            for spec in self._list_specs_in_core():
                if spec.show_arrays is not None:
                    spec.show_arrays(self.ctx, game, self.read["events"], None)
        self._facts.update({name: facts[name] for name in self._plan.core_keys & facts.keys()})  # they are the same
        self._core_data = copy_deep(self._get_core_data())

    def _list_specs_in_core(self) -> list[RuleSpec]:
        """Return the declarations of the rules that the core plays."""
        specs = [one.spec for one in self._plan.rules]
        return [one for one in specs if one.core_form is not None]

    def _begin_rules(self, game: GameRow) -> None:
        """Let rules in the core go on from their data in `ctx.game.data`."""
        for spec in self._list_specs_in_core():
            if spec.begin_arrays is not None:
                self._put_arrays(spec.begin_arrays(self.ctx, game))

    def _get_core_data(self) -> dict[str, Any]:
        """Return the data of rules in the core in `ctx.game.data`."""
        data = get_data(self.values)
        return {key: data[key] for key in self._plan.core_keys & data.keys()}

    def _take_core_data(self) -> None:
        """Write the changes of the data of rules in the core to the columns, if a function has read it."""
        if not self._has_core_data:
            return
        self._is_data_held = self._is_data_held or getrefcount(get_data(self.values)) > _OF_SLOT
        self.shows_more = self.shows_more or self._is_data_held
        now = self._get_core_data()
        if not now.keys() >= self._core_data.keys() or self._has_lost_arrays(now):
            if not self._phase_call.may_change:  # it is refused, and the data stay
                get_data(self.values).update(self._core_data)
                self._has_core_data = False
            self._need_own_rules("drops ctx.game.data of rules or functions in the core")
            lost = self._core_data.get(KEPT, {}).keys() - now.get(KEPT, {}).keys()
            makers = {key: self._state.makers[key] for key in lost & self._state.kept.keys()}
            self._put_arrays({key: make(1) for key, make in makers.items()})
            return
        if not _are_equal(now, self._core_data):
            self._begin_rules(GameRow.from_game(self._state, self.number))
            self._take_arrays(now.get(KEPT, {}))
        self._has_core_data = False

    def _take_arrays(self, arrays: Mapping[Hashable, Arrays]) -> None:
        """Take the arrays that array functions keep in this game."""
        self._own_arrays = {key: arrays[key] for key in arrays.keys() - self._state.kept.keys()}
        self._put_arrays({key: arrays[key] for key in arrays.keys() & self._state.kept.keys()})

    def _has_lost_arrays(self, now: Mapping[str, Any]) -> bool:
        """Return whether a function has deleted arrays that array functions keep."""
        return not now.get(KEPT, {}).keys() >= self._core_data.get(KEPT, {}).keys()

    def take_own_arrays(self, key: Hashable) -> Arrays:
        """Return the arrays that functions called in this game keep under a key; from now on, all games keep them."""
        return self._own_arrays.pop(key, {})

    def _put_arrays(self, arrays: Mapping[Hashable, Arrays]) -> None:
        """Set arrays that rules and strategies keep to those of one game."""
        for key, several in arrays.items():
            for name, array in several.items():
                self._state.kept[key][name][self.number] = array[0]

    def _make_began(self) -> dict[str, Any]:
        state = self._state
        begun = np.flatnonzero(state.start[self.number] >= 0)
        nodes = state.streets.ids(state.start[self.number, begun]).tolist()
        starts: dict[str, Any] = dict(zip((state.roster.names[i] for i in begun), nodes, strict=True))
        if state.flights is not None:
            places = map(tuple, state.start_position[self.number].tolist())
            flying = zip((state.roster.names[i] for i in state.flyers), places, strict=True)
            starts |= {name: place for name, place in flying if name in starts}
        return starts

    def _make_driven(self) -> dict[str, tuple[int, ...]]:
        traffic = self._state.movement.traffic
        if self._drivers:
            self.drive_on()
            return get_driven(self.values)
        if traffic is None:
            return {}
        number = self.number
        names = self._state.roster.names
        found = {names[agent]: traffic.list_driven(number, agent) for agent in np.flatnonzero(traffic.obeys).tolist()}
        return {name: edges for name, edges in found.items() if edges}

    def drive_on(self) -> None:
        """Note the edges that agents that obey turns by metres have driven to their ends since the last call."""
        core = self._core
        number = self.number
        before = self._parts_noted
        self._parts_noted = self._count_parts()
        if before == self._parts_noted or core.courses is None:
            return
        _, _, took_part = core.get_moves(np.array([number]), None)
        order = self.order
        for agent, name in self._drivers:
            turn = self._state.turn[number] - (core.part_of[agent] >= core.parts_played[number])
            is_new = turn * core.num_parts + core.part_of[agent] >= before
            if is_new and took_part[0, agent] and name in order.index_of:
                edges = core.courses.list_driven(number, agent)
                self.turns.legality.drive_on(order.slots[order.index_of[name]], edges, get_driven(self.values))

    def _count_parts(self) -> int:
        """Return the number of parts of turns that were played."""
        return int(self._state.turn[self.number]) * self._core.num_parts + int(self._core.parts_played[self.number])

    def _make_scores(self) -> Scores:
        self._scores_before = self._state.scores.get_scores(self.number)
        scores = Scores()
        dict.update(scores, self._scores_before)
        return scores

    def _make_events(self) -> list[dict[str, Any]]:
        found = self._state.events.list_entries(self.number)
        self._num_events = len(found)
        return found

    def _make_messages(self) -> list[dict[str, Any]]:
        radio = self._state.radio
        found = [] if radio is None else radio.list_entries(self.number)
        self._num_messages = len(found)
        return found

    def _make_errors(self) -> list[dict[str, Any]]:
        return self._state.errors.list_entries(self.number)

    def _make_counts(self) -> dict[str, dict[str, int]]:
        state = self._state
        before = {name: {**each} for name, each in self._means.start.counts.items()}
        columns = {kind: state.counts[kind][self.number].tolist() for kind in COUNTED}
        names = [(i, state.roster.names[i]) for i in sorted(self.members.have_come)]
        return before | {name: {kind: column[i] for kind, column in columns.items()} for i, name in names}

    def _make_memories(self) -> dict[str, dict[Any, Any]]:
        found = get_memories(self.values)
        memories = self._core.get_memories(self.number) if self._has_decided else {}
        self._core_memories = copy_deep(memories)
        for name, memory in memories.items():
            found.setdefault(name, {}).update(memory)
        return {**found}

    def _take_core_memories(self) -> None:
        """Write the changes of what the core remembers for agents to the columns, if a function has read it."""
        if "memories" not in self.read or not self._core.steps:
            return
        keys = {step.key for step in self._core.steps}
        memories = get_memories(self.values)
        shown, now = (
            {(name, key): one[key] for name, one in of_agents.items() for key in keys & one.keys()}
            for of_agents in (self._core_memories, memories)
        )
        if shown == now:
            return
        find = self.ctx.graph.graph.get_node
        if not all(can_read(self._core.steps, memory, find) for memory in memories.values()):
            self._need_plan("writes memories that strategies in the core cannot read")
            return
        self._put_arrays(begin_steps(self._core.steps, self.ctx, GameRow.from_game(self._state, self.number)))

    def _make_moves(self) -> TurnMoves | None:
        """Return the moves of the last turn of the game, or the moves about to be made; None: there are none."""
        part = self.part
        number = self.number
        games = np.array([number])
        if self._moved == (self._moment, None):
            kept: TurnMoves | None = get_moves(self.values)
            return kept
        if part is not None:
            acts = self._core.part_of == part
            starts, ends, took_part = (column[0] for column in self._core.get_moves(games, part))
            return self._make_moves_between(starts, ends, took_part, acts)
        if not self._has_moved:
            before: TurnMoves | None = get_moves(self.values)
            return before
        starts, ends, took_part = (column[0] for column in self._core.get_moves(games, None))
        if not (took_part.any() and self._core.knows_paths):
            return None
        moves = self._make_moves_between(starts, ends, took_part, None)
        parts = self._parts.settings.order
        return moves if parts is None or self._core.courses is not None else moves.fit_to_parts(parts)

    @property
    def _has_moved(self) -> bool:
        """Whether agents have moved in the batch; else the last moves are those of the turn before."""
        number = self.number
        return self._state.turn[number] > self._means.start.turn or bool(self._core.parts_played[number])

    @property
    def _has_decided(self) -> bool:
        """Whether agents have decided in the batch."""
        return self._has_moved or self.part is not None or bool(self._core.arrival)

    @property
    def _moment(self) -> tuple[int, int | None, bool]:
        """The number of turns played, the part in which agents are about to move, and whether newcomers take part."""
        return int(self._state.turn[self.number]), self.part, self._phase_call.have_joined

    def _make_moves_between(
        self, starts: IntArray, ends: IntArray, took_part: BoolArray, acts: BoolArray | None
    ) -> TurnMoves:
        """Return the moves of the agents that took part; those that do not act stay, None: all act."""
        members = self.members
        if self._moved is not None and self._moved[0] == self._moment and self._moved[1] is not None:
            members = self._moved[1]
        order = self._make_order_of(members)
        ids = self._state.streets.ids
        courses = self._core.courses
        numbers = np.sort(members.numbers)
        took_part = took_part[numbers]
        starts = starts[numbers]
        ends = np.where(took_part, ends[numbers], starts)
        acting = np.where(took_part, numbers, -1)
        if acts is not None:
            acting[~acts[numbers]] = -1
        actions = {}
        paths = None
        if courses is not None:
            standing = np.where((acting < 0) & took_part, numbers, -1)
            paths = courses.get_game_paths(self.number, acting, standing)
        first = ids(starts).tolist()
        if self._state.flights is not None:
            actions = self._make_flights(acting, first)
        if self._core.edges.are_any[0] and self._core.arrival is None:
            actions |= self._follow_named_edges(acting, ids(ends).tolist(), first)
        if courses is not None and self._state.movement.traffic is not None:
            actions |= self._resolve_driven(acting, courses, actions)
        lives = took_part.tobytes()
        return TurnMoves(order, as_ids(first), ids(ends).data, actions, paths=paths, took_part=lives)

    def _make_flights(self, numbers: IntArray, nodes: Sequence[int]) -> dict[int, ResolvedAction]:
        """Return the flights of agents, above these nodes, by their places among these numbers."""
        flights = self._state.flights
        assert flights is not None  # noqa: S101 - some fly
        found = {}
        for place in np.flatnonzero(np.isin(numbers, self._state.flyers)).tolist():
            node = nodes[place]
            position, quat = flights.get_wanted(int(numbers[place]), self.number)
            found[place] = ResolvedAction(node, (node,), position=position, quat=quat)
        return found

    def _follow_named_edges(
        self, numbers: IntArray, ends: Sequence[int], starts: Sequence[int]
    ) -> dict[int, ResolvedAction]:
        """Return the moves along edges that actions have named, by the places of the agents among these numbers."""
        edges = self._core.edges.find(self.number, numbers, self._state.movement.columns)
        return {
            place: ResolvedAction(ends[place], (starts[place], ends[place]), edge=int(edges[place]))
            for place in np.flatnonzero(edges >= 0).tolist()
        }

    def _resolve_driven(
        self, numbers: IntArray, courses: Courses, actions: Mapping[int, ResolvedAction]
    ) -> dict[int, ResolvedAction]:
        """Return the moves of agents that obey turns, with their edges, by their places among these numbers."""
        traffic = self._state.movement.traffic
        assert traffic is not None  # noqa: S101 - some obey turns
        found = {}
        for place in np.flatnonzero(numbers >= 0).tolist():
            agent = int(numbers[place])
            if not traffic.obeys[agent]:
                continue
            path, edge = courses.find_step(self.number, agent)
            one = actions.get(place) or ResolvedAction(path[-1], path, edge=edge)
            found[place] = one._replace(end=path[-1], path=path)
        return found

    # -- what functions change -----------------------------------------------------------------------------------------

    def take(self) -> None:
        """Write the changes into the columns, up to the first one that columns do not hold: see `why`.

        See `has_changed`; if the plan has changed, see `follow`.
        """
        journal = self.journal
        phase = self._phase
        is_other = phase.epoch != self.epoch
        are_changed = is_other and (phase.strategy_changes, phase.sensor_changes) != self._changes
        kinds = {one[0] if type(one) is tuple else _MOVED for one in journal.log}
        are_others = is_other and self.ctx.agent.block is not self.block
        have_changed = bool(journal.log or journal.progressed or are_changed or are_others)
        self.shows_more = self.shows_more or is_other or have_changed
        if self.has_other_map:
            self._take_roads()  # before the agents, which may be on new nodes
        if is_other and self._list_fixed_values() != self._fixed:
            self._note_terms()
        if self.why:
            return
        if self._own["_seed"] != self.seed:
            self.seed = self.ctx.seed
            self._state.seeds[self.number] = self.seed
            for key, rows in self._state.draw_rows([self.seed]).items():
                self._state.drawn[key][self.number] = rows[0]
        are_changed = are_changed or not kinds.isdisjoint(_EQUIPPING)
        block = self._take_agents(journal, kinds, are_changed=are_changed) if have_changed else self.block
        self._take_values(block, [name for name, code in _NUMBERS.items() if are_others or code in kinds])

    def _take_values(self, block: AgentBlock, numbers: Sequence[str]) -> None:
        """Write what functions have changed besides agents, and numbers of the agents of a block, into the columns."""
        if self.why:
            return
        if self.read:
            self._take_logs(self.read)
        self._take_core_data()
        self._take_core_memories()
        for name in numbers:
            self._state.numbers[name][self.number, self.members.numbers] = getattr(block, name)
        if self._facts != self.facts_shown:
            self._take_facts()

    def _need_own_rules(self, what: str) -> None:
        """Let all rules be called as functions in this game, after a function has changed what the core has of them."""
        self._need_plan(what)
        self.game.internals.calls_rules = True

    def _note_terms(self) -> None:
        """Note that a function has changed settings, rules or collectors."""
        now = self._parts.settings.settings_now()
        known = self.terms.settings
        if any(now[name] != known[name] for name in now.keys() - _OF_PLANS):
            self._need_columns("changes settings")
        self._need_plan("changes settings, rules or collectors")

    def _need_plan(self, what: str) -> None:
        """Let the game follow another plan after the function that is called; the argument says why, in words."""
        self._need_rule(what)
        self.has_other_plan = True

    def keep_moves(self, part: int | None) -> None:
        """Show the moves that the context has while agents are about to move in a part; None: while they are not."""
        self._moved = (int(self._state.turn[self.number]), part, False), None

    def _list_new_agents(self) -> list[Any]:
        """Return the agents that functions have created since their block was made."""
        known = {agent.name: agent for agent in self.members.agents.members}
        return [agent for name, agent in self.ctx.agent.agents.items() if known.get(name) is not agent]

    def _take_members(self) -> AgentBlock:
        """Store the agents that a function has created or deleted; return their new block."""
        number = self.number
        before = self.members
        agents = self.ctx.agent.agents
        roster = self._state.roster
        known = {agent.name: agent for agent in before.agents.members}
        new = self._list_new_agents()
        self.turns.note_departed()
        if self._moved is None or self._moved[0] != self._moment:
            self._moved = self._moment, before  # also for a fork
        if not all(map(roster.can_hold, new)):
            self._need_columns("creates agents for which most_agents= has reserved no rows")
            return self.members.block
        for name in [name for name, agent in known.items() if agents.get(name) is not agent]:
            self._core.leave(number, self.number_of[name], self.values.departed[name][1])
        for agent in new:
            place = self.number_of[agent.name]
            start = self.values.began[agent.name]
            if self.part is not None:  # it does not make the move of a deleted agent of its name
                self.cancel(place)
            self._core.enter(number, place, start, agent.current_node_id, self.part)
        self.members = Members(self.game, self._means, before)
        self._first_members = None  # it would keep all agents that are deleted from now on
        before.renew_journal()
        drawn = self.turns.snapshot()
        self._show_members()
        if drawn:
            self.turns.restore(drawn)
        self._fixed = self._list_fixed_values()
        terms = self._make_terms(self._means)
        if terms.list_changed(self.terms) or terms.have_changed_sensors(self.terms):
            self._need_plan("changes strategies or sensors of agents")
        return self.members.block

    def _take_logs(self, read: dict[str, Any]) -> None:
        """Write the changes of the scores and the events of a game that were read."""
        if "scores" in read:
            self._take_scores(read["scores"])
        if "events" in read and len(read["events"]) != self._num_events:
            self._take_events()
        if "messages" in read and len(read["messages"]) != self._num_messages:
            self._take_messages(read["messages"])

    def _take_events(self) -> None:
        """Count the stops of agents by events that a function has added to the log of a game."""
        events = self.read_field("events")
        if len(events) < self._num_events:
            self._need_own_rules("deletes events")
        self._note_events(events[self._num_events :])
        self._num_events = len(events)

    def _take_messages(self, messages: Sequence[dict[str, Any]]) -> None:
        """Let the messages of the log be under way that a function has left in it."""
        radio = self._state.radio
        if radio is not None:
            radio.renew_under_way(self.number, messages, self.values.turn)
        self._num_messages = len(messages)

    def _take_roads(self) -> None:
        """Store the open roads of the game after a function call."""
        if not self.take_roads():
            self._need_columns("changes more of the map than which roads are open")

    def _note_events(self, entries: Sequence[dict[str, Any]]) -> None:
        """Count the stops of agents by events that a function has added to the log of a game."""
        state = self._state
        numbers = self.number_of
        for entry in entries:
            stopped = entry.get(STOPPED.get(entry["kind"], ""))
            if isinstance(stopped, str) and stopped in numbers:
                state.stops[self.number, numbers[stopped]] += 1

    def _take_scores(self, scores: dict[Any, Any]) -> None:
        known = self._scores_before
        if scores == known and [*map(type, scores.values())] == [*map(type, known.values())]:
            return
        are_held = {key for key, points in known.items() if not is_exact_float(points)}  # the core adds to no scores
        if not all(key in are_held or is_exact_float(points) for key, points in scores.items()):
            self._need_plan("sets scores that are no numbers")
        self._state.scores.put(self.number, scores)

    def _take_agents(self, journal: Journal, kinds: set[int], *, are_changed: bool) -> AgentBlock:
        """Store the changes of agents; return their block.

        Args:
            journal: the changes.
            kinds: their kinds.
            are_changed: whether strategies or sensors may have changed, too.
        """
        if are_changed and self._have_other_equipment:
            self.ctx.agent.storage.detach_agents()
        are_others = self.ctx.agent.block is not self.block
        if not kinds <= _CHANGING | (_EQUIPPING if are_others else set()):
            self._need_columns("changes agents otherwise than by putting them elsewhere or out of the game")
            return self.block
        changed = self._take_members() if are_others else None
        if not self.why:
            self._take_changes(journal, kinds, changed)
        return changed or self.block

    @property
    def _have_other_equipment(self) -> bool:
        """Whether strategies or sensors of the agents were changed."""
        members = self.members
        sensors = self.ctx.sensor.storage.share()
        known = members.sensors
        are_same = sensors is known or (sensors.sensors, sensors.keywords) == (known.sensors, known.keywords)
        each = zip(members.agents.members, members.agents.equipment, strict=True)
        return not are_same or any((agent.strategy, agent.sensors) != own for agent, own in each)

    def _take_changes(self, journal: Journal, kinds: set[int], changed: AgentBlock | None) -> None:
        """Write the nodes of agents that were placed elsewhere, and which agents live.

        Args:
            journal: the changes that a function has made.
            kinds: the kinds of these changes.
            changed: the agents, if it has created or deleted some; else None.
        """
        state = self._state
        number = self.number
        block = changed or self.block
        progressed = [name for name in map(journal.names.__getitem__, journal.progressed) if name in block.rows]
        journal.log.clear()
        journal.progressed.clear()
        numbers = self.members.numbers
        for name in progressed:
            state.movement.clear(number, self.number_of[name])
        if changed or _TURNED in kinds:
            headings = zip(numbers.tolist(), block.heading, self.members.first_headings, strict=True)
            state.headings[number] = {agent: now for agent, now, first in headings if now != first}
        block.locate()
        self.take_nodes()
        self._asked = None  # others may live
        if changed or block.placed or state.placed[number].any():
            state.placed[number, numbers] = [row in block.placed for row in range(len(numbers))]
        if changed and self.part is None and self._has_moved:
            self._core.place_newcomers(np.array([number]))
        if state.flights is not None:
            for agent, row in zip(self.members.flying, self.members.rows_in_air, strict=True):
                block.flights.copy_to(state.flights, row, 0, agent, number)
            state.has_flown[number] &= ~state.placed[number, state.flyers]
            state.placed[number, state.flyers] |= state.has_flown[number]

    def _take_facts(self) -> None:
        """Store the facts that a rule has published."""
        known = self.facts_shown
        now = self._facts
        changed = {name for name, fact in now.items() if name not in known or fact is not known[name]}
        self.facts_shown = dict(now)
        if changed & self._plan.core_keys:
            self._need_own_rules("publishes facts of rules in the core")
        if self._plan.has_array_functions:
            self._need_plan("publishes facts, which array functions may read")

    def note_looks(self, *, has_drawn: bool) -> None:
        """Ask all agents in this game from now on if a function has changed what they draw or see next in this turn."""
        what = "draws by the streams of agents" if has_drawn else "asks sensors that err, or of classes of their own"
        if (has_drawn or not self.members.are_plain) and not self._plan.asks_all:
            at_arrivals = self._parts.settings.decide == "arrival"
            is_arriving = self._core.arrival is not None
            is_moving = self.part is not None and (has_drawn or at_arrivals)
            if is_arriving or is_moving:  # agents have, any number of times
                self._raise(
                    f"A plain function {what} while agents move, and the games of a batch have not kept how far they "
                    "are: draw from ctx.rng, or let a rule do it before or after the moves."
                )
            self.game.internals.asks_all = True
            self.look = None  # so that its last looks stay
            self._need_plan(what)

    @property
    def has_other_map(self) -> bool:
        """Whether a function has changed the map since it was taken."""
        return bool(self._map.count_changes() != self.map_changes)

    def cancel(self, agent: int) -> None:
        """Cancel the move of an agent."""
        self._core.hold(self.number, agent)
        if self._state.flights is not None:
            self._state.flights.hold(agent, self.number)

    # -- a turn that is taken back -------------------------------------------------------------------------------------

    def copy_turn_values(self) -> tuple[Any, ...]:
        """Return copies of what goes back with a turn that is taken back: all but what functions have written."""
        values = self.values
        delayed = values.delayed_looks
        departed = values.departed
        shared = values.team_memories
        has_drawn = self._own["_rng"] is not None
        if not (delayed or departed or shared or has_drawn or self.undone or self._keeps_more):
            return self.members, self._moved, self.terms, self.seed  # NOTE: as in most games (w8_games.py rule)
        collectors = self._parts.collectors
        collected = collectors.snapshot() if collectors.by_name else None
        looks = {which: {**of_turns} for which, of_turns in delayed.items()}
        sensed = [last[0] for last in self.lasts] if self.look is None else ()
        doing = copy_doing(get_data(values)) if self._state.doings is not None else None
        rng = self.ctx.rng_state() if has_drawn else None
        driven = {**get_driven(values)}, self._parts_noted
        known = sensed, collected, looks, {**departed}, rng, {**self.undone}, copy_deep(shared), doing, driven
        return self.members, self._moved, self.terms, self.seed, *known

    def take_back(self, before: tuple[Any, ...]) -> None:
        """Set what `copy_turn_values` has returned; what functions have written themselves stays."""
        members, self._moved, terms, self.seed, *known = before
        nothing: Any = (), None, {}, {}, None, {}, {}, None, ({}, 0)
        sensed, collected, looks, departed, rng, undone, shared, doing, driven = known or nothing
        values = self.values
        if self._drivers:
            refill(get_driven(values), driven[0])
            self._parts_noted = driven[1]
        self.why = ""
        values.delayed_looks = looks
        values.departed = departed
        values.team_memories = shared
        self.undone = undone
        self.members = members
        self._drop_changes()
        self._take_terms_back(terms)
        self._state.seeds[self.number] = self.seed
        for last, state in zip(self.lasts, sensed, strict=False):
            last[0] = state
        self.ctx.reseed(self.seed, rng)
        if collected is not None:
            self._parts.collectors.restore(collected)
        if self._state.doings is not None:
            put_doing(get_data(values), doing)
        self.decide_again()
        self._note_epoch()

    def decide_again(self) -> None:
        """Let agents draw and look again in this turn, as if they had not."""
        if self.turns.order_now is not None:
            self.turns.order_now.slots.table.begin_again()
        for sensor, _ in self.members.counting:
            sensor.notice.reset()


def _identify(function: object, *forms: object) -> Hashable:
    """Return what a strategy, a plan or a rule is equal by: its form in the core or of arrays, or else itself.

    Args:
        function: the function.
        forms: its forms, if they are known; None: it has none.
    """
    spec = get_strategy_spec(function)
    known = [one for one in (*forms, spec.core_steps, spec.array_form) if one is not None]
    return make_form_key(known[0]) if known else Same(function)


def _are_equal(one: object, other: object) -> bool:
    """Return whether two plain values are equal, also with arrays in dicts of them."""
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(_are_equal(value, other[key]) for key, value in one.items())
    if isinstance(one, np.ndarray):
        return np.array_equal(one, np.asarray(other))
    return bool(one == other)


def _get_terms(block: AgentBlock, row: int) -> dict[str, Any]:
    """Return the team and the speed of an agent, for `AgentBlock.write`."""
    return {"teams": block.teams[row], "speed": get_speed(block, row)}


def release(row: RowOfGame) -> None:
    """Let the context of a game that has got other columns keep nothing of the columns that it had."""
    values = row.values
    values.__class__ = GameState
    values.start, values.deed_log = row._first_fields
    values.moves = None
    row.turns.read_inbox = row.turns.messages.get_received
    for last in list_last_states(row.ctx).values():
        if type(last[0]) is UnknownLook:
            last[0] = UNKNOWN_LOOK


def continue_streams(ctx: HostContext, other: HostContext) -> None:
    """Let the random streams of a context, a fork of another one, go on where those of the other are."""
    ctx.reseed(other.seed, other.rng_state())
    if other.graph.storage.has_placed:
        streams = [one.graph.storage.get_place_stream() for one in (ctx, other)]
        streams[0].bit_generator.state = streams[1].bit_generator.state


def list_last_states(ctx: HostContext) -> dict[tuple[str, str], list[Any]]:
    """Return the lists with the last states of agents, by name and "", and with the last data of their sensors."""
    return _list_last_looks(ctx.agent.storage.list_created(), ctx.agent.storage.get_turn_access)


def _list_last_looks(agents: Iterable[Any], turn_access: Callable[[Any], Any]) -> dict[tuple[str, str], list[Any]]:
    """Return the same of some agents."""
    found = {}
    for agent in agents:
        access = turn_access(agent)
        found[agent.name, ""] = access.last
        found |= {(agent.name, one): last for one, last, *_ in access.carried if type(last) is list}
    return found
