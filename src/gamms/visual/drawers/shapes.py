"""Drawers of plain shapes, and marks that stay visible from afar."""

from dataclasses import fields
from typing import Any, TypeVar

from gamms.errors import BadValue
from gamms.typing import ColorType, IContext
from gamms.visual.appearance import Circle, Rectangle
from gamms.visual.drawing import drawing_of

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


# A drawer does not know the scale, so each mark is drawn twice, in world units and in pixels.


def rings(
    ctx: IContext, centers: Any, radius: float, color: ColorType, at_least_px: float, width_px: float = 2.0
) -> None:
    """Draw a ring around each of `centers` (rings, 2); a large one keeps the small one inside it."""
    visual = drawing_of(ctx)
    visual.render_circles(centers, radius, color, width_px)
    visual.render_circles(centers, at_least_px, color, width_px, in_pixels=True)
