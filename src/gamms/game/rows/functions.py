"""Calls plain functions in the games of a batch, each in the context of its game."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, Protocol

import numpy as np

from gamms.core.flight import TurnFlights
from gamms.errors import UnknownAttribute
from gamms.game.array_functions.view import ArrayView
from gamms.game.block.columns import PlayedGame
from gamms.game.decisions import Decisions
from gamms.game.messages import MessageTraffic, read_outboxes
from gamms.game.movement.courses import Routes
from gamms.game.rows.contexts import RowContexts
from gamms.game.rows.row import AskedPart, RowMeans, RowOfGame
from gamms.game.settings import NamedRule, Plan
from gamms.game.turn import CLOSED, describe_closed_edge
from gamms.ir.columns import Failure
from gamms.ir.deeds import PlainDeeds
from gamms.ir.game_state import describe_conflict
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray

CalledRule = tuple[NamedRule, int | None]
"""The rule that is called, and the part of the turn in which agents are about to move; None: they are not."""


class RowDriver(Protocol):
    """Plays the games of a batch, and lets those go on whose functions change what they share."""

    def go_on(self, row: RowOfGame, called: CalledRule | None) -> None:
        """Let a game go on by another plan, or in columns of its own if `row.why` says so.

        Args:
            row: the game.
            called: the rule that has changed it; None: a collector has.
        """


class RowFunctions:
    """Calls plain functions in the games on one map of a batch, each in the context of its game.

    Args:
        contexts: the games.
        means: what those share that follow a plan.
        driver: plays all games.

    Attributes:
        wanted: (games * agents,) the ids of nodes to which asked agents move; None: they go along routes.
        asks_anew: whether agents are asked on arrival; see `ask`.
        takes_all: whether all decisions of agents are taken, not only uncommon ones; see `take_decisions`.
        blocked: the games in which conflicts have stopped agents in their last turns.
        asking: the game whose strategies are called; None: none are.
    """

    wanted: memoryview | None
    asks_anew: bool
    takes_all: bool

    def __init__(self, contexts: RowContexts, means: RowMeans, driver: RowDriver) -> None:
        self._contexts = contexts
        self._state = means.state
        means.state.tell = self.note_undone
        self._core = means.core
        self._plan = means.plan
        self._driver = driver
        self._called: CalledRule | None = None
        self._first_turn = contexts.game.turn
        self._call = contexts.call
        self._deeds = PlainDeeds(0, [])  # that agents want to do now
        self._find_asked: Callable[[RowOfGame], AskedPart]
        self.blocked = set[int]()
        self.asking: RowOfGame | None = None

    @property
    def functions(self) -> Sequence[Callable[..., object]]:
        """The plain functions that are called."""
        return self._plan.functions

    # -- the games ----------------------------------------------------------------------------------------------

    def _play(self, games: IntArray, play: Callable[[RowOfGame, int], int]) -> None:
        """Call functions in some games.

        Args:
            games: the numbers of the games.
            play: calls functions in a game, given its index; returns whether it needs columns of its own (0: no).
        """
        state = self._state
        known = [(name, facts_of(state, games)) for name, facts_of in self._plan.facts_in_core]
        for place, number in enumerate(games.tolist()):
            row = self._contexts.get(number)
            row.show_facts(known, place)
            try:
                if play(row, place):
                    self._move_out(row)
                row.raise_refusal()  # which the function may have caught
            except Exception as error:
                row.refusal = None
                error.add_note(f"In game {state.first_game + number} of a batch, with the seed {state.seeds[number]}.")
                raise
            finally:
                if row.has_other_plan:
                    self._driver.go_on(row, self._called)

    def _move_out(self, row: RowOfGame) -> None:
        """Let a game go on in columns of its own; raise what the function has raised after which it does."""
        raised = row.raised
        try:
            self._driver.go_on(row, self._called)
        finally:
            row.put_back()
        if raised is not None:
            raise raised

    def fork(self, number: int) -> PlayedGame:
        """Return a game, which is between two turns, as it is now in a context of its own."""
        row = self._contexts.get(number)
        row.raised = None
        row.show()
        try:
            game, _ = row.make_fork()
        finally:
            row.put_back()
        return game

    def check(self, games: IntArray, part: int) -> None:
        """Call the rules that may refuse moves and deeds of a part of the turn, in each of these games."""
        self._play_phase(_calling(self._check), games, "", part=part)

    def _check(self, row: RowOfGame) -> None:
        number = row.number
        moves = row.read_field("moves")
        log = self._state.deed_log
        part_of = self._core.part_of
        numbers = row.number_of
        members = [i for i, name in enumerate(moves.order.names) if part_of[numbers[name]] == row.part]
        for i, kind, why in row.turns.list_refused(moves, members, row.game.internals.parts.rules):
            agent = numbers[moves.slots[i].name]
            self._note_undone(number, agent, why)
            if kind is None:
                self._hold(row, agent)
            else:
                self._state.note_failure(Failure.make_illegal(number, agent, why))
                log.refuse(number, agent, kind)

    def cut_off(self, games: IntArray, part: int) -> None:
        """Keep agents in place whose path was closed in these games."""
        self._play_phase(_calling(self._cut_off), games, "", part=part, have_joined=True)

    def _cut_off(self, row: RowOfGame) -> None:
        moves = row.read_field("moves")
        for i in row.turns.cut_off(moves):
            agent = row.number_of[moves.slots[i].name]
            self._hold(row, agent)
            self._note_undone(row.number, agent, CLOSED)

    def give_way(self, games: IntArray, part: int) -> None:
        """Keep agents in place that lose conflicts decided by a function, in these games."""
        self._play_phase(_calling(self._give_way), games, "", part=part, have_joined=True)

    def _give_way(self, row: RowOfGame) -> None:
        moves = row.read_field("moves")
        for i, end in zip(*row.turns.stop_losers(moves), strict=True):
            agent = row.number_of[moves.slots[i].name]
            self._hold(row, agent)
            self._core.note_conflict(row.number, agent, end)

    def give_way_at_arrivals(self, games: IntArray) -> None:
        """Stop arrived agents that lose conflicts decided by a function, in these games."""
        self._play_phase(_calling(self._give_way_at_arrivals), games, "")

    def _give_way_at_arrivals(self, row: RowOfGame) -> None:
        order = row.order
        number = row.number
        agents = [row.number_of[name] for name in order.names]
        before, after = [[places[agent] for agent in agents] for places in self._core.list_places(number)]
        for i, _ in row.turns.find_losers(order, before, after):
            self._core.hold(number, agents[i])

    def note_losers(self, games: IntArray) -> None:
        """Tell agents that conflicts have stopped them on arrival."""
        for at, agent in np.argwhere(self._core.find_losers(games)).tolist():
            game = int(games[at])
            self._note_undone(game, agent, describe_conflict(self._core.get_wanted_place(game, agent)))

    def _hold(self, row: RowOfGame, agent: int) -> None:
        """Cancel the move of an agent of a game, and count it."""
        self._state.counts["blocked"][row.number, agent] += 1
        row.cancel(agent)

    def call(
        self,
        named: NamedRule,
        games: IntArray,
        part: int | None = None,
    ) -> None:
        """Call a rule in each of these games.

        Args:
            named: the rule.
            games: the games.
            part: the part of the turn in which agents are about to move; None: they are not.
        """
        name = named.name

        def play(row: RowOfGame, _: int) -> bool:
            return row.call(row.terms.functions.get(name, named.rule), (row.ctx,))

        self._called = named, part
        try:
            self._play_phase(play, games, f"the rule {name!r} (phase {named.phase!r})", part, may_change=True)
        finally:
            self._called = None

    def collect(self, games: IntArray) -> None:
        """Call the collectors in the games in which they are due."""
        turns = self._state.turn[games]
        is_due = np.zeros(len(games), np.bool_)
        for every in self._plan.periods:
            is_due |= turns % every == 0
        if is_due.any():
            self._play_phase(_calling(_collect), games[is_due], "a collector", may_change=True)

    def get_collected(self, game: int) -> dict[str, dict[str, list[Any]]]:
        """Return the collected values of a game, by the names of collectors."""
        row = self._contexts.rows.get(game)
        of_game = self._contexts.game if row is None else row.game
        return of_game.internals.parts.collectors.get_tables()

    def _play_phase(
        self,
        play: Callable[[RowOfGame, int], int],
        games: IntArray,
        what: str,
        part: int | None = None,
        *,
        may_change: bool = False,
        have_joined: bool = False,
    ) -> None:
        """Call functions in each of these games.

        Args:
            play: see `_play`.
            games: the numbers of the games.
            what: the functions in words, for errors; "": their errors name them themselves.
            part: the part of the turn in which agents are about to move; None: they are not.
            may_change: whether the functions may change what belongs to the plan.
            have_joined: whether agents that were created in this part of the turn have joined it.
        """
        is_moving = part is not None or self._core.arrival is not None
        self._call.begin(part, is_moving=is_moving, may_change=may_change, have_joined=have_joined)
        try:
            self._play(games, play)
        except Exception as error:
            if what:
                hint = UnknownAttribute.hint_of(error)
                error.add_note(f"In {what}, in turn {self._state.turn[games[0]]}.{hint}")
            raise
        finally:
            self._call.end()
        self._state.now.clear()

    def decide(
        self, view: ArrayView, observing: IntArray, given: IntArray, here: BoolArray | None, part: int
    ) -> IntArray:
        """Return the actions of agents that are asked game by game.

        Args:
            view: the agents.
            observing: the numbers of other agents, whose sensors are called.
            given: the numbers of agents with actions from outside that get their states, too.
            here: (all games, all agents) a mask of the agents that arrive now; None: all agents decide.
            part: the part of the turn.
        """
        state = self._state
        agents = view.agents
        games = view.games
        self.blocked = {*games[np.any(state.blocked[games][:, agents], axis=1)].tolist()}
        wanted = np.array(state.streets.get_ids(view.node), np.int64)
        self.wanted = None if self._core.courses is not None else wanted.reshape(-1).data
        if here is None:
            asked = agents.tobytes(), observing.tobytes(), given.tobytes()
            self._find_asked = lambda row: row.find_asked(*asked)
        else:
            self._find_asked = partial(self._find_arriving, here, agents, observing, given)
        self._deeds = PlainDeeds(part, [])
        if self._core.courses is not None:
            self._core.courses.routes.forget()
        self.asks_anew = here is not None
        self.takes_all = self._plan.asks_all or self._chooses_more_than_nodes
        self._call.part = part
        width = len(agents)
        self._call.begin(None, is_moving=True)
        try:
            self._play(games, lambda row, place: row.ask(self, place * width))
        finally:
            self._call.end()
            self._call.part = 0
            self.asking = None
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

    def drive_on(self, games: IntArray) -> None:
        """Note the edges that agents that obey turns by metres have driven in these games, after their moves."""
        for number in games.tolist() if self._plan.drives.any() else ():
            row = self._contexts.rows.get(number)
            if row is not None:
                row.drive_on()

    def lead(self, view: ArrayView, actions: IntArray) -> IntArray:
        """Let agents that obey turns by metres go to legal nodes; return their actions: they follow routes.

        Args:
            view: the agents.
            actions: (games, agents) the numbers of the nodes.
        """
        legal = np.take_along_axis(view["legal"], actions[..., None], axis=-1)[..., 0]
        asked = view.agents.tobytes()

        def go(row: RowOfGame, place: int) -> None:
            part = row.find_asked(asked, b"", b"")
            targets = dict(zip(view.agents.tolist(), legal[place].tolist(), strict=True))
            row.turns.travel.prepare(len(part.order.block))
            decisions: Decisions = row.turns.answers
            decisions.begin(part.order.slots, part.order.get_nodes(), None, None)
            for i, name in part.members:
                decisions.take(i, {"action": targets[row.number_of[name]]})
            self.take_decisions(row, decisions, part)

        self._call.begin(None, is_moving=True)
        try:
            self._play(view.games, lambda row, place: row.call(go, (row, place)))
        finally:
            self._call.end()
        assert self._core.courses is not None  # noqa: S101 - the games are by metres
        self._core.courses.routes.write()
        return np.full_like(actions, -1)

    def find_asked(self, row: RowOfGame) -> AskedPart | None:
        """Return the agents that are asked in a game; None: there are none."""
        asked = self._find_asked(row)
        return asked if asked.part.observing or asked.part.commanded else None

    def _find_arriving(
        self, here: BoolArray, agents: IntArray, observing: IntArray, given: IntArray, row: RowOfGame
    ) -> AskedPart:
        """Return the agents that arrive now, by a mask (games, agents), of those of these numbers."""
        return row.find_asked(*(one[here[row.number, one]].tobytes() for one in (agents, observing, given)))

    def note_given(self, view: ArrayView) -> None:
        """Record that agents got actions from outside."""
        names = self._state.roster.names
        for at, i in np.argwhere(view.mask).tolist():
            number = int(view.games[at])
            if number in self._contexts.rows:
                self._contexts.get(number).undone.pop(names[view.agents[i]], None)

    def ask(self, row: RowOfGame, asked: AskedPart) -> Decisions:
        """Return the decisions of agents of a game that arrive; they may have decided before in the same turn."""
        legality = row.turns.legality
        legality.set_time(self._state.time[row.number].item())
        legality.keep_map(keeps=True)
        try:
            decisions: Decisions = row.turns.decide(asked.order, asked.part)
        finally:
            legality.keep_map(keeps=False)
            legality.set_time(0.0)
        return decisions

    def take_decisions(self, row: RowOfGame, decisions: Decisions, asked: AskedPart) -> None:
        """Store the decisions of agents of a game, but for moves to nodes."""
        if self._state.flights is not None:
            self._choose_flights(row, self._state.flights, decisions, asked)
        if self._core.courses is not None:
            self._choose_routes(row, self._core.courses.routes, decisions, asked)
        chooses = decisions.actions or decisions.paths is not None
        if chooses or decisions.failures or decisions.written or row.undone:
            self._take_uncommon(row, decisions, asked)
        if decisions.actions:
            self._take_deeds(row, decisions, asked)
        if self._state.radio is not None:
            self._take_messages(row, self._state.radio, decisions, asked)

    def _choose_flights(self, row: RowOfGame, flights: TurnFlights, decisions: Decisions, asked: AskedPart) -> None:
        """Store the flights that agents of a game have chosen."""
        for i, name in asked.members:
            action = decisions.actions.get(i)
            if action is not None and (action.position is not None or action.quat is not None):
                chosen = row.number, row.number_of[name], action.position, action.quat
                flights.chosen.append(chosen)

    def _choose_routes(self, row: RowOfGame, routes: Routes, decisions: Decisions, asked: AskedPart) -> None:
        """Store the routes that agents of a game have chosen."""
        for i, name in asked.members:
            action = decisions.actions.get(i)
            if action is not None and action.edge is not None:
                continue
            if not routes.choose(row.number, row.number_of[name], decisions, i):
                row.refuse_route(name, "that repeats an edge")

    def _take_uncommon(self, row: RowOfGame, decisions: Decisions, asked: AskedPart) -> None:
        """Store turns of agents, and why actions failed."""
        paths = decisions.paths
        for i in range(0 if paths is None or self._core.courses is not None else len(paths.maps)):
            if paths is not None and paths.maps[i] is not None:
                row.refuse_route(row.order.names[i], "over several nodes, or back to its own")
        named = dict(asked.members)
        for i, action in decisions.actions.items():
            if action.edge is not None:
                self._take_named_edge(row, row.number_of[named[i]], action.edge)
            if action.heading != ():
                self._state.turning.append((row.number, row.number_of[named[i]], action.heading))
        decide = set(named.values())
        undone = {name: why for name, why in row.undone.items() if name not in decide}
        for i, why in decisions.list_undone():
            undone[named[i]] = f"{undone[named[i]]}; {why}" if named[i] in undone else why
        row.undone = undone
        if decisions.written:
            decisions.merge_team_memories()
        turn = row.values.turn
        for i, kind, message in decisions.failures:
            failure = Failure(row.number, row.number_of[named[i]], kind, message)
            self._state.failures.append((failure, turn))

    def _take_named_edge(self, row: RowOfGame, agent: int, edge: int) -> None:
        """Let an agent of a game take an edge."""
        self._core.edges.put((row.number, agent), np.array(edge), self._state.movement.columns)

    def _take_deeds(self, row: RowOfGame, decisions: Decisions, asked: AskedPart) -> None:
        """Store the deeds of agents of a game."""
        number = row.number
        now = row.values.turn + 1
        for i, name in asked.members:
            action = decisions.actions.get(i)
            if action is not None and action.deeds:
                agent = row.number_of[name]
                if self._core.arrival:
                    self._core.note_late_deeds(np.array([number]), np.array([agent]))
                self._deeds.add(number, agent, name, now, decisions.starts[i], action.deeds)

    def _take_messages(self, row: RowOfGame, radio: MessageTraffic, decisions: Decisions, asked: AskedPart) -> None:
        """Store the messages that agents of a game send."""
        failed = decisions.failed
        slots = row.order.slots
        number = row.number
        having = {*asked.part.observing}  # an outbox: agents whose plan is of arrays have none
        sending = [slots[i] for i, _ in asked.members if i in having and i not in failed]
        messages, unsent = read_outboxes(row.ctx, row.ctx.game, sending)
        flaws = [Failure.make_illegal(number, row.number_of[slot.name], why) for slot, why in unsent]
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
        known = self._contexts.rows.get(game)
        plan = self._plan if known is None else known.terms.means.plan
        if plan.is_asked[agent]:
            undone = self._contexts.get(game).undone
            name = self._state.roster.names[agent]
            undone[name] = f"{undone[name]}; {why}" if name in undone else why

    def tell_blocked(self, row: RowOfGame, asked: AskedPart) -> list[Any]:
        """Set the reasons why agents failed to act in their last turns; return their slots."""
        state = self._state
        told = []
        slots = row.order.slots
        numbers = row.number_of
        number = row.number
        undone = row.undone
        for i, name in (*asked.members, *asked.given):
            why = [undone[name]] if name in undone else []
            if self._core.arrival is not None:
                pass  # `note_losers` has noted conflicts
            elif state.blocked[number, numbers[name]] and state.turn[number] > self._first_turn:
                conflict = describe_conflict(self._core.get_wanted_place(number, numbers[name]))
                why += [] if conflict in "; ".join(why) else [conflict]
            if why:
                slots[i].template["blocked"] = "; ".join(why)
                told.append(slots[i])
        return told

    def get_agents(self, game: int) -> list[tuple[Any, Any]] | None:
        """Return the agents of a game and their strategies; None: those of the start."""
        row = self._contexts.find(game)
        if row is None:
            return None
        agents = row.members.agents
        return [(agent, strategy) for agent, (strategy, _) in zip(agents.members, agents.equipment, strict=True)]

    def get_plans(self, game: int) -> Mapping[Any, Plan]:
        """Return the plans of teams in a game."""
        row = self._contexts.find(game)
        of_game = self._contexts.game if row is None else row.game
        plans: Mapping[Any, Plan] = of_game.settings()["plans"]
        return plans

    def get_departed(self, game: int) -> dict[str, tuple[Any, int]]:
        """Return the agents that were deleted in a game, with their teams and nodes."""
        row = self._contexts.rows.get(game)
        of_game = self._contexts.game if row is None else row.game
        departed: dict[str, tuple[Any, int]] = of_game.internals.state.departed
        return departed

    def checkpoint(self) -> Callable[[], None]:
        """Return a function that undoes later changes, but for memories, data, facts and attributes of agents."""
        undo = self._state.checkpoint(self._core.moves)
        undo_rows = self._contexts.checkpoint()

        def take_back() -> None:
            undo()
            undo_rows()

        return take_back


def _calling(function: Callable[[RowOfGame], object]) -> Callable[[RowOfGame, int], int]:
    """Return what calls a function in a game; see `RowFunctions._play`."""
    return lambda row, _: row.call(function, (row,))


def _collect(row: RowOfGame) -> None:
    """Call the collectors that are due in a game."""
    row.game.internals.parts.collectors.collect(row.values.turn, row.ctx, lambda: row.game.agents)
