"""The result of a run: a table with one row for each game; any game can be played again."""

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache
from itertools import chain, combinations
from statistics import fmean
from typing import TYPE_CHECKING, Any

import numpy as np

from gamms.arguments import as_count, as_float, as_int, as_items, as_known, as_positive
from gamms.context import Context
from gamms.errors import BadValue, UnknownName
from gamms.experiment import verification
from gamms.experiment.folders import FORMAT, SeriesLine, as_columns, list_series_lines, read_rows
from gamms.experiment.games import ExperimentSettings, Row, VariantPlayer
from gamms.experiment.statistics import (
    FEW_SEEDS,
    LEAST_P,
    Interval,
    PairedComparison,
    compare_pairs,
    compute_t_interval,
    correct_by_holm,
    count_seeds_needed,
    estimate_mean,
    estimate_rate_of_seeds,
    estimate_sobol_indices,
)
from gamms.experiment.tables import Table, plot
from gamms.experiment.variants import Variant, compute_digest, compute_first_digest, hash_code
from gamms.game.result import Result
from gamms.ir.tables import make_frame, make_table
from gamms.limits import max_memory
from gamms.scenario import Scenario, ScenarioError
from gamms.visual import Engine

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

_WINS = "wins."
_METRICS = ("score.", "collector.")  # prefixes of columns in a summary
_TOO_NARROW = f"Bootstrap intervals of means of up to {FEW_SEEDS} seeds may be too narrow"
_UNIT = "The unit of replication is the seed: games of one seed are averaged first."
_HAS_T = f"{_TOO_NARROW}; intervals of Student's t stand beside them."
_ENDS_OF_T = ("t_low", "t_high")


BySeed = dict[int, list[float]]  # seed -> the values of its games


class Rows(Sequence[Row]):
    """The rows of an experiment, in the order of its variants and seeds; `rows[0]` is a dict.

    A row has id, scenario (the digest of its variant), gamms, python and numpy (versions), each varied key, seed,
    reason, winner, truncated, turns, `score.<team>`, counts by team, `collector.<name>`, and error, which is None
    where the game was played to its end.

    Attributes:
        keys: the varied keys.
    """

    def __init__(
        self,
        rows: Sequence[Row],
        keys: Sequence[str],
        scenario: Scenario | Callable[[], Scenario] | None = None,
        variants: Sequence[Variant] = (),
        sample: tuple[Sequence[str], int] | None = None,
        series: Callable[[Iterable[str]], Iterable[SeriesLine]] | None = None,
        source: verification.Provenance | None = None,
    ) -> None:
        self._rows = list(rows)
        self.keys = tuple(keys)
        self._scenario = scenario
        self._variants = variants
        self._sample = sample  # keys and n of a sample for Sobol indices
        self._series = series  # yields what was collected in the games of some rows, by id
        self._source = source

    def __len__(self) -> int:
        return len(self._rows)

    def __getitem__(self, number: Any) -> Any:
        return self._rows[number]

    def __repr__(self) -> str:
        errors = len(self.errors())
        varied = f", varied: {', '.join(self.keys)}" if self.keys else ""
        return f"Rows({len(self)} games{varied}{f', {errors} with errors' if errors else ''})"

    def errors(self) -> list[Row]:
        """Return the rows of games that raised, or whose process died."""
        return [row for row in self._rows if row["error"] is not None]

    def table(self) -> dict[str, Any]:
        """Return all rows as a dict of columns; missing numbers are NaN."""
        return as_columns(self._rows, self.keys)

    def series(self, name: str) -> dict[str, Any]:
        """Return what a collector of the games has collected, see `ctx.game.collect`: a dict of columns, (values,).

        Columns: `id` (of the row), `turn`, `agent` (its name; None if the collector is of the game) and `value`.
        `rows.table()` has the settings and the seed of each id.

        Raises:
            UnknownName (KeyError): no game has a collector of this name.
            BadFile: a line of `series.jsonl` is not of a series.
        """
        lines = [*self._read_series_lines()]
        known = dict.fromkeys(line["name"] for line in lines)
        as_known(name, "collector", known)
        columns: dict[str, list[Any]] = {"id": [], "turn": [], "agent": [], "value": []}
        for line in lines:
            if line["name"] == name:
                count = len(line["turn"])
                each = {"id": [line["id"]] * count, "agent": line.get("agent", [None] * count)}
                for column, values in {**each, "turn": line["turn"], "value": line["value"]}.items():
                    columns[column] += values
        return make_table(columns)

    def sha256(self) -> str:
        """Return the SHA-256 of all rows without the columns of versions, in hexadecimal.

        The same games have the same digest on any machine, in any order and however they were played.
        """
        known = ({name: value for name, value in row.items() if value is not None} for row in self._rows)
        return verification.digest_of_lines(known)

    def root(self) -> str:
        """Return the root of the experiment, in hexadecimal: one SHA-256 to publish, by which others verify a folder.

        It covers the plan and the rows without versions, what collectors have collected, and the recordings (.ggr) in
        the folder. Like `sha256` it depends neither on the machine nor on the order in which games were played.

        Raises:
            BadValue: the rows have no plan: neither `run` nor `load` returned them.
            BadFile: the folder holds a link, or folders that are nested too deeply.
            TooLarge: the recordings have more bytes than is allowed.
        """
        return verification.find_root(self._get_source(), self._rows, self._read_series_lines())

    def verify(self, root: str | None = None, *, sample: int | None = None, seed: int = 0) -> verification.Verification:
        """Check the folder of these rows: its root, the files that follow from the rows, and some games, played again.

        Games are played only if the root is that of the folder, or if no root is given and `sample` is: they run the
        code that the plan names, as `play` does.

        Args:
            root: the published root; None: the folder is only compared with itself.
            sample: the number of rows that are played again, drawn by the root and `seed`; None: 10 if a root is given,
                otherwise none.
            seed: another seed draws other rows. One that a reviewer chooses cannot be foreseen by the author.

        Raises:
            BadType, BadValue: an argument is invalid, or the rows have no folder.
            BadFile: a file of the folder is not what a run writes.
            TooLarge: a file would take more memory than is allowed.
        """
        wanted = None if root is None else verification.as_root(root)
        usual = 0 if wanted is None else verification.SAMPLE
        count = usual if sample is None else as_count(sample, "sample", least=0)
        draw = as_int(seed, "seed")
        current = self._read_again()
        found = current.root()
        if wanted in (None, found):
            drawn = verification.draw_rows(found, draw, current, count)
            return verification.verify(current._get_source(), found, current, drawn, current._play_row)
        fault = f"The root of the folder is {found}, not {wanted}: something that it covers was altered."
        return verification.verify(current._get_source(), found, current, [], current._play_row, [fault])

    def _read_again(self) -> "Rows":
        """Return the rows that the folder has now, with the map of their scenario loaded once."""
        folder = self._get_source().folder
        if folder is None:
            raise BadValue("These rows have no folder: pass out= to run, or load a folder.")
        plan, rows = read_rows(folder)
        scenario = cache(self._scenario) if callable(self._scenario) else self._scenario
        source = verification.Provenance(plan, folder)
        return Rows(rows, plan["keys"], scenario, self._variants, self._sample, self._series, source)

    def _get_source(self) -> verification.Provenance:
        if self._source is None:
            raise BadValue("These rows have no plan: run and load return rows that have one.")
        return self._source

    def _read_series_lines(self) -> Iterable[SeriesLine]:
        return () if self._series is None else self._series(row["id"] for row in self._rows)

    def to_pandas(self) -> "pd.DataFrame":
        """Return all rows as a data frame of pandas.

        Raises:
            MissingExtra (ImportError): pandas is not installed.
        """
        return make_frame(self.table())

    # -- statistics -----------------------------------------------------------------------------------------------

    def metrics(self) -> list[str]:
        """Return the metrics of `summary`: turns, scores, collected numbers, and `wins.<team>`."""
        found = {name for name in self._find_number_columns() if name.startswith(_METRICS)}
        winners = {str(row["winner"]) for row in self._rows if row.get("winner") is not None}
        return ["turns", *sorted(found, key=lambda name: (not name.startswith("score."), name))] + [
            f"{_WINS}{one}" for one in sorted(winners)
        ]

    def summary(
        self, by: Sequence[str] | None = None, metrics: Sequence[str] | None = None, *, confidence: float = 0.95
    ) -> Table:
        """Return means with bootstrap intervals, and rates of wins with Wilson intervals, for each variant.

        Games of one seed count as one piece of evidence: first the games of a seed are averaged, then the seeds;
        intervals are over seeds. Rows with errors count in neither; the column `errors` says how many there are. Means
        of up to 100 seeds also have Student's interval, in the columns `t_low` and `t_high`.

        Args:
            by: the keys by which rows are grouped, also `opponent.<team>`, the member of a pool; None: all that were
                varied.
            metrics: columns of numbers, or `wins.<team>`; None: the result of `metrics()`.
            confidence: the confidence level of the intervals.

        Raises:
            UnknownName (KeyError): the rows lack the column.
            MissingExtra (ImportError): SciPy is not installed.
        """
        names = self.metrics() if metrics is None else [self._as_metric(one) for one in metrics]
        keys = self._as_keys(by)
        made = []
        is_few = False
        for settings, rows in self._group_rows(keys).items():
            good = [row for row in rows if row["error"] is None]
            for name in names:
                by_seed = _group_by_seed(name, good)
                counts = {"games": len(good), "seeds": len(by_seed), "errors": len(rows) - len(good)}
                mean = dict(zip(("mean", "low", "high"), _estimate_interval(name, by_seed, confidence), strict=True))
                means = [] if name.startswith(_WINS) else [fmean(some) for some in by_seed.values()]
                ends = _find_ends_of_t(means, confidence)
                made.append({**dict(zip(keys, settings, strict=True)), "metric": name, **counts, **mean, **ends})
                is_few |= _is_too_narrow(name, by_seed)
        return _make_table(made, is_few=is_few)

    def compare(self, metric: str, by: str, *, confidence: float = 0.95) -> Table:
        """Compare all values of a key in pairs of games that share the seed and all other settings.

        Pairs of one seed count as one piece of evidence: their differences are averaged, and interval, effect and p
        are of the means of the seeds.

        Columns: first, second, pairs, seeds, difference (first minus second) with its interval, effect (Cohen's d_z)
        and p of a permutation test, corrected for the number of comparisons after Holm. A note names the other varied
        keys, which are averaged over: see `interaction`. With up to 100 seeds,
        `t_low` and `t_high` are the ends of Student's interval. The table prints p as "< 0.0002" where the test cannot
        give a smaller one.

        Args:
            metric: a column of numbers, or `wins.<team>`.
            by: the key.
            confidence: the confidence level of the intervals.

        Raises:
            UnknownName (KeyError): the rows lack the column or key.
            MissingExtra (ImportError): SciPy is not installed.
        """
        differences = self._find_differences(metric, by)
        return _compare(("first", "second", "pairs"), differences, confidence, self._note_averaged([by]))

    def interaction(self, metric: str, a: str, b: str, *, confidence: float = 0.95) -> Table:
        """Test whether the difference between values of one key depends on another key.

        For each two values of `a` and each two of `b`, this is a difference of differences: how much more the metric
        changes from `second_a` to `first_a` at `first_b` than at `second_b`. The four games share the seed and all
        other settings. Differences of one seed count as one piece of evidence, as in `compare`.

        Columns: first_a, second_a, first_b, second_b, quadruples (of games), seeds, difference (of differences) with
        its interval, effect and p as in `compare`, corrected for the number of rows after Holm.

        Args:
            metric: a column of numbers, or `wins.<team>`.
            a: the key whose effect may depend on the other.
            b: the other key.
            confidence: the confidence level of the intervals.

        Raises:
            BadValue: the keys are the same, or one of them has only one value.
            UnknownName (KeyError): the rows lack the column or a key.
            MissingExtra (ImportError): SciPy is not installed.
        """
        name = self._as_metric(metric)
        for key in (a, b):
            as_known(key, "varied key", self.keys)
        if a == b:
            raise BadValue(f"An interaction is of two keys, not of {a!r} with itself.")
        values = find_values(self, name, (a, b))
        pairs_of = {key: list(combinations(dict.fromkeys(row[key] for row in self._rows), 2)) for key in (a, b)}
        alone = next((key for key, pairs in pairs_of.items() if not pairs), None)
        if alone is not None:
            raise BadValue(f"An interaction needs two values of each key, and {alone!r} has one: vary it.")
        contrasts = {}
        for first_a, second_a in pairs_of[a]:
            for first_b, second_b in pairs_of[b]:
                plus = [values.get(cell, {}) for cell in ((first_a, first_b), (second_a, second_b))]
                minus = [values.get(cell, {}) for cell in ((second_a, first_b), (first_a, second_b))]
                contrasts[first_a, second_a, first_b, second_b] = _find_contrast(plus, minus)
        names = ("first_a", "second_a", "first_b", "second_b", "quadruples")
        return _compare(names, contrasts, confidence, self._note_averaged([a, b]))

    def _find_differences(self, metric: str, by: str) -> dict[tuple[Any, ...], BySeed]:
        """Return the differences of paired games by seed, for each pair of values of a key."""
        name = self._as_metric(metric)
        as_known(by, "varied key", self.keys)
        values = find_values(self, name, (by,))
        return {
            (*first, *second): _find_contrast([values[first]], [values[second]])
            for first, second in combinations(values, 2)
        }

    def indices(self, metric: str, *, confidence: float = 0.95) -> Table:
        """Return first-order and total Sobol indices of the keys of a sample, with bootstrap intervals.

        Args:
            metric: a column of numbers, or `wins.<team>`, of which the mean over seeds counts.
            confidence: the confidence level of the intervals.

        Raises:
            BadValue: the rows are not from `sample(…, method="sobol")`, or some games are missing or have raised.
            UnknownName (KeyError): the rows lack the column.
        """
        if self._sample is None:
            raise BadValue("Sobol indices need rows of a sample: run(…, vary=sample(space, n, method='sobol')).")
        name = self._as_metric(metric)
        keys, n = self._sample
        points = len(self._rows) / (n * (len(keys) + 2))
        if points != int(points):
            raise BadValue(
                f"Games are missing: {len(self)} games are not equally many for each of {n * (len(keys) + 2)} points."
            )
        values = [np.nan if row["error"] is not None else read_metric(name, row) for row in self._rows]
        means = np.reshape(values, (-1, int(points))).mean(axis=1)
        made = []
        for key, orders in zip(keys, estimate_sobol_indices(means, len(keys), confidence), strict=True):
            for order, interval in zip(("first", "total"), orders, strict=True):
                made.append({"key": key, "index": order, **interval._asdict()})
        return Table.of(made)

    def plot(self, x: str | None = None, y: str = "turns", hue: str | None = None, ax: "Axes | None" = None) -> "Axes":
        """Draw means with intervals of 95 % over seeds: y by x, a series for each value of hue; return the axes.

        The title names the keys that are averaged over, because they are neither x nor hue, and says when bootstrap
        intervals are too narrow because of few seeds.

        Args:
            x: a varied key; None: the first one.
            y: a column of numbers, or `wins.<team>`.
            hue: a varied key; None: one series.
            ax: the axes to draw on; None: a new figure.

        Raises:
            UnknownName (KeyError): the rows lack the column or key.
            BadValue: nothing was varied, or all games raised.
            MissingExtra (ImportError): matplotlib or SciPy is not installed.
        """
        if x is None and not self.keys:
            raise BadValue("Nothing was varied, so there is no x to plot by.")
        if all(row["error"] is not None for row in self._rows):
            raise BadValue(f"None of the {len(self)} games ended without an error: rows.errors() says why.")
        name = self._as_metric(y)
        across = self.keys[0] if x is None else x
        keys = self._as_keys([across] if hue is None else [across, hue])
        notes = self._note_averaged(keys)
        is_few = False
        series: dict[Any, list[tuple[Any, Interval]]] = {}
        for settings, rows in self._group_rows(keys).items():
            good = [row for row in rows if row["error"] is None]
            by_seed = _group_by_seed(name, good)
            is_few |= _is_too_narrow(name, by_seed)
            point = settings[0], _estimate_interval(name, by_seed, 0.95)
            series.setdefault(settings[-1] if hue else None, []).append(point)
        if is_few:
            notes.append(f"{_TOO_NARROW}.")
        return plot(across, name, hue, series, ax, notes)

    def _note_averaged(self, keys: Sequence[str]) -> list[str]:
        """Return the note that names the other keys with several values, over which games are averaged."""
        averaged = [key for key in self.keys if key not in keys and len({row[key] for row in self._rows}) > 1]
        return [f"Averaged over {', '.join(averaged)}."] if averaged else []

    def _group_rows(self, keys: Sequence[str]) -> dict[tuple[Any, ...], list[Row]]:
        groups: dict[tuple[Any, ...], list[Row]] = {}
        for row in self._rows:
            groups.setdefault(tuple(row.get(key) for key in keys), []).append(row)
        return groups

    def _as_keys(self, given: Sequence[str] | None) -> list[str]:
        drawn = [name for name in self._rows[0] if name.startswith("opponent.")] if self._rows else []  # from pools
        known = [*self.keys, "seed", *drawn]
        keys = list(self.keys) if given is None else as_items(given, "by", "varied keys")
        for key in keys:
            as_known(key, "varied key", known)
        return keys

    def _find_number_columns(self) -> set[str]:
        cells = chain.from_iterable(row.items() for row in self._rows)
        return {name for name, value in cells if isinstance(value, (int, float))}

    def _as_metric(self, name: str) -> str:
        columns = self._find_number_columns()
        teams = [column.partition(".")[2] for column in sorted(columns) if column.startswith("agents.")]
        known = dict.fromkeys([*self.metrics(), *(f"{_WINS}{team}" for team in teams)])
        is_of_no_game = not teams and str(name).startswith(_WINS)
        if name not in columns and name not in known and not is_of_no_game:
            raise UnknownName("column of numbers", name, known)
        return name

    # -- games again ----------------------------------------------------------------------------------------------

    def play(self, row: str | int, *, record: str | os.PathLike[str] | None = None) -> Result:
        """Play the game of a row again; see `Scenario.play`.

        Args:
            row: its id, or its number.
            record: the file of a recording, to be replayed and rendered; None: it is not recorded.

        Raises:
            BadValue, ScenarioError: the plan does not hold the game, or the code that it names is not found.
            UnknownName (KeyError): the table lacks the row.
        """
        scenario, seed, strategies = self._find_game(row)
        return scenario.play(seed, strategies, record=record)

    def build(self, row: str | int, vis_engine: Engine | None = None) -> Context:
        """Return a context with the game of a row, ready to play; see `Scenario.build`.

        Raises:
            UnknownName (KeyError): the table lacks the row.
        """
        scenario, seed, strategies = self._find_game(row)
        return scenario.build(seed, strategies, vis_engine)

    def _play_row(self, id: str) -> tuple[Row, list[SeriesLine]]:
        """Play the game of a row again; return its row without the columns of the plan, and its collected values."""
        scenario, seed, strategies = self._find_game(id)
        code = hash_code(scenario.folder)
        settings = ExperimentSettings(scenario, {}, max_memory(), code)
        played = VariantPlayer(settings, Variant({}, {}, dict(strategies))).play([seed])
        return played.rows[0], [*list_series_lines(id, played.series[0])]

    def _find_game(self, wanted: str | int) -> tuple[Scenario, int, Mapping[str, Any]]:
        if isinstance(wanted, str):
            row = next((row for row in self._rows if row["id"] == wanted), None)
            if row is None:
                raise UnknownName("row", wanted, [row["id"] for row in self._rows[:3]])
        else:
            number = as_int(wanted, "The number of a row")
            if not -len(self) <= number < len(self):
                raise BadValue(f"There is no row {number}: there are {len(self)}, numbered from 0.")
            row = self._rows[number]
        settings = {key: row[key] for key in self.keys}
        variant = next((one for one in self._variants if one.settings == settings), None)
        if self._scenario is None or variant is None:
            raise verification.Unplayable(
                f"The plan does not say how to play row {row['id']}: a program passed functions for it, or an older "
                "GAMMS wrote the plan. Give load(…, scenario=…, vary=…) with these functions."
            )
        try:
            scenario = variant.apply_to(self._scenario() if callable(self._scenario) else self._scenario)
            is_first = self._source is not None and self._source.plan["format"] != FORMAT
            digest = compute_first_digest(scenario) if is_first else compute_digest(scenario, variant.strategies)
        except ScenarioError as error:
            way = "Give load(…, folder=…), the folder of its code and maps, and allow= for packages that you trust."
            raise ScenarioError(error.path, f"{error.message} {way}", error.file, error.place) from None
        if digest != row["scenario"]:
            raise BadValue(f"The scenario or its code has changed since the game of row {row['id']} was played.")
        return scenario, row["seed"], variant.strategies


def read_metric(name: str, row: Row) -> float:
    """Return the value of a metric in a row, NaN if the row has no such number, or no winner."""
    if name.startswith(_WINS):
        if "winner" not in row:
            return np.nan
        return float(row["winner"] is not None and str(row["winner"]) == name.removeprefix(_WINS))
    value = row.get(name)
    return float(value) if isinstance(value, (int, float)) else np.nan


def find_values(rows: Rows, name: str, keys: Sequence[str]) -> dict[tuple[Any, ...], dict[tuple[Any, ...], float]]:
    """Return the values of a metric: the values of these keys -> the seed and all other settings -> the value."""
    others = [one for one in rows.keys if one not in keys]
    found: dict[tuple[Any, ...], dict[tuple[Any, ...], float]] = {}
    for row in rows:
        value = np.nan if row["error"] is not None else read_metric(name, row)
        if np.isfinite(value):
            same = (row["seed"], *(row[one] for one in others))
            found.setdefault(tuple(row[key] for key in keys), {})[same] = value
    return found


def _find_contrast(
    plus: Sequence[Mapping[tuple[Any, ...], float]], minus: Sequence[Mapping[tuple[Any, ...], float]]
) -> BySeed:
    """Return sums of values minus sums of others, by seed, of games that share the seed and all other settings.

    Each mapping has the values of some games: the seed and the other settings -> the value.
    """
    by_seed: BySeed = {}
    for same in plus[0]:
        if all(same in values for values in (*plus, *minus)):
            difference = sum(values[same] for values in plus) - sum(values[same] for values in minus)
            by_seed.setdefault(same[0], []).append(difference)
    return by_seed


def _compare(
    names: Sequence[str], contrasts: Mapping[tuple[Any, ...], BySeed], confidence: float, notes: Sequence[str]
) -> Table:
    """Return a table of contrasts, each with interval, effect and p over seeds.

    Args:
        names: the columns of the values that are compared, then that of the number of contrasts of games.
        contrasts: the values that are compared -> the contrasts by seed.
        confidence: the confidence level of the intervals.
        notes: sentences below the table.
    """
    *labels, count = names
    made = []
    for compared, by_seed in contrasts.items():
        means = [fmean(some) for some in by_seed.values()]
        counts = {count: sum(map(len, by_seed.values())), "seeds": len(by_seed)}
        result = compare_pairs(means, confidence)
        ends = _find_ends_of_t(means, confidence)
        interval = {"difference": result.difference, "low": result.low, "high": result.high, **ends}
        test = {"effect": result.effect, "p": result.p}
        made.append({**dict(zip(labels, compared, strict=True)), **counts, **interval, **test})
    for row, p in zip(made, correct_by_holm([row["p"] for row in made]), strict=True):
        row["p"] = p
    if not made:
        return Table({one: np.array([]) for one in (*names, "seeds", *PairedComparison._fields)}, unit=_UNIT)
    is_few = any(len(by_seed) <= FEW_SEEDS for by_seed in contrasts.values())
    return _make_table(made, is_few=is_few, notes=notes, least={"p": min(LEAST_P * len(made), 0.999)})


def _find_ends_of_t(means: Sequence[float], confidence: float) -> dict[str, float]:
    """Return the columns of Student's interval of the mean over seeds; NaN where the bootstrap suffices."""
    ends = compute_t_interval(means, confidence) if len(means) <= FEW_SEEDS else (np.nan, np.nan)
    return dict(zip(_ENDS_OF_T, ends, strict=True))


def _make_table(
    rows: list[dict[str, Any]], *, is_few: bool, notes: Sequence[str] = (), least: Mapping[str, float] | None = None
) -> Table:
    """Return a table of means over seeds; only if some of them are of few seeds, it has Student's intervals."""
    if is_few:
        return Table.of(rows, notes=[*notes, _HAS_T], least=least, unit=_UNIT)
    columns = [{name: value for name, value in row.items() if name not in _ENDS_OF_T} for row in rows]
    return Table.of(columns, notes=notes, least=least, unit=_UNIT)


def _group_by_seed(name: str, rows: Sequence[Row]) -> dict[int, list[float]]:
    """Return the values of games by seed."""
    found: dict[int, list[float]] = {}
    for row in rows:
        value = read_metric(name, row)
        if np.isfinite(value):
            found.setdefault(row["seed"], []).append(value)
    return found


def _estimate_interval(name: str, by_seed: Mapping[int, Sequence[float]], confidence: float) -> Interval:
    """Return the mean of the means of seeds, with its interval."""
    means = [fmean(some) for some in by_seed.values()]
    if name.startswith(_WINS):
        return estimate_rate_of_seeds(means, sum(map(len, by_seed.values())), confidence)
    return estimate_mean(means, confidence)


def _is_too_narrow(name: str, by_seed: Mapping[int, Sequence[float]]) -> bool:
    return len(by_seed) <= FEW_SEEDS and not name.startswith(_WINS)


def power(
    spread: float | Rows,
    difference: float,
    *,
    metric: str | None = None,
    by: str | None = None,
    power: float = 0.8,
    alpha: float = 0.05,
) -> int:
    """Return the number of seeds that `rows.compare` needs to detect a difference.

    The normal approximation of the two-sided paired test with the correction of Guenther (The American Statistician
    35, 1981). Each seed is one pair, however many games it has.

    Args:
        spread: the standard deviation of the paired differences of seeds; or rows of a first experiment, from which
            it is estimated (of more than two values of the key, the largest one).
        difference: the mean difference to be found, in units of the metric.
        metric: for rows, a column of numbers, or `wins.<team>`.
        by: for rows, the key whose values are compared.
        power: the probability of finding the difference.
        alpha: the level of the test; for m comparisons, as Holm corrects them, divide it by m.

    Raises:
        BadValue (ValueError): a number is not in its range; rows have no two seeds that differ; metric or by is
            missing, or given without rows.
        UnknownName (KeyError): the rows lack the column or key.
    """
    wanted = as_float(difference, "difference")
    chance = as_positive(power, "power")
    level = as_positive(alpha, "alpha")
    if wanted == 0.0:
        raise BadValue("difference is 0.0: give one that the experiment is to find.")
    if not level < chance < 1.0:
        raise BadValue(f"alpha must be less than power, and power less than 1, not {level:g} and {chance:g}.")
    if not isinstance(spread, Rows):
        if metric is not None or by is not None:
            raise BadValue("metric and by are for rows: a standard deviation needs neither.")
        return count_seeds_needed(as_positive(spread, "spread"), wanted, chance, level)
    if metric is None or by is None:
        raise BadValue("Rows need metric= and by= for the differences.")
    spreads = [_estimate_deviation(one) for one in spread._find_differences(metric, by).values()]
    largest = max(spreads, default=0.0)
    if largest == 0.0:
        raise BadValue(f"No differences of {metric} by {by} vary over seeds: play more seeds first.")
    return count_seeds_needed(largest, wanted, chance, level)


def _estimate_deviation(by_seed: Mapping[int, Sequence[float]]) -> float:
    means = [fmean(some) for some in by_seed.values()]
    return float(np.std(means, ddof=1)) if len(means) > 1 else 0.0
