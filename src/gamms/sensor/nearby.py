"""The agents near a place, cached until agents or the graph change.

`SensorCaches` holds all caches that the built-in sensors of a context share.
"""

from collections.abc import Collection, Iterable, Sequence
from functools import cached_property
from itertools import compress
from math import inf
from typing import NamedTuple

import numpy as np

from gamms import kernels
from gamms.core import sight
from gamms.deciding import get_phase
from gamms.errors import UnknownName
from gamms.ir.columns import ChangeLog
from gamms.ir.graph import FloatArray, IntArray, as_node_id
from gamms.ir.obstacles import BoolArray
from gamms.ir.positions import Positions
from gamms.sensor.sensor import ALL_AROUND
from gamms.sensor.views import (
    FULL_CIRCLE,
    OccludedViewCache,
    Place,
    ViewCache,
    Viewpoint,
    find_coordinates,
    place_on_ground,
)
from gamms.typing import IContext
from gamms.typing.graph_engine import IGraph
from gamms.typing.on_edges import Line, PassedNode

_SLACK = 1e-6  # map units: tolerance for boxes, because places on an edge are rounded
_MOST_RADII = 64  # radii for which agents are stored in cells
_MOST_NODES = 1 << 20  # nodes whose positions are cached
_SHARE_MOVED = 8  # if one agent in this many has moved, all are entered again


class Coordinates(NamedTuple):
    """The 3D positions of agents, in order of creation."""

    xyz: FloatArray  # (agents, 3)  position of the node, on the edge, or in the air
    is_flying: BoolArray  # (agents,)
    is_outside: BoolArray  # (agents,)  not in a tunnel

    def select(self, rows: IntArray) -> "Coordinates":
        """Return the positions of some agents."""
        return Coordinates(self.xyz[rows], self.is_flying[rows], self.is_outside[rows])


class NodePositions(dict[int, tuple[float, float]]):
    """A cache node id -> (x, y), filled on demand."""

    def __init__(self, ctx: IContext) -> None:
        self._ctx = ctx

    def __missing__(self, node: int) -> tuple[float, float]:
        place = find_coordinates(self._ctx, node)
        self[node] = place
        return place

    def renew(self, nodes: Iterable[int]) -> None:
        """Replace the cache by the given nodes (KeyError)."""
        self.clear()
        ids = [*dict.fromkeys(nodes)]
        self.update(zip(ids, map(tuple, self._ctx.graph.graph.positions(ids).tolist()), strict=True))


class NearbyAgents(sight.AgentIndex):
    """An index of the agents of one context, for sensors.

    Attributes:
        places_of_nodes: positions of nodes; valid after a query.
    """

    def __init__(self, ctx: IContext) -> None:
        self.places_of_nodes = NodePositions(ctx)
        super().__init__(get_phase(ctx), sight.AgentPositions(self.places_of_nodes))
        self._ctx = ctx
        self._graph: IGraph | None = None
        self._travellers = AgentsOnEdges(ctx)
        self._positions: Positions | None = None  # that were entered last
        self._moved_since: ChangeLog | None = None
        self._version = 0  # of these
        self._revision: int | None = None  # of the graph

    def find_living(self, x: float, y: float, radius: float) -> IntArray:
        """Return the rows of the living agents above and below a disc, ascending; other living agents may be included.

        Raises:
            UnknownName (KeyError): the node of an agent was removed.
        """
        positions = self._catch_up()
        reach = kernels.widen_distance(radius)
        rows = set(self._find_rows_within(positions, x, y, reach))
        is_near = (np.abs(positions.flyer_xyz[:, :2] - (x, y)) <= reach).all(axis=1)
        rows.update(positions.flyers[is_near].tolist())
        return np.array(sorted(rows.difference(positions.inactive)), np.int64)

    def get_positions(self, rows: IntArray) -> Coordinates:
        """Return the 3D positions of some agents, (rows,).

        Raises:
            UnknownName (KeyError): the node of an agent was removed.
        """
        positions = self._ctx.agent.positions
        # An agent on an edge has the height and the tunnel of the last node that it passed.
        xyz, is_on_surface = place_on_ground(self._ctx, positions.find_node_ids(rows), self.get_xy(rows))
        is_flying = np.isin(rows, positions.flyers)
        xyz[is_flying] = positions.flyer_xyz[np.searchsorted(positions.flyers, rows[is_flying])]
        return Coordinates(xyz, is_flying, is_on_surface | is_flying)

    def get_xy(self, rows: Sequence[int] | IntArray) -> FloatArray:
        """Return the map positions of some agents (rows, 2); agents on an edge are between its ends.

        Raises:
            UnknownName (KeyError): the node of an agent was removed.
        """
        positions = self._ctx.agent.positions
        xy = self._ctx.graph.graph.positions(positions.find_node_ids(rows))
        for number, row in enumerate(rows if positions.travellers else ()):
            if row in positions.travellers:
                xy[number] = self._travellers.find_position(positions, int(row)) or xy[number]
        return xy

    def find_by_name(self, place: Place, radius: float, own: str | None) -> dict[str, int]:
        """Return a fresh dict of the living agents within a radius of a place: name -> reported value.

        Args:
            place: the place of the sensor.
            radius: map units.
            own: name of an agent that is left out.
        """
        # NOTE: most looks of most games end here (benchmarks: peers).
        moment = self.phase.moment
        positions = self._positions
        if moment is None or moment is not self.moment or positions is None:
            positions = self._catch_up()
        if not positions.travellers:
            looks = self.sights.get(radius)
            found = self.find_sight(radius) if looks is None else looks
            if type(place) is int:
                return found.find_around_node(place, own or "")
            x, y = self._find_coordinates(place)
            return found.find_by_name(x, y, own or "")
        rows = self._find_rows_within(positions, *self._find_coordinates(place), radius)
        nodes = positions.name_rows(rows)
        nodes.update(self.find_on_edges(positions, rows))
        nodes.pop(own or "", None)
        return nodes

    def load_all_positions(self) -> bool:
        """Take all positions; return whether agents may be on edges."""
        return bool(self._catch_up().travellers)

    def find_on_edges(self, positions: Positions, rows: list[int]) -> dict[str, int]:
        """Return name -> reported value of the given agents that are on edges."""
        travellers = positions.travellers
        moving = [row for row in rows if row in travellers] if travellers else []
        return {positions.names[row]: self._travellers.make_sighting(positions, row) for row in moving}

    def find_around(self, view: Viewpoint, radius: float) -> tuple[Positions, list[int]]:
        """Return the positions, and the rows of the agents within `radius` of a viewpoint, the border included.

        Raises:
            UnknownName (KeyError): the node of an agent was removed.
        """
        positions = self._catch_up()
        return positions, self._find_rows_within(positions, view.x, view.y, radius)

    def find_ahead(
        self, view: Viewpoint, radius: float, heading: tuple[float, float], fov: float
    ) -> tuple[Positions, list[int]]:
        """Return `find_around` for agents in a field of view of `fov` radians around a heading (cos, sin)."""
        positions = self._catch_up()
        x = view.x
        y = view.y
        rows = self.find_sight(radius).find_rows_ahead(x, y, *kernels.compute_cone(heading, fov))
        if positions.travellers:
            moving = self._travellers.find_within(positions, (x, y), radius)
            dx, dy = (self.get_xy(moving) - (x, y)).T
            rows = sorted([*rows, *compress(moving, kernels.find_in_cone(dx, dy, heading, fov).tolist())])
        return positions, rows

    def _find_rows_within(self, positions: Positions, x: float, y: float, radius: float) -> list[int]:
        rows = self.find_sight(radius).find_rows(x, y)
        if positions.travellers:
            rows = sorted([*rows, *self._travellers.find_within(positions, (x, y), radius)])
        return rows

    def _find_coordinates(self, place: Place) -> tuple[float, float]:
        if isinstance(place, tuple):
            return find_coordinates(self._ctx, place)
        return self.places_of_nodes[
            place if type(place) is int else as_node_id(place, "The id of a node", self._ctx.graph)
        ]

    def find_sight(self, radius: float) -> sight.RangeSearch:
        """Return the search for a radius."""
        found = self.sights.get(radius)
        if found is None:
            if len(self.sights) >= _MOST_RADII:
                self.sights.clear()
            found = sight.RangeSearch(self.agents, radius, (radius, FULL_CIRCLE, ALL_AROUND))
            self.sights[radius] = found
        return found

    def _catch_up(self) -> Positions:
        """Update the index, and return the positions of agents."""
        moment = self.phase.moment
        if moment is not None and moment is self.moment and self._positions is not None:
            return self._positions
        if self.phase.agent is not None:
            self.phase.read_last_turn()  # which looks at agents itself
        graph = self._graph
        if graph is None:
            graph = self._ctx.graph.graph
            self._graph = graph
            with self.phase.suspend(changes_world=False):
                self.revised = getattr(graph, "revised", graph)
        revision = graph.revision
        positions = self._ctx.agent.positions
        version = positions.version
        self.moment = None
        self.entered = None
        if revision != self._revision or revision is None or positions is not self._positions:
            self._revision = None  # until all are entered
            if positions is not self._positions:
                self._positions = positions
                self._moved_since = positions.subscribe()
            self._enter_all(positions, is_new=True)
            self._revision = revision
        elif version != self._version:
            rows = self._moved_since.take()  # type: ignore[union-attr] # of these positions
            count = len(positions.names)
            if rows is None or count != self.agents.count or _SHARE_MOVED * len(rows) > count:
                self._enter_all(positions, is_new=len(self.places_of_nodes) > _MOST_NODES)
            else:
                self._enter(positions, rows)
        self._version = version
        self.moment = moment
        block = positions.block
        is_plain = not (block.flyers or block.travellers) and len(self.places_of_nodes) <= _MOST_NODES
        self.entered = block if is_plain and revision is not None else None
        self.epoch = self.phase.epoch
        self.version = block.structure.version
        self.revision = revision
        return positions

    def _enter_all(self, positions: Positions, *, is_new: bool) -> None:
        nodes = positions.nodes.tolist()
        try:
            if is_new:
                self.places_of_nodes.renew(nodes)
            self.agents.fill(positions.get_names(), nodes)
        except UnknownName:
            self._revision = None
            lost = next(row for row, node in enumerate(nodes) if not self._ctx.graph.graph.has_node(node))
            raise UnknownName(f"node under agent {positions.names[lost]!r}:", nodes[lost]) from None
        inactive = positions.inactive
        travellers = positions.travellers
        for row in {*inactive, *travellers} if inactive or travellers else ():
            self.agents.put(row, nodes[row], is_seen=_is_on_node(positions, row))
        for one in self.sights.values():
            one.is_built = False

    def _enter(self, positions: Positions, rows: Collection[int]) -> None:
        node_of = positions.block.get_node
        sights = list(self.sights.values())
        for row in rows:
            self.agents.put(row, node_of(row), is_seen=_is_on_node(positions, row))
            for one in sights:
                one.move(row)


def _is_on_node(positions: Positions, row: int) -> bool:
    """Return whether an agent is alive and not on an edge."""
    if row in positions.inactive:
        return False
    return row not in positions.travellers or positions.get_edge_position(row) is None


class AgentsOnEdges:
    """The agents on edges, found by the boxes around their edges, and by exact positions where needed.

    An agent that moves along its edge does not change its box, so that many queries during a turn stay cheap
    (benchmarks: travel).
    """

    def __init__(self, ctx: IContext) -> None:
        self._ctx = ctx
        self._moved: ChangeLog | None = None
        self._key: tuple[Positions | None, int | None, int] = (None, None, 0)
        self._boxes: FloatArray = np.zeros((4, 0))  # (4, agents)  minimum x, y, maximum x, y; NaN for agents on nodes
        self._edges: dict[int, tuple[Line, float]] = {}  # by row: the present or last edge, and its length
        self._places: dict[int, tuple[float, float] | None] = {}  # by row

    def find_position(self, positions: Positions, row: int) -> tuple[float, float] | None:
        """Return the position of an agent on an edge, or at its node if the edge was removed; None for others."""
        self._catch_up(positions)
        return self._locate_agent(positions, row)

    def find_within(self, positions: Positions, place: tuple[float, float], radius: float) -> list[int]:
        """Return the rows of the living agents on edges within `radius` of a place, the border included, ascending."""
        self._catch_up(positions)
        x, y = place
        reach = radius + _SLACK
        left, low, right, high = self._boxes
        is_near = (left <= x + reach) & (right >= x - reach) & (low <= y + reach) & (high >= y - reach)
        found = []
        for row in np.flatnonzero(is_near).tolist():
            at_x, at_y = self._locate_agent(positions, row) or (inf, inf)
            dx = at_x - x
            dy = at_y - y
            if dx * dx + dy * dy <= radius * radius and row not in positions.inactive:
                found.append(row)
        return found

    def make_sighting(self, positions: Positions, row: int) -> int:
        """Return the reported value of an agent: its last node, with its position on the edge."""
        node: int = positions.block.get_node(row)
        progress = positions.get_edge_position(row)
        xy = None if progress is None else self.find_position(positions, row)
        if progress is None or xy is None or not self._edges[row][0].lengths:
            return node
        edge = progress.source, progress.target, progress.edge
        return PassedNode(node, edge, progress.share * self._edges[row][1], xy)

    def _locate_agent(self, positions: Positions, row: int) -> tuple[float, float] | None:
        if row not in self._places:
            progress = positions.get_edge_position(row)
            self._places[row] = None if progress is None else self._edges[row][0].find_point(progress.share)[:2]
        return self._places[row]

    def _catch_up(self, positions: Positions) -> None:
        """Update the edges of agents that are now on other edges, and clear cached positions."""
        graph = self._ctx.graph.graph
        key = positions, graph.revision, positions.version
        if key == self._key and graph.revision is not None:
            return
        if self._moved is None or positions is not self._key[0]:
            self._moved = positions.subscribe()
        rows = self._moved.take()
        size = len(positions.names)
        if rows is None or graph.revision is None or graph.revision != self._key[1] or self._boxes.shape[1] != size:
            self._boxes = np.full((4, size), np.nan)
            rows = set(positions.travellers)
            self._edges = {}
        self._key = key
        self._places = {}
        for row in rows:
            progress = positions.get_edge_position(row)
            if progress is None:
                self._boxes[:, row] = np.nan
                continue
            try:
                edge = graph.get_edge(progress.edge)
                points = edge.points
                length = edge.length
            except UnknownName:  # the edge was removed: the agent counts as on its node
                points = find_coordinates(self._ctx, progress.source)
                length = 0.0
            xs = points[::2]
            ys = points[1::2]
            self._boxes[:, row] = min(xs), min(ys), max(xs), max(ys)
            self._edges[row] = Line.from_flat(points), length


class SensorCaches:
    """The caches shared by the sensors of one context, each made when it is used first."""

    def __init__(self, ctx: IContext) -> None:
        self._ctx = ctx

    @cached_property
    def views(self) -> ViewCache:
        """Views by place."""
        return ViewCache(self._ctx)

    @cached_property
    def views_past_obstacles(self) -> OccludedViewCache:
        """Views by place, past obstacles."""
        return OccludedViewCache(self._ctx)

    @cached_property
    def nearby(self) -> NearbyAgents:
        """The index of agents."""
        return NearbyAgents(self._ctx)


def get_caches(ctx: IContext) -> SensorCaches:
    """Return the caches of the context's sensor engine; new ones for a sensor in a custom engine."""
    shared = getattr(getattr(ctx.sensor, "storage", None), "memory", None)
    return shared if isinstance(shared, SensorCaches) else SensorCaches(ctx)
