"""Progress of slow calls: a status line on the terminal, and interruption by Ctrl-C between two steps."""

import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import current_thread, main_thread

# NOTE: `signal.signal` looks up the names of signals and handlers, which takes 2.5 us of 2.7; a step of a vector
# environment with one game sets the handler twice (benchmarks: learning).
try:
    from _signal import getsignal as _get_handler  # type: ignore[import-not-found] # typeshed leaves it out
    from _signal import signal as _set_handler
except ImportError:  # only CPython has this module
    from signal import getsignal as _get_handler
    from signal import signal as _set_handler

Show = Callable[[str], None]  # shows a text
_CLEAR = "\r\x1b[K"
_INTERRUPT = int(signal.SIGINT)


@contextmanager
def show_progress(patience_s: float = 1.0) -> Iterator[Show]:
    """Yield `show(text)`: it shows the text once `patience_s` have passed, if stderr is a terminal."""
    terminal = sys.stderr
    visible = terminal is not None and terminal.isatty()
    begin = time.monotonic()
    shown = False

    def show(text: str) -> None:
        nonlocal shown
        if visible and time.monotonic() - begin >= patience_s:
            shown = True
            terminal.write(f"{_CLEAR}{text} …")
            terminal.flush()

    try:
        yield show
    finally:
        if shown:
            terminal.write(_CLEAR)
            terminal.flush()


class TurnInterrupted(BaseException):
    """Ctrl-C was pressed during a long turn, which is taken back."""


@contextmanager
def delay_interrupts(
    *, at_most_once: bool = False, on_interrupt: Callable[[], object] = lambda: None
) -> Iterator[None]:
    """Delay Ctrl-C until the end of the block, so that its work is neither skipped nor repeated.

    Args:
        at_most_once: whether a second Ctrl-C raises immediately, because the block may take long.
        on_interrupt: called at once with the first Ctrl-C.
    """
    before = _get_handler(_INTERRUPT) if current_thread() is main_thread() else None
    if before is None:  # Ctrl-C goes to the main thread, and perhaps not to Python
        yield
        return
    came: list[int] = []

    def note(number: int, _: object) -> None:
        came.append(number)
        if len(came) == 1:
            on_interrupt()
        if at_most_once and len(came) > 1:
            came.clear()
            _set_handler(_INTERRUPT, before)
            signal.raise_signal(_INTERRUPT)

    _set_handler(_INTERRUPT, note)
    try:
        yield
    finally:
        _set_handler(_INTERRUPT, before)
        if came:
            signal.raise_signal(_INTERRUPT)
