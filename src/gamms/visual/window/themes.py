"""The colours of the window: readable on paper and at night, and told apart by colour-blind readers."""

from typing import NamedTuple

from gamms.errors import BadValue, nearest
from gamms.visual.color import PAPER, Rgb, Rgba


class Theme(NamedTuple):
    """What is behind everything, what is written, and how streets look when nobody said so."""

    background: Rgba
    ink: Rgba
    faint: Rgba
    card: Rgba  # behind words
    border: Rgba  # of a card
    streets: Rgb
    nodes: Rgb
    walls: Rgb
    accent: Rgba


THEMES = {
    "light": Theme(
        background=(*PAPER, 255),
        ink=(45, 48, 54, 255),
        faint=(112, 116, 124, 255),
        card=(255, 255, 255, 225),
        border=(60, 64, 72, 40),
        streets=(165, 168, 172),
        nodes=(140, 143, 148),
        walls=(214, 205, 190),
        accent=(0, 114, 178, 255),
    ),
    "dark": Theme(
        background=(23, 26, 31, 255),
        ink=(228, 230, 234, 255),
        faint=(150, 155, 164, 255),
        card=(38, 42, 50, 230),
        border=(228, 230, 234, 40),
        streets=(84, 90, 101),
        nodes=(104, 110, 122),
        walls=(62, 57, 52),
        accent=(86, 180, 233, 255),
    ),
}


def theme_called(name: str) -> Theme:
    """The theme of that name.

    Raises:
        BadValue: there is none.
    """
    if name not in THEMES:
        raise BadValue(f"Unknown theme {name!r}; there is: {', '.join(THEMES)}.{nearest(str(name), THEMES)}")
    return THEMES[name]
