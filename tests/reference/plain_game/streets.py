"""The map of the reference: nodes, edges between them, and shortest ways."""

from dataclasses import dataclass, field
from fractions import Fraction
from functools import cache
from heapq import heappop, heappush
from math import dist, inf


@dataclass
class Streets:
    """Nodes by id, and the lengths of the edges between two nodes, in the order in which they were added."""

    xy: dict  # node -> (x, y)
    out: dict = field(default_factory=dict)  # node -> {next node: length of the edge in metres}
    is_bent: bool = False  # whether edges have other places on them than their ends

    @classmethod
    def of(cls, columns):
        """Return the map of what `Scenario.columns()` gives."""
        streets = cls(
            {node: tuple(xy) for node, xy in zip(columns.node_ids.tolist(), columns.xy.tolist(), strict=True)}
        )
        nodes = list(streets.xy)
        streets.out = {node: {} for node in nodes}
        lengths = columns.lengths.tolist()
        for source, target, length in zip(columns.sources.tolist(), columns.targets.tolist(), lengths, strict=True):
            if nodes[target] in streets.out[nodes[source]]:
                raise NotImplementedError("parallel edges are not in the subset of the reference")
            streets.out[nodes[source]][nodes[target]] = Fraction(length)
        streets.is_bent = bool(columns.polylines)
        streets.ways_from = cache(streets.ways_from)
        return streets

    def neighbours(self, node):
        """Return the other nodes next to a node, in the order of the edges."""
        return [end for end in self.out[node] if end != node]

    def cost(self, start, end, is_metric):
        """Return how much of an agent's speed an edge takes."""
        return self.out[start][end] if is_metric else Fraction(1)

    def ways_from(self, node, is_metric):
        """Return for each node in reach (its distance, its number of edges, the way there).

        Of equally long ways it is the one with the fewest edges; of these the one with the lowest ids from the start.
        """
        found = {}
        waiting = [(Fraction(0), 0, (node,))]
        while waiting:
            far, count, way = heappop(waiting)
            if way[-1] in found:
                continue
            found[way[-1]] = (far, count, way)
            for end in self.out[way[-1]]:
                if end not in found:
                    heappush(waiting, (far + self.cost(way[-1], end, is_metric), count + 1, (*way, end)))
        return found

    def distance(self, a, b, kind):
        """Return how far two nodes are from each other: "euclid", or "hops" and "metres" by the shorter direction."""
        if kind == "euclid":
            return dist(self.xy[a], self.xy[b])
        ways = self.ways_from(a, kind == "metres")
        back = self.ways_from(b, kind == "metres")
        return min(ways[b][0] if b in ways else inf, back[a][0] if a in back else inf)
