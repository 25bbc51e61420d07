"""Who carries a sensor, and that what it handed out is the caller's."""

import pytest

import gamms
from gamms.sensor import SensorType, views
from gamms.typing import ISensor

KINDS = [kind.name for kind in list(SensorType)[1:8]]


@pytest.fixture
def two(ctx):
    return [ctx.agent.create_agent(name, start_node_id=node) for node, name in enumerate("ab")]


@pytest.mark.parametrize("kind", KINDS)
def test_a_result_is_fresh_and_changing_it_changes_nothing_later(ctx, two, kind):
    sensor, twin = (ctx.sensor.create_sensor(name, SensorType[kind]) for name in ("s", "t"))
    sensor.sense(0)
    first = sensor.data
    twin.sense(0)
    expected = twin.data
    assert first == expected
    assert first is not expected
    for part in first.values() if isinstance(first, dict) and "nodes" in first else ():
        part.clear()
    first.clear()
    sensor.sense(0)
    assert sensor.data == expected == twin.data
    assert sensor.data is not first


def test_update_takes_anything_and_does_nothing(ctx):
    sensor = ctx.sensor.create_sensor("s", SensorType.MAP)
    assert sensor.update({"nodes": 3}) is None
    assert sensor.update(None) is None
    assert sensor.data == {}


def test_a_shared_sensor_under_two_names_stays_shared_without_one_of_them(ctx, two):
    sensor = ctx.sensor.create_sensor("s", SensorType.AGENT)
    for agent, name in ((two[0], "s"), (two[0], "again"), (two[1], "s")):
        agent.register_sensor(name, sensor)
    two[0].deregister_sensor("again")
    assert two[0].get_state()["sensor"] == {"s": (SensorType.AGENT, {"b": 1})}


def test_a_sensor_that_no_agent_carries_any_more_has_no_owner(ctx, two):
    sensor = ctx.sensor.create_sensor("s", SensorType.AGENT)
    two[0].register_sensor("s", sensor)
    two[0].deregister_sensor("s")
    sensor.sense(0)
    assert sensor.data == {"a": 0, "b": 1}


def test_two_states_from_a_shared_sensor_do_not_share_data(ctx, two):
    sensor = ctx.sensor.create_sensor("s", SensorType.NEIGHBOR)
    for agent in two:
        agent.register_sensor("s", sensor)
    states = [agent.get_state() for agent in two]
    assert [state["sensor"]["s"][1] for state in states] == [[0, 1, 2, 3, 4], [1, 0]]


def test_one_sensor_may_be_carried_under_two_names(ctx, two):
    sensor = ctx.sensor.create_sensor("s", SensorType.NEIGHBOR)
    two[1].register_sensor("x", sensor)
    two[1].register_sensor("y", sensor)
    assert two[1].get_state()["sensor"] == {name: (SensorType.NEIGHBOR, [1, 0]) for name in ("x", "y")}


def test_a_sensor_of_the_users_own_class_needs_no_owner_attribute(ctx, two):
    class Own(ISensor):
        sensor_id, type, data = "own", SensorType.CUSTOM, None
        told = ()

        def sense(self, node_id):
            self.data = node_id * 10

        def update(self, data):
            self.data = data

        def set_owner(self, owner):
            self.told = (*self.told, owner)

    own = Own()
    ctx.sensor.add_sensor(own)
    two[1].register_sensor("own", ctx.sensor.get_sensor("own"))
    assert two[1].get_state()["sensor"]["own"] == (SensorType.CUSTOM, 10)
    ctx.agent.delete_agent("b")
    assert own.told == ("b", None)


def test_views_are_cached_within_bounds_and_dropped_after_an_edit(ctx, monkeypatch):
    monkeypatch.setattr(views, "_MOST_WORDS", 1000)
    sensor = ctx.sensor.create_sensor("s", SensorType.ARC, fov=1.0)
    for turn in range(300):
        sensor.orientation = (1.0, turn / 100)
        sensor.sense(0)
    memo = ctx.sensor.storage.memory.views
    assert 0 < len(memo._seen) <= 10
    assert memo._words <= 1000
    ctx.graph.graph.update_node({"id": 1, "x": 2})
    sensor.sense(0)
    assert len(memo._seen) == 1


def test_a_view_too_large_to_remember_is_seen_all_the_same(ctx, monkeypatch):
    monkeypatch.setattr(views, "_MOST_WORDS", 10)
    sensor = ctx.sensor.create_sensor("s", SensorType.MAP)
    for _ in range(2):
        sensor.sense(0)
        assert len(sensor.data["nodes"]) == 6
    assert ctx.sensor.storage.memory.views._seen == {}


def test_a_shared_sensor_leaves_out_the_agent_that_asks_also_after_a_reset():
    seen = []

    def note(state):
        seen.append({name: sorted(data) for name, (_, data) in state["sensor"].items()})
        state["action"] = state["curr_pos"]

    def change(ctx):
        if ctx.game.turn == 1:
            ctx.agent.get_agent("ann").deregister_sensor("eyes")
            ctx.agent.delete_agent("bob")

    with gamms.create_context(seed=1) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(2, 2))
        ctx.sensor.create_sensor("eyes", SensorType.AGENT, sensor_range=1e9)
        ctx.agent.create_agent("ann", start_node_id=0, sensors=["eyes"], strategy=note)
        ctx.agent.create_agent("bob", start_node_id=3, sensors=["eyes"], strategy=gamms.strategies.stay)
        ctx.game.add(change)
        ctx.game.run(2)
        ctx.game.reset()
        ctx.game.run(2)
    assert seen == [{"eyes": ["bob"]}, {}] * 2
