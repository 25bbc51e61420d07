"""Mixtures of strategies, beside a linear program of SciPy, brute force and value iteration."""

from itertools import product

import numpy as np
import pytest
from solved_games import GRAPHS, matrix_value, pursuit, scene, simultaneous

from gamms.errors import BadValue, TooLarge, UnknownName
from gamms.solve import double_oracle, evaluate, matrix_game, solve
from gamms.strategies import chase, stay

TEAMS = {"red": {"count": 1}, "blue": {"count": 1}}
PENNIES = scene("pair", TEAMS, ["solved_games:pennies"], turns=2)
CHASE = pursuit("fan", [0], [2], turns=2)


@pytest.mark.parametrize("shape", [(1, 1), (1, 4), (5, 3), (20, 20)])
@pytest.mark.parametrize("entries", ["real", "few", "antisymmetric"])
def test_no_action_gains_against_an_equilibrium_whose_value_is_that_of_scipy(shape, entries):
    rng = np.random.default_rng(7)
    for _ in range(5):
        payoffs = rng.normal(size=shape) if entries == "real" else rng.integers(-1, 2, shape).astype(float)
        if entries == "antisymmetric":
            payoffs = payoffs[: min(shape), : min(shape)]
            payoffs = payoffs - payoffs.T
        value, rows, columns = matrix_game(payoffs)
        assert value == pytest.approx(matrix_value(payoffs), abs=1e-9)
        assert rows.sum() == pytest.approx(1.0)
        assert columns.sum() == pytest.approx(1.0)
        assert (rows @ payoffs).min() == pytest.approx(value, abs=1e-9)
        assert (payoffs @ columns).max() == pytest.approx(value, abs=1e-9)


@pytest.mark.parametrize("payoffs", [[], [1, 2], [[1, 2], [3]], [["a"]], [[1.0, float("nan")]], [[float("inf")]]])
def test_a_matrix_that_is_none_is_refused(payoffs):
    with pytest.raises(BadValue, match="payoffs"):
        matrix_game(payoffs)


def test_a_double_oracle_ends_at_the_value_that_brute_force_finds():
    found = double_oracle(CHASE)
    assert found.value == pytest.approx(simultaneous(GRAPHS["fan"], 0, 2, 2), abs=1e-9)
    assert found.gap < 1e-9
    assert found.gaps[0] > found.gap


@pytest.mark.parametrize("order", [None, [["red"], ["blue"]], [["blue"], ["red"]]])
def test_it_ends_at_the_value_of_value_iteration_whichever_team_moves_first(order):
    game = PENNIES if order is None else PENNIES.replace(settings={"order": order})
    found = double_oracle(game, team="blue", discount=0.9)
    assert found.value == pytest.approx(solve(game, team="blue", discount=0.9).value, abs=1e-9)
    assert found.payoffs.shape == (len(found.mixtures["blue"]), len(found.mixtures["red"]))


def test_its_mixtures_play_as_the_matrix_says():
    found = double_oracle(CHASE)
    assert max(found.mixtures["robbers"]) < 1.0, "it is drawn which strategy is played"
    strategies = {team: found.strategy(team) for team in found.teams}
    scores = [CHASE.play(seed, strategies).scores.get("cops", 0) for seed in range(40)]
    assert np.mean(scores) == pytest.approx(found.value, abs=0.2)


def test_an_answer_is_best_also_to_moves_that_no_strategy_of_the_other_team_makes():
    game = scene("pair", TEAMS, ["solved_games:apart"], turns=2, settings={"order": [["red"], ["blue"]]})
    blue = double_oracle(game).strategy("blue")
    for moves in product((0, 1), repeat=2):

        def red(state, moves=moves):
            state["action"] = moves[state["turn"]]

        assert game.play(strategies={"red": red, "blue": blue}).scores == {"blue": 4.0}


@pytest.mark.parametrize("graph", ["random 1", "random 4", "random 6"])
def test_it_ends_where_best_responses_ask_each_other_and_matrices_have_many_equal_entries(graph):
    game = pursuit(graph, [0], [5], turns=2)
    found = double_oracle(game, team="cops")
    assert found.gap < 1e-9
    assert found.value == pytest.approx(solve(game, team="cops").value, abs=1e-9)


@pytest.mark.parametrize("limit", [{"iterations": 2}, {"max_nodes": 250}, {"max_nodes": 3_000}])
def test_an_oracle_that_is_cut_short_says_by_how_much_it_may_be_off(limit):
    game = pursuit("random 4", [0], [5], turns=3)
    found = double_oracle(game, team="cops", **limit)
    assert 2 <= len(found.gaps) < 100
    assert found.gap > 0.1
    low, high = found.bounds
    assert low <= solve(game, team="cops").value <= high
    assert low <= found.value <= high
    assert high - low <= found.gap + 1e-12
    assert f"bounds=({low:.6g}, {high:.6g})" in repr(found)
    assert {len(shares) for shares in found.mixtures.values()} == {*found.payoffs.shape}
    assert game.play(1, {team: found.strategy(team) for team in found.teams}).turns <= 3


def test_bounds_get_narrower_until_they_are_the_value():
    several = [double_oracle(CHASE, iterations=number) for number in range(1, 1 + len(double_oracle(CHASE).gaps))]
    lows, highs = zip(*(one.bounds for one in several), strict=True)
    assert list(lows) == sorted(lows)
    assert list(highs) == sorted(highs, reverse=True)
    assert highs[-1] - lows[-1] < 1e-9
    assert lows[-1] == pytest.approx(several[-1].value, abs=1e-9)
    assert "bounds" not in repr(several[-1])


def test_it_is_refused_that_teams_see_too_much_for_one_best_response():
    with pytest.raises(TooLarge, match="more than max_nodes=5 different observations"):
        double_oracle(CHASE, max_nodes=5)
    with pytest.raises(BadValue, match="max_nodes must be at least 1"):
        double_oracle(CHASE, max_nodes=0)


def test_games_without_a_last_turn_and_unknown_teams_are_refused():
    with pytest.raises(BadValue, match="turns="):
        double_oracle(pursuit("path", [0], [2]))
    with pytest.raises(UnknownName, match="police"):
        double_oracle(CHASE, team="police")
    with pytest.raises(UnknownName, match="police"):
        double_oracle(PENNIES).strategy("police")


def test_a_strategy_is_evaluated_on_average_and_at_worst():
    eyes = {"eyes": {"type": "AGENT"}}
    seeing = {"teams.cops.sensors": ["eyes"], "teams.robbers.sensors": ["eyes"]}
    game = pursuit("path", [0], [2], turns=3, sensors=eyes).replace(**seeing)
    found = evaluate(game, chase, team="cops", opponents={"stay": stay, "chase": chase}, games=2)
    assert found.by_opponent == {"stay": 1.0, "chase": 1.0}
    assert found.average == 1.0
    assert found.worst == -found.response.value
    assert found.worst <= 1.0
    assert evaluate(game, chase, team="cops", opponents={"stay": stay}, method=None, games=1).worst == 1.0
    with pytest.raises(BadValue, match="opponents="):
        evaluate(game, chase, team="cops", opponents={})
