"""Moves of one game by metres: agents decide, resolve conflicts, and move; see `gamms.core.travel`."""
# ruff: noqa: ARG002 - a kind of movement reads no arguments that only others need

from __future__ import annotations

from typing import Any

from gamms.core import contacts, draws, moves, rules, strategies, travel
from gamms.core.contacts import Legs
from gamms.core.moves import TripMovers, TripPaths
from gamms.core.rules import Events, GameColumns
from gamms.core.travel import GoalPaths, LegalCache, ReachSearch, RoadEdges, TurnPaths


class MetreMovers(TripMovers):
    """The agents of games by metres; rows are as in `rules.GameColumns`.

    Attributes:
        roads, reach, known: the map, working memory, and stored sets of legal nodes.
        ways: shortest paths of agents with strategy steps, by row.
        near: shortest paths of all other agents, which are short; by a hash of start and goal.
        slots: the number of hash values, a power of 2.
        events: receives illegal actions.
        nodes: the number of nodes.
        speeds: (agents,) metres in the time unit of speeds; NaN: no speed.
        motion: (rows,) the last motion of agents on edges; see `ir.progress.Motion`.
        start_places, end_places: (rows,) the places of moves, as in `conflicts`: nodes, then edges.
        most_edges: the number of edges that an agent may enter before it decides again.
        drawn: (rows,) the number of draws of each agent in the turn.
    """

    def __init__(
        self,
        ways: GoalPaths,
        near: GoalPaths,
        known: LegalCache,
        events: Events,
        trips: TurnPaths,
        *movers: Any,
        slots: int,
        nodes: int,
        speeds: memoryview[float],
        motion: memoryview[int],
        start_places: memoryview[int],
        end_places: memoryview[int],
        drawn: memoryview[int],
        most_edges: int,
        has_all: bool,
        **columns: Any,
    ) -> None:
        super().__init__(trips, *movers, has_all=has_all, **columns)
        self.ways = ways
        self.roads: RoadEdges = self.ways.roads
        self.reach: ReachSearch = self.ways.reach
        self.known = known
        self.events = events
        self.near = near
        self.slots = slots
        self.nodes = nodes
        self.speeds = speeds
        self.motion = motion
        self.start_places = start_places
        self.end_places = end_places
        self.most_edges = most_edges
        self.drawn = drawn

    def decide(self, games: GameColumns, game: int) -> int:
        """Choose the moves of the living agents in this part of the turn, and find their paths; all others stay."""
        for i in range(games.agents):
            row = game * games.agents + i
            self.roads.use(rules.find_first_place(games, game, i))
            if is_there(games, self, game, i):
                self.end_places[row] = self.start_places[row]
                self.ends[row] = games.node[row]
                continue
            if games.alive[row] and self.part_of[i] == self.part[game]:
                choose(games, self, game, i)
            stop_on_edge(self, self.first + i)
            self.end_places[row] = find_place(self, self.first + i)
            self.ends[row] = self.trips.node[self.first + i]
        return 0

    def is_put(self, games: GameColumns, game: int, i: int) -> bool:
        """Return whether rules have put an agent elsewhere that was about to move, or brought it back."""
        was_on_edge = travel.is_on_edge_at_start(self.trips, self.first + i) and self.part_of[i] >= self.part[game]
        if was_on_edge and games.edge[game * games.agents + i] < 0:
            return True
        return moves.is_put(games, self, game, i)

    def is_moving(self, games: GameColumns, game: int, i: int) -> bool:
        """Return whether an agent covers part of an edge."""
        return travel.is_moving(self.trips, self.first + i)

    def find_goal(self, row: int) -> int:
        """Return the place where the move of an agent ends, as in `conflicts`."""
        return self.end_places[row]

    def stay(self, games: GameColumns, game: int, i: int) -> int:
        """Undo the move of an agent: it stays at its position for the whole turn, with the map on which it decided."""
        row = game * games.agents + i
        own = self.first + i
        self.roads.use(rules.find_first_place(games, game, i))
        if games.edge[row] < 0 or not travel.is_on_edge_at_start(self.trips, own):
            begin(games, self, row, i)
            travel.stand(self.roads, self.trips, own)
            self.trips.motion[own] = travel.STOPPED
        else:
            travel.stay(self.trips, own)
        self.start_places[row] = find_place(self, own)
        self.end_places[row] = self.start_places[row]
        self.ends[row] = self.trips.node[own]
        return 0

    def stand(self, games: GameColumns, game: int, i: int) -> int:
        """Set the place that conflicts read of an agent that has moved in an earlier part of the turn."""
        row = game * games.agents + i
        self.roads.use(rules.find_first_place(games, game, i))
        is_there(games, self, game, i)
        self.end_places[row] = self.start_places[row]
        self.ends[row] = games.node[row]
        return 0

    def go_all(self, games: GameColumns, game: int) -> int:
        """Write the ends of the paths of this part of the turn to the columns of the games."""
        part = self.part[game]
        for i in range(games.agents):
            if self.part_of[i] == part:
                go(games, self, game, i)
        return 0


def is_there(games: GameColumns, t: MetreMovers, game: int, i: int) -> bool:
    """Return whether an agent has moved in an earlier part of the turn; otherwise place it at its start."""
    row = game * games.agents + i
    if t.part_of[i] >= t.part[game]:
        set_out(games, t, row, i)
        return False
    edge = find_edge(games, t, row)
    t.start_places[row] = games.node[row] if edge < 0 else t.nodes + edge
    return True


def set_out(games: GameColumns, t: MetreMovers, row: int, i: int) -> int:
    """Start the turn of an agent at its position, or a later part of it."""
    if t.part[row // games.agents] == 0:
        moves.set_out(games, t, row)
    t.drawn[row] = 0
    own = t.first + i
    begin(games, t, row, i)
    if t.trips.edge[own] >= 0 and find_edge(games, t, row) < 0:
        t.trips.edge[own] = -1
        t.trips.share[own] = 0.0
    t.start_places[row] = find_place(t, own)
    return 0


def find_edge(games: GameColumns, t: MetreMovers, row: int) -> int:
    """Return the edge that an agent is on; -1: it is on its node, or its edge is closed."""
    edge = games.edge[row]
    return edge if edge >= 0 and travel.is_open(t.roads, edge) else -1


def go(games: GameColumns, t: MetreMovers, game: int, i: int) -> int:
    """Write the end of an agent's path to the columns of the games, and fit the path into its part of the turn."""
    row = game * games.agents + i
    own = t.first + i
    t.ends[row] = t.trips.node[own]
    moves.go(games, t, row)
    games.edge[row] = t.trips.edge[own]
    games.share[row] = t.trips.share[own]
    t.motion[row] = t.trips.motion[own]
    if t.went[row] != games.node[row]:  # a rule has put it there
        t.trips.times[own * (t.trips.most + 1)] = 1.0
    if t.parts > 1 and t.trips.legs[own] > 0:
        travel.go_in_part(t.trips, own, t.part[game], t.parts)
    return 0


def stop_on_edge(t: MetreMovers, own: int) -> int:
    """Stop an agent that is on an edge and has not moved; `own` is the row of its path."""
    if t.trips.edge[own] >= 0 and t.trips.legs[own] == 0:
        travel.stand(t.roads, t.trips, own)
        t.trips.motion[own] = travel.STOPPED
    return 0


def choose(games: GameColumns, t: MetreMovers, game: int, i: int) -> int:
    """Decide for an agent, and move it along a path to its target; an impossible move counts as illegal."""
    row = game * games.agents + i
    own = t.first + i
    t.blocked[row] = 0
    target = -1
    can_go = True
    if t.decides_by[i] == moves.IS_GIVEN and t.edges[row] != moves.NONE:
        go_over(t, row, own)
    elif t.decides_by[i] == moves.IS_GIVEN and t.given[row] < 0:
        go_along(t, row, own)
    else:
        target = find_target(games, t, game, i)
    if target >= 0 and t.decides_by[i] == moves.STEPS:
        can_go = travel.go_towards(t.roads, t.trips, t.ways, row, own, target)
    elif target >= 0:
        slot = (t.trips.node[own] * 31 + target) & (t.slots - 1)
        can_go = travel.go_towards(t.roads, t.trips, t.near, slot, own, target)
    if not can_go:
        where = t.trips.edge[own] if t.trips.edge[own] >= 0 else -2 - t.trips.node[own]
        t.events.put(game, games.turn[game], rules.NOBODY, rules.ILLEGAL, i, where, target)
    return 0


def go_along(t: MetreMovers, row: int, own: int) -> int:
    """Move an agent along the route that a function has given; `own` is the row of its path."""
    count = t.routes.take(row, t.trips.route)  # type: ignore[union-attr] # there are some
    if count >= 0:
        travel.go(t.roads, t.trips, own, t.routes.motions[row], count)  # type: ignore[union-attr]
    return 0


def go_over(t: MetreMovers, row: int, own: int) -> int:
    """Move an agent to the end of the edge that its action names, out of its node; or on along its edge, or back.

    `own` is the row of its path, which may have legs already, if it decides on arrival.
    """
    edge = t.edges[row]
    on = t.trips.edge[own]
    if edge < 0:
        return 0
    if on >= 0:
        return travel.go(t.roads, t.trips, own, travel.FORWARD if edge == on else travel.BACK, 0)
    legs = t.trips.legs[own]
    now = t.trips.now[own]
    t.trips.edge[own] = edge
    t.trips.share[own] = 0.0
    t.trips.motion[own] = travel.FORWARD
    travel.go(t.roads, t.trips, own, travel.FORWARD, 0)
    if t.trips.edge[own] >= 0 and t.trips.share[own] == 0.0:  # it has not left its node
        t.trips.legs[own] = legs
        t.trips.now[own] = now
        t.trips.edge[own] = -1
        t.trips.motion[own] = travel.STOPPED
    return 0


def begin(games: GameColumns, t: MetreMovers, row: int, i: int) -> int:
    """Place an agent at its position at the start of a turn."""
    edge = games.edge[row]
    share = games.share[row]
    return travel.begin(
        t.trips, t.first + i, games.node[row], edge, share, t.motion[row], 0.0, t.speeds[i], t.most_edges
    )


def find_place(t: MetreMovers, own: int) -> int:
    """Return the place of the agent of a path, as in `conflicts`: its node, or its edge numbered after all nodes."""
    return t.trips.node[own] if t.trips.edge[own] < 0 else t.nodes + t.trips.edge[own]


def find_target(games: GameColumns, t: MetreMovers, game: int, i: int) -> int:
    """Return the node that an agent moves toward, by its own decision or a given action; -1: none."""
    row = game * games.agents + i
    own = t.first + i
    by = t.decides_by[i]
    edge = t.trips.edge[own]
    if by == moves.WALKS and edge >= 0:
        return t.roads.targets[edge]
    if by == moves.STAYS:
        return -1
    node = t.trips.node[own]
    now = t.trips.now[own]
    if edge >= 0 or now > 0.0:
        share = t.trips.share[own]
        count = travel.find_reachable(t.roads, t.reach, node, edge, share, t.trips.motion[own], t.speeds[i], now, False)
        if by == moves.STEPS:
            strategies.take_legal(t.by_steps, t.reach.nodes, count)  # type: ignore[arg-type] # there are some
            return choose_by_steps(t, game, i)
        return t.reach.nodes[choose_number(games, t, row, by, count)]
    count = travel.count_legal(t.roads, t.reach, t.known, i, node, t.speeds[i])
    if by == moves.STEPS:
        for number in range(count):
            legal = travel.get_legal_node(t.roads, t.reach, t.known, i, node, number)
            t.by_steps.legal[number] = legal  # type: ignore[union-attr] # there are some
        t.by_steps.count = count  # type: ignore[union-attr]
        return choose_by_steps(t, game, i)
    return travel.get_legal_node(t.roads, t.reach, t.known, i, node, choose_number(games, t, row, by, count))


def choose_number(games: GameColumns, t: MetreMovers, row: int, by: int, count: int) -> int:
    """Return the number of the legal node that an agent draws, or that it is given, among `count`."""
    return draw_below(games, t, row, count) if by == moves.WALKS else moves.as_legal(t.given[row], count)


def draw_below(games: GameColumns, t: MetreMovers, row: int, bound: int) -> int:
    """Return the next random number of an agent below a bound."""
    t.drawn[row] += 1
    return draws.draw_integer(t.walks.keys[row], games.turn[row // games.agents], t.drawn[row] - 1, bound)


def choose_by_steps(t: MetreMovers, game: int, i: int) -> int:
    """Return the node that the strategy steps of an agent choose among its known legal nodes; -1: none."""
    row = game * t.by_steps.games.agents + i  # type: ignore[union-attr] # there are some
    edge = t.trips.edge[t.first + i]
    t.by_steps.ahead = t.roads.targets[edge] if edge >= 0 else -1  # type: ignore[union-attr] # there are some
    t.by_steps.goes_far = t.speeds[i] == t.speeds[i]  # type: ignore[union-attr] # not NaN
    t.by_steps.drawn = t.drawn[row]  # type: ignore[union-attr]
    node = strategies.act(t.by_steps, game, i)  # type: ignore[arg-type]
    t.drawn[row] = t.by_steps.drawn  # type: ignore[union-attr]
    return node


class MetrePaths(TripPaths):
    """The paths of the agents of one game by metres in a turn, in the form that `contacts` reads.

    Args:
        movers, trips: see `TripPaths`; the columns of the trips are those of the tracks and legs.
        roads: the map.
        edge_ids: (edges,) the ids of the edges.
        legs: receive the edges of the legs; their other columns are those of the trips.
    """

    def __init__(
        self, movers: MetreMovers, trips: TurnPaths, roads: RoadEdges, edge_ids: memoryview[int], legs: Legs
    ) -> None:
        super().__init__(movers, trips)
        self.roads = roads
        self.edge_ids = edge_ids
        self.legs = legs

    def fill(self, games: GameColumns, game: int) -> int:
        """Write the paths of the agents of a game."""
        moves.copy_paths(games, self, game)
        self.roads.use(games.first_node[game])
        for agent in range(games.agents):
            first = agent * self.trips.most
            for leg in range(first, first + self.trips.legs[agent]):
                contacts.describe_leg(
                    self.legs, leg, self.roads, self.edge_ids, self.trips.edges[leg], self.trips.backs[leg]
                )
        return 0
