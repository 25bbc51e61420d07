"""A recording holds every default of its scenario, so that it plays by them when they have changed."""

from inspect import signature
from io import BytesIO

import gamms
from gamms import recorder, rules, scenario
from gamms.scenario import Scenario


def recorded(game, seed=None):
    """The recording of a game, and its result."""
    file = BytesIO()
    with game.build(seed) as ctx:
        ctx.record.start(file)
        result = ctx.game.run()
        ctx.record.stop()
    return recorder.open(BytesIO(file.getvalue())), result


def test_a_recording_says_every_parameter_of_a_rule(made):
    said = recorded(made({"rules.1": "referee:count_turns"}))[0].header["scenario"]["rules"]
    assert said[0]["phase"] == "after"
    assert set(said[0]["with"]) == set(signature(rules.tag).parameters)
    assert said[0]["with"] | {"hops": 1, "score": 1, "then": "respawn"} == said[0]["with"]
    assert said[1] == {"rule": "referee:count_turns", "with": {"step": 1}, "phase": "after", "name": None}


def test_a_scenario_that_is_written_out_is_the_same_game(made, folder):
    for change in (
        {},
        {"teams.red.strategy": "players"},
        {"teams.red.strategy": {"function": "players:make", "with": {"node": 3}}},
        {"teams.red.strategy": None, "teams.red.plan": {"function": "players:spread"}},
        {"facts.halves": {"function": "gamms.rules.territory:halves"}},
        {"rules.1": {"rule": "referee:count_turns", "phase": "before", "with": {"step": 3}}},
    ):
        game = made(change)
        with game.build() as ctx:
            said = ctx.game.internals.scenario
        again = Scenario(folder=folder, **said)
        with again.build() as ctx:
            assert ctx.game.internals.scenario == said
        assert again.play() == game.play()


def test_the_scenario_of_a_recording_has_the_seed_that_was_played(made):
    recording, first = recorded(made(), seed=8)
    assert recording.header["scenario"]["seed"] == recording.seed == 8
    assert scenario.from_recording(recording, folder=made().folder).play() == first


def test_parameters_that_are_no_plain_values_are_left_out():
    game = Scenario(
        seed=1,
        max_turns=3,
        map={"grid": {"width": 3, "height": 3}},
        teams={"red": {"count": 1, "strategy": "gamms.strategies:random_walk"}},
        rules=[{"rule": "reach", "with": {"team": "red", "nodes": 8}}],
    )
    with game.build() as ctx:
        said = ctx.game.internals.scenario["rules"][0]["with"]
    assert set(said) == set(signature(rules.reach).parameters) - {"winner"}
    assert gamms.scenario.Scenario(**ctx.game.internals.scenario).play() == game.play()


def test_a_default_that_is_written_out_makes_no_other_game():
    def digests(**more):
        tag = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", **more}}
        teams = {"red": {"count": 1}, "blue": {"count": 1}}
        return Scenario(map={"grid": {"width": 3, "height": 3}}, teams=teams, rules=[tag]).digests()

    usual = digests()
    assert digests(then="respawn", score=1) == usual
    assert {part for part, digest in digests(score=2).items() if digest != usual[part]} == {"rules"}


def test_a_default_of_code_in_a_team_that_is_written_out_makes_no_other_game():
    def digests(**given):
        land = {"function": "gamms.rules.territory:published", "with": {"nodes": {0: "red"}, **given}}
        teams = {"red": {"count": 1, "meta": {"land": land}}}
        return Scenario(map={"grid": {"width": 3, "height": 3}}, teams=teams).digests()

    assert digests(name="territory") == digests() != digests(name="land")
