"""What was seen from a place: remembered as long as the world stays as it is, and shared by all sensors."""

from collections.abc import Iterable
from math import inf, pi
from typing import Any

import numpy as np

from gamms import kernels
from gamms.arguments import as_int
from gamms.ir.graph import FloatArray, IntArray
from gamms.sensor import looks
from gamms.typing import IContext
from gamms.typing.graph_engine import IGraph, NodeColumns, Surroundings

FULL_CIRCLE = 2.0 * pi

Sector = tuple[float, tuple[float, float], float]  # radius, heading (cos, sin), full opening angle
Place = int | tuple[float, ...]  # the id of a node, or (x, y)

_FAR_BEYOND = 3.0  # how far an area is measured, in distances to the farthest node along an axis
_MOST_AREAS = 1000
_MOST_WORDS = 1 << 24  # of 8 bytes: what may be remembered in all
_WORDS_PER_NODE = 12  # of a dict entry
_WORDS_PER_VIEW = 100  # of its key and its empty containers


class Views:
    """Surroundings by radius and field of view, and by place."""

    def __init__(self, ctx: IContext) -> None:
        self._ctx = ctx
        self._graph: IGraph | None = None
        self._revision: Any = None
        self._seen: dict[Any, dict[Any, Surroundings]] = {}
        self._words = 0

    def look(self, place: Place, radius: float, fov: float, heading: tuple[float, float]) -> Surroundings:
        """What a map sensor sees; shared, and therefore not to be changed."""
        # NOTE: the graph is asked for once: three properties cost a third of a look (benchmarks/README.md, w3).
        graph = self._graph = self._graph or self._ctx.graph.graph
        revision = graph.revision
        if revision != self._revision or revision is None:
            self._forget(revision)
        kind = radius if fov == FULL_CIRCLE or heading == (0.0, 0.0) else (radius, fov, heading)
        key = place
        if kind == inf:  # the whole graph looks alike from everywhere
            coordinates(self._ctx, place)
            key = -1
        try:
            return self._seen[kind][key]
        except KeyError:
            return self._keep(kind, key, self._ahead(place, radius, fov, heading))
        except TypeError:  # not hashable
            return self.look(as_int(place, "The id of a node"), radius, fov, heading)

    def known_ids(self, place: Place, radius: float) -> Iterable[int] | None:
        """The ids of the nodes within a radius of a place, if somebody has looked there already."""
        if self._revision is None or self._revision != self._ctx.graph.graph.revision:
            return None
        seen = self._seen.get(radius, {}).get(place)
        return None if seen is None else seen.nodes

    def _ahead(self, place: Place, radius: float, fov: float, heading: tuple[float, float]) -> Surroundings:
        graph = self._ctx.graph.graph
        if isinstance(place, tuple):
            return graph.among(nodes_ahead(self._ctx, place, radius, fov, heading).ids)
        return graph.within(place, radius, fov, heading)

    def _forget(self, revision: Any) -> None:
        self._revision = revision
        self._seen.clear()
        self._words = 0

    def _keep(self, kind: Any, place: Place, seen: Surroundings) -> Surroundings:
        """Remember a view, as long as it fits in; when the room is full, all others are forgotten."""
        words = _WORDS_PER_VIEW + _WORDS_PER_NODE * len(seen.nodes) + len(seen.edges)
        if self._revision is None or words > _MOST_WORDS:
            return seen
        if self._words + words > _MOST_WORDS:
            self._forget(self._revision)
        self._words += words
        self._seen.setdefault(kind, {})[place if isinstance(place, tuple) else int(place)] = seen
        return seen


class ViewsPastObstacles(Views):
    """The same, without what is behind an obstacle."""

    def __init__(self, ctx: IContext) -> None:
        super().__init__(ctx)
        self._areas: dict[Any, FloatArray] = {}

    def look_past(
        self, place: Place, radius: float, fov: float, heading: tuple[float, float], height: float
    ) -> Surroundings:
        """What a map sensor sees whose sight lines run `height` above the ground."""
        self._renew()
        kind = (radius, fov, heading, height)
        try:
            return self._seen[kind][place]
        except KeyError:
            ids = self._ids_in_sight(place, radius, fov, heading, height)
            return self._keep(kind, place, self._ctx.graph.graph.among(ids))
        except TypeError:  # not hashable
            return self.look_past(as_int(place, "The id of a node"), radius, fov, heading, height)

    def area(self, place: tuple[float, float], sector: Sector, height: float) -> FloatArray:
        """Corners (corners, 2) of what is in sight of a sector, cut off far beyond the map."""
        self._renew()
        key = place, sector, height
        if key not in self._areas:
            if len(self._areas) >= _MOST_AREAS:
                self._areas.clear()
            self._areas[key] = self._area_in_sight(place, sector, height)
        return self._areas[key]

    def _area_in_sight(self, place: tuple[float, float], sector: Sector, height: float) -> FloatArray:
        (radius, heading, fov), see = sector, self._ctx.graph.visible
        end = _FAR_BEYOND * float(np.abs(self._ctx.graph.columns().xy - place).max(initial=0.0))
        within, origin = min(radius, end) if radius < inf and end > 0.0 else radius, np.array([*place, height])
        return looks.area_in_sight(lambda points: see(origin, at_height(points, height)), *place, within, heading, fov)

    def _renew(self) -> None:
        room = self._ctx.graph
        revision = (room.graph.revision, room.obstacle_revision)
        if revision != self._revision or None in revision:
            self._forget(None if None in revision else revision)
            self._areas.clear()

    def _ids_in_sight(
        self, place: Place, radius: float, fov: float, heading: tuple[float, float], height: float
    ) -> IntArray:
        table = None if isinstance(place, tuple) else self._ctx.graph.visibility_table(radius, height)
        if table is not None and table.radius == radius:  # it has looked at what is in range already
            ids = table.from_node(place)  # type: ignore[arg-type] # a pair has no table
            nodes = NodeColumns(ids, self._ctx.graph.graph.positions(ids))
            return ahead_of(nodes, *coordinates(self._ctx, place), fov, heading).ids
        nodes = nodes_ahead(self._ctx, place, radius, fov, heading)
        return nodes.ids[in_sight(self._ctx, place, nodes, radius, height)]


def coordinates(ctx: IContext, place: Place) -> tuple[float, float]:
    """(x, y) of a place.

    Raises:
        UnknownName (KeyError): there is no such node.
    """
    if isinstance(place, tuple):
        return place[0], place[1]
    _, x, y = ctx.graph.graph.get_node(place)
    return x, y


def nodes_ahead(ctx: IContext, place: Place, radius: float, fov: float, heading: tuple[float, float]) -> NodeColumns:
    """The nodes in range and inside the field of view, as arrays."""
    x, y = coordinates(ctx, place)
    return ahead_of(ctx.graph.graph.nodes_near(x, y, radius), x, y, fov, heading)


def ahead_of(nodes: NodeColumns, x: float, y: float, fov: float, heading: tuple[float, float]) -> NodeColumns:
    """Those nodes that are inside the field of view of who looks from (x, y)."""
    if fov == FULL_CIRCLE or heading == (0.0, 0.0):
        return nodes
    ids, xy = nodes
    is_ahead = kernels.in_cone(xy[:, 0] - x, xy[:, 1] - y, heading, fov)
    return NodeColumns(ids[is_ahead], xy[is_ahead])


def in_sight(
    ctx: IContext, place: Place, nodes: NodeColumns, radius: float, height: float
) -> "np.ndarray[tuple[int, ...], np.dtype[np.bool_]]":
    """Whether no obstacle hides each node; all sight lines run `height` above the ground.

    A visibility table answers if there is one; it was made of the same sight lines.
    """
    if not isinstance(place, tuple):
        table = ctx.graph.visibility_table(radius, height)
        if table is not None:
            return table.mask(place, nodes.ids)
    origin = np.array([*coordinates(ctx, place), height])
    return ctx.graph.visible(origin, at_height(nodes.xy, height))


def at_height(xy: FloatArray, height: float) -> FloatArray:
    """Points (points, 3) above places (points, 2)."""
    return np.column_stack([xy, np.full(len(xy), height)])
