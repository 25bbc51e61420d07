"""Two pursuers learn to catch an evader: independent PPO with shared weights, on a thousand games at once.

    python examples/rl/ppo.py                # trains, then plays 500 games that it has not seen against `chase`
    python examples/rl/ppo.py --record pursuit.ggr && gamms render pursuit.ggr pursuit.mp4

Both pursuers know what either has seen (pursuit.py). They choose between legal nodes by a number for each, from what is
known about it: how far it is from there to the evader, and when the team was there last.
"""

import time

import torch
from pursuit import GLOBALS, SCENARIO, compare, observe, options_of, reward
from torch import nn
from torch.distributions import Categorical

from gamms import rl


class Policy(nn.Module):
    """Gives each action a number, and each agent a value.

    The first `shared` entries of an observation are about the agent, the others about each action.
    """

    def __init__(self, entries, actions, shared, width=64):
        super().__init__()
        self.actions, self.shared = actions, shared
        own = shared + (entries - shared) // actions
        self.score = nn.Sequential(
            nn.Linear(own, width), nn.Tanh(), nn.Linear(width, width), nn.Tanh(), nn.Linear(width, 1)
        )
        self.value = nn.Sequential(
            nn.Linear(entries, width),
            nn.Tanh(),
            nn.Linear(width, width),
            nn.Tanh(),
            nn.Linear(width, 1),
        )
        nn.init.orthogonal_(self.score[-1].weight, 0.01)  # at first, all actions are as likely

    def forward(self, observation, mask):
        """Return the distribution of actions, and the values."""
        own = observation[:, None, : self.shared].expand(-1, self.actions, -1)
        of_action = observation[:, self.shared :].reshape(len(observation), self.actions, -1)
        scores = self.score(torch.cat((own, of_action), dim=2))[..., 0]
        return Categorical(logits=scores.masked_fill(~mask, -1e9)), self.value(observation)[:, 0]


def tensors(observed):
    """What a policy takes, of what an environment gives."""
    return torch.from_numpy(observed["observation"]), torch.from_numpy(observed["action_mask"]).bool()


def advantages(rewards, values, ends, last, gamma=0.99, lam=0.95):
    """Generalised advantage estimation (Schulman et al. 2016), (turns, slots)."""
    found, running = torch.zeros_like(rewards), torch.zeros_like(last)
    for turn in reversed(range(len(rewards))):
        following = last if turn == len(rewards) - 1 else values[turn + 1]
        goes_on = 1.0 - ends[turn]
        running = rewards[turn] + gamma * following * goes_on - values[turn] + gamma * lam * goes_on * running
        found[turn] = running
    return found


def train(env, file, seed, iterations, shared=GLOBALS, turns=32, epochs=3, batches=4):
    """Train a policy with one seed, save what gives its actions numbers, and close the environment.

    Return the share of games caught in each iteration.
    """
    torch.manual_seed(seed)
    torch.set_num_threads(1)  # small networks are faster so, and the same seed gives the same policy
    policy = Policy(*env.single_observation_space["observation"].shape, env.single_action_space.n, shared)
    optimiser = torch.optim.Adam(policy.parameters(), lr=5e-4, eps=1e-5)
    observed, _ = env.reset()
    began = time.perf_counter()
    shares = []
    for iteration in range(iterations):
        kept, caught, ended = [], 0, 0
        for _ in range(turns):
            observation, mask = tensors(observed)
            with torch.no_grad():
                choice, value = policy(observation, mask)
                action = choice.sample()
            observed, rewards, terminated, truncated, _ = env.step(action.numpy())
            ends = terminated | truncated
            caught, ended = caught + int(terminated.sum()), ended + int(ends.sum())
            kept.append(
                (
                    observation,
                    mask,
                    action,
                    choice.log_prob(action),
                    value,
                    torch.tensor(rewards).float(),
                    torch.tensor(ends).float(),
                )
            )
        shares.append(caught / max(1, ended))
        observations, masks, actions, logs, values, rewards, ends = (
            torch.stack(column) for column in zip(*kept, strict=True)
        )
        with torch.no_grad():
            last = policy(*tensors(observed))[1]
        gains = advantages(rewards, values, ends, last)
        flat = [one.flatten(0, 1) for one in (observations, masks, actions, logs, gains, gains + values)]
        for _ in range(epochs):
            for rows in torch.randperm(len(flat[0])).chunk(batches):
                learn(policy, optimiser, *(one[rows] for one in flat))
        if iteration % 10 == 9 or iteration == iterations - 1:
            print(
                f"seed {seed}, iteration {iteration + 1}: {shares[-1]:.2f} of {ended // 2} games caught, "
                f"{time.perf_counter() - began:.0f} s",
                flush=True,
            )
    rl.save_policy(policy.score, file, env, shared=shared)
    env.close()
    return shares


def learn(policy, optimiser, observations, masks, actions, logs, gains, returns):
    """Do one step of PPO (Schulman et al. 2017) on some samples."""
    choice, value = policy(observations, masks)
    gains = (gains - gains.mean()) / (gains.std() + 1e-8)
    ratio = (choice.log_prob(actions) - logs).exp()
    surrogate = torch.minimum(ratio * gains, ratio.clamp(0.8, 1.2) * gains).mean()
    loss = -surrogate + 0.5 * (value - returns).pow(2).mean() - 0.02 * choice.entropy().mean()
    optimiser.zero_grad()
    loss.backward()
    nn.utils.clip_grad_norm_(policy.parameters(), 0.5)
    optimiser.step()


if __name__ == "__main__":
    given = options_of(__doc__, iterations=60, games=512)
    learner = {"num_games": given.games, "team": "red", "observation": observe, "reward": reward}

    def train_one(seed, file):
        train(rl.vector_env(SCENARIO, seed=seed, **learner), file, seed, given.iterations)

    compare(train_one, given)
