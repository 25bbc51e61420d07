"""Conflicts of moves in many games at once: the same as `Conflicts.resolve`, which says what they are."""

from collections.abc import Callable, Hashable, Sequence
from sys import maxsize
from typing import Any, Protocol, TypeVar

import numpy as np

from gamms.game.streets import Streets
from gamms.ir.graph import GraphColumns, IntArray, RowArray
from gamms.ir.obstacles import BoolArray
from gamms.kernels.draws import BitArray

T = TypeVar("T")

UNLIMITED = maxsize  # no graph has so many agents

_PLACES_PER_MOVE = 32  # so many are numbered by a table of all; more, by sorting those that agents are on or go to
_PLACES_AS_THEY_ARE = 4  # so many per move are not numbered at all
_FEW_INVOLVED = 8  # one agent in so many: it pays to leave out the others


class Movers(Protocol):
    """The agents whose moves are compared, in the order of their names."""

    @property
    def names(self) -> Sequence[str]:
        """Names of the agents."""

    @property
    def teams(self) -> Sequence[Hashable]:
        """The teams that agents play for."""

    @property
    def team_of(self) -> IntArray:
        """The number of the team of each, (agents,)."""

    @property
    def keys(self) -> BitArray:
        """The hashes of the names, (agents,)."""


class MovesTurn(Protocol):
    """What is asked of a turn: `MovesOfGames`, or `MovesOfOneGame`. Arrays have the axes (games, agents)."""

    @property
    def roster(self) -> Movers:
        """The agents."""

    @property
    def streets(self) -> Streets:
        """The graph."""

    @property
    def columns(self) -> GraphColumns:
        """The graph with all edges that places may be."""

    @property
    def node(self) -> IntArray:
        """Rows of the nodes on which moves begin."""

    @property
    def places(self) -> IntArray | None:
        """The same in games by metres: nodes and behind them edges; None: on nodes."""

    @property
    def alive(self) -> BoolArray:
        """Which agents count."""

    def draw_bits(self, at: IntArray, names: BitArray, *purpose: str | int) -> BitArray:
        """Return random bits of this turn for games and names."""

    def shared(self, key: Hashable, make: Callable[[], T]) -> T:
        """Return what is the same in all turns on this graph."""


ArrayResolver = Callable[[MovesTurn, IntArray, IntArray], Any]
"""Returns ranks of agents in contests, given the games of the turn and their numbers: those with the smallest win, of
equals the first by name; None: no agent wins."""


class MovesInArrays:
    """The moves of a turn of many games, and which agents have to stay.

    Attributes:
        turn: of the games.
        rank: the resolver.
        starts, ends: (games, agents) places: nodes, in games by metres edges behind them, or those of each team apart.
        stays: (games, agents), which the methods find out.
    """

    def __init__(self, turn: MovesTurn, ends: IntArray, rank: ArrayResolver, *, per_team: bool) -> None:
        edges = 0 if turn.places is None else len(turn.columns.edge_ids)
        self.turn, self.rank, self._nodes = turn, rank, turn.streets.num_nodes + edges
        self._per_team = per_team
        self.starts, self.ends = turn.node if turn.places is None else turn.places, ends
        if per_team:
            of_team = turn.roster.team_of * self._nodes
            self.starts, self.ends = self.starts + of_team, ends + of_team
        self.stays = np.zeros(ends.shape, np.bool_)

    def stop_swaps(self) -> None:
        """Let agents stay so that no two exchange nodes."""
        games = self._games_with_swaps()
        if not len(games):
            return
        rows, agents = np.nonzero((self.turn.alive & (self.starts != self.ends) & self._are_nodes())[games])
        at = games[rows]
        start, end = self.starts[at, agents], self.ends[at, agents]
        ways = np.column_stack((at, np.minimum(start, end), np.maximum(start, end)))
        way, ahead = np.unique(ways, axis=0, return_inverse=True)[1].ravel(), start < end
        is_contested = (np.bincount(way, ahead) > 0) & (np.bincount(way, ~ahead) > 0)
        those = np.flatnonzero(is_contested[way])
        at, agents, way, ahead = at[those], agents[those], way[those], ahead[those]
        ranked = self._ranked(at, agents, way)
        is_lost = np.ones(len(those), np.bool_)
        if ranked is not None:
            first = ranked[np.unique(way[ranked], return_index=True)[1]]
            goes_ahead = np.zeros(len(is_contested), np.bool_)
            goes_ahead[way[first]] = ahead[first]
            is_lost = ahead != goes_ahead[way]
        self.stays[at[is_lost], agents[is_lost]] = True

    def _are_nodes(self) -> BoolArray:
        """Return which agents begin and end on nodes, rather than edges."""
        nodes = self.turn.streets.num_nodes
        return (self.starts % self._nodes < nodes) & (self.ends % self._nodes < nodes)

    def _games_with_swaps(self) -> IntArray:
        """Return the games in which two agents want to exchange nodes."""
        starts, ends = self.starts, self.ends
        ways = np.minimum(starts, ends) * (self._nodes * len(self.turn.roster.teams)) + np.maximum(starts, ends)
        keys = np.where(self.turn.alive & (starts != ends) & self._are_nodes(), ways * 2 + (starts < ends), -1)
        keys.sort(axis=1)
        are_opposite = (keys[:, 1:] == keys[:, :-1] + 1) & (keys[:, 1:] % 2 == 1)
        return np.flatnonzero(are_opposite.any(axis=1))

    def stop_overflow(self, limits: IntArray | BoolArray, least: int) -> None:
        """Let agents stay so that no node takes in more than its limit, (nodes,), in rounds as `resolve` does.

        Args:
            limits: of the nodes; booleans where none is larger than 1.
            least: the smallest of them.
        """
        games = self._games_too_full(limits, least)
        living, starts, ends = self._living(games)
        stays, agents_each = self.stays[games], self.ends.shape[1]
        if stays.any():
            ends = np.where(stays.take(living), starts, ends)
        size = self._nodes * (len(self.turn.roster.teams) if self._per_team else 1)
        if len(games) > 1:
            first = living // agents_each * size
            starts, ends = starts + first, ends + first
        if limits.dtype == np.bool_:
            start, end, is_open = self._numbered(starts, ends, len(games) * size, limits, _PLACES_PER_MOVE)
            stopped = self._stopped_where_one_fits(games, living, (start, end), is_open)
        else:
            are_places_few = len(games) * size <= _PLACES_AS_THEY_ARE * len(ends)
            involved = _in_the_way(starts, ends, len(games) * size) if least and not are_places_few else None
            if involved is not None:
                living, starts, ends = _taken(involved, living, starts, ends)
            start, end, limit = self._numbered(starts, ends, len(games) * size, limits, _PLACES_AS_THEY_ARE)
            moves = _Coming(start, end, limit)
            those = moves.too_many()
            while len(those):
                is_lost = self._are_lost(games, living[those], end[those], moves.free)
                those = moves.too_many_after(those, is_lost)
            stopped = moves.stopped
        stays.reshape(-1)[living.take(stopped)] = True
        self.stays[games] = stays

    def _stopped_where_one_fits(
        self, games: IntArray, living: IntArray, moves: tuple[RowArray, RowArray], is_open: BoolArray
    ) -> IntArray:
        """Return which moves, starts and ends, are stopped where each place takes one agent, or none.

        Once all contests are decided, one agent comes to a place at most: one who stays is in the way of one other.
        """
        # NOTE: half of the time of counting who comes to each place; `take` and `compress` cost a third to two thirds
        # of an index (benchmarks: teams).
        (start, end), numbers = moves, np.arange(len(living), dtype=np.int32)
        goes, last = start != end, np.zeros(len(is_open), np.int32)
        last[end] = numbers  # who comes to a place, one of several
        is_contested = ~is_open
        is_contested[end.compress(last.take(end) != numbers)] = True
        those = np.flatnonzero(is_contested.take(end))
        place, may_go = end.take(those), goes.take(those)
        last[place] = np.arange(len(those))
        contest = last.take(place).astype(np.int64)  # by the number of one of those in it
        is_free = is_open.take(place)
        is_free[contest.compress(~may_go)] = False
        those, contest = those.compress(may_go), contest.compress(may_go)
        is_lost = self._are_lost(games, living.take(those), contest, is_free)
        winners, stopped = those.compress(~is_lost), those.compress(is_lost)
        last[end.take(winners)] = winners
        after = goes.copy()
        while len(stopped):
            after[stopped] = False
            homes = start.take(stopped)
            stopped = last.take(homes).astype(np.int64)
            stopped = stopped.compress((end.take(stopped) == homes) & after.take(stopped))
        return np.flatnonzero(goes != after)

    def _living(self, games: IntArray) -> tuple[IntArray, IntArray, IntArray]:
        """Return the numbers of the living agents among all of some games, and where their moves begin and end."""
        if len(self.ends) == len(games) == 1 and self.turn.alive.all():
            return np.arange(self.ends.size), self.starts[0], self.ends[0]
        living = np.flatnonzero(self.turn.alive[games])
        return living, self.starts[games].take(living), self.ends[games].take(living)

    def _numbered(
        self, start: IntArray, end: IntArray, size: int, limits: IntArray | BoolArray, most_each: int
    ) -> tuple[Any, Any, Any]:
        """Return numbers of the places, of so many, where moves begin and end, and the limit of each.

        They are numbered as they are if there are no more per move than `most_each`.
        """
        if size <= most_each * len(start):
            return start, end, limits if size == len(limits) else np.tile(limits, size // len(limits))
        places: IntArray = np.concatenate((start, end))
        numbers: RowArray
        if size > _PLACES_PER_MOVE * len(places):
            known, numbers = np.unique(places, return_inverse=True)
        else:
            # NOTE: a third of the time of sorting them (benchmarks: teams).
            known, number_of = places, np.empty(size, np.int32)
            number_of[places] = np.arange(len(places), dtype=np.int32)
            numbers = number_of.take(places)
        nodes = known if size == len(limits) else known % len(limits)
        return numbers[: len(start)], numbers[len(start) :], limits.take(nodes)

    def _games_too_full(self, limits: IntArray | BoolArray, least: int) -> IntArray:
        """Return the games in which more agents want to be on a node than it takes."""
        agents = self.ends.shape[1]
        if len(self.ends) == 1:
            return np.zeros(int(least < agents), np.int64)
        ends = np.where(self.stays, self.starts, self.ends)
        places = np.sort(np.where(self.turn.alive, ends, -1 - np.arange(agents)), axis=1)
        if least and least == limits.max():
            return np.flatnonzero((places[:, least:] == places[:, :-least]).any(axis=1))
        earlier = np.arange(agents) - np.minimum(limits[places % self._nodes], agents)
        others = np.take_along_axis(places, np.maximum(earlier, 0), axis=1)
        return np.flatnonzero(((earlier >= 0) & (places >= 0) & (others == places)).any(axis=1))

    def _are_lost(self, games: IntArray, numbers: IntArray, place: RowArray, free: RowArray | BoolArray) -> BoolArray:
        """Return which of these agents of some games, who want to go to places with these capacities, exceed them."""
        is_lost, those = np.ones(len(numbers), np.bool_), np.flatnonzero(free.take(place) > 0)
        if len(those):
            at, agents = games, numbers.take(those)
            if len(games) > 1:
                rows, agents = np.divmod(agents, self.ends.shape[1])
                at = games.take(rows)
            ranks = self.rank(self.turn, at, agents)
            if ranks is not None:
                is_lost[those.take(_first_each(ranks, place.take(those), free))] = False
        return is_lost

    def _ranked(self, at: IntArray, agents: IntArray, contest: RowArray) -> IntArray | None:
        """Return these agents, given in ascending order, by contest, the winners first; None: no agent wins."""
        ranks = self.rank(self.turn, at, agents) if len(at) else np.zeros(0)
        return None if ranks is None else np.lexsort((ranks, contest))


class _Coming:
    """How many agents are on their way to which places, round by round.

    Args:
        start, end: (moves,) places where moves begin and end.
        limit: (places,) how many agents a place takes.

    Attributes:
        free: (places,) how many more a place takes than stay there.
    """

    def __init__(self, start: RowArray, end: RowArray, limit: IntArray) -> None:
        self._start, self._end, places = start, end, len(limit)
        self._is_moving: BoolArray = start != end
        self._movers = np.flatnonzero(self._is_moving)
        self._to = end.take(self._movers)
        self.free: IntArray = limit - np.bincount(start[~self._is_moving], minlength=places)
        self._coming = np.bincount(self._to, minlength=places)
        self._last = np.empty(places, np.int64)  # who comes to a place that only one comes to
        self._last[self._to] = self._movers
        self._row = np.empty(places, np.int64)

    def too_many(self) -> IntArray:
        """Return the moves to places that more come to than they take, ascending."""
        is_over = self._coming > np.maximum(self.free, 0)
        return self._movers[is_over.take(self._to)]

    def too_many_after(self, moves: IntArray, are_stopped: BoolArray) -> IntArray:
        """Return the moves to places that more come to than they take once some of those that were are stopped."""
        others = moves[~are_stopped]
        self._last[self._end[others]] = others
        homes, coming = self._stop(moves[are_stopped])
        # NOTE: most who stay are in the way of one other, who is found without looking at all (benchmarks: teams).
        while coming.max(initial=0) == 1:
            homes, coming = self._stop(self._last[homes])
        if not len(homes):
            return homes
        is_full = np.zeros(len(self.free), np.bool_)
        is_full[homes] = True
        return self._movers[is_full.take(self._to) & self._is_moving.take(self._movers)]

    def _stop(self, moves: IntArray) -> tuple[IntArray, IntArray]:
        """Stop moves; return those places where they begin that more come to than they take, and how many do."""
        self._is_moving[moves] = False
        homes = self._start[moves]
        np.subtract.at(self._coming, self._end[moves], 1)
        np.subtract.at(self.free, homes, 1)
        coming, numbers = self._coming[homes], np.arange(len(homes))
        self._row[homes] = numbers
        are_too_many = (coming > np.maximum(self.free[homes], 0)) & (self._row[homes] == numbers)  # each place once
        return homes[are_too_many], coming[are_too_many]

    @property
    def stopped(self) -> IntArray:
        """The moves that are stopped, ascending."""
        return self._movers[~self._is_moving.take(self._movers)]


def _first_each(ranks: IntArray | BitArray, contest: RowArray, places: RowArray | BoolArray) -> IntArray:
    """Return who wins, so many in each contest: those with the smallest ranks, of equals the first."""
    if places.take(contest).max() > 1:
        ranked = np.lexsort((ranks, contest))
        contest = contest[ranked]
        ahead = np.arange(len(ranked)) - places[contest]  # the one whom an agent has to beat, if it is of its contest
        winners: IntArray = ranked[(ahead < 0) | (contest[ahead] != contest)]
        return winners
    # NOTE: a tenth of the time of sorting them (benchmarks: teams).
    best = np.empty(len(places), ranks.dtype)
    best[contest] = ranks
    np.minimum.at(best, contest, ranks)
    equals = np.flatnonzero(best.take(contest) == ranks)[::-1]
    first = np.empty(len(places), np.int64)
    those = contest.take(equals)
    first[those] = equals  # of several the one that is written last
    return equals.compress(first.take(those) == equals)


def _in_the_way(starts: IntArray, ends: IntArray, size: int) -> IntArray | None:
    """Return which moves can decide which agents stay, where places take one agent at least; None: it may be any.

    They are those to a place on which several end, those to a place that one of these begins on, and so forth.
    """
    # NOTE: where 2 to 5 % are stopped, this halves what conflicts add to a turn (benchmarks: teams).
    if size > _PLACES_PER_MOVE * len(ends):
        return None
    numbers, last = np.arange(len(ends), dtype=np.int32), np.zeros(size, np.int32)
    last[ends] = numbers
    full, most = ends[last.take(ends) != numbers], len(ends) // _FEW_INVOLVED
    if len(full) > most:
        return None
    is_full = np.zeros(size, np.bool_)
    is_full[full] = True
    is_involved = is_full.take(ends)
    fresh = np.flatnonzero(is_involved)
    while len(fresh):
        homes = starts.take(fresh)
        homes = homes[~is_full.take(homes)]  # to each of which one comes at most
        is_full[homes] = True
        coming = last.take(homes)
        fresh = coming[ends.take(coming) == homes]
        is_involved[fresh] = True
    involved = np.flatnonzero(is_involved)
    return involved if len(involved) <= most else None


def _taken(which: IntArray, *columns: IntArray) -> tuple[IntArray, ...]:
    return tuple(column.take(which) for column in columns)
