"""The base class of built-in sensors: name, kind, owner, last result, fixed place, field of view."""

from collections.abc import Callable, Hashable, Iterable, Sequence
from copy import copy
from functools import wraps
from math import hypot, inf
from typing import Any, ClassVar, Self, TypeVar, cast

from gamms.arguments import as_float, as_name, as_range
from gamms.deciding import ContextPart, DecidePhase, UnknownLook, get_phase, refuse_unknown_look, refuse_while_deciding
from gamms.errors import BadType, BadValue, GammsError, UnknownName
from gamms.ir.graph import FloatArray
from gamms.ir.sensor_results import SensorView
from gamms.text import shown
from gamms.typing import IContext
from gamms.typing.sensor_engine import ISensor, SensorType

Heading = tuple[float, float]  # (cos, sin); (0.0, 0.0) looks in all directions
ALL_AROUND: Heading = (0.0, 0.0)

R = TypeVar("R")
S = TypeVar("S", bound="Sensor")

ATTRIBUTES_OF = {  # keyword of `create_sensor` -> its attribute, if the names differ
    "sensor_range": "range",
    **{name: f"notice.{name}" for name in ("team", "exclude", "detection")},
    **{name: f"notice.{name}" for name in ("position_noise_m", "false_alarm_rate", "delay_turns")},
}
_OURS = "gamms.sensor."
_UNIT = 1e-9  # directions whose length differs from 1 by less are stored unchanged


def refuse_set_data(look: Callable[[S], R]) -> Callable[[S], R]:
    """Decorate a method that reads `data`, to raise BadValue if a caller has set `data` to something invalid."""

    @wraps(look)
    def read(sensor: S) -> R:
        try:
            return look(sensor)
        except GammsError:
            raise
        except (AttributeError, LookupError, TypeError, ValueError) as error:
            raise BadValue(
                f"The data of sensor {shown(sensor.sensor_id)} was set to {shown(sensor._last[0])}, which "
                f"is not data of this kind of sensor. Call sense again before drawing it."
            ) from error

    return read


class FixedType(GammsError, AttributeError):
    """An attempt to set the type of a built-in sensor."""


class Sensor(ContextPart, ISensor):
    """A built-in sensor; subclasses define `sense`."""

    # NOTE: slots, and frequently changing values in a list, because setting an attribute checks whether a
    # strategy is running: the paper's loop reads and writes them at every step (benchmarks: the loop).
    __slots__ = ("_last", "_owner", "_phase", "ctx", "sensor_id", "type")

    _called = "sensor"
    _CHECKS: ClassVar[dict[str, Callable[[Any, str], Any]]]  # attribute -> check of its values

    sees_world_only = True  # reads only the world, no data of the program
    _is_ours: ClassVar[bool] = True  # whether its class is built in

    type: SensorType  # kind of the sensor
    sensor_id: str  # its name
    ctx: IContext  # the context of the sensor
    _phase: DecidePhase
    _last: list[Any]  # `data`; the place, range and heading of the last look
    _owner: str | None

    def __init__(self, ctx: IContext, sensor_id: str, sensor_type: SensorType) -> None:
        phase = get_phase(ctx)
        phase.refuse("make a sensor")
        put = object.__setattr__  # NOTE: a third of the time of `__setattr__` (benchmarks)
        put(self, "_phase", phase)
        put(self, "_last", [None, None])
        put(self, "ctx", ctx)
        put(self, "sensor_id", as_name(sensor_id, "a sensor"))
        put(self, "type", _check_type(sensor_type, "type"))
        put(self, "_owner", None)

    def __init_subclass__(cls, **kwargs: object) -> None:
        super().__init_subclass__(**kwargs)
        cls._is_ours = cls.__module__.startswith(_OURS)
        cls.sees_world_only = cls._is_ours and cls.sees_world_only

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.sensor_id!r}, {self.type}, owner={self._owner!r})"

    def __setattr__(self, name: str, value: object) -> None:
        """Set an attribute after checks; refused while a strategy is running.

        Raises:
            BadValue, BadType: the value is invalid.
            FixedType (AttributeError): the type of a built-in sensor is fixed by its class.
        """
        if name[0] != "_":
            self._phase.refuse(f"set sensor.{name}", changes_game=name in self._CHECKS)
            if name == "type" and self._is_ours:
                raise FixedType(f"The type of sensor {self.sensor_id!r} cannot be set: create another sensor.")
            if name in ATTRIBUTES_OF and self._is_ours:
                self._warn_of_keyword(name)
            if name != "data":
                self._phase.change_sensors()
            check = self._CHECKS.get(name)
            value = value if check is None else check(value, f"{name} of {getattr(self, 'sensor_id', None)!r}")
        object.__setattr__(self, name, value)

    def _warn_of_keyword(self, name: str) -> None:
        path = ATTRIBUTES_OF[name]
        if hasattr(self, path.partition(".")[0]):
            self.ctx.logger.warning(
                f"Sensor {self.sensor_id!r}: sensor.{name} is a custom attribute; use sensor.{path}."
            )

    @property
    def data(self) -> Any:
        """The data of the last look; settable. While agents decide, it is read-only, and only its owner may read it."""
        phase = self._phase
        phase.read_last_turn()
        if phase.agent is not None and self._owner not in (None, *phase.list_names()):
            phase.refuse(f"read the data of sensor {self.sensor_id!r} of agent {self._owner!r}")
        refuse_unknown_look(self._last[0], f"sensor {self.sensor_id!r}")
        return phase.protect_value(self._last[0])

    @data.setter
    def data(self, data: object) -> None:
        self._last[0] = data

    def _get_view_data(self) -> Any:
        """Return the data to draw: `data`, or the data of the underlying kind; see `catalog.derived`."""
        return {} if type(self._last[0]) is UnknownLook else self.data

    def _get_place_of_look(self) -> Any:
        """Return the place of the last look: the id of a node, (x, y) or (x, y, z); None before a look."""
        return self._last[1] and self._last[1][0]

    @refuse_while_deciding
    def update(self, data: dict[str, Any]) -> None:
        """Ignore `data`: a built-in sensor collects its own data."""

    @refuse_while_deciding
    def set_owner(self, owner: str | None) -> None:
        """Set the name of the agent that carries the sensor; None for no agent."""
        self._phase.owner_changes += 1
        object.__setattr__(self, "_owner", None if owner is None else as_name(owner, "the owner of a sensor"))

    @refuse_while_deciding
    def reset(self) -> None:
        """Clear the sensed data."""
        self._last[:] = [] if isinstance(self._last[0], list) else {}, None

    def live_result(self) -> Sequence[Any]:
        """Return the list whose first item is the data of the last look; for custom classes, `data`."""
        if self._phase.agent is not None:
            self._phase.refuse("call sensor.live_result")
        return self._last if self._is_ours else super().live_result()

    @property
    def _is_stateless(self) -> bool:
        """Whether it has no state except the data of its last look."""
        return True

    @refuse_while_deciding
    def data_from(self, place: Any, owner: str | None) -> Any:
        """Return the `data` that an agent would get now; the look is not counted."""
        return self._look_from(place, owner)._get_data_for_owner()

    @refuse_while_deciding
    def view_from(self, node_id: int | None, owner: str | None) -> SensorView:
        """Return the present view, for drawing; for custom classes, the last view."""
        if not self._is_ours:
            return self.last_view()
        try:
            return self._look_from(node_id, owner).last_view()
        except UnknownName:  # a node is gone
            return SensorView()

    @refuse_while_deciding
    def view_of(self, data: object, place: int | tuple[float, ...], owner: str | None) -> SensorView:
        """Return the view of a report, for drawing, without a look.

        A sensor whose `data` is a function of other data looks, because a report does not tell these.

        Raises:
            BadValue: `data` is not data of this kind of sensor.
        """
        if not self._is_ours or type(self).data is not Sensor.data:
            return self.view_from(cast("int", place), owner)
        twin = self._copy_for_view()
        twin._owner = owner
        twin._last[:] = data, twin._aim(place)
        return twin.last_view()

    @property
    def shows_alike(self) -> Hashable:
        """A key shared by all sensors that show the same nodes from the same node; None: there are no others."""
        return None

    def _look_from(self, place: object, owner: str | None) -> Self:
        """Return a copy that has looked from a place for an agent."""
        twin = self._copy_for_view()
        twin._owner = owner
        twin.sense(place)  # type: ignore[arg-type] # those that look from the air need no node
        return twin

    def _get_data_for_owner(self) -> Any:
        return self._phase.protect_value(self._last[0]) if type(self).data is Sensor.data else self.data

    def _aim(self, place: object) -> Any:
        """Return the place, range and heading of a look from a place, as `sense` stores them."""
        return (place,)

    def _copy_for_view(self) -> Self:
        """Return a sensor to look with in its place."""
        twin = copy(self)
        twin._last = list(self._last)
        return twin

    def places_of(self, node_ids: Iterable[int]) -> FloatArray:
        """Return the positions of the nodes of a look (nodes, 2); nodes removed since then are left out."""
        graph = self.ctx.graph.graph
        return graph.positions([id for id in node_ids if graph.has_node(id)])


def check_orientation(value: Iterable[object], name: str) -> Heading:
    """Check an orientation, and return it as `(cos, sin)` of length 1.

    Raises:
        BadValue: not a pair of finite numbers, or (0, 0).
    """
    try:
        x, y = (as_float(part, name) for part in value)
    except (TypeError, ValueError):
        raise BadValue(f"{name} must be a pair (cos, sin), not {shown(value)}.") from None
    length = hypot(x, y)
    if not 0.0 < length < inf:
        raise BadValue(f"{name} must be finite and not (0, 0), not {shown(value)}.")
    return (x, y) if abs(length - 1.0) <= _UNIT else (x / length, y / length)


def _check_type(value: object, name: str) -> SensorType:
    if not isinstance(value, SensorType):
        raise BadType(f"{name} must be a SensorType, not {shown(value)}.")
    return value


Sensor._CHECKS = {
    "sensor_id": lambda value, _: as_name(value, "a sensor"),
    "range": as_range,
    "fov": as_range,
    "orientation": check_orientation,
    "observer_height": as_float,
}
