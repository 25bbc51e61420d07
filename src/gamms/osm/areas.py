"""Lines across squares: straight lines between junctions on the rim of an area that is open to a mode of travel."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import chain, pairwise
from typing import Any

import numpy as np

from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.projection import measure_on_ellipsoid
from gamms.osm.footprints import find_crossing, find_layer, make_footprints, make_outlines_of_ways, repair
from gamms.osm.network import OsmRoads, Rule

Squares = Mapping[int, tuple[dict[str, Any], list[int]]]
"""Id of an open multipolygon -> (its attributes, the ids of the ways around it)."""

ACROSS = "across_area"  # tag of the added lines, which are not on the map
_NEAREST = 40  # junctions to which lines from a junction may lead
_MOST_JUNCTIONS = 400  # of an area, or ways around it; agents walk around larger areas
_DETOUR = 1.05  # a line is added only if the way along the rim is longer by this factor


def open_squares(relations: Iterable[tuple[int, Mapping[str, str], list[int]]], rule: Rule) -> Squares:
    """Return the multipolygons that a rule accepts as ways; `relations` are (id, tags, ids of ways around it)."""
    found: dict[int, tuple[dict[str, Any], list[int]]] = {}
    for id, tags, rings in relations:
        is_square = "highway" in tags and tags.get("type") == "multipolygon" and id not in found
        taken = rule(id, {**tags, "area": "yes"}) if is_square else None
        if taken is not None:
            found[id] = {**taken[0], "oneway": False}, rings
    return dict(sorted(found.items()))


def find_rims(squares: Squares) -> dict[int, dict[str, Any]]:
    """Return way id -> attributes of the open multipolygon around which it lies; the first of several counts."""
    found: dict[int, dict[str, Any]] = {}
    for of_square, rings in reversed([*squares.values()]):
        found.update(dict.fromkeys(rings, of_square))
    return found


def add_areas(ways: OsmRoads, rows_of: Mapping[int, Sequence[int]], squares: Squares) -> OsmRoads:
    """Return the ways with their open areas: multipolygons, and closed ways with `area=yes`; `rows_of` is by id."""
    areas = [[*chain.from_iterable(rows_of.get(id, ()) for id in rings)] for _, rings in squares.values()]
    is_alone = ways.refs[ways.offsets[:-1]] == ways.refs[ways.offsets[1:] - 1]
    is_alone[list(chain.from_iterable(areas))] = False
    areas += [[row] for row, tags in enumerate(ways.tags) if tags.get("area") == "yes" and is_alone[row]]
    return replace(ways, areas=[rows for rows in areas if rows])


def add_ways_across(ways: OsmRoads) -> OsmRoads:
    """Return the ways with added straight lines across each area, between junctions on its rim that see each other.

    A junction is a node where three stretches of way meet. Lines are added, shortest first, if the way along the rim
    and earlier lines is longer by a twentieth; adding all lines would give many times as many. Holes of an area and
    buildings of the map block lines.
    """
    if not ways.areas:
        return ways
    refs, met = np.unique(_find_stretches(ways), return_counts=True)
    junctions = np.setdiff1d(refs[met > 2], [*ways.barriers])
    outlines = make_outlines_of_ways(ways.offsets, ways.lonlat, [sorted({*rows}) for rows in ways.areas], ways.areas)
    ends = list[int]()
    tags = [*ways.tags]
    for rows, shape in zip(ways.areas, repair(make_footprints(outlines)), strict=True):
        if max(np.isin(_list_refs(ways, rows), junctions).sum(), len(rows)) > _MOST_JUNCTIONS:
            continue
        rim, apart = _measure_along_rim(ways, rows, junctions)
        pairs = _find_near_pairs(rim, ways, junctions)
        pairs = pairs[find_crossing(shape, *ways.lonlat[rim[pairs.T]])]
        if ways.buildings is not None and len(pairs) and not _is_below_ground(ways.tags[rows[0]]):
            start, end = ways.lonlat[rim[pairs.T]]
            pairs = pairs[~ways.buildings.lie_between(start, end, around=shape)]
        lines = rim[_find_needed(pairs, _measure_distances(ways.lonlat[rim], pairs), apart)]
        ends += lines.ravel().tolist()
        tags += [{**ways.tags[rows[0]], "oneway": False, ACROSS: True}] * len(lines)
    added = np.array(ends, np.int64)
    return replace(
        ways,
        offsets=np.append(ways.offsets, ways.offsets[-1] + 2 * np.arange(1, len(added) // 2 + 1)),
        refs=np.append(ways.refs, ways.refs[added]),
        lonlat=np.concatenate((ways.lonlat, ways.lonlat[added])),
        against=np.append(ways.against, np.zeros(len(added) // 2, np.bool_)),
        tags=tags,
    )


def _is_below_ground(tags: Mapping[str, Any]) -> bool:
    return any(find_layer({"layer": str(tags.get(key, "0"))}) < 0 for key in ("layer", "level"))


def measure_across(ways: OsmRoads) -> float:
    """Return the total length of the lines across areas, meters."""
    rows = [row for row, tags in enumerate(ways.tags) if ACROSS in tags]
    first = ways.offsets[rows]
    return float(measure_on_ellipsoid(ways.lonlat[first], ways.lonlat[first + 1]).sum())


def _find_stretches(ways: OsmRoads) -> IntArray:
    """Return the pairs of nodes (stretches, 2) that are consecutive on a way, each once."""
    way = np.repeat(np.arange(len(ways.tags)), np.diff(ways.offsets))
    first = np.flatnonzero((way[:-1] == way[1:]) & (ways.refs[:-1] != ways.refs[1:]))
    return np.unique(np.sort(np.column_stack((ways.refs[first], ways.refs[first + 1])), axis=1), axis=0)


def _list_refs(ways: OsmRoads, rows: Sequence[int]) -> IntArray:
    return np.concatenate([ways.refs[ways.offsets[row] : ways.offsets[row + 1]] for row in rows])


def _measure_along_rim(ways: OsmRoads, rows: Sequence[int], junctions: IntArray) -> tuple[IntArray, FloatArray]:
    """Return a position for each junction and way end on the rim of an area, and their distances along the rim."""
    rank: dict[int, int] = {}  # of a node
    rim = list[int]()
    steps = list[tuple[int, int, float]]()
    for row in rows:
        positions = np.arange(ways.offsets[row], ways.offsets[row + 1])
        steps_of_way = _measure_distances(ways.lonlat[positions], np.arange(len(positions) - 1)[:, None] + (0, 1))
        past = np.append(0.0, np.cumsum(steps_of_way)).tolist()
        is_stop = np.isin(ways.refs[positions], junctions)
        is_stop[[0, -1]] = True
        stops = np.flatnonzero(is_stop & np.isfinite(ways.lonlat[positions, 0])).tolist()
        for stop in stops:
            if rank.setdefault(int(ways.refs[positions[stop]]), len(rim)) == len(rim):
                rim.append(int(positions[stop]))
        ranks = [rank[int(ways.refs[positions[stop]])] for stop in stops]
        steps += [(a, b, past[k] - past[j]) for (a, b), (j, k) in zip(pairwise(ranks), pairwise(stops), strict=True)]
    apart = np.where(np.eye(len(rim), dtype=np.bool_), 0.0, np.inf)
    for a, b, length in steps:
        _update_distances(apart, a, b, length)
    return np.array(rim, np.int64), apart


def _find_near_pairs(rim: IntArray, ways: OsmRoads, junctions: IntArray) -> IntArray:
    """Return pairs of rows (pairs, 2): each junction on the rim with its nearest others, each pair once."""
    chosen = np.flatnonzero(np.isin(ways.refs[rim], junctions))
    pairs = set[tuple[int, int]]()
    for row in chosen.tolist():
        others = chosen[chosen != row]
        far = _measure_distances(ways.lonlat[rim], np.column_stack((np.full(len(others), row), others)))
        near = others[np.argsort(far, kind="stable")[:_NEAREST]].tolist()
        pairs |= {(min(row, other), max(row, other)) for other in near}
    return np.array(sorted(pairs), np.int64).reshape(-1, 2)


def _find_needed(pairs: IntArray, lengths: FloatArray, apart: FloatArray) -> IntArray:
    """Return the pairs to connect: from the shortest on, those whose path so far is a twentieth longer than a line."""
    needed = list[int]()
    for row in np.argsort(lengths, kind="stable").tolist():
        a, b = pairs[row].tolist()
        if apart[a, b] > _DETOUR * lengths[row]:
            needed.append(row)
            _update_distances(apart, a, b, float(lengths[row]))
    return pairs[needed]


def _update_distances(apart: FloatArray, a: int, b: int, length: float) -> None:
    """Update a matrix of shortest distances after joining two places."""
    if length < apart[a, b]:
        there = apart[:, a, None] + length + apart[b]
        np.minimum(apart, np.minimum(there, there.T), out=apart)


def _measure_distances(lonlat: FloatArray, pairs: IntArray) -> FloatArray:
    """Return the distance between the places of each pair, in degrees of latitude."""
    east, north = (lonlat[pairs[:, 1]] - lonlat[pairs[:, 0]]).T
    return np.asarray(np.hypot(east * np.cos(np.radians(lonlat[pairs[:, 0], 1])), north))
