"""Scenarios as a `VecEnv` of Stable-Baselines3."""

import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason='Stable-Baselines3 is not installed: pip install "gamms[train]"')

from sb3_contrib import MaskablePPO
from sb3_contrib.common.maskable.utils import get_action_masks

from gamms import rl
from gamms.scenario import Scenario


def scene(side=3):
    teams = {
        "red": {"count": 2, "sensors": ["near"]},
        "blue": {"count": 1, "strategy": "gamms.strategies:random_walk"},
    }
    return Scenario(
        map={"grid": {"width": side, "height": side}},
        teams=teams,
        sensors={"near": {"type": "AGENT_RANGE", "sensor_range": 50}},
        rules=[{"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": "eliminate"}}, "last_team"],
        max_turns=10,
    )


def test_stable_baselines_learns_to_tag():
    env = rl.sb3_env(scene(), num_games=16, team="red")
    model = MaskablePPO("MultiInputPolicy", env, n_steps=8, batch_size=64, n_epochs=1, seed=1, device="cpu")
    model.learn(512)
    observed = env.reset()
    chosen, _ = model.predict(observed, action_masks=get_action_masks(env), deterministic=True)
    assert observed["action_mask"][np.arange(32), chosen].all()
    env.close()


def test_the_last_observation_of_a_game_is_kept():
    env = rl.sb3_env(scene(side=12).replace(max_turns=2), num_games=3, team="red")
    env.seed(4)
    env.reset()
    env.step(np.zeros(6, int))
    observed, _, ends, infos = env.step(np.zeros(6, int))
    assert ends.all()
    for slot in range(6):
        assert infos[slot]["TimeLimit.truncated"]
        assert (infos[slot]["terminal_observation"]["observation"] != observed["observation"][slot]).any()
