"""Sensors: they report what an agent sees from its position.

Read `catalog.py` first: the table of all kinds of sensors. A new kind is one row and one factory there.
May import: typing, kernels, ir and below, never another engine.
"""

from gamms.errors import suggest_names as _suggest_names
from gamms.kernels import multiply_quaternions, quaternion_to_direction
from gamms.sensor.air import AerialAgentSensor, AerialSensor, OccludedAerialAgentSensor, OccludedAerialSensor
from gamms.sensor.catalog import (
    aerial,
    aerial_agent,
    agent,
    agent_arc,
    agent_range,
    arc,
    from_function,
    map,  # noqa: A004 - the name of a kind of sensor
    neighbor,
    occluded_aerial,
    occluded_aerial_agent,
    occluded_agent,
    occluded_map,
    range,  # noqa: A004 - as above
)
from gamms.sensor.engine import SensorEngine
from gamms.sensor.function import FunctionSensor
from gamms.sensor.ground import AgentSensor, MapSensor, NeighborSensor, OccludedAgentSensor, OccludedMapSensor
from gamms.typing.sensor_engine import ISensor, ISensorEngine, SensorDeclaration, SensorType

__all__ = [
    "AerialAgentSensor",
    "AerialSensor",
    "AgentSensor",
    "FunctionSensor",
    "ISensor",
    "ISensorEngine",
    "MapSensor",
    "NeighborSensor",
    "OccludedAerialAgentSensor",
    "OccludedAerialSensor",
    "OccludedAgentSensor",
    "OccludedMapSensor",
    "SensorDeclaration",
    "SensorEngine",
    "SensorType",
    "aerial",
    "aerial_agent",
    "agent",
    "agent_arc",
    "agent_range",
    "arc",
    "from_function",
    "map",
    "multiply_quaternions",
    "neighbor",
    "occluded_aerial",
    "occluded_aerial_agent",
    "occluded_agent",
    "occluded_map",
    "quaternion_to_direction",
    "range",
]

_suggest_names(__name__, __all__)
