"""TorchRL learns a game of two teams: PPO with masks, one network for each team, without agents that are out.

    python examples/rl/with_torchrl.py       # trains for a minute, then prints how often the taggers win

The game is in catch.py; docs/howto/torchrl.md explains the program.
"""

import sys
from pathlib import Path

import torch
from catch import SCENARIO, compare, reward
from tensordict import TensorDict
from tensordict.nn import TensorDictModule, TensorDictSequential
from torch import nn
from torchrl.envs.utils import check_env_specs
from torchrl.modules import MaskedCategorical, ProbabilisticActor, ValueOperator
from torchrl.objectives import ClipPPOLoss, ValueEstimators

from gamms import rl


def make_network(entries, outputs):
    """Return a network that all agents of a team share."""
    return nn.Sequential(nn.Linear(entries, 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh(), nn.Linear(64, outputs))


def make_learner(env, team):
    """Return the actor and the loss of a team, which is a group of the environment."""
    entries = env.observation_spec[team, "observation"].shape[-1]
    actor = ProbabilisticActor(
        TensorDictModule(make_network(entries, env.learners.num_actions), [(team, "observation")], [(team, "logits")]),
        in_keys={"logits": (team, "logits"), "mask": (team, "action_mask")},
        out_keys=[(team, "action")],
        distribution_class=MaskedCategorical,
        return_log_prob=True,
        log_prob_key=(team, "log_prob"),
    )
    critic = ValueOperator(make_network(entries, 1), [(team, "observation")], [(team, "state_value")])
    loss = ClipPPOLoss(actor, critic, entropy_coeff=0.01, normalize_advantage=True)
    keys = {"reward", "action", "done", "terminated", "advantage", "value_target"}
    loss.set_keys(value=(team, "state_value"), sample_log_prob=(team, "log_prob"), **{key: (team, key) for key in keys})
    loss.make_value_estimator(ValueEstimators.GAE, gamma=0.99, lmbda=0.95)
    return actor, loss


def select_alive(played, team):
    """Return the samples of agents that took part, as one batch: agents that are out must not be learned from."""
    return TensorDict({team: played[team][played[team, "mask"]]}).auto_batch_size_(1)


def train(files, iterations, num_games=256):
    """Train both teams at once, and save their policies."""
    torch.manual_seed(1)
    torch.set_num_threads(1)  # small networks are faster so
    env = rl.torchrl_env(SCENARIO, num_games=num_games, reward=reward)
    check_env_specs(env)
    learners = {team: make_learner(env, team) for team in env.group_map}
    policy = TensorDictSequential(*(actor for actor, _ in learners.values()))
    optimizers = {team: torch.optim.Adam(loss.parameters(), lr=1e-3) for team, (_, loss) in learners.items()}
    for iteration in range(iterations):
        with torch.no_grad():
            played = env.rollout(32, policy, break_when_any_done=False)
        for team, (_, loss) in learners.items():
            with torch.no_grad():
                loss.value_estimator(played, params=loss.critic_network_params)
            samples = select_alive(played, team)
            for _ in range(4):
                for rows in torch.randperm(len(samples)).split(2048):
                    found = loss(samples[rows])
                    optimizers[team].zero_grad()
                    (found["loss_objective"] + found["loss_critic"] + found["loss_entropy"]).backward()
                    nn.utils.clip_grad_norm_(loss.parameters(), 0.5)
                    optimizers[team].step()
        caught = played["next", "runners", "reward"].sum() / -num_games
        if iteration % 10 == 9:
            print(f"iteration {iteration + 1}: {caught:.2f} runners caught in 32 turns", flush=True)
    for team, (actor, _) in learners.items():
        rl.save_policy(actor.module[0].module, files[team], env)
    env.close()


if __name__ == "__main__":
    files = {team: Path(f"torchrl_{team}.safetensors") for team in SCENARIO.spec.teams}
    train(files, iterations=int(sys.argv[1]) if len(sys.argv) > 1 else 40)
    print(compare(files["taggers"], files["runners"]))
