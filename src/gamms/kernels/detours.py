"""Alternatives to the shortest path between two nodes, found by A* in plain Python."""

from collections.abc import Iterable, Iterator
from heapq import heappop, heappush
from math import inf

from gamms.kernels.paths import Arcs


def simple_paths(arcs: Arcs, rests: memoryview, first: list[int]) -> Iterator[list[int]]:
    """Return the simple paths between two nodes, the shortest first.

    Yen's algorithm (1971): each further path deviates from an earlier path at one node, from where the shortest rest is
    searched that avoids the earlier nodes and the first arcs of earlier paths. As Lawler (1972) noted, a path needs to
    be left only where it left its own parent, or later.

    Args:
        arcs: the graph.
        rests: (nodes,) the distance from each node to the last node.
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
    """An A* search for detours; its heuristic is the distance to the end in the whole graph."""

    def __init__(self, arcs: Arcs, rests: memoryview, end: int) -> None:
        self._offsets, self._ends, self._weights = (column.data for column in arcs)
        self._rests = rests
        self._end = end

    def length(self, path: list[int]) -> float:
        """Return the sum of the weights on a path, added from its end."""
        total = 0.0
        for start, end in zip(path[-2::-1], path[:0:-1], strict=True):
            total += next(weight for row, weight in self._leaving(start) if row == end)
        return total

    def detour(self, start: int, closed: set[int], taken: set[int]) -> list[int] | None:
        """Return the shortest path to the end that avoids the rows `closed` and whose first step is not in `taken`."""
        far = {start: 0.0}
        before = {start: start}
        heap = [(0.0, 0, start, 0.0)]
        while heap:
            _, hops, row, gone = heappop(heap)
            if row == self._end:
                break
            if gone > far[row]:
                continue
            for end, weight in self._leaving(row):
                reached = gone + weight
                rest = self._rests[end]
                if reached >= far.get(end, inf) or rest == inf or end in closed or (row == start and end in taken):
                    continue
                far[end] = reached
                before[end] = row
                heappush(heap, (reached + rest, hops + 1, end, reached))
        else:
            return None
        path = [self._end]
        while path[-1] != start:
            path.append(before[path[-1]])
        return path[::-1]

    def _leaving(self, row: int) -> Iterable[tuple[int, float]]:
        first = self._offsets[row]
        last = self._offsets[row + 1]
        return zip(self._ends[first:last], self._weights[first:last], strict=True)
