"""Scenarios as games of OpenSpiel: its own checks, and its values beside ours."""

import sys

import numpy as np
import pytest
from solved_games import matrix_value, pursuit, scene

pytest.importorskip("pyspiel", reason="OpenSpiel is not installed")

import pyspiel
from open_spiel.python import policy
from open_spiel.python.algorithms import cfr, expected_game_score, exploitability

from gamms.errors import BadValue, MissingExtra
from gamms.solve import double_oracle, matrix_game, openspiel, solve

EYES = {"eyes": {"type": "AGENT"}}
TEAMS = {"red": {"count": 1, "sensors": ["eyes"]}, "blue": {"count": 1, "sensors": ["eyes"]}}
PENNIES = scene("pair", TEAMS, ["solved_games:pennies"], turns=2, sensors=EYES)


def ours(solution, game, turned):
    """The policy of a solution in the turn-based form of a game."""
    found, shares = policy.TabularPolicy(turned), {}

    def walk(state):
        if state.is_terminal():
            return
        places = dict(zip(solution.table.roster.names, solution.table.nodes[state.number].tolist(), strict=True))
        for player, team in enumerate(solution.table.setup.teams):
            nodes = {tuple(one.nodes.items()): one.share for one in solution.policy(team, places, state.turn)}
            row = [
                nodes.get(tuple(solution.table.name_actions(state.number, player, action).items()), 0.0)
                for action in state.legal_actions(player)
            ]
            shares[state.information_state_string(player)] = row
        for first in state.legal_actions(0):
            for second in state.legal_actions(1):
                after = state.clone()
                after.apply_actions([first, second])
                walk(after)

    walk(game.new_initial_state())
    for text, row in found.state_lookup.items():
        known = shares[text.split("\n", 1)[1]]
        found.action_probability_array[row, : len(known)] = known
    return found


@pytest.mark.parametrize(
    "scenario",
    [
        PENNIES,
        pursuit("path", [0], [2], turns=2, sensors=EYES).replace(
            **{"teams.cops.sensors": ["eyes"], "teams.robbers.sensors": ["eyes"]}
        ),
    ],
    ids=["pennies", "pursuit"],
)
def test_openspiel_finds_the_same_value_and_nothing_to_gain_against_our_strategies(scenario):
    solution, game = solve(scenario), openspiel(scenario)
    turned = pyspiel.convert_to_turn_based(game)
    played = ours(solution, game, turned)
    assert solution.is_exact
    assert exploitability.exploitability(turned, played) == pytest.approx(0.0, abs=1e-9)
    value = expected_game_score.policy_value(turned.new_initial_state(), [played, played])
    assert value == pytest.approx([solution.value, -solution.value], abs=1e-9)


def test_the_double_oracle_ends_at_the_value_of_the_matrix_that_openspiel_makes_of_the_game():
    matrix = pyspiel.extensive_to_matrix_game(pyspiel.convert_to_turn_based(openspiel(PENNIES)))
    expected = matrix_value(matrix.row_utilities())
    found = double_oracle(PENNIES)
    assert found.value == pytest.approx(expected, abs=1e-9)
    assert solve(PENNIES).value == pytest.approx(expected, abs=1e-9)


def test_cfr_gets_near_our_value():
    turned = pyspiel.convert_to_turn_based(openspiel(PENNIES))
    solver = cfr.CFRPlusSolver(turned)
    for _ in range(100):
        solver.evaluate_and_update_policy()
    average = solver.average_policy()
    value = expected_game_score.policy_value(turned.new_initial_state(), [average, average])[0]
    assert value == pytest.approx(solve(PENNIES).value, abs=2 * exploitability.nash_conv(turned, average))
    assert exploitability.exploitability(turned, average) < 0.03


def test_the_game_passes_openspiels_own_simulations():
    game = openspiel(PENNIES)
    pyspiel.random_sim_test(game, num_sims=3, serialize=False, verbose=False)
    state = game.new_initial_state()
    state.apply_actions([0, 1])
    assert state.clone().history() == state.history()
    assert len(state.information_state_tensor(0)) == game.information_state_tensor_size()
    assert str(state).startswith("turn 1: blue_0 on ")
    assert state.rewards() == state.returns() == [-state.returns()[1], state.returns()[1]]


def in_turns(*order):
    return PENNIES.replace(settings={"order": [[team] for team in order]})


def by_brute_force(state):
    """The value for the first player where both know everything."""
    if state.is_terminal():
        return state.returns()[0]
    best = (max, min)[state.current_player()]
    return best(by_brute_force(state.child(action)) for action in state.legal_actions())


@pytest.mark.parametrize("order", [("red", "blue"), ("blue", "red")])
def test_teams_that_move_in_turn_make_a_game_of_sequential_moves(order):
    game = openspiel(in_turns(*order))
    assert game.get_type().dynamics == pyspiel.GameType.Dynamics.SEQUENTIAL
    pyspiel.random_sim_test(game, num_sims=5, serialize=False, verbose=False)
    solution = solve(in_turns(*order))
    assert solution.is_exact
    assert by_brute_force(game.new_initial_state()) == pytest.approx(solution.value, abs=1e-9)
    solver = cfr.CFRPlusSolver(game)
    for _ in range(30):
        solver.evaluate_and_update_policy()
    gain = exploitability.nash_conv(game, solver.average_policy())
    value = expected_game_score.policy_value(game.new_initial_state(), [solver.average_policy()] * 2)[0]
    assert value == pytest.approx(solution.value, abs=gain + 1e-9)


def test_who_moves_second_sees_what_the_first_has_done_if_its_sensors_show_it():
    for sensors, differs in ((["eyes"], True), ([], False)):
        game = openspiel(in_turns("red", "blue").replace(**{"teams.blue.sensors": sensors}))
        texts = {game.new_initial_state().child(action).information_state_string(1) for action in (0, 1)}
        assert (len(texts) == 2) is differs


def test_a_game_without_a_winner_is_worth_nothing_to_both():
    chase = pursuit("path", [0], [2], turns=1)
    assert solve(chase, reward="win").value == 0.0
    state = openspiel(chase, reward="win").new_initial_state()
    state.apply_actions([0, 0])
    assert state.is_terminal()
    assert state.returns() == [0.0, 0.0]


def test_players_know_what_their_sensors_show_and_no_more():
    blind = openspiel(PENNIES.replace(**{"teams.red.sensors": []}))
    seeing = openspiel(PENNIES)
    told = []
    for game in (blind, seeing):
        texts = []
        for other in (0, 1):
            state = game.new_initial_state()
            state.apply_actions([0, other])
            texts.append(state.information_state_string(0))
        told.append(texts)
    assert told[0][0] == told[0][1]
    assert told[1][0] != told[1][1]


def test_games_that_openspiel_cannot_have_are_refused(monkeypatch):
    with pytest.raises(BadValue, match="turns="):
        openspiel(scene("pair", TEAMS, ["solved_games:pennies"], sensors=EYES))
    narrow = in_turns("red", "blue").replace(conflicts={"capacity": 1, "resolve": {"by_priority": ["blue", "red"]}})
    with pytest.raises(BadValue, match="remove conflicts"):
        openspiel(narrow)
    with pytest.raises(BadValue, match="A game of 3 teams cannot become a game of OpenSpiel"):
        openspiel(scene("pair", {**TEAMS, "green": {"count": 1}}, ["solved_games:pennies"], turns=1, sensors=EYES))
    monkeypatch.setitem(sys.modules, "gamms.solve.teams_game", None)
    with pytest.raises(MissingExtra, match=r"extra .solve.*pip install"):
        openspiel(PENNIES)


def test_psro_comes_to_an_equilibrium():
    pytest.importorskip("cvxpy", reason="PSRO of OpenSpiel needs cvxpy")
    from open_spiel.python.algorithms import policy_aggregator
    from open_spiel.python.algorithms.psro_v2 import best_response_oracle, psro_v2

    def nash(solver, return_joint=False):
        _, rows, columns = matrix_game(solver.get_meta_game()[0])
        return ([rows, columns], np.outer(rows, columns).ravel()) if return_joint else [rows, columns]

    turned = pyspiel.convert_to_turn_based(openspiel(PENNIES))
    oracle = best_response_oracle.BestResponseOracle(game=turned)
    solver, found = psro_v2.PSROSolver(turned, oracle, sims_per_entry=1, meta_strategy_method=nash), []
    for _ in range(14):
        solver.iteration()
        mixed = policy_aggregator.PolicyAggregator(turned).aggregate(
            range(2), solver.get_policies(), solver.get_meta_strategies()
        )
        found.append(exploitability.exploitability(turned, mixed))
        if found[-1] < 1e-6:
            break
    assert found[0] > 0.5
    assert found[-1] < 1e-6
