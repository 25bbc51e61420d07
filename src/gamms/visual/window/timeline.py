"""The timeline at the lower edge of a window: the progress of a game or a replay, and its events."""

from bisect import bisect_left
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any, NamedTuple

from gamms.text import as_text
from gamms.visual.appearance import Rgb, Rgba
from gamms.visual.backends.pygame_backend import Canvas, load
from gamms.visual.camera import Point
from gamms.visual.captions import UNMARKED, describe_ending, list_rises, write_captions
from gamms.visual.themes import Theme
from gamms.visual.window.panels import EDGE_PX, FONT_PX, make_panel, measure_text_px

HEIGHT_PX = 34
_ABOVE_EDGE_PX = 28  # of the window, for the small print below
FOOT_PX = HEIGHT_PX + _ABOVE_EDGE_PX - EDGE_PX + 6  # free below other panels, above their distance from the edge
_PAD_PX = 12
_BUTTON_PX = 30
_TRACK_PX = 4
_HANDLE_PX = 14
# width and height of marks
_MAJOR_PX = (4, 18)
_MINOR_PX = (2, 10)
_NEAR_PX = 5  # from the pointer to a mark that it is on
_MOST_WORDS = 4  # marks that are explained at once


class TimelineMark(NamedTuple):
    """An event of a turn, and the team that it is about, as text."""

    turn: int
    team: str | None
    words: str
    is_major: bool


class Timeline:
    """The events by turn, and the progress of the turns.

    Args:
        team_of: returns the team of an agent by name; None if the agent was deleted.

    Attributes:
        turns: the number of turns; 0: unknown, and no timeline is shown.
        can_seek: whether a person may choose a turn.
        scores: team -> last score.
    """

    def __init__(self, team_of: Callable[[str], str | None]) -> None:
        self._team_of = team_of
        self.turns = 0
        self.can_seek = False
        self.scores: dict[str, float] = {}
        self._marks: list[TimelineMark] = []
        self._bar = 0, 0, 1  # its left end, top and width, pixels

    @property
    def marks(self) -> tuple[TimelineMark, ...]:
        """The marks, in order."""
        return tuple(self._marks)

    def add(self, turn: int, highlight: Mapping[str, Any]) -> None:
        """Add an event of a rule, `scores`, or the end, which is `over`."""
        if "scores" in highlight:
            for words, of in list_rises(highlight["scores"], self.scores):
                self._marks.append(TimelineMark(turn, self._team_of(str(of)) or of, words, True))
        elif "over" in highlight:
            over = highlight["over"]
            winner = over.get("winner") if over else None
            if over:
                self._marks.append(
                    TimelineMark(turn, None if winner is None else as_text(winner), describe_ending(over)[0], True)
                )
        elif highlight.get("kind") not in UNMARKED:
            for words, agent in write_captions([highlight]):
                self._marks.append(TimelineMark(turn, None if agent is None else self._team_of(agent), words, False))

    # -- on the screen -----------------------------------------------------------------------------------------

    @property
    def is_shown(self) -> bool:
        """Return whether the line is painted."""
        return self.turns > 0

    def find_place(self, at: Point) -> float | None:
        """Return which share of the turns a point of the screen lies on; None: beside the line."""
        left, top, width = self._bar
        is_on = self.is_shown and top <= at[1] <= top + HEIGHT_PX and left - _PAD_PX <= at[0] <= left + width + _PAD_PX
        return self.find_share(at) if is_on else None

    def find_share(self, at: Point) -> float:
        """Return which share of the turns a point of the screen is above or below."""
        left, _, width = self._bar
        return min(max((at[0] - left) / width, 0.0), 1.0)

    def is_button(self, at: Point) -> bool:
        """Return whether a point of the screen is on the pause button."""
        left, top, _ = self._bar
        is_left = left - _PAD_PX - _BUTTON_PX <= at[0] < left - _PAD_PX
        return self.is_shown and self.can_seek and is_left and top <= at[1] <= top + HEIGHT_PX

    def describe_events(self, at: Point | None) -> list[str]:
        """Return the text of the events in the turns at a point of the screen."""
        share = None if at is None else self.find_place(at)
        if share is None:
            return []
        turn = round(share * self.turns)
        near = _NEAR_PX * self.turns / self._bar[2]
        begin = bisect_left(self._marks, turn - near, key=lambda mark: mark.turn)
        end = bisect_left(self._marks, turn + near, key=lambda mark: mark.turn)
        found = [f"turn {mark.turn}: {mark.words}" for mark in self._marks[begin:end]]
        more = [f"and {len(found) - _MOST_WORDS} more"] if len(found) > _MOST_WORDS else []
        return [*found[:_MOST_WORDS], *more] or ([f"turn {turn}"] if self.can_seek else [])

    def paint(
        self, canvas: Canvas, theme: Theme, colors: Mapping[str, Rgb], turn: int, done: float, *, is_running: bool
    ) -> None:
        """Paint the timeline above the lower edge; `done` is the number of shown turns, which may be fractional."""
        left = EDGE_PX
        top = canvas.height - _ABOVE_EDGE_PX - HEIGHT_PX
        width = canvas.width - 2 * EDGE_PX
        if width < HEIGHT_PX:
            return
        canvas.surface.blit(make_panel(width, HEIGHT_PX, theme.card, theme.border), (left, top))
        longest = measure_text_px(f"{self.turns} / {self.turns}", FONT_PX)  # so that the line keeps its length
        button = _BUTTON_PX if self.can_seek else 0
        words = longest + _PAD_PX
        words = words if width > 3 * words + button else 0
        begin = left + _PAD_PX + button
        long = max(width - 2 * _PAD_PX - button - words, 1)
        self._bar = begin, top, long
        middle = top + HEIGHT_PX // 2
        if button:
            _paint_button(canvas, theme, left + _PAD_PX, middle, is_running=is_running)
        track = make_panel(long, _TRACK_PX, (*theme.faint[:3], 90), radius=_TRACK_PX // 2)
        canvas.surface.blit(track, (begin, middle - _TRACK_PX // 2))
        share = min(done / self.turns, 1.0)
        if long * share >= _TRACK_PX:
            past = make_panel(round(long * share), _TRACK_PX, theme.faint, radius=_TRACK_PX // 2)
            canvas.surface.blit(past, (begin, middle - _TRACK_PX // 2))
        for mark in sorted(self._marks, key=lambda one: one.is_major):
            wide, high = _MAJOR_PX if mark.is_major else _MINOR_PX
            color = (*colors.get(str(mark.team), theme.faint[:3]), 255)
            x = begin + long * min(mark.turn / self.turns, 1.0) - wide / 2
            canvas.surface.blit(make_panel(wide, high, color, radius=1), (round(x), middle - high // 2))
        if self.can_seek:
            half = _HANDLE_PX // 2
            handle = make_panel(_HANDLE_PX, _HANDLE_PX, theme.ink, (*theme.card[:3], 255), radius=half)
            canvas.surface.blit(handle, (round(begin + long * share) - half, middle - half))
        if words:
            x = left + width - _PAD_PX
            canvas.draw_text(
                f"{turn} / {self.turns}", x, middle - FONT_PX // 3 + 1, FONT_PX, theme.ink, align_right=True
            )


def _paint_button(canvas: Canvas, theme: Theme, x: int, middle: int, *, is_running: bool) -> None:
    """Paint the effect of a click on the button: pause, or continue."""
    if is_running:
        for bar in (0, 7):
            canvas.surface.blit(make_panel(4, 14, theme.ink, radius=1), (x + bar, middle - 7))
    else:
        canvas.surface.blit(_draw_arrow(theme.ink), (x, middle - 7))


@lru_cache(maxsize=8)
def _draw_arrow(color: Rgba) -> Any:
    """Return a smooth triangle that points to the right."""
    pygame = load()
    large = pygame.Surface((48, 56), pygame.SRCALPHA, 32)
    large.fill((*color[:3], 0))
    pygame.draw.polygon(large, color, [(0, 0), (0, 55), (47, 28)])
    return pygame.transform.smoothscale(large, (12, 14))
