"""Cutting off, sharing out and escaping."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gamms.strategies import assign, follow_belief, goto, intercept, patrol, safest_exit, stay

NODES = st.integers(0, 35)


def moves(world, turns=1):
    """Play with the turn engine; where each agent is at the end."""
    world.ctx.game.run(turns)
    return {name: agent.current_node_id for name, agent in world.agents.items()}


def test_an_enemy_is_met_on_its_way_to_a_goal_not_followed(world):
    world.add("cat", 2, intercept(world.ctx, [5]), team=1)
    world.add("mouse", 24, goto(world.ctx, 5), team=2)
    path = world.ctx.graph.graph.shortest_path(24, 5)
    been = world.play(6)
    assert any(been["cat"][turn] == been["mouse"][turn] for turn in range(7))
    assert set(been["cat"][1:]) <= {*path, 2, *world.ctx.graph.graph.shortest_path(2, 5)}


@given(cat=NODES, mouse=NODES, goal=NODES)
def test_an_enemy_that_can_be_met_in_time_never_reaches_its_goal_alone(open_world, cat, mouse, goal):
    with open_world() as world:
        graph = world.ctx.graph.graph
        world.add("cat", cat, intercept(world.ctx, [goal]), team=1)
        world.add("mouse", mouse, goto(world.ctx, goal), team=2)
        if graph.distance(cat, goal) <= graph.distance(mouse, goal):
            been = world.play(12)
            turn = been["mouse"].index(goal)
            crossed = zip(been["cat"], been["cat"][1:], been["mouse"], been["mouse"][1:], strict=False)
            met = any(a == b for a, b in zip(been["cat"][: turn + 1], been["mouse"], strict=False))
            assert met or any(a == d and b == c for a, b, c, d in list(crossed)[:turn])


def test_agents_share_enemies_out_by_the_least_total_distance(world):
    for name, node in (("cat a", 0), ("cat b", 1)):
        world.add(name, node, assign(world.ctx), team=1)
    world.add("mouse", 2, stay, team=2)
    world.add("rat", 30, stay, team=2)
    assert moves(world, 8) == {"cat a": 30, "cat b": 2, "mouse": 2, "rat": 30}


def test_agents_that_share_no_memory_go_to_the_nearest(world):
    world.ctx.game.team_memory = False
    for name, node in (("cat a", 0), ("cat b", 1)):
        world.add(name, node, assign(world.ctx), team=1)
    world.add("mouse", 2, stay, team=2)
    world.add("rat", 30, stay, team=2)
    assert moves(world, 6)["cat a"] == 2


def test_a_teammate_without_a_target_goes_where_another_has_seen_an_enemy(world):
    world.add("cat a", 0, assign(world.ctx, otherwise=stay), sight=20.0, team=1)
    world.add("cat b", 35, assign(world.ctx, otherwise=stay), sight=20.0, team=1)
    world.add("mouse", 2, stay, team=2)
    assert moves(world, 9)["cat b"] == 2


def test_dead_enemies_are_assigned_to_no_agent(world):
    world.add("cat", 0, assign(world.ctx, otherwise=stay), team=1)
    world.add("mouse", 3, stay, team=2)
    moves(world, 2)
    world.ctx.game.eliminate("mouse")
    at = world.agents["cat"].current_node_id
    assert moves(world, 3)["cat"] == at


def test_of_two_exits_the_one_that_is_reached_before_the_enemy_is_taken(world):
    world.add("mouse", 2, safest_exit(world.ctx, [0, 5]), team=2)
    world.add("cat", 1, stay, team=1)
    assert moves(world, 3)["mouse"] == 5


def test_without_enemies_in_sight_the_nearest_exit_is_taken_and_no_exit_is_another_strategy(open_world):
    with open_world() as world:
        world.add("mouse", 2, safest_exit(world.ctx, [0, 5]), team=2)
        assert moves(world, 2)["mouse"] == 0
    line = dict.fromkeys(range(3), (0.0, 0.0))
    with open_world(line, [(0, 1, 1.0), (1, 0, 1.0)]) as world:
        world.add("mouse", 0, safest_exit(world.ctx, [2], otherwise=goto(world.ctx, 1)), team=2)
        assert moves(world)["mouse"] == 1


@given(cat=NODES, mouse=NODES, exits=st.sets(NODES, min_size=1, max_size=3))
def test_who_can_be_at_an_exit_first_gets_there_uncaught(open_world, cat, mouse, exits):
    from gamms.strategies import chase

    with open_world() as world:
        graph = world.ctx.graph.graph
        lead = max(graph.distance(cat, one) - graph.distance(mouse, one) for one in exits)
        world.add("cat", cat, chase(world.ctx), team=1)
        world.add("mouse", mouse, safest_exit(world.ctx, sorted(exits)), team=2)
        been = world.play(12)
        if lead > 0:
            arrived = min(been["mouse"].index(one) for one in exits if one in been["mouse"])
            assert all(a != b for a, b in zip(been["cat"][: arrived + 1], been["mouse"], strict=False))


def test_an_enemy_out_of_sight_is_found_by_where_it_can_be(world):
    world.add("cat", 0, follow_belief(world.ctx), sight=10.0, team=1)
    world.add("mouse", 35, stay, team=2)
    world.ctx.game.add(moves_met)
    result = world.ctx.game.run(60)
    assert result.reason == "found"


def moves_met(ctx):
    cat, mouse = (ctx.agent.get_agent(name) for name in ("cat", "mouse"))
    if cat.current_node_id == mouse.current_node_id:
        ctx.game.end("found")


def test_without_a_target_the_other_strategy_decides(world):
    world.add("cat", 0, follow_belief(world.ctx, otherwise=goto(world.ctx, 2)), team=1)
    assert moves(world, 2)["cat"] == 2


@pytest.mark.parametrize("unit", ["edges", "metres"])
def test_they_play_with_speeds_as_well(world, unit):
    ctx, pace = world.ctx, 1.0 if unit == "edges" else 10.0
    ctx.game.speed_unit = unit
    for i, make in enumerate((intercept, lambda ctx: intercept(ctx, [0, 35]), assign, follow_belief)):
        world.add(f"cat {i}", i, make(ctx), team=1, speed=(i + 1) * pace)
    world.add("mouse", 20, safest_exit(ctx, [0, 35]), team=2, speed=1.5 * pace)
    world.add("rat", 30, patrol(ctx, [3, 33]), team=2)
    assert ctx.game.run(20).errors == []


def test_impossible_arguments_are_refused(world):
    for make, error, said in (
        (lambda: intercept(world.ctx, [99]), KeyError, "99"),
        (lambda: intercept(world.ctx, []), ValueError, "intercept needs at least one node"),
        (lambda: safest_exit(world.ctx, 3), TypeError, "exits of safest_exit must be a list of node ids, not 3"),
        (lambda: assign(world.ctx, patience=-1), ValueError, "patience of assign"),
        (lambda: follow_belief(world.ctx, targets="mouse"), TypeError, "targets"),
    ):
        with pytest.raises(error, match=said):
            make()
    assert repr(intercept(world.ctx, [3], otherwise=stay)) == "intercept(ctx, [3], otherwise=stay)"
