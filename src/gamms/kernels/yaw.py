"""Headings in the plane and turns in space: the yaw of a quaternion, and back."""

from math import atan2, cos, hypot, sin

_VERTICAL = 1e-9  # of a length of 1: what points less sideways than this has no heading


def yaw(quat: tuple[float, float, float, float]) -> tuple[float, float]:
    """`(cos, sin)` of the heading of what is turned by `(w, x, y, z)`; (0.0, 0.0) if it points straight up or down.

    Unturned it heads east: the heading is that of the turned x axis, seen from above.
    """
    w, x, y, z = quat
    # The same as (1 - 2(yy + zz), 2(xy + wz)) where the length is 1, and exact for a quarter of a turn.
    east, north = w * w + x * x - y * y - z * z, 2.0 * (x * y + w * z)
    level = hypot(east, north)
    return (0.0, 0.0) if level < _VERTICAL else (east / level, north / level)


def about_z(heading: tuple[float, float]) -> tuple[float, float, float, float]:
    """The turn `(w, x, y, z)` about the vertical to a heading `(cos, sin)`."""
    half = atan2(heading[1], heading[0]) / 2.0
    return (cos(half), 0.0, 0.0, sin(half))
