"""Sight lines: what blocks them at the rims, and the fast form that answers as the exact test over all pairs."""

import json
import math
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from gamms import kernels

ANSWERS = json.loads((Path(__file__).parent / "sight_lines.json").read_text())  # by gamms 1.0.0


def wall(a, b, low=0.0, high=4.0):
    """A vertical face from a to b in the plan."""
    return [(*a, high), (*b, high), (*a, low), (*b, low)]


def is_blocked(origin, target, face):
    one = [np.array([value], np.float64) for value in (origin, target, face)]
    blocked = bool(kernels.find_blocking(*one)[0])
    assert kernels.find_visible(one[2], one[0][0], one[1]).tolist() == [not blocked]
    return blocked


def by_brute_force(corners, origin, targets):
    n, m = len(targets), len(corners)
    origins = np.broadcast_to(origin, (n * m, 3))
    blocked = kernels.find_blocking(origins, np.repeat(targets, m, axis=0), np.tile(corners, (n, 1, 1)))
    return ~blocked.reshape(n, m).any(axis=1)


# -- rims -------------------------------------------------------------------------------------------------------

EAST = (10.0, 0.0, 1.0)
HOME = (0.0, 0.0, 1.0)


@pytest.mark.parametrize(
    ("face", "expected"),
    [
        pytest.param(wall((5, -2), (5, 2)), True, id="a wall between them"),
        pytest.param(wall((5, 2), (5, -2)), True, id="its other side"),
        pytest.param(wall((10, -2), (10, 2)), True, id="a wall that touches the target"),
        pytest.param(wall((0, -2), (0, 2)), True, id="a wall that touches the observer"),
        pytest.param(wall((10.001, -2), (10.001, 2)), False, id="a wall behind the target"),
        pytest.param(wall((-0.001, -2), (-0.001, 2)), False, id="a wall behind the observer"),
        pytest.param(wall((5, 0), (5, 2)), True, id="a wall that begins on the line"),
        pytest.param(wall((5, -2), (5, 0)), True, id="a wall that ends on the line"),
        pytest.param(wall((5, 0.001), (5, 2)), False, id="a wall beside the line"),
        pytest.param(wall((5, -2), (5, 2), high=1.0), True, id="a wall as high as the line"),
        pytest.param(wall((5, -2), (5, 2), low=1.0), True, id="a roof edge as low as the line"),
        pytest.param(wall((5, -2), (5, 2), high=0.999), False, id="a lower wall"),
        pytest.param(wall((5, -2), (5, 2), low=1.001), False, id="a face above the line"),
        pytest.param(wall((3, 0), (7, 0)), False, id="a wall that the line runs along"),
        pytest.param(wall((0, 0), (10, 0)), False, id="a wall from observer to target"),
        pytest.param([(7, -1, 1), (3, -1, 1), (7, 1, 1), (3, 1, 1)], False, id="a ceiling in the height of the line"),
        pytest.param([(7, -1, 0), (3, -1, 2), (7, 1, 0), (3, 1, 2)], True, id="a ramp"),
        pytest.param(wall((5, 1), (5, 1)), False, id="a face of no width"),
        pytest.param([(5, 0, 1)] * 4, False, id="a point on the line"),
        pytest.param([(5, 2, 4), (5, -2, 4), (5, -2, 0), (5, 2, 0)], True, id="a bow tie, at its middle"),
    ],
)
def test_at_the_rims_a_face_blocks_unless_the_line_runs_along_it(face, expected):
    assert is_blocked(HOME, EAST, face) is expected
    assert is_blocked(EAST, HOME, face) is expected


def test_a_line_of_no_length_is_never_blocked():
    assert not is_blocked(HOME, HOME, wall((0, -2), (0, 2)))
    assert not is_blocked(HOME, HOME, [(1, 1, 1), (-1, 1, 1), (1, -1, 1), (-1, -1, 1)])


def test_the_diagonal_between_the_two_triangles_has_no_gap():
    for z in np.linspace(0.0, 4.0, 9):
        y = z / 2.0 - 1.0
        assert is_blocked((0.0, y, z), (10.0, y, z), wall((5, -1), (5, 1)))
        assert is_blocked((0.0, y, z), (10.0, y, z), wall((5, 1), (5, -1)))


def test_from_above_a_roof_hides_the_place_straight_below():
    roof = [(1, 1, 5), (-1, 1, 5), (1, -1, 5), (-1, -1, 5)]
    assert is_blocked((0, 0, 9), (0, 0, 0), roof)
    assert is_blocked((1, 1, 9), (1, 1, 0), roof)
    assert is_blocked((0, 0, 5), (0, 0, 0), roof)
    assert not is_blocked((0, 0, 4), (0, 0, 0), roof)
    assert not is_blocked((1.001, 0, 9), (1.001, 0, 0), roof)
    assert is_blocked((1.001, 0, 9), (0.99, 0, 0), roof)


def test_a_line_along_a_wall_passes_in_turned_and_far_away_towns_too():
    rng = np.random.default_rng(3)
    for turn in rng.uniform(0.0, 2.0 * math.pi, 200):
        way = np.array([math.cos(turn), math.sin(turn)])
        here = np.array([385_000.0, 6_670_000.0]) + rng.uniform(-999, 999, 2)
        face = wall(*(tuple(here + way * far) for far in rng.uniform(-2000, 2000, 2)), high=60.0)
        ends = [(*(here + way * far), 1.6) for far in rng.uniform(-250, 250, 2)]
        wide = np.abs(np.subtract(face[0], face[1])[:2]).sum()
        # Rounded to a nanometre, the ends lie beside the wall, and the line may lead through it at a real angle.
        angle = 4e-9 / math.dist(*ends)
        assert not is_blocked(*ends, face) or angle * 60.0 * wide > 1e-11 * (wide + 60.0) ** 2


@pytest.mark.parametrize("huge", [1e60, 1e120, 1e200, 1.7e308])
def test_numbers_too_large_to_multiply_block_nothing_and_warn_of_nothing(huge):
    for face in (wall((huge, -huge), (huge, huge), -huge, huge), wall((1, -huge), (1, huge), -huge, huge)):
        is_blocked(HOME, EAST, face)
        is_blocked((-huge, 0, 0), (huge, 0, 0), face)
    assert is_blocked(HOME, EAST, wall((5, -1e9), (5, 1e9)))


# -- ends on a face -----------------------------------------------------------------------------------------------


def exact_blocks(origin, target, face):
    """What `find_blocking` would answer without rounding, of the decimals that were meant."""
    origin, target, *corners = ([Fraction(f"{x:.6f}") for x in point] for point in (origin, target, *face))
    tr, tl, br, bl = corners
    return any(exact_hits(origin, target, *three) for three in ((tl, tr, br), (tl, br, bl)))


def exact_hits(origin, target, a, b, c):
    line, to_observer, first, second = (minus(*two) for two in ((target, origin), (origin, a), (b, a), (c, a)))
    across, turned = cross(line, second), cross(to_observer, first)
    det = dot(first, across)
    u, v, t = (dot(*two) * (1 if det > 0 else -1) for two in ((to_observer, across), (line, turned), (second, turned)))
    return det != 0 and min(u, v, t) >= 0 and max(u + v, t) <= abs(det)


def minus(a, b):
    return [x - y for x, y in zip(a, b, strict=True)]


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def dot(a, b):
    return sum(x * y for x, y in zip(a, b, strict=True))


def test_every_line_is_answered_as_without_rounding():
    expected = [exact_blocks(*case[:3]) for case in ANSWERS]
    origins, targets, corners = (np.array([case[i] for case in ANSWERS]) for i in range(3))
    assert kernels.find_blocking(origins, targets, corners).tolist() == expected
    assert [is_blocked(*case[:3]) for case in ANSWERS] == expected


def test_a_line_that_the_original_finds_blocked_is_blocked():
    assert all(is_blocked(*case[:3]) for case in ANSWERS if case[3])


tenths = st.integers(-60, 60).map(lambda n: n / 10)
places = st.tuples(tenths, tenths)


@given(
    places, places, places, places, st.sampled_from([0.2, 1.6, 3.0]), st.sampled_from([(0, 0), (385_000, 6_670_000)])
)
@settings(max_examples=100)
def test_lines_between_decimal_places_are_answered_as_without_rounding(a, b, origin, target, z, offset):
    a, b, origin, target = ((x + offset[0], y + offset[1]) for x, y in (a, b, origin, target))
    face = wall(a, b, 0.2, 3.0)
    assert is_blocked((*origin, z), (*target, z), face) is exact_blocks((*origin, z), (*target, z), face)


thirds = st.floats(-60, 60, width=32).map(lambda x: x / 3)
thirds_places = st.tuples(thirds, thirds)


@given(
    thirds_places,
    thirds_places,
    thirds_places,
    st.one_of(st.sampled_from([0.0, 1.0]), st.floats(0.0, 1.0)),
    st.sampled_from([0.0, 1.6, 4.0]),
    st.sampled_from([(0.0, 0.0), (385_000.1, 6_670_000.7)]),
)
@example((1 / 7, 1.1), (5.3, 1 / 3), (-4.0, -3.0), 0.0, 1.6, (0.0, 0.0))
def test_who_is_on_a_wall_neither_sees_nor_is_seen(a, b, other, share, z, offset):
    a, b, other = (np.add(place, offset) for place in (a, b, other))
    on_it = a if share == 0.0 else b if share == 1.0 else a + (b - a) * share
    way, line = b - a, other - on_it
    area = abs(way[0] * line[1] - way[1] * line[0])
    assume(min(math.hypot(*way), math.hypot(*line)) > 0.1 and area > 1e-3 * math.hypot(*way) * math.hypot(*line))
    face = wall(a.tolist(), b.tolist())
    assert is_blocked((*other, z), (*on_it, z), face)
    assert is_blocked((*on_it, z), (*other, z), face)


@given(thirds_places, thirds_places, st.floats(0.0, 1.0), st.floats(0.1, 3.0))
def test_a_tenth_of_a_millimetre_in_front_of_a_wall_one_is_seen(a, b, share, angle):
    a, b = np.add(a, (385_000.1, 6_670_000.7)), np.add(b, (385_000.1, 6_670_000.7))
    way = b - a
    assume(math.hypot(*way) > 0.1)
    way /= math.hypot(*way)
    ahead = np.array([-way[1], way[0]])
    near = a + (b - a) * share + 1e-4 * ahead
    far = near + 30.0 * (math.sin(angle) * ahead + math.cos(angle) * way)
    assert not is_blocked((*far, 1.6), (*near, 1.6), wall(a.tolist(), b.tolist()))


# -- the fast form ----------------------------------------------------------------------------------------------

whole = st.integers(-4, 4).map(float)
decimals = st.integers(-40, 40).map(lambda n: n / 10)
loose = st.floats(-5, 5, allow_subnormal=True)
wild = st.one_of(whole, st.sampled_from([1e-320, -1e-12, 1e-5, 1e12, -1e80, 1e110, -1.7e308]))


@st.composite
def scenes(draw):
    """Corners (faces, 4, 3), an origin (3,) and targets (targets, 3)."""
    number = draw(st.sampled_from([whole, whole, decimals, loose, wild]))
    point = st.tuples(number, number, number)
    flat = st.tuples(number, number)
    upright = st.builds(wall, flat, flat, number, number)
    thin = st.tuples(point, point).map(lambda ends: [ends[0], ends[1], ends[0], ends[1]])
    face = st.one_of(upright, upright, st.tuples(point, point, point, point), thin, point.map(lambda p: [p] * 4))
    corners = np.array(draw(st.lists(face, max_size=12)), np.float64).reshape(-1, 4, 3)
    places = [*corners.reshape(-1, 3).tolist(), *corners.mean(axis=1).tolist()]
    place = st.one_of(point, st.sampled_from(places)) if places else point
    origin = np.array(draw(place))
    above = st.tuples(st.just(origin[0]), st.just(origin[1]), number)
    targets = np.array(draw(st.lists(st.one_of(place, above), max_size=12)), np.float64).reshape(-1, 3)
    if draw(st.booleans()):  # all on the ground
        origin[2] = 1.6
        targets[:, 2] = 1.6
    return corners, origin, targets


@pytest.mark.filterwarnings("ignore:overflow:RuntimeWarning")  # of the places in the middle of huge faces
@given(scene=scenes(), shift=st.sampled_from([0.0, 0.0, 385_000.0, 6.67e6, 1e12]))
@example((np.array([wall((-1, 0), (1, 0))]), np.zeros(3), np.array([[0.0, 0.0, -9.0], [0.0, 1e-300, -9.0]])), 0.0)
@settings(max_examples=100)
def test_the_fast_form_answers_as_the_exact_test_over_all_pairs(scene, shift):
    there = np.array([shift, shift, 0.0])
    corners, origin, targets = (np.nan_to_num(array + there, posinf=1.0, neginf=1.0) for array in scene)
    expected = by_brute_force(corners, origin, targets).tolist()
    assert kernels.find_visible(corners, origin, targets).tolist() == expected
    is_asked = np.arange(2 * len(targets)).reshape(2, -1) % 3 > 0
    both = kernels.find_visible_from_each(corners, np.array([origin, [*origin[:2], 1.6]]), targets, is_asked)
    lower = by_brute_force(corners, np.array([*origin[:2], 1.6]), targets)
    assert np.array_equal(both, is_asked & [expected, lower])


@pytest.mark.parametrize("seed", range(3))
def test_the_fast_form_agrees_on_whole_towns(seed):
    rng = np.random.default_rng(seed)
    grain = (0.0, 1.0, 10.0)[seed % 3]
    rounded = (lambda a: np.round(a / grain) * grain) if grain else (lambda a: a)
    middle = rounded(rng.uniform(-60, 60, (300, 1, 2)))
    ends = middle + rounded(rng.uniform(-12, 12, (300, 2, 2)))
    corners = np.zeros((300, 4, 3))
    corners[:, :, :2] = ends[:, [0, 1, 0, 1]]
    corners[:, :2, 2] = rng.uniform(0, 20, (300, 1))
    corners[:40] = rounded(rng.uniform(-30, 30, (40, 4, 3)))  # roofs, ramps and worse
    corners[40:44] *= 50.0
    targets = rounded(rng.uniform(-60, 60, (200, 3)))
    if seed % 2:
        targets[:, 2] = 1.6
    for origin in (targets[0], *targets[1:6], corners[50, 0], (0.0, 0.0, 80.0)):
        fast = kernels.find_visible(corners, np.array(origin), targets)
        assert np.array_equal(fast, by_brute_force(corners, origin, targets))
        assert not fast.all()


@pytest.mark.parametrize("grain", [0.0, 1.0])
def test_observers_that_look_together_see_the_same_as_alone(grain):
    """Walls that reach past all heights hide what is beyond them without a test; bridges and low walls do not."""
    rng = np.random.default_rng(5)
    ends = rng.uniform(-60, 60, (120, 1, 2)) + rng.uniform(-12, 12, (120, 2, 2))
    ends = np.round(ends / grain) * grain if grain else ends
    low, high = rng.choice([0.0, 1.6, 3.0], 120, p=[0.8, 0.1, 0.1]), rng.choice([1.6, 1.5, 9.0], 120, p=[0.1, 0.1, 0.8])
    corners = np.array([wall(*ends[i], low[i], low[i] + high[i]) for i in range(120)])
    at = rng.choice([0.0, 0.5, 1.0, 1.5], (60, 1))
    targets = np.full((300, 3), 1.6)
    targets[:, :2] = rng.uniform(-60, 60, (300, 2))
    targets[:60, :2] = ends[:60, 0] + at * (ends[:60, 1] - ends[:60, 0])  # on walls, at their ends and in their lines
    is_asked = rng.random((8, 300)) < 0.9
    seen = kernels.find_visible_from_each(corners, targets[56:64], targets, is_asked)
    expected = [by_brute_force(corners, origin, targets) for origin in targets[56:64]]
    assert np.array_equal(seen, is_asked & expected)
    assert np.array_equal(kernels.find_visible(corners, targets[60], targets), expected[4])


def test_a_wall_is_looked_at_edge_on_from_every_side():
    """Lines almost along walls, where rounding is worst."""
    rng = np.random.default_rng(8)
    for _ in range(300):
        a, way = rng.uniform(-100, 100, 2), rng.uniform(-30, 30, 2)
        corners = np.array([wall(a, a + way, 0.0, rng.uniform(2, 90)) for _ in range(3)])
        corners[:, :, :2] += rng.choice([0.0, 1e-9, 1e-12, 1e-14], (3, 4, 2)) * rng.uniform(-1, 1, (3, 4, 2))
        far = rng.uniform(-9, 9, (8, 1))
        targets = np.column_stack([a + far * way, rng.choice([0.0, 1.6, 7.0], 8)])
        targets[:, :2] += rng.choice([0.0, 1e-9, 1e-12, 1e-13], (8, 2)) * rng.uniform(-1, 1, (8, 2))
        for origin in targets:
            assert np.array_equal(
                kernels.find_visible(corners, origin, targets), by_brute_force(corners, origin, targets)
            )


def test_ranges_are_expanded_in_order():
    groups, places = kernels.expand_ranges(np.array([3, 9, 5, 0]), np.array([5, 2, 6, 0]))
    assert (groups.tolist(), places.tolist()) == ([0, 0, 2], [3, 4, 5])
    assert kernels.expand_ranges(np.zeros(0, np.int64), np.zeros(0, np.int64))[1].tolist() == []


def test_more_pairs_than_are_held_at_a_time_are_answered_alike():
    rng = np.random.default_rng(2)
    corners = np.array([wall(a, -a, 0.0, rng.uniform(0, 3)) for a in rng.normal(0, 9, (500, 2))])
    targets = np.column_stack((rng.uniform(-99, 99, (700, 2)), rng.uniform(0, 9, 700)))
    origin = np.array([0.0, 0.1, 2.9])  # inside the box of every wall
    fast = kernels.find_visible(corners, origin, targets)
    assert np.array_equal(fast, by_brute_force(corners, origin, targets))
    assert 0 < fast.sum() < 700
