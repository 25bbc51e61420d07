"""What built-in sensors have in common: a name, a kind, an owner, the last result, a fixed place, a field of view."""

from collections.abc import Callable, Iterable, Sequence
from copy import copy
from functools import wraps
from math import hypot, inf
from typing import Any, ClassVar, Self, TypeVar, cast

import numpy as np

from gamms.arguments import as_float, as_int, as_name, as_numbers, as_range
from gamms.deciding import DecidePhase, Guarded, phase_of, refused_while_deciding
from gamms.errors import BadType, BadValue, GammsError, UnknownName
from gamms.ir.graph import FloatArray
from gamms.ir.sensed import SensorView
from gamms.sensor import fov_geometry
from gamms.sensor.views import FULL_CIRCLE, Place, coordinates, memory_of
from gamms.text import shown
from gamms.typing import IContext
from gamms.typing.sensor_engine import ISensor, SensorType

__all__ = [
    "ALL_AROUND",
    "FULL_CIRCLE",
    "GroundSensor",
    "Heading",
    "OccludedSensor",
    "Sensor",
    "checked_place",
    "of_data",
]

Heading = tuple[float, float]  # (cos, sin); (0.0, 0.0) sees all around

R = TypeVar("R")
S = TypeVar("S", bound="Sensor")

ALL_AROUND: Heading = (0.0, 0.0)
_OURS = "gamms.sensor."
_UNIT = 1e-9  # how much the length of a direction that is given may miss 1, to be read back as it was given


def of_data(look: Callable[[S], R]) -> Callable[[S], R]:
    """Decorate a method that reads `data`, to raise BadValue where it was set to what no such sensor sees."""

    @wraps(look)
    def read(sensor: S) -> R:
        try:
            return look(sensor)
        except GammsError:
            raise
        except (AttributeError, LookupError, TypeError, ValueError) as error:
            raise BadValue(
                f"The data of sensor {shown(sensor.sensor_id)} was set to {shown(sensor._last[0])}, which is nothing "
                f"that it sees. Call sense again before it is drawn."
            ) from error

    return read


class Sensor(Guarded, ISensor):
    """A built-in sensor; a subclass writes `sense`."""

    # NOTE: slots, not properties, and what changes with every look in a list, because setting an attribute asks whether
    # a strategy is running: the paper's loop reads and writes them at every step (benchmarks/README.md, w2).
    __slots__ = ("_last", "_owner", "_phase", "ctx", "sensor_id", "type")

    _called = "sensor"
    _CHECKS: ClassVar[dict[str, Callable[[Any, str], Any]]]  # attribute -> what it may be set to

    sees_world_only = True
    _is_ours: ClassVar[bool] = True  # whether its class is not one of the user's own

    type: SensorType
    sensor_id: str
    ctx: IContext
    _phase: DecidePhase
    _last: list[Any]  # `data`; the place, range and heading of the last look
    _owner: str | None

    def __init__(self, ctx: IContext, sensor_id: str, sensor_type: SensorType) -> None:
        phase = phase_of(ctx)
        phase.refuse("make a sensor")
        put = object.__setattr__  # NOTE: a third of the time of `__setattr__` (benchmarks/README.md)
        put(self, "_phase", phase)
        put(self, "_last", [None, None])
        put(self, "ctx", ctx)
        put(self, "sensor_id", as_name(sensor_id, "a sensor"))
        put(self, "type", _checked_type(sensor_type, "type"))
        put(self, "_owner", None)

    def __init_subclass__(cls, **kwargs: object) -> None:
        super().__init_subclass__(**kwargs)
        cls._is_ours = cls.__module__.startswith(_OURS)
        cls.sees_world_only = cls._is_ours and cls.sees_world_only

    def __repr__(self) -> str:
        """Name the sensor, its kind and its owner."""
        return f"{type(self).__name__}({self.sensor_id!r}, {self.type}, owner={self._owner!r})"

    def __setattr__(self, name: str, value: object) -> None:
        """Set an attribute after a look at it; refused while a strategy is running.

        Raises:
            BadValue, BadType: it cannot be set to that.
        """
        if name[0] != "_":
            self._phase.refuse(f"set sensor.{name}")
            self._phase.sensor_changes += 1
            check = self._CHECKS.get(name)
            value = value if check is None else check(value, f"{name} of {getattr(self, 'sensor_id', None)!r}")
        object.__setattr__(self, name, value)

    @property
    def data(self) -> Any:
        """What was sensed last; settable. While agents decide, it is read-only, and that of others is not shown."""
        phase = self._phase
        if phase.agent is not None and self._owner not in (None, *phase.names()):
            phase.refuse(f"look at what the sensor {self.sensor_id!r} of agent {self._owner!r} has seen")
        return phase.shown(self._last[0])

    @data.setter
    def data(self, data: object) -> None:
        self._last[0] = data

    @refused_while_deciding
    def update(self, data: dict[str, Any]) -> None:
        """Ignore `data`: a built-in sensor sees for itself."""

    @refused_while_deciding
    def set_owner(self, owner: str | None) -> None:
        """Name the agent that carries the sensor; None for no agent."""
        self._phase.sensor_changes += 1
        object.__setattr__(self, "_owner", None if owner is None else as_name(owner, "the owner of a sensor"))

    @refused_while_deciding
    def reset(self) -> None:
        """Forget what was sensed."""
        self._last[:] = [] if isinstance(self._last[0], list) else {}, None

    def live_result(self) -> Sequence[Any]:
        """Return the list whose first item is what was sensed last; of a class of the user's own, its `data`."""
        if self._phase.agent is not None:
            self._phase.refuse("call sensor.live_result")
        return self._last if self._is_ours else super().live_result()

    def _snapshot(self) -> tuple[Any, ...]:
        """Return what was sensed, for `_restore`."""
        return tuple(self._last)

    def _restore(self, before: tuple[Any, ...]) -> None:
        """Restore what was sensed."""
        self._last[:] = before

    @refused_while_deciding
    def view_from(self, node_id: int | None, owner: str | None) -> SensorView:
        """Return what it would see now, for drawing; a class of the user's own is not asked, but what it saw last."""
        if not self._is_ours:
            return self.last_view()
        twin = self._twin()
        twin._owner = owner
        try:
            twin.sense(node_id)  # type: ignore[arg-type] # those that look from the air need no node
        except UnknownName:  # a node is gone
            return SensorView()
        return twin.last_view()

    def _twin(self) -> Self:
        """A sensor that looks in its place."""
        twin = copy(self)
        twin._last = list(self._last)
        return twin

    def places_of(self, node_ids: Iterable[int]) -> FloatArray:
        """Return where the nodes of a look are (nodes, 2); those that were removed since then are left out."""
        graph = self.ctx.graph.graph
        return graph.positions([id for id in node_ids if graph.has_node(id)])


class GroundSensor(Sensor):
    """Looks over the ground, from the node it is asked about or from a fixed place.

    A sight line of an occluded sensor runs from where it looks to each node, both ends `observer_height` above the
    ground. What lies behind an obstacle is not seen; the node that it is on always is.

    Args:
        ctx: the context.
        sensor_id: the sensor's name.
        sensor_type: its kind.
        sensor_range: map units; may be infinite.
        fov: full opening angle in radians; exactly 2 pi sees all around.
        orientation: `(cos, sin)` relative to the owner's heading; absolute without an owner.
        observer_height: of the sight lines above the ground, map units; used by occluded sensors alone.

    Attributes:
        range: map units; may be infinite.
        fov: full opening angle in radians; exactly 2 pi sees all around.
        orientation: `(cos, sin)` relative to the owner's heading; absolute without an owner or at a fixed place.
        at: a node id or (x, y) to look from, whatever node is asked about; None looks from that node.
    """

    __slots__ = ("_at", "_observer_height", "fov", "orientation", "range")

    _is_occluded = False

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
        self.range = as_range(sensor_range, f"sensor_range of {sensor_id!r}")
        self.fov = fov
        self.orientation = orientation
        if self._is_occluded:
            self._observer_height = as_float(observer_height, f"observer_height of {sensor_id!r}")
        self._last[0] = {}

    @property
    def at(self) -> Place | None:
        """The fixed place it looks from; settable."""
        return self._at

    @at.setter
    def at(self, at: object) -> None:
        self._at = None if at is None else checked_place(self.ctx, at, f"at of {self.sensor_id!r}")

    def place(self, node_id: int | None) -> Place:
        """Return where it looks from when asked about a node."""
        if self._at is not None:
            return self._at
        if node_id is None:
            raise BadType(f"Sensor {self.sensor_id!r} has no place of its own: sense(node_id), or give it at=.")
        return node_id  # the graph checks it

    def heading(self) -> Heading:
        """Return where it looks, turned by the heading of its owner; (0.0, 0.0) while that has none."""
        if self._owner is None or self._at is not None:
            return self.orientation
        cos, sin = self.ctx.agent.get_agent(self._owner).orientation
        x, y = self.orientation
        return (x * cos - y * sin, x * sin + y * cos)

    def set_owner(self, owner: str | None) -> None:
        """Name the agent that carries the sensor; None for no agent, which also clears the last look."""
        super().set_owner(owner)
        if owner is None:
            self._last[1] = None

    @refused_while_deciding
    def view_from(self, node_id: int | None, owner: str | None) -> SensorView:
        """Return what it would see now, for drawing."""
        if node_id is None and self._at is None:
            if self._last[1] is None:
                return SensorView()
            node_id = cast("int", self._last[1][0])
        return super().view_from(node_id, owner)

    @of_data
    def outline(self) -> FloatArray:
        """Return the corners (corners, 2) of the field of view of the last look; none where it had no end."""
        looked: tuple[Place, float, float, Heading] | None = self._last[1]  # place, range, fov, heading
        if looked is None:
            return np.zeros((0, 2))
        place, radius, fov, heading = looked
        try:
            x, y = self._where(place)
        except UnknownName:  # its node is gone
            return np.zeros((0, 2))
        return self._area(x, y, radius, heading, fov)

    def _area(self, x: float, y: float, radius: float, heading: Heading, fov: float) -> FloatArray:
        """Return the corners of what it covers from a place."""
        if self._is_occluded:
            views = memory_of(self.ctx).views_past_obstacles
            return views.area((x, y), (radius, heading, fov), self._observer_height)
        return fov_geometry.sector(x, y, radius, heading, fov)

    def _where(self, place: Place) -> tuple[float, float]:
        return coordinates(self.ctx, place)


class OccludedSensor(GroundSensor):
    """Mix-in: looks past obstacles, and not through them; see `GroundSensor`."""

    __slots__ = ()

    _is_occluded = True

    @property
    def observer_height(self) -> float:
        """The height of its sight lines above the ground, map units; settable."""
        return self._observer_height

    @observer_height.setter
    def observer_height(self, height: float) -> None:
        self._observer_height = height


def checked_place(ctx: IContext, at: object, name: str) -> Place:
    """Return a node id or (x, y) from what a caller passed.

    Raises:
        UnknownName (KeyError): there is no such node.
        BadType, BadValue: neither an integer nor a pair of finite numbers.
    """
    if isinstance(at, str) or not hasattr(at, "__len__") or getattr(at, "ndim", 1) == 0:
        node = as_int(at, name)
        ctx.graph.graph.get_node(node)
        return node
    x, y = as_numbers(at, f"{name}, unless it is the id of a node,", "(x, y)")
    return x, y


def checked_orientation(value: Iterable[object], name: str) -> Heading:
    """Return `(cos, sin)` of length 1 from what a caller passed.

    Raises:
        BadValue: it is no pair of finite numbers, or (0, 0).
    """
    try:
        x, y = (as_float(part, name) for part in value)
    except (TypeError, ValueError):
        raise BadValue(f"{name} must be a pair (cos, sin), not {shown(value)}.") from None
    length = hypot(x, y)
    if not 0.0 < length < inf:
        raise BadValue(f"{name} must be finite and not (0, 0), not {shown(value)}.")
    return (x, y) if abs(length - 1.0) <= _UNIT else (x / length, y / length)


def _checked_type(value: object, name: str) -> SensorType:
    if not isinstance(value, SensorType):
        raise BadType(f"{name} must be a SensorType, not {shown(value)}.")
    return value


Sensor._CHECKS = {
    "sensor_id": lambda value, _: as_name(value, "a sensor"),
    "type": _checked_type,
    "range": as_range,
    "fov": as_range,
    "orientation": checked_orientation,
    "observer_height": as_float,
}
