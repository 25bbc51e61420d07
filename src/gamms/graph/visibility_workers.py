"""Compute the visible nodes of every node from arrays, in this process or in several at once.

Nearby observers are processed together: a hundred NumPy calls serve thirty observers as well as one. Threads do not
help, because the many small NumPy calls hold the interpreter lock. The processes of `multiprocessing` would import the
user's script again; those of `gamms.workers` import GAMMS alone (docs/decisions/0009).
"""

from collections.abc import Callable, Generator, Iterator
from contextlib import closing
from itertools import chain
from typing import NamedTuple

import numpy as np

from gamms import kernels
from gamms.errors import GammsError
from gamms.graph.indexes import NodeGrid, is_within
from gamms.graph.obstacles import Obstacles
from gamms.graph.tables import NodeTable
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import ObstacleColumns

_AT_ONCE = 4  # groups of observers
_GROUP = 40  # observers, at most
_LINES = 1 << 16  # sight lines tested together, at least those of one observer
_NEAR = 0.25  # share of the radius: side of a square whose observers form a group
_FEW = 8192  # observers below which a worker process is not worth its start
_SHARE = 256  # groups for each process, at most

Span = tuple[int, int]  # first group of observers, one past the last
RowArray = np.ndarray[tuple[int, ...], np.dtype[np.int32]]  # int32 to halve the memory


class VisibilityTask(NamedTuple):
    """The nodes, the faces, and the radius and height of a visibility table."""

    xy: FloatArray  # (nodes, 2)
    corners: FloatArray  # (faces, 4, 3)
    radius: float
    observer_height: float
    ground: FloatArray  # (nodes, 2)  height, and number of the tunnel or 0


class VisibilityRows(NamedTuple):
    """The visible node rows of some observers, one observer after the other."""

    counts: RowArray  # (observers,)
    rows: RowArray  # (counts.sum(),) node rows, ascending for each observer


_NOTHING = VisibilityRows(np.zeros(0, np.int32), np.zeros(0, np.int32))


class SightLines:
    """Tests the sight lines between nodes, as `GraphEngine.visible` would."""

    def __init__(self, task: VisibilityTask) -> None:
        count = len(task.xy)
        faces = len(task.corners)
        self._radius = task.radius
        height, self._tunnels = task.ground.T
        self._points = np.column_stack((task.xy, height + task.observer_height))
        nodes = NodeTable()
        nodes.extend(np.arange(count), xy=task.xy)
        self._grid = NodeGrid(nodes)
        self._obstacles = Obstacles()
        self._obstacles.add_many(ObstacleColumns(np.arange(faces), task.corners, np.zeros(faces, np.int64)))
        self.groups = _group_rows(task.xy, task.radius)

    def find_seen(self, first: int, last: int) -> VisibilityRows:
        """Return the nodes that the observers of one or more groups see, in the order of the groups."""
        found = list(chain.from_iterable(self._list_visible_rows(rows) for rows in self.groups[first:last]))
        return VisibilityRows(np.array([len(rows) for rows in found], np.int32), np.concatenate(found))

    def _list_visible_rows(self, observers: IntArray) -> Iterator[RowArray]:
        """Yield the visible rows of each of some nearby observers."""
        x, y = self._points[observers, :2].T
        middle = float(x.mean()), float(y.mean())
        off = float(np.hypot(x - middle[0], y - middle[1]).max())
        # Rounding must not exclude a node.
        reach = (self._radius + off + max(map(abs, middle))) * 1e-9 + self._radius + off
        near = self._grid.find_within(*middle, reach) if reach < np.inf else np.arange(len(self._points))
        size = max(1, _LINES // len(near))
        for part in np.split(observers, range(size, len(observers), size)):
            here = self._points[part]
            there = self._points[near]
            is_asked = is_within(there[:, 0], there[:, 1], here[:, :1], here[:, 1:2], self._radius)
            is_asked &= self._tunnels[near] == self._tunnels[part, None]
            for is_seen in self._obstacles.find_visible_from_each(here, there, is_asked):
                yield near[is_seen].astype(np.int32)


def _group_rows(xy: FloatArray, radius: float) -> list[IntArray]:
    """Group the rows by squares that are a fraction of the radius wide."""
    with np.errstate(over="ignore", invalid="ignore"):
        away = xy - xy.min(axis=0)
        column, line = (away / (max(radius * _NEAR, float(away.max()) * 1e-6) or 1.0)).astype(np.int64).T
    order = np.lexsort((column, line))
    ends = np.flatnonzero(np.diff(column[order]) | np.diff(line[order])) + 1
    groups: list[IntArray] = []
    for rows in np.split(order, ends):
        groups += [rows[i : i + _GROUP] for i in range(0, len(rows), _GROUP)]
    return groups


def compute_visibility(task: VisibilityTask, workers: int | None, show: Callable[[str], None]) -> VisibilityRows:
    """Return the visible nodes of every node; the number of workers changes only the time.

    Args:
        task: the nodes, faces and limits of the table.
        workers: number of processes; None: one per available core if worthwhile.
        show: called with lines of progress.
    """
    nodes = len(task.xy)
    if not nodes:
        return _NOTHING
    if workers is None:
        from gamms.workers import count_cores

        workers = 1 if nodes < _FEW else count_cores()
    sights = SightLines(task)
    count = len(sights.groups)
    size = _AT_ONCE if workers == 1 else max(_AT_ONCE, min(_SHARE, -(-count // (2 * workers))))
    spans = [(first, min(first + size, count)) for first in range(0, count, size)]
    parts = []
    done = 0
    found = (
        (sights.find_seen(*span) for span in spans)
        if workers == 1
        else _find_visible_by_processes(task, spans, workers)
    )
    with closing(found):
        for part in found:
            parts.append(part)
            done += len(part.counts)
            show(f"{done} of {nodes} nodes done")
    counts, rows = (np.concatenate(values) for values in zip(*parts, strict=True))
    by_row = np.argsort(np.concatenate(sights.groups))
    ends = np.concatenate((np.zeros(1, np.int64), np.cumsum(counts, dtype=np.int64)))
    places, _ = kernels.select_runs(ends, by_row)
    return VisibilityRows(counts[by_row], rows[places])


def _find_visible_by_processes(
    task: VisibilityTask, spans: list[Span], workers: int
) -> Generator[VisibilityRows, None, None]:
    """Return the visible nodes of each span; if a worker process fails, this process does its work."""
    from gamms.workers import WorkerDied, WorkerPool, wait_for_result

    pool = WorkerPool(workers)
    try:
        for span, future in [(span, pool.submit(find_visible, task, span)) for span in spans]:
            try:
                found = wait_for_result(future)
            except (OSError, WorkerDied, GammsError):
                found = find_visible(task, span)
            yield found
    finally:
        pool.shutdown()


def find_visible(task: VisibilityTask, span: Span) -> VisibilityRows:
    """Return the nodes that the given observers see."""
    return SightLines(task).find_seen(*span)
