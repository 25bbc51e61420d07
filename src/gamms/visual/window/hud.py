"""Words on the window: turn and scores, teams, questions, the panel of an agent, the source of the map."""

from collections.abc import Callable, Iterable, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from gamms.typing import IContext
from gamms.visual.backends.pygame import Canvas, load, text_width
from gamms.visual.color import Rgba, rgba
from gamms.visual.window.controls import HELP
from gamms.visual.window.themes import Theme

if TYPE_CHECKING:
    from gamms.visual.window.engine import WindowEngine

Hud = Callable[[IContext], Iterable[Any]]
Line = str | tuple[Rgba, str]  # words, perhaps with a dot before them

_FONT_PX, _LINE_PX, _PAD_PX, _EDGE_PX, _DOT_PX = 21, 20, 10, 12, 16
_SMALL_PX, _PROMPT_PX = 17, 56
_MOST_TEAMS = 10
_MOST_WORDS = 90  # of a line


class Words:
    """Paints all words that belong to the window and not to the world."""

    def __init__(self, engine: "WindowEngine", theme: Theme) -> None:
        self._engine, self.theme = engine, theme
        self.is_shown, self.has_help = True, False
        self._failed: Any = None

    def toggle(self) -> None:
        """Hide the words, or show them."""
        self.is_shown = not self.is_shown

    def toggle_help(self) -> None:
        """Say what the keys do, or do not."""
        self.has_help = not self.has_help

    def paint(self, canvas: Canvas) -> None:
        """Paint what is to be said at the moment."""
        prompt = self._prompt()
        engine, right, low = self._engine, canvas.width - _EDGE_PX, canvas.height - _EDGE_PX
        lines = self._hud_lines() if self.is_shown else []
        if engine.ctx.is_terminated():  # by the function that writes them
            return
        if self.is_shown:
            self._card(canvas, lines, _EDGE_PX, _EDGE_PX)
            self._card(canvas, self._teams(), right, _EDGE_PX, align=(1.0, 0.0))
            raised = _PROMPT_PX if prompt else 0
            self._card(canvas, HELP if self.has_help else (), _EDGE_PX, low - raised, align=(0.0, 1.0))
        note = engine.noted("")
        if note:
            canvas.text(note, canvas.width - 8, canvas.height - 20, _SMALL_PX, self.theme.faint, align_right=True)
        self._card(canvas, prompt, canvas.width / 2, low - 14, align=(0.5, 1.0))
        self._panel(canvas)

    def _prompt(self) -> list[Line]:
        """What is asked, or how to go on."""
        engine = self._engine
        if engine.question is not None:
            return [engine.question.words]
        return ["paused: space goes on, . shows one turn"] if engine.pace.is_paused else []

    # -- cards -----------------------------------------------------------------------------------------------

    def _hud_lines(self) -> list[Line]:
        hud = self._engine.hud
        if hud is None:
            return []
        try:
            return [str(line)[:_MOST_WORDS] for line in hud(self._engine.ctx)]
        except Exception as error:  # noqa: BLE001 - user code, as a drawer is
            if self._failed is not hud:  # once, not in each of sixty frames a second
                self._failed = hud
                self._engine.ctx.logger.error(f"The HUD could not be written: {type(error).__name__}: {error}")  # noqa: TRY400
            return []

    def _teams(self) -> list[Line]:
        """A dot and a name for each team, with how many of it are left."""
        teams = self._engine.teams()
        if len(teams) < 1 or len(teams) > _MOST_TEAMS:
            return []
        return [(color, f"{name}  {count}") for name, (color, count) in teams.items()]

    def _panel(self, canvas: Canvas) -> None:
        found = self._engine.pointed_at()
        if found is not None:
            lines, (x, y), beside = found
            lines = [line[:_MOST_WORDS] for line in lines]
            width, height = _size(tuple(lines), has_dots=False)
            left = x + beside if x + beside + width <= canvas.width else x - beside - width
            top = min(max(y - height / 2, _EDGE_PX), canvas.height - height - _EDGE_PX)
            self._card(canvas, lines, left, top)

    def _card(
        self,
        canvas: Canvas,
        lines: Sequence[Line],
        x: float,
        y: float,
        align: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        """Lines on a rounded card; `align` is the share of the card that lies left of and above (x, y)."""
        if not lines:
            return
        has_dots = not isinstance(lines[0], str)
        words = tuple(line if isinstance(line, str) else line[1] for line in lines)
        width, height = _size(words, has_dots=has_dots)
        left, top = round(x - align[0] * width), round(y - align[1] * height)
        canvas.surface.blit(_plain_card(width, height, self.theme.card, self.theme.border), (left, top))
        for row, line in enumerate(lines):
            at = top + _PAD_PX + row * _LINE_PX
            if not isinstance(line, str):
                canvas.surface.blit(_dot(line[0], self.theme.card), (left + _PAD_PX - 2, at))
            canvas.text(words[row], left + _PAD_PX + _DOT_PX * has_dots, at, _FONT_PX, self.theme.ink)

    def tag(self, canvas: Canvas, words: str, x: float, y: float, *, is_loud: bool = False) -> None:
        """A short label right of and above a point, or around it where it is loud."""
        if not is_loud:
            canvas.text(words, x, y, _SMALL_PX, self.theme.ink)
            return
        width = max(text_width(words, _FONT_PX) + 10, 22)
        card = _plain_card(width, 22, self.theme.accent, radius=11)
        canvas.surface.blit(card, (round(x - width / 2), round(y - 11)))
        canvas.text(words, x - text_width(words, _FONT_PX) / 2, y - 6, _FONT_PX, self.theme.background)


def score_line(scores: dict[Any, float]) -> str:
    """Scores by name, on one line."""
    return " · ".join(f"{name} {value:g}" for name, value in scores.items())


@lru_cache(maxsize=256)
def _size(words: tuple[str, ...], *, has_dots: bool) -> tuple[int, int]:
    widest = max(text_width(line, _FONT_PX) for line in words)
    return widest + 2 * _PAD_PX + _DOT_PX * has_dots, len(words) * _LINE_PX + 2 * _PAD_PX - 5


@lru_cache(maxsize=64)
def _plain_card(width: int, height: int, color: Rgba, border: Rgba | None = None, radius: int = 8) -> Any:
    pygame = load()
    surface = pygame.Surface((width, height), pygame.SRCALPHA, 32)
    if border is not None:
        pygame.draw.rect(surface, border, surface.get_rect(), border_radius=radius)
    inside = surface.get_rect() if border is None else surface.get_rect().inflate(-2, -2)
    pygame.draw.rect(surface, color, inside, border_radius=radius - (border is not None))
    return surface


@lru_cache(maxsize=64)
def _dot(color: Rgba, behind: Rgba) -> Any:
    """A smooth disc, made large and then small."""
    pygame = load()
    large = pygame.Surface((56, 56), pygame.SRCALPHA, 32)
    large.fill((*rgba(behind)[:3], 0))
    pygame.draw.circle(large, color, (28, 28), 24)
    return pygame.transform.smoothscale(large, (14, 14))
