"""Scenarios as a `VecEnv` of Stable-Baselines3."""

import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason='Stable-Baselines3 is not installed: pip install ".[train]"')

from gymnasium.wrappers.vector import RecordEpisodeStatistics
from sb3_contrib import MaskablePPO
from sb3_contrib.common.maskable.utils import get_action_masks
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.vec_env import VecMonitor

from gamms import rl
from gamms.errors import BadValue
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


@pytest.mark.parametrize("kind", [PPO, SAC])
def test_models_of_agents_that_fly_are_saved_and_fly_as_they_predict(kind, tmp_path):
    teams = {
        "red": {"count": 1, "type": "aerial", "speed": 8, "sensors": ["camera"]},
        "blue": {"count": 1, "strategy": "gamms.strategies:random_walk"},
    }
    game = scene().replace(
        teams=teams,
        sensors={"camera": {"type": "AERIAL_AGENT", "sensor_range": 60}},
        rules=[{"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "air": True, "euclid": 5}}],
    )
    env = rl.sb3_env(game, num_games=1, team="red", seed=3)
    model = kind("MultiInputPolicy", env, seed=1, device="cpu")
    rl.save_policy(model, tmp_path / "it.safetensors", env)
    env.seed(3)
    observed = env.reset()
    with game.build(3, {"red": rl.policy(tmp_path / "it.safetensors")}) as ctx:
        for _ in range(5):
            observed, *_ = env.step(model.predict(observed, deterministic=True)[0])
            ctx.game.step()
            view = env.learners.games.observe("red")
            assert ctx.agent.agents["red_0"].position == pytest.approx((*view["xy"][0, 0], view["z"][0, 0]), abs=1e-4)
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


def test_the_turns_of_agents_that_are_out_are_not_learned_of():
    tag = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": "eliminate"}}
    env = rl.sb3_env(
        scene(side=4).replace(
            teams={
                "red": {"count": 1, "strategy": "gamms.strategies:random_walk"},
                "blue": {"count": 3, "sensors": ["near"]},
            },
            rules=[tag, "last_team"],
        ),
        num_games=8,
        team="blue",
    )
    valid = []
    step = env.step_wait

    def noted():
        played = step()
        valid.append([info.get("valid", True) for info in played[3]])
        return played

    env.step_wait = noted
    model = MaskablePPO(
        "MultiInputPolicy", env, n_steps=16, batch_size=1000, n_epochs=1, seed=1, device="cpu", **env.rollouts
    )
    model.learn(16 * env.num_envs)
    is_valid = np.array(valid).T.ravel()
    rollouts = model.rollout_buffer
    assert 0 < is_valid.sum() < len(is_valid)
    assert len(rollouts.advantages) == is_valid.sum()
    assert sum(len(batch.actions) for batch in rollouts.get(64)) == is_valid.sum()
    own = rollouts.observations["observation"]
    assert own[:, :2].any(axis=1).all()  # the place of an agent that is there; of one that is out 0, 0


def test_a_life_is_one_episode():
    """Of agents that are tagged out one after the other, as `gymnasium` counts them."""
    tag = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": "eliminate"}}
    teams = {"red": {"count": 1, "strategy": "gamms.strategies:random_walk"}, "blue": {"count": 4}}
    given = scene().replace(teams=teams, sensors={}, rules=[tag, "last_team"], max_turns=30)
    options = {"num_games": 3, "team": "blue", "reward": lambda turn: turn.before.mask * 1.0}
    env, other = VecMonitor(rl.sb3_env(given, **options)), RecordEpisodeStatistics(rl.vector_env(given, **options), 999)
    env.reset()
    other.reset()
    returns = []
    for _ in range(80):
        returns += [info["episode"]["r"] for info in env.step(np.zeros(12, int))[3] if "episode" in info]
        other.step(np.zeros(12, int))
    assert returns == list(other.return_queue)
    assert len(returns) > 20
    assert min(returns) > 0


def test_a_model_that_was_loaded_needs_the_rollouts_of_its_environment(tmp_path):
    env = rl.sb3_env(scene(), num_games=2, team="red")
    MaskablePPO("MultiInputPolicy", env, n_steps=8, batch_size=16, device="cpu", **env.rollouts).save(
        tmp_path / "m.zip"
    )
    model = MaskablePPO.load(tmp_path / "m.zip", env, device="cpu")
    with pytest.raises(BadValue, match=r"load\(path, env, \*\*env.rollouts\)"):
        model.learn(32)
    MaskablePPO.load(tmp_path / "m.zip", env, device="cpu", **env.rollouts).learn(32)
    env.close()


def test_a_model_is_saved_as_a_policy_that_plays_as_it_does(tmp_path):
    env = rl.sb3_env(scene(), num_games=4, team="red", seed=5)
    model = MaskablePPO("MultiInputPolicy", env, n_steps=8, batch_size=64, seed=1, device="cpu", **env.rollouts)
    model.learn(512)
    rl.save_policy(model, tmp_path / "red.safetensors", env)
    model.save(tmp_path / "red.zip")
    red = rl.policy(tmp_path / "red.safetensors")
    trusted = rl.policy(tmp_path / "red.zip", trusted=True)
    env.seed(9)
    observed = env.reset()
    with scene().batch(4, seed=9, strategies={"red": red}) as games:
        for _ in range(3):
            chosen, _ = model.predict(observed, action_masks=get_action_masks(env), deterministic=True)
            observed, *_ = env.step(chosen)
            games.step()
            going = ~games.is_over
            places = env.learners.games.observe("red").node
            assert (games.observe("red").node[going] == places[going]).all()
    env.close()
    results = [scene().play(seed=3, strategies={"red": one}) for one in (red, trusted)]
    assert results[0] == results[1]
    with pytest.raises(BadValue, match="is a pickle"):
        rl.policy(tmp_path / "red.zip")


def test_a_model_learns_moves_and_deeds_and_plays_them(tmp_path):
    game = scene().replace(settings={"deeds": {"scan": {"node": "node"}, "rest": None}})
    env = rl.sb3_env(game, num_games=4, team="red")
    model = MaskablePPO("MultiInputPolicy", env, n_steps=8, batch_size=64, seed=1, device="cpu", **env.rollouts)
    model.learn(128)
    observed = env.reset()
    chosen, _ = model.predict(observed, action_masks=get_action_masks(env), deterministic=True)
    assert observed["action_mask"][np.arange(8), chosen[:, 0]].all()
    assert observed["action_mask"][np.arange(8), 5 + chosen[:, 1]].all()
    rl.save_policy(model, tmp_path / "red.safetensors", env)
    env.close()
    red = rl.policy(tmp_path / "red.safetensors", sample=True)
    assert {deed["deed"] for deed in game.play(seed=3, strategies={"red": red}).deeds} >= {"scan"}


def test_agents_that_fly_learn_without_masks():
    teams = {"red": {"count": 2, "type": "aerial", "speed": 8}, "blue": {"count": 1}}
    env = rl.sb3_env(scene().replace(teams=teams, sensors={}), num_games=2, team="red")
    model = PPO("MultiInputPolicy", env, n_steps=8, batch_size=32, n_epochs=1, device="cpu", **env.rollouts)
    model.learn(32)
    assert model.predict(env.reset(), deterministic=True)[0].shape == (4, 3)
    env.close()
