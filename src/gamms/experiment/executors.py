"""Executors of games: this process, worker processes, or an executor of the caller, such as Ray's."""

from collections.abc import Callable
from concurrent.futures import Executor, Future
from importlib.util import find_spec
from typing import ParamSpec, TypeVar

from gamms.arguments import as_count
from gamms.errors import BadType, BadValue, MissingExtra
from gamms.text import shown
from gamms.workers import WorkerDied, WorkerPool

__all__ = ["InProcessExecutor", "WorkerPool", "executor_for"]

P = ParamSpec("P")
T = TypeVar("T")


def executor_for(given: object, workers: int | None) -> tuple[Executor, bool]:
    """Return the executor of a run, and whether the run has to shut it down.

    Raises:
        BadType, BadValue: `given` is not an executor.
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
    return (InProcessExecutor(), False) if workers is None else (WorkerPool(as_count(workers, "workers")), True)


class InProcessExecutor(Executor):
    """Runs each function in this process, as soon as it is submitted."""

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Call a function now, and return its finished future."""
        future: Future[T] = Future()
        future.set_result(fn(*args, **kwargs))
        return future


def _on_ray() -> Executor:
    """Return an executor of the connected Ray cluster, or of a new one on this machine."""
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
