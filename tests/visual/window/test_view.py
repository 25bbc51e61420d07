"""The camera of the window: conversions, bounds, and what it does not see."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gamms.errors import BadValue
from gamms.visual import RenderManager

COORDINATE = st.floats(-1e4, 1e4)
VIEWS = st.builds(
    RenderManager,
    st.none(),
    COORDINATE,
    COORDINATE,
    st.floats(0.5, 1e4),
    st.integers(1, 3000),
    st.integers(1, 3000),
)


@given(VIEWS, COORDINATE, COORDINATE)
def test_screen_and_world_are_each_others_inverse(view, x, y):
    there = view.world_to_screen(x, y)
    assert view.screen_to_world(*there) == pytest.approx((x, y), abs=1e-5)
    assert view.viewport_to_screen(*view.screen_to_viewport(*there)) == pytest.approx(there, abs=1e-5)
    assert view.screen_to_world_scale(view.world_to_screen_scale(x)) == pytest.approx(x, abs=1e-6)
    assert view.viewport_to_screen_scale(view.screen_to_viewport_scale(x)) == pytest.approx(x, abs=1e-6)


@given(VIEWS)
def test_the_bounds_are_the_corners_of_the_screen(view):
    left_top = view.screen_to_world(0, 0)
    right_low = view.screen_to_world(view.screen_width, view.screen_height)
    assert left_top == pytest.approx((view.bound_left, view.bound_bottom), abs=1e-6)
    assert right_low == pytest.approx((view.bound_right, view.bound_top), abs=1e-6)
    assert view.bound_right - view.bound_left == pytest.approx(2 * view.camera_size, abs=1e-6)
    assert view.bound_bottom - view.bound_top == pytest.approx(2 * view.camera_size_y, abs=1e-6)


def test_conversions_are_those_of_1_0_0():
    view = RenderManager(None, 55, 10, 110.0, 1280, 720)
    assert view.world_to_screen(3, 4) == pytest.approx((337.45454545, 394.90909090))
    assert view.screen_to_world(100, 50) == pytest.approx((-37.8125, 63.28125))
    assert view.world_to_screen_scale(5) == pytest.approx(29.0909090)
    assert view.viewport_to_screen(0.5, 0.25) == (640, 180)
    assert (view.bound_top, view.bound_bottom, view.aspect_ratio) == (-51.875, 71.875, 1280 / 720)


def test_setting_a_value_moves_the_view():
    view = RenderManager(None)
    view.camera_x, view.camera_y, view.camera_size = 1, 2, 5
    view.screen_width, view.screen_height = 100, 50
    assert (view.bound_left, view.bound_right, view.bound_top, view.bound_bottom) == (-4, 6, -0.5, 4.5)
    view.set_origin(3.7, 4.2, 100, 100)
    assert (view.camera_x, view.camera_y, view.camera_size) == (3, 4, 5)


@pytest.mark.parametrize("bad", [0, -1.0])
def test_an_impossible_size_is_refused_and_changes_nothing(bad):
    view = RenderManager(None)
    with pytest.raises(BadValue):
        view.camera_size = bad
    with pytest.raises(BadValue):
        view.set_screen_size(100, 0)
    assert (view.camera_size, view.screen_width, view.screen_height) == (15, 1280, 720)


def test_a_shape_across_the_view_with_all_points_outside_is_not_culled():
    view = RenderManager(None, 0, 0, 10, 100, 100)
    assert not view.check_line_culled(-50, 0, 50, 1)
    assert not view.check_lines_culled([(-50, 50), (-50, 0), (50, 0), (50, 50), (-50, 50)])
    assert not view.check_polygon_culled([(-50, -50), (50, -50), (50, 50), (-50, 50)])
    assert view.check_polygon_culled([(20, -50), (50, -50), (50, 50), (20, 50)])
    assert view.check_polygon_culled([(21, 0), (0, 21), (50, 50)])


def test_circles_and_rectangles_are_culled_by_their_drawn_size():
    view = RenderManager(None, 0, 0, 10, 100, 100)
    assert not view.check_circle_culled(14, 0, 5)
    assert view.check_circle_culled(14, 14, 5)
    assert not view.check_rectangle_culled(-11, 0, 6, 1)  # five pixels to the left, six wide
    assert view.check_rectangle_culled(-11, 0, 4, 1)


@given(VIEWS, st.floats(0.5, 2.0), st.floats(0, 1), st.floats(0, 1))
def test_zooming_keeps_the_point_under_the_pointer(view, factor, right, down):
    pointer = right * view.screen_width, down * view.screen_height
    before, size = view.screen_to_world(*pointer), view.camera_size
    view.zoom(factor, pointer)
    assert view.screen_to_world(*pointer) == pytest.approx(before, abs=1e-6 * size + 1e-6)
    assert view.camera_size == pytest.approx(size * factor)


@given(VIEWS)
def test_frames_are_painted_through_a_camera_on_whole_pixels(view):
    camera = view.camera()
    for value in (camera.left * camera.scale, camera.top * camera.scale):
        assert value == pytest.approx(round(value), abs=1e-4)
    assert abs(camera.left - view.bound_left) * camera.scale <= 0.51
    assert abs(camera.top - view.bound_bottom) * camera.scale <= 0.51


@given(VIEWS, st.lists(st.tuples(COORDINATE, COORDINATE), min_size=2, max_size=5))
def test_a_line_with_a_point_in_view_is_never_culled(view, points):
    inside = [view.bound_left <= x <= view.bound_right and view.bound_top <= y <= view.bound_bottom for x, y in points]
    if any(inside):
        assert not view.check_lines_culled(points)
    low, high = np.min(points, axis=0), np.max(points, axis=0)
    if low[0] > view.bound_right + 1e-9 or high[0] < view.bound_left - 1e-9:  # beyond rounding
        assert view.check_lines_culled(points)


MARGIN = st.floats(0.0, 90.0)


@given(VIEWS, *[st.floats(-1e3, 1e3)] * 2, *[st.floats(0.1, 1e3)] * 2, st.tuples(*[MARGIN] * 4))
def test_a_box_is_seen_between_its_margins_and_in_the_middle_where_it_can_be(view, x, y, across, up, margins):
    view.set_screen_size(max(view.screen_width, 200), max(view.screen_height, 200))
    view.look_at_box(np.array([x, y]), np.array([x + across, y + up]), margins)
    (left, low), (right, high) = view.world_to_screen(x, y), view.world_to_screen(x + across, y + up)
    ends = [(left, view.screen_width - right, margins[0::2]), (high, view.screen_height - low, margins[1::2])]
    for first, last, (least, least_last) in ends:
        assert first >= least - 1e-3
        assert last >= least_last - 1e-3
        assert first == pytest.approx(last, abs=1e-3) or min(first - least, last - least_last) < 1e-3
    assert min(min(first - least, last - least_last) for first, last, (least, least_last) in ends) < 1e-3
