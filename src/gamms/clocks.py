"""Clocks that games, robots and links wait by: that of the machine, and one that advances only in `sleep`."""

import time
from math import inf
from numbers import Real
from typing import Protocol

from gamms.errors import BadType, BadValue
from gamms.text import shown

_LATEST_START_S = 1e10  # the year 2286 in Unix time; times in milliseconds and nanoseconds are later


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
    is_clock = callable(getattr(value, "now", None)) and callable(getattr(value, "sleep", None))
    if not is_clock or isinstance(value, type):
        raise BadType(f"A clock has now() and sleep(seconds), as gamms.bridge.SimulatedClock(), unlike {shown(value)}.")
    return value  # type: ignore[return-value] # as was checked


def _as_start(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, Real):
        raise BadType(f"start must be a number, not {shown(value)} ({type(value).__name__}).")
    try:
        start = float(value)
    except OverflowError:
        start = inf
    if not abs(start) <= _LATEST_START_S:  # or not a number
        raise BadValue(f"start is in seconds, from -1e10 to 1e10, not {shown(value)}: later, floats lack microseconds.")
    return start


WALL_CLOCK = WallClock()


class SimulatedClock:
    """A clock that advances only in `sleep`, so that games with simulated robots are instant and repeatable.

    Args:
        start: seconds, from -1e10 to 1e10.

    Raises:
        BadType: `start` is not a number.
        BadValue: it is out of range, where floats lack microseconds.
    """

    def __init__(self, start: float = 0.0) -> None:
        self._now = _as_start(start)

    def now(self) -> float:
        """Return the start time plus all seconds slept."""
        return self._now

    def sleep(self, seconds: float) -> None:
        """Advance the clock."""
        self._now += seconds
