"""Rules that tag are called as one: which of them was added first does not matter."""

from gamms.rules import tag
from gamms.scenario import Scenario

SIDES = [("red", "blue"), ("blue", "red")]


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
