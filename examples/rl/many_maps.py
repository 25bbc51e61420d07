"""One policy for many maps: pursuers learn in twelve districts of Helsinki, and play in six that they have not seen.

python examples/rl/many_maps.py          # trains for a minute, then prints how often who wins, with intervals
"""

from pathlib import Path

import numpy as np
from ppo import train

from gamms import rl
from gamms.scenario import Scenario
from gamms.solve import exact_evader, exact_pursuers
from gamms.strategies import chase, flee, random_walk

DISTRICTS = [{"generator": {"function": "crop:district", "with": {"number": number}}} for number in range(18)]
PURSUIT = Scenario(
    map=DISTRICTS[0],
    folder=Path(__file__).parent,
    sensors={"eyes": {"type": "AGENT"}},
    teams={"red": {"count": 2, "sensors": ["eyes"]}, "blue": {"count": 1, "sensors": ["eyes"]}},
    settings={"order": [["red"], ["blue"]]},
    rules=[{"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": "eliminate"}}, "last_team"],
    max_turns=40,
)


def observe(view):
    """The turn; and for each move: is it legal, how far are evader and mate, how much does the evader reach first?"""
    seen, roads, mate = view.enemies(), view.routes(None), view.node[:, ::-1, None]
    nodes = np.arange(len(view.streets.counts))
    legal, is_legal = view.legal_rows()
    evader = np.zeros((len(legal), 1, 1), np.int64)
    evader[seen.at, 0, 0] = seen.nodes
    ours = np.minimum(roads.distances(legal[..., None], nodes), roads.distances(mate[..., None], nodes))
    free = (roads.distances(evader[..., None], nodes) < ours).mean(axis=3)
    moves = [is_legal, roads.distances(legal, evader) / 10, roads.distances(legal, mate) / 10, free]
    found = np.zeros((*view.node.shape, view.num_actions, len(moves)), np.float32)
    found[:, :, : legal.shape[2]] = np.stack(moves, axis=3)
    turn = np.broadcast_to(view.turn[:, None, None] / 40, (*view.node.shape, 1))
    return np.concatenate([turn, found.reshape(*view.node.shape, -1)], axis=2, dtype=np.float32)


def learn(file, seed=1, iterations=40, num_games=256):
    """Train a policy on some maps, and save it; return the share of games won in each iteration."""
    others = {"blue": rl.opponents({"flee": flee, "walk": random_walk}, weights=[3, 1])}
    learner = {"team": "red", "observation": observe, "reward": lambda turn: turn.gains["red"][:, None] - [[0.03] * 2]}
    env = rl.vector_env(PURSUIT, num_games=num_games, others=others, maps=DISTRICTS[:12], seed=seed, **learner)
    return train(env, file, seed, iterations, shared=1)


def compare(file, games=100):
    """Evaluate a policy on maps that it has not seen."""
    strategies = {"chase": chase, "policy": rl.policy(file, observation=observe)}
    new = {"maps": DISTRICTS[12:], "games": games, "exact": exact_pursuers}
    return rl.evaluate(PURSUIT, strategies, team="red", opponents={"flee": flee, "exact": exact_evader}, **new)


if __name__ == "__main__":
    print(learn("many_maps.safetensors"), compare("many_maps.safetensors"), sep="\n")
