"""A run with a seed seeds `random` and `numpy.random`; a program finds them as it has left them."""

import random

import numpy as np
import pytest

import gamms


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


def open_shipped(grid, **agent):
    ctx = grid(seed=11)
    ctx.agent.create_agent("a", start_node_id=5, strategy=gamms.strategies.random_walk, **agent)
    ctx.game.run(1)
    return ctx


@pytest.fixture
def seeded(monkeypatch):
    """The seeds that `random` has got."""
    seeds = []
    monkeypatch.setattr(random, "seed", seeds.append)
    return seeds


def test_a_run_in_which_no_function_of_the_program_takes_part_seeds_nothing(grid, seeded):
    with open_shipped(grid) as ctx:
        seeded.clear()
        ctx.game.run(1)
        ctx.game.run(200)
        ctx.game.run(1)
    assert seeded == []


TAKE_PART = {
    "rule": lambda ctx, draw: ctx.game.add(lambda ctx: draw()),
    "collector": lambda ctx, draw: ctx.game.collect("drawn", lambda ctx: draw()),
    "strategy": lambda ctx, draw: ctx.agent.create_agent("b", start_node_id=4, strategy=lambda state: draw()),
    "plan": lambda ctx, draw: ctx.game.command("red", lambda states: draw()),
    "after turns": lambda ctx, draw: ctx.visual.after_turn.append(draw),
    "a strategy that prepares": lambda ctx, draw: ctx.agent.create_agent("b", start_node_id=4, strategy=Prepared(draw)),
}


class Prepared:
    def __init__(self, draw):
        self.draw = draw

    def prepare(self, ctx):
        self.draw()

    def __call__(self, state):
        state["action"] = state["legal"][0]


@pytest.mark.parametrize("kind", TAKE_PART)
@pytest.mark.parametrize("turns", [1, 200])
def test_functions_that_come_after_runs_of_shipped_parts_draw_by_the_seed(grid, kind, turns):
    found = []
    for state in (1, 2):
        random.seed(state)
        drawn = []
        with open_shipped(grid, team="red") as ctx:
            TAKE_PART[kind](ctx, lambda drawn=drawn: drawn.append(random.random()))
            ctx.game.run(turns)
        found.append(drawn)
    assert found[0]
    assert found[0] == found[1]
