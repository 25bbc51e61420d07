"""Streets and areas of places, from answers of Nominatim and Overpass, which are checked before use."""

import json
import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from itertools import product
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, TypeVar

import msgspec
import numpy as np
from msgspec import Meta

from gamms.errors import BadType, BadValue, GammsError, NetworkError, PlaceError
from gamms.ir.projection import WGS84, project
from gamms.limits import MemoryBudget, max_memory
from gamms.osm import footprints
from gamms.osm.areas import add_ways_across, measure_across
from gamms.osm.footprints import TagFilter, check_filter, is_asked_for
from gamms.osm.mode_union import ModeRoads, find_uses_in_largest_parts, keep_uses, unite
from gamms.osm.modes import (
    Mode,
    ModeCombination,
    ModeFunction,
    Travel,
    find_stops,
    find_vehicles,
    get_mode_name,
    honour_traffic,
    list_mode_keys,
    make_paced_rule,
    make_rule,
    modes,
)
from gamms.osm.network import (
    CLOSED_TO,
    KEPT_TAGS,
    ROADS,
    CoverageGaps,
    OsmRoads,
    OSMType,
    RoadNetwork,
    RoadSegments,
    Rule,
    add_stated_times,
    add_turns,
    cut_segments,
    describe_read_ways,
    find_largest_part,
    make_network_of_segments,
    project_to_metres,
    select_roads,
)
from gamms.osm.objects import (
    LEAST_NODES,
    NODE,
    RELATION,
    WAY,
    MapElement,
    NodeTags,
    ObjectVersions,
    Wanted,
    find_nodes_at_two_places,
)
from gamms.osm.reader import read_buildings, read_footprints, read_lines, read_ways
from gamms.osm.servers import Json, MapServers
from gamms.osm.settings import get_setting
from gamms.osm.topology import remove_unused_nodes, simplify
from gamms.osm.turns import parse_restrictions
from gamms.progress import Show, show_progress
from gamms.text import shown

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

_MARGIN_M = 500.0  # around an area, so that its junctions are those of the whole map
_MOST_KM2 = 20_000.0
_KM_PER_DEGREE = 111.32
_FARTHEST = (180.0, 90.0)  # degrees of longitude and latitude
_PER_DEGREE = 1e7  # units of places
_MOST_CUT = 1 / 3  # share of areas that may lack nodes: where a map was cut, some do; where it is damaged, most do
Location = str | dict[str, str] | Sequence[str | dict[str, str]]
_Any = TypeVar("_Any", bound="_Element")
_Query = tuple[list[str], str]  # the kinds of elements with their filters, and the output statement


class StreetOptions(NamedTuple):
    """Options for the streets of an area; `create_osm_graph` explains each."""

    osm_type: OSMType = OSMType.WALK
    resolution: float = 10.0
    simplify: bool = True
    retain_all: bool = False
    truncate_by_edge: bool = True
    custom_filter: str | list[str] | None = None
    tolerance: float = 10.0
    bidirectional: bool | None = None
    offline: bool = False
    mode: Travel | None = None  # takes its ways and directions, instead of those of OSMnx's network type
    strong: bool = False
    tags: Sequence[str] = ()  # further tags to keep
    around_buildings: bool = False


def download_streets_of_place(location: Location, name: str, options: StreetOptions, show: Show) -> RoadNetwork:
    """Download the streets inside the boundary of a place, in UTM meters.

    Raises:
        BadType, BadValue: the location is impossible.
        PlaceError, NetworkError: the map does not exist, or there is no answer.
        MissingExtra: requests is not installed.
    """
    _check_location(location)
    servers = MapServers(name, show, offline=options.offline)
    return _find_streets(servers, _find_boundary(servers, location), name, options, show)


def download_streets_of_polygon(polygon: "BaseGeometry", name: str, options: StreetOptions, show: Show) -> RoadNetwork:
    """Download the streets inside a shapely shape in degrees; raises like `download_streets_of_place`."""
    if getattr(polygon, "geom_type", None) not in _RINGS:
        raise BadType(
            f"polygon must be a shapely Polygon or MultiPolygon of (longitude, latitude), not {shown(polygon)}."
        )
    fault = _find_fault(polygon)
    if fault:
        raise BadValue(f"The area {name} is impossible: {fault}.")
    return _find_streets(MapServers(name, show, offline=options.offline), polygon, name, options, show)


def download_features_of_place(
    location: Location, tags: TagFilter, lines: Sequence[str] = (), *, offline: bool = False
) -> "list[tuple[BaseGeometry, dict[str, str]]]":
    """Download the areas with some of these tags in a place: shapely polygons in degrees, each with all of its tags.

    Ways with one of the keys `lines` follow as LineStrings, unless they are such an area.

    Raises:
        BadType, BadValue: the location or the tags are impossible.
        PlaceError, NetworkError: the place is unknown or empty, or there is no answer.
        MissingExtra: requests is not installed.
    """
    _check_location(location)
    wanted = check_filter(tags)
    if not wanted:
        raise BadValue("tags must name what to look for, such as {'building': True}, not be empty.")
    name = shown(location)
    with show_progress(1.0 if offline else 0.0) as show:
        servers = MapServers(name, show, offline=offline)
        boundary = _find_boundary(servers, location)
        show(f"Downloading the features of {name}")
        filters: list[str] = []
        for key, values in wanted.items():
            texts = [""] if values is None else [f"={json.dumps(one, ensure_ascii=False)}" for one in values]
            filters += [json.dumps(key, ensure_ascii=False) + text for text in texts]
        kinds = [f"{kind}[{one}]" for one, kind in product(filters, ("way", "relation"))]
        kinds += [f"way[{json.dumps(key)}]" for key in lines]
        found = _download(servers, boundary, [(kinds, "(._;>;);out;")], read_areas)
        areas = read_footprints(found, _WantedAreas(wanted))
        shapes = footprints.repair(footprints.make_footprints(areas))
        rows = np.flatnonzero(footprints.find_intersecting(boundary, shapes)).tolist()
        features = [(shapes[row], areas.about[row]) for row in rows if shapes[row].geom_type in _RINGS]
        if not features:
            raise PlaceError(f"There is nothing tagged {', '.join(tags)} in {name}. Try a larger area, or other tags.")
        servers.save_rest()
        others = read_lines(found, lines, lambda tags: None if is_asked_for(tags, wanted) else tags)
        about = [others.about[row] for row in others.owners.tolist()]
        return [*features, *zip(footprints.make_lines(others).tolist(), about, strict=True)]


class _WantedAreas:
    """The rules for areas with tags that are asked for; `wanted` comes from `check_filter`."""

    def __init__(self, wanted: Mapping[str, Collection[str] | None]) -> None:
        self.keys = [*wanted]
        self._wanted = wanted

    def find_wall(self, tags: Mapping[str, str]) -> Mapping[str, str] | None:
        """Return the tags of an area that is asked for, else None."""
        return tags if is_asked_for(tags, self._wanted) else None


def _find_boundary(servers: MapServers, location: Location) -> "BaseGeometry":
    """Return the outline of a place, or of several together."""
    queries = [location] if isinstance(location, (str, dict)) else list(location)
    boundary = footprints.unite_outlines([_find_outline(servers, query) for query in queries])
    fault = _find_fault(boundary)
    if fault:
        raise PlaceError(
            f"The boundary of {shown(location)} cannot be used: {fault}. Name a part of it, or use graph_from_bbox."
        )
    return boundary


def _find_outline(servers: MapServers, query: str | dict[str, str]) -> dict[str, Any]:
    places = servers.search(query, _read_places)
    outlined = [place for place in places if place.geojson is not None and place.geojson.type in _RINGS]
    if not outlined:
        raise PlaceError(
            f"There is no place {shown(query)}, or its boundary is not on the map (the server knows {len(places)} "
            "places of that name, and no outline). Check the spelling, or use graph_from_point or graph_from_bbox."
        )
    outline: dict[str, Any] = msgspec.to_builtins(max(outlined, key=lambda place: place.importance).geojson)
    return outline


def _find_streets(
    servers: MapServers, polygon: "BaseGeometry", name: str, options: StreetOptions, show: Show
) -> RoadNetwork:
    show(f"Downloading the streets of {name}")
    surroundings = footprints.widen(polygon, _MARGIN_M)
    if options.custom_filter or options.mode is None:
        filters = options.custom_filter or _make_filter(options.osm_type)
        queries = [([f"way{one}"], "(._;>;);out;") for one in ([filters] if isinstance(filters, str) else filters)]
    else:
        wanted = [f"way{one}" for one in _list_filters(options.mode)]
        wanted.append('relation["highway"]["type"="multipolygon"]')
        if any(find_vehicles(mode) for mode in _find_modes(options)):
            wanted.append('relation["type"~"^restriction"]')
        queries = [(wanted, "(._;>;);out;")]
    found = _download(servers, surroundings, queries, read_streets)
    buildings = None
    if options.around_buildings:
        show(f"Downloading the buildings of {name}")
        kinds = ['way["building"]', 'relation["building"]["type"="multipolygon"]']
        buildings = read_buildings(_download(servers, surroundings, [(kinds, "(._;>;);out;")], read_areas))
    network = _make_network(found, buildings, surroundings, options, show)
    if network is not None:
        there = _cut_to_area(simplify(network) if options.simplify else network, polygon, options)
        if len(there.sources):
            servers.save_rest()
            return there
    kind = options.custom_filter or (get_mode_name(options.mode) if options.mode else options.osm_type.name.lower())
    keys = ROADS if options.mode is None else _list_keys(options.mode)
    only = (
        ""
        if options.custom_filter
        else f"{describe_read_ways(keys)}; custom_filter='[\"railway\"]' would ask for others. "
    )
    raise PlaceError(
        f"There are no streets of the type {shown(kind)} in {name}. {only}"
        "Try a larger area, or another osm_type or custom_filter."
    )


def _find_modes(options: StreetOptions) -> "tuple[ModeFunction | None, ...]":
    return options.mode.modes if isinstance(options.mode, ModeCombination) else (options.mode,)


def _make_network(
    found: "_Answers",
    buildings: "footprints.BuildingIndex | None",
    area: "BaseGeometry",
    options: StreetOptions,
    show: Show,
) -> RoadNetwork | None:
    """Return the streets in an area in UTM meters; None if there are none for the mode, or for one of several."""
    parts = list[ModeRoads]()
    for one in _find_modes(options):
        mode = honour_traffic(one) if one is not None and options.bidirectional is False else one
        ways = add_stated_times(_read_ways(found, mode, options, show))
        ways = add_ways_across(replace(ways, buildings=buildings))
        segments = add_turns(_select_segments(cut_segments(ways), area, options), ways)
        if not len(segments.sources):
            return None
        parts.append(ModeRoads("" if mode is None else get_mode_name(mode), ways, segments))
    if isinstance(options.mode, ModeCombination):
        return project_to_metres(unite(parts, both_ways=bool(options.bidirectional)).network)
    name, ways, segments = parts[0]
    network = make_network_of_segments(segments, ways.tags)
    gaps = CoverageGaps(barriers=len(ways.barriers), across_m=measure_across(ways))
    network = replace(network, nodes=ways.nodes or NodeTags(), buildings=ways.buildings, left_out=gaps)
    return network if name else replace(network, refs=None)


def _cut_to_area(network: RoadNetwork, area: "BaseGeometry", options: StreetOptions) -> RoadNetwork:
    """Return the streets in an area, possibly none: unless all are wanted, the largest part, or that of each mode."""
    lonlat = project(network.xy, str(network.crs), WGS84)
    roads = RoadSegments(lonlat, network.sources, network.targets, np.arange(len(network.sources)))
    if network.modes:
        within = select_roads(network, _select_segments(roads, area, options._replace(retain_all=True)).ways)
        return keep_uses(within, options.retain_all | find_uses_in_largest_parts(within, strong=options.strong))
    inside = _select_segments(roads, area, options)
    there = find_largest_part(inside, ~network.two_way[inside.ways]) if options.strong and len(inside.ways) else inside
    lost = float(network.lengths[inside.ways].sum() - network.lengths[there.ways].sum())
    kept = select_roads(network, there.ways)
    return remove_unused_nodes(replace(kept, left_out=network.left_out._replace(no_way_back_m=lost)))


def _select_segments(segments: RoadSegments, area: "BaseGeometry", options: StreetOptions) -> RoadSegments:
    """Return the segments in an area and, unless all are wanted, only their largest connected part."""
    if not len(segments.sources):
        return segments
    kept = footprints.is_inside(area, segments.lonlat)
    if options.truncate_by_edge:
        crossing = kept[segments.sources] | kept[segments.targets]
        kept[segments.sources[crossing]] = kept[segments.targets[crossing]] = True
    inside = kept[segments.sources] & kept[segments.targets]
    ends = segments.sources[inside], segments.targets[inside]
    part = replace(segments, sources=ends[0], targets=ends[1], ways=segments.ways[inside])
    return part if options.retain_all or not inside.any() else find_largest_part(part)


def _read_ways(found: "_Answers", mode: ModeFunction | None, options: StreetOptions, show: Show) -> OsmRoads:
    """Return the ways as columns, with the speeds of the mode."""
    keys = () if mode is None or options.custom_filter else list_mode_keys(mode)
    ways = read_ways(
        *(found, show, _make_rule(mode, options), options.tags),
        areas=mode is not None,
        stops=find_stops(mode),
        keys=keys,
    )
    vehicles = {} if mode is None or not find_vehicles(mode) else {get_mode_name(mode): find_vehicles(mode)}
    return replace(ways, restrictions=parse_restrictions(ways.signs, vehicles))


def _make_rule(mode: ModeFunction | None, options: StreetOptions) -> Rule:
    """Return the rule for the ways of answers; without a mode, walkers have no one-way streets."""
    useful = [
        *dict.fromkeys(str(name) for name in (*get_setting("useful_tags_way"), *options.tags) if name != "oneway")
    ]
    names = sorted(useful, key=lambda name: KEPT_TAGS.index(name) if name in KEPT_TAGS else len(KEPT_TAGS))
    of_mode = None if mode is None else make_rule(mode, names)
    if of_mode is not None and not options.custom_filter:
        return of_mode
    any_way = make_paced_rule(mode or modes()[options.osm_type.name.lower()], options.osm_type, names)

    def rule(id: int, tags: Mapping[str, str]) -> tuple[dict[str, Any], bool] | None:
        found = None if of_mode is None else of_mode(id, tags)
        found = found or any_way(id, tags)
        if found is not None and of_mode is None and options.osm_type is OSMType.WALK:
            return {**found[0], "oneway": False}, False
        return found

    return rule


# -- the language of Overpass -----------------------------------------------------------------------------------


def _download(
    servers: MapServers, area: "BaseGeometry", queries: list[_Query], read: "Callable[[Json], list[_Element]]"
) -> "_Answers":
    """Run each query for the whole area."""
    found: list[_Element] = []
    for outline in footprints.outline_area(area, float(get_setting("max_query_area_size"))):
        corners = " ".join(f"{lat:.6f} {lon:.6f}" for lon, lat in outline.tolist())
        for kinds, output in queries:
            union = "".join(f"{kind}(poly:'{corners}');" for kind in kinds)
            found += servers.query(f"({union});{output}", read)
    return _Answers(found)


class _Answers:
    """Answers of Overpass as the elements in them that count; parts of an area may give one several times."""

    name = "the answers of the server"

    def __init__(self, given: "Sequence[_Element]") -> None:
        self._of: dict[str, list[Any]] = {  # kind -> elements
            kind: _list_last_versions([one for one in given if isinstance(one, type)]) for kind, type in _KINDS.items()
        }
        nodes = self._of["node"]
        lonlat = np.array([(one.lon, one.lat) for one in nodes], np.float64).reshape(-1, 2)
        self._ids = np.array([one.id for one in nodes], np.int64)
        self._places = np.rint(lonlat * _PER_DEGREE).astype(np.int64)
        self.unclear = find_nodes_at_two_places(self._ids, lonlat)

    def get_budget(self) -> MemoryBudget:
        """Return as much memory as elements can take: their number was limited when they were downloaded."""
        return MemoryBudget(max_memory(), self.name, is_streamed=True)

    @contextmanager
    def convert_errors(self) -> Iterator[None]:
        """Turn contradictions into a `NetworkError`."""
        try:
            yield
        except GammsError:
            raise
        except ValueError as error:
            raise NetworkError(f"The answers of the server contradict each other: {error}. Try again later.") from None

    def read_elements(
        self,
        keys: Mapping[str, Collection[str]],
        ids: Collection[int] = (),
        *,
        has_places: bool = False,  # noqa: ARG002 - for sources that know them at once
        wanted: Wanted | None = None,
    ) -> Iterator[MapElement]:
        """Yield the elements that are asked for; see `MapSource`."""
        for name, some in self._of.items():
            kind = name[0]
            for one in some:
                is_there = kind == WAY and one.id in ids
                if kind in keys and one.tags:
                    is_there = not keys[kind] or not one.tags.keys().isdisjoint(keys[kind])
                if is_there and (wanted is None or wanted(kind, one.tags)):
                    yield one.as_element()

    def read_nodes(self) -> Iterator[tuple[int, int, int]]:
        """Yield all nodes; see `MapSource`."""
        for id, (x, y) in zip(self._ids.tolist(), self._places.tolist(), strict=True):
            yield id, x, y


def _list_last_versions(elements: list[_Any]) -> list[_Any]:
    """Return the elements of one kind that are not deleted, in the version that counts."""
    ids = np.array([one.id for one in elements], np.int64)
    versions = np.array([one.version for one in elements], np.int64)
    deleted = np.array([not one.visible for one in elements], np.bool_)
    rows = np.flatnonzero(ObjectVersions(ids, versions, deleted).are_counting(ids, versions))
    return [elements[row] for row in rows.tolist()]


def _list_keys(travel: Travel) -> list[str]:
    """Return the keys of ways of a mode or of several."""
    several = travel.modes if isinstance(travel, ModeCombination) else (travel,)
    return [*dict.fromkeys(key for mode in several for key in list_mode_keys(mode))]


def _list_filters(travel: Travel) -> list[str]:
    """Return Overpass filters, of which the ways of a mode, or of one of several modes, match at least one."""
    several = travel.modes if isinstance(travel, ModeCombination) else (travel,)
    classes = [name for mode in several if isinstance(mode, Mode) for name in (*mode.highways, *mode.by_permission)]
    functions = [key for mode in several if not isinstance(mode, Mode) for key in list_mode_keys(mode)]
    found = dict.fromkeys(f"[{json.dumps(key)}]" for key in functions)
    for name in classes:
        key, _, value = name.partition("=") if "=" in name else ("highway", "", "*")
        text = json.dumps(key, ensure_ascii=False)
        found[f"[{text}]" if value == "*" else f"[{text}={json.dumps(value, ensure_ascii=False)}]"] = None
    return [*found]


def _make_filter(osm_type: OSMType) -> str:
    """Return the rule for reading files of this type, as an Overpass filter."""
    closed = CLOSED_TO[osm_type].items()
    return '["highway"]' + "".join(f'["{name}"!~"^({"|".join(sorted(values))})$"]' for name, values in closed)


# -- checks of queries ------------------------------------------------------------------------------------------


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


def _find_fault(polygon: "BaseGeometry") -> str:
    """Return why a shapely shape cannot be the area of a map, or ""."""
    if polygon.geom_type not in _RINGS:
        return f"it is a {polygon.geom_type}, not an area"
    west, south, east, north = polygon.bounds
    if (
        max(-west, east) <= _FARTHEST[0] < east - west
    ):  # a circle around the meridian has an outline that crosses itself
        return "it lies on both sides of the 180th meridian, where map servers end; take one side, or read a file"
    if polygon.is_empty or not polygon.is_valid:
        return "its outline is empty or crosses itself"
    if max(-west, east) > _FARTHEST[0] or max(-south, north) > _FARTHEST[1]:
        return f"its bounds {polygon.bounds} are not degrees of longitude and latitude"
    km2 = polygon.area * _KM_PER_DEGREE**2 * math.cos(math.radians((south + north) / 2.0))
    return f"it has {km2:.0f} km², more than {_MOST_KM2:.0f} km²" if km2 > _MOST_KM2 else ""


# -- formats of answers, with the required fields ---------------------------------------------------------------

_Lon = Annotated[float, Meta(ge=-180.0, le=180.0)]
_Lat = Annotated[float, Meta(ge=-90.0, le=90.0)]
_Rings = Annotated[list[Annotated[list[tuple[_Lon, _Lat]], Meta(min_length=4)]], Meta(min_length=1)]
_RINGS = {"Polygon": _Rings, "MultiPolygon": list[_Rings]}  # geometry types of areas, and their coordinates


class _TypedObject(msgspec.Struct):
    type: str
    coordinates: Json = None


class _Place(msgspec.Struct):
    importance: float
    geojson: _TypedObject | None = None


class _Element(msgspec.Struct):
    id: int
    tags: dict[str, str] = {}
    version: int = 0
    visible: bool = True

    def as_element(self) -> MapElement:
        """Return it as the element that readers take."""
        return MapElement(NODE, self.id, self.tags)


class _Node(_Element, kw_only=True):
    lon: _Lon
    lat: _Lat


class _Way(_Element, kw_only=True):
    nodes: list[int]

    def as_element(self) -> MapElement:
        return MapElement(WAY, self.id, self.tags, self.nodes)


class _Member(msgspec.Struct):
    type: str
    ref: int
    role: str


class _Relation(_Element, kw_only=True):
    members: list[_Member]

    def as_element(self) -> MapElement:
        members = [(part.type[:1], part.ref, part.role) for part in self.members]
        return MapElement(RELATION, self.id, self.tags, members=members)


_KINDS: dict[str, type[_Element]] = {"node": _Node, "way": _Way, "relation": _Relation}


def _read_places(answer: Json) -> list[_Place]:
    """Return the places in Nominatim's answer to a search."""
    if not isinstance(answer, list) or not all(isinstance(place, dict) for place in answer):
        raise ValueError("it is not a list of places")
    try:
        places = msgspec.convert(answer, list[_Place], strict=False)  # Nominatim may write numbers as text
        for place in places:
            if place.geojson is not None and place.geojson.type in _RINGS:
                msgspec.convert(place.geojson.coordinates, _RINGS[place.geojson.type])
    except msgspec.ValidationError as error:
        raise ValueError(f"a place has no importance, or a boundary that is not a polygon: {error}") from None
    return places


def read_elements(answer: Json, most_cut: float) -> list[_Element]:
    """Return the nodes, ways and relations in an Overpass answer.

    Args:
        answer: plain values.
        most_cut: the greatest share of the ways that may lack nodes.

    Raises:
        ValueError: the answer is not usable.
    """
    try:
        given = msgspec.convert(answer, dict[str, Any])
        listed = msgspec.convert(given.get("elements"), list[Any])
    except msgspec.ValidationError:
        raise ValueError("it has no list of elements") from None
    if given.get("remark"):
        raise ValueError(f"it is incomplete; the server reports {str(given['remark'])[:200]!r}")
    elements = [element for one in listed if (element := _read_element(one)) is not None]
    nodes = {element.id for element in elements if isinstance(element, _Node)}
    ways = [one for one in elements if isinstance(one, _Way) and len(one.nodes) >= LEAST_NODES]
    cut = [way.id for way in ways if not nodes.issuperset(way.nodes)]
    if len(cut) > most_cut * len(ways):
        raise ValueError(f"it lacks nodes of {len(cut)} of its {len(ways)} ways, such as {cut[0]}")
    return elements


def _read_element(one: Json) -> _Element | None:
    """Return a node, a way or a relation; None for other entries of an answer."""
    try:
        kind = _KINDS.get(msgspec.convert(one, _TypedObject).type)
        return None if kind is None else msgspec.convert(one, kind)
    except msgspec.ValidationError as error:
        raise ValueError(f"{str(one)[:100]} is not an element: {error}") from None


read_streets = partial(read_elements, most_cut=0.0)
read_areas = partial(read_elements, most_cut=_MOST_CUT)
