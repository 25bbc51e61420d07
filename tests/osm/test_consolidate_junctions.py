"""What is one physical junction becomes one node, and every metre is accounted for."""

import itertools
import math
from dataclasses import replace

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gamms.osm
from gamms.osm.network import find_components, make_network_of_lines, select_roads
from gamms.osm.topology import consolidate, count_road_ends, find_chains

place = st.integers(-400, 400).map(lambda n: n / 16 + n * n / 1e5)
places = st.lists(st.tuples(place, place), min_size=2, max_size=14, unique=True)


def network(xy, roads, lengths=None):
    ends = np.array(roads, np.int64).reshape(-1, 2)
    lengths = np.array([math.dist(xy[a], xy[b]) for a, b in roads] if lengths is None else lengths, float)
    return make_network_of_lines(np.array(xy, float), (ends[:, 0], ends[:, 1]), {}, lengths, [{}] * len(roads), None)


def dual_carriageway_crossing():
    """Four junctions at the corners of a square with 8 m sides, and two arms of 92 m at each."""
    corners = [(0.0, 0.0), (8.0, 0.0), (8.0, 8.0), (0.0, 8.0)]
    xy, roads = [*corners], [(0, 1), (1, 2), (2, 3), (3, 0)]
    for corner, (x, y) in enumerate(corners):
        for arm in ((x - 92.0 if x == 0.0 else x + 92.0, y), (x, y - 92.0 if y == 0.0 else y + 92.0)):
            roads.append((corner, len(xy)))
            xy.append(arm)
    return network(xy, roads)


@st.composite
def networks(draw):
    xy = draw(places)
    pairs = list(itertools.combinations(range(len(xy)), 2))
    roads = draw(st.lists(st.sampled_from(pairs), min_size=1, max_size=24))
    return network(xy, roads)


def parts(net):
    return len(np.unique(find_components(net.sources, net.targets, len(net.xy))))


def test_it_stays_four_junctions_when_the_tolerance_is_smaller():
    crossing = dual_carriageway_crossing()
    assert consolidate(crossing, 3.9) is crossing


def test_a_road_keeps_the_ratio_of_its_true_length_to_its_drawn_one():
    xy = [(0, 0), (2, 0), (0, 50), (2, -50), (-50, 0), (52, 0)]
    net = network(xy, [(0, 1), (0, 2), (1, 3), (0, 4), (1, 5)], lengths=[2.0, 100.0, 100.0, 50.0, 50.0])
    merged = consolidate(net, 1.0)
    assert merged.lengths.tolist() == pytest.approx([2 * math.hypot(1, 50)] * 2 + [51.0] * 2)


def test_near_roads_that_do_not_join_stay_apart():
    xy = [(-9, 0), (0, 0), (9, 0), (0, 9), (-9, 1), (0, 1), (9, 1), (0, -9)]
    bridge = network(xy, [(0, 1), (1, 2), (1, 7), (4, 5), (5, 6), (5, 3)])
    assert consolidate(bridge, 2.0) is bridge


def test_bends_and_dead_ends_stay():
    winding = network([(i, i % 2) for i in range(30)], [(i, i + 1) for i in range(29)])
    assert consolidate(winding, 10.0) is winding


def test_a_long_way_round_between_near_junctions_is_kept_as_a_loop():
    xy = [(0, 0), (2, 0), (1, 90), (-50, 0), (52, 0)]
    merged = consolidate(network(xy, [(0, 1), (0, 2), (2, 1), (0, 3), (1, 4)]), 2.0)
    assert merged.merged.nodes == 1
    assert merged.lengths.sum() == pytest.approx(2 * 51 + 2 * 90)


def test_vertices_at_one_place_become_one_without_any_tolerance():
    near = network([(0, 0), (0.001, 0), (0.001, 0), (9, 0)], [(0, 1), (1, 2), (2, 3)])
    for tolerance in (0.0, 1e-9):
        assert consolidate(near, tolerance).xy.tolist() == [[0, 0], [0.001, 0], [9, 0]]


def test_a_network_that_is_one_junction_becomes_one_node():
    knot = network([(0, 0), (1, 0), (0, 1), (1, 1)], list(itertools.combinations(range(4), 2)))
    merged = consolidate(knot, 5.0)
    assert (merged.xy.tolist(), len(merged.sources)) == ([[0.5, 0.5]], 0)


def test_a_large_heap_of_short_roads_is_merged_in_no_time():
    side = 150
    xy = [(0.01 * i, 0.01 * j) for i in range(side) for j in range(side)]
    roads = [(k, k + 1) for k in range(side * side) if (k + 1) % side]
    roads += [(k, k + side) for k in range(side * (side - 1))]
    merged = consolidate(network(xy, roads), 1.0)
    assert len(merged.xy) < 50


@settings(deadline=None)
@given(networks(), st.sampled_from([0.0, 0.5, 2.0, 8.0]))
def test_total_length_is_accounted_for(net, tolerance):
    merged = consolidate(net, tolerance)
    assert merged.lengths.sum() + merged.merged.length_m == pytest.approx(net.lengths.sum())
    assert len(merged.xy) + merged.merged.nodes == len(net.xy)


@settings(deadline=None)
@given(networks(), st.sampled_from([0.5, 2.0, 8.0]))
def test_merging_keeps_exactly_the_connections(net, tolerance):
    assert parts(consolidate(net, tolerance)) == parts(net)


@settings(deadline=None)
@given(networks(), st.sampled_from([0.5, 2.0, 8.0]))
def test_no_junction_moves_farther_than_four_tolerances(net, tolerance):
    merged = consolidate(net, tolerance)
    gaps = np.hypot(*(net.xy[:, None] - merged.xy[None, :]).transpose(2, 0, 1))
    assert (gaps.min(axis=1)[count_road_ends(net) > 2] <= 4.0 * tolerance + 1e-9).all()


@settings(deadline=None)
@given(networks(), st.sampled_from([0.5, 2.0, 8.0]))
def test_nothing_happens_where_no_two_junctions_are_near(net, tolerance):
    chains = find_chains(net)
    a, b = chains.ends.T
    junctions = (a >= 0) & (a != b) & (np.minimum(count_road_ends(net)[a], count_road_ends(net)[b]) > 2)
    if not (junctions & (chains.lengths <= 2.0 * tolerance)).any():
        assert consolidate(net, tolerance) is net


@settings(deadline=None)
@given(networks(), st.sampled_from([0.5, 2.0, 8.0]), st.randoms(use_true_random=False))
def test_the_order_of_nodes_and_roads_plays_no_part(net, tolerance, random):
    numbers, order = [*range(len(net.xy))], [*range(len(net.sources))]
    random.shuffle(numbers)
    random.shuffle(order)
    rank = np.argsort(numbers)
    other = network(net.xy[numbers].tolist(), np.column_stack((rank[net.sources], rank[net.targets]))[order].tolist())
    one, two = consolidate(net, tolerance), consolidate(other, tolerance)
    assert sorted(map(tuple, one.xy.round(9).tolist())) == sorted(map(tuple, two.xy.round(9).tolist()))
    assert sorted(one.lengths.round(9).tolist()) == sorted(two.lengths.round(9).tolist())


@settings(deadline=None)
@given(networks())
def test_chains_lead_over_nodes_where_two_roads_meet(net):
    chains = find_chains(net)
    graph = nx.MultiGraph(zip(net.sources.tolist(), net.targets.tolist(), strict=True))
    assert chains.lengths.sum() == pytest.approx(net.lengths.sum())
    ends = [node for node in chains.ends.ravel().tolist() if node >= 0]
    assert sorted(ends) == sorted(node for node, degree in graph.degree if degree != 2 for _ in range(degree))
    for chain in range(len(chains.ends)):
        piece = select_roads(net, np.flatnonzero(chains.of_road == chain))
        assert nx.is_connected(nx.MultiGraph(zip(piece.sources.tolist(), piece.targets.tolist(), strict=True)))


def street(graph, *nodes):
    for u, v in itertools.pairwise(nodes):
        graph.add_edge(u, v)


def test_a_networkx_graph_can_be_consolidated_and_then_cut():
    graph = nx.MultiGraph(crs="EPSG:32635")
    for name, x, y in [("a", 0, 0), ("b", 3, 0), ("w", -40, 0), ("e", 43, 0), ("n", 0, 40), ("s", 3, -40)]:
        graph.add_node(name, x=5e5 + x, y=6e6 + y)
    street(graph, "w", "a", "b", "e")
    street(graph, "n", "a")
    street(graph, "s", "b")
    merged = gamms.osm.consolidate(graph, 2.0)
    assert isinstance(merged, nx.MultiDiGraph)
    assert (merged.number_of_nodes(), merged.number_of_edges()) == (5, 8)
    assert merged.graph["crs"] == "EPSG:32635"
    cut = gamms.osm.process_osm_graph(merged, resolution=10.0)
    assert cut.number_of_edges() == 2 * 4 * 4
    assert sum(length for *_, length in cut.edges(data="length")) == pytest.approx(4 * (41.5 + math.hypot(1.5, 40)))


@pytest.mark.parametrize("tolerance", [-1.0, math.inf, math.nan])
def test_an_impossible_tolerance_is_refused(tolerance):
    with pytest.raises(ValueError, match="tolerance"):
        gamms.osm.consolidate(nx.MultiGraph(), tolerance)


def crossing_of_two_streets(*, link, upper):
    """Two streets of 200 m, 6 m apart on the map, which a link of 6 m joins in the middle; `upper` tags one of them."""
    xy = [(-100.0, 0.0), (0.0, 0.0), (100.0, 0.0), (-100.0, 6.0), (0.0, 6.0), (100.0, 6.0)]
    net = network(xy, [(0, 1), (1, 2), (3, 4), (4, 5), (1, 4)])
    street = {"highway": "residential"}
    return replace(net, tags=[street, street, {**street, **upper}, {**street, **upper}, {**street, **link}])


@pytest.mark.parametrize(
    ("link", "upper", "nodes"),
    [
        ({}, {}, 5),
        ({"bridge": "no", "tunnel": "no", "layer": "0", "level": "0"}, {}, 5),
        ({"highway": "steps"}, {}, 6),
        ({"highway": "elevator"}, {}, 6),
        ({"highway": "escalator"}, {}, 6),
        ({"bridge": "yes"}, {}, 6),
        ({"tunnel": "building_passage"}, {}, 6),
        ({}, {"layer": "1"}, 6),
        ({}, {"layer": "-1"}, 6),
        ({}, {"level": "1"}, 6),
        ({}, {"level": "0;1"}, 5),
        ({"layer": "1"}, {"layer": "1"}, 6),
    ],
)
def test_junctions_merge_within_one_layer_and_level_and_never_across_a_bridge_stairs_or_a_building(link, upper, nodes):
    assert len(consolidate(crossing_of_two_streets(link=link, upper=upper), 10.0).xy) == nodes
