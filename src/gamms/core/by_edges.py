"""Moves of one game with speeds in edges per turn: agents decide, resolve conflicts, and move.

An agent that covers only part of an edge stays on its node, and keeps this part for the next turn if it moves in the
same direction.
"""

from __future__ import annotations

from math import floor
from typing import Any

from gamms.core import draws, moves, strategies, travel
from gamms.core.moves import LegalMoves, OneEdgeMovers
from gamms.core.rules import AgentPaths, GameColumns
from gamms.core.travel import GoalPaths, LegalNodes, ReachSearch


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

    def find(self, node: int, edge: int, share: float, motion: int, speed: float, now: float) -> int:  # noqa: ARG002
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


class EdgePaths(AgentPaths):
    """The paths of the agents of one game in a turn, along several edges or parts of edges.

    Attributes:
        nodes, times, lengths: see `AgentPaths`; each agent has room for `most` nodes, beginning with its start node.
        legal: finds the legal nodes of one agent.
        hops: shortest paths by the number of edges.
        most: the maximum number of nodes of an agent.
        speeds: (agents,) edges per turn; NaN: the agent moves along one edge.
        ahead: (agents,) the node at the end of an edge that the agent has partly covered; -1: none.
        covered: (agents,) the covered share of this edge.
        route: (most,) the nodes of a route to follow; see `walk`.
        kept: the nodes, times and lengths of all games, if rules run after all games have moved (`keeps`).
    """

    def __init__(
        self,
        nodes: memoryview[int],
        times: memoryview[float],
        lengths: memoryview[int],
        streets: LegalMoves,
        hops: GoalPaths,
        most: int,
        *,
        speeds: memoryview[float],
        ahead: memoryview[int],
        covered: memoryview[float],
        route: memoryview[int],
        kept: AgentPaths | None = None,
    ) -> None:
        super().__init__(nodes, times, lengths)
        self.are_one_edge = False
        self.hops = hops
        self.legal = LegalByEdges(streets, self.hops.reach)
        self.most = most
        self.speeds = speeds
        self.ahead = ahead
        self.covered = covered
        self.route = route
        self.kept = kept
        self.keeps = kept is not None

    def take(self, streets: LegalMoves) -> None:
        """Replace the legal moves."""
        self.legal.streets = streets

    def fill(self, games: GameColumns, game: int) -> int:
        """Write the paths of the agents of a game; agents that a rule has placed elsewhere only get their node."""
        for agent in range(games.agents):
            row = game * games.agents + agent
            if self.keeps:
                copy_walk(self.kept, row, self, agent, self.most)  # type: ignore[arg-type] # there is one
            if games.placed[row]:
                begin(self, agent, games.node[row], -1, 0.0)
                self.times[agent * self.most] = 1.0
        return 0


class EdgeMovers(OneEdgeMovers):
    """The agents of games with speeds in edges per turn; rows are as in `rules.GameColumns`.

    `GameColumns.edge` holds the node ahead, at the end of a partly covered edge, and `GameColumns.share` the covered
    share.

    Attributes:
        paths: the paths of one game.
        long_ways: the shortest paths of agents that go beyond their legal nodes, if some do (`goes_far`).
        ahead, covered: (rows,) the values of `GameColumns.edge` and `GameColumns.share` after the moves.
    """

    def __init__(
        self,
        paths: EdgePaths,
        ahead: memoryview[int],
        covered: memoryview[float],
        long_ways: GoalPaths | None,
        *movers: Any,
        **columns: Any,
    ) -> None:
        super().__init__(*movers, **columns)
        self.paths = paths
        self.ahead = ahead
        self.covered = covered
        self.long_ways = long_ways
        self.goes_far = long_ways is not None
        self.keeps = self.paths.keeps

    def take_map(self, first: int) -> int:
        """Use the map whose first node has this place."""
        self.paths.legal.first = first
        self.paths.hops.roads.first = first
        if self.goes_far:
            self.long_ways.roads.first = first  # type: ignore[union-attr] # there are some
        return 0

    def decide(self, games: GameColumns, game: int) -> int:
        """Choose the moves of the living agents in this part of the turn, and write their paths; all others stay."""
        part = self.part[game]
        if self.kind_ends[moves.IS_GIVEN] < self.kind_ends[moves.STEPS]:
            strategies.begin(self.by_steps, game)  # type: ignore[arg-type] # there are some
        for i in range(games.agents):
            row = game * games.agents + i
            if part == 0:
                moves.set_out(games, self, row)
            if self.part_of[i] == part:
                choose(games, self, game, i)
            elif self.part_of[i] > part:
                begin(self.paths, i, games.node[row], -1, 0.0)
            elif self.keeps:
                self.recall(game, i)
            if self.part_of[i] != part:
                self.ends[row] = games.node[row]
        return 0

    def goes(self, games: GameColumns, game: int, i: int) -> bool:
        """Return whether an agent leaves its node, or covers part of an edge."""
        return self.paths.lengths[i] > 1 or self.ahead[game * games.agents + i] >= 0

    def stay(self, games: GameColumns, game: int, i: int) -> int:
        """Undo the move of an agent: it stays at its node for the whole turn."""
        row = game * games.agents + i
        self.ends[row] = games.node[row]
        self.ahead[row] = -1
        self.covered[row] = 0.0
        return begin(self.paths, i, games.node[row], -1, 0.0)

    def go_all(self, games: GameColumns, game: int) -> int:
        """Move the agents of this part of the turn to the ends of their moves."""
        part = self.part[game]
        for i in range(games.agents):
            if self.part_of[i] == part:
                go(games, self, game, i)
        return 0

    def keep(self, game: int, i: int) -> int:
        """Store the path of an agent until the next phase."""
        row = game * len(self.part_of) + i
        return copy_walk(self.paths, i, self.paths.kept, row, self.paths.most)  # type: ignore[arg-type] # there is one

    def recall(self, game: int, i: int) -> int:
        """Read the stored path of an agent."""
        row = game * len(self.part_of) + i
        return copy_walk(self.paths.kept, row, self.paths, i, self.paths.most)  # type: ignore[arg-type] # there is one


# -- one agent -------------------------------------------------------------------------------------------------------


def begin(walks: EdgePaths, i: int, node: int, ahead: int, covered: float) -> int:
    """Place an agent on its start node; the covered part of an edge that no longer exists is dropped."""
    walks.nodes[i * walks.most] = node
    walks.times[i * walks.most] = 0.0
    walks.lengths[i] = 1
    walks.ahead[i] = ahead if ahead >= 0 and is_next(walks.legal, node, ahead) else -1
    walks.covered[i] = covered if walks.ahead[i] >= 0 else 0.0
    return 0


def is_next(legal: LegalByEdges, node: int, other: int) -> bool:
    """Return whether the nodes are equal or an edge leads from the first to the second."""
    found = False
    at = legal.first + node
    for place in range(legal.streets.offsets[at], legal.streets.offsets[at + 1]):
        found = found or legal.streets.targets[place] == other
    return found


def list_legal(walks: EdgePaths, i: int) -> int:
    """Find the legal nodes of an agent on its start node; return their number."""
    return walks.legal.find(walks.nodes[i * walks.most], walks.ahead[i], walks.covered[i], 0, walks.speeds[i], 0.0)


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


def go_towards(walks: EdgePaths, i: int, ways: GoalPaths, memory: int, target: int) -> bool:
    """Move an agent toward a node until the turn is over; return whether it can.

    It takes a path with the fewest edges, and continues its partial edge if that is no longer.

    Args:
        walks: the paths; the agent is on its start node.
        i: the agent.
        ways: its shortest paths: `walks.hops`, or others.
        memory: the row of `ways` that holds the paths of the agent.
        target: the node.
    """
    node = walks.nodes[i * walks.most]
    if walks.speeds[i] != walks.speeds[i]:  # NaN
        walks.route[0] = target
        walk(walks, i, 1)
        return True
    by_hops = ways is walks.hops
    first = target
    if not by_hops or not is_next(walks.legal, node, target):
        first = travel.following(ways, memory, node, target)
        if first == node:
            return False
    ahead = walks.ahead[i]
    if by_hops and ahead >= 0 and ahead != first:
        onward = travel.distance(ways, memory, ahead, target) if ahead != target else 0.0
        if 1.0 - walks.covered[i] + onward <= travel.distance(ways, memory, node, target):
            first = ahead
    walks.route[0] = first
    count = 1
    while walks.route[count - 1] != target and count <= whole_edges(walks.speeds[i] + 1.0):
        walks.route[count] = travel.following(ways, memory, walks.route[count - 1], target)
        count += 1
    walk(walks, i, count)
    return True


def walk(walks: EdgePaths, i: int, count: int) -> int:
    """Move an agent along the first `count` nodes of `walks.route`, at least one, as far as its speed allows."""
    budget = 1.0
    if walks.speeds[i] == walks.speeds[i]:  # not NaN
        budget = walks.speeds[i] + (walks.covered[i] if walks.route[0] == walks.ahead[i] else 0.0)
    walks.ahead[i] = -1
    walks.covered[i] = 0.0
    edges = 0
    first = i * walks.most
    while edges < count and edges < whole_edges(budget):
        edges += 1
        walks.nodes[first + edges] = walks.route[edges - 1]
    walks.lengths[i] = edges + 1
    for place in range(1, edges + 1):
        walks.times[first + place] = place / edges
    left = budget - edges
    if edges < count and walks.route[edges] != walks.nodes[first + edges] and travel.SLACK < left < 1.0:
        walks.ahead[i] = walks.route[edges]
        walks.covered[i] = left
    return 0


def copy_walk(steps: AgentPaths, row: int, others: AgentPaths, other: int, most: int) -> int:
    """Copy the path of an agent from row `row` of `steps` to row `other` of `others`; `most` is the room of a row."""
    others.lengths[other] = steps.lengths[row]
    for number in range(steps.lengths[row]):
        others.nodes[other * most + number] = steps.nodes[row * most + number]
        others.times[other * most + number] = steps.times[row * most + number]
    return 0


# -- the agents of a game --------------------------------------------------------------------------------------------


def choose(games: GameColumns, w: EdgeMovers, game: int, i: int) -> int:
    """Decide for an agent, and write its path through the turn."""
    row = game * games.agents + i
    node = games.node[row]
    begin(w.paths, i, node, games.edge[row], games.share[row])
    target = -1
    count = 0
    if games.alive[row]:
        w.blocked[row] = 0
        if w.decides_by[i] == moves.IS_GIVEN and w.given[row] < 0:
            count = w.routes.take(row, w.paths.route)  # type: ignore[union-attr] # there are some
        else:
            target = target_of(games, w, game, i)
    if count > 0:
        walk(w.paths, i, count)
    elif target >= 0 and target != node:
        if w.paths.legal.reach.listed[target] == w.paths.legal.reach.search:
            go_towards(w.paths, i, w.paths.hops, row, target)
        else:
            go_towards(w.paths, i, w.long_ways, row, target)  # type: ignore[arg-type] # there are some
    else:
        begin(w.paths, i, node, -1, 0.0)
    w.ahead[row] = w.paths.ahead[i]
    w.covered[row] = w.paths.covered[i]
    w.ends[row] = w.paths.nodes[i * w.paths.most + w.paths.lengths[i] - 1]
    return 0


def go(games: GameColumns, w: EdgeMovers, game: int, i: int) -> int:
    """Move an agent to the end of its move, and fit its path into its part of the turn."""
    row = game * games.agents + i
    moves.go(games, w, row)
    games.edge[row] = w.ahead[row]
    games.share[row] = w.covered[row]
    if w.went[row] != games.node[row]:  # a rule has put it there
        w.paths.times[i * w.paths.most] = 1.0
    if w.parts > 1 and w.paths.lengths[i] > 1:
        go_in_part(w.paths, i, w.part[game], w.parts)
    return 0


def target_of(games: GameColumns, w: EdgeMovers, game: int, i: int) -> int:
    """Return the node that an agent moves toward, by its own decision or a given action; -1: none."""
    row = game * games.agents + i
    by = w.decides_by[i]
    if by == moves.STAYS:
        return -1
    count = list_legal(w.paths, i)
    if by == moves.STEPS:
        strategies.take_legal(w.by_steps, w.paths.legal.reach.nodes, count)  # type: ignore[arg-type] # there are some
        w.by_steps.goes_far = w.paths.speeds[i] == w.paths.speeds[i]  # type: ignore[union-attr] # not NaN
        w.by_steps.drawn = 0  # type: ignore[union-attr]
        return strategies.act(w.by_steps, game, i)  # type: ignore[arg-type]
    if by == moves.IS_GIVEN:
        return w.paths.legal.reach.nodes[w.given[row]]
    return w.paths.legal.reach.nodes[draws.below_at(w.walks.keys[row], games.turn[game], 0, count)]


def go_in_part(walks: EdgePaths, i: int, part: int, parts: int) -> int:
    """Fit the path of an agent into one of several equal parts of the turn; until then it waits on its first node."""
    first = i * walks.most
    for place in range(walks.lengths[i]):
        walks.times[first + place] = (part + walks.times[first + place]) / parts
    if part > 0:
        for place in range(walks.lengths[i], 0, -1):
            walks.nodes[first + place] = walks.nodes[first + place - 1]
            walks.times[first + place] = walks.times[first + place - 1]
        walks.times[first] = 0.0
        walks.lengths[i] += 1
    return 0
