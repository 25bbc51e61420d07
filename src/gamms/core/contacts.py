"""Contacts of a turn: the pairs of agents that meet, with time and place.

A turn is the time from 0 to 1. `Tracks` and `Legs` hold the paths of agents, `NearNodes` and `PathSegments` the
distances between places; `Contacts` finds the pairs of one game that meet, and sorts them by time.
"""

from __future__ import annotations

from array import array
from math import fabs, sqrt
from typing import Any

from gamms.core import draws, travel
from gamms.core.agents import NodeNumbers
from gamms.core.travel import RoadEdges, TurnPaths

INFINITE = float("inf")
SLACK = 1e-9  # of a turn: visits of one place with a gap of at most this time still meet
OURS = 1
THEIRS = 2
BACKWARDS = 1  # flags of legs, see `Legs`
TURNS = 2
UNKNOWN = 4
ON_NODE = -1  # instead of a leg: the agent is on a node
LEAVES = -2  # the agent left this node when the turn began
MOST_NEAR = 1 << 20  # the maximum number of stored distances, 16 bytes each
ON_NODES = 0
BY_PATHS = 1
ON_WAYS = 2
NEAR_PLACES = 3
ON_LINES = 4
SEARCHES = {  # the same for callers in Python, which do not see constants with a C type
    "on nodes": ON_NODES,
    "by paths": BY_PATHS,
    "on ways": ON_WAYS,  # the same, exact
    "near places": NEAR_PLACES,
    "on lines": ON_LINES,
}
BY_RANK = 0
BY_PAIR = 1
BY_PLACE = 2


def extend_column(kind: str, column: memoryview[Any], room: int) -> memoryview[Any]:
    """Return a copy of a column with room for `room` numbers; `kind` is a type code of `array`."""
    longer = memoryview(array(kind, bytes(8 * room)))
    longer[: len(column)] = column
    return longer


class Tracks:
    """The nodes that agents pass in a turn.

    Attributes:
        agents: the number of agents.
        most: the maximum number of nodes of an agent.
        nodes: (agents * most,) numbers of nodes in the order of passing. In games that count edges, an agent that waits
            on its first node has this node twice.
        times: (agents * most,) the time at each node.
        lengths: (agents,) the number of nodes, at least 1.
        sides: (agents,) 1: the agent is of the first side; 2: of the second; 3: of both; 0: it does not take part.
        at_end: whether agents meet only at their positions at the end of the turn.
    """

    def __init__(
        self,
        agents: int,
        most: int,
        nodes: memoryview[int],
        times: memoryview[float],
        lengths: memoryview[int],
        sides: memoryview[int],
        *,
        at_end: bool,
    ) -> None:
        self.agents = agents
        self.most = most
        self.nodes = nodes
        self.times = times
        self.lengths = lengths
        self.sides = sides
        self.at_end = at_end


class Legs:
    """The parts of edges that agents cover in a turn, in games by metres.

    Attributes:
        most: the maximum number of legs of an agent; 0 in games that count edges.
        counts: (agents,) the number of legs.
        sources, targets: (agents * most,) the numbers of the nodes at both ends of the edge.
        edges: (agents * most,) the number of the edge, as in `Polylines`.
        streets: (agents * most,) the street number, common to an edge and the edge back.
        flags: (agents * most,) the sum of 1 if the street runs against the edge, 2 if agents can turn around on the
            edge, and 4 if the position of the edge is unknown.
        begins, ends: (agents * most,) shares of the edge from its source.
        since, until: (agents * most,) the times of the leg.
        lengths: (agents * most,) the lengths of the edges, metres.
    """

    def __init__(
        self,
        most: int,
        counts: memoryview[int],
        sources: memoryview[int],
        targets: memoryview[int],
        edges: memoryview[int],
        streets: memoryview[int],
        flags: memoryview[int],
        begins: memoryview[float],
        ends: memoryview[float],
        since: memoryview[float],
        until: memoryview[float],
        lengths: memoryview[float],
    ) -> None:
        self.most = most
        self.counts = counts
        self.sources = sources
        self.targets = targets
        self.edges = edges
        self.streets = streets
        self.flags = flags
        self.begins = begins
        self.ends = ends
        self.since = since
        self.until = until
        self.lengths = lengths


def describe_leg(legs: Legs, place: int, roads: RoadEdges, edge_ids: memoryview[int], edge: int, back: int) -> int:
    """Write the columns of a leg that depend on its edge; nodes and streets are rows of nodes and edges.

    Args:
        legs: receive them,
        place: in this place.
        roads: the map.
        edge_ids: (edges,) the ids of the edges.
        edge: the edge.
        back: the edge for turning around; -1: none.
    """
    is_back = back >= 0 and edge_ids[back] < edge_ids[edge]
    legs.edges[place] = edge
    legs.streets[place] = back if is_back else edge
    legs.flags[place] = (BACKWARDS if is_back else 0) + (TURNS if back >= 0 else 0)
    if travel.is_removed(roads, edge):
        legs.flags[place] += UNKNOWN
    legs.sources[place] = roads.sources[edge]
    legs.targets[place] = roads.targets[edge]
    legs.lengths[place] = roads.lengths[edge]
    return 0


def put_paths(
    trips: TurnPaths,
    rows: memoryview[int],
    roads: RoadEdges,
    edge_ids: memoryview[int],
    numbers: NodeNumbers,
    streets: NodeNumbers,
    tracks: Tracks,
    legs: Legs,
    agents: memoryview[int],
) -> int:
    """Write the paths in these rows, (paths,), of agents of a single game with these numbers; see `put_path`."""
    for place in range(len(rows)):
        put_path(trips, rows[place], roads, edge_ids, numbers, streets, tracks, legs, agents[place])
    return 0


def put_path(
    trips: TurnPaths,
    row: int,
    roads: RoadEdges,
    edge_ids: memoryview[int],
    numbers: NodeNumbers,
    streets: NodeNumbers,
    tracks: Tracks,
    legs: Legs,
    agent: int,
) -> int:
    """Write the path of an agent of a single game, with numbers of nodes and streets by their ids.

    Args:
        trips: the paths,
        row: and the row of the agent there.
        roads: the map.
        edge_ids: (edges,) the ids of the edges.
        numbers: numbers the nodes.
        streets: numbers the edges and the streets.
        tracks: receive the nodes,
        legs: and the legs,
        agent: of the agent of this number.
    """
    tracks.lengths[agent] = trips.passed[row]
    for number in range(tracks.most):
        at = row * (trips.most + 1) + min(number, trips.passed[row] - 1)
        place = agent * tracks.most + number
        tracks.nodes[place] = numbers.number(roads.ids[trips.nodes[at]])
        tracks.times[place] = trips.times[at] if number < trips.passed[row] else 1.0
    legs.counts[agent] = trips.legs[row]
    for number in range(trips.legs[row]):
        at = row * trips.most + number
        place = agent * legs.most + number
        describe_leg(legs, place, roads, edge_ids, trips.edges[at], trips.backs[at])
        legs.edges[place] = streets.number(edge_ids[legs.edges[place]])
        legs.streets[place] = streets.number(edge_ids[legs.streets[place]])
        legs.sources[place] = numbers.number(roads.ids[legs.sources[place]])
        legs.targets[place] = numbers.number(roads.ids[legs.targets[place]])
        legs.begins[place] = trips.begins[at]
        legs.ends[place] = trips.ends[at]
        legs.since[place] = trips.since[at]
        legs.until[place] = trips.until[at]
    return 0


class NearNodes:
    """The nodes within a distance of each node, along edges, computed on first use.

    Attributes:
        arcs: (places + 1,) where the edges out of the node at each place begin in `heads`; the nodes of several maps
            may follow each other.
        heads, costs: (edges,) the node at the end and the length of each edge.
        limit: the distance.
        search: working memory.
        first: the place of the first node of the map to search.
        offsets: (places,) where the entries of a node begin; -1: they are not computed yet.
        counts: (places,) the number of entries.
        ends: (room,) numbers of nodes, ascending for each start node.
        far: (room,) their distances.
        used: the number of entries.
    """

    def __init__(
        self,
        arcs: memoryview[int],
        heads: memoryview[int],
        costs: memoryview[float],
        limit: float,
        search: travel.ReachSearch,
    ) -> None:
        self.limit = limit
        self.search = search
        self.first = 0
        self.ends: memoryview[int] = memoryview(array("q"))
        self.far: memoryview[float] = memoryview(array("d"))
        self.take(arcs, heads, costs)

    def take(self, arcs: memoryview[int], heads: memoryview[int], costs: memoryview[float]) -> int:
        """Switch to other maps, and drop all entries."""
        places = len(arcs) - 1
        self.arcs = arcs
        self.heads = heads
        self.costs = costs
        self.offsets = memoryview(array("q", [-1] * places))
        self.counts = memoryview(array("q", bytes(8 * places)))
        self.used = 0
        return 0

    def make_room(self, room: int) -> int:
        """Make room for `room` entries, and keep the existing ones."""
        ends = memoryview(array("q", bytes(8 * room)))
        far: Any = memoryview(array("d", bytes(8 * room)))
        if self.used > 0:
            ends[: self.used] = self.ends[: self.used]
            far[: self.used] = self.far[: self.used]
        self.ends = ends
        self.far = far
        return 0

    def begin(self) -> int:
        """Drop all entries if there are many."""
        if self.used > MOST_NEAR:
            self.forget()
        return 0

    def forget(self) -> int:
        """Drop all entries, after costs have changed in place; a cost of NaN closes an edge."""
        self.used = 0
        for place in range(len(self.offsets)):
            self.offsets[place] = -1
        return 0

    def learn(self, node: int) -> int:
        """Find the nodes near a node by Dijkstra's algorithm; return where its entries begin."""
        place = self.first + node
        if self.offsets[place] >= 0:
            return self.offsets[place]
        self.search.size = 0
        self.search.count = 0
        travel.reach_node(self.search, node, 0.0, 0)
        while self.search.size > 0:
            at = travel.visit_first(self.search)
            self.search.times[at] = self.search.when[at]
            for arc in range(self.arcs[self.first + at], self.arcs[self.first + at + 1]):
                far = self.search.when[at] + self.costs[arc]
                if far <= self.limit:
                    travel.reach_node(self.search, self.heads[arc], far, 0)
        travel.sort_seen(self.search)
        self.offsets[place] = self.used
        self.counts[place] = self.search.count
        if self.used + self.search.count > len(self.ends):
            self.make_room(2 * (self.used + self.search.count))
        for number in range(self.search.count):
            end = self.search.seen[number]
            self.ends[self.used + number] = end
            self.far[self.used + number] = self.search.times[end]
        self.used += self.search.count
        return self.offsets[place]

    def find_end(self, node: int) -> int:
        """Return where the entries of a node end, which are computed."""
        return self.offsets[self.first + node] + self.counts[self.first + node]

    def get_distance(self, start: int, end: int) -> float:
        """Return the distance from a node to another; infinity if it is beyond the limit."""
        first = self.learn(start)
        beyond = self.find_end(start)
        last = beyond
        while first < last:
            middle = (first + last) >> 1
            if self.ends[middle] < end:
                first = middle + 1
            else:
                last = middle
        if first < beyond and self.ends[first] == end:
            return self.far[first]
        return INFINITE


class NodePositions:
    """The positions of agents on the nodes that they pass, in games that count edges.

    Attributes:
        numbers: (agents * most,) the number of the position at each passed node.
        xyz: (3 * places,) x, y and z of each position.
    """

    def __init__(self, numbers: memoryview[int], xyz: memoryview[float]) -> None:
        self.numbers = numbers
        self.xyz = xyz


class Polylines:
    """The polylines of edges; see `gamms.typing.on_edges.Line`.

    Attributes:
        firsts, lasts: (edges,) the first and the last point of each edge; -1: it has no polyline yet.
        xs, ys: (points,) the points.
        lengths: (points,) the distance from each point to the next of the edge; 0 for its last.
        shares: (points,) the share of the length of the edge at each point.
        wholes: (edges,) the length of the polyline of each edge.
        x, y: the point that `find` has found.
    """

    def __init__(self) -> None:
        none: Any = memoryview(array("d"))
        self.firsts: memoryview[int] = memoryview(array("q"))
        self.lasts = self.firsts
        self.xs: memoryview[float] = none
        self.ys: memoryview[float] = none
        self.lengths: memoryview[float] = none
        self.shares: memoryview[float] = none
        self.wholes: memoryview[float] = none
        self.x = 0.0
        self.y = 0.0

    def take(
        self,
        firsts: memoryview[int],
        lasts: memoryview[int],
        xs: memoryview[float],
        ys: memoryview[float],
        lengths: memoryview[float],
        shares: memoryview[float],
        wholes: memoryview[float],
    ) -> None:
        """Set the polylines of all edges."""
        self.firsts = firsts
        self.lasts = lasts
        self.xs = xs
        self.ys = ys
        self.lengths = lengths
        self.shares = shares
        self.wholes = wholes

    def find(self, edge: int, share: float) -> int:
        """Find the point at a share of the length of an edge."""
        left = share * self.wholes[edge]
        last = self.lasts[edge]
        self.x = self.xs[last]
        self.y = self.ys[last]
        for point in range(self.firsts[edge], last):
            length = self.lengths[point]
            if length > 0.0 and left <= length:
                self.x = self.xs[point] + left * ((self.xs[point + 1] - self.xs[point]) / length)
                self.y = self.ys[point] + left * ((self.ys[point + 1] - self.ys[point]) / length)
                return 0
            left -= length
        return 0


class PathSegments:
    """The straight segments of the paths of agents, in games by metres: stays on nodes, then parts of edges.

    Attributes:
        edges: the polylines of the edges.
        places: (2 * nodes,) x and y of each node.
        flights: (3 * agents,) x, y and z of each flying agent; NaN for agents on the ground. Empty: none flies.
        offsets: (agents + 1,) where the segments of each agent begin.
        since, until: (parts,) the times of each segment.
        begins, ends: (3 * parts,) x, y and z of the agent at both times.
        parts: the number of segments.
        room: the maximum number of segments; it grows when necessary.
    """

    def __init__(self, agents: int, edges: Polylines, places: memoryview[float]) -> None:
        none: Any = memoryview(array("d"))
        self.edges = edges
        self.places = places
        self.flights: memoryview[float] = none
        self.offsets: memoryview[int] = memoryview(array("q", bytes(8 * (agents + 1))))
        self.since: memoryview[float] = none
        self.until: memoryview[float] = none
        self.begins: memoryview[float] = none
        self.ends: memoryview[float] = none
        self.parts = 0
        self.room = 0

    def make_room(self, room: int) -> int:
        """Make room for `room` segments, and keep the existing ones."""
        self.since = extend_column("d", self.since, room)
        self.until = extend_column("d", self.until, room)
        self.begins = extend_column("d", self.begins, 3 * room)
        self.ends = extend_column("d", self.ends, 3 * room)
        self.room = room
        return 0

    def fill(self, tracks: Tracks, legs: Legs, pieces: MotionIntervals) -> int:
        """Write the segments of the agents that take part; `pieces` is working memory."""
        put_visits(tracks, legs, pieces)
        self.parts = 0
        piece = 0
        for agent in range(tracks.agents):
            self.offsets[agent] = self.parts
            is_flying = len(self.flights) > 0 and self.flights[3 * agent] == self.flights[3 * agent]  # not NaN
            if is_flying and tracks.sides[agent]:
                self._put_flight(agent, 1.0 if tracks.at_end else tracks.times[agent * tracks.most])
            while piece < pieces.count and pieces.agents[piece] == agent:
                if not is_flying:
                    self._put_stay(pieces.nodes[piece], pieces.since[piece], pieces.until[piece])
                piece += 1
            if tracks.sides[agent] and not is_flying and legs.most > 0:
                self._put_legs(legs, agent, tracks.at_end)
        self.offsets[tracks.agents] = self.parts
        return 0

    def _put_flight(self, agent: int, since: float) -> int:
        """Add the position of a flying agent."""
        part = self._put(since, 1.0)
        for axis in range(3):
            self.begins[3 * part + axis] = self.flights[3 * agent + axis]
            self.ends[3 * part + axis] = self.flights[3 * agent + axis]
        return 0

    def _put_stay(self, node: int, since: float, until: float) -> int:
        """Add a stay on a node."""
        part = self._put(since, until)
        self._begin(part, self.places[2 * node], self.places[2 * node + 1])
        return self._end(part, self.places[2 * node], self.places[2 * node + 1])

    def _put_legs(self, legs: Legs, agent: int, at_end: bool) -> int:
        """Add the parts of edges that an agent covers; at the end, only the point where it is."""
        first = agent * legs.most
        beyond = first + legs.counts[agent]
        if at_end:
            leg = beyond - 1
            if beyond > first and 0.0 < legs.ends[leg] < 1.0 and not legs.flags[leg] & UNKNOWN:
                self._put_line(legs.edges[leg], legs.ends[leg], legs.ends[leg], 1.0, 1.0)
            return 0
        for leg in range(first, beyond):
            if not legs.flags[leg] & UNKNOWN:
                self._put_line(legs.edges[leg], legs.begins[leg], legs.ends[leg], legs.since[leg], legs.until[leg])
        return 0

    def _put_line(self, edge: int, begin: float, end: float, since: float, until: float) -> int:
        """Add the straight parts of a leg along the polyline of its edge."""
        pace = (until - since) / (end - begin) if end != begin else 0.0
        self.edges.find(edge, begin)
        part = self._put(since, until)
        self._begin(part, self.edges.x, self.edges.y)
        first = self.edges.firsts[edge] + 1
        last = self.edges.lasts[edge]
        for number in range(last + 1 - first):
            point = first + number if begin <= end else last - number
            share = self.edges.shares[point]
            if min(begin, end) < share < max(begin, end):
                time = since + (share - begin) * pace
                self.until[part] = time
                self._end(part, self.edges.xs[point], self.edges.ys[point])
                part = self._put(time, until)
                self._begin(part, self.edges.xs[point], self.edges.ys[point])
        self.edges.find(edge, end)
        return self._end(part, self.edges.x, self.edges.y)

    def _put(self, since: float, until: float) -> int:
        """Add a segment; return its number."""
        part = self.parts
        if part == self.room:
            self.make_room(2 * part + 16)
        self.since[part] = since
        self.until[part] = until
        self.parts = part + 1
        return part

    def _begin(self, part: int, x: float, y: float) -> int:
        """Set the begin of a segment on the ground."""
        self.begins[3 * part] = x
        self.begins[3 * part + 1] = y
        self.begins[3 * part + 2] = 0.0
        return 0

    def _end(self, part: int, x: float, y: float) -> int:
        """Set the end of a segment on the ground."""
        self.ends[3 * part] = x
        self.ends[3 * part + 1] = y
        self.ends[3 * part + 2] = 0.0
        return 0

    def compute_coordinate(self, part: int, axis: int, time: float) -> float:
        """Return a coordinate on a segment at a time, by linear interpolation."""
        begin = self.begins[3 * part + axis]
        if self.until[part] <= self.since[part]:
            return begin
        share = (time - self.since[part]) / (self.until[part] - self.since[part])
        return begin + share * (self.ends[3 * part + axis] - begin)


class MotionIntervals:
    """Working memory: intervals of the movement of agents of one game, and an index of them by key.

    Attributes:
        agents: numbers of agents in the game.
        nodes: the node where the agent is, or the one that it moves to.
        legs: rows of legs; `ON_NODE`, `LEAVES`, or the node that the agent comes from.
        since, until: the times of the interval.
        begins, ends: shares of edges, or the smallest and the largest x of the interval.
        keys, next: the key of each entry, and the next entry with the same key; -1: none.
        first: (keys,) the first entry of each key; -1: none. All are -1 between two searches.
        order: a permutation of intervals.
    """

    def __init__(
        self,
        agents: memoryview[int],
        nodes: memoryview[int],
        legs: memoryview[int],
        since: memoryview[float],
        until: memoryview[float],
        begins: memoryview[float],
        ends: memoryview[float],
        keys: memoryview[int],
        next: memoryview[int],
        first: memoryview[int],
        order: memoryview[int],
    ) -> None:
        self.agents = agents
        self.nodes = nodes
        self.legs = legs
        self.since = since
        self.until = until
        self.begins = begins
        self.ends = ends
        self.keys = keys
        self.next = next
        self.first = first
        self.order = order
        self.count = 0

    def make_room(self, room: int) -> int:
        """Make room for `room` intervals, and keep the existing ones."""
        self.agents = extend_column("q", self.agents, room)
        self.nodes = extend_column("q", self.nodes, room)
        self.legs = extend_column("q", self.legs, room)
        self.since = extend_column("d", self.since, room)
        self.until = extend_column("d", self.until, room)
        self.begins = extend_column("d", self.begins, room)
        self.ends = extend_column("d", self.ends, room)
        self.keys = extend_column("q", self.keys, room)
        self.next = extend_column("q", self.next, room)
        self.order = extend_column("q", self.order, room)
        return 0

    def put(self, agent: int, node: int, leg: int, since: float, until: float) -> int:
        """Add an interval; return its number."""
        piece = self.count
        self.agents[piece] = agent
        self.nodes[piece] = node
        self.legs[piece] = leg
        self.since[piece] = since
        self.until[piece] = until
        self.count = piece + 1
        return piece

    def enter(self, entry: int, key: int) -> int:
        """Add an entry to the index under a key."""
        self.keys[entry] = key
        self.next[entry] = self.first[key]
        self.first[key] = entry
        return 0

    def forget(self, entries: int) -> int:
        """Remove the first `entries` entries from the index; entries with the key -1 are not in it."""
        for entry in range(entries):
            if self.keys[entry] >= 0:
                self.first[self.keys[entry]] = -1
        return 0


class Contacts:
    """Finds the contacts of a turn of one game.

    Call `ask` to set the agents and their paths, then `find`.

    Attributes:
        pieces: working memory.
        a, b: (room,) the numbers of both agents of each contact.
        a_nodes, b_nodes: (room,) their nodes.
        times, distances: (room,) the time and the distance of each contact.
        draws: (room,) random bits of the pair.
        on_edges: (room,) whether they met on an edge.
        order: (room,) the contacts by time, distance and random bits.
        room: the maximum number of contacts.
        count: the number of contacts found; if it is greater than `room`, the search is repeated with more room.
        kept: the number of contacts in `order`.
    """

    def __init__(self, pieces: MotionIntervals) -> None:
        self.pieces = pieces
        self.make_room(0)
        self.count = 0
        self.kept = 0

    def ask(
        self,
        tracks: Tracks,
        legs: Legs,
        names: memoryview[int],
        purpose: memoryview[int],
        turn: memoryview[int],
        *,
        reach: NearNodes,
        places: NodePositions,
        lines: PathSegments,
        crossing: bool,
        by_metres: bool,
    ) -> None:
        """Set the agents, paths and options of the next search.

        Args:
            tracks: the nodes that all agents pass.
            legs: the parts of edges that they cover.
            names: (agents,) the keys of their names.
            purpose: (1,) the key of the draws that decide ties.
            turn: (1,) the number of turns played.
            reach: distances between all nodes that agents pass, for paths along edges.
            places: positions on nodes, for places.
            lines: straight segments, for lines.
            crossing: whether agents also meet on edges.
            by_metres: whether the game is by metres.
        """
        self.tracks = tracks
        self.legs = legs
        self.names = names
        self.purpose = purpose
        self.turn = turn
        self.crossing = crossing
        self.by_metres = by_metres
        self.reach = reach
        self.places = places
        self.lines = lines
        self.limit = 0.0
        self.is_exact = False

    def make_room(self, contacts: int) -> int:
        """Allocate columns for `contacts` contacts; the previous contacts are lost."""
        ints = [memoryview(array("q", bytes(8 * contacts))) for _ in range(6)]
        self.a = ints[0]
        self.b = ints[1]
        self.a_nodes = ints[2]
        self.b_nodes = ints[3]
        self.on_edges = ints[4]
        self.order = ints[5]
        times: Any = memoryview(array("d", bytes(8 * contacts)))
        distances: Any = memoryview(array("d", bytes(8 * contacts)))
        self.times: memoryview[float] = times
        self.distances: memoryview[float] = distances
        self.draws = memoryview(array("Q", bytes(8 * contacts)))
        self.room = contacts
        return 0

    def find(self, search: int, limit: float) -> int:
        """Find contacts, with more room if necessary; return the number of contacts in `order`.

        Args:
            search: the kind of search, one of `SEARCHES`.
            limit: the maximum distance of a contact, in the unit of the kind.
        """
        self.limit = limit
        self.is_exact = search in (ON_WAYS, ON_LINES)
        self._search(search)
        while self.count > self.room:
            self.make_room(2 * self.count)
            self._search(search)
        return self.kept

    def _search(self, search: int) -> int:
        """Find contacts by one of `SEARCHES`; if there are more than `room`, only count them."""
        self.count = 0
        self.kept = 0
        if search == ON_NODES:
            if not self.by_metres and not self._share_nodes(self.tracks.nodes, self.tracks.lengths, self.pieces.first):
                return 0
            self._find_on_nodes()
        elif search == BY_PATHS:
            self._find_near()
        elif search == ON_WAYS:
            self._find_within()
        elif search == NEAR_PLACES:
            self._put_steps()
            self._set_step_positions()
            self._sweep()
        else:
            self._put_lines()
            self._sweep()
        return self._finish()

    def _finish(self) -> int:
        """Add meetings on edges, and sort the contacts in `order`."""
        if self.crossing:
            if self.by_metres:
                self._find_on_streets()
            else:
                self._pass_by()
        if self.count == 0 or self.count > self.room:
            return 0
        for contact in range(self.count):
            pair = draws.mix(self.names[self.a[contact]]) ^ self.names[self.b[contact]]
            key = draws.compute_turn_key(draws.compute_first_key(self.purpose[0], pair), self.turn[0])
            self.draws[contact] = draws.compute_bits(key, 0)
            self.order[contact] = contact
        self.kept = self.count
        if self.by_metres:
            self._sort(self.order, 0, self.kept, BY_PAIR)
            self._drop_repeated()
        self._sort(self.order, 0, self.kept, BY_RANK)
        return 0

    def _drop_repeated(self) -> int:
        """Remove contacts of a pair that were found twice, or while it stays near, in games by metres."""
        kept = 0
        previous = -1
        has_been_near = False
        before = -INFINITE
        for place in range(self.count):
            contact = self.order[place]
            if previous < 0 or self.a[contact] != self.a[previous] or self.b[contact] != self.b[previous]:
                has_been_near = False
                before = -INFINITE
            previous = contact
            if self.is_exact and not self.on_edges[contact]:
                if has_been_near:
                    continue
                has_been_near = True
            if self.times[contact] - before > SLACK:  # else it was found on the node or the next edge, too
                self.order[kept] = contact
                kept += 1
            before = self.times[contact]
        self.kept = kept
        return 0

    def _meet(self, time: float, distance: float, on_edge: int, a: int, b: int, a_node: int, b_node: int) -> int:
        """Add a contact of two agents, unless they are the same."""
        if a == b:
            return 0
        contact = self.count
        self.count = contact + 1
        if contact < self.room:
            self.times[contact] = time
            self.distances[contact] = distance
            self.on_edges[contact] = on_edge
            self.a[contact] = a
            self.b[contact] = b
            self.a_nodes[contact] = a_node
            self.b_nodes[contact] = b_node
        return 0

    # -- the intervals of the agents -----------------------------------------------------------------------------------

    def _share_nodes(self, nodes: memoryview[int], lengths: memoryview[int], first: memoryview[int]) -> bool:
        """Return whether agents of both sides pass a common node; a quick test before the search.

        Args:
            nodes: those of `tracks`.
            lengths: those of `tracks`.
            first: the column of `pieces`, as working memory.
        """
        most = self.tracks.most
        found = False
        for agent in range(self.tracks.agents):
            if self.tracks.sides[agent] & THEIRS:
                for place in range(agent * most, agent * most + lengths[agent]):
                    first[nodes[place]] = 0
        for agent in range(self.tracks.agents):
            if self.tracks.sides[agent] & OURS and not found:
                for place in range(agent * most, agent * most + lengths[agent]):
                    found = found or first[nodes[place]] == 0
        for agent in range(self.tracks.agents):
            if self.tracks.sides[agent] & THEIRS:
                for place in range(agent * most, agent * most + lengths[agent]):
                    first[nodes[place]] = -1
        return found

    def _put_steps(self) -> int:
        """List the intervals between nodes: the node that each agent passed last, and from when until when."""
        self.pieces.count = 0
        soonest = INFINITE  # when the first of them reaches a node
        for agent in range(self.tracks.agents):
            if self.tracks.sides[agent] and self.tracks.lengths[agent] > 1:
                soonest = min(soonest, self.tracks.times[agent * self.tracks.most + 1])
        for agent in range(self.tracks.agents):
            if not self.tracks.sides[agent]:
                continue
            first = agent * self.tracks.most
            last = first + self.tracks.lengths[agent] - 1
            if self.tracks.at_end:
                piece = self.pieces.put(agent, self.tracks.nodes[last], ON_NODE, 1.0, INFINITE)
                self.pieces.keys[piece] = last - first
                continue
            for place in range(first, last + 1):
                until = INFINITE if place == last else self.tracks.times[place + 1]
                leg = (
                    LEAVES
                    if place == first and place < last and not is_there(self.tracks, self.legs, agent)
                    else ON_NODE
                )
                if (
                    leg == ON_NODE or until > soonest
                ):  # else no agent arrives while this one counts as on its first node
                    piece = self.pieces.put(agent, self.tracks.nodes[place], leg, self.tracks.times[place], until)
                    self.pieces.keys[piece] = place - first
        return 0

    def _put_legs(self, are_known: bool) -> int:
        """Add the parts of edges that agents cover, or with `at_end`, their final positions on edges.

        Args:
            are_known: whether to skip edges of unknown position.
        """
        for agent in range(self.tracks.agents):
            if not self.tracks.sides[agent] or not self.legs.most or not self.legs.counts[agent]:
                continue
            leg = agent * self.legs.most
            last = leg + self.legs.counts[agent] - 1
            if self.tracks.at_end:
                leg = last
                if self.legs.ends[last] <= 0.0 or self.legs.ends[last] >= 1.0:
                    continue
            for one in range(leg, last + 1):
                if are_known and self.legs.flags[one] & UNKNOWN:
                    continue
                piece = self.pieces.put(agent, -1, one, self.legs.since[one], self.legs.until[one])
                self.pieces.begins[piece] = self.legs.begins[one]
                self.pieces.ends[piece] = self.legs.ends[one]
                if self.tracks.at_end:
                    self.pieces.begins[piece] = self.legs.ends[one]
                    self.pieces.since[piece] = 1.0
                    self.pieces.until[piece] = 1.0
        return 0

    def _is_of(self, piece: int, side: int) -> bool:
        """Return whether the agent of an interval is of a side."""
        return (self.tracks.sides[self.pieces.agents[piece]] & side) != 0

    def _find_node(self, agent: int, time: float) -> int:
        """Return the node that an agent passed last; a node reached immediately after the time counts, too."""
        first = agent * self.tracks.most
        last = first + self.tracks.lengths[agent] - 1
        if not self.tracks.at_end:
            while last > first and self.tracks.times[last] > time + SLACK:
                last -= 1
        return self.tracks.nodes[last]

    # -- at the same place ---------------------------------------------------------------------------------------------

    def _find_on_nodes(self) -> int:
        """Find the pairs that are on the same node at the same time."""
        put_visits(self.tracks, self.legs, self.pieces)
        slack = SLACK if self.by_metres else 0.0
        for piece in range(self.pieces.count):
            self.pieces.keys[piece] = -1
            if self._is_of(piece, THEIRS):
                self.pieces.enter(piece, self.pieces.nodes[piece])
        for piece in range(self.pieces.count):
            if self._is_of(piece, OURS):
                node = self.pieces.nodes[piece]
                other = self.pieces.first[node]
                while other >= 0:
                    if (
                        self.pieces.since[piece] <= self.pieces.until[other] + slack
                        and self.pieces.since[other] <= self.pieces.until[piece] + slack
                    ):
                        time = max(self.pieces.since[piece], self.pieces.since[other])
                        self._meet(time, 0.0, 0, self.pieces.agents[piece], self.pieces.agents[other], node, node)
                    other = self.pieces.next[other]
        self.pieces.forget(self.pieces.count)
        return 0

    def _pass_by(self) -> int:
        """Find the pairs that pass each other on an edge in opposite directions, in a game that counts edges."""
        self.pieces.count = 0
        for agent in range(self.tracks.agents):
            if self.tracks.sides[agent]:
                first = agent * self.tracks.most
                for place in range(first, first + self.tracks.lengths[agent] - 1):
                    if self.tracks.nodes[place] != self.tracks.nodes[place + 1]:
                        piece = self.pieces.put(
                            agent,
                            self.tracks.nodes[place + 1],
                            self.tracks.nodes[place],
                            self.tracks.times[place],
                            self.tracks.times[place + 1],
                        )
                        self.pieces.keys[piece] = -1
                        if self.tracks.sides[agent] & THEIRS:
                            self.pieces.enter(piece, self.tracks.nodes[place + 1])
        for piece in range(self.pieces.count):
            if self._is_of(piece, OURS):
                source = self.pieces.legs[piece]
                other = self.pieces.first[source]
                while other >= 0:
                    if (
                        self.pieces.legs[other] == self.pieces.nodes[piece]
                        and self.pieces.since[piece] < self.pieces.until[other]
                        and self.pieces.since[other] < self.pieces.until[piece]
                    ):  # otherwise one enters the edge when the other leaves it: they meet on the node
                        a = self.pieces.agents[piece]
                        b = self.pieces.agents[other]
                        time = max(self.pieces.since[piece], self.pieces.since[other])
                        if self.tracks.at_end:
                            self._meet(1.0, 0.0, 1, a, b, self._find_node(a, 1.0), self._find_node(b, 1.0))
                        else:
                            self._meet(time, 0.0, 1, a, b, source, self.pieces.legs[other])
                    other = self.pieces.next[other]
        self.pieces.forget(self.pieces.count)
        return 0

    def _find_on_streets(self) -> int:
        """Find the pairs at the same point of a street at the same time: they pass, overtake, or stand together."""
        self.pieces.count = 0
        self._put_legs(False)
        for piece in range(self.pieces.count):
            self.pieces.keys[piece] = -1
            if self._is_of(piece, THEIRS):
                self.pieces.enter(piece, self.legs.streets[self.pieces.legs[piece]])
        for piece in range(self.pieces.count):
            if self._is_of(piece, OURS):
                other = self.pieces.first[self.legs.streets[self.pieces.legs[piece]]]
                while other >= 0:
                    time = self._find_first_touch(piece, other)
                    if time >= 0.0:
                        a = self.pieces.agents[piece]
                        b = self.pieces.agents[other]
                        self._meet(time, 0.0, 1, a, b, self._find_node(a, time), self._find_node(b, time))
                    other = self.pieces.next[other]
        self.pieces.forget(self.pieces.count)
        return 0

    def _find_first_touch(self, piece: int, other: int) -> float:
        """Return the first time when two agents on a street are at the same point; -1: never, or only at the start."""
        since = max(self.pieces.since[piece], self.pieces.since[other])
        until = min(self.pieces.until[piece], self.pieces.until[other])
        if since > until:
            return -1.0
        gap = self._find_place_on_street(piece, since) - self._find_place_on_street(other, since)
        later = self._find_place_on_street(piece, until) - self._find_place_on_street(other, until)
        if fabs(gap) <= SLACK:
            return since if since > 0.0 or fabs(later) <= SLACK else -1.0
        if gap * later < 0.0:
            return since + (until - since) * gap / (gap - later)
        return until if fabs(later) <= SLACK else -1.0

    def _find_place_on_street(self, piece: int, time: float) -> float:
        """Return the position of an agent on its street at a time, as a share."""
        begin = self.pieces.begins[piece]
        share = self.pieces.ends[piece]
        if self.pieces.until[piece] > self.pieces.since[piece]:
            span = self.pieces.until[piece] - self.pieces.since[piece]
            share = begin + (share - begin) * (time - self.pieces.since[piece]) / span
        return 1.0 - share if self.legs.flags[self.pieces.legs[piece]] & BACKWARDS else share

    # -- within a distance of the nodes passed last --------------------------------------------------------------------

    def _find_near(self) -> int:
        """Find the pairs within the distance along edges, tested whenever one of the two reaches a node."""
        self.reach.begin()
        self._put_steps()
        for side in range(2):  # paths from ours to theirs, and then those back
            for piece in range(self.pieces.count):
                self.pieces.keys[piece] = -1
                if self._is_of(piece, OURS if side else THEIRS):
                    self.pieces.enter(piece, self.pieces.nodes[piece])
            for piece in range(self.pieces.count):
                if not self._is_of(piece, THEIRS if side else OURS):
                    continue
                node = self.pieces.nodes[piece]
                begin = self.reach.learn(node)
                for entry in range(begin, self.reach.find_end(node)):
                    other = self.pieces.first[self.reach.ends[entry]]
                    if other < 0:
                        continue
                    back = self.reach.get_distance(self.reach.ends[entry], node)
                    if side and back < INFINITE:  # then it was found from the other side
                        continue
                    distance = min(self.reach.far[entry], back)
                    while other >= 0:
                        if side:
                            self._add_near(other, piece, distance)
                        else:
                            self._add_near(piece, other, distance)
                        other = self.pieces.next[other]
            self.pieces.forget(self.pieces.count)
        return 0

    def _add_near(self, piece: int, other: int, distance: float) -> int:
        """Add a contact at the later of two arrivals, if the other agent has not moved on."""
        time = max(self.pieces.since[piece], self.pieces.since[other])
        if time >= self.pieces.until[piece] or time >= self.pieces.until[other]:
            return 0
        if self.pieces.legs[piece] == LEAVES and self.pieces.since[piece] == time:
            return 0
        if self.pieces.legs[other] == LEAVES and self.pieces.since[other] == time:
            return 0
        a_node = self.pieces.nodes[piece]
        b_node = self.pieces.nodes[other]
        return self._meet(time, distance, 0, self.pieces.agents[piece], self.pieces.agents[other], a_node, b_node)

    # -- in a straight line --------------------------------------------------------------------------------------------

    def _sweep(self) -> int:
        """Find the pairs of intervals within a straight-line distance, by a sweep over x."""
        theirs = 0
        width = 0.0
        farthest = 0.0
        for piece in range(self.pieces.count):
            farthest = max(farthest, fabs(self.pieces.begins[piece]), fabs(self.pieces.ends[piece]))
            if self._is_of(piece, THEIRS):
                width = max(width, self.pieces.ends[piece] - self.pieces.begins[piece])
                self.pieces.order[theirs] = piece
                theirs += 1
        self._sort(self.pieces.order, 0, theirs, BY_PLACE)
        rim = self.limit + SLACK * (self.limit + farthest)  # the limit plus rounding errors
        for piece in range(self.pieces.count):
            if self._is_of(piece, OURS):
                first = 0
                last = theirs
                while first < last:
                    middle = (first + last) >> 1
                    if self.pieces.begins[self.pieces.order[middle]] < self.pieces.begins[piece] - rim - width:
                        first = middle + 1
                    else:
                        last = middle
                while first < theirs and self.pieces.begins[self.pieces.order[first]] <= self.pieces.ends[piece] + rim:
                    if self.by_metres:
                        self._approach(piece, self.pieces.order[first])
                    else:
                        self._step_near(piece, self.pieces.order[first])
                    first += 1
        return 0

    def _put_lines(self) -> int:
        """List the straight segments of the paths of agents."""
        self.lines.fill(self.tracks, self.legs, self.pieces)
        if self.lines.parts > len(self.pieces.agents):
            self.pieces.make_room(2 * self.lines.parts)
        self.pieces.count = 0
        for agent in range(self.tracks.agents):
            if self.tracks.sides[agent]:
                for part in range(self.lines.offsets[agent], self.lines.offsets[agent + 1]):
                    piece = self.pieces.put(agent, -1, part, self.lines.since[part], self.lines.until[part])
                    self.pieces.begins[piece] = min(self.lines.begins[3 * part], self.lines.ends[3 * part])
                    self.pieces.ends[piece] = max(self.lines.begins[3 * part], self.lines.ends[3 * part])
        return 0

    def _set_step_positions(self) -> int:
        """Set the positions of the steps for `_sweep`, and their keys to the numbers of these positions."""
        for piece in range(self.pieces.count):
            agent = self.pieces.agents[piece]
            place = self.places.numbers[agent * self.tracks.most + self.pieces.keys[piece]]
            self.pieces.keys[piece] = place
            self.pieces.begins[piece] = self.places.xyz[3 * place]
            self.pieces.ends[piece] = self.places.xyz[3 * place]
        return 0

    def _step_near(self, piece: int, other: int) -> int:
        """Add a contact of two agents on nodes, if they are within the distance."""
        a = 3 * self.pieces.keys[piece]
        b = 3 * self.pieces.keys[other]
        x = self.places.xyz[a] - self.places.xyz[b]
        y = self.places.xyz[a + 1] - self.places.xyz[b + 1]
        z = self.places.xyz[a + 2] - self.places.xyz[b + 2]
        far = x * x + y * y + z * z
        if far <= self.limit * self.limit:  # squares, because they are exact on every machine
            self._add_near(piece, other, sqrt(far))
        return 0

    def _approach(self, piece: int, other: int) -> int:
        """Add a contact at the first time when two agents on straight segments are within the distance."""
        part = self.pieces.legs[piece]
        their = self.pieces.legs[other]
        since = max(self.lines.since[part], self.lines.since[their])
        until = min(self.lines.until[part], self.lines.until[their])
        if since > until:
            return 0
        limit = self.limit * self.limit
        x = self.lines.compute_coordinate(part, 0, since) - self.lines.compute_coordinate(their, 0, since)
        y = self.lines.compute_coordinate(part, 1, since) - self.lines.compute_coordinate(their, 1, since)
        z = self.lines.compute_coordinate(part, 2, since) - self.lines.compute_coordinate(their, 2, since)
        far = x * x + y * y + z * z
        if far <= limit:
            return self._meet_on_way(since, sqrt(far), piece, other)
        dx = self.lines.compute_coordinate(part, 0, until) - self.lines.compute_coordinate(their, 0, until) - x
        dy = self.lines.compute_coordinate(part, 1, until) - self.lines.compute_coordinate(their, 1, until) - y
        dz = self.lines.compute_coordinate(part, 2, until) - self.lines.compute_coordinate(their, 2, until) - z
        square = dx * dx + dy * dy + dz * dz
        mixed = x * dx + y * dy + z * dz
        # |gap + share * change| = limit is a quadratic equation; its smaller root is when they come near.
        inside = mixed * mixed - square * (far - limit)
        if square == 0.0 or inside < 0.0:
            return 0
        share = (-mixed - sqrt(inside)) / square
        if 0.0 <= share <= 1.0:
            self._meet_on_way(since + share * (until - since), self.limit, piece, other)
        return 0

    def _meet_on_way(self, time: float, distance: float, piece: int, other: int) -> int:
        """Add a contact of two agents at their positions at a time, on nodes or between them."""
        a = self.pieces.agents[piece]
        b = self.pieces.agents[other]
        a_node = self._find_node(a, time)
        b_node = self._find_node(b, time)
        return self._meet(time, distance, 0, a, b, a_node, b_node)

    # -- within a distance along edges, with exact positions -----------------------------------------------------------

    def _find_within(self) -> int:
        """Find the pairs within the distance along edges, on nodes or between them."""
        self.reach.begin()
        put_visits(self.tracks, self.legs, self.pieces)
        self._put_legs(True)
        for side in range(2):  # paths from ours to theirs, and then those back
            # Paths reach an agent through at most two nodes: the entries 2 * piece and 2 * piece + 1.
            for piece in range(self.pieces.count):
                for end in range(2):
                    self.pieces.keys[2 * piece + end] = -1
                    if self._is_of(piece, OURS if side else THEIRS):
                        node = self._find_door(piece, end, True)
                        if node >= 0:
                            self.pieces.enter(2 * piece + end, node)
            for piece in range(self.pieces.count):
                if self._is_of(piece, THEIRS if side else OURS):
                    for end in range(2):
                        node = self._find_door(piece, end, False)
                        if node >= 0:
                            self._go_from(piece, end, node, side)
            self.pieces.forget(2 * self.pieces.count)
            for piece in range(self.pieces.count):
                self.pieces.keys[piece] = -1
                if self.pieces.legs[piece] >= 0 and self._is_of(piece, OURS if side else THEIRS):
                    self.pieces.enter(piece, self.legs.streets[self.pieces.legs[piece]])
            for piece in range(self.pieces.count):
                if self.pieces.legs[piece] >= 0 and self._is_of(piece, THEIRS if side else OURS):
                    other = self.pieces.first[self.legs.streets[self.pieces.legs[piece]]]
                    while other >= 0:
                        self._follow_street(piece, other, side)
                        other = self.pieces.next[other]
            self.pieces.forget(self.pieces.count)
        return 0

    def _find_door(self, piece: int, end: int, is_entry: bool) -> int:
        """Return a node through which paths leave or reach the position of an agent.

        Args:
            piece: the interval of the agent.
            end: 0: the node in the direction of the edge; 1: the other one, where agents can turn around.
            is_entry: whether paths reach the agent, rather than leave it.

        Returns:
            The node; -1: none.
        """
        leg = self.pieces.legs[piece]
        if leg < 0:
            return -1 if end else self.pieces.nodes[piece]
        if end and (not self.legs.flags[leg] & TURNS or self.legs.sources[leg] == self.legs.targets[leg]):
            return -1
        return self.legs.sources[leg] if (end == 1) != is_entry else self.legs.targets[leg]

    def _measure_distance(self, piece: int, is_source: bool, time: float) -> float:
        """Return the distance at a time between an agent and an end of its edge; 0 on a node."""
        leg = self.pieces.legs[piece]
        if leg < 0:
            return 0.0
        begin = self.pieces.begins[piece]
        end = self.pieces.ends[piece]
        if not is_source:
            begin = 1.0 - begin
            end = 1.0 - end
        return self._interpolate(piece, begin * self.legs.lengths[leg], end * self.legs.lengths[leg], time)

    def _interpolate(self, piece: int, begin: float, end: float, time: float) -> float:
        """Return the value at a time of a quantity that changes linearly during an interval."""
        since = self.pieces.since[piece]
        until = self.pieces.until[piece]
        return end if until <= since else begin + (end - begin) * (time - since) / (until - since)

    def _go_from(self, piece: int, end: int, node: int, side: int) -> int:
        """Follow the paths that leave the position of an agent through a node.

        The lengths of these paths change linearly while both intervals last.
        """
        first = self.reach.learn(node)
        for row in range(first, self.reach.find_end(node)):
            entry = self.pieces.first[self.reach.ends[row]]
            while entry >= 0:
                other = entry >> 1
                since = max(self.pieces.since[piece], self.pieces.since[other])
                until = min(self.pieces.until[piece], self.pieces.until[other])
                if since <= until:
                    is_source = (entry & 1) == 0
                    begin = self.reach.far[row] + self._measure_distance(piece, end == 1, since)
                    begin += self._measure_distance(other, is_source, since)
                    last = self.reach.far[row] + self._measure_distance(piece, end == 1, until)
                    last += self._measure_distance(other, is_source, until)
                    self._add_within(piece, other, since, until, begin, last, side)
                entry = self.pieces.next[entry]
        return 0

    def _follow_street(self, piece: int, other: int, side: int) -> int:
        """Follow the path between two agents along the street that both are on."""
        since = max(self.pieces.since[piece], self.pieces.since[other])
        until = min(self.pieces.until[piece], self.pieces.until[other])
        if since > until:
            return 0
        length = self.legs.lengths[self.pieces.legs[piece]]
        first = (self._interpolate_street_share(piece, since) - self._interpolate_street_share(other, since)) * length
        last = (self._interpolate_street_share(piece, until) - self._interpolate_street_share(other, until)) * length
        if first * last < 0.0:  # they pass each other
            passing = since + (until - since) * first / (first - last)
            return self._add_within(piece, other, since, passing, fabs(first), 0.0, side)
        return self._add_within(piece, other, since, until, fabs(first), fabs(last), side)

    def _interpolate_street_share(self, piece: int, time: float) -> float:
        """Return the position of an agent on its street at a time, as a share, by interpolation between the ends."""
        begin = self.pieces.begins[piece]
        end = self.pieces.ends[piece]
        if self.legs.flags[self.pieces.legs[piece]] & BACKWARDS:
            begin = 1.0 - begin
            end = 1.0 - end
        return self._interpolate(piece, begin, end, time)

    def _add_within(
        self, piece: int, other: int, since: float, until: float, begin: float, end: float, side: int
    ) -> int:
        """Add a contact at the first time within the distance, when the distance changes linearly between two times."""
        if side:
            piece, other = other, piece
        if begin <= self.limit:
            return self._meet_on_way(since, begin, piece, other)
        if end <= self.limit:
            time = since + (until - since) * (begin - self.limit) / (begin - end)
            return self._meet_on_way(time, self.limit, piece, other)
        return 0

    # -- order ---------------------------------------------------------------------------------------------------------

    def _is_before(self, one: int, other: int, by: int) -> bool:
        """Return whether a contact comes before another, or an interval begins west of another."""
        found = 0
        if by == BY_PLACE:
            found = compare_numbers(self.pieces.begins[one], self.pieces.begins[other])
        else:
            if by == BY_PAIR:
                found = compare_numbers(self.a[one], self.a[other])
                found = found or compare_numbers(self.b[one], self.b[other])
            found = found or compare_numbers(self.times[one], self.times[other])
            found = found or compare_numbers(self.distances[one], self.distances[other])
            if not found and self.draws[one] != self.draws[other]:
                found = -1 if self.draws[one] < self.draws[other] else 1
            found = found or compare_numbers(self.on_edges[one], self.on_edges[other])
        return found < 0 or (found == 0 and one < other)

    def _sort(self, order: memoryview[int], first: int, last: int, by: int) -> int:
        """Sort the part `first` to `last - 1` of an order of contacts or intervals, by heapsort."""
        count = last - first
        for root in range((count >> 1) - 1, -1, -1):
            self._sink(order, first, root, count, by)
        for end in range(count - 1, 0, -1):
            least = order[first]
            order[first] = order[first + end]
            order[first + end] = least
            self._sink(order, first, 0, end, by)
        return 0

    def _sink(self, order: memoryview[int], first: int, root: int, count: int, by: int) -> int:
        """Move an item of a heap down until no child comes after it."""
        item = order[first + root]
        child = 2 * root + 1
        while child < count:
            if child + 1 < count and self._is_before(order[first + child], order[first + child + 1], by):
                child += 1
            if not self._is_before(item, order[first + child], by):
                break
            order[first + root] = order[first + child]
            root = child
            child = 2 * root + 1
        order[first + root] = item
        return 0


def put_visits(tracks: Tracks, legs: Legs, pieces: MotionIntervals) -> int:
    """List the intervals in which agents are on nodes; a node that is left at time 0 is no visit of this turn."""
    pieces.count = 0
    for agent in range(tracks.agents):
        if not tracks.sides[agent]:
            continue
        first = agent * tracks.most
        last = first + tracks.lengths[agent] - 1
        leg = agent * legs.most
        beyond = leg + (legs.counts[agent] if legs.most else 0)
        if tracks.at_end:
            if beyond == leg or legs.ends[beyond - 1] <= 0.0 or legs.ends[beyond - 1] >= 1.0:
                pieces.put(agent, tracks.nodes[last], ON_NODE, 1.0, 1.0)
        elif beyond > leg:
            if is_there(tracks, legs, agent):
                pieces.put(agent, tracks.nodes[first], ON_NODE, tracks.times[first], legs.since[leg])
            for one in range(leg, beyond):
                if legs.begins[one] != legs.ends[one] and (legs.ends[one] == 0.0 or legs.ends[one] == 1.0):
                    node = legs.targets[one] if legs.ends[one] == 1.0 else legs.sources[one]
                    until = legs.since[one + 1] if one + 1 < beyond else 1.0
                    pieces.put(agent, node, ON_NODE, legs.until[one], until)
        else:
            for place in range(first if is_there(tracks, legs, agent) else first + 1, last + 1):
                until = tracks.times[place]
                if place == last:
                    until = 1.0
                elif tracks.nodes[place + 1] == tracks.nodes[place]:
                    until = tracks.times[place + 1]
                pieces.put(agent, tracks.nodes[place], ON_NODE, tracks.times[place], until)
    return 0


def is_there(tracks: Tracks, legs: Legs, agent: int) -> bool:
    """Return whether an agent stays on its first node for a time, rather than leaving it at once."""
    first = agent * tracks.most
    if legs.most and legs.counts[agent]:
        leg = agent * legs.most
        return legs.since[leg] > tracks.times[first] and (legs.begins[leg] == 0.0 or legs.begins[leg] == 1.0)
    return tracks.lengths[agent] == 1 or tracks.nodes[first] == tracks.nodes[first + 1]


def compare_numbers(one: float, other: float) -> int:
    """Return -1 if a number is less than another, 1 if it is greater, else 0."""
    return (one > other) - (one < other)
