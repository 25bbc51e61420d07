"""The graph room: nodes, edges and obstacles over columns; queries by place; files and bridges.

Read `graph.py` first (every call), then `tables.py` (where the data is), `indexes.py` (what makes it fast) and
`routes.py` (ways); for walls `obstacles.py`, then `visibility.py`.
May import: typing, kernels, ir and below, never another room. To add a file format, write a module that turns
`contents.Contents` into bytes and back; to add a query, give `IGraph` a slow default and override it in `graph.py`.
"""

from importlib import import_module
from typing import Any

from gamms.graph.engine import GraphEngine
from gamms.graph.graph import Graph
from gamms.graph.grid import grid
from gamms.graph.packed import PackedGraph
from gamms.typing.graph_engine import Engine, IGraph, IGraphEngine, Node, ObsFace, OSMEdge
from gamms.typing.memory_engine import StoreType

SqliteGraph = Graph  # one behaviour, whatever the engine
_IN_MEMORY = {"MemoryStore", "SqliteStore", "PathLike"}  # 1.0.0 offers these classes here, too

__all__ = [
    "Engine",
    "Graph",
    "GraphEngine",
    "IGraph",
    "IGraphEngine",
    "Node",
    "OSMEdge",
    "ObsFace",
    "PackedGraph",
    "SqliteGraph",
    "StoreType",
    "grid",
]


def __getattr__(name: str) -> Any:
    if name == "LineString":
        from gamms.ir import geometry

        return geometry.line_string_class()
    if name in _IN_MEMORY:
        return getattr(import_module("gamms.memory"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
