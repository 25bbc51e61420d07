"""Projections between degrees and metres, and lengths on the ellipsoid.

UTM zones (EPSG:326xx, 327xx, for Europe 258xx, for Finland 3067) are computed here, with the series of Krüger (1912) to
sixth order as given by Karney ("Transverse Mercator with an accuracy of a few nanometers", 2011), and lengths with the
formula of Vincenty (1975): with the same bits on every machine, by the functions at the end. All other CRSs use pyproj.
"""

import re
import warnings
from collections.abc import Sequence
from functools import cache, lru_cache
from itertools import accumulate, repeat
from math import factorial, pi
from operator import mul
from typing import Any, NamedTuple

import numpy as np

from gamms.errors import BadValue, MissingExtra
from gamms.ir.graph import FloatArray
from gamms.plugins import require_extra
from gamms.text import shown

WGS84 = "EPSG:4326"
_UTM_REACH = 84.0  # degrees of latitude
_CENTIMETRE = 0.01
_TURN = 360.0  # degrees
_TINY = 0.1  # metres or degrees: maps in metres have longer lines, and streets in degrees do not
_NEAR = 0.2  # the largest size of a map in degrees, as a share of its coordinates
_BEYOND = 10.0  # degrees: a map may extend beyond its zone; with swapped latitude and longitude it extends farther
_A = 6378137.0  # metres, equatorial radius of both ellipsoids
# flattenings
_WGS84_F = 1.0 / 298.257223563
_GRS80_F = 1.0 / 298.257222101
# scale and easting of the central meridian of a zone
_K0 = 0.9996
_EAST = 500_000.0
_FORTH = (  # coefficients of n, n^2, … (Karney 2011, equation 35), row j for the j-th multiple of the angle
    (1 / 2, -2 / 3, 5 / 16, 41 / 180, -127 / 288, 7891 / 37800),
    (0, 13 / 48, -3 / 5, 557 / 1440, 281 / 630, -1983433 / 1935360),
    (0, 0, 61 / 240, -103 / 140, 15061 / 26880, 167603 / 181440),
    (0, 0, 0, 49561 / 161280, -179 / 168, 6601661 / 7257600),
    (0, 0, 0, 0, 34729 / 80640, -3418889 / 1995840),
    (0, 0, 0, 0, 0, 212378941 / 319334400),
)
_BACK = (  # equation 36
    (1 / 2, -2 / 3, 37 / 96, -1 / 360, -81 / 512, 96199 / 604800),
    (0, 1 / 48, 1 / 15, -437 / 1440, 46 / 105, -1118711 / 3870720),
    (0, 0, 17 / 480, -37 / 840, -209 / 4480, 5569 / 90720),
    (0, 0, 0, 4397 / 161280, -11 / 504, -830251 / 7257600),
    (0, 0, 0, 0, 4583 / 161280, -108847 / 3991680),
    (0, 0, 0, 0, 0, 20648693 / 638668800),
)
_ROUNDS = 3  # iterations of Newton's method for the latitude; each doubles the number of correct digits
_TURNS = 20  # iterations of Vincenty's method, which takes four except for antipodal points
# radians: nanometres, and millimetres
_SAME_ANGLE = 1e-15
_LOST_ANGLE = 1e-9
_EPSG = re.compile(r"\s*(?:EPSG\s*:\s*)?(\d{4,5})\s*", re.IGNORECASE | re.ASCII)
_MOST_CODE = 100_000
_LONGEST_NAME = 80
_DEGREES = "degrees"
_METRES = "metres"
_UNITS = (_DEGREES, _METRES)
_PROJECT_IT = "Project the map to a CRS in metres, such as that of its UTM zone."
_STEP_M = 100.0  # over which the scale of a projection is measured
_MOST_OFF = 0.01


def find_utm_crs(lonlat: FloatArray) -> str:
    """Return the UTM zone of the mean position, as `EPSG:326xx` (north) or `EPSG:327xx` (south).

    Raises:
        BadValue: a position lies beyond 84 degrees north or south, where UTM ends, or far from the zone.
    """
    farthest = float(np.abs(lonlat[:, 1]).max())
    if farthest > _UTM_REACH:
        raise BadValue(
            f"The map reaches latitude {farthest}: UTM, the projection to metres, ends at "
            f"{_UTM_REACH} degrees. Project the network yourself and give it to process_osm_graph."
        )
    turn = np.exp(1j * np.radians(lonlat[:, 0])).mean()  # on the circle, because a map may straddle the date line
    zone = int((np.degrees(np.angle(turn)) + 180.0) // 6.0) % 60 + 1
    crs = f"EPSG:{(32600 if lonlat[:, 1].mean() >= 0.0 else 32700) + zone}"
    if not _is_in_zone(lonlat, crs).all():
        raise BadValue(
            f"The map is too wide for one projection to metres: it reaches more than {_BEYOND:.0f} degrees of "
            f"longitude beyond {crs}, the zone of its middle. Cut a smaller area out of it."
        )
    return crs


def project(points: FloatArray, source: object, target: str) -> FloatArray:
    """Project positions (points, 2) from one CRS to another; degrees are (longitude, latitude).

    Raises:
        BadValue: a position cannot be projected to the target.
    """
    xy = _transform(points, source, target)
    lost = np.flatnonzero(~np.isfinite(xy).all(axis=1))
    if len(lost):
        raise BadValue(
            f"The position {points[lost[0]].tolist()} cannot be projected to {target}: the map is too large "
            "for one zone. Cut a smaller area out of it."
        )
    return xy


def project_back_and_forth(points: FloatArray, source: str, target: str) -> FloatArray:
    """Project positions (points, 2), and check that each projects back to within a centimetre.

    Far from its zone, a projection gives coordinates of another place, or invalid ones.

    Raises:
        BadValue: a position lies outside the projection, or an argument is not a CRS.
    """
    there = _transform(points, source, target)
    lonlat = _transform(points, source, WGS84)
    again = _transform(there, target, WGS84)
    errors_m = np.full(len(points), np.inf)  # metres
    sound = np.flatnonzero(np.isfinite(np.column_stack([there, lonlat, again])).all(axis=1))
    sound = sound[_is_in_zone(lonlat[sound], source) & _is_in_zone(lonlat[sound], target)]
    errors_m[sound] = measure_on_ellipsoid(lonlat[sound], again[sound])
    lost = np.flatnonzero(errors_m > _CENTIMETRE)
    if len(lost):
        raise BadValue(
            f"The position {points[lost[0]].tolist()} of {source} has no place in {target}: it lies outside the area "
            "of the projection. Check the order of the coordinates, and graph.crs."
        )
    return there


def unroll(lonlat: FloatArray) -> FloatArray:
    """Return positions (points, 2) in degrees, in which no line of a map jumps from 180 to -180.

    The longitudes begin at the widest gap between them: of a map across 180 degrees, those in the west get 360 more.
    NaN stays.
    """
    known = lonlat[np.isfinite(lonlat[:, 0]), 0]
    if not len(known) or np.ptp(known) <= _TURN / 2.0:
        return lonlat
    east = np.unique(known)
    gaps = np.diff(east)
    widest = int(gaps.argmax())
    if gaps[widest] <= east[0] + _TURN - east[-1]:
        return lonlat
    is_west = lonlat[:, 0] <= east[widest]
    return np.column_stack((np.where(is_west, lonlat[:, 0] + _TURN, lonlat[:, 0]), lonlat[:, 1]))


def turn_longitudes(lonlat: FloatArray, middle: float) -> FloatArray:
    """Return positions (points, 2) in degrees with longitudes at most half a turn from a middle."""
    off = lonlat[:, 0] - middle
    turns = (off < -_TURN / 2.0).astype(np.float64) - (off > _TURN / 2.0)
    return np.column_stack((lonlat[:, 0] + _TURN * turns, lonlat[:, 1])) if turns.any() else lonlat


def measure_on_ellipsoid(start: FloatArray, end: FloatArray) -> FloatArray:
    """Return distances in metres along the WGS84 ellipsoid between positions (lines, 2) in degrees.

    Uses the inverse formula of Vincenty, accurate to 0.1 mm; for nearly antipodal points, where it does not
    converge, the great circle, accurate to 0.6 %.
    """
    f = _WGS84_F
    apart = np.radians((end[:, 0] - start[:, 0] + 180.0) % 360.0 - 180.0)
    (s1, c1), (s2, c2) = (compute_sine_cosine(_reduce_latitudes(side)) for side in (start, end))
    angle = apart
    step = np.zeros_like(apart)
    for _ in range(_TURNS):
        east, north = compute_sine_cosine(angle)
        sine = compute_length(c2 * east, c1 * s2 - s1 * c2 * north)
        cosine = s1 * s2 + c1 * c2 * north
        arc = compute_polar_angle(sine, cosine)
        tilt = np.divide(c1 * c2 * east, sine, out=np.zeros_like(sine), where=sine > 0.0)
        flat = 1.0 - tilt**2  # the squared cosine of the azimuth at the equator
        middle = cosine - 2.0 * np.divide(s1 * s2, flat, out=np.zeros_like(flat), where=flat > 0.0)
        c = f / 16.0 * flat * (4.0 + f * (4.0 - 3.0 * flat))
        wave = middle + c * cosine * (2.0 * middle**2 - 1.0)
        following = apart + (1.0 - c) * f * tilt * (arc + c * sine * wave)
        step = np.abs(following - angle)
        angle = following
        if not (step > _SAME_ANGLE).any():
            break
    u2 = flat * f * (2.0 - f) / ((1.0 - f) * (1.0 - f))
    a = 1.0 + u2 / 16384.0 * (4096.0 + u2 * (u2 * (320.0 - 175.0 * u2) - 768.0))
    b = u2 / 1024.0 * (256.0 + u2 * (u2 * (74.0 - 47.0 * u2) - 128.0))
    third = b / 6.0 * middle * (4.0 * sine**2 - 3.0) * (4.0 * middle**2 - 3.0)
    lengths: FloatArray = (
        _A * (1.0 - f) * a * (arc - b * sine * (middle + b / 4.0 * (cosine * (2.0 * middle**2 - 1.0) - third)))
    )
    lost = step > _LOST_ANGLE
    if lost.any():
        cosine = s1 * s2 + c1 * c2 * compute_sine_cosine(apart)[1]
        lengths[lost] = _A * compute_polar_angle(np.sqrt(np.maximum(1.0 - cosine**2, 0.0)), cosine)[lost]
    return lengths


def _reduce_latitudes(lonlat: FloatArray) -> FloatArray:
    sine, cosine = compute_sine_cosine(np.radians(lonlat[:, 1]))
    return compute_polar_angle((1.0 - _WGS84_F) * sine, cosine)


def check_metres(points: FloatArray, lengths: FloatArray, name: str) -> None:
    """Check that coordinates without a CRS may be metres: as degrees, a city is far from the origin and tiny.

    Args:
        points: (points, 2) all coordinates.
        lengths: (lines,) in the units of the coordinates.
        name: the subject of the error, with a hint where the CRS belongs.

    Raises:
        BadValue: they look like degrees.
    """
    if not len(points) or not len(lengths) or not (np.abs(points) <= (180.0, 90.0)).all():
        return
    size = np.ptp(points, axis=0).max()
    farthest = np.abs(points).max()
    if 0.0 < lengths.max() < _TINY and size < _NEAR * farthest:
        west, south = points.min(axis=0).tolist()
        east, north = points.max(axis=0).tolist()
        raise BadValue(
            f"{name}, and its coordinates look like degrees: from ({west:g}, {south:g}) to ({east:g}, {north:g}). "
            "Give 'EPSG:4326' for longitude and latitude, or the CRS of its coordinates in metres."
        )


def parse_crs(crs: object) -> tuple[str, bool]:
    """Return the text of a CRS, and whether its unit is degrees; otherwise it is metres.

    Raises:
        BadValue: not a CRS, or its unit is something else, for example feet.
    """
    name, unit = _find_name_and_unit(crs)
    if unit not in _UNITS:
        raise BadValue(f"{_explain_feet(name, unit)}. {_PROJECT_IT}")
    return name, unit == _DEGREES


def _find_name_and_unit(crs: object) -> tuple[str, str]:
    """Return the text of a CRS and its unit: "degrees", "metres", or another one by its own name.

    Raises:
        BadValue: not a CRS.
    """
    name = find_known_name(crs)
    if name is not None:
        return name, _DEGREES if name == WGS84 else _METRES
    pyproj = _import_pyproj()
    try:
        known = pyproj.CRS.from_user_input(crs)
    except (pyproj.exceptions.CRSError, ValueError) as error:  # ValueError for an integer of 4,300 digits
        raise BadValue(f"graph['crs'] is {shown(crs)}, which is not a CRS. Give one such as 'EPSG:32635'.") from error
    name = str(known.to_string())
    if known.is_geographic:
        return name, _DEGREES
    units = [axis.unit_name for axis in known.axis_info[:2] if axis.unit_conversion_factor not in (0.0, 1.0)]
    return name, str(units[0]) if units else _METRES  # 0: unknown


def _explain_feet(name: str, unit: str) -> str:
    return f"{name:.80} is in {unit}, but lengths and heights of maps are in metres"


def format_crs(crs: object) -> str:
    """Return a CRS as text: its usual name, or for a text that names no zone of UTM the text itself."""
    name = find_known_name(crs)
    if name is not None or isinstance(crs, str):
        return name or str(crs)
    try:
        return _find_name_and_unit(crs)[0]
    except (BadValue, MissingExtra):
        return str(crs)


def find_known_name(crs: object) -> str | None:
    """Return the usual text of a CRS that needs no pyproj, such as "EPSG:32635" for 32635; None for others."""
    text = str(crs) if type(crs) is int and abs(crs) < _MOST_CODE else crs
    if not isinstance(text, str) or len(text) > _LONGEST_NAME:
        return None
    found = _EPSG.fullmatch(text)
    name = f"EPSG:{found[1]}" if found else ""
    return name if name == WGS84 or find_zone(name) is not None else None


def compute_ground_scale(crs: str, xy: FloatArray) -> float:
    """Return the metres on the ground of one metre in a CRS: the value farthest from 1 at some places of a map.

    These are the middle and the corners of the box around positions (points, 2), and the directions of both axes. The
    result is 1.0 for a CRS without a place on Earth, such as that of a building site, and NaN outside of a projection.
    """
    if not len(xy):
        return 1.0
    low = xy.min(axis=0)
    high = xy.max(axis=0)
    places = np.array([(low + high) / 2.0, low, high, (low[0], high[1]), (high[0], low[1])])
    steps = np.array([(_STEP_M / 2.0, 0.0), (0.0, _STEP_M / 2.0)])
    start = (places[:, None] - steps).reshape(-1, 2)
    end = (places[:, None] + steps).reshape(-1, 2)
    try:
        ends = [_transform(points, crs, WGS84) for points in (start, end)]
    except BadValue:  # not a CRS of places on Earth
        return 1.0
    if not np.isfinite(ends).all():
        return float("nan")
    scales = measure_on_ellipsoid(*ends) / _STEP_M
    return float(scales[np.abs(scales - 1.0).argmax()])


def scale_fault(crs: object, xy: FloatArray) -> str:
    """Return why lengths in a CRS are not metres at positions (points, 2); "" if they are, or if that is unknown.

    Unknown are degrees, None, texts that name no CRS, and CRSs that need pyproj if it is not installed.
    """
    if crs is None:
        return ""
    try:
        name, unit = _find_name_and_unit(crs)
        scale = compute_ground_scale(name, xy) if unit == _METRES else 1.0
    except (BadValue, MissingExtra):
        return ""
    if unit not in _UNITS:
        return _explain_feet(name, unit)
    if is_true(scale):
        return ""
    off = "outside of its area" if np.isnan(scale) else f"where 1 m of it is {scale:.3g} m on the ground"
    return f"{name:.80} is not true to scale at this map, {off}, so its lengths are not metres"


def is_true(scale: float) -> bool:
    """Return whether lengths at a `compute_ground_scale` count as metres: one per cent is allowed."""
    return abs(scale - 1.0) <= _MOST_OFF


def _is_in_zone(lonlat: FloatArray, crs: str) -> "np.ndarray[Any, np.dtype[np.bool_]]":
    """Return whether positions (points, 2) lie in the zone of a CRS, or near it.

    Only longitude matters: a northern zone is also valid south of the equator.
    """
    zone = find_zone(crs)
    west, east = (zone.west, zone.east) if zone else _find_area_of_use(crs)
    width = (east - west) % 360.0 or 360.0  # the area may straddle the date line
    off_middle = np.abs((lonlat[:, 0] - west - width / 2.0 + 180.0) % 360.0 - 180.0)
    return off_middle <= width / 2.0 + _BEYOND


def _find_area_of_use(crs: str) -> tuple[float, float]:
    """Return the range of longitudes, in degrees, of a CRS."""
    if crs == WGS84:
        return -180.0, 180.0
    area = _import_pyproj().CRS.from_user_input(crs).area_of_use
    return (-180.0, 180.0) if area is None else (area.west, area.east)


def _transform(points: FloatArray, source: object, target: object) -> FloatArray:
    """Transform positions (points, 2) from one CRS to another; infinite if impossible."""
    if source == target:
        return points
    before, after = (find_zone(crs) if isinstance(crs, str) else None for crs in (source, target))
    if (before or source == WGS84) and (after or target == WGS84):
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # overflows are refused afterwards
            lonlat = points if before is None else _project_from_zone(points, before)
            return lonlat if after is None else _project_to_zone(lonlat, after)
    return np.column_stack(_make_transformer(source, target).transform(points[:, 0], points[:, 1]))


# -- UTM zones ----------------------------------------------------------------------------------------------------


class Zone(NamedTuple):
    """A UTM zone.

    Attributes:
        middle: longitude of its central meridian, degrees.
        north: northing of the equator, metres.
        flattening: flattening of its ellipsoid.
        west: western limit of use, degrees of longitude.
        east: eastern limit of use, degrees of longitude.
    """

    middle: float
    north: float
    flattening: float
    west: float
    east: float


@cache
def find_zone(crs: str) -> Zone | None:
    """Return the UTM zone of a CRS; None for other CRSs."""
    found = _EPSG.fullmatch(crs)
    code = int(found[1]) if found else 0
    if code == 3067:
        return Zone(27.0, 0.0, _GRS80_F, 19.08, 31.59)
    hundred, number = divmod(code, 100)
    if not (hundred in (326, 327) and 1 <= number <= 60) and not (hundred == 258 and 28 <= number <= 38):
        return None
    middle = 6.0 * number - 183.0
    is_south = hundred == 327
    flattening = _GRS80_F if hundred == 258 else _WGS84_F
    return Zone(middle, 1e7 * is_south, flattening, middle - 3.0, middle + 3.0)


def _project_to_zone(lonlat: FloatArray, zone: Zone) -> FloatArray:
    """Convert degrees (points, 2) to metres; infinite on the far half of the globe, where the series are invalid."""
    east = np.radians((lonlat[:, 0] - zone.middle + 180.0) % 360.0 - 180.0)
    sine, cosine = compute_sine_cosine(np.radians(lonlat[:, 1]))
    conformal = _compute_conformal(sine / cosine, _compute_eccentricity(zone.flattening))
    sine_east, cosine_east = compute_sine_cosine(east)
    size = compute_length(conformal, cosine_east)
    across = sine_east / size
    radius, forth, _ = _compute_series(zone.flattening)
    up, right = _sum_sine_series(forth, conformal / size, cosine_east / size, across)
    y = compute_polar_angle(conformal, cosine_east) + up
    x = inverse_hyperbolic_sine(across) + right
    xy = _K0 * radius * np.column_stack((x, y)) + (_EAST, zone.north)
    xy[(np.abs(lonlat[:, 1]) > 90.0) | ~(np.abs(east) < np.pi / 2.0)] = np.inf
    return xy


def _project_from_zone(xy: FloatArray, zone: Zone) -> FloatArray:
    """Convert metres (points, 2) to degrees; infinite where no place on Earth has them."""
    radius, _, back = _compute_series(zone.flattening)
    x, y = ((xy - (_EAST, zone.north)) / (_K0 * radius)).T
    up, right = _sum_sine_series(back, *compute_sine_cosine(y), compute_hyperbolic_sine(x))
    across = compute_hyperbolic_sine(x - right)
    sine, cosine = compute_sine_cosine(y - up)
    wanted = sine / compute_length(across, cosine)
    e = _compute_eccentricity(zone.flattening)
    tangent = wanted
    for _ in range(_ROUNDS):  # Karney 2011, equations 19 to 21
        found = _compute_conformal(tangent, e)
        slope = (
            (1.0 - e**2) * compute_length(1.0, found) * compute_length(1.0, tangent) / (1.0 + (1.0 - e**2) * tangent**2)
        )
        tangent = tangent + (wanted - found) / slope
    longitude = zone.middle + np.degrees(compute_polar_angle(across, cosine))
    latitude = np.degrees(compute_polar_angle(tangent, np.ones_like(tangent)))
    lonlat = np.column_stack(((longitude + 180.0) % 360.0 - 180.0, latitude))
    lonlat[~((np.abs(y) <= np.pi / 2.0) & (np.abs(x) < np.pi / 2.0))] = np.inf
    return lonlat


def _sum_sine_series(
    coefficients: list[float], sine: FloatArray, cosine: FloatArray, hyperbolic: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the real and imaginary parts of a series of sines of even multiples of a complex angle, by Clenshaw.

    Args:
        coefficients: of twice the angle, four times the angle, …
        sine: of its real part.
        cosine: of its real part.
        hyperbolic: the hyperbolic sine of its imaginary part.
    """
    sine_2 = 2.0 * sine * cosine
    cosine_2 = (cosine - sine) * (cosine + sine)
    sinh_2 = 2.0 * hyperbolic * compute_length(1.0, hyperbolic)
    cosh_2 = 1.0 + 2.0 * hyperbolic**2
    turn = 2.0 * cosine_2 * cosh_2, -2.0 * sine_2 * sinh_2
    real = after_real = np.zeros_like(sine)
    imaginary = after_imaginary = np.zeros_like(sine)
    for one in reversed(coefficients):
        next_real = one + turn[0] * real - turn[1] * imaginary - after_real
        next_imaginary = turn[0] * imaginary + turn[1] * real - after_imaginary
        real, after_real = next_real, real
        imaginary, after_imaginary = next_imaginary, imaginary
    upright = sine_2 * cosh_2, cosine_2 * sinh_2
    return real * upright[0] - imaginary * upright[1], real * upright[1] + imaginary * upright[0]


def _compute_conformal(tangent: FloatArray, e: float) -> FloatArray:
    """Convert tangents of latitudes to tangents of conformal latitudes (Karney 2011, equations 7 to 9)."""
    secant = compute_length(1.0, tangent)
    sigma = compute_hyperbolic_sine(e * inverse_hyperbolic_tangent(e * tangent / secant))
    return tangent * compute_length(1.0, sigma) - sigma * secant


def _compute_eccentricity(flattening: float) -> float:
    return float(np.sqrt(flattening * (2.0 - flattening)))


@cache
def _compute_series(flattening: float) -> tuple[float, list[float], list[float]]:
    """Return the radius of the rectifying sphere, and the series coefficients in both directions."""
    n = flattening / (2.0 - flattening)
    powers = [*accumulate(repeat(n, 6), mul)]
    radius = _A / (1.0 + n) * (1.0 + powers[1] / 4.0 + powers[3] / 64.0 + powers[5] / 256.0)
    forth, back = ([sum(map(mul, row, powers)) for row in table] for table in (_FORTH, _BACK))
    return radius, forth, back


# -- other CRSs ---------------------------------------------------------------------------------------------------


@lru_cache(maxsize=32)
def _make_transformer(source: object, target: object) -> Any:
    """Return the transformation that PROJ ranks first.

    One transformation for all places: PROJ itself may choose another for the inverse, with errors up to 150 m.
    """
    pyproj = _import_pyproj()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # a better correction grid exists, but is not installed
            found = pyproj.transformer.TransformerGroup(source, target, always_xy=True).transformers
    except pyproj.exceptions.ProjError as error:
        raise BadValue(
            f"Cannot transform from {shown(source)} to {shown(target)}: {error}. Give a CRS such as 'EPSG:32635'."
        ) from error
    if not found:
        raise BadValue(f"Cannot transform from {shown(source)} to {shown(target)}. Give a CRS such as 'EPSG:32635'.")
    return found[0]


def _import_pyproj() -> Any:
    with require_extra("Projecting coordinates to other than UTM zones", "osm"):
        import pyproj
    return pyproj


# -- elementary functions, with the same bits on every machine ---------------------------------------------------------

# The sines of NumPy are those of the processor or the C library, which differ in the last digit. Those here consist of
# sums, products, quotients and square roots, which IEEE 754 rounds the same everywhere. The coefficients are those of
# FDLIBM (Sun Microsystems, 1993) and of Taylor series; errors are below 1e-15 of the result.

_HALF_PI = (1.57079632673412561417, 6.07710050650619224932e-11)  # the first 33 bits, whose multiples are exact
_LOG_2 = (6.93147180369123816490e-01, 1.90821492927058770002e-10)
_TAN_PI_8 = 0.41421356237309503
_ROOT_HALF = 0.7071067811865476
_SINE = (
    *(-1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04),
    *(2.75573137070700676789e-06, -2.50507602534068634195e-08, 1.58969099521155010221e-10),
)
_COSINE = (
    *(4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05),
    *(-2.75573143513906633035e-07, 2.08757232129817482790e-09, -1.13596475577881948265e-11),
)
_ARCTANGENT = (
    *(3.33333333333329318027e-01, -1.99999999998764832476e-01, 1.42857142725034663711e-01),
    *(-1.11111104054623557880e-01, 9.09088713343650656196e-02, -7.69187620504482999495e-02),
    *(6.66107313738753120669e-02, -5.83357013379057348645e-02, 4.97687799461593236017e-02),
    *(-3.65315727442169155270e-02, 1.62858201153657823623e-02),
)
_LOGARITHM = (
    *(6.666666666666735130e-01, 3.999999999940941908e-01, 2.857142874366239149e-01, 2.222219843214978396e-01),
    *(1.818357216161805012e-01, 1.531383769920937332e-01, 1.479819860511658591e-01),
)
_HYPERBOLIC_SINE = tuple(1.0 / factorial(power) for power in range(1, 25, 2))
_HYPERBOLIC_ARCTANGENT = tuple(1.0 / power for power in range(1, 21, 2))


def evaluate_polynomial(coefficients: Sequence[float], x: FloatArray) -> FloatArray:
    """Return the sum of the coefficients times the powers of `x` from 0 on."""
    total = np.full_like(x, coefficients[-1])
    for one in coefficients[-2::-1]:
        total = total * x + one
    return total


def compute_length(x: FloatArray | float, y: FloatArray) -> FloatArray:
    """Return the lengths of vectors."""
    return np.asarray(np.sqrt(x * x + y * y))


def compute_sine_cosine(angle: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the sines and cosines of angles of a few turns at most, radians."""
    quarters = np.rint(angle * (2.0 / pi))
    rest = angle - quarters * _HALF_PI[0] - quarters * _HALF_PI[1]
    square = rest * rest
    sine = rest + rest * square * evaluate_polynomial(_SINE, square)
    cosine = 1.0 - (0.5 * square - square * square * evaluate_polynomial(_COSINE, square))
    quadrant = quarters % 4.0
    is_across = quarters % 2.0 == 1.0
    upright = np.where(is_across, cosine, sine)
    level = np.where(is_across, sine, cosine)
    return np.where(quadrant >= 2.0, -upright, upright), np.where(np.abs(quadrant - 1.5) < 1.0, -level, level)


def compute_polar_angle(y: FloatArray, x: FloatArray) -> FloatArray:
    """Return the angles of vectors from the x axis, as `numpy.arctan2`."""
    across = np.abs(x)
    up = np.abs(y)
    larger = np.maximum(across, up)
    slope = np.divide(np.minimum(across, up), larger, out=np.zeros_like(larger), where=larger != 0.0)
    is_wide = slope > _TAN_PI_8
    tangent = np.where(is_wide, (slope - 1.0) / (slope + 1.0), slope)
    square = tangent * tangent
    angle = tangent - tangent * square * evaluate_polynomial(_ARCTANGENT, square)
    angle = np.where(is_wide, angle + pi / 4.0, angle)
    angle = np.where(up > across, pi / 2.0 - angle, angle)
    angle = np.where(x < 0.0, pi - angle, angle)
    return np.asarray(np.copysign(angle, y))


def compute_hyperbolic_sine(x: FloatArray) -> FloatArray:
    """Return hyperbolic sines of numbers from -2 to 2."""
    return x * evaluate_polynomial(_HYPERBOLIC_SINE, x * x)


def inverse_hyperbolic_sine(x: FloatArray) -> FloatArray:
    """Return the numbers with these hyperbolic sines."""
    size = np.abs(x)
    excess = size + size * size / (1.0 + np.sqrt(1.0 + size * size))
    whole = 1.0 + excess
    lost = np.divide(excess, whole - 1.0, out=np.ones_like(excess), where=whole != 1.0)  # by rounding
    logarithm = np.where(whole == 1.0, excess, _compute_logarithm(whole) * lost)
    return np.asarray(np.copysign(logarithm, x))


def inverse_hyperbolic_tangent(x: FloatArray) -> FloatArray:
    """Return the numbers with these hyperbolic tangents, from -0.1 to 0.1."""
    return x * evaluate_polynomial(_HYPERBOLIC_ARCTANGENT, x * x)


def _compute_logarithm(x: FloatArray) -> FloatArray:
    mantissa, exponent = np.frexp(x)
    is_low = mantissa < _ROOT_HALF
    twos = exponent - np.where(is_low, 1.0, 0.0)
    above = np.where(is_low, 2.0 * mantissa, mantissa) - 1.0
    share = above / (2.0 + above)
    square = share * share
    half = 0.5 * above * above
    rest = share * (half + square * evaluate_polynomial(_LOGARITHM, square)) + twos * _LOG_2[1]
    return np.asarray(twos * _LOG_2[0] - ((half - rest) - above))
