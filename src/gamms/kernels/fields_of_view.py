"""Fields of view: rotations as unit quaternions (w, x, y, z), headings, and tests of points against a cone."""

from collections.abc import Sequence
from math import atan2, cos, frexp, hypot, ldexp, sin, sqrt

import numpy as np

from gamms.ir.graph import FloatArray

Quaternion = tuple[float, float, float, float]
_UNIT = 2e-9  # how far the square of a length may differ from 1, if the length differs by 1e-9
_VERTICAL = 1e-9  # share of the length: a direction less horizontal than this has no heading
_RIM = 1e-12  # radians: points on the border are inside in spite of rounding


def multiply_quaternions(q1: Quaternion, q2: Quaternion) -> Quaternion:
    """Return Hamilton's product of two quaternions (w, x, y, z): the rotation `q2`, then `q1`."""
    w1, x1, y1, z1 = q1
    w2, x2, y2, z2 = q2
    return (
        w1 * w2 - x1 * x2 - y1 * y2 - z1 * z2,
        w1 * x2 + x1 * w2 + y1 * z2 - z1 * y2,
        w1 * y2 - x1 * z2 + y1 * w2 + z1 * x2,
        w1 * z2 + x1 * y2 - y1 * x2 + z1 * w2,
    )


def quaternion_to_direction(quat: Quaternion) -> tuple[float, float, float]:
    """Rotate the x axis by (w, x, y, z), and return (x, y, z); of length 1 for a unit quaternion."""
    w, x, y, z = quat
    return (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y))


def normalize_quaternion(quat: Quaternion) -> Quaternion | None:
    """Return the finite `quat` divided by its length; None if it is zero.

    A quaternion whose length is 1 to within 1e-9 is returned unchanged.
    """
    w, x, y, z = quat
    if abs(w * w + x * x + y * y + z * z - 1.0) < _UNIT:  # programs compare the value they set with the value they read
        return quat
    largest = max(map(abs, quat))
    if largest == 0.0:
        return None
    exponent = frexp(largest)[1]  # a power of 2 changes no bit of the result, and no square overflows or vanishes
    w, x, y, z = (ldexp(part, -exponent) for part in quat)
    # Not hypot, which rounds differently: programs compare to the last bit.
    length = sqrt(w * w + x * x + y * y + z * z)
    return w / length, x / length, y / length, z / length


def compute_heading(quat: Quaternion) -> tuple[float, float]:
    """Return the heading `(cos, sin)` of a rotation `(w, x, y, z)`; (0.0, 0.0) if it points straight up or down.

    The heading of the identity is east: the rotated x axis, seen from above.
    """
    w, x, y, z = quat
    # Equals (1 - 2(yy + zz), 2(xy + wz)) for length 1, and is exact for a quarter turn.
    east = w * w + x * x - y * y - z * z
    north = 2.0 * (x * y + w * z)
    level = hypot(east, north)
    return (0.0, 0.0) if level < _VERTICAL else (east / level, north / level)


def make_rotation(heading: tuple[float, float]) -> Quaternion:
    """Return the rotation `(w, x, y, z)` about the vertical axis to a heading `(cos, sin)`."""
    half = atan2(heading[1], heading[0]) / 2.0
    return (cos(half), 0.0, 0.0, sin(half))


def compute_squares(dx: FloatArray, dy: FloatArray, dz: FloatArray) -> FloatArray:
    """Return the squared lengths of offsets in space, (points,), with the same bits on every machine."""
    with np.errstate(over="ignore"):  # an infinite distance is a valid result
        found: FloatArray = dx * dx + dy * dy + dz * dz
    return found


def find_in_view(
    offsets: Sequence[FloatArray], axis: Sequence[float | FloatArray], fov: float
) -> "np.ndarray[tuple[int, ...], np.dtype[np.bool_]]":
    """Return whether each offset lies within `fov / 2` radians of the axis, the border included.

    Args:
        offsets: east, north and up from the observer, (points,) each; an offset of zero counts as straight ahead.
        axis: the viewing direction x, y and z, of any positive length; one for all offsets or one for each.
        fov: full opening angle in radians.
    """
    x, y, z = offsets
    a, b, c = axis
    across = np.sqrt(compute_squares(y * c - z * b, z * a - x * c, x * b - y * a))
    seen: np.ndarray[tuple[int, ...], np.dtype[np.bool_]] = (
        np.arctan2(across, x * a + y * b + z * c) <= fov / 2.0 + _RIM
    )
    return seen


def find_in_cone(
    dx: FloatArray, dy: FloatArray, heading: tuple[float | FloatArray, float | FloatArray], fov: float
) -> "np.ndarray[tuple[int, ...], np.dtype[np.bool_]]":
    """Return whether each offset lies within `fov` radians around `heading`, the border included.

    Args:
        dx: (points,) offsets from the observer.
        dy: (points,) offsets from the observer.
        heading: `(cos, sin)` of the viewing direction, of any positive length; one for all offsets or one for each.
        fov: full opening angle in radians.

    An offset of zero counts as straight ahead.
    """
    off_axis = np.abs(np.arctan2(dy, dx) - np.arctan2(heading[1], heading[0]))
    off_axis = np.minimum(off_axis, 2.0 * np.pi - off_axis)
    rim = fov / 2.0 + _RIM
    seen: np.ndarray[tuple[int, ...], np.dtype[np.bool_]] = (off_axis <= rim) | ((dx == 0.0) & (dy == 0.0))
    return seen


def compute_cone(heading: tuple[float, float], fov: float) -> tuple[float, float]:
    """Return the angle of a heading (cos, sin) and the half angle of the field of view `fov`; both in radians."""
    return atan2(heading[1], heading[0]), fov / 2.0 + _RIM
