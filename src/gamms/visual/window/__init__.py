"""The window: a scenario as it happens, on a screen.

The engine (`engine.py`, read it first) is a loop over parts, none of which knows it: the camera (`camera.py`), keys,
mouse and questions to people (`input.py`), how time passes (`pacing.py`), and what is shown beside the artists
(`overlay.py`) with its text and legend (`hud.py`). Frames are painted fast by `scene.py` and `tiles.py`, one folder up.
Imported only when a window is asked for.
"""
