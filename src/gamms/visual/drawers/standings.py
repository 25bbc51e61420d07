"""Drawers of what rules count: places held or discovered, resources left, and deeds that agents cannot do again yet.

They read `ctx.game.data`, of a game or of its replay: `data["held"]` is key -> {"nodes", "team", "turns", "of"},
`data["discovered"]` key -> {"nodes", "by": team -> ids}, `data["resources"]` name -> {"full", "amounts": agent ->
amount}, `data["cooldowns"]` deed -> {"of", "left": agent -> turns}. Nodes are as `as_text` made them.
"""

from collections.abc import Iterator
from itertools import islice
from math import pi
from typing import Any

import numpy as np

from gamms.ir.graph import FloatArray
from gamms.typing import IAgent, IContext
from gamms.visual.appearance import AnyColor, color_group
from gamms.visual.constants import Layer
from gamms.visual.drawers.rules import game_data, in_text, team_colors_of
from gamms.visual.drawing import drawing_of
from gamms.visual.legend import SIGN, Row, Rows

HELD, DISCOVERED, RESOURCES, COOLDOWNS = "held", "discovered", "resources", "cooldowns"  # in `ctx.game.data`
_FIELDS: dict[str, dict[str, Any]] = {  # of what is there by key
    HELD: {"nodes": str, "turns": int, "of": int},
    DISCOVERED: {"nodes": str, "by": dict},
    RESOURCES: {"full": int | float, "amounts": dict},
    COOLDOWNS: {"of": int, "left": dict},
}
_MOST = 100  # places, resources and agents: no game shows so many, but a hostile recording may
_RING, _RING_PX, _ARC_PX, _FINE = 0.03, 2.0, 5.0, 48  # radius, in widths of what is seen; widths; parts of a circle
_AROUND, _APART_AROUND, _AROUND_PX = 0.021, 0.005, 3.0  # radii of arcs around agents, in widths; and how broad they are
_SQUARE = np.array([(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0), (0.0, 1.0)])
_WIDER, _FOUND_PX = (
    0.006,
    3.0,
)  # how much larger the square of each next team is, in widths; and how broad its lines are
_BAR, _BELOW, _APART, _BAR_PX = 0.034, 0.034, 0.01, 5.0  # length and places of bars, in widths; and how thick they are

_XY = tuple[float, float]


def counted_in(ctx: IContext, group: str) -> dict[str, dict[str, Any]]:
    """Return what rules count in one of the four groups, by key, as far as it can be drawn."""
    kept: Any = game_data(ctx).get(group)
    fields = _FIELDS[group]
    fit = (
        (str(key), state)
        for key, state in dict[Any, Any](kept if isinstance(kept, dict) else {}).items()
        if isinstance(state, dict) and all(isinstance(state.get(name), of) for name, of in fields.items())
    )
    return dict(islice(fit, _MOST))


def render_held(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw the places of the rule `hold`: rings, on which an arc in the colour of a team grows while it holds them.

    `data` may have `colors` by team.
    """
    visual, columns, held = drawing_of(ctx), ctx.graph.columns(), counted_in(ctx, HELD)
    colors = team_colors_of(ctx, {state.get("team"): None for state in held.values()}, data.get("colors"))
    radius = _RING * visual.extent() or 1.0
    for state in held.values():
        places = columns.xy[in_text(state["nodes"], columns.node_ids)]
        visual.render_circles(places, radius, SIGN, _RING_PX)
        share = min(1.0, max(0, state["turns"]) / max(1, state["of"]))
        if state.get("team") is not None and share > 0.0:
            arc = _arc(share) * radius
            points = (places[:, None] + arc[None]).reshape(-1, 2)
            offsets = np.arange(len(places) + 1, dtype=np.int64) * len(arc)
            visual.render_lines(points, offsets, colors[state["team"]], _ARC_PX)


def _arc(share: float) -> FloatArray:
    """Return the points (points, 2) of a part of the unit circle, from the top on and clockwise."""
    turn = 2.0 * pi * share * np.linspace(0.0, 1.0, 2 + int(_FINE * share))
    return np.column_stack([np.sin(turn), np.cos(turn)])


def render_discovered(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw the nodes of the rule `discover`: a grey square, and one in the colour of each team that has discovered it.

    `data` may have `colors` by team.
    """
    visual, columns = drawing_of(ctx), ctx.graph.columns()
    size = visual.extent() or 1.0
    for state in counted_in(ctx, DISCOVERED).values():
        by = dict(islice(state["by"].items(), _MOST))
        _squares(ctx, columns.xy[in_text(state["nodes"], columns.node_ids)], _RING * size, SIGN, _RING_PX)
        for number, (team, color) in enumerate(team_colors_of(ctx, by, data.get("colors")).items()):
            found = columns.xy[np.isin(columns.node_ids, by[team])]
            _squares(ctx, found, (_RING + number * _WIDER) * size, color, _FOUND_PX)


def _squares(ctx: IContext, centers: FloatArray, radius: float, color: AnyColor, width_px: float) -> None:
    """Draw squares that stand on a corner, (squares, 2)."""
    points = (centers[:, None] + _SQUARE[None] * radius).reshape(-1, 2)
    offsets = np.arange(len(centers) + 1, dtype=np.int64) * len(_SQUARE)
    drawing_of(ctx).render_lines(points, offsets, color, width_px)


def render_amounts(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw below each agent what it has left, by the rule `resource`: a bar for each, as long as it is full."""
    visual, colors = drawing_of(ctx), drawing_of(ctx).group_colors()
    size = visual.extent() or 1.0
    for number, state in enumerate(counted_in(ctx, RESOURCES).values()):
        for agent, (x, above), amount in _marked(ctx, state["amounts"], data):
            left, y = x - _BAR / 2 * size, above - (_BELOW + number * _APART) * size
            part = min(1.0, max(0.0, amount / (state["full"] or 1.0)))
            ends = ((1.0, visual.theme.background, 3.0), (1.0, SIGN, 0.0), (part, colors[str(color_group(agent))], 0.0))
            for length, color, more_px in ends:
                if length > 0.0:
                    line = [(left, y), (left + length * _BAR * size, y)]
                    visual.render_lines(line, [0, 2], color, _BAR_PX + more_px)


def render_cooldowns(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw around each agent how long it cannot do a deed again, by the rule `cooldown`: an arc that gets shorter."""
    visual, size = drawing_of(ctx), drawing_of(ctx).extent() or 1.0
    for number, state in enumerate(counted_in(ctx, COOLDOWNS).values()):
        for _, center, turns in _marked(ctx, state["left"], data):
            share = min(1.0, max(0.0, turns / (state["of"] or 1)))
            arc = _arc(share) * (_AROUND + number * _APART_AROUND) * size + center
            visual.render_lines(arc, [0, len(arc)], SIGN, _AROUND_PX)


def _marked(ctx: IContext, numbers: dict[Any, Any], data: dict[str, Any]) -> Iterator[tuple[IAgent, _XY, float]]:
    """Yield the agents that are shown, where, and the number of each; none where there are too many to read."""
    visual, share = drawing_of(ctx), data.get("_alpha", 1.0)
    for name, number in sorted(numbers.items()) if len(numbers) <= _MOST else ():
        agent = ctx.agent.agents.get(name)
        if agent is not None and visual.is_shown(agent, share) and isinstance(number, int | float):
            yield agent, visual.position_of(name, share), number


def _rows_of_amounts(ctx: IContext) -> Rows | None:
    rows = tuple(Row(SIGN, f"{name} left", sign="gauge") for name in counted_in(ctx, RESOURCES))
    return Rows("", rows) if rows else None


def _rows_of_cooldowns(ctx: IContext) -> Rows | None:
    rows = tuple(Row(SIGN, f"{deed} not ready", sign="arc") for deed in counted_in(ctx, COOLDOWNS))
    return Rows("", rows) if rows else None


render_held.__dict__.update(
    artist="held", layer=Layer.GOALS, is_mark=True, once_a_turn=True, legend=Rows("", (Row(SIGN, "held", sign="arc"),))
)
render_discovered.__dict__.update(
    artist="discovered",
    layer=Layer.GOALS,
    is_mark=True,
    once_a_turn=True,
    legend=Rows("", (Row(SIGN, "discovered", sign="square"),)),
)
render_amounts.__dict__.update(artist="resources", layer=Layer.FLAGS, is_mark=True, legend=_rows_of_amounts)
render_cooldowns.__dict__.update(artist="cooldowns", layer=Layer.FLAGS, is_mark=True, legend=_rows_of_cooldowns)
