"""Evaluation: strategies of a team on many maps, against many opponents, between a reference and exact play."""

import os
from collections.abc import Hashable, Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from gamms.arguments import as_count, as_known, as_mapping
from gamms.errors import BadValue, Duplicate
from gamms.experiment import Rows, Table, run
from gamms.experiment.rows import find_values
from gamms.experiment.statistics import Interval, estimate_ratio
from gamms.scenario import Scenario
from gamms.text import shown

if TYPE_CHECKING:
    from matplotlib.axes import Axes

EXACT = "exact"
"""The name of exact play among the strategies."""
_ALL = "all maps"
Values = Mapping[tuple[Any, ...], float]  # the seed and settings of a game -> the metric


class Evaluation:
    """The games of `evaluate`; it prints as its table.

    Args:
        rows: the rows of the games.
        team: the team whose strategies are compared.
        metric: what counts: `wins.<team>`, or a column of numbers.
        reference: the name of the strategy for which `gap_closed` is 0.

    Attributes:
        rows, team, metric, reference: see the arguments.
    """

    def __init__(self, rows: Rows, team: Hashable, metric: str, reference: str) -> None:
        self.rows = rows
        self.team = team
        self.metric = metric
        self.reference = reference

    def __str__(self) -> str:
        return str(self.table())

    def table(self, *, confidence: float = 0.95) -> Table:
        """Return a row for each map, opponent and strategy, and means over all maps.

        Columns: those of `Rows.summary`, where rates of wins have Wilson intervals. If exact play was evaluated, also
        `gap_closed`, the share of the gap between the reference and exact play that the strategy closes, with its
        bootstrap interval over seeds, `gap_low` and `gap_high`. They are missing where exact play is not significantly
        better than the reference (at 1 - `confidence`). Over all maps, the share is a ratio of sums.

        Args:
            confidence: the confidence level of the intervals.

        Raises:
            MissingExtra (ImportError): SciPy is not installed.
        """
        found = self._list_rows(self.rows.keys, confidence)
        if "map" in self.rows.keys:
            others = [key for key in self.rows.keys if key != "map"]
            found += [{"map": _ALL, **row} for row in self._list_rows(others, confidence)]
        return Table.of(found)

    def _list_rows(self, keys: Iterable[str], confidence: float) -> list[dict[str, Any]]:
        """Return the rows of the table for each combination of values of these keys."""
        own = f"strategies.{self.team}"
        columns = self.rows.summary(list(keys), [self.metric], confidence=confidence)
        rows = [dict(zip(columns, cells, strict=True)) for cells in zip(*map(list, columns.values()), strict=True)]
        if not any(row[own] == EXACT for row in rows):
            return rows
        others = [key for key in keys if key != own]
        values = find_values(self.rows, self.metric, [*others, own])
        for row in rows:
            setting = tuple(row[key] for key in others)
            played, least, most = (values.get((*setting, name), {}) for name in (row[own], self.reference, EXACT))
            found = _estimate_gap(played, least, most, confidence)
            row |= dict(zip(("gap_closed", "gap_low", "gap_high"), found, strict=True))
        return rows

    def gap_closed(self, strategy: str) -> float:
        """Return the share of the gap between the reference and exact play that a strategy closes.

        It is a ratio of sums over all maps and opponents; see `table`.

        Raises:
            UnknownName (KeyError): there is no such strategy.
            BadValue: exact play was not evaluated, or is not significantly better than the reference.
        """
        own = f"strategies.{self.team}"
        shares = {str(row[own]): row.get("gap_closed", np.nan) for row in self._list_rows([own], 0.95)}
        share = float(shares[as_known(strategy, "strategy", shares)])
        if np.isnan(share):
            raise BadValue(
                f"There is no gap for {shown(strategy)} to close, because no exact play beats the reference "
                f"{shown(self.reference)} significantly: give evaluate exact=…, more games, or maps and opponents "
                "where it is better."
            )
        return share

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw the metric by map, or by strategy on one map, with intervals of 95 %; return the axes.

        Raises:
            MissingExtra (ImportError): matplotlib or SciPy is not installed.
        """
        own = f"strategies.{self.team}"
        return self.rows.plot("map" if "map" in self.rows.keys else own, self.metric, own, ax)


def evaluate(  # noqa: PLR0913 - each option is independent of the others
    scenario: Scenario,
    strategies: Mapping[str, Any],
    *,
    team: Hashable,
    opponents: Mapping[Any, Any] | None = None,
    maps: Mapping[str, Any] | Iterable[Any] | None = None,
    games: int = 100,
    seed: int = 0,
    exact: object = None,
    reference: str | None = None,
    metric: str | None = None,
    out: str | os.PathLike[str] | None = None,
    workers: int | None = None,
) -> Evaluation:
    """Play each strategy of a team against each opponent on each map, by `experiment.run`.

    Rows, folders that go on, and digests are those of the experiment: `evaluation.rows` has them. (`solve.evaluate`
    evaluates a strategy against the worst opponent.)

    Args:
        scenario: the scenario.
        strategies: name -> strategy of the team, or a function of the context that makes it.
        team: the team.
        opponents: name -> strategy of the other team, or team -> such a mapping; None: those of the scenario.
        maps: name -> map, or maps that are named by their numbers, each as under `map` in a scenario; None: that of the
            scenario.
        games: the number of games of each combination, with the seeds `seed`, `seed + 1`, …
        seed: the first seed.
        exact: the strategy of the team, or a function of the context that makes it, that plays exactly, such as
            `solve.exact_pursuers`; None: there is none.
        reference: the name of the strategy for which `gap_closed` is 0; None: the first one.
        metric: `wins.<team>`, or a column of numbers; None: `wins.` of the team.
        out: a folder that keeps the rows; an interrupted evaluation continues there.
        workers: the number of worker processes; None: play in this process.

    Raises:
        UnknownName (KeyError): the team, the reference, or the team of the metric does not exist.
        BadType, BadValue, ScenarioError: see `experiment.run`.
    """
    teams = list(scenario.spec.teams)
    as_known(team, "team", teams)
    if metric is not None and metric.startswith("wins."):
        as_known(metric, "metric", [f"wins.{one}" for one in teams])
    if opponents is not None and not opponents:
        raise BadValue("opponents is empty: give at least one, name -> strategy, or None for those of the scenario.")
    compared = dict(as_mapping(strategies, "strategies"))
    if not compared:
        raise BadValue("strategies is empty: give at least one, name -> strategy.")
    lowest = next(iter(compared)) if reference is None else as_known(reference, "strategy", compared)
    if exact is not None and EXACT in compared:
        raise Duplicate("a strategy", EXACT)
    vary: dict[str, Any] = {}
    if maps is not None:
        vary["map"] = name_maps(maps)
    vary[f"strategies.{team}"] = {**compared, **({} if exact is None else {EXACT: exact})}
    for other, known in _group_by_team(opponents or {}, [one for one in teams if one != team]).items():
        vary[f"strategies.{other}"] = known
    seeds = range(seed, seed + as_count(games, "games"))
    rows = run(scenario, seeds, vary, out=out, workers=workers)
    return Evaluation(rows, team, f"wins.{team}" if metric is None else metric, lowest)


def _estimate_gap(played: Values, least: Values, most: Values, confidence: float) -> Interval:
    """Return the share of the gap that a strategy closes, from games that it, the reference and exact play share.

    Gains of a seed are summed over its games, so that no small gap of a single game is divided by.
    """
    games = [game for game in played if game in least and game in most]
    gains = {seed: np.zeros(2) for seed, *_ in games}
    for game in games:
        gains[game[0]] += played[game] - least[game], most[game] - least[game]
    sums = np.reshape([*gains.values()], (-1, 2))
    return estimate_ratio(sums[:, 0], sums[:, 1], confidence)


def name_maps(maps: Mapping[str, Any] | Iterable[Any]) -> dict[str, Any]:
    """Return name -> map; maps without names are named by their numbers."""
    return dict(maps) if isinstance(maps, Mapping) else {str(number): one for number, one in enumerate(maps)}


def _group_by_team(opponents: Mapping[Any, Any], others: list[Any]) -> Mapping[Any, Any]:
    """Return the opponents as team -> name -> strategy."""
    known = as_mapping(opponents, "opponents")
    if all(isinstance(one, Mapping) for one in known.values()):
        for team in known:
            as_known(team, "opposing team", others)
        return known
    if len(others) != 1:
        raise BadValue(f"opponents are for one team: with {shown(others)}, give {{team: {{name: strategy}}}}.")
    return {others[0]: known}
