"""Footprints: which tagged objects are walls, their heights, and their outlines as shapely polygons, in bulk."""

import math
import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from gamms import kernels
from gamms.arguments import as_float, as_int
from gamms.errors import BadType, BadValue
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.ir.projection import WGS84, find_utm_crs, project, turn_longitudes
from gamms.limits import refuse_above
from gamms.text import shown

if TYPE_CHECKING:
    from shapely import STRtree
    from shapely.geometry.base import BaseGeometry

HeightEstimates = Mapping[tuple[str, str], tuple[float, int]]  # (key, value or "*") -> (height in meters, type)
TagFilter = Mapping[str, bool | str | Iterable[str]]  # key -> True for every value, or the values

ANY = "*"
PART = "building:part"
BARRIER_TYPE = 37  # the types of gamms 1.0.0 end at 36
_LEVEL_M = 3.0
_FOOT_M = 0.3048
_INCH_M = 0.0254
_TALLEST_M = 1000.0  # greater heights are typing errors
_LONGEST = 255  # letters of a value, the limit of OpenStreetMap
_UNITS = {  # letters after a number -> meters
    **dict.fromkeys(("", "m", "metre", "metres", "meter", "meters"), 1.0),
    **dict.fromkeys(("'", "ft", "feet", "foot"), _FOOT_M),
    **dict.fromkeys(("level", "levels", "floor", "floors", "storey", "storeys", "stories"), _LEVEL_M),
}
_NUMBER = r"([0-9]+(?:[.,][0-9]+)?|[.,][0-9]+)"
_WORD = "(" + "|".join(sorted(filter(None, _UNITS), key=len, reverse=True)) + ")?"
_INCHES = rf"(?:\s*{_NUMBER}\s*(?:\"|''|\u201d|in|inch|inches))?"
_SIZE = rf"{_NUMBER}\s*{_WORD}{_INCHES}"
_HEIGHT = re.compile(rf"(?:~|ca\.?|about|approx\.?)?\s*{_SIZE}(?:\s*(?:-|\u2013|;|to)\s*{_SIZE})?(?:\s*[,;(].*)?")
_NO_WALLS = ("no", "roof", "carport", "proposed", "construction", "razed", "demolished")
_BURIED = ("underground", "underwater")
_ON_ROOFS = ("roof", "rooftop")
_WHOLE = re.compile(r"-?[0-9]{1,3}")


class WallProfile(NamedTuple):
    """The heights and the type of the walls around one footprint."""

    base: float  # meters above the ground
    top: float  # meters above the ground
    type: int
    key: str = "building"  # the tag that makes it a wall
    is_measured: bool = True  # whether tags give its height


class WallRules:
    """Checked tables that decide which tagged objects are walls, and how high.

    Args:
        tags: select only objects with one of these tags; None: all.
        estimates: (key, value) -> (height, type); `"*"` as the value stands for every other one. An exact row beats
            a `"*"`, and the last of several rows counts.
        barriers: value of `barrier` -> height, for lines that are walls.

    Raises:
        BadType, BadValue: a table has another form.
    """

    def __init__(
        self, tags: TagFilter | None, estimates: HeightEstimates, barriers: Mapping[str, float] | None = None
    ) -> None:
        self._tags = None if tags is None else check_filter(tags)
        self._estimates = _check_estimates(estimates)
        self._rank = {row: rank for rank, row in enumerate(self._estimates)}
        self._barriers = dict(barriers or {})
        self.keys = sorted({key for key, _ in self._estimates})
        self.has_barriers = bool(self._barriers)

    def find_wall(self, tags: Mapping[str, str]) -> WallProfile | None:
        """Return the walls around an area with these tags, or None."""
        if _is_off_the_ground(tags) or not (self._tags is None or is_asked_for(tags, self._tags)):
            return None
        row = self._find_row(tags)
        if row is None:
            return None
        estimate, type = self._estimates[row]
        return _make_wall(tags, estimate, type, row[0])

    def find_barrier(self, tags: Mapping[str, str]) -> WallProfile | None:
        """Return the wall along a line with these tags, or None."""
        estimate = self._barriers.get(tags.get("barrier", ""))
        if estimate is None or _is_off_the_ground(tags):
            return None
        return _make_wall(tags, estimate, BARRIER_TYPE, "barrier")

    def _find_row(self, tags: Mapping[str, str]) -> tuple[str, str] | None:
        given = [(key, tags[key]) for key in self.keys if key in tags]
        exact = [row for row in given if row in self._rank]
        others = [(key, ANY) for key, value in given if value not in _NO_WALLS and (key, ANY) in self._rank]
        return max(exact or others, key=self._rank.__getitem__, default=None)


def _is_off_the_ground(tags: Mapping[str, str]) -> bool:
    """Return whether an object lies under the ground, or on a roof, such as solar panels."""
    location = tags.get("location")
    return location in _BURIED or location in _ON_ROOFS or find_layer(tags) < 0


def is_in_the_way(tags: Mapping[str, str]) -> bool:
    """Return whether an area with these tags blocks ways: it is a building that stands on the ground."""
    is_building = tags.get("building", "no") not in _NO_WALLS and not _is_off_the_ground(tags)
    return is_building and not (parse_height(tags.get("min_height")) or _parse_levels(tags.get("building:min_level")))


def find_layer(tags: Mapping[str, str]) -> int:
    """Return the layer in the tags: negative below other objects; 0 by default."""
    text = tags.get("layer", "")
    return int(text) if _WHOLE.fullmatch(text) else 0


def _make_wall(tags: Mapping[str, str], estimate: float, type: int, key: str) -> WallProfile:
    said = parse_height(tags.get("height")) or parse_height(tags.get("est_height")) or _find_height_of_stories(tags)
    top = said or estimate
    base = parse_height(tags.get("min_height")) or _parse_levels(tags.get("building:min_level")) or 0.0
    return WallProfile(base if base < top else 0.0, top, type, key, said is not None)


def _find_height_of_stories(tags: Mapping[str, str]) -> float | None:
    """Return the height of the tagged stories, with the roof."""
    body = _parse_levels(tags.get("building:levels"))
    if body is None:
        return None
    roof = parse_height(tags.get("roof:height")) or _parse_levels(tags.get("roof:levels")) or 0.0
    return min(body + roof, _TALLEST_M)


def _parse_levels(text: str | None) -> float | None:
    return parse_height(text, {"": _LEVEL_M})


def parse_height(text: str | None, units: Mapping[str, float] = _UNITS) -> float | None:
    """Return a height as mappers write it, such as "12", "12.5 m", "12 ft 6 in" or "4 storeys", in meters.

    A range such as "10-12" gives its lower end, which is certain. None if the text is not a height, is not positive, or
    is above 1000 m.
    """
    # Without this limit, runs of spaces would take cubic time.
    words = " ".join(text.lower().split()) if text is not None and len(text) <= _LONGEST else ""
    found = _HEIGHT.fullmatch(words)
    if found is None:
        return None
    number, unit, inches, other, other_unit, other_inches = found.groups()
    sizes = [(number, unit or other_unit, inches), (other, other_unit or unit, other_inches)]
    heights = [_parse_metres(*size, units) for size in sizes if size[0] is not None]
    return min((metres for metres in heights if 0.0 < metres <= _TALLEST_M), default=None)


def _parse_metres(number: str, unit: str | None, inches: str | None, units: Mapping[str, float]) -> float:
    factor = units.get(unit or "", math.nan)
    if inches is not None and factor != _FOOT_M:
        return math.nan
    return float(number.replace(",", ".")) * factor + float((inches or "0").replace(",", ".")) * _INCH_M


# -- the tables of a caller -------------------------------------------------------------------------------------


def check_filter(tags: object) -> dict[str, tuple[str, ...] | None]:
    """Return a checked filter of tags: key -> the values, or None for any.

    Raises:
        BadType: the filter has another form.
    """
    if not isinstance(tags, Mapping):
        raise BadType(f"tags must be a dict such as {{'building': True}}, not {shown(tags)} ({type(tags).__name__}).")
    checked: dict[str, tuple[str, ...] | None] = {}
    for key, values in tags.items():
        if isinstance(key, str) and isinstance(values, bool):
            checked.update({key: None} if values else {})
            continue
        texts: tuple[Any, ...] = (values,)
        if isinstance(values, Iterable) and not isinstance(values, str):
            texts = tuple(values)
        if not all(isinstance(text, str) for text in (key, *texts)):
            raise BadType(f"tags[{shown(key)}] must be True, a value or a list of values, not {shown(values)}.")
        checked[key] = texts
    return checked


def is_asked_for(tags: Mapping[str, str], wanted: Mapping[str, Collection[str] | None]) -> bool:
    """Return whether an object has one of the wanted tags; `wanted` comes from `check_filter`."""
    return any(values is None or tags[key] in values for key, values in wanted.items() if key in tags)


def _check_estimates(estimates: object) -> dict[tuple[str, str], tuple[float, int]]:
    if not isinstance(estimates, Mapping):
        raise BadType(f"height_estimates must be a dict, not {shown(estimates)}. Start from HEIGHT_ESTIMATES_TYPES.")
    checked: dict[tuple[str, str], tuple[float, int]] = {}
    for row, estimate in estimates.items():
        name = f"height_estimates[{shown(row)}]"
        if not (isinstance(row, tuple) and len(row) == 2 and all(isinstance(part, str) for part in row)):
            raise BadType(f"{name}: its key must be two strings such as ('building', 'house').")
        try:
            height, type = estimate
        except (TypeError, ValueError):
            raise BadType(f"{name} must be (height in meters, type), not {shown(estimate)}.") from None
        metres = as_float(height, f"The height in {name}")
        if metres <= 0.0:
            raise BadValue(f"The height in {name} must be more than 0 m, not {metres}.")
        checked[row] = (metres, as_int(type, f"The type in {name}"))
    return checked


_ENTERS = "T********"  # DE-9IM pattern for lines and areas: their interiors intersect
_ROUNDING = 1e-8  # degrees, a millimeter: tolerance for a way along a wall
RING_ROLES = ("outer", "inner", "")  # roles of the ways that enclose a multipolygon
_BYTES_PER_CELL = 1 << 20  # of the map in a cell

Shapes = np.ndarray[Any, np.dtype[np.object_]]


@dataclass(slots=True, frozen=True, eq=False)
class Outlines:
    """Lines around footprints: line `i` visits the positions `offsets[i]:offsets[i + 1]`, at least two."""

    offsets: IntArray  # (lines + 1,)
    lonlat: FloatArray  # (positions, 2)  degrees
    owners: IntArray  # (lines,)  rows of `about`, ascending
    about: Sequence[Any]  # (footprints,)  the wall of each, or its tags


def make_outlines_of_ways(
    offsets: IntArray, lonlat: FloatArray, rows_of: Sequence[Sequence[int]], about: Sequence[Any]
) -> Outlines:
    """Return the lines around each footprint, without lines through places that the map lacks.

    Args:
        offsets: (ways + 1,) of the vertices of each way.
        lonlat: (vertices, 2) degrees, NaN where the map lacks the node.
        rows_of: (footprints,) the rows of the ways around each.
        about: (footprints,) the wall of each, or its tags.
    """
    sizes = np.diff(offsets)
    known = np.concatenate(([0], np.cumsum(np.isfinite(lonlat[:, 0]))))
    is_whole = (np.diff(known[offsets]) == sizes) & (sizes > 1)
    rows = [[row for row in of_one if is_whole[row]] for of_one in rows_of]
    owners = np.repeat(np.arange(len(rows)), np.array([len(of_one) for of_one in rows], np.int64))
    positions, offsets = kernels.select_runs(offsets, np.array(list(chain.from_iterable(rows)), np.int64))
    return Outlines(offsets, lonlat[positions], owners, about)


def find_rows_around(ids: Iterable[int], rows_of: Mapping[int, Sequence[int]]) -> list[int]:
    """Return the rows of the ways with these ids, each once and in the order of the ids; `rows_of` is by id."""
    return list(chain.from_iterable(rows_of[id] for id in sorted({*ids} & rows_of.keys())))


def split_known_parts(offsets: IntArray, lonlat: FloatArray, about: Sequence[Any]) -> Outlines:
    """Return the pieces of lines between places that the map lacks.

    Args:
        offsets: (lines + 1,) of the vertices of each line.
        lonlat: (vertices, 2) degrees, NaN where the map lacks the node.
        about: (lines,) the description of each line.
    """
    known = np.flatnonzero(np.isfinite(lonlat[:, 0]))
    line = np.repeat(np.arange(len(about)), np.diff(offsets))
    begins = np.append(True, (np.diff(known) > 1) | (np.diff(line[known]) > 0))[: len(known)]
    first = np.flatnonzero(begins)
    sizes = np.diff(np.append(first, len(known)))
    rows = np.flatnonzero(sizes > 1)
    positions, pieces = kernels.select_runs(np.append(first, len(known)), rows)
    return Outlines(pieces, lonlat[known[positions]], line[known[first[rows]]], about)


def make_footprints(outlines: Outlines) -> Shapes:
    """Return one polygonal shape per footprint, in degrees; empty if its lines enclose nothing.

    A ring inside another ring is a courtyard, and a ring in a courtyard is built upon, whatever the order and the
    direction of the lines. A line that crosses itself encloses the areas on both sides of the crossing.
    """
    import shapely

    shapes: Shapes = np.full(len(outlines.about), shapely.Polygon(), object)
    is_alone = np.bincount(outlines.owners, minlength=len(shapes))[outlines.owners] == 1
    first = outlines.lonlat[outlines.offsets[:-1]]
    last = outlines.lonlat[outlines.offsets[1:] - 1]
    is_ring = is_alone & (first == last).all(axis=1) & (np.diff(outlines.offsets) > 3)
    # A closed way keeps its points and their order; other footprints are assembled from lines.
    points, row = _select_lines(outlines, is_ring)
    shapes[outlines.owners[is_ring]] = make_polygons(points, row)
    points, row = _select_lines(outlines, ~is_ring)
    lines = shapely.linestrings(points, indices=row)
    owners, bundle = np.unique(outlines.owners[~is_ring], return_inverse=True)
    shapes[owners] = _find_enclosed_areas(shapely.multilinestrings(lines, indices=bundle))
    return shapes


def make_polygons(points: FloatArray, row: IntArray) -> Shapes:
    """Return polygons from closed lines through points (points, 2); `row` is the line of each point."""
    import shapely

    polygons: Shapes = shapely.polygons(shapely.linearrings(points, indices=row))
    return polygons


def _select_lines(outlines: Outlines, is_chosen: BoolArray) -> tuple[FloatArray, IntArray]:
    """Return the points (points, 2) of the chosen lines, and the line of each point."""
    sizes = np.diff(outlines.offsets)
    points = outlines.lonlat[np.repeat(is_chosen, sizes)]
    return points, np.repeat(np.arange(int(is_chosen.sum())), sizes[is_chosen])


def convert_shapes(given: "Sequence[BaseGeometry]") -> Shapes:
    """Return a caller's shapes as an array; shapes that are neither lines nor areas become empty."""
    import shapely

    kinds = (shapely.Polygon, shapely.MultiPolygon, shapely.LineString)
    shapes: Shapes = np.empty(len(given), object)
    shapes[:] = [shape if isinstance(shape, kinds) else shapely.Polygon() for shape in given]
    return shapes


def list_points(shapes: Shapes) -> FloatArray:
    """Return all points (points, 2) of some shapes."""
    import shapely

    points: FloatArray = shapely.get_coordinates(shapes)
    return points


def make_lines(outlines: Outlines) -> Shapes:
    """Return each line as a shape."""
    import shapely

    points, row = _select_lines(outlines, np.ones(len(outlines.owners), np.bool_))
    lines: Shapes = shapely.linestrings(points, indices=row)
    return lines


def is_inside(area: "BaseGeometry", xy: FloatArray) -> BoolArray:
    """Return a mask of the points (points, 2) in an area or on its outline."""
    import shapely

    shapely.prepare(area)
    inside: BoolArray = shapely.intersects_xy(area, xy)
    return inside


def find_intersecting(area: "BaseGeometry", shapes: Shapes) -> BoolArray:
    """Return a mask of the shapes that intersect an area."""
    import shapely

    shapely.prepare(area)
    met: BoolArray = shapely.intersects(area, shapes)
    return met


def find_crossing(area: "BaseGeometry", start: FloatArray, end: FloatArray) -> BoolArray:
    """Return a mask of the straight lines (lines, 2) that run inside an area, and not along its outline."""
    import shapely

    lines = shapely.linestrings(np.stack((start, end), axis=1))
    shapely.prepare(area)
    on_outline = shapely.length(shapely.intersection(lines, shapely.boundary(area)))
    across: BoolArray = shapely.covers(area, lines) & (on_outline < shapely.length(lines) / 2.0)
    return across


class BuildingIndex:
    """The buildings of a map that block ways.

    Args:
        read: returns their outlines, polygons in degrees; called on first use.
    """

    def __init__(self, read: "Callable[[], Shapes]") -> None:
        self._read = read

    @cached_property
    def _tree(self) -> "STRtree":
        import shapely

        return shapely.STRtree(repair(self._read()))

    @cached_property
    def _middle(self) -> float:
        """The longitude around which the buildings lie; it may be beyond 180 degrees."""
        import shapely

        if not len(self._tree.geometries):
            return 0.0
        west, _, east, _ = shapely.total_bounds(self._tree.geometries)
        return float(west + east) / 2.0

    def lie_between(self, start: FloatArray, end: FloatArray, around: "BaseGeometry") -> BoolArray:
        """Return a mask of the straight lines (lines, 2) in an area, in degrees, that lead through a building.

        A building that covers half of the area does not block lines: it is a hall in which they run.
        """
        import shapely

        line, row, _ = self.find_crossings(start, end)
        around = shapely.transform(around, lambda lonlat: turn_longitudes(lonlat, self._middle))
        covered = shapely.area(shapely.intersection(self._tree.geometries[row], around))
        return np.isin(np.arange(len(start)), line[covered < around.area / 2.0])

    def find_crossings(self, start: FloatArray, end: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
        """Return crossings of straight lines (lines, 2) with buildings: rows of lines, of buildings, lengths inside.

        Points and lengths are in degrees. A building does not block a line that begins and ends inside it without
        leaving it.
        """
        import shapely

        start, end = (turn_longitudes(some, self._middle) for some in (start, end))
        lines = shapely.linestrings(np.stack((start, end), axis=1))
        line, row = self._tree.query(lines, predicate="intersects")
        lines = lines[line]
        shapes = self._tree.geometries[row]
        through = shapely.relate_pattern(lines, shapes, _ENTERS) & ~shapely.contains_properly(shapes, lines)
        inside = shapely.buffer(shapes[through], -_ROUNDING, join_style="mitre")
        enters = shapely.relate_pattern(lines[through], inside, _ENTERS)
        far = shapely.length(shapely.intersection(lines[through], inside))
        return line[through][enters], row[through][enters], far[enters]


def unite_outlines(geojson: Sequence[dict[str, Any]]) -> "BaseGeometry":
    """Return the union of GeoJSON outlines, as a shapely shape."""
    import shapely

    return shapely.union_all([shapely.geometry.shape(one) for one in geojson])


def widen(area: "BaseGeometry", metres: float) -> "BaseGeometry":
    """Return an area of degrees with a margin in meters, as a shapely shape in degrees."""
    crs, in_metres = _project_to_metres(area)
    return _project_to_degrees(in_metres.buffer(metres), crs)


def outline_area(area: "BaseGeometry", most_m2: float) -> list[FloatArray]:
    """Return simple outlines in degrees that together cover an area of degrees, none larger than `most_m2`."""
    import shapely

    crs, in_metres = _project_to_metres(area)
    hull = in_metres.convex_hull
    if in_metres.geom_type == "Polygon" and in_metres.area <= most_m2:
        hull = in_metres
    parts = [hull] if hull.area <= most_m2 else [part.convex_hull for part in shapely.get_parts(in_metres)]
    cells = list(chain.from_iterable(_split_area(part, most_m2) for part in parts))
    return [shapely.get_coordinates(_project_to_degrees(cell, crs).exterior) for cell in cells]


def _split_area(area: "BaseGeometry", most_m2: float) -> "list[BaseGeometry]":
    """Return a convex area, cut into squares if it is too large."""
    import shapely

    if area.area <= most_m2:
        return [area]
    west, south, east, north = area.bounds
    columns, rows = (math.ceil(side / math.sqrt(most_m2)) for side in (east - west, north - south))
    refuse_above(_BYTES_PER_CELL * columns * rows, f"A map asked for in {columns} x {rows} parts")
    x = np.linspace(west, east, columns + 1)
    y = np.linspace(south, north, rows + 1)
    squares = shapely.box(
        *(side.ravel() for side in np.meshgrid(x[:-1], y[:-1])), *(side.ravel() for side in np.meshgrid(x[1:], y[1:]))
    )
    cut = shapely.intersection(area, squares)
    return [cell for cell in cut if cell.geom_type == "Polygon" and cell.area]


def _project_to_metres(area: "BaseGeometry") -> "tuple[str, BaseGeometry]":
    import shapely

    crs = find_utm_crs(shapely.get_coordinates(area))
    return crs, shapely.transform(area, lambda points: project(points, WGS84, crs))


def _project_to_degrees(area: "BaseGeometry", crs: str) -> "BaseGeometry":
    import shapely

    return shapely.transform(area, lambda points: project(points, crs, WGS84))


def repair(shapes: Shapes) -> Shapes:
    """Return the shapes with self-crossing polygons assembled again from their lines."""
    import shapely

    broken = ~shapely.is_valid(shapes) & (shapely.get_dimensions(shapes) == 2)
    if broken.any():
        shapes = shapes.copy()
        shapes[broken] = _find_enclosed_areas(shapely.boundary(shapes[broken]))
    return shapes


def _find_enclosed_areas(lines: Shapes) -> Shapes:
    """Return the areas that bundles of lines enclose."""
    import shapely

    # A union cuts lines where they meet, like `shapely.node`, but succeeds for all lines.
    enclosed: Shapes = shapely.build_area(shapely.union_all(lines.reshape(-1, 1), axis=1))
    return enclosed
