"""Shortest ways on a map, written again: Dijkstra's algorithm from the target, in dicts and a heap."""

from collections import OrderedDict
from heapq import heappop, heappush
from math import dist, inf


class Roads:
    """A map: `nodes` node -> (x, y), `edges` (source, target, length) in their order."""

    def __init__(self, nodes, edges):
        self.xy, self.known = nodes, OrderedDict()
        self.ahead, self.behind = {node: {} for node in nodes}, {node: {} for node in nodes}
        for source, target, length in edges:
            if source != target:
                self.ahead[source][target] = min(length, self.ahead[source].get(target, inf))
                self.behind[target][source] = self.ahead[source][target]

    def are_near(self, one, other, reach):
        return dist(self.xy[one], self.xy[other]) <= reach

    def around(self, here, hops):
        """Return node -> number of edges, up to so many."""
        found, ring = {here: 0}, [here]
        for number in range(1, hops + 1):
            ring = [end for node in ring for end in self.ahead[node] if end not in found]
            found.update((end, number) for end in ring)
        return found

    def to(self, target, here):
        """Return node -> distance to a target, of all nodes that are no farther than `here`; sums from the target."""
        if here in self.known.get(target, ()):
            self.known.move_to_end(target)
            return self.known[target]
        known, done, heap = {target: 0.0}, {}, [(0.0, target)]
        while heap:
            far, node = heappop(heap)
            if far > done.get(here, inf):
                break
            if node not in done:
                done[node] = far
                for before, length in self.behind[node].items():
                    if far + length < known.get(before, inf):
                        known[before] = far + length
                        heappush(heap, (far + length, before))
        self.known[target] = done
        while len(self.known) > 400:
            self.known.popitem(last=False)
        return done

    def distance(self, here, target):
        return self.to(target, here).get(here, inf)

    def shortest(self, here, target):
        """Return the shortest path; of several that with the fewest edges, then the one with the lowest ids."""
        far = self.to(target, here)

        def tight(node):
            return [end for end, length in self.ahead[node].items() if end in far and far[node] == far[end] + length]

        return self._path(here, target, tight)

    def fewest(self, here, target):
        """Return the path with the fewest edges; of several the one with the lowest ids."""
        return self._path(here, target, self.ahead.get)

    @staticmethod
    def _path(here, target, ends_of):
        """Return the path with the fewest of some edges, then with the lowest ids."""
        rings, seen = [[here]], {here}
        while target not in rings[-1]:
            ring = dict.fromkeys(end for node in rings[-1] for end in ends_of(node) if end not in seen)
            seen.update(ring)
            rings.append(list(ring))
        useful = [{target}]
        for ring in reversed(rings[:-1]):
            useful.append({node for node in ring if useful[-1] & set(ends_of(node))})
        path = [here]
        for ends in useful[-2::-1]:
            path.append(min(ends & set(ends_of(path[-1]))))
        return path
