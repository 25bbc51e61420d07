"""A run with a seed seeds `random` and `numpy.random`; a program finds them as it has left them."""

import random

import numpy as np
import pytest


def drawn(grid, seed, play):
    """What a game draws from both generators, and what the program draws after it."""
    inside = []

    def strategy(state):
        inside.append((random.random(), random.gauss(0, 1), np.random.normal()))  # noqa: NPY002
        state["action"] = random.choice(state["legal"])

    random.seed(3)
    np.random.seed(3)  # noqa: NPY002
    random.gauss(0, 1), np.random.normal()  # noqa: NPY002 - each draws a second number ahead
    with grid(seed=seed) as ctx:
        ctx.agent.create_agent("a", start_node_id=5, strategy=strategy)
        play(ctx.game)
    return inside, (random.gauss(0, 1), np.random.normal(), random.random(), np.random.random())  # noqa: NPY002


def test_runs_of_one_seed_draw_the_same_and_those_of_another_seed_do_not(grid):
    once, after = drawn(grid, 11, lambda game: game.run(7))
    assert drawn(grid, 11, lambda game: game.run(7)) == (once, after)
    assert drawn(grid, 12, lambda game: game.run(7))[0] != once
    assert drawn(grid, 11, lambda game: None)[1] == after


def test_a_later_run_of_a_game_draws_other_numbers_and_a_reset_repeats_the_first(grid):
    def play(game):
        game.run(3)
        game.run(3)
        game.reset()
        game.run(3)

    inside, _ = drawn(grid, 11, play)
    assert inside[:3] == inside[6:] != inside[3:6]


def test_steps_and_runs_without_a_seed_draw_from_the_generators_of_the_program(grid):
    stepped, _ = drawn(grid, 11, lambda game: game.step())
    ran, _ = drawn(grid, None, lambda game: game.run(1))
    assert stepped == ran


def test_a_run_that_fails_leaves_the_generators_as_they_were(grid):
    def fail(state):
        raise ValueError

    random.seed(3)
    before = random.getstate()
    with grid(seed=1) as ctx:
        ctx.agent.create_agent("a", start_node_id=5, strategy=fail)
        with pytest.raises(ValueError):
            ctx.game.run(1)
    assert random.getstate() == before
