"""The window, which shows a scenario on a screen while it is played.

The engine (`engine.py`, read it first) is a loop over parts, none of which knows it: keys, mouse and questions
to people (`input.py`), the display and the pace of its frames (`display.py`), captions and panels over
the map (`overlay.py`, painted by `panels.py`), and the part of the map in view (`framing.py`). The camera is in
`camera.py`, and frames are painted by `scene.py`, one folder up.
Imported only when a window is asked for.
"""
