"""Environments in the hands of Gymnasium: how it makes vectors of them, wraps them, and counts episodes."""

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium", reason="Gymnasium is not installed")

from gamms import rl

__all__ = ["rl"]  # its import registers the environments


@pytest.mark.parametrize("mode", ["sync", "async", "vector_entry_point"])
def test_gymnasium_makes_the_same_games_in_every_mode(mode):
    games = gymnasium.make_vec("gamms/GridTag-v0", num_envs=2, vectorization_mode=mode, agent="red_1")
    found = [games.reset(seed=4)[0], *(games.step(np.array([k % 3, 1]))[0] for k in range(4))]
    games.close()
    alone = gymnasium.make("gamms/GridTag-v0", agent="red_1")
    for slot in range(2):
        expected = [alone.reset(seed=4 + slot)[0], *(alone.step((k % 3, 1)[slot])[0] for k in range(4))]
        for one, other in zip(found, expected, strict=True):
            assert all(np.array_equal(one[key][slot], other[key]) for key in other)
    alone.close()
