"""PNG and GIF files with Pillow, which no other file imports."""

import io
from itertools import chain, product
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from gamms.plugins import needing
from gamms.visual.backends.coverage import ByteArray, PaintedFrame

if TYPE_CHECKING:
    from PIL.Image import Image


_OWN = 192  # colors taken from the first frame; the others are spread evenly, for later frames
_SPREAD = (0, 85, 170, 255)


def _image_module() -> Any:
    with needing("Writing a PNG or GIF file", "viz"):
        from PIL import Image
    return Image


def png_file(pixels: ByteArray, dpi: float) -> bytes:
    """Return a PNG file of RGB pixels (height, width, 3) with its paper size."""
    data = io.BytesIO()
    _image_module().fromarray(pixels).save(data, "PNG", dpi=(dpi, dpi))
    return data.getvalue()


def pixels_of(file: bytes) -> ByteArray:
    """Return the RGB pixels (height, width, 3) of an image file."""
    return np.asarray(_image_module().open(io.BytesIO(file)).convert("RGB"))


def image_size(path: str) -> tuple[int, int]:
    """Return the width and height of an image file without decoding it.

    Raises:
        OSError: not an image.
        MissingExtra: Pillow is not installed.
    """
    module = _image_module()
    # the caller knows the allowed number of pixels
    most = module.MAX_IMAGE_PIXELS
    module.MAX_IMAGE_PIXELS = None
    try:
        with module.open(path) as image:
            width, height = image.size
    except (ValueError, SyntaxError) as error:
        raise OSError(str(error)) from None
    finally:
        module.MAX_IMAGE_PIXELS = most
    return width, height


class Gif:
    """Writes an animation frame by frame, with one palette and only the changed part of each frame.

    Raises:
        MissingExtra: Pillow is not installed.
    """

    def __init__(self, path: Path, width: int, height: int, fps: float) -> None:
        self._image = _image_module()
        self._fps = fps
        self._size = width, height
        self._file = path.open("wb")
        self._palette: Any = None
        self._waiting: Any = None  # a part of the picture to be written: (image, corner)
        self._before: Any = None
        self._begun = self._frames = 0

    def add(self, picture: PaintedFrame) -> None:
        """Add a frame.

        Raises:
            OSError: the file cannot be written.
        """
        image = self._image.fromarray(picture.pixels())
        if self._palette is None:
            self._palette = _palette(self._image, image)
        image = image.quantize(palette=self._palette, dither=self._image.Dither.NONE)
        box = _changed(self._before, image)
        if box is not None:
            self._write()
            self._waiting = image.crop(box), box[:2]
            self._before = image
            self._begun = self._frames
        self._frames += 1

    def finish(self) -> None:
        """Write the remaining frames.

        Raises:
            OSError: the file cannot be written.
        """
        with self._file:
            self._write()
            self._file.write(b";")

    def discard(self) -> None:
        """Stop writing; the file is incomplete."""
        self._file.close()

    def _write(self) -> None:
        """Write the waiting frame, whose duration is now known."""
        from PIL import GifImagePlugin

        if self._waiting is None:
            return
        image, corner = self._waiting
        if self._begun == 0:
            for part in _header(self._image, image, self._palette):
                self._file.write(part)
        # Rounded in total, because frames last whole hundredths of a second.
        hundredths = round(100 * self._frames / self._fps) - round(100 * self._begun / self._fps)
        for part in GifImagePlugin.getdata(image, corner, duration=10 * max(hundredths, 1)):
            self._file.write(part)


def _header(module: ModuleType, image: "Image", palette: "Image") -> list[bytes]:
    """Return the beginning of a file that repeats forever, up to its first frame."""
    data = io.BytesIO()
    first = module.new("P", image.size)
    first.putpalette(palette.getpalette())
    first.save(data, "GIF", loop=0, optimize=False, duration=10)
    whole = data.getvalue()
    return [whole[: whole.index(b"!\xf9\x04")]]


def _palette(module: ModuleType, image: "Image") -> Any:
    own = (image.quantize(_OWN).getpalette() or [])[: 3 * _OWN]
    spread = chain.from_iterable(product(_SPREAD, repeat=3))
    palette = module.new("P", (1, 1))
    palette.putpalette([*own, *[0] * (3 * _OWN - len(own)), *spread])
    return palette


def _changed(before: "Image | None", image: "Image") -> tuple[int, int, int, int] | None:
    """Return the bounding box of the changed pixels; for the first frame the whole picture."""
    if before is None:
        return (0, 0, *image.size)
    differs = np.asarray(before) != np.asarray(image)
    rows = np.flatnonzero(differs.any(axis=1))
    columns = np.flatnonzero(differs.any(axis=0))
    if len(rows) == 0:
        return None
    return int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1
