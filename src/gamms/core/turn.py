"""A turn along edges of one game, and games to their ends, where all their parts are functions of the core.

A turn of a game is these phases, one after the other, which `play_turn` calls. All agents decide before one moves.

| phase     | function         | what happens                                                                         |
|-----------|------------------|--------------------------------------------------------------------------------------|
| decide    | `moves.decide`   | each living agent chooses a legal node, by its strategy or as it was given            |
| give way  | `moves.give_way` | agents that lose conflicts stay where they are                                       |
| move      | `moves.move`     | agents go; one turn more was played                                                  |
| rules     | `rules.play`     | the rules of the game are applied, each before the next; they may end the game        |

Games share nothing but the map and their rules' arguments: they may be played in any order and on several threads.
"""

from __future__ import annotations

from gamms.core import moves, rules

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
        movers: their agents as they move.
        first: the first of their rules, if `has_rules`.
        until: (games,) a game is played until so many turns of it are.
    """

    def __init__(
        self, games: rules.Games, movers: moves.Movers, first: rules.Rule | None, until: memoryview[int]
    ) -> None:
        self.games = games
        self.movers = movers
        self.first = first
        self.has_rules = first is not None
        self.until = until


def play_turn(p: Player, game: int) -> int:
    """Play one turn of a game."""
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
