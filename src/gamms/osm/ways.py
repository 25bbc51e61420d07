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
# values written out; None stands for any way of moving, to which only what is no road is closed.
_NO_ROADS = {"abandoned", "construction", "no", "planned", "platform", "proposed", "raceway", "razed"}
_NO_ROADS |= {"rest_area", "services"}
_NOT_ON_FOOT = _NO_ROADS | {"bus_guideway", "cycleway", "motorway", "motorway_link"}
_INDOORS = {"corridor", "elevator", "escalator", "footway", "steps"}
_NO_STREETS = {"bridleway", "bus_guideway", "cycleway", "path", "pedestrian", "service", "track"}
_DRIVEWAYS = {"alley", "driveway", "emergency_access", "parking", "parking_aisle", "private"}
_PRIVATE = {"access": {"private"}, "service": {"private"}}
_NO_AREA = {"area": {"yes"}}
CLOSED_TO: dict[OSMType | None, dict[str, set[str]]] = {
    None: {"highway": _NO_ROADS} | _NO_AREA,
    OSMType.WALK: _PRIVATE | {"highway": _NOT_ON_FOOT, "foot": {"no"}} | _NO_AREA,
    OSMType.BIKE: _PRIVATE | {"highway": (_NOT_ON_FOOT - {"cycleway"}) | _INDOORS, "bicycle": {"no"}} | _NO_AREA,
    OSMType.DRIVE: {
        "access": {"private"},
        "highway": _NO_ROADS | _INDOORS | _NO_STREETS,
        "motor_vehicle": {"no"},
        "motorcar": {"no"},
        "service": _DRIVEWAYS,
    }
    | _NO_AREA,
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


def is_open_to(osm_type: OSMType | None, tags: Mapping[str, str]) -> bool:
    """Return whether a way is a road for this way of moving; for None, for any."""
    return not any(tags.get(name) in values for name, values in CLOSED_TO[osm_type].items())


def is_against(oneway: object) -> bool:
    """Return whether the traffic of a one-way road runs against the order of its vertices."""
    return oneway in _AGAINST


def is_one_way(oneway: object, junction: object) -> bool:
    """Return whether traffic runs one way: where nothing is said it does so in a roundabout only."""
    return oneway is True or oneway in _ONE_WAY or (oneway is None and junction == "roundabout")


def kept_tags(
    osmid: int, tags: Mapping[str, str], osm_type: OSMType | None = None, names: Iterable[str] = KEPT_TAGS
) -> tuple[dict[str, Any], bool]:
    """Return the attributes of a way, and whether its traffic runs against the order of its vertices.

    These are its tags under their own names, and `oneway` as a bool. Bicycles may have a rule of their own for that.
    """
    rule = tags.get("oneway")
    if osm_type is OSMType.BIKE:
        rule = tags.get("oneway:bicycle", rule)
    kept = {name: tags[name] for name in names if name in tags}
    return {"osmid": osmid, **kept, "oneway": is_one_way(rule, tags.get("junction"))}, is_against(rule)


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
