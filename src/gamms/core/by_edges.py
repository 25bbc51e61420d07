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
            list_within(self, node, count_whole_edges(speed))
            if edge >= 0 and is_next(self, node, edge):
                list_within(self, edge, count_whole_edges(speed + share) - 1)
        return self.reach.found


class TrafficStates:
    """The states of traffic that obeys turn restrictions: by which edges it has come to its node.

    The first states are those of `kernels.turn_states`; behind them is one for each node, where traffic begins there;
    then follow those of further modes. The states of several maps, which differ in the open edges, follow each other.
    The position of a state in this sequence is its place.

    Attributes:
        nodes: (states,) the node of each state.
        edges: (states,) the last edge; -1: traffic begins on the node.
        sources: (states,) the node at the beginning of this edge; -1: traffic begins on the node.
        begin_of_agent: (agents,) the number of the state in which traffic begins on the first node, by the mode of each
            agent; -1: it obeys no turns.
        begin: this number for the agent in use.
        offsets: (places + 1,) the states that may follow at place `i` are `after[offsets[i]:offsets[i + 1]]`.
        after: states, in the order of the legal nodes; of several edges to a node, the cheapest first.
        kept: (places,) the state that is left of each one, because edges are closed; -1: none.
        first: the place of the first state on the map in use.
        first_of_game: (games,) the same for the map of each game.
        driven: (rows,) the states of agents; -1: they begin on their nodes.
        driving: (rows,) the same after the moves that are under way.
    """

    def __init__(
        self,
        nodes: memoryview[int],
        edges: memoryview[int],
        sources: memoryview[int],
        begin_of_agent: memoryview[int],
        driven: memoryview[int],
        driving: memoryview[int],
    ) -> None:
        self.nodes = nodes
        self.edges = edges
        self.sources = sources
        self.begin_of_agent = begin_of_agent
        self.begin = 0
        self.first = 0
        self.driven = driven
        self.driving = driving

    def take_maps(
        self,
        offsets: memoryview[int],
        after: memoryview[int],
        kept: memoryview[int],
        first_of_game: memoryview[int],
    ) -> None:
        """Set the legal moves on each map; see the attributes."""
        self.offsets = offsets
        self.after = after
        self.kept = kept
        self.first_of_game = first_of_game


class LegalWithTurns(LegalNodes):
    """The legal nodes of agents by edges that obey turn restrictions.

    Attributes:
        states: the states of traffic.
    """

    def __init__(self, states: TrafficStates, reach: ReachSearch) -> None:
        super().__init__(reach)
        self.states = states

    def find(self, node: int, edge: int, share: float, motion: int, speed: float, now: float) -> int:
        """Find the legal nodes of an agent in the state `node`; return their number."""
        return list_with_turns(self.states, self.reach, node)


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
        with_turns: the legal nodes of agents that obey turn restrictions, if some do (`obey_turns`).
    """

    def __init__(
        self,
        paths: EdgePaths,
        long_ways: GoalPaths | None,
        with_turns: LegalWithTurns | None,
        *movers: Any,
        speeds: memoryview[float],
        has_all: bool,
        **columns: Any,
    ) -> None:
        self.paths = paths
        super().__init__(self.paths.trips, *movers, has_all=has_all, **columns)
        self.long_ways = long_ways
        self.goes_far = long_ways is not None
        self.with_turns = with_turns
        self.obey_turns = with_turns is not None
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
            use_edges(self, rules.find_first_place(games, game, i))
            if self.part_of[i] == part:
                choose(games, self, game, i)
            elif self.part_of[i] > part:
                stand(games, self, row, i)
            if self.part_of[i] != part:
                self.ends[row] = games.node[row]
        return 0

    def is_moving(self, games: GameColumns, game: int, i: int) -> bool:
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


def count_whole_edges(budget: float) -> float:
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
        walk(walks.trips, row, 1)
        return True
    by_hops = ways is walks.hops
    first = target
    if not by_hops or not is_next(walks.legal, node, target):
        first = travel.find_next_node(ways, memory, node, target)
        if first == node:
            return False
    ahead = walks.trips.edge[row]
    if by_hops and ahead >= 0 and ahead != first:
        onward = travel.compute_distance(ways, memory, ahead, target) if ahead != target else 0.0
        if 1.0 - walks.trips.share[row] + onward <= travel.compute_distance(ways, memory, node, target):
            first = ahead
    walks.trips.route[0] = first
    count = 1
    while walks.trips.route[count - 1] != target and count <= count_whole_edges(walks.trips.speed[row] + 1.0):
        walks.trips.route[count] = travel.find_next_node(ways, memory, walks.trips.route[count - 1], target)
        count += 1
    walk(walks.trips, row, count)
    return True


def walk(trips: TurnPaths, row: int, count: int) -> int:
    """Move an agent along the first `count` nodes of the route, at least one, as far as its speed allows."""
    budget = 1.0
    speed = trips.speed[row]
    if speed == speed:  # noqa: PLR0124 - not NaN
        budget = speed + (trips.share[row] if trips.route[0] == trips.edge[row] else 0.0)
    trips.edge[row] = -1
    trips.share[row] = 0.0
    edges = 0
    first = row * (trips.most + 1)
    while edges < count and edges < count_whole_edges(budget):
        edges += 1
        trips.nodes[first + edges] = trips.route[edges - 1]
    trips.passed[row] = edges + 1
    trips.node[row] = trips.nodes[first + edges]
    for place in range(1, edges + 1):
        trips.times[first + place] = place / edges
    left = budget - edges
    if edges < count and trips.route[edges] != trips.node[row] and travel.SLACK < left < 1.0:
        trips.edge[row] = trips.route[edges]
        trips.share[row] = left
    return 0


# -- traffic with turn restrictions ------------------------------------------------------------------------------------


def find_state(s: TrafficStates, row: int, node: int, previous: int) -> int:
    """Return the state of an agent on a node, on the map in use.

    It begins on its node if its last edge is closed, or if something else than its last move has brought it there.

    Args:
        s: the states.
        row: the row of the agent.
        node: its node.
        previous: its previous node.
    """
    state = s.driven[row]
    if state < 0:
        return s.begin + node
    kept = s.kept[s.first + state]
    if kept < 0 or s.nodes[kept] != node or s.sources[kept] != previous:
        return s.begin + node
    return kept


def find_places(
    s: TrafficStates,
    games: memoryview[int],
    agents: memoryview[int],
    node: memoryview[int],
    previous: memoryview[int],
    places: memoryview[int],
) -> int:
    """Write the places of the states of agents in games.

    Args:
        s: the states.
        games: (entries,) the numbers of games.
        agents: (entries,) the numbers of agents that obey turns.
        node: (entries,) their nodes.
        previous: (entries,) their previous nodes.
        places: (entries,) receives the places.
    """
    for at in range(len(games)):
        use_states(s, games[at], agents[at])
        row = games[at] * len(s.begin_of_agent) + agents[at]
        places[at] = s.first + find_state(s, row, node[at], previous[at])
    return 0


def use_states(s: TrafficStates, game: int, agent: int) -> int:
    """Use the map of a game, and the mode of an agent that obeys turns."""
    s.first = s.first_of_game[game]
    s.begin = s.begin_of_agent[agent]
    return 0


def find_next(s: TrafficStates, state: int, node: int, edge: int) -> int:
    """Return the first state that may follow a state on a node, or along an edge; -1: none may, or neither is given.

    Args:
        s: the states.
        state: the state.
        node: the node, which differs from that of the state; -1: any.
        edge: the edge; -1: any.
    """
    if node < 0 and edge < 0:
        return -1
    at = s.first + state
    for place in range(s.offsets[at], s.offsets[at + 1]):
        after = s.after[place]
        if (node < 0 or s.nodes[after] == node) and (edge < 0 or s.edges[after] == edge):
            return after
    return -1


def list_with_turns(s: TrafficStates, reach: ReachSearch, state: int) -> int:
    """Find the legal nodes of an agent in a state; return their number."""
    reach.search += 1
    reach.found = 0
    travel.list_node(reach, s.nodes[state], 0.0)
    at = s.first + state
    for place in range(s.offsets[at], s.offsets[at + 1]):
        travel.list_node(reach, s.nodes[s.after[place]], 0.0)
    return reach.found


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
    if w.obey_turns and w.with_turns.states.begin_of_agent[i] >= 0:  # type: ignore[union-attr] # some obey them
        return choose_with_turns(games, w, w.with_turns, game, i)  # type: ignore[arg-type]
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
            target = find_target(games, w, game, i)
    if count > 0:
        walk(w.trips, own, count)
    elif target >= 0 and target != node:
        if w.paths.legal.reach.listed[target] == w.paths.legal.reach.search:
            go_towards(w.paths, own, w.paths.hops, row, target)
        else:
            go_towards(w.paths, own, w.long_ways, row, target)  # type: ignore[arg-type] # there are some
    else:
        stand(games, w, row, i)
    w.ends[row] = w.trips.node[own]
    return 0


def choose_with_turns(games: GameColumns, w: EdgeMovers, legal: LegalWithTurns, game: int, i: int) -> int:
    """Decide for an agent that obeys turn restrictions, and write its path along one edge."""
    row = game * games.agents + i
    own = w.first + i
    node = games.node[row]
    stand(games, w, row, i)
    w.ends[row] = node
    legal.states.driving[row] = legal.states.driven[row]
    if not games.alive[row]:
        return 0
    w.blocked[row] = 0
    use_states(legal.states, game, i)
    state = find_state(legal.states, row, node, games.previous[row])
    legal.states.driven[row] = -1 if legal.states.edges[state] < 0 else state
    legal.states.driving[row] = legal.states.driven[row]
    after = find_chosen_state(games, w, legal, game, i, state)
    if after >= 0:
        w.trips.route[0] = legal.states.nodes[after]
        walk(w.trips, own, 1)
        w.trips.edges[own * w.trips.most] = legal.states.edges[after]
        legal.states.driving[row] = after
        w.ends[row] = w.trips.node[own]
    return 0


def find_chosen_state(games: GameColumns, w: EdgeMovers, legal: LegalWithTurns, game: int, i: int, state: int) -> int:
    """Return the state to which an agent goes on, by its own decision or a given action; -1: it stays."""
    row = game * games.agents + i
    by = w.decides_by[i]
    if by == moves.STAYS:
        return -1
    if by == moves.IS_GIVEN and (w.edges[row] >= 0 or w.given[row] < 0):
        return find_next(legal.states, state, -1, w.edges[row])
    count = list_with_turns(legal.states, legal.reach, state)
    number = moves.as_legal(w.given[row], count)
    if by != moves.IS_GIVEN:
        number = draws.draw_integer(w.walks.keys[row], games.turn[game], 0, count)
    return find_next(legal.states, state, legal.reach.nodes[number] if number > 0 else -1, -1)


def go(games: GameColumns, w: EdgeMovers, game: int, i: int) -> int:
    """Move an agent to the end of its move, and fit its path into its part of the turn."""
    row = game * games.agents + i
    own = w.first + i
    obeys = w.obey_turns and w.with_turns.states.begin_of_agent[i] >= 0  # type: ignore[union-attr] # some obey them
    if obeys and games.node[row] == games.start[row] and w.trips.passed[own] > 1:  # no rule has put it elsewhere
        w.with_turns.states.driven[row] = w.with_turns.states.driving[row]  # type: ignore[union-attr]
    moves.go(games, w, row)
    games.edge[row] = w.trips.edge[own]
    games.share[row] = w.trips.share[own]
    if w.went[row] != games.node[row]:  # a rule has put it there
        w.trips.times[own * (w.trips.most + 1)] = 1.0
    if w.parts > 1 and w.trips.passed[own] > 1:
        travel.go_in_part(w.trips, own, w.part[game], w.parts)
    return 0


def find_target(games: GameColumns, w: EdgeMovers, game: int, i: int) -> int:
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
    return w.paths.legal.reach.nodes[draws.draw_integer(w.walks.keys[row], games.turn[game], 0, count)]
