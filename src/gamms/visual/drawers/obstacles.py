"""Drawer of obstacles: the top edge of each face as a line in the colour of its type."""

from collections import defaultdict
from typing import Any

import numpy as np

from gamms.ir.palette import COLOR_TYPES, OTHER_OBSTACLE
from gamms.typing import IContext
from gamms.visual.primitives import primitives_of

Segment = tuple[tuple[float, ...], tuple[float, ...]]


def render_obstacles(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw all obstacles; `data`: `color_map` (type -> colour), `boundary_thickness` (world units)."""
    colors: dict[int, Any] = {**COLOR_TYPES, **data.get("color_map", {})}
    thickness = data.get("boundary_thickness", 1.0)
    for type, segments in _top_edges(ctx).items():
        offsets = np.arange(0, 2 * len(segments) + 1, 2)
        points = np.array(segments).reshape(-1, 2)
        primitives_of(ctx).render_lines(points, offsets, colors.get(type, OTHER_OBSTACLE), thickness, in_world=True)


def _top_edges(ctx: IContext) -> dict[int, list[Segment]]:
    """The top edges of the faces by type, types in the order of their first face."""
    edges: dict[int, list[Segment]] = defaultdict(list)
    for id in ctx.graph.get_obstacle_faces():
        face = ctx.graph.get_obstacle_face(id)
        edges[face.type].append((face.tl[:2], face.tr[:2]))
    return edges
