"""Moves of one game along one edge per turn: agents decide, resolve conflicts, and move."""
# ruff: noqa: ARG002 - a kind of movement reads no arguments that only others need

from __future__ import annotations

from array import array
from typing import Any

from gamms.core import draws, routes, strategies, travel
from gamms.core.conflicts import Contests, MoveRequests, resolve
from gamms.core.rules import AgentPaths, GameColumns
from gamms.core.travel import TurnPaths

STAYS = 0  # kinds of decisions: stay on the node,
WALKS = 1  # move to a uniform random legal node,
IS_GIVEN = 2  # take an action from outside, the number of a legal node,
STEPS = 3  # or decide by the steps of a strategy, see `strategies`
KINDS = 4
NONE = -1  # values of `OneEdgeMovers.edges`: an action names no edge,
HALT = -2  # or it lets the agent stop where it is
# names for callers in Python, which do not see constants with a C type
STAY = STAYS
RANDOM_WALK = WALKS
GIVEN = IS_GIVEN
NO_EDGE = NONE
STOP = HALT
BY_STEPS = STEPS


class LegalMoves:
    """The legal moves of a turn: along one edge, or to any node.

    Several maps may have the same nodes and differ in the open roads; their nodes follow each other. The position of a
    node in this sequence is its place.

    Attributes:
        nodes: the number of places.
        are_all_legal: whether agents may move to any node; then the agent's own node is the first legal node, and the
            others follow.
        offsets: (places + 1,) the legal nodes at place `i` are `targets[offsets[i]:offsets[i + 1]]`.
        targets: the rows of legal nodes: for each place its own row, then its neighbors in the order of
            `state["legal"]`.
    """

    def __init__(self, offsets: memoryview[int], targets: memoryview[int], *, are_all_legal: bool = False) -> None:
        self.offsets = offsets
        self.targets = targets
        self.nodes = len(offsets) - 1
        self.are_all_legal = are_all_legal


class ChosenRoutes:
    """Routes that functions have chosen, for agents that may move along several edges.

    Attributes:
        room: the maximum number of nodes in a row.
        nodes: (rows * room,) the nodes of each route.
        counts: (rows,) the number of nodes; -1: the agent stays.
        motions: (rows,) for agents on an edge: `travel.BACK` or `travel.FORWARD`.
    """

    def __init__(self, room: int, nodes: memoryview[int], counts: memoryview[int], motions: memoryview[int]) -> None:
        self.room = room
        self.nodes = nodes
        self.counts = counts
        self.motions = motions

    def take(self, row: int, route: memoryview[int]) -> int:
        """Copy the route of an agent to `route`; return the number of its nodes, or -1."""
        for number in range(self.counts[row]):
            route[number] = self.nodes[row * self.room + number]
        return self.counts[row]


class OneEdgeMovers:
    """The agents of games along one edge per turn; rows are as in `rules.GameColumns`.

    Agents that move in other ways are subclasses, which override how one agent decides, goes and stays.

    Attributes:
        streets: the legal moves.
        decides_by: (agents,) `STAYS`, `WALKS`, `IS_GIVEN` or `STEPS`.
        by_kind: (agents,) the agents, sorted by `decides_by`; see `sort_kinds`.
        kind_ends: (KINDS,) the agents of a kind are `by_kind[kind_ends[kind - 1]:kind_ends[kind]]`.
        walks: draws for random walks; the numbers, below `counts`, are written to `ends`.
        given: (rows,) the actions given from outside; -1: the agent follows its route in `routes`.
        edges: (rows,) the edges that these actions name; `NONE` or `HALT`: see there. Only agents that may move along
            several edges look at them: for the others, `given` leads to the end of the edge.
        routes: routes; None: all agents move along one edge.
        by_steps: decides for agents with `STEPS`; None: there are none.
        contests, requests: resolve conflicts, if `has_conflicts`; the requests share `node` of the games, `ends` and
            `takes_part`.
        part_of: (agents,) the part of the turn in which each agent moves, in the order of play.
        parts: the number of parts of a turn.
        part: (games,) the number of parts played in the current turn.
        ends: (rows,) the nodes that agents move to in this part of the turn.
        went: (rows,) the nodes that agents have moved to in this turn; where they are if they have not moved yet.
        takes_part: (rows,) 1: the agent was alive at the start of the turn.
        counts: (rows,) the number of legal nodes at that time.
        moves, blocks: (rows,) the total numbers of moves to another node, and of moves stopped by conflicts.
        blocked: (rows,) 1: a conflict stopped the agent's last move.
        wanted: (rows,) the place where this move would have ended, as in `conflicts`.
        held: (rows,) 1: a function cancels the decision of the agent; `settle` puts that into effect.
    """

    def __init__(
        self,
        streets: LegalMoves,
        decides_by: memoryview[int],
        walks: draws.RandomChoices,
        given: memoryview[int],
        contests: Contests | None,
        requests: MoveRequests | None,
        *,
        edges: memoryview[int],
        ends: memoryview[int],
        went: memoryview[int],
        takes_part: memoryview[int],
        counts: memoryview[int],
        moves: memoryview[int],
        blocks: memoryview[int],
        blocked: memoryview[int],
        wanted: memoryview[int],
        held: memoryview[int],
        part_of: memoryview[int],
        part: memoryview[int],
        parts: int,
        by_steps: strategies.Strategies | None = None,
        routes: ChosenRoutes | None = None,
    ) -> None:
        self.streets = streets
        self.decides_by = decides_by
        self.by_kind: memoryview[int] = memoryview(array("q", [0]) * len(decides_by))
        self.kind_ends: memoryview[int] = memoryview(array("q", [0]) * KINDS)
        self.walks = walks
        self.given = given
        self.routes = routes
        self.by_steps = by_steps
        if by_steps is not None:
            self.by_steps.take_moves(self.streets.offsets, self.streets.targets)  # type: ignore[union-attr]
        self.contests = contests
        self.requests = requests
        self.has_conflicts = contests is not None
        self.edges = edges
        self.ends = ends
        self.went = went
        self.takes_part = takes_part
        self.counts = counts
        self.moves = moves
        self.blocks = blocks
        self.blocked = blocked
        self.wanted = wanted
        self.held = held
        self.part_of = part_of
        self.part = part
        self.parts = parts
        self.sort_kinds()

    def take(self, streets: LegalMoves) -> None:
        """Replace the legal moves."""
        self.streets = streets
        if self.by_steps is not None:
            self.by_steps.take_moves(streets.offsets, streets.targets)

    def sort_kinds(self) -> None:
        """Sort the agents by kinds of decisions; called whenever `decides_by` has changed."""
        count = 0
        for kind in range(KINDS):
            for i in range(len(self.decides_by)):
                if self.decides_by[i] == kind:
                    self.by_kind[count] = i
                    count += 1
            self.kind_ends[kind] = count

    # -- phases of a part of a turn; see `turn` -------------------------------------------------------------------

    def take_game(self, games: GameColumns, game: int) -> int:
        """Use the map and the paths of a game."""
        return 0

    def decide(self, games: GameColumns, game: int) -> int:
        """Choose the moves of the living agents in this part of the turn; all other agents stay."""
        begin_part(games, self, game)
        stay_all(games, self, game)
        walk_at_random(games, self, game)
        take_numbers(games, self, game, IS_GIVEN, self.given)
        return follow_steps(games, self, game)

    def settle(self, games: GameColumns, game: int) -> int:
        """Cancel the moves of held agents, and of agents that rules have placed elsewhere since they decided."""
        for i in range(games.agents):
            row = game * games.agents + i
            is_put = self.is_put(games, game, i)
            if is_put:
                put(games, self, row)
            if is_put or is_stopped(games, self, row, i):
                self.stay(games, game, i)
            if games.placed[row] and self.part_of[i] < self.part[game]:  # since it moved: conflicts read where it is
                self.stand(games, game, i)
            leave_or_join(games, self, row)
        return 0

    def give_way(self, games: GameColumns, game: int) -> int:
        """Resolve conflicts: the losers stay, and are counted."""
        if not self.has_conflicts or resolve(self.contests, self.requests, game, games.turn[game]) == 0:  # type: ignore[arg-type]
            return 0
        part = self.part[game]
        for i in range(games.agents):
            is_loser = self.contests.stays[i] and self.part_of[i] == part  # type: ignore[union-attr] # there are conflicts
            if is_loser and self.is_moving(games, game, i):
                block_agent(self, game * games.agents + i, self.find_goal(game * games.agents + i))
                self.stay(games, game, i)
        return 0

    def move(self, games: GameColumns, game: int) -> int:
        """Move the agents of this part of the turn, count the moves, and advance the turn after its last part."""
        self.go_all(games, game)
        return end_part(games, self, game)

    def go_all(self, games: GameColumns, game: int) -> int:
        """Move the agents of this part of the turn to the ends of their moves."""
        part = self.part[game]
        at = game * games.agents
        for i in range(games.agents):
            if self.part_of[i] == part:
                go(games, self, at + i)
        return 0

    # -- one agent ------------------------------------------------------------------------------------------------

    def is_put(self, games: GameColumns, game: int, i: int) -> bool:
        """Return whether rules have put an agent elsewhere that was about to move, or brought it back."""
        return is_put(games, self, game, i)

    def is_moving(self, games: GameColumns, game: int, i: int) -> bool:
        """Return whether an agent leaves its place."""
        row = game * games.agents + i
        return self.ends[row] != games.node[row]

    def find_goal(self, row: int) -> int:
        """Return the place where the move of an agent ends, as in `conflicts`."""
        return self.ends[row]

    def stay(self, games: GameColumns, game: int, i: int) -> int:
        """Undo the move of an agent: it stays at its place for the whole turn."""
        row = game * games.agents + i
        self.ends[row] = games.node[row]
        return 0

    def stand(self, games: GameColumns, game: int, i: int) -> int:
        """Set the place that conflicts read of an agent that has moved in an earlier part of the turn."""
        row = game * games.agents + i
        self.ends[row] = games.node[row]
        return 0


class TripMovers(OneEdgeMovers):
    """The agents of games that may move along several edges in a turn, or parts of edges; subclasses say how.

    Attributes:
        trips: (agents,) the paths of the game that is played, or (rows,) of all games, if functions ask for them
            between phases, or rules run after all games have moved (`has_all`).
        first: the row in `trips` of the first agent of the game.
    """

    def __init__(self, trips: TurnPaths, *movers: Any, has_all: bool, **columns: Any) -> None:
        super().__init__(*movers, **columns)
        self.first = 0
        self.take_paths(trips, has_all=has_all)

    def take_paths(self, trips: TurnPaths, *, has_all: bool) -> None:
        """Write the paths of the agents to other memory."""
        self.trips = trips
        self.has_all = has_all

    def take_game(self, games: GameColumns, game: int) -> int:
        """Use the paths of a game; the edges that each agent may use are chosen; see `rules.find_first_place`."""
        self.first = game * games.agents if self.has_all else 0
        return 0


# -- decisions of one game -------------------------------------------------------------------------------------------


def begin_part(games: GameColumns, m: OneEdgeMovers, game: int) -> int:
    """Begin a part of a turn for all agents."""
    at = game * games.agents
    first = games.first_node[game]
    part = m.part[game]
    for i in range(games.agents):
        row = at + i
        if part == 0:
            set_out(games, m, row)
        elif is_deciding(m, row, i, part):
            games.start[row] = games.node[row]
        m.counts[row] = count_legal(m.streets, first + games.node[row])
    return 0


def is_deciding(m: OneEdgeMovers, row: int, i: int, part: int) -> bool:
    """Return whether an agent decides in a part of the turn."""
    return m.takes_part[row] > 0 and m.part_of[i] == part


def stay_all(games: GameColumns, m: OneEdgeMovers, game: int) -> int:
    """Let agents that stay do so."""
    at = game * games.agents
    part = m.part[game]
    for place in range(m.kind_ends[STAYS]):
        i = m.by_kind[place]
        m.ends[at + i] = games.node[at + i]
        if is_deciding(m, at + i, i, part):
            m.blocked[at + i] = 0
    return 0


def walk_at_random(games: GameColumns, m: OneEdgeMovers, game: int) -> int:
    """Choose the nodes of agents that walk at random."""
    begin = m.kind_ends[STAYS]
    end = m.kind_ends[WALKS]
    if begin < end:
        draws.choose(m.walks, game * games.agents, m.by_kind, begin, end, games.turn[game])
        take_numbers(games, m, game, WALKS, m.ends)
    return 0


def take_numbers(games: GameColumns, m: OneEdgeMovers, game: int, kind: int, numbers: memoryview[int]) -> int:
    """Choose the nodes of agents of a kind from the numbers of legal nodes, (rows,); others than deciders stay."""
    at = game * games.agents
    first = games.first_node[game]
    part = m.part[game]
    for place in range(m.kind_ends[kind - 1], m.kind_ends[kind]):
        i = m.by_kind[place]
        row = at + i
        if is_deciding(m, row, i, part):
            m.blocked[row] = 0
            number = as_legal(numbers[row], m.counts[row])
            m.ends[row] = get_legal_node(m.streets, first, games.node[row], number)
        else:
            m.ends[row] = games.node[row]
    return 0


def follow_steps(games: GameColumns, m: OneEdgeMovers, game: int) -> int:
    """Choose the nodes of agents that follow the steps of strategies; those that do not decide now stay."""
    if m.kind_ends[IS_GIVEN] < m.kind_ends[STEPS]:
        strategies.begin(m.by_steps, game)  # type: ignore[arg-type] # there are some
    at = game * games.agents
    part = m.part[game]
    for place in range(m.kind_ends[IS_GIVEN], m.kind_ends[STEPS]):
        i = m.by_kind[place]
        m.ends[at + i] = games.node[at + i]
        if is_deciding(m, at + i, i, part):
            m.blocked[at + i] = 0
            m.ends[at + i] = choose_node_by_steps(games, m, game, i)
    return 0


def count_legal(s: LegalMoves, place: int) -> int:
    """Return the number of legal nodes at a place."""
    return s.nodes if s.are_all_legal else s.offsets[place + 1] - s.offsets[place]


def as_legal(number: int, count: int) -> int:
    """Return the number of a legal node: 0, to stay, for a number from outside that is none of `count`."""
    return number if 0 <= number < count else 0


def get_legal_node(s: LegalMoves, first: int, node: int, number: int) -> int:
    """Return legal node number `number` of a node; `first` is the place of the map's first node."""
    if not s.are_all_legal:
        return s.targets[s.offsets[first + node] + number]
    if number == 0:
        return node
    return number - 1 if number <= node else number


def set_out(games: GameColumns, m: OneEdgeMovers, row: int) -> int:
    """Start the turn of an agent at its node."""
    games.start[row] = games.node[row]
    m.went[row] = games.node[row]
    m.takes_part[row] = games.alive[row]
    games.placed[row] = 0
    return 0


def choose_node_by_steps(games: GameColumns, m: OneEdgeMovers, game: int, i: int) -> int:
    """Return the legal node that the strategy steps of an agent choose."""
    m.by_steps.drawn = 0  # type: ignore[union-attr] # there are some
    node = act(m.by_steps, m.streets, game, i)  # type: ignore[arg-type]
    return node if node >= 0 else games.node[game * games.agents + i]


def act(p: strategies.Strategies, s: LegalMoves, game: int, i: int) -> int:
    """Return the legal node that the steps of an agent choose; -1: none."""
    node = p.games.node[game * p.games.agents + i]
    first = p.games.first_node[game]
    p.count = count_legal(s, first + node)
    for number in range(p.count):
        p.legal[number] = get_legal_node(s, first, node, number)
    return strategies.act(p, game, i)


def ask(
    p: strategies.Strategies,
    s: LegalMoves,
    games: memoryview[int],
    agents: memoryview[int],
    asked: memoryview[int],
    drawn: memoryview[int],
    found: memoryview[int],
) -> int:
    """Let agents of some games choose by their steps, without moving them.

    Args:
        p: the agents.
        s: the legal moves.
        games: the numbers of the games.
        agents: the numbers of the agents.
        asked: (games * agents,) 1: the agent is asked.
        drawn: (games * agents,) how many numbers each has drawn in this turn; it is updated.
        found: (games * agents,) receives the number of the legal node that each chooses, unless it chooses none.
    """
    p.take_moves(s.offsets, s.targets)
    row = 0
    for at in range(len(games)):
        strategies.begin(p, games[at])
        for place in range(len(agents)):
            if asked[row]:
                p.drawn = drawn[row]
                node = act(p, s, games[at], agents[place])
                drawn[row] = p.drawn
                if node >= 0:
                    found[row] = routes.find_number(p.legal, 0, p.count, node)
            row += 1
    return 0


def block_agent(m: OneEdgeMovers, row: int, wanted: int) -> int:
    """Record that a conflict has stopped an agent on the way to a place."""
    m.wanted[row] = wanted
    m.blocked[row] = 1
    m.blocks[row] += 1
    return 0


def is_put(games: GameColumns, m: OneEdgeMovers, game: int, i: int) -> bool:
    """Return whether an agent that was about to move is on another node, or was brought back."""
    row = game * games.agents + i
    if not m.takes_part[row]:
        return True
    return m.part_of[i] >= m.part[game] and games.node[row] != games.start[row]


def is_stopped(games: GameColumns, m: OneEdgeMovers, row: int, i: int) -> bool:
    """Return whether an agent that has not moved yet in this turn is held, or was eliminated."""
    return m.part_of[i] >= m.part[row // games.agents] and (m.held[row] > 0 or not games.alive[row])


def put(games: GameColumns, m: OneEdgeMovers, row: int) -> int:
    """Keep an agent on its current node, to which rules have put it; see `go` for its own part of a turn."""
    part = m.part[row // games.agents]
    m.ends[row] = games.node[row]
    if part == 0 or m.part_of[row % games.agents] > part or not m.takes_part[row]:
        games.start[row] = games.node[row]
        m.went[row] = games.node[row]
    return 0


def leave_or_join(games: GameColumns, m: OneEdgeMovers, row: int) -> int:
    """Include an agent in the turn if it is alive."""
    m.held[row] = 0
    m.takes_part[row] = games.alive[row]
    if not games.alive[row]:
        m.ends[row] = games.node[row]
    return 0


def go(games: GameColumns, m: OneEdgeMovers, row: int) -> int:
    """Move an agent to the end of its move, unless a rule has put it elsewhere in a later part of the turn, its own."""
    games.placed[row] = 0
    if games.node[row] != games.start[row]:
        return 0
    m.went[row] = m.ends[row]
    if m.ends[row] != games.start[row]:
        games.previous[row] = games.start[row]
        m.moves[row] += 1
    games.node[row] = m.ends[row]
    return 0


def end_part(games: GameColumns, m: OneEdgeMovers, game: int) -> int:
    """Count a finished part of a turn, and advance the turn after its last part, or if the game is over."""
    m.part[game] += 1
    if m.part[game] == m.parts or games.over[game]:
        m.part[game] = 0
        games.turn[game] += 1
    return 0


class PartPaths(AgentPaths):
    """The paths of the agents of one game along at most one edge each, when a turn has several parts.

    Args:
        movers: the agents.
        nodes, times: see `AgentPaths`, with room for three nodes of each agent: an agent that waits for its part has
            its start node twice.
        lengths: see `AgentPaths`.
    """

    def __init__(
        self, movers: OneEdgeMovers, nodes: memoryview[int], times: memoryview[float], lengths: memoryview[int]
    ) -> None:
        super().__init__(nodes, times, lengths)
        self.are_one_edge = False
        self.movers = movers

    def fill(self, games: GameColumns, game: int) -> int:
        """Write the paths of the agents of a game."""
        for agent in range(games.agents):
            row = game * games.agents + agent
            place = 3 * agent
            part = self.movers.part_of[agent]
            is_put = games.placed[row] > 0 or self.movers.went[row] != games.node[row]
            self.nodes[place] = games.node[row]
            self.times[place] = 1.0 if is_put else 0.0
            if not is_put and games.start[row] != games.node[row]:
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


class TripPaths(AgentPaths):
    """The paths of the agents of one game along several edges or parts of edges.

    Args:
        movers: the agents.
        trips: (agents,) receive the paths, if those of the movers are of all games; otherwise the same paths.
    """

    def __init__(self, movers: TripMovers, trips: TurnPaths) -> None:
        super().__init__(trips.nodes, trips.times, trips.passed)
        self.are_one_edge = False
        self.movers = movers
        self.trips = trips

    def fill(self, games: GameColumns, game: int) -> int:
        """Write the paths of the agents of a game."""
        return copy_paths(games, self, game)


def copy_paths(games: GameColumns, p: TripPaths, game: int) -> int:
    """Copy the paths of a game from those of all games; agents that a rule has placed elsewhere only get their node."""
    for agent in range(games.agents):
        row = game * games.agents + agent
        if games.placed[row]:
            p.trips.legs[agent] = 0
            p.trips.passed[agent] = 1
            p.trips.nodes[agent * (p.trips.most + 1)] = games.node[row]
            p.trips.times[agent * (p.trips.most + 1)] = 1.0
        elif p.movers.has_all:
            travel.copy_trip(p.movers.trips, row, p.trips, agent)
    return 0
