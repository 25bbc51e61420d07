"""Drawers of the map: values of nodes and edges, choices of a person, obstacles and the base map."""

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from gamms import kernels
from gamms.ir.geometry import are_within, join_rings
from gamms.ir.graph import FloatArray, GraphColumns, IntArray
from gamms.ir.obstacles import COLOR_TYPES, OTHER_OBSTACLE, BoolArray, ObstacleColumns
from gamms.ir.scenery import SceneryKind, find_ground
from gamms.typing import IContext
from gamms.visual.appearance import AnyColor, GraphData, Rgb, Rgba, parse_color
from gamms.visual.drawers.streets import find_median, join_polylines, measure_along, select_part
from gamms.visual.drawing import Drawing, get_drawing
from gamms.visual.legend import ColoredValues
from gamms.visual.themes import WallTones

# radius of a disc and width of a line, in lengths of a typical edge
_NODE = 0.5
_EDGE = 0.35
# but never less
_NODE_PX = 2.0
_EDGE_PX = 3.0


def render_values(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw `data['values']`, the highest on top; values of removed nodes and edges are omitted."""
    values: ColoredValues = data["values"]
    columns = ctx.graph.columns()
    order = np.argsort(values.places, kind="stable")
    are_nodes = values.of == "nodes"
    known = columns.node_ids if are_nodes else columns.edge_ids
    rows = kernels.find_rows(known, values.ids[order], columns.node_order if are_nodes else columns.edge_order)
    places = values.places[order][rows >= 0]
    rows = rows[rows >= 0]
    draw = _draw_nodes if values.of == "nodes" else _draw_edges
    unit = find_typical_edge_length(columns)
    for begin, end in pairwise(kernels.find_equal_runs(places).tolist()):
        draw(ctx, columns, rows[begin:end], unit, values.colors[int(places[begin])])


def measure_longer_side(columns: GraphColumns) -> float:
    """Return the larger of the extents of a map from west to east and from south to north; 0.0 for no map."""
    return float(np.ptp(columns.xy, axis=0).max()) if len(columns.xy) else 0.0


def find_typical_edge_length(columns: GraphColumns) -> float:
    """Return the median length of edges as the crow flies; for a map without any, how large it is, or 1.0."""
    ways = columns.xy[columns.targets] - columns.xy[columns.sources]
    if len(ways):
        return find_median(np.hypot(ways[:, 0], ways[:, 1]))
    return measure_longer_side(columns) if len(columns.xy) > 1 else 1.0


def _draw_nodes(ctx: IContext, columns: GraphColumns, rows: IntArray, unit: float, color: AnyColor) -> None:
    visual = get_drawing(ctx)
    centers = columns.xy[rows]
    visual.render_circles(centers, _NODE * unit, color)
    visual.render_circles(centers, _NODE_PX, color, in_pixels=True)


def _draw_edges(ctx: IContext, columns: GraphColumns, rows: IntArray, unit: float, color: AnyColor) -> None:
    points: FloatArray
    points, offsets = join_polylines(columns, rows)
    get_drawing(ctx).render_lines(points, offsets, color, _EDGE * unit, in_world=True)
    get_drawing(ctx).render_lines(points, offsets, color, _EDGE_PX)


render_values.once_a_turn = True  # type: ignore[attr-defined] # values do not glide


_CHOICE_PX = 3.0
_RING_PX = 11.0


def render_input_overlay(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw the edges to `data['_input_options']` (number -> node; 0 is the agent's node), and rings around these nodes.

    `data['graph_data']`, a GraphData, defines the look; `data['_ink']` overrides the color. Nothing is drawn unless a
    person is asked.
    """
    options: dict[int, int] = data.get("_input_options", {})
    if not options or not data.get("_waiting_user_input"):
        return
    look: GraphData = data["graph_data"]
    columns = ctx.graph.columns()
    graph = ctx.graph.graph
    places = graph.positions(list(options.values()))
    shown = ctx.visual.get_viewport()
    least = 0.0 if shown is None else _RING_PX / shown[-1]
    radius = least if data.get("_ink") and least else max(look.node_size, least)
    rows = _find_edges(columns, next(iter(options.values())), set(options.values()))
    ways = [_cut_ends(join_polylines(columns, row)[0], radius) for row in rows[:, None]]
    if ways:
        offsets = np.cumsum([0, *map(len, ways)])
        get_drawing(ctx).render_lines(np.vstack(ways), offsets, data.get("_ink") or look.edge_color, _CHOICE_PX)
    get_drawing(ctx).render_circles(places, radius, data.get("_ink") or look.node_color, _CHOICE_PX)


def _cut_ends(way: FloatArray, radius: float) -> FloatArray:
    """Return a way without its ends, which would cover the agents there; all of it where nothing would be left."""
    along = measure_along(way)
    return way if 2 * radius >= along[-1] else select_part(way, along, radius, along[-1] - radius)


def _find_edges(columns: GraphColumns, here: int, ends: set[int]) -> "np.ndarray[Any, np.dtype[np.int64]]":
    """Return the edges that lead from a node to some others."""
    [begin] = np.flatnonzero(columns.node_ids == here)
    edges = columns.out_edges[columns.offsets[begin] : columns.offsets[begin + 1]]
    targets = columns.node_ids[columns.targets[edges]].tolist()
    return edges[[target in ends for target in targets]]


_Outline = list[list[float]]  # corners (x, y)


class Footprints(NamedTuple):
    """The outlines of buildings, and the faces around each."""

    points: FloatArray  # (points, 2)
    offsets: IntArray  # (footprints + 1,)  footprint `i` is `points[offsets[i]:offsets[i + 1]]`
    heights: FloatArray  # (footprints,)  of the top edges
    types: IntArray  # (footprints,)  of obstacles
    row_of: IntArray  # (faces,)  the footprint of each face; -1 = none

    def select(self, is_chosen: BoolArray) -> tuple[FloatArray, IntArray]:
        """Return the points and offsets of some footprints."""
        take, offsets = kernels.select_runs(self.offsets, np.flatnonzero(is_chosen))
        return self.points[take], offsets

    def compute_boxes(self) -> tuple[FloatArray, FloatArray]:
        """Return the lower left and upper right corners, (footprints, 2) each."""
        first = self.offsets[:-1]
        return np.minimum.reduceat(self.points, first), np.maximum.reduceat(self.points, first)


def find_footprints(faces: ObstacleColumns) -> Footprints:
    """Return the footprints of faces whose top edges lead, one after the other, around something.

    A ring inside the one before, of the same type, height and base, is a courtyard: it makes a hole.
    """
    rings, is_forward = _find_rings(faces.corners[:, 0], faces.corners[:, 1])
    outlines: list[_Outline] = [
        faces.corners[begin:end, 0 if forward else 1, :2].tolist()
        for (begin, end), forward in zip(rings.tolist(), is_forward, strict=True)
    ]
    first = rings[:, 0]
    looks = np.column_stack((faces.types, faces.corners[:, 0, 2], faces.corners[:, 2, 2]))[first].tolist()
    bundles = _group_rings(outlines, looks)
    closed = [np.array([*outline, outline[0]]) for outline in outlines]
    polygons = [join_rings([closed[ring] for ring in bundle]) for bundle in bundles]
    row_of = np.full(len(faces.ids), -1)
    for row, bundle in enumerate(bundles):
        for ring in bundle:
            row_of[slice(*rings[ring])] = row
    outer = first[np.array([bundle[0] for bundle in bundles], np.int64)]
    return Footprints(
        points=np.concatenate([np.empty((0, 2)), *polygons]),
        offsets=np.cumsum([0, *map(len, polygons)]),
        heights=_compute_wall_heights(faces.corners[outer]),
        types=faces.types[outer],
        row_of=row_of,
    )


def _compute_wall_heights(corners: FloatArray) -> FloatArray:
    """Return how high walls (walls, 4, 3) are: above their bases if none begins at 0, where the map is not flat."""
    tops = corners[:, 0, 2]
    bases = corners[:, 2, 2]
    return tops - bases if bases.all() else tops


def _find_rings(rights: FloatArray, lefts: FloatArray) -> tuple[IntArray, list[bool]]:
    """Return the first row and last row + 1 of each ring, (rings, 2), and whether its faces join from right to left."""
    found = dict.fromkeys(map(tuple, kernels.find_closed_rings(rights, lefts).tolist()), True)
    taken = np.zeros(len(rights), bool)
    for begin, end in found:
        taken[begin:end] = True
    others = np.zeros((0, 2), np.int64) if taken.all() else kernels.find_closed_rings(lefts, rights)
    for begin, end in others.tolist():
        if not taken[begin:end].any():
            found[(begin, end)] = False
    rings = sorted(found)
    return np.array(rings, np.int64).reshape(-1, 2), [found[ring] for ring in rings]


def _group_rings(outlines: list[_Outline], looks: list[list[float]]) -> list[list[int]]:
    """Yield the rings of each footprint: the outer ring, then the rings of its courtyards."""
    bundles: list[list[int]] = []
    for ring, outline in enumerate(outlines):
        outer, *holes = bundles[-1] if bundles else [ring]
        is_hole = ring > 0 and looks[ring] == looks[outer] and _is_within(outline, outlines[outer])
        if is_hole and not any(_is_within(outline, outlines[hole]) for hole in holes):
            bundles[-1].append(ring)
        else:
            bundles.append([ring])
    return bundles


def _is_within(outline: _Outline, other: _Outline) -> bool:
    """Return whether the middles of all edges are inside another outline."""
    for axis in (0, 1):
        mine, around = ([point[axis] for point in one] for one in (outline, other))
        if min(mine) < min(around) or max(mine) > max(around):
            return False
    corners = np.array(outline)
    return bool(are_within((corners + np.roll(corners, -1, axis=0)) / 2, np.array(other)).all())


_STEPS = 6  # distinct tones
# percentiles of heights; shades vary between these
_LOWEST = 5.0
_TALLEST = 95.0
_SHADE = 0.75  # of the color of an area: its outline


def render_obstacles(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw all obstacles.

    `data`: `color_map` (type -> color), `boundary_thickness` (world units); `fill` (bool): whether buildings are
    filled, in the color of their type or, if the color map has none, in a shade that depends on their height.

    Faces of one type are drawn at once, the types in the order of their first face.
    """
    columns = find_obstacles_to_draw(ctx)
    visual = get_drawing(ctx)
    thickness = data.get("boundary_thickness", 1.0)
    if data.get("fill"):
        _draw_buildings(ctx, columns, data.get("color_map", {}), thickness, visual.theme.map.walls)
        return
    colors: dict[int, Any] = {**COLOR_TYPES, **data.get("color_map", {})}
    types, first = np.unique(columns.types, return_index=True)
    for type in types[np.argsort(first)].tolist():
        _draw_tops(visual, columns, columns.types == type, colors.get(type, OTHER_OBSTACLE), thickness)


def find_obstacles_to_draw(ctx: IContext) -> ObstacleColumns:
    """Return the obstacles of a context; of one without any, the buildings that are drawn and block no sight."""
    obstacles = ctx.graph.obstacle_columns()
    return obstacles if len(obstacles.ids) else ctx.graph.scenery_columns().buildings


_LINES_M = {SceneryKind.WATERWAY: 2.0, SceneryKind.TRAM: 0.5, SceneryKind.RAIL: 0.8}  # how broad lines are drawn


def render_base_map(ctx: IContext, data: dict[str, Any]) -> None:  # noqa: ARG001 - of every drawer
    """Draw the areas and lines of the scenery on the ground of the map: parks, water, then rails."""
    columns = ctx.graph.columns()
    scenery = ctx.graph.scenery_columns()
    visual = get_drawing(ctx)
    tones = visual.theme.map.ground
    walls = find_obstacles_to_draw(ctx).corners.reshape(-1, 3)[:, :2]
    ground = find_ground(scenery.points, columns.xy, *columns.polylines.values(), walls)
    if len(ground):
        (left, low), (right, high) = ground.tolist()
        visual.render_polygon([(left, low), (right, low), (right, high), (left, high)], tones.land)
    colors = {
        SceneryKind.GREEN: tones.green,
        SceneryKind.WATER: tones.water,
        SceneryKind.WATERWAY: tones.waterway,
        SceneryKind.TRAM: tones.rail,
        SceneryKind.RAIL: tones.rail,
    }
    for kind, color in colors.items():
        take, offsets = kernels.select_runs(scenery.offsets, np.flatnonzero(scenery.kinds == kind))
        if kind in _LINES_M and len(take):
            visual.render_lines(scenery.points[take], offsets, color, _LINES_M[kind], in_world=True)
        elif len(take):
            visual.render_polygons(scenery.points[take], offsets, color)


def _draw_tops(visual: Drawing, columns: ObstacleColumns, chosen: BoolArray, color: AnyColor, thickness: float) -> None:
    tops = columns.corners[chosen, 1::-1, :2]  # from top left to top right
    if len(tops):
        offsets = np.arange(0, 2 * len(tops) + 1, 2)
        visual.render_lines(tops.reshape(-1, 2), offsets, color, thickness, in_world=True)


# -- filled -----------------------------------------------------------------------------------------------------


def _draw_buildings(
    ctx: IContext, columns: ObstacleColumns, colors: dict[int, Any], thickness: float, tones: WallTones
) -> None:
    """Fill closed outlines, the highest last; then draw all top edges."""
    visual = get_drawing(ctx)
    built = find_footprints(columns)
    is_filled = ~_is_fence(ctx, built)
    own = np.isin(built.types, list(colors))
    step = _find_tones(built.heights)
    for number in range(_STEPS):
        tone = _blend_colors(tones.low, tones.high, number / (_STEPS - 1))
        _fill(visual, built, is_filled & ~own & (step == number), tone)
    has_own = np.isin(columns.types, list(colors))
    is_around = np.append(is_filled, False)[built.row_of]  # the row -1 is the last
    _draw_tops(visual, columns, ~has_own & is_around, tones.outline, thickness)
    _draw_tops(visual, columns, ~has_own & ~is_around, tones.wall, thickness)
    for type, color in colors.items():
        _fill(visual, built, is_filled & (built.types == type), color)
        _draw_tops(visual, columns, (columns.types == type) & is_around, _shade_color(color), thickness)
        _draw_tops(visual, columns, (columns.types == type) & ~is_around, color, thickness)


def _fill(visual: Drawing, built: Footprints, chosen: BoolArray, color: AnyColor) -> None:
    if chosen.any():
        visual.render_polygons(*built.select(chosen), color)


def _is_fence(ctx: IContext, built: Footprints) -> BoolArray:
    """Return which rings have the whole graph inside: they are around the scene, not in it."""
    xy: FloatArray = ctx.graph.columns().xy
    if len(xy) == 0 or len(built.types) == 0:
        return np.zeros(len(built.types), bool)
    low, high = built.compute_boxes()
    is_fence: BoolArray = (low <= xy.min(axis=0)).all(axis=1) & (high >= xy.max(axis=0)).all(axis=1)
    return is_fence


def _find_tones(heights: FloatArray) -> IntArray:
    """Return which of the tones each height has."""
    if len(heights) == 0:
        return np.zeros(0, np.int64)
    low, high = np.percentile(heights, (_LOWEST, _TALLEST)).tolist()
    if low == high:
        return np.full(len(heights), (_STEPS - 1) // 2)
    share = np.clip((heights - low) / (high - low), 0.0, 1.0)
    steps: IntArray = np.rint(share * (_STEPS - 1)).astype(np.int64)
    return steps


def _blend_colors(low: Rgb, high: Rgb, share: float) -> Rgb:
    red, green, blue = (round(a + share * (b - a)) for a, b in zip(low, high, strict=True))
    return red, green, blue


def _shade_color(color: AnyColor) -> Rgba:
    red, green, blue, alpha = parse_color(color)
    return round(_SHADE * red), round(_SHADE * green), round(_SHADE * blue), alpha
