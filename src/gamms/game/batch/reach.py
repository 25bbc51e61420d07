"""The maps of games by metres as the core takes them, and which nodes are legal there in what is left of a turn."""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from gamms import kernels
from gamms.core import travel as core
from gamms.game.batch.columns import PlayedGame, some_rows
from gamms.game.batch.roads import OpenRoads, RoadMap, ValuesOfMaps
from gamms.game.streets import Streets
from gamms.game.travel import SLACK, Reach, map_of
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
    def of(cls, game: PlayedGame, streets: Streets) -> "TravelTerms":
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


class Maps:
    """The maps of games as the core takes them; games share what is equal.

    Args:
        roads: of the games.
        terms: by what agents travel.

    Attributes:
        roads: as given.
    """

    def __init__(self, roads: OpenRoads, terms: TravelTerms) -> None:
        self.roads, self._terms = roads, terms
        self._at_start = self._map(np.zeros(0, np.int64), None)
        self.touched = ValuesOfMaps(roads, roads.streets.num_nodes, self._touched_on)

    def _touched_on(self, roads: RoadMap | None) -> tuple[IntArray, IntArray]:
        """Return the nodes from which other edges lead on a map than at the start."""
        rows = np.unique(self.roads.whole.columns.sources[np.zeros(0, np.int64) if roads is None else roads.touched])
        return rows, np.ones(len(rows), np.int64)

    def _map(self, nodes: IntArray, roads: RoadMap | None) -> core.Roads:
        terms, at_start = self._terms, self.roads.streets.columns
        edges = [self.roads.open_from(node, roads) for node in nodes.tolist()]
        ends = np.cumsum([0, *map(len, edges)])
        patch = nodes, ends, np.array([row for some in edges for row in some], np.int64)
        columns, leaving = self.roads.whole.columns, (at_start.offsets, at_start.out_edges)
        return map_of(columns, terms.costs, terms.seconds, terms.turn_seconds, leaving, patch)

    def of(self, roads: RoadMap | None) -> core.Roads:
        """Return a map; None: that of the start."""
        if roads is None:
            return self._at_start
        if "travel" not in roads.shared:
            roads.shared["travel"] = self._map(self._touched_on(roads)[0], roads)
        found: core.Roads = roads.shared["travel"]
        return found

    def each(self, games: IntArray) -> Iterator[tuple[core.Roads, Any]]:
        """Yield the maps that some games have, and the places of those that have each."""
        if not self.roads.are_closed:
            yield self._at_start, np.s_[:]
            return
        for roads, places in self.roads.by_map(games):
            yield self.of(roads), places

    def backs(self, edges: IntArray, games: IntArray) -> IntArray:
        """Return the edges by which one turns round on others, -1 among them, in games that broadcast; -1: none."""
        flat, found = edges.ravel(), np.empty(edges.size, np.int64)
        for roads, places in self.each(np.broadcast_to(games, edges.shape).ravel()):
            backs = np.empty(len(flat[places]), np.int64)
            core.backs(roads, np.ascontiguousarray(flat[places]).data, backs.data)
            found[places] = backs
        return found.reshape(edges.shape)


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
        maps: of the games.
        speeds: that agents have; NaN: none, so that they go along one edge in a turn.
        goes_on: whether agents on their way go on until they arrive.
    """

    def __init__(self, maps: Maps, speeds: FloatArray, *, goes_on: bool) -> None:
        self._maps, self._roads, self._nodes = maps, maps.roads, maps.roads.streets.num_nodes
        self._speeds, self._goes_on, self._reach = speeds, goes_on, Reach(self._nodes)
        self._forget()

    def _forget(self) -> None:
        self._number = np.full(len(self._speeds) * self._nodes, -1)
        self._on_maps: dict[tuple[int, int], int] = {}  # by the number of the map and the key
        self._flat, self._when, self._used = np.zeros(1 << 10, np.int64), np.zeros(1 << 10), 0

    def counts(self, choices: IntArray) -> IntArray:
        """Return how many nodes choices have."""
        return choices & ((1 << _COUNTED) - 1)

    def nodes(self, choices: IntArray, actions: IntArray) -> IntArray:
        """Return the rows of nodes of choices by their numbers."""
        found: IntArray = self._flat[(choices >> _COUNTED) + actions]
        return found

    def on_nodes(self, node: IntArray, kind: IntArray, left: FloatArray, games: IntArray) -> IntArray:
        """Return the choices on nodes, (agents,), by the numbers of speeds, in what is left of the turn, in games."""
        if self._used > _MOST_KNOWN:
            self._forget()
        keys = kind * self._nodes + node
        new = np.unique(keys[self._number[keys] < 0])
        if len(new):
            self._number[new] = self._learn(self._maps.of(None), self._starts(new))
        found: IntArray = self._number[keys]
        if self._roads.are_closed:
            self._find_on_maps(found, keys, games)
        late = np.nonzero(left < 1.0)
        if len(late[0]):
            found[late] = self._within(found[late], left[late])
        return found

    def on_edges(self, places: Places, games: IntArray) -> IntArray:
        """Return the choices of agents on open edges, in games."""
        found = np.empty(len(games), np.int64)
        for roads, some in self._maps.each(games):
            found[some] = self._learn(roads, some_rows(places, some))
        return found

    def _starts(self, keys: IntArray) -> Places:
        kind, nodes = np.divmod(keys, self._nodes)
        return Places.on_nodes(nodes, self._speeds[kind])

    def _find_on_maps(self, found: IntArray, keys: IntArray, games: IntArray) -> None:
        """Replace choices that have nodes from which other edges lead in their games than at the start."""
        others, known = np.flatnonzero(self._roads.number[games] > 0), self._on_maps
        which, entries = kernels.expand_ranges(*self._range_of(found[others]))
        is_other = self._maps.touched.at(self._flat[entries], games[others[which]], 0) > 0
        for row in others[np.unique(which[is_other])].tolist():
            game, key = int(games[row]), int(keys[row])
            of_map = int(self._roads.number[game]), key
            if of_map not in known:
                roads = self._maps.of(self._roads.of(game))
                known[of_map] = int(self._learn(roads, self._starts(np.array([key])))[0])
            found[row] = known[of_map]

    def _range_of(self, choices: IntArray) -> tuple[IntArray, IntArray]:
        first = choices >> _COUNTED
        return first, first + self.counts(choices)

    def _within(self, choices: IntArray, left: FloatArray) -> IntArray:
        """Return choices without the nodes that are reached later, which are their last ones."""
        first, last = self._range_of(choices)
        rows, entries = kernels.expand_ranges(first, last)
        is_reached = self._when[entries] <= left[rows] + SLACK
        return (first << _COUNTED) + np.bincount(rows[is_reached], minlength=len(first))

    def _learn(self, roads: core.Roads, places: Places) -> IntArray:
        """Keep what is legal for some agents on a map; return the numbers of these choices."""
        counts, first, begin = np.zeros(len(places.node), np.int64), 0, self._used
        views: list[Any] = [np.ascontiguousarray(column).data for column in places]
        while first < len(counts):
            needed = self._used + self._nodes
            if needed > len(self._flat):
                self._flat, self._when = np.resize(self._flat, 2 * needed), np.resize(self._when, 2 * needed)
            room: list[Any] = [column[self._used :].data for column in (self._flat, self._when)]
            last = core.reach_each(*[roads, self._reach.core, first, *views, self._goes_on, *room, counts.data])
            self._used += int(counts[first:last].sum())
            first = last
        numbers: IntArray = ((begin + np.cumsum(counts) - counts) << _COUNTED) + counts
        return numbers

    def most(self, limit: int) -> int:
        """Return how many nodes are legal at most: on an edge, fewer than from both its ends together."""
        columns, roads, most = self._roads.streets.columns, self._maps.of(None), 1
        for speed in self._speeds.tolist():
            reached = list[set[int]]()
            for first in range(0, self._nodes, _AT_ONCE):
                nodes = np.arange(first, min(first + _AT_ONCE, self._nodes))
                used = self._used
                choices = self._learn(roads, Places.on_nodes(nodes, np.full(len(nodes), speed)))
                ranges = zip(*(ends.tolist() for ends in self._range_of(choices)), strict=True)
                reached += [{*self._flat[begin:end].tolist()} for begin, end in ranges]
                self._used = used
                most = max(most, int(self.counts(choices).max()))
                if most > limit:
                    return most
            for source, target in zip(columns.sources.tolist(), columns.targets.tolist(), strict=True):
                most = max(most, len(reached[source] | reached[target]))
        return most
