"""Checks of what callers pass for nodes, headings, positions, quaternions and strategies before it is written."""

from collections.abc import Iterable
from math import hypot, isfinite
from typing import Any, cast

import numpy as np

from gamms import kernels
from gamms.arguments import as_float, as_function_of, as_int, as_numbers, as_range
from gamms.errors import BadType, BadValue, UnknownName
from gamms.ir.agents import UNTURNED, AgentBlock, Position, Quat
from gamms.text import Called, shown
from gamms.typing.context import IContext
from gamms.typing.graph_engine import IGraph


def as_node(value: object) -> int:
    """Return an action that must be a node id."""
    try:
        return as_int(value, "A node id")
    except BadType:
        raise BadType(
            f"An action must be a node id or a dict with 'node_id', not {shown(value)} ({type(value).__name__})."
        ) from None


def known_node(graph: IGraph, block: AgentBlock, value: object) -> int:
    """Return the id of a node of the graph; while the block trusts nodes, any integer.

    Raises:
        UnknownName (KeyError): there is no such node.
        BadType: it is no integer.
    """
    node = as_int(value, "A node id")
    if not block.trusts_nodes and not graph.has_node(node):
        raise UnknownName("node", node)
    return node


def above(graph: IGraph, node: int, z: float) -> Position:
    """Return the position above a node; (0, 0, z) where a trusted node is not there, for replay knows the position."""
    if not graph.has_node(node):
        return (0.0, 0.0, z)
    _, x, y = graph.get_node(node)
    return (x, y, z)


def as_heading(heading: object) -> tuple[float, float]:
    """Return `(cos, sin)` of length 1 from a pair of any length."""
    try:
        x, y = cast("Iterable[object]", heading)
    except (TypeError, ValueError):
        raise BadValue(f"An orientation must be a pair (cos, sin), not {shown(heading)}.") from None
    cos, sin = as_float(x, "An orientation"), as_float(y, "An orientation")
    scale = max(abs(cos), abs(sin))  # first, so that no square overflows or vanishes
    if scale == 0.0:
        raise BadValue("An orientation must not be (0, 0). Use None to have none set.")
    cos, sin = cos / scale, sin / scale
    length = hypot(cos, sin)
    return cos / length, sin / length


def heading_in(action: dict[str, Any]) -> Any:
    """Return the heading that an action dict asks for, None to follow moves; () where it asks for none.

    Raises:
        BadValue, BadType: it has no `node_id`, or an impossible orientation.
    """
    if "node_id" not in action:
        raise BadValue(f"An action dict needs 'node_id'; got only {sorted(map(str, action))}.")
    if "orientation" not in action:
        return ()
    heading = action["orientation"]
    return None if heading is None else as_heading(heading)


def as_position(value: object) -> Position:
    """Return `(x, y, z)`, finite."""
    x, y, z = as_numbers(value, "A position", "(x, y, z)")
    return (x, y, z)


def as_quat(value: object) -> Quat:
    """Return `(w, x, y, z)` of length 1 from one of any length; all zeros mean unturned."""
    w, x, y, z = as_numbers(value, "A quat", "(w, x, y, z)")
    return kernels.unit_quaternion((w, x, y, z)) or UNTURNED


def level_quat(heading: object) -> Quat:
    """Return the quaternion that faces `(cos, sin)`, of any length, without pitch and roll; None: unturned."""
    return UNTURNED if heading is None else kernels.about_z(as_heading(heading))


def one_step(position: Position, direction: object, speed: float) -> Position:
    """Return the position after one step of `speed` map units; a direction of length 0 leaves it."""
    parts = as_numbers(direction, "A direction", "(dx, dy, dz)")
    scale = max(map(abs, parts))
    if scale == 0.0:
        return position
    parts = [part / scale for part in parts]
    length = hypot(*parts)
    x, y, z = (at + part / length * speed for at, part in zip(position, parts, strict=True))
    if not (isfinite(x) and isfinite(y) and isfinite(z)):
        raise BadValue(f"A step of {speed} from {position} leads beyond all numbers. Use a smaller speed.")
    return (x, y, z)


def flight(block: AgentBlock, row: int, action: object) -> tuple[Position | None, Quat | None]:
    """Return the position and the quaternion after a flyer's action; None for what does not change.

    Raises:
        BadType, BadValue: it is not an action of a flyer.
    """
    if isinstance(action, dict):
        quat = as_quat(action["quat"]) if "quat" in action else None
        if "direction" not in action:
            return None, quat
        return _ahead(block, row, action["direction"], action.get("distance")), quat
    if isinstance(action, (tuple, np.ndarray)):
        return _ahead(block, row, action, None), None
    raise BadType(
        "The action of an aerial agent must be a tuple (dx, dy, dz) or a dict with 'direction' or 'quat', "
        f"not {shown(action)} ({type(action).__name__})."
    )


def position_of(block: AgentBlock, row: int) -> Position:
    """Return the position of a flyer.

    Raises:
        BadType: the agent is on the ground.
    """
    position = block.position[row]
    if position is None:
        raise BadType(f"Agent {block.names[row]!r} does not fly.")
    return position


def _ahead(block: AgentBlock, row: int, direction: object, distance: object) -> Position:
    speed = block.speed[row] or 0.0
    if distance is None:
        return one_step(position_of(block, row), direction, speed)
    far = as_range(distance, "A distance")
    if far > speed:
        raise BadValue(f"A distance of {far:g} is more than agent {block.names[row]!r} flies at once: {speed:g}.")
    return one_step(position_of(block, row), direction, far)


def as_strategy(ctx: IContext, value: object) -> Any:
    """Check that a value is a function of the state, which was not made for another context.

    Raises:
        BadType, BadValue: it is not.
    """
    as_function_of(value, "A strategy", "the state")
    if isinstance(value, Called) and any(isinstance(one, IContext) and one is not ctx for one in value.held()):
        raise BadValue(
            f"{shown(value)} was made for another context, whose map and agents it asks for. Make it with this one."
        )
    return value
