"""An agent that decides but can never move is named once, when its game begins, with the reason."""

import logging

import pytest

from gamms import rl, scenario
from gamms.strategies import random_walk, stay
from gamms.typing.agent_engine import AgentType

START = "Agents cannot move: {}. Start them elsewhere"
EDGE = {"length": 100.0, "drive": 50.0}


@pytest.fixture
def said(caplog):
    """The warnings that the program's log has."""
    caplog.set_level(logging.WARNING, "gamms")
    return lambda: [one.getMessage() for one in caplog.records]


@pytest.fixture
def roads(ctx):
    """A game whose nodes 0, 1, 2 are a line on foot, only its first half for cars; node 20 is alone."""
    for node in [*ctx.graph.graph.get_nodes()]:
        ctx.graph.graph.remove_node(node)
    ctx.graph.add_nodes([0, 1, 2, 20], [0.0, 100.0, 200.0, 900.0], [0.0] * 4)
    for id, (source, target) in enumerate([(0, 1), (1, 0), (1, 2), (2, 1), (20, 20)]):
        speed = 50.0 if max(source, target) < 2 else 0.0
        ctx.graph.graph.add_edge({"id": id, "source": source, "target": target, "walk": 5.0, **EDGE, "drive": speed})
    return ctx


@pytest.mark.parametrize(
    ("start", "more", "why"),
    [
        (20, {}, "no open edge leads away from node 20"),
        (2, {"mode": "drive"}, "no open edge for its mode 'drive' leads away from node 2"),
        (
            2,
            {"mode": {"attribute": "drive", "turns": True}},
            "no open edge for its mode 'drive' leads away from node 2",
        ),
        (0, {"speed": 0.0}, "its speed is 0"),
        (0, {"speed": 0.0, "type": AgentType.AERIAL}, "its speed is 0"),
    ],
)
def test_an_agent_that_can_never_move_is_named_once_with_the_reason(roads, heard, start, more, why):
    roads.agent.create_agent("anna", start_node_id=start, strategy=lambda state: state.update(action=None), **more)
    roads.game.on_illegal = "stay"
    roads.game.run(2)
    roads.game.reset(seed=2)
    roads.game.run(2)
    assert [one[: len(START.format(f"'anna' ({why})"))] for one in heard[:1]] == [START.format(f"'anna' ({why})")]
    assert sum("cannot move" in one for one in heard) == 1


def test_roads_that_are_closed_at_the_start_are_a_reason(roads, heard):
    roads.agent.create_agent("anna", start_node_id=0, strategy=random_walk)
    roads.graph.close_roads(edges=[0])
    roads.game.run(1)
    assert heard[0].startswith(START.format("'anna' (no open edge leads away from node 0)"))


@pytest.mark.parametrize(
    ("start", "strategy", "more"),
    [(20, stay, {}), (2, random_walk, {"mode": "walk"}), (2, random_walk, {}), (1, random_walk, {"mode": "drive"})],
)
def test_agents_that_can_move_or_shall_stay_are_not_named(roads, heard, start, strategy, more):
    roads.agent.create_agent("anna", start_node_id=start, strategy=strategy, **more)
    roads.agent.create_agent("gone", start_node_id=20, strategy=random_walk).alive = False
    roads.game.run(2)
    assert heard == []


def test_many_agents_are_counted(roads, heard):
    for number in range(5):
        roads.agent.create_agent(f"a{number}", start_node_id=20, strategy=random_walk)
    roads.game.run(1)
    (line,) = heard
    assert "'a2' (no open edge leads away from node 20) and 2 more. Start" in line


def test_edges_that_trap_agents_which_obey_turns_are_told_once(roads, heard):
    roads.graph.graph.update_edge({"id": 0, "forbidden_turns": {"walk": [[2], [1]]}})
    obeying = {"attribute": "walk", "turns": True}
    roads.agent.create_agent("anna", start_node_id=0, mode=obeying, strategy=random_walk)
    roads.game.run(1)
    roads.game.reset(seed=4)
    roads.game.run(1)
    (line,) = heard
    assert line.startswith(START.format("any 'walk with turns' after edge 0 (no legal turn, as after 1 edges)"))


@pytest.fixture
def game(roads, tmp_path):
    """A function that makes a scenario with one agent on the lone node, and another that walks."""
    roads.graph.save(tmp_path / "roads.gamms")

    def make(strategy):
        decided = {} if strategy is None else {"strategy": strategy}
        teams = {
            "red": {**decided, "agents": [{"name": "anna", "node": 20}]},
            "blue": {"strategy": "gamms.strategies:random_walk", "agents": [{"name": "ben", "node": 0}]},
        }
        return scenario.Scenario(map={"file": "roads.gamms"}, teams=teams, max_turns=3, folder=tmp_path)

    return make


def test_games_of_a_scenario_and_its_batch_name_the_agents_once(game, said):
    one = game("gamms.strategies:random_walk")
    with one.batch(4) as games:
        games.run()
        games.reset()
        games.run()
    one.play(seed=1)
    (line,) = said()
    assert line.startswith(START.format("'anna' (no open edge leads away from node 20)"))


def test_an_environment_names_learners_that_cannot_move(game, said):
    env = rl.vector_env(game(None), num_games=2, team="red", reward=lambda turn: 1.0 * turn.after.mask)
    env.reset(seed=1)
    env.reset(seed=2)
    env.close()
    (line,) = said()
    assert line.startswith(START.format("'anna' (no open edge leads away from node 20)"))


def test_an_agent_that_only_one_seed_lets_begin_on_a_lone_node_is_named(roads, tmp_path, said):
    roads.graph.save(tmp_path / "roads.gamms")

    def make():
        teams = {"red": {"count": 1, "strategy": "gamms.strategies:random_walk"}}
        return scenario.Scenario(map={"file": "roads.gamms"}, teams=teams, max_turns=2, folder=tmp_path)

    ends = {seed: make().play(seed=seed).agents["red_0"]["node"] for seed in range(12)}
    free, stuck = (next(seed for seed, node in ends.items() if (node == 20) == is_stuck) for is_stuck in (False, True))
    said_before = len(said())
    with make().batch(seeds=[free, stuck]) as games:
        games.run()
        games.run()
    (line,) = said()[said_before:]
    why = f"no open edge leads away from node 20, where the seed {stuck} lets it begin"
    assert line.startswith(START.format(f"'red_0' ({why})"))


def test_no_agent_is_named_where_every_node_is_legal(roads, heard):
    roads.game.legal = "any"
    roads.agent.create_agent("anna", start_node_id=20, strategy=random_walk)
    roads.game.run(1)
    assert heard == []
