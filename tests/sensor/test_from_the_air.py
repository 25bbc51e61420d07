"""AERIAL and AERIAL_AGENT: what is seen along an axis from an agent that flies, or from a fixed place in the air."""

from math import dist, inf, pi, sqrt

import pytest

import gamms
from gamms.agent import AgentType
from gamms.sensor import SensorType, multiply_quaternions, quaternion_to_direction

HALF = sqrt(0.5)
LEVEL, DOWN, LEFT = (1.0, 0.0, 0.0, 0.0), (HALF, 0.0, HALF, 0.0), (HALF, 0.0, 0.0, HALF)


@pytest.fixture
def drone(ctx):
    drone = ctx.agent.create_agent("drone", type=AgentType.AERIAL, start_node_id=0, speed=1.0)
    drone.position = (0.0, 0.0, 2.0)
    return drone


@pytest.fixture
def look(ctx, drone):
    def look(kind, **given):
        name = f"sensor_{len(ctx.sensor.sensors)}"
        drone.register_sensor(name, ctx.sensor.create_sensor(name, kind, **given))
        return drone.get_state()["sensor"][name][1]

    return look


def test_by_default_the_ground_straight_below_is_seen(look):
    seen = look(SensorType.AERIAL)
    assert list(seen["nodes"]) == [0, 1, 2, 3, 4]  # at most 1.15 aside of a point 2 below
    assert len(seen["edges"]) == 8


def test_a_node_at_the_rim_of_the_cone_or_of_the_range_is_seen(look, drone):
    drone.position = (0.0, 0.0, 1.0)
    assert list(look(SensorType.AERIAL, fov=pi / 2)["nodes"]) == [0, 1, 2, 3, 4]
    assert list(look(SensorType.AERIAL, fov=pi / 2 - 1e-6)["nodes"]) == [0]
    assert list(look(SensorType.AERIAL, fov=pi / 2, sensor_range=sqrt(2))["nodes"]) == [0, 1, 2, 3, 4]
    assert list(look(SensorType.AERIAL, fov=pi / 2, sensor_range=1.4)["nodes"]) == [0]


def test_the_range_counts_in_space(look, drone):
    drone.position = (0.0, 0.0, 60.0)
    assert look(SensorType.AERIAL, sensor_range=50.0) == {"nodes": {}, "edges": []}
    assert len(look(SensorType.AERIAL, sensor_range=inf)["nodes"]) == 6


def test_a_node_without_streets_and_one_at_the_drone_itself_are_seen(look, drone):
    drone.position = (3.0, 4.0, 0.0)
    assert list(look(SensorType.AERIAL, sensor_range=0.0)["nodes"]) == [5]


def test_a_cone_that_looks_at_the_ground_is_at_most_nine_tenths_of_a_half_circle_wide(ctx, look, drone):
    drone.position = (0.0, 0.0, 0.1)
    assert list(look(SensorType.AERIAL, fov=2 * pi)["nodes"]) == [0]
    assert ctx.sensor.get_sensor("sensor_0").fov == 0.9 * pi


def test_without_an_owner_and_a_place_nothing_is_seen(ctx):
    for kind, nothing in ((SensorType.AERIAL, {"nodes": {}, "edges": []}), (SensorType.AERIAL_AGENT, {})):
        sensor = ctx.sensor.create_sensor(kind.name, kind)
        assert sensor.data == {}
        sensor.sense(0)
        assert sensor.data == nothing


@pytest.mark.parametrize("metres", [0.0, 2.0, 5.0, inf])
def test_many_looks_at_one_moment_see_the_same(ctx, drone, metres):
    for number in range(12):
        flyer = ctx.agent.create_agent(f"flyer_{number}", type=AgentType.AERIAL, start_node_id=0, speed=1.0)
        flyer.position = (number - 5.0, number % 3, 2.0)
    ctx.agent.get_agent("flyer_6").alive = False
    eyes = ctx.sensor.create_sensor("eyes", SensorType.AERIAL_AGENT, sensor_range=metres)
    drone.register_sensor("eyes", eyes)
    looks = eyes.sense_many([0] * 20)
    assert all(looks[i].tolist() == looks[0].tolist() for i in range(20))
    assert bool(len(looks[0])) == (metres > 0)


def test_looks_between_moves_of_single_agents_among_many_see_what_a_scan_of_all_does():
    with gamms.create_context(logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(34, 34, 1.0))
        xy = {node: ctx.graph.graph.get_node(node)[1:] for node in range(34 * 34)}
        ctx.agent.create_team("ant", xy)
        kites = [
            ctx.agent.create_agent(f"kite_{i}", type="AERIAL", speed=1.0, start_node_id=0, position=(i, i, 1.0))
            for i in range(4)
        ]
        kites[3].alive = ctx.agent.get_agent("ant_35").alive = False
        kinds = ("AERIAL_AGENT", "OCCLUDED_AERIAL_AGENT")
        sensors = [ctx.sensor.create_sensor(kind, kind, sensor_range=2.5) for kind in kinds]
        for sensor in sensors:
            kites[0].register_sensor(sensor.sensor_id, sensor)

        def look_again(times):
            others = [one for one in ctx.agent.create_iter() if one.alive and one is not kites[0]]
            places = {one.name: (one.type, one.position) for one in others if one in kites}
            ants = {one.name: (one.type, (*xy[one.current_node_id], 0.0)) for one in others if one not in kites}
            expected = {
                name: seen
                for name, seen in (ants | places).items()
                if 0.0 < dist(kites[0].position, seen[1]) <= sensors[0].range
            }
            for _ in range(times):
                for sensor in sensors:
                    sensor.sense()
                    assert list(sensor.data.items()) == list(expected.items())
            return expected

        for i in range(2):
            kites[0].position = (2.0 * i, 3.0, 1.0)
            look_again(1)
            kites[1].position = (2.0 * i + 1.0, 3.0, 0.5)
            ctx.agent.get_agent(f"ant_{1000 + i}").current_node_id = 3 * 34 + 2 * i
            assert {"kite_1", f"ant_{1000 + i}"} <= look_again(10 * i + 1).keys()


def test_an_agent_at_the_very_point_of_the_drone_is_not_seen_as_in_the_original(ctx, look, drone):
    twin = ctx.agent.create_agent("twin", type=AgentType.AERIAL, start_node_id=0, speed=1.0)
    twin.position = drone.position
    assert look(SensorType.AERIAL_AGENT) == {}
    twin.position = (0.0, 0.0, 2.001)
    assert list(look(SensorType.AERIAL_AGENT)) == ["twin"]


def test_sensors_on_the_ground_find_drones_at_the_nearest_node(sense, ctx, drone):
    drone.position = (2.9, 4.2, 40.0)
    assert sense(SensorType.AGENT_RANGE, node=5, sensor_range=0.0) == {"drone": 5}


@pytest.mark.parametrize(
    ("given", "error", "words"),
    [
        ({"quat": (0, 0, 0, 0)}, ValueError, "quat of 'eye' must not be zero"),
        ({"quat": (1, 0, 0)}, ValueError, r"quat of 'eye' must be \(w, x, y, z\)"),
        ({"quat": (1, 0, 0, float("nan"))}, ValueError, r"quat of 'eye' \(w, x, y, z\) must be finite"),
        ({"quat": "down"}, TypeError, "quat of 'eye' must be"),
        ({"quat": 1}, TypeError, "quat of 'eye' must be"),
        ({"sensor_range": -1}, ValueError, "range_m of 'eye' must not be negative"),
        ({"fov": float("nan")}, ValueError, "fov of 'eye' must be finite"),
        ({"at": (0, 0)}, ValueError, r"at of 'eye' must be \(x, y, z\)"),
        ({"at": 0}, TypeError, r"at of 'eye' must be \(x, y, z\)"),
    ],
)
@pytest.mark.parametrize("kind", ["AERIAL", "OCCLUDED_AERIAL_AGENT"])
def test_an_impossible_keyword_is_refused(ctx, kind, given, error, words):
    with pytest.raises(error, match=words):
        ctx.sensor.create_sensor("eye", SensorType[kind], **given)
    assert ctx.sensor.sensors == {}


def test_a_quaternion_is_kept_at_length_one(ctx):
    sensor = ctx.sensor.create_sensor("eye", SensorType.AERIAL, quat=(2, 0, 2, 0))
    assert sensor.quat == pytest.approx(DOWN)
    with pytest.raises(ValueError, match="must not be zero"):
        sensor.quat = (0, 0, 0, 0)
    assert sensor.quat == pytest.approx(DOWN)


def test_the_published_helpers_multiply_and_point():
    assert quaternion_to_direction(LEVEL) == (1.0, 0.0, 0.0)
    assert quaternion_to_direction(DOWN) == pytest.approx((0.0, 0.0, -1.0))
    assert multiply_quaternions(LEVEL, (0, 1, 0, 0)) == (0.0, 1.0, 0.0, 0.0)
    assert quaternion_to_direction(multiply_quaternions(LEFT, LEFT)) == pytest.approx((-1.0, 0.0, 0.0))
