"""Lets all nodes look around: in this process, or in several at once.

Threads do not help: each observer takes a hundred NumPy calls on small arrays, between which only one thread can run.
The processes of `multiprocessing` would import the user's script again. These import nothing but GAMMS, and get what
they need through their pipes (docs/decisions/0009).
"""

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Generator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, suppress
from queue import SimpleQueue
from struct import Struct
from typing import IO, Any

import numpy as np

from gamms.graph.sights import RowArray, Scene, Seen, Sights

_AT_ONCE = 64  # observers
_FEW = 4096  # observers for whom no process is worth its start
_SCRIPT = "from gamms.graph.lookouts import serve; serve()"

_SCENE = Struct("<QQdd")  # nodes, faces, radius, observer height; their xy and corners follow as float64
_ASKED = Struct("<QQ")  # first observer, one behind the last
_COUNT = Struct("<Q")  # rows; the counts and the rows follow as int32


def all_seen(scene: Scene, workers: int | None, show: Callable[[str], None]) -> Seen:
    """What every node sees; the number of workers changes nothing but the time.

    Args:
        scene: who looks at whom.
        workers: processes; None: one for each processor where that pays.
        show: is told how far it is.
    """
    nodes = len(scene.xy)
    if not nodes:
        return Seen(np.zeros(0, np.int32), np.zeros(0, np.int32))
    if workers is None:
        workers = 1 if nodes < _FEW else os.cpu_count() or 1
    chunks = [(first, min(first + _AT_ONCE, nodes)) for first in range(0, nodes, _AT_ONCE)]
    parts = []
    with closing(_parts(scene, chunks, min(workers, len(chunks)))) as found:
        for (_, last), part in zip(chunks, found, strict=True):
            parts.append(part)
            show(f"{last} of {nodes} nodes have looked around")
    counts, rows = zip(*parts, strict=True)
    return Seen(np.concatenate(counts), np.concatenate(rows))


def _parts(scene: Scene, chunks: list[tuple[int, int]], workers: int) -> Generator[Seen, None, None]:
    if workers > 1:
        yield from _Lookouts(scene, workers).parts(chunks)
    else:
        sights = Sights(scene)
        yield from (sights.seen(*chunk) for chunk in chunks)


class _Lookouts:
    """Processes that answer; where one cannot be had or breaks down, this process answers in its place."""

    def __init__(self, scene: Scene, count: int) -> None:
        self._is_over = False
        self._pool = ThreadPoolExecutor(count)  # threads that wait for a process each
        self._all = [_Lookout(scene) for _ in range(count)]
        self._idle: SimpleQueue[_Lookout] = SimpleQueue()
        for one in self._all:
            self._idle.put(one)

    def parts(self, chunks: list[tuple[int, int]]) -> Generator[Seen, None, None]:
        """What the observers of each chunk see."""
        try:
            for future in [self._pool.submit(self._seen, *chunk) for chunk in chunks]:
                yield future.result()
        finally:
            self._is_over = True
            self._stop()
            self._pool.shutdown(cancel_futures=True)
            self._stop()  # one may have been starting

    def _seen(self, first: int, last: int) -> Seen:
        one = self._idle.get()
        try:
            return one.seen(first, last)
        except (OSError, EOFError):
            if self._is_over:
                raise
            one.replace()
            return one.seen(first, last)
        finally:
            self._idle.put(one)

    def _stop(self) -> None:
        for one in self._all:
            one.stop()


class _Lookout:
    """One process, or what stands in for it."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._here: Sights | None = None
        self._process: subprocess.Popen[bytes] | None = None

    def seen(self, first: int, last: int) -> Seen:
        """What some observers see.

        Raises:
            OSError, EOFError: the process cannot be started, or broke down.
        """
        if self._here is not None:
            return self._here.seen(first, last)
        if self._process is None:
            self._process = _start()
            _send(self._process, _SCENE.pack(len(self._scene.xy), len(self._scene.corners), *self._scene[2:]))
            _send(self._process, self._scene.xy.astype("<f8").tobytes(), self._scene.corners.astype("<f8").tobytes())
        _send(self._process, _ASKED.pack(first, last))
        answer: Any = self._process.stdout
        (total,) = _COUNT.unpack(_read(answer, _COUNT.size))
        return Seen(_int32(_read(answer, 4 * (last - first))), _int32(_read(answer, 4 * total)))

    def replace(self) -> None:
        """From now on answer here."""
        self.stop()
        self._here = Sights(self._scene)

    def stop(self) -> None:
        """End the process."""
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.wait()
            for pipe in (process.stdin, process.stdout):
                with suppress(OSError):  # what was still to be written is lost, as it should be
                    pipe.close()  # type: ignore[union-attr] # there are pipes


def _start() -> "subprocess.Popen[bytes]":
    if not sys.executable or getattr(sys, "frozen", False):
        raise OSError("this program is no Python interpreter that could be started again")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    return subprocess.Popen(  # noqa: S603 - our own words to the interpreter that runs us
        [sys.executable, "-c", _SCRIPT],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env=environment,
    )


def _send(process: "subprocess.Popen[bytes]", *parts: bytes) -> None:
    pipe: Any = process.stdin
    for part in parts:
        pipe.write(part)
    pipe.flush()


def _read(pipe: IO[bytes], size: int) -> bytes:
    data = pipe.read(size)
    if len(data) < size:
        raise EOFError
    return data


def _int32(data: bytes) -> RowArray:
    return np.frombuffer(data, "<i4").astype(np.int32)


def serve() -> None:
    """Be one of the processes: read a scene, then answer until there are no more questions."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever asks is interrupted, and ends this
    asked, answer = sys.stdin.buffer, sys.stdout.buffer
    nodes, faces, radius, height = _SCENE.unpack(_read(asked, _SCENE.size))
    xy = np.frombuffer(_read(asked, 16 * nodes), "<f8").astype(np.float64).reshape(-1, 2)
    corners = np.frombuffer(_read(asked, 96 * faces), "<f8").astype(np.float64).reshape(-1, 4, 3)
    sights = Sights(Scene(xy, corners, radius, height))
    while question := asked.read(_ASKED.size):
        counts, rows = sights.seen(*_ASKED.unpack(question))
        answer.write(_COUNT.pack(len(rows)) + counts.astype("<i4").tobytes() + rows.astype("<i4").tobytes())
        answer.flush()
