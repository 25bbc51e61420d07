"""What an agent draws follows from the seed, its name and the turn."""

import copy
import pickle

import pytest


def test_what_is_drawn_in_a_turn_follows_from_the_turn_alone(grid):
    def drawn(skipped):
        seen = []

        def strategy(state):
            if state["turn"] not in skipped:
                seen.append((state["turn"], *state["rng"].integers(1 << 40, size=3).tolist()))

        with grid(seed=5) as ctx:
            ctx.agent.create_agent("a", start_node_id=0, strategy=strategy)
            ctx.game.run(max_turns=6)
        return seen

    everything = drawn(())
    assert drawn((0, 1, 4)) == [one for one in everything if one[0] not in (0, 1, 4)]
    assert len({numbers for _, *numbers in everything for numbers in numbers}) == 18


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


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda rng: pickle.loads(pickle.dumps(rng))], ids=["copy", "pickle"])
def test_a_copy_of_a_stream_goes_on_where_it_was(grid, copied):
    draws = []

    def strategy(state):
        state["rng"].random()
        other = copied(state["rng"])
        draws.append((other.random(), state["rng"].random()))

    with grid() as ctx:
        ctx.agent.create_agent("a", start_node_id=0, strategy=strategy)
        ctx.game.run(max_turns=2)
    assert [one == other for one, other in draws] == [True, True]
