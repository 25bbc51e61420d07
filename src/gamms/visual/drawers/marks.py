"""Marks that stay visible from afar: sized in world units, but never smaller than some pixels."""

from typing import Any

from gamms.typing import ColorType, IContext
from gamms.visual.primitives import primitives_of

# A drawer does not know the scale, so each mark is drawn twice, in world units and in pixels.


def rings(
    ctx: IContext, centers: Any, radius: float, color: ColorType, at_least_px: float, width_px: float = 2.0
) -> None:
    """Draw a ring around each of `centers` (rings, 2); a large one keeps the small one inside it."""
    visual = primitives_of(ctx)
    visual.render_circles(centers, radius, color, width_px)
    visual.render_circles(centers, at_least_px, color, width_px, in_pixels=True)


def discs(ctx: IContext, centers: Any, radius: float, color: ColorType, outline: ColorType, at_least_px: float) -> None:
    """Fill an outlined disc around each of `centers` (discs, 2)."""
    visual = primitives_of(ctx)
    # Both outlines come first, so that the larger disc hides the outline of the smaller.
    visual.render_circles(centers, radius, outline, 3.0)
    visual.render_circles(centers, at_least_px, outline, 3.0, in_pixels=True)
    visual.render_circles(centers, radius, color)
    visual.render_circles(centers, at_least_px, color, in_pixels=True)
