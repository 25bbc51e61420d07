"""What learners choose, see and get, as numbers in the caller's arrays.

Observations are vectors, or features of nodes.

A vector has the agent's position; for each of `actions` actions, whether it is legal, and the offset to its node; and
for each of the nearest `others` visible agents, a 1, whether it is a teammate, its offset, and its distance by road.
Features of a node include the action that leads there, and the numbers of visible agents on it. Lengths are shares of
the map size.
"""

from __future__ import annotations

from array import array

from gamms.core import routes, sight, strategies
from gamms.core.block import INT64

try:
    import cython  # type: ignore[import-untyped]
except ImportError:  # Cython is not needed to run the text
    from contextlib import nullcontext
    from types import SimpleNamespace

    cython = SimpleNamespace(nogil=nullcontext())

OWN = 2  # numbers for the agent's position,
OF_ACTION = 3  # for an action,
OF_OTHER = 5  # and for another agent
AROUND = 7  # features of a node around an agent,
ON_MAP = 6  # and of a node of the whole map


class VisibleAgents:
    """The agents that observers see: found by a search, or without one, given as pairs.

    Attributes:
        search: finds them by plain sensors.
        first: (rows + 1,) the pairs of a row are `first[row]` to `first[row + 1] - 1`.
        nodes: (pairs,) the node of the visible agent.
        mates: (pairs,) 1: it is a teammate.
        viewers: (observers,) their numbers among all agents.
        agents: the number of all agents.
        node, alive: (all games * agents,) the nodes of all agents, and 1 for living ones.
        team: (agents,) the team number of each agent.
        nobody: the team number of agents without a team; -1: all agents have a team.
    """

    def __init__(
        self,
        search: sight.AgentSearch | None,
        first: memoryview[int],
        nodes: memoryview[int],
        mates: memoryview[int],
        *,
        viewers: memoryview[int],
        node: memoryview[int],
        alive: memoryview[int],
        team: memoryview[int],
        nobody: int,
    ) -> None:
        self.search = search
        self.is_searched = search is not None
        self.viewers = viewers
        self.node = node
        self.alive = alive
        self.team = team
        self.agents = len(team)
        self.nobody = nobody
        self.first = first
        self.nodes = nodes
        self.mates = mates


class Observers:
    """The observers of some games; each has a row in the output.

    Attributes:
        agents: the number of observers of a game.
        games: (places,) the number of each game, for `turn`, `seen.node` and `seen.alive`.
        rows: (places,) the row of the first observer of each game.
        is_asked: (rows,) 1: the agent is alive; 0: all its numbers are 0.
        choice: (rows,) the legal nodes of a row are `targets[offsets[choice]:offsets[choice + 1]]`, its own node first;
            if the array is empty, the choice is the node of the agent.
        first_node: (all games,) the first node of the map of each game, among the nodes of several maps; `choice` and
            the positions of nodes are numbered by these.
        first_road: (all games,) the place of the first node of the roads of each game, see `routes.NearbyDistances`.
        mode_first: (agents,) the offset from `first_road` to the roads that each observer may use.
        turn: (all games,) the number of turns played.
        seen: the visible agents.
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
        first_node: memoryview[int],
        first_road: memoryview[int],
        mode_first: memoryview[int],
        turn: memoryview[int],
        seen: VisibleAgents,
    ) -> None:
        self.agents = agents
        self.games = games
        self.rows = rows
        self.is_asked = is_asked
        self.choice = choice
        self.are_by_node = len(choice) == 0
        self.offsets = offsets
        self.targets = targets
        self.first_node = first_node
        self.first_road = first_road
        self.mode_first = mode_first
        self.turn = turn
        self.seen = seen


class VectorObservations:
    """The output of vector observations.

    Attributes:
        places: (2 * nodes,) x and y of each node.
        own: (2 * rows,) x and y of each agent, if agents may be between nodes; else empty.
        actions: the number of actions in a vector.
        others: the number of other agents in a vector.
        entries: the length of a vector; entries after those of other agents are 0, except that the last one is n / (n +
            100) after n turns. 0: no vectors are written, only the legal actions.
        values: (rows * entries,) the vectors.
        legal: (rows * actions,) 1: the action is legal; dead agents can only stay.
        counts: (rows,) the number of legal actions.
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
        self.counts = counts
        self.take(values, legal)

    def take(self, values: memoryview[float], legal: memoryview[int]) -> None:
        """Write to these buffers from now on."""
        self.values = values
        self.legal = legal


def keep_rows(v: VectorObservations, to: VectorObservations, first: int, count: int) -> int:
    """Copy the vectors and the legal actions of some rows to another output."""
    for entry in range(first * v.entries, (first + count) * v.entries):
        to.values[entry] = v.values[entry]
    for action in range(first * v.actions, (first + count) * v.actions):
        to.legal[action] = v.legal[action]
    return 0


class NearestAgents:
    """The agents that one observer sees, and the nearest of them in order of distance; ties are in the order of names.

    Attributes:
        count: the number of visible agents.
        agents: (all agents,) their numbers, in any order.
        nodes: (all agents,) their nodes.
        mates: (all agents,) 1: it is a teammate.
        far: (others + 1,) the squared distances of the nearest agents.
        nearest: (others + 1,) their indices in `nodes`.
        ways: distances by road, shares of the map size, which all threads read; None: they are not asked for.
        searches: whether to search distances that `ways` lacks, which only one thread at a time may do;
        lacks: otherwise, whether some were lacking.
    """

    def __init__(
        self,
        agents: memoryview[int],
        nodes: memoryview[int],
        mates: memoryview[int],
        far: memoryview[float],
        nearest: memoryview[int],
        ways: routes.NearbyDistances | None,
    ) -> None:
        self.count = 0
        self.agents = agents
        self.nodes = nodes
        self.mates = mates
        self.far = far
        self.nearest = nearest
        self.ways = ways
        self.searches = True
        self.lacks = False


class NodeFeatures:
    """The output of node features, for the nodes around agents or for the whole map.

    Attributes:
        most: the number of nodes for each observer.
        hops: the maximum number of edges to a node; 0: the nodes of the whole map.
        near: (nodes * most,) the nodes around each node.
        far: (nodes * most,) their distances in edges; -1: unused.
        places: (2 * nodes,) x and y of each node.
        values: (rows * most * features,) the features.
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


class LearnerTurn:
    """The actions of learners before a turn, and their rewards and ends after it.

    Attributes:
        games, agents: the number of games, and of learners in each; rows are ordered by game.
        may_return: whether agents that are out may come back; then they wait, and end with their games.
        counts: (rows,) the number of legal actions of each learner.
        alive: (rows,) 1: the learner is alive.
        over: (games,) 1: the game has ended.
        late: (games,) 1: it has ended because of its time limit.
        earned: (rows,) the reward of the turn, also of learners that did not take part.
        moves: (rows,) the chosen actions; `begin_turn` replaces illegal ones by 0.
        was_over: (games,) `over` before the turn.
        plays: (rows,) 1: the learner takes part in the turn.
        rewards: (rows,) 0 for learners that did not take part.
        terminated, truncated: (rows,) 1: the learner ended in the turn, for a reason other than a time limit, or
            because of it.
        may_begin: (games,) how often the game may begin again in the calls that end it.
        begun: (games,) 1: it has begun again in the turn.
    """

    def __init__(
        self,
        games: int,
        agents: int,
        counts: memoryview[int],
        alive: memoryview[int],
        over: memoryview[int],
        late: memoryview[int],
        earned: memoryview[float],
        moves: memoryview[int],
        *,
        was_over: memoryview[int],
        plays: memoryview[int],
        rewards: memoryview[float],
        terminated: memoryview[int],
        truncated: memoryview[int],
        may_begin: memoryview[int],
        begun: memoryview[int],
        may_return: bool,
    ) -> None:
        self.games = games
        self.agents = agents
        self.counts = counts
        self.alive = alive
        self.over = over
        self.late = late
        self.earned = earned
        self.moves = moves
        self.was_over = was_over
        self.plays = plays
        self.rewards = rewards
        self.terminated = terminated
        self.truncated = truncated
        self.may_begin = may_begin
        self.begun = begun
        self.may_return = may_return


def begin_turns(t: LearnerTurn) -> int:
    """Begin a turn in all games; see `begin_turn`."""
    for game in range(t.games):
        begin_turn(t, game)
    return 0


def begin_turn(t: LearnerTurn, game: int) -> int:
    """Note which learners of a game take part in a turn, and replace illegal actions by 0."""
    t.was_over[game] = t.over[game]
    t.begun[game] = 0
    for row in range(game * t.agents, (game + 1) * t.agents):
        t.plays[row] = t.alive[row] and not t.over[game]
        if t.moves[row] < 0 or t.moves[row] >= t.counts[row]:
            t.moves[row] = 0
    return 0


def write_masks(t: LearnerTurn, legal: memoryview[int]) -> int:
    """Write which actions are legal, (rows * actions,); dead agents, and all in games that are over, can only stay."""
    for game in range(t.games):
        write_mask(t, legal, game)
    return 0


def write_mask(t: LearnerTurn, legal: memoryview[int], game: int) -> int:
    """Write the legal actions of the learners of a game; see `write_masks`."""
    actions = len(legal) // max(t.games * t.agents, 1)
    for row in range(game * t.agents, (game + 1) * t.agents):
        if t.over[game] or not t.alive[row]:
            t.counts[row] = 1
        for action in range(actions):
            legal[row * actions + action] = action < t.counts[row]
    return 0


def observe_turn(t: LearnerTurn, o: Observers, v: VectorObservations, found: NearestAgents, game: int) -> int:
    """Write which learners of a game are alive, their vectors, and their legal actions."""
    first = game * o.seen.agents
    for agent in range(t.agents):
        t.alive[game * t.agents + agent] = o.seen.alive[first + o.seen.viewers[agent]]
    observe(o, v, found, game)
    if t.over[game]:
        write_mask(t, v.legal, game)
    return 0


def observe_turns_aside(
    t: LearnerTurn,
    o: Observers,
    v: VectorObservations,
    found: NearestAgents,
    games: memoryview[int],
    begin: int,
    end: int,
) -> int:
    """Call `observe_turn` for `games[begin:end]` without the GIL; `o` and `v` have the rows of the learners."""
    with cython.nogil:
        for number in range(begin, end):
            observe_turn(t, o, v, found, games[number])
    return 0


def end_turns(t: LearnerTurn) -> int:
    """Write the rewards and ends of a turn in all games; return the number of learners that ended."""
    found = 0
    for game in range(t.games):
        found += end_turn(t, game)
    return found


def end_turn(t: LearnerTurn, game: int) -> int:
    """Write the rewards and ends of a turn in a game; return the number of learners that ended."""
    found = 0
    is_over = t.over[game]
    is_late = t.late[game]
    for row in range(game * t.agents, (game + 1) * t.agents):
        plays = t.plays[row]
        t.rewards[row] = t.earned[row] if plays else 0.0
        counts = plays or (t.may_return and not t.was_over[game])
        is_out = not (t.may_return or t.alive[row])
        t.terminated[row] = counts and (is_out or (is_over and not is_late))
        t.truncated[row] = counts and is_late and not is_out
        found += t.terminated[row] or t.truncated[row]
    return found


def list_seen(
    s: sight.AgentSearch,
    games: memoryview[int],
    own: memoryview[float],
    viewers: memoryview[int],
    is_asked: memoryview[int],
    pairs: memoryview[int],
) -> int:
    """Write pairs of observers and visible agents, by game, by observer, then by the number of the visible agent.

    Args:
        s: finds them.
        games: (places,) the number of each game.
        own: (2 * places * agents,) x and y of each agent, if agents may be between nodes; else empty.
        viewers: (observers,) their numbers among all agents.
        is_asked: (places * observers,) 1: the observer looks.
        pairs: (4 * room,) receives the place of each game, then the observers, the visible agents, and their nodes.

    Returns:
        The number of pairs, those without room included.
    """
    room = len(pairs) // 4
    seen = memoryview(array(INT64, bytes(8 * s.agents)))
    found = 0
    for place in range(len(games)):
        game = games[place]
        if len(own) > 0:
            s.load_positions(game, own, 2 * place * s.agents)
        else:
            s.load_node_positions(game, 0)
        for viewer in range(len(viewers)):
            if not is_asked[place * len(viewers) + viewer]:
                continue
            count = sight.see(s, game, viewers[viewer], seen)
            sight.sort_numbers(seen, count)
            for number in range(count):
                if found < room:
                    pairs[found] = place
                    pairs[room + found] = viewer
                    pairs[2 * room + found] = seen[number]
                    pairs[3 * room + found] = s.node[game * s.agents + seen[number]]
                found += 1
    return found


def get_node(o: Observers, place: int, agent: int) -> int:
    """Return the node of an observer, in the game at a place."""
    return o.seen.node[o.games[place] * o.seen.agents + o.seen.viewers[agent]]


def observe(o: Observers, v: VectorObservations, found: NearestAgents, game: int) -> int:
    """Write the vectors of all observers of the game at a place."""
    if v.others > 0:
        begin_looks(o, game)
    for i in range(o.agents):
        row = o.rows[game] + i
        count = 1
        if o.is_asked[row] and v.entries == 0:
            count = count_legal(o, game, i)
        elif o.is_asked[row]:
            count = _write(o, v, found, game, i)
        else:
            for entry in range(row * v.entries, (row + 1) * v.entries):
                v.values[entry] = 0.0
        v.counts[row] = count
        for action in range(v.actions):
            v.legal[row * v.actions + action] = action < count
    return 0


def count_legal(o: Observers, game: int, agent: int) -> int:
    """Return the number of legal actions of an observer of the game at a place."""
    choice = o.first_node[o.games[game]] + get_node(o, game, agent)
    if not o.are_by_node:
        choice = o.choice[o.rows[game] + agent]
    return o.offsets[choice + 1] - o.offsets[choice]


def _write(o: Observers, v: VectorObservations, found: NearestAgents, game: int, agent: int) -> int:
    """Write the vector of a living agent; return the number of legal actions."""
    row = o.rows[game] + agent
    base = o.first_node[o.games[game]]
    here = base + get_node(o, game, agent)
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
        node = base + o.targets[first + action]
        v.values[at] = 1.0
        v.values[at + 1] = v.places[2 * node] - own_x
        v.values[at + 2] = v.places[2 * node + 1] - own_y
        at += OF_ACTION
    for entry in range(at, at + (v.actions - count) * OF_ACTION):
        v.values[entry] = 0.0
    at += (v.actions - count) * OF_ACTION
    count = 0
    roads = o.first_road[o.games[game]] + o.mode_first[agent]
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
        v.values[at + 4] = find_road(found, found.ways, roads, here, node)  # type: ignore[arg-type]
        at += OF_OTHER
    is_timed = last > row * v.entries + OWN + v.actions * OF_ACTION + v.others * OF_OTHER
    for entry in range(at, last):
        v.values[entry] = 0.0
    if is_timed:
        v.values[last - 1] = o.turn[o.games[game]] / (o.turn[o.games[game]] + 100.0)
    return num_legal


def begin_looks(o: Observers, game: int) -> int:
    """Take the positions of the agents in the game at a place, before observers look."""
    if o.seen.is_searched:
        o.seen.search.load_node_positions(o.games[game], o.first_node[o.games[game]])  # type: ignore[union-attr]
    return 0


def look(o: Observers, found: NearestAgents, game: int, agent: int) -> int:
    """Find the agents that an observer sees, in the game at a place."""
    row = o.rows[game] + agent
    base = o.first_node[o.games[game]]
    found.count = 0
    if not o.seen.is_searched:
        for pair in range(o.seen.first[row], o.seen.first[row + 1]):
            found.agents[found.count] = found.count
            found.nodes[found.count] = base + o.seen.nodes[pair]
            found.mates[found.count] = o.seen.mates[pair]
            found.count += 1
        return 0
    at = o.games[game] * o.seen.agents
    viewer = o.seen.viewers[agent]
    found.count = sight.see(o.seen.search, o.games[game], viewer, found.agents)  # type: ignore[arg-type]
    for place in range(found.count):
        other = found.agents[place]
        found.nodes[place] = base + o.seen.node[at + other]
        found.mates[place] = strategies.are_mates(o.seen.team[viewer], o.seen.team[other], o.seen.nobody)
    return 0


def find_road(found: NearestAgents, ways: routes.NearbyDistances, base: int, node: int, target: int) -> float:
    """Return the distance by road from a node to a target; 0 if it is lacking and not to be searched."""
    far = ways.look_up(base + target, node)
    if far >= 0.0:
        return far
    if not found.searches:
        found.lacks = True
        return 0.0
    ways.search(base, target, node)
    return ways.look_up(base + target, node)


def is_nearer(found: NearestAgents, far: float, other: int, place: int) -> bool:
    """Return whether an agent at a squared distance comes before the one at a place of the nearest."""
    if far == found.far[place]:
        return found.agents[other] < found.agents[found.nearest[place]]
    return far < found.far[place]


def _choose_nearest(v: VectorObservations, found: NearestAgents, own_x: float, own_y: float) -> int:
    """Find the nearest visible agents, by insertion into a sorted list; return their number."""
    count = 0
    for other in range(found.count):
        dx = v.places[2 * found.nodes[other]] - own_x
        dy = v.places[2 * found.nodes[other] + 1] - own_y
        far = dx * dx + dy * dy
        place = count
        while place > 0 and is_nearer(found, far, other, place - 1):
            found.far[place] = found.far[place - 1]
            found.nearest[place] = found.nearest[place - 1]
            place -= 1
        found.far[place] = far
        found.nearest[place] = other
        count = min(count + 1, v.others)
    return count


def observe_nodes(o: Observers, n: NodeFeatures, found: NearestAgents, game: int) -> int:
    """Write the node features for all observers of the game at a place."""
    size = n.most * (AROUND if n.hops > 0 else ON_MAP)
    begin_looks(o, game)
    for i in range(o.agents):
        row = o.rows[game] + i
        node = get_node(o, game, i)
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


def _write_around(o: Observers, n: NodeFeatures, row: int, node: int) -> int:
    """Write the features of the nodes around an agent, with no visible agents."""
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


def _count_around(n: NodeFeatures, found: NearestAgents, row: int, node: int) -> int:
    """Add the numbers of visible agents on the nodes around an agent."""
    for other in range(found.count):
        for k in range(n.most):
            place = node * n.most + k
            if n.far[place] >= 0 and n.near[place] == found.nodes[other]:
                n.values[(row * n.most + k) * AROUND + 5 + (not found.mates[other])] += 1.0
    return 0


def _write_map(o: Observers, n: NodeFeatures, row: int, node: int) -> int:
    """Write the features of all nodes of the map, with no visible agents."""
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
    for action in range(
        o.offsets[choice + 1] - first - 1, -1, -1
    ):  # backward, so that the first action to a node counts
        n.values[(row * n.most + o.targets[first + action]) * ON_MAP + 3] = action
    return 0


def observe_aside(
    o: Observers, v: VectorObservations, found: NearestAgents, places: memoryview[int], begin: int, end: int
) -> int:
    """Write the vectors of the games at `places[begin:end]` without the GIL."""
    with cython.nogil:
        for number in range(begin, end):
            observe(o, v, found, places[number])
    return 0


def observe_nodes_aside(o: Observers, n: NodeFeatures, found: NearestAgents, begin: int, end: int) -> int:
    """Write the node features of the games at places `begin` to `end - 1` without the GIL."""
    with cython.nogil:
        for game in range(begin, end):
            observe_nodes(o, n, found, game)
    return 0
