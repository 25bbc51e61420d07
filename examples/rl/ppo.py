"""Two pursuers learn to catch an evader: independent PPO with shared weights, on a thousand games at once.

    python examples/rl/ppo.py                # trains, then plays 500 games that it has not seen against `chase`
    python examples/rl/ppo.py --record pursuit.ggr && gamms render pursuit.ggr pursuit.mp4

Both pursuers know what either has seen. They choose between legal nodes by a number for each, from what is known about
it: how far it is from there to the evader, and when the team was there last.
"""

import argparse
import time
from pathlib import Path

import numpy as np
import torch
from torch import nn
from torch.distributions import Categorical

from gamms import rl
from gamms.scenario import load

SCENARIO = Path(__file__).parent / "pursuit.yaml"
HELD_OUT = 1_000_000  # the first seed of games that no training run comes to
METRES, TURNS = 300.0, 50.0
GLOBALS, PER_ACTION = 5, 5


def observe(view):
    """What each pursuer knows, (games, agents, GLOBALS + actions * PER_ACTION)."""
    games, agents = view.node.shape
    streets, routes = view.streets, view.routes()
    kept = view.keep(
        "pursuit",
        lambda games: {
            "node": np.zeros(games, np.int64),
            "turn": np.full(games, -1),
            "visits": np.full((games, len(streets.counts)), -100, np.int32),
        },
    )
    seen = view.enemies()
    kept["node"][view.games[seen.at]], kept["turn"][view.games[seen.at]] = seen.nodes, view.turn[seen.at]
    kept["visits"][view.games[:, None], view.node] = view.turn[:, None]
    target, when, visits = (kept[name][view.games] for name in ("node", "turn", "visits"))
    is_known = (when >= 0)[:, None]
    legal = streets.legal[view.node]  # (games, agents, actions)
    everywhere = np.broadcast_to(target[:, None, None], legal.shape)
    ahead = np.where(is_known[..., None], routes.distances(legal, everywhere), 0.0)
    here = ahead[..., 0]
    age = np.where(is_known, view.turn[:, None] - when[:, None], TURNS)
    mate = here[:, ::-1] if agents > 1 else here
    of_agent = [is_known, np.minimum(age / TURNS, 1.0), here / METRES, mate / METRES, view.turn[:, None] / 150.0]
    spread = routes.distances(legal, np.broadcast_to(view.node[:, ::-1, None], legal.shape))
    of_action = np.stack(
        [
            np.arange(legal.shape[2]) < view.counts[..., None],
            (ahead - here[..., None]) / 60.0,
            ahead / METRES,
            spread / METRES,
            np.minimum((view.turn[:, None, None] - visits[np.arange(games)[:, None, None], legal]) / TURNS, 2.0),
        ],
        axis=3,
    )
    values = [np.broadcast_to(one, (games, agents))[..., None] for one in of_agent]
    return np.concatenate([*values, of_action.reshape(games, agents, -1)], axis=2, dtype=np.float32).clip(-5, 5)


def reward(turn):
    """One for a catch, a little for each metre nearer to an evader in sight, less a little for each turn."""
    earned = np.full(turn.after.node.shape, -0.01)
    earned += turn.gains.get("red", np.zeros(len(earned)))[:, None]
    seen, routes = turn.after.enemies(), turn.after.routes()
    before, now = (routes.distances(view.node[seen.at, seen.viewers], seen.nodes) for view in (turn.before, turn.after))
    earned[seen.at, seen.viewers] += 0.1 * (before - now) / METRES
    return earned


class Policy(nn.Module):
    """Gives each action a number, and each agent a value."""

    def __init__(self, actions, width=64):
        super().__init__()
        self.actions = actions
        self.score = nn.Sequential(
            nn.Linear(GLOBALS + PER_ACTION, width), nn.Tanh(), nn.Linear(width, width), nn.Tanh(), nn.Linear(width, 1)
        )
        self.value = nn.Sequential(
            nn.Linear(GLOBALS + PER_ACTION * actions, width),
            nn.Tanh(),
            nn.Linear(width, width),
            nn.Tanh(),
            nn.Linear(width, 1),
        )
        nn.init.orthogonal_(self.score[-1].weight, 0.01)  # at first, all actions are as likely

    def forward(self, observation, mask):
        """Return the distribution of actions, and the values."""
        own = observation[:, None, :GLOBALS].expand(-1, self.actions, -1)
        of_action = observation[:, GLOBALS:].reshape(len(observation), self.actions, PER_ACTION)
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


def train(scenario, seed, iterations, games=512, turns=32, epochs=3, batches=4):
    """Return a policy that was trained with one seed."""
    torch.manual_seed(seed)
    env = rl.vector_env(scenario, num_games=games, team="red", observation=observe, reward=reward, seed=seed * 1000)
    policy = Policy(env.single_action_space.n)
    optimiser = torch.optim.Adam(policy.parameters(), lr=5e-4, eps=1e-5)
    observed, _ = env.reset()
    began = time.perf_counter()
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
                f"seed {seed}, iteration {iteration + 1}: {caught / max(1, ended):.2f} of {ended // 2} games caught, "
                f"{time.perf_counter() - began:.0f} s",
                flush=True,
            )
    env.close()
    return policy


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


def evaluate(scenario, policy, games, file):
    """Return which of the held-out games are won, of a policy that takes its best actions; record the first."""
    env = rl.Learners(
        scenario, games, teams=["red"], observation=observe, reward=reward, seed=HELD_OUT, record=file is not None
    )
    with env:
        while not env.is_over.all():
            observation, mask = torch.from_numpy(env.observe()).flatten(0, 1), torch.from_numpy(env.masks).flatten(0, 1)
            with torch.no_grad():
                choice, _ = policy(observation, mask)
            env.step(choice.logits.argmax(dim=1).numpy().reshape(games, -1))
        if file is not None:
            env.games.record(0, file)
        return env.games.table()["winner"] == "red"


def main():
    """Train with several seeds, and compare with the scripted pursuers on games that were not trained with."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--iterations", type=int, default=60)
    options.add_argument("--seeds", type=int, default=5)
    options.add_argument("--games", type=int, default=512, help="that are trained in at once")
    options.add_argument("--held-out", type=int, default=500, help="games to compare in")
    options.add_argument("--record", metavar="FILE", help="a recording of a game of the last policy")
    given = options.parse_args()
    torch.set_num_threads(1)  # small networks are faster so, and the same seed gives the same policy
    scenario = load(SCENARIO, allow=["crop"])
    with scenario.batch(given.held_out, seed=HELD_OUT) as games:
        games.run()
        scripted = games.table()["winner"] == "red"
    print(f"chase: {scripted.mean():.3f} of {given.held_out} evaders caught")
    found = []
    for seed in range(1, given.seeds + 1):
        policy = train(scenario, seed, given.iterations, given.games)
        found.append(evaluate(scenario, policy, given.held_out, given.record))
        print(f"seed {seed}: {found[-1].mean():.3f} of {given.held_out} evaders caught")
    better = np.array(found, float) - scripted  # (seeds, games)
    low, high = interval(better)
    print(f"more than chase: interquartile mean {iqm(better.mean(axis=1)):.3f}, 95 % interval {low:.3f} to {high:.3f}")


def interval(better, draws=2000):
    """Return the 95 % bootstrap interval of the interquartile mean over seeds and games (Agarwal et al. 2021)."""
    random, (seeds, games) = np.random.default_rng(0), better.shape
    means = []
    for _ in range(draws):
        chosen = better[random.integers(seeds, size=seeds)][:, random.integers(games, size=games)]
        means.append(iqm(chosen.mean(axis=1)))
    return np.quantile(means, [0.025, 0.975])


def iqm(values):
    """Return the mean of the middle half."""
    ordered = np.sort(values)
    cut = len(ordered) // 4
    return ordered[cut : len(ordered) - cut].mean()


if __name__ == "__main__":
    main()
