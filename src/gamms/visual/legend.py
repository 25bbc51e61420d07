"""Legends, and values of nodes or edges in colours that a legend explains."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from gamms.arguments import as_float, as_int
from gamms.errors import BadType, BadValue, UnknownName
from gamms.ir.draw import DrawSpace
from gamms.ir.graph import FloatArray, IntArray
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
    colorized,
    levels,
    rgba,
    table,
)
from gamms.visual.camera import Camera
from gamms.visual.drawing import Commands
from gamms.visual.lettering import words_width

_FONT_PX, _TITLE_PX = 21.0, 22.0
_LINE_PX, _GAP_PX, _PAD_PX = 23.0, 16.0, 12.0
_SWATCH_PX, _BAR_PX, _BAR_HEIGHT_PX = 7.0, 16.0, 150.0
_ASIDE = 0.4  # of the width of a picture: no more is taken from the map
_MOST_ROWS = 12
_MOST_COLORS = 1024
_RIM = (255, 255, 255)


class Bar(NamedTuple):
    """A scale: its colours from low to high, and the words at its low end, middle and high end."""

    title: str
    colors: tuple[Rgb, ...]
    low: str
    middle: str
    high: str


class Row(NamedTuple):
    """One colour, what it stands for, and a value to the right of that."""

    color: Rgb
    name: str
    value: str = ""


class Rows(NamedTuple):
    """Colours that are explained one by one."""

    title: str
    rows: tuple[Row, ...]


Block = Bar | Rows


def blocks_of(ctx: IContext, artists: Mapping[str, IArtist]) -> tuple[Block, ...]:
    """Return the blocks of the legends of visible artists, lower layers first.

    Raises:
        BadType: a legend is none.
    """
    found: list[Block] = []
    for name, artist in sorted(artists.items(), key=lambda item: item[1].get_layer()):
        data = getattr(artist, "data", None)
        legend = data.get("legend") if isinstance(data, dict) and artist.get_visible() else None
        legend = legend(ctx) if callable(legend) else legend
        for block in legend if isinstance(legend, list) else [legend]:
            if block is None:
                continue
            if not isinstance(block, Bar | Rows):
                raise BadType(
                    f"The legend of artist {shown(name)} must be a Bar or Rows, or a list of such, not {shown(block)}."
                )
            found.append(block)
    return tuple(found)


def plain_block(block: Block) -> dict[str, Any]:
    """Return a block as plain values, for a recording."""
    if isinstance(block, Bar):
        return {"title": block.title, "colors": list(block.colors), "ends": [block.low, block.middle, block.high]}
    return {"title": block.title, "rows": [tuple(row) for row in block.rows]}


def block_from_plain(plain: dict[str, Any]) -> Block:
    """Return the block that `plain_block` described.

    Raises:
        BadType, BadValue, KeyError, TypeError: it did not describe this.
    """
    words = [plain["title"], *plain.get("ends", ()), *(word for _, *row in plain.get("rows", ()) for word in row)]
    if not all(isinstance(word, str) for word in words):
        raise BadType("The words of a recorded legend must be str.")
    if "rows" in plain:
        return Rows(words[0], tuple(Row(rgba(color)[:3], *words) for color, *words in plain["rows"]))
    low, middle, high = words[1:]
    colors = tuple(rgba(color)[:3] for color in plain["colors"])
    if not 0 < len(colors) <= _MOST_COLORS:
        raise BadValue(f"The bar of a recorded legend has between 1 and {_MOST_COLORS} colours, not {len(colors)}.")
    return Bar(words[0], colors, low, middle, high)


class Legend:
    """Blocks, one below the other.

    Args:
        blocks: from top to bottom.
        width: of the picture, pixels.
        height: of the picture, pixels.

    Attributes:
        width, height: pixels; 0.0 where the picture is too small for a legend, or there is nothing to explain.
    """

    def __init__(self, blocks: tuple[Block, ...], width: float, height: float) -> None:
        wide, high = max(map(_width, blocks), default=0.0), sum(map(_height, blocks)) + _GAP_PX * (len(blocks) - 1)
        has_room = bool(blocks) and wide + 3.0 * _PAD_PX <= _ASIDE * width and high + 3.0 * _PAD_PX <= height
        self._blocks = blocks if has_room else ()
        self.width, self.height = (wide, high) if has_room else (0.0, 0.0)

    def draw(self, pen: "Pen", left: float, top: float, ground: Rgba) -> None:
        """Draw it; the ground lies between it and the map."""
        if self._blocks:
            pen.rectangle(
                left - _PAD_PX, top - _PAD_PX, self.width + 2.0 * _PAD_PX, self.height + 2.0 * _PAD_PX, ground
            )
        for block in self._blocks:
            if isinstance(block, Bar):
                _draw_bar(pen, block, left, top)
            else:
                _draw_rows(pen, block, left, top, self.width)
            top += _height(block) + _GAP_PX


class Pen:
    """Draws at points in 96ths of an inch from the upper left corner, through a camera that looks at the world.

    Args:
        camera: of the picture.
        fine: how many of its pixels are a 96th of an inch.
        ink: of words.
    """

    def __init__(self, camera: Camera, fine: float, ink: Rgb) -> None:
        self._camera, self._ink, self.commands = camera, ink, Commands()
        self._scale = camera.scale / fine

    def _place(self, x: float, y: float) -> tuple[float, float]:
        return self._camera.left + x / self._scale, self._camera.top - y / self._scale

    def rectangle(self, x: float, y: float, width: float, height: float, color: AnyColor) -> None:
        """Fill a rectangle from its upper left corner."""
        self.commands.add_rectangle(*self._place(x, y), width, height, color)

    def disc(self, x: float, y: float, radius: float, color: AnyColor) -> None:
        """Fill a disc with a bright rim."""
        for size, ink in ((radius + 1.5, _RIM), (radius, color)):
            self.commands.add_circles([self._place(x, y)], size, ink, space=DrawSpace.SCREEN)

    def line(self, points: Iterable[tuple[float, float]], color: AnyColor, width: float) -> None:
        """Draw a polyline."""
        self.commands.add_line([self._place(*point) for point in points], color, width)

    def polygon(self, points: Iterable[tuple[float, float]], color: AnyColor) -> None:
        """Fill a polygon."""
        self.commands.add_polygon([self._place(*point) for point in points], color)

    def text(self, words: str, x: float, middle: float, font_px: float, ink: Rgb | None = None) -> None:
        """Write words whose small letters have their middle so far down."""
        self.commands.add_text(words, *self._place(x, middle - 0.36 * font_px), ink or self._ink, font_px)


def _draw_bar(pen: Pen, bar: Bar, left: float, top: float) -> None:
    top += _draw_title(pen, bar.title, left, top)
    step, bottom = _BAR_HEIGHT_PX / len(bar.colors), top + _BAR_HEIGHT_PX
    for number, color in enumerate(reversed(bar.colors)):  # each down to the bottom, so that no seam shows
        begin = top + number * step
        pen.rectangle(left, begin, _BAR_PX, bottom - begin, color)
    for words, y in ((bar.high, top + 6.0), (bar.middle, (top + bottom) / 2), (bar.low, bottom - 6.0)):
        pen.text(words, left + _BAR_PX + 8.0, y, _FONT_PX)


def _draw_rows(pen: Pen, block: Rows, left: float, top: float, width: float) -> None:
    top += _draw_title(pen, block.title, left, top)
    for number, row in enumerate(_shown(block)):
        middle = top + (number + 0.5) * _LINE_PX
        pen.disc(left + _SWATCH_PX + 1.0, middle, _SWATCH_PX, row.color)
        pen.text(row.name, left + 2.0 * _SWATCH_PX + 9.0, middle, _FONT_PX)
        if row.value:
            pen.text(row.value, left + width - words_width(row.value, _FONT_PX), middle, _FONT_PX)


def _draw_title(pen: Pen, title: str, left: float, top: float) -> float:
    """Write a title, and return its height, pixels."""
    if title:
        pen.text(title, left, top + 0.5 * _LINE_PX, _TITLE_PX)
    return _title_height(title)


def _title_height(title: str) -> float:
    return _LINE_PX + 3.0 if title else 0.0


def _height(block: Block) -> float:
    body = _BAR_HEIGHT_PX if isinstance(block, Bar) else _LINE_PX * len(_shown(block))
    return _title_height(block.title) + body


def _width(block: Block) -> float:
    if isinstance(block, Bar):
        body = _BAR_PX + 8.0 + max(words_width(words, _FONT_PX) for words in (block.low, block.middle, block.high))
    else:
        values = max((words_width(row.value, _FONT_PX) for row in block.rows), default=0.0)
        names = max((words_width(row.name, _FONT_PX) for row in _shown(block)), default=0.0)
        body = 2.0 * _SWATCH_PX + 9.0 + names + (values + _PAD_PX if values else 0.0)
    return max(body, words_width(block.title, _TITLE_PX))


def _shown(block: Rows) -> tuple[Row, ...]:
    """Return the rows, without those that are too many."""
    if len(block.rows) <= _MOST_ROWS:
        return block.rows
    return (*block.rows[: _MOST_ROWS - 1], Row(PAPER, f"and {len(block.rows) - _MOST_ROWS + 1} more"))


def legend_only(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw nothing: the artist has a legend only."""


legend_only.once_a_turn = True  # type: ignore[attr-defined]  # what drawers are asked for


_FEW_COLORS = 8  # so many different ones are explained one by one
_STEPS = 64  # of a bar
_HUNDRED, _HUGE = 100.0, 1e7


@dataclass(frozen=True, eq=False)
class Values:
    """Ids with their places among a few colours; those without a value (NaN) are left out.

    Attributes:
        of: "nodes" or "edges".
        ids: (values,)
        colors: the different colours, from low to high.
        places: (values,) of each value's colour among `colors`.
        legend: the bar or the rows that explain the colours; None where there is nothing to explain.
    """

    of: str
    ids: IntArray
    colors: tuple[Rgb, ...]
    places: IntArray
    legend: Block | None


def checked(
    of: str,
    given: Mapping[int, float],
    known: IntArray,
    cmap: str | Colorize,
    span: tuple[float | None, float | None],
    title: str,
) -> Values:
    """Check the values that a caller gave, and return them in colours.

    Args:
        of: "nodes" or "edges".
        given: id -> value; NaN leaves it out.
        known: all ids there are.
        cmap: the name of a colour map, or a function from a value to a colour.
        span: the lowest and the highest value of the map; None takes it from the values.
        title: of the legend.

    Raises:
        BadType, BadValue: not a mapping to numbers, a function that gives no colour, or an impossible span.
        UnknownName (KeyError): no such node or edge, or no such colour map.
    """
    if not isinstance(given, Mapping):
        raise BadType(f"{of} must be a mapping from ids to values, not {shown(given)} ({type(given).__name__}).")
    ids = np.array([as_int(id, f"An id of {of}") for id in given], np.int64)
    strange = ids[~np.isin(ids, known)].tolist()
    if strange:
        raise UnknownName(of.removesuffix("s"), strange[0])
    values = _numbers(given.values(), of)
    is_shown = ~np.isnan(values)
    ids, values = ids[is_shown], values[is_shown]
    if callable(cmap):
        colors, places = colorized(cmap, values)
        low, high = _span(values, span)
        return Values(of, ids, tuple(colors), places, _key_of_function(cmap, values, low, high, title))
    colors, (low, high) = list(table(cmap)), _span(values, span, is_even=cmap == DIVERGING)
    bar = _bar(title, colors, low, high) if len(values) else None
    return Values(of, ids, tuple(colors), levels(values, low, high), bar)


def _numbers(values: Iterable[Any], of: str) -> FloatArray:
    """Return numbers, NaN and infinite ones among them."""
    found = list(values)
    if not all(type(value) in (float, int) for value in found):
        found = [value if _is_endless(value) else as_float(value, f"A value of {of}") for value in found]
    try:
        return np.array(found, float)
    except OverflowError:
        raise BadValue(f"A value of {of} is too large for a float.") from None


def _is_endless(value: object) -> bool:
    return isinstance(value, float | np.floating) and not np.isfinite(value)


def _span(values: FloatArray, span: tuple[float | None, float | None], *, is_even: bool = False) -> tuple[float, float]:
    """Return the values at both ends of the map: the given ones, or those of the finite values.

    Raises:
        BadValue: the lower one is not below the higher.
    """
    given = tuple(
        None if end is None else as_float(end, name) for name, end in zip(("vmin", "vmax"), span, strict=True)
    )
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 0.0)
    if is_even and given == (None, None):
        farthest = max(abs(low), abs(high))
        return -farthest, farthest
    low, high = low if given[0] is None else given[0], high if given[1] is None else given[1]
    if given != (None, None) and low >= high:
        raise BadValue(f"The colours need vmin below vmax, not from {low:g} to {high:g}.")
    return low, high


def _key_of_function(colorize: Colorize, values: FloatArray, low: float, high: float, title: str) -> Block | None:
    distinct = np.unique(values)
    if len(distinct) == 0:
        return None
    if len(distinct) <= _FEW_COLORS:
        return Rows(title, tuple(Row(rgba(colorize(value))[:3], f"{value:g}") for value in distinct.tolist()))
    shown = distinct[np.rint(np.linspace(0, len(distinct) - 1, min(_STEPS, len(distinct)))).astype(int)]
    if (
        np.isfinite(distinct).all() and high > low
    ):  # at even steps, for each step it asks for the nearest value there is
        wanted = np.linspace(low, high, _STEPS)
        shown = distinct[np.abs(distinct[:, None] - wanted).argmin(axis=0)]
    return _bar(title, [rgba(colorize(value))[:3] for value in shown.tolist()], low, high)


def _bar(title: str, colors: list[Rgb], low: float, high: float) -> Block:
    if high <= low:
        return Rows(title, (Row(colors[LEVELS // 2 if len(colors) == LEVELS else 0], f"{low:g}"),))
    thinned = [colors[place] for place in np.rint(np.linspace(0, len(colors) - 1, _STEPS)).astype(int).tolist()]
    return Bar(title, tuple(thinned), *map(_tick, (low, (low + high) / 2, high)))


def _tick(value: float) -> str:
    """Return a number in three digits, or in all of those of a large integer."""
    return f"{value:.0f}" if _HUNDRED <= abs(value) < _HUGE else f"{value:.3g}"
