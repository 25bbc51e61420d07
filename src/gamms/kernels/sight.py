"""Who lies inside a field of view."""

from math import atan2, pi

import numpy as np

from gamms.ir.graph import FloatArray

_RIM = 1e-12  # radians: what lies on the rim is inside, however the angles were rounded


def in_cone(
    dx: FloatArray, dy: FloatArray, heading: tuple[float, float], fov: float
) -> "np.ndarray[tuple[int, ...], np.dtype[np.bool_]]":
    """Whether each offset lies within `fov` radians around `heading`, the rim included.

    Args:
        dx: (points,) offsets from the observer.
        dy: (points,) offsets from the observer.
        heading: `(cos, sin)` of the direction of view, of any positive length.
        fov: full opening angle in radians.

    An offset of zero counts as straight ahead.
    """
    off_axis = np.abs(np.arctan2(dy, dx) - np.arctan2(heading[1], heading[0]))
    off_axis = np.minimum(off_axis, 2.0 * np.pi - off_axis)
    rim = fov / 2.0 + _RIM
    seen: np.ndarray[tuple[int, ...], np.dtype[np.bool_]] = (off_axis <= rim) | ((dx == 0.0) & (dy == 0.0))
    return seen


def is_in_cone(dx: float, dy: float, heading: tuple[float, float], fov: float) -> bool:
    """`in_cone` of one offset."""
    # NOTE: NumPy takes longer for a handful of offsets than `math` does (benchmarks/README.md, AGENT_ARC among 10).
    off_axis = abs(atan2(dy, dx) - atan2(heading[1], heading[0]))
    return min(off_axis, 2.0 * pi - off_axis) <= fov / 2.0 + _RIM or (dx == 0.0 and dy == 0.0)
