"""The game of a batch that a context shows: what functions read is read there, and their changes are taken from it."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache, partial
from typing import Any, NamedTuple, NoReturn
from weakref import WeakKeyDictionary

import numpy as np

from gamms.core.ask import GamesInContext
from gamms.core.copies import copy_deep, copy_items, copy_values
from gamms.deciding import UNKNOWN_LOOK, get_phase
from gamms.errors import BadValue
from gamms.game.block.columns import PlayedGame
from gamms.game.block.in_core import CoreGames
from gamms.game.block.state import STOPPED, GameArrays, GameRow, NeedsSeparateContext, is_exact_float
from gamms.game.cursor.called_functions import CalledFunctions
from gamms.game.cursor.own_functions import get_function_of_game
from gamms.game.cursor.pointed import (
    GuardedDict,
    Looks,
    PointedContext,
    PointedState,
    Population,
    RowValues,
    StartOfGame,
)
from gamms.game.decisions import Decisions, MadeDecisions
from gamms.game.messages import MessageTraffic
from gamms.game.movement.arrivals import AgentsUnderWay
from gamms.game.movement.courses import Courses
from gamms.game.movement.moves import TurnMoves
from gamms.game.movement.travel import ResolvedAction
from gamms.game.order import TurnOrder, TurnPart
from gamms.game.random_streams import DrawTable
from gamms.game.settings import BegunPhase, as_called
from gamms.game.slots import COUNTED
from gamms.game.snapshots import ForkSource, GameStart, copy_moves, copy_rules
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
from gamms.ir.game_state import KEPT, BlockedAgents, GameState, Scores, describe_conflict
from gamms.ir.graph import IntArray
from gamms.ir.journal import Journal
from gamms.ir.obstacles import BoolArray
from gamms.ir.schema import CHANGE_EVENTS, NUMBERS, Memo
from gamms.plain import is_plain, is_same
from gamms.typing.context import HostContext

_NUMBERS = [column.name for column in NUMBERS]
_CHANGING = {CHANGE_EVENTS[name].code for name in ("node", "previous", "alive", *_NUMBERS)}
_EQUIPPING = {AGENT_CREATE, AGENT_DELETE, AGENT_SENSOR_REGISTER, AGENT_SENSOR_DEREGISTER}
_TURNED = CHANGE_EVENTS["heading"].code
_CHANGING |= {AERIAL_AGENT_FLIGHT, AERIAL_AGENT_TURN, AGENT_ATTRIBUTE, _TURNED}


class AskedAgents(NamedTuple):
    """Agents that are asked, some of which may be dead.

    Attributes:
        order: the order of all agents.
        part: the living ones, as a part of a turn.
        places: the slot of each agent; -1: it is dead.
        members: the slots and names of the living ones.
        templates: the names of the living ones, and their states.
    """

    order: TurnOrder
    part: TurnPart
    places: list[int]
    members: list[tuple[int, str]]
    templates: list[tuple[str, dict[str, Any]]]


class StreamPositions(NamedTuple):
    """The positions of agents' random streams and sensors in a turn, for agents that are asked again.

    Attributes:
        streams: the marks by names of agents; see `AgentSlot.get_marks`.
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
    asked_of: Callable[[bytes, bytes, bytes], AskedAgents]


@dataclass
class _PopulationCaches:
    """Values derived from a set of agents of the context.

    Attributes:
        lasts: the last states of agents, and the last data of sensors, each a list of one item.
        named_lasts: the same by names; see `list_last_states`.
        notices: the detection models of sensors that count their looks, of agents that observe.
        counting: each sensor that counts its looks, and its owners.
        sees_world_only: whether all sensors that are called look only at the graph and the agents.
        are_plain: whether this holds, and repeated calls in a turn return the same data.
        order_of: returns the order of the agents, by whether all know the same facts.
    """

    lasts: list[list[Any]]
    named_lasts: dict[tuple[str, str], list[Any]]
    notices: list[Any]
    counting: list[tuple[Any, list[str]]]
    sees_world_only: bool
    are_plain: bool
    order_of: Callable[[bool], _OrderInGames]


class _Attributes:
    """The custom attributes of agents: games share them until one sets some, or reads some that may change in place.

    Args:
        agents: the agents at the start.
        may_share: whether no function changes the `__dict__` of agents directly, which nothing notices.

    Attributes:
        now: the attributes of each agent in the game that is shown.
        shown: those that the agents have.
        are_shared: whether games share attributes; else each has its own from the beginning.
    """

    def __init__(self, agents: Sequence[Any], *, may_share: bool) -> None:
        self._first = [copy_values(vars(one)) for one in agents]
        self._shared: list[dict[str, Any]] = [one.__dict__ for one in agents]
        self.are_shared = may_share and is_plain(self._first)
        self.now = self._shared
        self.shown = self._shared

    @property
    def have_changed(self) -> bool:
        """Whether those that games share have changed."""
        return self.are_shared and not is_same(self._shared, self._first)

    def take_row(self, row: RowValues | None) -> None:
        """Go to the attributes of a game; None: it has those of the start."""
        if row is not None and row.attributes is not None:
            self.now = row.attributes
        elif row is None or self.are_shared:
            self.now = self._shared
        else:
            row.attributes = [copy_values(own) for own in self._first]
            self.now = row.attributes

    def show(self, agents: Sequence[Any]) -> None:
        """Let agents have the attributes of the game that is shown."""
        for agent, own in zip(agents, self.now, strict=True):
            agent.__dict__ = own
        self.shown = self.now

    def detach_attributes(self, row: RowValues, agents: Sequence[Any]) -> None:
        """Give a game its own copy of shared attributes."""
        if row.attributes is None:
            row.attributes = copy_deep(self.shown)
            self.now = row.attributes
            self.show(agents)

    def keep(self, row: RowValues) -> None:
        """Let a game keep the attributes that are shown, which a function has changed; others share copies."""
        if row.attributes is None:
            row.attributes = self.shown
            self.now = self.shown
            self._shared = copy_deep(self._first)

    def release(self, agents: Sequence[Any]) -> None:
        """Let the agents of the start have the attributes that they had then."""
        for agent, own in zip(agents, self._first, strict=True):
            agent.__dict__ = own


class ShownGame(GamesInContext):
    """The game of a batch that a context shows, and what functions change in it.

    The context has one set of agents. They show the game that it is pointed at. If a plain function changes what the
    core cannot change, its game leaves: it goes on from there in a context of its own, see `take_along`. If a function
    reads what a batch does not keep, it is refused. The context shows games until `release`.

    Args:
        game: the game at its start, whose context is pointed at other games.
        pointed: points the context at games.
        state: the state of all games.
        core: plays the games in the core.
        called: the functions that are called.

    Attributes:
        number_of: name -> the number of the agent in the roster.
        block: the agents of the game.
        cached: values derived from the agents.
        ordered: the order of the agents.
        part: the part of the turn in which agents are about to move; None: they are not.
        have_joined: whether agents created in this part of the turn take part in it.
        has_ended: whether a function has ended the game.
        begun: the phase that is played, if a game can leave in it and go on from there; else None.
        refusal: why a game can neither go on here nor leave; None: all can.
        refused: the number of this game; -1: it is unknown; None: all can.
    """

    _pointed: PointedContext
    _state: GameArrays
    row: RowValues | None
    journal: Journal
    block: AgentBlock
    cached: _PopulationCaches
    ordered: _OrderInGames

    def __init__(
        self, game: PlayedGame, pointed: PointedContext, state: GameArrays, core: CoreGames, called: CalledFunctions
    ) -> None:
        parts = game.internals.parts
        values = parts.state
        super().__init__(pointed, get_phase(game.ctx), state, state.stop.data, vars(game.ctx), values.facts)
        self._game = game
        self._core = core
        self._called = called
        self._ctx = game.ctx
        self._parts = parts
        self._turns = parts.turns
        self._values = values
        self.part: int | None = None
        self.have_joined = False
        self.has_ended = False
        self.begun: BegunPhase | None = None
        self.refusal: BadValue | None = None
        self.refused: int | None = None
        self._under_way: AgentsUnderWay | None = None  # of the game that leaves
        pointed.hold()
        self._first_looks = {key: last[0] for key, last in list_last_states(self._ctx).items()}
        self.number_of = {name: i for i, name in enumerate(state.roster.names)}
        self.looks = GuardedDict({}, None, lambda _: self.refuse_look())
        self._known_caches: WeakKeyDictionary[Population, _PopulationCaches] = WeakKeyDictionary()
        self._attributes = _Attributes(pointed.population.agents.members, may_share=not called.change_attributes)
        self._take_shown()
        self._turns.note_departed()
        self._first_data = {key: one for key, one in values.data.items() if key not in called.core_keys}
        self._first_core_data = {key: one for key, one in values.data.items() if key in called.core_keys}
        self._first_facts = dict(self._facts)
        self._facts_own: dict[str, Any] | None = None  # of the game, if they are not the first ones
        self.facts_shown = self._first_facts
        self._alive: bytes | None = None  # the agents whose order is taken; None: unknown
        self._is_public = True  # whether that is the order of agents that know the same facts
        self._scores_before: dict[Any, Any] = {}
        self._num_events = 0  # of the events and messages that were read
        self._num_messages = 0
        self._has_own = bool(
            called.asks_all or called.own_functions or state.radio is not None or not self._attributes.are_shared
        )
        self.has_more = self._has_own
        self._kept_start = values.start
        self._kept_deeds = values.deed_log
        if state.radio is not None:
            self._turns.read_inbox = partial(self._read_inbox, state.radio)
        self._begin()
        self._fixed = self._list_fixed_values()
        self._note_epoch()

    def _begin(self) -> None:
        """Let the state of the context read the game that is shown."""
        values = self._values
        pointed = self._pointed
        self._phase.before_reading = self._copy_attributes
        values.__class__ = PointedState
        values.start = StartOfGame(
            self._pointed, self.read, self.get_own_row, self._end, self._replace_data, self._refuse_verb
        )
        values.deed_log = self._state.deed_log
        values.has_begun = True
        values.blocked = BlockedAgents()
        pointed.reads_rows = True
        pointed.number = -1
        self._show_facts(None)

    def release(self) -> None:
        """Restore the context as it was before it was pointed at games."""
        values = self._values
        turns = self._turns
        values.__class__ = GameState
        values.start = self._kept_start
        values.deed_log = self._kept_deeds
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
        self._attributes.release(self._agents)
        for last in self.cached.lasts:
            last[0] = {}
        self._pointed.release()

    @property
    def has_changed_shared(self) -> bool:
        """Whether a function has changed attributes of agents that games share."""
        return self._attributes.have_changed

    def go_on(self, before: "ShownGame") -> None:
        """Go on with the part of the turn in which another object has shown games."""
        self.part = before.part
        self.have_joined = before.have_joined
        self.begun = before.begun

    def refuse(self, what: str, way_out: str) -> NoReturn:
        """Refuse what a function has done that a batch notices too late, because its code does not say so.

        Args:
            what: the forbidden call, in words.
            way_out: how its code says so.

        Raises:
            BadValue: always.
        """
        self.why = ""
        self.refused = self._pointed.number
        self.refusal = BadValue(
            f"A plain function {what}, and the games of a batch have not kept what this needs. Its code does not say "
            f"that it does so: {way_out}. Then the games keep what they need, or are played one after the other."
        )
        raise self.refusal

    def refuse_look(self) -> NoReturn:
        """Refuse to read what agents have sensed in earlier turns; see `refuse`."""
        self.refuse(
            "reads what agents have sensed in earlier turns",
            "write agent.state, or sensor.data of agent.sensors, in the function itself",
        )

    def _refuse_verb(self, what: str) -> NoReturn:
        """Refuse a verb that no function may call in a turn; the argument says which, in words."""
        self.refuse(what, "play and reset a game between two turns, not in a function that a turn calls")

    def say_why(self, what: str) -> None:
        """Set why the game leaves, unless it is known."""
        self.why = self.why or f"a plain function {what}"

    def go_alone(self, what: str) -> NoReturn:
        """Let the current game go on in a context of its own; the argument says why, in words."""
        self.say_why(what)
        raise NeedsSeparateContext(self.why)

    def _note_read(self, what: str) -> None:
        """Let the current game go on alone after the function that is called; the argument says why, in words."""
        self.read_of_core = self.read_of_core or what

    def take_along(self, positions: StreamPositions | None) -> Any:
        """Return the game that is shown, which leaves, in a context of its own; Any: it is a `Game`.

        The context has what functions have changed. The game is in the middle of a turn: its next `step` plays the
        rest of it.

        Args:
            positions: the streams and looks of agents that functions have decided for at arrivals; None: for none.
        """
        begun = self.begun
        assert begun is not None  # noqa: S101 - functions are called in a phase
        self._refuse_kept_rows()
        is_within = begun.phase not in ("before", "after")
        drawn = {}
        if self._core.arrival is not None and self.has_other_map:
            begun = begun._replace(map_before=self._pointed.map_before)
        if begun.phase == "arrive" or (begun.phase == "decide" and self._core.arrival):
            self._under_way = self._hand_over_arrivals(begun.phase)
            begun = begun._replace(under_way=self._under_way)
            drawn = self._continue_streams(self._under_way, positions)
        earlier = self._show_decisions(begun) if is_within else None
        if begun.phase == "decide":
            decided = self._hand_over() if self.raised is None else None
            begun = begun._replace(decided=decided)
            self._forget_other_looks(decided)
        sensed = frozenset(key for key, last in list_last_states(self._ctx).items() if last[0] is not self.looks)
        self.looks.is_filled = True  # with nothing; deleted agents have it, too
        self._fill_fields()
        source = ForkSource(self._parts, only_plain=False)
        ctx, memo = self._make_fork(source)
        parts = ctx.game.internals.parts
        state = parts.state
        state.start = GameStart(self._pointed.at_rest, None, (ctx.seed, None))  # what planners know of other agents
        state.has_begun = True
        state.under_way = None
        state.parts_played = None
        for name in self._read["memories"]:
            state.get_memory(name)
        parts.rules.unchecked = copy_rules(self._parts.rules.unchecked, memo)
        raised = None if isinstance(self.raised, NeedsSeparateContext) else self.raised
        parts.turns.begun = begun._replace(rules=copy_rules(begun.rules, memo), raised=raised, sensed=sensed)
        parts.turns.note_departed()  # from here on
        parts.turns.restore(drawn | source.snapshot.part("turns"))
        parts.turns.phase.read_last_turn()  # before other agents decide
        if self._phase.strategy_changes == self._changes[0]:
            parts.turns.prepared = parts.turns.phase.strategy_changes
        self._copy_named_edges(state, earlier if is_within else self.read("moves"), is_within=is_within)
        if earlier is not None:
            parts.turns.whole = copy_moves(earlier, parts, memo)
        if is_within:
            self._copy_logs(state, parts.turns.messages, begun)
        for key, last in list_last_states(ctx).items():
            if key not in sensed:
                last[0] = UNKNOWN_LOOK
        return ctx.game

    def _refuse_kept_rows(self) -> None:
        """Refuse to let a game leave if array functions keep values by agent, and it has other agents than the batch.

        Raises:
            BadValue: see `refuse`.
        """
        roster = self._state.roster
        row = GameRow.from_game(self._state, self._pointed.number)
        known = {*self._ctx.agent.agents, *self.get_own_row().departed}
        if row.keeps_for_agents and not known >= {*roster.names}:
            name = next(name for name in roster.names if name not in known)
            self.refuse(
                f"lets its game leave the batch ({self.why}), where keep(key, make) has a place for agent {name!r}, "
                "which has not come",
                "keep arrays of the shape (games,), or reserve no agents",
            )

    def _hand_over_arrivals(self, phase: str) -> AgentsUnderWay:
        """Return the agents of the game that leaves while they arrive."""
        number = self._pointed.number
        agents = np.sort(self._population.numbers)
        names = [self._state.roster.names[i] for i in agents.tolist()]
        order = self.ordered.order
        speeds = [order.slots[order.index_of[name]].speed for name in names]
        found = self._core.hand_over(number, agents, names, speeds, decides=phase == "decide")
        actions: dict[str, ResolvedAction] = {}
        if self._state.flights is not None:
            acting = np.where(found.moves, agents, -1)
            actions = {names[place]: one for place, one in self._make_flights(acting, found.starts).items()}
        node_of = dict(zip(names, found.starts, strict=True))
        named = self._core.edges.find(number, agents, self._state.movement.columns).tolist()
        for name, edge in zip(names, named, strict=True):
            if edge >= 0:
                actions[name] = ResolvedAction(node_of[name], (node_of[name],), edge=edge)
        headings = {}
        now = self._core.turned if self._core.arrival else len(self._state.turning)
        for place, (game, agent, heading) in enumerate(self._state.turning):
            name = self._state.roster.names[agent]
            if game == number and place >= now:
                headings[name] = heading
            elif game == number:
                action = actions.get(name) or ResolvedAction(node_of[name], (node_of[name],))
                actions[name] = action._replace(heading=heading)
        return found._replace(actions=actions, headings=headings)

    def _continue_streams(
        self, under_way: AgentsUnderWay, positions: StreamPositions | None
    ) -> dict[str, tuple[Any, Any]]:
        """Let sensors count on in this turn; return the positions of agents' streams, see `AgentSlot.get_marks`."""
        known = positions or StreamPositions({}, [])
        counts = dict(zip(under_way.names, under_way.count_decisions(), strict=True))
        is_asked = {id(notice) for notice in self.cached.notices}
        for notice, looks in zip(self.cached.notices, known.looks, strict=False):
            if not under_way.decides:
                notice.go_to(looks)
        for sensor, owners in self.cached.counting:
            looks_in_core = {name: (self._values.turn, counts[name]) for name in owners if counts.get(name)}
            asked_looks = sensor.notice.mark() if id(sensor.notice) in is_asked else {}
            sensor.notice.go_to(looks_in_core | asked_looks)
        drawn = self._core.drawn[self._pointed.number].tolist()
        named = {name: drawn[self.number_of[name]] for name in under_way.names}
        return {name: (count, None) for name, count in named.items() if count} | known.streams

    def _make_fork(self, source: ForkSource) -> tuple[Any, Memo]:
        """Return a context with the game, whose random streams go on, and the counterparts of objects in it."""
        row = self.get_own_row()
        if row.collectors is not None:
            collected = row.collectors.snapshot()
            now = self._parts.collectors.snapshot()
            source.put_collectors({name: collected.get(name, one) for name, one in now.items()})
        functions = [(one, get_function_of_game(one, self._pointed.number)) for one in self._called.own_functions]
        ctx, memo = source.make_fork(self._ctx.seed, functions=functions)
        made = ctx.game.internals.parts
        made.state.collected = made.collectors.list_last_numbers(made.state.turn)
        ctx.reseed(self._ctx.seed, self._ctx.rng_state())
        if self._ctx.graph.storage.has_placed:
            streams = [one.graph.storage.get_place_stream() for one in (ctx, self._ctx)]
            streams[0].bit_generator.state = streams[1].bit_generator.state
        return ctx, memo

    def _copy_logs(self, state: GameState, messages: MessageTraffic, begun: BegunPhase) -> None:
        """Let a fork go on with the deeds of this part of the turn, and with the messages that will be sent after it.

        While agents decide, there are no deeds yet, and the messages are those of earlier parts.
        """
        number = self._pointed.number
        if begun.under_way is not None:
            numbers = [*map(self.number_of.get, sorted(self._ctx.agent.agents))]  # None: it has no row
            slots = {number: i for i, number in enumerate(numbers) if number is not None}
            self._state.deed_log.copy_wanted(number, state.deed_log, begun.part, slots)
        elif self.part is not None:
            self._state.deed_log.copy_part(number, state.deed_log)
        if self._state.radio is not None:
            self._state.radio.copy_admitted(number, messages)

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

    def _show_decisions(self, begun: BegunPhase) -> TurnMoves | None:
        """Show what agents have decided in this turn besides their moves.

        Returns:
            The moves of the earlier parts of the turn; None: it is the first.
        """
        number = self._pointed.number
        part = begun.part
        games = np.array([number])
        here, _, took_part = (column[0] for column in self._core.get_next_moves(games, part))
        if begun.under_way is not None:
            here = here.copy()
            starts = dict(zip(begun.under_way.names, begun.under_way.starts, strict=True))
            here[[self.number_of[name] for name in starts]] = self._state.streets.rows([*starts.values()])
        has_moved = self._core.part_of < part
        moves: TurnMoves | None = self.read("moves")
        for game, agent, heading in self._state.turning if begun.phase not in ("arrive", "decide") else ():
            if game == number:
                assert moves is not None  # noqa: S101 - it has those of this turn
                moves.set_heading(moves.order.index_of[self._state.roster.names[agent]], heading)
        if part == 0 or begun.order is None:
            return None
        starts, ends, _ = (column[0] for column in self._core.get_last_moves(games))
        starts, ends = (np.where(has_moved, column, here) for column in (starts, ends))
        return self._make_moves_between(starts, ends, took_part, has_moved).fit_to_parts(begun.order)

    def _hand_over(self) -> MadeDecisions:
        """Return the decisions of the agents of the game, which were asked last."""
        turns = self._turns
        order, part = turns.asked_part
        names = order.names
        members = part.select_present(part.members)
        others = {*part.select_present(part.observing)}.difference(members)
        sensed = {names[i]: turns.seen[i]["sensor"] for i in others}
        answers: Decisions = turns.answers
        return answers.hand_over(members, sensed)

    def _forget_other_looks(self, decided: MadeDecisions | None) -> None:
        """Forget what agents have sensed, but for those of the game that leaves while they decide."""
        if self._called.asks_all:
            return
        have_decided = () if decided is None else decided.ends
        have_looked = () if decided is None else {*decided.ends, *decided.sensed}
        for (name, sensor), last in list_last_states(self._ctx).items():
            if name not in (have_looked if sensor else have_decided):
                last[0] = self.looks

    def _fill_fields(self) -> None:
        """Put what only the core has into the fields of the game that leaves."""
        row = self.get_own_row()
        self._turns.restart_counts()
        for name in ("counts", "errors"):
            self._read.pop(name, None)  # refusals are noted after functions have read them
        data = self.read("data")
        if type(data) is GuardedDict:
            data.fill()
            self._read["data"] = {**data}
        of_arrays = GameRow.from_game(self._state, self._pointed.number).of_arrays
        if of_arrays and KEPT not in self._called.core_keys:  # of array strategies alone
            self._read["data"] = {**self._read["data"], KEPT: of_arrays}
        if type(row.data) is GuardedDict:  # which the batch goes on with, if it takes the turn back
            row.data = {key: one for key, one in dict.items(row.data) if key not in self._called.core_keys}
        self.read("memories")
        self._values.blocked = self._make_blocked()

    def _make_blocked(self) -> BlockedAgents:
        """Return why actions of agents were not executed in their last turns."""
        state = self._state
        number = self._pointed.number
        names = state.roster.names
        found = BlockedAgents(self.get_own_row().undone)
        told = {*found, *(names[number] for number in self._called.asked)}  # asked agents are told in `undone`
        begun = self.begun
        decided = 0 if self.part is None else self.part + 1  # the parts of the turn in which agents have decided
        if begun is not None and begun.phase in ("arrive", "decide"):
            decided = begun.part
        has_decided = self._core.part_of < decided
        if self._under_way is not None:
            counts = zip(self._under_way.names, self._under_way.count_decisions(), strict=True)
            has_decided[[self.number_of[name] for name, count in counts if count]] = True
        for error in state.errors.list_entries(number):
            last = state.turn[number] - (not has_decided[self.number_of[error["agent"]]])
            if error["turn"] == last and error["agent"] not in told:
                found.add(error["agent"], error["message"])
        is_known = state.blocked[number].copy()
        if state.turn[number] == self._called.first.turn:  # others were blocked before the game was in the batch
            is_known &= has_decided
            for name, why in self._called.first.blocked.items():
                if not has_decided[self.number_of[name]]:
                    found.setdefault(name, why)
        for agent in np.flatnonzero(is_known).tolist():  # in its last turn
            why = describe_conflict(self._core.get_wanted_place(number, agent))
            if why not in found.get(names[agent], ""):
                found.add(names[agent], why)
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

    def _take_shown(self) -> None:
        """Read the agents that the context has from now on."""
        population = self._pointed.population
        self._population = population
        self.block = population.block
        self._agents = population.agents.members
        self.journal = population.journal
        self.cached = self._get_caches(population)
        self.lasts = self.cached.lasts
        self._alive = None
        self._attributes.shown = []  # unknown
        self.forget_looks()

    def _get_caches(self, population: Population) -> _PopulationCaches:
        """Return the values derived from the agents of the context, which are these."""
        if population not in self._known_caches:
            self._known_caches[population] = self._make_caches(population.agents.members)
        return self._known_caches[population]

    def _make_caches(self, agents: Sequence[Any]) -> _PopulationCaches:
        access = self._ctx.agent.storage.get_turn_access
        named = _list_ends_of_deeds(agents, access)
        owned = [(sensor, agent.name) for agent in agents for sensor in agent.sensors.values()]
        sensors = [sensor for sensor, _ in owned]
        observing = (agent for agent in agents if agent.name in self._called.observing)
        carried = [sensor for agent in observing for sensor in agent.sensors.values()]
        looks = [(one, one.in_arrays()) for one in sensors if hasattr(one, "in_arrays")]
        counting = {id(one): one.notice for one, look in looks if look is not None and not look.is_plain}
        notices = [counting[id(one)] for one in carried if id(one) in counting]
        sees_world_only = all(getattr(one, "sees_world_only", False) for one in carried)
        are_plain = not counting and all(getattr(one, "sees_world_only", False) for one in sensors)
        owners: dict[int, tuple[Any, list[str]]] = {}
        for sensor, name in owned:
            if id(sensor) in counting:
                owners.setdefault(id(sensor), (sensor, []))[1].append(name)
        return _PopulationCaches(
            [*named.values()], named, notices, [*owners.values()], sees_world_only, are_plain, cache(self._make_order)
        )

    def begin_counts(self) -> None:
        """Count the looks of sensors in each game from now on: some have looked in the turn, if agents are moving."""
        self.has_more = self._has_own or (self.part is not None and len(self.cached.counting) > 0)
        for sensor, _ in self.cached.counting:
            sensor.notice.reset()

    def _show_counts(self) -> None:
        """Show how often sensors have looked before agents move: once, if their owners have decided."""
        part = self.part or 0
        _, _, took_part = self._core.get_next_moves(np.array([self._pointed.number]), part)
        have_looked = took_part[0] & (self._core.part_of <= part)
        for sensor, owners in self.cached.counting:
            sensor.notice.go_to({name: (self._values.turn, 1) for name in owners if have_looked[self.number_of[name]]})

    def has_asked(self) -> bool:
        """Return whether a function has called sensors."""
        if not self._called.asks_all:
            return super().has_asked()
        return any(last[0] is not self._looks_shown[key] for key, last in self.cached.named_lasts.items())

    def keep_looks(self) -> None:
        """Keep what agents have sensed in the row of the game, if functions may read it."""
        if self._called.asks_all:
            self.get_own_row().looks = {key: last[0] for key, last in self.cached.named_lasts.items()}

    def get_looks(self, row: RowValues) -> Looks:
        """Return what the agents of a game have sensed."""
        if row.looks is None:
            row.looks = {key: copy_deep(one) for key, one in self._first_looks.items() if key[1] or not one}
            for (name, sensor), one in self._first_looks.items():
                if one and not sensor:  # the state of an agent in a game that has begun
                    row.looks[name, ""] = {**one, "memory": row.memories[name]}
        return row.looks

    def _show_looks(self) -> None:
        """Show what the agents of the game have sensed."""
        self._looks_shown = dict(self.get_looks(self.get_own_row()))
        for key, last in self.cached.named_lasts.items():
            last[0] = self._looks_shown[key]

    def forget_looks(self) -> None:
        """Forget what agents have sensed, unless functions may read it."""
        if self._called.asks_all:
            return
        for last in self.cached.lasts:
            last[0] = self.looks

    def show_more(self) -> None:
        """Show the values in Python of the game that the context is pointed at."""
        pointed = self._pointed
        if pointed.population is not self._population:
            self._take_shown()
        for own in self._called.own_functions:
            own.number = pointed.number
        self._show_row()
        if self._alive is None:
            self._take_order()
        elif pointed.alive != self._alive:
            self._alive = pointed.alive
            self.ordered.order.take_lives()
        if self._attributes.shown is not self._attributes.now:
            self._attributes.show(self._agents)
        if self._called.asks_all:
            self._show_looks()
        if self.part is not None and self.cached.counting:
            self._show_counts()
        if self._phase.epoch != self.epoch:
            self._note_epoch()

    def _show_row(self) -> None:
        """Show the Python values of the game."""
        row = self.row
        if row is None and not self._attributes.are_shared:
            row = self.get_own_row()
        self._own_of_ctx["_rng"] = None if row is None else row.rng
        is_public = row is None or not (row.agent_facts or row.team_facts)
        if is_public != self._is_public:
            self._is_public = is_public
            self._alive = None
        facts = None if row is None else row.facts
        if facts is not self._facts_own:
            self._show_facts(facts)
        self._attributes.take_row(row)
        if row is not None and not (row.rng is None and facts is None and row.attributes is None and is_public):
            self._pointed.shows_more = True

    def _read_inbox(self, radio: MessageTraffic, name: str) -> list[dict[str, Any]]:
        """Return the messages that an agent of the game hears in its next turn."""
        return radio.make_inbox(self._pointed.number, self._values.turn, name)

    def get_own_row(self) -> RowValues:
        """Return the Python values of the game that the context is pointed at; make them if there are none."""
        row: RowValues = self._pointed.get_row(self._pointed.number)
        self.row = row
        return row

    def _show_facts(self, own: dict[str, Any] | None) -> None:
        """Show the facts of a game; None: the facts published before the batch."""
        self._facts_own = own
        self.facts_shown = self._first_facts if own is None else own
        self._facts.clear()
        self._facts.update(self.facts_shown)

    def _copy_attributes(self) -> None:
        """Give the game its own attributes before one is read that may change in place."""
        if any(type(one) is tuple and one[0] == AGENT_ATTRIBUTE for one in self.journal.log):
            self._attributes.keep(self.get_own_row())  # the function that reads it has set some
        else:
            self._attributes.detach_attributes(self.get_own_row(), self._agents)
        self._pointed.shows_more = True

    def _take_order(self) -> None:
        """Use the turn order of the agents of the game, and let the living ones take part."""
        self._alive = None
        self._pointed.shows_more = True  # if settings refuse the order, the next game takes it again
        self.ordered = self.cached.order_of(self._is_public)
        self.table = self.ordered.table
        self._turns.take_order(self.ordered.order)
        self.ordered.order.take_lives()
        self._alive = self._pointed.alive

    def _make_order(self, is_public: bool) -> _OrderInGames:  # noqa: ARG002 - on which the order depends
        """Return the order of the agents of the context; they may know the same facts or not."""
        order = self._turns.make_order()
        order.slots.get_slots(range(len(order.slots)))  # now: later the context may have the agents of another game
        return _OrderInGames(order, order.slots.table, lru_cache(1024)(partial(self.make_asked, order)))

    def _make_order_of_population(self, population: Population) -> TurnOrder:
        """Return the order of other agents than the present ones, some of which may have been deleted."""
        if population is self._population:
            return self.ordered.order
        with self._phase.suspend():  # a strategy may ask how agents have moved
            with self._pointed.show_population(population):
                found = self._get_caches(population).order_of(self._is_public)
            if not self._pointed.has_other_agents():
                self._take_order()
        return found.order

    def make_asked(self, order: TurnOrder, asked: bytes, observing: bytes, _: bytes) -> AskedAgents:
        """Return the living agents that are asked, and the living agents that only observe, given their numbers."""
        names = self._state.roster.names
        named = [names[number] for number in np.frombuffer(asked, np.int64).tolist()]
        living = {order.names[i]: i for i in order.list_present()}
        places = [living.get(name, -1) for name in named]
        members = [(i, name) for i, name in zip(places, named, strict=True) if i >= 0]
        part = order.whole
        if len(members) < len(order.slots):
            part = order.make_part([i for i, _ in members])
        others = {living.get(names[number], -1) for number in np.frombuffer(observing, np.int64).tolist()} - {-1}
        if others:
            part.let_observe(others)
        templates = [(name, order.slots[i].template) for i, name in members]
        return AskedAgents(order, part, places, members, templates)

    # -- fields that are made when they are read -----------------------------------------------------------------------

    def read(self, name: str) -> Any:
        """Return a field of the game that the context is pointed at."""
        read = self._read
        if name not in read:
            read[name] = getattr(self, f"_make_{name}")()
        return read[name]

    def _make_data(self) -> dict[Any, Any]:
        row = self.get_own_row()
        if row.data is None:
            row.data = self._copy_of_data(self._first_data)
        elif self._called.core_keys and type(row.data) is not GuardedDict:  # of a game that begins with other data
            own = {key: one for key, one in row.data.items() if key not in self._called.core_keys}
            row.data = self._copy_of_data(own)
        elif type(row.data) is GuardedDict:  # which another object has made, if a game has left since
            row.data.fill_by(self._show_core_data)
        return row.data

    def _make_over(self) -> dict[str, Any] | None:
        return self._state.over[self._pointed.number]

    def _end(self, over: dict[str, Any] | None) -> None:
        """End the game that the context is pointed at."""
        number = self._pointed.number
        self._state.over[number] = over
        self._state.is_going[number] = over is None
        self._read["over"] = over
        self.has_ended = True

    def _copy_of_data(self, data: dict[Any, Any]) -> dict[Any, Any]:
        values: dict[Any, Any] = copy_items(dict(dict.items(data)))
        if not self._called.core_keys:
            return values
        return GuardedDict(values, self._called.core_keys, self._show_core_data)

    def _show_core_data(self, data: GuardedDict) -> None:
        """Put the data of rules in the core into `ctx.game.data`."""
        self._note_read(f"reads ctx.game.data, with that of {', '.join(sorted(self._called.core_keys))}")
        self._take_events()
        game = GameRow.from_game(self._state, self._pointed.number)
        for key, value in self._first_core_data.items():
            data[key] = copy_deep(value)
        if KEPT in self._called.core_keys:
            data[KEPT] = game.of_arrays
        if self._read.get("data") is data:  # else it was replaced
            with self._phase.suspend(changes_world=False):
                for rule in as_called(self._game.rules):
                    if rule.spec.show_arrays is not None:
                        rule.spec.show_arrays(self._ctx, game, self._read["events"], None)

    def _replace_data(self, data: dict[Any, Any]) -> None:
        if self._called.core_keys:
            self._note_read("replaces ctx.game.data")
        self.get_own_row().data = data
        self._read["data"] = data

    def _make_began(self) -> dict[str, Any]:
        state = self._state
        begun = np.flatnonzero(state.start[self._pointed.number] >= 0)
        nodes = state.streets.ids(state.start[self._pointed.number, begun]).tolist()
        starts: dict[str, Any] = dict(zip((state.roster.names[i] for i in begun), nodes, strict=True))
        if state.flights is not None:
            places = map(tuple, state.start_position[self._pointed.number].tolist())
            flying = zip((state.roster.names[i] for i in state.flyers), places, strict=True)
            starts |= {name: place for name, place in flying if name in starts}
        return starts

    def _make_driven(self) -> dict[str, tuple[int, ...]]:
        traffic = self._state.movement.traffic
        if traffic is None:
            return {}
        number = self._pointed.number
        names = self._state.roster.names
        found = {names[agent]: traffic.list_driven(number, agent) for agent in np.flatnonzero(traffic.obeys).tolist()}
        return {name: edges for name, edges in found.items() if edges}

    def _make_scores(self) -> Scores:
        self._scores_before = self._state.scores.get_scores(self._pointed.number)
        scores = Scores()
        dict.update(scores, self._scores_before)
        return scores

    def _make_events(self) -> list[dict[str, Any]]:
        found = self._state.events.list_entries(self._pointed.number)
        self._num_events = len(found)
        return found

    def _make_messages(self) -> list[dict[str, Any]]:
        radio = self._state.radio
        found = [] if radio is None else radio.list_entries(self._pointed.number)
        self._num_messages = len(found)
        return found

    def _make_errors(self) -> list[dict[str, Any]]:
        return self._state.errors.list_entries(self._pointed.number)

    def _make_counts(self) -> dict[str, dict[str, int]]:
        state = self._state
        columns = {kind: state.counts[kind][self._pointed.number].tolist() for kind in COUNTED}
        names = enumerate(state.roster.names)
        now = {name: {kind: column[i] for kind, column in columns.items()} for i, name in names}
        return self._called.first.counts | now

    def _make_memories(self) -> dict[str, dict[Any, Any]]:
        self._note_read("reads ctx.game.memories")
        number = self._pointed.number
        found = self.get_own_row().memories
        has_decided = self._has_moved or self.part is not None or self._under_way is not None
        for name, memory in self._core.get_memories(number).items() if has_decided else ():
            found[name].update(memory)
        return {**found}

    def _make_moves(self) -> TurnMoves | None:
        """Return the moves of the last turn of the game, or the moves about to be made; None: there are none."""
        part = self.part
        number = self._pointed.number
        games = np.array([number])
        if part is not None:
            acts = self._core.part_of == part
            starts, ends, took_part = (column[0] for column in self._core.get_next_moves(games, part))
            return self._make_moves_between(starts, ends, took_part, acts)
        if not self._has_moved:
            return self._called.first.moves
        starts, ends, took_part = (column[0] for column in self._core.get_last_moves(games))
        if not (took_part.any() and self._core.knows_paths):
            return None
        moves = self._make_moves_between(starts, ends, took_part, None)
        parts = self._parts.settings.order
        return moves if parts is None or self._core.courses is not None else moves.fit_to_parts(parts)

    @property
    def _has_moved(self) -> bool:
        """Whether agents have moved in the batch; else the last moves are those of the turn before."""
        number = self._pointed.number
        return self._state.turn[number] > self._called.first.turn or self._core.count_played_parts(number) > 0

    @property
    def _moment(self) -> tuple[int, int | None, bool]:
        """The number of turns played, the part in which agents are about to move, and whether newcomers take part."""
        return int(self._state.turn[self._pointed.number]), self.part, self.have_joined

    def _make_moves_between(
        self, starts: IntArray, ends: IntArray, took_part: BoolArray, acts: BoolArray | None
    ) -> TurnMoves:
        """Return the moves of the agents that took part; those that do not act stay, None: all act."""
        population = self._population
        moved = None if self.row is None else self.row.moved
        if moved is not None and moved[0] == self._moment:
            population = moved[1]
        order = self._make_order_of_population(population)
        ids = self._state.streets.ids
        courses = self._core.courses
        numbers = np.sort(population.numbers)
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
            paths = courses.get_game_paths(self._pointed.number, acting, standing)
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
            position, quat = flights.get_wanted(int(numbers[place]), self._pointed.number)
            found[place] = ResolvedAction(node, (node,), position=position, quat=quat)
        return found

    def _follow_named_edges(
        self, numbers: IntArray, ends: Sequence[int], starts: Sequence[int]
    ) -> dict[int, ResolvedAction]:
        """Return the moves along edges that actions have named, by the places of the agents among these numbers."""
        edges = self._core.edges.find(self._pointed.number, numbers, self._state.movement.columns)
        return {
            place: ResolvedAction(ends[place], (starts[place], ends[place]), edge=int(edges[place]))
            for place in np.flatnonzero(edges >= 0).tolist()
        }

    def _resolve_driven(
        self, numbers: IntArray, courses: Courses, actions: Mapping[int, ResolvedAction]
    ) -> dict[int, ResolvedAction]:
        """Return the moves of agents that obey turns, with all their edges, by their places among these numbers."""
        traffic = self._state.movement.traffic
        assert traffic is not None  # noqa: S101 - some obey turns
        found = {}
        for place in np.flatnonzero(numbers >= 0).tolist():
            agent = int(numbers[place])
            if not traffic.obeys[agent]:
                continue
            path, edges = courses.list_driven(self._pointed.number, agent)
            one = actions.get(place) or ResolvedAction(path[-1], path)
            edge = edges[0] if one.edge is None and len(edges) == 1 else one.edge
            found[place] = one._replace(end=path[-1], path=path, edge=edge, edges=edges)
        return found

    # -- what functions change -----------------------------------------------------------------------------------------

    def take(self) -> None:
        """Write the changes of a game into the columns; the game leaves if they are of values that all games share.

        See `has_changed`.
        """
        journal = self.journal
        phase = self._phase
        rng = self._own_of_ctx["_rng"]
        if rng is not None:
            self.get_own_row().rng = rng
        is_other = phase.epoch != self.epoch
        are_changed = is_other and (phase.strategy_changes, phase.sensor_changes) != self._changes
        have_changed = bool(journal.log or journal.progressed or are_changed)
        have_facts = self._facts != self.facts_shown
        self._pointed.shows_more = self._pointed.shows_more or is_other or have_changed or have_facts or rng is not None
        if self._pointed.map.count_changes() != self._pointed.map_changes:
            self._take_roads()  # before the agents, which may be on new nodes
        if is_other and self._list_fixed_values() != self._fixed:
            self.go_alone("changes settings, rules or collectors")
        block = self._take_agents(journal) if have_changed else self.block
        if self._read:
            self._take_logs(self._read)
        for name in _NUMBERS:
            self._state.numbers[name][self._pointed.number, self._population.numbers] = getattr(block, name)
        if have_facts:
            self._take_facts()
        if self.read_of_core:
            self.go_alone(self.read_of_core)

    def _take_population(self) -> AgentBlock:
        """Store the agents that a function has created or deleted for its game; return their new block."""
        number = self._pointed.number
        before = self._population
        agents = self._ctx.agent.agents
        roster = self._state.roster
        known = {agent.name: agent for agent in before.agents.members}
        first = dict(zip(self._pointed.first.agents.members, self._pointed.first.agents.equipment, strict=True))
        new = [agent for name, agent in agents.items() if known.get(name) is not agent]
        self._turns.note_departed()
        row = self.get_own_row()
        if row.moved is None or row.moved[0] != self._moment:
            row.moved = self._moment, before  # also for a game that leaves
        if not all(map(roster.can_hold, new)):
            self.go_alone("creates agents for which most_agents= has reserved no rows")
        if any(first.get(agent, own) != own for agent in agents.values() for own in [(agent.strategy, agent.sensors)]):
            self.go_alone("changes strategies or sensors of agents")
        self._attributes.keep(row)
        for name in [name for name, agent in known.items() if agents.get(name) is not agent]:
            self._core.leave(number, self.number_of[name], row.departed[name][1])
        for agent in new:
            place = self.number_of[agent.name]
            start = self._values.began[agent.name]
            self._core.enter(number, place, start, agent.current_node_id, after_moves=self.part is None)
            if self.part is not None:  # it does not make the move of a deleted agent of its name
                self.cancel(place)
        attributes = {agent.name: agent.__dict__ for agent in agents.values()}
        looks: Looks = {key: last[0] for key, last in list_last_states(self._ctx).items()}
        found = self._pointed.take_population(number)
        self._take_shown()
        row.attributes = [attributes[agent.name] for agent in self._agents]
        self._attributes.take_row(row)
        self._fixed = self._list_fixed_values()
        if self._called.asks_all:
            row.looks = looks
        return found.block

    def _take_logs(self, read: dict[str, Any]) -> None:
        """Write the changes of the scores and the events of a game that were read."""
        if "scores" in read:
            self._take_scores(read["scores"])
        if "events" in read and len(read["events"]) != self._num_events:
            self._take_events()
        if "messages" in read and len(read["messages"]) != self._num_messages:
            self.go_alone("changes ctx.game.messages")

    def _take_events(self) -> None:
        """Count the stops of agents by events that a function has added to the log of a game."""
        events = self.read("events")
        if len(events) < self._num_events:
            self._note_read("deletes events")
        self._note_events(events[self._num_events :])
        self._num_events = len(events)

    def _take_roads(self) -> None:
        """Store the open roads of the game after a function call."""
        if not self._pointed.take_roads(self._pointed.number):
            self.go_alone("changes more of the map than which roads are open")

    def _note_events(self, entries: Sequence[dict[str, Any]]) -> None:
        """Count the stops of agents by events that a function has added to the log of a game."""
        state = self._state
        numbers = self.number_of
        for entry in entries:
            stopped = entry.get(STOPPED.get(entry["kind"], ""))
            if isinstance(stopped, str) and stopped in numbers:
                state.stops[self._pointed.number, numbers[stopped]] += 1

    def _take_scores(self, scores: dict[Any, Any]) -> None:
        known = self._scores_before
        if scores == known and [*map(type, scores.values())] == [*map(type, known.values())]:
            return
        are_held = {key for key, points in known.items() if not is_exact_float(points)}  # the core adds to no scores
        if not all(key in are_held or is_exact_float(points) for key, points in scores.items()):
            self.go_alone("sets scores that are no numbers")
        self._state.scores.put(self._pointed.number, scores)

    def _take_agents(self, journal: Journal) -> AgentBlock:
        """Store the changes of agents; return their block."""
        self._pointed.detach_agents()
        are_others = self._pointed.has_other_agents()
        kinds = {one[0] for one in journal.log if type(one) is tuple}
        if AGENT_ATTRIBUTE in kinds:
            self._attributes.keep(self.get_own_row())
        if not kinds <= _CHANGING | (_EQUIPPING if are_others else set()):
            self.go_alone("changes agents otherwise than by putting them elsewhere or out of the game")
        changed = self._take_population() if are_others else None  # now these are shown as in an earlier game
        self._take_changes(journal, kinds, changed)
        return changed or self.block

    def _take_changes(self, journal: Journal, kinds: set[int], changed: AgentBlock | None) -> None:
        """Write the nodes of agents that were placed elsewhere, and which agents live.

        Args:
            journal: the changes that a function has made.
            kinds: the kinds of these changes.
            changed: the agents, if it has created or deleted some; else None.
        """
        state = self._state
        number = self._pointed.number
        block = changed or self.block
        progressed = [name for name in map(journal.names.__getitem__, journal.progressed) if name in block.rows]
        journal.log.clear()
        journal.progressed.clear()
        numbers = self._population.numbers
        for name in progressed:
            state.movement.clear(number, self.number_of[name])
        if changed or _TURNED in kinds:
            headings = zip(numbers.tolist(), block.heading, self._population.first_headings, strict=True)
            state.headings[number] = {agent: now for agent, now, first in headings if now != first}
        block.locate()
        state.node[number, numbers] = state.streets.rows(np.array(block.get_ids(block.node)))
        state.previous[number, numbers] = state.streets.rows(np.array(block.get_ids(block.previous)))
        alive = bytes(block.alive)
        state.alive[number, numbers] = np.frombuffer(alive, np.bool_)
        if not changed:
            self._pointed.headings = state.headings[number]
            self._pointed.alive = alive
        state.placed[number, numbers] = [row in block.placed for row in range(len(numbers))]
        if changed and self.part is None and self._has_moved:
            self._core.place_newcomers(np.array([number]))
        if state.flights is not None:
            for agent, row in zip(self._population.flying, self._population.rows_in_air, strict=True):
                block.flights.copy_to(state.flights, row, 0, agent, number)
            state.has_flown[number] &= ~state.placed[number, state.flyers]
            state.placed[number, state.flyers] |= state.has_flown[number]

    def _take_facts(self) -> None:
        """Store the facts that a rule has published in a game."""
        known = self.facts_shown
        now = self._facts
        changed = {name for name, fact in now.items() if name not in known or fact is not known[name]}
        facts = dict(now)
        self.get_own_row().facts = facts
        self._facts_own = facts
        self.facts_shown = facts
        if changed & self._called.core_keys:
            self.go_alone("publishes facts of rules in the core")
        if self._called.has_array_functions:
            self.go_alone("publishes facts, which array functions may read")

    def note_looks(self, *, has_drawn: bool) -> None:
        """Let the game go on alone if a function has changed what agents draw or see next in this turn."""
        what = "draws by the streams of agents" if has_drawn else "asks sensors that err, or of classes of their own"
        self.keep_looks()
        if has_drawn or not self.cached.are_plain:
            at_arrivals = self._parts.settings.decide == "arrival"
            is_arriving = self._core.arrival is not None
            is_moving = self.part is not None and (has_drawn or at_arrivals)
            if is_arriving or is_moving:  # agents have, any number of times
                self.refuse(what, "write get_state or observation, and 'draw' or 'rng', in the function itself")
            self._note_read(what)

    def refuse_other_agents(self, what: str) -> None:
        """Let the game leave if a function has changed agents otherwise than by own attributes."""
        if any(type(one) is not tuple or one[0] != AGENT_ATTRIBUTE for one in self.journal.log):
            self.go_alone(f"that is {what} changes agents")

    @property
    def has_other_settings(self) -> bool:
        """Whether a function has changed settings, rules or collectors, or strategies or sensors of agents."""
        phase = self._phase
        return (
            phase.strategy_changes,
            phase.sensor_changes,
        ) != self._changes or self._list_fixed_values() != self._fixed

    @property
    def has_other_map(self) -> bool:
        """Whether a function has changed the map since it was taken."""
        return bool(self._pointed.map.count_changes() != self._pointed.map_changes)

    def leave_with_other_map(self) -> None:
        """Let the game leave if a function has changed the map: until agents have arrived, the map is another one."""
        if self.has_other_map:
            self.go_alone("changes the map while agents are on their way")

    def cancel(self, agent: int) -> None:
        """Cancel the move of an agent of the game that the context is pointed at."""
        self._core.hold(self._pointed.number, agent)
        if self._state.flights is not None:
            self._state.flights.hold(agent, self._pointed.number)


def list_last_states(ctx: HostContext) -> dict[tuple[str, str], list[Any]]:
    """Return the lists with the last states of agents, by name and "", and with the last data of their sensors."""
    return _list_ends_of_deeds(ctx.agent.storage.list_created(), ctx.agent.storage.get_turn_access)


def _list_ends_of_deeds(agents: Iterable[Any], turn_access: Callable[[Any], Any]) -> dict[tuple[str, str], list[Any]]:
    """Return the same of some agents."""
    found = {}
    for agent in agents:
        access = turn_access(agent)
        found[agent.name, ""] = access.last
        found |= {(agent.name, one): last for one, last, *_ in access.carried if type(last) is list}
    return found
