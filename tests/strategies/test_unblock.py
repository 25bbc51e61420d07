"""Giving way: agents that stand in each other's way pass each other in the end."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gamms.rules import Conflicts
from gamms.strategies import goto, stay, unblock

LAWS = settings(max_examples=12)


def face_to_face(ctx):
    ctx.game.conflicts = Conflicts(capacity=1, allow_swaps=False)


def arrives_both(world, starts, make, turns):
    """Let two agents go where the other one is; return the first turn in which each has been there, or None."""
    face_to_face(world.ctx)
    left, right = starts
    for name, start, target in (("anna", left, right), ("bert", right, left)):
        world.add(name, start, make(goto(world.ctx, target)), team="red")
    seen = {}
    for turn in range(turns):
        world.ctx.game.step()
        for name, target in (("anna", right), ("bert", left)):
            if world.agents[name].current_node_id == target:
                seen.setdefault(name, turn)
    return len(seen) == 2


@given(row=st.integers(0, 5), width=st.integers(1, 5), seed=st.integers(0, 10**6))
@LAWS
def test_two_that_go_through_each_other_on_a_grid_both_arrive(open_world, row, width, seed):
    with open_world(seed=seed) as world:
        assert arrives_both(world, (6 * row, 6 * row + width), unblock, 200)


@pytest.mark.parametrize("seed", range(8))
def test_two_in_a_street_with_one_side_street_pass_each_other(open_world, seed):
    places = {node: (10.0 * node, 0.0) for node in range(7)} | {7: (30.0, 10.0)}
    ways = [(node, node + 1, 10.0) for node in range(6)] + [(3, 7, 10.0)]
    with open_world(places, [*ways, *((b, a, length) for a, b, length in ways)], seed=seed) as world:
        assert arrives_both(world, (0, 6), unblock, 600)


def test_without_it_they_stand_face_to_face_for_ever(world):
    assert not arrives_both(world, (0, 5), lambda strategy: strategy, 60)


def test_an_unblocked_agent_plays_its_strategy(world):
    world.add("anna", 0, unblock(goto(world.ctx, 3), after=1))
    world.ctx.game.run(4)
    assert world.agents["anna"].current_node_id == 3
    assert world.ctx.game.memories["anna"]["unblock"]["often"] == 0


def test_impossible_arguments_are_refused():
    with pytest.raises(ValueError, match="after of unblock"):
        unblock(stay, after=0)
    with pytest.raises(TypeError, match="strategy of unblock must be a function"):
        unblock(3)


def test_it_prints_as_the_call_that_made_it(world):
    assert repr(unblock(goto(world.ctx, 3), after=4)) == "unblock(goto(ctx, 3), after=4)"
