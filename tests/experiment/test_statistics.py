"""Intervals, comparisons and Sobol indices, against values that are known or computed by hand."""

import math
from collections import Counter
from itertools import product

import numpy as np
import pytest
import small_hunts
from small_hunts import HUNT

from gamms import experiment
from gamms.errors import BadValue, UnknownName
from gamms.experiment.rows import Rows
from gamms.experiment.statistics import (
    compare_pairs,
    correct_by_holm,
    estimate_mean,
    estimate_rate,
    estimate_rate_of_seeds,
    estimate_sobol_indices,
)
from gamms.experiment.tables import describe_key, plot


def test_a_rate_has_the_interval_of_wilson():
    z, rate, n = 1.959963984540054, 0.8, 10
    centre = (rate + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * math.sqrt(rate * (1 - rate) / n + z * z / (4 * n * n))
    assert estimate_rate(8, 10) == pytest.approx((0.8, centre - half, centre + half))
    assert estimate_rate(0, 5)[:2] == pytest.approx((0.0, 0.0))
    assert estimate_rate(5, 5).high == 1.0
    assert math.isnan(estimate_rate(0, 0).value)


def test_equal_games_of_a_seed_are_one_piece_of_evidence():
    rates = [1.0, 0.0, 1.0, 1.0, 0.0]
    assert estimate_rate_of_seeds(rates, 5) == pytest.approx(estimate_rate(3, 5))
    assert estimate_rate_of_seeds(rates, 40) == pytest.approx(estimate_rate(3, 5))
    assert estimate_rate_of_seeds([1.0] * 5, 40) == estimate_rate(5, 5)
    assert estimate_rate_of_seeds([0.5] * 5, 40) == estimate_rate(20, 40)  # no more evidence than independent games
    between = estimate_rate_of_seeds([1.0, 0.25, 1.0, 0.5, 0.25], 20)
    assert estimate_rate(3, 5).low < between.low < estimate_rate(12, 20).low
    assert math.isnan(estimate_rate_of_seeds([], 0).value)


def test_the_bootstrap_of_few_values_is_close_to_that_of_all_resamples():
    values = [0.0, 1.0, 2.0, 4.0]
    means = sorted(sum(drawn) / 4 for drawn in product(values, repeat=4))  # all 256 are as probable
    interval = estimate_mean(values)
    assert interval.value == 1.75
    assert means[0] < interval.low < 1.75 < interval.high < means[-1]
    assert interval == estimate_mean(values)  # whatever was drawn before


def test_equal_values_have_no_interval():
    assert estimate_mean([3.0] * 9) == pytest.approx((3.0, math.nan, math.nan), nan_ok=True)
    table = made(*(("a", seed, 3, 1, "red", None) for seed in range(120))).summary()
    assert str(table).splitlines()[1:] == [
        "a    turns        120    120       0     3      -     -",
        "a    score.red    120    120       0     1      -     -",
        "a    wins.red     120    120       0     1  0.969     1",
    ]
    assert r"3.00 \\" in table.latex()


def test_the_bootstrap_of_many_values_is_close_to_that_of_the_normal_distribution():
    for n in (300, 1500):
        values = np.random.default_rng(n).normal(5.0, 2.0, n)
        half = 1.96 * values.std(ddof=1) / math.sqrt(n)
        assert estimate_mean(values) == pytest.approx(
            (values.mean(), values.mean() - half, values.mean() + half), abs=0.03
        )


def test_pairs_have_an_effect_size_and_an_exact_p_of_all_signs():
    differences = [1.0, 2.0, 3.0, -1.0]
    found = compare_pairs(differences)
    assert found.difference == 1.25
    assert found.effect == pytest.approx(1.25 / math.sqrt(35 / 12))
    sums = [
        sum(sign * one for sign, one in zip(signs, differences, strict=True)) for signs in product((1, -1), repeat=4)
    ]
    assert found.p == pytest.approx(sum(abs(one) >= 5.0 for one in sums) / 16)
    assert compare_pairs([0.0, 0.0])[3:] == (0.0, 1.0)
    assert compare_pairs([2.0, 2.0]).effect == math.inf


def test_p_values_are_corrected_after_holm():
    assert correct_by_holm([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])
    assert correct_by_holm([0.9, 0.8]) == [1.0, 1.0]
    assert correct_by_holm([]) == []


def ishigami(x, a=7.0, b=0.1):
    return np.sin(x[:, 0]) + a * np.sin(x[:, 1]) ** 2 + b * x[:, 2] ** 4 * np.sin(x[:, 0])


def test_sobol_indices_are_those_of_the_ishigami_function():
    points = experiment.sample(dict.fromkeys("xyz", (-math.pi, math.pi)), 1024)
    values = ishigami(np.array([list(point.values()) for point in points]))
    found = estimate_sobol_indices(values, 3)
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
    ours = estimate_sobol_indices(blocks.ravel(), 3)
    assert [one.value for one, _ in ours] == pytest.approx(theirs.first_order.ravel().tolist())
    assert [one.value for _, one in ours] == pytest.approx(theirs.total_order.ravel().tolist())


@pytest.mark.parametrize("ends", [(1, 2.5), (1.5, 3), (1.0, 3.0)])
def test_a_range_with_an_end_that_is_no_integer_is_one_of_numbers(ends):
    values = [point["x"] for point in experiment.sample({"x": ends, "y": (1, 3)}, 8)]
    assert all(type(value) is float and ends[0] <= value <= ends[1] for value in values)
    assert len(set(values)) > 3


def test_integers_and_numbers_of_a_range_are_drawn_equally_often():
    points = list(experiment.sample({"whole": (5, 8), "real": (10.0, 14.0)}, 400, "latin"))
    assert Counter(point["whole"] for point in points) == dict.fromkeys(range(5, 9), 100)
    assert Counter(int(point["real"]) for point in points) == dict.fromkeys(range(10, 14), 100)


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
    assert list(table) == ["way", "metric", "games", "seeds", "errors", "mean", "low", "high", "t_low", "t_high"]
    found = {
        (way, metric): (games, seeds, errors, mean)
        for way, metric, games, seeds, errors, mean, *_ in zip(*table.values(), strict=True)
    }
    assert found["a", "turns"] == (2, 2, 1, 5.0)
    assert found["b", "score.red"] == (3, 3, 0, 4.0)
    assert found["a", "wins.red"] == (2, 2, 1, 0.5)
    assert found["b", "wins.blue"] == (3, 3, 0, 0.0)


def test_a_summary_averages_by_seed_first():
    table = ROWS.summary([], ["wins.red"])
    assert (table["games"], table["seeds"], table["errors"]) == (5, 3, 1)
    assert table["mean"] == [0.5]  # of 1, 1/2 and 0


def test_values_are_compared_on_the_seeds_that_both_have():
    table = ROWS.compare("score.red", "way")
    columns = ("first", "second", "pairs", "seeds", "difference")
    assert [table[name][0] for name in columns] == ["a", "b", 2, 2, -1.5]
    assert table["effect"][0] == pytest.approx(-1.5 / math.sqrt(0.5))
    assert ROWS.compare("wins.red", "way")["difference"][0] == -0.5


def repeated(differences, copies):
    """Return rows of two ways that differ by seed, played alike with every value of a key that does not matter."""
    rows = []
    for copy in range(copies):
        for way in ("a", "b"):
            for seed, difference in enumerate(differences):
                turns = float(difference) if way == "a" else 0.0
                settings = {"copy": copy, "way": way, "seed": seed}
                rows.append({"id": str(len(rows)), **settings, "turns": turns, "winner": None, "error": None})
    return Rows(rows, ["copy", "way"])


def test_games_that_repeat_a_seed_add_no_evidence():
    differences = np.random.default_rng(1).normal(0.5, 1.0, 25)
    once, often = (repeated(differences, copies).compare("turns", "way") for copies in (1, 8))
    assert (once["pairs"][0], often["pairs"][0], often["seeds"][0]) == (25, 200, 25)
    for name in ("difference", "low", "high", "effect", "p"):
        assert often[name][0] == pytest.approx(once[name][0])
    means = [repeated(differences, copies).summary(["way"], ["turns"]) for copies in (1, 8)]
    assert means[0]["low"].tolist() == pytest.approx(means[1]["low"].tolist(), nan_ok=True)


def test_equal_strategies_are_found_to_differ_in_one_of_twenty_experiments():
    rng = np.random.default_rng(7)
    tables = (repeated(rng.normal(size=9), 8).compare("turns", "way") for _ in range(300))
    assert 0.03 < np.mean([table["p"][0] < 0.05 for table in tables]) < 0.07


def test_p_at_its_floor_is_printed_as_a_bound():
    rows = repeated(np.full(40, 2.0) + np.arange(40) / 100, 1)
    table = rows.compare("turns", "way")
    assert table["p"].tolist() == [pytest.approx(0.0002)]
    assert str(table).splitlines()[1].endswith("  < 0.0002")
    assert r"\textless{} 0.0002 \\" in table.latex()
    clear = repeated([1.0, -1.0] * 60, 1).compare("turns", "way")
    assert str(clear).endswith("  1")


def test_few_seeds_have_a_note_that_intervals_of_means_are_too_narrow():
    too_narrow = "Bootstrap intervals of means of up to 100 seeds may be too narrow"
    note = f"{too_narrow}; intervals of Student's t stand beside them."
    assert ROWS.summary().notes == [note]
    assert str(ROWS.compare("turns", "way")).endswith(f"\n{note}")
    assert note in ROWS.summary().latex()
    assert ROWS.summary(metrics=["wins.red"]).notes == []  # of Wilson
    assert note not in repeated(np.arange(101), 8).compare("turns", "way").notes
    assert note in repeated(np.arange(100), 8).compare("turns", "way").notes


def test_few_seeds_have_the_interval_of_student_beside_the_others():
    import scipy.stats

    values = np.random.default_rng(3).normal(size=10)
    table = repeated(values, 3).compare("turns", "way", confidence=0.9)
    theirs = scipy.stats.ttest_1samp(values, 0.0).confidence_interval(0.9)
    assert (table["t_low"][0], table["t_high"][0]) == pytest.approx((theirs.low, theirs.high))
    assert list(table).index("t_low") == list(table).index("high") + 1
    assert f"& [{theirs.low:.2f}, {theirs.high:.2f}] &" in table.latex()
    summary = ROWS.summary(metrics=["turns", "wins.red"])
    assert np.isfinite(summary["t_low"]).tolist() == [True, False, False, False]  # equal values, and rates of wins
    assert "t_low" not in repeated(np.arange(101), 3).compare("turns", "way")


@pytest.mark.parametrize("make", [ROWS.summary, lambda: ROWS.compare("turns", "way")])
def test_the_unit_of_replication_is_named_where_a_table_is_published(make):
    assert "The unit of replication is the seed: games of one seed are averaged first." in make().latex()


def crossed(differences, copies=1):
    """Return rows of two ways on two maps: way a takes 2 turns longer, and on the large map these differences more."""
    rows = []
    for copy in range(copies):
        for way in ("a", "b"):
            for size in (5, 10):
                for seed, difference in enumerate(differences):
                    turns = seed + 2.0 * (way == "a") + size + float(difference) * (way == "a" and size == 10)
                    settings = {"copy": copy, "way": way, "size": size, "seed": seed}
                    rows.append({"id": str(len(rows)), **settings, "turns": turns, "winner": None, "error": None})
    return Rows(rows, ["copy", "way", "size"])


def test_an_interaction_is_that_of_a_mixed_model():
    turns = {
        ("a", 5): [18, 21, 22, 21, 27, 21, 20, 19, 25, 31, 24, 17],
        ("b", 5): [15, 12, 19, 19, 27, 22, 14, 17, 21, 27, 21, 11],
        ("a", 10): [27, 25, 25, 30, 32, 29, 24, 26, 32, 35, 28, 23],
        ("b", 10): [17, 15, 22, 20, 27, 19, 18, 16, 27, 29, 27, 17],
    }
    rows = [
        {
            "id": f"{way} {size} {seed}",
            "way": way,
            "size": size,
            "seed": seed,
            "turns": one,
            "winner": None,
            "error": None,
        }
        for (way, size), each in turns.items()
        for seed, one in enumerate(each)
    ]
    table = Rows(rows, ["way", "size"]).interaction("turns", "way", "size")
    # statsmodels 0.15: mixedlm("turns ~ C(way, Treatment('b')) * C(size, Treatment(10))", rows, groups="seed").fit()
    assert table["difference"][0] == pytest.approx(-3.4166667)
    assert [table["low"][0], table["high"][0]] == pytest.approx([-5.541, -1.292], abs=0.6)
    assert [table["t_low"][0], table["t_high"][0]] == pytest.approx([-6.0775, -0.7558], abs=1e-4)  # of t, by SciPy
    assert table["p"][0] < 0.05


def test_an_interaction_compares_differences_of_the_same_seeds():
    differences = np.random.default_rng(1).normal(0.5, 1.0, 120)
    table = crossed(differences, 3).interaction("turns", "way", "size")
    assert [table[name][0] for name in list(table)[:6]] == ["a", "b", 5, 10, 360, 120]
    alone = repeated(-differences, 1).compare("turns", "way")
    for name in ("difference", "low", "high", "effect", "p"):
        assert table[name][0] == pytest.approx(alone[name][0])
    assert table.notes == ["Averaged over copy."]
    assert crossed(differences).compare("turns", "way").notes == ["Averaged over size."]
    swapped = crossed(differences).interaction("turns", "size", "way")
    assert swapped["difference"][0] == pytest.approx(table["difference"][0])


def test_power_is_that_of_the_t_test():
    expected = {0.2: 199, 0.5: 34, 0.8: 15}  # of statsmodels: TTestPower().solve_power(effect, alpha=.05, power=.8)
    for effect, seeds in expected.items():
        assert experiment.power(2.0, effect * 2.0) == seeds
        assert experiment.power(2.0, -effect * 2.0) == seeds
    assert experiment.power(1.0, 0.5, power=0.9, alpha=0.01) == 63
    assert experiment.power(1.0, 100.0) == 6  # five signs cannot give p < 0.05


def test_power_takes_the_spread_of_rows_by_seed():
    rows = repeated(np.arange(8.0), 8)
    spread = float(np.std(np.arange(8.0), ddof=1))
    assert experiment.power(rows, 1.0, metric="turns", by="way") == experiment.power(spread, 1.0)


@pytest.mark.parametrize(
    ("given", "options", "message"),
    [
        ((1.0, 0.0), {}, "difference is 0"),
        ((0.0, 1.0), {}, "spread must be"),
        ((1.0, 1.0), {"power": 1.0}, "power less than 1"),
        ((1.0, 1.0), {"alpha": 0.9}, "alpha must be less than power"),
        ((1.0, 1.0), {"by": "way"}, "are for rows"),
        ((ROWS, 1.0), {"by": "way"}, "need metric= and by="),
        ((repeated([2.0, 2.0], 3), 1.0), {"metric": "turns", "by": "way"}, "play more seeds"),
    ],
)
def test_power_refuses_invalid_arguments(given, options, message):
    with pytest.raises(BadValue, match=message):
        experiment.power(*given, **options)


def test_unknown_columns_and_keys_are_named():
    with pytest.raises(UnknownName, match=r"Did you mean 'score\.red'"):
        ROWS.summary(metrics=["score.rde"])
    with pytest.raises(UnknownName, match="Did you mean 'way'"):
        ROWS.compare("turns", "wya")
    with pytest.raises(UnknownName, match="Unknown varied key 'seed'"):
        ROWS.compare("turns", "seed")
    with pytest.raises(UnknownName, match="Did you mean 'size'"):
        crossed([1.0]).interaction("turns", "way", "sise")
    with pytest.raises(BadValue, match="of two keys, not of 'way' with itself"):
        crossed([1.0]).interaction("turns", "way", "way")
    with pytest.raises(BadValue, match="'copy' has one"):
        crossed([1.0]).interaction("turns", "way", "copy")


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


def test_the_indices_of_a_played_sample_name_the_important_settings():
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
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("way", "score of red")
    assert [label.get_text() for label in axes.get_xticklabels()] == ["a", "b"]
    (bars,) = axes.containers
    assert bars.lines[0].get_ydata().tolist() == [2.0, 4.0]
    assert axes.get_title().startswith("Bootstrap intervals")
    assert ROWS.plot(y="score.red", ax=figure.add_subplot()).get_xlabel() == "way"
    with pytest.raises(UnknownName):
        ROWS.plot("wya")


@pytest.mark.parametrize(
    ("key", "words"),
    [
        ("turns", "turns"),
        ("max_turns", "max turns"),
        ("wins.pursuers", "share of games won by pursuers"),
        ("score.red", "score of red"),
        ("strategies.blue", "strategy of blue"),
        ("teams.red.count", "red: count"),
        ("teams.red.sensors.eyes.range_m", "red: sensors.eyes.range m"),
    ],
)
def test_axes_have_words_as_labels(key, words):
    assert describe_key(key) == words


def test_ticks_of_whole_numbers_are_whole():
    figure = pytest.importorskip("matplotlib.figure").Figure()
    axes = figure.subplots()
    points = [(count, (0.1 * count, 0.0, 1.0)) for count in (1, 2, 3)]
    plot("teams.red.count", "wins.red", None, {None: points}, axes, [])
    figure.canvas.draw()
    assert all(float(tick).is_integer() for tick in axes.get_xticks())


def test_a_plot_names_the_keys_that_it_averages_over():
    figure = pytest.importorskip("matplotlib.figure").Figure()
    rows = repeated(np.arange(101.0), 3)
    assert rows.plot("way", ax=figure.add_subplot()).get_title() == "Averaged over copy."
    assert rows.plot("way", hue="copy", ax=figure.add_subplot()).get_title() == ""


def test_equal_values_are_drawn_without_an_interval():
    figure = pytest.importorskip("matplotlib.figure").Figure()
    (bars,) = repeated([2.0] * 30, 2).plot("way", ax=figure.add_subplot()).containers
    assert bars.lines[0].get_ydata().tolist() == [2.0, 0.0]
    assert [len(ends) for ends in bars.lines[2][0].get_segments()] == [0, 0]
