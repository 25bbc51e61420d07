"""Rotations in space as unit quaternions `(w, x, y, z)`, and cones around an axis."""

from math import hypot

import numpy as np

from gamms.ir.graph import FloatArray

Quaternion = tuple[float, float, float, float]

_RIM = 1e-12  # radians: what lies on the rim is inside, however the angles were rounded


def multiply_quaternions(q1: Quaternion, q2: Quaternion) -> Quaternion:
    """Hamilton's product: the rotation `q2`, then `q1`."""
    w1, x1, y1, z1 = q1
    w2, x2, y2, z2 = q2
    return (
        w1 * w2 - x1 * x2 - y1 * y2 - z1 * z2,
        w1 * x2 + x1 * w2 + y1 * z2 - z1 * y2,
        w1 * y2 - x1 * z2 + y1 * w2 + z1 * x2,
        w1 * z2 + x1 * y2 - y1 * x2 + z1 * w2,
    )


def quaternion_to_direction(quat: Quaternion) -> tuple[float, float, float]:
    """Where the x axis points after a rotation; of length 1 for a unit quaternion."""
    w, x, y, z = quat
    return (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y))


def unit_quaternion(quat: Quaternion) -> Quaternion | None:
    """`quat` at length 1; None if it is zero or not finite."""
    scale = max(map(abs, quat))  # first, so that no square overflows or vanishes
    if not 0.0 < scale < np.inf:
        return None
    w, x, y, z = (part / scale for part in quat)
    length = hypot(w, x, y, z)
    return w / length, x / length, y / length, z / length


def in_view(
    offsets: FloatArray, axis: tuple[float, float, float], fov: float
) -> "np.ndarray[tuple[int, ...], np.dtype[np.bool_]]":
    """Whether each offset lies within `fov / 2` radians of the axis, the rim included.

    Args:
        offsets: (points, 3) from the observer; an offset of zero counts as straight ahead.
        axis: the direction of view, of any positive length.
        fov: full opening angle in radians.
    """
    across = np.linalg.norm(np.cross(offsets, axis), axis=1)
    seen: np.ndarray[tuple[int, ...], np.dtype[np.bool_]] = (
        np.arctan2(across, offsets @ np.array(axis)) <= fov / 2.0 + _RIM
    )
    return seen
