"""The one door to networkx: road networks from its graphs and into them."""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from gamms.errors import BadType, BadValue
from gamms.ir.geometry import line_strings, points_of
from gamms.ir.graph import FloatArray, IntArray
from gamms.osm.labels import first_seen
from gamms.osm.network import RoadNetwork, network_of_lines
from gamms.osm.polylines import reversed_points

if TYPE_CHECKING:
    import networkx as nx

ATTRIBUTION = "© OpenStreetMap contributors, ODbL 1.0"
_OWN = frozenset(("id", "linestring", "geometry", "length", "reversed"))  # not tags: we write or replace them


def to_digraph(network: RoadNetwork) -> "nx.DiGraph[int]":
    """One node per node and one edge per direction of each road, numbered in first-seen order.

    Nodes have `x` and `y`; edges have `id`, `linestring`, `length` and their tags.
    The way back has the next id.
    """
    graph = _empty_digraph(network.crs)
    numbers, firsts = _numbers(network)
    xy = network.xy[firsts].tolist()
    graph.add_nodes_from((node, {"x": x, "y": y}) for node, (x, y) in enumerate(xy))
    ids = np.cumsum(1 + network.two_way) - (1 + network.two_way)
    there = line_strings(network.points, _lines(network.offsets))
    back = line_strings(network.points[reversed_points(network.offsets)], _lines(network.offsets))
    sources, targets = numbers[network.sources].tolist(), numbers[network.targets].tolist()
    lengths, two_way, ways = network.lengths.tolist(), network.two_way.tolist(), network.ways.tolist()
    for road, id in enumerate(ids.tolist()):
        u, v, length, tags = sources[road], targets[road], lengths[road], network.tags[ways[road]]
        graph.add_edge(u, v, id=id, linestring=there[road], length=length, **tags)
        if two_way[road]:
            graph.add_edge(v, u, id=id + 1, linestring=back[road], length=length, **tags)
    return graph


def to_road_graph(network: RoadNetwork) -> "nx.MultiDiGraph[int]":
    """One edge per road, with its tags and `oneway`; for saving a map that is to be cut later."""
    import networkx as nx

    graph: nx.MultiDiGraph[int] = nx.MultiDiGraph(attribution=ATTRIBUTION, crs=network.crs)
    graph.add_nodes_from((node, {"x": x, "y": y}) for node, (x, y) in enumerate(network.xy.tolist()))
    lines = line_strings(network.points, _lines(network.offsets))
    ends = zip(network.sources.tolist(), network.targets.tolist(), strict=True)
    for road, (u, v) in enumerate(ends):
        tags = {**network.tags[network.ways[road]], "oneway": not network.two_way[road]}
        graph.add_edge(u, v, id=road, linestring=lines[road], length=float(network.lengths[road]), **tags)
    return graph


def network_of_graph(graph: Any) -> RoadNetwork:
    """The nodes and edges of a networkx graph in its own coordinates; every edge is a one-way road.

    `crs` stays open; an edge without a length has NaN.

    Raises:
        BadType: it is no networkx graph.
        BadValue: a node has no position, or an edge an impossible length.
    """
    import networkx as nx

    if not isinstance(graph, nx.Graph):
        raise BadType(f"osmg must be a networkx graph, not {graph!r} ({type(graph).__name__}).")
    rows = {node: row for row, node in enumerate(graph)}
    xy = np.array([_position(node, data) for node, data in graph.nodes(data=True)], np.float64).reshape(-1, 2)
    edges = list(graph.edges(data=True))
    sources = np.array([rows[u] for u, _, _ in edges], np.int64)
    targets = np.array([rows[v] for _, v, _ in edges], np.int64)
    lengths = np.array([_length(u, v, data) for u, v, data in edges], np.float64)
    tags = [{name: value for name, value in data.items() if name not in _OWN} for _, _, data in edges]
    bends = {
        road: _oriented(points_of(data["geometry"], f"The geometry of edge ({u!r}, {v!r})"), xy[rows[u]], xy[rows[v]])
        for road, (u, v, data) in enumerate(edges)
        if data.get("geometry") is not None
    }
    return network_of_lines(xy, (sources, targets), bends, lengths, tags, None)


def _empty_digraph(crs: str | None) -> "nx.DiGraph[int]":
    import networkx as nx

    graph: nx.DiGraph[int] = nx.DiGraph(attribution=ATTRIBUTION)
    if crs is not None:
        graph.graph["crs"] = crs
    return graph


def _numbers(network: RoadNetwork) -> tuple[IntArray, IntArray]:
    """The number of each node row, and the row of each number; nodes without a road come last."""
    ends = np.column_stack((network.sources, network.targets)).ravel()
    return _first_seen_rows(np.concatenate((ends, np.arange(len(network.xy)))), len(network.xy))


def _first_seen_rows(rows: IntArray, count: int) -> tuple[IntArray, IntArray]:
    """Numbers for the rows in `range(count)`, all of which occur, in the order in which they first occur."""
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
        raise BadValue(f"Node {node!r} has no position: it needs finite numbers 'x' and 'y', not {dict(data)!r}.")
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
            f"Edge ({u!r}, {v!r}) has the length {value!r}. "
            "Give metres, or leave 'length' out and it follows from the geometry."
        )
    return length


def _oriented(points: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """An undirected graph may store the geometry of (u, v) from v to u."""
    along = np.hypot(*(points[0] - start)) + np.hypot(*(points[-1] - end))
    against = np.hypot(*(points[0] - end)) + np.hypot(*(points[-1] - start))
    return points[::-1] if against < along else points
