"""Moves of one game along several edges a turn, or parts of one: agents decide, give way to each other, and go.

Speeds count edges. An agent that covers only part of an edge stays on its node, and goes on from there in the next
turn if it goes the same way.
"""

from __future__ import annotations

from math import floor

from gamms.core import by_metres, draws, moves, travel
from gamms.core.by_metres import Roaming
from gamms.core.conflicts import resolve
from gamms.core.moves import Movers
from gamms.core.rules import Games, Steps
from gamms.core.travel import Reach, Ways


class Walkers:
    """The agents of games that count edges as they decide and go; rows are those of `rules.Games`.

    `Games.edge` has the nodes to which agents have covered part of an edge, and `Games.share` how much of it.

    Attributes:
        movers: the columns that all agents have, however they move.
        hops, ways: their ways by the number of edges, and by length.
        reach: scratch.
        roaming: what those do that go to nodes drawn at random.
        most: how many nodes an agent has room for.
        speeds: (agents,) edges in a turn; NaN: along one edge.
        nodes, times: (agents * most,) the nodes that an agent of the game passes, where it is first, and when.
        lengths: (agents,) how many these are.
    """

    def __init__(
        self,
        movers: Movers,
        hops: Ways,
        ways: Ways,
        roaming: Roaming,
        most: int,
        speeds: memoryview[float],
        nodes: memoryview[int],
        times: memoryview[float],
        lengths: memoryview[int],
    ) -> None:
        self.movers = movers
        self.hops = hops
        self.ways = ways
        self.reach: Reach = self.hops.reach
        self.roaming = roaming
        self.most = most
        self.speeds = speeds
        self.nodes = nodes
        self.times = times
        self.lengths = lengths


def decide(games: Games, w: Walkers, game: int) -> int:
    """Let the living agents of a game choose where they go, and find their ways through the turn."""
    for i in range(games.agents):
        row = game * games.agents + i
        games.start[row] = games.node[row]
        w.movers.takes_part[row] = games.alive[row]
        w.movers.ends[row] = games.node[row]
        w.nodes[i * w.most] = games.node[row]
        w.times[i * w.most] = 0.0
        w.lengths[i] = 1
        ahead = ahead_of(games, w, row)
        covered = games.share[row]
        games.edge[row] = -1
        games.share[row] = 0.0
        if games.alive[row]:
            w.movers.blocked[row] = 0
            target = target_of(games, w, game, i, ahead, covered)
            if target >= 0 and target != games.node[row]:
                set_off(games, w, row, i, target, ahead, covered)
                w.movers.ends[row] = w.nodes[i * w.most + w.lengths[i] - 1]
    return 0


def ahead_of(games: Games, w: Walkers, row: int) -> int:
    """Return the node to which an agent has covered part of an edge; -1: none."""
    ahead = games.edge[row]
    return ahead if ahead >= 0 and is_next(w, games.node[row], ahead) else -1


def is_next(w: Walkers, node: int, other: int) -> bool:
    """Return whether an edge leads from a node to another, or they are the same."""
    for place in range(w.movers.streets.offsets[node], w.movers.streets.offsets[node + 1]):
        if w.movers.streets.targets[place] == other:
            return True
    return False


def target_of(games: Games, w: Walkers, game: int, i: int, ahead: int, covered: float) -> int:
    """Return the node that an agent wants to go to, as it decides or is given it; -1: none."""
    row = game * games.agents + i
    by = w.movers.decides_by[i]
    if by == by_metres.ROAMS:
        target = by_metres.waypoint(games, w.roaming, w.ways, w.movers.walks, game, i)
        list_legal(w, i, games.node[row], ahead, covered)
        return target
    if by != moves.WALKS and by != moves.IS_GIVEN:  # noqa: PLR1714 - as C
        return -1
    list_legal(w, i, games.node[row], ahead, covered)
    if by == moves.IS_GIVEN:
        return w.reach.nodes[w.movers.given[row]]
    return w.reach.nodes[draws.below_at(w.movers.walks.keys[row], games.turn[game], 0, w.reach.found)]


def list_legal(w: Walkers, i: int, node: int, ahead: int, covered: float) -> int:
    """List the nodes that an agent may go to: those next to it, then those in reach, then those on from its edge."""
    w.reach.search += 1
    w.reach.found = 0
    for place in range(w.movers.streets.offsets[node], w.movers.streets.offsets[node + 1]):
        travel.list_node(w.reach, w.movers.streets.targets[place], 0.0)
    if w.speeds[i] == w.speeds[i]:  # not NaN
        list_within(w, node, whole_edges(w.speeds[i]))
        if ahead >= 0:
            list_within(w, ahead, whole_edges(w.speeds[i] + covered) - 1)
    return 0


def whole_edges(budget: float) -> float:
    """Return how many edges are within a budget, as far as numbers are exact."""
    return floor(budget * (1.0 + travel.SLACK))


def list_within(w: Walkers, node: int, hops: float) -> int:
    """Append the nodes at most so many edges ahead of a node, in the order of their rows."""
    if hops < 0:
        return 0
    w.reach.seen[0] = node
    w.reach.when[node] = 0.0
    w.reach.places[node] = 1
    w.reach.count = 1
    number = 0
    while number < w.reach.count:
        at = w.reach.seen[number]
        number += 1
        if w.reach.when[at] + 1.0 <= hops:
            for place in range(w.movers.streets.offsets[at], w.movers.streets.offsets[at + 1]):
                other = w.movers.streets.targets[place]
                if w.reach.places[other] == 0:
                    w.reach.places[other] = 1
                    w.reach.when[other] = w.reach.when[at] + 1.0
                    w.reach.seen[w.reach.count] = other
                    w.reach.count += 1
    travel.forget_seen(w.reach)
    w.reach.size = 0
    w.reach.count = 0
    for place in range(number):
        travel.reach_node(w.reach, w.reach.seen[place], 0.0, w.reach.seen[place])
    while w.reach.size > 0:
        travel.list_node(w.reach, travel.visit_first(w.reach), 0.0)
    return travel.forget_seen(w.reach)


def set_off(games: Games, w: Walkers, row: int, i: int, target: int, ahead: int, covered: float) -> int:
    """Let an agent go towards a node that is not its own until the turn is over, by hops where the node is legal."""
    node = games.node[row]
    if w.speeds[i] != w.speeds[i]:  # NaN
        return pass_node(w, i, target)
    by_hops = w.reach.listed[target] == w.reach.search
    first = target
    if not by_hops or not is_next(w, node, target):
        first = following(w, row, node, target, by_hops)
    if by_hops and ahead >= 0 and ahead != first:
        onward = travel.distance(w.hops, row, ahead, target) if ahead != target else 0.0
        if 1.0 - covered + onward <= travel.distance(w.hops, row, node, target):
            first = ahead
    budget = w.speeds[i] + (covered if first == ahead else 0.0)
    most = whole_edges(budget)
    edges = 0
    while node != target and edges < most:
        node = first if edges == 0 else following(w, row, node, target, by_hops)
        pass_node(w, i, node)
        edges += 1
    for place in range(edges + 1):
        w.times[i * w.most + place] = place / edges if edges > 0 else 0.0
    left = budget - edges
    if node != target and travel.SLACK < left < 1.0:
        onto = first if edges == 0 else following(w, row, node, target, by_hops)
        if onto != node:
            games.edge[row] = onto
            games.share[row] = left
    return 0


def following(w: Walkers, row: int, node: int, target: int, by_hops: bool) -> int:
    """Return the next node on the way of an agent to a node, by the number of edges or by length."""
    if by_hops:
        return travel.following(w.hops, row, node, target)
    return travel.following(w.ways, row, node, target)


def pass_node(w: Walkers, i: int, node: int) -> int:
    """Let an agent come to a node, at the end of the turn until it comes to another."""
    place = i * w.most + w.lengths[i]
    w.nodes[place] = node
    w.times[place] = 1.0
    w.lengths[i] += 1
    return 0


def give_way(games: Games, w: Walkers, game: int) -> int:
    """Let agents stay that lose conflicts, and count them."""
    if not w.movers.has_conflicts:
        return 0
    if resolve(w.movers.contests, w.movers.requests, game, games.turn[game]) == 0:  # type: ignore[arg-type] # there are
        return 0
    for i in range(games.agents):
        row = game * games.agents + i
        goes = w.lengths[i] > 1 or games.edge[row] >= 0
        if goes and w.movers.contests.stays[i]:  # type: ignore[union-attr] # there are conflicts
            w.movers.ends[row] = games.start[row]
            w.lengths[i] = 1
            games.edge[row] = -1
            games.share[row] = 0.0
            w.movers.blocked[row] = 1
            w.movers.blocks[row] += 1
    return 0


class Walks(Steps):
    """How the agents of one game have gone in a turn along several edges, as contacts take it.

    Args:
        most: how many nodes an agent has room for.
        nodes, times, lengths: see `Steps`, with as many.
    """

    def __init__(self, most: int, nodes: memoryview[int], times: memoryview[float], lengths: memoryview[int]) -> None:
        super().__init__(nodes, times, lengths)
        self.are_one_edge = False
        self.most = most

    def fill(self, games: Games, game: int) -> int:
        """Write how the agents of a game came to where they are; those that rules have put elsewhere have not gone."""
        for agent in range(games.agents):
            row = game * games.agents + agent
            if games.placed[row]:
                self.lengths[agent] = 1
                self.nodes[agent * self.most] = games.node[row]
                self.times[agent * self.most] = 1.0
        return 0
