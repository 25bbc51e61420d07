"""Operations on whole networks: components, simplification, directions."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gamms import kernels
from gamms.osm.network import find_components, join_directions, make_network_of_lines, make_two_way, measure_along
from gamms.osm.topology import simplify

coordinate = st.integers(-40, 40).map(lambda n: n / 4)
point = st.tuples(coordinate, coordinate)


def network(xy, roads, tags=None, polylines=None):
    ends = np.array(roads).reshape(-1, 2)
    polylines = {road: np.array(points, float) for road, points in (polylines or {}).items()}
    lengths = np.array([math.dist(xy[a], xy[b]) for a, b in roads])
    return make_network_of_lines(
        np.array(xy, float), (ends[:, 0], ends[:, 1]), polylines, lengths, tags or [{}] * len(roads), "EPSG:32635"
    )


def slow_components(pairs, count):
    label = list(range(count))
    for _ in range(count):
        for a, b in pairs:
            label[a] = label[b] = min(label[a], label[b])
    return label


@settings(deadline=None)
@given(st.lists(st.tuples(st.integers(0, 19), st.integers(0, 19)), max_size=25))
def test_components_are_named_after_their_first_row(pairs):
    a, b = np.array(pairs, np.int64).reshape(-1, 2).T
    assert find_components(a, b, 20).tolist() == slow_components(pairs, 20)


def test_components_of_a_long_shuffled_chain_take_few_rounds():
    rows = np.random.default_rng(1).permutation(100_000)
    assert not find_components(rows[:-1], rows[1:], 100_000).any()


@settings(deadline=None)
@given(st.lists(st.integers(-3, 3)))
def test_numbers_are_given_in_first_seen_order(keys):
    numbers, firsts = kernels.number_by_appearance(np.array(keys, np.int64))
    order = list(dict.fromkeys(keys))
    assert numbers.tolist() == [order.index(key) for key in keys]
    assert firsts.tolist() == [keys.index(key) for key in order]


def test_a_chain_becomes_one_road_with_the_same_length():
    chain = make_two_way(network([(0, 0), (3, 4), (6, 0), (6, 5)], [(0, 1), (2, 1), (2, 3)]))
    simple = simplify(chain)
    assert simple.lengths.tolist() == [15]
    assert simple.points.tolist() == [[0, 0], [3, 4], [6, 0], [6, 5]]
    assert simple.xy.tolist() == [[0, 0], [6, 5]]


def test_one_way_roads_keep_their_direction():
    row = network([(0, 0), (1, 0), (2, 0)], [(1, 0), (2, 1)])
    simple = simplify(row)
    assert simple.xy[simple.sources].tolist() == [[2, 0]]
    assert simple.points.tolist() == [[2, 0], [1, 0], [0, 0]]


def test_a_ring_becomes_a_road_back_to_its_first_node():
    simple = simplify(network([(0, 0), (1, 0), (1, 1)], [(0, 1), (1, 2), (2, 0)]))
    assert (simple.sources.tolist(), simple.targets.tolist()) == ([0], [0])
    assert simple.points.tolist() == [[0, 0], [1, 0], [1, 1], [0, 0]]


@settings(deadline=None)
@given(
    st.lists(st.tuples(st.integers(0, 9), st.integers(0, 9)), min_size=1, max_size=14),
    st.lists(point, min_size=10, max_size=10, unique=True),
    st.booleans(),
)
def test_simplifying_keeps_the_total_length_and_needs_one_go(roads, xy, two_way):
    polylines = {road: [xy[a], (50, 50), xy[b]] for road, (a, b) in enumerate(roads) if a == b or road % 3 == 0}
    full = network(xy, roads, polylines=polylines)
    full = make_two_way(full) if two_way else full
    simple = simplify(full)
    assert simple.lengths.sum() == pytest.approx(full.lengths.sum())
    drawn = [measure_along(one.offsets, one.points)[one.offsets[1:] - 1].sum() for one in (full, simple)]
    assert drawn[0] == pytest.approx(drawn[1])
    assert (simple.points[simple.offsets[:-1]] == simple.xy[simple.sources]).all()
    assert (simple.points[simple.offsets[1:] - 1] == simple.xy[simple.targets]).all()
    if two_way:
        assert len(simplify(simple).sources) == len(simple.sources)


def test_a_road_and_its_reverse_become_one():
    polyline = [(0, 0), (1, 1), (2, 0)]
    there_and_back = network([(0, 0), (2, 0)], [(0, 1), (1, 0), (0, 1)], polylines={0: polyline, 1: polyline[::-1]})
    joined = join_directions(there_and_back)
    assert joined.two_way.tolist() == [True, False]
    assert len(joined.sources) == 2
