"""MP4 files by PyAV. Between two frames a few agents move, so only the squares that differ are converted."""

from collections.abc import Iterable
from pathlib import Path
from queue import Queue
from threading import Thread
from typing import Any, NamedTuple

import numpy as np

from gamms.errors import MissingExtra
from gamms.visual.backends import PaintedFrame
from gamms.visual.backends.coverage import ByteArray

TILE, BORDER = 64, 4  # pixels; of a square, and around it, for colours are mixed from neighbours
SIDE = TILE + 2 * BORDER
STRIP = 8  # squares that are converted at once, side by side: long rows are what converters are fast with
MOST = 64  # of more of them it is faster to convert everything


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


_AHEAD = 8  # frames that wait for the encoder
# A fixed number of threads, so that the same frames give the same bytes on every machine. It is one, for that one works
# beside the painter already; two cost half as much again in waiting for each other.
_OPTIONS = {"preset": "veryfast", "crf": "20", "threads": "1"}


class Mp4:
    """Writes H.264 beside the program that paints, so that a film takes little longer than its slower half.

    Raises:
        MissingExtra: PyAV is not installed.
    """

    def __init__(self, path: Path, width: int, height: int, fps: float) -> None:
        try:
            import av
        except ImportError as error:
            raise MissingExtra("Writing an MP4 film", "video") from error
        from fractions import Fraction

        from av.video.reformatter import VideoReformatter

        self._size = width, height
        self._frame: Any = av.VideoFrame(width, height, "bgra")
        self._strip: Any = av.VideoFrame(SIDE * STRIP, SIDE, "bgra")
        self._pixels, self._squares = planes_of(self._frame)[0], planes_of(self._strip)[0].view(np.uint32)
        self._reformatters: tuple[Any, Any] = VideoReformatter(), VideoReformatter()  # each knows one size
        self._few = _one_thread(self._reformatters[1], self._strip)
        self._converted: Any = None  # the frame before, in the colours of the encoder
        # The index comes first, so that a browser can begin before it has all.
        self._file: Any = av.open(str(path), "w", format="mp4", options={"movflags": "+faststart"})
        rate = Fraction(fps).limit_denominator(1001)
        self._number, self._time_base = 0, 1 / rate
        self._stream = self._file.add_stream("libx264", rate=rate, options=_OPTIONS)
        self._stream.width, self._stream.height, self._stream.pix_fmt = width, height, "yuv420p"
        self._buffer = bytearray(4 * width * height)
        self._waiting: Queue[Any] = Queue()
        self._free: Queue[Any] = Queue()  # fresh memory for every frame would cost more than filling it
        for _ in range(_AHEAD):
            self._free.put(av.VideoFrame(width, height, "yuv420p"))
        self._error: BaseException | None = None
        self._thread = Thread(target=self._encode, name="gamms-film", daemon=True)
        self._thread.start()

    def add(self, picture: PaintedFrame) -> None:
        """Add a frame.

        Raises:
            OSError: the file cannot be written.
        """
        boxes = picture.changes() if self._number else None
        tiles = None if boxes is None else squares(boxes, *self._size)
        if tiles is None:
            self._convert(picture)
        elif tiles:
            self._change(picture, tiles)
        frame = self._free.get()
        for mine, its in zip(planes_of(self._converted), planes_of(frame), strict=True):
            its[:] = mine
        frame.pts, frame.time_base, self._number = self._number, self._time_base, self._number + 1
        self._waiting.put(frame)
        self._raise()

    def finish(self) -> None:
        """Write what is left.

        Raises:
            OSError: the file cannot be written.
        """
        self._waiting.put(None)
        self._thread.join()
        try:
            self._raise()
            self._file.mux(self._stream.encode(None))
        finally:
            self._file.close()

    def discard(self) -> None:
        """Stop; what was written is of no use."""
        self._waiting.put(None)
        self._thread.join()
        self._file.close()

    def _encode(self) -> None:
        while (frame := self._waiting.get()) is not None:
            try:
                if self._error is None:
                    self._file.mux(self._stream.encode(frame))
            except BaseException as error:  # noqa: BLE001 - it is raised where frames are added
                self._error = error
            finally:
                self._free.put(frame)

    def _raise(self) -> None:
        if self._error is not None:
            raise self._error

    def _convert(self, picture: PaintedFrame) -> None:
        """Turn all of a picture into the colours of the encoder."""
        picture.copy_bgrx(self._buffer)
        self._pixels[:] = np.frombuffer(self._buffer, np.uint8).reshape(self._pixels.shape)
        self._converted = self._reformatters[0].reformat(self._frame, format="yuv420p")

    def _change(self, picture: PaintedFrame, tiles: list[Square]) -> None:
        """Put tiles of a picture into the frame before; the encoder has copied that by now."""
        planes = planes_of(self._converted)
        for begin in range(0, len(tiles), STRIP):
            some = tiles[begin : begin + STRIP]
            picture.cut([tile.corner for tile in some], self._squares)
            converted = self._reformatters[1].reformat(self._strip, format="yuv420p", **self._few)
            paste(planes, planes_of(converted), some)


def _one_thread(reformatter: Any, frame: Any) -> dict[str, int]:
    """What keeps PyAV from sharing out a few pixels among all processors, which takes longer than the work itself."""
    try:
        reformatter.reformat(frame, format="yuv420p", threads=1)
    except TypeError:  # an old version, which does not
        return {}
    return {"threads": 1}
