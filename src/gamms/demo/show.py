"""How a game of capture the flag looks: visuals and a drawer, as any program declares them."""

from collections.abc import Mapping
from typing import Any

from gamms.context import Context
from gamms.demo.report import sides
from gamms.visual import Artist
from gamms.visual.color import team_colors
from gamms.visual.undeclared import legend_of_teams

_LABEL_PX = 19


def declare(ctx: Context) -> None:
    """Declare streets, agents and their names to the visual room; territory and flags are drawn by their rules."""
    ctx.visual.set_graph_visual(node_size=0.0, edge_color=(120, 124, 130))
    teams = sides(ctx)
    colors = team_colors(teams)
    for team, agents in teams.items():
        for agent in agents:
            ctx.visual.set_agent_visual(agent.name, color=colors[str(team)], size=12)
    artist = Artist(ctx, draw_names, 45)
    artist.data = {"names": list(ctx.agent.agents)}
    ctx.visual.add_artist("names", artist)
    ctx.visual.add_artist("legend", legend_of_teams(ctx))


def draw_names(ctx: Any, data: Mapping[str, Any]) -> None:
    """Write each agent's name beside it."""
    for name in data["names"]:
        x, y = ctx.visual.position_of(name, data.get("_alpha", 1.0))
        ctx.visual.render_text(name, x + 14, y + 10, (30, 30, 30), font_size=_LABEL_PX)
