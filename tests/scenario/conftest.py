"""A scenario to change, in a folder of its own."""

import copy

import pytest
import yaml

from gamms import scenario

LITTLE = {
    "name": "little",
    "seed": 3,
    "max_turns": 15,
    "map": {"grid": {"width": 8, "height": 6, "spacing": 10}},
    "sensors": {"near": {"type": "NEIGHBOR"}, "eyes": {"type": "AGENT_RANGE", "sensor_range": 30}},
    "teams": {
        "red": {
            "count": 3,
            "near": 0,
            "within": 30,
            "sensors": ["near", "eyes"],
            "strategy": "players:wander",
            "meta": {"speedy": True},
        },
        "blue": {
            "agents": [
                {"name": "anna", "node": 47, "sensors": ["eyes"], "strategy": "gamms.strategies:chase"},
                {"name": "bert", "node": [70, 40]},
            ],
            "sensors": ["near"],
            "strategy": {"function": "gamms.strategies:patrol", "with": {"nodes": [47, 40]}},
        },
    },
    "rules": [
        {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "hops": 1}},
        {"rule": "referee:count_turns", "with": {"step": 2}},
    ],
    "conflicts": {"capacity": 1, "resolve": {"by_priority": ["red", "blue"]}},
    "facts": {"bases": {"red": 0, "blue": 47}},
}
PLAYERS = """
import random
from .paces import pace

def wander(state):
    legal = state["legal"] if pace(state) else state["legal"][:1]
    state["action"] = legal[int(state["rng"].integers(len(legal)))]

def by_global_chance(state):
    state["action"] = random.choice(state["legal"])

def make(ctx, node):
    def go(state):
        state["action"] = node
    return go

def spread(states, step=1):
    for state in states.values():
        legal = state["legal"]
        state["action"] = legal[step * state["draw"].below(len(legal)) % len(legal)]

def walk(arrays):
    import numpy
    return arrays.targets[arrays.offsets[:-1] + arrays.draw.below(numpy.diff(arrays.offsets))]

def planned(ctx, node):
    drawn = ctx.stream("planned").integers(100)
    async def plan(states):
        for state in states.values():
            state["action"] = state["legal"][(node + drawn) % len(state["legal"])]
    return plan

def map_strategy(agent_config):
    assert all(config["meta"]["team"] == config["team"] for config in agent_config.values())
    return dict.fromkeys(agent_config, by_global_chance)
"""
REFEREE = """
def count_turns(ctx, step=1):
    ctx.game.scores["turns"] += step

def explode():
    raise RuntimeError("boom")
"""


@pytest.fixture
def little():
    """The keys of a scenario that can be changed."""
    return copy.deepcopy(LITTLE)


@pytest.fixture
def folder(tmp_path):
    """A folder with the code of the little scenario and its file, `little.yaml`."""
    folder = tmp_path / "games"
    folder.mkdir()
    (folder / "players.py").write_text(PLAYERS)
    (folder / "paces.py").write_text("def pace(state):\n    return state['turn'] % 3 < 2\n")
    (folder / "referee.py").write_text(REFEREE)
    (folder / "little.yaml").write_text(yaml.safe_dump(LITTLE, sort_keys=False))
    return folder


@pytest.fixture
def made(little, folder):
    """Makes the little scenario with some of its values changed, by dotted paths."""

    def make(changes=None, **sections):
        given = {**copy.deepcopy(little), **sections}
        for path, value in (changes or {}).items():
            *way, last = path.split(".")
            here = given
            for part in way:
                here = here[int(part) if isinstance(here, list) else part]
            here[int(last) if isinstance(here, list) else last] = value
        return scenario.Scenario(folder=folder, **given)

    return make
