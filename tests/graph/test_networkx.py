"""The bridge to networkx: any of its graphs in, all or nothing; ours out, and the same again."""

import math
from types import SimpleNamespace

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import LineString, Point

from gamms.errors import BadValue
from gamms.graph import Graph

KINDS = [nx.Graph, nx.DiGraph, nx.MultiGraph, nx.MultiDiGraph]
BENT = [(0.0, 0.0), (0.0, 3.0), (4.0, 3.0)]


def square(kind):
    """Four places; a street around, and the last one without coordinates."""
    G = kind(crs="EPSG:32635", attribution="© us")
    G.add_nodes_from([(0, {"x": 0, "y": 0, "name": "a"}), (1, {"x": 4, "y": 3}), (2, {"x": 4.5, "y": 0.0}), (9, {})])
    G.add_edge(0, 1, geometry=LineString(BENT), lanes=2)
    G.add_edge(1, 2, length=7, highway=["a", "b"])
    G.add_edge(2, 2)
    return G


@pytest.mark.parametrize(
    "crs", ["EPSG:3857", 3857, "3857", "ESRI:54009", "EPSG:2263", {"proj": "merc", "datum": "WGS84"}, "an object"]
)
def test_a_graph_whose_lengths_are_not_metres_is_refused(any_ctx, crs):
    pyproj = pytest.importorskip("pyproj")
    G = nx.MultiDiGraph(crs=pyproj.CRS(3857) if crs == "an object" else crs)
    G.add_nodes_from([(0, {"x": 2_776_308.0, "y": 8_437_000.0}), (1, {"x": 2_777_308.0, "y": 8_437_000.0})])
    G.add_edge(0, 1)
    with pytest.raises(BadValue, match=r"(lengths are not metres|is in US survey foot).*process_osm_graph"):
        any_ctx.graph.attach_networkx_graph(G)
    assert len(any_ctx.graph.graph) == 0
    any_ctx.graph.graph.crs = "EPSG:3857"
    del G.graph["crs"]
    with pytest.raises(BadValue, match="metres"):
        any_ctx.graph.attach_networkx_graph(G)
    any_ctx.graph.graph.crs = None
    assert any_ctx.graph.attach_networkx_graph(G).get_edge(0).length == 1000.0


def test_the_crs_of_a_graph_may_be_a_number(any_ctx):
    for crs in (32635, "epsg:32635"):
        G = nx.DiGraph(crs=crs)
        G.add_node(crs, x=500_000.0, y=6_700_000.0)
        assert any_ctx.graph.attach_networkx_graph(G).crs == "EPSG:32635"


def edges_of(graph):
    edges = [graph.get_edge(id) for id in graph.get_edges()]
    return [(edge.source, edge.target, edge.length, edge.points) for edge in edges]


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_graph_is_attached(any_ctx, kind):
    graph = any_ctx.graph.attach_networkx_graph(square(kind))
    assert graph is any_ctx.graph.graph
    assert [graph.get_node(id) for id in graph.get_nodes()] == [(0, 0, 0), (1, 4, 3), (2, 4.5, 0), (9, 0, 0)]
    there = [
        (0, 1, 7.0, (0.0, 0.0, 0.0, 3.0, 4.0, 3.0)),
        (1, 2, 7.0, (4.0, 3.0, 4.5, 0.0)),
        (2, 2, 0.0, (4.5, 0.0, 4.5, 0.0)),
    ]
    back = [(1, 0, 7.0, (4.0, 3.0, 0.0, 3.0, 0.0, 0.0)), (2, 1, 7.0, (4.5, 0.0, 4.0, 3.0))]
    both = [there[0], back[0], there[1], back[1], there[2]]
    assert edges_of(graph) == (there if kind(()).is_directed() else both)
    assert list(graph.get_edges()) == list(range(len(edges_of(graph))))
    assert graph.node_attributes(0) == {"name": "a"}
    assert {tuple(graph.edge_attributes(id)) for id in graph.get_edges()} == {("lanes",), ("highway",), ()}
    assert (any_ctx.graph.crs, any_ctx.graph.attribution) == ("EPSG:32635", "© us")


def test_given_edge_ids_are_kept_and_missing_ones_are_free_ones(graph):
    graph.add_node({"id": 0, "x": 0.0, "y": 0.0})
    graph.add_edge({"id": 50, "source": 0, "target": 0, "length": 0.0})
    graph.attach_networkx_graph(nx.DiGraph([(1, 2, {"id": 70}), (2, 3, {}), (3, 1, {"id": -5}), (1, 3, {})]))
    ends = {id: tuple(graph.get_edge(id)[1:3]) for id in graph.get_edges()}
    assert ends == {50: (0, 0), 70: (1, 2), 71: (1, 3), 72: (2, 3), -5: (3, 1)}


def test_numpy_s_integers_are_ids_as_those_of_python(any_ctx):
    G = nx.relabel_nodes(nx.path_graph(3, nx.DiGraph), {i: np.int64(1000 * i) for i in range(3)})
    graph = any_ctx.graph.attach_networkx_graph(G)
    assert set(graph.get_nodes()) == {0, 1000, 2000}
    assert any_ctx.graph.networkx_labels() == {}


def test_labels_that_are_no_integers_are_mapped(any_ctx):
    G = nx.DiGraph([("a", (1, "b")), ((1, "b"), 4), (4, 2.5)])
    graph = any_ctx.graph.attach_networkx_graph(G)
    labels = any_ctx.graph.networkx_labels()
    assert labels == {"a": 5, (1, "b"): 6, 2.5: 7}
    assert set(graph.get_nodes()) == {4, 5, 6, 7}
    assert [row[:2] for row in edges_of(graph)] == [(5, 6), (6, 4), (4, 7)]
    graph.remove_node(5)
    assert any_ctx.graph.networkx_labels() == {(1, "b"): 6, 2.5: 7}


def test_a_label_that_only_looks_like_its_id_is_still_a_label(ctx):
    ctx.graph.attach_networkx_graph(nx.DiGraph([(0, 1.0)]))
    assert ctx.graph.networkx_labels() == {1.0: 1}


def test_labels_avoid_the_ids_that_are_taken(ctx, graph):
    graph.add_node({"id": 10, "x": 0.0, "y": 0.0})
    ctx.graph.attach_networkx_graph(nx.Graph([("a", "b")]))
    assert ctx.graph.networkx_labels() == {"a": 11, "b": 12}


@pytest.mark.parametrize("key", ["linestring", "geometry"])
@pytest.mark.parametrize(
    "line", [BENT, LineString(BENT), [list(point) for point in BENT]], ids=["tuples", "shapely", "lists"]
)
@pytest.mark.parametrize("kind", [nx.Graph, nx.DiGraph])
def test_a_shape_may_be_a_linestring_or_a_list(graph, key, line, kind):
    G = kind([(0, 1, {key: line})])
    graph.attach_networkx_graph(G)
    assert graph.get_edge(0).points == (0.0, 0.0, 0.0, 3.0, 4.0, 3.0)
    assert graph.get_edge(0).length == 7.0
    if not G.is_directed():
        assert graph.get_edge(1).points == (4.0, 3.0, 0.0, 3.0, 0.0, 0.0)


def test_a_linestring_wins_over_a_geometry(graph):
    graph.attach_networkx_graph(nx.DiGraph([(0, 1, {"linestring": BENT, "geometry": LineString([(0, 0), (9, 9)])})]))
    assert graph.get_edge(0).points == (0.0, 0.0, 0.0, 3.0, 4.0, 3.0)
    assert graph.edge_attributes(0) == {}


def test_the_callers_graph_is_not_changed(graph):
    G = square(nx.MultiGraph)
    before = (dict(G.graph), list(G.nodes(data=True)), list(G.edges(data=True)))
    before_text = repr(before)
    graph.attach_networkx_graph(G)
    assert repr((dict(G.graph), list(G.nodes(data=True)), list(G.edges(data=True)))) == before_text


def faulty(nodes=(), edges=()):
    G = nx.MultiDiGraph()
    G.add_nodes_from([(100, {}), (101, {}), *nodes])
    G.add_edges_from([(100, 101, {}), *edges])
    return G


FAULTS = {
    "nothing": (None, TypeError),
    "no graph": ({1: 2}, TypeError),
    "a taken node": (faulty([(1, {})]), KeyError),
    "a taken edge": (faulty(edges=[(100, 101, {"id": 1})]), KeyError),
    "an edge id twice": (faulty(edges=[(100, 101, {"id": 60}), (100, 101, {"id": 60})]), KeyError),
    "an edge id that is text": (faulty(edges=[(100, 101, {"id": "60"})]), TypeError),
    "a coordinate that is text": (faulty([(102, {"x": "1"})]), TypeError),
    "a coordinate that is not finite": (faulty([(102, {"y": math.nan})]), ValueError),
    "a negative length": (faulty(edges=[(100, 101, {"length": -1})]), ValueError),
    "a length that is text": (faulty(edges=[(100, 101, {"length": "far"})]), TypeError),
    "a geometry of another kind": (faulty(edges=[(100, 101, {"geometry": Point(1, 1)})]), ValueError),
    "an empty geometry": (faulty(edges=[(100, 101, {"geometry": LineString()})]), ValueError),
    "a linestring of one point": (faulty(edges=[(100, 101, {"linestring": [(0, 0)]})]), ValueError),
    "a linestring that is not finite": (
        faulty(edges=[(100, 101, {"linestring": LineString([(0, 0), (math.inf, 1)])})]),
        ValueError,
    ),
    "a node beyond the last id": (faulty([(2**63 - 1, {}), ("one more", {})]), Exception),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_graph_that_cannot_be_attached_changes_nothing(any_ctx, fill, everything, fault):
    G, cause = FAULTS[fault]
    graph = fill(any_ctx)
    before = (everything(any_ctx), graph.revision)
    with pytest.raises(BadValue, match=r"^Failed to attach NetworkX graph: .") as caught:
        any_ctx.graph.attach_networkx_graph(G)
    assert isinstance(caught.value.__cause__, cause)
    assert (everything(any_ctx), graph.revision) == before


def test_attaching_twice_fails_where_ids_overlap(any_ctx, everything):
    any_ctx.graph.attach_networkx_graph(square(nx.DiGraph))
    before = everything(any_ctx)
    with pytest.raises(ValueError, match="Failed to attach"):
        any_ctx.graph.attach_networkx_graph(square(nx.DiGraph))
    assert everything(any_ctx) == before


def test_an_empty_graph_adds_nothing(any_ctx, everything):
    before = everything(any_ctx)
    any_ctx.graph.attach_networkx_graph(nx.Graph())
    assert everything(any_ctx) == before


small = st.integers(-3, 3).map(float)
names = st.dictionaries(st.sampled_from(["name", "lanes", "self", "key", "u_of_edge"]), st.integers(), max_size=2)


@st.composite
def graphs(draw):
    graph = Graph()
    ids = draw(st.lists(st.integers(-5, 20), min_size=1, max_size=6, unique=True))
    for id in ids:
        graph.add_node(draw(names) | {"id": id, "x": draw(small), "y": draw(small)})
    for id in draw(st.lists(st.integers(-5, 50), max_size=8, unique=True)):
        line = draw(st.none() | st.lists(st.tuples(small, small), min_size=2, max_size=4))
        ends = {"source": draw(st.sampled_from(ids)), "target": draw(st.sampled_from(ids))}
        graph.add_edge(draw(names) | ends | {"id": id, "length": abs(draw(small)), "linestring": line})
    return graph


@given(graph=graphs())
@settings(max_examples=16)
def test_to_networkx_and_back_is_the_same_graph(graph):
    back = Graph()
    back.attach_networkx_graph(graph.to_networkx())
    assert [back.get_node(id) for id in back.get_nodes()] == [graph.get_node(id) for id in graph.get_nodes()]
    assert {id: back.get_edge(id) for id in back.get_edges()} == {id: graph.get_edge(id) for id in graph.get_edges()}
    assert [back.node_attributes(id) for id in back.get_nodes()] == [
        graph.node_attributes(id) for id in graph.get_nodes()
    ]
    assert all(back.edge_attributes(id) == graph.edge_attributes(id) for id in graph.get_edges())


def test_a_graph_in_another_crs_is_refused(ctx):
    first, second = nx.DiGraph(crs="EPSG:32635"), nx.DiGraph(crs="EPSG:4326")
    first.add_node(1, x=0.0, y=0.0)
    second.add_node(2, x=25.0, y=60.0)
    ctx.graph.attach_networkx_graph(first)
    with pytest.raises(BadValue, match="its CRS is EPSG:4326, but the graph has EPSG:32635"):
        ctx.graph.attach_networkx_graph(second)
    assert (list(ctx.graph.graph.get_nodes()), ctx.graph.crs) == ([1], "EPSG:32635")


def test_a_graph_without_coordinates_is_warned_about(ctx):
    heard = []
    verbs = ("debug", "info", "warning", "error", "critical", "setLevel")
    ctx.logger = SimpleNamespace(**dict.fromkeys(verbs, heard.append))
    ctx.graph.attach_networkx_graph(nx.grid_2d_graph(3, 3))
    assert "None of the 9 nodes has an x or y" in heard[0]
