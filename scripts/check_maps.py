"""Check graphs of maps against the maps, without our own readers: our own parser, distances and union-find here.

    python scripts/check_maps.py FILE [FILE ...] [--resolution 10] [--tolerance 0]

Each file (.osm, .osm.pbf, … or .geojson) is read here with plain loops, and the graph that `gamms.osm` makes of it is
looked at edge by edge. The exit code is 1 if any check fails.
"""

import argparse
import json
import math
import resource
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import osmium
import pyproj

import gamms.osm

NO_ROADS = {"abandoned", "construction", "no", "planned", "proposed", "raceway", "razed", "rest_area", "services"}
MAJOR, FLATTENING = 6_378_137.0, 1 / 298.257223563  # WGS 84
ECCENTRICITY2 = FLATTENING * (2 - FLATTENING)

Place = tuple[float, float]  # longitude, latitude


class Source(NamedTuple):
    """The largest connected part of a map: its straight pieces of road."""

    segments: list[tuple[Place, Place]]

    def length(self) -> float:
        """Metres on the ellipsoid."""
        return sum(metres(a, b) for a, b in self.segments)

    def haversine(self) -> float:
        """Metres on the sphere, as OSMnx counts them."""
        return sum(haversine(a, b) for a, b in self.segments)

    def junctions(self) -> list[Place]:
        """Where three roads or more meet."""
        ends = Counter(place for segment in self.segments for place in segment)
        return [place for place, count in ends.items() if count > 2]


def main() -> None:
    """Check every file and print a table of what was found."""
    parser = argparse.ArgumentParser(description="Check graphs of maps against the maps.")
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--resolution", type=float, default=10.0)
    parser.add_argument("--tolerance", type=float, default=0.0)
    wishes = parser.parse_args()
    verdicts = [check(file, wishes.resolution, wishes.tolerance) for file in wishes.files]
    sys.exit(0 if all(verdicts) else 1)


def check(file: Path, resolution: float, tolerance: float) -> bool:
    """Load a file both ways, compare, print; whether all is well."""
    load = gamms.osm.graph_from_geojson if gamms.osm.is_geojson(file) else gamms.osm.graph_from_file
    begin = time.perf_counter()
    graph = load(file, resolution, True, tolerance=tolerance)
    seconds = time.perf_counter() - begin
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    source = largest_part(geojson_lines(file) if gamms.osm.is_geojson(file) else osm_lines(file))
    print(f"\n{file.name}: resolution {resolution:g} m, tolerance {tolerance:g} m")
    print(f"  {seconds:.2f} s, peak {peak:.0f} MB of this process; {len(graph)} nodes, {graph.number_of_edges()} edges")
    results = [
        check_length(graph, source, tolerance),
        check_components(graph),
        check_two_way(graph),
        check_twins(graph),
        check_spacing(graph, resolution),
        check_shapes(graph),
        check_crs(graph, source),
        check_junctions(graph, source, tolerance),
    ]
    for is_good, text in results:
        print(f"  {'ok  ' if is_good else 'FAIL'} {text}")
    return all(is_good for is_good, _ in results)


def check_length(graph: Any, source: Source, tolerance: float) -> tuple[bool, str]:
    """The length of the map is that of the graph and of what was merged away."""
    before, after = source.length(), sum(data["length"] for _, _, data in once(graph))
    merged = graph.graph["merged_length"]
    error = abs(after + merged - before) / before
    text = f"length {before:.1f} m (haversine {source.haversine():.1f}) -> {after:.1f} m"
    is_good = error <= 0.001 and (merged == 0.0 or tolerance > 0.0)
    return is_good, f"{text} + {merged:.1f} m inside junctions, {error:.2e} off"


def check_components(graph: Any) -> tuple[bool, str]:
    """The graph is in one piece, as the part of the map is."""
    parts = len(set(roots((u, v) for u, v in graph.edges).values()))
    lonely = sum(graph.degree(node) == 0 for node in graph)
    return parts + lonely == 1, f"{parts} component(s), {lonely} isolated nodes"


def check_two_way(graph: Any) -> tuple[bool, str]:
    """Both directions of a road share their nodes and are mirror images."""
    bad = 0
    for u, v, data in graph.edges(data=True):
        back = graph.get_edge_data(v, u)
        mirrored = back is not None and list(back["linestring"].coords) == list(data["linestring"].coords)[::-1]
        bad += not (mirrored and back["length"] == data["length"])
    return bad == 0, f"{bad} edges without their mirror image through the same nodes"


def check_twins(graph: Any) -> tuple[bool, str]:
    """Nodes within a micrometre: what a road cut apart in its two directions would leave."""
    cells = Counter((round(data["x"], 6), round(data["y"], 6)) for _, data in graph.nodes(data=True))
    twins = sum(count - 1 for count in cells.values())
    return twins <= len(graph) // 10_000, f"{twins} nodes at the place of another one (in the source, too)"


def check_spacing(graph: Any, resolution: float) -> tuple[bool, str]:
    """No edge is as long as what has to be cut."""
    shares = [data["length"] / resolution for _, _, data in graph.edges(data=True)]
    inside = sum(0.75 - 1e-9 <= share <= 1.25 + 1e-9 for share in shares)
    return max(shares) < 1.5, f"{inside / len(shares):.1%} of the edges within 0.75-1.25, longest {max(shares):.3f}"


def check_shapes(graph: Any) -> tuple[bool, str]:
    """Every line begins and ends at the nodes of its edge."""
    bad = 0
    for u, v, data in graph.edges(data=True):
        first, last = data["linestring"].coords[0], data["linestring"].coords[-1]
        (ux, uy), (vx, vy) = ((graph.nodes[node]["x"], graph.nodes[node]["y"]) for node in (u, v))
        bad += first != (ux, uy) or last != (vx, vy)
    return bad == 0, f"{bad} edges whose line does not lead from node to node"


def check_crs(graph: Any, source: Source) -> tuple[bool, str]:
    """The projection is the UTM zone of the map."""
    places = {place for segment in source.segments for place in segment}
    lon, lat = (sum(place[axis] for place in places) / len(places) for axis in (0, 1))
    expected = f"EPSG:{(32600 if lat >= 0 else 32700) + int((lon + 180) // 6) + 1}"
    return graph.graph["crs"] == expected, f"CRS {graph.graph['crs']}, the map is in {expected}"


def check_junctions(graph: Any, source: Source, tolerance: float) -> tuple[bool, str]:
    """Every junction of the source has a node: there, or within the reach of merging."""
    to_degrees = pyproj.Transformer.from_crs(graph.graph["crs"], "EPSG:4326", always_xy=True).transform
    lon, lat = to_degrees(*zip(*((data["x"], data["y"]) for _, data in graph.nodes(data=True)), strict=True))
    cells = defaultdict(list)
    reach = 4.0 * tolerance + 0.01
    side = max(reach / 50_000.0, 1e-5)
    for place in zip(lon, lat, strict=True):
        cells[place[0] // side, place[1] // side].append(place)
    farthest = 0.0
    for place in source.junctions():
        column, row = place[0] // side, place[1] // side
        near = [other for i in (-1, 0, 1) for j in (-1, 0, 1) for other in cells[column + i, row + j]]
        farthest = max(farthest, min((metres(place, other) for other in near), default=math.inf))
    return farthest <= reach, f"junctions of the map have a node within {farthest:.4f} m (allowed {reach:g} m)"


def osm_lines(file: Path) -> Iterator[list[tuple[Any, Place]]]:
    """The roads of a map as lists of (node, place)."""
    places = {item.id: (item.lon, item.lat) for item in osmium.FileProcessor(str(file), osmium.osm.NODE)}
    for way in osmium.FileProcessor(str(file), osmium.osm.WAY):
        tags = dict(way.tags)
        if "highway" in tags and tags["highway"] not in NO_ROADS:
            yield [(node.ref, places.get(node.ref)) for node in way.nodes]


def geojson_lines(file: Path) -> Iterator[list[tuple[Any, Place]]]:
    """The lines of a collection of features as lists of (place, place)."""
    for feature in json.loads(file.read_text(encoding="utf-8"))["features"]:
        if feature["geometry"]["type"] == "LineString":
            yield [(tuple(place[:2]), tuple(place[:2])) for place in feature["geometry"]["coordinates"]]


def largest_part(lines: Iterator[list[tuple[Any, Place]]]) -> Source:
    """The straight pieces of road of the connected part with the most nodes."""
    pairs = [(a, b) for line in lines for a, b in pairwise(line) if a[1] and b[1] and a[0] != b[0]]
    root = roots((a[0], b[0]) for a, b in pairs)
    largest = Counter(root.values()).most_common(1)[0][0]
    return Source([(a[1], b[1]) for a, b in pairs if root[a[0]] == largest])


def roots(pairs: Iterator[tuple[Any, Any]]) -> dict[Any, Any]:
    """Union-find: a name for the connected part that each node is in."""
    parent: dict[Any, Any] = {}

    def find(node: Any) -> Any:
        parent.setdefault(node, node)
        while parent[node] != node:
            parent[node] = node = parent[parent[node]]
        return node

    for a, b in pairs:
        parent[find(a)] = find(b)
    return {node: find(node) for node in [*parent]}


def once(graph: Any) -> Iterator[tuple[int, int, dict[str, Any]]]:
    """Every road once: an edge, and not its mirror image."""
    seen = set()
    for u, v, data in graph.edges(data=True):
        if (v, u) not in seen:
            seen.add((u, v))
            yield u, v, data


def metres(a: Place, b: Place) -> float:
    """A short distance on the ellipsoid, by its radii of curvature half way."""
    (lon1, lat1), (lon2, lat2) = (map(math.radians, place) for place in (a, b))
    squeezed = 1 - ECCENTRICITY2 * math.sin((lat1 + lat2) / 2) ** 2
    north = MAJOR * (1 - ECCENTRICITY2) / squeezed**1.5 * (lat2 - lat1)
    east = MAJOR / math.sqrt(squeezed) * math.cos((lat1 + lat2) / 2) * (lon2 - lon1)
    return math.hypot(north, east)


def haversine(a: Place, b: Place) -> float:
    """The distance on a sphere."""
    (lon1, lat1), (lon2, lat2) = (map(math.radians, place) for place in (a, b))
    h = math.sin((lat2 - lat1) / 2) ** 2 + math.cos(lat1) * math.cos(lat2) * math.sin((lon2 - lon1) / 2) ** 2
    return 2 * 6_371_009 * math.asin(math.sqrt(h))


if __name__ == "__main__":
    main()
