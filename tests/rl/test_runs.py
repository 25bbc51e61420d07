"""Training runs share no game, whatever the numbers of games, processes and threads, and play no game of tests."""

from functools import partial

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="Gymnasium is not installed")

from gamms import kernels, rl
from gamms.errors import BadType, BadValue
from gamms.recorder import open as open_recording
from gamms.scenario import Scenario
from gamms.strategies import stay

LEAST = 1 << 62
TAG = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}}


def scene():
    teams = {team: {"count": 1, "strategy": "gamms.strategies:random_walk"} for team in ("red", "blue")}
    return Scenario(max_turns=2, map={"grid": {"rows": 5, "columns": 5}}, teams=teams, rules=[TAG])


def play_run(games, run=None, steps=7, **options):
    """Return the seeds of the games in some turns of a run, (turns, games)."""
    with rl.Learners(scene(), games, teams="red", **options) as learners:
        learners.begin_all(run)
        found = [learners.games.seeds]
        for _ in range(steps):
            learners.step(np.zeros((games, 1), np.int64), begins="ended")
            learners.begin_again(np.flatnonzero(learners.is_over))
            found.append(learners.games.seeds)
    return np.array(found)


def test_runs_with_adjacent_seeds_share_no_game():
    runs = [set(play_run(16, seed).ravel().tolist()) for seed in (1, 2, 3, -1)]
    assert [len(run) for run in runs] == [16 * 4] * 4
    assert len(set.union(*runs)) == 16 * 4 * 4


def test_no_game_of_a_run_has_a_seed_of_the_tests():
    for seed in (0, 5, LEAST, -(1 << 63)):
        found = play_run(8, seed)
        assert found.dtype == np.int64
        assert found.min() >= LEAST


def test_the_games_of_a_run_depend_neither_on_their_number_nor_on_threads():
    expected = play_run(6, 9)
    assert (play_run(20, 9, threads=3)[:, :6] == expected).all()
    assert (play_run(6, None, seed=9) == expected).all()
    seeds = kernels.compute_run_seeds([9] * 24, [*range(6)] * 4, np.repeat(range(4), 6).tolist())
    assert expected[::2].ravel().tolist() == seeds


def test_the_games_of_a_run_do_not_depend_on_processes():
    envs = [rl.vector_env(scene(), num_games=5, team="red", seed=3, workers=workers) for workers in (1, 2)]
    for options in ({}, {"seed": 8}, {"seed": [4, None, 7, 7, None]}):
        first, second = (env.reset(**options)[0]["observation"] for env in envs)
        assert (first == second).all()
        for _ in range(5):
            first, second = (env.step(np.ones(5, np.int64))[0]["observation"] for env in envs)
            assert (first == second).all()
    for env in envs:
        env.close()


@pytest.mark.parametrize("make", [partial(rl.parallel_env, team="red"), partial(rl.single_agent_env, agent="red_0")])
def test_an_environment_of_one_game_plays_game_0_of_the_run(make):
    env = make(scene(), seed=6)
    seeds = kernels.compute_run_seeds([6, 6, 2, 2], [0] * 4, [0, 1, 0, 1])
    found = []
    for seed in (None, None, 2, None):
        env.reset(seed=seed)
        found += env.learners.games.seeds
    assert found == seeds
    env.reset(seed=[7])
    assert env.learners.games.seeds == (7,)
    env.reset()
    assert env.learners.games.seeds == tuple(kernels.compute_run_seeds([7], [0], [1]))
    with pytest.raises(BadValue, match="seed has 2 seeds for 1 games"):
        env.reset(seed=[7, 8])
    for wrong in ("7", [0.5]):
        with pytest.raises((BadType, TypeError)):
            env.reset(seed=wrong)
    env.close()


def test_a_named_seed_is_the_game_itself_and_later_episodes_are_of_runs():
    found = play_run(3, [5, None, 5], seed=1)
    later = [kernels.compute_run_seeds([run] * 3, [game] * 3, range(3)) for game, run in enumerate((5, 1, 5))]
    assert found[0].tolist() == [5, later[1][0], 5]
    assert found[2].tolist() == [seeds[1] for seeds in later]


def test_seeds_of_runs_survive_recordings_and_tables(tmp_path):
    [seed] = kernels.compute_run_seeds([1], [0], [0])
    with scene().batch(seeds=[seed], record=True) as games:
        games.run()
        games.record(0, tmp_path / "game.ggr")
        assert games.table()["seed"].tolist() == [seed]
        result = games.result(0)
    assert scene().play(seed=seed, record=tmp_path / "alone.ggr") == result
    assert (tmp_path / "alone.ggr").read_bytes() == (tmp_path / "game.ggr").read_bytes()
    with open_recording(tmp_path / "game.ggr") as recording:
        assert recording.header["seed"] == seed


def test_a_population_values_policies_by_games_that_trained_none():
    pytest.importorskip("torch", reason="PyTorch is not installed")
    trained = []

    def learn(env, start):
        env.reset()
        trained.append(set(env.learners.games.seeds))
        return rl.ppo_learner(env, start, steps=64)

    found = rl.Population(
        scene(), {team: [stay] for team in ("red", "blue")}, learner=learn, games=5, metric="wins.red", seed=2
    )
    responses = [found.responses(team, by="learn") for team in found.teams]
    for response in responses:
        found.add(response.team, response)
    found.responses("red", by="learn")
    assert len(set.union(*trained)) == 3 * 64
    assert {row["seed"] for row in found.rows} == {2, 3, 4, 5, 6}
    assert min(set.union(*trained)) >= LEAST


def test_a_model_of_stable_baselines_and_its_environment_agree_on_the_run():
    pytest.importorskip("stable_baselines3", reason='Stable-Baselines3 is not installed: pip install ".[train]"')
    pairs = [(None, 5), (5, None), (5, 5), (5, 6), (6, 5), (6, None)]
    found = []
    for own, of_model in pairs:
        env = rl.sb3_env(scene(), num_games=2, team="red", **({} if own is None else {"seed": own}))
        env.seed(of_model)
        env.reset()
        found.append(env.learners.games.seeds)
        env.close()
    assert found[0] == found[1] == found[2] == tuple(kernels.compute_run_seeds([5, 5], [0, 1], [0, 0]))
    assert len({seed for seeds in found[2:] for seed in seeds}) == 8


def test_trainings_of_the_same_environment_with_other_seeds_share_no_game():
    pytest.importorskip("torch", reason="PyTorch is not installed")
    found = []
    for seed in (1, 2):
        env = rl.vector_env(scene(), num_games=3, team="red")
        rl.ppo_learner(env, steps=3, seed=seed)
        found.append(env.learners.games.seeds)
        before = env.learners._episodes.tolist()
        rl.ppo_learner(env, steps=3, seed=seed)  # goes on
        assert (env.learners._episodes > before).all()
        env.close()
    assert not set(found[0]) & set(found[1])
    assert set(found[0]) < set(play_run(3, 1, steps=40).ravel().tolist())
