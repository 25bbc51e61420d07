"""Environments in the wrappers of SuperSuit: all that fit their spaces."""

import warnings

import numpy as np
import pytest

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    supersuit = pytest.importorskip("supersuit", reason="SuperSuit is not installed")

from gamms import rl
from gamms.scenario import Scenario

pytestmark = pytest.mark.filterwarnings("ignore")  # of SuperSuit itself
WRAPPERS = {
    "black_death_v3": {},
    "dtype_v0": {"dtype": np.float16},
    "flatten_v0": {},
    "reshape_v0": {},  # `shape` is that of the environment
    "frame_stack_v1": {"stack_size": 3},
    "normalize_obs_v0": {},
    "pad_action_space_v0": {},
    "pad_observations_v0": {},
    "agent_indicator_v0": {},
    "reward_lambda_v0": {"change_reward_fn": np.sign},
    "clip_reward_v0": {},
    "sticky_actions_v0": {"repeat_action_probability": 0.5},
    "delay_observations_v0": {"delay": 2},
    "max_observation_v0": {"memory": 2},
    "frame_skip_v0": {"num_frames": 2},
    "nan_random_v0": {},
    "nan_noop_v0": {"no_op_action": 0},
    "nan_zeros_v0": {},
    "observation_lambda_v0": {"change_observation_fn": lambda observed, _: observed / 2},
    "action_lambda_v1": {"change_action_fn": lambda action, _: action, "change_space_fn": lambda space: space},
}
OF_TEAMS = {"black_death_v3", "pad_action_space_v0", "pad_observations_v0", "agent_indicator_v0"}


def scene():
    tag = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": "eliminate"}}
    teams = {"red": {"count": 1, "strategy": "gamms.strategies:random_walk"}, "blue": {"count": 3}}
    return Scenario(map={"grid": {"width": 4, "height": 3}}, teams=teams, rules=[tag, "last_team"], max_turns=20)


def alive(turn):
    return turn.before.mask * 1.0


@pytest.mark.parametrize("name", WRAPPERS)
def test_wrappers_take_teams(name):
    options = dict(WRAPPERS[name])
    env = rl.parallel_env(scene(), team="blue", reward=alive, mask="info")
    if name == "reshape_v0":
        options["shape"] = (1, *env.observation_space("blue_0").shape)
    wrapped = getattr(supersuit, name)(env, **options)
    for seed in (1, 2):
        observed, _ = wrapped.reset(seed=seed)
        while wrapped.agents:
            assert all(observed[agent] in wrapped.observation_space(agent) for agent in wrapped.agents)
            observed, *_ = wrapped.step({agent: wrapped.action_space(agent).sample() for agent in wrapped.agents})
    wrapped.close()


@pytest.mark.parametrize("name", [name for name in WRAPPERS if name not in OF_TEAMS])
def test_wrappers_take_single_agents(name):
    options = dict(WRAPPERS[name])
    env = rl.single_agent_env(scene(), agent="blue_0", reward=alive, mask="info")
    if name == "reshape_v0":
        options["shape"] = (1, *env.observation_space.shape)
    wrapped = getattr(supersuit, name)(env, **options)
    observed, _ = wrapped.reset(seed=1)
    ends = False
    while not ends:
        assert observed in wrapped.observation_space
        observed, _, terminated, truncated, _ = wrapped.step(wrapped.action_space.sample())
        ends = terminated or truncated
    wrapped.close()


@pytest.mark.parametrize("processes", [0, 2])
def test_several_teams_make_one_vector(processes):
    env = rl.parallel_env(scene(), team="blue", reward=alive, mask="info")
    one = supersuit.pettingzoo_env_to_vec_env_v1(supersuit.black_death_v3(env))
    games = supersuit.concat_vec_envs_v1(one, 2, num_cpus=processes, base_class="gymnasium")
    games.reset(seed=3)
    for _ in range(30):
        observed, rewards, *_ = games.step(np.zeros(6, np.int64))
    assert observed.shape[0] == len(rewards) == games.num_envs == 6
    games.close()
