"""The game that other libraries learn in with_*.py: two taggers, two runners, and both teams learn."""

import numpy as np

from gamms import rl
from gamms.scenario import Scenario
from gamms.strategies import random_walk

SCENARIO = Scenario(
    map={"grid": {"rows": 6, "columns": 6}},
    sensors={"eyes": {"type": "AGENT"}},
    teams={
        "taggers": {"count": 2, "sensors": ["eyes"]},
        "runners": {"count": 2, "sensors": ["eyes"], "from": {"team": "taggers", "at_least": 20}},
    },
    rules=[
        {"rule": "tag", "with": {"taggers": "taggers", "tagged": "runners", "then": "eliminate", "score": 1}},
        "last_team",
        {"rule": "time_limit", "with": {"turns": 30, "winner": "runners"}},
    ],
)


def reward(turn):
    """Pay taggers 1 for a catch; a runner loses 1 when it is caught. A turn costs taggers a little."""
    if turn.team == "taggers":
        return turn.gains["taggers"][:, None] - [[0.02, 0.02]]
    return -(turn.before.mask & ~turn.after.mask).astype(np.float32)


def compare(taggers, runners, games=200):
    """Play trained policies, given as files, and random walks against each other in games of other seeds."""
    strategies = {"random walk": random_walk, "trained": rl.policy(taggers, sample=True)}
    opponents = {"random walk": random_walk, "trained": rl.policy(runners, sample=True)}
    return rl.evaluate(SCENARIO, strategies, team="taggers", opponents=opponents, games=games)
