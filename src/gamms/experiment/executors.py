"""Where games are played: in this process, in worker processes, or by an executor of the caller's, such as Ray's."""

import os
import pickle
import runpy
import subprocess
import sys
import threading
import traceback
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from contextlib import suppress
from functools import cache
from importlib.util import find_spec
from multiprocessing.connection import wait
from typing import Any, BinaryIO, ParamSpec, TypeVar, cast

from gamms.arguments import as_count
from gamms.errors import BadType, BadValue, GammsError, MissingExtra
from gamms.text import shown

P = ParamSpec("P")
T = TypeVar("T")

_LOOK_S = 1.0  # how often a process that says nothing is looked at
_IN_WORKER = "GAMMS_EXPERIMENT_WORKER"
# Ctrl-C is for the process that has started this one, also while it imports.
_SCRIPT = """import signal
signal.signal(signal.SIGINT, signal.SIG_IGN)
from gamms.experiment.executors import serve
serve()
"""


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

    They are fresh processes on every system, and end with this one however that ends.

    Args:
        workers: how many.
        is_fresh: whether each task gets a process of its own.
    """

    def __init__(self, workers: int, *, is_fresh: bool = False) -> None:
        super().__init__(workers, "gamms-worker")
        self._is_fresh = is_fresh
        self._own = threading.local()
        self._all: list[_Worker] = []
        self._is_ended = False

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Call a function in a process."""
        return super().submit(self._call, pickle.dumps((fn, args, kwargs)))

    def _call(self, task: bytes) -> Any:
        worker: _Worker | None = getattr(self._own, "worker", None)
        if worker is None:
            worker = self._own.worker = _Worker()
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


class _Worker:
    """A process that does tasks: a Python of its own, into which the user's script is not imported unasked."""

    def __init__(self) -> None:
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
        self._process = subprocess.Popen(  # noqa: S603 - our own words to the interpreter that runs us
            [sys.executable, "-c", _SCRIPT], stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment
        )

    def ask(self, task: bytes) -> tuple[bool, Any]:
        """Return whether a task was done, and what it gave, or raised."""
        stdin, stdout = cast("BinaryIO", self._process.stdin), cast("BinaryIO", self._process.stdout)
        script = getattr(sys.modules["__main__"], "__file__", None) if b"__main__" in task else None
        try:
            _send(stdin, pickle.dumps((script, task)))
        except OSError:
            raise self._died() from None
        while os.name == "posix" and not wait([stdout.fileno()], _LOOK_S):
            if self._process.poll() is not None:  # though a child of its own keeps the pipe open
                raise self._died()
        answer = _received(stdout)
        if answer is None:
            raise self._died()
        found: tuple[bool, Any] = pickle.loads(answer)  # noqa: S301 - from our own process
        return found

    def end(self) -> None:
        """End the process; what it is doing is lost."""
        self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            with suppress(OSError):  # what could not be written is lost, too
                cast("BinaryIO", pipe).close()

    def _died(self) -> WorkerDied:
        self.end()
        return WorkerDied(f"the process that played it ended, with exit code {self._process.returncode}")


def _send(stream: BinaryIO, data: bytes) -> None:
    stream.write(len(data).to_bytes(8, "little") + data)
    stream.flush()


def _received(stream: BinaryIO) -> bytes | None:
    """Return what was sent; None: nothing more comes."""
    size = stream.read(8)
    data = stream.read(int.from_bytes(size, "little"))
    return data if len(size) == 8 and len(data) == int.from_bytes(size, "little") else None


def serve() -> None:
    """Work as one of the processes: do tasks until there are no more."""
    tasks, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what strategies print is no answer
    os.environ[_IN_WORKER] = "1"
    with suppress(OSError):
        while (task := _received(tasks)) is not None:
            _send(answers, _answer(*pickle.loads(task)))  # noqa: S301 - from our own process


def _answer(script: str | None, task: bytes) -> bytes:
    try:
        if script is not None:  # where functions are that the task names
            _import_script(script)
        fn, args, kwargs = pickle.loads(task)  # noqa: S301 - from our own process
        return pickle.dumps((True, fn(*args, **kwargs)))
    except GammsError as error:
        return pickle.dumps((False, error))
    except Exception:  # noqa: BLE001 - raised by the process that has asked
        return pickle.dumps((False, BadValue(f"A worker could not begin:\n{traceback.format_exc()}")))


@cache
def _import_script(path: str) -> None:
    """Let this process have what the user's script defines, as the processes of `multiprocessing` have it."""
    vars(sys.modules["__main__"]).update(runpy.run_path(path, run_name="__mp_main__"))


def refuse_in_worker() -> None:
    """Refuse to begin an experiment in a process that plays one.

    Raises:
        BadValue: this is such a process.
    """
    if _IN_WORKER in os.environ:
        raise BadValue(
            "Workers import this program for the functions that it defines: put what it does under "
            'if __name__ == "__main__":, or define the functions in another module.'
        )


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
