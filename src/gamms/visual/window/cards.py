"""Cards: what the words on a window lie on."""

from functools import lru_cache
from typing import Any

from gamms.visual.backends.pygame import load
from gamms.visual.color import Rgba

EDGE_PX = 12  # between a card and the edge of the window


@lru_cache(maxsize=64)
def plain_card(width: int, height: int, color: Rgba, border: Rgba | None = None, radius: int = 8) -> Any:
    """An empty card with round corners, as a surface."""
    pygame = load()
    surface = pygame.Surface((width, height), pygame.SRCALPHA, 32)
    if border is not None:
        pygame.draw.rect(surface, border, surface.get_rect(), border_radius=radius)
    inside = surface.get_rect() if border is None else surface.get_rect().inflate(-2, -2)
    pygame.draw.rect(surface, color, inside, border_radius=radius - (border is not None))
    return surface
