"""Conversion of path lengths to turns, for agents of different speeds."""

from collections.abc import Mapping, Sequence
from math import inf

import numpy as np

from gamms.context import Context
from gamms.ir.graph import FloatArray, IntArray

Pace = tuple[str | None, float]  # a weight of edges, and the amount of it per turn

LITTLE = 1e-9  # a speed for agents that do not move: they need no time to their own node, and nearly forever to others


def pace_of(ctx: Context, name: str | None) -> Pace:
    """Return the edge weight that limits an agent, and its amount per turn."""
    return _pace(ctx, None if name is None else getattr(ctx.agent.get_agent(name), "speed", None))


def _pace(ctx: Context, speed: float | None) -> Pace:
    if speed is None or ctx.current_game is None:
        return None, 1.0
    if ctx.game.speed_unit == "edges":
        return None, speed
    return "length", speed * (ctx.game.turn_seconds if ctx.game.speed_unit == "metres_per_second" else 1.0)


def by_pace(ctx: Context, seen: Mapping[str, int]) -> dict[Pace, dict[str, int]]:
    """Return visible agents with their nodes, grouped by pace."""
    paces = dict[float | None, Pace]()
    found = dict[Pace, dict[str, int]]()
    for name, node in seen.items():
        speed = getattr(ctx.agent.get_agent(name), "speed", None)
        if speed not in paces:
            paces[speed] = _pace(ctx, speed)
        found.setdefault(paces[speed], {})[name] = node
    return found


def in_turns(far: float, speed: float) -> float:
    """Return the number of turns for a distance; infinite for an infinite distance, at any speed."""
    if speed and far < inf:
        return far / speed
    return inf if far else 0.0


def turns_for(far: FloatArray, speed: FloatArray | float) -> FloatArray:
    """Return the numbers of turns for distances; large for agents that do not move."""
    found: FloatArray = np.divide(far, np.maximum(speed, LITTLE), out=np.full(far.shape, inf), where=far < inf)
    return found


def turns_to(ctx: Context, name: str | None, source: int, target: int) -> float:
    """Return the number of turns that an agent needs between two nodes; infinite if there is no path."""
    weight, speed = pace_of(ctx, name)
    return in_turns(ctx.graph.graph.distance(source, target, weight), speed)


def turns_from(
    ctx: Context, name: str | None, sources: Sequence[int], targets: Sequence[int] | IntArray | None = None
) -> FloatArray:
    """Return the turns that an agent needs to nodes (sources, targets); None: all nodes of `ctx.graph.columns()`."""
    weight, speed = pace_of(ctx, name)
    ends = ctx.graph.columns().node_ids if targets is None else targets
    return turns_for(ctx.graph.graph.distance_matrix(sources, ends, weight), speed)
