"""Rules that tag are called as one: which of them was added first does not matter."""

import pytest

import gamms
from gamms.rules import respawn, tag
from gamms.scenario import Scenario
from gamms.strategies import random_walk

SIDES = [("red", "blue"), ("blue", "red")]


def walkers(*, width, seed, rules):
    """A game of two walkers a side on a grid."""
    ctx = gamms.create_context(seed=seed, logger_config={"level": "ERROR"})
    ctx.graph.attach_networkx_graph(gamms.graph.grid(width, width))
    for number, team in enumerate(("red", "blue", "red", "blue")):
        start = (width * width - 1) * (number < 2) + (-1) ** (number < 2) * 2 * number
        ctx.agent.create_agent(f"a{number}", start_node_id=start, team=team, strategy=random_walk)
    for rule in rules:
        ctx.game.add(rule)
    return ctx


def test_two_sides_that_tag_each_other_score_about_the_same_in_500_games():
    teams = {team: {"count": 2, "strategy": "gamms.strategies:random_walk"} for team in ("red", "blue")}
    rules = [{"rule": "tag", "with": {"taggers": a, "tagged": b}} for a, b in SIDES]
    scenario = Scenario(map={"grid": {"width": 5, "height": 5}}, teams=teams, rules=rules, max_turns=40)
    with scenario.batch(500) as games:
        games.run()
        scores = [games.result(number).scores for number in range(500)]
    red, blue = (sum(score.get(team, 0) for score in scores) for team in ("red", "blue"))
    assert red + blue > 1000
    assert 0.9 < red / blue < 1.1


@pytest.mark.parametrize("then", ["respawn", "eliminate"])
def test_the_order_in_which_rules_are_added_changes_no_game(then):
    def play(sides, seed):
        rules = [tag(*side, then=then, score=score) for side, score in sides]
        with walkers(width=3, seed=seed, rules=[*rules, respawn(2)]) as ctx:
            ctx.game.run(20)
            return list(ctx.game.events), dict(ctx.game.scores)

    scored = list(zip(SIDES, (1, 3), strict=True))
    for seed in range(10):
        assert play(scored, seed) == play(scored[::-1], seed)


def test_a_rule_that_is_removed_tags_no_more_and_the_others_go_on(road):
    ctx = road(ann=("red", 3), bob=("blue", 3))
    for name, side in zip(("first", "second"), SIDES, strict=True):
        ctx.game.add(tag(*side), name=name)
    ctx.game.remove("first")
    ctx.game.step()
    assert dict(ctx.game.scores) == {"blue": 1}


def test_rules_that_remove_one_that_tags_are_followed_in_the_same_turn(road):
    ctx = road(ann=("red", 3), bob=("blue", 3))
    ctx.game.add(lambda ctx: ctx.game.remove("first") if ctx.game.turn == 1 else None)
    for name, side in zip(("first", "second"), SIDES, strict=True):
        ctx.game.add(tag(*side), name=name)
    ctx.game.step()
    assert dict(ctx.game.scores) == {"blue": 1}
