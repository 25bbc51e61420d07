"""What the writer of moves checks before it writes: actions, headings, positions, turns."""

from collections.abc import Mapping
from math import hypot, isfinite
from typing import Any

from gamms.arguments import as_float, as_int
from gamms.errors import BadType, BadValue
from gamms.ir.agents import UNTURNED, Position, Quat

_ROUNDING = 2e-15  # how far the square of a length of 1 is off at most


def as_node(value: Any) -> int:
    """An action that is to be a node id."""
    try:
        return as_int(value, "A node id")
    except BadType:
        raise BadType(
            f"An action must be a node id or a dict with 'node_id', not {value!r} ({type(value).__name__})."
        ) from None


def as_heading(heading: Any) -> tuple[float, float]:
    """`(cos, sin)` of length 1 from a pair of any length."""
    try:
        x, y = heading
    except (TypeError, ValueError):
        raise BadValue(f"An orientation must be a pair (cos, sin), not {heading!r}.") from None
    x, y = as_float(x, "An orientation"), as_float(y, "An orientation")
    scale = max(abs(x), abs(y))  # first, so that no square overflows or vanishes
    if scale == 0.0:
        raise BadValue("An orientation must not be (0, 0). Use None to have none set.")
    x, y = x / scale, y / scale
    length = hypot(x, y)
    return x / length, y / length


def as_position(value: Any) -> Position:
    """`(x, y, z)`, finite."""
    x, y, z = _numbers(value, "position", "(x, y, z)")
    return (x, y, z)


def as_quat(value: Any) -> Quat:
    """`(w, x, y, z)` of length 1 from one of any length; all zeros mean unturned."""
    w, x, y, z = parts = _numbers(value, "quat", "(w, x, y, z)")
    if abs(w * w + x * x + y * y + z * z - 1.0) < _ROUNDING:  # so that setting what was read changes nothing
        return (w, x, y, z)
    scale = max(map(abs, parts))
    if scale == 0.0:
        return UNTURNED
    w, x, y, z = (part / scale for part in parts)
    length = hypot(w, x, y, z)
    return (w / length, x / length, y / length, z / length)


def one_step(position: Position, direction: Any, speed: float) -> Position:
    """Where one step of `speed` map units leads; a direction of length 0 leads nowhere else."""
    parts = _numbers(direction, "direction", "(dx, dy, dz)")
    scale = max(map(abs, parts))
    if scale == 0.0:
        return position
    parts = [part / scale for part in parts]
    length = hypot(*parts)
    x, y, z = (at + part / length * speed for at, part in zip(position, parts, strict=True))
    if not (isfinite(x) and isfinite(y) and isfinite(z)):
        raise BadValue(f"A step of {speed} from {position} leads beyond all numbers. Use a smaller speed.")
    return (x, y, z)


def _numbers(value: Any, what: str, form: str) -> list[float]:
    """As many finite numbers as `form` names.

    Raises:
        BadType: `value` is no sequence of numbers.
        BadValue: there are more or fewer, or one is NaN or infinite.
    """
    if not hasattr(value, "__getitem__") or isinstance(value, (str, bytes, Mapping)):
        raise BadType(f"A {what} must be {form}, not {value!r} ({type(value).__name__}).")
    if getattr(value, "ndim", 1) != 1 or len(value) != form.count(",") + 1:
        raise BadValue(f"A {what} must be {form}, not {value!r}.")
    return [as_float(part, f"Every part of a {what} {form}") for part in value]
