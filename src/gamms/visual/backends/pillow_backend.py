"""Pixels, PNG and GIF files with Pillow, which no other file imports."""

import io
import zlib
from collections.abc import Iterator
from itertools import chain, pairwise, product
from math import ceil
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

from gamms.ir.graph import FloatArray, IntArray
from gamms.plugins import require_extra
from gamms.visual.font import ASCENT, EM, FONT, measure_words

if TYPE_CHECKING:
    from PIL.Image import Image

ByteArray = np.ndarray[Any, np.dtype[np.uint8]]
PixelArray = np.ndarray[Any, np.dtype[np.uint32]]  # (rows, columns)  blue, green, red and an unused byte

# of the colors of an animation: vivid ones of its first frame, such as those of teams, and mixed ones of all of it; the
# others are spread evenly, for later frames
_VIVID = 24
_MIXED = 168
_SPREAD = (0, 85, 170, 255)
_FINER = 4  # shapes and letters are drawn this many times larger, then reduced, for smooth edges
EDGE_PX = 0.5 / _FINER  # by which Pillow fills more than a polygon at each side
_FARTHEST = 1 << 28  # limit of coordinates, because Pillow counts in 32 bits
_MOST_LETTER_PX = 1024  # larger letters need no smoothing of our own
_HALO_PX = 1.25  # around letters


class PaintedFrame(Protocol):
    """A frame of a film."""

    def pixels(self) -> ByteArray:
        """Return red, green and blue as a new array (height, width, 3)."""

    def bgrx(self) -> PixelArray:
        """Return blue, green, red and an unused byte as an array (height, width): the fastest way to an encoder."""


class Patch(NamedTuple):
    """Coverage of a part of a picture from 0 to 255, and the position of its upper left pixel.

    Pixel (column, row) is the square from (column, row) to (column + 1, row + 1); y is down.
    """

    coverage: ByteArray  # (rows, columns)
    left: int
    top: int


def import_image_module() -> Any:
    """Return Pillow's module of images.

    Raises:
        MissingExtra: Pillow is not installed.
    """
    with require_extra("Painting a picture", "viz"):
        from PIL import Image
    return Image


# -- coverage -----------------------------------------------------------------------------------------------------


def compute_polygons(points: FloatArray, offsets: IntArray, width: int, height: int) -> Patch | None:
    """Return the coverage of filled polygons, each by the even-odd rule, clipped to a picture; overlaps count once.

    Args:
        points: (points, 2), pixels.
        offsets: (polygons + 1,)  polygon `i` is `points[offsets[i]:offsets[i + 1]]`.
        width: width of the picture.
        height: height of the picture.

    Returns:
        The coverage; None outside of the picture.
    """
    module = import_image_module()
    from PIL import ImageDraw

    low = np.maximum(np.floor(points.min(axis=0)), 0.0)
    high = np.minimum(np.ceil(points.max(axis=0)), (width, height))
    if (low >= high).any():
        return None
    columns, rows = ((high - low) * _FINER).astype(np.int64).tolist()
    image = module.new("L", (columns, rows))
    pen = ImageDraw.Draw(image)
    corners = np.clip(np.rint((points - low) * _FINER - 0.5), -_FARTHEST, _FARTHEST).ravel().tolist()
    for begin, end in pairwise((2 * offsets).tolist()):
        pen.polygon(corners[begin:end], fill=255)
    left, top = low.astype(np.int64).tolist()
    return Patch(np.asarray(image.reduce(_FINER)), left, top)


def compute_text_coverage(words: str, font_px: int, angle: float = 0.0, *, has_halo: bool = False) -> ByteArray:
    """Return the coverage of text around its middle, turned counter-clockwise by degrees, maybe with its halo."""
    module = import_image_module()
    from PIL import ImageDraw, ImageFont

    finer = max(min(_FINER, _MOST_LETTER_PX // font_px), 1)
    font = ImageFont.truetype(str(FONT), EM * font_px * finer)
    room = 2 + font_px // 4  # for the halo, and for accents above the line
    width = measure_words(words, font_px)
    columns = ceil(width) + 2 * room
    rows = ceil(font_px * EM) + 2 * room
    image = module.new("L", (columns * finer, rows * finer))
    pen = ImageDraw.Draw(image)
    x = (columns - width) / 2
    baseline = (rows - font_px * EM) / 2 + ASCENT * font_px * EM
    for letter in words:  # each exactly at its place, as in other formats
        stroke = round(_HALO_PX * finer) if has_halo else 0
        pen.text((x * finer, baseline * finer), letter, fill=255, font=font, anchor="ls", stroke_width=stroke)
        x += measure_words(letter, font_px)
    if angle:
        image = image.rotate(angle, module.Resampling.BICUBIC, expand=True)
    return np.asarray(image.reduce(finer))


# -- files --------------------------------------------------------------------------------------------------------


def encode_png(pixels: ByteArray, dpi: float) -> bytes:
    """Return a PNG file of RGB pixels (height, width, 3) with its paper size."""
    data = io.BytesIO()
    import_image_module().fromarray(pixels).save(data, "PNG", dpi=(dpi, dpi))
    return data.getvalue()


def decode_pixels(file: bytes) -> ByteArray:
    """Return the RGB pixels (height, width, 3) of an image file."""
    return np.asarray(import_image_module().open(io.BytesIO(file)).convert("RGB"))


def read_image_size(path: str) -> tuple[int, int]:
    """Return the width and height of an image file without decoding it.

    Raises:
        OSError: not an image.
        MissingExtra: Pillow is not installed.
    """
    module = import_image_module()
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
    """Collects the frames of an animation with one palette, and writes them at the end.

    Raises:
        MissingExtra: Pillow is not installed.
    """

    def __init__(self, path: Path, width: int, height: int, fps: float) -> None:
        self._image = import_image_module()
        self._fps = fps
        self._size = width, height
        self._path = path
        path.write_bytes(b"")  # an error is raised now, not after all frames
        self._palette: Any = None
        self._frames: list[bytes] = []  # compressed color indices; equal frames are stored once
        self._counts: list[int] = []  # of times that each is shown

    def add(self, picture: PaintedFrame) -> None:
        """Add a frame."""
        image = self._image.fromarray(picture.pixels())
        if self._palette is None:
            self._palette = _make_palette(self._image, image)
        image = image.quantize(palette=self._palette, dither=self._image.Dither.NONE)
        frame = zlib.compress(image.tobytes(), 1)
        if self._frames[-1:] == [frame]:
            self._counts[-1] += 1
        else:
            self._frames.append(frame)
            self._counts.append(1)

    def finish(self) -> None:
        """Write all frames.

        Raises:
            OSError: the file cannot be written.
        """
        # Rounded in total, because frames last whole hundredths of a second.
        ends = np.rint(100.0 * np.cumsum([0, *self._counts]) / self._fps)
        durations = (10 * np.maximum(np.diff(ends), 1.0)).astype(np.int64).tolist()
        images = self._read_images()
        options = {"loop": 0, "optimize": False, "duration": durations}
        with self._path.open("wb") as file:
            next(images).save(file, "GIF", save_all=True, append_images=images, **options)

    def _read_images(self) -> Iterator["Image"]:
        for frame in self._frames:
            image = self._image.frombytes("P", self._size, zlib.decompress(frame))
            image.putpalette(self._palette.getpalette())
            yield image

    def discard(self) -> None:
        """Stop collecting frames; the file is empty."""


def _make_palette(module: ModuleType, image: "Image") -> Any:
    counts: Any = image.getcolors(image.width * image.height)
    weighed = sorted((-count * (max(color) - min(color)) ** 3, color) for count, color in counts)
    vivid = list(chain.from_iterable(color for _, color in weighed[:_VIVID]))
    own = [*vivid, *(image.quantize(_MIXED).getpalette() or [])[: 3 * _MIXED]]
    spread = chain.from_iterable(product(_SPREAD, repeat=3))
    palette = module.new("P", (1, 1))
    palette.putpalette([*own, *[0] * (3 * (_VIVID + _MIXED) - len(own)), *spread])
    return palette
