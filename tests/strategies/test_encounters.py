"""Chasing, fleeing and guarding, by what the sensors say."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gamms.agent import AgentType
from gamms.errors import BadValue
from gamms.sensor import SensorType
from gamms.strategies import chase, first, flee, goto, guard, intercept, mix, patrol, random_walk, stay
from gamms.strategies.knowledge import find_mates_in_sight

NODES = st.integers(0, 35)


def decided(world, name):
    """What an agent would do now."""
    state = world.state_of(world.agents[name])
    world.agents[name].strategy(state)
    return state.get("action")


def test_the_nearest_enemy_by_road_is_chased_not_the_nearest_as_the_crow_flies(open_world):
    places = {0: (0.0, 0.0), 1: (10.0, 0.0), 2: (0.0, 1.0)}
    with open_world(places, [(0, 1, 10.0), (1, 0, 10.0), (1, 2, 15.0), (2, 1, 15.0), (0, 2, 40.0)]) as world:
        world.add("cat", 0, chase(world.ctx), team="red")
        world.add("far", 1, stay, team="blue")
        world.add("close", 2, stay, team="blue")
        world.add("friend", 0, stay, team="red")
        assert world.play(2)["cat"] == [0, 1, 1]


@pytest.mark.parametrize(
    "make",
    [
        chase,
        lambda ctx: goto(ctx, 3),
        lambda ctx: first(stay, patrol(ctx, [1, 2])),
        lambda ctx: mix(0.5, stay, flee(ctx)),
    ],
)
def test_a_strategy_that_was_made_for_another_context_is_refused(world, open_world, make):
    agent = world.add("cat", 14, make(world.ctx))
    with open_world({3: (0.0, 0.0), 1: (1.0, 0.0), 2: (2.0, 0.0)}, [(3, 1, 1.0)]) as other:
        wrong = make(other.ctx)
        for give in (
            lambda: agent.register_strategy(wrong),
            lambda: world.add("dog", 14, wrong),
            lambda: world.ctx.agent.create_team("team", [1, 2], strategy=wrong),
        ):
            with pytest.raises(BadValue, match=r"\(.*ctx.*\) was made for another context"):
                give()
    assert agent.strategy is not wrong
    assert set(world.ctx.agent.agents) == {"cat"}


def test_of_equally_near_enemies_the_first_by_name_is_chased(world):
    world.add("cat", 14, chase(world.ctx), team=1)
    for name, node in (("zoe", 15), ("anna", 13), ("mia", 8)):
        world.add(name, node, stay, team=2)
    assert decided(world, "cat") == 13


def test_out_of_sight_no_agent_is_chased(world):
    world.add("cat", 0, chase(world.ctx, stay), sight=25.0, team=1)
    world.add("mouse", 3, goto(world.ctx, 1), team=2)
    assert world.play(3)["cat"] == [0, 0, 1, 1]
    world.add("dog", 0, chase(world.ctx, otherwise=None), sight=5.0, team=3)
    world.agents["cat"].current_node_id = 35
    assert decided(world, "dog") is None


def test_by_default_a_chaser_looks_for_enemies_at_random(open_world):
    walks = []
    for make in (chase, lambda _: random_walk):
        with open_world() as world:
            world.add("cat", 14, make(world.ctx), sight=5.0, team=1)
            walks.append(world.play(10)["cat"])
    assert walks[0] == walks[1]


def test_those_of_no_team_are_everybodys_enemies(world):
    world.add("cat", 0, chase(world.ctx))
    world.add("mouse", 12, stay)
    assert world.play(2)["cat"] == [0, 6, 12]
    world.add("dog", 24, chase(world.ctx), team="dogs")
    assert decided(world, "dog") == 18


def test_mates_in_sight_are_those_of_the_own_team(world):
    for node, (name, team) in enumerate({"cat": "red", "mate": "red", "mouse": "blue", "stray": None}.items()):
        world.add(name, node, stay, team=team)
    mates = [find_mates_in_sight(world.ctx, world.state_of(world.agents[name])) for name in ("cat", "stray")]
    assert mates == [{"mate": 1}, {}]


def test_an_agent_does_not_chase_itself_where_a_fixed_sensor_shows_it(world):
    tower = world.ctx.sensor.create_sensor("tower", SensorType.AGENT, at=0)
    cat = world.add("cat", 7, chase(world.ctx, stay), sight=0.0)
    cat.register_sensor("tower", tower)
    assert cat.get_state()["sensor"]["tower"][1] == {"cat": 7}
    world.add("mouse", 9, stay)
    assert world.play(2)["cat"] == [7, 8, 9]


def test_a_flyer_is_chased_to_the_node_below(world):
    world.add("cat", 0, chase(world.ctx), team=1)
    world.add("kite", 0, stay, type=AgentType.AERIAL, speed=3.0, position=(22.0, 1.0, 9.0), team=2)
    assert world.play(3)["cat"] == [0, 1, 2, 2]


@given(cat=NODES, mouse=NODES)
def test_who_stays_is_caught_after_as_many_turns_as_the_shortest_path_has_edges(open_world, cat, mouse):
    with open_world() as world:
        world.add("cat", cat, chase(world.ctx), team=1)
        world.add("mouse", mouse, stay, team=2)
        path = world.ctx.graph.graph.shortest_path(cat, mouse)
        assert world.play(len(path))["cat"] == [*path, mouse]


def test_who_flees_goes_where_the_nearest_enemy_is_farthest(world):
    world.add("mouse", 14, flee(world.ctx), team=1)
    world.add("cat", 13, stay, team=2)
    assert decided(world, "mouse") == 8  # 15 and 20 are as far
    world.add("dog", 2, stay, team=2)
    assert decided(world, "mouse") == 15  # 20 too
    world.agents["dog"].current_node_id = world.agents["cat"].current_node_id = 15
    world.agents["mouse"].current_node_id = 0
    assert decided(world, "mouse") == 0


@given(mouse=NODES, cats=st.lists(NODES, min_size=1, max_size=3))
def test_no_legal_node_is_farther_from_the_nearest_enemy_than_the_one_chosen(open_world, mouse, cats):
    with open_world() as world:
        world.add("mouse", mouse, flee(world.ctx), team=1)
        for i, cat in enumerate(cats):
            world.add(f"cat {i}", cat, stay, team=2)
        distances = world.ctx.graph.graph.distances(source=cats)
        legal = world.legal(world.agents["mouse"])
        most = max(distances[node] for node in legal)
        assert decided(world, "mouse") == min(node for node in legal if distances[node] == most)


def test_without_an_enemy_in_sight_no_agent_flees(world):
    world.add("mouse", 14, flee(world.ctx), sight=5.0, team=1)
    world.add("cat", 16, stay, team=2)
    assert decided(world, "mouse") == 14
    world.agents["mouse"].register_strategy(flee(world.ctx, otherwise=None))
    assert decided(world, "mouse") is None


def test_a_guard_goes_after_who_comes_near_and_returns(world):
    world.add("guard", 14, guard(world.ctx, 14, 20.0), team=1)
    intruder = world.add("intruder", 17, stay, team=2)
    assert world.play(2)["guard"] == [14, 14, 14]
    intruder.current_node_id = 16
    assert world.play(2)["guard"] == [14, 15, 16]
    intruder.current_node_id = 17
    assert world.play(3)["guard"] == [16, 15, 14, 14]


def test_a_guard_waits_where_the_way_to_an_enemy_leads_too_far_away(open_world):
    places = {node: (float(node), 0.0) for node in range(4)}
    edges = [(0, 1, 10.0), (1, 2, 1.0), (2, 3, 1.0), (3, 0, 10.0), (1, 0, 10.0)]  # 2 is 11 from the post, 3 is 10
    with open_world(places, edges) as world:
        world.add("guard", 0, guard(world.ctx, 0, 10.0), team=1)
        world.add("intruder", 3, stay, team=2)
        assert world.play(3)["guard"] == [0, 1, 1, 1]


@given(start=NODES, post=NODES, radius=st.sampled_from([0.0, 10.0, 25.0, 40.0]), rounds=st.lists(NODES, min_size=1))
def test_once_near_its_post_a_guard_never_leaves_it(open_world, start, post, radius, rounds):
    with open_world() as world:
        graph = world.ctx.graph.graph
        world.add("guard", start, guard(world.ctx, post, radius), team=1)
        world.add("intruder", rounds[0], patrol(world.ctx, rounds), team=2)
        far = [graph.distance(node, post) for node in world.play(20)["guard"]]
        assert all(after <= max(radius, before) for before, after in pairwise(far))
        assert far[-1] <= radius


def test_bad_posts_radii_and_fallbacks_are_refused(world):
    with pytest.raises(KeyError, match="Unknown node 99"):
        guard(world.ctx, 99, 10.0)
    with pytest.raises(ValueError, match="radius of guard must not be negative, not -1"):
        guard(world.ctx, 0, -1)
    for make in (chase, flee):
        with pytest.raises(TypeError, match=f"otherwise of {make.__name__}"):
            make(world.ctx, "walk")


def test_in_a_loop_of_ones_own_they_ask_for_the_team(world):
    cat = world.add("cat", 0)
    world.add("mouse", 12, team="mice")
    for strategy in (chase(world.ctx), flee(world.ctx), guard(world.ctx, 0, 5.0)):
        with pytest.raises(KeyError, match=r"needs state\['team'\].* set it to agent\.team"):
            strategy(cat.get_state())
    state = cat.get_state() | {"team": "cats"}
    chase(world.ctx)(state)
    assert state["action"] == 6


def test_for_a_flyer_an_error_says_that_these_go_along_edges(world):
    kite = world.add("kite", 0, type=AgentType.AERIAL, speed=3.0)
    for strategy in (chase(world.ctx), flee(world.ctx), guard(world.ctx, 0, 5.0), intercept(world.ctx)):
        with pytest.raises(TypeError, match="moves along edges"):
            strategy(world.state_of(kite))
