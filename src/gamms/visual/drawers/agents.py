"""Drawer of an agent: an outlined disc, or a picture, at its node."""

from typing import Any

from gamms.typing import IContext
from gamms.visual.appearance import AgentData
from gamms.visual.color import Rgb, rgba
from gamms.visual.drawers.marks import discs

_LEAST_PX = 6.0
_BRIGHT = 170.0
_WHITE, _DARK = (255, 255, 255), (60, 60, 60)


def render_agent(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw the agent that `data['agent_data']`, an AgentData, names and describes."""
    look: AgentData = data["agent_data"]
    node = ctx.graph.graph.get_node(ctx.agent.get_agent(look.name).current_node_id)
    look.current_position = (node.x, node.y)
    if look.image is not None:
        ctx.visual.render_image(node.x, node.y, look.image, look.size)
    else:
        discs(ctx, [(node.x, node.y)], look.size, look.color, _outline(look.color), _LEAST_PX)


def _outline(color: Any) -> Rgb:
    """Dark around bright colours, white around the others."""
    red, green, blue, _ = rgba(color)
    luminance = 0.299 * red + 0.587 * green + 0.114 * blue
    return _DARK if luminance > _BRIGHT else _WHITE
