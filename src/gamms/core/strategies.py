"""Strategies of one game along edges: agents that go to nodes, after enemies in sight, or away from them.

A strategy is a list of steps, tried in turn until one gives an action: `chase(otherwise=patrol(nodes))` is two.
`act` returns the action of an agent, the number of a legal node. It writes what the agent remembers beside the memory,
and `remember` takes that over once all agents of the game have decided: where a way is not known yet, nothing has
happened, and the game waits until the caller has found it.
"""

from __future__ import annotations

from gamms.core import draws
from gamms.core.rules import Games

STAYS = 0  # a step: it stays,
WALKS = 1  # goes to one of the legal nodes, each as likely,
GOES = 2  # to a node,
FOLLOWS = 3  # from one node of a list to the next,
WANDERS = 4  # to a node that is drawn, and to another one when it was there for some turns,
CHASES = 5  # to the nearest enemy in sight,
FLEES = 6  # or to the legal node that is farthest from enemies in sight
KINDS = ("stay", "walk", "go", "follow", "wander", "chase", "flee")  # of steps by their numbers
NOTHING = -1  # no action: the next step is tried
UNKNOWN = -3  # of an action: the caller has to find it
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
    """Known distances and first steps to targets, and the pairs that were asked for and are not known yet.

    Attributes:
        nodes: how many there are.
        tables: (nodes,) the number of the table of a target; -1: there is none yet.
        far: (tables * nodes,) how far it is from a node to the target; infinite where no path leads there.
        actions: (tables * nodes,) the number of the legal node by which an agent goes there; -1: no path; UNKNOWN.
        wanted: (room,) pairs that were asked for: the target times `nodes` plus the node.
        count: how many pairs there are.
        is_missing: whether an agent of the game that decides has asked for such a pair.
    """

    def __init__(self, nodes: int, wanted: memoryview[int]) -> None:
        self.nodes = nodes
        self.wanted = wanted
        self.count = 0
        self.is_missing = False

    def take(self, tables: memoryview[int], far: memoryview[float], actions: memoryview[int]) -> None:
        """Take tables in which all is known that was asked for."""
        self.tables = tables
        self.far = far
        self.actions = actions
        self.count = 0


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
        numbers: (steps,) of `FOLLOWS` 1: the agent begins with the nearest; of `WANDERS` for how many turns it stays.
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
        slots: memoryview[int],
        nodes: memoryview[int],
        following: memoryview[int],
    ) -> None:
        self.begins = begins
        self.kinds = kinds
        self.first = first
        self.sizes = sizes
        self.numbers = numbers
        self.slots = slots
        self.nodes = nodes
        self.following = following


class Strategies:
    """The agents of games as they decide by steps; rows are those of `rules.Games`.

    Attributes:
        games: the games.
        steps: of their strategies.
        ways: the known ways on the map.
        looks: the sensors that agents carry.
        offsets, targets: the legal nodes of node `i` are `targets[offsets[i]:offsets[i + 1]]`, its own first.
        ids: (nodes,) of nodes by their rows.
        keys: (rows,) the `draws.first_key` of each agent.
        safety, legal: (most legal nodes,) scratch: how far the nearest enemy is from legal nodes, and their ids.
        memory: (columns * rows,) what agents remember.
        noted: (columns * agents,) what those of one game remember from now on.
        has_noted: (columns * agents,) 1: it is another number.
        drawn: how often the agent that decides has drawn in this turn.
    """

    def __init__(
        self,
        games: Games,
        steps: Steps,
        ways: WayTables,
        looks: Looks,
        offsets: memoryview[int],
        targets: memoryview[int],
        ids: memoryview[int],
        keys: memoryview[int],
        safety: memoryview[float],
        legal: memoryview[int],
        *,
        memory: memoryview[int],
        noted: memoryview[int],
        has_noted: memoryview[int],
    ) -> None:
        self.games = games
        self.steps = steps
        self.ways = ways
        self.looks = looks
        self.offsets = offsets
        self.targets = targets
        self.ids = ids
        self.keys = keys
        self.safety = safety
        self.legal = legal
        self.memory = memory
        self.noted = noted
        self.has_noted = has_noted
        self.drawn = 0


def act(p: Strategies, game: int, agent: int) -> int:
    """Return the action of an agent of a game; any where a way is missing, as `ways` says then."""
    node = p.games.node[game * p.games.agents + agent]
    p.drawn = 0
    for step in range(p.steps.begins[agent], p.steps.begins[agent + 1]):
        kind = p.steps.kinds[step]
        action = 0
        if kind == WALKS:
            action = _drawn(p, game, agent, p.offsets[node + 1] - p.offsets[node])
        elif kind == GOES:
            action = _towards(p.ways, node, p.steps.nodes[p.steps.first[step]])
        elif kind == FOLLOWS:
            action = _towards(p.ways, node, _stop(p, game, agent, step, node))
        elif kind == WANDERS:
            action = _towards(p.ways, node, _waypoint(p, game, agent, step, node))
        elif kind == CHASES:
            action = _towards(p.ways, node, _nearest_enemy(p, game, agent, node))
        elif kind == FLEES:
            action = _farthest(p, game, agent, node)
        if action != NOTHING:
            return action
    return 0


def remember(p: Strategies, game: int) -> int:
    """Keep what the agents of a game remember; return 1, and keep nothing, where a way was missing."""
    rows = len(p.games.node)
    agents = p.games.agents
    columns = len(p.noted) // agents
    is_missing = p.ways.is_missing
    p.ways.is_missing = False
    for column in range(columns):
        for agent in range(agents):
            place = column * agents + agent
            if p.has_noted[place] and not is_missing:
                p.memory[column * rows + game * agents + agent] = p.noted[place]
            p.has_noted[place] = 0
    return is_missing


def _place(ways: WayTables, node: int, target: int) -> int:
    """Return where tables have the way from a node to a target; -1, and note that it is wanted, where it is unknown."""
    table = ways.tables[target]
    place = table * ways.nodes + node
    if table >= 0 and ways.actions[place] != UNKNOWN:
        return place
    ways.is_missing = True
    if ways.count < len(ways.wanted):
        ways.wanted[ways.count] = target * ways.nodes + node
        ways.count += 1
    return -1


def _distance(ways: WayTables, node: int, target: int) -> float:
    place = _place(ways, node, target)
    return 0.0 if place < 0 else ways.far[place]


def _towards(ways: WayTables, node: int, target: int) -> int:
    """Return the action that leads to a target; NOTHING: there is none, or no path."""
    if target < 0:
        return NOTHING
    place = _place(ways, node, target)
    return 0 if place < 0 else ways.actions[place]


def _drawn(p: Strategies, game: int, agent: int, bound: int) -> int:
    """Draw a number below a bound."""
    p.drawn += 1
    return draws.below_at(p.keys[game * p.games.agents + agent], p.games.turn[game], p.drawn - 1, bound)


def _known(p: Strategies, game: int, agent: int, column: int) -> int:
    """Return what an agent remembers."""
    place = column * p.games.agents + agent
    if p.has_noted[place]:
        return p.noted[place]
    return p.memory[column * len(p.games.node) + game * p.games.agents + agent]


def _note(p: Strategies, agent: int, column: int, number: int) -> int:
    place = column * p.games.agents + agent
    p.noted[place] = number
    p.has_noted[place] = 1
    return 0


def _stop(p: Strategies, game: int, agent: int, step: int, node: int) -> int:
    """Return the node on its list to which an agent goes; -1: it was at the last one."""
    first = p.steps.first[step]
    at = _known(p, game, agent, p.steps.slots[step])
    if at < 0:
        at = 0
        if p.steps.numbers[step]:
            least = _distance(p.ways, node, p.steps.nodes[first])
            for number in range(1, p.steps.sizes[step]):
                far = _distance(p.ways, node, p.steps.nodes[first + number])
                if far < least:
                    least = far
                    at = number
    at = next_stop(p.steps.nodes, p.steps.following, first, p.steps.sizes[step], at, node)
    _note(p, agent, p.steps.slots[step], at)
    return p.steps.nodes[first + at] if at < p.steps.sizes[step] else -1


def _waypoint(p: Strategies, game: int, agent: int, step: int, node: int) -> int:
    """Return the node that was drawn, or draw another one."""
    slot = p.steps.slots[step]
    target = _known(p, game, agent, slot)
    far = 0.0 if target == node else INFINITE
    if target >= 0 and target != node:
        far = _distance(p.ways, node, target)
    left = turns_left(target == node, _known(p, game, agent, slot + 1), far)
    if left < 0:
        target = p.steps.nodes[p.steps.first[step] + _drawn(p, game, agent, p.steps.sizes[step])]
        left = p.steps.numbers[step]
    _note(p, agent, slot, target)
    _note(p, agent, slot + 1, left)
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
            far = _distance(p.ways, node, p.games.node[at + other])
            if far < least:
                least = far
                found = p.games.node[at + other]
    return found


def _farthest(p: Strategies, game: int, agent: int, node: int) -> int:
    """Return the action by which the nearest enemy in sight is farthest; NOTHING: no enemy is in sight."""
    at = game * p.games.agents
    count = p.offsets[node + 1] - p.offsets[node]
    is_seen = False
    for action in range(count):
        p.safety[action] = INFINITE
        p.legal[action] = p.ids[p.targets[p.offsets[node] + action]]
    for other in range(p.games.agents):
        if _sees(p.looks, p.games, game, agent, other):
            is_seen = True
            for action in range(count):
                far = _distance(p.ways, p.games.node[at + other], p.targets[p.offsets[node] + action])
                p.safety[action] = min(p.safety[action], far)
    return farthest(p.safety, p.legal, count) if is_seen else NOTHING
