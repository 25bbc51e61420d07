"""Populations: exact responses to pools, and mixtures that converge to the values of value iteration."""

from itertools import product

import pytest
from solved_games import PURSUIT, made, scene, simultaneous

from gamms import rl
from gamms.errors import BadValue
from gamms.scenario import Scenario
from gamms.solve import best_response, matrix_game, solve
from gamms.strategies import pool, random_walk, stay

TEAMS = {"red": {"agents": [{"name": "red_0", "node": 0}]}, "blue": {"agents": [{"name": "blue_0", "node": 1}]}}
PENNIES = scene("pair", TEAMS, ["solved_games:pennies"], turns=1)
RACE = scene(
    "grid",
    {"reds": {"agents": [{"name": "runner", "node": 7}]}, "blues": {"agents": [{"name": "guard", "node": 5}]}},
    ["solved_games:race"],
    turns=2,
    settings={"information": "full"},
)
ORDERED = scene(
    "cycle",
    {
        "cops": {"agents": [{"name": "cop_0", "node": 0}, {"name": "cop_1", "node": 0}]},
        "robbers": {"agents": [{"name": "robber_0", "node": 2}]},
    },
    PURSUIT,
    turns=3,
    settings={"order": [["cops"], ["robbers"]], "information": "full"},
)
GAMES = {"pennies": PENNIES, "race": RACE, "ordered pursuit": ORDERED}


def moves_to(*nodes):
    """A strategy that goes to these nodes, one in each turn."""

    def strategy(state):
        state["action"] = nodes[state["turn"] % len(nodes)]

    strategy.__name__ = f"moves to {nodes}"
    return strategy


@pytest.mark.parametrize("name", GAMES)
def test_the_exploitability_of_a_population_falls_to_0_and_its_value_to_that_of_the_game(name):
    game = GAMES[name]
    population = rl.Population(game, {team: [stay] for team in game.spec.teams}, exact=best_response, games=1)
    value = solve(game).value
    for _ in range(20):
        responses = {team: population.responses(team) for team in population.teams}
        high, low = (sign * found.value for sign, found in zip((1.0, -1.0), responses.values(), strict=True))
        assert low - 1e-9 <= value <= high + 1e-9
        if high - low < 0.04:
            break
        for team, found in responses.items():
            population.add(team, found)
    assert population.interval() == (low, high)
    assert (high - low) / 2.0 == pytest.approx(0.0, abs=0.02)
    assert matrix_game(population.payoffs).value == pytest.approx(value, abs=0.02)


def test_the_gap_of_a_pursuit_in_which_all_move_at_once_falls_within_eight_rounds():
    nodes = {"red": 0, "blue": 5}
    teams = {team: {"agents": [{"name": team, "node": node}]} for team, node in nodes.items()}
    rules = [{"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": "eliminate", "score": 1}}]
    grid = {"grid": {"rows": 4, "columns": 4}}
    game = Scenario(map=grid, teams=teams, rules=rules, max_turns=4, settings={"information": "full"})
    population = rl.Population(game, {team: [stay] for team in nodes}, exact=best_response, games=1)
    value = solve(game).value
    gaps = []
    for _ in range(9):
        responses = {team: population.responses(team) for team in nodes}
        high, low = responses["red"].value, -responses["blue"].value
        assert low - 1e-9 <= value <= high + 1e-9
        gaps.append(high - low)
        if gaps[-1] < 1e-9:
            break
        for team, found in responses.items():
            population.add(team, found)
    assert gaps[-1] < gaps[0]


@pytest.mark.parametrize("order", [None, [["red"], ["blue"]], [["blue"], ["red"]]])
@pytest.mark.parametrize("weights", [[1, 1, 1, 1], [5, 1, 1, 2]])
def test_a_response_to_a_pool_is_as_good_as_the_best_of_all_strategies(order, weights):
    settings = {} if order is None else {"order": order}
    game = scene("pair", TEAMS, ["solved_games:pennies"], turns=2, settings=settings)
    blues = [moves_to(*nodes) for nodes in product((0, 1), repeat=2)]
    found = best_response(game, team="red", against=pool(blues, weights))
    assert found.information == "full"
    scores = {"red": [], "blue": []}
    for blue in blues:
        scored = game.play(strategies={"red": found.strategy, "blue": blue}).scores
        for team, values in scores.items():
            values.append(scored.get(team, 0.0))
    leads = [red - blue for red, blue in zip(scores["red"], scores["blue"], strict=True)]
    shares = [weight / sum(weights) for weight in weights]
    assert found.value == pytest.approx(sum(share * lead for share, lead in zip(shares, leads, strict=True)))
    assert found.value == pytest.approx(best_value_by_hand(order, shares))


def best_value_by_hand(order, shares):
    """The value of the best of all red strategies in two turns of pennies, by sums over blue's moves."""
    joint = dict(zip(product((0, 1), repeat=2), shares, strict=True))

    def best(weights):
        lead = {node: {other: 2 - node if node == other else -1 for other in (0, 1)} for node in (0, 1)}
        if order is not None and order[0] == ["blue"]:  # red sees blue's move first
            return sum(weight * max(lead[node][other] for node in (0, 1)) for other, weight in weights.items())
        return max(sum(weight * lead[node][other] for other, weight in weights.items()) for node in (0, 1))

    first = {one: joint[one, 0] + joint[one, 1] for one in (0, 1)}
    return best(first) + sum(best({two: joint[one, two] for two in (0, 1)}) for one in (0, 1))


def test_a_response_to_a_pool_of_one_member_is_that_to_the_member():
    game = scene("fan", ORDERED.to_dict()["teams"], PURSUIT, turns=2)
    one, several = (best_response(game, team="cops", against=one) for one in (stay, pool([stay])))
    assert several.value == one.value
    assert several.bound == one.bound
    assert simultaneous(made("fan"), 0, 2, 2) <= one.value


def test_a_response_to_a_pool_can_be_responded_to():
    red = best_response(PENNIES, team="red", against=pool([moves_to(0), moves_to(1)], [3, 1])).strategy
    found, same = (best_response(PENNIES, team="blue", against=one) for one in (red, pool([red])))
    assert found.value == same.value == 1.0  # red always goes to node 0


def test_pools_that_draw_and_games_without_an_end_are_refused():
    with pytest.raises(BadValue, match="draws random numbers"):
        best_response(PENNIES, team="red", against=pool([stay, random_walk]))
    with pytest.raises(BadValue, match="needs a game with a last turn"):
        best_response(scene("pair", TEAMS, ["solved_games:pennies"]), team="red", against=pool([stay, moves_to(0)]))
