"""Drawer of choices: where the agent whose person is asked may go next."""

from typing import Any

import numpy as np

from gamms.ir.graph import FloatArray
from gamms.typing import IContext
from gamms.visual.appearance import GraphData
from gamms.visual.drawers.graph import polylines
from gamms.visual.drawing import drawing_of

_EDGE_PX, _RING_PX = 3.0, 11.0


def render_input_overlay(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw the ways to `data['_input_options']` (number -> node; 0 is where the agent is) and rings around them.

    `data['graph_data']`, a GraphData, says how; nothing is drawn while nobody is asked.
    """
    options: dict[int, int] = data.get("_input_options", {})
    if not options or not data.get("_waiting_user_input"):
        return
    look: GraphData = data["graph_data"]
    columns, graph = ctx.graph.columns(), ctx.graph.graph
    places = graph.positions(list(options.values()))
    shown = ctx.visual.get_viewport()
    radius = max(look.node_size, _RING_PX / shown[-1]) if shown is not None else look.node_size
    rows = _rows(columns, next(iter(options.values())), set(options.values()))
    ways = [_between_rings(polylines(columns, row)[0], radius) for row in rows[:, None]]
    if ways:
        offsets = np.cumsum([0, *map(len, ways)])
        drawing_of(ctx).render_lines(np.vstack(ways), offsets, look.edge_color, _EDGE_PX)
    drawing_of(ctx).render_circles(places, radius, look.node_color, _EDGE_PX)


def _between_rings(way: FloatArray, radius: float) -> FloatArray:
    """A way without its ends, which would cover who stands there; all of it where that would leave nothing."""
    along = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(way, axis=0).T))))
    ends = radius, along[-1] - radius
    if ends[0] >= ends[1]:
        return way
    begin, end = (np.array([np.interp(place, along, values) for values in way.T]) for place in ends)
    return np.vstack([begin, way[(along > ends[0]) & (along < ends[1])], end])


def _rows(columns: Any, here: int, ends: set[int]) -> "np.ndarray[Any, np.dtype[np.int64]]":
    """The edges that lead from a node to some others."""
    [begin] = np.flatnonzero(columns.node_ids == here)
    edges = columns.out_edges[columns.offsets[begin] : columns.offsets[begin + 1]]
    targets = columns.node_ids[columns.targets[edges]].tolist()
    rows: np.ndarray[Any, np.dtype[np.int64]] = edges[[target in ends for target in targets]]
    return rows
