"""Graphs from elsewhere, such as OSMnx, cut in the same way."""

import itertools
import math

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely import LineString

import gamms
from gamms.errors import BadType, BadValue
from gamms.ir.projection import measure_on_ellipsoid
from gamms.osm import consolidate, load, obstacle_from_file, process_osm_graph, resample_columns


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


PLACES = {"Helsinki": (24.94, 60.17), "Quito": (-78.5, -0.2), "Hobart": (147.3, -42.9), "Alta": (23.3, 69.97)}


def drawn(place, crs, **data):
    """Return a street of two pieces in a CRS, with true lengths of about 1.1 km in all."""
    pyproj = pytest.importorskip("pyproj")
    lon, lat = PLACES[place]
    lonlat = np.array([(lon, lat), (lon + 0.01, lat), (lon + 0.01, lat + 0.005)])
    known = pyproj.CRS.from_user_input(crs)
    xy = np.column_stack(pyproj.Transformer.from_crs("EPSG:4326", known, always_xy=True).transform(*lonlat.T))
    graph = nx.MultiDiGraph(crs=crs)
    graph.add_nodes_from((node, {"x": x, "y": y}) for node, (x, y) in enumerate(xy.tolist()))
    graph.add_edge(0, 2, geometry=LineString(xy), **data)
    return graph, float(measure_on_ellipsoid(lonlat[:-1], lonlat[1:]).sum())


FALSE_METRES = ["EPSG:3857", 3857, "EPSG:3395", "ESRI:54009", "EPSG:6933", "EPSG:3035"]


@pytest.mark.parametrize(("place", "crs"), [("Helsinki", "EPSG:32640"), *itertools.product(PLACES, FALSE_METRES)])
def test_metres_are_those_of_the_ground_in_every_crs(place, crs):
    graph, length = drawn(place, crs)
    cut = process_osm_graph(graph, resolution=50.0, bidirectional=False)
    assert total_length(cut) == pytest.approx(length, rel=0.01)
    assert sum(line.length for *_, line in cut.edges(data="linestring")) == pytest.approx(length, rel=0.01)
    for _, _, data in cut.edges(data=True):
        assert data["travel_time"] == pytest.approx(data["length"] / data["speed_kph"] * 3.6)
    merged = gamms.osm.consolidate(graph, 0.0)
    assert total_length(merged) == pytest.approx(length, rel=0.01)
    with gamms.create_context() as ctx:
        ctx.graph.attach_networkx_graph(cut)
        x, y = cut.nodes[0]["x"], cut.nodes[0]["y"]
        assert ctx.graph.to_latlon(x, y) == pytest.approx(PLACES[place][::-1], abs=1e-6)


def test_a_crs_may_be_an_object_of_pyproj():
    pyproj = pytest.importorskip("pyproj")
    graph, length = drawn("Helsinki", pyproj.CRS.from_epsg(3857))
    cut = process_osm_graph(graph, resolution=50.0, bidirectional=False)
    assert (cut.graph["crs"], total_length(cut)) == ("EPSG:32635", pytest.approx(length, rel=1e-6))


def test_a_length_that_is_measured_in_false_metres_is_not_one():
    graph, length = drawn("Helsinki", "EPSG:3857")
    planar = graph.edges[0, 2, 0]["geometry"].length
    for said, wanted in ((planar, length), (1234.5, 1234.5)):
        graph.edges[0, 2, 0]["length"] = said
        cut = process_osm_graph(graph, resolution=1e6, bidirectional=False)
        assert total_length(cut) == pytest.approx(wanted, rel=1e-6)


def test_columns_in_false_metres_are_projected(caplog):
    graph, length = drawn("Helsinki", "EPSG:3857")
    del graph.graph["crs"]
    with gamms.create_context(logger_config={"level": "ERROR"}) as ctx:
        ctx.graph.attach_networkx_graph(graph)
        ctx.graph.graph.crs = "EPSG:3857"
        cut = resample_columns(ctx.graph.columns(), 50.0)
    assert cut.graph["crs"] == "EPSG:32635"
    assert total_length(cut) == pytest.approx(2.0 * length, rel=1e-6)


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


def cut_street(there, back=None):
    """Return the attributes of the edges of a bent street, there and back, after cutting it into two pieces."""
    graph = street(crs="EPSG:32635")
    graph.edges[0, 1, 0].update(there)
    graph.edges[1, 0, 0].update(there if back is None else back)
    cut = process_osm_graph(graph, resolution=36.0, bidirectional=False)
    assert list(cut.edges) == [(0, 1), (1, 0), (1, 2), (2, 1)]
    return cut.edges[0, 1], cut.edges[1, 0]


def test_numbers_and_truths_may_be_text_as_in_graphml():
    data, _ = cut_street({"speed_kph": " 80.0", "travel_time": "4.5", "length": "90", "oneway": "False"})
    assert (data["speed_kph"], data["travel_time"], data["length"], data["oneway"]) == (80.0, 2.25, 45.0, False)


@pytest.mark.parametrize(
    "truth", [True, "True", "true", " YES ", "y", 1, 1.0, "1", "1.0", "-1", np.True_, [True, False]]
)
def test_a_truth_is_read_as_such(truth):
    assert cut_street({"oneway": truth})[0]["oneway"] is True


@pytest.mark.parametrize("truth", [False, "False", "no", "f", 0, 0.0, "0", np.False_, "[False, False]", "reversible"])
def test_a_falsehood_is_read_as_such(truth):
    assert cut_street({"oneway": truth})[0]["oneway"] is False


@pytest.mark.parametrize("missing", [None, "", "nan", "None", math.nan, "<NA>"])
def test_a_missing_value_counts_as_left_out(missing):
    data, _ = cut_street({"oneway": missing, "speed_kph": missing, "travel_time": missing, "maxspeed": "36"})
    assert data["speed_kph"] == 36.0
    assert data["travel_time"] == pytest.approx(3.625)
    assert "oneway" not in data


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("speed_kph", value) for value in ("fast", "80 km/h", 0, -5.0, "-5", math.inf, True, [], ["50", "fast"], {})),
        *(("travel_time", value) for value in ("4,5", -1.0, "inf", False, [1.0, 2.0], "[1.0, 2.0]", object())),
        *(("oneway", value) for value in ("perhaps", 2, [], "[]", {}, "FTF", object())),
        *(("length", value) for value in ("12.5 m", "40 ft", True, [10.0], "[10.0]")),
    ],
)
def test_an_edge_with_an_impossible_value_is_named(name, value):
    with pytest.raises(BadValue, match=rf"^Edge \(0, 1\) has the {name} .*Give "):
        cut_street({name: value})


def test_several_speeds_and_signs_give_their_mean_also_as_text():
    for several in (["50", "30"], [50, 30], "['50', '30']", "[50.0, 30.0]"):
        for name in ("speed_kph", "maxspeed"):
            assert cut_street({name: several})[0]["speed_kph"] == 40.0
    assert cut_street({"highway": "['steps', 'primary']"})[0]["speed_kph"] == 2.0


def test_each_direction_keeps_its_own_attributes():
    there, back = cut_street(
        {"speed_kph": 30, "travel_time": 9.0, "name": "A"}, {"speed_kph": "70", "travel_time": "4", "name": "B"}
    )
    assert [(data["speed_kph"], data["travel_time"], data["name"]) for data in (there, back)] == [
        (30.0, 4.5, "A"),
        (70.0, 2.0, "B"),
    ]


def test_signs_of_one_direction_follow_the_direction_of_the_way():
    signs = {"maxspeed:forward": "30", "maxspeed:backward": "70", "maxspeed": "50"}
    for is_text in (False, True):
        back = {"reversed": "True" if is_text else True}
        assert [data["maxspeed"] for data in cut_street(signs, signs | back)] == ["30", "70"]
    with pytest.raises(BadValue, match="'perhaps' for 'reversed'"):
        cut_street(signs | {"reversed": "perhaps"})


def as_graphml(graph):
    """Return a graph as programs read it that OSMnx has written to GraphML: all of its values are text."""
    text = nx.MultiDiGraph(**{name: str(value) for name, value in graph.graph.items()})
    text.add_nodes_from(
        (str(node), {name: str(value) for name, value in data.items()}) for node, data in graph.nodes.items()
    )
    for u, v, data in graph.edges(data=True):
        text.add_edge(str(u), str(v), **{name: getattr(value, "wkt", str(value)) for name, value in data.items()})
    return nx.parse_graphml("\n".join(nx.generate_graphml(text)))


VALUES = st.fixed_dictionaries(
    {},
    optional={
        "speed_kph": st.sampled_from([80, 12.5, [30.0, 50.0]]),
        "travel_time": st.sampled_from([4.5, 0]),
        "oneway": st.sampled_from([True, False, [True, False], None]),
        "maxspeed": st.sampled_from(["50", "30 mph", ["50", "30"], "none"]),
        "highway": st.sampled_from(["primary", ["steps", "path"]]),
        "reversed": st.booleans(),
        "maxspeed:forward": st.sampled_from(["20", "40"]),
    },
)


@given(there=VALUES, back=VALUES)
def test_a_graph_in_graphml_is_the_same_graph(there, back):
    graph = street(crs="EPSG:32635")
    graph.edges[0, 1, 0].update(there)
    graph.edges[1, 0, 0].update(back)
    names = ("id", "length", "speed_kph", "travel_time", "oneway")
    cuts = [process_osm_graph(one, 36.0, bidirectional=False) for one in (graph, as_graphml(graph))]
    found = [[(u, v, *(data.get(name) for name in names)) for u, v, data in cut.edges(data=True)] for cut in cuts]
    assert found[0] == found[1]


def test_columns_may_have_truths_as_text():
    graph = nx.DiGraph([(0, 1, {"oneway": "False"}), (1, 2, {"oneway": "True", "speed_kph": "36"})])
    nx.set_node_attributes(graph, {node: {"x": 100.0 * node, "y": 0.0} for node in graph})
    with gamms.create_context() as ctx:
        ctx.graph.attach_networkx_graph(graph)
        cut = resample_columns(ctx.graph.columns(), 50.0, bidirectional=False)
        assert cut.number_of_edges() == 6
        assert cut.edges[2, 3]["travel_time"] == pytest.approx(5.0)
        ctx.graph.update_edge({"id": 1, "oneway": "perhaps"})
        with pytest.raises(BadValue, match="Edge 1 has the oneway 'perhaps'"):
            resample_columns(ctx.graph.columns(), 50.0)


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
