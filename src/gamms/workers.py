"""Worker processes: fresh Python processes that call functions, and import the user's script only on demand.

They, and other child processes that call `die_with_parent`, end when their parent process ends, even by a crash.
"""

import ctypes
import gc
import os
import pickle
import runpy
import signal
import subprocess
import sys
import threading
import traceback
from collections.abc import Callable, Collection, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, ThreadPoolExecutor
from concurrent.futures import wait as wait_for
from contextlib import contextmanager, suppress
from functools import cache, partial
from multiprocessing.connection import wait
from typing import Any, BinaryIO, ParamSpec, TypeVar, cast

from gamms.errors import BadValue, GammsError

P = ParamSpec("P")
T = TypeVar("T")

SIGNALS_S = 0.5  # how often signals are looked for that came just before a wait, which Python then sleeps through
_LOOK_S = 1.0  # interval of checks of a silent process
_IN_WORKER = "GAMMS_WORKER"
_SET_DEATH_SIGNAL = 1  # of prctl; SIGKILL
_KILL = 9
_LIBC: Any = ctypes.CDLL(None) if sys.platform == "linux" else None  # loaded here, for a forked child must not load
_SCRIPT = """import signal
signal.signal(signal.SIGINT, signal.SIG_IGN)
if hasattr(signal, "pthread_sigmask"):
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
from gamms.workers import serve
serve()
"""


def count_cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def die_with_parent(parent: int) -> None:
    """Have this process killed when the one that started it ends; does nothing on systems other than Linux.

    Linux means the thread that started it, which therefore has to live as long.

    Args:
        parent: the id of that process; if it has ended already, this process exits.
    """
    if _LIBC is not None:
        _LIBC.prctl(_SET_DEATH_SIGNAL, _KILL, 0, 0, 0)
        if os.getppid() != parent:
            os._exit(1)


def wait_for_first(futures: Collection[Future[T]]) -> set[Future[T]]:
    """Wait until at least one future is done, or Ctrl-C is pressed; return the finished futures."""
    while not (done := wait_for(futures, SIGNALS_S, FIRST_COMPLETED).done):
        pass
    return done


def wait_for_result(future: Future[T]) -> T:
    """Wait for a result, or Ctrl-C."""
    wait_for_first([future])
    return future.result()


class WorkerDied(BrokenExecutor):
    """A worker process ended during a task."""


class Worker:
    """A process that runs tasks, one at a time; it ends when this process ends, even by a crash.

    Attributes:
        pid: the number that the system gave it.

    Raises:
        OSError: it cannot be started.
    """

    def __init__(self) -> None:
        if not sys.executable or getattr(sys, "frozen", False):
            raise OSError("This program is no Python interpreter that could be started again.")
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
        with _block_ctrl_c():
            self._process = subprocess.Popen(  # noqa: S603 - our own words to the interpreter that runs us
                [sys.executable, "-c", _SCRIPT], stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment
            )
        self.pid = self._process.pid

    def ask(self, task: bytes) -> tuple[bool, Any]:
        """Run a task; return whether it succeeded, and its result or exception.

        Args:
            task: a function and its arguments, as `make_task` returns them.

        Raises:
            WorkerDied: the process has ended.
            BadValue: the task names what a notebook or a console defines.
        """
        self.send(task)
        return self.receive()

    def send(self, task: bytes) -> None:
        """Begin a task, whose answer is for `receive`; see `ask`."""
        stdin = cast("BinaryIO", self._process.stdin)
        script = getattr(sys.modules["__main__"], "__file__", None) if b"__main__" in task else None
        if b"__main__" in task and (script is None or not os.path.exists(script)):  # noqa: PTH110 - a text
            raise BadValue(
                "Worker processes cannot import functions of a notebook or console: put them into a file and import "
                "it, or leave workers out."
            )
        try:
            _send(stdin, pickle.dumps((script, task)))
        except OSError:
            raise self._make_death_error() from None

    def receive(self) -> tuple[bool, Any]:
        """Return the answer to the task that was sent; see `ask`."""
        stdout = cast("BinaryIO", self._process.stdout)
        while os.name == "posix" and not wait([stdout.fileno()], _LOOK_S):
            if self._process.poll() is not None:  # even if a child process keeps the pipe open
                raise self._make_death_error()
        answer = _receive_message(stdout)
        if answer is None:
            raise self._make_death_error()
        found: tuple[bool, Any] = pickle.loads(answer)  # noqa: S301 - from our own process
        return found

    def end(self) -> None:
        """End the process; its current task is lost."""
        self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            with suppress(OSError):  # unwritten data are lost, too
                cast("BinaryIO", pipe).close()

    def _make_death_error(self) -> WorkerDied:
        self.end()
        return WorkerDied(f"the process that played it ended, with exit code {self._process.returncode}")


class WorkerPool(ThreadPoolExecutor):
    """A pool of worker processes; if a process dies, its task raises `WorkerDied` and the process is replaced.

    Processes are started fresh on every system, and end when this process ends, even by a crash.

    Args:
        workers: the number of processes.
        is_fresh: whether each task gets a new process.
    """

    def __init__(self, workers: int, *, is_fresh: bool = False) -> None:
        super().__init__(workers, "gamms-worker")
        self._is_fresh = is_fresh
        self._own = threading.local()
        self._all: list[Worker] = []
        self._is_ended = False

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Call a function in a process."""
        return super().submit(self._call, partial(fn, *args, **kwargs))

    def _call(self, call: Callable[[], object]) -> Any:
        task = make_task(call)  # not before, for tasks that wait may be many and large
        worker: Worker | None = getattr(self._own, "worker", None)
        if worker is None:
            worker = Worker()
            self._own.worker = worker
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


@contextmanager
def _block_ctrl_c() -> Iterator[None]:
    """Start processes with SIGINT blocked, because Ctrl-C is handled by this process."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def make_task(fn: Callable[P, object], /, *args: P.args, **kwargs: P.kwargs) -> bytes:
    """Return a call of a function as a task for a worker."""
    return pickle.dumps((fn, args, kwargs))


def _send(stream: BinaryIO, data: bytes) -> None:
    stream.write(len(data).to_bytes(8, "little") + data)
    stream.flush()


def _receive_message(stream: BinaryIO) -> bytes | None:
    """Return the next message; None at the end of the stream."""
    size = stream.read(8)
    data = stream.read(int.from_bytes(size, "little"))
    return data if len(size) == 8 and len(data) == int.from_bytes(size, "little") else None


def serve() -> None:
    """Run as a worker process: execute tasks until the end of the input."""
    tasks = os.fdopen(os.dup(0), "rb")
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # output of strategies must not mix with results
    os.environ[_IN_WORKER] = "1"
    with suppress(OSError):
        while (task := _receive_message(tasks)) is not None:
            _send(answers, _answer(*pickle.loads(task)))  # noqa: S301 - from our own process


def _answer(script: str | None, task: bytes) -> bytes:
    try:
        if script is not None:  # where functions are that the task names
            _import_script(script)
        fn, args, kwargs = _load_task(task)
        return pickle.dumps((True, fn(*args, **kwargs)))
    except GammsError as error:
        return pickle.dumps((False, error))
    except Exception:  # noqa: BLE001 - raised by the process that has asked
        return pickle.dumps((False, BadValue(f"A worker could not begin:\n{traceback.format_exc()}")))


def _load_task(task: bytes) -> tuple[Callable[..., object], tuple[object, ...], dict[str, object]]:
    """Return a function and its arguments; their modules are imported with the first task.

    Meanwhile no garbage is collected: looking through the imported modules takes a sixth of the start of a process.
    """
    gc.disable()
    try:
        found: tuple[Callable[..., object], tuple[object, ...], dict[str, object]] = pickle.loads(task)  # noqa: S301
        return found
    finally:
        gc.enable()


@cache
def _import_script(path: str) -> None:
    """Import the user's script as `multiprocessing` does, so that its definitions are available."""
    vars(sys.modules["__main__"]).update(runpy.run_path(path, run_name="__mp_main__"))


def refuse_in_worker() -> None:
    """Raise in a worker process, because workers must not start workers.

    Raises:
        BadValue: this is a worker process.
    """
    if _IN_WORKER in os.environ:
        raise BadValue(
            "Workers import this program for the functions that it defines: put what it does under "
            'if __name__ == "__main__":, or define the functions in another module.'
        )
