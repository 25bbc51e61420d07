"""Tracks: read measured points from GPX and CSV files, and match them to the roads.

The matcher is a hidden Markov model (Newson and Krumm 2009). Its states are the edges near a point, and the Viterbi
algorithm finds the likeliest route. The distance of a point from its edge has a normal distribution, and the length of
the route between points has an exponential distribution. Costs, the negative logarithms of probabilities, are in meters
of route. Points may be left out as outliers, and a route may be interrupted by a gap, each at a price.
"""

import csv
import os
from collections.abc import Iterator, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from itertools import islice, pairwise
from math import hypot, inf, nan
from pathlib import Path
from typing import NamedTuple
from xml.parsers import expat

import numpy as np

from gamms import kernels
from gamms.arguments import as_path
from gamms.errors import BadFile, BadType, BadValue, MissingFile, UnknownType
from gamms.ir.geometry import NearLines
from gamms.ir.graph import FloatArray, GraphColumns, IntArray, find_shortest_edges
from gamms.limits import refuse_above
from gamms.text import parse_cell, shown
from gamms.typing.graph_engine import IGraph
from gamms.typing.routes import RouteQueries, get_cached

_NEAREST_SIGMAS = 2.0  # points nearer than this to the last one that counts are skipped
_MORE_SIGMAS = 4.0  # edges farther than the nearest one by more than this do not count
_DETOUR_M = 2.0  # of route for which the likelihood falls by the factor e
_OUTLIER_STEPS = 10.0  # usual distances between points, of route that a point must save to be left out
_MOST_OUTLIERS = 2  # in a row
_LONGEST_DETOUR_M = 500.0  # beyond the straight line; a longer one is a gap
_POINTS_AT_ONCE = 1_000
_ROUNDING = 1e-6  # meters, of equally long routes


class TrackMatch(NamedTuple):
    """A track, matched to the roads.

    Attributes:
        agent: the name of the agent or of the track; of several, their names with commas; empty for points without a
            name.
        paths: node ids of each part of the route. A part begins and ends at the nodes nearest to its first and last
            points, and may have a single node.
        edges: for each point the id of its edge; None for outliers.
        places: (points, 2) for each point the nearest point on its edge, map units; NaN for outliers.
        outliers: numbers of the points that do not count: too far from every road, or reached by a long detour only.
        gaps: for each part but the first, the numbers of the last point before it and of its first point. No road
            leads on between them, or the file begins a new track or segment.
        length: the length of the route from the first point to the last, without gaps, in the unit of edges.
        off_m: the mean distance of points from their edges, map units; NaN if no point is on a road.
        agents: for each point the name of its agent or track, for `edges`, `outliers` and `gaps` of several.
    """

    agent: str
    paths: list[list[int]]
    edges: list[int | None]
    places: FloatArray
    outliers: list[int]
    gaps: list[tuple[int, int]]
    length: float
    off_m: float
    agents: list[str]

    @property
    def points(self) -> int:
        """The number of points."""
        return len(self.edges)

    @property
    def off_road(self) -> int:
        """The number of outliers."""
        return len(self.outliers)

    @property
    def parts(self) -> int:
        """The number of parts of the route."""
        return len(self.paths)

    def __repr__(self) -> str:
        values = f"agent={self.agent!r}, points={self.points}, outliers={self.off_road}, parts={self.parts}"
        return f"TrackMatch({values}, length={self.length:.1f}, off_m={self.off_m:.1f})"


class TrackPoints(NamedTuple):
    """The measured points of a track or of its segment, in order."""

    name: str
    times: FloatArray  # (points,) seconds; NaN: unknown
    xy: FloatArray  # (points, 2)


class TrackPart(NamedTuple):
    """A part of a track that follows the roads without a gap."""

    nodes: list[int]  # ids; the first edge holds the first point, the last edge the last one
    node_at: FloatArray  # (nodes,) distance of each node from the start
    points: list[int]  # (knots,) numbers of points
    along: FloatArray  # (knots,) their distances from the start


class MatchedPoints(NamedTuple):
    """How `TrackPoints` match the roads."""

    parts: list[TrackPart]
    edges: list[int | None]  # (points,) ids; None: an outlier
    places: FloatArray  # (points, 2)
    off: list[float]  # of the points that count


def match_track(
    source: object, graph: IGraph, routes: RouteQueries, columns: GraphColumns, noise_m: float, within_m: float
) -> TrackMatch:
    """Match a file or points to a graph; see `GraphEngine.match_track`."""
    tracks = list(read_tracks(source, graph))
    matcher = TrackMatcher(graph, routes, columns, noise_m, within_m)
    return join_matches([(one.name, matcher.match(one)) for one in tracks])


def join_matches(pieces: Sequence[tuple[str, MatchedPoints]]) -> TrackMatch:
    """Return the match of tracks and segments that were matched apart, given with the names of their tracks."""
    parts: list[TrackPart] = []
    ends: list[tuple[int, int]] = []  # of each part: numbers of its first and last point
    edges: list[int | None] = []
    agents: list[str] = []
    for name, piece in pieces:
        agents += [name] * len(piece.edges)
        parts += piece.parts
        ends += [(len(edges) + part.points[0], len(edges) + part.points[-1]) for part in piece.parts]
        edges += piece.edges
    off = [one for _, piece in pieces for one in piece.off]
    return TrackMatch(
        agent=", ".join(dict.fromkeys(name for name, _ in pieces)),
        paths=[_trim_path(part) for part in parts],
        edges=edges,
        places=np.concatenate([np.empty((0, 2)), *(piece.places for _, piece in pieces)]),
        outliers=[at for at, edge in enumerate(edges) if edge is None],
        gaps=[(before[1], after[0]) for before, after in pairwise(ends)],
        length=float(sum(part.along[-1] - part.along[0] for part in parts)),
        off_m=float(np.mean(off)) if off else nan,
        agents=agents,
    )


def _trim_path(part: TrackPart) -> list[int]:
    """Return the nodes of a part, without a first or last node that is not the nearer end of its edge."""
    first = int(part.along[0] > part.node_at[1] / 2.0)
    last = len(part.nodes) - int(part.along[-1] < (part.node_at[-1] + part.node_at[-2]) / 2.0)
    return part.nodes[first : max(last, first + 1)]


# -- matching -------------------------------------------------------------------------------------------------------


class _RoadIndex:
    """The edges of a graph as lines, for matching."""

    def __init__(self, routes: RouteQueries, columns: GraphColumns) -> None:
        ends = np.stack((columns.xy[columns.sources], columns.xy[columns.targets]), axis=1)
        self.lines = NearLines([columns.polylines.get(row, line) for row, line in enumerate(ends)])
        self.sources = columns.sources
        self.targets = columns.targets
        self.node_ids = columns.node_ids.tolist()
        self.edge_ids = columns.edge_ids.tolist()
        self.shortest = find_shortest_edges(columns)
        pairs = zip(columns.node_ids[columns.sources].tolist(), columns.node_ids[columns.targets].tolist(), strict=True)
        self.lengths = np.array([self.shortest[pair] for pair in pairs])  # (edges,) the shortest of parallel ones
        self.search = kernels.Search(routes.arcs(), columns.node_ids)


class _Candidates(NamedTuple):
    """The possible positions of a point: on edges, at offsets."""

    edges: IntArray  # (candidates,) rows
    offsets: FloatArray  # from their sources, in the unit of lengths
    off: FloatArray  # from the point
    xy: FloatArray  # (candidates, 2)


class _Position(NamedTuple):
    """The chosen position of a point."""

    point: int  # number
    edge: int  # row
    offset: float
    off: float
    xy: FloatArray  # (2,)


class _States(NamedTuple):
    """What the Viterbi algorithm keeps of a point, by candidate."""

    before: IntArray  # how many points before this one the previous one is; 0: it is the first
    back: IntArray  # the candidate of the previous one
    begins: IntArray  # 1: a part begins


class TrackMatcher:
    """Matches points to the roads of a graph.

    Args:
        graph: the graph.
        routes: its routes.
        columns: its columns.
        noise_m: the standard deviation of the errors of positions.
        within_m: points that are farther from every road do not count.

    Raises:
        BadValue: the graph has no edges.
    """

    def __init__(
        self, graph: IGraph, routes: RouteQueries, columns: GraphColumns, noise_m: float, within_m: float
    ) -> None:
        if not len(columns.edge_ids):
            raise BadValue("The map has no edges, so tracks cannot be matched to it.")
        self._graph = graph
        self._roads = get_cached(routes, "tracks", None, lambda: _RoadIndex(routes, columns))
        self._noise_m = noise_m
        self._within_m = within_m

    def match(self, points: TrackPoints) -> MatchedPoints:
        """Return the route through points that are one segment."""
        kept = self._find_distant_points(points.xy)
        until = [*kept[1:], len(points.xy)]  # the next point that is not skipped
        candidates = [
            some
            for at in range(0, len(kept), _POINTS_AT_ONCE)
            for some in self._find_candidates(points, kept[at : at + _POINTS_AT_ONCE])
        ]
        near = [at for at, some in enumerate(candidates) if len(some.edges)]
        runs = self._find_likeliest_runs(points.xy[[kept[at] for at in near]], [candidates[at] for at in near])
        edges: list[int | None] = [None] * len(points.xy)
        places = np.full((len(points.xy), 2), nan)
        parts = []
        off = []
        for run in runs:
            rows = [kept[near[one.point]] for one in run]
            stops = [until[near[one.point]] for one in run]
            for one, row, stop in zip(run, rows, stops, strict=True):
                edges[row:stop] = [self._roads.edge_ids[one.edge]] * (stop - row)
                places[row:stop] = one.xy
                off.append(one.off)
            parts.append(self._make_part(run, rows, stops))
        return MatchedPoints(parts, edges, places, off)

    def _find_distant_points(self, xy: FloatArray) -> list[int]:
        """Return the last point and all that are farther from the last kept one than measurement errors explain."""
        kept: list[int] = []
        least = _NEAREST_SIGMAS * self._noise_m
        before = (inf, inf)
        for at, (x, y) in enumerate(xy.tolist()):
            is_near = hypot(x - before[0], y - before[1]) <= least  # false for positions that are not finite
            if not is_near or at == len(xy) - 1:
                kept.append(at)
                before = (x, y)
        return kept

    def _find_candidates(self, points: TrackPoints, rows: list[int]) -> list[_Candidates]:
        """Return the edges near points: those that are hardly farther than the nearest one."""
        xy = points.xy[rows]
        finite = np.flatnonzero(np.isfinite(xy).all(axis=1))
        found, lines, off = self._roads.lines.find_within(xy[finite], self._within_m)
        at = finite[found]
        nearest = np.full(len(rows), inf)
        np.minimum.at(nearest, at, off)
        is_near = off <= nearest[at] + _MORE_SIGMAS * self._noise_m
        order = np.flatnonzero(is_near)[np.lexsort((lines[is_near], off[is_near], at[is_near]))]
        at, lines, off = at[order], lines[order], off[order]
        shares, places = self._roads.lines.project(xy[at], lines)
        offsets = shares * self._roads.lengths[lines]
        ends = np.searchsorted(at, np.arange(len(rows) + 1)).tolist()
        spans = [slice(begin, end) for begin, end in pairwise(ends)]
        return [_Candidates(lines[span], offsets[span], off[span], places[span]) for span in spans]

    def _find_likeliest_runs(self, xy: FloatArray, candidates: list[_Candidates]) -> list[list[_Position]]:
        """Return the likeliest positions of points, by Viterbi, for each part."""
        if not candidates:
            return []
        steps = np.hypot(*np.diff(xy, axis=0).T)
        usual = max(float(np.median(steps)), _NEAREST_SIGMAS * self._noise_m) if len(steps) else 0.0
        outlier_m = _OUTLIER_STEPS * usual
        costs: list[FloatArray] = []
        states: list[_States] = []
        for at, some in enumerate(candidates):
            is_possible = at <= _MOST_OUTLIERS
            best = np.full(len(some.edges), at * outlier_m if is_possible else inf)
            state = _States(*np.zeros((3, len(best)), np.int64))
            state.begins[:] = 1
            for before in range(1, min(at, _MOST_OUTLIERS + 1) + 1):
                earlier = costs[-before] + (before - 1) * outlier_m
                if before > 1 and best.max() <= earlier.min():
                    continue  # leaving points out makes nothing cheaper
                straight = hypot(*(xy[at] - xy[at - before]).tolist())
                ways = self._find_road_distances(candidates[at - before], some, straight + _LONGEST_DETOUR_M)
                is_end = np.full(ways.shape, at == len(candidates) - 1) | (states[at - before].begins[:, None] > 0)
                chords = np.hypot(*(candidates[at - before].xy[:, None] - some.xy).transpose(2, 0, 1))
                ways[is_end] = np.maximum(ways - chords, 0.0)[is_end]  # or points at the ends would be drawn inward
                totals = earlier[:, None] + ways
                _improve(best, state, totals, before, begins=0)
                gap = np.full((len(earlier), len(best)), earlier[:, None] + straight + _LONGEST_DETOUR_M)
                _improve(best, state, gap, before, begins=1)
            costs = [*costs[-_MOST_OUTLIERS:], best + _DETOUR_M * 0.5 * (some.off / self._noise_m) ** 2]
            states.append(state)
        lost = min(range(len(costs)), key=lambda number: costs[-1 - number].min() + number * outlier_m)
        runs = _trace_back(candidates, states, len(candidates) - 1 - lost, int(costs[-1 - lost].argmin()))
        for run in runs:
            for at in sorted({1, len(run) - 2}) if len(run) > 2 else ():
                run[at] = self._move_along_route(run[at - 1], run[at], run[at + 1], candidates[run[at].point])
        return runs

    def _move_along_route(self, before: _Position, one: _Position, after: _Position, some: _Candidates) -> _Position:
        """Return the candidate nearest to a point from which the route is as long as from a chosen one.

        Beside the first and last points, where only detours are charged, positions are drawn along the route.
        """
        within = float(np.hypot(*(after.xy - before.xy))) + 2.0 * _LONGEST_DETOUR_M
        start, end = (
            _Candidates(np.array([end.edge]), np.array([end.offset]), np.array([end.off]), end.xy[None])
            for end in (before, after)
        )
        ways = self._find_road_distances(start, some, within)[0] + self._find_road_distances(some, end, within)[:, 0]
        is_on_route = ways <= ways[some.edges == one.edge] + _ROUNDING
        best = int(np.where(is_on_route, some.off, inf).argmin())
        return _make_position(one.point, some, best)

    def _find_road_distances(self, before: _Candidates, after: _Candidates, within: float) -> FloatArray:
        """Return road distances (before, after) between candidates; infinity for those beyond a distance."""
        starts, start_of = np.unique(self._roads.targets[before.edges], return_inverse=True)
        goals, goal_of = np.unique(self._roads.sources[after.edges], return_inverse=True)
        between = np.array(
            [
                self._roads.search.compute_distances(starts[i : i + 1], goals, within=within)[0]
                for i in range(len(starts))
            ]
        )
        rest = self._roads.lengths[before.edges] - before.offsets
        ways = between[start_of][:, goal_of] + rest[:, None] + after.offsets
        ahead = after.offsets - before.offsets[:, None]
        stays = (before.edges[:, None] == after.edges) & (ahead >= -_NEAREST_SIGMAS * self._noise_m)
        found: FloatArray = np.where(stays, np.maximum(0.0, ahead), ways)
        return found

    def _make_part(self, run: list[_Position], rows: list[int], stops: list[int]) -> TrackPart:
        """Return the part through positions.

        Args:
            run: the positions.
            rows: numbers of their points.
            stops: numbers of the next points that are not skipped; the agent hardly moves until then.
        """
        roads = self._roads
        first = run[0]
        nodes = [roads.node_ids[roads.sources[first.edge]], roads.node_ids[roads.targets[first.edge]]]
        node_at = [0.0, float(roads.lengths[first.edge])]
        points: list[int] = []
        along: list[float] = []
        for before, one, row, stop in zip([first, *run], run, rows, stops, strict=False):
            is_same = before.edge == one.edge and before.offset - one.offset <= _NEAREST_SIGMAS * self._noise_m
            if not is_same:
                source, target = (roads.node_ids[ends[one.edge]] for ends in (roads.sources, roads.targets))
                for node in (*self._graph.shortest_path(nodes[-1], source)[1:], target):
                    node_at.append(node_at[-1] + roads.shortest[nodes[-1], node])
                    nodes.append(node)
            here = node_at[-2] + one.offset
            along.append(max(along[-1], here) if along else here)
            points.append(row)
            if stop > row + 1:
                along.append(along[-1])
                points.append(stop - 1)
        return TrackPart(nodes, np.array(node_at), points, np.array(along))


def _make_position(point: int, some: _Candidates, at: int) -> _Position:
    return _Position(point, int(some.edges[at]), float(some.offsets[at]), float(some.off[at]), some.xy[at])


def _improve(best: FloatArray, state: _States, totals: FloatArray, before: int, *, begins: int) -> None:
    """Take over the cheapest way to each candidate where it is cheaper than the best one.

    Args:
        best: (candidates,) the costs.
        state: the states, which are changed with the costs.
        totals: (earlier candidates, candidates) costs.
        before: how many points earlier the earlier candidates are.
        begins: 1 if a part begins at the candidates.
    """
    back = totals.argmin(axis=0)
    costs = totals.min(axis=0)
    is_better = costs < best
    best[is_better] = costs[is_better]
    state.before[is_better] = before
    state.back[is_better] = back[is_better]
    state.begins[is_better] = begins


def _trace_back(candidates: list[_Candidates], states: list[_States], at: int, chosen: int) -> list[list[_Position]]:
    """Return the positions of each part that lead to a candidate of a point."""
    runs: list[list[_Position]] = [[]]
    while True:
        some = candidates[at]
        runs[-1].append(
            _Position(
                at, int(some.edges[chosen]), float(some.offsets[chosen]), float(some.off[chosen]), some.xy[chosen]
            )
        )
        before = int(states[at].before[chosen])
        if not before:
            return [run[::-1] for run in reversed(runs)]
        if states[at].begins[chosen]:
            runs.append([])
        chosen = int(states[at].back[chosen])
        at -= before


# -- files ----------------------------------------------------------------------------------------------------------

_CHUNK = 1 << 16  # bytes
# bytes of memory, measured: for each byte of a file that holds only points, and for a point
_PER_BYTE = 10
_POINT_BYTES = 240
# bytes of memory: for each byte of a CSV file of short lines, and for a line
_PER_CSV_BYTE = 24
_LINE_BYTES = 150
_MOST_POINTS = 1_000_000
_LONG = 200  # most characters of a name
_MOST_LAT = 90.0  # degrees
_TRACKS = ("trk", "rte")
_POINTS = ("trkpt", "rtept")
_PARTS = ("trkseg", "rte")
_DEEPEST = 100  # most nested elements
_COLUMNS = {
    "time": ("time", "t", "timestamp"),
    "agent": ("agent", "name"),
    "lat": ("lat", "latitude"),
    "lon": ("lon", "longitude"),
    "x": ("x",),
    "y": ("y",),
}


class _MeasuredPoints(NamedTuple):
    """The points of a track or of its segment, as a file has them."""

    name: str
    points: FloatArray  # (points, 3) time in seconds, or NaN; latitude and longitude in degrees, or x and y
    in_degrees: bool


def read_tracks(source: object, graph: IGraph) -> Iterator[TrackPoints]:
    """Yield the tracks and segments of a GPX or CSV file, or points in map units as one segment.

    Raises:
        BadType: the source is neither a file nor points.
        MissingFile (FileNotFoundError): the file does not exist.
        BadFile (ValueError): the file is damaged, too large, or of another format.
        UnknownType: its suffix is neither .gpx nor .csv.
        BadValue: the graph has no CRS for degrees, or the points are far from the map.
    """
    if not isinstance(source, (str, os.PathLike)):
        yield from _read_points(source)
        return
    file = as_path(source, "A track")
    read = _FORMATS.get(file.suffix.lower())
    if read is None:
        raise UnknownType(f"No tracks are read from {file.suffix or 'a file without a suffix'!r}: give .gpx or .csv.")
    for name, points, in_degrees in read(file):
        times, *places = points.T
        xy = graph.from_latlon(lat=places[0], lon=places[1]) if in_degrees else places
        yield TrackPoints(name or file.stem, times, np.column_stack(xy))


def _read_points(source: object) -> list[TrackPoints]:
    try:
        rows = np.array(source if isinstance(source, np.ndarray) else list(source))  # type: ignore[call-overload] # checked
        if rows.dtype.kind not in "iuf" or rows.ndim != 2 or rows.shape[1] not in (2, 3):
            raise ValueError("they are not rows of two or three numbers")  # noqa: TRY301 - the except says which points
    except (TypeError, ValueError):
        if isinstance(source, Sequence) and not source:
            return []
        raise BadType(
            f"A track is a GPX or CSV file, or points (x, y) or (x, y, t) in map units, not {shown(source)}. "
            "ctx.graph.from_latlon(lat, lon) converts degrees."
        ) from None
    times = rows[:, 2] if rows.shape[1] == 3 else np.full(len(rows), nan)
    return [TrackPoints("", times.astype(np.float64), rows[:, :2].astype(np.float64))] if len(rows) else []


def read_csv(file: Path) -> list[_MeasuredPoints]:
    """Return the tracks of a CSV file; raises like `read_gpx`."""
    if not file.is_file():
        raise MissingFile("a CSV track", file)
    refuse_above(min(_PER_CSV_BYTE * file.stat().st_size, _LINE_BYTES * _MOST_POINTS), f"Reading {str(file)!r}")
    rows: dict[str, list[tuple[float, float, float]]] = {}
    at_line = ""
    try:
        with file.open(newline="", encoding="utf-8-sig") as stream:
            reader = csv.reader(stream)
            header = next(reader, [])
            at = _find_columns(header)
            in_degrees = not {"x", "y"} <= at.keys()
            keys = ("lat", "lon") if in_degrees else ("x", "y")
            for row in filter(None, islice(reader, _MOST_POINTS)):
                at_line = f"line {reader.line_num}: "
                _refuse_short(row, at, len(header))
                name = parse_cell(row[at["agent"]]) if "agent" in at else file.stem
                place = float(row[at[keys[0]]]), float(row[at[keys[1]]])
                if in_degrees:
                    _check_degrees(*place)
                rows.setdefault(name, []).append((_parse_time(row[at["time"]]) if "time" in at else nan, *place))
            is_too_long = next(reader, None) is not None
    except (csv.Error, ValueError) as error:
        raise BadFile(
            f"{str(file)!r} cannot be used as a CSV file of tracks: {at_line}{str(error).rstrip('.')}."
        ) from None
    if is_too_long:
        raise BadFile(f"{str(file)!r} has more than {_MOST_POINTS:,} rows. Split it.")
    return [_MeasuredPoints(name, np.array(one, np.float64), in_degrees) for name, one in rows.items()]


def _find_columns(header: list[str]) -> dict[str, int]:
    names = [name.strip().lower() for name in header]
    at: dict[str, int] = {}
    for key, known in _COLUMNS.items():
        found = [names.index(one) for one in known if one in names]
        if found:
            at[key] = found[0]
    if not ({"lat", "lon"} <= at.keys() or {"x", "y"} <= at.keys()):
        raise ValueError(f"its columns are {shown(names)}, and it needs lat and lon or x and y, and may have time")
    return at


def _refuse_short(row: list[str], at: dict[str, int], columns: int) -> None:
    """Refuse a row that ends before a column that is read (ValueError)."""
    if len(row) <= max(at.values()):
        raise ValueError(f"it has {len(row)} of the {columns} columns")


def _check_degrees(lat: float, lon: float) -> None:
    for name, most, value in (("lat", _MOST_LAT, lat), ("lon", 2.0 * _MOST_LAT, lon)):
        if not abs(value) <= most:  # also of a point without it, which is NaN
            raise ValueError(f"{name} must lie between -{most:g} and {most:g} degrees, not {value}")


def _parse_time(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return parse_seconds(text.strip())


def read_gpx(file: Path) -> list[_MeasuredPoints]:
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
    rows = [("".join(name).strip()[:_LONG], np.array(points)) for name, points in reader.parts if points]
    return [_MeasuredPoints(name, points, in_degrees=True) for name, points in rows]


_FORMATS = {".gpx": read_gpx, ".csv": read_csv}


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
            _check_degrees(*place)
            self.parts[-1][1].append([nan, *place])
            self.count += 1
            if self.count > _MOST_POINTS:
                raise ValueError(f"it has more than {_MOST_POINTS:,} points")

    def _end(self, _: str) -> None:
        if self._open.pop() == "time" and self._open[-1:] and self._open[-1] in _POINTS:
            with suppress(ValueError):  # a point with an invalid time is kept
                self.parts[-1][1][-1][0] = parse_seconds("".join(self._time).strip())
        self._time = []

    def _read(self, text: str) -> None:
        inner = self._open[-2:]
        if inner[-1:] == ["time"]:
            self._time.append(text[:_LONG])
        elif inner[-1:] == ["name"] and inner[0] in _TRACKS and len(self._name) < _LONG:
            self._name.append(text[:_LONG])

    def _refuse(self, *_: object) -> None:
        raise ValueError("it declares a document type, which GPX does not allow")


def parse_seconds(text: str) -> float:
    """Return a time like 2025-06-15T15:06:40Z as seconds since 1970; a time without a zone is UTC.

    Raises:
        ValueError: `text` is not a time.
    """
    is_count = text.isdigit() and len(text) > len("20250615")  # of some unit, which might read as another date
    if len(text) > _LONG or is_count:
        raise ValueError(f"{text[:40]!r} is no time")
    moment = datetime.fromisoformat(text)
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()
