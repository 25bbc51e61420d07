"""Drawer of the graph: streets as polylines, nodes as small discs, all in bulk."""

from typing import Any

import numpy as np

from gamms.ir.graph import FloatArray, GraphColumns, IntArray
from gamms.typing import IContext
from gamms.visual.appearance import GraphData
from gamms.visual.primitives import primitives_of

_FEW = 2_000  # up to so many edges there is room for broader streets
_ID_PX, _INK = 17, (60, 60, 60)
_STREET = 2.0  # metres: how broad a street of a real map is drawn, but never thinner than a pixel
_SLIM = 0.2  # at most so broad, in lengths of a usual edge


def render_graph(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw the graph as `data['graph_data']`, a GraphData, describes it; a two-way street is drawn once."""
    look: GraphData = data["graph_data"]
    columns = ctx.graph.columns()
    visual = primitives_of(ctx)
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
        usual = float(np.median(columns.lengths)) if len(columns.lengths) else 0.0
        look.edge_line_points[columns.revision] = points, offsets, min(_STREET, _SLIM * usual)
    made: tuple[FloatArray, IntArray, float] = look.edge_line_points[columns.revision]
    return made


def polylines(columns: GraphColumns, rows: IntArray) -> tuple[FloatArray, IntArray]:
    """Points (points, 2) and offsets (rows + 1,) of the edges in `rows`."""
    bends = [columns.bends.get(row) for row in rows.tolist()]
    counts = np.array([2 if bend is None else len(bend) for bend in bends], np.int64)
    offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    is_straight = np.array([bend is None for bend in bends], bool)
    points = np.empty((offsets[-1], 2))
    first = offsets[:-1][is_straight]
    points[first] = columns.xy[columns.sources[rows[is_straight]]]
    points[first + 1] = columns.xy[columns.targets[rows[is_straight]]]
    points[np.repeat(~is_straight, counts)] = np.concatenate(
        [np.empty((0, 2)), *(bend for bend in bends if bend is not None)]
    )
    return points, offsets


def one_way_each(columns: GraphColumns) -> IntArray:
    """Edge rows without those that repeat an earlier one, in the same or the opposite direction."""
    bent = np.fromiter(sorted(columns.bends), np.int64, len(columns.bends))
    straight = np.setdiff1d(np.arange(len(columns.edge_ids)), bent, assume_unique=True)
    low = np.minimum(columns.sources[straight], columns.targets[straight])
    high = np.maximum(columns.sources[straight], columns.targets[straight])
    _, first = np.unique(low * len(columns.node_ids) + high, return_index=True)
    seen: dict[bytes, int] = {}
    for row in bent.tolist():
        seen.setdefault(_undirected(columns.bends[row]), row)
    return np.sort(np.concatenate([straight[first], np.fromiter(seen.values(), np.int64, len(seen))]))


def _undirected(bend: FloatArray) -> bytes:
    """The same bytes for a polyline and its reverse."""
    return min(bend.tobytes(), bend[::-1].tobytes())
