"""How games end: reaching a place, time, the last team."""

import pytest

from gamms.agent import AgentType
from gamms.rules import reach, tag, time_limit


def test_the_first_team_to_reach_a_node_wins(road):
    ctx = road(r=("red", 2, 3, 4), b=("blue", 9))
    ctx.game.add(reach("red", 4, score=3))
    result = ctx.game.run(9)
    assert (result.turns, result.winner, result.reason) == (2, "red", "red reached the goal")
    assert result.scores == {"red": 3}
    assert result.events == [{"turn": 2, "kind": "reach", "agent": "r", "node": 4}]


def test_a_goal_may_be_one_of_several_nodes_and_another_team_may_win(road):
    ctx = road(r=("red", 2, 3, 4), b=("blue", 0))
    ctx.game.add(reach("red", [9, 3], winner="blue"))
    assert ctx.game.run(9).winner == "blue"


def test_teams_may_race_to_each_others_starts(road):
    ctx = road(r=("red", 2, 3, 4), b=("blue", 4), b2=("blue", 9))
    ctx.game.add(reach({"red": "starts of blue", "blue": "starts of red"}))
    assert ctx.game.run(9).winner == "red"


def test_who_arrive_at_once_draw(road):
    ctx = road(r=("red", 2, 3), b=("blue", 7, 6))
    ctx.game.add(reach({"red": 3, "blue": 6}, score=1))
    result = ctx.game.run(9)
    assert (result.turns, result.winner, result.reason) == (1, None, "blue and red reached the goal")
    assert result.scores == {"blue": 1, "red": 1}


def test_the_dead_the_tagged_and_flyers_reach_nothing(road):
    ctx = road(r=("red", 2, 3), b=("blue", 4, 3))
    ctx.agent.create_agent("drone", type=AgentType.AERIAL, team="red", start_node_id=3, speed=1.0)
    ctx.game.add(tag("blue", "red"))
    ctx.game.add(reach("red", 3))
    assert ctx.game.run(3).reason == "max_turns"


def test_a_goal_that_is_passed_counts_and_the_first_there_wins(road):
    for passing, winner in ((True, "red"), (False, "blue")):
        ctx = road(r=("red", 2, 6), b=("blue", 9, 8), late=("red", 7, 8))
        ctx.agent.get_agent("r").speed = 4
        ctx.game.add(reach({"red": 4, "blue": 8}, score=1, passing=passing))
        result = ctx.game.run(3)
        assert (result.turns, result.winner, result.scores) == (1, winner, {winner: 1})
    assert [(event["agent"], event["node"]) for event in result.events] == [("b", 8)]


def test_those_who_pass_their_goals_at_one_moment_draw_and_who_leaves_a_goal_at_once_is_not_there(road):
    ctx = road(r=("red", 0, 4), b=("blue", 5, 7))
    for name, speed in (("r", 4), ("b", 2)):
        ctx.agent.get_agent(name).speed = speed
    ctx.game.add(reach({"red": 2, "blue": 6}))
    assert (ctx.game.run(3).turns, ctx.game.over["winner"]) == (1, None)
    ctx = road(r=("red", 4, 5))
    ctx.game.add(reach("red", 4))
    assert ctx.game.run(3).reason == "max_turns"


def test_who_is_tagged_on_its_way_reaches_nothing_behind_or_before(road):
    ctx = road(r=("red", 2, 6), b=("blue", 5))
    ctx.agent.get_agent("r").speed = 4
    ctx.game.add(tag("blue", "red"))
    ctx.game.add(reach("red", [4, 6]))
    ctx.game.step()
    assert [event["kind"] for event in ctx.game.events] == ["tag", "respawned"]


@pytest.mark.parametrize(("order", "winner"), [(1, None), (-1, "red")], ids=["tag first", "reach first"])
def test_rules_are_called_in_the_order_in_which_they_were_added(road, order, winner):
    ctx = road(r=("red", 2, 3), b=("blue", 3))
    for rule in [tag("blue", "red", then="eliminate"), reach("red", 3)][::order]:
        ctx.game.add(rule)
    assert ctx.game.run(1).winner == winner


@pytest.mark.parametrize("winner", ["blue", None])
def test_who_wins_by_time_may_be_said(road, winner):
    ctx = road(r=("red", 2), b=("blue", 4))
    ctx.game.scores["red"] = 5
    ctx.game.add(time_limit(2, winner=winner))
    result = ctx.game.run()
    assert (result.winner, result.turns, result.truncated) == (winner, 2, True)


def test_a_team_alone_does_not_win_by_time(road):
    ctx = road(r=("red", 2))
    ctx.game.scores["red"] = 5
    ctx.game.add(time_limit(1))
    assert ctx.game.run().winner is None


def test_a_game_that_is_over_is_not_ended_again(road):
    ctx = road(r=("red", 2))
    ctx.game.end("rain")
    ctx.game.end("snow", winner="red")
    assert ctx.game.run(3).reason == "rain"


def test_impossible_arguments_are_refused_at_once(road):
    for make, message in (
        (lambda: reach("red"), "must be an integer, not None"),
        (lambda: reach("red", []), "node for team 'red' to reach is missing"),
        (lambda: reach("red", "the start of blue"), "'starts of blue'"),
        (lambda: reach({"red": 1}, 2), "already has the nodes"),
        (lambda: reach({"red": 1, "blue": 2}, winner="red"), "is for one team"),
        (lambda: reach("red", 1, score="much"), "score must be a number"),
        (lambda: reach("red", 1, passing=None), "passing must be True or False"),
        (lambda: time_limit(0), "at least 1"),
        (lambda: time_limit(2.5), "must be an integer"),
    ):
        with pytest.raises((ValueError, TypeError), match=message):
            make()
    ctx = road(r=("red", 2))
    with pytest.raises(KeyError, match="Unknown node 77"):
        ctx.game.add(reach("red", [3, 77]))
    with pytest.raises(ValueError, match="no rule that could end it"):
        ctx.game.run()


@pytest.mark.parametrize(("rules", "winner"), [("tag reach", None), ("reach tag", "red")])
def test_between_rules_their_order_counts_and_not_the_time(road, rules, winner):
    ctx = road(r=("red", 0, [1, 2, 3]), b=("blue", 1))
    made = {"tag": tag("blue", "red", then="eliminate"), "reach": reach("red", 3)}
    ctx.agent.get_agent("r").speed = 3
    for name in rules.split():
        ctx.game.add(made[name])
    assert ctx.game.run(1).winner == winner
