"""A hunt of a few turns on a small grid, and strategies for it that worker processes can import."""

import os
import signal
import time
from pathlib import Path

from gamms.scenario import Scenario

HUNT = Scenario(
    name="Small hunt",
    max_turns=6,
    map={"grid": {"width": 4, "height": 4}},
    teams={
        "red": {"count": 2, "strategy": "gamms.strategies:random_walk"},
        "blue": {"count": 1, "strategy": "gamms.strategies:random_walk"},
    },
    rules=[{"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": "eliminate"}}, "last_team"],
)


def wait_here(state):
    state["action"] = state["curr_pos"]


def raise_at_times(state):
    if state["turn"] == 2 and state["draw"].random() < 0.8:
        raise ValueError("no way")
    state["action"] = state["curr_pos"]


def die_at_times(state):
    """Kill the process that plays, in some games."""
    if state["turn"] == 2 and state["draw"].random() < 0.6:
        os._exit(3)
    state["action"] = state["curr_pos"]


def linger(state):
    """While there is a gate in the working directory, begin slowly, and no game once three are over."""
    journal = Path("killed", "journal.jsonl")
    while state["turn"] == 0 and Path("gate").exists():
        time.sleep(0.02)
        if not journal.exists() or len(journal.read_bytes().splitlines()) < 3:
            break
    state["action"] = state["curr_pos"]


def be_killed_once(state):
    """Kill the process that plays as `kill -9` does, if there is a file, which is gone then."""
    once = Path(state["facts"]["once"])
    if state["turn"] == 2 and once.exists():
        once.unlink()
        os.kill(os.getpid(), signal.SIGKILL)
    state["action"] = state["curr_pos"]


def count_tags(result):
    return sum(event["kind"] == "tag" for event in result.events)
