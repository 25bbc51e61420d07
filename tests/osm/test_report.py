"""The fidelity report against a slow independent computation, and on the command line."""

import json
import math
from itertools import product
from pathlib import Path

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import LineString, Point
from typer.testing import CliRunner

import gamms
from gamms.cli import app
from gamms.errors import BadFile, BadType, BadValue
from gamms.ir.geometry import find_nearest_point, measure_distances
from gamms.osm import Report, graph_from_file, graph_from_geojson, graph_from_xml, report
from gamms.osm.fidelity import measure_deviations
from gamms.osm.network import make_network_of_columns
from gamms.osm.networkx_bridge import to_digraph
from gamms.osm.topology import consolidate, resample

ROAD = {"highway": "residential"}


@pytest.fixture
def town(make_map):
    """A wavy street of two ways, a one-way street, a dead end, a crossing of four near junctions, a far part."""
    nodes = {i: (60.17 + 0.0002 * math.sin(i), 24.94 + 0.0004 * i) for i in range(30)}
    nodes |= {100 + i: (60.171, 24.94 + 0.0012 * i) for i in range(10)}
    lat, lon = nodes[10]
    nodes |= {200: (lat, lon + 0.00005), 201: (lat + 0.00004, lon), 202: (lat + 0.001, lon)}
    nodes |= {203: (lat + 0.00004, lon + 0.001), 204: (lat - 0.001, lon + 0.00005)}
    nodes |= {300: (60.2, 24.9), 301: (60.201, 24.9)}
    return make_map(
        nodes,
        ([*range(15)], {**ROAD, "name": "Wave"}),
        ([*range(14, 30)], {**ROAD, "name": "More"}),
        ([0, *range(100, 110), 29], {**ROAD, "oneway": "yes"}),
        ([10, 200], ROAD),
        ([10, 201, 202], ROAD),
        ([201, 203], ROAD),
        ([200, 204], ROAD),
        ([300, 301], ROAD),
    )


def test_nothing_deviates_where_nothing_was_merged(town):
    found = report(graph_from_file(town, tolerance=0.0), town)
    assert (found.deviation_max, found.deviation_mean, found.nodes_merged, found.length_merged) == (0, 0, 0, 0)
    assert found.surplus_max < 1e-6
    assert found.source == town.name
    assert found.crs == "EPSG:32635"


def test_pieces_are_within_their_bounds(town):
    found = report(graph_from_file(town, 10.0, tolerance=0.0), town)
    assert 7.5 <= found.piece_min <= found.piece_max <= 12.5
    assert found.spacing_kept
    finer = report(graph_from_file(town, 10.0, tolerance=0.0), town, resolution=20.0)  # whole roads are short enough
    assert (finer.piece_max < 15.0, finer.spacing_kept) == (True, False)


@pytest.mark.parametrize(
    ("spoil", "broken"),
    [
        (lambda data: data.update(length=0.0), {"length_kept", "uncut_kept"}),
        (lambda data: data.update(length=data["length"] * 3), {"length_kept", "uncut_kept", "spacing_kept"}),
    ],
)
def test_a_broken_promise_is_found(town, spoil, broken):
    graph = graph_from_file(town, 60.0, tolerance=0.0)
    assert report(graph, town).roads_uncut >= 2
    for *_, data in graph.edges(data=True):
        spoil(data)
    found = report(graph, town)
    assert {name for name in ("length_kept", "spacing_kept", "uncut_kept") if not getattr(found, name)} >= broken
    assert not found.is_faithful
    assert "NO" in str(found)


def test_the_report_accounts_for_all_of_the_source(make_map, cross):
    cross |= {11: (60.18, 24.94), 12: (60.181, 24.94), 13: (60.18, 24.942)}
    path = make_map(
        cross,
        ([1, 2], {**ROAD, "access:conditional": "no @ (Mo-Fr)"}),
        ([2, 3], {"highway": "footway"}),
        ([2, 4], {**ROAD, "access": "private"}),
        ([1, 4, 3, 1], {**ROAD, "area": "yes"}),
        ([11, 12], ROAD),
        ([2, 12], {"building": "yes"}),
        ([13, 1], {**ROAD, "oneway": "yes"}),
    )
    relation = '<relation id="1"><member type="way" ref="100" role="from"/><tag k="type" v="restriction"/></relation>'
    path.write_text(path.read_text().replace("</osm>", f"{relation}</osm>"))
    found = report(graph_from_file(path, 10.0, osm_type="drive"), path)
    left_out = sum(found.closed.values()) + found.other_parts + found.no_way_back
    assert found.source_length == pytest.approx(found.length_before + left_out)
    assert found.source_length == pytest.approx(report(graph_from_xml(path, 1e6, retain_all=True), path).length_before)
    assert [*found.closed] == ["area=yes", "access=private", "highway=footway"]
    rows = dict(found.rows())
    assert rows["closed by class"].startswith("55.5 m left out: highway=footway")
    assert rows["closed by access"].startswith("55.7 m left out: access=private")
    assert rows["closed as areas"] == "268.3 m left out: area=yes 268.3 m"
    assert rows["ignored"] == "1 turn restrictions, 1 conditional"
    assert found.is_faithful


def test_a_context_says_the_same_as_the_graph_it_was_given(town):
    graph = graph_from_file(town, tolerance=0.0)
    with gamms.create_context(logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(graph)
        assert report(ctx.graph, town, resolution=10.0).to_dict() == report(graph, town).to_dict()
        with pytest.raises(BadValue, match="resolution"):
            report(ctx.graph, town)


def test_the_shipped_map_keeps_its_promises():
    with gamms.create_context(logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.load(gamms.osm.load._FILE)
        columns = ctx.graph.columns()
    found = report(gamms.osm.resample_columns(columns), columns)
    assert found.is_faithful, str(found)
    assert found.deviation_max == 0.0
    assert found.components == 1
    assert found.length_before == pytest.approx(columns.lengths.sum())


def test_the_source_may_be_a_graph(town):
    graph = nx.MultiDiGraph(crs="EPSG:32635")
    for node, x in enumerate((0.0, 30.0, 33.0)):
        graph.add_node(node, x=5e5 + x, y=6e6)
    polyline = LineString([(5e5, 6e6), (5e5 + 15, 6e6 + 9), (5e5 + 30, 6e6)])
    graph.add_edge(0, 1, geometry=polyline, length=35.5)
    graph.add_edge(1, 2, length=3.2)
    cut = gamms.osm.process_osm_graph(graph)
    assert report(cut, graph).is_faithful
    with pytest.raises(BadValue, match="EPSG"):
        report(graph_from_file(town), nx.MultiDiGraph(graph, crs="EPSG:32634"))


def test_a_geojson_source_is_read(tmp_path):
    path = tmp_path / "map.geojson"
    path.write_text('{"type": "LineString", "coordinates": [[24.94, 60.17], [24.941, 60.17], [24.942, 60.1705]]}')
    found = report(graph_from_geojson(path), path)
    assert found.is_faithful
    assert found.dead_ends == 2


def test_an_empty_graph_has_a_report(town):
    found = report(nx.DiGraph(resolution=10.0), nx.Graph())
    assert (found.nodes, found.components, found.length_error) == (0, 0, 0.0)
    assert found.to_dict()["piece_min"] is None
    assert str(found)


def test_an_invalid_graph_or_map_is_refused(town, tmp_path):
    with pytest.raises(BadType):
        report(3, town, resolution=10.0)
    with pytest.raises(BadType):
        report(graph_from_file(town), 3)
    bad = tmp_path / "bad.osm"
    bad.write_text("hello")
    with pytest.raises(BadFile):
        report(graph_from_file(town), bad)


def test_a_report_is_a_plain_value(town):
    found = report(graph_from_file(town), town)
    assert isinstance(found, Report)
    assert found == report(graph_from_file(town), town)
    assert json.loads(json.dumps(found.to_dict()))["is_faithful"] is True


place = st.integers(-900, 900).map(lambda n: n / 16 + n * n / 1e5)


@settings(max_examples=12)
@given(
    st.lists(st.tuples(place, place), min_size=2, max_size=10, unique=True),
    st.data(),
    st.sampled_from([0.0, 2.0]),
    st.sampled_from([3.0, 10.0, 40.0]),
)
def test_every_network_keeps_its_promises(xy, data, tolerance, resolution):
    node = st.integers(0, len(xy) - 1)
    roads = data.draw(st.lists(st.tuples(node, node).filter(lambda ends: ends[0] != ends[1]), min_size=1, max_size=12))
    graph = nx.MultiGraph()
    graph.add_nodes_from((i, {"x": x, "y": y}) for i, (x, y) in enumerate(xy))
    graph.add_edges_from(roads)
    source = gamms.osm.load.make_network_in_metres(graph)
    merged = consolidate(source, tolerance)
    cut = to_digraph(resample(merged, resolution))
    about = {"merged_length": merged.merged.length_m, "merged_nodes": merged.merged.nodes, "bidirectional": False}
    cut.graph.update(resolution=resolution, tolerance=tolerance, **about)
    found = report(cut, source)
    assert found.directions_kept
    assert found.joints_kept
    assert found.on_map_kept
    assert found.length_error == pytest.approx(0.0, abs=1e-9)
    assert found.length_kept or tolerance > 0.0
    assert found.uncut_kept
    assert found.spacing_kept


def test_the_command_prints_a_table(town):
    result = CliRunner().invoke(app, ["osm", "report", str(town), "--tolerance", "4"])
    assert result.exit_code == 0, result.output
    assert "length kept" in result.output
    assert "EPSG:32635" in result.output


def test_the_command_prints_json(town):
    arguments = ["osm", "report", str(town), "--json", "--resolution", "20", "--network", "drive"]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    found = json.loads(result.output)
    assert (found["resolution"], found["is_faithful"]) == (20.0, True)


def test_the_command_reads_geojson(tmp_path):
    path = tmp_path / "map.geojson"
    path.write_text('{"type": "LineString", "coordinates": [[24.94, 60.17], [24.941, 60.17]]}')
    assert CliRunner().invoke(app, ["osm", "report", str(path)]).exit_code == 0


@pytest.mark.parametrize("content", [None, b"", b"hello", b'{"type": "Point"}', b"\x1f\x8b\x00"])
def test_a_bad_file_gives_one_sentence_and_exit_code_1(tmp_path, content):
    path = tmp_path / "bad.osm"
    if content is not None:
        path.write_bytes(content)
    result = CliRunner().invoke(app, ["osm", "report", str(path)])
    assert result.exit_code == 1
    assert result.output.startswith("gamms: ")
    assert "Traceback" not in result.output
    assert str(path) in result.output


def test_a_bad_number_gives_one_sentence_too(town):
    result = CliRunner().invoke(app, ["osm", "report", str(town), "--resolution", "0"])
    assert result.exit_code == 1
    assert "resolution" in result.output


def test_columns_of_a_network_are_a_source(town):
    with gamms.create_context(logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(graph_from_file(town, 1e6))
        network = make_network_of_columns(ctx.graph.columns())
    assert np.isfinite(network.lengths).all()


@given(
    st.lists(st.tuples(place, place), min_size=4, max_size=12, unique=True),
    st.sampled_from([0.01, 1.0, 30.0, 1000.0]),
)
def test_deviations_are_exact_at_every_scale(xy, scale):
    xy = [(x * scale, y * scale) for x, y in xy]
    graph = nx.Graph()
    graph.add_nodes_from((i, {"x": x, "y": y}) for i, (x, y) in enumerate(xy))
    half = len(xy) // 2
    one, other = graph.copy(), graph.copy()
    nx.add_path(one, range(half))
    nx.add_path(other, range(half, len(xy)))
    found = measure_deviations(*(gamms.osm.load.make_network_in_metres(part) for part in (one, other)))
    line = LineString(xy[half:])
    expected = [line.distance(Point(node)) for node in xy[:half]]
    assert sorted(found) == pytest.approx(sorted(expected), rel=1e-9, abs=1e-9)


def test_the_distance_to_a_straight_line_is_that_to_its_nearest_point_and_it_may_be_a_point():
    points = np.array([[2.0, 3.0], [-3.0, 4.0], [13.0, -4.0], [3.0, 4.0]])
    ends = np.array([[10.0, 0.0], [10.0, 0.0], [10.0, 0.0], [0.0, 0.0]])
    assert measure_distances(points, np.zeros((4, 2)), ends).tolist() == [3.0, 5.0, 5.0, 5.0]
    assert find_nearest_point(np.zeros((2, 2)), (3.0, 4.0)) == (0.0, 5.0)


def two_areas(order):
    """Relations: a closed area, and an open one that has its rim as a hole."""
    closed = '<member type="way" ref="101" role="outer"/><tag k="access" v="private"/>'
    opened = '<member type="way" ref="100" role="outer"/><member type="way" ref="101" role="inner"/>'
    parts = {7: closed, 8: opened}
    square = '<tag k="type" v="multipolygon"/><tag k="highway" v="pedestrian"/>'
    return "".join(f'<relation id="{id}">{parts[id]}{square}</relation>' for id in order)


@pytest.mark.parametrize("order", [(7, 8), (8, 7)])
@pytest.mark.parametrize("rim", [{}, {"highway": "footway", "access": "private"}])
def test_a_hole_of_an_open_area_is_not_closed_too(make_map, cross, order, rim):
    cross |= {5: (60.1690, 24.941), 6: (60.1700, 24.9405), 7: (60.1701, 24.941), 8: (60.1699, 24.941)}
    street = [3, 9], {"highway": "footway"}
    path = make_map({**cross, 9: (60.17, 24.945)}, ([1, 4, 3, 5, 1], {}), ([6, 7, 8, 6], rim), street)
    path.write_text(path.read_text().replace("</osm>", f"{two_areas(order)}</osm>"))
    found = report(graph_from_file(path, osm_type="walk", retain_all=True), path)
    assert found.closed == {}
    assert found.source_kept
    assert found.is_faithful


def long_streets(make_map):
    """Streets of more than 300 m between pairs of junctions, of which each becomes one junction at 10 m."""
    nodes, ways = {}, []
    for i in range(6):
        lat, lon = 60.17 + 0.0027 * (i % 2), 24.94 + 0.0054 * i
        nodes |= {10 * i: (lat, lon), 10 * i + 1: (lat, lon + 0.0001), 10 * i + 2: (lat + 0.0027, lon)}
        nodes[10 * i + 3] = lat - 0.0005, lon + 0.0001
        ways += [([10 * i, 10 * i + 1], ROAD), ([10 * i + 2, 10 * i], ROAD), ([10 * i + 1, 10 * i + 3], ROAD)]
        ways += [([10 * i + 1, 10 * i + 10], {**ROAD, "name": f"to {i + 1}"})] if i < 5 else []
    ways.append(([2, 51], {**ROAD, "oneway": "yes", "name": "one way"}))
    return make_map(nodes, *ways)


def lose_a_street(graph, of_street):
    graph.remove_edges_from([*of_street, *((v, u) for u, v in of_street)])


def lose_a_direction(graph, of_street):
    graph.remove_edges_from([(u, v) for u, v in of_street if u < v])


def lengthen(graph, of_street):
    for u, v in of_street:
        graph.edges[u, v]["length"] *= 1.2


def reconnect(graph, of_street):
    u, v = of_street[0]
    for here, there in ((u, v), (v, u)):
        data = dict(graph.edges[here, there])
        graph.remove_edge(here, there)
        ends = [max(graph) if node == v else node for node in (here, there)]
        graph.add_edge(*ends, **data)


@pytest.mark.parametrize("resolution", [10.0, 1e6])
@pytest.mark.parametrize("fault", [None, lose_a_street, lose_a_direction, lengthen, reconnect])
def test_a_fault_of_one_street_is_found_where_all_junctions_are_merged(make_map, resolution, fault):
    path = long_streets(make_map)
    graph = graph_from_file(path, resolution, osm_type="drive")
    assert graph.graph["merged_nodes"] > 0
    assert abs(graph.graph["merged_length"]) > 0.001 * report(graph, path).length_before
    street = [(u, v) for u, v, name in graph.edges(data="name") if name == "to 3"]
    metres = sum(graph.edges[edge]["length"] for edge in street) / 2.0
    assert metres > 250.0
    if fault is not None:
        fault(graph, street)
    assert report(graph, path).is_faithful == (fault is None)
    assert not report(graph, path, tolerance=1.0).length_kept


DIRECTED = {"highway": "secondary", "maxspeed:forward": "30", "maxspeed:backward": "70"}


def exchange(graph, edge):
    graph.edges[edge]["speed_kph"], graph.edges[edge[::-1]]["speed_kph"] = (70.0, 30.0)


@pytest.mark.parametrize(
    ("fault", "roads"),
    [
        (lambda graph, edge: None, 0),
        (lambda graph, edge: graph.edges[edge].update(speed_kph=31.0), 1),
        (lambda graph, edge: graph.edges[edge].update(speed_kph="30.0"), 0),
        (lambda graph, edge: graph.edges[edge].pop("speed_kph"), 0),
        (exchange, 2),
    ],
)
def test_an_edge_with_another_speed_than_its_direction_of_the_road_is_a_no(make_map, cross, fault, roads):
    file = make_map(cross, ([1, 2], DIRECTED), ([3, 2], DIRECTED), ([2, 4], ROAD))
    for options in ({"osm_type": "drive"}, {"bidirectional": False}, {"bidirectional": True}):
        graph = nx.DiGraph(graph_from_file(file, 1e6, **options))
        west = min(graph.edges, key=lambda edge: sum(graph.nodes[node]["x"] for node in edge))
        edge = west if graph.edges[west]["speed_kph"] == 30.0 else west[::-1]
        fault(graph, edge)
        found = report(graph, file)
        assert found.wrong_speeds == pytest.approx(roads * graph.edges[edge]["length"])
        assert found.speeds_kept == found.is_faithful == (roads == 0)
        assert dict(found.rows())["speeds"].startswith("NO: " if roads else "yes: 0.0 m")


def test_speeds_are_compared_if_the_mode_of_travel_is_known(make_map, cross):
    file = make_map(cross, ([1, 2], DIRECTED), ([2, 3], ROAD))
    with gamms.create_context(logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(graph_from_file(file, 10.0, osm_type="walk"))
        for mode, is_same in ((None, True), ("walk", True), ("bike", False)):
            assert report(ctx.graph, file, resolution=10.0, osm_type=mode).speeds_kept == is_same


def test_the_speeds_of_a_network_are_compared():
    network = nx.MultiDiGraph(crs="EPSG:32635")
    network.add_nodes_from([(0, {"x": 0.0, "y": 0.0}), (1, {"x": 100.0, "y": 0.0})])
    network.add_edge(0, 1, speed_kph="80")
    network.add_edge(1, 0, speed_kph="40")
    cut = nx.DiGraph(gamms.osm.process_osm_graph(network, 25.0, bidirectional=False))
    assert report(cut, network).is_faithful
    for *_, data in cut.edges(data=True):
        data["speed_kph"] = 80.0
    assert report(cut, network).wrong_speeds == pytest.approx(100.0)


@pytest.mark.parametrize("mode", [None, "drive"])
def test_a_context_keeps_its_promises_where_junctions_were_merged(mode):
    path = Path(__file__).parents[1] / "osm_online" / "data" / "kluuvi.osm.gz"
    with gamms.create_context(logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(graph_from_file(path, osm_type=mode))
        found = report(ctx.graph, path, resolution=10.0, osm_type=mode)
    assert found.nodes_merged > 0
    assert found.is_faithful, str(found)


@pytest.mark.parametrize(
    ("mode", "tolerance"),
    [*product([None, *gamms.osm.modes()], [None]), (None, 0.0), ("drive", 0.0), ("walk", 10.0)],
)
def test_a_real_map_keeps_its_promises_for_every_mode(mode, tolerance):
    path = Path(__file__).parents[1] / "osm_online" / "data" / "kluuvi.osm.gz"
    found = report(graph_from_file(path, osm_type=mode, tolerance=tolerance), path)
    assert found.is_faithful, str(found)
    assert found.length_error == pytest.approx(0.0, abs=1e-9)


def test_the_command_ends_with_1_after_a_no(town, monkeypatch):
    true_graph = graph_from_file
    monkeypatch.setattr(gamms.osm, "graph_from_file", lambda *given, **more: nx.DiGraph(true_graph(*given, **more)))
    arguments = ["osm", "report", str(town), "--json"]
    assert CliRunner().invoke(app, arguments).exit_code == 0

    def without_a_street(*given, **more):
        graph = nx.DiGraph(true_graph(*given, **more))
        lose_a_street(graph, [(u, v) for u, v, name in graph.edges(data="name") if name == "More"])
        return graph

    monkeypatch.setattr(gamms.osm, "graph_from_file", without_a_street)
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 1
    assert json.loads(result.output)["is_faithful"] is False


def test_a_graph_without_a_mode_is_compared_with_the_part_that_it_keeps(make_map, cross):
    """Agents may go against its one-way streets, so that every node is reached, whatever `strong` says."""
    ways = ([1, 2], {**ROAD, "oneway": "yes"}), ([2, 3], ROAD), ([2, 4], {**ROAD, "oneway": "yes"})
    file = make_map(cross, *ways)
    for strong in (True, False):
        for bidirectional in (True, False):
            graph = graph_from_file(file, 1e6, bidirectional, strong=strong)
            assert report(graph, file).is_faithful
