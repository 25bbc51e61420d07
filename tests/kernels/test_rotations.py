"""The yaw of a turn in space, and the turn about the vertical that has it."""

from math import cos, hypot, pi, sin, sqrt

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from gamms import kernels

HALF = sqrt(0.5)
ANGLES = st.floats(-pi, pi)
PARTS = st.floats(-1.0, 1.0)


@pytest.mark.parametrize(
    ("quat", "heading"),
    [
        ((1.0, 0.0, 0.0, 0.0), (1.0, 0.0)),
        ((HALF, 0.0, 0.0, HALF), (0.0, 1.0)),
        ((0.0, 0.0, 0.0, 1.0), (-1.0, 0.0)),
        ((HALF, 0.0, 0.0, -HALF), (0.0, -1.0)),
        ((HALF, 0.0, HALF, 0.0), (0.0, 0.0)),
        ((HALF, 0.0, -HALF, 0.0), (0.0, 0.0)),
        ((HALF, HALF, 0.0, 0.0), (1.0, 0.0)),
        ((0.0, 0.0, 1.0, 0.0), (-1.0, 0.0)),
    ],
    ids=["unturned", "left", "about", "right", "nose down", "nose up", "on its side", "over its head"],
)
def test_the_heading_is_that_of_the_turned_x_axis(quat, heading):
    assert kernels.compute_heading(quat) == heading


@given(quat=st.tuples(PARTS, PARTS, PARTS, PARTS))
def test_a_turn_and_the_one_back_cancel_each_other(quat):
    w, x, y, z = quat
    square = w * w + x * x + y * y + z * z
    assert kernels.multiply_quaternions(quat, (w, -x, -y, -z)) == pytest.approx((square, 0.0, 0.0, 0.0), abs=1e-12)


@given(angle=ANGLES)
def test_a_turn_about_the_vertical_has_the_yaw_it_was_made_for(angle):
    heading = (cos(angle), sin(angle))
    assert kernels.compute_heading(kernels.make_rotation(heading)) == pytest.approx(heading, abs=1e-12)
    assert hypot(*kernels.make_rotation(heading)) == pytest.approx(1.0)


@given(angle=ANGLES, pitch=st.floats(-1.5, 1.5), roll=ANGLES)
def test_pitch_and_roll_leave_the_yaw_alone(angle, pitch, roll):
    heading = (cos(angle), sin(angle))
    down = (cos(pitch / 2), 0.0, sin(pitch / 2), 0.0)
    over = (cos(roll / 2), sin(roll / 2), 0.0, 0.0)
    turned = kernels.multiply_quaternions(kernels.make_rotation(heading), kernels.multiply_quaternions(down, over))
    assert kernels.compute_heading(turned) == pytest.approx(heading, abs=1e-9)


@given(quat=st.tuples(PARTS, PARTS, PARTS, PARTS), angle=ANGLES)
def test_turning_about_the_vertical_adds_to_the_yaw(quat, angle):
    length = hypot(*quat)
    assume(length > 1e-3)
    quat = tuple(part / length for part in quat)
    x, y = kernels.compute_heading(quat)
    w, a, b, z = quat
    assume(hypot(w * w + a * a - b * b - z * z, 2 * (a * b + w * z)) > 1e-3)  # nearly vertical: hardly any yaw
    turned = kernels.compute_heading(
        kernels.multiply_quaternions(kernels.make_rotation((cos(angle), sin(angle))), quat)
    )
    assert turned == pytest.approx((x * cos(angle) - y * sin(angle), x * sin(angle) + y * cos(angle)), abs=1e-9)


@given(quat=st.tuples(PARTS, PARTS, PARTS, PARTS).filter(lambda quat: hypot(*quat) > 1e-3))
def test_a_heading_has_length_one_or_none_and_a_turn_and_its_opposite_are_the_same(quat):
    length = hypot(*quat)
    quat = tuple(part / length for part in quat)
    heading = kernels.compute_heading(quat)
    assert heading == (0.0, 0.0) or hypot(*heading) == pytest.approx(1.0)
    assert kernels.compute_heading(tuple(-part for part in quat)) == heading
