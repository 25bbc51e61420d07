"""The display: the one window that the library offers, without sound, and without a hand on signals.

Contexts that run at the same time share it; it closes with the last of them.
"""

import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from gamms.errors import NoDisplay
from gamms.visual.backends.pygame import load

_NO_HANDLERS = "SDL_NO_SIGNAL_HANDLERS"  # or else SIGTERM would become one more event, and the process live on
_RESIZED = "Requested window was forcibly resized"  # as a window manager that tiles does; the caller asks for its size
_FALLBACK, _DRIVER_CHOSEN = "offscreen", ("SDL_VIDEODRIVER", "SDL_VIDEO_DRIVER")
_owners: list[object] = []


def open_window(owner: object, width: int, height: int, title: str) -> Any:
    """The surface of a window that can be resized.

    Raises:
        MissingExtra: the library is not installed.
        NoDisplay: no window can be opened here.
    """
    pygame = load()
    with _left_alone(_NO_HANDLERS), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=_RESIZED, category=RuntimeWarning)
        try:
            pygame.display.init()
            _check_is_seen(pygame)
            surface = pygame.display.set_mode((width, height), pygame.RESIZABLE)
        except pygame.error as error:
            if not _owners:
                pygame.display.quit()
            raise NoDisplay(str(error)) from None
    pygame.display.set_caption(title)
    pygame.key.set_repeat()
    _owners.append(owner)
    return surface


def _check_is_seen(pygame: Any) -> None:
    """Raise pygame.error for the driver that SDL falls back to without a display, unless the user has named one."""
    if pygame.display.get_driver() == _FALLBACK and not any(map(os.environ.get, _DRIVER_CHOSEN)):
        raise pygame.error("no display is connected")


def close_window(owner: object) -> None:
    """Close the window, unless another context still shows something in it."""
    if owner in _owners:
        _owners.remove(owner)
        if not _owners:
            load().display.quit()


def window_surface() -> Any:
    """The surface of the window as large as it is now; None while there is no window."""
    display = load().display
    return display.get_surface() if display.get_init() else None


@contextmanager
def _left_alone(name: str) -> Iterator[None]:
    """Set an environment variable for a moment, unless the user has set it."""
    is_ours = name not in os.environ
    os.environ.setdefault(name, "1")
    try:
        yield
    finally:
        if is_ours:
            del os.environ[name]
