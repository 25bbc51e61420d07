"""Queries of several paths or places: k shortest paths, isochrones, the nearest of many, the nearest edge, matrices."""

import math
import pickle
from itertools import islice
from unittest import mock

import networkx as nx
import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

import gamms
from gamms.errors import BadType, BadValue, UnknownName
from gamms.graph import Graph, routes

NODES = 8
ROW = st.integers(0, NODES - 1)
EDGES = st.lists(st.tuples(ROW, ROW, st.integers(0, 9)), max_size=24)
PLACES = st.lists(st.tuples(st.integers(0, 3), st.integers(0, 3)), min_size=NODES, max_size=NODES)


def build(edges, places=((0, 0),) * NODES):
    graph, reference = Graph(), nx.DiGraph()
    graph.add_nodes(range(NODES), *np.transpose(places))
    reference.add_nodes_from(range(NODES))
    for id, (source, target, length) in enumerate(edges):
        graph.add_edge({"id": id, "source": source, "target": target, "length": length})
        known = reference.get_edge_data(source, target, {"length": length})["length"]
        reference.add_edge(source, target, length=min(length, known))
    return graph, reference


@pytest.fixture
def town():
    with gamms.create_context(seed=1) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(4, 5, spacing=100.0))
        yield ctx.graph


@given(edges=EDGES, k=st.integers(1, 12), source=ROW, target=ROW)
def test_k_shortest_paths_are_as_long_as_those_of_networkx(edges, k, source, target):
    graph, reference = build(edges)
    found = graph.routes.k_shortest_paths(source, target, k)
    assert len({tuple(path) for path in found}) == len(found)
    if not nx.has_path(reference, source, target):
        assert found == []
        return
    known = islice(nx.shortest_simple_paths(reference, source, target, weight="length"), k)
    lengths = [nx.path_weight(reference, path, "length") for path in found]
    assert lengths == [nx.path_weight(reference, path, "length") for path in known]
    assert all(len(set(path)) == len(path) and nx.is_path(reference, path) for path in found)
    assert found[0] == graph.shortest_path(source, target)


def test_k_shortest_paths_go_by_any_weight(town):
    assert town.routes.k_shortest_paths(0, 6, 3) == [[0, 1, 6], [0, 5, 6], [0, 1, 2, 7, 6]]
    for edge_id in town.graph.get_edges():
        if town.graph.get_edge(edge_id).source == 1:
            town.graph.update_edge({"id": edge_id, "toll": 9})
    assert town.routes.k_shortest_paths(0, 6, 1, weight="toll") == [[0, 5, 6]]
    assert town.routes.k_shortest_paths(3, 3, 4) == [[3]]
    with pytest.raises(BadValue, match="k must be at least 1"):
        town.routes.k_shortest_paths(0, 6, 0)
    with pytest.raises(UnknownName, match="99"):
        town.routes.k_shortest_paths(0, 99, 1)


@given(edges=EDGES, limits=st.lists(st.integers(0, 20), max_size=4), sources=st.lists(ROW, min_size=1, max_size=3))
def test_isochrones_hold_what_networkx_reaches_within_each_limit(edges, limits, sources):
    graph, reference = build(edges)
    far = nx.multi_source_dijkstra_path_length(reference, set(sources), weight="length")
    found = graph.routes.isochrones(sources, limits)
    assert [ids.tolist() for ids in found] == [sorted(id for id in far if far[id] <= limit) for limit in limits]


def test_a_node_that_is_not_there_has_no_distance_to_a_target_asked_for_before(town):
    assert town.graph.distance(0, 19) == 700.0
    with pytest.raises(UnknownName, match="99"):
        town.graph.distance(99, 19)


def test_isochrones_refuse_a_negative_limit(town):
    assert town.routes.isochrones(0, [100.0])[0].tolist() == [0, 1, 5]
    with pytest.raises(BadValue, match="limit"):
        town.routes.isochrones(0, [100.0, -1.0])


@given(
    edges=EDGES,
    places=PLACES,
    targets=st.lists(ROW, max_size=5),
    source=ROW,
    left=st.sampled_from([0, 1 << 30]),
)
def test_the_nearest_is_the_first_of_those_at_the_least_distance(edges, places, targets, source, left):
    graph, _ = build([(u, v, math.dist(places[u], places[v]) + length // 5) for u, v, length in edges], places)
    far = [graph.distance(source, target) for target in targets]
    known = targets[far.index(min(far))] if targets and min(far) < math.inf else None
    with mock.patch.object(routes.CachedRoutes, "_count_left", return_value=left):
        fresh, _ = build([(u, v, math.dist(places[u], places[v]) + length // 5) for u, v, length in edges], places)
        assert fresh.routes.nearest(source, targets) == known
        if known is not None:
            assert fresh.routes.nearest(source, targets, within=min(far)) == known
            assert fresh.routes.nearest(source, targets, within=min(far) / 2) == (known if min(far) == 0 else None)


NUMBER = st.floats(-50, 350)


@given(x=NUMBER, y=NUMBER, bend=st.lists(st.tuples(NUMBER, NUMBER), max_size=3))
def test_the_nearest_edge_is_that_of_shapely(x, y, bend):
    graph = Graph()
    graph.add_nodes(range(4), [0, 100, 100, 300], [0, 0, 200, 300])
    graph.add_edges([7, 5], [0, 1], [1, 2], lengths=[250.0, 200.0])
    shape = [(100, 200), *bend, (300, 300)]
    line = shapely.LineString(shape)
    graph.add_edge({"id": 2, "source": 2, "target": 3, "length": line.length, "linestring": shape})
    lines = {7: shapely.LineString([(0, 0), (100, 0)]), 5: shapely.LineString([(100, 0), (100, 200)]), 2: line}
    place = shapely.Point(x, y)
    edge_id, offset, distance = graph.routes.nearest_edge(x, y)
    assert distance == pytest.approx(lines[edge_id].distance(place), abs=1e-9)
    assert distance <= min(one.distance(place) for one in lines.values()) + 1e-6
    there = lines[edge_id].interpolate(offset / graph.get_edge(edge_id).length, normalized=True)
    assert there.distance(place) == pytest.approx(distance, abs=1e-6)


def test_without_edges_none_is_nearest():
    graph = Graph()
    assert graph.routes.nearest_edge(0, 0, within=5.0) is None
    with pytest.raises(BadValue, match="no edges"):
        graph.routes.nearest_edge(0, 0)
    with pytest.raises(BadType, match="x"):
        graph.routes.nearest_edge("0", 0)


def test_an_engine_with_the_defaults_of_the_contract_answers_alike(town):
    class Engine(type(town)):
        routes = gamms.graph.IGraphEngine.routes
        graph = property(lambda self: plain)

    class Plain(Graph):
        _get_routes = gamms.graph.IGraph._get_routes

    plain = Plain()
    plain.attach_networkx_graph(town.to_networkx())
    with gamms.create_context() as ctx:
        other = Engine(ctx).routes
        for ask in (
            lambda queries: queries.k_shortest_paths(0, 8, 4),
            lambda queries: queries.nearest(0, [19, 7, 11]),
            lambda queries: [ids.tolist() for ids in queries.isochrones([0, 9], [100, 200])],
            lambda queries: queries.nearest_edge(133, 77)[1:],
        ):
            assert ask(other) == ask(town.routes)


def test_routes_are_pickled_after_they_have_answered(town):
    far = town.graph.distances(source=0)
    assert pickle.loads(pickle.dumps(town.routes)).isochrones(0, [1e9])[0].tolist() == [*far]
