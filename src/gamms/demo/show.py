"""How a game of capture the flag looks: drawers and visuals, as any program declares them."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from gamms.context import Context
from gamms.demo.match import Match
from gamms.visual import Artist, Color

_GROUND_M = 7.0  # radius of the tint around a node
_PAPER = 252
_TINT = 0.25  # share of the team colour in the ground
_POLE_M, _CLOTH_M = 60.0, 32.0
_LABEL_PX = 13


def declare(match: Match) -> None:
    """Declare territories, streets, flags and agents to the visual room of the game's context."""
    ctx, world = match.ctx, match.world
    ctx.visual.set_graph_visual(node_size=0.0, edge_color=(120, 124, 130))
    side = np.array([world.side[node] for node in ctx.graph.columns().node_ids.tolist()])
    tints = {_tint(team.color): ctx.graph.columns().xy[side == number] for number, team in enumerate(world.teams)}
    _add(ctx, "territories", draw_territories, 4, {"tints": tints})
    flags = [(_flag_node(match, number), team.color) for number, team in enumerate(world.teams)]
    _add(ctx, "flags", draw_flags, 35, {"flags": flags})
    for agent in match.agents:
        ctx.visual.set_agent_visual(agent.name, color=world.teams[agent.team].color, size=12)
    _add(ctx, "names", draw_names, 45, {"names": [agent.name for agent in match.agents]})


def draw_territories(ctx: Context, data: Mapping[str, Any]) -> None:
    """Tint the ground around the nodes of each team."""
    for color, places in data["tints"].items():
        ctx.visual.render_circles(places, _GROUND_M, color)


def draw_flags(ctx: Context, data: Mapping[str, Any]) -> None:
    """Plant each flag on its node."""
    for node_id, color in data["flags"]:
        _, x, y = ctx.graph.graph.get_node(node_id)
        top, low = y + _POLE_M, y + _POLE_M - _CLOTH_M
        ctx.visual.render_line(x, y, x, top, Color.Black, width=3)
        ctx.visual.render_polygon([(x, top), (x + 1.5 * _CLOTH_M, (top + low) / 2), (x, low)], color)


def draw_names(ctx: Context, data: Mapping[str, Any]) -> None:
    """Write each agent's name beside it."""
    for name in data["names"]:
        _, x, y = ctx.graph.graph.get_node(ctx.agent.get_agent(name).current_node_id)
        ctx.visual.render_text(name, x + 14, y + 10, (30, 30, 30), font_size=_LABEL_PX)


def _tint(color: tuple[int, int, int]) -> tuple[int, ...]:
    return tuple(round(_TINT * part + (1.0 - _TINT) * _PAPER) for part in color)


def _flag_node(match: Match, team: int) -> int:
    """Where a flag is: with the agent that carries it away, or at home."""
    carrier = match.announced.carriers.get(team)
    return match.world.flag[team] if carrier is None else match.ctx.agent.get_agent(carrier).current_node_id


def _add(ctx: Context, name: str, drawer: Any, layer: int, data: dict[str, Any]) -> None:
    artist = Artist(ctx, drawer, layer)
    artist.data = data
    ctx.visual.add_artist(name, artist)
