"""The camera of a window, which keys, mouse and programs move."""

import numpy as np

from gamms.arguments import as_float, as_int
from gamms.errors import BadValue
from gamms.ir.graph import FloatArray
from gamms.visual.camera import Camera

Point = tuple[float, float]
Margins = tuple[float, float, float, float]  # left, top, right, bottom; pixels
_HALF_WIDTH = 15.0  # world units, of a camera that was not pointed anywhere
_CLOSEST = 1e-6  # world units: half the width of the closest look
_NO_MARGINS = (0.0, 0.0, 0.0, 0.0)
_STEADY, _STEP = 1.3, 0.5  # a camera that sees so many times as much, or moves by such a share of its view, leaps


class WindowCamera:
    """The camera of a window; setting one of its values changes the next frame.

    World coordinates are y up; screen coordinates are pixels, y down; viewport coordinates go from 0.0 to 1.0.

    Args:
        camera_x: the world point in the middle of the screen.
        camera_y: likewise.
        camera_size: half the visible width, in world units.
        screen_width: pixels.
        screen_height: pixels.
    """

    def __init__(
        self,
        camera_x: float = 0.0,
        camera_y: float = 0.0,
        camera_size: float = _HALF_WIDTH,
        screen_width: int = 1280,
        screen_height: int = 720,
    ) -> None:
        self._x, self._y, self._size = camera_x, camera_y, camera_size
        self._width, self._height = screen_width, screen_height
        self.is_pointed = False  # whether a person or a program has said where to look

    # -- what can be set -------------------------------------------------------------------------------------

    @property
    def camera_x(self) -> float:
        """The world point in the middle of the screen."""
        return self._x

    @camera_x.setter
    def camera_x(self, x: float) -> None:
        self._x, self.is_pointed = as_float(x, "camera_x"), True

    @property
    def camera_y(self) -> float:
        """The world point in the middle of the screen."""
        return self._y

    @camera_y.setter
    def camera_y(self, y: float) -> None:
        self._y, self.is_pointed = as_float(y, "camera_y"), True

    @property
    def camera_size(self) -> float:
        """Half the visible width, in world units."""
        return self._size

    @camera_size.setter
    def camera_size(self, size: float) -> None:
        if (size := as_float(size, "camera_size")) <= 0.0:
            raise BadValue(f"camera_size is half the visible width in world units, above 0, not {size:g}.")
        self._size, self.is_pointed = max(size, _CLOSEST), True

    @property
    def screen_width(self) -> int:
        """Pixels."""
        return self._width

    @screen_width.setter
    def screen_width(self, width: int) -> None:
        self.set_screen_size(width, self._height)

    @property
    def screen_height(self) -> int:
        """Pixels."""
        return self._height

    @screen_height.setter
    def screen_height(self, height: int) -> None:
        self.set_screen_size(self._width, height)

    def set_screen_size(self, width: int, height: int) -> None:
        """Show on a screen of so many pixels; the visible width stays.

        Raises:
            BadValue: one is not positive.
        """
        width, height = as_int(width, "screen_width"), as_int(height, "screen_height")
        if width <= 0 or height <= 0:
            raise BadValue(f"A screen needs a positive width and height, not {width} x {height}.")
        self._width, self._height = width, height

    def look_at_box(
        self, low: FloatArray, high: FloatArray, margins: Margins = _NO_MARGINS, *, is_pointed: bool = False
    ) -> None:
        """Let everything between two corners be seen, in the middle if that leaves margins of so many pixels."""
        (x, y), (across, up) = ((low + high) / 2).tolist(), (high - low).tolist()
        left, top, right, bottom = margins
        room, down = max(self._width - left - right, 1.0), max(self._height - top - bottom, 1.0)
        unit = max(across / room, up / down) or 2.0 * _HALF_WIDTH / self._width  # of the world, per pixel
        slack = (room - across / unit) / 2, (down - up / unit) / 2  # pixels, at either side
        self._x = x + _shift(right - left, slack[0]) * unit
        self._y = y + _shift(top - bottom, slack[1]) * unit
        self._size = unit * self._width / 2
        self.is_pointed = self.is_pointed or is_pointed

    def move_by(self, right_px: float, down_px: float) -> None:
        """Let the picture follow a hand that moves by so many pixels."""
        self.camera_x -= right_px / self.scale
        self.camera_y += down_px / self.scale

    def zoom(self, factor: float, around: Point | None = None, closest: float = _CLOSEST) -> None:
        """See `factor` times as much, down to a half width of `closest`; a point of the screen stays where it is."""
        size = max(self._size * factor, min(closest, self._size))
        if around is not None:
            x, y = self.screen_to_world(*around)
            share = size / self._size
            self._x, self._y = x + (self._x - x) * share, y + (self._y - y) * share
        self.camera_size = size

    # -- what follows ----------------------------------------------------------------------------------------

    @property
    def scale(self) -> float:
        """Pixels per world unit."""
        return self._width / (2.0 * self._size)

    @property
    def aspect_ratio(self) -> float:
        """Width by height."""
        return self._width / self._height

    @property
    def camera_size_y(self) -> float:
        """Half the visible height, in world units."""
        return self._size / self.aspect_ratio

    @property
    def bound_left(self) -> float:
        """The least visible x."""
        return self._x - self._size

    @property
    def bound_right(self) -> float:
        """The greatest visible x."""
        return self._x + self._size

    @property
    def bound_top(self) -> float:
        """The least visible y, as in 1.0.0."""
        return self._y - self.camera_size_y

    @property
    def bound_bottom(self) -> float:
        """The greatest visible y, as in 1.0.0."""
        return self._y + self.camera_size_y

    def camera(self) -> Camera:
        """What frames are painted through: shifted to whole pixels, so that what was painted once can be shifted."""
        scale = self.scale
        left, top = round(self.bound_left * scale), round(self.bound_bottom * scale)
        return Camera(self._width, self._height, left / scale, top / scale, scale)

    # -- conversions -----------------------------------------------------------------------------------------

    def world_to_screen(self, x: float, y: float) -> Point:
        """A world point in pixels."""
        return (x - self.bound_left) * self.scale, (self.bound_bottom - y) * self.scale

    def screen_to_world(self, x: float, y: float) -> Point:
        """A point in pixels as a world point."""
        return self.bound_left + x / self.scale, self.bound_bottom - y / self.scale


def _shift(margins_px: float, slack_px: float) -> float:
    """How far from the middle, in pixels, what is between margins of such a difference has to be."""
    shift = abs(margins_px) / 2 - slack_px
    return 0.0 if shift <= 0.0 else shift if margins_px > 0.0 else -shift


def is_near(camera: Camera, before: Camera) -> bool:
    """Whether a camera has moved and zoomed so little that it may be on its way."""
    if not 1 / _STEADY <= camera.scale / before.scale <= _STEADY:
        return False
    (x, y), (then_x, then_y) = _middle(camera), _middle(before)
    right, up = abs(x - then_x) * camera.scale, abs(y - then_y) * camera.scale
    return right <= _STEP * camera.width and up <= _STEP * camera.height


def _middle(camera: Camera) -> Point:
    return camera.left + camera.width / 2 / camera.scale, camera.top - camera.height / 2 / camera.scale


_REACH_PX = 14.0


def nearest(points: FloatArray, x: float, y: float, reach_px: float = _REACH_PX) -> int | None:
    """The row of the screen point (points, 2) nearest to (x, y), if one is within reach."""
    if len(points) == 0:
        return None
    distances = np.hypot(*(points - (x, y)).T)
    row = int(np.argmin(distances))
    return row if distances[row] <= reach_px else None
