"""Distances and steps to many targets for many agents at once: tables of one graph, computed as they are asked for."""

from collections import OrderedDict
from collections.abc import Iterator
from hashlib import blake2b
from threading import RLock
from typing import Any

import numpy as np

from gamms import kernels
from gamms.arguments import as_array, as_one_shape
from gamms.game.streets import Streets
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray

_MOST_BYTES = 512 * 2**20  # of the tables of one graph, and of those of other graphs that are kept beside them
_AT_ONCE = 1 << 20  # nodes and edges that are searched at once, in all
_DETOURS = (1.5, 3.0, 8.0, np.inf)  # how long ways are that are looked for first, then, and last, in straight lines
_MARGIN = 1.1  # how much farther a table is made for than is asked, because others ask from a little farther away
_SHORT = 0xFFFF  # nodes that have numbers of two bytes, without the last
_MANY = 255  # actions that have numbers of one byte, without the last


_lock = RLock()  # one batch at a time reads and extends tables
_shared: OrderedDict[bytes, "RouteTable"] = OrderedDict()  # by the graph and the weight; what was used last is last


def shared_routes(streets: Streets, weight: str | None) -> "RouteTable":
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

    A target gets a table when it is first asked for: of the nodes around it, and of more of the map once one farther
    away asks: 9 bytes for each of these, and 2 or 4 for each node of the map. As long as distances alone are asked for,
    a table has no nodes that are farther in a straight line than those that asked; else it has all on the ways, too.
    When the tables are larger than 512 MB together, they are made again as they are asked for.

    Args:
        streets: the nodes, and which of them are legal from where.
        weight: of the edges, see `IGraph`.
    """

    def __init__(self, streets: Streets, weight: str | None) -> None:
        self._streets, self._arcs = streets.apart(), streets.ways_to(weight)
        sources = np.repeat(np.arange(len(streets.counts)), np.diff(self._arcs.offsets))
        x, y = streets.axes
        straight = np.hypot(x[self._arcs.ends] - x[sources], y[self._arcs.ends] - y[sources]).sum()
        self._slope = float(self._arcs.weights.sum() / straight) if straight > 0.0 else 1.0  # of ways, on average
        self._action_of = np.append(streets.action_to(self._arcs.ends, sources), 0)  # the last one: at the target
        nodes, most = len(streets.counts), int(streets.counts.max(initial=1))
        narrow = np.dtype(np.uint16 if nodes < _SHORT else np.int32)
        tables = min(nodes, max(1, _MOST_BYTES // 2 // (max(nodes, 1) * narrow.itemsize)))
        times = len(_DETOURS)  # that a table may be computed, each time for more of the map
        values = max(_MOST_BYTES // 2 // 9, times * nodes + 1)
        self._most = max(1, min(tables, (values - 1) // max(times * nodes, 1)))  # tables that fit for certain
        # Memory is taken for what is written alone. Of each table and node the number of its values, from its first:
        self._ranks = np.empty((tables, nodes), narrow)
        self._unknown = _SHORT if nodes < _SHORT else -1
        self._first, self._sizes = np.zeros((2, tables), np.int64)
        self._tables, self._used = 0, 1
        self._has_hops = np.zeros(tables, np.bool_)  # which tables say where the ways lead
        self._table_of, self._level = np.full(nodes, -1, np.int64), np.full(nodes, -1, np.int64)  # by target
        self._span = np.zeros(nodes)  # by target: how far away, in a straight line, those are that its table is for
        self._has_ways, self._is_asked_for_ways = np.zeros(nodes, np.bool_), False  # which tables are not only for them
        self._far, self._hops = np.empty(values), np.empty(values, np.uint8 if most < _MANY else np.int32)
        self._none = _MANY if most < _MANY else -1  # stands for no path
        self._far[0], self._hops[0] = np.inf, self._none
        self._leaps = _has_triangle(streets)  # from here, a legal node may come later on the way than the next one
        self._entries: tuple[IntArray, IntArray, IntArray] | None = None

    @property
    def nbytes(self) -> int:
        """How much memory the tables take that there are."""
        per_value, per_table = self._far.itemsize + self._hops.itemsize, self._ranks[:1].nbytes
        return self._used * per_value + self._tables * per_table

    def distances(
        self,
        sources: IntArray,
        targets: IntArray,
        *,
        at: IntArray | None = None,  # noqa: ARG002 - for maps that differ
    ) -> FloatArray:
        """Return how far it is from nodes to others, as `graph.distance` does; rows that broadcast to one shape.

        Args:
            sources: rows of nodes, as `view.streets.rows(ids)` gives them.
            targets: rows of nodes.
            at: the games, by their places in the view; None: all have the same roads.

        Raises:
            BadType, BadValue: they are no rows of nodes, or do not broadcast to one shape.
        """
        sources, targets = self._checked(sources, targets)
        found = np.empty(sources.shape)
        flat, starts, ends = found.reshape(-1), sources.reshape(-1), targets.reshape(-1)
        with _lock:
            for some in self._ready(starts, ends, with_hops=False):
                flat[some] = self._far[self._values(starts[some], ends[some])]
        return found

    def actions(
        self,
        sources: IntArray,
        targets: IntArray,
        allowed: BoolArray | None = None,
        *,
        at: IntArray | None = None,  # noqa: ARG002 - for maps that differ
    ) -> IntArray:
        """Return the actions that lead to targets, as strategies go a step: to the target itself where it is legal.

        Args:
            sources: rows of nodes.
            targets: rows, likewise; both broadcast to one shape.
            allowed: (nodes,) which may be entered, the targets among them; None: all. Where the next one is not, the
                action is to stay.
            at: see `distances`.

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
            for some in self._ready(starts, ends):
                flat[some] = self._steps(starts[some], ends[some], allowed)
        return found

    def _checked(self, sources: object, targets: object) -> list[IntArray]:
        """Return rows of nodes that a caller passed, of one shape."""
        checked = self._streets.checked
        return as_one_shape({"sources": checked(sources, "sources"), "targets": checked(targets, "targets")})

    def following(
        self,
        sources: IntArray,
        targets: IntArray,
        *,
        at: IntArray | None = None,  # noqa: ARG002 - for maps that differ
    ) -> IntArray:
        """Return the row of the next node on the shortest path, (queries,); where there is none, the source."""
        found = np.empty(len(sources), np.int64)
        for some in self._ready(sources, targets):
            starts = sources[some]
            hops = self._hops[self._values(starts, targets[some])]
            found[some] = self._streets.ends_of(starts, np.where(hops == self._none, 0, hops).astype(np.int64))
        return found

    def _steps(self, starts: IntArray, ends: IntArray, allowed: BoolArray | None) -> IntArray:
        streets = self._streets
        hops = self._hops[self._values(starts, ends)]
        has_path = hops != self._none
        actions: IntArray = np.where(has_path, hops, 0).astype(np.int64)
        leaping = np.flatnonzero(self._leaps[starts])
        if len(leaping):
            here, goal = starts[leaping], ends[leaping]
            reached = actions[leaping]
            at, going = streets.ends_of(here, reached), has_path[leaping] & (reached > 0)
            while going.any():  # on, as long as the next node on the way is legal, too
                on = streets.ends_of(at, np.where(going, self._hops[self._values(at, goal)], 0))
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

    # -- for maps on which some of the roads are closed --------------------------------------------------------------

    @property
    def arcs(self) -> kernels.Arcs:
        """The edges with their weights, reversed."""
        return self._arcs

    def ready(self, starts: IntArray, ends: IntArray) -> Iterator[Any]:
        """Yield places of queries of which `values` and `around` know all nodes on the ways."""
        with _lock:
            yield from self._ready(starts, ends)

    def values(self, starts: IntArray, ends: IntArray) -> tuple[FloatArray, IntArray]:
        """Return how far it is, infinite where that is not known, and the rows of the nodes that come next."""
        values = self._values(starts, ends)
        hops = self._hops[values]
        return self._far[values], self._streets.ends_of(starts, np.where(hops == self._none, 0, hops).astype(np.int64))

    def around(self, targets: IntArray) -> tuple[IntArray, IntArray, FloatArray, BoolArray]:
        """Return the nodes from which it is known how far some targets are.

        Returns:
            The places in `targets`, ascending, rows of nodes, ascending, how far it is, and (targets,) of which
            all are known.
        """
        tables = self._table_of[targets]
        lines, rows = np.nonzero(self._ranks[tables] != self._unknown)
        far = self._far[self._first[tables][lines] + self._ranks[tables[lines], rows]]
        return lines, rows, far, self._level[targets] == len(_DETOURS) - 1

    # -- tables -------------------------------------------------------------------------------------------------

    def _ready(self, starts: IntArray, ends: IntArray, *, with_hops: bool = True) -> Iterator[Any]:
        """Yield places in `starts` whose tables are there: all in one go, if they fit."""
        if self._fill(starts, ends, with_hops=with_hops):
            yield slice(None)
            return
        order = np.argsort(ends, kind="stable")
        ordered, targets = ends[order], np.unique(ends)
        for first in range(0, len(targets), self._most):
            last = targets[min(first + self._most, len(targets)) - 1]
            some = order[np.searchsorted(ordered, targets[first]) : np.searchsorted(ordered, last, side="right")]
            while not self._fill(starts[some], ends[some], with_hops=with_hops):  # it starts again with no tables
                pass
            yield some

    def _values(self, starts: IntArray, ends: IntArray) -> IntArray:
        """Return where the values of queries are whose tables are there."""
        tables = self._table_of[ends]
        ranks = self._ranks[tables, starts]
        return np.where(ranks == self._unknown, 0, self._first[tables] + ranks)

    def _fill(self, starts: IntArray, ends: IntArray, *, with_hops: bool) -> bool:
        """Compute the tables that are missing; where that is too much, discard all and return False."""
        self._is_asked_for_ways |= with_hops
        if not self._fill_distances(starts, ends, with_hops=with_hops):
            return False
        if with_hops:
            lacking = ends[~self._has_hops[self._table_of[ends]]]
            if len(lacking):
                self._add_hops(np.unique(lacking))
        return True

    def _fill_distances(self, starts: IntArray, ends: IntArray, *, with_hops: bool) -> bool:
        lack = self._lack(starts, ends, with_hops=with_hops)
        if not lack.any():
            return True
        is_new = np.zeros(len(self._level), np.bool_)  # by target: a table that is computed again loses what it had
        is_new[ends[lack]] = True
        missing = np.flatnonzero(is_new[ends])
        xy, (starts, ends) = self._streets.columns.xy, (starts[missing], ends[missing])
        straight = np.hypot(*(xy[starts] - xy[ends]).T)
        is_far = straight > self._span[ends]
        self._level[ends[is_far | (with_hops & ~self._has_ways[ends])]] = -1
        self._span[ends[is_far]] = _MARGIN * straight.max()
        for level, detour in enumerate(_DETOURS):
            wanted = np.flatnonzero(self._level[ends] < level)
            targets = np.unique(ends[wanted[self._lack(starts[wanted], ends[wanted], with_hops=with_hops)]])
            cutoff = np.inf if detour == np.inf else detour * self._slope * float(self._span[targets].max(initial=0.0))
            if not self._add(targets, cutoff, level):
                return False
        return True

    def _lack(self, starts: IntArray, ends: IntArray, *, with_hops: bool) -> BoolArray:
        """Return which distances no table has, (queries,), or with hops no table with all nodes on the ways."""
        tables = self._table_of[ends]
        lack: BoolArray = (self._ranks[tables, starts] == self._unknown) | (tables < 0)
        if with_hops:
            lack |= ~self._has_ways[ends]
        return lack

    def _add(self, targets: IntArray, cutoff: float, level: int) -> bool:
        """Compute the tables of some targets, up to a distance; where they do not fit, discard all and return False."""
        arcs, ids = self._arcs, self._streets.columns.node_ids
        size = max(1, _AT_ONCE // (len(ids) + len(arcs.ends)))
        for first in range(0, len(targets), size):
            some = targets[first : first + size]
            lines, rows, far = self._reached(some, cutoff)
            known = self._table_of[some]
            fresh = some[known < 0]
            if self._used + len(rows) > len(self._far):
                self._sizes[known[known >= 0]] = 0
                self._close_gaps()
            if self._tables + len(fresh) > len(self._first) or self._used + len(rows) > len(self._far):
                self._table_of[:], self._level[:], self._span[:], self._tables, self._used = -1, -1, 0.0, 0, 1
                self._has_ways[:] = False
                return False
            self._table_of[fresh] = np.arange(self._tables, self._tables + len(fresh))
            self._level[some] = level
            self._tables += len(fresh)
            tables, values = self._table_of[some], slice(self._used, self._used + len(rows))
            begins = np.searchsorted(lines, np.arange(len(some)))
            ranks = np.full((len(some), len(ids)), self._unknown, self._ranks.dtype)
            ranks[lines, rows] = np.arange(len(rows)) - begins[lines]
            self._ranks[tables], self._first[tables] = ranks, self._used + begins
            self._sizes[tables] = np.diff(begins, append=len(rows))
            self._far[values], self._has_hops[tables] = far, False
            self._used += len(rows)
        return True

    def _reached(self, targets: IntArray, cutoff: float) -> kernels.Reached:
        """Return from where targets are reached: what they span, or, if ways were asked for, all nodes on these."""
        lines, rows, far = found = kernels.reached_from(self._arcs, targets, len(self._table_of), cutoff)
        self._has_ways[targets] |= self._is_asked_for_ways
        if self._has_ways[targets].any():
            self._has_ways[targets] = True
            return found
        (x, y), ends = self._streets.axes, targets[lines]
        kept = np.hypot(x[rows] - x[ends], y[rows] - y[ends]) <= self._span[ends]
        return kernels.Reached(lines[kept], rows[kept], far[kept])

    def _close_gaps(self) -> None:
        """Move the values of tables to where those were of tables that have been computed again for more of the map."""
        self._used = 1
        for table in np.argsort(self._first[: self._tables]).tolist():
            first, size = self._first[table], self._sizes[table]
            for column in (self._far, self._hops):
                column[self._used : self._used + size] = column[first : first + size]
            self._first[table], self._used = self._used, self._used + int(size)

    def _add_hops(self, targets: IntArray) -> None:
        """Compute where the ways to some targets lead, whose distances are known."""
        # NOTE: apart from the distances, because who flees asks for these alone (benchmarks: learning).
        arcs, ids = self._arcs, self._streets.columns.node_ids
        size = max(1, _AT_ONCE // (len(ids) + len(arcs.ends)))
        for first in range(0, len(targets), size):
            some = targets[first : first + size]
            tables = self._table_of[some]
            lines, rows = np.nonzero(self._ranks[tables] != self._unknown)
            values = self._first[tables][lines] + self._ranks[tables[lines], rows]
            reached = kernels.Reached(lines, rows, self._far[values])
            self._hops[values] = self._action_of[kernels.last_arcs(arcs, some, ids, reached)]
            self._has_hops[tables] = True
            self._mark_detours(some)

    def _mark_detours(self, targets: IntArray) -> None:
        """Note from which nodes an edge to a target is not the shortest way there."""
        offsets, order, sources = self._into()
        entries, ends = kernels.chosen_runs(offsets, targets)
        rows = sources[order[entries]]
        lines = np.repeat(np.arange(len(targets)), np.diff(ends))
        goals = targets[lines]
        hops = self._hops[self._values(rows, goals)]
        leads_on = self._streets.ends_of(rows, np.where(hops == self._none, 0, hops)) != goals
        is_detour = (leads_on | (hops == self._none)) & (rows != goals)
        self._leaps[rows[is_detour]] = True

    def _into(self) -> tuple[IntArray, IntArray, IntArray]:
        """Return the entries of `streets.targets` by the node that they lead to, and the node that each leads from."""
        if self._entries is None:
            streets = self._streets
            sources = np.repeat(np.arange(len(streets.counts)), streets.counts)
            self._entries = *kernels.group_rows(streets.targets, len(streets.counts)), sources
        return self._entries


def _has_triangle(streets: Streets) -> BoolArray:
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
