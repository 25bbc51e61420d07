"""What programs hand over in odd forms: as much of it is recorded as can be."""

from types import MappingProxyType

import pytest
from games import copied, everything, recorded, replayed


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
