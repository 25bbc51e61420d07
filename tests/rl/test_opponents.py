"""Opponents that are drawn from a pool for each game, and what environments tell of them."""

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="Gymnasium is not installed")
pytest.importorskip("safetensors", reason="safetensors is not installed")

from gamms import rl
from gamms.errors import MissingFile
from gamms.scenario import Scenario
from gamms.strategies import chase, flee, pool

WALK = "gamms.strategies:random_walk"


def scene(turns=4):
    """Two taggers and two runners, who see to a distance."""
    team = {"count": 2, "strategy": WALK, "sensors": ["eyes"]}
    return Scenario(
        map={"grid": {"rows": 4, "columns": 4}},
        sensors={"eyes": {"type": "AGENT_RANGE", "range_m": 25}},
        teams={"red": team, "blue": team},
        rules=[{"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}}],
        max_turns=turns,
    )


@pytest.fixture
def blue(tmp_path):
    """A pool of two policies of random weights and a strategy."""
    entries = 2 + 5 * 3 + 3 * 5 + 1
    for number in (1, 2):
        weight = np.random.default_rng(number).normal(size=(5, entries))
        rl.save_policy([(weight, np.zeros(5))], tmp_path / f"{number}.safetensors", scene(), team="blue")
    paths = [tmp_path / "1.safetensors", str(tmp_path / "2.safetensors")]
    return {"policies": rl.opponents(paths), "all kinds": rl.opponents({"a": paths[0], "b": paths[1], "c": flee})}


@pytest.mark.parametrize("kind", ["policies", "all kinds"])
def test_policies_and_strategies_are_drawn_as_in_games_alone(blue, kind):
    others = {"blue": blue[kind]}
    with scene(12).batch(10, strategies=others) as games:
        games.run()
        alone = [scene(12).play(seed=seed, strategies=others) for seed in range(10)]
        assert [games.result(number) for number in range(10)] == alone
    assert len({one.row()["opponent.blue"] for one in alone}) > 1


@pytest.mark.parametrize("workers", [1, 2])
def test_infos_of_many_games_name_the_opponents_also_at_the_end(blue, workers):
    others = {"blue": blue["all kinds"]}
    env = rl.vector_env(scene(), num_games=6, team="red", others=others, workers=workers)
    _, infos = env.reset(seed=0)
    drawn = [scene().play(seed=seed, strategies=others).row()["opponent.blue"] for seed in range(12)]
    assert infos["opponent.blue"].tolist() == np.repeat(drawn[:6], 2).tolist()
    for _ in range(4):
        *_, infos = env.step(np.zeros(12, int))
    assert infos["final_info"]["opponent.blue"].tolist() == np.repeat(drawn[:6], 2).tolist()
    assert infos["opponent.blue"].tolist() == np.repeat(drawn[6:], 2).tolist()
    env.close()


def test_infos_of_games_in_processes_have_their_maps():
    maps = [{"grid": {"rows": rows, "columns": 4}} for rows in (3, 4, 5)]
    envs = [rl.vector_env(scene(), num_games=5, team="red", maps=maps, workers=workers) for workers in (1, 2)]
    found = []
    for env in envs:
        infos = [env.reset(seed=0)[1]] + [env.step(np.zeros(10, int))[4] for _ in range(9)]
        assert all(info["map_spec"][slot] == maps[info["map"][slot]] for info in infos for slot in range(10))
        found.append([info["map"].tolist() for info in infos])
        env.close()
    assert found[0] == found[1]
    assert found[0][0] != found[0][-1]


def test_infos_of_one_game_name_the_opponent():
    others = {"blue": pool([chase, flee])}
    env = rl.single_agent_env(scene(), agent="red_0", others=others)
    for seed in range(4):
        _, info = env.reset(seed=seed)
        drawn = scene().play(seed=seed, strategies=others).row()["opponent.blue"]
        assert info["opponent.blue"] == drawn
        assert env.step(0)[4]["opponent.blue"] == drawn
    env.close()
    team = {**scene().to_dict()["teams"]["blue"]}
    team["strategy"] = {
        "function": "gamms.strategies:pool",
        "with": {"members": [{"function": "gamms.strategies:flee"}]},
    }
    env = rl.parallel_env(scene().replace(**{"teams.blue": team}), team="red")
    _, infos = env.reset(seed=1)
    assert infos["red_1"]["opponent.blue"] == "flee"
    env.close()


def test_a_path_without_a_policy_is_named(tmp_path):
    with pytest.raises(MissingFile, match=r"none.safetensors' for a policy"):
        rl.opponents([tmp_path / "none.safetensors"])
