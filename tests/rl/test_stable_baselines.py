"""Scenarios as a `VecEnv` of Stable-Baselines3."""

import json

import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason='Stable-Baselines3 is not installed: pip install ".[train]"')

from gymnasium.wrappers.vector import RecordEpisodeStatistics
from sb3_contrib import MaskablePPO
from sb3_contrib.common.maskable.utils import get_action_masks
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.logger import configure
from stable_baselines3.common.vec_env import VecMonitor

from gamms import kernels, rl
from gamms.errors import BadValue
from gamms.scenario import Scenario
from gamms.strategies import random_walk, stay


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
    with game.build(env.learners.games.seeds[0], {"red": rl.policy(tmp_path / "it.safetensors")}) as ctx:
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
    options = {"num_games": 3, "team": "blue", "reward": lambda turn: turn.before.mask * 1.0}
    env = VecMonitor(rl.sb3_env(hunted(), **options))
    other = RecordEpisodeStatistics(rl.vector_env(hunted(), **options), 999)
    env.reset()
    other.reset()
    returns = []
    for _ in range(80):
        returns += [info["episode"]["r"] for info in env.step(np.zeros(12, int))[3] if "episode" in info]
        other.step(np.zeros(12, int))
    assert returns == list(other.return_queue)
    assert len(returns) > 20
    assert min(returns) > 0


def hunted():
    """Four agents that go out one after the other, and a hunter at random."""
    tag = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": "eliminate"}}
    teams = {"red": {"count": 1, "strategy": "gamms.strategies:random_walk"}, "blue": {"count": 4}}
    return scene().replace(teams=teams, sensors={}, rules=[tag, "last_team"], max_turns=30)


def weigh(turn):
    """Pay each agent that begins the turn the number of those that do."""
    return turn.before.mask * turn.before.mask.sum(axis=1, keepdims=True) * 1.0


def lives_of(scenario, seed, actions):
    """Return the lengths and returns of the agents' lives in a game alone by these actions, (turns, agents)."""
    env = rl.parallel_env(scenario, team="blue", reward=weigh)
    env.reset(seed=[seed])
    earned = dict.fromkeys(env.agents, 0.0)
    lives = []
    for turn, chosen in enumerate(actions, 1):
        here = env.agents
        _, rewards, *_ = env.step({name: chosen[env.possible_agents.index(name)] for name in here})
        earned = {name: earned[name] + rewards[name] for name in here}
        lives += [(turn, earned[name]) for name in here if name not in env.agents]
        if not env.agents:
            return turn, lives
    return len(actions), lives


def test_the_log_of_a_model_has_the_true_lives_of_agents_that_go_out(tmp_path):
    games, turns = 3, 96
    env = rl.sb3_env(hunted(), num_games=games, team="blue", reward=weigh)
    taken = []
    play = env.step_async
    env.step_async = lambda actions: taken.append(actions.copy()) or play(actions)
    options = {"n_steps": turns, "batch_size": 64, "n_epochs": 1, "stats_window_size": 10_000}
    model = MaskablePPO("MultiInputPolicy", env, seed=1, device="cpu", **options, **env.rollouts)
    model.set_logger(configure(str(tmp_path), ["json"]))
    model.learn(env.num_envs * turns)
    model.logger.close()
    logged = json.loads((tmp_path / "progress.json").read_text().splitlines()[-1])
    env.close()
    taken = np.array(taken).reshape(turns, games, 4)
    lives = []
    for game in range(games):
        first = 0
        for episode in range(turns):
            [seed] = kernels.compute_run_seeds([1], [game], [episode])
            played, ended = lives_of(hunted(), seed, taken[first:, game])
            lives += ended
            first += played
            if first == turns:
                break
    lengths, returns = np.array(lives).T
    assert len({*lengths}) > 5
    assert len(lives) > 20
    assert logged["rollout/ep_len_mean"] == pytest.approx(lengths.mean())
    assert logged["rollout/ep_rew_mean"] == pytest.approx(returns.mean())


@pytest.mark.parametrize("workers", [1, 2])
def test_a_life_names_the_opponent_and_the_map_of_its_game(workers):
    maps = [{"grid": {"width": width, "height": 3}} for width in (3, 4)]
    others = {"blue": rl.opponents({"still": stay, "walks": random_walk})}
    options = {"num_games": 4, "team": "red", "others": others, "maps": maps}
    env = rl.sb3_env(scene(), workers=workers, **options)
    env.seed(3)
    env.reset()
    alone = rl.Learners(scene(), 1, teams=["red"], others=others, maps=maps)
    episodes = [0] * 4
    found = set()
    for _ in range(25):
        *_, ends, infos = env.step(np.zeros(8, int))
        for slot in np.flatnonzero(ends).tolist():
            game = slot // 2
            alone.begin(np.array([0]), kernels.compute_run_seeds([3], [game], [episodes[game]]))
            for key, column in alone.drawn.items():
                assert infos[slot][key] == column[0]
            found.add((infos[slot]["opponent.blue"], infos[slot]["map"]))
            assert infos[slot]["map_spec"] == maps[infos[slot]["map"]]
        for game in np.flatnonzero(ends[::2]).tolist():
            episodes[game] += 1
    assert len(found) == 4
    alone.close()
    env.close()


def test_a_callback_changes_the_opponents_of_games_that_begin_later():
    env = VecMonitor(rl.sb3_env(scene(), num_games=2, team="red", others={"blue": random_walk}))
    env.reset()
    named = []
    for turn in range(30):
        if turn == 5:
            env.set_others({"blue": stay})
        *_, ends, infos = env.step(np.zeros(4, int))
        named.append([infos[slot]["opponent.blue"] for slot in np.flatnonzero(ends).tolist()])
    assert {name for names in named[:5] for name in names} <= {"random_walk"}
    assert {name for names in named[16:] for name in names} == {"stay"}
    env.close()


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
    with scene().batch(seeds=env.learners.games.seeds, strategies={"red": red}) as games:
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
