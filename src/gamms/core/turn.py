"""Play turns of one game, or whole games, by functions of the core alone.

A turn consists of these phases, one after the other. All agents decide before any moves. With
an order of play, a turn has parts, in which some of the agents decide and move; the rules follow the last part.

| phase    | what happens                                            | along one edge, several, by metres           |
|----------|---------------------------------------------------------|----------------------------------------------|
| decide   | each living agent chooses or is given its move          | `decide` of `moves`, `by_edges`, `by_metres` |
| settle   | agents stay that functions have held or put elsewhere   | `settle`, likewise                           |
| give way | agents that lose conflicts stay                         | `give_way`, likewise                         |
| move     | agents move; the turn counter advances                  | `move`, likewise                             |
| rules    | the rules are applied in order and may end the game     | `rules.play`                                 |

If functions are called between these phases, all games finish one phase before the next begins: `play_phases`.
Agents that decide on arrival decide and give way several times per turn: `arrivals.play`, or in phases of their own
instead of the first, `arrivals.play_phase`.

Games share only the map and the arguments of rules; they can be played in any order and on several threads.
"""

from __future__ import annotations

from gamms.core import arrivals, by_edges, by_metres, moves, rules

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


class Player:
    """The data with which one thread plays games.

    Attributes:
        games: the columns of all games.
        movers: the agents' moves along one edge per turn.
        walkers: moves along several edges per turn; None: not used.
        travelers: moves by metres; None: not used.
        arrivals: moves by metres with decisions on arrival; None: not used.
        first: the first rule, if `has_rules`.
        until: (games,) the number of parts of turns after which the game stops; 0: it is not played.
    """

    def __init__(
        self,
        games: rules.GameColumns,
        movers: moves.OneEdgeMovers,
        walkers: by_edges.EdgeMovers | None,
        travelers: by_metres.MetreMovers | None,
        at_arrivals: arrivals.Arrivals | None,
        first: rules.Rule | None,
        until: memoryview[int],
    ) -> None:
        self.games = games
        self.movers = movers
        self.walkers = walkers
        self.by_edges = walkers is not None
        self.travelers = travelers
        self.by_metres = travelers is not None
        self.arrivals = at_arrivals
        self.at_arrivals = at_arrivals is not None
        self.first = first
        self.has_rules = first is not None
        self.until = until


def take_map(p: Player, game: int) -> int:
    """Use the roads that are open in a game."""
    first = p.games.first_node[game]
    if p.by_metres:
        return by_metres.take_map(p.travelers, first)  # type: ignore[arg-type] # there are some
    return by_edges.take_map(p.walkers, first) if p.by_edges else 0  # type: ignore[arg-type]


def decide(p: Player, game: int) -> int:
    """Let the agents of a part of a turn decide."""
    if p.at_arrivals:
        return arrivals.play(p.games, p.arrivals, game)  # type: ignore[arg-type] # there are some
    if p.by_metres:
        return by_metres.decide(p.games, p.travelers, game)  # type: ignore[arg-type] # there are some
    if p.by_edges:
        return by_edges.decide(p.games, p.walkers, game)  # type: ignore[arg-type] # there are some
    return moves.decide(p.games, p.movers, game)


def move(p: Player, game: int) -> int:
    """Let the agents of a part of a turn give way to each other and go, and apply the rules after the last part."""
    if p.by_metres:
        if not p.at_arrivals:
            by_metres.give_way(p.games, p.travelers, game)  # type: ignore[arg-type] # there are some
        by_metres.move(p.games, p.travelers, game)  # type: ignore[arg-type]
    elif p.by_edges:
        by_edges.give_way(p.games, p.walkers, game)  # type: ignore[arg-type] # there are some
        by_edges.move(p.games, p.walkers, game)  # type: ignore[arg-type]
    else:
        moves.give_way(p.games, p.movers, game)
        moves.move(p.games, p.movers, game)
    if p.has_rules and p.movers.part[game] == 0:
        rules.play(p.first, game)  # type: ignore[arg-type] # there is one
    return 0


def play_phase(p: Player, phase: int, game: int) -> int:
    """Play a phase of a part of a turn of a game, with how agents go kept between; see `PHASES`."""
    if phase > MOVE:
        return arrivals.play_phase(p.games, p.arrivals, p.travelers, phase, game)  # type: ignore[arg-type]
    if phase == DECIDE:
        decide(p, game)
    else:
        settle(p, game)
    if phase == MOVE:
        return move(p, game)
    if p.by_metres:
        return by_metres.keep(p.games, p.travelers, game)  # type: ignore[arg-type] # there are some
    return by_edges.keep(p.games, p.walkers, game) if p.by_edges else 0  # type: ignore[arg-type]


def settle(p: Player, game: int) -> int:
    """Let agents stay that functions have held or put elsewhere since they decided."""
    if p.by_metres:
        by_metres.recall(p.games, p.travelers, game)  # type: ignore[arg-type] # there are some
        return by_metres.settle(p.games, p.travelers, game)  # type: ignore[arg-type]
    if p.by_edges:
        by_edges.recall(p.games, p.walkers, game)  # type: ignore[arg-type] # there are some
        return by_edges.settle(p.games, p.walkers, game)  # type: ignore[arg-type]
    return moves.settle(p.games, p.movers, game)


def play(p: Player, begin: int, end: int) -> int:
    """Play the games `begin` to `end - 1`, each until it is over or its number of turns is reached."""
    parts = p.movers.parts
    for game in range(begin, end):
        if p.until[game] == 0:  # it is on another map
            continue
        take_map(p, game)
        while not p.games.over[game] and p.games.turn[game] * parts + p.movers.part[game] < p.until[game]:
            decide(p, game)
            move(p, game)
    return 0


def play_phases(p: Player, phase: int, begin: int, end: int) -> int:
    """Play a phase of those games from `begin` to `end - 1` whose turns are not played."""
    parts = p.movers.parts
    for game in range(begin, end):
        if p.games.turn[game] * parts + p.movers.part[game] < p.until[game]:
            take_map(p, game)
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
