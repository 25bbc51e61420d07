"""Read the lines of a GeoJSON file (RFC 7946) as roads that join where they have equal coordinates."""

import os
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np
from msgspec import Meta

from gamms.errors import BadFile
from gamms.limits import refuse_above
from gamms.osm.network import Rule, Ways, is_against, is_one_way, offsets_of
from gamms.osm.osmium_reader import as_file
from gamms.progress import Show

_MEMORY_PER_BYTE = 10  # that Python needs for what it reads
_MOST_LEVELS = 32  # of geometry collections inside geometry collections
_NO_TAGS = frozenset(("id", "osmid", "linestring", "geometry", "length", "reversed"))  # names of our own
_WGS84 = ("CRS84", "EPSG::4326", "EPSG:4326")  # how files from before RFC 7946 name the only CRS there is now
_WAY_OUT = "Give a GeoJSON file with LineString or MultiLineString geometries in longitude and latitude."
_ID = re.compile(r"(?:way/)?(-?\d{1,18})", re.ASCII)
_Line = list[Annotated[list[float], Meta(min_length=2)]]


class _Object(msgspec.Struct):
    """A document, a feature or a geometry of any kind; coordinates are looked at where they are those of lines."""

    type: str = ""
    features: "list[_Object]" = []
    geometry: "_Object | None" = None
    geometries: "list[_Object] | None" = None
    coordinates: Any = None
    properties: dict[str, Any] | None = None
    id: Any = None
    crs: Any = None
    attribution: Any = None
    copyright: Any = None


def read_lines(file: Path, show: Show, _rule: Rule | None = None, _tags: Sequence[str] = ()) -> Ways:
    """Return the lines of a GeoJSON file, in its order; points and polygons are passed over.

    Raises:
        BadFile: it is no GeoJSON, damaged, too large, without lines, or not in degrees.
    """
    show(f"Reading {file.name}")
    refuse_above(_MEMORY_PER_BYTE * file.stat().st_size, f"reading {str(file)!r}")
    try:
        return _ways(file.read_bytes().removeprefix(b"\xef\xbb\xbf"))
    except (ValueError, RecursionError, MemoryError, msgspec.MsgspecError) as error:
        raise BadFile(f"{str(file)!r} cannot be used: {str(error)[:200]}. {_WAY_OUT}") from None


def is_geojson(filepath: str | os.PathLike[str]) -> bool:
    """Return whether a file begins as a JSON object does.

    Raises:
        FileNotFoundError, IsADirectoryError: there is no such file.
    """
    with as_file(filepath).open("rb") as stream:
        return stream.read(64).removeprefix(b"\xef\xbb\xbf").lstrip().startswith(b"{")


def _ways(text: bytes) -> Ways:
    document = msgspec.json.decode(text, type=_Object)
    if document.crs and not msgspec.json.encode(document.crs).decode().rstrip('"} ').endswith(_WGS84):
        raise ValueError(f"its crs is {str(document.crs)[:80]}, and GeoJSON is in WGS 84. Convert it first")
    features = [document if document.type == "Feature" else _Object(geometry=document)]
    if document.type == "FeatureCollection":
        features = document.features
    lines, tags, against = [], [], []
    for number, feature in enumerate(features, 1):
        for line in _lines_of(feature.geometry):
            try:
                lines.append(_lonlat(msgspec.convert(line, _Line)))
            except ValueError as error:
                raise ValueError(f"feature {number} has a line that is none: {error}") from None
            tags.append(_tags(feature, number))
            against.append(is_against((feature.properties or {}).get("oneway")))
    if not lines:
        raise ValueError("it has no lines")
    lonlat = np.concatenate(lines)
    places, refs = np.unique(lonlat @ (1.0, 1.0j), return_inverse=True)
    offsets = offsets_of(np.array([len(line) for line in lines], np.int64))
    credit = next((text for text in (document.attribution, document.copyright) if isinstance(text, str)), None)
    lonlat = np.column_stack((places.real, places.imag))[refs]
    return Ways(offsets, refs.astype(np.int64), lonlat, np.array(against, np.bool_), tags, credit, nodes=None)


def _lines_of(geometry: _Object | None, level: int = 0) -> Iterator[Any]:
    """Yield the coordinates of the lines in a geometry."""
    if geometry is None:  # a feature without a place
        return
    if level > _MOST_LEVELS or not geometry.type:
        raise ValueError("a geometry has no type, or is nested too deep")
    if geometry.type == "LineString":
        yield geometry.coordinates
    elif geometry.type == "MultiLineString":
        yield from msgspec.convert(geometry.coordinates, list[Any])
    elif geometry.type == "GeometryCollection":
        for part in msgspec.convert(geometry.geometries, list[_Object]):
            yield from _lines_of(part, level + 1)


def _lonlat(line: list[list[float]]) -> "np.ndarray[Any, np.dtype[np.float64]]":
    lonlat = np.array([place[:2] for place in line], np.float64).reshape(-1, 2)
    outside = (np.abs(lonlat) > (180.0, 90.0)).any(axis=1)
    if outside.any():
        raise ValueError(f"the position {line[outside.argmax()]} is no longitude and latitude in degrees")
    return lonlat


def _tags(feature: _Object, number: int) -> dict[str, Any]:
    """Return the properties of a feature, and as `osmid` the first of its ids with a number in it, such as way/123."""
    given = feature.properties or {}
    kept = {name: value for name, value in given.items() if name not in _NO_TAGS and value is not None}
    ids = (str(id) for id in (given.get("osmid"), given.get("@id"), feature.id))
    found = next((match for id in ids if (match := _ID.fullmatch(id))), None)
    oneway = is_one_way(given.get("oneway"), given.get("junction"))
    return {"osmid": number if found is None else int(found[1]), **kept, "oneway": oneway}
