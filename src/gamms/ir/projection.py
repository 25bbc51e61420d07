"""Projections by pyproj: between degrees and metres, and true lengths on the ellipsoid."""

from functools import lru_cache
from typing import Any

import numpy as np

from gamms.errors import BadValue, MissingExtra
from gamms.ir.graph import FloatArray
from gamms.text import shown

WGS84 = "EPSG:4326"
_UTM_REACH = 84.0  # degrees of latitude
_CENTIMETRE = 0.01
_BEYOND = 10.0  # degrees: a map may reach beyond its zone, a swapped latitude and longitude reaches farther


def utm_crs(lonlat: FloatArray) -> str:
    """Return the UTM zone of the mean position, as `EPSG:326xx` (north) or `EPSG:327xx` (south).

    Raises:
        BadValue: a position lies beyond 84 degrees north or south, where UTM ends, or far beside the zone.
    """
    farthest = float(np.abs(lonlat[:, 1]).max())
    if farthest > _UTM_REACH:
        raise BadValue(
            f"The map reaches latitude {farthest}: UTM, the projection to metres, ends at "
            f"{_UTM_REACH} degrees. Project the network yourself and give it to process_osm_graph."
        )
    turn = np.exp(1j * np.radians(lonlat[:, 0])).mean()  # on the circle: a map may straddle the date line
    zone = int((np.degrees(np.angle(turn)) + 180.0) // 6.0) % 60 + 1
    crs = f"EPSG:{(32600 if lonlat[:, 1].mean() >= 0.0 else 32700) + zone}"
    if not _is_in_zone(lonlat, crs).all():
        raise BadValue(
            f"The map is too wide for one projection to metres: it reaches more than {_BEYOND:.0f} degrees of "
            f"longitude beyond {crs}, the zone of its middle. Cut a smaller area out of it."
        )
    return crs


def project(points: FloatArray, source: object, target: str) -> FloatArray:
    """Positions (points, 2) of one CRS in another; degrees are longitude, latitude.

    Raises:
        BadValue: a position has no place in the target.
    """
    xy = _transformed(points, source, target)
    lost = np.flatnonzero(~np.isfinite(xy).all(axis=1))
    if len(lost):
        raise BadValue(
            f"The position {points[lost[0]].tolist()} cannot be projected to {target}: the map is too large "
            "for one zone. Cut a smaller area out of it."
        )
    return xy


def project_back_and_forth(points: FloatArray, source: str, target: str) -> FloatArray:
    """Positions (points, 2) of one CRS in another, each of which leads back to a centimetre from where it came.

    Far from the zone of a projection its formulas give numbers of another place, or useless ones.

    Raises:
        BadValue: a position lies outside the projection, or one of the two names no CRS.
    """
    there = _transformed(points, source, target)
    lonlat, again = _transformed(points, source, WGS84), _transformed(there, target, WGS84)
    errors_m = np.full(len(points), np.inf)  # metres
    sound = np.flatnonzero(np.isfinite(np.column_stack([there, lonlat, again])).all(axis=1))
    sound = sound[_is_in_zone(lonlat[sound], source) & _is_in_zone(lonlat[sound], target)]
    errors_m[sound] = ellipsoid_lengths(lonlat[sound], again[sound])
    lost = np.flatnonzero(errors_m > _CENTIMETRE)
    if len(lost):
        raise BadValue(
            f"The position {points[lost[0]].tolist()} of {source} has no place in {target}: it lies outside the area "
            "of the projection. Check the order of the coordinates, and graph.crs."
        )
    return there


def ellipsoid_lengths(start: FloatArray, end: FloatArray) -> FloatArray:
    """Metres along the WGS84 ellipsoid between positions (lines, 2) in degrees."""
    _, _, lengths = _pyproj().Geod(ellps="WGS84").inv(start[:, 0], start[:, 1], end[:, 0], end[:, 1])
    return np.asarray(lengths, np.float64)


def crs_of(crs: object) -> tuple[str, bool]:
    """Return the text of a CRS that a graph names, and whether it counts in degrees; else it counts in metres.

    Raises:
        BadValue: it names no CRS, or one that counts in something else, such as feet.
    """
    pyproj = _pyproj()
    try:
        known = pyproj.CRS.from_user_input(crs)
    except (pyproj.exceptions.CRSError, ValueError) as error:  # a ValueError of an integer of 4,300 digits
        raise BadValue(f"graph['crs'] is {shown(crs)}, which names no CRS. Give one such as 'EPSG:32635'.") from error
    name = str(known.to_string())
    for axis in known.axis_info[:2]:
        if not known.is_geographic and axis.unit_conversion_factor not in (0.0, 1.0):  # 0: unknown
            raise BadValue(
                f"{name:.80} counts in {axis.unit_name}, and lengths and heights of maps are in metres. Project the "
                "map to a CRS in metres, such as that of its UTM zone."
            )
    return name, bool(known.is_geographic)


def _is_in_zone(lonlat: FloatArray, crs: str) -> "np.ndarray[Any, np.dtype[np.bool_]]":
    """Return whether positions (points, 2) lie in the zone where a CRS is in use, or not far beside it.

    Longitude decides: a northern zone is good south of the equator, too.
    """
    area = _transformer(crs, WGS84).source_crs.area_of_use
    if area is None:
        return np.ones(len(lonlat), np.bool_)
    width = (area.east - area.west) % 360.0 or 360.0  # an area may straddle the date line
    off_middle = np.abs((lonlat[:, 0] - area.west - width / 2.0 + 180.0) % 360.0 - 180.0)
    is_in: np.ndarray[Any, np.dtype[np.bool_]] = off_middle <= width / 2.0 + _BEYOND
    return is_in


def _transformed(points: FloatArray, source: object, target: object) -> FloatArray:
    """Positions (points, 2) of one CRS in another; infinite where there is none."""
    return np.column_stack(_transformer(source, target).transform(points[:, 0], points[:, 1]))


@lru_cache(maxsize=32)
def _transformer(source: object, target: object) -> Any:
    pyproj = _pyproj()
    try:
        return pyproj.Transformer.from_crs(source, target, always_xy=True)
    except pyproj.exceptions.ProjError as error:
        raise BadValue(
            f"There is no way from {shown(source)} to {shown(target)}: {error}. Give a CRS such as 'EPSG:32635'."
        ) from error


def _pyproj() -> Any:
    try:
        import pyproj
    except ImportError as error:
        raise MissingExtra("Projecting coordinates", "osm") from error
    return pyproj
