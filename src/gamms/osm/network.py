"""A road network as columns: nodes, and roads with a polyline, a true length and a direction."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.projection import WGS84, ellipsoid_lengths, project, utm_crs
from gamms.osm.polylines import along, chosen_lines, offsets_of, straight_lines, with_ends
from gamms.osm.ways import ATTRIBUTION, Segments

BoolArray = np.ndarray[Any, np.dtype[np.bool_]]


class Merged(NamedTuple):
    """What merging junctions has taken away so far."""

    nodes: int = 0
    length_m: float = 0.0  # of the roads inside junctions


_NOTHING = Merged()


@dataclass(slots=True, frozen=True, eq=False)
class RoadNetwork:
    """Every road leads from its source to its target; traffic runs that way, or both ways if `two_way`."""

    xy: FloatArray  # (nodes, 2)  metres
    sources: IntArray  # (roads,)  node rows
    targets: IntArray  # (roads,)  node rows
    offsets: IntArray  # (roads + 1,)  polylines: road i has the points offsets[i]:offsets[i + 1]
    points: FloatArray  # (points, 2)  the first and last of a road are its nodes
    lengths: FloatArray  # (roads,)  true metres
    two_way: BoolArray  # (roads,)
    ways: IntArray  # (roads,)  rows of `tags`
    tags: Sequence[Mapping[str, Any]]  # (ways,)  attributes that the roads of a way share
    crs: str | None
    merged: Merged = _NOTHING
    attribution: str | None = ATTRIBUTION


def network_of_segments(segments: Segments, tags: Sequence[Mapping[str, Any]]) -> RoadNetwork:
    """Project the pieces of road to metres; lengths are measured on the ellipsoid, not on the map."""
    start, end = segments.lonlat[segments.sources], segments.lonlat[segments.targets]
    crs = utm_crs(segments.lonlat)
    xy = project(segments.lonlat, WGS84, crs)
    offsets, points = straight_lines(xy[segments.sources], xy[segments.targets])
    one_way = np.fromiter((bool(of_way["oneway"]) for of_way in tags), np.bool_, len(tags))
    return RoadNetwork(
        xy=xy,
        sources=segments.sources,
        targets=segments.targets,
        offsets=offsets,
        points=points,
        lengths=ellipsoid_lengths(start, end),
        two_way=~one_way[segments.ways],
        ways=segments.ways,
        tags=tags,
        crs=crs,
    )


def network_of_lines(
    xy: FloatArray,
    ends: tuple[IntArray, IntArray],
    bends: Mapping[int, FloatArray],
    lengths: FloatArray,
    tags: Sequence[Mapping[str, Any]],
    crs: str | None,
) -> RoadNetwork:
    """A network of one-way roads from its parts; road `i` has the vertices `bends[i]`, or is straight.

    Nothing is measured or projected: a length may still be NaN, and a polyline may miss its nodes.
    """
    sources, targets = ends
    lines = [bends[road] if road in bends else xy[[a, b]] for road, (a, b) in enumerate(zip(*ends, strict=True))]
    return RoadNetwork(
        xy=xy,
        sources=sources,
        targets=targets,
        offsets=offsets_of(np.fromiter(map(len, lines), np.int64, len(lines))),
        points=np.concatenate(lines) if lines else np.zeros((0, 2)),
        lengths=lengths,
        two_way=np.zeros(len(sources), np.bool_),
        ways=np.arange(len(sources)),
        tags=tags,
        crs=crs,
    )


def projected(network: RoadNetwork, source: str) -> RoadNetwork:
    """Project a network in degrees to UTM; unknown lengths are measured on the ellipsoid."""
    crs = utm_crs(network.xy)
    inside = np.ones(len(network.points), np.bool_)
    inside[network.offsets[1:] - 1] = False
    step = np.zeros(len(network.points))
    last = np.flatnonzero(inside)
    step[last] = ellipsoid_lengths(network.points[last], network.points[last + 1])
    line = np.repeat(np.arange(len(network.sources)), np.diff(network.offsets))
    measured = np.bincount(line, weights=step, minlength=len(network.sources))
    return replace(
        network,
        xy=project(network.xy, source, crs),
        points=project(network.points, source, crs),
        lengths=np.where(np.isnan(network.lengths), measured, network.lengths),
        crs=crs,
    )


def connected(network: RoadNetwork) -> RoadNetwork:
    """Lead every polyline from node to node, and give roads without a length that of their polyline."""
    start, end = network.xy[network.sources], network.xy[network.targets]
    offsets, points, _ = with_ends(network.offsets, network.points, start, end)
    on_map = along(offsets, points)[offsets[1:] - 1]
    lengths = np.where(np.isnan(network.lengths), on_map, network.lengths)
    return replace(network, offsets=offsets, points=points, lengths=lengths)


def chosen_roads(network: RoadNetwork, roads: IntArray) -> RoadNetwork:
    """The same nodes with some of the roads, in the order of `roads`."""
    offsets, points = chosen_lines(network.offsets, network.points, roads)
    return replace(
        network,
        sources=network.sources[roads],
        targets=network.targets[roads],
        offsets=offsets,
        points=points,
        lengths=network.lengths[roads],
        two_way=network.two_way[roads],
        ways=network.ways[roads],
    )


def without_unused_nodes(network: RoadNetwork) -> RoadNetwork:
    """The same roads, with only the nodes at their ends."""
    used, rows = np.unique(np.concatenate((network.sources, network.targets)), return_inverse=True)
    half = len(network.sources)
    return replace(network, xy=network.xy[used], sources=rows[:half], targets=rows[half:])


def both_ways(network: RoadNetwork) -> RoadNetwork:
    """The same network for those who may go against the traffic."""
    return replace(network, two_way=np.ones(len(network.sources), np.bool_))
