"""Footprints: what the walls of buildings stand around, as polygons whose holes are courtyards."""

from typing import NamedTuple

import numpy as np

from gamms import kernels
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray, ObstacleColumns
from gamms.visual.clipping import inside

_Outline = list[list[float]]  # corners (x, y)


class Footprints(NamedTuple):
    """What is built upon, and which faces are around it."""

    points: FloatArray  # (points, 2)
    offsets: IntArray  # (footprints + 1,)  footprint `i` is `points[offsets[i]:offsets[i + 1]]`
    heights: FloatArray  # (footprints,)  of the top edges
    types: IntArray  # (footprints,)  of obstacles
    row_of: IntArray  # (faces,)  the footprint that a face stands around; -1 = none

    def chosen(self, is_chosen: BoolArray) -> tuple[FloatArray, IntArray]:
        """Points and offsets of some footprints."""
        take, offsets = kernels.chosen_runs(self.offsets, np.flatnonzero(is_chosen))
        return self.points[take], offsets

    def boxes(self) -> tuple[FloatArray, FloatArray]:
        """Lower left and upper right corners, (footprints, 2) each."""
        first = self.offsets[:-1]
        return np.minimum.reduceat(self.points, first), np.maximum.reduceat(self.points, first)


def footprints(faces: ObstacleColumns) -> Footprints:
    """The footprints of faces whose top edges lead, one after the other, around something.

    A ring inside the one before, of the same type, height and base, is a courtyard: it makes a hole.
    """
    rings, is_forward = _rings(faces.corners[:, 0], faces.corners[:, 1])
    outlines: list[_Outline] = [
        faces.corners[begin:end, 0 if forward else 1, :2].tolist()
        for (begin, end), forward in zip(rings.tolist(), is_forward, strict=True)
    ]
    first = rings[:, 0]
    looks = np.column_stack((faces.types, faces.corners[:, 0, 2], faces.corners[:, 2, 2]))[first].tolist()
    bundles = _bundles(outlines, looks)
    polygons = [_with_holes([outlines[ring] for ring in bundle]) for bundle in bundles]
    row_of = np.full(len(faces.ids), -1)
    for row, bundle in enumerate(bundles):
        for ring in bundle:
            row_of[slice(*rings[ring])] = row
    outer = first[np.array([bundle[0] for bundle in bundles], np.int64)]
    return Footprints(
        points=np.array([point for polygon in polygons for point in polygon]).reshape(-1, 2),
        offsets=np.cumsum([0, *map(len, polygons)]),
        heights=faces.corners[outer, 0, 2],
        types=faces.types[outer],
        row_of=row_of,
    )


def _rings(rights: FloatArray, lefts: FloatArray) -> tuple[IntArray, list[bool]]:
    """First and last row + 1 of every ring, and whether its faces go on from right to left, as those of maps do."""
    found = dict.fromkeys(map(tuple, kernels.closed_rings(rights, lefts).tolist()), True)
    taken = np.zeros(len(rights), bool)
    for begin, end in found:
        taken[begin:end] = True
    others = np.zeros((0, 2), np.int64) if taken.all() else kernels.closed_rings(lefts, rights)
    for begin, end in others.tolist():
        if not taken[begin:end].any():
            found[(begin, end)] = False
    rings = sorted(found)
    return np.array(rings, np.int64).reshape(-1, 2), [found[ring] for ring in rings]


def _bundles(outlines: list[_Outline], looks: list[list[float]]) -> list[list[int]]:
    """Rings that make one footprint: the outer one, then those of its courtyards."""
    bundles: list[list[int]] = []
    for ring, outline in enumerate(outlines):
        outer, *holes = bundles[-1] if bundles else [ring]
        is_hole = ring > 0 and looks[ring] == looks[outer] and _is_within(outline, outlines[outer])
        if is_hole and not any(_is_within(outline, outlines[hole]) for hole in holes):
            bundles[-1].append(ring)
        else:
            bundles.append([ring])
    return bundles


def _is_within(outline: _Outline, other: _Outline) -> bool:
    """Whether the middles of all edges are inside another outline."""
    for axis in (0, 1):
        mine, around = ([point[axis] for point in one] for one in (outline, other))
        if min(mine) < min(around) or max(mine) > max(around):
            return False
    corners = np.array(outline)
    return bool(inside((corners + np.roll(corners, -1, axis=0)) / 2, np.array(other)).all())


def _with_holes(outlines: list[_Outline]) -> _Outline:
    """One polygon: a seam leads from the first outline to each other one, which runs the other way around, and back."""
    outer, *holes = outlines
    seam, polygon = outer[0], list(outer)
    for hole in holes:
        back = hole[::-1] if (_area(hole) > 0.0) == (_area(outer) > 0.0) else hole
        polygon += [seam, *back, back[0]]
    return polygon


def _area(outline: _Outline) -> float:
    """Twice the area; negative where it runs clockwise."""
    x, y = (np.array(outline) - outline[0]).T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1))
