"""Moves along several edges per turn, or parts of edges, in the game of a context; see `core.by_edges`."""

from collections.abc import Sequence
from math import nan
from typing import Any

import numpy as np

from gamms.core import by_edges as core
from gamms.core.travel import GoalPaths
from gamms.errors import BadValue, NoPath
from gamms.game.streets import StreetGraph
from gamms.game.travel import PathFinder, ResolvedAction
from gamms.ir.progress import Progress

_MORE_NODES = 3  # room in addition to the nodes of a path


class MultiEdgeMoves(PathFinder):
    """Finds moves along several edges per turn, on one revision of a graph.

    Args:
        streets: the legal moves along one edge.

    Attributes:
        streets: see the argument.
    """

    def __init__(self, streets: StreetGraph) -> None:
        super().__init__(streets.columns, np.ones(len(streets.columns.edge_ids)))
        self.streets = streets
        self._most = streets.num_nodes + _MORE_NODES
        self._take_ways(self.ways(0))

    def _take_ways(self, hops: GoalPaths) -> None:
        """Use these shortest paths in the core, with new buffers."""
        nodes: list[Any] = [one.data for one in np.zeros((2, self._most), np.int64)]
        times: Any = np.zeros(self._most).data
        ints: list[Any] = [one.data for one in np.zeros((2, 1), np.int64)]
        floats: list[Any] = [one.data for one in np.zeros((2, 1))]
        self._hops = hops
        self._nodes, self._route = nodes
        self._lengths, self._ahead = ints
        self._speed, self._covered = floats
        self._walks = core.EdgePaths(
            *(self._nodes, times, self._lengths, self.streets.core, hops, self._most),
            speeds=self._speed,
            ahead=self._ahead,
            covered=self._covered,
            route=self._route,
        )

    def _begin(self, here: int, speed: float | None, place: Progress | None) -> None:
        """Place an agent at its start."""
        ahead = -1
        covered = 0.0
        if place is not None and place.source == here:
            ahead = self._row_of.get(place.target, -1)
            covered = place.share
        self._speed[0] = nan if speed is None else min(speed, self._most)
        core.begin(self._walks, 0, self.row(here), ahead, covered)

    def reachable(self, here: int, speed: float | None, place: Progress | None) -> tuple[int, ...]:
        """Return the legal nodes of an agent in this turn, its own first."""
        self._begin(here, speed, place)
        return self.found(core.list_legal(self._walks, 0))

    def towards(self, agent: int, here: int, speed: float, place: Progress | None, target: int) -> ResolvedAction:
        """Return the move of an agent toward a node, along a path with the fewest edges.

        Raises:
            BadValue: there is no path.
        """
        hops = self.ways(agent)
        if hops is not self._hops:
            self._take_ways(hops)
        self._begin(here, speed, place)
        if not core.go_towards(self._walks, 0, hops, agent, self.row(target)):
            raise BadValue(str(NoPath(here, target)))
        return self._ended()

    def along(self, here: int, speed: float, place: Progress | None, route: Sequence[int]) -> ResolvedAction:
        """Return the move of an agent along a route of nodes."""
        if len(route) + _MORE_NODES > self._most:
            self._most = len(route) + _MORE_NODES
            self._take_ways(self._hops)
        self._begin(here, speed, place)
        for number, node in enumerate(route):
            self._route[number] = self.row(node)
        core.walk(self._walks, 0, len(route))
        return self._ended()

    def _ended(self) -> ResolvedAction:
        """Return the path that the core has written."""
        ids = self.ids
        ahead = self._ahead[0]
        path = tuple([ids[row] for row in self._nodes[: self._lengths[0]].tolist()])
        progress = None if ahead < 0 else Progress(path[-1], ids[ahead], self._covered[0])
        return ResolvedAction(path[-1], path, progress=progress)
