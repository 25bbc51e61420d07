"""Recordings of real journeys: tracks from GPX and CSV files, matched to the roads, are replayed in a game.

`gamms.graph.tracks` reads and matches the tracks.
"""

import os
from collections.abc import Iterable, Mapping
from math import ceil, inf, isfinite
from typing import Any, NamedTuple

import numpy as np

from gamms.arguments import as_float, as_name, as_path, as_positive, explain_call_errors, refuse_finer_time
from gamms.bridge.feeds import FixLike
from gamms.bridge.lines import as_fix
from gamms.context import Context, create_context
from gamms.errors import BadFile, BadType, BadValue
from gamms.graph.tracks import MatchedPoints, TrackMatch, TrackMatcher, TrackPoints, join_matches, read_tracks
from gamms.ir.graph import FloatArray
from gamms.text import shown
from gamms.typing import IGraph
from gamms.typing.game import State

_MOST_TURNS = 1_000_000

Tracks = Iterable[str | os.PathLike[str]] | Mapping[str, str | os.PathLike[str] | Iterable[FixLike]]


class _TimedPart(NamedTuple):
    """A part of a journey along the roads without a gap."""

    nodes: list[int]  # ids
    node_at: FloatArray  # (nodes,) distance of each node from the start
    times: FloatArray  # (knots,) times
    along: FloatArray  # (knots,) distances from the start at these times


@explain_call_errors
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
        BadValue (ValueError): a track does not touch a road, its times are in milliseconds or a finer unit, or an
            argument is impossible.
    """
    seconds, noise, within = (
        as_positive(value, name)
        for value, name in ((turn_seconds, "turn_seconds"), (noise_m, "noise_m"), (within_m, "within_m"))
    )
    with _copy_map(graph) as ctx:
        points = dict(sorted(_read_all(tracks, ctx.graph.graph).items()))
        if not points:
            raise BadValue("There are no tracks: give GPX or CSV files, or a mapping from names to fixes.")
        columns = ctx.graph.columns()
        matcher = TrackMatcher(ctx.graph.graph, ctx.graph.routes, columns, noise, within)
        matched = {name: matcher.match(one) for name, one in points.items()}
        found = {name: _time_parts(points[name], one, within) for name, one in matched.items()}
        began = min(parts[0].times[0] for parts in found.values())
        turns = ceil((max(parts[-1].times[-1] for parts in found.values()) - began) / seconds)
        if turns > _MOST_TURNS:
            raise BadValue(
                f"The tracks last {turns * seconds:,.0f} s, which are {turns:,} turns of {seconds:g} s, and "
                f"{_MOST_TURNS:,} are allowed. Give a greater turn_seconds."
            )
        _play(ctx, found, began, turns, seconds, path, overwrite)
    return [join_matches([one]) for one in matched.items()]


def _copy_map(graph: object) -> Context:
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


def _read_all(tracks: object, graph: IGraph) -> dict[str, TrackPoints]:
    """Return the points of each track by the name of its agent."""
    parts: dict[str, list[TrackPoints]] = {}
    if isinstance(tracks, Mapping):
        for key, given in tracks.items():
            name = as_name(key, "an agent")
            if isinstance(given, (str, os.PathLike)):
                parts[name] = list(read_tracks(as_path(given, "A track"), graph))
            else:
                parts[name] = [_read_fixes(given, graph)]
    elif isinstance(tracks, Iterable) and not isinstance(tracks, (str, bytes)):
        for file in tracks:
            for part in read_tracks(as_path(file, "A track"), graph):
                parts.setdefault(part.name, []).append(part)
    else:
        raise BadType(f"tracks must be a list of files, or a mapping from names to files, not {shown(tracks)}.")
    return {name: _sort_parts(name, some) for name, some in parts.items()}


def _sort_parts(name: str, parts: list[TrackPoints]) -> TrackPoints:
    """Return points sorted by time, with the first point of each time only."""
    times = np.concatenate([np.empty(0), *(part.times for part in parts)])
    xy = np.concatenate([np.empty((0, 2)), *(part.xy for part in parts)])
    is_usable = np.isfinite(times) & np.isfinite(xy).all(axis=1)
    if not is_usable.any():
        raise BadFile(f"The track of {shown(name)} has no point with both a time and a position.")
    found, first = np.unique(times[is_usable], return_index=True)
    refuse_finer_time(float(found[np.abs(found).argmax()]), f"A time of the track of {shown(name)}")
    return TrackPoints(name, found, xy[is_usable][first])


def _read_fixes(given: object, graph: IGraph) -> TrackPoints:
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
    found = np.array(rows, np.float64).reshape(-1, 3)
    return TrackPoints("", found[:, 0], found[:, 1:])


def _time_parts(points: TrackPoints, matched: MatchedPoints, within_m: float) -> list[_TimedPart]:
    if not matched.parts:
        raise BadValue(
            f"No point of the track of {shown(points.name)} is within {within_m:g} of a road. Check the map and its "
            "crs, or give a greater within_m."
        )
    return [_TimedPart(one.nodes, one.node_at, points.times[one.points], one.along) for one in matched.parts]


# -- playing --------------------------------------------------------------------------------------------------------


class _TrackFollower:
    """Moves an agent along its track."""

    def __init__(self, parts: list[_TimedPart]) -> None:
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
    tracks: dict[str, list[_TimedPart]],
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
