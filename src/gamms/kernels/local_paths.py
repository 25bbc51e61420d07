"""Shortest paths between nodes that are near each other, and detours: A* and Dijkstra's algorithm in Python values."""

from collections.abc import Iterable, Iterator
from heapq import heappop, heappush
from math import dist, inf
from typing import NamedTuple

import numpy as np

from gamms.ir.graph import FloatArray, IntArray
from gamms.kernels.paths import Arcs

_SLACK = 1e-9  # more than rounding adds to the length of a path with a million edges
_LEAST = 1e-150  # what is shorter may have lost digits
_MOST_KEPT = 1 << 16  # nodes whose neighbours are kept as Python values, about 500 bytes each

Neighbours = tuple[tuple[int, float, tuple[float, float]], ...]  # (row, weight, (x, y)) of each


class Found(NamedTuple):
    """What a search found.

    Attributes:
        distances: row -> distance to the target, exact for every row on a shortest path.
        successors: row -> rows of the next nodes on shortest paths, likewise; some may be given twice.
        expanded: how many nodes were expanded, which is the cost of the search.
    """

    distances: dict[int, float]
    successors: dict[int, list[int]]
    expanded: int


class LocalSearch(dict[int, Neighbours]):
    """Searches from a target to a source by A* (Hart, Nilsson and Raphael, 1968), to the bits of Dijkstra's algorithm.

    As a dict: row -> its neighbours, read from the arrays when a search first comes there.

    Args:
        arcs: the ways, reversed.
        xy: (nodes, 2) where the nodes are.
    """

    def __init__(self, arcs: Arcs, xy: FloatArray) -> None:
        self._offsets, self._ends, self._weights = (column.data for column in arcs)
        self._xy, self._places = xy, xy.data
        self._slope = _least_slope(arcs, xy) * (1.0 - _SLACK)

    def __missing__(self, row: int) -> Neighbours:
        if len(self) >= _MOST_KEPT:
            self.clear()
        first, last = self._offsets[row], self._offsets[row + 1]
        ends = self._ends[first:last].tolist()
        places = [self.place(end) for end in ends]
        found = self[row] = tuple(zip(ends, self._weights[first:last].tolist(), places, strict=True))
        return found

    def place(self, row: int) -> tuple[float, float]:
        """Return the coordinates of a node; all are at one place where the straight line bounds nothing."""
        places = self._places
        return (places[row, 0], places[row, 1]) if self._slope else (0.0, 0.0)

    def least_distances(self, source: int, targets: IntArray) -> FloatArray:
        """Return (targets,) what the ways from a row to others take at least."""
        if not self._slope:
            return np.zeros(len(targets))
        bounds: FloatArray = np.hypot(*(self._xy[targets] - self._xy[source]).T) * self._slope
        return bounds

    def search(self, source: int, target: int, most: int, within: float = inf) -> Found | None:
        """Return the distance from a source and what lies on the shortest paths; None when it takes too long.

        The distances are sums from the target, so the search begins there. A node waits in the heap by its distance
        plus a lower bound of the rest of the way, and is expanded again when its distance falls: so the bound need
        not be consistent after rounding. The search ends when all that waits is longer, by more than rounding can
        add, than the way found: then every node on a shortest path was expanded with its exact distance.

        Args:
            source: row of the first node.
            target: row of the last one.
            most: how many nodes may be expanded.
            within: longer ways are not looked for.
        """
        here, slope = self.place(source), self._slope
        distances, successors = {target: 0.0}, dict[int, list[int]]()
        bound = widened(0.0 if source == target else within)
        heap, expanded, known = [(0.0, 0.0, target)], 0, distances.get
        while heap:
            least, far, node = heappop(heap)
            if least > bound:
                break
            if far > distances[node]:
                continue
            if expanded >= most:
                return None
            expanded += 1
            for end, weight, place in self[node]:
                reached, before = far + weight, known(end, inf)
                if reached < before:
                    distances[end], successors[end] = reached, [node]
                    if end == source:
                        bound = min(bound, widened(reached))
                    least = reached + slope * dist(here, place)
                    if least <= bound:
                        heappush(heap, (least, reached, end))
                elif reached == before and end != target:
                    successors[end].append(node)
        return Found(distances, successors, expanded)

    def distances(
        self,
        roots: Iterable[int],
        most: int,
        *,
        others: set[int] | None = None,
        within: float = inf,
        is_nearest: bool = False,
    ) -> dict[int, float] | None:
        """Return row -> distance to the nearest of some roots, of others among them; of no node farther than these.

        Dijkstra's algorithm until all others are reached; one that is missing then has no path.

        Args:
            roots: rows of nodes.
            most: how many nodes may be expanded; None is returned when more are needed.
            others: rows; None: all.
            within: what is farther away is not reached.
            is_nearest: whether the nearest others are enough, and those that are as near up to rounding.
        """
        left, distances, bound = {-1} if others is None else set(others), dict.fromkeys(roots, 0.0), inf
        heap, known = [(0.0, root) for root in sorted(distances)], distances.get
        while heap and left and heap[0][0] <= bound:
            far, node = heappop(heap)
            if far > distances[node]:
                continue
            if most <= 0:
                return None
            most -= 1
            if is_nearest and node in left:
                bound = min(bound, widened(far))
            left.discard(node)
            for end, weight, _ in self[node]:
                reached = far + weight
                if reached < known(end, inf) and reached <= within:
                    distances[end] = reached
                    heappush(heap, (reached, end))
        return distances


def widened(far: float) -> float:
    """Return a little more than a distance: more than rounding can add to it."""
    return far * (1.0 + _SLACK) + _LEAST


def best_steps(source: int, target: int, found: Found, ids: memoryview) -> dict[int, int]:
    """Return row -> next row, for the rows on the best of the shortest paths; empty where there is no path.

    The one with the fewest edges is the best; of several the one whose ids, read from the source, are least where they
    first differ.
    """
    if source not in found.distances:
        return {}
    steps = dict[int, int]()
    while source != target and len(found.successors[source]) == 1:  # until where paths branch off
        steps[source] = source = found.successors[source][0]
    before: dict[int, set[int]] = {}
    waiting = [source]
    for row in waiting:  # which grows
        for following in found.successors.get(row, ()):
            if following not in before:
                waiting.append(following)
            before.setdefault(following, set()).add(row)
    hops, level = {target: 0}, [target]
    for row in level:  # which grows
        for previous in before.get(row, ()):
            if previous not in hops:
                hops[previous] = hops[row] + 1
                level.append(previous)
    row = source
    while row != target:
        following = min((one for one in found.successors[row] if hops[one] + 1 == hops[row]), key=lambda one: ids[one])
        steps[row] = row = following
    return steps


def simple_paths(arcs: Arcs, rests: memoryview, first: list[int]) -> Iterator[list[int]]:
    """Return the paths without circles between two nodes, the shortest first.

    Yen's algorithm (1971): each later path leaves an earlier one at a node, from where the best way to the end is found
    that leads neither through the nodes before nor along an arc that an earlier path took. As Lawler (1972) noted, a
    path need only be left where it left its own parent, or later.

    Args:
        arcs: the ways.
        rests: (nodes,) the distance of each node to the last one.
        first: rows of the shortest path.
    """
    search = _DetourSearch(arcs, rests, first[-1])
    waiting = [(search.length(first), len(first), first, 0)]
    given: list[list[int]] = []
    while waiting:
        _, _, path, begin = heappop(waiting)
        given.append(path)
        yield path
        for at in range(begin, len(path) - 1):
            taken = {other[at + 1] for other in given if other[: at + 1] == path[: at + 1]}
            detour = search.detour(path[at], set(path[:at]), taken)
            if detour is not None:
                whole = path[:at] + detour
                heappush(waiting, (search.length(whole), len(whole), whole, at))


class _DetourSearch:
    """Searches by A* with the distances of the whole graph to the end, which are what a detour takes at least."""

    def __init__(self, arcs: Arcs, rests: memoryview, end: int) -> None:
        self._offsets, self._ends, self._weights = (column.data for column in arcs)
        self._rests, self._end = rests, end

    def length(self, path: list[int]) -> float:
        """Return the sum of the weights on a path, from its end."""
        total = 0.0
        for start, end in zip(path[-2::-1], path[:0:-1], strict=True):
            total += next(weight for row, weight in self._leaving(start) if row == end)
        return total

    def detour(self, start: int, closed: set[int], taken: set[int]) -> list[int] | None:
        """Return the best path to the end that avoids the rows `closed` and does not step to one `taken` first."""
        far, before = {start: 0.0}, {start: start}
        heap = [(0.0, 0, start, 0.0)]
        while heap:
            _, hops, row, gone = heappop(heap)
            if row == self._end:
                break
            if gone > far[row]:
                continue
            for end, weight in self._leaving(row):
                reached, rest = gone + weight, self._rests[end]
                if reached >= far.get(end, inf) or rest == inf or end in closed or (row == start and end in taken):
                    continue
                far[end], before[end] = reached, row
                heappush(heap, (reached + rest, hops + 1, end, reached))
        else:
            return None
        path = [self._end]
        while path[-1] != start:
            path.append(before[path[-1]])
        return path[::-1]

    def _leaving(self, row: int) -> Iterable[tuple[int, float]]:
        first, last = self._offsets[row], self._offsets[row + 1]
        return zip(self._ends[first:last], self._weights[first:last], strict=True)


def _least_slope(arcs: Arcs, xy: FloatArray) -> float:
    """Return the greatest number that, times the straight line between any two nodes, no way between them is below.

    0 where there is none, or numbers are so large or small that the product may be wrong.
    """
    if not len(xy) or np.abs(xy).max() > 1.0 / _LEAST:
        return 0.0
    starts = np.repeat(np.arange(len(xy)), np.diff(arcs.offsets))
    straight = np.hypot(*(xy[arcs.ends] - xy[starts]).T)
    is_line = straight > 0.0
    if not is_line.any() or straight[is_line].min() < _LEAST:
        return 0.0
    slope = float((arcs.weights[is_line] / straight[is_line]).min())
    return slope if slope < inf else 0.0
