"""Covering a map: sweeping all nodes as a team, and waypoints drawn at random."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gamms.strategies import random_waypoints, sweep

LAWS = settings(max_examples=10)


def turns_to_visit_all(world, most=2000):
    """Play until every node was visited; return the number of turns."""
    seen = {agent.current_node_id for agent in world.agents.values()}
    for turn in range(most):
        if len(seen) == len(world.ctx.graph.columns().node_ids):
            return turn
        world.ctx.game.step()
        seen |= {agent.current_node_id for agent in world.agents.values()}
    return most


@given(starts=st.lists(st.integers(0, 35), min_size=1, max_size=4), seed=st.integers(0, 99))
@LAWS
def test_all_nodes_that_can_be_reached_are_visited_wherever_the_team_starts(open_world, starts, seed):
    with open_world(seed=seed) as world:
        for i, start in enumerate(starts):
            world.add(f"agent {i}", start, sweep(world.ctx), team="red")
        assert turns_to_visit_all(world, 120) < 120


def test_a_team_goes_on_with_the_part_of_a_member_that_is_dead(world):
    for i in range(2):
        world.add(f"agent {i}", 0, sweep(world.ctx), team="red")
    world.ctx.game.run(3)
    world.ctx.game.eliminate("agent 1")
    world.ctx.game.run(60)
    assert len(world.ctx.game.team_memories["red"]["sweep"]["visited"]) == 36


def test_in_a_loop_of_ones_own_a_mate_that_dies_before_an_agent_is_asked_has_no_part_any_longer(world):
    strategy = sweep(world.ctx)
    anna, bert = (world.add(name, 0, strategy, team="red") for name in ("anna", "bert"))

    def target():
        state = world.state_of(bert)
        state["memory"].clear()
        strategy(state)
        return state["memory"]["sweep target"]

    assert target() in (3, 18)  # of the half that is farther away
    anna.alive = False
    assert target() in (1, 6)


def test_a_mate_that_dies_between_two_turns_has_no_part_in_the_second(world):
    targets = []
    for name in ("anna", "bert"):
        world.add(name, 0, sweep(world.ctx), team="red")
    for _ in range(2):
        world.ctx.game.step()
        targets.append(world.ctx.game.memories["bert"].pop("sweep target"))
        world.agents["bert"].current_node_id, world.agents["anna"].alive = 0, False
    assert targets[0] in (3, 18)
    assert targets[1] in (1, 6)


def test_nodes_covered_by_sensors_count_as_visited_by_sight(world):
    agent = world.add("anna", 14, sweep(world.ctx, [14, 15, 20, 35], by_sight=True), sight=15.0, team="red")
    world.ctx.game.step()
    assert {14, 15, 20} <= world.ctx.game.team_memories["red"]["sweep"]["visited"]
    world.ctx.game.run(6)
    assert agent.current_node_id in (28, 29, 34, 35)


def test_waypoints_without_a_way_are_drawn_again(open_world):
    places = dict.fromkeys(range(4), (0.0, 0.0))
    with open_world(places, [(0, 1, 1.0), (1, 0, 1.0)]) as world:
        agent = world.add("anna", 0, random_waypoints(world.ctx))
        been = set()
        for _ in range(30):
            world.ctx.game.step()
            been.add(agent.current_node_id)
        assert been == {0, 1}


def test_impossible_arguments_are_refused(world):
    for make, error, said in (
        (lambda: sweep(world.ctx, []), ValueError, "sweep needs at least one node"),
        (lambda: sweep(world.ctx, repeat=1), TypeError, "repeat of sweep"),
        (lambda: random_waypoints(world.ctx, [99]), KeyError, "99"),
        (lambda: random_waypoints(world.ctx, pause=-1), ValueError, "pause of random_waypoints"),
    ):
        with pytest.raises(error, match=said):
            make()
