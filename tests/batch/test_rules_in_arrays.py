"""Rules in batches: each game is the one that is played alone, whatever the rules do in it."""

import math
from pathlib import Path

import networkx as nx
import numpy as np
import pytest
from batch_scenes import plain, scene

import gamms
from gamms.errors import BadType, BadValue, MissingKey, UnknownName
from gamms.rules import Conflicts, by_priority, by_rank, capture_flag, discover, last_team, tag
from gamms.scenario import Scenario
from gamms.strategies import random_waypoints

OWNERS = {node: "red" if node % 5 < 2 else "blue" for node in range(25)}
SEEDS = [1, 2**40]


def rule(name, /, **arguments):
    return {"rule": name, "with": arguments}


TAG = rule("tag", taggers="red", tagged="blue", mutual=True)
OUT = rule("tag", taggers="red", tagged="blue", mutual=True, then="eliminate", score=0)
PAY = {"tag": {"agent": 0.1, "other": -0.7}, "eliminated": {"agent": -1 / 3}, "hold": {"team": 2}}
PUBLISHED = rule("gamms.rules.territory:published", nodes=OWNERS)


@pytest.mark.parametrize(
    "rules",
    [
        [rule("hold", nodes=[6, 7], turns=2)],
        [OUT, rule("respawn"), rule("hold", nodes=[6, 7, 8], turns=2, ends=False, score=1.5)],
        [rule("hold", nodes=[6, 7], turns=1, ends=False, score=1, every=True, teams="red"), rule("last_team")],
        [
            OUT,
            rule("respawn"),
            rule("payoff", table=PAY, zero_sum=True),
            rule("hold", nodes=[6, 7], turns=1, ends=False),
        ],
        [rule("payoff", table=PAY), OUT, rule("reach", team="red", nodes=3)],
        [OUT, rule("arrive", team="red", nodes=[3, 5]), rule("none_left", team="red")],
        [rule("arrive", team="blue", nodes="starts of red", score=0.1), rule("none_left", team="blue", winner="red")],
    ],
)
def test_places_are_held_and_events_paid_as_in_games_that_are_played_alone(rules, same_as_one_by_one):
    same_as_one_by_one(scene(rules, side=4), SEEDS)


@pytest.mark.parametrize("empty", ["stay", "eliminate"])
def test_moves_that_cost_too_much_are_refused(empty, same_as_one_by_one):
    fuel = rule("resource", name="fuel", start=40, per_metre=1, recharge={5: 20, 6: 20}, empty=empty)
    water = rule("resource", name="water", start=4, per_turn=1, recharge={0: 2, 15: 2}, teams="red")
    conflicts = {"capacity": 1}
    same_as_one_by_one(scene([fuel, water, rule("respawn", after=2)], side=4, conflicts=conflicts), SEEDS)


def winding():
    """A street that is longer than a straight line, and a shorter one beside it that leads one way only."""
    graph = nx.MultiDiGraph()
    graph.add_nodes_from((node, {"x": 10.0 * node, "y": 0.0}) for node in range(3))
    for source, target, length in ((0, 1, 25.0), (0, 1, 15.0), (1, 0, 25.0), (1, 2, 30.0), (2, 1, 30.0)):
        graph.add_edge(source, target, length=length)
    return graph


def test_a_way_costs_as_much_as_the_shortest_edge_along_it(same_as_one_by_one):
    fuel = rule("resource", name="fuel", start=100, per_metre=1)
    map = {"generator": {"function": "test_rules_in_arrays:winding"}}
    same_as_one_by_one(scene([fuel], map=map, folder=Path(__file__).parent, max_turns=6), SEEDS)


def test_agents_that_are_out_of_a_game_by_metres_meet_no_other_on_streets(same_as_one_by_one):
    scenario = scene([OUT, rule("respawn"), TAG], side=3, settings={"speed_unit": "metres"})
    same_as_one_by_one(scenario.replace(**{f"teams.{team}.speed": 17.0 for team in ("red", "blue")}), SEEDS)


def test_agents_that_arrive_by_metres_while_others_are_stopped_are_met_there(same_as_one_by_one):
    settings, conflicts = {"speed_unit": "metres"}, {"capacity": 1, "among": "team"}
    scenario = scene([TAG], side=3, max_turns=12, settings=settings, conflicts=conflicts)
    same_as_one_by_one(scenario.replace(**{"teams.red.speed": 13.0, "teams.blue.speed": 17.0}), SEEDS[:2])


def test_games_that_are_reset_are_paid_for_what_happens_in_them_alone():
    with scene([rule("hold", nodes=list(range(25)), turns=1, ends=False), TAG, rule("payoff", table=PAY)]).batch(
        2
    ) as games:
        games.step()
        games.reset([0])
        games.run()
        first = [plain(games.result(number)) for number in range(2)]
        games.reset()
        games.run()
        assert [plain(games.result(number)) for number in range(2)] == first


@pytest.mark.parametrize(
    "rules",
    [
        [rule("tag", taggers="red", tagged="blue", mutual=True, territory=OWNERS)],
        [PUBLISHED, rule("tag", taggers="blue", tagged="red", territory="territory", then="eliminate")],
        [rule("tag", taggers="red", tagged="blue", then="eliminate"), rule("respawn", after=2, times=1)],
        [TAG | {"with": {**TAG["with"], "then": "eliminate"}}, rule("respawn", teams="red"), rule("last_team")],
        [TAG, rule("reach", team={"red": "starts of blue", "blue": [3, 24]}, score=2)],
        [rule("reach", team="red", nodes=[7, 8], winner="blue", passing=False)],
    ],
)
def test_tags_goals_and_returns_are_those_of_games_that_are_played_alone(rules, same_as_one_by_one):
    same_as_one_by_one(scene(rules), SEEDS)


@pytest.mark.parametrize(
    "given",
    [
        {"hops": 2},
        {"hops": 1.5, "crossing": True, "passing": False, "then": "eliminate"},
        {"metres": 15, "mutual": True},
        {"metres": 30, "crossing": True, "territory": OWNERS},
        {"euclid": 15},
        {"euclid": 20, "passing": False, "crossing": True, "territory": OWNERS, "mutual": True},
    ],
)
def test_agents_that_are_near_are_tagged_as_in_games_that_are_played_alone(given, same_as_one_by_one):
    same_as_one_by_one(scene([rule("tag", taggers="red", tagged="blue", **given)], max_turns=10), SEEDS)


@pytest.mark.parametrize("decide", ["turn", "arrival"])
@pytest.mark.parametrize(
    "given",
    [
        {"metres": 8.5, "mutual": True},
        {"metres": 4, "crossing": True, "territory": OWNERS},
        {"metres": 1e9, "then": "eliminate"},
        {"euclid": 8.5, "mutual": True},
        {"euclid": 6, "passing": False, "crossing": True},
        {"euclid": math.inf, "then": "eliminate"},
    ],
)
def test_agents_by_metres_are_tagged_when_they_first_are_near_as_alone(given, decide, same_as_one_by_one):
    tag, settings = rule("tag", taggers="red", tagged="blue", **given), {"speed_unit": "metres", "decide": decide}
    scenario = scene([tag, tag], side=4, max_turns=6, settings=settings | {"order": [["blue"], ["red"]]})
    same_as_one_by_one(scenario.replace(**{"teams.red.speed": 13.0, "teams.blue.speed": 17.0}), SEEDS[:1])


@pytest.mark.parametrize("order", [1, -1])
def test_rules_that_tag_are_one_rule_as_in_games_that_are_played_alone(order, same_as_one_by_one):
    tags = [
        rule("tag", taggers="red", tagged="blue", score=0.5),
        rule("tag", taggers="blue", tagged="red", then="eliminate", hops=1, score=2),
        rule("tag", taggers="red", tagged="blue", metres=5, territory=OWNERS),
    ]
    same_as_one_by_one(scene([*tags[::order], rule("respawn")], side=4, max_turns=10), SEEDS)


def test_members_of_one_team_may_tag_each_other(same_as_one_by_one):
    tag = rule("tag", taggers="red", tagged="red", hops=1)
    same_as_one_by_one(scene([tag], red=12, side=9, max_turns=6), SEEDS[:2])


@pytest.mark.parametrize("given", [{}, {"hops": 2, "score": 1.5}, {"teams": ["red"], "score": 1}])
@pytest.mark.parametrize("order", [None, [["blue"], ["red"]]])
def test_nodes_are_discovered_as_in_games_that_are_played_alone(given, order, same_as_one_by_one):
    looks = {
        "near": {"type": "RANGE", "sensor_range": 12.0},
        "watch": {"type": "AGENT_RANGE", "sensor_range": 9.0},
        "tower": {"type": "AGENT_RANGE", "at": 7, "sensor_range": 11.0},
        "ahead": {"type": "ARC", "sensor_range": 15.0, "fov": 1.5},
        "arc": {"type": "AGENT_ARC", "sensor_range": 25.0, "fov": 1.0},
    }
    walkers = {"count": 3, "strategy": "gamms.strategies:random_walk"}
    teams = {"red": {**walkers, "sensors": ["near", "tower"]}, "blue": {**walkers, "sensors": ["watch"]}}
    teams["green"] = {**walkers, "count": 2, "sensors": ["ahead", "arc"]}
    nodes = {"nodes": {3: "flag", 12: "decoy", 20: None, 24: [1]}}
    rules = [rule("discover", **nodes, **given), OUT, rule("payoff", table={"discover": {"team": 2}})]
    scenario = scene(rules, sensors=looks, teams=teams, settings={"order": order and [*order, ["green"]]})
    same_as_one_by_one(scenario, SEEDS)


def test_teams_without_agents_discover_nothing():
    with scene().build(seed=1) as ctx:
        ctx.game.add(discover([3], teams=["green"]))
        with ctx.game.batch(2) as games:
            games.run()
            assert [games.result(number).events for number in range(2)] == [[], []]


@pytest.mark.parametrize("flags", [{"red": 6, "blue": 18}, {"red": 6, "blue": 6}, {"green": 12, "red": 3}])
@pytest.mark.parametrize(
    "given", [{}, {"territory": OWNERS, "goal": 2, "score": 0.5}, {"passing": False, "goal": None}]
)
def test_flags_are_taken_and_captured_as_in_games_that_are_played_alone(flags, given, same_as_one_by_one):
    same_as_one_by_one(scene([TAG, rule("capture_flag", flags=flags, **given)], max_turns=50), SEEDS)


def test_agents_that_stay_look_where_they_looked_before(same_as_one_by_one):
    sensors = {"eyes": {"type": "AGENT_ARC", "sensor_range": 30.0, "fov": 1.5}}
    teams = {
        "red": {"count": 4, "strategy": "gamms.strategies:chase", "sensors": ["eyes"]},
        "blue": {"count": 4, "strategy": "gamms.strategies:flee", "sensors": ["eyes"]},
    }
    conflicts = {"capacity": 1, "resolve": "nobody"}
    for order in (None, [["blue"], ["red"]]):
        game = scene([TAG], side=4, sensors=sensors, conflicts=conflicts, settings={"order": order})
        same_as_one_by_one(game.replace(teams=teams), range(6))


@pytest.mark.parametrize(
    ("unit", "xs", "speeds", "order"),
    [
        ("edges", [0.0, 1.0, 2.0], (2, 2), None),
        ("edges", [0.0, 1.0, 2.0], (2, 2), [["red"], ["blue"]]),
        ("metres", [0.0, 1.0, 2.0], (2.0, 2.0), None),
        ("metres", [0.0, 0.3, 1.0], (0.4, 0.7 / 0.75), None),  # at one time but for rounding
    ],
)
def test_agents_that_meet_on_a_node_do_not_pass_each_other_on_the_edge_behind_it(unit, xs, speeds, order):
    with gamms.create_context(game={"speed_unit": unit, "order": order}) as ctx:
        ctx.graph.add_nodes(range(3), xs, [0.0] * 3)
        ctx.graph.add_edges(range(4), [0, 1, 1, 2], [1, 2, 0, 1])
        last = 1 if order else 2
        for (team, start, target), speed in zip((("red", 0, last), ("blue", last, 0)), speeds, strict=True):
            one = ctx.agent.create_agent(team, start_node_id=start, team=team, speed=speed)
            one.register_strategy(gamms.strategies.goto(ctx, target))
        ctx.game.add(tag("red", "blue", mutual=True, territory={0: "blue", 2: "red"}))
        with ctx.game.batch(2) as games:
            games.step()
            assert not games.detached
            assert games.result(1).events == []


@pytest.mark.parametrize(("unit", "speed"), [("edges", 4), ("metres", 40.0)])
def test_an_agent_that_is_put_where_its_own_path_ends_has_not_come_there_by_it(unit, speed):
    with gamms.create_context(logger_config={"level": "CRITICAL"}, game={"speed_unit": unit}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 4))
        ctx.agent.create_agent("runner", start_node_id=0, team="red", speed=speed)
        ctx.agent.get_agent("runner").strategy = lambda state: state.update(action=[0, 1, 2, 1, 0])
        ctx.agent.create_agent("guard", start_node_id=1, team="blue")
        rules = tag("blue", "red"), capture_flag({"blue": 2, "red": 0}, announce=False)
        for one in rules:
            ctx.game.add(one)
        with ctx.game.batch(2) as games:
            games.step()
            assert [event["kind"] for event in games.result(1).events] == ["tag", "respawned"]


def test_carriers_of_flags_are_known_as_numbers_of_agents():
    scenario = scene([rule("capture_flag", flags={"red": 6, "blue": 18}, goal=None)])
    with scenario.batch(seeds=SEEDS) as games:
        games.run()
        blue, red = games.observe("blue"), games.observe("red")
        known, names = red["facts"]["flags"], [*blue["name"], *red["name"], None]
        for number, seed in enumerate(SEEDS):
            with scenario.build(seed=seed) as ctx:
                ctx.game.run()
                for team, flag in ctx.game.facts["flags"].items():
                    assert known[team]["node"] == flag["node"]
                    assert names[known[team]["carrier"][number]] == flag["carrier"]


@pytest.mark.parametrize("resolve", ["at_random", "nobody", {"by_priority": ["blue", "red"]}])
@pytest.mark.parametrize("capacity", [1, 2, {6: 0, 7: 1, 8: 2}])
@pytest.mark.parametrize(("among", "allow_swaps"), [("all", False), ("team", False), ("all", True)])
def test_the_same_agents_have_to_stay(resolve, capacity, among, allow_swaps, same_as_one_by_one):
    conflicts = {"capacity": capacity, "among": among, "allow_swaps": allow_swaps, "resolve": resolve}
    same_as_one_by_one(scene([], red=5, blue=6, side=4, max_turns=10, conflicts=conflicts), SEEDS[:2])


@pytest.mark.parametrize("order", [[["blue"], ["red"]], [["red"], ["blue"]]])
@pytest.mark.parametrize(
    "given",
    [{}, {"hops": 1, "mutual": True}, {"metres": 15, "crossing": True}, {"passing": False, "then": "eliminate"}],
)
def test_teams_play_one_after_another_as_in_games_that_are_played_alone(given, order, same_as_one_by_one):
    rules = [rule("tag", taggers="red", tagged="blue", **given), rule("capture_flag", flags={"red": 6, "blue": 18})]
    conflicts = {"capacity": 1, "resolve": "at_random"}
    same_as_one_by_one(scene(rules, conflicts=conflicts, settings={"order": order}), SEEDS)


def test_an_order_of_play_without_a_team_is_refused_where_it_is_played():
    games = scene([], settings={"order": [["red"]]}).batch(2)
    with games, pytest.raises(BadValue, match="leaves out team 'blue'"):
        games.run()


def first_by_name(contest, ctx):
    return [contest.movers[0]]


def crowded(capacity, resolve=None):
    ctx = scene([], red=6, blue=6, side=4, max_turns=8).build(seed=1)
    for node in range(16):
        ctx.graph.graph.update_node({"id": node, "room": node % 3})
    ctx.game.conflicts = Conflicts(capacity, resolve=resolve)
    return ctx


def test_capacities_may_be_attributes_of_nodes():
    with crowded("room") as ctx, ctx.game.batch(seeds=[3]) as games:
        games.run()
        with ctx.game.fork(0).ctx as alone:
            alone.game.reset(seed=3)
            assert plain(games.result(0)) == plain(alone.game.run())
    with crowded("rooms") as ctx, ctx.game.batch(1) as games, pytest.raises(UnknownName, match="rooms"):
        games.step()


def test_a_resolver_that_is_a_function_is_asked_game_by_game():
    with crowded(1, first_by_name) as ctx, ctx.game.batch(1) as games:
        assert "Conflicts" in games.slow


NO_STOPS = [
    (None, BadType, "must be an array of booleans, not None"),
    (np.zeros((2, 12), np.int64), BadType, "must be an array of booleans"),
    (np.zeros((2, 5), np.bool_), BadValue, r"has the shape \(2, 5\), which does not broadcast to \(2, 12\)"),
    ([[True], [True, False]], BadType, "must be an array of booleans"),
]


def test_ranks_of_your_own_decide_in_a_batch_as_alone():
    def odd_ones_first(name, team):
        return None if name.endswith("4") else int(name[-1]) % 2 == 0

    with crowded(1, by_rank(odd_ones_first)) as ctx, ctx.game.batch(seeds=[3, 4]) as games:
        games.run()
        for number, seed in enumerate(games.seeds):
            with ctx.game.fork(0).ctx as alone:
                alone.game.reset(seed=seed)
                assert plain(games.result(number)) == plain(alone.game.run())


def test_a_team_that_is_not_in_the_list_is_named():
    with crowded(1, by_priority(["red"])) as ctx, ctx.game.batch(4) as games, pytest.raises(MissingKey, match="blue"):
        games.run()


def test_a_game_of_agents_of_no_team_is_over_for_the_last_team():
    with gamms.create_context(logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
        ctx.agent.create_agent("one", start_node_id=0, strategy=gamms.strategies.random_walk)
        ctx.game.add(last_team())
        with ctx.game.batch(2) as games:
            games.run()
            assert games.table()["reason"].tolist() == ["last team"] * 2


def test_a_game_that_has_begun_goes_on_in_arrays():
    with scene([OUT, rule("respawn", after=4)], side=4).build(seed=1) as ctx:
        while len(ctx.game.agents) == 6:
            ctx.game.step()
        turn = ctx.game.turn
        with ctx.game.batch(seeds=[1, 2]) as games, ctx.game.fork(0).ctx as alone:
            assert games.turn.tolist() == [turn, turn]
            assert sum(games.observe(team).mask.sum() for team in ("red", "blue")) == 2 * len(ctx.game.agents)
            for _ in range(2):
                games.run()
                for number, seed in enumerate(games.seeds):
                    alone.game.reset(seed=seed)
                    assert plain(games.result(number)) == plain(alone.game.run())
                games.reset()


def test_agents_may_be_out_and_have_scores_from_the_start():
    with scene([OUT, rule("respawn", after=4)], side=4).build(seed=1) as ctx:
        ctx.game.eliminate("red_0")
        ctx.game.scores["red"] = 2.5
        with ctx.game.batch(seeds=[1, 2]) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            for number, seed in enumerate(games.seeds):
                alone.game.reset(seed=seed)
                assert plain(games.result(number)) == plain(alone.game.run())


@pytest.mark.parametrize("more", [[rule("time_limit", turns=2)], []])
def test_a_batch_of_a_game_without_further_turns_is_over_at_once(more):
    with scene(more, side=4, max_turns=2).build(seed=1) as ctx:
        over = ctx.game.run()
        with ctx.game.batch(2) as games:
            assert games.is_in_arrays
            assert games.is_over.tolist() == [True, True]
            games.step()
            games.reset([1], seeds=[5])
            games.run()
            for number in range(2):
                assert plain(games.result(number)) | {"seed": 1} == plain(over)
                assert games.context(number).game.turn == 2


def test_a_score_is_an_integer_where_no_other_number_was_added_in_its_own_game():
    def bonus(ctx):
        ctx.game.scores["red"] += 0.5 if ctx.seed == 1 else 1

    scene = Scenario(map={"grid": {"width": 3, "height": 3}}, teams={"red": {"count": 1}}, max_turns=2)
    with scene.build(seed=1) as ctx:
        ctx.game.add(bonus)
        with ctx.game.batch(seeds=[1, 2]) as games:
            games.step()
            games.step()
            assert [repr(games.result(i).scores["red"]) for i in (0, 1)] == ["1.0", "2"]
            games.reset([0], seeds=[3])
            games.step()
            assert repr(games.result(0).scores["red"]) == "1"


def test_agents_that_come_back_know_what_has_stopped_them_before_they_went_out():
    def shy(state):
        state["action"] = state["curr_pos"] if state["blocked"] else state["legal"][-1]

    def blink(ctx):
        for agent in sorted(ctx.agent.agents):
            (ctx.game.respawn if ctx.game.turn % 3 == 0 else ctx.game.eliminate)(agent)

    for order in (None, [["red"], ["blue"]]):
        scenario = scene(side=3, conflicts={"capacity": 1}, settings={"order": order} if order else {})
        with scenario.build(seed=1, strategies={"red": shy, "blue": shy}) as ctx:
            ctx.game.add(blink)
            with ctx.game.batch(seeds=[1]) as games, ctx.game.fork(0).ctx as alone:
                games.run()
                alone.game.reset(seed=1)
                assert plain(games.result(0)) == plain(alone.game.run())


@pytest.mark.parametrize("decide", ["turn", "arrival"])
@pytest.mark.parametrize("passing", [True, False])
def test_before_agents_on_edges_move_rules_have_them_on_the_nodes_behind(decide, passing, same_as_one_by_one):
    met = {"taggers": "red", "tagged": "blue", "passing": passing} | ({"euclid": 9.0} if passing else {})
    rules = [
        {"rule": "tag", "with": met},
        {"rule": "arrive", "with": {"team": "red", "nodes": [12], "passing": passing}},
    ]
    scenario = scene([one | {"phase": "deeds"} for one in rules], settings={"speed_unit": "metres", "decide": decide})
    goes = dict.fromkeys(("red", "blue"), random_waypoints)
    same_as_one_by_one(scenario.replace(**{"teams.red.speed": 13.0, "teams.blue.speed": 7.0}), range(4), goes)


def test_an_agent_that_was_out_has_the_start_again_where_it_pays_before_it_moves(same_as_one_by_one):
    fuel = {"rule": "resource", "with": {"name": "fuel", "start": 4, "per_edge": 1}, "phase": "deeds"}
    out = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": "eliminate", "hops": 1}}
    same_as_one_by_one(scene([fuel, out, {"rule": "respawn", "with": {"after": 1}}]), range(4))
