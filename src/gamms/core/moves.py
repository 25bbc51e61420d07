"""Moves of one game along edges: agents decide, give way to each other, and go."""

from __future__ import annotations

from gamms.core import draws, strategies
from gamms.core.conflicts import Contests, Requests, resolve
from gamms.core.rules import Games

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
    """Where agents may go along one edge.

    Attributes:
        offsets: (nodes + 1,) the legal nodes of node `i` are `targets[offsets[i]:offsets[i + 1]]`.
        targets: of each node its own row first, then those of its neighbors in the order of `state["legal"]`.
    """

    def __init__(self, offsets: memoryview[int], targets: memoryview[int]) -> None:
        self.offsets = offsets
        self.targets = targets


class Movers:
    """The agents of games as they decide and move; rows are those of `rules.Games`.

    Attributes:
        streets: where they may go.
        decides_by: (agents,) `STAYS`, `WALKS`, `IS_GIVEN` or `STEPS`.
        walks: draws the nodes of those that walk: into `ends`, numbers below `counts`.
        some_walk: whether there are such.
        given: (rows,) the actions of those that are given one; (0,) where none is.
        by_steps: decides for those of `STEPS`, if there are such (`some_steps`).
        contests, requests: find who gives way, if `has_conflicts`; the requests have `start` of the games, `ends` and
            `takes_part`.
        ends: (rows,) where agents go in the turn that is played.
        takes_part: (rows,) 1: the agent was alive when this turn began.
        counts: (rows,) how many nodes were legal then.
        moves, blocks: (rows,) how often agents have gone to another node, and how often conflicts have stopped them.
        blocked: (rows,) 1: conflicts stopped the agent when it decided last.
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
        by_steps: strategies.Strategies | None = None,
    ) -> None:
        self.streets = streets
        self.decides_by = decides_by
        self.walks = walks
        self.some_walk = some_walk
        self.given = given
        self.by_steps = by_steps
        self.some_steps = by_steps is not None
        self.contests = contests
        self.requests = requests
        self.has_conflicts = contests is not None
        self.ends = ends
        self.takes_part = takes_part
        self.counts = counts
        self.moves = moves
        self.blocks = blocks
        self.blocked = blocked


def decide(games: Games, m: Movers, game: int) -> int:
    """Let the living agents of a game choose the legal nodes that they go to; the others stay.

    Return 1 where a way is not known yet that one of them asks for: nothing has happened then.
    """
    at = game * games.agents
    for row in range(at, at + games.agents):
        node = games.node[row]
        games.start[row] = node
        m.takes_part[row] = games.alive[row]
        if games.alive[row]:
            m.blocked[row] = 0
        m.counts[row] = m.streets.offsets[node + 1] - m.streets.offsets[node]
    if m.some_walk:  # `ends` are numbers of legal nodes for a while
        draws.choose(m.walks, at, games.agents, games.turn[game])
    for i in range(games.agents):
        row = at + i
        action = 0
        if m.takes_part[row] and m.decides_by[i] == WALKS:
            action = m.ends[row]
        elif m.takes_part[row] and m.decides_by[i] == IS_GIVEN:
            action = m.given[row]
        elif m.takes_part[row] and m.decides_by[i] == STEPS:
            action = strategies.act(m.by_steps, game, i)  # type: ignore[arg-type] # there are some
        m.ends[row] = m.streets.targets[m.streets.offsets[games.start[row]] + action]
    return strategies.remember(m.by_steps, game) if m.some_steps else 0  # type: ignore[arg-type]


def give_way(games: Games, m: Movers, game: int) -> int:
    """Let agents stay that lose conflicts, and count them."""
    if not m.has_conflicts or resolve(m.contests, m.requests, game, games.turn[game]) == 0:  # type: ignore[arg-type]
        return 0
    at = game * games.agents
    for i in range(games.agents):
        row = at + i
        if m.contests.stays[i] and m.ends[row] != games.start[row]:  # type: ignore[union-attr] # there are conflicts
            m.ends[row] = games.start[row]
            m.blocked[row] = 1
            m.blocks[row] += 1
    return 0


def move(games: Games, m: Movers, game: int) -> int:
    """Let agents go, and count their moves; one turn more was played then."""
    at = game * games.agents
    for row in range(at, at + games.agents):
        games.placed[row] = 0
        if m.ends[row] != games.start[row]:
            games.node[row] = m.ends[row]
            m.moves[row] += 1
    games.turn[game] += 1
    return 0
