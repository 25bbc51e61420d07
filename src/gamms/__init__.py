"""GAMMS: games between teams of agents on graphs and real road networks.

    import gamms

    with gamms.create_context(seed=1) as ctx:
        ctx.graph.attach_networkx_graph(networkx_graph)
        ctx.sensor.create_sensor("near", gamms.sensor.SensorType.NEIGHBOR)
        ctx.agent.create_agent("anna", start_node_id=0, sensors=["near"])

Start reading at `context.py`; every other folder is one room of the house.
"""

from importlib import import_module as _import_module
from typing import Any as _Any

from gamms import _legacy, agent, graph, memory, sensor, typing, visual
from gamms.context import Context, InternalContext, create_context
from gamms.typing import logger

__version__ = "2.0.0.dev0"

__all__ = [
    "Context",
    "InternalContext",
    "agent",
    "create_context",
    "graph",
    "logger",
    "memory",
    "sensor",
    "typing",
    "visual",
]

# Rooms and guests that are loaded when they are first named.
_WHEN_ASKED = {"game", "osm", "recorder", "recordings", "rules", "scenario", "strategies", "testing"}

_legacy.install()


def __getattr__(name: str) -> _Any:
    found = _import_module(f"gamms.{name}") if name in _WHEN_ASKED else _legacy.resolve(name)
    if found is not None:
        return found
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
