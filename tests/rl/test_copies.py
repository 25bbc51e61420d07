"""Copies and pickles of environments: they go on as the environments would that they were made of."""

import copy
import pickle

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="Gymnasium is not installed")
pytest.importorskip("pettingzoo", reason="PettingZoo is not installed")

from policy_scenes import remembered, seen_so_far

from gamms import rl
from gamms.errors import BadValue
from gamms.scenario import Scenario


def scene(**more):
    """Hunters and runners, some of whom are tagged out, with deeds and games of different lengths."""
    sensors = {"near": {"type": "AGENT_RANGE", "sensor_range": 30}}
    walk = {"strategy": "gamms.strategies:random_walk", "sensors": ["near"]}
    given = {
        "teams": {"red": {"count": 2, **walk}, "blue": {"count": 3, **walk}},
        "rules": [{"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": "eliminate"}}, "last_team"],
        "settings": {"deeds": {"scan": {"node": "node"}}},
        "max_turns": 12,
        **more,
    }
    return Scenario(map={"grid": {"width": 4, "height": 3}}, sensors=sensors, **given)


FLYERS = {
    "teams": {
        "red": {"count": 1, "strategy": "gamms.strategies:random_walk"},
        "blue": {"count": 2, "type": "aerial", "speed": 6},
    }
}
COPIES = {"copy": copy.deepcopy, "pickle": lambda env: pickle.loads(pickle.dumps(env))}
OPTIONS = {"observation": seen_so_far, "reward": remembered}
MADE = {
    "team": lambda: rl.parallel_env(scene(), team="blue", **OPTIONS),
    "agent": lambda: rl.single_agent_env(scene(), agent="blue_1", mask="info", actions="discrete", **OPTIONS),
    "in the air": lambda: rl.parallel_env(scene(**FLYERS), team="blue"),
    "games": lambda: rl.vector_env(scene(), num_games=4, team="blue", **OPTIONS),
    "games of an agent": lambda: rl.vector_env(scene(), num_games=3, agent="blue_1", autoreset_mode="NEXT_STEP"),
    "games one by one": lambda: rl.vector_env(scene(**FLYERS), num_games=3, team="blue"),
    "processes": lambda: rl.vector_env(scene(), num_games=4, team="blue", workers=2, **OPTIONS),
}


def written(found):
    """Return what an environment gave in a form that can be compared."""
    if isinstance(found, dict):
        return {key: written(value) for key, value in found.items()}
    if isinstance(found, tuple):
        return [written(value) for value in found]
    return found.tolist() if isinstance(found, np.ndarray) else found


def next_actions(env, random):
    """Return actions of all agents, of which some are not legal."""
    if not hasattr(env, "possible_agents"):
        env.action_space.seed(int(random.integers(1000)))
        return env.action_space.sample()
    for name in env.agents:
        env.action_space(name).seed(int(random.integers(1000)))
    return {name: env.action_space(name).sample() for name in env.agents}


def played(env, random, turns):
    """Return what an environment gives in turns, and begin games again where it does not."""
    found = []
    for _ in range(turns):
        one = env.step(next_actions(env, random))
        found.append(written(one))
        is_over = not env.agents if hasattr(env, "possible_agents") else np.ndim(one[2]) == 0 and (one[2] or one[3])
        if is_over:
            found.append(written(env.reset()))
    return found


@pytest.mark.parametrize(
    ("kind", "how"),
    [
        (kind, how) for kind in MADE for how in COPIES if (kind, how) != ("processes", "copy")
    ],  # which take long to start
)
def test_copies_go_on_as_the_environment(kind, how):
    env = MADE[kind]()
    env.reset(seed=3)
    random = np.random.default_rng(1)
    middle, later = 5, 14  # in the middle of all games, and when they have begun again at different times
    for turns in (middle, later) if kind != "processes" else (middle + later,):
        played(env, random, turns)
        other = COPIES[how](env)
        one_more = COPIES[how](other)
        state = random.bit_generator.state
        expected = [*played(env, random, 9), written(env.reset())]
        for twin in (other, one_more):
            again = np.random.default_rng()
            again.bit_generator.state = state
            assert [*played(twin, again, 9), written(twin.reset())] == expected
            twin.close()
    env.close()


@pytest.mark.parametrize("kind", ["team", "games"])
def test_an_environment_that_has_not_begun_is_copied(kind):
    env = MADE[kind]()
    other = pickle.loads(pickle.dumps(env))
    with pytest.raises(BadValue, match=r"No game has begun: call reset\(\)"):
        other.step({} if kind == "team" else other.action_space.sample())
    assert written(other.reset()) == written(env.reset())


def test_spaces_of_copies_draw_as_those_of_the_environment():
    env = MADE["team"]()
    env.reset(seed=1)
    env.action_space("blue_1").seed(5)
    other = copy.deepcopy(env)
    first, second = ([written(one.action_space("blue_1").sample()) for _ in range(9)] for one in (env, other))
    assert first == second


def test_a_closed_environment_is_not_copied():
    env = MADE["team"]()
    env.close()
    with pytest.raises(BadValue, match="This environment is closed"):
        copy.deepcopy(env)


def test_environments_that_gymnasium_has_wrapped_are_copied():
    gymnasium = pytest.importorskip("gymnasium")
    env = gymnasium.make("gamms/GridTag-v0", agent="red_1")
    env.reset(seed=4)
    env.step(1)
    other = copy.deepcopy(env)
    assert other.spec.id == "gamms/GridTag-v0"
    assert written(other.step(2)) == written(env.step(2))


def list_arrays(found):
    if isinstance(found, np.ndarray):
        return [found]
    parts = found.values() if isinstance(found, dict) else found if isinstance(found, (tuple, list)) else ()
    return [array for one in parts for array in list_arrays(one)]


@pytest.mark.parametrize("kind", ["team", "agent", "games", "games of an agent", "games one by one"])
def test_observations_masks_and_rewards_are_the_caller_s_own(kind):
    """Writing into them changes nothing that comes later."""
    seen = []
    for writes in (False, True):
        env = MADE[kind]()
        random = np.random.default_rng(1)
        found = [env.reset(seed=3)]
        texts = []
        for _ in range(4):
            texts.append(str(written(found[-1])))
            for array in list_arrays(found[-1]) if writes else ():
                if array.dtype.kind in "bif":
                    array[...] = 1
            found.append(env.step(next_actions(env, random)))
        seen.append(texts)
        env.close()
    assert seen[0] == seen[1]
