"""Agents that go along several edges in a turn, or parts of one, by their speeds in edges, in many games at once."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from gamms.game.batch.movement import AIMS, LIMITED, Movement
from gamms.game.streets import StreetGraph
from gamms.game.travel import SLACK
from gamms.ir.graph import ClosedEdges, FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.ir.progress import Progress

_MOST_KNOWN = 1 << 25  # legal nodes that are kept
_AT_ONCE = 1 << 12  # choices of which the largest is looked for
_REACHES = 3  # by how much more than the speed alone what is covered of an edge may lead: 0, 1, or 2 by rounding


class EdgeMovement(Movement):
    """Agents that go along several edges in a turn, or parts of one, by their speeds in edges.

    A choice is what `Legality.reachable` returns: without a speed that of the node where an agent is, which has its
    number; for a speed, an entry of `whole.targets` (where the agent is, and the neighbour to which it has covered
    part of the edge, or itself), and what that part adds. Those are found when they are first asked for.

    Args:
        streets: of the map.
        speeds: of the agents in the order of the roster; None: along one edge.
        whole, closed: see `Movement`.

    Attributes:
        paces: (agents,) speeds, none more than there are nodes; NaN: along one edge.
        begun: (games, agents) the row of the node to which an agent has covered part of the edge; -1: to none.
        covered: (games, agents) how much of it.
    """

    is_plain, has_aims = False, True
    _used: int
    remembers = ("begun", "covered")

    def __init__(
        self,
        streets: StreetGraph,
        speeds: Sequence[float | None],
        whole: StreetGraph | None = None,
        closed: ClosedEdges | None = None,
    ) -> None:
        super().__init__(streets, whole, closed)
        self._is_paced = np.array([speed is not None for speed in speeds], np.bool_)
        # No way to a node has more edges than there are nodes.
        self._speeds = np.array([0.0 if speed is None else min(speed, streets.num_nodes) for speed in speeds])
        self.paces = np.where(self._is_paced, self._speeds, np.nan)
        self._kinds, self._kind_of = np.unique(self._speeds, return_inverse=True)
        self._sources = np.repeat(np.arange(streets.num_nodes), self.whole.counts)
        self._keys = len(self._kinds) * _REACHES * len(self.whole.targets)
        self._forget()
        self.begin((0, len(speeds)))

    def begin(self, shape: tuple[int, int]) -> None:
        """Reserve memory for so many games and agents."""
        super().begin(shape)
        self.begun, self.covered = np.full(shape, -1), np.zeros(shape)

    def clear(self, games: Any, agents: Any = np.s_[:]) -> None:
        """Let agents have covered nothing of an edge."""
        self.begun[games, agents], self.covered[games, agents] = -1, 0.0

    def put_on(self, games: IntArray, agent: int, place: Progress) -> None:
        """Let an agent have covered part of an edge in some games."""
        self.begun[games, agent], self.covered[games, agent] = self.streets.rows([place.target]), place.share

    def on_edges(self, game: int, node: IntArray) -> dict[int, Progress]:
        """Return what agents of a game, on these nodes (agents,), have covered of edges, by their numbers."""
        agents = np.flatnonzero(self.begun[game] >= 0)
        ids = self.streets.ids
        each = ids(node[agents]), ids(self.begun[game, agents]), self.covered[game, agents]
        found = zip(*(one.tolist() for one in each), strict=True)
        return {agent: Progress(*one) for agent, one in zip(agents.tolist(), found, strict=True)}

    # -- legal nodes ----------------------------------------------------------------------------------------------

    def choices(self, node: IntArray, which: tuple[IntArray, IntArray]) -> IntArray:
        """Return the numbers of the choices of agents that are on these nodes."""
        is_other = self._is_paced[which[1]]
        if not is_other.any():
            return node
        found, others = node.copy(), np.nonzero(np.broadcast_to(is_other, node.shape))
        games, agents = (np.broadcast_to(one, node.shape)[others] for one in which)
        found[others] = self._choices_by_speed(node[others], games, agents)
        return found

    def _choices_by_speed(self, node: IntArray, games: IntArray, agents: IntArray) -> IntArray:
        entries, kind = len(self.whole.targets), self._kind_of[agents] * _REACHES
        ahead = self.begun[games, agents]
        on = np.flatnonzero(ahead >= 0)
        keys = kind * entries + self.whole.offsets[node]
        keys[on] += self.whole.action_to(node[on], ahead[on])
        speed = self._speeds[agents[on]]
        more = np.floor(_edges_within(speed + self.covered[games[on], agents[on]])) - np.floor(_edges_within(speed))
        keys[on] += more.astype(np.int64) * entries
        found: IntArray = self._number[keys]
        if (found < 0).any():
            if self._used > len(self.streets.targets) + _MOST_KNOWN:
                self._forget()
            new = np.unique(keys[self._number[keys] < 0])
            self._number[new] = self._learn(new)
            found = self._number[keys]
        return found

    def are_plain(self, agents: IntArray) -> bool:
        """Whether none of some agents has a speed."""
        return not self._is_paced[agents].any()

    def counts(self, choices: IntArray) -> IntArray:
        """Return how many nodes are legal."""
        return self._count[choices]

    def nodes(self, choices: IntArray, actions: IntArray) -> IntArray:
        """Return the rows of legal nodes by their numbers."""
        found: IntArray = self._flat[self._first[choices] + actions]
        return found

    def _forget(self) -> None:
        self._number = np.full(self._keys, -1, np.int64)
        self._first, self._count = self.streets.offsets[:-1], self.streets.counts
        self._flat, self._used = self.streets.targets, len(self.streets.targets)

    def _learn(self, keys: IntArray) -> IntArray:
        """Find these choices and return their numbers."""
        at, found = self._reached(keys)
        counts = np.bincount(at, minlength=len(keys))
        numbers = len(self._first) + np.arange(len(keys))
        self._first = np.concatenate((self._first, self._used + np.cumsum(counts) - counts))
        self._count = np.concatenate((self._count, counts))
        after = self._used + len(found)
        if after > len(self._flat):
            self._flat = np.concatenate((self._flat[: self._used], np.empty(2 * after - self._used, np.int64)))
        self._flat[self._used : after], self._used = found, after
        return numbers

    def _reached(self, keys: IntArray) -> tuple[IntArray, IntArray]:
        """Return what is in choices, by their places in `keys`, and the rows of nodes.

        These are nodes next to the agent, then those in reach of it, then those along the begun edge.
        """
        nodes = self.whole.num_nodes
        kind, entry = np.divmod(keys, len(self.whole.targets))
        kind, more = np.divmod(kind, _REACHES)
        here, ahead = self._sources[entry], self.whole.targets[entry]
        hops = np.floor(_edges_within(self._kinds[kind])).astype(np.int64)
        runs, near = self.streets.legal_of(here)
        parts = [
            (np.repeat(np.arange(len(keys)), np.diff(runs)), near),
            self._within(here, hops),
            self._within(ahead, np.where(ahead == here, -1, hops + more - 1)),
        ]
        at, found = (np.concatenate(columns) for columns in zip(*parts, strict=True))
        _, first = np.unique(at * nodes + found, return_index=True)
        first = np.sort(first)
        first = first[np.argsort(at[first], kind="stable")]
        return at[first], found[first]

    def most_legal(self, limit: int) -> int:
        """Return how many nodes are legal at most; where no speed is a fraction, no agent has begun an edge."""
        most, entries = 1, len(self.whole.targets)
        are_open = np.flatnonzero(self.streets.action_to(self._sources, self.whole.targets) >= 0)
        for kind, speed in enumerate(self._kinds.tolist()):
            if speed >= self.streets.num_nodes:
                return self.streets.num_nodes
            begun = are_open if speed % 1.0 else self.whole.offsets[:-1]
            for first in range(0, len(begun), _AT_ONCE):
                at, _ = self._reached((kind * _REACHES + 1) * entries + begun[first : first + _AT_ONCE])
                most = max(most, int(np.bincount(at).max(initial=1)))
                if most > limit:
                    return most
        return most

    def _within(self, rows: IntArray, hops: IntArray) -> tuple[IntArray, IntArray]:
        """Return the nodes at most so many edges ahead of nodes: the places in `rows`, ascending, and rows of nodes."""
        nodes, at = len(self.streets.counts), np.flatnonzero(hops >= 0)
        known = fresh = at * nodes + rows[at]
        ring = 0
        while len(fresh):
            ring += 1
            fresh = fresh[hops[fresh // nodes] >= ring]
            runs, targets = self.streets.legal_of(fresh % nodes)
            ends = np.repeat(fresh // nodes, np.diff(runs)) * nodes + targets
            fresh = np.setdiff1d(ends, known)
            known = np.union1d(known, fresh)
        return known // nodes, known % nodes

    # -- moves ----------------------------------------------------------------------------------------------------

    def towards(
        self, node: IntArray, targets: IntArray, which: tuple[IntArray, IntArray], allowed: BoolArray | None = None
    ) -> IntArray:
        """Return the actions that lead agents from nodes towards others; -1: no path."""
        has_speed = self._is_paced[which[1]]
        found, table = np.full(node.shape, -1), self.routes("length")
        found[~has_speed] = table.actions(node[~has_speed], targets[~has_speed], allowed)
        here, ends = node[has_speed], targets[has_speed]
        limit = np.zeros(len(here), np.int64)
        if allowed is not None:  # of the first edges of the way
            at, goes = here, np.ones(len(here), np.bool_)
            for _ in range(int(self._speeds.max()) + 2):
                at = table.following(at, ends)
                goes &= allowed[at]
                limit += goes
                goes &= at != ends
                if not goes.any():
                    break
        first = 1 if allowed is None else LIMITED
        has_path = np.isfinite(table.distances(here, ends))
        found[has_speed] = np.where(has_path, AIMS * (first + limit) + ends, -1)
        return found


def _edges_within(budget: FloatArray) -> FloatArray:
    """Return the largest numbers of edges that count as within budgets."""
    return budget * (1.0 + SLACK)
