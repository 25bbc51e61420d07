"""Where agents get in a turn that counts edges: the nodes around a node and the ways to them, kept for later turns."""

from itertools import islice
from typing import NamedTuple

import numpy as np

from gamms.game.streets import Streets
from gamms.typing.graph_engine import IGraph

_MOST_KEPT = 1 << 17  # nodes around others: 25 megabytes


class Around(NamedTuple):
    """The nodes within so many edges of one."""

    legal: tuple[int, ...]  # the node in the middle, its neighbours, then the others in the order of the graph
    hops: dict[int, float]  # node -> edges from the middle, in the order of the graph
    before: dict[int, int]  # node -> the one before it on the shortest path; of all others if there is a bound

    def path(self, node: int) -> list[int]:
        """Return the shortest path to a node in `before`, without the one in the middle."""
        path = [node]
        while len(path) < self.hops[node]:
            path.append(self.before[path[-1]])
        return path[::-1]


class Surroundings:
    """The nodes around others, of the graph as it is.

    Shortest paths are those of `graph.shortest_path(source, target, None)`: of several the one whose ids, read from the
    source, are least where they first differ. A breadth-first search that takes neighbours in the order of their ids
    finds these.
    """

    def __init__(self) -> None:
        self._graph: IGraph | None = None
        self._revision: int | None = None
        self._found: dict[tuple[int, int], Around] = {}  # by node and number of edges
        self._kept = 0  # how many nodes are in them

    def of(self, graph: IGraph, streets: Streets, node: int, edges: int) -> Around:
        """Return the nodes within so many edges of a node.

        Args:
            graph: is searched.
            streets: of this graph.
            node: in the middle.
            edges: how many at most.

        Raises:
            UnknownName (KeyError): there is no such node.
        """
        if graph is not self._graph or graph.revision is None or graph.revision != self._revision:
            self._graph, self._revision = graph, graph.revision
            self._found.clear()
            self._kept = 0
        found = self._found.get((node, edges))
        if found is None:
            found = self._found[node, edges] = _search(graph, streets, node, edges)
            self._kept += len(found.hops)
            if self._kept > _MOST_KEPT:
                self._forget_half()
        return found

    def _forget_half(self) -> None:
        for key in [*islice(self._found, (len(self._found) + 1) // 2)]:
            self._kept -= len(self._found.pop(key).hops)


def _search(graph: IGraph, streets: Streets, node: int, edges: int) -> Around:
    near, hops, before = graph.neighborhoods, {node: 0.0}, dict[int, int]()
    level, far = [node], 0
    while level and far < edges:
        far += 1
        following = []
        for one in level:
            for other in sorted(near[one]):
                if other not in hops:
                    hops[other], before[other] = float(far), one
                    following.append(other)
        level = following
    ids = np.fromiter(hops, np.int64, len(hops))
    ordered = ids[streets.rows(ids).argsort()].tolist()
    legal = tuple(dict.fromkeys([*near[node], *ordered]))
    return Around(legal, {one: hops[one] for one in ordered}, before)
