"""Calls plain rules and strategies in a context that is pointed at each game of a batch in turn."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any

import numpy as np

from gamms.core.flight import TurnFlights
from gamms.deciding import get_phase
from gamms.errors import UnknownAttribute
from gamms.game.array_functions.view import ArrayView
from gamms.game.block.columns import PlayedGame
from gamms.game.block.in_core import CoreGames
from gamms.game.block.state import GameArrays
from gamms.game.cursor.called_functions import CalledFunctions
from gamms.game.cursor.pointed import GamesToShow, PointedContext
from gamms.game.cursor.shown import AskedAgents, ShownGame, StreamPositions
from gamms.game.decisions import Decisions
from gamms.game.messages import MessageTraffic, read_outboxes
from gamms.game.movement.courses import Routes
from gamms.game.result import Collectors
from gamms.game.settings import BegunPhase, NamedRule
from gamms.game.turn import CLOSED, describe_closed_edge
from gamms.ir.columns import Failure
from gamms.ir.deeds import PlainDeeds
from gamms.ir.game_state import describe_conflict
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray


def _return_function(function: object) -> object:
    """Return the function of a collector for another game of the batch."""
    return function


class Cursor:
    """Calls plain functions in a context that is pointed at each game of a batch in turn; see `ShownGame`.

    Args:
        game: the game at its start, whose context is pointed at other games.
        pointed: points the context at games.
        state: the state of all games.
        core: plays the games in the core.
        called: the functions that are called.

    Attributes:
        wanted: (games * agents,) the ids of nodes to which asked agents move; None: they go along routes.
        asks_anew: whether each game may ask other agents than the game before, or ask them otherwise; see `ask`.
        takes_all: whether all decisions of agents are taken, not only uncommon ones; see `take_decisions`.
    """

    _shown: ShownGame
    _has_begun = False
    _find_asked: Callable[[], AskedAgents]
    wanted: memoryview | None
    asks_anew: bool
    takes_all: bool

    def __init__(
        self, game: PlayedGame, pointed: PointedContext, state: GameArrays, core: CoreGames, called: CalledFunctions
    ) -> None:
        parts = game.internals.parts
        self._game = game
        self._pointed = pointed
        self._state = state
        state.tell = self.note_undone
        self._core = core
        self._called = called
        self._ctx = game.ctx
        self._parts = parts
        self._turns = parts.turns
        self._values = parts.state
        self._phase = get_phase(game.ctx)
        self._deeds = PlainDeeds(0, [])  # that agents want to do now
        self._marks = dict[int, StreamPositions]()  # of games, while agents arrive
        asked_names = {state.roster.names[number] for number in called.asked}
        pointed.at_start.undone = {name: why for name, why in parts.state.blocked.items() if name in asked_names}

    @property
    def functions(self) -> Sequence[Callable[..., object]]:
        """The plain functions that are called."""
        return self._called.functions

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
        """Let the context show games, unless it does already."""
        if not self._has_begun:
            self._shown = ShownGame(self._game, self._pointed, self._state, self._core, self._called)
            self._has_begun = True

    def release(self) -> None:
        """Restore the context as it was before it was pointed at games."""
        if self._has_begun:
            self._has_begun = False
            self._shown.release()

    def _let_leave(self) -> None:
        """Stop playing the current game here, and restore the context."""
        before = self._shown
        game = before.take_along(self._marks.get(self._pointed.number))
        self._state.leave(self._pointed.number, before.why, game)
        turns = self._turns
        is_moving = turns.is_moving
        self.release()
        self._begin()
        self._shown.go_on(before)
        self._shown.begin_counts()
        turns.is_playing = True
        turns.is_moving = is_moving

    def fork(self, number: int) -> PlayedGame:
        """Return a game, which is between two turns, as it is now in a context of its own."""
        rules = self._parts.rules.now
        self._begin()
        self._turns.is_playing = True
        shown = self._shown
        shown.begun = BegunPhase("after", rules.rules, len(rules.of_phase["after"]), collects=False)
        shown.raised = None
        shown.begin_counts()
        try:
            shown.show(self._pointed.get_first(np.array([number])), 0)
            game: PlayedGame = shown.take_along(None)
        finally:
            self.release()
        game.internals.parts.turns.finish_turn()
        game.internals.left_as = number
        return game

    def _begin_phase(self, phase: str, part: int) -> BegunPhase:
        """Return a phase of a part of the turn, in which games that leave go on."""
        return BegunPhase(phase, self._parts.rules.now.rules, 0, self._parts.settings.order, part=part)

    def _refuse_shared_changes(self) -> None:
        """Refuse that a function has changed attributes of agents that games share.

        Raises:
            BadValue: it has; see `ShownGame.refuse`.
        """
        if self._shown.has_changed_shared:
            self._pointed.number = -1  # it may have been in any of the games
            self._shown.refuse("changes the __dict__ of agents", "name __dict__, or call vars, in the function")

    def _name_failure(self, error: Exception) -> None:
        """Add the game to an error; agents have the attributes again that games share."""
        refused = self._shown.refused
        number = self._pointed.number if refused is None else refused
        if number >= 0:
            error.add_note(f"In game {number} of a batch, with the seed {self._state.seeds[number]}.")
        self._shown.refusal = None
        self._shown.refused = None
        if self._shown.has_changed_shared:
            self.release()

    def _play(self, games: IntArray, play: Callable[[ShownGame, GamesToShow, IntArray], int]) -> None:
        """Play those of some games that have not left, games with the same agents together.

        Args:
            games: the numbers of the games.
            play: plays games from the first one on until one leaves; called with what shows them, the games, and their
                indices; returns the number of games that it has played.
        """
        state = self._state
        places = np.arange(len(games))
        if state.leaving:
            places = np.flatnonzero(~np.isin(games, [*state.leaving]))
        while len(places):
            some = self._pointed.get_first(games[places])
            which = places[: len(some.numbers)]
            shown = self._shown
            shown.core_facts = [(name, facts_of(state, games[which])) for name, facts_of in self._called.facts_in_core]
            played = play(shown, some, which)
            if shown.refusal is not None:  # the function has caught it
                raise shown.refusal
            if shown.why:
                self._let_leave()
            places = places[played:]

    def check(self, games: IntArray, part: int) -> None:
        """Call the rules that may refuse moves and deeds of a part of the turn, in each of these games."""
        self._call_each(self._check, games, part=part, begun=self._begin_phase("check", part))

    def _check(self) -> None:
        number = self._pointed.number
        moves = self._shown.read("moves")
        log = self._state.deed_log
        part_of = self._core.part_of
        numbers = self._shown.number_of
        members = [i for i, name in enumerate(moves.order.names) if part_of[numbers[name]] == self._shown.part]
        for i, kind, why in self._turns.list_refused(moves, members, self._parts.rules):
            agent = numbers[moves.slots[i].name]
            self._note_undone(number, agent, why)
            if kind is None:
                self._hold(agent)
            else:
                self._state.note_failure(Failure.make_illegal(number, agent, why))
                log.refuse(number, agent, kind)
        self._shown.refuse_other_agents("the check of a rule")

    def cut_off(self, games: IntArray, part: int) -> None:
        """Keep agents in place whose path was closed in these games."""
        with self._call_after_joining():
            self._call_each(self._cut_off, games, part=part)

    @contextmanager
    def _call_after_joining(self) -> Iterator[None]:
        """Call functions after agents that were created in this part of the turn have joined it."""
        self._begin()
        self._shown.have_joined = True
        try:
            yield
        finally:
            self._shown.have_joined = False

    def _cut_off(self) -> None:
        moves = self._shown.read("moves")
        for i in self._turns.cut_off(moves):
            agent = self._shown.number_of[moves.slots[i].name]
            self._hold(agent)
            self._note_undone(self._pointed.number, agent, CLOSED)

    def give_way(self, games: IntArray, part: int) -> None:
        """Keep agents in place that lose conflicts decided by a function, in these games."""
        with self._call_after_joining():
            self._call_each(self._give_way, games, part=part, begun=self._begin_phase("give way", part))

    def _give_way(self) -> None:
        moves = self._shown.read("moves")
        for i, end in zip(*self._turns.stop_losers(moves), strict=True):
            agent = self._shown.number_of[moves.slots[i].name]
            self._hold(agent)
            self._core.note_conflict(self._pointed.number, agent, end)
        self._shown.refuse_other_agents("the function of conflicts")

    def begin_arrivals(self) -> None:
        """Begin a part of the turn in which agents are asked on arrival."""
        self._marks = {}

    def give_way_at_arrivals(self, games: IntArray, part: int) -> None:
        """Stop arrived agents that lose conflicts decided by a function, in these games."""
        self._call_each(self._give_way_at_arrivals, games, begun=self._begin_phase("arrive", part))

    def _give_way_at_arrivals(self) -> None:
        order = self._shown.ordered.order
        number = self._pointed.number
        agents = [self._shown.number_of[name] for name in order.names]
        before, after = [[places[agent] for agent in agents] for places in self._core.list_places(number)]
        for i, _ in self._turns.find_losers(order, before, after):
            self._core.hold(number, agents[i])
        self._shown.refuse_other_agents("the function of conflicts")
        self._shown.leave_with_other_map()

    def note_losers(self, games: IntArray) -> None:
        """Tell agents that conflicts have stopped them on arrival."""
        for at, agent in np.argwhere(self._core.find_losers(games)).tolist():
            game = int(games[at])
            self._note_undone(game, agent, describe_conflict(self._core.get_wanted_place(game, agent)))

    def _hold(self, agent: int) -> None:
        """Cancel the move of an agent of the game that the context is pointed at, and count it."""
        self._state.counts["blocked"][self._pointed.number, agent] += 1
        self._shown.cancel(agent)

    def call(self, named: NamedRule, games: IntArray, part: int | None = None) -> None:
        """Call a rule in each of these games, before agents of a part of the turn move; None: before or after all."""
        what = f"the rule {named.name!r} (phase {named.phase!r})"
        begun = BegunPhase.from_rule(named, self._parts.rules.now, self._parts.settings.order, part or 0)
        self._call_each(named.rule, games, self._ctx, what=what, part=part, begun=begun)

    def collect(self, games: IntArray) -> None:
        """Call the collectors in the games in which they are due."""
        turns = self._state.turn[games]
        is_due = np.zeros(len(games), np.bool_)
        for every in self._called.periods:
            is_due |= turns % every == 0
        if is_due.any():
            rules = self._parts.rules.now
            begun = BegunPhase("after", rules.rules, len(rules.of_phase["after"]), collects=False)
            self._call_each(self._collect, games[is_due], what="a collector", begun=begun)

    def _collect(self) -> None:
        row = self._shown.get_own_row()
        if row.collectors is None:
            row.collectors = Collectors()
            row.collectors.copy_from(self._parts.collectors, _return_function)
        row.collectors.collect(self._values.turn, self._ctx, lambda: self._game.agents)

    def get_collected(self, game: int) -> dict[str, dict[str, list[Any]]]:
        """Return the collected values of a game, by the names of collectors."""
        row = self._pointed.rows[game]
        return (self._parts.collectors if row is None or row.collectors is None else row.collectors).get_tables()

    def _call_each(
        self,
        function: Callable[..., object],
        games: IntArray,
        *args: object,
        what: str = "",
        part: int | None = None,
        begun: BegunPhase | None = None,
    ) -> None:
        """Call a function while the context is pointed at each of these games in turn.

        Args:
            function: the function to call.
            games: the numbers of the games.
            args: its arguments.
            what: the function in words, for errors; "": its errors name it themselves.
            part: the part of the turn in which agents are about to move; None: they are not.
            begun: the phase of the turn, if a game can leave in it and go on from there.
        """
        turns = self._turns
        self._begin()
        turns.is_playing = True
        self._shown.part = part
        self._shown.begun = begun
        self._shown.begin_counts()
        turns.is_moving = part is not None or self._core.arrival is not None
        try:
            ordered = games[self._pointed.order_by_population(games)]
            self._play(ordered, lambda shown, some, _: shown.call_each(some, function, args))
            self._refuse_shared_changes()
        except Exception as error:
            if what:
                hint = UnknownAttribute.hint_of(error)
                error.add_note(f"In {what}, in turn {self._values.turn}.{hint}")
            self._name_failure(error)
            raise
        finally:
            turns.is_playing = False
            turns.is_moving = False
            self._shown.part = None
            self._shown.begun = None
        self._state.now.clear()

    @contextmanager
    def _observe_and_decide(self, begun: BegunPhase) -> Iterator[None]:
        """Let agents observe and decide in games at which the context is pointed; see `_begin_phase`."""
        turns = self._turns
        self._begin()
        self._shown.has_ended = False
        self._shown.raised = None
        self._shown.begun = begun
        turns.is_playing = True
        turns.is_moving = True
        try:
            yield
            self._refuse_shared_changes()
        except Exception as error:
            self._name_failure(error)
            raise
        finally:
            turns.is_playing = False
            turns.is_moving = False
            turns.legality.set_time(0.0)
            self._shown.begun = None
            self._shown.forget_looks()

    def decide(self, view: ArrayView, observing: IntArray, here: BoolArray | None, part: int) -> IntArray:
        """Return the actions of agents that are asked game by game.

        Args:
            view: the agents.
            observing: the numbers of other agents, whose sensors are called.
            here: (all games, all agents) a mask of the agents that arrive now; None: all agents decide.
            part: the part of the turn.
        """
        state = self._state
        agents = view.agents
        places = self._pointed.order_by_population(view.games)
        games = view.games[places]
        are_blocked = np.any(state.blocked[games][:, agents], axis=1).tolist()
        wanted = np.array(state.streets.get_ids(view.node), np.int64)
        self.wanted = None if self._core.courses is not None else wanted.reshape(-1).data
        if here is None:
            self._find_asked = partial(self._find_living, agents.tobytes(), observing.tobytes())
        else:
            self._find_asked = partial(self._find_arriving, here, agents, observing)
        self._deeds = PlainDeeds(part, [])
        self._turns.part = part
        if self._core.courses is not None:
            self._core.courses.routes.forget()

        def ask(shown: ShownGame, some: GamesToShow, which: IntArray) -> int:
            self.asks_anew = here is not None or len(shown.cached.notices) > 0
            self.takes_all = self._called.asks_all or not shown.cached.sees_world_only or self._chooses_more_than_nodes
            blocked = [are_blocked[i] for i in which.tolist()]
            return shown.ask_agents(some, self, blocked, places[which].tolist())

        with self._observe_and_decide(self._begin_phase("decide", part)):
            self._play(games, ask)
        if self._deeds.given and not self._core.arrival:
            state.deed_log.request_deeds(self._deeds)
        if self._core.courses is not None:
            self._core.courses.routes.write()
            return np.full(view.node.shape, -1)
        return view.action_to(wanted)

    @property
    def _chooses_more_than_nodes(self) -> bool:
        """Whether agents of a game decide on more than nodes to move to."""
        state = self._state
        has_routes = state.flights is not None or self._core.courses is not None
        return has_routes or len(state.deeds.declared) > 0 or state.radio is not None

    def find_asked(self) -> AskedAgents | None:
        """Return the agents that are asked in the current game; None: there are none."""
        asked = self._find_asked()
        return asked if asked.part.observing or asked.part.commanded else None

    def _find_living(self, asked: bytes, observing: bytes) -> AskedAgents:
        """Return the agents that are asked between two turns, given the numbers of these and of others that observe."""
        return self._shown.ordered.asked_of(asked, observing, self._shown.block.alive.tobytes())

    def _find_arriving(self, here: BoolArray, agents: IntArray, observing: IntArray) -> AskedAgents:
        """Return the agents that arrive now, by a mask (games, agents), of those of these numbers."""
        arriving, looking = [one[here[self._pointed.number, one]].tobytes() for one in (agents, observing)]
        return self._shown.make_asked(self._shown.ordered.order, arriving, looking, b"")

    def note_given(self, view: ArrayView) -> None:
        """Record that agents got actions from outside."""
        names = self._state.roster.names
        for at, i in np.argwhere(view.mask).tolist():
            row = self._pointed.rows[view.games[at]]
            if row is not None:
                row.undone.pop(names[view.agents[i]], None)

    def ask(self, asked: AskedAgents) -> Decisions:
        """Return the decisions of agents of the current game that arrive, or whose sensors count their looks."""
        if self._core.arrival is not None:
            return self._decide_at_arrival(asked)
        for notice in self._shown.cached.notices:
            notice.reset()
        decisions: Decisions = self._turns.decide(asked.order, asked.part)
        return decisions

    def take_decisions(self, decisions: Decisions, asked: AskedAgents) -> None:
        """Store the decisions of agents of the current game, but for moves to nodes."""
        self._shown.keep_looks()
        if not self._shown.cached.sees_world_only:
            self._store_changes_by_sensors(asked)
        if self._state.flights is not None:
            self._choose_flights(self._state.flights, decisions, asked)
        if self._core.courses is not None:
            self._choose_routes(self._core.courses.routes, decisions, asked)
        chooses = decisions.actions or decisions.paths is not None
        if chooses or decisions.failures or decisions.written or self._shown.get_own_row().undone:
            self._take_uncommon(decisions, asked)
        if decisions.actions:
            self._take_deeds(decisions, asked)
        if self._state.radio is not None:
            self._take_messages(self._state.radio, decisions, asked)

    def _decide_at_arrival(self, asked: AskedAgents) -> Decisions:
        """Return the decisions of agents that may have decided before in the same turn."""
        number = self._pointed.number
        turns = self._turns
        slots = self._shown.ordered.order.slots
        known = self._marks.get(number, StreamPositions({}, [{} for _ in self._shown.cached.notices]))
        for notice, looks in zip(self._shown.cached.notices, known.looks, strict=True):
            notice.go_to(looks)
        for i, name in asked.members:
            slots[i].go_to(known.streams.get(name, (None, None)))
        turns.legality.set_time(self._state.time[number].item())
        turns.legality.keep_map(keeps=True)
        try:
            decisions: Decisions = turns.decide(self._shown.ordered.order, asked.part)
        finally:
            turns.legality.keep_map(keeps=False)
        streams = {name: slots[i].get_marks() for i, name in asked.members}
        self._marks[number] = StreamPositions(
            known.streams | streams, [notice.mark() for notice in self._shown.cached.notices]
        )
        return decisions

    def _store_changes_by_sensors(self, asked: AskedAgents) -> None:
        """Write the changes that custom sensors made before agents decided.

        Raises:
            BadValue: agents are left that would have looked before some of the changes; see `ShownGame.refuse`.
        """
        shown = self._shown
        have_changed = bool(
            shown.journal.log or shown.journal.progressed or shown.has_ended or shown.has_other_settings
        )
        if have_changed or shown.has_other_map:
            lives = np.frombuffer(shown.block.alive.tobytes(), np.bool_)
            decides = self._core.part_of[self._pointed.population.numbers] == self._deeds.part
            if len(asked.part.observing) < np.count_nonzero(lives & decides):
                what = "that is a sensor changes the game while other agents look in the core"
                shown.refuse(what, "set the attribute, or call the verb, in the sensor itself")
        if have_changed:
            shown.go_alone("that is a sensor changes agents, settings, rules or collectors, or ends the game")
        if self._core.arrival is not None:
            shown.leave_with_other_map()
        shown.take()

    def _choose_flights(self, flights: TurnFlights, decisions: Decisions, asked: AskedAgents) -> None:
        """Store the flights that agents of the current game have chosen."""
        for i, name in asked.members:
            action = decisions.actions.get(i)
            if action is not None and (action.position is not None or action.quat is not None):
                chosen = self._pointed.number, self._shown.number_of[name], action.position, action.quat
                flights.chosen.append(chosen)

    def _choose_routes(self, routes: Routes, decisions: Decisions, asked: AskedAgents) -> None:
        """Store the routes that agents of the current game have chosen."""
        for i, name in asked.members:
            action = decisions.actions.get(i)
            if action is not None and action.edge is not None:
                continue
            if not routes.choose(self._pointed.number, self._shown.number_of[name], decisions, i):
                self._shown.go_alone("chooses a route with an edge that it repeats")

    def _take_uncommon(self, decisions: Decisions, asked: AskedAgents) -> None:
        """Store turns of agents, and why actions failed."""
        paths = decisions.paths
        for i in range(0 if paths is None or self._core.courses is not None else len(paths.maps)):
            track = None if paths is None else paths.make_track(i)
            if track is not None and len(track.path) > 2:
                self._shown.go_alone("chooses a route over other nodes")
            if track is not None:
                self._shown.go_alone("chooses a route that comes to the node on which it begins")
        named = dict(asked.members)
        for i, action in decisions.actions.items():
            if action.edge is not None:
                self._take_named_edge(self._shown.number_of[named[i]], action.edge)
            if action.heading != ():
                self._state.turning.append((self._pointed.number, self._shown.number_of[named[i]], action.heading))
        decide = set(named.values())
        row = self._shown.get_own_row()
        undone = {name: why for name, why in row.undone.items() if name not in decide}
        for i, why in decisions.list_undone():
            undone[named[i]] = f"{undone[named[i]]}; {why}" if named[i] in undone else why
        row.undone = undone
        if decisions.written:
            decisions.merge_team_memories()
        turn = self._values.turn
        for i, kind, message in decisions.failures:
            failure = Failure(self._pointed.number, self._shown.number_of[named[i]], kind, message)
            self._state.failures.append((failure, turn))

    def _take_named_edge(self, agent: int, edge: int) -> None:
        """Let an agent of the current game take an edge."""
        self._core.edges.put((self._pointed.number, agent), np.array(edge), self._state.movement.columns)

    def _take_deeds(self, decisions: Decisions, asked: AskedAgents) -> None:
        """Store the deeds of agents of the current game."""
        number = self._pointed.number
        now = self._values.turn + 1
        for i, name in asked.members:
            action = decisions.actions.get(i)
            if action is not None and action.deeds:
                agent = self._shown.number_of[name]
                if self._core.arrival:
                    self._core.note_late_deeds(np.array([number]), np.array([agent]))
                self._deeds.add(number, agent, name, now, decisions.starts[i], action.deeds)

    def _take_messages(self, radio: MessageTraffic, decisions: Decisions, asked: AskedAgents) -> None:
        """Store the messages that agents of the current game send."""
        failed = decisions.failed
        slots = self._shown.ordered.order.slots
        number = self._pointed.number
        having = {*asked.part.observing}  # an outbox: agents whose plan is of arrays have none
        sending = [slots[i] for i, _ in asked.members if i in having and i not in failed]
        messages, unsent = read_outboxes(self._ctx, self._ctx.game, sending)
        flaws = [Failure.make_illegal(number, self._shown.number_of[slot.name], why) for slot, why in unsent]
        radio.post_checked(number, messages, flaws)

    def note_closed_edges(self, games: IntArray, agents: IntArray, edges: IntArray) -> None:
        """Tell agents that they have left closed edges."""
        columns = self._state.movement.columns
        ends = columns.node_ids[columns.sources[edges]], columns.node_ids[columns.targets[edges]]
        for game, agent, source, target in zip(*(one.tolist() for one in (games, agents, *ends)), strict=True):
            self._note_undone(game, agent, describe_closed_edge(source, target))

    def note_undone(self, failure: Failure) -> None:
        """Tell an asked agent, in its next turn, why its action failed in this one."""
        self._note_undone(failure.game, failure.agent, failure.message)

    def _note_undone(self, game: int, agent: int, why: str) -> None:
        if agent in self._called.asked:
            undone = self._pointed.get_row(game).undone
            name = self._state.roster.names[agent]
            undone[name] = f"{undone[name]}; {why}" if name in undone else why

    def tell_blocked(self, asked: AskedAgents) -> list[Any]:
        """Set the reasons why agents failed to act in their last turns; return their slots."""
        state = self._state
        told = []
        slots = self._shown.ordered.order.slots
        numbers = self._shown.number_of
        number = self._pointed.number
        undone = self._shown.get_own_row().undone
        for i, name in asked.members:
            why = [undone[name]] if name in undone else []
            if self._core.arrival is not None:
                pass  # `note_losers` has noted conflicts
            elif state.blocked[number, numbers[name]] and state.turn[number] > self._called.first.turn:
                why.append(describe_conflict(self._core.get_wanted_place(number, numbers[name])))
            if why:
                slots[i].set_blocked("; ".join(why))
                told.append(slots[i])
        return told

    def get_agents(self, game: int) -> list[tuple[Any, Any]] | None:
        """Return the agents of a game and their strategies; None: those of the start."""
        population = self._pointed.get_population(game)
        if population is None:
            return None
        strategies = [strategy for strategy, _ in population.agents.equipment]
        return [*zip(population.agents.members, strategies, strict=True)]

    def get_departed(self, game: int) -> dict[str, tuple[Any, int]]:
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
