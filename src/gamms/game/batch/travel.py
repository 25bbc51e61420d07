"""Travel by metres in many games at once: where agents are on edges, and what they cover in a turn.

`gamms.core.travel` says how each agent goes; here is what strategies of arrays decide, and the columns of games.
"""

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from gamms.core import travel as core
from gamms.game.batch import reach
from gamms.game.batch.movement import (
    AIMS,
    LIMITED,
    STOP,
    Movement,
    Places,
)
from gamms.game.batch.reach import Choices, TravelTerms
from gamms.game.streets import StreetGraph
from gamms.game.travel import map_of
from gamms.ir.graph import ClosedEdges, FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.ir.progress import Progress


class MetricMovement(Movement):
    """Agents that are anywhere on edges, and go as far in a turn as their speeds in metres say.

    Args:
        streets: of the map.
        speeds: of the agents in the order of the roster; None: along one edge in a turn.
        terms: by what they travel.
        whole, closed: see `Movement`.

    Attributes:
        paces: (agents,) speeds; NaN: along one edge in a turn.
        edge: (games, agents) the rows of the edges that agents are on; -1: they are on their nodes.
        share: (games, agents) of the edge that is behind them.
        motion: (games, agents) how they move there, see `ir.progress.Motion`.
        now: (games,) of the turn, from 0 to 1: when the agents that are asked decide.
    """

    is_plain, leaves_nodes, has_aims = False, True, True
    remembers = ("edge", "share", "motion")
    idle = STOP

    def __init__(
        self,
        streets: StreetGraph,
        speeds: Sequence[float | None],
        terms: TravelTerms,
        whole: StreetGraph | None = None,
        closed: ClosedEdges | None = None,
    ) -> None:
        super().__init__(streets, whole, closed)
        self.terms, self.turn_seconds = terms, terms.turn_seconds
        self._is_paced = np.array([speed is not None for speed in speeds], np.bool_)
        self._speeds = np.array([1.0 if speed is None else speed for speed in speeds])
        self.paces = np.where(self._is_paced, self._speeds, np.nan)
        self._kinds, self._kind_of = np.unique(self.paces, return_inverse=True)
        self._is_endless = np.isinf(self._kinds) & (terms.seconds is None)  # by which they go any distance in a turn
        self.begin((0, len(speeds)))

    @cached_property
    def map(self) -> core.RoadEdges:
        """The map as the core takes it."""
        columns, terms = self.streets.columns, self.terms
        leaving = columns.offsets, columns.out_edges
        return map_of(columns, terms.costs, terms.seconds, terms.turn_seconds, leaving)

    @cached_property
    def _choices(self) -> Choices:
        return Choices(self.map, self.streets, self._kinds, goes_on=self.terms.decides_at_arrivals)

    def begin(self, shape: tuple[int, int]) -> None:
        """Reserve memory for so many games and agents, all of which are on nodes."""
        super().begin(shape)
        self.edge, self.share, self.motion = np.full(shape, -1), np.zeros(shape), np.zeros(shape, np.int64)
        self.now = np.zeros(shape[0])

    def clear(self, games: Any, agents: Any = np.s_[:]) -> None:
        """Let agents be on their nodes."""
        self.edge[games, agents], self.share[games, agents] = -1, 0.0

    def put_on(self, games: IntArray, agent: int, place: Progress) -> None:
        """Let an agent be on an edge in some games."""
        self.edge[games, agent] = np.flatnonzero(self.columns.edge_ids == place.edge)[0]
        self.share[games, agent], self.motion[games, agent] = place.share, place.motion

    def on_edges(self, game: int, node: IntArray) -> dict[int, Progress]:  # noqa: ARG002 - as `Movement`
        """Return where on edges agents of a game are, by their numbers."""
        return self.progress(self.edge[game], self.share[game], self.motion[game])

    def progress(self, edge: IntArray, share: FloatArray, motion: IntArray) -> dict[int, Progress]:
        """Return the positions of agents on edges, by their places; edges of -1 are nodes."""
        places = np.flatnonzero(edge >= 0)
        columns, edges = self.columns, edge[places]
        ends = columns.node_ids[columns.sources[edges]], columns.node_ids[columns.targets[edges]]
        each = (*ends, share[places], columns.edge_ids[edges], motion[places])
        found = zip(*(one.tolist() for one in each), strict=True)
        return {place: Progress(*one) for place, one in zip(places.tolist(), found, strict=True)}

    def take_out(self, games: IntArray, agents: IntArray) -> None:
        """Let agents that are out of the game be where they are."""

    def backs(self, edges: IntArray) -> IntArray:
        """Return the rows of the edges by which one turns round on others, -1 among them; -1: none."""
        backs = np.empty(edges.size, np.int64)
        core.backs(self.map, np.ascontiguousarray(edges.ravel()).data, backs.data)
        return backs.reshape(edges.shape)

    @property
    def is_endless(self) -> bool:
        """Whether an agent goes any distance in a turn."""
        return bool(self._is_endless.any())

    # -- legal nodes ----------------------------------------------------------------------------------------------

    def choices(self, node: IntArray, which: tuple[IntArray, IntArray]) -> IntArray:
        """Return the numbers of the choices of agents."""
        edge, games = np.broadcast_to(self.on_edge(which), node.shape), np.broadcast_to(which[0], node.shape)
        kind = np.broadcast_to(self._kind_of[which[1]], node.shape)
        left = np.broadcast_to(1.0 - self.now[which[0]], node.shape)
        found, on_node = np.zeros(node.shape, np.int64), np.nonzero(edge < 0)
        found[on_node] = self._choices.on_nodes(node[on_node], kind[on_node], left[on_node])
        on = np.nonzero(edge >= 0)
        if len(on[0]):
            which = games[on], np.broadcast_to(which[1], node.shape)[on]
            speed, now = self._kinds[kind[on]], self.now[which[0]]
            places = reach.Places(node[on], edge[on], self.share[which], self.motion[which], speed, now)
            found[on] = self._choices.on_edges(places)
        return found

    def counts(self, choices: IntArray) -> IntArray:
        """Return how many nodes are legal."""
        return self._choices.counts(choices)

    def nodes(self, choices: IntArray, actions: IntArray) -> IntArray:
        """Return the rows of legal nodes by their numbers."""
        return self._choices.nodes(choices, actions)

    def most_legal(self, limit: int) -> int:
        """Return how many nodes are legal at most."""
        return self._choices.most(limit)

    # -- what strategies decide -----------------------------------------------------------------------------------

    def towards(
        self, node: IntArray, targets: IntArray, which: tuple[IntArray, IntArray], allowed: BoolArray | None = None
    ) -> IntArray:
        """Return the actions that lead agents towards nodes; -1: no path."""
        games, agents = which
        has_speed, table, edge = self._is_paced[agents], self.routes("length"), self.on_edge(which)
        found = np.full(node.shape, -1)
        found[~has_speed] = table.actions(node[~has_speed], targets[~has_speed], allowed)
        stopped = np.flatnonzero(~has_speed & (edge >= 0) & (found >= 0))  # just before a node, by a conflict
        if len(stopped):
            those = games[stopped], agents[stopped]
            found[stopped] = AIMS + self._next_legal(node[stopped], targets[stopped], those, allowed)
        has_path, on = np.isfinite(table.distances(node, targets)), edge >= 0
        if allowed is not None:
            some = np.flatnonzero(has_speed & has_path)
            found[some] = self._as_far_as_allowed(node[some], targets[some], (games[some], agents[some]), allowed)
            return found
        has_path[on] |= np.isfinite(table.distances(self.columns.targets[edge[on]], targets[on]))
        return np.where(has_speed, np.where(has_path, AIMS + targets, -1), found)

    def _next_legal(
        self, node: IntArray, targets: IntArray, which: tuple[IntArray, IntArray], allowed: BoolArray | None
    ) -> IntArray:
        """Return targets that are legal, and of the others as far as the nodes of the shortest path are legal."""
        choices, table, goes_on = self.choices(node, which), self.routes("length"), np.ones(len(node), np.bool_)
        found = np.where(self.action_to(choices, targets) >= 0, targets, node)
        while goes_on.any():
            ahead = table.following(found, targets)
            goes_on &= (found != targets) & (self.action_to(choices, ahead) >= 0)
            goes_on &= True if allowed is None else allowed[ahead]
            found = np.where(goes_on, ahead, found)
        return found

    def _as_far_as_allowed(
        self, node: IntArray, targets: IntArray, which: tuple[IntArray, IntArray], allowed: BoolArray
    ) -> IntArray:
        """Return the actions that lead to targets that are legal, and to others along nodes of the shortest path."""
        table, limit, at = self.routes("length"), np.zeros(len(node), np.int64), node
        is_legal = self.action_to(self.choices(node, which), targets) >= 0
        goes_on = ~is_legal & (node != targets)
        while goes_on.any():
            at = np.where(goes_on, table.following(at, targets), at)
            goes_on &= allowed[at]
            limit += goes_on
            goes_on &= at != targets
        return np.where(is_legal, AIMS + targets, np.where(limit > 0, AIMS * (LIMITED + limit) + targets, AIMS + node))

    def places(self, node: IntArray, which: tuple[IntArray, IntArray]) -> Places:
        """Return where agents are."""
        columns, edge, share = self.columns, self.on_edge(which), self.share[which]
        xy, ids = columns.xy[node].copy(), np.full((*node.shape, 3), -1)
        on = np.nonzero(edge >= 0)
        rows = edge[on]
        ends = columns.node_ids[columns.sources[rows]], columns.node_ids[columns.targets[rows]]
        ids[on] = np.column_stack((*ends, columns.edge_ids[rows]))
        xy[on] = np.column_stack(self.lines.at(rows, share[on])[:2])
        return Places(ids, self.offsets(which), xy)

    def offsets(self, which: tuple[IntArray, IntArray]) -> FloatArray:
        """Return how far along their edges agents are, map units."""
        edge = self.on_edge(which)
        return np.where(edge >= 0, self.share[which] * self.columns.lengths[edge], 0.0)
