"""Environments of games of many kinds, by the tests of PettingZoo and Gymnasium, and in many games as in one."""

import warnings

import pytest

pytest.importorskip("gymnasium", reason="Gymnasium is not installed")
pytest.importorskip("pettingzoo", reason="PettingZoo is not installed")

from gymnasium.utils.env_checker import check_env

with warnings.catch_warnings():
    warnings.simplefilter("ignore", DeprecationWarning)  # importing the tests of PettingZoo makes a game the old way
    from pettingzoo.test import parallel_api_test, parallel_seed_test

from gamms import rl
from gamms.scenario import Scenario

WALK = "gamms.strategies:random_walk"
TAG = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": "eliminate"}}
OWN = """
def arrest(ctx):
    for deed in ctx.game.performed("arrest"):
        ctx.game.eliminate(deed.values["whom"])
        ctx.game.scores[deed.team] += 1


def join(ctx):
    if ctx.game.turn == 3:
        ctx.agent.create_agent("red_late", start_node_id=0, team="red")
        ctx.agent.create_agent("red_later", start_node_id=0, team="red", strategy=stay)


def stay(state):
    state["action"] = state["curr_pos"]


def leave(ctx):
    if ctx.game.turn == 4:
        ctx.agent.delete_agent("red_0")


def defect(ctx):
    if ctx.game.turn == 2:
        ctx.agent.agents["blue_0"].team = "red"


def out_at_once(ctx):
    ctx.game.scores["red"] += 1
    for agent in [one for one in ctx.game.agents if one.team == "red"]:
        ctx.game.eliminate(agent.name)
"""
ARREST = {"rule": "own:arrest", "phase": "deeds"}
SPEEDS = {"red": {"count": 2, "speed": 13}, "blue": {"count": 1, "speed": 9, "strategy": WALK}}
AERIAL = {
    "red": {"count": 2, "type": "aerial", "speed": 7, "sensors": ["near"]},
    "blue": {"count": 2, "strategy": WALK},
}
GAMES = {
    "deeds, messages and agents that come back": {
        "rules": [ARREST, {"rule": "respawn", "with": {"after": 2}}, TAG],
        "settings": {"deeds": {"arrest": {"whom": "agent"}, "shout": None}},
        "channels": {"radio": {"range_m": 30.0, "loss": 0.2}},
    },
    "in the air": {
        "teams": AERIAL,
        "sensors": {"near": {"type": "AERIAL_AGENT", "sensor_range": 60, "detection": 0.5}},
        "rules": [{**TAG, "with": {**TAG["with"], "air": True, "euclid": 12.0}}],
    },
    "arrivals and conflicts": {
        "teams": SPEEDS,
        "settings": {"speed_unit": "metres", "decide": "arrival"},
        "conflicts": {"capacity": 1},
        "sensors": {},
    },
    "fifty agents": {
        "teams": {"red": {"count": 30, "sensors": ["near"]}, "blue": {"count": 20, "strategy": WALK}},
        "map": {"grid": {"width": 10, "height": 10}},
    },
    "one agent": {"teams": {"red": {"count": 1}}, "rules": [{"rule": "reach", "with": {"team": "red", "nodes": [15]}}]},
    "agents join": {"rules": [TAG, "own:join"]},
    "agents leave": {"rules": [TAG, "own:leave"]},
    "agents change teams": {"rules": [TAG, "own:defect"]},
    "out at once": {"rules": ["own:out_at_once"]},
    "sensors that report late": {"sensors": {"near": {"type": "AGENT_RANGE", "sensor_range": 30, "delay_turns": 2}}},
    "sensors that look ahead": {"sensors": {"near": {"type": "AGENT_ARC", "sensor_range": 30, "fov": 1.0}}},
    "an order of play with speeds": {
        "teams": {"red": {"count": 2, "speed": 1.5}, "blue": {"count": 2, "speed": 3, "strategy": WALK}},
        "settings": {"order": [["blue"], ["red"]]},
    },
    "one node": {"teams": {"red": {"count": 1}, "blue": {"count": 1}}, "map": {"grid": {"width": 1, "height": 1}}},
}


@pytest.fixture(params=GAMES)
def game(request, tmp_path):
    """Two taggers and two runners, or what a kind of game says instead."""
    (tmp_path / "own.py").write_text(OWN)
    near = {"near": {"type": "AGENT_RANGE", "sensor_range": 30}}
    teams = {"red": {"count": 2, "sensors": ["near"]}, "blue": {"count": 2, "strategy": WALK}}
    given = {
        "map": {"grid": {"width": 4, "height": 4}},
        "teams": teams,
        "sensors": near,
        "rules": [TAG],
        "max_turns": 8,
    }
    return Scenario(folder=tmp_path, **given | GAMES[request.param])


def test_checkers_find_no_fault(game, capsys):
    env = rl.parallel_env(game, team="red")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        parallel_api_test(env, num_cycles=4)
        parallel_seed_test(lambda: rl.parallel_env(game, team="red"), num_cycles=2)
        check_env(rl.single_agent_env(game, agent=env.possible_agents[0]), skip_render_check=True)
    assert "Passed" in capsys.readouterr().out
