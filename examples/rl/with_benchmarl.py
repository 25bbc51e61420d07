"""BenchMARL learns a game of two teams: MAPPO with masks, a group for each team.

    python examples/rl/with_benchmarl.py     # trains for a minute, then prints how often the taggers win

The game is in catch.py; docs/howto/benchmarl.md explains the program.
"""

import sys
import tempfile
from pathlib import Path

import torch
from benchmarl.algorithms import MappoConfig
from benchmarl.environments.common import TaskClass
from benchmarl.experiment import Experiment, ExperimentConfig
from benchmarl.models.mlp import MlpConfig
from catch import SCENARIO, compare, reward

from gamms import rl


class GammsTask(TaskClass):
    """A scenario as a task: each team is a group, and observations are apart from masks."""

    def get_env_fun(self, num_envs, continuous_actions, seed, device):
        return lambda: rl.torchrl_env(num_games=num_envs, seed=seed, **self.config).to(device)

    def supports_continuous_actions(self):
        return False

    def supports_discrete_actions(self):
        return True

    def has_render(self, env):
        return False

    def max_steps(self, env):
        return 32

    def group_map(self, env):
        return env.group_map

    def _select(self, env, key):
        spec = env.full_observation_spec_unbatched.clone()
        for team in env.group_map:
            for other in set(spec[team].keys()) - {key}:
                del spec[team, other]
        return spec

    def observation_spec(self, env):
        return self._select(env, "observation")  # networks get nothing else

    def action_mask_spec(self, env):
        return self._select(env, "action_mask")

    def action_spec(self, env):
        return env.full_action_spec_unbatched

    def info_spec(self, env):
        return None

    def state_spec(self, env):
        return None

    @staticmethod
    def env_name():
        return "gamms"


def train(files, iterations):
    """Train both teams at once, and save their policies."""
    torch.set_num_threads(1)  # small networks are faster so
    config = ExperimentConfig.get_from_yaml()
    config.prefer_continuous_actions = False
    config.max_n_iters = iterations
    config.max_n_frames = None
    config.on_policy_n_envs_per_worker = 256  # games
    config.on_policy_collected_frames_per_batch = 256 * 32
    config.on_policy_minibatch_size = 2048
    config.on_policy_n_minibatch_iters = 4
    config.lr = 1e-3
    config.evaluation = False
    config.loggers = []
    config.save_folder = tempfile.mkdtemp()
    network = MlpConfig(num_cells=[64, 64], layer_class=torch.nn.Linear, activation_class=torch.nn.Tanh)
    experiment = Experiment(
        task=GammsTask("catch", {"scenario": SCENARIO, "reward": reward}),
        algorithm_config=MappoConfig.get_from_yaml(),
        model_config=network,
        critic_model_config=network,
        seed=1,
        config=config,
    )
    experiment.run()
    env = rl.torchrl_env(SCENARIO, num_games=1, reward=reward)
    for team, policy in experiment.group_policies.items():
        rl.save_policy(as_layers(policy.module[0].mlp), files[team], env)
    env.close()


def as_layers(network):
    """Return the layers of a `MultiAgentMLP` whose weights all agents share, as arrays for `save_policy`."""
    parts = [network.params[name] for name in sorted(network.params.keys(), key=int)]
    first, second, last = ((part["weight"].detach().numpy(), part["bias"].detach().numpy()) for part in parts)
    return [first, "tanh", second, "tanh", last]


if __name__ == "__main__":
    files = {team: Path(f"benchmarl_{team}.safetensors") for team in SCENARIO.spec.teams}
    train(files, iterations=int(sys.argv[1]) if len(sys.argv) > 1 else 40)
    print(compare(files["taggers"], files["runners"]))
