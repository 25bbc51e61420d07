"""The adapter to pygame (pygame-ce or pygame): surfaces to paint on, with smooth edges and transparency.

Nothing here opens a window or uses sound; a surface needs neither.
"""

import os
import re
import sys
from collections import deque
from collections.abc import Callable, Iterable
from functools import lru_cache
from itertools import repeat
from math import cos, radians, sin
from typing import TYPE_CHECKING, Any
from weakref import WeakValueDictionary

import numpy as np

from gamms.errors import BadValue, MissingExtra
from gamms.ir.graph import FloatArray
from gamms.limits import refuse_above
from gamms.visual.appearance import PAPER, Rgb, Rgba, is_dark
from gamms.visual.backends.pillow_backend import (
    ByteArray,
    Patch,
    PixelArray,
    compute_text_coverage,
    import_image_module,
    read_image_size,
)
from gamms.visual.camera import find_extent
from gamms.visual.font import EM, measure_words, warn_of_boxes

if TYPE_CHECKING:
    from pygame import Surface

_PROMPT = "PYGAME_HIDE_SUPPORT_PROMPT"
_UNWRITABLE = re.compile("[\x00-\x1f\x7f\ud800-\udfff]")
_BGRX = (0xFF0000, 0xFF00, 0xFF) if sys.byteorder == "little" else ()  # the bit masks of such a surface
_MOST_IMAGE_PX = 4096
_IMAGE_BYTES = 12  # bytes per pixel: decoded, copied with transparency and scaled; 9 measured
_SVG_PX = 1024
_MOST_FONT_PX = 2048
_MOST_LETTERS = 10_000
_LETTERS = 8  # maximum width of a letter, as a multiple of its height

BLACK = (0, 0, 0, 255)
WHITE = (255, 255, 255, 255)

Placed = tuple["Surface", tuple[int, int]]  # a surface, and the position of its upper left corner


@lru_cache(maxsize=1)
def load() -> Any:
    """Return pygame without display, sound and greeting.

    Raises:
        MissingExtra: pygame is not installed.
    """
    is_ours = _PROMPT not in os.environ
    os.environ.setdefault(_PROMPT, "1")
    try:
        import pygame
        import pygame.surfarray
        import pygame.transform
    except ImportError as error:
        raise MissingExtra("Painting a picture", "viz") from error
    finally:
        if is_ours:
            del os.environ[_PROMPT]
    return pygame


class Canvas:
    """A picture to paint on: (x, y) in pixels from its upper left corner, y down; colors are RGBA.

    Args:
        width: pixels.
        height: pixels.
        surface: a surface to paint on instead of a new one, for example of a window; 32 bits.
        paper: the background color, used for outlines of text.
    """

    def __init__(self, width: int, height: int, surface: "Surface | None" = None, paper: Rgb = PAPER) -> None:
        self._pygame = load()
        import_image_module()  # so that a film without Pillow does not begin
        self.width = width
        self.height = height
        self._paper = paper
        self.surface: Surface = self._pygame.Surface((width, height), 0, 32) if surface is None else surface

    def fill(self, color: Rgba) -> None:
        """Fill everything with an opaque color."""
        self.surface.fill(color[:3])

    def pixels(self) -> ByteArray:
        """Return red, green and blue as a read-only copy (height, width, 3)."""
        data = self._pygame.image.tobytes(self.surface, "RGB")
        return np.frombuffer(data, np.uint8).reshape(self.height, self.width, 3)

    def bgrx(self) -> PixelArray:
        """Return blue, green, red and an unused byte of each pixel as one number; overwritten by the next frame."""
        if self.surface.get_masks()[:3] == _BGRX and self.surface.get_pitch() == 4 * self.width:
            data: Any = self.surface.get_buffer()
        else:
            data = self._pygame.image.tobytes(self.surface, "BGRA")
        return np.frombuffer(data, np.uint32).reshape(self.height, self.width)

    # -- shapes ----------------------------------------------------------------------------------------------

    def draw_hairlines(self, starts: FloatArray, ends: FloatArray, color: Rgba) -> None:
        """Draw smooth lines (lines, 2), one pixel wide, which must not extend far outside."""
        low, high = find_extent(starts, ends)
        left, top = np.maximum(np.floor(low - 2), 0).astype(int).tolist()
        right, bottom = np.minimum(np.ceil(high + 2), (self.width, self.height)).astype(int).tolist()
        if right <= left or bottom <= top:
            return
        part = self.surface.subsurface((left, top, right - left, bottom - top))
        if color[3] < 255:  # lines that cross are blended once
            part = part.copy()
        shift = (left + 0.5, top + 0.5)  # pygame counts from the center of a pixel
        begin, end = (zip(*(points - shift).T.tolist(), strict=True) for points in (starts, ends))
        ink = self._pygame.Color(*color[:3])  # created once for all lines
        # NOTE: a loop in C, in half the time (redrawing a map of 100,000 edges).
        deque(map(self._pygame.draw.aaline, repeat(part), repeat(ink), begin, end), maxlen=0)
        if color[3] < 255:
            part.set_alpha(color[3])
            self.surface.blit(part, (left, top))

    def draw_rectangle(self, x: float, y: float, width: float, height: float, color: Rgba) -> None:
        """Fill a rectangle, rounded to whole pixels for sharp edges."""
        corners = np.rint([(x, y), (x + width, y + height)])
        (left, top), (right, bottom) = np.clip(corners, 0, (self.width, self.height)).astype(int).tolist()
        if right > left and bottom > top:
            self.surface.blit(_paint(right - left, bottom - top, color), (left, top))

    def cover(self, patch: Patch, color: Rgba) -> None:
        """Blend a color with the coverage of a patch."""
        self.surface.blit(make_stamp(patch.coverage, color), (patch.left, patch.top))

    def draw_stamps(self, placed: Iterable[Placed]) -> None:
        """Paint surfaces, in order."""
        fast = getattr(self.surface, "fblits", None)  # only in pygame-ce
        if fast is None:
            self.surface.blits(placed, doreturn=False)
        else:
            fast(placed)

    # -- words and images ------------------------------------------------------------------------------------

    def draw_text(
        self,
        words: str,
        x: float,
        y: float,
        font_px: float,
        color: Rgba,
        *,
        angle: float = 0.0,
        align_right: bool = False,
        edge: Rgb | None = None,
    ) -> None:
        """Write text with the upper left, or upper right, corner at (x, y), with an outline if it is over a map.

        Text is turned counter-clockwise around its upper left corner by `angle` degrees.
        """
        edge = self._paper if edge is None and is_dark(color) != is_dark(self._paper) else edge
        font_px = min(max(round(font_px), 1), _MOST_FONT_PX)
        # Text beyond the edge is cut off: a malicious map may have an attribution of a million letters.
        longest = self.width + self.height + round(max(-x, 0.0))
        most = min(_LETTERS * longest // font_px + _LETTERS, _MOST_LETTERS)
        words = _UNWRITABLE.sub(" ", words[-most:] if align_right else words[:most])
        warn_of_boxes(words)
        written = _render_text(words, font_px, color, edge, round(angle % 360.0, 1))
        across = measure_words(words, font_px) / 2
        down = EM * font_px / 2
        turn = radians(angle)
        begin = x - 2 * across if align_right else x
        left = begin + across * cos(turn) + down * sin(turn) - written.get_width() / 2
        top = y + down * cos(turn) - across * sin(turn) - written.get_height() / 2
        self.surface.blit(written, (round(left), round(top)))

    def draw_image(self, path: str, x: float, y: float, side: float, angle: float) -> None:
        """Draw an image file in a square of `side` px around (x, y), rotated counter-clockwise by degrees."""
        drawn = _render_image(path, round(min(side, _MOST_IMAGE_PX)), round(angle % 360.0, 1))
        self.surface.blit(drawn, (round(x - drawn.get_width() / 2), round(y - drawn.get_height() / 2)))


def make_stamp(coverage: ByteArray, color: Rgba) -> "Surface":
    """Return a surface of one color with the opacity `coverage` (rows, columns)."""
    rows, columns = coverage.shape
    surface = _paint(columns, rows, (*color[:3], 255))
    opacity = coverage if color[3] == 255 else (coverage.astype(np.uint16) * color[3] // 255).astype(np.uint8)
    load().surfarray.pixels_alpha(surface)[:] = opacity.T
    return surface


def paint_transparent(paint: "Callable[[Rgba], Surface]") -> "Surface":
    """Paint over two colors, and return the result on a transparent surface; see `make_transparent`."""
    return make_transparent(paint(BLACK), paint(WHITE))


def make_transparent(over_black: "Surface", over_white: "Surface") -> "Surface":
    """Return a transparent surface from the same painting over black and over white.

    Blit it with BLEND_PREMULTIPLIED.
    """
    pygame = load()
    black, white = (pygame.surfarray.array3d(surface) for surface in (over_black, over_white))
    red, green, blue = np.moveaxis(white - black, 2, 0)  # never negative, so nothing wraps around
    seen_through = np.maximum(np.maximum(red, green), blue)  # NOTE: a third of the time of max(axis=2) (zooming)
    surface: Surface = pygame.Surface(over_black.get_size(), pygame.SRCALPHA, 32)
    pygame.surfarray.pixels3d(surface)[:] = black
    pygame.surfarray.pixels_alpha(surface)[:] = 255 - seen_through
    return surface


def _paint(width: int, height: int, color: Rgba) -> "Surface":
    pygame = load()
    surface: Surface = pygame.Surface((width, height), pygame.SRCALPHA, 32)
    surface.fill(color)
    return surface


@lru_cache(maxsize=4096)
def _render_text(words: str, font_px: int, color: Rgba, edge: Rgb | None, angle: float) -> "Surface":
    """Return text on a surface around its middle, turned counter-clockwise by degrees."""
    surface = make_stamp(compute_text_coverage(words, font_px, angle), (*color[:3], 255))
    if edge is not None:
        halo = make_stamp(compute_text_coverage(words, font_px, angle, has_halo=True), (*edge, 255))
        halo.blit(surface, (0, 0))
        surface = halo
    surface.set_alpha(color[3])
    return surface


_held: "WeakValueDictionary[str, Surface]" = WeakValueDictionary()


def hold_image(surface: "Surface") -> str:
    """Return a name by which a loaded image can be drawn like a file, while it exists."""
    name = f"surface {id(surface):#x}"
    if _held.get(name) is not surface:
        _held[name] = surface
        _render_image.cache_clear()  # an earlier image may have had this name
    return name


@lru_cache(maxsize=512)
def _render_image(path: str, side: int, angle: float) -> "Surface":
    pygame = load()
    image = _held.get(path) or _open_image(path)
    ratio = side / max(image.get_size())
    size = [max(1, round(length * ratio)) for length in image.get_size()]
    fitted: Surface = pygame.transform.smoothscale(image, size)
    return pygame.transform.rotozoom(fitted, angle, 1.0) if angle else fitted


@lru_cache(maxsize=64)
def _open_image(path: str) -> "Surface":
    """Return the image with transparency, in the byte order of fast blits.

    Raises:
        BadValue: the image cannot be read.
        TooLarge (BadValue): it would exceed the memory limit.
    """
    pygame = load()
    try:
        if path.lower().endswith(".svg") and hasattr(pygame.image, "load_sized_svg"):  # pygame-ce
            drawn: Surface = pygame.image.load_sized_svg(path, (_SVG_PX, _SVG_PX))
            return drawn
        width, height = read_image_size(path)
        refuse_above(width * height * _IMAGE_BYTES, f"The image {path!r} of {width} x {height} pixels")
        image = pygame.image.load(path)
    except (pygame.error, OSError) as error:
        raise BadValue(f"Cannot read the image {path!r}: {error}") from None
    surface: Surface = pygame.Surface(image.get_size(), pygame.SRCALPHA, 32)
    surface.blit(image, (0, 0))
    return surface
