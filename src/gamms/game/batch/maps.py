"""Plays the games of a batch that have several maps: each game is played by the engine of its map."""

from collections.abc import Callable, Hashable, Mapping, Sequence
from contextlib import ExitStack
from itertools import zip_longest
from typing import Any

import numpy as np

from gamms import kernels
from gamms.game.batch.arrays import ArrayEngine, Numbers
from gamms.game.batch.columns import PlayedGame
from gamms.game.batch.given import Given
from gamms.game.batch.one_by_one import OneByOneEngine
from gamms.game.batch.state import NotTakenUp
from gamms.game.batch.view import ArrayView
from gamms.game.result import Result
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray

_PURPOSE = "map"


def drawn_maps(seeds: Sequence[int], num_maps: int) -> IntArray:
    """Return the number of the map that each game draws by its seed alone, (seeds,)."""
    if num_maps == 1:
        return np.zeros(len(seeds), np.int64)
    purposes = np.array([kernels.purpose_key(seed, _PURPOSE) for seed in seeds], np.uint64)
    bits = kernels.draw_bits_rows(purposes, kernels.name_keys([_PURPOSE]), 0)
    return kernels.below_many(bits, num_maps)


class MapEngines:
    """The engines of the maps of a batch, and which of them plays each game.

    Each engine has a row for every game. Games on other maps are absent from it: it does not play them.

    Args:
        engines: of the maps: all play in the core, or all play one game after the other.
        map_of: (games,) the number of the map of each game.

    Attributes:
        in_core: the engines, if they play in the core.
        one_by_one: the engines, if they play one game after the other.
        map_of: see above.
        current: the number of the map of the game that was played last; of games in the core 0.
    """

    def __init__(self, engines: Sequence[ArrayEngine] | Sequence[OneByOneEngine], map_of: IntArray) -> None:
        self.in_core = [engine for engine in engines if isinstance(engine, ArrayEngine)]
        self.one_by_one = [engine for engine in engines if isinstance(engine, OneByOneEngine)]
        self._engines: list[ArrayEngine | OneByOneEngine] = [*engines]
        self.map_of = map_of
        self.current = 0
        for number, engine in enumerate(self._engines):
            engine.leave(np.flatnonzero(map_of != number))

    def __len__(self) -> int:
        return len(self._engines)

    @property
    def functions(self) -> list[Callable[..., object]]:
        """The array functions that the engines call."""
        return [function for engine in self.in_core for function in engine.functions]

    @property
    def calls_each(self) -> bool:
        """Whether plain functions are called game by game, in the core."""
        return any(engine.calls_each for engine in self.in_core)

    def release(self) -> None:
        """Have contexts as they were before plain functions were called."""
        for engine in self.in_core:
            engine.release()

    @property
    def loaded(self) -> int | None:
        """The number of the game that a context has, of those that are played one by one; None: of none."""
        return self.one_by_one[self.current].loaded if self.one_by_one else None

    def start(self, games: IntArray, seeds: Sequence[int], maps: IntArray, nodes: IntArray) -> None:
        """Begin games again.

        Args:
            games: their numbers.
            seeds: one for each of them.
            maps: (games,) the numbers of the maps that they are on from now on.
            nodes: (games, agents) the ids of the nodes where agents begin; not read in games that are played one by
                one.
        """
        before = self.map_of[games]
        self.map_of[games] = maps
        for number, engine in enumerate(self._engines):
            engine.leave(games[(before == number) & (maps != number)])
            which = np.flatnonzero(maps == number)
            if not len(which):
                continue
            own = [seeds[place] for place in which.tolist()]
            if isinstance(engine, ArrayEngine):
                engine.start(games[which], own, nodes[which])
            else:
                engine.start(games[which], own)

    # -- playing ------------------------------------------------------------------------------------------------

    def play(self, turns: int, threads: int) -> int:
        """Play so many turns of the games that are not over; return how many were played at most.

        Only in the core, and where there are no array functions.
        """
        return max(engine.play(turns, threads) for engine in self.in_core)

    def step(self, given: Mapping[Hashable, Given], numbers: Numbers | None = None, threads: int = 1) -> None:
        """Play one turn of all games that are not over; see `ArrayEngine.phases`."""
        if self.one_by_one:
            self._step_one_by_one(given)
            return
        undoing = [engine.checkpoint() for engine in self.in_core] if (~self.is_over).sum() > 1 else []
        phases = [engine.phases(given, numbers, threads) for engine in self.in_core]
        try:
            for _ in zip_longest(*phases):  # the games of all maps come to the end of a phase before the next begins
                pass
        except NotTakenUp:
            raise
        except BaseException:
            for undo in undoing:
                undo()
            raise

    def _step_one_by_one(self, given: Mapping[Hashable, Given]) -> None:
        """Play one turn of all games that are not over; of several none is played where one raises."""
        playing = np.flatnonzero(~self.is_over)
        by_map = [playing[self.map_of[playing] == number] for number in range(len(self))]
        for engine, games in zip(self.one_by_one, by_map, strict=True):
            engine.check(given, games)
        with ExitStack() as stack:
            for engine, games in zip(self.one_by_one, by_map, strict=True):
                stack.callback(engine.return_to_shown)
                if len(playing) > 1:  # NOTE: a snapshot for each turn would slow one game down
                    stack.enter_context(engine.undoing_after_error(games))
            for games in by_map:
                for game in games.tolist():
                    self.step_game(game, given)

    def step_game(self, game: int, given: Mapping[Hashable, Given]) -> None:
        """Play one turn of a game that is played by itself."""
        self._stepping(game).step_game(game, given)

    def run(self, game: int) -> None:
        """Play a game that is played by itself to its end."""
        self._stepping(game).run(game)

    def show(self, game: int) -> PlayedGame:
        """Point the context of the map of a game at it, and point it there again after each turn."""
        return self._stepping(game).show(game)

    def return_to_shown(self) -> None:
        """Point contexts at the games that they were pointed at by `show`, if they were."""
        for engine in self.one_by_one:
            engine.return_to_shown()

    def ran_from(self, game: int) -> int | None:
        """Return how many turns a game had when it was played to its end at once; None: it was not."""
        return self.one_by_one[self.map_of[game]].ran_from.get(game) if self.one_by_one else None

    def _stepping(self, game: int) -> OneByOneEngine:
        self.current = int(self.map_of[game])
        return self.one_by_one[self.current]

    # -- seeing -------------------------------------------------------------------------------------------------

    @property
    def is_over(self) -> BoolArray:
        """Which games have ended, (games,)."""
        is_over: BoolArray = self._of_all([engine.is_over for engine in self._engines])
        return is_over

    def turns(self) -> IntArray:
        """Return how many turns were played, (games,)."""
        turns: IntArray = self._of_all([engine.turns() for engine in self._engines])
        return turns

    def scores(self) -> dict[Any, Any]:
        """Return the scores of all games: key -> (games,)."""
        found = [engine.scores() for engine in self._engines]
        if len(found) == 1:
            return found[0]
        nothing = np.zeros(len(self.map_of))
        keys = dict.fromkeys(key for scores in found for key in scores)
        return {key: self._of_all([scores.get(key, nothing) for scores in found]) for key in keys}

    def _of_all(self, columns: Sequence[Any]) -> Any:
        """Return one column (games,) of those of the engines: each game has the entry of its map's engine."""
        if len(columns) == 1:
            return columns[0]
        return np.stack(columns)[self.map_of, np.arange(len(self.map_of))]

    def over(self, game: int) -> dict[str, Any] | None:
        """Return how a game has ended; None: it goes on."""
        return self._of(game).over(game)

    def result(self, game: int) -> Result:
        """Return the result of a game so far."""
        return self._of(game).result(game)

    def _of(self, game: int) -> ArrayEngine | OneByOneEngine:
        return self._engines[int(self.map_of[game])]

    def view(self, agents: IntArray, number: int) -> ArrayView:
        """Return what agents observe in the games on the map of this number."""
        return self._engines[number].view(agents, np.flatnonzero(self.map_of == number))
