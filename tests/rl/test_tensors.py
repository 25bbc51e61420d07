"""Scenarios as an `EnvBase` of TorchRL."""

import numpy as np
import pytest

pytest.importorskip("torchrl", reason='TorchRL is not installed: pip install ".[torchrl]"')

import torch
from torchrl.envs import TransformedEnv
from torchrl.envs.transforms import ActionMask, RewardSum
from torchrl.envs.utils import check_env_specs

from gamms import rl
from gamms.errors import BadValue, UnknownName
from gamms.scenario import Scenario
from gamms.strategies import chase, flee

WALK = "gamms.strategies:random_walk"
TAG = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": "eliminate"}}


def scene(**more):
    teams = {"red": {"count": 2, "strategy": WALK, "sensors": ["near"]}, "blue": {"count": 3, "strategy": WALK}}
    near = {"near": {"type": "AGENT_RANGE", "sensor_range": 20}}
    given = {"teams": teams, "sensors": near, "rules": [TAG, "last_team"], "max_turns": 12, **more}
    return Scenario(map={"grid": {"width": 4, "height": 4}}, **given)


@pytest.mark.parametrize("team", [None, "red", ["blue", "red"]])
def test_torchrl_finds_no_fault_in_the_specs(team):
    env = rl.torchrl_env(scene(), num_games=6, team=team)
    check_env_specs(env, seed=3)
    check_env_specs(env, break_when_any_done="both")
    env.close()


def test_specs_of_one_game_have_no_axis_of_games():
    env = rl.torchrl_env(scene(), num_games=6)
    spec = env.full_observation_spec_unbatched
    assert spec["blue", "mask"].shape == (3,)
    assert spec["blue", "action_mask"].shape == (3, 5)
    assert env.full_done_spec_unbatched["red", "done"].shape == (2, 1)
    env.close()


def test_groups_are_teams_of_games_and_agents():
    env = rl.torchrl_env(scene(), num_games=6)
    assert env.group_map == {"blue": ["blue_0", "blue_1", "blue_2"], "red": ["red_0", "red_1"]}
    begun = env.reset()
    assert begun["red", "observation"].shape == (6, 2, 38)
    assert begun["blue", "action_mask"].shape == (6, 3, 5)
    assert begun["blue", "mask"].all()
    played = env.rollout(4, break_when_any_done=False)
    assert played["next", "red", "reward"].shape == (6, 4, 2, 1)


@pytest.mark.parametrize("maps", [None, [{"grid": {"width": width, "height": 4}} for width in (3, 5, 9)]])
def test_tensors_are_the_same_games_as_those_of_gymnasium(maps):
    tensors = rl.torchrl_env(scene(), num_games=9, team="blue", seed=5, maps=maps)
    arrays = rl.vector_env(scene(), num_games=9, team="blue", seed=5, maps=maps)
    state, (observed, _) = tensors.reset(), arrays.reset()
    assert len({*tensors.learners.games.maps.tolist()}) == len(maps or [None])
    ended = 0
    for turn in range(40):
        assert np.array_equal(state["blue", "observation"].flatten(0, 1).numpy(), observed["observation"])
        assert np.array_equal(state["blue", "action_mask"].flatten(0, 1).numpy(), observed["action_mask"].astype(bool))
        masks = observed["action_mask"]
        actions = np.array([np.flatnonzero(mask)[turn % mask.sum()] for mask in masks])
        state["blue", "action"] = torch.from_numpy(actions.reshape(9, 3))
        played, state = tensors.step_and_maybe_reset(state)
        observed, rewards, _, truncated, infos = arrays.step(actions)
        after = played["next"]
        assert np.array_equal(after["blue", "reward"].flatten().numpy(), rewards.astype(np.float32))
        assert np.array_equal(after["truncated"].flatten().numpy(), truncated.reshape(9, 3).any(axis=1))
        over = after["done"].flatten().numpy()
        ended += over.sum()
        if over.any():
            last = infos["final_obs"]["observation"].reshape(9, 3, -1)[over]
            assert np.array_equal(after["blue", "observation"].numpy()[over], last)
    assert ended > 4


def stay(state):
    """Choose to stay for all agents."""
    state["blue", "action"] = torch.zeros(4, 3, dtype=torch.int64)
    return state


def test_others_change_in_games_that_are_reset():
    sets = [{"red": chase}, {"red": flee}]
    env, *fixed = [rl.torchrl_env(scene(), num_games=4, team="blue", others=one) for one in (None, *sets)]
    expected = [one.rollout(3, policy=stay) for one in fixed]
    assert not (expected[0] == expected[1]).all()
    with pytest.raises(BadValue, match="'blue'"):
        env.set_others({"blue": flee})
    env.set_others(sets[0])
    assert (env.rollout(3, policy=stay) == expected[0]).all()
    TransformedEnv(env, RewardSum()).set_others(sets[1])
    env.set_seed(0)
    assert (env.rollout(3, policy=stay) == expected[1]).all()
    for one in (env, *fixed):
        one.close()


def test_agents_that_come_are_masked_and_go_on_until_they_are_there(tmp_path):
    (tmp_path / "coming.py").write_text(
        "def come(ctx):\n"
        "    if ctx.game.turn == 2 + ctx.seed % 3:\n"
        "        one = ctx.agent.agents['red_0']\n"
        "        given = {'strategy': one.strategy, 'sensors': dict(one.sensors)}\n"
        "        ctx.agent.create_agent('red_2', start_node_id=3, team='red', **given)\n"
    )
    game = scene(rules=[TAG, "coming:come"], folder=tmp_path)
    env = rl.torchrl_env(game, num_games=3, team="red", most_agents={"red": 3}, seed=0)
    check_env_specs(env, seed=3)
    env.set_seed(0)
    state = env.reset()
    for turn in range(1, 12):
        state = env.rand_step(state)["next"]
        assert state["red", "mask"][:, 2].tolist() == [turn >= 2 + seed for seed in range(3)]
        assert not state["red", "done"].any()
    env.close()


def test_agents_that_are_out_are_masked():
    env = rl.torchrl_env(scene(), num_games=30, team="blue", seed=2)
    state, found = env.reset(), 0
    for _ in range(11):
        state = env.rand_step(state)["next"]
        out = ~state["blue", "mask"] & ~state["done"]
        found += int(out.sum())
        assert (state["blue", "terminated"][..., 0] >= out).all()
        assert (state["blue", "action_mask"][out].sum(dim=-1) == 1).all()
    assert found > 0


def test_transforms_of_torchrl_choose_legal_actions():
    env = TransformedEnv(rl.torchrl_env(scene(), num_games=5, team="red"))
    env.append_transform(ActionMask(("red", "action"), ("red", "action_mask")))
    env.append_transform(RewardSum(in_keys=[("red", "reward")], reset_keys=["_reset"]))
    played = env.rollout(20, break_when_any_done=False)
    chosen = played["red", "action_mask"].gather(-1, played["red", "action"][..., None])
    assert chosen.all()


def test_batches_are_played_by_tensors_as_by_arrays():
    with scene().batch(4, seed=2) as tensors, scene().batch(4, seed=2) as arrays:
        while not tensors.is_over.all():
            seen = tensors.observe("red").vector()
            legal = torch.from_dlpack(seen.legal)
            assert np.shares_memory(np.from_dlpack(legal), seen.legal)
            tensors.step({"red": np.from_dlpack(legal.sum(dim=-1) - 1)})
            arrays.step({"red": arrays.observe("red").counts - 1})
        assert [tensors.result(game) for game in range(4)] == [arrays.result(game) for game in range(4)]


def test_tensors_share_the_memory_of_observations():
    given = []

    def place(view):
        given.append(view["xy"].astype(np.float32))
        return given[-1]

    def far_from_the_first_node(turn):
        return turn.after["xy"].sum(axis=-1)

    env = rl.torchrl_env(scene(), num_games=3, team="red", observation=place, reward=far_from_the_first_node)
    check_env_specs(env)
    begun = env.reset()["red", "observation"]
    assert begun.shape == (3, 2, 2)
    assert np.shares_memory(np.from_dlpack(begun), given[-1])


def test_observations_that_must_not_be_written_are_copied():
    nodes = np.arange(6.0).reshape(3, 2, 1)
    nodes.flags.writeable = False
    env = rl.torchrl_env(scene(), num_games=3, team="red", observation=lambda _: nodes)
    env.reset()["red", "observation"][:] = 0.0
    assert nodes.max() == 5.0


def test_writing_into_tensors_does_not_change_the_games():
    played, changed = (rl.torchrl_env(scene(), num_games=4, seed=3) for _ in range(2))
    states = [played.reset(), changed.reset()]
    for _ in range(12):
        for tensor in states[1].values(include_nested=True, leaves_only=True):
            tensor.fill_(1)
        for state in states:
            for team in ("red", "blue"):
                state[team, "action"] = torch.ones(state[team, "mask"].shape, dtype=torch.int64)
        states = [env.step(state)["next"] for env, state in zip((played, changed), states, strict=True)]
        for key in states[0].keys(include_nested=True, leaves_only=True):
            assert torch.equal(states[0][key], states[1][key]), key


def test_an_environment_that_is_put_elsewhere_gives_tensors_there():
    env = rl.torchrl_env(scene(), num_games=3).to("cpu:0")
    check_env_specs(env)
    assert env.device == torch.device("cpu:0")
    assert env.rollout(3, break_when_any_done=False).device == torch.device("cpu:0")


def test_wrong_arguments_are_refused_by_name():
    with pytest.raises(UnknownName, match="red"):
        rl.torchrl_env(scene(), num_games=2, team="rde")
    with pytest.raises(BadValue, match="give reward="):
        rl.torchrl_env(scene(rules=["last_team"]), num_games=2)


def test_moves_and_deeds_are_one_action_with_masks():
    env = TransformedEnv(rl.torchrl_env(scene(settings={"deeds": {"scan": {"node": "node"}}}), num_games=3, team="red"))
    check_env_specs(env.base_env)
    env.append_transform(ActionMask(("red", "action"), ("red", "action_mask")))
    played = env.rollout(10, break_when_any_done=False)
    moves, deeds = played["red", "action_mask"].split([5, 6], dim=-1)
    chosen = played["red", "action"]
    assert moves.gather(-1, chosen[..., :1]).all()
    assert deeds.gather(-1, chosen[..., 1:]).all()
    assert chosen[..., 1].any()
    assert env.base_env.learners.games.result(0).deeds


@pytest.mark.parametrize("settings", [{}, {"deeds": {"drop": {"node": "node"}}}])
def test_agents_that_fly_have_a_box_without_masks(settings):
    teams = {"red": {"count": 2, "type": "aerial", "speed": 8}, "blue": {"count": 1, "strategy": WALK}}
    env = rl.torchrl_env(scene(teams=teams, sensors={}, settings=settings), num_games=2)
    check_env_specs(env, seed=3)
    played = env.rollout(4, break_when_any_done=False)
    assert played["red", "action"].shape == (
        2,
        4,
        2,
        9 if settings else 3,
    )  # a direction, and what each deed and none is worth
    assert ("red", "action_mask") not in played.keys(include_nested=True)
    assert ("blue", "action_mask") in played.keys(include_nested=True)
