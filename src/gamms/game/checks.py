"""What the writer of moves checks before it writes: actions, headings, positions, turns."""

from math import hypot, isfinite
from typing import Any

import numpy as np

from gamms import kernels
from gamms.arguments import as_float, as_int, as_numbers
from gamms.errors import BadType, BadValue
from gamms.ir.agents import UNTURNED, AgentColumns, Position, Quat
from gamms.text import shown


def as_node(value: Any) -> int:
    """An action that is to be a node id."""
    try:
        return as_int(value, "A node id")
    except BadType:
        raise BadType(
            f"An action must be a node id or a dict with 'node_id', not {shown(value)} ({type(value).__name__})."
        ) from None


def as_heading(heading: Any) -> tuple[float, float]:
    """`(cos, sin)` of length 1 from a pair of any length."""
    try:
        x, y = heading
    except (TypeError, ValueError):
        raise BadValue(f"An orientation must be a pair (cos, sin), not {shown(heading)}.") from None
    x, y = as_float(x, "An orientation"), as_float(y, "An orientation")
    scale = max(abs(x), abs(y))  # first, so that no square overflows or vanishes
    if scale == 0.0:
        raise BadValue("An orientation must not be (0, 0). Use None to have none set.")
    x, y = x / scale, y / scale
    length = hypot(x, y)
    return x / length, y / length


def as_position(value: Any) -> Position:
    """`(x, y, z)`, finite."""
    x, y, z = as_numbers(value, "A position", "(x, y, z)")
    return (x, y, z)


def as_quat(value: Any) -> Quat:
    """`(w, x, y, z)` of length 1 from one of any length; all zeros mean unturned."""
    w, x, y, z = as_numbers(value, "A quat", "(w, x, y, z)")
    return kernels.unit_quaternion((w, x, y, z)) or UNTURNED


def one_step(position: Position, direction: Any, speed: float) -> Position:
    """Where one step of `speed` map units leads; a direction of length 0 leads nowhere else."""
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


def flight(columns: AgentColumns, row: int, action: Any) -> tuple[Position | None, Quat | None]:
    """Where a flyer's action leads, and how it turns; None for what stays as it is.

    Raises:
        BadType, BadValue: it is no action of a flyer.
    """
    if isinstance(action, dict):
        quat = as_quat(action["quat"]) if "quat" in action else None
        return (_ahead(columns, row, action["direction"]) if "direction" in action else None), quat
    if isinstance(action, (tuple, np.ndarray)):
        return _ahead(columns, row, action), None
    raise BadType(
        "The action of an aerial agent must be a tuple (dx, dy, dz) or a dict with 'direction' or 'quat', "
        f"not {shown(action)} ({type(action).__name__})."
    )


def position_of(columns: AgentColumns, row: int) -> Position:
    """Where a flyer is."""
    position = columns.position[row]
    if position is None:
        raise BadType(f"Agent {columns.names[row]!r} does not fly.")
    return position


def _ahead(columns: AgentColumns, row: int, direction: Any) -> Position:
    return one_step(position_of(columns, row), direction, columns.speed[row] or 0.0)
