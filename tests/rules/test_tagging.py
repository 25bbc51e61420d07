"""Tagging: who tags whom, what follows from it, and whose ground it is."""

import pytest

from gamms.rules import tag

WEST = {node: "red" if node < 5 else "blue" for node in range(10)}


def tags(ctx):
    return [(event["agent"], event["other"], event["node"]) for event in ctx.game.events if event["kind"] == "tag"]


def places(ctx):
    return {agent.name: agent.current_node_id for agent in ctx.game.agents}


def test_who_is_tagged_goes_back_to_its_start(road):
    ctx = road(r=("red", 2, 3), b=("blue", 4, 3))
    ctx.game.add(tag("red", "blue"))
    ctx.game.step()
    assert places(ctx) == {"r": 3, "b": 4}
    assert ctx.agent.get_agent("b").prev_node_id == 4
    assert tags(ctx) == [("r", "b", 3)]
    assert ctx.game.scores == {"red": 1}


def test_who_is_tagged_may_be_out(road):
    ctx = road(r=("red", 2, 3), b=("blue", 4, 3))
    ctx.game.add(tag("red", "blue", then="eliminate", score=2.5))
    result = ctx.game.run(1)
    assert not result.agents["b"]["alive"]
    assert result.scores == {"red": 2.5}


def test_who_passes_a_tagger_on_an_edge_is_tagged_on_it_behind_the_node_it_came_from(road):
    for passing, node in ((True, 3), (False, 2)):
        ctx = road(r=("red", 2, 3), b=("blue", 3, 2))
        ctx.game.add(tag("red", "blue", then="eliminate", passing=passing))
        ctx.game.step()
        assert tags(ctx) == [("r", "b", node)]


def test_a_tagger_reaches_as_far_as_the_rule_says(road):
    for nearness, tagged in (({"hops": 2}, 1), ({"hops": 1}, 0), ({"metres": 20}, 1), ({"euclid": 19.9}, 0)):
        ctx = road(r=("red", 2), b=("blue", 4))
        ctx.game.add(tag("red", "blue", **nearness))
        ctx.game.step()
        assert len(tags(ctx)) == tagged


def test_aerial_agents_take_part_only_where_the_rule_says_so(road):
    for air in ({}, {"air": True}):
        ctx = road(r=("red", 4))
        ctx.agent.create_agent("drone", type="AERIAL", start_node_id=4, team="blue", speed=1.0)
        ctx.game.add(tag("red", "blue", **air))
        ctx.game.step()
        assert tags(ctx) == [("r", "drone", 4)] * len(air)


def test_a_tagger_tags_one_the_nearest(road):
    ctx = road(r=("red", 2), b3=("blue", 3), b4=("blue", 4))
    ctx.game.add(tag("red", "blue", hops=5))
    ctx.game.step()
    assert tags(ctx) == [("r", "b3", 3)]


def test_all_are_judged_by_where_they_are_before_anybody_is_moved(road):
    ctx = road(r1=("red", 4, 3), r2=("red", 7), b1=("blue", 4, 3), b2=("blue", 8, 7))
    ctx.agent.get_agent("r1").current_node_id = 2  # b1's start is in no agent's reach, b2's is
    ctx.game.add(tag("red", "blue", then=lambda ctx, _, other: ctx.game.respawn(other, 3)))
    ctx.game.step()
    assert sorted(tags(ctx)) == [("r1", "b1", 3), ("r2", "b2", 7)]


def test_both_sides_may_tag_each_other(road):
    ctx = road(r=("red", 2, 3), b=("blue", 4, 3), spare=("red", 3))
    ctx.game.add(tag("red", "blue", mutual=True))
    ctx.game.step()
    assert len(tags(ctx)) == 2
    assert places(ctx)["b"] == 4
    assert ctx.game.scores == {"red": 1, "blue": 1}


def test_who_cannot_be_tagged_keeps_no_tagger_busy(road):
    ctx = road(r=("red", 4), intruder=("blue", 3), near=("blue", 5), nearest=("blue", 5))
    ctx.game.add(tag("red", "blue", hops=1, territory=WEST))
    ctx.game.step()
    assert tags(ctx) == [("r", "intruder", 3)]


def test_agents_that_come_later_are_tagged_too(road):
    ctx = road(r=("red", 3))
    ctx.game.add(tag("red", "green"))
    ctx.game.step()
    ctx.agent.create_agent("g", start_node_id=3, team="green")
    ctx.game.step()
    assert tags(ctx) == [("r", "g", 3)]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"hops": -1}, "hops must not be negative"),
        ({"hops": 1, "metres": 5}, "Give one distance, not hops=1 and metres=5"),
        ({"then": "respwan"}, "Did you mean 'respawn'"),
        ({"then": 3}, "then must be"),
        ({"territory": 3}, "territory must be a mapping"),
        ({"territory": {"a": "red"}}, "A node of a territory must be an integer"),
        ({"mutual": "yes"}, "mutual must be True or False"),
        ({"score": "1"}, "score must be a number"),
    ],
)
def test_impossible_arguments_are_refused_at_once(given, message):
    with pytest.raises((ValueError, TypeError), match=message):
        tag("red", "blue", **given)
