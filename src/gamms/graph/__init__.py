"""The graph engine: nodes, edges and obstacles as columns; range queries, routing, visibility; files and bridges.

Read `graph.py` first (every verb), then `store.py` and `tables.py` (where the data is), `indexes.py` (what makes
queries fast), `routes.py`, `positions.py`, `finding.py`, `isochrones.py` and `tracks.py`; for obstacles
`obstacles.py`, then `visibility.py`.
May import: typing, kernels, ir and below, never another engine. To add a file format, add a function to `export.py`; to
add a query, give `IGraph` a slow default and override it in `graph.py`.
"""

import typing as _typing
from importlib import import_module

from gamms.errors import UnknownAttribute
from gamms.errors import list_names as _list_names
from gamms.graph.engine import GraphEngine
from gamms.graph.graph import Graph
from gamms.typing.graph_engine import Engine, IGraph, IGraphEngine, Node, ObsFace, OSMEdge
from gamms.typing.memory_engine import StoreType

if _typing.TYPE_CHECKING:
    from gamms.graph.networkx_bridge import grid
    from gamms.graph.tracks import TrackMatch

SqliteGraph = Graph  # one class for both engines
_IN_MEMORY = {"MemoryStore", "SqliteStore", "PathLike"}  # 1.0.0 also exports these classes from here

__all__ = [
    "Engine",
    "Graph",
    "GraphEngine",
    "IGraph",
    "IGraphEngine",
    "Node",
    "OSMEdge",
    "ObsFace",
    "SqliteGraph",
    "StoreType",
    "TrackMatch",
    "grid",
]
_list_names(__name__, __all__)


def __getattr__(name: str) -> _typing.Any:
    if name == "grid":  # imported on first use, because it imports the exporters, too
        return import_module("gamms.graph.networkx_bridge").grid
    if name == "TrackMatch":
        return import_module("gamms.graph.tracks").TrackMatch
    if name == "LineString":
        from gamms.ir import geometry

        return geometry.import_line_string()
    if name in _IN_MEMORY:
        return getattr(import_module("gamms.memory"), name)
    raise UnknownAttribute(__name__, name, () if name.startswith("_") else __all__)
