"""The fidelity report: how a graph differs from its source map, and whether it keeps its promises."""

import json
import math
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Union

import numpy as np

from gamms import kernels
from gamms.arguments import as_float, as_range
from gamms.errors import BadType, BadValue
from gamms.ir.geometry import are_inside, find_lines_near, find_nearest_lines, measure_distances
from gamms.ir.graph import FloatArray, GraphColumns, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.ir.projection import measure_on_ellipsoid, turn_longitudes
from gamms.osm.geojson import is_geojson
from gamms.osm.load import (
    Clip,
    ModeOfTravel,
    RoadSelection,
    make_network_in_metres,
    make_recipe,
    make_selection,
    read_network,
    select_part,
)
from gamms.osm.modes import WayFilter, as_travel, filter_of_words, find_tolerance, get_mode_name, make_paced_rule, modes
from gamms.osm.network import (
    OsmRoads,
    OSMType,
    RoadNetwork,
    Rule,
    compute_offsets,
    connect_polylines,
    cut_segments,
    find_components,
    find_segment_starts,
    find_ways_back,
    list_classic_ignored_values,
    make_classic_closed_rule,
    make_classic_rule,
    make_network_of_columns,
    make_network_of_lines,
    make_two_way,
    measure_along,
    select_roads,
)
from gamms.osm.networkx_bridge import find_waiting_columns, make_network_of_graph
from gamms.osm.objects import normalize_tags, parse_number
from gamms.osm.osmium_reader import MapFile, as_file
from gamms.osm.reader import read_ways
from gamms.osm.speeds import compute_speed_kph
from gamms.osm.topology import consolidate, count_road_ends, find_chains, simplify
from gamms.osm.turns import RestrictionCounts, count_restrictions
from gamms.progress import show_progress
from gamms.text import make_printable_line, shown
from gamms.typing import IGraphEngine

if TYPE_CHECKING:
    import networkx as nx

Cut = Union["nx.Graph[Any]", IGraphEngine, GraphColumns]
Source = Union[str, os.PathLike[str], "nx.Graph[Any]", GraphColumns, RoadNetwork]

_ROUNDING_M = 0.001
_WIDEST_DEFAULT = 10.0  # meters: the assumed tolerance of a graph that does not state its own
_SLACK = 1e-9
_JUDGED_TAGS = ("oneway", "speed_kph")
_FILTER = "filter"  # why an open way is left out; other reasons contain "="
_MOST_NAMED = 4  # tags that close ways, in the text of a report
_SHARES = (0.25, 0.5, 0.75, 1.0, 1.25, 1.5)
LEAST_PIECE = 0.75  # in resolutions
MOST_PIECE = 1.25
_MOST_UNCUT = 1.5  # in resolutions: shorter roads stay whole
_EXACT = 1e-6  # meters, and relative: rounding errors
_ON_LINE_M = 1e-3  # a point so near to a line lies on it
_SAME_SPEED = 1e-6  # relative: rounding errors of files
_PARALLEL = 1e-2  # radians between two lines that count as parallel
_STEP_M = 25.0  # largest distance between points of a straight road that are compared with the map
_WIDEST = 3.0  # width of a merged junction in tolerances, at most
_Places = np.ndarray[tuple[int], np.dtype[np.complex128]]


class Report(NamedTuple):
    """The result of `report`. Lengths are meters; a two-way road counts once."""

    source: str
    crs: str | None
    resolution: float
    nodes: int
    edges: int
    source_length: float | None  # of all ways of a file with a key of the mode, open or not; None for other sources
    length_before: float  # of the open roads in the compared parts of the source
    length_after: float  # of the graph
    other_parts: float  # of open roads missing in the graph because they are not connected with the kept part
    no_way_back: float  # … or are connected, but one-way streets do not lead there and back
    across: float  # of the added lines across squares, in all parts
    doubled: float  # of roads that are there again, for those of several modes that a barrier stops
    conditional_ignored: int  # ways with rules for certain times only, such as access:conditional
    turn_restrictions: int  # that hold for the mode of travel, on its roads
    turn_restrictions_ignored: int
    turn_restrictions_conditional: int  # of these, ones that hold at some times only
    turn_restrictions_of_others: (
        int  # … ones for other vehicles; the rest is unclear, or permits or forbids other roads
    )
    edges_without_turn: int  # of a mode that obeys turns, after which it may take no edge
    ignored_values: dict[str, int]  # tags for access, direction or speed that have no known meaning -> ways with them
    barriers: int  # where agents cannot pass, such as bollards on streets for cars
    filtered: float  # of open ways that the caller's filter refuses
    clipped: float  # of all ways outside of the caller's area
    closed: dict[str, float]  # of ways that are closed to the mode of travel, by the tag that closes them
    against_traffic: float  # of edges against the directions of the source
    one_direction: float  # of edges that are the only direction of a two-way road
    wrong_speeds: float  # of edges with another speed than the roads of the source have in their direction
    wrong_joints: int  # places where other numbers of roads meet than in the source, without a merged junction
    length_merged: float  # by which merging junctions shortens the roads of the source; negative if it lengthens them
    deviation_max: float  # of a vertex of the source from the nearest road of the graph
    deviation_mean: float  # over all vertices of the source
    surplus_max: float  # deviation of a point of the graph from the nearest road of the source
    nodes_merged: int
    dead_ends: int
    components: int
    parallel_roads: int  # beyond the first between the same two junctions
    one_way_share: float  # of the length, by the tags of streets
    roads_uncut: int  # edges that are whole roads, shorter than 1.5 times the resolution
    roads_uncut_untrue: int  # uncut roads whose length differs from the source
    pieces: int  # edges that are pieces of longer roads
    pieces_parted: int  # pieces of short roads that were cut only so that no road is lost
    piece_min: float  # of the other pieces; NaN without any
    piece_max: float
    spacing: dict[str, int]  # the number of edges for each range of shares of the resolution
    length_kept: bool  # before = after, less what merging junctions moved
    spacing_kept: bool  # pieces have 0.75 to 1.25 times the resolution, uncut roads less than 1.5 times
    uncut_kept: bool  # uncut roads have their true length
    directions_kept: bool  # edges follow the traffic, in both directions where it is two-way
    speeds_kept: bool  # edges have the speeds of the source; also if the graph does not state its mode of travel
    joints_kept: bool  # roads meet where they meet in the source
    on_map_kept: bool  # every point is on the map, or within 3 tolerances if junctions were merged
    source_kept: bool  # open and left-out ways add up to the source

    @property
    def is_faithful(self) -> bool:
        """Whether all promises are kept."""
        return all(value for name, value in self._asdict().items() if name.endswith("_kept"))

    @property
    def length_error(self) -> float:
        """The share of the source's length that is neither in the graph nor merged away; negative for a surplus."""
        missing = self.length_before - self.length_after - self.length_merged
        return missing / self.length_before if self.length_before else 0.0

    def to_dict(self) -> dict[str, Any]:
        """Return all values for JSON; numbers that are not finite become None."""
        fields = {**self._asdict(), "length_error": self.length_error, "is_faithful": self.is_faithful}
        strange = {name for name, value in fields.items() if isinstance(value, float) and not np.isfinite(value)}
        return {name: None if name in strange else value for name, value in fields.items()}

    def rows(self) -> list[tuple[str, str]]:
        """Return the report as pairs of a title and a text."""
        merged = self.length_merged / self.length_before if self.length_before else 0.0
        missing = abs(self.length_before - self.length_after - self.length_merged)
        grown = f"{0.0 - round(self.length_merged, 1):+,.1f} m ({0.0 - round(merged, 5):+.3%})"  # never "-0.0"
        yes = {True: "yes", False: "NO"}
        lacking = f"{self.one_direction:,.1f} m lack one"
        untrue = f"{self.roads_uncut_untrue:,} whole roads differ from the source"
        return [
            ("map", f"{self.source}, {self.crs or 'no CRS'}, cut every {self.resolution:g} m"),
            ("graph", f"{self.nodes:,} nodes, {self.edges:,} edges"),
            *([] if self.source_length is None else [("source", f"{self.source_length:,.1f} m of ways")]),
            ("length before", f"{self.length_before:,.1f} m"),
            ("length after", f"{self.length_after:,.1f} m"),
            ("closed by class", self._describe_closed("highway")),
            ("closed by access", self._describe_closed("")),
            ("closed as areas", self._describe_closed("area")),
            ("other parts", f"{self.other_parts:,.1f} m left out"),
            ("no way back", f"{self.no_way_back:,.1f} m left out"),
            *([("by filter", f"{self.filtered:,.1f} m left out")] if self.filtered else []),
            *([("outside of clip", f"{self.clipped:,.1f} m left out")] if self.clipped else []),
            ("across squares", f"{self.across:,.1f} m of lines that are on no map"),
            *([("at barriers", f"{self.doubled:,.1f} m twice, because some modes stop there")] if self.doubled else []),
            *([("not understood", _describe_counts(self.ignored_values))] if self.ignored_values else []),
            ("barriers", f"{self.barriers:,} end roads"),
            (
                "ignored",
                f"{self.turn_restrictions_ignored:,} turn restrictions, {self.conditional_ignored:,} conditional",
            ),
            ("turns", self._describe_turns()),
            ("no legal turn", f"after {self.edges_without_turn:,} edges"),
            ("by merging", f"{grown}, {self.nodes_merged:,} nodes"),
            ("deviation", f"{self.deviation_max:.2f} m at most, {self.deviation_mean:.4f} m on average"),
            ("off the map", f"{self.surplus_max:.2f} m at most"),
            ("components", f"{self.components:,}"),
            ("dead ends", f"{self.dead_ends:,}"),
            ("parallel roads", f"{self.parallel_roads:,}"),
            ("one-way", f"{self.one_way_share:.1%} of the length"),
            ("whole roads", f"{self.roads_uncut:,}"),
            ("pieces", f"{self.pieces:,}, {self.piece_min:.2f} to {self.piece_max:.2f} m"),
            ("cut to lose none", f"{self.pieces_parted:,} of them"),
            *((f"edges of {name}", f"{count:,}") for name, count in self.spacing.items()),
            ("length kept", f"{yes[self.length_kept]}: {missing:,.1f} m off, less what merging moved"),
            ("spacing kept", f"{yes[self.spacing_kept]}: pieces 0.75 to 1.25, whole roads below 1.5 resolutions"),
            ("true lengths", f"{yes[self.uncut_kept]}: {untrue}"),
            ("directions", f"{yes[self.directions_kept]}: {self.against_traffic:,.1f} m against, {lacking}"),
            ("speeds", f"{yes[self.speeds_kept]}: {self.wrong_speeds:,.1f} m differ from the source"),
            ("joints", f"{yes[self.joints_kept]}: {self.wrong_joints:,} differ from the source"),
            ("on the map", f"{yes[self.on_map_kept]}: {self.surplus_max:.2f} m off at most"),
            ("source accounted", f"{yes[self.source_kept]}: open, closed and left out are all of it"),
        ]

    def _describe_turns(self) -> str:
        """Return how many turn restrictions hold, and why others do not."""
        conditional = self.turn_restrictions_conditional
        of_others = self.turn_restrictions_of_others
        rest = self.turn_restrictions_ignored - conditional - of_others
        ignored = f"{conditional:,} conditional, {of_others:,} of others, {rest:,} unclear or for roads left out"
        return f"{self.turn_restrictions:,} restrictions hold; ignored are {ignored}"

    def _describe_closed(self, key: str) -> str:
        """Return which ways are closed by `highway`, by `area`, or for an empty key by other tags."""
        of_key = {why: metres for why, metres in self.closed.items() if _group(why) == key}
        parts = [f"{why} {metres:,.1f} m" for why, metres in of_key.items()]
        more = f", {len(parts) - _MOST_NAMED} more" if len(parts) > _MOST_NAMED else ""
        total = f"{sum(of_key.values()):,.1f} m left out"
        return f"{total}: {', '.join(parts[:_MOST_NAMED])}{more}" if parts else total

    def __str__(self) -> str:
        rows = self.rows()
        width = max(len(title) for title, _ in rows)
        return "\n".join(f"{title:<{width}}  {text}" for title, text in rows)


def _describe_counts(counts: Mapping[str, int]) -> str:
    """Return the first tags, with the number of ways of each."""
    parts = [f"{tag} on {count:,} ways" for tag, count in counts.items()]
    more = f", {len(parts) - _MOST_NAMED} more" if len(parts) > _MOST_NAMED else ""
    return make_printable_line(", ".join(parts[:_MOST_NAMED])) + more


def report(
    graph: Cut,
    source: Source,
    *,
    resolution: float | None = None,
    tolerance: float | None = None,
    retain_all: bool | None = None,
    osm_type: ModeOfTravel | Sequence[ModeOfTravel] | None = None,
    filter: WayFilter | None = None,
    clip: "Clip | None" = None,
) -> Report:
    """Compare a graph with the map that it was made from.

    Args:
        graph: a graph made by `gamms.osm`, or a context's graph to which it was attached.
        source: the map file, or the uncut network: any graph that `process_osm_graph` takes, or columns.
        resolution: the requested resolution; needed if the graph does not state it.
        tolerance: the requested tolerance for merging junctions; default: as stated by the graph. If neither is given,
            the graph may have merged none, or with the default of any mode of travel.
        retain_all: compare all parts of a file, or only the largest; default: as stated by the graph.
        osm_type: the mode of travel, or the list of modes, whose roads in a file are compared; default: as stated by
            the graph.
        filter: the filter of ways, as for `graph_from_file`; default: as stated by the graph, unless it was a function.
        clip: the area; default: as stated by the graph.

    Raises:
        BadValue: the resolution is unknown, or the CRS differ.
        BadType: graph or source has a wrong type.
        FileNotFoundError, BadFile, MissingExtra: see `graph_from_file`.
    """
    edges, about = _make_edges(graph)
    edges = connect_polylines(edges)
    length = as_float(resolution if resolution is not None else about.get("resolution", np.nan), "resolution")
    if not length > 0.0:
        raise BadValue("The graph does not state its resolution. Give it: report(…, resolution=10.0).")
    if tolerance is not None:
        about["tolerance"] = as_range(tolerance, "tolerance")
    everything = bool(about.get("retain_all", False)) if retain_all is None else retain_all
    selection = select_part(
        _make_selection(about, everything, osm_type),
        filter_of_words(about.get("filter", "")) if filter is None else filter,
        json.loads(about.get("clip") or "null") if clip is None else clip,
    )
    before = _make_source_network(source, selection)
    about = {**about, **_count_ways(source, selection)}
    if None not in (before.crs, edges.crs) and before.crs != edges.crs:
        raise BadValue(f"The source is in {before.crs} and the graph in {edges.crs}: they cannot be compared.")
    is_file = isinstance(source, (str, os.PathLike))
    about["has_speeds"] = not is_file or osm_type is not None or "mode" in about
    name = Path(source).name if isinstance(source, (str, os.PathLike)) else type(source).__name__
    return _compare_networks(edges, before, {**about, "resolution": length, "source": name})


def _compare_networks(edges: RoadNetwork, source: RoadNetwork, about: dict[str, Any]) -> Report:
    resolution = about["resolution"]
    roads = _join_directions(edges)
    one_way = np.fromiter((bool(roads.tags[way].get("oneway")) for way in roads.ways), np.bool_, len(roads.ways))
    is_cut, is_parted = _find_pieces(roads, source, resolution)
    away = measure_deviations(source, roads)
    uncut = np.flatnonzero(~is_cut)
    regular = roads.lengths[is_cut & ~is_parted] / resolution
    untrue = _count_untrue_lengths(roads, uncut, source)
    before = float(source.lengths.sum())
    after = float(roads.lengths.sum())
    merged = min(_merge_junctions(source, about), key=lambda one: abs(before - after - one.merged.length_m))
    against, alone = _measure_wrong_directions(edges, source, merged, about)
    speeds = _measure_wrong_speeds(edges, source, merged) if about["has_speeds"] else 0.0
    joints = _count_wrong_joints(roads, source, about.get("tolerance", _WIDEST_DEFAULT))
    if "tolerance" in about:
        joints = max(joints, _count_wrong_joints(roads, merged, 0.0))
    off_map = _measure_surplus(roads, source)
    signs = about.get("turn_signs", RestrictionCounts(held=source.turn_restrictions))
    least = LEAST_PIECE - _SLACK
    most = MOST_PIECE + _SLACK
    in_bounds = ((regular >= least) & (regular <= most)).all()
    return Report(
        source=about["source"],
        crs=edges.crs,
        resolution=resolution,
        nodes=len(edges.xy),
        edges=len(edges.sources),
        length_before=before,
        length_after=after,
        other_parts=source.left_out.other_parts_m,
        no_way_back=source.left_out.no_way_back_m,
        source_length=about.get("source_length"),
        across=source.left_out.across_m,
        doubled=source.left_out.doubled_m,
        conditional_ignored=about.get("conditional", 0),
        turn_restrictions=source.turn_restrictions,
        turn_restrictions_ignored=sum(signs) - source.turn_restrictions,
        turn_restrictions_conditional=signs.conditional,
        turn_restrictions_of_others=signs.others,
        edges_without_turn=_count_edges_without_turn(edges),
        ignored_values=about.get("ignored_values", {}),
        barriers=source.left_out.barriers,
        filtered=about.get("filtered", 0.0),
        clipped=about.get("clipped", 0.0),
        closed=about.get("closed", {}),
        against_traffic=against,
        one_direction=alone,
        wrong_speeds=speeds,
        wrong_joints=joints,
        length_merged=merged.merged.length_m,
        deviation_max=float(away.max(initial=0.0)),
        deviation_mean=float(away.mean()) if len(away) else 0.0,
        surplus_max=off_map,
        nodes_merged=merged.merged.nodes,
        dead_ends=int((count_road_ends(roads) == 1).sum()),
        components=len(np.unique(find_components(roads.sources, roads.targets, len(roads.xy)))),
        parallel_roads=_count_parallel_roads(roads),
        one_way_share=float(roads.lengths[one_way].sum() / after) if after else 0.0,
        roads_uncut=len(uncut),
        roads_uncut_untrue=untrue,
        pieces=int(is_cut.sum()),
        pieces_parted=int(is_parted.sum()),
        piece_min=float(regular.min() * resolution) if len(regular) else np.nan,
        piece_max=float(regular.max() * resolution) if len(regular) else np.nan,
        spacing=_make_histogram(edges.lengths / resolution),
        length_kept=_are_equal(before - merged.merged.length_m, after),
        spacing_kept=bool(in_bounds and (roads.lengths[uncut] < _MOST_UNCUT * resolution + _SLACK).all()),
        uncut_kept=untrue == 0,
        directions_kept=not against + alone,
        speeds_kept=not speeds,
        joints_kept=joints == 0,
        on_map_kept=off_map <= _WIDEST * about.get("tolerance", _WIDEST_DEFAULT) + _ROUNDING_M,
        source_kept=_is_accounted(source, about),
    )


def _make_edges(graph: Cut) -> tuple[RoadNetwork, dict[str, Any]]:
    several = str(getattr(graph, "graph", {}).get("mode", "")) if hasattr(graph, "is_directed") else ""
    names = (*_JUDGED_TAGS, *(several.split(",") if "," in several else ()))
    waiting = find_waiting_columns(graph, names)
    if waiting is not None:
        return make_network_of_columns(waiting[0]), dict(waiting[1])
    get = getattr(graph, "columns", None)
    columns = get() if callable(get) else graph
    if isinstance(columns, GraphColumns):
        return make_network_of_columns(columns), {}
    if isinstance(graph, GraphColumns | IGraphEngine) or not hasattr(graph, "is_directed"):
        raise BadType(f"graph must be a networkx graph, ctx.graph or its columns, not {shown(graph)}.")
    is_drawn = all("linestring" in data and "length" in data for _, _, data in graph.edges(data=True))
    if not is_drawn:
        return make_network_in_metres(graph), dict(graph.graph)
    return replace(make_network_of_graph(graph, names), crs=graph.graph.get("crs")), dict(graph.graph)


def _make_selection(
    about: dict[str, Any], retain_all: bool, osm_type: ModeOfTravel | Sequence[ModeOfTravel] | None
) -> RoadSelection:
    """Return the selection of roads that are compared with a graph; `about` is the graph's description."""
    name = about.get("mode", "")
    classic = about.get("osm_type", "")
    strong = bool(about.get("strong", osm_type is not None)) and not retain_all
    recipe = make_recipe(1.0, 0.0, None, retain_all)._replace(
        bidirectional=about.get("bidirectional"),
        mode=name,
        strong=strong,
        around_buildings=bool(about.get("around_buildings", True)),
    )
    if osm_type is not None:
        travel = as_travel(osm_type)
        return make_selection(recipe._replace(mode=get_mode_name(travel)), travel)
    names = name.split(",") if name else []
    if custom := next((one for one in names if one not in modes()), None):
        raise BadValue(f"The graph was made for the custom mode {custom!r}. Give it again: report(…, osm_type=…).")
    if names:
        return make_selection(recipe, as_travel(names[0] if len(names) == 1 else names))
    kind = OSMType[classic] if classic else None
    every_way = bool(about.get("every_way", False))
    closed = None if every_way else make_classic_closed_rule(kind)
    rule = make_classic_rule(kind, every_way=every_way)
    if kind is not None:
        rule = _add_speeds(kind, rule)
    return RoadSelection(
        *(rule, "", retain_all, strong and not recipe.bidirectional, closed),
        around_buildings=recipe.around_buildings,
        ignored=list_classic_ignored_values,
    )


def _add_speeds(kind: OSMType, rule: Rule) -> Rule:
    """Return the rule with the speeds of graphs of a place."""
    paced = make_paced_rule(modes()[kind.name.lower()], kind)
    return lambda osmid, tags: None if rule(osmid, tags) is None else paced(osmid, tags)


def _make_source_network(source: Source, selection: RoadSelection) -> RoadNetwork:
    if isinstance(source, RoadNetwork):
        return source
    if isinstance(source, GraphColumns):
        return make_network_of_columns(source)
    if not isinstance(source, (str, os.PathLike)):
        return make_network_in_metres(source)
    with show_progress() as show:
        file = as_file(source)
        return read_network(file, show, selection, is_geojson=is_geojson(file))


def _count_ways(source: Source, selection: RoadSelection) -> dict[str, Any]:
    """Count all ways of a file with a key of the mode, open or not, and features of theirs that a graph ignores.

    Each way counts once. A closed way, or the rim of a closed area, counts as open if it is the rim of an open area.

    Returns:
        source_length, clipped, filtered, closed (closing tag -> meters, largest first), conditional,
        turn_signs, ignored_values.
    """
    if not isinstance(source, (str, os.PathLike)) or is_geojson(Path(source)):
        return {}

    parts = selection.of_modes or (selection,)

    def rule(osmid: int, tags: Mapping[str, str]) -> tuple[dict[str, Any], bool]:
        closed = None if selection.closed is None else selection.closed(osmid, tags)
        conditional = any(name.endswith(":conditional") for name in normalize_tags(tags))
        ignored = [tag for one in parts if one.ignored is not None for tag in one.ignored(tags)]
        is_taken = closed is not None or any(one.rule is None or one.rule(osmid, tags) is not None for one in parts)
        why = "" if is_taken else _FILTER
        if closed is not None:
            why = closed[0]["why"]
        return {"osmid": osmid, "why": why, "oneway": False, "conditional": conditional, "ignored": ignored}, False

    with show_progress() as show:
        map_file = MapFile(as_file(source))
        ways = read_ways(map_file, show, rule, areas=selection.areas, keys=selection.keys)
        is_open = set[tuple[int, int, int]]()
        for one in parts:
            open_ways = read_ways(map_file, show, one.rule, areas=one.areas, keys=one.keys)
            is_open |= {*_list_pieces(open_ways)}
        signs = max(count_restrictions(ways.signs, one.vehicles) for one in parts)
    pieces = cut_segments(ways)
    metres = measure_on_ellipsoid(pieces.lonlat[pieces.sources], pieces.lonlat[pieces.targets])
    known = np.ones(len(pieces.lonlat), np.bool_)
    if selection.clip is not None:
        known = are_inside(selection.clip, turn_longitudes(pieces.lonlat, 0.0))
    inside = known[pieces.sources] & known[pieces.targets]
    of_ways = np.bincount(pieces.ways, weights=metres * inside, minlength=len(ways.tags)).tolist()
    found: dict[str, float] = {}
    ignored = Counter[str]()
    for piece, tags, length in zip(_list_pieces(ways), ways.tags, of_ways, strict=True):
        if length > 0.0:
            ignored.update(set(tags["ignored"]))
        if length > 0.0 and tags["why"] and piece not in is_open:
            found[tags["why"]] = found.get(tags["why"], 0.0) + length
    return {
        "source_length": float(metres.sum()),
        "clipped": float(metres[~inside].sum()),
        "filtered": found.pop(_FILTER, 0.0),
        "closed": dict(sorted(found.items(), key=lambda item: (-item[1], item[0]))),
        "conditional": sum(
            tags["conditional"] and length > 0.0 for tags, length in zip(ways.tags, of_ways, strict=True)
        ),
        "turn_signs": signs,
        "ignored_values": dict(sorted(ignored.items(), key=lambda item: (-item[1], item[0]))),
    }


def _list_pieces(ways: OsmRoads) -> list[tuple[int, int, int]]:
    """Return the id of each way, and its first two nodes, which only one of the pieces of a way has."""
    first = ways.offsets[:-1]
    return [*zip(ways.ids, ways.refs[first].tolist(), ways.refs[first + 1].tolist(), strict=True)]


def _is_accounted(source: RoadNetwork, about: Mapping[str, Any]) -> bool:
    """Return whether open and left-out ways add up to the counted length of the source."""
    total = about.get("source_length")
    left_out = source.left_out
    if total is None:
        return True
    known = source.lengths.sum() + sum(about["closed"].values()) + left_out.other_parts_m + left_out.no_way_back_m
    known += about["filtered"] + about["clipped"]
    return _are_equal(known - left_out.across_m - left_out.doubled_m, total)


def _are_equal(length: float, other: float) -> bool:
    """Return whether two lengths are equal up to rounding."""
    return bool(abs(length - other) <= _ROUNDING_M + _SLACK * other)


def _merge_junctions(source: RoadNetwork, about: Mapping[str, Any]) -> list[RoadNetwork]:
    """Return the source with merged junctions, for the graph's tolerance or each possible default."""
    if not len(source.sources):
        return [source]
    roads = simplify(source) if about.get("simplify", True) else source
    defaults = {0.0, *map(find_tolerance, (None, *modes().values()))}
    tolerances = {about["tolerance"]} if "tolerance" in about else defaults
    return [consolidate(roads, tolerance) for tolerance in sorted(tolerances)]


def _measure_wrong_directions(
    edges: RoadNetwork, source: RoadNetwork, merged: RoadNetwork, about: Mapping[str, Any]
) -> tuple[float, float]:
    """Return the result of `_find_wrong_directions` for a graph that may allow or forbid going against the traffic."""
    may = [about["bidirectional"]] if "bidirectional" in about else [True, False]
    networks = [[make_two_way(one) if both else one for one in (source, merged)] for both in may]
    return min((_find_wrong_directions(edges, *some) for some in networks), key=sum)


def _group(why: str) -> str:
    """Return the group of a closing tag: `highway`, `area`, or "" for others."""
    key = why.partition("=")[0]
    return key if key in ("highway", "area") else ""


def _count_edges_without_turn(edges: RoadNetwork) -> int:
    """Return the number of edges after which a mode that obeys turn restrictions may take no edge."""
    found = 0
    for mode, paths in edges.turns.items():
        speeds = np.array([parse_number(of_edge.get(mode, 1.0)) for of_edge in edges.tags], np.float64)[edges.ways]
        rows = [tuple(road >> 1 for road in path) for path in paths]
        lone = kernels.find_edges_without_turn(edges.sources, edges.targets, edges.lengths, speeds > 0.0, rows)
        found += len(lone)
    return found


def _count_parallel_roads(roads: RoadNetwork) -> int:
    ends = np.sort(find_chains(roads).ends, axis=1)
    ends = ends[ends[:, 0] != ends[:, 1]]
    return len(ends) - len(np.unique(ends, axis=0))


def _make_histogram(shares: FloatArray) -> dict[str, int]:
    starts = ("0", *(f"{share:g}" for share in _SHARES))
    names = [*(f"{low}-{high}" for low, high in pairwise(starts)), f"{starts[-1]} and more"]
    counts = np.bincount(np.searchsorted(_SHARES, shares, side="right"), minlength=len(names))
    return dict(zip(names, counts.tolist(), strict=True))


# -- measures between a graph and its source ---------------------------------------------------------------------


def _join_directions(edges: RoadNetwork) -> RoadNetwork:
    """Join the edges of both directions between two nodes into one road if their lengths are exactly equal."""
    low = np.minimum(edges.sources, edges.targets)
    high = np.maximum(edges.sources, edges.targets)
    order = np.lexsort((edges.lengths, high, low))
    keys = np.column_stack((low, high, edges.lengths))[order]
    new = np.ones(len(order), np.bool_)
    new[1:] = (keys[1:] != keys[:-1]).any(axis=1)
    group = np.cumsum(new) - 1
    there = np.bincount(group, weights=(edges.sources <= edges.targets)[order], minlength=int(new.sum()))
    back = np.bincount(group, minlength=int(new.sum())) - there
    copies = np.maximum(there, back).astype(np.int64)
    rows = np.repeat(order[new], copies)
    return select_roads(edges, rows)


def _find_pieces(roads: RoadNetwork, source: RoadNetwork, resolution: float) -> tuple[BoolArray, BoolArray]:
    """Recognize cut roads: at a cut two pieces of exactly equal length meet where the source has no vertex.

    Returns:
        Two masks (roads,): pieces of longer roads; and among them pieces of short roads that were cut only so that no
        road is lost.
    """
    nodes = np.concatenate((roads.sources, roads.targets))
    lengths = np.tile(roads.lengths, 2)
    longest = np.full(len(roads.xy), -np.inf)
    shortest = np.full(len(roads.xy), np.inf)
    np.maximum.at(longest, nodes, lengths)
    np.minimum.at(shortest, nodes, lengths)
    chains = find_chains(roads, (longest == shortest) & ~np.isin(_make_complex(roads.xy), _make_complex(source.points)))
    number = np.bincount(chains.of_road, minlength=len(chains.lengths))
    short_pair = (number == 2) & (chains.lengths < _MOST_UNCUT * resolution)
    small_loop = (number == 3) & (chains.ends[:, 0] == chains.ends[:, 1]) & (chains.lengths < 2.5 * resolution)
    parted = (short_pair | small_loop)[chains.of_road]
    return (number > 1)[chains.of_road], parted


def measure_deviations(source: RoadNetwork, roads: RoadNetwork) -> FloatArray:
    """Return the exact distance of every vertex of the source from the nearest of these roads, meters."""
    used = np.unique(np.concatenate((source.sources, source.targets)))
    vertices = np.unique(_make_complex(np.concatenate((source.xy[used], source.points))))
    away = np.flatnonzero(~np.isin(vertices, _make_complex(roads.points)))
    result = np.zeros(len(vertices))
    if not len(away) or not len(roads.points):
        result[away] = np.inf
        return result
    start = find_segment_starts(roads.offsets)
    places = np.column_stack((vertices[away].real, vertices[away].imag))
    _, result[away] = find_nearest_lines(places, roads.points[start], roads.points[start + 1])
    return result


def _count_untrue_lengths(roads: RoadNetwork, rows: IntArray, source: RoadNetwork) -> int:
    """Return the number of these uncut roads whose length differs from the pieces of the source that they follow.

    Roads without a counterpart in the source, because they lead to a merged junction, are not compared.
    """
    chosen = select_roads(roads, rows)
    ours, _, line = _list_segments(chosen)
    theirs, source_share, source_line = _list_segments(source)
    places, numbers = np.unique(np.concatenate((ours, theirs)), return_inverse=True)
    pairs = numbers.reshape(-1, 2) @ (len(places), 1)  # one number per pair of points
    wanted = pairs[: len(ours)]
    keys, firsts = np.unique(pairs[len(ours) :], return_index=True)
    if not len(keys) or not len(ours):
        return 0
    at = kernels.find_rows(keys, wanted)
    there = at >= 0
    true = (source.lengths[source_line] * source_share)[firsts][at]
    expected = np.bincount(line, weights=np.where(there, true, 0.0), minlength=len(rows))
    judged = np.bincount(line, weights=~there, minlength=len(rows)) == 0
    wrong = np.abs(chosen.lengths - expected) > _EXACT * (1.0 + expected)
    return int((judged & wrong).sum())


def _measure_surplus(roads: RoadNetwork, source: RoadNetwork) -> float:
    """Return the largest distance of the roads from the map: at vertices, middles of straight pieces, and every 25 m.

    A piece whose two ends lie on one straight piece of the source runs along it, because the distance is a convex
    function. Only other pieces are examined at more points.
    """
    mine = find_segment_starts(roads.offsets)
    theirs = find_segment_starts(source.offsets)
    if not len(mine) or not len(theirs):
        return math.inf if len(mine) else 0.0
    here = roads.points[mine]
    there = roads.points[mine + 1]
    start = source.points[theirs]
    end = source.points[theirs + 1]
    near, _ = find_nearest_lines((here + there) / 2.0, start, end)
    off = np.maximum(*(measure_distances(places, start[near], end[near]) for places in (here, there)))
    astray = off > _EXACT
    places = _sample_lines(here[astray], there[astray])
    closely = find_nearest_lines(places, start, end)[1].max() if len(places) else 0.0
    return max(float(closely), float(off[~astray].max(initial=0.0)))


def _sample_lines(here: FloatArray, there: FloatArray) -> FloatArray:
    """Return points on straight lines (lines, 2): their ends, their middle, and at least one every 25 m."""
    parts = np.maximum(np.ceil(np.hypot(*(there - here).T) / _STEP_M), 2.0).astype(np.int64)
    line = np.repeat(np.arange(len(parts)), parts + 1)
    share = (np.arange(len(line)) - compute_offsets(parts + 1)[line]) / parts[line]
    return np.asarray(here[line] + (there - here)[line] * share[:, None])


def _find_wrong_directions(edges: RoadNetwork, source: RoadNetwork, merged: RoadNetwork) -> tuple[float, float]:
    """Return the meters of edges against the traffic, and of edges that are the only direction of a two-way road.

    An edge is compared with the roads under the middle of its longest straight piece: roads of the source or, if
    merging has moved it, of the source with merged junctions.
    """
    alone = _find_roads_without_way_back(edges)
    judged = np.flatnonzero(alone | ~source.two_way.all())
    if not len(judged) or not len(source.sources):
        return 0.0, 0.0
    chosen = select_roads(edges, judged)
    counts = _count_directions_below(chosen, source)
    moved = np.flatnonzero(counts[0] == 0)
    if len(moved):
        counts[:, moved] = _count_directions_below(select_roads(chosen, moved), merged)
    found, allowed, both = counts
    lengths = edges.lengths[judged]
    against = (found > 0) & (allowed == 0)
    only = (found > 0) & (both == found) & alone[judged]
    return float(lengths[against].sum()), float(lengths[only].sum())


def _find_roads_without_way_back(edges: RoadNetwork) -> BoolArray:
    """Return a mask of edges without an edge of the same length in the other direction."""
    count = len(edges.sources)
    ends = np.stack((edges.sources, edges.targets))
    sources, targets = np.concatenate((ends, ends[::-1]), axis=1)
    lengths = np.tile(edges.lengths, 2)
    order = np.lexsort((lengths, targets, sources))
    rows = np.column_stack((sources, targets, lengths))[order]
    group = np.empty(2 * count, np.int64)
    group[order] = np.cumsum(np.append(False, (np.diff(rows, axis=0) != 0.0).any(axis=1)))[: 2 * count]
    is_there = np.bincount(group[:count], minlength=2 * count) > 0
    return np.asarray(~is_there[group[count:]])


def _count_directions_below(edges: RoadNetwork, source: RoadNetwork) -> IntArray:
    """Return (3, edges): the number of source roads under each edge, those in its direction, and two-way ones."""
    below = _find_roads_below(edges, source)
    is_two_way = source.two_way[below.roads]
    kinds = (np.ones(len(below.edges), np.bool_), is_two_way | below.are_along, is_two_way)
    return np.stack([np.bincount(below.edges[rows], minlength=len(edges.sources)) for rows in kinds])


def _measure_wrong_speeds(edges: RoadNetwork, source: RoadNetwork, merged: RoadNetwork) -> float:
    """Return the meters of edges that have another speed than each source road under them, in their direction.

    The speeds of several modes are compared one by one. Edges are compared as in `_find_wrong_directions`; an edge that
    states no speed is not compared.
    """
    is_wrong = np.zeros(len(edges.lengths), np.bool_)
    for name in ("speed_kph", *source.modes):
        stated = np.array([parse_number(of_edge.get(name)) for of_edge in edges.tags], np.float64)[edges.ways]
        judged = np.flatnonzero(~np.isnan(stated))
        if not len(judged) or not len(source.sources):
            continue
        chosen = select_roads(edges, judged)
        counts = _count_speeds_below(chosen, stated[judged], source, name)
        moved = np.flatnonzero(counts[0] == 0)
        if len(moved):
            counts[:, moved] = _count_speeds_below(select_roads(chosen, moved), stated[judged[moved]], merged, name)
        found, equal = counts
        is_wrong[judged] |= (found > 0) & (equal == 0)
    return float(edges.lengths[is_wrong].sum())


def _count_speeds_below(edges: RoadNetwork, speeds: FloatArray, source: RoadNetwork, name: str) -> IntArray:
    """Return (2, edges): the number of source roads under each edge, and those that have its speed (edges,).

    Args:
        edges: the edges.
        speeds: (edges,) as the edges state them.
        source: the roads.
        name: the attribute with the speed, `speed_kph` or a mode of travel.
    """
    below = _find_roads_below(edges, source)
    of_ways = [
        compute_speed_kph(of_way) if name == "speed_kph" else parse_number(of_way.get(name)) for of_way in source.tags
    ]
    of_tags = np.array(of_ways, np.float64)
    rows = np.where(below.are_along, source.ways[below.roads], find_ways_back(source)[below.roads])
    are_equal = np.isclose(of_tags[rows], speeds[below.edges], rtol=_SAME_SPEED, atol=0.0)
    counts = [np.bincount(found, minlength=len(edges.sources)) for found in (below.edges, below.edges[are_equal])]
    return np.stack(counts)


class _RoadsBelow(NamedTuple):
    """The pairs of an edge and a source road that runs under the middle of its longest straight piece."""

    edges: IntArray  # (pairs,)
    roads: IntArray  # (pairs,)
    are_along: BoolArray  # (pairs,)  whether the road has the direction of the edge, not the opposite one


def _find_roads_below(edges: RoadNetwork, source: RoadNetwork) -> _RoadsBelow:
    mine = find_segment_starts(edges.offsets)
    theirs = find_segment_starts(source.offsets)
    size = np.hypot(*(edges.points[mine + 1] - edges.points[mine]).T)
    line = _find_lines_of_pieces(edges)
    order = np.lexsort((size, line))
    mine = mine[order[np.append(np.diff(line[order]) > 0, True)]]  # the longest piece of each edge
    step = edges.points[mine + 1] - edges.points[mine]
    steps = source.points[theirs + 1] - source.points[theirs]
    middles = edges.points[mine] + step / 2.0
    edge, piece = find_lines_near(middles, source.points[theirs], source.points[theirs + 1], _ON_LINE_M)
    onward = (step[edge] * steps[piece]).sum(axis=1)
    aside = step[edge][:, 0] * steps[piece][:, 1] - step[edge][:, 1] * steps[piece][:, 0]
    alike = np.abs(aside) <= _PARALLEL * np.abs(onward)
    return _RoadsBelow(edge[alike], _find_lines_of_pieces(source)[piece[alike]], onward[alike] > 0.0)


def _count_wrong_joints(roads: RoadNetwork, source: RoadNetwork, tolerance: float) -> int:
    """Return the number of places where the numbers of roads that meet or end differ from the source.

    Places that may be a merged junction, or were merged into one, are not counted.
    """
    source = consolidate(source, 0.0)
    ours = _find_joints(roads.xy, count_road_ends(roads))
    theirs = _find_joints(source.xy, count_road_ends(source))
    two_way = source.two_way
    ends = (
        np.concatenate((source.sources, source.targets[two_way])),
        np.concatenate((source.targets, source.sources[two_way])),
    )
    lengths = np.concatenate((source.lengths, source.lengths[two_way]))
    pairs = _join_directions(
        make_network_of_lines(source.xy, ends, {}, lengths, [], None)
    )  # one-way roads of both directions count once
    once = _find_joints(source.xy, count_road_ends(pairs))
    new = np.array([place for place, met in ours.items() if met not in (theirs.get(place), once.get(place))], complex)
    gone = np.array([place for place in theirs.keys() & once.keys() if place not in ours], complex)
    if tolerance > 0.0 and len(gone):
        reach = _WIDEST * tolerance + _EXACT
        new = new[_count_near(new, gone, reach) == 0]  # every node of a merged junction is gone
        gone = gone[_count_near(gone, gone, reach) < 2]
    return len(new) + len(gone)


def _find_joints(xy: FloatArray, degree: IntArray) -> dict[complex, list[int]]:
    """Return place -> numbers of roads that meet at its nodes, without nodes that merely continue a road."""
    found: dict[complex, list[int]] = {}
    rows = np.flatnonzero((degree != 0) & (degree != 2))
    for place, met in sorted(
        zip(_make_complex(xy[rows]).tolist(), degree[rows].tolist(), strict=True), key=lambda one: one[1]
    ):
        found.setdefault(place, []).append(met)
    return found


def _count_near(places: _Places, others: _Places, reach: float) -> IntArray:
    """Return the number of others within reach of each place."""
    here, there = (np.column_stack((some.real, some.imag)) for some in (places, others))
    rows, _ = find_lines_near(here, there, there, reach)
    return np.bincount(rows, minlength=len(places))


def _find_lines_of_pieces(network: RoadNetwork) -> IntArray:
    """Return the road of each straight piece."""
    return np.repeat(np.arange(len(network.sources)), np.diff(network.offsets) - 1)


def _list_segments(network: RoadNetwork) -> tuple[_Places, FloatArray, IntArray]:
    """Return the ends (segments, 2) of every straight piece, sorted, its share of its road, and the road."""
    start = find_segment_starts(network.offsets)
    line = _find_lines_of_pieces(network)
    position = measure_along(network.offsets, network.points)
    total = position[network.offsets[1:] - 1][line]
    share = (position[start + 1] - position[start]) / np.where(total > 0.0, total, 1.0)
    places = _make_complex(network.points)
    return np.sort(np.column_stack((places[start], places[start + 1])), axis=1), share, line


def _make_complex(xy: FloatArray) -> _Places:
    return np.ascontiguousarray(xy).view(np.complex128)[:, 0]
