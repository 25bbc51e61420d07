"""Shortest paths: distances along edges, and the next step on the way; by SciPy where it is installed.

Of the whole graph by Dijkstra's algorithm, in arrays; for two nodes that are near each other by A*, in Python values.
Matchings of least cost are found by shortest augmenting paths.
"""

from collections.abc import Iterable, Iterator
from functools import cache, lru_cache
from heapq import heapify, heappop, heappush
from itertools import groupby
from math import dist, inf
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np

from gamms.ir.graph import FloatArray, IntArray
from gamms.kernels.csr import chosen_runs

_FEW = 1000  # arcs: below, a heap in Python is done before SciPy has checked its arguments
_FEW_TIES = 1 << 10  # arcs that end paths of equal length: of so few, the paths are followed one by one
_SLACK = 1e-9  # more than rounding adds to the length of a path with a million edges
_LEAST = 1e-150  # what is shorter may have lost digits
_MOST_KEPT = 1 << 16  # nodes whose neighbours are kept as Python values, about 500 bytes each

Neighbours = tuple[tuple[int, float, tuple[float, float]], ...]  # (row, weight, (x, y)) of each


class Arcs(NamedTuple):
    """A weighted directed graph as compressed sparse rows: what leaves row `i` is at `offsets[i]:offsets[i + 1]`."""

    offsets: IntArray  # (nodes + 1,)
    ends: IntArray  # (arcs,)  rows, ascending for each start
    weights: FloatArray  # (arcs,)  not negative, finite


def make_arcs(starts: IntArray, ends: IntArray, weights: FloatArray, nodes: int) -> Arcs:
    """Group edges by their start; of parallel ones the cheapest stays.

    Args:
        starts: (edges,) rows.
        ends: (edges,) rows.
        weights: (edges,) not negative; an infinite one closes its edge.
        nodes: how many rows there are.
    """
    order = np.lexsort((weights, ends, starts))
    order = order[np.isfinite(weights[order])]
    starts, ends, weights = starts[order], ends[order], weights[order]
    is_first = np.ones(len(order), np.bool_)
    is_first[1:] = (starts[1:] != starts[:-1]) | (ends[1:] != ends[:-1])
    offsets = np.zeros(nodes + 1, np.int64)
    np.cumsum(np.bincount(starts[is_first], minlength=nodes), out=offsets[1:])
    return Arcs(offsets, ends[is_first], weights[is_first])


def heap_distances(arcs: Arcs, rows: IntArray, cutoff: float = inf) -> FloatArray:
    """Return the distance of every node from the nearest of some nodes: the specification.

    Dijkstra's algorithm (1959) with a binary heap. The weights of a path are added one by one, from its start: rounding
    never turns a longer sum into a smaller one, so that the result does not depend on the order of the heap, and
    every implementation that adds so finds the same bits.

    Args:
        arcs: the ways; reversed ones give the distances *to* `rows`.
        rows: where to start.
        cutoff: what is farther away than this counts as out of reach.

    Returns:
        (nodes,) infinite where there is no path.
    """
    offsets, ends, weights = (column.tolist() for column in arcs)
    distances = [inf] * (len(offsets) - 1)
    heap = [(0.0, row) for row in rows.tolist()]
    heapify(heap)
    for _, row in heap:
        distances[row] = 0.0
    while heap:
        distance, node = heappop(heap)
        if distance > distances[node]:
            continue
        for arc in range(offsets[node], offsets[node + 1]):
            end, far = ends[arc], distance + weights[arc]
            if far < distances[end] and far <= cutoff:
                distances[end] = far
                heappush(heap, (far, end))
    return np.array(distances)


def tight_arcs(arcs: Arcs, distances: FloatArray) -> Arcs:
    """Return the arcs that shortest paths may use, each of weight 1.

    Args:
        arcs: the ways.
        distances: (nodes,) what `shortest_distances` found along them.
    """
    starts = _starts(arcs)
    reached = distances[starts] + arcs.weights
    is_tight = (reached == distances[arcs.ends]) & np.isfinite(reached)
    ones = np.ones(int(is_tight.sum()))
    return make_arcs(starts[is_tight], arcs.ends[is_tight], ones, len(arcs.offsets) - 1)


def first_steps(tight: Arcs, hops: FloatArray, ids: IntArray) -> IntArray:
    """Return for every node the one before it on its shortest path from the start.

    Of equally long paths the one with the fewest edges counts; of these, the one whose ids, read from the node
    back to the start, are least at the first difference. On reversed arcs that is the next node on the way *to* the
    start.

    Args:
        tight: the arcs that shortest paths may use.
        hops: (nodes,) the least number of tight arcs to each node.
        ids: (nodes,) different numbers.

    Returns:
        (nodes,) rows; -1 for the start itself and where there is no path.
    """
    starts = _starts(tight)
    is_step = hops[starts] + 1.0 == hops[tight.ends]
    starts, ends = starts[is_step], tight.ends[is_step]
    order = np.lexsort((-ids[starts], ends))  # of several, the last one written stays: the least id
    steps = np.full(len(ids), -1, np.int64)
    steps[ends[order]] = starts[order]
    return steps


class Reached(NamedTuple):
    """The nodes that can be reached from several starts: entries by start, then by row."""

    lines: IntArray  # (entries,)  numbers of starts
    rows: IntArray  # (entries,)  of nodes
    far: FloatArray  # (entries,)  distances from the start


class Trees(NamedTuple):
    """The same, with the shortest paths."""

    lines: IntArray
    rows: IntArray
    far: FloatArray
    arcs: IntArray  # (entries,)  the last arc on the path; -1 at the start itself


def route_trees(arcs: Arcs, roots: IntArray, ids: IntArray, cutoff: float = inf) -> Trees:
    """Return what `heap_distances` and `first_steps` say of several starts, all at once.

    On reversed arcs these are the distances to the roots, and the first arcs on the ways there.

    Args:
        arcs: the ways.
        roots: (roots,) rows, each once.
        ids: (nodes,) different numbers.
        cutoff: what is farther away than this counts as out of reach.
    """
    reached = reached_from(arcs, roots, len(ids), cutoff)
    return Trees(*reached, last_arcs(arcs, roots, ids, reached))


def reached_from(arcs: Arcs, roots: IntArray, nodes: int, cutoff: float = inf) -> Reached:
    """Return what `route_trees` returns, without the paths: half of its time or less.

    Args:
        arcs: the ways.
        roots: (roots,) rows, each once.
        nodes: how many rows there are.
        cutoff: as there.
    """
    if len(arcs.ends) < _FEW or not len(roots) or not has_scipy():
        distances = np.array([heap_distances(arcs, root, cutoff) for root in roots[:, None]]).reshape(-1, nodes)
    else:
        distances = _sparse().csgraph.dijkstra(_matrix(arcs), indices=roots, limit=cutoff)
    flat = distances.reshape(-1)
    near = np.flatnonzero(flat < inf)
    lines = near // max(nodes, 1)
    return Reached(lines, near - lines * nodes, flat[near])


def last_arcs(arcs: Arcs, roots: IntArray, ids: IntArray, reached: Reached) -> IntArray:
    """Return the last arcs on the shortest paths, (entries,) those of `Trees`.

    Args:
        arcs: the ways.
        roots: (roots,) rows, each once.
        ids: (nodes,) different numbers.
        reached: what `reached_from` returns of the roots.
    """
    nodes, (lines, rows, far) = len(ids), reached
    near, flat = lines * nodes + rows, np.full(len(roots) * nodes, inf)
    flat[near] = far
    used, runs = chosen_runs(arcs.offsets, rows)
    # The arcs of all roots side by side, as if each had a graph of its own, in which rows are `before` and `after`.
    starts = _starts(arcs)
    before = np.repeat(near, np.diff(runs))
    after = before + (arcs.ends - starts)[used]
    tight = np.flatnonzero(flat[before] + arcs.weights[used] == flat[after])
    before, after, used = before[tight], after[tight], used[tight]
    last: IntArray = np.full(len(flat), -1, np.int64)
    last[after] = used
    begins = np.arange(len(roots)) * nodes + roots
    last[begins] = -1
    counts = np.bincount(after, minlength=len(flat))
    counts[begins] = 0
    among = np.flatnonzero(counts[after] > 1)
    if len(among) > _FEW_TIES or (len(among) and not arcs.weights.all()):
        tied = np.zeros(len(roots), np.bool_)
        tied[after[among] // nodes] = True
        some = tied[before // nodes]
        hops = _fewest_arcs(before[some], after[some], begins[tied], len(flat))
        best = among[hops[before[among]] + 1 == hops[after[among]]]
        best = best[np.argsort(-ids[starts[used[best]]], kind="stable")]  # the last one written stays: the least id
        last[after[best]] = used[best]
    elif len(among):
        among = among[np.lexsort((after[among], flat[after[among]]))]
        ties = zip(after[among].tolist(), ids[starts[used[among]]].tolist(), used[among].tolist(), strict=True)
        _break_ties(last, (starts - arcs.ends).data, begins, ties)
    found: IntArray = last[near]
    return found


def _break_ties(last: IntArray, back: memoryview, begins: IntArray, ties: Iterable[tuple[int, int, int]]) -> None:
    """Write the best last arcs to nodes to which there are several: the fewest arcs from the start, then the least id.

    Args:
        last: (nodes,) the last arc on the path to each node, right for those that are nearer than all ties.
        back: (arcs,) how far the row of the start of an arc is from that of its end.
        begins: rows, to which no arc leads.
        ties: nodes, ids and rows of arcs, by the distance of the node; those of one node follow each other.
    """
    hops = dict.fromkeys(begins.tolist(), 0)
    for node, group in groupby(ties, key=itemgetter(0)):
        options = []
        for _, id, arc in group:
            row, path = node + back[arc], list[int]()
            while row not in hops:
                path.append(row)
                row += back[last[row]]
            for count, passed in enumerate(reversed(path), hops[row] + 1):
                hops[passed] = count
            options.append((hops[node + back[arc]] + 1, id, arc))
        hops[node], _, last[node] = min(options)


def route_tables(arcs: Arcs, roots: IntArray, ids: IntArray, cutoff: float = inf) -> tuple[FloatArray, IntArray]:
    """Return what `route_trees` returns as distances (roots, nodes), infinite where there is no path, and as rows.

    The rows (roots, nodes) are those of the nodes before on the paths, -1 for the roots and where there is no path.
    """
    found, shape = route_trees(arcs, roots, ids, cutoff), (len(roots), len(ids))
    distances: FloatArray = np.full(shape, inf)
    steps: IntArray = np.full(shape, -1, np.int32)  # half the memory
    distances[found.lines, found.rows] = found.far
    is_led = found.arcs >= 0
    steps[found.lines[is_led], found.rows[is_led]] = _starts(arcs)[found.arcs[is_led]]
    return distances, steps


def _starts(arcs: Arcs) -> IntArray:
    """Return the row that each arc leads from."""
    return np.repeat(np.arange(len(arcs.offsets) - 1), np.diff(arcs.offsets))


def _fewest_arcs(starts: IntArray, ends: IntArray, begins: IntArray, nodes: int) -> IntArray:
    """Return how many arcs lead to each node from the nearest of some nodes, (nodes,); -1 where none lead.

    Args:
        starts: (arcs,) rows, ascending.
        ends: (arcs,)
        begins: rows.
        nodes: how many there are.
    """
    offsets = np.concatenate((np.zeros(1, np.int64), np.cumsum(np.bincount(starts, minlength=nodes))))
    hops, reached, count = np.full(nodes, -1), begins, 0
    while len(reached):
        hops[reached] = count
        arcs, _ = chosen_runs(offsets, reached)
        following = ends[arcs]
        following = following[hops[following] < 0]
        count += 1
        hops[following] = count
        reached = np.unique(following)
    return hops


def shortest_distances(arcs: Arcs, rows: IntArray, cutoff: float = inf) -> FloatArray:
    """Return what `heap_distances` returns; by SciPy where it is installed and faster."""
    if len(arcs.ends) < _FEW or len(rows) == 0 or not has_scipy():
        return heap_distances(arcs, rows, cutoff)
    return scipy_distances(arcs, rows, cutoff)


def scipy_distances(arcs: Arcs, rows: IntArray, cutoff: float = inf) -> FloatArray:
    """Return what `heap_distances` returns: Dijkstra with a Fibonacci heap, in C; `rows` must not be empty."""
    found: FloatArray = _sparse().csgraph.dijkstra(_matrix(arcs), indices=np.unique(rows), min_only=True, limit=cutoff)
    return found


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
        bound = _widened(0.0 if source == target else within)
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
                        bound = min(bound, _widened(reached))
                    least = reached + slope * dist(here, place)
                    if least <= bound:
                        heappush(heap, (least, reached, end))
                elif reached == before and end != target:
                    successors[end].append(node)
        return Found(distances, successors, expanded)

    def distances(self, root: int, others: set[int], most: int) -> dict[int, float] | None:
        """Return row -> distance to the root, of others among them; of no node that is farther away than these.

        Dijkstra's algorithm until all others are reached; one that is missing then has no path.

        Args:
            root: row of a node.
            others: rows.
            most: how many nodes may be expanded; None is returned when more are needed.
        """
        left, distances, heap = set(others), {root: 0.0}, [(0.0, root)]
        known = distances.get
        while heap and left:
            far, node = heappop(heap)
            if far > distances[node]:
                continue
            if most <= 0:
                return None
            most -= 1
            left.discard(node)
            for end, weight, _ in self[node]:
                reached = far + weight
                if reached < known(end, inf):
                    distances[end] = reached
                    heappush(heap, (reached, end))
        return distances


def _widened(far: float) -> float:
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


@lru_cache(maxsize=64)  # agents of a team ask for the same
def least_matching(costs: tuple[tuple[float, ...], ...]) -> tuple[int, ...]:
    """Return for each row a column of its own, so that the sum of the costs is least.

    The Hungarian method by shortest augmenting paths (Jonker, Volgenant: A shortest augmenting path algorithm for
    dense and sparse linear assignment problems, 1987). Of equally good matchings it gives always the same, unlike
    different versions of SciPy.

    Args:
        costs: (rows, columns), with as many columns as rows at least; infinite where both must not be matched, which
            is done all the same where nothing else is left.
    """
    if not costs:
        return ()
    table = np.array(costs)
    table[np.isinf(table)] = 2.0 * table[np.isfinite(table)].sum() + 1.0
    rows, columns = table.shape
    row_of, prices, gains = np.full(columns, -1), np.zeros(columns), np.zeros(rows)
    for start in range(rows):
        row, distances, before = start, np.full(columns, inf), np.full(columns, -1)
        column, is_done, passed = -1, np.zeros(columns, np.bool_), 0.0
        while row >= 0:  # until a column is found that has no row yet
            offers = np.where(is_done, inf, passed + table[row] - gains[row] - prices)
            is_less = offers < distances
            distances[is_less], before[is_less] = offers[is_less], column
            column = int(np.argmin(np.where(is_done, inf, distances)))
            passed, is_done[column], row = float(distances[column]), True, int(row_of[column])
        tried = is_done & (row_of >= 0)
        gains[row_of[tried]] += passed - distances[tried]
        gains[start] += passed
        prices[is_done] += distances[is_done] - passed
        while column >= 0:
            previous = int(before[column])
            row_of[column] = start if previous < 0 else row_of[previous]
            column = previous
    found = {int(row): column for column, row in enumerate(row_of.tolist()) if row >= 0}
    return tuple(found[row] for row in range(rows))


def lacks_scipy(arcs: int) -> bool:
    """Return whether SciPy would be faster for so many arcs, and is not installed."""
    return arcs >= _FEW and not has_scipy()


@cache
def has_scipy() -> bool:
    """Return whether SciPy can be imported; tried once."""
    try:
        _sparse()
    except ImportError:
        return False
    return True


def _matrix(arcs: Arcs) -> Any:
    """Return arcs as a sparse matrix."""
    nodes = len(arcs.offsets) - 1
    # Given as rows, not as a list of triples: so explicit zeros stay edges, and nothing is added up.
    parts = arcs.weights, arcs.ends.astype(np.int32), arcs.offsets.astype(np.int32)
    return _sparse().csr_array(parts, (nodes, nodes))


def _sparse() -> Any:
    import scipy.sparse.csgraph

    return scipy.sparse
