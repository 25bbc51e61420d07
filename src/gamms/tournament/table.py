"""The table of a tournament: points and faults, ratings, the pay-off matrix, its cycles and its Nash mixture."""

import math
from collections.abc import Sequence
from itertools import chain, combinations, permutations
from statistics import fmean
from typing import NamedTuple

import numpy as np

from gamms import kernels
from gamms.arguments import as_items, as_known
from gamms.experiment.statistics import Interval, estimate_mean, estimate_rate_of_seeds
from gamms.ir.graph import FloatArray
from gamms.text import make_printable_line
from gamms.tournament.games import Row, Run

WIN = 1.0
DRAW = 0.5
_RESAMPLES = 1_000
_SEED = 20
_CELLS = 1 << 22  # elements of an array of resamples
_MOST_STEPS = 100
_TOLERANCE = 1e-7  # of a step; the remaining error is about its square
_DIGITS = 6  # of Elo points, so that equal records have equal ratings
_POINTS = 400.0 / math.log(10.0)  # Elo points for a strength of 1


class Standing(NamedTuple):
    """The points, games and faults of an entry.

    Attributes:
        entry: the name of the entry.
        points: 1 for a win, 1/2 for a draw.
        games: the number of games.
        wins, draws, losses: the numbers of games won, drawn and lost.
        faults: kind of fault -> number of games lost by it.
    """

    entry: str
    points: float
    games: int
    wins: int
    draws: int
    losses: int
    faults: dict[str, int]


class Rating(NamedTuple):
    """The strength of an entry in Elo points.

    Attributes:
        entry: the name of the entry.
        elo: the rating; the mean of all entries is 0. An entry with 400 more than another is expected to get 10 points
            for each point of the other.
        low: the lower end of the 95 % interval over seeds; NaN if all seeds have the same results.
        high: the upper end of the interval.
    """

    entry: str
    elo: float
    low: float
    high: float


class Payoff(NamedTuple):
    """The results of two entries against each other, from the side of the first.

    Attributes:
        points: points per game: `value` is the mean, `low` and `high` its 95 % score interval (Wilson) over the seeds.
        score: the mean lead of its team's score, with its 95 % bootstrap interval over the seeds; `low` and `high` are
            NaN if all seeds give the same lead.
        games: the number of games of the two.
        seeds: the number of seeds; the games of both sides with one seed count as one piece of evidence.
    """

    points: Interval
    score: Interval
    games: int
    seeds: int


class Cycle(NamedTuple):
    """Three entries: the first beats the second, the second the third, and the third the first.

    Attributes:
        entries: their names.
        is_certain: whether all three intervals lie above 1/2.
    """

    entries: tuple[str, str, str]
    is_certain: bool


def count_points(row: Row) -> dict[str, float]:
    """Return the points of both entries of a game; an entry with a fault loses, even if both have one."""
    if row["winner"] is None:
        return {entry: 0.0 if team in row["faults"] else DRAW for team, entry in row["entries"].items()}
    return {entry: WIN if team == row["winner"] else 0.0 for team, entry in row["entries"].items()}


def identify_seed(row: Row) -> tuple[str | None, int]:
    """Return what games share if they begin alike: the run and the label."""
    return row.get("run"), row["seed"]


def list_notes(table: "Table") -> list[str]:
    """Return what a reader of a table has to know: entries that cannot play, given secrets, limits not enforced."""
    notes = [f"{make_printable_line(name)} cannot play: {reason}" for name, reason in table.not_ready.items()]
    notes += [f"The secret of the run {run['sha256']} was given." for run in table.runs if run["is_given"]]
    if table.not_enforced:
        notes.append(f"Not enforced on this system: {'; '.join(table.not_enforced)}.")
    return notes


class Table:
    """The results of a tournament. `print(table)` shows the ranking.

    Args:
        rows: the rows of all games, in the order of the schedule.
        entries: the names of the entries.

    Attributes:
        rows: see above.
        entries: see above.
        not_enforced: descriptions of the limits that the system could not enforce.
        not_ready: entry -> why it failed its trial before the first game.
        runs: the runs in which the games were played, with their secrets.
    """

    def __init__(self, rows: Sequence[Row], entries: Sequence[str]) -> None:
        self.rows = list(rows)
        self.entries = as_items(entries, "entries", "names")
        self.not_enforced = list[str]()
        self.not_ready = dict[str, str]()
        self.runs = list[Run]()
        for name in set(chain.from_iterable(row["entries"].values() for row in self.rows)):
            as_known(name, "entry", self.entries)
        self._payoffs: dict[tuple[str, str], Payoff] | None = None

    def standings(self) -> list[Standing]:
        """Return the standings of the entries, sorted by points per game, highest first, then by name."""
        points: dict[str, list[float]] = {name: [] for name in self.entries}
        faults: dict[str, dict[str, int]] = {name: {} for name in self.entries}
        for row in self.rows:
            for entry, one in count_points(row).items():
                points[entry].append(one)
            for team, kind in row["faults"].items():
                of = faults[row["entries"][team]]
                of[kind] = of.get(kind, 0) + 1
        found = []
        for name, some in points.items():
            counts = some.count(WIN), some.count(DRAW), some.count(0.0)
            found.append(Standing(name, sum(some), len(some), *counts, dict(sorted(faults[name].items()))))
        return sorted(found, key=lambda one: (-one.points / max(one.games, 1), one.entry))

    def ratings(self) -> list[Rating]:
        """Return Bradley-Terry ratings, sorted from the highest, with 95 % bootstrap intervals over seeds.

        The order of games does not matter. A draw is half a win for each, and a game in which both entries have a
        fault does not count. Each entry also draws one game against an imaginary opponent of average strength, so that
        an entry that has won all its games has a finite rating. If all entries have met equally often, the ratings
        have the order of the points.

        Bradley and Terry, Biometrika 39, 1952; Mease, The American Statistician 57, 2003 (the imaginary opponent);
        Hunter, The Annals of Statistics 32, 2004.
        """
        numbers = {name: number for number, name in enumerate(self.entries)}
        by_seed: dict[object, list[tuple[int, int, float]]] = {}
        for row in self.rows:
            points = count_points(row)
            games = by_seed.setdefault(identify_seed(row), [])
            if sum(points.values()) > 0.0:
                games += [(numbers[one], numbers[other], points[one]) for one, other in permutations(points)]
        won = np.zeros((len(by_seed), len(numbers), len(numbers)))
        for seed, games in zip(won, by_seed.values(), strict=True):
            for one, other, value in games:
                seed[one, other] += value
        found = zip(self.entries, _estimate_elo_intervals(won), strict=True)
        ratings = [Rating(name, *interval) for name, interval in found]
        return sorted(ratings, key=lambda one: (-one.elo, one.entry))

    def payoffs(self) -> dict[tuple[str, str], Payoff]:
        """Return (first, second) -> results of the first entry against the second, with 95 % intervals over seeds.

        Raises:
            MissingExtra: SciPy is not installed.
        """
        if self._payoffs is None:
            games: dict[tuple[str, str], dict[object, list[tuple[float, float]]]] = {}
            for row in self.rows:
                points = count_points(row)
                scores = {row["entries"][team]: one for team, one in row["scores"].items()}
                for pair in permutations(points):
                    first = pair[0]
                    second = pair[1]
                    value = points[first], scores[first] - scores[second]
                    games.setdefault((first, second), {}).setdefault(identify_seed(row), []).append(value)
            self._payoffs = {pair: _estimate_payoff(by_seed) for pair, by_seed in sorted(games.items())}
        return self._payoffs

    def cycles(self) -> list[Cycle]:
        """Return all cycles of three entries, each of which scores more than half the points against the next."""
        payoffs = self.payoffs()
        found = []
        for first, *rest in combinations(sorted(self.entries), 3):
            for second, third in (rest, rest[::-1]):
                ways = [payoffs.get(pair) for pair in ((first, second), (second, third), (third, first))]
                known = [one.points for one in ways if one is not None]
                if len(known) == 3 and all(one.value > DRAW for one in known):
                    found.append(Cycle((first, second, third), all(one.low > DRAW for one in known)))
        return found

    def nash_mixture(self) -> dict[str, float] | None:
        """Return a Nash equilibrium of the game of choosing an entry: name -> its probability.

        The pay-offs are half the differences of the points per game of both, which makes the game zero-sum and the same
        for both players. An entry in it need not be high in the table. None: some pair of entries has not met.
        """
        payoffs = self.payoffs()
        names = self.entries
        matrix = np.zeros((len(names), len(names)))
        for row, first in enumerate(names):
            for column, second in enumerate(names):
                if row != column:
                    if (first, second) not in payoffs:
                        return None
                    difference = payoffs[first, second].points.value - payoffs[second, first].points.value
                    matrix[row, column] = difference / 2.0
        return dict(zip(names, kernels.solve_matrix_games(matrix[None])[1][0].tolist(), strict=True))

    def __str__(self) -> str:
        header = ("", "entry", "points", "games", "won", "drawn", "lost", "faults")
        lines: list[tuple[str, ...]] = [header]
        for rank, one in enumerate(self.standings(), 1):
            faults = ", ".join(f"{count} {kind}" for kind, count in one.faults.items())
            numbers = (one.games, one.wins, one.draws, one.losses)
            lines.append((str(rank), make_printable_line(one.entry), f"{one.points:g}", *map(str, numbers), faults))
        widths = [max(len(line[column]) for line in lines) for column in range(len(header))]
        text = "\n".join(
            "  ".join(
                cell.ljust(width) if column in (1, 7) else cell.rjust(width)
                for column, (cell, width) in enumerate(zip(line, widths, strict=True))
            ).rstrip()
            for line in lines
        )
        return "\n".join([text, *list_notes(self)])


def _estimate_payoff(by_seed: dict[object, list[tuple[float, float]]]) -> Payoff:
    games = sum(map(len, by_seed.values()))
    points = [fmean(point for point, _ in some) for some in by_seed.values()]
    scores = [fmean(score for _, score in some) for some in by_seed.values()]
    return Payoff(estimate_rate_of_seeds(points, games), estimate_mean(scores), games, len(by_seed))


def _estimate_elo_intervals(won: FloatArray) -> list[Interval]:
    """Return the rating of each entry in Elo points, with its 95 % percentile bootstrap interval over seeds.

    The mean of all ratings is 0. If all resamples agree, the ends of an interval are NaN.

    Args:
        won: (seeds, entries, entries): the wins of one entry against another one; a draw counts half.
    """
    seeds, entries, _ = won.shape
    ratings = _POINTS * _estimate_strengths(won.sum(axis=0)[None])[0]
    if seeds < 2:
        return [_round_interval(one, np.nan, np.nan) for one in ratings]
    rng = np.random.default_rng(_SEED)
    counts = rng.multinomial(seeds, np.full(seeds, 1.0 / seeds), size=_RESAMPLES).astype(float)
    flat = won.reshape(seeds, -1)
    per_batch = max(1, _CELLS // flat.shape[1])
    resampled = []
    for first in range(0, _RESAMPLES, per_batch):
        sums = counts[first : first + per_batch] @ flat
        resampled.append(_POINTS * _estimate_strengths(sums.reshape(-1, entries, entries)))
    low, high = np.quantile(np.concatenate(resampled), (0.025, 0.975), axis=0)
    is_one_value = high - low < 1e-6
    low[is_one_value] = np.nan
    high[is_one_value] = np.nan
    return [_round_interval(*one) for one in zip(ratings, low, high, strict=True)]


def _round_interval(*values: float) -> Interval:
    return Interval(*(round(float(one), _DIGITS) + 0.0 for one in values))  # 0.0 for -0.0


def _estimate_strengths(won: FloatArray) -> FloatArray:
    """Return the logarithms of the strengths in the Bradley-Terry model, (tournaments, entries), with the mean 0.

    They maximize the likelihood in which each entry also draws one game against an opponent of strength 1 (Mease, The
    American Statistician 57, 2003), so they are finite and unique for any schedule. Newton's method with the damped
    steps of Sun and Tran-Dinh (Mathematical Programming 178, 2019, theorem 2) finds them from any start.

    Args:
        won: (tournaments, entries, entries): the wins of one entry against another one; a draw counts half.
    """
    played = won + won.transpose(0, 2, 1)
    diagonal = np.arange(won.shape[1])
    found = np.zeros(won.shape[:2])
    for _ in range(_MOST_STEPS):
        expected = _share(found[:, :, None] - found[:, None, :])
        of_average = _share(found)
        gradient = (won - played * expected).sum(axis=2) + 0.5 - of_average
        curvature = -played * expected * (1.0 - expected)
        curvature[:, diagonal, diagonal] = -curvature.sum(axis=2) + of_average * (1.0 - of_average)
        step = np.linalg.solve(curvature, gradient[:, :, None])[:, :, 0]
        reach = np.maximum(np.ptp(np.pad(step, ((0, 0), (1, 0))), axis=1), _TOLERANCE)
        found += step * (np.log1p(reach) / reach)[:, None]
        if reach.max() <= _TOLERANCE:
            break
    centered: FloatArray = found - found.mean(axis=1, keepdims=True)
    return centered


def _share(difference: FloatArray) -> FloatArray:
    """Return the logistic function of a difference of log-strengths."""
    share: FloatArray = 0.5 * (1.0 + np.tanh(0.5 * difference))
    return share
