"""Drawers of marks for the turn that is shown: a cross where an agent was tagged, or went out of the game."""

from typing import Any

from gamms.typing import IContext
from gamms.visual.drawing import drawing_of
from gamms.visual.teams import side_colors, side_of

_ARM, _REACH = 0.011, 1.5  # half of a cross, in widths of what is seen; radius of its ring, in such halves
_WHITE, _LINE_PX, _EDGE_PX = (255, 255, 255), 3.0, 3.0


def render_tags(ctx: IContext, data: dict[str, Any]) -> None:
    """Mark the nodes of this turn's `tag` events, as `gamms.rules.tag` emits them.

    `data` may have `colors` by team, and names of agents as `of`: tags without any of these are left out.
    """
    visual, of = drawing_of(ctx), data.get("of")
    tags = [tag for tag in visual.events.of_kind("tag") if of is None or {tag.get("agent"), tag.get("other")} & of]
    if not tags:
        return
    arm, usual = _ARM * visual.extent() or 1.0, side_colors(ctx)
    for tag in tags:
        node, tagger = tag.get("node", -1), ctx.agent.agents.get(tag.get("agent", ""))
        if tagger is None or not ctx.graph.graph.has_node(node):
            continue
        side = side_of(tagger)
        color = data.get("colors", {}).get(side, usual[str(side)])
        place = ctx.graph.graph.get_node(node)
        for ink, more_px in ((_WHITE, _EDGE_PX), (color, 0.0)):
            visual.render_circles([(place.x, place.y)], _REACH * arm, ink, _LINE_PX + more_px)
            _cross(ctx, place.x, place.y, arm, ink, _LINE_PX + more_px)


def render_eliminated(ctx: IContext, data: dict[str, Any]) -> None:
    """Mark where agents went out of the game in this turn; `data["colors"]` has the colours of those that are shown."""
    visual = drawing_of(ctx)
    arm = _ARM * visual.extent() or 1.0
    for name in sorted(visual.events.eliminated() & data["colors"].keys() & ctx.agent.agents.keys()):
        x, y = visual.position_of(name)
        for ink, more_px in ((_WHITE, _EDGE_PX), (data["colors"][name], 0.0)):
            _cross(ctx, x, y, arm, ink, _LINE_PX + more_px)


def _cross(ctx: IContext, x: float, y: float, arm: float, ink: Any, width_px: float) -> None:
    cross = [(x - arm, y - arm), (x + arm, y + arm), (x - arm, y + arm), (x + arm, y - arm)]
    drawing_of(ctx).render_lines(cross, [0, 2, 4], ink, width_px)


for _drawer in (render_tags, render_eliminated):
    _drawer.once_a_turn = True  # type: ignore[attr-defined] # a mark does not glide
