"""Plates: painted surfaces, larger than the view while a camera moves, and shifted until they no longer hold it."""

from typing import Any

from gamms.visual.backends.pygame import Canvas, load, on_glass
from gamms.visual.backends.raster import Painting
from gamms.visual.camera import Camera
from gamms.visual.color import Rgba

_BORDER = 4  # one fourth of the view on every side


class Plate:
    """A painting on a background, or on glass, through which one sees what is on the canvas."""

    def __init__(self) -> None:
        self._painting: Painting | None = None
        self._background: Rgba | None = None
        self._camera: Camera | None = None
        self._surface: Any = None

    def show(
        self, painting: Painting, canvas: Canvas, camera: Camera, background: Rgba | None, *, is_moving: bool
    ) -> None:
        """Show the painting as the camera sees it; no background is glass."""
        is_mine = painting is self._painting and background == self._background
        if not is_mine or not self._serves(camera, is_moving=is_moving):
            self._painting, self._background = painting, background
            self._camera = _larger(camera) if is_moving else camera
            self._surface = _painted(painting, self._camera, background)
        self._blit(canvas, camera, load().BLEND_PREMULTIPLIED if background is None else 0)

    def _serves(self, camera: Camera, *, is_moving: bool) -> bool:
        """Whether what was painted shows all that the camera sees; while it moves, up to half a pixel beside."""
        mine = self._camera
        if mine is None or camera.scale != mine.scale:
            return False
        x, y = _shift(mine, camera)
        is_whole = is_moving or (x == round(x) and y == round(y))
        is_held = min(x, y) >= 0.0 and x + camera.width <= mine.width and y + camera.height <= mine.height
        return is_whole and is_held

    def _blit(self, canvas: Canvas, camera: Camera, flags: int) -> None:
        if self._camera is not None:
            x, y = _shift(self._camera, camera)
            canvas.paste(self._surface, (round(x), round(y), camera.width, camera.height), flags)


def _painted(painting: Painting, camera: Camera, background: Rgba | None) -> Any:
    if background is None:
        return on_glass(lambda color: _painted(painting, camera, color))
    canvas = Canvas(camera.width, camera.height)
    canvas.fill(background)
    painting.paint(canvas, camera)
    return canvas.surface


def _larger(camera: Camera) -> Camera:
    across, down = camera.width // _BORDER, camera.height // _BORDER
    return Camera(
        camera.width + 2 * across,
        camera.height + 2 * down,
        camera.left - across / camera.scale,
        camera.top + down / camera.scale,
        camera.scale,
    )


def _shift(mine: Camera, camera: Camera) -> tuple[float, float]:
    """How many pixels right of and below the corner of `mine` the corner of a camera of the same scale lies."""
    return (camera.left - mine.left) * mine.scale, (mine.top - camera.top) * mine.scale
