"""The functions of `gamms.osm` that make graphs of maps, step by step from the file to the networkx graph."""

import json
import logging
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias, TypedDict, Unpack

import numpy as np

from gamms.arguments import (
    as_bool,
    as_context,
    as_positive,
    as_range,
    explain_call_errors,
    find_signature,
    refuse_context,
    refuse_keywords,
    spell_out_options,
)
from gamms.errors import BadFile, BadValue
from gamms.ir.geometry import make_area
from gamms.ir.graph import GraphColumns
from gamms.ir.projection import check_metres, parse_crs, scale_fault
from gamms.osm import topology
from gamms.osm.areas import add_ways_across, measure_across
from gamms.osm.elevation import Elevation, ElevationPath, add_heights, as_elevation
from gamms.osm.geojson import read_lines
from gamms.osm.mode_union import ModeRoads, choose_modes, open_both_ways, unite
from gamms.osm.modes import (
    Mode,
    ModeCombination,
    ModeFunction,
    Travel,
    WayFilter,
    as_travel,
    filter_in_words,
    filter_rule,
    find_stops,
    find_tolerance,
    find_vehicles,
    get_mode_name,
    honour_traffic,
    keep_more_tags,
    list_mode_keys,
    make_closed_rule,
    make_rule,
)
from gamms.osm.network import (
    ROADS,
    OsmRoads,
    OSMType,
    RoadNetwork,
    Rule,
    Stops,
    add_stated_times,
    add_turns,
    connect_polylines,
    cut_segments,
    describe_read_ways,
    find_components,
    join_directions,
    list_classic_ignored_values,
    make_classic_closed_rule,
    make_classic_rule,
    make_network_of_columns,
    make_network_of_part,
    make_network_of_segments,
    make_two_way,
    measure_along,
    project_network,
    project_to_metres,
    project_to_true_metres,
    split_directions,
)
from gamms.osm.networkx_bridge import make_network_of_graph, to_columns, to_digraph, to_multidigraph
from gamms.osm.objects import as_tags
from gamms.osm.osmium_reader import MapFile, as_file
from gamms.osm.reader import read_ways
from gamms.osm.topology import resample
from gamms.osm.turns import parse_restrictions
from gamms.progress import Show, show_progress
from gamms.typing import IContext
from gamms.typing.map_storage import IPackedGraph, packed_graphs

if TYPE_CHECKING:
    import networkx as nx
    from shapely import MultiPolygon, Polygon

    from gamms.osm.footprints import BuildingIndex

FilePath = str | os.PathLike[str]
_WIDEST_JUNCTION_M = 1000.0
_SLOW_BYTES = 32 << 20
_FILE = Path(__file__).parent.parent / "data" / "helsinki.gamms"
_MODES_FILE = _FILE.with_name("helsinki_modes.gamms")
_MODES_OF_HELSINKI = ("walk", "bike", "drive")


NetworkTags: TypeAlias = Mapping[str, str | bool | Sequence[str] | Mapping[str, float]]
"""The tags of a network that is no road: key -> a value, a list of values, True for any, or values with their km/h."""

ModeOfTravel: TypeAlias = OSMType | str | ModeFunction | NetworkTags
"""An `OSMType`, the name of a mode of travel, a `Mode`, a function from the tags of a way to its `Access`, or a network
that is no road, such as `{"railway": ["rail", "tram"]}`."""


class GraphRecipe(NamedTuple):
    """The options by which a graph was made of a map; stored in `G.graph`, for reports."""

    resolution: float
    tolerance: float
    bidirectional: bool | None
    retain_all: bool
    simplify: bool
    osm_type: str = ""  # "WALK", "BIKE", "DRIVE" or the name of another mode
    mode: str = ""  # the mode whose rules chose the roads, or modes with commas; empty for the rules of 1.0.0
    strong: bool = False
    around_buildings: bool = False  # whether merged junctions and lines across squares avoid buildings
    clip: str = ""  # the area in degrees, as GeoJSON
    filter: str = ""  # as JSON, or the name of a function
    every_way: bool = False  # also planned, unfinished and removed roads, as gamms 1.0.0 takes them from files


class RoadSelection(NamedTuple):
    """The roads of a map to read."""

    rule: Rule | None = None  # which ways are open, and in which direction; None: all roads
    mode: str = ""  # its name, for errors
    retain_all: bool = False
    strong: bool = False
    closed: Rule | None = None  # which ways are left out
    areas: bool = False  # add lines across open areas
    tags: tuple[str, ...] = ()  # further tags to keep
    stops: Stops | None = None  # which barriers end a road
    vehicles: tuple[str, ...] = ()  # the names of the mode in turn restrictions; empty: none hold for it
    is_classic: bool = False  # nodes have only the attributes of gamms 1.0.0
    clip: "Polygon | MultiPolygon | None" = None  # the area in degrees to read
    snap: float = 0.0  # meters, for GeoJSON
    around_buildings: bool = False
    ignored: Callable[[Mapping[str, str]], list[str]] | None = None  # the tags of a way that its rule cannot read
    keys: tuple[str, ...] = ROADS  # a way needs a tag with one of these keys
    both_ways: bool = False  # whether several modes may go against one-way traffic
    of_modes: "tuple[RoadSelection, ...]" = ()  # the selections of several modes, which replace `rule`


Clip: TypeAlias = "Sequence[float] | Sequence[Sequence[float]] | Mapping[str, Any] | Polygon | MultiPolygon"
"""An area in degrees: (west, south, east, north), or a polygon of pairs, of GeoJSON or of shapely.

A box across 180 degrees has west > east, as in GeoJSON; a polygon across it is given as its two parts.
"""


class MapOptions(TypedDict, total=False):
    """Further options of functions that make graphs of maps."""

    tags: Sequence[str]
    """Tags that edges keep besides the usual ones, and nodes, too: a node of the map with one of these tags is a
    node of the graph; ().
    """
    elevation: "ElevationPath | Elevation | None"
    """A .hgt file of SRTM, or a folder of them: nodes get their height `z` in meters, edges their `grade`, and walking
    uphill takes longer; None.
    """
    around_buildings: bool
    """Whether merged junctions and lines across squares avoid buildings: True for files; False for areas, whose
    buildings would have to be downloaded.
    """


class FileOptions(MapOptions, total=False):
    """Further options of `graph_from_file`."""

    filter: "WayFilter | None"
    """A filter of the open ways: a function from the tags of a way to a bool; or a dict from tags to the required
    value, a list of such values, or True for any value; None: all.
    """
    clip: "Clip | None"
    """The area to read: (west, south, east, north) in degrees, with west > east across 180 degrees, or a polygon in
    degrees, as (longitude, latitude) pairs, of shapely or of GeoJSON; None: all. Roads end at their last node in it.
    Only the area takes memory.
    """


for_a_graph = refuse_context("ctx.graph.attach_networkx_graph(gamms.osm.{name}(…))")


@for_a_graph
def graph_from_xml(
    filepath: FilePath,
    resolution: float = 10.0,
    bidirectional: bool = True,
    retain_all: bool = False,
    tolerance: float = 1e-9,
) -> "nx.DiGraph[int]":
    """Make a graph of all ways with a `highway` tag in an OpenStreetMap file, with a node at every vertex of the file.

    `graph_from_file` reads the same files, spaces the nodes of winding roads evenly, supports modes of travel, and
    leaves out planned, unfinished and removed roads, raceways, services and rest areas.

    Args:
        filepath: the map file (.osm, .xml, .osm.gz, .osm.bz2, .osm.pbf).
        resolution: meters between nodes; a road of length L becomes round(L / resolution) equal pieces,
            and a road shorter than 1.5 times the resolution stays whole.
        bidirectional: let agents go against one-way streets; False keeps the directions.
        retain_all: keep every part of the map, not only the largest connected one.
        tolerance: meters; junctions joined by a road of at most twice this length become one node.

    Returns:
        A directed graph in UTM meters, its CRS in `G.graph["crs"]`. Nodes are 0, 1, … with `x` and `y`;
        edges have `id`, `linestring`, `length` (true meters, on the ellipsoid), `speed_kph`, `travel_time` and
        the tags of their street.

    Raises:
        FileNotFoundError, IsADirectoryError: the file does not exist.
        BadFile: the file is damaged, not OpenStreetMap data, or has no roads.
        BadValue, BadType: an argument is impossible.
        MissingExtra: osmium is not installed.
    """
    recipe = make_recipe(resolution, tolerance, bidirectional, retain_all)._replace(every_way=True)
    return _make_graph(filepath, recipe, make_selection(recipe, None))


@for_a_graph
@spell_out_options(tags=(), elevation=None, around_buildings=True, filter=None, clip=None)
def graph_from_file(
    filepath: FilePath,
    resolution: float = 10.0,
    bidirectional: bool | None = None,
    retain_all: bool = False,
    tolerance: float | None = None,
    osm_type: "ModeOfTravel | Sequence[ModeOfTravel] | None" = None,
    simplify: bool = True,
    strong: bool | None = None,
    **more: Unpack[FileOptions],
) -> "nx.DiGraph[int]":
    """Make a graph of the roads in an OpenStreetMap file for one mode of travel, or for all.

    Args:
        filepath: the map file (.osm, .xml, .osm.gz, .osm.bz2, .osm.pbf).
        resolution: meters between nodes, as for `graph_from_xml`; roads are cut from junction to junction.
        bidirectional: True: agents may go against one-way streets; False: they may not; None: as the mode says, and
            without a mode they may.
        retain_all: keep every part of the map, not only the largest connected one.
        tolerance: meters; junctions joined by a road of at most twice this length become one node.
            0 merges only vertices at equal positions; None: as the mode says, and 0.5 without one.
        osm_type: a mode of travel: an `OSMType`, one of the names in `gamms.osm.modes()`, a `Mode`, or a function from
            the tags of a way to its `Access`. It decides the open roads, their directions and the travel times. None
            takes all roads, with the speed of cars. A dict of tags, such as `{"railway": ["rail", "tram"]}`, is a
            network that is no road: all ways with one of the tags. A list of modes makes one graph for all of them:
            each edge has for each mode an attribute with its name, the speed in km/h, 0.0 where the mode may not go.
        simplify: cut roads from junction to junction; False makes a node at every vertex of the file.
        strong: keep the largest part in which every node can be reached from every other; default: only with a mode.
        more: see `FileOptions`.

    Returns:
        A graph as from `graph_from_xml`. Nodes that exist on the map also have their id as `osmid` and, at crossings
        and traffic signals, `highway`.

    Raises: as `graph_from_xml`.
    """
    refuse_keywords(more, find_signature(graph_from_file).parameters, "graph_from_file")
    tags = as_tags(more.get("tags", ()))
    mode = None if osm_type is None else as_travel(osm_type, tags)
    tolerance = find_tolerance(mode) if tolerance is None else tolerance
    recipe = make_recipe(resolution, tolerance, bidirectional, retain_all, simplify)
    recipe = adapt_recipe(recipe, mode, bidirectional, strong)
    recipe = recipe._replace(around_buildings=as_bool(more.get("around_buildings", True), "around_buildings"))
    selection = select_part(make_selection(recipe, mode, tags), more.get("filter"), more.get("clip"))
    area = "" if selection.clip is None else json.dumps(selection.clip.__geo_interface__)
    recipe = recipe._replace(clip=area, filter=filter_in_words(more.get("filter")))
    return _make_graph(filepath, recipe, selection, as_ground(more.get("elevation"), mode))


def select_part(selection: RoadSelection, given: "WayFilter | None", clip: object) -> RoadSelection:
    """Return the selection restricted by the caller's filter and area.

    Raises:
        BadType, BadValue: the filter or the area is impossible.
    """
    area = None if clip is None else make_area(clip, "clip")
    of_modes = tuple(one._replace(rule=filter_rule(one.rule, given), clip=area) for one in selection.of_modes)
    return selection._replace(rule=filter_rule(selection.rule, given), clip=area, of_modes=of_modes)


def adapt_recipe(
    recipe: GraphRecipe, mode: Travel | None, bidirectional: bool | None, strong: bool | None
) -> GraphRecipe:
    """Return the recipe for a mode of travel: its directions, and only strongly connected roads."""
    if mode is not None:
        both = None if bidirectional is None else recipe.bidirectional
        recipe = recipe._replace(bidirectional=both, osm_type=get_mode_name(mode).upper(), mode=get_mode_name(mode))
    strong = mode is not None if strong is None else as_bool(strong, "strong")
    return recipe._replace(strong=strong and not recipe.retain_all)


def make_selection(recipe: GraphRecipe, mode: Travel | None, tags: tuple[str, ...] = ()) -> RoadSelection:
    """Return the selection of roads for a recipe; `mode` may be None if the recipe names none."""
    if isinstance(mode, ModeCombination):
        of_modes = [make_selection(recipe._replace(mode=get_mode_name(one)), one, tags) for one in mode.modes]
        return of_modes[0]._replace(
            mode=recipe.mode,
            both_ways=bool(recipe.bidirectional),
            closed=_make_closing_rule(of_modes),
            keys=tuple(dict.fromkeys(key for one in of_modes for key in one.keys)),
            of_modes=(*of_modes,),
        )
    strong = recipe.strong and not recipe.bidirectional
    if mode is None:
        closed = None if recipe.every_way else make_classic_closed_rule(None)
        rule = make_classic_rule(None, every_way=recipe.every_way)
        chosen = RoadSelection(
            keep_more_tags(rule, tags), "", recipe.retain_all, strong, closed, is_classic=recipe.every_way
        )
        chosen = chosen._replace(ignored=list_classic_ignored_values)
    else:
        mode = honour_traffic(mode) if recipe.bidirectional is False else mode
        rule = keep_more_tags(make_rule(mode), tags)
        stops = find_stops(mode)
        chosen = RoadSelection(
            rule, recipe.mode, recipe.retain_all, strong, make_closed_rule(mode), areas=True, stops=stops
        )
        chosen = chosen._replace(vehicles=find_vehicles(mode), keys=list_mode_keys(mode))
        chosen = chosen._replace(ignored=mode.ignored_values if isinstance(mode, Mode) else None)
    return chosen._replace(tags=tags, around_buildings=recipe.around_buildings)


def _make_closing_rule(selections: Sequence[RoadSelection]) -> Rule:
    """Return the rule for the ways that are closed to each mode, with the tag that closes them to the first."""

    def closed(osmid: int, tags: Mapping[str, str]) -> tuple[dict[str, Any], bool] | None:
        found = [None if one.closed is None else one.closed(osmid, tags) for one in selections]
        asked = (row for row, one in enumerate(selections) if any(key in tags for key in one.keys))
        return None if None in found else found[next(asked, 0)]

    return closed


@for_a_graph
def graph_from_geojson(
    filepath: FilePath,
    resolution: float = 10.0,
    bidirectional: bool = True,
    retain_all: bool = False,
    tolerance: float = 0.0,
    simplify: bool = True,
    elevation: "ElevationPath | Elevation | None" = None,
    snap: float = 0.0,
) -> "nx.DiGraph[int]":
    """Make a graph of the lines in a GeoJSON file; they join at equal coordinates.

    LineString and MultiLineString are roads, whatever their properties, which become the tags of the edges;
    `oneway`, `maxspeed` and `highway` have their meanings of OpenStreetMap. Other geometries are ignored.
    No optional library is needed.

    Args:
        filepath: the map file.
        resolution: see `graph_from_file`.
        bidirectional: see `graph_from_file`.
        retain_all: keep every part of the map; otherwise log the parts left out, with their share of the length.
        tolerance: see `graph_from_file`.
        simplify: see `graph_from_file`.
        elevation: see `FileOptions`.
        snap: meters; the end of a line joins the nearest other line within this distance. Crossing lines stay apart.

    Returns: as `graph_from_file`.

    Raises:
        FileNotFoundError, IsADirectoryError: the file does not exist.
        BadFile: the file is damaged, not GeoJSON, too large, not in degrees, or has no lines.
        BadValue, BadType: an argument is impossible, or the lines are too far apart or north for one projection.
    """
    recipe = make_recipe(resolution, tolerance, bidirectional, retain_all, simplify)
    if (metres := as_range(snap, "snap")) > _WIDEST_JUNCTION_M:
        raise BadValue(f"snap must be at most {_WIDEST_JUNCTION_M:g} meters, not {metres}.")
    selection = make_selection(recipe, None)._replace(snap=metres)
    return _make_graph(filepath, recipe, selection, as_ground(elevation, None), is_geojson=True)


def process_osm_graph(
    osmg: "nx.Graph[Any]", resolution: float = 10.0, bidirectional: bool | None = None
) -> "nx.DiGraph[int]":
    """Cut the edges of a networkx graph, such as OSMnx makes, like `graph_from_xml`.

    Nodes need `x` and `y`; edges may have a `geometry` and a `length` in meters. A graph in degrees, or in a CRS whose
    meters are off by more than one per cent there, such as Web Mercator, is projected to UTM; any other is taken as
    meters, unchanged. A graph without a CRS must be in meters, and one that looks like degrees is refused. Both
    directions of a street share their nodes.

    Args:
        osmg: the graph.
        resolution: meters between nodes.
        bidirectional: True: agents may go against one-way streets; False: they may not; None: they may, as in gamms
            1.0.0, with a warning once per process if there are one-way streets.

    Raises:
        BadType: it is not a networkx graph.
        BadValue: a node lacks a position, or the CRS, a length or the resolution is impossible.
        MissingExtra: the graph has a CRS that is not a UTM zone and pyproj is not installed.
    """
    recipe = make_recipe(resolution, 0.0, bidirectional)
    with show_progress() as show:
        show("Reading the graph")
        network = make_network_in_metres(osmg)
        if bidirectional is None and not network.two_way.all():
            _warn_of_opened_streets()
        return cut(network, recipe, show)


@cache  # once per process
def _warn_of_opened_streets() -> None:
    logging.getLogger("gamms").warning(
        "process_osm_graph lets agents go both ways on the one-way streets of this graph, which is its default. Give "
        "bidirectional=False to keep their directions, or bidirectional=True if this is meant."
    )


def consolidate(osmg: "nx.Graph[Any]", tolerance: float) -> "nx.MultiDiGraph[int]":
    """Merge the nodes of a networkx graph that form one junction; `process_osm_graph` can cut the result.

    Junctions, where at least three roads end, become one node if a road of at most twice the tolerance joins them and
    the node would not be wider than three tolerances. Near junctions without such a road stay apart.

    Args:
        osmg: see `process_osm_graph`.
        tolerance: meters.

    Raises: as `process_osm_graph`.
    """
    tolerance = _check_tolerance(tolerance)
    with show_progress() as show:
        show("Joining roads")
        network = topology.consolidate(make_network_in_metres(osmg), tolerance)
        return to_multidigraph(network)


def resample_columns(columns: GraphColumns, resolution: float = 10.0, bidirectional: bool = True) -> "nx.DiGraph[int]":
    """Cut a map that was saved uncut, such as the shipped one, like `graph_from_xml`.

    No optional library is needed. Each edge is one road, one-way if its attribute `oneway` is true. As in
    `process_osm_graph`, a map whose meters are not true is projected.

    Raises:
        BadType, BadValue: the resolution is impossible, or an edge has an impossible direction, speed or time.
    """
    recipe = make_recipe(resolution, 0.0, bidirectional)
    with show_progress() as show:
        network = make_network_of_columns(columns)
        if scale_fault(columns.crs, columns.xy):
            network = connect_polylines(project_to_true_metres(network, parse_crs(columns.crs)[0]))
        network = join_directions(network) if network.turns else network
        return cut(network, recipe, show)


class ElevationSource(NamedTuple):
    """The source of heights for roads."""

    elevation: Elevation
    are_walked: tuple[bool, ...]  # whether slopes affect travel times, for each mode


def as_ground(elevation: "ElevationPath | Elevation | None", mode: Travel | None) -> ElevationSource | None:
    """Return the source of heights for a mode of travel; None without heights.

    Raises:
        FileNotFoundError, BadFile, BadType: the heights do not exist or are not valid.
    """
    heights = as_elevation(elevation)
    modes = mode.modes if isinstance(mode, ModeCombination) else (mode,)
    walked = [isinstance(one, Mode) and one.slope == "walked" for one in modes]
    return None if heights is None else ElevationSource(heights, tuple(walked))


def _make_graph(
    filepath: FilePath,
    recipe: GraphRecipe,
    selection: RoadSelection,
    ground: ElevationSource | None = None,
    *,
    is_geojson: bool = False,
) -> "nx.DiGraph[int]":
    file = as_file(filepath)
    # osmium reports nothing while it reads its first nodes; if that takes a second, show the progress before.
    with show_progress(0.0 if file.stat().st_size > _SLOW_BYTES else 1.0) as show:
        network = read_network(file, show, selection, is_geojson=is_geojson)
        show(f"Joining {len(network.sources)} roads")
        network = topology.simplify(network) if recipe.simplify else network
        return cut(topology.consolidate(network, recipe.tolerance), recipe, show, ground)


def cut(
    network: RoadNetwork, recipe: GraphRecipe, show: Show, ground: ElevationSource | None = None
) -> "nx.DiGraph[int]":
    """Cut joined roads as the recipe says, and make the graph."""
    show(f"Cutting {len(network.sources)} roads")
    pieces = resample(make_two_way(network) if recipe.bidirectional else network, recipe.resolution)
    pieces = replace(pieces, buildings=None)  # they take memory
    if pieces.refs is not None:
        pieces = replace(pieces, tunnels=topology.number_tunnels(pieces))
    if ground is not None:
        pieces = add_heights(pieces, ground.elevation, are_walked=ground.are_walked)
    show(f"Making a graph of {len(pieces.sources)} pieces")
    return to_digraph(pieces, _make_entries(recipe, network))


def _make_entries(recipe: GraphRecipe, network: RoadNetwork) -> dict[str, Any]:
    """Return the entries of `G.graph`: the recipe, and the lengths of merged and omitted roads."""
    merged = {"merged_nodes": network.merged.nodes, "merged_length": network.merged.length_m}
    return {**recipe._asdict(), **merged, **network.left_out._asdict(), "turn_restrictions": network.turn_restrictions}


def make_network_in_metres(osmg: "nx.Graph[Any]") -> RoadNetwork:
    """Return the roads of a networkx graph, projected to true meters if necessary; both directions become one road."""
    network = make_network_of_graph(osmg)
    crs = osmg.graph.get("crs")
    if crs is None:
        drawn = measure_along(network.offsets, network.points)[network.offsets[1:] - 1]
        check_metres(network.xy, drawn, "The graph has no CRS (osmg.graph['crs'])")
    name, in_degrees = (None, False) if crs is None else parse_crs(crs)
    if name is not None and not in_degrees:
        network = project_to_true_metres(network, name)
    elif name is not None and len(network.xy) and (np.abs(network.xy) <= (180.0, 90.0)).all():
        network = project_network(network, name)  # otherwise the CRS is out of date: these cannot be degrees
    network = connect_polylines(network)
    return join_directions(network) if osmg.is_directed() else make_two_way(network)


def make_recipe(
    resolution: float,
    tolerance: float,
    bidirectional: bool | None,
    retain_all: bool = True,
    simplify: bool = False,
    osm_type: OSMType | None = None,
) -> GraphRecipe:
    """Check the options for making a graph; vehicles obey one-way streets by default.

    Raises:
        BadType, BadValue: a resolution or tolerance is impossible.
    """
    metres = as_positive(resolution, "resolution", hint=" meters. The default is 10.")
    both = osm_type in (None, OSMType.WALK) if bidirectional is None else as_bool(bidirectional, "bidirectional")
    retain_all = as_bool(retain_all, "retain_all")
    simplify = as_bool(simplify, "simplify")
    name = "" if osm_type is None else osm_type.name
    return GraphRecipe(metres, _check_tolerance(tolerance), both, retain_all, simplify, name)


def _check_tolerance(tolerance: float) -> float:
    number = as_range(tolerance, "tolerance")
    if number > _WIDEST_JUNCTION_M:
        raise BadValue(
            f"tolerance must be finite and at most {_WIDEST_JUNCTION_M:g} meters, not {number}: "
            "no junction is that wide."
        )
    return number


def read_network(file: Path, show: Show, selection: RoadSelection, *, is_geojson: bool) -> RoadNetwork:
    """Read the roads of a file of OpenStreetMap or GeoJSON, one per pair of consecutive vertices, in UTM meters.

    Raises:
        BadFile: the file is not usable, or has no roads of this selection.
        MissingExtra: osmium is not installed.
    """
    if selection.of_modes:
        return _read_modes(file, show, selection)
    if is_geojson:
        ways = read_lines(file, show, snap=selection.snap)
    else:
        ways = _read_with_squares(MapFile(file), show, selection)
    segments = cut_segments(ways)
    if not len(segments.sources):
        raise BadFile(f"{str(file)!r} {_explain_no_roads(ways, selection)}")
    show(f"Projecting {len(segments.lonlat)} nodes")
    if selection.retain_all:
        network = make_network_of_segments(add_turns(segments, ways), ways.tags)
    else:
        network = make_network_of_part(segments, ways, strong=selection.strong)
    if not len(network.sources):
        raise BadFile(f"{str(file)!r} {_explain_no_way_back('')}")
    if ways.nodes is None and network.left_out.other_parts_m:
        lost = network.left_out.other_parts_m / (network.left_out.other_parts_m + float(network.lengths.sum()))
        parts = len(np.unique(find_components(segments.sources, segments.targets, len(segments.lonlat))))
        logging.getLogger("gamms").warning(
            f"{file.name} has {len(ways.tags)} lines in {parts} parts; {lost:.1%} of their length is not joined to the "
            "largest one and left out. snap= joins ends that are near, retain_all=True keeps all parts."
        )
    left_out = network.left_out._replace(barriers=len(ways.barriers), across_m=measure_across(ways))
    network = replace(network, left_out=left_out, buildings=ways.buildings)
    if selection.is_classic or ways.nodes is None:
        return replace(network, attribution=ways.attribution, refs=None)
    return replace(network, attribution=ways.attribution, nodes=ways.nodes)


def _read_with_squares(
    source: MapFile, show: Show, selection: RoadSelection, buildings: "BuildingIndex | None" = None
) -> OsmRoads:
    """Read the ways of a map, and add the lines across squares; `buildings` are those of the map, if known."""
    ways = read_ways(
        *(source, show, selection.rule, selection.tags),
        areas=selection.areas,
        stops=selection.stops,
        clip=selection.clip,
        around_buildings=selection.around_buildings,
        keys=selection.keys,
    )
    if selection.vehicles:
        ways = replace(ways, restrictions=parse_restrictions(ways.signs, {selection.mode: selection.vehicles}))
    ways = add_stated_times(ways)
    return add_ways_across(ways if buildings is None else replace(ways, buildings=buildings))


def _read_modes(file: Path, show: Show, selection: RoadSelection) -> RoadNetwork:
    """Read the roads of a file for several modes; a mode may use only its own largest part, so that none has islands.

    Raises: as `read_network`.
    """
    source = MapFile(file)
    parts = list[ModeRoads]()
    for one in selection.of_modes:
        ways = _read_with_squares(source, show, one, parts[0].ways.buildings if parts else None)
        segments = cut_segments(ways)
        if not len(segments.sources):
            raise BadFile(f"{str(file)!r} {_explain_no_roads(ways, one)}")
        parts.append(ModeRoads(one.mode, ways, segments))
    if selection.retain_all:
        parts = [part._replace(segments=add_turns(part.segments, part.ways)) for part in parts]
        return project_to_metres(unite(parts, both_ways=selection.both_ways).network)
    kept = [part.are_in_largest(strong=selection.strong) for part in parts]
    with_turns = [
        part._replace(segments=add_turns(part.segments, part.ways, of_mode))
        for part, of_mode in zip(parts, kept, strict=True)
    ]
    roads = unite(with_turns, both_ways=selection.both_ways)
    for part, of_mode in zip(parts, kept, strict=True):
        if not of_mode.any():
            raise BadFile(f"{str(file)!r} {_explain_no_way_back(part.name)}")
    return project_to_metres(roads.keep(kept))


def _explain_no_way_back(mode: str) -> str:
    """Return the rest of the error for a file whose one-way streets lead nowhere and back."""
    whose = f" for the mode {mode!r}" if mode else ""
    return (
        f"has no two places with a route in both directions{whose}, because its streets are one-way. "
        "Load them with strong=False, or allow travel against the traffic with bidirectional=True."
    )


def _explain_no_roads(ways: OsmRoads, selection: RoadSelection) -> str:
    """Return the rest of the error for a file without roads."""
    whose = f" for the mode {selection.mode!r}" if selection.mode else ""
    only = f"{describe_read_ways(selection.keys)}; osm_type={{'railway': ['rail']}} reads other networks, "
    only += "and graph_from_geojson lines of any kind."
    if selection.clip is not None:
        west, south, east, north = selection.clip.bounds
        where = f"between longitudes {west:g} and {east:g} and latitudes {south:g} and {north:g}"
        return f"has no roads{whose} in the area of clip, {where}. {only}"
    if ways.tags or ways.without_nodes:
        return "has roads without their nodes. Export it with all nodes (in Overpass: (._;>;); out;)."
    return f"has no roads{whose}. {only} Export the area with its roads."


@explain_call_errors
def helsinki(
    ctx: IContext,
    resolution: float = 10.0,
    bidirectional: bool | None = None,
    buildings: bool | None = None,
    osm_type: OSMType | str | Sequence[OSMType | str] | None = None,
) -> "nx.DiGraph[int]":
    """Put the streets of central Helsinki into the empty graph of a context, and return them as a networkx graph.

    Args:
        ctx: the context.
        resolution: meters between nodes.
        bidirectional: let agents go against one-way streets; None: as the modes say, and without modes they may.
        buildings: add the walls of buildings to the obstacles; None: only draw them, so that they block no sight line;
            False: leave them out, as well as parks, water and rails, which are drawn otherwise.
        osm_type: "walk", "bike" or "drive", or a list of these for one graph for several, as for `graph_from_file`;
            None: all streets and paths.

    Raises:
        BadType: `ctx` is not a context, or `osm_type` is no mode of travel.
        BadValue: the context has a graph or obstacles already, the resolution is impossible, or the map does not have
            the mode or the directions.
    """
    graph = as_context(ctx, "helsinki").graph.graph
    if [*graph.get_nodes(), *ctx.graph.get_obstacle_faces()]:
        raise BadValue("The context already has a graph or obstacles. Load the map into a new context.")
    recipe = make_recipe(resolution, 0.0, bidirectional)
    travel = None if osm_type is None else as_travel(osm_type)
    if travel is not None:
        _check_modes_of_helsinki(travel, bidirectional)
        both_ways = recipe.bidirectional if bidirectional else None
        recipe = recipe._replace(
            bidirectional=both_ways, osm_type=get_mode_name(travel).upper(), mode=get_mode_name(travel)
        )
    is_list = isinstance(travel, ModeCombination)
    pieces, columns = _cut_helsinki(
        recipe.resolution, recipe.mode, is_list=is_list, bidirectional=bool(recipe.bidirectional)
    )
    streets = to_digraph(pieces, _make_entries(recipe, pieces), columns)
    ctx.graph.attach_networkx_graph(streets)
    if buildings:
        walls = _pack_helsinki(_FILE).obstacle_columns()
        ctx.graph.add_obstacles(walls.corners, walls.ids, walls.types)
    if buildings is not False:
        graph.scenery = "helsinki"
    return streets


def _check_modes_of_helsinki(travel: Travel, bidirectional: bool | None) -> None:
    names = get_mode_name(travel).split(",")
    if other := next((name for name in names if name not in _MODES_OF_HELSINKI), None):
        raise BadValue(
            f"The map of Helsinki has the modes {', '.join(_MODES_OF_HELSINKI)}, not {other!r}. "
            "Give a file to graph_from_file for other modes."
        )
    if bidirectional is False and "walk" in names:
        raise BadValue(
            "The map of Helsinki has no walkers who obey the one-way streets of cars. "
            "Leave bidirectional out: bicycles and cars obey them."
        )


@cache
def _pack_helsinki(file: Path) -> IPackedGraph:
    return packed_graphs["gamms"](file.read_bytes())


@lru_cache(maxsize=4)
def _cut_helsinki(
    resolution: float, mode: str, *, is_list: bool, bidirectional: bool
) -> tuple[RoadNetwork, GraphColumns]:
    """Return the shipped streets, cut; cached, because contexts copy them."""
    network = _load_helsinki(mode.split(","), is_list=is_list, both_ways=bidirectional) if mode else None
    if network is None:
        network = make_network_of_columns(_pack_helsinki(_FILE).columns())
        network = make_two_way(network) if bidirectional else network
    pieces = resample(network, resolution)
    return pieces, to_columns(pieces)


def _load_helsinki(names: Sequence[str], *, is_list: bool, both_ways: bool) -> RoadNetwork:
    """Return the shipped streets for modes of travel; the edges of a mode that is no list have `speed_kph` alone."""
    stored = make_network_of_columns(_pack_helsinki(_MODES_FILE).columns())
    tags, back = split_directions(stored.tags)
    back_ways = None if back is None else back[stored.ways]
    network = replace(stored, tags=tags, back_ways=back_ways, modes=_MODES_OF_HELSINKI)
    network = choose_modes(open_both_ways(network) if both_ways else network, names)
    if not is_list:
        plain = [{name: value for name, value in of_way.items() if name not in names} for of_way in network.tags]
        network = replace(network, tags=plain, modes=())
    return topology.simplify(network)
