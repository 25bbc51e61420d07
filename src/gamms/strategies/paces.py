"""How many turns agents take for their ways."""

from collections.abc import Mapping, Sequence
from math import inf

import numpy as np

from gamms.context import Context
from gamms.ir.graph import FloatArray, IntArray

Pace = tuple[str | None, float]  # a weight of edges, and how much of it in a turn

LITTLE = 1e-9  # a speed: agents that do not move get to their own node in no time, and nowhere else in this game


def pace_of(ctx: Context, name: str | None) -> Pace:
    """Return by which weight of edges an agent goes, and how much of it in a turn."""
    return _pace(ctx, None if name is None else getattr(ctx.agent.get_agent(name), "speed", None))


def _pace(ctx: Context, speed: float | None) -> Pace:
    if speed is None or ctx.current_game is None:
        return None, 1.0
    if ctx.game.speed_unit == "edges":
        return None, speed
    return "length", speed * (ctx.game.turn_seconds if ctx.game.speed_unit == "metres_per_second" else 1.0)


def by_pace(ctx: Context, seen: Mapping[str, int]) -> dict[Pace, dict[str, int]]:
    """Return agents in sight with their nodes, as given, by how they go."""
    paces, found = dict[float | None, Pace](), dict[Pace, dict[str, int]]()
    for name, node in seen.items():
        speed = getattr(ctx.agent.get_agent(name), "speed", None)
        if speed not in paces:
            paces[speed] = _pace(ctx, speed)
        found.setdefault(paces[speed], {})[name] = node
    return found


def in_turns(far: float, speed: float) -> float:
    """Return how many turns a way takes; infinite where there is none, however high the speed is."""
    return far / speed if speed and far < inf else (inf if far else 0.0)


def turns_for(far: FloatArray, speed: FloatArray | float) -> FloatArray:
    """Return how many turns ways take, likewise; agents that do not move take long."""
    found: FloatArray = np.divide(far, np.maximum(speed, LITTLE), out=np.full(far.shape, inf), where=far < inf)
    return found


def turns_to(ctx: Context, name: str | None, source: int, target: int) -> float:
    """Return how many turns an agent takes from one node to another; infinite where there is no path."""
    weight, speed = pace_of(ctx, name)
    return in_turns(ctx.graph.graph.distance(source, target, weight), speed)


def turns_from(
    ctx: Context, name: str | None, sources: Sequence[int], targets: Sequence[int] | IntArray | None = None
) -> FloatArray:
    """Return how many turns an agent takes to nodes (sources, targets); None: to all, as in `ctx.graph.columns()`."""
    weight, speed = pace_of(ctx, name)
    ends = ctx.graph.columns().node_ids if targets is None else targets
    return turns_for(ctx.graph.graph.distance_matrix(sources, ends, weight), speed)
