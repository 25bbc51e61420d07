"""Outlines of fields of view: what is seen lies inside them, and they are no larger than that."""

from itertools import pairwise
from math import cos, hypot, inf, isclose, pi, sin, sqrt, tan

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from gamms.sensor import fov_geometry
from gamms.typing import OSMEdge

places = st.floats(-1e3, 1e3)
radii = st.floats(0.1, 1e3)
heights = st.floats(0.1, 100.0)
turns = st.floats(-pi, pi)
openings = st.floats(0.1, 0.9 * pi)
reaches = st.floats(1.001, 20.0)  # how much farther the sensor sees than to the ground
axes = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda axis: hypot(*axis) > 0.1)


def is_inside(outline, x, y, slack):
    """Whether a point lies in a convex polygon that runs counter-clockwise, or outside by at most `slack`."""
    ahead = np.roll(outline, -1, axis=0) - outline
    length = np.hypot(*ahead.T)
    ahead, start = ahead[length > 1e-9] / length[length > 1e-9, None], outline[length > 1e-9]
    left = ahead[:, 0] * (y - start[:, 1]) - ahead[:, 1] * (x - start[:, 0])
    return (left >= -slack).all()


@given(places, places, radii)
def test_the_corners_of_a_disc_are_as_far_away_as_the_eye_reaches(x, y, radius):
    outline = fov_geometry.make_disc(x, y, radius)
    assert outline.shape == (48, 2)
    np.testing.assert_allclose(np.hypot(*(outline - (x, y)).T), radius, rtol=1e-9, atol=1e-9)


@given(places, places, radii, turns, st.floats(0.1, 6.28))
def test_a_sector_is_its_centre_and_an_arc_that_its_heading_halves(x, y, radius, heading, fov):
    outline = fov_geometry.make_sector(x, y, radius, (np.cos(heading), np.sin(heading)), fov)
    assert outline[0].tolist() == [x, y]
    arc = outline[1:] - (x, y)
    np.testing.assert_allclose(np.hypot(*arc.T), radius, atol=1e-9)
    ahead = arc @ (np.cos(heading), np.sin(heading))
    left = arc @ (-np.sin(heading), np.cos(heading))
    np.testing.assert_allclose(left[[0, -1]], radius * sin(fov / 2) * np.array([-1.0, 1.0]), atol=1e-6)
    np.testing.assert_allclose(ahead[[0, -1]], radius * cos(fov / 2), atol=1e-6)
    np.testing.assert_allclose(ahead, ahead[::-1], atol=1e-6)


@pytest.mark.parametrize(("heading", "fov"), [((0.0, 0.0), 1.0), ((1.0, 0.0), 2 * pi), ((1.0, 0.0), 7.0)])
def test_an_agent_that_sees_all_around_sees_a_disc(heading, fov):
    assert (
        fov_geometry.make_sector(1.0, 2.0, 3.0, heading, fov).tolist() == fov_geometry.make_disc(1.0, 2.0, 3.0).tolist()
    )


def test_the_view_ends_at_a_wall_and_goes_on_beside_it():
    outline = fov_geometry.find_area_in_sight(lambda points: points[:, 0] <= 3.0, 1.0, 2.0, 5.0, (0.0, 0.0), 1.0)
    assert outline[:, 0].max() == pytest.approx(3.0, abs=0.01)
    assert outline[:, 0].min() == pytest.approx(-4.0, abs=0.01)


def test_an_endless_view_has_no_outline():
    assert fov_geometry.make_disc(0.0, 0.0, inf).shape == (0, 2)
    assert fov_geometry.make_sector(0.0, 0.0, inf, (1.0, 0.0), 1.0).shape == (0, 2)
    assert fov_geometry.make_footprint((0.0, 0.0, 9.0), (1.0, 0.0, 0.0), inf, 1.0).shape == (0, 2)


@given(places, places, heights, openings)
def test_straight_down_the_footprint_is_a_disc_of_the_radius_that_the_height_gives(x, y, z, fov):
    outline = fov_geometry.make_footprint((x, y, z), (0.0, 0.0, -2.0), inf, fov)
    np.testing.assert_allclose(np.hypot(*(outline - (x, y)).T), z * tan(fov / 2), rtol=1e-6)
    np.testing.assert_allclose(outline.mean(axis=0), (x, y), atol=1e-3 * z * tan(fov / 2))  # corners on all sides


@given(heights, openings, st.floats(1.01, 10.0))
def test_a_short_sight_makes_the_footprint_smaller(z, fov, share):
    outline = fov_geometry.make_footprint((0.0, 0.0, z), (0.0, 0.0, -1.0), share * z, fov)
    radius = min(z * tan(fov / 2), sqrt((share * z) ** 2 - z * z))
    reached = np.hypot(*outline.T)
    assert isclose(reached.max(), radius, rel_tol=1e-6)
    assert reached.min() > 0.99 * radius


def ray(axis, off_axis, turn):
    """The unit vector that leans away from an axis, in a direction given by `turn`."""
    ahead = np.array(axis) / hypot(*axis)
    aside = np.cross(ahead, (0.0, 0.0, 1.0) if abs(ahead[2]) < 0.9 else (1.0, 0.0, 0.0))
    aside /= np.linalg.norm(aside)
    return cos(off_axis) * ahead + sin(off_axis) * (cos(turn) * aside + sin(turn) * np.cross(ahead, aside))


@given(heights, axes, reaches, openings, st.floats(0.0, 1.0), turns)
def test_the_footprint_holds_all_the_ground_that_is_seen(z, axis, reach, fov, share, turn):
    sight = ray(axis, share * fov / 2, turn)
    assume(sight[2] < -0.01)
    radius = reach * z / -sight[2]
    outline = fov_geometry.make_footprint((0.0, 0.0, z), axis, radius, fov)
    assert is_inside(outline, *(sight[:2] * -z / sight[2]), slack=0.01 * radius)


@given(heights, axes, reaches, openings)
def test_every_corner_of_a_footprint_is_ground_that_is_seen(z, axis, reach, fov):
    axis = (*axis[:2], -max(0.01, abs(axis[2])))
    radius = reach * z * hypot(*axis) / -axis[2]  # so the middle of the view is on the ground
    outline = fov_geometry.make_footprint((0.0, 0.0, z), axis, radius, fov)
    corners = np.column_stack([outline, np.full(len(outline), -z)])
    distances = np.linalg.norm(corners, axis=1)
    assert (distances <= radius * (1 + 1e-9)).all()
    assert (corners @ axis / distances / hypot(*axis) >= cos(fov / 2) - 1e-6).all()


@given(heights, axes, radii, openings, st.floats(0.0, 1.0), turns, st.floats(0.0, 1.0))
def test_the_shadow_holds_all_that_is_seen_in_the_air(z, axis, radius, fov, share, turn, near):
    sight = near * radius * ray(axis, share * fov / 2, turn)
    if z + sight[2] < 0:
        sight *= z / -sight[2]  # what is seen ends on the ground
    outline = fov_geometry.make_shadow((0.0, 0.0, z), axis, radius, fov)
    assert is_inside(outline, *sight[:2], slack=0.05 * radius)


def test_where_no_ground_is_seen_the_shadow_of_the_cone_stands_in():
    ahead = ((0.0, 0.0, 90.0), (1.0, 0.0, 0.0), 30.0, 1.0)
    outline = fov_geometry.make_footprint(*ahead)
    assert outline.tolist() == fov_geometry.make_shadow(*ahead).tolist()
    assert [0.0, 0.0] in outline.tolist()
    assert isclose(outline[:, 0].max(), 30.0)


def test_a_cone_that_opens_to_a_half_space_or_more_counts_as_a_ball():
    assert (
        fov_geometry.make_footprint((1.0, 2.0, 3.0), (0.0, 0.0, -1.0), 5.0, pi).tolist()
        == fov_geometry.make_disc(1.0, 2.0, 5.0).tolist()
    )


def test_the_blind_have_a_footprint_without_extent():
    assert np.ptp(fov_geometry.make_footprint((1.0, 2.0, 3.0), (0.0, 0.0, -1.0), 0.0, 1.0), axis=0).tolist() == [
        0.0,
        0.0,
    ]


def test_edges_become_polylines_and_those_without_one_are_left_out():
    straight = OSMEdge(0, 0, 1, 5.0, [(0.0, 0.0), (5.0, 0.0)])
    bare, bent = OSMEdge(1, 0, 1, 5.0), OSMEdge(2, 1, 2, 5.0, [(5.0, 0.0), (6.0, 1.0), (5.0, 2.0)])
    lines, offsets = fov_geometry.join_polylines([straight, bare, bent])
    drawn = [lines[begin:end].tolist() for begin, end in pairwise(offsets)]
    assert drawn == [[[0, 0], [5, 0]], [[5, 0], [6, 1], [5, 2]]]
    assert fov_geometry.join_polylines([])[0].shape == (0, 2)
