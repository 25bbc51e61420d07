"""What agents of one game observe as numbers, written into the arrays of the caller: vectors, or entries of nodes.

A vector has the own place, `actions` times whether an action is legal and how far away the node is to which it leads,
and of the nearest `others` in sight whether there is one, whether it is a mate, and how far away it is. Entries of
nodes say which action leads there, and how many agents are seen there. Lengths are shares of the map.
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
AROUND = 7  # entries of a node around an agent,
ON_MAP = 6  # and of a node of the whole map


class Seen:
    """The agents that are seen, found by the sensors of all agents or, without `looks`, given as pairs.

    Attributes:
        looks: the sensors of all agents of a game.
        first: (rows + 1,) the pairs of a row are `first[row]` to `first[row + 1] - 1`.
        nodes: (pairs,) where an agent is seen.
        mates: (pairs,) 1: it is a mate.
        viewers: (agents that observe,) their numbers among all agents.
        agents: how many these are.
        node, alive: (all games * agents,) of all agents.
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
    """The agents that observe in some games, each of which has a row in what is written.

    Attributes:
        agents: how many there are in a game.
        games: (places,) the numbers of the games, in whose columns `turn`, `seen.node` and `seen.alive` they are.
        rows: (places,) the row of the first of these agents in each game.
        is_asked: (rows,) 1: the agent is alive; else all of its numbers are 0.
        choice: (rows,) the legal nodes of a row are `targets[offsets[choice]:offsets[choice + 1]]`, its own first;
            (0,): a choice is the node of the agent.
        turn: (all games,) how many turns were played.
        seen: whom they see.
    """

    def __init__(
        self,
        agents: int,
        games: memoryview[int],
        rows: memoryview[int],
        is_asked: memoryview[int],
        choice: memoryview[int],
        offsets: memoryview[int],
        targets: memoryview[int],
        *,
        turn: memoryview[int],
        seen: Seen,
    ) -> None:
        self.agents = agents
        self.games = games
        self.rows = rows
        self.is_asked = is_asked
        self.choice = choice
        self.are_by_node = len(choice) == 0
        self.offsets = offsets
        self.targets = targets
        self.turn = turn
        self.seen = seen


class Vectors:
    """The vectors that are written.

    Attributes:
        places: (2 * nodes,) x and y of each node.
        own: (2 * rows,) x and y of each agent, if they may be elsewhere than on nodes; else (0,).
        actions: how many actions a vector has.
        others: how many other agents it has.
        entries: how many numbers it has; behind those of the others 0, but the last one the share n / (n + 100) after
            n turns.
        values: (rows * entries,)
        legal: (rows * actions,) 1: the action is legal; of agents that are dead, only to stay.
        counts: (rows,) how many actions are legal.
    """

    def __init__(
        self,
        places: memoryview[float],
        own: memoryview[float],
        actions: int,
        others: int,
        entries: int,
        values: memoryview[float],
        legal: memoryview[int],
        counts: memoryview[int],
    ) -> None:
        self.places = places
        self.own = own
        self.are_on_nodes = len(own) == 0
        self.actions = actions
        self.others = others
        self.entries = entries
        self.values = values
        self.legal = legal
        self.counts = counts


class Found:
    """The agents that one sees, and the nearest of them first; of several as far away, the first by name.

    Attributes:
        count: how many there are.
        nodes: (all agents,) where they are.
        mates: (all agents,) 1: it is a mate.
        far: (others + 1,) the squares of how far away the nearest are.
        nearest: (others + 1,) which they are.
    """

    def __init__(
        self, nodes: memoryview[int], mates: memoryview[int], far: memoryview[float], nearest: memoryview[int]
    ) -> None:
        self.count = 0
        self.nodes = nodes
        self.mates = mates
        self.far = far
        self.nearest = nearest


class Nodes:
    """The entries of nodes that are written, of those around agents, or of the whole map.

    Attributes:
        most: how many nodes an agent has entries of.
        hops: how many edges away the last ones are; 0: the nodes are those of the whole map.
        near: (nodes * most,) the nodes around each node.
        far: (nodes * most,) how many edges away they are; -1: there is none.
        places: (2 * nodes,) x and y of each node.
        values: (rows * most * entries,)
    """

    def __init__(
        self,
        most: int,
        hops: int,
        near: memoryview[int],
        far: memoryview[int],
        places: memoryview[float],
        values: memoryview[float],
    ) -> None:
        self.most = most
        self.hops = hops
        self.near = near
        self.far = far
        self.places = places
        self.values = values


def mark_seen(
    looks: strategies.Looks,
    viewers: memoryview[int],
    team: memoryview[int],
    is_asked: memoryview[int],
    alive: memoryview[int],
    marks: memoryview[int],
) -> int:
    """Mark the agents that agents see in some games.

    Args:
        looks: the sensors of all agents of a game, whose places are those of all agents of these games.
        viewers: (agents that look,) their numbers among all agents.
        team: (agents,) the number of the team of each.
        is_asked: (games * agents that look,) 1: it looks.
        alive: (games * agents,)
        marks: (games * agents that look * agents,) 1 from now on: it sees the other.
    """
    agents = len(team)
    for row in range(len(is_asked)):
        if is_asked[row]:
            viewer = viewers[row % len(viewers)]
            first = row // len(viewers) * agents
            for other in range(agents):
                if other == viewer or not alive[first + other]:
                    continue
                if strategies.shows(looks, viewer, team[other], first + viewer, first + other):
                    marks[row * agents + other] = 1
    return 0


def node_of(o: Observers, place: int, agent: int) -> int:
    """Return the node of an agent that observes, in the game at a place."""
    return o.seen.node[o.games[place] * o.seen.agents + o.seen.viewers[agent]]


def observe(o: Observers, v: Vectors, found: Found, game: int) -> int:
    """Write the vectors of the agents of the game at a place."""
    for i in range(o.agents):
        row = o.rows[game] + i
        count = 1
        if o.is_asked[row]:
            count = _write(o, v, found, game, i)
        else:
            for entry in range(row * v.entries, (row + 1) * v.entries):
                v.values[entry] = 0.0
        v.counts[row] = count
        for action in range(v.actions):
            v.legal[row * v.actions + action] = action < count
    return 0


def _write(o: Observers, v: Vectors, found: Found, game: int, agent: int) -> int:
    """Write the vector of an agent that is alive; return how many actions are legal."""
    row = o.rows[game] + agent
    here = node_of(o, game, agent)
    own_x = v.places[2 * here] if v.are_on_nodes else v.own[2 * row]
    own_y = v.places[2 * here + 1] if v.are_on_nodes else v.own[2 * row + 1]
    at = row * v.entries
    last = at + v.entries
    v.values[at] = own_x
    v.values[at + 1] = own_y
    at += OWN
    choice = here if o.are_by_node else o.choice[row]
    first = o.offsets[choice]
    num_legal = o.offsets[choice + 1] - first
    count = min(v.actions, num_legal)
    for action in range(count):
        node = o.targets[first + action]
        v.values[at] = 1.0
        v.values[at + 1] = v.places[2 * node] - own_x
        v.values[at + 2] = v.places[2 * node + 1] - own_y
        at += OF_ACTION
    for entry in range(at, at + (v.actions - count) * OF_ACTION):
        v.values[entry] = 0.0
    at += (v.actions - count) * OF_ACTION
    count = 0
    if v.others > 0:
        look(o, found, game, agent)
        count = _choose_nearest(v, found, own_x, own_y)
    for place in range(count):
        other = found.nearest[place]
        node = found.nodes[other]
        v.values[at] = 1.0
        v.values[at + 1] = found.mates[other]
        v.values[at + 2] = v.places[2 * node] - own_x
        v.values[at + 3] = v.places[2 * node + 1] - own_y
        at += OF_OTHER
    is_timed = last > row * v.entries + OWN + v.actions * OF_ACTION + v.others * OF_OTHER
    for entry in range(at, last):
        v.values[entry] = 0.0
    if is_timed:
        v.values[last - 1] = o.turn[o.games[game]] / (o.turn[o.games[game]] + 100.0)
    return num_legal


def look(o: Observers, found: Found, game: int, agent: int) -> int:
    """Find the agents that an agent sees, in the game at a place."""
    row = o.rows[game] + agent
    found.count = 0
    if not o.seen.has_looks:
        for pair in range(o.seen.first[row], o.seen.first[row + 1]):
            found.nodes[found.count] = o.seen.nodes[pair]
            found.mates[found.count] = o.seen.mates[pair]
            found.count += 1
        return 0
    at = o.games[game] * o.seen.agents
    viewer = o.seen.viewers[agent]
    here = o.seen.node[at + viewer]
    own = o.seen.team[viewer]
    for other in range(o.seen.agents):
        if other == viewer or not o.seen.alive[at + other]:
            continue
        node = o.seen.node[at + other]
        if strategies.shows(o.seen.looks, viewer, o.seen.team[other], here, node):  # type: ignore[arg-type]
            found.nodes[found.count] = node
            found.mates[found.count] = o.seen.team[other] == own and o.seen.are_mates[own]
            found.count += 1
    return 0


def _choose_nearest(v: Vectors, found: Found, own_x: float, own_y: float) -> int:
    """Choose the nearest of the agents that are seen; return how many these are."""
    count = 0
    for other in range(found.count):
        dx = v.places[2 * found.nodes[other]] - own_x
        dy = v.places[2 * found.nodes[other] + 1] - own_y
        far = dx * dx + dy * dy
        place = count
        while place > 0 and far < found.far[place - 1]:
            found.far[place] = found.far[place - 1]
            found.nearest[place] = found.nearest[place - 1]
            place -= 1
        found.far[place] = far
        found.nearest[place] = other
        count = min(count + 1, v.others)
    return count


def observe_nodes(o: Observers, n: Nodes, found: Found, game: int) -> int:
    """Write the entries of nodes for the agents of the game at a place."""
    size = n.most * (AROUND if n.hops > 0 else ON_MAP)
    for i in range(o.agents):
        row = o.rows[game] + i
        node = node_of(o, game, i)
        if not o.is_asked[row]:
            for entry in range(row * size, (row + 1) * size):
                n.values[entry] = 0.0
        elif n.hops > 0:
            _write_around(o, n, row, node)
            look(o, found, game, i)
            _count_around(n, found, row, node)
        else:
            _write_map(o, n, row, node)
            look(o, found, game, i)
            for other in range(found.count):
                at = (row * n.most + found.nodes[other] + 1) * ON_MAP
                n.values[at - 2 + (not found.mates[other])] += 1.0
    return 0


def _write_around(o: Observers, n: Nodes, row: int, node: int) -> int:
    """Write the entries of the nodes around an agent, on which nobody is seen."""
    choice = node if o.are_by_node else o.choice[row]
    first = o.offsets[choice]
    for k in range(n.most):
        at = (row * n.most + k) * AROUND
        place = node * n.most + k
        near = n.near[place]
        for entry in range(at, at + AROUND):
            n.values[entry] = 0.0
        n.values[at + 4] = -1.0
        if n.far[place] < 0:
            continue
        n.values[at] = 1.0
        n.values[at + 1] = n.places[2 * near] - n.places[2 * node]
        n.values[at + 2] = n.places[2 * near + 1] - n.places[2 * node + 1]
        n.values[at + 3] = n.far[place] / (n.hops * 1.0)
        for action in range(o.offsets[choice + 1] - first):
            if o.targets[first + action] == near:
                n.values[at + 4] = action
                break
    return 0


def _count_around(n: Nodes, found: Found, row: int, node: int) -> int:
    """Count the agents that are seen on the nodes around an agent."""
    for other in range(found.count):
        for k in range(n.most):
            place = node * n.most + k
            if n.far[place] >= 0 and n.near[place] == found.nodes[other]:
                n.values[(row * n.most + k) * AROUND + 5 + (not found.mates[other])] += 1.0
    return 0


def _write_map(o: Observers, n: Nodes, row: int, node: int) -> int:
    """Write the entries of all nodes, on which nobody is seen."""
    for other in range(n.most):
        at = (row * n.most + other) * ON_MAP
        n.values[at] = n.places[2 * other]
        n.values[at + 1] = n.places[2 * other + 1]
        n.values[at + 2] = 0.0
        n.values[at + 3] = -1.0
        n.values[at + 4] = 0.0
        n.values[at + 5] = 0.0
    n.values[(row * n.most + node) * ON_MAP + 2] = 1.0
    choice = node if o.are_by_node else o.choice[row]
    first = o.offsets[choice]
    for action in range(o.offsets[choice + 1] - first - 1, -1, -1):  # of several, the first one counts
        n.values[(row * n.most + o.targets[first + action]) * ON_MAP + 3] = action
    return 0


def observe_aside(o: Observers, v: Vectors, found: Found, places: memoryview[int], begin: int, end: int) -> int:
    """Write the vectors of the games at `places[begin:end]`, and let other threads of Python go on meanwhile."""
    with cython.nogil:
        for number in range(begin, end):
            observe(o, v, found, places[number])
    return 0


def observe_nodes_aside(o: Observers, n: Nodes, found: Found, begin: int, end: int) -> int:
    """Write the entries of nodes of the games at the places from `begin` to `end - 1`, likewise."""
    with cython.nogil:
        for game in range(begin, end):
            observe_nodes(o, n, found, game)
    return 0
