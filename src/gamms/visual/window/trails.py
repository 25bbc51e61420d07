"""Trails: the ways that agents took in their last turns, fading."""

from collections import deque
from typing import Any

import numpy as np

from gamms.ir.graph import FloatArray
from gamms.typing import IContext
from gamms.visual.color import rgba
from gamms.visual.motion import Motion
from gamms.visual.primitives import primitives_of

_ALPHA, _WIDTH_PX = 150, 3.0


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

    def draw(self, ctx: IContext, data: dict[str, Any]) -> None:
        """Draw them in `data["colors"]`, by agent; the last turn only as far as it is shown."""
        visual, share, colors = primitives_of(ctx), float(data.get("_alpha", 1.0)), data["colors"]
        for age, ways in enumerate(reversed(self._ways)):
            alpha = round(_ALPHA * (1.0 - age / (self.turns + 1)))
            by_color: dict[tuple[int, int, int], list[FloatArray]] = {}
            for name, points in ways.items():
                shown = points if age else _begun(points, share)
                if name in colors and len(shown) > 1:
                    by_color.setdefault(rgba(colors[name])[:3], []).append(shown)
            for color, lines in by_color.items():
                offsets = np.cumsum([0, *map(len, lines)])
                visual.render_lines(np.concatenate(lines), offsets, (*color, alpha), _WIDTH_PX)


def _begun(points: FloatArray, share: float) -> FloatArray:
    """A way up to a share of its length."""
    lengths = np.hypot(*np.diff(points, axis=0).T)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    end = share * along[-1]
    inside = along < end
    last = [np.interp(end, along, points[:, axis]) for axis in (0, 1)]
    return np.vstack([points[inside], last])
