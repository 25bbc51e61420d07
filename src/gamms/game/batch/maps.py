"""The draw of each game's map, and the engine for games on several maps that are played one after the other."""

from collections.abc import Callable, Hashable, Mapping, Sequence
from contextlib import ExitStack
from typing import Any

import numpy as np

from gamms import kernels
from gamms.game.batch.columns import PlayedGame
from gamms.game.batch.given import OutsideActions
from gamms.game.batch.one_by_one import SequentialEngine
from gamms.game.batch.view import ArrayView
from gamms.game.result import Result
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray

_PURPOSE = "map"


def drawn_maps(seeds: Sequence[int], num_maps: int) -> IntArray:
    """Return the number of the map that each seed draws, (seeds,)."""
    if num_maps == 1:
        return np.zeros(len(seeds), np.int64)
    purposes = np.array([kernels.purpose_key(seed, _PURPOSE) for seed in seeds], np.uint64)
    bits = kernels.draw_bits_rows(purposes, kernels.name_keys([_PURPOSE]), 0)
    return kernels.below_many(bits, num_maps)


class SequentialMapsEngine:
    """Plays games on several maps one after the other, with one engine for each map.

    Each engine numbers all games of the batch, and plays the games on its map.

    Args:
        engines: the engine of each map.
        map_of: (games,) the number of the map of each game.

    Attributes:
        current: the number of the map of the game that was played last.
    """

    functions: tuple[Callable[..., object], ...] = ()  # the functions called for many games at once
    calls_each = may_leave = False

    def __init__(self, engines: Sequence[SequentialEngine], map_of: IntArray) -> None:
        self._engines = engines
        self._map_of = map_of
        self.current = 0
        for number, engine in enumerate(engines):
            engine.leave(np.flatnonzero(map_of != number))

    def release(self) -> None:
        """Restore the contexts to their state before games were played in them."""
        for engine in self._engines:
            engine.release()

    @property
    def loaded(self) -> int | None:
        """The number of the game in the context that played last; None: it holds no game."""
        return self._engines[self.current].loaded

    def start(self, games: IntArray, seeds: Sequence[int], maps: IntArray) -> None:
        """Reset games to their start.

        Args:
            games: the numbers of the games.
            seeds: one seed for each game.
            maps: (games,) the numbers of their new maps.
        """
        before = self._map_of[games]
        self._map_of[games] = maps
        for number, engine in enumerate(self._engines):
            engine.leave(games[(before == number) & (maps != number)])
            which = np.flatnonzero(maps == number)
            engine.start(games[which], [seeds[place] for place in which.tolist()])

    # -- playing ------------------------------------------------------------------------------------------------

    def step(self, given: Mapping[Hashable, OutsideActions]) -> None:
        """Play one turn of all games that are not over; if one of several games raises, the turn is undone in all."""
        playing = np.flatnonzero(~self.is_over)
        by_map = [playing[self._map_of[playing] == number] for number in range(len(self._engines))]
        for engine, games in zip(self._engines, by_map, strict=True):
            engine.check(given, games)
        with ExitStack() as stack:
            for engine, games in zip(self._engines, by_map, strict=True):
                stack.callback(engine.return_to_shown)
                if len(playing) > 1:  # NOTE: a snapshot for each turn would slow one game down
                    stack.enter_context(engine.undoing_after_error(games))
            for games in by_map:
                for game in games.tolist():
                    self.step_game(game, given)

    def step_game(self, game: int, given: Mapping[Hashable, OutsideActions]) -> None:
        """Play one turn of one game."""
        self._stepping(game).step_game(game, given)

    def run(self, game: int) -> None:
        """Play one game to its end."""
        self._stepping(game).run(game)

    def can_show(self, game: int) -> bool:
        """Return whether `show` can point a context at a game: it continues, or its final state is loaded or saved."""
        return self._of(game).can_show(game)

    def show(self, game: int) -> PlayedGame:
        """Point the context of a game's map at the game, now and after each later turn."""
        return self._stepping(game).show(game)

    def return_to_shown(self) -> None:
        """Point the contexts at the games last chosen by `show`, if any."""
        for engine in self._engines:
            engine.return_to_shown()

    def ran_from(self, game: int) -> int | None:
        """Return the number of turns a game had when `run` played it to its end; None: `run` did not play it."""
        return self._of(game).ran_from.get(game)

    def _stepping(self, game: int) -> SequentialEngine:
        self.current = int(self._map_of[game])
        return self._engines[self.current]

    # -- seeing -------------------------------------------------------------------------------------------------

    @property
    def is_over(self) -> BoolArray:
        """Whether each game has ended, (games,)."""
        is_over: BoolArray = self._of_all([engine.is_over for engine in self._engines])
        return is_over

    def turns(self) -> IntArray:
        """Return the number of turns played, (games,)."""
        turns: IntArray = self._of_all([engine.turns() for engine in self._engines])
        return turns

    def scores(self) -> dict[Any, Any]:
        """Return the scores of all games: key -> (games,)."""
        found = [engine.scores() for engine in self._engines]
        nothing = np.zeros(len(self._map_of))
        keys = dict.fromkeys(key for scores in found for key in scores)
        return {key: self._of_all([scores.get(key, nothing) for scores in found]) for key in keys}

    def _of_all(self, columns: Sequence[Any]) -> Any:
        """Return one column (games,) from the engines' columns: each game takes the entry of its map's engine."""
        return np.stack(columns)[self._map_of, np.arange(len(self._map_of))]

    def over(self, game: int) -> dict[str, Any] | None:
        """Return the reason, winner and truncation of a game that has ended; None: it continues."""
        return self._of(game).over(game)

    def result(self, game: int) -> Result:
        """Return the result of a game so far."""
        return self._of(game).result(game)

    def _of(self, game: int) -> SequentialEngine:
        return self._engines[int(self._map_of[game])]

    def view(self, agents: IntArray, number: int) -> ArrayView:
        """Return a view of agents in the games on the map with this number."""
        return self._engines[number].view(agents, np.flatnonzero(self._map_of == number))
