"""Legal moves along one edge as arrays, for maps that many agents or games share."""

from copy import copy
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from gamms import kernels
from gamms.arguments import as_array, as_numbers_of, as_one_shape
from gamms.core import moves
from gamms.errors import BadValue, UnknownName
from gamms.ir.graph import FloatArray, GraphColumns, IntArray, RowArray
from gamms.readonly import ShallowCopyMixin, copy_locked


class RouteSource(Protocol):
    """The part of `ctx.graph.routes` that this module needs."""

    def arcs(self, weight: str | None = "length", *, reverse: bool = False) -> kernels.Arcs:
        """Return the edges with weights as compressed sparse rows, optionally reversed; parallel edges are merged."""

    def weights(self, weight: str | None) -> FloatArray:
        """Return the weight of each edge, (edges,)."""

    def neighborhoods(self) -> tuple[IntArray, IntArray]:
        """Return each node and its out-neighbors as offsets (nodes + 1,) and rows; the node itself comes first."""


class StreetGraph(ShallowCopyMixin):
    """The nodes of a graph, and the legal moves from each along one edge.

    Args:
        columns: the columns of the graph.
        queries: `ctx.graph.routes`.

    Attributes:
        columns: the columns of the graph.
        num_nodes: the number of nodes.
        counts: (nodes,) the number of legal nodes of each node, including itself.
        offsets: (nodes + 1,) the legal nodes of node `i` are `targets[offsets[i]:offsets[i + 1]]`.
        targets: rows of nodes: for each node its own row, then its neighbors in the order of `state["legal"]`.
    """

    _not_pickled = (
        "The streets of a batch can neither be pickled nor copied deeply, because they refer to its map. Pickle their "
        "columns, or ctx.graph.columns()."
    )

    def __init__(self, columns: GraphColumns, queries: RouteSource) -> None:
        self.columns = columns
        self._queries = queries
        self.num_nodes = len(columns.node_ids)
        self.offsets, self.targets = map(copy_locked, queries.neighborhoods())
        self.counts: IntArray = copy_locked(np.diff(self.offsets))
        self._ids_are_rows = bool((columns.node_ids == np.arange(len(columns.node_ids))).all())
        self._order = None if self._ids_are_rows else columns.node_order
        self._padded: IntArray | None = None
        self._axes: FloatArray | None = None

    def get_ways(self, weight: str | None) -> kernels.Arcs:
        """Return the edges with weights as compressed sparse rows."""
        return self._queries.arcs(weight)

    def get_reversed_ways(self, weight: str | None) -> kernels.Arcs:
        """Return the reversed edges with weights, for searches from the ends of paths."""
        return self._queries.arcs(weight, reverse=True)

    def weights(self, weight: str | None) -> FloatArray:
        """Return the weight of each edge, (edges,)."""
        return self._queries.weights(weight)

    def copy_without_graph(self) -> "StreetGraph":
        """Return a copy that does not keep the graph in memory, for caches."""
        twin = copy(self)
        del twin._queries
        return twin

    def ids(self, rows: IntArray) -> IntArray:
        """Return the ids of nodes.

        Raises:
            BadType, BadValue: `rows` are not rows of nodes.
        """
        return self.get_ids(self.check_rows(rows, "rows"))

    def get_ids(self, rows: IntArray) -> IntArray:
        """Return the ids of nodes, without a check of the rows."""
        return rows if self._ids_are_rows else self.columns.node_ids[rows]

    def rows(self, ids: Any) -> IntArray:
        """Return the rows of nodes.

        Raises:
            BadType: the ids are not integers.
            UnknownName (KeyError): a node is not on the map.
        """
        wanted = as_array(ids, "ids of nodes", "integers").astype(np.int64, copy=False)
        known = self.columns.node_ids
        if self._order is None and wanted.size and wanted.view(np.uint64).max() < len(known):
            return wanted
        if self._order is None:
            found = np.clip(wanted, 0, max(0, len(known) - 1))
        else:
            places = np.searchsorted(known, wanted, sorter=self._order)
            found = self._order[np.minimum(places, len(known) - 1)]
        missing = wanted[known[found] != wanted] if len(known) else wanted
        if missing.size:
            raise UnknownName("node", int(missing.flat[0]))
        return found

    def check_rows(self, rows: object, name: str) -> IntArray:
        """Return rows of nodes from a caller, checked; `streets.rows(ids)` makes them.

        Raises:
            BadType, BadValue: they are not integers, or not rows of nodes.
        """
        return as_numbers_of(rows, name, self.num_nodes, "nodes")

    @cached_property
    def core(self) -> moves.LegalMoves:
        """The legal moves in the form of the core."""
        return moves.LegalMoves(*self._get_memory())

    @cached_property
    def core_with_all_legal(self) -> moves.LegalMoves:
        """The legal moves in the form of the core, for games that allow moves to any node."""
        return moves.LegalMoves(*self._get_memory(), are_all_legal=True)

    def _get_memory(self) -> tuple[Any, Any]:
        """Return the buffers of `offsets` and `targets`."""
        offsets: Any = np.ascontiguousarray(self.offsets, np.int32).data
        targets: Any = np.ascontiguousarray(self.targets, np.int32).data
        return offsets, targets

    @property
    def axes(self) -> FloatArray:
        """The x and the y of all nodes, (2, nodes), each contiguous."""
        if self._axes is None:
            self._axes = copy_locked(self.columns.xy.T)
        return self._axes

    @cached_property
    def _narrow(self) -> tuple[RowArray, int, RowArray, RowArray]:
        """A compact form: counts, the width of rows of steps, these steps, and their offsets.

        A step is the difference between the row of a target and the row of the node. The width is 0 if rows would waste
        memory; then the offsets are used.
        """
        # NOTE: most of a turn of many agents is reading this from all over the map: counts take a byte or two, steps
        # two where they fit, and no offsets are read where rows are about as long as each other (benchmarks: teams).
        nodes = len(self.counts)
        most = int(self.counts.max(initial=1))
        steps = self.targets - np.repeat(np.arange(nodes), self.counts)
        offsets = self.offsets.astype(np.int32)
        steps = steps.astype(np.int16 if np.abs(steps).max(initial=0) < 1 << 15 else np.int32)
        is_even = nodes * most <= 2 * len(steps)
        if is_even:
            places = np.repeat(np.arange(nodes, dtype=np.int32) * np.int32(most) - offsets[:-1], self.counts)
            places += np.arange(len(steps), dtype=np.int32)
            rows = np.zeros(nodes * most, steps.dtype)
            rows[places] = steps
            steps = rows
        return self.counts.astype(np.min_scalar_type(most)), most if is_even else 0, steps, offsets

    def count_legal(self, rows: IntArray) -> RowArray:
        """Return the numbers of legal nodes of nodes, in the smallest integer type that fits."""
        return self._narrow[0].take(rows)

    @property
    def legal(self) -> IntArray:
        """The legal nodes of each node, (nodes, most), padded with the node itself."""
        if self._padded is None:
            most = int(self.counts.max(initial=1))
            columns = np.minimum(np.arange(most), self.counts[:, None] - 1)
            padded = self.targets[self.offsets[:-1, None] + columns]
            is_legal = np.arange(most) < self.counts[:, None]
            self._padded = copy_locked(np.where(is_legal, padded, np.arange(len(padded))[:, None]))
        return self._padded

    def get_legal(self, rows: IntArray) -> tuple[IntArray, IntArray]:
        """Return the legal nodes of several nodes: offsets (nodes + 1,) and rows."""
        places, ends = kernels.select_runs(self.offsets, rows)
        return ends, self.targets[places]

    def step(self, rows: IntArray, actions: IntArray) -> IntArray:
        """Return the rows of the nodes that actions lead to; an action is the number of a legal node.

        Raises:
            BadType, BadValue: `rows` or `actions` are invalid, or do not broadcast to one shape.
        """
        here, chosen = as_one_shape(
            {"rows": self.check_rows(rows, "rows"), "actions": as_array(actions, "actions", "integers")}
        )
        counts = self.count_legal(here)
        is_wrong = (chosen < 0) | (chosen >= counts)
        if is_wrong.any():
            raise BadValue(
                f"actions: from node {self.ids(here[is_wrong])[0]} there is no action {chosen[is_wrong][0]}, only 0 to "
                f"{counts[is_wrong][0] - 1}."
            )
        return self.find_ends(here, chosen)

    def find_ends(self, rows: IntArray, actions: IntArray) -> IntArray:
        """Return the rows of the nodes that actions lead to, without checks."""
        _, width, steps, offsets = self._narrow
        # NOTE: in place: to make another array is a twentieth of a turn of 100,000 agents (benchmarks: teams).
        places: IntArray = np.empty(np.broadcast(rows, actions).shape, np.int64)
        if width:
            np.multiply(rows, width, out=places, dtype=np.int64)
        else:
            places[...] = offsets[rows]
        np.add(places, actions, out=places, casting="unsafe")
        return rows + steps.take(places, mode="clip")

    def action_to(self, rows: IntArray, targets: IntArray) -> IntArray:
        """Return the action that leads to a target, by rows; -1 if the target is not legal.

        Raises:
            BadType, BadValue: `rows` are not rows of nodes, or `targets` are not integers.
        """
        rows = self.check_rows(rows, "rows")
        targets = as_array(targets, "targets", "integers")
        matches = self.legal[rows] == targets[..., None]
        matches &= np.arange(matches.shape[-1]) < self.counts[rows][..., None]
        return np.where(matches.any(axis=-1), matches.argmax(axis=-1), -1)


class LegalNodes:
    """The legal nodes of several agents, in the order of `state["legal"]`: their own node first.

    Args:
        offsets, targets: (agents + 1,), (legal,) ids: the legal nodes of agent `i` are `targets[offsets[i]:offsets[i +
            1]]`.
    """

    def __init__(self, offsets: IntArray, targets: IntArray) -> None:
        self._streets: StreetGraph | None = None
        self._rows = np.arange(len(offsets) - 1)
        self.ragged = offsets, targets

    @classmethod
    def from_streets(cls, streets: StreetGraph, nodes: IntArray) -> "LegalNodes":
        """Return the legal nodes of agents that move along one edge, from the ids of their nodes, (agents,)."""
        legal = cls.__new__(cls)
        legal._streets = streets
        legal._rows = streets.rows(nodes)
        return legal

    @cached_property
    def ragged(self) -> tuple[IntArray, IntArray]:
        """Offsets and targets; read-only."""
        streets: Any = self._streets
        offsets, rows = streets.get_legal(self._rows)
        return copy_locked(offsets), copy_locked(streets.ids(rows))

    @cached_property
    def counts(self) -> RowArray:
        """The number of legal nodes of each agent, (agents,)."""
        found: RowArray = np.diff(self.ragged[0]) if self._streets is None else self._streets.count_legal(self._rows)
        return copy_locked(found.astype(np.int32))

    def step(self, actions: IntArray) -> IntArray:
        """Return the ids of the nodes that actions lead to; an action is the number of a legal node."""
        if self._streets is None:
            ends, nodes = self.ragged
            chosen: IntArray = nodes[ends[:-1] + actions]
            return chosen
        return self._streets.get_ids(self._streets.find_ends(self._rows, actions))


def as_table(at: IntArray, ids: IntArray, rows: int) -> IntArray:
    """Return ids as a table with a row for each agent, (rows, most), ascending, padded with -1.

    Args:
        at: (ids,) the row of each id.
        ids: the ids.
        rows: the number of rows.
    """
    order = np.lexsort((ids, at))
    counts = np.bincount(at, minlength=rows)
    first = np.cumsum(counts) - counts
    found = np.full((rows, int(counts.max(initial=0))), -1)
    found[at[order], np.arange(len(at)) - first[at[order]]] = ids[order]
    return found
