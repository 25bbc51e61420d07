"""The cutting kernel against a slow reference that walks along each road."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gamms.errors import BadValue
from gamms.osm.network import compute_offsets, extend_to_ends, make_network_of_lines, measure_along, reverse_points
from gamms.osm.topology import count_pieces, cut_polylines, resample

coordinate = st.integers(-1000, 1000).map(lambda n: n / 8)
point = st.tuples(coordinate, coordinate)
line = st.lists(point, min_size=2, max_size=7)


def walked(points, count):
    """Cut one polyline by walking along it with a cursor: the pieces, as lists of points."""
    steps = [math.dist(a, b) for a, b in itertools.pairwise(points)]
    total = sum(steps)
    marks = [total * k / count for k in range(1, count)]
    pieces, piece, gone = [], [points[0]], 0.0
    for (a, b), step in zip(itertools.pairwise(points), steps, strict=True):
        while marks and marks[0] < gone + step:
            t = (marks.pop(0) - gone) / step
            cut = (a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t)
            pieces.append([*piece, cut])
            piece = [cut]
        piece.append(b)
        gone += step
    pieces.append(piece)
    return pieces


def polyline_length(points):
    return sum(math.dist(a, b) for a, b in itertools.pairwise(points))


def columns(lines):
    return compute_offsets(np.array([len(one) for one in lines])), np.array([p for one in lines for p in one], float)


def network(xy, roads, lengths=None, polylines=None):
    ends = np.array(roads).reshape(-1, 2)
    lengths = np.array(lengths if lengths is not None else [math.dist(xy[a], xy[b]) for a, b in roads], float)
    polylines = {road: np.array(points, float) for road, points in (polylines or {}).items()}
    return make_network_of_lines(
        np.array(xy, float), (ends[:, 0], ends[:, 1]), polylines, lengths, [{}] * len(roads), None
    )


@settings(deadline=None)
@given(st.lists(st.tuples(line, st.integers(1, 9)), min_size=1, max_size=6))
def test_the_kernel_cuts_as_a_walk_along_each_road_does(cases):
    cases = [(points, count) for points, count in cases if polyline_length(points) > 0.1]
    if not cases:
        return
    counts = np.array([count for _, count in cases])
    cuts, offsets, points = cut_polylines(*columns([points for points, _ in cases]), counts)
    expected = [piece for points, count in cases for piece in walked(points, count)]
    assert len(offsets) - 1 == len(expected)
    for first, last, piece in zip(offsets, offsets[1:], expected, strict=False):
        ours = points[first:last].tolist()
        assert np.allclose([ours[0], ours[-1]], [piece[0], piece[-1]], atol=1e-6)
        assert polyline_length(ours) == pytest.approx(polyline_length(piece), abs=1e-6)
        assert all(min(math.dist(vertex, ours_) for ours_ in ours) < 1e-6 for vertex in piece)
    inner = [end for one, count in cases for end in (piece[-1] for piece in walked(one, count)[:-1])]
    assert np.allclose(cuts, np.array(inner).reshape(-1, 2), atol=1e-6)


@settings(deadline=None)
@given(st.lists(line, min_size=1, max_size=5), st.floats(0.5, 200.0))
def test_the_lengths_of_the_pieces_add_up(lines, resolution):
    xy = [end for points in lines for end in (points[0], points[-1])]
    roads = [(2 * i, 2 * i + 1) for i in range(len(lines))]
    lengths = [1.003 * polyline_length(points) for points in lines]
    pieces = resample(network(xy, roads, lengths, dict(enumerate(lines))), resolution)
    sums = np.bincount(pieces.ways, weights=pieces.lengths, minlength=len(lines))
    assert sums == pytest.approx(lengths, rel=1e-9)
    cut = np.bincount(pieces.ways)[pieces.ways] > 1
    assert (pieces.lengths[cut] >= 0.75 * resolution - 1e-9).all()
    assert (pieces.lengths <= 1.5 * resolution).all()


@settings(deadline=None)
@given(st.lists(line, min_size=1, max_size=5))
def test_backwards_twice_is_forwards(lines):
    offsets, points = columns(lines)
    back = reverse_points(offsets)
    assert (back[back] == np.arange(len(points))).all()
    assert points[back][: offsets[1]].tolist() == [list(p) for p in lines[0][::-1]]


@settings(deadline=None)
@given(st.lists(st.tuples(line, point, point), min_size=1, max_size=5))
def test_led_polylines_start_and_end_at_their_nodes(cases):
    offsets, points = columns([points for points, _, _ in cases])
    start, end = (np.array([case[i] for case in cases], float) for i in (1, 2))
    led, result, grown = extend_to_ends(offsets, points, start, end)
    assert (result[led[:-1]] == start).all()
    assert (result[led[1:] - 1] == end).all()
    before, after = measure_along(offsets, points)[offsets[1:] - 1], measure_along(led, result)[led[1:] - 1]
    assert after == pytest.approx(before + grown, abs=1e-6)


@pytest.mark.parametrize(
    ("length", "pieces"), [(0, 1), (14.9, 1), (15, 2), (25, 2), (30, 3), (34, 3), (35, 4), (45, 4), (100, 10)]
)
def test_the_number_of_pieces_is_rounded_half_to_even(length, pieces):
    assert count_pieces(np.array([float(length)]), 10.0).tolist() == [pieces]


def test_the_number_of_pieces_is_bounded():
    with pytest.raises(BadValue, match=r"1000000000 m of road in pieces of resolution=0\.001 m"):
        count_pieces(np.array([1e9]), 1e-3)


def test_no_roads_are_no_pieces():
    assert len(resample(network([(0, 0)], []), 10.0).sources) == 0


def test_vertices_stay_inside_their_piece():
    cuts, offsets, points = cut_polylines(*columns([[(0, 0), (4, 0), (5, 0), (10, 0)]]), np.array([2]))
    assert cuts.tolist() == [[5, 0]]
    assert offsets.tolist() == [0, 3, 5]
    assert points[:, 0].tolist() == [0, 4, 5, 5, 10]


def test_opposite_one_way_roads_are_not_parallel():
    assert len(resample(network([(0, 0), (8, 0)], [(0, 1), (1, 0)]), 10.0).sources) == 2


def test_a_road_back_to_its_own_node_has_three_pieces_at_least():
    ring = [(0, 0), (3, 0), (3, 3), (0, 3), (0, 0)]
    pieces = resample(network([(0, 0)], [(0, 0)], [12], {0: ring}), 10.0)
    assert pieces.sources.tolist() == [0, 1, 2]
    assert pieces.targets.tolist() == [1, 2, 0]
    assert pieces.lengths.tolist() == [4, 4, 4]
