"""The appearance of drawings: colors, and the data of the built-in drawers."""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from types import MappingProxyType
from typing import Any

import numpy as np

from gamms.arguments import as_float, as_name
from gamms.errors import BadType, BadValue, UnknownName, nearest
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.text import shown
from gamms.typing import ColorType

Rgb = tuple[int, int, int]
Rgba = tuple[int, int, int, int]
AnyColor = ColorType | str
"""RGB or RGBA, the name of a color, or `#rrggbb`."""


class Color:
    """Named colors, as RGB."""

    White = (255, 255, 255)
    Black = (0, 0, 0)
    Red = (255, 0, 0)
    Green = (0, 255, 0)
    LightGreen = (144, 238, 144)
    Blue = (0, 0, 255)
    Yellow = (255, 255, 0)
    Cyan = (0, 255, 255)
    Magenta = (255, 0, 255)
    Gray = (169, 169, 169)
    LightGray = (211, 211, 211)
    DarkGray = (128, 128, 128)
    Brown = (210, 105, 30)
    Purple = (128, 0, 128)


PAPER: Rgb = (252, 252, 250)  # behind every picture

# Each has a clear color name. In this order they grow lighter, by at least 6.8 of CIELAB's 100, so that they differ
# in grey, too; for color-blind viewers (by Machado's matrices) any two are at least 19 apart, compared to Okabe and
# Ito's 16.
TEAM_COLORS: tuple[Rgb, ...] = (
    (20, 80, 165),
    (208, 48, 40),
    (30, 156, 92),
    (206, 140, 186),
    (240, 172, 40),
    (125, 215, 250),
)

_NAMED_TEAMS = {"blue": 0, "red": 1, "green": 2, "pink": 3, "purple": 3, "orange": 4, "yellow": 4, "cyan": 5}


def assign_team_colors(
    teams: Iterable[Any], given: Mapping[str, Rgb] = MappingProxyType({}), palette: Sequence[Rgb] = TEAM_COLORS
) -> dict[str, Rgb]:
    """Return a color for each team, by its text: the color with its name, else the next free color.

    Args:
        teams: in the order of assignment; teams may be any values.
        given: text of a team -> its color, which no other team gets.
        palette: blue, red, green, pink, orange and cyan.
    """
    names = dict.fromkeys(map(str, teams))
    own = {name: palette[_NAMED_TEAMS[name.lower()]] for name in names if name.lower() in _NAMED_TEAMS}
    own |= {name: given[name] for name in names if name in given}
    left = [color for color in palette if color not in own.values()] or list(palette)
    others = [name for name in names if name not in own]
    own |= {name: left[i % len(left)] for i, name in enumerate(others)}
    return {name: own[name] for name in names}


def sort_sides(sides: Iterable[str | None], known: Sequence[str]) -> list[str]:
    """Return the known sides in the order of color assignment.

    Args:
        sides: order of all sides of a game; None for a side whose name is unknown.
        known: the known sides; those missing in `sides` replace the None entries, then are appended.
    """
    named = set(sides := tuple(sides))
    others = iter([side for side in known if side not in named])
    return [*(next(others, f"\0{i}") if side is None else side for i, side in enumerate(sides)), *others]


def is_dark(color: Sequence[float]) -> bool:
    """Return whether a color is nearer to black than to white."""
    return sum(color[:3]) < 3 * 128


def choose_inks(background: Rgba) -> tuple[Rgb, Rgb]:
    """Return two greys for text on a background: one with high contrast, and a fainter one."""
    if is_dark(background):
        return (222, 224, 228), (150, 154, 160)
    return (51, 51, 51), (119, 119, 119)


_NAMES: dict[str, Rgb] = {
    "orange": (255, 165, 0),
    "pink": (255, 192, 203),
    **{name.lower(): value for name, value in vars(Color).items() if isinstance(value, tuple)},
}
_NAMES |= {name.replace("gray", "grey"): value for name, value in _NAMES.items() if "gray" in name}


def string_to_color(text: str) -> Rgb:
    """Return a color by name, in any case, or by `#rrggbb`.

    Raises:
        BadValue (ValueError): the color does not exist.
    """
    name = text.strip().lower()
    if name in _NAMES:
        return _NAMES[name]
    try:
        red, green, blue = bytes.fromhex(name.removeprefix("#"))
    except ValueError:
        raise BadValue(f"Unknown color {shown(text)}; give a name or '#rrggbb'.{nearest(name, _NAMES)}") from None
    return red, green, blue


def parse_color(color: AnyColor) -> Rgba:
    """Return RGB, RGBA, a name or `#rrggbb` as four integers, clipped to 0-255.

    Raises:
        BadType: not a color.
        BadValue: not three or four finite numbers, or an unknown name.
    """
    try:
        return _convert_color(color)
    except TypeError:  # a list or an array, which is not hashable, or not a color
        return _convert_color.__wrapped__(color)


@lru_cache(maxsize=1024)
def _convert_color(color: AnyColor) -> Rgba:
    if isinstance(color, str):
        return (*string_to_color(color), 255)
    try:
        values = [as_float(value, "A color's component") for value in color]
    except TypeError as error:
        raise BadType(
            f"A color is (red, green, blue) or (red, green, blue, alpha), not {shown(color)}: {error}"
        ) from None
    if len(values) not in (3, 4):
        raise BadValue(f"A color has three or four components, not {len(values)}: {shown(color)}.")
    red, green, blue, alpha = (min(255, max(0, round(value))) for value in [*values, 255.0][:4])
    return red, green, blue, alpha


LEVELS = 256
DIVERGING = "diverging"

Colorize = Callable[[float], Any]

_TABLES = {
    "viridis": "440154 482576 414487 35608d 2a788e 21908d 22a884 43bf71 7ad151 bbdf27 fde725",
    "magma": "000004 140e36 3b0f70 641a80 8c2981 b73779 de4968 f7705c fe9f6d fecf92 fcfdbf",
    "cividis": "00224e 123570 3b496c 575d6d 707173 8a8678 a59c74 c3b369 e1cc55 fee838",
    DIVERGING: "124376 2963a2 4b85c7 77a9e3 a9cdf7 f0eeec ebc09a d39760 b4712d 904f00 673300",
}


def find_color_table(name: object) -> tuple[Rgb, ...]:
    """Return the `LEVELS` colors of a color map, from low to high.

    Raises:
        UnknownName (KeyError): the color map does not exist.
    """
    if not isinstance(name, str) or name not in _TABLES:
        raise UnknownName("color map", name, _TABLES)
    known = np.array([list(bytes.fromhex(color)) for color in _TABLES[name].split()], float)
    places = np.linspace(0.0, len(known) - 1.0, LEVELS)
    mixed = np.column_stack([np.interp(places, np.arange(len(known)), part) for part in known.T])
    return tuple((red, green, blue) for red, green, blue in np.rint(mixed).astype(int).tolist())


def find_levels(values: FloatArray, low: float, high: float) -> IntArray:
    """Return the level (values,) of each value, 0 to LEVELS - 1, clipped at both ends."""
    if high <= low:
        return np.full(len(values), LEVELS // 2, np.int64)
    share = (np.clip(values, low, high) - low) / (high - low)
    return np.rint(share * (LEVELS - 1)).astype(np.int64)


def apply_colors(colorize: Colorize, values: FloatArray) -> tuple[list[Rgb], IntArray]:
    """Apply a caller's color function to values; return the distinct colors, and the index of each value's color."""
    distinct, places = np.unique(values, return_inverse=True)
    named = [parse_color(colorize(value))[:3] for value in distinct.tolist()]
    colors = list(dict.fromkeys(named))
    place_of = {color: place for place, color in enumerate(colors)}
    return colors, np.array([place_of[color] for color in named], np.int64)[places]


@dataclass
class Circle:
    """A disc; `radius` in world units."""

    x: float
    y: float
    radius: float
    color: ColorType = Color.Black


@dataclass
class Rectangle:
    """A rectangle with its top-left corner at (x, y); `width` and `height` in pixels."""

    x: float
    y: float
    width: float
    height: float
    color: ColorType = Color.Black


@dataclass
class AgentData:
    """The look of an agent; `size` in world units."""

    name: str
    color: ColorType = Color.Black
    size: float = 8.0
    image: Any = None  # path of an image; a window may store the loaded image
    current_position: tuple[float, float] | None = None  # position of the last drawing
    least_px: float = 6.0  # minimum radius
    shift: tuple[float, float] = (0.0, 0.0)  # offset of the last drawing to the right and down, in radii
    defaults: dict[str, Any] = field(default_factory=dict, compare=False)  # values filled in

    @classmethod
    def declared(cls, **given: Any) -> "AgentData":
        """Return a look with declared values, so that `fill` may change the others.

        Raises:
            BadType, BadValue: the name is not a string or is empty, or the size is not a finite number.
        """
        as_name(given["name"], "an agent")
        if "size" in given:
            as_float(given["size"], "size")
        look = cls(**given)
        names = ("color",) * ("color" not in given) + ("size", "least_px") * ("size" not in given)
        look.defaults = {name: getattr(look, name) for name in names}
        return look

    def fill(self, other: "AgentData") -> None:
        """Copy the values from another look that were neither declared nor set by the program."""
        for name, value in self.defaults.items():
            if getattr(self, name) == value:
                self.defaults[name] = getattr(other, name)
                setattr(self, name, getattr(other, name))

    def given(self) -> dict[str, Any]:
        """Return the declared values."""
        filled = {name for name, value in self.defaults.items() if getattr(self, name) == value}
        return {name: value for name, value in self.__dict__.items() if name not in filled}


@dataclass
class AgentLooks:
    """The looks of agents of one size that are drawn together, as columns.

    Iteration yields copies as `AgentData`.
    """

    names: Sequence[str]
    rows: IntArray  # (agents,) row of each agent, valid for one structure
    structure: int | None  # the `structure_version` of these rows
    colors: Sequence[Rgb]  # the different ones
    color_rows: IntArray  # (agents,) color index of each agent
    size: float
    least_px: float
    # (agents, 2) positions of the last drawing; NaN: not drawn
    positions: FloatArray = field(init=False, compare=False)
    shifts: FloatArray = field(init=False, compare=False)  # (agents, 2) see `AgentData.shift`

    def __post_init__(self) -> None:
        self.note(np.zeros(len(self.names), bool))

    def note(
        self, is_shown: BoolArray, positions: FloatArray | float = np.nan, shifts: FloatArray | float = 0.0
    ) -> None:
        """Record the positions at which the shown agents were drawn."""
        self.positions = np.full((len(self.names), 2), np.nan)
        self.shifts = np.zeros((len(self.names), 2))
        self.positions[is_shown] = positions
        self.shifts[is_shown] = shifts

    def list_drawn(self) -> tuple[list[str], FloatArray]:
        """Return the names of drawn agents, and (agents, 6): position, shift, size and minimum radius."""
        is_drawn = ~np.isnan(self.positions[:, 0])
        names = [self.names[row] for row in np.flatnonzero(is_drawn).tolist()]
        sizes = np.broadcast_to((self.size, self.least_px), (len(names), 2))
        return names, np.hstack([self.positions[is_drawn], self.shifts[is_drawn], sizes])

    def remove_agents(self, hidden: Collection[str]) -> "AgentLooks":
        """Return the looks without the hidden agents."""
        kept = [row for row, name in enumerate(self.names) if name not in hidden]
        names = [self.names[row] for row in kept]
        return AgentLooks(
            names, self.rows[kept], self.structure, self.colors, self.color_rows[kept], self.size, self.least_px
        )

    def __iter__(self) -> Iterator[AgentData]:
        columns = self.color_rows.tolist(), self.positions.tolist(), self.shifts.tolist()
        for name, row, (x, y), (right, down) in zip(self.names, *columns, strict=True):
            place = (x, y) if x == x else None  # noqa: PLR0124 - unless it is NaN
            yield AgentData(name, self.colors[row], self.size, None, place, self.least_px, (right, down))


@dataclass
class GraphData:
    """The look of the graph; `node_size` in world units."""

    node_color: ColorType = Color.DarkGray
    node_size: float = 2.0
    edge_color: ColorType = Color.LightGray
    draw_id: bool = False
    edge_line_points: dict[int, Any] = field(
        default_factory=dict, compare=False
    )  # graph revision -> cached result of the drawer
