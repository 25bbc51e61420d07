"""Positions of agents on edges of the graph, in games by metres (`ctx.game.speed_unit`)."""

from collections.abc import Sequence
from itertools import accumulate, chain, pairwise
from math import hypot
from typing import Any, NamedTuple, Self

import numpy as np

from gamms.core.ask import find_point
from gamms.core.contacts import Polylines
from gamms.errors import ContextTerminated, UnknownName
from gamms.ir.graph import FloatArray, GraphColumns, IntArray
from gamms.ir.progress import Motion, Progress
from gamms.typing.graph_engine import IGraph


class OnEdge(NamedTuple):
    """The position of an agent on an edge."""

    edge: tuple[int, int, int]  # source id, target id, edge id
    offset_m: float  # distance from the source, map units
    xy: tuple[float, float]
    ahead: tuple[float, float]  # the direction of movement (cos, sin), or of the last movement


class PassedNode(int):
    """The report of AGENT sensors for an agent on an edge: the last node that it passed, and its position.

    It is equal to the id of the node. For agents on nodes, sensors report plain integers.

    Attributes:
        edge: (source id, target id, edge id).
        offset_m: distance of the agent from the source of the edge, map units.
        xy: position on the map.
    """

    edge: tuple[int, int, int]
    offset_m: float
    xy: tuple[float, float]

    def __new__(cls, node: int, *place: Any) -> Self:
        """Return the node id with a position: `edge`, `offset_m` and `xy`; on copying, attributes are set later."""
        self = super().__new__(cls, node)
        if place:
            self.edge, self.offset_m, self.xy = place
        return self


def locate(graph: IGraph, progress: Progress) -> OnEdge | None:
    """Return the map position of an agent on an edge; None if the edge was removed."""
    try:
        edge = graph.get_edge(progress.edge)
    except (UnknownName, ContextTerminated):
        return None
    return locate_on_edge(progress, edge.length, Line.from_flat(edge.points))


class Line(NamedTuple):
    """A polyline, prepared for finding points on it."""

    points: list[tuple[float, float]]
    lengths: list[float]  # from each point to the next, map units

    @classmethod
    def from_flat(cls, flat: Sequence[float]) -> "Line":
        """Return the polyline (x0, y0, x1, …)."""
        points = list(zip(flat[::2], flat[1::2], strict=True))
        return cls(points, [hypot(x1 - x0, y1 - y0) for (x0, y0), (x1, y1) in pairwise(points)])

    def find_point(self, share: float) -> tuple[float, float, float, float]:
        """Return the point (x, y) at a share of its length, and the direction (cos, sin) there."""
        x, y, dx, dy = find_point(self.points, self.lengths, share)
        return x, y, dx, dy

    def list_shares(self) -> list[float]:
        """Return the shares of its length at its points, except for the first."""
        whole = sum(self.lengths) or 1.0
        return [far / whole for far in accumulate(self.lengths)]


class LineColumns(NamedTuple):
    """The columns of polylines, as `gamms.core.contacts.Polylines` takes them."""

    firsts: IntArray  # (edges,) row of the first point; -1: the edge has no polyline yet
    lasts: IntArray
    xs: FloatArray
    ys: FloatArray
    lengths: FloatArray  # from each point to the next
    shares: FloatArray  # of the length of the edge, at each point
    wholes: FloatArray  # (edges,)

    @classmethod
    def from_lines(cls, lines: Sequence[Line]) -> Self:
        """Return the columns of some polylines."""
        sizes = np.array([len(line.points) for line in lines], np.int64)
        lasts = np.cumsum(sizes) - 1
        xs, ys = np.array([*chain.from_iterable(line.points for line in lines)], np.float64).reshape(-1, 2).T.copy()
        lengths = np.array([*chain.from_iterable((*line.lengths, 0.0) for line in lines)], np.float64)
        shares = np.array([*chain.from_iterable((0.0, *line.list_shares()) for line in lines)], np.float64)
        wholes = np.array([sum(line.lengths) for line in lines], np.float64)
        return cls(lasts - sizes + 1, lasts, xs, ys, lengths, shares, wholes)

    def reserve(self, count: int) -> Self:
        """Return these polylines with room for those of the edges up to number `count`."""
        more = count - len(self.firsts)
        none = np.full(more, -1)
        firsts = np.concatenate((self.firsts, none))
        lasts = np.concatenate((self.lasts, none))
        return self._replace(firsts=firsts, lasts=lasts, wholes=np.concatenate((self.wholes, np.zeros(more))))

    def add_lines(self, edges: Sequence[int], lines: Sequence[Line]) -> Self:
        """Return these polylines with added ones: `lines` of the edges with the numbers `edges`, which had none."""
        new = self.from_lines(lines)
        self.firsts[edges] = new.firsts + len(self.xs)
        self.lasts[edges] = new.lasts + len(self.xs)
        self.wholes[edges] = new.wholes
        xs, ys, lengths, shares = (np.concatenate(both) for both in zip(self[2:6], new[2:6], strict=True))
        return self._replace(xs=xs, ys=ys, lengths=lengths, shares=shares)

    def give(self, lines: Polylines) -> None:
        """Set the polylines of a search of the core."""
        buffers: list[Any] = [column.data for column in self]
        lines.take(*buffers)


class Lines:
    """The polylines of all edges of a graph, to find many points on them, with exactly the results of `Line`.

    Args:
        columns: columns of the graph.
    """

    def __init__(self, columns: GraphColumns) -> None:
        ends = np.concatenate((columns.xy[columns.sources], columns.xy[columns.targets]), axis=1)
        flat = ends.tolist()
        for row, polyline in columns.polylines.items():
            flat[row] = polyline.ravel().tolist()
        found = LineColumns.from_lines([Line.from_flat(one) for one in flat])
        self.polylines = found
        self._count = found.lasts - found.firsts  # (edges,) number of straight parts
        self._first = found.firsts
        self._whole = found.wholes
        self._x = found.xs
        self._y = found.ys
        self._lengths = found.lengths

    def find_points(self, edges: IntArray, shares: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return the points x and y at shares of edge rows, and the directions cos and sin there, (places,)."""
        place = self._first[edges]
        left = shares * self._whole[edges]
        last = place + self._count[edges]
        x = self._x[last]
        y = self._y[last]
        cos = np.zeros(len(edges))
        sin = np.zeros(len(edges))
        open_ = np.arange(len(edges))
        while len(open_):
            length = self._lengths[place]
            is_here = (length > 0.0) & (left <= length)
            here = place[is_here]
            found = open_[is_here]
            far = left[is_here]
            cos[found] = (self._x[here + 1] - self._x[here]) / length[is_here]
            sin[found] = (self._y[here + 1] - self._y[here]) / length[is_here]
            x[found] = self._x[here] + far * cos[found]
            y[found] = self._y[here] + far * sin[found]
            goes_on = ~is_here & (place + 1 < last[open_])
            open_ = open_[goes_on]
            place = place[goes_on] + 1
            left = (left - length)[goes_on]
        return x, y, cos, sin


def locate_on_edge(progress: Progress, length: float, line: Line) -> OnEdge:
    """Return the map position of an agent on an edge of a given length, along a polyline."""
    x, y, dx, dy = line.find_point(progress.share)
    sign = -1.0 if progress.motion == Motion.BACK else 1.0
    ends = progress.source, progress.target, progress.edge
    return OnEdge(ends, progress.share * length, (x, y), (sign * dx, sign * dy))


def find_point_along(flat: Sequence[float], share: float) -> tuple[float, float, float, float]:
    """Return the point (x, y) at a share of a polyline (x0, y0, x1, …), and the direction (cos, sin) there."""
    return Line.from_flat(flat).find_point(share)


def cut_line(flat: Sequence[float], begin: float, end: float) -> list[tuple[float, float, float]]:
    """Return the corners of a part of a polyline, between two shares: (share, x, y) of each."""
    line = Line.from_flat(flat)
    low, high = sorted((begin, end))
    bends = [(share, *point) for share, point in zip(line.list_shares(), line.points[1:], strict=True)]
    between = [bend for bend in bends if low < bend[0] < high]
    ends = [(share, *find_point_along(flat, share)[:2]) for share in (begin, end)]
    return [ends[0], *(between if begin <= end else reversed(between)), ends[1]]
