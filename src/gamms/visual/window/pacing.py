"""The pace of a window: frames per second, how fast turns are shown, pause, and one turn at a time."""

from time import monotonic
from typing import Any

from gamms.arguments import as_float
from gamms.errors import BadValue
from gamms.visual.backends.pygame import load

_SPEEDS = (0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0)


class Pace:
    """How time passes in a window.

    Args:
        max_fps: frames per second at most while a turn is shown or a person is asked.

    Attributes:
        clock: of the library.
        is_capped: whether frames wait for their time.
        is_paused: whether turns stand still.
        is_showing: whether a turn is being shown.
        shown_seconds: how much of it was shown.
    """

    def __init__(self, max_fps: float) -> None:
        if not (max_fps := as_float(max_fps, "max_fps")) > 0.0:
            raise BadValue(f"A window needs a positive number of frames per second, not max_fps={max_fps:g}.")
        self.max_fps = max_fps
        self.clock: Any = load().time.Clock()
        self.is_capped = self.is_paused = self.is_stepping = False
        self.is_showing, self.shown_seconds = False, 0.0
        self._speed = _SPEEDS.index(1.0)

    @property
    def speed(self) -> float:
        """How many times as fast as usual turns are shown."""
        return _SPEEDS[self._speed]

    @property
    def stands(self) -> bool:
        """Whether no time passes for the turn that is shown."""
        return self.is_paused and not self.is_stepping

    def faster(self, steps: int) -> None:
        """Show turns faster, or slower where `steps` is negative."""
        self._speed = min(max(self._speed + steps, 0), len(_SPEEDS) - 1)

    def pause(self) -> None:
        """Stand still, or go on."""
        self.is_paused, self.is_stepping = not self.is_paused, False

    def step(self) -> None:
        """Show one turn, then stand still."""
        self.is_paused = self.is_stepping = True

    def begin_turn(self) -> None:
        """Begin to show a turn."""
        self.is_showing, self.shown_seconds = True, 0.0
        self.clock.tick()

    def end_turn(self) -> None:
        """End the turn that is shown."""
        self.is_showing, self.shown_seconds, self.is_stepping = False, 0.0, False
        self.clock.tick()

    def share(self, turn_seconds: float) -> float:
        """How much of a turn of so many seconds is shown, from 0.0 to 1.0."""
        if not self.is_showing or turn_seconds <= 0.0:
            return 1.0
        return min(self.shown_seconds / turn_seconds, 1.0)

    def tick(self, turn_seconds: float) -> float:
        """End a frame, and the turn if all of it is shown: seconds since the frame before."""
        is_over = self.is_showing and self.shown_seconds >= turn_seconds and not self.stands
        seconds = float(self.clock.tick(self.max_fps if self.is_capped else 0)) / 1000.0
        if self.is_showing and not self.stands:
            self.shown_seconds += seconds * self.speed
        if is_over:
            self.end_turn()
        return seconds

    @staticmethod
    def now() -> float:
        """Seconds since some moment."""
        return monotonic()
