"""Cameras of pictures and of the window, and clipping of drawings to their view."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from gamms import kernels
from gamms.arguments import as_float, as_int
from gamms.deciding import Guarded, get_phase, lift_decide_phase, refuse_while_deciding
from gamms.errors import BadValue, GammsError
from gamms.ir.draw import DrawCommands, DrawKind, DrawSpace
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.typing import IContext
from gamms.visual.constants import Layer

_SHORTEST = 1e-12  # smaller extents along an axis count as 0


def find_touching(
    low: FloatArray, high: FloatArray, box: tuple[float, float, float, float]
) -> "np.ndarray[tuple[int, ...], np.dtype[np.bool_]]":
    """Return which boxes, from `low` to `high` (boxes, 2), touch the box (left, low, right, high)."""
    left, bottom, right, top = box
    return (high[:, 0] >= left) & (low[:, 0] <= right) & (high[:, 1] >= bottom) & (low[:, 1] <= top)


def find_extent(starts: FloatArray, ends: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the lower left and the upper right corner of lines (lines, 2); there must be at least one."""
    # NOTE: a tenth of the time of min(axis=0), which iterates over pairs (first frame of 100,000 edges).
    low: FloatArray = np.minimum(starts.T, ends.T, order="C").min(axis=1)
    high: FloatArray = np.maximum(starts.T, ends.T, order="C").max(axis=1)
    return low, high


def clip_lines(
    starts: FloatArray, ends: FloatArray, low: tuple[float, float], high: tuple[float, float]
) -> tuple[FloatArray, FloatArray]:
    """Return the parts of lines (lines, 2) inside a box, in order, without lines that miss it."""
    ways = ends - starts
    enter = np.zeros(len(starts))
    leave = np.ones(len(starts))
    is_inside = np.ones(len(starts), bool)
    for axis in (0, 1):
        way = ways[:, axis]
        start = starts[:, axis]
        is_parallel = np.abs(way) < _SHORTEST
        step = np.where(is_parallel, 1.0, way)
        at_low = (low[axis] - start) / step
        at_high = (high[axis] - start) / step
        enter = np.maximum(enter, np.where(is_parallel, 0.0, np.minimum(at_low, at_high)))
        leave = np.minimum(leave, np.where(is_parallel, 1.0, np.maximum(at_low, at_high)))
        is_inside &= ~is_parallel | ((start >= low[axis]) & (start <= high[axis]))
    is_inside &= enter <= leave
    begin = starts[is_inside]
    way = ways[is_inside]
    return begin + enter[is_inside, None] * way, begin + leave[is_inside, None] * way


Point = tuple[float, float]
Box = tuple[FloatArray, FloatArray]  # the lower left and the upper right corner, world units
Margins = tuple[float, float, float, float]  # left, top, right, bottom; pixels
FAINTEST_PX = 0.4  # minimum width of lines in world units: thinner lines would vanish
CSS_DPI = 96.0  # resolution at which pixels have their usual size
_VIEWS = (Layer.SEEN, Layer.WINDOW_SENSORS, Layer.SENSORS)
BEYOND = 1.0  # of the map's longer side: how far views of sensors may widen a picture, which would shrink the map
_SMALLEST = 1e-9  # world units; smaller extents count as points
_AT_SIDE = 0.05  # share of the longer side of a box within which drawings count as at the border


class Camera(NamedTuple):
    """A picture's size in pixels, the world point in its upper left corner, and pixels per world unit."""

    width: int
    height: int
    left: float
    top: float
    scale: float

    def to_screen(self, points: FloatArray) -> FloatArray:
        """Return world points (points, 2) in pixels."""
        return (points - (self.left, self.top)) * (self.scale, -self.scale)


class FixedView(NamedTuple):
    """The view of pictures of any size: a center and a width, in world units."""

    x: float
    y: float
    world_width: float

    def make_camera(self, width: int, height: int) -> Camera:
        """Return the camera of a picture with this size in pixels."""
        scale = width / self.world_width
        return Camera(width, height, self.x - self.world_width / 2, self.y + height / 2 / scale, scale)


class Viewpoint(Guarded):
    """The view of pictures, frames and films.

    Args:
        ctx: the context.
        position_of: function from an agent's name and a share of its last move to its position.

    Attributes:
        look: a fixed view; None: everything that is drawn.
        followed: the name of the agent in the center, if any.
    """

    _called = "ctx.visual"

    def __init__(self, ctx: IContext, position_of: Callable[[str, float], tuple[float, float]]) -> None:
        self._phase = get_phase(ctx)
        self._position_of = position_of
        self.look: FixedView | None = None
        self.followed: str | None = None

    @refuse_while_deciding
    def look_at(self, x: float, y: float, width: float) -> None:
        """Show `width` world units around (x, y), instead of everything.

        Raises:
            BadType, BadValue: not finite numbers, or a width that is not positive.
        """
        x = as_float(x, "x")
        y = as_float(y, "y")
        width = as_float(width, "width")
        if width <= 0.0:
            raise BadValue(f"A view needs a positive width in world units, not {width:g}.")
        self.look = FixedView(x, y, width)
        self.followed = None

    @refuse_while_deciding
    def look_at_all(self) -> None:
        """Show everything that is drawn."""
        self.look = None
        self.followed = None

    @refuse_while_deciding
    def follow(self, agent_name: str) -> None:
        """Keep an agent in the center of the present view; after it is deleted, stay at its last position."""
        self.followed = agent_name

    @lift_decide_phase
    def make_camera(self, width: int, height: int, share: float = 1.0) -> Camera | None:
        """Return the camera of a picture after a share of the agents' last moves; None shows everything."""
        if self.look is None:
            return None
        if self.followed is not None:
            try:
                x, y = self._position_of(self.followed, share)
            except GammsError:  # it is gone
                self.followed = None
            else:
                self.look = FixedView(x, y, self.look.world_width)
        camera = self.look.make_camera(width, height)
        if self.followed is None:
            return camera
        # Moved by whole pixels, so that streets do not flicker.
        left = round(camera.left * camera.scale) / camera.scale
        top = round(camera.top * camera.scale) / camera.scale
        return camera._replace(left=left, top=top)


def fit_box(low: FloatArray, high: FloatArray, width: int, height: int, margins: Margins) -> Camera:
    """Return the camera that shows a box as large as possible between margins in pixels."""
    left, top, right, bottom = margins
    free = max(width - left - right, 1.0), max(height - top - bottom, 1.0)
    scale = min(
        (room / extent for room, extent in zip(free, high - low, strict=True) if extent > _SMALLEST),
        default=1.0,
    )
    x, y = ((low + high) / 2).tolist()
    return Camera(width, height, x - (width + left - right) / 2 / scale, y + (height + top - bottom) / 2 / scale, scale)


def frame_drawings(*drawings: DrawCommands) -> Box:
    """Return the corners of what a picture shows: all drawings, but only the near part of large views of sensors."""
    are_views = [np.isin(commands.layer, _VIEWS) for commands in drawings]
    low, high = _enclose_boxes([compute_bounds(commands) for commands in drawings if len(commands)])
    others = [
        compute_bounds(one, ~is_view) for one, is_view in zip(drawings, are_views, strict=True) if not is_view.all()
    ]
    near_low, near_high = _enclose_boxes(others)
    beyond = BEYOND * float((near_high - near_low).max())
    if beyond > 0.0:
        low = np.maximum(low, near_low - beyond)
        high = np.minimum(high, near_high + beyond)
    return low, high


def _enclose_boxes(boxes: list[Box]) -> Box:
    """Return the box around some boxes."""
    if not boxes:
        return np.zeros(2), np.zeros(2)
    return np.min([low for low, _ in boxes], axis=0), np.max([high for _, high in boxes], axis=0)


def compute_bounds(commands: DrawCommands, chosen: BoolArray | None = None) -> Box:
    """Return the lower left and upper right corner of all drawings, world units, without sizes in pixels.

    Args:
        commands: the drawings.
        chosen: (commands,) those that count; None: all.
    """
    if len(commands) == 0:
        return np.zeros(2), np.zeros(2)
    breadth = np.where(commands.kind == DrawKind.LINE, commands.width, 0.0)
    reach = np.where(commands.space == DrawSpace.WORLD, commands.size + breadth / 2.0, 0.0)
    around = np.repeat(reach, np.diff(commands.offsets))
    axes = _list_corners(commands).T
    # NOTE: one axis after the other, in a third of the time (first frame of 100,000 edges).
    if chosen is not None:
        counts = np.repeat(chosen, np.diff(commands.offsets))
        axes = axes[:, counts]
        around = around[counts]
    return np.array([(axis - around).min() for axis in axes]), np.array([(axis + around).max() for axis in axes])


def _list_corners(commands: DrawCommands) -> FloatArray:
    """Return the points of all commands, with the far corner of each rectangle instead of its extent."""
    points = commands.points.copy()
    rows = np.flatnonzero(commands.kind == DrawKind.RECTANGLE)
    anchors = commands.offsets[rows]
    in_world = (commands.space[rows] == DrawSpace.WORLD)[:, None]
    points[anchors + 1] = points[anchors] + points[anchors + 1] * (1.0, -1.0) * in_world
    shifts, places = find_shifted_points(commands)
    points[shifts] = points[places]
    return points


def spill(commands: DrawCommands, box: Box) -> Margins:
    """Return how many pixels signs near the border of a box extend beyond it."""
    shifts, places = find_shifted_points(commands)
    low, high = box
    far = _AT_SIDE * float((high - low).max())
    reach = [0.0, 0.0, 0.0, 0.0]
    for side, (axis, sign) in enumerate(((0, -1.0), (1, -1.0), (0, 1.0), (1, 1.0))):  # y is down in pixels
        is_low = side in {0, 3}
        apart = commands.points[places, axis] - low[axis] if is_low else high[axis] - commands.points[places, axis]
        beyond = sign * commands.points[shifts[apart <= far], axis]
        reach[side] = float(beyond.max(initial=0.0))
    left, top, right, bottom = reach
    return left, top, right, bottom


def find_shifted_points(commands: DrawCommands) -> tuple[IntArray, IntArray]:
    """Return the points that are pixel offsets to the right and down, and the index of the reference point of each.

    The reference is the first point of the command: the center of a moved circle, or the place of a pixel polygon.
    """
    is_moved = (commands.kind == DrawKind.CIRCLE) & (np.diff(commands.offsets) == 2)
    is_symbol = (commands.kind == DrawKind.POLYGON) & (commands.space == DrawSpace.SCREEN)
    rows = np.flatnonzero(is_moved | is_symbol)
    begins = commands.offsets[rows]
    command, shifts = kernels.expand_ranges(begins + 1, commands.offsets[rows + 1])
    return shifts, begins[command]


def project_to_screen(commands: DrawCommands, camera: Camera) -> FloatArray:
    """Return all points in pixels.

    Both points of a moved circle are its center; both first points of a pixel polygon are its first corner.
    """
    points = camera.to_screen(commands.points)
    shifts, places = find_shifted_points(commands)
    points[shifts] = points[places] + commands.points[shifts]
    points[places] = points[places + 1]
    return points


_HALF_WIDTH = 15.0  # world units, of a camera without a set view
_CLOSEST = 1e-6  # world units: half the width of the closest view
NO_MARGINS = (0.0, 0.0, 0.0, 0.0)
# a larger zoom, or a move by a larger share of the view, counts as a jump
_STEADY = 1.3
_STEP = 0.5


class WindowCamera:
    """The camera of a window; changed values take effect in the next frame.

    World coordinates are y up; screen coordinates are pixels, y down; viewport coordinates go from 0.0 to 1.0.

    Args:
        camera_x: x of the world point in the middle of the screen.
        camera_y: its y.
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
        self._x = camera_x
        self._y = camera_y
        self._size = camera_size
        self._width = screen_width
        self._height = screen_height
        self.is_pointed = False  # whether a person or a program has set the view

    # -- settable values -------------------------------------------------------------------------------------

    @property
    def camera_x(self) -> float:
        """The world point in the middle of the screen."""
        return self._x

    @camera_x.setter
    def camera_x(self, x: float) -> None:
        self._x = as_float(x, "camera_x")
        self.is_pointed = True

    @property
    def camera_y(self) -> float:
        """The world point in the middle of the screen."""
        return self._y

    @camera_y.setter
    def camera_y(self, y: float) -> None:
        self._y = as_float(y, "camera_y")
        self.is_pointed = True

    @property
    def camera_size(self) -> float:
        """Half the visible width, in world units."""
        return self._size

    @camera_size.setter
    def camera_size(self, size: float) -> None:
        if (size := as_float(size, "camera_size")) <= 0.0:
            raise BadValue(f"camera_size is half the visible width in world units, above 0, not {size:g}.")
        self._size = max(size, _CLOSEST)
        self.is_pointed = True

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
        """Set the screen size in pixels; the visible width stays.

        Raises:
            BadValue: a size is not positive.
        """
        width = as_int(width, "screen_width")
        height = as_int(height, "screen_height")
        if width <= 0 or height <= 0:
            raise BadValue(f"A screen needs a positive width and height, not {width} x {height}.")
        self._width = width
        self._height = height

    def look_at_box(self, low: FloatArray, high: FloatArray, margins: Margins = NO_MARGINS) -> None:
        """Show the box between two corners, centered if margins of these sizes in pixels allow it."""
        x, y = ((low + high) / 2).tolist()
        across, up = (high - low).tolist()
        left, top, right, bottom = margins
        across_px = max(self._width - left - right, 1.0)
        down_px = max(self._height - top - bottom, 1.0)
        unit = max(across / across_px, up / down_px) or 2.0 * _HALF_WIDTH / self._width  # world units per pixel
        slack = (across_px - across / unit) / 2, (down_px - up / unit) / 2  # pixels, at either side
        self._x = x + _shift(right - left, slack[0]) * unit
        self._y = y + _shift(top - bottom, slack[1]) * unit
        self._size = unit * self._width / 2

    def move_by(self, right_px: float, down_px: float) -> None:
        """Move the picture along with a drag by this many pixels."""
        self.camera_x -= right_px / self.scale
        self.camera_y += down_px / self.scale

    def zoom(self, factor: float, around: Point | None = None, closest: float = _CLOSEST) -> None:
        """Show `factor` times as much, down to a half width of `closest`; a point of the screen stays fixed."""
        size = max(self._size * factor, min(closest, self._size))
        if around is not None:
            x, y = self.screen_to_world(*around)
            share = size / self._size
            self._x = x + (self._x - x) * share
            self._y = y + (self._y - y) * share
        self.camera_size = size

    # -- derived values --------------------------------------------------------------------------------------

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
        """Return the camera for painting, moved by whole pixels, so that painted tiles can be shifted."""
        scale = self.scale
        left = round(self.bound_left * scale)
        top = round(self.bound_bottom * scale)
        return Camera(self._width, self._height, left / scale, top / scale, scale)

    # -- conversions -----------------------------------------------------------------------------------------

    def world_to_screen(self, x: float, y: float) -> Point:
        """Convert a world point to pixels."""
        return (x - self.bound_left) * self.scale, (self.bound_bottom - y) * self.scale

    def screen_to_world(self, x: float, y: float) -> Point:
        """Convert pixels to a world point."""
        return self.bound_left + x / self.scale, self.bound_bottom - y / self.scale


def _shift(margins_px: float, slack_px: float) -> float:
    """Return the offset from the center, in pixels, for contents between margins with this difference."""
    shift = abs(margins_px) / 2 - slack_px
    if shift <= 0.0:
        return 0.0
    return shift if margins_px > 0.0 else -shift


def is_near(camera: Camera, before: Camera) -> bool:
    """Return whether a camera has moved and zoomed so little that it may be on its way."""
    if not 1 / _STEADY <= camera.scale / before.scale <= _STEADY:
        return False
    x, y = _find_middle(camera)
    then_x, then_y = _find_middle(before)
    right = abs(x - then_x) * camera.scale
    up = abs(y - then_y) * camera.scale
    return right <= _STEP * camera.width and up <= _STEP * camera.height


def _find_middle(camera: Camera) -> Point:
    return camera.left + camera.width / 2 / camera.scale, camera.top - camera.height / 2 / camera.scale


_REACH_PX = 14.0


def find_nearest_point(points: FloatArray, x: float, y: float, reach_px: float = _REACH_PX) -> int | None:
    """Return the row of the screen point (points, 2) nearest to (x, y), if one is within reach."""
    if len(points) == 0:
        return None
    distances = np.hypot(*(points - (x, y)).T)
    row = int(np.argmin(distances))
    return row if distances[row] <= reach_px else None
