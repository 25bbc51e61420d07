"""Sight on uneven ground and in tunnels: eyes are above their node, and none look through the roof of a tunnel."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gamms
from gamms.sensor import SensorType

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


def test_who_is_in_a_tunnel_sees_and_is_seen_there_alone(world):
    ctx = world(tunnels=(0, 1, 1, 0, 2))
    assert seen(ctx, 0) == [0, 3]
    assert seen(ctx, 1) == [1, 2]
    assert seen(ctx, 4) == [4]
    assert seen(ctx, 0, SensorType.RANGE, sensor_range=1e9) == [0, 1, 2, 3, 4]  # it looks through walls, too


@given(
    heights=st.lists(st.floats(-20.0, 20.0), min_size=5, max_size=5),
    tunnels=st.lists(st.integers(0, 2), min_size=5, max_size=5),
    wall_at=st.floats(-20.0, 20.0),
)
def test_tables_hold_the_data_of_sensors(heights, tunnels, wall_at):
    with gamms.create_context(logger_config={"level": "CRITICAL"}) as ctx:
        for node, (height, tunnel) in enumerate(zip(heights, tunnels, strict=True)):
            ctx.graph.graph.add_node({"id": node, "x": 40.0 * node, "y": 0.0, "z": height, "underground": tunnel})
        ctx.graph.add_obstacles(wall(wall_at))
        plain = [seen(ctx, node, sensor_range=130.0) for node in range(5)]
        table = ctx.graph.visibility(130.0, path=False)
        assert [table.from_node(node).tolist() for node in range(5)] == plain
        ctx.graph.graph.update_node({"id": 0, "z": 100.0})
        assert ctx.graph.visibility_table(130.0) is None


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
