"""Shortest paths on a graph from one or several root nodes, by Dijkstra's algorithm (1959).

The weights of a path are added one by one from its root. Rounding never makes a longer sum smaller, so the distances do
not depend on the order of visits. Among paths of equal length, one with the fewest arcs is chosen; further ties go, at
each node, to the previous node with the smallest id.
"""

from __future__ import annotations

from gamms.core import travel

INFINITE = float("inf")
SLACK = 1e-9  # relative; rounding adds less to a path of a million arcs
LEAST = 1e-150  # below this length, floats may have lost digits


class Arcs:
    """A directed graph as compressed sparse rows: arcs from row `i` begin at `offsets[first + i]`.

    Attributes:
        offsets: (places + 1,) where the arcs from the node at each place begin; several graphs with the same nodes may
            follow each other.
        ends: (arcs,) rows of nodes.
        weights: (arcs,) nonnegative, finite.
        ids: (nodes,) distinct node ids.
        first: the place of the first node of the graph to search.
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
    """The shortest paths found by a search.

    Attributes:
        reach: working memory; `seen[:count]` are the nodes that were seen, and `when` their distances.
        last: (nodes,) the last arc on the path to each seen node; -1: the node is a root.
        before: (nodes,) the previous node on the path; -1: the node is a root.
        path: (nodes,) receives the rows of the nodes of a path.
        count: the number of seen nodes. Nodes that were not visited may be nearer than `when`.
    """

    def __init__(
        self, reach: travel.ReachSearch, last: memoryview[int], before: memoryview[int], path: memoryview[int]
    ) -> None:
        self.reach = reach
        self.last = last
        self.before = before
        self.path = path
        self.count = 0


def widened(far: float) -> float:
    """Return a distance plus a margin for rounding errors."""
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
    """Visit nodes by distance from the roots until all goals are visited; return the number of visits, or -1.

    Args:
        arcs: the graph.
        paths: receives the paths.
        roots: rows of nodes.
        goals: rows of nodes; -1 stands for a goal that is never visited.
        most: the maximum number of visits; -1 is returned if more are necessary.
        within: the maximum distance; nodes beyond are not reached.
        is_nearest: whether to stop after the nearest goals, including ties up to rounding.
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


def list_goals(reach: travel.ReachSearch, goals: memoryview[int]) -> int:
    """Mark the goals of a search; return the number of different goals."""
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
    """Extend the path of a visited node by an arc, unless the end already has a path that is at least as good."""
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
    """Write the nodes on the path from a visited node back to its root; return their number."""
    count = 0
    while node >= 0:
        paths.path[count] = node
        count += 1
        node = paths.before[node]
    return count
