"""The ways of a map as columns, which of them each way of moving may use, and the pieces of road between vertices."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np

from gamms.ir.graph import FloatArray, IntArray

NO_ROADS = (
    "abandoned",
    "construction",
    "no",
    "planned",
    "platform",
    "proposed",
    "raceway",
    "razed",
    "rest_area",
    "services",
)
KEPT_TAGS = (
    "highway",
    "name",
    "lanes",
    "maxspeed",
    "ref",
    "bridge",
    "tunnel",
    "access",
    "service",
    "width",
    "est_width",
    "junction",
    "landuse",
    "area",
)
ATTRIBUTION = "© OpenStreetMap contributors, ODbL 1.0"
_ONE_WAY = ("yes", "true", "1", "-1", "reverse", "T", "F")
_AGAINST = ("-1", "reverse", "T")


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


@dataclass(slots=True, frozen=True, eq=False)
class Ways:
    """Roads as they are in the file: way `i` visits the positions `offsets[i]:offsets[i + 1]`."""

    offsets: IntArray  # (ways + 1,)
    refs: IntArray  # (positions,)  OpenStreetMap node ids
    lonlat: FloatArray  # (positions, 2)  degrees, NaN where the file lacks the node
    against: "np.ndarray[Any, np.dtype[np.bool_]]"  # (ways,)  one-way against the order of the positions
    tags: Sequence[Mapping[str, Any]]  # (ways,)  osmid, oneway as a bool, and the kept tags as text
    attribution: str | None = ATTRIBUTION


@dataclass(slots=True, frozen=True, eq=False)
class Segments:
    """Straight pieces of road between consecutive vertices, in the order of the file."""

    lonlat: FloatArray  # (nodes, 2)  degrees, in first-seen order
    sources: IntArray  # (segments,)  node rows
    targets: IntArray  # (segments,)  node rows
    ways: IntArray  # (segments,)  way rows


def is_road(highway: str, area: str | None) -> bool:
    """Return whether a way with these tags can be walked, ridden or driven."""
    return highway not in NO_ROADS and area != "yes"


def is_open_to(osm_type: OSMType | None, tags: Mapping[str, str]) -> bool:
    """Return whether a way is a road for this way of moving; for None, for any."""
    if not is_road(tags["highway"], tags.get("area")):
        return False
    closed = CLOSED_TO[osm_type] if osm_type is not None else {}
    return not any(tags.get(name) in values for name, values in closed.items())


def traffic_rule(osm_type: OSMType | None, tags: Mapping[str, Any]) -> object:
    """Return the value of `oneway` that holds for this way of moving: bicycles may have one of their own."""
    rule = tags.get("oneway")
    return tags.get("oneway:bicycle", rule) if osm_type is OSMType.BIKE else rule


def is_against(oneway: object) -> bool:
    """Return whether the traffic of a one-way road runs against the order of its vertices."""
    return oneway in _AGAINST


def is_one_way(oneway: object, junction: object) -> bool:
    """Return whether traffic runs one way: where nothing is said it does so in a roundabout only."""
    return oneway is True or oneway in _ONE_WAY or (oneway is None and junction == "roundabout")


def kept_tags(
    osmid: int, tags: Mapping[str, str], osm_type: OSMType | None = None, names: Iterable[str] = KEPT_TAGS
) -> dict[str, Any]:
    """Return the attributes of a way: its tags under their own names, `oneway` as a bool."""
    kept: dict[str, Any] = {"osmid": osmid}
    kept.update((name, tags[name]) for name in names if name in tags)
    kept["oneway"] = is_one_way(traffic_rule(osm_type, tags), tags.get("junction"))
    return kept


def segments_of(ways: Ways) -> Segments:
    """Cut the ways at every vertex; a vertex that the file lacks leaves a gap, never a line across it."""
    way = np.repeat(np.arange(len(ways.tags)), np.diff(ways.offsets))
    there = np.isfinite(ways.lonlat[:, 0])
    joined = (way[:-1] == way[1:]) & there[:-1] & there[1:] & (ways.refs[:-1] != ways.refs[1:])
    first = np.flatnonzero(joined)
    positions = np.column_stack((first, first + 1))
    way = way[first]
    positions[ways.against[way]] = positions[ways.against[way], ::-1]
    rows, firsts = first_seen(ways.refs[positions].ravel())
    sources, targets = rows[0::2], rows[1::2]
    return Segments(ways.lonlat[positions.ravel()[firsts]], sources, targets, way)


def largest_part(segments: Segments) -> Segments:
    """Return the connected part with the most nodes; of equals the one that the file names first."""
    label = components(segments.sources, segments.targets, len(segments.lonlat))
    inside = label == np.bincount(label).argmax()
    kept = inside[segments.sources]
    row = np.cumsum(inside) - 1
    return Segments(
        segments.lonlat[inside], row[segments.sources[kept]], row[segments.targets[kept]], segments.ways[kept]
    )


def first_seen(keys: IntArray) -> tuple[IntArray, IntArray]:
    """Number the distinct keys 0, 1, … in the order in which they first appear.

    Returns:
        `numbers` (keys,), the number of each key; `firsts` (distinct,), where each number first appears.
    """
    _, firsts, inverse = np.unique(keys, return_index=True, return_inverse=True)
    order = np.argsort(firsts)
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(len(order))
    return rank[inverse], firsts[order]


def components(a: IntArray, b: IntArray, count: int) -> IntArray:
    """Return the smallest row that each of `count` rows is connected to by the pairs `(a[i], b[i])`.

    Union by minimum with pointer jumping: the number of rounds grows with the logarithm of the longest chain.
    """
    label = np.arange(count)
    while True:
        left, right = label[a], label[b]
        differ = left != right
        if not differ.any():
            return label
        a, b = a[differ], b[differ]
        low, high = np.minimum(left, right)[differ], np.maximum(left, right)[differ]
        np.minimum.at(label, high, low)
        label = _flattened(label)


def _flattened(label: IntArray) -> IntArray:
    while True:
        further = label[label]
        if np.array_equal(further, label):
            return label
        label = further
