"""Buildings as obstacles: from footprints with tags to the walls that `ctx.graph.add_obstacles` takes."""

import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from typing import Any, NamedTuple, TypedDict, Unpack

import numpy as np

from gamms.arguments import as_float, as_items, as_range, refuse_context, refuse_keywords, spell_out_options
from gamms.errors import BadType, BadValue, nearest
from gamms.ir.graph import FloatArray
from gamms.ir.projection import (
    WGS84,
    check_metres,
    compute_ground_scale,
    find_utm_crs,
    is_true,
    parse_crs,
    project,
    project_back_and_forth,
    scale_fault,
)
from gamms.osm import footprints
from gamms.osm.constants import BARRIER_HEIGHTS, OSM_OBSTACLE_TAGS, wall_estimates
from gamms.osm.elevation import Elevation, ElevationPath, as_elevation
from gamms.osm.footprints import HeightEstimates, TagFilter, WallProfile
from gamms.osm.network import OsmRoads, RoadSegments, cut_segments, find_largest_part
from gamms.osm.osmium_reader import MapFile, as_file
from gamms.osm.overpass import Location, download_features_of_place
from gamms.osm.reader import read_barriers, read_footprints, read_ways
from gamms.osm.walls import SimplifyTolerance, WallFaces, make_faces
from gamms.text import shown

Barriers = bool | str | Iterable[str] | Mapping[str, float]  # the `barrier` values that are walls
Record = dict[str, Any]  # the arguments of `ctx.graph.add_obstacle_face`

_AT_ONCE = 4096  # faces


class WallOptions(TypedDict, total=False):
    """Further options of functions that make walls."""

    barriers: Barriers
    """Values of `barrier` whose lines are walls, too: True for `gamms.osm.BARRIER_HEIGHTS`, some of its keys, or
    your own table from values to heights in meters; False.
    """
    elevation: ElevationPath | Elevation | None
    """A .hgt file of SRTM, or a folder of them, as for roads: walls stand on the ground, and z is above sea level;
    None.
    """


_for_obstacles = refuse_context("ctx.graph.add_obstacles(gamms.osm.{name}(…))")
_with_options = spell_out_options(barriers=False, elevation=None)


@_for_obstacles
@_with_options
def obstacle_from_file(
    filepath: str | os.PathLike[str],
    tags: TagFilter = OSM_OBSTACLE_TAGS,
    height_estimates: HeightEstimates | None = None,
    min_tolerance: float = 0.5,
    relative_tolerance: float = 0.01,
    crs: object = None,
    **more: Unpack[WallOptions],
) -> Iterator[Record]:
    """Return the walls of the buildings in an OpenStreetMap file (.osm, .xml, .osm.gz, .osm.bz2, .osm.pbf).

    A wall is a vertical quadrangle above one edge of a footprint, also around courtyards. A file without buildings
    gives no walls. Footprints that are incomplete in the file, or cross themselves, give the walls that they enclose.

    Args:
        filepath: the map file.
        tags: select only objects with one of these tags: key -> a value, several, or True for all.
        height_estimates: (key, value) -> (height in meters, type): which objects are walls, and their heights without
            `height` or `building:levels`. None: `gamms.osm.wall_estimates()`, without land use.
        min_tolerance: meters by which a footprint may be simplified, but never so that it crosses a street of the file
            that it did not cross before.
        relative_tolerance: the tolerance as a share of the perimeter, 0.5 m at most; the greater of both counts.
        crs: the CRS of the walls, in meters; give `ctx.graph.crs` if there are streets already. None: that of
            `graph_from_xml` with its defaults for the same file or, in a file without roads, the UTM zone of the
            mean point of the footprints.
        more: see `WallOptions`.

    Returns:
        An iterator over dicts for `ctx.graph.add_obstacle_face(**wall)`, or all of it for `ctx.graph.add_obstacles`:
        `face_id` from 0, the corners `tr`, `tl`, `br`, `bl` as (x, y, z), and `type`.

    Raises:
        FileNotFoundError, IsADirectoryError: the file does not exist.
        BadFile: the file is damaged or not OpenStreetMap data, or `elevation` is not a file of heights.
        BadValue, BadType: an argument is impossible.
        MissingExtra: osmium is not installed.
    """
    rules, tolerance = _check_rules(tags, height_estimates, (min_tolerance, relative_tolerance), more)
    heights = as_elevation(more.get("elevation"))
    plane = _make_plane(crs, heights, lambda points: _find_crs(cut_segments(roads)) or find_utm_crs(points))
    source = MapFile(as_file(filepath))
    outlines = read_footprints(source, rules)
    fences = read_barriers(source, rules)
    if not len(outlines.owners) and not len(fences.owners):
        return iter(())
    roads = read_ways(source, lambda _: None)
    shapes = np.concatenate((footprints.make_footprints(outlines), footprints.make_lines(fences)))
    to_metres, ground = plane(np.concatenate((outlines.lonlat, fences.lonlat)))
    walls = [*outlines.about, *(fences.about[row] for row in fences.owners.tolist())]
    return _list_records(make_faces(shapes, walls, to_metres, tolerance, _make_streets(roads), ground))


obstacle_from_xml = obstacle_from_file  # its name in 1.0.0


@_for_obstacles
@_with_options
def obstacle_from_osm(
    location: Location,
    tags: TagFilter = OSM_OBSTACLE_TAGS,
    height_estimates: HeightEstimates | None = None,
    min_tolerance: float = 0.5,
    relative_tolerance: float = 0.01,
    crs: object = None,
    *,
    offline: bool = False,
    **more: Unpack[WallOptions],
) -> Iterator[Record]:
    """Return the walls of the buildings of a place, such as `"Monaco"`, from the servers of OpenStreetMap.

    Other arguments are those of `obstacle_from_file`. Without `crs`, it is the UTM zone of the mean point of the
    footprints; give `ctx.graph.crs` if there are streets already, so that both fit. `offline` uses cached answers of
    the servers.

    Raises:
        BadValue, BadType: an argument is impossible.
        PlaceError, NetworkError: the place is unknown or empty, or there is no answer.
        MissingExtra: requests is not installed.
    """
    rules, tolerance = _check_rules(tags, height_estimates, (min_tolerance, relative_tolerance), more)
    plane = _make_plane(crs, as_elevation(more.get("elevation")))
    lines = ("highway", "barrier") if rules.has_barriers else ("highway",)
    features = download_features_of_place(location, tags, lines, offline=offline)
    return _read_records(features, rules, tolerance, plane)


@_with_options
def faces_of_features(
    features: Iterable[tuple[Any, Mapping[str, Any]]],
    crs: object = None,
    height_estimates: HeightEstimates | None = None,
    min_tolerance: float = 0.5,
    relative_tolerance: float = 0.01,
    *,
    tags: TagFilter | None = None,
    **more: Unpack[WallOptions],
) -> Iterator[Record]:
    """Return the walls of shapely polygons and multipolygons in longitude and latitude, each with its tags.

    A LineString with `barrier` may be a wall; one with `highway` is a street. Other geometries, and tags that are not
    texts, are ignored. Other arguments are those of `obstacle_from_file`.

    Raises:
        BadValue, BadType: an argument is impossible, or a polygon is outside of the CRS.
        MissingExtra: the CRS is not a UTM zone, and pyproj is not installed.
    """
    rules, tolerance = _check_rules(tags, height_estimates, (min_tolerance, relative_tolerance), more)
    return _read_records(features, rules, tolerance, _make_plane(crs, as_elevation(more.get("elevation"))))


def extract_osm_polygon_faces(
    gdf: Any,  # geopandas is not a dependency
    height_estimates: HeightEstimates | None = None,
    min_tolerance: float = 0.5,
    relative_tolerance: float = 0.01,
) -> Iterator[Record]:
    """Return the walls of the polygons in a GeoDataFrame, such as OSMnx makes, whose columns are the tags.

    A GeoDataFrame in degrees, or in a CRS whose meters are not true there, such as Web Mercator, is projected to UTM;
    any other is taken as meters, unchanged.

    Raises:
        BadType: it is not a GeoDataFrame.
        BadValue: its CRS is not valid, or another argument is impossible.
    """
    rules, tolerance = _check_rules(None, height_estimates, (min_tolerance, relative_tolerance), {})
    try:
        name = gdf.geometry.name
        features = [(row[name], row) for row in gdf.to_dict("records")]
    except AttributeError:
        raise BadType(f"gdf must be a GeoDataFrame, not {type(gdf).__name__}.") from None
    if gdf.crs is None:
        bounds = np.array([shape.bounds for shape, _ in features if getattr(shape, "bounds", ())]).reshape(-1, 2, 2)
        bounds = bounds[np.isfinite(bounds).all(axis=(1, 2))]
        check_metres(bounds.reshape(-1, 2), np.ptp(bounds, axis=1).max(axis=1), "The GeoDataFrame has no CRS (gdf.crs)")
    return _read_records(features, rules, tolerance, _make_plane_of_frame(gdf.crs))


# -- inside -----------------------------------------------------------------------------------------------------


class MetricPlane(NamedTuple):
    """The projection of points to meters, and the height of the ground there."""

    to_metres: Callable[[FloatArray], FloatArray]  # of points (points, 2)
    ground: Callable[[FloatArray], FloatArray] | None = None  # heights at points in meters


def _read_records(
    features: Iterable[tuple[Any, Mapping[str, Any]]],
    rules: footprints.WallRules,
    tolerance: SimplifyTolerance,
    plane: Callable[[FloatArray], MetricPlane],
) -> Iterator[Record]:
    """Return the walls of shapes; `plane` returns the projection for all their points."""
    walls = list[tuple[Any, WallProfile]]()
    streets = list[Any]()
    for shape, given in features:
        tags = {key: text for key, text in given.items() if isinstance(text, str)}
        is_line = getattr(shape, "geom_type", None) == "LineString"
        wall = rules.find_barrier(tags) if is_line else rules.find_wall(tags)
        if wall is not None:
            walls.append((shape, wall))
        elif is_line and "highway" in tags:
            streets.append(shape)
    shapes = footprints.convert_shapes([shape for shape, _ in walls])
    points = footprints.list_points(shapes)
    if not len(points):
        return iter(())
    roads = footprints.convert_shapes(streets)
    to_metres, ground = plane(points)
    return _list_records(make_faces(shapes, [wall for _, wall in walls], to_metres, tolerance, roads, ground))


def _make_streets(roads: OsmRoads) -> footprints.Shapes:
    """Return the roads that are complete in the file."""
    rows = [[way] for way in range(len(roads.tags))]
    return footprints.make_lines(footprints.make_outlines_of_ways(roads.offsets, roads.lonlat, rows, roads.tags))


def _make_plane(
    crs: object, elevation: Elevation | None, default: Callable[[FloatArray], str] = find_utm_crs
) -> Callable[[FloatArray], MetricPlane]:
    """Return a function from the points of a map to its plane, in the caller's CRS in meters, or the default one."""
    if crs is not None:
        name, in_degrees = parse_crs(crs)
        if in_degrees:
            raise BadValue(f"crs is {name}, which is in degrees. Give a CRS in meters, such as ctx.graph.crs.")

    def plane(points: FloatArray) -> MetricPlane:
        # The caller's CRS may belong to another part of the world.
        target, to = (default(points), project) if crs is None else (name, project_back_and_forth)
        to_metres = partial(to, source=WGS84, target=target)
        if crs is not None and (fault := scale_fault(name, to_metres(points))):
            raise BadValue(f"crs: {fault}. Give that of the UTM zone, or ctx.graph.crs.")
        if elevation is None:
            return MetricPlane(to_metres)
        return MetricPlane(to_metres, lambda xy: elevation.heights(project(xy, target, WGS84)))

    return plane


def _make_plane_of_frame(crs: object) -> Callable[[FloatArray], MetricPlane]:
    """Return a function from points in the CRS of a GeoDataFrame to their plane."""
    name, in_degrees = (None, False) if crs is None else parse_crs(crs)
    if in_degrees:
        return _make_plane(None, None)

    def plane(points: FloatArray) -> MetricPlane:
        if name is None or is_true(compute_ground_scale(name, points)):
            return MetricPlane(lambda xy: xy)
        return MetricPlane(partial(project, source=name, target=find_utm_crs(project(points, name, WGS84))))

    return plane


def _list_records(faces: WallFaces) -> Iterator[Record]:
    for first in range(
        0, len(faces.types), _AT_ONCE
    ):  # not all at once: a dict takes ten times the memory of its numbers
        corners = faces.corners[first : first + _AT_ONCE].tolist()
        types = faces.types[first : first + _AT_ONCE].tolist()
        for row, (type, face) in enumerate(zip(types, corners, strict=True), first):
            tr, tl, br, bl = map(tuple, face)
            yield {"face_id": row, "tr": tr, "tl": tl, "br": br, "bl": bl, "type": type}


def _find_crs(segments: RoadSegments) -> str | None:
    """Return the CRS that `graph_from_xml` gives these roads; None without roads."""
    return find_utm_crs(find_largest_part(segments).lonlat) if len(segments.sources) else None


def _check_rules(
    tags: TagFilter | None, estimates: HeightEstimates | None, tolerances: tuple[float, float], more: WallOptions
) -> tuple[footprints.WallRules, SimplifyTolerance]:
    """Return the checked rules for walls, and the tolerance of their simplification."""
    refuse_keywords(more, WallOptions.__annotations__, "A map of obstacles")
    heights = _check_barrier_heights(more.get("barriers", False))
    rules = footprints.WallRules(tags, wall_estimates() if estimates is None else estimates, heights)
    tolerance = SimplifyTolerance(
        as_range(tolerances[0], "min_tolerance"), as_range(tolerances[1], "relative_tolerance")
    )
    if math.inf in tolerance:
        raise BadValue("min_tolerance and relative_tolerance must be finite.")
    return rules, tolerance


def _check_barrier_heights(barriers: Barriers) -> dict[str, float]:
    if isinstance(barriers, bool):
        return BARRIER_HEIGHTS if barriers else {}
    if isinstance(barriers, Mapping):
        heights = {str(kind): as_float(height, f"barriers[{kind!r}]") for kind, height in barriers.items()}
        if min(heights.values(), default=1.0) <= 0.0:
            raise BadValue(f"The heights of barriers must be more than 0 m, not {shown(barriers)}.")
        return heights
    kinds = [barriers] if isinstance(barriers, str) else as_items(barriers, "barriers", "values of `barrier`")
    for kind in kinds:
        if not isinstance(kind, str) or kind not in BARRIER_HEIGHTS:
            raise BadValue(
                f"barriers has the unknown kind {shown(kind)}.{nearest(kind, BARRIER_HEIGHTS)} "
                "Give a dict with heights in meters."
            )
    return {kind: BARRIER_HEIGHTS[kind] for kind in kinds}
