"""Strategies and plans that differ between the games of a batch, because a scenario makes them from the seed."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from gamms.game.batch.columns import PlayedGame
from gamms.game.batch.state import NotTakenUp
from gamms.game.settings import Plan
from gamms.ir.graph import IntArray
from gamms.text import as_code

Decider = tuple[str, str]
"""What a function decides for: ("agent", name), or ("team", team) if it is a plan."""
MakeDeciders = Callable[[int], Mapping[Decider, Any]]
"""Resets a game with a seed, and returns its strategies and plans that differ with the seed."""


class OwnFunction:
    """A strategy, or the plan of a team, that is another function in each game.

    Attributes:
        of_game: the function of each game.
        number: the game for which it is called.
    """

    def __init__(self, num_games: int) -> None:
        self.of_game: list[Any] = [None] * num_games
        self.number = 0

    def __call__(self, asked: Any) -> Any:
        """Call the function of the game."""
        return self.of_game[self.number](asked)

    def __repr__(self) -> str:
        """Name the function of the game."""
        return as_code(some_function(self))


def function_in(decider: Any, game: int) -> Any:
    """Return the function that decides in a game."""
    return decider.of_game[game] if isinstance(decider, OwnFunction) else decider


def some_function(decider: Any) -> Any:
    """Return the function that decides in some game."""
    return next(filter(None, decider.of_game)) if isinstance(decider, OwnFunction) else decider


class OwnFunctions:
    """The strategies and plans of games on one map that differ between games.

    Args:
        game: the game in whose context they are called.
        make: makes those of a seed.
        seeds: of all games of the batch.
    """

    def __init__(self, game: PlayedGame, make: MakeDeciders, seeds: Sequence[int]) -> None:
        self._game = game
        self._make = make
        self._seed = seeds[0]
        self._made_for: list[int | None] = [None] * len(seeds)
        self._own: dict[Decider, OwnFunction] = {}
        self._first: Mapping[Decider, Any] = {}  # of the seed of the context

    def take(self, games: IntArray, seeds: Sequence[int]) -> None:
        """Make the functions of some games; the context is not pointed at a game, and returns to its first seed.

        Raises:
            NotTakenUp: an agent has no strategy in one of the games, or a strategy with a `prepare`.
        """
        for number, seed in zip(games.tolist(), seeds, strict=True):
            if seed == self._made_for[number]:
                continue
            for decider, function in self._make(seed).items():
                if function is None or hasattr(function, "prepare"):
                    raise NotTakenUp(f"{as_code(function)}, with what it prepares in a game")
                own = self._own.setdefault(decider, OwnFunction(len(self._made_for)))
                own.of_game[number] = function
            self._made_for[number] = seed
        self._first = self._make(self._seed)

    def install(self) -> None:
        """Let agents and teams of the context decide by the functions of the game that it is pointed at."""
        self._decide_by(self._own)

    def remove(self) -> None:
        """Let agents and teams of the context decide by the functions of its seed."""
        self._decide_by(self._first)

    def _decide_by(self, functions: Mapping[Decider, Any]) -> None:
        plans = dict(self._game.plans)
        for (kind, name), function in functions.items():
            if kind == "team":
                plans[name] = Plan(function, plans[name].arrays)
            else:
                self._game.ctx.agent.agents[name].decide_by(function)
        self._game.plans = plans
