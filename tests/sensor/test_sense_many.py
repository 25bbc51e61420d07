"""The array form of every sensor sees what one look after the other sees."""

import pickle
from math import pi

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gamms
from gamms.agent import AgentType
from gamms.sensor import SensorType
from gamms.sensor.catalog import KINDS

IDS = list(range(9))


def world(seed):
    """A 3 x 3 grid with a wall through it, five walkers and a drone, and one sensor of each kind on one of them."""
    ctx = gamms.create_context(seed=seed, logger_config={"level": "CRITICAL"})
    ctx.graph.add_nodes(IDS, [10.0 * (i % 3) for i in IDS], [10.0 * (i // 3) for i in IDS])
    pairs = [(i, i + 1) for i in IDS if i % 3 < 2] + [(i, i + 3) for i in IDS if i < 6]
    ctx.graph.add_edges(range(len(pairs)), [a for a, _ in pairs], [b for _, b in pairs])
    ctx.graph.add_obstacle_face(1, (5, 25, 9), (5, 5, 9), (5, 25, 0), (5, 5, 0), 1)
    for i in range(5):
        ctx.agent.create_agent(f"a{i}", start_node_id=2 * i % 9, team=i % 2)
    drone = ctx.agent.create_agent("drone", type=AgentType.AERIAL, start_node_id=4, speed=1.0, team=1)
    drone.position = (12.0, 11.0, 8.0)
    return ctx


def plain(sensor):
    """What one look saw, as the array form says it."""
    data, names = sensor.data, list(sensor.ctx.agent.positions.names)
    if sensor.type is SensorType.NEIGHBOR:
        return data, None
    if "nodes" in data:
        return list(data["nodes"]), [edge.id for edge in data["edges"]]
    return [names.index(name) for name in data], None


@settings(max_examples=12)
@given(st.data())
@pytest.mark.parametrize("kind", list(KINDS))
def test_many_looks_are_the_single_ones(kind, data):
    given = {
        "sensor_range": data.draw(st.sampled_from([0.0, 10.0, 14.2, 30.0])),
        "fov": data.draw(st.sampled_from([1.0, pi, 2 * pi])),
    }
    filters = data.draw(st.sampled_from([{}, {"team": 1}, {"exclude": 1}, {"detection": 0.5}]))
    asked = data.draw(st.lists(st.sampled_from(IDS), max_size=6))
    owner = data.draw(st.sampled_from([None, "a1", "drone"]))
    dead = data.draw(st.sampled_from([None, "a2"]))
    sensors = []
    contexts = [world(5), world(5)]
    for ctx in contexts:
        sensor = ctx.sensor.create_sensor("s", kind, **given, **(filters if "team" in KINDS[kind].list_names() else {}))
        if owner is not None and (owner == "drone" or "AERIAL" not in kind.name):
            ctx.agent.get_agent(owner).register_sensor("s", sensor)
            ctx.agent.get_agent("a1").orientation = (0.6, 0.8)
        sensors.append(sensor)
        if dead is not None:
            ctx.agent.get_agent(dead).alive = False
    many, one = sensors
    before = many.data
    sensed = many.sense_many(asked)
    assert len(sensed) == len(asked)
    assert many.data == before
    for look, node_id in enumerate(asked):
        one.sense(node_id)
        values, edges = plain(one)
        assert sensed[look].tolist() == values
        if edges is not None:
            assert sensed.edges[look].tolist() == edges
        elif kind is not SensorType.NEIGHBOR:
            assert [sensed.names[i] for i in sensed[look]] == list(one.data)
    for ctx in contexts:
        ctx.terminate()


@pytest.mark.parametrize("kind", [kind for kind in KINDS if "AERIAL" not in kind.name])
def test_an_unknown_node_among_many_is_named(kind):
    with world(1) as ctx:
        sensor = ctx.sensor.create_sensor("s", kind)
        with pytest.raises(KeyError, match="99"):
            sensor.sense_many([0, 99])


def test_sensor_data_of_the_map_can_be_pickled():
    with world(1) as ctx:
        sensed = ctx.sensor.create_sensor("s", "RANGE", sensor_range=10.0).sense_many([0, 4])
    copy = pickle.loads(pickle.dumps(sensed))
    assert copy[1].tolist() == [1, 3, 4, 5, 7]
    assert copy.edges[0].tolist() == sensed.edges[0].tolist() == [0, 6]


def test_a_sensor_whose_owner_is_no_agent_shows_all_agents():
    with world(1) as ctx:
        eye = ctx.sensor.create_sensor("eye", SensorType.AGENT_RANGE, sensor_range=100.0)
        eye.set_owner("nobody")
        found = eye.sense_many(IDS * 20)
        assert set(found.names) == set(ctx.agent.agents)
        assert len(found.values) == len(IDS) * 20 * len(found.names)
