"""Where agents were in the course of a turn of one game: at nodes, and on edges in games by metres.

A turn is the time from 0 to 1.
"""

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise

from gamms.context import Context
from gamms.errors import UnknownName
from gamms.ir.agents import Position
from gamms.typing.game import Leg, Track
from gamms.typing.graph_values import OSMEdge
from gamms.typing.on_edges import line_along, point_along

Visit = tuple[int, float, float]  # node id; from when until when
Line = tuple[float, float, Position, Position]  # from when until when, and where an agent is then


def at_end(track: Track) -> Track:
    """Return that an agent is where it is at the end of the turn, and nothing of how it got there."""
    last = track.legs[-1]._replace(begin=track.legs[-1].end, since=1.0, until=1.0) if track.legs else None
    is_on_edge = last is not None and 0.0 < last.end < 1.0
    return Track(track.path[-1:], (1.0,), (last,) if last is not None and is_on_edge else ())


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

    def length_of(self, leg: Leg) -> float | None:
        """Return how long the edge of a leg is; None: it was removed, and nothing tells where it was."""
        try:
            return self[leg.edge].length
        except UnknownName:
            return None

    def xy_at(self, track: Track, time: float, node: int, at: Position | None) -> tuple[float, float] | None:
        """Return where on the map an agent is; None where its edge or node is gone.

        Args:
            track: how it has moved.
            time: of the turn.
            node: the one that it has passed last.
            at: where one that flies is; it is on no node.
        """
        try:
            if at is not None:
                return at[:2]
            for leg in track.legs:
                if leg.since <= time <= leg.until:
                    return point_along(self[leg.edge].points, leg.share_at(time))[:2]
            found = self.graph.get_node(node)
        except UnknownName:
            return None
        return found.x, found.y

    def lines_of(self, track: Track, at: Position | None) -> Iterator[Line]:
        """Yield the straight parts of the way of an agent; of one that flies, where it is."""
        if at is not None:
            yield track.times[0], 1.0, at, at
            return
        for node, since, until in visits_of(track):
            _, x, y = self.graph.get_node(node)
            yield since, until, (x, y, 0.0), (x, y, 0.0)
        for leg in self._known(track.legs):
            yield from _lines_along(self[leg.edge], leg)

    def _known(self, legs: Iterable[Leg]) -> Iterator[Leg]:
        return (leg for leg in legs if self.length_of(leg) is not None)


def _lines_along(edge: OSMEdge, leg: Leg) -> Iterator[Line]:
    """Yield the straight parts of a leg along the polyline of its edge."""
    line = line_along(edge.points, leg.begin, leg.end)
    pace = (leg.until - leg.since) / (leg.end - leg.begin) if leg.end != leg.begin else 0.0
    times = [leg.since, *(leg.since + (share - leg.begin) * pace for share, _, _ in line[1:-1]), leg.until]
    points = [(x, y, 0.0) for _, x, y in line]
    for (since, until), (begin, end) in zip(pairwise(times), pairwise(points), strict=True):
        yield since, until, begin, end
