"""Save finished turns in the background, and at exit, even if no later turn comes."""

import atexit
import os
from collections.abc import Callable
from contextlib import suppress
from threading import Event, Lock, Thread
from time import sleep

INTERVAL_S = 0.25


class BackgroundSaving:
    """Saves a recording four times a second.

    Args:
        save: writes pending turns; its argument tells whether this is the last call.

    Attributes:
        lock: held by the thread that writes.
    """

    def __init__(self, save: Callable[[bool], None]) -> None:
        self._save = save
        self.lock = Lock()
        self._is_over = False
        self._background: _SavingThread | None = None
        self._trouble: Exception | None = None
        self._process = os.getpid()

    @property
    def is_inherited(self) -> bool:
        """Whether this process was forked from the recording process, and shares its file."""
        return os.getpid() != self._process

    def begin(self) -> bool:
        """Start saving in the background until `end`, and at exit; return False if threads are not available."""
        if self._background is None:
            self._background = _get_saver()
            self._background.add(self)
        return self._background.has_thread

    def end(self) -> None:
        """Stop saving."""
        self._is_over = True
        if self._background is not None:
            self._background.saved.discard(self)

    def check(self) -> None:
        """Raise an error that occurred in the background."""
        if self._trouble is not None:
            raise self._trouble

    def save_now(self, *, is_last: bool = True) -> None:
        """Write pending turns, in any thread."""
        with self.lock:
            if self._trouble is None and not self._is_over:
                try:
                    self._save(is_last)
                except Exception as error:  # noqa: BLE001 - for the thread that plays
                    self._trouble = error


class _SavingThread:
    """Saves all recordings of this process in one thread."""

    def __init__(self) -> None:
        self.saved: set[BackgroundSaving] = set()
        self.process = os.getpid()
        self._has_some = Event()
        atexit.register(self._save_all, is_last=True)
        self.has_thread = False
        # NOTE: one thread for all: starting a thread takes milliseconds if other programs use the processors.
        with suppress(RuntimeError):
            Thread(target=self._keep_saving, name="gamms recordings", daemon=True).start()
            self.has_thread = True

    def add(self, one: BackgroundSaving) -> None:
        """Add a recording to save."""
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


_backgrounds: list[_SavingThread] = []


def _get_saver() -> _SavingThread:
    """Return the background saver of this process, which may have been forked."""
    if not _backgrounds or _backgrounds[-1].process != os.getpid():
        _backgrounds.append(_SavingThread())
    return _backgrounds[-1]
