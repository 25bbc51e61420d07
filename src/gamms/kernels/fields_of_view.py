"""Fields of view: rotations in space as unit quaternions (w, x, y, z), headings, and what lies inside a cone."""

from collections.abc import Sequence
from math import atan2, cos, frexp, hypot, ldexp, sin, sqrt

import numpy as np

from gamms.ir.graph import FloatArray

Quaternion = tuple[float, float, float, float]
_UNIT = 2e-9  # how far the square of a length is from 1 at most, where the length is 1 to 1e-9
_VERTICAL = 1e-9  # of a length of 1: what points less sideways than this has no heading
_RIM = 1e-12  # radians: what lies on the rim is inside, however the angles were rounded


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
    """Return (x, y, z), the x axis after a rotation by (w, x, y, z); of length 1 for a unit quaternion."""
    w, x, y, z = quat
    return (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y))


def unit_quaternion(quat: Quaternion) -> Quaternion | None:
    """Return the finite `quat` divided by the root of the sum of its squares; None if it is zero.

    A quaternion whose length is 1 to 1e-9 is returned as it is.
    """
    w, x, y, z = quat
    if abs(w * w + x * x + y * y + z * z - 1.0) < _UNIT:  # programs compare what they set with what they read
        return quat
    largest = max(map(abs, quat))
    if largest == 0.0:
        return None
    exponent = frexp(largest)[1]  # a power of 2 changes no bit of the result, and no square overflows or vanishes
    w, x, y, z = (ldexp(part, -exponent) for part in quat)
    length = sqrt(w * w + x * x + y * y + z * z)  # not hypot, which rounds once: programs compare to the last bit
    return w / length, x / length, y / length, z / length


def yaw(quat: Quaternion) -> tuple[float, float]:
    """Return the heading `(cos, sin)` of a rotation `(w, x, y, z)`; (0.0, 0.0) if it points straight up or down.

    Unturned it heads east: the heading is that of the turned x axis, seen from above.
    """
    w, x, y, z = quat
    # The same as (1 - 2(yy + zz), 2(xy + wz)) where the length is 1, and exact for a quarter of a turn.
    east, north = w * w + x * x - y * y - z * z, 2.0 * (x * y + w * z)
    level = hypot(east, north)
    return (0.0, 0.0) if level < _VERTICAL else (east / level, north / level)


def about_z(heading: tuple[float, float]) -> Quaternion:
    """Return the rotation `(w, x, y, z)` about the vertical to a heading `(cos, sin)`."""
    half = atan2(heading[1], heading[0]) / 2.0
    return (cos(half), 0.0, 0.0, sin(half))


def squares(dx: FloatArray, dy: FloatArray, dz: FloatArray) -> FloatArray:
    """Return the squares of the lengths of offsets in space, (points,): on every machine the same bits."""
    with np.errstate(over="ignore"):  # infinitely far away is far away
        found: FloatArray = dx * dx + dy * dy + dz * dz
    return found


def in_view(
    offsets: Sequence[FloatArray], axis: Sequence[float | FloatArray], fov: float
) -> "np.ndarray[tuple[int, ...], np.dtype[np.bool_]]":
    """Return whether each offset lies within `fov / 2` radians of the axis, the rim included.

    Args:
        offsets: east, north and up from the observer, (points,) each; an offset of zero counts as straight ahead.
        axis: the direction of view, of any positive length, or those of each offset: x, y and z.
        fov: full opening angle in radians.
    """
    (x, y, z), (a, b, c) = offsets, axis
    across = np.sqrt(squares(y * c - z * b, z * a - x * c, x * b - y * a))
    seen: np.ndarray[tuple[int, ...], np.dtype[np.bool_]] = (
        np.arctan2(across, x * a + y * b + z * c) <= fov / 2.0 + _RIM
    )
    return seen


def in_cone(
    dx: FloatArray, dy: FloatArray, heading: tuple[float | FloatArray, float | FloatArray], fov: float
) -> "np.ndarray[tuple[int, ...], np.dtype[np.bool_]]":
    """Return whether each offset lies within `fov` radians around `heading`, the rim included.

    Args:
        dx: (points,) offsets from the observer.
        dy: (points,) offsets from the observer.
        heading: `(cos, sin)` of the direction of view, of any positive length; or those of each offset.
        fov: full opening angle in radians.

    An offset of zero counts as straight ahead.
    """
    off_axis = np.abs(np.arctan2(dy, dx) - np.arctan2(heading[1], heading[0]))
    off_axis = np.minimum(off_axis, 2.0 * np.pi - off_axis)
    rim = fov / 2.0 + _RIM
    seen: np.ndarray[tuple[int, ...], np.dtype[np.bool_]] = (off_axis <= rim) | ((dx == 0.0) & (dy == 0.0))
    return seen


def cone(heading: tuple[float, float], fov: float) -> tuple[float, float]:
    """Return the direction of a heading (cos, sin), and how far from it directions are inside `fov`; both radians."""
    return atan2(heading[1], heading[0]), fov / 2.0 + _RIM
