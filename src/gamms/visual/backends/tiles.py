"""Tiles: where a film's frame differs from the one before, as squares that are turned into the encoder's colours alone.

Between two frames a few agents move. Copying and converting all pixels would take as long as encoding them.
"""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np

from gamms.visual.backends.coverage import ByteArray, PixelArray

TILE, BORDER = 64, 4  # pixels; of a square, and around it, for colours are mixed from neighbours
SIDE = TILE + 2 * BORDER
STRIP = 8  # squares that are converted at once, side by side: long rows are what converters are fast with
MOST = 64  # of more of them it is faster to convert everything


class PaintedFrame(Protocol):
    """A frame of a film."""

    def pixels(self) -> ByteArray:
        """RGB, as (height, width, 3), of its own."""

    def copy_bgrx(self, buffer: bytearray) -> None:
        """Write blue, green, red and a byte without meaning, row by row: the fastest way to an encoder."""

    def changes(self) -> list[tuple[int, int, int, int]] | None:
        """Left, top, width and height of where it may differ from the frame before; None: anywhere."""

    def cut(self, corners: Sequence[tuple[int, int]], strip: PixelArray) -> None:
        """Write squares, by their upper left corners, side by side into a strip (side, sides); see `copy_bgrx`."""


class Square(NamedTuple):
    """A tile of a picture: its place, and the upper left corner of the larger square around it."""

    left: int
    top: int
    corner: tuple[int, int]


def squares(boxes: Iterable[tuple[int, int, int, int]], width: int, height: int) -> list[Square] | None:
    """The tiles that boxes touch; None where there are too many, or the picture is too small."""
    if min(width, height) < SIDE:
        return None
    blocks = {  # most boxes are small and many lie in the same tiles
        (max(left, 0) // TILE, max(top, 0) // TILE, (min(left + across, width) - 1) // TILE, (top + down - 1) // TILE)
        for left, top, across, down in set(boxes)
        if across and down
    }
    lowest = (height - 1) // TILE
    found = {
        (x, y)
        for left, top, right, bottom in blocks
        for x in range(left, right + 1)
        for y in range(top, min(bottom, lowest) + 1)
    }
    if len(found) > MOST:
        return None
    return [_square(x * TILE, y * TILE, width, height) for x, y in sorted(found)]


def _square(left: int, top: int, width: int, height: int) -> Square:
    corner = min(max(left - BORDER, 0), width - SIDE), min(max(top - BORDER, 0), height - SIDE)
    return Square(left, top, corner)


def planes_of(frame: Any) -> list[ByteArray]:
    """The planes of a frame of PyAV as arrays (rows, columns) that can be written to."""
    found = []
    for plane in frame.planes:
        rows = np.frombuffer(plane, np.uint8).reshape(plane.height, plane.line_size)
        found.append(rows[:, : plane.width * (4 if frame.format.name == "bgra" else 1)])
    return found


def paste(planes: list[ByteArray], parts: list[ByteArray], tiles: list[Square]) -> None:
    """Put tiles into the planes of a picture whose second and third plane are half as large.

    Args:
        planes: of the picture.
        parts: of the squares around the tiles, side by side.
        tiles: where they belong.
    """
    for plane, part, share in zip(planes, parts, (1, 2, 2), strict=True):
        side = SIDE // share
        for number, (left, top, (x, y)) in enumerate(tiles):
            down, across = (top - y) // share, number * side + (left - x) // share
            place = plane[top // share : (top + TILE) // share, left // share : (left + TILE) // share]
            rows, columns = place.shape
            place[:] = part[down : down + rows, across : across + columns]
