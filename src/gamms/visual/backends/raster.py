"""Raster graphics: draw commands as pixels, painted through a camera.

`Painting` prepares commands once; it can then be painted through any camera, at little cost for invisible parts.
"""

from collections.abc import Callable, Iterator
from functools import lru_cache
from itertools import pairwise
from math import ceil
from typing import Any, NamedTuple

import numpy as np

from gamms import kernels
from gamms.ir.draw import DrawCommands, DrawKind, DrawSpace
from gamms.ir.graph import FloatArray, IntArray
from gamms.visual.appearance import Rgba
from gamms.visual.backends.pillow_backend import EDGE_PX, ByteArray, Patch, compute_polygons
from gamms.visual.backends.pygame_backend import Canvas, make_stamp
from gamms.visual.camera import CSS_DPI, FAINTEST_PX, Camera, clip_lines, find_extent, find_touching

_SMALLEST_RADIUS_PX = 0.5
_THINNEST_PX = 1.0  # minimum width of lines in world units
_BEYOND_PX = 8.0  # lines are clipped this far outside the picture
_LARGEST_STAMP_PX = 96.0
_OPAQUE = 255
_STEPS = 4  # positions of a stamp within a pixel
_CORNER_PX = 4.0  # maximum distance between the corners of round ends


class Painting:
    """Draw commands in runs that are painted together."""

    def __init__(self, commands: DrawCommands) -> None:
        self.commands = commands
        rows = commands.in_painting_order()
        self._runs = [_RUNS[kind](commands, rows[begin:end]) for kind, begin, end in _split_into_runs(commands, rows)]

    def paint(self, canvas: Canvas, camera: Camera) -> None:
        """Paint the part visible to a camera, from back to front."""
        for run in self._runs:
            run(canvas, camera)


_Run = Callable[[Canvas, Camera], None]


def _split_into_runs(commands: DrawCommands, rows: IntArray) -> Iterator[tuple[DrawKind, int, int]]:
    """Yield (kind, first, last + 1) of consecutive commands of one style."""
    kind = commands.kind[rows]
    has_style = np.isin(kind, (DrawKind.LINE, DrawKind.POLYGON))
    styles = (commands.width, commands.space, *commands.color.T)
    offsets = kernels.find_equal_runs(kind, *(np.where(has_style, column[rows], 0) for column in styles))
    for begin, end in pairwise(offsets.tolist()):
        yield DrawKind(int(kind[begin])), begin, end


def _compute_view(camera: Camera, margin_px: float) -> tuple[float, float, float, float]:
    """Return the left, low, right and high end of a camera's view plus a margin in pixels, world units."""
    margin = margin_px / camera.scale
    right = camera.left + camera.width / camera.scale
    low = camera.top - camera.height / camera.scale
    return camera.left - margin, low - margin, right + margin, camera.top + margin


def _get_color(commands: DrawCommands, row: int) -> Rgba:
    red, green, blue, alpha = commands.color[row].tolist()
    return red, green, blue, alpha


# -- lines --------------------------------------------------------------------------------------------------


class _Lines:
    """Polylines of one style, as line segments with their bounding boxes."""

    def __init__(self, commands: DrawCommands, rows: IntArray) -> None:
        _, first = kernels.expand_ranges(commands.offsets[rows], commands.offsets[rows + 1] - 1)
        self.starts = commands.points[first]
        self.ends = commands.points[first + 1]
        self.low = np.minimum(self.starts, self.ends)
        self.high = np.maximum(self.starts, self.ends)
        row = int(rows[0])
        self.color = _get_color(commands, row)
        self.width = float(commands.width[row])
        self.is_in_world = bool(commands.space[row] == DrawSpace.WORLD)

    def __call__(self, canvas: Canvas, camera: Camera) -> None:
        width_px = self.width
        color = self.color
        if self.is_in_world:  # lines thinner than a pixel become paler
            red, green, blue, alpha = color
            exact = max(width_px * camera.scale, FAINTEST_PX)
            width_px = max(exact, _THINNEST_PX)
            color = (red, green, blue, round(alpha * min(exact, 1.0)))
        seen = find_touching(self.low, self.high, _compute_view(camera, width_px + _BEYOND_PX))
        if not seen.any() or width_px == 0.0 or color[3] == 0:
            return
        starts = camera.to_screen(self.starts[seen])
        ends = camera.to_screen(self.ends[seen])
        draw_lines(canvas, starts, ends, width_px, color)


def draw_lines(canvas: Canvas, starts: FloatArray, ends: FloatArray, width_px: float, color: Rgba) -> None:
    """Paint line segments (lines, 2), in pixels."""
    margin = width_px + _BEYOND_PX
    low = (-margin, -margin)
    high = (canvas.width + margin, canvas.height + margin)
    lowest, highest = find_extent(starts, ends)
    if (lowest < low).any() or (highest > high).any():
        starts, ends = clip_lines(starts, ends, low, high)
    if len(starts) == 0:
        return
    if width_px == _THINNEST_PX:
        canvas.draw_hairlines(starts, ends, color)
        return
    patch = compute_strokes(starts, ends, width_px, canvas.width, canvas.height)
    if patch is not None:
        canvas.cover(patch, color)


def compute_strokes(starts: FloatArray, ends: FloatArray, width_px: float, width: int, height: int) -> Patch | None:
    """Return the coverage of lines with round ends, clipped to a picture; overlaps count once.

    Args:
        starts: (lines, 2), pixels.
        ends: (lines, 2), pixels.
        width_px: width of every line; lines thinner than a pixel become paler.
        width: width of the picture.
        height: height of the picture.
    """
    corners = _outline_lines(starts, ends, max(width_px, 1.0) / 2 - EDGE_PX)
    offsets = np.arange(len(corners) + 1) * corners.shape[1]
    patch = compute_polygons(corners.reshape(-1, 2), offsets, width, height)
    if patch is None or width_px >= 1.0:
        return patch
    return patch._replace(coverage=np.rint(patch.coverage * width_px).astype(np.uint8))


def _outline_lines(starts: FloatArray, ends: FloatArray, half: float) -> FloatArray:
    """Return the outlines (lines, corners, 2) of lines with round ends and half a width, all in one direction."""
    ways = ends - starts
    headings = np.arctan2(ways[:, 1], ways[:, 0])
    corners = 2 + int(np.pi * half / _CORNER_PX) + 2 * (half > 1.0)
    turns = np.linspace(np.pi / 2, 3 * np.pi / 2, corners)
    angles = headings[:, None] + np.concatenate([turns, turns + np.pi])
    middles = np.repeat(np.stack([starts, ends], axis=1), corners, axis=1)
    return middles + half * np.stack([np.cos(angles), np.sin(angles)], axis=2)


# -- circles ------------------------------------------------------------------------------------------------


class _Circles:
    """Circles of any size and color."""

    def __init__(self, commands: DrawCommands, rows: IntArray) -> None:
        self.centers = commands.points[commands.offsets[rows]]
        self.shift = np.zeros((len(rows), 2))
        is_moved = commands.offsets[rows + 1] - commands.offsets[rows] == 2
        self.shift[is_moved] = commands.points[commands.offsets[rows[is_moved]] + 1]
        self.size = commands.size[rows]
        self.width = commands.width[rows]
        self.color = commands.color[rows]
        self.is_in_world = commands.space[rows] == DrawSpace.WORLD
        self.largest_in_world = float(self.size[self.is_in_world].max(initial=0.0))
        self.largest_px, self.widest_px, self.farthest_px = (
            float(px.max(initial=0.0)) for px in (self.size[~self.is_in_world], self.width, np.abs(self.shift))
        )

    def __call__(self, canvas: Canvas, camera: Camera) -> None:
        radius = self.size * np.where(self.is_in_world, camera.scale, 1.0)
        farthest = max(self.largest_in_world * camera.scale, self.largest_px) + self.widest_px + _BEYOND_PX
        near = find_touching(self.centers, self.centers, _compute_view(camera, farthest + self.farthest_px))
        near &= (radius >= _SMALLEST_RADIUS_PX) & (self.color[:, 3] > 0)
        columns: tuple[np.ndarray[Any, Any], ...] = (self.centers, self.shift, radius, self.width, self.color)
        centers, shift, radius, width, color = (column[near] for column in columns)
        centers = camera.to_screen(centers) + shift
        reach = (radius + width)[:, None] + 1.0
        inside = find_touching(centers - reach, centers + reach, (0.0, 0.0, canvas.width, canvas.height))
        seen = np.flatnonzero(inside)
        is_small = (radius + width)[seen] <= _LARGEST_STAMP_PX
        for begin, end in pairwise(kernels.find_equal_runs(is_small).tolist()):
            rows = seen[begin:end]
            paint = _stamp_circles if is_small[begin] else _draw_large_circles
            paint(canvas, centers[rows], radius[rows], width[rows], color[rows])


def _stamp_circles(
    canvas: Canvas, centers: FloatArray, radius: FloatArray, width: FloatArray, color: ByteArray
) -> None:
    sizes = np.rint(np.column_stack([radius, width]) * 10)
    reach = np.ceil(sizes[:, 0] / 10 + sizes[:, 1] / 10 / 2) + 1  # as of the stamp
    corner = centers - reach[:, None]
    whole = np.floor(corner)
    steps = (corner - whole) * _STEPS
    looks = np.column_stack([sizes, steps, color]).astype(np.int32)
    keys = looks.view(f"V{looks.itemsize * looks.shape[1]}").ravel().tolist()  # bytes
    stamps = {key: _make_stamp(key) for key in set(keys)}
    x, y = whole.astype(np.int64).T.tolist()
    # NOTE: never a list of pairs, which triggers the garbage collector (first frame of 100,000 edges).
    canvas.draw_stamps(zip(map(stamps.__getitem__, keys), zip(x, y, strict=True), strict=True))


@lru_cache(maxsize=8192)
def _make_stamp(look: bytes) -> Any:
    """Return a circle as a surface: radius and width in tenths of pixels, position within a pixel, and color."""
    radius, width, right, down, *color = np.frombuffer(look, np.int32).tolist()
    radius /= 10
    width /= 10
    reach = ceil(radius + width / 2) + 1
    x, y = (reach + (step + 0.5) / _STEPS for step in (right, down))
    side = 2 * reach + 1
    full = np.zeros((side, side), np.uint8)
    patch = make_disc(x, y, *_compute_ring(radius, width), side, side)
    if patch is not None:
        rows, columns = patch.coverage.shape
        full[patch.top : patch.top + rows, patch.left : patch.left + columns] = patch.coverage
    return make_stamp(full, tuple(color))


def make_disc(x: float, y: float, outer: float, inner: float, width: int, height: int) -> Patch | None:
    """Return a disc of radius `outer` px with a hole of radius `inner`, clipped to a picture; None if it is empty."""
    left = max(0, int(np.floor(x - outer - 1)))
    top = max(0, int(np.floor(y - outer - 1)))
    right = min(width, int(np.ceil(x + outer + 1)))
    bottom = min(height, int(np.ceil(y + outer + 1)))
    if left >= right or top >= bottom:
        return None
    across = np.arange(left, right) + 0.5 - x
    down = np.arange(top, bottom) + 0.5 - y
    distance = np.hypot(across, down[:, None])
    covered = np.clip(outer + 0.5 - distance, 0.0, 1.0)
    if inner > 0.0:
        covered -= np.clip(inner + 0.5 - distance, 0.0, 1.0)
    return Patch(np.rint(np.maximum(covered, 0.0) * 255.0).astype(np.uint8), left, top)


def _compute_ring(radius: float, width: float) -> tuple[float, float]:
    """Return the outer and inner radius; 0 for a disc without a hole."""
    return (radius, 0.0) if width == 0.0 else (radius + width / 2, max(radius - width / 2, 0.0))


def _draw_large_circles(
    canvas: Canvas, centers: FloatArray, radius: FloatArray, width: FloatArray, color: ByteArray
) -> None:
    columns = (centers.tolist(), radius.tolist(), width.tolist(), color.tolist())
    for (x, y), r, w, (red, green, blue, alpha) in zip(*columns, strict=True):
        patch = make_disc(x, y, *_compute_ring(r, w), canvas.width, canvas.height)
        if patch is not None:
            canvas.cover(patch, (red, green, blue, alpha))


# -- single commands ------------------------------------------------------------------------------------------


class _SingleCommands:
    """Rectangles, texts and images, painted one by one."""

    def __init__(self, commands: DrawCommands, rows: IntArray) -> None:
        self.commands = commands
        self.rows = rows.tolist()
        kind = DrawKind(int(commands.kind[rows[0]]))
        self.paint = _SINGLE[kind]

    def __call__(self, canvas: Canvas, camera: Camera) -> None:
        for row in self.rows:
            self.paint(canvas, camera, _Command.from_row(self.commands, row, camera))


class _Polygons:
    """Polygons of one style; opaque ones are filled together, transparent ones one by one, so that they blend."""

    def __init__(self, commands: DrawCommands, rows: IntArray) -> None:
        self.color = _get_color(commands, int(rows[0]))
        self.width = float(commands.width[rows[0]])
        take, self.offsets = kernels.select_runs(commands.offsets, rows)
        # world units, and pixels
        self.points = commands.points[take]
        self.shifts = np.zeros((len(take), 2))
        first = self.offsets[:-1]
        if commands.space[rows[0]] == DrawSpace.SCREEN:
            self.shifts = self.points
            self.points = np.repeat(self.points[first], np.diff(self.offsets), axis=0)
            self.shifts[first] = self.shifts[first + 1]
        self.low, self.high = (measure.reduceat(self.points, first) for measure in (np.minimum, np.maximum))
        self.margin_px = self.width + float(np.abs(self.shifts).max())

    def __call__(self, canvas: Canvas, camera: Camera) -> None:
        seen = find_touching(self.low, self.high, _compute_view(camera, self.margin_px))
        if not seen.any() or self.color[3] == 0:
            return
        take, offsets = kernels.select_runs(self.offsets, np.flatnonzero(seen))
        points = camera.to_screen(self.points[take]) + self.shifts[take]
        if self.width > 0.0 or self.color[3] < _OPAQUE:
            for begin, end in pairwise(offsets.tolist()):
                _draw_polygon(canvas, points[begin:end], self.width, self.color)
            return
        patch = compute_polygons(points, offsets, camera.width, camera.height)
        if patch is not None:
            canvas.cover(patch, self.color)


class _Command(NamedTuple):
    """One command, in pixels."""

    points: FloatArray  # (points, 2)
    size: float
    width: float
    angle: float
    color: Rgba
    text: str
    extent: FloatArray  # of a rectangle, in its own unit

    @classmethod
    def from_row(cls, commands: DrawCommands, row: int, camera: Camera) -> "_Command":
        """Return one command as seen by a camera."""
        points = commands.points[commands.offsets[row] : commands.offsets[row + 1]]
        scale = camera.scale if commands.space[row] == DrawSpace.WORLD else 1.0
        return cls(
            points=camera.to_screen(points),
            size=float(commands.size[row]) * scale,
            width=float(commands.width[row]),
            angle=float(commands.angle[row]),
            color=_get_color(commands, row),
            text=commands.text[row],
            extent=points[-1] * scale,
        )


def _draw_rectangle(canvas: Canvas, camera: Camera, command: _Command) -> None:  # noqa: ARG001 - as of all kinds
    x, y = command.points[0].tolist()
    width, height = command.extent.tolist()
    if command.width == 0.0:
        canvas.draw_rectangle(x, y, width, height, command.color)
        return
    corners = np.array([(x, y), (x + width, y), (x + width, y + height), (x, y + height)])
    _draw_polygon(canvas, corners, command.width, command.color)


def _draw_polygon(canvas: Canvas, points: FloatArray, width_px: float, color: Rgba) -> None:
    low = points.min(axis=0) - width_px
    high = points.max(axis=0) + width_px
    if (high < 0).any() or (low > (canvas.width, canvas.height)).any() or color[3] == 0:
        return
    if width_px > 0.0:
        draw_lines(canvas, points, np.roll(points, -1, axis=0), width_px, color)
        return
    patch = compute_polygons(points, np.array([0, len(points)]), canvas.width, canvas.height)
    if patch is not None:
        canvas.cover(patch, color)


def _draw_text(canvas: Canvas, camera: Camera, command: _Command) -> None:
    x, y = command.points[0].tolist()
    reach = 2.0 * command.size * len(command.text)  # an upper bound of the width
    if -reach < x < camera.width + reach and -reach < y < camera.height + reach:
        canvas.draw_text(command.text, x, y, command.size, command.color, angle=command.angle)


def _draw_image(canvas: Canvas, camera: Camera, command: _Command) -> None:
    x, y = command.points[0].tolist()
    reach = 1.5 * command.size
    is_seen = -reach < x < camera.width + reach and -reach < y < camera.height + reach
    if is_seen and command.size >= _SMALLEST_RADIUS_PX:
        canvas.draw_image(command.text, x, y, 2 * command.size, command.angle)


_SINGLE = {
    DrawKind.RECTANGLE: _draw_rectangle,
    DrawKind.TEXT: _draw_text,
    DrawKind.IMAGE: _draw_image,
}
_RUNS: dict[DrawKind, Callable[[DrawCommands, IntArray], _Run]] = {
    DrawKind.LINE: _Lines,
    DrawKind.CIRCLE: _Circles,
    DrawKind.POLYGON: _Polygons,
    **dict.fromkeys(_SINGLE, _SingleCommands),
}


# -- whole pictures -----------------------------------------------------------------------------------------


def paint_picture(commands: DrawCommands, camera: Camera, background: Rgba) -> Canvas:
    """Paint a whole picture."""
    canvas = Canvas(camera.width, camera.height, paper=background[:3])
    canvas.fill(background)
    Painting(commands).paint(canvas, camera)
    return canvas


def write_png(commands: DrawCommands, camera: Camera, *, title: str, background: Rgba, dpi: float = CSS_DPI) -> bytes:  # noqa: ARG001 - of every format
    """Return the picture as a PNG file.

    Raises:
        MissingExtra: pygame or Pillow is not installed.
    """
    from gamms.visual.backends.pillow_backend import encode_png

    return encode_png(paint_picture(commands, camera, background).pixels(), dpi)
