"""How long agents take for their ways, in turns: of one, and in arrays of those in many games."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from math import inf
from typing import Any

import numpy as np

from gamms.context import Context
from gamms.game.batch.sight import Seen
from gamms.game.batch.view import ArrayView, movement_in
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray

Pace = tuple[str | None, float]  # a weight of edges, and how much of it in a turn
Ask = Callable[[IntArray, IntArray], Any]  # of sources and targets

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


class ArrayPaces:
    """The same for agents of many games by their numbers in the roster, and rows of nodes; all broadcast to one shape.

    Args:
        view: of the agents that ask.
    """

    def __init__(self, view: ArrayView) -> None:
        self._view, by = view, movement_in(view)
        speeds = [agent.speed for agent in view.roster.agents]
        seconds = by.turn_seconds
        self._speeds = np.array([1.0 if speed is None else speed * (seconds or 1.0) for speed in speeds])
        self._by_length = np.array([speed is not None for speed in speeds]) & (seconds is not None)

    def turns_to(self, agents: IntArray, sources: IntArray, targets: IntArray) -> FloatArray:
        """Return what the function `turns_to` does."""
        far: FloatArray = self._each(agents, sources, targets, lambda weight: self._view.routes(weight).distances)
        speeds = np.broadcast_to(self._speeds[agents], far.shape)
        found: FloatArray = np.where(far > 0.0, inf, 0.0)
        np.divide(far, speeds, out=found, where=(speeds > 0.0) & (far < inf))
        return found

    def turns_from(self, agents: IntArray, sources: IntArray, targets: IntArray) -> FloatArray:
        """Return what the function `turns_from` does."""
        far = self._each(agents, sources, targets, lambda weight: partial(self._view.flows().far, weight=weight))
        return turns_for(far, self._speeds[agents])

    def following(self, agents: IntArray, sources: IntArray, targets: IntArray) -> IntArray:
        """Return the nodes that come next on the ways of agents, (queries,)."""
        found: IntArray = self._each(agents, sources, targets, lambda weight: self._view.routes(weight).following)
        return found.astype(np.int64)

    def reach(self, seen: Seen, number: IntArray, nodes: IntArray) -> BoolArray:
        """Return which nodes, (numbers, nodes), agents reach in a turn that are seen in pairs of these numbers."""
        size, flows, keys = self._view.streets.num_nodes, self._view.flows(), [np.zeros(0, np.int64)]
        paces = np.stack((self._by_length, self._speeds))[:, seen.others]
        kinds, kind = np.unique(paces, axis=1, return_inverse=True)
        for i, (by_length, speed) in enumerate(kinds.T.tolist()):
            some = np.flatnonzero(kind == i)
            ends, rows = flows.reached(seen.nodes[some], speed, "length" if by_length else None)
            keys.append(np.repeat(number[some], np.diff(ends)) * size + rows)
        return np.isin(np.arange(len(nodes))[:, None] * size + nodes, np.concatenate(keys))

    def _each(self, agents: IntArray, sources: IntArray, targets: IntArray, ask: Callable[[str | None], Ask]) -> Any:
        """Return what is answered for ways by the weights of agents."""
        by_length = self._by_length[agents]
        if by_length.all() or not by_length.any():
            return ask("length" if by_length.any() else None)(sources, targets)
        by_length, sources, targets = np.broadcast_arrays(by_length, sources, targets)
        found = np.empty(by_length.shape)
        for weight, which in ((None, ~by_length), ("length", by_length)):
            found[which] = ask(weight)(sources[which], targets[which])
        return found
