"""The display of a window, and the pace of its frames."""

import atexit
import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from math import inf
from tempfile import gettempdir
from time import monotonic, sleep
from types import ModuleType
from typing import Any, Protocol

from gamms.arguments import as_float
from gamms.errors import BadValue, NoDisplay
from gamms.visual.appearance import PAPER, TEAM_COLORS
from gamms.visual.backends.pygame_backend import load

_NO_HANDLERS = "SDL_NO_SIGNAL_HANDLERS"  # or else SIGTERM would become one more event, and the process live on
_RUNTIME = "XDG_RUNTIME_DIR"  # or else Wayland's library complains of it where there is no display at all
_RESIZED = "Requested window was forcibly resized"  # as a window manager that tiles does; the caller asks for its size
_FALLBACK = "offscreen"
_DRIVER_CHOSEN = ("SDL_VIDEODRIVER", "SDL_VIDEO_DRIVER")
_UNSEEN = ("dummy", "offscreen")
_WITH_SCREEN = ("win32", "darwin")  # platforms without a variable that names a display
_DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY")


class WindowOwner(Protocol):
    """The engine that a window belongs to."""

    def stay_open_at_exit(self) -> None:
        """Keep the window open after the end of the program, if it shows something."""


_owners: list[WindowOwner] = []


def open_window(owner: WindowOwner, width: int, height: int, title: str) -> Any:
    """Open a window that can be resized, and return its surface.

    Raises:
        MissingExtra: the library is not installed.
        NoDisplay: no window can be opened here.
    """
    pygame = load()
    with (
        _set_default_environment(_NO_HANDLERS, "1"),
        _set_default_environment(_RUNTIME, gettempdir()),
        warnings.catch_warnings(),
    ):
        warnings.filterwarnings("ignore", message=_RESIZED, category=RuntimeWarning)
        try:
            pygame.display.init()
            _check_is_seen(pygame)
            pygame.display.set_icon(_draw_icon(pygame))
            surface = pygame.display.set_mode((width, height), pygame.RESIZABLE)
        except pygame.error as error:
            if not _owners:
                pygame.display.quit()
            raise NoDisplay(str(error)) from None
    pygame.display.set_caption(title)
    pygame.key.set_repeat()
    if not _owners:  # after pygame's own, which closes the display, so that this one is called before
        atexit.unregister(_stay_open_at_exit)
        atexit.register(_stay_open_at_exit)
    _owners.append(owner)
    return surface


_ICON_PX = 64
_ICON_FINER = 4
_ICON_NODES = ((14, 44), (32, 16), (50, 42))  # of a small graph, each in the color of a team


def _draw_icon(pygame: ModuleType) -> Any:
    """Return the picture for title and task bars: three agents on a graph."""
    side = _ICON_PX * _ICON_FINER
    large = pygame.Surface((side, side), pygame.SRCALPHA, 32)
    large.fill((*PAPER, 0))
    pygame.draw.rect(large, PAPER, large.get_rect(), border_radius=12 * _ICON_FINER)
    nodes = [(x * _ICON_FINER, y * _ICON_FINER) for x, y in _ICON_NODES]
    pygame.draw.lines(large, (140, 143, 148), True, nodes, 4 * _ICON_FINER)
    for color, node in zip(TEAM_COLORS, nodes, strict=False):
        pygame.draw.circle(large, color, node, 9 * _ICON_FINER)
    return pygame.transform.smoothscale(large, (_ICON_PX, _ICON_PX))


def _check_is_seen(pygame: ModuleType) -> None:
    """Raise pygame.error for the driver that SDL falls back to without a display, unless the user has named one."""
    if pygame.display.get_driver() == _FALLBACK and not any(map(os.environ.get, _DRIVER_CHOSEN)):
        raise pygame.error("no display is connected")


def may_open() -> bool:
    """Return whether a window can be opened here, as far as the environment tells, without loading pygame."""
    names_display = any(map(os.environ.get, (*_DISPLAYS, *_DRIVER_CHOSEN)))
    return find_spec("pygame") is not None and (sys.platform in _WITH_SCREEN or names_display)


def is_watched() -> bool:
    """Return whether there may be a person before the screen who does nothing else.

    Not where tests run, nor without a display, nor in an interpreter or a notebook, which waits for the next command.
    """
    is_interactive = hasattr(sys, "ps1") or sys.flags.interactive
    return load().display.get_driver() not in _UNSEEN and not os.environ.get("CI") and not is_interactive


def _stay_open_at_exit() -> None:
    """Keep the last window open at exit, unless an exception has ended the program."""
    if _owners and not hasattr(sys, "last_value"):
        _owners[-1].stay_open_at_exit()


def close_window(owner: WindowOwner) -> None:
    """Close the window, unless another context still shows something in it."""
    if owner in _owners:
        _owners.remove(owner)
        if not _owners:
            load().display.quit()


def get_window_surface() -> Any:
    """Return the surface of the window in its present size; None without a window."""
    display = load().display
    return display.get_surface() if display.get_init() else None


@contextmanager
def _set_default_environment(name: str, value: str) -> Iterator[None]:
    """Set an environment variable for a moment, unless the user has set it."""
    is_ours = name not in os.environ
    os.environ.setdefault(name, value)
    try:
        yield
    finally:
        if is_ours:
            del os.environ[name]


_SPEEDS = (0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0)


class FrameTiming:
    """The frame rate of a window, and the speed of turns.

    Args:
        max_fps: the maximum frames per second while a turn is shown or a person is asked.

    Attributes:
        clock: the clock of the library.
        is_capped: whether the frame rate is limited.
        is_paused: whether the game is paused.
        is_held: whether they do as long as a person chooses one.
        is_showing: whether a turn is being shown.
        shown_seconds: how much of it was shown.
    """

    def __init__(self, max_fps: float) -> None:
        if not (max_fps := as_float(max_fps, "max_fps")) > 0.0:
            raise BadValue(f"A window needs a positive number of frames per second, not max_fps={max_fps:g}.")
        self.max_fps = max_fps
        self.clock: Any = load().time.Clock()
        self.is_capped = False
        self.is_paused = False
        self.is_held = False
        self.is_stepping = False
        self.is_showing = False
        self.shown_seconds = 0.0
        self._due = monotonic()
        self._is_whole = False  # all of the turn is shown
        self._ends_step = True  # a step ends with the turn that is shown
        self._speed = _SPEEDS.index(1.0)

    @property
    def speed(self) -> float:
        """The factor of the playback speed of turns."""
        return _SPEEDS[self._speed]

    @property
    def is_halted(self) -> bool:
        """Return whether the playback is paused."""
        return self.is_held or (self.is_paused and not self.is_stepping)

    def change_speed(self, steps: int) -> None:
        """Show turns faster, or slower where `steps` is negative."""
        self._speed = min(max(self._speed + steps, 0), len(_SPEEDS) - 1)

    def pause(self) -> None:
        """Pause, or continue."""
        self.is_paused = not self.is_paused
        self.is_stepping = False

    def step(self) -> None:
        """Show the rest of the turn, or the next turn if available, then pause."""
        self.is_paused = True
        self.is_stepping = True
        self._ends_step = self.is_showing and not self._is_whole

    def begin_turn(self) -> None:
        """Begin to show a turn."""
        self.is_showing = True
        self.shown_seconds = 0.0
        self._is_whole = False
        self._ends_step = True
        self.clock.tick()

    def show_end(self) -> None:
        """Show the end of a turn while the game is paused."""
        self.is_showing = True
        self.shown_seconds = inf
        self._is_whole = True
        self.is_stepping = False

    def end_turn(self) -> None:
        """End the turn that is shown."""
        self.is_showing = False
        self.shown_seconds = 0.0
        self.clock.tick()

    def share(self, turn_seconds: float) -> float:
        """Return the displayed share of a turn with a given duration, from 0.0 to 1.0."""
        if not self.is_showing or turn_seconds <= 0.0:
            return 1.0
        return min(self.shown_seconds / turn_seconds, 1.0)

    def tick(self, turn_seconds: float) -> float:
        """End a frame, and the turn if all of it is shown: seconds since the frame before."""
        self._is_whole = self.is_showing and self.shown_seconds >= turn_seconds
        if self._is_whole and self._ends_step:
            self.is_stepping = False
        is_over = self._is_whole and not self.is_halted
        self._wait()
        seconds = float(self.clock.tick()) / 1000.0
        if self.is_showing and not self.is_halted:
            self.shown_seconds += seconds * self.speed
        if is_over:
            self.end_turn()
        return seconds

    def _wait(self) -> None:
        """Wait for the time of the next frame; SDL's clock counts whole milliseconds, which gives 62 frames for 60."""
        now = monotonic()
        if self.is_capped and self._due > now:
            sleep(self._due - now)
        self._due = max(self._due, now) + 1.0 / self.max_fps
