"""A path between near nodes is searched for near them, and is the path that the whole table gives."""

import math
from unittest import mock

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gamms.errors import BadValue, NoPath
from gamms.graph import Graph, routes

NODES = 12
ROW = st.integers(0, NODES - 1)
PLACES = st.lists(st.tuples(st.integers(0, 3), st.integers(0, 3)), min_size=NODES, max_size=NODES)
# How much longer than the straight line: equally long ways, ways that rounding makes equal, and shorter ones.
DETOURS = st.sampled_from([1.0, 1.0, 1.0, 1.5, 2.0, 0.1, 0.0, 1.0 + 1e-16, 1e16, 1e-300])
EDGES = st.lists(st.tuples(ROW, ROW, DETOURS, st.sampled_from([None, 0, 0.1, 0.2, 0.3, math.inf])), max_size=40)
WEIGHTS = st.sampled_from(["length", "toll", None])


def searched(routes, goal):
    """Let searches visit any number of nodes."""
    return 1 << 30


def tables(routes, goal):
    """Let searches visit no node, so that tables are made."""
    return 0


def answers(places, edges, weight, share):
    """Return the path and the distance between all nodes."""
    graph = Graph()
    ids = (np.arange(NODES) * 7 + 3) % NODES
    graph.add_nodes(ids, *np.transpose(places))
    for id, (source, target, detour, toll) in enumerate(edges):
        length = math.dist(places[source], places[target]) * detour
        edge = {"id": id, "source": int(ids[source]), "target": int(ids[target]), "length": length}
        graph.add_edge(edge if toll is None and id else {**edge, "toll": toll or 0})
    with mock.patch.object(routes.CachedRoutes, "_count_left", share):
        return [
            (path_of(graph, source, target, weight), graph.distance(source, target, weight))
            for target in range(NODES)
            for source in range(NODES)
        ]


def path_of(graph, source, target, weight):
    try:
        return graph.shortest_path(source, target, weight)
    except NoPath:
        return None


@given(places=PLACES, edges=EDGES, weight=WEIGHTS)
def test_searches_and_tables_give_the_same_paths_and_the_same_bits(places, edges, weight):
    assert answers(places, edges, weight, searched) == answers(places, edges, weight, tables)


@given(edges=EDGES, weight=WEIGHTS, some=st.lists(ROW, max_size=3), cutoff=st.sampled_from([0, 0.3, 0.6, 1, 2.5]))
def test_a_cutoff_gives_the_same_bits_as_the_whole_cut_off(edges, weight, some, cutoff):
    graph = Graph()
    graph.add_nodes((np.arange(NODES) * 7 + 3) % NODES, np.arange(NODES), np.zeros(NODES))
    for id, (source, target, length, toll) in enumerate(edges):
        graph.add_edge({"id": id, "source": source, "target": target, "length": length, "toll": toll or 0})
    for ends in ({"source": some}, {"target": some}):
        known = graph.distances(**ends, weight=weight if edges else None)
        near = graph.distances(**ends, weight=weight if edges else None, cutoff=cutoff)
        assert list(near.items()) == [(node, far) for node, far in known.items() if far <= cutoff]


@given(places=PLACES, edges=EDGES, weight=WEIGHTS, sources=st.lists(ROW, max_size=4))
def test_many_distances_and_those_from_the_nearest_are_single_ones_to_the_bit(places, edges, weight, sources):
    graph = Graph()
    graph.add_nodes(range(NODES), *np.transpose(places))
    for id, (source, target, detour, toll) in enumerate(edges):
        length = math.dist(places[source], places[target]) * detour
        graph.add_edge({"id": id, "source": source, "target": target, "length": length, "toll": toll or 0})
    weight = weight if edges else None
    pairs = [[graph.distance(one, to, weight) for to in range(NODES)] for one in sources]
    known = [min((row[to] for row in pairs), default=math.inf) for to in range(NODES)]
    for share in (searched, tables):
        fresh = graph._fork(graph._store.fork(), graph._phase)
        with mock.patch.object(routes.CachedRoutes, "_count_left", share):
            assert fresh.routes.distances_from_nearest(sources, range(NODES), weight) == known
            fresh = graph._fork(graph._store.fork(), graph._phase)
            assert fresh.routes.distances(sources, range(NODES), weight).tolist() == pairs


def test_the_cost_of_distances_up_to_a_cutoff_depends_on_near_nodes_alone(city):
    assert 20 < len(city.distances(source=75 * 150 + 75, cutoff=50.0)) < 120  # of 22,500
    assert len(city._routes.search("length", reverse=False).find(np.array([75 * 150 + 75]), within=50.0).rows) < 120


@pytest.fixture(scope="module")
def city():
    """A grid of 150 x 150 nodes whose streets are up to a fifth longer than straight; a third of them is missing."""
    rng, side = np.random.default_rng(4), 150
    rows = np.arange(side * side).reshape(side, side)
    x, y = np.meshgrid(np.arange(side) * 10.0, np.arange(side) * 10.0)
    pairs = np.concatenate(
        [
            np.stack([rows[:, :-1].ravel(), rows[:, 1:].ravel()], axis=1),
            np.stack([rows[:-1].ravel(), rows[1:].ravel()], axis=1),
        ]
    )
    pairs = pairs[rng.random(len(pairs)) > 0.3]
    graph = Graph()
    graph.add_nodes(rows.ravel(), x.ravel(), y.ravel())
    ends = np.concatenate([pairs, pairs[:, ::-1]])
    graph.add_edges(np.arange(len(ends)), *ends.T, lengths=rng.choice([10.0, 11.0, 12.0], len(ends)))
    return graph


def test_a_near_path_visits_few_nodes(city):
    target, source = 75 * 150 + 75, 65 * 150 + 65
    search = city._routes.search("length")
    path = search.find_path(source, target, 22500, math.inf)
    assert path.visited < 900  # of 22,500
    assert search.find_path(source, target, path.visited - 1, math.inf).visited == -1


def test_a_path_that_is_cut_by_its_weight_is_no_path():
    graph = Graph()
    graph.add_nodes(range(3), [0, 1, 2], [0, 0, 0])
    graph.add_edge({"id": 0, "source": 0, "target": 1, "length": 1.0, "toll": math.inf})
    with mock.patch.object(routes.CachedRoutes, "_count_left", searched):
        with pytest.raises(NoPath, match="from node 0 to node 1"):
            graph.shortest_path(0, 1, "toll")
        assert graph.distance(0, 1, "toll") == math.inf
        graph.update_edge({"id": 0, "toll": -1})
        with pytest.raises(BadValue, match="'toll' of edge 0"):
            graph.shortest_path(0, 1, "toll")
