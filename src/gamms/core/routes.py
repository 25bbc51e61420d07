"""Shortest paths along the arcs of a graph, found by Dijkstra's algorithm (1959) from some nodes, the roots.

The weights of a path are added one by one from its root. Rounding never turns a longer sum into a smaller one, so the
distances do not depend on the order in which nodes are visited. Of paths that are equally long the one with the fewest
arcs is best; of these, at each node, the one that comes from the node with the smallest id.
"""

from __future__ import annotations

from gamms.core import travel

INFINITE = float("inf")
SLACK = 1e-9  # more than rounding adds to the length of a path with a million arcs
LEAST = 1e-150  # shorter paths may have lost digits


class Arcs:
    """A directed graph as compressed sparse rows: what leaves row `i` begins at `offsets[first + i]`.

    Attributes:
        offsets: (places + 1,) where the arcs begin that leave the node at each place; those of several graphs with the
            same nodes may follow each other.
        ends: (arcs,) rows of nodes.
        weights: (arcs,) not negative, finite.
        ids: (nodes,) different numbers.
        first: the place of the first node of the graph that is searched.
    """

    def __init__(
        self,
        offsets: memoryview[int],
        ends: memoryview[int],
        weights: memoryview[float],
        ids: memoryview[int],
    ) -> None:
        self.offsets = offsets
        self.ends = ends
        self.weights = weights
        self.ids = ids
        self.first = 0


class Paths:
    """The shortest paths that a search has found.

    Attributes:
        reach: scratch; `seen[:count]` of it are the nodes that were seen, and `when` says how far they are.
        last: (nodes,) the last arc on the path to each node that was seen; -1 of a root.
        before: (nodes,) the node that it leaves; -1 of a root.
        path: (nodes,) gets the rows of nodes on a path.
        count: how many nodes were seen. Those that were not visited may be nearer than `when` says.
    """

    def __init__(
        self, reach: travel.Reach, last: memoryview[int], before: memoryview[int], path: memoryview[int]
    ) -> None:
        self.reach = reach
        self.last = last
        self.before = before
        self.path = path
        self.count = 0


def widened(far: float) -> float:
    """Return a little more than a distance: more than rounding can add to it."""
    return far * (1.0 + SLACK) + LEAST


def find(
    arcs: Arcs,
    paths: Paths,
    roots: memoryview[int],
    goals: memoryview[int],
    most: int,
    within: float,
    is_nearest: bool,
) -> int:
    """Visit the nodes that are nearest to some roots until all goals are; return how many, -1: it would be too many.

    Args:
        arcs: the graph.
        paths: gets the paths to these nodes.
        roots: rows of nodes.
        goals: rows of nodes; -1 for one that is never visited.
        most: how many nodes may be visited.
        within: what is farther away is not reached.
        is_nearest: whether the nearest goals are enough, and those that are as near up to rounding.
    """
    left = list_goals(paths.reach, goals)
    paths.reach.size = 0
    paths.reach.count = 0
    for number in range(len(roots)):
        paths.last[roots[number]] = -1
        paths.before[roots[number]] = -1
        travel.reach_node(paths.reach, roots[number], 0.0, 0)
    visited = 0
    latest = INFINITE
    while paths.reach.size > 0 and left > 0 and paths.reach.when[paths.reach.heap[0]] <= latest:
        if visited >= most:
            visited = -1
            break
        node = travel.visit_first(paths.reach)
        visited += 1
        if paths.reach.listed[node] == paths.reach.search:
            left -= 1
            if is_nearest:
                latest = min(latest, widened(paths.reach.when[node]))
        for arc in range(arcs.offsets[arcs.first + node], arcs.offsets[arcs.first + node + 1]):
            go_along(arcs, paths, node, arc, within)
    paths.count = paths.reach.count
    travel.forget_seen(paths.reach)
    return visited


def list_goals(reach: travel.Reach, goals: memoryview[int]) -> int:
    """List some goals; return how many different ones there are."""
    reach.search += 1
    left = 0
    for number in range(len(goals)):
        if goals[number] < 0:
            left += 1
        elif reach.listed[goals[number]] != reach.search:
            reach.listed[goals[number]] = reach.search
            left += 1
    return left


def go_along(arcs: Arcs, paths: Paths, start: int, arc: int, within: float) -> int:
    """Reach the end of an arc from its start, which was visited, unless a path that is as good leads there."""
    end = arcs.ends[arc]
    place = paths.reach.places[end]
    far = paths.reach.when[start] + arcs.weights[arc]
    rank = paths.reach.rank[start] + 1
    if place < 0 or not far < INFINITE or far > within:
        return 0
    if place > 0:
        if far > paths.reach.when[end]:
            return 0
        if far == paths.reach.when[end]:
            before = paths.before[end]
            is_better = before >= 0 and rank == paths.reach.rank[end] and arcs.ids[start] < arcs.ids[before]
            if rank >= paths.reach.rank[end] and not is_better:
                return 0
    paths.last[end] = arc
    paths.before[end] = start
    return travel.reach_node(paths.reach, end, far, rank)


def trace(paths: Paths, node: int) -> int:
    """Write the nodes on the path from a node that was visited back to its root; return how many there are."""
    count = 0
    while node >= 0:
        paths.path[count] = node
        count += 1
        node = paths.before[node]
    return count
