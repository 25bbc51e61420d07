"""Capture the flag, sentence by sentence."""

import pytest

import gamms
from gamms.agent import AgentType
from gamms.rules import capture_flag, tag

WEST = {node: "red" if node < 5 else "blue" for node in range(10)}
FLAGS = {"red": 1, "blue": 8}


def flag_events(ctx):
    return [(event["turn"], event["kind"], event["agent"]) for event in ctx.game.events if "flag" in event]


def carriers(ctx):
    return ctx.game.data["flags"]["carriers"]


def test_a_flag_is_taken_by_standing_on_it_and_captured_at_home(road):
    ctx = road(r=("red", 7, 8, 7, 6, 5, 4))
    ctx.game.add(capture_flag(FLAGS, territory=WEST))
    result = ctx.game.run(9)
    assert flag_events(ctx) == [(1, "take", "r"), (5, "capture", "r")]
    assert result.events[0] == {"turn": 1, "kind": "take", "agent": "r", "flag": "blue", "node": 8}
    assert (result.winner, result.reason, result.scores) == ("red", "flags captured", {"red": 1})


def test_without_a_territory_home_is_where_the_own_flag_stands(road):
    ctx = road(r=("red", 7, 8, 7, 6, 5, 4, 3, 2, 1))
    ctx.game.add(capture_flag(FLAGS))
    assert ctx.game.run(12).turns == 8


def test_a_team_without_a_flag_brings_others_to_where_it_began(road):
    ctx = road(r=("red", 7, 8, 7, 6), r2=("red", 6))
    ctx.game.add(capture_flag({"blue": 8}))
    assert (ctx.game.run(9).turns, ctx.game.result().winner) == (2, "red")
    ctx = road(r=("red", 7, 8, 9, 8, 7, 6))
    ctx.game.add(capture_flag({"blue": 8}))
    assert ctx.game.run(9).turns == 4


def test_captures_count_up_to_the_goal_and_the_flag_is_back_at_once(road):
    ctx = road(r=("red", 4, 5, 4, 5, 4, 5, 4, 5), second=("red", 4, 4, 5, 4))
    ctx.game.add(capture_flag({"blue": 5}, territory=WEST, goal=2, score=10))
    result = ctx.game.run(9)
    assert result.turns == 3
    assert flag_events(ctx)[:3] == [(1, "take", "r"), (2, "capture", "r"), (2, "take", "second")]
    assert result.scores == {"red": 20}
    assert ctx.game.data["flags"]["captures"] == {"red": 2}


def test_without_a_goal_captures_never_end_a_game(road):
    ctx = road(r=("red", 4, 5, 4, 5, 4))
    ctx.game.add(capture_flag({"blue": 5}, territory=WEST, goal=None))
    assert (ctx.game.run(9).turns, ctx.game.scores["red"]) == (9, 2)


def test_two_that_reach_the_goal_at_once_draw(road):
    ctx = road(r=("red", 4, 5, 4), b=("blue", 5, 4, 5))
    ctx.game.add(capture_flag({"red": 4, "blue": 5}, territory=WEST))
    result = ctx.game.run(9)
    assert (result.turns, result.winner, result.scores) == (2, None, {"red": 1, "blue": 1})


def test_who_is_tagged_before_it_is_home_captures_nothing(road):
    ctx = road(r=("red", 4, 5, 4), b=("blue", 3, 3, 4))
    ctx.game.add(tag("blue", "red"))
    ctx.game.add(capture_flag({"blue": 5}, territory=WEST))
    ctx.game.run(4)
    assert flag_events(ctx) == [(1, "take", "r"), (2, "drop", "r")]


def test_a_carrier_that_is_deleted_drops_its_flag(road):
    ctx = road(r=("red", 7, 8))
    ctx.game.add(capture_flag(FLAGS))
    ctx.game.step()
    ctx.agent.delete_agent("r")
    ctx.game.step()
    assert flag_events(ctx) == [(1, "take", "r"), (2, "drop", "r")]


def test_no_agent_takes_its_own_flag_or_one_that_is_away_or_any_from_the_air_or_for_no_team(road):
    ctx = road(b=("blue", 8), r=("red", 7, 7, 8), late=("red", 7, 7, 7, 8), nobodys=(None, 8))
    ctx.agent.create_agent("drone", type=AgentType.AERIAL, team="red", start_node_id=8, speed=1.0)
    ctx.game.add(capture_flag(FLAGS))
    ctx.game.run(4)
    assert flag_events(ctx) == [(2, "take", "r")]


def test_no_agent_carries_two_flags(road):
    ctx = road(r=("red", 8), r2=("red", 7, 7, 8))
    ctx.game.add(capture_flag({"red": 0, "blue": 8, "green": 8}))
    ctx.game.run(3)
    assert flag_events(ctx) == [(1, "take", "r"), (2, "take", "r2")]
    assert carriers(ctx) == {"blue": "r", "green": "r2", "red": None}


def test_chance_decides_who_takes_a_flag(road):
    takers = set()
    for seed in range(12):
        ctx = road(seed=seed, r=("red", 7, 8), r2=("red", 7, 8), g=("green", 9, 8))
        ctx.game.add(capture_flag(FLAGS))
        ctx.game.step()
        takers.add(carriers(ctx)["blue"])
    assert takers == {"r", "r2", "g"}


def test_two_such_rules_keep_apart_what_they_remember(road):
    ctx = road(r=("red", 7, 8, 7))
    ctx.game.add(capture_flag({"blue": 8}, goal=None))
    ctx.game.add(capture_flag({"blue": 7}, key="decoys", score=-1, goal=None))
    ctx.game.run(3)
    assert set(ctx.game.data) == set(ctx.game.facts) == {"flags", "decoys"}


def test_impossible_arguments_are_refused(road):
    for given, message in (
        ({"flags": {}}, "flags must be a mapping"),
        ({"flags": 3}, "flags must be a mapping"),
        ({"flags": {"red": "1"}}, "The base of the flag of 'red' must be an integer"),
        ({"flags": FLAGS, "goal": 0}, "goal must be at least 1"),
        ({"flags": FLAGS, "score": None}, "score must be a number"),
        ({"flags": FLAGS, "territory": [1]}, "territory must be a mapping"),
        ({"flags": FLAGS, "announce": 1}, "announce must be True or False"),
        ({"flags": FLAGS, "passing": 1}, "passing must be True or False"),
        ({"flags": FLAGS, "key": ""}, "must not be empty"),
    ):
        with pytest.raises((ValueError, TypeError), match=message):
            capture_flag(**given)
    with pytest.raises(KeyError, match="Unknown node 77"):
        road().game.add(capture_flag({"red": 77}))


# -- on the way -------------------------------------------------------------------------------------------------


def route(*nodes):
    """A strategy: go along this way."""
    return lambda state: state.update(action=list(nodes))


def open_way(*agents, seed=5, **flags):
    """A game on a road of ten nodes with agents `(name, team, start, way)` that go along their whole way in a turn."""
    ctx = gamms.create_context(seed=seed, logger_config={"level": "CRITICAL"})
    ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 10))
    for name, team, start, way in agents:
        ctx.agent.create_agent(name, start_node_id=start, team=team, speed=len(way), strategy=route(*way))
    ctx.game.add(capture_flag(**flags))
    ctx.game.step()
    return [(event["kind"], event["agent"], event["node"]) for event in ctx.game.events], ctx.game.over


def test_a_flag_may_be_taken_and_brought_home_in_one_turn():
    there_and_back = ("r", "red", 4, (5, 4))
    assert open_way(there_and_back, flags={"blue": 5})[0] == [("take", "r", 5), ("capture", "r", 4)]
    assert open_way(there_and_back, flags={"blue": 5}, passing=False)[0] == []


def test_the_first_on_the_way_takes_a_flag_and_one_that_left_at_once_does_not():
    for seed in range(4):
        taken, _ = open_way(("r", "red", 7, (6, 5, 4)), ("s", "red", 4, (5,)), flags={"blue": 5}, seed=seed)
        assert taken[0] == ("take", "r", 5)  # at 2/3, and the other at 1
    assert open_way(("r", "red", 5, (6,)), flags={"blue": 5})[0] == []


def test_a_flag_that_was_brought_home_is_taken_again_by_who_comes_later():
    happened, _ = open_way(("r", "red", 4, (5, 4, 3)), ("s", "red", 6, (5,)), flags={"blue": 5}, goal=None)
    assert happened == [("take", "r", 5), ("capture", "r", 4), ("take", "s", 5)]


def test_the_first_to_reach_the_goal_wins_and_later_moments_do_not_count():
    flags = {"red": 0, "blue": 9}
    first, second = ("r", "red", 8, (9, 8, 7, 6)), ("b", "blue", 1, (0, 1, 2))
    happened, over = open_way(first, second, flags=flags, territory={8: "red", 2: "blue"})
    assert happened == [("take", "r", 9), ("take", "b", 0), ("capture", "r", 8)]  # at 1/4, 1/3 and 1/2; the other at 1
    assert over["winner"] == "red"


def test_whoever_goes_along_a_loop_is_back_at_the_end_of_the_turn(road):
    ctx = road(r=("red", 5, [5, 5]), b=("blue", 9))
    ctx.graph.add_edges([100], [5], [5])
    ctx.agent.get_agent("r").speed = 1
    ctx.game.add(capture_flag({"blue": 5}, territory={5: "red"}, goal=None))
    ctx.game.step()
    assert [kind for _, kind, _ in flag_events(ctx)] == ["take", "capture", "take"]
