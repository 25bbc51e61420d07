"""Walls as faces: footprints and lines with their heights, simplified, with openings and without covered parts."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np

from gamms.ir.graph import FloatArray, IntArray
from gamms.limits import refuse_above
from gamms.osm.footprints import PART, Shapes, WallProfile, repair

_LINE = 1  # shapely's type numbers, and a dimension
_RING = 2
_POLYGON = 3
_AREA = 2
_MOST_RELATIVE_M = 0.5
_FEWEST_OF_RING = 4  # points, of which the last is the first
_AT_ONCE = 16  # shapes in one tree query
_MOST_PAIRS = 1_000_000  # of intersecting lines and street pieces
_BYTES_PER_PAIR = 100  # stands for the time that they take
_GATE_M = 3.0
_SLIVER_M = 0.5
_SEAM_M = 0.1  # gap that parts may leave between them


@dataclass(slots=True, frozen=True, eq=False)
class WallFaces:
    """Walls as quadrangles."""

    corners: FloatArray  # (faces, 4, 3)  top right, top left, bottom right, bottom left
    types: IntArray  # (faces,)


def _find_floor(heights: FloatArray, owner: IntArray, shapes: Shapes) -> FloatArray:
    """Return the base height of walls at each point: of an area at its lowest point, of a line at the ground."""
    import shapely

    lowest = np.full(len(shapes), np.inf)
    np.minimum.at(lowest, owner, heights)
    is_area = shapely.get_dimensions(shapes) == _AREA
    return np.where(is_area[owner], lowest[owner], heights)


class SimplifyTolerance(NamedTuple):
    """Tolerances in meters for simplifying outlines."""

    metres: float = 0.5
    relative: float = 0.01  # of the length, at most `_MOST_RELATIVE_M`; the greater of both counts

    def compute_tolerance(self, lines: Shapes) -> FloatArray:
        """Return the tolerance of each line."""
        import shapely

        relative: FloatArray = np.minimum(self.relative * shapely.length(lines), _MOST_RELATIVE_M)
        return np.maximum(self.metres, relative)


def make_faces(
    shapes: Shapes,
    walls: Sequence[WallProfile],
    to_metres: Callable[[FloatArray], FloatArray],
    tolerance: SimplifyTolerance,
    streets: Shapes | None = None,
    ground: Callable[[FloatArray], FloatArray] | None = None,
) -> WallFaces:
    """Return walls along lines and around polygons, also around courtyards; `to_metres` projects points (points, 2).

    With heights of the `ground`, for points in meters, z is above sea level: a building is level and stands on the
    lowest point of its outline, from which `height` is measured; a barrier follows the ground.

    A line that shares a vertex with a street has an opening there. A line that would cross a street only because it was
    simplified is not simplified. The part of a building that its building parts do not cover gets its own walls.
    """
    import shapely

    shapes = repair(shapely.transform(shapes, to_metres))
    roads = shapely.transform(np.zeros(0, object) if streets is None else streets, to_metres)
    shapes, walls = _subtract_parts(shapes, walls)
    shapes = _cut_openings(shapes, roads)
    lines, owner = _find_boundaries(shapes)
    lines = _simplify(lines, tolerance.compute_tolerance(lines), roads)
    points, line = shapely.get_coordinates(lines, return_index=True)
    start = np.flatnonzero((line[:-1] == line[1:]) & (points[:-1] != points[1:]).any(axis=1))
    of_wall = owner[line[start]]
    base, top, types = (np.array([wall[i] for wall in walls])[of_wall] for i in range(3))
    floor = np.zeros(len(points)) if ground is None else _find_floor(ground(points), owner[line], shapes)
    corners = [
        np.column_stack((points[row], floor[row] + height)) for height, row in product((top, base), (start, start + 1))
    ]
    return WallFaces(np.stack(corners, axis=1).reshape(-1, 4, 3), types.astype(np.int64))


def _find_boundaries(shapes: Shapes) -> tuple[Shapes, IntArray]:
    """Return the rings of polygons and the lines themselves, and the shape of each."""
    import shapely

    parts, owner = shapely.get_parts(shapes, return_index=True)
    kind = shapely.get_type_id(parts)
    rings, polygon = shapely.get_rings(parts[kind == _POLYGON], return_index=True)
    of_rings = owner[kind == _POLYGON][polygon]
    of_lines = owner[kind == _LINE]
    order = np.argsort(np.concatenate((of_rings, of_lines)), kind="stable")
    return np.concatenate((rings, parts[kind == _LINE]))[order], np.concatenate((of_rings, of_lines))[order]


def _simplify(lines: Shapes, tolerances: FloatArray, streets: Shapes) -> Shapes:
    """Return lines simplified within their tolerances that touch or cross no further street piece."""
    import shapely

    simple: Shapes = shapely.simplify(_start_at_corners(lines), tolerances)
    is_ring = shapely.get_type_id(lines) == _RING
    changed = shapely.get_num_coordinates(simple) != shapely.get_num_coordinates(lines)
    changed &= ~(is_ring & (shapely.get_num_coordinates(simple) < _FEWEST_OF_RING))
    simple = np.where(changed, simple, lines)
    changed = np.flatnonzero(changed)
    tree = shapely.STRtree(_split_into_pieces(streets))
    found = 0
    for first in range(0, len(changed), _AT_ONCE):
        rows = changed[first : first + _AT_ONCE]
        if found > _MOST_PAIRS:  # not a street map: only time would be lost
            simple[rows] = lines[rows]
            continue
        for predicate in ("crosses", "intersects"):  # a line that only touched a street may not cross it
            before, after = (tree.query(some[rows], predicate=predicate) for some in (lines, simple))
            keys = [pair[0] * len(tree) + pair[1] for pair in (before, after)]
            new = np.unique(after[0][~np.isin(keys[1], keys[0])])
            simple[rows[new]] = lines[rows[new]]
            found += before.shape[1] + after.shape[1]
    return simple


def _start_at_corners(lines: Shapes) -> Shapes:
    """Return rings as closed lines that begin and end at a corner: the point farthest from the middle of their box.

    Simplifying moves a ring at its first point, wherever that is, by more than the tolerance, but keeps the ends of
    lines. Of several farthest points, the one with the least coordinates counts.
    """
    import shapely

    rings = np.flatnonzero(shapely.get_type_id(lines) == _RING)
    points, ring = shapely.get_coordinates(lines[rings], return_index=True)
    if not len(rings):
        return lines
    starts = np.searchsorted(ring, np.arange(len(rings)))
    counts = np.diff(np.append(starts, len(ring))) - 1  # the last point is the first
    middle = (np.minimum.reduceat(points, starts) + np.maximum.reduceat(points, starts)) / 2.0
    far = np.hypot(*(points - middle[ring]).T)
    order = np.lexsort((points[:, 1], points[:, 0], -far, ring))
    corner = order[starts] - starts
    rank = np.arange(len(ring)) - starts[ring]
    turned = starts[ring] + (rank + corner[ring]) % counts[ring]
    begun = lines.copy()
    begun[rings] = shapely.linestrings(points[turned], indices=ring)
    return begun


def _split_into_pieces(lines: Shapes) -> Shapes:
    """Return the straight pieces of lines."""
    import shapely

    points, line = shapely.get_coordinates(lines, return_index=True)
    start = np.flatnonzero(line[:-1] == line[1:])
    pieces: Shapes = shapely.linestrings(np.stack((points[start], points[start + 1]), axis=1))
    return pieces


def _cut_openings(shapes: Shapes, streets: Shapes) -> Shapes:
    """Return the shapes with a gap, a gate, in each line that shares a vertex with a street."""
    import shapely

    rows = np.flatnonzero(shapely.get_type_id(shapes) == _LINE)
    points, line = shapely.get_coordinates(shapes[rows], return_index=True)
    of_streets = np.unique(shapely.get_coordinates(streets) @ (1.0, 1.0j))
    is_shared = np.isin(points @ (1.0, 1.0j), of_streets)
    opened, first = np.unique(line[is_shared], return_index=True)
    if not len(opened):
        return shapes
    gates = [shapely.MultiPoint(some) for some in np.split(points[is_shared], first[1:])]
    shapes = shapes.copy()
    shapes[rows[opened]] = shapely.difference(shapes[rows[opened]], shapely.buffer(gates, _GATE_M / 2.0))
    return shapes


def _subtract_parts(shapes: Shapes, walls: Sequence[WallProfile]) -> tuple[Shapes, Sequence[WallProfile]]:
    """Return the shapes, with buildings reduced to the areas that their parts do not cover, and the walls of the parts.

    A part belongs to the smallest building around it. A part without a height gets that of the building. The rest of a
    building counts if it is wider than twice `_SLIVER_M`.
    """
    import shapely

    parts = np.flatnonzero(np.array([wall.key == PART for wall in walls], np.bool_))
    buildings = np.flatnonzero(np.array([wall.key == "building" for wall in walls], np.bool_))
    part, building = _find_containing_areas(shapes[parts], shapes[buildings])
    shapes = shapes.copy()
    heights = [*walls]
    if not len(part):
        return shapes, walls
    order = np.argsort(building, kind="stable")
    owners, first = np.unique(building[order], return_index=True)
    for owner, some in zip(buildings[owners].tolist(), np.split(parts[part[order]], first[1:]), strict=True):
        covered = shapely.buffer(shapely.union_all(shapes[some]), _SEAM_M, join_style="mitre")
        pieces = shapely.get_parts(shapely.difference(shapes[owner], covered))
        is_wide = ~shapely.is_empty(shapely.buffer(pieces, -_SLIVER_M))
        shapes[owner] = shapely.multipolygons(pieces[is_wide & (shapely.get_type_id(pieces) == _POLYGON)])
        for row in some.tolist():
            base = walls[row].base
            top = walls[row].top if walls[row].is_measured else walls[owner].top
            heights[row] = walls[row]._replace(base=base if base < top else 0.0, top=top, type=walls[owner].type)
    return shapes, heights


def _find_containing_areas(parts: Shapes, areas: Shapes) -> tuple[IntArray, IntArray]:
    """Return the parts that lie in an area, and the smallest such area of each."""
    import shapely

    tree = shapely.STRtree(shapely.point_on_surface(parts))
    sizes = shapely.area(areas)
    pairs = [np.zeros((2, 0), np.int64)]
    for first in range(0, len(areas) if len(parts) else 0, _AT_ONCE):
        pairs.append(tree.query(areas[first : first + _AT_ONCE], predicate="contains") + np.array([[first], [0]]))
        refuse_above(_BYTES_PER_PAIR * sum(some.shape[1] for some in pairs), "A map of so many buildings in each other")
    area, part = np.concatenate(pairs, axis=1)
    order = np.lexsort((sizes[area], part))
    inside, first_of = np.unique(part[order], return_index=True)
    return inside, area[order][first_of]
