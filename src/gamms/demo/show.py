"""How a game of capture the flag looks: visuals and a drawer, as any program declares them."""

from collections.abc import Mapping
from typing import Any

from gamms.context import Context
from gamms.demo.report import sides
from gamms.visual import Artist, legend_of_teams
from gamms.visual.color import team_colors
from gamms.visual.drawing import drawing_of

_LABEL_PX = 19
_LABEL = 0.09, 0.016, 0.01  # how broad and high a name is, and half a disc, in widths of what is seen
_ASIDE = "\u00a0" * 2  # as wide as the disc of an agent, for text is placed in world units only


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
    """Write each agent's name right of it, where it would be neither upon another name nor upon an agent."""
    wide, high, disc = (share * drawing_of(ctx).extent() for share in _LABEL)
    share = data.get("_alpha", 1.0)
    hidden = drawing_of(ctx).hidden_agents(share)
    places = {name: ctx.visual.position_of(name, share) for name in data["names"] if name not in hidden}
    written: list[tuple[float, float]] = []
    for name, (x, y) in places.items():
        agents = [other_x - x for other_x, other_y in places.values() if abs(other_y - y) < high]
        names = [other_x - x for other_x, other_y in written if abs(other_y - y) < high]
        if not any(disc < way < wide for way in agents) and not any(abs(way) < wide for way in names):
            ctx.visual.render_text(_ASIDE + name, x, y + 0.4 * high, (30, 30, 30), font_size=_LABEL_PX)
            written.append((x, y))
