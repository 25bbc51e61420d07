"""The sensors of agents: as passed by callers, and in the form in which agents read them."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from gamms.arguments import as_member, as_name
from gamms.errors import BadType, UnknownName
from gamms.text import shown
from gamms.typing import IContext
from gamms.typing.sensor_engine import Carried, ISensor, LiveData, SensorType, find_owner, is_sensor


def make_carried(name: str, sensor: ISensor, own: str | None, near: Mapping[int, Sequence[int]]) -> Carried:
    """Return a sensor in the form in which its agent reads it.

    Args:
        name: name of the sensor in the agent's state.
        sensor: the sensor.
        own: name of the agent, if others also carry the sensor.
        near: neighborhoods of the agent's graph.
    """
    offered: Callable[[], Any] | None = getattr(sensor, "live_result", None)
    last = LiveData(sensor) if offered is None else offered()
    if own is not None:
        return name, last, None, _SharedSensor(sensor, own)
    if type(last) is list and getattr(sensor, "neighborhoods", None) is near:
        # NOTE: without the sensor object, which would be read from memory at every look (benchmarks: turns).
        return name, last, sensor.type, None
    return name, last, None, sensor


class _SharedSensor:
    """Reads a sensor that several agents carry, on behalf of one of them."""

    __slots__ = ("_own", "_sensor", "sees_world_only")

    def __init__(self, sensor: ISensor, own: str) -> None:
        self._sensor = sensor
        self._own = own
        self.sees_world_only = getattr(sensor, "sees_world_only", False)

    @property
    def type(self) -> SensorType:
        return self._sensor.type

    def sense(self, node_id: int) -> None:
        sensor = self._sensor
        own = self._own
        owner = find_owner(sensor)
        sensor.set_owner(own)
        try:
            sensor.sense(node_id)
        finally:
            if owner not in (None, own):  # a look without an agent belongs to the agent that registered the sensor last
                sensor.set_owner(owner)


def list_sensors(sensors: Any) -> Any:
    """Return sensors in a form that can be iterated more than once; other values are returned unchanged."""
    if isinstance(sensors, list | tuple | dict | str) or not isinstance(sensors, Iterable):
        return sensors
    return dict(sensors) if isinstance(sensors, Mapping) else list(sensors)


def find_sensors(ctx: IContext, name: str, given: Any, *, skips_unknown: bool = False) -> dict[str, Any]:
    """Return the sensors for a new agent, or their declarations, by their names in its state.

    Args:
        ctx: the context.
        name: the name of the agent, or of its team.
        given: a list of ids and sensors, or a dict from names to ids, sensors and declarations.
        skips_unknown: whether unknown ids are skipped with a warning.

    Raises:
        BadType: something is not a sensor.
        UnknownName (KeyError): an id is unknown.
    """
    is_dict = type(given) is not list and isinstance(given, Mapping)
    if isinstance(given, str) or not isinstance(given, Iterable):
        hint = _explain_kind("eyes", given)
        raise BadType(f"sensors= of {shown(name)} must be a list of sensor ids or a dict, not {shown(given)}.{hint}")
    if isinstance(given, Mapping) and as_member(SensorType, given.get("type")) is not None:
        hint = f'Give it a name, sensors={{"eyes": {shown(given)}}}.'
        raise BadType(f"sensors= of {shown(name)} is one sensor without a name. {hint}")
    pairs = given.items() if isinstance(given, Mapping) else ((one, one) for one in given)
    found = {}
    for key, sensor in pairs:
        is_id = isinstance(sensor, str)
        if is_dict:
            as_name(key, "a sensor")
        elif isinstance(sensor, Mapping):
            hint = f'Give it a name, sensors={{"eyes": {shown(sensor)}}}.'
            raise BadType(f"Agent {name!r} cannot carry {shown(sensor)} without a name. {hint}")
        if not is_id and not isinstance(sensor, Mapping) and not is_sensor(sensor):
            factories = "sensors, their ids, and what gamms.sensor.agent_range() and its like return"
            hint = _explain_kind(key if is_dict else "eyes", sensor)
            raise BadType(f"Agent {name!r} cannot carry {shown(sensor)}: sensors= takes {factories}.{hint}")
        try:
            found[key if is_id or is_dict else sensor.sensor_id] = ctx.sensor.get_sensor(sensor) if is_id else sensor
        except UnknownName as error:
            hint = _explain_kind(key if is_dict else "eyes", sensor)
            if not skips_unknown:
                raise UnknownName("sensor", sensor, ctx.sensor.sensors, hint) from None
            ctx.logger.warning(f"Agent {shown(name)} is created without a sensor: {error}{hint}")
    return found


def _explain_kind(name: str, given: object) -> str:
    """Return how to declare a sensor of a kind, for the name, the type or the factory of a kind in its place."""
    kind = as_member(SensorType, getattr(given, "__name__", given))
    if kind is None or kind is SensorType.CUSTOM:
        return ""
    return f" Declare it: sensors={{{shown(name)}: gamms.sensor.{kind.name.lower()}()}}."
