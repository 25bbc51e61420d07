"""Sensors in the form in which agents ask them."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from gamms.typing.sensor_engine import Carried, ISensor, LiveData, SensorType, owner_of


def carried(name: str, sensor: ISensor, own: str | None, near: Mapping[int, Sequence[int]]) -> Carried:
    """Return a sensor in this form.

    Args:
        name: what it is called in the agent's state.
        sensor: the sensor.
        own: the agent that asks, if others carry the sensor, too.
        near: the neighbourhoods of the agent's graph.
    """
    offered: Callable[[], Any] | None = getattr(sensor, "live_result", None)
    last = LiveData(sensor) if offered is None else offered()
    if own is not None:
        return name, last, None, _Look(sensor, own)
    if type(last) is list and getattr(sensor, "neighborhoods", None) is near:
        # NOTE: without the sensor, which would be read from memory at every look (benchmarks: turns).
        return name, last, sensor.type, None
    return name, last, None, sensor


class _Look:
    """Asks a sensor that several agents carry on behalf of one of them."""

    __slots__ = ("_own", "_sensor", "sees_world_only")

    def __init__(self, sensor: ISensor, own: str) -> None:
        self._sensor, self._own = sensor, own
        self.sees_world_only = getattr(sensor, "sees_world_only", False)

    @property
    def type(self) -> SensorType:
        return self._sensor.type

    def sense(self, node_id: int) -> None:
        sensor, own = self._sensor, self._own
        owner = owner_of(sensor)
        sensor.set_owner(own)
        try:
            sensor.sense(node_id)
        finally:
            if owner not in (None, own):  # a look that no agent asks for is that of the one that registered it last
                sensor.set_owner(owner)
