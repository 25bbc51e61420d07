"""Agents on the ground that go more than one edge in a turn, or less."""

import pytest

from gamms.errors import NoPath


def places(agent, result):
    return [agent.seen[i]["curr_pos"] for i in range(len(agent.seen))] + [result.agents[agent.name]["node"]]


def test_a_target_is_walked_to_by_the_shortest_way_with_ties_by_lowest_id(ctx, play):
    agent = play("a", 0, 15, 15, 15, speed=2)
    result = ctx.game.run(3)
    assert places(agent, result) == [0, 2, 7, 15]
    assert result.agents["a"]["moves"] == 3


def test_rules_see_the_way(ctx, play):
    play("a", 0, 15, speed=3)
    ctx.game.step()
    assert ctx.game.moves["a"].path == (0, 1, 2, 3)


def test_a_list_is_walked_along_as_far_as_the_speed_goes(ctx, play):
    agent = play("a", 0, [4, 5, 1, 0], [4, 6], speed=2)
    result = ctx.game.run(2)
    assert places(agent, result) == [0, 5, 5]
    assert result.errors[0]["message"] == "BadValue: No edge leads from node 4 to node 6."


def test_a_list_may_begin_with_the_own_node_and_be_empty(ctx, play):
    agent = play("a", 0, [0, 1, 2], [], [2], speed=5)
    assert places(agent, ctx.game.run(3)) == [0, 2, 2, 2]


def test_legal_are_the_nodes_in_reach_own_node_first(ctx, play):
    agent = play("a", 0, speed=2)
    ctx.game.step()
    assert agent.seen[0]["legal"][0] == 0
    assert sorted(agent.seen[0]["legal"]) == [0, 1, 2, 4, 5, 8]


def test_left_over_metres_carry_over_while_the_way_goes_on(ctx, play):
    ctx.game.speed_unit = "metres"
    agent = play("a", 0, *[3] * 6, speed=7.0)
    assert places(agent, ctx.game.run(6)) == [0, 0, 1, 2, 2, 3, 3]
    assert sorted(agent.seen[0]["legal"]) == [0, 1, 4]  # those next to it are, even if they are too far for now


def test_who_arrives_or_stays_has_no_metres_left(ctx, play):
    ctx.game.speed_unit = "metres"
    agent = play("a", 0, 1, 1, 2, 2, speed=15.0)
    result = ctx.game.run(4)
    assert places(agent, result) == [0, 1, 1, 2, 2]
    assert agent._columns.carry == [0.0]


def test_a_speed_of_zero_stays_and_an_endless_one_goes_anywhere(ctx, play):
    slow, fast = play("a", 0, 1, speed=0), play("b", 0, 15, speed=float("inf"))
    ctx.game.speed_unit = "metres"
    ctx.game.step()
    assert (slow.current_node_id, fast.current_node_id) == (0, 15)


def test_a_speed_may_change_while_the_game_runs(ctx, play):
    agent = play("a", 0, 3, 3, speed=1)
    ctx.game.step()
    agent.speed = 2
    ctx.game.step()
    assert agent.current_node_id == 3


def test_a_node_that_no_way_leads_to_is_not_legal(ctx, play):
    ctx.graph.graph.add_node({"id": 99, "x": 0, "y": 0})
    play("a", 0, 99, speed=2)
    message = ctx.game.run(1).errors[0]["message"]
    assert message == f"BadValue: {NoPath(0, 99)}"


@pytest.mark.parametrize("speed", [-1, float("nan"), "fast"])
def test_an_impossible_speed_is_named_when_the_game_begins(ctx, play, speed):
    play("a", 0, 1, speed=speed)
    with pytest.raises((ValueError, TypeError), match="speed of agent 'a'"):
        ctx.game.step()
