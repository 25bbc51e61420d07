"""Self-play with a slowly moving average: a runner and a guard learn a pursuit in which both move at once.

    python examples/rl/self_play.py             # learns for 20 s of CPU time
    python examples/rl/self_play.py --quick     # learns for a second

Whoever is predictable loses, so learning the best response to the other goes in circles. Here each learns against the
other as it is now, and a moving average of its own past attracts it: magnetic mirror descent (Sokota et al. 2023), with
a number for each state and action. The printed gap is exact: what both would gain by best responses; 0 in equilibrium.
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from gamms import rl
from gamms.scenario import Scenario
from gamms.solve import solve

NODES, TURNS, ITERATIONS, STARTS = 16, 6, 150, {"runner": 0, "guard": 15}
TAG = {"rule": "tag", "with": {"taggers": "guard", "tagged": "runner", "hops": 1, "then": "eliminate"}}
PURSUIT = Scenario(
    map={"grid": {"rows": 4, "columns": 4}},
    sensors={"eyes": {"type": "AGENT"}},
    teams={team: {"agents": [{"name": team, "node": node}], "sensors": ["eyes"]} for team, node in STARTS.items()},
    rules=[TAG, "last_team", {"rule": "time_limit", "with": {"turns": TURNS, "winner": "runner"}}],
)


def observe(view):
    """Turn, own node and other node, as a 1 in one of TURNS * NODES * NODES entries."""
    found, seen = np.zeros((*view.node.shape, TURNS * NODES * NODES), np.float32), view.enemies()
    state = (view.turn[seen.at] * NODES + view.node[seen.at, seen.viewers]) * NODES + seen.nodes
    found[seen.at, seen.viewers, np.minimum(state, found.shape[2] - 1)] = 1.0
    return found


def learn(env, logits, magnet, random, rate=1.0, pull=0.2, turns=2 * TURNS):
    """Return the logits after a step towards actions that win more often, and towards the magnet."""
    observed, states, actions, rewards, ends = env.reset()[0], [], [], [], []
    for _ in range(turns):
        states.append(observed["observation"].argmax(axis=1))
        scores = np.where(observed["action_mask"] > 0, logits[states[-1]], -np.inf)
        actions.append((scores + random.gumbel(size=scores.shape)).argmax(axis=1))
        observed, reward, ended, late, _ = env.step(actions[-1])
        rewards.append(reward)
        ends.append(ended | late)
    won = np.full((turns + 1, env.num_envs), np.nan)  # unknown in games that have not ended
    for turn in reversed(range(turns)):
        won[turn] = rewards[turn] + np.where(ends[turn], 0.0, won[turn + 1])
    known = np.isfinite(won[:-1])
    pairs = np.array(states)[known], np.array(actions)[known]
    wins, count = np.zeros((2, *logits.shape))
    np.add.at(wins, pairs, won[:-1][known])
    np.add.at(count, pairs, 1)
    mean = wins.sum(axis=1, keepdims=True) / np.maximum(count.sum(axis=1, keepdims=True), 1)
    gain = np.where(count > 0, wins / np.maximum(count, 1) - mean, 0.0)
    return (logits + rate * gain + rate * pull * magnet) / (1 + rate * pull)


def respond(view, logits):
    """Return how often the runner escapes: if it responds best to the guard, and if the guard does to it."""
    nodes, legal = np.arange(NODES), view.streets.legal
    is_legal = np.arange(legal.shape[1]) < view.streets.counts[:, None]
    is_near = view.routes(None).distances(nodes[:, None], nodes) <= 1
    chances = {
        team: np.exp(table).reshape(TURNS, NODES, NODES, -1) * is_legal[:, None] for team, table in logits.items()
    }
    shares = {team: found / found.sum(axis=3, keepdims=True) for team, found in chances.items()}
    most = least = np.ones((NODES, NODES))  # node of the runner, node of the guard
    for turn in reversed(range(TURNS)):
        after = [np.where(is_near, 0, one)[legal[:, None, :, None], legal[None, :, None]] for one in (most, least)]
        of_runner = np.einsum("abij,baj->abi", after[0], shares["guard"][turn])
        most = np.where(is_legal[:, None], of_runner, 0).max(axis=2)
        of_guard = np.einsum("abij,abi->abj", after[1], shares["runner"][turn])
        least = np.where(is_legal[None], of_guard, 1).min(axis=2)
    return most[*STARTS.values()], least[*STARTS.values()]


def play_itself(iterations=ITERATIONS, seed=1, num_games=64, slowness=20):
    """Let both learn; after each iteration yield how often the runner escapes the averages, see `respond`."""
    options = {"num_games": num_games, "seed": seed, "observation": observe, "reward": lambda turn: turn.won}
    envs = {team: rl.vector_env(PURSUIT, team=team, **options) for team in STARTS}
    random, size = np.random.default_rng(seed), envs["runner"].learners.num_actions
    logits = {team: np.zeros((TURNS * NODES * NODES, size)) for team in STARTS}
    average = dict(logits)
    with TemporaryDirectory() as folder:
        for _ in range(iterations):
            for team, other in (("runner", "guard"), ("guard", "runner")):
                file = Path(folder) / f"{other}.safetensors"
                rl.save_policy([(logits[other].T, np.zeros(size))], file, envs[other])
                envs[team].set_others({other: rl.policy(file, observation=observe, sample=True)})
                logits[team] = learn(envs[team], logits[team], average[team], random)
            average = {team: average[team] + (logits[team] - average[team]) / slowness for team in STARTS}
            yield respond(envs["runner"].learners.games.observe("runner"), average)


if __name__ == "__main__":
    exact = solve(PURSUIT, team="runner", reward="win").value / 2 + 0.5
    print(f"exact play: the runner escapes in {exact:.3f} of the games")
    total = 8 if "--quick" in sys.argv else ITERATIONS
    for number, (most, least) in enumerate(play_itself(total), 1):
        if number in (1, total) or number % 30 == 0:
            print(f"iteration {number}: {least:.3f} to {most:.3f} against best responses, a gap of {most - least:.3f}")
