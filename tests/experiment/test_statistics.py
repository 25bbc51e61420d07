"""Intervals, comparisons and Sobol indices, against values that are known or computed by hand."""

import math
from itertools import product

import numpy as np
import pytest
import small_hunts
from small_hunts import HUNT

from gamms import experiment
from gamms.errors import BadValue, UnknownName
from gamms.experiment.rows import Rows
from gamms.experiment.statistics import holm, mean_interval, paired, rate_interval, sobol_indices


def test_a_rate_has_the_interval_of_wilson():
    z, rate, n = 1.959963984540054, 0.8, 10
    centre = (rate + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * math.sqrt(rate * (1 - rate) / n + z * z / (4 * n * n))
    assert rate_interval(8, 10) == pytest.approx((0.8, centre - half, centre + half))
    assert rate_interval(0, 5)[:2] == pytest.approx((0.0, 0.0))
    assert math.isnan(rate_interval(0, 0).value)


def test_the_bootstrap_of_few_values_is_close_to_that_of_all_resamples():
    values = [0.0, 1.0, 2.0, 4.0]
    means = sorted(sum(drawn) / 4 for drawn in product(values, repeat=4))  # all 256 are as probable
    interval = mean_interval(values)
    assert interval.value == 1.75
    assert means[0] < interval.low < 1.75 < interval.high < means[-1]
    assert interval == mean_interval(values)  # whatever was drawn before
    assert mean_interval([3.0] * 9) == (3.0, 3.0, 3.0)


def test_the_bootstrap_of_many_values_is_close_to_that_of_the_normal_distribution():
    for n in (300, 1500):
        values = np.random.default_rng(n).normal(5.0, 2.0, n)
        half = 1.96 * values.std(ddof=1) / math.sqrt(n)
        assert mean_interval(values) == pytest.approx(
            (values.mean(), values.mean() - half, values.mean() + half), abs=0.03
        )


def test_pairs_have_an_effect_size_and_an_exact_p_of_all_signs():
    differences = [1.0, 2.0, 3.0, -1.0]
    found = paired(differences)
    assert found.difference == 1.25
    assert found.effect == pytest.approx(1.25 / math.sqrt(35 / 12))
    sums = [
        sum(sign * one for sign, one in zip(signs, differences, strict=True)) for signs in product((1, -1), repeat=4)
    ]
    assert found.p == pytest.approx(sum(abs(one) >= 5.0 for one in sums) / 16)
    assert paired([0.0, 0.0])[3:] == (0.0, 1.0)
    assert paired([2.0, 2.0]).effect == math.inf


def test_p_values_are_corrected_after_holm():
    assert holm([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])
    assert holm([0.9, 0.8]) == [1.0, 1.0]
    assert holm([]) == []


def ishigami(x, a=7.0, b=0.1):
    return np.sin(x[:, 0]) + a * np.sin(x[:, 1]) ** 2 + b * x[:, 2] ** 4 * np.sin(x[:, 0])


def test_sobol_indices_are_those_of_the_ishigami_function():
    points = experiment.sample(dict.fromkeys("xyz", (-math.pi, math.pi)), 1024)
    values = ishigami(np.array([list(point.values()) for point in points]))
    found = sobol_indices(values, 3)
    variance = 7.0**2 / 8 + 0.1 * math.pi**4 / 5 + 0.1**2 * math.pi**8 / 18 + 0.5
    of_x, of_y = 0.5 * (1 + 0.1 * math.pi**4 / 5) ** 2, 7.0**2 / 8
    of_xz = 0.1**2 * math.pi**8 * (1 / 18 - 1 / 50)
    first, total = ([one[order] for one in found] for order in (0, 1))
    assert [one.value for one in first] == pytest.approx([of_x / variance, of_y / variance, 0.0], abs=0.03)
    expected = [(of_x + of_xz) / variance, of_y / variance, of_xz / variance]
    assert [one.value for one in total] == pytest.approx(expected, abs=0.03)
    assert all(one.low < one.value < one.high and one.high - one.low < 0.2 for one in (*first, *total))


def test_sobol_indices_are_those_of_scipy():
    import scipy.stats

    points = experiment.sample(dict.fromkeys("xyz", (0.0, 1.0)), 64)
    blocks = ishigami(np.array([list(point.values()) for point in points])).reshape(5, 1, 64)
    theirs = scipy.stats.sobol_indices(func={"f_A": blocks[0], "f_B": blocks[1], "f_AB": blocks[2:]}, n=64)
    ours = sobol_indices(blocks.ravel(), 3)
    assert [one.value for one, _ in ours] == pytest.approx(theirs.first_order.ravel().tolist())
    assert [one.value for _, one in ours] == pytest.approx(theirs.total_order.ravel().tolist())


@pytest.mark.parametrize("ends", [(1, 2.5), (1.5, 3), (1.0, 3.0)])
def test_a_range_with_an_end_that_is_no_integer_is_one_of_numbers(ends):
    values = [point["x"] for point in experiment.sample({"x": ends, "y": (1, 3)}, 8)]
    assert all(type(value) is float and ends[0] <= value <= ends[1] for value in values)
    assert len(set(values)) > 3


def test_a_sample_is_in_its_ranges_and_follows_its_seed():
    space = {"teams.red.count": (1, 3), "max_turns": [2, 4], "rules.tag.with.hops": {"min": 0.5, "max": 1.5}}
    for method, count in (("latin", 12), ("random", 12), ("sobol", 80)):
        points = list(experiment.sample(space, 16 if method == "sobol" else 12, method))
        assert len(points) == count
        assert {point["teams.red.count"] for point in points} == {1, 2, 3}
        assert {point["max_turns"] for point in points} == {2, 4}
        assert all(0.5 <= point["rules.tag.with.hops"] <= 1.5 for point in points)
        assert points == list(experiment.sample(space, 16 if method == "sobol" else 12, method))
        assert points != list(experiment.sample(space, 16 if method == "sobol" else 12, method, seed=1))


@pytest.mark.parametrize(
    ("space", "n", "message"),
    [
        ({}, 4, "no keys"),
        ({"a": (1, 2)}, 6, "power of two .* such as 8"),
        ({"a": (2, 1)}, 4, "must grow"),
        ({"a": 3}, 4, r"is \(low, high\) or a list"),
        ({"a": {"min": 1}}, 4, "'max'"),
    ],
)
def test_a_space_that_is_none_is_refused(space, n, message):
    with pytest.raises(BadValue, match=message):
        experiment.sample(space, n)


def made(*rows):
    full = [
        {
            "id": str(i),
            "scenario": "",
            "seed": seed,
            "way": way,
            "turns": turns,
            "score.red": score,
            "winner": winner,
            "error": error,
        }
        for i, (way, seed, turns, score, winner, error) in enumerate(rows)
    ]
    return Rows(full, ["way"])


ROWS = made(
    ("a", 0, 4, 1, "red", None),
    ("a", 1, 6, 3, "blue", None),
    ("a", 2, None, None, None, "ValueError: x"),
    ("b", 0, 2, 2, "red", None),
    ("b", 1, 2, 5, "red", None),
    ("b", 2, 2, 5, None, None),
)


def test_a_summary_has_means_and_rates_of_wins_for_each_variant():
    table = ROWS.summary()
    assert list(table) == ["way", "metric", "games", "errors", "mean", "low", "high"]
    found = {
        (way, metric): (games, errors, mean)
        for way, metric, games, errors, mean, *_ in zip(*table.values(), strict=True)
    }
    assert found["a", "turns"] == (2, 1, 5.0)
    assert found["b", "score.red"] == (3, 0, 4.0)
    assert found["a", "wins.red"] == (2, 1, 0.5)
    assert found["b", "wins.blue"] == (3, 0, 0.0)
    assert ROWS.summary([], ["wins.red"])["mean"] == [0.6]


def test_values_are_compared_on_the_seeds_that_both_have():
    table = ROWS.compare("score.red", "way")
    assert (table["first"][0], table["second"][0], table["pairs"][0], table["difference"][0]) == ("a", "b", 2, -1.5)
    assert table["effect"][0] == pytest.approx(-1.5 / math.sqrt(0.5))
    assert ROWS.compare("wins.red", "way")["difference"][0] == -0.5


def test_unknown_columns_and_keys_are_named():
    with pytest.raises(UnknownName, match=r"Did you mean 'score\.red'"):
        ROWS.summary(metrics=["score.rde"])
    with pytest.raises(UnknownName, match="Did you mean 'way'"):
        ROWS.compare("turns", "wya")


def test_a_table_prints_and_is_set_by_latex():
    table = experiment.Table.of([{"way": "a_b", "games": 3, "mean": 0.5, "low": 0.25, "high": 1.0}])
    assert str(table).splitlines() == ["way  games  mean   low  high", "a_b      3   0.5  0.25     1"]
    assert table.latex(caption="50 %", label="tab:x").splitlines() == [
        r"\begin{table}",
        r"\centering",
        r"\caption{50 \%}",
        r"\label{tab:x}",
        r"\begin{tabular}{lrr}",
        r"\toprule",
        r"way & games & mean \\",
        r"\midrule",
        r"a\_b & 3 & 0.50 [0.25, 1.00] \\",
        r"\bottomrule",
        r"\end{tabular}",
        r"\end{table}",
    ]


def test_the_indices_of_a_played_sample_say_what_matters():
    points = experiment.sample({"max_turns": (1, 8), "data.unused": (0, 9)}, 8)
    lonely = HUNT.replace(data={"unused": 0}, rules=[{"rule": "time_limit", "with": {"turns": 99}}])
    rows = experiment.run(lonely, [1], points, collect={"tags": small_hunts.count_tags})
    table = rows.indices("turns")
    assert table["key"].tolist() == ["max_turns", "max_turns", "data.unused", "data.unused"]
    assert table["index"].tolist() == ["first", "total"] * 2
    assert table["value"][1] > 0.2
    assert table["value"][2:].tolist() == [0.0, 0.0]
    with pytest.raises(BadValue, match="need rows of a sample"):
        ROWS.indices("turns")


def test_a_plot_has_a_series_for_each_hue_and_returns_its_axes():
    figure = pytest.importorskip("matplotlib.figure").Figure()
    axes = figure.subplots()
    assert ROWS.plot("way", "score.red", ax=axes) is axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("way", "score.red")
    assert [label.get_text() for label in axes.get_xticklabels()] == ["a", "b"]
    (bars,) = axes.containers
    assert bars.lines[0].get_ydata().tolist() == [2.0, 4.0]
    with pytest.raises(UnknownName):
        ROWS.plot("wya")
