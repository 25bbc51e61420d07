"""Where games are played: in this process, in worker processes, or by an executor of the caller's, such as Ray's."""

import threading
from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from importlib.util import find_spec
from typing import Any, ParamSpec, TypeVar

from gamms.arguments import as_count
from gamms.errors import BadType, BadValue, MissingExtra
from gamms.text import shown
from gamms.workers import Worker, WorkerDied, task_of

P = ParamSpec("P")
T = TypeVar("T")


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

    They are fresh processes on every system, and end with this one however that ends.

    Args:
        workers: how many.
        is_fresh: whether each task gets a process of its own.
    """

    def __init__(self, workers: int, *, is_fresh: bool = False) -> None:
        super().__init__(workers, "gamms-worker")
        self._is_fresh = is_fresh
        self._own = threading.local()
        self._all: list[Worker] = []
        self._is_ended = False

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Call a function in a process."""
        return super().submit(self._call, task_of(fn, *args, **kwargs))

    def _call(self, task: bytes) -> Any:
        worker: Worker | None = getattr(self._own, "worker", None)
        if worker is None:
            worker = self._own.worker = Worker()
            self._all.append(worker)
            if self._is_ended:  # while this one was started
                worker.end()
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
        self._is_ended = True
        for worker in self._all:
            worker.end()
        super().shutdown(wait=wait, cancel_futures=cancel_futures)


def _on_ray() -> Executor:
    """Return an executor of the cluster of Ray that this program is connected to, or else of one on this machine."""
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
