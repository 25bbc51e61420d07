"""Moves of one game along edges: agents decide, give way to each other, and go."""

from __future__ import annotations

from gamms.core import draws, strategies
from gamms.core.conflicts import Contests, Requests, resolve
from gamms.core.rules import Games, Steps

STAYS = 0  # how an agent decides: it stays where it is,
WALKS = 1  # goes to one of its legal nodes, each as likely,
IS_GIVEN = 2  # has an action from outside: the number of a legal node,
STEPS = 4  # or decides by the steps of its strategy, see `strategies`
# names for callers in Python, which do not see constants with a C type
STAY = STAYS
RANDOM_WALK = WALKS
GIVEN = IS_GIVEN
BY_STEPS = STEPS


class Streets:
    """Where agents may go in a turn: along one edge, or anywhere.

    There may be several maps with the same nodes, which differ in the roads that are open: the nodes of one come after
    those of another, and have places.

    Attributes:
        nodes: how many there are.
        are_all_legal: whether agents may go to any node: of these a node has its own first, then the others.
        offsets: (nodes + 1,) the legal nodes of the node at place `i` are `targets[offsets[i]:offsets[i + 1]]`.
        targets: of each node its own row first, then those of its neighbors in the order of `state["legal"]`.
    """

    def __init__(self, offsets: memoryview[int], targets: memoryview[int], *, are_all_legal: bool = False) -> None:
        self.offsets = offsets
        self.targets = targets
        self.nodes = len(offsets) - 1
        self.are_all_legal = are_all_legal


class Routes:
    """The ways along which functions let agents go, node by node, where these do not go along one edge.

    Attributes:
        room: how many nodes a row has room for.
        nodes: (rows * room,)
        counts: (rows,) how many nodes there are; -1: the agent stays where it is.
        motions: (rows,) of an agent on an edge: `travel.BACK`, or `travel.FORWARD`.
    """

    def __init__(self, room: int, nodes: memoryview[int], counts: memoryview[int], motions: memoryview[int]) -> None:
        self.room = room
        self.nodes = nodes
        self.counts = counts
        self.motions = motions

    def take(self, row: int, route: memoryview[int]) -> int:
        """Copy the way of an agent; return how many nodes there are, or -1."""
        for number in range(self.counts[row]):
            route[number] = self.nodes[row * self.room + number]
        return self.counts[row]


class Movers:
    """The agents of games as they decide and move; rows are those of `rules.Games`.

    Attributes:
        streets: where they may go.
        decides_by: (agents,) `STAYS`, `WALKS`, `IS_GIVEN` or `STEPS`.
        walks: draws the nodes of those that walk: into `ends`, numbers below `counts`.
        some_walk: whether there are such.
        given: (rows,) the actions of those that are given one; -1: they go as `routes` says.
        routes: see there; None: all agents go along one edge.
        by_steps: decides for those of `STEPS`, if there are such.
        contests, requests: find who gives way, if `has_conflicts`; the requests have `node` of the games, `ends` and
            `takes_part`.
        part_of: (agents,) the part of the turn in which each decides and moves, in the order of play.
        parts: how many parts a turn has.
        part: (games,) how many of them were played in the turn that is under way.
        ends: (rows,) where agents go in the turn that is played.
        takes_part: (rows,) 1: the agent was alive when this turn began.
        counts: (rows,) how many nodes were legal then.
        moves, blocks: (rows,) how often agents have gone to another node, and how often conflicts have stopped them.
        blocked: (rows,) 1: conflicts stopped the agent when it decided last.
        wanted: (rows,) where it wanted to go then, as conflicts compare places.
    """

    def __init__(
        self,
        streets: Streets,
        decides_by: memoryview[int],
        walks: draws.Choices,
        some_walk: bool,
        given: memoryview[int],
        contests: Contests | None,
        requests: Requests | None,
        *,
        ends: memoryview[int],
        takes_part: memoryview[int],
        counts: memoryview[int],
        moves: memoryview[int],
        blocks: memoryview[int],
        blocked: memoryview[int],
        wanted: memoryview[int],
        part_of: memoryview[int],
        part: memoryview[int],
        parts: int,
        by_steps: strategies.Strategies | None = None,
        routes: Routes | None = None,
    ) -> None:
        self.streets = streets
        self.decides_by = decides_by
        self.walks = walks
        self.some_walk = some_walk
        self.given = given
        self.routes = routes
        self.by_steps = by_steps
        self.contests = contests
        self.requests = requests
        self.has_conflicts = contests is not None
        self.ends = ends
        self.takes_part = takes_part
        self.counts = counts
        self.moves = moves
        self.blocks = blocks
        self.blocked = blocked
        self.wanted = wanted
        self.part_of = part_of
        self.part = part
        self.parts = parts

    def take(self, streets: Streets) -> None:
        """Let the agents move on these streets from now on."""
        self.streets = streets


def count_legal(s: Streets, place: int) -> int:
    """Return how many nodes are legal from the node at a place."""
    return s.nodes if s.are_all_legal else s.offsets[place + 1] - s.offsets[place]


def legal_node(s: Streets, first: int, node: int, number: int) -> int:
    """Return the legal node of a number; `first` is the place of the first node of the map."""
    if not s.are_all_legal:
        return s.targets[s.offsets[first + node] + number]
    if number == 0:
        return node
    return number - 1 if number <= node else number


def decide(games: Games, m: Movers, game: int) -> int:
    """Let the living agents of this part of a turn choose the legal nodes that they go to; the others stay."""
    at = game * games.agents
    first = games.first_node[game]
    part = m.part[game]
    for row in range(at, at + games.agents):
        node = games.node[row]
        if part == 0:
            games.start[row] = node
            m.takes_part[row] = games.alive[row]
        m.counts[row] = count_legal(m.streets, first + node)
    if m.some_walk:  # `ends` are numbers of legal nodes for a while
        draws.choose(m.walks, at, games.agents, games.turn[game])
    for i in range(games.agents):
        row = at + i
        action = 0
        if m.takes_part[row] and m.part_of[i] == part:
            m.blocked[row] = 0
            if m.decides_by[i] == WALKS:
                action = m.ends[row]
            elif m.decides_by[i] == IS_GIVEN:
                action = m.given[row]
            elif m.decides_by[i] == STEPS:
                m.ends[row] = node_by_steps(games, m, game, i)
                continue
        m.ends[row] = legal_node(m.streets, first, games.node[row], action)
    return 0


def node_by_steps(games: Games, m: Movers, game: int, i: int) -> int:
    """Return the legal node to which an agent goes by the steps of its strategy."""
    row = game * games.agents + i
    first = games.first_node[game]
    m.by_steps.count = m.counts[row]  # type: ignore[union-attr] # there are some
    for number in range(m.counts[row]):
        m.by_steps.legal[number] = legal_node(m.streets, first, games.node[row], number)  # type: ignore[union-attr]
    m.by_steps.drawn = 0  # type: ignore[union-attr]
    node = strategies.act(m.by_steps, game, i)  # type: ignore[arg-type]
    return node if node >= 0 else games.node[row]


def give_way(games: Games, m: Movers, game: int) -> int:
    """Let agents stay that lose conflicts, and count them."""
    if not m.has_conflicts or resolve(m.contests, m.requests, game, games.turn[game]) == 0:  # type: ignore[arg-type]
        return 0
    at = game * games.agents
    for i in range(games.agents):
        row = at + i
        if m.contests.stays[i] and m.ends[row] != games.node[row]:  # type: ignore[union-attr] # there are conflicts
            m.wanted[row] = m.ends[row]
            m.ends[row] = games.node[row]
            m.blocked[row] = 1
            m.blocks[row] += 1
    return 0


def move(games: Games, m: Movers, game: int) -> int:
    """Let agents go, and count their moves; one turn more was played then if this was its last part."""
    at = game * games.agents
    for row in range(at, at + games.agents):
        games.placed[row] = 0
        if m.ends[row] != games.node[row]:
            games.node[row] = m.ends[row]
            m.moves[row] += 1
    end_part(games, m, game)
    return 0


def end_part(games: Games, m: Movers, game: int) -> int:
    """Note that one part more of a turn was played, and one turn more if it was the last."""
    m.part[game] += 1
    if m.part[game] == m.parts:
        m.part[game] = 0
        games.turn[game] += 1
    return 0


class StepsInParts(Steps):
    """How the agents of one game have gone in a turn along one edge or none, each in its part of the turn.

    Args:
        movers: the agents.
        nodes, times: see `Steps`, with three nodes of each agent: one that waits for its part is twice on the first.
        lengths: see `Steps`.
    """

    def __init__(
        self, movers: Movers, nodes: memoryview[int], times: memoryview[float], lengths: memoryview[int]
    ) -> None:
        super().__init__(nodes, times, lengths)
        self.are_one_edge = False
        self.movers = movers

    def fill(self, games: Games, game: int) -> int:
        """Write how the agents of a game came to where they are."""
        for agent in range(games.agents):
            row = game * games.agents + agent
            place = 3 * agent
            part = self.movers.part_of[agent]
            self.nodes[place] = games.node[row]
            self.times[place] = 1.0 if games.placed[row] else 0.0
            if not games.placed[row] and games.start[row] != games.node[row]:
                self.nodes[place] = games.start[row]
                if part > 0:
                    place += 1
                    self.nodes[place] = games.start[row]
                    self.times[place] = part / self.movers.parts
                place += 1
                self.nodes[place] = games.node[row]
                self.times[place] = (part + 1) / self.movers.parts
            self.lengths[agent] = place - 3 * agent + 1
        return 0
