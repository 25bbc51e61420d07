"""The font of all pictures, and the width of texts in it. The font file is part of the package.

Its letters have the widths of Arial, Helvetica and Liberation Sans; every SVG viewer has one of these.
"""

import logging
from functools import lru_cache
from pathlib import Path
from struct import unpack_from

from gamms.text import shown

FONT = Path(__file__).parent.parent / "data" / "fonts" / "Arimo-Regular.ttf"
FAMILIES = "Arimo, Arial, 'Liberation Sans', Helvetica, sans-serif"
EM = 0.6875  # font size in heights, as in 1.0.0 and pygame
MIDDLE = 0.36  # from the top of a line of words to the middle of small letters, in heights
ASCENT = 0.8  # from the top of a line of words to its baseline, in font sizes

_SLIMMEST = 0.15  # of letters, in font sizes
_UNICODE = 0  # the platform of a table of characters


def words_width(words: str, font_px: float) -> float:
    """Return how broad words are, in the unit of `font_px`, the height as `render_text` counts it."""
    widths, default = _widths()
    return EM * font_px * sum(widths.get(ord(letter), default) for letter in words)


def shortened(words: str, font_px: float, most_px: float, *, is_title: bool = False) -> str:
    """Shorten a text to a width, and end it with an ellipsis.

    Args:
        words: the words.
        font_px: the font size, as for `render_text`.
        most_px: the maximum width, pixels.
        is_title: whether to remove the beginning instead of the end, where paths have their names.
    """
    if len(words) * font_px * EM * _SLIMMEST <= most_px and words_width(words, font_px) <= most_px:
        return words
    letters = words[::-1] if is_title else words
    room = most_px - words_width("…", font_px)
    count = 0
    while count < len(words) and (room := room - words_width(letters[count], font_px)) >= 0.0:
        count += 1
    if not count:
        return ""
    return f"…{words[-count:]}" if is_title else f"{words[:count].rstrip()}…"


@lru_cache(maxsize=1024)
def warn_of_boxes(words: str) -> None:
    """Warn once per process about letters that the font lacks, which are shown as boxes."""
    lacking = [letter for letter in words if ord(letter) not in _widths()[0]]
    if lacking and not _warned:
        _warned.append(words)
        logging.getLogger("gamms").warning(
            "In pixels and PDF, %s is written with boxes for %s: the font of pictures has Latin, Greek and Cyrillic "
            "letters only. Save a picture as .svg, which is shown in the fonts of its viewer, or use other letters.",
            shown(words),
            shown("".join(dict.fromkeys(lacking))),
        )


_warned: list[str] = []


@lru_cache(maxsize=1)
def _widths() -> tuple[dict[int, float], float]:
    """Return how broad each character of the font is, and any other one, in font sizes."""
    data = FONT.read_bytes()
    tags = [unpack_from(">4s4xL", data, 12 + 16 * number) for number in range(*unpack_from(">H", data, 4))]
    start = dict(tags)
    (em,) = unpack_from(">H", data, start[b"head"] + 18)
    (count,) = unpack_from(">H", data, start[b"hhea"] + 34)
    advances = unpack_from(">" + "Hh" * count, data, start[b"hmtx"])[::2]
    glyphs = _glyphs(data, start[b"cmap"])
    return {code: advances[min(glyph, count - 1)] / em for code, glyph in glyphs.items()}, advances[0] / em


def _glyphs(data: bytes, begin: int) -> dict[int, int]:
    """Return the numbers of the glyphs of characters, from a table of format 4."""
    (table,) = (begin + offset for platform, offset in _subtables(data, begin) if platform == _UNICODE)
    segments = unpack_from(">H", data, table + 6)[0] // 2
    ends, starts, deltas, offsets = (
        unpack_from(f">{segments}H", data, table + 14 + 2 * (column * segments + (column > 0))) for column in range(4)
    )
    found = dict[int, int]()
    for number, (first, last, delta, offset) in enumerate(zip(starts, ends, deltas, offsets, strict=True)):
        place = table + 16 + 2 * (3 * segments + number) + offset  # from where glyphs are listed, if they are
        for code in range(first, min(last, 0xFFFE) + 1):
            glyph = unpack_from(">H", data, place + 2 * (code - first))[0] if offset else code
            if glyph:
                found[code] = (glyph + delta) % 0x10000
    return found


def _subtables(data: bytes, begin: int) -> list[tuple[int, int]]:
    count = unpack_from(">H", data, begin + 2)[0]
    return [unpack_from(">H2xL", data, begin + 4 + 8 * number) for number in range(count)]
