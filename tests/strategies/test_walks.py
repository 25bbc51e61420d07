"""Staying and walking at random, on the ground and in the air, with and without what the turn engine gives."""

from math import hypot

import pytest

from gamms.agent import AgentType
from gamms.strategies import random_walk, stay


def test_who_stays_stays(world):
    world.add("anna", 7, stay)
    kite = world.add("kite", 0, stay, type=AgentType.AERIAL, speed=3.0)
    assert world.play(3)["anna"] == [7] * 4
    assert kite.position == (0.0, 0.0, 0.0)


def test_a_flyer_walks_at_random_at_its_height(world):
    kite = world.add("kite", 0, random_walk, type=AgentType.AERIAL, speed=3.0, position=(5.0, 5.0, 4.0))
    before, directions = kite.position, set()
    for _ in range(20):
        world.play()
        (x0, y0, _), (x, y, z) = before, kite.position
        assert hypot(x - x0, y - y0) == pytest.approx(3.0)
        assert z == 4.0
        directions.add((x > x0, y > y0))
        before = kite.position
    assert len(directions) == 4


def test_in_a_loop_of_ones_own_a_random_walk_needs_a_generator_and_a_neighbor_sensor(world):
    anna = world.add("anna", 7)
    for _ in range(20):
        here, state = anna.current_node_id, anna.get_state()
        with pytest.raises(KeyError, match=r"random_walk needs state\['rng'\].* for example ctx.rng"):
            random_walk(state)
        assert "action" not in state
        state["rng"] = world.ctx.rng
        random_walk(state)
        anna.set_state()
        assert anna.current_node_id in world.ctx.graph.graph.neighborhoods[here]
    anna.deregister_sensor("near")
    with pytest.raises(KeyError, match=r"state\['legal'\].* NEIGHBOR sensor"):
        random_walk({**anna.get_state(), "rng": world.ctx.rng})


def test_the_same_seed_gives_the_same_walk_whichever_agents_are_there(open_world):
    walks = []
    for others in ([], ["bert", "zoe"], ["zoe", "bert"]):
        with open_world(seed=3) as world:
            for name in [*others, "anna"]:
                world.add(name, 14, random_walk)
            walks.append(world.play(30)["anna"])
    assert walks[0] == walks[1] == walks[2]
    assert len(set(walks[0])) > 3
