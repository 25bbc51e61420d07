"""Graphs as files of other programs, and as tables."""

import json
import sqlite3
import sys

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


def test_what_cannot_be_written_leaves_no_file(town, tmp_path):
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
