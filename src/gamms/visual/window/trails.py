"""Trails: the ways that agents took in their last turns, fading."""

from collections import deque
from itertools import chain
from typing import Any

import numpy as np

from gamms.typing import IContext
from gamms.visual.color import rgba
from gamms.visual.drawing import drawing_of
from gamms.visual.motion import Motion, Moves

_ALPHA = 150
_FEW, _WIDTH_PX, _THIN_PX = 200, 3.0, 1.0  # so many are drawn broad; more of them fast


class Trails:
    """Keeps the ways of the last turns.

    Args:
        turns: how many; 0 keeps none.
    """

    def __init__(self, turns: int) -> None:
        self.turns = turns
        self._ways: deque[Moves] = deque()

    def add_turn(self, motion: Motion) -> None:
        """Add the moves of the turn that was just played."""
        if self.turns:
            self._ways.append(motion.moves)
            while len(self._ways) > self.turns:
                self._ways.popleft()

    def draw_past(self, ctx: IContext, data: dict[str, Any]) -> None:
        """Draw those of the turns before the last, in `data["colors"]`, by agent."""
        ages = list(enumerate(reversed(self._ways)))[1:]
        for age, ways in reversed(ages):
            _draw(ctx, ways, 1.0, data["colors"], round(_ALPHA * (1.0 - age / (self.turns + 1))))

    draw_past.once_a_turn = True  # type: ignore[attr-defined] # then it is over

    def draw_last(self, ctx: IContext, data: dict[str, Any]) -> None:
        """Draw those of the last turn as far as it is shown."""
        if self._ways:
            _draw(ctx, self._ways[-1], float(data.get("_alpha", 1.0)), data["colors"], _ALPHA)


def _draw(ctx: IContext, moves: Moves, share: float, colors: dict[str, Any], alpha: int) -> None:
    by_color: dict[Any, list[list[tuple[float, float]]]] = {}
    paths, ends = moves.paths, [(x, y) for x, y in moves.paths.at(share).tolist()]
    for name, row in moves.rows.items():
        if name in colors:
            by_color.setdefault(rgba(colors[name]), []).append(paths.until(row, share, ends[row]))
    width = _WIDTH_PX if len(moves.rows) <= _FEW else _THIN_PX
    for color, lines in by_color.items():
        points, offsets = list(chain.from_iterable(lines)), np.cumsum([0, *map(len, lines)])
        drawing_of(ctx).render_lines(points, offsets, (*color[:3], alpha), width)
