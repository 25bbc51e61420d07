"""The words of the room: engines, spaces, shapes, and the sizes below which the window leaves things out."""

from enum import Enum

SHORT_EDGE_PIXEL_THRESHOLD = 3.0
SKIP_EDGE_PIXEL_THRESHOLD = 1.0
SKIP_NODE_PIXEL_THRESHOLD = 1.0
CACHE_ZOOM_MAX = 1.2


class Engine(Enum):
    """How a scenario is shown: not at all, in a window, or in a film that needs no display."""

    NO_VIS = 0
    PYGAME = 1
    OFFSCREEN = 2


class Space(Enum):
    """What a coordinate is measured in."""

    World = 0
    Screen = 1
    Viewport = 2


class Shape(Enum):
    """Drawers that go by a name."""

    Circle = 1
    Rectangle = 2
