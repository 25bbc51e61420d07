"""Polylines as shapely LineStrings and as arrays."""

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from gamms.errors import BadValue
from gamms.ir.graph import FloatArray
from gamms.text import shown

if TYPE_CHECKING:
    from shapely import LineString, Polygon


def line_string(points: FloatArray | Sequence[Sequence[float]]) -> "LineString":
    """Return a shapely LineString through `points` of shape (points, 2)."""
    import shapely

    return shapely.LineString(points)


def polygon(points: FloatArray | Sequence[Sequence[float]]) -> "Polygon":
    """Return a shapely Polygon with the outline `points` of shape (points, 2)."""
    import shapely

    return shapely.Polygon(points)


def line_strings(points: FloatArray, lines: "np.ndarray[Any, np.dtype[np.int64]]") -> "list[LineString]":
    """Return many LineStrings at once: `points[i]` of shape (points, 2) belongs to line `lines[i]` (ascending)."""
    import shapely

    return list(shapely.linestrings(points, indices=lines))


def points_of(shape: object, name: str) -> FloatArray:
    """Return the points (points, 2) of a LineString or a sequence of coordinates.

    Raises:
        BadValue: fewer than two points, or points that are not finite pairs of numbers.
    """
    try:
        coordinates: Any = getattr(shape, "coords", shape)  # of a shape with several parts this raises
        given = np.array([tuple(point)[:2] for point in coordinates])
        if given.dtype.kind in "USb":
            raise TypeError("text and bools are no numbers")  # noqa: TRY301 - the except says which shape it was
        points = given.astype(np.float64)
    except (TypeError, ValueError, NotImplementedError) as error:
        raise BadValue(f"{name} must be a LineString or a list of (x, y) pairs, not {shown(shape)}: {error}") from error
    if points.ndim != 2 or points.shape[0] < 2 or points.shape[1] != 2:
        raise BadValue(f"{name} needs at least two (x, y) points, not {shown(shape)}.")
    if not np.isfinite(points).all():
        raise BadValue(f"{name} has a coordinate that is not finite: {shown(shape)}.")
    points.setflags(write=False)
    return points


def polylines_of(shapes: Mapping[int, object], name_of: Callable[[int], str]) -> dict[int, FloatArray]:
    """Return the points (points, 2) of many LineStrings or sequences of coordinates, by row; see `points_of`."""
    found: dict[int, FloatArray] = {}
    if any(hasattr(type(shape), "coords") for shape in shapes.values()):  # else shapely need not be loaded
        import shapely

        lines = {row: shape for row, shape in shapes.items() if isinstance(shape, shapely.LineString)}
        points, owners = shapely.get_coordinates(list(lines.values()), return_index=True)
        points.setflags(write=False)
        bounds = np.searchsorted(owners, np.arange(len(lines) + 1)).tolist()
        if np.isfinite(points).all() and min(np.diff(bounds), default=2) > 1:  # else `points_of` says which is wrong
            found = {row: points[a:b] for row, a, b in zip(lines, bounds[:-1], bounds[1:], strict=True)}
    return {row: found[row] if row in found else points_of(shape, name_of(row)) for row, shape in shapes.items()}


def distances_to_lines(points: FloatArray, starts: FloatArray, ends: FloatArray) -> FloatArray:
    """Return the distance of each of `points` (points, 2) to the nearest of some straight lines (lines, 2)."""
    import shapely

    tree = shapely.STRtree(shapely.linestrings(np.stack((starts, ends), axis=1)))
    (rows, _), near = tree.query_nearest(shapely.points(points), return_distance=True, all_matches=False)
    distances = np.empty(len(points))
    distances[rows] = near
    return distances


def line_string_class() -> "type[LineString]":
    """Return Shapely's LineString itself, which 1.0.0 could be asked for."""
    import shapely

    return shapely.LineString  # type: ignore[no-any-return] # shapely has no types
