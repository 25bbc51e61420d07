"""Agents are observed as vectors of numbers, which say what their states say."""

import numpy as np
import pytest
from batch_scenes import scene

import gamms
from gamms.errors import TooLarge

NEAR = {"near": {"type": "AGENT_RANGE", "sensor_range": 25.0}}
WALKS = {"count": 3, "strategy": "gamms.strategies:random_walk", "sensors": ["near"]}
TEAMS = {"red": WALKS, "blue": WALKS}
TAG = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": "eliminate"}}


@pytest.mark.parametrize("others", [10**8, 10**15])
def test_vectors_that_do_not_fit_into_memory_are_refused(others):
    with scene().batch(2) as games, pytest.raises(TooLarge, match=f"ectors of {others} others would take about"):
        games.observe("red").vector(others=others)


@gamms.array_strategy
def away(view):
    """Go away from the nearest agent that is seen."""
    found = view.vector(others=1)
    values = dict(zip(found.names, np.moveaxis(found.values, -1, 0), strict=True))
    actions = range(found.legal.shape[-1])
    gained = np.stack([-values["other_0.dx"] * values[f"action_{k}.dx"] for k in actions], axis=-1)
    return np.where(found.legal, gained, -np.inf).argmax(axis=-1)


def test_a_strategy_of_vectors_plays_the_same_alone_and_in_batches(same_as_one_by_one):
    same_as_one_by_one(scene([TAG], teams=TEAMS, sensors=NEAR), [1, 2, 3], {"red": away})
