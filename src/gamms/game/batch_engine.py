"""Plays all games of a batch in the core, phase by phase where functions are called between its phases."""

import itertools
from collections import ChainMap
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import copy
from dataclasses import replace
from functools import partial
from math import hypot
from time import perf_counter
from typing import Any, NamedTuple, Self

import numpy as np

from gamms import kernels
from gamms.core.arrivals import PHASES as PHASES_AT_ARRIVALS
from gamms.core.block import AT_START, GameStarts
from gamms.core.moves import NO_EDGE, STOP
from gamms.core.turn import PHASES as PHASES_OF_CORE
from gamms.core.turn import TurnDriver, TurnPlan, TurnsOfGames, begin_turns, play_step
from gamms.deciding import DecidePhase
from gamms.errors import BadValue, GammsError, UnknownName
from gamms.game.array_functions.given import OutsideActions
from gamms.game.array_functions.turn import ArrayTurn
from gamms.game.array_functions.view import (
    ArrayView,
    LearnerWriter,
    lead_along,
    make_asked_view,
)
from gamms.game.block.columns import (
    AgentTable,
    ComingAgent,
    PlayedGame,
    describe_turns,
    find_decider,
    get_or_make,
    get_sensors,
    make_roster,
    play_in_threads,
)
from gamms.game.block.in_core import CoreColumns, CoreGames, get_memory, is_function, list_called_rules, put_scores
from gamms.game.block.initial_state import BeginningGames, InitialState, NextStarts, make_movement
from gamms.game.block.sensing import is_turning_with_agent, note_sensors
from gamms.game.block.state import NO_STOP, GameArrays, view_with_plan
from gamms.game.conflicts import flatten
from gamms.game.deeds import DeclaredDeeds, check_value
from gamms.game.hidden_state import find_names
from gamms.game.lasting import DeedReader
from gamms.game.messages import ANTENNA, MessagePositions, MessageTraffic
from gamms.game.movement.legal_moves import Movement
from gamms.game.movement.legality import IllegalAction, explain_edge, refuse_any, refuse_edge
from gamms.game.movement.roads import join_streets
from gamms.game.plan import RowPlan, StrategyGroup, are_all_asked, find_first_called
from gamms.game.random_streams import seed_for_run
from gamms.game.result import Result, list_opponents
from gamms.game.rows.by_seed import GamesBySeed
from gamms.game.rows.contexts import RowContexts
from gamms.game.rows.functions import CalledRule, RowDriver, RowFunctions
from gamms.game.rows.row import RowMeans, RowOfGame, release
from gamms.game.settings import NamedRule, RuleTable, group_rules, join_rules
from gamms.game.strategy_specs import call_each, get_strategy_spec, is_deciding_in_arrays
from gamms.ir.columns import Failure, select_rows
from gamms.ir.deeds import DeedLog, DeedsInArrays
from gamms.ir.game_state import PHASES
from gamms.ir.graph import ClosedEdges, FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.progress import TurnInterrupted
from gamms.readonly import thaw
from gamms.text import as_code, shown
from gamms.typing.actions import step_once
from gamms.typing.agent_engine import IAgent
from gamms.typing.game import find_strategy_name

_DECIDE, _SETTLE, _MOVE = PHASES_OF_CORE
_ARRIVE, _CHOOSE, _GO_ON = PHASES_AT_ARRIVALS
_LONG_S = 0.1  # turns that take longer can be interrupted
_MOMENT_S = 0.2  # of several turns that are played at once
_MOST_AT_ONCE = 10_000  # turns
_OWN = -1  # the number of the plan of games that have columns of their own
_FIRST_PLAN = 1 << 30  # the number of the first plan that functions make: larger than those of maps


class RulesLeft:
    """The rules that a game has yet to call in a phase of the turn in which its functions have changed what it follows.

    Args:
        number: the number of the game.
        phase: the phase.
        groups: the rules, in groups that are called as one.
        seen: all rules that the game has had in the phase.
        part: the part of the turn in which agents are about to move; None: they are not.

    Attributes:
        number, phase, part: see above.
    """

    def __init__(
        self,
        number: int,
        phase: str,
        groups: Sequence[Sequence[NamedRule]],
        seen: Sequence[NamedRule],
        part: int | None,
    ) -> None:
        self.number = number
        self.phase = phase
        self.part = part
        self._groups = [*groups]
        self._seen = [*seen]

    @classmethod
    def from_rule(cls, number: int, called: CalledRule, before: RuleTable) -> "RulesLeft":
        """Return the rules after one that is called, of those with which the phase has begun."""
        named, part = called
        groups = before.of_phase[named.phase]
        place = [joined.name for _, joined in groups].index(named.name)
        return cls(number, named.phase, [group for group, _ in groups[place + 1 :]], before.rules, part)

    def move(self, number: int, here: RuleTable, there: RuleTable) -> "RulesLeft":
        """Return the same rules for the fork of a game, given the rules that the game and the fork have now."""

        def find(rules: Sequence[NamedRule]) -> list[NamedRule]:
            return [there.rules[here.rules.index(one)] for one in rules if one in here.rules]

        return RulesLeft(number, self.phase, [find(group) for group in self._groups], find(self._seen), self.part)

    def take(self, now: RuleTable) -> None:
        """Follow other rules: call those that were added, too, and none that were removed."""
        self._groups = [[one for one in group if one in now.rules] for group in self._groups]
        added = [one for one in now.rules if one not in self._seen]
        self._seen += added
        self._groups += [group for group, _ in group_rules([one for one in added if one.phase == self.phase])]

    def pop(self) -> NamedRule | None:
        """Return the rule that is called next; None: there is none."""
        self._groups = [group for group in self._groups if group]
        return join_rules(self._groups.pop(0)) if self._groups else None


class GamesOnOneMap:
    """The games of a batch that are on one map: their rules, and the functions that are called between phases.

    Games on the same map whose strategies differ count as games on different maps; see `Batch`.

    Args:
        game: the game at its start, on the map.
        state: the state of all games of the batch, on this map.
        block: the columns that the games on all maps share.
        number: the number of the map.
        own: the games that differ by their seeds.
        driver: plays all games.

    Attributes:
        game, state, number: see above.
        plan: what the games share.
        core: plays the games in the core.
        contexts: the games in contexts of their own.
        calls: calls plain functions; None: there are none.
        source: the games that follow the plan of the start, of which these are some; None: these are they.

    Raises:
        GammsError: the core cannot play a rule or the conflicts, or cannot continue them from the state of the game.
    """

    source: "GamesOnOneMap | None" = None
    _means: RowMeans | None = None

    def __init__(
        self,
        game: PlayedGame,
        state: GameArrays,
        block: CoreColumns,
        number: int,
        own: GamesBySeed,
        driver: RowDriver,
    ) -> None:
        self.game = game
        self._own = own
        self.state = state
        self.number = number
        self._block = block
        self._driver = driver
        self._flights: list[tuple[IntArray, FloatArray]] = []  # the flights of agents that are given in this turn

    def begin_all(self, starts: NextStarts, games: IntArray) -> Self:
        """Begin the first games on this map, and return this.

        Args:
            starts: what games have by their seeds when they begin.
            games: (games,) the games that begin on the map now.
        """
        game = self.game
        state = self.state
        state.take_game(game)
        settings = game.settings()
        if settings["team_memory"]:
            state.share_memories()
        self._declare_deeds(settings)
        asks_all = are_all_asked(game, state.roster, self._own)
        self._make_plan(game, asks_all=asks_all)
        self._begin_first(starts, games)
        state.facts.update(game.facts)
        self._prepare(game, None)
        self.contexts = RowContexts(game, state, self.core, self._own, self.plan)
        state.find_game = self.contexts.show
        if self.plan.drives.any():  # only their contexts know which nodes are legal
            state.apart = ChainMap({}, {number: partial(self.contexts.show, number) for number in range(len(state))})
        state.change_roads = self.contexts.change_roads
        state.take_own_arrays = self.contexts.take_own_arrays
        self.calls = self._make_calls() if self.plan.calls_each else None
        return self

    def change(self, row: RowOfGame, number: int) -> "GamesOnOneMap":
        """Return the games that follow the plan that a game needs now, whose functions have changed it."""
        roster = self.state.roster.replace_agents(row.list_carriers())
        state = view_with_plan(self.state, roster, dict(row.game.facts) if self.differs else row.list_own_facts())
        own = GamesBySeed(self.game, None, 0, {}, differs=False)
        found = GamesOnOneMap(self.game, state, self._block, number, own, self._driver)
        found.source = self
        asks_all = self.plan.asks_all or are_all_asked(row.game, roster, own)
        found._make_plan(row.game, asks_all=asks_all)
        found._initial = self._initial
        found._beginning = self._beginning
        found._prepare(row.game, self.core)
        found.contexts = self.contexts
        found._means = self.contexts.means._replace(state=state, core=found.core, plan=found.plan)
        found.calls = found._make_calls()
        return found

    @property
    def differs(self) -> bool:
        """Whether the games differ by their seeds in more than columns."""
        return self._own.is_needed

    def _make_plan(self, game: PlayedGame, *, asks_all: bool) -> None:
        """Make the plan of a game; `asks_all`: the strategies of all agents of the start are called game by game."""
        settings = game.settings()
        self._call_arrays_by_game(settings, asks_all=asks_all)
        self.plan = RowPlan.from_game(game, self.state.roster, self._own, asks_all=asks_all)
        self._is_strict = settings["on_illegal"] == "raise"
        asked = np.flatnonzero(self.plan.is_asked).tolist()
        self._called = as_code(find_decider(self.state.roster.agents[asked[0]], settings["plans"])) if asked else ""

    def _prepare(self, game: PlayedGame, before: CoreGames | None) -> None:
        """Prepare to play games like one in the core.

        Args:
            game: the game.
            before: plays them by the plan with which they have begun; None: it is this one.
        """
        state = self.state
        plan = self.plan
        carried = [sensor for agent in state.roster.agents for sensor in get_sensors(agent).values()]
        note_sensors(state, with_nodes=any(map(is_turning_with_agent, carried)))
        for one in plan.rules:  # they write what agents know of them
            if one.spec.prepare_arrays is not None:
                one.spec.prepare_arrays(state)
        is_apart = plan.calls_each or before is not None or not (state.radio is None and state.flights is None)
        asked = np.flatnonzero(plan.is_asked).tolist()
        self.core = CoreGames(game, state, self._block, self.number, is_apart=is_apart, asked=asked)
        self.core.begin(before)

    def _make_calls(self) -> RowFunctions:
        """Return what calls plain functions."""
        return RowFunctions(self.contexts, self.means, self._driver)

    @property
    def means(self) -> RowMeans:
        """What the games share in contexts of their own."""
        return self._means or self.contexts.means

    def _begin_first(self, starts: NextStarts, games: IntArray) -> None:
        """Write the start of a game to a block of one game, and begin the first games on this map with its row."""
        state = self.state
        on_start = np.full((1, len(state.roster.names)), AT_START)
        first = GameArrays(state.roster, copy(state.movement), [0], on_start, others=state.movements)
        columns = CoreColumns([first], np.zeros(1, np.int64))
        self._initial = InitialState(self.game, first, columns)
        first.scores.put(0, self.game.scores)
        columns.give()
        state.first |= first.first
        state.of_core |= first.of_core
        self._beginning = BeginningGames(state, self._block, first, columns, starts)
        self.begin(games)
        self._initial.put_values(state, games)
        self._put_own(games)

    def _call_arrays_by_game(self, settings: Mapping[str, Any], *, asks_all: bool) -> None:
        """Let array strategies be called game by game where all agents are, or where a verb that they call needs it.

        These are looks that are counted in each game, and `view.towards` of agents with speeds. Agents that obey turns
        by metres need it for all verbs.
        """
        movement = self.state.movement
        at_arrivals = is_deciding_at_arrivals(movement)
        verbs = {"towards"} if movement.acts_by_paths else set[str]()
        drives = self.state.roster.find_driving(settings["speed_unit"]).tolist()
        for agent, is_driving in zip(self.state.roster.agents, drives, strict=True):
            decider = find_decider(agent, settings["plans"])
            form = get_strategy_spec(decider).array_form
            if form is None or not is_deciding_in_arrays(decider, settings):
                continue
            is_named = any(not verbs.isdisjoint(names) for names in find_names([form]))
            if asks_all or is_named or is_driving or (at_arrivals and has_counted_looks(agent)):
                call_each(decider)

    def fork(self, number: int) -> PlayedGame:
        """Return a game as it is between two turns, in a context of its own."""
        return (self.calls or self._make_calls()).fork(number)

    def _declare_deeds(self, settings: Mapping[str, Any]) -> None:
        """Tell the state of the games which deeds there are, and what agents are doing."""
        state = self.state
        roster = state.roster
        check = partial(check_value, ctx=self.game.ctx)
        state.deeds = DeclaredDeeds(settings["deeds"], check, roster.names, state.streets, state.roads.are_open)
        if state.deeds.lasting:
            self._first_data = thaw(self.game.internals.state.data)
            state.doings = DeedReader(settings, roster.names, roster.list_teams(), self._get_data)

    def _get_data(self, number: int) -> Mapping[Any, Any]:
        """Return `ctx.game.data` of a game."""
        return self.contexts.get_data(number, self._first_data)

    @property
    def asking(self) -> int | None:
        """The number of the game whose strategies are called now; None: none are called."""
        row = None if self.calls is None else self.calls.asking
        return None if row is None else row.number

    @property
    def _at_arrivals(self) -> bool:
        return is_deciding_at_arrivals(self.state.movement)

    @property
    def functions(self) -> list[Callable[..., object]]:
        """The functions that are called."""
        rules = [one.spec.array_form for one in self.plan.rules if one.spec.is_array_function]
        plain = [] if self.calls is None else self.calls.functions
        return [*(group.form for group in self.plan.groups), *filter(None, rules), *plain]

    def checkpoint(self) -> Callable[[], None]:
        """Return a function that undoes all later changes."""
        return self.state.checkpoint(self.core.moves) if self.calls is None else self.calls.checkpoint()

    def is_checkpoint_needed(self, *, is_given: bool, is_single: bool) -> bool:
        """Return whether functions may raise after something has changed.

        Args:
            is_given: whether actions come from outside.
            is_single: whether one game plays: it is taken back only if the turn is not counted.
        """
        if any(one.spec.is_array_function and one.phase != "after" for one in self.plan.rules):
            return True
        may_raise = len(self.plan.groups) > 0 or self.state.radio is not None
        may_raise_later = (may_raise and self.core.num_parts > 1) or self.is_asking_at_arrivals(is_given=is_given)
        acts_early = self.source is not None or self.game.internals.parts.turns.needs_checkpoint
        calls = self.calls is not None and (not is_single or acts_early)
        return calls or may_raise_later or self.plan.leaves_out

    def is_asking_at_arrivals(self, *, is_given: bool) -> bool:
        """Return whether functions, or actions from outside, decide for agents on arrival."""
        return self._at_arrivals and (is_given or self.plan.asks_functions or self.plan.has_conflicts)

    @property
    def at_rest(self) -> BoolArray | None:
        """A mask of the agents that certainly decide when a turn begins, (all games, agents); None: all."""
        if not self._at_arrivals:
            return None
        games, agents = self.state.node.shape
        at_rest: BoolArray = self.state.movement.find_edges((np.arange(games)[:, None], np.arange(agents))) < 0
        return at_rest

    @property
    def starts(self) -> GameStarts:
        """Begins games on this map, in the core."""
        return self._beginning.core

    def begin(self, games: IntArray) -> None:
        """Begin games on this map; see `note_begun`."""
        self.starts.begin(flatten(games, np.int64))

    def note_begun(self, games: IntArray, seeds: Sequence[int]) -> None:
        """Set the values of games that have begun with these seeds, besides columns."""
        self.state.forget(games, seeds)
        self._initial.put_values(self.state, games)
        self._put_own(games)
        self.contexts.forget(games)

    def _put_own(self, games: IntArray) -> None:
        """Set the scores, events and open roads that differ between games at their start."""
        state = self.state
        for number in games.tolist() if self._own.is_needed else ():
            game = np.array([number])
            own_roads = self._own.find_roads(number)
            if own_roads is not None:
                edge_ids, closed, snapshot = own_roads
                roads = state.roads.map_with(edge_ids, closed)
                if roads is not None:
                    roads.snapshot = snapshot
                state.put_roads(game, roads)
            values = self._own.begun[number].internals.state
            state.scores.put(number, values.scores)
            state.events.forget(game)
            state.events.begin(game, [dict(event) for event in values.events])

    def refuse_left_out(self, games: IntArray) -> None:
        """Refuse games with a living agent whose team the order of play or the priorities in conflicts leave out.

        Raises:
            BadValue, MissingKey (KeyError): there is such an agent.
        """
        lives = self.state.alive[games] & self.plan.is_left_out
        if lives.any():
            at, agent = np.argwhere(lives)[0].tolist()
            number = int(games[at])
            try:
                self.plan.refuse_left_out(agent)
            except (GammsError, LookupError) as error:
                error.add_note(f"In game {number} of a batch, with the seed {self.state.seeds[number]}.")
                raise

    def check_given(self, games: IntArray, given: Mapping[Hashable, OutsideActions]) -> None:
        """Refuse deeds and messages that are not legal before a rule is called."""
        for team, wanted in given.items():
            wanted.act(make_asked_view(self.state, games, wanted.select_agents(self.state.roster, team), self.at_rest))

    def call_before(self, games: IntArray) -> None:
        """Call the rules of the phase "before"."""
        games = self._initial.select_not_under_way(self.state, games)
        for named in self.plan.list_rules("before"):
            self.call(named, games[self.state.is_going[games]])  # a game that one of them ends is over for the others

    def take(self, games: IntArray, given: Mapping[Hashable, OutsideActions], here: BoolArray | None = None) -> None:
        """Take the given deeds, messages and flights of agents; their moves are in the block already.

        Args:
            games: the games that are played.
            given: team -> the actions of its agents, which replace their decisions.
            here: (all games, agents) a mask of the agents that decide now; None: all.
        """
        self._flights = []
        for team, wanted in given.items():
            acts = self.calls is not None or wanted.deeds or wanted.messages
            if not acts and wanted.flights is None:
                continue
            agents = wanted.select_agents(self.state.roster, team)
            if wanted.flights is not None:
                self._flights.append((agents, wanted.flights))
            if acts:
                view = make_asked_view(self.state, games, agents, here)
                if self.calls is not None:
                    self.calls.note_given(view)
                wanted.act(view)
                self._take_acts(view)

    def find_block_agents(self, is_given: BoolArray) -> BoolArray:
        """Return a mask of the agents whose actions are in the block, (agents,): from functions or from outside.

        Args:
            is_given: (agents,) a mask of the agents with an action from outside.
        """
        takes = is_given | self.plan.is_asked
        for group in self.plan.groups:
            takes[group.agents] = True
        return takes

    def decide(self, games: IntArray, part: int, is_given: BoolArray, here: BoolArray | None = None) -> None:
        """Write the actions that functions choose for agents, in a part of the turn, into the block.

        Args:
            games: the games that are played.
            part: the part of the turn.
            is_given: (agents,) a mask of the agents with an action from outside.
            here: (all games, agents) a mask of the agents that decide now; None: all.
        """
        actions = self._block.given
        if not self.core.arrival:
            self._fly_as_given(games, is_given & (self.core.part_of == part))
        self._call_each(games, part, is_given, here)
        for group in self.plan.groups:
            agents = group.agents[~is_given[group.agents] & (self.core.part_of[group.agents] == part)]
            asked = games if here is None else games[here[games][:, agents].any(axis=1)]
            for some in self._group_by_roads(asked) if len(agents) and len(asked) else ():
                view = make_asked_view(self.state, some, agents, here)
                view._named = np.full(view.node.shape, NO_EDGE)
                rows = np.ix_(some, agents)
                if here is not None:
                    view.draw = view.draw.after(self.core.drawn[rows]).only(view.mask)
                actions[rows] = self._ask_group(view, group)
                if here is not None:
                    self.core.drawn[rows] = view.draw.count

    def _ask_group(self, view: ArrayView, group: StrategyGroup) -> IntArray:
        """Return the actions of an array function, and take its deeds and messages.

        Raises:
            BadValue: the function calls what needs to be called game by game, and its code does not name it.
        """
        try:
            actions = self._call_strategy(view, group)
            self._take_acts(view)
        except Exception as error:
            turns = describe_turns(view.turn, view.games, self.state.first_game)
            error.add_note(f"In the strategy {group.name} of a batch, {turns}.")
            raise
        return actions

    def _call_strategy(self, view: ArrayView, group: StrategyGroup) -> IntArray:
        """Return the actions of an array function; flying agents stay on the node below them."""
        name = getattr(group.form, "__name__", group.name) if view.flies else group.name
        given: Any = view._call(group.form, name)
        if view.flies:
            self._fly(view, given)
            return np.zeros_like(view.node)
        if view._named is not None and (view._named >= 0).any():
            edges = self._refuse_edges(view, view._named)
            self.core.edges.put(np.ix_(view.games, view.agents), edges, self.state.movement.columns)
            given = lead_along(view, edges, given)
        return given  # type: ignore[no-any-return] # they are actions

    def _refuse_edges(self, view: ArrayView, edges: IntArray) -> IntArray:
        """Return the edges that an array function has named, with `STOP` for agents that may not take theirs."""
        is_wrong = (edges >= 0) & ~(view["legal_edges"] == edges[..., None]).any(axis=-1)
        for at, i in np.argwhere(is_wrong).tolist():
            error = self._explain_edge(view, (at, i), int(edges[at, i]))
            self._refuse_action(view, (at, i), error)
        return np.where(is_wrong, STOP, edges)

    def _explain_edge(self, view: ArrayView, which: tuple[int, int], edge: int) -> GammsError:
        """Return why an agent at an index of a view may not take an edge; see `Legality.resolve`."""
        by = self.state.movement
        columns = by.columns
        agent = view.agents[which[1]]
        if by.are_all_legal:
            return refuse_any(edge, view["name"][which[1]])
        row = kernels.find_rows(columns.edge_ids, np.array([edge]), columns.edge_order)
        if not by.all_roads.are_open_rows(row, view.games[[which[0]]])[0]:
            return UnknownName("edge", edge)
        source, target = (int(columns.node_ids[ends[row[0]]]) for ends in (columns.sources, columns.targets))
        here = int(columns.node_ids[view.node[which]])
        on_edge = int(view["edge"][which][2])
        mode = None if not by.mode_of[agent] else by.modes[by.mode_of[agent] - 1]
        flaw = explain_edge((source, target, edge), here, None if on_edge < 0 else on_edge, mode)
        legal = view["legal_edges"][which]
        return refuse_edge(edge, flaw, legal[legal >= 0].tolist())

    def _refuse_action(self, view: ArrayView, which: tuple[int, int], error: GammsError) -> None:
        """Refuse the action of an agent at an index of a view: raise the error, or note it, by the settings."""
        game = int(view.games[which[0]])
        agent = int(view.agents[which[1]])
        turn = int(self.state.turn[game])
        if self._is_strict:
            raise IllegalAction(f"Agent {self.state.roster.name(agent)} in turn {turn}: {error}") from error
        self.state.refuse(Failure.make_illegal(game, agent, f"{type(error).__name__}: {error}"), turn)

    def _fly_as_given(self, games: IntArray, which: BoolArray) -> None:
        """Set the given flights of agents in a part of the turn; agents without one hover."""
        roster = self.state.roster
        agents = np.flatnonzero(which & roster.flies)
        if not len(agents):
            return
        offsets = np.zeros((len(games), len(roster.names), 3))
        for given_to, flights in self._flights:
            offsets[:, given_to] = flights[games]
        self._fly(ArrayView(self.state, games, agents), offsets[:, agents])

    def _fly(self, view: ArrayView, offsets: FloatArray) -> None:
        """Set the displacements of the agents of a view, (games, agents, 3), limited by their speeds."""
        for at, i in np.argwhere(view.mask).tolist():
            try:
                self._choose(int(view.games[at]), int(view.agents[i]), offsets[at, i].tolist())
            except GammsError as error:
                self._refuse_action(view, (at, i), error)

    def _choose(self, game: int, agent: int, offset: Sequence[float]) -> None:
        """Choose the displacement of an agent, in map units, limited by its speed.

        Raises:
            BadValue: the position exceeds the range of floats.
        """
        flights = self.state.flights
        assert flights is not None  # noqa: S101 - it flies
        speed = self.state.roster.agents[agent].speed or 0.0
        position = step_once(flights.get_position(agent, game), offset, min(hypot(*offset), speed))
        flights.chosen.append((game, agent, position, None))

    def fly(self, games: IntArray, part: int) -> None:
        """Move the flying agents in a part of the turn, after the others have moved."""
        state = self.state
        flights = self.state.flights
        nearest = self.game.ctx.graph.graph.nearest_node
        assert flights is not None  # noqa: S101 - some fly
        moves = state.alive[games] & (self.core.part_of == part)
        flown = np.zeros(state.has_flown.size, np.int64)
        flown = flown[: flights.move(flatten(games, np.int64), get_memory(moves), moves.shape[1], flown.data)]
        if not len(flown):
            return
        pairs = np.divmod(flown, len(state.flyers))
        those = pairs[0], state.flyers[pairs[1]]
        has_flown = state.has_flown[pairs]
        below = nearest(*state.position[pairs][:, :2].T)
        state.previous[those] = state.node[those]
        state.node[those] = state.streets.rows(below)
        state.counts["moves"][those] += has_flown
        state.placed[those] |= has_flown

    def _call_each(self, games: IntArray, part: int, is_given: BoolArray, here: BoolArray | None) -> None:
        """Call deciding plain functions, and sensors that are called in each turn, game by game."""
        are_next = self.core.part_of == part
        led = np.flatnonzero(self.plan.drives & are_next & is_given)
        if self.calls is not None and len(led) and len(games):
            view = ArrayView(self.state, games, led)
            given = np.ix_(games, led)
            self._block.given[given] = self.calls.lead(view, self._block.given[given])
        asked = np.flatnonzero(self.plan.is_asked & are_next & ~is_given)
        observing = np.flatnonzero(self.plan.is_observing & are_next & (is_given | ~self.plan.is_asked))
        told = np.flatnonzero(is_given & are_next) if self.plan.asks_all else asked[:0]
        if here is not None:
            games = games[here[games][:, np.concatenate((asked, observing, told))].any(axis=1)]
        if self.calls is None or not len(games) or not len(asked) + len(observing) + len(told):
            return
        view = ArrayView(self.state, games, asked)
        try:
            self._block.given[np.ix_(games, asked)] = self.calls.decide(view, observing, told, here, part)
        except Exception as error:
            if len(asked) and not getattr(error, "__notes__", ()):  # which name the function that has raised
                turns = describe_turns(view.turn, view.games, self.state.first_game)
                error.add_note(f"In the strategy {self._called} of a batch, {turns}.")
            raise

    def leave_closed_edges(self, games: IntArray, part: int | None = None) -> None:
        """Move agents on closed edges to the nodes that they passed last; `part`: only those of a part of the turn."""
        by = self.state.movement
        if not by.by_metres:
            return
        members = self.state.alive[games] & (True if part is None else self.core.part_of == part)
        left = by.leave_closed_edges(games, members)
        self.state.counts["blocked"][left[0], left[1]] += 1  # each agent is on one edge
        if self.calls is not None:
            self.calls.note_closed_edges(*left)
        if len(left[0]):
            self.state.now.clear()

    def give_way_at_arrivals(self, games: IntArray) -> None:
        """Stop the arrived agents that lose conflicts decided by a function."""
        if self.calls is not None and self.plan.has_conflicts and len(games):
            self.calls.give_way_at_arrivals(games)

    def _group_by_roads(self, games: IntArray) -> Iterator[IntArray]:
        """Yield groups of games with the same open roads, for which an array function is called together."""
        roads = self.state.roads
        if not roads.are_closed:
            yield games
            return
        for _, places in roads.group_by_map(games):
            yield games[places]

    def _group_by_beginning(self, games: IntArray) -> Iterator[IntArray]:
        """Yield the games in which agents have moved in the batch, then the other games."""
        if self._initial.last_turn is None:
            yield games
            return
        has_moved = self.state.turn[games] > self._initial.turn
        yield from filter(len, (games[has_moved], games[~has_moved]))

    def _take_acts(self, view: ArrayView) -> None:
        """Take the deeds and messages of the agents of a view, who decide in the same part of the turn."""
        state = self.state
        if state.radio is not None:
            state.radio.post(view._outboxes or ())
        deeds = [one._replace(at=view.games[one.at]) for one in view._deeds or ()]
        for one in deeds if self.core.arrival else ():
            self.core.note_late_deeds(one.at, one.agents)
        for one in () if self.core.arrival else deeds:
            if len(one.at):
                part = int(self.core.part_of[one.agents[0]])
                state.deed_log.request_deeds(DeedsInArrays(part, state.deeds.numbering, one, state.turn[one.at] + 1))

    def send(self, games: IntArray) -> None:
        """Send the messages of these games, in which all agents have moved."""
        radio = self.state.radio
        if radio is not None and radio.is_sending and len(games):
            for some in self._group_by_roads(games):
                radio.send(some, _locate_agents(self.game, self.state, radio, some))

    def check(self, games: IntArray, part: int) -> None:
        """Call the rules that may refuse moves and deeds of a part of the turn."""
        self._note_places(are_open=False)
        if self.plan.has_checks and self.calls is not None and len(games):
            self.calls.check(games, part)

    def _note_places(self, *, are_open: bool) -> None:
        """Store the positions of agents that are about to move; `are_open`: the edges stored last are still open."""
        self._block.here = self.state.node.copy()
        if self.core.courses is not None:
            self.core.courses.note_places(self._block.here, are_open=are_open)

    def end_deeds(self, games: IntArray, part: int, lived: BoolArray) -> None:
        """Note who has fallen in the phase "deeds", and let agents stay that were created or placed elsewhere in it.

        Args:
            games: the games.
            part: the part of the turn.
            lived: (all games, agents) a mask of the agents that lived before the phase.
        """
        fell = lived[games] & ~self.state.alive[games]
        self.state.fell[games] = self.state.fell[games] | fell if part else fell
        self.core.put_replacing(games)
        if self.state.flights is not None:
            are_put = (self.state.node[games] != self._block.start[games]) & (self.core.part_of == part)
            self.state.flights.cancel(flatten(games, np.int64), get_memory(are_put), are_put.shape[1])

    def cut_off(self, changed: IntArray, part: int) -> None:
        """Keep agents in place whose path was closed in these games."""
        self._note_places(are_open=True)
        if self.calls is not None and len(changed):
            self.calls.cut_off(changed, part)

    def give_way(self, games: IntArray, part: int) -> None:
        """Keep agents in place that lose conflicts decided by a function."""
        if self.calls is not None and self.plan.has_conflicts and len(games) and not self._at_arrivals:
            self.calls.give_way(games, part)

    def call(self, named: NamedRule, games: IntArray, part: int | None = None) -> None:
        """Call a rule function for those of some games that follow this plan; see `RowFunctions.call`."""
        games = self._block.select_followers(self.number, games)
        if not len(games):
            return
        if named.spec.array_form is None:
            if self.calls is not None:
                self.calls.call(named, games, part)
            return
        for some in self._group_by_roads(games):
            for few in self._group_by_beginning(some):
                self._apply(named, few, part)

    def call_left(self, named: NamedRule, left: RulesLeft) -> None:
        """Call a rule in a game that has begun to follow this plan in a phase, or has followed it before."""
        games = np.array([left.number])
        game = self.contexts.get(left.number).game
        (called,) = list_called_rules(game, self.state.roster, [named])
        if not is_function(called):
            self.core.play_rule(called, games)
        elif called.spec.array_form is None and self.calls is not None:
            self.calls.call(called, games, left.part)
        else:
            self.call(called, games, left.part)

    def _apply(self, named: NamedRule, games: IntArray, part: int | None) -> None:
        """Call an array rule for some games."""
        form: Any = named.spec.array_form
        turn = ArrayTurn(self.state, games)
        turn._is_moving = part is not None
        last = None if turn._is_moving else self._initial.last_turn
        if last is not None and self.state.turn[games[0]] == self._initial.turn:
            turn.starts, turn.ends, turn.took_part, turn.paths = select_rows(last, np.zeros_like(games))
        else:
            moves = self.core.get_moves(games, part)
            turn.starts, turn.ends, turn.took_part = moves
            if part is None:
                turn.paths = self.core.get_paths(games)
            elif self.core.courses is not None:
                acting = turn.took_part & (self.core.part_of == part)
                turn.paths = self.core.courses.get_paths(games, turn.starts, acting, turn.took_part & ~acting)
        turn._lock()
        try:
            form(turn)
        except Exception as error:
            error.add_note(
                f"In the rule {named.name!r} (phase {named.phase!r}) of a batch, "
                f"{describe_turns(turn.turn, turn.games, self.state.first_game)}."
            )
            raise
        finally:
            turn._close()


class OutsideAgents(NamedTuple):
    """The agents with actions from outside, which are the same in all turns with actions for the same teams.

    Attributes:
        members: team -> the numbers of the agents that its actions are for.
        is_given: (agents,) a mask of these agents.
        takes: plan -> a mask of the agents whose actions are in the block, (agents,); None: no agents.
        asks_at_arrivals: whether functions, or actions from outside, decide for agents on arrival.
    """

    members: Mapping[Hashable, IntArray]
    is_given: BoolArray
    takes: Mapping[int, BoolArray] | None
    asks_at_arrivals: bool


class TurnOfGames:
    """The turn that games of a batch play now.

    Args:
        playing: (games,) a mask of the games that are played.
        given: team -> the actions of its agents, which replace their decisions.
        agents: the agents with these actions.
        threads: the number of threads.

    Attributes:
        playing, given, agents, threads: see the arguments.
        first: (games,) the first part of the turn that was not played before.
        begun: (games,) the number of parts of turns that were played before this turn.
        in_part: (games,) a mask of the games that play the current part.
        roads: (games,) the number of the open roads of each game before rules of a phase were called.
        lived: (games, agents) who lived before the phase "deeds".
    """

    first: IntArray
    begun: IntArray
    in_part: BoolArray
    lived: BoolArray

    def __init__(
        self, playing: BoolArray, given: Mapping[Hashable, OutsideActions], agents: OutsideAgents, threads: int
    ) -> None:
        self.playing = playing
        self.given = given
        self.agents = agents
        self.threads = threads
        self.roads = np.full(len(playing), -1)


class BatchEngine(TurnDriver):
    """Plays the games of a batch in the core; see `core.turn` for the phases of a turn.

    A game in which a function changes what belongs to its plan follows another plan over the same columns from there
    on; games with equal changes share it.

    Args:
        games: the game at its start on each map.
        movements: the movement of agents on each map.
        seeds: the seeds of the games.
        map_of: (games,) the number of each game's map.
        start: the ids of the start nodes, (games, agents).
        rosters: the agents on each map.
        own: the games on each map that differ by their seeds.
        num_streets: the number of different maps; map i has the streets of map i modulo this number.

    Attributes:
        maps: the games on each map.
        own: what plays the games whose functions have changed more than the columns of all games hold, by number: each
            in columns of its own, in the same phases.
        maps_in_use: the numbers of the maps that games are on.
        newest: the numbers of the maps on which games begin from now on: those that were put last.
        starts: what the next starts of games have by their seeds.
        last_turns: (games,) the turn after which each game ends, by its setting; `NO_STOP`: it has no limit.
        only: the number of the only game that is played now, while the others wait; None: all are.

    Raises:
        GammsError: the core cannot play a rule or the conflicts, or cannot continue them from the state of the game.
    """

    def __init__(
        self,
        games: Sequence[PlayedGame],
        movements: Sequence[Movement],
        seeds: Sequence[int],
        map_of: IntArray,
        start: IntArray,
        rosters: Sequence[AgentTable],
        own: Sequence[GamesBySeed],
        num_streets: int,
    ) -> None:
        super().__init__(DecidePhase())
        self.spent = dict.fromkeys(PHASES, 0.0)
        self.phases = {
            "decide": ("decide", self._decide),
            "act": ("rules", self._act),
            "give way": ("resolve", self._give_way),
            "move": ("apply", self._move),
            "send": ("apply", self._send),
        }
        self._map_of = map_of.copy()
        self._num_streets = num_streets
        self.newest = range(num_streets)
        settings = games[0].settings()
        self._state = GameArrays(rosters[0], movements[0], seeds, None, others=movements[1:])
        self._state.radio = _make_traffic(settings, rosters[0], len(seeds))
        self._radio = self._state.radio
        self._deed_log = self._state.deed_log
        self._has_deeds = bool(settings["deeds"])
        logs: tuple[MessageTraffic | DeedLog | None, ...] = (self._radio, self._deed_log)
        self._logs_of_turn = [log for log in logs if log is not None]
        others = [self._state.view_on_map(*pair) for pair in zip(movements[1:], rosters[1:], strict=True)]
        states = [self._state, *others]
        self.only: int | None = None
        self._last: int | None = settings["max_turns"]
        self.last_turns = np.full(len(seeds), NO_STOP if self._last is None else self._last)
        self._seconds = np.inf  # that the last turn took
        self._can_stop = False
        self._is_strict = settings["on_illegal"] == "raise"
        self._block = CoreColumns(states, self._map_of)
        self.starts = NextStarts(states, map_of, start)
        self.maps: list[GamesOnOneMap] = []
        self._plans: dict[Hashable, GamesOnOneMap] = {}  # that functions have made, by their keys
        self._in_turn = set[int]()  # the numbers of those that games have followed in the current turn
        self._next_plan = itertools.count(_FIRST_PLAN)
        self._left: dict[int, RulesLeft] = {}  # by game
        self.own: dict[int, BatchEngine] = {}
        self._is_moving = False
        self._acts = False
        for number, (game, state, values) in enumerate(zip(games, states, own, strict=True)):
            made = GamesOnOneMap(game, state, self._block, number, values, self)
            self.maps.append(made.begin_all(self.starts, np.flatnonzero(self._map_of == number)))
        self._num_parts = self.maps[0].core.num_parts
        self._by_metres = any(movement.by_metres for movement in movements)
        self._of_all_maps: GameArrays | None = None  # see `_group_by_legal_moves`
        if num_streets > 1 and all(movement.is_plain for movement in movements):
            self._tables = join_streets([movement.streets for movement in movements[:num_streets]])
            self._of_all_maps = self._state.view_on_map(Movement(movements[0].streets), rosters[0])
        self._given_agents: dict[tuple[tuple[Hashable, str | None], ...], OutsideAgents] = {}  # by team
        self._now: TurnOfGames
        self._find_phases()
        state = self._state
        self._turns = TurnsOfGames(
            get_memory(state.is_going),
            get_memory(state.turn),
            -1 if self._last is None else self._last,
            self._num_parts,
            get_memory(self._block.until),
            get_memory(self._block.over),
        )

    def _find_games(self) -> None:
        """Find the numbers of the games that follow each plan."""
        self._all = [*self.maps, *self._plans.values()]
        self._on = [np.flatnonzero(self._block.plan_of == one.number) for one in self._all]
        self._block.others = [one.state for one in self._plans.values()]

    def _find_phases(self) -> None:
        """Determine what happens between the phases of a turn, by the plans that games follow."""
        self._find_games()
        self.maps_in_use = [number for number in range(len(self.maps)) if (self._map_of == number).any()]
        self._in_use = [one for one, games in zip(self._all, self._on, strict=True) if len(games)]
        self._leaves_out = any(one.plan.leaves_out for one in self._in_use)
        acted = self._is_moving and self._acts  # the rest of the turn is played as it began
        self._acts = acted or any(one.plan.acts for one in self._in_use)
        self._asks_functions = any(one.plan.asks_functions for one in self._in_use)
        self._has_rules_before = any(one.plan.list_rules("before") for one in self._in_use)
        # Whether nothing happens between the parts of a turn that the core does not do, and in the whole turn:
        acts = self._acts or self._has_deeds
        self._plays_parts_at_once = not (self.plays_by_phases or acts or self._by_metres)
        self._plays_turns = self._plays_parts_at_once and not (self._has_rules_before or self._leaves_out)
        self._given_agents.clear()
        self.plan_now = None

    def put_maps(
        self,
        first: int,
        games: Sequence[PlayedGame],
        movements: Sequence[Movement],
        rosters: Sequence[AgentTable],
        own: Sequence[GamesBySeed],
    ) -> None:
        """Add maps, on which no game is yet, or replace maps without games.

        Args:
            first: the number of the first of these maps.
            games: the game at its start on each of them.
            movements: see above.
            rosters: see above.
            own: see above.

        Raises:
            GammsError: see above; then nothing was changed.
        """
        states = [self._state.view_on_map(*pair) for pair in zip(movements, rosters, strict=True)]
        none = np.zeros(0, np.int64)
        maps = [
            GamesOnOneMap(game, state, self._block, first + place, values, self)
            for place, (game, state, values) in enumerate(zip(games, states, own, strict=True))
        ]
        for one in maps:
            one.begin_all(self.starts, none)
        for one in self.maps[first : first + len(maps)]:
            one.contexts.close()
        self.maps[first : first + len(maps)] = maps
        self._block.take_states([one.state for one in self.maps])
        self.newest = range(first, first + len(maps))
        self._forget_plans()
        self._find_phases()

    # -- plans ----------------------------------------------------------------------------------------------------

    def go_on(self, row: RowOfGame, called: CalledRule | None) -> None:
        """Let a game go on whose functions have changed what it shares with others; see `RowDriver`."""
        if row.why:
            self._move_out(row, called)
        else:
            self._change_plan(row, called)

    def _change_plan(self, row: RowOfGame, called: CalledRule | None) -> None:
        """Let a game follow the plan that it needs now, because a function has changed what belongs to its plan.

        Args:
            row: the game.
            called: the rule that has changed it, and the part of the turn, if agents are about to move; None: a
                collector has.
        """
        number = row.number
        rules = row.terms.rules
        before = self._find_plan(number)
        now = self._get_or_make_plan(before.source or before, row)
        self._in_turn |= {before.number, now.number}
        row.follow(now.means)
        if now is before and number not in self._left:
            return  # it goes on with this plan
        self._block.plan_of[number] = now.number
        if called is not None and number not in self._left:
            self._left[number] = RulesLeft.from_rule(number, called, rules)
        if number in self._left:
            self._left[number].take(row.terms.rules)
        self._find_phases()
        self.phase.drop_plans()
        self._now.agents = self._find_given(self._now.given)

    def _find_plan(self, number: int) -> GamesOnOneMap:
        """Return the games that follow the same plan as a game."""
        plan = self._block.plan_of[number]
        return next(one for one in self._all if one.number == plan)

    def _get_or_make_plan(self, source: GamesOnOneMap, row: RowOfGame) -> GamesOnOneMap:
        """Return the games that follow the plan that a game needs now, which has begun with the plan of `source`."""
        terms = row.make_key()
        if terms is None:
            return source
        key = source.number, terms, row.number if source.differs else None
        if key not in self._plans:
            self._forget_plans()
            made = source.change(row, next(self._next_plan))
            self._plans[key] = made
            self._find_games()
        return self._plans[key]

    def _forget_plans(self) -> None:
        """Forget the plans that functions have made, and that no game follows."""
        kept = {*np.unique(self._block.plan_of).tolist()} | self._in_turn
        self._plans = {key: one for key, one in self._plans.items() if one.number in kept and one.source in self.maps}

    def _play_left(self) -> None:
        """Call the rules of a phase that are left in games which have begun to follow other plans in it."""
        while self._left:
            number, left = next(iter(self._left.items()))
            is_cut_short = left.phase == "before" and not self._state.is_going[number]
            named = None if is_cut_short else left.pop()
            if named is None:
                del self._left[number]
            else:
                self._find_plan(number).call_left(named, left)
        for one in [*self.own.values()]:
            one._play_left()

    def _move_out(self, row: RowOfGame, called: CalledRule | None) -> None:
        """Let a game go on in columns of its own, because a function has changed what those of all games do not hold.

        Args:
            row: the game.
            called: see `RowDriver`.
        """
        number = row.number
        before = self._find_plan(number)
        has_other_map = row.has_other_map
        game, new = row.make_fork()
        try:
            own = make_engine(game)
            own._state.first_game = self._state.first_game + number
            left = self._left.pop(number, None)
            if left is None and called is not None:
                left = RulesLeft.from_rule(number, called, row.terms.rules)
            if left is not None:
                now = row.game.internals.parts.rules.now
                left.take(now)
                own._left[0] = left.move(0, now, own.maps[0].contexts.get(0).terms.rules)
            own._join(self, number, before, new, has_other_map=has_other_map)
        except BaseException:
            game.ctx.terminate()
            raise
        own.phase = self.phase
        self.own[number] = own
        self.maps[int(self._map_of[number])].contexts.moved[number] = partial(self.show, number)
        self._block.plan_of[number] = _OWN
        self._end_with_others(number)
        self._find_phases()
        self.phase.drop_plans()

    def _join(
        self, others: "BatchEngine", number: int, before: GamesOnOneMap, new: Sequence[str], *, has_other_map: bool
    ) -> None:
        """Go on with a game in the middle of its turn among others.

        Args:
            others: plays the others.
            number: the number of the game there.
            before: the games that follow the plan that it has followed there.
            new: the names of the agents that the function has created.
            has_other_map: whether it has changed the map, besides the open roads.
        """
        left = {**self._left}
        self._begin_turn(np.ones(1, np.bool_), others._give_to(self, number), 1)
        self._left = left
        now = self._now
        theirs = others._now
        pairs = self._state.roster.find_pairs(before.state.roster)
        part = others.part if others._is_moving else None
        known = [i for i, agent in enumerate(pairs[0].tolist()) if self._state.roster.names[agent] not in new]
        if part is not None and (self.maps[0].core.part_of[pairs[0]] != before.core.part_of[pairs[1]])[known].any():
            raise BadValue(
                'A rule of the phase "deeds" changes ctx.game.order, or the teams of agents, while agents move in this '
                'order. In a batch, change it in the phase "before" or "after".'
            )
        created = [self._state.roster.names.index(name) for name in new]
        self.maps[0].core.take_moves(before.core, number, pairs, created, part)
        self.maps[0].contexts.get(0).keep_moves(part)
        self._is_moving = others._is_moving
        have_changed = has_other_map or bool((others._number_roads() != theirs.roads)[[number]].any())
        now.roads = np.full(1, -1) if have_changed else self._number_roads()
        if not self._is_moving:
            return
        self._acts = True
        self.part = others.part
        now.first = theirs.first[[number]]
        now.begun = self._state.turn * self._num_parts
        now.in_part = np.ones(1, np.bool_)
        now.lived = np.zeros(self._state.alive.shape, np.bool_)
        now.lived[0, pairs[0]] = theirs.lived[number, pairs[1]]
        agents = dict(zip(*pairs[::-1].tolist(), strict=True))
        turning = [one for one in others._state.turning if one[0] == number and one[1] in agents]
        self._state.turning += [(0, agents[turned], heading) for _, turned, heading in turning]
        others._deed_log.move_part(number, self._deed_log, agents)
        if others._radio is not None and self._radio is not None:
            others._radio.move_admitted(number, self._radio)

    def _give_to(self, own: "BatchEngine", number: int) -> dict[Hashable, OutsideActions]:
        """Return the given actions of this turn for a game that another engine plays alone."""
        found = {}
        roster = own._state.roster
        numbers = {name: agent for agent, name in enumerate(roster.names)}
        teams = roster.list_teams()
        for team, wanted in self._now.given.items():
            members = [self._state.roster.names[agent] for agent in wanted.select_agents(self._state.roster, team)]
            places = [i for i, name in enumerate(members) if name in numbers and teams[numbers[name]] == team]
            if places:
                renumbered = np.array([numbers.get(name, -1) for name in self._state.roster.names], np.int64)
                declared = own.maps[0].plan.settings["deeds"]
                one = wanted.select_game(number, np.array(places), renumbered, declared)
                found[team] = one._replace(numbers=np.array([numbers[members[i]] for i in places]), are_legal=False)
        return found

    def _note_own(self) -> None:
        """Write the turns, scores and ends of games in columns of their own to those of all games."""
        state = self._state
        for number, one in self.own.items():
            one._note_own()
            state.turn[number] = one._state.turn[0]
            state.over[number] = one._state.over[0]
            state.is_going[number] = one._state.is_going[0]
            state.scores.put(number, one._state.scores.get_scores(0))

    def _go_back(self) -> None:
        """Follow the plans of the begin of a turn again, and drop the columns that games have got in it."""
        for number in [number for number in self.own if self._block.plan_of[number] != _OWN]:
            self._end_own(number)
        for one in self.own.values():
            one._go_back()
        self._find_phases()

    def _end(self) -> None:
        """End the contexts of a game in columns of its own, and drop its last moves, which know the columns before."""
        on_map = self.maps[0]
        self.close()
        on_map.game.ctx.terminate()
        on_map.game.internals.state.moves = None
        for row in on_map.contexts.rows.values():
            release(row)

    def _end_own(self, number: int) -> None:
        """End the columns that a game has of its own."""
        self.own.pop(number)._end()
        self.maps[int(self._map_of[number])].contexts.moved.pop(number, None)

    @property
    def has_first_roads(self) -> bool:
        """Whether the roads of the start are open in all games."""
        return not any(one.state.roads.are_closed for one in self._in_use)

    @property
    def _at_rest(self) -> BoolArray | None:
        """A mask of the agents that certainly decide when a turn begins, (all games, agents); None: all."""
        masks = [(one.at_rest, games) for one, games in zip(self._all, self._on, strict=True)]
        found, _ = masks[0]
        for mask, games in masks[1:]:
            if found is not None and mask is not None:
                found[games] = mask[games]
        return found

    def _select_maps(self, which: BoolArray) -> Iterator[tuple[GamesOnOneMap, IntArray]]:
        """Yield each plan with the games that follow it and that a mask selects, (games,)."""
        are_all = np.count_nonzero(which) == len(which)
        for one, games in zip(self._all, self._on, strict=True):
            yield one, games if are_all else games[which[games]]

    @property
    def current(self) -> int:
        """The number of the map whose strategies are called now; 0: none are called."""
        called = next((one for one in self._all if one.asking is not None), self.maps[0])
        moved = next((number for number, own in self.own.items() if own.loaded is not None), None)
        return (called.source or called).number if moved is None else int(self._map_of[moved])

    @property
    def loaded(self) -> int | None:
        """The number of the game whose strategies are called now; None: none are called."""
        moved = (number for number, own in self.own.items() if own.loaded is not None)
        return next((one.asking for one in self._all if one.asking is not None), next(moved, None))

    @property
    def functions(self) -> list[Callable[..., object]]:
        """The functions that it calls."""
        of_own = [function for own in self.own.values() for function in own.functions]
        return [function for one in self._in_use for function in one.functions] + of_own

    @property
    def plays_by_phases(self) -> bool:
        """Whether functions are called, or messages are sent, between phases of a turn."""
        has_functions = self.calls_each or len(self.functions) > 0 or len(self.own) > 0
        return self._radio is not None or self._state.flights is not None or has_functions

    @property
    def calls_each(self) -> bool:
        """Whether plain functions are called game by game."""
        return any(one.calls is not None for one in self._in_use)

    def close(self) -> None:
        """End the contexts of games in which functions were called."""
        for one in self.maps:
            one.contexts.close()
        for number in [*self.own]:
            self._end_own(number)

    def start(self, games: IntArray, first: int | IntArray) -> None:
        """Begin games with their next rows; `first`: the number of the map of each one that has the first streets."""
        maps = first + self.starts.streets[self.starts.next[games]]
        for number in np.unique(maps).tolist():
            self.maps[number].begin(games[maps == number])
        self._note_begun(games, maps)

    def _note_begun(self, games: IntArray, maps: IntArray) -> None:
        """Set the values of games that have begun on these maps, besides columns."""
        ended = [game for game in games.tolist() if game in self.own]
        for game in ended:
            self._end_own(game)
        self._map_of[games] = maps
        self._block.plan_of[games] = maps
        if len(self._all) > 1 or ended:
            self._find_games()
            if ended or self._in_use != [one for one, its in zip(self._all, self._on, strict=True) if len(its)]:
                self._find_phases()
        self.last_turns[games] = NO_STOP if self._last is None else self._last
        self._state.stop_at[games] = NO_STOP
        for number in np.unique(maps).tolist():
            those = games[maps == number]
            self.maps[number].note_begun(those, self.starts.get_seeds(self.starts.now[those]))

    @property
    def is_over(self) -> BoolArray:
        """Whether each game has ended, (games,)."""
        over = ~self._state.is_going
        over |= self._state.turn >= self.last_turns
        return over

    @property
    def playing(self) -> BoolArray:
        """Whether each game is played here and is not over, (games,)."""
        found = ~self.is_over
        if self.only is not None:
            found[: self.only] = False
            found[self.only + 1 :] = False
        return found

    @contextmanager
    def play_only(self, game: int) -> Iterator[None]:
        """Play only this game within the block, and seed the global generators for it; see `seed_for_run`."""
        ctx = self.show(game).ctx
        self.only = game
        try:
            with seed_for_run(ctx, int(self._state.turn[game])):
                yield
        finally:
            self.only = None

    def show(self, game: int) -> PlayedGame:
        """Return a game in the context that functions get, which shows it as it is now."""
        if game in self.own:
            return self.own[game].show(0)
        return self.maps[int(self._map_of[game])].contexts.show(game)

    def fork(self, game: int) -> PlayedGame:
        """Return a game as it is between two turns, in a context of its own."""
        found = self.own[game].fork(0) if game in self.own else self.maps[int(self._map_of[game])].fork(game)
        found.internals.left_as = game
        return found

    def stop_after(self, turns: int | None) -> None:
        """Let a run that begins now stop each game after a number of turns; None: it has no limit."""
        self._state.stop_at[:] = NO_STOP if turns is None else self._state.turn + turns
        for one, games in zip(self._all, self._on, strict=True) if self._plans else ():
            last = one.plan.settings["max_turns"]  # a run that begins now ends there; the run before went on
            self.last_turns[games] = NO_STOP if last is None else last
        for number, own in self.own.items():
            last = own._find_limit()
            self.last_turns[number] = NO_STOP if last is None else last
            self._end_with_others(number)

    def _end_with_others(self, number: int) -> None:
        """Let a game in columns of its own end when those of all games say so."""
        own = self.own[number]
        own.last_turns[0] = self.last_turns[number]
        own._state.stop_at[0] = self._state.stop_at[number]
        if own.own:
            own._end_with_others(0)

    def _find_limit(self) -> int | None:
        """Return the turn after which the only game of these ends, by its setting; None: it has no limit."""
        if self.own:
            return self.own[0]._find_limit()
        last: int | None = self._find_plan(0).plan.settings["max_turns"]
        return last

    def count_turns_left(self) -> int:
        """Return the largest number of turns that a game which is not over has left in a run."""
        playing = self.playing
        left = (self._state.stop_at - self._state.turn)[playing]
        return int(np.clip(left, 0, _MOST_AT_ONCE).max(initial=0))

    # -- playing ------------------------------------------------------------------------------------------------

    def play(
        self,
        most: int,
        threads: int,
        given: Mapping[Hashable, OutsideActions] | None = None,
        writer: LearnerWriter | None = None,
    ) -> int:
        """Play some turns of the games that are not over, at most `most`; return the largest number played.

        Only for games without functions. As many turns are played as take a moment, but at least one.

        Args:
            most: the largest number of turns.
            threads: the number of threads.
            given: team -> the moves of its agents in a single turn, see `can_play_moves`; None: all decide themselves.
            writer: takes the moves itself, and writes their rewards and observations; None: the caller does.

        Raises:
            TurnInterrupted: Ctrl-C was pressed in a long turn, which was not played.
        """
        if self._leaves_out:  # who may be dead
            self.step({})
            return 1
        if given is not None:
            return self._play_given(given, threads, writer)
        before = self._state.turn.copy()
        count = min(most, max(1, int(_MOMENT_S / max(self._seconds, _MOMENT_S / _MOST_AT_ONCE))))
        self._play_turns(count, None, threads)
        played = int((self._state.turn - before).max())
        self._seconds /= max(played, 1)
        return played

    def _play_given(self, given: Mapping[Hashable, OutsideActions], threads: int, writer: LearnerWriter | None) -> int:
        """Play a turn with given moves; return 1."""
        are_legal = all(one.are_legal for one in given.values())
        playing = self._state.is_going if are_legal else self.playing  # where moves are checked
        self._begin_turn(playing, given, threads)
        if writer is None:
            self._take_moves(playing, given, None)
        try:
            self._play_turns(1, self._now.agents.takes, threads, writer)
        except TurnInterrupted:
            if writer is not None:
                writer.take_back()
            raise
        if writer is not None and len(writer.begun):
            streets = self.starts.streets[self.starts.now[writer.begun]]
            self._note_begun(writer.begun, self.newest.start + streets)
        return 1

    def _play_turns(
        self,
        most: int,
        takes: Mapping[int, BoolArray] | None,
        threads: int,
        writer: LearnerWriter | None = None,
    ) -> None:
        """Play some turns of the games that are not over, at most `most`; see `_play`."""
        begin_turns(self._turns, most)
        put_scores(self._state, self._block.score)
        with self._undo_on_error([], is_single=False):  # no function can raise
            self._run_core(takes, threads, None, writer)
            if self._block.illegal and self._is_strict:
                self._raise_illegal()

    def can_play_moves(self, given: Mapping[Hashable, OutsideActions]) -> bool:
        """Return whether the core plays a whole turn with these actions in one call: they are moves alone.

        Then nothing that the core does not do happens between the phases of the turn.
        """
        return self._plays_turns and all(one.are_moves for one in given.values())

    def step(self, given: Mapping[Hashable, OutsideActions], threads: int = 1) -> None:
        """Play one turn of all games that are not over.

        Args:
            given: team -> the actions of its agents, which replace their decisions.
            threads: the number of threads.
        """
        is_over = self.is_over
        is_single = len(is_over) - np.count_nonzero(is_over) == 1
        needing = self._list_needing(is_given=len(given) > 0, is_single=is_single)
        with self._undo_on_error(needing, is_single=is_single):
            self._begin_turn(self.playing, given, threads)
            self.play_turn()
            self._note_own()

    def _list_needing(self, *, is_given: bool, is_single: bool) -> list[GamesOnOneMap]:
        """Return the games in which functions may raise after something has changed; see `is_checkpoint_needed`."""
        each = [one for one in self._in_use if one.is_checkpoint_needed(is_given=is_given, is_single=is_single)]
        needing = [*dict.fromkeys(one.source or one for one in each)]
        if self.own:  # in them, functions have changed more than a turn changes
            needing = [*dict.fromkeys(one.source or one for one in self._in_use)] or self.maps[:1]
        for own in self.own.values():
            needing += own._list_needing(is_given=is_given, is_single=False)
        return needing

    def interrupt(self) -> None:
        """Stop the turns under way, if they take long and can be taken back."""
        self._state.stop[0] = self._can_stop

    @contextmanager
    def _undo_on_error(self, needing: Sequence["GamesOnOneMap"], *, is_single: bool) -> Iterator[None]:
        """Take back the turns of the block if it raises; that of a single game only until the turn is counted.

        Turns that take long can be interrupted; before the first turn, the time is not known.

        Args:
            needing: the games in which a function may raise after something has changed.
            is_single: whether one game plays.

        Raises:
            TurnInterrupted: Ctrl-C was pressed.
        """
        is_long = self._seconds > _LONG_S
        turns = self._state.turn.copy() if is_single else self._state.turn
        undoing = [one.checkpoint() for one in needing]
        undoing_interrupted = undoing
        if is_long and not undoing:
            undoing_interrupted = [one.checkpoint() for one in self._in_use]
        self._can_stop = is_long
        began = perf_counter()
        try:
            yield
        except TurnInterrupted:
            self._take_back(undoing_interrupted)
            raise
        except BaseException:
            self._note_own()
            is_counted = is_single and (self._state.turn != turns).any()
            self._take_back(() if is_counted else undoing)
            raise
        finally:
            self._seconds = perf_counter() - began
            self._can_stop = False
            self._state.stop[0] = 0

    def _take_back(self, undoing: Sequence[Callable[[], None]]) -> None:
        """Take back a turn with these functions; games follow the plans of its begin again."""
        for undo in undoing:
            undo()
        if undoing:
            self._go_back()
        self._note_own()

    # -- the phases of a turn -----------------------------------------------------------------------------------

    def plan(self) -> TurnPlan:
        """Return the phases of a turn."""
        own = [one.plan() for one in self.own.values()]
        needed = {"decide", "move"}
        if self._acts or self._has_deeds:
            needed.add("act")
        if any(one.plan.has_conflicts for one in self._in_use):
            needed.add("give way")
        needed |= {entry.phase for one in own for entry in one.entries} - {"send"}
        parts = [needed] * self.num_parts
        if self._plays_parts_at_once:
            parts[:-1] = [set()] * (self._num_parts - 1)
        self.plan_now = self.make_plan(None, parts, self._radio is not None)
        return self.plan_now

    @property
    def num_parts(self) -> int:
        """The number of parts of a turn, of the games that have most."""
        return max([self._num_parts, *(one.num_parts for one in self.own.values())])

    def _begin_turn(self, playing: BoolArray, given: Mapping[Hashable, OutsideActions], threads: int) -> None:
        """Note which games play a turn, and which actions come from outside."""
        self._state.failures.clear()
        self._left.clear()
        self._in_turn.clear()
        self._block.edges.forget()
        for log in self._logs_of_turn:
            log.begin_turn()
        for number in [number for number, one in self.own.items() if one.own]:
            self._flatten(number)
        teams = tuple((team, wanted.name) for team, wanted in given.items())
        agents = self._given_agents.get(teams)
        if agents is None:
            agents = self._find_given(given)
            self._given_agents[teams] = agents
        self._now = TurnOfGames(playing, given, agents, threads)
        for number, one in self.own.items():
            one._begin_turn(playing[[number]], self._give_to(one, number), 1)

    def _flatten(self, number: int) -> None:
        """Play a game in the newest of the columns of its own that it has got one after the other."""
        before = self.own[number]
        self.own[number] = before.own.pop(0)
        self.own[number].phase = self.phase
        before._end()

    def _find_given(self, given: Mapping[Hashable, OutsideActions]) -> OutsideAgents:
        """Return the agents that actions are for, team by team."""
        roster = self._state.roster
        is_given = np.zeros(len(roster.names), np.bool_)
        members = {team: wanted.select_agents(roster, team) for team, wanted in given.items()}
        for agents in members.values():
            is_given[agents] = True
        takes = None
        if given or self._asks_functions:
            takes = {one.number: one.find_block_agents(is_given) for one in self._all}
        asks_at_arrivals = any(one.is_asking_at_arrivals(is_given=len(given) > 0) for one in self._in_use)
        return OutsideAgents(members, is_given, takes, asks_at_arrivals)

    def run_before_moves(self) -> bool:
        """Call the rules before the moves, and take the given actions."""
        self._check_given()
        self._call_rules_before()
        self._play_left()
        self._take_given()
        return True

    def _check_given(self) -> None:
        """Refuse actions from outside that are not legal before a rule is called."""
        now = self._now
        if self._has_rules_before:
            self._take_moves(now.playing, now.given, self._at_rest)
            for one, games in self._select_maps(now.playing):
                one.check_given(games, now.given)
        for own in self.own.values():
            own._check_given()

    def _call_rules_before(self) -> None:
        """Call the rules of the phase "before"."""
        others = [*self.own.values()]
        for one, games in self._select_maps(self._now.playing) if self._has_rules_before else ():
            one.call_before(games)
        for own in others:
            own._call_rules_before()

    def _take_given(self) -> None:
        """Take the given actions in the games that go on after the rules of the phase "before"."""
        now = self._now
        if self._has_rules_before or self._in_turn:
            now.playing = now.playing & ~self.is_over
        for one, games in self._select_maps(now.playing) if self._leaves_out else ():
            one.refuse_left_out(games)
        if now.given and not now.agents.asks_at_arrivals:
            self._take(now.playing, now.given)
        for own in self.own.values():
            own._take_given()

    def begin_moves(self, plan: TurnPlan) -> int:
        """Forget the choices of the last turn."""
        now = self._now
        if self._state.flights is not None:
            self._state.flights.chosen.clear()
        self._state.turning.clear()
        now.first = self._block.part.copy()
        now.begun = self._state.turn * self._num_parts
        self.part = 0
        self._is_moving = True
        for one in self.own.values():
            one.begin_moves(plan)
        return 0

    def end_moves(self) -> int:
        """Let plans that functions have changed in the moves count from now on."""
        self._is_moving = False
        if self._in_turn:
            self._find_phases()
        for one in self.own.values():
            one.end_moves()
        return 0

    def lose_moves(self, error: BaseException) -> None:
        """Take back the parts of the turn that were played; see `_undo_on_error`."""
        self._block.part[:] = self._now.first
        self._block.held[:] = 0
        for one in self._in_use:
            one.contexts.decide_again()
        for own in self.own.values():
            own.lose_moves(error)

    def run_after_moves(self) -> int:
        """Call rules and collectors in the games that have moved."""
        self._begin_rules_after()
        self._play_rules()
        self._play_left()
        self._end_rules_after()
        return 0

    def _begin_rules_after(self) -> None:
        """Prepare to call the rules of the phase "after"."""
        others = [*self.own.values()]
        self._now.roads = self._number_roads()
        for one, games in self._select_maps(self._now.playing):
            if one.calls is not None:
                one.calls.drive_on(games)
        for own in others:
            own._begin_rules_after()

    def _end_rules_after(self) -> None:
        """Let agents leave edges that rules have closed, call the collectors, and end the turn of messages."""
        others = [*self.own.values()]
        changed = self._number_roads() != self._now.roads
        for one, games in self._select_maps(self._now.playing):
            one.leave_closed_edges(games[changed[games]])
            if one.calls is not None:
                one.calls.collect(self._block.select_followers(one.number, games))
        if self._radio is not None:
            self._radio.end_turns(1)
        for own in others:
            own._end_rules_after()

    def _list_rules_after(self) -> list[tuple[GamesOnOneMap, IntArray, Iterator[NamedRule]]]:
        """Return the games that have moved, and what yields the functions of each that are rules."""
        found = [(one, games, one.core.play_rules(games)) for one, games in self._select_maps(self._now.playing)]
        for own in self.own.values():
            found += own._list_rules_after()
        return found

    def _play_rules(self) -> None:
        """Call the rules of the phase "after" rank by rank, whatever plans games follow.

        So functions of users, which may raise, are called in all games before shipped rules of later ranks.
        """
        each = self._list_rules_after()
        due = [next(rules, None) for _, _, rules in each]
        while any(due):
            rank = min(named.spec.rank for named in due if named is not None)
            for place, (one, games, rules) in enumerate(each):
                named = due[place]
                while named is not None and (len(each) == 1 or named.spec.rank == rank):
                    one.call(named, games)
                    named = next(rules, None)
                due[place] = named

    def _number_roads(self) -> IntArray:
        """Return the number of the open roads of each game among those of its map, (games,)."""
        found = np.zeros_like(self._map_of)
        for one, games in zip(self._all, self._on, strict=True):
            found[games] = one.state.roads.number[games]
        return found

    def _play_core(self, playing: BoolArray, part: int, phase: int | None) -> None:
        """Play a phase of a part of the turn in the core; None: all phases; see `_play`."""
        now = self._now
        self._play(playing, now.begun + part + 1, now.agents.takes, now.threads, phase)

    def _decide(self, part: int) -> None:
        """Let the agents of a part of the turn observe and decide; if no function acts before the moves, play these."""
        for own in self.own.values():
            own._decide(part)
        if part >= self._num_parts:
            return
        now = self._now
        self.part = part
        playing: BoolArray = now.playing & (now.first <= part) & self._state.is_going
        now.in_part = playing
        play = partial(self._play_core, playing, part)
        for one, games in self._select_maps(playing) if self._by_metres else ():
            one.leave_closed_edges(games, part)
        if now.agents.asks_at_arrivals:
            self._play_arrivals(playing, part, play)
            return
        if part > 0 and now.given and not self._plays_parts_at_once:
            self._take_moves_again(playing, part)
        for one, games in self._select_maps(playing) if self._asks_functions or self._state.flights is not None else ():
            one.decide(games, part, now.agents.is_given)
        self._play_decisions(playing, part, partial(play, _DECIDE if self._acts else None))

    def _act(self, part: int) -> None:
        """Call the rules that refuse moves and deeds, log the deeds, and call the rules that execute them."""
        self._check(part)
        self._do_deeds(part)
        self._play_left()
        self._end_deeds(part)

    def _check(self, part: int) -> None:
        """Call the rules that refuse moves and deeds, and log the deeds."""
        for own in self.own.values():
            own._check(part)
        if part >= self._num_parts:
            return
        for one, games in self._select_maps(self._now.in_part) if self._acts else ():
            one.check(games, part)
        self._deed_log.note(self.maps[0].state.deeds.lasting)

    def _do_deeds(self, part: int) -> None:
        """Call the rules of the phase "deeds"."""
        others = [*self.own.values()]
        now = self._now
        if self._acts and part < self._num_parts:
            self._play_core(now.in_part, part, _SETTLE)
            now.roads = self._number_roads()
            now.lived = self._state.alive.copy()
            for one, games in self._select_maps(now.in_part):
                for named in one.plan.list_rules("deeds"):
                    one.call(named, games, part)
        for own in others:
            own._do_deeds(part)

    def _end_deeds(self, part: int) -> None:
        """Let agents stay that rules of the phase "deeds" have placed elsewhere, or whose way they have closed."""
        for own in self.own.values():
            own._end_deeds(part)
        if not self._acts or part >= self._num_parts:
            return
        now = self._now
        for one, games in self._select_maps(now.in_part):
            one.end_deeds(games, part, now.lived)
        self._play_core(now.in_part, part, _SETTLE)
        changed = now.in_part & (self._number_roads() != now.roads)
        for one, games in self._select_maps(changed):
            one.cut_off(games, part)
        if changed.any():
            self._play_core(now.in_part, part, _SETTLE)

    def _give_way(self, part: int) -> None:
        """Call the functions that decide conflicts."""
        for own in self.own.values():
            own._give_way(part)
        for one, games in self._select_maps(self._now.in_part) if part < self._num_parts else ():
            one.give_way(games, part)

    def _move(self, part: int) -> None:
        """Move the agents, unless the core has moved them after their decisions; then those that fly."""
        for own in self.own.values():
            own._move(part)
        if part >= self._num_parts:
            return
        playing = self._now.in_part
        if self._acts or self._now.agents.asks_at_arrivals:
            self._play_core(playing, part, _MOVE)
        self._state.apply_headings()
        for one, games in self._select_maps(playing) if self._state.flights is not None else ():
            one.fly(games, part)

    def _send(self, part: int) -> None:
        """Send the messages of the turn."""
        for own in self.own.values():
            own._send(part)
        for one, games in self._select_maps(self._now.playing):
            one.send(games)

    # -- decisions ----------------------------------------------------------------------------------------------

    def _take(
        self, playing: BoolArray, given: Mapping[Hashable, OutsideActions], here: BoolArray | None = None
    ) -> None:
        """Take the actions that are given.

        Args:
            playing: (games,) a mask of the games that are played.
            given: team -> the actions of its agents, which replace their decisions.
            here: (games, agents) a mask of the agents that decide now; None: all.
        """
        self._take_moves(playing, given, here)
        for one, games in self._select_maps(playing):
            one.take(games, given, here)

    def _ask_at_arrivals(self, playing: BoolArray, part: int) -> None:
        """Ask for the decisions of agents that arrive now or set out, and take actions from outside."""
        is_given = self._now.agents.is_given
        here = np.zeros(self._state.node.shape, np.bool_)
        for one, games in self._select_maps(playing):
            here[games] = one.core.find_deciding(games)
        if self._now.given:
            self._take(playing, self._now.given, here)
        for one, games in self._select_maps(playing):
            one.decide(games, part, is_given, here)

    def _take_moves(self, playing: BoolArray, given: Mapping[Hashable, OutsideActions], here: BoolArray | None) -> None:
        """Write given moves into the block, if they are legal; see `_take` for `here`."""
        checked = dict(given)
        if here is None and not self._has_rules_before:  # agents are where they were when the turn began
            for team in [team for team, wanted in given.items() if wanted.are_legal]:
                wanted = checked.pop(team)
                self._block.given[:, self._now.agents.members[team]] = wanted.moves
        for state, games in self._group_by_legal_moves(playing) if checked else ():
            for team, wanted in checked.items():
                agents = self._now.agents.members[team]
                view = make_asked_view(state, games, agents, here)
                on_ground = np.where(state.roster.flies[agents], 0, wanted.moves[games])
                moves = view._check_actions(wanted.get_moves(view, on_ground), f"team {shown(team)}")
                self._block.given[np.ix_(games, agents)] = moves
        if any(wanted.edges is not None for wanted in given.values()):
            self._take_edges(playing, given, here)

    def _take_edges(self, playing: BoolArray, given: Mapping[Hashable, OutsideActions], here: BoolArray | None) -> None:
        """Write given edges into the block, if they are legal, with the moves to their ends; see `_take` for `here`."""
        for one, games in self._select_maps(playing):
            for team, wanted in given.items() if len(games) else ():
                agents = self._now.agents.members[team]
                view = make_asked_view(one.state, games, agents, here)
                if not one.core.arrival:  # an edge that is not legal where an agent arrives lets it stay there
                    wanted.check_edges(view, f"team {shown(team)}")
                edges = wanted.get_edges(view)
                if edges is not None and (edges != NO_EDGE).any():
                    rows = np.ix_(games, agents)
                    one.core.edges.put(rows, edges, one.state.movement.columns)
                    self._block.given[rows] = lead_along(view, edges, self._block.given[rows])

    def _take_moves_again(self, playing: BoolArray, part: int) -> None:
        """Check the given moves of a later part of the turn: rules may have closed roads, or moved agents."""
        now = self._now
        is_next = self.maps[0].core.part_of == part
        given = {team: one for team, one in now.given.items() if is_next[now.agents.members[team]].any()}
        self._take_moves(playing, given, np.broadcast_to(is_next, self._state.node.shape))

    def _group_by_legal_moves(self, playing: BoolArray) -> list[tuple[GameArrays, IntArray]]:
        """Return groups of games whose legal moves are in one table, with their states."""
        if self._of_all_maps is None or not self.has_first_roads:
            return [(one.state, games) for one, games in self._select_maps(playing)]
        tables = self._tables
        self._of_all_maps.movement.tables = tables._replace(first=tables.first[self._map_of % self._num_streets])
        return [(self._of_all_maps, np.flatnonzero(playing))]

    def _play_decisions(
        self, playing: BoolArray, part: int, play: Callable[[], None], *, is_later: bool = False
    ) -> None:
        """Carry out the decisions of agents in a part of the turn; record failed actions and unsent messages.

        Args:
            playing: (games,) a mask of the games that are played.
            part: the part of the turn.
            play: plays the decisions in the core.
            is_later: whether these are decisions on arrival, after the deeds of the turn.

        Raises:
            IllegalAction: an action is illegal, and `on_illegal` is "raise".
        """
        if self._state.flights is not None and not is_later:
            members = (self.maps[0].core.part_of == part) | (part == 0)
            self._state.flights.set_out(flatten(np.flatnonzero(playing), np.int64), get_memory(members))
        flaws = self._admit(part)
        turns = self._state.turn.copy()
        if not is_later:
            self._deed_log.do(part, is_first=part == 0)
        play()
        illegal = self._block.illegal
        if illegal and self._is_strict:
            self._raise_illegal()
        failed = {(one.game, one.agent) for one in illegal}
        for log in self._logs_of_turn if failed else ():
            log.withdraw(failed)
        for one in illegal if is_later else ():
            where = np.array([one.game]), np.array([one.agent])
            self._find_plan(one.game).core.note_late_deeds(*where, are_wanted=False)
        for flaw in [one for one in flaws if (one.game, one.agent) not in failed]:
            self.maps[self._map_of[flaw.game]].state.refuse(flaw, int(turns[flaw.game]))

    def _play_arrivals(self, playing: BoolArray, part: int, play: Callable[[int], None]) -> None:
        """Start the agents of a part of the turn, and ask them again on each arrival until the turn is over.

        Args:
            playing: (games,) a mask of the games that are played.
            part: the part of the turn.
            play: plays a phase in the core.
        """
        for one, games in self._select_maps(playing):
            one.core.begin_arrivals(games)
        is_played = False
        try:
            play(_ARRIVE)
            number = 0
            now = playing
            while number == 0 or now.any():
                self._state.notice_interrupt()
                now = self._find_arriving_games(now)
                turned = len(self._state.turning)
                if number > 0:
                    self._block.edges.begin_arrival()
                self._ask_at_arrivals(now, part)
                self._play_decisions(now, part, partial(play, _CHOOSE), is_later=number > 0)
                for one, games in self._select_maps(now):
                    one.give_way_at_arrivals(games)
                play(_GO_ON)
                for one, games in self._select_maps(now):
                    if one.calls is not None:
                        one.calls.note_losers(games)
                if number > 0:
                    self._state.turning[turned:] = filter(self._has_gone_on, self._state.turning[turned:])
                play(_ARRIVE)
                number += 1
                for one in self._in_use:
                    one.core.arrival = number
            is_played = True
        finally:
            self._block.edges.end_arrivals()
            for one in self._all:
                one.core.end_arrivals(is_played=is_played)

    def _has_gone_on(self, turning: tuple[int, int, Any]) -> bool:
        """Return whether an agent that has chosen a heading on arrival was not stopped there."""
        game, agent, _ = turning
        losers = self._find_plan(game).core.find_losers(np.array([game]))
        return not losers[0, agent] and (game, agent) not in self._block.waiting

    def _find_arriving_games(self, playing: BoolArray) -> BoolArray:
        """Return a mask of the games in which agents arrive or set out, (games,)."""
        arriving = np.zeros_like(playing)
        for one, games in self._select_maps(playing):
            arriving[one.core.select_arriving(games)] = True
        return arriving

    def _admit(self, part: int) -> list[Failure]:
        """Admit the valid messages of a part of the turn; return the errors of the others.

        Raises:
            IllegalAction: a message cannot be sent, and `on_illegal` is "raise".
        """
        flaws = [] if self._radio is None else self._radio.admit(part, self._state.is_there)
        if flaws and self._is_strict:
            raise self._make_illegal_action(flaws[0], flaws[0].message)
        return flaws

    def _raise_illegal(self) -> None:
        """Raise the error for the first decision that the core could not execute."""
        failure = self._block.illegal[0]
        raise self._make_illegal_action(failure, failure.message.removeprefix("BadValue: "))

    def _make_illegal_action(self, failure: Failure, why: str) -> IllegalAction:
        """Return the error for an illegal action of an agent."""
        state = self._state
        game = failure.game
        error = IllegalAction(f"Agent {state.roster.name(failure.agent)} in turn {state.turn[game]}: {why}")
        error.add_note(f"In game {state.first_game + game} of a batch, with the seed {state.seeds[game]}.")
        return error

    def _play(
        self,
        playing: BoolArray,
        until: IntArray,
        takes: Mapping[int, BoolArray] | None,
        threads: int,
        phase: int | None = None,
    ) -> None:
        """Play games in the core.

        Args:
            playing: (games,) a mask of the games that are played.
            until: (games,) the number of parts of turns after which each game stops.
            takes: plan -> a mask of the agents whose actions are in the block, (agents,); None: no agents.
            threads: the number of threads.
            phase: the phase of a part of the turn, see `gamms.core.turn`; None: all phases.
        """
        self._block.until[:] = np.where(playing, until, 0)
        self._block.give()
        self._run_core(takes, threads, phase)

    def _run_core(
        self,
        takes: Mapping[int, BoolArray] | None,
        threads: int,
        phase: int | None,
        writer: LearnerWriter | None = None,
    ) -> None:
        """Play the games that `CoreColumns.until` selects; see `_play` and `play`."""
        cores = [one.core for one in self._in_use]
        for one in self._in_use:
            one.core.prepare(None if takes is None else takes[one.number], threads)

        def play_part(thread: int, begin: int, end: int) -> None:
            if writer is not None:
                players = [core.get_player(thread) for core in cores]
                play_step(steps[thread], players, starts, writer.waits, begin, end)
                return
            for core in cores:
                core.play_part(thread, begin, end, phase)

        if writer is not None:
            columns = get_memory(self._block.given), get_memory(self._block.score)
            steps = writer.begin_step(self._turns, *columns, self._block.score.shape[1])
            starts = [self.maps[number].starts for number in self.newest] if writer.begins else []
        play_in_threads(play_part, len(self._map_of), threads, waits=self._can_stop)
        if writer is not None:
            writer.end_step()
        for core in cores:
            core.finish()
        self._block.take_in()
        self._state.notice_interrupt()

    # -- seeing -------------------------------------------------------------------------------------------------

    def group_by_map(self, games: IntArray) -> Iterator[tuple[GameArrays, IntArray]]:
        """Yield the state of each map, with the given games that are on it."""
        for number, one in enumerate(self.maps):
            some = games[self._map_of[games] == number]
            if len(some):
                yield one.state, some

    def make_view(self, agents: IntArray, number: int) -> ArrayView:
        """Return the observations of agents in the games on the map with this number."""
        games = self._on[number] if len(self._all) == 1 and not self.own else np.flatnonzero(self._map_of == number)
        return ArrayView(self.maps[number].state, games, agents)

    def describe_end(self, game: int) -> dict[str, Any] | None:
        """Return the reason, winner and truncation of a game's end; None: it goes on."""
        known = self._state.over[game]
        turn = self._state.turn[game]
        has_stopped = turn == self._state.stop_at[game]  # a step may have gone on from there
        is_late = has_stopped or turn >= self.last_turns[game]
        return {"reason": "max_turns", "winner": None, "truncated": True} if known is None and is_late else known

    def list_ends(self) -> tuple[IntArray, list[dict[str, Any] | None]]:
        """Return the games that do not go on, and the reason, winner and truncation of the end that rules gave each."""
        ended = np.flatnonzero(~self._state.is_going)
        over = self._state.over
        return ended, [over[game] for game in ended.tolist()]

    def count_turns(self) -> IntArray:
        """Return the number of turns played, (games,)."""
        return self._state.turn.copy()

    def get_result(self, game: int) -> Result:
        """Return the result of a game so far."""
        if game in self.own:
            found = self.own[game].get_result(0)
            over = self.describe_end(game)
            return replace(found, **over) if over is not None and found.reason == "unfinished" else found
        on_map = self.maps[int(self._map_of[game])]
        state = on_map.state
        template = on_map.game.result()
        nodes = state.streets.ids(state.node[game]).tolist()
        roster = state.roster
        calls = on_map.calls
        own = None if calls is None else calls.get_agents(game)
        if own is None:
            own = [(agent, agent.strategy) for agent in roster.agents if not isinstance(agent, ComingAgent)]
        ends = {agent.name: agent.team for agent, _ in own}
        gone = on_map.game.internals.state.departed if calls is None else calls.get_departed(game)
        agents = {}
        for number, name in enumerate(roster.names):
            if name in ends or name in gone:
                agents[name] = {
                    "team": ends[name] if name in ends else gone[name][0],
                    "alive": bool(state.alive[game, number]),
                    "node": nodes[number] if name in ends else gone[name][1],
                    **{kind: int(counts[game, number]) for kind, counts in state.counts.items()},
                }
        for name in gone.keys() - {*roster.names}:  # created and deleted in one call
            team, node = gone[name]
            agents[name] = {"team": team, "alive": False, "node": node, **dict.fromkeys(state.counts, 0)}
        plans = on_map.game.settings()["plans"] if calls is None else calls.get_plans(game)
        deciders = {
            agent.name: plans[agent.team].function if agent.team in plans else strategy for agent, strategy in own
        }
        strategies = {name: find_strategy_name(one) for name, one in deciders.items()}
        over = self.describe_end(game) or {"reason": "unfinished", "winner": None, "truncated": True}
        return Result(
            turns=int(state.turn[game]),
            scores=state.scores.get_scores(game),
            events=[dict(event) for event in state.events.list_entries(game)],
            agents=dict(sorted(agents.items())),
            errors=[dict(error) for error in state.errors.list_entries(game)],
            deeds=[dict(deed) for deed in self._deed_log.list_entries(game)],
            collected=template.collected if on_map.calls is None else on_map.calls.get_collected(game),
            messages=[] if self._radio is None else [dict(message) for message in self._radio.list_entries(game)],
            timings=dict.fromkeys(PHASES, 0.0),
            seed=state.seeds[game],
            provenance=template.provenance
            | {"strategies": dict(sorted(strategies.items()))}
            | list_opponents([(ends[name], one) for name, one in deciders.items()], state.seeds[game]),
            **over,
        )


def _make_traffic(settings: Mapping[str, Any], roster: AgentTable, num_games: int) -> MessageTraffic | None:
    """Return the messages of games with these settings; None: they have no channels."""
    channels = settings["channels"]
    part_of = roster.find_parts(settings["order"])
    return MessageTraffic(channels, roster.get_teams_by_name(), part_of, num_games) if channels else None


def make_core_movement(game: PlayedGame, roster: AgentTable, more_edges: ClosedEdges) -> Movement:
    """Return the movement of a game's agents in the core, where rules may close and open roads.

    `more_edges` are edges that only other games have at their start.
    """
    may_change = find_first_called(game, roster) is not None or any(map(is_function, list_called_rules(game, roster)))
    return make_movement(game, roster, may_reopen=may_change, is_detached=may_change, more_edges=more_edges)


def is_deciding_at_arrivals(movement: Movement) -> bool:
    """Return whether agents decide on arrival."""
    return movement.by_metres and movement.terms.decides_at_arrivals


def has_counted_looks(agent: IAgent) -> bool:
    """Return whether an agent has a sensor that counts its looks in a turn."""
    looks = [one.in_arrays() for one in get_sensors(agent).values() if hasattr(one, "in_arrays")]
    return any(look is not None and not look.is_plain for look in looks)


def _locate_agents(game: PlayedGame, state: GameArrays, radio: MessageTraffic, games: IntArray) -> MessagePositions:
    """Return the positions of the agents of some games after all moves.

    Args:
        game: a game in a context with the map of these games.
        state: the state of all games.
        radio: the messages of all games.
        games: the numbers of the games; all have the same open roads.
    """
    streets, movement, shared = state.make_map_data(games)
    columns = streets.columns
    node = state.node[games]
    which = np.broadcast_to(games[:, None], node.shape), np.broadcast_to(np.arange(node.shape[1]), node.shape)
    z = get_or_make(shared, "heights of nodes", lambda: _find_heights(game, columns.node_ids))[node]
    xyz = np.concatenate((movement.make_places(node, which).xy, z[..., None]), axis=-1)
    antennas = xyz + ANTENNA
    if state.flights is not None:
        in_air = state.position[games]
        xyz[:, state.flyers] = in_air
        antennas[:, state.flyers] = in_air

    def is_within(at: IntArray, transmitters: IntArray, hops: int) -> BoolArray:
        found: BoolArray = movement.get_routes(None).distances(node[at, transmitters][:, None], node[at]) <= hops
        return found

    return MessagePositions(
        teams=radio.teams,
        keys=state.roster.keys,
        turns=state.turn[games] - 1,
        xyz=xyz,
        antennas=antennas,
        alive=state.alive[games],
        send_keys=lambda channel, names: np.stack(
            [state.compute_purpose_keys("channel", channel, name)[games] for name in names], axis=1
        ),
        is_within=is_within,
        visible=game.ctx.graph.visible,
        place_of=lambda node: columns.xy[columns.node_ids == node].tolist(),
    )


def _find_heights(game: PlayedGame, nodes: IntArray) -> FloatArray:
    """Return the heights of nodes, metres."""
    ground = game.ctx.graph.graph.ground(nodes)
    return np.zeros(len(nodes)) if ground is None else np.asarray(ground.z)


def make_engine(game: PlayedGame) -> BatchEngine:
    """Return what plays one game, which goes on from its present state."""
    roster = make_roster(game)
    seed = game.ctx.seed
    own = GamesBySeed(game, None, seed, {}, differs=False, goes_on=True)
    start = np.array([roster.list_start_nodes(game)])
    movement = make_core_movement(game, roster, {})
    return BatchEngine([game], [movement], [seed], np.zeros(1, np.int64), start, [roster], [own], 1)
