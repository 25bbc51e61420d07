"""Which nodes are legal by metres, in what is left of a turn, and by which edges agents go, on the maps of games."""

from collections.abc import Callable, Mapping, Sequence
from heapq import heappop, heappush
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from gamms import kernels
from gamms.game.batch.columns import PlayedGame
from gamms.game.batch.roads import OpenRoads, RoadMap, ValuesOfMaps
from gamms.game.streets import Streets
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray

SLACK = 1e-9  # of a turn, as `core.travel` has it
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


class EdgesBetween:
    """By which edges agents go between nodes and turn round, in games in which other roads are open.

    Args:
        roads: of the games.
        costs: (edges,) of all that may be open; of parallel ones the cheapest is taken, of equal ones the first.
    """

    def __init__(self, roads: OpenRoads, costs: FloatArray) -> None:
        self._roads, self._costs, columns = roads, costs, roads.whole.columns
        self._columns, self._nodes = columns, len(columns.node_ids)
        ways = columns.sources * self._nodes + columns.targets
        self._ways, self._way_of = np.unique(ways, return_inverse=True)
        self._back_of = kernels.rows_of(self._ways, columns.targets * self._nodes + columns.sources)  # ways
        self._offsets, self._edges = kernels.group_rows(self._way_of, len(self._ways))
        self._cheapest, self._back = self._cheapest_on(None, np.arange(len(self._ways))), self._back_on(None, None)
        self._others = ValuesOfMaps(roads, len(self._ways), self._other_cheapest)
        self._other_backs = ValuesOfMaps(roads, len(ways), self._other_backs_on)

    def cheapest(self, starts: IntArray, ends: IntArray, games: IntArray) -> IntArray:
        """Return the rows of the cheapest edges between nodes next to each other in games."""
        ways = np.searchsorted(self._ways, starts * self._nodes + ends)
        return self._others.at(ways, games, self._cheapest[ways])

    def backs(self, edges: IntArray, games: IntArray) -> IntArray:
        """Return the edges by which one turns round on others in games: the first that are as long; -1: none."""
        if not len(self._back):
            return np.full(edges.shape, -1)
        backs: IntArray = self._back[edges]
        if self._roads.are_closed:
            backs = self._other_backs.at(np.maximum(edges, 0), games, backs)
        return np.where(edges >= 0, backs, -1)

    def _other_cheapest(self, roads: RoadMap | None) -> tuple[IntArray, IntArray]:
        ways = np.zeros(0, np.int64) if roads is None else np.unique(self._way_of[roads.touched])
        return ways, self._cheapest_on(roads, ways)

    def _other_backs_on(self, roads: RoadMap | None) -> tuple[IntArray, IntArray]:
        if roads is None:
            return np.zeros(0, np.int64), np.zeros(0, np.int64)
        ways = np.unique(self._back_of[roads.touched])
        places, _ = kernels.chosen_runs(self._offsets, ways[ways >= 0])
        edges = np.sort(self._edges[places])
        return edges, self._back_on(roads, edges)

    def _between(self, roads: RoadMap | None, ways: IntArray) -> tuple[IntArray, IntArray]:
        """Return the open edges of ways on a map, in their order: the places in `ways`, ascending, and rows."""
        places, runs = kernels.chosen_runs(self._offsets, ways)
        which, edges = np.repeat(np.arange(len(ways)), np.diff(runs)), self._edges[places]
        rank = self._roads.ranks_on(roads, edges)
        order = np.lexsort((rank, which))
        order = order[rank[order] >= 0]
        return which[order], edges[order]

    def _cheapest_on(self, roads: RoadMap | None, ways: IntArray) -> IntArray:
        which, edges = self._between(roads, ways)
        order = np.lexsort((np.arange(len(which)), self._costs[edges], which))
        found = np.full(len(ways), -1)
        first = order[np.diff(which[order], prepend=-1) > 0]
        found[which[first]] = edges[first]
        return found

    def _back_on(self, roads: RoadMap | None, edges: IntArray | None) -> IntArray:
        """Return the edges by which one turns round on others, on a map; None: on all."""
        edges, lengths = np.arange(len(self._way_of)) if edges is None else edges, self._columns.lengths
        found, some = np.full(len(edges), -1), np.flatnonzero(self._back_of[edges] >= 0)
        which, others = self._between(roads, self._back_of[edges[some]])
        own = lengths[edges[some[which]]]
        is_like = np.flatnonzero(np.abs(lengths[others] - own) <= SLACK * own)
        first = is_like[np.diff(which[is_like], prepend=-1) > 0]
        found[some[which[first]]] = others[first]
        return found


class Reach:
    """The choices of agents by their speeds; the number of each says where its nodes are kept, and how many there are.

    Args:
        roads: of the games.
        speeds: that agents have; NaN: none, so that they go along one edge in a turn.
        are_endless: which of these lead any distance in a turn.
        takes: returns how many turns shares of edges take at speeds; see `ByMetres.takes`.
    """

    def __init__(
        self,
        roads: OpenRoads,
        speeds: FloatArray,
        are_endless: BoolArray,
        takes: Callable[[Any, Any, Any], FloatArray],
    ) -> None:
        self._roads, self._columns, self._nodes = roads, roads.whole.columns, roads.streets.num_nodes
        self._speeds, self._are_endless, self._takes = speeds, are_endless, takes
        # NOTE: kept, because each agent on an edge looks around in each turn (benchmarks: travel).
        self._arcs: list[dict[int, list[tuple[float, int, int]]]] = [{} for _ in speeds]  # on the map of the start
        self._touched = ValuesOfMaps(roads, self._nodes, self._touched_on)
        self._forget()

    def _touched_on(self, roads: RoadMap | None) -> tuple[IntArray, IntArray]:
        """Return the nodes from which other edges lead on a map than at the start."""
        rows = np.unique(self._columns.sources[np.zeros(0, np.int64) if roads is None else roads.touched])
        return rows, np.ones(len(rows), np.int64)

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

    def from_nodes(self, node: IntArray, kind: IntArray, left: FloatArray, games: IntArray) -> IntArray:
        """Return the choices on nodes, (agents,), by the numbers of speeds, in what is left of the turn, in games."""
        if self._used > _MOST_KNOWN:
            self._forget()
        keys = kind * self._nodes + node
        new = np.unique(keys[self._number[keys] < 0])
        if len(new):
            self._number[new] = self.add([self._reached(key, None) for key in new.tolist()])
        found: IntArray = self._number[keys]
        if self._roads.are_closed:
            self._find_on_maps(found, keys, games)
        late = np.nonzero(left < 1.0)
        if len(late[0]):
            found[late] = self._within(found[late], left[late])
        return found

    def _reached(self, key: int, roads: RoadMap | None) -> dict[int, float]:
        """Return the nodes of a choice on a map, and when each is reached."""
        kind, start = divmod(key, self._nodes)
        near = dict.fromkeys(self.near(start, roads), 0.0)
        return near | self.around(start, kind, 0.0, roads) | near

    def _find_on_maps(self, found: IntArray, keys: IntArray, games: IntArray) -> None:
        """Replace choices that have nodes from which other edges lead in their games than at the start."""
        others, known = np.flatnonzero(self._roads.number[games] > 0), self._on_maps
        which, entries = kernels.expand_ranges(*self._range_of(found[others]))
        is_other = self._touched.at(self._flat[entries], games[others[which]], 0) > 0
        for row in others[np.unique(which[is_other])].tolist():
            game, key = int(games[row]), int(keys[row])
            of_map = int(self._roads.number[game]), key
            if of_map not in known:
                known[of_map] = int(self.add([self._reached(key, self._roads.of(game))])[0])
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

    def _known(self, node: int, kind: int, roads: RoadMap | None) -> dict[int, list[tuple[float, int, int]]]:
        """Return what is kept of arcs from nodes such as this one: on the map of the start, or on another one."""
        if roads is None:
            return self._arcs[kind]
        if "touched" not in roads.shared:
            roads.shared["touched"] = frozenset(self._touched_on(roads)[0].tolist())
        if node not in roads.shared["touched"]:
            return self._arcs[kind]
        known: dict[int, list[tuple[float, int, int]]] = roads.shared.setdefault(("arcs", kind), {})
        return known

    def near(self, node: int, roads: RoadMap | None) -> list[int]:
        """Return a node and those next to it on a map; None: that of the start."""
        return list(self._roads.legal_from(node, roads))

    def around(self, node: int, kind: int, begun: float, roads: RoadMap | None) -> dict[int, float]:
        """Return the nodes within a turn from a node, the first ones first, and when each is reached; see `Travel`."""
        found, heap = dict[int, float](), [(begun, 0, node)]
        if np.isnan(self._speeds[kind]):
            return found
        if self._are_endless[kind]:
            return self._all_from(node, roads)
        while heap:
            now, _, at = heappop(heap)
            if at in found:
                continue
            found[at] = now
            arcs = self._known(at, kind, roads)
            for turns, id, end in arcs.get(at) or self._learn(kind, at, roads, arcs):
                then = now + turns
                if then > 1.0 + SLACK:  # nor will the rest be in reach
                    break
                if end not in found:
                    heappush(heap, (then, id, end))
        return found

    def _all_from(self, node: int, roads: RoadMap | None) -> dict[int, float]:
        """Return all nodes that paths of finite length lead to from a node, ascending; they are reached at once."""
        columns, found, left = self._columns, {node}, [node]
        while left:
            edges = np.array(self._roads.open_from(left.pop(), roads), np.int64)
            new = {*columns.targets[edges[columns.lengths[edges] < np.inf]].tolist()} - found
            found |= new
            left += new
        return dict.fromkeys(sorted(found), 0.0)

    def _learn(
        self, kind: int, node: int, roads: RoadMap | None, known: dict[int, list[tuple[float, int, int]]]
    ) -> list[tuple[float, int, int]]:
        """Return the edges that leave a node as turns, ids and rows of the nodes that they lead to, in this order."""
        columns = self._columns
        edges = np.array(self._roads.open_from(node, roads), np.int64)
        ends = columns.targets[edges]
        parts = self._takes(edges, 1.0, self._speeds[kind]), columns.node_ids[ends], ends
        known[node] = sorted(zip(*(part.tolist() for part in parts), strict=True))
        return known[node]

    def most(self, limit: int) -> int:
        """Return how many nodes are legal at most: on an edge, fewer than from both its ends together."""
        columns, most = self._roads.streets.columns, 1
        for kind in range(len(self._speeds)):
            reached = []
            for node in range(self._nodes):
                reached.append({*self.near(node, None), *self.around(node, kind, 0.0, None)})
                most = max(most, len(reached[-1]))
                if most > limit:
                    return most
            for source, target in zip(columns.sources.tolist(), columns.targets.tolist(), strict=True):
                most = max(most, len(reached[source] | reached[target]))
        return most
