"""A sensor that looks for agents says on which nodes it would show one, and how probably."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

import gamms
from gamms.agent import AgentType
from gamms.errors import NotOffered
from gamms.sensor import SensorType

KINDS = ["AGENT", "AGENT_RANGE", "AGENT_ARC", "OCCLUDED_AGENT", "AERIAL_AGENT", "OCCLUDED_AERIAL_AGENT"]


def world():
    ctx = gamms.create_context(seed=1, logger_config={"level": "CRITICAL"})
    ctx.graph.attach_networkx_graph(gamms.graph.grid(5, 5))
    wall = [(18.0, 12.0), (22.0, 28.0)]
    (x0, y0), (x1, y1) = wall
    ctx.graph.add_obstacle_face(1, tr=(x1, y1, 9), tl=(x0, y0, 9), br=(x1, y1, 0), bl=(x0, y0, 0), type=1)
    return ctx


@given(kind=st.sampled_from(KINDS), node=st.integers(0, 24), reach=st.floats(0, 60), fov=st.floats(0.1, 6.0))
def test_it_covers_the_nodes_on_which_an_agent_is_seen_and_no_others(kind, node, reach, fov):
    with world() as ctx:
        type = AgentType.AERIAL if "AERIAL" in kind else AgentType.BASIC
        owner = ctx.agent.create_agent("owner", start_node_id=node, type=type, speed=1.0)
        sensor = ctx.sensor.create_sensor("eyes", SensorType[kind], sensor_range=reach, fov=fov)
        owner.register_sensor("eyes", sensor)
        if type is AgentType.AERIAL:
            owner.position = (*owner.position[:2], 3.0)
        else:
            owner.orientation = (0.6, 0.8)
        other = ctx.agent.create_agent("other", start_node_id=0)
        seen = []
        for place in range(25):
            other.current_node_id = place
            sensor.sense(node)
            seen += [place] * ("other" in sensor.data)
        covered = sensor.coverage(node)
        assert covered.node_ids.tolist() == seen
        assert covered.detection.tolist() == [1.0] * len(seen)
        assert covered.not_shown == ()


def test_a_sensor_that_does_not_look_for_agents_does_not_offer_it():
    with world() as ctx, pytest.raises(NotOffered, match="coverage"):
        ctx.sensor.create_sensor("near", SensorType.NEIGHBOR).coverage(0)


def test_coverage_past_obstacles_follows_the_walls_the_map_and_the_settings():
    with world() as ctx:
        eyes = ctx.sensor.create_sensor("eyes", SensorType.OCCLUDED_AGENT, sensor_range=60.0)
        first = set(eyes.coverage(10).node_ids.tolist())
        assert set(eyes.coverage(0).node_ids.tolist()) != first
        ctx.graph.add_obstacle_face(2, tr=(5, 45, 9), tl=(5, -5, 9), br=(5, 45, 0), bl=(5, -5, 0), type=1)
        assert set(eyes.coverage(10).node_ids.tolist()) == {0, 5, 10, 15, 20}
        ctx.graph.add_nodes([99], [0.0], [33.0])
        assert set(eyes.coverage(10).node_ids.tolist()) == {0, 5, 10, 15, 20, 99}
        eyes.range = 12.0
        assert set(eyes.coverage(10).node_ids.tolist()) == {5, 10, 15}
        eyes.observer_height = 10.0
        assert set(eyes.coverage(10).node_ids.tolist()) == {5, 10, 11, 15}
