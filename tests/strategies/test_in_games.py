"""The strategies under the turn engine: by speed, from the start again, and as in the turns by hand."""

from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gamms.strategies import chase, first, flee, follow_path, goto, guard, human, patrol, stay

NODES = st.integers(0, 35)


def play(world, turns):
    """Where each agent has been under the turn engine, by name: before, and at the end of each turn."""
    game = world.ctx.game
    been = {name: [agent.current_node_id] for name, agent in world.agents.items()}
    for _ in range(turns):
        game.step()
        for name, agent in world.agents.items():
            been[name].append(agent.current_node_id)
    return been


@given(nodes=st.lists(NODES, min_size=1, max_size=4), starts=st.tuples(NODES, NODES, NODES))
@settings(max_examples=8)
def test_the_turn_engine_and_turns_by_hand_agree(open_world, nodes, starts):
    games = []
    for is_by_hand in (True, False):
        with open_world() as world:
            ctx = world.ctx
            world.add("cat", starts[0], chase(ctx, otherwise=patrol(ctx, nodes)), sight=20.0, team=1)
            world.add("mouse", starts[1], flee(ctx, otherwise=follow_path(ctx, nodes)), sight=15.0, team=2)
            world.add("owl", starts[2], guard(ctx, nodes[0], 20.0), team=3)
            games.append(world.play(15) if is_by_hand else play(world, 15))
    assert games[0] == games[1]


def test_who_goes_several_edges_a_turn_arrives_sooner(world):
    world.add("anna", 0, goto(world.ctx, 29), speed=3)
    path = world.ctx.graph.graph.shortest_path(0, 29)
    assert play(world, 4)["anna"] == [0, path[3], path[6], 29, 29]


@pytest.mark.parametrize("make", [goto, lambda ctx, node: patrol(ctx, [node, node]), lambda ctx, _: chase(ctx)])
@pytest.mark.parametrize("speed", [4.0, 15.0, 25.0])
@pytest.mark.parametrize("unit", ["edges", "metres"])
def test_no_part_of_a_turn_is_lost_on_the_way(world, make, speed, unit):
    world.ctx.game.speed_unit = unit
    world.add("anna", 0, make(world.ctx, 35), speed=speed / (10.0 if unit == "edges" else 1.0), team=1)
    world.add("bert", 35, stay, team=2)
    edges = [len(world.ctx.graph.graph.shortest_path(0, node)) - 1 for node in play(world, 20)["anna"]]
    assert edges == [min(10, int(turn * speed / 10.0)) for turn in range(21)]


@given(
    start=NODES,
    post=NODES,
    speed=st.sampled_from([0.5, 1, 1.5, 2, 3, 4]),
    rounds=st.lists(NODES, min_size=1, max_size=3),
)
@settings(max_examples=8)
@pytest.mark.parametrize("unit", ["edges", "metres"])
def test_a_guard_with_a_speed_stays_near_its_post_as_well(open_world, unit, start, post, speed, rounds):
    with open_world() as world:
        world.ctx.game.speed_unit = unit
        speed *= 1 if unit == "edges" else 7.0
        world.add("guard", start, guard(world.ctx, post, 20.0), team=1, speed=speed)
        world.add("intruder", rounds[0], patrol(world.ctx, rounds), team=2)
        far = [world.ctx.graph.graph.distance(node, post) for node in play(world, 25)["guard"]]
        assert all(after <= max(20.0, before) for before, after in pairwise(far))
        assert far[-1] <= 20.0
        assert world.ctx.game.result().errors == []


def test_who_is_undecided_stays_and_the_result_says_so(world):
    world.add("anna", 0, chase(world.ctx, otherwise=None), team=1)
    world.add("bert", 7, first(chase(world.ctx, otherwise=None), stay), team=1)
    result = world.ctx.game.run(max_turns=2)
    assert [(error["agent"], error["kind"]) for error in result.errors] == [("anna", "illegal")] * 2
    assert [agent["node"] for agent in result.agents.values()] == [0, 7]


def test_strategies_are_swapped_while_the_game_runs(world):
    anna = world.add("anna", 0, goto(world.ctx, 35))
    play(world, 2)
    anna.register_strategy(goto(world.ctx, 0))
    assert play(world, 2)["anna"][-1] == 0


def test_a_person_plays_against_a_strategy(world):
    moves = iter([1, 2, 3, 99])
    world.add("anna", 0, human(lambda _: next(moves)), team="people")
    world.add("cat", 35, chase(world.ctx), team="cats")
    result = world.ctx.game.run(max_turns=4)
    assert result.agents["anna"]["node"] == 3
    assert [(error["turn"], error["agent"]) for error in result.errors] == [(3, "anna")]
