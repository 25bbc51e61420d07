"""Where agents may go along one edge, in arrays: the streets of a map that many agents or games share."""

from copy import copy
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from gamms import kernels
from gamms.arguments import as_array, as_numbers_of, as_one_shape
from gamms.core import moves
from gamms.errors import BadValue, UnknownName
from gamms.ir.graph import FloatArray, GraphColumns, IntArray, RowArray
from gamms.readonly import locked


class Ways(Protocol):
    """What `ctx.graph.routes` says of the edges of a map."""

    def arcs(self, weight: str | None = "length", *, reverse: bool = False) -> kernels.Arcs:
        """Return the edges with their weights as compressed sparse rows, or reversed ones; parallel ones are one."""

    def weights(self, weight: str | None) -> FloatArray:
        """Return what each edge costs, (edges,)."""

    def neighborhoods(self) -> tuple[IntArray, IntArray]:
        """Return the nodes that each node has an edge to, itself first, as offsets (nodes + 1,) and rows."""


class Streets:
    """The nodes of a graph, and where an agent may go from each along one edge.

    Args:
        columns: of the graph.
        queries: `ctx.graph.routes`.

    Attributes:
        columns: of the graph.
        num_nodes: how many nodes there are.
        counts: (nodes,) how many nodes are legal from each, its own included.
        offsets: (nodes + 1,) those of node `i` are `targets[offsets[i]:offsets[i + 1]]`.
        targets: rows of nodes; of each node its own first, then its neighbours in the order of `state["legal"]`.
    """

    def __init__(self, columns: GraphColumns, queries: Ways) -> None:
        self.columns, self._queries, self.num_nodes = columns, queries, len(columns.node_ids)
        self.offsets, self.targets = map(locked, queries.neighborhoods())
        self.counts: IntArray = locked(np.diff(self.offsets))
        self._ids_are_rows = bool((columns.node_ids == np.arange(len(columns.node_ids))).all())
        self._order = None if self._ids_are_rows else np.argsort(columns.node_ids, kind="stable")
        self._padded: IntArray | None = None
        self._axes: FloatArray | None = None

    def ways(self, weight: str | None) -> kernels.Arcs:
        """Return the edges with their weights."""
        return self._queries.arcs(weight)

    def ways_to(self, weight: str | None) -> kernels.Arcs:
        """Return the edges with their weights, reversed: paths along them are found from their ends."""
        return self._queries.arcs(weight, reverse=True)

    def weights(self, weight: str | None) -> FloatArray:
        """Return what each edge costs, (edges,)."""
        return self._queries.weights(weight)

    def apart(self) -> "Streets":
        """Return the same for what is kept longer than the graph, which it does not keep in memory."""
        twin = copy(self)
        del twin._queries
        return twin

    def ids(self, rows: IntArray) -> IntArray:
        """Return the ids of nodes.

        Raises:
            BadType, BadValue: they are no rows of nodes.
        """
        return self.ids_of(self.checked(rows, "rows"))

    def ids_of(self, rows: IntArray) -> IntArray:
        """Return what `ids` does, of rows that are known to be such."""
        return rows if self._ids_are_rows else self.columns.node_ids[rows]

    def rows(self, ids: Any) -> IntArray:
        """Return the rows of nodes.

        Raises:
            BadType: they are no integers.
            UnknownName (KeyError): one is not on the map.
        """
        wanted, known = as_array(ids, "ids of nodes", "integers").astype(np.int64, copy=False), self.columns.node_ids
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

    def checked(self, rows: object, name: str) -> IntArray:
        """Return rows of nodes that a caller passed; `streets.rows(ids)` gives them.

        Raises:
            BadType, BadValue: they are no integers, or one is not the row of a node.
        """
        return as_numbers_of(rows, name, self.num_nodes, "nodes")

    @cached_property
    def core(self) -> moves.Streets:
        """The same as the core takes them."""
        return moves.Streets(*self._memory())

    @cached_property
    def core_with_all_legal(self) -> moves.Streets:
        """The same as the core takes them where agents may go to any node."""
        return moves.Streets(*self._memory(), are_all_legal=True)

    def _memory(self) -> tuple[Any, Any]:
        """Return the memory of `offsets` and `targets`."""
        offsets: Any = np.ascontiguousarray(self.offsets, np.int32).data
        targets: Any = np.ascontiguousarray(self.targets, np.int32).data
        return offsets, targets

    @property
    def axes(self) -> FloatArray:
        """The x and the y of all nodes, (2, nodes), each in one piece."""
        if self._axes is None:
            self._axes = locked(self.columns.xy.T)
        return self._axes

    @cached_property
    def _narrow(self) -> tuple[RowArray, int, RowArray, RowArray]:
        """Counts, the width of rows of steps, these steps, and their offsets where there are no rows: width 0.

        A step is by how much the row of a target is larger than that of the node.
        """
        # NOTE: most of a turn of many agents is reading this from all over the map: counts take a byte or two, steps
        # two where they fit, and no offsets are read where rows are about as long as each other (benchmarks: teams).
        nodes, most = len(self.counts), int(self.counts.max(initial=1))
        steps, offsets = self.targets - np.repeat(np.arange(nodes), self.counts), self.offsets.astype(np.int32)
        steps = steps.astype(np.int16 if np.abs(steps).max(initial=0) < 1 << 15 else np.int32)
        is_even = nodes * most <= 2 * len(steps)
        if is_even:
            places = np.repeat(np.arange(nodes, dtype=np.int32) * np.int32(most) - offsets[:-1], self.counts)
            places += np.arange(len(steps), dtype=np.int32)
            rows = np.zeros(nodes * most, steps.dtype)
            rows[places] = steps
            steps = rows
        return self.counts.astype(np.min_scalar_type(most)), most if is_even else 0, steps, offsets

    def counts_of(self, rows: IntArray) -> RowArray:
        """Return how many nodes are legal from each of some nodes, in as few bytes as that fits into."""
        return self._narrow[0].take(rows)

    @property
    def legal(self) -> IntArray:
        """The rows of the legal nodes of each node, (nodes, most), behind the last one its own again."""
        if self._padded is None:
            most = int(self.counts.max(initial=1))
            columns = np.minimum(np.arange(most), self.counts[:, None] - 1)
            padded = self.targets[self.offsets[:-1, None] + columns]
            is_legal = np.arange(most) < self.counts[:, None]
            self._padded = locked(np.where(is_legal, padded, np.arange(len(padded))[:, None]))
        return self._padded

    def legal_of(self, rows: IntArray) -> tuple[IntArray, IntArray]:
        """Return the legal nodes from some nodes as offsets (nodes + 1,) and rows, one after the other."""
        places, ends = kernels.chosen_runs(self.offsets, rows)
        return ends, self.targets[places]

    def step(self, rows: IntArray, actions: IntArray) -> IntArray:
        """Return where actions lead, each the number of a legal node.

        Raises:
            BadType, BadValue: they are no rows of nodes or no such numbers, or do not broadcast to one shape.
        """
        here, chosen = as_one_shape(
            {"rows": self.checked(rows, "rows"), "actions": as_array(actions, "actions", "integers")}
        )
        counts = self.counts_of(here)
        is_wrong = (chosen < 0) | (chosen >= counts)
        if is_wrong.any():
            raise BadValue(
                f"actions: from node {self.ids(here[is_wrong])[0]} there is no action {chosen[is_wrong][0]}, only 0 to "
                f"{counts[is_wrong][0] - 1}."
            )
        return self.ends_of(here, chosen)

    def ends_of(self, rows: IntArray, actions: IntArray) -> IntArray:
        """Return what `step` does, of actions that are known to be legal."""
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
        """Return the number of a legal node, by rows; -1 where it is not legal.

        Raises:
            BadType, BadValue: `rows` are no rows of nodes, or `targets` no integers.
        """
        rows, targets = self.checked(rows, "rows"), as_array(targets, "targets", "integers")
        matches = self.legal[rows] == targets[..., None]
        matches &= np.arange(matches.shape[-1]) < self.counts[rows][..., None]
        return np.where(matches.any(axis=-1), matches.argmax(axis=-1), -1)


class LegalNodes:
    """The legal nodes of some agents: their own first, then others, as `state["legal"]` has them.

    Args:
        offsets, targets: (agents + 1,), (legal,) ids: agent `i` may go to `targets[offsets[i]:offsets[i + 1]]`.
    """

    def __init__(self, offsets: IntArray, targets: IntArray) -> None:
        self._streets: Streets | None = None
        self._rows = np.arange(len(offsets) - 1)
        self.ragged = offsets, targets

    @classmethod
    def along_streets(cls, streets: Streets, nodes: IntArray) -> "LegalNodes":
        """Return those of agents that go along one edge, by the ids of their nodes, (agents,)."""
        legal = cls.__new__(cls)
        legal._streets, legal._rows = streets, streets.rows(nodes)
        return legal

    @cached_property
    def ragged(self) -> tuple[IntArray, IntArray]:
        """Offsets and targets, as above; not to be written to."""
        streets: Any = self._streets
        offsets, rows = streets.legal_of(self._rows)
        return locked(offsets), locked(streets.ids(rows))

    @cached_property
    def counts(self) -> RowArray:
        """How many there are for each agent, (agents,)."""
        found: RowArray = np.diff(self.ragged[0]) if self._streets is None else self._streets.counts_of(self._rows)
        return locked(found.astype(np.int32))

    def step(self, actions: IntArray) -> IntArray:
        """Return the ids of nodes that actions lead to, each the number of a legal node."""
        if self._streets is None:
            ends, nodes = self.ragged
            chosen: IntArray = nodes[ends[:-1] + actions]
            return chosen
        return self._streets.ids_of(self._streets.ends_of(self._rows, actions))
