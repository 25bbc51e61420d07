"""Cut the districts of version 2 of the suite out of five cities, each a few blocks with 60 to 150 junctions.

    npm pack osm2geojson@1.0.3 geojson-path-finder@2.1.0
    pip download quackosm==0.11.0 --no-deps --no-binary quackosm
    python scripts/cut_districts.py . [--out src/gamms/data/districts]

The folder has these three archives, whose tests have extracts of OpenStreetMap; Helsinki is cut out of the map that
ships with GAMMS. A city is the largest connected part of the ways that people may walk, from junction to junction. A
district has the junctions nearest by road to one of them; the junction and the number are drawn by the name of the
district. The same archives give the same bytes (with the same zlib).
"""

import argparse
import hashlib
import heapq
import random
import tarfile
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import networkx as nx
import numpy as np

import gamms
from gamms.ir.geometry import make_line_strings
from gamms.osm.geojson import read_lines
from gamms.osm.modes import make_rule
from gamms.osm.network import (
    RoadNetwork,
    cut_segments,
    find_largest_part,
    make_network_of_columns,
    make_network_of_segments,
    make_two_way,
    select_roads,
)
from gamms.osm.osmium_reader import MapFile
from gamms.osm.reader import read_ways
from gamms.osm.topology import count_road_ends, simplify

OUT = Path(__file__).parents[1] / "src" / "gamms" / "data" / "districts"
WALK = gamms.osm.modes()["walk"]
FEWEST, MOST = 60, 150  # junctions of a district
MOST_ROADS = 6  # at a junction
LEAST_ROADS = 1.25  # for each junction: fewer are a village of dead ends
MOST_SHARED = 0.1  # of the junctions of a district, with all districts before it
EXITS = 3  # junctions far from the center and each other: nodes 0, 1 and 2; the center is node 3
GRID = 128.0  # places are rounded to 1 / 128 meter, which is less than the source resolves


class City(NamedTuple):
    """A city, its extract and the number of its districts."""

    name: str
    archive: str  # "": the map that ships with GAMMS
    member: str
    districts: int


CITIES = (
    City("helsinki", "", "", 8),
    City("victoria", "osm2geojson-1.0.3.tgz", "package/test/fixtures/victoria.osm.bz2", 5),
    City("bejaia", "osm2geojson-1.0.3.tgz", "package/test/fixtures/bejaia.osm.xml", 6),
    City("monaco", "quackosm-0.11.0.tar.gz", "quackosm-0.11.0/tests/test_files/monaco.osm.pbf", 6),
    City("gothenburg", "geojson-path-finder-2.1.0.tgz", "package/test/large-network.json", 6),
)


def main(arguments: Sequence[str] | None = None) -> None:
    """Read the archives, cut and save."""
    parser = argparse.ArgumentParser(description="Cut the districts of version 2 of the suite.")
    parser.add_argument("archives", type=Path, help="the folder with the three archives")
    parser.add_argument("--out", type=Path, default=OUT, help="the folder of the districts")
    chosen = parser.parse_args(arguments)
    chosen.out.mkdir(parents=True, exist_ok=True)
    for city in CITIES:
        streets = read_city(city, chosen.archives)
        graph = graph_of(streets)
        used: set[int] = set()
        for number in range(1, city.districts + 1):
            name = f"{city.name}_{number}"
            district, junctions = draw_district(name, streets, graph, used)
            used |= junctions
            save(district, chosen.out / f"{name}.gamms")
            nodes, roads = len(district.xy), len(district.sources)
            print(f"{name}: {nodes} junctions, {roads} roads, {district.lengths.sum() / 1000:.1f} km", flush=True)
    files = sorted(chosen.out.glob("*.gamms"))
    digest = hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()
    print(f"{len(files)} files, {sum(file.stat().st_size for file in files) / 1000:.0f} kB, sha256 {digest}")


def read_city(city: City, archives: Path) -> RoadNetwork:
    """Return the ways of a city that people may walk, from junction to junction, without tags."""
    if not city.archive:
        with gamms.create_context() as ctx:
            ctx.graph.load(OUT.parent / "helsinki.gamms")
            return joined(make_network_of_columns(ctx.graph.columns()))
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / Path(city.member).name
        with tarfile.open(archives / city.archive) as archive:
            file.write_bytes(archive.extractfile(city.member).read())  # type: ignore[union-attr]
        if file.suffix == ".json":
            ways = read_lines(file, lambda _: None)
            is_open = np.array([WALK({key: str(value) for key, value in of.items()}) is not None for of in ways.tags])
        else:
            ways = read_ways(MapFile(file), lambda _: None, make_rule(WALK))
            is_open = np.ones(len(ways.tags), np.bool_)
    segments = cut_segments(ways)
    kept = is_open[segments.ways]
    ends = {"sources": segments.sources[kept], "targets": segments.targets[kept], "ways": segments.ways[kept]}
    return joined(make_network_of_segments(find_largest_part(replace(segments, **ends)), ways.tags))


def joined(network: RoadNetwork) -> RoadNetwork:
    """Return a network from junction to junction: two-way, without tags, loops and second roads between two of them."""
    roads = replace(make_two_way(network), tags=[{}], ways=np.zeros(len(network.sources), np.int64), back_ways=None)
    while True:
        roads = simplify(roads)
        ends = np.sort(np.column_stack((roads.sources, roads.targets)), axis=1)
        order = np.lexsort((roads.lengths, ends[:, 1], ends[:, 0]))
        is_first = np.append(True, (np.diff(ends[order], axis=0) != 0).any(axis=1))
        kept = np.sort(order[is_first & (ends[order, 0] != ends[order, 1])])
        if len(kept) == len(roads.sources):
            return roads
        roads = select_roads(roads, kept)


def graph_of(network: RoadNetwork) -> "nx.Graph[int]":
    """Return the junctions with the lengths of the roads between them."""
    graph: nx.Graph[int] = nx.Graph()
    graph.add_nodes_from(range(len(network.xy)))
    ends = zip(network.sources.tolist(), network.targets.tolist(), network.lengths.tolist(), strict=True)
    graph.add_weighted_edges_from(ends, "length")
    return graph


def draw_district(name: str, city: RoadNetwork, graph: "nx.Graph[int]", used: set[int]) -> tuple[RoadNetwork, set[int]]:
    """Return a district that is drawn by its name, and the junctions of the city in it."""
    draws = random.Random(name)
    while True:
        junctions = {*nearest(graph, draws.randrange(len(city.xy)), draws.randint(FEWEST, MOST))}
        if len(junctions & used) > MOST_SHARED * len(junctions):
            continue
        inside = np.zeros(len(city.xy), np.bool_)
        inside[[*junctions]] = True
        roads = np.flatnonzero(inside[city.sources] & inside[city.targets])
        if len(roads) - len(junctions) < (LEAST_ROADS - 1) * FEWEST:  # joining roads adds no rings
            continue
        district = joined(select_roads(city, roads))
        is_sized = FEWEST <= len(district.xy) <= MOST and count_road_ends(district).max() <= MOST_ROADS
        has_rings = len(district.sources) >= LEAST_ROADS * len(district.xy)
        if is_sized and has_rings:
            return numbered(district), junctions


def nearest(graph: "nx.Graph[int]", middle: int, wanted: int) -> list[int]:
    """Return the junctions nearest by road to one of them, by Dijkstra's algorithm."""
    found: dict[int, float] = {}
    waiting = [(0.0, middle)]
    while waiting and len(found) < wanted:
        length, node = heapq.heappop(waiting)
        if node not in found:
            found[node] = length
            for other, road in graph[node].items():
                heapq.heappush(waiting, (length + road["length"], other))
    return [*found]


def numbered(network: RoadNetwork) -> RoadNetwork:
    """Return a district with its places on a binary grid, and its exits and its center as the first nodes."""
    graph = graph_of(network)
    far = dict(nx.all_pairs_dijkstra_path_length(graph, weight="length"))
    center = min(graph, key=lambda node: (max(far[node].values()), node))
    others = [node for node in graph if node != center]
    exits: list[int] = []
    for _ in range(EXITS):
        exits.append(max(others, key=lambda node: (min(far[node][other] for other in exits or [center]), -node)))
    first = [*exits, center]
    order = [*first, *(node for node in graph if node not in first)]
    row_of = np.argsort(order)
    xy, points, lengths = (np.round(values * GRID) / GRID for values in (network.xy, network.points, network.lengths))
    ends = {"sources": row_of[network.sources], "targets": row_of[network.targets]}
    return replace(network, xy=xy[order], points=points, lengths=lengths, **ends)


def save(network: RoadNetwork, out: Path) -> None:
    """Save a district in the format of `ctx.graph.save`, with an edge in each direction of each road."""
    graph: nx.DiGraph[int] = nx.DiGraph(attribution=network.attribution, crs=network.crs)
    graph.add_nodes_from((node, {"x": x, "y": y}) for node, (x, y) in enumerate(network.xy.tolist()))
    lines = make_line_strings(network.points, np.repeat(np.arange(len(network.sources)), np.diff(network.offsets)))
    ends = zip(network.sources.tolist(), network.targets.tolist(), lines, network.lengths.tolist(), strict=True)
    for road, (u, v, line, length) in enumerate(ends):
        graph.add_edge(u, v, id=2 * road, linestring=line, length=length)
        graph.add_edge(v, u, id=2 * road + 1, linestring=line.reverse(), length=length)
    with gamms.create_context() as ctx:
        ctx.graph.attach_networkx_graph(graph)
        ctx.graph.save(out)


if __name__ == "__main__":
    main()
