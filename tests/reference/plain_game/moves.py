"""Where agents may go in a turn, and when they are where: docs/game.md, Moves; docs/travel.md.

A turn is the time from 0 to 1. A route is the nodes to come; none means to stay.
"""

from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise


@dataclass
class Stay:
    """That an agent is on a node from one time of the turn to another."""

    begin: Fraction
    end: Fraction
    node: int


@dataclass
class Ride:
    """That an agent is on an edge between two times of the turn, first `x0` and at last `x1` metres from the source."""

    begin: Fraction
    end: Fraction
    source: int
    target: int
    x0: Fraction = Fraction(0)
    x1: Fraction = Fraction(1)


@dataclass
class Walk:
    """What a move is: the nodes that are passed, when the agent is where, and where it is at the end."""

    path: list
    track: list
    node: int
    target: int | None = None
    offset: Fraction = Fraction(0)

    @property
    def end(self):
        """The node that the agent counts as on at the end, None between two nodes in games by metres."""
        return self.node if self.target is None else None


class Illegal(Exception):
    """An action that is not legal."""


class ByEdges:
    """Moves where speeds count edges: agents are on nodes, and may have covered part of the edge to the next one."""

    is_metric = False

    def __init__(self, streets):
        self.streets = streets

    def legal(self, agent):
        """Return the nodes that an agent may move to: its own, its neighbours, and what else it reaches in a turn."""
        near = [agent.node, *self.streets.neighbours(agent.node)]
        return (*near, *self.reached(agent, near))

    def reached(self, agent, near):
        """Return the nodes in reach in a turn but those near, in the order in which they were added to the map."""
        if agent.speed is None:
            return []
        ways = self.ways(agent)
        return [node for node in self.streets.xy if node not in near and node in ways and ways[node][0] <= agent.speed]

    def ways(self, agent):
        """Return node -> (how much of an agent's speed the shortest way takes, its edges, its nodes)."""
        ways = self.streets.ways_from(agent.node, self.is_metric)
        if agent.target is not None:
            ways = dict(ways)
            for end, (far, count, way) in self.streets.ways_from(agent.target, self.is_metric).items():
                if agent.node not in way:
                    ways[end] = min(ways[end], (1 - agent.offset + far, count + 1, (agent.node, *way)))
        return ways

    def route(self, agent, action):
        """Return the route that an action means. Raises Illegal."""
        if isinstance(action, dict):
            action = action["node_id"]
        if isinstance(action, (list, tuple)):
            return self.route_along(agent, list(action))
        if action == agent.node:
            return ()
        if agent.speed is None and action not in self.streets.out[agent.node]:
            raise Illegal(f"{action!r} is not legal")
        if agent.speed is None and not self.is_metric:
            return (action,)
        return self.way_to(agent, action)

    def way_to(self, agent, node):
        """Return the route of the shortest way to a node. Raises Illegal."""
        ways = self.ways(agent)
        if node not in ways:
            raise Illegal(f"no way leads to {node!r}")
        return ways[node][2][1:]

    def route_along(self, agent, nodes):
        """Return the route along a list of nodes, each next to the one before; a node twice is a pause."""
        if nodes[:1] == [agent.node]:
            nodes = nodes[1:]
        if agent.speed is None and len(nodes) > 1 and not self.is_metric:
            raise Illegal("an agent without a speed goes along one edge")
        for start, end in pairwise([agent.node, *nodes]):
            if end != start and end not in self.streets.out.get(start, {}):
                raise Illegal(f"no edge leads from {start!r} to {end!r}")
        return tuple(nodes)

    def walk(self, agent, route, begin, end):
        """Return how an agent goes along a route in a part of the turn, as far as its speed leads."""
        path = [agent.node]
        left = Fraction(1) if agent.speed is None else agent.speed
        target = None
        offset = Fraction(0)
        for node in route:
            covered = agent.offset if len(path) == 1 and node == agent.target else Fraction(0)
            if left < 1 - covered:
                if node != path[-1] and covered + left:
                    target = node
                    offset = covered + left
                break
            left -= 1 - covered
            path.append(node)
        return Walk(path, track_by_edges(path, begin, end), path[-1], target, offset)


def track_by_edges(path, begin, end):
    """Return when an agent is where: of n edges it is at the k-th node after k/n of its part of the turn."""
    if len(path) == 1:
        return [Stay(Fraction(0), Fraction(1), path[0])]
    # One that waits for its part of the turn reaches its node once more when this begins.
    track = [Stay(Fraction(0), begin, path[0]), Stay(begin, begin, path[0])] if begin else []
    each = (end - begin) / (len(path) - 1)
    now = begin
    for source, target in pairwise(path):
        if source == target:
            track.append(Stay(now, now + each, source))
        else:
            track.append(Ride(now, now + each, source, target))
        track.append(Stay(now + each, now + each, target))
        now += each
    return [*track, Stay(end, Fraction(1), path[-1])]


class ByMetres(ByEdges):
    """Moves where speeds count metres: agents are anywhere on edges, and `offset` metres from the node passed last."""

    is_metric = True

    def legal(self, agent):
        """Return both ends of the edge that an agent is on, the nodes next to them, and what else it reaches in a turn.

        First what is ahead, then what is behind; of what is reached the nearest first, then the lowest id.
        """
        ends = [end for _, end in self.begun(agent)]
        near = [node for end in ends for node in self.streets.neighbours(end)]
        reached = [node for begun in self.begun(agent) for node in self.reached(agent, *begun)]
        own = [agent.node] if agent.node in ends else []
        return tuple(dict.fromkeys([*own, *ends, *near, *reached]))

    def begun(self, agent):
        """Return (metres, node) of each node to which an agent may go at first: its own, or both ends of its edge."""
        if agent.target is None:
            return [(Fraction(0), agent.node)]
        ahead = [(self.streets.out[agent.node][agent.target] - agent.offset, agent.target)]
        return ahead + ([(agent.offset, agent.node)] if self.can_turn(agent) else [])

    def reached(self, agent, covered, start):
        """Return the nodes in reach in a turn beyond a node that is so many metres away, the nearest first."""
        if agent.speed is None:
            return []
        ways = self.streets.ways_from(start, True)
        found = [(way[0], node) for node, way in ways.items() if covered + way[0] <= agent.speed]
        return [node for _, node in sorted(found)]

    def can_turn(self, agent):
        """Return whether an agent may turn round on its edge: an edge leads back that is as long."""
        out = self.streets.out
        return out[agent.target].get(agent.node) == out[agent.node][agent.target]

    def ways(self, agent):
        """Return node -> (how many metres the shortest way takes, its edges, the agent's node and those to come)."""
        if agent.target is None:
            return super().ways(agent)
        ways = {}
        for covered, node in self.begun(agent):
            for end, (far, count, way) in self.streets.ways_from(node, True).items():
                if end not in ways or covered + far < ways[end][0]:
                    ways[end] = (covered + far, count + 1, (agent.node, *way))
        return ways

    def route(self, agent, action):
        """Return the route that an action means. Raises Illegal."""
        if action is None:
            return ()
        if isinstance(action, dict):
            action = action["node_id"]
        if agent.target is None or isinstance(action, (list, tuple)):
            return super().route(agent, action)
        if action == agent.target or (action == agent.node and self.can_turn(agent)):
            return (action,)
        return self.way_to(agent, action)

    def route_along(self, agent, nodes):
        """Return the route along a list of nodes, whose first may be the node passed last; pauses do not count."""
        if agent.target is None:
            return super().route_along(agent, nodes)
        if len(nodes) > 1 and nodes[0] == agent.node:
            nodes = nodes[1:]
        if nodes and nodes[0] not in (agent.node, agent.target):
            nodes = [agent.node, *nodes]
        if nodes and nodes[0] == agent.node and not self.can_turn(agent):
            raise Illegal("one cannot turn round on a one-way road")
        for start, end in pairwise(nodes):
            if end != start and end not in self.streets.out.get(start, {}):
                raise Illegal(f"no edge leads from {start!r} to {end!r}")
        return tuple(nodes)

    def walk(self, agent, route, begin, end):
        """Return how an agent goes along a route in a part of the turn, as far as its metres lead."""
        walk = Walk([agent.node], [], agent.node, agent.target, agent.offset)
        left = agent.speed
        if left is None:
            others = [node for node in route if node != agent.node]
            left = self.streets.out[agent.node][others[0]] if others else Fraction(1)
        rate = left / (end - begin)
        now = begin
        waits = self.standing(walk, Fraction(0), begin)
        for node in route:
            if node == walk.node and walk.target is None:
                continue
            if walk.target is None:
                walk.target = node
                walk.offset = Fraction(0)
            goal = self.streets.out[walk.node][walk.target] if node == walk.target else Fraction(0)
            far = min(abs(goal - walk.offset), left)
            there = walk.offset + far if goal > walk.offset else walk.offset - far
            walk.track.append(Ride(now, now + far / rate, walk.node, walk.target, walk.offset, there))
            now += far / rate
            left -= far
            walk.offset = there
            if there != goal:
                break
            if node == walk.target:
                walk.node = node
                walk.path.append(node)
            walk.target = None
            walk.offset = Fraction(0)
            walk.track.append(Stay(now, now, walk.node))
            if not left:
                break
        if now == begin:
            walk.track = [self.standing(walk, Fraction(0), Fraction(1))]
        else:
            walk.track = [*([waits] if begin else []), *walk.track, self.standing(walk, now, Fraction(1))]
        return walk

    def standing(self, walk, begin, end):
        """Return that an agent stands where it is, on its node or on its edge."""
        if walk.target is None:
            return Stay(begin, end, walk.node)
        return Ride(begin, end, walk.node, walk.target, walk.offset, walk.offset)
