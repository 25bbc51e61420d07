"""Drawers of sensors: what each saw last, drawn so that what lies below stays visible."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from gamms.errors import BadValue
from gamms.typing import ColorType, IContext, SensorType
from gamms.typing.artist import Drawer
from gamms.visual.color import Color, Rgba, rgba
from gamms.visual.drawers.marks import rings
from gamms.visual.primitives import primitives_of

_ALPHA = 150
_NODE_PX, _RING_PX, _EDGE_PX = 3.0, 10.0, 4.0
_NEIGHBOR_RADIUS, _MAP_RADIUS, _AGENT_RADIUS = 2.0, 1.0, 8.0


def render_sensor(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw the last view of the sensor that `data['name']` names, in the way of its kind.

    Raises:
        BadValue: a kind of the user's own, which only the user can draw.
    """
    type = ctx.sensor.get_sensor(data["name"]).type
    if type not in _DRAWERS:
        raise BadValue(f"Sensors of type {type.name} have no drawer here; add an artist with a drawer of your own.")
    _DRAWERS[type](ctx, data)


def render_neighbor_sensor(ctx: IContext, data: dict[str, Any]) -> None:
    """Mark the nodes that were sensed."""
    nodes = ctx.sensor.get_sensor(data["name"]).data
    centers = ctx.graph.graph.positions(list(nodes))
    _mark(ctx, centers, _NEIGHBOR_RADIUS, data.get("color", Color.Cyan))


def render_agent_sensor(ctx: IContext, data: dict[str, Any]) -> None:
    """Ring the agents that were sensed, `size` world units around them."""
    seen = ctx.sensor.get_sensor(data["name"]).data
    centers = ctx.graph.graph.positions(list(seen.values()))
    rings(ctx, centers, data.get("size", _AGENT_RADIUS), data.get("color", Color.Cyan), _RING_PX)


def render_map_sensor(ctx: IContext, data: dict[str, Any]) -> None:
    """Mark the nodes and trace the edges that were sensed."""
    seen = ctx.sensor.get_sensor(data["name"]).data
    _trace(ctx, [edge.points for edge in seen.get("edges", ())], _see_through(data.get("edge_color", Color.Cyan)))
    centers = [(node.x, node.y) for node in seen.get("nodes", {}).values()]
    _mark(ctx, centers, _MAP_RADIUS, data.get("node_color", Color.Cyan))


def _mark(ctx: IContext, centers: Any, radius: float, color: Any) -> None:
    """A ring, and a small dot for when the ring is too small: whoever stands there keeps its own colour."""
    visual = primitives_of(ctx)
    visual.render_circles(centers, radius, color, 2.0)
    visual.render_circles(centers, _NODE_PX, _see_through(color), in_pixels=True)


def _trace(ctx: IContext, lines: list[tuple[float, ...]], color: ColorType) -> None:
    points = np.array([number for line in lines for number in line]).reshape(-1, 2)
    offsets = np.cumsum([0, *(len(line) // 2 for line in lines)])
    primitives_of(ctx).render_lines(points, offsets, color, _EDGE_PX)


def _see_through(color: Any) -> Rgba:
    """The colour with our transparency, unless it brings its own."""
    red, green, blue, alpha = rgba(color)
    return red, green, blue, min(alpha, _ALPHA)


def _each(types: Iterable[SensorType], drawer: Drawer) -> dict[SensorType, Drawer]:
    return dict.fromkeys(types, drawer)


_DRAWERS: dict[SensorType, Drawer] = {
    SensorType.NEIGHBOR: render_neighbor_sensor,
    **_each(
        (SensorType.AGENT, SensorType.AGENT_RANGE, SensorType.AGENT_ARC, SensorType.OCCLUDED_AGENT),
        render_agent_sensor,
    ),
    **_each(
        (
            SensorType.MAP,
            SensorType.RANGE,
            SensorType.ARC,
            SensorType.AERIAL,
            SensorType.OCCLUDED_MAP,
            SensorType.OCCLUDED_AERIAL,
        ),
        render_map_sensor,
    ),
}
