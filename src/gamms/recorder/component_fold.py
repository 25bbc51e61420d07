"""What events do to the components of a state: names, fields and values, without a class that could do anything."""

from collections.abc import Callable
from typing import Any

from gamms.typing.opcodes import OpCodes

State = dict[str, Any]


def opened(told: Any) -> State:
    """Components as a keyframe tells them: module and name of a class -> its fields; name of a component -> its values.

    Raises:
        KeyError, TypeError, ValueError, AttributeError: a stranger told them.
    """
    return {
        "component_classes": {(module, name): list(fields) for module, name, fields in told["classes"]},
        "components": {name: dict(fields) for name, fields in told["values"].items()},
    }


def nothing() -> State:
    """No components."""
    return opened({"classes": (), "values": {}})


def _declare(state: State, data: Any) -> None:
    module, name = data["key"]
    state["component_classes"][module, name] = list(data["struct"])


def _build(state: State, data: Any) -> None:
    module, name = data["type"]
    state["components"][data["name"]] = dict.fromkeys(state["component_classes"][module, name])


def _update(state: State, data: Any) -> None:
    state["components"][data["name"]][data["key"]] = data["value"]


def _delete(state: State, data: Any) -> None:
    del state["components"][data["name"]]


EVENTS: dict[int, Callable[[State, Any], None]] = {
    OpCodes.COMPONENT_REGISTER.value: _declare,
    OpCodes.COMPONENT_CREATE.value: _build,
    OpCodes.COMPONENT_UPDATE.value: _update,
    OpCodes.COMPONENT_DELETE.value: _delete,
}
