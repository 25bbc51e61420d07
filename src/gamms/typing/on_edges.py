"""Where agents are that are on an edge of the graph: in games by metres (`ctx.game.speed_unit`)."""

from collections.abc import Sequence
from itertools import accumulate, pairwise
from math import hypot
from typing import Any, NamedTuple, Self

from gamms.errors import ContextTerminated, UnknownName
from gamms.ir.progress import Motion, Progress
from gamms.typing.graph_engine import IGraph


class OnEdge(NamedTuple):
    """Where on an edge an agent is."""

    edge: tuple[int, int, int]  # ids of the nodes that it leads from and to, and its own
    offset_m: float  # from its source, map units
    xy: tuple[float, float]
    ahead: tuple[float, float]  # (cos, sin) of the way that the agent goes, or last went


class PassedNode(int):
    """What AGENT sensors report of an agent on an edge: the node that it has passed last, and where it is.

    It is the id of the node, as sensors report it of agents on nodes. Those are plain integers.

    Attributes:
        edge: ids of the nodes that the edge leads from and to, and its own.
        offset_m: how far from the source of the edge the agent is, map units.
        xy: where on the map it is.
    """

    edge: tuple[int, int, int]
    offset_m: float
    xy: tuple[float, float]

    def __new__(cls, node: int, *place: Any) -> Self:
        """Return the node with a place: `edge`, `offset_m` and `xy`; a copy gets its attributes later."""
        self = super().__new__(cls, node)
        if place:
            self.edge, self.offset_m, self.xy = place
        return self


def located(graph: IGraph, progress: Progress) -> OnEdge | None:
    """Return where on the map an agent is that is on an edge; None: the edge is gone."""
    try:
        edge = graph.get_edge(progress.edge)
    except (UnknownName, ContextTerminated):
        return None
    return placed(progress, edge.length, Line.of(edge.points))


class Line(NamedTuple):
    """A polyline, as places on it are found."""

    points: list[tuple[float, float]]
    lengths: list[float]  # from each point to the next, map units

    @classmethod
    def of(cls, flat: Sequence[float]) -> "Line":
        """Return the polyline (x0, y0, x1, …)."""
        points = list(zip(flat[::2], flat[1::2], strict=True))
        return cls(points, [hypot(x1 - x0, y1 - y0) for (x0, y0), (x1, y1) in pairwise(points)])

    def at(self, share: float) -> tuple[float, float, float, float]:
        """Return the point (x, y) after a share of it, and the direction (cos, sin) of it there."""
        points, lengths = self
        left = share * sum(lengths)
        for i, length in enumerate(lengths):
            if length > 0.0 and left <= length:
                (x0, y0), (x1, y1) = points[i], points[i + 1]
                dx, dy = (x1 - x0) / length, (y1 - y0) / length
                return x0 + left * dx, y0 + left * dy, dx, dy
            left -= length
        return *points[-1], 0.0, 0.0


def placed(progress: Progress, length: float, line: Line) -> OnEdge:
    """Return where on the map an agent is that is on an edge of a length, along a polyline."""
    x, y, dx, dy = line.at(progress.share)
    sign = -1.0 if progress.motion == Motion.BACK else 1.0
    ends = progress.source, progress.target, progress.edge
    return OnEdge(ends, progress.share * length, (x, y), (sign * dx, sign * dy))


def point_along(flat: Sequence[float], share: float) -> tuple[float, float, float, float]:
    """Return the point (x, y) after a share of a polyline (x0, y0, x1, …), and the direction (cos, sin) of it there."""
    return Line.of(flat).at(share)


def line_along(flat: Sequence[float], begin: float, end: float) -> list[tuple[float, float, float]]:
    """Return the corners of a part of such a polyline, from one share of it to another: (share, x, y) of each."""
    points, lengths = Line.of(flat)
    whole, low, high = sum(lengths) or 1.0, *sorted((begin, end))
    bends = [(far / whole, *point) for far, point in zip(accumulate(lengths), points[1:], strict=True)]
    between = [bend for bend in bends if low < bend[0] < high]
    ends = [(share, *point_along(flat, share)[:2]) for share in (begin, end)]
    return [ends[0], *(between if begin <= end else reversed(between)), ends[1]]
