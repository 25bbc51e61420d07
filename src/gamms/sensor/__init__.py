"""Sensors: they report what an agent sees from its position.

Read `catalog.py` first: the table of all kinds of sensors. A new kind is one row there.
May import: typing, kernels, ir and below, never another engine.
"""

from gamms.kernels import multiply_quaternions, quaternion_to_direction
from gamms.sensor.aerial import AerialAgentSensor, AerialSensor, OccludedAerialAgentSensor, OccludedAerialSensor
from gamms.sensor.engine import SensorEngine
from gamms.sensor.function import FunctionSensor
from gamms.sensor.ground import AgentSensor, MapSensor, NeighborSensor, OccludedAgentSensor, OccludedMapSensor
from gamms.typing.sensor_engine import ISensor, ISensorEngine, SensorType

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
    "SensorEngine",
    "SensorType",
    "multiply_quaternions",
    "quaternion_to_direction",
]
