"""Polylines as shapely LineStrings and as arrays; areas, and boxes in degrees."""

from collections.abc import Callable, Mapping, Sequence
from itertools import chain
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from gamms.arguments import as_float
from gamms.errors import BadValue
from gamms.ir.graph import FloatArray, IntArray, read_only
from gamms.text import shown

if TYPE_CHECKING:
    from shapely import LineString, MultiPolygon, Polygon


def make_line_string(points: FloatArray | Sequence[Sequence[float]]) -> "LineString":
    """Return a shapely LineString through `points` of shape (points, 2)."""
    import shapely

    return shapely.LineString(points)


def make_polygon(points: FloatArray | Sequence[Sequence[float]]) -> "Polygon":
    """Return a shapely Polygon with the outline `points` of shape (points, 2)."""
    import shapely

    return shapely.Polygon(points)


def unite(outlines: Sequence[FloatArray]) -> "list[Polygon]":
    """Return the union of polygons with outlines (corners, 2), as shapely Polygons."""
    import shapely

    parts = shapely.get_parts(shapely.union_all([shapely.make_valid(shapely.Polygon(one)) for one in outlines]))
    return [part for part in parts if isinstance(part, shapely.Polygon)]


def buffer_lines(lines: Sequence[FloatArray], center: FloatArray, width: float) -> "Polygon | MultiPolygon":
    """Return the places within a width of lines, (points, 2) each, or of a center (x, y).

    Circles are polygons with 32 corners, as is usual: their areas are 0.6 % too small.
    """
    import shapely

    seen = {min(line.tobytes(), line[::-1].tobytes()): line for line in lines}  # streets have two directions
    strings = [shapely.LineString(line) for line in seen.values()]
    # NOTE: one buffer around all lines takes 60 times as long (Helsinki, 10,000 parts of edges).
    return shapely.union_all([shapely.Point(*center).buffer(width), *shapely.buffer(strings, width)])


def list_polygons(area: "Polygon | MultiPolygon") -> "list[Polygon]":
    """Return the polygons of an area."""
    import shapely

    return list(shapely.get_parts(area))


def are_within(points: FloatArray, corners: FloatArray) -> "np.ndarray[Any, np.dtype[np.bool_]]":
    """Return which points (points, 2) are inside a polygon (corners, 2), and not on its border."""
    import shapely

    found: np.ndarray[Any, np.dtype[np.bool_]] = shapely.contains_xy(shapely.Polygon(corners), points)
    return found


def list_rings(polygon: "Polygon") -> list[FloatArray]:
    """Return the rings of a Polygon, each (corners + 1, 2): the outer ring, then its holes in opposite direction."""
    import shapely

    return [shapely.get_coordinates(ring) for ring in shapely.get_rings(shapely.normalize(polygon))]


def find_hull(points: FloatArray) -> FloatArray:
    """Return the corners (corners, 2) of the convex hull of points (points, 2), counter-clockwise."""
    import shapely

    ring = shapely.get_coordinates(shapely.normalize(shapely.convex_hull(shapely.MultiPoint(points))))
    corners: FloatArray = ring[:0:-1]  # a ring ends at its first corner, and is clockwise
    return corners


def join_rings(rings: Sequence[FloatArray]) -> FloatArray:
    """Return one line (points, 2) along closed rings, the outer one first, each hole joined by a short seam."""
    outer, *holes = rings
    line = outer
    for hole in holes:
        apart = np.linalg.norm(line[:, None] - hole, axis=2)
        here, there = np.unravel_index(apart.argmin(), apart.shape)
        line = np.concatenate([line[: here + 1], hole[there:-1], hole[: there + 1], line[here:]])
    return line[:-1]


def find_straight_parts(
    points: FloatArray, offsets: IntArray, groups: IntArray, tolerance: float
) -> tuple[IntArray, FloatArray]:
    """Return the straight parts of lines, joined where two lines of a group meet.

    Args:
        points: (points, 2)
        offsets: (lines + 1,)
        groups: (lines,) integers from 0, without gaps.
        tolerance: by which points of a line may be beside its straight parts.

    Returns:
        The group (parts,) of each part, and its ends (parts, 2, 2).
    """
    import shapely

    lines = shapely.linestrings(points, indices=np.repeat(np.arange(len(groups)), np.diff(offsets)))
    order = np.argsort(groups, kind="stable")
    bundles = shapely.multilinestrings(lines[order], indices=groups[order])
    joined, owner = shapely.get_parts(shapely.line_merge(bundles), return_index=True)
    corners, line = shapely.get_coordinates(shapely.simplify(joined, tolerance), return_index=True)
    first = np.flatnonzero(line[1:] == line[:-1])
    return owner[line[first]], np.stack([corners[first], corners[first + 1]], axis=1)


def make_line_strings(points: FloatArray, lines: "np.ndarray[Any, np.dtype[np.int64]]") -> "list[LineString]":
    """Return many LineStrings at once: `points[i]` of shape (points, 2) belongs to line `lines[i]` (ascending)."""
    import shapely

    return list(shapely.linestrings(points, indices=lines))


def read_points(shape: object, name: str) -> FloatArray:
    """Return the points (points, 2) of a LineString, of its well-known text, or of a sequence of coordinates.

    Raises:
        BadValue: fewer than two points, or points that are not finite pairs of numbers.
    """
    try:
        shape = _parse_line(shape) if isinstance(shape, str) else shape
        coordinates: Any = getattr(shape, "coords", shape)  # raises for a shape with several parts
        given = np.array([tuple(point)[:2] for point in coordinates])
        if given.dtype.kind in "USb":
            raise TypeError("text and bools are not numbers")  # noqa: TRY301 - the except says which shape it was
        points = given.astype(np.float64)
    except (TypeError, ValueError, NotImplementedError) as error:
        raise BadValue(f"{name} must be a LineString or a list of (x, y) pairs, not {shown(shape)}: {error}") from error
    if points.ndim != 2 or points.shape[0] < 2 or points.shape[1] != 2:
        raise BadValue(f"{name} needs at least two (x, y) points, not {shown(shape)}.")
    if not np.isfinite(points).all():
        raise BadValue(f"{name} has a coordinate that is not finite: {shown(shape)}.")
    return read_only(points)


def _parse_line(text: str) -> "LineString":
    import shapely

    try:
        with np.errstate(invalid="ignore"):  # `read_points` reports coordinates that are not finite
            return shapely.from_wkt(text)
    except shapely.errors.ShapelyError as error:
        raise ValueError(f"it is not well-known text ({error})") from None


def read_polylines(shapes: Mapping[int, object], name_of: Callable[[int], str]) -> dict[int, FloatArray]:
    """Return the points (points, 2) of many LineStrings or sequences of coordinates, by row; see `read_points`."""
    found: dict[int, FloatArray] = {}
    if any(hasattr(type(shape), "coords") for shape in shapes.values()):  # otherwise shapely need not be loaded
        import shapely

        lines = {row: shape for row, shape in shapes.items() if isinstance(shape, shapely.LineString)}
        points, owners = shapely.get_coordinates(list(lines.values()), return_index=True)
        points.setflags(write=False)
        bounds = np.searchsorted(owners, np.arange(len(lines) + 1)).tolist()
        # otherwise `read_points` reports the invalid one
        if np.isfinite(points).all() and min(np.diff(bounds), default=2) > 1:
            found = {row: points[a:b] for row, a, b in zip(lines, bounds[:-1], bounds[1:], strict=True)}
    return {row: found[row] if row in found else read_points(shape, name_of(row)) for row, shape in shapes.items()}


def find_nearest_lines(
    points: FloatArray, starts: FloatArray, ends: FloatArray
) -> "tuple[np.ndarray[Any, np.dtype[np.int64]], FloatArray]":
    """Return the nearest of some line segments (lines, 2) for each of `points` (points, 2), and its distance."""
    import shapely

    tree = shapely.STRtree(shapely.linestrings(np.stack((starts, ends), axis=1)))
    (_, lines), distances = tree.query_nearest(shapely.points(points), return_distance=True, all_matches=False)
    return lines, distances


def measure_distances(points: FloatArray, starts: FloatArray, ends: FloatArray) -> FloatArray:
    """Return the distance of each of `points` (points, 2) to the line segment of the same row."""
    along = ends - starts
    to = points - starts
    square = (along * along).sum(axis=1)
    share = np.clip((to * along).sum(axis=1) / np.where(square > 0.0, square, 1.0), 0.0, 1.0)
    return np.asarray(np.hypot(*(to - share[:, None] * along).T))


def find_lines_near(
    points: FloatArray, starts: FloatArray, ends: FloatArray, distance: float
) -> "tuple[np.ndarray[Any, np.dtype[np.int64]], np.ndarray[Any, np.dtype[np.int64]]]":
    """Return pairs of rows of points (points, 2) and line segments (lines, 2) that are within a distance."""
    import shapely

    tree = shapely.STRtree(shapely.linestrings(np.stack((starts, ends), axis=1)))
    rows, lines = tree.query(shapely.points(points), predicate="dwithin", distance=distance)
    return rows, lines


class LineTree:
    """An R-tree that finds the nearest of many polylines; building it takes a second for a million lines.

    Args:
        ends: (lines, 2, 2) first and last point of each line.
        polylines: line -> (points, 2), for lines that are not straight.
    """

    def __init__(self, ends: FloatArray, polylines: Mapping[int, FloatArray]) -> None:
        import shapely

        lines = shapely.linestrings(ends)
        if polylines:
            shapes = list(polylines.values())
            counts = [len(shape) for shape in shapes]
            numbers = np.repeat(np.arange(len(shapes)), counts)
            lines[list(polylines)] = shapely.linestrings(np.concatenate(shapes), indices=numbers)
        self._tree = shapely.STRtree(lines)
        self._point = shapely.Point

    def find_nearest(self, place: tuple[float, float]) -> int:
        """Return the line nearest to a place; ties within a billionth of the distance go to the first line."""
        point = self._point(place)
        (line,), (distance,) = self._tree.query_nearest(point, return_distance=True, all_matches=False)
        as_near = self._tree.query(point, predicate="dwithin", distance=distance * (1.0 + 1e-9))
        return int(min([line, *as_near]))


class NearLines:
    """Finds polylines near points.

    Args:
        lines: (points, 2) of each line.
    """

    def __init__(self, lines: Sequence[FloatArray]) -> None:
        import shapely

        rows = np.repeat(np.arange(len(lines)), [len(line) for line in lines])
        self._lines = shapely.linestrings(np.concatenate(lines), indices=rows)
        self._tree = shapely.STRtree(self._lines)
        self._distance = shapely.distance
        self._points = shapely.points

    def find_within(self, points: FloatArray, distance: float) -> tuple[IntArray, IntArray, FloatArray]:
        """Return rows of points (points, 2), rows of lines within a distance, and the distances, (pairs,) each."""
        near = self._points(points)
        rows, lines = self._tree.query(near, predicate="dwithin", distance=distance)
        return rows, lines, self._distance(near[rows], self._lines[lines])

    def project(self, points: FloatArray, lines: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return the point of each line that is nearest to a point of (points, 2).

        Returns:
            Their positions as shares of the lengths of lines, from 0 to 1, (points,), and themselves, (points, 2).
        """
        import shapely

        chosen = self._lines[lines]
        shares = shapely.line_locate_point(chosen, self._points(points), normalized=True)
        found = shapely.get_coordinates(shapely.line_interpolate_point(chosen, shares, normalized=True))
        return shares, found


def find_nearest_point(points: FloatArray, place: tuple[float, float]) -> tuple[float, float]:
    """Return the point of a polyline (points, 2) nearest to a place.

    Returns:
        Its position as a share of the length of the polyline, from 0 to 1, and its distance from the place.
    """
    steps = np.diff(points, axis=0)
    lengths = np.hypot(*steps.T)
    squares = np.where(lengths > 0.0, lengths**2, 1.0)
    shares = np.clip(((np.array(place) - points[:-1]) * steps).sum(axis=1) / squares, 0.0, 1.0)
    off = np.hypot(*(points[:-1] + shares[:, None] * steps - place).T)
    at = int(off.argmin())
    gone = float(lengths[:at].sum() + shares[at] * lengths[at])
    whole = float(lengths.sum())
    return (gone / whole if whole else 0.0), float(off[at])


def make_region(shape: object, name: str, from_lonlat: Callable[[FloatArray], FloatArray]) -> "Polygon":
    """Return one or several polygons, prepared for many queries.

    Args:
        shape: an outline as a sequence of (x, y) pairs; a shapely polygon or multipolygon; or a GeoJSON dict, with
            positions as longitude and latitude.
        name: name of the argument, for error messages.
        from_lonlat: converts GeoJSON positions (points, 2) to x and y.

    Raises:
        BadValue: not such a shape, or it has no area, crosses itself or is not finite.
    """
    import shapely

    region: Any
    if isinstance(shape, Mapping):
        parts = [shapely.Polygon(*_read_rings(one, name, from_lonlat)) for one in _parse_polygons(shape, name)]
        region = shapely.union_all(parts) if all(part.is_valid for part in parts) else shapely.MultiPolygon(parts)
    elif isinstance(shape, (shapely.Polygon, shapely.MultiPolygon)):
        region = shape
    else:
        region = shapely.Polygon(_read_ring(shape, name))
    if not region.is_valid or region.is_empty or not np.isfinite(region.bounds).all():
        why = "it is empty" if region.is_empty else shapely.is_valid_reason(region)
        raise BadValue(f"{name} is no area: {why}.")
    shapely.prepare(region)
    return region


def _parse_polygons(shape: Mapping[Any, Any], name: str) -> list[Any]:
    """Return the coordinates of the polygons in a GeoJSON object."""
    if shape.get("type") == "FeatureCollection" and isinstance(shape.get("features"), list):
        return list(chain.from_iterable(_parse_feature_polygons(part, name) for part in shape["features"]))
    return _parse_feature_polygons(shape, name)


def _parse_feature_polygons(shape: Any, name: str) -> list[Any]:
    geometry = shape.get("geometry") if isinstance(shape, Mapping) and shape.get("type") == "Feature" else shape
    kind, coordinates = (
        geometry.get(key) if isinstance(geometry, Mapping) else None for key in ("type", "coordinates")
    )
    if kind == "Polygon" and isinstance(coordinates, (list, tuple)):
        return [coordinates]
    if kind == "MultiPolygon" and isinstance(coordinates, (list, tuple)):
        return list(coordinates)
    raise BadValue(f"{name} must be a Polygon or a MultiPolygon of GeoJSON, or features of them, not {shown(shape)}.")


def _read_rings(
    polygon: Any, name: str, from_lonlat: Callable[[FloatArray], FloatArray]
) -> tuple[FloatArray, list[FloatArray]]:
    if not isinstance(polygon, (list, tuple)) or not polygon:
        raise BadValue(f"{name} has a polygon without an outline: {shown(polygon)}.")
    outline, *holes = (from_lonlat(_read_ring(ring, name)) for ring in polygon)
    return outline, holes


def _read_ring(ring: object, name: str) -> FloatArray:
    points = read_points(ring, name)
    if len(points) < 3:
        raise BadValue(f"{name} needs at least three (x, y) points, not {shown(ring)}.")
    return points


_EAST = 180.0  # degrees of longitude and latitude
_NORTH = 90.0
_TURN = 360.0
_WIDEST = 180.0  # of a box across 180 degrees; its sides are swapped if it seems wider


class Box(NamedTuple):
    """An area between two longitudes and two latitudes, degrees; it lies across 180 degrees if west > east."""

    west: float
    south: float
    east: float
    north: float

    @property
    def is_across(self) -> bool:
        """Whether it lies across 180 degrees."""
        return self.west > self.east

    def make_region(self) -> "Polygon | MultiPolygon":
        """Return its area; of one across 180 degrees both parts."""
        import shapely

        if not self.is_across:
            return shapely.box(*self)
        sides = ((self.west, _EAST), (-_EAST, self.east))
        parts = [shapely.box(west, self.south, east, self.north) for west, east in sides if west < east]
        return shapely.MultiPolygon(parts)


def check_box(sides: Sequence[object], names: Sequence[str], name: str = "") -> Box:
    """Return a box of four checked sides: west, south, east, north.

    Args:
        sides: numbers.
        names: of the sides, for errors.
        name: of the box, for errors.

    Raises:
        BadType, BadValue: a side is no number, or the sides are impossible or swapped.
    """
    box = Box(*(as_float(side, f"{name} {of_side}".strip()) for side, of_side in zip(sides, names, strict=True)))
    given = ", ".join(f"{of_side}={side:g}" for of_side, side in zip(names, box, strict=True))
    refusal = f"{name} {given} is not an area".strip()
    west, south, east, north = names
    if max(abs(box.west), abs(box.east)) > _EAST or max(abs(box.south), abs(box.north)) > _NORTH:
        raise BadValue(f"{refusal}: longitudes are from -180 to 180 degrees, and latitudes from -90 to 90.")
    width = box.east - box.west + (_TURN if box.is_across else 0.0)
    if box.south >= box.north or width <= 0.0:
        raise BadValue(f"{refusal}: it takes {west} < {east} (longitudes) and {south} < {north} (latitudes).")
    if box.is_across and width > _WIDEST:
        raise BadValue(f"{refusal}: it takes {west} < {east}; across 180 degrees it would be {width:g} degrees wide.")
    return box


def make_area(clip: object, name: str) -> "Polygon | MultiPolygon":
    """Return a caller's area in degrees: a box (west, south, east, north), or what `make_region` takes.

    Raises:
        BadType, BadValue: it is no area in degrees, or an edge goes around the world.
    """
    sides = clip.tolist() if isinstance(clip, np.ndarray) else clip
    if isinstance(sides, (list, tuple)) and len(sides) == 4 and all(isinstance(one, (int, float)) for one in sides):
        return make_region(check_box(sides, Box._fields, name).make_region(), name, lambda lonlat: lonlat)
    region = make_region(clip, name, lambda lonlat: lonlat)
    if (np.abs(np.reshape(region.bounds, (2, 2))) > (_EAST, _NORTH)).any():
        raise BadValue(f"{name} must be in degrees of longitude and latitude; its bounds are {shown(region.bounds)}.")
    _check_edges(region, name)
    return region


def find_bounds_by_side(region: "Polygon | MultiPolygon") -> list[tuple[float, float, float, float]]:
    """Return the bounds of an area in degrees, apart for its polygons west of Greenwich and the others."""
    import shapely

    parts = shapely.get_parts(region)
    is_west = shapely.bounds(parts)[:, 2] <= 0.0
    return [tuple(shapely.total_bounds(some).tolist()) for some in (parts[is_west], parts[~is_west]) if len(some)]


def _check_edges(region: "Polygon | MultiPolygon", name: str) -> None:
    """Check that no edge of an area goes around the world, as that of an area across 180 degrees seems to do.

    Raises:
        BadValue: one does.
    """
    import shapely

    for part in shapely.get_parts(region):
        for ring in (part.exterior, *part.interiors):
            longitudes = shapely.get_coordinates(ring)[:, 0]
            steps = np.abs(np.diff(longitudes))
            long = np.flatnonzero((steps > _EAST) & (steps < _TURN))
            if len(long):
                first, second = longitudes[long[0] : long[0] + 2].tolist()
                raise BadValue(
                    f"{name} has an edge from longitude {first:g} to {second:g}, around the world. Cut an area across "
                    "180 degrees into two polygons there (RFC 7946, 3.1.9), or give a box with west > east."
                )


def are_inside(region: "Polygon", xy: FloatArray) -> "np.ndarray[Any, np.dtype[np.bool_]]":
    """Return which points (points, 2) are in a region or on its border."""
    import shapely

    found: np.ndarray[Any, np.dtype[np.bool_]] = shapely.intersects_xy(region, xy)
    return found


def find_lines_inside(
    region: "Polygon", ends: FloatArray, polylines: Mapping[int, FloatArray], *, touching: bool
) -> "np.ndarray[Any, np.dtype[np.bool_]]":
    """Return a mask of the polylines that lie completely, or partly, in a region.

    Args:
        region: see `make_region`.
        ends: (lines, 2, 2) first and last point of each line.
        polylines: line -> (points, 2), for lines that are not straight.
        touching: whether lines that are partly inside count.
    """
    import shapely

    low = ends.min(axis=1)
    high = ends.max(axis=1)
    for row, points in polylines.items():
        low[row] = points.min(axis=0)
        high[row] = points.max(axis=0)
    west, south, east, north = region.bounds
    near = np.flatnonzero(((high >= (west, south)) & (low <= (east, north))).all(axis=1))
    shapes = [polylines.get(row, ends[row]) for row in near.tolist()]
    found = np.zeros(len(ends), np.bool_)
    if shapes:
        lines = make_line_strings(
            np.concatenate(shapes), np.repeat(np.arange(len(shapes)), [len(one) for one in shapes])
        )
        found[near] = (shapely.intersects if touching else shapely.covers)(region, lines)
    return found


def import_line_string() -> "type[LineString]":
    """Return Shapely's LineString class, which 1.0.0 also offers."""
    import shapely

    return shapely.LineString  # type: ignore[no-any-return] # shapely has no types
