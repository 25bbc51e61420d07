"""Judge graphs for walkers, cyclists and drivers by a reader, access rules and routes of our own.

    python scripts/check_modes.py FILE [FILE ...] [--routes 200] [--tolerance 10]

Nothing of `gamms.osm` is used but its public loaders: maps (.osm, .osm.gz, .osm.bz2, and .osm.pbf by osmium) are read
here by plain loops, the rules are written after the pages "Key:access" and "OSM tags for routing" of OpenStreetMap's
wiki, routes and parts are those of networkx and SciPy. Ways about which both disagree are listed; rules are opinions.
The exit code is 1 if a graph breaks a promise.
"""

import argparse
import bz2
import gzip
import itertools
import math
import random
import sys
import xml.etree.ElementTree as ET
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import networkx as nx
import pyproj
import scipy.sparse.csgraph
import shapely

import gamms
import gamms.osm

Tags = Mapping[str, str]
STREETS = {"primary", "secondary", "tertiary", "trunk", "primary_link", "secondary_link", "tertiary_link", "trunk_link"}
STREETS |= {"unclassified", "residential", "living_street", "road"}
SMALL = {"service", "track", "path", "pedestrian", "bridleway"}
CLASSES = {  # open unless a tag closes them; "drive" is for streets without service roads and tracks
    "walk": STREETS | SMALL | {"footway", "steps", "corridor", "platform", "elevator"},
    "bike": STREETS | SMALL | {"cycleway"},
    "drive": STREETS | {"motorway", "motorway_link"},
}
SIGNED = {  # classes that only a sign opens
    "walk": {"cycleway", "busway", "motorway", "motorway_link"},
    "bike": {"footway", "busway", "platform"},
    "drive": {"track", "pedestrian", "busway"},
}
KEYS = {  # the most general first: a later one overrides an earlier one
    "walk": ("access", "foot"),
    "bike": ("access", "vehicle", "bicycle"),
    "drive": ("access", "vehicle", "motor_vehicle", "motorcar"),
}
CLOSED = {"no", "private", "use_sidepath", "agricultural", "forestry", "military", "delivery", "emergency", "customers"}
CLOSED |= {"psv", "bus", "dismount", "agricultural;forestry", "forestry;agricultural", "restricted", "official_only"}
OPEN = {"yes", "designated", "permissive", "official"}
MAY_PASS = OPEN | {"destination", "permit", "unknown", "discouraged"}
STOPS = {  # barriers that stop a mode where no key says anything
    "walk": {"wall", "fence", "hedge", "retaining_wall", "city_wall"},
    "bike": {"wall", "fence", "hedge", "retaining_wall", "city_wall", "stile", "kissing_gate", "turnstile"},
    "drive": {"bollard", "block", "chain", "cycle_barrier", "motorcycle_barrier", "stile", "kissing_gate", "turnstile"}
    | {"wall", "fence", "hedge", "retaining_wall", "city_wall", "jersey_barrier", "log", "rope", "planter", "bus_trap"}
    | {"full-height_turnstile", "horse_stile", "debris", "swing_gate_closed", "sump_buster", "hampshire_gate_closed"},
}
WHOLE = {"resolution": 1e6, "simplify": False, "tolerance": 0.0}
ECCENTRICITY2, MAJOR = 0.0066943799901413165, 6_378_137.0  # WGS 84


class Way(NamedTuple):
    """A line of the map."""

    refs: list[int]
    tags: dict[str, str]


class Map(NamedTuple):
    """What a file says."""

    places: dict[int, tuple[float, float]]  # degrees
    marks: dict[int, dict[str, str]]  # tags of nodes
    ways: dict[int, Way]
    areas: dict[int, Way]  # multipolygons, and the ways around them


def main() -> None:
    """Check every file, and print what was found."""
    parser = argparse.ArgumentParser(description="Judge graphs of maps for modes of travel.")
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--routes", type=int, default=200)
    parser.add_argument("--tolerance", type=float, default=10.0, help="metres, for merging junctions")
    given = parser.parse_args()
    verdicts = [judge(file, mode, given.routes, given.tolerance) for file in given.files for mode in CLASSES]
    verdicts += [check_walls(file) for file in given.files]
    sys.exit(0 if all(verdicts) else 1)


def judge(file: Path, mode: str, routes: int, tolerance: float) -> bool:
    """Check the graph of a file for one mode, and print what was found; whether it keeps its promises."""
    city = read_map(file)
    print(f"\n{file.name}, {mode}")
    every = gamms.osm.graph_from_file(file, osm_type=mode, retain_all=True, **WHOLE)
    part = gamms.osm.graph_from_file(file, osm_type=mode, **WHOLE)
    compare_ways(city, mode, every)
    checks = [
        check_lengths(city, every),
        check_parts(city, mode, every, part),
        check_own_routes(city, mode, part, routes),
        check_routes(part, routes),
        check_squares(city, every),
        check_merging(city, file, mode, tolerance),
    ]
    for is_kept, text in checks:
        print(f"  {'ok  ' if is_kept else 'FAIL'} {text}")
    return all(is_kept for is_kept, _ in checks)


# -- the map ----------------------------------------------------------------------------------------------------


def read_map(file: Path) -> Map:
    """Read a map file by plain loops."""
    found = Map({}, {}, {}, {})
    for kind, id, tags, more in elements_of_pbf(file) if file.name.endswith(".pbf") else elements_of_xml(file):
        if kind == "node":
            found.places[id] = more
            if tags:
                found.marks[id] = tags
        elif kind == "way":
            found.ways.setdefault(id, Way(more, tags))
        elif tags.get("type") == "multipolygon":
            found.areas[id] = Way(more, tags)
    return found


def elements_of_xml(file: Path) -> Iterator[tuple[str, int, dict[str, str], Any]]:
    """Yield the kind, number and tags of what an XML file has, and where or of what it is made."""
    opened = {".gz": gzip.open, ".bz2": bz2.open}.get(file.suffix, open)
    with opened(file, "rb") as stream:
        for _, one in ET.iterparse(stream):
            if one.tag not in ("node", "way", "relation"):
                continue
            tags = {tag.get("k", ""): tag.get("v", "") for tag in one.iter("tag")}
            more: Any = [int(part.get("ref", 0)) for part in one.iter("nd")]
            if one.tag == "node":
                more = float(one.get("lon", "nan")), float(one.get("lat", "nan"))
            elif one.tag == "relation":
                more = [int(part.get("ref", 0)) for part in one.iter("member") if part.get("type") == "way"]
            yield one.tag, int(one.get("id", 0)), tags, more
            one.clear()


def elements_of_pbf(file: Path) -> Iterator[tuple[str, int, dict[str, str], Any]]:
    """Yield the same of a file of osmium's own formats."""
    import osmium

    for one in osmium.FileProcessor(str(file)):
        tags = dict(one.tags)
        if one.is_node():
            yield "node", one.id, tags, (one.lon, one.lat)
        elif one.is_way():
            yield "way", one.id, tags, [node.ref for node in one.nodes]
        elif one.is_relation():
            yield "relation", one.id, tags, [part.ref for part in one.members if part.type == "w"]


def metres(a: tuple[float, float], b: tuple[float, float]) -> float:
    """A short distance on the ellipsoid, by its radii of curvature half way."""
    (lon1, lat1), (lon2, lat2) = (map(math.radians, place) for place in (a, b))
    squeezed = 1 - ECCENTRICITY2 * math.sin((lat1 + lat2) / 2) ** 2
    north = MAJOR * (1 - ECCENTRICITY2) / squeezed**1.5 * (lat2 - lat1)
    return math.hypot(north, MAJOR / math.sqrt(squeezed) * math.cos((lat1 + lat2) / 2) * (lon2 - lon1))


def steps_of(city: Map, id: int) -> list[tuple[int, int, float]]:
    """The pieces of a way between nodes that the file has, with their length."""
    pairs = [(a, b) for a, b in itertools.pairwise(city.ways[id].refs) if a != b]
    known = [(a, b) for a, b in pairs if a in city.places and b in city.places]
    return [(a, b, metres(city.places[a], city.places[b])) for a, b in known]


def length_of(city: Map, ids: Iterable[int]) -> float:
    """Metres of some ways together, a stretch that a way goes twice counted twice."""
    return sum(length for id in ids if id in city.ways for _, _, length in steps_of(city, id))


# -- the rules --------------------------------------------------------------------------------------------------


def sign_for(mode: str, tags: Tags) -> bool | None:
    """Whether the access keys open or close something for a mode; None where they leave it as it is."""
    verdict = None
    for key in KEYS[mode]:
        value, is_own = tags.get(key), key not in ("access", "vehicle")
        if value in CLOSED:
            verdict = False
        elif value in OPEN and is_own:
            verdict = True
        elif value in MAY_PASS and verdict is False and is_own:
            verdict = None
    return verdict


def is_open(mode: str, tags: Tags) -> bool:
    """Whether a way is a road for a mode."""
    highway, sign = tags.get("highway", ""), sign_for(mode, tags)
    if sign is False or (highway not in CLASSES[mode] and not (sign and highway in SIGNED[mode])):
        return False
    if any(tags.get(key) == "yes" for key in ("disused", "abandoned", "proposed", "razed", "demolished")):
        return False
    if tags.get("construction", "no") not in ("no", "minor"):
        return False
    if mode == "drive":
        return tags.get("area") != "yes"
    if sign is None and tags.get("motorroad") == "yes":
        return False
    beside = (tags.get(key) for key in ("sidewalk", "sidewalk:both", "sidewalk:left", "sidewalk:right"))
    return not (mode == "walk" and sign is None and "separate" in beside)


def directions(mode: str, tags: Tags) -> tuple[bool, bool]:
    """Whether a mode may use a way along its nodes, and against them."""
    keys = {
        "walk": ("oneway:foot", "conveying"),
        "bike": ("oneway:bicycle", "oneway"),
        "drive": ("oneway:motorcar", "oneway:motor_vehicle", "oneway"),
    }
    key = next((key for key in keys[mode] if key in tags), None)
    value = tags.get(key or "")
    if mode == "walk":  # conveying=yes says nothing of the direction
        is_one_way = value == "forward" or (value in ("yes", "true", "1") and key == "oneway:foot")
        return value not in ("-1", "reverse", "backward"), not is_one_way
    implied = tags.get("junction") in ("roundabout", "circular") or tags.get("highway") == "motorway"
    if mode == "bike" and key != "oneway:bicycle":
        lanes = [tags.get(f"cycleway{side}", "") for side in ("", ":left", ":right", ":both")]
        against = [tags.get(f"cycleway{side}:oneway", "") for side in (":left", ":right", ":both")]
        if any(lane.startswith("opposite") for lane in lanes) or {"-1", "no"} & {*against}:
            return True, True
    if value in ("-1", "reverse"):
        return False, True
    return True, not (value in ("yes", "true", "1") or (value is None and implied))


def is_stopped(mode: str, tags: Tags) -> bool:
    """Whether a node ends the roads through it for a mode."""
    sign = sign_for(mode, tags)
    return "barrier" in tags and (tags["barrier"] in STOPS[mode] if sign is None else not sign)


def roads_of(city: Map, mode: str, ids: Iterable[int]) -> "nx.DiGraph[Any]":
    """A graph of some ways by our own directions: nodes are those of the map, but for barriers, which end each road."""
    graph, ends = nx.DiGraph(), itertools.count()
    for id in ids:
        along, against = directions(mode, city.ways[id].tags)
        for a, b, length in steps_of(city, id):
            here, there = (("end", next(ends)) if is_stopped(mode, city.marks.get(ref, {})) else ref for ref in (a, b))
            for one, other, is_allowed in ((here, there, along), (there, here, against)):
                if is_allowed and graph.get_edge_data(one, other, {"length": math.inf})["length"] > length:
                    graph.add_edge(one, other, length=length)
    return graph


# -- the checks -------------------------------------------------------------------------------------------------


def ways_of(city: Map, graph: Any) -> set[int]:
    """The numbers of the ways in a graph, with those around its multipolygons; lines across squares are on no map."""
    values = (data["osmid"] for *_, data in graph.edges(data=True) if not data.get("across_area"))
    ids = {id for value in values for id in (value if isinstance(value, list) else [value])}
    around = (ref for id in ids & city.areas.keys() - city.ways.keys() for ref in city.areas[id].refs)
    return (ids | {*around}) & city.ways.keys()


def compare_ways(city: Map, mode: str, graph: Any) -> None:
    """Print which ways are open by our rules and in the graph, and about which both disagree."""
    roads = {id for id, way in city.ways.items() if "highway" in way.tags}
    squares = (way for way in city.areas.values() if is_open(mode, {**way.tags, "area": "yes"}))
    ours = {id for id in roads if is_open(mode, city.ways[id].tags)}
    ours |= {ref for way in squares for ref in way.refs} & city.ways.keys() - roads
    theirs = ways_of(city, graph)
    for name, ids in (("of ways", roads), ("open by our rules", ours), ("open in the graph", theirs)):
        print(f"  {length_of(city, ids) / 1e3:10.3f} km {name}")
    for name, some in (("only by our rules", ours - theirs), ("only in the graph", theirs - ours)):
        print(f"  {length_of(city, some) / 1e3:10.3f} km {name}")
        kinds: dict[str, float] = defaultdict(float)
        for id in some:
            tags = city.ways[id].tags
            names = ("highway", *KEYS[mode], "service", "area", "motorroad", "construction")
            kinds[" ".join(f"{key}={tags[key]}" for key in names if key in tags)] += length_of(city, [id])
        for kind, length in sorted(kinds.items(), key=lambda item: -item[1])[:8]:
            print(f"  {length:13.1f} m  {kind}")


def check_lengths(city: Map, graph: Any) -> tuple[bool, str]:
    """The graph is as long as its ways on the ellipsoid."""
    before, after = length_of(city, ways_of(city, graph)), 0.0
    for u, v, data in graph.edges(data=True):
        is_back = u > v and graph.get_edge_data(v, u, {}).get("length") == data["length"]
        after += 0.0 if is_back or data.get("across_area") else data["length"]
    error = abs(after - before) / max(before, 1.0)
    return error <= 1e-6, f"length {before:.2f} m by the map, {after:.2f} m in the graph, {error:.1e} off"


def check_parts(city: Map, mode: str, every: Any, part: Any) -> tuple[bool, str]:
    """The part is strongly connected, by networkx and by SciPy, and the largest such one by our own directions."""
    matrix = nx.to_scipy_sparse_array(part, weight=None)
    parts = scipy.sparse.csgraph.connected_components(matrix, connection="strong")[0]
    dead = sum(not part.out_degree(node) for node in part)
    found = [*nx.strongly_connected_components(roads_of(city, mode, ways_of(city, every)))]
    largest = (some for some in found if len(some) == max(map(len, found)))
    theirs = {data["osmid"] for _, data in part.nodes(data=True) if "osmid" in data}
    theirs -= {ref for ref in theirs if is_stopped(mode, city.marks.get(ref, {}))}
    nodes = ({node for node in some if not isinstance(node, tuple)} for some in largest)
    ours = min(nodes, key=lambda some: len(some ^ theirs))  # of equals either is right
    strong, odd = nx.is_strongly_connected(part), len(ours ^ theirs)
    text = f"{parts} strong part(s), {dead} nodes without exit; {odd} of {len(ours | theirs)} nodes differ from ours"
    return bool(strong and parts == 1 and not dead), text


def check_own_routes(city: Map, mode: str, part: Any, count: int) -> tuple[bool, str]:
    """Distances along the ways, without lines across squares, are those by our lengths and directions."""
    ours = roads_of(city, mode, ways_of(city, part))
    streets = nx.DiGraph((u, v, data) for u, v, data in part.edges(data=True) if not data.get("across_area"))
    node_of = {part.nodes[node].get("osmid"): node for node in streets}
    shared = sorted(ref for ref in ours if ref in node_of)
    order = {node: row for row, node in enumerate(ours)}
    matrix = nx.to_scipy_sparse_array(ours, weight="length")
    draw, worst, lost = random.Random(7), 0.0, 0
    for _ in range(count if len(shared) > 1 else 0):
        one, other = draw.sample(shared, 2)
        true = scipy.sparse.csgraph.dijkstra(matrix, indices=order[one])[order[other]]
        try:
            found = nx.shortest_path_length(streets, node_of[one], node_of[other], "length")
        except nx.NetworkXNoPath:
            found = math.inf
        if math.isinf(found) != math.isinf(true):
            lost += 1
        elif math.isfinite(found):
            worst = max(worst, abs(found - true) / max(true, 1.0))
    return (
        lost == 0 and worst <= 1e-6,
        f"{count} routes by SciPy on our own graph: {worst:.1e} off at most, {lost} lost",
    )


def check_routes(part: Any, count: int) -> tuple[bool, str]:
    """The distances of a context are those of networkx."""
    draw, nodes, worst = random.Random(11), sorted(part), 0.0
    with gamms.create_context(logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(part)
        for _ in range(count if len(nodes) > 1 else 0):
            one, other = draw.sample(nodes, 2)
            for weight in ("length", "travel_time"):
                true = nx.shortest_path_length(part, one, other, weight)
                found = ctx.graph.distance(one, other, weight=weight)
                worst = max(worst, abs(found - true) / max(true, 1.0))
    return worst <= 1e-9, f"{count} routes by networkx, in metres and seconds: {worst:.1e} off at most"


def to_metres(graph: Any) -> Any:
    """A function from degrees to the coordinates of a graph."""
    return pyproj.Transformer.from_crs("EPSG:4326", graph.graph["crs"], always_xy=True).transform


def buildings_of(city: Map, graph: Any) -> list[Any]:
    """The outlines in metres of closed ways and multipolygons that are buildings on the ground."""
    project, found = to_metres(graph), []
    for way in [*city.ways.values(), *city.areas.values()]:
        tags = way.tags
        if tags.get("building", "no") in ("no", "roof", "carport", "construction", "proposed", "razed", "demolished"):
            continue
        is_raised = tags.get("layer", "0").startswith("-") or tags.get("location") in ("underground", "rooftop")
        if is_raised or "min_height" in tags or "building:min_level" in tags:
            continue
        lines = [way.refs] if way in city.ways.values() else [city.ways[id].refs for id in way.refs if id in city.ways]
        rings = [
            shapely.LineString([project(*city.places[ref]) for ref in refs])
            for refs in lines
            if {*refs} <= city.places.keys()
        ]
        area = shapely.build_area(shapely.union_all(rings)) if len(rings) == len(lines) else shapely.Polygon()
        found += [area] if not area.is_empty else []
    return found


def stretch_inside(line: Any, building: Any) -> float:
    """Metres of a line inside a building, but for what runs along its walls."""
    inside = building.buffer(-0.02)
    return 0.0 if inside.is_empty else float(line.intersection(inside).length)


def check_squares(city: Map, every: Any) -> tuple[bool, str]:
    """Lines across squares lead through no building, and ways between junctions in sight of each other are straight."""
    buildings = shapely.STRtree(buildings_of(city, every))
    lines = [data["linestring"] for u, v, data in every.edges(data=True) if data.get("across_area") and u < v]
    blocked = 0
    for line in lines:
        near = buildings.geometries[buildings.query(line, predicate="intersects")]
        blocked += any(stretch_inside(line, one) > 0.05 and not one.buffer(0.05).covers(line) for one in near)
    place = {data["osmid"]: (data["x"], data["y"]) for _, data in every.nodes(data=True) if data.get("osmid")}
    node_of = {data.get("osmid"): node for node, data in every.nodes(data=True)}
    stretches = {frozenset(step[:2]) for id in ways_of(city, every) for step in steps_of(city, id)}
    met = Counter(ref for stretch in stretches for ref in stretch)
    pairs, lost, worst = 0, 0, 1.0
    for id in sorted(ways_of(city, every)):
        refs = city.ways[id].refs
        if city.ways[id].tags.get("area") != "yes" or refs[0] != refs[-1] or not {*refs} <= place.keys():
            continue
        area = shapely.Polygon([place[ref] for ref in refs])
        junctions = [ref for ref in dict.fromkeys(refs) if met[ref] > 2]
        if not area.is_valid or len(junctions) > 40:
            continue
        for one, other in itertools.combinations(junctions, 2):
            line = shapely.LineString([place[one], place[other]])
            near = buildings.geometries[buildings.query(line.buffer(0.05))]
            if (
                not area.covers(line)
                or area.boundary.intersection(line).length > 0.01
                or any(line.intersects(b) for b in near)
            ):
                continue
            pairs += 1
            if not nx.has_path(every, node_of[one], node_of[other]):
                lost += 1
                continue
            way = nx.shortest_path_length(every, node_of[one], node_of[other], "length")
            worst = max(worst, way / line.length)
    text = f"{len(lines)} lines across, {blocked} through buildings; {pairs} pairs in sight, {lost} without a way"
    return blocked == 0 and lost == 0 and worst < 1.06, f"{text}, longest detour {worst:.3f}"


def floors_of(city: Map, graph: Any) -> dict[int, set[tuple[str, str]]]:
    """The layers and levels of the ways at each node; stairs and elevators have none."""
    found: dict[int, set[tuple[str, str]]] = defaultdict(set)
    for id in ways_of(city, graph):
        tags = city.ways[id].tags
        if tags.get("highway") not in ("steps", "elevator", "escalator"):
            floors = itertools.product(*(tags.get(key, "0").split(";") for key in ("layer", "level")))
            for ref, floor in itertools.product(city.ways[id].refs, [*floors]):
                found[ref].add(floor)
    return found


def check_merging(city: Map, file: Path, mode: str, tolerance: float) -> tuple[bool, str]:
    """Junctions that became one have a layer in common and no building between, and no road leads into a building."""
    options: dict[str, Any] = {"osm_type": mode, "retain_all": True, "resolution": 1e6}
    before, after = (gamms.osm.graph_from_file(file, tolerance=one, **options) for one in (0.0, tolerance))
    buildings = shapely.STRtree(buildings_of(city, after))
    place, now = (
        {data["osmid"]: (data["x"], data["y"]) for _, data in graph.nodes(data=True) if data.get("osmid")}
        for graph in (before, after)
    )
    moved = [ref for ref in now if ref in place and math.dist(now[ref], place[ref]) > 1e-6]
    floors, mixed, behind, unknown = floors_of(city, before), 0, 0, 0
    for ref in place.keys() - now.keys():
        near = [one for one in moved if math.dist(now[one], place[ref]) <= 3.0 * tolerance]
        alike = [one for one in near if not floors[one] or not floors[ref] or floors[one] & floors[ref]]
        lines = [shapely.LineString([place[one], place[ref]]) for one in alike]
        free = [line for line in lines if not _is_across(line, buildings)]
        unknown += not near
        mixed += bool(near and not alike)
        behind += bool(alike and not free)
    inside = {key for key, length in _inside(before, buildings).items() if length > 0.05}
    led = {key for key, length in _inside(after, buildings).items() if length > 0.5} - inside
    text = f"at {tolerance:g} m {len(place) - len(now)} nodes are gone, {unknown} of them not near a new one"
    text += f", {mixed} of another layer, {behind} behind a building; {len(led)} roads newly in buildings"
    return not unknown + mixed + behind + len(led), text


def _is_across(line: Any, buildings: Any) -> bool:
    near = buildings.geometries[buildings.query(line, predicate="intersects")]
    return any(stretch_inside(line, one) > 0.05 and not one.covers(line) for one in near)


def _inside(graph: Any, buildings: Any) -> dict[tuple[int, int], float]:
    """Metres of each way in each building."""
    found: dict[tuple[int, int], float] = defaultdict(float)
    for _, _, data in graph.edges(data=True):
        ids = data["osmid"] if isinstance(data["osmid"], list) else [data["osmid"]]
        for row in buildings.query(data["linestring"], predicate="intersects").tolist():
            length = stretch_inside(data["linestring"], buildings.geometries[row])
            for id in ids if not data.get("across_area") else ():
                found[id, row] += length
    return found


def check_walls(file: Path) -> bool:
    """No wall crosses a street on the surface, unless a line of the map does, within 0.15 m."""
    city = read_map(file)
    graph = gamms.osm.graph_from_file(file, retain_all=True, **WHOLE)
    walls = [*gamms.osm.obstacle_from_file(file, crs=graph.graph["crs"])]
    faces = shapely.STRtree([shapely.LineString([wall["br"][:2], wall["bl"][:2]]) for wall in walls])
    project, roads = to_metres(graph), ways_of(city, graph)
    refs = (way.refs for id, way in city.ways.items() if id not in roads)
    drawn = [[project(*city.places[ref]) for ref in some if ref in city.places] for some in refs]
    outlines = shapely.STRtree([shapely.LineString(line) for line in drawn if len(line) > 1])
    through, moved = 0, 0
    for u, v, data in graph.edges(data=True):
        line, is_under = data["linestring"], data.get("tunnel", "no") != "no"
        if u < v and not is_under and len(faces.query(line, predicate="crosses")):
            through += 1
            moved += not len(outlines.query(line.buffer(0.15), predicate="intersects"))
    print(f"\n{file.name}\n  {'FAIL' if moved else 'ok  '} {len(walls)} walls, {through} pieces of street through them")
    print(f"       {moved} of these are not on the map")
    return moved == 0


if __name__ == "__main__":
    main()
