"""Two rules by which each side tags the other: who is called first, and who is warned of it."""

import logging

import pytest

import gamms
from gamms.rules import tag
from gamms.scenario import Scenario
from gamms.strategies import random_walk, stay

EVERYWHERE = dict.fromkeys(range(25), "red")
EXCHANGED = [
    {"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}},
    {"rule": "tag", "with": {"taggers": "blue", "tagged": "red"}},
]


def is_blue(agent):
    return agent.team == "blue"


@pytest.fixture
def ctx():
    with gamms.create_context(seed=5) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(5, 5))
        for name, team in (("ann", "red"), ("bob", "blue")):
            ctx.agent.create_agent(name, start_node_id=12, team=team, strategy=stay)
        yield ctx


@pytest.mark.parametrize("blue", ["blue", is_blue])
def test_two_rules_that_tag_each_others_sides_are_warned_about_once(ctx, heard, blue):
    ctx.game.add(tag("red", blue))
    ctx.game.add(tag(blue, "red"))
    assert heard == []
    ctx.game.run(2)
    ctx.game.reset()
    ctx.game.run(2)
    assert len(heard) == 1
    assert "'tag' and 'tag_2' tag each other's sides" in heard[0]
    assert {"territory=", "mutual=True"} < {*heard[0].replace(",", "").split()}


@pytest.mark.parametrize(
    "rules",
    [
        [tag("red", "blue", mutual=True)],
        [tag("red", "blue", territory=EVERYWHERE), tag("blue", "red", territory={})],
        [tag("red", "blue"), tag("red", "blue", hops=1)],
        [tag("red", "red"), tag("red", "red", hops=1)],
        [tag("red", "blue"), tag("blue", "green")],
    ],
)
def test_other_rules_that_tag_are_not_warned_about(ctx, heard, rules):
    ctx.agent.create_agent("cid", start_node_id=0, team="green")
    for rule in rules:
        ctx.game.add(rule)
    ctx.game.run(2)
    assert heard == []


def test_the_side_that_tags_by_the_rule_that_was_added_first_is_at_an_advantage():
    def points(*sides):
        scores = {"red": 0.0, "blue": 0.0}
        for seed in range(20):
            with gamms.create_context(seed=seed, logger_config={"level": "ERROR"}) as ctx:
                ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
                for number, team in enumerate(("red", "blue", "red", "blue")):
                    ctx.agent.create_agent(f"a{number}", start_node_id=2 * number, team=team, strategy=random_walk)
                for side in sides:
                    ctx.game.add(tag(side, {"red": "blue", "blue": "red"}[side]))
                for team, score in ctx.game.run(20).scores.items():
                    scores[team] += score
        return scores

    first, second = points("red", "blue"), points("blue", "red")
    assert first["red"] > 2 * first["blue"]
    assert second["blue"] > 2 * second["red"]


def scenario():
    teams = {team: {"count": 2, "strategy": "gamms.strategies:random_walk"} for team in ("red", "blue")}
    return Scenario(map={"grid": {"width": 5, "height": 5}}, teams=teams, rules=EXCHANGED, max_turns=3)


@pytest.mark.parametrize(
    "play",
    [
        lambda game: [game.play(seed=seed) for seed in range(3)],
        lambda game: [game.replace(max_turns=turns).play(seed=1) for turns in (2, 3)],
        lambda game: [game.batch(3).run() for _ in range(2)],
        lambda game: game.batch(3, one_by_one=True).run(),
        lambda game: game.batch(3).step(),
    ],
    ids=["games", "variants", "batches", "one by one", "a turn"],
)
def test_games_of_one_scenario_warn_once(play, caplog):
    with caplog.at_level(logging.WARNING, "gamms"):
        play(scenario())
    assert sum("tag each other" in record.getMessage() for record in caplog.records) == 1


def test_a_batch_of_a_game_warns_once(ctx, heard):
    ctx.game.add(tag("red", "blue"))
    ctx.game.add(tag("blue", "red"))
    for _ in range(2):
        with ctx.game.batch(3) as games:
            games.step()
    ctx.game.run(1)
    assert [sentence for sentence in heard if "tag each other" in sentence] == heard[:1] != []
