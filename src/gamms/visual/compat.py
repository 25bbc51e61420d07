"""Names of 1.0.0's window that programs reach into, mapped to the parts of ours; see docs/compatibility.md."""

from collections.abc import Sequence
from operator import attrgetter
from typing import Any

import numpy as np

from gamms.arguments import as_float
from gamms.ir.geometry import are_within
from gamms.ir.graph import FloatArray
from gamms.typing import ArtistType, IArtist, IContext
from gamms.visual.artists import Artists
from gamms.visual.backends.pygame_backend import load
from gamms.visual.camera import Point, WindowCamera, clip_lines
from gamms.visual.drawing import Drawing
from gamms.visual.window.display import FrameTiming, get_window_surface
from gamms.visual.window.input import Question

_HALF_WIDTH = 15.0  # world units, of a camera that was not pointed anywhere


class RenderManager(WindowCamera):
    """The camera of a window, with 1.0.0's conversions and culling; setting one of its values changes the next frame.

    Args:
        ctx: the context.
        camera_x: x of the world point in the middle of the screen.
        camera_y: its y.
        camera_size: half the visible width, in world units.
        screen_width: pixels.
        screen_height: pixels.
    """

    def __init__(
        self,
        ctx: IContext,
        camera_x: float = 0.0,
        camera_y: float = 0.0,
        camera_size: float = _HALF_WIDTH,
        screen_width: int = 1280,
        screen_height: int = 720,
    ) -> None:
        super().__init__(camera_x, camera_y, camera_size, screen_width, screen_height)
        self.ctx = ctx

    def set_origin(self, x: float, y: float, graph_width: float = 0.0, graph_height: float = 0.0) -> None:  # noqa: ARG002 - 1.0.0 takes and ignores them
        """Look at a world point, cut to whole units."""
        self.camera_x = int(x)
        self.camera_y = int(y)

    def world_to_screen_scale(self, world_size: float) -> float:
        """Return a length in world units as pixels."""
        return world_size * self.scale

    def screen_to_world_scale(self, screen_size: float) -> float:
        """Return a length in pixels as world units."""
        return screen_size / self.scale

    def viewport_to_screen(self, x: float, y: float) -> Point:
        """Return a share of the screen in pixels."""
        return x * self._width, y * self._height

    def screen_to_viewport(self, x: float, y: float) -> Point:
        """Return a point in pixels as shares of the screen."""
        return x / self._width, y / self._height

    def viewport_to_screen_scale(self, viewport_size: float) -> float:
        """Return a share of the width in pixels."""
        return viewport_size * self._width

    def screen_to_viewport_scale(self, screen_size: float) -> float:
        """Return a length in pixels as a share of the width."""
        return screen_size / self._width

    # -- culling: whether nothing of it is seen --------------------------------------------------------------

    def check_circle_culled(self, x: float, y: float, radius: float) -> bool:
        """Return whether a disc is wholly outside."""
        beyond = (
            max(self.bound_left - x, x - self.bound_right, 0.0),
            max(self.bound_top - y, y - self.bound_bottom, 0.0),
        )
        return float(np.hypot(*beyond)) > radius

    def check_line_culled(self, x1: float, y1: float, x2: float, y2: float) -> bool:
        """Return whether a line is wholly outside."""
        return self.check_lines_culled([(x1, y1), (x2, y2)])

    def check_lines_culled(self, points: Sequence[Point]) -> bool:
        """Return whether a polyline is wholly outside the window."""
        corners = np.asarray(points, np.float64).reshape(-1, 2)
        return not self._is_crossed(corners[:-1], corners[1:])

    def check_polygon_culled(self, points: Sequence[Point]) -> bool:
        """Return whether a filled polygon is wholly outside; one around everything that is seen is not."""
        corners = np.asarray(points, np.float64).reshape(-1, 2)
        is_crossed = self._is_crossed(corners, np.roll(corners, -1, axis=0))
        return not (is_crossed or are_within(np.array([(self._x, self._y)]), corners).any())

    def check_rectangle_culled(self, x: float, y: float, width: float, height: float) -> bool:
        """Return whether a rectangle of `render_rectangle`, from its top-left corner in pixels, is wholly outside."""
        left, top = self.world_to_screen(x, y)
        return left > self._width or top > self._height or left + width < 0.0 or top + height < 0.0

    def _is_crossed(self, starts: FloatArray, ends: FloatArray) -> bool:
        box = (self.bound_left, self.bound_top), (self.bound_right, self.bound_bottom)
        return len(clip_lines(starts, ends, *box)[0]) > 0


class WindowNames:
    """Names of a windowed engine that begin with `_`."""

    ctx: IContext
    camera: RenderManager
    pace: FrameTiming
    artists: Artists
    drawing: Drawing
    question: Question | None
    screen: Any
    drawer_surface: Any
    turn_seconds: Any

    _pygame = property(lambda _: load())
    _render_manager = property(attrgetter("camera"))
    _screen = property(attrgetter("screen"))
    _clock = property(attrgetter("pace.clock"))
    _waiting_simulation = property(attrgetter("pace.is_showing"))

    @property
    def _sim_time_constant(self) -> float:
        seconds: float = self.turn_seconds
        return seconds

    @_sim_time_constant.setter
    def _sim_time_constant(self, seconds: float) -> None:
        self.turn_seconds = as_float(seconds, "_sim_time_constant")

    @property
    def _simulation_time(self) -> float:
        return self.pace.shown_seconds

    @_simulation_time.setter
    def _simulation_time(self, seconds: float) -> None:
        self.pace.shown_seconds = seconds

    @property
    def _waiting_user_input(self) -> bool:
        return self.question is not None

    @property
    def _waiting_agent_name(self) -> str | None:
        return None if self.question is None else self.question.name

    @property
    def _dynamic_artists(self) -> dict[str, IArtist]:
        """Artists that change from frame to frame, by name."""
        artists = self.artists.declared.items()
        return {name: artist for name, artist in artists if artist.get_artist_type() is ArtistType.DYNAMIC}

    @property
    def _input_overlay_artist(self) -> IArtist:
        return self.artists.declared["input_overlay"]

    def _get_target_surface(self) -> Any:
        """Return a surface for drawers that paint with pygame: above the drawings of their layer; else the screen."""
        if self.drawing.commands is None:
            return get_window_surface() or self.screen
        if self.drawer_surface is None:
            self.drawer_surface = load().Surface(self.screen.get_size(), load().SRCALPHA, 32)
        return self.drawer_surface

    def _toggle_waiting_simulation(self, is_waiting: bool) -> None:
        """Begin to show a turn, or end it; `update` shows its frames."""
        if is_waiting:
            self.drawing.turns.end_turn()
            self.drawing.motion.begin_turn()
            self.pace.begin_turn()
        else:
            self.pace.end_turn()
