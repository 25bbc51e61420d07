"""Buildings as obstacles: from footprints with tags to the walls that `ctx.graph.add_obstacles` takes."""

import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from gamms.arguments import as_range
from gamms.errors import BadType, BadValue
from gamms.ir.graph import FloatArray
from gamms.ir.projection import WGS84, crs_of, project, project_back_and_forth, utm_crs
from gamms.osm import footprints
from gamms.osm.constants import OSM_OBSTACLE_TAGS, wall_estimates
from gamms.osm.footprints import HeightEstimates, TagFilter
from gamms.osm.network import largest_part, segments_of
from gamms.osm.osmium_reader import as_file, read_footprints, read_ways
from gamms.osm.overpass import Location, features_of_place

Record = dict[str, Any]  # the arguments of `ctx.graph.add_obstacle_face`
Projection = Callable[[FloatArray], FloatArray]  # points (points, 2) to points in metres

_AT_ONCE = 4096  # faces


def obstacle_from_file(
    filepath: str | os.PathLike[str],
    tags: TagFilter = OSM_OBSTACLE_TAGS,
    height_estimates: HeightEstimates | None = None,
    min_tolerance: float = 0.5,
    relative_tolerance: float = 0.01,
    crs: object = None,
) -> Iterator[Record]:
    """Return the walls of the buildings in an OpenStreetMap file (.osm, .xml, .osm.gz, .osm.bz2, .osm.pbf).

    A wall is a vertical quadrangle above one edge of a footprint, around courtyards too. A file without buildings
    gives no walls. Footprints that a file holds in part, or that cross themselves, give the walls that they enclose.

    Args:
        filepath: the map file.
        tags: only things with one of these tags.
        height_estimates: (key, value) -> (height in metres, type): what is a wall at all, and how high where neither
            `height` nor `building:levels` says so. None: `gamms.osm.wall_estimates()`, without land use.
        min_tolerance: metres by which a footprint may be simplified.
        relative_tolerance: the same as a part of its perimeter; the greater of both counts.
        crs: the CRS of the walls, in metres; give `ctx.graph.crs` if there are streets already. None: that of
            `graph_from_xml` with its defaults for the same file or, in a file without roads, the UTM zone of the
            mean point of the footprints.

    Returns:
        An iterator over dicts for `ctx.graph.add_obstacle_face(**wall)`, or all of it for `ctx.graph.add_obstacles`:
        `face_id` from 0, the corners `tr`, `tl`, `br`, `bl` as (x, y, z), and `type`.

    Raises:
        FileNotFoundError, IsADirectoryError: there is no such file.
        BadFile: it is damaged or not OpenStreetMap data.
        BadValue, BadType: an argument is impossible.
        MissingExtra: osmium or pyproj is not installed.
    """
    rules, tolerances = _checked(tags, height_estimates, min_tolerance, relative_tolerance)
    projection = _projection(crs, lambda points: _crs_of_roads(file) or utm_crs(points))
    file = as_file(filepath)
    outlines = read_footprints(file, rules)
    if not len(outlines.owners):
        return iter(())
    return _records(
        footprints.faces_of(
            footprints.footprints_of(outlines), outlines.about, projection(outlines.lonlat), *tolerances
        )
    )


obstacle_from_xml = obstacle_from_file  # the name that 1.0.0 gave it


def obstacle_from_osm(
    location: Location,
    tags: TagFilter = OSM_OBSTACLE_TAGS,
    height_estimates: HeightEstimates | None = None,
    min_tolerance: float = 0.5,
    relative_tolerance: float = 0.01,
    crs: object = None,
    *,
    offline: bool = False,
) -> Iterator[Record]:
    """Return the walls of the buildings of a place, such as `"Monaco"`, from the servers of OpenStreetMap.

    Everything but `location` is as for `obstacle_from_file`. Without `crs`, it is the UTM zone of the mean point of
    the footprints; give `ctx.graph.crs` if there are streets already, so that both fit. `offline` takes what the
    servers answered before.

    Raises:
        BadValue, BadType: an argument is impossible.
        PlaceError, NetworkError: there is no such place, nothing in it, or no answer.
        MissingExtra: requests or pyproj is not installed.
    """
    rules, tolerances = _checked(tags, height_estimates, min_tolerance, relative_tolerance)
    projection = _projection(crs)
    return _records_of_features(features_of_place(location, tags, offline=offline), rules, tolerances, projection)


def faces_of_features(
    features: Iterable[tuple[Any, Mapping[str, Any]]],
    crs: object = None,
    height_estimates: HeightEstimates | None = None,
    min_tolerance: float = 0.5,
    relative_tolerance: float = 0.01,
    *,
    tags: TagFilter | None = None,
) -> Iterator[Record]:
    """Return the walls of shapely polygons and multipolygons in longitude and latitude, each with its tags.

    What is no polygon, and a tag that is no text, is passed over. Everything else is as for `obstacle_from_file`.

    Raises:
        BadValue, BadType: an argument is impossible, or a polygon has no place in the CRS.
        MissingExtra: pyproj is not installed.
    """
    rules, tolerances = _checked(tags, height_estimates, min_tolerance, relative_tolerance)
    return _records_of_features(features, rules, tolerances, _projection(crs))


def extract_osm_polygon_faces(
    gdf: Any,  # geopandas is not ours to import
    height_estimates: HeightEstimates | None = None,
    min_tolerance: float = 0.5,
    relative_tolerance: float = 0.01,
) -> Iterator[Record]:
    """Return the walls of the polygons in a GeoDataFrame, such as OSMnx makes, whose columns are the tags.

    One whose `crs` counts in degrees is projected to UTM; any other is taken as metres, just as it is.

    Raises:
        BadType: it is no GeoDataFrame.
        BadValue: its CRS is none, or another argument is impossible.
    """
    rules, tolerances = _checked(None, height_estimates, min_tolerance, relative_tolerance)
    try:
        name = gdf.geometry.name
        features = [(row[name], row) for row in gdf.to_dict("records")]
    except AttributeError:
        raise BadType(f"gdf must be a GeoDataFrame, not {type(gdf).__name__}.") from None
    in_degrees = gdf.crs is not None and crs_of(gdf.crs)[1]
    projection = _projection(None) if in_degrees else lambda _: lambda points: points
    return _records_of_features(features, rules, tolerances, projection)


# -- inside -----------------------------------------------------------------------------------------------------


def _records_of_features(
    features: Iterable[tuple[Any, Mapping[str, Any]]],
    rules: footprints.WallRules,
    tolerances: tuple[float, float],
    projection: Callable[[FloatArray], Projection],
) -> Iterator[Record]:
    """Return the walls of shapes; `projection` says for all their points how these become metres."""
    texts = ((shape, {key: text for key, text in tags.items() if isinstance(text, str)}) for shape, tags in features)
    chosen = [(shape, wall) for shape, tags in texts if (wall := rules.wall_of(tags)) is not None]
    shapes, points = footprints.shapes_of([shape for shape, _ in chosen])
    if not len(points):
        return iter(())
    return _records(footprints.faces_of(shapes, [wall for _, wall in chosen], projection(points), *tolerances))


def _projection(crs: object, default: Callable[[FloatArray], str] = utm_crs) -> Callable[[FloatArray], Projection]:
    """From the points of a map to its projection: to a CRS in metres of the caller's, or to the default one."""
    if crs is None:
        return lambda points: partial(project, source=WGS84, target=default(points))
    name, in_degrees = crs_of(crs)
    if in_degrees:
        raise BadValue(f"crs is {name}, which counts in degrees. Give one in metres, such as ctx.graph.crs.")
    # It may belong to another part of the world.
    return lambda _: partial(project_back_and_forth, source=WGS84, target=name)


def _records(faces: footprints.Faces) -> Iterator[Record]:
    for first in range(0, len(faces.types), _AT_ONCE):  # not all at once: a dict takes ten times its numbers
        corners = faces.corners[first : first + _AT_ONCE].tolist()
        types = faces.types[first : first + _AT_ONCE].tolist()
        for row, (type, face) in enumerate(zip(types, corners, strict=True), first):
            tr, tl, br, bl = map(tuple, face)
            yield {"face_id": row, "tr": tr, "tl": tl, "br": br, "bl": bl, "type": type}


def _crs_of_roads(file: Path) -> str | None:
    """Return the CRS that `graph_from_xml` gives a file that is known to be sound; None if it has no roads."""
    segments = segments_of(read_ways(file, lambda _: None))
    return utm_crs(largest_part(segments).lonlat) if len(segments.sources) else None


def _checked(
    tags: TagFilter | None, estimates: HeightEstimates | None, min_tolerance: float, relative_tolerance: float
) -> tuple[footprints.WallRules, tuple[float, float]]:
    """Return what decides on the walls, and the tolerances of their simplification."""
    rules = footprints.WallRules(tags, wall_estimates() if estimates is None else estimates)
    tolerances = as_range(min_tolerance, "min_tolerance"), as_range(relative_tolerance, "relative_tolerance")
    if math.inf in tolerances:
        raise BadValue("min_tolerance and relative_tolerance must be finite.")
    return rules, tolerances
