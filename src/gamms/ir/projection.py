"""The one door to pyproj: between degrees and metres, and true lengths on the ellipsoid."""

from typing import Any

import numpy as np

from gamms.errors import BadValue, MissingExtra
from gamms.ir.graph import FloatArray

WGS84 = "EPSG:4326"
_UTM_REACH = 84.0  # degrees of latitude


def utm_crs(lonlat: FloatArray) -> str:
    """The UTM zone of the mean position, as `EPSG:326xx` (north) or `EPSG:327xx` (south).

    Raises:
        BadValue: a position lies beyond 84 degrees north or south, where UTM ends.
    """
    farthest = float(np.abs(lonlat[:, 1]).max())
    if farthest > _UTM_REACH:
        raise BadValue(
            f"The map reaches latitude {farthest}: UTM, the projection to metres, ends at "
            f"{_UTM_REACH} degrees. Project the network yourself and give it to process_osm_graph."
        )
    turn = np.exp(1j * np.radians(lonlat[:, 0])).mean()  # on the circle: a map may straddle the date line
    zone = int((np.degrees(np.angle(turn)) + 180.0) // 6.0) % 60 + 1
    return f"EPSG:{(32600 if lonlat[:, 1].mean() >= 0.0 else 32700) + zone}"


def project(points: FloatArray, source: Any, target: str) -> FloatArray:
    """Positions (points, 2) of one CRS in another; degrees are longitude, latitude.

    Raises:
        BadValue: a position has no place in the target.
    """
    pyproj = _pyproj()
    transform = pyproj.Transformer.from_crs(source, target, always_xy=True).transform
    xy = np.column_stack(transform(points[:, 0], points[:, 1]))
    lost = np.flatnonzero(~np.isfinite(xy).all(axis=1))
    if len(lost):
        raise BadValue(
            f"The position {points[lost[0]].tolist()} cannot be projected to {target}: the map is too large "
            "for one zone. Cut a smaller area out of it."
        )
    return xy


def ellipsoid_lengths(start: FloatArray, end: FloatArray) -> FloatArray:
    """Metres along the WGS84 ellipsoid between positions (lines, 2) in degrees."""
    _, _, lengths = _pyproj().Geod(ellps="WGS84").inv(start[:, 0], start[:, 1], end[:, 0], end[:, 1])
    return np.asarray(lengths, np.float64)


def crs_of(crs: Any) -> tuple[str, bool]:
    """The text of a CRS that a graph names, and whether it counts in degrees.

    Raises:
        BadValue: it names no CRS.
    """
    pyproj = _pyproj()
    try:
        known = pyproj.CRS.from_user_input(crs)
    except pyproj.exceptions.CRSError as error:
        raise BadValue(f"graph['crs'] is {crs!r}, which names no CRS. Give one such as 'EPSG:32635'.") from error
    return str(known.to_string()), bool(known.is_geographic)


def _pyproj() -> Any:
    try:
        import pyproj
    except ImportError as error:
        raise MissingExtra("Projecting coordinates", "osm") from error
    return pyproj
