"""Graphs as files of other programs, and as tables."""

import json
import sqlite3
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree as ET

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gamms
from gamms.errors import BadType, BadValue, MissingExtra, MissingFolder, UnknownType

QUIET = {"level": "CRITICAL"}


@pytest.fixture
def town():
    """Three nodes near Helsinki; a bent street there and back, two parallel ones, and all kinds of attributes."""
    with gamms.create_context(logger_config=QUIET) as ctx:
        graph = ctx.graph.graph
        graph.crs, graph.attribution = "EPSG:32635", '© Öpen <Maps> & "friends"'
        ctx.graph.add_nodes([5, 6, 7], [385_000, 385_100, 385_100.5], [6_672_000, 6_672_000, 6_672_050.25])
        graph.update_node({"id": 5, "signal": True, "note": 'a "quoted", <text> & \x07 bell'})
        bend = [(385_000, 6_672_000), (385_050, 6_672_020), (385_100, 6_672_000)]
        ways = [(5, 6, {"linestring": bend, "name": "Höhe"}), (6, 5, {"linestring": bend[::-1], "Name": ["a", "b"]})]
        ways += [(6, 7, {"lanes": 2, "big": 2**70}), (6, 7, {"lanes": 2.5, "id_": None, "geom": {"x": {1}}})]
        for id, (source, target, data) in enumerate(ways, 10):
            graph.add_edge({"id": id, "source": source, "target": target, "length": id + 0.125, **data})
        yield ctx


def edges_of(ctx):
    return [ctx.graph.graph.get_edge(id) for id in ctx.graph.graph.get_edges()]


def test_geojson_holds_nodes_and_edges_in_degrees(town, tmp_path):
    (file,) = town.graph.export(tmp_path / "town.geojson")
    found = json.loads(file.read_text(encoding="utf-8"))
    assert found["attribution"] == town.graph.attribution
    kinds = [feature["geometry"]["type"] for feature in found["features"]]
    assert kinds == ["Point"] * 3 + ["LineString"] * 4
    street = found["features"][3]
    assert (street["properties"]["id"], street["properties"]["name_2"]) == (10, "Höhe")
    lon, lat = np.array(street["geometry"]["coordinates"]).T
    x, y = town.graph.from_latlon(lat=lat, lon=lon)
    assert np.abs(np.column_stack((x, y)) - town.graph.columns().polylines[0]).max() < 1e-3
    ends = [found["features"][row]["geometry"]["coordinates"] for row in (0, 1)]
    assert [street["geometry"]["coordinates"][at] for at in (0, -1)] == ends
    again = gamms.osm.graph_from_geojson(file, simplify=False, bidirectional=False, resolution=1e6)
    assert len(again) >= 3


def test_a_graph_without_a_crs_has_map_units_only(tmp_path):
    with gamms.create_context(logger_config=QUIET) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(2, 2))
        with pytest.raises(BadValue, match=r"set ctx\.graph\.graph\.crs"):
            ctx.graph.export(tmp_path / "grid.geojson")
        for suffix in (".csv", ".gpkg", ".graphml"):
            ctx.graph.export(tmp_path / f"grid{suffix}")
        assert (tmp_path / "grid_nodes.csv").read_text().splitlines()[:2] == ["id,x,y", "0,0.0,0.0"]
        database = sqlite3.connect(tmp_path / "grid.gpkg")
        assert database.execute("SELECT DISTINCT srs_id FROM gpkg_geometry_columns").fetchall() == [(-1,)]
        database.close()
        assert not (tmp_path / "grid.geojson").exists()


def test_a_failed_write_leaves_no_file(town, tmp_path):
    for name, error, hint in [("a.graphm", UnknownType, "Did you mean '.graphml'"), ("a", UnknownType, "without a")]:
        with pytest.raises(error, match=hint):
            town.graph.export(tmp_path / name)
    with pytest.raises(MissingFolder):
        town.graph.export(tmp_path / "there" / "a.csv")
    with pytest.raises(BadType):
        town.graph.export(7)
    (tmp_path / "old.gpkg").write_text("old")
    for number in range(2_000):
        town.graph.graph.update_node({"id": 5, f"a{number}": 1})
    with pytest.raises(BadValue, match="at most 1900"):
        town.graph.export(tmp_path / "old.gpkg")
    assert [(file.name, file.read_text()) for file in tmp_path.iterdir()] == [("old.gpkg", "old")]


def test_graphml_keeps_names_that_have_signs_of_xml(town, tmp_path):
    name = "a & 'b' <\t\"c\">"
    town.graph.graph.update_node({"id": 5, name: "x & y"})
    town.graph.export(tmp_path / "a.graphml")
    assert nx.read_graphml(tmp_path / "a.graphml", node_type=int).nodes[5][name] == "x & y"


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text() | st.binary(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text() | st.integers(), inner, max_size=3),
    max_leaves=5,
)


@given(st.dictionaries(st.text(min_size=1), VALUES, max_size=4))
@settings(max_examples=12)
def test_any_attributes_can_be_written(tmp_path_factory, attributes):
    folder = tmp_path_factory.mktemp("out")
    attributes = {name: value for name, value in attributes.items() if name not in ("id", "x", "y")}
    with gamms.create_context(logger_config=QUIET) as ctx:
        ctx.graph.graph.crs = "EPSG:32635"
        ctx.graph.graph.add_node({"id": 1, "x": 385_000, "y": 6_672_000, **attributes})
        for suffix in (".csv", ".gpkg", ".graphml", ".geojson"):
            ctx.graph.export(folder / f"a{suffix}")
    assert len(json.loads((folder / "a.geojson").read_text(encoding="utf-8"))["features"]) == 1
    assert len(nx.read_graphml(folder / "a.graphml")) == 1
    database = sqlite3.connect(folder / "a.gpkg")
    assert database.execute("SELECT id FROM nodes").fetchall() == [(1,)]
    database.close()


# -- other libraries ----------------------------------------------------------------------------------------------


def test_writers_of_networkx_take_a_plain_graph(town, tmp_path):
    plain = town.graph.to_networkx(plain=True)
    nx.write_graphml(plain, tmp_path / "a.graphml")
    nx.write_gexf(plain, tmp_path / "a.gexf")
    json.dumps(nx.node_link_data(plain, edges="edges"))
    with gamms.create_context(logger_config=QUIET) as ctx:
        ctx.graph.attach_networkx_graph(plain)
        assert sorted(edges_of(ctx)) == sorted(edges_of(town))


def test_text_that_is_no_line_is_refused(town):
    for text in ("nonsense", "POINT (1 2)", "LINESTRING EMPTY", "LINESTRING (0 0, nan 1)"):
        with pytest.raises(BadValue, match="linestring of edge 10"):
            town.graph.graph.update_edge({"id": 10, "linestring": text})


def test_frames_of_arrays_and_pandas(town):
    nodes = town.graph.frames.arrays("nodes")
    assert nodes["id"].tolist() == [5, 6, 7]
    assert nodes["lat"].dtype == np.float64
    with pytest.raises(BadType, match="'nodes' and 'edges'"):
        town.graph.frames.arrays("ways")
    pytest.importorskip("pandas")
    nodes, edges = town.graph.frames.to_pandas()
    assert edges.source.tolist() == [5, 6, 6, 6]
    assert nodes.signal.tolist() == [True, None, None]


@pytest.mark.parametrize("library", ["pandas", "polars", "igraph"])
def test_a_library_that_is_absent_is_named(town, monkeypatch, library):
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(MissingExtra, match=f"{library}.*pip install"):
        getattr(town.graph.frames, f"to_{library}")()


# -- SUMO and OSMnx -----------------------------------------------------------------------------------------------


@pytest.fixture
def streets(town):
    """The same town with speeds, one-way streets and a loop."""
    graph = town.graph.graph
    for id, kph in ((10, 30.0), (11, 50), (12, "fast"), (13, 20.0)):
        graph.update_edge({"id": id, "speed_kph": kph, "highway": "residential"})
    graph.add_edge({"id": 20, "source": 7, "target": 7, "length": 42.5, "osmid": [3, 4], "oneway": False})
    return town


def read_net(path):
    root = ET.parse(path).getroot()
    lanes = {edge.get("id"): edge.find("lane").attrib for edge in root.iter("edge")}
    return root, lanes


def test_a_network_of_sumo_has_the_lengths_speeds_and_shapes_of_the_graph(streets, tmp_path):
    (file,) = streets.graph.export(tmp_path / "Town.NET.XML")
    root, lanes = read_net(file)
    columns = streets.graph.columns()
    assert [float(lanes[str(id)]["length"]) for id in columns.edge_ids] == columns.lengths.tolist()
    speeds = [float(lane["speed"]) * 3.6 for lane in lanes.values()]
    assert speeds == pytest.approx([30, 50, 50, 20, 50], abs=1e-12)
    location = root.find("location").attrib
    offset = np.array([*map(float, location["netOffset"].split(","))])
    assert location["projParameter"] == "+proj=utm +zone=35 +ellps=WGS84 +datum=WGS84 +units=m +no_defs"
    line = np.array([[*map(float, point.split(","))] for point in lanes["10"]["shape"].split()]) - offset
    assert line.tolist() == columns.polylines[0].tolist()
    nodes = {one.get("id"): (float(one.get("x")), float(one.get("y"))) for one in root.iter("junction")}
    assert np.array([nodes[str(id)] for id in columns.node_ids]) - offset == pytest.approx(columns.xy, abs=1e-9)


def test_a_network_of_sumo_connects_each_edge_with_all_that_begin_at_its_end(streets, tmp_path):
    root, _ = read_net(streets.graph.export(tmp_path / "town.net.xml")[0])
    found = {(one.get("from"), one.get("to")): one.get("dir") for one in root.iter("connection")}
    edges = {edge.id: edge for edge in edges_of(streets)}
    pairs = [(str(a), str(b)) for a in edges for b in edges if edges[a].target == edges[b].source]
    assert sorted(found) == sorted(pairs)
    assert [found["10", id] for id in ("11", "12")] == ["t", "l"]
    dead_ends = {one.get("id") for one in root.iter("junction") if one.get("type") == "dead_end"}
    assert dead_ends == {node for node in ("5", "6", "7") if node not in {str(one.target) for one in edges.values()}}


@pytest.mark.parametrize("speed", [10**400, float("nan"), float("inf"), -5, 0, True, "50", None])
def test_a_network_of_sumo_has_the_usual_speed_where_that_of_an_edge_is_none(tmp_path, speed):
    with gamms.create_context() as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 2))
        ctx.graph.update_edge({"id": 0, "speed_kph": speed})
        _, lanes = read_net(*ctx.graph.export(tmp_path / "town.net.xml"))
        assert float(lanes["0"]["speed"]) == 50 / 3.6


def test_a_network_of_sumo_without_a_crs_says_so(tmp_path):
    with gamms.create_context(logger_config=QUIET) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(2, 2))
        root, lanes = read_net(ctx.graph.export(tmp_path / "grid.net.xml")[0])
    assert root.find("location").get("projParameter") == "!"
    assert len(lanes) == 8


def test_a_file_for_osmnx_has_the_attributes_that_its_reader_converts(streets, tmp_path):
    (file,) = streets.graph.export(tmp_path / "town.osmnx.graphml")
    graph = nx.read_graphml(file, node_type=int, force_multigraph=True)
    values = [*graph.nodes.values(), *(data for *_, data in graph.edges(data=True))]
    assert all(isinstance(value, str) for data in values for value in data.values())
    assert (graph.graph["crs"], graph.graph["simplified"]) == ("epsg:4326", "True")
    assert sorted(graph.edges(keys=True)) == [(5, 6, 0), (6, 5, 0), (6, 7, 0), (6, 7, 1), (7, 7, 0)]
    lat, lon = streets.graph.to_latlon(385_100.5, 6_672_050.25)
    assert [float(graph.nodes[7][axis]) for axis in ("y", "x")] == pytest.approx([lat, lon], abs=1e-9)
    assert [graph.nodes[node]["street_count"] for node in (5, 6, 7)] == ["1", "3", "4"]
    street, loop = graph.edges[5, 6, 0], graph.edges[7, 7, 0]
    found = [street[name] for name in ("length", "speed_kph", "oneway", "reversed")]
    assert found == ["10.125", "30.0", "False", "False"]
    assert street["geometry"].startswith("LINESTRING (24.9")
    assert (loop["osmid"], loop["oneway"], street["osmid"]) == ("[3, 4]", "False", "10")
    assert "geometry" not in loop
    assert "speed_kph" not in graph.edges[6, 7, 0]  # 'fast' is no number
    with pytest.raises(BadValue, match="OSMnx needs degrees"), gamms.create_context(logger_config=QUIET) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(2, 2))
        ctx.graph.export(tmp_path / "grid.osmnx.graphml")


def test_osmnx_opens_the_file_of_helsinki(tmp_path):
    osmnx = pytest.importorskip("osmnx")
    with gamms.create_context(logger_config=QUIET) as ctx:
        gamms.osm.helsinki(ctx)
        graph = osmnx.load_graphml(ctx.graph.export(tmp_path / "town.osmnx.graphml")[0])
        columns = ctx.graph.columns()
    found = sorted((u, v, data["length"], data["travel_time"]) for u, v, data in graph.edges(data=True))
    ends = zip(columns.node_ids[columns.sources].tolist(), columns.node_ids[columns.targets].tolist(), strict=True)
    times = columns.edge_attributes["travel_time"]
    lengths = enumerate(columns.lengths.tolist())
    assert found == sorted((*pair, length, times[row]) for pair, (row, length) in zip(ends, lengths, strict=True))
    assert dict(graph.nodes(data="street_count")) == osmnx.stats.count_streets_per_node(graph)
    assert osmnx.project_graph(graph).graph["crs"] == "EPSG:32635"


def test_sumo_drives_the_lengths_of_the_graph(streets, tmp_path):
    home = Path(pytest.importorskip("sumo").SUMO_HOME)
    (net,) = streets.graph.export(tmp_path / "town.net.xml")
    drives = tmp_path / "drives.rou.xml"
    drives.write_text(
        '<routes><vehicle id="a" depart="0" departPos="0"><route edges="11 10 13 20"/></vehicle></routes>'
    )
    trips = tmp_path / "trips.xml"
    options = ["--no-step-log", "--tripinfo-output", str(trips)]
    subprocess.run([home / "bin" / "sumo", "-n", net, "-r", drives, *options], check=True)
    (trip,) = ET.parse(trips).getroot()
    assert float(trip.get("routeLength")) == pytest.approx(11.125 + 10.125 + 13.125 + 42.5, abs=0.01)
