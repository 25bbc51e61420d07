"""Many polylines in one array: line `i` has the points `points[offsets[i]:offsets[i + 1]]`."""

import numpy as np

from gamms import kernels
from gamms.ir.graph import FloatArray, IntArray


def straight_lines(start: FloatArray, end: FloatArray) -> tuple[IntArray, FloatArray]:
    """Offsets and points of straight lines between positions (lines, 2)."""
    points = np.stack((start, end), axis=1).reshape(-1, 2)
    return np.arange(len(start) + 1) * 2, points


def chosen_lines(offsets: IntArray, points: FloatArray, lines: IntArray) -> tuple[IntArray, FloatArray]:
    """Offsets and points of some of the lines, in the order of `lines`."""
    take, chosen = kernels.chosen_runs(offsets, lines)
    return chosen, points[take]


def reversed_points(offsets: IntArray) -> IntArray:
    """The rows of the points such that every line runs backwards."""
    mirror = np.repeat(offsets[:-1] + offsets[1:] - 1, np.diff(offsets))
    return mirror - np.arange(offsets[-1])


def along(offsets: IntArray, points: FloatArray) -> FloatArray:
    """How far along its own line each point is."""
    if not len(points):
        return np.zeros(0)
    step = np.zeros(len(points))
    step[1:] = np.hypot(*np.diff(points, axis=0).T)
    step[offsets[:-1]] = 0.0
    total = np.cumsum(step)
    return np.asarray(total - np.repeat(total[offsets[:-1]], np.diff(offsets)))


def with_ends(
    offsets: IntArray, points: FloatArray, start: FloatArray, end: FloatArray
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Lead every line from `start` to `end`: a point is added where the line does not begin or end there.

    Returns:
        the new offsets, the new points, and by how much each line has grown.
    """
    head, tail = points[offsets[:-1]], points[offsets[1:] - 1]
    before, after = (head != start).any(axis=1), (tail != end).any(axis=1)
    grown = offsets_of(np.diff(offsets) + before + after)
    result = np.empty((grown[-1], 2))
    shift = np.repeat(grown[:-1] + before - offsets[:-1], np.diff(offsets))
    result[np.arange(len(points)) + shift] = points
    result[grown[:-1]] = start
    result[grown[1:] - 1] = end
    return grown, result, np.hypot(*(head - start).T) + np.hypot(*(end - tail).T)


def moved_ends(
    offsets: IntArray, points: FloatArray, start: FloatArray, end: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Move the first point of every line to `start` and its last to `end`.

    Returns:
        the new points, and how many times longer each line is drawn than before.
    """
    moved = points.copy()
    moved[offsets[:-1]], moved[offsets[1:] - 1] = start, end
    before, after = lengths_of(offsets, points), lengths_of(offsets, moved)
    return moved, np.divide(after, before, out=np.ones_like(after), where=before > 0.0)


def lengths_of(offsets: IntArray, points: FloatArray) -> FloatArray:
    """How long each line is drawn."""
    steps = np.hypot(*np.diff(points, axis=0, append=points[-1:]).T)
    steps[offsets[1:] - 1] = 0.0  # from the end of a line to the begin of the next
    return np.add.reduceat(steps, offsets[:-1]) if len(offsets) > 1 else np.zeros(0)


def offsets_of(counts: IntArray) -> IntArray:
    """Where groups of these sizes begin and end when they follow each other."""
    offsets = np.zeros(len(counts) + 1, np.int64)
    np.cumsum(counts, out=offsets[1:])
    return offsets
