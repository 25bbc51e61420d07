"""Maps in, graphs out: what `gamms.osm` offers, step by step from the file to the networkx graph."""

import math
import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gamms.arguments import as_float, as_range
from gamms.errors import BadFile, BadValue
from gamms.ir.graph import GraphColumns
from gamms.ir.projection import crs_of
from gamms.osm.columns import network_of_columns
from gamms.osm.consolidate import consolidate
from gamms.osm.directions import joined_directions
from gamms.osm.files import as_file
from gamms.osm.network import RoadNetwork, both_ways, connected, network_of_segments, projected
from gamms.osm.networkx import network_of_graph, to_digraph
from gamms.osm.osmium import read_ways
from gamms.osm.progress import progress
from gamms.osm.resample import resample
from gamms.osm.ways import largest_part, segments_of

if TYPE_CHECKING:
    from collections.abc import Callable

    import networkx as nx


_SLOW_BYTES = 32 << 20


def graph_from_xml(
    filepath: str | os.PathLike[str],
    resolution: float = 10.0,
    bidirectional: bool = True,
    retain_all: bool = False,
    tolerance: float = 1e-9,
) -> "nx.DiGraph[int]":
    """Make a graph of the roads in an OpenStreetMap file (.osm, .xml, .osm.gz, .osm.bz2, .osm.pbf).

    Args:
        filepath: the map file.
        resolution: metres between nodes; a road of length L becomes round(L / resolution) equal pieces,
            and a road shorter than 1.5 times the resolution stays whole.
        bidirectional: let agents go against one-way streets; False honours the directions.
        retain_all: keep every part of the map, not only the largest connected one.
        tolerance: metres; vertices joined by roads and within twice this distance become one node.

    Returns:
        A directed graph in UTM metres, its CRS in `G.graph["crs"]`. Nodes are 0, 1, … with `x` and `y`;
        edges have `id`, `linestring`, `length` (true metres, on the ellipsoid) and the tags of their street.

    Raises:
        FileNotFoundError, IsADirectoryError: there is no such file.
        BadFile: it is damaged, not OpenStreetMap data, or has no roads.
        BadValue, BadType: an argument is impossible.
        MissingExtra: osmium or pyproj is not installed.
    """
    resolution, tolerance = _resolution(resolution), as_range(tolerance, "tolerance")
    if math.isinf(tolerance):
        raise BadValue("tolerance must be finite, in metres: with an infinite one the whole map would be one node.")
    file = as_file(filepath)
    # Nothing can be shown while osmium reads its first nodes: say so before, where that takes a second.
    with progress(0.0 if file.stat().st_size > _SLOW_BYTES else 1.0) as show:
        network = read_network(file, retain_all=retain_all, show=show)
        show(f"Joining {len(network.sources)} roads")
        return _cut(consolidate(network, tolerance), resolution, bidirectional=bidirectional, show=show)


def process_osm_graph(
    osmg: Any,  # any networkx graph
    resolution: float = 10.0,
    bidirectional: bool = True,
) -> "nx.DiGraph[int]":
    """Cut the edges of a networkx graph, such as OSMnx makes, as `graph_from_xml` does.

    Nodes need `x` and `y`; edges may have a `geometry` and a `length` in metres. A graph whose `crs` counts
    in degrees is projected to UTM; any other is taken as metres, just as it is. Both directions of a street
    share their nodes.

    Raises:
        BadType: it is no networkx graph.
        BadValue: a node lacks a position, or the CRS, a length or the resolution is impossible.
        MissingExtra: the graph has a CRS and pyproj is not installed.
    """
    resolution = _resolution(resolution)
    with progress() as show:
        show("Reading the graph")
        network = connected(_in_metres(network_of_graph(osmg), osmg.graph.get("crs")))
        network = joined_directions(network) if osmg.is_directed() else both_ways(network)
        return _cut(network, resolution, bidirectional=bidirectional, show=show)


def resample_columns(
    columns: GraphColumns,
    resolution: float = 10.0,
    bidirectional: bool = True,
) -> "nx.DiGraph[int]":
    """Cut a map that was saved uncut, such as the shipped one, as `graph_from_xml` does.

    It needs no optional library. Each edge is one road, one-way where its attribute `oneway` is true.

    Raises:
        BadType, BadValue: the resolution is impossible.
    """
    resolution = _resolution(resolution)
    with progress() as show:
        return _cut(network_of_columns(columns), resolution, bidirectional=bidirectional, show=show)


def read_network(file: Path, *, retain_all: bool, show: "Callable[[str], None]") -> RoadNetwork:
    """The roads of a map file, one per pair of consecutive vertices, in UTM metres."""
    ways = read_ways(file, show)
    segments = segments_of(ways)
    if not len(segments.sources):
        raise BadFile(
            f"{str(file)!r} has roads, but not the nodes that they lead through. "
            "Export it with all nodes (in Overpass: (._;>;); out;)."
        )
    show(f"Projecting {len(segments.lonlat)} nodes")
    return network_of_segments(segments if retain_all else largest_part(segments), ways.tags)


def _cut(
    network: RoadNetwork, resolution: float, *, bidirectional: bool, show: "Callable[[str], None]"
) -> "nx.DiGraph[int]":
    show(f"Cutting {len(network.sources)} roads")
    pieces = resample(both_ways(network) if bidirectional else network, resolution)
    show(f"Making a graph of {len(pieces.sources)} pieces")
    return to_digraph(pieces)


def _in_metres(network: RoadNetwork, crs: Any) -> RoadNetwork:
    if crs is None:
        return network
    name, in_degrees = crs_of(crs)
    if not in_degrees:
        return replace(network, crs=name)
    if not len(network.xy) or (np.abs(network.xy) > (180.0, 90.0)).any():
        return network  # the CRS is out of date: these cannot be degrees
    return projected(network, name)


def _resolution(resolution: float) -> float:
    number = as_float(resolution, "resolution")
    if number <= 0.0:
        raise BadValue(f"resolution must be more than 0 metres, not {number}. The default is 10.")
    return number
