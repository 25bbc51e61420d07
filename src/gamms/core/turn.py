"""Play turns of one game, or whole games, by functions of the core alone.

A turn consists of these phases, one after the other. All agents decide before any moves. With
an order of play, a turn has parts, in which some of the agents decide and move; the rules follow the last part.

| phase    | what happens                                            | method                   |
|----------|---------------------------------------------------------|--------------------------|
| decide   | each living agent chooses or is given its move          | `OneEdgeMovers.decide`   |
| settle   | agents stay that functions have held or put elsewhere   | `OneEdgeMovers.settle`   |
| give way | agents that lose conflicts stay                         | `OneEdgeMovers.give_way` |
| move     | agents move; the turn counter advances                  | `OneEdgeMovers.move`     |
| rules    | the rules are applied in order and may end the game     | `rules.play`             |

Agents that move along several edges, or by metres, override what differs: `by_edges.EdgeMovers`,
`by_metres.MetreMovers`.

If functions are called between these phases, all games finish one phase before the next begins: `play_phases`.
Agents that decide on arrival decide and give way several times per turn: `arrivals.play`, or in phases of their own
instead of the first, `arrivals.play_phase`.

Games share only the map and the arguments of rules; they can be played in any order and on several threads.
"""

from __future__ import annotations

from gamms.core import arrivals, moves, rules

try:
    import cython  # type: ignore[import-untyped]
except ImportError:  # Cython is not needed to run the text
    from contextlib import nullcontext
    from types import SimpleNamespace

    cython = SimpleNamespace(nogil=nullcontext())

DECIDE = 0
SETTLE = 1
MOVE = 2
PHASES = (DECIDE, SETTLE, MOVE)
"""What `play_phases` plays, besides the phases of `arrivals`."""


class PastPlaces:
    """Where the agents of a single game were after its last turns; those of turn t are in row t modulo `turns`.

    Attributes:
        turns: the number of turns that are kept; 0: none.
        node: (turns * agents,) the nodes.
        edge, share, motion: the same for positions on edges, see `rules.GameColumns` and `ir.progress.Motion`; empty in
            games without positions between nodes.
        motions: (agents,) the present motions.
    """

    def __init__(
        self,
        turns: int,
        node: memoryview[int],
        edge: memoryview[int],
        share: memoryview[float],
        motion: memoryview[int],
        motions: memoryview[int],
    ) -> None:
        self.turns = turns
        self.node = node
        self.edge = edge
        self.share = share
        self.motion = motion
        self.motions = motions

    def note(self, games: rules.GameColumns) -> int:
        """Keep the places of agents after a turn."""
        first = games.turn[0] % self.turns * games.agents
        for i in range(games.agents):
            self.node[first + i] = games.node[i]
        for i in range(len(self.motions)):
            self.edge[first + i] = games.edge[i]
            self.share[first + i] = games.share[i]
            self.motion[first + i] = self.motions[i]
        return 0


class Player:
    """The data with which one thread plays games.

    Attributes:
        games: the columns of all games.
        movers: the agents, and how they move.
        arrivals: moves by metres with decisions on arrival; None: not used.
        first: the first rule, if `has_rules`.
        until: (games,) the number of parts of turns after which the game stops; 0: it is not played.
        stop: (1,) not 0: all games stop at once, each between two turns, or before the next game of a phase.
        past: keeps the places of agents after turns of a single game.
    """

    def __init__(
        self,
        games: rules.GameColumns,
        movers: moves.OneEdgeMovers,
        at_arrivals: arrivals.Arrivals | None,
        first: rules.Rule | None,
        until: memoryview[int],
        stop: memoryview[int],
        past: PastPlaces,
    ) -> None:
        self.stop = stop
        self.past = past
        self.games = games
        self.movers = movers
        self.arrivals = at_arrivals
        self.at_arrivals = at_arrivals is not None
        self.first = first
        self.has_rules = first is not None
        self.until = until


def decide(p: Player, game: int) -> int:
    """Let the agents of a part of a turn decide."""
    if p.at_arrivals:
        return arrivals.play(p.games, p.arrivals, game)  # type: ignore[arg-type] # there are some
    return p.movers.decide(p.games, game)


def move(p: Player, game: int) -> int:
    """Let the agents of a part of a turn give way to each other and go, and apply the rules after the last part."""
    if not p.at_arrivals:
        p.movers.give_way(p.games, game)
    p.movers.move(p.games, game)
    if p.has_rules and p.movers.part[game] == 0:
        rules.play(p.first, game)  # type: ignore[arg-type] # there is one
    return 0


def play_phase(p: Player, phase: int, game: int) -> int:
    """Play a phase of a part of a turn of a game, with how agents go kept between; see `PHASES`."""
    if phase > MOVE:
        return arrivals.play_phase(p.games, p.arrivals, p.arrivals.travelers, phase, game)  # type: ignore[arg-type, union-attr]
    if phase == DECIDE:
        decide(p, game)
    else:
        p.movers.recall_all(game)
        p.movers.settle(p.games, game)
    if phase == MOVE:
        return move(p, game)
    return p.movers.keep_all(game)


def play(p: Player, begin: int, end: int) -> int:
    """Play the games `begin` to `end - 1`, each until it is over or its number of turns is reached."""
    parts = p.movers.parts
    for game in range(begin, end):
        if p.until[game] == 0:  # it is on another map
            continue
        p.movers.take_map(p.games.first_node[game])
        while not p.games.over[game] and p.games.turn[game] * parts + p.movers.part[game] < p.until[game]:
            if p.stop[0]:
                return 0
            decide(p, game)
            move(p, game)
            if p.past.turns > 0 and p.movers.part[game] == 0:
                p.past.note(p.games)
    return 0


def play_phases(p: Player, phase: int, begin: int, end: int) -> int:
    """Play a phase of those games from `begin` to `end - 1` whose turns are not played."""
    parts = p.movers.parts
    for game in range(begin, end):
        if p.stop[0]:
            return 0
        if p.games.turn[game] * parts + p.movers.part[game] < p.until[game]:
            p.movers.take_map(p.games.first_node[game])
            play_phase(p, phase, game)
    return 0


def play_aside(p: Player, begin: int, end: int) -> int:
    """Call `play` without the GIL."""
    with cython.nogil:
        play(p, begin, end)
    return 0


def play_phases_aside(p: Player, phase: int, begin: int, end: int) -> int:
    """Do what `play_phases` does, and let other threads of Python go on meanwhile."""
    with cython.nogil:
        play_phases(p, phase, begin, end)
    return 0
