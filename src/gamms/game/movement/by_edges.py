"""Agents that go along several edges in a turn, or parts of one, by their speeds in edges, in many games at once."""

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from gamms.core import by_edges as core
from gamms.core.travel import GoalPaths
from gamms.game.movement.one_edge import PacedMovement
from gamms.game.movement.streets import StreetGraph
from gamms.game.movement.travel import ReachableNodes, StoredPaths
from gamms.ir.graph import ClosedEdges, FloatArray, IntArray
from gamms.ir.progress import Progress
from gamms.kernels import buffer

_AT_ONCE = 1 << 12  # positions at which the most legal nodes are looked for


class EdgeMovement(PacedMovement):
    """Agents that go along several edges in a turn, or parts of one, by their speeds in edges.

    Args:
        streets: the graph of the map.
        speeds: the speeds of agents in the order of the roster; None: one edge per turn.
        whole, closed: see `Movement`.

    Attributes:
        paces: (agents,) the speeds, at most the number of nodes; NaN: one edge per turn.
        begun: (games, agents) the row of the node at the end of a partly covered edge; -1: none.
        covered: (games, agents) the covered share of this edge.
    """

    remembers = ("begun", "covered")

    def __init__(
        self,
        streets: StreetGraph,
        speeds: Sequence[float | None],
        whole: StreetGraph | None = None,
        closed: ClosedEdges | None = None,
    ) -> None:
        # No path to a node has more edges than there are nodes.
        paces = [np.nan if speed is None else min(speed, streets.num_nodes) for speed in speeds]
        super().__init__(streets, np.array(paces, np.float64), whole, closed)

    def begin(self, shape: tuple[int, int]) -> None:
        """Reserve memory for these numbers of games and agents."""
        super().begin(shape)
        self.begun = np.full(shape, -1)
        self.covered = np.zeros(shape)

    def clear(self, games: Any, agents: Any = np.s_[:]) -> None:
        """Reset the covered parts of edges."""
        self.begun[games, agents] = -1
        self.covered[games, agents] = 0.0

    def put_on(self, games: IntArray, agent: int, place: Progress) -> None:
        """Set the covered part of an agent's edge in some games."""
        self.begun[games, agent] = self.streets.rows([place.target])
        self.covered[games, agent] = place.share

    def on_edges(self, game: int, node: IntArray) -> dict[int, Progress]:
        """Return the covered parts of edges of a game's agents on these nodes, (agents,), by their numbers."""
        agents = np.flatnonzero(self.begun[game] >= 0)
        ids = self.streets.ids
        each = ids(node[agents]), ids(self.begun[game, agents]), self.covered[game, agents]
        found = zip(*(one.tolist() for one in each), strict=True)
        return {agent: Progress(*one) for agent, one in zip(agents.tolist(), found, strict=True)}

    # -- legal nodes ----------------------------------------------------------------------------------------------

    @cached_property
    def _hops(self) -> GoalPaths:
        columns = self.columns
        paths = StoredPaths(columns, np.ones(len(columns.edge_ids)), 0, 1, self.all_roads.edges_at([self._on]))
        return paths.plain_ways(ReachableNodes(self.streets.num_nodes))

    def _of(self, node: IntArray, which: tuple[IntArray, IntArray]) -> tuple[IntArray, IntArray]:
        return self._legal_at(node, self.begun[which], self.covered[which], self.paces[which[1]])

    def _legal_at(
        self, node: IntArray, ahead: IntArray, covered: FloatArray, speed: FloatArray
    ) -> tuple[IntArray, IntArray]:
        """Return the legal nodes of agents by their positions and speeds, as `_listed` does."""
        times = np.zeros(len(node))
        lengths, route = np.zeros((2, len(node)), np.int64)
        walks = core.EdgePaths(
            *(buffer(node.copy()), buffer(times), buffer(lengths), self.streets.core, self._hops, 1),
            speeds=buffer(speed),
            ahead=buffer(ahead.copy()),
            covered=buffer(covered.copy()),
            route=buffer(route),
        )
        return self._listed(len(node), lambda first, rows, counts: core.list_each(walks, first, rows, counts))

    def most_legal(self, limit: int) -> int:
        """Return the maximum number of legal nodes; if all speeds are integers, no agent is on an edge."""
        streets = self.streets
        most = 1
        nodes = np.arange(streets.num_nodes)
        on_nodes = nodes, np.full(len(nodes), -1)
        on_edges = np.repeat(nodes, streets.counts), streets.targets
        for speed in np.unique(self.paces).tolist():
            if speed >= streets.num_nodes:
                return streets.num_nodes
            node, ahead = on_edges if speed % 1.0 else on_nodes
            for first in range(0, len(node), _AT_ONCE):
                some = slice(first, first + _AT_ONCE)
                here = node[some]
                covered = np.ones(len(here))
                counts, _ = self._legal_at(here, ahead[some], covered, np.full(len(here), speed))
                most = max(most, int(counts.max(initial=1)))
                if most > limit:
                    return most
        return most
