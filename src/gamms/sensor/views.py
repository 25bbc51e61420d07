"""What is seen from a place of the nodes and edges around, remembered as long as they stay as they are."""

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

_FAR_BEYOND = 3.0  # how far an area is measured, in distances to the farthest node along an axis
_MOST_AREAS = 1000
_MOST_WORDS = 1 << 24  # of 8 bytes: what may be remembered in all, but for arrays of ids
_PART = 8  # one in so many views is forgotten when there are too many
_WORDS_PER_NODE = 7  # of a dict entry, at most
_SURFACE = NodeGround(np.zeros(1), np.zeros(1, np.int64))  # of a flat map
_WORDS_PER_VIEW = 100  # of its key and its empty containers
_FEW_MISSES = 4  # looks of a moment that are answered one by one, and
_AGENTS_PER_MISS = 512  # one more for each so many agents
_FEWEST, _MOST_AHEAD = 16, 4096  # views that are worked out together
_GROWTH = 4
_MOST_BEHIND = 64  # looks from nodes that were passed, before it goes back to one, and
_NODES_PER_LOOK_BEHIND = 16  # one more for each so many nodes
_SHARE_AHEAD = 4  # one in so many words may be of views that are worked out together
_MOST_RADII = 64  # at which looks are counted


class View(Surroundings):
    """What is seen from a place, to be shared, and not to be changed."""

    @cached_property
    def node_ids(self) -> IntArray:
        """The ids of the nodes, (nodes,)."""
        return np.array([*self.nodes], np.int64)

    @cached_property
    def edge_ids(self) -> IntArray:
        """The ids of the edges, (edges,)."""
        return np.array([edge.id for edge in self.edges], np.int64)


class LooksToCome:
    """What agents will see all around within one radius that have not looked yet at this moment.

    While agents decide, all see the same world, and look in the order of their names. So where several looks were from
    nodes that are not known, what the next agents will see is worked out together: for more and more of them, as long
    as most of it is looked at.

    Attributes:
        views: by node; a look takes its own out.
        words: what these take in memory.
        largest: what a view that was worked out by itself takes, at most.
    """

    __slots__ = (
        *("_begin", "_behind", "_end", "_made", "_misses", "_nodes", "_places", "_size", "_wait", "_waited"),
        *("largest", "views", "words"),
    )

    def __init__(self) -> None:
        self._size, self._wait, self._waited, self._made, self.largest = _FEWEST, 0, 0, 0, 1
        self.views: dict[int, Surroundings] = {}
        self.begin()

    def begin(self) -> None:
        """Begin again, as agents may have moved."""
        self.judge()
        self._misses = self._begin = self._end = self._behind = 0
        self._nodes: list[int] | None = None  # from which agents look, in their order
        self._places: dict[int, int] = {}  # of these in it

    def judge(self) -> None:
        """Forget what was not looked at; work out more the next time, or less and later."""
        unused, self.views, self.words = len(self.views), {}, 0
        if not self._made:
            return
        if 2 * unused <= self._made:
            self._size, self._waited = min(_GROWTH * self._size, _MOST_AHEAD), 0
        else:
            self._size = max(self._size // _GROWTH, _FEWEST)
            self._wait = self._waited = min(2 * self._waited + _FEWEST, _MOST_AHEAD)
        self._made = 0

    def is_due(self, node: int, positions: Positions) -> bool:
        """Count a look from a node that is not known, and return whether to work out what the next ones see."""
        self._misses += 1
        # NOTE: to sort 10,000 agents takes as long as 20 looks (benchmarks: looks of many agents).
        if self._wait or self._misses <= _FEW_MISSES + len(positions.names) // _AGENTS_PER_MISS:
            self._wait = max(self._wait - 1, 0)
            return False
        if self._nodes is None:
            names, nodes = positions.names, positions.nodes
            rows = sorted(positions.living_rows, key=names.__getitem__)
            self._nodes = list(dict.fromkeys([nodes[row] for row in rows]))
            self._places = dict(zip(self._nodes, count(), strict=False))
        place = self._places.get(node)
        if place is None:
            return False
        most_behind = _MOST_BEHIND + len(self._nodes) // _NODES_PER_LOOK_BEHIND
        if place < self._end and self._behind < most_behind:  # the view was known, and was forgotten since
            self._behind += 1
            return False
        self._behind = 0
        self._begin = self._end = place
        return True

    def most(self) -> int:
        """Return how many views to work out together."""
        return min(self._size, _MOST_WORDS // _SHARE_AHEAD // self.largest)

    def next_nodes(self, known: Container[int]) -> list[int]:
        """Return nodes that are not known from which agents look next; none where they are few."""
        found, nodes, most = list[int](), self._nodes or (), self.most()
        place = self._begin
        while place < len(nodes) and len(found) < most:
            if nodes[place] not in known:
                found.append(nodes[place])
            place += 1
        self._end = place
        return found if len(found) >= _FEWEST // 2 else []

    def take(self, nodes: list[int], seen: list[Surroundings], most_words: int) -> None:
        """Keep what is seen from nodes, until it takes so many words."""
        for node, view in zip(nodes, seen, strict=True):
            words = _words(view)
            if self.words + words > most_words:
                break
            self.views[node] = view
            self.words += words
        self._made = len(self.views)

    def stop(self) -> None:
        """Work nothing out until agents have moved."""
        self._nodes, self._places = [], {}


class Views:
    """Surroundings by radius and field of view, and by place."""

    def __init__(self, ctx: IContext) -> None:
        self._ctx, self._phase = ctx, phase_of(ctx)
        self._graph: IGraph | None = None
        self._moment: object = None
        self._revision: Any = None
        self._seen: dict[Any, dict[Any, View]] = {}
        self._words = 0
        self._to_come: dict[float, LooksToCome] = {}  # by radius
        self._has_missed = False  # whether there is something in them of this moment

    def look(self, place: Place, radius: float, fov: float, heading: tuple[float, float]) -> View:
        """Return what a map sensor sees."""
        # NOTE: the graph is asked for once, and for its revision once in a turn: three properties cost a third of a
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
        if kind == inf:  # the whole graph looks alike from everywhere
            coordinates(self._ctx, place)
            key = -1
        try:
            return self._seen[kind][key]
        except KeyError:
            return self._keep(kind, key, self._ahead(place, radius, fov, heading))
        except TypeError:  # not hashable
            return self.look(as_int(place, "The id of a node"), radius, fov, heading)

    def known(self, radius: float) -> Mapping[Place, View]:
        """Return what sensors have seen all around within a finite radius, by place, as far as it is remembered."""
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
        """Return what is seen all around a node as agents decide."""
        looks = self._to_come.get(radius)
        if looks is None:
            if len(self._to_come) >= _MOST_RADII:
                self._begin_looks()
                self._to_come.clear()
            looks = self._to_come[radius] = LooksToCome()
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
            except UnknownName:  # an agent stands on a node that was removed
                looks.stop()
            else:
                looks.take(nodes[1:], others, _MOST_WORDS - self._words)
                self._words += looks.words
                return seen
        seen = graph.within(node, radius)
        looks.largest = max(looks.largest, _words(seen))
        return seen

    def _next_nodes(self, looks: LooksToCome, node: int, radius: float) -> list[int]:
        """Return the nodes from which to look together, this one first; none where it does not pay."""
        if not looks.is_due(node, self._ctx.agent.positions):
            return []
        self._words -= looks.words
        looks.judge()
        nodes, words = looks.next_nodes(self._seen.get(radius, {})), looks.most() * looks.largest
        if nodes and self._words + words > _MOST_WORDS:  # now, and not before those look whose views are known
            self._drop(words)
            has_room = self._words + words <= _MOST_WORDS
            nodes = looks.next_nodes(self._seen.get(radius, {})) if has_room else []
        return nodes

    def _begin_looks(self) -> None:
        """Forget what was worked out for looks that have not come, as agents may have moved."""
        for looks in self._to_come.values():
            self._words -= looks.words
            looks.begin()
        self._has_missed = False

    def _forget(self, revision: object) -> None:
        self._revision = revision
        self._seen.clear()
        self._words = 0

    def _keep(self, kind: Hashable, place: Place, seen: Surroundings) -> View:
        """Remember a view, if it is small enough; when there are too many, one in a few is forgotten."""
        words, view = _words(seen), View(*seen)
        if self._revision is None or words > _MOST_WORDS:
            return view
        if self._words + words > _MOST_WORDS:
            self._drop(words)
            if self._words + words > _MOST_WORDS:  # what others will look at takes it
                return view
        self._words += words
        self._seen.setdefault(kind, {})[place if isinstance(place, tuple) else int(place)] = view
        return view

    def _drop(self, words: int) -> None:
        """Forget one in a few views of each kind, until so much memory is free."""
        # NOTE: not the oldest: who looks from more places in turn than are kept would find none of them
        # (benchmarks: where it broke).
        while self._seen and self._words + words > _MOST_WORDS:
            for kind, views in list(self._seen.items()):
                for place in list(views)[::_PART]:
                    self._words -= _words(views.pop(place))
                if not views:
                    del self._seen[kind]


def _words(seen: Surroundings) -> int:
    return _WORDS_PER_VIEW + _WORDS_PER_NODE * len(seen.nodes) + len(seen.edges)


class ViewsPastObstacles(Views):
    """The same, without what is behind an obstacle."""

    def __init__(self, ctx: IContext) -> None:
        super().__init__(ctx)
        self._areas: dict[Any, FloatArray] = {}

    def look_past(
        self, place: Place, radius: float, fov: float, heading: tuple[float, float], height: float, tunnel: int = 0
    ) -> View:
        """Return what a map sensor sees whose sight lines run `height` above the ground; `tunnel` as for `in_sight`."""
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
        """Return the corners (corners, 2) of what is in sight of a sector, cut off far beyond the map."""
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
        level = float(ground_at(self._ctx, place).z[0]) + height  # the area is cut where the eyes are
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
        if table is not None and table.radius == radius:  # it has looked at what is in range already
            ids = table.from_node(place)  # type: ignore[arg-type] # a pair has no table
            nodes = NodeColumns(ids, self._ctx.graph.graph.positions(ids))
            return ahead_of(nodes, *coordinates(self._ctx, place), fov, heading).ids
        nodes = nodes_ahead(self._ctx, place, radius, fov, heading)
        return nodes.ids[in_sight(self._ctx, place, nodes, radius, height, tunnel)]


def coordinates(ctx: IContext, place: Place) -> tuple[float, float]:
    """Return (x, y) of a place.

    Raises:
        UnknownName (KeyError): there is no such node.
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
    """Return those nodes that are inside the field of view from (x, y)."""
    if fov == FULL_CIRCLE or heading == (0.0, 0.0):
        return nodes
    ids, xy = nodes
    is_ahead = kernels.in_cone(xy[:, 0] - x, xy[:, 1] - y, heading, fov)
    return NodeColumns(ids[is_ahead], xy[is_ahead])


def in_sight(
    ctx: IContext, place: Place, nodes: NodeColumns, radius: float, height: float, tunnel: int = 0
) -> "np.ndarray[tuple[int, ...], np.dtype[np.bool_]]":
    """Return whether no obstacle hides each node; all sight lines run `height` above the ground.

    A visibility table answers if there is one; it was made of the same sight lines. `tunnel` is that of a place
    (x, y); that of a node is known.
    """
    if not isinstance(place, tuple):
        table = ctx.graph.visibility_table(radius, height)
        if table is not None:
            return table.mask(place, nodes.ids)
    return is_unhidden(ctx, place, nodes, height, tunnel)


def is_unhidden(ctx: IContext, place: Place, nodes: NodeColumns, height: float, tunnel: int = 0) -> BoolArray:
    """Return whether no obstacle hides each node, or a place beside it, without asking a table."""
    here, there = ground_at(ctx, place), ctx.graph.graph.ground(nodes.ids)
    origin = here.eyes(np.array([coordinates(ctx, place)]), height)[0]
    if there is None:
        return ctx.graph.visible(origin, at_height(nodes.xy, height))
    is_near: BoolArray = there.tunnels == (tunnel if isinstance(place, tuple) else here.tunnels)
    return is_near & ctx.graph.visible(origin, there.eyes(nodes.xy, height))


def ground_at(ctx: IContext, place: Place) -> NodeGround:
    """Return the ground at one place; at (x, y) that of the surface, as high as the nearest node."""
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
    """Return the nodes as points (nodes, 3) on the ground, and which of them are not in a tunnel."""
    ground = ctx.graph.graph.ground(ids)
    if ground is None:
        return at_height(xy, 0.0), np.ones(len(xy), np.bool_)
    return ground.eyes(xy, 0.0), ground.tunnels == 0
