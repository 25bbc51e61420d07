"""Drawers of trails: the paths of agents in the last turns."""

from collections.abc import Mapping
from itertools import chain
from typing import Any

import numpy as np

from gamms.typing import IArtist, IContext
from gamms.visual.appearance import rgba
from gamms.visual.artist import Artist, looks_of
from gamms.visual.constants import Layer
from gamms.visual.drawing import drawing_of
from gamms.visual.shown_turn import MovedAgents

_ALPHA = 150
# the number of trails that are drawn wide; more are drawn thin, which is faster
_FEW = 200
_WIDTH_PX = 3.0
_THIN_PX = 1.0


def render_past_trails(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw the paths of `data["turns"]` turns except the last, in `data["colors"]` by agent; older ones are fainter."""
    ages = list(enumerate(drawing_of(ctx).motion.past(data["turns"])))[1:]
    for age, moves in reversed(ages):
        _draw(ctx, moves, 1.0, data["colors"], round(_ALPHA * (1.0 - age / (data["turns"] + 1))))


render_past_trails.once_a_turn = True  # type: ignore[attr-defined] # then it is over


def render_trails(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw the ways of the last turn as far as it is shown."""
    motion = drawing_of(ctx).motion
    share = float(data.get("_alpha", 1.0))
    for moves in [motion.moves] if share < 1.0 else motion.past(1):
        _draw(ctx, moves, share, data["colors"], _ALPHA)


def artists_of_trails(ctx: IContext, artists: Mapping[str, IArtist], turns: int) -> dict[str, IArtist]:
    """Return artists of the trails of the agents that artists show."""
    hidden = drawing_of(ctx).hidden_agents()
    colors = {look.name: look.color for look in looks_of(artists) if look.name not in hidden}
    trails: dict[str, IArtist] = {}
    for name, drawer in (("past trails", render_past_trails), ("trails", render_trails)):
        trails[name] = artist = Artist(ctx, drawer, Layer.TRAILS)
        artist.data = {"colors": colors, "turns": turns}
    return trails


def _draw(ctx: IContext, moves: MovedAgents, share: float, colors: Mapping[str, Any], alpha: int) -> None:
    by_color: dict[Any, list[list[tuple[float, float]]]] = {}
    paths = moves.paths
    ends = [(x, y) for x, y in moves.paths.at(share).tolist()]
    for name, row in moves.rows.items():
        if name in colors:
            by_color.setdefault(rgba(colors[name]), []).append(paths.until(row, share, ends[row]))
    width = _WIDTH_PX if len(moves.rows) <= _FEW else _THIN_PX
    for color, lines in by_color.items():
        points = list(chain.from_iterable(lines))
        offsets = np.cumsum([0, *map(len, lines)])
        drawing_of(ctx).render_lines(points, offsets, (*color[:3], alpha), width)
