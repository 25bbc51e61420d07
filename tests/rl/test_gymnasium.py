"""Environments in the hands of Gymnasium: how it makes vectors of them, wraps them, and counts episodes."""

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="Gymnasium is not installed")

import gymnasium
from gymnasium.wrappers.vector import RecordEpisodeStatistics

import gamms
from gamms import rl
from gamms.scenario import Scenario

TAG = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": "eliminate"}}


def scene(**more):
    """Five agents who are tagged out one after the other, by one who walks at random."""
    teams = {"red": {"count": 1, "strategy": "gamms.strategies:random_walk"}, "blue": {"count": 5}}
    given = {"teams": teams, "rules": [TAG, "last_team"], "max_turns": 40, **more}
    return Scenario(map={"grid": {"width": 4, "height": 3}}, **given)


def stay(state):
    state["action"] = state["legal"][0]


def one_each_turn(turn):
    return turn.before.mask * 1.0


def lives(scenario, seed, file):
    """Return how many turns each agent of the team lives, read from the recording of a game, and those of the game."""
    scenario.play(seed=seed, strategies={"blue": stay}, record=file)
    with gamms.recorder.open(file) as game:
        alive = np.array([state.agents["alive"] for state in game[:-1]], np.int64)
        blue = [name.startswith("blue") for name in game[0].agents["name"]]
        return alive[:, blue].sum(axis=0).tolist(), game.turns


@pytest.mark.parametrize("mode", ["sync", "async", "vector_entry_point"])
def test_gymnasium_makes_the_same_games_in_every_mode(mode):
    games = gymnasium.make_vec("gamms/GridTag-v0", num_envs=2, vectorization_mode=mode, agent="red_1")
    found = [games.reset(seed=4)[0], *(games.step(np.array([k % 3, 1]))[0] for k in range(4))]
    games.close()
    alone = gymnasium.make("gamms/GridTag-v0", agent="red_1")
    for slot in range(2):
        expected = [alone.reset(seed=4 + slot)[0], *(alone.step((k % 3, 1)[slot])[0] for k in range(4))]
        for one, other in zip(found, expected, strict=True):
            assert all(np.array_equal(one[key][slot], other[key]) for key in other)
    alone.close()


def test_a_life_is_one_episode(tmp_path):
    games, steps = 3, 150
    env = RecordEpisodeStatistics(rl.vector_env(scene(), num_games=games, team="blue", reward=one_each_turn), 10_000)
    env.reset(seed=7)
    for _ in range(steps):
        env.step(np.zeros(env.num_envs, np.int64))
    expected = []
    for game in range(games):
        begun, seed = 0, 7 + game
        while begun < steps:
            found, turns = lives(scene(), seed, tmp_path / f"{seed}.ggr")
            expected += [life for life in found if begun + life <= steps]
            begun, seed = begun + turns, seed + games
    assert len(expected) > 50
    assert sorted(env.return_queue) == sorted(expected)
    assert env.episode_count == len(expected)
