"""Drawer of values: discs on nodes, or broad lines along edges, in the colours that stand for their values."""

from typing import Any

import numpy as np

from gamms.ir.graph import FloatArray, GraphColumns, IntArray
from gamms.typing import IContext
from gamms.visual.drawers.graph import polylines, usual
from gamms.visual.drawing import drawing_of
from gamms.visual.values import Values

_NODE, _EDGE = 0.5, 0.35  # radius of a disc and width of a line, in lengths of a usual edge
_NODE_PX, _EDGE_PX = 2.0, 3.0  # but never less


def render_values(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw `data['values']`, a Values, the highest on top; what is no longer on the map is left out."""
    values: Values = data["values"]
    columns, order = ctx.graph.columns(), np.argsort(values.places, kind="stable")
    known = columns.node_ids if values.of == "nodes" else columns.edge_ids
    rows, is_there = _rows(known, values.ids[order])
    places = values.places[order][is_there]
    cuts = np.flatnonzero(np.diff(places)) + 1
    draw = _draw_nodes if values.of == "nodes" else _draw_edges
    unit = usual_edge(columns)
    for part in np.split(np.arange(len(rows)), cuts) if len(rows) else []:
        draw(ctx, columns, rows[part], unit, values.colors[int(places[part[0]])])


def usual_edge(columns: GraphColumns) -> float:
    """How long an edge is usually, in a straight line; of a map without any, how large the map is, or 1.0."""
    ways = columns.xy[columns.targets] - columns.xy[columns.sources]
    if len(ways):
        return usual(np.hypot(ways[:, 0], ways[:, 1]))
    return float(np.ptp(columns.xy, axis=0).max()) if len(columns.xy) > 1 else 1.0


def _draw_nodes(ctx: IContext, columns: GraphColumns, rows: IntArray, unit: float, color: Any) -> None:
    visual, centers = drawing_of(ctx), columns.xy[rows]
    visual.render_circles(centers, _NODE * unit, color)
    visual.render_circles(centers, _NODE_PX, color, in_pixels=True)


def _draw_edges(ctx: IContext, columns: GraphColumns, rows: IntArray, unit: float, color: Any) -> None:
    points: FloatArray
    points, offsets = polylines(columns, rows)
    drawing_of(ctx).render_lines(points, offsets, color, _EDGE * unit, in_world=True)
    drawing_of(ctx).render_lines(points, offsets, color, _EDGE_PX)


def _rows(known: IntArray, ids: IntArray) -> tuple[IntArray, "np.ndarray[Any, np.dtype[np.bool_]]"]:
    """The rows of those ids that are known, and which these are."""
    order = np.argsort(known, kind="stable")
    places = np.minimum(np.searchsorted(known, ids, sorter=order), max(len(known) - 1, 0))
    is_there = known[order[places]] == ids if len(known) else np.zeros(len(ids), bool)
    return order[places[is_there]] if len(known) else np.empty(0, np.int64), is_there


render_values.once_a_turn = True  # type: ignore[attr-defined] # values are told, and do not glide
