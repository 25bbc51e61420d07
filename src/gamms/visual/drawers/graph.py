"""Drawer of the graph: streets as polylines, nodes as small discs, all in bulk."""

from typing import Any

import numpy as np

from gamms.ir.graph import FloatArray, GraphColumns, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.typing import IContext
from gamms.visual.appearance import GraphData
from gamms.visual.drawing import drawing_of

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
