"""Save the turns that are over although no later turn comes: in the background, and at exit."""

import atexit
import os
from collections.abc import Callable
from contextlib import suppress
from threading import Event, Lock, Thread
from time import sleep

INTERVAL_S = 0.25


class Saving:
    """Saves a recording four times a second.

    Args:
        save: writes what waits; its argument says whether this is the last time.

    Attributes:
        lock: of the thread that writes.
    """

    def __init__(self, save: Callable[[bool], None]) -> None:
        self._save, self.lock, self._is_over = save, Lock(), False
        self._background: _Background | None = None
        self._trouble: Exception | None = None
        self._process = os.getpid()

    @property
    def is_inherited(self) -> bool:
        """Whether this is a process that was forked from the one that records, and shares its file."""
        return os.getpid() != self._process

    def begin(self) -> bool:
        """Save in the background until `end`, and when the program ends; False where there are no threads."""
        if self._background is None:
            self._background = _background()
            self._background.add(self)
        return self._background.has_thread

    def end(self) -> None:
        """Save no more."""
        self._is_over = True
        if self._background is not None:
            self._background.saved.discard(self)

    def check(self) -> None:
        """Raise what went wrong in the background."""
        if self._trouble is not None:
            raise self._trouble

    def save_now(self, *, is_last: bool = True) -> None:
        """Write what waits, in any thread."""
        with self.lock:
            if self._trouble is None and not self._is_over:
                try:
                    self._save(is_last)
                except Exception as error:  # noqa: BLE001 - for the thread that plays
                    self._trouble = error


class _Background:
    """Saves recordings in one thread of this process, as long as there are some."""

    def __init__(self) -> None:
        self.saved: set[Saving] = set()
        self.process = os.getpid()
        self._has_some = Event()
        atexit.register(self._save_all, is_last=True)
        self.has_thread = False
        # NOTE: one for all of them: to start a thread takes milliseconds where other programs use the processors.
        with suppress(RuntimeError):
            Thread(target=self._keep_saving, name="gamms recordings", daemon=True).start()
            self.has_thread = True

    def add(self, one: Saving) -> None:
        """Save a recording as well."""
        self.saved.add(one)
        self._has_some.set()

    def _keep_saving(self) -> None:
        while self._has_some.wait():
            sleep(INTERVAL_S)
            self._save_all(is_last=False)
            if not self.saved:
                self._has_some.clear()
                if self.saved:  # which came in between
                    self._has_some.set()

    def _save_all(self, *, is_last: bool) -> None:
        if os.getpid() == self.process:
            for one in tuple(self.saved):
                one.save_now(is_last=is_last)


_backgrounds: list[_Background] = []


def _background() -> _Background:
    """That of this process, which may have been forked from one that has another."""
    if not _backgrounds or _backgrounds[-1].process != os.getpid():
        _backgrounds.append(_Background())
    return _backgrounds[-1]
