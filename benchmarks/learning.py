"""Environments to learn in: two pursuers and an evader on Helsinki, of which the pursuers learn."""

import time
import warnings

import numpy as np
from worlds import Spent


def scenario():
    """The game of `gamms/HelsinkiPursuit-v0`."""
    from gamms.scenario import from_gallery

    return from_gallery("helsinki_pursuit")


def many_games(games=1024, turns=100):
    """A vector environment, against the environment of one game."""
    from gamms import rl

    env, one = rl.vector_env(scenario(), num_games=games, team="red"), rl.parallel_env(scenario(), team="red")
    env.reset(seed=1)
    choices = np.random.default_rng(1).integers(4, size=(turns, env.num_envs))

    def ours():
        for actions in choices:
            env.step(actions)
        return turns * env.num_envs

    return ours, lambda: steps_of(one, turns)


def many_games_in_two_processes(games=4096, turns=200):
    """A vector environment of two processes, against this process alone: seconds on a clock, as both play at once.

    In so many turns most games end once, and begin again.
    """
    from gamms import rl

    envs = [rl.vector_env(scenario(), num_games=games, team="red", workers=workers) for workers in (2, 1)]
    choices = np.random.default_rng(1).integers(4, size=(turns, envs[0].num_envs))

    def played(env, warm=600):
        env.reset(seed=1)
        for turn in range(warm):  # most tables of distances are made then
            env.step(choices[turn % turns])

        def play():
            began = time.perf_counter()
            for actions in choices:
                env.step(actions)
            return Spent((time.perf_counter() - began) / choices.size)

        return play

    return tuple(played(env) for env in envs)


def one_game(turns=100):
    """The environment of one game, against `pursuit_v5` of PettingZoo."""
    from pettingzoo.sisl import pursuit_v5

    from gamms import rl

    env, peer = rl.parallel_env(scenario(), team="red"), pursuit_v5.parallel_env()
    return lambda: steps_of(env, turns), lambda: steps_of(peer, turns)


def steps_of(env, turns):
    """Play some turns with actions by chance; return what an agent-step took, and resets not counted."""
    spent, steps, random = 0.0, 0, np.random.default_rng(1)
    env.reset(seed=1)
    for _ in range(turns):
        if not env.agents:
            env.reset()
        actions = {name: int(random.integers(4)) for name in env.agents}
        began = time.process_time()
        env.step(actions)
        spent, steps = spent + time.process_time() - began, steps + len(actions)
    return Spent(spent / steps)


warnings.filterwarnings("ignore", category=DeprecationWarning, module="pettingzoo")
