"""The enums of drawing: engines, spaces, shapes and layers; and the sizes below which the window omits details."""

from enum import Enum, IntEnum

SHORT_EDGE_PIXEL_THRESHOLD = 3.0  # pixels; for programs of gamms 1.0.0
SKIP_EDGE_PIXEL_THRESHOLD = 1.0  # pixels; for programs of gamms 1.0.0
SKIP_NODE_PIXEL_THRESHOLD = 1.0  # pixels; for programs of gamms 1.0.0
CACHE_ZOOM_MAX = 1.2  # how far a cached drawing is stretched before it is drawn again


class Engine(Enum):
    """The display of a scenario: none, a window, a film without a display, or browsers."""

    NO_VIS = 0
    PYGAME = 1
    OFFSCREEN = 2
    WEB = 3


class Space(Enum):
    """The unit of a coordinate."""

    World = 0
    Screen = 1
    Viewport = 2


class Shape(Enum):
    """Drawers by name."""

    Circle = 1
    Rectangle = 2


class Layer(IntEnum):
    """The layers of built-in artists, from the ground up; custom artists may use any number between."""

    TEAMS = 1  # their legend, which comes first
    BASE_MAP = 2
    TUNNELS = 4
    OBSTACLES = 5
    GRAPH = 10
    TERRITORIES = 12
    VALUES = 13
    TRAILS = 14
    SEEN = 15  # sensor views in the default scene
    MESSAGES = 17
    GOALS = 18
    TAGS = 19  # below agents, so that no living agent is crossed out
    AGENTS = 20
    FLAGS = 22
    ARTISTS = 30  # artists without a given layer
    WINDOW_SENSORS = 30  # declared sensors in a window, as in 1.0.0
    SENSORS = 40
    OPTIONS = 50  # of a person who is asked for a move
