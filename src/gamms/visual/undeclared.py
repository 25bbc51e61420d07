"""What a scenario looks like when nobody said so: grey streets, agents in the colours of their teams or their own."""

from typing import Any

import numpy as np

from gamms.ir.graph import GraphColumns
from gamms.typing import IArtist, IContext
from gamms.visual.appearance import AgentData, GraphData
from gamms.visual.artist import Artist
from gamms.visual.color import TEAM_COLORS, Rgb
from gamms.visual.drawers import render_agent, render_graph

_STREETS, _NODES = (165, 168, 172), (140, 143, 148)


def undeclared_artists(ctx: IContext) -> dict[str, IArtist]:
    """Artists of the graph and of every agent, by name."""
    unit = _sight(ctx.graph.columns())
    streets = Artist(ctx, render_graph, 10)
    streets.data = {"graph_data": GraphData(_NODES, 0.35 * unit, _STREETS)}
    artists: dict[str, IArtist] = {"graph": streets}
    colors = _TeamColors()
    for agent in ctx.agent.create_iter():
        artists[agent.name] = disc = Artist(ctx, render_agent, 20)
        look = AgentData(agent.name, colors.of(getattr(agent, "team", None) or agent.name), unit)
        disc.data = {"agent_data": look, "_alpha": 1.0}
    return artists


class _TeamColors:
    """Colours in the order in which teams are met; a team may be anything that can be compared."""

    def __init__(self) -> None:
        self._teams: list[Any] = []

    def of(self, team: Any) -> Rgb:
        if team not in self._teams:
            self._teams.append(team)
        return TEAM_COLORS[self._teams.index(team) % len(TEAM_COLORS)]


def _sight(columns: GraphColumns) -> float:
    """A radius, in world units, at which agents neither hide streets nor vanish."""
    if len(columns.xy) == 0:
        return 1.0
    widest = float(np.ptp(columns.xy, axis=0).max())
    ways = columns.xy[columns.targets] - columns.xy[columns.sources]
    lengths = np.hypot(ways[:, 0], ways[:, 1])
    typical = float(np.median(lengths)) if len(lengths) else widest
    return min(0.22 * typical, 0.018 * widest) or 1.0
