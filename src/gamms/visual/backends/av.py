"""The one door to PyAV: MP4 files."""

from pathlib import Path
from queue import Queue
from threading import Thread
from typing import Any

import numpy as np

from gamms.errors import MissingExtra
from gamms.visual.backends import PaintedFrame
from gamms.visual.backends.tiles import SIDE, STRIP, Square, paste, planes_of, squares

_AHEAD = 8  # frames that wait for the encoder
# A fixed number of threads, so that the same frames give the same bytes on every machine.
_OPTIONS = {"preset": "veryfast", "crf": "20", "threads": "2"}

_Frame = bytearray | tuple[list[Square], Any]  # all pixels, or tiles that differ from the frame before


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
        self._strip: Any = av.VideoFrame(SIDE, SIDE * STRIP, "bgra")
        self._pixels, self._squares = planes_of(self._frame)[0], planes_of(self._strip)[0]
        self._reformatters: tuple[Any, Any] = VideoReformatter(), VideoReformatter()  # each knows one size
        self._converted: Any = None  # the frame before, in the colours of the encoder
        # The index comes first, so that a browser can begin before it has all.
        self._file: Any = av.open(str(path), "w", format="mp4", options={"movflags": "+faststart"})
        rate = Fraction(fps).limit_denominator(1001)
        self._number, self._time_base = 0, 1 / rate
        self._stream = self._file.add_stream("libx264", rate=rate, options=_OPTIONS)
        self._stream.width, self._stream.height, self._stream.pix_fmt = width, height, "yuv420p"
        self._waiting: Queue[_Frame | None] = Queue(_AHEAD)
        self._free: Queue[bytearray] = Queue()  # fresh memory for every frame would cost more than filling it
        for _ in range(_AHEAD):
            self._free.put(bytearray(4 * width * height))
        self._has_begun = False
        self._error: BaseException | None = None
        self._thread = Thread(target=self._encode, name="gamms-film", daemon=True)
        self._thread.start()

    def add(self, picture: PaintedFrame) -> None:
        """Add a frame.

        Raises:
            OSError: the file cannot be written.
        """
        boxes = picture.changes() if self._has_begun else None
        tiles = None if boxes is None else squares(boxes, *self._size)
        if tiles is None:
            buffer = self._free.get()
            picture.copy_bgrx(buffer)
            self._waiting.put(buffer)
        else:
            self._waiting.put((tiles, picture.cuts([tile.corner for tile in tiles], SIDE) if tiles else None))
        self._has_begun = True
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
                    self._file.mux(self._stream.encode(self._filled(frame)))
            except BaseException as error:  # noqa: BLE001 - it is raised where frames are added
                self._error = error
            finally:
                if isinstance(frame, bytearray):
                    self._free.put(frame)

    def _filled(self, frame: "_Frame") -> Any:
        """The frame in the colours of the encoder, with the next number."""
        if isinstance(frame, bytearray):
            self._pixels[:] = np.frombuffer(frame, np.uint8).reshape(self._pixels.shape)
            self._converted = self._reformatters[0].reformat(self._frame, format="yuv420p")
        elif frame[1] is not None:
            self._change(frame[0], frame[1])
        self._converted.pts, self._number = self._number, self._number + 1
        self._converted.time_base = self._time_base
        return self._converted

    def _change(self, tiles: list[Square], cuts: Any) -> None:
        """Put tiles into the frame before; an encoder has copied it by now."""
        planes, rows = planes_of(self._converted), cuts.view(np.uint8).reshape(-1, 4 * SIDE)
        for begin in range(0, len(tiles), STRIP):
            part = rows[begin * SIDE : (begin + STRIP) * SIDE]
            self._squares[: len(part)] = part
            converted = self._reformatters[1].reformat(self._strip, format="yuv420p")
            paste(planes, planes_of(converted), tiles[begin : begin + STRIP])

    def _raise(self) -> None:
        if self._error is not None:
            raise self._error
