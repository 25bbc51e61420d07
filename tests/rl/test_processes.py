"""Vector environments in several processes."""

import os
import signal
import sys
from pathlib import Path
from shutil import disk_usage

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="Gymnasium is not installed")

from policy_scenes import failing_reward

from gamms import rl
from gamms.errors import BadType, BadValue
from gamms.rl import processes
from gamms.scenario import Scenario
from gamms.workers import WorkerDied

GAMES = 5


def scene():
    """Two taggers with sensors, of whom one may go out, and a runner at half their speed."""
    teams = {
        "red": {"count": 2, "sensors": ["near"]},
        "blue": {"count": 1, "speed": 0.5, "strategy": "gamms.strategies:random_walk"},
    }
    tag = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": "eliminate"}}
    caught = {"rule": "tag", "with": {"taggers": "blue", "tagged": "red", "hops": 1, "score": 0, "then": "eliminate"}}
    near = {"near": {"type": "AGENT_RANGE", "sensor_range": 30}}
    grid = {"grid": {"width": 5, "height": 5}}
    return Scenario(map=grid, teams=teams, sensors=near, rules=[tag, caught, "last_team"], max_turns=9)


def test_games_in_two_processes_are_those_of_one_and_a_killed_process_is_named():
    files = {*Path("/dev/shm").glob("gamms-*")}
    one = rl.vector_env(scene(), num_games=GAMES, team="red", seed=3)
    two = rl.vector_env(scene(), num_games=GAMES, team="red", seed=3, workers=2)
    for name in ("observation_space", "action_space", "single_observation_space", "single_action_space", "metadata"):
        assert getattr(one, name) == getattr(two, name)
    assert (two.num_envs, two.num_games, two.num_agents) == (10, GAMES, 2)
    for given in ({}, {"seed": 8}, {"options": {}}):
        assert written(one.reset(**given)) == written(two.reset(**given))
        random = np.random.default_rng(1)
        for _ in range(15):  # games end at different times, and begin again
            actions = random.integers(5, size=one.num_envs)
            assert written(one.step(actions)) == written(two.step(actions))
            assert (one.action_masks() == two.action_masks()).all()
    with pytest.raises(BadValue, match="integers, one for each of 10 agents"):
        two.step(actions[:4])
    assert written(one.step(actions)) == written(two.step(actions))
    assert {*Path("/dev/shm").glob("gamms-*")} <= files
    pids = [worker.pid for worker in two._workers]
    os.kill(pids[1], signal.SIGTERM)
    with pytest.raises(WorkerDied, match=r"In process 2 of 2, which plays the games 2 to 4: .* with exit code"):
        two.step(actions)
    with pytest.raises(BadValue, match="is closed"):
        two.reset()
    for pid in pids if sys.platform != "win32" else ():
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)
    one.close()
    two.close()


def test_an_error_of_a_process_is_raised_with_its_name_and_closes_the_environment():
    env = rl.vector_env(scene(), num_games=2, team="red", reward=failing_reward, workers=2)
    env.reset(seed=1)
    with pytest.raises(ArithmeticError, match="no reward in turn 1") as raised:
        env.step(np.zeros(4, np.int64))
    notes = "\n".join(raised.value.__notes__)
    assert "In process 1 of 2, which plays the games 0 to 0; the environment was closed." in notes
    assert "failing_reward" in notes
    with pytest.raises(BadValue, match="is closed"):
        env.step(np.zeros(4, np.int64))


def test_shared_data_of_processes_is_in_memory_only_where_there_is_enough(monkeypatch, tmp_path):
    monkeypatch.setattr(processes, "_MEMORY", str(tmp_path))
    free = disk_usage(tmp_path).free
    for share, is_there in ((0.25, True), (0.75, False)):
        file = processes._make_file(int(share * free))  # which takes no space before it is written
        assert (file.parent == tmp_path) == is_there
        file.unlink()


def test_environments_that_processes_cannot_play_are_refused():
    with pytest.raises(BadValue, match="workers is 3, and there are 2 games"):
        rl.vector_env(scene(), num_games=2, team="red", workers=3)
    with pytest.raises(BadValue, match="workers must be"):
        rl.vector_env(scene(), num_games=2, team="red", workers=0)
    with pytest.raises(BadType, match="Give functions that a module defines"):
        rl.vector_env(scene(), num_games=2, team="red", workers=2, reward=lambda turn: turn.after.node * 0.0)


def written(found):
    """Return what an environment gave as it is compared: names, types and bytes."""
    if isinstance(found, dict):
        return [(key, written(value)) for key, value in found.items()]
    if isinstance(found, tuple):
        return [written(value) for value in found]
    return type(found), found.dtype.str, found.shape, found.tobytes()
