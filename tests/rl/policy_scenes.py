"""A network as PyTorch has it, for tests that save policies."""

import numpy as np


class Values(np.ndarray):
    """Parameters as PyTorch has them."""

    def detach(self):
        return self

    cpu = numpy = detach


class Linear:
    def __init__(self, weight):
        self.weight, self.bias = weight.astype(np.float32).view(Values), None


class Sequential(list):
    def __init__(self, *layers):
        super().__init__(layers)


def failing_reward(turn):
    """Raise, as a reward of a user may."""
    raise ArithmeticError(f"no reward in turn {turn.after.turn[0]}")


def seen_so_far(view):
    """Observe the node of each agent and the largest node that it has been on."""
    kept = view.keep("largest", lambda games: {"node": np.zeros((games, len(view.roster.names)), np.int64)})["node"]
    where = np.ix_(view.games, view.agents)
    kept[where] = np.maximum(kept[where], view.node)
    return np.stack((view.node, kept[where]), axis=2)


def remembered(turn):
    """Pay for where agents have gone."""
    return turn.after.node - turn.before.node * 0.5
