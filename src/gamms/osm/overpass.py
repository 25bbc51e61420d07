"""Streets and areas of places, from the answers of Nominatim and Overpass, which are checked before they are used."""

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, groupby
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from gamms.errors import BadType, BadValue, PlaceError
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.projection import WGS84, project
from gamms.osm.network import RoadNetwork, chosen_roads, network_of_segments, offsets_of, without_unused_nodes
from gamms.osm.polygons import (
    RING_ROLES,
    area_of,
    footprints_of,
    is_inside,
    meets,
    outlines_of,
    outlines_of_ways,
    repaired,
    widened,
)
from gamms.osm.servers import Json, MapServers
from gamms.osm.settings import setting
from gamms.osm.topology import simplify
from gamms.osm.ways import (
    CLOSED_TO,
    KEPT_TAGS,
    NO_ROADS,
    OSMType,
    Segments,
    Ways,
    is_against,
    kept_tags,
    largest_part,
    segments_of,
    traffic_rule,
)
from gamms.progress import progress
from gamms.text import shown

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

_MARGIN_M = 500.0  # around an area, so that its junctions are those of the whole map
_MOST_KM2 = 20_000.0
_KM_PER_DEGREE = 111.32
_FARTHEST = (180.0, 90.0)
_SIDEWALKS = ("sidewalk", "sidewalk:both", "sidewalk:left", "sidewalk:right")  # separate: there is another way to walk
_AREAS = ("Polygon", "MultiPolygon")
Show = Callable[[str], None]
Location = str | dict[str, str] | Sequence[str | dict[str, str]]
Tags = Mapping[str, bool | list[str]] | Mapping[str, bool | str | list[str]]
Element = dict[str, Any]
_Query = tuple[list[str], str]  # the kinds of elements with their filters, and what to output of those found
_FARTHEST = (180.0, 90.0)  # degrees of longitude and latitude
_MOST_CUT = 1 / 3  # share of ways that may lack nodes: where a map was cut, some do; where it is damaged, most do
_POLYGONS = ("Polygon", "MultiPolygon")


class StreetOptions(NamedTuple):
    """Which streets of an area are wanted."""

    osm_type: OSMType
    simplify: bool
    retain_all: bool
    truncate_by_edge: bool
    custom_filter: str | list[str] | None


@dataclass(slots=True, frozen=True)
class _Elements:
    """What Overpass answered, each element once."""

    nodes: dict[int, tuple[float, float]]  # degrees
    ways: dict[int, Element]
    relations: dict[int, Element]


def streets_of_place(
    location: Location, name: str, options: StreetOptions, show: Show, *, offline: bool
) -> RoadNetwork:
    """Download the streets inside the boundary of a place, in UTM metres.

    Raises:
        BadType, BadValue: the location is impossible.
        PlaceError, NetworkError: there is no such map, or no answer.
        MissingExtra: requests or pyproj is not installed.
    """
    _check_location(location)
    servers = MapServers(name, show, offline=offline)
    return _streets(servers, _boundary(servers, location), name, options, show)


def streets_of_polygon(
    polygon: "BaseGeometry", name: str, options: StreetOptions, show: Show, *, offline: bool
) -> RoadNetwork:
    """Download the streets inside a shapely Polygon or MultiPolygon in degrees; raises as `streets_of_place` does."""
    if getattr(polygon, "geom_type", None) not in _AREAS:
        raise BadType(
            f"polygon must be a shapely Polygon or MultiPolygon of (longitude, latitude), not {shown(polygon)}."
        )
    fault = _fault_of(polygon)
    if fault:
        raise BadValue(f"The area {name} is impossible: {fault}.")
    return _streets(MapServers(name, show, offline=offline), polygon, name, options, show)


def features_of_place(
    location: Location, tags: Tags, *, offline: bool = False
) -> "list[tuple[BaseGeometry, dict[str, str]]]":
    """Download the areas with some of these tags in a place: shapely polygons in degrees, each with all of its tags.

    Raises:
        BadType, BadValue: the location or the tags are impossible.
        PlaceError, NetworkError: there is no such place, nothing in it, or no answer.
        MissingExtra: requests or pyproj is not installed.
    """
    _check_location(location)
    _check_tags(tags)
    name = shown(location)
    with progress(1.0 if offline else 0.0) as show:
        servers = MapServers(name, show, offline=offline)
        boundary = _boundary(servers, location)
        show(f"Downloading the features of {name}")
        filters = [part for key, value in tags.items() for part in _tag_filters(key, value)]
        kinds = [f"{kind}{one}" for one in filters for kind in ("way", "relation")]
        found = _download(servers, boundary, [(kinds, "(._;>;);out;")], fault_of_areas)
        areas = _areas(found, tags, boundary)
        if not areas:
            raise PlaceError(f"There is nothing tagged {', '.join(tags)} in {name}. Try a larger area, or other tags.")
        servers.save_rest()
        return areas


def _boundary(servers: MapServers, location: Location) -> "BaseGeometry":
    """Return the outline of a place, or of several together."""
    queries = [location] if isinstance(location, (str, dict)) else list(location)
    boundary = area_of([_outline(servers, query) for query in queries])
    fault = _fault_of(boundary)
    if fault:
        raise PlaceError(
            f"The boundary of {shown(location)} is of no use: {fault}. Name a part of it, or use graph_from_bbox."
        )
    return boundary


def _outline(servers: MapServers, query: str | dict[str, str]) -> dict[str, Any]:
    places = servers.search(query, fault_of_places)
    places = sorted(places, key=lambda place: float(place["importance"]), reverse=True)
    outlines = [place["geojson"] for place in places if (place.get("geojson") or {}).get("type") in _AREAS]
    if not outlines:
        raise PlaceError(
            f"There is no place {shown(query)}, or its boundary is not on the map (the server knows {len(places)} "
            "places of that name, and no outline). Check the spelling, or use graph_from_point or graph_from_bbox."
        )
    outline: dict[str, Any] = outlines[0]
    return outline


def _streets(
    servers: MapServers, polygon: "BaseGeometry", name: str, options: StreetOptions, show: Show
) -> RoadNetwork:
    show(f"Downloading the streets of {name}")
    surroundings = widened(polygon, _MARGIN_M)
    filters = options.custom_filter or _filter_of(options.osm_type)
    queries = [([f"way{one}"], "(._;>;);out;") for one in ([filters] if isinstance(filters, str) else filters)]
    found = _download(servers, surroundings, queries, fault_of_streets)
    ways = _ways(found, options.osm_type)
    segments = _part(segments_of(ways), surroundings, options)
    if len(segments.sources):
        network = network_of_segments(segments, ways.tags)
        network = simplify(network) if options.simplify else network
        lonlat = project(network.xy, str(network.crs), WGS84)
        roads = Segments(lonlat, network.sources, network.targets, np.arange(len(network.sources)))
        chosen = _part(roads, polygon, options).ways
        if len(chosen):
            servers.save_rest()
            return without_unused_nodes(chosen_roads(network, chosen))
    kind = options.custom_filter or options.osm_type.name.lower()
    raise PlaceError(
        f"There are no streets of the type {shown(kind)} in {name}. "
        "Try a larger area, or another osm_type or custom_filter."
    )


def _part(segments: Segments, area: "BaseGeometry", options: StreetOptions) -> Segments:
    """Return the segments in an area and, unless all are wanted, connected with each other."""
    if not len(segments.sources):
        return segments
    kept = is_inside(area, segments.lonlat)
    if options.truncate_by_edge:
        crossing = kept[segments.sources] | kept[segments.targets]
        kept[segments.sources[crossing]] = kept[segments.targets[crossing]] = True
    inside = kept[segments.sources] & kept[segments.targets]
    part = Segments(segments.lonlat, segments.sources[inside], segments.targets[inside], segments.ways[inside])
    return part if options.retain_all or not inside.any() else largest_part(part)


def _ways(found: _Elements, osm_type: OSMType) -> Ways:
    """Return the ways as columns; walkers have no one-way streets."""
    useful = [str(name) for name in setting("useful_tags_way") if name != "oneway"]
    names = [*(name for name in KEPT_TAGS if name in useful), *(name for name in useful if name not in KEPT_TAGS)]
    refs = [[ref for ref, _ in groupby(way["nodes"])] for way in found.ways.values()]
    tags = [kept_tags(way["id"], way.get("tags", {}), osm_type, names) for way in found.ways.values()]
    rules = [traffic_rule(osm_type, way.get("tags", {})) for way in found.ways.values()]
    if osm_type is OSMType.WALK:
        tags, rules = [{**of_way, "oneway": False} for of_way in tags], [None] * len(rules)
    offsets, lonlat, ids = _vertices(found, refs)
    return Ways(offsets, ids, lonlat, np.array([is_against(rule) for rule in rules], np.bool_), tags)


def _areas(found: _Elements, tags: Tags, boundary: "BaseGeometry") -> "list[tuple[BaseGeometry, dict[str, str]]]":
    """Return the closed ways and multipolygons with one of these tags as shapes with all their tags."""
    rings = [way for way in found.ways.values() if _is_ring(way) and _suits(way, tags)]
    relations = [one for one in found.relations.values() if _is_area(one) and _suits(one, tags)]
    ways_of = [[way["id"]] for way in rings]
    for relation in relations:
        members = relation["members"]
        ways_of.append([one["ref"] for one in members if one["type"] == "way" and one["role"] in RING_ROLES])
    about = [one["tags"] for one in [*rings, *relations]]
    row_of = {id: row for row, id in enumerate(found.ways)}
    offsets, lonlat, _ = _vertices(found, [way["nodes"] for way in found.ways.values()])
    shapes = repaired(footprints_of(outlines_of_ways(offsets, lonlat, row_of, ways_of, about)))
    inside = meets(boundary, shapes)
    return [
        (shapes[row], dict(about[row])) for row in np.flatnonzero(inside).tolist() if shapes[row].geom_type in _AREAS
    ]


def _is_ring(way: Element) -> bool:
    nodes = way["nodes"]
    return len(nodes) > 3 and nodes[0] == nodes[-1] and way.get("tags", {}).get("area") != "no"


def _is_area(relation: Element) -> bool:
    return relation.get("tags", {}).get("type") in ("multipolygon", "boundary")


def _suits(element: Element, tags: Tags) -> bool:
    found = element.get("tags", {})
    return any(key in found and (value is True or found[key] in _values(value)) for key, value in tags.items())


def _values(value: bool | str | list[str]) -> Sequence[str]:
    return [value] if isinstance(value, str) else value if isinstance(value, list) else []


def _vertices(found: _Elements, lines: list[list[int]]) -> tuple[IntArray, FloatArray, IntArray]:
    """Return the offsets of lines through these nodes, degrees (vertices, 2) or NaN, and the ids of the nodes."""
    nowhere = (math.nan, math.nan)
    refs = [ref for line in lines for ref in line]
    lonlat = np.array([found.nodes.get(ref, nowhere) for ref in refs], np.float64).reshape(-1, 2)
    return offsets_of(np.array([len(line) for line in lines], np.int64)), lonlat, np.array(refs, np.int64)


# -- the language of Overpass -----------------------------------------------------------------------------------


def _download(
    servers: MapServers, area: "BaseGeometry", queries: list[_Query], fault_of: Callable[[Any], str]
) -> _Elements:
    """Ask each query for the whole area."""
    found: dict[str, dict[int, Element]] = {"node": {}, "way": {}, "relation": {}}
    for outline in outlines_of(area, float(setting("max_query_area_size"))):
        corners = " ".join(f"{lat:.6f} {lon:.6f}" for lon, lat in outline.tolist())
        for kinds, output in queries:
            union = "".join(f"{kind}(poly:'{corners}');" for kind in kinds)
            for element in servers.query(f"({union});{output}", fault_of)["elements"]:
                if element["type"] in found:
                    found[element["type"]][element["id"]] = element
    nodes = {id: (node["lon"], node["lat"]) for id, node in found["node"].items()}
    return _Elements(nodes, found["way"], found["relation"])


def _filter_of(osm_type: OSMType) -> str:
    """Return the ways that files would be read for, as a filter of Overpass."""
    closed = {name: sorted(values) for name, values in CLOSED_TO[osm_type].items()}
    closed["highway"] = sorted([*closed["highway"], *NO_ROADS])
    closed["area"] = ["yes"]
    if osm_type is OSMType.WALK:
        closed.update({name: ["separate"] for name in _SIDEWALKS})
    return '["highway"]' + "".join(f'["{name}"!~"^({"|".join(values)})$"]' for name, values in closed.items())


def _tag_filters(key: str, value: bool | str | list[str]) -> list[str]:
    quoted = json.dumps(key, ensure_ascii=False)
    if value is True:
        return [f"[{quoted}]"]
    return [f"[{quoted}={json.dumps(one, ensure_ascii=False)}]" for one in _values(value)]


# -- what is asked, checked -------------------------------------------------------------------------------------


def _check_location(location: object) -> None:
    places = location if isinstance(location, (list, tuple)) else [location]
    for place in places:
        texts: list[Any] = [*place.keys(), *place.values()] if isinstance(place, dict) else [place]
        if not all(isinstance(text, str) for text in texts):
            raise BadType(
                f"location must be the name of a place, a dict such as {{'city': 'Turku'}} or a list of these, "
                f"not {shown(location)} ({type(location).__name__})."
            )
        if not any(text.strip() for text in texts):
            raise BadValue(f"location must name a place, not {shown(location)}.")
    if not places:
        raise BadValue("location must name a place, not be an empty list.")


def _check_tags(tags: object) -> None:
    if not isinstance(tags, dict):
        raise BadType(f"tags must be a dict such as {{'building': True}}, not {shown(tags)} ({type(tags).__name__}).")
    if not tags:
        raise BadValue("tags must name what to look for, such as {'building': True}, not be empty.")
    for key, value in tags.items():
        values = value if isinstance(value, list) else [value]
        if not isinstance(key, str) or not (value is True or all(isinstance(one, str) for one in values)):
            raise BadType(f"tags[{shown(key)}] must be True, a text or a list of texts, not {shown(value)}.")


def _fault_of(polygon: "BaseGeometry") -> str:
    """Return why no map can be made of the area inside a shapely shape, in words."""
    if polygon.geom_type not in _AREAS:
        return f"it is a {polygon.geom_type}, not an area"
    west, south, east, north = polygon.bounds
    if max(-west, east) <= _FARTHEST[0] < east - west:  # of a circle around the meridian, the outline crosses itself
        return "it lies on both sides of the 180th meridian, where map servers end; take one side, or read a file"
    if polygon.is_empty or not polygon.is_valid:
        return "its outline is empty or crosses itself"
    if max(-west, east) > _FARTHEST[0] or max(-south, north) > _FARTHEST[1]:
        return f"its bounds {polygon.bounds} are not degrees of longitude and latitude"
    km2 = polygon.area * _KM_PER_DEGREE**2 * math.cos(math.radians((south + north) / 2.0))
    return f"it has {km2:.0f} km², and {_MOST_KM2:.0f} km² are the most" if km2 > _MOST_KM2 else ""


def fault_of_places(answer: Json) -> str:
    """Return the fault of Nominatim's answer to the question where a place is; an empty one has none."""
    if not isinstance(answer, list) or not all(isinstance(place, dict) for place in answer):
        return "it is no list of places"
    return next((fault for place in answer if (fault := _fault_of_place(place))), "")


def fault_of_streets(answer: Json) -> str:
    """Return the fault of Overpass's answer to the question for streets; an empty one has none."""
    fault = _fault_of_elements(answer)
    if fault:
        return fault
    nodes = {element["id"] for element in answer["elements"] if element["type"] == "node"}
    ways = (element for element in answer["elements"] if element["type"] == "way")
    cut = next((way["id"] for way in ways if not nodes.issuperset(way["nodes"])), None)
    return "" if cut is None else f"it lacks nodes of the way {cut}"


def fault_of_areas(answer: Json) -> str:
    """Return the fault of Overpass's answer to the question for buildings and the like; an empty one has none."""
    fault = _fault_of_elements(answer)
    if fault:
        return fault
    nodes = {element["id"] for element in answer["elements"] if element["type"] == "node"}
    ways = [element for element in answer["elements"] if element["type"] == "way"]
    cut = sum(not nodes.issuperset(way["nodes"]) for way in ways)
    return f"it lacks nodes of {cut} of its {len(ways)} ways" if cut > _MOST_CUT * len(ways) else ""


def _fault_of_elements(answer: Json) -> str:
    if not isinstance(answer, dict) or not isinstance(answer.get("elements"), list):
        return "it has no list of elements"
    if answer.get("remark"):
        return f"it is incomplete, for the server remarks {str(answer['remark'])[:200]!r}"
    return next((f"{str(one)[:100]} is no element" for one in answer["elements"] if not _is_element(one)), "")


def _fault_of_place(place: dict[str, Any]) -> str:
    try:
        is_ranked = math.isfinite(float(place["importance"]))  # Nominatim may write numbers as text
    except (KeyError, TypeError, ValueError):
        is_ranked = False
    shape = place.get("geojson")
    if not is_ranked:
        return "a place has no importance"
    if shape is not None and (not isinstance(shape, dict) or not isinstance(shape.get("type"), str)):
        return "a place has a geometry without a type"
    if shape is None or shape["type"] not in _POLYGONS or _is_outline(shape.get("coordinates"), shape["type"]):
        return ""
    return "a place has a boundary that is no polygon"


def _is_outline(coordinates: Json, kind: str) -> bool:
    try:
        rings = coordinates if kind == "Polygon" else list(chain.from_iterable(coordinates))
        return bool(rings) and all(len(ring) >= 4 and all(map(_is_position, ring)) for ring in rings)
    except TypeError:
        return False


def _is_position(place: object) -> bool:
    return (
        isinstance(place, list)
        and len(place) >= 2
        and all(_is_number(x) and abs(x) <= most for x, most in zip(place, _FARTHEST, strict=False))
    )


def _is_element(element: object) -> bool:
    if not isinstance(element, dict) or not isinstance(element.get("type"), str):
        return False
    tags = element.get("tags", {})
    if not isinstance(tags, dict) or not all(isinstance(text, str) for text in _texts(tags)):
        return False
    check = _ELEMENTS.get(element["type"])
    return check is None or (_is_id(element.get("id")) and check(element))


def _texts(tags: dict[Any, Any]) -> Iterator[Any]:
    return chain(tags.keys(), tags.values())


def _is_node(node: dict[str, Any]) -> bool:
    return _is_position([node.get("lon"), node.get("lat")])


def _is_way(way: dict[str, Any]) -> bool:
    nodes = way.get("nodes")
    return isinstance(nodes, list) and all(map(_is_id, nodes))


def _is_relation(relation: dict[str, Any]) -> bool:
    members = relation.get("members")
    return isinstance(members, list) and all(
        isinstance(member, dict) and {"type", "ref", "role"} <= member.keys() for member in members
    )


_ELEMENTS = {"node": _is_node, "way": _is_way, "relation": _is_relation}


def _is_id(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
