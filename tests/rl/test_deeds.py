"""Declared deeds as a second head of what learners do."""

import warnings

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="Gymnasium is not installed")
pytest.importorskip("pettingzoo", reason="PettingZoo is not installed")

from gymnasium.utils.env_checker import check_env

with warnings.catch_warnings():
    warnings.simplefilter("ignore", DeprecationWarning)  # importing the tests of PettingZoo makes a game the old way
    from pettingzoo.test import parallel_api_test, parallel_seed_test

from policy_scenes import Linear, Sequential

from gamms import rl
from gamms.errors import BadValue
from gamms.scenario import Scenario

DEEDS = {
    "arrest": {"whom": "agent"},
    "scan": {"node": "node"},
    "pay": {"amount": [1, 5], "to": "agent?"},
    "close": {"street": "edge"},
    "vote": {"yes": "boolean", "why": "text?"},
    "rest": {},
}
NAMES = 1 + 3 + 5 + 2 * 4 + 4 + 2 + 1
TAG = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}}
COOLDOWN = {"rule": "cooldown", "with": {"deed": "scan", "turns": 3}}


def scene(deeds=DEEDS, rules=(TAG, COOLDOWN), **more):
    teams = {"red": {"count": 2, "sensors": ["near"]}, "blue": {"count": 1, "strategy": "gamms.strategies:random_walk"}}
    near = {"near": {"type": "AGENT_RANGE", "sensor_range": 30}}
    settings = {"deeds": deeds, **more.pop("settings", {})}
    given = {"teams": teams, "sensors": near, "rules": list(rules), "max_turns": 9, "settings": settings, **more}
    return Scenario(map={"grid": {"width": 4, "height": 4}}, **given)


def test_choices_are_nothing_and_each_deed_with_each_target():
    with rl.Learners(scene(), teams=["red"]) as learners:
        names = learners.deeds.names
        assert len(names) == len(learners.deeds) == NAMES
        assert names[:5] == (
            "nothing",
            "arrest(whom='blue_0')",
            "arrest(whom='red_0')",
            "arrest(whom='red_1')",
            "scan(node=node 0)",
        )
        assert "pay(amount=1)" in names
        assert "pay(amount=5, to='red_1')" in names
        assert names[-4:] == ("close(street=edge 3)", "vote(yes=False)", "vote(yes=True)", "rest()")
        masks = learners.deed_masks[0, 0]
        legal = learners.masks[0, 0].sum()
        assert masks[4:9].sum() == legal
        assert masks[17:21].sum() == legal - 1
        assert masks.sum() == NAMES - (5 - legal) - (4 - (legal - 1))


def test_a_choice_of_a_node_is_the_legal_node_of_its_number():
    with rl.Learners(scene(), 2, teams=["red"]) as learners:
        names = learners.deeds.names
        view = learners.games.observe("red")
        choice = names.index("scan(node=node 0)") + np.array([[0, 1], [2, 1]])
        legal = np.take_along_axis(view["legal"], (choice - choice.min())[..., None], axis=-1)[..., 0]
        learners.step(np.zeros((2, 2), np.int64), choice)
        for game in range(2):
            done = {deed["agent"]: deed["node"] for deed in learners.games.result(game).deeds}
            assert [done[name] for name in view["name"]] == legal[game].tolist()


def test_checkers_find_no_fault(capsys):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        parallel_api_test(rl.parallel_env(scene(), team="red"), num_cycles=20)
        parallel_seed_test(lambda: rl.parallel_env(scene(), team="red"), num_cycles=10)
        check_env(rl.single_agent_env(scene(), agent="red_1"), skip_render_check=True)
    assert "Passed" in capsys.readouterr().out


def test_deeds_without_an_end_of_choices_are_refused_by_name():
    with pytest.raises(
        BadValue, match=r"'amount' of the deed 'pay' is of the kind 'number'.*amount: \[1, 2\], among the fields"
    ):
        rl.parallel_env(scene({"pay": {"amount": "number"}}, [TAG]), team="red")
    with pytest.raises(BadValue, match="With the deed 'mark' there are 10001 choices"):
        rl.parallel_env(scene({"mark": {"x": list(range(100)), "y": list(range(100))}}, [TAG]), team="red")
    games = rl.vector_env(scene(), num_games=2, team="red")
    games.reset()
    with pytest.raises(BadValue, match="each a pair of a move and a deed"):
        games.step(np.zeros(4, int))


def test_a_saved_policy_moves_and_does_deeds(tmp_path):
    pytest.importorskip("safetensors")
    game = scene()
    with rl.Learners(game, teams=["red"]) as learners:
        entries, heads = learners.observe().shape[2], learners.num_actions + len(learners.deeds)
    random = np.random.default_rng(3)
    rl.save_policy(
        Sequential(Linear(random.normal(size=(heads, entries)))), tmp_path / "red.safetensors", game, team="red"
    )
    for sample in (False, True):
        red = rl.policy(tmp_path / "red.safetensors", sample=sample)
        with game.batch(2, seed=5, strategies={"red": red}) as games:
            games.run()
            alone = game.play(seed=6, strategies={"red": red})
            assert games.result(1).to_dict()["deeds"] == alone.to_dict()["deeds"] != []
            assert games.result(1) == alone
    with pytest.raises(BadValue, match=f"gives {heads - 1} numbers, and {heads} are needed"):
        wrong = Sequential(Linear(random.normal(size=(heads - 1, entries))))
        rl.save_policy(wrong, tmp_path / "no.safetensors", game, team="red")


def test_learners_see_how_much_of_a_deed_that_lasts_they_have_done():
    defuse = {"fields": {}, "turns": 4, "interrupted_by": ["move"], "on_interrupt": "resume"}
    with rl.Learners(scene({"rest": None}, rules=[TAG]), teams=["red"]) as learners:
        entries = learners.observe().shape[2]
    with rl.Learners(scene({"rest": None, "defuse": defuse}, rules=[TAG]), 2, teams=["red"]) as learners:
        assert learners.observe().shape[2] == entries + 1
        choice = learners.deeds.names.index("defuse()")
        assert learners.deed_masks[..., choice].all()
        chosen = np.array([[choice, 0], [0, choice]])
        learners.step(np.zeros((2, 2), np.int64), chosen)
        for done in (0.25, 0.5, 0.75):
            assert learners.observe()[..., -2].tolist() == np.where(chosen > 0, done, 0.0).tolist()
            assert (learners.deed_masks[..., choice] == (chosen == 0)).all()
            learners.step(np.zeros((2, 2), np.int64))
        assert not learners.observe()[..., -2].any()
        assert learners.deed_masks[..., choice].all()
        done = [deed["agent"] for game in range(2) for deed in learners.games.result(game).deeds]
        assert done == ["red_0", "red_1"]


def test_a_number_of_a_deed_that_lasts_is_refused_with_a_way_out_that_it_can_take():
    wait = {"fields": {"long": "number"}, "turns": 4}
    with pytest.raises(BadValue, match=r"long: \[1, 2\], among the fields of the deed"):
        rl.Learners(scene({"wait": wait}, rules=[TAG]), teams=["red"])
    rl.Learners(scene({"wait": {**wait, "fields": {"long": [1, 2]}}}, rules=[TAG]), teams=["red"]).close()
