"""Read the lines of a GeoJSON file (RFC 7946) as roads that join at equal coordinates."""

import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np
from msgspec import Meta

from gamms.errors import BadFile
from gamms.ir.geometry import NearLines, find_nearest_point
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.projection import WGS84, find_utm_crs, project
from gamms.limits import refuse_above
from gamms.osm.network import OsmRoads, Rule, add_signs, compute_offsets, find_components
from gamms.osm.objects import LEAST_NODES, is_against, is_one_way, normalize_tags, read_edge_values
from gamms.osm.osmium_reader import as_file
from gamms.plain import describe_flaw
from gamms.progress import Show
from gamms.text import shown

_MEMORY_PER_BYTE = 16  # memory for each byte of a file, measured
_MOST_LEVELS = 32  # of nested geometry collections
_NO_TAGS = frozenset(("id", "osmid", "linestring", "geometry", "length", "reversed"))  # our own names
_WGS84 = ("CRS84", "EPSG::4326", "EPSG:4326")  # names of WGS 84 in files older than RFC 7946
_WAY_OUT = "Give a GeoJSON file with LineString or MultiLineString geometries in longitude and latitude."
_EAST = 180.0  # degrees
_OVERTURE = "roads of Overture Maps, whose speeds, directions, access and connectors are not read yet"
_NAV2 = "edges of a route graph of Nav2, whose frame, in meters, and directions are not read yet"
_FOREIGN = {
    **dict.fromkeys(("connectors", "access_restrictions", "speed_limits", "prohibited_transitions"), _OVERTURE),
    **dict.fromkeys(("startid", "endid"), _NAV2),
}  # properties of other formats -> the format
_ID = re.compile(r"(?:way/)?(-?\d{1,18})", re.ASCII)
_Line = list[Annotated[list[float], Meta(min_length=2)]]


class _GeoJsonObject(msgspec.Struct):
    """A document, a feature or a geometry of any kind; only the coordinates of lines are checked."""

    type: str = ""
    features: "list[_GeoJsonObject]" = []
    geometry: "_GeoJsonObject | None" = None
    geometries: "list[_GeoJsonObject] | None" = None
    coordinates: Any = None
    properties: dict[str, Any] | None = None
    id: Any = None
    crs: Any = None
    elements: Any = None  # of an answer of Overpass, which is no GeoJSON
    remark: Any = None
    attribution: Any = None
    copyright: Any = None


def read_lines(
    file: Path, show: Show, _rule: Rule | None = None, _tags: Sequence[str] = (), *, snap: float = 0.0
) -> OsmRoads:
    """Return the lines of a GeoJSON file, in its order; ignore points and polygons.

    Ends of lines join other lines that are at most `snap` meters away.

    Raises:
        BadFile: the file is not GeoJSON, is damaged, too large, without lines, not in degrees, or of another format.
    """
    show(f"Reading {file.name}")
    refuse_above(_MEMORY_PER_BYTE * file.stat().st_size, f"reading {str(file)!r}")
    try:
        ways = _read_ways(file.read_bytes().removeprefix(b"\xef\xbb\xbf"))
        return snap_ends(ways, snap) if snap else ways
    except (ValueError, RecursionError, MemoryError, msgspec.MsgspecError) as error:
        raise BadFile(f"{str(file)!r} cannot be used: {str(error)[:250]}. {_WAY_OUT}") from None


def is_geojson(filepath: str | os.PathLike[str]) -> bool:
    """Return whether a file begins like a JSON object, so that `graph_from_geojson` may read it.

    Raises:
        FileNotFoundError, IsADirectoryError: the file does not exist.
    """
    with as_file(filepath).open("rb") as stream:
        return stream.read(64).removeprefix(b"\xef\xbb\xbf").lstrip().startswith(b"{")


def _read_ways(text: bytes) -> OsmRoads:
    document = msgspec.json.decode(text, type=_GeoJsonObject)
    if document.crs and not msgspec.json.encode(document.crs).decode().rstrip('"} ').endswith(_WGS84):
        raise ValueError(f"its crs is {str(document.crs)[:80]}, and GeoJSON is in WGS 84. Convert it first")
    if document.elements is not None:
        said = f"; the server reports {shown(document.remark)}" if document.remark else ""
        raise ValueError(f"it is an answer of Overpass in its own JSON{said}. Ask for XML ([out:xml])")
    features = [document if document.type == "Feature" else _GeoJsonObject(geometry=document)]
    if document.type == "FeatureCollection":
        features = document.features
    lines = []
    tags = []
    against = []
    for number, feature in enumerate(features, 1):
        if mark := next((name for name in _FOREIGN if name in (feature.properties or {})), None):
            raise ValueError(f"feature {number} has {mark!r}: these are {_FOREIGN[mark]}. Convert it first")
        oneway = normalize_tags(feature.properties or {}).get("oneway")
        for line in _list_lines(feature.geometry):
            try:
                lonlat = _read_lonlat(msgspec.convert(line, _Line))
            except ValueError as error:
                raise ValueError(f"feature {number} has an invalid line: {error}") from None
            if len(lonlat) < LEAST_NODES:
                continue
            lines.append(lonlat)
            tags.append(_read_tags(feature, number))
            against.append(is_against(oneway))
    if not lines:
        raise ValueError("it has no lines; only LineString and MultiLineString are roads")
    lonlat = np.concatenate(lines)
    places, refs = np.unique(lonlat @ (1.0, 1.0j), return_inverse=True)
    offsets = compute_offsets(np.array([len(line) for line in lines], np.int64))
    credit = next((text for text in (document.attribution, document.copyright) if isinstance(text, str)), None)
    lonlat = np.column_stack((places.real, places.imag))[refs]
    return OsmRoads(offsets, refs.astype(np.int64), lonlat, np.array(against, np.bool_), tags, credit, nodes=None)


def _list_lines(geometry: _GeoJsonObject | None, level: int = 0) -> Iterator[Any]:
    """Yield the coordinates of the lines in a geometry."""
    if geometry is None:  # a feature without a geometry
        return
    if level > _MOST_LEVELS or not geometry.type:
        raise ValueError("a geometry has no type, or is nested too deep")
    if geometry.type == "LineString":
        yield geometry.coordinates
    elif geometry.type == "MultiLineString":
        yield from msgspec.convert(geometry.coordinates, list[Any])
    elif geometry.type == "GeometryCollection":
        for part in msgspec.convert(geometry.geometries, list[_GeoJsonObject]):
            yield from _list_lines(part, level + 1)


def _read_lonlat(line: list[list[float]]) -> "np.ndarray[Any, np.dtype[np.float64]]":
    lonlat = np.array([place[:2] for place in line], np.float64).reshape(-1, 2)
    outside = (np.abs(lonlat) > (180.0, 90.0)).any(axis=1)
    if outside.any():
        raise ValueError(f"the position {line[outside.argmax()]} is not a longitude and latitude in degrees")
    lonlat[lonlat[:, 0] == -_EAST, 0] = _EAST  # one meridian: lines across it are cut there (RFC 7946, 3.1.9)
    return lonlat


def _read_tags(feature: _GeoJsonObject, number: int) -> dict[str, Any]:
    """Return the properties of a feature; `osmid` is the first id with a number in it, such as way/123."""
    given = feature.properties or {}
    kept = {name: value for name, value in given.items() if name not in _NO_TAGS and value is not None}
    for name, value in kept.items():
        if flaw := describe_flaw(value):
            raise ValueError(f"the property {shown(name)} of feature {number}{flaw}")
    ids = (str(id) for id in (given.get("osmid"), given.get("@id"), feature.id))
    found = next((match for id in ids if (match := _ID.fullmatch(id))), None)
    plain = normalize_tags(given)
    oneway = plain.get("oneway")
    tags = {"osmid": number if found is None else int(found[1]), **kept}
    tags["oneway"] = is_one_way(oneway, plain.get("junction"))
    tags = read_edge_values(tags, f"feature {number}")
    return add_signs(tags, kept, against=is_against(oneway))


# -- lines that nearly meet ---------------------------------------------------------------------------------------

_AT_ONCE = 64  # ends of lines
_MOST_NEAR = 1_000  # lines around an end, on average
_FEW_NEAR = 1_000_000


def snap_ends(ways: OsmRoads, metres: float) -> OsmRoads:
    """Return lines whose ends are joined to the nearest other line, if it is at most `metres` away.

    An end joins a near vertex of that line, or else becomes a new vertex of it. Crossing lines stay apart, because one
    may be a bridge.

    Raises:
        ValueError: joining would take hours, because very many lines are near each other.
    """
    xy = project(ways.lonlat, WGS84, find_utm_crs(ways.lonlat))
    lines = [slice(a, b) for a, b in pairwise(ways.offsets.tolist())]
    counts = np.bincount(ways.refs)
    whole = [line for line, rows in enumerate(lines) if rows.stop - rows.start > 1]
    open_ends: list[tuple[int, int]] = []
    for line in whole:
        ends = (lines[line].start, lines[line].stop - 1)
        open_ends += [(line, at) for at in ends if counts[ways.refs[at]] == 1]
    found = _find_nearest_lines({line: xy[lines[line]] for line in whole}, open_ends, xy, metres) if whole else {}
    joined = []  # places; line -> [(distance along it, place)]
    inserted = dict[int, list[tuple[float, int]]]()
    for (_, at), line in found.items():
        points = xy[lines[line]]
        off = np.hypot(*(points - xy[at]).T)
        vertex = int(off.argmin())
        if off[vertex] <= metres:
            joined.append((ways.refs[at], ways.refs[lines[line].start + vertex]))
        else:
            inserted.setdefault(line, []).append((find_nearest_point(points, (xy[at, 0], xy[at, 1]))[0], at))
    pairs = np.array(joined, np.int64).reshape(-1, 2)
    label = find_components(pairs[:, 0], pairs[:, 1], len(counts))
    order = _insert_places(xy, lines, inserted)
    refs = label[ways.refs][order]
    lonlat = ways.lonlat[np.unique(ways.refs, return_index=True)[1]][refs]
    sizes = np.diff(ways.offsets) + np.array([len(inserted.get(line, ())) for line in range(len(lines))])
    return replace(ways, offsets=compute_offsets(sizes), refs=refs, lonlat=lonlat)


def _find_nearest_lines(
    lines: dict[int, FloatArray], ends: list[tuple[int, int]], xy: FloatArray, metres: float
) -> dict[tuple[int, int], int]:
    """Return (line, position) of an end -> the nearest other line within `metres`."""
    tree = NearLines([*lines.values()])
    numbers = np.array([*lines], np.int64)
    found: dict[tuple[int, int], int] = {}
    total = 0
    for first in range(0, len(ends), _AT_ONCE):
        part = ends[first : first + _AT_ONCE]
        rows, near, off = tree.find_within(xy[[at for _, at in part]], metres)
        others = numbers[near]
        total += len(rows)
        if total > _FEW_NEAR + _MOST_NEAR * (first + len(part)):
            raise ValueError(
                f"too many lines are within {metres:g} m of each other; use a smaller snap, or fewer lines"
            )
        is_other = np.flatnonzero(others != np.array([line for line, _ in part])[rows])
        for pair in is_other[np.argsort(-off[is_other], kind="stable")].tolist():
            found[part[rows[pair]]] = int(others[pair])  # the last one is the nearest
    return found


def _insert_places(xy: FloatArray, lines: list[slice], inserted: dict[int, list[tuple[float, int]]]) -> IntArray:
    """Return the rows of the points of all lines, line by line, with `inserted` ones at their shares of the lengths.

    Args:
        xy: (points, 2)
        lines: the rows of each line.
        inserted: number of a line -> (share of its length, row) of each inserted point.
    """
    order: list[int] = []
    for line, rows in enumerate(lines):
        own = list(range(rows.start, rows.stop))
        if line in inserted:
            gone = np.append(0.0, np.hypot(*np.diff(xy[rows], axis=0).T).cumsum())
            places = [*zip((gone / (gone[-1] or 1.0)).tolist(), own, strict=True), *inserted[line]]
            own = [at for _, at in sorted(places, key=lambda place: place[0])]
        order.extend(own)
    return np.array(order, np.int64)
