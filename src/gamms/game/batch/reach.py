"""By what agents travel by metres, and which nodes are legal for them in what is left of a turn."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from gamms import kernels
from gamms.core import travel as core
from gamms.game.batch.columns import PlayedGame
from gamms.game.streets import StreetGraph
from gamms.game.travel import SLACK, ReachableNodes
from gamms.ir.graph import FloatArray, IntArray

_MOST_KNOWN = 1 << 22  # nodes that are kept
_AT_ONCE = 1 << 12  # nodes at which the most legal ones are looked for
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
    def of(cls, game: PlayedGame, streets: StreetGraph) -> "TravelTerms":
        """Return those of a game by metres, on such streets."""
        settings = game.settings()
        weight, is_by_seconds = settings["weight"], settings["speed_unit"] == "metres_per_second"
        costs = np.asarray(streets.weights(weight), np.float64)
        seconds = costs if weight == "travel_time" and is_by_seconds else None
        return cls(weight, costs, seconds, seconds_of_turn(settings) or 1.0, settings["decide"] == "arrival")


def seconds_of_turn(settings: Mapping[str, Any]) -> float | None:
    """Return how long a turn of a game lasts, in the time of speeds by metres; None: speeds count edges."""
    lasts: dict[str, float | None] = {"edges": None, "metres": 1.0, "metres_per_second": settings["turn_seconds"]}
    return lasts[settings["speed_unit"]]


class Places(NamedTuple):
    """Where agents are that look around, (agents,); see `core.reachable`."""

    node: IntArray
    edge: IntArray
    share: FloatArray
    motion: IntArray
    speed: FloatArray
    now: FloatArray

    @classmethod
    def on_nodes(cls, nodes: IntArray, speed: FloatArray) -> "Places":
        """Return those of agents on nodes where a turn begins."""
        number, zeros = len(nodes), np.zeros(len(nodes))
        return cls(nodes, np.full(number, -1), zeros, np.zeros(number, np.int64), speed, zeros)


class Choices:
    """The choices of agents by their speeds; the number of each says where its nodes are kept, and how many there are.

    Args:
        roads: the map as the core takes it.
        streets: of the map.
        speeds: that agents have; NaN: none, so that they go along one edge in a turn.
        goes_on: whether agents on their way go on until they arrive.
    """

    def __init__(self, roads: core.RoadEdges, streets: StreetGraph, speeds: FloatArray, *, goes_on: bool) -> None:
        self._roads = roads
        self._streets = streets
        self._nodes = streets.num_nodes
        self._speeds = speeds
        self._goes_on = goes_on
        self._reach = ReachableNodes(self._nodes)
        self._forget()

    def _forget(self) -> None:
        self._number = np.full(len(self._speeds) * self._nodes, -1)
        self._flat, self._when, self._used = np.zeros(1 << 10, np.int64), np.zeros(1 << 10), 0

    def counts(self, choices: IntArray) -> IntArray:
        """Return how many nodes choices have."""
        return choices & ((1 << _COUNTED) - 1)

    def nodes(self, choices: IntArray, actions: IntArray) -> IntArray:
        """Return the rows of nodes of choices by their numbers."""
        found: IntArray = self._flat[(choices >> _COUNTED) + actions]
        return found

    def on_nodes(self, node: IntArray, kind: IntArray, left: FloatArray) -> IntArray:
        """Return the choices on nodes, (agents,), by the numbers of speeds, in what is left of the turn."""
        if self._used > _MOST_KNOWN:
            self._forget()
        keys = kind * self._nodes + node
        new = np.unique(keys[self._number[keys] < 0])
        if len(new):
            self._number[new] = self._learn(self._starts(new))
        found: IntArray = self._number[keys]
        late = np.nonzero(left < 1.0)
        if len(late[0]):
            found[late] = self._within(found[late], left[late])
        return found

    def on_edges(self, places: Places) -> IntArray:
        """Return the choices of agents on edges."""
        return self._learn(places)

    def _starts(self, keys: IntArray) -> Places:
        kind, nodes = np.divmod(keys, self._nodes)
        return Places.on_nodes(nodes, self._speeds[kind])

    def _range_of(self, choices: IntArray) -> tuple[IntArray, IntArray]:
        first = choices >> _COUNTED
        return first, first + self.counts(choices)

    def _within(self, choices: IntArray, left: FloatArray) -> IntArray:
        """Return choices without the nodes that are reached later, which are their last ones."""
        first, last = self._range_of(choices)
        rows, entries = kernels.expand_ranges(first, last)
        is_reached = self._when[entries] <= left[rows] + SLACK
        return (first << _COUNTED) + np.bincount(rows[is_reached], minlength=len(first))

    def _learn(self, places: Places) -> IntArray:
        """Keep what is legal for some agents; return the numbers of these choices."""
        counts, first, begin = np.zeros(len(places.node), np.int64), 0, self._used
        views: list[Any] = [np.ascontiguousarray(column).data for column in places]
        while first < len(counts):
            needed = self._used + self._nodes
            if needed > len(self._flat):
                self._flat, self._when = np.resize(self._flat, 2 * needed), np.resize(self._when, 2 * needed)
            room: list[Any] = [column[self._used :].data for column in (self._flat, self._when)]
            last = core.reach_each(*[self._roads, self._reach.core, first, *views, self._goes_on, *room, counts.data])
            self._used += int(counts[first:last].sum())
            first = last
        numbers: IntArray = ((begin + np.cumsum(counts) - counts) << _COUNTED) + counts
        return numbers

    def most(self, limit: int) -> int:
        """Return how many nodes are legal at most: on an edge, fewer than from both its ends together."""
        columns, most = self._streets.columns, 1
        for speed in self._speeds.tolist():
            reached = list[set[int]]()
            for first in range(0, self._nodes, _AT_ONCE):
                nodes = np.arange(first, min(first + _AT_ONCE, self._nodes))
                used = self._used
                choices = self._learn(Places.on_nodes(nodes, np.full(len(nodes), speed)))
                ranges = zip(*(ends.tolist() for ends in self._range_of(choices)), strict=True)
                reached += [{*self._flat[begin:end].tolist()} for begin, end in ranges]
                self._used = used
                most = max(most, int(self.counts(choices).max()))
                if most > limit:
                    return most
            for source, target in zip(columns.sources.tolist(), columns.targets.tolist(), strict=True):
                most = max(most, len(reached[source] | reached[target]))
        return most
