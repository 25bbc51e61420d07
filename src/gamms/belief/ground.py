"""The map in the form that beliefs use: node rows, edges between them, and the moves of targets along them."""

from functools import cached_property, lru_cache
from hashlib import blake2b
from typing import Any, Self

import numpy as np

from gamms import kernels
from gamms.errors import BadType, UnknownName
from gamms.ir.graph import FloatArray, GraphColumns, IntArray, find_usable_edges, list_forbidden_paths
from gamms.text import shown
from gamms.typing.routes import TurnRoutes

Arc = tuple[int, int, float]  # ids of both ends, length


class BeliefMap:
    """The map in one revision.

    Attributes:
        columns: columns of the graph.
        size: number of nodes.
        digest: a text that identifies the nodes and edges, equal in every run.
    """

    def __init__(self, columns: GraphColumns) -> None:
        self.columns = columns
        self.size = len(columns.node_ids)
        ends = columns.node_ids[columns.sources], columns.node_ids[columns.targets]
        parts = (columns.node_ids, *ends, columns.lengths)
        self.digest = blake2b(
            b"".join(np.ascontiguousarray(part).tobytes() for part in parts), digest_size=8
        ).hexdigest()

    def __reduce__(self) -> tuple[Any, ...]:
        return get_belief_map, (self.columns,)

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        return self

    def find_rows(self, node_ids: IntArray) -> IntArray:
        """Return the rows of some nodes (nodes,); -1 for unknown nodes."""
        return kernels.find_rows(self.columns.node_ids, node_ids, self.columns.node_order)

    def find_row(self, node_id: int) -> int:
        """Return the row of a node; -1 if it is unknown."""
        return self._row_of.get(node_id, -1)

    @cached_property
    def _row_of(self) -> dict[int, int]:
        """Node id -> its row."""
        return dict(zip(self.columns.node_ids.tolist(), range(self.size), strict=True))

    def find_known_rows(self, node_ids: IntArray) -> IntArray:
        """Return the rows of some nodes (nodes,).

        Raises:
            UnknownName (KeyError): a node is not on the map.
        """
        rows = self.find_rows(node_ids)
        if (rows < 0).any():
            raise UnknownName("node", int(node_ids[np.argmax(rows < 0)]), self.columns.node_ids.tolist())
        return rows

    def list_arcs(self) -> set[Arc]:
        """Return all edges by the ids of their ends and their lengths."""
        ids = self.columns.node_ids
        columns = self.columns
        ends = ids[columns.sources].tolist(), ids[columns.targets].tolist()
        return set(zip(*ends, columns.lengths.tolist(), strict=True))

    def list_ids(self, chosen: "IntArray | FloatArray") -> list[int]:
        """Return the ids of the rows in a mask."""
        found: list[int] = self.columns.node_ids[chosen].tolist()
        return found


@lru_cache(maxsize=4)
def get_belief_map(columns: GraphColumns) -> BeliefMap:
    """Return the map of a graph revision, cached.

    Raises:
        BadType: not the columns of a graph.
    """
    if not isinstance(columns, GraphColumns):
        raise BadType(f"The map of a filter must be the columns of a graph, ctx.graph.columns(), not {shown(columns)}.")
    return BeliefMap(columns)


class MoveMap:
    """The moves of targets along one edge, between places: nodes, or the states of traffic that obeys turns.

    Args:
        ground: the map.
        nodes: (places,) the row of the node of each place.
        shares: (places,) the initial probability of each place among those on its node.
        ids: (places,) different numbers, by which ties of shortest paths are decided.
        arcs: (arcs,) each: the places at both ends, and the row of the edge.

    Attributes:
        ground, nodes, shares: see above.
        starts: (moves,) places, ascending.
        ends: (moves,) places. Of several edges from a place to a node, only the shortest is a move.
    """

    def __init__(
        self,
        ground: BeliefMap,
        nodes: IntArray,
        shares: FloatArray,
        ids: IntArray,
        arcs: tuple[IntArray, IntArray, IntArray],
    ) -> None:
        self.ground = ground
        self.nodes = nodes
        self.shares = shares
        self._ids = ids
        starts, ends, edges = arcs
        lengths = ground.columns.lengths[edges]
        order = np.lexsort((edges, lengths, nodes[ends], starts))
        order = order[nodes[starts[order]] != nodes[ends[order]]]
        self._starts = starts[order]
        self._ends = ends[order]
        self._edges = edges[order]
        self._lengths = lengths[order]
        _, first = np.unique(self._starts * ground.size + nodes[self._ends], return_index=True)
        self.starts = self._starts[first]
        self.ends = self._ends[first]

    @property
    def arcs(self) -> tuple[IntArray, IntArray]:
        """The places at both ends of all arcs, (arcs,) each, without edges from a node to itself."""
        return self._starts, self._ends

    def begin_on(self, row: int) -> int:
        """Return the place of a target that begins on a node, by the row of the node."""
        return len(self.nodes) - self.ground.size + row

    def list_ends(self, place: int) -> list[int]:
        """Return the ends of the moves from a place."""
        first, last = np.searchsorted(self.starts, (place, place + 1)).tolist()
        ends: list[int] = self.ends[first:last].tolist()
        return ends

    def find_edges(self, starts: IntArray, ends: IntArray) -> IntArray:
        """Return the rows (pairs,) of the shortest edges between pairs of places; -1 if there is no edge."""
        number = len(self.nodes)
        order = np.lexsort((self._lengths, self._starts * number + self._ends))
        known, first = np.unique((self._starts * number + self._ends)[order], return_index=True)
        if not len(known):
            return np.full(len(starts), -1)
        wanted = starts * number + ends
        found = np.minimum(np.searchsorted(known, wanted), len(known) - 1)
        return np.where(known[found] == wanted, self._edges[order[first[found]]], -1)

    def find_steps(self, goal: int) -> IntArray:
        """Return the next place on the shortest path from each place to a node, (places,).

        Args:
            goal: the row of the node.

        Returns:
            The place itself at the node; -1: there is no path.
        """
        number = len(self.nodes)
        arcs = kernels.make_arcs(self._ends, self._starts, self._lengths, number)
        goals = np.flatnonzero(self.nodes == goal)
        found = kernels.Search(arcs, self._ids).find(goals)
        steps = np.full(number, -1)
        steps[found.rows] = found.before
        steps[goals] = goals
        return steps


@lru_cache(maxsize=4)
def map_moves(ground: BeliefMap, turns: str | None = None) -> MoveMap:
    """Return the moves of targets on a map.

    Args:
        ground: the map.
        turns: the mode of targets that obey its turn restrictions, the name of an edge attribute; None: they obey none,
            and may use all edges. With turns, the places are the vertices of `TurnRoutes.list_arcs`; the last of them,
            one for each node, are those of targets that begin there, or came by an unknown edge.
    """
    columns = ground.columns
    here = np.arange(ground.size)
    edges = np.arange(len(columns.edge_ids))
    if turns is None:
        return MoveMap(ground, here, np.ones(ground.size), columns.node_ids, (columns.sources, columns.targets, edges))
    paths = list_forbidden_paths(columns).get(turns, [])
    traffic = TurnRoutes(columns, columns.lengths, find_usable_edges(columns, turns), paths)
    *arcs, nodes = traffic.list_arcs()
    shares = np.concatenate((np.zeros(len(nodes) - ground.size), np.ones(ground.size)))
    return MoveMap(ground, nodes, shares, np.arange(len(nodes)), (arcs[0], arcs[1], arcs[2]))
