"""Distances and actions toward targets for many agents at once, from tables that are computed on demand."""

from collections import OrderedDict
from collections.abc import Iterator
from hashlib import blake2b
from threading import RLock
from typing import Any

import numpy as np

from gamms import kernels
from gamms.arguments import as_array, as_one_shape
from gamms.game.streets import StreetGraph
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray

_MOST_BYTES = 512 * 2**20  # of the tables of one graph, and of the other graphs' tables in the cache
_BYTES = 12  # of a node in a table
_AT_ONCE = 1 << 20  # nodes and edges that one call searches, summed over its targets


_lock = RLock()  # one batch at a time reads and extends tables
_shared: OrderedDict[bytes, "RouteTable"] = OrderedDict()  # by hash of graph and weight; most recently used last


def shared_routes(streets: StreetGraph, weight: str | None) -> "RouteTable":
    """Return the tables of a graph; batches on equal graphs with equal weights share them."""
    arcs = streets.ways_to(weight)
    parts = (streets.columns.node_ids, streets.offsets, streets.targets, *arcs)
    key = blake2b(b"".join(blake2b(part.tobytes()).digest() for part in parts)).digest()
    with _lock:
        found = _shared.pop(key, None) or RouteTable(streets, weight)
        left = _MOST_BYTES
        for other in reversed([*_shared]):
            left -= _shared[other].nbytes
            if left < 0:
                del _shared[other]
        _shared[key] = found
    return found


class RouteTable:
    """Distances to targets and actions that lead there, for arrays of agents.

    The first query of a target computes a table with the distance and the next action from every node, 12 bytes for
    each node of the map. When the tables of a graph would exceed 512 MB, they are dropped and computed again on demand.

    Args:
        streets: the nodes and their legal nodes.
        weight: the edge weight, see `IGraph`.
    """

    def __init__(self, streets: StreetGraph, weight: str | None) -> None:
        self._streets = streets.apart()
        self._arcs = streets.ways_to(weight)
        nodes = len(streets.counts)
        sources = np.repeat(np.arange(nodes), np.diff(self._arcs.offsets))
        self._action_of = np.append(streets.action_to(self._arcs.ends, sources), 0)  # the last one: at the target
        self._most = max(1, min(nodes, _MOST_BYTES // (_BYTES * max(nodes, 1))))  # tables
        self._table_of = np.full(nodes, -1, np.int64)  # by target
        self._count = 0  # of tables
        self._far = np.empty((0, nodes))
        self._hops = np.empty((0, nodes), np.int32)
        self._leaps = _has_triangle(streets)  # a legal node of these nodes may come later on a path than the next one
        self._entries: tuple[IntArray, IntArray, IntArray] | None = None

    @property
    def nbytes(self) -> int:
        """The memory of the computed tables, bytes."""
        return self._count * _BYTES * len(self._table_of)

    def distances(self, sources: IntArray, targets: IntArray) -> FloatArray:
        """Return the distances from sources to targets, as `graph.distance` does.

        Args:
            sources: rows of nodes, as `view.streets.rows(ids)` returns them.
            targets: rows of nodes; both arrays broadcast to one shape.

        Raises:
            BadType, BadValue: the arrays are not rows of nodes, or do not broadcast to one shape.
        """
        sources, targets = self._checked(sources, targets)
        found = np.empty(sources.shape)
        flat, starts, ends = found.reshape(-1), sources.reshape(-1), targets.reshape(-1)
        with _lock:
            for some in self._ready(ends):
                flat[some] = self._far[self._table_of[ends[some]], starts[some]]
        return found

    def actions(
        self,
        sources: IntArray,
        targets: IntArray,
        allowed: BoolArray | None = None,
    ) -> IntArray:
        """Return the actions that lead toward targets along shortest paths.

        An action goes to the last node of the path that is legal in one move and that a chain of legal nodes leads to;
        to the target itself, if it is legal.

        Args:
            sources: rows of nodes.
            targets: rows of nodes; both arrays broadcast to one shape.
            allowed: (nodes,) the nodes that may be entered; None: all. The action is to stay where the next node of
                the path, or a target in one move, is not allowed.

        Returns:
            Indices of legal nodes; -1 without a path.

        Raises:
            BadType, BadValue: the arrays are not rows of nodes, or do not broadcast to one shape.
        """
        sources, targets = self._checked(sources, targets)
        if allowed is not None:
            allowed = as_array(allowed, "allowed", "booleans", (len(self._streets.counts),))
        found = np.empty(sources.shape, np.int64)
        flat, starts, ends = found.reshape(-1), sources.reshape(-1), targets.reshape(-1)
        with _lock:
            for some in self._ready(ends):
                flat[some] = self._steps(starts[some], ends[some], allowed)
        return found

    def _checked(self, sources: object, targets: object) -> list[IntArray]:
        """Return the rows of nodes that a caller passed, broadcast to one shape."""
        checked = self._streets.checked
        return as_one_shape({"sources": checked(sources, "sources"), "targets": checked(targets, "targets")})

    def following(self, sources: IntArray, targets: IntArray) -> IntArray:
        """Return the rows of the next nodes on the shortest paths, (queries,); the source itself without a path."""
        found = np.empty(len(sources), np.int64)
        for some in self._ready(targets):
            starts = sources[some]
            hops = self._next(starts, targets[some])
            found[some] = self._streets.ends_of(starts, np.maximum(hops, 0))
        return found

    def _next(self, starts: IntArray, ends: IntArray) -> IntArray:
        """Return the action that leads to the next node of the path, 0 at the target; -1 without a path."""
        return self._hops[self._table_of[ends], starts].astype(np.int64)

    def _steps(self, starts: IntArray, ends: IntArray, allowed: BoolArray | None) -> IntArray:
        streets = self._streets
        hops = self._next(starts, ends)
        has_path = hops >= 0
        actions = np.maximum(hops, 0)
        leaping = np.flatnonzero(self._leaps[starts])
        if len(leaping):
            here, goal = starts[leaping], ends[leaping]
            reached = actions[leaping]
            at, going = streets.ends_of(here, reached), has_path[leaping] & (reached > 0)
            while going.any():  # follow the path as long as its next node is legal
                on = streets.ends_of(at, np.where(going, self._next(at, goal), 0))
                action = streets.action_to(here, on)
                going &= (action >= 0) & (at != goal)
                if allowed is not None:
                    going &= allowed[at] & allowed[on]
                reached, at = np.where(going, action, reached), np.where(going, on, at)
            direct = streets.action_to(here, goal)
            actions[leaping] = np.where(direct >= 0, direct, reached)
            has_path[leaping] |= direct >= 0
        if allowed is not None:
            actions[~allowed[streets.ends_of(starts, actions)]] = 0
        return np.where(has_path, actions, -1)

    # -- tables -------------------------------------------------------------------------------------------------

    def _ready(self, ends: IntArray) -> Iterator[Any]:
        """Yield indices into `ends` after computing their tables; one slice of all if the tables fit."""
        targets = np.unique(ends)
        if len(targets) <= self._most:
            self._fill(targets)
            yield slice(None)
            return
        for first in range(0, len(targets), self._most):
            some = targets[first : first + self._most]
            self._fill(some)
            yield np.flatnonzero((ends >= some[0]) & (ends <= some[-1]))

    def _fill(self, targets: IntArray) -> None:
        """Compute the missing tables of targets; drop all others if the total would exceed the limit."""
        new = targets[self._table_of[targets] < 0]
        if self._count + len(new) > self._most:
            self._table_of[:] = -1
            self._count = 0
            new = targets
        self._make_room(self._count + len(new))
        nodes = len(self._table_of)
        size = max(1, _AT_ONCE // (nodes + len(self._arcs.ends)))
        for first in range(0, len(new), size):
            some = new[first : first + size]
            lines, rows, far, last, _ = kernels.route_trees(self._arcs, some, self._streets.columns.node_ids)
            tables = slice(self._count, self._count + len(some))
            self._far[tables] = np.inf
            self._hops[tables] = -1
            self._far[lines + self._count, rows] = far
            self._hops[lines + self._count, rows] = self._action_of[last]
            self._table_of[some] = np.arange(self._count, self._count + len(some))
            self._count += len(some)
            self._mark_detours(some)

    def _make_room(self, tables: int) -> None:
        """Allocate memory for a number of tables."""
        if tables <= len(self._far):
            return
        more = min(self._most, 2 * tables) - len(self._far)
        nodes = len(self._table_of)
        self._far = np.concatenate((self._far, np.empty((more, nodes))))
        self._hops = np.concatenate((self._hops, np.empty((more, nodes), np.int32)))

    def _mark_detours(self, targets: IntArray) -> None:
        """Mark the nodes from which an edge to one of the targets is not the shortest path."""
        offsets, order, sources = self._into()
        entries, ends = kernels.chosen_runs(offsets, targets)
        rows = sources[order[entries]]
        lines = np.repeat(np.arange(len(targets)), np.diff(ends))
        goals = targets[lines]
        hops = self._next(rows, goals)
        leads_on = self._streets.ends_of(rows, np.maximum(hops, 0)) != goals
        is_detour = (leads_on | (hops < 0)) & (rows != goals)
        self._leaps[rows[is_detour]] = True

    def _into(self) -> tuple[IntArray, IntArray, IntArray]:
        """Return the entries of `streets.targets` grouped by target node, and the source node of each entry."""
        if self._entries is None:
            streets = self._streets
            sources = np.repeat(np.arange(len(streets.counts)), streets.counts)
            self._entries = *kernels.group_rows(streets.targets, len(streets.counts)), sources
        return self._entries


def _has_triangle(streets: StreetGraph) -> BoolArray:
    """Return a mask of the nodes with two neighbors that are joined by an edge, (nodes,)."""
    nodes = len(streets.counts)
    sources = np.repeat(np.arange(nodes), streets.counts)
    is_edge = sources != streets.targets
    starts, ends = sources[is_edge], streets.targets[is_edge]
    keys = np.sort(starts * nodes + ends)
    entries, runs = kernels.chosen_runs(streets.offsets, ends)
    first, second = np.repeat(starts, np.diff(runs)), streets.targets[entries]
    among = np.repeat(ends, np.diff(runs))
    is_there = kernels.rows_of(keys, first * nodes + second) >= 0
    found = np.zeros(nodes, np.bool_)
    found[first[is_there & (second != among)]] = True
    return found
