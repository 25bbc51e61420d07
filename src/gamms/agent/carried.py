"""Sensors in the form in which agents ask them."""

from collections.abc import Callable
from typing import Any

from gamms.typing.sensor_engine import Carried, ISensor, LiveData, owner_of


def carried(name: str, sensor: ISensor, own: str | None) -> Carried:
    """Return a sensor in this form; `own` names the agent that asks if others carry the sensor, too."""
    offered: Callable[[], Any] | None = getattr(sensor, "live_result", None)
    last = LiveData(sensor) if offered is None else offered()
    is_plain = own is None and type(last) is list
    lists = getattr(sensor, "lists", None) if is_plain else None
    return name, sensor.sense if is_plain else _Look(sensor, own), sensor, last, lists


class _Look:
    """Asks a sensor of a caller's class, or one that several agents carry, on behalf of one of them."""

    __slots__ = ("_own", "_sensor")

    def __init__(self, sensor: ISensor, own: str | None) -> None:
        self._sensor, self._own = sensor, own

    def __call__(self, node_id: int) -> None:
        sensor, own = self._sensor, self._own
        if own is None:
            sensor.sense(node_id)
            return
        owner = owner_of(sensor)
        sensor.set_owner(own)
        try:
            sensor.sense(node_id)
        finally:
            if owner not in (None, own):  # a look that no agent asks for is that of the one that registered it last
                sensor.set_owner(owner)
