"""Tracks of real journeys, from GPX and CSV files, as recordings: match them to the roads and replay them.

A whole track is matched by a hidden Markov model (Newson and Krumm 2009). Its states are the edges near a point. The
distance of a point from its edge has a normal distribution, and the detour of the route between two points beyond the
straight line has an exponential distribution. The Viterbi algorithm finds the likeliest edges.
"""

import csv
import os
from collections.abc import Iterable, Iterator, Mapping
from itertools import islice, pairwise
from math import ceil, hypot, inf, isfinite
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gamms import kernels
from gamms.arguments import as_float, as_name, as_path, as_positive, names_keywords
from gamms.bridge.feeds import FixLike
from gamms.bridge.lines import as_fix
from gamms.context import Context, create_context
from gamms.errors import BadFile, BadType, BadValue, MissingFile, UnknownType
from gamms.graph.finding import read_gpx, seconds_of
from gamms.ir.geometry import NearLines, nearest_on
from gamms.ir.graph import FloatArray, IntArray, shortest_edges
from gamms.limits import refuse_above
from gamms.text import from_cell, shown
from gamms.typing import IGraph
from gamms.typing.game import State

_MOST_POINTS = 1_000_000
_MOST_TURNS = 1_000_000
# bytes of memory: for each byte of a CSV file of short lines, and for a line
_PER_BYTE = 24
_LINE_BYTES = 150
_CANDIDATES = 8  # edges of a point
_DETOUR_M = 10.0  # mean detour of routes beyond the straight line
_LONGEST_DETOUR_M = 500.0
_COLUMNS = {
    "time": ("time", "t", "timestamp"),
    "agent": ("agent", "name"),
    "lat": ("lat", "latitude"),
    "lon": ("lon", "longitude"),
    "x": ("x",),
    "y": ("y",),
}

Tracks = Iterable[str | os.PathLike[str]] | Mapping[str, str | os.PathLike[str] | Iterable[FixLike]]


class TrackMatch(NamedTuple):
    """The quality of a track's match to the roads.

    Attributes:
        agent: the name of the agent.
        points: the number of points with a time.
        off_road: the number of matched points that are too far from every road.
        parts: the number of parts between which no road leads.
        off_m: the mean distance of the points from their roads, map units; NaN if no point is on a road.
    """

    agent: str
    points: int
    off_road: int
    parts: int
    off_m: float


class _Track(NamedTuple):
    """The measured points of a track."""

    times: FloatArray  # (points,) in order
    xy: FloatArray  # (points, 2)


class _EdgeCandidate(NamedTuple):
    """A candidate position of a point: on an edge, at an offset."""

    edge: int  # row
    offset: float  # from its source, in the unit of lengths
    off: float  # from the point


class _TrackPart(NamedTuple):
    """A part of a track that follows the roads without a gap."""

    nodes: list[int]  # ids
    node_at: FloatArray  # (nodes,) distance of each node from the start
    times: FloatArray  # (knots,) times
    along: FloatArray  # (knots,) distances from the start at these times


@names_keywords
def recording_from_tracks(
    tracks: Tracks,
    graph: Context | str | os.PathLike[str],
    path: str | os.PathLike[str],
    *,
    turn_seconds: float = 1.0,
    noise_m: float = 5.0,
    within_m: float = 50.0,
    overwrite: bool = False,
) -> list[TrackMatch]:
    """Write a recording in which agents follow tracks along the roads.

    The game measures moves in meters: after each turn an agent is at the position of its track at that time, on the
    edge. An agent is in the game from the first time of its track to the last. Across a gap between roads it jumps to
    the next part of its track.

    Args:
        tracks: GPX and CSV files; or a mapping from the names of agents to files, or to fixes with `t`. A CSV file
            has columns `time` (or `t`), `lat` and `lon` or `x` and `y`, and optionally `agent`.
        graph: a context with the map, or the file of a map, `.gamms`.
        path: the file of the recording.
        turn_seconds: the length of a turn.
        noise_m: the standard deviation of the errors of the positions.
        within_m: points that are farther from every road do not count.
        overwrite: whether the recording may replace a file.

    Returns:
        How well each track fits the roads, sorted by name.

    Raises:
        FileNotFoundError: a file does not exist.
        BadFile (ValueError): a file is not GPX or CSV, is damaged or too large, or has no times.
        BadValue (ValueError): a track does not touch a road, or an argument is impossible.
    """
    seconds, noise, within = (
        as_positive(value, name)
        for value, name in ((turn_seconds, "turn_seconds"), (noise_m, "noise_m"), (within_m, "within_m"))
    )
    with _empty_copy(graph) as ctx:
        points = dict(sorted(_read_all(tracks, ctx.graph.graph).items()))
        if not points:
            raise BadValue("There are no tracks: give GPX or CSV files, or a mapping from names to fixes.")
        matcher = _Matcher(ctx, noise, within)
        found = {name: matcher.match(name, one) for name, one in points.items()}
        began = min(parts[0].times[0] for parts, _ in found.values())
        turns = ceil((max(parts[-1].times[-1] for parts, _ in found.values()) - began) / seconds)
        if turns > _MOST_TURNS:
            raise BadValue(
                f"The tracks last {turns * seconds:,.0f} s, which are {turns:,} turns of {seconds:g} s, and "
                f"{_MOST_TURNS:,} are allowed. Give a greater turn_seconds."
            )
        _play(ctx, {name: parts for name, (parts, _) in found.items()}, began, turns, seconds, path, overwrite)
    return [report for _, report in found.values()]


def _empty_copy(graph: object) -> Context:
    """Return a context with the map and without agents."""
    if isinstance(graph, Context):
        ctx = graph.fork(0)[0]
        for name in list(ctx.agent.agents):
            ctx.agent.delete_agent(name)
        return ctx
    if not isinstance(graph, (str, os.PathLike)):
        raise BadType(f"graph must be a context or the file of a map, not {shown(graph)}.")
    ctx = create_context(seed=0)
    try:
        ctx.graph.load(graph)
    except BaseException:
        ctx.terminate()
        raise
    return ctx


# -- files ----------------------------------------------------------------------------------------------------------


def _read_all(tracks: object, graph: IGraph) -> dict[str, _Track]:
    """Return the points of each track by the name of its agent."""
    rows: dict[str, list[FloatArray]] = {}
    if isinstance(tracks, Mapping):
        for key, given in tracks.items():
            name = as_name(key, "an agent")
            is_file = isinstance(given, (str, os.PathLike))
            parts = (
                [part for _, part in _read(as_path(given, "A track"), graph)] if is_file else [_of_fixes(given, graph)]
            )
            rows[name] = parts
    elif isinstance(tracks, Iterable) and not isinstance(tracks, (str, bytes)):
        for file in tracks:
            for name, part in _read(as_path(file, "A track"), graph):
                rows.setdefault(name, []).append(part)
    else:
        raise BadType(f"tracks must be a list of files, or a mapping from names to files, not {shown(tracks)}.")
    return {name: _in_order(name, np.concatenate(parts)) for name, parts in rows.items()}


def _in_order(name: str, rows: FloatArray) -> _Track:
    """Return rows (time, x, y) sorted by time, with the first row of each time only."""
    timed = rows[np.isfinite(rows).all(axis=1)]
    if not len(timed):
        raise BadFile(f"The track of {shown(name)} has no point with both a time and a position.")
    _, first = np.unique(timed[:, 0], return_index=True)
    return _Track(timed[first, 0], timed[first, 1:])


def _read(file: Path, graph: IGraph) -> Iterator[tuple[str, FloatArray]]:
    """Yield the name and the rows (time, x, y) of each part of a file."""
    if file.suffix.lower() == ".gpx":
        for part in read_gpx(file):
            x, y = graph.from_latlon(lat=part.latlon[:, 0], lon=part.latlon[:, 1])
            yield part.name or file.stem, np.column_stack([part.times, x, y])
    elif file.suffix.lower() == ".csv":
        yield from _read_csv(file, graph)
    else:
        raise UnknownType(f"No tracks are read from {file.suffix or 'a file without a suffix'!r}: give .gpx or .csv.")


def _read_csv(file: Path, graph: IGraph) -> Iterator[tuple[str, FloatArray]]:
    if not file.is_file():
        raise MissingFile("a CSV track", file)
    refuse_above(min(_PER_BYTE * file.stat().st_size, _LINE_BYTES * _MOST_POINTS), f"Reading {str(file)!r}")
    rows: dict[str, list[tuple[float, float, float]]] = {}
    at_line = ""
    try:
        with file.open(newline="", encoding="utf-8-sig") as stream:
            reader = csv.reader(stream)
            at = _columns_of(next(reader, []))
            keys = ("x", "y") if "x" in at and "y" in at else ("lat", "lon")
            for row in filter(None, islice(reader, _MOST_POINTS)):
                at_line = f"line {reader.line_num}: "
                name = from_cell(row[at["agent"]]) if "agent" in at else file.stem
                place = float(row[at[keys[0]]]), float(row[at[keys[1]]])
                rows.setdefault(name, []).append((_time_of(row[at["time"]]), *place))
            is_too_long = next(reader, None) is not None
        at_line = ""
        found = {name: _in_map_units(np.array(one, np.float64), keys, graph) for name, one in rows.items()}
    except (csv.Error, ValueError, IndexError) as error:
        raise BadFile(
            f"{str(file)!r} cannot be used as a CSV file of tracks: {at_line}{str(error).rstrip('.')}."
        ) from None
    if is_too_long:
        raise BadFile(f"{str(file)!r} has more than {_MOST_POINTS:,} rows. Split it.")
    yield from found.items()


def _in_map_units(points: FloatArray, keys: tuple[str, str], graph: IGraph) -> FloatArray:
    """Convert rows (time, lat, lon) to rows (time, x, y) in map units, if `keys` says so."""
    if keys == ("lat", "lon"):
        points[:, 1], points[:, 2] = graph.from_latlon(lat=points[:, 1], lon=points[:, 2])
    return points


def _columns_of(header: list[str]) -> dict[str, int]:
    names = [name.strip().lower() for name in header]
    at: dict[str, int] = {}
    for key, known in _COLUMNS.items():
        found = [names.index(one) for one in known if one in names]
        if found:
            at[key] = found[0]
    if "time" not in at or not ({"lat", "lon"} <= at.keys() or {"x", "y"} <= at.keys()):
        raise ValueError(f"its columns are {shown(names)}, and it needs time, and lat and lon or x and y")
    return at


def _time_of(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return seconds_of(text.strip())


def _of_fixes(given: object, graph: IGraph) -> FloatArray:
    if not isinstance(given, Iterable):
        raise BadType(f"A track is a file or a list of fixes, not {shown(given)}.")
    rows = []
    for fix in map(as_fix, given):
        if fix.flaw is not None or fix.t is None:
            rows.append((np.nan, np.nan, np.nan))
        elif fix.x is not None and fix.y is not None:
            rows.append((fix.t, fix.x, fix.y))
        else:
            rows.append((fix.t, *graph.from_latlon(lat=as_float(fix.lat, "lat"), lon=as_float(fix.lon, "lon"))))
    return np.array(rows, np.float64).reshape(-1, 3)


# -- matching -------------------------------------------------------------------------------------------------------


class _Matcher:
    """Matches tracks to the roads of one map."""

    def __init__(self, ctx: Context, noise_m: float, within_m: float) -> None:
        graph = ctx.graph.graph
        columns = ctx.graph.columns()
        if not len(columns.edge_ids):
            raise BadValue("The map has no edges, so tracks cannot be matched to it.")
        self._graph = graph
        self._columns = columns
        self._noise_m = noise_m
        self._within_m = within_m
        ends = np.stack((columns.xy[columns.sources], columns.xy[columns.targets]), axis=1)
        self._lines = [columns.polylines.get(row, line) for row, line in enumerate(ends)]
        self._tree = NearLines(self._lines)
        self._sources = columns.node_ids[columns.sources].tolist()
        self._targets = columns.node_ids[columns.targets].tolist()
        self._shortest = shortest_edges(columns)
        self._search = kernels.Search(ctx.graph.routes.arcs(), columns.node_ids)

    def match(self, name: str, points: _Track) -> tuple[list[_TrackPart], TrackMatch]:
        """Return the parts of a track, and how well it matches."""
        kept = self._distant_points(points)
        candidates = self._candidates(points.xy[kept])
        near = [at for at, some in enumerate(candidates) if some]
        if not near:
            raise BadValue(
                f"No point of the track of {shown(name)} is within {self._within_m:g} of a road. Check the map and its "
                "crs, or give a greater within_m."
            )
        rows = [kept[at] for at in near]
        runs = self._likeliest_runs(points.xy[rows], [candidates[at] for at in near])
        parts = []
        off = []
        for start, run in runs:
            stop = start + len(run)
            until = rows[stop] if stop < len(rows) else len(points.times)
            parts.append(self._part(run, rows[start:stop], points.times[:until]))
            off += [one.off for one in run]
        return parts, TrackMatch(name, len(points.times), len(kept) - len(near), len(parts), float(np.mean(off)))

    def _distant_points(self, points: _Track) -> list[int]:
        """Return the indices of points that are farther from the last kept one than measurement errors explain."""
        kept = [0]
        xy = points.xy.tolist()
        for at, (x, y) in enumerate(xy):
            before = xy[kept[-1]]
            if hypot(x - before[0], y - before[1]) > 2.0 * self._noise_m:
                kept.append(at)
        return kept

    def _candidates(self, xy: FloatArray) -> list[list[_EdgeCandidate]]:
        found: list[list[_EdgeCandidate]] = [[] for _ in range(len(xy))]
        points, lines, off = self._tree.within(xy, self._within_m)
        for at in np.lexsort((lines, off, points)).tolist():
            some = found[points[at]]
            if len(some) < _CANDIDATES:
                edge = int(lines[at])
                share, _ = nearest_on(self._lines[edge], (float(xy[points[at], 0]), float(xy[points[at], 1])))
                some.append(_EdgeCandidate(edge, share * self._length(edge), float(off[at])))
        return found

    def _length(self, edge: int) -> float:
        """Return the length of the shortest edge between the ends of an edge."""
        return self._shortest[self._sources[edge], self._targets[edge]]

    def _likeliest_runs(
        self, xy: FloatArray, candidates: list[list[_EdgeCandidate]]
    ) -> list[tuple[int, list[_EdgeCandidate]]]:
        """Return the likeliest candidates by Viterbi, for each part: (number of its first point, candidates)."""
        costs = self._emissions(candidates[0])
        backs: list[IntArray] = [np.full(len(costs), -1)]
        ends: list[tuple[int, int]] = []  # (number of the last point, its candidate) of each finished part
        for at, some in enumerate(candidates[1:], 1):
            straight = hypot(*(xy[at] - xy[at - 1]).tolist())
            ways = self._road_distances(candidates[at - 1], some, straight)
            totals = costs[:, None] + np.abs(ways - straight) / _DETOUR_M
            if np.isfinite(totals).any():
                backs.append(totals.argmin(axis=0))
                costs = totals.min(axis=0) + self._emissions(some)
                costs -= costs.min()
            else:  # no road leads on
                ends.append((at - 1, int(costs.argmin())))
                backs.append(np.full(len(some), -1))
                costs = self._emissions(some)
        ends.append((len(candidates) - 1, int(costs.argmin())))
        return [self._trace_back(candidates, backs, *end) for end in ends]

    def _emissions(self, some: list[_EdgeCandidate]) -> FloatArray:
        return np.array([0.5 * (one.off / self._noise_m) ** 2 for one in some])

    def _trace_back(
        self, candidates: list[list[_EdgeCandidate]], backs: list[IntArray], at: int, chosen: int
    ) -> tuple[int, list[_EdgeCandidate]]:
        run = [candidates[at][chosen]]
        while backs[at][chosen] >= 0:
            chosen = int(backs[at][chosen])
            at = at - 1
            run.append(candidates[at][chosen])
        return at, run[::-1]

    def _road_distances(self, before: list[_EdgeCandidate], after: list[_EdgeCandidate], straight: float) -> FloatArray:
        """Return road distances (before, after) between candidates; infinity for long detours."""
        sources = self._columns.sources
        targets = self._columns.targets
        ends = {int(sources[one.edge]) for one in after}
        ways = np.full((len(before), len(after)), inf)
        found = {start: self._distances(start, ends) for start in {int(targets[one.edge]) for one in before}}
        for i, one in enumerate(before):
            between = found[int(targets[one.edge])]
            for k, other in enumerate(after):
                if self._stays(one, other):
                    ways[i, k] = max(0.0, other.offset - one.offset)
                else:
                    rest = self._length(one.edge) - one.offset + other.offset
                    ways[i, k] = between.get(int(sources[other.edge]), inf) + rest
        ways[ways > straight + _LONGEST_DETOUR_M] = inf
        return ways

    def _stays(self, one: _EdgeCandidate, other: _EdgeCandidate) -> bool:
        """Return whether the agent is still on its edge: ahead, or behind within the measurement error."""
        return one.edge == other.edge and one.offset - other.offset <= 2.0 * self._noise_m

    def _distances(self, start: int, ends: set[int]) -> dict[int, float]:
        """Return the distances from the row of a node to other rows."""
        goals = sorted(ends)
        far, _ = self._search.far(np.array([start]), np.array(goals, np.int64))
        return dict(zip(goals, far.tolist(), strict=True))

    def _part(self, run: list[_EdgeCandidate], rows: list[int], known: FloatArray) -> _TrackPart:
        """Return the part through these candidates; `known` are the times up to the end of the part."""
        first = run[0]
        nodes = [self._sources[first.edge], self._targets[first.edge]]
        node_at = [0.0, self._length(first.edge)]
        times = [float(known[rows[0]])]
        along = [first.offset]
        for (one, other), (before, row) in zip(pairwise(run), pairwise(rows), strict=True):
            if self._stays(one, other):
                here = max(along[-1], node_at[-2] + other.offset)
            else:
                between = self._graph.shortest_path(nodes[-1], self._sources[other.edge])
                for node in (*between[1:], self._targets[other.edge]):
                    node_at.append(node_at[-1] + self._shortest[nodes[-1], node])
                    nodes.append(node)
                here = max(along[-1], node_at[-2] + other.offset)
            if row - before > 1:  # the agent hardly moved until the point before
                times.append(float(known[row - 1]))
                along.append(along[-1])
            times.append(float(known[row]))
            along.append(here)
        if len(known) > rows[-1] + 1:  # the agent hardly moves after the last point
            times.append(float(known[-1]))
            along.append(along[-1])
        return _TrackPart(nodes, np.array(node_at), np.array(times), np.array(along))


# -- playing --------------------------------------------------------------------------------------------------------


class _TrackFollower:
    """Moves an agent along its track."""

    def __init__(self, parts: list[_TrackPart]) -> None:
        self._parts = parts
        self._at = 0
        self._gone = 0.0
        self._action: list[int] | None = None

    @property
    def start(self) -> int:
        """The start node of the track."""
        return self._parts[0].nodes[0]

    def is_there(self, since: float, until: float) -> bool:
        """Return whether the track covers a part of a turn, apart from the turn's first moment."""
        return bool(self._parts[0].times[0] <= until and since < self._parts[-1].times[-1])

    def prepare(self, ctx: Context, name: str, time: float, seconds: float) -> None:
        """Plan the agent's move to the position of its track at the end of the turn that begins at `time`."""
        agent: Any = ctx.agent.get_agent(name)
        is_there = self.is_there(time, time + seconds)
        if agent.alive != is_there:
            agent.alive = is_there
        later = self._at
        while later + 1 < len(self._parts) and self._parts[later + 1].times[0] <= time + seconds:
            later += 1
        if later != self._at:
            self._at = later
            self._gone = 0.0
            agent.current_node_id = self._parts[later].nodes[0]
        part = self._parts[self._at]
        wanted = float(np.interp(time + seconds, part.times, part.along))
        distance = wanted - self._gone
        self._action = None
        if distance > 1e-6:
            first = int(np.searchsorted(part.node_at, self._gone, "right")) - 1
            last = int(np.searchsorted(part.node_at, wanted, "left")) + 1
            self._action = part.nodes[max(first, 0) : last + 1]
            agent.speed = distance
            self._gone = wanted

    def decide(self, state: State) -> None:
        """Set the action of the agent."""
        state["action"] = self._action


def _play(
    ctx: Context,
    tracks: dict[str, list[_TrackPart]],
    began: float,
    turns: int,
    seconds: float,
    path: str | os.PathLike[str],
    overwrite: bool,
) -> None:
    journeys = {name: _TrackFollower(parts) for name, parts in tracks.items()}
    ctx.game.speed_unit = "metres"
    for name, journey in journeys.items():
        agent = ctx.agent.create_agent(name, start_node_id=journey.start, speed=1.0, strategy=journey.decide)
        agent.alive = journey.is_there(-inf, began)

    def follow_tracks(ctx: Context) -> None:
        for name, journey in journeys.items():
            journey.prepare(ctx, name, began + ctx.game.turn * seconds, seconds)

    ctx.game.add(follow_tracks, phase="before")
    created = int(began) if isfinite(began) and began >= 0.0 else None
    ctx.record.start(path, created=created, overwrite=overwrite)
    ctx.game.run(turns)
    ctx.record.stop()
