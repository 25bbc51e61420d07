"""Travel by metres: the nodes that an agent can reach in a turn, and the parts of edges that it covers.

Agents cover speed times time on each edge, as in microscopic traffic models with a constant speed per edge and without
interaction (Treiber and Kesting, Traffic Flow Dynamics, 2013, chapter 6). A turn is the time from 0 to 1. Nodes and
edges are rows; -1 stands for none. An agent without a speed has the speed NaN: it moves along one edge per turn, of any
length.
"""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from math import fabs
from typing import Any

INFINITE = float("inf")
SLACK = 1e-9  # of a turn: a path that takes exactly a turn must not fail by rounding
LEAST = 5e-324  # shares of an edge: bounds for agents under way, against rounding
MOST = 1.0 - 2.0**-53
SHORT = 1e-9  # the share of an edge between a node and an agent that may not enter it
ROUNDED = 1e-12  # of a turn: an arrival this shortly before the end counts as at the end
MORE_LEGS = 3  # legs that a path may have in addition to its nodes
NO_COSTS = memoryview(array("q"))
ENDLESS = 1 << 32  # edges: more than any path has
FORWARD = 1  # the values of `ir.progress.Motion`
BACK = 2
STOPPED = 3
# a name for callers in Python, which do not see constants with a C type
UNLIMITED = ENDLESS


class RoadEdges:
    """The edges of a map, or of several maps that differ in the open edges.

    The nodes of several maps follow each other. The position of a node in this sequence is its place.

    Attributes:
        ids: (nodes,) node ids; of two nodes reached at the same time, the one with the smaller id comes first.
        offsets: (places + 1,) where the open edges out of each node begin in `leaving`.
        leaving: rows of edges by source node, in insertion order.
        first: the place of the first node of the map in use.
        first_costs: (maps,) the index of the cost of the first edge on each map; empty: 0 on all maps.
        first_cost: this index on the map in use.
        removed: (maps * edges,) 1: the edge is neither open nor closed on the map; empty: no edges were removed.
        sources, targets: (edges,) rows of nodes.
        lengths: (edges,) metres.
        costs: (kinds * edges,) the costs by which agents choose paths, of one kind of map after the other.
        seconds: (kinds * edges,) the minimum travel time of each edge; empty: edges have no speed limits.
        turn_seconds: the duration of a turn, in the time unit of speeds.
    """

    def __init__(
        self,
        ids: memoryview[int],
        offsets: memoryview[int],
        leaving: memoryview[int],
        sources: memoryview[int],
        targets: memoryview[int],
        lengths: memoryview[float],
        costs: memoryview[float],
        seconds: memoryview[float],
        turn_seconds: float,
    ) -> None:
        self.ids = ids
        self.offsets = offsets
        self.leaving = leaving
        self.first = 0
        self.first_costs = NO_COSTS
        self.first_cost = 0
        self.removed = memoryview(b"")
        self.sources = sources
        self.targets = targets
        self.lengths = lengths
        self.costs = costs
        self.seconds = seconds
        self.turn_seconds = turn_seconds

    def take(self, offsets: memoryview[int], leaving: memoryview[int], first_costs: memoryview[int]) -> None:
        """Switch to other maps with the same nodes and edges, and use the first one until `use` chooses another."""
        self.offsets = offsets
        self.leaving = leaving
        self.first_costs = first_costs
        self.first = 0
        self.first_cost = 0

    def note_removed(self, removed: memoryview[int]) -> None:
        """Set which edges were removed from each map."""
        self.removed = removed

    def use(self, first: int) -> int:
        """Use the map whose first node has this place."""
        if first != self.first and len(self.first_costs) > 0:
            self.first_cost = self.first_costs[first // len(self.ids)]
        self.first = first
        return 0

    def get_cost(self, edge: int) -> float:
        """Return the cost of an edge on the map in use."""
        return self.costs[self.first_cost + edge]

    def count(self, node: int) -> int:
        """Return the number of edges out of a node."""
        return self.offsets[self.first + node + 1] - self.offsets[self.first + node]

    def get_edge(self, node: int, number: int) -> int:
        """Return edge number `number` out of a node."""
        return self.leaving[self.offsets[self.first + node] + number]


class ReachSearch:
    """The nodes that one agent can reach, and working memory of the search; all columns are (nodes,).

    Attributes:
        nodes: rows, in the order of `state["legal"]`; the first `found` are in use.
        times: the arrival time at each of them.
        listed: the number of the last search that has listed each node.
        found: the number of nodes.
        search: the number of the last search.
        heap, size: a binary heap of nodes to visit.
        places: the position of each node in the heap, from 1; 0: it has not been seen; -1: it has been visited.
        when: the earliest known arrival time at each node.
        rank: breaks ties between nodes with equal times; the smaller rank comes first.
        seen, count: the nodes that have been seen.
    """

    def __init__(
        self,
        nodes: memoryview[int],
        times: memoryview[float],
        listed: memoryview[int],
        heap: memoryview[int],
        places: memoryview[int],
        when: memoryview[float],
        rank: memoryview[int],
        seen: memoryview[int],
    ) -> None:
        self.nodes = nodes
        self.times = times
        self.listed = listed
        self.heap = heap
        self.places = places
        self.when = when
        self.rank = rank
        self.seen = seen
        self.found = 0
        self.search = 0
        self.size = 0
        self.count = 0


class LegalCache:
    """Stored sets of legal nodes at the start of a turn on the first map, as far as there is room.

    Attributes:
        kinds: (agents,) the number of the agent's speed; equal speeds have equal numbers.
        counts: (kinds * nodes,) the number of legal nodes; 0: not computed yet.
        first: (kinds * nodes,) where they begin in `nodes`.
        nodes: (room,) rows of nodes.
        used: the number of entries in `nodes`.
    """

    def __init__(
        self, kinds: memoryview[int], counts: memoryview[int], first: memoryview[int], nodes: memoryview[int]
    ) -> None:
        self.kinds = kinds
        self.counts = counts
        self.first = first
        self.nodes = nodes
        self.used = 0


class TurnPaths:
    """The paths of agents through a turn.

    Attributes:
        most: the maximum number of legs in a row.
        node: (rows,) the node that each agent passed last.
        edge: (rows,) the edge that it is on; -1: it is on its node.
        share: (rows,) the share of the edge behind it; 0.0 on a node.
        motion: (rows,) its motion on the edge; see `ir.progress.Motion`.
        now: (rows,) the current time in the turn.
        speed: (rows,) metres in the time unit of speeds; NaN: none.
        left: (rows,) the number of edges that it may still enter or continue on.
        pace: (rows,) turns per metre, if the path takes the rest of the turn whatever its length; -1.0: it moves at its
            speed.
        legs: (rows,) the number of legs.
        edges: (rows * most,) the edge of each leg.
        backs: (rows * most,) the edge for turning around on it; -1: none.
        begins, ends: (rows * most,) shares of the edge.
        since, until: (rows * most,) the times of the leg.
        passed: (rows,) the number of nodes: the one passed last at the start, then all nodes reached.
        nodes: (rows * (most + 1),) these nodes.
        times: (rows * (most + 1),) the time at each of them.
        route: the nodes of a route to follow; see `go`.
    """

    def __init__(self, rows: int, most: int, ints: memoryview[int], floats: memoryview[float]) -> None:
        self.cut(rows, most, ints, floats)

    def cut(self, rows: int, most: int, ints: memoryview[int], floats: memoryview[float]) -> int:
        """Use parts of memory as columns, in this order.

        Args:
            rows: the number of rows.
            most: the maximum number of legs in a row.
            ints: memory for integers; the rest is for routes.
            floats: memory for floats.
        """
        legs = rows * most
        nodes = legs + rows
        self.most = most
        self.node = ints[:rows]
        self.edge = ints[rows : 2 * rows]
        self.motion = ints[2 * rows : 3 * rows]
        self.left = ints[3 * rows : 4 * rows]
        self.legs = ints[4 * rows : 5 * rows]
        self.passed = ints[5 * rows : 6 * rows]
        at = 6 * rows
        self.edges = ints[at : at + legs]
        self.backs = ints[at + legs : at + 2 * legs]
        at += 2 * legs
        self.nodes = ints[at : at + nodes]
        self.route = ints[at + nodes :]
        self.share = floats[:rows]
        self.now = floats[rows : 2 * rows]
        self.speed = floats[2 * rows : 3 * rows]
        self.pace = floats[3 * rows : 4 * rows]
        at = 4 * rows
        self.begins = floats[at : at + legs]
        self.ends = floats[at + legs : at + 2 * legs]
        self.since = floats[at + 2 * legs : at + 3 * legs]
        self.until = floats[at + 3 * legs : at + 4 * legs]
        self.times = floats[at + 4 * legs :]
        return 0

    def take_route(self, route: memoryview[int]) -> None:
        """Use other memory for routes."""
        self.route = route


class GoalPaths:
    """Shortest paths of agents to goal nodes; the next nodes of one path per row are stored.

    Among paths of equal cost, one with the fewest edges is taken; further ties go, at each node, to the next node with
    the smallest id.

    Attributes:
        roads: the map; every edge has a finite cost.
        back: the map with all edges reversed.
        reach: working memory.
        direct: (edges,) a cache for the first map, all 0 at first: 1: the edge is the only shortest path between its
            ends; 2: it is not.
        most: the maximum number of stored nodes of a path, including the first.
        goal: (rows,) the place of the goal of the stored path.
        count: (rows,) the number of its stored nodes; 0 at first, and if there is no path.
        at: (rows,) the index of the last requested node.
        nodes, far: (rows * most,) the stored nodes, and the cost from each to the goal.
    """

    def __init__(
        self,
        roads: RoadEdges,
        back: RoadEdges,
        reach: ReachSearch,
        direct: memoryview[int],
        most: int,
        goal: memoryview[int],
        count: memoryview[int],
        at: memoryview[int],
        nodes: memoryview[int],
        far: memoryview[float],
    ) -> None:
        self.roads = roads
        self.back = back
        self.reach = reach
        self.direct = direct
        self.most = most
        self.goal = goal
        self.count = count
        self.at = at
        self.nodes = nodes
        self.far = far


class LegalNodes:
    """The legal nodes of agents by their positions and speeds; a subclass finds those of one kind of movement.

    Attributes:
        reach: receives the nodes.
    """

    def __init__(self, reach: ReachSearch) -> None:
        self.reach = reach

    def find(self, node: int, edge: int, share: float, motion: int, speed: float, now: float) -> int:  # noqa: ARG002
        """Find the legal nodes of an agent; return their number.

        Args:
            node: the node that the agent passed last.
            edge: the edge that it has partly covered, as in `rules.GameColumns`; -1: nothing.
            share: the covered share.
            motion: its motion on the edge.
            speed: its speed; NaN: none.
            now: the current time in the turn.
        """
        return 0


class LegalByMetres(LegalNodes):
    """The legal nodes of agents by metres.

    Attributes:
        roads: the map.
        goes_on: see `find_reachable`.
    """

    def __init__(self, roads: RoadEdges, reach: ReachSearch, *, goes_on: bool) -> None:
        super().__init__(reach)
        self.roads = roads
        self.goes_on = goes_on

    def find(self, node: int, edge: int, share: float, motion: int, speed: float, now: float) -> int:
        """Find the legal nodes of an agent; return their number."""
        return find_reachable(self.roads, self.reach, node, edge, share, motion, speed, now, self.goes_on)


# -- edges -----------------------------------------------------------------------------------------------------------


def find_cheapest(roads: RoadEdges, source: int, target: int) -> int:
    """Return the cheapest edge from one node to another, the first of equals; -1: none."""
    found = -1
    for number in range(roads.count(source)):
        edge = roads.get_edge(source, number)
        if roads.targets[edge] == target and (found < 0 or roads.get_cost(edge) < roads.get_cost(found)):
            found = edge
    return found


def find_next_edge(roads: RoadEdges, node: int, then: int) -> int:
    """Return the edge from a node that an entry of a route stands for, see `go`; -1: there is none."""
    nodes = len(roads.ids)
    return find_cheapest(roads, node, then) if then < nodes else then - nodes


def find_reverse_edge(roads: RoadEdges, edge: int) -> int:
    """Return the edge for turning around: the first edge back with equal length; -1: none."""
    node = roads.targets[edge]
    length = roads.lengths[edge]
    for number in range(roads.count(node)):
        other = roads.get_edge(node, number)
        if roads.targets[other] == roads.sources[edge] and fabs(roads.lengths[other] - length) <= SLACK * length:
            return other
    return -1


def compute_turns(roads: RoadEdges, edge: int, share: float, speed: float) -> float:
    """Return the travel time of a share of an edge at a speed, in turns."""
    if speed != speed:  # noqa: PLR0124 - NaN
        return share
    metres = share * roads.lengths[edge]
    pace = speed * roads.turn_seconds
    taken = INFINITE
    if speed == INFINITE or metres == 0.0:
        taken = 0.0
    elif pace > 0.0:
        taken = metres / pace
    if len(roads.seconds) > 0:
        least = share * roads.seconds[roads.first_cost + edge] / roads.turn_seconds
        if least > taken:
            return least
    return taken


def is_endless(roads: RoadEdges, speed: float) -> bool:
    """Return whether an agent of this speed can cover any distance in a turn."""
    return speed == INFINITE and len(roads.seconds) == 0


def is_open(roads: RoadEdges, edge: int) -> bool:
    """Return whether an edge is on the map in use."""
    node = roads.sources[edge]
    found = False
    for number in range(roads.count(node)):
        found = found or roads.get_edge(node, number) == edge
    return found


def is_removed(roads: RoadEdges, edge: int) -> bool:
    """Return whether an edge was removed from the map in use."""
    return len(roads.removed) > 0 and roads.removed[roads.first // len(roads.ids) * len(roads.lengths) + edge] > 0


def is_going(roads: RoadEdges, edge: int, motion: int) -> bool:
    """Return whether an agent moves along an edge, or back where it can turn around."""
    return motion == FORWARD or (motion == BACK and find_reverse_edge(roads, edge) >= 0)


# -- legal nodes -----------------------------------------------------------------------------------------------------


def find_reachable(
    roads: RoadEdges,
    reach: ReachSearch,
    node: int,
    edge: int,
    share: float,
    motion: int,
    speed: float,
    now: float,
    goes_on: bool,
) -> int:
    """Find the legal nodes of an agent; return their number.

    First come the nodes next to its position, then the nodes that it can reach in this turn, by time. An agent on an
    edge may go to both ends; without a speed, only to these.

    Args:
        roads: the map.
        reach: receives the nodes.
        node: the node that the agent passed last.
        edge: the edge that it is on; -1: it is on its node.
        share: the share of the edge behind it.
        motion: its motion on the edge.
        speed: its speed.
        now: the current time in the turn.
        goes_on: whether an agent that moves along an edge has to go on to its end first.
    """
    reach.search += 1
    reach.found = 0
    left = 1.0 - now
    is_paced = speed == speed  # noqa: PLR0124 - NaN
    if edge < 0:
        list_near(roads, reach, node)
        if is_paced:
            list_around(roads, reach, node, speed, 0.0, left)
        return reach.found
    end = roads.targets[edge]
    ahead = compute_turns(roads, edge, 1.0 - share, speed)
    behind = compute_turns(roads, edge, share, speed)
    may_turn = find_reverse_edge(roads, edge) >= 0
    if goes_on and (motion == FORWARD or (motion == BACK and may_turn)):
        if motion == BACK:
            end = node
            ahead = behind
        list_near(roads, reach, end)
        if is_paced:
            list_around(roads, reach, end, speed, ahead, left)
        return reach.found
    if may_turn:
        list_node(reach, node, 0.0)
    list_node(reach, end, 0.0)
    if is_paced:
        list_near(roads, reach, end)
        if may_turn:
            list_near(roads, reach, node)
        list_around(roads, reach, end, speed, ahead, left)
        if may_turn:
            list_around(roads, reach, node, speed, behind, left)
    return reach.found


def count_legal(roads: RoadEdges, reach: ReachSearch, known: LegalCache, agent: int, node: int, speed: float) -> int:
    """Return the number of legal nodes of an agent on a node at the start of a turn."""
    key = known.kinds[agent] * len(roads.ids) + node
    if roads.first == 0 and known.counts[key] > 0:
        return known.counts[key]
    count = find_reachable(roads, reach, node, -1, 0.0, 0, speed, 0.0, False)
    if roads.first == 0 and known.used + count <= len(known.nodes):
        known.counts[key] = count
        known.first[key] = known.used
        for place in range(count):
            known.nodes[known.used + place] = reach.nodes[place]
        known.used += count
    return count


def get_legal_node(roads: RoadEdges, reach: ReachSearch, known: LegalCache, agent: int, node: int, number: int) -> int:
    """Return legal node number `number` after a call of `count_legal`."""
    key = known.kinds[agent] * len(roads.ids) + node
    is_known = roads.first == 0 and known.counts[key] > 0
    return known.nodes[known.first[key] + number] if is_known else reach.nodes[number]


def list_node(reach: ReachSearch, node: int, time: float) -> int:
    """Append a node with its time, unless it is already listed."""
    if reach.listed[node] != reach.search:
        reach.listed[node] = reach.search
        reach.nodes[reach.found] = node
        reach.times[reach.found] = time
        reach.found += 1
    return 0


def list_near(roads: RoadEdges, reach: ReachSearch, node: int) -> int:
    """Append a node and its neighbors."""
    list_node(reach, node, 0.0)
    for number in range(roads.count(node)):
        list_node(reach, roads.targets[roads.get_edge(node, number)], 0.0)
    return 0


def list_around(roads: RoadEdges, reach: ReachSearch, node: int, speed: float, begun: float, left: float) -> int:
    """Append the nodes that can be reached from a node in the rest of a turn, by Dijkstra's algorithm.

    They are in the order of arrival; if any distance can be covered, in the order of rows. `begun` is the arrival time
    at the first node, and `left` the time that is left in the turn.
    """
    endless = is_endless(roads, speed)
    latest = left + SLACK
    reach.size = 0
    reach.count = 0
    reach_node(reach, node, begun, roads.ids[node])
    while reach.size > 0:
        at = visit_first(reach)
        if not endless:
            list_node(reach, at, reach.when[at])
        for number in range(roads.count(at)):
            edge = roads.get_edge(at, number)
            if not endless:
                time = reach.when[at] + compute_turns(roads, edge, 1.0, speed)
                if time <= latest:
                    reach_node(reach, roads.targets[edge], time, roads.ids[roads.targets[edge]])
            elif roads.lengths[edge] < INFINITE:
                reach_node(reach, roads.targets[edge], begun, roads.ids[roads.targets[edge]])
    if endless:
        for one in range(len(roads.ids)):
            if reach.places[one] < 0:
                list_node(reach, one, 0.0)
    return forget_seen(reach)


def forget_seen(reach: ReachSearch) -> int:
    """Reset the working memory after a search."""
    for number in range(reach.count):
        reach.places[reach.seen[number]] = 0
    return 0


def sort_seen(reach: ReachSearch) -> int:
    """Reset the working memory after a search, and sort the seen nodes by row."""
    forget_seen(reach)
    number = reach.count
    reach.size = 0
    reach.count = 0
    for place in range(number):
        reach_node(reach, reach.seen[place], 0.0, reach.seen[place])
    for place in range(number):
        reach.seen[place] = visit_first(reach)
    return forget_seen(reach)


def is_before(reach: ReachSearch, one: int, other: int) -> bool:
    """Return whether a node comes before another in the heap, by time, then by rank."""
    if reach.when[one] != reach.when[other]:
        return reach.when[one] < reach.when[other]
    return reach.rank[one] < reach.rank[other]


def reach_node(reach: ReachSearch, node: int, time: float, rank: int) -> int:
    """Add a node to the heap, or move it forward if the new time or rank is better."""
    place = reach.places[node]
    if place < 0:
        return 0
    if place > 0 and (reach.when[node] < time or (reach.when[node] == time and reach.rank[node] <= rank)):
        return 0
    if place == 0:
        reach.seen[reach.count] = node
        reach.count += 1
        reach.size += 1
        place = reach.size
    reach.when[node] = time
    reach.rank[node] = rank
    while place > 1:
        above = reach.heap[(place >> 1) - 1]
        if not is_before(reach, node, above):
            break
        reach.heap[place - 1] = above
        reach.places[above] = place
        place = place >> 1
    reach.heap[place - 1] = node
    reach.places[node] = place
    return 0


def visit_first(reach: ReachSearch) -> int:
    """Remove the first node from the heap and return it."""
    first = reach.heap[0]
    reach.places[first] = -1
    node = reach.heap[reach.size - 1]
    reach.size -= 1
    place = 1
    while 2 * place <= reach.size:
        below = 2 * place
        if below < reach.size and is_before(reach, reach.heap[below], reach.heap[below - 1]):
            below += 1
        if not is_before(reach, reach.heap[below - 1], node):
            break
        reach.heap[place - 1] = reach.heap[below - 1]
        reach.places[reach.heap[place - 1]] = place
        place = below
    if reach.size > 0:
        reach.heap[place - 1] = node
        reach.places[node] = place
    return first


def is_only_way(roads: RoadEdges, reach: ReachSearch, source: int, target: int) -> bool:
    """Return whether an edge is the shortest path from a node to another by more than rounding errors."""
    edge = find_cheapest(roads, source, target)
    if edge < 0 or not roads.get_cost(edge) < INFINITE:
        return False
    latest = roads.get_cost(edge) * (1.0 + SLACK)
    reach.size = 0
    reach.count = 0
    found = True
    reach_node(reach, source, 0.0, 0)
    while found and reach.size > 0:
        at = visit_first(reach)
        for number in range(roads.count(at)):
            edge = roads.get_edge(at, number)
            cost = reach.when[at] + roads.get_cost(edge)
            if cost <= latest and (at != source or roads.targets[edge] != target):
                found = found and roads.targets[edge] != target
                reach_node(reach, roads.targets[edge], cost, 0)
    forget_seen(reach)
    return found


# -- shortest paths --------------------------------------------------------------------------------------------------


def is_direct(ways: GoalPaths, source: int, target: int) -> bool:
    """Return whether an edge is the only shortest path from one node to another."""
    edge = find_cheapest(ways.roads, source, target)
    if edge < 0 or source == target or ways.roads.first > 0:
        return False
    if ways.direct[edge] == 0:
        ways.direct[edge] = 1 if is_only_way(ways.roads, ways.reach, source, target) else 2
    return ways.direct[edge] == 1


def find_way(ways: GoalPaths, row: int, source: int, goal: int) -> int:
    """Store the shortest path from a node to a goal; return the number of stored nodes, 0 if there is no path.

    The search starts at the goal, so that the costs do not depend on the start of the path.
    """
    ways.back.use(ways.roads.first)
    ways.reach.size = 0
    ways.reach.count = 0
    reach_node(ways.reach, goal, 0.0, 0)
    while ways.reach.size > 0 and ways.reach.places[source] >= 0:
        at = visit_first(ways.reach)
        for number in range(ways.back.count(at)):
            edge = ways.back.get_edge(at, number)
            cost = ways.reach.when[at] + ways.back.get_cost(edge)
            reach_node(ways.reach, ways.back.targets[edge], cost, ways.reach.rank[at] + 1)
    ways.goal[row] = ways.roads.first + goal
    ways.at[row] = 0
    ways.count[row] = 0
    node = source if ways.reach.places[source] < 0 else -1
    while node >= 0 and ways.count[row] < ways.most:
        place = row * ways.most + ways.count[row]
        ways.nodes[place] = node
        ways.far[place] = ways.reach.when[node]
        ways.count[row] += 1
        node = get_next_on_path(ways, node)
    forget_seen(ways.reach)
    return ways.count[row]


def get_next_on_path(ways: GoalPaths, node: int) -> int:
    """Return the next node on the path to the goal of a search; -1: the node is the goal."""
    found = -1
    for number in range(ways.roads.count(node)):
        edge = ways.roads.get_edge(node, number)
        other = ways.roads.targets[edge]
        if (
            ways.reach.places[other] < 0
            and ways.reach.when[other] + ways.roads.get_cost(edge) == ways.reach.when[node]
            and ways.reach.rank[other] + 1 == ways.reach.rank[node]
            and (found < 0 or ways.roads.ids[other] < ways.roads.ids[found])
        ):
            found = other
    return found


def find_place_on_path(ways: GoalPaths, row: int, node: int, goal: int) -> int:
    """Return the index of a node on the stored path to a goal, after a search if necessary; -1: there is no path."""
    if ways.goal[row] == ways.roads.first + goal:
        place = ways.at[row]
        for _ in range(ways.count[row]):
            # The last stored node has no next node, unless it is the goal.
            if ways.nodes[row * ways.most + place] == node and (place + 1 < ways.count[row] or node == goal):
                ways.at[row] = place
                return place
            place = place + 1 if place + 1 < ways.count[row] else 0
    return 0 if find_way(ways, row, node, goal) > 0 else -1


def compute_distance(ways: GoalPaths, row: int, node: int, goal: int) -> float:
    """Return the cost of an agent's path from a node to a goal; infinity if there is no path."""
    if is_direct(ways, node, goal):
        return ways.roads.get_cost(find_cheapest(ways.roads, node, goal))
    place = find_place_on_path(ways, row, node, goal)
    return ways.far[row * ways.most + place] if place >= 0 else INFINITE


def find_next_node(ways: GoalPaths, row: int, node: int, goal: int) -> int:
    """Return the next node on an agent's path from a node to a goal; the node itself if there is no path."""
    if is_direct(ways, node, goal):
        return goal
    place = find_place_on_path(ways, row, node, goal)
    return ways.nodes[row * ways.most + place + 1] if place >= 0 and node != goal else node


def put_route(ways: GoalPaths, trips: TurnPaths, row: int, node: int, goal: int, begin: int) -> int:
    """Append the next nodes of an agent's path to a route that has `begin` nodes.

    Return the new number of nodes; it is unchanged at the goal and if there is no path.
    """
    if is_direct(ways, node, goal):
        trips.route[begin] = goal
        return begin + 1
    place = find_place_on_path(ways, row, node, goal)
    count = ways.count[row] - place - 1 if place >= 0 else 0
    first = row * ways.most + place + 1
    for number in range(count):
        trips.route[begin + number] = ways.nodes[first + number]
    return begin + count


# -- directions ------------------------------------------------------------------------------------------------------


def end_towards(roads: RoadEdges, node: int, edge: int, target: int) -> int:
    """Return the motion on an edge toward a node that is an end of it; 0: it is not an end.

    `node` is the node that the agent passed last; it counts as an end if the agent can turn around.
    """
    if target == roads.targets[edge]:
        return FORWARD
    if target == node and find_reverse_edge(roads, edge) >= 0:
        return BACK
    return 0


def find_shorter_direction(roads: RoadEdges, edge: int, share: float, ahead: float, behind: float) -> int:
    """Return the motion on an edge toward the cheaper path; on a tie, forward; 0: no path.

    Args:
        roads: the map.
        edge: the edge that the agent is on.
        share: the share of the edge behind it.
        ahead: the cost of the path from the end of the edge.
        behind: the cost of the path from its source.
    """
    cost = roads.get_cost(edge)
    ahead = (1.0 - share) * cost + ahead
    behind = share * cost + behind if find_reverse_edge(roads, edge) >= 0 else INFINITE
    if behind < ahead:
        return BACK
    return FORWARD if ahead < INFINITE else 0


# -- motion through the turn -----------------------------------------------------------------------------------------


def begin(
    trips: TurnPaths, row: int, node: int, edge: int, share: float, motion: int, now: float, speed: float, left: int
) -> int:
    """Place an agent at its start; `TurnPaths` describes the arguments."""
    trips.node[row] = node
    trips.edge[row] = edge
    trips.share[row] = share if edge >= 0 else 0.0
    trips.motion[row] = motion
    trips.now[row] = now
    trips.speed[row] = speed
    trips.left[row] = 1 if speed != speed else left  # noqa: PLR0124 - NaN
    trips.pace[row] = -1.0
    trips.legs[row] = 0
    trips.passed[row] = 1
    trips.nodes[row * (trips.most + 1)] = node
    trips.times[row * (trips.most + 1)] = now
    return 0


def add_leg(roads: RoadEdges, trips: TurnPaths, row: int, edge: int, begin: float, end: float, until: float) -> int:
    """Add a leg along a part of an edge, from the current time until `until`."""
    return put_new_leg(trips, row, edge, find_reverse_edge(roads, edge), begin, end, until)


def put_new_leg(trips: TurnPaths, row: int, edge: int, back: int, begin: float, end: float, until: float) -> int:
    """Add a leg along a part of an edge; `back` is the edge for turning around.

    Without room for the leg, the agent stands still instead.
    """
    if trips.legs[row] >= trips.most:
        return stand_still(trips, row)
    place = row * trips.most + trips.legs[row]
    trips.edges[place] = edge
    trips.backs[place] = back
    trips.begins[place] = begin
    trips.ends[place] = end
    trips.since[place] = trips.now[row]
    trips.until[place] = until
    trips.legs[row] += 1
    trips.now[row] = until
    return 0


def stand_still(trips: TurnPaths, row: int) -> int:
    """Let an agent cover nothing more in this turn, where its path cannot be written."""
    trips.left[row] = 0
    trips.now[row] = 1.0
    return 0


def compute_turns_to_end(roads: RoadEdges, trips: TurnPaths, row: int, edge: int, motion: int) -> float:
    """Return the time that an agent needs to reach the end of its edge, in turns."""
    share = fabs((0.0 if motion == BACK else 1.0) - trips.share[row])
    if trips.pace[row] >= 0.0:
        return share * roads.lengths[edge] * trips.pace[row]
    return compute_turns(roads, edge, share, trips.speed[row])


def stop_before_end(trips: TurnPaths, row: int, motion: int, takes: float) -> float:
    """Return the share of an edge where an agent is at the end of the turn; -1.0: it covers nothing."""
    first = trips.share[row]
    last = 0.0 if motion == BACK else 1.0
    part = fabs(last - first) * (1.0 - trips.now[row]) / takes if takes < INFINITE else 0.0
    stop = first + part if last > first else first - part
    return stop if part > 0.0 and 0.0 < stop < 1.0 else -1.0


def cover(roads: RoadEdges, trips: TurnPaths, row: int, edge: int, motion: int) -> bool:
    """Move an agent along an edge; return whether it reaches the end before the turn is over.

    Otherwise it stops on the edge. `motion` is BACK toward the source of the edge, else FORWARD.
    """
    if edge < 0 or trips.legs[row] >= trips.most:
        stand_still(trips, row)
        return False
    first = trips.share[row]
    takes = compute_turns_to_end(roads, trips, row, edge, motion)
    until = trips.now[row] + takes
    if until > 1.0 + SLACK:
        stop = stop_before_end(trips, row, motion, takes)
        if stop >= 0.0:
            add_leg(roads, trips, row, edge, first, stop, 1.0)
            trips.edge[row] = edge
            trips.share[row] = stop
            trips.motion[row] = BACK if motion == BACK else FORWARD
        stand(roads, trips, row)
        return False
    trips.left[row] -= 1
    add_leg(roads, trips, row, edge, first, 0.0 if motion == BACK else 1.0, until if until < 1.0 - ROUNDED else 1.0)
    node = roads.sources[edge] if motion == BACK else roads.targets[edge]
    if node != trips.node[row]:
        place = row * (trips.most + 1) + trips.passed[row]
        trips.nodes[place] = node
        trips.times[place] = trips.now[row]
        trips.passed[row] += 1
    trips.node[row] = node
    trips.edge[row] = -1
    trips.share[row] = 0.0
    return True


def stand(roads: RoadEdges, trips: TurnPaths, row: int) -> int:
    """Keep an agent at its position for the rest of the turn."""
    trips.left[row] = 0
    if trips.edge[row] >= 0 and trips.now[row] < 1.0:
        add_leg(roads, trips, row, trips.edge[row], trips.share[row], trips.share[row], 1.0)
    return 0


def is_on_edge_at_start(trips: TurnPaths, row: int) -> bool:
    """Return whether an agent is on an edge at the start of its path."""
    return trips.legs[row] > 0 and 0.0 < trips.begins[row * trips.most] < 1.0


def is_moving(trips: TurnPaths, row: int) -> bool:
    """Return whether an agent covers part of an edge."""
    first = row * trips.most
    return trips.legs[row] > 0 and trips.begins[first] != trips.ends[first]


def stay(trips: TurnPaths, row: int) -> int:
    """Undo the path of an agent: it stays at its start for the whole turn, on the map on which the path was found."""
    first = row * trips.most
    trips.edge[row] = -1
    trips.share[row] = 0.0
    if is_on_edge_at_start(trips, row):
        trips.edge[row] = trips.edges[first]
        trips.share[row] = trips.begins[first]
        put_leg(trips, first, first, trips.begins[first], 0.0, 1.0)
    trips.legs[row] = 1 if trips.edge[row] >= 0 else 0
    trips.motion[row] = STOPPED
    trips.passed[row] = 1
    trips.node[row] = trips.nodes[row * (trips.most + 1)]
    trips.times[row * (trips.most + 1)] = 0.0
    return 0


def stop_short(roads: RoadEdges, trips: TurnPaths, row: int) -> int:
    """Stop an agent just before the node at the end of its last leg, for the rest of the turn."""
    leg = row * trips.most + trips.legs[row] - 1
    edge = trips.edges[leg]
    if trips.ends[leg] == 1.0:
        trips.passed[row] -= 1
    trips.ends[leg] = 1.0 - SHORT if trips.ends[leg] == 1.0 else SHORT
    trips.node[row] = roads.sources[edge]
    trips.edge[row] = edge
    trips.share[row] = trips.ends[leg]
    trips.motion[row] = STOPPED
    trips.now[row] = trips.until[leg]
    return stand(roads, trips, row)


def go_in_part(trips: TurnPaths, row: int, part: int, parts: int) -> int:
    """Fit the path of an agent into one of several equal parts of the turn; until then it waits at its start."""
    first = row * trips.most
    node = row * (trips.most + 1)
    stands = is_on_edge_at_start(trips, row)
    for leg in range(first, first + trips.legs[row]):
        trips.since[leg] = (part + trips.since[leg]) / parts
        trips.until[leg] = (part + trips.until[leg]) / parts
    for place in range(node, node + trips.passed[row]):
        trips.times[place] = (part + trips.times[place]) / parts
    if part > 0 and stands:
        for leg in range(first + trips.legs[row], first, -1):
            copy_leg(trips, leg - 1, trips, leg)
        put_leg(trips, first, first, trips.begins[first], 0.0, part / parts)
        trips.legs[row] += 1
    elif part > 0:
        for place in range(node + trips.passed[row], node, -1):
            trips.nodes[place] = trips.nodes[place - 1]
            trips.times[place] = trips.times[place - 1]
        trips.passed[row] += 1
    if part > 0:
        trips.times[node] = 0.0
    if part + 1 < parts and trips.edge[row] >= 0 and trips.legs[row] > 0:
        last = first + trips.legs[row]
        put_leg(trips, last, last - 1, trips.share[row], (part + 1) / parts, 1.0)
        trips.legs[row] += 1
    return 0


def compute_share(begin: float, end: float, since: float, until: float, time: float) -> float:
    """Return the share of an edge where an agent on a leg is at a time; the ends of the edge only when it is there."""
    if time >= until:
        return end
    share = begin + (end - begin) * (time - since) / (until - since)
    return min(max(share, LEAST), MOST) if begin != end else share


def get_motion(begin: float, end: float) -> int:
    """Return the motion of an agent on a leg between two shares of an edge."""
    if begin == end:
        return STOPPED
    return FORWARD if begin < end else BACK


def put_leg(trips: TurnPaths, leg: int, other: int, share: float, since: float, until: float) -> int:
    """Write a leg of an agent that stands on the edge of another leg."""
    trips.edges[leg] = trips.edges[other]
    trips.backs[leg] = trips.backs[other]
    trips.begins[leg] = share
    trips.ends[leg] = share
    trips.since[leg] = since
    trips.until[leg] = until
    return 0


def copy_leg(trips: TurnPaths, leg: int, others: TurnPaths, other: int) -> int:
    """Copy a leg to the place of another."""
    others.edges[other] = trips.edges[leg]
    others.backs[other] = trips.backs[leg]
    others.begins[other] = trips.begins[leg]
    others.ends[other] = trips.ends[leg]
    others.since[other] = trips.since[leg]
    others.until[other] = trips.until[leg]
    return 0


class PathsBySlot:
    """The paths of the agents of one game through a turn, by slot; a subclass makes room for them.

    Attributes:
        maps: for each slot, the ids of the map on which the path was found; None: the agent has no path.
        core: the paths.
        make_progress: makes the position of an agent on an edge.
        motions: the motions by number, for these positions.
    """

    def __init__(self, agents: int, make_progress: Any, motions: Sequence[Any]) -> None:
        self.maps: list[Any] = [None] * agents
        self.core: TurnPaths
        self.make_progress = make_progress
        self.motions = motions

    def count_most_legs(self) -> int:
        """Return the maximum number of legs of an agent."""
        found = 0
        for i in range(len(self.core.legs)):
            found = max(found, self.core.legs[i])
        return found

    def count_most_nodes(self) -> int:
        """Return the maximum number of nodes of an agent, at least 1."""
        found = 1
        for i in range(len(self.core.passed)):
            found = max(found, self.core.passed[i])
        return found

    def take(self, i: int, paths: TurnPaths, row: int, room: int, roads: Any) -> int:
        """Copy the path of an agent from other paths.

        Args:
            i: its slot.
            paths: the other paths,
            row: and its row there.
            room: a number that is not less than the number of its legs, and of nodes beyond the first.
            roads: the ids of the map.
        """
        if room + MORE_LEGS > self.core.most:
            self.reserve(room)
        copy_trip(paths, row, self.core, i)
        self.maps[i] = roads
        return 0

    def reserve(self, legs: int) -> bool:
        """Make room for so many legs of an agent, and legs before and after them; return whether memory is new."""
        raise NotImplementedError

    def get_progress(self, i: int) -> Any:
        """Return the position of an agent on an edge when its path ends; None: it is on a node."""
        roads = self.maps[i]
        paths = self.core
        if roads is None or paths.share[i] == 0.0:
            return None
        if roads.edge_ids is None:  # its path is over nodes
            return self.make_progress(roads.ids[paths.node[i]], roads.ids[paths.edge[i]], paths.share[i])
        source, target, id = roads.edge_ids[paths.edge[i]]
        return self.make_progress(source, target, paths.share[i], id, self.motions[paths.motion[i]])

    def get_position_at(self, i: int, time: float) -> Any:
        """Return the position of an agent on its last leg at a time of the turn; None: it is on a node."""
        paths = self.core
        leg = i * paths.most + paths.legs[i] - 1
        begin = paths.begins[leg]
        end = paths.ends[leg]
        share = compute_share(begin, end, paths.since[leg], paths.until[leg], time)
        if share <= 0.0 or share >= 1.0:
            return None
        source, target, id = self.maps[i].edge_ids[paths.edges[leg]]
        return self.make_progress(source, target, share, id, self.motions[get_motion(begin, end)])


def copy_trip(trips: TurnPaths, row: int, others: TurnPaths, other: int) -> int:
    """Copy the path of an agent to a row of other trips."""
    others.legs[other] = 0
    others.passed[other] = 0
    return add_trip(trips, row, others, other, 0)


def add_trip(trips: TurnPaths, row: int, others: TurnPaths, other: int, first: int) -> int:
    """Append the legs of an agent, and its nodes from number `first` on, to its path in other trips.

    Without room for them, the agent stands still there instead.
    """
    if others.legs[other] + trips.legs[row] > others.most:
        return stand_still(others, other)
    others.node[other] = trips.node[row]
    others.edge[other] = trips.edge[row]
    others.share[other] = trips.share[row]
    others.motion[other] = trips.motion[row]
    place = other * others.most + others.legs[other]
    for number in range(trips.legs[row]):
        copy_leg(trips, row * trips.most + number, others, place + number)
    place = other * (others.most + 1) + others.passed[other] - first
    for number in range(first, trips.passed[row]):
        others.nodes[place + number] = trips.nodes[row * (trips.most + 1) + number]
        others.times[place + number] = trips.times[row * (trips.most + 1) + number]
    others.legs[other] += trips.legs[row]
    others.passed[other] += trips.passed[row] - first
    return 0


def find_missing_edge(roads: RoadEdges, trips: TurnPaths, node: int, count: int) -> int:
    """Return the index of the first route node that no edge reaches from the previous one; -1: there is none."""
    at = node
    for number in range(count):
        if trips.route[number] != at and find_cheapest(roads, at, trips.route[number]) < 0:
            return number
        at = trips.route[number]
    return -1


def is_using_whole_turn(roads: RoadEdges, trips: TurnPaths, row: int) -> bool:
    """Return whether the path of an agent takes the rest of the turn, whatever its length."""
    speed = trips.speed[row]
    return speed != speed or is_endless(roads, speed)  # noqa: PLR0124 - NaN


def set_pace(roads: RoadEdges, trips: TurnPaths, row: int, motion: int, count: int) -> int:
    """Compute the pace of an agent whose path takes the rest of the turn; `go` describes the arguments."""
    at = trips.node[row]
    left = trips.left[row]
    metres = 0.0
    if trips.edge[row] >= 0:
        edge = trips.edge[row]
        metres = fabs((0.0 if motion == BACK else 1.0) - trips.share[row]) * roads.lengths[edge]
        at = roads.sources[edge] if motion == BACK else roads.targets[edge]
        left -= 1
    for number in range(count):
        if trips.route[number] != at and left > 0:
            edge = find_next_edge(roads, at, trips.route[number])
            metres += roads.lengths[edge]
            at = roads.targets[edge]
            left -= 1
    trips.pace[row] = (1.0 - trips.now[row]) / metres if metres > 0.0 else 0.0
    return 0


def go(roads: RoadEdges, trips: TurnPaths, row: int, motion: int, count: int) -> bool:
    """Move an agent to an end of its edge, if it is on one, then along a route; return whether it may go on.

    An agent whose path takes the rest of the turn needs its whole route in one call.

    Args:
        roads: the map.
        trips: holds the route: rows of nodes, or of edges, to which the number of nodes is added. An edge leads from
            each node to the next, and repeated nodes are skipped. It receives the legs, and needs room for two legs
            more than the route has entries.
        row: the row of the agent.
        motion: for an agent on an edge: BACK or FORWARD.
        count: the number of entries of the route.
    """
    if trips.pace[row] < 0.0 and is_using_whole_turn(roads, trips, row):
        set_pace(roads, trips, row, motion, count)
    if trips.edge[row] >= 0 and not cover(roads, trips, row, trips.edge[row], motion):
        return False
    for number in range(count):
        node = trips.route[number]
        if node == trips.node[row]:
            continue
        if trips.left[row] <= 0 or not cover(roads, trips, row, find_next_edge(roads, trips.node[row], node), FORWARD):
            return False
    return trips.left[row] > 0


def go_towards(roads: RoadEdges, trips: TurnPaths, ways: GoalPaths, memory: int, row: int, target: int) -> bool:
    """Move an agent toward a node until the turn is over; return whether it can.

    An agent on an edge takes the shorter direction.

    Args:
        roads: the map.
        trips: holds the agent at its start.
        ways: shortest paths.
        memory: the row of `ways` for the agent's path.
        row: the row of the agent.
        target: the node.
    """
    node = trips.node[row]
    edge = trips.edge[row]
    motion = FORWARD
    needs_whole = is_endless(roads, trips.speed[row])
    count = 0
    goes_on = True
    if edge >= 0:
        motion = find_motion(roads, trips, ways, memory, row, target)
        if motion == 0:
            return False
        node = roads.sources[edge] if motion == BACK else roads.targets[edge]
        if node == target or not needs_whole:
            goes_on = go(roads, trips, row, motion, 0)
    while goes_on and node != target:
        before = count
        count = put_route(ways, trips, memory, node, target, before)
        if count == before:
            return False
        node = trips.route[count - 1]
        if node == target or not needs_whole:
            goes_on = go(roads, trips, row, motion, count)
            count = 0
    return True


def find_motion(roads: RoadEdges, trips: TurnPaths, ways: GoalPaths, memory: int, row: int, target: int) -> int:
    """Return the motion of an agent on an edge toward a node; 0: it cannot go there."""
    node = trips.node[row]
    edge = trips.edge[row]
    motion = end_towards(roads, node, edge, target)
    if motion == 0 and trips.speed[row] == trips.speed[row]:  # not NaN
        ahead = compute_distance(ways, memory, roads.targets[edge], target)
        behind = compute_distance(ways, memory, node, target)
        motion = find_shorter_direction(roads, edge, trips.share[row], ahead, behind)
    return motion


# -- many agents ----------------------------------------------------------------------------------------------------


def find_reverse_edges(roads: RoadEdges, edges: memoryview[int], found: memoryview[int]) -> int:
    """Write the edge for turning around on each edge of an array, see `back`; -1 stays -1."""
    for number in range(len(edges)):
        found[number] = find_reverse_edge(roads, edges[number]) if edges[number] >= 0 else -1
    return 0


def find_each(
    legal: LegalNodes,
    first: int,
    node: memoryview[int],
    edge: memoryview[int],
    share: memoryview[float],
    motion: memoryview[int],
    speed: memoryview[float],
    now: memoryview[float],
    found: memoryview[int],
    counts: memoryview[int],
) -> int:
    """List the legal nodes of each agent from number `first` on; return the first agent whose nodes did not fit.

    The agents' columns are as in `LegalNodes.find`. The nodes are written one after the other to `found`, the number of
    nodes of each agent to `counts`.
    """
    used = 0
    for number in range(first, len(node)):
        count = legal.find(node[number], edge[number], share[number], motion[number], speed[number], now[number])
        if used + count > len(found):
            return number
        for place in range(count):
            found[used + place] = legal.reach.nodes[place]
        counts[number] = count
        used += count
    return len(node)
