"""Plates: painted surfaces, larger than the view while a camera moves, shifted and scaled until they no longer do."""

from typing import Any

from gamms.visual.backends.pygame import Canvas, load, veil
from gamms.visual.backends.raster import Painting
from gamms.visual.camera import Camera
from gamms.visual.color import Rgba
from gamms.visual.constants import CACHE_ZOOM_MAX

_BORDER = 4  # one fourth of the view on every side
_BLACK, _WHITE = (0, 0, 0, 255), (255, 255, 255, 255)


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
        """Whether what was painted shows all that the camera sees, and sharply enough."""
        mine = self._camera
        if mine is None or not is_moving:
            return mine is not None and (camera == mine or _is_shifted(mine, camera))
        return 1 / CACHE_ZOOM_MAX <= camera.scale / mine.scale <= CACHE_ZOOM_MAX and _holds(mine, camera)

    def _blit(self, canvas: Canvas, camera: Camera, flags: int) -> None:
        mine = self._camera
        if mine is None:
            return
        x, y = (camera.left - mine.left) * mine.scale, (mine.top - camera.top) * mine.scale
        if camera.scale == mine.scale:
            area = (round(x), round(y), camera.width, camera.height)
            canvas.paste(self._surface, area, flags)
            return
        share = mine.scale / camera.scale
        size = min(round(camera.width * share), mine.width), min(round(camera.height * share), mine.height)
        left, top = min(max(round(x), 0), mine.width - size[0]), min(max(round(y), 0), mine.height - size[1])
        part = self._surface.subsurface((left, top, *size))
        scaled = load().transform.smoothscale(part, (camera.width, camera.height))
        canvas.paste(scaled, None, flags)


def _painted(painting: Painting, camera: Camera, background: Rgba | None) -> Any:
    if background is None:
        return veil(*(_painted(painting, camera, color) for color in (_BLACK, _WHITE)))
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


def _holds(mine: Camera, camera: Camera) -> bool:
    """Whether all that `camera` sees lies within what `mine` sees."""
    left, top = (camera.left - mine.left) * mine.scale, (mine.top - camera.top) * mine.scale
    share = mine.scale / camera.scale
    return (
        min(left, top) >= 0.0
        and left + camera.width * share <= mine.width
        and top + camera.height * share <= mine.height
    )


def _is_shifted(mine: Camera, camera: Camera) -> bool:
    """Whether `camera` sees a part of what `mine` sees, whole pixels away."""
    x, y = (camera.left - mine.left) * mine.scale, (mine.top - camera.top) * mine.scale
    return camera.scale == mine.scale and x == round(x) and y == round(y) and _holds(mine, camera)
