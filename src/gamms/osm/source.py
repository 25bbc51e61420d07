"""From a map file to its road network, uncut: nothing merged, nothing left out but what was not asked for."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from gamms.errors import BadFile
from gamms.osm.geojson import is_geojson, read_lines
from gamms.osm.network import RoadNetwork, network_of_segments
from gamms.osm.osmium import read_ways
from gamms.osm.travel import OSMType
from gamms.osm.ways import Ways, largest_part, segments_of


def read_network(
    file: Path, *, retain_all: bool, show: Callable[[str], None], osm_type: OSMType | None = None
) -> RoadNetwork:
    """The roads of an OpenStreetMap file, one per pair of consecutive vertices, in UTM metres."""
    return _network(file, read_ways(file, show, osm_type), retain_all=retain_all, show=show)


def read_line_network(file: Path, *, retain_all: bool, show: Callable[[str], None]) -> RoadNetwork:
    """The lines of a GeoJSON file, one road per pair of consecutive vertices, in UTM metres."""
    show(f"Reading {file.name}")
    return _network(file, read_lines(file), retain_all=retain_all, show=show)


def read_any_network(
    file: Path, *, retain_all: bool, show: Callable[[str], None], osm_type: OSMType | None = None
) -> RoadNetwork:
    """The roads of a file of either kind: the first byte tells which."""
    if is_geojson(file):
        return read_line_network(file, retain_all=retain_all, show=show)
    return read_network(file, retain_all=retain_all, show=show, osm_type=osm_type)


def _network(file: Path, ways: Ways, *, retain_all: bool, show: Callable[[str], None]) -> RoadNetwork:
    segments = segments_of(ways)
    if not len(segments.sources):
        raise BadFile(
            f"{str(file)!r} has roads, but not the nodes that they lead through. "
            "Export it with all nodes (in Overpass: (._;>;); out;)."
        )
    show(f"Projecting {len(segments.lonlat)} nodes")
    network = network_of_segments(segments if retain_all else largest_part(segments), ways.tags)
    return replace(network, attribution=ways.attribution)
