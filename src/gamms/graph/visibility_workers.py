"""Computes which nodes every node sees, from arrays alone: in this process, or in several at once.

Threads do not help: each observer takes a hundred NumPy calls on small arrays, between which only one thread can run.
The processes of `multiprocessing` would import the user's script again; those of `gamms.workers` import GAMMS alone
(docs/decisions/0009).
"""

from collections.abc import Callable, Generator
from contextlib import closing
from typing import NamedTuple

import numpy as np

from gamms.errors import GammsError
from gamms.graph.indexes import NodeGrid
from gamms.graph.obstacles import Obstacles
from gamms.graph.tables import NodeTable
from gamms.ir.graph import FloatArray
from gamms.ir.obstacles import ObstacleColumns

_AT_ONCE = 64  # observers
_FEW = 4096  # observers for whom no process is worth its start
_SHARE = 4096  # observers for each process, at most; one of them takes about a millisecond

Span = tuple[int, int]  # first observer, one behind the last
RowArray = np.ndarray[tuple[int, ...], np.dtype[np.int32]]  # half the memory of other rows; there are many


class VisibilityTask(NamedTuple):
    """The nodes, the faces, and the radius and height of a visibility table."""

    xy: FloatArray  # (nodes, 2)
    corners: FloatArray  # (faces, 4, 3)
    radius: float
    observer_height: float
    ground: FloatArray  # (nodes, 2)  height, and number of the tunnel or 0


class VisibilityRows(NamedTuple):
    """The rows of the nodes that some observers see, one observer after the other."""

    counts: RowArray  # (observers,)
    rows: RowArray  # (counts.sum(),) node rows, ascending for each observer


_NOTHING = VisibilityRows(np.zeros(0, np.int32), np.zeros(0, np.int32))


class SightLines:
    """Tests the sight lines of nodes, as `GraphEngine.visible` would."""

    def __init__(self, task: VisibilityTask) -> None:
        count, faces = len(task.xy), len(task.corners)
        self._radius = task.radius
        height, self._tunnels = task.ground.T
        self._points = np.column_stack((task.xy, height + task.observer_height))
        nodes = NodeTable()
        nodes.extend(np.arange(count), xy=task.xy)
        self._grid = NodeGrid(nodes)
        self._obstacles = Obstacles()
        self._obstacles.add_many(ObstacleColumns(np.arange(faces), task.corners, np.zeros(faces, np.int64)))

    def seen(self, first: int, last: int) -> VisibilityRows:
        """Return what the observers in these rows see; there must be one."""
        found = [self._row(row) for row in range(first, last)]
        return VisibilityRows(np.array([len(rows) for rows in found], np.int32), np.concatenate(found))

    def _row(self, row: int) -> RowArray:
        observer = self._points[row]
        near = self._grid.within(float(observer[0]), float(observer[1]), self._radius)
        near = near[self._tunnels[near] == self._tunnels[row]]
        seen: RowArray = near[self._obstacles.visible(observer, self._points[near])].astype(np.int32)
        return seen


def compute_visibility(task: VisibilityTask, workers: int | None, show: Callable[[str], None]) -> VisibilityRows:
    """Return what every node sees; the number of workers changes nothing but the time.

    Args:
        task: what to compute.
        workers: processes; None: one for each core that this process may use, where that pays.
        show: takes a line of progress.
    """
    nodes = len(task.xy)
    if not nodes:
        return _NOTHING
    if workers is None:
        from gamms.workers import cores

        workers = 1 if nodes < _FEW else cores()
    size = _AT_ONCE if workers == 1 else max(_AT_ONCE, min(_SHARE, -(-nodes // (2 * workers))))
    spans = [(first, min(first + size, nodes)) for first in range(0, nodes, size)]
    parts = []
    sights = SightLines(task)
    found = (sights.seen(*span) for span in spans) if workers == 1 else _seen_by_processes(task, spans, workers)
    with closing(found):
        for (_, last), part in zip(spans, found, strict=True):
            parts.append(part)
            show(f"{last} of {nodes} nodes have looked around")
    counts, rows = zip(*parts, strict=True)
    return VisibilityRows(np.concatenate(counts), np.concatenate(rows))


def _seen_by_processes(task: VisibilityTask, spans: list[Span], workers: int) -> Generator[VisibilityRows, None, None]:
    """Return what each span sees; where a process cannot be had or breaks down, this process works in its place."""
    from gamms.workers import WorkerDied, WorkerPool, result_of

    pool = WorkerPool(workers)
    try:
        for span, future in [(span, pool.submit(seen_by, task, span)) for span in spans]:
            try:
                found = result_of(future)
            except (OSError, WorkerDied, GammsError):
                found = seen_by(task, span)
            yield found
    finally:
        pool.shutdown()


def seen_by(task: VisibilityTask, span: Span) -> VisibilityRows:
    """Return what some observers see."""
    return SightLines(task).seen(*span)
