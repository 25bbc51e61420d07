"""Read the lines of a GeoJSON file (RFC 7946) as roads that join where they have equal coordinates."""

import json
import math
import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from gamms.errors import BadFile
from gamms.limits import refuse_above
from gamms.osm.files import as_file
from gamms.osm.network import offsets_of
from gamms.osm.servers import Json
from gamms.osm.ways import Ways, is_against, is_one_way

_MEMORY_PER_BYTE = 10  # that Python needs for what it reads
_MOST_LEVELS = 32  # of geometry collections inside geometry collections
_LINES = {"LineString", "MultiLineString"}
_NO_TAGS = frozenset(("id", "linestring", "geometry", "length", "reversed"))  # names of our own
_WGS84 = ("CRS84", "EPSG::4326", "EPSG:4326")  # how files from before RFC 7946 name the only CRS there is now
_WAY_OUT = "Give a GeoJSON file with LineString or MultiLineString geometries in longitude and latitude."


@dataclass(slots=True)
class _Lines:
    """Lines while they are being read."""

    file: Path
    points: list[list[tuple[float, float]]] = field(default_factory=list)
    against: list[bool] = field(default_factory=list)
    tags: list[dict[str, Any]] = field(default_factory=list)

    def add(self, coordinates: Json, feature: Mapping[str, Any], number: int) -> None:
        properties = feature.get("properties") or {}
        if not isinstance(coordinates, list) or not isinstance(properties, dict):
            _refuse(self.file, f"feature {number} has no list of coordinates, or properties that are no object")
        self.points.append([_position(self.file, place, number) for place in coordinates])
        self.against.append(is_against(_hashable(properties.get("oneway"))))
        self.tags.append(_tags(properties, feature.get("id"), number))

    def ways(self, attribution: str | None) -> Ways:
        lonlat = np.array([place for line in self.points for place in line], np.float64).reshape(-1, 2)
        places, refs = np.unique(lonlat @ (1.0, 1.0j), return_inverse=True)
        offsets = offsets_of(np.array([len(line) for line in self.points], np.int64))
        lonlat = np.column_stack((places.real, places.imag))[refs]
        return Ways(offsets, refs.astype(np.int64), lonlat, np.array(self.against, np.bool_), self.tags, attribution)


def read_lines(file: Path) -> Ways:
    """Return the lines of a GeoJSON file, in its order; points and polygons are passed over.

    Raises:
        BadFile: it is no GeoJSON, damaged, too large, without lines, or not in degrees.
    """
    document = _document(file)
    named = (document.get("crs") or {}) if isinstance(document.get("crs") or {}, dict) else {"": document["crs"]}
    if named and not json.dumps(named).rstrip('"} ').endswith(_WGS84):
        _refuse(file, f"its crs is {json.dumps(named)[:80]}, and GeoJSON is in WGS 84. Convert it first")
    lines = _Lines(file)
    for number, feature in enumerate(_features(file, document), 1):
        for coordinates in _line_coordinates(file, feature.get("geometry"), number):
            lines.add(coordinates, feature, number)
    if not lines.points:
        _refuse(file, "it has no lines")
    credits = (document.get(name) for name in ("attribution", "copyright"))
    return lines.ways(next((text for text in credits if isinstance(text, str)), None))


def is_geojson(filepath: str | os.PathLike[str]) -> bool:
    """Return whether a file begins as a JSON object does.

    Raises:
        FileNotFoundError, IsADirectoryError: there is no such file.
    """
    with as_file(filepath).open("rb") as stream:
        return stream.read(64).removeprefix(b"\xef\xbb\xbf").lstrip().startswith(b"{")


def _document(file: Path) -> dict[str, Any]:
    refuse_above(_MEMORY_PER_BYTE * file.stat().st_size, f"reading {str(file)!r}")
    try:
        document = json.loads(file.read_text(encoding="utf-8-sig"), parse_constant=_no_number)
    except (ValueError, RecursionError, MemoryError) as error:
        _refuse(file, f"it is no JSON ({str(error)[:100]})")
    if not isinstance(document, dict):
        _refuse(file, f"it holds {type(document).__name__}, not an object")
    return document


def _no_number(text: str) -> NoReturn:
    raise ValueError(f"{text} is no number")


def _features(file: Path, document: dict[str, Any]) -> Iterator[dict[str, Any]]:
    kind = document.get("type")
    if kind == "Feature":
        yield document
    elif kind != "FeatureCollection":
        yield {"geometry": document}
    else:
        features = document.get("features")
        if not isinstance(features, list):
            _refuse(file, "its features are no list")
        for number, feature in enumerate(features, 1):
            if not isinstance(feature, dict):
                _refuse(file, f"feature {number} is no object")
            yield feature


def _line_coordinates(file: Path, geometry: Json, number: int, level: int = 0) -> Iterator[Any]:
    if geometry is None:  # a feature without a place
        return
    kind = geometry.get("type") if isinstance(geometry, dict) else None
    if not isinstance(kind, str) or level > _MOST_LEVELS:
        _refuse(file, f"the geometry of feature {number} has no type, or is nested too deep")
    parts = geometry.get("geometries" if kind == "GeometryCollection" else "coordinates")
    if kind == "LineString":
        yield parts
    elif kind in ("MultiLineString", "GeometryCollection"):
        if not isinstance(parts, list):
            _refuse(file, f"the {kind} of feature {number} is no list")
        for part in parts:
            if kind == "MultiLineString":
                yield part
            else:
                yield from _line_coordinates(file, part, number, level + 1)


def _position(file: Path, place: Json, number: int) -> tuple[float, float]:
    try:
        lon, lat = (_degrees(value) for value in place[:2])
    except (TypeError, ValueError, OverflowError, KeyError):
        lon = lat = math.nan
    if not (-180.0 <= lon <= 180.0 and -90.0 <= lat <= 90.0):
        shown = json.dumps(place)[:60]
        _refuse(file, f"feature {number} has the position {shown}, which is no longitude and latitude in degrees")
    return lon, lat


def _degrees(value: Json) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise TypeError
    return float(value)


def _tags(properties: Mapping[str, Any], id: Json, number: int) -> dict[str, Any]:
    """Return the properties of a feature, and what every road has: `osmid` and `oneway`."""
    kept = {name: value for name, value in properties.items() if name not in _NO_TAGS and value is not None}
    oneway, junction = (_hashable(properties.get(name)) for name in ("oneway", "junction"))
    return {
        "osmid": _osmid(number, properties.get("osmid"), properties.get("@id"), id),
        **{name: value for name, value in kept.items() if name != "osmid"},
        "oneway": is_one_way(oneway, junction),
    }


def _osmid(number: int, *given: Json) -> int:
    """Return the first of the given ids that has a number in it, such as way/123; else the number of the feature."""
    for id in given:
        match = re.fullmatch(r"(?:way/)?(-?\d{1,18})", str(id), re.ASCII)
        if match:
            return int(match[1])
    return number


def _hashable(value: Json) -> str | int | None:
    return value if isinstance(value, (str, bool, int)) else None


def _refuse(file: Path, why: str) -> NoReturn:
    raise BadFile(f"{str(file)!r} cannot be used: {why}. {_WAY_OUT}")
