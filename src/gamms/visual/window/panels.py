"""What a window paints over the world: panels of text, the legend and small print, in the colours of a theme."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

from gamms.errors import BadValue, nearest
from gamms.text import shown
from gamms.typing import IContext
from gamms.visual.appearance import BY_NIGHT, PAPER, Rgba
from gamms.visual.backends.pygame_backend import Canvas, load, painted_transparent
from gamms.visual.backends.raster import Painting
from gamms.visual.camera import Camera, Point
from gamms.visual.default_scene import ON_PAPER, MapTones
from gamms.visual.legend import Block, Legend, Pen
from gamms.visual.lettering import words_width
from gamms.visual.window.input import HELP


class Theme(NamedTuple):
    """The colours of the background, of text, and of the default map."""

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
    """Return the theme of that name.

    Raises:
        BadValue: there is none.
    """
    if name not in THEMES:
        raise BadValue(f"Unknown theme {shown(name)}; there is: {', '.join(THEMES)}.{nearest(name, THEMES)}")
    return THEMES[name]


HudLines = Callable[[IContext], Iterable[Any]]

EDGE_PX = 12  # between a panel and the edge of the window
_FONT_PX, _LINE_PX, _PAD_PX = 21, 20, 10
_SMALL_PX, _PROMPT_PX, _ABOVE_NOTE_PX = 17, 56, 14
_FOOT_PX = 64  # of the window, where it asks and names the source of the map
_HINT = "F1: keys"
_LONGEST = 90  # letters of a line


class Hud:
    """Paints the text that belongs to the window and not to the world.

    Attributes:
        legend: in the upper right corner.
        is_shown: whether lines, legend and help are.
        has_help: whether the keys are explained.
    """

    def __init__(self, theme: Theme) -> None:
        self.theme = theme
        self.is_shown, self.has_help = True, False
        self.legend = WindowLegend(theme)

    def toggle(self) -> None:
        """Hide the text, or show it."""
        self.is_shown = not self.is_shown

    def toggle_help(self) -> None:
        """Explain the keys, or do not."""
        self.has_help = not self.has_help

    def paint(self, canvas: Canvas, lines: Iterable[str], prompt: list[str], credit: str, *, has_hint: bool) -> None:
        """Paint lines in the upper left corner, the legend, a prompt at the bottom, and the source of the map."""
        low = canvas.height - EDGE_PX
        if self.is_shown:
            right, bottom = self._panel(canvas, [_short(line) for line in lines], EDGE_PX, EDGE_PX)
            # Right of the lines, or below them where they are too wide.
            self.legend.paint(canvas, bottom if right + EDGE_PX > canvas.width - self.legend.width else 0)
            raised = _PROMPT_PX if prompt else _ABOVE_NOTE_PX
            self._panel(canvas, HELP if self.has_help else (), EDGE_PX, low - raised, align=(0.0, 1.0))
            if has_hint and not self.has_help:
                self._foot(canvas, _HINT)
        self._foot(canvas, credit, is_right=True)
        self._panel(canvas, prompt, canvas.width / 2, low - _ABOVE_NOTE_PX, align=(0.5, 1.0))

    def _foot(self, canvas: Canvas, words: str, *, is_right: bool = False) -> None:
        """Write small print in a lower corner."""
        x, y, edge = canvas.width - EDGE_PX if is_right else EDGE_PX, canvas.height - 20, self.theme.background[:3]
        if words:
            canvas.text(words, x, y, _SMALL_PX, self.theme.faint, align_right=is_right, edge=edge)

    def paint_facts(self, canvas: Canvas, facts: list[str], at: Point, beside_px: float) -> None:
        """Paint facts right of a point, or left of it where it does not fit or the legend is."""
        x, y = at
        lines = _wrapped(tuple(map(_short, facts)), canvas.width)
        width, height = _size(lines)
        top = min(max(y - height / 2, EDGE_PX), canvas.height - height - EDGE_PX)
        is_beside_legend = self.is_shown and top < self.legend.height
        right = canvas.width - max(EDGE_PX, is_beside_legend * self.legend.width)
        left = x + beside_px if x + beside_px + width <= right else x - beside_px - width
        self._panel(canvas, lines, max(left, EDGE_PX), top)

    def _panel(
        self, canvas: Canvas, lines: Sequence[str], x: float, y: float, align: tuple[float, float] = (0.0, 0.0)
    ) -> tuple[int, int]:
        """Paint lines on a panel, a share `align` of it left of and above (x, y); return its right and lower end."""
        if not lines:
            return 0, 0
        lines = _wrapped(tuple(lines), canvas.width)
        width, height = _size(lines)
        left, top = round(x - align[0] * width), round(y - align[1] * height)
        canvas.surface.blit(plain_panel(width, height, self.theme.card, self.theme.border), (left, top))
        for row, line in enumerate(lines):
            canvas.text(line, left + _PAD_PX, top + _PAD_PX + row * _LINE_PX, _FONT_PX, self.theme.ink)
        return left + width, top + height

    def tag(self, canvas: Canvas, words: str, x: float, y: float, *, is_loud: bool = False) -> None:
        """Write a short label right of and above a point, or around it where it is loud."""
        if not is_loud:
            canvas.text(words, x, y, _SMALL_PX, self.theme.ink, edge=self.theme.background[:3])
            return
        width = max(round(words_width(words, _FONT_PX)) + 10, 22)
        card = plain_panel(width, 22, self.theme.accent, radius=11)
        canvas.surface.blit(card, (round(x - width / 2), round(y - 11)))
        canvas.text(words, x - words_width(words, _FONT_PX) / 2, y - 6, _FONT_PX, self.theme.background)


def score_line(scores: Mapping[Any, float]) -> str:
    """Return scores by name, on one line."""
    return " · ".join(f"{name} {value:g}" for name, value in scores.items())


def _short(line: str) -> str:
    return line if len(line) <= _LONGEST else line[: _LONGEST - 1] + "…"


@lru_cache(maxsize=256)
def _wrapped(lines: tuple[str, ...], width_px: int) -> tuple[str, ...]:
    """Return the lines of a panel as narrow as the window."""
    most_px, narrow = width_px - 2 * (EDGE_PX + _PAD_PX), list[str]()
    for line in lines:
        narrow.append("")
        for word in line.split(" "):
            longer = f"{narrow[-1]} {word}" if narrow[-1] else word
            if narrow[-1] and words_width(longer, _FONT_PX) > most_px:
                narrow.append(word)
            else:
                narrow[-1] = longer
    return tuple(narrow)


@lru_cache(maxsize=256)
def _size(words: tuple[str, ...]) -> tuple[int, int]:
    widest = max(words_width(line, _FONT_PX) for line in words)
    return round(widest) + 2 * _PAD_PX, len(words) * _LINE_PX + 2 * _PAD_PX - 5


class WindowLegend:
    """The legend in the upper right corner of the window."""

    def __init__(self, theme: Theme) -> None:
        self._theme = theme
        self._explained: tuple[tuple[Block, ...], int, int] = ((), 1, 1)
        self._legend = Legend(*self._explained)
        self._panel_surface: Any = None

    @property
    def blocks(self) -> tuple[Block, ...]:
        """What it explains."""
        return self._explained[0]

    @property
    def width(self) -> int:
        """Pixels from the right edge of the window; 0 where there is no legend, or it does not fit."""
        return round(self._legend.width) + 3 * EDGE_PX if self._legend.width else 0

    @property
    def height(self) -> int:
        """Likewise, downwards."""
        return round(self._legend.height) + 3 * EDGE_PX if self._legend.height else 0

    def explain(self, blocks: tuple[Block, ...], width: int, height: int) -> None:
        """Say this from now on, in a window of so many pixels."""
        if (blocks, width, height) != self._explained:
            self._explained, self._panel_surface = (blocks, width, height), None
            self._legend = Legend(blocks, width, height - _FOOT_PX)

    def paint(self, canvas: Canvas, top: int) -> None:
        """Paint it from `top` downwards, if it fits above the foot of the window."""
        if self.width and top + self.height <= canvas.height - _FOOT_PX:
            if self._panel_surface is None:
                self._panel_surface = painted_transparent(self._painted)
            place = canvas.width - self.width, top
            canvas.surface.blit(self._panel_surface, place, special_flags=load().BLEND_PREMULTIPLIED)

    def _painted(self, behind: Rgba) -> Any:
        canvas, theme = Canvas(self.width, self.height), self._theme
        canvas.fill(behind)
        card = plain_panel(self.width - EDGE_PX, self.height - EDGE_PX, theme.card, theme.border)
        canvas.surface.blit(card, (0, EDGE_PX))
        camera = Camera(canvas.width, canvas.height, 0.0, 0.0, 1.0)
        pen = Pen(camera, 1.0, theme.ink[:3])
        self._legend.draw(pen, EDGE_PX, 2 * EDGE_PX, (0, 0, 0, 0))
        Painting(pen.commands.freeze()).paint(canvas, camera)
        return canvas.surface


@lru_cache(maxsize=64)
def plain_panel(width: int, height: int, color: Rgba, border: Rgba | None = None, radius: int = 8) -> Any:
    """Return an empty panel with round corners, as a surface."""
    pygame = load()
    surface = pygame.Surface((width, height), pygame.SRCALPHA, 32)
    if border is not None:
        pygame.draw.rect(surface, border, surface.get_rect(), border_radius=radius)
    inside = surface.get_rect() if border is None else surface.get_rect().inflate(-2, -2)
    pygame.draw.rect(surface, color, inside, border_radius=radius - (border is not None))
    return surface
