"""Themes: the colors of backgrounds, texts, maps and teams in pictures, films and windows."""

from typing import NamedTuple

from gamms.errors import BadValue, nearest
from gamms.text import shown
from gamms.visual.appearance import PAPER, TEAM_COLORS, Rgb, Rgba


class WallTones(NamedTuple):
    """The colors of buildings and walls without their own color."""

    low: Rgb  # of the areas of the lowest buildings
    high: Rgb  # of the highest walls; between both, colors are interpolated
    outline: Rgb  # of areas
    wall: Rgb  # of walls without a footprint


class GroundTones(NamedTuple):
    """The colors of the base map, which is drawn below everything else."""

    land: Rgb  # of the rectangle of the map
    green: Rgb  # of parks and woods
    water: Rgb  # of areas of water
    waterway: Rgb  # of rivers and streams that are lines
    rail: Rgb


class MapTones(NamedTuple):
    """The colors of the map."""

    streets: Rgb
    nodes: Rgb
    walls: WallTones
    ground: GroundTones


Shades = tuple[Rgb, Rgb, Rgb]  # of streets that a team has never seen, has seen, and sees now


class Theme(NamedTuple):
    """The colors of the background, of text, of the default map, and of teams without a declared color."""

    background: Rgba
    ink: Rgba
    faint: Rgba
    card: Rgba  # behind words
    border: Rgba  # of a card
    map: MapTones
    fog: Shades
    teams: tuple[Rgb, ...] = TEAM_COLORS


THEMES = {
    "light": Theme(
        background=(*PAPER, 255),
        ink=(45, 48, 54, 255),
        faint=(112, 116, 124, 255),
        card=(255, 255, 255, 225),
        border=(60, 64, 72, 40),
        map=MapTones(
            streets=(165, 168, 172),
            nodes=(140, 143, 148),
            walls=WallTones(low=(240, 236, 228), high=(206, 197, 181), outline=(193, 184, 168), wall=(139, 128, 110)),
            ground=GroundTones(
                land=(246, 245, 241),
                green=(228, 238, 218),
                water=(219, 228, 234),
                waterway=(196, 215, 228),
                rail=(206, 198, 204),
            ),
        ),
        fog=((235, 236, 237), (205, 207, 211), (135, 139, 146)),
    ),
    "dark": Theme(
        background=(23, 26, 31, 255),
        ink=(228, 230, 234, 255),
        faint=(150, 155, 164, 255),
        card=(38, 42, 50, 230),
        border=(228, 230, 234, 40),
        map=MapTones(
            streets=(112, 119, 132),
            nodes=(122, 129, 142),
            walls=WallTones(low=(37, 40, 45), high=(70, 68, 66), outline=(86, 84, 81), wall=(140, 130, 116)),
            ground=GroundTones(
                land=(29, 32, 38), green=(30, 43, 35), water=(28, 38, 47), waterway=(34, 51, 70), rail=(62, 58, 66)
            ),
        ),
        fog=((42, 45, 51), (104, 109, 118), (206, 210, 216)),
        teams=((50, 114, 208), (230, 80, 68), (60, 172, 108), (222, 158, 204), (246, 190, 76), (150, 226, 252)),
    ),
    # Paper has no tone; team colors differ by an eighth in brightness, so that a copy in grey tells them apart.
    "print": Theme(
        background=(255, 255, 255, 255),
        ink=(0, 0, 0, 255),
        faint=(70, 70, 70, 255),
        card=(255, 255, 255, 255),
        border=(0, 0, 0, 90),
        map=MapTones(
            streets=(150, 150, 150),
            nodes=(130, 130, 130),
            walls=WallTones(low=(244, 244, 244), high=(212, 212, 212), outline=(190, 190, 190), wall=(110, 110, 110)),
            ground=GroundTones(
                land=(250, 250, 250),
                green=(241, 246, 236),
                water=(224, 232, 238),
                waterway=(204, 216, 224),
                rail=(196, 192, 196),
            ),
        ),
        fog=((232, 232, 232), (196, 196, 196), (110, 110, 110)),
        teams=((0, 52, 116), (192, 64, 84), (18, 102, 62), (196, 112, 156), (228, 172, 56), (164, 220, 240)),
    ),
}


def find_theme(name: object) -> Theme:
    """Return the theme of that name.

    Raises:
        BadValue: the theme does not exist.
    """
    if not isinstance(name, str) or name not in THEMES:
        raise BadValue(f"Unknown theme {shown(name)}; there are: {', '.join(THEMES)}.{nearest(name, THEMES)}")
    return THEMES[name]
