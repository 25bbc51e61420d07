"""The window: a scenario as it happens, on a screen.

What lives here: the engine (`engine.py`, read it first) and its parts, one file per responsibility: where it looks
(`view.py`), what keys and mouse do (`controls.py`), how time passes (`pacing.py`), questions to people (`asking.py`),
words (`hud.py`) and the legend (`legend.py`) on `cards.py`, what is shown on demand (`onlookers.py`, `pointing.py`,
`trails.py`), and how frames are painted fast (`stage.py`, `tiles.py`, `sheets.py`, `crowd.py`). `internals.py` has the
names that programs for 1.0.0 reach into.
Imported only when a window is asked for.
"""

from gamms.visual.window.engine import WindowEngine
from gamms.visual.window.view import RenderManager

PygameVisualizationEngine = WindowEngine

__all__ = ["PygameVisualizationEngine", "RenderManager", "WindowEngine"]
