"""Probabilities that depend on distance, for detections by sensors and for message loss."""

from collections.abc import Callable, Iterable
from numbers import Real
from typing import cast

import numpy as np

from gamms.errors import BadType, BadValue
from gamms.ir.graph import FloatArray
from gamms.text import shown


def as_chances(given: object, name: str, *, or_function: bool = False) -> FloatArray:
    """Return the points (points, 2) of a probability curve: ascending distances, and the probability at each.

    Args:
        given: a number, for all distances, or pairs `(distance, probability)`.
        name: name of the value, for error messages.
        or_function: whether a function is also accepted, for error messages.

    Raises:
        BadType, BadValue: the value is neither.
    """
    pairs: object = [(0.0, given)] if isinstance(given, Real) else given
    points = _check_points(cast("Iterable[tuple[float, float]]", pairs), given, name, or_function=or_function)
    if not np.isfinite(points).all() or (points[:, 1] < 0.0).any() or (points[:, 1] > 1.0).any():
        raise BadValue(f"{name} must have probabilities from 0 to 1, not {shown(given)}.")
    if (np.diff(points[:, 0]) <= 0.0).any():
        raise BadValue(f"The distances of {name} must ascend, not {shown(given)}.")
    return points


def interpolate_chances(distances: FloatArray, points: FloatArray) -> FloatArray:
    """Return probabilities at distances (distances,), by linear interpolation between the points."""
    return np.interp(distances, points[:, 0], points[:, 1])


def compute_chances(function: Callable[[FloatArray], object], distances: FloatArray, name: str) -> FloatArray:
    """Return the probabilities from a caller's function at distances (distances,).

    Raises:
        BadValue: the function returns invalid values, or too many or too few.
    """
    chances = np.asarray(function(distances), np.float64)
    if chances.shape != distances.shape or not ((chances >= 0.0) & (chances <= 1.0)).all():
        raise BadValue(
            f"{name} must give a probability from 0 to 1 for each of {len(distances)} distances, not {shown(chances)}."
        )
    return chances


def _check_points(pairs: Iterable[tuple[float, float]], given: object, name: str, *, or_function: bool) -> FloatArray:
    try:
        points = np.array([(float(distance), float(chance)) for distance, chance in pairs])
    except (TypeError, ValueError, OverflowError):
        forms = ["a probability", "pairs (distance, probability)", *(["a function of distances"] * or_function)]
        raise BadType(f"{name} must be {', '.join(forms[:-1])} or {forms[-1]}, not {shown(given)}.") from None
    if not len(points):
        raise BadValue(f"{name} needs at least one pair (distance, probability).")
    return points
