"""Drawers of plain shapes: what an artist with `Shape.Circle` or `Shape.Rectangle` draws."""

from dataclasses import fields
from typing import Any, TypeVar

from gamms.errors import BadValue
from gamms.typing import IContext
from gamms.visual.appearance import Circle, Rectangle

_Shape = TypeVar("_Shape", Circle, Rectangle)


def render_circle(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw a Circle found in `data`, or the one that `data` describes: x, y, radius (or scale), color."""
    if "scale" in data:
        data = {"radius": data["scale"], **data}
    circle = _described(Circle, data)
    ctx.visual.render_circle(circle.x, circle.y, circle.radius, circle.color)


def render_rectangle(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw a Rectangle found in `data`, or the one that `data` describes: x, y, width, height, color."""
    shape = _described(Rectangle, data)
    ctx.visual.render_rectangle(shape.x, shape.y, shape.width, shape.height, shape.color)


def _described(kind: type[_Shape], data: dict[str, Any]) -> _Shape:
    for value in data.values():
        if isinstance(value, kind):
            return value
    names = [field.name for field in fields(kind)]
    missing = [name for name in names if name not in data and name != "color"]
    if missing:
        raise BadValue(f"The data of a {kind.__name__.lower()} lacks {', '.join(missing)}; it has {sorted(data)}.")
    return kind(**{name: data[name] for name in names if name in data})
