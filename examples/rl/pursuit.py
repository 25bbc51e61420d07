"""The pursuit that is learned: what the pursuers observe and get, and how well they do in games of other seeds."""

import argparse
import time
from pathlib import Path

import numpy as np

from gamms import rl
from gamms.scenario import load

SCENARIO = load(Path(__file__).parent / "pursuit.yaml", allow=["crop"])
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


def caught(games, pursuers=None, record=None):
    """Return which of the first games, which no training plays, the pursuers win; record the first one."""
    with SCENARIO.batch(games, strategies=pursuers and {"red": pursuers}) as batch:
        batch.run()
        if record is not None:
            batch.record(0, record)
        return batch.table()["winner"] == "red"


def compare(train, options):
    """Train with several seeds, and print how much better the pursuers are than `chase`, with its interval.

    `train` takes a seed and the path of a file, and writes a policy into it.
    """
    scripted = caught(options.held_out)
    print(f"chase: {scripted.mean():.3f} of {options.held_out} evaders caught")
    found = []
    for seed in range(1, options.seeds + 1):
        file = Path(options.out) / f"pursuers_{seed}.safetensors"
        began = time.process_time()
        train(seed, file)
        spent = time.process_time() - began
        found.append(caught(options.held_out, rl.policy(file, observation=observe), options.record))
        print(f"seed {seed}: {found[-1].mean():.3f} of {options.held_out} evaders caught, {spent:.0f} s of one core")
    better = np.array(found, float) - scripted  # (seeds, games)
    low, high = interval(better)
    print(f"more than chase: interquartile mean {iqm(better.mean(axis=1)):.3f}, 95 % interval {low:.3f} to {high:.3f}")


def options_of(description, iterations, games):
    """Return the options of the command line of an example."""
    options = argparse.ArgumentParser(description=description.splitlines()[0])
    options.add_argument("--iterations", type=int, default=iterations)
    options.add_argument("--seeds", type=int, default=5)
    options.add_argument("--games", type=int, default=games, help="that are trained in at once")
    options.add_argument("--held-out", type=int, default=500, help="games to compare in")
    options.add_argument("--out", default=".", metavar="FOLDER", help="for the policies")
    options.add_argument("--record", metavar="FILE", help="a recording of a game of the last policy")
    return options.parse_args()


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
