"""Words on the window: turn and scores, the legend, questions, the panel of an agent, the source of the map."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from gamms.typing import IContext
from gamms.visual.backends.pygame import Canvas, text_width
from gamms.visual.window.cards import EDGE_PX, plain_card
from gamms.visual.window.controls import HELP
from gamms.visual.window.legend import WindowLegend
from gamms.visual.window.themes import Theme

if TYPE_CHECKING:
    from gamms.visual.window.engine import WindowEngine

Hud = Callable[[IContext], Iterable[Any]]

_FONT_PX, _LINE_PX, _PAD_PX = 21, 20, 10
_SMALL_PX, _PROMPT_PX, _ABOVE_NOTE_PX = 17, 56, 14
_HINT = "F1: keys"
_LONGEST = 90  # letters of a line


class Words:
    """Paints all words that belong to the window and not to the world."""

    def __init__(self, engine: "WindowEngine", theme: Theme) -> None:
        self._engine, self.theme = engine, theme
        self.is_shown, self.has_help = True, False
        self.legend = WindowLegend(theme)
        self._failed: Any = None

    def toggle(self) -> None:
        """Hide the words, or show them."""
        self.is_shown = not self.is_shown

    def toggle_help(self) -> None:
        """Say what the keys do, or do not."""
        self.has_help = not self.has_help

    def paint(self, canvas: Canvas) -> None:
        """Paint what is to be said at the moment."""
        lines = self._hud_lines() if self.is_shown else []
        if self._engine.ctx.is_terminated():  # by the function that writes them
            return
        prompt, low = self._prompt(), canvas.height - EDGE_PX
        if self.is_shown:
            hud = self._card(canvas, lines, EDGE_PX, EDGE_PX)
            self._paint_legend(canvas, hud)
            raised = _PROMPT_PX if prompt else _ABOVE_NOTE_PX
            self._card(canvas, HELP if self.has_help else (), EDGE_PX, low - raised, align=(0.0, 1.0))
            if self._engine.hud == self._engine.turn_lines and not self.has_help:  # who replaced it wants just that
                self._foot(canvas, _HINT)
        self._foot(canvas, self._engine.noted(""), is_right=True)
        self._card(canvas, prompt, canvas.width / 2, low - _ABOVE_NOTE_PX, align=(0.5, 1.0))
        self._panel(canvas)

    def _foot(self, canvas: Canvas, words: str, *, is_right: bool = False) -> None:
        """Small print in a lower corner."""
        x, y, edge = canvas.width - EDGE_PX if is_right else EDGE_PX, canvas.height - 20, self.theme.background[:3]
        if words:
            canvas.text(words, x, y, _SMALL_PX, self.theme.faint, align_right=is_right, edge=edge)

    def _prompt(self) -> list[str]:
        """What is asked, or how to go on."""
        engine = self._engine
        if engine.question is not None:
            return [engine.question.words]
        return ["paused: space goes on, . shows one turn"] if engine.pace.is_paused else []

    def _paint_legend(self, canvas: Canvas, hud: tuple[int, int]) -> None:
        """Paint the legend right of the HUD, or below it where that is too wide."""
        right, bottom = hud
        self.legend.paint(canvas, bottom if right + EDGE_PX > canvas.width - self.legend.width else 0)

    # -- cards -----------------------------------------------------------------------------------------------

    def _hud_lines(self) -> list[str]:
        hud = self._engine.hud
        if hud is None:
            return []
        try:
            return [_short(str(line)) for line in hud(self._engine.ctx)]
        except Exception as error:  # noqa: BLE001 - user code, as a drawer is
            if self._failed is not hud:  # once, not in each of sixty frames a second
                self._failed = hud
                self._engine.ctx.logger.error(f"The HUD could not be written: {type(error).__name__}: {error}")  # noqa: TRY400
            return []

    def _panel(self, canvas: Canvas) -> None:
        """What is known about an agent: right of it, or left where there is no room or the legend is."""
        found = self._engine.pointed_at()
        if found is None:
            return
        told, (x, y), beside = found
        lines = _wrapped(tuple(map(_short, told)), canvas.width)
        width, height = _size(lines)
        top = min(max(y - height / 2, EDGE_PX), canvas.height - height - EDGE_PX)
        is_beside_legend = self.is_shown and top < self.legend.height
        right = canvas.width - max(EDGE_PX, is_beside_legend * self.legend.width)
        left = x + beside if x + beside + width <= right else x - beside - width
        self._card(canvas, lines, max(left, EDGE_PX), top)

    def _card(
        self, canvas: Canvas, lines: Sequence[str], x: float, y: float, align: tuple[float, float] = (0.0, 0.0)
    ) -> tuple[int, int]:
        """Lines on a card; `align` is the share of the card left of and above (x, y). Where it ends: right, bottom."""
        if not lines:
            return 0, 0
        lines = _wrapped(tuple(lines), canvas.width)
        width, height = _size(lines)
        left, top = round(x - align[0] * width), round(y - align[1] * height)
        canvas.surface.blit(plain_card(width, height, self.theme.card, self.theme.border), (left, top))
        for row, line in enumerate(lines):
            canvas.text(line, left + _PAD_PX, top + _PAD_PX + row * _LINE_PX, _FONT_PX, self.theme.ink)
        return left + width, top + height

    def tag(self, canvas: Canvas, words: str, x: float, y: float, *, is_loud: bool = False) -> None:
        """A short label right of and above a point, or around it where it is loud."""
        if not is_loud:
            canvas.text(words, x, y, _SMALL_PX, self.theme.ink, edge=self.theme.background[:3])
            return
        width = max(text_width(words, _FONT_PX) + 10, 22)
        card = plain_card(width, 22, self.theme.accent, radius=11)
        canvas.surface.blit(card, (round(x - width / 2), round(y - 11)))
        canvas.text(words, x - text_width(words, _FONT_PX) / 2, y - 6, _FONT_PX, self.theme.background)


def score_line(scores: Mapping[Any, float]) -> str:
    """Scores by name, on one line."""
    return " · ".join(f"{name} {value:g}" for name, value in scores.items())


def _short(line: str) -> str:
    return line if len(line) <= _LONGEST else line[: _LONGEST - 1] + "…"


@lru_cache(maxsize=256)
def _wrapped(lines: tuple[str, ...], width_px: int) -> tuple[str, ...]:
    """The lines of a card as narrow as the window."""
    room, narrow = width_px - 2 * (EDGE_PX + _PAD_PX), list[str]()
    for line in lines:
        narrow.append("")
        for word in line.split(" "):
            longer = f"{narrow[-1]} {word}" if narrow[-1] else word
            if narrow[-1] and text_width(longer, _FONT_PX) > room:
                narrow.append(word)
            else:
                narrow[-1] = longer
    return tuple(narrow)


@lru_cache(maxsize=256)
def _size(words: tuple[str, ...]) -> tuple[int, int]:
    widest = max(text_width(line, _FONT_PX) for line in words)
    return widest + 2 * _PAD_PX, len(words) * _LINE_PX + 2 * _PAD_PX - 5
