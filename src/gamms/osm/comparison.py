"""Measures between a graph and its source network: lengths, positions, directions and joints."""

import math

import numpy as np

from gamms import kernels
from gamms.ir.geometry import distances_to, lines_near, nearest_lines
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.osm.network import RoadNetwork, along, chosen_roads, network_of_lines, offsets_of, segment_starts
from gamms.osm.topology import chains_of, consolidate, degrees

MOST_UNCUT = 1.5  # in resolutions: shorter roads stay whole
_EXACT = 1e-6  # meters, and relative: rounding errors
_ON_LINE_M = 1e-3  # a point so near to a line lies on it
_PARALLEL = 1e-2  # radians between two lines that count as parallel
_STEP_M = 25.0  # largest distance between points of a straight road that are compared with the map
WIDEST = 3.0  # width of a merged junction in tolerances, at most
_Places = np.ndarray[tuple[int], np.dtype[np.complex128]]


def roads_once(edges: RoadNetwork) -> RoadNetwork:
    """Join the edges of both directions between two nodes into one road if their lengths are exactly equal."""
    low = np.minimum(edges.sources, edges.targets)
    high = np.maximum(edges.sources, edges.targets)
    order = np.lexsort((edges.lengths, high, low))
    keys = np.column_stack((low, high, edges.lengths))[order]
    new = np.ones(len(order), np.bool_)
    new[1:] = (keys[1:] != keys[:-1]).any(axis=1)
    group = np.cumsum(new) - 1
    there = np.bincount(group, weights=(edges.sources <= edges.targets)[order], minlength=int(new.sum()))
    back = np.bincount(group, minlength=int(new.sum())) - there
    copies = np.maximum(there, back).astype(np.int64)
    rows = np.repeat(order[new], copies)
    return chosen_roads(edges, rows)


def pieces_of(roads: RoadNetwork, source: RoadNetwork, resolution: float) -> tuple[BoolArray, BoolArray]:
    """Recognize cut roads: at a cut two pieces of exactly equal length meet where the source has no vertex.

    Returns:
        Two masks (roads,): pieces of longer roads; and among them pieces of short roads that were cut only so that no
        road is lost.
    """
    nodes = np.concatenate((roads.sources, roads.targets))
    lengths = np.tile(roads.lengths, 2)
    longest = np.full(len(roads.xy), -np.inf)
    shortest = np.full(len(roads.xy), np.inf)
    np.maximum.at(longest, nodes, lengths)
    np.minimum.at(shortest, nodes, lengths)
    chains = chains_of(roads, (longest == shortest) & ~np.isin(_complex(roads.xy), _complex(source.points)))
    number = np.bincount(chains.of_road, minlength=len(chains.lengths))
    short_pair = (number == 2) & (chains.lengths < MOST_UNCUT * resolution)
    small_loop = (number == 3) & (chains.ends[:, 0] == chains.ends[:, 1]) & (chains.lengths < 2.5 * resolution)
    parted = (short_pair | small_loop)[chains.of_road]
    return (number > 1)[chains.of_road], parted


def deviations(source: RoadNetwork, roads: RoadNetwork) -> FloatArray:
    """Return the exact distance of every vertex of the source from the nearest of these roads, meters."""
    used = np.unique(np.concatenate((source.sources, source.targets)))
    vertices = np.unique(_complex(np.concatenate((source.xy[used], source.points))))
    away = np.flatnonzero(~np.isin(vertices, _complex(roads.points)))
    result = np.zeros(len(vertices))
    if not len(away) or not len(roads.points):
        result[away] = np.inf
        return result
    start = segment_starts(roads.offsets)
    places = np.column_stack((vertices[away].real, vertices[away].imag))
    _, result[away] = nearest_lines(places, roads.points[start], roads.points[start + 1])
    return result


def untrue_lengths(roads: RoadNetwork, rows: IntArray, source: RoadNetwork) -> int:
    """Return the number of these uncut roads whose length differs from the pieces of the source that they follow.

    Roads without a counterpart in the source, because they lead to a merged junction, are not compared.
    """
    chosen = chosen_roads(roads, rows)
    ours, _, line = _segments(chosen)
    theirs, source_share, source_line = _segments(source)
    places, numbers = np.unique(np.concatenate((ours, theirs)), return_inverse=True)
    pairs = numbers.reshape(-1, 2) @ (len(places), 1)  # one number per pair of points
    wanted = pairs[: len(ours)]
    keys, firsts = np.unique(pairs[len(ours) :], return_index=True)
    if not len(keys) or not len(ours):
        return 0
    at = kernels.rows_of(keys, wanted)
    there = at >= 0
    true = (source.lengths[source_line] * source_share)[firsts][at]
    expected = np.bincount(line, weights=np.where(there, true, 0.0), minlength=len(rows))
    judged = np.bincount(line, weights=~there, minlength=len(rows)) == 0
    wrong = np.abs(chosen.lengths - expected) > _EXACT * (1.0 + expected)
    return int((judged & wrong).sum())


def surplus(roads: RoadNetwork, source: RoadNetwork) -> float:
    """Return the largest distance of the roads from the map: at vertices, middles of straight pieces, and every 25 m.

    A piece whose two ends lie on one straight piece of the source runs along it, because the distance is a convex
    function. Only other pieces are examined at more points.
    """
    mine = segment_starts(roads.offsets)
    theirs = segment_starts(source.offsets)
    if not len(mine) or not len(theirs):
        return math.inf if len(mine) else 0.0
    here = roads.points[mine]
    there = roads.points[mine + 1]
    start = source.points[theirs]
    end = source.points[theirs + 1]
    near, _ = nearest_lines((here + there) / 2.0, start, end)
    off = np.maximum(*(distances_to(places, start[near], end[near]) for places in (here, there)))
    astray = off > _EXACT
    places = _places_along(here[astray], there[astray])
    closely = nearest_lines(places, start, end)[1].max() if len(places) else 0.0
    return max(float(closely), float(off[~astray].max(initial=0.0)))


def _places_along(here: FloatArray, there: FloatArray) -> FloatArray:
    """Return points on straight lines (lines, 2): their ends, their middle, and at least one every 25 m."""
    parts = np.maximum(np.ceil(np.hypot(*(there - here).T) / _STEP_M), 2.0).astype(np.int64)
    line = np.repeat(np.arange(len(parts)), parts + 1)
    share = (np.arange(len(line)) - offsets_of(parts + 1)[line]) / parts[line]
    return np.asarray(here[line] + (there - here)[line] * share[:, None])


def wrong_directions(edges: RoadNetwork, source: RoadNetwork, merged: RoadNetwork) -> tuple[float, float]:
    """Return the meters of edges against the traffic, and of edges that are the only direction of a two-way road.

    An edge is compared with the roads under the middle of its longest straight piece: roads of the source or, if
    merging has moved it, of the source with merged junctions.
    """
    alone = _without_way_back(edges)
    judged = np.flatnonzero(alone | ~source.two_way.all())
    if not len(judged) or not len(source.sources):
        return 0.0, 0.0
    chosen = chosen_roads(edges, judged)
    counts = _roads_below(chosen, source)
    moved = np.flatnonzero(counts[0] == 0)
    if len(moved):
        counts[:, moved] = _roads_below(chosen_roads(chosen, moved), merged)
    found, allowed, both = counts
    lengths = edges.lengths[judged]
    against = (found > 0) & (allowed == 0)
    only = (found > 0) & (both == found) & alone[judged]
    return float(lengths[against].sum()), float(lengths[only].sum())


def _without_way_back(edges: RoadNetwork) -> BoolArray:
    """Return a mask of edges without an edge of the same length in the other direction."""
    count = len(edges.sources)
    ends = np.stack((edges.sources, edges.targets))
    sources, targets = np.concatenate((ends, ends[::-1]), axis=1)
    lengths = np.tile(edges.lengths, 2)
    order = np.lexsort((lengths, targets, sources))
    rows = np.column_stack((sources, targets, lengths))[order]
    group = np.empty(2 * count, np.int64)
    group[order] = np.cumsum(np.append(False, (np.diff(rows, axis=0) != 0.0).any(axis=1)))[: 2 * count]
    is_there = np.bincount(group[:count], minlength=2 * count) > 0
    return np.asarray(~is_there[group[count:]])


def _roads_below(edges: RoadNetwork, source: RoadNetwork) -> IntArray:
    """Return (3, edges): the number of source roads under each edge, those in its direction, and two-way ones."""
    mine = segment_starts(edges.offsets)
    theirs = segment_starts(source.offsets)
    size = np.hypot(*(edges.points[mine + 1] - edges.points[mine]).T)
    line = _lines_of_pieces(edges)
    order = np.lexsort((size, line))
    mine = mine[order[np.append(np.diff(line[order]) > 0, True)]]  # the longest piece of each edge
    step = edges.points[mine + 1] - edges.points[mine]
    steps = source.points[theirs + 1] - source.points[theirs]
    middles = edges.points[mine] + step / 2.0
    edge, piece = lines_near(middles, source.points[theirs], source.points[theirs + 1], _ON_LINE_M)
    onward = (step[edge] * steps[piece]).sum(axis=1)
    aside = step[edge][:, 0] * steps[piece][:, 1] - step[edge][:, 1] * steps[piece][:, 0]
    alike = np.abs(aside) <= _PARALLEL * np.abs(onward)
    is_two_way = source.two_way[_lines_of_pieces(source)][piece]
    kinds = (alike, alike & (is_two_way | (onward > 0.0)), alike & is_two_way)
    return np.stack([np.bincount(edge[rows], minlength=len(edges.sources)) for rows in kinds])


def wrong_joints(roads: RoadNetwork, source: RoadNetwork, tolerance: float) -> int:
    """Return the number of places where the numbers of roads that meet or end differ from the source.

    Places that may be a merged junction, or were merged into one, are not counted.
    """
    source = consolidate(source, 0.0)
    ours = _joints(roads.xy, degrees(roads))
    theirs = _joints(source.xy, degrees(source))
    two_way = source.two_way
    ends = (
        np.concatenate((source.sources, source.targets[two_way])),
        np.concatenate((source.targets, source.sources[two_way])),
    )
    lengths = np.concatenate((source.lengths, source.lengths[two_way]))
    pairs = roads_once(
        network_of_lines(source.xy, ends, {}, lengths, [], None)
    )  # one-way roads of both directions count once
    once = _joints(source.xy, degrees(pairs))
    new = np.array([place for place, met in ours.items() if met not in (theirs.get(place), once.get(place))], complex)
    gone = np.array([place for place in theirs.keys() & once.keys() if place not in ours], complex)
    if tolerance > 0.0 and len(gone):
        reach = WIDEST * tolerance + _EXACT
        new = new[_near(new, gone, reach) == 0]  # every node of a merged junction is gone
        gone = gone[_near(gone, gone, reach) < 2]
    return len(new) + len(gone)


def _joints(xy: FloatArray, degree: IntArray) -> dict[complex, list[int]]:
    """Return place -> numbers of roads that meet at its nodes, without nodes that merely continue a road."""
    found: dict[complex, list[int]] = {}
    rows = np.flatnonzero((degree != 0) & (degree != 2))
    for place, met in sorted(
        zip(_complex(xy[rows]).tolist(), degree[rows].tolist(), strict=True), key=lambda one: one[1]
    ):
        found.setdefault(place, []).append(met)
    return found


def _near(places: _Places, others: _Places, reach: float) -> IntArray:
    """Return the number of others within reach of each place."""
    here, there = (np.column_stack((some.real, some.imag)) for some in (places, others))
    rows, _ = lines_near(here, there, there, reach)
    return np.bincount(rows, minlength=len(places))


def _lines_of_pieces(network: RoadNetwork) -> IntArray:
    """Return the road of each straight piece."""
    return np.repeat(np.arange(len(network.sources)), np.diff(network.offsets) - 1)


def _segments(network: RoadNetwork) -> tuple[_Places, FloatArray, IntArray]:
    """Return the ends (segments, 2) of every straight piece, sorted, its share of its road, and the road."""
    start = segment_starts(network.offsets)
    line = _lines_of_pieces(network)
    position = along(network.offsets, network.points)
    total = position[network.offsets[1:] - 1][line]
    share = (position[start + 1] - position[start]) / np.where(total > 0.0, total, 1.0)
    places = _complex(network.points)
    return np.sort(np.column_stack((places[start], places[start + 1])), axis=1), share, line


def _complex(xy: FloatArray) -> _Places:
    return np.ascontiguousarray(xy).view(np.complex128)[:, 0]
