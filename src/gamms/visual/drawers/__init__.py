"""Drawers: functions `(ctx, data)` that draw one kind of object, with the primitives of `ctx.visual`.

One file per topic. A new thing to draw is one function here; every backend can show it. Where the same thing
is drawn many times, use the bulk primitives `render_lines` and `render_circles` (see `drawing.py`).
"""

from gamms.visual.drawers.agents import render_aerial_agent, render_agent, render_circle, render_rectangle
from gamms.visual.drawers.graph import render_input_overlay, render_obstacles
from gamms.visual.drawers.sensors import (
    render_aerial_agent_sensor,
    render_agent_sensor,
    render_map_sensor,
    render_neighbor_sensor,
    render_sensor,
)
from gamms.visual.drawers.streets import render_graph

__all__ = [
    "render_aerial_agent",
    "render_aerial_agent_sensor",
    "render_agent",
    "render_agent_sensor",
    "render_circle",
    "render_graph",
    "render_input_overlay",
    "render_map_sensor",
    "render_neighbor_sensor",
    "render_obstacles",
    "render_rectangle",
    "render_sensor",
]
