"""Speeds on roads in km/h: the signs of a map, for one direction of traffic, and the usual speeds of classes of ways.

The rules of countries are not known here. Words such as `FI:urban` stand for the same speed everywhere, and the speed
of a road without a sign depends only on its class, not on other roads of the map as in OSMnx.
"""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from typing import Any, NamedTuple

from gamms.osm.objects import DIRECTIONS, parse_number, split_words

# Kilometers per hour on a road without a sign. Our own round numbers for free traffic, between the limits usual in
# Europe and the speed that the shape of such roads allows; ways for walkers have the pace of a walker.
_HIGHWAYS_OF_SPEED = {
    110.0: ("motorway",),
    90.0: ("trunk",),
    60.0: ("motorway_link", "primary"),
    50.0: ("trunk_link", "primary_link", "secondary", "tertiary"),
    40.0: ("secondary_link", "tertiary_link", "unclassified", "busway", "road"),
    30.0: ("residential",),
    20.0: ("service",),
    15.0: ("track", "cycleway"),
    10.0: ("living_street",),
    8.0: ("bridleway",),
    5.0: ("pedestrian", "footway", "path"),
    4.0: ("corridor",),
    2.0: ("steps",),
}
SPEED_OF_HIGHWAY_KPH: dict[str, float] = {}
for _kph, _highways in _HIGHWAYS_OF_SPEED.items():
    SPEED_OF_HIGHWAY_KPH.update(dict.fromkeys(_highways, _kph))
UNKNOWN_SPEED_KPH = 30.0

# Kilometers per hour on ways of other networks: our own round numbers. A ferry without a duration is slow.
SPEED_OF_NETWORK_KPH: dict[str, float] = {
    "railway=rail": 80.0,
    "railway=light_rail": 50.0,
    "railway=subway": 40.0,
    "railway=monorail": 40.0,
    "railway=narrow_gauge": 30.0,
    "railway=tram": 25.0,
    "railway=funicular": 10.0,
    "route=ferry": 15.0,
    "waterway=*": 10.0,
    "aerialway=*": 15.0,
}

SPEED_OF_WORD_KPH: dict[str, float] = {  # the word after the country in values such as FI:urban
    "motorway": 120.0,
    "trunk": 90.0,
    "rural": 80.0,
    "nsl_dual": 112.65408,  # 70 mph
    "nsl_single": 96.56064,  # 60 mph
    "nsl_restricted": 48.28032,  # 30 mph
    "urban": 50.0,
    "bicycle_road": 30.0,
    "living_street": 10.0,
    "pedestrian_zone": 5.0,
    "walk": 5.0,
}
_NO_LIMIT = frozenset(("none", "unlimited"))
_NO_LIMIT_KPH = 130.0
_WITHOUT_LIMIT = frozenset(("motorway", "trunk"))  # the classes of ways on which there are roads without a limit

# Keys that name the kind of limit, or the zone in which a road lies; without a sign they give the speed.
_ZONES = ("zone:maxspeed", "maxspeed:type", "source:maxspeed", "zone:traffic")
_OWN_LIMITS = frozenset(("living_street", "pedestrian"))  # classes with a limit of their own in any traffic zone
_IN_MILES = frozenset(("gb", "uk", "us"))  # countries whose zones are numbers of miles per hour

CARS = ("motorcar", "motor_vehicle", "vehicle")  # names of a car in keys such as maxspeed:motorcar
_FASTEST_KPH = 300.0  # greater speeds are typing errors
_METRES_PER_SECOND = 3.6
_MILE = 1.609344
_KNOT = 1.852
_UNITS = {  # without spaces
    **dict.fromkeys(("", "km/h", "kmh", "kph", "kmph", "km/hr"), 1.0),
    **dict.fromkeys(("mph", "mi/h", "mi"), _MILE),
    **dict.fromkeys(("knots", "knot", "kn", "kt", "kts"), _KNOT),
    "m/s": _METRES_PER_SECOND,
}
_NUMBER = r"\d{1,4}(?:[.,]\d{1,4})?"
_SIGN = re.compile(rf"({_NUMBER})(?:\s*[-\u2013]\s*({_NUMBER}))?\s*([a-z][a-z/ ]*)?\.?", re.ASCII)
_BETWEEN = re.compile(r"[|]|,(?!\d(?!\d))")  # a comma before a single digit is that of a decimal number


def compute_speed_kph(tags: Mapping[str, Any]) -> float:
    """Return the speed on a road in km/h: given as `speed_kph`, signed as `maxspeed`, or usual for its `highway`.

    Several signs (a list, or text with semicolons) give their mean; texts that are not speeds are ignored.
    """
    given = parse_number(tags.get("speed_kph"))
    if 0.0 < given < math.inf:
        return given
    sign = find_signs(tags)
    if sign is not None:
        return sign.kph
    known = (SPEED_OF_HIGHWAY_KPH[name] for name in split_words(tags.get("highway")) if name in SPEED_OF_HIGHWAY_KPH)
    return next(known, UNKNOWN_SPEED_KPH)


def find_network_speed_kph(key: str, value: str) -> float:
    """Return the usual speed on ways of another network than roads, such as `railway=tram`."""
    known = (SPEED_OF_NETWORK_KPH.get(f"{key}={word}") for word in (value, "*"))
    return next((kph for kph in known if kph is not None), UNKNOWN_SPEED_KPH)


_CLOCK = re.compile(r"(?:(\d{1,3}):)?(\d{1,4})(?::(\d{2}))?", re.ASCII)  # h:mm, h:mm:ss, or minutes
_ISO_DURATION = re.compile(
    r"p(?:(\d+)d)?(?:t(?:(\d+(?:[.,]\d+)?)h)?(?:(\d+(?:[.,]\d+)?)m)?(?:(\d+(?:[.,]\d+)?)s)?)?", re.ASCII
)


def parse_duration_s(value: object) -> float | None:
    """Return a `duration` in seconds: `hh:mm`, `hh:mm:ss`, minutes, or ISO 8601 such as `PT1H30M`; else None."""
    words = split_words(value)
    if len(words) != 1:
        return None
    clock = _CLOCK.fullmatch(words[0])
    iso = _ISO_DURATION.fullmatch(words[0])
    seconds = 0.0
    if clock is not None and (clock[1] is not None or clock[3] is None):
        hours, minutes, rest = (float(part or 0) for part in clock.groups())
        seconds = 3600.0 * hours + 60.0 * minutes + rest
    elif iso is not None:
        parts = [float((part or "0").replace(",", ".")) for part in iso.groups()]
        seconds = sum(part * of_unit for part, of_unit in zip(parts, (86400.0, 3600.0, 60.0, 1.0), strict=True))
    return seconds if seconds > 0.0 else None


class Sign(NamedTuple):
    """The signs under one key."""

    key: str
    kph: float  # of several signs the mean


def find_signs(tags: Mapping[str, Any], vehicles: Sequence[str] = (), direction: str = "") -> Sign | None:
    """Return the most specific signs of a road that give a speed; None without such signs.

    Args:
        tags: of the road.
        vehicles: the names of the vehicle in keys such as `maxspeed:motorcar`, the most specific first.
        direction: "forward", "backward", or "" for signs that hold in both directions.
    """
    for key in _list_keys(tuple(vehicles), direction):
        signs = _split_signs(tags[key]) if key in tags else []
        if key.startswith("zone:traffic") and not _OWN_LIMITS.isdisjoint(split_words(tags.get("highway"))):
            continue
        speeds = [speed for sign in signs for speed in _parse_speeds(sign, tags)]
        if speeds:
            return Sign(key, sum(speeds) / len(speeds))
    return None


def sign_in_force(tags: Mapping[str, Any], vehicles: Sequence[str], direction: str) -> dict[str, Any]:
    """Return the signs that hold for a vehicle in one direction as the tag `maxspeed`; empty if `maxspeed` has them."""
    sign = find_signs(tags, vehicles, direction)
    return {} if sign is None or sign.key == "maxspeed" else {"maxspeed": tags[sign.key]}


def list_unread_signs(tags: Mapping[str, Any], vehicles: Sequence[str] = CARS) -> Iterator[str]:
    """Yield the signs for a vehicle that give no speed, as "key=word"."""
    for key in sign_keys(vehicles):
        if key in tags and not key.startswith(_ZONES):  # those also name surveys and other sources
            yield from (f"{key}={word}" for word in _split_signs(tags[key]) if not _parse_speeds(word, tags))


def sign_keys(vehicles: Sequence[str]) -> list[str]:
    """Return the keys of all signs for a vehicle."""
    return [*dict.fromkeys(key for direction in DIRECTIONS for key in _list_keys(tuple(vehicles), direction))]


@cache
def _list_keys(vehicles: tuple[str, ...], direction: str) -> tuple[str, ...]:
    """Return the keys of the signs for a vehicle in one direction, the most specific first."""
    keys: list[str] = []
    for vehicle in vehicles:
        if direction:
            keys += [f"maxspeed:{vehicle}:{direction}", f"maxspeed:{direction}:{vehicle}"]
        keys.append(f"maxspeed:{vehicle}")
    for key in ("maxspeed", *_ZONES):
        keys += [f"{key}:{direction}", key] if direction else [key]
    return tuple(keys)


def has_special_signs(tags: Mapping[Any, Any]) -> bool:
    """Return whether a road may have a limit under another key than `maxspeed`."""
    return any(isinstance(key, str) and key.startswith(("maxspeed:", *_ZONES)) for key in tags)


def _split_signs(value: object) -> list[str]:
    """Return the signs in a value: numbers with their units, or words."""
    parts = (part.strip() for word in split_words(value) for part in _BETWEEN.split(word))
    return [part for part in parts if part]


def _parse_speeds(text: str, tags: Mapping[str, Any]) -> list[float]:
    """Return the speed on a sign, or both ends of a range; empty if the text is not a speed."""
    word = text.rpartition(":")[2].strip()  # the country does not matter, but for its unit
    if word in SPEED_OF_WORD_KPH:
        return [SPEED_OF_WORD_KPH[word]]
    if word in _NO_LIMIT:
        return [_NO_LIMIT_KPH] if not _WITHOUT_LIMIT.isdisjoint(split_words(tags.get("highway"))) else []
    match = _SIGN.fullmatch(word.removeprefix("zone").strip())
    unit = "" if match is None or match[3] is None else match[3].replace(" ", "")
    if not unit and text.partition(":")[0].strip() in _IN_MILES:
        unit = "mph"
    if match is None or unit not in _UNITS:
        return []
    speeds = [float(number.replace(",", ".")) * _UNITS[unit] for number in match.groups()[:2] if number is not None]
    return [speed for speed in speeds if 0.0 < speed <= _FASTEST_KPH]
