"""Who is under the pointer, and what is known about him."""

from typing import Any

import numpy as np

from gamms.ir.graph import FloatArray
from gamms.typing import IContext
from gamms.typing.agent_engine import AgentType

_REACH_PX = 14.0


def nearest(points: FloatArray, x: float, y: float, reach_px: float = _REACH_PX) -> int | None:
    """The row of the screen point (points, 2) nearest to (x, y), if one is within reach."""
    if len(points) == 0:
        return None
    distances = np.hypot(*(points - (x, y)).T)
    row = int(np.argmin(distances))
    return row if distances[row] <= reach_px else None


def facts_about(ctx: IContext, name: str) -> list[str]:
    """An agent in a few lines: name, team, where it is, and what its sensors last told it."""
    agent: Any = ctx.agent.get_agent(name)
    team = getattr(agent, "team", None)
    lines = [name if team is None else f"{name} · team {team}"]
    if agent.type == AgentType.AERIAL:
        x, y, z = agent.position
        lines.append(f"at ({x:.1f}, {y:.1f}), {z:.1f} up")
    else:
        lines.append(f"at node {agent.current_node_id}, from {agent.prev_node_id}")
    if not getattr(agent, "alive", True):
        lines.append("out of the game")
    told = agent.state.get("sensor") if isinstance(agent.state, dict) else None
    for sensor, (kind, data) in (told or {}).items():
        lines.append(f"{sensor} ({getattr(kind, 'name', kind)}): {_summary(data)}")
    return lines


def _summary(data: Any) -> str:
    """What a sensor told, as short as it can be said."""
    if isinstance(data, dict):
        counts = [f"{len(part)} {name}" for name, part in data.items() if isinstance(part, dict | list | tuple | set)]
        if counts and len(counts) == len(data):
            return ", ".join(counts)
    if isinstance(data, dict | list | tuple | set):
        few = ", ".join(map(str, data)) if len(data) <= 6 else ""
        return few if 0 < len(few) <= 40 else f"{len(data)} seen" if data else "nothing"
    words = str(data)
    return words if len(words) <= 40 else words[:39] + "…"
