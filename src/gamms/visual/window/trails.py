"""Trails: the ways that agents took in their last turns, fading."""

from collections import deque
from typing import Any

import numpy as np

from gamms.ir.graph import FloatArray
from gamms.typing import IContext
from gamms.visual.color import rgba
from gamms.visual.motion import Motion
from gamms.visual.primitives import primitives_of

_ALPHA = 150
_FEW, _WIDTH_PX, _THIN_PX = 200, 3.0, 1.0  # so many are drawn broad; more of them fast


class Trails:
    """Keeps the ways of the last turns.

    Args:
        turns: how many; 0 keeps none.
    """

    def __init__(self, turns: int) -> None:
        self.turns = turns
        self._ways: deque[dict[str, FloatArray]] = deque()

    def add_turn(self, motion: Motion) -> None:
        """Remember how everybody just moved."""
        if self.turns:
            self._ways.append(motion.ways())
            while len(self._ways) > self.turns:
                self._ways.popleft()

    def draw_past(self, ctx: IContext, data: dict[str, Any]) -> None:
        """Draw those of the turns before the last, in `data["colors"]`, by agent."""
        ages = list(enumerate(reversed(self._ways)))[1:]
        for age, ways in reversed(ages):
            _draw(ctx, ways, data["colors"], round(_ALPHA * (1.0 - age / (self.turns + 1))))

    draw_past.once_a_turn = True  # type: ignore[attr-defined] # then it is over

    def draw_last(self, ctx: IContext, data: dict[str, Any]) -> None:
        """Draw those of the last turn as far as it is shown."""
        share = float(data.get("_alpha", 1.0))
        ways = self._ways[-1] if self._ways else {}
        _draw(ctx, {name: _begun(points, share) for name, points in ways.items()}, data["colors"], _ALPHA)


def _draw(ctx: IContext, ways: dict[str, FloatArray], colors: dict[str, Any], alpha: int) -> None:
    by_color: dict[Any, list[FloatArray]] = {}
    for name, points in ways.items():
        if name in colors and len(points) > 1:
            by_color.setdefault(rgba(colors[name])[:3], []).append(points)
    for color, lines in by_color.items():
        offsets = np.cumsum([0, *map(len, lines)])
        width = _WIDTH_PX if len(ways) <= _FEW else _THIN_PX
        primitives_of(ctx).render_lines(np.concatenate(lines), offsets, (*color, alpha), width)


def _begun(points: FloatArray, share: float) -> FloatArray:
    """A way up to a share of its length."""
    lengths = np.hypot(*np.diff(points, axis=0).T)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    end = share * along[-1]
    inside = along < end
    last = [np.interp(end, along, points[:, axis]) for axis in (0, 1)]
    return np.vstack([points[inside], last])
