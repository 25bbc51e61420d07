"""Plates: painted surfaces that are shown again as long as the camera sees the same."""

from typing import Any

from gamms.visual.backends.pygame import Canvas, load, veil
from gamms.visual.backends.raster import Painting
from gamms.visual.camera import Camera
from gamms.visual.color import Rgba

_BLACK, _WHITE = (0, 0, 0, 255), (255, 255, 255, 255)


class Plate:
    """A painting on a background, or on glass, through which one sees what is on the canvas."""

    def __init__(self) -> None:
        self._key: tuple[Painting, Camera, Rgba | None] | None = None
        self._surface: Any = None

    def show(self, painting: Painting, canvas: Canvas, camera: Camera, background: Rgba | None) -> None:
        """Show the painting as the camera sees it; no background is glass."""
        key = painting, camera, background
        if key != self._key:
            self._key, self._surface = key, _painted(*key)
        canvas.surface.blit(
            self._surface, (0, 0), special_flags=load().BLEND_PREMULTIPLIED if background is None else 0
        )


def _painted(painting: Painting, camera: Camera, background: Rgba | None) -> Any:
    if background is None:
        return veil(*(_painted(painting, camera, color) for color in (_BLACK, _WHITE)))
    canvas = Canvas(camera.width, camera.height)
    canvas.fill(background)
    painting.paint(canvas, camera)
    return canvas.surface
