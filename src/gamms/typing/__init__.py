"""Contracts: what each room promises (verbs). Values that cross rooms are here too: Node, OSMEdge, ObsFace.

Each contract has three parts: what you *must* write, what you *may* override for speed, what you get *free*.
Read `graph_engine.py` and `sensor_engine.py` first. May import: `gamms.ir` and below.
"""

from gamms.typing import logger
from gamms.typing.agent_engine import AgentType, IAerialAgent, IAgent, IAgentEngine
from gamms.typing.artist import ArtistType, IArtist
from gamms.typing.compute_engine import IComputeEngine, ITask
from gamms.typing.context import IContext
from gamms.typing.game import IConflicts, Move, Rule
from gamms.typing.graph_engine import IGraph, IGraphEngine, Node, ObsFace, OSMEdge
from gamms.typing.internal_context import IInternalContext
from gamms.typing.logger import ILogger
from gamms.typing.memory_engine import IMemoryEngine, IPathLike, IStore, StoreType
from gamms.typing.message_engine import IMessageEngine
from gamms.typing.opcodes import OpCodes
from gamms.typing.recorder import IRecorder
from gamms.typing.sensor_engine import ISensor, ISensorEngine, SensorOptions, SensorType
from gamms.typing.state import (
    Action,
    AerialAction,
    AerialState,
    AerialStrategy,
    AsyncStrategy,
    Draws,
    NodeAction,
    NodeId,
    State,
    Strategy,
)
from gamms.typing.visualization_engine import (
    AgentVisual,
    ColorType,
    GraphVisual,
    IVisualizationEngine,
    ObstacleVisual,
    SensorVisual,
)

__all__ = [
    "Action",
    "AerialAction",
    "AerialState",
    "AerialStrategy",
    "AgentType",
    "AgentVisual",
    "ArtistType",
    "AsyncStrategy",
    "ColorType",
    "Draws",
    "GraphVisual",
    "IAerialAgent",
    "IAgent",
    "IAgentEngine",
    "IArtist",
    "IComputeEngine",
    "IConflicts",
    "IContext",
    "IGraph",
    "IGraphEngine",
    "IInternalContext",
    "ILogger",
    "IMemoryEngine",
    "IMessageEngine",
    "IPathLike",
    "IRecorder",
    "ISensor",
    "ISensorEngine",
    "IStore",
    "ITask",
    "IVisualizationEngine",
    "Move",
    "Node",
    "NodeAction",
    "NodeId",
    "OSMEdge",
    "ObsFace",
    "ObstacleVisual",
    "OpCodes",
    "Rule",
    "SensorOptions",
    "SensorType",
    "SensorVisual",
    "State",
    "StoreType",
    "Strategy",
    "logger",
]
