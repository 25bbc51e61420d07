"""Convert road networks from and to networkx graphs, with the speed on each road."""

import math
from collections.abc import Collection, Mapping
from copy import deepcopy
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from gamms import kernels
from gamms.errors import BadType, BadValue
from gamms.ir.geometry import make_line_strings, read_polylines
from gamms.ir.graph import (
    FORBIDDEN_TURNS,
    CodedValues,
    FloatArray,
    GraphColumns,
    IntArray,
    Polylines,
    name_mode_time,
)
from gamms.ir.obstacles import BoolArray
from gamms.ir.projection import format_crs
from gamms.limits import GarbagePause, refuse_above
from gamms.osm.network import RoadNetwork, is_upright, make_network_of_lines
from gamms.osm.objects import DIRECTIONS, is_missing, parse_number, parse_truth, read_edge_values
from gamms.osm.speeds import CARS, compute_speed_kph, has_special_signs, sign_in_force
from gamms.osm.turns import read_turns_of_edges, renumber
from gamms.text import shown
from gamms.typing.map_storage import IGraphSource

if TYPE_CHECKING:
    import networkx as nx


def compute_travel_times(
    network: RoadNetwork, ways: IntArray, speeds: FloatArray, name: str = "travel_time"
) -> FloatArray:
    """Return seconds (roads,) along each road; NaN where there is no speed.

    A way with a time of its own keeps it; its pieces share it in proportion to their lengths.

    Args:
        network: the roads.
        ways: (roads,) the rows of their tags in one direction.
        speeds: (ways,) km/h; NaN: none.
        name: the attribute with the times of ways.
    """
    needed = network.lengths / (speeds[ways] / 3.6)
    times = [parse_number(of_way.get(name)) for of_way in network.tags] or [math.nan]
    given = np.array([time if 0.0 <= time < math.inf else math.nan for time in times])[ways]
    whole = np.bincount(ways, weights=network.lengths, minlength=len(network.tags))[ways]
    share = np.where(whole > 0.0, network.lengths / np.where(whole > 0.0, whole, 1.0), 1.0)
    return np.where(np.isnan(given), needed, given * share)


def compute_grades(z: FloatArray, ends: IntArray, lengths: FloatArray) -> FloatArray:
    """Return the rise of each edge from its first to its second end, as a share of its length."""
    rise = z[ends[:, 1]] - z[ends[:, 0]]
    return np.divide(rise, lengths, out=np.zeros(len(lengths)), where=lengths > 0.0)


def compute_walking_factor(grade: FloatArray) -> FloatArray:
    """Return the factor by which walking takes longer on a slope than on level ground.

    By the hiking function of Tobler ("Three presentations on geographical analysis and modeling", 1993): the speed is
    proportional to exp(-3.5 |grade + 0.05|), the greatest on a gentle way down.
    """
    steep = np.clip(grade, -_STEEPEST, _STEEPEST)
    return np.exp(3.5 * (np.abs(steep + 0.05) - 0.05))


# Names that a waiting graph answers from its columns.
_COUNTS = frozenset(("__len__", "number_of_edges", "number_of_nodes", "order", "size"))
_OF_COLUMNS = _COUNTS | {"__class__", "as_columns", "is_directed", "is_multigraph", "name"}
_FILLED_NODE_BYTES = 700
_FILLED_EDGE_BYTES = 1_300
_SIMPLE = frozenset((str, int, float, bool, type(None)))  # types of values that need no copy
_TEXTS = frozenset((str, type(None)))
_TIMES = name_mode_time("")  # the beginning of the names of travel times of modes
_STEEPEST = 1.0  # steeper grades are errors of the data
# Names of attributes that are not tags.
_RESERVED = frozenset(("id", "linestring", "geometry", "length", FORBIDDEN_TURNS))
_OWN = _RESERVED | {"reversed"}  # not tags: we write or replace them


def to_digraph(
    network: RoadNetwork, about: Mapping[str, Any] | None = None, columns: GraphColumns | None = None
) -> "nx.DiGraph[int]":
    """Return one node per node and one edge per direction of each road, numbered in first-seen order.

    Nodes have `x` and `y`, and the tags in `network.nodes`; edges have `id`, `linestring`, `length`, their tags,
    `speed_kph` and `travel_time`. The edge in the other direction has the next id. Of several roads from one node to
    another the last is kept.

    The graph is filled when its nodes or edges are first read: most graphs are only attached to a context, which takes
    the columns and is ten times as fast. Its size, its text and `G.graph` are known before.

    Args:
        network: the roads.
        about: further entries for `G.graph`.
        columns: the result of `to_columns` for the network, if known.
    """
    return _get_deferred_class()(network, about or {}, columns)  # type: ignore[no-any-return] # a class that is made in a function


class _WaitingRoads:
    """The contents of a graph that is not filled yet.

    Attributes:
        network: the roads.
        about: the entries of `G.graph`, which a program may change.
    """

    def __init__(self, network: RoadNetwork, about: Mapping[str, Any], columns: GraphColumns | None) -> None:
        self.network = network
        self.about = {**_make_credits(network.crs, network.attribution), **about}
        self._columns = columns

    def columns(self) -> GraphColumns:
        """Return the roads as columns, without the entries of `G.graph`."""
        if self._columns is None:
            self._columns = to_columns(self.network)
        return self._columns

    def to_attach(self) -> tuple[GraphColumns, str | None]:
        """Return the columns and the attribution that `attach_networkx_graph` would make of the filled graph."""
        crs = self.about.get("crs")
        attribution = self.about.get("attribution")
        columns = self.columns()
        if crs != columns.crs:
            columns = replace(columns, crs=None if crs is None else format_crs(crs))
        return columns, None if attribution is None else str(attribution)


def _find_waiting_roads(graph: object) -> _WaitingRoads | None:
    """Return the contents of a graph that is not filled yet; None for an ordinary graph."""
    roads: _WaitingRoads | None = object.__getattribute__(graph, "__dict__").get("waiting")
    return roads


def _make_columns(graph: "nx.DiGraph[int]") -> tuple[GraphColumns, str | None]:
    """Return the columns that `attach_networkx_graph` would make of the filled graph."""
    roads = _find_waiting_roads(graph)
    if roads is None:
        raise AttributeError("The graph is filled: attach it as it is.")
    return roads.to_attach()


def _count_nodes(graph: "nx.DiGraph[int]") -> int:
    """Return the number of nodes."""
    roads = _find_waiting_roads(graph)
    return graph.number_of_nodes() if roads is None else len(roads.network.xy)


def _count_edges(graph: "nx.DiGraph[int]", u: int | None = None, v: int | None = None) -> int:
    """Return the number of edges, or of the edges from one node to another."""
    roads = _find_waiting_roads(graph)
    if roads is not None and u is None:
        return len(roads.columns().edge_ids)
    _become_ordinary(graph)
    return int(graph.number_of_edges(u, v))


def _add_weights(graph: "nx.DiGraph[int]", weight: str | None = None) -> float:
    """Return the number of edges, or the sum of their weights."""
    if weight is None:
        return _count_edges(graph)
    _become_ordinary(graph)
    return graph.size(weight)


@cache
def _get_deferred_class() -> Any:
    """Return the class of graphs that are filled on first access; networkx is slow to load."""
    import networkx as nx

    class LazyRoadGraph(nx.DiGraph):  # type: ignore[type-arg] # it cannot be subscripted when it runs
        """A graph of roads that becomes an ordinary DiGraph when its nodes or edges are read.

        Its numbers of nodes and edges, `G.graph` and its text leave it as it is.
        """

        def __init__(self, network: Any = None, about: Any = None, columns: Any = None, **others: Any) -> None:
            if isinstance(network, RoadNetwork):
                object.__getattribute__(self, "__dict__")["waiting"] = _WaitingRoads(network, about, columns)
            else:  # networkx makes an empty graph of another graph's class
                object.__setattr__(self, "__class__", nx.DiGraph)
                nx.DiGraph.__init__(self, network, **others)

        def __getattribute__(self, name: str) -> Any:
            roads = _find_waiting_roads(self)
            if name == "graph" and roads is not None:
                return roads.about
            if name in _OF_COLUMNS:
                return object.__getattribute__(self, name)
            _become_ordinary(self)
            return getattr(self, name)

        def __setattr__(self, name: str, value: Any) -> None:
            _become_ordinary(self)
            setattr(self, name, value)

        __len__ = number_of_nodes = order = _count_nodes
        number_of_edges = _count_edges
        size = _add_weights  # type: ignore[assignment] # one function for both overloads
        as_columns = _make_columns

    LazyRoadGraph.__name__ = LazyRoadGraph.__qualname__ = "DiGraph"
    IGraphSource.register(LazyRoadGraph)
    return LazyRoadGraph


def _become_ordinary(graph: "nx.DiGraph[int]") -> None:
    """Fill a waiting graph, which becomes an ordinary DiGraph.

    Raises:
        TooLarge (BadValue): it would take more memory than allowed; the graph stays as it is.
    """
    import networkx as nx

    roads = _find_waiting_roads(graph)
    if roads is None:
        return
    columns = roads.columns()
    nodes = len(columns.node_ids)
    edges = len(columns.edge_ids)
    refuse_above(
        nodes * _FILLED_NODE_BYTES + edges * _FILLED_EDGE_BYTES,
        f"Reading the {nodes} nodes and {edges} edges of this graph as dicts of networkx (ctx.graph takes it as it is)",
    )
    del object.__getattribute__(graph, "__dict__")["waiting"]
    object.__setattr__(graph, "__class__", nx.DiGraph)
    nx.DiGraph.__init__(graph)
    graph.graph = roads.about
    _fill(graph, columns)


def find_waiting_columns(graph: object, names: Collection[str]) -> tuple[GraphColumns, Mapping[str, Any]] | None:
    """Return the columns of a graph that is not filled yet, and its entries of `G.graph`; None for other graphs.

    The graph stays unfilled.

    Args:
        graph: any graph.
        names: the attributes of edges to return. Their speeds and times are always returned.
    """
    roads = _find_waiting_roads(graph) if isinstance(graph, _get_deferred_class()) else None
    if roads is None:
        return None
    network = roads.network
    known: dict[tuple[Any, ...], int] = {}  # few, while there are as many ways as roads
    names = ("speed_kph", *(name for name in names if name != "speed_kph"))
    values = ((compute_speed_kph(of_way), *(of_way.get(name) for name in names[1:])) for of_way in network.tags)
    rows = [known.setdefault(of_way, len(known)) for of_way in values]
    tags = [dict(zip(names, of_way, strict=True)) for of_way in known]
    codes = np.array(rows, np.int64)
    back = None if network.back_ways is None else codes[network.back_ways]
    bare = replace(network, tags=tags, ways=codes[network.ways], back_ways=back)
    bare = replace(bare, refs=None, tunnels=None, z=None)
    return to_columns(bare), roads.about


def to_columns(network: RoadNetwork, *, has_parallels: bool = False) -> GraphColumns:
    """Return the graph that `to_digraph` makes, as columns; with parallels, all roads between two nodes.

    Requires: lengths are finite.
    """
    firsts, numbers = _number_nodes(network)
    roads, is_back, ends = _list_directed_roads(network, numbers)
    # As in networkx: sorted by source, then by when the pair of nodes was first joined; the last road of a pair counts.
    keys = np.arange(len(roads)) if has_parallels else ends[0] * len(firsts) + ends[1]
    pairs, first, group = np.unique(keys, return_index=True, return_inverse=True)
    last = np.zeros(len(pairs), np.int64)
    np.maximum.at(last, group, np.arange(len(keys)))
    chosen = last[np.lexsort((first, ends[0][first]))]
    sources, targets = ends[:, chosen]
    xy = network.xy[firsts]
    offsets, out_edges = kernels.group_rows(sources, len(xy))
    attributes = _make_attribute_columns(network, roads[chosen], is_back[chosen])
    if network.turns:
        attributes.update(_make_turn_columns(network, roads[chosen], is_back[chosen], chosen))
    return GraphColumns(
        node_ids=np.arange(len(xy)),
        xy=xy,
        edge_ids=chosen,
        sources=sources,
        targets=targets,
        lengths=network.lengths[roads[chosen]],
        offsets=offsets,
        out_edges=out_edges,
        polylines=_list_bent_shapes(network, roads[chosen], is_back[chosen]),
        node_attributes=_make_node_columns(network, firsts),
        edge_attributes=attributes,
        revision=0,
        crs=network.crs,
    )


def _make_node_columns(network: RoadNetwork, rows: IntArray) -> dict[str, Mapping[int, Any]]:
    """Return name -> position -> value for the nodes in these rows: their ids, and their tags."""
    refs = np.zeros(0, np.int64) if network.refs is None else network.refs[rows]
    numbered = np.flatnonzero(refs)
    columns: dict[str, Mapping[int, Any]] = (
        {"osmid": _make_separate_values(numbered, refs[numbered])} if len(numbered) else {}
    )
    tagged: dict[str, dict[int, Any]] = {}
    for row in numbered[np.isin(refs[numbered], np.array([*network.nodes.of], np.int64))].tolist():
        for name, value in network.nodes.of[int(refs[row])].items():
            tagged.setdefault(name, {})[row] = value
    columns.update(tagged)
    if network.tunnels is not None and (inside := np.flatnonzero(network.tunnels[rows])).size:
        columns["underground"] = _make_separate_values(inside, network.tunnels[rows][inside])
    return (
        columns if network.z is None else {**columns, "z": _make_separate_values(np.arange(len(rows)), network.z[rows])}
    )


def _make_separate_values(rows: IntArray, values: "np.ndarray[Any, Any]") -> CodedValues:
    """Return an attribute with a separate value for each row."""
    return CodedValues(rows, np.arange(len(rows)), values.tolist())


def _make_attribute_columns(network: RoadNetwork, roads: IntArray, is_back: BoolArray) -> dict[str, CodedValues]:
    """Return name -> row -> value for the edges of these roads, forward or back."""
    speeds = _list_speeds(network)
    given: dict[str, dict[int, Any]] = {}
    for way, of_way in enumerate(network.tags):
        for name, value in of_way.items():
            if name not in _RESERVED:
                given.setdefault(name, {})[way] = _copy(value)
        given.setdefault("speed_kph", {})[way] = speeds[way]
    ways = _find_ways(network, roads, is_back)
    code_of_way = np.empty(len(network.tags), np.int64)
    columns: dict[str, CodedValues] = {}
    for name, by_way in given.items():
        code_of_way.fill(-1)
        code_of_way[list(by_way)] = np.arange(len(by_way))
        codes = code_of_way[ways]
        rows = np.flatnonzero(codes >= 0)
        if len(rows):
            columns[name] = CodedValues(rows, codes[rows], [*by_way.values()])
    if not len(roads):
        return columns
    return {**columns, **_find_paces(network, speeds, roads, is_back)}


def _make_turn_columns(
    network: RoadNetwork, roads: IntArray, is_back: BoolArray, ids: IntArray
) -> dict[str, CodedValues]:
    """Return the attribute with the forbidden turns of edges, given their roads, directions and ids; none without."""
    numbers = np.full(2 * len(network.sources), -1)
    numbers[2 * roads + is_back] = np.arange(len(roads))
    of_row: dict[int, dict[str, list[list[int]]]] = {}
    for mode, paths in renumber(network.turns, numbers).items():
        for path in paths:
            of_row.setdefault(path[0], {}).setdefault(mode, []).append(ids[list(path[1:])].tolist())
    rows = np.array(sorted(of_row), np.int64)
    values = [of_row[row] for row in rows.tolist()]
    return {FORBIDDEN_TURNS: CodedValues(rows, np.arange(len(rows)), values)} if values else {}


def _find_ways(network: RoadNetwork, roads: IntArray, is_back: BoolArray) -> IntArray:
    """Return the rows of the tags of these roads, forward or back."""
    there = network.ways[roads]
    return there if network.back_ways is None else np.where(is_back, network.back_ways[roads], there)


def _find_paces(
    network: RoadNetwork, speeds: list[float], roads: IntArray, is_back: BoolArray
) -> dict[str, CodedValues]:
    """Return the `travel_time` of each of these roads, forward or back, and its `grade` if nodes have heights.

    Roads of several modes have a time for each mode that may use them; `travel_time` is that of the first.
    """
    ways = _find_ways(network, roads, is_back)
    grade = _find_grades(network, roads, is_back)
    times = _find_times(network, np.array(speeds, np.float64), "travel_time", roads, is_back)
    times = _slow_on_slopes(network, times, grade, ways, number=0)
    columns: dict[str, CodedValues] = {}
    first = np.full(len(roads), math.nan)
    for number, mode in enumerate(_list_modes_with_times(network)):
        kph = np.array([parse_number(of_way.get(mode)) for of_way in network.tags], np.float64)
        name = name_mode_time(mode)
        of_mode = _find_times(network, np.where(kph > 0.0, kph, math.nan), name, roads, is_back)
        of_mode = _slow_on_slopes(network, of_mode, grade, ways, number=number)
        rows = np.flatnonzero(~np.isnan(of_mode))
        columns[name] = _make_separate_values(rows, of_mode[rows])
        first = np.where(np.isnan(first), of_mode, first)
    if network.modes:
        times = np.where(np.isnan(first), times, first)
    every = np.arange(len(roads))
    columns["travel_time"] = _make_separate_values(every, times)
    return columns if grade is None else {**columns, "grade": _make_separate_values(every, grade)}


def _list_modes_with_times(network: RoadNetwork) -> list[str]:
    """Return the modes of a network, and those of which its roads have the travel times."""
    names = dict.fromkeys(name for of_way in network.tags for name in of_way if name.startswith(_TIMES))
    return [*dict.fromkeys((*network.modes, *(name.removeprefix(_TIMES) for name in names)))]


def _find_times(network: RoadNetwork, speeds: FloatArray, name: str, roads: IntArray, is_back: BoolArray) -> FloatArray:
    """Return the travel time of each of these roads, forward or back; see `compute_travel_times`."""
    times = compute_travel_times(network, network.ways, speeds, name)[roads]
    if network.back_ways is None:
        return times
    return np.where(is_back, compute_travel_times(network, network.back_ways, speeds, name)[roads], times)


def _find_grades(network: RoadNetwork, roads: IntArray, is_back: BoolArray) -> FloatArray | None:
    """Return the `grade` of each of these roads, forward or back; None if nodes have no heights."""
    if network.z is None:
        return None
    grade = compute_grades(network.z, np.column_stack((network.sources, network.targets)), network.lengths)[roads]
    return np.where(is_back, -grade, grade)


def _slow_on_slopes(
    network: RoadNetwork, times: FloatArray, grade: FloatArray | None, ways: IntArray, *, number: int
) -> FloatArray:
    """Return the travel times of a mode, by its number, on roads with slopes; stairs and elevators have none."""
    if grade is None or not any(network.are_walked[number : number + 1]):
        return times
    are_upright = np.array([is_upright(of_way) for of_way in network.tags], np.bool_)[ways]
    return np.where(are_upright, times, times * compute_walking_factor(grade))


def _list_speeds(network: RoadNetwork) -> list[float]:
    """Return the speed (ways,) on each way; most of the thousands of ways on a map have equal tags."""
    known: dict[tuple[Any, ...], float] = {}
    speeds: list[float] = []
    for of_way in network.tags:
        key = of_way.get("speed_kph"), of_way.get("maxspeed"), of_way.get("highway")
        if not _TEXTS.issuperset(map(type, key)):
            speeds.append(compute_speed_kph(of_way))
            continue
        if key not in known:
            known[key] = compute_speed_kph(of_way)
        speeds.append(known[key])
    return speeds


def _copy(value: object) -> Any:
    return value if type(value) in _SIMPLE else deepcopy(value)


def _list_bent_shapes(network: RoadNetwork, roads: IntArray, is_back: BoolArray) -> Polylines:
    """Return the shapes of edges that are not straight lines between their nodes."""
    first = network.offsets[:-1]
    last = network.offsets[1:] - 1
    is_straight = (last - first == 1) & np.all(
        (network.points[first] == network.xy[network.sources]) & (network.points[last] == network.xy[network.targets]),
        axis=1,
    )
    rows = np.flatnonzero(~is_straight[roads])
    of_row = roads[rows]
    count = len(network.points)
    points = np.concatenate((network.points, network.points[::-1]))
    points.setflags(write=False)
    starts = np.where(is_back[rows], 2 * count - network.offsets[of_row + 1], network.offsets[of_row])
    return Polylines(rows, starts, starts + np.diff(network.offsets)[of_row], points)


def to_multidigraph(network: RoadNetwork) -> "nx.MultiDiGraph[int]":
    """Return a graph that keeps all parallel roads between two nodes."""
    import networkx as nx

    graph: nx.MultiDiGraph[int] = nx.MultiDiGraph()
    graph.graph.update(_make_credits(network.crs, network.attribution))
    _fill(graph, to_columns(network, has_parallels=True))
    return graph


def _number_nodes(network: RoadNetwork) -> tuple[IntArray, IntArray]:
    """Return the rows of nodes in first-seen order, and the number of each row; nodes without roads come last."""
    ends = np.column_stack((network.sources, network.targets)).ravel()
    rows = np.concatenate((ends, np.arange(len(network.xy))))
    firsts = rows[kernels.number_by_appearance(rows)[1]]
    numbers = np.empty(len(firsts), np.int64)
    numbers[firsts] = np.arange(len(firsts))
    return firsts, numbers


def _make_credits(crs: str | None, attribution: str | None) -> dict[str, str]:
    """Return the entries of `G.graph` about the source of a graph."""
    about = {"attribution": attribution, "crs": crs}
    return {name: text for name, text in about.items() if text is not None}


def _fill(graph: "nx.Graph[int]", columns: GraphColumns) -> None:
    """Add the nodes and edges of columns to an empty graph."""
    with GarbagePause():
        nodes: list[dict[str, Any]] = [{"x": x, "y": y} for x, y in columns.xy.tolist()]
        _add_attributes(nodes, columns.node_attributes)
        graph.add_nodes_from(zip(columns.node_ids.tolist(), nodes, strict=True))
        ends = (columns.sources, columns.targets)
        roads = make_network_of_lines(columns.xy, ends, columns.polylines, columns.lengths, (), columns.crs)
        lines = make_line_strings(roads.points, np.repeat(np.arange(len(roads.lengths)), np.diff(roads.offsets)))
        first = zip(columns.edge_ids.tolist(), lines, columns.lengths.tolist(), strict=True)
        edges: list[dict[str, Any]] = [{"id": id, "linestring": line, "length": length} for id, line, length in first]
        _add_attributes(edges, columns.edge_attributes)
        graph.add_edges_from(zip(*(rows.tolist() for rows in ends), edges, strict=True))


def _add_attributes(rows: list[dict[str, Any]], columns: Mapping[str, Mapping[int, Any]]) -> None:
    for name, values in columns.items():
        for row, value in values.items():
            rows[row][name] = _copy(value)


def _list_directed_roads(network: RoadNetwork, numbers: IntArray) -> tuple[IntArray, BoolArray, IntArray]:
    """Return every road forward and, where traffic is two-way, back: its row, whether back, and its ends (2, edges)."""
    roads = np.repeat(np.arange(len(network.sources)), 1 + network.two_way)
    is_back = np.zeros(len(roads), np.bool_)
    is_back[1:] = roads[1:] == roads[:-1]
    ends = numbers[np.stack((network.sources, network.targets))[:, roads]]
    ends[:, is_back] = ends[::-1, is_back]
    return roads, is_back, ends


def make_network_of_graph(graph: "nx.Graph[Any]", names: Collection[str] | None = None) -> RoadNetwork:
    """Return the nodes and edges of a networkx graph in its own coordinates; every edge is a one-way road.

    `crs` stays None; an edge without a length has NaN. `names` are the attributes that become tags, by default all.

    Raises:
        BadType: it is not a networkx graph.
        BadValue: a node has no position, or an edge an impossible length, direction, speed or time.
    """
    import networkx as nx

    if not isinstance(graph, nx.Graph):
        raise BadType(f"osmg must be a networkx graph, not {shown(graph)} ({type(graph).__name__}).")
    rows = {node: row for row, node in enumerate(graph)}
    xy = np.array([_read_position(node, data) for node, data in graph.nodes(data=True)], np.float64).reshape(-1, 2)
    edges = list(graph.edges(data=True))
    sources = np.array([rows[u] for u, _, _ in edges], np.int64)
    targets = np.array([rows[v] for _, v, _ in edges], np.int64)
    lengths = np.array([_read_length(u, v, data) for u, v, data in edges], np.float64)
    is_directed = graph.is_directed()
    tags = [_select_tags(u, v, data, names, is_directed=is_directed) for u, v, data in edges]
    shapes = {road: data.get("geometry", data.get("linestring")) for road, (_, _, data) in enumerate(edges)}
    given = {road: shape for road, shape in shapes.items() if shape is not None}
    signs = {road: data[FORBIDDEN_TURNS] for road, (_, _, data) in enumerate(edges) if FORBIDDEN_TURNS in data}
    turns = read_turns_of_edges([data.get("id") for _, _, data in edges], signs) if signs else {}
    polylines = read_polylines(given, lambda road: f"The geometry of edge ({edges[road][0]!r}, {edges[road][1]!r})")
    network = make_network_of_lines(
        xy, (sources, targets), _orient_polylines(polylines, xy, sources, targets), lengths, tags, None
    )
    return replace(network, turns=turns)


def _select_tags(
    u: object, v: object, data: Mapping[Any, Any], names: Collection[str] | None, *, is_directed: bool
) -> dict[Any, Any]:
    """Return the attributes of an edge that become tags, with the sign of its direction."""
    if names is not None:
        data = {name: data[name] for name in names if name in data}
    what = f"Edge ({shown(u)}, {shown(v)})"
    tags = {name: value for name, value in read_edge_values(data, what).items() if name not in _OWN}
    if not has_special_signs(tags):
        return tags
    is_reversed = False if is_missing(data.get("reversed")) else parse_truth(data["reversed"])
    if is_reversed is None:
        raise BadValue(f"{what} has the value {shown(data['reversed'])} for 'reversed'. Give True or False.")
    return {**tags, **sign_in_force(tags, CARS, DIRECTIONS[is_reversed] if is_directed else "")}


def _read_position(node: object, data: Mapping[str, Any]) -> tuple[float, float]:
    x = parse_number(data.get("x"))
    y = parse_number(data.get("y"))
    if not (math.isfinite(x) and math.isfinite(y)):
        raise BadValue(
            f"Node {shown(node)} has no position: it needs finite numbers 'x' and 'y', not {shown(dict(data))}."
        )
    return x, y


def _read_length(u: object, v: object, data: Mapping[str, Any]) -> float:
    value = data.get("length")
    length = parse_number(value)
    if value is not None and not 0.0 <= length < math.inf:
        raise BadValue(
            f"Edge ({shown(u)}, {shown(v)}) has the length {shown(value)}. "
            "Give meters, or omit 'length' to use the length of the geometry."
        )
    return length


def _orient_polylines(
    polylines: dict[int, FloatArray], xy: FloatArray, sources: IntArray, targets: IntArray
) -> dict[int, FloatArray]:
    """Reverse polylines that do not begin at their source: undirected graphs may store those of (u, v) from v to u."""
    if not polylines:
        return polylines
    roads = np.fromiter(polylines, np.int64, len(polylines))
    first, last = (np.array([polyline[end] for polyline in polylines.values()]) for end in (0, -1))
    start = xy[sources[roads]]
    end = xy[targets[roads]]
    along = np.hypot(*(first - start).T) + np.hypot(*(last - end).T)
    against = np.hypot(*(first - end).T) + np.hypot(*(last - start).T)
    return {**polylines, **{road: polylines[road][::-1] for road in roads[against < along].tolist()}}
