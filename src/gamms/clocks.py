"""Clocks that games, robots and links wait by: that of the machine, and one that advances only in `sleep`."""

import time
from typing import Protocol

from gamms.errors import BadType
from gamms.text import shown


class Clock(Protocol):
    """Tells the time and waits."""

    def now(self) -> float:
        """Return seconds since an arbitrary moment; never decreasing."""

    def sleep(self, seconds: float) -> None:
        """Wait for a number of seconds."""


class WallClock:
    """The monotonic clock of the machine."""

    def now(self) -> float:
        """Return seconds since an arbitrary moment."""
        return time.monotonic()

    def sleep(self, seconds: float) -> None:
        """Wait for a number of seconds."""
        time.sleep(seconds)


def as_clock(value: object) -> Clock:
    """Return a clock; None: the clock of the machine.

    Raises:
        BadType: the value is not a clock.
    """
    if value is None:
        return WALL_CLOCK
    if not (callable(getattr(value, "now", None)) and callable(getattr(value, "sleep", None))):
        raise BadType(f"A clock has now() and sleep(seconds), as gamms.bridge.SimulatedClock(), unlike {shown(value)}.")
    return value  # type: ignore[return-value] # as was checked


WALL_CLOCK = WallClock()


class SimulatedClock:
    """A clock that advances only in `sleep`, so that games with simulated robots are instant and repeatable.

    Args:
        start: seconds.
    """

    def __init__(self, start: float = 0.0) -> None:
        self._now = start

    def now(self) -> float:
        """Return the start time plus all seconds slept."""
        return self._now

    def sleep(self, seconds: float) -> None:
        """Advance the clock."""
        self._now += seconds
