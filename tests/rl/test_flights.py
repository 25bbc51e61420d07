"""Learners that fly: a box of shares of what they reach, alone, beside others on the ground, and in many games."""

import warnings

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="Gymnasium is not installed")
pytest.importorskip("pettingzoo", reason="PettingZoo is not installed")

from gymnasium.utils.env_checker import check_env

with warnings.catch_warnings():
    warnings.simplefilter("ignore", DeprecationWarning)  # importing the tests of PettingZoo makes a game the old way
    from pettingzoo.test import parallel_api_test, parallel_seed_test

from policy_scenes import Linear, Sequential

import gamms
from gamms import rl
from gamms.errors import BadValue
from gamms.rl.networks import read_network
from gamms.scenario import Scenario

TAG = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "air": True, "euclid": 12.0}}


def scene(drones=2, cars=0, **more):
    """Drones, and perhaps cars, after a runner."""
    agents = [
        {"name": f"red_drone_{i}", "type": "aerial", "speed": 8.0 + i, "altitude": 20.0, "sensors": ["camera"]}
        for i in range(drones)
    ]
    agents += [{"name": f"red_car_{i}", "sensors": ["near"]} for i in range(cars)]
    teams = {"red": {"agents": agents}, "blue": {"count": 1, "strategy": "gamms.strategies:random_walk"}}
    sensors = {
        "camera": {"type": "AERIAL_AGENT", "sensor_range": 60},
        "near": {"type": "AGENT_RANGE", "sensor_range": 20},
    }
    given = {"teams": teams, "sensors": sensors, "rules": [TAG], "max_turns": 8, **more}
    return Scenario(map={"grid": {"width": 4, "height": 4}}, **given)


@pytest.mark.parametrize("flights", [np.zeros((1, 2, 2)), np.full((1, 2, 3), "up"), np.zeros((1, 2, 3), bool)])
def test_flights_are_three_numbers_for_each_agent(flights):
    with rl.Learners(scene(), teams=["red"]) as learners:
        moves = np.zeros((1, len(learners.names)), int)
        with pytest.raises(BadValue, match="Flights are numbers"):
            learners.step(moves, flights=flights)


def test_a_team_on_the_ground_learns_beside_one_that_flies():
    env = rl.parallel_env(scene(cars=1))
    env.reset(seed=1)
    *_, infos = env.step({name: env.action_space(name).sample() * 0 for name in env.agents})
    assert set(infos) == {"blue_0", "red_car_0", "red_drone_0", "red_drone_1"}


@pytest.mark.parametrize("cars", [0, 2])
def test_checkers_find_no_fault(cars, capsys):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        parallel_api_test(rl.parallel_env(scene(cars=cars), team="red"), num_cycles=20)
        parallel_seed_test(lambda: rl.parallel_env(scene(cars=cars), team="red"), num_cycles=10)
        check_env(rl.single_agent_env(scene(cars=cars), agent="red_drone_1"), skip_render_check=True)
    assert "Passed" in capsys.readouterr().out


def test_agents_in_the_air_and_on_the_ground_have_spaces_of_their_own():
    env = rl.parallel_env(scene(cars=1))
    observed, infos = env.reset(seed=1)
    assert [type(env.action_space(name)).__name__ for name in env.possible_agents] == [
        "Discrete",
        "Discrete",
        "Box",
        "Box",
    ]
    assert (
        {name for name, one in infos.items() if "action_mask" in one}
        == {"blue_0", "red_car_0"}
        == set(env.action_masks())
    )
    assert {one["observation"].shape for one in observed.values()} == {(2 + 15 + 15 + 2,)}
    with pytest.raises(BadValue, match="'red_drone_0' flies and 'red_car_0' does not, and vector_env has one action"):
        rl.vector_env(scene(cars=1), num_games=2, team="red")
    games = rl.vector_env(scene(), num_games=2, team="red")
    games.reset()
    with pytest.raises(BadValue, match="3 numbers from -1 to 1 for each of 4 agents"):
        games.step(np.zeros(4))
    with pytest.raises(BadValue, match="'red_drone_0' flies and 'red_car_0' does not, and a policy has one action"):
        rl.save_policy(None, "red.safetensors", scene(cars=1), team="red")


DEEDS = {"drop": {"node": "node"}, "mark": {"whom": "agent"}}


@pytest.mark.parametrize(("team", "deeds"), [("drones", {}), ("drones", DEEDS), ("cars", {})])
def test_saved_policies_act_alone_as_in_their_environment(team, deeds, tmp_path):
    agents = scene(drones=2, cars=2).to_dict()["teams"]["red"]["agents"]
    teams = {"drones": {"agents": agents[:2]}, "cars": {"agents": agents[2:]}}
    runner = {"agents": [{"name": "blue_0", "node": 9, "strategy": "gamms.strategies:random_walk"}]}
    tag = {"rule": "tag", "with": {**TAG["with"], "taggers": "drones"}}
    game = scene(teams={**teams, "blue": runner}, rules=[tag], settings={"deeds": deeds})
    env = rl.parallel_env(game, team=team)
    observed, _ = env.reset(seed=[3])
    name = env.agents[0]
    entries = len(observed[name]["observation"])
    numbers = 3 if team == "drones" else env.learners.num_actions
    numbers += len(env.learners.deeds or ())
    weight = np.random.default_rng(0).normal(size=(numbers, entries))
    rl.save_policy(Sequential(Linear(weight)), tmp_path / "it.safetensors", env)
    played = game.build(3, {team: rl.policy(tmp_path / "it.safetensors")})
    evaluate = read_network(Sequential(Linear(weight))).make_logits(numbers)
    with played:
        for _ in range(5):
            chosen = {}
            for name in env.agents:
                one = observed[name]
                mask = one.get("action_mask", np.ones(numbers))
                values = evaluate({"observation": one["observation"][None], "action_mask": mask[None]})[0]
                chosen[name] = (
                    np.clip(values, -1, 1) if team == "drones" else np.argmax(np.where(mask, values, -np.inf))
                )
            observed, *_ = env.step(chosen)
            played.game.step()
            alone = env.learners.games.context(0)
            for one in played.agent.create_iter():
                other = alone.agent.agents[one.name]
                assert (one.current_node_id, one.get_state()["curr_pos"]) == (
                    other.current_node_id,
                    other.get_state()["curr_pos"],
                )
        assert played.game.result().deeds == alone.game.result().deeds
        assert bool(deeds) == bool(played.game.result().deeds)
    env.close()


def test_policies_of_agents_that_fly_are_for_these_alone(tmp_path):
    entries = rl.parallel_env(scene(), team="red").observation_space("red_drone_0")["observation"].shape[0]
    rl.save_policy(Sequential(Linear(np.zeros((3, entries)))), tmp_path / "it.safetensors", scene(), team="red")
    with pytest.raises(BadValue, match="trained for agents that fly, not for those on the ground"):
        scene().play(strategies={"blue": rl.policy(tmp_path / "it.safetensors", other_scenario=True)})
    with pytest.raises(BadValue, match="sample=True draws moves"):
        scene().play(strategies={"red": rl.policy(tmp_path / "it.safetensors", sample=True)})


def test_what_flies_has_no_masks():
    with pytest.raises(BadValue, match="'red_drone_0' flies, and what it does has no mask"):
        rl.single_agent_env(scene(), agent="red_drone_0").action_masks()


def test_an_action_may_say_how_far_an_agent_flies():
    with gamms.create_context() as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(2, 2))
        kite = ctx.agent.create_agent("kite", type="AERIAL", start_node_id=0, speed=5.0)
        for distance, x in ((2.0, 2.0), (0.0, 2.0), (None, 7.0)):
            kite.get_state()["action"] = {"direction": (3, 0, 0)} | ({} if distance is None else {"distance": distance})
            kite.set_state()
            assert kite.position == (x, 0.0, 0.0)
        for distance, why in ((6.0, "more than the speed of agent 'kite', 5"), (-1.0, "A distance")):
            kite.get_state()["action"] = {"direction": (1, 0, 0), "distance": distance}
            with pytest.raises(BadValue, match=why):
                kite.set_state()
