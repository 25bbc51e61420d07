"""Drawers of sensor views, transparent so that the map stays visible."""

from dataclasses import replace
from itertools import chain
from typing import Any

import numpy as np

from gamms.errors import BadValue
from gamms.ir.geometry import join_rings, list_rings, unite
from gamms.ir.graph import FloatArray, GraphColumns
from gamms.ir.sensor_results import SensorView
from gamms.text import shown
from gamms.typing import IContext
from gamms.visual.appearance import AnyColor, Color, Rgba, parse_color
from gamms.visual.drawers.agents import draw_rings
from gamms.visual.drawers.streets import cut_dashes, measure_along
from gamms.visual.drawing import Points, get_drawing
from gamms.visual.shown_turn import get_view

_ALPHA = 150
_NODE_PX = 3.0
_RING_PX = 10.0
_EDGE_PX = 4.0
# of the common drawing of many sensors
_MANY_ALPHA = 110
_MANY_PX = 2.5
_MOST_OPAQUE = 0.4  # fields of view of all colors, one upon the other
# world units
_NODE_RADIUS = 2.0
_JUNCTION_RADIUS = 1.0
_AGENT_RADIUS = 8.0


def render_sensor(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw the last view of the sensor that `data['name']` names.

    Nothing is drawn where all agents that carry it are out. The field of view lies below, then the edges, marks on the
    nodes, and rings around the agents. `data` may also have `color`, `node_color`, `edge_color`, `size` (of the
    rings) and `node_size`, both in world units.

    Raises:
        UnknownName (KeyError): there is no such sensor.
        NotOffered: it has no `last_view`.
    """
    sensor = ctx.sensor.get_sensor(data["name"])
    if not get_drawing(ctx).carriers.is_blind(sensor):
        _draw(ctx, data, get_view(sensor))


def render_sight(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw present sensor views: `data["sights"]` are views, each with the color of its agent.

    The rings around agents that are known by name are left to `render_rings`.
    """
    for color, view in data["sights"]:
        _draw(ctx, {**data, "color": color}, replace(view, agents=view.agents[:0]) if view.names else view)


def render_sights(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw many sensor views, merged by color, so that overlaps are drawn once and the map stays visible.

    `data["sights"]` is as for `render_sight`.
    """
    views: dict[AnyColor, list[SensorView]] = {}
    for color, view in data["sights"]:
        views.setdefault(color, []).append(remove_edge_ends(view))
    alpha = min(_FILL_ALPHA, round(255 * (1 - (1 - _MOST_OPAQUE) ** (1 / max(len(views), 1)))))
    for color, of_color in views.items():
        outlines = [_move_with_carrier(ctx, view, view.outline, data) for view in of_color if len(view.outline)]
        _draw_fields_of_view(ctx, outlines, color, alpha)
        _draw_dashed_border(
            ctx, [_move_with_carrier(ctx, view, view.dashed, data) for view in of_color if len(view.dashed)], color
        )
    visual = get_drawing(ctx)
    for color, of_color in views.items():
        lines = dict[bytes, FloatArray]()
        for view in of_color:
            lines |= {line.tobytes(): line for line in np.split(view.lines, view.offsets[1:-1]) if len(line)}
        if lines:
            offsets = np.cumsum([0, *map(len, lines.values())])
            visual.render_lines(
                np.concatenate([*lines.values()]), offsets, _make_transparent(color, _MANY_ALPHA), _MANY_PX
            )
    for color, of_color in views.items():
        marked = [view.nodes for view in of_color if len(view.nodes)]
        if marked:
            nodes = np.unique(np.concatenate(marked), axis=0)
            visual.render_circles(nodes, _MANY_PX / 2, _make_transparent(color), in_pixels=True)
        for view in of_color:
            if len(view.agents) and not view.names:
                draw_rings(ctx, view.agents, data["size"], parse_color(color), _RING_PX)


def remove_edge_ends(view: SensorView) -> SensorView:
    """Return a view without the nodes at the ends of its edges."""
    return replace(view, nodes=view.nodes[:0]) if len(view.lines) else view


def render_rings(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw the rings of sensor views around agents at their shown positions."""
    position_of = get_drawing(ctx).position_of
    share = data.get("_alpha", 1.0)
    agents = ctx.agent.agents
    for color, view in data["sights"]:
        places = [position_of(name, share) for name in view.names if name in agents]
        draw_rings(ctx, places, data["size"], color, _RING_PX)


def _draw(ctx: IContext, data: dict[str, Any], view: SensorView) -> None:
    data = {**data.get("_defaults", {}), **data}
    color = data.get("color", data.get("node_color", Color.Cyan))
    if len(view.outline):
        draw_field_of_view(ctx, _move_with_carrier(ctx, view, view.outline, data), color)
    if len(view.dashed):
        _draw_dashed_border(ctx, [_move_with_carrier(ctx, view, view.dashed, data)], color)
    if len(view.lines):
        edge_color = _make_transparent(data.get("edge_color", color))
        get_drawing(ctx).render_lines(view.lines, view.offsets, edge_color, _EDGE_PX)
    if len(view.nodes):
        default = _JUNCTION_RADIUS if len(view.lines) else _NODE_RADIUS
        _mark(ctx, view.nodes, data.get("node_size", default), data.get("node_color", color))
    if len(view.agents):
        draw_rings(ctx, view.agents, data.get("size", _AGENT_RADIUS), color, _RING_PX)


def _move_with_carrier(ctx: IContext, view: SensorView, corners: FloatArray, data: dict[str, Any]) -> FloatArray:
    """Return the corners of a field of view, around its carrier as it is shown while it moves."""
    share = data.get("_alpha", 1.0)
    if view.carrier is None or view.is_early or share >= 1.0 or view.carrier not in ctx.agent.agents:
        return corners
    position_of = get_drawing(ctx).position_of
    moved: FloatArray = corners + np.subtract(position_of(view.carrier, share), position_of(view.carrier, 1.0))
    return moved


def _mark(ctx: IContext, centers: Points, radius: float, color: AnyColor) -> None:
    """Draw a ring, and a small dot for when the ring is too small: an agent there keeps its own color."""
    visual = get_drawing(ctx)
    visual.render_circles(centers, radius, color, 2.0)
    visual.render_circles(centers, _NODE_PX, _make_transparent(color), in_pixels=True)


render_sensor.once_a_turn = True  # type: ignore[attr-defined] # sensors look once a turn

# The names under which 1.0.0 had a drawer per kind.
render_map_sensor = render_agent_sensor = render_neighbor_sensor = render_aerial_agent_sensor = render_sensor


_SPILL = 4.0  # of the map's longer side: how far beyond it a field is drawn, which is more than pictures show
_FILL_ALPHA = 30
_RIM_ALPHA = 130
# of a dashed border
_DASHES = 40
_DASH_PX = 1.5


def draw_field_of_view(ctx: IContext, outline: Points, color: AnyColor) -> None:
    """Fill `outline` (corners, 2) transparently, unless it contains the whole map.

    Raises:
        BadValue: a corner that is no pair of finite numbers.
    """
    corners = _cut_outline(ctx, outline)
    if len(corners) == 0:
        return
    visual = get_drawing(ctx)
    visual.render_polygon(corners.tolist(), _make_transparent(color, _FILL_ALPHA))
    visual.render_polygon(corners.tolist(), _make_transparent(color, _RIM_ALPHA), 1)


def _draw_fields_of_view(ctx: IContext, outlines: list[FloatArray], color: AnyColor, alpha: int) -> None:
    """Fill the union of fields of view, and draw its border."""
    bounded = _unite_outlines(ctx, outlines)
    if not bounded:
        return
    visual = get_drawing(ctx)
    fills = [join_rings(rings) for rings in bounded]
    rims = list(chain.from_iterable(bounded))
    visual.render_polygons(np.concatenate(fills), np.cumsum([0, *map(len, fills)]), _make_transparent(color, alpha))
    visual.render_lines(np.concatenate(rims), np.cumsum([0, *map(len, rims)]), _make_transparent(color, _RIM_ALPHA))


def _draw_dashed_border(ctx: IContext, outlines: list[FloatArray], color: AnyColor) -> None:
    """Draw the border of the union of fields of view dashed."""
    visual = get_drawing(ctx)
    for rim in chain.from_iterable(_unite_outlines(ctx, outlines)):
        points, offsets = cut_dashes(rim, np.array([0, len(rim)]), measure_along(rim)[-1] / _DASHES)
        visual.render_lines(points, offsets, _make_transparent(color, _RIM_ALPHA), _DASH_PX)


def _unite_outlines(ctx: IContext, outlines: list[FloatArray]) -> list[list[FloatArray]]:
    """Return the union of fields of view: the closed rings of each polygon."""
    corners = [_cut_outline(ctx, outline) for outline in outlines]
    return [list_rings(polygon) for polygon in unite([one for one in corners if len(one)])]


def _cut_outline(ctx: IContext, outline: Points) -> FloatArray:
    """Return a field of view (corners, 2), cut to the surroundings of the map; empty if it contains the whole map.

    Raises:
        BadValue: a corner that is no pair of finite numbers.
    """
    corners = np.asarray(outline, np.float64)
    if corners.ndim != 2 or corners.shape[1] != 2 or not np.isfinite(corners).all():
        raise BadValue(f"The outline of a field of view is (x, y) pairs of finite numbers, not {shown(outline)}.")
    box = get_drawing(ctx).of_map(_compute_surroundings)
    if box is not None:
        corners = cut(corners, *box)
    is_drawn = len(corners) > 2 and (box is None or not _is_whole(corners, *box))
    return corners if is_drawn else corners[:0]


def cut(corners: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """Return the part (corners, 2) of a polygon that is inside a box, by the algorithm of Sutherland and Hodgman."""
    if ((corners >= low) & (corners <= high)).all():  # as most are
        return corners
    for axis in (0, 1):
        corners = _cut_off(corners, axis, low[axis], -1.0)
        corners = _cut_off(corners, axis, high[axis], 1.0)
    return corners


def _cut_off(corners: FloatArray, axis: int, limit: float, side: float) -> FloatArray:
    """Return the part of a polygon that is not beyond a limit; `side` is 1.0 where larger is beyond, else -1.0."""
    beyond = side * (corners[:, axis] - limit)
    following = np.roll(corners, -1, axis=0)
    next_beyond = side * (following[:, axis] - limit)
    crosses = (beyond > 0.0) != (next_beyond > 0.0)
    share = np.divide(beyond, beyond - next_beyond, out=np.zeros(len(corners)), where=crosses)
    crossings = corners + share[:, None] * (following - corners)
    crossings[:, axis] = limit
    kept = np.column_stack([beyond <= 0.0, crosses]).ravel()
    both = np.stack([corners, crossings], axis=1).reshape(-1, 2)
    inside: FloatArray = both[kept]
    return inside


def _compute_surroundings(columns: GraphColumns) -> tuple[FloatArray, FloatArray] | None:
    """Return the lower left and upper right corner of the box that fields of view are cut to; None for no extent."""
    xy = columns.xy
    if len(xy) == 0:
        return None
    low = xy.min(axis=0)
    high = xy.max(axis=0)
    spill = _SPILL * float((high - low).max())
    return (low - spill, high + spill) if spill > 0.0 else None


def _is_whole(corners: FloatArray, low: FloatArray, high: FloatArray) -> bool:
    """Return whether a polygon that was cut to a box fills it, so that all its corners are on the sides of the box."""
    return bool(((corners == low) | (corners == high)).any(axis=1).all())


def _make_transparent(color: AnyColor, alpha: int = _ALPHA) -> Rgba:
    """Return a color with the default transparency, unless it is more transparent already."""
    red, green, blue, own = parse_color(color)
    return red, green, blue, min(own, alpha)
