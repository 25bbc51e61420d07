"""The font of all pictures, and the width of texts in it. The font file is part of the package.

Its letters have the widths of Arial, Helvetica and Liberation Sans; every SVG viewer has one of these.
"""

import json
import logging
from functools import lru_cache
from pathlib import Path

from gamms.text import shown

FONT = Path(__file__).parent.parent / "data" / "fonts" / "Arimo-Regular.ttf"
_WIDTHS = FONT.with_name("widths.json")  # width in the unit of the font -> its letters of that width
FAMILIES = "Arimo, Arial, 'Liberation Sans', Helvetica, sans-serif"
EM = 0.6875  # font size in heights, as in 1.0.0 and pygame
MIDDLE = 0.36  # from the top of a line of words to the middle of small letters, in heights
ASCENT = 0.8  # from the top of a line of words to its baseline, in font sizes

_SLIMMEST = 0.15  # of letters, in font sizes


def measure_words(words: str, font_px: float) -> float:
    """Return how broad words are, in the unit of `font_px`, the height as `render_text` counts it."""
    widths, default = _read_widths()
    return EM * font_px * sum(widths.get(ord(letter), default) for letter in words)


def shorten_text(words: str, font_px: float, most_px: float, *, is_title: bool = False) -> str:
    """Shorten a text to a width, and end it with an ellipsis.

    Args:
        words: the words.
        font_px: the font size, as for `render_text`.
        most_px: the maximum width, pixels.
        is_title: whether to remove the beginning instead of the end, where paths have their names.
    """
    if len(words) * font_px * EM * _SLIMMEST <= most_px and measure_words(words, font_px) <= most_px:
        return words
    letters = words[::-1] if is_title else words
    room = most_px - measure_words("…", font_px)
    count = 0
    while count < len(words) and (room := room - measure_words(letters[count], font_px)) >= 0.0:
        count += 1
    if not count:
        return ""
    return f"…{words[-count:]}" if is_title else f"{words[:count].rstrip()}…"


@lru_cache(maxsize=1024)
def warn_of_boxes(words: str) -> None:
    """Warn once per process about letters that the font lacks, which are shown as boxes."""
    lacking = [letter for letter in words if ord(letter) not in _read_widths()[0]]
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
def _read_widths() -> tuple[dict[int, float], float]:
    """Return the width of each character of the font, and that of other characters, in font sizes."""
    table = json.loads(_WIDTHS.read_text("ascii"))
    widths = dict[int, float]()
    for width, letters in table["letters"].items():
        widths.update(dict.fromkeys(map(ord, letters), int(width) / table["em"]))
    return widths, table["other"] / table["em"]
