"""The table of a tournament: points and faults, ratings, the pay-off matrix, its cycles and its Nash mixture."""

from collections.abc import Sequence
from itertools import combinations, permutations
from typing import NamedTuple

import numpy as np

from gamms import kernels
from gamms.arguments import as_items, as_known
from gamms.experiment.statistics import Interval, mean_interval
from gamms.extras import needing
from gamms.text import printable_line
from gamms.tournament.games import Row

WIN, DRAW = 1.0, 0.5


class Standing(NamedTuple):
    """What an entry has come to.

    Attributes:
        entry: its name.
        points: 1 for a win, 1/2 for a draw.
        games: that it has played.
        wins, draws, losses: of these.
        faults: kind of fault -> how many games it has lost by it.
    """

    entry: str
    points: float
    games: int
    wins: int
    draws: int
    losses: int
    faults: dict[str, int]


class Rating(NamedTuple):
    """How strong an entry is: a normal distribution with the mean `mu` and the standard deviation `sigma`."""

    entry: str
    mu: float
    sigma: float


class Payoff(NamedTuple):
    """How two entries did against each other, as the first of them sees it.

    Attributes:
        points: of a game: `value`, the mean, and `low` and `high`, its 95 % interval over the seeds, of each of which
            both sides' games count as one.
        score: by how much its team's score was higher, likewise.
        games: that they have played.
    """

    points: Interval
    score: Interval
    games: int


class Cycle(NamedTuple):
    """Three entries of which each beats the next one, and the last the first.

    Attributes:
        entries: their names.
        is_certain: whether all three intervals lie above 1/2.
    """

    entries: tuple[str, str, str]
    is_certain: bool


def points_of(row: Row) -> dict[str, float]:
    """Return the points of both entries of a game: a fault loses, and so do both if both have one."""
    if row["winner"] is None:
        return {entry: 0.0 if team in row["faults"] else DRAW for team, entry in row["entries"].items()}
    return {entry: WIN if team == row["winner"] else 0.0 for team, entry in row["entries"].items()}


class Table:
    """What came of a tournament. `print(table)` shows the ranking.

    Args:
        rows: of all games, in the order of the plan.
        entries: the names of the entries.

    Attributes:
        rows: see above.
        entries: see above.
        not_enforced: what of the limits the system could not enforce, in words.
        not_ready: entry -> why it cannot play when it was tried before the first game.
    """

    def __init__(self, rows: Sequence[Row], entries: Sequence[str]) -> None:
        self.rows = list(rows)
        self.entries = as_items(entries, "entries", "names")
        self.not_enforced = list[str]()
        self.not_ready = dict[str, str]()
        for name in {entry for row in self.rows for entry in row["entries"].values()}:
            as_known(name, "entry", self.entries)
        self._payoffs: dict[tuple[str, str], Payoff] | None = None

    def standings(self) -> list[Standing]:
        """Return the entries, the best first: by points per game, then by name."""
        points: dict[str, list[float]] = {name: [] for name in self.entries}
        faults: dict[str, dict[str, int]] = {name: {} for name in self.entries}
        for row in self.rows:
            for entry, one in points_of(row).items():
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
        """Return the ratings by the Plackett-Luce model of openskill, the highest first by `mu - 3 sigma`.

        Games count seed by seed. All begin at 25 with a deviation of 25/3. A game in which both entries have a fault
        does not count.

        Weng and Lin, A Bayesian Approximation Method for Online Ranking, JMLR 12, 2011.

        Raises:
            MissingExtra: openskill is not installed.
        """
        with needing("A rating", "tournament"):
            from openskill.models import PlackettLuce
        model = PlackettLuce()
        known = {name: model.rating(name=name) for name in self.entries}
        places = {seed: place for place, seed in enumerate(dict.fromkeys(row["seed"] for row in self.rows))}
        for row in sorted(self.rows, key=lambda one: (one["round"], places[one["seed"]])):
            points = points_of(row)
            if sum(points.values()) == 0.0:
                continue
            rated = model.rate([[known[name]] for name in points], scores=list(points.values()))
            known |= {name: team[0] for name, team in zip(points, rated, strict=True)}
        found = [Rating(name, float(one.mu), float(one.sigma)) for name, one in known.items()]
        return sorted(found, key=lambda one: (3.0 * one.sigma - one.mu, one.entry))

    def payoffs(self) -> dict[tuple[str, str], Payoff]:
        """Return how each two entries that have met did, in both orders, with 95 % intervals.

        Raises:
            MissingExtra: SciPy is not installed.
        """
        if self._payoffs is None:
            games: dict[tuple[str, str], dict[int, list[tuple[float, float]]]] = {}
            for row in self.rows:
                points, scores = points_of(row), {row["entries"][team]: one for team, one in row["scores"].items()}
                for pair in permutations(points):
                    first, second = pair[0], pair[1]
                    value = points[first], scores[first] - scores[second]
                    games.setdefault((first, second), {}).setdefault(row["seed"], []).append(value)
            self._payoffs = {pair: _payoff(by_seed) for pair, by_seed in sorted(games.items())}
        return self._payoffs

    def cycles(self) -> list[Cycle]:
        """Return all threes of entries of which each beats the next one, by points of their games."""
        payoffs, found = self.payoffs(), []
        for first, *rest in combinations(sorted(self.entries), 3):
            for second, third in (rest, rest[::-1]):
                ways = [payoffs.get(pair) for pair in ((first, second), (second, third), (third, first))]
                known = [one.points for one in ways if one is not None]
                if len(known) == 3 and all(one.value > DRAW for one in known):
                    found.append(Cycle((first, second, third), all(one.low > DRAW for one in known)))
        return found

    def nash_mixture(self) -> dict[str, float] | None:
        """Return a Nash equilibrium of the game of choosing an entry: name -> with which probability.

        The pay-offs are half the differences of the points per game of both, which makes the game zero-sum and the same
        for both players. An entry in it need not be high in the table. None: some two have not met.
        """
        payoffs, names = self.payoffs(), self.entries
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
            lines.append((str(rank), printable_line(one.entry), f"{one.points:g}", *map(str, numbers), faults))
        widths = [max(len(line[column]) for line in lines) for column in range(len(header))]
        text = "\n".join(
            "  ".join(
                cell.ljust(width) if column in (1, 7) else cell.rjust(width)
                for column, (cell, width) in enumerate(zip(line, widths, strict=True))
            ).rstrip()
            for line in lines
        )
        notes = [f"{printable_line(name)} cannot play: {reason}" for name, reason in self.not_ready.items()]
        if self.not_enforced:
            notes.append(f"Not enforced on this system: {'; '.join(self.not_enforced)}.")
        return "\n".join([text, *notes])


def _payoff(by_seed: dict[int, list[tuple[float, float]]]) -> Payoff:
    points, scores = (
        mean_interval([float(np.mean([one[of] for one in some])) for some in by_seed.values()]) for of in (0, 1)
    )
    return Payoff(points, scores, sum(map(len, by_seed.values())))
