"""Views of nodes and edges from a place, cached until the graph changes."""

from collections.abc import Container, Hashable, Mapping
from functools import cached_property
from itertools import count
from math import inf, pi
from typing import Any

import numpy as np

from gamms import kernels
from gamms.arguments import as_int
from gamms.deciding import phase_of
from gamms.errors import UnknownName
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.ir.positions import Positions
from gamms.sensor import fov_geometry
from gamms.typing import IContext
from gamms.typing.graph_engine import IGraph, NodeColumns, NodeGround, Surroundings

FULL_CIRCLE = 2.0 * pi

Sector = tuple[float, tuple[float, float], float]  # radius, heading (cos, sin), full opening angle
Place = int | tuple[float, ...]  # the id of a node, or (x, y)

_FAR_BEYOND = 3.0  # limit of a visible area, in distances to the farthest node along an axis
_MOST_AREAS = 1000
_MOST_WORDS = 1 << 24  # cached 8-byte words in total, except arrays of ids
_PART = 8  # one in this many views is dropped when the cache is full
_WORDS_PER_NODE = 7  # per dict entry, at most
_SURFACE = NodeGround(np.zeros(1), np.zeros(1, np.int64))  # of a flat map
_WORDS_PER_VIEW = 100  # per view, for its key and its empty containers
_FEW_MISSES = 4  # misses at one moment that are computed one by one, and
_AGENTS_PER_MISS = 512  # one more for each so many agents
# views that are computed together
_FEWEST = 16
_MOST_AHEAD = 4096
_GROWTH = 4
_MOST_BEHIND = 64  # looks from nodes already passed before the search returns to one, and
_NODES_PER_LOOK_BEHIND = 16  # one more for each so many nodes
_SHARE_AHEAD = 4  # share of the words for views that are computed together
_MOST_RADII = 64  # radii for which looks are counted


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


class ViewPrefetcher:
    """A prefetcher of views: computes the views that other agents will need at this moment, for one radius.

    While agents decide, all see the same world, and look in the order of their names. After several looks from unknown
    nodes, the views of the next agents are computed together, in growing numbers as long as most of them are used.

    Attributes:
        views: view by node; a look removes its view.
        words: memory of these views.
        largest: largest size of a view computed alone.
    """

    __slots__ = (
        *("_begin", "_behind", "_end", "_made", "_misses", "_nodes", "_places", "_size", "_wait", "_waited"),
        *("largest", "views", "words"),
    )

    def __init__(self) -> None:
        self._size = _FEWEST
        self._wait = 0
        self._waited = 0
        self._made = 0
        self.largest = 1
        self.views: dict[int, Surroundings] = {}
        self.begin()

    def begin(self) -> None:
        """Restart, because agents may have moved."""
        self.judge()
        self._misses = self._begin = self._end = self._behind = 0
        self._nodes: list[int] | None = None  # nodes of agents, in the order of their looks
        self._places: dict[int, int] = {}  # of these in it

    def judge(self) -> None:
        """Drop unused views; compute more the next time if most were used, else fewer and later."""
        unused = len(self.views)
        self.views = {}
        self.words = 0
        if not self._made:
            return
        if 2 * unused <= self._made:
            self._size = min(_GROWTH * self._size, _MOST_AHEAD)
            self._waited = 0
        else:
            self._size = max(self._size // _GROWTH, _FEWEST)
            self._wait = self._waited = min(2 * self._waited + _FEWEST, _MOST_AHEAD)
        self._made = 0

    def is_due(self, node: int, positions: Positions) -> bool:
        """Count a look from an unknown node; return whether to compute the next views together."""
        self._misses += 1
        # NOTE: sorting 10,000 agents takes as long as 20 looks (benchmarks: looks of many agents).
        if self._wait or self._misses <= _FEW_MISSES + len(positions.names) // _AGENTS_PER_MISS:
            self._wait = max(self._wait - 1, 0)
            return False
        if self._nodes is None:
            names = positions.names
            nodes = positions.nodes
            rows = sorted(positions.living_rows, key=names.__getitem__)
            self._nodes = list(dict.fromkeys([nodes[row] for row in rows]))
            self._places = dict(zip(self._nodes, count(), strict=False))
        place = self._places.get(node)
        if place is None:
            return False
        most_behind = _MOST_BEHIND + len(self._nodes) // _NODES_PER_LOOK_BEHIND
        if place < self._end and self._behind < most_behind:  # the view was cached, and dropped since
            self._behind += 1
            return False
        self._behind = 0
        self._begin = self._end = place
        return True

    def most(self) -> int:
        """Return how many views to compute together."""
        return min(self._size, _MOST_WORDS // _SHARE_AHEAD // self.largest)

    def next_nodes(self, known: Container[int]) -> list[int]:
        """Return unknown nodes from which agents look next; empty if there are few."""
        found = list[int]()
        nodes = self._nodes or ()
        most = self.most()
        place = self._begin
        while place < len(nodes) and len(found) < most:
            if nodes[place] not in known:
                found.append(nodes[place])
            place += 1
        self._end = place
        return found if len(found) >= _FEWEST // 2 else []

    def take(self, nodes: list[int], seen: list[Surroundings], most_words: int) -> None:
        """Store views of nodes, up to a number of words."""
        for node, view in zip(nodes, seen, strict=True):
            words = _words(view)
            if self.words + words > most_words:
                break
            self.views[node] = view
            self.words += words
        self._made = len(self.views)

    def stop(self) -> None:
        """Stop prefetching until agents have moved."""
        self._nodes = []
        self._places = {}


class ViewCache:
    """A cache of surroundings by radius and field of view, and by place."""

    def __init__(self, ctx: IContext) -> None:
        self._ctx = ctx
        self._phase = phase_of(ctx)
        self._graph: IGraph | None = None
        self._moment: object = None
        self._revision: Any = None
        self._seen: dict[Any, dict[Any, View]] = {}
        self._words = 0
        self._to_come: dict[float, ViewPrefetcher] = {}  # by radius
        self._has_missed = False  # whether it has prefetched views of this moment

    def look(self, place: Place, radius: float, fov: float, heading: tuple[float, float]) -> View:
        """Return the view of a map sensor."""
        # NOTE: reads the graph once, and its revision once per turn: three properties would cost a third of a
        # look (benchmarks: sense).
        moment = self._phase.moment
        if moment is None or moment is not self._moment:
            self._moment = moment
            if self._has_missed:
                self._begin_looks()
            graph = self._graph = self._ctx.graph.graph if self._graph is None else self._graph
            revision = graph.revision
            if revision != self._revision or revision is None:
                self._forget(revision)
        kind = radius if fov == FULL_CIRCLE or heading == (0.0, 0.0) else (radius, fov, heading)
        key = place
        if kind == inf:  # the whole graph is the same from every place
            coordinates(self._ctx, place)
            key = -1
        try:
            return self._seen[kind][key]
        except KeyError:
            return self._keep(kind, key, self._ahead(place, radius, fov, heading))
        except TypeError:  # not hashable
            return self.look(as_int(place, "The id of a node"), radius, fov, heading)

    def known(self, radius: float) -> Mapping[Place, View]:
        """Return the cached views in all directions within a finite radius, by place."""
        is_valid = self._revision is not None and self._revision == self._ctx.graph.graph.revision
        return self._seen.get(radius, {}) if is_valid else {}

    def _ahead(self, place: Place, radius: float, fov: float, heading: tuple[float, float]) -> Surroundings:
        graph = self._ctx.graph.graph
        if isinstance(place, tuple):
            return graph.among(nodes_ahead(self._ctx, place, radius, fov, heading).ids)
        is_around = (fov == FULL_CIRCLE or heading == (0.0, 0.0)) and radius != inf
        if is_around and self._phase.moment is not None and type(place) is int and self._revision is not None:
            return self._around(graph, place, radius)
        return graph.within(place, radius, fov, heading)

    def _around(self, graph: IGraph, node: int, radius: float) -> Surroundings:
        """Return the surroundings of a node, while agents decide."""
        looks = self._to_come.get(radius)
        if looks is None:
            if len(self._to_come) >= _MOST_RADII:
                self._begin_looks()
                self._to_come.clear()
            looks = self._to_come[radius] = ViewPrefetcher()
        seen = looks.views.pop(node, None)
        if seen is not None:
            words = _words(seen)
            looks.words -= words
            self._words -= words
            return seen
        self._has_missed = True
        nodes = self._next_nodes(looks, node, radius)
        if nodes:
            try:
                seen, *others = graph.within_many(nodes, radius)
            except UnknownName:  # the node of an agent was removed
                looks.stop()
            else:
                looks.take(nodes[1:], others, _MOST_WORDS - self._words)
                self._words += looks.words
                return seen
        seen = graph.within(node, radius)
        looks.largest = max(looks.largest, _words(seen))
        return seen

    def _next_nodes(self, looks: ViewPrefetcher, node: int, radius: float) -> list[int]:
        """Return the nodes whose views to compute together, this one first; empty if it does not pay off."""
        if not looks.is_due(node, self._ctx.agent.positions):
            return []
        self._words -= looks.words
        looks.judge()
        nodes = looks.next_nodes(self._seen.get(radius, {}))
        words = looks.most() * looks.largest
        if nodes and self._words + words > _MOST_WORDS:  # only now, after the looks whose views were cached
            self._drop(words)
            has_room = self._words + words <= _MOST_WORDS
            nodes = looks.next_nodes(self._seen.get(radius, {})) if has_room else []
        return nodes

    def _begin_looks(self) -> None:
        """Drop unused prefetched views, because agents may have moved."""
        for looks in self._to_come.values():
            self._words -= looks.words
            looks.begin()
        self._has_missed = False

    def _forget(self, revision: object) -> None:
        self._revision = revision
        self._seen.clear()
        self._words = 0

    def _keep(self, kind: Hashable, place: Place, seen: Surroundings) -> View:
        """Cache a view if it is small enough; when the cache is full, drop one in a few views."""
        words = _words(seen)
        view = View(*seen)
        if self._revision is None or words > _MOST_WORDS:
            return view
        if self._words + words > _MOST_WORDS:
            self._drop(words)
            if self._words + words > _MOST_WORDS:  # the space is used by prefetched views
                return view
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
                    self._words -= _words(views.pop(place))
                if not views:
                    del self._seen[kind]


def _words(seen: Surroundings) -> int:
    return _WORDS_PER_VIEW + _WORDS_PER_NODE * len(seen.nodes) + len(seen.edges)


class OccludedViewCache(ViewCache):
    """A cache of views without nodes behind obstacles."""

    def __init__(self, ctx: IContext) -> None:
        super().__init__(ctx)
        self._areas: dict[Any, FloatArray] = {}

    def look_past(
        self, place: Place, radius: float, fov: float, heading: tuple[float, float], height: float, tunnel: int = 0
    ) -> View:
        """Return the view of a map sensor with sight lines `height` above the ground; `tunnel` as for `in_sight`."""
        self._renew()
        kind = (radius, fov, heading, height, tunnel)
        try:
            return self._seen[kind][place]
        except KeyError:
            ids = self._ids_in_sight(place, radius, fov, heading, height, tunnel)
            return self._keep(kind, place, self._ctx.graph.graph.among(ids))
        except TypeError:  # not hashable
            return self.look_past(as_int(place, "The id of a node"), radius, fov, heading, height, tunnel)

    def area(self, place: tuple[float, float], sector: Sector, height: float) -> FloatArray:
        """Return the corners (corners, 2) of the visible part of a sector, cut off far outside the map."""
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
        within = min(radius, end) if radius < inf and end > 0.0 else radius
        level = float(ground_at(self._ctx, place).z[0]) + height  # the area is computed at the height of the eyes
        origin = np.array([*place, level])
        return fov_geometry.area_in_sight(
            lambda points: see(origin, at_height(points, level)), *place, within, heading, fov
        )

    def _renew(self) -> None:
        graph = self._ctx.graph
        revision = (graph.graph.revision, graph.obstacle_revision)
        if revision != self._revision or None in revision:
            self._forget(None if None in revision else revision)
            self._areas.clear()

    def _ids_in_sight(
        self, place: Place, radius: float, fov: float, heading: tuple[float, float], height: float, tunnel: int
    ) -> IntArray:
        table = None if isinstance(place, tuple) else self._ctx.graph.visibility_table(radius, height)
        if table is not None and table.radius == radius:  # the table already has the range
            ids = table.from_node(place)  # type: ignore[arg-type] # a pair has no table
            nodes = NodeColumns(ids, self._ctx.graph.graph.positions(ids))
            return ahead_of(nodes, *coordinates(self._ctx, place), fov, heading).ids
        nodes = nodes_ahead(self._ctx, place, radius, fov, heading)
        return nodes.ids[in_sight(self._ctx, place, nodes, radius, height, tunnel)]


def coordinates(ctx: IContext, place: Place) -> tuple[float, float]:
    """Return (x, y) of a place.

    Raises:
        UnknownName (KeyError): the node does not exist.
    """
    if isinstance(place, tuple):
        return place[0], place[1]
    _, x, y = ctx.graph.graph.get_node(place)
    return x, y


def nodes_ahead(ctx: IContext, place: Place, radius: float, fov: float, heading: tuple[float, float]) -> NodeColumns:
    """Return the nodes in range and inside the field of view, as arrays."""
    x, y = coordinates(ctx, place)
    return ahead_of(ctx.graph.graph.nodes_near(x, y, radius), x, y, fov, heading)


def ahead_of(nodes: NodeColumns, x: float, y: float, fov: float, heading: tuple[float, float]) -> NodeColumns:
    """Return the nodes that are inside the field of view from (x, y)."""
    if fov == FULL_CIRCLE or heading == (0.0, 0.0):
        return nodes
    ids, xy = nodes
    is_ahead = kernels.in_cone(xy[:, 0] - x, xy[:, 1] - y, heading, fov)
    return NodeColumns(ids[is_ahead], xy[is_ahead])


def in_sight(
    ctx: IContext, place: Place, nodes: NodeColumns, radius: float, height: float, tunnel: int = 0
) -> "np.ndarray[tuple[int, ...], np.dtype[np.bool_]]":
    """Return whether no obstacle hides each node; all sight lines run `height` above the ground.

    Uses a visibility table if there is one, with the same result. `tunnel` is the tunnel of a place (x, y); for a node
    it is known.
    """
    if not isinstance(place, tuple):
        table = ctx.graph.visibility_table(radius, height)
        if table is not None:
            return table.mask(place, nodes.ids)
    return is_unhidden(ctx, place, nodes, height, tunnel)


def is_unhidden(ctx: IContext, place: Place, nodes: NodeColumns, height: float, tunnel: int = 0) -> BoolArray:
    """Return whether no obstacle hides each node or an adjacent place, without a visibility table."""
    here = ground_at(ctx, place)
    there = ctx.graph.graph.ground(nodes.ids)
    origin = here.eyes(np.array([coordinates(ctx, place)]), height)[0]
    if there is None:
        return ctx.graph.visible(origin, at_height(nodes.xy, height))
    is_near: BoolArray = there.tunnels == (tunnel if isinstance(place, tuple) else here.tunnels)
    return is_near & ctx.graph.visible(origin, there.eyes(nodes.xy, height))


def ground_at(ctx: IContext, place: Place) -> NodeGround:
    """Return the ground at one place; for (x, y) the surface, at the height of the nearest node."""
    graph = ctx.graph.graph
    if not isinstance(place, tuple):
        ground = graph.ground([place])
    elif (ground := graph.ground([])) is not None:
        ground = graph.ground([int(graph.nearest_node(place[0], place[1]))])
        ground = ground and ground._replace(tunnels=_SURFACE.tunnels)
    return _SURFACE if ground is None else ground


def at_height(xy: FloatArray, height: float) -> FloatArray:
    """Return points (points, 3) above places (points, 2) of a flat map."""
    return np.column_stack([xy, np.full(len(xy), height)])


def on_ground(ctx: IContext, ids: IntArray, xy: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return the nodes as points (nodes, 3) on the ground, and a mask of those that are not in a tunnel."""
    ground = ctx.graph.graph.ground(ids)
    if ground is None:
        return at_height(xy, 0.0), np.ones(len(xy), np.bool_)
    return ground.eyes(xy, 0.0), ground.tunnels == 0
