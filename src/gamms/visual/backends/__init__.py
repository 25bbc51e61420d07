"""Backends: functions that convert draw commands to the bytes of a picture file.

`backend(commands, camera, *, title, background, dpi) -> bytes`; it paints only the commands, which include the text
around the map. To add a format, add one file here and one line below; an installed package adds one through the entry
point group `gamms.backends`. `gamms.testing.check_backend` checks the contract.

Pixels are painted by `raster.py` on the surfaces of `pygame_backend.py`; optional libraries have one file each.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

from gamms.ir.draw import DrawCommands
from gamms.plugins import Registry
from gamms.visual.backends import svg
from gamms.visual.backends.pillow_backend import PaintedFrame
from gamms.visual.camera import Camera

Backend = Callable[..., bytes]

FORMATS: Registry[bytes] = Registry("picture format", "gamms.backends")
FORMATS.register(".svg")(svg.write_svg)


@FORMATS.register(".png")
def _render_png(commands: DrawCommands, camera: Camera, **words: Any) -> bytes:
    from gamms.visual.backends.raster import write_png

    return write_png(commands, camera, **words)


@FORMATS.register(".pdf")
def _render_pdf(commands: DrawCommands, camera: Camera, **words: Any) -> bytes:
    from gamms.visual.backends.pdf import write_pdf

    return write_pdf(commands, camera, **words)


class FilmWriter(Protocol):
    """A writer of a film file; made by `(path, width, height, fps)`."""

    def add(self, picture: PaintedFrame) -> None:
        """Add a frame; its buffer is reused afterwards."""

    def finish(self) -> None:
        """End the file."""

    def discard(self) -> None:
        """Stop writing; the file is incomplete."""


FILMS: Registry[FilmWriter] = Registry("film format", "gamms.films")


@FILMS.register(".mp4")
def _open_mp4(path: Path, width: int, height: int, fps: float) -> FilmWriter:
    from gamms.visual.backends.av_backend import Mp4

    return Mp4(path, width, height, fps)


@FILMS.register(".gif")
def _open_gif(path: Path, width: int, height: int, fps: float) -> FilmWriter:
    from gamms.visual.backends.pillow_backend import Gif

    return Gif(path, width, height, fps)
