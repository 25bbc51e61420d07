"""Strategies of one game: agents that go to nodes, after enemies in sight, or away from them.

A strategy is a list of steps, tried in turn until one gives a node: `chase(otherwise=patrol(nodes))` is two.
`act` returns the node to which an agent goes, and writes what it remembers.
"""

from __future__ import annotations

from array import array
from typing import Any

from gamms.core import draws, routes, travel
from gamms.core.rules import Games, extended

STAYS = 0  # a step: it stays,
WALKS = 1  # goes to one of the legal nodes, each as likely,
GOES = 2  # to a node,
FOLLOWS = 3  # from one node of a list to the next,
WANDERS = 4  # to a node that is drawn, and to another one when it was there for some turns,
CHASES = 5  # to the nearest enemy in sight,
FLEES = 6  # or to the legal node that is farthest from enemies in sight;
MIXES = 7  # it tries the next steps with a probability, else those behind a number of steps;
SKIPS = 8  # steps that are not tried
KINDS = ("stay", "walk", "go", "follow", "wander", "chase", "flee", "mix", "skip")  # of steps by their numbers
NOTHING = -1  # no node: the next step is tried
NOT_KNOWN = -1.0  # a distance
INFINITE = float("inf")


# -- what strategies decide by, in a game alone and in batches ---------------------------------------------------------


def next_stop(stops: memoryview[int], following: memoryview[int], first: int, count: int, at: int, node: int) -> int:
    """Return the number of the stop to which an agent on a node goes; `count` after the last one.

    Args:
        stops: nodes; those of the agent are the `count` ones from `first` on.
        following: of each of these, the number of the next one that is another node.
        first: see `stops`.
        count: how many stops there are.
        at: the number of the stop to which the agent went so far.
        node: where it is.
    """
    if at < count and stops[first + at] == node:
        return following[first + at]
    return at


def turns_left(is_there: bool, left: int, far: float) -> int:
    """Return for how many turns an agent still stays at its waypoint; -1: it draws another waypoint.

    Args:
        is_there: whether it is at its waypoint.
        left: for how many turns it was to stay there.
        far: how far the waypoint is; infinite where no path leads there, or none has been drawn.
    """
    if is_there:
        return left - 1
    return max(left, 0) if far < INFINITE else -1


def farthest(distances: memoryview[float], ids: memoryview[int], count: int) -> int:
    """Return the number of the greatest of the first `count` distances; ties go to the lowest id."""
    found = 0
    for number in range(1, count):
        is_lower = distances[number] == distances[found] and ids[number] < ids[found]
        if distances[number] > distances[found] or is_lower:
            found = number
    return found


# -- the strategies of batches -----------------------------------------------------------------------------------------


class WayTables:
    """Ways from all nodes to some targets, which are found when they are first asked for.

    They are those of `travel.Ways`, by length.

    Attributes:
        ids: (nodes,) of nodes by their rows.
        arcs: the edges on all maps, reversed; `arcs.first` is the place of the first node of the map of the game that
            decides, see `moves.Streets`.
        paths: scratch.
        tables: (places,) the number of the table of the target at each place; -1: there is none.
        targets: (room,) the places of the targets of tables; -1: on a map that no game has any more.
        far: (room * nodes,) how far it is from a node to the target; infinite where no path leads there.
        following: (room * nodes,) the node that comes next.
        count: how many tables there are.
    """

    def __init__(
        self,
        ids: memoryview[int],
        offsets: memoryview[int],
        tails: memoryview[int],
        costs: memoryview[float],
        paths: routes.Paths,
        far: memoryview[float],
        following: memoryview[int],
    ) -> None:
        self.ids = ids
        self.paths = paths
        self.root = memoryview(array("q", [0]))
        self.goal = memoryview(array("q", [0]))
        self.tables = memoryview(array("q"))
        self.targets = memoryview(array("q"))
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
        """Find ways on other maps from now on.

        `moved` has the first place of each map that there was, -1 of one that is gone. The edges that lead to the node
        at each place begin at `offsets`; `tails` are the nodes that they lead from, `costs` their lengths. `far` and
        `following` begin with what they had.
        """
        nodes = max(len(self.ids), 1)
        self.arcs = routes.Arcs(offsets, tails, costs, self.ids)
        self.far = far
        self.following = following
        self.tables = memoryview(array("q", [-1] * (len(offsets) - 1)))
        self.targets = extended("q", self.targets, len(far) // nodes)
        for table in range(self.count):
            place = self.targets[table]
            if place >= 0:
                self.targets[table] = moved[place // nodes]
            if self.targets[table] >= 0:
                self.targets[table] += place % nodes
                self.tables[self.targets[table]] = table

    def place(self, node: int, target: int) -> int:
        """Return where the columns have the way from a node to a target."""
        if self.tables[self.arcs.first + target] < 0:
            self.begin(self.arcs.first + target)
            self.find(target, node)
        place = self.tables[self.arcs.first + target] * len(self.ids) + node
        if self.far[place] == NOT_KNOWN:
            self.find(target, -1)
        return place

    def begin(self, place: int) -> int:
        """Add a table of the target at a place; where there is no room, without those of before."""
        if self.count == len(self.targets):
            for table in range(self.count):
                if self.targets[table] >= 0:
                    self.tables[self.targets[table]] = -1
            self.count = 0
        self.tables[place] = self.count
        self.targets[self.count] = place
        first = self.count * len(self.ids)
        self.count += 1
        for node in range(len(self.ids)):
            self.far[first + node] = NOT_KNOWN
        return 0

    def find(self, target: int, node: int) -> int:
        """Find the ways to a target from all nodes that are no farther from it than a node; -1: from all nodes."""
        first = self.tables[self.arcs.first + target] * len(self.ids)
        self.root[0] = target
        self.goal[0] = node
        routes.find(self.arcs, self.paths, self.root, self.goal, len(self.ids), INFINITE, False)
        is_whole = self.paths.reach.size == 0
        for number in range(self.paths.count):
            at = self.paths.reach.seen[number]
            if is_whole or at == node or self.paths.reach.when[at] < self.paths.reach.when[node]:
                self.far[first + at] = self.paths.reach.when[at]
                self.following[first + at] = self.paths.before[at]
        if is_whole:
            for place in range(first, first + len(self.ids)):
                if self.far[place] == NOT_KNOWN:
                    self.far[place] = INFINITE
        return 0

    def distance(self, node: int, target: int) -> float:
        """Return how far it is from a node to a target; infinite where no path leads there."""
        return self.far[self.place(node, target)]


class Looks:
    """What sensors on agents show: the agents of some teams within a radius on the map.

    Attributes:
        begins: (agents + 1,) the sensors of agent `i` are `begins[i]` to `begins[i + 1] - 1`.
        squares: (sensors,) of the radius; may be infinite.
        shows: (sensors * teams,) 1: it shows the agents of a team.
        teams: how many there are.
        places: (2 * nodes,) x and y of each node, map units; or of whatever else `shows` is asked about.
    """

    def __init__(
        self,
        begins: memoryview[int],
        squares: memoryview[float],
        shows: memoryview[int],
        teams: int,
        places: memoryview[float],
    ) -> None:
        self.begins = begins
        self.squares = squares
        self.shows = shows
        self.teams = teams
        self.places = places


class Steps:
    """The steps of the strategies of agents.

    Attributes:
        begins: (agents + 1,) those of agent `i` are `begins[i]` to `begins[i + 1] - 1`.
        kinds: (steps,) `STAYS`, ...
        first: (steps,) where their nodes begin in `nodes`.
        sizes: (steps,) how many these are.
        numbers: (steps,) of `FOLLOWS` 1: the agent begins with the nearest; of `WANDERS` for how many turns it stays;
            of `MIXES` and `SKIPS` of how many steps.
        chances: (steps,) of `MIXES`, the probability.
        slots: (steps,) the column of what agents remember by the step; of `WANDERS` the next one, too.
        nodes: rows of nodes.
        following: of each of these that is on a list, the number of the next one on it that is another node.
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
    """The agents of games as they decide by steps; rows are those of `rules.Games`.

    Attributes:
        games: the games.
        steps: of their strategies.
        ways: the ways on the map.
        looks: the sensors that agents carry.
        keys: (rows,) the `draws.first_key` of each agent.
        legal: (nodes,) the legal nodes of the agent that decides, its own first; the caller writes them.
        legal_ids, safety: (nodes,) scratch: their ids, and how far the nearest enemy is from them.
        memory: (columns * rows,) what agents remember.
        count: how many legal nodes there are.
        ahead: the node at the end of the edge that the agent is on; -1: it is on its node.
        goes_far: whether it may go on towards nodes that are not legal,
        long_ways: along these.
        drawn: how often it has drawn in this turn; the caller sets it.
    """

    def __init__(
        self,
        games: Games,
        steps: Steps,
        ways: WayTables,
        looks: Looks,
        keys: memoryview[int],
        memory: memoryview[int],
    ) -> None:
        self.games = games
        self.steps = steps
        self.ways = ways
        self.looks = looks
        self.keys = keys
        self.memory = memory
        nodes = len(self.ways.ids)
        safety: Any = memoryview(array("d", bytes(8 * nodes)))
        self.legal = memoryview(array("q", bytes(8 * nodes)))
        self.legal_ids = memoryview(array("q", bytes(8 * nodes)))
        self.safety: memoryview[float] = safety
        self.count = 0
        self.ahead = -1
        self.goes_far = False
        self.long_ways: travel.Ways | None = None
        self.drawn = 0

    def go_far(self, ways: travel.Ways) -> None:
        """Have the ways of agents that may go on towards nodes that are not legal, by their rows."""
        self.long_ways = ways


def take_legal(p: Strategies, nodes: memoryview[int], count: int) -> int:
    """Take the first `count` of some nodes as the legal ones of the agent that decides next."""
    p.count = count
    for number in range(count):
        p.legal[number] = nodes[number]
    return 0


def act(p: Strategies, game: int, agent: int) -> int:
    """Return the node to which an agent of a game goes, which is legal unless it goes far; -1: it stays."""
    node = p.games.node[game * p.games.agents + agent]
    p.ways.arcs.first = p.games.first_node[game]
    step = p.steps.begins[agent]
    while step < p.steps.begins[agent + 1]:
        kind = p.steps.kinds[step]
        target = NOTHING
        if kind == STAYS:
            return NOTHING
        if kind == WALKS:
            return p.ahead if p.ahead >= 0 else p.legal[_drawn(p, game, agent, p.count)]
        if kind == GOES:
            target = p.steps.nodes[p.steps.first[step]]
        elif kind == FOLLOWS:
            target = _stop(p, game, agent, step, node)
        elif kind == WANDERS:
            target = _waypoint(p, game, agent, step, node)
        elif kind == CHASES:
            target = _nearest_enemy(p, game, agent, node)
        elif kind == FLEES:
            target = _farthest(p, game, agent)
        elif kind == SKIPS or _chance(p, game, agent) >= p.steps.chances[step]:
            step += p.steps.numbers[step]
        target = _towards(p, game, agent, node, target)
        if target >= 0:
            return target
        step += 1
    return NOTHING


def _distance(p: Strategies, game: int, agent: int, node: int, target: int) -> float:
    """Return how far it is from a node to the target of an agent; if it goes far, the way to there is remembered."""
    if p.goes_far:
        return travel.distance(p.long_ways, game * p.games.agents + agent, node, target)  # type: ignore[arg-type]
    return p.ways.distance(node, target)


def _towards(p: Strategies, game: int, agent: int, node: int, target: int) -> int:
    """Return the node to which an agent goes on its way to a target; NOTHING: there is none, or no path."""
    if target < 0 or _is_legal(p, target):
        return target
    has_path = _distance(p, game, agent, node, target) < INFINITE
    if p.goes_far and p.ahead >= 0 and not has_path:
        has_path = _distance(p, game, agent, p.ahead, target) < INFINITE
    if p.goes_far or not has_path:
        return target if has_path else NOTHING
    found = node
    following = p.ways.following[p.ways.place(node, target)]
    while _is_legal(p, following):
        found = following
        following = p.ways.following[p.ways.place(found, target)]
    return found


def _is_legal(p: Strategies, node: int) -> bool:
    found = False
    for number in range(p.count):
        found = found or p.legal[number] == node
    return found


def _drawn(p: Strategies, game: int, agent: int, bound: int) -> int:
    """Draw a number below a bound."""
    p.drawn += 1
    return draws.below_at(p.keys[game * p.games.agents + agent], p.games.turn[game], p.drawn - 1, bound)


def _chance(p: Strategies, game: int, agent: int) -> float:
    """Draw a number from 0 to 1."""
    p.drawn += 1
    key = draws.turn_key(p.keys[game * p.games.agents + agent], p.games.turn[game])
    return draws.fraction(draws.bits_at(key, p.drawn - 1))


def _place(p: Strategies, game: int, agent: int, column: int) -> int:
    """Return where an agent remembers something."""
    return column * len(p.games.node) + game * p.games.agents + agent


def _stop(p: Strategies, game: int, agent: int, step: int, node: int) -> int:
    """Return the node on its list to which an agent goes; -1: it was at the last one."""
    first = p.steps.first[step]
    place = _place(p, game, agent, p.steps.slots[step])
    at = p.memory[place]
    if at < 0:
        at = 0
        if p.steps.numbers[step]:
            least = p.ways.distance(node, p.steps.nodes[first])
            for number in range(1, p.steps.sizes[step]):
                far = p.ways.distance(node, p.steps.nodes[first + number])
                if far < least:
                    least = far
                    at = number
    at = next_stop(p.steps.nodes, p.steps.following, first, p.steps.sizes[step], at, node)
    p.memory[place] = at
    return p.steps.nodes[first + at] if at < p.steps.sizes[step] else -1


def _waypoint(p: Strategies, game: int, agent: int, step: int, node: int) -> int:
    """Return the node that was drawn, or draw another one."""
    place = _place(p, game, agent, p.steps.slots[step])
    place_of_left = _place(p, game, agent, p.steps.slots[step] + 1)
    target = p.memory[place]
    far = INFINITE
    if target >= 0 and target != node:
        far = _distance(p, game, agent, node, target)
    left = turns_left(target == node, p.memory[place_of_left], far)
    if left < 0:
        target = p.steps.nodes[p.steps.first[step] + _drawn(p, game, agent, p.steps.sizes[step])]
        left = p.steps.numbers[step]
    p.memory[place] = target
    p.memory[place_of_left] = left
    return target


def _sees(looks: Looks, games: Games, game: int, agent: int, other: int) -> bool:
    """Whether an agent sees another one, which is an enemy."""
    at = game * games.agents
    if not games.alive[at + other] or games.team[other] == games.team[agent]:
        return False
    return shows(looks, agent, games.team[other], games.node[at + agent], games.node[at + other])


def shows(looks: Looks, agent: int, team: int, here: int, there: int) -> bool:
    """Whether a sensor of an agent on a node shows an agent of a team on another node."""
    dx = looks.places[2 * there] - looks.places[2 * here]
    dy = looks.places[2 * there + 1] - looks.places[2 * here + 1]
    square = dx * dx + dy * dy
    for sensor in range(looks.begins[agent], looks.begins[agent + 1]):
        if looks.shows[sensor * looks.teams + team] and square <= looks.squares[sensor]:
            return True
    return False


def _nearest_enemy(p: Strategies, game: int, agent: int, node: int) -> int:
    """Return the node of the enemy in sight that is nearest by road, of several the first; -1: there is none."""
    found = -1
    least = INFINITE
    at = game * p.games.agents
    for other in range(p.games.agents):
        if _sees(p.looks, p.games, game, agent, other):
            far = p.ways.distance(node, p.games.node[at + other])
            if far < least:
                least = far
                found = p.games.node[at + other]
    return found


def _farthest(p: Strategies, game: int, agent: int) -> int:
    """Return the legal node that is farthest from the nearest enemy in sight; NOTHING: no enemy is in sight."""
    at = game * p.games.agents
    is_seen = False
    for number in range(p.count):
        p.safety[number] = INFINITE
        p.legal_ids[number] = p.ways.ids[p.legal[number]]
    for other in range(p.games.agents):
        if _sees(p.looks, p.games, game, agent, other):
            is_seen = True
            for number in range(p.count):
                far = p.ways.distance(p.games.node[at + other], p.legal[number])
                p.safety[number] = min(p.safety[number], far)
    return p.legal[farthest(p.safety, p.legal_ids, p.count)] if is_seen else NOTHING
