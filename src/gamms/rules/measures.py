"""How far apart agents are: by edges, by road, in a straight line."""

from collections import defaultdict
from collections.abc import Callable, Mapping
from math import inf

import numpy as np

from gamms.graph import Graph
from gamms.ir.agents import Position
from gamms.ir.graph import FloatArray

Placed = tuple[str, int]  # the name of an agent, and the id of the node it counts as on
Distances = dict[tuple[str, str], float]  # by the names of two agents
Measure = Callable[[list[Placed], list[Placed]], Distances]  # of all pairs that are near enough
_Flyers = Mapping[str, Position]  # by name


def _by_hops(graph: Graph, limit: float, _: _Flyers) -> Measure:
    near = graph.neighborhoods

    def reached(node: int) -> dict[int, float]:
        # NOTE: 5 us for what lies 3 edges around a node of Helsinki, where a search of the whole graph takes 170 us.
        hops, ring, far = {node: 0.0}, [node], 0.0
        while ring and far + 1.0 <= limit:
            far += 1.0
            ring = [end for end in dict.fromkeys(end for start in ring for end in near[start]) if end not in hops]
            hops.update(dict.fromkeys(ring, far))
        return hops

    return _by_way(reached)


def _by_metres(graph: Graph, limit: float, _: _Flyers) -> Measure:
    return _by_way(lambda node: graph.distances(source=node, cutoff=limit))


def _by_way(search: Callable[[int], Mapping[int, float]]) -> Measure:
    """The shorter of the ways there and back, where one of them is among those that lead out of its first node."""
    known: dict[int, Mapping[int, float]] = {}

    def reached(node: int) -> Mapping[int, float]:
        if node not in known:
            known[node] = search(node)
        return known[node]

    def measure(ours: list[Placed], theirs: list[Placed]) -> Distances:
        if not ours or not theirs:
            return {}
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

    return measure


def _straight(graph: Graph, limit: float, flyers: _Flyers) -> Measure:
    def places(agents: list[Placed]) -> FloatArray:
        """Where agents are, (agents, 3)."""
        flat = graph.positions([node for _, node in agents])
        found = np.column_stack([flat, np.zeros(len(agents))])
        for row, (name, _) in enumerate(agents):
            if name in flyers:
                found[row] = flyers[name]
        return found

    def measure(ours: list[Placed], theirs: list[Placed]) -> Distances:
        if not ours or not theirs:
            return {}
        ways = places(ours)[:, None, :] - places(theirs)[None, :, :]
        far = np.hypot(np.hypot(ways[..., 0], ways[..., 1]), ways[..., 2])
        rows, columns = np.nonzero(far <= limit)
        pairs = zip(rows.tolist(), columns.tolist(), far[rows, columns].tolist(), strict=True)
        return {(ours[i][0], theirs[k][0]): distance for i, k, distance in pairs}

    return measure


MEASURES: dict[str, Callable[[Graph, float, _Flyers], Measure]] = {
    "hops": _by_hops,
    "metres": _by_metres,
    "euclid": _straight,
}


def _by_node(agents: list[Placed]) -> dict[int, list[str]]:
    at: dict[int, list[str]] = defaultdict(list)
    for name, node in agents:
        at[node].append(name)
    return at
