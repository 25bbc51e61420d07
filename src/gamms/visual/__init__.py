"""The visual engines: the look of a scenario, and its pictures, films and windows.

An engine (`engine.py`, read it first) is a facade of parts: `drawing.py` has the primitives, which collect draw
commands; `artists.py` stores the declared artists (`artist.py`), and `default_scene.py` makes those of a scenario that
does not declare its graph; `camera.py` has cameras; `pictures.py` saves pictures with `files.py`; `page.py` arranges
the parts around the map, `captions.py` the text below it and `labels.py` the names on the map; `layout.py` decides
where they are free. Drawers (`drawers/`) draw one kind of thing each, with data of the turn from `shown_turn.py`;
backends (`backends/`) convert draw commands to files; `scene.py` paints frames of films and of the window (`window/`)
fast. Colors are in `appearance.py` and `themes.py`, the font in `font.py`, legends and values in `legend.py`, recorded
drawings in `recorded_drawings.py`, and names of 1.0.0's window in `compat.py`. May import: `gamms.typing`,
`gamms.kernels`, `gamms.ir`, `gamms.plugins`, `gamms.arguments`, `gamms.errors`. To draw something new, add one function
to `drawers/`; to add an output format, add one file to `backends/` and one line to its `__init__`. Drawing only reads
the scenario.
"""

import typing as _typing
from importlib import import_module

from gamms.errors import list_names as _list_names
from gamms.visual.constants import (
    CACHE_ZOOM_MAX,
    SHORT_EDGE_PIXEL_THRESHOLD,
    SKIP_EDGE_PIXEL_THRESHOLD,
    SKIP_NODE_PIXEL_THRESHOLD,
    Engine,
    Shape,
    Space,
)

if _typing.TYPE_CHECKING:  # at run time, names are loaded on first use: most contexts draw nothing
    from gamms.visual.appearance import AgentData, Circle, Color, GraphData, Rectangle, string_to_color
    from gamms.visual.artist import Artist, RenderMode
    from gamms.visual.compat import RenderManager
    from gamms.visual.default_scene import legend_of_teams
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
    from gamms.visual.engine import NoEngine, PictureEngine
    from gamms.visual.window.engine import PygameVisualizationEngine, WindowEngine
else:
    _HOMES = {
        "appearance": "AgentData Circle Color GraphData Rectangle string_to_color",
        "artist": "Artist RenderMode",
        "compat": "RenderManager",
        "default_scene": "legend_of_teams",
        "drawers": "render_aerial_agent render_aerial_agent_sensor render_agent render_agent_sensor render_circle "
        "render_graph render_input_overlay render_map_sensor render_neighbor_sensor render_obstacles render_rectangle "
        "render_sensor",
        "engine": "NoEngine PictureEngine",
        "window.engine": "PygameVisualizationEngine WindowEngine",
    }
    _HOME_OF = dict[str, str]()
    for _home, _names in _HOMES.items():
        _HOME_OF.update(dict.fromkeys(_names.split(), _home))

    def __getattr__(name: str) -> _typing.Any:
        if name not in _HOME_OF:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        found = getattr(import_module(f"{__name__}.{_HOME_OF[name]}"), name)
        globals()[name] = found
        return found


class _Lazy:
    """A module that is imported on first access to an attribute."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __getattr__(self, attribute: str) -> _typing.Any:
        return getattr(import_module(self._name), attribute)


def lazy(name: str) -> _Lazy:
    """Return a module that is imported on first use."""
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
_list_names(__name__, __all__)
