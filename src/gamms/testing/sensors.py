"""Does a sensor keep the contract of `gamms.typing.ISensor`?"""

from copy import deepcopy
from typing import Any

from gamms.typing import ISensor, SensorType


def check_sensor(sensor: ISensor, node_id: int) -> None:
    """Run every promise over a sensor that looks at the world from a node.

    Args:
        sensor: not registered on an agent that must keep it: its owner is set and taken away.
        node_id: a node of the graph that the sensor looks at; the world must hold still meanwhile.

    Raises:
        AssertionError: a promise is broken; the message names it.
    """
    _expect("sensor_id is a name", str(sensor.sensor_id) == sensor.sensor_id != "", sensor.sensor_id)
    _expect("type is a SensorType", isinstance(sensor.type, SensorType), sensor.type)
    _expect("sense returns nothing", _returned(sensor.sense(node_id)) is None, "something")
    first = sensor.data
    kept = deepcopy(first)
    sensor.sense(node_id)
    _expect("sensing twice in a world that holds still sees the same", sensor.data == kept, sensor.data)
    _expect("data is fresh after every sense", _is_fresh(sensor.data, first), first)
    _expect("a later sense changes no earlier result", first == kept, first)
    _expect("update accepts a dict", _returned(sensor.update({})) is None, "something")
    many = sensor.sense_many([node_id, node_id])
    _expect("sense_many looks once for each node", len(many) == 2, len(many))
    _expect("sense_many sees the same from the same node", _plain(many[0]) == _plain(many[1]), many[1])
    if many.values.dtype == object:
        _expect("sense_many sees what sense sees", _plain(many[0]) == [kept], many[0])
    try:
        sensor.set_owner("nobody-yet")
    except KeyError:
        sensor.set_owner(None)  # a sensor may insist on an agent that is there
    _expect("set_owner accepts None", _returned(sensor.set_owner(None)) is None, "something")


def _returned(value: Any) -> Any:
    return value


def _plain(values: Any) -> list[Any]:
    return list(values.tolist())


def _is_fresh(data: Any, before: Any) -> bool:
    return data is not before or not isinstance(data, list | dict | set | bytearray)


def _expect(promise: str, is_kept: bool, seen: Any) -> None:
    if not is_kept:
        raise AssertionError(f"{promise}: got {seen!r}.")
