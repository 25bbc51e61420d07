"""Strategies and plans that differ between the games of a batch, because a scenario makes them from the seed."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from gamms.game.batch.columns import PlayedGame
from gamms.game.batch.state import NotInCore
from gamms.game.settings import Plan
from gamms.ir.graph import IntArray
from gamms.text import as_code

Decider = tuple[str, str]
"""The owner of a function: ("agent", name) for a strategy, ("team", team) for a plan."""
MakeDeciders = Callable[[int], Mapping[Decider, Any]]
"""Resets a game with a seed, and returns its strategies and plans that depend on the seed."""


class FunctionPerGame:
    """A strategy, or the plan of a team, with a different function in each game.

    Attributes:
        of_game: the function of each game; None: the game has none yet.
        number: the number of the game that a call is for.
    """

    def __init__(self, num_games: int) -> None:
        self.of_game: list[Any] = [None] * num_games
        self.number = 0

    def __call__(self, asked: Any) -> Any:
        """Call the function of the current game."""
        return self.of_game[self.number](asked)

    def __repr__(self) -> str:
        """Return the name of the first game's function that exists."""
        return as_code(some_function(self))


def function_in(decider: Any, game: int) -> Any:
    """Return the function of a strategy or plan in a game."""
    return decider.of_game[game] if isinstance(decider, FunctionPerGame) else decider


def some_function(decider: Any) -> Any:
    """Return the function of a strategy or plan in the first game that has one."""
    return next(filter(None, decider.of_game)) if isinstance(decider, FunctionPerGame) else decider


class FunctionsPerGame:
    """The strategies and plans that differ between the games on one map.

    Args:
        game: the game in whose context the functions are called.
        make: makes the functions of a seed.
        seeds: the seeds of all games of the batch.
    """

    def __init__(self, game: PlayedGame, make: MakeDeciders, seeds: Sequence[int]) -> None:
        self._game = game
        self._make = make
        self._seed = seeds[0]
        self._made_for: list[int | None] = [None] * len(seeds)
        self._own: dict[Decider, FunctionPerGame] = {}
        self._first: Mapping[Decider, Any] = {}  # of the seed of the context

    def take(self, games: IntArray, seeds: Sequence[int]) -> None:
        """Make the functions of games; afterwards, the context is reset with its first seed.

        The context must not be pointed at a game of the batch.

        Raises:
            NotInCore: an agent has no strategy in one of the games, or its strategy has a `prepare` method.
        """
        for number, seed in zip(games.tolist(), seeds, strict=True):
            if seed == self._made_for[number]:
                continue
            for decider, function in self._make(seed).items():
                if function is None or hasattr(function, "prepare"):
                    raise NotInCore(f"{as_code(function)}, with what it prepares in a game")
                own = self._own.setdefault(decider, FunctionPerGame(len(self._made_for)))
                own.of_game[number] = function
            self._made_for[number] = seed
        self._first = self._make(self._seed)

    def install(self) -> None:
        """Set the strategies and plans of the context to the `FunctionPerGame` objects of all games."""
        self._decide_by(self._own)

    def remove(self) -> None:
        """Set the strategies and plans of the context to the functions of its first seed."""
        self._decide_by(self._first)

    def _decide_by(self, functions: Mapping[Decider, Any]) -> None:
        plans = dict(self._game.plans)
        for (kind, name), function in functions.items():
            if kind == "team":
                plans[name] = Plan(function, plans[name].arrays)
            else:
                self._game.ctx.agent.agents[name].decide_by(function)
        self._game.plans = plans
