"""Sensors that obstacles stop: named cases, and on random worlds the same as a brute force over all faces."""

from math import acos, atan2, inf, pi, remainder, sqrt

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gamms
from gamms.agent import AgentType
from gamms.sensor import SensorType


def wall(ctx, start, end, top=9.0, foot=0.0, id=1):
    (x0, y0), (x1, y1) = start, end
    ctx.graph.add_obstacle_face(id, (x1, y1, top), (x0, y0, top), (x1, y1, foot), (x0, y0, foot), 1)


def test_a_wall_hides_the_node_behind_it_and_the_street_to_it(ctx, sense):
    wall(ctx, (0.5, -0.5), (0.5, 0.5))
    seen = sense(SensorType.OCCLUDED_MAP)
    assert list(seen["nodes"]) == [0, 2, 3, 4, 5]
    assert [edge.id for edge in seen["edges"]] == [4, 5, 6, 7, 8, 9]
    assert list(sense(SensorType.RANGE)["nodes"]) == [0, 1, 2, 3, 4, 5]


def test_looks_from_many_nodes_past_a_wall_are_not_those_of_a_sensor_that_sees_through_it(ctx):
    wall(ctx, (0.5, -0.5), (0.5, 0.5))
    through = ctx.sensor.create_sensor("through", SensorType.RANGE, sensor_range=9.0)
    past = ctx.sensor.create_sensor("past", SensorType.OCCLUDED_MAP, sensor_range=9.0)
    through.sense(0)
    past.sense(0)
    assert past.sense_many([0]).values.tolist() == list(past.data["nodes"]) != list(through.data["nodes"])


@pytest.mark.parametrize(("height", "is_seen"), [(1.6, False), (2.0, False), (2.01, True), (0.4, True), (0.5, False)])
def test_a_sight_line_passes_over_a_low_wall_and_under_a_bridge(ctx, sense, height, is_seen):
    wall(ctx, (0.5, -0.5), (0.5, 0.5), top=2.0, foot=0.5)
    assert (1 in sense(SensorType.OCCLUDED_MAP, observer_height=height)["nodes"]) == is_seen


def test_range_and_field_of_view_count_as_without_obstacles(ctx, sense):
    wall(ctx, (0.5, -0.5), (0.5, 0.5))
    assert list(sense(SensorType.OCCLUDED_MAP, sensor_range=1.0)["nodes"]) == [0, 2, 3, 4]
    assert list(sense(SensorType.OCCLUDED_MAP, fov=pi / 2, orientation=(0, 1))["nodes"]) == [0, 2, 5]


@pytest.mark.parametrize(("height", "error"), [(float("nan"), ValueError), (inf, ValueError), ("high", TypeError)])
@pytest.mark.parametrize("kind", ["OCCLUDED_MAP", "OCCLUDED_AGENT"])
def test_an_impossible_height_is_refused(ctx, kind, height, error):
    with pytest.raises(error, match="observer_height of 's'"):
        ctx.sensor.create_sensor("s", SensorType[kind], observer_height=height)
    assert ctx.sensor.sensors == {}


def test_a_visibility_table_answers_until_the_world_changes(ctx):
    wall(ctx, (0.5, -0.5), (0.5, 0.5))
    ctx.agent.create_agent("hidden", start_node_id=1)
    ctx.agent.create_agent("seen", start_node_id=2)
    table = ctx.graph.visibility(5.0, 1.6, path=False)
    assert ctx.graph.visibility_table(5.0, 1.6) is table
    ground = ctx.sensor.create_sensor("m", SensorType.OCCLUDED_MAP, sensor_range=5.0)
    agents = ctx.sensor.create_sensor("a", SensorType.OCCLUDED_AGENT, sensor_range=5.0)
    for sensor in (ground, agents):
        sensor.sense(0)
    assert list(ground.data["nodes"]) == table.from_node(0).tolist() == [0, 2, 3, 4, 5]
    assert agents.data == {"seen": 2}
    ctx.graph.remove_obstacle_face(1)
    for sensor in (ground, agents):
        sensor.sense(0)
    assert 1 in ground.data["nodes"]
    assert "hidden" in agents.data


def test_a_wall_that_touches_the_eye_hides_what_the_rounding_of_1_0_0_says():
    wall = ((0.0, 2.0, 6.0), (1.0, -1.5, 6.0), (0.0, 2.0, 0.0), (1.0, -1.5, 0.0))
    assert not is_clear((0.0, 2.0, 1.6), (1.0, 1.0, 1.6), [wall])
    with built([(0, 2), (1, 1)], [wall], [], [], ()) as ctx:
        sensor = ctx.sensor.create_sensor("m", SensorType.OCCLUDED_MAP, sensor_range=2.0, observer_height=1.6)
        sensor.sense(0)
        assert list(sensor.data["nodes"]) == [0]


# -- brute force ------------------------------------------------------------------------------------------------


def minus(a, b):
    return tuple(p - q for p, q in zip(a, b, strict=True))


def dot(a, b):
    return sum(p * q for p, q in zip(a, b, strict=True))


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def meets(start, end, v0, v1, v2):
    """Möller and Trumbore, in plain Python."""
    ray, e1, e2 = minus(end, start), minus(v1, v0), minus(v2, v0)
    p = cross(ray, e2)
    det = dot(e1, p)
    if abs(det) < 1e-9:
        return False
    scale, s = 1.0 / det, minus(start, v0)  # the inverse, as in 1.0.0: the last bit decides where a wall touches an eye
    u = scale * dot(s, p)
    q = cross(s, e1)
    v, t = scale * dot(ray, q), scale * dot(e2, q)
    return 0 <= u <= 1 and v >= 0 and u + v <= 1 and 0 <= t <= 1


def is_clear(start, end, faces):
    return not any(meets(start, end, tl, tr, br) or meets(start, end, tl, br, bl) for tr, tl, br, bl in faces)


COORDINATE = st.integers(-6, 6).map(lambda i: i / 2)
POINT = st.tuples(COORDINATE, COORDINATE, st.integers(0, 8).map(float))
UPRIGHT = st.tuples(POINT, POINT).map(
    lambda ends: ((*ends[0][:2], 6.0), (*ends[1][:2], 6.0), (*ends[0][:2], 0.0), (*ends[1][:2], 0.0))
)
FACES = st.lists(st.one_of(UPRIGHT, st.tuples(POINT, POINT, POINT, POINT)), max_size=8)
PLACES = st.lists(st.tuples(st.integers(-3, 3), st.integers(-3, 3)), min_size=1, max_size=12)
RANGES = st.sampled_from([0.0, 1.0, 2.0, sqrt(2), sqrt(5), 5.0, inf])
FOVS = st.sampled_from([0.0, 1.0, pi / 2, pi, 2 * pi])
QUATS = st.sampled_from(
    [(1, 0, 0, 0), (sqrt(0.5), 0, sqrt(0.5), 0), (sqrt(0.5), 0, 0, sqrt(0.5)), (0.9, 0.1, 0.4, -0.2), (0, 0, 1, 0)]
)
HEADINGS = st.sampled_from([(1.0, 0.0), (0.0, -1.0), (0.6, 0.8)])


@st.composite
def worlds(draw):
    places, faces = draw(PLACES), draw(FACES)
    ends = st.integers(0, len(places) - 1)
    edges = draw(st.lists(st.tuples(ends, ends), max_size=12))
    walkers = draw(st.lists(ends, max_size=4))
    flyers = draw(st.lists(POINT, max_size=3))
    return places, faces, edges, walkers, flyers


def built(places, faces, edges, walkers, flyers):
    ctx = gamms.create_context(logger_config={"level": "CRITICAL"})
    ctx.graph.add_nodes(range(len(places)), [x for x, _ in places], [y for _, y in places])
    ctx.graph.add_edges(range(len(edges)), [a for a, _ in edges], [b for _, b in edges])
    for id, (tr, tl, br, bl) in enumerate(faces):
        ctx.graph.add_obstacle_face(id, tr, tl, br, bl, 1)
    for i, node in enumerate(walkers):
        ctx.agent.create_agent(f"w{i}", start_node_id=node)
    for i, place in enumerate(flyers):
        ctx.agent.create_agent(f"f{i}", type=AgentType.AERIAL, start_node_id=0, speed=1, position=place)
    return ctx


def ahead(dx, dy, heading, fov):
    if fov == 2 * pi or (dx, dy) == (0, 0):
        return True
    return abs(remainder(atan2(dy, dx) - atan2(heading[1], heading[0]), 2 * pi)) <= fov / 2 + 1e-9


@settings(max_examples=16)
@given(worlds(), RANGES, FOVS, HEADINGS, st.sampled_from([0.0, 1.0, 1.6, 6.0]), st.data())
def test_on_random_worlds_the_ground_looks_like_a_scan_of_all_faces(world, radius, fov, heading, height, data):
    places, faces, edges, walkers, _ = world
    observer = data.draw(st.integers(0, len(places) - 1))
    x, y = places[observer]
    start = (x, y, height)

    def is_seen(node):
        nx, ny = places[node]
        dx, dy = nx - x, ny - y
        return (
            dx * dx + dy * dy <= radius * radius + 1e-12
            and ahead(dx, dy, heading, fov)
            and is_clear(start, (nx, ny, height), faces)
        )

    with built(places, faces, edges, walkers, ()) as ctx:
        if data.draw(st.booleans()):
            ctx.graph.visibility(data.draw(st.sampled_from([radius, inf])), height, path=False)
        given = {"sensor_range": radius, "fov": fov, "orientation": heading, "observer_height": height}
        ground = ctx.sensor.create_sensor("m", SensorType.OCCLUDED_MAP, **given)
        agents = ctx.sensor.create_sensor("a", SensorType.OCCLUDED_AGENT, **given)
        for sensor in (ground, agents):
            sensor.sense(observer)
        nodes = [node for node in range(len(places)) if is_seen(node)]
        assert list(ground.data["nodes"]) == nodes
        assert [edge.id for edge in ground.data["edges"]] == [i for i, ends in enumerate(edges) if {*ends} <= {*nodes}]
        assert agents.data == {f"w{i}": node for i, node in enumerate(walkers) if is_seen(node)}


@settings(max_examples=16)
@given(worlds(), POINT, RANGES, FOVS, QUATS)
def test_on_random_worlds_the_view_from_the_air_is_that_of_a_scan(world, eye, radius, fov, quat):
    places, faces, edges, walkers, flyers = world
    length_of_quat = sqrt(sum(part * part for part in quat))
    axis = gamms.sensor.quaternion_to_direction(tuple(part / length_of_quat for part in quat))

    def is_ahead(place, widest):
        away = minus(place, eye)
        length = sqrt(dot(away, away))
        if length > radius + 1e-12:
            return False
        opening = min(fov, widest)
        if length == 0 or opening == 2 * pi:
            return True
        angle = acos(max(-1.0, min(1.0, dot(away, axis) / length)))
        return angle <= opening / 2 + 1e-7  # the rim is inside, and the arc cosine is not exact there

    with built(places, faces, edges, walkers, flyers) as ctx:
        kinds = ["AERIAL", "OCCLUDED_AERIAL", "AERIAL_AGENT", "OCCLUDED_AERIAL_AGENT"]
        given = {"at": eye, "sensor_range": radius, "fov": fov, "quat": quat}
        free, past, crowd, crowd_past = (ctx.sensor.create_sensor(kind, SensorType[kind], **given) for kind in kinds)
        for sensor in (free, past, crowd, crowd_past):
            sensor.sense()
        nodes = [id for id, (x, y) in enumerate(places) if is_ahead((x, y, 0.0), 0.9 * pi)]
        assert list(free.data["nodes"]) == nodes
        nodes = [id for id in nodes if is_clear(eye, (*places[id], 0.0), faces)]
        assert list(past.data["nodes"]) == nodes
        assert [edge.id for edge in past.data["edges"]] == [i for i, ends in enumerate(edges) if {*ends} <= {*nodes}]
        everybody = {f"w{i}": (AgentType.BASIC, (*map(float, places[node]), 0.0)) for i, node in enumerate(walkers)}
        everybody |= {f"f{i}": (AgentType.AERIAL, place) for i, place in enumerate(flyers)}
        seen = {name: one for name, one in everybody.items() if one[1] != eye and is_ahead(one[1], 2 * pi)}
        assert list(crowd.data.items()) == list(seen.items())
        seen = {name: one for name, one in seen.items() if is_clear(eye, one[1], faces)}
        assert list(crowd_past.data.items()) == list(seen.items())
