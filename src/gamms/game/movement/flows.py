"""Random walks, diffusion of probabilities, and reachable nodes, computed along graph edges for many games at once.

See `routes.py` for distances and actions toward targets, and `gamms.belief.GamesFilter` for beliefs about targets.
"""

import numpy as np

from gamms import kernels
from gamms.arguments import as_array, as_count, as_float, as_int, as_key, as_range
from gamms.core.belief import IncomingArcs, predict
from gamms.errors import BadValue, TooLarge
from gamms.game.movement.routes import RouteTable
from gamms.game.movement.streets import StreetGraph
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.limits import max_memory, refuse_above
from gamms.text import shown

_MOST_DENSE = 1 << 28  # nodes in masks
_BYTES_PER_ROW = 8  # of walks


class Flows:
    """Random walks, diffusion and reachable nodes on a graph, as `view.flows()` returns them.

    Nodes are rows of `streets.columns`. Arrays may have any axes, such as games and agents.

    Args:
        streets: the graph.
    """

    def __init__(self, streets: StreetGraph) -> None:
        self._streets = streets
        self._walks: dict[float | None, IncomingArcs] = {}
        self._searches: dict[str | None, RouteTable] = {}

    def walks(self, nodes: IntArray, turns: int, seed: int = 0) -> IntArray:
        """Return random walks from nodes; each step goes to a uniformly drawn legal node, or stays.

        Args:
            nodes: rows of the start nodes, any shape.
            turns: the number of steps.
            seed: the seed of the draws; walk `i` draws the same numbers regardless of the other walks.

        Returns:
            Rows of nodes, shape (turns + 1, …); the first entry is `nodes`.

        Raises:
            BadType, BadValue: `nodes` are not rows of nodes.
            TooLarge: the walks would not fit into memory.
        """
        nodes = self._streets.checked(nodes, "nodes")
        steps = as_count(turns, "turns", least=0)
        per_turn = _BYTES_PER_ROW * max(1, nodes.size)
        fitting = max(0, max_memory() // per_turn - 1)  # the start nodes take one row
        what = f"{nodes.size} walks of {steps} turns, of which {fitting} would fit,"
        refuse_above(per_turn * (steps + 1), what)
        key = kernels.purpose_key(as_int(seed, "seed"), "walks")
        walkers = np.arange(nodes.size, dtype=np.uint64)
        found = np.empty((steps + 1, nodes.size), np.int64)
        found[0] = nodes.ravel()
        for turn in range(steps):
            here = found[turn]
            chosen = kernels.below_many(kernels.draw_bits_rows(key, walkers, turn), self._streets.counts[here])
            found[turn + 1] = self._streets.ends_of(here, chosen)
        return found.reshape(steps + 1, *nodes.shape)

    def diffuse(self, masses: FloatArray, turns: int = 1, stay: float | None = None) -> FloatArray:
        """Return node probabilities after random walks, shape (…, nodes).

        Equals `belief.Filter.predict` with `belief.random_walk(stay)`.

        Args:
            masses: probabilities of the nodes before the walks, (…, nodes).
            turns: the number of steps.
            stay: the probability of staying in one step; None: the same as moving to any one neighbor.

        Raises:
            BadType, BadValue: the last axis does not have one entry for each node, a mass is negative, infinite or
                NaN, or `stay` is not a probability.
        """
        nodes = len(self._streets.counts)
        masses = as_array(masses, "masses", "weights")
        if masses.dtype.kind != "f":
            masses = masses.astype(np.float64)
        if masses.shape[-1:] != (nodes,):
            raise BadValue(f"The last axis of masses must have {nodes} nodes, not the shape {masses.shape}.")
        chance = None if stay is None else as_float(stay, "stay")
        if chance is not None and not 0.0 <= chance <= 1.0:
            raise BadValue(f"stay must be a probability from 0 to 1, not {shown(stay)}.")
        if chance not in self._walks:
            self._walks[chance] = self._walk(chance)
        found = np.array(masses, np.float64, order="C")
        values = kernels.buffer(found)
        sums = kernels.buffer(np.empty(nodes))
        steps = as_count(turns, "turns", least=0)
        predict(self._walks[chance], sums, values, 0, values, 0, found.size // max(nodes, 1), steps)
        return found.astype(masses.dtype, copy=False)

    def _walk(self, stay: float | None) -> IncomingArcs:
        """Return the transition probabilities of a random walk by target node."""
        streets = self._streets
        counts = streets.counts
        ends = streets.targets
        starts = np.repeat(np.arange(len(counts)), counts)
        ways = counts - 1
        stays = 1.0 / (ways + 1.0) if stay is None else np.where(ways, stay, 1.0)
        going = (1.0 - stays) / np.maximum(ways, 1)
        chances = np.where(starts == ends, stays[starts], going[starts])
        return IncomingArcs(*kernels.ways_to(starts, ends, chances, len(counts)))

    def within(self, nodes: IntArray, limit: float, weight: str | None = "length") -> BoolArray:
        """Return masks of the nodes within a path length of each node, as `graph.distances(source=, cutoff=)` does.

        Args:
            nodes: rows of the start nodes, any shape.
            limit: the largest path length, in the unit of the weight.
            weight: the edge weight: "length", the name of an attribute, or None to count edges.

        Returns:
            A boolean mask, shape (…, nodes).

        Raises:
            BadType, BadValue: `nodes` are not rows of nodes.
            TooLarge: the mask would take more than 256 MB.
        """
        nodes = self._streets.checked(nodes, "nodes")
        size = len(self._streets.counts)
        if nodes.size * size > _MOST_DENSE:
            raise TooLarge(
                f"{nodes.size} masks of {size} nodes are too large. Ask for fewer games, or for distances between "
                "nodes: view.routes().distances."
            )
        ends, rows = self.reached(nodes.ravel(), limit, weight)
        found = np.zeros((nodes.size, size), np.bool_)
        found[np.repeat(np.arange(nodes.size), np.diff(ends)), rows] = True
        return found.reshape(*nodes.shape, size)

    def reached(self, nodes: IntArray, limit: float, weight: str | None = "length") -> tuple[IntArray, IntArray]:
        """Return the nodes that `within` finds as offsets, (nodes + 1,), and concatenated rows.

        The nodes within `limit` of `nodes[i]` are `rows[offsets[i]:offsets[i + 1]]`.

        Raises:
            BadType, BadValue: `nodes` are not rows of nodes.
            TooLarge: there are more than 268 million rows.
        """
        places = self._streets.checked(nodes, "nodes")
        most = as_range(limit, "limit")
        starts, which = np.unique(places, return_inverse=True)
        arcs = self._streets.ways(as_key(weight, "weight"))
        tree = kernels.route_trees(arcs, starts, np.arange(self._streets.num_nodes), most)
        lines = tree.lines
        rows = tree.rows
        known = np.bincount(lines, minlength=len(starts))
        counts = known[which]
        ends = np.concatenate(([0], np.cumsum(counts)))
        if ends[-1] > _MOST_DENSE:
            raise TooLarge(f"{ends[-1]} nodes are in reach, too many for arrays. Ask for fewer games.")
        first = (np.cumsum(known) - known)[which]
        return ends, rows[np.arange(ends[-1]) + np.repeat(first - ends[:-1], counts)]

    def edges(self, sources: IntArray, targets: IntArray) -> FloatArray:
        """Return the numbers of edges on the shortest paths from sources to targets; infinite without a path.

        The first query of a source searches the whole map; up to 512 MB of results are cached.

        Args:
            sources: rows of nodes.
            targets: rows of nodes; both arrays broadcast to one shape.

        Raises:
            BadType, BadValue: the arrays are not rows of nodes, or do not broadcast to one shape.
        """
        return self.far(sources, targets, None)

    def far(self, sources: IntArray, targets: IntArray, weight: str | None = "length") -> FloatArray:
        """Return the distances from sources to targets by an edge weight; infinite without a path.

        Searches start at the sources and are cached as in `edges`. `view.routes()` searches from the targets, so its
        sums of lengths may differ in the last bits.
        """
        if as_key(weight, "weight") not in self._searches:
            self._searches[weight] = RouteTable(self._streets, weight, from_sources=True)
        return self._searches[weight].distances(targets, sources)
