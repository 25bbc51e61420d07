"""Sensors of the user's own kind."""

import copy
import pickle

import pytest

import gamms
from gamms.sensor import MapSensor, SensorType
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
