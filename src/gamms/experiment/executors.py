"""Where games are played: in this process, in worker processes, or by an executor of the caller's, such as Ray's."""

import os
import pickle
import signal
import threading
import traceback
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from contextlib import suppress
from importlib.util import find_spec
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any, ParamSpec, TypeVar

from gamms.arguments import as_count
from gamms.errors import BadType, BadValue, GammsError, MissingExtra
from gamms.text import shown

P = ParamSpec("P")
T = TypeVar("T")

_LOOK_S = 1.0  # how often a process that says nothing is looked at
_READY = b"ready"


class WorkerDied(BrokenExecutor):
    """A process ended while it played."""


def cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def executor_for(given: object, workers: int | None) -> tuple[Executor, bool]:
    """Return the executor of a run, and whether it is to be shut down at its end.

    Raises:
        BadType, BadValue: `given` is no executor.
        MissingExtra: Ray is not installed.
    """
    if isinstance(given, Executor):
        return given, False
    if given == "ray":
        return _on_ray(), True
    if isinstance(given, str):
        raise BadValue(f"executor must be an executor of concurrent.futures or 'ray', not {shown(given)}.")
    if given is not None:
        raise BadType(f"executor must be an executor of concurrent.futures or 'ray', not {shown(given)}.")
    return (Here(), False) if workers is None else (WorkerPool(as_count(workers, "workers")), True)


class Here(Executor):
    """Plays in this process, as soon as it is asked."""

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Call a function."""
        future: Future[T] = Future()
        future.set_result(fn(*args, **kwargs))
        return future


class WorkerPool(ThreadPoolExecutor):
    """Processes of which each may die without the others: its task raises `WorkerDied`, and another takes its place.

    They are spawned, on every system, and end with this process however that ends.

    Args:
        workers: how many.
        is_fresh: whether each task gets a process of its own.
    """

    def __init__(self, workers: int, *, is_fresh: bool = False) -> None:
        super().__init__(workers, "gamms-worker")
        self._is_fresh = is_fresh
        self._own = threading.local()
        self._all: list[_Worker] = []

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Call a function in a process."""
        return super().submit(self._call, pickle.dumps((fn, args, kwargs)))

    def _call(self, task: bytes) -> Any:
        worker: _Worker | None = getattr(self._own, "worker", None)
        if worker is None:
            worker = self._own.worker = _Worker()
            self._all.append(worker)
        try:
            is_done, answer = worker.ask(task)
        except WorkerDied:
            self._own.worker = None
            raise
        if self._is_fresh:
            worker.end()
            self._own.worker = None
        if not is_done:
            raise answer
        return answer

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End all processes; tasks that are under way are lost."""
        super().shutdown(wait=False, cancel_futures=True)
        for worker in self._all:
            worker.end()
        super().shutdown(wait=wait, cancel_futures=cancel_futures)


class _Worker:
    """A process, and the connection to it."""

    def __init__(self) -> None:
        for is_last in (False, True):  # the first may be killed while it starts
            self._connection, self._process = _started()
            try:
                if self._receive() == _READY:
                    return
            except WorkerDied:
                if is_last:
                    raise BadValue(
                        "Worker processes cannot start: a program that uses workers has its calls under "
                        'if __name__ == "__main__":, since each worker imports it.'
                    ) from None

    def ask(self, task: bytes) -> tuple[bool, Any]:
        """Return whether a task was done, and what it gave, or raised."""
        try:
            self._connection.send_bytes(task)
        except OSError:
            raise self._died() from None
        answer: tuple[bool, Any] = pickle.loads(self._receive())  # noqa: S301 - from our own process
        return answer

    def end(self) -> None:
        """End the process; what it is doing is lost."""
        self._process.kill()
        self._process.join()

    def _receive(self) -> bytes:
        while not wait([self._connection, self._process.sentinel], _LOOK_S):
            if not self._process.is_alive():  # though a child of its own keeps the connection open
                raise self._died()
        try:
            if self._connection.poll():
                return self._connection.recv_bytes()
        except (EOFError, OSError):
            pass
        raise self._died()

    def _died(self) -> WorkerDied:
        self._process.join()
        self._connection.close()
        return WorkerDied(f"the process that played it ended, with exit code {self._process.exitcode}")


def _started() -> tuple[Connection, BaseProcess]:
    spawn = get_context("spawn")
    own, theirs = spawn.Pipe()
    process = spawn.Process(target=_serve, args=(theirs,), daemon=True)
    process.start()
    theirs.close()
    return own, process


def _serve(connection: Connection) -> None:
    """Do tasks until the other end of the connection is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that has started this one
    connection.send_bytes(_READY)
    with suppress(EOFError, OSError):
        while True:
            connection.send_bytes(_answer(connection.recv_bytes()))


def _answer(task: bytes) -> bytes:
    try:
        fn, args, kwargs = pickle.loads(task)  # noqa: S301 - from our own process
        return pickle.dumps((True, fn(*args, **kwargs)))
    except GammsError as error:
        return pickle.dumps((False, error))
    except Exception:  # noqa: BLE001 - raised by the process that has asked
        return pickle.dumps((False, BadValue(f"A worker could not begin:\n{traceback.format_exc()}")))


def _on_ray() -> Executor:
    """Return an executor of the cluster of Ray that this program is connected to, or else of one on this machine.

    Raises:
        MissingExtra: it is not installed.
    """
    if find_spec("ray") is None:
        raise MissingExtra('executor="ray"', "ray")
    import ray

    is_own = not ray.is_initialized()
    if is_own:
        ray.init(log_to_driver=False, include_dashboard=False)

    class OnRay(Executor):
        def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
            asked = ray.remote(max_retries=0)(fn).remote(*args, **kwargs).future()
            future: Future[T] = Future()
            asked.add_done_callback(lambda done: _pass_on(done, future, ray.exceptions.WorkerCrashedError))
            return future

        def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:  # noqa: ARG002 - of the class
            if is_own:
                ray.shutdown()

    return OnRay()


def _pass_on(done: Future[T], future: Future[T], crash: type[BaseException]) -> None:
    error = done.exception()
    if error is None:
        future.set_result(done.result())
    else:
        future.set_exception(WorkerDied("the process that played it ended") if isinstance(error, crash) else error)
