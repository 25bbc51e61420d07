"""The work of a worker: play games of one variant, and return rows of plain values."""

import json
import pickle
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from time import perf_counter
from typing import Any, NamedTuple

from gamms.errors import BadValue, TooLarge
from gamms.experiment.variants import Variant
from gamms.game.result import Result
from gamms.limits import allowing
from gamms.plain import Plain, as_json, to_plain
from gamms.scenario import Scenario
from gamms.text import printable_line, reason, without_address

Row = dict[str, Plain]
Collect = Mapping[str, Callable[[Result], Any]]

_FEW = 2  # largest number of games that are played without a batch


class ExperimentSettings(NamedTuple):
    """Settings shared by all games of an experiment."""

    scenario: Scenario
    collect: dict[str, Callable[[Result], Any]]
    max_memory: int


class Task(NamedTuple):
    """Games of one variant, for any process.

    Attributes:
        settings: pickled `ExperimentSettings`.
        variant: a pickled `Variant`.
        seeds: the seeds of the games.
    """

    settings: bytes
    variant: bytes
    seeds: tuple[int, ...]


class FinishedTask(NamedTuple):
    """The result of a task: a row for each seed, and the seconds that the task took."""

    rows: list[Row]
    seconds: float


class VariantPlayer:
    """Plays the games of one variant."""

    def __init__(self, settings: ExperimentSettings, variant: Variant) -> None:
        self._settings = settings
        self._strategies = variant.strategies
        self._scenario = variant.of(settings.scenario)

    def play(self, seeds: Sequence[int]) -> FinishedTask:
        """Play games and return their rows; a game that raises becomes a row with an error."""
        begin = perf_counter()
        with allowing(self._settings.max_memory):
            rows = self._in_arrays(seeds) if len(seeds) >= _FEW else None
            rows = [self._alone(seed) for seed in seeds] if rows is None else rows
        return FinishedTask(rows, perf_counter() - begin)

    def _alone(self, seed: int) -> Row:
        try:
            return row_of(self._scenario.play(seed, self._strategies), self._settings.collect)
        except (Exception, SystemExit) as error:  # noqa: BLE001 - which code of users may raise; it is in the row
            return {"error": _error(error)}

    def _in_arrays(self, seeds: Sequence[int]) -> list[Row] | None:
        """Return the rows of games played as a batch; None: a game has raised."""
        try:
            with self._scenario.batch(seeds=seeds, strategies=self._strategies) as games:
                games.run(warn=False)
                return [row_of(games.result(number), self._settings.collect) for number in range(len(seeds))]
        except TooLarge:
            half = len(seeds) // 2
            return [*self.play(seeds[:half]).rows, *self.play(seeds[half:]).rows]
        except (Exception, SystemExit):  # noqa: BLE001 - played one by one, the game that raises is a row
            return None


def play(task: Task) -> FinishedTask:
    """Play the games of a task in a worker."""
    return _player(task.settings, task.variant).play(task.seeds)


@lru_cache(maxsize=16)
def _player(settings: bytes, variant: bytes) -> VariantPlayer:
    return VariantPlayer(loaded(settings), pickle.loads(variant))  # noqa: S301 - our own


@lru_cache(maxsize=2)
def loaded(settings: bytes) -> Any:
    """Return unpickled settings; each process loads the map of their scenario once."""
    return pickle.loads(settings)  # noqa: S301 - our own


def pickled(value: object, name: str) -> bytes:
    """Return a pickled value, for other processes.

    Raises:
        BadValue: the value cannot be pickled; the message names it.
    """
    try:
        return pickle.dumps(value)
    except Exception as error:
        raise BadValue(
            f"{name} cannot be sent to other processes, {printable_line(without_address(reason(error)))}. Define it "
            "with def or class at the top of a module, or play in this process: without workers and executor."
        ) from error


def row_of(result: Result, collect: Collect) -> Row:
    """Return the row of a game, with the values of the `collect` functions."""
    row = {name: _plain(value) for name, value in result.row().items()}
    row |= {f"collector.{name}": _plain(function(result)) for name, function in collect.items()}
    return {**row, "error": None}


def _plain(value: object) -> Plain:
    """Return a scalar unchanged, and any other value as JSON."""
    value = as_json(to_plain(value))
    is_scalar = value is None or isinstance(value, (bool, int, float, str))
    return value if is_scalar else json.dumps(value, ensure_ascii=False)


def _error(error: BaseException) -> str:
    """Return an error as one line that is the same in every process."""
    notes = getattr(error, "__notes__", ())
    cause = "" if error.__cause__ is None else f" ({type(error.__cause__).__name__}: {reason(error.__cause__)})"
    text = " ".join([f"{type(error).__name__}: {reason(error)}{cause}", *notes])
    return printable_line(without_address(text))
