"""The legend on the window: the one of pictures, painted once on glass and shown in every frame."""

from typing import Any

from gamms.visual.backends.pygame import Canvas, load, on_glass
from gamms.visual.backends.raster import Painting
from gamms.visual.camera import Camera
from gamms.visual.legend import Block, Legend
from gamms.visual.window.cards import EDGE_PX, plain_card
from gamms.visual.window.themes import Theme

_FOOT_PX = 64  # of the window, where it asks and names the source of the map


class WindowLegend:
    """What colours mean, in the upper right corner of the window."""

    def __init__(self, theme: Theme) -> None:
        self._theme = theme
        self._told: tuple[tuple[Block, ...], int, int] = ((), 1, 1)
        self._legend = Legend(*self._told)
        self._glass: Any = None

    @property
    def blocks(self) -> tuple[Block, ...]:
        """What it explains."""
        return self._told[0]

    @property
    def width(self) -> int:
        """Pixels from the right edge of the window; 0 where there is no legend, or no room for it."""
        return round(self._legend.aside)

    @property
    def height(self) -> int:
        """Likewise, downwards."""
        return round(self._legend.depth)

    def explain(self, blocks: tuple[Block, ...], width: int, height: int) -> None:
        """Say this from now on, in a window of so many pixels."""
        if (blocks, width, height) != self._told:
            self._told, self._glass = (blocks, width, height), None
            self._legend = Legend(blocks, width, height - _FOOT_PX)

    def paint(self, canvas: Canvas, top: int) -> None:
        """Paint it from `top` downwards, if there is room for it above the foot of the window."""
        if self.width and top + self.height <= canvas.height - _FOOT_PX:
            if self._glass is None:
                self._glass = on_glass(self._painted)
            place = canvas.width - self.width, top
            canvas.surface.blit(self._glass, place, special_flags=load().BLEND_PREMULTIPLIED)

    def _painted(self, behind: Any) -> Any:
        canvas, theme = Canvas(self.width, self.height), self._theme
        canvas.fill(behind)
        card = plain_card(self.width - EDGE_PX, self.height - EDGE_PX, theme.card, theme.border)
        canvas.surface.blit(card, (0, EDGE_PX))
        camera = Camera(canvas.width, canvas.height, 0.0, 0.0, 1.0)
        Painting(self._legend.commands(camera, background=theme.card, ground=0)).paint(canvas, camera)
        return canvas.surface
