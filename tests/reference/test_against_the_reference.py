"""Law: the library plays random games as the reference does, which is the specification.

Each agent sees the same, and after each turn everybody is at the same place; paths, scores, events, facts and ends are
the same.
"""

import logging

import pytest

from reference.games import plain, scenario_of, wander
from reference.simulator import Game


@pytest.fixture(autouse=True)
def no_messages():
    """Say nothing of actions that are not legal."""
    logging.getLogger("gamms").setLevel(logging.CRITICAL)


def seen_by(seen):
    """Return a strategy that notes what agents know and want."""

    def strategy(state):
        wander(state)
        known = {key: plain(state[key]) for key in ("curr_pos", "legal", "facts", "action")}
        seen.append({"name": state["name"], "is_blocked": state["blocked"] is not None, **known})

    return strategy


def without_pauses(path):
    """Return a path without nodes that are the same as the one before."""
    return [node for i, node in enumerate(path) if i == 0 or node != path[i - 1]]


def engine_after_turn(ctx):
    """Return what can be seen of a game of the library after a turn."""
    game = ctx.game
    return {
        "nodes": {agent.name: agent.current_node_id for agent in game.agents},
        "paths": {name: without_pauses(move.path) for name, move in game.moves.items()},
        "scores": {name: score for name, score in game.scores.items() if score},
        "facts": plain(game.facts),
        "events": [dict(event) for event in game.events],
        "over": game.over,
    }


def reference_after_turn(game, movers):
    """Return what can be seen of a game of the reference after a turn in which these agents moved."""
    return {
        "nodes": {agent.name: agent.node for agent in game.living()},
        "paths": {name: without_pauses(game.agents[name].path) for name in movers},
        "scores": {name: score for name, score in game.scores.items() if score},
        "facts": plain(game.facts),
        "events": game.events,
        "over": game.over,
    }


def check_game(number):
    """Play a random game by the library and by the reference, and compare them turn by turn."""
    scenario = scenario_of(number)
    seen, wanted = [], []
    teams = scenario.to_dict()["teams"]
    game = Game(scenario, strategies=dict.fromkeys(teams, seen_by(wanted)))
    with scenario.build(strategies=dict.fromkeys(teams, seen_by(seen))) as ctx:
        while game.over is None and game.turn < game.max_turns:
            movers = [agent.name for agent in game.living()]
            ctx.game.step()
            game.step()
            assert seen == wanted, f"game {number}, turn {game.turn}"
            assert engine_after_turn(ctx) == reference_after_turn(game, movers), f"game {number}, turn {game.turn}"
        rows = ctx.game.result().agents
        for name, agent in game.agents.items():
            counts = {"moves": agent.moves, "blocked": agent.blocks, "illegal": agent.illegal}
            assert {key: rows[name][key] for key in counts} == counts, f"game {number}, {name}"


@pytest.mark.parametrize("part", range(8))
def test_games_are_those_of_the_reference(part):
    for number in range(part, 800, 8):
        check_game(number)
