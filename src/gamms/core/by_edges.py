"""Moves of one game with speeds in edges per turn: agents decide, resolve conflicts, and move.

An agent that covers only part of an edge stays on its node, and keeps this part for the next turn if it moves in the
same direction.
"""
# ruff: noqa: ARG002 - a kind of movement reads no arguments that only others need

from __future__ import annotations

from math import floor
from typing import Any

from gamms.core import draws, moves, rules, strategies, travel
from gamms.core.moves import LegalMoves, TripMovers
from gamms.core.rules import GameColumns
from gamms.core.travel import GoalPaths, LegalNodes, ReachSearch, TurnPaths


class LegalByEdges(LegalNodes):
    """The legal nodes of agents by speeds in edges: neighbors, nodes within the speed, and nodes beyond a partial edge.

    Attributes:
        streets: the legal moves along one edge.
        first: the place of the first node of the map in use; see `LegalMoves`.
    """

    def __init__(self, streets: LegalMoves, reach: ReachSearch) -> None:
        super().__init__(reach)
        self.streets = streets
        self.first = 0

    def find(self, node: int, edge: int, share: float, motion: int, speed: float, now: float) -> int:
        """Find the legal nodes of an agent; return their number. `edge` is the node at the end of a partial edge."""
        self.reach.search += 1
        self.reach.found = 0
        at = self.first + node
        for place in range(self.streets.offsets[at], self.streets.offsets[at + 1]):
            travel.list_node(self.reach, self.streets.targets[place], 0.0)
        if speed == speed:  # noqa: PLR0124 - NaN
            list_within(self, node, whole_edges(speed))
            if edge >= 0 and is_next(self, node, edge):
                list_within(self, edge, whole_edges(speed + share) - 1)
        return self.reach.found


class EdgePaths:
    """Finds the paths of agents in a turn, along several edges or parts of edges.

    In `TurnPaths`, `edge` and `share` are then the node ahead, at the end of a partly covered edge, and the covered
    share; there are no legs.

    Attributes:
        trips: the paths.
        legal: finds the legal nodes of one agent.
        hops: shortest paths by the number of edges.
    """

    def __init__(self, trips: TurnPaths, streets: LegalMoves, hops: GoalPaths) -> None:
        self.trips = trips
        self.hops = hops
        self.legal = LegalByEdges(streets, self.hops.reach)

    def take(self, streets: LegalMoves) -> None:
        """Replace the legal moves."""
        self.legal.streets = streets


class EdgeMovers(TripMovers):
    """The agents of games with speeds in edges per turn; rows are as in `rules.GameColumns`.

    `GameColumns.edge` holds the node ahead, at the end of a partly covered edge, and `GameColumns.share` the covered
    share.

    Attributes:
        paths: finds the paths.
        long_ways: the shortest paths of agents that go beyond their legal nodes, if some do (`goes_far`).
        speeds: (agents,) edges per turn; NaN: the agent moves along one edge.
    """

    def __init__(
        self,
        paths: EdgePaths,
        long_ways: GoalPaths | None,
        *movers: Any,
        speeds: memoryview[float],
        has_all: bool,
        **columns: Any,
    ) -> None:
        self.paths = paths
        super().__init__(self.paths.trips, *movers, has_all=has_all, **columns)
        self.long_ways = long_ways
        self.goes_far = long_ways is not None
        self.speeds = speeds

    def decide(self, games: GameColumns, game: int) -> int:
        """Choose the moves of the living agents in this part of the turn, and write their paths; all others stay."""
        part = self.part[game]
        if self.kind_ends[moves.IS_GIVEN] < self.kind_ends[moves.STEPS]:
            strategies.begin(self.by_steps, game)  # type: ignore[arg-type] # there are some
        for i in range(games.agents):
            row = game * games.agents + i
            if part == 0:
                moves.set_out(games, self, row)
            use_edges(self, rules.first_place(games, game, i))
            if self.part_of[i] == part:
                choose(games, self, game, i)
            elif self.part_of[i] > part:
                stand(games, self, row, i)
            if self.part_of[i] != part:
                self.ends[row] = games.node[row]
        return 0

    def goes(self, games: GameColumns, game: int, i: int) -> bool:
        """Return whether an agent leaves its node, or covers part of an edge."""
        return self.trips.passed[self.first + i] > 1 or self.trips.edge[self.first + i] >= 0

    def stay(self, games: GameColumns, game: int, i: int) -> int:
        """Undo the move of an agent: it stays at its node for the whole turn."""
        row = game * games.agents + i
        self.ends[row] = games.node[row]
        return stand(games, self, row, i)

    def go_all(self, games: GameColumns, game: int) -> int:
        """Move the agents of this part of the turn to the ends of their moves."""
        part = self.part[game]
        for i in range(games.agents):
            if self.part_of[i] == part:
                go(games, self, game, i)
        return 0


# -- one agent -------------------------------------------------------------------------------------------------------


def begin(walks: EdgePaths, row: int, node: int, ahead: int, covered: float, speed: float) -> int:
    """Place an agent on its start node; the covered part of an edge that no longer exists is dropped."""
    at = ahead if ahead >= 0 and is_next(walks.legal, node, ahead) else -1
    return travel.begin(walks.trips, row, node, at, covered, 0, 0.0, speed, 0)


def is_next(legal: LegalByEdges, node: int, other: int) -> bool:
    """Return whether the nodes are equal or an edge leads from the first to the second."""
    found = False
    at = legal.first + node
    for place in range(legal.streets.offsets[at], legal.streets.offsets[at + 1]):
        found = found or legal.streets.targets[place] == other
    return found


def list_legal(walks: EdgePaths, row: int) -> int:
    """Find the legal nodes of an agent on its start node; return their number."""
    node = walks.trips.node[row]
    ahead = walks.trips.edge[row]
    return walks.legal.find(node, ahead, walks.trips.share[row], 0, walks.trips.speed[row], 0.0)


def whole_edges(budget: float) -> float:
    """Return the number of whole edges within a budget, up to rounding errors."""
    return floor(budget * (1.0 + travel.SLACK))


def list_within(legal: LegalByEdges, node: int, hops: float) -> int:
    """Append all nodes at most `hops` edges from a node, ordered by row; found by breadth-first search."""
    if hops < 0:
        return 0
    legal.reach.seen[0] = node
    legal.reach.when[node] = 0.0
    legal.reach.places[node] = 1
    legal.reach.count = 1
    number = 0
    while number < legal.reach.count:
        at = legal.reach.seen[number]
        number += 1
        if legal.reach.when[at] + 1.0 <= hops:
            here = legal.first + at
            for place in range(legal.streets.offsets[here], legal.streets.offsets[here + 1]):
                other = legal.streets.targets[place]
                if legal.reach.places[other] == 0:
                    legal.reach.places[other] = 1
                    legal.reach.when[other] = legal.reach.when[at] + 1.0
                    legal.reach.seen[legal.reach.count] = other
                    legal.reach.count += 1
    travel.sort_seen(legal.reach)
    for place in range(number):
        travel.list_node(legal.reach, legal.reach.seen[place], 0.0)
    return 0


def go_towards(walks: EdgePaths, row: int, ways: GoalPaths, memory: int, target: int) -> bool:
    """Move an agent toward a node until the turn is over; return whether it can.

    It takes a path with the fewest edges, and continues its partial edge if that is no longer.

    Args:
        walks: the paths; the agent is on its start node.
        row: the row of the agent.
        ways: its shortest paths: `walks.hops`, or others.
        memory: the row of `ways` that holds the paths of the agent.
        target: the node.
    """
    node = walks.trips.node[row]
    if walks.trips.speed[row] != walks.trips.speed[row]:  # NaN
        walks.trips.route[0] = target
        walk(walks, row, 1)
        return True
    by_hops = ways is walks.hops
    first = target
    if not by_hops or not is_next(walks.legal, node, target):
        first = travel.following(ways, memory, node, target)
        if first == node:
            return False
    ahead = walks.trips.edge[row]
    if by_hops and ahead >= 0 and ahead != first:
        onward = travel.distance(ways, memory, ahead, target) if ahead != target else 0.0
        if 1.0 - walks.trips.share[row] + onward <= travel.distance(ways, memory, node, target):
            first = ahead
    walks.trips.route[0] = first
    count = 1
    while walks.trips.route[count - 1] != target and count <= whole_edges(walks.trips.speed[row] + 1.0):
        walks.trips.route[count] = travel.following(ways, memory, walks.trips.route[count - 1], target)
        count += 1
    walk(walks, row, count)
    return True


def walk(walks: EdgePaths, row: int, count: int) -> int:
    """Move an agent along the first `count` nodes of the route, at least one, as far as its speed allows."""
    budget = 1.0
    speed = walks.trips.speed[row]
    if speed == speed:  # noqa: PLR0124 - not NaN
        budget = speed + (walks.trips.share[row] if walks.trips.route[0] == walks.trips.edge[row] else 0.0)
    walks.trips.edge[row] = -1
    walks.trips.share[row] = 0.0
    edges = 0
    first = row * (walks.trips.most + 1)
    while edges < count and edges < whole_edges(budget):
        edges += 1
        walks.trips.nodes[first + edges] = walks.trips.route[edges - 1]
    walks.trips.passed[row] = edges + 1
    walks.trips.node[row] = walks.trips.nodes[first + edges]
    for place in range(1, edges + 1):
        walks.trips.times[first + place] = place / edges
    left = budget - edges
    if edges < count and walks.trips.route[edges] != walks.trips.node[row] and travel.SLACK < left < 1.0:
        walks.trips.edge[row] = walks.trips.route[edges]
        walks.trips.share[row] = left
    return 0


# -- the agents of a game --------------------------------------------------------------------------------------------


def use_edges(w: EdgeMovers, first: int) -> int:
    """Use the edges of the map, and of the mode, whose first node is at a place."""
    w.paths.legal.first = first
    w.paths.hops.roads.use(first)
    if w.goes_far:
        w.long_ways.roads.use(first)  # type: ignore[union-attr] # there are some
    return 0


def stand(games: GameColumns, w: EdgeMovers, row: int, i: int) -> int:
    """Let an agent stay on its node."""
    return begin(w.paths, w.first + i, games.node[row], -1, 0.0, w.speeds[i])


def choose(games: GameColumns, w: EdgeMovers, game: int, i: int) -> int:
    """Decide for an agent, and write its path through the turn."""
    row = game * games.agents + i
    own = w.first + i
    node = games.node[row]
    begin(w.paths, own, node, games.edge[row], games.share[row], w.speeds[i])
    target = -1
    count = 0
    if games.alive[row]:
        w.blocked[row] = 0
        if w.decides_by[i] == moves.IS_GIVEN and w.edges[row] >= 0:
            w.trips.route[0] = w.paths.hops.roads.targets[w.edges[row]]
            count = 1
        elif w.decides_by[i] == moves.IS_GIVEN and w.given[row] < 0:
            count = w.routes.take(row, w.trips.route)  # type: ignore[union-attr] # there are some
        else:
            target = target_of(games, w, game, i)
    if count > 0:
        walk(w.paths, own, count)
    elif target >= 0 and target != node:
        if w.paths.legal.reach.listed[target] == w.paths.legal.reach.search:
            go_towards(w.paths, own, w.paths.hops, row, target)
        else:
            go_towards(w.paths, own, w.long_ways, row, target)  # type: ignore[arg-type] # there are some
    else:
        stand(games, w, row, i)
    w.ends[row] = w.trips.node[own]
    return 0


def go(games: GameColumns, w: EdgeMovers, game: int, i: int) -> int:
    """Move an agent to the end of its move, and fit its path into its part of the turn."""
    row = game * games.agents + i
    own = w.first + i
    moves.go(games, w, row)
    games.edge[row] = w.trips.edge[own]
    games.share[row] = w.trips.share[own]
    if w.went[row] != games.node[row]:  # a rule has put it there
        w.trips.times[own * (w.trips.most + 1)] = 1.0
    if w.parts > 1 and w.trips.passed[own] > 1:
        travel.go_in_part(w.trips, own, w.part[game], w.parts)
    return 0


def target_of(games: GameColumns, w: EdgeMovers, game: int, i: int) -> int:
    """Return the node that an agent moves toward, by its own decision or a given action; -1: none."""
    row = game * games.agents + i
    by = w.decides_by[i]
    if by == moves.STAYS:
        return -1
    count = list_legal(w.paths, w.first + i)
    if by == moves.STEPS:
        strategies.take_legal(w.by_steps, w.paths.legal.reach.nodes, count)  # type: ignore[arg-type] # there are some
        w.by_steps.goes_far = w.speeds[i] == w.speeds[i]  # type: ignore[union-attr] # not NaN
        w.by_steps.drawn = 0  # type: ignore[union-attr]
        return strategies.act(w.by_steps, game, i)  # type: ignore[arg-type]
    if by == moves.IS_GIVEN:
        return w.paths.legal.reach.nodes[moves.as_legal(w.given[row], count)]
    return w.paths.legal.reach.nodes[draws.below_at(w.walks.keys[row], games.turn[game], 0, count)]
