"""What an agent draws follows from the seed, its name and the turn."""

import copy
import pickle
import random
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from gamms.game.random_streams import Draws, DrawTable
from gamms.ir.game_state import GameState


def test_agents_and_seeds_draw_differently(grid):
    drawn = []

    def strategy(state):
        drawn.append(float(state["rng"].random()))

    for seed in (1, 2):
        with grid(seed=seed) as ctx:
            for name in "ab":
                ctx.agent.create_agent(name, start_node_id=0, strategy=strategy)
            ctx.game.run(max_turns=3)
    assert len(set(drawn)) == 12


@pytest.mark.parametrize("drawn", [0, 1, 3])
@pytest.mark.parametrize("key", ["rng", "draw"])
@pytest.mark.parametrize("copied", [copy.deepcopy, lambda rng: pickle.loads(pickle.dumps(rng))], ids=["copy", "pickle"])
def test_a_copy_of_a_stream_goes_on_where_it_was(grid, copied, key, drawn):
    draws = []

    def strategy(state):
        for _ in range(drawn):
            state[key].random()
        other = copied(state[key])
        draws.append((other.random(), state[key].random()))

    with grid() as ctx:
        ctx.agent.create_agent("a", start_node_id=0, strategy=strategy)
        ctx.game.run(max_turns=2)
    assert [one == other for one, other in draws] == [True, True]


def test_draws_of_a_turn_follow_from_seed_name_turn_and_count_alone(grid):
    def drawn(names, *, skipped=()):
        seen = {}

        def strategy(state):
            if state["turn"] not in skipped:
                draw = state["draw"]
                seen[state["name"], state["turn"]] = (draw.bits(), draw.below(6), draw.random(), draw.choice("abc"))

        with grid(seed=5) as ctx:
            for name in names:
                ctx.agent.create_agent(name, start_node_id=0, strategy=strategy)
            ctx.game.run(max_turns=4)
        return seen

    everything = drawn("abc")
    assert len({bits for bits, *_ in everything.values()}) == 12
    assert drawn("ca", skipped=(0, 2)) == {key: everything[key] for key in everything if key[0] in "ac" and key[1] % 2}


@pytest.mark.parametrize("n", [0, -1, 2**32 + 1])
def test_numbers_below_nothing_are_refused(grid, n):
    with grid() as ctx:
        agent = ctx.agent.create_agent("a", start_node_id=0, strategy=lambda state: state["draw"].below(n))
        with pytest.raises(ValueError, match=r"needs 1 <= n <= 2 \*\* 32"):
            ctx.game.step()
        agent.register_strategy(lambda state: state["draw"].choice([]))
        with pytest.raises(ValueError, match="not 0"):
            ctx.game.step()


def test_a_seed_that_is_set_before_the_first_turn_counts(grid):
    def first_draws(ctx):
        drawn = []
        strategy = lambda state: drawn.append((state["draw"].bits(), state["rng"].random()))
        ctx.agent.create_agent("a", start_node_id=0, strategy=strategy)
        assert ctx.game.agents
        ctx.game.reset(seed=8)
        ctx.game.step()
        return drawn

    with grid(seed=5) as ctx, grid(seed=8) as other:
        assert first_draws(ctx) == first_draws(other)


def test_draws_are_equal_if_they_draw_the_same_from_here(grid):
    pairs = []

    def strategy(state):
        before = copy.deepcopy(state["draw"])
        equal = before == state["draw"]
        state["draw"].bits()
        pairs.append((equal, before == state["draw"], before == 5))

    with grid() as ctx:
        ctx.agent.create_agent("a", start_node_id=0, strategy=strategy)
        ctx.game.run(max_turns=2)
    assert pairs == [(True, False, False)] * 2


@pytest.mark.parametrize("is_team", [False, True])
def test_the_random_stream_of_an_agent_stays_when_others_die_and_come_and_with_another_seed(grid, is_team):
    held = {}

    def strategy(state):
        held.setdefault(state["name"], []).append((state["draw"], state["team"], state["draw"].below(1 << 32)))

    with grid(seed=5) as ctx:
        if is_team:
            ctx.agent.create_team("red", [0] * 4, strategy=strategy)
        else:
            for number in range(4):
                ctx.agent.create_agent(f"red_{number}", start_node_id=0, team="red", strategy=strategy)
        ctx.game.max_turns = None
        changes = (
            lambda: ctx.game.eliminate("red_0"),
            lambda: ctx.agent.create_agent("late", start_node_id=0, strategy=strategy),
            lambda: setattr(ctx.agent.get_agent("red_3"), "team", "blue"),
            lambda: (ctx.reseed(6), ctx.agent.delete_agent("red_2")),
        )
        for change in changes:
            ctx.game.step()
            change()
        ctx.game.step()
    assert [draw is held["red_1"][0][0] for draw, *_ in held["red_1"]] == [True] * 5
    assert [team for _, team, _ in held["red_3"]] == ["red"] * 3 + ["blue"] * 2
    assert {name: len(drawn) for name, drawn in held.items()} == dict.fromkeys(("red_1", "red_3"), 5) | {
        "red_0": 1,
        "red_2": 4,
        "late": 3,
    }
    for name, drawn in held.items():
        for turn, (_, _, bits) in enumerate(drawn, 2 if name == "late" else 0):
            assert bits == Draws(DrawTable(6 if turn == 4 else 5, GameState(turn=turn)), name).below(1 << 32)


@pytest.mark.parametrize("is_team", [False, True])
def test_draws_follow_another_seed_from_the_moment_at_which_it_is_given(grid, is_team):
    drawn = []

    def strategy(state):
        drawn.append((state["draw"].bits(), state["rng"].random()))

    def add(ctx):
        if is_team:
            ctx.agent.create_team("red", [0], strategy=strategy)
        else:
            ctx.agent.create_agent("red_0", start_node_id=0, strategy=strategy)

    with grid(seed=5) as ctx, grid(seed=6) as other:
        add(ctx)
        add(other)
        ctx.game.step()
        ctx.reseed(6)
        for _ in range(2):
            ctx.game.step()
        other.game.internals.state.turn = 1
        for _ in range(2):
            other.game.step()
    assert drawn[1:3] == drawn[3:]


def test_games_in_threads_leave_the_global_generators_as_they_were(grid):
    def play(seed):
        with grid(seed=seed) as ctx:
            ctx.agent.create_agent("a", start_node_id=0, strategy=lambda state: state.update(action=0))
            for _ in range(60):
                ctx.game.step()
            return ctx.game.turn

    random.seed(3)
    before, bits, interval = random.getstate(), np.random.get_bit_generator(), sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(4) as pool:
            turns = list(pool.map(play, range(16)))
    finally:
        sys.setswitchinterval(interval)
    assert turns == [60] * 16
    assert random.getstate() == before
    assert np.random.get_bit_generator() is bits
