"""Graphs from elsewhere, such as OSMnx, cut in the same way."""

import networkx as nx
import pytest
from shapely import LineString

from gamms.errors import BadType, BadValue
from gamms.osm import consolidate, load, obstacle_from_file, process_osm_graph


def street(**about):
    """A bent street from 0 to 1 as OSMnx has it: an edge there and an edge back."""
    graph = nx.MultiDiGraph(**about)
    graph.add_node(0, x=500_000.0, y=6_000_000.0)
    graph.add_node(1, x=500_060.0, y=6_000_000.0)
    polyline = [(500_000.0, 6_000_000.0), (500_030.0, 6_000_020.0), (500_060.0, 6_000_000.0)]
    graph.add_edge(0, 1, geometry=LineString(polyline), length=72.5, name="A", oneway=False, reversed=False)
    graph.add_edge(1, 0, geometry=LineString(polyline[::-1]), length=72.5, name="A", oneway=False, reversed=True)
    return graph


def total_length(graph):
    return sum(length for _, _, length in graph.edges(data="length"))


@pytest.mark.parametrize("crs", ["EPSG:2263", "EPSG:2277", "+proj=utm +zone=35 +units=km"])
def test_a_map_in_feet_is_not_taken_for_one_in_metres(crs, tmp_path):
    with pytest.raises(BadValue, match=r"is in .*, but lengths and heights of maps are in metres"):
        process_osm_graph(street(crs=crs))
    with pytest.raises(BadValue, match="in metres"):
        obstacle_from_file(tmp_path / "any.osm", crs=crs)


def test_directions_are_honoured_only_if_asked_for():
    graph = street()
    graph.remove_edge(1, 0)
    assert process_osm_graph(graph).number_of_edges() == 14
    one_way = process_osm_graph(graph, bidirectional=False)
    assert one_way.number_of_edges() == 7
    assert list(one_way.edges) == [(i, i + 1) for i in range(7)]


def test_opening_one_way_streets_by_default_is_warned_about_once(caplog):
    load._warn_of_opened_streets.cache_clear()
    graph = street()
    for open_street in (street(), nx.MultiGraph(street())):
        process_osm_graph(open_street)
    graph.remove_edge(1, 0)
    for bidirectional in (True, False):
        process_osm_graph(graph, bidirectional=bidirectional)
    assert caplog.messages == []
    for _ in range(2):
        process_osm_graph(graph)
    (message,) = caplog.messages
    assert "bidirectional=False" in message


def test_a_graph_in_degrees_is_projected_once():
    graph = nx.MultiDiGraph(crs="epsg:4326")
    graph.add_node("a", x=24.94, y=60.17)
    graph.add_node("b", x=24.95, y=60.17)
    graph.add_edge("a", "b")
    cut = process_osm_graph(graph)
    assert cut.graph["crs"] == "EPSG:32635"
    assert total_length(cut) == pytest.approx(2 * 555.1, rel=0.001)
    assert process_osm_graph(nx.MultiDiGraph(cut)).graph["crs"] == "EPSG:32635"


def test_a_stale_crs_does_not_project_metres():
    cut = process_osm_graph(street(crs="epsg:4326"))
    assert cut.nodes[0] == {"x": 500_000.0, "y": 6_000_000.0}


def test_a_graph_without_a_crs_is_in_metres():
    graph = nx.Graph()
    graph.add_node(0, x=0, y=0)
    graph.add_node(1, x=30, y=0)
    graph.add_edge(0, 1)
    cut = process_osm_graph(graph)
    assert sorted(x for _, x in cut.nodes(data="x")) == pytest.approx([0, 10, 20, 30])
    assert "crs" not in cut.graph


def test_isolated_nodes_are_kept():
    graph = street()
    graph.add_node("lonely", x=0.0, y=0.0)
    assert process_osm_graph(graph).nodes[8] == {"x": 0.0, "y": 0.0}


def test_the_callers_graph_is_left_alone():
    graph = street(crs="EPSG:32635")
    before = repr([list(graph.nodes(data=True)), list(graph.edges(data=True)), graph.graph])
    process_osm_graph(graph)
    assert repr([list(graph.nodes(data=True)), list(graph.edges(data=True)), graph.graph]) == before


def test_an_empty_graph_stays_empty():
    assert process_osm_graph(nx.MultiDiGraph()).number_of_nodes() == 0
    assert process_osm_graph(nx.MultiDiGraph(crs="epsg:4326")).number_of_nodes() == 0


def test_bad_graphs_are_refused_with_the_place():
    with pytest.raises(BadType, match="networkx"):
        process_osm_graph(None)
    for bad in ({}, {"x": 0.0}, {"x": "here", "y": 0.0}, {"x": float("nan"), "y": 0.0}):
        graph = nx.MultiDiGraph()
        graph.add_node("corner", **bad)
        with pytest.raises(BadValue, match="corner"):
            process_osm_graph(graph)
    for length in (-1.0, float("nan"), "far"):
        graph = street()
        graph.edges[0, 1, 0]["length"] = length
        with pytest.raises(BadValue, match="length"):
            process_osm_graph(graph)
    with pytest.raises(BadValue, match="CRS"):
        process_osm_graph(street(crs="nonsense"))
    with pytest.raises(BadValue, match="resolution"):
        process_osm_graph(street(), resolution=0)


def in_degrees(scale=1.0, **edge):
    graph = nx.MultiDiGraph()
    graph.add_nodes_from([(0, {"x": 24.94 * scale, "y": 60.17 * scale}), (1, {"x": 24.95 * scale, "y": 60.17 * scale})])
    graph.add_edge(0, 1, **edge)
    return graph


@pytest.mark.parametrize("edge", [{}, {"length": 555.1}])
@pytest.mark.parametrize("read", [process_osm_graph, lambda graph: consolidate(graph, 1.0)])
def test_degrees_without_a_crs_are_no_metres(read, edge):
    with pytest.raises(BadValue, match=r"has no CRS .* look like degrees: from \(24\.94, 60\.17\) .* 'EPSG:4326'"):
        read(in_degrees(**edge))
    for crs in ("EPSG:4326", "EPSG:32635"):
        graph = in_degrees(**edge)
        graph.graph["crs"] = crs
        read(graph)


def test_small_maps_in_metres_need_no_crs():
    assert process_osm_graph(in_degrees(scale=100.0)).number_of_edges() == 2
    grid = nx.grid_2d_graph(3, 3)
    nx.set_node_attributes(grid, {node: {"x": 0.05 * node[0], "y": 0.05 * node[1]} for node in grid})
    assert len(process_osm_graph(grid)) == 9
