"""Play turns of one game, or whole games, by functions of the core alone.

A turn consists of these phases, which `play_part` calls in order. All agents decide before any moves. With
an order of play, a turn has parts, in which some of the agents decide and move; the rules follow the last part.

| phase    | what happens                                            | along one edge, several, by metres           |
|----------|---------------------------------------------------------|----------------------------------------------|
| decide   | each living agent chooses or is given its move          | `decide` of `moves`, `by_edges`, `by_metres` |
| give way | agents that lose conflicts stay                         | `give_way`, likewise                         |
| move     | agents move; the turn counter advances                  | `move`, likewise                             |
| rules    | the rules are applied in order and may end the game     | `rules.play`                                 |

Agents that decide on arrival decide and give way several times per turn: `arrivals.play`.

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


class Player:
    """The data with which one thread plays games.

    Attributes:
        games: the columns of all games.
        movers: the agents' moves along one edge per turn.
        walkers: moves along several edges per turn; None: not used.
        travelers: moves by metres; None: not used.
        arrivals: moves by metres with decisions on arrival; None: not used.
        first: the first rule, if `has_rules`.
        until: (games,) the number of parts of turns after which the game stops.
    """

    def __init__(
        self,
        games: rules.Games,
        movers: moves.Movers,
        walkers: by_edges.Walkers | None,
        travelers: by_metres.Travelers | None,
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


def play_part(p: Player, game: int) -> int:
    """Play one part of a turn of a game."""
    if p.by_metres:
        if p.at_arrivals:
            arrivals.play(p.games, p.arrivals, game)  # type: ignore[arg-type] # there are some
        else:
            by_metres.decide(p.games, p.travelers, game)  # type: ignore[arg-type] # there are some
            by_metres.give_way(p.games, p.travelers, game)  # type: ignore[arg-type]
        by_metres.move(p.games, p.travelers, game)  # type: ignore[arg-type]
    elif p.by_edges:
        by_edges.decide(p.games, p.walkers, game)  # type: ignore[arg-type] # there are some
        by_edges.give_way(p.games, p.walkers, game)  # type: ignore[arg-type]
        by_edges.move(p.games, p.walkers, game)  # type: ignore[arg-type]
    else:
        moves.decide(p.games, p.movers, game)
        moves.give_way(p.games, p.movers, game)
        moves.move(p.games, p.movers, game)
    if p.has_rules and p.movers.part[game] == 0:
        rules.play(p.first, game)  # type: ignore[arg-type] # there is one
    return 0


def play(p: Player, begin: int, end: int) -> int:
    """Play the games `begin` to `end - 1`, each until it is over or its number of turns is reached."""
    parts = p.movers.parts
    for game in range(begin, end):
        while not p.games.over[game] and p.games.turn[game] * parts + p.movers.part[game] < p.until[game]:
            play_part(p, game)
    return 0


def play_aside(p: Player, begin: int, end: int) -> int:
    """Call `play` without the GIL."""
    with cython.nogil:
        play(p, begin, end)
    return 0
