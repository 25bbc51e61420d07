"""A turn of one game, and games to their ends, where all their parts are functions of the core.

A turn of a game is these phases, one after the other, which `play_part` calls. All agents decide before one moves; with
an order of play, agents do so in parts of the turn, one part after the other, and the rules follow the last.

| phase    | what happens                                            | along one edge, several, by metres           |
|----------|---------------------------------------------------------|----------------------------------------------|
| decide   | each living agent chooses where it goes, or is given it | `decide` of `moves`, `by_edges`, `by_metres` |
| give way | agents that lose conflicts stay where they are          | `give_way`, likewise                         |
| move     | agents go; one turn more was played                     | `move`, likewise                             |
| rules    | the rules are applied in order; they may end the game   | `rules.play`                                 |

Agents that decide where they arrive decide and give way several times in a turn: `arrivals.play`.

Games share nothing but the map and their rules' arguments: they may be played in any order and on several threads.
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
    """What one thread plays games with.

    Attributes:
        games: the columns of all games.
        movers: their agents as they move along one edge in a turn.
        walkers: their agents as they go along several edges, if they do so: `by_edges`.
        travelers: their agents as they go by metres, if they do so: `by_metres`.
        arrivals: the same as they decide where they arrive, if they do so.
        first: the first of their rules, if `has_rules`.
        until: (games,) a game is played until so many parts of its turns are.
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
    """Play the games from `begin` to `end - 1`, each until it is over or its turns are played."""
    parts = p.movers.parts
    for game in range(begin, end):
        while not p.games.over[game] and p.games.turn[game] * parts + p.movers.part[game] < p.until[game]:
            play_part(p, game)
    return 0


def play_aside(p: Player, begin: int, end: int) -> int:
    """Do what `play` does, and let other threads of Python go on meanwhile."""
    with cython.nogil:
        play(p, begin, end)
    return 0
