"""MP4 files with PyAV. Between two frames only a few agents move, so only tiles that differ are converted."""

from pathlib import Path
from queue import Queue
from threading import Thread
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from gamms.plugins import needing
from gamms.visual.backends.coverage import ByteArray, PaintedFrame, PixelArray

if TYPE_CHECKING:
    from av import VideoFrame
    from av.video.reformatter import VideoReformatter


# pixels: size of a tile, and of its border, because colors are mixed with neighbors
TILE = 64
BORDER = 4
SIDE = TILE + 2 * BORDER
STRIP = 8  # tiles that are converted at once, side by side, because converters are fast for long rows
MOST = 64  # number of tiles from which the whole frame is converted


class ChangedTile(NamedTuple):
    """A changed tile of a picture: its position, and the upper left corner of the tile with its border."""

    left: int
    top: int
    corner: tuple[int, int]


def squares(before: PixelArray, now: PixelArray) -> list[ChangedTile] | None:
    """Return the tiles in which two frames differ; None if there are too many, or the picture is too small."""
    height, width = now.shape
    if min(width, height) < SIDE:
        return None
    differs = before.view(np.uint64) != now.view(np.uint64)  # two pixels each
    by_row = np.array([differs[top : top + TILE].any(axis=0) for top in range(0, height, TILE)])
    rows, columns = np.nonzero(np.logical_or.reduceat(by_row, np.arange(0, width // 2, TILE // 2), axis=1))
    if len(rows) > MOST:
        return None
    places = zip((columns * TILE).tolist(), (rows * TILE).tolist(), strict=True)
    return [_square(left, top, width, height) for left, top in places]


def _square(left: int, top: int, width: int, height: int) -> ChangedTile:
    corner = min(max(left - BORDER, 0), width - SIDE), min(max(top - BORDER, 0), height - SIDE)
    return ChangedTile(left, top, corner)


def planes_of(frame: "VideoFrame") -> list[ByteArray]:
    """Return the planes of a PyAV frame as writable arrays (rows, columns)."""
    found = []
    for plane in frame.planes:
        rows = np.frombuffer(memoryview(plane), np.uint8).reshape(plane.height, plane.line_size)
        found.append(rows[:, : plane.width * (4 if frame.format.name == "bgra" else 1)])
    return found


def paste(planes: list[ByteArray], parts: list[ByteArray], tiles: list[ChangedTile]) -> None:
    """Copy tiles into the planes of a picture whose second and third plane have half the size.

    Args:
        planes: planes of the picture.
        parts: planes of the tiles with borders, side by side.
        tiles: positions of the tiles.
    """
    for plane, part, share in zip(planes, parts, (1, 2, 2), strict=True):
        side = SIDE // share
        for number, (left, top, (x, y)) in enumerate(tiles):
            down = (top - y) // share
            across = number * side + (left - x) // share
            place = plane[top // share : (top + TILE) // share, left // share : (left + TILE) // share]
            rows, columns = place.shape
            place[:] = part[down : down + rows, across : across + columns]


_AHEAD = 8  # frames waiting for the encoder
# A fixed number of threads, so that equal frames give equal bytes on every machine. One thread, because it runs
# beside the painter already; two take half as much again for synchronization. The macroblock tree of x264 reads
# memory that it has not written, so that equal frames sometimes gave different bytes; 23 without it looks better than
# 20 with it.
_OPTIONS = {"preset": "veryfast", "crf": "23", "mbtree": "0", "threads": "1"}


class Mp4:
    """Encodes H.264 in parallel with the painter, so that a film takes little longer than the slower of the two.

    Raises:
        MissingExtra: PyAV is not installed.
    """

    def __init__(self, path: Path, width: int, height: int, fps: float) -> None:
        with needing("Writing an MP4 film", "video"):
            import av
        from fractions import Fraction

        from av.video.reformatter import VideoReformatter

        self._frame: Any = av.VideoFrame(width, height, "bgra")
        self._strip: Any = av.VideoFrame(SIDE * STRIP, SIDE, "bgra")
        # Pixels of the previous frame, and of tiles to be converted.
        self._pixels, self._squares = (planes_of(one)[0].view(np.uint32) for one in (self._frame, self._strip))
        self._reformatters: tuple[Any, Any] = VideoReformatter(), VideoReformatter()  # each knows one size
        self._few = _one_thread(self._reformatters[1], self._strip)
        self._converted: Any = None  # the previous frame, in the color format of the encoder
        # The index comes first, so that browsers can start before the whole file is loaded.
        self._file: Any = av.open(str(path), "w", format="mp4", options={"movflags": "+faststart"})
        rate = Fraction(fps).limit_denominator(1001)
        self._number = 0
        self._time_base = 1 / rate
        self._stream = self._file.add_stream("libx264", rate=rate, options=_OPTIONS)
        self._stream.width = width
        self._stream.height = height
        self._stream.pix_fmt = "yuv420p"
        self._waiting: Queue[Any] = Queue()
        self._free: Queue[Any] = Queue()  # new memory for every frame would cost more than filling it
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
        pixels = picture.bgrx()
        tiles = squares(self._pixels, pixels) if self._number else None
        if tiles is None:
            self._pixels[:] = pixels
            self._converted = self._reformatters[0].reformat(self._frame, format="yuv420p")
        elif tiles:
            self._change(pixels, tiles)
        frame = self._free.get()
        for mine, its in zip(planes_of(self._converted), planes_of(frame), strict=True):
            its[:] = mine
        frame.pts = self._number
        frame.time_base = self._time_base
        self._number = self._number + 1
        self._waiting.put(frame)
        self._raise()

    def finish(self) -> None:
        """Write the remaining frames.

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
        """Stop writing; the file is incomplete."""
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

    def _change(self, pixels: PixelArray, tiles: list[ChangedTile]) -> None:
        """Update tiles of the previous frame, which the encoder has already copied."""
        planes = planes_of(self._converted)
        for begin in range(0, len(tiles), STRIP):
            some = tiles[begin : begin + STRIP]
            for number, (_, _, (x, y)) in enumerate(some):
                self._squares[:, number * SIDE : (number + 1) * SIDE] = pixels[y : y + SIDE, x : x + SIDE]
            converted = self._reformatters[1].reformat(self._strip, format="yuv420p", **self._few)
            paste(planes, planes_of(converted), some)
        for left, top, _ in tiles:
            tile = slice(top, top + TILE), slice(left, left + TILE)
            self._pixels[tile] = pixels[tile]


def _one_thread(reformatter: "VideoReformatter", frame: "VideoFrame") -> dict[str, int]:
    """Return keywords that keep PyAV from dividing a few pixels among all processors, which is slower."""
    try:
        reformatter.reformat(frame, format="yuv420p", threads=1)
    except TypeError:  # an old version without these keywords
        return {}
    return {"threads": 1}
