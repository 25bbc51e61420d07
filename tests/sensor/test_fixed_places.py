"""Sensors that look from a place of their own: watch towers, balloons."""

from math import pi

import pytest

from gamms.agent import AgentType
from gamms.sensor import SensorType


def test_a_tower_looks_from_its_node_for_every_agent(ctx):
    tower = ctx.sensor.create_sensor("tower", SensorType.RANGE, sensor_range=1.0, at=5)
    for node in (None, 0, 1):
        tower.sense(node)
        assert list(tower.data["nodes"]) == [5]


def test_a_tower_may_stand_where_no_node_is(ctx):
    tower = ctx.sensor.create_sensor("tower", SensorType.RANGE, sensor_range=1.0, at=(0.5, 0.5))
    tower.sense()
    assert list(tower.data["nodes"]) == [0, 1, 2]
    assert [edge.id for edge in tower.data["edges"]] == [2, 3, 4, 5]


def test_a_tower_looks_in_its_own_direction_and_sees_its_owner(ctx):
    tower = ctx.sensor.create_sensor("tower", SensorType.AGENT_ARC, sensor_range=9.0, fov=1.0, at=3)
    scout = ctx.agent.create_agent("scout", start_node_id=0, sensors=["tower"])
    scout.orientation = (0.0, 1.0)
    assert scout.get_state()["sensor"]["tower"][1] == {"scout": 0}
    tower.orientation = (0.0, 1.0)
    assert scout.get_state()["sensor"]["tower"][1] == {}


def test_a_balloon_looks_from_the_air_without_an_owner(ctx):
    ctx.agent.create_agent("scout", start_node_id=1)
    ground = ctx.sensor.create_sensor("ground", SensorType.AERIAL, at=(0.0, 0.0, 1.0), fov=pi / 2)
    agents = ctx.sensor.create_sensor("agents", SensorType.AERIAL_AGENT, at=(0.0, 0.0, 1.0))
    ground.sense()
    agents.sense()
    assert list(ground.data["nodes"]) == [0, 1, 2, 3, 4]
    assert agents.data == {"scout": (AgentType.BASIC, (1.0, 0.0, 0.0))}


def test_a_balloon_on_a_rope_sees_its_drone_too(ctx):
    drone = ctx.agent.create_agent("drone", type=AgentType.AERIAL, start_node_id=0, speed=1)
    ctx.sensor.create_sensor("eye", SensorType.AERIAL_AGENT, at=(0.0, 0.0, 1.0))
    drone.register_sensor("eye", ctx.sensor.get_sensor("eye"))
    assert list(drone.get_state()["sensor"]["eye"][1]) == ["drone"]


def test_a_tower_whose_node_is_gone_says_so(ctx):
    tower = ctx.sensor.create_sensor("tower", SensorType.RANGE, at=5)
    ctx.graph.graph.remove_node(5)
    with pytest.raises(KeyError, match="Unknown node 5"):
        tower.sense()


@pytest.mark.parametrize(
    ("at", "error"),
    [(99, KeyError), ("a", TypeError), ((1,), ValueError), ((1, float("nan")), ValueError), (1.5, TypeError)],
)
def test_an_impossible_place_is_refused(ctx, at, error):
    with pytest.raises(error):
        ctx.sensor.create_sensor("tower", SensorType.RANGE, at=at)
    assert ctx.sensor.sensors == {}


def test_kinds_that_know_no_place_say_that_they_ignore_it(ctx, heard):
    ctx.sensor.create_sensor("near", SensorType.NEIGHBOR, at=5)
    ctx.sensor.create_sensor("map", SensorType.MAP, team="red", sensor_range=5.0)
    assert [warning.split(" AGENT")[0] for warning in heard] == [
        "Sensor 'near': NEIGHBOR ignores at=. These kinds take it: MAP, RANGE, ARC,",
        "Sensor 'map': MAP ignores team=. These kinds take it:",
    ]
