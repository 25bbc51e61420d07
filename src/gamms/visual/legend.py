"""Legends, and values of nodes or edges as colors with a legend."""

from collections.abc import Iterable, Mapping
from copy import copy
from dataclasses import dataclass
from math import cos, pi, sin
from typing import Any, NamedTuple

import numpy as np

from gamms.arguments import as_float
from gamms.errors import BadType, BadValue, UnknownName
from gamms.ir.draw import DrawSpace
from gamms.ir.graph import FloatArray, IntArray, as_node_id
from gamms.text import shown
from gamms.typing import IArtist, IContext
from gamms.visual.appearance import (
    DIVERGING,
    LEVELS,
    PAPER,
    AnyColor,
    Colorize,
    Rgb,
    Rgba,
    apply_colors,
    find_color_table,
    find_levels,
    parse_color,
)
from gamms.visual.camera import Camera
from gamms.visual.drawing import Commands
from gamms.visual.font import MIDDLE, measure_words

_FONT_PX = 21.0
_TITLE_PX = 22.0
_LINE_PX = 23.0
_GAP_PX = 16.0
_PAD_PX = 12.0
_SWATCH_PX = 7.0
_BAR_PX = 16.0
_BAR_HEIGHT_PX = 150.0
_NAME_PX = 2.0 * _SWATCH_PX + 9.0  # where names begin
_ASIDE = 1 / 3  # of the width of a picture: the maximum for a legend
_SMALLEST = 0.7  # the least size of letters, as a share of the usual one
_MOST_ROWS = 12
_DISC = "disc"
SIGN: Rgb = (110, 114, 120)  # signs have the colors of teams, and are explained in grey
_SMALL_PX = 17.0
_HEADING_PX = 17.0
_FAINT = (119, 119, 119)
_LARGE = "0000"
_FAINT_BY_NIGHT = (150, 154, 160)
_MOST_COLORS = 1024
_RIM = (255, 255, 255)


class ColorScale(NamedTuple):
    """A color scale: colors from low to high, and labels at its low end, middle and high end."""

    title: str
    colors: tuple[Rgb, ...]
    low: str
    middle: str
    high: str


class LegendRow(NamedTuple):
    """A row of a legend: a color or a sign, its meaning, and a value to the right."""

    color: Rgb
    name: str
    value: str = ""
    sign: str = "disc"  # or a name of `_SIGNS`


class LegendRows(NamedTuple):
    """A block of legend rows with colors and signs; blocks without a title are shown together."""

    title: str
    rows: tuple[LegendRow, ...]
    heading: str = ""  # the heading of the column of values


Block = ColorScale | LegendRows


def list_blocks(ctx: IContext, artists: Mapping[str, IArtist]) -> tuple[Block, ...]:
    """Return the blocks of the legends of visible artists, lower layers first.

    Raises:
        BadType: a legend is none.
    """
    found: list[Block] = []
    for name, artist in sorted(artists.items(), key=lambda item: item[1].get_layer()):
        data = getattr(artist, "data", None)
        default = getattr(artist.get_drawer(), "legend", None)
        legend = data.get("legend", default) if isinstance(data, dict) and artist.get_visible() else None
        legend = legend(ctx) if callable(legend) else legend
        for block in legend if isinstance(legend, list) else [legend]:
            if block is None:
                continue
            if not isinstance(block, ColorScale | LegendRows):
                raise BadType(
                    f"The legend of artist {shown(name)} must be LegendRows, a ColorScale, or a list of these, "
                    f"not {shown(block)}."
                )
            found.append(block)
    return merge_blocks(found)


def merge_blocks(blocks: Iterable[Block]) -> tuple[Block, ...]:
    """Merge the blocks without title, and without values other than scores, into one; equal rows appear once."""
    found = list[Block | None]()
    rows = dict[tuple[object, ...], LegendRow]()
    heading = ""
    for block in blocks:
        if isinstance(block, ColorScale) or not _is_open(block):
            found.append(block)
            continue
        found += [None] * (None not in found)
        rows |= {(row.color, row.name, row.sign): row for row in block.rows}
        heading = heading or block.heading
    return tuple(LegendRows("", tuple(rows.values()), heading) if block is None else block for block in found)


def grow_blocks(before: tuple[Block, ...], now: tuple[Block, ...]) -> tuple[Block, ...]:
    """Return the blocks of now with the open rows of before in their order, so that no row ever moves in a film."""
    open_before = [block for block in before if _is_open(block)]
    if not open_before:
        return now
    place = next((place for place, block in enumerate(now) if _is_open(block)), len(now))
    return *now[:place], *merge_blocks([*open_before, *now[place : place + 1]]), *now[place + 1 :]


def _is_open(block: Block) -> bool:
    """Return whether rows may be shown with others: rows without a title, and without values except scores."""
    return (
        isinstance(block, LegendRows)
        and not block.title
        and (bool(block.heading) or not any(row.value for row in block.rows))
    )


def make_plain_block(block: Block) -> dict[str, Any]:
    """Return a block as plain values, for a recording."""
    if isinstance(block, ColorScale):
        return {"title": block.title, "colors": list(block.colors), "ends": [block.low, block.middle, block.high]}
    rows = [tuple(row) if row.sign != _DISC else tuple(row)[:3] for row in block.rows]
    return {"title": block.title, "rows": rows} | ({"heading": block.heading} if block.heading else {})


def make_block(plain: dict[str, Any]) -> Block:
    """Return the block that `make_plain_block` described.

    Raises:
        BadType, BadValue, KeyError, TypeError: it did not describe this.
    """
    words = [plain["title"], *plain.get("ends", ())]
    for _, *row in plain.get("rows", ()):
        words += row
    words.append(plain.get("heading", ""))
    if not all(isinstance(word, str) for word in words):
        raise BadType("The words of a recorded legend must be str.")
    if "rows" in plain:
        return LegendRows(
            words[0], tuple(LegendRow(parse_color(color)[:3], *row) for color, *row in plain["rows"]), words[-1]
        )
    low, middle, high = words[1:-1]
    colors = tuple(parse_color(color)[:3] for color in plain["colors"])
    if not 0 < len(colors) <= _MOST_COLORS:
        raise BadValue(f"The bar of a recorded legend has between 1 and {_MOST_COLORS} colors, not {len(colors)}.")
    return ColorScale(words[0], colors, low, middle, high)


class Legend:
    """The layout of a legend: blocks, one below the other.

    Letters shrink until the blocks fit a third of the width of the picture, and its height. Where they would be too
    small, the rows with signs are left out; where that is not enough, the legend.

    Args:
        blocks: the blocks from top to bottom.
        width: the width of the picture, pixels.
        height: the available height, pixels.

    Attributes:
        width, height: pixels; 0.0 where there is no room for a legend, or there is nothing to explain.
        least: the width of a picture, and the height of the room, in which it looks the same.
    """

    def __init__(self, blocks: tuple[Block, ...], width: float, height: float) -> None:
        self._blocks: tuple[Block, ...] = ()
        self._zoom = 1.0
        self.width = 0.0
        self.height = 0.0
        self.least = (0.0, 0.0)
        for tried in (blocks, _remove_signs(blocks)):
            wide = max(map(_measure_width, tried), default=0.0)
            high = sum(map(_measure_height, tried)) + _GAP_PX * (len(tried) - 1)
            if wide > 0.0 and high > 0.0:
                zoom = min(1.0, _ASIDE * (width - _PAD_PX) / wide, height / high)
                if zoom >= _SMALLEST:
                    self._blocks = tried
                    self._zoom = zoom
                    self.width = zoom * wide
                    self.height = zoom * high
                    self.least = self.width / _ASIDE + _PAD_PX, self.height
                    return

    def draw(self, pen: "Pen", left: float, top: float, ground: Rgba | None) -> None:
        """Draw the legend, on a background if it covers the map."""
        if self._blocks and ground is not None:
            pen.draw_rectangle(
                left - _PAD_PX, top - _PAD_PX, self.width + 2.0 * _PAD_PX, self.height + 2.0 * _PAD_PX, ground
            )
        pen = pen.copy_zoomed(self._zoom, left, top)
        top = 0.0
        for block in self._blocks:
            if isinstance(block, ColorScale):
                _draw_bar(pen, block, top)
            else:
                _draw_rows(pen, block, top)
            top += _measure_height(block) + _GAP_PX


def _remove_signs(blocks: tuple[Block, ...]) -> tuple[Block, ...]:
    """Return the blocks of a legend that explain colors."""
    found = list[Block]()
    for block in blocks:
        if isinstance(block, ColorScale):
            found.append(block)
            continue
        rows = tuple(row for row in block.rows if row.sign == _DISC)
        if block.title or rows:
            found.append(block._replace(rows=rows))
    return tuple(found)


class Pen:
    """Draws in page units, 1/96 inch from the upper left corner, through a camera of the world.

    Args:
        camera: the camera of the picture.
        fine: the number of camera pixels per 1/96 inch.
        ink: the color of texts.

    Attributes:
        camera: the camera of the picture.
        ink: the color of texts.
        commands: what was drawn.
    """

    def __init__(self, camera: Camera, fine: float, ink: Rgb) -> None:
        self.camera = camera
        self.ink = ink
        self.commands = Commands()
        self._scale = camera.scale / fine
        self._zoom = 1.0
        self._begin = (0.0, 0.0)

    def copy_zoomed(self, zoom: float, left: float, top: float) -> "Pen":
        """Return a pen that draws into the same commands, in another size, and from a point of this one's."""
        pen = copy(self)
        pen._begin = (left, top)
        pen._zoom = zoom
        return pen

    @property
    def faint(self) -> Rgb:
        """The color of headings: a pale variant of the text color."""
        return _FAINT if sum(self.ink) < 3 * 128 else _FAINT_BY_NIGHT

    def _convert_point(self, x: float, y: float) -> tuple[float, float]:
        left, top = (begin + self._zoom * way for begin, way in zip(self._begin, (x, y), strict=True))
        return self.camera.left + left / self._scale, self.camera.top - top / self._scale

    def draw_rectangle(self, x: float, y: float, width: float, height: float, color: AnyColor) -> None:
        """Fill a rectangle from its upper left corner."""
        self.commands.add_rectangle(*self._convert_point(x, y), self._zoom * width, self._zoom * height, color)

    def draw_circle(self, x: float, y: float, radius: float, color: AnyColor, width: float = 0.0) -> None:
        """Draw a circle; a width of 0 fills it."""
        place = self._convert_point(x, y)
        zoom = self._zoom
        self.commands.add_circles([place], zoom * radius, color, zoom * width, DrawSpace.SCREEN)

    def draw_line(self, points: Iterable[tuple[float, float]], color: AnyColor, width: float) -> None:
        """Draw a polyline."""
        self.commands.add_line([self._convert_point(*point) for point in points], color, self._zoom * width)

    def draw_polygon(self, points: Iterable[tuple[float, float]], color: AnyColor) -> None:
        """Fill a polygon."""
        self.commands.add_polygon([self._convert_point(*point) for point in points], color)

    def draw_turned_text(self, words: str, corner: tuple[float, float], font_px: float, ink: Rgb, angle: float) -> None:
        """Write words from their upper left corner, turned around that counter-clockwise by degrees."""
        self.commands.add_text(words, *self._convert_point(*corner), ink, self._zoom * font_px, angle)

    def draw_text(self, words: str, x: float, middle: float, font_px: float, ink: Rgb | None = None) -> None:
        """Write words whose small letters have their middle so far down."""
        place = self._convert_point(x, middle - MIDDLE * font_px)
        self.commands.add_text(words, *place, ink or self.ink, self._zoom * font_px)


def _draw_bar(pen: Pen, bar: ColorScale, top: float) -> None:
    top += _draw_title(pen, bar.title, top)
    step = _BAR_HEIGHT_PX / len(bar.colors)
    bottom = top + _BAR_HEIGHT_PX
    for number, color in enumerate(reversed(bar.colors)):  # each down to the bottom, so that no seam shows
        begin = top + number * step
        pen.draw_rectangle(0.0, begin, _BAR_PX, bottom - begin, color)
    for words, y in ((bar.high, top + 6.0), (bar.middle, (top + bottom) / 2), (bar.low, bottom - 6.0)):
        pen.draw_text(words, _BAR_PX + 8.0, y, _FONT_PX)


def _draw_rows(pen: Pen, block: LegendRows, top: float) -> None:
    top += _draw_title(pen, block.title, top)
    end = _measure_values_end(block)
    if block.heading:
        pen.draw_text(
            block.heading, end - measure_words(block.heading, _SMALL_PX), top + 0.4 * _LINE_PX, _SMALL_PX, pen.faint
        )
        top += _HEADING_PX
    for number, row in enumerate(_select_rows(block)):
        middle = top + (number + 0.5) * _LINE_PX
        color = pen.faint if row.color == SIGN and row.sign != _DISC else row.color
        _draw_sign(pen, row.sign, _SWATCH_PX + 1.0, middle, color)
        pen.draw_text(row.name, _NAME_PX, middle, _FONT_PX)
        if row.value:
            pen.draw_text(row.value, end - measure_words(row.value, _FONT_PX), middle, _FONT_PX)


class _SignPart(NamedTuple):
    """A part of a sign: a circle, or a line or polygon through points to the right and down; pixels."""

    width: float = 0.0  # 0 = filled
    radius: float = 0.0
    points: tuple[tuple[float, float], ...] = ()
    alpha: int = 255
    color: Rgb | None = None  # None: that of the row


def _make_ring(radius: float, width: float = 2.0) -> _SignPart:
    return _SignPart(width, radius)


def _make_line(width: float, *points: tuple[float, float], alpha: int = 255) -> _SignPart:
    return _SignPart(width, points=points, alpha=alpha)


def _make_arc(width: float, radius: float, begin: float, end: float) -> _SignPart:
    """Return a part of a circle, from the top on clockwise, in full turns."""
    turns = np.linspace(begin, end, 5) * 2.0 * pi
    return _make_line(width, *((radius * sin(turn), -radius * cos(turn)) for turn in turns.tolist()))


_TIMER = _make_line(3.5, *((6.5 * sin(step * pi / 16), -6.5 * cos(step * pi / 16)) for step in range(13)))
_SIGNS = {
    _DISC: (_SignPart(radius=_SWATCH_PX + 1.5, color=_RIM), _SignPart(radius=_SWATCH_PX)),
    "ring": (_make_ring(6.5),),
    "dot": (_SignPart(radius=3.5, alpha=200),),
    "field": (_SignPart(radius=8.0, alpha=50), _SignPart(1.0, 8.0, alpha=150)),
    "range": tuple(_make_arc(1.2, 7.5, gap / 8, (gap + 0.6) / 8) for gap in range(8)),
    "line": (_make_line(4.0, (-8.0, 0.0), (8.0, 0.0), alpha=150),),
    "curve": (_make_line(2.0, *((x, x * x / 12 - 3.0) for x in range(-8, 9, 2))),),
    "band": (_make_line(9.0, (-6.0, 0.0), (6.0, 0.0), alpha=90),),
    "flag": (_make_line(2.0, (-4.0, 8.0), (-4.0, -8.0)), _make_line(0.0, (-4.0, -8.0), (7.0, -4.5), (-4.0, -1.0))),
    "cross": (_make_line(2.5, (-5.0, 5.0), (5.0, -5.0)), _make_line(2.5, (-5.0, -5.0), (5.0, 5.0))),
    "tick": (_make_line(2.5, (-6.0, 0.5), (-2.0, 5.0), (6.0, -5.0)),),
    "tag": (_make_ring(7.0, 1.5), _make_line(1.5, (-3.5, 3.5), (3.5, -3.5)), _make_line(1.5, (-3.5, -3.5), (3.5, 3.5))),
    "goal": (
        _make_ring(5.5, 1.5),
        _make_ring(2.0, 1.5),
        *(_make_line(1.5, (5.5 * x, 5.5 * y), (9.0 * x, 9.0 * y)) for x, y in ((1, 0), (0, 1), (-1, 0), (0, -1))),
    ),
    "arc": (_make_ring(6.5, 1.0), _TIMER),
    "base": (_make_line(2.0, (6.0, 6.0), (6.0, -6.0), (-6.0, -6.0), (-6.0, 6.0), (6.0, 6.0)),),
    "plus": (_make_line(2.0, (-7.0, 0.0), (7.0, 0.0)), _make_line(2.0, (0.0, -7.0), (0.0, 7.0))),
    "timer": (_TIMER,),
    "square": (_make_line(2.0, (0.0, 7.0), (7.0, 0.0), (0.0, -7.0), (-7.0, 0.0), (0.0, 7.0)),),
    "gauge": (_make_line(5.0, (-8.0, 0.0), (8.0, 0.0), alpha=90), _make_line(5.0, (-8.0, 0.0), (2.0, 0.0))),
}


def _draw_sign(pen: Pen, sign: str, x: float, y: float, color: Rgb) -> None:
    for part in _SIGNS.get(sign, _SIGNS[_DISC]):
        ink = (*(part.color or color), part.alpha)
        points = [(x + right, y + down) for right, down in part.points]
        if part.radius:
            pen.draw_circle(x, y, part.radius, ink, part.width)
        elif part.width:
            pen.draw_line(points, ink, part.width)
        else:
            pen.draw_polygon(points, ink)


def _draw_title(pen: Pen, title: str, top: float) -> float:
    """Write a title, and return its height, pixels."""
    if title:
        pen.draw_text(title, 0.0, top + 0.5 * _LINE_PX, _TITLE_PX)
    return _measure_title_height(title)


def _measure_title_height(title: str) -> float:
    return _LINE_PX + 3.0 if title else 0.0


def _measure_height(block: Block) -> float:
    body = (
        _BAR_HEIGHT_PX
        if isinstance(block, ColorScale)
        else _LINE_PX * len(_select_rows(block)) + _HEADING_PX * bool(block.heading)
    )
    return _measure_title_height(block.title) + body


def _measure_width(block: Block) -> float:
    if isinstance(block, ColorScale):
        body = _BAR_PX + 8.0 + max(measure_words(words, _FONT_PX) for words in (block.low, block.middle, block.high))
    else:
        names = max((measure_words(row.name, _FONT_PX) for row in _select_rows(block)), default=0.0)
        body = max(_NAME_PX + names, _measure_values_end(block))
    return max(body, measure_words(block.title, _TITLE_PX))


def _measure_values_end(block: LegendRows) -> float:
    """Return the right edge of the column of values, right of the names and wide enough for growing numbers."""
    valued = [row for row in block.rows if row.value]
    if not valued:
        return 0.0
    values = [measure_words(row.value, _FONT_PX) for row in valued]
    if block.heading:
        values += [measure_words(block.heading, _SMALL_PX), measure_words(_LARGE, _FONT_PX)]
    return _NAME_PX + max(measure_words(row.name, _FONT_PX) for row in valued) + _PAD_PX + max(values)


def _select_rows(block: LegendRows) -> tuple[LegendRow, ...]:
    """Return the rows that fit, without the rest."""
    if len(block.rows) <= _MOST_ROWS:
        return block.rows
    return (*block.rows[: _MOST_ROWS - 1], LegendRow(PAPER, f"and {len(block.rows) - _MOST_ROWS + 1} more"))


def draw_nothing(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw nothing: the artist has a legend only."""


draw_nothing.once_a_turn = True  # type: ignore[attr-defined]  # what drawers are asked for


_FEW_COLORS = 8  # up to this number of distinct colors, each has a row
_STEPS = 64  # of a bar
_HUNDRED = 100.0
_HUGE = 1e7


@dataclass(frozen=True, eq=False)
class ColoredValues:
    """Ids with the indices of their colors; ids without a value (NaN) are left out.

    Attributes:
        of: "nodes" or "edges".
        ids: (values,)
        colors: the distinct colors, from low to high.
        places: (values,) the index of each value's color in `colors`.
        legend: the scale or the rows that explain the colors; None if there are no values.
    """

    of: str
    ids: IntArray
    colors: tuple[Rgb, ...]
    places: IntArray
    legend: Block | None


def check_colored_values(
    of: str,
    given: Mapping[int, float],
    known: IntArray,
    cmap: str | Colorize,
    span: tuple[float | None, float | None],
    title: str,
) -> ColoredValues:
    """Check values of nodes or edges, and convert them to colors.

    Args:
        of: "nodes" or "edges".
        given: id -> value; ids with NaN are omitted.
        known: all valid ids.
        cmap: the name of a color map, or a function from a value to a color.
        span: the lowest and the highest value of the color map; None: the range of the values.
        title: the title of the legend.

    Raises:
        BadType, BadValue: not a mapping to numbers, a function that gives no color, or an impossible span.
        UnknownName (KeyError): no such node or edge, or no such color map.
    """
    if not isinstance(given, Mapping):
        raise BadType(f"{of} must be a mapping from ids to values, not {shown(given)} ({type(given).__name__}).")
    ids = np.array([as_node_id(id, f"An id of {of}") for id in given], np.int64)
    strange = ids[~np.isin(ids, known)].tolist()
    if strange:
        raise UnknownName(of.removesuffix("s"), strange[0])
    values = _convert_values(given.values(), of)
    is_shown = ~np.isnan(values)
    ids = ids[is_shown]
    values = values[is_shown]
    if callable(cmap):
        colors, places = apply_colors(cmap, values)
        low, high = _find_span(values, span)
        return ColoredValues(of, ids, tuple(colors), places, _make_function_key(cmap, values, low, high, title))
    colors = list(find_color_table(cmap))
    low, high = _find_span(values, span, is_even=cmap == DIVERGING)
    bar = _make_color_bar(title, colors, low, high) if len(values) else None
    return ColoredValues(of, ids, tuple(colors), find_levels(values, low, high), bar)


def _convert_values(values: Iterable[Any], of: str) -> FloatArray:
    """Convert values to floats; NaN and infinite values are allowed."""
    found = list(values)
    if not all(type(value) in (float, int) for value in found):
        found = [value if _is_endless(value) else as_float(value, f"A value of {of}") for value in found]
    try:
        return np.array(found, float)
    except OverflowError:
        raise BadValue(f"A value of {of} is too large for a float.") from None


def _is_endless(value: object) -> bool:
    return isinstance(value, float | np.floating) and not np.isfinite(value)


def _find_span(
    values: FloatArray, span: tuple[float | None, float | None], *, is_even: bool = False
) -> tuple[float, float]:
    """Return the values at both ends of the color map: as given, or the extremes of the finite values."""
    given = tuple(
        None if end is None else as_float(end, name) for name, end in zip(("vmin", "vmax"), span, strict=True)
    )
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 0.0)
    if is_even and given == (None, None):
        farthest = max(abs(low), abs(high))
        return -farthest, farthest
    low = low if given[0] is None else given[0]
    high = high if given[1] is None else given[1]
    if given != (None, None) and low >= high:
        raise BadValue(f"The colors need vmin below vmax, not from {low:g} to {high:g}.")
    return low, high


def _make_function_key(colorize: Colorize, values: FloatArray, low: float, high: float, title: str) -> Block | None:
    distinct = np.unique(values)
    if len(distinct) == 0:
        return None
    if len(distinct) <= _FEW_COLORS:
        return LegendRows(
            title, tuple(LegendRow(parse_color(colorize(value))[:3], f"{value:g}") for value in distinct.tolist())
        )
    shown = distinct[np.rint(np.linspace(0, len(distinct) - 1, min(_STEPS, len(distinct)))).astype(int)]
    if np.isfinite(distinct).all() and high > low:  # the nearest existing value at even steps
        wanted = np.linspace(low, high, _STEPS)
        shown = distinct[np.abs(distinct[:, None] - wanted).argmin(axis=0)]
    return _make_color_bar(title, [parse_color(colorize(value))[:3] for value in shown.tolist()], low, high)


def _make_color_bar(title: str, colors: list[Rgb], low: float, high: float) -> Block:
    if high <= low:
        return LegendRows(title, (LegendRow(colors[LEVELS // 2 if len(colors) == LEVELS else 0], f"{low:g}"),))
    thinned = [colors[place] for place in np.rint(np.linspace(0, len(colors) - 1, _STEPS)).astype(int).tolist()]
    return ColorScale(title, tuple(thinned), *map(_tick, (low, (low + high) / 2, high)))


def _tick(value: float) -> str:
    """Return a number with three digits, or all digits of a large integer."""
    return f"{value:.0f}" if _HUNDRED <= abs(value) < _HUGE else f"{value:.3g}"
