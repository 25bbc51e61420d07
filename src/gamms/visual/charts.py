"""Charts of the numbers that `ctx.game.collect` collects: which are shown, and how a window draws them.

The pages of browsers get the same selection, turn by turn, in the slot `charts`; see docs/page-format.md.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from gamms.ir.game_state import CollectedNumbers
from gamms.text import make_printable_line
from gamms.visual.appearance import Rgb
from gamms.visual.font import measure_words, shorten_text
from gamms.visual.legend import Pen

MOST_CHARTS = 4
MOST_LINES = 8
WIDTH_PX = 208.0
HEIGHT_PX = 84.0  # of one chart, with its title
_MOST_TURNS = 20_000
_FONT_PX = 15.0
_SMALL_PX = 12.0
_TITLE_PX = 20.0
_SCALE_PX = 38.0  # for the numbers beside a chart
_LONGEST_NAME = 60

Chart = dict[str, float]
"""Line of a chart -> its value: the name of an agent, or "" for a value of the whole game."""


def select_charts(collected: Mapping[str, CollectedNumbers]) -> dict[str, Chart]:
    """Return the first charts, by the name of the collector, with their first lines.

    Args:
        collected: see `GameState.collected`.
    """
    charts = {}
    for name, numbers in list(collected.items())[:MOST_CHARTS]:
        lines = numbers if isinstance(numbers, Mapping) else {"": numbers}
        charts[make_printable_line(name)[:_LONGEST_NAME]] = dict(list(lines.items())[:MOST_LINES])
    return charts


class ChartLine(NamedTuple):
    """A line of a chart: the turns and the values of its points."""

    turns: list[int]
    values: list[float]


class ChartHistory:
    """The numbers of the turns that were shown, in any order.

    Attributes:
        turns: turn -> its charts.
    """

    def __init__(self) -> None:
        self.turns: dict[int, dict[str, Chart]] = {}

    def note(self, turn: int, collected: Mapping[str, CollectedNumbers]) -> None:
        """Note the numbers of a turn."""
        if collected and (turn in self.turns or len(self.turns) < _MOST_TURNS):
            self.turns[turn] = select_charts(collected)

    def list_lines(self, turn: int) -> dict[str, dict[str, ChartLine]]:
        """Return chart -> line -> its points up to a turn; charts that have no value then are omitted."""
        now = self.turns.get(turn, {})
        found: dict[str, dict[str, ChartLine]] = {name: {} for name in now}
        for number in sorted(known for known in self.turns if known <= turn):
            for name, chart in self.turns[number].items():
                for line, value in chart.items() if name in now else ():
                    points = found[name].setdefault(line, ChartLine([], []))
                    points.turns.append(number)
                    points.values.append(value)
        return found


def draw_chart(
    pen: Pen, name: str, lines: Mapping[str, ChartLine], colors: Mapping[str, Rgb], at: tuple[float, float]
) -> None:
    """Draw a chart: its name and present value above, the largest and smallest value beside the lines.

    Args:
        pen: the pen of the page.
        name: the title.
        lines: the points of each line.
        colors: line -> its color; other lines have the color of texts.
        at: the upper left corner.
    """
    left, top = at
    turns = [turn for line in lines.values() for turn in line.turns]
    values = [value for line in lines.values() for value in line.values]
    low, high = min(values), max(values)
    begin, end = min(turns), max(turns)
    value = _describe_present_value(lines)
    room = WIDTH_PX - measure_words(value, _FONT_PX) - 8.0
    pen.draw_text(shorten_text(name, _FONT_PX, room), left, top + _TITLE_PX / 2, _FONT_PX)
    pen.draw_text(value, left + WIDTH_PX - measure_words(value, _FONT_PX), top + _TITLE_PX / 2, _FONT_PX)
    upper, lower = top + _TITLE_PX + 6.0, top + HEIGHT_PX - 10.0
    for number, y in dict.fromkeys(
        [(high, upper if high > low else (upper + lower) / 2), (low, lower if high > low else (upper + lower) / 2)]
    ):
        pen.draw_text(f"{number:.3g}", left, y, _SMALL_PX, pen.faint)
    width = WIDTH_PX - _SCALE_PX

    def place(turn: int, number: float) -> tuple[float, float]:
        share = (turn - begin) / (end - begin) if end > begin else 1.0
        height = (number - low) / (high - low) if high > low else 0.5
        return left + _SCALE_PX + share * width, lower - height * (lower - upper)

    for line, points in lines.items():
        color = colors.get(line, pen.ink)
        places = [place(*point) for point in zip(points.turns, points.values, strict=True)]
        if len(places) > 1:
            pen.draw_line(_thin_out(places), color, 1.5)
        pen.draw_circle(*places[-1], 2.5, color)


def _describe_present_value(lines: Mapping[str, ChartLine]) -> str:
    """Return the last value of a chart, or the least and the largest of several lines."""
    last = [line.values[-1] for line in lines.values()]
    low, high = f"{min(last):.4g}", f"{max(last):.4g}"
    return low if low == high else f"{low} to {high}"


def _thin_out(places: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return at most some points for each pixel of the width, the last one included."""
    step = max(len(places) // round(2 * WIDTH_PX), 1)
    return [*places[:-1:step], places[-1]]
