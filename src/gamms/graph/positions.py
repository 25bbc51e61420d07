"""Nodes for places: the nearest one, and some drawn at random."""

from operator import index
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from gamms import kernels
from gamms.arguments import as_float, as_int, as_range
from gamms.errors import BadType, BadValue
from gamms.graph.coordinates import places_of, refuse_far
from gamms.ir.graph import FloatArray, IntArray
from gamms.text import shown

if TYPE_CHECKING:
    from numpy.random import Generator

    from gamms.graph.graph import Graph

_TRIES = 20  # how often to begin anew when nodes that must be apart do not fit


def nearest_node(graph: "Graph", xy: tuple[Any, Any], latlon: tuple[Any, Any]) -> Any:
    """The id of the node nearest to a place, or the ids (places,) of those nearest to several."""
    places = places_of(graph.crs, xy, latlon)
    if not len(graph):
        raise BadValue("The graph has no nodes, so none is nearest. Add nodes first.")
    nearest = graph._indexes.nearest
    rows = np.array([nearest(x, y) for x, y in places.reshape(-1, 2).tolist()], np.int64)
    if latlon[0] is not None and graph.crs is not None:
        known = graph._nodes.array("xy")
        refuse_far(graph.crs, known[graph._nodes.living()], places.reshape(-1, 2), known[rows])
    ids = graph._nodes.array("ids")[rows]
    return int(ids[0]) if places.ndim == 1 else ids


def place(
    graph: "Graph",
    n: int,
    near: int | tuple[float, float] | None,
    radius: float | None,
    apart: float,
    rng: "Generator | int | None",
) -> list[int]:
    """Ids of `n` different nodes, drawn at random."""
    demand = _Demand(_count(n), as_range(apart, "apart"), _disc(graph, near, radius))
    stream = _generator(rng)
    candidates = _candidates(graph, demand)
    best: list[int] = []
    for _ in range(_TRIES if demand.apart > 0.0 and len(candidates) >= demand.n else 1):
        drawn = _drawn(graph, candidates[stream.permutation(len(candidates))], demand)
        if len(drawn) == demand.n:
            ids = graph._nodes.ids
            return [ids[row] for row in drawn]
        best = max(best, drawn, key=len)
    raise BadValue(demand.refusal(len(best)))


class _Demand(NamedTuple):
    """What was asked for, checked."""

    n: int
    apart: float
    disc: tuple[float, float, float] | None  # x, y, radius

    def refusal(self, placed: int) -> str:
        """What to tell who asked for more than fit."""
        words, ways_out = f"Only {placed} of {self.n} nodes could be placed", ["ask for fewer"]
        if self.disc is not None:
            words += " within {2:g} of ({0:g}, {1:g})".format(*self.disc)
            ways_out.append("a larger radius")
        if self.apart > 0.0:
            words += f" at least {self.apart:g} apart"
            ways_out.append("a smaller apart")
        return f"{words}; {' or '.join(ways_out)}."


def _candidates(graph: "Graph", demand: _Demand) -> IntArray:
    if demand.disc is None or demand.disc[2] == np.inf:
        return graph._nodes.living()
    return graph._indexes.nodes_within(*demand.disc)


def _drawn(graph: "Graph", rows: IntArray, demand: _Demand) -> list[int]:
    """The first rows that keep apart from those before them, as many as are asked for."""
    if demand.apart == 0.0:
        drawn: list[int] = rows[: demand.n].tolist()
        return drawn
    xy = graph._nodes.array("xy")
    is_blocked = np.zeros(len(xy), np.bool_)
    drawn = []
    for row in rows.tolist():
        if len(drawn) == demand.n:
            break
        if not is_blocked[row]:
            drawn.append(row)
            is_blocked[_closer_than(graph, xy, row, demand.apart)] = True
    return drawn


def _closer_than(graph: "Graph", xy: FloatArray, row: int, apart: float) -> IntArray:
    x, y = xy[row].tolist()
    around = graph._nodes.living() if apart == np.inf else graph._indexes.nodes_within(x, y, apart)
    with np.errstate(over="ignore"):  # infinitely far away is far enough
        found: IntArray = around[np.hypot(*(xy[around] - (x, y)).T) < apart]
    return found


def _count(n: Any) -> int:
    count = as_int(n, "n")
    if count < 0:
        raise BadValue(f"n must not be negative, not {count}.")
    return count


def _disc(graph: "Graph", near: Any, radius: Any) -> tuple[float, float, float] | None:
    if (near is None) != (radius is None):
        given, missing = ("near", "radius") if radius is None else ("radius", "near")
        raise BadValue(f"place(…) got {given}= without {missing}=: give both, or neither for the whole graph.")
    if near is None:
        return None
    try:
        node = graph.get_node(index(near))
        x, y = node.x, node.y
    except TypeError:
        x, y = _point(near)
    return x, y, as_range(radius, "radius")


def _point(near: Any) -> tuple[float, float]:
    try:
        x, y = near
    except (TypeError, ValueError):
        raise BadType(f"near must be the id of a node or a pair (x, y), not {shown(near)}.") from None
    return as_float(x, "x of near"), as_float(y, "y of near")


def _generator(rng: Any) -> "Generator":
    from numpy.random import Generator

    if isinstance(rng, Generator):
        return rng
    if rng is None:
        raise BadType(
            "place(…) draws at random and needs rng=, a numpy Generator or a seed, such as rng=ctx.rng; "
            "ctx.graph.place(…) has a stream of its own."
        )
    return kernels.stream(as_int(rng, "rng"), "graph", "place")
