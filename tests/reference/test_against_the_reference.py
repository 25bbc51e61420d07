"""Law: the library plays random games as the reference does, which is the specification.

Each agent sees the same, and after each turn everybody is at the same place; paths, scores, events, facts and ends are
the same.
"""

import logging
import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from plain_game.simulator import Game
from random_scenarios import plain, scenario_of, wander

import gamms


@pytest.fixture(autouse=True)
def no_messages():
    """Say nothing of actions that are not legal."""
    logging.getLogger("gamms").setLevel(logging.CRITICAL)


def seen_by(seen):
    """Return a strategy that notes what agents know and want."""

    def strategy(state):
        wander(state)
        keys = ("curr_pos", "offset_m", "legal", "inbox", "outbox", "action")
        known = {key: plain(state[key]) for key in keys if key in state}
        seen.append({"name": state["name"], "is_blocked": state["blocked"] is not None, **known})

    return strategy


def without_pauses(path):
    """Return a path without nodes that are the same as the one before."""
    return [node for i, node in enumerate(path) if i == 0 or node != path[i - 1]]


def place_of(agent):
    """Return where an agent of the library is: the node passed last, the next one if between two, and the metres."""
    if agent.edge is None:
        return agent.current_node_id, None, 0.0
    return agent.current_node_id, *(end for end in agent.edge[:2] if end != agent.current_node_id), agent.offset_m


def reference_place_of(game, agent):
    """Return the same of an agent of the reference."""
    if game.node_of(agent) is not None:
        return agent.node, None, 0.0
    return agent.node, agent.target, float(agent.offset)


def engine_after_turn(ctx):
    """Return what can be seen of a game of the library after a turn."""
    game = ctx.game
    return {
        "places": {agent.name: place_of(agent) for agent in game.agents},
        "paths": {name: without_pauses(move.path) for name, move in game.moves.items()},
        "scores": {name: score for name, score in game.scores.items() if score},
        "facts": plain(game.facts),
        "events": [dict(event) for event in game.events],
        "messages": [{key: value for key, value in one.items() if key != "size"} for one in game.messages],
        "over": game.over,
    }


def reference_after_turn(game, movers):
    """Return what can be seen of a game of the reference after a turn in which these agents moved."""
    return {
        "places": {agent.name: reference_place_of(game, agent) for agent in game.living()},
        "paths": {name: without_pauses(game.agents[name].path) for name in movers},
        "scores": {name: score for name, score in game.scores.items() if score},
        "facts": plain(game.facts),
        "events": game.events,
        "messages": game.messages,
        "over": game.over,
    }


def check_game(number):
    """Play a random game by the library and by the reference, and compare them turn by turn."""
    scenario = scenario_of(number)
    seen = []
    wanted = []
    teams = scenario.to_dict()["teams"]
    game = Game(scenario, strategies=dict.fromkeys(teams, seen_by(wanted)))
    with scenario.build(strategies=dict.fromkeys(teams, seen_by(seen))) as ctx:
        while game.over is None and game.turn < game.max_turns:
            movers = [agent.name for agent in game.living()]
            ctx.game.step()
            game.step()
            assert seen == wanted, f"game {number}, turn {game.turn}"
            seen.clear()
            wanted.clear()
            assert engine_after_turn(ctx) == reference_after_turn(game, movers), f"game {number}, turn {game.turn}"
        rows = ctx.game.result().agents
        for name, agent in game.agents.items():
            counts = {"moves": agent.moves, "blocked": agent.blocks, "illegal": agent.illegal}
            assert {key: rows[name][key] for key in counts} == counts, f"game {number}, {name}"


@pytest.mark.parametrize("part", range(8))
def test_games_are_those_of_the_reference(part):
    for number in range(part, 200, 8):
        check_game(number)


@given(st.integers(1_000_000, 1_000_000_000))
def test_any_game_is_that_of_the_reference(number):
    check_game(number)


@pytest.mark.skipif(os.environ.get("GAMMS_ALL_PLAYS") != "1", reason="takes a minute")
def test_many_more_games_are_those_of_the_reference():
    for number in range(100_000, 103_000):
        check_game(number)


@pytest.mark.parametrize("number", range(200_000, 200_010))
def test_games_of_batches_are_those_of_the_reference(number):
    scenario = scenario_of(number)
    strategies = dict.fromkeys(scenario.to_dict()["teams"], wander)
    seeds = range(number, number + 20)  # of fewer games a batch plays them one by one
    with scenario.batch(seeds=seeds, strategies=strategies) as games:
        games.run()
        for i, seed in enumerate(seeds):
            result = games.result(i)
            game = Game(scenario, seed=seed, strategies=strategies)
            game.run()
            assert result.turns == game.turn
            assert [dict(event) for event in result.events] == game.events
            assert {name: score for name, score in result.scores.items() if score} == game.scores
            assert [{key: one[key] for key in one if key != "size"} for one in result.messages] == game.messages
            rows = {
                name: [row[key] for key in ("node", "alive", "moves", "illegal")] for name, row in result.agents.items()
            }
            assert rows == {
                agent.name: [agent.node, agent.alive, agent.moves, agent.illegal] for agent in game.agents.values()
            }
            if game.over is not None:
                assert {key: getattr(result, key) for key in game.over} == game.over


@pytest.mark.parametrize("name", ["grid_tag", "pursuit"])
def test_scenarios_of_the_gallery_can_be_played_by_the_reference(name):
    scenario = gamms.scenario.load(Path(gamms.__file__).parent / "data" / "gallery" / f"{name}.yaml")
    walks = dict.fromkeys(scenario.to_dict()["teams"], gamms.strategies.random_walk)
    for seed in range(3):
        result = scenario.play(seed=seed, strategies=walks)
        game = Game(scenario, seed=seed, strategies=walks)
        game.run()
        assert [dict(event) for event in result.events] == game.events
        assert {key: getattr(result, key) for key in game.over} == game.over


def test_a_walk_that_a_scenario_names_is_played_by_the_reference():
    walks = gamms.scenario.Scenario(
        max_turns=20,
        map={"grid": {"width": 3, "height": 3}},
        teams={team: {"count": 2, "strategy": "gamms.strategies:random_walk"} for team in ("red", "blue")},
        rules=[{"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}}],
    )
    for seed in range(5):
        game = Game(walks, seed=seed)
        game.run()
        result = walks.play(seed=seed)
        assert game.events
        assert (result.scores, [dict(event) for event in result.events]) == (game.scores, game.events)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"conflicts": {"edge_capacity": 1}}, "edge_capacity"),
        ({"conflicts": {"capacity": "room"}}, "room"),
        ({"settings": {"legal": "any"}}, "legal"),
        ({"settings": {"on_illegal": "stay", "speed_unit": "metres_per_second"}}, "metres_per_second"),
        ({"teams.red.type": "aerial", "teams.red.speed": 1}, "type"),
        ({"teams.red.strategy": "gamms.strategies:chase"}, "chase"),
        ({"rules": [{"rule": "resource", "with": {"name": "fuel", "start": 1}}]}, "resource"),
        ({"rules": [{"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "air": True}}]}, "air"),
        ({"channels": {"radio": {"range_m": 5, "line_of_sight": True}}}, "line_of_sight"),
    ],
)
def test_features_outside_the_subset_are_refused_by_name(changes, named):
    grid = gamms.scenario.Scenario(
        seed=1, map={"grid": {"width": 3, "height": 3}}, teams={"red": {"count": 2}, "blue": {"count": 1}}
    )
    with pytest.raises(NotImplementedError, match=named):
        Game(grid.replace(**changes))
