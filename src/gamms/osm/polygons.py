"""Footprints as shapely polygons: assemble, repair and simplify them in bulk, and make walls of them."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from gamms import kernels
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.projection import WGS84, project, utm_crs
from gamms.limits import refuse_above
from gamms.osm.heights import Wall

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

RING_ROLES = ("outer", "inner", "")  # of the ways in a multipolygon that enclose it
_POLYGON = 3  # shapely's number of the type
_BYTES_PER_CELL = 1 << 20  # of the map in a cell

BoolArray = np.ndarray[Any, np.dtype[np.bool_]]
Shapes = np.ndarray[Any, np.dtype[np.object_]]


@dataclass(slots=True, frozen=True, eq=False)
class Outlines:
    """Lines that enclose footprints: line `i` visits the positions `offsets[i]:offsets[i + 1]`, two at least."""

    offsets: IntArray  # (lines + 1,)
    lonlat: FloatArray  # (positions, 2)  degrees
    owners: IntArray  # (lines,)  rows of `about`, ascending
    about: Sequence[Any]  # (footprints,)  the wall of each, or its tags


@dataclass(slots=True, frozen=True, eq=False)
class Faces:
    """Walls as quadrangles."""

    corners: FloatArray  # (faces, 4, 3)  top right, top left, bottom right, bottom left
    types: IntArray  # (faces,)


def outlines_of_ways(
    offsets: IntArray, lonlat: FloatArray, row_of: Mapping[int, int], ways_of: Sequence[list[int]], about: Sequence[Any]
) -> Outlines:
    """Return the lines of each footprint; one that leads through a place that the map lacks is left out.

    Args:
        offsets: (ways + 1,) of the vertices of each way.
        lonlat: (vertices, 2) degrees, NaN where the map lacks the node.
        row_of: way id -> row.
        ways_of: (footprints,) the ids of the ways around each.
        about: (footprints,) the wall of each, or its tags.
    """
    sizes = np.diff(offsets)
    known = np.concatenate(([0], np.cumsum(np.isfinite(lonlat[:, 0]))))
    is_whole = (np.diff(known[offsets]) == sizes) & (sizes > 1)
    rows = [[row for id in sorted({*ways} & row_of.keys()) if is_whole[row := row_of[id]]] for ways in ways_of]
    owners = np.repeat(np.arange(len(rows)), np.array([len(of_one) for of_one in rows], np.int64))
    positions, offsets = kernels.chosen_runs(offsets, np.array([row for of_one in rows for row in of_one], np.int64))
    return Outlines(offsets, lonlat[positions], owners, about)


def footprints_of(outlines: Outlines) -> Shapes:
    """Return one polygonal shape per footprint, in degrees; empty where its lines enclose nothing.

    What lies inside another ring is a courtyard, and what lies in a courtyard is built upon, whatever the order and
    the direction of the lines. A line that crosses itself encloses what is left and right of the crossing.
    """
    import shapely

    shapes: Shapes = np.full(len(outlines.about), shapely.Polygon(), object)
    is_alone = np.bincount(outlines.owners, minlength=len(shapes))[outlines.owners] == 1
    is_ring = is_alone & _is_ring(outlines)
    # A closed way keeps its points and their order; everything else is assembled.
    points, row = _chosen(outlines, is_ring)
    shapes[outlines.owners[is_ring]] = shapely.polygons(shapely.linearrings(points, indices=row))
    points, row = _chosen(outlines, ~is_ring)
    lines = shapely.linestrings(points, indices=row)
    owners, bundle = np.unique(outlines.owners[~is_ring], return_inverse=True)
    shapes[owners] = _enclosed(shapely.multilinestrings(lines, indices=bundle))
    return shapes


def _is_ring(outlines: Outlines) -> BoolArray:
    first, last = outlines.lonlat[outlines.offsets[:-1]], outlines.lonlat[outlines.offsets[1:] - 1]
    return np.asarray((first == last).all(axis=1) & (np.diff(outlines.offsets) > 3))


def _chosen(outlines: Outlines, is_chosen: BoolArray) -> tuple[FloatArray, IntArray]:
    """Return the points (points, 2) of some lines, and to which of them each belongs."""
    sizes = np.diff(outlines.offsets)
    points = outlines.lonlat[np.repeat(is_chosen, sizes)]
    return points, np.repeat(np.arange(int(is_chosen.sum())), sizes[is_chosen])


def shapes_of(shapes: "Sequence[BaseGeometry]") -> Shapes:
    """Shapes of a caller as an array; what is no polygon or multipolygon becomes an empty one."""
    import shapely

    kinds = (shapely.Polygon, shapely.MultiPolygon)
    made: Shapes = np.empty(len(shapes), object)
    made[:] = [shape if isinstance(shape, kinds) else shapely.Polygon() for shape in shapes]
    return made


def coordinates_of(shapes: Shapes) -> FloatArray:
    """Return all points (points, 2) of some shapes."""
    import shapely

    points: FloatArray = shapely.get_coordinates(shapes)
    return points


def is_inside(area: "BaseGeometry", xy: FloatArray) -> BoolArray:
    """Return which points (points, 2) lie in an area or on its outline."""
    import shapely

    shapely.prepare(area)
    inside: BoolArray = shapely.intersects_xy(area, xy)
    return inside


def meets(area: "BaseGeometry", shapes: Shapes) -> BoolArray:
    """Return which shapes have a point in common with an area."""
    import shapely

    shapely.prepare(area)
    met: BoolArray = shapely.intersects(area, shapes)
    return met


def area_of(geojson: Sequence[dict[str, Any]]) -> "BaseGeometry":
    """Return the union of some outlines in GeoJSON, as a shapely shape."""
    import shapely

    return shapely.union_all([shapely.geometry.shape(one) for one in geojson])


def widened(area: "BaseGeometry", metres: float) -> "BaseGeometry":
    """Return an area of degrees with a margin, as a shapely shape in degrees."""
    crs, in_metres = _in_metres(area)
    return _in_degrees(in_metres.buffer(metres), crs)


def outlines_of(area: "BaseGeometry", most_m2: float) -> list[FloatArray]:
    """Simple outlines in degrees that together cover an area of degrees, none larger than `most_m2`."""
    import shapely

    crs, in_metres = _in_metres(area)
    hull = in_metres.convex_hull
    if in_metres.geom_type == "Polygon" and in_metres.area <= most_m2:
        hull = in_metres
    parts = [hull] if hull.area <= most_m2 else [part.convex_hull for part in shapely.get_parts(in_metres)]
    cells = [cell for part in parts for cell in _cells(part, most_m2)]
    return [shapely.get_coordinates(_in_degrees(cell, crs).exterior) for cell in cells]


def _cells(area: "BaseGeometry", most_m2: float) -> "list[BaseGeometry]":
    """Return a convex area, cut into squares where it is too large."""
    import shapely

    if area.area <= most_m2:
        return [area]
    west, south, east, north = area.bounds
    columns, rows = (math.ceil(side / math.sqrt(most_m2)) for side in (east - west, north - south))
    refuse_above(_BYTES_PER_CELL * columns * rows, f"A map asked for in {columns} x {rows} parts")
    x, y = np.linspace(west, east, columns + 1), np.linspace(south, north, rows + 1)
    squares = shapely.box(
        *(side.ravel() for side in np.meshgrid(x[:-1], y[:-1])), *(side.ravel() for side in np.meshgrid(x[1:], y[1:]))
    )
    cut = shapely.intersection(area, squares)
    return [cell for cell in cut if cell.geom_type == "Polygon" and cell.area]


def _in_metres(area: "BaseGeometry") -> "tuple[str, BaseGeometry]":
    import shapely

    crs = utm_crs(shapely.get_coordinates(area))
    return crs, shapely.transform(area, lambda points: project(points, WGS84, crs))


def _in_degrees(area: "BaseGeometry", crs: str) -> "BaseGeometry":
    import shapely

    return shapely.transform(area, lambda points: project(points, crs, WGS84))


def faces_of(
    shapes: Shapes,
    walls: Sequence[Wall],
    to_metres: Callable[[FloatArray], FloatArray],
    min_tolerance: float,
    relative_tolerance: float,
) -> Faces:
    """Walls along the edges of polygons, around courtyards too; `to_metres` projects points (points, 2)."""
    import shapely

    polygons, owner = shapely.get_parts(repaired(shapely.transform(shapes, to_metres)), return_index=True)
    is_area = shapely.get_type_id(polygons) == _POLYGON
    polygons, owner = polygons[is_area], owner[is_area]
    perimeters = shapely.length(shapely.get_exterior_ring(polygons))
    tolerances = np.maximum(min_tolerance, relative_tolerance * perimeters)
    rings, polygon = shapely.get_rings(shapely.simplify(polygons, tolerances), return_index=True)
    points, ring = shapely.get_coordinates(rings, return_index=True)
    start = np.flatnonzero((ring[:-1] == ring[1:]) & (points[:-1] != points[1:]).any(axis=1))
    return _standing(points[start], points[start + 1], owner[polygon[ring[start]]], walls)


def _standing(start: FloatArray, end: FloatArray, owners: IntArray, walls: Sequence[Wall]) -> Faces:
    base, top = (np.array([wall[i] for wall in walls], np.float64)[owners] for i in (0, 1))
    corners = [np.column_stack((points, heights)) for heights in (top, base) for points in (start, end)]
    types = np.array([wall.type for wall in walls], np.int64)[owners]
    return Faces(np.stack(corners, axis=1).reshape(-1, 4, 3), types)


def repaired(shapes: Shapes) -> Shapes:
    """Return the shapes; those that cross themselves are assembled again from their lines."""
    import shapely

    broken = ~shapely.is_valid(shapes)
    if broken.any():
        shapes = shapes.copy()
        shapes[broken] = _enclosed(shapely.boundary(shapes[broken]))
    return shapes


def _enclosed(lines: Shapes) -> Shapes:
    """Return what bundles of lines enclose."""
    import shapely

    # A union cuts lines where they meet, as `shapely.node` does, but gets to the end with any lines.
    enclosed: Shapes = shapely.build_area(shapely.union_all(lines.reshape(-1, 1), axis=1))
    return enclosed
