"""A turn of one game, and games to their ends, where all their parts are functions of the core.

A turn of a game is these phases, one after the other, which `play_turn` calls. All agents decide before one moves.

| phase    | along one edge   | by metres            | what happens                                            |
|----------|------------------|----------------------|---------------------------------------------------------|
| decide   | `moves.decide`   | `by_metres.decide`   | each living agent chooses where it goes, or is given it |
| give way | `moves.give_way` | `by_metres.give_way` | agents that lose conflicts stay where they are          |
| move     | `moves.move`     | `by_metres.move`     | agents go; one turn more was played                     |
| rules    | `rules.play`     | `rules.play`         | the rules are applied in order; they may end the game   |

Games share nothing but the map and their rules' arguments: they may be played in any order and on several threads.
"""

from __future__ import annotations

from gamms.core import by_metres, moves, rules

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
        travelers: their agents as they go by metres, if the games are `by_metres`.
        first: the first of their rules, if `has_rules`.
        until: (games,) a game is played until so many turns of it are.
    """

    def __init__(
        self,
        games: rules.Games,
        movers: moves.Movers,
        travelers: by_metres.Travelers | None,
        first: rules.Rule | None,
        until: memoryview[int],
    ) -> None:
        self.games = games
        self.movers = movers
        self.travelers = travelers
        self.by_metres = travelers is not None
        self.first = first
        self.has_rules = first is not None
        self.until = until


def play_turn(p: Player, game: int) -> int:
    """Play one turn of a game."""
    if p.by_metres:
        by_metres.decide(p.games, p.travelers, game)  # type: ignore[arg-type] # there are some
        by_metres.give_way(p.games, p.travelers, game)  # type: ignore[arg-type]
        by_metres.move(p.games, p.travelers, game)  # type: ignore[arg-type]
    else:
        moves.decide(p.games, p.movers, game)
        moves.give_way(p.games, p.movers, game)
        moves.move(p.games, p.movers, game)
    if p.has_rules:
        rules.play(p.first, game)  # type: ignore[arg-type] # there is one
    return 0


def play(p: Player, begin: int, end: int) -> int:
    """Play the games with the numbers from `begin` to `end - 1`, each until it is over or its turns are played."""
    for game in range(begin, end):
        while not p.games.over[game] and p.games.turn[game] < p.until[game]:
            play_turn(p, game)
    return 0


def play_aside(p: Player, begin: int, end: int) -> int:
    """Do what `play` does, and let other threads of Python go on meanwhile."""
    with cython.nogil:
        play(p, begin, end)
    return 0
