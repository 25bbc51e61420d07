"""The work of a worker: play games of one variant, and return rows of plain values."""

import json
import pickle
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from time import perf_counter
from typing import Any, NamedTuple

from gamms.errors import BadValue, TooLarge
from gamms.experiment.variants import Variant, find_other_module, list_undeclared, watch_files
from gamms.game.result import Result
from gamms.limits import allowing
from gamms.plain import Plain, as_json, to_plain
from gamms.scenario import Scenario
from gamms.text import make_printable_line, reason, remove_addresses

Row = dict[str, Plain]
Collect = Mapping[str, Callable[[Result], Any]]
Series = dict[str, dict[str, list[Plain]]]
"""What the collectors of a game have collected: name of a collector -> its columns `turn`, `value`, and `agent`."""

_FEW = 2  # largest number of games that are played without a batch


class ExperimentSettings(NamedTuple):
    """Settings shared by all games of an experiment.

    Attributes:
        scenario: the scenario, without the changes of variants.
        collect: name -> function of the result of a game.
        max_memory: the bytes of memory that a step may take.
        code: the files of code in the folder of the scenario that the digests of rows cover, and their SHA-256, by
            which a worker knows that they have changed.
    """

    scenario: Scenario
    collect: dict[str, Callable[[Result], Any]]
    max_memory: int
    code: Mapping[str, str]


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
    """The result of a task.

    Attributes:
        rows: the row of each seed.
        series: the collected values of each seed.
        seconds: the seconds that the task took.
        undeclared: the files in the folder of the scenario that were opened, and that it does not name.
    """

    rows: list[Row]
    series: list[Series]
    seconds: float
    undeclared: set[str]


class VariantPlayer:
    """Plays the games of one variant."""

    def __init__(self, settings: ExperimentSettings, variant: Variant) -> None:
        self._settings = settings
        self._strategies = variant.strategies
        self._scenario = variant.apply_to(settings.scenario)

    def play(self, seeds: Sequence[int]) -> FinishedTask:
        """Play games and return their rows; a game that raises becomes a row with an error."""
        begin = perf_counter()
        with allowing(self._settings.max_memory), watch_files() as opened:
            played = self._play_in_arrays(seeds) if len(seeds) >= _FEW else None
            played = [self._play_alone(seed) for seed in seeds] if played is None else played
        other = find_other_module(self._scenario.folder, self._settings.code)
        if other is not None:
            error = (
                f"The game has loaded {other} from the folder of the scenario, which the digest of its row does not "
                "cover: keep code in .py files that are there before play, and not in hidden or linked folders."
            )
            played = [({"error": error}, {}) for _ in seeds]
        undeclared = list_undeclared(self._scenario, opened)
        seconds = perf_counter() - begin
        return FinishedTask([row for row, _ in played], [series for _, series in played], seconds, undeclared)

    def _play_alone(self, seed: int) -> tuple[Row, Series]:
        try:
            return self._read(self._scenario.play(seed, self._strategies))
        except (Exception, SystemExit) as error:  # noqa: BLE001 - which code of users may raise; it is in the row
            return {"error": _describe_error(error)}, {}

    def _read(self, result: Result) -> tuple[Row, Series]:
        return make_row(result, self._settings.collect), collect_series(result)

    def _play_in_arrays(self, seeds: Sequence[int]) -> list[tuple[Row, Series]] | None:
        """Return the rows and series of games played as a batch; None: a game has raised."""
        try:
            with self._scenario.batch(seeds=seeds, strategies=self._strategies) as games:
                games.run(warn=False)
                return [self._read(games.result(number)) for number in range(len(seeds))]
        except TooLarge:
            half = len(seeds) // 2
            parts = self.play(seeds[:half]), self.play(seeds[half:])
            return [one for part in parts for one in zip(part.rows, part.series, strict=True)]
        except (Exception, SystemExit):  # noqa: BLE001 - played one by one, the game that raises is a row
            return None


def play(task: Task) -> FinishedTask:
    """Play the games of a task in a worker."""
    return _make_player(task.settings, task.variant).play(task.seeds)


@lru_cache(maxsize=16)
def _make_player(settings: bytes, variant: bytes) -> VariantPlayer:
    return VariantPlayer(load_settings(settings), pickle.loads(variant))  # noqa: S301 - our own


@lru_cache(maxsize=2)
def load_settings(settings: bytes) -> Any:
    """Return unpickled settings; each process loads the map of their scenario once."""
    return pickle.loads(settings)  # noqa: S301 - our own


def pickle_value(value: object, name: str) -> bytes:
    """Return a pickled value, for other processes.

    Raises:
        BadValue: the value cannot be pickled; the message names it.
    """
    try:
        return pickle.dumps(value)
    except Exception as error:
        raise BadValue(
            f"{name} cannot be sent to other processes, {make_printable_line(remove_addresses(reason(error)))}. "
            "Define it with def or class at the top of a module, or play in this process: without workers and executor."
        ) from error


def make_row(result: Result, collect: Collect) -> Row:
    """Return the row of a game, with the values of the `collect` functions."""
    row = {name: _make_plain(value) for name, value in result.row().items()}
    row |= {f"collector.{name}": _make_plain(function(result)) for name, function in collect.items()}
    return {**row, "error": None}


def collect_series(result: Result) -> Series:
    """Return what the collectors of a game have collected, as plain values."""
    return {
        name: {column: [as_json(to_plain(value)) for value in values] for column, values in table.items()}
        for name, table in result.collected.items()
    }


def _make_plain(value: object) -> Plain:
    """Return a scalar unchanged, and any other value as JSON."""
    value = as_json(to_plain(value))
    is_scalar = value is None or isinstance(value, (bool, int, float, str))
    return value if is_scalar else json.dumps(value, ensure_ascii=False)


def _describe_error(error: BaseException) -> str:
    """Return an error as one line that is the same in every process."""
    notes = getattr(error, "__notes__", ())
    cause = "" if error.__cause__ is None else f" ({type(error.__cause__).__name__}: {reason(error.__cause__)})"
    text = " ".join([f"{type(error).__name__}: {reason(error)}{cause}", *notes])
    return make_printable_line(remove_addresses(text))
