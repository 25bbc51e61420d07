"""Road networks as columns: the ways of a map, the rules that select roads from them, and roads with polylines."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Any, NamedTuple

import numpy as np

from gamms import kernels
from gamms.arguments import as_member
from gamms.errors import BadType
from gamms.ir.graph import FORBIDDEN_TURNS, FloatArray, GraphColumns, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.ir.projection import WGS84, compute_ground_scale, find_utm_crs, is_true, measure_on_ellipsoid, project
from gamms.osm.footprints import BuildingIndex
from gamms.osm.objects import (
    DIRECTIONS,
    ONE_WAY,
    TWO_WAY,
    NodeTags,
    is_against,
    is_one_way,
    normalize_tags,
    read_edge_values,
    split_words,
)
from gamms.osm.speeds import CARS, has_special_signs, list_unread_signs, sign_in_force
from gamms.osm.turns import (
    ForbiddenTurns,
    RoadPieces,
    TurnRelation,
    TurnRestriction,
    choose,
    read_turns_of_edges,
    renumber,
)
from gamms.text import shown

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
    "layer",
    "level",
)
ROADS = ("highway",)  # the keys of ways that are roads
# Keys of ways of other networks; edges keep them where there is no `highway`.
NETWORK_KEYS = ("railway", "route", "waterway", "aerialway", "aeroway", "power", "man_made", "piste:type")
ATTRIBUTION = "© OpenStreetMap contributors, ODbL 1.0"
STATED_SECONDS = "stated_seconds"  # tag with the time that a way takes by the map, until its length is known
_FASTEST_FERRY_KPH = 120.0  # a time that is too short for a ferry is an error of the map
BACKWARD_TAGS = "tags:backward"  # tag with the tags that hold against the traffic of a two-way road only
_UPRIGHT = frozenset(("steps", "escalator", "elevator"))  # their speed already includes the climb


class OSMType(Enum):
    """The modes of travel of gamms 1.0.0."""

    WALK = 0
    BIKE = 1
    DRIVE = 2


def as_osm_type(value: object) -> OSMType:
    """Return a mode of travel of 1.0.0, given as such or by its name.

    Raises:
        BadType: the value is neither.
    """
    kind = as_member(OSMType, value)
    if kind is None:
        raise BadType(f"osm_type must be OSMType.WALK, BIKE or DRIVE, or such a name, not {shown(value)}.")
    return kind


# Tags that close a way, per mode: tag -> values. These are the rules of OSMnx's network types, with the
# values written out; None stands for any mode, to which only ways that are not roads are closed.
_NO_WAYS = {"abandoned", "construction", "no", "planned", "proposed", "raceway", "razed", "rest_area", "services"}
_NO_ROADS = _NO_WAYS | {"platform"}
_NOT_ON_FOOT = _NO_ROADS | {"bus_guideway", "cycleway", "motorway", "motorway_link"}
_INDOORS = {"corridor", "elevator", "escalator", "footway", "steps"}
_NO_STREETS = {"bridleway", "bus_guideway", "cycleway", "path", "pedestrian", "service", "track"}
_DRIVEWAYS = {"alley", "driveway", "emergency_access", "parking", "parking_aisle", "private"}
_PRIVATE = {"access": {"private"}, "service": {"private"}}
_NO_AREA = {"area": {"yes"}}
_SEPARATE = {  # a separate way for walking exists
    name: {"separate"} for name in ("sidewalk", "sidewalk:both", "sidewalk:left", "sidewalk:right")
}
CLOSED_TO: dict[OSMType | None, dict[str, set[str]]] = {
    None: {"highway": _NO_WAYS},
    OSMType.WALK: _PRIVATE | {"highway": _NOT_ON_FOOT, "foot": {"no"}} | _NO_AREA | _SEPARATE,
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


_NO_NODE_TAGS = NodeTags()


@dataclass(slots=True, frozen=True, eq=False)
class OsmRoads:
    """Roads as in the file: way `i` visits the positions `offsets[i]:offsets[i + 1]`."""

    offsets: IntArray  # (ways + 1,)
    refs: IntArray  # (positions,)  OpenStreetMap node ids
    lonlat: FloatArray  # (positions, 2)  degrees, NaN where the file lacks the node
    against: BoolArray  # (ways,)  one-way against the order of the positions
    tags: Sequence[Mapping[str, Any]]  # (ways,)  osmid, oneway as a bool, and the kept tags as text
    attribution: str | None = ATTRIBUTION
    areas: Sequence[Sequence[int]] = ()  # (areas,)  rows of the ways around each open area, in any order
    nodes: NodeTags | None = _NO_NODE_TAGS  # None: `refs` are not ids of OpenStreetMap
    barriers: Collection[int] = ()  # ids of nodes that no agent can pass
    buildings: BuildingIndex | None = None  # of the map; None: unknown
    ids: Sequence[int] = ()  # (ways,)  OpenStreetMap way ids, if known; equal for the pieces of one way
    signs: Sequence[TurnRelation] = ()  # the turn restrictions of the map
    restrictions: Mapping[str, Sequence[TurnRestriction]] = field(default_factory=dict)  # that hold, by mode of travel
    without_nodes: int = 0  # the number of ways that are left out, because they have fewer than two nodes


@dataclass(slots=True, frozen=True, eq=False)
class RoadSegments:
    """Straight pieces of road between consecutive vertices, in the order of the file."""

    lonlat: FloatArray  # (nodes, 2)  degrees, in first-seen order
    sources: IntArray  # (segments,)  node rows
    targets: IntArray  # (segments,)  node rows
    ways: IntArray  # (segments,)  way rows
    refs: IntArray | None = None  # (nodes,)  OpenStreetMap node ids
    turns: ForbiddenTurns = field(default_factory=dict)
    turn_restrictions: int = 0  # of the map that hold on these roads


def is_upright(tags: Mapping[str, Any]) -> bool:
    """Return whether a way is stairs or an elevator."""
    return not _UPRIGHT.isdisjoint(split_words(tags.get("highway")))


Rule = Callable[[int, Mapping[str, str]], tuple[dict[str, Any], bool] | None]
"""From the id and tags of a way to its attributes and whether traffic runs against its vertices; None: closed."""


Stops = Callable[[Mapping[str, str]], bool]
"""From the tags of a node to whether it is a barrier that agents cannot pass."""


def make_classic_rule(osm_type: OSMType | None, *, every_way: bool = False) -> Rule:
    """Return the rule of OSMnx's network type, with the directions of traffic.

    Args:
        osm_type: the network type; None: all roads.
        every_way: take all ways with a `highway` tag, as gamms 1.0.0 does for files, including planned roads.
    """
    closed = make_classic_closed_rule(osm_type)

    def rule(osmid: int, tags: Mapping[str, str]) -> tuple[dict[str, Any], bool] | None:
        if not every_way and closed(osmid, tags):
            return None
        kept, against = keep_tags(osmid, tags, osm_type)
        return add_signs(kept, tags, against=against), against

    return rule


def make_classic_closed_rule(osm_type: OSMType | None) -> Rule:
    """Return the rule for the ways that `make_classic_rule` leaves out, with the closing tag as `why`."""

    def closed(osmid: int, tags: Mapping[str, str]) -> tuple[dict[str, Any], bool] | None:
        plain = normalize_tags(tags)
        why = next(
            (found for name, values in CLOSED_TO[osm_type].items() if (found := find_closing_tag(plain, name, values))),
            None,
        )
        return None if why is None else ({"osmid": osmid, "why": why, "oneway": False}, False)

    return closed


def list_classic_ignored_values(tags: Mapping[str, str]) -> list[str]:
    """Return the tags with the direction and speed of traffic that have no known meaning, as "key=word"."""
    plain = normalize_tags(tags)
    unknown = (word for word in split_words(plain.get("oneway")) if word not in ONE_WAY | TWO_WAY)
    return [*(f"oneway={word}" for word in unknown), *list_unread_signs(plain, CARS)]


def find_closing_tag(tags: Mapping[str, str], name: str, values: Collection[str]) -> str:
    """Return a tag as "key=words" if all of its words are among these values, else ""."""
    words = split_words(tags[name]) if name in tags else []
    return f"{name}={';'.join(words)}" if words and all(word in values for word in words) else ""


def make_attributes(osmid: int, tags: Mapping[str, str], names: Iterable[str] = KEPT_TAGS) -> dict[str, Any]:
    """Return the id of a way and its kept tags."""
    if "highway" not in tags:
        names = (*names, *NETWORK_KEYS, "duration")
    return {"osmid": osmid, **{name: tags[name] for name in names if name in tags}}


def keep_tags(
    osmid: int, tags: Mapping[str, str], osm_type: OSMType | None = None, names: Iterable[str] = KEPT_TAGS
) -> tuple[dict[str, Any], bool]:
    """Return the attributes of a way, and whether its traffic runs against the order of its vertices.

    The attributes are its tags under their own names, and `oneway` as a bool. Bicycles may have their own tag for it.
    """
    plain = normalize_tags(tags)
    rule = plain.get("oneway")
    if osm_type is OSMType.BIKE:
        rule = plain.get("oneway:bicycle", rule)
    one_way = is_one_way(rule, plain.get("junction"))
    return {**make_attributes(osmid, tags, names), "oneway": one_way}, is_against(rule)


def add_signs(attributes: dict[str, Any], tags: Mapping[str, Any], *, against: bool) -> dict[str, Any]:
    """Return the attributes of a way with `maxspeed` as its signs have it for cars, in each direction."""
    plain = normalize_tags(tags)
    if not has_special_signs(plain):
        return attributes
    signs = [sign_in_force(plain, CARS, direction) for direction in DIRECTIONS]
    return add_directions(attributes, signs, against=against)


def add_directions(
    attributes: dict[str, Any], directed: Sequence[Mapping[str, Any]], *, against: bool
) -> dict[str, Any]:
    """Return the attributes of a way with others that hold in one direction only.

    Args:
        attributes: of the way.
        directed: the attributes along the vertices of the way, and against them.
        against: whether its traffic runs against the vertices.
    """
    first, other = reversed(directed) if against else directed
    found = {**attributes, **first}
    if not attributes["oneway"] and first != other:
        back = {name: other.get(name, attributes.get(name)) for name in {**first, **other}}
        found[BACKWARD_TAGS] = {**attributes.get(BACKWARD_TAGS, {}), **back}
    return found


def split_directions(tags: Sequence[Mapping[str, Any]]) -> tuple[Sequence[Mapping[str, Any]], IntArray | None]:
    """Return the tags with a row for each direction of ways where they differ, and (ways,) the rows of the way back.

    The latter are None if all ways have the same tags in both directions.
    """
    differing = {row: of_way[BACKWARD_TAGS] for row, of_way in enumerate(tags) if BACKWARD_TAGS in of_way}
    if not differing:
        return tags, None
    rows = np.arange(len(tags))
    rows[[*differing]] = len(tags) + np.arange(len(differing))
    split = [*tags]
    for row, other in differing.items():
        own = {name: value for name, value in tags[row].items() if name != BACKWARD_TAGS}
        split[row] = own
        split.append({name: value for name, value in {**own, **other}.items() if value is not None})
    return split, rows


def add_stated_times(ways: OsmRoads) -> OsmRoads:
    """Return the ways with the speeds that follow from their length and the time that the map states for them.

    A way of which a node is missing, or that would be faster than 120 km/h, keeps its usual speed.
    """
    if not any(STATED_SECONDS in of_way for of_way in ways.tags):
        return ways
    tags = list[Mapping[str, Any]]()
    for of_way, start, end in zip(ways.tags, ways.offsets[:-1], ways.offsets[1:], strict=True):
        own = {name: value for name, value in of_way.items() if name != STATED_SECONDS}
        if STATED_SECONDS in of_way:
            line = ways.lonlat[start:end]
            kph = 3.6 * float(measure_on_ellipsoid(line[:-1], line[1:]).sum()) / of_way[STATED_SECONDS]
            own.update({"speed_kph": kph} if 0.0 < kph <= _FASTEST_FERRY_KPH else {})
        tags.append(own)
    return replace(ways, tags=tags)


def describe_read_ways(keys: Sequence[str]) -> str:
    """Return which ways are read, for errors."""
    if tuple(keys) == ROADS:
        return "Only ways with a highway tag are read, not railways, ferries or waterways"
    return f"Only ways with one of the tags {', '.join(keys)} are read"


def cut_segments(ways: OsmRoads) -> RoadSegments:
    """Cut the ways at every vertex; a vertex that the file lacks leaves a gap, never a line across it.

    At a barrier each piece of road ends at a node of its own.
    """
    way = np.repeat(np.arange(len(ways.tags)), np.diff(ways.offsets))
    there = np.isfinite(ways.lonlat[:, 0])
    joined = (way[:-1] == way[1:]) & there[:-1] & there[1:] & (ways.refs[:-1] != ways.refs[1:])
    first = np.flatnonzero(joined)
    positions = np.column_stack((first, first + 1))
    way = way[first]
    positions[ways.against[way]] = positions[ways.against[way], ::-1]
    ends = ways.refs[positions].ravel()
    rows, firsts = kernels.number_by_appearance(ends)
    if ways.barriers:
        shut = np.isin(ends, [*ways.barriers])
        rows[shut] = len(ends) + np.arange(shut.sum())
        rows, firsts = kernels.number_by_appearance(rows)
    sources = rows[0::2]
    targets = rows[1::2]
    firsts = positions.ravel()[firsts]
    refs = None if ways.nodes is None else ways.refs[firsts]
    return RoadSegments(ways.lonlat[firsts], sources, targets, way, refs)


def add_turns(segments: RoadSegments, ways: OsmRoads, kept: BoolArray | None = None) -> RoadSegments:
    """Return the segments of ways with the paths that turn restrictions forbid.

    Args:
        segments: the segments.
        ways: their ways.
        kept: (segments,) the segments that stay on the map: a restriction that permits only other ones does not hold,
            because it would trap traffic. None: all.
    """
    if not ways.restrictions:
        return segments
    named = {id for held in ways.restrictions.values() for one in held for id in one.list_ways()}
    rows = [row for row, id in enumerate(ways.ids) if id in named]
    of_way: dict[int, list[int]] = {}
    is_named = np.isin(segments.ways, rows)
    for segment in np.flatnonzero(is_named if kept is None else is_named & kept).tolist():
        of_way.setdefault(ways.ids[segments.ways[segment]], []).append(segment)
    vias = {id for held in ways.restrictions.values() for one in held for id in one.list_nodes()}
    places: dict[int, list[int]] = {}
    refs = np.zeros(0, np.int64) if segments.refs is None else segments.refs
    for node in np.flatnonzero(np.isin(refs, [*vias])).tolist():
        places.setdefault(int(refs[node]), []).append(node)
    one_way = np.fromiter((bool(of_way["oneway"]) for of_way in ways.tags), np.bool_, len(ways.tags))
    ends = (segments.sources, segments.targets)
    pieces = RoadPieces(*ends, len(segments.lonlat), of_way, places, one_way[segments.ways])
    found = {mode: pieces.find_forbidden(held) for mode, held in ways.restrictions.items()}
    return replace(
        segments,
        turns={mode: paths for mode, (paths, _) in found.items()},
        turn_restrictions=sum(count for _, count in found.values()),
    )


def find_largest_part(segments: RoadSegments, one_way: BoolArray | None = None) -> RoadSegments:
    """Return the connected part with the most nodes; ties go to the part that comes first in the file.

    Args:
        segments: pieces of road.
        one_way: (segments,) whether they lead from source to target only; if given, return the largest part in which
            every node can be reached from every other.
    """
    return _select_segments(segments, find_nodes_in_largest(segments, one_way))


def find_nodes_in_largest(segments: RoadSegments, one_way: BoolArray | None) -> BoolArray:
    """Return a mask of the nodes in the largest part; see `find_largest_part`."""
    count = len(segments.lonlat)
    sources = segments.sources
    targets = segments.targets
    if one_way is None:
        label = find_components(sources, targets, count)
    else:
        back = ~one_way
        ends = np.concatenate((sources, targets[back])), np.concatenate((targets, sources[back]))
        label = find_strong_components(*ends, count)
    return np.asarray(label == np.bincount(label).argmax())


def _select_segments(segments: RoadSegments, inside: BoolArray) -> RoadSegments:
    kept = inside[segments.sources] & inside[segments.targets]
    row = np.cumsum(inside) - 1
    return replace(
        segments,
        lonlat=segments.lonlat[inside],
        sources=row[segments.sources[kept]],
        targets=row[segments.targets[kept]],
        ways=segments.ways[kept],
        refs=None if segments.refs is None else segments.refs[inside],
    )


def find_components(a: IntArray, b: IntArray, count: int) -> IntArray:
    """Return the smallest row connected with each of `count` rows by the pairs `(a[i], b[i])`.

    Union by minimum with pointer jumping: the number of rounds grows with the logarithm of the longest chain.
    """
    label = np.arange(count)
    while True:
        left = label[a]
        right = label[b]
        differ = left != right
        if not differ.any():
            return label
        a = a[differ]
        b = b[differ]
        low = np.minimum(left, right)[differ]
        high = np.maximum(left, right)[differ]
        np.minimum.at(label, high, low)
        while not np.array_equal(further := label[label], label):
            label = further


def find_strong_components(sources: IntArray, targets: IntArray, count: int) -> IntArray:
    """Return for each of `count` rows the smallest row in its strongly connected component.

    Kosaraju's algorithm: in the reverse order in which a depth-first search leaves them, rows collect the rows that
    lead to them.
    """
    begins, back = _list_neighbors(targets, sources, count)
    label = [-1] * count
    for start in reversed(_order_by_search(*_list_neighbors(sources, targets, count))):
        waiting = [start] if label[start] < 0 else []
        while waiting:
            row = waiting.pop()
            label[row] = start
            waiting += [ahead for ahead in back[begins[row] : begins[row + 1]] if label[ahead] < 0]
    smallest = np.full(count, count)
    np.minimum.at(smallest, label, np.arange(count))
    return smallest[label]


def _list_neighbors(sources: IntArray, targets: IntArray, count: int) -> tuple[list[int], list[int]]:
    """Return the offsets of the rows' targets in a list, and that list."""
    offsets, steps = kernels.group_rows(sources, count)
    return offsets.tolist(), targets[steps].tolist()


def _order_by_search(begins: list[int], onward: list[int]) -> list[int]:
    """Return all rows in the order in which a depth-first search leaves them."""
    seen = bytearray(len(begins) - 1)
    cursor = begins[:-1]
    order = list[int]()
    for start in range(len(seen)):
        walk = [] if seen[start] else [start]
        seen[start] = True
        while walk:
            row = walk[-1]
            at = cursor[row]
            cursor[row] += 1
            if at == begins[row + 1]:
                order.append(walk.pop())
            elif not seen[onward[at]]:
                seen[onward[at]] = True
                walk.append(onward[at])
    return order


_SAME = 1e-6  # meters between vertices, and the relative difference of lengths
_PLANAR = 1e-3  # relative difference of a planar length


def reverse_points(offsets: IntArray) -> IntArray:
    """Return the rows of the points with every line reversed."""
    mirror = np.repeat(offsets[:-1] + offsets[1:] - 1, np.diff(offsets))
    return mirror - np.arange(offsets[-1])


def find_segment_starts(offsets: IntArray) -> IntArray:
    """Return the rows of the points at which straight pieces of lines begin; each ends at the next point."""
    return np.delete(np.arange(offsets[-1]), offsets[1:] - 1)


def measure_along(offsets: IntArray, points: FloatArray) -> FloatArray:
    """Return the distance of each point along its line."""
    if not len(points):
        return np.zeros(0)
    step = np.zeros(len(points))
    step[1:] = np.hypot(*np.diff(points, axis=0).T)
    step[offsets[:-1]] = 0.0
    total = np.cumsum(step)
    return np.asarray(total - np.repeat(total[offsets[:-1]], np.diff(offsets)))


def extend_to_ends(
    offsets: IntArray, points: FloatArray, start: FloatArray, end: FloatArray
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Extend every line to begin at `start` and end at `end`, with added points where needed.

    Returns:
        The new offsets, the new points, and the growth of each line.
    """
    head = points[offsets[:-1]]
    tail = points[offsets[1:] - 1]
    before = (head != start).any(axis=1)
    after = (tail != end).any(axis=1)
    grown = compute_offsets(np.diff(offsets) + before + after)
    result = np.empty((grown[-1], 2))
    shift = np.repeat(grown[:-1] + before - offsets[:-1], np.diff(offsets))
    result[np.arange(len(points)) + shift] = points
    result[grown[:-1]] = start
    result[grown[1:] - 1] = end
    return grown, result, np.hypot(*(head - start).T) + np.hypot(*(end - tail).T)


def move_ends(
    offsets: IntArray, points: FloatArray, start: FloatArray, end: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Move the first point of every line to `start` and its last to `end`.

    Returns:
        The new points, and the factor by which the drawn length of each line changes.
    """
    moved = points.copy()
    moved[offsets[:-1]] = start
    moved[offsets[1:] - 1] = end
    before = measure_lengths(offsets, points)
    after = measure_lengths(offsets, moved)
    return moved, np.divide(after, before, out=np.ones_like(after), where=before > 0.0)


def measure_lengths(offsets: IntArray, points: FloatArray) -> FloatArray:
    """Return the drawn length of each line."""
    steps = np.hypot(*np.diff(points, axis=0, append=points[-1:]).T)
    steps[offsets[1:] - 1] = 0.0  # from the end of a line to the beginning of the next
    return np.add.reduceat(steps, offsets[:-1]) if len(offsets) > 1 else np.zeros(0)


def compute_offsets(counts: IntArray) -> IntArray:
    """Return the offsets of consecutive groups of these sizes."""
    offsets = np.zeros(len(counts) + 1, np.int64)
    np.cumsum(counts, out=offsets[1:])
    return offsets


class MergedJunctions(NamedTuple):
    """The roads and lengths that merging junctions has removed so far."""

    nodes: int = 0
    length_m: float = 0.0  # of the roads inside junctions


class CoverageGaps(NamedTuple):
    """The open roads of a map that a graph lacks, in meters, and the lines that it adds."""

    other_parts_m: float = 0.0  # not connected with the kept part
    no_way_back_m: float = 0.0  # connected with it, but one-way streets do not lead there and back
    barriers: int = 0  # places where agents of the mode cannot pass
    across_m: float = 0.0  # of added lines across squares, on the whole map
    doubled_m: float = 0.0  # of roads that are there again, for those of several modes that a barrier stops


_NOTHING = MergedJunctions()
_ALL_IN = CoverageGaps()


@dataclass(slots=True, frozen=True, eq=False)
class RoadNetwork:
    """Roads from source to target nodes; traffic runs that way, or both ways if `two_way`."""

    xy: FloatArray  # (nodes, 2)  meters
    sources: IntArray  # (roads,)  node rows
    targets: IntArray  # (roads,)  node rows
    offsets: IntArray  # (roads + 1,)  polylines: road i has the points offsets[i]:offsets[i + 1]
    points: FloatArray  # (points, 2)  the first and last of a road are its nodes
    lengths: FloatArray  # (roads,)  true meters
    two_way: BoolArray  # (roads,)
    ways: IntArray  # (roads,)  rows of `tags`
    tags: Sequence[Mapping[str, Any]]  # (ways,)  attributes that the roads of a way share
    crs: str | None
    back_ways: IntArray | None = None  # (roads,)  rows of `tags` for the way back; None: as `ways`
    merged: MergedJunctions = _NOTHING
    left_out: CoverageGaps = _ALL_IN
    attribution: str | None = ATTRIBUTION
    refs: IntArray | None = None  # (nodes,)  OpenStreetMap node ids; 0 for a node without one
    nodes: NodeTags = _NO_NODE_TAGS
    z: FloatArray | None = None  # (nodes,)  meters above sea level
    are_walked: tuple[bool, ...] = ()  # whether slopes affect travel times, of each of `modes` or of the only one
    modes: tuple[str, ...] = ()  # the attributes of `tags` with the speeds of several modes of travel; 0: closed
    buildings: BuildingIndex | None = None  # of the map; None: unknown
    tunnels: IntArray | None = None  # (nodes,)  number of the tunnel in which a node lies; 0: on the surface
    turns: ForbiddenTurns = field(default_factory=dict)
    turn_restrictions: int = 0  # of the map that hold on these roads


def make_network_of_part(segments: RoadSegments, ways: OsmRoads, *, strong: bool) -> RoadNetwork:
    """Project the largest part of a map to meters; `left_out` of the result counts the rest.

    Args:
        segments: pieces of road; at least one.
        ways: their ways.
        strong: whether every node of the part has to be reachable from every other, in the directions of the roads.
    """
    inside = find_nodes_in_largest(segments, find_one_way_segments(segments, ways.tags) if strong else None)
    out = ~(inside[segments.sources] & inside[segments.targets])
    sources = segments.sources[out]
    targets = segments.targets[out]
    metres = measure_on_ellipsoid(segments.lonlat[sources], segments.lonlat[targets])
    joined = find_components(segments.sources, segments.targets, len(segments.lonlat))
    near = joined[sources] == joined[inside.argmax()]
    left_out = CoverageGaps(float(metres[~near].sum()), float(metres[near].sum()))
    part = add_turns(_select_segments(segments, inside), ways)
    return replace(make_network_of_segments(part, ways.tags), left_out=left_out)


def make_network_of_segments(segments: RoadSegments, tags: Sequence[Mapping[str, Any]]) -> RoadNetwork:
    """Project pieces of road to meters; lengths are measured on the ellipsoid, not on the map."""
    of_directions, back = split_directions(tags)
    roads = make_network_in_degrees(
        segments,
        two_way=~find_one_way_segments(segments, tags),
        tags=of_directions,
        back_ways=None if back is None else back[segments.ways],
    )
    return project_to_metres(roads)


def find_one_way_segments(segments: RoadSegments, tags: Sequence[Mapping[str, Any]]) -> BoolArray:
    """Return a mask of the pieces of road that are one-way by the tags of the ways."""
    return np.fromiter((bool(of_way["oneway"]) for of_way in tags), np.bool_, len(tags))[segments.ways]


def make_network_in_degrees(
    segments: RoadSegments, *, two_way: BoolArray, tags: Sequence[Mapping[str, Any]], back_ways: IntArray | None
) -> RoadNetwork:
    """Return pieces of road as a network in degrees, without a CRS; their lengths are in meters.

    Args:
        segments: the pieces, with rows of `tags` as their ways.
        two_way: (segments,)
        tags: the attributes of directions of ways.
        back_ways: (segments,) rows of `tags` for the way back; None: as the ways.
    """
    lengths = measure_on_ellipsoid(segments.lonlat[segments.sources], segments.lonlat[segments.targets])
    roads = make_network_of_lines(segments.lonlat, (segments.sources, segments.targets), {}, lengths, tags, None)
    roads = replace(roads, two_way=two_way, ways=segments.ways, back_ways=back_ways, refs=segments.refs)
    return replace(roads, turns=segments.turns, turn_restrictions=segments.turn_restrictions)


def project_to_metres(network: RoadNetwork) -> RoadNetwork:
    """Project straight roads in degrees to UTM; their lengths stay."""
    crs = find_utm_crs(network.xy)
    xy = project(network.xy, WGS84, crs)
    points = xy[np.column_stack((network.sources, network.targets)).ravel()]
    return replace(network, xy=xy, points=points, crs=crs)


def make_network_of_lines(
    xy: FloatArray,
    ends: tuple[IntArray, IntArray],
    polylines: Mapping[int, FloatArray],
    lengths: FloatArray,
    tags: Sequence[Mapping[str, Any]],
    crs: str | None,
) -> RoadNetwork:
    """Return a network of one-way roads from its parts; road `i` has the vertices `polylines[i]`, or is straight.

    Nothing is measured or projected: a length may still be NaN, and a polyline may miss its nodes.
    """
    sources, targets = (np.asarray(rows, np.int64) for rows in ends)
    counts = np.full(len(sources), 2)
    counts[list(polylines)] = [len(polyline) for polyline in polylines.values()]
    offsets = compute_offsets(counts)
    points = np.empty((offsets[-1], 2))
    points[offsets[:-1]] = xy[sources]
    points[offsets[1:] - 1] = xy[targets]
    for road, polyline in polylines.items():
        points[offsets[road] : offsets[road + 1]] = polyline
    two_way = np.zeros(len(sources), np.bool_)
    ways = np.arange(len(sources))
    return RoadNetwork(xy, sources, targets, offsets, points, lengths, two_way, ways, tags, crs)


def project_network(network: RoadNetwork, source: str) -> RoadNetwork:
    """Project a network in degrees to UTM; measure unknown lengths on the ellipsoid."""
    crs = find_utm_crs(network.xy)
    start = find_segment_starts(network.offsets)
    steps = measure_on_ellipsoid(network.points[start], network.points[start + 1])
    line = np.repeat(np.arange(len(network.sources)), np.diff(network.offsets) - 1)
    measured = np.bincount(line, weights=steps, minlength=len(network.sources))
    return replace(
        network,
        xy=project(network.xy, source, crs),
        points=project(network.points, source, crs),
        lengths=np.where(np.isnan(network.lengths), measured, network.lengths),
        crs=crs,
    )


def project_to_true_metres(network: RoadNetwork, crs: str) -> RoadNetwork:
    """Return a network in the meters of a CRS; where these are not true to scale, it is projected to UTM.

    A length that is the planar one there counts as unknown, because it is not in meters.
    """
    if is_true(compute_ground_scale(crs, network.xy)):
        return replace(network, crs=crs)
    drawn = measure_lengths(network.offsets, network.points)
    is_planar = np.abs(network.lengths - drawn) <= _PLANAR * drawn
    lonlat = replace(
        network,
        xy=project(network.xy, crs, WGS84),
        points=project(network.points, crs, WGS84),
        lengths=np.where(is_planar, np.nan, network.lengths),
    )
    return project_network(lonlat, WGS84)


def connect_polylines(network: RoadNetwork) -> RoadNetwork:
    """Extend every polyline to its nodes, and set each unknown length to the length of the polyline."""
    start = network.xy[network.sources]
    end = network.xy[network.targets]
    offsets, points, _ = extend_to_ends(network.offsets, network.points, start, end)
    on_map = measure_along(offsets, points)[offsets[1:] - 1]
    lengths = np.where(np.isnan(network.lengths), on_map, network.lengths)
    return replace(network, offsets=offsets, points=points, lengths=lengths)


def select_roads(network: RoadNetwork, roads: IntArray) -> RoadNetwork:
    """Return the network with only these roads, in the order of `roads`, and all nodes."""
    taken, offsets = kernels.select_runs(network.offsets, roads)
    return replace(
        network,
        sources=network.sources[roads],
        targets=network.targets[roads],
        offsets=offsets,
        points=network.points[taken],
        lengths=network.lengths[roads],
        two_way=network.two_way[roads],
        ways=network.ways[roads],
        back_ways=None if network.back_ways is None else network.back_ways[roads],
        turns=choose(network.turns, roads, len(network.sources)),
    )


def find_ways_back(network: RoadNetwork) -> IntArray:
    """Return for each road the row of its tags on the way back."""
    return network.ways if network.back_ways is None else network.back_ways


def make_two_way(network: RoadNetwork) -> RoadNetwork:
    """Return the network with all roads two-way, for agents that may go against the traffic."""
    return replace(network, two_way=np.ones(len(network.sources), np.bool_))


def make_network_of_columns(columns: GraphColumns) -> RoadNetwork:
    """Return one road per edge: one-way if its attribute `oneway` is true, two-way otherwise.

    Raises:
        BadValue: an edge has a direction, a speed or a time that is not one; see `read_edge_values`.
    """
    given: list[dict[str, Any]] = [{} for _ in range(len(columns.edge_ids))]
    for name, values in columns.edge_attributes.items():
        for row, value in values.items() if name != FORBIDDEN_TURNS else ():
            given[row][name] = value
    signs = columns.edge_attributes.get(FORBIDDEN_TURNS, {})
    turns = read_turns_of_edges(columns.edge_ids.tolist(), signs) if signs else {}
    tags = [read_edge_values(one, f"Edge {id}") for id, one in zip(columns.edge_ids.tolist(), given, strict=True)]
    ends = (columns.sources, columns.targets)
    roads = make_network_of_lines(columns.xy, ends, columns.polylines, columns.lengths, tags, columns.crs)
    two_way = np.fromiter((not of_edge.get("oneway", False) for of_edge in tags), np.bool_, len(tags))
    return connect_polylines(replace(roads, two_way=two_way, turns=turns))


def join_directions(network: RoadNetwork) -> RoadNetwork:
    """Merge each one-way road with its exact reverse into a two-way road.

    Cutting both separately would leave two rows of nearly equal nodes along every street. Both directions keep their
    tags.
    """
    waiting: dict[tuple[int, int], list[int]] = {}
    two_way = network.two_way.copy()
    back_ways = find_ways_back(network).copy()
    numbers = np.arange(2 * len(network.sources))  # of directed roads
    kept: list[int] = []
    for road, ends in enumerate(zip(network.sources.tolist(), network.targets.tolist(), strict=True)):
        back = waiting.get(ends[::-1], [])
        twin = next((other for other in back if _is_reverse(network, road, other)), None)
        if twin is None:
            waiting.setdefault(ends, []).append(road)
            kept.append(road)
        else:
            back.remove(twin)
            two_way[twin] = True
            numbers[2 * road : 2 * road + 2] = 2 * twin + 1, 2 * twin
            back_ways[twin] = network.ways[road]
    joined = replace(network, two_way=two_way, back_ways=back_ways, turns=renumber(network.turns, numbers))
    return select_roads(joined, np.array(kept, np.int64))


def _is_reverse(network: RoadNetwork, road: int, other: int) -> bool:
    here = network.points[network.offsets[road] : network.offsets[road + 1]]
    there = network.points[network.offsets[other] : network.offsets[other + 1]]
    length = float(network.lengths[road])
    length_there = float(network.lengths[other])
    return (
        len(here) == len(there)
        and abs(length - length_there) <= _SAME * max(length, length_there)
        and bool((np.abs(here - there[::-1]) <= _SAME).all())
    )
