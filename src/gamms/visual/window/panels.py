"""The panels of a window: text, the legend and small print, in the colors of a theme."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Any

from gamms.typing import IContext
from gamms.visual.appearance import Rgb, Rgba
from gamms.visual.backends.pygame_backend import Canvas, load, painted_transparent
from gamms.visual.backends.raster import Painting
from gamms.visual.camera import Camera, Point
from gamms.visual.captions import (
    INDENT_PX,
    LINE_PX,
    CaptionLine,
    ResultCard,
    captions_width,
    card_size,
    draw_captions,
    draw_card,
)
from gamms.visual.charts import HEIGHT_PX, WIDTH_PX, ChartLine, draw_chart
from gamms.visual.font import words_width
from gamms.visual.keys import explain_keys
from gamms.visual.legend import Block, Legend, Pen
from gamms.visual.themes import Theme

HudLines = Callable[[IContext], Iterable[Any]]

EDGE_PX = 12  # between a panel and the edge of the window
FONT_PX = 21
_LINE_PX = 20
_PAD_PX = 10
_SMALL_PX = 17
_PROMPT_PX = 56
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
        taken: where panels were painted in this frame: left, top, right and lower end of each.
    """

    def __init__(self, theme: Theme) -> None:
        self.theme = theme
        self.is_shown = True
        self.has_help = False
        self.taken: list[_Box] = []
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
        """Paint lines in the upper left corner, the legend, a prompt above a foot of the window, and small print."""
        low = canvas.height - EDGE_PX - max(foot_px, _ABOVE_NOTE_PX)
        self.taken = []
        if self.is_shown:
            right, bottom = self._panel(canvas, [_short(line) for line in lines], EDGE_PX, EDGE_PX)
            # To the right of the lines, or below if the lines are too wide.
            self.legend.paint(canvas, bottom if right + EDGE_PX > canvas.width - self.legend.width else 0)
            if self.legend.width:
                self.taken.append((canvas.width - self.legend.width, 0, canvas.width, self.legend.height))
            raised = _PROMPT_PX - _ABOVE_NOTE_PX if prompt else 0
            self._panel(canvas, _help_lines() if self.has_help else (), EDGE_PX, low - raised, align=(0.0, 1.0))
            if has_hint and not self.has_help:
                self._foot(canvas, _HINT)
        self._foot(canvas, credit, is_right=True)
        self._panel(canvas, prompt, canvas.width / 2, low, align=(0.5, 1.0))

    def paint_captions(
        self, canvas: Canvas, captions: Sequence[CaptionLine], foot_px: int, *, has_prompt: bool
    ) -> None:
        """Paint the captions in the lower left corner, above foot and prompt; earlier turns are faint."""
        room = canvas.width - 2 * (EDGE_PX + _PAD_PX) - INDENT_PX
        width = round(captions_width(captions, room)) + 2 * _PAD_PX
        height = round(LINE_PX * len(captions)) + _PAD_PX
        low = self.taken[-1][1] if has_prompt else canvas.height - max(foot_px, _ABOVE_NOTE_PX)
        top = round(low) - EDGE_PX - height
        canvas.surface.blit(plain_panel(width, height, self.theme.card, self.theme.border), (EDGE_PX, top))
        pen = _screen_pen(canvas, self.theme)
        draw_captions(pen, captions, (EDGE_PX + _PAD_PX, top + _PAD_PX / 2, room), self.theme.faint[:3])
        pen.paint(canvas)
        self.taken.append(_box(EDGE_PX, top, width, height))

    def _foot(self, canvas: Canvas, words: str, *, is_right: bool = False) -> None:
        """Write small print in a lower corner."""
        x = canvas.width - EDGE_PX if is_right else EDGE_PX
        y = canvas.height - 20
        edge = self.theme.background[:3]
        if words:
            canvas.text(words, x, y, _SMALL_PX, self.theme.faint, align_right=is_right, edge=edge)

    def paint_facts(self, canvas: Canvas, facts: list[str], at: Point, beside_px: float, foot_px: int) -> None:
        """Paint facts beside a point, where they cover no other panel; of a point outside below the lines."""
        x, y = at
        lines = _wrapped(tuple(map(_short, facts)), canvas.width)
        width, height = _size(lines)
        last = canvas.width - EDGE_PX - width, canvas.height - EDGE_PX - foot_px - height
        places = [(x + beside_px, y - height / 2), (x - beside_px - width, y - height / 2)]
        places += [(x - width / 2, y + beside_px), (x - width / 2, y - beside_px - height)]
        below_lines = EDGE_PX, self.taken[0][3] + EDGE_PX if self.taken else EDGE_PX
        is_outside = not (0 <= x <= canvas.width and 0 <= y <= canvas.height)
        places = [below_lines] if is_outside else [*places, below_lines]
        inside = [
            (max(min(left, last[0]), EDGE_PX), max(min(top, last[1]), EDGE_PX)) for left, top in places
        ]  # as far as the window is large enough
        taken = [*self.taken, (x - beside_px / 2, y - beside_px / 2, x + beside_px / 2, y + beside_px / 2)]
        left, top = min(inside, key=lambda at: sum(_overlap(_box(at[0], at[1], width, height), box) for box in taken))
        self._panel(canvas, lines, left, top)

    def paint_charts(
        self,
        canvas: Canvas,
        charts: Mapping[str, Mapping[str, ChartLine]],
        colors: Mapping[str, Rgb],
        group_of: Callable[[str], str | None],
        foot_px: int,
    ) -> None:
        """Paint charts at the right edge below the legend, as many as have room above the foot.

        Args:
            canvas: the window.
            charts: chart -> line -> its points.
            colors: the color of each team.
            group_of: returns the team of an agent, which gives its line a color.
            foot_px: the height of the timeline.
        """
        width = round(WIDTH_PX) + 2 * _PAD_PX
        left = canvas.width - EDGE_PX - width
        upper = [box[3] for box in self.taken if box[2] > left and box[1] < canvas.height / 2]
        top = round(max(upper, default=0)) + EDGE_PX
        count = min(len(charts), int((canvas.height - max(foot_px, _FOOT_PX) - top - _PAD_PX) // HEIGHT_PX))
        if count < 1 or left < canvas.width / 2:
            return
        height = round(count * HEIGHT_PX) + _PAD_PX
        canvas.surface.blit(plain_panel(width, height, self.theme.card, self.theme.border), (left, top))
        pen = _screen_pen(canvas, self.theme)
        for row, (name, lines) in enumerate(list(charts.items())[:count]):
            groups = {line: group_of(line) for line in lines}
            inks = {line: colors[group] for line, group in groups.items() if group is not None and group in colors}
            draw_chart(pen, name, lines, inks, (left + _PAD_PX, top + _PAD_PX / 2 + row * HEIGHT_PX))
        pen.paint(canvas)
        self.taken.append(_box(left, top, width, height))

    def paint_card(self, canvas: Canvas, card: ResultCard) -> None:
        """Paint how a game ended in the upper middle; in a small window, below all lines."""
        width, height = card_size(card)
        left = (canvas.width - width) / 2
        top = max((canvas.height - height) / 5, EDGE_PX)
        upper = [box for box in self.taken if box[1] < canvas.height / 2]
        if any(_overlap(_box(left, top, width, height), box) for box in upper):
            top = max(box[3] for box in upper) + EDGE_PX
        pen = _screen_pen(canvas, self.theme)
        center = canvas.width / 2, top + height / 2
        draw_card(pen, card, center, self.theme.card[:3], self.theme.faint[:3])
        pen.paint(canvas)
        self.taken.append(_box(left, top, width, height))

    def _panel(
        self, canvas: Canvas, lines: Sequence[str], x: float, y: float, align: tuple[float, float] = (0.0, 0.0)
    ) -> tuple[int, int]:
        """Paint lines on a panel, a share `align` of it left of and above (x, y); return its right and lower end."""
        if not lines:
            return 0, 0
        lines = _wrapped(tuple(lines), canvas.width)
        width, height = _size(lines)
        left = round(x - align[0] * width)
        top = round(y - align[1] * height)
        canvas.surface.blit(plain_panel(width, height, self.theme.card, self.theme.border), (left, top))
        for row, line in enumerate(lines):
            canvas.text(line, left + _PAD_PX, top + _PAD_PX + row * _LINE_PX, FONT_PX, self.theme.ink)
        self.taken.append(_box(left, top, width, height))
        return left + width, top + height

    def badge(self, canvas: Canvas, words: str, x: float, y: float) -> None:
        """Paint a round label around a point, in the color of words, which no team has."""
        width = max(text_px(words, FONT_PX) + 10, BADGE_PX)
        badge = plain_panel(width, BADGE_PX, self.theme.ink, self.theme.background, radius=BADGE_PX // 2)
        canvas.surface.blit(badge, (round(x - width / 2), round(y - BADGE_PX / 2)))
        edge = self.theme.ink[:3]  # none, so that no halo of another color is around the words
        canvas.text(words, x - text_px(words, FONT_PX) / 2, y - 6, FONT_PX, self.theme.background, edge=edge)
        self.taken.append(_box(x - width / 2, y - BADGE_PX / 2, width, BADGE_PX))


@lru_cache
def _help_lines() -> tuple[str, ...]:
    """Return the keys of the window, two kinds to a line."""
    each = [f"{keys}: {words}" for words, keys in explain_keys("window").items()]
    each.append("line below: go to any turn of a replay")
    return tuple(" · ".join(each[i : i + 2]) for i in range(0, len(each), 2))


_Box = tuple[float, float, float, float]  # left, top, right, bottom


def _box(left: float, top: float, width: float, height: float) -> _Box:
    return left, top, left + width, top + height


def _overlap(one: _Box, other: _Box) -> float:
    """Return the area that two boxes share."""
    across, down = (min(one[i + 2], other[i + 2]) - max(one[i], other[i]) for i in (0, 1))
    return max(across, 0.0) * max(down, 0.0)


def text_px(words: str, font_px: int) -> int:
    """Return how wide words are, in whole pixels."""
    return round(words_width(words, font_px))


def _short(line: str) -> str:
    return line if len(line) <= _LONGEST else line[: _LONGEST - 1] + "…"


@lru_cache(maxsize=256)
def _wrapped(lines: tuple[str, ...], width_px: int) -> tuple[str, ...]:
    """Return the lines of a panel as narrow as the window."""
    most_px = width_px - 2 * (EDGE_PX + _PAD_PX)
    narrow = list[str]()
    for line in lines:
        narrow.append("")
        for word in line.split(" "):
            longer = f"{narrow[-1]} {word}" if narrow[-1] else word
            if narrow[-1] and text_px(longer, FONT_PX) > most_px:
                narrow.append(word)
            else:
                narrow[-1] = longer
    return tuple(narrow)


@lru_cache(maxsize=256)
def _size(words: tuple[str, ...]) -> tuple[int, int]:
    widest = max(text_px(line, FONT_PX) for line in words)
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
        """Paint it from `top` downwards, if it fits above the foot of the window."""
        if self.width and top + self.height <= canvas.height - _FOOT_PX:
            if self._panel_surface is None:
                self._panel_surface = painted_transparent(self._painted)
            place = canvas.width - self.width, top
            canvas.surface.blit(self._panel_surface, place, special_flags=load().BLEND_PREMULTIPLIED)

    def _painted(self, behind: Rgba) -> Any:
        theme = self._theme
        canvas = Canvas(self.width, self.height, paper=theme.background[:3])
        canvas.fill(behind)
        card = plain_panel(self.width - EDGE_PX, self.height - EDGE_PX, theme.card, theme.border)
        canvas.surface.blit(card, (0, EDGE_PX))
        pen = _screen_pen(canvas, theme)
        self._legend.draw(pen, EDGE_PX, 2 * EDGE_PX, None)
        pen.paint(canvas)
        return canvas.surface


class _ScreenPen(Pen):
    """Draws in pixels of the window."""

    def paint(self, canvas: Canvas) -> None:
        """Paint what was drawn."""
        Painting(self.commands.freeze()).paint(canvas, self.camera)


def _screen_pen(canvas: Canvas, theme: Theme) -> _ScreenPen:
    return _ScreenPen(Camera(canvas.width, canvas.height, 0.0, 0.0, 1.0), 1.0, theme.ink[:3])


_FINER = 4  # pixels in which a panel is drawn for one of its own


@lru_cache(maxsize=256)
def plain_panel(width: int, height: int, color: Rgba, border: Rgba | None = None, radius: int = 8) -> Any:
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
