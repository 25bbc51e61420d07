"""Enum values and constants that programs and recordings rely on."""

import pytest

import gamms

ENUMS = {
    "agent.AgentType": {"BASIC": 0, "AERIAL": 1},
    "graph.Engine": {"MEMORY": 0, "SQLITE": 1},
    "graph.StoreType": {"MEMORY": 0, "FILESYSTEM": 1, "DATABASE": 2},
    "visual.Engine": {"NO_VIS": 0, "PYGAME": 1},
    "visual.Space": {"World": 0, "Screen": 1, "Viewport": 2},
    "visual.Shape": {"Circle": 1, "Rectangle": 2},
    "visual.RenderMode": {"CACHED": 1, "NON_CACHED": 2},
    "typing.ArtistType": {"STATIC": 1, "DYNAMIC": 2},
}
SENSORS = [
    "CUSTOM",
    "NEIGHBOR",
    "MAP",
    "AGENT",
    "RANGE",
    "ARC",
    "AGENT_RANGE",
    "AGENT_ARC",
    "AERIAL",
    "AERIAL_AGENT",
    "OCCLUDED_MAP",
    "OCCLUDED_AGENT",
    "OCCLUDED_AERIAL",
    "OCCLUDED_AERIAL_AGENT",
]


@pytest.mark.parametrize("path", ENUMS)
def test_an_enum_has_the_published_values(path):
    room, name = path.split(".")
    values = {member.name: member.value for member in getattr(getattr(gamms, room), name)}
    assert values.items() >= ENUMS[path].items()  # a member of our own may come after


def test_the_kinds_of_sensor_have_the_published_values():
    kinds = list(gamms.sensor.SensorType)[: len(SENSORS)]  # custom kinds of other tests come after
    assert [(kind.name, kind.value) for kind in kinds] == [(name, value) for value, name in enumerate(SENSORS)]


def test_an_agent_type_is_an_integer():
    assert gamms.agent.AgentType.AERIAL == 1
    assert isinstance(gamms.agent.AgentType.BASIC, int)


def test_the_constants_of_the_visual_room():
    visual = gamms.visual
    assert (visual.SHORT_EDGE_PIXEL_THRESHOLD, visual.SKIP_EDGE_PIXEL_THRESHOLD) == (3.0, 1.0)
    assert (visual.SKIP_NODE_PIXEL_THRESHOLD, visual.CACHE_ZOOM_MAX) == (1.0, 1.2)


def test_the_version_is_our_own():
    assert gamms.__version__ != "1.0.0"
    assert gamms.__version__.split(".")[0] == "2"
