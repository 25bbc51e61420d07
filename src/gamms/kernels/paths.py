"""Shortest paths: distances along edges and next steps, found by `gamms.core.routes`.

Minimum-cost matchings are found by shortest augmenting paths; alternatives to a shortest path by A* in plain Python.
"""

from collections.abc import Iterable, Iterator
from heapq import heappop, heappush
from math import inf
from typing import Any, NamedTuple

import numpy as np

from gamms.core import routes, travel
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.kernels.csr import expand_ranges, group_rows

_MANY = 1 << 62  # nodes: more than any graph has
_NEVER = np.array([-1])  # a goal that is never reached, so that all nodes are searched
_NO_FARTHER = -1.0  # the search ends at its last goal


class Arcs(NamedTuple):
    """A weighted directed graph as compressed sparse rows: arcs from row `i` are at `offsets[i]:offsets[i + 1]`."""

    offsets: IntArray  # (nodes + 1,)
    ends: IntArray  # (arcs,)  target rows, ascending for each source row
    weights: FloatArray  # (arcs,)  not negative, finite


def make_arcs(starts: IntArray, ends: IntArray, weights: FloatArray, nodes: int) -> Arcs:
    """Group edges by their source; of parallel edges the cheapest is kept.

    Args:
        starts: (edges,) rows.
        ends: (edges,) rows.
        weights: (edges,) not negative; an infinite one closes its edge.
        nodes: the number of rows.
    """
    order = np.lexsort((weights, ends, starts))
    order = order[np.isfinite(weights[order])]
    starts = starts[order]
    ends = ends[order]
    weights = weights[order]
    is_first = np.ones(len(order), np.bool_)
    is_first[1:] = (starts[1:] != starts[:-1]) | (ends[1:] != ends[:-1])
    offsets = np.zeros(nodes + 1, np.int64)
    np.cumsum(np.bincount(starts[is_first], minlength=nodes), out=offsets[1:])
    return Arcs(offsets, ends[is_first], weights[is_first])


class SearchResult(NamedTuple):
    """The nodes reached by a search, in no order."""

    rows: IntArray  # (entries,)
    far: FloatArray  # (entries,)  distances from the nearest root
    arcs: IntArray  # (entries,)  the last arc on the path; -1 at a root
    before: IntArray  # (entries,)  the previous row on the path; -1 at a root


class ShortestPath(NamedTuple):
    """A shortest path; empty if there is no path.

    Attributes:
        rows: rows of its nodes, from a node to the root.
        far: distance of each node from the root.
        visited: the number of visited nodes, which measures the cost of the search.
    """

    rows: list[int]
    far: list[float]
    visited: int


class _SearchBuffers:
    """The arrays that one search writes to: `far` is infinite at nodes that were not reached."""

    def __init__(self, nodes: int) -> None:
        ints = np.zeros((9, nodes), np.int64)
        self.far = np.full(nodes, inf)
        self.last, self.before, self.path, self.seen = ints[:4]
        unused, listed, heap, places, rank = (column.data for column in ints[4:])
        far: Any = self.far.data
        reach = travel.ReachSearch(unused, far, listed, heap, places, far, rank, self.seen.data)
        self.core = routes.Paths(reach, self.last.data, self.before.data, self.path.data)


class Search:
    """Searches along arcs; several may run at once.

    Args:
        arcs: the graph; reversed arcs give the paths *to* roots.
        ids: (nodes,) different numbers, used to break ties. Of equally long paths the one with the fewest edges is
            preferred; of these, the one whose ids, read from the node back to the root, are smallest at the first
            difference.
    """

    def __init__(self, arcs: Arcs, ids: IntArray) -> None:
        ints: list[Any] = [np.ascontiguousarray(column, np.int64).data for column in (arcs.offsets, arcs.ends, ids)]
        weights: Any = np.ascontiguousarray(arcs.weights, np.float64).data
        offsets, ends, numbers = ints
        self._arcs = routes.Arcs(offsets, ends, weights, numbers)
        self._nodes = len(arcs.offsets) - 1
        self._free: list[_SearchBuffers] = []

    def find(self, roots: IntArray, *, within: float = inf) -> SearchResult:
        """Find all nodes within a distance of the nearest of some roots, given as rows."""
        scratch = self._take_buffers()
        routes.find(self._arcs, scratch.core, roots.data, _NEVER.data, _MANY, within, _NO_FARTHER, False)
        rows = scratch.seen[: scratch.core.count].copy()
        found = SearchResult(rows, scratch.far[rows], scratch.last[rows], scratch.before[rows])
        self._release(scratch)
        return found

    def compute_distances(
        self, roots: IntArray, goals: IntArray, *, most: int = _MANY, within: float = inf, is_nearest: bool = False
    ) -> tuple[FloatArray, int]:
        """Return the distance of goals from the nearest of some roots, (goals,), and the number of visited nodes.

        Args:
            roots: rows of nodes.
            goals: rows of nodes; their distance is infinite if there is no path.
            most: limit of visited nodes; if more are needed, -1 is returned as their number.
            within: goals at a greater distance are not reached.
            is_nearest: whether only the nearest goals matter, including ties up to rounding; the distances of others
                may be infinite.
        """
        scratch = self._take_buffers()
        visited = routes.find(self._arcs, scratch.core, roots.data, goals.data, most, within, _NO_FARTHER, is_nearest)
        found = scratch.far[goals]
        self._release(scratch)
        return found, visited

    def find_path(self, row: int, root: int, most: int, within: float) -> ShortestPath:
        """Return the shortest path between a node and a root; `visited` is -1 if it needs more than `most` nodes."""
        scratch = self._take_buffers()
        ends = np.array([root, row])
        visited = routes.find(self._arcs, scratch.core, ends[:1].data, ends[1:].data, most, within, _NO_FARTHER, False)
        path = ShortestPath([], [], visited)
        if visited >= 0 and scratch.far[row] < inf:
            rows = scratch.path[: routes.trace(scratch.core, row)]
            path = ShortestPath(rows.tolist(), scratch.far[rows].tolist(), visited)
        self._release(scratch)
        return path

    def _take_buffers(self) -> _SearchBuffers:
        try:
            return self._free.pop()  # one atomic call, because other threads may search
        except IndexError:
            return _SearchBuffers(self._nodes)

    def _release(self, scratch: _SearchBuffers) -> None:
        scratch.far[scratch.seen[: scratch.core.count]] = inf
        self._free.append(scratch)


class ReachableNodes(NamedTuple):
    """The nodes that can be reached from several starts: entries by start, then by row."""

    lines: IntArray  # (entries,)  indices of starts
    rows: IntArray  # (entries,)  of nodes
    far: FloatArray  # (entries,)  distances from the start
    arcs: IntArray  # (entries,)  the last arc on the path; -1 at the start itself
    before: IntArray  # (entries,)  the previous row on the path; -1 at the start itself


def find_route_trees(arcs: Arcs, roots: IntArray, ids: IntArray, cutoff: float = inf) -> ReachableNodes:
    """Return the nodes that can be reached from several starts, with shortest paths; see `Search`.

    On reversed arcs these are the distances to the roots, and the first arcs of the paths.

    Args:
        arcs: the graph.
        roots: (roots,) distinct rows.
        ids: (nodes,) different numbers, used to break ties.
        cutoff: nodes farther than this are not reached.
    """
    search = Search(arcs, ids)
    parts = [np.zeros((4, 0), np.int64)]
    far = [np.zeros(0)]
    for number in range(len(roots)):
        found = search.find(roots[number : number + 1], within=cutoff)
        order = np.argsort(found.rows)
        line = np.full(len(order), number)
        parts.append(np.stack((line, found.rows[order], found.arcs[order], found.before[order])))
        far.append(found.far[order])
    lines, rows, last, before = np.concatenate(parts, axis=1)
    return ReachableNodes(lines, rows, np.concatenate(far), last, before)


def compute_route_tables(
    arcs: Arcs, roots: IntArray, ids: IntArray, cutoff: float = inf
) -> tuple[FloatArray, IntArray]:
    """Return `find_route_trees` as tables: distances (roots, nodes), infinite if there is no path, and rows.

    The rows (roots, nodes) are the previous nodes on the paths, -1 for the roots and if there is no path.
    """
    found = find_route_trees(arcs, roots, ids, cutoff)
    shape = (len(roots), len(ids))
    distances: FloatArray = np.full(shape, inf)
    steps: IntArray = np.full(shape, -1, np.int32)  # half the memory
    distances[found.lines, found.rows] = found.far
    steps[found.lines, found.rows] = found.before
    return distances, steps


class ForbiddenPaths:
    """Paths that must not be followed, as the automaton of Aho and Corasick (1975).

    The state after a walk is the longest end of it that begins a forbidden path, at least its last edge.

    Args:
        paths: numbers of edges, at least two each.

    Attributes:
        starts: the first edges of the paths.
        begins: all proper beginnings of forbidden paths with more than one edge, in order.
    """

    def __init__(self, paths: Iterable[tuple[int, ...]]) -> None:
        self._paths = frozenset(paths)
        self.starts = frozenset(path[0] for path in self._paths)
        self.begins = dict.fromkeys(path[:end] for path in sorted(self._paths) for end in range(2, len(path)))

    def step(self, state: tuple[int, ...], edge: int) -> tuple[int, ...] | None:
        """Return the state after one more edge; None: it would complete a forbidden path."""
        walk = (*state, edge)
        ends = [walk[first:] for first in range(len(walk))]
        if not self._paths.isdisjoint(ends):
            return None
        return next((end for end in ends if end in self.begins), ends[-1])


class TurnStates(NamedTuple):
    """The states of traffic that obeys forbidden paths, and the steps between them.

    Rows below the number of edges are "on this edge", which is all that matters there; further rows are beginnings of
    forbidden paths with more edges.
    """

    edges: IntArray  # (states,)  the last edge
    starts: IntArray  # (steps,)  states
    ends: IntArray  # (steps,)  states


def make_turn_states(
    sources: IntArray,
    targets: IntArray,
    lengths: FloatArray,
    is_open: BoolArray,
    forbidden: ForbiddenPaths,
) -> TurnStates:
    """Return the states of traffic on a graph.

    Traffic turns back, onto an edge with the same ends and length, only where no other edge may be taken. It takes no
    edge from a node to itself.

    Args:
        sources: (edges,) rows of nodes.
        targets: (edges,) rows of nodes.
        lengths: (edges,)
        is_open: (edges,) whether traffic may use the edge.
        forbidden: paths of rows of edges.
    """
    count = len(sources)
    nodes = int(max(sources.max(initial=-1), targets.max(initial=-1))) + 1
    rows = np.flatnonzero(is_open)
    going = rows[sources[rows] != targets[rows]]
    offsets, order = group_rows(sources[going], nodes)
    leaving = going[order]
    before, places = expand_ranges(offsets[targets[rows]], offsets[targets[rows] + 1])
    starts = rows[before]
    ends = leaving[places]
    is_back = (sources[starts] == targets[ends]) & (lengths[starts] == lengths[ends])
    has_others = np.bincount(starts[~is_back], minlength=count) > 0
    is_plain = ~np.isin(starts, [*forbidden.starts]) & (~is_back | ~has_others[starts])
    number = {begin: count + place for place, begin in enumerate(forbidden.begins)}
    steps: list[tuple[int, int]] = []
    special = [(edge,) for edge in sorted(forbidden.starts) if is_open[edge]]
    for state in (*special, *forbidden.begins):
        last = state[-1]
        onward = leaving[offsets[targets[last]] : offsets[targets[last] + 1]].tolist()
        back = [edge for edge in onward if targets[edge] == sources[last] and lengths[edge] == lengths[last]]
        for edges in ([edge for edge in onward if edge not in back], back):
            found = [after for edge in edges if (after := forbidden.step(state, edge)) is not None]
            if found:
                steps += [(number.get(state, last), number.get(after, after[-1])) for after in found]
                break
    some = np.array(steps, np.int64).reshape(-1, 2)
    last_edges = [begin[-1] for begin in forbidden.begins]
    return TurnStates(
        np.concatenate((np.arange(count), np.array(last_edges, np.int64))),
        np.concatenate((starts[is_plain], some[:, 0])),
        np.concatenate((ends[is_plain], some[:, 1])),
    )


def find_edges_without_turn(
    sources: IntArray, targets: IntArray, lengths: FloatArray, is_open: BoolArray, paths: Iterable[tuple[int, ...]]
) -> IntArray:
    """Return the open edges after which traffic that obeys forbidden paths may take no edge; see `make_turn_states`."""
    states = make_turn_states(sources, targets, lengths, is_open, ForbiddenPaths(paths))
    count = len(states.edges)
    is_taken = is_open & (sources != targets)
    is_last = is_taken[states.edges] & (np.bincount(states.starts, minlength=count) == 0)
    is_last[len(sources) :] &= np.bincount(states.ends, minlength=count)[len(sources) :] > 0
    return np.unique(states.edges[is_last])


def find_least_matching(costs: FloatArray) -> list[int]:
    """Return a different column for each row, so that the sum of the costs is minimal.

    The Hungarian method by shortest augmenting paths (Jonker, Volgenant: A shortest augmenting path algorithm for dense
    and sparse linear assignment problems, 1987). Of equally good matchings it always returns the same one, unlike
    different versions of SciPy.

    Args:
        costs: (rows, columns), with at least as many columns as rows; infinite for pairs to avoid, which are matched
            only if nothing else is left.
    """
    table = costs.copy()
    table[np.isinf(table)] = 2.0 * table[np.isfinite(table)].sum() + 1.0
    rows, columns = table.shape
    row_of = np.full(columns, -1)
    prices = np.zeros(columns)
    gains = np.zeros(rows)
    for start in range(rows):
        row = start
        distances = np.full(columns, inf)
        before = np.full(columns, -1)
        column = -1
        is_done = np.zeros(columns, np.bool_)
        passed = 0.0
        while row >= 0:  # until a column without a row is found
            offers = np.where(is_done, inf, passed + table[row] - gains[row] - prices)
            is_less = offers < distances
            distances[is_less] = offers[is_less]
            before[is_less] = column
            column = int(np.argmin(np.where(is_done, inf, distances)))
            passed = float(distances[column])
            is_done[column] = True
            row = int(row_of[column])
        tried = is_done & (row_of >= 0)
        gains[row_of[tried]] += passed - distances[tried]
        gains[start] += passed
        prices[is_done] += distances[is_done] - passed
        while column >= 0:
            previous = int(before[column])
            row_of[column] = start if previous < 0 else row_of[previous]
            column = previous
    found = {int(row): column for column, row in enumerate(row_of.tolist()) if row >= 0}
    return [found[row] for row in range(rows)]


def find_simple_paths(arcs: Arcs, rests: memoryview, first: list[int]) -> Iterator[list[int]]:
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
    waiting = [(search.measure_path(first), len(first), first, 0)]
    given: list[list[int]] = []
    while waiting:
        _, _, path, begin = heappop(waiting)
        given.append(path)
        yield path
        for at in range(begin, len(path) - 1):
            taken = {other[at + 1] for other in given if other[: at + 1] == path[: at + 1]}
            detour = search.find_detour(path[at], set(path[:at]), taken)
            if detour is not None:
                whole = path[:at] + detour
                heappush(waiting, (search.measure_path(whole), len(whole), whole, at))


class _DetourSearch:
    """An A* search for detours; its heuristic is the distance to the end in the whole graph."""

    def __init__(self, arcs: Arcs, rests: memoryview, end: int) -> None:
        self._offsets, self._ends, self._weights = (column.data for column in arcs)
        self._rests = rests
        self._end = end

    def measure_path(self, path: list[int]) -> float:
        """Return the sum of the weights on a path, added from its end."""
        total = 0.0
        for start, end in zip(path[-2::-1], path[:0:-1], strict=True):
            total += next(weight for row, weight in self._list_leaving(start) if row == end)
        return total

    def find_detour(self, start: int, closed: set[int], taken: set[int]) -> list[int] | None:
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
            for end, weight in self._list_leaving(row):
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

    def _list_leaving(self, row: int) -> Iterable[tuple[int, float]]:
        first = self._offsets[row]
        last = self._offsets[row + 1]
        return zip(self._ends[first:last], self._weights[first:last], strict=True)
