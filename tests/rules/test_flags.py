"""Capture the flag, sentence by sentence."""

import pytest

from gamms.agent import AgentType
from gamms.rules import capture_flag

WEST = {node: "red" if node < 5 else "blue" for node in range(10)}
FLAGS = {"red": 1, "blue": 8}


def flag_events(ctx):
    return [(event["turn"], event["kind"], event["agent"]) for event in ctx.game.events if "flag" in event]


def carriers(ctx):
    return ctx.game.data["flags"]["carriers"]


def test_captures_count_up_to_the_goal_and_the_flag_is_back_at_once(road):
    ctx = road(r=("red", 4, 5, 4, 5, 4, 5, 4, 5), second=("red", 4, 4, 5, 4))
    ctx.game.add(capture_flag({"blue": 5}, territory=WEST, goal=2, score=10))
    result = ctx.game.run(9)
    assert result.turns == 3
    assert flag_events(ctx)[:3] == [(1, "take", "r"), (2, "capture", "r"), (2, "take", "second")]
    assert result.scores == {"red": 20}
    assert ctx.game.data["flags"]["captures"] == {"red": 2}


def test_a_carrier_that_is_deleted_drops_its_flag(road):
    ctx = road(r=("red", 7, 8))
    ctx.game.add(capture_flag(FLAGS))
    ctx.game.step()
    ctx.agent.delete_agent("r")
    ctx.game.step()
    assert flag_events(ctx) == [(1, "take", "r"), (2, "drop", "r")]


@pytest.mark.parametrize("home", [{}, {"territory": {0: "red"}}])  # nodes of no team are no home
def test_a_carrier_that_has_left_its_team_captures_nothing(road, home):
    ctx = road(r=("red", 7, 8, 7))
    ctx.game.add(capture_flag(FLAGS, **home))
    ctx.game.step()
    ctx.agent.get_agent("r").team = None
    ctx.game.step()
    assert flag_events(ctx) == [(1, "take", "r")]
    assert carriers(ctx)["blue"] == "r"


def test_no_agent_takes_its_own_flag_or_one_that_is_away_or_any_from_the_air_or_for_no_team(road):
    ctx = road(b=("blue", 8), r=("red", 7, 7, 8), late=("red", 7, 7, 7, 8), nobodys=(None, 8))
    ctx.agent.create_agent("drone", type=AgentType.AERIAL, team="red", start_node_id=8, speed=1.0)
    ctx.game.add(capture_flag(FLAGS))
    ctx.game.run(4)
    assert flag_events(ctx) == [(2, "take", "r")]


def test_two_such_rules_have_separate_memories(road):
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


def test_an_agent_on_a_loop_is_back_at_the_end_of_the_turn(road):
    ctx = road(r=("red", 5, [5, 5]), b=("blue", 9))
    ctx.graph.add_edges([100], [5], [5])
    ctx.agent.get_agent("r").speed = 1
    ctx.game.add(capture_flag({"blue": 5}, territory={5: "red"}, goal=None))
    ctx.game.step()
    assert [kind for _, kind, _ in flag_events(ctx)] == ["take", "capture", "take"]
