"""Which nodes are legal by metres: those next to nodes, and those in reach of them, in what is left of a turn."""

from collections.abc import Callable, Mapping, Sequence
from heapq import heappop, heappush
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from gamms import kernels
from gamms.game.batch.columns import PlayedGame
from gamms.game.streets import Streets
from gamms.game.travel import SLACK
from gamms.ir.graph import FloatArray, GraphColumns, IntArray

_MOST_KNOWN = 1 << 22  # nodes that are kept
_COUNTED = 32  # the bits of a choice that say how many nodes it has; those above, where these begin


class TravelTerms(NamedTuple):
    """By what agents travel.

    Attributes:
        weight: of the edges, by which they choose paths.
        costs: (edges,) by that weight.
        seconds: (edges,) that each takes at least; None: edges have no speed of their own.
        turn_seconds: how long a turn lasts, in the time of speeds.
        decides_at_arrivals: whether agents go on until they arrive, and decide there; see `arrivals`.
    """

    weight: str
    costs: FloatArray
    seconds: FloatArray | None
    turn_seconds: float
    decides_at_arrivals: bool = False

    @classmethod
    def of(cls, game: PlayedGame) -> "TravelTerms":
        """Return those of a game by metres."""
        settings, graph = game.settings(), game.ctx.graph.graph
        weight, is_by_seconds = settings["weight"], settings["speed_unit"] == "metres_per_second"
        costs = np.asarray(graph.weights(weight), np.float64)
        seconds = costs if weight == "travel_time" and is_by_seconds else None
        turn_seconds = settings["turn_seconds"] if is_by_seconds else 1.0
        return cls(weight, costs, seconds, turn_seconds, settings["decide"] == "arrival")


def edges_back(columns: GraphColumns, ways: IntArray, nodes: int) -> IntArray:
    """Return the first edge from the end of each edge to its start that is as long; -1 where there is none.

    Args:
        columns: of the graph.
        ways: (edges,) the rows of their sources times the number of nodes, and of their targets.
        nodes: how many there are.
    """
    order = np.argsort(ways, kind="stable")
    wanted = columns.targets * nodes + columns.sources
    first, last = (np.searchsorted(ways[order], wanted, side) for side in ("left", "right"))
    found = np.full(len(ways), -1)
    for number in reversed(range(int((last - first).max(initial=0)))):
        open_ = np.flatnonzero(first + number < last)
        others = order[first[open_] + number]
        is_like = np.abs(columns.lengths[others] - columns.lengths[open_]) <= SLACK * columns.lengths[open_]
        found[open_[is_like]] = others[is_like]
    return found


class Reach:
    """The choices of agents by their speeds; the number of each says where its nodes are kept, and how many there are.

    Args:
        streets: of the map.
        speeds: that agents have; NaN: none, so that they go along one edge in a turn.
        takes: returns how many turns shares of edges take at speeds; see `ByMetres.takes`.
    """

    def __init__(self, streets: Streets, speeds: FloatArray, takes: Callable[[Any, Any, Any], FloatArray]) -> None:
        self._streets, self._speeds, self._takes = streets, speeds, takes
        # NOTE: kept, because each agent on an edge looks around in each turn (benchmarks: travel).
        self._arcs: list[dict[int, list[tuple[float, int, int]]]] = [{} for _ in speeds]
        self._forget()

    def _forget(self) -> None:
        self._number = np.full(len(self._speeds) * len(self._streets.counts), -1)
        self._flat, self._when, self._used = np.zeros(1 << 10, np.int64), np.zeros(1 << 10), 0

    def counts(self, choices: IntArray) -> IntArray:
        """Return how many nodes choices have."""
        return choices & ((1 << _COUNTED) - 1)

    def nodes(self, choices: IntArray, actions: IntArray) -> IntArray:
        """Return the rows of nodes of choices by their numbers."""
        found: IntArray = self._flat[(choices >> _COUNTED) + actions]
        return found

    def from_nodes(self, node: IntArray, kind: IntArray, left: FloatArray) -> IntArray:
        """Return the choices on nodes, by the numbers of speeds, in what is left of the turn."""
        if self._used > _MOST_KNOWN:
            self._forget()
        keys = kind * len(self._streets.counts) + node
        new, nodes = np.unique(keys[self._number[keys] < 0]), len(self._streets.counts)
        if len(new):
            known = [(dict.fromkeys(self.near(key % nodes), 0.0), divmod(key, nodes)) for key in new.tolist()]
            self._number[new] = self.add([near | self.around(at, of, 0.0) | near for near, (of, at) in known])
        found: IntArray = self._number[keys]
        late = np.nonzero(left < 1.0)
        if len(late[0]):
            found[late] = self._within(found[late], left[late])
        return found

    def _within(self, choices: IntArray, left: FloatArray) -> IntArray:
        """Return choices without the nodes that are reached later, which are their last ones."""
        first, counts = choices >> _COUNTED, self.counts(choices)
        rows, entries = kernels.expand_ranges(first, first + counts)
        is_reached = self._when[entries] <= left[rows] + SLACK
        return (first << _COUNTED) + np.bincount(rows[is_reached], minlength=len(first))

    def add(self, choices: Sequence[Mapping[int, float]]) -> IntArray:
        """Keep the nodes of choices with the times of the turn when they are reached; return their numbers."""
        counts = np.array([len(nodes) for nodes in choices])
        first = self._used + np.cumsum(counts) - counts
        begin, self._used = self._used, self._used + int(counts.sum())
        if self._used > len(self._flat):
            self._flat, self._when = np.resize(self._flat, 2 * self._used), np.resize(self._when, 2 * self._used)
        self._flat[begin : self._used] = [*chain.from_iterable(choices)]
        self._when[begin : self._used] = [time for nodes in choices for time in nodes.values()]
        numbers: IntArray = (first << _COUNTED) + counts
        return numbers

    def near(self, node: int) -> list[int]:
        """Return a node and those next to it."""
        streets = self._streets
        near: list[int] = streets.targets[streets.offsets[node] : streets.offsets[node + 1]].tolist()
        return near

    def around(self, node: int, kind: int, begun: float) -> dict[int, float]:
        """Return the nodes within a turn from a node, the first ones first, and when each is reached; see `Travel`."""
        found, heap, arcs = dict[int, float](), [(begun, 0, node)], self._arcs[kind]
        if np.isnan(self._speeds[kind]):
            return found
        while heap:
            now, _, at = heappop(heap)
            if at in found:
                continue
            found[at] = now
            for turns, id, end in arcs.get(at) or self._learn(kind, at):
                then = now + turns
                if then > 1.0 + SLACK:  # nor will the rest be in reach
                    break
                if end not in found:
                    heappush(heap, (then, id, end))
        return found

    def _learn(self, kind: int, node: int) -> list[tuple[float, int, int]]:
        """Return the edges that leave a node as turns, ids and rows of the nodes that they lead to, in this order."""
        columns = self._streets.columns
        edges = columns.out_edges[columns.offsets[node] : columns.offsets[node + 1]]
        ends = columns.targets[edges]
        parts = self._takes(edges, 1.0, self._speeds[kind]), columns.node_ids[ends], ends
        found = sorted(zip(*(part.tolist() for part in parts), strict=True))
        self._arcs[kind][node] = found
        return found

    def most(self, limit: int) -> int:
        """Return how many nodes are legal at most: on an edge, fewer than from both its ends together."""
        columns, most = self._streets.columns, 1
        for kind in range(len(self._speeds)):
            reached = []
            for node in range(len(self._streets.counts)):
                reached.append({*self.near(node), *self.around(node, kind, 0.0)})
                most = max(most, len(reached[-1]))
                if most > limit:
                    return most
            for source, target in zip(columns.sources.tolist(), columns.targets.tolist(), strict=True):
                most = max(most, len(reached[source] | reached[target]))
        return most
