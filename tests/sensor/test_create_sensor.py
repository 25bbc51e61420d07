"""Creating and finding sensors: defaults, keywords, errors."""

from math import inf, pi, sqrt

import numpy as np
import pytest

import gamms
from gamms.errors import GammsError
from gamms.sensor import AgentSensor, MapSensor, NeighborSensor, SensorType


@pytest.mark.parametrize(
    ("kind", "made", "radius", "fov"),
    [
        ("MAP", MapSensor, inf, 2 * pi),
        ("RANGE", MapSensor, 30.0, 2 * pi),
        ("ARC", MapSensor, 30.0, 2 * pi),
        ("AGENT", AgentSensor, inf, 2 * pi),
        ("AGENT_RANGE", AgentSensor, 30.0, 2 * pi),
        ("AGENT_ARC", AgentSensor, 30.0, 2 * pi),
    ],
)
def test_the_defaults_of_each_kind(ctx, kind, made, radius, fov):
    sensor = ctx.sensor.create_sensor("s", SensorType[kind])
    assert type(sensor) is made
    assert (sensor.type, sensor.sensor_id, sensor.data) == (SensorType[kind], "s", {})
    assert (sensor.range, sensor.fov, sensor.orientation, sensor._owner) == (radius, fov, (1.0, 0.0), None)
    assert ctx.sensor.get_sensor("s") is ctx.sensor.sensors["s"] is sensor
    assert isinstance(sensor, gamms.typing.ISensor)


def test_the_defaults_of_a_neighbor_sensor(ctx):
    sensor = ctx.sensor.create_sensor("s", SensorType.NEIGHBOR)
    assert (type(sensor), sensor.type, sensor.data) == (NeighborSensor, SensorType.NEIGHBOR, [])


@pytest.mark.parametrize(
    ("kind", "radius", "fov", "orientation"),
    [
        ("MAP", inf, 2 * pi, (1, 0)),
        ("RANGE", 5.0, 2 * pi, (1, 0)),
        ("ARC", 5.0, 2.5, (0, 1)),
        ("AGENT", inf, 2.5, (0, 1)),
        ("AGENT_RANGE", 5.0, 2 * pi, (1, 0)),
        ("AGENT_ARC", 5.0, 2.5, (0, 1)),
    ],
)
def test_each_kind_honours_its_own_keywords_and_ignores_the_rest(ctx, heard, kind, radius, fov, orientation):
    given = {"type": SensorType[kind], "sensor_range": 5, "fov": 2.5, "orientation": (0, 2), "colour": "red"}
    sensor = ctx.sensor.create_sensor("s", given["type"], **given)
    assert (sensor.range, sensor.fov, sensor.orientation) == (radius, fov, orientation)
    assert [warning.split(" It takes")[0] for warning in heard] == [f"Sensor 's': {kind} ignores colour=."]


def test_the_type_may_be_given_by_name(ctx):
    sensor = ctx.sensor.create_sensor("camera", type=SensorType.ARC, sensor_range=50, fov=2.5)
    assert (sensor.type, sensor.range, sensor.fov) == (SensorType.ARC, 50.0, 2.5)


def test_a_misspelt_keyword_is_warned_about(ctx, heard):
    ctx.sensor.create_sensor("s", SensorType.RANGE, sensor_rang=5)
    assert heard == ["Sensor 's': RANGE ignores sensor_rang=. Did you mean 'sensor_range'?"]


@pytest.mark.parametrize(
    ("kind", "name", "way_out"),
    [
        (SensorType.AGENT_RANGE, "range", "Did you mean 'range_m'?"),
        (SensorType.RANGE, "radius", "Did you mean 'range_m'?"),
        (SensorType.ARC, "angle", "Did you mean 'fov'?"),
        (SensorType.RANGE, "color", "It takes: at, range_m, sensor_range."),
        (SensorType.MAP, "team", "These kinds take it: AGENT, AGENT_RANGE"),
        (SensorType.NEIGHBOR, "range", "It takes none."),
    ],
)
def test_a_keyword_that_a_kind_ignores_is_named_with_the_one_it_takes(ctx, heard, kind, name, way_out):
    ctx.sensor.create_sensor("s", kind, **{name: 60})
    (warning,) = heard
    assert warning.startswith(f"Sensor 's': {kind.name} ignores {name}=. {way_out}")


@pytest.mark.parametrize("kind", [SensorType.ARC, SensorType.AERIAL])
def test_a_field_of_view_in_degrees_is_warned_about(ctx, heard, kind):
    ctx.sensor.create_sensor("eye", kind, sensor_range=5.0, fov=90)
    for i, fov in enumerate((2 * pi, 6.2832, inf)):
        ctx.sensor.create_sensor(f"round {i}", kind, sensor_range=5.0, fov=fov)
    assert heard == ["Sensor 'eye' sees everything: fov=90 is in radians. Did you mean math.radians(90)?"]


def test_an_ignored_keyword_is_warned_about_once_for_each_kind(ctx, heard):
    for i in range(3):
        ctx.sensor.create_sensor(f"a{i}", SensorType.RANGE, range=60)
        ctx.sensor.create_sensor(f"b{i}", SensorType.AGENT_RANGE, range=60)
    assert [warning.split(" ignores")[0] for warning in heard] == ["Sensor 'a0': RANGE", "Sensor 'b0': AGENT_RANGE"]


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("neighbour", "Unknown sensor type 'neighbour' for sensor 's'. Did you mean 'neighbor'?"),
        ("SensorType.ARK", "Did you mean 'ARC'?"),
        ("x", "Use a SensorType: NEIGHBOR, MAP"),
        (3, "Unknown sensor type 3"),
        (None, "Unknown sensor type None"),
        (SensorType.CUSTOM, "A custom sensor is an object of your own class"),
        (["odd"], "Unknown sensor type"),
    ],
)
def test_an_unknown_type_is_a_value_error_that_says_what_to_write(ctx, kind, words):
    with pytest.raises(ValueError, match="Unknown sensor type") as caught:
        ctx.sensor.create_sensor("s", kind)
    assert isinstance(caught.value, GammsError)
    assert words in str(caught.value)
    assert ctx.sensor.sensors == {}


def test_every_published_kind_is_built(ctx):
    for kind in list(SensorType)[1:14]:
        assert ctx.sensor.create_sensor(kind.name, kind).type is kind


def test_a_taken_name_is_a_value_error_and_the_first_sensor_stays(ctx):
    first = ctx.sensor.create_sensor("s", SensorType.RANGE)
    with pytest.raises(ValueError, match="already a sensor named 's'"):
        ctx.sensor.create_sensor("s", SensorType.NEIGHBOR)
    with pytest.raises(ValueError, match="already"):
        ctx.sensor.add_sensor(NeighborSensor(ctx, "s"))
    assert ctx.sensor.get_sensor("s") is first


def test_an_unknown_sensor_is_a_key_error_with_the_nearest_name(ctx):
    ctx.sensor.create_sensor("camera", SensorType.RANGE)
    with pytest.raises(KeyError, match=r"^Unknown sensor 'camra'. Did you mean 'camera'\?$"):
        ctx.sensor.get_sensor("camra")
    with pytest.raises(KeyError):
        ctx.sensor.get_sensor(["camera"])


@pytest.mark.parametrize("keyword", ["range_m", "fov"])
@pytest.mark.parametrize(
    ("value", "error"),
    [(-1, ValueError), (float("nan"), ValueError), (-inf, ValueError), ("5", TypeError), (None, TypeError)],
)
@pytest.mark.parametrize("kind", ["ARC", "AGENT_ARC"])
def test_an_impossible_range_or_fov_is_refused(ctx, kind, keyword, value, error):
    with pytest.raises(error, match=f"{keyword} of 's'"):
        ctx.sensor.create_sensor("s", SensorType[kind], **{keyword: value})
    assert ctx.sensor.sensors == {}


@pytest.mark.parametrize("value", [(0, 0), (1,), (1, 2, 3), None, "ab", (inf, 0), (float("nan"), 1)])
def test_an_impossible_orientation_is_refused(ctx, value):
    with pytest.raises(ValueError, match="orientation of 's'"):
        ctx.sensor.create_sensor("s", SensorType.ARC, orientation=value)
    assert ctx.sensor.sensors == {}


def test_a_keyword_that_is_set_as_an_attribute_is_warned_about(ctx, heard):
    sensor = ctx.sensor.create_sensor("s", SensorType.AGENT_RANGE, sensor_range=3)
    sensor.sensor_range, sensor.team = 5, "red"
    kept = "is a custom attribute; use sensor."
    assert heard == [f"Sensor 's': sensor.sensor_range {kept}range.", f"Sensor 's': sensor.team {kept}notice.team."]
    with pytest.raises(AttributeError, match=r"no attribute 'teem'\. Did you mean 'team'"):
        sensor.notice.teem = "red"


def test_an_orientation_is_kept_at_length_one_and_numpy_numbers_are_welcome(ctx):
    sensor = ctx.sensor.create_sensor(
        "s", SensorType.ARC, sensor_range=np.float32(5), fov=np.int64(2), orientation=np.array([2.0, 2.0])
    )
    assert sensor.orientation == pytest.approx((sqrt(0.5), sqrt(0.5)))
    assert (sensor.range, sensor.fov) == (5.0, 2.0)


@pytest.mark.parametrize(("name", "error"), [("", ValueError), (None, TypeError), (7, TypeError)])
def test_a_name_is_a_string(ctx, name, error):
    with pytest.raises(error):
        ctx.sensor.create_sensor(name, SensorType.MAP)


def test_only_sensors_can_be_added(ctx):
    with pytest.raises(TypeError, match="'camera' has no sensor_id, type, data, sense, update, set_owner"):
        ctx.sensor.add_sensor("camera")


def test_a_class_is_no_sensor_yet(ctx):
    with pytest.raises(TypeError, match="A sensor is an object with"):
        ctx.sensor.add_sensor(Plain)


class Plain:
    """A sensor that derives from nothing."""

    sensor_id, type = "plain", SensorType.CUSTOM

    def __init__(self):
        self.data, self.owner = None, None

    def sense(self, node_id):
        self.data = [node_id, self.owner]

    def update(self, data):
        pass

    def set_owner(self, owner):
        self.owner = owner


def test_a_config_is_not_changed(ctx):
    config = {"type": SensorType.RANGE, "sensor_range": 5}
    ctx.sensor.create_sensor("s", config["type"], **config)
    assert config == {"type": SensorType.RANGE, "sensor_range": 5}


def test_after_the_end_sensors_stay_readable_and_none_is_created(ctx):
    sensor = ctx.sensor.create_sensor("s", SensorType.NEIGHBOR)
    sensor.sense(0)
    ctx.terminate()
    assert ctx.sensor.get_sensor("s").data == [0, 1, 2, 3, 4]
    with pytest.raises(AttributeError, match="terminated"):
        ctx.sensor.create_sensor("new", SensorType.NEIGHBOR)
    with pytest.raises(AttributeError, match="terminated"):
        sensor.sense(0)
    assert sensor.data == [0, 1, 2, 3, 4]


@pytest.mark.parametrize("name", ["neighbor", "NEIGHBOR", "SensorType.NEIGHBOR"])
def test_a_kind_may_be_given_by_its_name(ctx, name):
    assert ctx.sensor.create_sensor("near", name).type is SensorType.NEIGHBOR
    assert ctx.sensor.create_sensor("far", type=name.lower()).type is SensorType.NEIGHBOR
