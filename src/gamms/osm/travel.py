"""Ways of moving: which roads each may use, and how fast a road may be driven, as tables."""

from enum import Enum


class OSMType(Enum):
    """Which ways of moving a network is for."""

    WALK = 0
    BIKE = 1
    DRIVE = 2


# What a way must not be, per way of moving: tag -> values. These are the rules of OSMnx's network types, with the
# values written out. They hold on top of the rule for all: no road that is no road (`NO_ROADS`), no area.
_NOT_FOR_ALL_TO_USE = {"access": {"private"}, "service": {"private"}}
CLOSED_TO: dict[OSMType, dict[str, set[str]]] = {
    OSMType.WALK: {
        **_NOT_FOR_ALL_TO_USE,
        "highway": {"bus_guideway", "cycleway", "motorway", "motorway_link"},
        "foot": {"no"},
    },
    OSMType.BIKE: {
        **_NOT_FOR_ALL_TO_USE,
        "highway": {
            "bus_guideway",
            "corridor",
            "elevator",
            "escalator",
            "footway",
            "motorway",
            "motorway_link",
            "steps",
        },
        "bicycle": {"no"},
    },
    OSMType.DRIVE: {
        "access": {"private"},
        "highway": {
            "bridleway",
            "bus_guideway",
            "corridor",
            "cycleway",
            "elevator",
            "escalator",
            "footway",
            "path",
            "pedestrian",
            "service",
            "steps",
            "track",
        },
        "motor_vehicle": {"no"},
        "motorcar": {"no"},
        "service": {"alley", "driveway", "emergency_access", "parking", "parking_aisle", "private"},
    },
}

# Kilometres per hour on a road without a sign. Our own round numbers for free traffic, between the limits usual in
# Europe and what the shape of such roads allows; ways for walkers have the pace of a walker.
SPEED_OF_HIGHWAY_KPH: dict[str, float] = {
    "motorway": 110.0,
    "motorway_link": 60.0,
    "trunk": 90.0,
    "trunk_link": 50.0,
    "primary": 60.0,
    "primary_link": 50.0,
    "secondary": 50.0,
    "secondary_link": 40.0,
    "tertiary": 50.0,
    "tertiary_link": 40.0,
    "unclassified": 40.0,
    "residential": 30.0,
    "living_street": 10.0,
    "service": 20.0,
    "busway": 40.0,
    "road": 40.0,
    "track": 15.0,
    "cycleway": 15.0,
    "bridleway": 8.0,
    "pedestrian": 5.0,
    "footway": 5.0,
    "path": 5.0,
    "corridor": 4.0,
    "steps": 2.0,
}
UNKNOWN_SPEED_KPH = 30.0

SPEED_OF_WORD_KPH: dict[str, float] = {  # what follows the country in values such as FI:urban
    "motorway": 120.0,
    "none": 130.0,
    "trunk": 90.0,
    "rural": 80.0,
    "nsl_dual": 112.65408,  # 70 mph
    "nsl_single": 96.56064,  # 60 mph
    "urban": 50.0,
    "bicycle_road": 30.0,
    "living_street": 10.0,
    "walk": 5.0,
}
