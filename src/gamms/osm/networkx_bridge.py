"""Road networks from networkx graphs and into them."""

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from gamms.errors import BadType, BadValue
from gamms.ir.geometry import line_strings, polylines_of
from gamms.ir.graph import FloatArray, IntArray
from gamms.osm.network import RoadNetwork, network_of_lines, reversed_points
from gamms.osm.speeds import speed_kph, travel_times
from gamms.osm.ways import first_seen
from gamms.text import shown

if TYPE_CHECKING:
    import networkx as nx

_OWN = frozenset(("id", "linestring", "geometry", "length", "reversed"))  # not tags: we write or replace them


def to_digraph(network: RoadNetwork) -> "nx.DiGraph[int]":
    """Return one node per node and one edge per direction of each road, numbered in first-seen order.

    Nodes have `x` and `y`; edges have `id`, `linestring`, `length`, their tags, `speed_kph` and `travel_time`.
    The way back has the next id. Of roads from one node to another the last is kept.
    """
    import networkx as nx

    graph: nx.DiGraph[int] = nx.DiGraph()
    _fill(graph, network)
    return graph


def to_multidigraph(network: RoadNetwork) -> "nx.MultiDiGraph[int]":
    """Return the same with every road, also between the same two nodes."""
    import networkx as nx

    graph: nx.MultiDiGraph[int] = nx.MultiDiGraph()
    _fill(graph, network)
    return graph


def _fill(graph: "nx.DiGraph[int]", network: RoadNetwork) -> None:
    about = {"attribution": network.attribution, "crs": network.crs}
    graph.graph.update({name: text for name, text in about.items() if text is not None})
    numbers, firsts = _numbers(network)
    xy = network.xy[firsts].tolist()
    graph.add_nodes_from((node, {"x": x, "y": y}) for node, (x, y) in enumerate(xy))
    graph.add_edges_from(_edges(network, numbers))


def _edges(network: RoadNetwork, numbers: IntArray) -> Iterator[tuple[int, int, dict[str, Any]]]:
    """Every road there and, where traffic runs both ways, back: as networkx takes them."""
    ids = (np.cumsum(1 + network.two_way) - (1 + network.two_way)).tolist()
    there = line_strings(network.points, _lines(network.offsets))
    back = line_strings(network.points[reversed_points(network.offsets)], _lines(network.offsets))
    tags = [{**of_way, "speed_kph": speed_kph(of_way)} for of_way in network.tags]
    times = travel_times(network, np.array([of_way["speed_kph"] for of_way in tags], np.float64)).tolist()
    sources, targets = numbers[network.sources].tolist(), numbers[network.targets].tolist()
    lengths, two_way, ways = network.lengths.tolist(), network.two_way.tolist(), network.ways.tolist()
    for road, id in enumerate(ids):
        u, v, length, time, of_way = sources[road], targets[road], lengths[road], times[road], tags[ways[road]]
        own = {"linestring": there[road], "length": length}
        yield u, v, {"id": id, **own, **of_way, "travel_time": time}
        if two_way[road]:
            own = {"linestring": back[road], "length": length}
            yield v, u, {"id": id + 1, **own, **of_way, "travel_time": time}


def network_of_graph(graph: "nx.Graph[Any]") -> RoadNetwork:
    """Return the nodes and edges of a networkx graph in its own coordinates; every edge is a one-way road.

    `crs` stays None; an edge without a length has NaN.

    Raises:
        BadType: it is no networkx graph.
        BadValue: a node has no position, or an edge an impossible length.
    """
    import networkx as nx

    if not isinstance(graph, nx.Graph):
        raise BadType(f"osmg must be a networkx graph, not {shown(graph)} ({type(graph).__name__}).")
    rows = {node: row for row, node in enumerate(graph)}
    xy = np.array([_position(node, data) for node, data in graph.nodes(data=True)], np.float64).reshape(-1, 2)
    edges = list(graph.edges(data=True))
    sources = np.array([rows[u] for u, _, _ in edges], np.int64)
    targets = np.array([rows[v] for _, v, _ in edges], np.int64)
    lengths = np.array([_length(u, v, data) for u, v, data in edges], np.float64)
    tags = [{name: value for name, value in data.items() if name not in _OWN} for _, _, data in edges]
    shapes = {road: data.get("geometry", data.get("linestring")) for road, (_, _, data) in enumerate(edges)}
    given = {road: shape for road, shape in shapes.items() if shape is not None}
    polylines = polylines_of(given, lambda road: f"The geometry of edge ({edges[road][0]!r}, {edges[road][1]!r})")
    return network_of_lines(xy, (sources, targets), _oriented(polylines, xy, sources, targets), lengths, tags, None)


def _numbers(network: RoadNetwork) -> tuple[IntArray, IntArray]:
    """Return the number of each node row, and the row of each number; nodes without a road come last."""
    ends = np.column_stack((network.sources, network.targets)).ravel()
    return _first_seen_rows(np.concatenate((ends, np.arange(len(network.xy)))), len(network.xy))


def _first_seen_rows(rows: IntArray, count: int) -> tuple[IntArray, IntArray]:
    """Return numbers for the rows in `range(count)`, all of which occur, in the order in which they first occur."""
    _, firsts = first_seen(rows)
    order = rows[firsts]
    numbers = np.empty(count, np.int64)
    numbers[order] = np.arange(count)
    return numbers, order


def _lines(offsets: IntArray) -> IntArray:
    return np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))


def _position(node: object, data: Mapping[str, Any]) -> tuple[float, float]:
    try:
        x, y = float(data["x"]), float(data["y"])
    except (KeyError, TypeError, ValueError):
        x = y = math.nan
    if not (math.isfinite(x) and math.isfinite(y)):
        raise BadValue(
            f"Node {shown(node)} has no position: it needs finite numbers 'x' and 'y', not {shown(dict(data))}."
        )
    return x, y


def _length(u: object, v: object, data: Mapping[str, Any]) -> float:
    value = data.get("length")
    if value is None:
        return math.nan
    try:
        length = float(value)
    except (TypeError, ValueError):
        length = math.nan
    if not 0.0 <= length < math.inf:
        raise BadValue(
            f"Edge ({shown(u)}, {shown(v)}) has the length {shown(value)}. "
            "Give metres, or leave 'length' out and it follows from the geometry."
        )
    return length


def _oriented(
    polylines: dict[int, FloatArray], xy: FloatArray, sources: IntArray, targets: IntArray
) -> dict[int, FloatArray]:
    """Let every polyline begin at its source: an undirected graph may store the geometry of (u, v) from v to u."""
    if not polylines:
        return polylines
    roads = np.fromiter(polylines, np.int64, len(polylines))
    first, last = (np.array([polyline[end] for polyline in polylines.values()]) for end in (0, -1))
    start, end = xy[sources[roads]], xy[targets[roads]]
    along = np.hypot(*(first - start).T) + np.hypot(*(last - end).T)
    against = np.hypot(*(first - end).T) + np.hypot(*(last - start).T)
    return {**polylines, **{road: polylines[road][::-1] for road in roads[against < along].tolist()}}
