"""When and where agents that travel by metres are near each other, exactly: on nodes, on edges, and between both."""

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import chain, pairwise
from math import inf, sqrt
from typing import NamedTuple

import numpy as np

from gamms import kernels
from gamms.context import Context
from gamms.errors import UnknownName
from gamms.ir.agents import Position
from gamms.ir.graph import FloatArray
from gamms.typing.game import Leg, Track
from gamms.typing.graph_values import OSMEdge
from gamms.typing.on_edges import line_along, point_along

TIME_SLACK = 1e-9  # of a turn: agents that are at one place so far apart in time meet there

Visit = tuple[int, float, float]  # node id; from when until when
Meeting = tuple[float, float, bool, str, str, int, int]  # time, distance, on an edge?, a, b, where a was, where b was
Reached = Callable[[int], Mapping[int, float]]  # the nodes that are near enough ahead of a node, with their distances


class EdgesGoneAlong(dict[int, OSMEdge]):
    """id -> edge, of those that agents go along in a turn, which rules may have closed since.

    Raises:
        UnknownName (KeyError): when an edge is asked for that was removed.
    """

    def __init__(self, ctx: Context) -> None:
        super().__init__()
        self._ctx, self.graph = ctx, ctx.graph.graph

    def __missing__(self, id: int) -> OSMEdge:
        """Look an edge up."""
        try:
            found = self.graph.get_edge(id)
        except UnknownName:
            _, closed = self._ctx.graph.storage.roads()
            if id not in closed:
                raise
            edge = closed[id]
            line = edge.get("linestring")
            line = self.graph.positions([edge["source"], edge["target"]]) if line is None else line
            found = OSMEdge(id, edge["source"], edge["target"], edge["length"], line)
        self[id] = found
        return found

    def without_removed(self, legs: Iterable[Leg]) -> Iterator[Leg]:
        """Yield the legs whose edges were not removed: nothing tells where these were."""
        for leg in legs:
            try:
                self[leg.edge]
            except UnknownName:
                continue
            yield leg


class Journey:
    """Where one agent is in the course of a turn.

    Args:
        name: of the agent.
        track: how it has moved.
        at: where one that flies is; it is on no node.

    Attributes:
        visits: the nodes that it is on, from when until when.
        legs: what it covers of which edges.
    """

    def __init__(self, name: str, track: Track, at: Position | None = None) -> None:
        self.name, self.track, self.at = name, track, at
        self.visits, self.legs = visits_of(track), track.legs

    def node_at(self, time: float) -> int:
        """Return the node that it has passed last; it is on a node that it reaches right after the time."""
        passed = [node for node, when in zip(*self.track[:2], strict=True) if when <= time + TIME_SLACK]
        return passed[-1] if passed else self.track.path[0]

    def xy_at(self, edges: "EdgesGoneAlong", time: float) -> tuple[float, float] | None:
        """Return where on the map it is; None where its edge or node is gone."""
        try:
            if self.at is not None:
                return self.at[:2]
            for leg in self.legs:
                if leg.since <= time <= leg.until:
                    return point_along(edges[leg.edge].points, leg.share_at(time))[:2]
            node = edges.graph.get_node(self.node_at(time))
        except UnknownName:
            return None
        return node.x, node.y


def visits_of(track: Track) -> Sequence[Visit]:
    """Return the nodes that an agent was at; the one that it left at once belongs to the turn before."""
    path, times, legs = track
    if legs:
        return _visits_by_legs(track)
    # NOTE: one edge or none is the usual case, and there are as many as agents (benchmarks: turns).
    if len(path) == 1:
        return ((path[0], times[0], 1.0),)
    if len(path) == 2 and path[0] != path[1]:
        return ((path[1], times[1], 1.0),)
    left = [
        after if end == start else now
        for (start, end), (now, after) in zip(pairwise(path), pairwise(times), strict=True)
    ]
    visits = list(zip(path, times, (*left, 1.0), strict=True))
    return visits if path[1] == path[0] else visits[1:]


def _visits_by_legs(track: Track) -> Sequence[Visit]:
    path, times, legs = track
    first = legs[0]
    visits = [(path[0], times[0], first.since)] if first.begin in (0.0, 1.0) and first.since > times[0] else []
    for leg, after in zip(legs, (*legs[1:], None), strict=True):
        if leg.begin != leg.end and leg.end in (0.0, 1.0):
            visits.append((leg.target if leg.end else leg.source, leg.until, 1.0 if after is None else after.since))
    return visits


# -- at one place -------------------------------------------------------------------------------------------------


def on_edges(ours: Sequence[Journey], theirs: Sequence[Journey]) -> Iterator[Meeting]:
    """Yield the pairs that are at one place of a street at one time: who meet, overtake, or stand there."""
    on: dict[int, list[tuple[Journey, Leg]]] = defaultdict(list)
    for one in ours:
        for leg in one.legs:
            on[leg.street].append((one, leg))
    for other in theirs:
        for its in other.legs:
            for one, leg in on.get(its.street, ()):
                time = _first_touch(leg, its)
                if time is not None:
                    yield time, 0.0, True, one.name, other.name, one.node_at(time), other.node_at(time)


def _first_touch(a: Leg, b: Leg) -> float | None:
    """Return when two agents on one street are first at one place of it; None: never, or only when the turn begins."""
    since, until = max(a.since, b.since), min(a.until, b.until)
    if since > until:
        return None
    gaps = [_street_share(a, time) - _street_share(b, time) for time in (since, until)]
    if abs(gaps[0]) <= TIME_SLACK:
        return since if since > 0.0 or abs(gaps[1]) <= TIME_SLACK else None
    if gaps[0] * gaps[1] < 0.0:
        return since + (until - since) * gaps[0] / (gaps[0] - gaps[1])
    return until if abs(gaps[1]) <= TIME_SLACK else None


def _street_share(leg: Leg, time: float) -> float:
    share = leg.share_at(time)
    return share if leg.street == leg.edge else 1.0 - share


# -- in a straight line ---------------------------------------------------------------------------------------------


class _Line(NamedTuple):
    """A straight part of a journey."""

    since: float
    until: float
    begin: Position
    end: Position


def within_euclid(
    edges: EdgesGoneAlong, ours: Sequence[Journey], theirs: Sequence[Journey], limit: float
) -> Iterator[Meeting]:
    """Yield the pairs that are so near in a straight line, each when it first is."""
    lines = {one.name: list(_lines(edges, one)) for one in (*ours, *theirs)}
    ours, theirs = ([one for one in side if lines[one.name]] for side in (ours, theirs))
    if not ours or not theirs:
        return
    low_a, high_a = _boxes([lines[one.name] for one in ours])
    low_b, high_b = _boxes([lines[one.name] for one in theirs])
    reach = with_rim(limit, max(float(np.abs(ends).max()) for ends in (low_a, high_a, low_b, high_b)))
    spread = sum(
        float(np.sqrt(((high - low) ** 2).sum(axis=1).max())) for low, high in ((low_a, high_a), (low_b, high_b))
    )
    rows, columns, _ = kernels.pairs_within((low_a + high_a) / 2, (low_b + high_b) / 2, reach + spread)
    gaps = np.maximum(low_a[rows] - high_b[columns], low_b[columns] - high_a[rows]).clip(0.0)
    near = np.flatnonzero((gaps * gaps).sum(axis=1) <= reach * reach)
    for row, column in zip(rows[near].tolist(), columns[near].tolist(), strict=True):
        one, other = ours[row], theirs[column]
        pairs = ((a, b) for a in lines[one.name] for b in lines[other.name])
        found = [met for a, b in pairs if (met := _first_near(a, b, limit)) is not None]
        if found:
            time, distance = min(found)
            yield time, distance, False, one.name, other.name, one.node_at(time), other.node_at(time)


def with_rim(limit: float, farthest: float) -> float:
    """Return a distance that is longer than any that counts as a limit after rounding, where coordinates are so far."""
    return limit + TIME_SLACK * (limit + farthest)


def _boxes(journeys: Sequence[Sequence[_Line]]) -> tuple[FloatArray, FloatArray]:
    """Return the lowest and the highest coordinates on each journey, (journeys, 3) both."""
    points = np.array([point for lines in journeys for line in lines for point in (line.begin, line.end)])
    begins = np.cumsum([0, *(2 * len(lines) for lines in journeys[:-1])])
    return np.minimum.reduceat(points, begins), np.maximum.reduceat(points, begins)


def _lines(edges: EdgesGoneAlong, one: Journey) -> Iterator[_Line]:
    if one.at is not None:
        yield _Line(one.track.times[0], 1.0, one.at, one.at)
        return
    for node, since, until in one.visits:
        _, x, y = edges.graph.get_node(node)
        yield _Line(since, until, (x, y, 0.0), (x, y, 0.0))
    for leg in edges.without_removed(one.legs):
        yield from _lines_of(edges[leg.edge], leg)


def _lines_of(edge: OSMEdge, leg: Leg) -> Iterator[_Line]:
    """Yield the straight parts of a leg along the polyline of its edge."""
    line = line_along(edge.points, leg.begin, leg.end)
    pace = (leg.until - leg.since) / (leg.end - leg.begin) if leg.end != leg.begin else 0.0
    times = [leg.since, *(leg.since + (share - leg.begin) * pace for share, _, _ in line[1:-1]), leg.until]
    points = [(x, y, 0.0) for _, x, y in line]
    for (since, until), (begin, end) in zip(pairwise(times), pairwise(points), strict=True):
        yield _Line(since, until, begin, end)


def _first_near(a: _Line, b: _Line, limit: float) -> tuple[float, float] | None:
    """Return when two agents on straight parts are first so near, and how near; None: never."""
    since, until = max(a.since, b.since), min(a.until, b.until)
    if since > until:
        return None
    x, y, z = (one - other for one, other in zip(_at(a, since), _at(b, since), strict=True))
    # Squares are compared, which are the same on every machine and in `meetings_in_arrays`.
    far = x * x + y * y + z * z
    if far <= limit * limit:
        return since, sqrt(far)
    last = (one - other for one, other in zip(_at(a, until), _at(b, until), strict=True))
    dx, dy, dz = (then - now for then, now in zip(last, (x, y, z), strict=True))
    square, mixed = dx * dx + dy * dy + dz * dz, x * dx + y * dy + z * dz
    # |gap + share * change| = limit is a quadratic equation; its smaller root is when they come near.
    inside = mixed * mixed - square * (far - limit * limit)
    if square == 0.0 or inside < 0.0:
        return None
    share = (-mixed - sqrt(inside)) / square
    return (since + share * (until - since), limit) if 0.0 <= share <= 1.0 else None


def _at(line: _Line, time: float) -> tuple[float, ...]:
    if line.until <= line.since:
        return line.begin
    share = (time - line.since) / (line.until - line.since)
    return tuple(x + share * (y - x) for x, y in zip(line.begin, line.end, strict=True))


# -- along the edges --------------------------------------------------------------------------------------------------


class _Stretch(NamedTuple):
    """A part of a journey on which the distances to the ends of its edge change evenly.

    Attributes:
        since, until: of the turn.
        street: whose; None on a node.
        places: at the two times, shares of the street.
        length: of the edge.
        exits: how one leaves: node -> metres to it at the two times.
        entries: how one comes: node -> metres from it at the two times.
    """

    since: float
    until: float
    street: int | None
    places: tuple[float, float]
    length: float
    exits: Mapping[int, tuple[float, float]]
    entries: Mapping[int, tuple[float, float]]


def within_metres(
    edges: EdgesGoneAlong, reached: Reached, ours: Sequence[Journey], theirs: Sequence[Journey], limit: float
) -> Iterator[Meeting]:
    """Yield the pairs that are so near by the shorter of the paths there and back, each when it first is."""
    stretches = {one.name: list(_stretches(edges, one)) for one in (*ours, *theirs)}
    ways = _in_reach(reached, stretches, ours, theirs), _in_reach(reached, stretches, theirs, ours)
    near = ways[0] | {(one, other) for other, one in ways[1]}
    names = ({one.name: one for one in side} for side in (ours, theirs))
    of_ours, of_theirs = names
    for name, its in sorted(near):
        one, other = of_ours[name], of_theirs[its]
        pairs = ((a, b) for a in stretches[name] for b in stretches[its])
        found = [met for a, b in pairs if (met := _first_within(reached, a, b, limit)) is not None]
        if found:
            time, distance = min(found)
            yield time, distance, False, name, its, one.node_at(time), other.node_at(time)


def _in_reach(
    reached: Reached, stretches: Mapping[str, Sequence["_Stretch"]], ours: Sequence[Journey], theirs: Sequence[Journey]
) -> set[tuple[str, str]]:
    """Return the pairs on one street, and those where a path leads from one to the other that may be short enough."""
    at: dict[tuple[str, int], set[str]] = defaultdict(set)
    for other in theirs:
        for stretch in stretches[other.name]:
            for node in stretch.entries:
                at["node", node].add(other.name)
            if stretch.street is not None:
                at["street", stretch.street].add(other.name)
    found = set[tuple[str, str]]()
    for one in ours:
        for stretch in stretches[one.name]:
            nodes = {node for exit in stretch.exits for node in reached(exit)}
            keys = [("node", node) for node in nodes]
            keys += [("street", stretch.street)] if stretch.street is not None else []
            found.update((one.name, other) for key in keys if key in at for other in at[key])
    return found


def _stretches(edges: EdgesGoneAlong, one: Journey) -> Iterator[_Stretch]:
    for node, since, until in one.visits:
        here = {node: (0.0, 0.0)}
        yield _Stretch(since, until, None, (0.0, 0.0), 0.0, here, here)
    for leg in edges.without_removed(one.legs):
        length = edges[leg.edge].length
        behind, ahead = (leg.begin * length, leg.end * length), ((1.0 - leg.begin) * length, (1.0 - leg.end) * length)
        exits, entries = {leg.target: ahead}, {leg.source: behind}
        if leg.back is not None:
            exits, entries = {leg.source: behind, **exits}, {leg.target: ahead, **entries}
        yield _Stretch(leg.since, leg.until, leg.street, leg.on_street(), length, exits, entries)


def _first_within(reached: Reached, a: _Stretch, b: _Stretch, limit: float) -> tuple[float, float] | None:
    """Return when two agents on stretches are first so near, and how near; None: never."""
    since, until = max(a.since, b.since), min(a.until, b.until)
    if since > until:
        return None
    least: tuple[float, float] | None = None
    for last, begin, end in chain(_apart(reached, a, b, since, until), _apart(reached, b, a, since, until)):
        if begin <= limit:
            met = since, begin
        elif end <= limit:
            met = since + (last - since) * (begin - limit) / (begin - end), limit
        else:
            continue
        least = met if least is None else min(least, met)
    return least


def _apart(
    reached: Reached, a: _Stretch, b: _Stretch, since: float, until: float
) -> Iterator[tuple[float, float, float]]:
    """Yield by each path from one to the other a time, and the distances at `since` and then.

    Each changes evenly between both, and does not fall after that time.
    """
    if a.street is not None and a.street == b.street:
        first, last = (
            (_even(a.since, a.until, a.places, time) - _even(b.since, b.until, b.places, time)) * a.length
            for time in (since, until)
        )
        if first * last < 0.0:  # they pass each other
            yield since + (until - since) * first / (first - last), abs(first), 0.0
        else:
            yield until, abs(first), abs(last)
    for node, out in a.exits.items():
        far = reached(node)
        for end, into in b.entries.items():
            between = far.get(end, inf)
            if between < inf:
                begin, final = (
                    between + _even(a.since, a.until, out, time) + _even(b.since, b.until, into, time)
                    for time in (since, until)
                )
                yield until, begin, final


def _even(since: float, until: float, values: tuple[float, float], time: float) -> float:
    """Return a value that changes evenly."""
    return values[1] if until <= since else values[0] + (values[1] - values[0]) * (time - since) / (until - since)
