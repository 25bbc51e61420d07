"""Conversion of path lengths to turns, for agents of different speeds."""

from collections.abc import Mapping, Sequence
from math import inf
from typing import NamedTuple

import numpy as np

from gamms.context import Context
from gamms.ir.graph import FloatArray, IntArray
from gamms.strategies.knowledge import get_graph_of_mode


class Pace(NamedTuple):
    """How far an agent gets in a turn.

    Attributes:
        weight: the weight of edges that limits it.
        speed: the amount of this weight per turn.
        mode: its mode, which says which edges it may use; None: all.
    """

    weight: str | None
    speed: float
    mode: str | None


LITTLE = 1e-9  # a speed for agents that do not move: they need no time to their own node, and nearly forever to others


def find_pace(ctx: Context, name: str | None) -> Pace:
    """Return how far an agent gets in a turn; without a name, one along any edge."""
    agent = None if name is None else ctx.agent.get_agent(name)
    return _make_pace(ctx, getattr(agent, "speed", None), getattr(agent, "mode", None))


def _make_pace(ctx: Context, speed: float | None, mode: str | None) -> Pace:
    if speed is None or ctx.current_game is None:
        return Pace(None, 1.0, mode)
    if ctx.game.speed_unit == "edges":
        return Pace(None, speed, mode)
    seconds = ctx.game.turn_seconds if ctx.game.speed_unit == "metres_per_second" else 1.0
    return Pace("length", speed * seconds, mode)


def group_by_pace(ctx: Context, seen: Mapping[str, int]) -> dict[Pace, dict[str, int]]:
    """Return visible agents with their nodes, grouped by pace."""
    paces = dict[tuple[float | None, str | None], Pace]()
    found = dict[Pace, dict[str, int]]()
    for name, node in seen.items():
        agent = ctx.agent.get_agent(name)
        own = getattr(agent, "speed", None), getattr(agent, "mode", None)
        if own not in paces:
            paces[own] = _make_pace(ctx, *own)
        found.setdefault(paces[own], {})[name] = node
    return found


def count_turns(far: float, speed: float) -> float:
    """Return the number of turns for a distance; infinite for an infinite distance, at any speed."""
    if speed and far < inf:
        return far / speed
    return inf if far else 0.0


def convert_to_turns(far: FloatArray, speed: FloatArray | float) -> FloatArray:
    """Return the numbers of turns for distances; large for agents that do not move."""
    found: FloatArray = np.divide(far, np.maximum(speed, LITTLE), out=np.full(far.shape, inf), where=far < inf)
    return found


def count_turns_to(ctx: Context, name: str | None, source: int, target: int) -> float:
    """Return the number of turns that an agent needs between two nodes; infinite if there is no path."""
    weight, speed, mode = find_pace(ctx, name)
    return count_turns(get_graph_of_mode(ctx, mode).distance(source, target, weight), speed)


def count_turns_from(
    ctx: Context, name: str | None, sources: Sequence[int], targets: Sequence[int] | IntArray | None = None
) -> FloatArray:
    """Return the turns that an agent needs to nodes (sources, targets); None: all nodes of `ctx.graph.columns()`."""
    weight, speed, mode = find_pace(ctx, name)
    ends = ctx.graph.columns().node_ids if targets is None else targets
    return convert_to_turns(get_graph_of_mode(ctx, mode).distance_matrix(sources, ends, weight), speed)
