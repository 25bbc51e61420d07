"""The walk over draw commands that SVG and PDF share: as seen by a camera, in painting order, in runs of one style.

A format is a `VectorWriter`; `write_vectors` calls it for each element.
"""

from collections.abc import Callable
from itertools import groupby, pairwise
from typing import NamedTuple, Protocol

import numpy as np

from gamms import kernels
from gamms.ir.draw import DrawCommands, DrawKind, DrawSpace
from gamms.ir.graph import FloatArray, IntArray
from gamms.visual.appearance import Rgb, Rgba, is_dark
from gamms.visual.camera import FAINTEST_PX, Camera, find_touching, project_to_screen
from gamms.visual.font import EM

_SMALLEST_RADIUS = 5  # tenths of pixels
_BEYOND_PX = 8.0  # drawings this far outside may still reach into the picture

Point = tuple[int, int]


class VectorWriter(Protocol):
    """A format of vectors. All measures are tenths of pixels, the unit of rounding, with y down."""

    def begin(self, color: Rgba, width: int, *, is_outline: bool) -> None:
        """Begin the elements of a run, which have one kind and style; they are outlines or filled."""

    def end(self) -> None:
        """End the run; it may be empty."""

    def write_lines(self, lines: list[list[Point]]) -> None:
        """Write all lines of a run, each of at least two points, of which neighbors differ."""

    def write_circle(self, middle: Point, radius: int) -> None:
        """Write a circle."""

    def write_rectangle(self, corner: Point, width: int, height: int) -> None:
        """Write a rectangle below and to the right of a corner."""

    def write_polygon(self, corners: list[Point]) -> None:
        """Write a polygon."""

    def write_text(self, words: str, corner: Point, size: int, angle: float, halo: Rgb | None) -> None:
        """Write text below and to the right of a corner, around which it turns; a halo makes it readable over a map."""

    def write_image(self, path: str, middle: Point, half: int, angle: float) -> None:
        """Write an image file that turns around its middle, with half of its longer side."""


def write_vectors(commands: DrawCommands, camera: Camera, background: Rgba, writer: VectorWriter) -> None:
    """Write draw commands as seen by a camera over a background, from back to front."""
    sheet = _make_sheet(commands, camera, background)
    for begin, end in pairwise(kernels.find_equal_runs(sheet.kind, sheet.width, *sheet.color.T).tolist()):
        kind = DrawKind(int(sheet.kind[begin]))
        red, green, blue, alpha = sheet.color[begin].tolist()
        width = int(sheet.width[begin])
        writer.begin((red, green, blue, alpha), width, is_outline=kind is DrawKind.LINE or width > 0)
        if kind is DrawKind.LINE:
            lines = ([point for point, _ in groupby(sheet.list_points(row))] for row in range(begin, end))
            writer.write_lines([line for line in lines if len(line) > 1])  # the others shrank to a point
        else:
            for row in range(begin, end):
                _ELEMENTS[kind](sheet, row, writer)
        writer.end()


class _Sheet(NamedTuple):
    """All commands in painting order and in tenths of pixels."""

    kind: IntArray  # (commands,)
    color: "np.ndarray[tuple[int, ...], np.dtype[np.uint8]]"  # (commands, 4)
    size: IntArray  # (commands,)
    width: IntArray  # (commands,)
    angle: FloatArray  # (commands,)  degrees
    offsets: IntArray  # (commands + 1,)
    points: IntArray  # (points, 2)
    text: list[str]  # (commands,)
    paper: Rgb

    def list_points(self, row: int) -> list[Point]:
        """Return the points of one command."""
        return [(x, y) for x, y in self.points[self.offsets[row] : self.offsets[row + 1]].tolist()]


def _write_circle(sheet: _Sheet, row: int, writer: VectorWriter) -> None:
    radius = int(sheet.size[row])
    if radius >= _SMALLEST_RADIUS:
        writer.write_circle(sheet.list_points(row)[0], radius)


def _write_rectangle(sheet: _Sheet, row: int, writer: VectorWriter) -> None:
    corner, (width, height) = sheet.list_points(row)
    writer.write_rectangle(corner, width, height)


def _write_polygon(sheet: _Sheet, row: int, writer: VectorWriter) -> None:
    corners = sheet.list_points(row)
    writer.write_polygon(
        corners[1:] if corners[0] == corners[1] else corners
    )  # for a polygon in pixels, see `project_to_screen`


def _write_text(sheet: _Sheet, row: int, writer: VectorWriter) -> None:
    halo = sheet.paper if is_dark(sheet.color[row].tolist()) != is_dark(sheet.paper) else None
    writer.write_text(sheet.text[row], sheet.list_points(row)[0], int(sheet.size[row]), float(sheet.angle[row]), halo)


def _write_image(sheet: _Sheet, row: int, writer: VectorWriter) -> None:
    writer.write_image(sheet.text[row], sheet.list_points(row)[0], int(sheet.size[row]), float(sheet.angle[row]))


_ELEMENTS: dict[DrawKind, Callable[[_Sheet, int, VectorWriter], None]] = {
    DrawKind.CIRCLE: _write_circle,
    DrawKind.RECTANGLE: _write_rectangle,
    DrawKind.POLYGON: _write_polygon,
    DrawKind.TEXT: _write_text,
    DrawKind.IMAGE: _write_image,
}


def _make_sheet(commands: DrawCommands, camera: Camera, background: Rgba) -> _Sheet:
    """Return the view of a camera on draw commands over a background."""
    points = project_to_screen(commands, camera)
    scale = np.where(commands.space == DrawSpace.WORLD, camera.scale, 1.0)
    rows = _find_seen_rows(commands, camera, points, scale)
    take, offsets = kernels.select_runs(commands.offsets, rows)
    boxes = np.flatnonzero(commands.kind == DrawKind.RECTANGLE)
    font_scale = np.where(commands.kind == DrawKind.TEXT, EM, 1.0)
    points[commands.offsets[boxes] + 1] = commands.points[commands.offsets[boxes] + 1] * scale[boxes, None]
    return _Sheet(
        kind=commands.kind[rows],
        color=commands.color[rows],
        size=_round_to_tenths(commands.size * scale * font_scale)[rows],
        width=_round_to_tenths(_compute_widths_px(commands, scale))[rows],
        angle=commands.angle[rows],
        offsets=offsets,
        points=_round_to_tenths(points)[take],
        text=[commands.text[row] for row in rows.tolist()],
        paper=background[:3],
    )


def _find_seen_rows(commands: DrawCommands, camera: Camera, points: FloatArray, scale: FloatArray) -> IntArray:
    """Return the rows in painting order, without rows outside the picture."""
    rows = commands.in_painting_order()
    if len(rows) == 0:
        return rows
    letters = np.array([max(len(text), 1) for text in commands.text])
    reach = 2.0 * commands.size * scale * np.where(commands.kind == DrawKind.TEXT, letters, 1) + commands.width * scale
    low, high = (measure.reduceat(points, commands.offsets[:-1]) for measure in (np.minimum, np.maximum))
    box = (0.0, 0.0, float(camera.width), float(camera.height))
    margin = (reach + _BEYOND_PX)[:, None]
    is_seen = find_touching(low - margin, high + margin, box) | (commands.kind == DrawKind.RECTANGLE)
    seen: IntArray = rows[is_seen[rows]]
    return seen


def _compute_widths_px(commands: DrawCommands, scale: FloatArray) -> FloatArray:
    in_world = (commands.kind == DrawKind.LINE) & (commands.space == DrawSpace.WORLD)
    widths = np.where(in_world, np.maximum(commands.width * scale, FAINTEST_PX), commands.width)
    # An outline must not be rounded to 0, which means filled.
    return np.where(widths > 0.0, np.maximum(widths, 0.1), 0.0)


def _round_to_tenths(pixels: FloatArray) -> IntArray:
    return np.rint(pixels * 10.0).astype(np.int64)
