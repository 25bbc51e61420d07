"""Actions of agents of many games: those that strategies decide in arrays, and those given from outside."""

from collections.abc import Hashable, Mapping, Sequence
from functools import partial
from operator import itemgetter
from typing import Any

import numpy as np

from gamms.game.batch.arrivals import Decided
from gamms.game.batch.channels import MOST_AT_ONCE, Outbox
from gamms.game.batch.columns import Failure, in_turns, places_of
from gamms.game.batch.deeds import ArrayDeeds
from gamms.game.batch.flights import Flights, as_flights
from gamms.game.batch.game_forms import GameForms, Group
from gamms.game.batch.given import Given
from gamms.game.batch.movement import NO_ACTION, Illegal
from gamms.game.batch.reports import DELAYS
from gamms.game.batch.state import GameArrays
from gamms.game.batch.turn import ArrayTurn
from gamms.game.batch.view import ArrayView, as_actions
from gamms.game.legality import IllegalAction
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.text import shown


class Asking:
    """What the agents of games are asked in a turn.

    Args:
        state: of all games.
        here: the forms of strategies.
        given: team -> what its agents do, in place of what their strategies decide.
        at_arrivals: whether agents are asked where they arrive, each by itself.

    Attributes:
        outboxes: what they send.
        flights: what those do that fly and were asked last; None: none flies.
        lost: of those that were asked last, which have set no action, or would fly too far to be said in numbers.
    """

    flights: Flights | None = None

    def __init__(
        self, state: GameArrays, here: GameForms, given: Mapping[Hashable, Given], *, at_arrivals: bool
    ) -> None:
        self._state, self._here, self._given, self._at_arrivals = state, here, given, at_arrivals
        self.outboxes, self._moment = list[Outbox](), 0  # how often agents were asked
        self._acts: tuple[list[ArrayDeeds], list[Outbox]] | None = None  # deeds and messages that are given
        settings = here.game.settings()
        self._raises, self._commanded = settings["on_illegal"] == "raise", settings["plans"].keys() | given.keys()
        self._asked: tuple[IntArray, BoolArray]  # some games of the turn, and which agents were asked last
        self.lost = list[Illegal]()  # of those that decide now
        self._failures: list[Failure] = []  # of those that were asked, until they are noted

    def given(self, turn: ArrayTurn, asked: BoolArray | None = None) -> tuple[IntArray, BoolArray]:
        """Return the actions that were given, (games, agents) of this turn, and to which agents, (agents,).

        Those of agents that are asked are checked; None: of all.
        """
        actions = np.full(turn.node.shape, self._state.movement.idle)
        is_given = np.zeros(len(turn.roster.names), np.bool_)
        for team, wanted in self._given.items():
            agents = turn.roster.members(team)
            view = ArrayView(self._state, turn.games, agents, asked)
            view.mask = view.mask & ~turn.roster.flies[agents]
            actions[:, agents] = view._checked(wanted.moves_in(view, wanted.moves[turn.games]), f"team {shown(team)}")
            is_given[agents] = True
        return actions, is_given

    def check(self, turn: ArrayTurn, asked: BoolArray | None) -> None:
        """Refuse what was given and cannot be done as the games are now; nothing changes."""
        self.given(turn, asked)
        self.acts(turn)

    def ask(
        self, turn: ArrayTurn, actions: IntArray, is_decided: BoolArray, asked: BoolArray
    ) -> tuple[IntArray, list[ArrayDeeds]]:
        """Ask agents, (games, agents); return their actions and deeds, those that are given among them.

        Args:
            turn: of the games.
            actions: that are given, for all agents; it is written to.
            is_decided: (agents,) which are not asked, because their actions are given or because others move.
            asked: (games, agents) which agents move.
        """
        if self._acts is None and self._given:
            self._acts = self.acts(turn)
        self._state.shared[DELAYS].note(turn.games, asked)
        acts, num_sent = self._acts, len(self.outboxes)
        flyers = self._state.flyers
        self.lost, self._asked = [], (turn.games, asked)
        self.flights = None if flyers is None else flyers.hovering(len(turn.games))
        for team, one in self._given.items() if flyers is not None else ():
            agents, ways = turn.roster.members(team), one.flights
            ways = np.zeros((*turn.node.shape[:1], len(agents), 3)) if ways is None else ways[turn.games]
            self._fly(turn, agents, ways, asked[:, agents])
        chosen, deeds = self._decided(turn, actions, is_decided, asked if self._at_arrivals else None)
        if acts is not None:
            those = np.zeros(self._state.node.shape, np.bool_)
            those[turn.games] = asked
            deeds += _deeds_of(turn, acts[0], those)
            self._send([box.those(those[box.at, box.senders]) for box in acts[1]])
        self.outboxes[num_sent:] = [box.sent_at(self._moment) for box in self.outboxes[num_sent:]]
        self._moment += 1
        return chosen, deeds

    def _fly(self, turn: ArrayTurn, agents: IntArray, ways: FloatArray, where: BoolArray) -> None:
        """Let those of some agents that fly do so, map units, (games, agents, 3), where they are asked."""
        flyers, flights = self._state.flyers, self.flights
        if flyers is None or flights is None:
            return
        lost = flyers.aim(flights, turn.games, agents, ways, where)
        self.lost += [Illegal(at, agent, f"BadValue: {why}") for at, agent, why in lost]

    def _without_skips(self, view: ArrayView, actions: IntArray) -> IntArray:
        """Return actions, those of agents that have set none so that they stay, which is noted."""
        skips = actions == NO_ACTION
        which = np.nonzero(skips)
        if not len(which[0]):
            return actions
        rows, is_legal = view.legal_rows(which)
        columns = which[0], view.agents[which[1]], view.streets.ids_of(rows), is_legal.sum(axis=-1)
        for at, agent, nodes, count in zip(*(column.tolist() for column in columns), strict=True):
            why = IllegalAction.missing(nodes[:count])
            self.lost.append(Illegal(at, agent, f"{type(why).__name__}: {why}"))
        return np.where(skips, view._movement.idle, actions)

    def at_arrivals(self, turn: ArrayTurn, asked: BoolArray) -> Decided:
        """Ask agents that arrive in a turn of some games."""
        actions, is_given = self.given(turn, asked)
        actions, deeds = self.ask(turn, actions, is_given | ~asked.any(axis=0), asked)
        does_deeds = np.zeros(asked.shape, np.bool_)
        for one in deeds:
            does_deeds[one.at, one.agents] = True
        for lost in self.lost:
            does_deeds[lost.at, lost.agent] = False
        return Decided(actions, does_deeds)

    def note(self, turn: ArrayTurn, illegal: Sequence[Illegal]) -> None:
        """Note what those did wrong who were asked last; what they send whose actions are not legal is dropped."""
        wrong, self.lost = self._wrong(turn, illegal), []
        self._raise_first([*wrong, *self._failures])
        if wrong and self.outboxes:
            is_dropped = np.zeros(self._state.node.shape, np.bool_)
            is_dropped[[one.game for one in wrong], [one.agent for one in wrong]] = True
            first = (self._moment - 1) * MOST_AT_ONCE
            self.outboxes = [box.those(~is_dropped[box.at, box.senders] | (box.order < first)) for box in self.outboxes]
        senders = {(one.game, one.agent) for one in wrong}
        failures = [one for one in self._failures if not one.is_unsent or (one.game, one.agent) not in senders]
        for one in sorted(failures + wrong, key=itemgetter(0, 1, 2)):
            self._state.note_failure(one)
        self._failures = []

    def _wrong(self, turn: ArrayTurn, illegal: Sequence[Illegal]) -> list[Failure]:
        """Return what those did wrong who were asked last, some of whose actions could not be done in a turn."""
        wrong = [(self._asked[0], one) for one in self.lost]
        wrong += [(turn.games, one) for one in illegal if turn.alive[one.at, one.agent]]
        return [Failure.illegal(int(games[one.at]), one.agent, one.message) for games, one in wrong]

    def _raise_first(self, failures: Sequence[Failure]) -> None:
        """Raise the error of what is not legal and the turn engine would find first, where it raises that."""
        state, illegal = self._state, [one for one in failures if one.kind == "illegal"] if self._raises else []
        if illegal:
            one = min(illegal, key=self._rank)
            why = one.message if one.is_unsent else one.message.partition(": ")[2]
            named = f"Agent {shown(state.roster.names[one.agent])} in turn {int(state.turn[one.game])}"
            error = IllegalAction(f"{named}: {why}")
            error.add_note(f"In game {one.game} of a batch, with the seed {state.seeds[one.game]}.")
            raise error

    def _rank(self, one: Failure) -> tuple[int, bool, int, int]:
        """Return when the turn engine finds what an agent does wrong: plans of teams decide after all others."""
        roster, first, (games, asked) = self._state.roster, -1, self._asked
        team = roster.team_of[one.agent]
        if not one.is_unsent and roster.teams[team] in self._commanded:
            first = int(np.flatnonzero(asked[np.searchsorted(games, one.game)] & (roster.team_of == team))[0])
        return one.game, one.is_unsent, first, one.agent

    def _send(self, boxes: list[Outbox]) -> None:
        """Take what agents want to send, and note what of it cannot be sent."""
        radio = self._state.radio
        if radio is None or not boxes:
            return
        found, flaws = radio.sendable(boxes, self._state.is_there)
        self.outboxes += found
        self._failures += [Failure.illegal(*flaw, is_unsent=True) for flaw in flaws]

    def acts(self, turn: ArrayTurn) -> tuple[list[ArrayDeeds], list[Outbox]]:
        """Return the deeds and messages that were given, of games by their numbers in the batch."""
        state, deeds, outboxes = self._state, list[ArrayDeeds](), list[Outbox]()
        acting = {team: one for team, one in self._given.items() if one.deeds or one.messages}
        is_played = np.zeros((len(state), 1), np.bool_)
        is_played[turn.games] = True
        for team, one in acting.items():
            view = ArrayView(state, np.arange(len(state)), turn.roster.members(team))
            view.mask, view._deeds, view._outboxes = view.mask & is_played, [], []
            one.act(view)
            deeds += view._deeds
            outboxes += view._outboxes
        return deeds, outboxes

    def _decided(
        self, turn: ArrayTurn, given: IntArray, is_decided: BoolArray, asked: BoolArray | None
    ) -> tuple[IntArray, list[ArrayDeeds]]:
        """Ask the strategies of agents whose actions are not given; return all actions, and their deeds.

        Args:
            turn: of the games.
            given: actions, (games, agents), which is written to.
            is_decided: (agents,) which are not asked.
            asked: (games, agents) which agents arrive now, where agents decide at arrivals; else None.
        """
        actions, deeds = given, list[ArrayDeeds]()
        for group in self._here.groups:
            agents = group.agents[~is_decided[group.agents]]
            if len(agents):
                view = ArrayView(self._state, turn.games, agents, asked)
                try:
                    columns = agents if len(agents) < actions.shape[1] else np.s_[:]
                    chosen = self._here.decide(group, view, partial(_decided_by, group))
                    if group.flies:
                        self._fly(turn, agents, chosen, view.mask)
                    else:
                        actions[:, columns] = self._without_skips(view, chosen) if group.may_skip else chosen
                    deeds += view._deeds or []
                    self._send(view._outboxes or [])
                    if asked is not None:
                        self._state.drawn[np.ix_(turn.games, agents)] = view.draw.count
                except Exception as error:
                    error.add_note(f"In the strategy {group.name} of a batch, {in_turns(view.turn, view.games)}.")
                    raise
        if asked is not None:
            self._state.looks[turn.games] += asked
        return actions, [one for one in deeds if len(one.at)]


def _decided_by(group: Group, view: ArrayView) -> np.ndarray[Any, Any]:
    """Return the actions that a strategy gives in a view, or `NO_ACTION`; of agents that fly how far these do."""
    view._lock()
    given = group.form(view)
    if group.flies:
        return as_flights(given, f"{group.name}: what agents that fly do", view.node.shape)
    if not group.may_skip:
        return view._checked(given, group.name, may_aim=True)
    actions = as_actions(given, view.node.shape, group.name)
    skips = actions == NO_ACTION
    checked = view._checked(np.where(skips, view._movement.idle, actions), group.name, may_aim=True)
    return np.where(skips & view.mask, NO_ACTION, checked)


def _deeds_of(turn: ArrayTurn, deeds: Sequence[ArrayDeeds], those: BoolArray) -> list[ArrayDeeds]:
    """Return the deeds of some agents, (games of the batch, agents), as they are done in a turn."""
    number, found = places_of(turn.games, len(those)), []
    for one in deeds:
        done = one.those(those[one.at, one.agents])
        at = number[done.at]
        found.append(done._replace(at=at, nodes=turn.node[at, done.agents]))
    return [one for one in found if len(one.at)]
