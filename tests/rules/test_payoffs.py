"""Pay-offs by a table of events; agents that come back; and rules that do not care which was added first."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gamms
from gamms.errors import BadType, BadValue, UnknownName
from gamms.rules import capture_flag, hold, payoff, resource, respawn, tag, time_limit
from gamms.strategies import random_walk


def test_events_are_paid_for_by_their_fields(road):
    ctx = road(a=("red", 3, 4), b=("blue", 4), c=("green", 9))
    ctx.game.add(payoff({"tag": {"agent": 3, "other": -1}, "hold": {"team": 5}}))
    ctx.game.add(tag("blue", "red", score=0))
    ctx.game.add(hold(9, 1, ends=False))
    assert ctx.game.run(1).scores == {"blue": 3, "red": -1, "green": 5}


def test_a_flag_is_of_a_team_whatever_agents_are_called(road):
    ctx = road(red=("blue", 1, 0, 1, 2), b=("red", 9))
    ctx.game.add(capture_flag({"red": 0, "blue": 2}, score=0))
    ctx.game.add(payoff({"take": {"agent": 1}, "capture": {"agent": 10, "flag": -4}}))
    assert ctx.game.run(9).scores == {"blue": 11, "red": -4}  # 1 + 10


def test_the_others_pay_in_equal_parts(road):
    ctx = road(a=("red", 3, 4), b=("blue", 4), c=("green", 9), d=(None, 0))
    ctx.game.add(tag("blue", "red", score=0))
    ctx.game.add(payoff({"tag": {"agent": 4, "other": -2}}, zero_sum=True))
    # blue +4, red -2, green -2; then red -2, blue +1, green +1
    assert ctx.game.run(1).scores == {"blue": 5, "red": -4, "green": -1}


def test_points_of_the_last_turn_decide_who_wins_by_time(road):
    ctx = road(a=("red", 3, 4), b=("blue", 4))
    ctx.game.add(time_limit(1))
    ctx.game.add(payoff({"tag": {"agent": 1}}))
    ctx.game.add(tag("blue", "red", score=0))
    assert ctx.game.run().winner == "blue"


def test_agents_of_no_team_and_a_team_alone_are_not_paid(road):
    for zero_sum, scores in ((False, {"red": -1}), (True, {})):
        ctx = road(a=(None, 3), b=("red", 3))
        ctx.game.add(tag(None, "red", score=0))
        ctx.game.add(payoff({"tag": {"agent": 1, "other": -1}}, zero_sum=zero_sum))
        assert ctx.game.run(1).scores == scores


def test_impossible_tables_are_refused(road):
    for table, error, words in (
        ({}, BadValue, "table is empty"),
        ({"tag": 3}, BadType, "table\\['tag'\\]"),
        ({"tag": {"agent": "3"}}, BadType, "'agent'"),
        ("tag", BadType, "table"),
    ):
        with pytest.raises(error, match=words):
            payoff(table)
    ctx = road(a=("red", 3, 4), b=("blue", 4))
    ctx.game.add(tag("blue", "red"))
    ctx.game.add(payoff({"tag": {"agnet": 1}}))
    with pytest.raises(UnknownName, match=r"'tag': 'agnet'.*agent"):
        ctx.game.step()


# -- coming back ------------------------------------------------------------------------------------------------


def test_an_agent_may_come_back_once(road):
    ctx = road(a=("red", 3, 4, 4, 4, 4), b=("blue", 4))
    ctx.game.add(respawn(times=1))
    ctx.game.add(tag("blue", "red", then="eliminate"))
    assert [event["turn"] for event in ctx.game.run(9).events if event["kind"] == "respawned"] == [2]


def test_an_agent_that_began_on_the_first_node_comes_back_there(road):
    ctx = road(a=("red", 0, 1), b=("blue", 1))
    ctx.game.add(respawn())
    ctx.game.add(tag("blue", "red", then="eliminate"))
    assert [event["node"] for event in ctx.game.run(3).events if event["kind"] == "respawned"] == [0]


def test_both_of_a_contact_may_be_eliminated_and_come_back(road):
    ctx = road(a=("red", 3, 4), b=("blue", 5, 4))
    ctx.game.add(tag("red", "blue", mutual=True, then="eliminate"))
    ctx.game.add(respawn())
    assert [agent["alive"] for agent in ctx.game.run(1).agents.values()] == [False, False]
    assert [agent["node"] for agent in ctx.game.run(1).agents.values()] == [3, 5]


def test_an_agent_without_resources_returns_with_its_initial_amount(road):
    ctx = road(a=("red", 0))
    ctx.game.add(resource("water", 2, per_turn=1, empty="eliminate"))
    ctx.game.add(respawn())
    events = [(event["turn"], event["kind"]) for event in ctx.game.run(6).events if event["kind"] != "empty"]
    assert events == [(2, "eliminated"), (3, "respawned"), (5, "eliminated"), (6, "respawned")]


# -- laws -------------------------------------------------------------------------------------------------------

LAWS = settings(max_examples=12)
TEAMS = ["red", "blue", "green"]


@LAWS
@given(
    table=st.dictionaries(
        st.sampled_from(["tag", "eliminated", "respawned"]),
        st.dictionaries(st.just("agent"), st.integers(-9, 9), min_size=1),
        min_size=1,
    ),
    places=st.lists(st.integers(0, 15), min_size=2, max_size=6),
)
def test_scores_of_zero_sum_games_add_up_to_zero(table, places):
    with gamms.create_context(seed=3, logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(4, 4))
        for number, node in enumerate(places):
            ctx.agent.create_agent(f"a{number}", start_node_id=node, team=TEAMS[number % 3], strategy=random_walk)
        for rule in (tag("red", "blue", then="eliminate", score=0), respawn(), payoff(table, zero_sum=True)):
            ctx.game.add(rule)
        for _ in range(10):
            ctx.game.step()
            assert sum(ctx.game.scores.values()) == pytest.approx(0, abs=1e-9)
