"""Contracts of the engines, and values that several engines use: Node, OSMEdge, ObsFace, State.

A contract has three parts: methods to implement, methods to override for speed, and methods with a default.
Read `graph_engine.py`, `sensor_engine.py` and `game.py` first. May import: `gamms.kernels` and below.
"""

from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING

from gamms.errors import list_names as _list_names
from gamms.typing import logger
from gamms.typing.agent_engine import AgentType, IAerialAgent, IAgent, IAgentEngine
from gamms.typing.context import IContext
from gamms.typing.game import (
    Action,
    AerialAction,
    AerialState,
    AerialStrategy,
    AsyncStrategy,
    ChannelOptions,
    Draws,
    EdgeAction,
    IConflicts,
    JammerOptions,
    Message,
    Move,
    NodeAction,
    NodeId,
    OutgoingMessage,
    Rule,
    State,
    Strategy,
    TeamPlan,
)
from gamms.typing.graph_engine import IGraph, IGraphEngine, Node, ObsFace, OSMEdge
from gamms.typing.internal_context import IComputeEngine, IInternalContext, IMessageEngine, ITask
from gamms.typing.logger import ILogger
from gamms.typing.memory_engine import IMemoryEngine, IPathLike, IStore, StoreType
from gamms.typing.recorder import IRecorder, OpCodes, PageOptions
from gamms.typing.sensor_engine import ISensor, ISensorEngine, SensorOptions, SensorType
from gamms.typing.visualization_engine import (
    AgentVisual,
    ArtistType,
    ColorType,
    GraphVisual,
    IArtist,
    IVisualizationEngine,
    ObstacleVisual,
    PictureOptions,
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
    "ChannelOptions",
    "ColorType",
    "Draws",
    "EdgeAction",
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
    "JammerOptions",
    "Message",
    "Move",
    "Node",
    "NodeAction",
    "NodeId",
    "OSMEdge",
    "ObsFace",
    "ObstacleVisual",
    "OpCodes",
    "OutgoingMessage",
    "PageOptions",
    "PictureOptions",
    "Rule",
    "SensorOptions",
    "SensorType",
    "SensorVisual",
    "State",
    "StoreType",
    "Strategy",
    "TeamPlan",
    "logger",
]
_list_names(__name__, __all__)

if not TYPE_CHECKING:  # type checkers would accept any misspelled name

    def __getattr__(name: str) -> ModuleType:
        if name in {"artist", "compute_engine", "message_engine", "opcodes"}:  # modules of 1.0.0: see `gamms.compat`
            return import_module(f"gamms.typing.{name}")
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
