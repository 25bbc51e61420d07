"""Learners that go several edges in a turn, anywhere, or by metres: action k is the k-th node of `state["legal"]`."""

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="Gymnasium is not installed")
pytest.importorskip("pettingzoo", reason="PettingZoo is not installed")

from policy_scenes import Linear, Sequential

from gamms import rl
from gamms.errors import BadValue
from gamms.scenario import Scenario

WALK = "gamms.strategies:random_walk"
TAG = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}}
NEAR = {"near": {"type": "AGENT_RANGE", "sensor_range": 30}}
ALL = {"near": {"type": "AGENT"}}
KINDS = {
    "two edges": {"speed": 2.0},
    "edges and parts": {"speed": 2.5},
    "speeds that differ": {"blue_speed": 3.0},
    "anywhere": {"settings": {"legal": "any"}},
    "metres": {"speed": 24.0, "settings": {"speed_unit": "metres"}, "sensors": ALL},
    "arrivals": {"speed": 24.0, "settings": {"speed_unit": "metres", "decide": "arrival"}, "sensors": ALL},
}


def scene(speed=None, blue_speed=None, sensors=NEAR, **more):
    red = {"count": 2, "strategy": WALK, "sensors": ["near"]} | ({} if speed is None else {"speed": speed})
    blue = {"count": 2, "strategy": WALK} | ({} if blue_speed is None else {"speed": blue_speed})
    teams = {"red": red, "blue": blue}
    given = {"teams": teams, "sensors": sensors, "rules": [TAG], "max_turns": 8, **more}
    return Scenario(map={"grid": {"width": 4, "height": 4}}, **given)


def test_the_number_of_actions_is_worked_out_from_the_map():
    def width(**kind):
        with rl.Learners(scene(**kind), teams=["red"]) as learners:
            return learners.num_actions

    assert width() == 5
    assert width(speed=2.0) == 11  # in the middle of a grid of 4 by 4: two streets away
    assert width(speed=2.5) > 11
    assert width(settings={"legal": "any"}) == 16
    assert width(speed=float("inf")) == 16
    with pytest.raises(BadValue, match=r"may go to 4900 nodes or more.*4096.*lower speeds"):
        rl.Learners(scene(settings={"legal": "any"}).replace(map={"grid": {"width": 70, "height": 70}}), teams=["red"])


def test_nodes_that_actions_lead_to_are_in_observations_of_nodes():
    for observation in (rl.neighbourhood(3), rl.graph()):
        with rl.Learners(scene(speed=2.0), teams=["red"], observation=observation) as learners:
            entry = observation.names.index("action")
            actions = learners.observe()[..., entry]
            for number in range(2):
                assert sorted(actions[0, number][actions[0, number] >= 0]) == [*range(learners.masks[0, number].sum())]


def test_an_action_that_a_closed_road_forbids_stays(tmp_path):
    (tmp_path / "storm.py").write_text(
        "def storm(ctx):\n"
        "    if ctx.game.turn == 1:\n"
        "        ctx.graph.close_roads([edge for edge in ctx.graph.graph.get_edges()])\n"
    )
    game = scene(rules=[{"rule": "storm:storm", "phase": "before"}, TAG], folder=tmp_path)
    env, games = rl.parallel_env(game, team="red", seed=3), rl.vector_env(game, num_games=1, team="red", seed=3)
    env.reset()
    games.reset()
    for _ in range(3):
        actions = games.action_masks().sum(axis=1) - 1
        observed, *_ = env.step(dict(zip(("red_0", "red_1"), actions, strict=True)))
        many, *_ = games.step(actions)
        for slot, name in enumerate(env.agents):
            assert np.array_equal(many["observation"][slot], observed[name]["observation"])
    assert games.action_masks().sum(axis=1).tolist() == [1, 1]
    assert env.action_masks()["red_0"].sum() == 1


@pytest.mark.parametrize("kind", KINDS)
def test_a_policy_plays_alone_as_in_batches(kind, tmp_path):
    pytest.importorskip("safetensors")
    game = scene(**KINDS[kind])
    with rl.Learners(game, teams=["red"]) as learners:
        entries, actions = learners.observe().shape[2], learners.num_actions
    file, random = tmp_path / "red.safetensors", np.random.default_rng(1)
    rl.save_policy(Sequential(Linear(random.normal(size=(actions, entries)))), file, game, team="red")
    red = rl.policy(file)
    with game.batch(3, seed=1, strategies={"red": red}) as games:
        games.run()
        alone = [game.play(seed=seed, strategies={"red": red}) for seed in (1, 2, 3)]
        assert [games.result(number).to_dict()["agents"] for number in range(3)] == [
            one.to_dict()["agents"] for one in alone
        ]
        assert any(one.agents["red_0"]["moves"] for one in alone)
