"""Views of nodes and edges from a place, cached until the graph changes."""

from collections.abc import Hashable, Mapping
from functools import cached_property
from math import inf, pi
from typing import Any, NamedTuple, Self

import numpy as np

from gamms import kernels
from gamms.deciding import get_phase
from gamms.ir.graph import FloatArray, IntArray, as_node_id
from gamms.ir.obstacles import BoolArray
from gamms.sensor import fov_geometry
from gamms.typing import IContext
from gamms.typing.graph_engine import IGraph, NodeColumns, NodeGround, Surroundings

FULL_CIRCLE = 2.0 * pi

Sector = tuple[float, tuple[float, float], float]  # radius, heading (cos, sin), full opening angle
Place = int | tuple[float, ...]  # the id of a node, or (x, y)

_FAR_BEYOND = 3.0  # limit of a visible area, in distances to the farthest node along an axis
_MOST_AREAS = 1000
_MOST_IDS = 1 << 20  # cached ids of nodes in sight
_MOST_WORDS = 1 << 24  # cached 8-byte words in total, except arrays of ids
_PART = 8  # one in this many views is dropped when the cache is full
_WORDS_PER_NODE = 7  # per dict entry, at most
_SURFACE = NodeGround(np.zeros(1), np.zeros(1, np.int64))  # of a flat map
_WORDS_PER_VIEW = 100  # per view, for its key and its empty containers


class View(Surroundings):
    """A read-only view from a place, shared by sensors."""

    @cached_property
    def node_ids(self) -> IntArray:
        """The ids of the nodes, (nodes,)."""
        return np.array([*self.nodes], np.int64)

    @cached_property
    def edge_ids(self) -> IntArray:
        """The ids of the edges, (edges,)."""
        return np.array([edge.id for edge in self.edges], np.int64)


class ViewCache:
    """A cache of surroundings by radius and field of view, and by place."""

    def __init__(self, ctx: IContext) -> None:
        self._ctx = ctx
        self._phase = get_phase(ctx)
        self._graph: IGraph | None = None
        self._moment: object = None
        self._revision: Any = None
        self._seen: dict[Any, dict[Any, View]] = {}
        self._words = 0

    def look(self, place: Place, radius: float, fov: float, heading: tuple[float, float]) -> View:
        """Return the view of a map sensor."""
        # NOTE: reads the graph once, and its revision once per turn: three properties would cost a third of a
        # look (benchmarks: sense).
        moment = self._phase.moment
        if moment is None or moment is not self._moment:
            self._moment = moment
            graph = self._ctx.graph.graph if self._graph is None else self._graph
            self._graph = graph
            revision = graph.revision
            if revision != self._revision or revision is None:
                self._forget(revision)
        kind = radius if fov == FULL_CIRCLE or heading == (0.0, 0.0) else (radius, fov, heading)
        key = place
        if kind == inf:  # the whole graph is the same from every place
            find_coordinates(self._ctx, place)
            key = -1
        try:
            return self._seen[kind][key]
        except KeyError:
            return self._keep(kind, key, self._find_ahead(place, radius, fov, heading))
        except TypeError:  # not hashable
            return self.look(as_node_id(place, "The id of a node", self._ctx.graph), radius, fov, heading)

    def get_views(self, radius: float) -> Mapping[Place, View]:
        """Return the cached views in all directions within a finite radius, by place."""
        is_valid = self._revision is not None and self._revision == self._ctx.graph.graph.revision
        return self._seen.get(radius, {}) if is_valid else {}

    def _find_ahead(self, place: Place, radius: float, fov: float, heading: tuple[float, float]) -> Surroundings:
        graph = self._ctx.graph.graph
        if isinstance(place, tuple):
            return graph.among(
                find_nodes_ahead(self._ctx, Viewpoint.from_place(self._ctx, place), radius, fov, heading).ids
            )
        return graph.within(place, radius, fov, heading)

    def _forget(self, revision: object) -> None:
        self._revision = revision
        self._seen.clear()
        self._words = 0

    def _keep(self, kind: Hashable, place: Place, seen: Surroundings) -> View:
        """Cache a view if it is small enough; when the cache is full, drop one in a few views."""
        words = _count_words(seen)
        view = View(*seen)
        if self._revision is None or words > _MOST_WORDS:
            return view
        if self._words + words > _MOST_WORDS:
            self._drop(words)
        self._words += words
        self._seen.setdefault(kind, {})[place if isinstance(place, tuple) else int(place)] = view
        return view

    def _drop(self, words: int) -> None:
        """Drop one in a few views of each kind, until enough memory is free."""
        # NOTE: not the oldest: an agent that cycles through more places than fit would then never hit the
        # cache (benchmarks: where it broke).
        while self._seen and self._words + words > _MOST_WORDS:
            for kind, views in list(self._seen.items()):
                for place in list(views)[::_PART]:
                    self._words -= _count_words(views.pop(place))
                if not views:
                    del self._seen[kind]


def _count_words(seen: Surroundings) -> int:
    return _WORDS_PER_VIEW + _WORDS_PER_NODE * len(seen.nodes) + len(seen.edges)


class OccludedViewCache(ViewCache):
    """A cache of views without nodes behind obstacles."""

    def __init__(self, ctx: IContext) -> None:
        super().__init__(ctx)
        self._areas: dict[Any, FloatArray] = {}
        self._ids: dict[Any, IntArray] = {}
        self._count = 0  # of nodes in it

    def look_past(
        self, place: Place, radius: float, fov: float, heading: tuple[float, float], height: float, tunnel: int = 0
    ) -> View:
        """Return the view of a map sensor with sight lines `height` above the ground; `tunnel` as in `Viewpoint`."""
        self._renew()
        kind = (radius, fov, heading, height, tunnel)
        try:
            return self._seen[kind][place]
        except KeyError:
            ids = self.list_nodes(place, radius, fov, heading, height, tunnel)
            return self._keep(kind, place, self._ctx.graph.graph.among(ids))
        except TypeError:  # not hashable
            return self.look_past(
                as_node_id(place, "The id of a node", self._ctx.graph), radius, fov, heading, height, tunnel
            )

    def list_nodes(
        self, place: Place, radius: float, fov: float, heading: tuple[float, float], height: float, tunnel: int
    ) -> IntArray:
        """Return the ids of the nodes of `look_past` (nodes,), in insertion order; read-only."""
        self._renew()
        key = place, radius, fov, heading, height, tunnel
        try:
            known = self._ids.get(key)
        except TypeError:  # not hashable
            place = as_node_id(place, "The id of a node", self._ctx.graph)
            return self.list_nodes(place, radius, fov, heading, height, tunnel)
        if known is None:
            known = self._find_ids_in_sight(place, radius, fov, heading, height, tunnel)
            known.setflags(write=False)
            self._count += len(known)
            if self._count > _MOST_IDS:
                self._ids.clear()
                self._count = len(known)
            self._ids[key] = known
        return known

    def compute_area(self, place: tuple[float, float], sector: Sector, height: float) -> FloatArray:
        """Return the corners (corners, 2) of the visible part of a sector, cut off far outside the map."""
        self._renew()
        key = place, sector, height
        if key not in self._areas:
            if len(self._areas) >= _MOST_AREAS:
                self._areas.clear()
            self._areas[key] = self._find_area_in_sight(place, sector, height)
        return self._areas[key]

    def _find_area_in_sight(self, place: tuple[float, float], sector: Sector, height: float) -> FloatArray:
        radius, heading, fov = sector
        see = self._ctx.graph.visible
        end = _FAR_BEYOND * float(np.abs(self._ctx.graph.columns().xy - place).max(initial=0.0))
        within = min(radius, end) if radius < inf and end > 0.0 else radius
        level = float(find_ground(self._ctx, place).z[0]) + height  # the area is computed at the height of the eyes
        origin = np.array([*place, level])
        return fov_geometry.find_area_in_sight(
            lambda points: see(origin, raise_to_height(points, level)), *place, within, heading, fov
        )

    def _renew(self) -> None:
        graph = self._ctx.graph
        revision = (graph.graph.revision, graph.obstacle_revision)
        if revision != self._revision or None in revision:
            self._forget(None if None in revision else revision)
            self._areas.clear()
            self._ids.clear()
            self._count = 0

    def _find_ids_in_sight(
        self, place: Place, radius: float, fov: float, heading: tuple[float, float], height: float, tunnel: int
    ) -> IntArray:
        view = Viewpoint.from_place(self._ctx, place, tunnel)
        table = None if view.node is None else self._ctx.graph.visibility_table(radius, height)
        if table is not None and table.radius == radius and view.node is not None:  # the table already has the range
            ids = table.from_node(view.node)
            return select_ahead(NodeColumns(ids, self._ctx.graph.graph.positions(ids)), view, fov, heading).ids
        nodes = find_nodes_ahead(self._ctx, view, radius, fov, heading)
        return nodes.ids[find_in_sight(self._ctx, view, nodes, radius, height)]


class Viewpoint(NamedTuple):
    """The place from which a sensor on the ground looks.

    Attributes:
        node: id of its node; None: it is between nodes, at (x, y).
        x: map units.
        y: map units.
        tunnel: number of the tunnel of a place (x, y); 0: on the surface. For a node it is known.
    """

    node: int | None
    x: float
    y: float
    tunnel: int = 0

    @classmethod
    def from_place(cls, ctx: IContext, place: Place, tunnel: int = 0) -> Self:
        """Return the viewpoint at a place.

        Raises:
            UnknownName (KeyError): the node does not exist.
        """
        return cls(None if isinstance(place, tuple) else place, *find_coordinates(ctx, place), tunnel)


def find_coordinates(ctx: IContext, place: Place) -> tuple[float, float]:
    """Return (x, y) of a place.

    Raises:
        UnknownName (KeyError): the node does not exist.
    """
    if isinstance(place, tuple):
        return place[0], place[1]
    _, x, y = ctx.graph.graph.get_node(place)
    return x, y


def find_nodes_ahead(
    ctx: IContext, view: Viewpoint, radius: float, fov: float, heading: tuple[float, float]
) -> NodeColumns:
    """Return the nodes in range and inside the field of view, as arrays."""
    return select_ahead(ctx.graph.graph.nodes_near(view.x, view.y, radius), view, fov, heading)


def select_ahead(nodes: NodeColumns, view: Viewpoint, fov: float, heading: tuple[float, float]) -> NodeColumns:
    """Return the nodes that are inside the field of view."""
    if fov == FULL_CIRCLE or heading == (0.0, 0.0):
        return nodes
    ids, xy = nodes
    is_ahead = kernels.find_in_cone(xy[:, 0] - view.x, xy[:, 1] - view.y, heading, fov)
    return NodeColumns(ids[is_ahead], xy[is_ahead])


def find_in_sight(
    ctx: IContext, view: Viewpoint, nodes: NodeColumns, radius: float, height: float
) -> "np.ndarray[tuple[int, ...], np.dtype[np.bool_]]":
    """Return whether no obstacle hides each node; all sight lines run `height` above the ground.

    Uses a visibility table if there is one, with the same result.
    """
    table = None if view.node is None else ctx.graph.visibility_table(radius, height)
    if table is None or view.node is None:
        return is_unhidden(ctx, view, nodes, height)
    return table.mask(view.node, nodes.ids)


def is_unhidden(ctx: IContext, view: Viewpoint, nodes: NodeColumns, height: float) -> BoolArray:
    """Return whether no obstacle hides each node or an adjacent place, without a visibility table."""
    here = find_ground(ctx, (view.x, view.y) if view.node is None else view.node)
    there = ctx.graph.graph.ground(nodes.ids)
    origin = here.find_eyes(np.array([(view.x, view.y)]), height)[0]
    if there is None:
        return ctx.graph.visible(origin, raise_to_height(nodes.xy, height))
    is_near: BoolArray = there.tunnels == (view.tunnel if view.node is None else here.tunnels)
    return is_near & ctx.graph.visible(origin, there.find_eyes(nodes.xy, height))


def find_ground(ctx: IContext, place: Place) -> NodeGround:
    """Return the ground at one place; for (x, y) the surface, at the height of the nearest node."""
    graph = ctx.graph.graph
    if not isinstance(place, tuple):
        ground = graph.ground([place])
    elif (ground := graph.ground([])) is not None:
        ground = graph.ground([int(graph.nearest_node(place[0], place[1]))])
        ground = ground and ground._replace(tunnels=_SURFACE.tunnels)
    return _SURFACE if ground is None else ground


def raise_to_height(xy: FloatArray, height: float) -> FloatArray:
    """Return points (points, 3) above places (points, 2) of a flat map."""
    return np.column_stack([xy, np.full(len(xy), height)])


def place_on_ground(ctx: IContext, ids: IntArray, xy: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return the nodes as points (nodes, 3) on the ground, and a mask of the nodes that are not in a tunnel."""
    ground = ctx.graph.graph.ground(ids)
    if ground is None:
        return raise_to_height(xy, 0.0), np.ones(len(xy), np.bool_)
    return ground.find_eyes(xy, 0.0), ground.tunnels == 0
