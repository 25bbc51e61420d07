"""The one door to shapely: polylines in and out of its LineString."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from gamms.errors import BadValue
from gamms.ir.graph import FloatArray
from gamms.text import shown

if TYPE_CHECKING:
    from shapely import LineString, Polygon


def line_string(points: FloatArray | Sequence[Sequence[float]]) -> "LineString":
    """A shapely LineString through `points` of shape (points, 2)."""
    import shapely

    return shapely.LineString(points)


def polygon(points: FloatArray | Sequence[Sequence[float]]) -> "Polygon":
    """A shapely Polygon with the outline `points` of shape (points, 2)."""
    import shapely

    return shapely.Polygon(points)


def line_strings(points: FloatArray, lines: "np.ndarray[Any, np.dtype[np.int64]]") -> "list[LineString]":
    """Many LineStrings at once: `points[i]` of shape (points, 2) belongs to line `lines[i]` (ascending)."""
    import shapely

    return list(shapely.linestrings(points, indices=lines))


def points_of(shape: Any, name: str) -> FloatArray:
    """The points (points, 2) of a LineString or a sequence of coordinates.

    Raises:
        BadValue: fewer than two points, or points that are not finite pairs of numbers.
    """
    try:
        coordinates = getattr(shape, "coords", shape)  # of a shape with several parts this raises
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


def points_of_many(shapes: Sequence[Any]) -> tuple[FloatArray, "np.ndarray[Any, np.dtype[np.int64]]"]:
    """The points of many LineStrings at once: `points` (points, 2) and `offsets` (shapes + 1,) into them.

    Raises:
        BadValue: one of them is no LineString.
    """
    import shapely

    for shape in shapes:
        if not isinstance(shape, shapely.LineString) or shape.is_empty:
            raise BadValue(f"A linestring or geometry must be a LineString with points, not {shown(shape)}.")
    points, lines = shapely.get_coordinates(shapes, return_index=True)
    points.setflags(write=False)
    offsets = np.searchsorted(lines, np.arange(len(shapes) + 1))
    return points, offsets


def distances_to_lines(points: FloatArray, starts: FloatArray, ends: FloatArray) -> FloatArray:
    """Return the distance of each of `points` (points, 2) to the nearest of some straight lines (lines, 2)."""
    import shapely

    tree = shapely.STRtree(shapely.linestrings(np.stack((starts, ends), axis=1)))
    (rows, _), near = tree.query_nearest(shapely.points(points), return_distance=True, all_matches=False)
    distances = np.empty(len(points))
    distances[rows] = near
    return distances


def line_string_class() -> "type[LineString]":
    """Shapely's LineString itself, which 1.0.0 could be asked for."""
    import shapely

    return shapely.LineString  # type: ignore[no-any-return] # shapely has no types
