"""A line on the terminal that says what a slow call is doing; silent everywhere else."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Show = Callable[[str], None]  # shows a text
_CLEAR = "\r\x1b[K"


@contextmanager
def progress(patience_s: float = 1.0) -> Iterator[Show]:
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
