"""Turns in which agents decide at each arrival, in many games at once; see `game.arrivals`.

A round plays the next arrival of each game: games are at times of their own, and in each of them few agents arrive.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from gamms.game.arrivals import MOST_ARRIVALS, NO_DEEDS, WAITS
from gamms.game.batch.columns import Failure, some_rows
from gamms.game.batch.movement import Illegal, Legs, Moves, motion_along
from gamms.game.batch.state import GameArrays
from gamms.game.batch.travel import ByMetres, Trip
from gamms.game.batch.turn import ArrayTurn
from gamms.game.travel import LEAST, MOST
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray


class Decided(NamedTuple):
    """What agents do next, (games, agents): their actions, and which of them do deeds besides."""

    actions: IntArray
    does_deeds: BoolArray


Ask = Callable[[ArrayTurn, BoolArray], Decided]
"""Asks some agents, (games, agents), of the games of a turn."""
Note = Callable[[Sequence[Illegal]], None]
"""Notes what agents did wrong that have decided, and which of their actions could not be done."""
Resolve = Callable[[ArrayTurn, IntArray], BoolArray]
"""Returns which agents of the games of a turn, (games, agents), conflicts stop on the way to places."""


class Arrivals:
    """The course of a turn of some games, from one arrival to the next.

    Args:
        state: of all games; while agents are asked, it says where all are then.
        turn: of the games.
        by: how the agents go.
        members: (games, agents) which agents move.
        resolve: finds conflicts; None: there are none.

    Attributes:
        blocked: (games, agents) which agents conflicts have stopped.
        illegal: the actions when the turn began that could not be done.
    """

    illegal: Sequence[Illegal] = ()

    def __init__(
        self, state: GameArrays, turn: ArrayTurn, by: ByMetres, members: BoolArray, resolve: Resolve | None
    ) -> None:
        self._state, self._turn, self._by, self._members, self._resolve = state, turn, by, members, resolve
        self._trip = Trip(by, turn.node, turn.games)
        self._begun = begun = by.edge[turn.games], by.share[turn.games], by.motion[turn.games]
        edge, share, self._motion = begun[0].flatten(), begun[1].flatten(), begun[2].flatten()
        self._node = turn.node.flatten()  # that each has passed last
        none = np.full(len(edge), -1)
        self._leg = Legs(edge, none, share, share.copy(), np.zeros(len(edge)), np.ones(len(edge)))  # that each is on
        self._arrives = np.zeros(len(edge), np.bool_)  # at the end of it
        self._places = np.where(edge >= 0, len(by.streets.counts) + edge, self._node)  # as conflicts compare them
        self._times = np.zeros(len(edge), np.int64)  # how often each has arrived
        self.blocked = np.zeros(members.shape, np.bool_)

    def play(self, actions: IntArray, ask: Ask, note: Note) -> Moves:
        """Let agents do what they have decided when the turn began, and ask them wherever they arrive.

        `note` is called with the actions that could not be done, whenever agents have decided.
        """
        games, by, state = self._turn.games, self._by, self._state
        try:
            state.now.clear()
            self._begin(actions.ravel(), note)
            while self._pass_time(ask, note):
                pass
        finally:
            by.edge[games], by.share[games], by.motion[games] = self._begun
            state.node[games], by.now[games] = self._turn.node, 0.0
            state.drawn[games] = state.looks[games] = 0
            state.now.clear()
        return self._trip.moves()

    def _begin(self, actions: IntArray, note: Note) -> None:
        trip, rows = self._trip, np.flatnonzero(self._members)
        is_going = self._by.is_going(self._turn.games).ravel()[rows]
        trip.decide(rows[~is_going], actions[rows[~is_going]])
        trip.go_on(rows[is_going], self._motion[rows[is_going]])
        note(trip.illegal)
        self.illegal = [*trip.illegal]
        self._depart(np.ones(len(self._turn.games), np.bool_), rows)

    def _pass_time(self, ask: Ask, note: Note) -> bool:
        """Play the next arrival of each game; return whether there was one."""
        until = np.where(self._arrives, self._leg.until, np.inf).reshape(self._members.shape)
        now: FloatArray = until.min(axis=1, initial=np.inf)
        games: BoolArray = now < np.inf
        if not games.any():
            return False
        is_here = (until == now[:, None]) & games[:, None]
        here, decides = np.flatnonzero(is_here), is_here & (now < 1.0)[:, None]
        before, leg = self._node[here], some_rows(self._leg, here)
        node = self._trip.columns.node
        self._node[here], self._leg.edge[here], self._arrives[here] = node[here], -1, False
        self._times[here] += 1
        self._trip.goes[here] = False
        does_deeds = self._decide(now, decides, ask, note) if decides.any() else np.zeros(until.size, np.bool_)
        is_lost = self._depart(games, here)
        lost = here[is_lost]
        if len(lost):
            self._node[lost] = self._trip.columns.node[lost] = before[is_lost]
            self._trip.stop_short(lost, some_rows(leg, is_lost))
            self._read_legs(lost)
        is_flawed = ~is_lost & (does_deeds[here] | (self._times[here] >= MOST_ARRIVALS))
        for row in here[is_flawed].tolist():
            waits = self._times[row] >= MOST_ARRIVALS
            game, agent = divmod(row, until.shape[1])
            flaw = Failure.illegal(int(self._turn.games[game]), agent, WAITS if waits else NO_DEEDS)
            self._state.note_failure(flaw)
        return True

    def _decide(self, now: FloatArray, decides: BoolArray, ask: Ask, note: Note) -> BoolArray:
        """Ask agents that arrive now, (games,); return which of them do deeds, if what they decide is legal."""
        which: BoolArray = np.logical_or.reduce(decides, axis=1)
        rows = np.flatnonzero(decides)
        decided = ask(self._stand(which, now), decides[which])
        actions, does_deeds = np.zeros(decides.shape, np.int64), np.zeros(decides.shape, np.bool_)
        actions[which], does_deeds[which] = decided
        self._trip.illegal.clear()
        self._trip.decide(rows, actions.ravel()[rows])
        note(self._trip.illegal)
        for one in self._trip.illegal:
            does_deeds[one.at, one.agent] = False
        return does_deeds.ravel()

    def _stand(self, which: BoolArray, now: FloatArray) -> ArrayTurn:
        """Let all agents of some games, (games,), be where they are at a time; return the turn of these games."""
        state, by, part, leg = self._state, self._by, self._turn._of(which), self._leg
        games, shape = part.games, self._members.shape
        time = np.broadcast_to(now[:, None], shape).ravel()
        with np.errstate(divide="ignore", invalid="ignore"):
            gone = leg.begin + (leg.end - leg.begin) * (time - leg.since) / (leg.until - leg.since)
        gone = np.where(leg.begin == leg.end, gone, np.clip(gone, LEAST, MOST))
        share = np.where((time < leg.until) & (leg.until > leg.since), gone, leg.end)
        on = leg.edge >= 0  # who has arrived is on no leg
        columns = np.where(on, leg.edge, -1), np.where(on, share, 0.0), self._motion, self._node
        for column, values in zip((by.edge, by.share, by.motion, state.node), columns, strict=True):
            column[games] = values.reshape(shape)[which]
        by.now[games], part.node = now[which], state.node[games]
        state.now.clear()
        return part

    def _depart(self, games: BoolArray, rows: IntArray) -> BoolArray:
        """Let agents of some games, (games,), go on, or stay; return which of them conflicts stop."""
        trip = self._trip
        going = rows[trip.goes[rows]]
        nodes = trip.first_nodes(going)
        edges = trip.first_edges(going, nodes)
        sets_off = edges >= 0
        going, nodes, edges = going[sets_off], nodes[sets_off], edges[sets_off]
        is_lost = self._lost(games, rows, going, edges)
        on = ~np.isin(going, rows[is_lost]) & (self._times[going] < MOST_ARRIVALS)
        going = going[on]
        trip.travel(going, nodes[on])
        self._read_legs(going)
        arrives = trip.columns.edge[going] < 0
        if self._resolve is None:  # who arrives as the turn ends does not decide
            arrives &= self._leg.until[going] < 1.0
        self._arrives[going] = arrives
        return is_lost

    def _lost(self, games: BoolArray, rows: IntArray, going: IntArray, edges: IntArray) -> BoolArray:
        """Return which agents conflicts stop, of which some are going along edges."""
        if self._resolve is None:
            return np.zeros(len(rows), np.bool_)
        before, shape = self._places, self._members.shape
        after, on_node = before.copy(), rows[self._leg.edge[rows] < 0]
        after[on_node] = self._node[on_node]
        after[going] = len(self._by.streets.counts) + edges
        stops, part = np.zeros(shape, np.bool_), self._turn._of(games)
        part._origins = before.reshape(shape)[games]
        stops[games] = self._resolve(part, after.reshape(shape)[games])
        self.blocked |= stops
        self._places = np.where(stops.ravel(), before, after)
        return stops.ravel()[rows]

    def _read_legs(self, rows: IntArray) -> None:
        """Take the legs that agents are on now."""
        legs = self._trip.last_legs(rows)
        for column, values in zip((self._leg.edge, *self._leg[2:]), legs, strict=True):
            column[rows] = values
        self._motion[rows] = motion_along(legs[2] - legs[1])
