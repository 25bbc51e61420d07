"""What programs hand over in odd forms: as much of it is recorded as can be."""

from types import MappingProxyType

import pytest
from games import copied, everything, recorded, replayed

from gamms.sensor import SensorType


@pytest.mark.parametrize(
    "sensors",
    [
        lambda ctx: (name for name in ("near", "map")),
        lambda ctx: {"near": None, "map": None}.keys(),
        lambda ctx: map(str, ("near", "map")),
        lambda ctx: MappingProxyType({"front": "near", "back": ctx.sensor.get_sensor("map")}),
    ],
    ids=["names", "keys", "map", "mapping"],
)
@pytest.mark.parametrize("version", [2, 3])
def test_sensors_given_as_any_iterable_are_recorded(ctx, sensors, version):
    def play(ctx):
        ctx.agent.create_agent("a", start_node_id=0, sensors=sensors(ctx))
        ctx.visual.simulate()

    data = recorded(play, ctx, version=version)
    carried = {name: sensor.sensor_id for name, sensor in ctx.agent.get_agent("a")._sensor_list.items()}
    assert list(carried.values()) == ["near", "map"]
    if version == 3:
        again, _ = replayed(data)
        assert everything(again) == everything(ctx)
        assert copied(data) == data
    else:
        ctx.agent.delete_agent("a")
        replayed(data, ctx)
        found = ctx.agent.get_agent("a")._sensor_list
        assert {name: sensor.sensor_id for name, sensor in found.items()} == carried


# -- what is no plain value -----------------------------------------------------------------------------------------


class Listener:
    """A logger that keeps its warnings."""

    def __init__(self):
        self.warnings = []

    def warning(self, message, *_):
        self.warnings.append(message)

    debug = info = error = critical = setLevel = lambda *_: None


@pytest.fixture
def heard(ctx):
    ctx.logger = Listener()
    return ctx.logger.warnings


@pytest.mark.parametrize(
    "value", [object(), {1, object}, [object()], {"a": {1, object}}], ids=["object", "set", "list", "dict"]
)
def test_map_values_that_are_not_plain_are_left_out_with_one_warning(ctx, heard, value):
    def play(ctx):
        for id in (20, 21, 22):
            ctx.graph.graph.add_node({"id": id, "x": 0.0, "y": 0.0, "foo": value if id > 20 else 7, "bar": id})
            ctx.graph.graph.update_edge({"id": id % 20, "closed_by": value})
            ctx.visual.simulate()

    data = recorded(play, ctx)
    again, _ = replayed(data)
    assert [again.graph.node_attributes(id) for id in (20, 21, 22)] == [{"foo": 7, "bar": 20}, {"bar": 21}, {"bar": 22}]
    assert again.graph.edge_attributes(0) == {}
    assert [message.split(" with ")[0] for message in heard] == ["Edge 0 has 'closed_by'", "Node 21 has 'foo'"]
    assert copied(data) == data


def test_values_that_are_not_plain_at_the_start_are_left_out_with_one_warning(ctx, heard, tmp_path):
    for id in (20, 21):
        ctx.graph.graph.add_node({"id": id, "x": 0.0, "y": 0.0, "owner": object()})
    ctx.agent.create_agent("a", start_node_id=20, brain=object(), size=3)
    ctx.sensor.create_sensor("eyes", SensorType.AGENT_RANGE, sensor_range=20.0, team=frozenset)
    ctx.agent.create_agent("b", start_node_id=20, brain=object(), sensors=["eyes"])
    data = recorded(lambda ctx: ctx.visual.simulate(), ctx)
    told = ["Node 20 and 1 more has 'owner'", "Agent 'a' has 'brain'", "Sensor 'eyes' has 'team'"]
    assert [message.split(" with ")[0] for message in heard] == told
    again, _ = replayed(data)
    assert vars(again.agent.get_agent("a")) == {"size": 3}
    assert list(again.agent.get_agent("b")._sensor_list) == ["eyes"]
    assert again.sensor.get_sensor("eyes").range == 20.0
    replayed(data, ctx)  # whose map is the same but for what cannot be written


@pytest.mark.parametrize("version", [2, 3])
def test_keywords_that_are_not_plain_are_left_out_with_one_warning(ctx, heard, version):
    def play(ctx):
        for name in "abc":
            ctx.agent.create_agent(name, start_node_id=0, brain=object(), meta={"team": 1, "plan": print})
        ctx.visual.simulate()

    data = recorded(play, ctx, version=version)
    assert [message.split(" with ")[0] for message in heard] == ["Agent 'a' has 'brain'", "Agent 'a' has 'meta'"]
    for name in "abc":
        ctx.agent.delete_agent(name)
    assert replayed(data, ctx)[0].agent.get_agent("a").meta == {"team": 1}
