"""Drawers of the graph: streets and nodes, values of them, and the choices of a person."""

from typing import Any

import numpy as np

from gamms.ir.graph import FloatArray, GraphColumns, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.typing import IContext
from gamms.visual.appearance import GraphData
from gamms.visual.drawing import drawing_of
from gamms.visual.values import Values

_FEW = 2_000  # up to so many edges there is room for broader streets
_ID_PX, _INK = 17, (60, 60, 60)
_STREET = 2.0  # metres: how broad a street of a real map is drawn, but never thinner than a pixel
_SLIM = 0.2  # at most so broad, in lengths of a usual edge


def render_graph(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw the graph as `data['graph_data']`, a GraphData, describes it; a two-way street is drawn once."""
    look: GraphData = data["graph_data"]
    columns = ctx.graph.columns()
    visual = drawing_of(ctx)
    points, offsets, breadth = _streets(columns, look)
    if columns.crs is None:
        visual.render_lines(points, offsets, look.edge_color, 1.5 if len(offsets) <= _FEW else 1.0)
    else:
        visual.render_lines(points, offsets, look.edge_color, breadth, in_world=True)
    visual.render_circles(columns.xy, look.node_size, look.node_color)
    if look.draw_id:
        for id, (x, y) in zip(columns.node_ids.tolist(), columns.xy.tolist(), strict=True):
            visual.render_text(str(id), x, y, _INK, font_size=_ID_PX)


def _streets(columns: GraphColumns, look: GraphData) -> tuple[FloatArray, IntArray, float]:
    """The polylines of the graph and how broad they are on a real map, made once per revision."""
    if columns.revision not in look.edge_line_points:
        look.edge_line_points.clear()
        points, offsets = polylines(columns, one_way_each(columns))
        look.edge_line_points[columns.revision] = points, offsets, min(_STREET, _SLIM * usual(columns.lengths))
    made: tuple[FloatArray, IntArray, float] = look.edge_line_points[columns.revision]
    return made


def usual(lengths: FloatArray) -> float:
    """The median of some lengths; 0.0 of none."""
    if len(lengths) == 0:
        return 0.0
    # NOTE: not np.median, which first loads masked arrays for 15 ms (first frame of 100,000 edges).
    low, high = (len(lengths) - 1) // 2, len(lengths) // 2
    return float(np.partition(lengths, (low, high))[[low, high]].mean())


def polylines(columns: GraphColumns, rows: IntArray) -> tuple[FloatArray, IntArray]:
    """Points (points, 2) and offsets (rows + 1,) of the edges in `rows`."""
    is_bent = ~_is_straight(columns)[rows]
    bends = [columns.bends[row] for row in rows[is_bent].tolist()]
    counts = np.full(len(rows), 2, np.int64)
    counts[is_bent] = [len(bend) for bend in bends]
    offsets = np.concatenate(([0], np.cumsum(counts)))
    ends = np.column_stack((columns.sources[rows], columns.targets[rows]))[~is_bent].ravel()
    if not bends:
        return columns.xy[ends], offsets
    points, is_of_bend = np.empty((offsets[-1], 2)), np.repeat(is_bent, counts)
    points[is_of_bend], points[~is_of_bend] = np.concatenate(bends), columns.xy[ends]
    return points, offsets


def one_way_each(columns: GraphColumns) -> IntArray:
    """Edge rows without those that repeat an earlier one, in the same or the opposite direction."""
    straight = np.flatnonzero(_is_straight(columns))
    low = np.minimum(columns.sources[straight], columns.targets[straight])
    high = np.maximum(columns.sources[straight], columns.targets[straight])
    _, first = np.unique(low * len(columns.node_ids) + high, return_index=True)
    seen: dict[bytes, int] = {}
    for row in sorted(columns.bends):
        seen.setdefault(_undirected(columns.bends[row]), row)
    return np.sort(np.concatenate([straight[first], np.fromiter(seen.values(), np.int64, len(seen))]))


def _is_straight(columns: GraphColumns) -> BoolArray:
    """Which edges, (edges,), have no polyline."""
    is_straight = np.ones(len(columns.edge_ids), bool)
    is_straight[list(columns.bends)] = False
    return is_straight


def _undirected(bend: FloatArray) -> bytes:
    """The same bytes for a polyline and its reverse."""
    return min(bend.tobytes(), bend[::-1].tobytes())


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


render_values.once_a_turn = True  # type: ignore[attr-defined] # values do not glide


_CHOICE_PX, _RING_PX = 3.0, 11.0


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
    rows = _edges_between(columns, next(iter(options.values())), set(options.values()))
    ways = [_between_rings(polylines(columns, row)[0], radius) for row in rows[:, None]]
    if ways:
        offsets = np.cumsum([0, *map(len, ways)])
        drawing_of(ctx).render_lines(np.vstack(ways), offsets, look.edge_color, _CHOICE_PX)
    drawing_of(ctx).render_circles(places, radius, look.node_color, _CHOICE_PX)


def _between_rings(way: FloatArray, radius: float) -> FloatArray:
    """A way without its ends, which would cover the agents there; all of it where that would leave nothing."""
    along = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(way, axis=0).T))))
    ends = radius, along[-1] - radius
    if ends[0] >= ends[1]:
        return way
    begin, end = (np.array([np.interp(place, along, values) for values in way.T]) for place in ends)
    return np.vstack([begin, way[(along > ends[0]) & (along < ends[1])], end])


def _edges_between(columns: Any, here: int, ends: set[int]) -> "np.ndarray[Any, np.dtype[np.int64]]":
    """The edges that lead from a node to some others."""
    [begin] = np.flatnonzero(columns.node_ids == here)
    edges = columns.out_edges[columns.offsets[begin] : columns.offsets[begin + 1]]
    targets = columns.node_ids[columns.targets[edges]].tolist()
    rows: np.ndarray[Any, np.dtype[np.int64]] = edges[[target in ends for target in targets]]
    return rows
