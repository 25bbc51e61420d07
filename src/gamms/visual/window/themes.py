"""The colours of the window: readable on paper and at night, and told apart by colour-blind readers."""

from typing import NamedTuple

from gamms.errors import BadValue, nearest
from gamms.text import shown
from gamms.visual.appearance import BY_NIGHT
from gamms.visual.color import PAPER, Rgba
from gamms.visual.default_scene import ON_PAPER, MapTones


class Theme(NamedTuple):
    """What is behind everything, what is written, and how the map looks when nobody said so."""

    background: Rgba
    ink: Rgba
    faint: Rgba
    card: Rgba  # behind words
    border: Rgba  # of a card
    map: MapTones
    accent: Rgba


THEMES = {
    "light": Theme(
        background=(*PAPER, 255),
        ink=(45, 48, 54, 255),
        faint=(112, 116, 124, 255),
        card=(255, 255, 255, 225),
        border=(60, 64, 72, 40),
        map=ON_PAPER,
        accent=(0, 114, 178, 255),
    ),
    "dark": Theme(
        background=(23, 26, 31, 255),
        ink=(228, 230, 234, 255),
        faint=(150, 155, 164, 255),
        card=(38, 42, 50, 230),
        border=(228, 230, 234, 40),
        map=MapTones((84, 90, 101), (104, 110, 122), BY_NIGHT),
        accent=(86, 180, 233, 255),
    ),
}


def theme_called(name: str) -> Theme:
    """The theme of that name.

    Raises:
        BadValue: there is none.
    """
    if name not in THEMES:
        raise BadValue(f"Unknown theme {shown(name)}; there is: {', '.join(THEMES)}.{nearest(name, THEMES)}")
    return THEMES[name]
