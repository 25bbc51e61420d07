"""Streets and areas of places, from the answers of Nominatim and Overpass; read `servers.py` for how they are asked."""

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np

from gamms.errors import BadType, BadValue, PlaceError
from gamms.ir.graph import FloatArray
from gamms.ir.projection import WGS84, project
from gamms.osm.answers import fault_of_areas, fault_of_places, fault_of_streets
from gamms.osm.network import RoadNetwork, chosen_roads, network_of_segments, without_unused_nodes
from gamms.osm.polygons import Outlines, area_of, footprints_of, is_inside, meets, outlines_of, repaired, widened
from gamms.osm.polylines import offsets_of
from gamms.osm.servers import MapServers
from gamms.osm.settings import setting
from gamms.osm.simplify import simplify
from gamms.osm.travel import CLOSED_TO, OSMType
from gamms.osm.ways import (
    KEPT_TAGS,
    NO_ROADS,
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

_MARGIN_M = 500.0  # around an area, so that its junctions are those of the whole map
_MOST_KM2 = 20_000.0
_KM_PER_DEGREE = 111.32
_FARTHEST = (180.0, 90.0)
_SIDEWALKS = ("sidewalk", "sidewalk:both", "sidewalk:left", "sidewalk:right")  # separate: there is another way to walk
_AREAS = ("Polygon", "MultiPolygon")
_ROLES = ("outer", "inner", "")

Show = Callable[[str], None]
Location = str | dict[str, str] | Sequence[str | dict[str, str]]
Tags = Mapping[str, bool | str | list[str]]
Element = dict[str, Any]
_Query = tuple[list[str], str]  # the kinds of elements with their filters, and what to output of those found


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


def streets_of_place(location: Location, options: StreetOptions, show: Show, *, offline: bool) -> RoadNetwork:
    """Download the streets inside the boundary of a place, in UTM metres.

    Raises:
        BadType, BadValue: the location is impossible.
        PlaceError, NetworkError: there is no such map, or no answer.
        MissingExtra: requests or pyproj is not installed.
    """
    _check_location(location)
    servers = MapServers(shown(location), show, offline=offline)
    return _streets(servers, _boundary(servers, location), shown(location), options, show)


def streets_of_polygon(polygon: Any, name: str, options: StreetOptions, show: Show, *, offline: bool) -> RoadNetwork:
    """Download the streets inside a shapely Polygon or MultiPolygon in degrees; raises as `streets_of_place` does."""
    if getattr(polygon, "geom_type", None) not in _AREAS:
        raise BadType(
            f"polygon must be a shapely Polygon or MultiPolygon of (longitude, latitude), not {shown(polygon)}."
        )
    fault = _fault_of(polygon)
    if fault:
        raise BadValue(f"The area {name} is impossible: {fault}.")
    return _streets(MapServers(name, show, offline=offline), polygon, name, options, show)


def features_of_place(location: Location, tags: Tags, *, offline: bool = False) -> list[tuple[Any, dict[str, str]]]:
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


def _boundary(servers: MapServers, location: Location) -> Any:
    """The outline of a place, or of several together."""
    queries = [location] if isinstance(location, (str, dict)) else list(location)
    boundary = area_of([_outline(servers, query) for query in queries])
    fault = _fault_of(boundary)
    if fault:
        raise PlaceError(
            f"The boundary of {shown(location)} is of no use: {fault}. Name a part of it, or use graph_from_bbox."
        )
    return boundary


def _outline(servers: MapServers, query: str | dict[str, str]) -> Any:
    places = servers.search(query, fault_of_places)
    places = sorted(places, key=lambda place: float(place["importance"]), reverse=True)
    outlines = [place["geojson"] for place in places if (place.get("geojson") or {}).get("type") in _AREAS]
    if not outlines:
        raise PlaceError(
            f"There is no place {shown(query)}, or its boundary is not on the map (the server knows {len(places)} "
            "places of that name, and no outline). Check the spelling, or use graph_from_point or graph_from_bbox."
        )
    return outlines[0]


def _streets(servers: MapServers, polygon: Any, name: str, options: StreetOptions, show: Show) -> RoadNetwork:
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


def _part(segments: Segments, area: Any, options: StreetOptions) -> Segments:
    """The segments in an area and, unless all are wanted, connected with each other."""
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
    """The ways as columns; walkers have no one-way streets."""
    useful = [str(name) for name in setting("useful_tags_way") if name != "oneway"]
    names = [*(name for name in KEPT_TAGS if name in useful), *(name for name in useful if name not in KEPT_TAGS)]
    refs = [[ref for ref, _ in groupby(way["nodes"])] for way in found.ways.values()]
    tags = [kept_tags(way["id"], way.get("tags", {}), osm_type, names) for way in found.ways.values()]
    rules = [traffic_rule(osm_type, way.get("tags", {})) for way in found.ways.values()]
    if osm_type is OSMType.WALK:
        tags, rules = [{**of_way, "oneway": False} for of_way in tags], [None] * len(rules)
    all_refs = [ref for of_way in refs for ref in of_way]
    return Ways(
        offsets_of(np.array([len(of_way) for of_way in refs], np.int64)),
        np.array(all_refs, np.int64),
        _lonlat(found, all_refs),
        np.array([is_against(rule) for rule in rules], np.bool_),
        tags,
    )


def _areas(found: _Elements, tags: Tags, boundary: Any) -> list[tuple[Any, dict[str, str]]]:
    """The closed ways and multipolygons with one of these tags, as shapes with all their tags; parts are left out."""
    whole = {
        id: way["nodes"]
        for id, way in found.ways.items()
        if len(way["nodes"]) > 1 and found.nodes.keys() >= set(way["nodes"])
    }
    rings = [way for way in found.ways.values() if _is_ring(way) and way["id"] in whole and _suits(way, tags)]
    relations = [one for one in found.relations.values() if _is_area(one) and _suits(one, tags)]
    bundles = [[way["id"]] for way in rings] + [
        sorted(
            {one["ref"] for one in relation["members"] if one["type"] == "way" and one["role"] in _ROLES} & whole.keys()
        )
        for relation in relations
    ]
    about = [one["tags"] for one in [*rings, *relations]]
    lines = [whole[way] for bundle in bundles for way in bundle]
    owners = np.repeat(np.arange(len(bundles)), np.array([len(bundle) for bundle in bundles], np.int64))
    lonlat = _lonlat(found, [ref for line in lines for ref in line])
    outlines = Outlines(offsets_of(np.array([len(line) for line in lines], np.int64)), lonlat, owners, about)
    shapes = repaired(footprints_of(outlines))
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


def _lonlat(found: _Elements, refs: Iterable[int]) -> FloatArray:
    nowhere = (math.nan, math.nan)
    return np.array([found.nodes.get(ref, nowhere) for ref in refs], np.float64).reshape(-1, 2)


# -- the language of Overpass -----------------------------------------------------------------------------------


def _download(servers: MapServers, area: Any, queries: list[_Query], fault_of: Callable[[Any], str]) -> _Elements:
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
    """The ways that files would be read for, as a filter of Overpass."""
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


def _fault_of(polygon: Any) -> str:
    """Why no map can be made of the area inside a shapely shape, in words."""
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
