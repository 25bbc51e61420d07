"""Which kinds of sensor there are, and how each is made from the caller's keywords: a table, not a ladder."""

from collections.abc import Callable
from math import inf, pi
from typing import TYPE_CHECKING, Any, NamedTuple

from gamms.sensor.agents import AgentSensor
from gamms.sensor.map import MapSensor
from gamms.sensor.neighbor import NeighborSensor
from gamms.typing.sensor_engine import ISensor, SensorType

if TYPE_CHECKING:
    from gamms.sensor.engine import SensorEngine

FORWARD = (1.0, 0.0)


class Kind(NamedTuple):
    """How to make a sensor of one type."""

    make: Callable[["SensorEngine", str, SensorType, dict[str, Any]], ISensor]
    defaults: dict[str, Any]  # the keywords it honours


def _neighbor(engine: "SensorEngine", sensor_id: str, kind: SensorType, _: dict[str, Any]) -> ISensor:
    return NeighborSensor(engine.ctx, sensor_id, kind)


def _map(engine: "SensorEngine", sensor_id: str, kind: SensorType, given: dict[str, Any]) -> ISensor:
    return MapSensor(engine.ctx, sensor_id, kind, **{"sensor_range": inf, **given}, views=engine.views)


def _agent(engine: "SensorEngine", sensor_id: str, kind: SensorType, given: dict[str, Any]) -> ISensor:
    return AgentSensor(engine.ctx, sensor_id, kind, **{"sensor_range": inf, **given}, crowd=engine.crowd)


KINDS: dict[SensorType, Kind] = {
    SensorType.NEIGHBOR: Kind(_neighbor, {}),
    SensorType.MAP: Kind(_map, {}),
    SensorType.RANGE: Kind(_map, {"sensor_range": 30.0}),
    SensorType.ARC: Kind(_map, {"sensor_range": 30.0, "fov": 2.0 * pi, "orientation": FORWARD}),
    SensorType.AGENT: Kind(_agent, {"fov": 2.0 * pi, "orientation": FORWARD}),
    SensorType.AGENT_RANGE: Kind(_agent, {"sensor_range": 30.0}),
    SensorType.AGENT_ARC: Kind(_agent, {"sensor_range": 30.0, "fov": 2.0 * pi, "orientation": FORWARD}),
}

LATER: dict[SensorType, str] = {
    SensorType.AERIAL: "sensing from the air",
    SensorType.AERIAL_AGENT: "sensing from the air",
    SensorType.OCCLUDED_MAP: "sensing past obstacles",
    SensorType.OCCLUDED_AGENT: "sensing past obstacles",
    SensorType.OCCLUDED_AERIAL: "sensing past obstacles",
    SensorType.OCCLUDED_AERIAL_AGENT: "sensing past obstacles",
}
