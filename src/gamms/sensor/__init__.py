"""The sensor room: what an agent sees of the world from its node.

Read `catalog.py` first: it says which kinds there are and how each is made. A new kind is one file and one line
there. May import: typing, kernels, ir and below, never another room.
"""

from typing import Any

from gamms.errors import NotYetAttribute
from gamms.sensor.agents import AgentSensor
from gamms.sensor.engine import SensorEngine
from gamms.sensor.map import MapSensor
from gamms.sensor.neighbor import NeighborSensor
from gamms.typing.sensor_engine import ISensor, ISensorEngine, SensorType

__all__ = [
    "AgentSensor",
    "ISensor",
    "ISensorEngine",
    "MapSensor",
    "NeighborSensor",
    "SensorEngine",
    "SensorType",
]

_AERIAL = ("AerialSensor", "AerialAgentSensor", "multiply_quaternions", "quaternion_to_direction")
_OCCLUDED = ("OccludedMapSensor", "OccludedAgentSensor", "OccludedAerialSensor", "OccludedAerialAgentSensor")
LATER = {**dict.fromkeys(_AERIAL, "sensing from the air"), **dict.fromkeys(_OCCLUDED, "sensing past obstacles")}


def __getattr__(name: str) -> Any:
    if name in LATER:
        raise NotYetAttribute(LATER[name])
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
