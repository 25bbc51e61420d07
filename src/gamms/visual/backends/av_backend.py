"""MP4 files with PyAV."""

from pathlib import Path
from queue import Queue
from threading import Thread
from typing import Any

import numpy as np

from gamms.plugins import require_extra
from gamms.visual.backends.pillow_backend import PaintedFrame

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
        with require_extra("Writing an MP4 film", "video"):
            import av
        from fractions import Fraction

        from av.video.reformatter import VideoReformatter

        self._frame: Any = av.VideoFrame(width, height, "bgra")
        self._pixels = np.frombuffer(memoryview(self._frame.planes[0]), np.uint32).reshape(height, -1)[:, :width]
        self._reformatter: Any = VideoReformatter()
        # The index comes first, so that browsers can start before the whole file is loaded.
        self._file: Any = av.open(str(path), "w", format="mp4", options={"movflags": "+faststart"})
        rate = Fraction(fps).limit_denominator(1001)
        self._number = 0
        self._time_base = 1 / rate
        self._stream = self._file.add_stream("libx264", rate=rate, options=_OPTIONS)
        self._stream.width = width
        self._stream.height = height
        self._stream.pix_fmt = "yuv420p"
        self._waiting: Queue[Any] = Queue(_AHEAD)
        self._error: BaseException | None = None
        self._thread = Thread(target=self._encode, name="gamms-film", daemon=True)
        self._thread.start()

    def add(self, picture: PaintedFrame) -> None:
        """Add a frame.

        Raises:
            OSError: the file cannot be written.
        """
        self._pixels[:] = picture.bgrx()
        frame = self._reformatter.reformat(self._frame, format="yuv420p")
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

    def _raise(self) -> None:
        if self._error is not None:
            raise self._error
