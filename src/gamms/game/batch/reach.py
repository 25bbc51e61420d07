"""Which nodes are legal by metres: those next to nodes, and those in reach of them, in what is left of a turn."""

from collections.abc import Callable, Iterable, Mapping
from heapq import heappop, heappush
from typing import Any, NamedTuple

import numpy as np

from gamms import kernels
from gamms.game.streets import Streets
from gamms.game.travel import SLACK
from gamms.ir.graph import FloatArray, IntArray

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


class Reach:
    """The choices of agents by their speeds; the number of each says where its nodes are kept, and how many there are.

    Args:
        streets: of the map.
        speeds: that agents have; NaN: none, so that they go along one edge in a turn.
        takes: returns how many turns shares of edges take at speeds; see `ByMetres.takes`.
    """

    def __init__(self, streets: Streets, speeds: FloatArray, takes: Callable[[Any, Any, Any], FloatArray]) -> None:
        self._streets, self._speeds, self._takes = streets, speeds, takes
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
        for key in np.unique(keys[self._number[keys] < 0]).tolist():
            kind_of, start = divmod(key, len(self._streets.counts))
            near, around = self.near(start), self.around(start, kind_of, 0.0)
            self._number[key] = self.add([*near, *around], around | dict.fromkeys(near, 0.0))
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

    def add(self, nodes: Iterable[int], when: Mapping[int, float] | None = None) -> int:
        """Keep the nodes of a choice, of which some are reached at times of the turn; return its number."""
        different = list(dict.fromkeys(nodes))
        first, self._used = self._used, self._used + len(different)
        if self._used > len(self._flat):
            self._flat, self._when = np.resize(self._flat, 2 * self._used), np.resize(self._when, 2 * self._used)
        self._flat[first : self._used] = different
        self._when[first : self._used] = 0.0 if when is None else [when[node] for node in different]
        return (first << _COUNTED) + len(different)

    def near(self, node: int) -> list[int]:
        """Return a node and those next to it."""
        streets = self._streets
        near: list[int] = streets.targets[streets.offsets[node] : streets.offsets[node + 1]].tolist()
        return near

    def around(self, node: int, kind: int, begun: float) -> dict[int, float]:
        """Return the nodes within a turn from a node, the first ones first, and when each is reached; see `Travel`."""
        speed, columns = self._speeds[kind], self._streets.columns
        if np.isnan(speed):
            return {}
        ids, found, heap = columns.node_ids, dict[int, float](), [(begun, int(columns.node_ids[node]), node)]
        while heap:
            now, _, at = heappop(heap)
            if at in found:
                continue
            found[at] = now
            edges = columns.out_edges[columns.offsets[at] : columns.offsets[at + 1]]
            then = (now + self._takes(edges, 1.0, speed)).tolist()
            for time, end in zip(then, columns.targets[edges].tolist(), strict=True):
                if end not in found and time <= 1.0 + SLACK:
                    heappush(heap, (time, int(ids[end]), end))
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
