"""The visual room: what a scenario looks like, and pictures of it.

What lives here: the engine without a window (`no_engine.py`), artists (`artist.py`) and their drawers
(`drawers/`), the drawing primitives (`primitives.py`), which collect draw commands (`commands.py`), the backends
that turn draw commands into files (`backends/`), and the window (`window/`). `picture.py` goes from artists to a file.
Values become colours in `values.py`, and `legend.py` explains them.
Read `no_engine.py` first, then `primitives.py`.
May import: `gamms.typing`, `gamms.kernels`, `gamms.ir`, `gamms.plugins`, `gamms.arguments`, `gamms.errors`.
To extend: something to draw is one function in `drawers/`; a way to show it is one file in `backends/` and
one line in its `__init__`. The room only reads the scenario; it never changes it.
"""

from importlib import import_module
from typing import Any

from gamms.visual import notebook
from gamms.visual.appearance import AgentData, Circle, GraphData, Rectangle
from gamms.visual.artist import Artist, RenderMode
from gamms.visual.color import Color, string_to_color
from gamms.visual.constants import (
    CACHE_ZOOM_MAX,
    SHORT_EDGE_PIXEL_THRESHOLD,
    SKIP_EDGE_PIXEL_THRESHOLD,
    SKIP_NODE_PIXEL_THRESHOLD,
    Engine,
    Shape,
    Space,
)
from gamms.visual.drawers import (
    render_aerial_agent,
    render_aerial_agent_sensor,
    render_agent,
    render_agent_sensor,
    render_circle,
    render_graph,
    render_input_overlay,
    render_map_sensor,
    render_neighbor_sensor,
    render_obstacles,
    render_rectangle,
    render_sensor,
)
from gamms.visual.engine import PictureEngine
from gamms.visual.no_engine import NoEngine

_LATER = {  # not loaded before somebody wants to see something
    **dict.fromkeys(("PygameVisualizationEngine", "RenderManager", "WindowEngine"), "gamms.visual.window"),
    "legend_of_teams": "gamms.visual.undeclared",
}


def __getattr__(name: str) -> Any:
    if name in _LATER:
        return getattr(import_module(_LATER[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


class _Lazy:
    """A module that is imported when something in it is asked for."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __getattr__(self, attribute: str) -> Any:
        return getattr(import_module(self._name), attribute)


def lazy(name: str) -> _Lazy:
    """The module of that name, which is imported when it is first used."""
    return _Lazy(name)


__all__ = [
    "CACHE_ZOOM_MAX",
    "SHORT_EDGE_PIXEL_THRESHOLD",
    "SKIP_EDGE_PIXEL_THRESHOLD",
    "SKIP_NODE_PIXEL_THRESHOLD",
    "AgentData",
    "Artist",
    "Circle",
    "Color",
    "Engine",
    "GraphData",
    "NoEngine",
    "PictureEngine",
    "PygameVisualizationEngine",
    "Rectangle",
    "RenderManager",
    "RenderMode",
    "Shape",
    "Space",
    "WindowEngine",
    "lazy",
    "legend_of_teams",
    "notebook",
    "render_aerial_agent",
    "render_aerial_agent_sensor",
    "render_agent",
    "render_agent_sensor",
    "render_circle",
    "render_graph",
    "render_input_overlay",
    "render_map_sensor",
    "render_neighbor_sensor",
    "render_obstacles",
    "render_rectangle",
    "render_sensor",
    "string_to_color",
]
