"""Strategies are evaluated on maps, against opponents, between a reference and exact play."""

import numpy as np
import pytest

from gamms import experiment, rl
from gamms.errors import BadType, BadValue, Duplicate, UnknownName
from gamms.scenario import Scenario
from gamms.strategies import chase, flee, random_walk, stay

MAPS = {"square": {"grid": {"rows": 4, "columns": 4}}, "long": {"grid": {"rows": 3, "columns": 9}}}
OWN = {"walk": random_walk, "chase": chase}
OTHERS = {"flee": flee, "stay": stay}


def scene(**more):
    teams = {
        "red": {"count": 2, "sensors": ["eyes"]},
        "blue": {"count": 1, "sensors": ["eyes"], "strategy": "gamms.strategies:random_walk"},
    }
    rules = [{"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": "eliminate"}}, "last_team"]
    eyes = {"eyes": {"type": "AGENT"}}
    return Scenario(map=MAPS["square"], max_turns=20, sensors=eyes, teams=teams, rules=rules, **more)


def rows_of(table):
    return [dict(zip(table, cells, strict=True)) for cells in zip(*map(list, table.values()), strict=True)]


def test_an_evaluation_has_the_rows_of_the_experiment():
    found = rl.evaluate(scene(), OWN, team="red", opponents=OTHERS, maps=MAPS, games=8, seed=5)
    vary = {"map": MAPS, "strategies.red": OWN, "strategies.blue": OTHERS}
    same = experiment.run(scene(), range(5, 13), vary)
    assert found.rows.sha256() == same.sha256()
    rows = rows_of(found.table())
    assert "gap_closed" not in rows[0]
    assert len(rows) == 2 * 2 * 2 + 2 * 2
    rates = same.summary(metrics=["wins.red"])
    assert [row["mean"] for row in rows[:8]] == list(rates["mean"])
    means = {(row["map"], row["strategies.red"], row["strategies.blue"]): row["mean"] for row in rows}
    for own in OWN:
        for other in OTHERS:
            assert means["all maps", own, other] == pytest.approx(np.mean([means[map, own, other] for map in MAPS]))


def test_the_gap_closed_is_0_for_the_reference_and_1_for_exact_play():
    found = rl.evaluate(scene(), {**OWN, "stay": stay}, team="red", opponents=OTHERS, maps=MAPS, games=10, exact=chase)
    rows = rows_of(found.table())
    means = {(row["map"], row["strategies.blue"], row["strategies.red"]): row["mean"] for row in rows}
    shares = {"walk": 0.0, "exact": 1.0, "chase": 1.0}
    is_some = 0
    for row in rows:
        walk, exact, own = (
            means[row["map"], row["strategies.blue"], name] for name in ("walk", "exact", row["strategies.red"])
        )
        if np.isnan(row["gap_closed"]):
            assert exact - walk < 0.6  # 10 games
            continue
        is_some += 1
        assert row["gap_closed"] == pytest.approx((own - walk) / (exact - walk))
        assert row["gap_closed"] == pytest.approx(shares.get(row["strategies.red"], row["gap_closed"]))
    assert is_some
    assert found.gap_closed("chase") == 1.0
    assert found.gap_closed("walk") == 0.0
    assert found.gap_closed("stay") < 0.0
    below = rl.evaluate(scene(), OWN, team="red", games=8, exact=chase, reference="chase")
    with pytest.raises(BadValue, match=r"no gap for 'walk' to close.*the reference 'chase'"):
        below.gap_closed("walk")
    with pytest.raises(UnknownName, match="Did you mean 'walk'"):
        below.gap_closed("wlak")
    with pytest.raises(UnknownName, match=r"'other'\. There are: 'walk', 'chase', 'exact'"):
        below.gap_closed("other")


def make_evaluation(won):
    """Return the evaluation of games that are won by numbers of seeds: map -> strategy -> won games of 40."""
    rows = [
        {"id": f"{map}-{name}-{seed}", "seed": seed, "map": map, "strategies.red": name, "error": None}
        | {"winner": "red" if seed < number else None, "turns": 1}
        for map, numbers in won.items()
        for name, number in numbers.items()
        for seed in range(40)
    ]
    return rl.Evaluation(experiment.Rows(rows, ["map", "strategies.red"]), "red", "wins.red", "chase")


def test_the_gap_closed_is_a_ratio_of_sums_with_an_interval_over_seeds():
    hard = {"chase": 10, "mine": 25, "exact": 40}
    found = make_evaluation({"hard": hard, "easy": {"chase": 39, "mine": 38, "exact": 40}})
    by_map = {row["map"]: row for row in rows_of(found.table()) if row["strategies.red"] == "mine"}
    assert by_map["hard"]["gap_closed"] == pytest.approx(15 / 30)
    assert by_map["hard"]["gap_low"] < 0.5 < by_map["hard"]["gap_high"]
    assert np.isnan([by_map["easy"][key] for key in ("gap_closed", "gap_low", "gap_high")]).all()  # one game of 40
    assert by_map["all maps"]["gap_closed"] == pytest.approx((15 - 1) / (30 + 1))
    assert 0.2 < by_map["all maps"]["gap_low"] < 0.45 < by_map["all maps"]["gap_high"] < 0.7
    assert found.gap_closed("mine") == pytest.approx((15 - 1) / (30 + 1))
    with pytest.raises(BadValue, match="no exact play beats the reference 'chase' significantly"):
        make_evaluation({"easy": {"chase": 37, "mine": 38, "exact": 40}}).gap_closed("mine")


def test_wrong_opponents_and_metrics_are_refused_before_games_are_played():
    with pytest.raises(BadValue, match="opponents is empty"):
        rl.evaluate(scene(), OWN, team="red", opponents={})
    with pytest.raises(UnknownName, match=r"Unknown metric 'wins\.green'\. Did you mean 'wins\.red'"):
        rl.evaluate(scene(), OWN, team="red", metric="wins.green")


def test_an_evaluation_goes_on_in_its_folder(tmp_path):
    options = {"team": "red", "opponents": {"blue": OTHERS}, "maps": [*MAPS.values()], "out": tmp_path / "results"}
    whole = rl.evaluate(scene(), OWN, games=6, **{**options, "out": None})
    again = rl.evaluate(scene(), OWN, games=6, **options)
    assert again.rows.sha256() == whole.rows.sha256()
    assert experiment.load(tmp_path / "results").sha256() == whole.rows.sha256()
    assert {row["map"] for row in again.rows} == {"0", "1"}


def test_other_metrics_and_latex_tables(tmp_path):
    found = rl.evaluate(scene(), OWN, team="red", games=5, metric="turns")
    assert set(found.table()["metric"]) == {"turns"}
    assert r"\toprule" in found.table().latex()
    assert str(found) == str(found.table())
    pytest.importorskip("matplotlib").use("Agg")
    assert found.plot().get_ylabel()


def test_wrong_arguments_of_an_evaluation_are_refused_by_name():
    with pytest.raises(UnknownName, match=r"Unknown team 'rde'\. Did you mean 'red'"):
        rl.evaluate(scene(), OWN, team="rde")
    with pytest.raises(UnknownName, match=r"Unknown strategy 'chas'\. Did you mean 'chase'"):
        rl.evaluate(scene(), OWN, team="red", reference="chas")
    with pytest.raises(BadValue, match="strategies is empty"):
        rl.evaluate(scene(), {}, team="red")
    with pytest.raises(BadType, match="strategies must be"):
        rl.evaluate(scene(), chase, team="red")
    with pytest.raises(Duplicate, match="'exact'"):
        rl.evaluate(scene(), {"exact": chase}, team="red", exact=chase)
    with pytest.raises(UnknownName, match=r"Unknown opposing team 'bleu'\. Did you mean 'blue'"):
        rl.evaluate(scene(), OWN, team="red", opponents={"bleu": OTHERS})
    three = scene().replace(**{"teams.green": {"count": 1, "strategy": "gamms.strategies:stay"}})
    with pytest.raises(BadValue, match=r"give \{team: \{name: strategy\}\}"):
        rl.evaluate(three, OWN, team="red", opponents=OTHERS)
