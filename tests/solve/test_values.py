"""Values of small games equal brute force, and strategies achieve them."""

from functools import cache

import networkx as nx
import numpy as np
import pytest
from solved_games import GRAPHS, PURSUIT, in_turns, matrix_value, neighbours, pursuit, scene, simultaneous

import gamms
from gamms import kernels
from gamms.errors import BadType, BadValue, TooLarge, UnknownName
from gamms.solve import best_response, solve
from gamms.solve.solution import make_setup
from gamms.solve.table import explore

TEAMS = {"red": {"count": 1}, "blue": {"count": 1}}
TURNS = {"order": [["cops"], ["robbers"]]}


@pytest.mark.parametrize(("graph", "turns"), [("path", 5), ("cycle", 4), ("grid", 2), ("star", 3)])
def test_a_cop_and_a_robber_that_move_at_once_are_worth_what_brute_force_says(graph, turns):
    solution = solve(pursuit(graph, [0], [3], turns=turns), team="robbers")
    assert solution.value == pytest.approx(-simultaneous(GRAPHS[graph], 0, 3, turns), abs=1e-9)
    for robber in (1, 2):
        value = solve(pursuit(graph, [0], [robber], turns=turns), team="cops").value
        assert value == pytest.approx(simultaneous(GRAPHS[graph], 0, robber, turns), abs=1e-9)


@pytest.mark.parametrize(("graph", "cops"), [("path", [0]), ("cycle", [0]), ("fan", [1]), ("cycle", [0, 1])])
def test_games_in_turns_are_worth_what_brute_force_says(graph, cops):
    solution = solve(pursuit(graph, cops, [4], turns=5, settings=TURNS), team="cops")
    assert solution.value == in_turns(GRAPHS[graph], cops, 4, 5)
    assert solution.nash_conv() == 0.0


@pytest.mark.parametrize(
    ("graph", "cops", "wins"),
    [
        ("tree", [0], True),  # one cop wins on trees
        ("star", [1], True),
        ("fan", [1], True),  # which is chordal
        ("square", [0], False),  # and not on cycles of four and more
        ("cycle", [0], False),
        ("cycle", [0, 1], True),  # where two do, as on all outerplanar graphs
        ("grid", [0], False),
        ("grid", [0, 1], True),  # and on grids
    ],
)
def test_the_cop_number_of_graphs_is_that_of_the_literature(graph, cops, wins):
    robber = max(GRAPHS[graph], key=lambda node: min(nx.shortest_path_length(GRAPHS[graph], cop, node) for cop in cops))
    solution = solve(pursuit(graph, cops, [robber], settings=TURNS), team="cops", reward="win")
    assert (solution.value, solution.error) == (float(wins), 0.0)


def test_a_robber_on_a_path_is_caught_after_as_many_turns_as_it_is_long():
    scenario = pursuit("path", [0], [3], settings=TURNS)
    solution = solve(scenario, team="cops", reward="turns")
    assert solution.value == -4.0
    played = scenario.play(strategies={team: solution.strategy(team) for team in ("cops", "robbers")})
    assert (played.turns, played.winner) == (4, "cops")


@pytest.mark.parametrize("settings", [{}, TURNS])
def test_a_team_does_not_delay_a_reward_available_in_any_turn(settings):
    scenario = pursuit("path", [0], [3], turns=12, settings=settings)
    cops = solve(scenario, team="cops", reward="win").strategy("cops")
    result = scenario.play(strategies={"cops": cops, "robbers": gamms.strategies.stay})
    assert (result.turns, result.winner) == (3, "cops")


def test_matching_pennies_are_drawn_with_the_shares_of_the_equilibrium():
    scenario = scene("pair", TEAMS, ["solved_games:pennies"], turns=30)
    solution = solve(scenario, reward="score")
    one_turn = matrix_value([[2.0, -1.0], [-1.0, 1.0]])
    assert one_turn == pytest.approx(0.2)
    assert solution.value == pytest.approx(30 * one_turn, abs=1e-9)
    assert sorted(choice.share for choice in solution.policy("red")) == pytest.approx([0.4, 0.6])
    assert solution.nash_conv() == pytest.approx(0.0, abs=1e-9)
    strategies = {team: solution.strategy(team) for team in ("red", "blue")}
    gains = [r.scores["red"] - r.scores["blue"] for r in (scenario.play(seed, strategies) for seed in range(20))]
    assert abs(np.mean(gains) - 6.0) < 3 * np.std(gains) / 20**0.5


def test_a_policy_is_that_of_the_first_turn_unless_another_is_named():
    solution = solve(scene("pair", TEAMS, ["solved_games:pennies"], turns=1))
    assert solution.policy("red") == solution.policy("red", turn=0)
    with pytest.raises(BadValue, match=r"does not continue .* in turn 1"):
        solution.policy("red", turn=1)


def test_a_discounted_game_without_an_end_has_the_value_of_its_sum():
    scenario = scene("pair", TEAMS, ["solved_games:pennies"])
    solution = solve(scenario, discount=0.9)
    assert solution.value == pytest.approx(0.2 / (1 - 0.9), abs=1e-9)
    assert 0.0 < solution.error < 1e-9
    assert solution.nash_conv() == pytest.approx(0.0, abs=1e-8)
    with pytest.raises(BadValue, match=r"turns= or discount="):
        solve(scenario)


def race_value(turns):
    """The value of the race for the runner at 0, with the guard at 5, by brute force."""
    ways = neighbours(GRAPHS["grid"])

    @cache
    def value(runner, guard, left):
        if not left:
            return 0.0

        def after(r, g):
            return -0.1 + (-1.0 if r == g else 1.0 if r == 8 else value(r, g, left - 1))

        return matrix_value([[after(r, g) for g in ways[guard]] for r in ways[runner]])

    return value(0, 5, turns)


def race(**more):
    teams = {
        "reds": {"agents": [{"name": "runner", "node": 0}]},
        "blues": {"agents": [{"name": "guard", "node": 5}]},
    }
    return scene("grid", teams, ["solved_games:race"], **more)


def test_a_race_by_a_rule_without_array_form_is_worth_what_brute_force_says():
    solution = solve(race(turns=2))
    assert solution.value == pytest.approx(race_value(2), abs=1e-9)
    assert solution.nash_conv() == pytest.approx(0.0, abs=1e-9)


def test_rewards_are_functions_of_what_happens_in_a_turn():
    def near(transition):
        return 1.0 if transition.after["runner"] == 4 and transition.winner is None else 0.0

    ways = neighbours(GRAPHS["grid"])

    @cache
    def value(runner, guard, left):
        if not left:
            return 0.0

        def after(r, g):
            return 0.0 if r in (g, 8) else float(r == 4) + value(r, g, left - 1)

        return matrix_value([[after(r, g) for g in ways[guard]] for r in ways[runner]])

    assert solve(race(), reward=near, turns=2).value == pytest.approx(value(0, 5, 2), abs=1e-9)


def test_what_rules_remember_and_the_turn_are_part_of_states_where_they_count():
    solution = solve(scene("pair", TEAMS, ["solved_games:toll", "solved_games:pennies"], turns=7))

    @cache
    def value(red, blue, turn, paid):
        if turn == 7:
            return 0.0

        def after(r, b):
            pays = (turn + 1) % 3 == 0 and r != 0 and paid < 2
            return (2.0 - r if r == b else -1.0) - pays + value(r, b, turn + 1, paid + pays)

        return matrix_value([[after(r, b) for b in (0, 1)] for r in (0, 1)])

    assert solution.table.by_turn
    assert solution.value == pytest.approx(value(*solution.table.nodes[0].tolist(), 0, 0), abs=1e-9)


def test_a_leader_at_the_time_limit_makes_scores_part_of_states():
    rules = ["solved_games:pennies", {"rule": "time_limit", "with": {"turns": 4}}]
    solution = solve(scene("pair", TEAMS, rules), reward="win")

    @cache
    def value(left, lead):
        if not left:
            return float(np.sign(lead))
        after = [value(left - 1, lead + points) for points in (2, -1, 1)]
        return matrix_value([[after[0], after[1]], [after[1], after[2]]])

    assert solution.table.by_scores
    assert solution.value == pytest.approx(value(4, 0), abs=1e-9)


def test_values_are_given_for_each_place_of_an_agent():
    solution = solve(pursuit("path", [0], [4], settings=TURNS), team="cops", reward="turns")
    assert solution.values("robber_0") == {1: -1.0, 2: -4.0, 3: -4.0, 4: -4.0}
    assert solution.value_at({"cop_0": 2, "robber_0": 4}) == -2.0
    with pytest.raises(BadValue, match="does not continue"):
        solution.value_at({"robber_0": 0})
    with pytest.raises(UnknownName, match="cop_0"):
        solution.value_at({"copp": 0})


def flight(robber, turns):
    """A robber on a road, which is safe on node 0, with a cop behind it."""
    game = pursuit("road", [8], [robber], turns=turns)
    return game.replace(rules=[*PURSUIT, {"rule": "reach", "with": {"team": "robbers", "nodes": 0}}])


def test_a_state_has_no_value_for_more_turns_than_are_left_when_the_game_gets_there():
    solution = solve(flight(7, 6), team="robbers", reward="win")
    assert solution.values("robber_0") == {7: 0.0}
    for node in range(2, 8):
        first = 7 - node
        for turn in range(first, 6):
            assert solution.value_at({"robber_0": node}, turn) == 0.0
        for turn in range(first):
            for ask in (solution.value_at, lambda places, when: solution.policy("robbers", places, when)):
                with pytest.raises(BadValue, match=rf"reaches it in turn {first} at the earliest.* Give turn={first}"):
                    ask({"robber_0": node}, turn)
    assert solution.values("robber_0", turn=5) == dict.fromkeys(range(2, 8), 0.0)
    assert solve(flight(2, 6), team="robbers", reward="win").value == 1.0  # which the longer game does not show


def test_all_states_have_values_at_the_start_where_more_turns_lead_to_no_others():
    solution = solve(flight(7, 30), team="robbers", reward="win")
    assert solution.values("robber_0") == dict.fromkeys(range(1, 8), 1.0)


def test_a_strategy_does_not_play_where_the_solved_game_does_not_get_to_so_early():
    solution = solve(flight(7, 7), reward="win")
    strategies = {team: solution.strategy(team) for team in ("cops", "robbers")}
    assert flight(7, 7).play(strategies=strategies).winner == "robbers"
    with pytest.raises(BadValue, match="In turn 0 agents are at positions that the solved game never reaches"):
        flight(2, 7).play(strategies=strategies)


EYES = {"eyes": {"type": "AGENT"}, "near": {"type": "AGENT_RANGE", "sensor_range": 10}}


@pytest.mark.parametrize(
    ("cops", "robbers", "bound"),
    [("eyes", "eyes", "exact"), ("eyes", "near", "lower"), ("near", "eyes", "upper"), ("near", "near", "none")],
)
def test_a_value_states_its_relation_to_that_of_agents_that_see_less(cops, robbers, bound):
    teams = {"cops": {"count": 1, "sensors": [cops]}, "robbers": {"count": 1, "sensors": [robbers]}}
    map = {"grid": {"width": 3, "height": 2}}
    scenario = pursuit("path", [0], [3]).replace(map=map, teams=teams, sensors=EYES, max_turns=3)
    solution = solve(scenario)
    assert (solution.information, solution.bound, solution.is_exact) == ("full", bound, bound == "exact")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"rules": ["solved_games:lottery", "solved_games:pennies"]}, "draws.*by_priority"),
        ({"rules": ["solved_games:hidden"]}, "HIDDEN.*data"),
        ({"settings": {"deeds": {"shout": None}}}, "shout"),
        ({"settings": {"speed_unit": "metres"}}, "edges"),
        ({"teams": {"red": {"count": 1}}}, "1 teams"),
        ({"rules": ["last_team"]}, "no turn gives points"),
    ],
)
def test_what_cannot_be_solved_is_refused_by_name(changes, message):
    scenario = scene("pair", TEAMS, ["solved_games:pennies"], turns=9)
    with pytest.raises(BadValue, match=message):
        solve(scenario.replace(**changes))


def test_a_game_that_is_too_large_is_refused_before_it_is_played():
    scenario = pursuit("path", [0], [3]).replace(map={"grid": {"width": 40, "height": 40}})
    with pytest.raises(TooLarge, match=r"2,560,000 joint positions .*447 nodes"):
        solve(scenario)
    assert len(solve(scenario, turns=2).table) < 200


def test_a_game_whose_rules_remember_too_much_is_refused():
    scenario = scene("pair", TEAMS, ["solved_games:toll", "solved_games:pennies"], turns=7)
    with pytest.raises(TooLarge, match="more than max_states=10 states, but only 4 joint"):
        solve(scenario, max_states=10)


def test_what_a_rule_does_in_the_last_turn_alone_puts_no_turns_into_states():
    late = {"rule": "time_limit", "with": {"turns": 5, "winner": "robbers"}}
    solution = solve(pursuit("path", [0], [4]).replace(rules=[*PURSUIT, late]), reward="win")
    assert not solution.table.by_turn
    assert solution.value == pytest.approx(2 * simultaneous(GRAPHS["path"], 0, 4, 5) - 1, abs=1e-9)


@pytest.mark.parametrize(("own", "given", "used"), [(None, None, 0), (4, None, 4), (4, 0, 0)])
def test_the_start_is_that_of_the_seed_of_the_call_or_else_of_the_scenario(own, given, used):
    scenario = scene("path", TEAMS, ["solved_games:pennies"], turns=1).replace(seed=own)
    with scenario.build(used) as ctx:
        start = [ctx.agent.get_agent(name).current_node_id for name in ("blue_0", "red_0")]
    assert solve(scenario, seed=given).table.nodes[0].tolist() == start


def test_a_strategy_refuses_a_game_that_starts_where_the_solved_one_does_not_get_to():
    cops = solve(pursuit("path", [0], [3], turns=1), team="cops", reward="turns").strategy("cops")
    with pytest.raises(BadValue, match=r"'robber_0': 4.* seed=1"):
        pursuit("path", [0], [4], turns=1).play(strategies={"cops": cops, "robbers": gamms.strategies.stay})


def test_games_in_arrays_and_in_contexts_have_the_same_states_and_values():
    near = {"rule": "tag", "with": {"taggers": "cops", "tagged": "robbers", "then": "eliminate", "hops": 1}}
    first = {"resolve": {"by_priority": ["robbers", "cops"]}}
    scenario = pursuit("square", [0], [2], turns=4, conflicts=first).replace(rules=[near, "last_team"])
    in_arrays = solve(scenario, turns=2)
    in_context = solve(scenario.replace(rules=[near, "last_team", "solved_games:nothing"]), turns=2)
    assert 0.0 < abs(in_arrays.value) < 1.0
    assert in_arrays.value == pytest.approx(in_context.value, abs=1e-12)
    assert sorted(map(tuple, in_arrays.table.nodes)) == sorted(map(tuple, in_context.table.nodes))


def cops_apart(**more):
    return pursuit("fan", [1, 4], [3], turns=6, **more)


@pytest.mark.parametrize("more", [{}, {"settings": TURNS}])
def test_agents_that_differ_by_their_names_only_are_sorted_and_ends_are_one_state(more):
    setup = make_setup(cops_apart(**more), ("cops", "robbers"), {}, turns=None, seed=None, max_states=10_000)
    solution, every = solve(cops_apart(**more), reward="turns"), explore(setup, by_winner=False)
    is_over = [np.diff(table.offsets) == 0 for table in (solution.table, every)]
    assert len(solution.table) < len(every) / 2
    assert is_over[0].sum() <= 2 < is_over[1].sum()  # one winner, and none
    places = {"cop_0": 4, "cop_1": 1}
    assert solution.value_at(places) == solution.value
    there, back = (solution.policy("cops", at) for at in ({}, places))
    assert [one.share for one in there] == [one.share for one in back]
    assert [(one.nodes["cop_0"], one.nodes["cop_1"]) for one in there] == [
        (one.nodes["cop_1"], one.nodes["cop_0"]) for one in back
    ]


def test_strategies_play_with_sorted_agents_that_exchange_their_places():
    solution = solve(cops_apart(settings=TURNS), team="cops", reward="turns")
    best = {team: solution.strategy(team) for team in ("cops", "robbers")}
    agents = [{"name": "cop_0", "node": 4}, {"name": "cop_1", "node": 1}]
    for start in (cops_apart(settings=TURNS), cops_apart(settings=TURNS).replace(**{"teams.cops.agents": agents})):
        assert start.play(strategies=best).turns == -solution.value


@pytest.mark.parametrize(
    "changes",
    [
        {"conflicts": {"resolve": {"by_priority": ["robbers", "cops"]}}},
        {"rules": [*PURSUIT, "solved_games:nothing"]},
        {"rules": [*PURSUIT, {"rule": "respawn"}]},
        {"teams.cops.agents": [{"name": "cop_0", "node": 1, "speed": 2}, {"name": "cop_1", "node": 4}]},
        {"rules": [{"rule": "tag", "with": {"taggers": "robbers", "tagged": "cops"}}]},  # which return to their starts
    ],
)
def test_agents_that_something_may_tell_apart_are_not_sorted(changes):
    assert solve(cops_apart().replace(**changes), reward="turns", turns=1).table.sorted_agents is None


def test_agents_that_turns_tell_apart_are_noticed_in_play(monkeypatch):
    agents = [{"name": "cop_0", "node": 0, "speed": 2}, {"name": "cop_1", "node": 0}]
    scenario = pursuit("path", [0, 0], [3], turns=4).replace(**{"teams.cops.agents": agents})
    value = solve(scenario, reward="turns").value
    monkeypatch.setattr("gamms.solve.worlds._find_interchangeable", lambda _, __: [np.array([0, 1])])
    noticed = solve(scenario, reward="turns")
    assert noticed.table.sorted_agents is None
    assert noticed.value == pytest.approx(value, abs=1e-9)


def test_agents_that_a_reward_may_tell_apart_are_not_sorted():
    def near(transition):
        return 1.0 if transition.after["cop_0"] == 1 else 0.0

    scenario = cops_apart().replace(max_turns=2)
    assert solve(scenario, reward=near).table.sorted_agents is None
    cops = solve(scenario, reward="turns").strategy("cops")
    with pytest.raises(BadValue, match=r"interchangeable agents sorted.*function as its reward, too"):
        best_response(scenario, team="robbers", against=cops, reward=near)


def test_a_function_as_the_reward_of_a_response_sees_where_agents_are_at_the_end():
    def far(transition):
        return 1.0 if transition.is_over and transition.after["robber_0"] in (None, 4) else 0.0

    def caught(transition):
        return float(transition.winner == "cops")

    scenario = pursuit("path", [2], [3], turns=3)
    cops = [solve(scenario, team="cops", reward=reward).strategy("cops") for reward in ("win", caught)]
    values = [best_response(scenario, team="robbers", against=one, reward=far).value for one in cops]
    assert values[0] == pytest.approx(values[1], abs=1e-9)
    assert values[0] > 0.0


def test_it_makes_no_difference_which_of_several_sorted_agents_lots_take_out():
    near = {"rule": "tag", "with": {"taggers": "cops", "tagged": "robbers", "then": "eliminate", "hops": 1}}
    scenario = pursuit("pair", [0], [1, 1], turns=5).replace(rules=[near, "last_team"])
    solution = solve(scenario, reward="turns", team="cops")
    assert solution.value == -2.0  # one in each turn
    assert solution.value_at({"robber_1": None}, 1) == solution.value_at({"robber_0": None}, 1) == -1.0
    assert solution.policy("robbers", {"robber_0": None}, 1)[0].nodes.keys() == {"robber_1"}


@pytest.mark.parametrize("rule", ["solved_games:shut", "solved_games:shut_in_arrays"])
def test_roads_that_a_rule_closes_are_part_of_states(rule):
    rules = [*PURSUIT, rule]
    scenario = pursuit("path", [0], [3], turns=7, settings=TURNS)
    assert solve(scenario, reward="turns", team="cops").value == -4.0
    closing = solve(scenario.replace(rules=rules), reward="turns", team="cops")
    assert closing.value == -7.0  # the robber is behind it, and safe until the end


def test_a_game_that_lets_agents_look_at_all_is_solved_as_it_is_played():
    assert solve(pursuit("path", [0], [3], turns=3, settings={"information": "full"}), reward="turns").is_exact


def test_arguments_are_checked():
    scenario = scene("pair", TEAMS, ["solved_games:pennies"], turns=3)
    with pytest.raises(UnknownName, match="green"):
        solve(scenario, team="green")
    with pytest.raises(BadValue, match="score"):
        solve(scenario, reward="points")
    with pytest.raises(BadValue, match="discount"):
        solve(scenario, discount=0.0)
    with pytest.raises(BadType, match="scenario"):
        solve("tag.yaml")
    with pytest.raises(BadType, match="reward"):
        solve(scenario, reward=lambda: 1.0)
    solution = solve(scenario)
    with pytest.raises(BadType, match=r"strategies\['red'\]"):
        solution.nash_conv({"red": solution.strategy("blue")})
    with pytest.raises(BadType, match="strategies must be a dict"):
        solution.exploitability([solution.strategy("red")])
    with pytest.raises(BadValue, match="for agents of team 'blue'"):
        scenario.play(strategies={"red": solution.strategy("blue")})


def test_matrix_games_are_solved_as_linear_programs_are():
    draws = np.random.default_rng(1)
    for rows, columns in ((2, 2), (3, 5), (5, 3), (16, 4), (1, 3)):
        for games in (draws.normal(size=(8, rows, columns)), draws.integers(-1, 2, size=(8, rows, columns)) * 1.0):
            values, first, second = kernels.solve_matrix_games(games)
            assert values == pytest.approx([matrix_value(game) for game in games], abs=1e-9)
            assert (games * first[:, :, None]).sum(axis=1).min(axis=1) == pytest.approx(values, abs=1e-12)
            assert (games * second[:, None, :]).sum(axis=2).max(axis=1) == pytest.approx(values, abs=1e-12)


def test_rewards_by_score_say_which_wins_count_nothing(caplog):
    guard = {"agents": [{"name": "guard", "node": 0}]}
    runner = {"agents": [{"name": "runner", "node": 2}]}
    rules = [
        {"rule": "tag", "with": {"taggers": "guards", "tagged": "runners", "score": 1}},
        {"rule": "reach", "with": {"team": "runners", "nodes": [4]}},
    ]
    game = scene("path", {"guards": guard, "runners": runner}, rules, turns=4)
    solve(game)
    assert "a win of team 'runners' is worth nothing" in caplog.text
    assert "reward='win'" in caplog.text
    caplog.clear()
    solve(game, reward="win")
    assert not caplog.records
