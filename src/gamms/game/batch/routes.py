"""Distances and steps to many targets for many agents at once: tables of one graph, computed as they are asked for."""

from typing import Any

import numpy as np

from gamms import kernels
from gamms.game.batch.columns import BoolArray
from gamms.game.streets import Streets
from gamms.ir.graph import FloatArray, IntArray

_MOST_BYTES = 512 * 2**20  # of tables; 9 for each node and target
_AT_ONCE = 1 << 20  # nodes and edges that are searched at once, in all
_DETOUR = 2.0  # ways that are longer than so many straight lines are looked for on the whole map


class RouteTable:
    """How far it is to targets, and which action leads there: what strategies ask of `ctx.graph`, for arrays.

    A target gets a table of its own when it is first asked for: of the nodes around it, and of the whole map once one
    farther away asks. When there are too many tables, those that were not used for longest are overwritten.

    Args:
        streets: the nodes, and which of them are legal from where.
        weight: of the edges, see `IGraph`.
    """

    def __init__(self, streets: Streets, weight: str | None) -> None:
        self._streets, self._weight = streets, weight
        nodes = len(streets.counts)
        tables = min(nodes, max(1, _MOST_BYTES // (9 * max(nodes, 1))))
        most = int(streets.counts.max(initial=1))
        self._none = int(np.iinfo(np.uint8 if most < 255 else np.int32).max)  # stands for no path
        self._far = np.empty((tables, nodes))  # the system gives memory for what is written alone
        self._hops = np.empty((tables, nodes), np.uint8 if most < 255 else np.int32)  # actions to the next nodes
        self._table_of = np.full(nodes, -1, np.int64)
        self._target_of = np.full(tables, -1, np.int64)
        self._is_whole = np.zeros(tables, np.bool_)
        self._used = np.zeros(tables, np.int64)  # when, in queries
        self._query = 0
        self._leaps = _has_triangle(streets)  # from here, a legal node may come later on the way than the next one
        self._entries: tuple[IntArray, IntArray, IntArray] | None = None

    def distances(self, sources: IntArray, targets: IntArray) -> FloatArray:
        """Return how far it is from nodes to others, as `graph.distance` does; rows that broadcast to one shape."""
        sources, targets = np.broadcast_arrays(sources, targets)
        found = np.empty(sources.shape)
        flat, starts, ends = found.reshape(-1), sources.reshape(-1), targets.reshape(-1)
        for some, tables in self._ready(starts, ends):
            flat[some] = self._far[tables, starts[some]]
        return found

    def actions(self, sources: IntArray, targets: IntArray, allowed: BoolArray | None = None) -> IntArray:
        """Return the actions that lead to targets, as strategies go a step: to the target itself where it is legal.

        Args:
            sources: rows of nodes.
            targets: rows, likewise; both broadcast to one shape.
            allowed: (nodes,) which may be entered, the targets among them; None: all. Where the next one is not, the
                action is to stay.

        Returns:
            Numbers of legal nodes; -1 where there is no path.
        """
        sources, targets = np.broadcast_arrays(sources, targets)
        found = np.empty(sources.shape, np.int64)
        flat, starts, ends = found.reshape(-1), sources.reshape(-1), targets.reshape(-1)
        for some, tables in self._ready(starts, ends):
            flat[some] = self._steps(starts[some], ends[some], tables, allowed)
        return found

    def _steps(self, starts: IntArray, ends: IntArray, tables: IntArray, allowed: BoolArray | None) -> IntArray:
        streets = self._streets
        hops = self._hops[tables, starts]
        has_path = hops != self._none
        actions: IntArray = np.where(has_path, hops, 0).astype(np.int64)
        leaping = np.flatnonzero(self._leaps[starts])
        if len(leaping):
            here, goal, table = starts[leaping], ends[leaping], tables[leaping]
            reached = actions[leaping]
            at, going = streets.step(here, reached), has_path[leaping] & (reached > 0)
            while going.any():  # on, as long as the next node on the way is legal, too
                on = streets.step(at, np.where(going, self._hops[table, at], 0))
                action = streets.action_to(here, on)
                going &= (action >= 0) & (at != goal)
                if allowed is not None:
                    going &= allowed[at] & allowed[on]
                reached, at = np.where(going, action, reached), np.where(going, on, at)
            direct = streets.action_to(here, goal)
            actions[leaping] = np.where(direct >= 0, direct, reached)
            has_path[leaping] |= direct >= 0
        if allowed is not None:
            actions[~allowed[streets.step(starts, actions)]] = 0
        return np.where(has_path, actions, -1)

    # -- tables -------------------------------------------------------------------------------------------------

    def _ready(self, starts: IntArray, ends: IntArray) -> Any:
        """Yield queries whose tables are there, as places in `starts`, with the tables; all in one go, if they fit."""
        self._query += 1
        targets, most = None, len(self._target_of)
        if len(ends) > most:
            targets = np.unique(ends)
        if targets is None or len(targets) <= most:
            some: Any = slice(None)
            yield some, self._tables(starts, ends)
            return
        order = np.argsort(ends, kind="stable")
        for last in range(most, len(targets) + most, most):
            first = np.searchsorted(ends[order], targets[last - most])
            end = np.searchsorted(ends[order], targets[min(last, len(targets)) - 1], side="right")
            some = order[first:end]
            self._query += 1
            yield some, self._tables(starts[some], ends[some])

    def _tables(self, starts: IntArray, ends: IntArray) -> IntArray:
        """Return the tables of some targets, (queries,), with these starts in them."""
        tables = self._table_of[ends]
        lacking = np.flatnonzero(tables < 0)
        if len(lacking):
            self._used[tables[tables >= 0]] = self._query
            xy = self._streets.columns.xy
            with np.errstate(over="ignore", invalid="ignore"):
                straight = np.hypot(*(xy[starts[lacking]] - xy[ends[lacking]]).T).max()
            self._add(np.unique(ends[lacking]), _DETOUR * float(straight))
            tables = self._table_of[ends]
        beyond = np.flatnonzero((self._far[tables, starts] == np.inf) & ~self._is_whole[tables])
        if len(beyond):
            self._add(np.unique(ends[beyond]), np.inf)
        self._used[tables] = self._query
        return tables

    def _add(self, targets: IntArray, cutoff: float) -> None:
        """Compute the tables of some targets, up to a distance."""
        streets, ids = self._streets, self._streets.columns.node_ids
        missing = targets[self._table_of[targets] < 0]
        if len(missing):
            oldest = np.argsort(self._used, kind="stable")[: len(missing)]
            self._table_of[self._target_of[oldest][self._target_of[oldest] >= 0]] = -1
            self._table_of[missing], self._target_of[oldest] = oldest, missing
        size = max(1, _AT_ONCE // (len(ids) + len(streets.columns.edge_ids)))
        for first in range(0, len(targets), size):
            some = targets[first : first + size]
            far, following = streets.queries.tables(ids[some], self._weight, cutoff)
            tables = self._table_of[some]
            hops = np.full(far.shape, self._none, self._hops.dtype)
            lines, rows = np.nonzero(following >= 0)
            hops[lines, rows] = streets.action_to(rows, following[lines, rows])
            hops[np.arange(len(some)), some] = 0
            self._far[tables], self._hops[tables], self._is_whole[tables] = far, hops, cutoff == np.inf
            self._mark_detours(some, following)

    def _mark_detours(self, targets: IntArray, following: IntArray) -> None:
        """Note from which nodes an edge to a target is not the shortest way there."""
        offsets, order, sources = self._into()
        entries, ends = kernels.chosen_runs(offsets, targets)
        rows = sources[order[entries]]
        lines = np.repeat(np.arange(len(targets)), np.diff(ends))
        goals = targets[lines]
        is_detour = (following[lines, rows] != goals) & (rows != goals)
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
    offsets = np.concatenate((streets.offsets, [len(streets.targets)]))
    entries, runs = kernels.chosen_runs(offsets, ends)
    first, second = np.repeat(starts, np.diff(runs)), streets.targets[entries]
    among = np.repeat(ends, np.diff(runs))
    wanted = first * nodes + second
    at = np.searchsorted(keys, wanted)
    is_there = (keys[np.minimum(at, len(keys) - 1)] == wanted) if len(keys) else np.zeros(len(wanted), np.bool_)
    found = np.zeros(nodes, np.bool_)
    found[first[is_there & (second != among)]] = True
    return found
