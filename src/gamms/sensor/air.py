"""The sensors AERIAL and AERIAL_AGENT, and their occluded variants: views from the air along an axis."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import inf, pi, sqrt
from typing import Any, ClassVar, NamedTuple, cast

import numpy as np

from gamms import kernels
from gamms.arguments import as_ids, as_numbers, as_range
from gamms.deciding import refuse_while_deciding
from gamms.errors import BadValue
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.sensor_results import LookResults, SensorView, flatten_lists
from gamms.kernels import Quaternion
from gamms.sensor import fov_geometry
from gamms.sensor.detection import DetectingSensor
from gamms.sensor.ground import map_view
from gamms.sensor.nearby import Coordinates, get_caches
from gamms.sensor.sensor import Sensor, refuse_set_data
from gamms.sensor.sighting_errors import LookDraws
from gamms.sensor.views import find_ground, place_on_ground
from gamms.typing import AgentType, IAerialAgent, IContext
from gamms.typing.graph_engine import Surroundings
from gamms.typing.sensor_engine import SensorType

DOWN: Quaternion = (sqrt(0.5), 0.0, sqrt(0.5), 0.0)
AHEAD: Quaternion = (1.0, 0.0, 0.0, 0.0)

Axis = tuple[float, float, float]
_Corners = Callable[[FloatArray, Axis, float, float], FloatArray]  # of position, axis, range and fov

_Sighting = tuple[AgentType, tuple[float, float, float]]
_KINDS = (AgentType.BASIC, AgentType.AERIAL)


class Pose(NamedTuple):
    """The position and the viewing direction of a sensor."""

    position: FloatArray  # (3,)
    axis: Axis


class FlyingSensor(Sensor):
    """Looks from an aerial agent, or from a fixed place in the air.

    Attributes:
        range: map units, in 3D; may be infinite.
        fov: full opening angle of the cone in radians.
        quat: rotation relative to the owner (absolute at a fixed place); the sensor looks along its x axis.
        at: fixed position (x, y, z); None: the position of the owner.
    """

    range: float  # range in 3D, map units
    fov: float  # full opening angle of the cone, radians

    _type: ClassVar[SensorType]
    _is_occluded = False
    _defaults: ClassVar[tuple[float, Quaternion]]  # default fov and quat
    _widest = inf

    def __init__(
        self,
        ctx: IContext,
        sensor_id: str,
        sensor_range: float,
        fov: float | None = None,
        quat: Quaternion | None = None,
    ) -> None:
        super().__init__(ctx, sensor_id, self._type)
        self.quat = self._defaults[1] if quat is None else quat
        self._at: Axis | None = None
        self.range = as_range(sensor_range, f"range_m of {sensor_id!r}")
        self.fov = min(as_range(self._defaults[0] if fov is None else fov, f"fov of {sensor_id!r}"), self._widest)
        self._last[0] = {}

    @property
    def quat(self) -> Quaternion:
        """The rotation (w, x, y, z), of length 1; settable to any nonzero length."""
        return self._quat

    @quat.setter
    def quat(self, quat: Sequence[float]) -> None:
        w, x, y, z = as_numbers(quat, name := f"quat of {self.sensor_id!r}", "(w, x, y, z)")
        unit = kernels.normalize_quaternion((w, x, y, z))
        if unit is None:
            raise BadValue(f"{name} must not be zero: it has no direction. (1, 0, 0, 0) is no rotation.")
        self._quat = unit

    @property
    def at(self) -> Axis | None:
        """The fixed position (x, y, z), or None; settable."""
        return self._at

    @at.setter
    def at(self, at: Sequence[float] | None) -> None:
        point = None if at is None else as_numbers(at, f"at of {self.sensor_id!r}", "(x, y, z)")
        self._at = cast("Axis | None", point and tuple(point))

    @refuse_while_deciding
    def set_owner(self, owner: str | None) -> None:
        """Set the name of the agent that carries the sensor; None for no agent.

        Raises:
            UnknownName (KeyError): the agent does not exist.
            BadValue (ValueError): the agent does not fly, and the sensor has no fixed position.
        """
        self._refuse_ground_agent(owner)
        super().set_owner(owner)

    def view_from(self, node_id: int | None, owner: str | None) -> SensorView:
        """Return the present view of the sensor, for drawing."""
        self._refuse_ground_agent(owner)
        return super().view_from(node_id, owner)

    def _aim(self, place: object) -> Pose | None:  # noqa: ARG002 - it looks from the air
        return self.pose()

    def _get_place_of_look(self) -> Axis | None:
        pose: Pose | None = self._last[1]
        return None if pose is None else cast("Axis", tuple(pose.position.tolist()))

    def _refuse_ground_agent(self, owner: str | None) -> None:
        if owner is not None and self.ctx.agent.get_agent(owner).type is not AgentType.AERIAL and self._at is None:
            raise BadValue(
                f"Sensor {self.sensor_id!r} ({self.type}) needs a flying agent, but {owner!r} does not fly. "
                "Create it with type=AgentType.AERIAL, or give the sensor a fixed position with at=(x, y, z)."
            )

    def pose(self) -> Pose | None:
        """Return the pose of the sensor; None without an owner and a fixed position.

        Raises:
            BadValue: the owner is on the ground, and the sensor no longer has a fixed position.
        """
        if self._at is not None:
            return Pose(np.array(self._at), kernels.quaternion_to_direction(self._quat))
        if self._owner is None:
            return None
        self._refuse_ground_agent(self._owner)
        owner = cast("IAerialAgent", self.ctx.agent.get_agent(self._owner))
        turned = kernels.multiply_quaternions(owner.quat, self._quat)
        return Pose(np.array(owner.position), kernels.quaternion_to_direction(turned))

    def _add_field(self, view: SensorView, corners_of: _Corners) -> SensorView:
        """Return a view with the outline of the last look, or its reach if walls hide parts of it."""
        pose: Pose | None = self._last[1]
        if pose is None:
            return view
        corners = corners_of(*pose, self.range, self.fov)
        return replace(view, reach=corners) if self._is_occluded else replace(view, outline=corners)

    def _find_in_reach(self, offsets: FloatArray, axis: Axis) -> IntArray:
        """Return the indices of offsets (points, 3) that lie in range and in the cone."""
        # Compares squares, which are the same on every machine and in batches.
        near = np.flatnonzero(kernels.compute_squares(*offsets.T) <= self.range * self.range)
        if self.fov >= 2.0 * pi:
            return near
        return near[kernels.find_in_view([*offsets[near].T], axis, self.fov)]


class AerialSensor(FlyingSensor):
    """`data`: fresh `{'nodes': {id: Node}, 'edges': [OSMEdge, …]}` of the ground below, in insertion order.

    A node is seen if it is at most `range` away in 3D and inside the cone, both borders included. An edge is seen if
    both its ends are. Without an owner and a fixed position nothing is seen.

    Args:
        ctx: the context.
        sensor_id: name of the sensor.
        sensor_range: map units.
        fov: full opening angle of the cone in radians, limited to 0.9 pi.
        quat: rotation relative to the owner; by default it looks straight down.

    Raises:
        BadValue, BadType: range or fov is negative, NaN or not a number; the quaternion is zero or invalid.
    """

    _type = SensorType.AERIAL
    _defaults = (pi / 3.0, DOWN)
    _widest = 0.9 * pi  # widest cone toward the ground, as in 1.0.0

    def sense(self, node_id: int | None = None) -> None:  # noqa: ARG002 - it looks from the air
        """Sense the ground."""
        if self._phase.agent is not None:
            self._phase.refuse("call sensor.sense")
        pose = self.pose()
        nodes, edges = self._find_seen(pose)
        self._last[:] = {"nodes": nodes, "edges": edges}, pose

    def sense_many(self, node_ids: Sequence[int] | np.ndarray[Any, Any]) -> LookResults:
        """Sense once for each node, always from the position of the sensor. `data` is unchanged."""
        nodes, edges = self._find_seen(self.pose())
        looks = len(as_ids(node_ids, "node_ids"))
        return LookResults(
            *flatten_lists([[*nodes]] * looks), LookResults(*flatten_lists([[edge.id for edge in edges]] * looks))
        )

    @refuse_set_data
    def last_view(self) -> SensorView:
        """Return the nodes and edges seen last, and the part of the ground inside the cone at that time."""
        return self._add_field(map_view(self._get_view_data()), fov_geometry.make_footprint)

    def _find_seen(self, pose: Pose | None) -> Surroundings:
        if pose is None:
            return Surroundings({}, [])
        x, y, _ = pose.position.tolist()
        ids, xy = self.ctx.graph.graph.nodes_near(x, y, self.range)
        ground, is_outside = place_on_ground(self.ctx, ids, xy)
        rows = self._find_in_reach(ground - pose.position, pose.axis)
        if self._is_occluded:
            rows = rows[is_outside[rows]]
            rows = rows[self.ctx.graph.visible(pose.position, ground[rows])]
        return self.ctx.graph.graph.among(ids[rows])


class OccludedAerialSensor(AerialSensor):
    """An AERIAL sensor that does not see through obstacles, with sight lines from the sensor to the nodes."""

    _type = SensorType.OCCLUDED_AERIAL
    _is_occluded = True


class AerialAgentSensor(DetectingSensor, FlyingSensor):
    """`data`: fresh `{agent name: (AgentType, (x, y, z))}` of the other agents, in order of creation.

    Agents on the ground are at the height of their node, 0 on a flat map. An agent is seen if it is at most `range`
    away in 3D and inside the cone, both borders included, but not exactly at the position of the sensor, as in 1.0.0.
    Without an owner and a fixed position no agent is seen.

    Args:
        ctx: the context.
        sensor_id: name of the sensor.
        sensor_range: map units.
        fov: full opening angle of the cone in radians; 2 pi sees in all directions.
        quat: rotation relative to the owner; by default it looks straight ahead.

    Raises:
        BadValue, BadType: range or fov is negative, NaN or not a number; the quaternion is zero or invalid.
    """

    _type = SensorType.AERIAL_AGENT
    _defaults = (2.0 * pi, AHEAD)
    _notice = None

    def sense(self, node_id: int | None = None) -> None:  # noqa: ARG002 - it looks from the air
        """Sense agents."""
        if self._phase.agent is not None:
            self._phase.refuse("call sensor.sense")
        pose = self.pose()
        self._last[:] = self._find_seen(pose), pose

    def sense_many(self, node_ids: Sequence[int] | np.ndarray[Any, Any]) -> LookResults:
        """Sense once for each node, always from the position of the sensor; values are indices in `names`.

        `data` is unchanged.
        """
        pose = self.pose()
        with self.notice.undo_looks():
            return self._make_results([self._find_seen(pose) for _ in node_ids])

    def _find_seen(self, pose: Pose | None) -> dict[str, _Sighting]:
        look = self.notice.look(self.ctx, self._owner)
        rows, now = self._find_agents(pose, look)
        names = self.ctx.agent.positions.names
        seen = {
            names[row]: (_KINDS[is_flying], (x, y, z))
            for row, is_flying, (x, y, z) in zip(rows.tolist(), now.is_flying.tolist(), now.xyz.tolist(), strict=True)
        }
        if not self.notice.has_errors:
            return seen
        report = self._report(look, None, seen)
        return {name: (AgentType(kind), tuple(place)) for name, (kind, place) in report.items()}

    def _find_reportable_rows(self) -> list[int]:
        flyers = set(self.ctx.agent.positions.flyers.tolist())
        return [row for row in super()._find_reportable_rows() if row not in flyers]

    def _make_sighting(self, node_id: int) -> _Sighting:
        node = self.ctx.graph.graph.get_node(node_id)
        ground = find_ground(self.ctx, node_id)
        return AgentType.BASIC, (node.x, node.y, float(ground.z[0]))

    def _displace_sightings(self, sightings: list[_Sighting], errors: FloatArray) -> list[_Sighting]:
        places = (self._list_places(sightings) + errors).tolist()
        return [(kind, (x, y, z)) for (kind, _), (x, y, z) in zip(sightings, places, strict=True)]

    def _list_places(self, sightings: list[_Sighting]) -> FloatArray:
        return np.array([place for _, place in sightings], np.float64).reshape(-1, 3)

    def _find_covered(self, node_id: int | None) -> tuple[IntArray, FloatArray]:  # noqa: ARG002 - it looks from the air
        pose = self.pose()
        if pose is None:
            return np.zeros(0, np.int64), np.zeros(0)
        x, y, _ = pose.position.tolist()
        ids, xy = self.ctx.graph.graph.nodes_near(x, y, self.range)
        ground, is_outside = place_on_ground(self.ctx, ids, xy)
        offsets = ground - pose.position
        rows = self._find_in_reach(offsets, pose.axis)
        rows = rows[offsets[rows].any(axis=1)]
        if self._is_occluded:
            rows = rows[is_outside[rows]]
            rows = rows[self.ctx.graph.visible(pose.position, ground[rows])]
        return ids[rows], _measure_lengths(offsets[rows])

    @refuse_set_data
    def last_view(self) -> SensorView:
        """Return the agents seen last, their positions at that time, and the ground below the cone."""
        agents = np.array([place[:2] for _, place in self._get_view_data().values()], np.float64).reshape(-1, 2)
        return self._add_field(SensorView(agents=agents, names=self._list_names()), fov_geometry.make_shadow)

    def _find_agents(self, pose: Pose | None, look: LookDraws) -> tuple[IntArray, Coordinates]:
        """Return the rows (agents,) of the agents that are seen, and their positions."""
        nearby = get_caches(self.ctx).nearby
        near = np.zeros(0, np.int64)
        if pose is None:
            return near, nearby.get_positions(near)
        positions = self.ctx.agent.positions
        own = self._owner if self._at is None else None
        x, y, _ = pose.position.tolist()
        near = nearby.find_living(x, y, self.range)
        names = positions.names
        there = nearby.get_positions(near)
        offsets = there.xyz - pose.position
        reached = self._find_in_reach(offsets, pose.axis)
        reached = reached[offsets[reached].any(axis=1)]
        listed: list[int] = near[reached].tolist()
        wanted = set(self.notice.select_wanted([row for row in listed if names[row] != own], positions.teams))
        at = reached[[row in wanted for row in listed]]
        if self._is_occluded:
            at = at[there.is_outside[at]]
            at = at[self.ctx.graph.visible(pose.position, there.xyz[at])]
        if self.notice.needs_chance:
            distances = _measure_lengths(there.xyz[at] - pose.position)
            seen = [names[row] for row in near[at].tolist()]
            at = at[self.notice.is_noticed(look, seen, distances)]
        return near[at], there.select(at)


class OccludedAerialAgentSensor(AerialAgentSensor):
    """An AERIAL_AGENT sensor that does not see agents behind obstacles."""

    _type = SensorType.OCCLUDED_AERIAL_AGENT
    _is_occluded = True


def _measure_lengths(offsets: FloatArray) -> FloatArray:
    found: FloatArray = np.sqrt(kernels.compute_squares(*offsets.T))
    return found
