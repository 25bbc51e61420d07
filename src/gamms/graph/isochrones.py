"""Isochrones: what can be reached from a node or an edge within limits, as parts of edges and as polygons.

The polygon of a limit is the line-based network buffer (Oliver, Schuurman and Hall, 2007; the "sausage buffer" of
Forsyth et al., 2012): all places within a width of the streets that are reached. The budget ends at exact points on
edges; a cost is spent evenly along an edge.
"""

import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, overload

import numpy as np

from gamms.arguments import as_int, as_items, as_known, as_range, as_target
from gamms.errors import BadValue, UnknownName, UnknownType
from gamms.folders import open_whole_file
from gamms.graph import positions
from gamms.graph.graph import Graph
from gamms.ir import geometry
from gamms.ir.graph import FloatArray, GraphColumns, IntArray, as_node_id
from gamms.text import shown
from gamms.typing.context import IContext
from gamms.typing.on_edges import cut_line

if TYPE_CHECKING:
    from shapely import MultiPolygon, Polygon

Source = int | Mapping[str, Any]
"""A node id, or a place on an edge: `{"edge": id, "share": 0.25}`; the share is 0, the beginning, by default."""
_COLOR = (38, 120, 178)
_DECIMALS = 9  # of degrees
_WIDEST = 1e9  # map units: wider than the earth


class EdgePart(NamedTuple):
    """A part of an edge, between two shares of its length from 0 to 1."""

    edge: int
    begin: float
    end: float


class Isochrone(NamedTuple):
    """The nodes and parts of edges that can be reached within a limit.

    Attributes:
        limit: in the unit of the weight.
        polygon: the places within the width of the lines, in map units; a shapely Polygon or MultiPolygon.
        parts: the parts of edges that are reached, in their direction.
        lines: (points, 2) of each part.
        ends: (ends, 2) the places on edges where the limit is reached.
    """

    limit: float
    polygon: "Polygon | MultiPolygon"
    parts: list[EdgePart]
    lines: list[FloatArray]
    ends: FloatArray

    @property
    def rings(self) -> list[list[FloatArray]]:
        """The rings (corners + 1, 2) of each polygon: the outer one counter-clockwise, then the holes clockwise."""
        return [[ring[::-1] for ring in geometry.list_rings(one)] for one in geometry.list_polygons(self.polygon)]


class Isochrones(Sequence[Isochrone]):
    """The isochrones of one source, in the order of their limits: the result of `ctx.graph.isochrone`.

    Args:
        found: the isochrones.
        weight: the weight of the edges.
        crs: the CRS of the map, if any.
        attribution: the authors of the map's data.
    """

    def __init__(
        self, found: Iterable[Isochrone], weight: str | None, crs: str | None, attribution: str | None
    ) -> None:
        self._found = tuple(found)
        self.weight = weight
        self.crs = crs
        self.attribution = attribution

    def __len__(self) -> int:
        return len(self._found)

    @overload
    def __getitem__(self, number: int) -> Isochrone: ...
    @overload
    def __getitem__(self, number: slice) -> Sequence[Isochrone]: ...
    def __getitem__(self, number: int | slice) -> Isochrone | Sequence[Isochrone]:
        return self._found[number]

    def __iter__(self) -> Iterator[Isochrone]:
        return iter(self._found)

    def __repr__(self) -> str:
        """Return a text with the limits and the weight."""
        return f"Isochrones({[one.limit for one in self._found]}, weight={self.weight!r})"

    def to_geojson(self) -> dict[str, Any]:
        """Return the polygons as a GeoJSON FeatureCollection (RFC 7946), each with its `limit` and `weight`.

        Raises:
            BadValue (ValueError): the map has no CRS.
        """
        if self.crs is None:
            raise BadValue(
                "GeoJSON needs degrees, and this graph has no CRS: set ctx.graph.graph.crs, such as to 'EPSG:32635'."
            )
        features = []
        for one in self._found:
            coordinates = [[self._convert_to_degrees(ring) for ring in rings] for rings in one.rings]
            about = {"limit": one.limit, "weight": self.weight}
            shape = {"type": "MultiPolygon", "coordinates": coordinates}
            features.append({"type": "Feature", "properties": about, "geometry": shape})
        known = {} if self.attribution is None else {"attribution": self.attribution}
        return {"type": "FeatureCollection", **known, "features": features}

    def export(self, path: str | os.PathLike[str]) -> Path:
        """Write the polygons as a `.geojson` file, and return its path; an existing file is replaced.

        Raises:
            UnknownType (ValueError): the suffix is not `.geojson`.
            BadValue (ValueError): the map has no CRS.
            OSError: the file cannot be written.
        """
        target = as_target(path)
        if target.suffix.lower() != ".geojson":
            raise UnknownType(f"Isochrones are written as .geojson, not as {target.suffix or target.name!r}.")
        text = json.dumps(self.to_geojson(), allow_nan=False)
        with open_whole_file(target, through_links=True) as beside:
            beside.write_text(text, encoding="utf-8")
        return target

    def draw(self, ctx: IContext, data: Mapping[str, Any]) -> None:
        """Draw the polygons, that of the greatest limit first: a drawer for `ctx.visual.add_artist`.

        Args:
            ctx: the context.
            data: of the artist; `color` is the color of all polygons, which are transparent.
        """
        red, green, blue = data.get("color", _COLOR)[:3]
        for one in sorted(self._found, key=lambda one: -one.limit):
            for rings in one.rings:
                ctx.visual.render_polygon(geometry.join_rings(rings).tolist(), (red, green, blue, 60))
                for ring in rings:
                    ctx.visual.render_polygon(ring.tolist(), (red, green, blue, 200), width=1)

    def _convert_to_degrees(self, ring: FloatArray) -> list[list[float]]:
        lat, lon = positions.to_latlon(self.crs, ring[:, 0], ring[:, 1])
        return np.column_stack((lon, lat)).round(_DECIMALS).tolist()  # type: ignore[no-any-return] # two levels of lists


class _Start(NamedTuple):
    """A place on an edge where ways begin."""

    row: int
    share: float


def find_isochrones(
    graph: Graph, source: Source, limits: object, weight: str | None, width: float, attribution: str | None
) -> Isochrones:
    """Return the isochrones of a graph; see `GraphEngine.isochrone`."""
    single = isinstance(limits, (int, float)) and not isinstance(limits, bool)
    given = [limits] if single else as_items(limits, "limits", "numbers")
    reach = [as_range(one, "A limit") for one in given]
    if not reach or max(reach) == inf:
        raise BadValue(f"limits must be one or more finite numbers, not {shown(limits)}.")
    radius = as_range(width, "width")
    if not 0 < radius <= _WIDEST:
        raise BadValue(
            f"width must be positive and at most {_WIDEST:g}, not {shown(width)}: polygons have this distance "
            "from streets."
        )
    columns = graph.columns()
    weights = graph.routes.weights(weight)
    starts = _find_starts(columns, source) if isinstance(source, Mapping) else []
    far = np.full(len(columns.node_ids), inf)
    if starts:
        for one in starts:
            left = (1.0 - one.share) * float(weights[one.row])
            _take_least(far, graph, int(columns.targets[one.row]), left, max(reach), weight)
        at = _find_point(columns, starts[0].row, starts[0].share)
    else:
        row = int(graph.routes.rows(as_node_id(source, "source", graph))[0])
        _take_least(far, graph, row, 0.0, max(reach), weight)
        at = columns.xy[row]
    found = [_make_isochrone(columns, weights, far, starts, at, limit, radius) for limit in reach]
    return Isochrones(found, weight, columns.crs, attribution)


def refuse_closed_edge(whole: Graph, usable: Graph, source: Source, mode: object) -> None:
    """Refuse a place on an edge that a mode may not use.

    Args:
        whole: the graph of all modes.
        usable: that of the mode.
        source: a node, or the place.
        mode: the mode, for the message.

    Raises:
        BadValue: the mode may not use the edge.
    """
    edge = source.get("edge") if isinstance(source, Mapping) else None
    graphs = (whole, usable)
    has_it = [isinstance(edge, int) and edge in graph.columns().edge_ids for graph in graphs]
    if has_it == [True, False]:
        raise BadValue(
            f"Mode {shown(mode)} may not use edge {edge}: start from a node or an edge of the mode, or leave out mode=."
        )


def _find_starts(columns: GraphColumns, source: Mapping[str, Any]) -> list[_Start]:
    """Return a place on an edge, and the same place on the edge of the opposite direction if there is one."""
    for key in source:
        as_known(key, "key of a place on an edge", ("edge", "share"))
    if "edge" not in source:
        raise BadValue(f"source must be a node id or {{'edge': id}}, not {shown(source)}.")
    edge = as_int(source["edge"], "edge")
    (rows,) = np.nonzero(columns.edge_ids == edge)
    if not len(rows):
        raise UnknownName("edge", edge, columns.edge_ids.tolist())
    row = int(rows[0])
    share = as_range(source.get("share", 0.0), "share")
    if share > 1.0:
        raise BadValue(f"share must be at most 1, the end of the edge, not {shown(share)}.")
    ends = columns.sources[row], columns.targets[row]
    is_opposite = (columns.targets == ends[0]) & (columns.sources == ends[1])
    is_opposite &= np.isclose(columns.lengths, columns.lengths[row], rtol=1e-9)
    is_opposite[row] = False
    return [_Start(row, share), *(_Start(one, 1.0 - share) for one in np.flatnonzero(is_opposite)[:1].tolist())]


def _take_least(far: FloatArray, graph: Graph, row: int, before: float, limit: float, weight: str | None) -> None:
    """Lower the costs of nodes to those of ways from a node, to which a way costs `before`."""
    if before > limit:
        return
    costs = graph.distances(source=int(graph.columns().node_ids[row]), weight=weight, cutoff=limit - before)
    rows = graph.routes.rows([*costs])
    np.minimum.at(far, rows, before + np.fromiter(costs.values(), float, len(costs)))


def _make_isochrone(
    columns: GraphColumns,
    weights: FloatArray,
    far: FloatArray,
    starts: Sequence[_Start],
    at: FloatArray,
    limit: float,
    width: float,
) -> Isochrone:
    """Return the places that are reached within a limit.

    Args:
        columns: the graph.
        weights: (edges,) the costs of the edges.
        far: (nodes,) the costs of the ways to the nodes.
        starts: places on edges where ways begin, besides nodes.
        at: (2,) the place of the source.
        limit: the limit.
        width: of the polygon around the lines.
    """
    left = limit - far[columns.sources]
    rows = np.flatnonzero((left >= 0.0) & np.isfinite(weights))
    reached = dict(zip(rows.tolist(), _compute_shares(left[rows], weights[rows]).tolist(), strict=True))
    spans = {row: [(0.0, share)] for row, share in reached.items() if share > 0.0}
    for one in starts:
        more = float(_compute_shares(np.array([limit]), weights[[one.row]])[0])
        last = min(1.0, one.share + more)
        before = reached.get(one.row, 0.0)
        if one.share <= before:
            spans[one.row] = [(0.0, max(before, last))]
        elif last > one.share:
            spans.setdefault(one.row, []).append((one.share, last))
    parts = []
    lines = []
    ends = []
    for row in sorted(spans):
        for begin, end in spans[row]:
            line = _cut_edge(columns, row, begin, end)
            parts.append(EdgePart(int(columns.edge_ids[row]), begin, end))
            lines.append(line)
            if end < 1.0:
                ends.append(line[-1])
    polygon = geometry.buffer_lines(lines, at, width)
    return Isochrone(limit, polygon, parts, lines, np.array(ends, float).reshape(-1, 2))


def _compute_shares(left: FloatArray, weights: FloatArray) -> FloatArray:
    """Return the shares of edges that the rest of the limit pays for; all of an edge that costs nothing."""
    shares = np.ones(len(left))
    np.divide(left, weights, out=shares, where=weights > left)
    return shares


def _cut_edge(columns: GraphColumns, row: int, begin: float, end: float) -> FloatArray:
    """Return the part of an edge between two shares, (points, 2)."""
    points = _list_points(columns, row)
    if (begin, end) == (0.0, 1.0):
        return points
    found: FloatArray = np.array([place[1:] for place in cut_line(points.ravel().tolist(), begin, end)])
    return found


def _find_point(columns: GraphColumns, row: int, share: float) -> FloatArray:
    place: FloatArray = _cut_edge(columns, row, share, share)[0]
    return place


def _list_points(columns: GraphColumns, row: int) -> FloatArray:
    ends: IntArray = np.array([columns.sources[row], columns.targets[row]])
    return columns.polylines.get(row, columns.xy[ends])
