"""Between the map's x and y and degrees on the globe, for one place or many alike."""

from typing import Any

import numpy as np

from gamms.errors import BadType, BadValue
from gamms.ir import projection
from gamms.ir.graph import FloatArray
from gamms.text import shown

_NEAR_M = 1_000.0  # from which a place is never too far
_MOST_LAT, _MOST_LON = 90.0, 360.0  # degrees; both -10 and 350 are in use for the same meridian


def to_latlon(crs: str | None, x: Any, y: Any) -> tuple[Any, Any]:
    """Latitude and longitude in degrees: floats for numbers, arrays for arrays."""
    known = _known(crs, "graph.to_latlon(x, y)")
    xy = pairs(x, y, ("x", "y"))
    lonlat = projection.project_back_and_forth(xy.reshape(-1, 2), known, projection.WGS84).reshape(xy.shape)
    return _column(lonlat, 1), _column(lonlat, 0)


def from_latlon(crs: str | None, lat: Any, lon: Any) -> tuple[Any, Any]:
    """Map units x and y: floats for numbers, arrays for arrays."""
    xy = _projected(crs, lat, lon, "graph.from_latlon(lat=, lon=)")
    return _column(xy, 0), _column(xy, 1)


def places_of(crs: str | None, xy: tuple[Any, Any], latlon: tuple[Any, Any]) -> FloatArray:
    """Places (2,) or (places, 2) in map units, given as x and y or as latitude and longitude.

    Raises:
        BadType: neither pair is complete, or both are given.
    """
    is_xy, is_latlon = ([value is not None for value in pair] for pair in (xy, latlon))
    if all(is_xy) and not any(is_latlon):
        return pairs(*xy, ("x", "y"))
    if all(is_latlon) and not any(is_xy):
        return _projected(crs, *latlon, "graph.nearest_node(lat=, lon=)")
    raise BadType("Give a place as nearest_node(x, y) or as nearest_node(lat=…, lon=…).")


def refuse_far(crs: str, nodes: FloatArray, places: FloatArray, nearest: FloatArray) -> None:
    """Refuse places that are meant to be on a map, and are not.

    Args:
        crs: of the map.
        nodes: (nodes, 2) of the map; one at least.
        places: (places, 2)
        nearest: (places, 2) the nodes nearest to them.

    Raises:
        BadValue: a place is farther from the map than the map is wide, and farther than a kilometre.
    """
    bounds = np.stack((nodes.min(axis=0), nodes.max(axis=0)))
    south_west, north_east = projection.project(bounds, crs, projection.WGS84)
    width = float(projection.ellipsoid_lengths(south_west[None], north_east[None])[0])
    there, near = (projection.project(points, crs, projection.WGS84) for points in (places, nearest))
    off = projection.ellipsoid_lengths(there, near)
    far = np.flatnonzero(off > max(width, _NEAR_M))
    if len(far):
        (west, south), (east, north), (lon, lat) = (point.tolist() for point in (south_west, north_east, there[far[0]]))
        raise BadValue(
            f"lat={lat:.6g}, lon={lon:.6g} is {off[far[0]] / 1000.0:,.1f} km from the nearest node: the map reaches "
            f"from lat={south:.6g}, lon={west:.6g} to lat={north:.6g}, lon={east:.6g}. Is this the right map?"
        )


def pairs(first: Any, second: Any, names: tuple[str, str]) -> FloatArray:
    """Two numbers as (2,), two arrays of one length as (places, 2); all finite.

    Raises:
        BadType: they are not numbers.
        BadValue: they have different shapes, or one is not finite.
    """
    arrays = [_numbers(value, name) for value, name in zip((first, second), names, strict=True)]
    if arrays[0].shape != arrays[1].shape or arrays[0].ndim > 1:
        raise BadValue(
            f"{names[0]} and {names[1]} must be two numbers or two arrays of one length, not of the shapes "
            f"{arrays[0].shape} and {arrays[1].shape}."
        )
    return np.stack(arrays, axis=-1)


def _projected(crs: str | None, lat: Any, lon: Any, call: str) -> FloatArray:
    known = _known(crs, call)
    lonlat = pairs(lon, lat, ("lon", "lat"))
    for name, most, values in (("lat", _MOST_LAT, lonlat[..., 1]), ("lon", _MOST_LON, lonlat[..., 0])):
        wrong = values[np.abs(values) > most]
        if wrong.size:
            raise BadValue(f"{name} must lie between -{most:g} and {most:g} degrees, not {wrong.flat[0]}.")
    return projection.project_back_and_forth(lonlat.reshape(-1, 2), projection.WGS84, known).reshape(lonlat.shape)


def _known(crs: str | None, call: str) -> str:
    if crs is None:
        raise BadValue(
            f"{call} needs to know what x and y mean: set graph.crs to the coordinate reference system of the map, "
            "such as 'EPSG:32635'."
        )
    return crs


def _numbers(values: Any, name: str) -> FloatArray:
    try:
        array = np.asarray(values)
    except ValueError as error:
        raise BadType(f"{name} must be a number or an array of numbers: {error}.") from None
    if array.size == 0:
        array = array.astype(np.float64)
    if array.dtype.kind not in "iuf":
        raise BadType(f"{name} must be a number or an array of numbers, not {shown(values)}.")
    array = array.astype(np.float64, copy=False)
    wrong = array[~np.isfinite(array)]
    if wrong.size:
        raise BadValue(f"{name} must be finite, not {wrong.flat[0]}.")
    return array


def _column(pairs: FloatArray, which: int) -> Any:
    return float(pairs[which]) if pairs.ndim == 1 else pairs[:, which].copy()
