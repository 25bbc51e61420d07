"""How fast a road may be driven: its `maxspeed` as a number, or a speed by its class.

The rules of a country are not known here. Words such as `FI:urban` stand for the same speed everywhere, and a
road without a sign gets a speed that depends on its class only: not on what else is on the map, as OSMnx has it.
"""

import math
import re
from collections.abc import Mapping
from typing import Any, TypeGuard

import numpy as np

from gamms.ir.graph import FloatArray
from gamms.osm.network import RoadNetwork

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

_FASTEST_KPH = 300.0  # beyond is a slip of the pen
_UNITS = {"": 1.0, "km/h": 1.0, "kmh": 1.0, "kph": 1.0, "mph": 1.609344, "knots": 1.852}
_SIGN = re.compile(r"(\d{1,4}(?:\.\d{1,4})?)\s*([a-z/]*)", re.ASCII)


def speed_kph(tags: Mapping[str, Any]) -> float:
    """Return the speed on a road in km/h: given as `speed_kph`, signed as `maxspeed`, or usual for its `highway`.

    Several signs (a list, or text with semicolons) give their mean; what is no speed is passed over.
    """
    given = tags.get("speed_kph")
    if is_number(given) and 0.0 < given < math.inf:
        return float(given)
    signs = [speed for text in _texts(tags.get("maxspeed")) if (speed := _of_sign(text)) is not None]
    if signs:
        return sum(signs) / len(signs)
    known = (SPEED_OF_HIGHWAY_KPH[name] for name in _texts(tags.get("highway")) if name in SPEED_OF_HIGHWAY_KPH)
    return next(known, UNKNOWN_SPEED_KPH)


def is_number(value: object) -> TypeGuard[float]:
    """Return whether it is a real number; a bool is none."""
    return isinstance(value, (int, float, np.integer)) and not isinstance(value, bool) and not math.isnan(value)


def travel_times(network: RoadNetwork, speeds: FloatArray) -> FloatArray:
    """Seconds along each road at the speed (ways,) of its way.

    A way that came with a `travel_time` of its own keeps it; its pieces share it by their lengths.
    """
    needed = network.lengths / (speeds[network.ways] / 3.6)
    given = np.array([_given_time(of_way) for of_way in network.tags] or [math.nan])[network.ways]
    whole = np.bincount(network.ways, weights=network.lengths, minlength=len(network.tags))[network.ways]
    share = np.where(whole > 0.0, network.lengths / np.where(whole > 0.0, whole, 1.0), 1.0)
    return np.where(np.isnan(given), needed, given * share)


def _given_time(tags: Mapping[str, Any]) -> float:
    given = tags.get("travel_time")
    return float(given) if is_number(given) and 0.0 <= given < math.inf else math.nan


def _texts(value: object) -> list[str]:
    if isinstance(value, (list, tuple)):
        return [text for part in value for text in _texts(part)]
    if isinstance(value, str):
        return [part.strip().lower() for part in re.split("[;|,]", value)]
    return [str(value)] if is_number(value) else []


def _of_sign(text: str) -> float | None:
    word = text.rpartition(":")[2]  # the country does not matter
    if word in SPEED_OF_WORD_KPH:
        return SPEED_OF_WORD_KPH[word]
    match = _SIGN.fullmatch(word.removeprefix("zone").strip())
    if match is None or match[2] not in _UNITS:
        return None
    speed = float(match[1]) * _UNITS[match[2]]
    return speed if 0.0 < speed <= _FASTEST_KPH else None
