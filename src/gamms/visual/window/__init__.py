"""The window, which shows a scenario on a screen while it is played.

The engine (`engine.py`, read it first) is a loop over parts, none of which knows it: keys, mouse and questions
to people (`input.py`), the display and the pace of its frames (`display.py`), what is shown beside the artists
(`overlay.py`, whose words `panels.py` paints), and where it looks (`framing.py`). The camera is in `camera.py`, and
frames are painted by `scene.py`, one folder up.
Imported only when a window is asked for.
"""
