"""Rules in batches: each game is the one that is played alone, whatever the rules do in it."""

import pytest
from batch_scenes import scene

OWNERS = {node: "red" if node % 5 < 2 else "blue" for node in range(25)}
SEEDS = [1, 2, 3, 2**40]


def rule(name, **arguments):
    return {"rule": name, "with": arguments}


TAG = rule("tag", taggers="red", tagged="blue", mutual=True)
PUBLISHED = rule("gamms.rules.territory:published", nodes=OWNERS)


@pytest.mark.parametrize(
    "rules",
    [
        [rule("tag", taggers="red", tagged="blue", mutual=True, territory=OWNERS)],
        [PUBLISHED, rule("tag", taggers="blue", tagged="red", territory="territory", then="eliminate")],
        [rule("tag", taggers="red", tagged="blue", then="eliminate"), rule("respawn", after=2, times=1)],
        [TAG | {"with": {**TAG["with"], "then": "eliminate"}}, rule("respawn", teams="red"), rule("last_team")],
        [TAG, rule("reach", team={"red": "starts of blue", "blue": [3, 24]}, score=2)],
        [rule("reach", team="red", nodes=[7, 8], winner="blue", passing=False)],
    ],
)
def test_tags_goals_and_returns_are_those_of_games_that_are_played_alone(rules, same_as_one_by_one):
    same_as_one_by_one(scene(rules), SEEDS)


@pytest.mark.parametrize("flags", [{"red": 6, "blue": 18}, {"red": 6, "blue": 6}, {"green": 12, "red": 3}])
@pytest.mark.parametrize(
    "given", [{}, {"territory": OWNERS, "goal": 2, "score": 0.5}, {"passing": False, "goal": None}]
)
def test_flags_are_taken_and_captured_as_in_games_that_are_played_alone(flags, given, same_as_one_by_one):
    same_as_one_by_one(scene([TAG, rule("capture_flag", flags=flags, **given)], max_turns=50), SEEDS)


def test_carriers_of_flags_are_known_as_numbers_of_agents():
    scenario = scene([rule("capture_flag", flags={"red": 6, "blue": 18}, goal=None)])
    with scenario.batch(seeds=SEEDS) as games:
        games.run()
        blue, red = games.observe("blue"), games.observe("red")
        known, names = red["facts"]["flags"], [*blue["name"], *red["name"], None]
        for number, seed in enumerate(SEEDS):
            with scenario.build(seed=seed) as ctx:
                ctx.game.run()
                for team, flag in ctx.game.facts["flags"].items():
                    assert known[team]["node"] == flag["node"]
                    assert names[known[team]["carrier"][number]] == flag["carrier"]
