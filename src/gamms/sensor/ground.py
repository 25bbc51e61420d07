"""Sensors on the ground: NEIGHBOR, MAP, RANGE, ARC, the AGENT kinds, and their occluded variants."""

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from math import pi
from typing import Any, cast

import numpy as np

from gamms import kernels
from gamms.arguments import as_float, as_numbers, as_range
from gamms.core import sight
from gamms.deciding import refuse_while_deciding
from gamms.errors import BadType, UnknownName
from gamms.ir.graph import FloatArray, IntArray, as_node_id, as_node_ids, split_mode
from gamms.ir.positions import Positions
from gamms.ir.sensor_results import LookResults, SensorView, make_results
from gamms.sensor import fov_geometry
from gamms.sensor.detection import DetectingSensor
from gamms.sensor.nearby import get_caches
from gamms.sensor.sensor import ALL_AROUND, Heading, Sensor, refuse_set_data
from gamms.sensor.sighting_errors import LookDraws
from gamms.sensor.views import (
    FULL_CIRCLE,
    Place,
    View,
    Viewpoint,
    find_coordinates,
    find_in_sight,
    find_nodes_ahead,
    is_unhidden,
)
from gamms.typing import IContext
from gamms.typing.graph_engine import NodeColumns
from gamms.typing.sensor_engine import SensorType


class GroundSensor(Sensor):
    """A sensor on the ground, which looks from a given node or from a fixed place.

    The sight lines of an occluded sensor run from its place to each node, with both ends `observer_height` above the
    ground. Nodes behind an obstacle are not seen; the node of the sensor always is.

    Args:
        ctx: the context.
        sensor_id: name of the sensor.
        sensor_type: kind of the sensor.
        sensor_range: map units; may be infinite.
        fov: full opening angle in radians; exactly 2 pi sees in all directions.
        orientation: `(cos, sin)` relative to the owner's heading; absolute without an owner.
        observer_height: height of sight lines above the ground, map units; used only by occluded sensors.

    Attributes:
        range: map units; may be infinite.
        fov: full opening angle in radians; exactly 2 pi sees in all directions.
        orientation: `(cos, sin)` relative to the owner's heading; absolute without an owner or at a fixed place.
        at: fixed place, a node id or (x, y); None: the node passed to `sense`.
    """

    __slots__ = ("_at", "_memory", "_observer_height", "fov", "orientation", "range")

    _is_occluded = False
    looks_from_points = True  # its place may be (x, y), the position of an agent on an edge

    range: float
    fov: float
    orientation: Heading

    def __init__(
        self,
        ctx: IContext,
        sensor_id: str,
        sensor_type: SensorType,
        sensor_range: float,
        fov: float = FULL_CIRCLE,
        orientation: Heading = (1.0, 0.0),
        observer_height: float = 1.6,
    ) -> None:
        super().__init__(ctx, sensor_id, sensor_type)
        self._at: Place | None = None
        self._memory = get_caches(ctx)
        self.range = as_range(sensor_range, f"range_m of {sensor_id!r}")
        self.fov = fov
        self.orientation = orientation
        if self._is_occluded:
            self._observer_height = as_float(observer_height, f"observer_height of {sensor_id!r}")
        self._last[0] = {}

    @property
    def at(self) -> Place | None:
        """The fixed place it looks from, or None; settable."""
        return self._at

    @at.setter
    def at(self, at: object) -> None:
        self._at = None if at is None else check_place(self.ctx, at, f"at of {self.sensor_id!r}")

    def place(self, node_id: int | None) -> Place:
        """Return the place from which it looks for a node id."""
        if self._at is not None:
            return self._at
        if node_id is None:
            raise BadType(f"Sensor {self.sensor_id!r} has no fixed place: call sense(node_id), or set at=.")
        return node_id  # the graph checks it

    @property
    def looks_alike(self) -> Hashable:  # type: ignore[override] # it depends on how it is set
        """A key shared by all sensors that look in all directions from their agents' nodes in the same way."""
        is_usual = self._is_ours and not self._is_occluded and "sense" not in self.__dict__
        return (type(self), self.range) if is_usual and self.fov == FULL_CIRCLE and self._at is None else None

    def _make_viewpoint(self, place: Place) -> Viewpoint:
        """Return a place from which it looks, with its coordinates."""
        return Viewpoint.from_place(self.ctx, place, self._find_tunnel(place) if self._is_occluded else 0)

    def _find_tunnel(self, place: Place) -> int:
        """Return the tunnel of a place (x, y), which is that of its owner on an edge; 0 on the surface."""
        if self._owner is None or self._at is not None or not isinstance(place, tuple):
            return 0
        ground = self.ctx.graph.graph.ground([self.ctx.agent.get_agent(self._owner).current_node_id])
        return 0 if ground is None else int(ground.tunnels[0])

    @property
    def turns_with_agent(self) -> bool:
        """Whether its field of view turns with the agent that carries it."""
        return self.fov != FULL_CIRCLE and self._at is None

    def heading(self) -> Heading:
        """Return the viewing direction, rotated by the heading of its owner; (0.0, 0.0) if the owner has none."""
        if self._owner is None or self._at is not None:
            return self.orientation
        cos, sin = self.ctx.agent.get_agent(self._owner).orientation
        x, y = self.orientation
        return (x * cos - y * sin, x * sin + y * cos)

    def set_owner(self, owner: str | None) -> None:
        """Set the name of the agent that carries the sensor; None for no agent, which also clears the last look."""
        super().set_owner(owner)
        if owner is None:
            self._last[1] = None

    def _aim(self, place: object) -> tuple[Place, float, float, Heading]:
        heading = ALL_AROUND if self.fov == FULL_CIRCLE else self.heading()
        return self.place(cast("int", place)), self.range, self.fov, heading

    @refuse_while_deciding
    def view_from(self, node_id: int | None, owner: str | None) -> SensorView:
        """Return the present view of the sensor, for drawing."""
        if node_id is None and self._at is None:
            if self._last[1] is None:
                return SensorView()
            node_id = cast("int", self._last[1][0])
        return super().view_from(node_id, owner)

    def _add_field(self, view: SensorView) -> SensorView:
        """Return a view with the outline of the last look, and its reach if obstacles can block it."""
        looked: tuple[Place, float, float, Heading] | None = self._last[1]  # place, range, fov, heading
        if looked is None:
            return view
        place, radius, fov, heading = looked
        try:
            x, y = self._find_coordinates(place)
        except UnknownName:  # its node is gone
            return view
        whole = fov_geometry.make_sector(x, y, radius, heading, fov)
        if not self._is_occluded:
            return replace(view, outline=whole)
        views = self._memory.views_past_obstacles
        return replace(
            view, outline=views.compute_area((x, y), (radius, heading, fov), self._observer_height), reach=whole
        )

    def _find_coordinates(self, place: Place) -> tuple[float, float]:
        return find_coordinates(self.ctx, place)


class OccludedSensor(GroundSensor):
    """Mix-in for sensors that do not see through obstacles; see `GroundSensor`."""

    __slots__ = ()

    _is_occluded = True

    @property
    def observer_height(self) -> float:
        """The height of its sight lines above the ground, map units; settable."""
        return self._observer_height

    @observer_height.setter
    def observer_height(self, height: float) -> None:
        self._observer_height = height


class MapSensor(GroundSensor):
    """`data`: fresh `{'nodes': {id: Node}, 'edges': [OSMEdge, …]}`, in insertion order.

    A node is seen if it is at most `range` away from the sensor and inside its field of view, both borders included;
    the node of the sensor is always seen. An edge is seen if both its ends are.

    For the arguments see `GroundSensor`.
    """

    __slots__ = ()

    def sense(self, node_id: int | None = None) -> None:
        """Sense the nodes and edges around."""
        if self._phase.agent is not None:
            self._phase.refuse("call sensor.sense")
        place = self.place(node_id) if node_id is None or self._at is not None else node_id
        radius = self.range
        fov = self.fov
        last = self._last
        heading = ALL_AROUND if fov == FULL_CIRCLE else self.heading()
        # NOTE: inline for the most common case (benchmarks: peers).
        hidden = self._is_occluded
        nodes, edges = (
            self._look_around(place, heading) if hidden else self._memory.views.look(place, radius, fov, heading)
        )
        last[0] = {"nodes": nodes.copy(), "edges": edges.copy()}
        last[1] = (place, radius, fov, heading)

    @property
    def shows_alike(self) -> Hashable:
        """As `looks_alike`."""
        return self.looks_alike

    @refuse_while_deciding
    def shared_look(self) -> Callable[[], sight.NodeViews]:
        """Return a function that returns the views shared by sensors that look alike, valid while agents decide."""
        views = self._memory.views
        view = self.range, self.fov, ALL_AROUND
        return lambda: sight.NodeViews(views.get_views(view[0]), view)

    def sense_many(self, node_ids: Sequence[int] | np.ndarray[Any, Any]) -> LookResults:
        """Sense from many nodes; values are ids of nodes, and `edges` has ids of edges. `data` is unchanged."""
        heading = ALL_AROUND if self.fov == FULL_CIRCLE else self.heading()
        views = [self._look_around(self.place(id), heading) for id in as_node_ids(node_ids, "node_ids", self.ctx.graph)]
        return make_results([view.node_ids for view in views], partial(_collect_edges, views))

    @refuse_set_data
    def last_view(self) -> SensorView:
        """Return the nodes and edges seen last, and the field of view at that time."""
        return self._add_field(map_view(self._get_view_data()))

    def _find_coordinates(self, place: Place) -> tuple[float, float]:
        node = (
            self._get_view_data().get("nodes", {}).get(place)
        )  # its position at that time, unless the data was emptied since
        return super()._find_coordinates(place) if node is None else (node.x, node.y)

    def _look_around(self, place: Place, heading: Heading) -> View:
        if self._is_occluded:
            views = self._memory.views_past_obstacles
            return views.look_past(
                place, self.range, self.fov, heading, self._observer_height, self._find_tunnel(place)
            )
        return self._memory.views.look(place, self.range, self.fov, heading)


class OccludedMapSensor(OccludedSensor, MapSensor):
    """A MAP sensor that does not see through obstacles."""

    __slots__ = ()


def map_view(data: dict[str, Any]) -> SensorView:
    """Return the view of a sensor of nodes and edges, from its `data`, without a field of view."""
    nodes = np.array([(node.x, node.y) for node in data.get("nodes", {}).values()], np.float64).reshape(-1, 2)
    return SensorView(nodes, *fov_geometry.join_polylines(data.get("edges", ())))


class NeighborSensor(Sensor):
    """`data`: a fresh list of the node itself, then its out-neighbours in edge insertion order."""

    __slots__ = ("_neighborhoods",)

    def __init__(self, ctx: IContext, sensor_id: str, sensor_type: SensorType = SensorType.NEIGHBOR) -> None:
        super().__init__(ctx, sensor_id, sensor_type)
        self._last[0] = []
        self._neighborhoods = ctx.graph.graph.neighborhoods

    def _find_mode(self) -> str | None:
        """Return the mode of the agent that carries the sensor: only edges that it may use lead to neighbors."""
        owner = self.ctx.agent.agents.get(self._owner) if isinstance(self._owner, str) else None
        mode: str | None = getattr(owner, "mode", None)
        return None if mode is None else split_mode(mode)[0]

    def sense_many(self, node_ids: Sequence[int] | np.ndarray[Any, Any]) -> LookResults:
        """Sense from many nodes; values are ids of nodes. `data` is unchanged."""
        nodes = as_node_ids(node_ids, "node_ids", self.ctx.graph)
        mode = self._find_mode()
        routes = self.ctx.graph.routes if mode is None else self.ctx.graph.routes.select_mode(mode).routes
        offsets, targets = routes.neighborhoods()
        places, ends = kernels.select_runs(offsets, routes.rows(nodes))
        return LookResults(ends, self.ctx.graph.columns().node_ids[targets[places]])

    @property
    def neighborhoods(self) -> Mapping[int, Sequence[int]]:
        """The neighborhoods of the graph, which a look only copies to `data` (used by agents)."""
        mode = self._find_mode()
        if mode is None:
            return self._neighborhoods
        found: Mapping[int, Sequence[int]] = self.ctx.graph.routes.select_mode(mode).neighborhoods
        return found

    @property
    def shows_alike(self) -> Hashable:
        """A key shared by all sensors of agents of one mode."""
        return (type(self), self._find_mode()) if self._is_ours and "sense" not in self.__dict__ else None

    def sense(self, node_id: int) -> None:
        """Sense the neighbors of a node."""
        if self._phase.agent is not None:
            self._phase.refuse("call sensor.sense")
        near = self.neighborhoods
        try:
            self._last[0] = [*near[node_id]]
        except TypeError:  # not hashable, or no id
            node_id = as_node_id(node_id, "The id of a node", self.ctx.graph)
            self._last[0] = [*near[node_id]]
        self._last[1] = (node_id,)

    @refuse_set_data
    def last_view(self) -> SensorView:
        """The nodes seen last."""
        return SensorView(nodes=self.places_of(self._get_view_data()))


class AgentSensor(DetectingSensor, GroundSensor):
    """`data`: fresh `{agent name: node id}` of the other agents nearby, in order of creation.

    For an agent on an edge the id is a `PassedNode`, which also has its position on the edge, unless reports have
    errors.

    Without an owner, or at a fixed place, all agents count as others. The geometry is that of `MapSensor`, applied to
    the nodes of the agents, or the nearest nodes of flying agents.

    For the other arguments see `GroundSensor`.

    Args:
        owner: name of the agent that carries the sensor.
    """

    __slots__ = ("_notice",)

    def __init__(
        self,
        ctx: IContext,
        sensor_id: str,
        sensor_type: SensorType,
        sensor_range: float,
        fov: float = FULL_CIRCLE,
        orientation: Heading = (1.0, 0.0),
        owner: str | None = None,
        observer_height: float = 1.6,
    ) -> None:
        super().__init__(ctx, sensor_id, sensor_type, sensor_range, fov, orientation, observer_height)
        self._notice = None
        self._owner = owner

    def sense(self, node_id: int | None = None) -> None:
        """Sense the agents around."""
        if self._phase.agent is not None:
            self._phase.refuse("call sensor.sense")
        place = self.place(node_id) if node_id is None or self._at is not None else node_id
        fov = self.fov
        heading = ALL_AROUND if fov == FULL_CIRCLE else self.heading()
        last = self._last
        last[0] = self._find_seen(place, node_id, heading)
        last[1] = (place, self.range, fov, heading)

    @property
    def looks_alike(self) -> Hashable:  # type: ignore[override] # as above
        """A key shared by all sensors that look in all directions from their agents' nodes, and report all they see."""
        return super().looks_alike if self._notice is None or self._notice.reports_all else None

    @refuse_while_deciding
    def shared_look(self) -> Callable[[], sight.RangeSearch | None]:
        """Return a function that returns a search for agents, which sensors that look alike share while agents decide.

        It returns None if there is none.
        """
        return partial(self._memory.nearby.get_shared_look, self.range)

    def sense_many(self, node_ids: Sequence[int] | np.ndarray[Any, Any]) -> LookResults:
        """Sense from many nodes; values are indices in `names`. `data` is unchanged."""
        heading = ALL_AROUND if self.fov == FULL_CIRCLE else self.heading()
        with self._phase.suspend(changes_world=False) if self._notice is None else self._notice.undo_looks():
            ids = as_node_ids(node_ids, "node_ids", self.ctx.graph)
            return self._make_results([self._find_seen(self.place(id), id, heading) for id in ids])

    def _find_seen(self, place: Place, node_id: int | None, heading: Heading) -> dict[str, int]:
        """Return what one look reports: name -> reported value.

        Args:
            place: the place of the sensor.
            node_id: the node of its owner; None: it is unknown.
            heading: the direction of its field of view.
        """
        notice = self._notice
        nearby = self._memory.nearby
        own = self._owner if self._at is None else None
        if heading == ALL_AROUND and (notice is None or notice.reports_all) and not self._is_occluded:
            return nearby.find_by_name(place, self.range, own)
        positions, rows, look = self._find_agents(place, heading)
        seen = positions.name_rows(rows)
        if look is not None and not self.notice.has_errors:
            look = None
        if look is None and positions.travellers:
            seen.update(nearby.find_on_edges(positions, rows))
        if own is not None:
            seen.pop(own, None)
        return seen if look is None else self._report(look, node_id, seen)

    def _find_covered(self, node_id: int | None) -> tuple[IntArray, FloatArray]:
        heading = ALL_AROUND if self.fov == FULL_CIRCLE else self.heading()
        place = self.place(node_id)
        view = self._make_viewpoint(place)
        if self._is_occluded:
            views = self._memory.views_past_obstacles
            ids = views.list_nodes(place, self.range, self.fov, heading, self._observer_height, view.tunnel)
            nodes = NodeColumns(ids, self.ctx.graph.graph.positions(ids))
        else:
            nodes = find_nodes_ahead(self.ctx, view, self.range, self.fov, heading)
        return nodes.ids, np.hypot(*(nodes.xy - (view.x, view.y)).T)

    @property
    def _is_all_around(self) -> bool:
        return self.covers_disc and self._at is None

    @property
    def covers_disc(self) -> bool:
        """Whether it covers all nodes within its range."""
        return self._is_ours and self.fov == FULL_CIRCLE and not self._is_occluded

    @property
    def _is_convex(self) -> bool:
        return not self._is_occluded and (self.fov == FULL_CIRCLE or self.fov <= pi)

    @refuse_set_data
    def last_view(self) -> SensorView:
        """Return the agents seen last, their positions at that time, and the field of view at that time."""
        graph = self.ctx.graph.graph
        kept = [node for node in self._get_view_data().values() if graph.has_node(node)]
        agents = graph.positions(kept)
        for i, node in enumerate(kept):
            agents[i] = getattr(node, "xy", agents[i])
        return self._add_field(SensorView(agents=agents, names=self._list_names()))

    def _make_sighting(self, node_id: int) -> int:
        return node_id

    def _displace_sightings(self, sightings: list[int], errors: FloatArray) -> list[int]:
        """Return the nodes nearest to the positions with errors."""
        graph = self.ctx.graph.graph
        x, y = (graph.positions(sightings) + errors[:, :2]).T
        nodes: list[int] = graph.nearest_node(x, y).tolist()
        return nodes

    def _list_places(self, sightings: list[int]) -> IntArray:
        return np.array(sightings, np.int64)

    def _find_agents(self, place: Place, heading: Heading) -> tuple[Positions, list[int], LookDraws | None]:
        """Return the positions of agents, the rows of seen agents, ascending, and the look, if it was counted."""
        nearby = self._memory.nearby
        view = self._make_viewpoint(place)
        if heading == ALL_AROUND:
            positions, rows = nearby.find_around(view, self.range)
        else:
            positions, rows = nearby.find_ahead(view, self.range, heading, self.fov)
        notice = self._notice
        if notice is not None:
            rows = notice.select_wanted(rows, positions.teams)
        if self._is_occluded:
            rows = self._remove_hidden(view, rows, positions)
        if notice is None or not notice.needs_look:
            return positions, rows, None
        look = notice.look(self.ctx, self._owner)
        if notice.needs_chance:
            distances = np.hypot(*(nearby.get_xy(rows) - (view.x, view.y)).T)
            names = [positions.names[row] for row in rows]
            rows = _select_rows(rows, notice.is_noticed(look, names, distances))
        return positions, rows, look

    def _remove_hidden(self, view: Viewpoint, rows: list[int], positions: Positions) -> list[int]:
        """Return the rows of agents that no obstacle hides; visibility tables know nodes, but not places on edges."""
        xy = self._memory.nearby.get_xy
        height = self._observer_height
        between = [row for row in rows if positions.get_edge_position(row) is not None] if positions.travellers else []
        on_nodes = sorted({*rows}.difference(between)) if between else rows
        nodes = NodeColumns(positions.find_node_ids(on_nodes), xy(on_nodes))
        seen = _select_rows(on_nodes, find_in_sight(self.ctx, view, nodes, self.range, height))
        if between:
            places = NodeColumns(positions.find_node_ids(between), xy(between))
            seen += _select_rows(between, is_unhidden(self.ctx, view, places, height))
        return sorted(seen)


class OccludedAgentSensor(OccludedSensor, AgentSensor):
    """An AGENT sensor that does not see agents behind obstacles."""

    __slots__ = ()


def _collect_edges(views: list[View]) -> LookResults:
    return make_results([view.edge_ids for view in views])


def _select_rows(rows: list[int], is_kept: "np.ndarray[Any, np.dtype[np.bool_]]") -> list[int]:
    return [row for row, is_in in zip(rows, is_kept.tolist(), strict=True) if is_in]


def check_place(ctx: IContext, at: object, name: str) -> Place:
    """Check a place passed by a caller: a node id or (x, y).

    Raises:
        UnknownName (KeyError): the node does not exist.
        BadType, BadValue: neither an integer nor a pair of finite numbers.
    """
    if isinstance(at, str) or not hasattr(at, "__len__") or getattr(at, "ndim", 1) == 0:
        node = as_node_id(at, name, ctx.graph)
        ctx.graph.graph.get_node(node)
        return node
    x, y = as_numbers(at, f"{name}, unless it is the id of a node,", "(x, y)")
    return x, y
