"""Drawers of the progress of rules: held and discovered places, remaining resources, cooldowns, and deeds that last.

They read `ctx.game.data`, of a game or of its replay: `data["held"]` is key -> {"nodes", "team", "turns", "of"},
`data["discovered"]` key -> {"nodes", "by": team -> ids}, `data["resources"]` name -> {"full", "amounts": agent ->
amount}, `data["cooldowns"]` and `data["doing"]` deed -> {"of", "left": agent -> turns}. Nodes are as `as_text` made
them.
"""

from collections.abc import Iterator
from itertools import islice
from math import pi
from typing import Any

import numpy as np

from gamms.ir.draw import Owner
from gamms.ir.graph import FloatArray
from gamms.knowledge.sides import Side, find_side_of
from gamms.typing import IAgent, IContext
from gamms.visual.constants import Layer
from gamms.visual.drawers.rules import find_ids_in_text, find_team_colors, get_game_data
from gamms.visual.drawing import Drawing, get_drawing
from gamms.visual.legend import SIGN, LegendRow, LegendRows

# in `ctx.game.data`
HELD = "held"
DISCOVERED = "discovered"
RESOURCES = "resources"
COOLDOWNS = "cooldowns"
DOING = "doing"
_FIELDS: dict[str, dict[str, Any]] = {  # types of the entries, by key
    HELD: {"nodes": str, "turns": int, "of": int},
    DISCOVERED: {"nodes": str, "by": dict},
    RESOURCES: {"full": int | float, "amounts": dict},
    COOLDOWNS: {"of": int, "left": dict},
    DOING: {"of": int | float, "left": dict},
}
_MOST = 100  # places, resources and agents: no game shows so many, but a hostile recording may
# radius of rings and squares, and the widths of their lines
_PLACE_PX = 20.0
_THIN_PX = 2.0
_ARC_PX = 5.0
_FINE = 48  # parts of a circle
# radii of arcs around agents, and the width of their lines
_AROUND_PX = 18.0
_NEXT_PX = 4.0
_LINE_PX = 3.0
_SQUARE = np.array([(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0)])
# how much larger the square of each next team is, and the width of its lines
_WIDER_PX = 4.0
_FOUND_PX = 3.0
# length, places and thickness of bars
_BAR_PX = 26.0
_BELOW_PX = 20.0
_APART_PX = 7.0
_THICK_PX = 5.0

_XY = tuple[float, float]


def find_counts(ctx: IContext, group: str) -> dict[str, dict[str, Any]]:
    """Return the drawable counts of rules in one of the groups, by key."""
    kept: Any = get_game_data(ctx).get(group)
    fields = _FIELDS[group]
    fit = (
        (str(key), state)
        for key, state in dict[Any, Any](kept if isinstance(kept, dict) else {}).items()
        if isinstance(state, dict) and all(isinstance(state.get(name), of) for name, of in fields.items())
    )
    return dict(islice(fit, _MOST))


def render_held(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw the places of the rule `hold`: rings, on which an arc in the color of a team grows while it holds them.

    `data` may have `colors` by team.
    """
    visual = get_drawing(ctx)
    columns = ctx.graph.columns()
    held = find_counts(ctx, HELD)
    colors = find_team_colors(ctx, {state.get("team"): None for state in held.values()}, data.get("colors"))
    for state in held.values():
        places = columns.xy[find_ids_in_text(state["nodes"], columns.node_ids)]
        visual.render_circles(places, _PLACE_PX, SIGN, _THIN_PX, in_pixels=True)
        share = min(1.0, max(0, state["turns"]) / max(1, state["of"]))
        if state.get("team") is not None and share > 0.0:
            visual.render_symbols(places, _compute_arc(share, _PLACE_PX), colors[state["team"]], _ARC_PX)


def _compute_arc(share: float, radius: float) -> FloatArray:
    """Return the corners (corners, 2) of an outline that is a part of a circle, from the top on and clockwise."""
    turn = 2.0 * pi * share * np.linspace(0.0, 1.0, 2 + int(_FINE * share))
    arc = np.column_stack([np.sin(turn), -np.cos(turn)]) * radius
    return np.concatenate([arc, arc[-2:0:-1]])  # back the way it came, for an outline is closed


def render_discovered(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw the nodes of the rule `discover`: a grey square, and one in the color of each team that has discovered it.

    `data` may have `colors` by team.
    """
    visual = get_drawing(ctx)
    columns = ctx.graph.columns()
    for state in find_counts(ctx, DISCOVERED).values():
        by = dict(islice(state["by"].items(), _MOST))
        nodes = columns.xy[find_ids_in_text(state["nodes"], columns.node_ids)]
        with visual.owned(sides=()):
            visual.render_symbols(nodes, _PLACE_PX * _SQUARE, SIGN, _THIN_PX)
        for number, (team, color) in enumerate(find_team_colors(ctx, by, data.get("colors")).items()):
            found = columns.xy[np.isin(columns.node_ids, by[team])]
            with visual.owned(sides=[visual.label_side(Side(team, None))]):
                visual.render_symbols(found, (_PLACE_PX + number * _WIDER_PX) * _SQUARE, color, _FOUND_PX)


def render_amounts(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw a bar below each agent for its amounts of the rule `resource`, with a length relative to a full amount."""
    visual = get_drawing(ctx)
    for number, state in enumerate(find_counts(ctx, RESOURCES).values()):
        for agent, place, amount in _list_marked_agents(ctx, state["amounts"], data):
            left = -_BAR_PX / 2
            down = _BELOW_PX + number * _APART_PX
            part = min(1.0, max(0.0, amount / (state["full"] or 1.0)))
            own = visual.color_of(visual.label_side(find_side_of(agent)))
            ends = ((1.0, visual.theme.background, 3.0), (1.0, SIGN, 0.0), (part, own, 0.0))
            for length, color, more_px in ends:
                line = [(left, down), (left + length * _BAR_PX, down)]
                with visual.owned(*_find_owner(visual, agent)):
                    visual.render_symbols([place] if length > 0.0 else [], line, color, _THICK_PX + more_px)


def render_cooldowns(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw around each agent how long it cannot do a deed again, by the rule `cooldown`: an arc that gets shorter."""
    visual = get_drawing(ctx)
    for number, state in enumerate(find_counts(ctx, COOLDOWNS).values()):
        for agent, place, turns in _list_marked_agents(ctx, state["left"], data):
            share = min(1.0, max(0.0, turns / (state["of"] or 1)))
            with visual.owned(*_find_owner(visual, agent)):
                visual.render_symbols([place], _compute_arc(share, _AROUND_PX + number * _NEXT_PX), SIGN, _LINE_PX)


def render_doing(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw around each agent how much of a deed that lasts it has done: an arc in its color that closes.

    It is outside the arcs of cooldowns, apart from the disc of the same color.
    """
    visual = get_drawing(ctx)
    radius = _AROUND_PX + (1 + len(find_counts(ctx, COOLDOWNS))) * _NEXT_PX
    for state in find_counts(ctx, DOING).values():
        for agent, place, turns in _list_marked_agents(ctx, state["left"], data):
            share = min(1.0, max(0.0, 1.0 - turns / (state["of"] or 1)))
            with visual.owned(*_find_owner(visual, agent)):
                visual.render_symbols([place], _compute_arc(1.0, radius), SIGN, 1.0)
                if share > 0.0:
                    color = visual.color_of(visual.label_side(find_side_of(agent)))
                    visual.render_symbols([place], _compute_arc(share, radius), color, _LINE_PX)


def _find_owner(visual: Drawing, agent: IAgent) -> Owner:
    """Return the owner of a sign that goes with an agent and that its own team alone knows of."""
    return Owner(agent.name, (visual.label_side(find_side_of(agent)),))


def _describe_amounts(ctx: IContext) -> dict[str, list[tuple[str, Any]]]:
    """Return agent -> text of the amount it has left."""
    found: dict[str, list[tuple[str, Any]]] = {}
    for resource, state in find_counts(ctx, RESOURCES).items():
        for name, amount in islice(state["amounts"].items(), _MOST):
            found.setdefault(str(name), []).append((f"{resource} left", amount))
    return found


def _describe_cooldowns(ctx: IContext) -> dict[str, list[tuple[str, Any]]]:
    """Return agent -> the deeds that it cannot do yet, in words, with the number of turns."""
    found: dict[str, list[tuple[str, Any]]] = {}
    for deed, state in find_counts(ctx, COOLDOWNS).items():
        for name, turns in islice(state["left"].items(), _MOST):
            found.setdefault(str(name), []).append((f"{deed} not ready", f"{turns} turns"))
    return found


def _describe_doing(ctx: IContext) -> dict[str, list[tuple[str, Any]]]:
    """Return agent -> the deed that it is doing, in words, with the number of turns that are left."""
    found: dict[str, list[tuple[str, Any]]] = {}
    for deed, state in find_counts(ctx, DOING).items():
        for name, turns in islice(state["left"].items(), _MOST):
            if isinstance(turns, int | float):
                found.setdefault(str(name), []).append((f"{deed} goes on", f"{turns:.3g} turns"))
    return found


def _list_marked_agents(
    ctx: IContext, numbers: dict[Any, Any], data: dict[str, Any]
) -> Iterator[tuple[IAgent, _XY, float]]:
    """Yield the shown agents with position and number; none if there are too many to be legible."""
    visual = get_drawing(ctx)
    share = data.get("_alpha", 1.0)
    for name, number in sorted(numbers.items()) if len(numbers) <= _MOST else ():
        agent = ctx.agent.agents.get(name)
        if agent is not None and visual.is_shown(agent, share) and isinstance(number, int | float):
            yield agent, visual.position_of(name, share), number


def _make_amount_rows(ctx: IContext) -> LegendRows | None:
    rows = tuple(LegendRow(SIGN, f"{name} left", sign="gauge") for name in find_counts(ctx, RESOURCES))
    return LegendRows("", rows) if rows else None


def _make_cooldown_rows(ctx: IContext) -> LegendRows | None:
    rows = tuple(LegendRow(SIGN, f"{deed} not ready", sign="timer") for deed in find_counts(ctx, COOLDOWNS))
    return LegendRows("", rows) if rows else None


def _make_doing_rows(ctx: IContext) -> LegendRows | None:
    rows = tuple(LegendRow(SIGN, f"{deed} goes on", sign="arc") for deed in find_counts(ctx, DOING))
    return LegendRows("", rows) if rows else None


render_held.__dict__.update(
    artist="held",
    layer=Layer.GOALS,
    is_mark=True,
    once_a_turn=True,
    legend=LegendRows("", (LegendRow(SIGN, "held", sign="arc"),)),
)
render_discovered.__dict__.update(
    artist="discovered",
    layer=Layer.GOALS,
    is_mark=True,
    once_a_turn=True,
    legend=LegendRows("", (LegendRow(SIGN, "discovered", sign="square"),)),
)
render_amounts.__dict__.update(
    artist="resources", layer=Layer.FLAGS, is_mark=True, legend=_make_amount_rows, facts=_describe_amounts
)
render_cooldowns.__dict__.update(
    artist="cooldowns", layer=Layer.FLAGS, is_mark=True, legend=_make_cooldown_rows, facts=_describe_cooldowns
)
render_doing.__dict__.update(
    artist="doing", layer=Layer.FLAGS, is_mark=True, legend=_make_doing_rows, facts=_describe_doing
)
for _drawer in (render_held, render_discovered, render_amounts, render_cooldowns, render_doing):
    _drawer.__dict__["is_in_fog"] = True  # teams that see little know of it
    _drawer.__dict__["settles_in"] = 0
