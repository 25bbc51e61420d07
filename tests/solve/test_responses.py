"""Best responses to strategies, what teams could gain by them, and how far that is from equilibrium."""

from functools import cache

import pytest
from solved_games import GRAPHS, neighbours, pursuit, scene

from gamms.errors import BadValue, MissingExtra, UnknownName
from gamms.solve import best_response, exploitability, nash_conv, solve
from gamms.strategies import random_walk

TEAMS = {"red": {"count": 1}, "blue": {"count": 1}}
PENNIES = scene("pair", TEAMS, ["solved_games:pennies"], turns=6)
RUN = pursuit(
    "cycle", [0], [2], turns=6, sensors={"eyes": {"type": "AGENT"}}, settings={"order": [["robbers"], ["cops"]]}
)


def stay(state):
    state["action"] = state["curr_pos"]


def alternate(state):
    """Go to the other node in every second turn, counted in the memory."""
    count = state["memory"]["count"] = (state["memory"].get("count", 0) + 1) % 2
    state["action"] = state["legal"][-1] if count else state["curr_pos"]


def clockwise(state):
    state["action"] = (state["curr_pos"] + 1) % 5


def test_the_best_response_to_a_strategy_is_what_brute_force_says():
    answer = best_response(RUN, team="cops", against=clockwise, turns=6)

    @cache
    def value(cop, robber, left):
        if not left:
            return 0.0
        moved = (robber + 1) % 5
        if moved == cop:  # it runs into the cop, which moves second
            return 1.0
        ends = [1.0 if to == moved else value(to, moved, left - 1) for to in neighbours(GRAPHS["cycle"])[cop]]
        return max(ends)

    assert answer.value == value(0, 2, 6) == 1.0
    assert (answer.interval, answer.method, answer.information) == ((1.0, 1.0), "exact", "full")
    played = RUN.play(strategies={"robbers": clockwise, "cops": answer.strategy})
    assert played.winner == "cops"


def test_a_strategy_with_memory_is_answered_by_its_future_actions():
    start = solve(PENNIES).table.nodes[0].tolist()
    blue = start[0]

    @cache
    def value(blue, count, left):
        if not left:
            return 0.0
        count = (count + 1) % 2
        blue = 1 - blue if count else blue
        return max((2.0 - red if red == blue else -1.0) for red in (0, 1)) + value(blue, count, left - 1)

    assert best_response(PENNIES, team="red", against=alternate).value == value(blue, 0, 6)


def test_an_equilibrium_cannot_be_exploited_and_other_play_can():
    solution = solve(PENNIES)
    best = {team: solution.strategy(team) for team in ("red", "blue")}
    assert nash_conv(PENNIES, best) == pytest.approx(0.0, abs=1e-9)
    assert best_response(PENNIES, team="blue", against=best["red"]).value == pytest.approx(-solution.value, abs=1e-9)
    start = solution.table.nodes[0].tolist()
    given = {"red": best["red"], "blue": stay}
    expected = 6 * (2 - start[0]) - solution.value  # red on the node of blue, and blue what it gets at best anyway
    assert nash_conv(PENNIES, given) == pytest.approx(expected, abs=1e-9)
    assert exploitability(PENNIES, given) == pytest.approx(expected / 2, abs=1e-9)
    assert exploitability(PENNIES, given, team="blue") == pytest.approx(expected / 2, abs=1e-9)


@pytest.mark.parametrize("team", ["cops", "robbers"])
@pytest.mark.parametrize("order", [None, [["cops"], ["robbers"]], [["robbers"], ["cops"]]])
def test_the_strategy_of_a_best_response_earns_its_value(team, order):
    game = pursuit("path", [0], [3], turns=9, settings={"order": order} if order else {})
    solution = solve(game, reward="turns", team="cops")
    other = solution.strategy("robbers" if team == "cops" else "cops")
    answer = best_response(game, team=team, against=other, reward="turns")
    played = game.play(strategies={team: answer.strategy, "robbers" if team == "cops" else "cops": other})
    assert abs(answer.value) == played.turns


def test_turns_are_paid_by_the_team_whose_reward_they_are():
    still = pursuit("path", [0], [4], turns=9)
    assert best_response(still, team="cops", against=stay, reward="turns").value == -4.0
    assert nash_conv(still, {"cops": stay, "robbers": stay}, team="cops", reward="turns") == -4.0 + 9.0


def test_strategies_of_other_teams_may_be_those_of_the_scenario():
    against = {"robbers": {"agents": [{"name": "robber_0", "node": 4}], "strategy": "gamms.strategies:stay"}}
    teams = {**pursuit("path", [0], [4]).to_dict()["teams"], **against}
    scenario = pursuit("path", [0], [4], turns=9).replace(teams=teams)
    assert best_response(scenario, team="cops").value == 1.0


def test_what_a_method_cannot_treat_is_refused_by_name():
    with pytest.raises(BadValue, match=r"strategy of 'blue' draws"):
        best_response(PENNIES, team="red", against=random_walk)
    with pytest.raises(BadValue, match="method"):
        best_response(PENNIES, team="red", against=stay, method="guess")
    with pytest.raises(BadValue, match="'win'"):
        best_response(PENNIES, team="red", against=stay, method="learn", reward="win")
    with pytest.raises(BadValue, match="'turns'"):
        best_response(PENNIES, team="red", against=stay, method="search", reward="turns")
    with pytest.raises(BadValue, match="against="):
        best_response(PENNIES, team="red", method="search")
    with pytest.raises(UnknownName, match="green"):
        best_response(PENNIES, team="green", against=stay)
    with pytest.raises(UnknownName, match="green"):
        nash_conv(PENNIES, {"green": stay})
    with pytest.raises(BadValue, match="against contains team 'red', which responds"):
        best_response(PENNIES, team="red", against={"red": stay, "blue": stay})
    with pytest.raises(BadValue, match="both teams"):
        nash_conv(PENNIES, {"red": stay})
    endless = solve(scene("pair", TEAMS, ["solved_games:pennies"]), discount=0.9)
    with pytest.raises(BadValue, match="reward='win'"):
        best_response(endless.table.setup.scenario, team="blue", against=endless.strategy("red"), reward="win")


def test_a_response_searches_ahead():
    eyes = {"teams.cops.sensors": ["eyes"], "teams.robbers.sensors": ["eyes"]}
    scenario = pursuit("path", [0], [2], turns=3).replace(sensors={"eyes": {"type": "AGENT"}}, **eyes)
    found = best_response(scenario, team="cops", against=stay, method="search", budget=12)
    exact = best_response(scenario, team="cops", against=stay)
    assert exact.value == 1.0
    assert 0.5 < found.value <= exact.value
    assert (found.method, found.bound, found.information) == ("search", "lower", "agent")
    assert found.interval[0] <= found.value <= found.interval[1]


@pytest.mark.slow
def test_a_response_is_learned():
    pytest.importorskip("sb3_contrib", reason="sb3-contrib is not installed")
    eyes = {"teams.cops.sensors": ["eyes"], "teams.robbers.sensors": ["eyes"]}
    scenario = pursuit("path", [0], [3], turns=6).replace(sensors={"eyes": {"type": "AGENT"}}, **eyes)
    learned = best_response(scenario, team="cops", against=stay, method="learn", budget=8_000)
    exact = best_response(scenario, team="cops", against=stay)
    assert (exact.value, exact.bound) == (1.0, "exact")
    assert 0.9 <= learned.value <= exact.value
    assert (learned.bound, learned.information) == ("lower", "agent")
    assert learned.interval[0] <= learned.value <= learned.interval[1]
    assert scenario.play(strategies={"cops": learned.strategy, "robbers": stay}).winner == "cops"


def test_learning_without_its_library_names_it(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "sb3_contrib", None)
    with pytest.raises(MissingExtra, match=r"extra .train.*pip install"):
        best_response(PENNIES, team="red", against=stay, method="learn")
