"""The panels of a window: text, the legend and small print, in the colors of a theme."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from gamms.ir.graph import FloatArray
from gamms.typing import IContext
from gamms.visual.appearance import Rgb, Rgba
from gamms.visual.backends.pygame_backend import Canvas, load, paint_transparent
from gamms.visual.backends.raster import Painting
from gamms.visual.camera import Camera, Point
from gamms.visual.captions import (
    INDENT_PX,
    LINE_PX,
    CaptionLine,
    ResultCard,
    draw_captions,
    draw_card,
    measure_captions_width,
    measure_card,
)
from gamms.visual.charts import HEIGHT_PX, WIDTH_PX, ChartLine, draw_chart
from gamms.visual.font import measure_words
from gamms.visual.keys import explain_keys
from gamms.visual.layout import Layout
from gamms.visual.legend import Block, Legend, Pen
from gamms.visual.themes import Theme

HudLines = Callable[[IContext], Iterable[Any]]

EDGE_PX = 12  # between a panel and the edge of the window
FONT_PX = 21
_LINE_PX = 20
_PAD_PX = 10
_SMALL_PX = 17
_ABOVE_NOTE_PX = 14
BADGE_PX = 24
_FOOT_PX = 64  # of the window, where it asks and names the source of the map
_HINT = "F1: keys"
_LONGEST = 90  # letters of a line


class Hud:
    """Paints the text that belongs to the window and not to the world.

    Attributes:
        legend: in the upper right corner.
        is_shown: whether lines, legend and help are.
        has_help: whether the keys are explained.
        layout: of this frame, with the areas of its panels.
    """

    def __init__(self, theme: Theme) -> None:
        self.theme = theme
        self.is_shown = True
        self.has_help = False
        self.layout = Layout((0.0, 0.0, 0.0, 0.0))
        self.legend = WindowLegend(theme)

    def set_theme(self, theme: Theme) -> None:
        """Set the theme."""
        self.theme = theme
        self.legend = WindowLegend(theme)

    def toggle(self) -> None:
        """Hide the text, or show it."""
        self.is_shown = not self.is_shown

    def toggle_help(self) -> None:
        """Explain the keys, or do not."""
        self.has_help = not self.has_help

    def paint(
        self, canvas: Canvas, lines: Iterable[str], prompt: list[str], credit: str, foot_px: int, *, has_hint: bool
    ) -> None:
        """Paint lines in the upper left corner, a prompt above a foot of the window, the legend, and small print."""
        foot = max(foot_px, _ABOVE_NOTE_PX) + EDGE_PX
        self.layout = Layout((EDGE_PX, EDGE_PX, canvas.width - EDGE_PX, canvas.height - foot))
        if self.is_shown:
            self._paint_lines(canvas, _wrap_lines(tuple(map(_shorten_line, lines)), canvas.width), (EDGE_PX, EDGE_PX))
        asked = _wrap_lines(tuple(prompt), canvas.width)
        width, height = _measure_size(asked)
        self._paint_lines(canvas, asked, (round((canvas.width - width) / 2), canvas.height - foot - height))
        if self.is_shown:
            self._paint_legend(canvas)
            help_lines = _wrap_lines(_make_help_lines(), canvas.width) if self.has_help else ()
            self._paint_lines(canvas, help_lines, self._find_lower_left(*_measure_size(help_lines)))
            if has_hint and not self.has_help:
                self._write_foot(canvas, _HINT)
        self._write_foot(canvas, credit, is_right=True)

    def _paint_legend(self, canvas: Canvas) -> None:
        """Paint the legend in the upper right corner, or below the lines there, if it has room."""
        right = self.layout.page[2]
        width = self.legend.width - EDGE_PX
        height = self.legend.height - EDGE_PX
        places = self.layout.list_below((right - width, EDGE_PX, right, EDGE_PX + height), EDGE_PX)
        row = self.layout.find_free(places, EDGE_PX) if self.legend.width else None
        if row is not None:
            self.legend.paint(canvas, round(places[row, 1]) - EDGE_PX)
            self.layout.cover(places[row])

    def paint_captions(self, canvas: Canvas, captions: Sequence[CaptionLine]) -> None:
        """Paint the captions in the lower left corner, above other panels there; earlier turns are faint."""
        room = canvas.width - 2 * (EDGE_PX + _PAD_PX) - INDENT_PX
        width = round(measure_captions_width(captions, room)) + 2 * _PAD_PX
        height = round(LINE_PX * len(captions)) + _PAD_PX
        left, top = self._find_lower_left(width, height)
        self._paint_panel(canvas, (left, top), (width, height))
        pen = _make_screen_pen(canvas, self.theme)
        draw_captions(pen, captions, (left + _PAD_PX, top + _PAD_PX / 2, room), self.theme.faint[:3])
        pen.paint(canvas)

    def _find_lower_left(self, width: int, height: int) -> tuple[int, int]:
        """Return the upper left corner of a panel at the lowest place at the left edge that covers the least."""
        left, _, _, bottom = self.layout.page
        places = self.layout.list_above((left, bottom - height, left + width, bottom), EDGE_PX)
        return _find_corner(places[self.layout.choose(places, EDGE_PX)])

    def _write_foot(self, canvas: Canvas, words: str, *, is_right: bool = False) -> None:
        """Write small print in a lower corner."""
        x = canvas.width - EDGE_PX if is_right else EDGE_PX
        y = canvas.height - 20
        edge = self.theme.background[:3]
        if words:
            canvas.draw_text(words, x, y, _SMALL_PX, self.theme.faint, align_right=is_right, edge=edge)

    def paint_facts(self, canvas: Canvas, facts: list[str], at: Point, beside_px: float) -> None:
        """Paint facts beside a point, where they cover no other panel; of a point outside below the lines."""
        x, y = at
        lines = _wrap_lines(tuple(map(_shorten_line, facts)), canvas.width)
        width, height = _measure_size(lines)
        places = self.layout.list_below((EDGE_PX, EDGE_PX, EDGE_PX + width, EDGE_PX + height), EDGE_PX)
        if 0 <= x <= canvas.width and 0 <= y <= canvas.height:
            corners = [(x + beside_px, y - height / 2), (x - beside_px - width, y - height / 2)]
            corners += [(x - width / 2, y + beside_px), (x - width / 2, y - beside_px - height)]
            beside = np.hstack([corners, np.add(corners, (width, height))])
            places = np.vstack([beside, places])
        places = self.layout.move_inside(places)
        half = beside_px / 2
        taken = Layout(self.layout.page, [*self.layout.areas, (x - half, y - half, x + half, y + half)])
        self._paint_lines(canvas, lines, _find_corner(places[taken.choose(places)]))

    def paint_charts(
        self,
        canvas: Canvas,
        charts: Mapping[str, Mapping[str, ChartLine]],
        colors: Mapping[str, Rgb],
        group_of: Callable[[str], str | None],
    ) -> None:
        """Paint charts at the right edge below the legend, as many as have room.

        Args:
            canvas: the window.
            charts: chart -> line -> its points.
            colors: the color of each team.
            group_of: returns the team of an agent, which gives its line a color.
        """
        width = round(WIDTH_PX) + 2 * _PAD_PX
        right = self.layout.page[2]
        left = right - width
        count = len(charts) if left >= canvas.width / 2 else 0
        row = None
        while count and row is None:
            height = round(count * HEIGHT_PX) + _PAD_PX
            places = self.layout.list_below((left, EDGE_PX, right, EDGE_PX + height), EDGE_PX)
            row = self.layout.find_free(places, EDGE_PX)
            count -= row is None
        if row is None:
            return
        left, top = _find_corner(places[row])
        self._paint_panel(canvas, (left, top), (width, height))
        pen = _make_screen_pen(canvas, self.theme)
        for row, (name, lines) in enumerate(list(charts.items())[:count]):
            groups = {line: group_of(line) for line in lines}
            inks = {line: colors[group] for line, group in groups.items() if group is not None and group in colors}
            draw_chart(pen, name, lines, inks, (left + _PAD_PX, top + _PAD_PX / 2 + row * HEIGHT_PX))
        pen.paint(canvas)

    def paint_card(self, canvas: Canvas, card: ResultCard) -> None:
        """Paint how a game ended in the upper middle or below the panels there; in a small window, at the left edge."""
        width, height = measure_card(card)
        left = (canvas.width - width) / 2
        top = max((canvas.height - height) / 5, EDGE_PX)
        places = self.layout.list_below((left, top, left + width, top + height), EDGE_PX)
        aside = self.layout.list_below((EDGE_PX, top, EDGE_PX + width, top + height), EDGE_PX)
        places = np.vstack([places, aside])
        place = places[self.layout.choose(places, EDGE_PX)]
        pen = _make_screen_pen(canvas, self.theme)
        center = float(place[0]) + width / 2, float(place[1]) + height / 2
        draw_card(pen, card, center, self.theme.card[:3], self.theme.faint[:3])
        pen.paint(canvas)
        self.layout.cover(place)

    def _paint_lines(self, canvas: Canvas, lines: Sequence[str], corner: tuple[int, int]) -> None:
        """Paint lines, if there are any, on a panel whose upper left corner is given."""
        if not lines:
            return
        left, top = corner
        self._paint_panel(canvas, corner, _measure_size(tuple(lines)))
        for row, line in enumerate(lines):
            canvas.draw_text(line, left + _PAD_PX, top + _PAD_PX + row * _LINE_PX, FONT_PX, self.theme.ink)

    def _paint_panel(self, canvas: Canvas, corner: tuple[int, int], size: tuple[int, int]) -> None:
        """Paint an empty panel from its upper left corner, and cover its area."""
        canvas.surface.blit(make_panel(*size, self.theme.card, self.theme.border), corner)
        self.layout.cover(np.append(corner, np.add(corner, size)))

    def paint_badge(self, canvas: Canvas, words: str, middles: FloatArray) -> None:
        """Paint a round label at the first of its `middles` (middles, 2) where it is free.

        It has the color of words, which no team has.
        """
        width = max(measure_text_px(words, FONT_PX) + 10, BADGE_PX)
        half = np.array([width / 2, BADGE_PX / 2])
        places = np.hstack([middles - half, middles + half])
        place = places[self.layout.choose(places, 1.0)]
        left, top = _find_corner(place)
        badge = make_panel(width, BADGE_PX, self.theme.ink, self.theme.background, radius=BADGE_PX // 2)
        canvas.surface.blit(badge, (left, top))
        edge = self.theme.ink[:3]  # none, so that no halo of another color is around the words
        x = left + (width - measure_text_px(words, FONT_PX)) / 2
        canvas.draw_text(words, x, top + 6, FONT_PX, self.theme.background, edge=edge)
        self.layout.cover(place)


@lru_cache
def _make_help_lines() -> tuple[str, ...]:
    """Return the keys of the window, two kinds to a line."""
    each = [f"{keys}: {words}" for words, keys in explain_keys("window").items()]
    each.append("timeline: go to any turn of a replay")
    return tuple(" · ".join(each[i : i + 2]) for i in range(0, len(each), 2))


def _find_corner(place: FloatArray) -> tuple[int, int]:
    """Return the upper left corner of a place (4,), in whole pixels."""
    return round(place[0]), round(place[1])


def measure_text_px(words: str, font_px: int) -> int:
    """Return how wide words are, in whole pixels."""
    return round(measure_words(words, font_px))


def _shorten_line(line: str) -> str:
    return line if len(line) <= _LONGEST else line[: _LONGEST - 1] + "…"


@lru_cache(maxsize=256)
def _wrap_lines(lines: tuple[str, ...], width_px: int) -> tuple[str, ...]:
    """Return the lines of a panel as narrow as the window."""
    most_px = width_px - 2 * (EDGE_PX + _PAD_PX)
    narrow = list[str]()
    for line in lines:
        narrow.append("")
        for word in line.split(" "):
            longer = f"{narrow[-1]} {word}" if narrow[-1] else word
            if narrow[-1] and measure_text_px(longer, FONT_PX) > most_px:
                narrow.append(word)
            else:
                narrow[-1] = longer
    return tuple(narrow)


@lru_cache(maxsize=256)
def _measure_size(words: tuple[str, ...]) -> tuple[int, int]:
    widest = max((measure_text_px(line, FONT_PX) for line in words), default=0)
    return widest + 2 * _PAD_PX, len(words) * _LINE_PX + 2 * _PAD_PX - 5


class WindowLegend:
    """The legend in the upper right corner of the window."""

    def __init__(self, theme: Theme) -> None:
        self._theme = theme
        self._explained: tuple[tuple[Block, ...], int, int] = ((), 1, 1)
        self._legend = Legend(*self._explained)
        self._panel_surface: Any = None

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The blocks of the legend."""
        return self._explained[0]

    @property
    def width(self) -> int:
        """The width in pixels from the right edge of the window; 0 without a legend, or if it does not fit."""
        return round(self._legend.width) + 3 * EDGE_PX if self._legend.width else 0

    @property
    def height(self) -> int:
        """The height in pixels from the upper edge of the window; 0 without a legend, or if it does not fit."""
        return round(self._legend.height) + 3 * EDGE_PX if self._legend.height else 0

    def explain(self, blocks: tuple[Block, ...], width: int, height: int) -> None:
        """Set the blocks of the legend, in a window of this size in pixels."""
        if (blocks, width, height) != self._explained:
            self._explained = (blocks, width, height)
            self._panel_surface = None
            self._legend = Legend(blocks, width, height - _FOOT_PX)

    def paint(self, canvas: Canvas, top: int) -> None:
        """Paint it at the right edge, from `top` downwards."""
        if self._panel_surface is None:
            self._panel_surface = paint_transparent(self._paint_legend)
        place = canvas.width - self.width, top
        canvas.surface.blit(self._panel_surface, place, special_flags=load().BLEND_PREMULTIPLIED)

    def _paint_legend(self, behind: Rgba) -> Any:
        theme = self._theme
        canvas = Canvas(self.width, self.height, paper=theme.background[:3])
        canvas.fill(behind)
        card = make_panel(self.width - EDGE_PX, self.height - EDGE_PX, theme.card, theme.border)
        canvas.surface.blit(card, (0, EDGE_PX))
        pen = _make_screen_pen(canvas, theme)
        self._legend.draw(pen, EDGE_PX, 2 * EDGE_PX, None)
        pen.paint(canvas)
        return canvas.surface


class _ScreenPen(Pen):
    """Draws in pixels of the window."""

    def paint(self, canvas: Canvas) -> None:
        """Paint what was drawn."""
        Painting(self.commands.freeze()).paint(canvas, self.camera)


def _make_screen_pen(canvas: Canvas, theme: Theme) -> _ScreenPen:
    return _ScreenPen(Camera(canvas.width, canvas.height, 0.0, 0.0, 1.0), 1.0, theme.ink[:3])


_FINER = 4  # pixels in which a panel is drawn for one of its own


@lru_cache(maxsize=256)
def make_panel(width: int, height: int, color: Rgba, border: Rgba | None = None, radius: int = 8) -> Any:
    """Return an empty panel with round, smooth corners, as a surface."""
    pygame = load()
    large = pygame.Surface((_FINER * width, _FINER * height), pygame.SRCALPHA, 32)
    large.fill((*(border or color)[:3], 0))  # or else the edges would be mixed with black
    if border is not None:
        pygame.draw.rect(large, border, large.get_rect(), border_radius=_FINER * radius)
    edge = 0 if border is None else _FINER
    inside = large.get_rect().inflate(-2 * edge, -2 * edge)
    pygame.draw.rect(large, color, inside, border_radius=_FINER * radius - edge)
    return pygame.transform.smoothscale(large, (width, height))
