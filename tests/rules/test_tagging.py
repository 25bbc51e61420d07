"""Tagging: who tags whom, what follows from it, and whose ground it is."""

import pytest

from gamms.rules import tag

WEST = {node: "red" if node < 5 else "blue" for node in range(10)}


def tags(ctx):
    return [(event["agent"], event["other"], event["node"]) for event in ctx.game.events if event["kind"] == "tag"]


def places(ctx):
    return {agent.name: agent.current_node_id for agent in ctx.game.agents}


def test_aerial_agents_take_part_only_where_the_rule_says_so(road):
    for air in ({}, {"air": True}):
        ctx = road(r=("red", 4))
        ctx.agent.create_agent("drone", type="AERIAL", start_node_id=4, team="blue", speed=1.0)
        ctx.game.add(tag("red", "blue", **air))
        ctx.game.step()
        assert tags(ctx) == [("r", "drone", 4)] * len(air)


def test_all_are_judged_by_where_they_are_before_anybody_is_moved(road):
    ctx = road(r1=("red", 4, 3), r2=("red", 7), b1=("blue", 4, 3), b2=("blue", 8, 7))
    ctx.agent.get_agent("r1").current_node_id = 2  # b1's start is in no agent's reach, b2's is
    ctx.game.add(tag("red", "blue", then=lambda ctx, _, other: ctx.game.respawn(other, 3)))
    ctx.game.step()
    assert sorted(tags(ctx)) == [("r1", "b1", 3), ("r2", "b2", 7)]


def test_agents_that_come_later_are_tagged_too(road):
    ctx = road(r=("red", 3))
    ctx.agent.create_team("green", [])
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


RIVALS = {  # two rules for the same two sides, how far apart the agents are, and the points of the one that tags
    "the earliest contact": (tag("red", "blue", score=2), tag("red", "blue", hops=2, score=1), 2, 1),
    "the smallest distance": (tag("red", "blue", euclid=30, score=1), tag("red", "blue", hops=1, score=2), 1, 2),
    "the first by the text, in other units": (
        tag("red", "blue", metres=9, score=1),
        tag("red", "blue", hops=3, score=2),
        0,
        2,
    ),
    "the first by the text": (tag("red", "blue", score=2), tag("red", "blue", score=1), 0, 1),
}


@pytest.mark.parametrize("decides", RIVALS)
def test_of_rules_with_the_same_sides_the_one_that_the_docs_name_tags(road, decides):
    one, other, apart, points = RIVALS[decides]
    for rules in ((one, other), (other, one)):
        ctx = road(r=("red", 0), b=("blue", apart))
        for rule in rules:
            ctx.game.add(rule)
        assert ctx.game.run(1).scores == {"red": points}
        with ctx.game.batch(2) as games:
            games.run(warn=False) if ctx.game.max_turns else games.step()
            assert games.scores["red"].tolist() == [2 * points] * 2


def test_rules_that_look_for_the_same_are_warned_about(road, caplog):
    ctx = road(r=("red", 0), b=("blue", 0))
    ctx.logger.setLevel("WARNING")
    for rule in (
        *(tag("red", "blue", score=2), tag("blue", "red", score=2), tag("red", "blue", hops=1)),
        *(tag("red", "blue", territory={0: "red"}), tag("red", "blue", then="eliminate")),
    ):
        ctx.game.add(rule)
    ctx.game.add(tag("red", "blue"), phase="before")
    ctx.game.run(1)
    said = [record.getMessage() for record in caplog.records if "look for" in record.getMessage()]
    assert said == [
        (
            "The rules 'tag' and 'tag_5' look for the same agents at the same distances: only 'tag' has an effect, the "
            "first by the text of its call, tag('red', 'blue', score=2)."
        )
    ]
