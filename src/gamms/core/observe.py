"""What agents of one game observe as numbers, written into the arrays of the caller: vectors of one length.

A vector has the own place, `actions` times whether an action is legal and how far away the node is to which it leads,
and of the nearest `others` in sight whether there is one, whether it is a mate, and how far away it is. Lengths are
shares of the map.
"""

from __future__ import annotations

from gamms.core import strategies

try:
    import cython  # type: ignore[import-untyped]
except ImportError:  # Cython is not needed to run the text
    from contextlib import nullcontext
    from types import SimpleNamespace

    cython = SimpleNamespace(nogil=nullcontext())

OWN = 2  # entries of the own place,
OF_ACTION = 3  # of an action,
OF_OTHER = 4  # and of another agent


class Seen:
    """The agents that are seen, found by the sensors of all agents or, without `looks`, given as pairs.

    Attributes:
        looks: the sensors of all agents of a game.
        first: (rows + 1,) the pairs of a row are `first[row]` to `first[row + 1] - 1`.
        nodes: (pairs,) where an agent is seen.
        mates: (pairs,) 1: it is a mate.
        viewers: (agents that observe,) their numbers among all agents.
        agents: how many these are.
        node, alive: (games * agents,) of all.
        team: (agents,) the number of the team of each.
        are_mates: (teams,) 1: agents of this team are mates.
    """

    def __init__(
        self,
        looks: strategies.Looks | None,
        first: memoryview[int],
        nodes: memoryview[int],
        mates: memoryview[int],
        *,
        viewers: memoryview[int],
        node: memoryview[int],
        alive: memoryview[int],
        team: memoryview[int],
        are_mates: memoryview[int],
    ) -> None:
        self.looks = looks
        self.has_looks = looks is not None
        self.viewers = viewers
        self.node = node
        self.alive = alive
        self.team = team
        self.agents = len(team)
        self.are_mates = are_mates
        self.first = first
        self.nodes = nodes
        self.mates = mates


class Observers:
    """The agents that observe; rows are games times these agents.

    Attributes:
        agents: how many there are in a game.
        node: (rows,) where they are, or were last.
        is_asked: (rows,) 1: the agent is alive; else all of its numbers are 0.
        choice: (rows,) the legal nodes of a row are `targets[offsets[choice]:offsets[choice + 1]]`, its own first.
        turn: (games,) how many turns were played.
        own: (2 * rows,) x and y of where they are, if they may be elsewhere than on nodes; else (0,).
        seen: whom they see.
    """

    def __init__(
        self,
        agents: int,
        node: memoryview[int],
        is_asked: memoryview[int],
        choice: memoryview[int],
        offsets: memoryview[int],
        targets: memoryview[int],
        *,
        turn: memoryview[int],
        own: memoryview[float],
        seen: Seen,
    ) -> None:
        self.agents = agents
        self.node = node
        self.is_asked = is_asked
        self.choice = choice
        self.offsets = offsets
        self.targets = targets
        self.turn = turn
        self.own = own
        self.are_on_nodes = len(own) == 0
        self.seen = seen


class Vectors:
    """The vectors that are written.

    Attributes:
        places: (2 * nodes,) x and y of each node.
        actions: how many actions a vector has.
        others: how many other agents it has.
        entries: how many numbers it has; behind those of the others 0, but the last one the share n / (n + 100) after
            n turns.
        values: (rows * entries,)
        legal: (rows * actions,) 1: the action is legal; of agents that are dead, only to stay.
    """

    def __init__(
        self,
        places: memoryview[float],
        actions: int,
        others: int,
        entries: int,
        values: memoryview[float],
        legal: memoryview[int],
    ) -> None:
        self.places = places
        self.actions = actions
        self.others = others
        self.entries = entries
        self.values = values
        self.legal = legal


class Nearest:
    """The nearest agents that one sees, the nearest first; of several as far away, the first by name.

    Attributes:
        count: how many there are.
        far: (others,) the squares of how far away they are.
        nodes: (others,) where they are.
        mates: (others,) 1: it is a mate.
    """

    def __init__(self, far: memoryview[float], nodes: memoryview[int], mates: memoryview[int]) -> None:
        self.count = 0
        self.far = far
        self.nodes = nodes
        self.mates = mates


def observe(o: Observers, v: Vectors, near: Nearest, game: int) -> int:
    """Write the vectors of the agents of one game."""
    for i in range(o.agents):
        row = game * o.agents + i
        at = row * v.entries
        for entry in range(at, at + v.entries):
            v.values[entry] = 0.0
        place = row * v.actions
        for action in range(place, place + v.actions):
            v.legal[action] = 0
        if o.is_asked[row]:
            _write(o, v, near, game, i)
        elif v.actions > 0:
            v.legal[place] = 1
    return 0


def _write(o: Observers, v: Vectors, near: Nearest, game: int, agent: int) -> int:
    """Write the vector of an agent that is alive, where all is 0."""
    row = game * o.agents + agent
    own_x = v.places[2 * o.node[row]] if o.are_on_nodes else o.own[2 * row]
    own_y = v.places[2 * o.node[row] + 1] if o.are_on_nodes else o.own[2 * row + 1]
    at = row * v.entries
    v.values[at] = own_x
    v.values[at + 1] = own_y
    at += OWN
    first = o.offsets[o.choice[row]]
    count = min(v.actions, o.offsets[o.choice[row] + 1] - first)
    for action in range(count):
        node = o.targets[first + action]
        entry = at + action * OF_ACTION
        v.legal[row * v.actions + action] = 1
        v.values[entry] = 1.0
        v.values[entry + 1] = v.places[2 * node] - own_x
        v.values[entry + 2] = v.places[2 * node + 1] - own_y
    at += v.actions * OF_ACTION
    near.count = 0
    if v.others > 0:
        _look(o, v, near, game, agent, own_x, own_y)
    for other in range(near.count):
        entry = at + other * OF_OTHER
        v.values[entry] = 1.0
        v.values[entry + 1] = near.mates[other]
        v.values[entry + 2] = v.places[2 * near.nodes[other]] - own_x
        v.values[entry + 3] = v.places[2 * near.nodes[other] + 1] - own_y
    at += v.others * OF_OTHER
    if at < (row + 1) * v.entries:
        v.values[(row + 1) * v.entries - 1] = o.turn[game] / (o.turn[game] + 100.0)
    return 0


def _look(o: Observers, v: Vectors, near: Nearest, game: int, agent: int, own_x: float, own_y: float) -> int:
    """Find the nearest agents that an agent sees."""
    row = game * o.agents + agent
    if not o.seen.has_looks:
        for pair in range(o.seen.first[row], o.seen.first[row + 1]):
            _take(v, near, o.seen.nodes[pair], o.seen.mates[pair], own_x, own_y)
        return 0
    at = game * o.seen.agents
    viewer = o.seen.viewers[agent]
    for other in range(o.seen.agents):
        node = o.seen.node[at + other]
        if other == viewer or not o.seen.alive[at + other]:
            continue
        if strategies.shows(o.seen.looks, viewer, o.seen.team[other], o.node[row], node):  # type: ignore[arg-type]
            is_mate = o.seen.team[other] == o.seen.team[viewer] and o.seen.are_mates[o.seen.team[viewer]]
            _take(v, near, node, is_mate, own_x, own_y)
    return 0


def _take(v: Vectors, near: Nearest, node: int, is_mate: int, own_x: float, own_y: float) -> int:
    """Take an agent among the nearest, if it is one."""
    dx = v.places[2 * node] - own_x
    dy = v.places[2 * node + 1] - own_y
    far = dx * dx + dy * dy
    place = near.count
    if place == v.others:
        if far >= near.far[place - 1]:
            return 0
        place -= 1
    else:
        near.count += 1
    while place > 0 and far < near.far[place - 1]:
        near.far[place] = near.far[place - 1]
        near.nodes[place] = near.nodes[place - 1]
        near.mates[place] = near.mates[place - 1]
        place -= 1
    near.far[place] = far
    near.nodes[place] = node
    near.mates[place] = is_mate
    return 0


def observe_games(o: Observers, v: Vectors, near: Nearest, begin: int, end: int) -> int:
    """Write the vectors of the games from `begin` to `end - 1`."""
    for game in range(begin, end):
        observe(o, v, near, game)
    return 0


def observe_aside(o: Observers, v: Vectors, near: Nearest, begin: int, end: int) -> int:
    """Do what `observe_games` does, and let other threads of Python go on meanwhile."""
    with cython.nogil:
        observe_games(o, v, near, begin, end)
    return 0
