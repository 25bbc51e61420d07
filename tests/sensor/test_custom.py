"""Sensors of the user's own kind."""

import copy
import pickle

import pytest

import gamms
from gamms.sensor import MapSensor, SensorType
from gamms.sensor.air import AerialAgentSensor
from gamms.sensor.catalog import derived
from gamms.sensor.ground import AgentSensor, NeighborSensor
from gamms.typing import ISensor


class Counter(ISensor):
    """Counts how often it looked; says nothing about its type, which the decorator does."""

    def __init__(self, name):
        self._name, self._data = name, 0

    @property
    def sensor_id(self):
        return self._name

    @property
    def data(self):
        return self._data

    def sense(self, node_id):
        self._data += 1

    def update(self, data):
        self._data = data

    def set_owner(self, owner):
        self.owner = owner


def test_a_decorated_class_senses_a_kind_of_its_own(ctx):
    made = ctx.sensor.custom(name="COUNTING")(Counter)
    assert made is Counter
    ctx.sensor.add_sensor(Counter("c"))
    agent = ctx.agent.create_agent("a", start_node_id=0, sensors=["c"])
    assert agent.get_state()["sensor"]["c"] == (SensorType.COUNTING, 1)
    assert agent.get_state()["sensor"]["c"] == (SensorType.COUNTING, 2)
    assert ctx.sensor.get_sensor("c").owner == "a"


def test_a_new_kind_is_a_full_member_of_the_enumeration(ctx):
    count = len(SensorType)
    name = f"NEW_{count}"  # kinds outlive the test
    ctx.sensor.custom(name)
    kind = getattr(SensorType, name)
    assert (kind.name, kind.value, len(SensorType)) == (name, count, count + 1)
    assert SensorType[name] is SensorType(count) is kind is list(SensorType)[-1]
    assert kind in SensorType
    assert isinstance(kind, SensorType)
    assert (str(kind), repr(kind)) == (f"SensorType.{name}", f"<SensorType.{name}: {count}>")
    assert pickle.loads(pickle.dumps(kind)) is copy.deepcopy(kind) is kind
    assert {kind: 1}[kind] == 1
    assert kind != SensorType.MAP
    assert getattr(gamms.typing.SensorType, name) is kind
    with pytest.raises(ValueError, match="A custom sensor is an object of your own class"):
        ctx.sensor.create_sensor("x", kind)


def test_a_kind_that_exists_is_used_again_with_a_warning(ctx, heard):
    first = ctx.sensor.custom("TWICE")(type("First", (Counter,), {}))
    heard.clear()
    second = ctx.sensor.custom("TWICE")(type("Second", (Counter,), {}))
    assert first("x").type is second("y").type is SensorType.TWICE
    assert heard == ["SensorType.TWICE exists already and is used again."]


def test_a_decorated_class_can_be_subclassed_and_decorated_again(ctx):
    parent = ctx.sensor.custom("PARENT")(type("Parent", (Counter,), {}))
    child = ctx.sensor.custom("CHILD")(type("Child", (parent,), {}))
    plain = type("Plain", (parent,), {})
    assert [made("x").type.name for made in (parent, child, plain)] == ["PARENT", "CHILD", "PARENT"]


def test_a_built_in_sensor_can_be_made_ones_own(ctx):
    @ctx.sensor.custom("TWO_STEPS")
    class TwoSteps(MapSensor):
        def sense(self, node_id):
            super().sense(node_id)
            self.data = sorted(self.data["nodes"])

    sensor = TwoSteps(ctx, "s", SensorType.RANGE, 1.0)
    ctx.sensor.add_sensor(sensor)
    sensor.sense(1)
    assert (sensor.type, sensor.data) == (SensorType.TWO_STEPS, [0, 1])
    assert ctx.sensor.create_sensor("r", SensorType.RANGE).type is SensorType.RANGE
    assert (MapSensor.sees_world_only, TwoSteps.sees_world_only) == (True, False)


def test_a_class_that_derives_from_nothing_becomes_a_sensor_by_being_decorated(ctx):
    @ctx.sensor.custom("DUCK")
    class Duck:
        sensor_id, data = "duck", None

        def sense(self, node_id):
            self.data = node_id

        def set_owner(self, owner):
            self.owner = owner

        def update(self, data):
            self.data = data

    ctx.sensor.add_sensor(Duck())
    agent = ctx.agent.create_agent("a", start_node_id=3, sensors=["duck"])
    assert agent.get_state()["sensor"]["duck"] == (SensorType.DUCK, 3)


@pytest.mark.parametrize("missing", ["sensor_id", "type", "data", "sense", "update", "set_owner"])
def test_a_sensor_that_lacks_something_cannot_be_made(missing):
    members = {name: None for name in ("sensor_id", "type", "data", "sense", "update", "set_owner") if name != missing}
    with pytest.raises(TypeError, match=missing):
        type("Partial", (ISensor,), members)()


@pytest.mark.parametrize(
    ("name", "error"),
    [
        ("mro", ValueError),
        ("name", ValueError),
        ("value", ValueError),
        ("_member_map_", ValueError),
        ("__init__", ValueError),
        ("two words", ValueError),
        ("", ValueError),
        (7, TypeError),
    ],
)
def test_a_bad_name_is_refused_and_adds_nothing(ctx, name, error):
    count = len(SensorType)
    with pytest.raises(error):
        ctx.sensor.custom(name)
    assert len(SensorType) == count


def test_kinds_live_longer_than_the_context_that_made_them(ctx):
    ctx.sensor.custom("SURVIVOR")
    ctx.terminate()
    assert SensorType.SURVIVOR.name == "SURVIVOR"


class TestDerived:
    """A class made by `derived` reads the data of the nearest kind, and the place of the look if it asks for it."""

    @pytest.fixture
    def ctx(self):
        with gamms.create_context(seed=1) as ctx:
            ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
            yield ctx

    def test_a_reader_of_data_alone_gets_no_place(self, ctx):
        sensor = derived(NeighborSensor, len)(ctx, "degree")
        sensor.sense(4)
        assert sensor.data == 5

    def test_a_reader_with_another_second_parameter_keeps_its_default(self, ctx):
        sensor = derived(NeighborSensor, lambda near, least=7: (len(near), least))(ctx, "degree")
        sensor.sense(4)
        assert sensor.data == (5, 7)

    def test_a_reader_with_a_place_gets_the_node_of_the_look(self, ctx):
        sensor = derived(NeighborSensor, lambda near, place: (place, near))(ctx, "around")
        assert sensor.data == (None, [])
        sensor.sense(8)
        assert (sensor.data[0], sorted(sensor.data[1])) == (8, [5, 7, 8])

    def test_agents_and_their_distances_are_read_in_one_turn(self, ctx):
        def nearest(seen, place):
            return min(seen, key=lambda name: abs(seen[name] - place))

        ctx.sensor.add_sensor(derived(AgentSensor, nearest)(ctx, "nearest", SensorType.AGENT_RANGE, 100.0))
        seen = []

        def note(state):
            seen.append(state["sensor"]["nearest"][1])

        ctx.agent.create_agent("anna", start_node_id=0, sensors=["nearest"], strategy=note)
        ctx.agent.create_agent("ben", start_node_id=4)
        ctx.agent.create_agent("cleo", start_node_id=3)
        ctx.game.run(1)
        assert seen == ["cleo"]
        assert ctx.agent.get_agent("anna").get_state()["sensor"]["nearest"][1] == "cleo"

    def test_data_from_a_place_is_computed_there(self, ctx):
        sensor = derived(NeighborSensor, lambda near, place: (place, len(near)))(ctx, "degree")
        sensor.sense(0)
        assert sensor.data_from(4, None) == (4, 5)
        assert sensor.data == (0, 3)

    def test_a_look_from_an_edge_has_the_position(self, ctx):
        sensor = derived(AgentSensor, lambda _, place: place)(ctx, "here", SensorType.AGENT_RANGE, 100.0)
        sensor.sense((2.5, 0.0))
        assert sensor.data == (2.5, 0.0)

    def test_a_look_from_the_air_has_the_position_in_the_air(self, ctx):
        sensor = derived(AerialAgentSensor, lambda _, place: place)(ctx, "here", 100.0)
        assert sensor.data is None
        sensor.at = (1.0, 2.0, 3.0)
        sensor.sense()
        assert sensor.data == (1.0, 2.0, 3.0)
