"""Pictures and films of recordings. A client: it replays into a context and draws that as any program would.

Read `files.py` first: from a recording to a file. `fog.py` shows only what a team can see.
"""

from gamms.rendering.files import RenderOptions, render
from gamms.rendering.fog import Fog

__all__ = ["Fog", "RenderOptions", "render"]
