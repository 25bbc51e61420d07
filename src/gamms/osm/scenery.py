"""Scenery from the maps of streets: buildings, parks, water and rails, which are drawn but block no sight."""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np

from gamms.arguments import as_context
from gamms.errors import BadValue
from gamms.ir.geometry import join_rings, list_rings
from gamms.ir.graph import FloatArray
from gamms.ir.obstacles import ObstacleColumns
from gamms.ir.projection import WGS84, parse_crs, project
from gamms.ir.scenery import Scenery, SceneryKind, make_empty_scenery
from gamms.osm import footprints
from gamms.osm.constants import wall_estimates
from gamms.osm.footprints import Shapes, WallProfile, WallRules, find_layer
from gamms.osm.osmium_reader import MapFile, as_file
from gamms.osm.overpass import Location, download_features_of_place
from gamms.osm.reader import read_footprints, read_line_parts
from gamms.osm.walls import SimplifyTolerance, make_faces
from gamms.typing import IContext

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

Tags = Mapping[str, str]
_Feature = tuple[Any, Any]  # a shapely shape in degrees, and its kind: a WallProfile, a SceneryKind or _COAST

_AREAS = {
    **dict.fromkeys(
        (("leisure", one) for one in ("park", "garden", "golf_course", "nature_reserve")), SceneryKind.GREEN
    ),
    **dict.fromkeys((("natural", one) for one in ("wood", "grassland", "scrub", "heath")), SceneryKind.GREEN),
    **dict.fromkeys(
        (("landuse", one) for one in ("grass", "forest", "cemetery", "meadow", "village_green", "recreation_ground")),
        SceneryKind.GREEN,
    ),
    **dict.fromkeys((("landuse", one) for one in ("reservoir", "basin", "pond")), SceneryKind.WATER),
    **dict.fromkeys((("waterway", one) for one in ("riverbank", "dock")), SceneryKind.WATER),
    ("natural", "water"): SceneryKind.WATER,
}
_LINES = {
    **dict.fromkeys((("waterway", one) for one in ("river", "canal", "stream")), SceneryKind.WATERWAY),
    **dict.fromkeys((("railway", one) for one in ("rail", "light_rail", "subway", "narrow_gauge")), SceneryKind.RAIL),
    ("railway", "tram"): SceneryKind.TRAM,
}
_COAST = "coastline"  # land on its left, the sea on its right
_LINE_KEYS = "railway", "waterway", "natural"
_MARGIN_M = 20.0  # around the streets
_LEAST_M2 = 60.0  # smaller areas are left out; tolerances of outlines and lines
_AREA_M = 1.0
_LINE_M = 0.5
_TOLERANCE = SimplifyTolerance(0.5, 0.01)  # of buildings
_MOST_WALLS = 200_000
_GRID = 16.0  # coordinates are rounded to 1 / 16 meter, so that files stay small
_BESIDE_M = 0.25  # distance from a coast of the tested points, and the share of them that has to agree
_SURE = 0.9
_REACH_M = 100.0  # largest distance from the edge of the area at which a coast may end
_POLYGON = 3  # shapely's type numbers
_LINE = 1


def scenery_from_file(filepath: str | os.PathLike[str], ctx: IContext, *, buildings: bool = True) -> Scenery:
    """Return the scenery in an OpenStreetMap file around the streets of a context, for `ctx.graph.graph.scenery`.

    More than 200,000 walls of buildings are left out, with a warning. Areas that are incomplete in the file are left
    out. The sea is drawn where coastlines divide the area of the streets; a coastline that ends up to 100 m from its
    edge is extended to it.

    Args:
        filepath: the map file of the streets.
        ctx: the context with these streets.
        buildings: whether to draw buildings.

    Raises:
        FileNotFoundError, IsADirectoryError: the file does not exist.
        BadFile: the file is damaged or not OpenStreetMap data.
        BadValue: the context has no streets with a CRS in meters, or there is too much scenery around them.
        MissingExtra: osmium or pyproj is not installed.
    """
    crs, box = _find_place(as_context(ctx, "scenery_from_file", "scenery_from_file('city.osm', ctx)"))
    source = MapFile(as_file(filepath))
    rules = _SceneryRules(buildings=buildings)
    areas = read_footprints(source, rules)
    lines = read_line_parts(source, _LINE_KEYS, _find_line_kind)
    shapes = chain(
        zip(footprints.make_footprints(areas), areas.about, strict=True),
        zip(footprints.make_lines(lines), (lines.about[row] for row in lines.owners.tolist()), strict=True),
    )
    return _limit_buildings(ctx, _make_scenery(list(shapes), crs, box))


def scenery_from_osm(location: Location, ctx: IContext, *, buildings: bool = True, offline: bool = False) -> Scenery:
    """Return the scenery of a place, such as `"Monaco"`, around the streets of a context, from OpenStreetMap's servers.

    Other arguments are those of `scenery_from_file`. `offline` uses cached answers of the servers.

    Raises:
        BadType, BadValue: the location is impossible, or as for `scenery_from_file`.
        PlaceError, NetworkError: the place is unknown or empty, or there is no answer.
        MissingExtra: requests or pyproj is not installed.
    """
    crs, box = _find_place(as_context(ctx, "scenery_from_osm", "scenery_from_osm('Monaco', ctx)"))
    rules = _SceneryRules(buildings=buildings)
    wanted = dict[str, bool | list[str]]()
    for key, value in _AREAS:
        wanted.setdefault(key, []).append(value)  # type: ignore[union-attr] # a list, as each of them is
    if buildings:
        wanted["building"] = True
    found = download_features_of_place(location, wanted, _LINE_KEYS, offline=offline)
    about = [
        rules.find_wall(tags) if shape.geom_type in ("Polygon", "MultiPolygon") else _find_line_kind(tags)
        for shape, tags in found
    ]
    return _limit_buildings(
        ctx, _make_scenery([(shape, what) for (shape, _), what in zip(found, about, strict=True) if what], crs, box)
    )


class _SceneryRules:
    """Rules that turn an area into a building, an area of the base map, or nothing.

    Args:
        buildings: whether buildings are wanted.
    """

    def __init__(self, *, buildings: bool) -> None:
        self._walls = WallRules({"building": True}, wall_estimates()) if buildings else None
        self.keys = sorted({key for key, _ in _AREAS} | ({"building"} if buildings else set()))

    def find_wall(self, tags: Tags) -> "WallProfile | SceneryKind | None":
        """Return the walls around an area with these tags, or the kind of an area without walls, or None."""
        wall = None if self._walls is None else self._walls.find_wall(tags)
        return wall or _find_kind(tags, _AREAS)


def _find_line_kind(tags: Tags) -> SceneryKind | str | None:
    """Return the kind of a line with these tags: `_COAST` for a coast, None if it is not drawn."""
    return _COAST if tags.get("natural") == _COAST else _find_kind(tags, _LINES)


def _find_kind(tags: Tags, table: Mapping[tuple[str, str], SceneryKind]) -> SceneryKind | None:
    """Return the kind of an object on the ground; None if it lies below, or is not drawn."""
    if (
        find_layer(tags) < 0
        or tags.get("tunnel", "no") != "no"
        or tags.get("location") in ("underground", "underwater")
    ):
        return None
    return next((kind for (key, value), kind in table.items() if tags.get(key) == value), None)


def _find_place(ctx: IContext) -> tuple[str, "BaseGeometry"]:
    """Return the CRS of the streets of a context, and the rectangle around them in meters."""
    import shapely

    columns = ctx.graph.columns()
    if columns.crs is None or not len(columns.xy):
        raise BadValue("The context has no streets with a CRS. Load them first: ctx.graph.attach_networkx_graph(…).")
    crs, in_degrees = parse_crs(columns.crs)
    if in_degrees:
        raise BadValue(f"The streets are in {crs}, which is in degrees; scenery needs a CRS in meters.")
    low = columns.xy.min(axis=0) - _MARGIN_M
    high = columns.xy.max(axis=0) + _MARGIN_M
    return crs, shapely.box(*low.tolist(), *high.tolist())


def _limit_buildings(ctx: IContext, scenery: Scenery) -> Scenery:
    """Return a scenery without its buildings if they are too many to be drawn."""
    walls = len(scenery.buildings.ids)
    if walls <= _MOST_WALLS:
        return scenery
    ctx.logger.warning(f"The buildings around the streets have {walls} walls; above {_MOST_WALLS}, they are not drawn.")
    return replace(scenery, buildings=make_empty_scenery().buildings)


def _make_scenery(features: list[_Feature], crs: str, box: "BaseGeometry") -> Scenery:
    """Return the scenery in a rectangle, from features in degrees."""
    import shapely

    to_metres = partial(project, source=WGS84, target=crs)
    shapes: Shapes = np.empty(len(features), object)
    shapes[:] = [shape for shape, _ in features]
    projected = shapely.transform(shapes, to_metres)
    shapely.prepare(box)
    is_near = np.isfinite(shapely.bounds(projected)).all(axis=1)
    is_near[is_near] = shapely.intersects(box, shapely.envelope(projected[is_near]))
    rows = np.flatnonzero(is_near).tolist()
    walls = [row for row in rows if isinstance(features[row][1], WallProfile)]
    by_kind = {kind: projected[[row for row in rows if features[row][1] == kind]] for kind in (*SceneryKind, _COAST)}
    kinds = list[int]()
    lines = list[FloatArray]()
    for kind in SceneryKind:
        if kind < SceneryKind.WATERWAY:
            more = _find_sea(by_kind[_COAST], box) if kind is SceneryKind.WATER else []
            found = list(_list_outlines(by_kind[kind], more, box))
        else:
            found = list(_list_drawn_lines(by_kind[kind], box))
        lines += found
        kinds += [int(kind)] * len(found)
    offsets = np.cumsum([0, *map(len, lines)])
    points = np.round(np.concatenate([np.zeros((0, 2)), *lines]) * _GRID) / _GRID
    about = [features[row][1] for row in walls]
    return Scenery(np.array(kinds, np.int64), offsets, points, _make_buildings(shapes[walls], about, to_metres, box))


def _make_buildings(
    shapes: Shapes, walls: Sequence[WallProfile], to_metres: Callable[[FloatArray], FloatArray], box: "BaseGeometry"
) -> ObstacleColumns:
    """Return the walls of the buildings whose center lies in a rectangle."""
    import shapely

    bounds = shapely.bounds(shapes).reshape(-1, 4)
    is_in = (
        footprints.is_inside(box, to_metres((bounds[:, :2] + bounds[:, 2:]) / 2)) if len(bounds) else np.zeros(0, bool)
    )
    chosen = [wall for wall, inside in zip(walls, is_in.tolist(), strict=True) if inside]
    if not chosen:
        return make_empty_scenery().buildings
    faces = make_faces(shapes[is_in], chosen, to_metres, _TOLERANCE)
    return ObstacleColumns(np.arange(len(faces.types)), np.round(faces.corners * _GRID) / _GRID, faces.types)


def _list_outlines(shapes: Shapes, more: "list[BaseGeometry]", box: "BaseGeometry") -> Iterator[FloatArray]:
    """Yield the polygons of the union of areas in a rectangle, with holes joined by seams."""
    import shapely

    union = shapely.union_all([*shapely.intersection(footprints.repair(shapes), box), *more])
    for part in shapely.get_parts(shapely.simplify(union, _AREA_M)):
        if shapely.get_type_id(part) == _POLYGON and part.area >= _LEAST_M2:
            yield join_rings(list_rings(part))


def _list_drawn_lines(shapes: Shapes, box: "BaseGeometry") -> Iterator[FloatArray]:
    """Yield the lines in a rectangle, joined where they meet."""
    import shapely

    parts = shapely.get_parts(shapely.intersection(shapes, box))
    parts = parts[shapely.get_type_id(parts) == _LINE]
    joined = shapely.get_parts(shapely.line_merge(shapely.multilinestrings(parts)))
    for line in shapely.simplify(joined, _LINE_M):
        if line.length:
            yield shapely.get_coordinates(line)


def _find_sea(coasts: Shapes, box: "BaseGeometry") -> "list[BaseGeometry]":
    """Return the parts of a rectangle that lie right of coastlines, and not left of any."""
    import shapely

    if not len(coasts):
        return []
    points, line = shapely.get_coordinates(coasts, return_index=True)
    start = np.flatnonzero((line[:-1] == line[1:]) & (points[:-1] != points[1:]).any(axis=1))
    ways = points[start + 1] - points[start]
    pieces = shapely.intersection(shapely.linestrings(np.stack([points[start], points[start + 1]], axis=1)), box)
    is_in = shapely.length(pieces) > 0.0
    pieces = pieces[is_in]
    ways = ways[is_in]
    middles = shapely.get_coordinates(shapely.line_interpolate_point(pieces, 0.5, normalized=True))
    right = ways[:, ::-1] / np.hypot(*ways.T)[:, None] * (1.0, -1.0)
    lengths = shapely.length(pieces)
    cut = shapely.union_all([*shapely.intersection(coasts, box), box.boundary, *_extend_coasts(coasts, box)])
    parts = shapely.get_parts(shapely.polygonize(shapely.get_parts(cut)))
    found = []
    tree = shapely.STRtree(parts)
    votes = np.zeros((2, len(parts)))
    for side, sign in enumerate((1.0, -1.0)):
        beside = shapely.points(middles + sign * _BESIDE_M * right)
        rows, hit = tree.query(beside, predicate="within")
        np.add.at(votes[side], hit, lengths[rows])
    for part, at_right, at_left in zip(parts, *votes.tolist(), strict=True):
        if at_right > 0.0 and at_right >= _SURE * (at_right + at_left):
            found.append(part)
    return found


def _extend_coasts(coasts: Shapes, box: "BaseGeometry") -> "list[BaseGeometry]":
    """Return lines from ends of coasts near the edge of a rectangle to that edge."""
    import shapely

    points, line = shapely.get_coordinates(coasts, return_index=True)
    is_end = np.append(True, np.diff(line) > 0) | np.append(np.diff(line) > 0, True)
    ends, count = np.unique(points[is_end], axis=0, return_counts=True)
    places = shapely.points(ends[count == 1])
    ways = shapely.shortest_line(places, box.boundary)
    is_way = shapely.within(places, box) & (shapely.length(ways) <= _REACH_M)
    return list(ways[is_way])
