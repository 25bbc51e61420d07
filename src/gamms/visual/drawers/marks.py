"""Marks that stay visible from afar: sized in world units, but never smaller than some pixels."""

from typing import Any

from gamms.typing import ColorType, IContext
from gamms.visual.drawing import drawing_of

# A drawer does not know the scale, so each mark is drawn twice, in world units and in pixels.


def rings(
    ctx: IContext, centers: Any, radius: float, color: ColorType, at_least_px: float, width_px: float = 2.0
) -> None:
    """Draw a ring around each of `centers` (rings, 2); a large one keeps the small one inside it."""
    visual = drawing_of(ctx)
    visual.render_circles(centers, radius, color, width_px)
    visual.render_circles(centers, at_least_px, color, width_px, in_pixels=True)
