"""Sources of measured positions: feeds, which other threads may fill."""

import asyncio
import threading
import weakref
from collections import Counter, deque
from collections.abc import AsyncIterable, Callable, Iterable, Mapping
from typing import Any, NamedTuple, Self

from gamms.arguments import is_finer_time
from gamms.bridge.lines import Fix, as_fix
from gamms.clocks import Clock, as_clock
from gamms.errors import BadType, BadValue
from gamms.readonly import NotPickled
from gamms.text import shown

_MOST_WAITING = 256  # fixes; beyond this number the oldest are dropped
_JOIN_S = 1.0

FixLike = Fix | Mapping[str, object]
Message = dict[str, Any]  # plain values, as docs/bridge.md describes them
Send = Callable[[Message], object]
Source = Callable[[], FixLike | Iterable[FixLike] | None] | Iterable[FixLike] | AsyncIterable[FixLike]


class ReceivedFix(NamedTuple):
    """A fix and the time when it arrived."""

    fix: Fix
    at: float  # by the clock of the feed


class Feed(NotPickled):
    """The incoming fixes of one robot; any thread may add some.

    Args:
        source: a function that returns new fixes when it is called: None, one fix or several; or an iterable, which
            may be asynchronous, that a thread reads until it ends or the feed is closed. None: the program calls `put`.
        clock: the clock for the age of fixes; None: that of the machine.
        send: takes messages for the robot; None: the robot gets no messages.

    Attributes:
        counts: "received", "bad" (no position, or a time in milliseconds), "dropped" (fixes came faster than they were
            taken).
    """

    _not_pickled = (
        "A feed can neither be pickled nor copied, because threads write to it. Make another one, with the same source."
    )

    def __init__(self, source: Source | None = None, *, clock: Clock | None = None, send: Send | None = None) -> None:
        self.clock = as_clock(clock)
        self.send = send
        self.counts: Counter[str] = Counter()
        self._waiting: deque[ReceivedFix] = deque(maxlen=_MOST_WAITING)
        self._lock = threading.Lock()
        self._error: Exception | None = None
        self._ask: Callable[[], object] | None = None
        self._reader: _FeedReader | None = None
        if callable(source):
            self._ask = source
        elif isinstance(source, (AsyncIterable, Iterable)) and not isinstance(source, (str, bytes, Mapping)):
            self._reader = _FeedReader(self, source)
        elif source is not None:
            raise BadType(f"A feed is a function, an iterable of fixes or a gamms.bridge.Feed, not {shown(source)}.")

    def put(self, fix: FixLike) -> None:
        """Add a fix that arrives now; a fix without a position is counted and dropped.

        Raises:
            BadType, BadValue: the value is not a fix.
        """
        received = ReceivedFix(as_fix(fix), self.clock.now())
        with self._lock:
            self.counts["received"] += 1
            if received.fix.flaw is not None or is_finer_time(received.fix.t or 0.0):
                self.counts["bad"] += 1
                return
            if len(self._waiting) == self._waiting.maxlen:
                self.counts["dropped"] += 1
            self._waiting.append(received)

    def take(self) -> list[ReceivedFix]:
        """Return and remove the fixes received since the last call.

        Raises:
            Exception: an error of the feed's iterable, raised once.
        """
        if self._ask is not None:
            self._put_all(self._ask())
        with self._lock:
            taken = list(self._waiting)
            self._waiting.clear()
            error = self._error
            self._error = None
        if error is not None:
            raise error
        return taken

    def close(self) -> None:
        """Stop reading the iterable."""
        if self._reader is not None:
            self._reader.stop()

    def fail(self, error: Exception) -> None:
        """Store an error that the next `take` raises."""
        self._error = error

    def _put_all(self, given: Any) -> None:
        if isinstance(given, (Fix, Mapping)):
            self.put(given)
        elif isinstance(given, Iterable) and not isinstance(given, (str, bytes)):
            for fix in given:
                self.put(fix)
        elif given is not None:
            raise BadType(f"A feed returns None, a fix or several fixes, not {shown(given)}.")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class _FeedReader:
    """Reads an iterable in a thread until its feed is closed or no longer used."""

    def __init__(self, feed: Feed, source: AsyncIterable[FixLike] | Iterable[FixLike]) -> None:
        self._feed = weakref.ref(feed)
        self._is_stopped = False
        self._loop: asyncio.AbstractEventLoop | None = None
        self._task: asyncio.Task[None] | None = None
        self._thread = threading.Thread(target=self._run, args=(source,), name="gamms feed", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the thread: immediately if it awaits a fix, else after the next fix."""
        self._is_stopped = True
        loop = self._loop
        task = self._task
        if loop is not None and task is not None and not loop.is_closed():
            loop.call_soon_threadsafe(task.cancel)
        if self._thread is not threading.current_thread():
            self._thread.join(_JOIN_S)

    def _run(self, source: AsyncIterable[FixLike] | Iterable[FixLike]) -> None:
        try:
            if isinstance(source, AsyncIterable):
                asyncio.run(self._await(source))
            else:
                for fix in source:
                    if not self._put(fix):
                        return
        except asyncio.CancelledError:
            return
        except Exception as error:  # noqa: BLE001 - it is raised where the feed is used
            feed = self._feed()
            if feed is not None:
                feed.fail(error)

    async def _await(self, source: AsyncIterable[FixLike]) -> None:
        self._loop = asyncio.get_running_loop()
        self._task = asyncio.current_task()
        if self._is_stopped:
            return
        async for fix in source:
            if not self._put(fix):
                return

    def _put(self, fix: FixLike) -> bool:
        feed = self._feed()
        if feed is None or self._is_stopped:
            return False
        feed.put(fix)
        return True


def as_feed(source: object, clock: Clock | None) -> Feed:
    """Return a feed for any value that `drive` accepts as one.

    Raises:
        BadType, BadValue: the value cannot be a feed, or the feed has another clock.
    """
    if not isinstance(source, Feed):
        own: Any = getattr(source, "clock", None) if clock is None else clock
        given: Any = source
        if given is None:
            raise BadType("A feed is a function, an iterable of fixes or a gamms.bridge.Feed, not None.")
        return Feed(given, clock=own, send=getattr(source, "send", None))
    if clock is not None and source.clock is not clock:
        raise BadValue("This feed has a clock of its own: give the clock to Feed(…, clock=…) alone.")
    return source
