"""Find parts of a graph: streets and junctions by name, nodes and edges in a polygon, paths of GPX tracks."""

import unicodedata
from collections.abc import Iterable, Mapping
from contextlib import suppress
from datetime import UTC, datetime
from itertools import islice
from math import nan
from typing import TYPE_CHECKING, Any, NamedTuple
from xml.parsers import expat

import numpy as np

from gamms.arguments import as_path, as_text
from gamms.errors import BadFile, BadValue, MissingFile, NoPath, UnknownName
from gamms.graph import positions
from gamms.ir import geometry
from gamms.ir.graph import FloatArray, GraphColumns, IntArray
from gamms.limits import refuse_above
from gamms.typing.graph_engine import IGraph
from gamms.typing.routes import RouteQueries

if TYPE_CHECKING:
    from pathlib import Path

    from shapely import Polygon

_LONG = 200  # most characters of a searched name
_MANY = 20_000  # names that are compared with an unknown name for suggestions
_MOST_LISTED = 8
_ONE_JUNCTION = 50.0  # metres: nodes of one junction are at most this far from the next node
_NEAR = 30.0  # metres: gap between streets that are joined by a piece with no name or another name
_AT_ONCE = 256  # nodes
_MOST_LAT = 90.0  # degrees


class NamedFeature(NamedTuple):
    """A named part of a graph: a street or a junction.

    Attributes:
        name: name on the map.
        nodes: ids of its nodes, in insertion order.
        edges: ids of its edges, in insertion order.
        xy: (nodes, 2) coordinates of the nodes.
        is_junction: whether this is a junction of streets.
    """

    name: str
    nodes: list[int]
    edges: list[int]
    xy: FloatArray
    is_junction: bool

    @property
    def node(self) -> int:
        """The node nearest to the center.

        Raises:
            BadValue (ValueError): the streets meet at several junctions; the message names one node of each.
        """
        clusters = _clusters(self.xy) if self.is_junction else [np.arange(len(self.xy))]
        off = (np.hypot(*(self.xy[rows] - self.xy[rows].mean(axis=0)).T) for rows in clusters)
        middles = [rows.item(far.argmin()) for rows, far in zip(clusters, off, strict=True)]
        if len(middles) > 1:
            places = [f"node {self.nodes[row]} at ({self.xy[row, 0]:.0f}, {self.xy[row, 1]:.0f})" for row in middles]
            raise BadValue(f"{self.name} is at {len(middles)} places: {_listed(places)}. Use one of these nodes.")
        return self.nodes[middles[0]]


class PolygonContents(NamedTuple):
    """The nodes and edges in a polygon.

    Attributes:
        nodes: ids, in insertion order.
        edges: ids, in insertion order.
    """

    nodes: list[int]
    edges: list[int]


class StreetNames:
    """The streets of a graph by name, ignoring case and accents.

    Args:
        names: edge row -> its `name`: a text, or a list of texts.
    """

    def __init__(self, names: Mapping[int, object]) -> None:
        self._rows: dict[str, list[int]] = {}
        self._spelling: dict[str, str] = {}
        folded: dict[str, str] = {}
        for row, given in names.items():
            several = given if isinstance(given, list | tuple) else [given]
            for name in several:
                if isinstance(name, str):
                    key = folded[name] if name in folded else folded.setdefault(name, _folded(name))
                    self._rows.setdefault(key, []).append(row)
                    self._spelling.setdefault(key, name)

    def __contains__(self, name: object) -> bool:
        """Return whether a street has this name."""
        return isinstance(name, str) and _folded(name) in self._rows

    def rows(self, name: str) -> IntArray:
        """Return the rows of the edges of a street, in insertion order.

        Raises:
            UnknownName (KeyError): no street has this name; the message lists similar names.
            BadValue (ValueError): no edge has a name.
        """
        if not self._rows:
            raise BadValue("No edge of this graph has a name. Streets of OpenStreetMap have the attribute 'name'.")
        key = _folded(name)
        if key not in self._rows:
            from difflib import get_close_matches  # imported here because few programs need it

            known = list(islice(self._rows, _MANY))
            alike = get_close_matches(key, known, n=3) or [one for one in known if key and key in one]
            raise UnknownName("street", name, [self._spelling[one] for one in alike or known])
        return np.unique(np.array(self._rows[key], np.int64))

    def spelling(self, name: str) -> str:
        """Return a name as the map spells it."""
        return self._spelling[_folded(name)]

    def of_rows(self, rows: Iterable[int]) -> list[str]:
        """Return the names of the streets of some edges."""
        wanted = set(rows)
        return [self._spelling[key] for key, own in self._rows.items() if not wanted.isdisjoint(own)]


def find(columns: GraphColumns, streets: StreetNames, text: str) -> NamedFeature:
    """Return a street, or the junction of the streets in "A & B"."""
    text = as_text(text, "The name to find", "the name of a street, or 'A & B'")
    if len(text) > _LONG:
        raise BadValue(f"The name of a street has at most {_LONG} characters, not {len(text)}.")
    if text in streets or "&" not in text:
        rows = streets.rows(text)
        return _found(columns, streets.spelling(text), _nodes_of(columns, rows), rows, is_junction=False)
    names = [part.strip() for part in text.split("&")]
    sides = [_nodes_of(columns, streets.rows(name)) for name in names]
    title = " & ".join(streets.spelling(name) for name in names)
    shared = sides[0]
    for side in sides[1:]:
        shared = np.intersect1d(shared, side)
    if not len(shared):
        shared = _nearly_shared(columns, streets, names, sides)
    is_at = np.zeros(len(columns.node_ids), np.bool_)
    is_at[shared] = True
    of_streets = np.unique(np.concatenate([streets.rows(name) for name in names]))
    rows = of_streets[is_at[columns.sources[of_streets]] | is_at[columns.targets[of_streets]]]
    return _found(columns, title, shared, rows, is_junction=True)


def inside(columns: GraphColumns, region: "Polygon", *, touching: bool) -> PolygonContents:
    """Return the nodes in a region, and the edges that lie in it completely or partly."""
    nodes = columns.node_ids[geometry.are_inside(region, columns.xy)]
    ends = np.stack((columns.xy[columns.sources], columns.xy[columns.targets]), axis=1)
    rows = geometry.lines_inside(region, ends, columns.polylines, touching=touching)
    return PolygonContents(nodes.tolist(), columns.edge_ids[rows].tolist())


def region_of(polygon: object, crs: str | None) -> "Polygon":
    """Return a polygon passed by a caller, in map units.

    Raises:
        BadValue (ValueError): not a polygon, or GeoJSON on a map without a CRS.
    """

    def from_lonlat(lonlat: FloatArray) -> FloatArray:
        return np.column_stack(positions.from_latlon(crs, lonlat[:, 1], lonlat[:, 0]))

    return geometry.region_of(polygon, "The polygon", from_lonlat)


def bounds(columns: GraphColumns) -> tuple[float, float, float, float]:
    """Return (xmin, ymin, xmax, ymax) of all nodes and polylines.

    Raises:
        BadValue (ValueError): there are no nodes.
    """
    if not len(columns.node_ids):
        raise BadValue("The graph has no nodes, so it has no bounds. Add nodes first.")
    points = np.concatenate([columns.xy, *columns.polylines.values()])
    xmin, ymin, xmax, ymax = np.concatenate((points.min(axis=0), points.max(axis=0))).tolist()
    return xmin, ymin, xmax, ymax


def _folded(name: str) -> str:
    """Return a name in lower case, without accents and extra spaces."""
    plain = unicodedata.normalize("NFKD", name.casefold())
    return " ".join("".join(one for one in plain if not unicodedata.combining(one)).split())


def _found(columns: GraphColumns, name: str, nodes: IntArray, edges: IntArray, *, is_junction: bool) -> NamedFeature:
    ids = columns.node_ids[nodes].tolist(), columns.edge_ids[edges].tolist()
    return NamedFeature(name, *ids, columns.xy[nodes], is_junction)


def _nodes_of(columns: GraphColumns, rows: IntArray) -> IntArray:
    return np.unique(np.concatenate((columns.sources[rows], columns.targets[rows])))


def _nearly_shared(columns: GraphColumns, streets: StreetNames, names: list[str], sides: list[IntArray]) -> IntArray:
    """Return the two nearest nodes of two streets, if they are close enough to form one junction."""
    first, second = names[:2]
    if len(names) == 2:
        xy = columns.xy[sides[0]]
        other = columns.xy[sides[1]]
        best = np.inf
        pair = (0, 0)
        for at in range(0, len(xy), _AT_ONCE):
            off = np.hypot(*(xy[at : at + _AT_ONCE, None] - other[None]).transpose(2, 0, 1))
            row, column = np.unravel_index(off.argmin(), off.shape)
            if off[row, column] < best:
                best = float(off[row, column])
                pair = (int(sides[0][at + row]), int(sides[1][column]))
        if best <= _NEAR:
            return np.unique(pair)
        near = f"{best:,.0f} apart at nodes {columns.node_ids[pair[0]]} and {columns.node_ids[pair[1]]}"
        hint = f"{streets.spelling(first)} and {streets.spelling(second)} do not meet: they are {near}."
    else:
        hint = f"{' & '.join(map(streets.spelling, names))} do not all meet at one node."
    is_at = np.zeros(len(columns.node_ids), np.bool_)
    is_at[sides[0]] = True
    rows = np.flatnonzero(is_at[columns.sources] | is_at[columns.targets])
    others = [name for name in streets.of_rows(rows.tolist()) if name != streets.spelling(first)]
    raise BadValue(f"{hint} {streets.spelling(first)} meets {_listed(others) or 'no other street with a name'}.")


def _clusters(xy: FloatArray) -> list[IntArray]:
    """Group the rows of places: places that a chain of short steps connects are in one group."""
    left = np.arange(len(xy))
    clusters = []
    while len(left):
        cluster = left[:1]
        left = left[1:]
        new = cluster
        while len(new) and len(left):
            is_near = np.hypot(*(xy[left, None] - xy[None, new]).transpose(2, 0, 1)).min(axis=1) <= _ONE_JUNCTION
            new = left[is_near]
            left = left[~is_near]
            cluster = np.concatenate((cluster, new))
        clusters.append(cluster)
    return clusters


def _listed(names: list[Any]) -> str:
    rest = len(names) - _MOST_LISTED
    return ", ".join(map(str, names[:_MOST_LISTED])) + (f" and {rest} more" if rest > 0 else "")


# -- tracks of GPX ------------------------------------------------------------------------------------------------

_CHUNK = 1 << 16  # bytes
# bytes of memory, measured: for each byte of a file that holds only points, and for a point
_PER_BYTE = 10
_POINT_BYTES = 240
_MOST_POINTS = 1_000_000
_TRACKS = ("trk", "rte")
_POINTS = ("trkpt", "rtept")
_PARTS = ("trkseg", "rte")
_DEEPEST = 100  # most nested elements


class Track(NamedTuple):
    """A GPX track, matched to the graph.

    Attributes:
        paths: node ids of each part of the track; a new part begins where the file begins one, where points are too far
            from every edge, and where no path leads on.
        edges: id of the nearest edge of each point; None for points too far from every edge.
    """

    paths: list[list[int]]
    edges: list[int | None]


def track_of(path: object, graph: IGraph, routes: RouteQueries, within: float) -> Track:
    """Match a GPX file to a graph; see `GraphEngine.track`."""
    paths: list[list[int]] = []
    edges: list[int | None] = []
    for part in read_gpx(as_path(path, "path")):
        is_new = True
        lat, lon = part.latlon.T
        for x, y in zip(*graph.from_latlon(lat=lat, lon=lon), strict=True):
            near = routes.nearest_edge(x, y, within)
            edges.append(None if near is None else near.edge_id)
            if near is None:
                is_new = True
                continue
            edge = graph.get_edge(near.edge_id)
            node = edge.source if near.offset < edge.length / 2.0 else edge.target
            if not is_new and node != paths[-1][-1]:
                try:
                    paths[-1].extend(graph.shortest_path(paths[-1][-1], node)[1:])
                except NoPath:
                    is_new = True
            if is_new:
                paths.append([node])
                is_new = False
    return Track(paths, edges)


class GpxPart(NamedTuple):
    """A segment or a route of a GPX file.

    Attributes:
        name: name of the track; empty if it has none.
        latlon: (points, 2) degrees.
        times: (points,) seconds since 1970; NaN for points without a time.
    """

    name: str
    latlon: FloatArray
    times: FloatArray


def read_gpx(file: "Path") -> list[GpxPart]:
    """Return all segments and routes of a GPX file that have points.

    Raises:
        MissingFile (FileNotFoundError): the file does not exist.
        BadFile (ValueError): the file is not GPX, damaged, or too large.
    """
    if not file.is_file():
        raise MissingFile("a GPX track", file)
    refuse_above(min(_PER_BYTE * file.stat().st_size, _POINT_BYTES * _MOST_POINTS), f"Reading {str(file)!r}")
    reader = _GpxReader()
    try:
        with file.open("rb") as stream:
            while chunk := stream.read(_CHUNK):
                reader.parser.Parse(chunk, False)
        reader.parser.Parse(b"", True)
    except (expat.ExpatError, ValueError) as error:
        raise BadFile(f"{str(file)!r} cannot be used as a GPX file: {error}.") from None
    rows = [(name, np.array(points, np.float64)) for name, points in reader.parts if points]
    return [GpxPart("".join(name).strip()[:_LONG], points[:, :2], points[:, 2]) for name, points in rows]


class _GpxReader:
    """Collects the points of a GPX file while it is parsed."""

    def __init__(self) -> None:
        self.parts: list[tuple[list[str], list[list[float]]]] = [([], [])]  # (name as text pieces, points) of each part
        self.count = 0
        self.parser = expat.ParserCreate()
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.CharacterDataHandler = self._read
        self.parser.StartDoctypeDeclHandler = self._refuse
        self._is_first = True
        self._open: list[str] = []  # names of the enclosing elements
        self._name: list[str] = []  # of the track
        self._time: list[str] = []  # of the point

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        name = name.rpartition(":")[2]
        if self._is_first and name != "gpx":
            raise ValueError(f"it begins with <{name[:40]}>")
        self._is_first = False
        self._open.append(name)
        if len(self._open) > _DEEPEST:
            raise ValueError(f"its elements are more than {_DEEPEST} deep")
        if name in _TRACKS:
            self._name = []
        if name in _PARTS:
            self.parts.append((self._name, []))
        elif name in _POINTS:
            place = float(attributes.get("lat", "nan")), float(attributes.get("lon", "nan"))
            if not (abs(place[0]) <= _MOST_LAT and abs(place[1]) <= 2.0 * _MOST_LAT):
                raise ValueError(f"a point has no latitude and longitude: {str(attributes)[:80]}")
            self.parts[-1][1].append([*place, nan])
            self.count += 1
            if self.count > _MOST_POINTS:
                raise ValueError(f"it has more than {_MOST_POINTS:,} points")

    def _end(self, _: str) -> None:
        if self._open.pop() == "time" and self._open[-1:] and self._open[-1] in _POINTS:
            with suppress(ValueError):  # a point with an invalid time is kept
                self.parts[-1][1][-1][2] = seconds_of("".join(self._time).strip())
        self._time = []

    def _read(self, text: str) -> None:
        inner = self._open[-2:]
        if inner[-1:] == ["time"]:
            self._time.append(text[:_LONG])
        elif inner[-1:] == ["name"] and inner[0] in _TRACKS and len(self._name) < _LONG:
            self._name.append(text[:_LONG])

    def _refuse(self, *_: object) -> None:
        raise ValueError("it declares a document type, which GPX does not allow")


def seconds_of(text: str) -> float:
    """Return a time like 2025-06-15T15:06:40Z as seconds since 1970; a time without a zone is UTC.

    Raises:
        ValueError: `text` is not a time.
    """
    if len(text) > _LONG:
        raise ValueError(f"{text[:40]!r} is no time")
    moment = datetime.fromisoformat(text)
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()
