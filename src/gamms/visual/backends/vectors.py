"""Common code of SVG and PDF: draw commands as seen by a camera, in painting order and in runs of one style."""

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from gamms import kernels
from gamms.ir.draw import DrawCommands, DrawKind, DrawSpace
from gamms.ir.graph import FloatArray, IntArray
from gamms.visual.appearance import Rgb, Rgba, is_dark
from gamms.visual.camera import FAINTEST_PX, Camera, on_screen, touching
from gamms.visual.font import EM

SMALLEST_RADIUS_PX = 0.5
_BEYOND_PX = 8.0  # drawings this far outside may still reach into the picture


class VectorCommands(NamedTuple):
    """All commands in painting order and in tenths of pixels, the unit of rounding."""

    kind: IntArray  # (commands,)
    color: "np.ndarray[tuple[int, ...], np.dtype[np.uint8]]"  # (commands, 4)
    size: IntArray  # (commands,)
    width: IntArray  # (commands,)
    angle: FloatArray  # (commands,)  degrees
    offsets: IntArray  # (commands + 1,)
    points: IntArray  # (points, 2)
    text: list[str]  # (commands,)
    paper: Rgb

    def points_of(self, row: int) -> list[list[int]]:
        """Return the points of one command."""
        points: list[list[int]] = self.points[self.offsets[row] : self.offsets[row + 1]].tolist()
        return points

    def has_halo(self, row: int) -> bool:
        """Return whether text has an outline in the background color, to be readable over a map."""
        return is_dark(self.color[row].tolist()) != is_dark(self.paper)

    def runs(self) -> Iterator[tuple[int, int]]:
        """Yield (first row, last row + 1) of consecutive commands that are painted together."""
        yield from pairwise(kernels.equal_runs(self.kind, self.width, *self.color.T).tolist())


def sheet_of(commands: DrawCommands, camera: Camera, background: Rgba) -> VectorCommands:
    """Return the view of a camera on draw commands over a background."""
    points = on_screen(commands, camera)
    scale = np.where(commands.space == DrawSpace.WORLD, camera.scale, 1.0)
    rows = _seen(commands, camera, points, scale)
    take, offsets = kernels.chosen_runs(commands.offsets, rows)
    boxes = np.flatnonzero(commands.kind == DrawKind.RECTANGLE)
    font_scale = np.where(commands.kind == DrawKind.TEXT, EM, 1.0)
    points[commands.offsets[boxes] + 1] = commands.points[commands.offsets[boxes] + 1] * scale[boxes, None]
    return VectorCommands(
        kind=commands.kind[rows],
        color=commands.color[rows],
        size=_tenths(commands.size * scale * font_scale)[rows],
        width=_tenths(_widths_px(commands, scale))[rows],
        angle=commands.angle[rows],
        offsets=offsets,
        points=_tenths(points)[take],
        text=[commands.text[row] for row in rows.tolist()],
        paper=background[:3],
    )


def _seen(commands: DrawCommands, camera: Camera, points: FloatArray, scale: FloatArray) -> IntArray:
    """Return the rows in painting order, without rows outside the picture."""
    rows = commands.in_painting_order()
    if len(rows) == 0:
        return rows
    letters = np.array([max(len(text), 1) for text in commands.text])
    reach = 2.0 * commands.size * scale * np.where(commands.kind == DrawKind.TEXT, letters, 1) + commands.width * scale
    low, high = (measure.reduceat(points, commands.offsets[:-1]) for measure in (np.minimum, np.maximum))
    box = (0.0, 0.0, float(camera.width), float(camera.height))
    margin = (reach + _BEYOND_PX)[:, None]
    is_seen = touching(low - margin, high + margin, box) | (commands.kind == DrawKind.RECTANGLE)
    seen: IntArray = rows[is_seen[rows]]
    return seen


def _widths_px(commands: DrawCommands, scale: FloatArray) -> FloatArray:
    in_world = (commands.kind == DrawKind.LINE) & (commands.space == DrawSpace.WORLD)
    widths = np.where(in_world, np.maximum(commands.width * scale, FAINTEST_PX), commands.width)
    # An outline must not be rounded to 0, which means filled.
    return np.where(widths > 0.0, np.maximum(widths, 0.1), 0.0)


def _tenths(pixels: FloatArray) -> IntArray:
    return np.rint(pixels * 10.0).astype(np.int64)
