"""Populations of a pursuit in which both teams move at once: the gap after each round, measured exactly.

    python benchmarks/populations.py                            # all; needs PyTorch
    python benchmarks/populations.py --games grid --methods "exact nash" "learn nash"

One pursuer and one evader on a board of 4 x 4, who see each other; a point for a catch. Both populations begin with
`stay`. In each round both teams add a response to a mixture of the other one's strategies: the exact one, or one that
`rl.ppo_learner` has learned. The interval is that of exact responses to the mixtures of all strategies so far, by
`gamms.solve`; it contains the value of the game, and its width is the gap.
"""

import argparse
from functools import partial

import networkx as nx
import numpy as np

from gamms import array_strategy, rl, solve
from gamms.scenario import Scenario


@array_strategy
def stay(view):
    """Stay; as an array strategy, so that a pool with policies is called once for all games."""
    return np.zeros(view.node.shape, np.int64)


METHODS = ("exact nash", "exact uniform", "learn nash", "learn uniform", "learn last")
GAMES = {"grid": (4, 0, 5), "diagonals": (3, 0, 10)}  # turns, and the nodes at which both start
ROUNDS = 8
STEPS = 16_384  # of the training of a response


def king(side):
    """A board with edges to all eight neighbors."""
    graph = nx.strong_product(nx.path_graph(side), nx.path_graph(side))
    for row, column in graph:
        graph.add_node((row, column), x=float(column), y=float(row))
    return nx.convert_node_labels_to_integers(graph, ordering="sorted")


def chased(name):
    """The game of a name."""
    turns, pursuer, evader = GAMES[name]
    board = {"grid": {"rows": 4, "columns": 4}}
    return Scenario(
        map=board if name == "grid" else {"generator": {"function": "populations:king", "with": {"side": 4}}},
        folder=__file__.rpartition("/")[0],
        max_turns=turns,
        sensors={"eyes": {"type": "AGENT"}},
        teams={
            "red": {"agents": [{"name": "pursuer", "node": pursuer}], "sensors": ["eyes"]},
            "blue": {"agents": [{"name": "evader", "node": evader}], "sensors": ["eyes"]},
        },
        rules=[
            {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "score": 1, "then": "eliminate"}},
            "last_team",
        ],
    )


def measure(game, method, seed):
    """Yield the interval of exact responses after 0, 1, 2 and more rounds."""
    by, to = method.split()
    learner = partial(rl.ppo_learner, steps=STEPS, seed=seed)
    both = {"red": [stay], "blue": [stay]}
    population = rl.Population(game, both, exact=solve.best_response, learner=learner, games=1, seed=seed)
    for number in range(ROUNDS + 1):
        yield population.interval(to=to)
        if number < ROUNDS:
            for team, found in [(team, population.responses(team, by, to)) for team in population.teams]:
                population.add(team, found)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--games", nargs="+", choices=GAMES, default=list(GAMES))
    parser.add_argument("--methods", nargs="+", choices=METHODS, default=METHODS)
    parser.add_argument("--seeds", nargs="+", type=int, default=[1, 2, 3])
    options = parser.parse_args()
    for name in options.games:
        value = solve.solve(chased(name)).value
        for method in options.methods:
            for seed in options.seeds[:1] if method.startswith("exact") else options.seeds:  # those draw nothing
                found = list(measure(chased(name), method, seed))
                assert all(low - 1e-9 <= value <= high + 1e-9 for low, high in found)
                gaps = " ".join(f"{high - low:.3f}" for low, high in found)
                print(f"{name}, value {value:.3f}, {method}, seed {seed}, gaps: {gaps}", flush=True)
