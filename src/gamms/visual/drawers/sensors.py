"""Drawer of sensors: what each saw last, whatever its kind, drawn so that what lies below stays visible."""

from dataclasses import replace
from typing import Any

from gamms.ir.sensed import SensorView
from gamms.typing import IContext
from gamms.visual.color import Color, Rgba, rgba
from gamms.visual.drawers.fields import field_of_view
from gamms.visual.drawers.marks import rings
from gamms.visual.drawing import drawing_of
from gamms.visual.sights import view_of

_ALPHA = 150
_NODE_PX, _RING_PX, _EDGE_PX = 3.0, 10.0, 4.0
_NODE_RADIUS, _JUNCTION_RADIUS, _AGENT_RADIUS = 2.0, 1.0, 8.0  # world units


def render_sensor(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw the last view of the sensor that `data['name']` names.

    Nothing is drawn where all who carry it are out. The field of view lies below, then the edges, marks on the nodes,
    and rings around the agents. `data` may also have `color`, `node_color`, `edge_color`, `size` (of the rings) and
    `node_size`, both in world units.

    Raises:
        UnknownName (KeyError): there is no such sensor.
        NotOffered: it has no `last_view`.
    """
    sensor = ctx.sensor.get_sensor(data["name"])
    if not drawing_of(ctx).carriers.is_blind(sensor):
        _draw(ctx, data, view_of(sensor))


def render_sight(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw what a sensor sees now: `data["sights"]` are views, each with the colour of the agent that carries it.

    The rings around agents that are known by name are left to `render_rings`.
    """
    for color, view in data["sights"]:
        _draw(ctx, {**data, "color": color}, replace(view, agents=view.agents[:0]) if view.names else view)


def render_rings(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw the rings of such views around the agents where they are shown."""
    position_of, share, agents = drawing_of(ctx).position_of, data.get("_alpha", 1.0), ctx.agent.agents
    for color, view in data["sights"]:
        places = [position_of(name, share) for name in view.names if name in agents]
        rings(ctx, places, data["size"], color, _RING_PX)


def _draw(ctx: IContext, data: dict[str, Any], view: SensorView) -> None:
    color = data.get("color", data.get("node_color", Color.Cyan))
    if len(view.outline):
        field_of_view(ctx, view.outline, color)
    if len(view.lines):
        edge_color = _see_through(data.get("edge_color", color))
        drawing_of(ctx).render_lines(view.lines, view.offsets, edge_color, _EDGE_PX)
    if len(view.nodes):
        usual = _JUNCTION_RADIUS if len(view.lines) else _NODE_RADIUS
        _mark(ctx, view.nodes, data.get("node_size", usual), data.get("node_color", color))
    if len(view.agents):
        rings(ctx, view.agents, data.get("size", _AGENT_RADIUS), color, _RING_PX)


def _mark(ctx: IContext, centers: Any, radius: float, color: Any) -> None:
    """A ring, and a small dot for when the ring is too small: whoever stands there keeps its own colour."""
    visual = drawing_of(ctx)
    visual.render_circles(centers, radius, color, 2.0)
    visual.render_circles(centers, _NODE_PX, _see_through(color), in_pixels=True)


def _see_through(color: Any) -> Rgba:
    """The colour with our transparency, unless it brings its own."""
    red, green, blue, alpha = rgba(color)
    return red, green, blue, min(alpha, _ALPHA)


render_sensor.once_a_turn = True  # type: ignore[attr-defined] # between turns nobody looks
render_sight.once_a_turn = True  # type: ignore[attr-defined] # it is seen from where agents will be at the end

# The names under which 1.0.0 had a drawer per kind.
render_map_sensor = render_agent_sensor = render_neighbor_sensor = render_aerial_agent_sensor = render_sensor
