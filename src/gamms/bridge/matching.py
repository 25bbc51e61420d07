"""Match a robot to the roads: check single fixes, and find the robot's position on its planned route.

A live robot is first looked for on its planned route, not far behind its last position and no farther ahead than it can
have driven: map matching by the connections of the network (White, Bernstein and Kornhauser 2000, algorithm 3,
bounded). Whole tracks are matched in `tracks.py`.
"""

from collections import Counter, deque
from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from math import hypot, inf
from typing import Literal, NamedTuple, get_args

import numpy as np

from gamms import kernels
from gamms.arguments import as_choice, as_positive
from gamms.bridge.feeds import ReceivedFix
from gamms.bridge.lines import Fix
from gamms.errors import BadValue
from gamms.ir.graph import FloatArray, GraphColumns
from gamms.typing import IGraph
from gamms.typing.game import Move
from gamms.typing.on_edges import cut_line

_AGREEING = 3  # outliers in a row that agree with each other: the robot was carried there
_DRIFT = 1e-3  # largest drift of a clock in real time, seconds per second
_WINDOW = 5.0  # how far the rate of a clock is looked back for, times the largest age of a fix
_MOST_ARRIVALS = 50  # in a window
_LEAST_ARRIVALS = 3  # for a rate other than 1

XY = tuple[float, float]
Stamps = Literal["any", "real", "arrival"]


class FixChecks(NamedTuple):
    """Conditions that a fix must meet to count.

    Attributes:
        within_m: the largest distance from the road in meters, which is also the largest error of positions.
        max_speed: the top speed of the robot in meters per second.
        max_age_s: seconds after which a fix is stale.
        stamps: the clock of the times `t` in fixes: "any", which may run at another rate than real time and be paused,
            as that of a simulator; "real", which runs in real time, so that a fix is late as long as its link is; or
            "arrival", which takes fixes as measured when they arrive and uses `t` only for their order.
    """

    within_m: float = 30.0
    max_speed: float = 40.0
    max_age_s: float = 2.0
    stamps: Stamps = "any"

    def checked(self) -> "FixChecks":
        """Return the conditions as checked plain values.

        Raises:
            BadType, BadValue: a value is not a positive number, or `stamps` is not one of its values.
        """
        as_choice(self.stamps, "stamps of FixChecks", get_args(Stamps))
        within_m, max_speed, max_age_s = (
            as_positive(getattr(self, name), f"{name} of FixChecks") for name in ("within_m", "max_speed", "max_age_s")
        )
        return FixChecks(within_m, max_speed, max_age_s, self.stamps)


class MeasuredPosition(NamedTuple):
    """A measured position of a robot, with its time and heading."""

    xy: XY  # map units
    at: float  # by the clock of the feed
    heading: float | None  # degrees clockwise from north


class _Arrival(NamedTuple):
    """The arrival of a fix."""

    t: float  # when the fix was measured, by the clock of the sender
    at: float  # when it arrived, by our clock


class SenderClock:
    """Estimates when fixes were measured, from the times that their sender gives.

    Nothing is known about the clock of the sender but that it does not go back. The least delay counts as zero
    (Cristian 1989), in a window of arrivals: by a clock in real time, and by one at another rate. The rate is that of
    the line below all arrivals which is nearest to them (Moon, Skelly and Towsley 1999). A fix is late if it is late by
    both. So a link that gets slower is noticed, and after half a window it cannot be told from a clock that has stood.

    Args:
        checks: the conditions for fixes, with the kind of the clock.
    """

    def __init__(self, checks: FixChecks) -> None:
        self._stamps = checks.stamps
        self._max_age_s = checks.max_age_s
        self._window_s = _WINDOW * checks.max_age_s
        self._arrivals: deque[_Arrival] = deque()
        self._last = _Arrival(-inf, -inf)
        self._kept_since = -inf  # when the first of the arrivals came that the last one stands for
        self._least = inf  # the least offset from a clock in real time to ours, and when it was updated
        self._least_at = 0.0
        self._last_measured = -inf

    def convert_time(self, t: float, at: float) -> float:
        """Return the time of a measurement by our clock.

        Args:
            t: the time of the measurement by the clock of the sender, not before that of the last call.
            at: the time of the arrival.
        """
        if self._stamps == "arrival":
            delay = 0.0
        elif self._stamps == "real":
            delay = self._estimate_delay_in_real_time(t, at)
        else:
            delay = self._estimate_delay(_Arrival(t, at))
        self._last_measured = max(self._last_measured, min(at, at - delay))
        return self._last_measured

    def _estimate_delay_in_real_time(self, t: float, at: float) -> float:
        drift = _DRIFT * (at - self._least_at)
        self._least = min(at - t, self._least + drift)
        self._least_at = at
        return at - t - self._least

    def _estimate_delay(self, new: _Arrival) -> float:
        self._add(new)
        delay = new.at - new.t - min(one.at - one.t for one in self._arrivals)
        span_s = new.at - self._arrivals[0].at
        if len(self._arrivals) >= _LEAST_ARRIVALS and span_s >= self._max_age_s / 2.0:
            delay = min(delay, _estimate_delay_at_own_rate(self._arrivals, new))
        return max(0.0, delay)

    def _add(self, new: _Arrival) -> None:
        """Keep an arrival; of those close together, keep the least delayed one."""
        arrivals = self._arrivals
        if arrivals and new.t - self._last.t > new.at - self._last.at + self._max_age_s:
            arrivals.clear()  # the clock of the sender has been put forward, or the link is fast again
        self._last = new
        while arrivals and new.at - arrivals[0].at > self._window_s:
            arrivals.popleft()
        if not arrivals or new.at - self._kept_since >= self._window_s / _MOST_ARRIVALS:
            arrivals.append(new)
            self._kept_since = new.at
        elif new.at - new.t < arrivals[-1].at - arrivals[-1].t:
            arrivals[-1] = new


def _estimate_delay_at_own_rate(arrivals: Sequence[_Arrival], new: _Arrival) -> float:
    """Return how far an arrival is above the line that is below all arrivals and nearest to them on average."""
    hull: list[_Arrival] = []  # convex, from below
    for one in arrivals:
        if hull and one.t <= hull[-1].t:
            continue
        while len(hull) >= 2 and _compute_slope(hull[-2], one) <= _compute_slope(hull[-2], hull[-1]):
            hull.pop()
        hull.append(one)
    if len(hull) < 2:
        return inf
    middle = sum(one.t / len(arrivals) for one in arrivals)
    begin, end = next((pair for pair in pairwise(hull) if pair[1].t >= middle), (hull[-2], hull[-1]))
    return new.at - begin.at - _compute_slope(begin, end) * (new.t - begin.t)


def _compute_slope(one: _Arrival, other: _Arrival) -> float:
    return (other.at - one.at) / (other.t - one.t)


class PositionTracker:
    """Filters the fixes of one robot and keeps its last plausible position.

    A fix is measured before it arrives; `SenderClock` estimates how long before.

    Args:
        checks: the conditions for each fix.
        to_xy: converts latitude and longitude in degrees to map units; raises BadValue if that is impossible.

    Attributes:
        last: the last position that counts.
        counts: "taken", "off_map", "out_of_order", "outlier".
    """

    def __init__(self, checks: FixChecks, to_xy: Callable[[float, float], XY]) -> None:
        self._checks = checks
        self._to_xy = to_xy
        self.last: MeasuredPosition | None = None
        self.counts: Counter[str] = Counter()
        self._clock = SenderClock(checks)
        self._newest: ReceivedFix | None = None  # the newest fix with a time of the sender
        self._odd: list[MeasuredPosition] = []  # the last outliers, which agree with each other

    def take(self, received: Iterable[ReceivedFix]) -> None:
        """Judge the received fixes in order, and update the last position."""
        for one in received:
            self.counts[self._judge(one)] += 1

    def compute_age(self, now: float) -> float:
        """Return the age of the last position in seconds; infinity if there is no position."""
        return inf if self.last is None else max(0.0, now - self.last.at)

    def _judge(self, received: ReceivedFix) -> str:
        fix = received.fix
        xy = self._find_position(fix)
        if xy is None:
            return "off_map"
        at = self._find_time(received)
        if at is None or (self.last is not None and at < self.last.at):
            return "out_of_order"
        place = MeasuredPosition(xy, at, fix.heading)
        if self.last is not None and not self._can_follow(self.last, place):
            self._odd = [*self._odd, place] if self._odd and self._can_follow(self._odd[-1], place) else [place]
            if len(self._odd) < _AGREEING:
                return "outlier"
        self._odd = []
        self.last = place
        return "taken"

    def _find_position(self, fix: Fix) -> XY | None:
        if fix.x is not None and fix.y is not None:
            return fix.x, fix.y
        if fix.lat is None or fix.lon is None:
            return None
        try:
            return self._to_xy(fix.lat, fix.lon)
        except BadValue:
            return None

    def _find_time(self, received: ReceivedFix) -> float | None:
        """Return the time of a fix's measurement by our clock; None: a newer fix has arrived already."""
        fix, at = received
        newest = self._newest
        if fix.t is None:
            return at
        if newest is not None and fix.t < (newest.fix.t or 0.0):
            if at - newest.at <= self._checks.max_age_s:
                return None
            self._clock = SenderClock(self._checks)  # the sender's clock has restarted
        self._newest = received
        return self._clock.convert_time(fix.t, at)

    def _can_follow(self, before: MeasuredPosition, after: MeasuredPosition) -> bool:
        reach = self._checks.max_speed * max(0.0, after.at - before.at) + self._checks.within_m
        return hypot(after.xy[0] - before.xy[0], after.xy[1] - before.xy[1]) <= reach


class RoutePoint(NamedTuple):
    """The point of a route that is nearest to a position."""

    along: float  # map units from the start of the route
    off: float  # map units from the position


class RoadRoute:
    """A route along roads for a robot to follow.

    Args:
        points: (points, 2) of its line.
        nodes: ids of its nodes, in order.
        node_at: the distance of each node from the start of the route, map units.
    """

    def __init__(self, points: FloatArray, nodes: list[int], node_at: list[float]) -> None:
        self.points = points
        self.nodes = nodes
        self._node_at = node_at
        self._steps = np.diff(points, axis=0)
        self._lengths = np.hypot(self._steps[:, 0], self._steps[:, 1])
        self._divisors = np.where(self._lengths > 0.0, self._lengths, 1.0)
        self._begins = np.concatenate([[0.0], np.cumsum(self._lengths)])
        self.length = float(self._begins[-1])

    def find_nearest(self, xy: XY, low: float = 0.0, high: float = inf) -> RoutePoint:
        """Return the point nearest to `xy` between the distances `low` and `high` from the start."""
        if not len(self._lengths):
            return RoutePoint(0.0, hypot(xy[0] - self.points[0, 0], xy[1] - self.points[0, 1]))
        starts = self.points[:-1]
        steps = self._steps
        begins = self._begins[:-1]
        low = min(max(low, 0.0), self.length)
        high = max(min(high, self.length), 0.0)
        ahead = ((np.array(xy) - starts) * steps).sum(axis=1) / self._divisors
        ahead = np.clip(np.clip(ahead, 0.0, self._lengths), low - begins, high - begins)
        is_open = (ahead >= 0.0) & (ahead <= self._lengths)
        shares = np.clip(ahead / self._divisors, 0.0, 1.0)
        off = np.where(is_open, np.hypot(*(starts + shares[:, None] * steps - xy).T), inf)
        best = int(off.argmin())
        return RoutePoint(float(begins[best] + ahead[best]), float(off[best]))

    def find_point(self, along: float) -> XY:
        """Return the point at a distance from the start."""
        x, y = (float(np.interp(along, self._begins, self.points[:, axis])) for axis in (0, 1))
        return x, y

    def get_rest(self, along: float) -> FloatArray:
        """Return the rest of the line from a distance on (points, 2)."""
        later = self.points[self._begins > along + 1e-6]
        return np.concatenate([[self.find_point(along)], later])

    def find_last_node(self, along: float) -> int:
        """Return the id of the last node up to a distance from the start; the first node if there is none."""
        return [self.nodes[0], *(node for node, at in zip(self.nodes, self._node_at, strict=True) if at <= along)][-1]


def find_route(graph: IGraph, columns: GraphColumns, move: Move) -> RoadRoute:
    """Return the route of a move, by its legs if the game measures moves in meters."""
    if not move.legs:
        return find_route_along(columns, move.path)
    lines = list[FloatArray]()
    ends = list[int | None]()
    for leg in move.legs:
        line = cut_line(graph.get_edge(leg.edge).points, leg.begin, leg.end)
        lines.append(np.array([point[1:] for point in line], np.float64))
        if leg.end >= 1.0:
            ends.append(leg.target)
        elif leg.end <= 0.0:
            ends.append(leg.source)
        else:
            ends.append(None)
    return _join_lines(lines, move.start, ends)


def find_route_along(columns: GraphColumns, path: Iterable[int]) -> RoadRoute:
    """Return the route along a path of adjacent nodes, by the shortest of parallel edges."""
    nodes = list(path)
    rows = kernels.find_rows(columns.node_ids, np.array(nodes, np.int64), columns.node_order).tolist()
    if len(rows) == 1:
        return RoadRoute(columns.xy[rows], nodes, [0.0])
    lines: list[FloatArray] = []
    for source, target in pairwise(rows):
        out = columns.out_edges[columns.offsets[source] : columns.offsets[source + 1]]
        fit = out[columns.targets[out] == target]
        if len(fit):
            edge = int(fit[columns.lengths[fit].argmin()])
            lines.append(columns.polylines.get(edge, columns.xy[[source, target]]))
        else:  # moves need no edges if `ctx.game.legal` is "any"
            lines.append(columns.xy[[source, target]])
    return _join_lines(lines, nodes[0], nodes[1:])


def _join_lines(lines: list[FloatArray], start: int, ends: Iterable[int | None]) -> RoadRoute:
    """Return the route that joins lines; each line ends at a node, or at None."""
    nodes = [start]
    node_at = [0.0]
    along = 0.0
    for line, end in zip(lines, ends, strict=True):
        along += float(np.hypot(*np.diff(line, axis=0).T).sum())
        if end is not None:
            nodes.append(end)
            node_at.append(along)
    points = np.concatenate([lines[0], *(line[1:] for line in lines[1:])])
    return RoadRoute(points, nodes, node_at)
