"""Drawer of streets and nodes: larger roads are wider, tunnels are dashed and lowest, bridges are on top."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from gamms.ir.graph import FloatArray, GraphColumns, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.typing import IContext
from gamms.visual.appearance import AnyColor, GraphData, parse_color
from gamms.visual.drawing import Drawing, get_drawing

_IN_DEGREES = "EPSG:4326", "OGC:CRS84"  # coordinate systems in degrees, whose lengths are not in metres
_FEW = 2_000  # the number of edges up to which streets are wider
_ID_PX = 17
_STREET = 2.0  # metres: how broad a street of a real map is drawn
_SLIM = 0.2  # at most so broad, in lengths of a typical edge


class _RoadClass(NamedTuple):
    """The look of roads of one class."""

    width: float  # in widths of a street
    shade: float  # from the color of streets, 0.0, to that of the background, 1.0, or of words, -1.0


_PATH, _SERVICE, _ORDINARY, _MAIN, _MAJOR = range(5)
_CLASSES = (
    _RoadClass(0.4, 0.0),
    _RoadClass(0.7, 0.0),
    _RoadClass(1.0, 0.0),
    _RoadClass(1.6, -0.1),
    _RoadClass(2.6, -0.2),
)
_CLASS_OF = {
    **dict.fromkeys(("footway", "path", "steps", "cycleway", "pedestrian", "corridor", "bridleway", "track"), _PATH),
    "service": _SERVICE,
    **dict.fromkeys(("primary", "secondary", "motorway_link", "trunk_link"), _MAIN),
    **dict.fromkeys(("motorway", "trunk"), _MAJOR),
}
# of tunnels and bridges; 0: on the ground
_BELOW = -1
_ABOVE = 1
_TUNNEL_SHADE = 0.4
# of a tunnel: metres from dash to dash, and how much of it is drawn
_DASH = 12.0
_DASHED = 0.6


class _Strokes(NamedTuple):
    """Polylines of the same width and color."""

    points: FloatArray  # (points, 2)
    offsets: IntArray  # (lines + 1,)
    width: float  # world units
    shade: float
    level: int


class _Streets(NamedTuple):
    """The drawing of a graph, from back to front."""

    strokes: list[_Strokes]
    is_below: BoolArray  # (nodes,)  whether only tunnels lead there


def render_graph(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw the graph as `data['graph_data']`, a GraphData, describes it; a two-way street is drawn once.

    On a real map the width of a road depends on its class, `highway`. Tunnels are dashed and lowest, bridges are on
    top. If `data['tunnels']` is "below", tunnels are omitted.
    """
    look: GraphData = data["graph_data"]
    columns = ctx.graph.columns()
    visual = get_drawing(ctx)
    streets = visual.of_map(_make_streets)
    is_apart = data.get("tunnels") == "below"
    if columns.crs is None:
        for points, offsets, *_ in streets.strokes:
            visual.render_lines(points, offsets, look.edge_color, 1.5 if len(offsets) <= _FEW else 1.0)
    else:
        _draw(visual, [one for one in streets.strokes if not (is_apart and one.level == _BELOW)], look, tinted=is_apart)
    nodes = columns.xy[~streets.is_below] if is_apart else columns.xy
    visual.render_circles(nodes, look.node_size, look.node_color)
    if look.draw_id:
        for id, (x, y) in zip(columns.node_ids.tolist(), columns.xy.tolist(), strict=True):
            visual.render_text(str(id), x, y, visual.theme.ink, font_size=_ID_PX)


def render_tunnels(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw the tunnels, which `render_graph` omits, and their nodes."""
    look: GraphData = data["graph_data"]
    columns = ctx.graph.columns()
    visual = get_drawing(ctx)
    streets = visual.of_map(_make_streets)
    _draw(visual, [one for one in streets.strokes if one.level == _BELOW], look, tinted=True)
    if streets.is_below.any():
        color = change_shade(look.node_color, _TUNNEL_SHADE, visual)
        visual.render_circles(columns.xy[streets.is_below], look.node_size, color)


def is_in_metres(columns: GraphColumns) -> bool:
    """Return whether lengths on a map are metres."""
    return columns.crs is not None and columns.crs not in _IN_DEGREES


def has_tunnels(columns: GraphColumns) -> bool:
    """Return whether the graph is a real map with a tunnel."""
    return columns.crs is not None and bool((find_levels(columns) == _BELOW).any())


def _draw(visual: Drawing, strokes: list[_Strokes], look: GraphData, *, tinted: bool) -> None:
    for points, offsets, width, shade, _ in strokes:
        color = change_shade(look.edge_color, shade, visual) if tinted and shade else look.edge_color
        visual.render_lines(points, offsets, color, width, in_world=True)


def change_shade(color: AnyColor, shade: float, visual: Drawing) -> AnyColor:
    """Return a color that is nearer to that of the background, or, below 0.0, to that of words."""
    goal = visual.theme.background if shade > 0.0 else visual.theme.ink
    red, green, blue = (round(a + abs(shade) * (b - a)) for a, b in zip(parse_color(color)[:3], goal[:3], strict=True))
    return red, green, blue


def _make_streets(columns: GraphColumns) -> _Streets:
    """Return the drawing of a graph: tunnels first, then by road class, bridges last."""
    rows = find_distinct_roads(columns)
    is_below = np.zeros(len(columns.xy), bool)
    if columns.crs is None:
        return _Streets([_Strokes(*join_polylines(columns, rows), 0.0, 0.0, 0)] if len(rows) else [], is_below)
    breadth = min(_STREET, _SLIM * find_median(columns.lengths))
    classes = find_classes(columns)
    levels = find_levels(columns)
    is_main = classes > _ORDINARY
    strokes = list[_Strokes]()
    # Each look is a pass over the picture: great tunnels look like others, great roads are above the others anyway.
    classes[is_main & (levels == _BELOW)] = _ORDINARY
    levels[is_main & (levels == _ABOVE)] = 0
    for level in (_BELOW, 0, _ABOVE):
        for number, (width, shade) in enumerate(_CLASSES):
            part = rows[(classes[rows] == number) & (levels[rows] == level)]
            if len(part):
                lines = join_polylines(columns, part)
                is_tunnel = level == _BELOW
                lines = cut_dashes(*lines, _DASH) if is_tunnel else lines
                strokes.append(_Strokes(*lines, width * breadth, _TUNNEL_SHADE if is_tunnel else shade, level))
    if (levels == _BELOW).any():
        ends = np.concatenate([columns.sources, columns.targets])
        leads_below = np.tile(levels == _BELOW, 2)
        is_below[ends[leads_below]] = True
        is_below[ends[~leads_below]] = False
    return _Streets(strokes, is_below)


def find_classes(columns: GraphColumns) -> IntArray:
    """Return the class of each edge, (edges,); streets where it is not known."""
    classes = np.full(len(columns.edge_ids), _ORDINARY)
    kinds = columns.edge_attributes.get("highway", {})
    # NOTE: the usual kind costs no call (first frame of 100,000 edges).
    found = [_CLASS_OF.get(one, _ORDINARY) if type(one) is str else _find_class(one) for one in kinds.values()]
    classes[list(kinds)] = found
    return classes


def _find_class(kinds: object) -> int:
    """Return the greatest class of a way of several kinds."""
    known = [kind for kind in kinds if isinstance(kind, str)] if isinstance(kinds, list | tuple) else []
    return max((_CLASS_OF.get(kind, _ORDINARY) for kind in known), default=_ORDINARY)


def find_levels(columns: GraphColumns) -> IntArray:
    """Return which edges, (edges,), are tunnels, bridges or on the ground."""
    levels = np.zeros(len(columns.edge_ids), np.int64)
    attributes = columns.edge_attributes
    layers = {row: _find_layer(value) for row, value in attributes.get("layer", {}).items()}
    levels[list(layers)] = list(layers.values())
    for key, level in (("tunnel", _BELOW), ("bridge", _ABOVE)):
        levels[[row for row, value in attributes.get(key, {}).items() if _is_so(value)]] = level
    return levels


def _find_layer(value: object) -> int:
    """Return on which side of the ground a layer as tags have it is: -1, 0 or 1."""
    text = str(value).strip()
    if not text.lstrip("-").isdigit() or int(text) == 0:
        return 0
    return _BELOW if text.startswith("-") else _ABOVE


def _is_so(value: object) -> bool:
    """Return whether a tag is set and is not "no"."""
    return any(map(_is_so, value)) if isinstance(value, list | tuple) else value not in (None, False, "", "no")


def cut_dashes(points: FloatArray, offsets: IntArray, period: float) -> tuple[FloatArray, IntArray]:
    """Return the dashes of polylines as polylines; each begins and ends with half a dash, so that they fit together."""
    found = list[FloatArray]()
    for line in np.split(points, offsets[1:-1]):
        along = measure_along(line)
        if along[-1] > 0.0:
            found += _cut_into_dashes(line, along, period)
    return np.concatenate([np.empty((0, 2)), *found]), np.cumsum([0, *map(len, found)])


def _cut_into_dashes(line: FloatArray, along: FloatArray, period: float) -> Iterator[FloatArray]:
    """Yield the dashes of a polyline, whose points are so far from its beginning."""
    length = float(along[-1])
    gaps = max(round(length / period), 1)
    step = length / gaps
    for number in range(gaps + 1):
        begin = max((number - _DASHED / 2) * step, 0.0)
        end = min((number + _DASHED / 2) * step, length)
        yield select_part(line, along, begin, end)


def measure_along(line: FloatArray) -> FloatArray:
    """Return how far along a polyline (points, 2) each of its points is."""
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])


def select_part(line: FloatArray, along: FloatArray, begin: float, end: float) -> FloatArray:
    """Return the part of a polyline between two distances; `along` is from `measure_along`."""
    first, last = np.column_stack([np.interp([begin, end], along, axis) for axis in line.T])
    return np.vstack([first, line[(along > begin) & (along < end)], last])


def find_median(lengths: FloatArray) -> float:
    """Return the median of some lengths; 0.0 of none."""
    if len(lengths) == 0:
        return 0.0
    # NOTE: not np.median, which first loads masked arrays for 15 ms (first frame of 100,000 edges).
    low = (len(lengths) - 1) // 2
    high = len(lengths) // 2
    return float(np.partition(lengths, (low, high))[[low, high]].mean())


def join_polylines(columns: GraphColumns, rows: IntArray) -> tuple[FloatArray, IntArray]:
    """Return the points (points, 2) and offsets (rows + 1,) of the edges in `rows`."""
    is_bent = ~_is_straight(columns)[rows]
    bends = [columns.polylines[row] for row in rows[is_bent].tolist()]
    counts = np.full(len(rows), 2, np.int64)
    counts[is_bent] = [len(bend) for bend in bends]
    offsets = np.concatenate(([0], np.cumsum(counts)))
    ends = np.column_stack((columns.sources[rows], columns.targets[rows]))[~is_bent].ravel()
    if not bends:
        return columns.xy[ends], offsets
    points = np.empty((offsets[-1], 2))
    is_of_bend = np.repeat(is_bent, counts)
    points[is_of_bend] = np.concatenate(bends)
    points[~is_of_bend] = columns.xy[ends]
    return points, offsets


def find_distinct_roads(columns: GraphColumns) -> IntArray:
    """Return edge rows without duplicates of earlier edges in the same or the opposite direction."""
    straight = np.flatnonzero(_is_straight(columns))
    low = np.minimum(columns.sources[straight], columns.targets[straight])
    high = np.maximum(columns.sources[straight], columns.targets[straight])
    _, first = np.unique(low * len(columns.node_ids) + high, return_index=True)
    seen: dict[bytes, int] = {}
    for row in sorted(columns.polylines):
        seen.setdefault(_make_undirected_key(columns.polylines[row]), row)
    return np.sort(np.concatenate([straight[first], np.fromiter(seen.values(), np.int64, len(seen))]))


def _is_straight(columns: GraphColumns) -> BoolArray:
    """Return which edges, (edges,), have no polyline."""
    is_straight = np.ones(len(columns.edge_ids), bool)
    is_straight[list(columns.polylines)] = False
    return is_straight


def _make_undirected_key(bend: FloatArray) -> bytes:
    """Return the same bytes for a polyline and its reverse."""
    return min(bend.tobytes(), bend[::-1].tobytes())
