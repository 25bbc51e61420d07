"""What the built-in sensors of a context share: what is seen from a place, and where all agents are.

Both are remembered as long as the world stays as it is.
"""

from collections.abc import Callable, Collection, Hashable, Iterable
from math import inf, pi
from typing import Any, NamedTuple

import numpy as np

from gamms import kernels
from gamms.arguments import as_int
from gamms.errors import UnknownName
from gamms.ir.columns import ChangeLog
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.ir.positions import Positions
from gamms.sensor import fov_geometry
from gamms.typing import IContext
from gamms.typing.graph_engine import IGraph, NodeColumns, NodeGround, Surroundings
from gamms.typing.on_edges import Line, PassedNode

FULL_CIRCLE = 2.0 * pi

Sector = tuple[float, tuple[float, float], float]  # radius, heading (cos, sin), full opening angle
Place = int | tuple[float, ...]  # the id of a node, or (x, y)

_FAR_BEYOND = 3.0  # how far an area is measured, in distances to the farthest node along an axis
_MOST_AREAS = 1000
_MOST_WORDS = 1 << 24  # of 8 bytes: what may be remembered in all
_PART = 8  # one in so many views is forgotten when there are too many
_WORDS_PER_NODE = 12  # of a dict entry
_SURFACE = NodeGround(np.zeros(1), np.zeros(1, np.int64))  # of a flat map
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
        """Return what a map sensor sees; shared, and therefore not to be changed."""
        # NOTE: the graph is asked for once: three properties cost a third of a look (benchmarks: sense).
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

    def known_ids(self, place: Place, radius: float) -> Iterable[int] | None:
        """Return the ids of the nodes within a radius of a place, if a sensor has looked there already."""
        if self._revision is None or self._revision != self._ctx.graph.graph.revision:
            return None
        seen = self._seen.get(radius, {}).get(place)
        return None if seen is None else seen.nodes

    def _ahead(self, place: Place, radius: float, fov: float, heading: tuple[float, float]) -> Surroundings:
        graph = self._ctx.graph.graph
        if isinstance(place, tuple):
            return graph.among(nodes_ahead(self._ctx, place, radius, fov, heading).ids)
        return graph.within(place, radius, fov, heading)

    def _forget(self, revision: object) -> None:
        self._revision = revision
        self._seen.clear()
        self._words = 0

    def _keep(self, kind: Hashable, place: Place, seen: Surroundings) -> Surroundings:
        """Remember a view, if it is small enough; when there are too many, one in a few is forgotten."""
        words = _words(seen)
        if self._revision is None or words > _MOST_WORDS:
            return seen
        if self._words + words > _MOST_WORDS:
            self._drop(words)
        self._words += words
        self._seen.setdefault(kind, {})[place if isinstance(place, tuple) else int(place)] = seen
        return seen

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
    ) -> Surroundings:
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


# -- agents ----------------------------------------------------------------------------------------------------------


_MOST_IDS = 1 << 22  # of nodes: what may be remembered in all
_SLACK = 1e-6  # map units: boxes are compared with this tolerance, because places on an edge are rounded
_MANY_AGENTS = 128  # so many are found for all that look
_FAR = 1e150  # of which squares are infinite
_WIDE = 4096  # nodes: a disc with more is compared with the places of all agents instead


class Coordinates(NamedTuple):
    """Where all agents are on the map, in the order of their creation."""

    xyz: FloatArray  # (agents, 3)  of the node or the place on an edge, on the ground, or of an agent that flies
    xy: FloatArray  # (agents, 2)  of the node, or of the place on an edge
    is_flying: BoolArray  # (agents,)
    is_outside: BoolArray  # (agents,)  not in a tunnel


class NearbyAgents:
    """The agents of one context, as sensors find them."""

    def __init__(self, ctx: IContext, views: Views) -> None:
        self._ctx = ctx
        self._views = views
        self._graph: IGraph | None = None
        self._key: tuple[Positions | None, int, int | None] = (None, 0, None)
        self._coordinates: Coordinates | None = None
        self._travellers = Travellers(ctx)
        self._looks = LooksOfAll()
        self._checked: tuple[Positions | None, int | None] = (None, None)  # that no agent is on a removed node
        self._revision: int | None = None  # of the graph that the discs are of
        self._discs: dict[float, dict[Place, Collection[int] | None]] = {}
        self._ids: dict[int, int] = {}  # one object per id
        self._kept = 0

    def coordinates(self) -> Coordinates:
        """Return where all agents are on the map.

        Raises:
            UnknownName (KeyError): an agent stands on a node that was removed.
        """
        positions, graph = self._ctx.agent.positions, self._ctx.graph.graph
        key = (positions, positions.version, graph.revision)
        if self._coordinates is None or key != self._key or key[2] is None:
            xy = self._xy_of(positions)
            for row in positions.travellers:
                xy[row] = self._travellers.place(positions, row) or xy[row]
            # On an edge an agent is as high as the node that it passed last, and in its tunnel.
            xyz, is_on_surface = on_ground(self._ctx, positions.node_ids, xy)
            is_flying = np.zeros(len(xy), np.bool_)
            xyz[positions.flyers], is_flying[positions.flyers] = positions.flyer_xyz, True
            self._coordinates = Coordinates(xyz, xy, is_flying, is_on_surface | is_flying)
            self._key = key
        return self._coordinates

    def xy(self, rows: list[int]) -> FloatArray:
        """Return where some agents are on the map (rows, 2)."""
        positions = self._ctx.agent.positions
        if not positions.travellers:
            found: FloatArray = self.coordinates().xy[rows]
            return found
        xy = self._xy_of(positions, rows)
        for i, row in enumerate(rows):
            xy[i] = self._travellers.place(positions, row) or xy[i]
        return xy

    def nodes_by_name(self) -> dict[str, int]:
        """Return a fresh dict of all living agents: name -> id of the node."""
        positions, revision = self._ctx.agent.positions, self._ctx.graph.graph.revision
        if (positions, revision) != self._checked or revision is None:
            self._xy_of(positions)  # which finds agents on removed nodes
            self._checked = positions, revision
        nodes = dict(positions.by_name)
        if positions.travellers:
            nodes.update(self.on_edges(positions, sorted(set(positions.travellers) - set(positions.inactive))))
        return nodes

    def on_edges(self, positions: Positions, rows: list[int]) -> dict[str, int]:
        """Return what is reported of those agents that are on edges, by their names."""
        travellers = positions.travellers
        moving = [row for row in rows if row in travellers] if travellers else []
        return {positions.names[row]: self._travellers.sighting(positions, row) for row in moving}

    def within(self, place: Place, radius: float) -> tuple[Positions, list[int]]:
        """Return where agents are, and the rows of those within `radius` of a place, the rim included.

        Raises:
            UnknownName (KeyError): there is no such node, or an agent stands on one that was removed.
        """
        graph = self._graph = self._ctx.graph.graph if self._graph is None else self._graph
        revision = graph.revision
        if revision != self._revision or revision is None:
            self._forget(revision)
        positions, looks = self._ctx.agent.positions, self._looks
        if radius == inf:
            self._checked_place(place)
            return positions, positions.living.tolist()
        are_many = len(positions.names) >= _MANY_AGENTS
        if are_many and type(place) is int and looks.are_frequent(radius, positions):
            found = looks.known(radius, place, self.coordinates)
            if found is not None:
                return positions, found
        try:
            disc = self._discs[radius][place]
        except (KeyError, TypeError):  # not known, or not hashable
            disc = self._disc(self._checked_place(place), radius, are_many=are_many)
        if disc is None:
            return positions, self._compared(place, radius)
        rows = positions.rows_on(disc)
        if are_many:
            looks.note(radius, len(rows))
        if positions.travellers:
            rows = sorted([*rows, *self._travellers.within(positions, coordinates(self._ctx, place), radius)])
        return positions, rows

    def _checked_place(self, place: Place) -> Place:
        known = place if isinstance(place, tuple) else as_int(place, "The id of a node")
        coordinates(self._ctx, known)  # it is there
        return known

    def _forget(self, revision: int | None) -> None:
        self.coordinates()  # which finds agents on removed nodes
        self._revision, self._kept = revision, 0
        self._looks = LooksOfAll()
        self._discs.clear()
        self._ids.clear()

    def _disc(self, place: Place, radius: float, *, are_many: bool) -> Collection[int] | None:
        """Return the ids of the nodes in a disc; None where there are too many to remember."""
        ids = self._views.known_ids(place, radius)
        if ids is None:
            x, y = coordinates(self._ctx, place)
            ids = self._ctx.graph.graph.nodes_near(x, y, radius).ids.tolist()
        # NOTE: a tuple of shared ints is a sixth of a set, and what counts is how much memory a look touches
        # (benchmarks: 1,000 agents in Helsinki). Few agents are looked up in the set.
        disc = tuple([self._ids.setdefault(id, id) for id in ids]) if are_many else {*ids}
        kept = disc if len(disc) <= _WIDE else None
        if self._kept > _MOST_IDS:
            self._discs.clear()
            self._kept = 0
        self._discs.setdefault(radius, {})[place] = kept
        self._kept += 16 + len(kept or ())
        return kept

    def _compared(self, place: Place, radius: float) -> list[int]:
        xy, living = self.coordinates().xy, self._ctx.agent.positions.living
        dx, dy = (xy[living] - coordinates(self._ctx, place)).T
        with np.errstate(over="ignore"):  # infinitely far away is far away
            rows: list[int] = living[dx * dx + dy * dy <= radius * radius].tolist()
        return rows

    def _xy_of(self, positions: Positions, rows: list[int] | None = None) -> FloatArray:
        """Return where the nodes are that some agents are on, or have passed last (rows, 2); None: of all."""
        graph, nodes = self._ctx.graph.graph, positions.node_ids if rows is None else positions.node_ids[rows]
        try:
            return graph.positions(nodes)
        except UnknownName:
            lost = next(i for i, node in enumerate(nodes.tolist()) if not graph.has_node(node))
            name = positions.names[lost if rows is None else rows[lost]]
            raise UnknownName(f"node under agent {name!r}:", int(nodes[lost])) from None


class LooksOfAll:
    """Who is around each node with an agent on it, worked out at once for ranges at which many agents look.

    These are the ranges of so many looks before agents last moved. In the paper's loop, in which each agent moves after
    its look, there are none (benchmarks: where it broke).
    """

    def __init__(self) -> None:
        self._frequent: frozenset[float] = frozenset()
        self._positions: Positions | None = None
        self._version = 0
        self._looks: dict[float, int] = {}  # range -> looks since agents moved
        self._found: dict[float, int] = {}  # range -> the agents that were found since then
        self._around: dict[float, dict[int, list[int]]] = {}

    def are_frequent(self, radius: float, positions: Positions) -> bool:
        """Whether many agents look as far as that; what was found before agents moved is forgotten."""
        version = positions.version
        if version != self._version or positions is not self._positions:
            self._begin(positions, version)
        looks = self._looks
        looks[radius] = looks.get(radius, 0) + 1
        return radius in self._frequent

    def _begin(self, positions: Positions, version: int) -> None:
        agents = len(positions.names)
        often = [radius for radius, looks in self._looks.items() if looks * _PART >= agents]
        self._frequent = frozenset(r for r in often if self._found.get(r, 0) * agents <= self._looks[r] * _MOST_IDS)
        self._positions, self._version = positions, version
        for noted in (self._looks, self._found, self._around):
            noted.clear()

    def note(self, radius: float, found: int) -> None:
        """Note how many agents a look has found."""
        self._found[radius] = self._found.get(radius, 0) + found

    def known(self, radius: float, node: int, coordinates: Callable[[], Coordinates]) -> list[int] | None:
        """Return the rows of the living agents within a range of a node, ascending; None: it is worked out alone."""
        around = self._around.get(radius)
        if around is None:
            around = self._around[radius] = self._all(radius, coordinates().xy)
            self.note(radius, sum(map(len, around.values())))
        return around.get(node)

    def _all(self, radius: float, xy: FloatArray) -> dict[int, list[int]]:
        positions: Positions = self._positions  # type: ignore[assignment] # `are_frequent` was called
        if positions.travellers or not max(radius, float(np.abs(xy).max())) < _FAR:
            return {}
        living = positions.living
        nodes, first = np.unique(positions.node_ids, return_index=True)
        (x, y), (x1, y1), group = xy[first].T, xy[living].T, np.zeros(len(xy), np.int64)
        here, there = kernels.Area(x, y, group[: len(x)]), kernels.Area(x1, y1, group[: len(x1)])
        parts = [*kernels.near_each_other(here, there, radius)]
        at, others = (np.concatenate([part[side] for part in parts]) for side in (0, 1))
        ends, rows = np.searchsorted(at, np.arange(len(nodes) + 1)).tolist(), living[others].tolist()
        return {node: rows[begin:end] for node, begin, end in zip(nodes.tolist(), ends, ends[1:], strict=False)}


class Travellers:
    """The agents on edges, as sensors find them: by the boxes around their edges, and exactly where that is not enough.

    An agent that goes on along its edge changes no box, so that many agents can be asked in the course of a turn
    (benchmarks: travel).
    """

    def __init__(self, ctx: IContext) -> None:
        self._ctx = ctx
        self._moved: ChangeLog | None = None
        self._key: tuple[Positions | None, int | None, int] = (None, None, 0)
        self._boxes: FloatArray = np.zeros((4, 0))  # (4, agents)  least x, y, greatest x, y; NaN for those on nodes
        self._edges: dict[
            int, tuple[Line, float]
        ] = {}  # by row, of the edge that one is on, or was last, and its length
        self._places: dict[int, tuple[float, float] | None] = {}  # by row

    def place(self, positions: Positions, row: int) -> tuple[float, float] | None:
        """Return where an agent is that is on an edge; None for others. Where the edge is gone, it is at its node."""
        self._catch_up(positions)
        return self._place(positions, row)

    def within(self, positions: Positions, place: tuple[float, float], radius: float) -> list[int]:
        """Return the rows of the living agents on edges within `radius` of a place, the rim included, ascending."""
        self._catch_up(positions)
        (x, y), reach, (left, low, right, high) = place, radius + _SLACK, self._boxes
        is_near = (left <= x + reach) & (right >= x - reach) & (low <= y + reach) & (high >= y - reach)
        found = []
        for row in np.flatnonzero(is_near).tolist():
            at_x, at_y = self._place(positions, row) or (inf, inf)
            dx, dy = at_x - x, at_y - y
            if dx * dx + dy * dy <= radius * radius and row not in positions.inactive:
                found.append(row)
        return found

    def sighting(self, positions: Positions, row: int) -> int:
        """Return what is reported of an agent: the node that it is on or has passed, and where on an edge it is."""
        node, progress = positions.nodes[row], positions.on_edge(row)
        xy = None if progress is None else self.place(positions, row)
        if progress is None or xy is None or not self._edges[row][0].lengths:
            return node
        edge = progress.source, progress.target, progress.edge
        return PassedNode(node, edge, progress.share * self._edges[row][1], xy)

    def _place(self, positions: Positions, row: int) -> tuple[float, float] | None:
        if row not in self._places:
            progress = positions.on_edge(row)
            self._places[row] = None if progress is None else self._edges[row][0].at(progress.share)[:2]
        return self._places[row]

    def _catch_up(self, positions: Positions) -> None:
        """Find the edges of the agents that are on others now, and forget where agents were."""
        graph = self._ctx.graph.graph
        key = positions, graph.revision, positions.version
        if key == self._key and graph.revision is not None:
            return
        if self._moved is None or positions is not self._key[0]:
            self._moved = positions.subscribe()
        rows, size = self._moved.take(), len(positions.names)
        if rows is None or graph.revision is None or graph.revision != self._key[1] or self._boxes.shape[1] != size:
            self._boxes, rows, self._edges = np.full((4, size), np.nan), set(positions.travellers), {}
        self._key, self._places = key, {}
        for row in rows:
            progress = positions.on_edge(row)
            if progress is None:
                self._boxes[:, row] = np.nan
                continue
            try:
                edge = graph.get_edge(progress.edge)
                points, length = edge.points, edge.length
            except UnknownName:  # it is gone: the agent counts as on its node
                points, length = coordinates(self._ctx, progress.source), 0.0
            xs, ys = points[::2], points[1::2]
            self._boxes[:, row] = min(xs), min(ys), max(xs), max(ys)
            self._edges[row] = Line.of(points), length


# -- both ------------------------------------------------------------------------------------------------------------


class Memory:
    """What sensors share; one per context.

    Attributes:
        views, views_past_obstacles: what was seen from where.
        nearby: which agents are near a place.
    """

    def __init__(self, ctx: IContext) -> None:
        self.views = Views(ctx)
        self.views_past_obstacles = ViewsPastObstacles(ctx)
        self.nearby = NearbyAgents(ctx, self.views)


def memory_of(ctx: IContext) -> Memory:
    """Return the memory of the context's sensor engine; one of its own for a sensor in an engine of another class."""
    shared = getattr(getattr(ctx.sensor, "storage", None), "memory", None)
    return shared if isinstance(shared, Memory) else Memory(ctx)
