"""Shortest paths on a graph from one or several root nodes, by Dijkstra's algorithm (1959).

The weights of a path are added one by one from its root. Rounding never makes a longer sum smaller, so the distances do
not depend on the order of visits. Among paths of equal length, one with the fewest arcs is chosen; further ties go, at
each node, to the previous node with the smallest id.
"""

from __future__ import annotations

from array import array

from gamms.core import travel

try:
    import cython  # type: ignore[import-untyped]
except ImportError:  # Cython is not needed to run the text
    from contextlib import nullcontext
    from types import SimpleNamespace

    cython = SimpleNamespace(nogil=nullcontext())

INFINITE = float("inf")
NOT_KNOWN = -1.0  # a distance not computed yet
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


def widen_distance(far: float) -> float:
    """Return a distance plus a margin for rounding errors."""
    return far * (1.0 + SLACK) + LEAST


def find(
    arcs: Arcs,
    paths: Paths,
    roots: memoryview[int],
    goals: memoryview[int],
    most: int,
    within: float,
    least: float,
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
        least: the distance up to which nodes are visited even after all goals; below 0: none are.
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
    while paths.reach.size > 0 and paths.reach.when[paths.reach.heap[0]] <= (latest if left > 0 else least):
        if visited >= most:
            visited = -1
            break
        node = travel.visit_first(paths.reach)
        visited += 1
        if paths.reach.listed[node] == paths.reach.search:
            left -= 1
            if is_nearest:
                latest = min(latest, widen_distance(paths.reach.when[node]))
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


# -- paths to many targets -------------------------------------------------------------------------------------------


class PathTables:
    """Shortest paths from all nodes to target nodes, computed on first use.

    Ties are broken as in `travel.GoalPaths`; the cost is the length.

    Attributes:
        ids: (nodes,) the id of each row.
        arcs: the reversed edges of all maps; `arcs.first` is the place of the first node of the current map, see
            `moves.LegalMoves`.
        paths: working memory.
        tables: (places,) the table number of the target at each place; -1: none.
        targets: (room,) the place of the target of each table; -1: the map is no longer used.
        far: (room * nodes,) the distance from each node to the target; infinity: no path.
        following: (room * nodes,) the next node on the path.
        radius: (room,) the distance up to which paths to the target are known.
        count: the number of tables.
    """

    def __init__(
        self,
        ids: memoryview[int],
        offsets: memoryview[int],
        tails: memoryview[int],
        costs: memoryview[float],
        paths: Paths,
        far: memoryview[float],
        following: memoryview[int],
    ) -> None:
        self.ids = ids
        self.paths = paths
        self.root = memoryview(array("q", [0]))
        self.goal = memoryview(array("q", [0]))
        self.tables = memoryview(array("q"))
        self.targets = memoryview(array("q"))
        self.radius: memoryview[float] = memoryview(array("d"))
        self.count = 0
        self.take(offsets, tails, costs, far, following, self.targets)

    def take(
        self,
        offsets: memoryview[int],
        tails: memoryview[int],
        costs: memoryview[float],
        far: memoryview[float],
        following: memoryview[int],
        moved: memoryview[int],
    ) -> None:
        """Switch to other maps, and keep the tables of maps that remain.

        `moved` has the new first place of each old map, or -1 if it is gone. The edges into the node at each place
        begin at `offsets`; `tails` are their source nodes, `costs` their lengths. `far` and `following` begin with the
        old entries.
        """
        nodes = max(len(self.ids), 1)
        self.arcs = Arcs(offsets, tails, costs, self.ids)
        self.far = far
        self.following = following
        self.tables = memoryview(array("q", [-1] * (len(offsets) - 1)))
        targets = memoryview(array("q", bytes(8 * (len(far) // nodes))))
        radius: memoryview[float] = memoryview(array("d", bytes(8 * (len(far) // nodes))))
        for table in range(self.count):
            place = self.targets[table]
            targets[table] = -1
            radius[table] = self.radius[table]
            if place >= 0 and moved[place // nodes] >= 0:
                targets[table] = moved[place // nodes] + place % nodes
                self.tables[targets[table]] = table
        self.targets = targets
        self.radius = radius

    def find_index(self, node: int, target: int) -> int:
        """Return the index in `far` and `following` for a path from a node to a target."""
        if self.tables[self.arcs.first + target] < 0:
            self.begin(self.arcs.first + target)
        place = self.tables[self.arcs.first + target] * len(self.ids) + node
        if self.far[place] == NOT_KNOWN:
            self.find(target, node)
        return place

    def begin(self, place: int) -> int:
        """Add a table for the target at a place; if there is no room, delete all older tables."""
        if self.count == len(self.targets):
            for table in range(self.count):
                if self.targets[table] >= 0:
                    self.tables[self.targets[table]] = -1
            self.count = 0
        self.tables[place] = self.count
        self.targets[self.count] = place
        self.radius[self.count] = 0.0
        first = self.count * len(self.ids)
        self.count += 1
        for node in range(len(self.ids)):
            self.far[first + node] = NOT_KNOWN
        return 0

    def find(self, target: int, node: int) -> int:
        """Search paths to a target from all nodes up to the distance of a node; -1: from all nodes.

        Each search of a target goes at least twice as far as the one before, so that there are few of them.
        """
        table = self.tables[self.arcs.first + target]
        first = table * len(self.ids)
        self.root[0] = target
        self.goal[0] = node
        least = 2.0 * self.radius[table]
        find(self.arcs, self.paths, self.root, self.goal, len(self.ids), INFINITE, least, False)
        is_whole = self.paths.reach.size == 0
        if not is_whole:
            self.radius[table] = self.paths.reach.when[self.paths.reach.heap[0]]
        for number in range(self.paths.count):
            at = self.paths.reach.seen[number]
            if is_whole or at == node or self.paths.reach.when[at] < self.radius[table]:
                self.far[first + at] = self.paths.reach.when[at]
                self.following[first + at] = self.paths.before[at]
        if is_whole:
            for place in range(first, first + len(self.ids)):
                if self.far[place] == NOT_KNOWN:
                    self.far[place] = INFINITE
        return 0

    def fill(self, target: int) -> int:
        """Search paths to a target from all nodes, unless there is a table for it."""
        if self.tables[self.arcs.first + target] < 0:
            self.begin(self.arcs.first + target)
            self.find(target, -1)
        return 0

    def get_distance(self, node: int, target: int) -> float:
        """Return the distance from a node to a target; infinity if there is no path."""
        return self.far[self.find_index(node, target)]


def find_distances(
    ways: PathTables, order: memoryview[int], nodes: memoryview[int], targets: memoryview[int], found: memoryview[float]
) -> int:
    """Write the distance from each node to its target, (queries,); queries are answered in a given order."""
    for place in range(len(order)):
        number = order[place]
        ways.fill(targets[number])
        found[number] = ways.get_distance(nodes[number], targets[number])
    return 0


def find_actions(
    ways: PathTables,
    offsets: memoryview[int],
    legal: memoryview[int],
    order: memoryview[int],
    nodes: memoryview[int],
    targets: memoryview[int],
    allowed: memoryview[int],
    found: memoryview[int],
) -> int:
    """Write the number of the legal node to which each node's path to its target leads in one move; -1: no path.

    Args:
        ways: the paths.
        offsets: (nodes + 1,) where the legal nodes of each node begin in `legal`.
        legal: rows of nodes.
        order: the order in which the queries are answered.
        nodes: (queries,) rows of nodes.
        targets: (queries,) rows of nodes.
        allowed: (nodes,) 1: the node may be entered; empty: all may.
        found: (queries,) receives the numbers.
    """
    for place in range(len(order)):
        number = order[place]
        ways.fill(targets[number])
        first = offsets[nodes[number]]
        count = offsets[nodes[number] + 1] - first
        node = find_next_node(ways, legal, first, count, nodes[number], targets[number], allowed)
        if node >= 0 and len(allowed) > 0 and not allowed[node]:
            node = nodes[number]
        found[number] = find_number(legal, first, count, node)
    return 0


def find_next_node(
    ways: PathTables, legal: memoryview[int], first: int, count: int, node: int, target: int, allowed: memoryview[int]
) -> int:
    """Return the node that an agent moves to in one move on its path from a node to a target; -1: no path.

    It moves to the target if that is legal, otherwise along the path, see `count_steps`, up to the first node that is
    not allowed.

    Args:
        ways: the paths.
        legal: rows of nodes; the legal ones are the `count` entries from index `first`.
        first: see `legal`.
        count: see `legal`.
        node: the row of the agent's node.
        target: the row of its target.
        allowed: see `find_actions`.
    """
    if find_number(legal, first, count, target) >= 0:
        return target
    if not ways.get_distance(node, target) < INFINITE:
        return -1
    ways.paths.path[0] = node
    last = node
    length = 1
    edges = 0
    steps = 0
    while steps == edges:  # all known nodes are legal: more may be
        edges += 2
        while length <= edges:
            last = ways.following[ways.find_index(last, target)]
            if last < 0 or (len(allowed) > 0 and not allowed[last]):
                break
            ways.paths.path[length] = last
            length += 1
        steps = count_steps(ways.paths.path, length, legal, first, count)
    return ways.paths.path[steps]


def count_steps(path: memoryview[int], length: int, legal: memoryview[int], first: int, count: int) -> int:
    """Return how many steps along a path an agent takes in one move: as many as lead to legal nodes, one by one.

    Args:
        path: nodes, the agent's own first.
        length: how many of them are the path.
        legal: nodes; the legal ones are the `count` entries from index `first`.
        first: see `legal`.
        count: see `legal`.
    """
    steps = 0
    while steps + 1 < length and find_number(legal, first, count, path[steps + 1]) >= 0:
        steps += 1
    return steps


def find_number(legal: memoryview[int], first: int, count: int, node: int) -> int:
    """Return the number of a node among `count` legal nodes from index `first` on; -1: it is not legal."""
    for number in range(count):
        if legal[first + number] == node:
            return number
    return -1


# -- distances to nodes nearby -----------------------------------------------------------------------------------------


class NodesByX:
    """The nodes of maps by ascending x, so that those near a node are found on both sides of it.

    Attributes:
        order: (nodes,) rows of nodes, by ascending x on each map; the maps follow each other.
        xy: (2 * nodes,) x and y of each node, map units.
        found: (nodes,) the rows that were found last.
    """

    def __init__(self, order: memoryview[int], xy: memoryview[float], found: memoryview[int]) -> None:
        self.order = order
        self.xy = xy
        self.found = found

    def find(self, rank: int, begin: int, end: int, square: float) -> int:
        """Write the nodes around the node of a rank, itself included, to `found`; return their number."""
        here = self.order[rank]
        self.found[0] = here
        count = 1
        for side in range(-1, 2, 2):
            other = rank + side
            while begin <= other < end:
                node = self.order[other]
                dx = self.xy[2 * node] - self.xy[2 * here]
                dy = self.xy[2 * node + 1] - self.xy[2 * here + 1]
                if dx * dx > square:
                    break
                if dx * dx + dy * dy <= square:
                    self.found[count] = node
                    count += 1
                other += side
        return count


class NearbyDistances:
    """Distances by road to target nodes, from the nodes around each of them; searched once, then looked up.

    Attributes:
        arcs: the reversed edges of all maps, one after the other; a place is the number of a node among their nodes.
        paths: working memory.
        first, counts: (places,) the entries of the target at each place are `counts[place]` from `first[place]` on.
        radius: (places,) the distance below which all nodes have an entry.
        nodes: (room,) rows of nodes, ascending for each target.
        far: (room,) their distances.
        used: the number of entries in use; when there is no room for more, all are searched again on demand.
        farthest: the distance that stands for all that are longer, and for nodes without a path.
    """

    def __init__(
        self,
        ids: memoryview[int],
        offsets: memoryview[int],
        tails: memoryview[int],
        costs: memoryview[float],
        paths: Paths,
        nodes: memoryview[int],
        far: memoryview[float],
        farthest: float,
    ) -> None:
        self.paths = paths
        self.root = memoryview(array("q", [0]))
        self.goal = memoryview(array("q", [0]))
        self.nodes = nodes
        self.far = far
        self.farthest = farthest
        self.take(ids, offsets, tails, costs)

    def take(
        self,
        ids: memoryview[int],
        offsets: memoryview[int],
        tails: memoryview[int],
        costs: memoryview[float],
    ) -> None:
        """Switch to other maps; their distances are searched on demand. See `PathTables.take`."""
        places = len(offsets) - 1
        self.arcs = Arcs(offsets, tails, costs, ids)
        self.first = memoryview(array("q", bytes(8 * places)))
        self.counts = memoryview(array("q", bytes(8 * places)))
        self.radius: memoryview[float] = memoryview(array("d", bytes(8 * places)))
        self.used = 0

    def look_up(self, place: int, node: int) -> float:
        """Return the distance from a node to the target at a place; `NOT_KNOWN`: it was not searched."""
        low = self.first[place]
        if self.counts[place] == len(self.arcs.ids):
            return self.far[low + node]
        end = low + self.counts[place]
        high = end
        while low < high:
            middle = (low + high) // 2
            if self.nodes[middle] < node:
                low = middle + 1
            else:
                high = middle
        if low < end and self.nodes[low] == node:
            return self.far[low]
        return self.farthest if self.radius[place] >= self.farthest else NOT_KNOWN

    def search(self, base: int, target: int, node: int) -> int:
        """Search the distances to a target from all nodes up to the distance of a node.

        Each search of a target goes at least twice as far as the one before, so that there are few of them.

        Args:
            base: the place of the first node of the map.
            target: the row of the target.
            node: the row of the node.
        """
        least = 2.0 * self.radius[base + target]
        self.arcs.first = base
        self.root[0] = target
        self.goal[0] = node
        find(self.arcs, self.paths, self.root, self.goal, len(self.arcs.ids), self.farthest, least, False)
        radius = self.farthest
        if self.paths.reach.size > 0:
            radius = self.paths.reach.when[self.paths.reach.heap[0]]
        return self.keep(base + target, node, radius)

    def keep(self, place: int, node: int, radius: float) -> int:
        """Replace the entries of the target at a place by those of the last search."""
        if self.used + self.paths.count > len(self.nodes):
            self.used = 0
            for other in range(len(self.counts)):
                self.counts[other] = 0
                self.radius[other] = 0.0
        count = 0
        for number in range(self.paths.count):
            at = self.paths.reach.seen[number]
            if at == node or self.paths.reach.when[at] < radius or radius >= self.farthest:
                self.nodes[self.used + count] = at
                count += 1
        sort_part(self.nodes, self.used, count)
        for number in range(self.used, self.used + count):
            self.far[number] = self.paths.reach.when[self.nodes[number]]
        self.first[place] = self.used
        self.counts[place] = count
        self.radius[place] = radius
        self.used += count
        return 0

    def find_all(self, near: NodesByX, begin: int, end: int, square: float) -> int:
        """Search the distances to some nodes of the first map, from all nodes around them, without the GIL.

        If there is no room for them, they are left to `search`.

        Args:
            near: finds the nodes around a node.
            begin: the first row of the nodes; all are on one map.
            end: the row behind the last one.
            square: the squared radius around a node, map units.
        """
        with cython.nogil:
            room = len(self.nodes) - self.used
            for rank in range(begin, end):
                room -= near.find(rank, begin, end, square)
                if room < 0:
                    return 0
            for rank in range(begin, end):
                self.find_around(near, near.order[rank], near.find(rank, begin, end, square))
        return 0

    def find_around(self, near: NodesByX, target: int, count: int) -> int:
        """Search the distances to a target from the first `count` of `near.found`."""
        self.arcs.first = 0
        self.root[0] = target
        for number in range(count):
            self.nodes[self.used + number] = near.found[number]
            self.paths.reach.when[near.found[number]] = self.farthest  # unless there is a path
        find(self.arcs, self.paths, self.root, near.found[:count], len(self.arcs.ids), self.farthest, -1.0, False)
        sort_part(self.nodes, self.used, count)
        for number in range(self.used, self.used + count):
            self.far[number] = self.paths.reach.when[self.nodes[number]]
        self.first[target] = self.used
        self.counts[target] = count
        self.radius[target] = 0.0
        self.used += count
        return 0


def sort_part(numbers: memoryview[int], first: int, count: int) -> int:
    """Sort `count` numbers from index `first` on, by insertion over gaps that shrink."""
    gap = 1
    while 3 * gap < count:
        gap = 3 * gap + 1
    while gap > 0:
        for place in range(first + gap, first + count):
            number = numbers[place]
            before = place - gap
            while before >= first and numbers[before] > number:
                numbers[before + gap] = numbers[before]
                before -= gap
            numbers[before + gap] = number
        gap //= 3
    return 0
