"""How far apart agents are: by edges, by road, in a straight line."""

from collections.abc import Callable, Collection, Mapping
from math import inf
from typing import Any

import numpy as np

from gamms.graph import Graph
from gamms.ir.agents import Position
from gamms.ir.graph import FloatArray

Place = int | Position  # where an agent counts as being: a node id; (x, y, z) of a flyer, where that is measured
Distances = dict[tuple[Place, Place], float]
Measure = Callable[[Collection[Place], Collection[Place]], Distances]  # of all pairs that are near enough


def _by_hops(graph: Graph, limit: float) -> Measure:
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


def _by_metres(graph: Graph, limit: float) -> Measure:
    return _by_way(lambda node: graph.distances(source=node, cutoff=limit))


def _by_way(search: Callable[[int], Mapping[int, float]]) -> Measure:
    """The shorter of the ways there and back, where one of them is among those that lead out of its first node."""
    known: dict[int, Mapping[int, float]] = {}

    def reached(node: int) -> Mapping[int, float]:
        if node not in known:
            known[node] = search(node)
        return known[node]

    def measure(ours: Collection[Any], theirs: Collection[Any]) -> Distances:
        ours, theirs = dict.fromkeys(ours).keys(), dict.fromkeys(theirs).keys()
        apart: Distances = {}
        for node in ours if theirs else ():
            ways = reached(node)
            apart.update(((node, other), ways[other]) for other in ways.keys() & theirs)
        for node in theirs if ours else ():
            ways = reached(node)
            for other in ways.keys() & ours:
                apart[other, node] = min(ways[other], apart.get((other, node), inf))
        return apart

    return measure


def _straight(graph: Graph, limit: float) -> Measure:
    known: dict[Place, tuple[float, ...]] = {}

    def located(places: Collection[Place]) -> FloatArray:
        """Where places are, (places, 3)."""
        new = [place for place in places if place not in known]
        nodes = [place for place in new if not isinstance(place, tuple)]
        known.update((place, place) for place in new if isinstance(place, tuple))
        known.update((node, (x, y, 0.0)) for node, (x, y) in zip(nodes, graph.positions(nodes).tolist(), strict=True))
        return np.array([known[place] for place in places]).reshape(-1, 3)

    def measure(ours: Collection[Place], theirs: Collection[Place]) -> Distances:
        a, b = list(ours), list(theirs)
        ways = located(a)[:, None, :] - located(b)[None, :, :]
        far = np.hypot(np.hypot(ways[..., 0], ways[..., 1]), ways[..., 2])
        rows, columns = np.nonzero(far <= limit)
        pairs = zip(rows.tolist(), columns.tolist(), far[rows, columns].tolist(), strict=True)
        return {(a[i], b[k]): distance for i, k, distance in pairs}

    return measure


MEASURES: dict[str, Callable[[Graph, float], Measure]] = {
    "hops": _by_hops,
    "metres": _by_metres,
    "euclid": _straight,
}
