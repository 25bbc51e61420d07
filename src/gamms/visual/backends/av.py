"""The one door to PyAV: MP4 files."""

from pathlib import Path
from queue import Queue
from threading import Thread
from typing import Any

import numpy as np

from gamms.errors import MissingExtra
from gamms.visual.backends import PaintedFrame

_AHEAD = 8  # frames that wait for the encoder
# A fixed number of threads, so that the same frames give the same bytes on every machine.
_OPTIONS = {"preset": "veryfast", "crf": "20", "threads": "2"}


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

        self._frame: Any = av.VideoFrame(width, height, "bgra")
        self._step = 4 * width
        # The index comes first, so that a browser can begin before it has all.
        self._file: Any = av.open(str(path), "w", format="mp4", options={"movflags": "+faststart"})
        rate = Fraction(fps).limit_denominator(1001)
        self._number, self._time_base = 0, 1 / rate
        self._stream = self._file.add_stream("libx264", rate=rate, options=_OPTIONS)
        self._stream.width, self._stream.height, self._stream.pix_fmt = width, height, "yuv420p"
        self._waiting: Queue[bytearray | None] = Queue()
        self._free: Queue[bytearray] = Queue()  # fresh memory for every frame would cost more than filling it
        for _ in range(_AHEAD):
            self._free.put(bytearray(4 * width * height))
        self._error: BaseException | None = None
        self._thread = Thread(target=self._encode, name="gamms-film", daemon=True)
        self._thread.start()

    def add(self, picture: PaintedFrame) -> None:
        """Add a frame.

        Raises:
            OSError: the file cannot be written.
        """
        buffer = self._free.get()
        picture.copy_bgrx(buffer)
        self._waiting.put(buffer)
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
        while (pixels := self._waiting.get()) is not None:
            try:
                if self._error is None:
                    self._file.mux(self._stream.encode(self._filled(pixels)))
            except BaseException as error:  # noqa: BLE001 - it is raised where frames are added
                self._error = error
            finally:
                self._free.put(pixels)

    def _filled(self, pixels: bytearray) -> Any:
        """The frame with other pixels and the next number."""
        plane = self._frame.planes[0]
        if plane.line_size == self._step:
            plane.update(pixels)
        else:  # its rows are padded
            rows = np.zeros((plane.height, plane.line_size), np.uint8)
            rows[:, : self._step] = np.frombuffer(pixels, np.uint8).reshape(plane.height, self._step)
            plane.update(rows)
        self._frame.pts, self._number = self._number, self._number + 1
        self._frame.time_base = self._time_base
        return self._frame

    def _raise(self) -> None:
        if self._error is not None:
            raise self._error
