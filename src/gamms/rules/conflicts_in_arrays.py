"""Conflicts of moves in many games at once: the same as `Conflicts.resolve`, which says what they are."""

from collections.abc import Callable
from sys import maxsize
from typing import Any

import numpy as np

from gamms.game.batch.device import DeviceTurn
from gamms.game.batch.libraries import Tensor
from gamms.game.batch.turn import ArrayTurn
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray

UNLIMITED = maxsize  # no graph has so many agents

ArrayResolver = Callable[[ArrayTurn, IntArray, IntArray], Any]
"""Returns ranks of agents in contests, given the games of the turn and their numbers: those with the smallest win, of
equals the first by name; None: no agent wins."""


def may_conflict(turn: DeviceTurn, least: int, *, per_team: bool, swaps: bool) -> Tensor:
    """Return in which games agents may be in the way of others, (games,), on the device.

    Args:
        turn: before agents move to its `ends`.
        least: the smallest capacity of a node.
        per_team: whether teams do not count for each other.
        swaps: whether agents may not exchange nodes.
    """
    xp, team_of, nodes = turn.xp, turn.roster.team_of, len(turn.roster.names) and len(turn.streets.columns.node_ids)
    of_team = turn.put(team_of * nodes if per_team else team_of * 0)
    starts, ends, found = turn.node + of_team, turn.ends + of_team, []
    moves = turn.alive & (starts != ends)
    if swaps:
        low, high = xp.where(starts < ends, starts, ends), xp.where(starts < ends, ends, starts)
        ways = (low * (nodes * len(turn.roster.teams)) + high) * 2
        keys = xp.sort(xp.where(moves, ways + xp.astype(starts < ends, xp.int64), -2), axis=1)
        found.append((keys[:, 1:] == keys[:, :-1] + 1) & (keys[:, 1:] % 2 == 1))
    if least < len(team_of):
        absent = turn.put(-1 - np.arange(len(team_of)))
        places = xp.sort(xp.where(turn.alive, ends, absent), axis=1)
        found.append(places[:, least:] == places[:, : len(team_of) - least])
    return turn.any_of(found)


class MovesInArrays:
    """The moves of a turn of many games, and which agents have to stay.

    Attributes:
        turn: of the games.
        rank: the resolver.
        starts, ends: (games, agents) places: nodes, in games by metres edges behind them, or those of each team apart.
        stays: (games, agents), which the methods find out.
    """

    def __init__(self, turn: ArrayTurn, ends: IntArray, rank: ArrayResolver, *, per_team: bool) -> None:
        edges = 0 if turn.places is None else len(turn.streets.columns.edge_ids)
        self.turn, self.rank, self._nodes = turn, rank, len(turn.streets.counts) + edges
        of_team = turn.roster.team_of * self._nodes if per_team else 0
        starts = turn.node if turn.places is None else turn.places
        self.starts, self.ends, self.stays = starts + of_team, ends + of_team, np.zeros(ends.shape, np.bool_)

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
        nodes = len(self.turn.streets.counts)
        are_nodes: BoolArray = (self.starts % self._nodes < nodes) & (self.ends % self._nodes < nodes)
        return are_nodes

    def _games_with_swaps(self) -> IntArray:
        """Return the games in which two agents want to exchange nodes."""
        starts, ends = self.starts, self.ends
        ways = np.minimum(starts, ends) * (self._nodes * len(self.turn.roster.teams)) + np.maximum(starts, ends)
        keys = np.where(self.turn.alive & (starts != ends) & self._are_nodes(), ways * 2 + (starts < ends), -1)
        keys.sort(axis=1)
        are_opposite = (keys[:, 1:] == keys[:, :-1] + 1) & (keys[:, 1:] % 2 == 1)
        return np.flatnonzero(are_opposite.any(axis=1))

    def stop_overflow(self, limits: IntArray) -> None:
        """Let agents stay so that no node takes in more than its limit, (nodes,), in rounds as `resolve` does."""
        games = self._games_too_full(limits)
        while len(games):
            rows, agents = np.nonzero(self.turn.alive[games])
            at = games[rows]
            start, end = self.starts[at, agents], self.ends[at, agents]
            moves = (start != end) & ~self.stays[at, agents]
            places = rows * (self._nodes * len(self.turn.roster.teams)) + np.where(moves, end, start)
            known, place = np.unique(places, return_inverse=True)
            free = limits[known % self._nodes] - np.bincount(place, ~moves).astype(np.int64)
            is_over = np.bincount(place, moves) > np.maximum(free, 0)
            those = np.flatnonzero(is_over[place] & moves)
            lost = those[self._losers(at[those], agents[those], place[those], free)]
            self.stays[at[lost], agents[lost]] = True
            games = np.unique(at[lost])

    def _games_too_full(self, limits: IntArray) -> IntArray:
        """Return the games in which more agents want to be on a node than it takes."""
        agents, least = self.ends.shape[1], int(limits.min(initial=UNLIMITED))
        if least >= agents:
            return np.zeros(0, np.int64)
        ends = np.where(self.stays, self.starts, self.ends)
        places = np.sort(np.where(self.turn.alive, ends, -1 - np.arange(agents)), axis=1)
        if least and least == limits.max():
            return np.flatnonzero((places[:, least:] == places[:, :-least]).any(axis=1))
        earlier = np.arange(agents) - np.minimum(limits[places % self._nodes], agents)
        others = np.take_along_axis(places, np.maximum(earlier, 0), axis=1)
        return np.flatnonzero(((earlier >= 0) & (places >= 0) & (others == places)).any(axis=1))

    def _losers(self, at: IntArray, agents: IntArray, place: IntArray, free: IntArray) -> IntArray:
        """Return which of these agents, who want to go to places with these capacities, exceed them."""
        has_room = free[place] > 0
        those, turned_away = np.flatnonzero(has_room), np.flatnonzero(~has_room)
        ranked = self._ranked(at[those], agents[those], place[those])
        if ranked is None:
            return np.arange(len(at))
        ranked = those[ranked]
        starts = np.unique(place[ranked], return_index=True)[1]
        number = np.arange(len(ranked)) - np.repeat(starts, np.diff([*starts, len(ranked)]))
        return np.concatenate((turned_away, ranked[number >= free[place[ranked]]]))

    def _ranked(self, at: IntArray, agents: IntArray, contest: IntArray) -> IntArray | None:
        """Return these agents by contest, in each the winners first; None: no agent wins."""
        ranks = self.rank(self.turn, at, agents) if len(at) else np.zeros(0)
        return None if ranks is None else np.lexsort((agents, ranks, contest))
