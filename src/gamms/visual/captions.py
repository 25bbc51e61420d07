"""Captions: sentences for events and for the end of a game, shared by films, windows and commands."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from gamms.ir.events import DECISIONS
from gamms.ir.game_state import ALL_PLAYED, describe_reason
from gamms.knowledge.sides import Side, find_side_of
from gamms.text import as_digits, as_text
from gamms.typing import IContext
from gamms.visual.appearance import Rgb
from gamms.visual.drawing import Drawing, get_drawing
from gamms.visual.font import measure_words, shorten_text
from gamms.visual.legend import Pen

MOST_LINES = 2  # at once
CAPTION_SECONDS = 2.0  # that a line is shown
LINE_PX = 25.0
# captions; space between the turn and the captions; their dots
_FONT_PX = 21.0
_ASIDE_PX = 26.0
_SPOT_PX = 5.0
INDENT_PX = 4.0 * _SPOT_PX  # of the words behind a dot
_CARD_PX = 26.0
_TITLE_PX = 34.0
_PAD_PX = 24.0
_TITLE_SPOT_PX = 8.0
_BEHIND_SPOT_PX = 3.0 * _TITLE_SPOT_PX  # where the title begins
_LONGEST = 90  # letters
_LAST = "starts again"  # which rules may note before others see why
_SENTENCES = {  # kind of event -> the field with the subject, and the predicate
    "tag": ("other", "is tagged by {agent}"),
    "take": ("agent", "takes the {flag} flag"),
    "drop": ("agent", "loses the {flag} flag"),
    "capture": ("agent", "brings the {flag} flag home"),
    "reach": ("agent", "reaches the goal"),
    "arrive": ("agent", "arrives at node {node}"),
    "discover": ("agent", "discovers node {node}"),
    "empty": ("agent", "has no {resource} left"),
    "hold": ("team", "has held its place for {turns} turns"),
    "eliminated": ("agent", "is out"),
    "respawned": ("agent", _LAST),
}
_FIELD = re.compile(r"{(\w+)}")

UNMARKED = frozenset({"tag", "respawned", *DECISIONS})  # kinds of events that are too frequent for a timeline


class Caption(NamedTuple):
    """A sentence, and the agent or the team that it is about."""

    words: str
    agent: str | None


def write_captions(events: Iterable[Mapping[str, Any]]) -> list[Caption]:
    """Return the sentences of a turn's events, one per agent; kind and agent for events without a known sentence."""
    found: dict[tuple[str | None, str], list[str]] = {}  # by agent and kind
    of_turn = list(events)
    arrived = [event.get("agent") for event in of_turn if event.get("kind") == "arrive"]
    for event in of_turn:
        kind = as_text(event.get("kind", ""))
        agent = event.get("agent")
        if kind in DECISIONS or (kind == "eliminated" and agent in arrived):  # the caption of the arrival suffices
            continue
        about, predicate = _SENTENCES.get(kind, ("", ""))
        if about and {about, *_FIELD.findall(predicate)} <= event.keys():
            words = {name: as_text(event[name]) for name in _FIELD.findall(predicate)}
            found.setdefault((as_text(event[about]), ""), []).append(predicate.format_map(words))
        else:
            found[None if agent is None else as_text(agent), kind] = []
    return [Caption(_write_sentence(agent, kind, predicates), agent) for (agent, kind), predicates in found.items()]


def list_rises(scores: Mapping[Any, Any], before: dict[str, float]) -> Iterator[Caption]:
    """Yield a caption for each score that is larger than before, then store the scores as those before."""
    now = {as_text(of): score for of, score in dict(scores).items() if isinstance(score, int | float)}
    for of, score in now.items():
        if score > before.get(of, 0):
            yield Caption(f"{of} scores: {as_digits(score)}", of)
    before.clear()
    before.update(now)


def _write_sentence(agent: str | None, kind: str, predicates: list[str]) -> str:
    words = kind if agent is None else f"{agent}: {kind}"
    if predicates:
        *others, last = sorted(predicates, key=_LAST.__eq__)
        words = f"{agent} {', '.join(others)} and {last}" if others else f"{agent} {last}"
    return words if len(words) <= _LONGEST else f"{words[: _LONGEST - 1]}…"


def score_line(scores: Mapping[Any, float]) -> str:
    """Return scores by name, on one line."""
    return " · ".join(f"{name} {as_digits(value)}" for name, value in scores.items())


def find_scores(ctx: IContext, later: Iterable[str] = ()) -> dict[str, float]:
    """Return the scores by text, of all teams if one has any; `later` are teams that will have scores."""
    game = ctx.current_game
    known = {} if game is None else {as_text(of): score for of, score in game.scores.items()}
    teams = dict.fromkeys(as_text(team) for team in dict.fromkeys(ctx.agent.positions.teams) if team is not None)
    counted = {*later, *known}
    return dict.fromkeys([*(teams if counted & teams.keys() else ()), *sorted(counted - teams.keys())], 0) | known


def describe_ending(over: Mapping[str, Any]) -> tuple[str, str]:
    """Return who has won, and why the game is over, in words."""
    winner = over.get("winner")
    reason = describe_reason(over.get("reason", ""))
    return "No winner" if winner is None else f"{as_text(winner)} won", reason


class ResultCard(NamedTuple):
    """The end of a game: the winner and its color, the reason, the scores and the number of turns."""

    title: str
    color: Rgb | None
    lines: tuple[str, ...]


def end_card(ctx: IContext, turn: int, later: Iterable[str] = (), reason: str = "") -> ResultCard | None:
    """Return how the game ended; where it did not, and no reason for its last turn is given or known, None."""
    game = ctx.current_game
    over = None if game is None else game.over
    if game is not None and turn and turn == game.last_turn:
        reason = reason or ALL_PLAYED
    if over is None and not reason:
        return None
    title, reason = ("The end", reason) if over is None else describe_ending(over)
    color = None if over is None else get_drawing(ctx).group_colors().get(as_text(over["winner"]))
    scores = dict(sorted(find_scores(ctx, later).items(), key=lambda item: -item[1]))
    turns = f"{as_text(turn)} turn{'s' * (turn != 1)}"
    return ResultCard(title, color, (reason, *([score_line(scores)] if scores else []), turns))


class CaptionLine(NamedTuple):
    """A caption, the color of its team, and the number of remaining turns."""

    words: str
    color: Rgb | None
    turns: int


class CaptionBar(NamedTuple):
    """The text below the map: the turn, the scores, and the events, the latest first."""

    turn: int
    scores: str
    lines: tuple[CaptionLine, ...]


class Captions:
    """The captions of the last turns.

    Args:
        ctx: the context.
        drawing: has the events of the turn that is shown.

    Attributes:
        turns: for how many a line is shown.
    """

    def __init__(self, ctx: IContext, drawing: Drawing) -> None:
        self._ctx = ctx
        self._drawing = drawing
        self.turns = 1
        self._lines: list[CaptionLine] = []

    def make_captions(self, side: Side | None = None) -> CaptionBar:
        """Return the captions of this turn; call it once per turn.

        Args:
            side: only events of which this side knows have captions; None: all.
        """
        game = self._ctx.current_game
        colors = self._drawing.group_colors()
        agents = self._ctx.agent.agents
        new = list[CaptionLine]()
        if game is not None and game.over is not None:
            color = colors.get(str(game.over.get("winner")))
            new.append(CaptionLine(": ".join(describe_ending(game.over)), color, self.turns))
        events = self._drawing.events
        known = (one for one in events.list_last() if side is None or side in events.find_witnesses(one))
        for words, name in write_captions(known):
            color = colors.get(self._drawing.label_side(find_side_of(agents[name])) if name in agents else str(name))
            new.append(CaptionLine(words, color, self.turns))
        if len(new) > MOST_LINES:
            last = new[MOST_LINES - 1]
            new[MOST_LINES - 1 :] = [last._replace(words=f"{last.words}, and {len(new) - MOST_LINES} more")]
        older = [line._replace(turns=line.turns - 1) for line in self._lines if line.turns > 1]
        self._lines = [*new, *older][:MOST_LINES]
        turn = (0 if game is None else game.turn) or self._drawing.turns.count
        return CaptionBar(turn, score_line(find_scores(self._ctx)), tuple(self._lines))


def draw_caption_bar(
    pen: Pen, bar: CaptionBar, at: tuple[float, float, float], lines: int, faint: Rgb, *, scores: bool
) -> None:
    """Draw the turn, optionally the scores, and to the right the captions.

    Args:
        pen: the pen of the page.
        bar: the texts.
        at: the left edge, the upper edge and the width of the available space.
        lines: the number of lines.
        faint: the color of captions of earlier turns.
        scores: whether to include the scores.
    """
    left, top, width = at
    words = f"turn {as_text(bar.turn)}" + (f" · {bar.scores}" if scores and bar.scores else "")
    pen.draw_text(shorten_text(words, _FONT_PX, width), left, top + 0.5 * LINE_PX, _FONT_PX)
    begin = left + max(measure_words(words, _FONT_PX), measure_words("turn 0000", _FONT_PX)) + _ASIDE_PX
    room = left + width - begin - INDENT_PX
    if room > _ASIDE_PX:
        draw_captions(pen, bar.lines[:lines], (begin, top, room), faint)


def draw_captions(pen: Pen, lines: Sequence[CaptionLine], at: tuple[float, float, float], faint: Rgb) -> None:
    """Draw captions with dots in the colors of their teams; `at` is as for `draw_caption_bar`."""
    left, top, room = at
    newest = max((line.turns for line in lines), default=0)
    for number, line in enumerate(lines):
        middle = top + (number + 0.5) * LINE_PX
        ink = None if line.turns == newest else faint
        if line.color is not None:
            pen.draw_circle(left + _SPOT_PX, middle, _SPOT_PX, line.color)
        pen.draw_text(shorten_text(line.words, _FONT_PX, room), left + INDENT_PX, middle, _FONT_PX, ink)


def measure_captions_width(lines: Sequence[CaptionLine], room: float) -> float:
    """Return the width of captions with their dots, in the available space."""
    return INDENT_PX + max(measure_words(shorten_text(line.words, _FONT_PX, room), _FONT_PX) for line in lines)


def measure_card(card: ResultCard) -> tuple[float, float]:
    """Return the width and height of a card."""
    width = max(_measure_title_width(card), *(measure_words(line, _FONT_PX) for line in card.lines)) + 2 * _PAD_PX
    return width, _TITLE_PX + _CARD_PX * len(card.lines) + 1.6 * _PAD_PX


def _measure_title_width(card: ResultCard) -> float:
    return measure_words(card.title, _TITLE_PX) + (0.0 if card.color is None else _BEHIND_SPOT_PX)


def draw_card(pen: Pen, card: ResultCard, center: tuple[float, float], ground: Rgb, faint: Rgb) -> None:
    """Draw how a game ended on a card around a point."""
    width, height = measure_card(card)
    x, y = center
    edge = 1.0
    left = x - width / 2
    top = y - height / 2
    pen.draw_rectangle(left - edge, top - edge, width + 2 * edge, height + 2 * edge, (*faint, 255))
    pen.draw_rectangle(left, top, width, height, (*ground, 255))
    middle = top + 0.8 * _PAD_PX + 0.5 * _TITLE_PX
    begin = x - _measure_title_width(card) / 2
    if card.color is not None:
        pen.draw_circle(begin + _TITLE_SPOT_PX, middle, _TITLE_SPOT_PX, card.color)
        begin += _BEHIND_SPOT_PX
    pen.draw_text(card.title, begin, middle, _TITLE_PX)
    for number, line in enumerate(card.lines):
        down = top + 0.8 * _PAD_PX + _TITLE_PX + (number + 0.6) * _CARD_PX
        pen.draw_text(line, x - measure_words(line, _FONT_PX) / 2, down, _FONT_PX, faint if number == 0 else None)
