"""Strategies of one game, executed as steps: agents go to nodes, chase visible enemies, or flee from them.

A strategy is a list of steps, tried in order until one chooses a node: `chase(otherwise=patrol(nodes))` has two. `act`
returns the chosen node, and updates the memory of the agent.
"""

from __future__ import annotations

from array import array
from typing import Any

from gamms.core import draws, routes, rules, sight, travel
from gamms.core.rules import GameColumns

STAYS = 0  # kinds of steps: stay;
WALKS = 1  # move to a uniform random legal node;
GOES = 2  # go to a fixed node;
FOLLOWS = 3  # visit the nodes of a list in order;
WANDERS = 4  # go to a random node, wait there for some turns, then draw another one;
CHASES = 5  # go to the nearest visible enemy;
FLEES = 6  # move to the legal node farthest from visible enemies;
MIXES = 7  # continue with a probability, else skip a number of steps;
SKIPS = 8  # skip a number of steps;
PICKS = 9  # continue if the number drawn for the team and the game is below a bound, else skip a number of steps
KINDS = ("stay", "walk", "go", "follow", "wander", "chase", "flee", "mix", "skip", "pick")  # names of steps by number
NOTHING = -1  # no node was chosen: try the next step
INFINITE = float("inf")


# -- decisions common to single games and batches ----------------------------------------------------------------------


def find_next_stop(
    stops: memoryview[int], following: memoryview[int], first: int, count: int, at: int, node: int
) -> int:
    """Return the index of the stop that an agent goes to next; `count` after the last stop.

    Args:
        stops: nodes; the agent's stops are the `count` entries from index `first`.
        following: for each stop, the index of the next stop at another node.
        first: see `stops`.
        count: the number of stops.
        at: the index of the current stop.
        node: the node of the agent.
    """
    if 0 <= at < count and stops[first + at] == node:
        return following[first + at]
    return at


def count_turns_left(is_there: bool, left: int, far: float) -> int:
    """Return the number of turns that an agent still waits at its waypoint; -1: it draws another waypoint.

    Args:
        is_there: whether it is at its waypoint.
        left: the number of turns that it had left.
        far: the distance to the waypoint; infinity if there is no path, or no waypoint.
    """
    if is_there:
        return left - 1
    return max(left, 0) if far < INFINITE else -1


def is_nearer(far: float, number: int, least: float, found: int) -> bool:
    """Return whether a distance replaces the least one so far; of equal distances the lower number has the first.

    Args:
        far: the distance; infinity: there is no path, so that it replaces none.
        number: its number.
        least: the least distance so far, or the greatest that counts.
        found: the number of that distance; while there is none, a number above all others.
    """
    return far < least or (far == least and far < INFINITE and number < found)


def find_farthest(distances: memoryview[float], ids: memoryview[int], count: int) -> int:
    """Return the index of the greatest of the first `count` distances; ties go to the lowest id."""
    found = 0
    for number in range(1, count):
        if is_nearer(-distances[number], ids[number], -distances[found], ids[found]):
            found = number
    return found


def is_drawn(fraction: float, chance: float) -> bool:
    """Return whether something with a probability happens, given a random number in [0, 1)."""
    return fraction < chance


def are_mates(own: int, other: int, nobody: int) -> bool:
    """Return whether agents of two teams are mates; `nobody` is the number of agents without a team, who have none."""
    return own == other and own != nobody


def mark_mates(
    teams: memoryview[int], nobody: int, agents: memoryview[int], others: memoryview[int], found: memoryview[int]
) -> int:
    """Write whether agents are mates of others, (pairs,); `teams`, (all agents,), has the team of each."""
    for pair in range(len(agents)):
        found[pair] = are_mates(teams[agents[pair]], teams[others[pair]], nobody)
    return 0


# -- the strategies of batches -----------------------------------------------------------------------------------------


class StrategySteps:
    """The steps of the strategies of agents.

    Attributes:
        begins: (agents + 1,) the steps of agent `i` are `begins[i]` to `begins[i + 1] - 1`.
        kinds: (steps,) `STAYS` to `PICKS`.
        first: (steps,) where the nodes of the step begin in `nodes`.
        sizes: (steps,) the number of its nodes.
        numbers: (steps,) for `FOLLOWS`, 1: begin with the nearest stop; for `WANDERS`, the turns to wait; for `MIXES`,
            `SKIPS` and `PICKS`, the number of steps to skip.
        chances: (steps,) for `MIXES`, the probability; for `PICKS`, the bound.
        slots: (steps,) the memory column of the step; `WANDERS` also uses the next one.
        nodes: rows of nodes.
        following: for each node on a list, the index of the next one that is a different node.
    """

    def __init__(
        self,
        begins: memoryview[int],
        kinds: memoryview[int],
        first: memoryview[int],
        sizes: memoryview[int],
        numbers: memoryview[int],
        chances: memoryview[float],
        slots: memoryview[int],
        nodes: memoryview[int],
        following: memoryview[int],
    ) -> None:
        self.begins = begins
        self.kinds = kinds
        self.first = first
        self.sizes = sizes
        self.numbers = numbers
        self.chances = chances
        self.slots = slots
        self.nodes = nodes
        self.following = following


class Strategies:
    """The agents of games that decide by strategy steps; rows are as in `rules.GameColumns`.

    Attributes:
        games: the games.
        steps: the steps of their strategies.
        ways: shortest paths.
        search: finds the agents that agents see; it has no memory unless `has_lookers`.
        has_lookers: whether some agents look for others.
        seen: (agents,) working memory: the numbers of the agents that were found last.
        keys: (rows,) the `draws.compute_first_key` of each agent.
        shares: (rows,) the number in [0, 1) drawn for the team of each agent in its game; empty without `PICKS`.
        legal: (nodes,) the legal nodes of the current agent, its own node first; written by the caller.
        legal_ids, safety: (nodes,) working memory: their ids, and their distances from the nearest enemy.
        memory: (columns * rows,) the memory of the agents.
        count: the number of legal nodes.
        ahead: the node at the end of the current agent's edge; -1: it is on a node.
        goes_far: whether the current agent may choose a target beyond the legal nodes,
        long_ways: and the paths that it then follows.
        has_roads: whether there are such paths, for agents that do not all go along one edge a turn.
        near_offsets, near_targets: the legal moves, as in `moves.LegalMoves`, of agents that go along one edge a turn.
        anywhere: empty; all nodes are allowed, see `routes.find_next_node`.
        drawn: the number of draws of the current agent in this turn; set by the caller.
    """

    def __init__(
        self,
        games: GameColumns,
        steps: StrategySteps,
        ways: routes.PathTables,
        search: sight.AgentSearch,
        keys: memoryview[int],
        shares: memoryview[float],
        memory: memoryview[int],
    ) -> None:
        self.games = games
        self.steps = steps
        self.ways = ways
        self.search = search
        self.has_lookers = len(self.search.order) > 0
        self.keys = keys
        self.shares = shares
        self.memory = memory
        nodes = len(self.ways.ids)
        safety: Any = memoryview(array("d", bytes(8 * nodes)))
        self.legal = memoryview(array("q", bytes(8 * nodes)))
        self.legal_ids = memoryview(array("q", bytes(8 * nodes)))
        self.safety: memoryview[float] = safety
        self.seen = memoryview(array("q", bytes(8 * games.agents)))
        self.count = 0
        self.ahead = -1
        self.goes_far = False
        self.long_ways: travel.GoalPaths | None = None
        self.has_roads = False
        self.anywhere = memoryview(b"")
        self.near_offsets = memoryview(array("i"))
        self.near_targets = memoryview(array("i"))
        self.drawn = 0

    def go_far(self, ways: travel.GoalPaths) -> None:
        """Set the shortest paths, by row, of agents that may choose targets beyond their legal nodes."""
        self.long_ways = ways
        self.has_roads = True

    def take_moves(self, offsets: memoryview[int], targets: memoryview[int]) -> int:
        """Set the legal moves along one edge, by which waypoints are reachable."""
        self.near_offsets = offsets
        self.near_targets = targets
        return 0


def begin(p: Strategies, game: int) -> int:
    """Take the places of the agents of a game, before the agents of a part of a turn decide."""
    if p.has_lookers:
        p.search.load_node_positions(game, 0)
    return 0


def take_legal(p: Strategies, nodes: memoryview[int], count: int) -> int:
    """Set the legal nodes of the current agent to the first `count` of `nodes`."""
    p.count = count
    for number in range(count):
        p.legal[number] = nodes[number]
    return 0


def act(p: Strategies, game: int, agent: int) -> int:
    """Return the node that an agent chooses, legal unless `goes_far`; -1: it stays."""
    node = p.games.node[game * p.games.agents + agent]
    p.ways.arcs.first = rules.find_first_place(p.games, game, agent)
    step = p.steps.begins[agent]
    while step < p.steps.begins[agent + 1]:
        kind = p.steps.kinds[step]
        target = NOTHING
        if kind == STAYS:
            return NOTHING
        if kind == WALKS:
            return p.ahead if p.ahead >= 0 else p.legal[_draw_number(p, game, agent, p.count)]
        if kind == GOES:
            target = p.steps.nodes[p.steps.first[step]]
        elif kind == FOLLOWS:
            target = _stop(p, game, agent, step, node)
        elif kind == WANDERS:
            target = _choose_waypoint(p, game, agent, step, node)
        elif kind == CHASES:
            target = _find_nearest_enemy(p, game, agent, node)
        elif kind == FLEES:
            target = _find_farthest(p, game, agent)
        elif kind == PICKS:
            if not is_drawn(p.shares[game * p.games.agents + agent], p.steps.chances[step]):
                step += p.steps.numbers[step]
        elif kind == SKIPS or not is_drawn(_draw_fraction(p, game, agent), p.steps.chances[step]):
            step += p.steps.numbers[step]
        target = _step_towards(p, game, agent, node, target)
        if target >= 0:
            return target
        step += 1
    return NOTHING


def _find_distance(p: Strategies, game: int, agent: int, node: int, target: int) -> float:
    """Return the distance from a node to the target of an agent; with `goes_far`, the path is stored."""
    if p.goes_far:
        return travel.compute_distance(p.long_ways, game * p.games.agents + agent, node, target)  # type: ignore[arg-type]
    return p.ways.get_distance(node, target)


def _step_towards(p: Strategies, game: int, agent: int, node: int, target: int) -> int:
    """Return the node that an agent moves to on its path to a target; NOTHING: no target, or no path."""
    if target < 0:
        return NOTHING
    if not p.goes_far or routes.find_number(p.legal, 0, p.count, target) >= 0:
        return routes.find_next_node(p.ways, p.legal, 0, p.count, node, target, p.anywhere)
    has_path = _find_distance(p, game, agent, node, target) < INFINITE
    if p.ahead >= 0 and not has_path:
        has_path = _find_distance(p, game, agent, p.ahead, target) < INFINITE
    return target if has_path else NOTHING


def _draw_number(p: Strategies, game: int, agent: int, bound: int) -> int:
    """Return a random number below a bound."""
    p.drawn += 1
    return draws.draw_integer(p.keys[game * p.games.agents + agent], p.games.turn[game], p.drawn - 1, bound)


def _draw_fraction(p: Strategies, game: int, agent: int) -> float:
    """Return a random number in [0, 1)."""
    p.drawn += 1
    key = draws.compute_turn_key(p.keys[game * p.games.agents + agent], p.games.turn[game])
    return draws.convert_to_fraction(draws.compute_bits(key, p.drawn - 1))


def _find_index(p: Strategies, game: int, agent: int, column: int) -> int:
    """Return the index of a memory column of an agent in `memory`."""
    return column * len(p.games.node) + game * p.games.agents + agent


def _stop(p: Strategies, game: int, agent: int, step: int, node: int) -> int:
    """Return the next node on an agent's list; -1: it has visited the last one."""
    first = p.steps.first[step]
    place = _find_index(p, game, agent, p.steps.slots[step])
    at = p.memory[place]
    if at < 0:
        at = _find_nearest_stop(p, step, node) if p.steps.numbers[step] else 0
    at = find_next_stop(p.steps.nodes, p.steps.following, first, p.steps.sizes[step], at, node)
    p.memory[place] = at
    return p.steps.nodes[first + at] if at < p.steps.sizes[step] else -1


def _find_nearest_stop(p: Strategies, step: int, node: int) -> int:
    """Return the index of the nearest node on a list, the first of equals; 0 if no path leads to any."""
    first = p.steps.first[step]
    found = p.steps.sizes[step]
    least = INFINITE
    for number in range(p.steps.sizes[step]):
        far = p.ways.get_distance(node, p.steps.nodes[first + number])
        if is_nearer(far, number, least, found):
            least = far
            found = number
    return found if found < p.steps.sizes[step] else 0


def _choose_waypoint(p: Strategies, game: int, agent: int, step: int, node: int) -> int:
    """Return the agent's current waypoint, or draw a new one."""
    place = _find_index(p, game, agent, p.steps.slots[step])
    place_of_left = _find_index(p, game, agent, p.steps.slots[step] + 1)
    target = p.memory[place]
    far = INFINITE
    if target >= 0 and target != node:
        far = _find_distance(p, game, agent, node, target)
    left = count_turns_left(target == node, p.memory[place_of_left], far)
    if left < 0:
        target = _draw_waypoint(p, game, agent, step, node)
        left = p.steps.numbers[step]
    p.memory[place] = target
    p.memory[place_of_left] = left
    return target


def _draw_waypoint(p: Strategies, game: int, agent: int, step: int, node: int) -> int:
    """Draw a waypoint of an agent; if it cannot reach the node, draw one of those that it can reach, if there are any.

    So nothing has to be searched where all nodes can be reached.
    """
    first = p.steps.first[step]
    target = p.steps.nodes[first + _draw_number(p, game, agent, p.steps.sizes[step])]
    is_near = not p.goes_far and routes.find_number(p.legal, 0, p.count, target) >= 0
    if is_near or _find_distance(p, game, agent, node, target) < INFINITE:
        return target
    _list_reachable(p, node)
    count = 0
    for number in range(first, first + p.steps.sizes[step]):
        if p.ways.paths.reach.listed[p.steps.nodes[number]] == p.ways.paths.reach.search:
            count += 1
    if count == 0:
        return target
    left = _draw_number(p, game, agent, count)
    number = first
    while left > 0 or p.ways.paths.reach.listed[p.steps.nodes[number]] != p.ways.paths.reach.search:
        if p.ways.paths.reach.listed[p.steps.nodes[number]] == p.ways.paths.reach.search:
            left -= 1
        number += 1
    return p.steps.nodes[number]


def _list_reachable(p: Strategies, node: int) -> int:
    """List the nodes that the current agent can reach from a node in any time."""
    p.ways.paths.reach.search += 1
    p.ways.paths.reach.found = 0
    travel.list_node(p.ways.paths.reach, node, 0.0)
    place = 0
    while place < p.ways.paths.reach.found:
        at = p.ways.paths.reach.nodes[place]
        if p.has_roads:
            for number in range(p.long_ways.roads.count(at)):  # type: ignore[union-attr] # there are some
                edge = p.long_ways.roads.get_edge(at, number)  # type: ignore[union-attr]
                if not p.goes_far or p.long_ways.roads.get_cost(edge) < INFINITE:  # type: ignore[union-attr]
                    travel.list_node(p.ways.paths.reach, p.long_ways.roads.targets[edge], 0.0)  # type: ignore[union-attr]
        else:
            at += p.ways.arcs.first
            for number in range(p.near_offsets[at], p.near_offsets[at + 1]):
                travel.list_node(p.ways.paths.reach, p.near_targets[number], 0.0)
        place += 1
    return 0


def _find_enemies(p: Strategies, game: int, agent: int) -> int:
    """Write the numbers of the visible enemies of an agent to `seen`, in no order; return how many they are."""
    count = sight.see(p.search, game, agent, p.seen)
    enemies = 0
    for place in range(count):
        if not are_mates(p.games.team[agent], p.games.team[p.seen[place]], p.games.nobody):
            p.seen[enemies] = p.seen[place]
            enemies += 1
    return enemies


def _find_nearest_enemy(p: Strategies, game: int, agent: int, node: int) -> int:
    """Return the node of the nearest visible enemy by road, the first of equals; -1: none."""
    at = game * p.games.agents
    found = p.games.agents
    least = INFINITE
    for place in range(_find_enemies(p, game, agent)):
        other = p.seen[place]
        far = p.ways.get_distance(node, p.games.node[at + other])
        if is_nearer(far, other, least, found):
            least = far
            found = other
    return p.games.node[at + found] if found < p.games.agents else -1


def _find_farthest(p: Strategies, game: int, agent: int) -> int:
    """Return the legal node farthest from the nearest visible enemy; NOTHING: no enemy is visible."""
    at = game * p.games.agents
    count = _find_enemies(p, game, agent)
    if count == 0:
        return NOTHING
    for number in range(p.count):
        p.safety[number] = INFINITE
        p.legal_ids[number] = p.ways.ids[p.legal[number]]
    for place in range(count):
        for number in range(p.count):
            far = p.ways.get_distance(p.games.node[at + p.seen[place]], p.legal[number])
            p.safety[number] = min(p.safety[number], far)
    return p.legal[find_farthest(p.safety, p.legal_ids, p.count)]
