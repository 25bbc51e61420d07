"""Colour maps: from values to colours that readers with any eyes can put in order, and that keep it in grey.

A table names colours at equal steps; between them the colours are mixed. `viridis`, `magma` and `cividis` grow lighter
from low to high; `diverging` is palest in the middle, blue below it and brown above.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from gamms.errors import UnknownName
from gamms.ir.graph import FloatArray, IntArray
from gamms.visual.color import Rgb, rgba

LEVELS = 256
DIVERGING = "diverging"

Colorize = Callable[[float], Any]

_TABLES = {
    "viridis": "440154 482576 414487 35608d 2a788e 21908d 22a884 43bf71 7ad151 bbdf27 fde725",
    "magma": "000004 140e36 3b0f70 641a80 8c2981 b73779 de4968 f7705c fe9f6d fecf92 fcfdbf",
    "cividis": "00224e 123570 3b496c 575d6d 707173 8a8678 a59c74 c3b369 e1cc55 fee838",
    DIVERGING: "124376 2963a2 4b85c7 77a9e3 a9cdf7 f0eeec ebc09a d39760 b4712d 904f00 673300",
}
NAMES = tuple(_TABLES)


def table(name: Any) -> tuple[Rgb, ...]:
    """The colours of a map from low to high, LEVELS of them.

    Raises:
        UnknownName (KeyError): there is no such map.
    """
    if not isinstance(name, str) or name not in _TABLES:
        raise UnknownName("colour map", name, _TABLES)
    known = np.array([list(bytes.fromhex(color)) for color in _TABLES[name].split()], float)
    places = np.linspace(0.0, len(known) - 1.0, LEVELS)
    mixed = np.column_stack([np.interp(places, np.arange(len(known)), part) for part in known.T])
    return tuple((red, green, blue) for red, green, blue in np.rint(mixed).astype(int).tolist())


def levels(values: FloatArray, low: float, high: float) -> IntArray:
    """The level (values,) of each value, 0 to LEVELS - 1; what lies outside has that of the nearer end."""
    if high <= low:
        return np.full(len(values), LEVELS // 2, np.int64)
    share = (np.clip(values, low, high) - low) / (high - low)
    return np.rint(share * (LEVELS - 1)).astype(np.int64)


def colorized(colorize: Colorize, values: FloatArray) -> tuple[list[Rgb], IntArray]:
    """What a caller's function makes of values: its different colours, and the place of each value's among them."""
    distinct, places = np.unique(values, return_inverse=True)
    named = [rgba(colorize(value))[:3] for value in distinct.tolist()]
    colors = list(dict.fromkeys(named))
    place_of = {color: place for place, color in enumerate(colors)}
    return colors, np.array([place_of[color] for color in named], np.int64)[places]
