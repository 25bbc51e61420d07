"""RLlib learns a game of two teams: PPO with masks, a policy for each team; agents that are out leave the episode.

    python examples/rl/with_rllib.py         # trains for some minutes, then prints how often the taggers win

The game is in catch.py; docs/howto/rllib.md explains the program.
"""

import sys
from pathlib import Path

import torch
from catch import SCENARIO, compare, reward
from ray.rllib.algorithms.ppo import PPOConfig
from ray.rllib.core.columns import Columns
from ray.rllib.core.rl_module.apis.value_function_api import ValueFunctionAPI
from ray.rllib.core.rl_module.multi_rl_module import MultiRLModuleSpec
from ray.rllib.core.rl_module.rl_module import RLModuleSpec
from ray.rllib.core.rl_module.torch.torch_rl_module import TorchRLModule
from ray.rllib.env.wrappers.pettingzoo_env import ParallelPettingZooEnv
from torch import nn

from gamms import rl


class TeamsEnv(ParallelPettingZooEnv):
    """A game for RLlib, which ends when no agent of PettingZoo is left."""

    def __init__(self, config=None):
        super().__init__(rl.parallel_env(SCENARIO, reward=reward, seed=getattr(config, "worker_index", 0)))

    def step(self, action_dict):
        observations, rewards, terminated, truncated, infos = super().step(action_dict)
        truncated["__all__"] = not self.par_env.agents and not terminated["__all__"]
        return observations, rewards, terminated, truncated, infos


class MaskedModule(TorchRLModule, ValueFunctionAPI):
    """A network for the actions of a team and one for values; illegal actions have no probability."""

    def setup(self):
        entries, actions = self.observation_space["observation"].shape[0], self.action_space.n
        self.actor, self.critic = (
            nn.Sequential(nn.Linear(entries, 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh(), nn.Linear(64, outputs))
            for outputs in (actions, 1)
        )

    def _forward(self, batch, **_):
        observed = batch[Columns.OBS]
        logits = self.actor(observed["observation"]).masked_fill(observed["action_mask"] == 0, -1e9)
        return {Columns.ACTION_DIST_INPUTS: logits}

    def compute_values(self, batch, embeddings=None):
        return self.critic(batch[Columns.OBS]["observation"])[:, 0]


def train(files, iterations):
    """Train both teams at once, and save their policies."""
    torch.set_num_threads(1)  # small networks are faster so
    teams = list(SCENARIO.spec.teams)
    config = (
        PPOConfig()
        .environment(TeamsEnv)
        .env_runners(num_env_runners=0, rollout_fragment_length="auto", batch_mode="complete_episodes")
        .multi_agent(policies=teams, policy_mapping_fn=lambda agent, *_, **__: agent.rsplit("_", 1)[0])
        .rl_module(rl_module_spec=MultiRLModuleSpec(rl_module_specs={t: RLModuleSpec(MaskedModule) for t in teams}))
        .training(train_batch_size=2048, minibatch_size=1024, num_epochs=4, lr=1e-3, entropy_coeff=0.01, grad_clip=0.5)
        .debugging(seed=1)
    )
    algorithm = config.build_algo()
    for iteration in range(iterations):
        result = algorithm.train()
        if iteration % 10 == 9:
            returns = result["env_runners"]["module_episode_returns_mean"]
            print(f"iteration {iteration + 1}:", {team: round(float(returns[team]), 2) for team in teams}, flush=True)
    env = rl.parallel_env(SCENARIO, reward=reward)
    for team in teams:
        rl.save_policy(algorithm.get_module(team).actor, files[team], env)
    algorithm.stop()


if __name__ == "__main__":
    files = {team: Path(f"rllib_{team}.safetensors") for team in SCENARIO.spec.teams}
    train(files, iterations=int(sys.argv[1]) if len(sys.argv) > 1 else 40)
    print(compare(files["taggers"], files["runners"]))
