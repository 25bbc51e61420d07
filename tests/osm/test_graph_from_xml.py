"""From a map file to a graph: lengths, directions, connectedness, tags."""

import math
import subprocess
import sys

import networkx as nx
import numpy as np
import pytest

from gamms.osm import graph_from_file, graph_from_xml, report

ROAD = {"highway": "residential"}


def haversine(a, b):
    (lat1, lon1), (lat2, lon2) = (map(math.radians, p) for p in (a, b))
    h = math.sin((lat2 - lat1) / 2) ** 2 + math.cos(lat1) * math.cos(lat2) * math.sin((lon2 - lon1) / 2) ** 2
    return 2 * 6_371_009 * math.asin(math.sqrt(h))


def total_length(graph):
    return sum(data["length"] for _, _, data in graph.edges(data=True))


def places(graph):
    return {(data["x"], data["y"]) for _, data in graph.nodes(data=True)}


def test_lengths_are_true_metres(make_map, curve):
    path = make_map(curve, ([*curve], ROAD))
    expected = sum(haversine(curve[i], curve[i + 1]) for i in range(1, 8))
    graph = graph_from_xml(path, resolution=5.0)
    assert total_length(graph) == pytest.approx(2 * expected, rel=0.006)


@pytest.mark.parametrize("resolution", [1.0, 3.0, 10.0, 1e6])
def test_resampling_keeps_the_total_length(make_map, curve, resolution):
    path = make_map(curve, ([*curve], ROAD))
    whole = total_length(graph_from_xml(path, resolution=1e9))
    assert total_length(graph_from_xml(path, resolution=resolution)) == pytest.approx(whole, rel=1e-9)


def test_cut_pieces_have_about_the_resolution(make_map, cross):
    graph = graph_from_xml(make_map(cross, ([1, 2, 3], ROAD), ([2, 4], ROAD)), resolution=10.0)
    lengths = [data["length"] for _, _, data in graph.edges(data=True)]
    assert len(lengths) > 30
    assert all(7.5 <= length <= 12.5 for length in lengths)


def test_a_curved_road_has_no_two_nodes_at_nearly_one_place(make_map, curve):
    graph = graph_from_xml(make_map(curve, ([*curve], ROAD)), resolution=4.0)
    xy = np.array(sorted(places(graph)))
    gaps = np.hypot(*(xy[:, None] - xy[None, :]).transpose(2, 0, 1)) + np.eye(len(xy)) * 1e9
    assert gaps.min() > 1.0


def test_the_graph_names_its_crs_and_its_makers(make_map, cross):
    graph = graph_from_xml(make_map(cross, ([1, 2], ROAD)))
    assert graph.graph["crs"] == "EPSG:32635"
    assert "OpenStreetMap" in graph.graph["attribution"]
    xs = [x for _, x in graph.nodes(data="x")]
    assert 100_000 < min(xs) < max(xs) < 900_000


def test_a_map_may_straddle_the_date_line(make_map):
    graph = graph_from_xml(make_map({1: (10.0, 179.9995), 2: (10.0, -179.9999)}, ([1, 2], ROAD)), resolution=1e4)
    assert graph.graph["crs"] == "EPSG:32660"
    assert total_length(graph) == pytest.approx(2 * haversine((10.0, 0.0), (10.0, 0.0006)), rel=0.006)


@pytest.mark.parametrize("oneway", ["yes", "true", "1"])
def test_one_way_streets_lead_forward_only(make_map, cross, oneway):
    path = make_map(cross, ([1, 2, 3], {**ROAD, "oneway": oneway}))
    graph = graph_from_xml(path, bidirectional=False)
    assert graph.number_of_edges() == graph.number_of_nodes() - 1
    assert all(graph.nodes[u]["x"] < graph.nodes[v]["x"] for u, v in graph.edges)


@pytest.mark.parametrize("oneway", ["-1", "reverse"])
def test_reversed_one_way_streets_lead_backward_only(make_map, cross, oneway):
    path = make_map(cross, ([1, 2, 3], {**ROAD, "oneway": oneway}))
    graph = graph_from_xml(path, bidirectional=False)
    assert graph.number_of_edges() == graph.number_of_nodes() - 1
    assert all(graph.nodes[u]["x"] > graph.nodes[v]["x"] for u, v in graph.edges)


def test_bidirectional_opens_one_way_streets(make_map, cross):
    path = make_map(cross, ([1, 2, 3], {**ROAD, "oneway": "yes"}))
    both, one = graph_from_xml(path), graph_from_xml(path, bidirectional=False)
    assert both.number_of_edges() == 2 * one.number_of_edges()
    assert places(both) == places(one)


def test_two_roads_between_the_same_nodes_are_both_there(make_map, cross):
    one = graph_from_xml(make_map(cross, ([1, 2], ROAD), name="one.osm"), resolution=1e6)
    two = graph_from_xml(make_map(cross, ([1, 2], ROAD), ([2, 1], {"highway": "footway"})), resolution=1e6)
    assert total_length(two) == pytest.approx(2 * total_length(one))
    assert two.number_of_nodes() == 3
    assert {data["highway"] for _, _, data in two.edges(data=True)} == {"residential", "footway"}


def test_a_node_missing_from_the_file_leaves_a_gap(make_map, cross):
    path = make_map({**cross, 5: (60.17, 24.943)}, ([1, 4, 99, 3, 5], ROAD))
    graph = graph_from_xml(path, resolution=1e6, retain_all=True)
    assert nx.number_weakly_connected_components(graph) == 2
    assert graph.number_of_edges() == 4


def test_the_largest_part_is_kept_unless_all_are_asked_for(make_map, cross):
    far = {11: (60.18, 24.95), 12: (60.1805, 24.95)}
    path = make_map({**cross, **far}, ([11, 12], ROAD), ([1, 2, 3], ROAD))
    assert graph_from_xml(path, resolution=1e6).number_of_nodes() == 3
    assert graph_from_xml(path, resolution=1e6, retain_all=True).number_of_nodes() == 5


@pytest.mark.parametrize(
    ("tags", "taken_by"),
    [
        ({"highway": "platform"}, (graph_from_xml, graph_from_file)),
        ({"highway": "pedestrian", "area": "yes"}, (graph_from_xml, graph_from_file)),
        ({"highway": "construction"}, (graph_from_xml,)),
        ({"highway": "proposed"}, (graph_from_xml,)),
        ({"building": "yes"}, ()),
    ],
)
def test_all_ways_with_a_highway_tag_are_read_as_1_0_0_does(make_map, cross, tags, taken_by):
    path = make_map(cross, ([1, 2], ROAD), ([2, 3, 4, 2], tags))
    for load in (graph_from_xml, graph_from_file):
        graph = load(path, resolution=1e6)
        assert (100, 101)[load in taken_by] == max(data["osmid"] for *_, data in graph.edges(data=True))
        assert report(graph, path).is_faithful


def test_a_closed_way_and_repeated_vertices_lose_nothing(make_map, cross):
    path = make_map(cross, ([1, 1, 2, 4, 4, 1], ROAD))
    graph = graph_from_xml(path, resolution=1e6)
    expected = haversine(cross[1], cross[2]) + haversine(cross[2], cross[4]) + haversine(cross[4], cross[1])
    assert total_length(graph) == pytest.approx(2 * expected, rel=0.006)
    assert min(data["length"] for _, _, data in graph.edges(data=True)) > 0.0


def test_coincident_nodes_that_a_road_joins_become_one(make_map, cross):
    cross[5] = cross[2]
    graph = graph_from_xml(make_map(cross, ([1, 2, 5, 3], ROAD)), resolution=1e6)
    assert graph.number_of_nodes() == 3
    assert min(data["length"] for _, _, data in graph.edges(data=True)) > 0.0


_DIGEST = """
import hashlib, sys
from gamms.osm import graph_from_xml
graph = graph_from_xml(sys.argv[1])
text = repr([list(graph.nodes(data=True)), [(u, v, {**d, "linestring": d["linestring"].wkb}) for u, v, d in
    graph.edges(data=True)], graph.graph])
print(hashlib.sha256(text.encode()).hexdigest())
"""


def test_the_hash_seed_changes_nothing(make_map, cross, capsys, monkeypatch):
    path = make_map(cross, ([1, 2, 3], {**ROAD, "name": "A", "lanes": "2"}), ([2, 4], {**ROAD, "ref": "1"}))
    monkeypatch.setattr(sys, "argv", ["digest", str(path)])
    exec(_DIGEST, {})
    command = [sys.executable, "-c", _DIGEST, str(path)]
    there = subprocess.check_output(command, env={"PYTHONHASHSEED": "4711"}, text=True)
    assert there == capsys.readouterr().out
