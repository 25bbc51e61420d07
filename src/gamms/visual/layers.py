"""The layers on which built-in artists draw; lower layers are painted first."""

from enum import IntEnum


class Layer(IntEnum):
    """From the ground up; artists of the caller's own may use any number between."""

    OBSTACLES = 5
    GRAPH = 10
    TERRITORIES = 12
    VALUES = 13
    TRAILS = 14
    SEEN = 15  # what sensors see in the default scene
    AGENTS = 20
    FLAGS = 22
    TAGS = 25
    ARTISTS = 30  # without a layer of their own
    WINDOW_SENSORS = 30  # declared sensors in a window, as in 1.0.0
    SENSORS = 40
    OPTIONS = 50  # of a person who is asked for a move
