"""Distances and steps to many targets for many agents at once: tables of one graph, computed as they are asked for."""

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

_MOST_BYTES = 512 * 2**20  # of the tables of one graph, and of those of other graphs that are kept beside them
_BYTES = 12  # of a node in a table
_AT_ONCE = 1 << 20  # nodes and edges that are searched at once, in all


_lock = RLock()  # one batch at a time reads and extends tables
_shared: OrderedDict[bytes, "RouteTable"] = OrderedDict()  # by the graph and the weight; what was used last is last


def shared_routes(streets: StreetGraph, weight: str | None) -> "RouteTable":
    """Return the tables of a graph, which all batches on equal streets with equal weights share."""
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
    """How far it is to targets, and which action leads there: what strategies ask of `ctx.graph`, for arrays.

    A target gets a table, of how far it is from all nodes and which action leads on, when it is first asked for: 12
    bytes for each node of the map. When the tables are larger than 512 MB together, they are made again as they are
    asked for.

    Args:
        streets: the nodes, and which of them are legal from where.
        weight: of the edges, see `IGraph`.
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
        self._leaps = _has_triangle(streets)  # from here, a legal node may come later on the way than the next one
        self._entries: tuple[IntArray, IntArray, IntArray] | None = None

    @property
    def nbytes(self) -> int:
        """How much memory the tables take that there are."""
        return self._count * _BYTES * len(self._table_of)

    def distances(self, sources: IntArray, targets: IntArray) -> FloatArray:
        """Return how far it is from nodes to others, as `graph.distance` does; rows that broadcast to one shape.

        Args:
            sources: rows of nodes, as `view.streets.rows(ids)` gives them.
            targets: rows of nodes.

        Raises:
            BadType, BadValue: they are no rows of nodes, or do not broadcast to one shape.
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
        """Return the actions that lead to targets, as strategies go a step: to the target itself where it is legal.

        Args:
            sources: rows of nodes.
            targets: rows, likewise; both broadcast to one shape.
            allowed: (nodes,) which may be entered, the targets among them; None: all. Where the next one is not, the
                action is to stay.

        Returns:
            Numbers of legal nodes; -1 where there is no path.

        Raises:
            BadType, BadValue: they are no rows of nodes, or do not broadcast to one shape.
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
        """Return rows of nodes that a caller passed, of one shape."""
        checked = self._streets.checked
        return as_one_shape({"sources": checked(sources, "sources"), "targets": checked(targets, "targets")})

    def following(self, sources: IntArray, targets: IntArray) -> IntArray:
        """Return the row of the next node on the shortest path, (queries,); where there is none, the source."""
        found = np.empty(len(sources), np.int64)
        for some in self._ready(targets):
            starts = sources[some]
            hops = self._next(starts, targets[some])
            found[some] = self._streets.ends_of(starts, np.maximum(hops, 0))
        return found

    def _next(self, starts: IntArray, ends: IntArray) -> IntArray:
        """Return the action that leads to the next node on the way, 0 at the target; -1: there is no path."""
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
            while going.any():  # on, as long as the next node on the way is legal, too
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
        """Yield places in `ends` whose tables are there: all in one go, if they fit."""
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
        """Compute the tables that are missing; where there are too many with these, without those of before."""
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
        """Have memory for so many tables."""
        if tables <= len(self._far):
            return
        more = min(self._most, 2 * tables) - len(self._far)
        nodes = len(self._table_of)
        self._far = np.concatenate((self._far, np.empty((more, nodes))))
        self._hops = np.concatenate((self._hops, np.empty((more, nodes), np.int32)))

    def _mark_detours(self, targets: IntArray) -> None:
        """Note from which nodes an edge to a target is not the shortest way there."""
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
        """Return the entries of `streets.targets` by the node that they lead to, and the node that each leads from."""
        if self._entries is None:
            streets = self._streets
            sources = np.repeat(np.arange(len(streets.counts)), streets.counts)
            self._entries = *kernels.group_rows(streets.targets, len(streets.counts)), sources
        return self._entries


def _has_triangle(streets: StreetGraph) -> BoolArray:
    """Return from which nodes two edges lead to nodes of which one is a neighbour of the other, (nodes,)."""
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
