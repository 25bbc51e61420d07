"""How far apart agents are: on one node, by edges, by road, in a straight line."""

from collections import defaultdict
from collections.abc import Callable, Mapping
from math import inf
from typing import Any

import numpy as np

from gamms.ir.graph import FloatArray
from gamms.typing import AgentType

Distances = dict[tuple[str, str], float]  # by the names of two agents


def _on_one_node(_: Any, ours: list[Any], theirs: list[Any], __: float) -> Distances:
    return _by_way(ours, theirs, lambda node: {node: 0.0})


def _by_hops(ctx: Any, ours: list[Any], theirs: list[Any], limit: float) -> Distances:
    near = ctx.graph.graph.neighborhoods

    def reached(node: int) -> dict[int, float]:
        # NOTE: 5 us for what lies 3 edges around a node of Helsinki, where a search of the whole graph takes 170 us.
        hops, ring, far = {node: 0.0}, [node], 0.0
        while ring and far + 1.0 <= limit:
            far += 1.0
            ring = [end for end in dict.fromkeys(end for start in ring for end in near[start]) if end not in hops]
            hops.update(dict.fromkeys(ring, far))
        return hops

    return _by_way(ours, theirs, reached)


def _by_metres(ctx: Any, ours: list[Any], theirs: list[Any], limit: float) -> Distances:
    return _by_way(ours, theirs, lambda node: ctx.graph.graph.distances(source=node, cutoff=limit))


def _by_way(ours: list[Any], theirs: list[Any], reached: Callable[[int], Mapping[int, float]]) -> Distances:
    """The shorter of the ways there and back, where one of them is among those that lead out of its first node."""
    at_a, at_b = _by_node(ours), _by_node(theirs)
    apart: dict[tuple[int, int], float] = {}
    for node in at_a:
        ways = reached(node)
        apart.update(((node, other), ways[other]) for other in ways.keys() & at_b.keys())
    for node in at_b:
        ways = reached(node)
        for other in ways.keys() & at_a.keys():
            apart[other, node] = min(ways[other], apart.get((other, node), inf))
    return {(a, b): far for (node, other), far in apart.items() for a in at_a[node] for b in at_b[other]}


def _straight(ctx: Any, ours: list[Any], theirs: list[Any], limit: float) -> Distances:
    ways = _places(ctx, ours)[:, None, :] - _places(ctx, theirs)[None, :, :]
    far = np.hypot(np.hypot(ways[..., 0], ways[..., 1]), ways[..., 2])
    rows, columns = np.nonzero(far <= limit)
    pairs = zip(rows.tolist(), columns.tolist(), far[rows, columns].tolist(), strict=True)
    return {(ours[i].name, theirs[k].name): distance for i, k, distance in pairs}


def _places(ctx: Any, agents: list[Any]) -> FloatArray:
    """Where agents are, (agents, 3)."""
    flat = ctx.graph.graph.positions([agent.current_node_id for agent in agents])
    places = np.column_stack([flat, np.zeros(len(agents))])
    for row, agent in enumerate(agents):
        if agent.type is AgentType.AERIAL:
            places[row] = agent.position
    return places


MEASURES: dict[str | None, Callable[[Any, list[Any], list[Any], float], Distances]] = {
    None: _on_one_node,
    "hops": _by_hops,
    "metres": _by_metres,
    "euclid": _straight,
}


def _by_node(agents: list[Any]) -> dict[int, list[str]]:
    at: dict[int, list[str]] = defaultdict(list)
    for agent in agents:
        at[agent.current_node_id].append(agent.name)
    return at
