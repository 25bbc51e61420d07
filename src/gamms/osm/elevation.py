"""Heights of the ground from files of the Shuttle Radar Topography Mission (.hgt), and slopes of roads.

A file covers one degree by one degree and is named after its south-western corner, such as N60E024.hgt: rows from north
to south of 1201 (SRTM3) or 3601 (SRTM1) big-endian 16-bit numbers, meters above sea level, -32768 where unknown (USGS,
"SRTM Topography", 2015). decisions/0039 explains how heights affect walking times and sight lines.
"""

import os
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gamms.arguments import as_path
from gamms.errors import BadFile, BadType, BadValue
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.ir.projection import WGS84, parse_crs, project
from gamms.osm.network import RoadNetwork, find_components
from gamms.osm.networkx_bridge import compute_grades
from gamms.osm.objects import split_words
from gamms.text import shown

if TYPE_CHECKING:
    import networkx as nx

_NAME = re.compile(r"([NS])(\d{2})([EW])(\d{3})(?:\.SRTMGL[13])?\.hgt", re.IGNORECASE)
_ENDINGS = (".hgt", ".SRTMGL1.hgt", ".SRTMGL3.hgt", ".HGT")
_POSTS = {2 * posts * posts: posts for posts in (1201, 3601)}  # bytes of a file -> posts along a side
_VOID = -32768
_REACH = 16  # posts: reach for filling a void from its rim
_MOST_ROUNDS = 2000  # exact for tunnels of so many nodes; longer ones get the height of the ground in their middle
_AT_GROUND = ("no", "building_passage")
_WAY_OUT = (
    "Give a .hgt file of SRTM (1201 x 1201 or 3601 x 3601 posts, named after its corner, such as N60E024.hgt), or a "
    "folder of them. GeoTIFF and .zip are not read: unpack, or convert by gdal_translate -of SRTMHGT."
)
ElevationPath = str | os.PathLike[str]


class Elevation:
    """The heights in a .hgt file, or in the files of a folder, each of which is read when it is needed.

    Args:
        path: the file or folder; the name of a file tells which degree it covers, such as N60E024.hgt.

    Raises:
        FileNotFoundError: the file or folder does not exist.
        BadFile: the file is not a .hgt file.
        BadType: the value is not a path.
    """

    def __init__(self, path: ElevationPath) -> None:
        self._path = as_path(path, "elevation")
        if not self._path.exists():
            raise FileNotFoundError(f"There is no file or folder {str(self._path)!r} of heights. {_WAY_OUT}")
        self._corner = None if self._path.is_dir() else _parse_corner(self._path)

    def heights(self, lonlat: FloatArray) -> FloatArray:
        """Return meters above sea level at points (points, 2) in degrees, interpolated bilinearly between posts.

        Unknown posts are left out; if all around a point are unknown, the nearest one within 16 posts counts.

        Raises:
            BadFile: a file is damaged.
            BadValue: a point is in no file, or in the middle of a void.
        """
        south_west = np.floor(lonlat).astype(np.int64)
        for row, axis in np.argwhere(lonlat == south_west).tolist():  # also in the last column or row of another file
            if self._find(*south_west[row].tolist()) is None:
                south_west[row, axis] -= 1
        heights = np.empty(len(lonlat))
        for corner in np.unique(south_west, axis=0):
            inside = (south_west == corner).all(axis=1)
            file = self._find(*corner.tolist())
            if file is None:
                name = _make_name(*np.floor(lonlat[inside][0]).astype(np.int64).tolist())
                place = lonlat[inside][0].tolist()
                raise BadValue(f"{str(self._path)!r} has no heights at {place}: {name}.hgt is needed. {_WAY_OUT}")
            heights[inside] = _interpolate(_read(file), lonlat[inside] - corner, file)
        return heights

    def _find(self, west: int, south: int) -> Path | None:
        """Return the file with this south-western corner, or None."""
        if self._corner is not None:
            return self._path if self._corner.tolist() == [west, south] else None
        files = (self._path / (_make_name(west, south) + ending) for ending in _ENDINGS)
        return next((file for file in files if file.is_file()), None)


def _make_name(west: int, south: int) -> str:
    return f"{'NS'[south < 0]}{abs(south):02d}{'EW'[west < 0]}{abs(west):03d}"


def as_elevation(value: object) -> Elevation | None:
    """Return the elevation for a value or a path; None for None."""
    return value if value is None or isinstance(value, Elevation) else Elevation(value)  # type: ignore[arg-type] # checked


def _parse_corner(file: Path) -> IntArray:
    """Return (west, south) from the name of a file."""
    match = _NAME.fullmatch(file.name)
    if match is None:
        raise BadFile(f"{str(file)!r} does not have the name of a height file. {_WAY_OUT}")
    south = int(match[2]) * (-1 if match[1] in "sS" else 1)
    return np.array((int(match[4]) * (-1 if match[3] in "wW" else 1), south))


def _read(file: Path) -> "np.ndarray[Any, np.dtype[np.int16]]":
    """Return the heights in a file (posts, posts), from south to north."""
    size = file.stat().st_size
    if size not in _POSTS:
        raise BadFile(f"{str(file)!r} has {size} bytes; a height file has {' or '.join(map(str, _POSTS))}. {_WAY_OUT}")
    return np.fromfile(file, ">i2").reshape(_POSTS[size], _POSTS[size])[::-1]


def _interpolate(posts: "np.ndarray[Any, np.dtype[np.int16]]", share: FloatArray, file: Path) -> FloatArray:
    """Return heights at points (points, 2), given as shares of the width and the height of a file."""
    at = share * (len(posts) - 1)
    low = np.minimum(at.astype(np.int64), len(posts) - 2)
    east, north = (at - low).T
    weights = np.stack([(1.0 - east) * (1.0 - north), east * (1.0 - north), (1.0 - east) * north, east * north])
    column, row = low.T
    corners = np.stack([posts[row, column], posts[row, column + 1], posts[row + 1, column], posts[row + 1, column + 1]])
    weights[corners == _VOID] = 0.0
    known = weights.sum(axis=0)
    found: FloatArray = (weights * corners).sum(axis=0) / np.where(known > 0.0, known, 1.0)
    for lost in np.flatnonzero(known <= 0.0).tolist():
        found[lost] = _find_nearest_known(posts, at[lost], file)
    return found


def _find_nearest_known(posts: "np.ndarray[Any, np.dtype[np.int16]]", at: FloatArray, file: Path) -> float:
    column, row = np.rint(at).astype(np.int64).tolist()
    west = max(column - _REACH, 0)
    south = max(row - _REACH, 0)
    around = posts[south : row + _REACH + 1, west : column + _REACH + 1]
    rows, columns = np.nonzero(around != _VOID)
    if not len(rows):
        raise BadValue(
            f"{str(file)!r} lacks heights around column {column}, row {row} from the south, over more than {_REACH} "
            "posts. Use a file without gaps."
        )
    nearest = np.hypot(rows + south - at[1], columns + west - at[0]).argmin()
    return float(around[rows[nearest], columns[nearest]])


# -- roads on the ground --------------------------------------------------------------------------------------------


def add_heights(network: RoadNetwork, elevation: Elevation, *, are_walked: tuple[bool, ...]) -> RoadNetwork:
    """Return a network whose nodes have heights; `are_walked` tells whether slopes affect the times of each mode.

    Raises: as `Elevation.heights`.
    """
    raised = np.array([_is_structure(tags) for tags in network.tags], np.bool_)[network.ways]
    ends = np.column_stack((network.sources, network.targets))
    z = _find_ground(network.xy, network.crs, elevation)
    return replace(network, z=_span_bridges(z, ends, network.lengths, raised), are_walked=are_walked)


def add_elevation(graph: "nx.Graph[Any]", elevation: "ElevationPath | Elevation") -> None:
    """Set the height `z` of nodes of a networkx graph, in meters above sea level, and the `grade` of its edges.

    The grade of an edge is its rise divided by its length. Travel times stay unchanged; the loaders' option `elevation`
    includes slopes in them.

    Args:
        graph: nodes have `x` and `y` in the CRS `graph.graph["crs"]`, edges a `length` in meters.
        elevation: a .hgt file, or a folder of them.

    Raises:
        FileNotFoundError, BadFile: the heights do not exist or are not valid.
        BadValue: the graph has no CRS, or a point has no height.
        BadType: an argument has a wrong type.
    """
    if not hasattr(graph, "is_directed"):
        raise BadType(f"graph must be a networkx graph, not {shown(graph)}. For a context: ctx.graph.to_networkx().")
    heights = elevation if isinstance(elevation, Elevation) else Elevation(elevation)
    crs = graph.graph.get("crs")
    if crs is None:
        raise BadValue("The graph has no CRS, so its location is unknown. Set graph.graph['crs'].")
    row_of = {node: row for row, node in enumerate(graph)}
    try:
        xy = np.array([(data["x"], data["y"]) for _, data in graph.nodes(data=True)], np.float64).reshape(-1, 2)
        lengths = np.array([data["length"] for *_, data in graph.edges(data=True)], np.float64)
    except (KeyError, TypeError, ValueError) as error:
        raise BadValue(f"Nodes need numbers x and y, and edges a length: {error!r}.") from None
    ends = np.array([(row_of[u], row_of[v]) for u, v in graph.edges()], np.int64).reshape(-1, 2)
    raised = np.array([_is_structure(data) for *_, data in graph.edges(data=True)], np.bool_)
    z = _span_bridges(_find_ground(xy, parse_crs(crs)[0], heights), ends, lengths, raised)
    for node, height in zip(graph, z.tolist(), strict=True):
        graph.nodes[node]["z"] = height
    for (*_, data), grade in zip(graph.edges(data=True), compute_grades(z, ends, lengths).tolist(), strict=True):
        data["grade"] = grade


def _is_structure(tags: Mapping[str, Any]) -> bool:
    """Return whether a road is on a bridge or in a tunnel."""
    return any(word not in _AT_GROUND for key in ("bridge", "tunnel") for word in split_words(tags.get(key)))


def _find_ground(xy: FloatArray, crs: str | None, elevation: Elevation) -> FloatArray:
    if crs is None:
        raise BadValue("The graph has no CRS, so its location is unknown.")
    return elevation.heights(project(xy, crs, WGS84))


def _span_bridges(z: FloatArray, ends: IntArray, lengths: FloatArray, raised: BoolArray) -> FloatArray:
    """Return the heights of nodes, to the millimeter; bridges and tunnels rise evenly from end to end.

    The ground there is above or below the road. The heights of nodes without another road are those for which the
    grades balance at each (the solution of Laplace's equation), found by conjugate gradients.
    """
    met, rows = np.unique(ends[raised], return_inverse=True)
    a, b = rows.reshape(-1, 2).T
    count = len(met)
    inner = np.bincount(ends[~raised].ravel(), minlength=len(z))[met] == 0
    label = find_components(a, b, count)
    inner &= np.isin(label, label[~inner])  # parts that lead nowhere have no other height
    pull = 1.0 / np.maximum(lengths[raised], 1e-3)

    def balance(height: FloatArray) -> FloatArray:
        flow = pull * (height[a] - height[b])
        total = np.bincount(a, flow, count) - np.bincount(b, flow, count)
        return np.asarray(np.where(inner, total, 0.0), np.float64)

    level = z[met]
    rest: FloatArray = -balance(level)
    direction = rest
    size = float((rest * rest).sum())
    least = 1e-20 * size
    for _ in range(min(int(inner.sum()), _MOST_ROUNDS)):
        if size <= least:
            break
        turned = balance(direction)
        step = size / float((direction * turned).sum())
        level = level + step * direction
        rest = rest - step * turned
        before = size
        size = float((rest * rest).sum())
        direction = rest + (size / before) * direction
    spanned = z.copy()
    spanned[met] = level
    return np.round(spanned, 3)
