"""Sight on uneven ground and in tunnels: eyes are above their node, and none look through the roof of a tunnel."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gamms
from gamms.sensor import SensorType
from gamms.typing import AgentType

WALL = [(50.0, -50.0, 3.0), (50.0, 50.0, 3.0), (50.0, -50.0, 0.0), (50.0, 50.0, 0.0)]


def wall(z):
    """Return a wall of 3 m across the line of nodes, at a height."""
    return np.array([WALL]) + np.array((0.0, 0.0, z))


@pytest.fixture
def world():
    """Make a context with nodes 0, 1, … 100 m apart on a line, joined to and fro, of these heights and tunnels."""
    contexts = []

    def world(heights=(), tunnels=(), wall_at=None):
        ctx = gamms.create_context(logger_config={"level": "CRITICAL"})
        contexts.append(ctx)
        graph, count = ctx.graph.graph, max(len(heights), len(tunnels))
        for node in range(count):
            given = {"z": heights[node]} if heights else {}
            given |= {"underground": tunnels[node]} if tunnels and tunnels[node] else {}
            graph.add_node({"id": node, "x": 100.0 * node, "y": 0.0, **given})
        for node in range(count - 1):
            graph.add_edge({"id": 2 * node, "source": node, "target": node + 1, "length": 100.0})
            graph.add_edge({"id": 2 * node + 1, "source": node + 1, "target": node, "length": 100.0})
        if wall_at is not None:
            ctx.graph.add_obstacles(wall(wall_at))
        return ctx

    yield world
    for ctx in contexts:
        ctx.terminate()


def seen(ctx, node, type=SensorType.OCCLUDED_MAP, **options):
    sensor = ctx.sensor.create_sensor(f"from {node} {type}", type, **options)
    sensor.sense(node)
    return sorted(sensor.data["nodes"])


def test_from_a_hill_eyes_look_over_a_wall(world):
    assert seen(world((0.0, 0.0), wall_at=0.0), 0) == [0]
    assert seen(world((10.0, 0.0), wall_at=0.0), 0) == [0, 1]
    assert seen(world((0.0, 10.0), wall_at=0.0), 0) == [0, 1]
    assert seen(world((0.5, 0.5), wall_at=0.0), 0) == [0]


def test_where_all_is_as_much_higher_all_is_seen_alike(world):
    for wall_at, found in ((300.0, [0]), (0.0, [0, 1])):
        assert seen(world((300.0, 300.0), wall_at=wall_at), 0) == found


def test_a_sensor_at_a_place_is_as_high_as_the_nearest_node(world):
    ctx = world((10.0, 0.0), wall_at=0.0)
    for at, found in (((1.0, 0.0), [0, 1]), ((99.0, 0.0), [0, 1])):
        sensor = ctx.sensor.create_sensor(f"at {at}", SensorType.OCCLUDED_MAP, at=at)
        sensor.sense()
        assert sorted(sensor.data["nodes"]) == found
    low = world((0.0, 0.0), wall_at=0.0)
    sensor = low.sensor.create_sensor("low", SensorType.OCCLUDED_MAP, at=(1.0, 0.0))
    sensor.sense()
    assert sorted(sensor.data["nodes"]) == [0]


def test_who_is_in_a_tunnel_sees_and_is_seen_there_alone(world):
    ctx = world(tunnels=(0, 1, 1, 0, 2))
    assert seen(ctx, 0) == [0, 3]
    assert seen(ctx, 1) == [1, 2]
    assert seen(ctx, 4) == [4]
    assert seen(ctx, 0, SensorType.RANGE, sensor_range=1e9) == [0, 1, 2, 3, 4]  # it looks through walls, too


def test_agents_in_a_tunnel_are_hidden(world):
    ctx = world(tunnels=(0, 1, 1, 0))
    for node in range(4):
        ctx.agent.create_agent(f"a{node}", start_node_id=node)
    for node, found in ((0, {"a3"}), (1, {"a2"})):
        sensor = ctx.sensor.create_sensor(f"s{node}", SensorType.OCCLUDED_AGENT)
        ctx.agent.get_agent(f"a{node}").register_sensor(f"s{node}", sensor)
        sensor.sense(node)
        assert set(sensor.data) == found


def test_an_agent_on_an_edge_is_in_the_tunnel_of_the_node_that_it_passed(world):
    ctx = world(tunnels=(0, 1, 1, 0))
    ctx.game.speed_unit = "metres"
    found = {}

    def strategy(state):
        name = state["name"]
        found[name] = sorted(state["sensor"][f"eyes of {name}"][1])
        state["action"] = {"inside": 2, "outside": 3}[name]

    for name, node in (("inside", 1), ("outside", 3), ("mole", 2)):
        ctx.agent.create_agent(name, start_node_id=node, speed=30.0, strategy=strategy if name != "mole" else None)
    for name in ("inside", "outside"):
        sensor = ctx.sensor.create_sensor(f"eyes of {name}", SensorType.OCCLUDED_AGENT)
        ctx.agent.get_agent(name).register_sensor(f"eyes of {name}", sensor)
    for _ in range(2):
        ctx.game.step()
    assert ctx.agent.get_agent("inside").edge is not None
    assert found == {"inside": ["mole"], "outside": []}


def test_from_the_air_the_ground_is_at_its_height_and_tunnels_are_not_seen(world):
    ctx = world((5.0, 7.0, 9.0), (0, 1, 0))
    for node in range(3):
        ctx.agent.create_agent(f"a{node}", start_node_id=node)
    ctx.agent.create_agent("drone", start_node_id=1, type=AgentType.AERIAL, speed=1.0, position=(100.0, 0.0, 60.0))
    every = {f"a{node}": (AgentType.BASIC, (100.0 * node, 0.0, height)) for node, height in enumerate((5.0, 7.0, 9.0))}
    for type, found in (
        (SensorType.AERIAL_AGENT, every),
        (SensorType.OCCLUDED_AERIAL_AGENT, {name: every[name] for name in ("a0", "a2")}),
    ):
        sensor = ctx.sensor.create_sensor(f"{type}", type, sensor_range=1e6)
        ctx.agent.get_agent("drone").register_sensor(f"{type}", sensor)
        sensor.sense(1)
        assert sensor.data == found
    above = (100.0, 0.0, 60.0)
    down = ctx.sensor.create_sensor("down", SensorType.OCCLUDED_AERIAL, sensor_range=1e6, fov=3.0, at=above)
    down.sense(1)
    assert sorted(down.data["nodes"]) == [0, 2]
    near = ctx.sensor.create_sensor("near", SensorType.AERIAL, sensor_range=53.5, fov=0.1, at=above)
    near.sense(1)
    assert sorted(near.data["nodes"]) == [1]  # 53 m below, not 60


@given(
    heights=st.lists(st.floats(-20.0, 20.0), min_size=5, max_size=5),
    tunnels=st.lists(st.integers(0, 2), min_size=5, max_size=5),
    wall_at=st.floats(-20.0, 20.0),
)
def test_tables_say_what_sensors_see(heights, tunnels, wall_at):
    with gamms.create_context(logger_config={"level": "CRITICAL"}) as ctx:
        for node, (height, tunnel) in enumerate(zip(heights, tunnels, strict=True)):
            ctx.graph.graph.add_node({"id": node, "x": 40.0 * node, "y": 0.0, "z": height, "underground": tunnel})
        ctx.graph.add_obstacles(wall(wall_at))
        plain = [seen(ctx, node, sensor_range=130.0) for node in range(5)]
        table = ctx.graph.visibility(130.0, path=False)
        assert [table.from_node(node).tolist() for node in range(5)] == plain
        ctx.graph.graph.update_node({"id": 0, "z": 100.0})
        assert ctx.graph.visibility_table(130.0) is None


def test_workers_see_uneven_ground_too(world):
    ctx = world(
        tuple(float(node % 3) * 5.0 for node in range(70)), tuple(node // 60 for node in range(70)), wall_at=0.0
    )
    alone = ctx.graph.visibility(350.0, path=False, workers=1)
    with gamms.create_context(logger_config={"level": "CRITICAL"}) as other:
        other.graph.attach_networkx_graph(ctx.graph.graph.to_networkx())
        other.graph.add_obstacles(ctx.graph.obstacle_columns().corners)
        many = other.graph.visibility(350.0, path=False, workers=2)
        for node in range(70):
            assert alone.from_node(node).tolist() == many.from_node(node).tolist()


@pytest.mark.parametrize("z", ["high", None, float("nan"), True, [1.0]])
def test_an_attribute_z_that_is_no_height_counts_as_none(world, z):
    ctx = world((0.0, 0.0), wall_at=0.0)
    ctx.graph.graph.update_node({"id": 0, "z": z})
    assert seen(ctx, 0) == [0]


def test_removed_nodes_leave_the_others_where_they_are(world):
    ctx = world((0.0, 10.0, 20.0, 30.0), (0, 0, 1, 1))
    ctx.graph.graph.remove_node(0)
    ctx.graph.columns()
    ground = ctx.graph.graph.ground([3, 1])
    assert (ground.z.tolist(), ground.tunnels.tolist()) == ([30.0, 10.0], [1, 0])
