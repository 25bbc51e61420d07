"""Await decisions of agents concurrently: all start together and have one deadline."""

import asyncio
import math
import selectors
import weakref
from collections.abc import Awaitable, Callable, Collection, Coroutine
from concurrent.futures import Executor, Future, wait
from contextlib import suppress
from contextvars import Context, copy_context
from inspect import CORO_CREATED, getcoroutinestate, iscoroutine
from threading import Thread
from typing import Any, NamedTuple, TypeVar, TypeVarTuple

from gamms.clocks import Clock, WallClock
from gamms.deciding import AWAITED, DecidePhase
from gamms.errors import GammsError

T = TypeVar("T")
Arguments = TypeVarTuple("Arguments")

_GRACE_S = 1.0  # the time for a cancelled coroutine to end
_LATER_S = 1e-6  # the time after which timers of a `_ClockLoop` are called, longer than asyncio's resolution


class Outcome(NamedTuple):
    """The result of one awaitable: a value, an error, or a timeout."""

    value: Any = None
    error: BaseException | None = None
    is_late: bool = False


class EventLoop:
    """The event loop of one game, which runs only while agents decide.

    It stays open between turns, and so do connections that strategies have opened in it. It runs in the thread that
    plays the game; if this thread already runs an event loop, as notebooks do, it runs in a helper thread until the
    turn ends.

    Args:
        clock: the clock of all waits in the loop.
    """

    def __init__(self, clock: Clock) -> None:
        self.clock = clock
        self._loop: asyncio.AbstractEventLoop | None = None
        self.close: Callable[[], object] = lambda: None

    def collect(
        self,
        phase: DecidePhase,
        awaited: Collection[tuple[Any, Awaitable[Any]]],
        deadline_s: float | None,
        *,
        strict: bool,
    ) -> list[Outcome]:
        """Await all awaitables; return their outcomes in the same order.

        Args:
            phase: the phase of the context; nothing can be changed while they run.
            awaited: pairs of a decider (an agent or `Deciders`) and its awaitable.
            deadline_s: seconds; later awaitables are cancelled. None: no limit.
            strict: cancel the others as soon as one raises.
        """
        if self._loop is None or self._loop.is_closed():
            self._loop = _make_loop(self.clock)
            self.close = weakref.finalize(self, _close, self._loop)
        work = _collect_outcomes(phase, awaited, deadline_s, strict=strict)
        phase.agent = AWAITED
        try:
            return (_run_in_thread if _is_in_a_loop() else _run)(self._loop, work)
        finally:
            phase.agent = None
            for coroutine in (work, *(one for _, one in awaited if iscoroutine(one))):
                if getcoroutinestate(coroutine) == CORO_CREATED:  # cancelled before it began
                    coroutine.close()


def _make_loop(clock: Clock) -> asyncio.AbstractEventLoop:
    """Return an event loop whose timers follow a clock."""
    return asyncio.new_event_loop() if type(clock) is WallClock else _ClockLoop(clock)


class _ClockLoop(asyncio.SelectorEventLoop):
    """An event loop that tells the time and waits by a clock.

    When no task can go on and nothing has arrived, the clock sleeps until the next timer, as the `autojump` clock of
    Trio does. It stands while functions that tasks wait for run in threads. It does not wait for sockets and files.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._in_threads = set[asyncio.Future[Any]]()
        super().__init__(_ClockSelector(clock, self._in_threads))

    def time(self) -> float:
        """Return the time by the clock, seconds."""
        return self._clock.now()

    def call_at(
        self, when: float, callback: Callable[[*Arguments], object], *args: *Arguments, context: Context | None = None
    ) -> asyncio.TimerHandle:
        """Call a function when the clock has passed a time.

        asyncio calls functions up to its resolution too early. A task that then waits for the rest of the time would
        wait for ever, because a simulated clock stands as long as tasks go on. So it would if the time were rounded
        to the present one.
        """
        later = max(when + _LATER_S, math.nextafter(self.time(), math.inf))
        return super().call_at(later, callback, *args, context=context)

    def run_in_executor(
        self, executor: Executor | None, func: Callable[[*Arguments], T], *args: *Arguments
    ) -> asyncio.Future[T]:
        """Call a function in a thread."""
        future = super().run_in_executor(executor, func, *args)
        self._in_threads.add(future)
        future.add_done_callback(self._in_threads.discard)
        return future


class _ClockSelector(selectors.DefaultSelector):
    """A selector that waits by a clock, unless threads work for the loop."""

    def __init__(self, clock: Clock, in_threads: set[asyncio.Future[Any]]) -> None:
        super().__init__()
        self._clock = clock
        self._in_threads = in_threads

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        """Return the ready files; if there are none, sleep for `timeout` seconds. None: wait for a file."""
        if timeout is None or (timeout > 0.0 and self._in_threads):
            return super().select(None)
        ready = super().select(0.0)
        if not ready and timeout > 0.0:
            self._clock.sleep(timeout + 2.0 * math.ulp(self._clock.now()))  # past the timer, however the sum is rounded
        return ready


async def _collect_outcomes(
    phase: DecidePhase, awaited: Collection[tuple[Any, Awaitable[Any]]], deadline_s: float | None, *, strict: bool
) -> list[Outcome]:
    tasks = [asyncio.create_task(_await_decision(phase, decider, awaitable)) for decider, awaitable in awaited]
    until = asyncio.FIRST_EXCEPTION if strict else asyncio.ALL_COMPLETED
    try:
        await _wait_for_tasks(tasks, deadline_s, until)
        return [_make_outcome(task) for task in tasks]
    finally:
        late = [task for task in tasks if not task.done()]
        for task in late:
            task.cancel()
        if late:
            await asyncio.wait(late, timeout=_GRACE_S)
        for task in tasks:
            _make_outcome(task)  # or asyncio would log an error that was never retrieved, also of Ctrl-C


async def _wait_for_tasks(tasks: "list[asyncio.Task[Any]]", deadline_s: float | None, until: str) -> None:
    """Wait for tasks like `asyncio.wait`, but wake up regularly to handle Ctrl-C."""
    from gamms.workers import SIGNALS_S

    now = asyncio.get_running_loop().time
    ends = math.inf if deadline_s is None else now() + deadline_s
    waiting = set(tasks)
    are_enough = False
    while waiting and not are_enough and (left := ends - now()) > 0.0:
        ended, waiting = await asyncio.wait(waiting, timeout=min(left, SIGNALS_S), return_when=until)
        are_enough = until == asyncio.FIRST_EXCEPTION and any(not one.cancelled() and one.exception() for one in ended)


async def _await_decision(phase: DecidePhase, decider: object, awaitable: Awaitable[Any]) -> Any:
    phase.decide_in_this_task(decider)
    return await awaitable


def _make_outcome(task: "asyncio.Task[Any]") -> Outcome:
    if not task.done():
        return Outcome(is_late=True)
    if task.cancelled():
        return Outcome(error=GammsError("It was cancelled, and not because of the deadline."))
    error = task.exception()
    return Outcome(task.result()) if error is None else Outcome(error=error)


def _is_in_a_loop() -> bool:
    try:
        asyncio.get_running_loop()
    except RuntimeError:
        return False
    return True


def _run(loop: asyncio.AbstractEventLoop, work: Coroutine[Any, Any, list[Outcome]]) -> list[Outcome]:
    """Run the loop in this thread; an interrupt cancels the work."""
    task = loop.create_task(work)
    try:
        return loop.run_until_complete(task)
    except BaseException:
        if not task.done():
            task.cancel()
            with suppress(asyncio.CancelledError):
                loop.run_until_complete(task)
        raise


def _run_in_thread(loop: asyncio.AbstractEventLoop, work: Coroutine[Any, Any, list[Outcome]]) -> list[Outcome]:
    """Run the loop in a helper thread, because this thread runs another loop; an interrupt cancels the work."""
    from gamms.workers import wait_for_first

    found: Future[list[Outcome]] = Future()

    def run() -> None:
        try:
            found.set_result(_run(loop, work))
        except BaseException as error:  # noqa: BLE001 - it is raised where the result is asked for
            found.set_exception(error)

    thread = Thread(target=copy_context().run, args=(run,), name="gamms decisions", daemon=True)
    try:
        thread.start()
        wait_for_first([found])
    except BaseException:
        if not found.done():
            loop.call_soon_threadsafe(_cancel_all, loop)
            wait([found], 2 * _GRACE_S)
        raise
    thread.join()
    return found.result()


def _cancel_all(loop: asyncio.AbstractEventLoop) -> "set[asyncio.Task[Any]]":
    tasks = asyncio.all_tasks(loop)
    for task in tasks:
        task.cancel()
    return tasks


def _close(loop: asyncio.AbstractEventLoop) -> None:
    """Cancel remaining tasks of strategies, and close the loop."""
    if loop.is_closed() or loop.is_running():
        return
    tasks = _cancel_all(loop)
    if not _is_in_a_loop():
        if tasks:
            loop.run_until_complete(asyncio.wait(tasks, timeout=_GRACE_S))
        loop.run_until_complete(loop.shutdown_asyncgens())
    loop.close()
