"""A saved policy, and any other function that makes strategies, is accepted wherever a strategy is."""

import pickle

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="Gymnasium is not installed")
pytest.importorskip("safetensors", reason="safetensors is not installed")

from policy_scenes import Linear, Sequential

from gamms import experiment, rl
from gamms.planning import mcts
from gamms.scenario import Scenario, ScenarioError
from gamms.solve import best_response
from gamms.strategies import chase

WALK = "gamms.strategies:random_walk"


def scene(width=4, **more):
    """Two taggers and a runner on a grid, all of whom see far."""
    teams = {
        name: {"count": 3 - number, "strategy": WALK, "sensors": ["far"]} for number, name in ((1, "red"), (2, "blue"))
    }
    given = {"name": "hunt", "teams": teams, "sensors": {"far": {"type": "AGENT_RANGE", "sensor_range": 99}}, **more}
    tag = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}}
    return Scenario(**{"map": {"grid": {"width": width, "height": 4}}, "rules": [tag], "max_turns": 10, **given})


@pytest.fixture
def saved(tmp_path):
    env = rl.parallel_env(scene(), team="red")
    entries = env.observation_space("red_0")["observation"].shape[0]
    file = tmp_path / "red.safetensors"
    rl.save_policy(Sequential(Linear(np.random.default_rng(1).normal(size=(5, entries)))), file, env)
    return file


@pytest.fixture(params=["policy", "chase"])
def maker(request, saved):
    return rl.policy(saved) if request.param == "policy" else chase


def played_by(ctx):
    with ctx:
        return ctx.game.run()


def test_agents_and_teams_take_functions_that_make_strategies(maker):
    expected = scene().play(seed=3, strategies={"red": maker})
    registered, set_there, commanded = (scene().build(seed=3) for _ in range(3))
    for agent in [*registered.agent.teams["red"]]:
        agent.register_strategy(maker)
    for agent in [*set_there.agent.teams["red"]]:
        agent.strategy = lambda c: [maker(c)][0]
    commanded.game.command("red", maker)
    for ctx in (registered, set_there, commanded):
        assert played_by(ctx) == expected
    with scene().build(seed=3) as ctx:
        ctx.agent.create_agent("red_9", start_node_id=0, team="red", strategy=maker)
        ctx.agent.create_team("green", [0, 1], strategy=maker)
        made = [agent.strategy for agent in ctx.agent.create_iter() if agent.name in ("red_9", "green_0", "green_1")]
    assert len(made) == 3
    assert all(map(callable, made))
    assert maker not in made


def test_searches_play_ahead_with_functions_that_make_strategies(maker):
    red = mcts(4, depth=3, rollout=maker, opponents=chase)
    with scene(max_turns=3).build(seed=3, strategies={"red": red, "blue": mcts(4, opponents={"red": maker})}) as ctx:
        assert ctx.game.run().turns <= 3


def test_a_policy_plays_the_same_in_other_processes(saved):
    players = {"policy": rl.policy(saved), "pool": rl.opponents([saved, chase])}
    here, there = (
        experiment.run(scene(), range(4), {"strategies.red": players}, workers=workers) for workers in (None, 2)
    )
    assert len({row["strategies.red"] for row in here}) == 2
    assert here.sha256() == there.sha256()
    assert pickle.loads(pickle.dumps(players["policy"])).__name__ == "policy('red.safetensors')"


def test_the_best_answer_to_a_policy_says_how_to_allow_more_states(saved):
    with pytest.raises(ValueError, match="budget=100"):
        best_response(scene(), team="blue", against=rl.policy(saved), reward="win", turns=4, budget=100)


def test_a_policy_is_bound_to_its_spaces_and_rules(saved):
    red = rl.policy(saved)
    others = scene(name="other", seed=8, max_turns=4, width=5)
    assert others.play(strategies={"red": red}).turns <= 4
    with pytest.raises(ScenarioError, match=r"has other rules than this game: rl.policy\(path, other_scenario=True\)"):
        scene(rules=["last_team"]).play(strategies={"red": red})
